//! How to record.

use std::collections::BTreeMap;
use std::time::Duration;

use super::RecordingError;

/// Everything that made the run what it is, as keys and values: scenario, seed, scheme, initial state, protocol hash.
///
/// It is written before the first record, so that a killed run has it, and once more at the end.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Configuration(pub(super) BTreeMap<String, String>);

impl Configuration {
    /// An empty configuration.
    pub fn new() -> Configuration {
        Configuration::default()
    }

    /// The configuration with `key` set to `value`, which may be a whole document (TOML, JSON).
    #[must_use]
    pub fn with(mut self, key: impl Into<String>, value: impl ToString) -> Configuration {
        self.0.insert(key.into(), value.to_string());
        self
    }

    /// The value of `key`, if it is set.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(String::as_str)
    }

    /// Keys and values, in order of the keys.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().map(|(key, value)| (key.as_str(), value.as_str()))
    }
}

/// What the times in a recording count from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeBase {
    /// The start of the run is time 0: for virtual time, so that the same run gives the same bytes.
    Virtual,
    /// The start of the run is a moment of the UNIX epoch: for real time.
    Unix {
        /// That moment, ns.
        start_ns: u64,
    },
}

impl TimeBase {
    /// The start of the run, ns of the epoch in use.
    pub const fn start_ns(self) -> u64 {
        match self {
            TimeBase::Virtual => 0,
            TimeBase::Unix { start_ns } => start_ns,
        }
    }
}

/// When what was recorded goes to the file. A run that is killed loses at most what came after the last flush.
#[derive(Clone, Copy, Debug)]
pub enum FlushPolicy {
    /// As soon as this much time has passed since the last flush, give or take the 5 ms at which the writer polls.
    Interval {
        /// The time.
        interval: Duration,
        /// A monotonic clock; only differences count.
        clock: fn() -> Duration,
    },
    /// When the first record of a step this many steps after the last flush comes. The bytes of the file then depend on
    /// the records alone, provided that they all come through one channel.
    Steps(u64),
}

/// How chunks are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// Not at all.
    None,
    /// LZ4 frames.
    Lz4,
}

/// What to do if the file is there already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Refuse with [`RecordingError::Exists`].
    Refuse,
    /// Overwrite it.
    Overwrite,
}

/// How to record.
#[derive(Clone, Debug)]
pub struct Options {
    /// Time from one step to the next, s; finite and positive.
    pub dt_s: f64,
    /// Name of the bus interface, noted with every frame.
    pub interface: String,
    /// What times count from.
    pub time_base: TimeBase,
    /// When what was recorded goes to the file.
    pub flush: FlushPolicy,
    /// How chunks are compressed.
    pub compression: Compression,
    /// What to do if the file is there already.
    pub existing: Existing,
    /// Steps in a full-rate batch, at least 1.
    pub batch_steps: u32,
    /// Every how many steps a message for plotting is written, at least 1.
    pub plot_every_steps: u64,
}

impl Options {
    /// For a run in real time: starts at `start_unix_ns` of the UNIX epoch, flushes every half second of `clock`.
    pub fn real_time(dt_s: f64, interface: &str, start_unix_ns: u64, clock: fn() -> Duration) -> Options {
        Options {
            time_base: TimeBase::Unix { start_ns: start_unix_ns },
            flush: FlushPolicy::Interval { interval: Duration::from_millis(500), clock },
            ..Options::virtual_time(dt_s, interface)
        }
    }

    /// For a run in virtual time: starts at 0, flushes every 1000 steps; the same run gives the same bytes.
    pub fn virtual_time(dt_s: f64, interface: &str) -> Options {
        Options {
            dt_s,
            interface: interface.to_string(),
            time_base: TimeBase::Virtual,
            flush: FlushPolicy::Steps(1000),
            compression: Compression::Lz4,
            existing: Existing::Refuse,
            batch_steps: 100,
            plot_every_steps: 10,
        }
    }

    /// When step `step` was, ns of the epoch in use: start + step·dt, rounded to the nearest nanosecond.
    pub(super) fn time_of_step_ns(&self, step: u64) -> u64 {
        self.time_base.start_ns().saturating_add(libm::round(step as f64 * self.dt_s * 1e9) as u64)
    }

    /// Refuses values that make no sense.
    pub(super) fn check(&self) -> Result<(), RecordingError> {
        let at_least_one = "at least 1";
        let dt = self.dt_s.is_finite() && self.dt_s > 0.0;
        let checks = [
            ("dt_s", dt, self.dt_s.to_string(), "a finite time above 0 s"),
            ("batch_steps", self.batch_steps > 0, self.batch_steps.to_string(), at_least_one),
            ("plot_every_steps", self.plot_every_steps > 0, self.plot_every_steps.to_string(), at_least_one),
            ("flush", !matches!(self.flush, FlushPolicy::Steps(0)), String::from("every 0 steps"), at_least_one),
        ];
        match checks.into_iter().find(|(_, holds, _, _)| !holds) {
            Some((option, _, got, expected)) => Err(RecordingError::Option { option, got, expected }),
            None => Ok(()),
        }
    }
}
