//! The acting load: held from one command to the next, and ramped to zero at the end.

use crate::rig::Load;

/// The load that acts on the structure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hold {
    load: Load,
    ramp_from: Load,
    ramp_left: u64,
    ramp_samples: u64,
}

impl Hold {
    /// Returns a hold without a load; a ramp takes `ramp_samples` samples, at least 1.
    pub fn new(ramp_samples: u64) -> Hold {
        let zero = Load::default();
        // With 0 samples `release` would start no ramp, and the load would act for ever.
        Hold { load: zero, ramp_from: zero, ramp_left: 0, ramp_samples: ramp_samples.max(1) }
    }

    /// Holds the load of a command.
    pub fn take(&mut self, load: Load) {
        self.load = load;
        self.ramp_left = 0;
    }

    /// Starts the ramp, if a load is held and none runs.
    pub fn release(&mut self) {
        // A second release must not start the ramp anew, or the load would last longer.
        if self.ramp_left == 0 && self.load != Load::default() {
            self.ramp_from = self.load;
            self.ramp_left = self.ramp_samples;
        }
    }

    /// Returns the load of the next sample period, one step down a running ramp.
    pub fn next(&mut self) -> Load {
        if self.ramp_left > 0 {
            self.ramp_left -= 1;
            self.load = match self.ramp_left {
                // Exactly zero at the end, without the rounding of a factor.
                0 => Load::default(),
                left => self.ramp_from.scaled(left as f64 / self.ramp_samples as f64),
            };
        }
        self.load
    }

    /// Returns the load that is held now.
    pub fn load(&self) -> &Load {
        &self.load
    }

    /// Returns the number of samples until the ramp ends; 0 if none runs.
    pub fn ramp_left(&self) -> u64 {
        self.ramp_left
    }
}
