//! Options of a recording: format, compression, and what happens to an existing file.

use std::time::Duration;

use super::channels::Channels;
use super::error::RecordingError;
use super::summary::RunTime;
use crate::staged::Existing;
use resonarm_numeric::number::short;

/// The times at which records are flushed to the file. A run that is killed loses at most the records after the last
/// flush.
#[derive(Clone, Copy, Debug)]
pub enum FlushPolicy {
    /// Flushes when this much time has passed since the last flush, give or take the 5 ms at which the writer polls.
    Interval {
        /// Time between two flushes.
        interval: Duration,
        /// A monotonic clock; only differences count.
        clock: fn() -> Duration,
    },
    /// Flushes at the first record of a sample this many samples after the last flush. The bytes of the file then
    /// depend on the records alone, provided that they all come through one channel.
    Samples(u64),
}

/// The compression of chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// Chunks are written without compression.
    None,
    /// Zstandard (RFC 8878), one frame a chunk.
    Zstd,
}

/// The time at which the file gets its name. If the recorder is dropped before, the file is removed, and an existing
/// file stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Naming {
    /// The file gets its name at the first record: a run that is killed leaves the flushed records.
    FirstRecord,
    /// The file gets its name when it is complete: for recordings made from others, which can be made again.
    Whole,
}

/// Options with which a recording is written.
#[derive(Clone, Debug)]
pub struct Options {
    /// Time from one sample to the next, s; finite and positive.
    pub dt_s: f64,
    /// Name of the bus interface, noted with every frame.
    pub interface: String,
    /// The origin of times.
    pub time: RunTime,
    /// Time at which the monotonic clock of the run loop read 0, ns of the UNIX epoch; `None` for simulated time alone.
    /// With what the clock read at the start of the run ([`Channel::begin`](super::Channel::begin)) that gives the
    /// moment at which the run began.
    pub clock_epoch_unix_ns: Option<u64>,
    /// The times at which records are flushed to the file.
    pub flush: FlushPolicy,
    /// The compression of chunks.
    pub compression: Compression,
    /// The action if the file already exists.
    pub existing: Existing,
    /// The time at which the file gets its name.
    pub naming: Naming,
    /// Samples in a batch, from 1 to 100000.
    pub batch_samples: u32,
    /// Interval of the messages in the plotting topics, in samples, at most 1000: 1 is every sample, unfiltered, 0
    /// none. From 2 on they are filtered against aliases, as `docs/recording.md` states.
    pub plot_every_samples: u64,
    /// Delay of a reading against its sample, in samples, 0 or more: noted in the file. By default 0.5.
    pub reading_delay_samples: f64,
    /// Channels of states and readings. By default the arm's, without the coil of a shaker.
    pub channels: Channels,
}

impl Options {
    /// Options for a run in real time: `clock` read 0 at `clock_epoch_unix_ns` of the UNIX epoch; flushes every half
    /// second of it.
    pub fn real_time(dt_s: f64, interface: &str, clock_epoch_unix_ns: u64, clock: fn() -> Duration) -> Options {
        Options {
            time: RunTime::RealTime,
            clock_epoch_unix_ns: Some(clock_epoch_unix_ns),
            flush: FlushPolicy::Interval { interval: Duration::from_millis(500), clock },
            ..Options::virtual_time(dt_s, interface)
        }
    }

    /// Options for a run in lockstep: as [`Options::real_time`], but log times count from 0.
    pub fn lockstep(dt_s: f64, interface: &str, clock_epoch_unix_ns: u64, clock: fn() -> Duration) -> Options {
        Options { time: RunTime::Lockstep, ..Options::real_time(dt_s, interface, clock_epoch_unix_ns, clock) }
    }

    /// Options for a run of simulated time alone: starts at 0, flushes every 1000 samples; the same run produces
    /// identical bytes.
    pub fn virtual_time(dt_s: f64, interface: &str) -> Options {
        Options {
            dt_s,
            interface: interface.to_string(),
            time: RunTime::Simulated,
            clock_epoch_unix_ns: None,
            flush: FlushPolicy::Samples(1000),
            compression: Compression::Zstd,
            existing: Existing::Refuse,
            naming: Naming::FirstRecord,
            batch_samples: 500,
            plot_every_samples: 10,
            reading_delay_samples: 0.5,
            channels: Channels::arm(false),
        }
    }

    /// Returns the simulated time of a sample, ns from the start of the run: sample·dt, rounded to the nearest
    /// nanosecond.
    pub(super) fn simulated_ns(&self, sample: u64) -> u64 {
        libm::round(sample as f64 * self.dt_s * 1e9) as u64
    }

    /// Rejects values that are out of their ranges.
    pub(super) fn check(&self) -> Result<(), RecordingError> {
        // A batch of so many takes some 10 MB, far less than a chunk may.
        const MOST_IN_A_BATCH: u32 = 100_000;
        let at_least_one = "at least 1";
        let dt = self.dt_s.is_finite() && self.dt_s > 0.0;
        let checks = [
            ("dt_s", dt, short(&self.dt_s).to_string(), "a finite time above 0 s"),
            (
                "batch_samples",
                (1..=MOST_IN_A_BATCH).contains(&self.batch_samples),
                self.batch_samples.to_string(),
                "from 1 to 100000",
            ),
            (
                "plot_every_samples",
                self.plot_every_samples <= 1000,
                self.plot_every_samples.to_string(),
                "at most 1000",
            ),
            (
                "reading_delay_samples",
                self.reading_delay_samples.is_finite() && self.reading_delay_samples >= 0.0,
                short(&self.reading_delay_samples).to_string(),
                "a finite number, 0 or more",
            ),
            ("flush", !matches!(self.flush, FlushPolicy::Samples(0)), String::from("every 0 samples"), at_least_one),
        ];
        match checks.into_iter().find(|(_, holds, _, _)| !holds) {
            Some((option, _, got, expected)) => Err(RecordingError::Option { option, got, expected }),
            None => Ok(()),
        }
    }
}
