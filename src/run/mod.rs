//! The run loops: real time, lockstep and free, all driving the same nodes through the same steps.
//!
//! One sample, whatever the loop:
//!
//! ```text
//! measure(k) → frames out → frames in, until the deadline → command held (zero-order) → advance to k + 1
//! ```
//!
//! - [`real_time`]: samples at absolute deadlines of the monotonic clock; whatever came in by then counts.
//! - [`lockstep`]: virtual time; an armed plant waits for the command that answers the sample before it advances.
//! - [`free`]: virtual time and no bus: plant and exciter in one loop, as fast as it goes.
//!
//! For the same commands the three give the same states, bit for bit.

mod error;
mod exciter;
mod free;
mod lockstep;
mod plant_side;
mod real_time;
mod tape;

pub use error::RunError;
pub use exciter::{ExciterReport, exciter};
pub use free::{FreeReport, free};
pub use lockstep::lockstep;
pub use plant_side::{Counts, PlantSide};
pub use real_time::{RealTimeOptions, real_time};
pub use tape::Tape;

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use serde::Serialize;

use crate::bus::Statistics;
use crate::protocol::Emergency;
use crate::realtime::LoopSummary;

/// When a run ends by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct End {
    /// After this many samples.
    pub after_samples: Option<u64>,
    /// When an armed plant is disarmed or faults.
    pub on_disarm: bool,
}

/// What the run's threads and the rest of the program tell each other.
#[derive(Debug, Default)]
pub struct Signals {
    stop: AtomicBool,
    step: AtomicU64,
}

impl Signals {
    /// Asks the run to end.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Whether the run was asked to end.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// The sample at which the run is.
    pub fn step(&self) -> u64 {
        self.step.load(Ordering::Relaxed)
    }

    pub(crate) fn set_step(&self, step: u64) {
        self.step.store(step, Ordering::Relaxed);
    }
}

/// What a plant's run came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlantReport {
    /// Samples, overruns and latencies. Out of real time nothing is late and there are no wake-ups.
    #[serde(flatten)]
    pub timing: LoopSummary,
    /// What the bus and the protocol's checks counted.
    pub bus: BusCounts,
    /// The fault that was latched at the end.
    #[serde(skip)]
    pub fault: Option<Emergency>,
}

/// What the bus and the protocol's checks counted, in frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct BusCounts {
    /// Frames received.
    pub received: u64,
    /// Frames sent.
    pub sent: u64,
    /// Frames lost: incoming ones because the receive queue was full, outgoing ones because they could not be sent in time.
    pub dropped: u64,
    /// Frames of the protocol refused for their checks (E2E, length, values).
    pub e2e_errors: u64,
}

impl BusCounts {
    fn new(statistics: Statistics, counts: Counts) -> BusCounts {
        BusCounts {
            received: statistics.received,
            sent: statistics.sent,
            dropped: statistics.dropped + counts.unsent_frames,
            e2e_errors: counts.refused_frames,
        }
    }
}

#[cfg(test)]
mod tests;
