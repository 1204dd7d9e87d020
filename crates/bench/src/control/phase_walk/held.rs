//! The recently held loads: a reading arrives later than the hold that it reads.

use crate::rig::converter::MOST_ORDER;

/// The loads of the last holds, the latest first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Held([f64; MOST_ORDER]);

impl Held {
    /// Begins a hold with a load.
    pub fn hold(&mut self, load: f64) {
        self.0.rotate_right(1);
        self.0[0] = load;
    }

    /// Holds the last load for `samples` samples more.
    pub fn hold_on(&mut self, samples: u64) {
        (0..samples.min(MOST_ORDER as u64)).for_each(|_| self.hold(self.last()));
    }

    /// The load of the last hold.
    pub fn last(&self) -> f64 {
        self.0[0]
    }

    /// The load of the hold that began `holds` holds before the last, at most four.
    pub fn before(&self, holds: usize) -> f64 {
        self.0[holds]
    }
}
