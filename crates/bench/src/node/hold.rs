//! The load that acts: held from command to command, and its ramp to zero.

use crate::rig::Load;

/// The load that acts.
///
/// Released, it goes to zero in n equal steps, one a sample: (n−1)/n, (n−2)/n … 0 of the held load. A new command ends
/// the ramp.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hold {
    load: Load,
    ramp_from: Load,
    ramp_left: u64,
    ramp_samples: u64,
}

impl Hold {
    /// Holds nothing; a ramp takes `ramp_samples` samples, at least 1.
    pub fn new(ramp_samples: u64) -> Hold {
        let zero = Load::default();
        Hold { load: zero, ramp_from: zero, ramp_left: 0, ramp_samples: ramp_samples.max(1) }
    }

    /// Holds a command's load.
    pub fn take(&mut self, load: Load) {
        self.load = load;
        self.ramp_left = 0;
    }

    /// Starts the ramp, if a load is held and none runs.
    pub fn release(&mut self) {
        if self.ramp_left == 0 && self.load != Load::default() {
            self.ramp_from = self.load;
            self.ramp_left = self.ramp_samples;
        }
    }

    /// Drops the load at once.
    pub fn drop_load(&mut self) {
        self.take(Load::default());
    }

    /// The load of the next sample period: one step down the ramp, if one runs.
    pub fn next(&mut self) -> Load {
        if self.ramp_left > 0 {
            self.ramp_left -= 1;
            self.load = match self.ramp_left {
                0 => Load::default(),
                left => self.ramp_from.scaled(left as f64 / self.ramp_samples as f64),
            };
        }
        self.load
    }

    /// The load held now.
    pub fn load(&self) -> &Load {
        &self.load
    }

    /// Samples until the ramp ends; 0 if none runs.
    pub fn ramp_left(&self) -> u64 {
        self.ramp_left
    }
}
