//! Pacing: simulated time is held to the clock, by waits of the plant alone.
//!
//! At speed v, sample k is due v times as fast as it is sampled:
//!
//! ```text
//!     due(k) = anchor + (k − k₀) / (rate · v)
//! ```
//!
//! A run in simulated time skips or changes no sample for being late: it is processed as soon as the machine gets to
//! it, and the lag of simulated time behind the clock is reported.

use serde::Serialize;
use thiserror::Error;

use resonarm_numeric::number::{rounded, short};
use resonarm_realtime::{Clock, HistogramError, LatencyHistogram, Percentiles, SampleRate};

/// Simulated seconds a second; 0 is as fast as possible.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Speed(f64);

impl Speed {
    /// As fast as possible.
    pub const UNPACED: Speed = Speed(0.0);
    /// One simulated second per second of the clock.
    pub const ACTUAL: Speed = Speed(1.0);

    /// A speed of `times` simulated seconds a second, or 0.
    ///
    /// # Errors
    /// [`SpeedError::Value`] if it is negative or not a finite number.
    pub fn new(times: f64) -> Result<Speed, SpeedError> {
        if times.is_finite() && times >= 0.0 { Ok(Speed(times)) } else { Err(SpeedError::Value { got: times }) }
    }

    /// Returns the simulated seconds a second, or 0.
    pub const fn times(self) -> f64 {
        self.0
    }

    /// Says whether the run waits for the clock.
    pub fn is_paced(self) -> bool {
        self.0 > 0.0
    }

    /// Returns the length of a sample period on the clock, s; 0 if the run does not wait for it.
    pub(super) fn period_s(self, rate: SampleRate) -> f64 {
        if self.is_paced() { 1.0 / (rate.rate_hz() * self.0) } else { 0.0 }
    }
}

/// The progress of simulated time against the clock.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pacing {
    /// Simulated seconds a second that were requested.
    pub speed: f64,
    /// Lag of simulated time behind the clock at the last sample, s of the clock.
    pub lag_s: f64,
    /// Largest lag behind the clock, s.
    pub longest_lag_s: f64,
}

/// Error of a speed that a run can't have.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SpeedError {
    /// The speed is not a finite number from 0 on.
    #[error("the speed is {got}: it must be a positive number of simulated seconds a second, or 0 for as fast as possible", got = short(.got))]
    Value {
        /// Speed that was requested.
        got: f64,
    },
    /// A run in real time always has the speed of the clock.
    #[error("the speed is {got}, but a run in real time has the speed of the clock; use the mode lockstep or free", got = short(.got))]
    RealTime {
        /// Speed that was requested.
        got: f64,
    },
    /// A sample takes so long that the partner would consider the plant lost.
    #[error(
        "the speed is {got:e}: a sample would take {period_s} s, but may take at most half of `network.lockstep_timeout_s` \
         ({timeout_s} s), or each end considers the other lost; the speed must be at least {least:.1e}",
        period_s = rounded(.period_s, 3), timeout_s = short(.timeout_s)
    )]
    TooSlow {
        /// Speed that was requested.
        got: f64,
        /// The duration of a sample, s.
        period_s: f64,
        /// The time for which each end waits for the other, s.
        timeout_s: f64,
        /// Smallest speed that is possible.
        least: f64,
    },
}

/// Holds simulated time to a clock.
#[derive(Debug)]
pub(super) struct Pace<'c, C: Clock> {
    /// The clock to which the run is held.
    pub clock: &'c C,
    rate: SampleRate,
    speed: Speed,
    /// Start of the run on the clock, from which its times count, ns.
    pub start_ns: u64,
    /// A sample, and the time at which it is due.
    anchor: (u64, u64),
    late: LatencyHistogram,
    /// Delay of the sample noted last, ns; 0 if the run does not wait for the clock.
    pub lag_ns: u64,
    longest_lag_ns: u64,
}

impl<'c, C: Clock> Pace<'c, C> {
    /// Starts a pace for a run that begins now.
    pub fn start(clock: &'c C, rate: SampleRate, speed: Speed) -> Result<Self, HistogramError> {
        Pace::start_at(clock, clock.now_ns(), rate, speed)
    }

    /// Starts a pace for a run that begins at `start_ns` on the clock.
    pub fn start_at(clock: &'c C, start_ns: u64, rate: SampleRate, speed: Speed) -> Result<Self, HistogramError> {
        let late = LatencyHistogram::new()?;
        Ok(Pace { clock, rate, speed, start_ns, anchor: (0, start_ns), late, lag_ns: 0, longest_lag_ns: 0 })
    }

    /// Returns the run's time, ns.
    pub fn now_ns(&self) -> u64 {
        self.clock.now_ns().saturating_sub(self.start_ns)
    }

    /// Restarts the schedule: `sample` is due now, and the others count from there at the speed.
    pub fn anchor(&mut self, sample: u64) {
        self.anchor = (sample, self.clock.now_ns());
    }

    /// Returns the time on the clock at which `sample` is due, ns; `None` if the run does not wait for the clock.
    fn due_ns(&self, sample: u64) -> Option<u64> {
        // Counted from the anchor and not from the sample before, so that no rounding and no delay adds up.
        let offset_ns = self.rate.offset_ns(sample.saturating_sub(self.anchor.0)) as f64 / self.speed.0;
        self.speed.is_paced().then(|| self.anchor.1.saturating_add(offset_ns as u64))
    }

    /// Returns the time until `sample` is due, ns.
    pub fn left_ns(&self, sample: u64) -> u64 {
        self.due_ns(sample).map_or(0, |due_ns| due_ns.saturating_sub(self.clock.now_ns()))
    }

    /// Sleeps until `sample` is due.
    pub fn sleep(&self, sample: u64) {
        let left_ns = self.left_ns(sample);
        if left_ns > 0 {
            self.clock.sleep_until_ns(self.clock.now_ns() + left_ns);
        }
    }

    /// Notes that `sample` is processed now, and its delay.
    pub fn note(&mut self, sample: u64) {
        let Some(due_ns) = self.due_ns(sample) else { return };
        self.lag_ns = self.clock.now_ns().saturating_sub(due_ns);
        self.longest_lag_ns = self.longest_lag_ns.max(self.lag_ns);
        self.late.record(self.lag_ns);
    }

    /// Returns the delays of the samples; `None` if the run did not wait for the clock.
    pub fn wakeup_us(&self) -> Option<Percentiles> {
        self.late.percentiles()
    }

    /// Returns how simulated time kept up with the clock; `None` if the run did not wait for it.
    pub fn report(&self) -> Option<Pacing> {
        let lag_s = self.lag_ns as f64 * 1e-9;
        let longest_lag_s = self.longest_lag_ns as f64 * 1e-9;
        self.speed.is_paced().then_some(Pacing { speed: self.speed.0, lag_s, longest_lag_s })
    }
}
