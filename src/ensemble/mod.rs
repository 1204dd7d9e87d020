//! Many independent arms at once: side by side in the lanes of the processor, and in groups over the cores.
//!
//! A call that makes many steps is faster than many calls: it takes each group of arms through all its steps in registers.
//!
//! Every arm moves as if it were alone: the step is the same source as [`Integrator::step`](crate::integrate::Integrator::step)
//! makes, generic over one number or several, so the states are the same bit for bit, whatever the processor offers.

mod lanes;
#[cfg(feature = "std")]
mod threads;

use alloc::vec::Vec;

use thiserror::Error;

use crate::arm::kernel::{Coefficients, Motion};
use crate::arm::{Arm, State};
use crate::integrate::{Excitation, IntegrateError, Integrator, Scheme};

/// Why an ensemble can't be made, or an arm of it can't go on.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EnsembleError {
    /// The scheme has no form for lanes.
    #[error("scheme {scheme} does not go side by side: an ensemble takes rk4")]
    Scheme {
        /// The scheme.
        scheme: Scheme,
    },
    /// Arms, states and excitations differ in number.
    #[error("an ensemble of {arms} arms was given {got} {what}: it needs one for each arm")]
    Count {
        /// Number of arms.
        arms: usize,
        /// What differs: `states` or `excitations`.
        what: &'static str,
        /// Its number.
        got: usize,
    },
    /// An arm can't be integrated.
    #[error("arm {index} of the ensemble: {source}")]
    Arm {
        /// The arm, from 0.
        index: usize,
        /// What the integrator says.
        source: IntegrateError,
    },
}

/// Independent arms that advance together.
#[derive(Clone, Debug)]
pub struct Ensemble {
    arms: Vec<Coefficients<f64>>,
    motions: Vec<Motion<f64>>,
    step_s: f64,
    time_step: u64,
}

impl Ensemble {
    /// The arms at t = 0, each with its state; every arm takes `rate_hz` steps a second of `scheme`, which must
    /// be `rk4`: the others need too many numbers at a time for the registers, or a different number of iterations for each arm.
    ///
    /// # Errors
    /// [`EnsembleError::Scheme`] if the scheme is another, [`EnsembleError::Count`] if there is not one state for each arm,
    /// [`EnsembleError::Arm`] if the scheme can't carry an arm at this rate.
    pub fn new(scheme: Scheme, rate_hz: f64, arms: &[Arm], states: &[State]) -> Result<Ensemble, EnsembleError> {
        if scheme != Scheme::Rk4 {
            return Err(EnsembleError::Scheme { scheme });
        }
        same_count(arms.len(), "states", states.len())?;
        for (index, arm) in arms.iter().enumerate() {
            Integrator::new(scheme, rate_hz, arm).map_err(|source| EnsembleError::Arm { index, source })?;
        }
        Ok(Ensemble {
            arms: arms.iter().map(|arm| arm.coefficients).collect(),
            motions: states.iter().map(Motion::from).collect(),
            step_s: 1.0 / rate_hz,
            time_step: 0,
        })
    }

    /// The number of arms.
    pub fn len(&self) -> usize {
        self.arms.len()
    }

    /// Whether there is no arm.
    pub fn is_empty(&self) -> bool {
        self.arms.is_empty()
    }

    /// t = steps made / rate, s.
    pub fn time_s(&self) -> f64 {
        self.stretch(0).time_s(0)
    }

    /// The state of every arm, in the order in which they were given.
    pub fn states(&self) -> Vec<State> {
        self.motions.iter().copied().map(State::from).collect()
    }

    /// Advances every arm by `steps` steps under its own excitation, on the calling thread.
    ///
    /// # Errors
    /// [`EnsembleError::Count`] if there is not one excitation for each arm; [`EnsembleError::Arm`] with the first arm whose state
    /// is no longer finite: the ensemble then is at the end of the steps all the same.
    pub fn advance<E: Excitation>(&mut self, steps: u32, excitations: &[E]) -> Result<(), EnsembleError> {
        same_count(self.arms.len(), "excitations", excitations.len())?;
        let stretch = self.stretch(steps);
        stretch.advance(&self.arms, &mut self.motions, excitations);
        self.finish(steps)
    }

    fn stretch(&self, steps: u32) -> Stretch {
        Stretch { first_step: self.time_step, steps, step_s: self.step_s }
    }

    fn finish(&mut self, steps: u32) -> Result<(), EnsembleError> {
        self.time_step += u64::from(steps);
        match self.states().iter().position(|state| !state.is_finite()) {
            None => Ok(()),
            Some(index) => Err(EnsembleError::Arm { index, source: IntegrateError::NotFinite { t_s: self.time_s() } }),
        }
    }
}

/// Steps to make, and where in time they begin.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    first_step: u64,
    steps: u32,
    step_s: f64,
}

impl Stretch {
    /// Start of the step `k`, s.
    fn time_s(self, k: u32) -> f64 {
        (self.first_step + u64::from(k)) as f64 * self.step_s
    }
}

fn same_count(arms: usize, what: &'static str, got: usize) -> Result<(), EnsembleError> {
    if got == arms { Ok(()) } else { Err(EnsembleError::Count { arms, what, got }) }
}

#[cfg(test)]
mod tests;
