//! Fixed-step one-step methods for the arm. No allocation; bounded work per step.
//!
//! A step from tₙ to tₙ + h sees the load through [`Excitation`], at the times its stages ask for: a held command is the
//! same at all of them (zero-order hold), a sine is exact inside the step.

mod error;
mod gauss_legendre;
mod runge_kutta;
mod scheme;

pub use error::IntegrateError;
pub use scheme::{Scheme, UnknownScheme};

use crate::arm::{Arm, Load, State};

/// The load as a function of time.
pub trait Excitation {
    /// The load at the time `t_s`, s since the start of the simulation.
    fn load(&self, t_s: f64) -> Load;
}

/// A load held over the step.
impl Excitation for Load {
    fn load(&self, _t_s: f64) -> Load {
        *self
    }
}

/// amplitude · sin(2πft): the excitation of Eqs. (31) and (32).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sine {
    /// The load at the crest.
    pub amplitude: Load,
    /// f, Hz.
    pub frequency_hz: f64,
}

impl Excitation for Sine {
    fn load(&self, t_s: f64) -> Load {
        self.amplitude.scaled(libm::sin(core::f64::consts::TAU * (self.frequency_hz * t_s)))
    }
}

/// A scheme with a step that it can carry for a given arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integrator {
    scheme: Scheme,
    step_s: f64,
}

impl Integrator {
    /// Checks that the scheme is stable for `arm` at `rate_hz` steps a second.
    ///
    /// # Errors
    /// [`IntegrateError::Rate`] if the rate is not a positive number, [`IntegrateError::RateTooLow`] with the rate that
    /// would do if the scheme can't carry the arm's second mode at this rate.
    pub fn new(scheme: Scheme, rate_hz: f64, arm: &Arm) -> Result<Integrator, IntegrateError> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(IntegrateError::Rate { got_hz: rate_hz });
        }
        let fastest_rad_s = arm.angular_frequencies_rad_s()[1];
        let needed_hz = libm::ceil(fastest_rad_s / scheme.phase_limit_rad());
        if rate_hz < needed_hz {
            return Err(IntegrateError::RateTooLow { scheme, got_hz: rate_hz, needed_hz });
        }
        Ok(Integrator { scheme, step_s: 1.0 / rate_hz })
    }

    /// The scheme.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The step h, s.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The state one step after `state`, which is at the time `t_s`.
    ///
    /// # Errors
    /// [`IntegrateError::NoConvergence`] if the stages of an implicit scheme could not be solved,
    /// [`IntegrateError::NotFinite`] if the result is not a number. The state given stays what it was.
    pub fn step(
        &self,
        arm: &Arm,
        t_s: f64,
        state: &State,
        excitation: &impl Excitation,
    ) -> Result<State, IntegrateError> {
        let next = match self.scheme {
            Scheme::Rk4 => runge_kutta::step(arm, t_s, self.step_s, state, excitation),
            Scheme::Gl4 => gauss_legendre::step(&gauss_legendre::GL4, arm, t_s, self.step_s, state, excitation)?,
            Scheme::Gl6 => gauss_legendre::step(&gauss_legendre::GL6, arm, t_s, self.step_s, state, excitation)?,
        };
        if next.is_finite() { Ok(next) } else { Err(IntegrateError::NotFinite { t_s: t_s + self.step_s }) }
    }
}

#[cfg(test)]
mod tests;
