//! The loads of the last holds. They are kept because a reading arrives later than the hold that it belongs to.

use crate::rig::converter::MOST_ORDER;

/// Loads of the last holds, the latest first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Held([f64; MOST_ORDER]);

impl Held {
    /// Starts a hold of a load.
    pub fn hold(&mut self, load: f64) {
        // Five numbers at most, so moving them is cheaper than a ring with an index.
        self.0.rotate_right(1);
        self.0[0] = load;
    }

    /// Continues the last load for `samples` more samples.
    pub fn hold_on(&mut self, samples: u64) {
        // More holds than are stored would only repeat the same load.
        (0..samples.min(MOST_ORDER as u64)).for_each(|_| self.hold(self.last()));
    }

    /// Returns the load of the last hold.
    pub fn last(&self) -> f64 {
        self.0[0]
    }

    /// Returns the load of the hold that began `holds` holds before the last, at most four.
    pub fn before(&self, holds: usize) -> f64 {
        self.0[holds]
    }
}
