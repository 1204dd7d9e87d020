//! Loads on the arm as functions of time.

use super::Load;
use crate::integrate::Excitation;

/// A load held over the step.
impl Excitation<Load> for Load {
    fn load(&self, _t_s: f64) -> Load {
        *self
    }

    fn is_constant(&self) -> bool {
        true
    }
}

/// amplitude · sin(2πft): the excitation of Eqs. (31) and (32).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sine {
    /// The peak load.
    pub amplitude: Load,
    /// f, Hz.
    pub frequency_hz: f64,
}

impl Excitation<Load> for Sine {
    #[inline]
    fn load(&self, t_s: f64) -> Load {
        self.amplitude.scaled(libm::sin(core::f64::consts::TAU * (self.frequency_hz * t_s)))
    }
}
