//! Errors of stepping a structure beyond those of its integrator.

use thiserror::Error;

use crate::integrate::IntegrateError;
use resonarm_numeric::number::short;

/// Error of a structure that can't be stepped, or can't make a step.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StepError {
    /// The elements, as stiff or as fast as they are where the step starts, need more parts of it than are made.
    #[error(
        "the step at t = {t_s} s needs more than {most} parts for the stiffness of the elements: raise the \
         integration rate to at least {needed_hz} Hz, or check for an element that is far too stiff",
        t_s = short(.t_s), needed_hz = short(.needed_hz)
    )]
    TooStiff {
        /// Start of the step, s; 0 before the first.
        t_s: f64,
        /// Most parts of a step.
        most: u32,
        /// The lowest rate that would do, Hz.
        needed_hz: f64,
    },
    /// The current of a shaker's coil follows the voltage too fast.
    #[error(
        "the current of the shaker's coil follows the voltage too fast for the step: `inductance_h` is {got_h}; it \
         must be at least {least_h}, or 0 for a current that follows at once", got_h = short(.got_h), least_h = short(.least_h)
    )]
    Coil {
        /// The given inductance, H.
        got_h: f64,
        /// The least valid one but zero, H.
        least_h: f64,
    },
    /// A load that varies over a step, on a shaker.
    #[error("the shaker's command varies within the step: expected a load that is held over the step")]
    NotHeld,
    /// Too many harmonics of a periodic load.
    #[error("the load has {got} harmonics: it can have at most {most}")]
    Harmonics {
        /// Number of harmonics given.
        got: usize,
        /// The most harmonics that a load may have.
        most: usize,
    },
    /// The rate does not fit, the integrator can't make the step, or the new state is not finite.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// Another number of loads than the drive has degrees of freedom.
    #[error("got {got} loads: expected {expected}, one for each degree of freedom of the drive")]
    Loads {
        /// Number of loads given.
        got: usize,
        /// The number of degrees of freedom.
        expected: usize,
    },
    /// Numbers that are not a saved state of this structure.
    #[error("the saved state has {got} finite numbers: expected {states}, or {all} with the branches of the elements")]
    Saved {
        /// Numbers given, up to the first that is not finite.
        got: usize,
        /// The number of states.
        states: usize,
        /// The length of a whole saved state, [`Stepper::saved_len`](super::Stepper::saved_len).
        all: usize,
    },
}
