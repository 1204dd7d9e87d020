//! Errors of the integrators: rates that don't fit, and steps that can't be made.

use thiserror::Error;

use super::scheme::Scheme;
use resonarm_numeric::number::short;

/// Error of an integrator that can't start or make a step.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum IntegrateError {
    /// The rate is not a positive number.
    #[error("the integration rate is {got_hz} Hz: it must be a positive number", got_hz = short(.got_hz))]
    Rate {
        /// Rate that was given, Hz.
        got_hz: f64,
    },
    /// Steps so short that rounding outweighs the change they make.
    #[error(
        "the integration rate is {got_hz:e} Hz: it must be at most {most_hz:e} Hz for this structure, since the \
         changes over a shorter step are lost in rounding"
    )]
    RateTooHigh {
        /// Rate that was given, Hz.
        got_hz: f64,
        /// The highest rate that would do, Hz.
        most_hz: f64,
    },
    /// The scheme is unstable at this rate, or makes less than one step a period.
    #[error(
        "scheme {scheme} is too coarse for this structure at {got_hz} Hz: its fastest mode needs a rate of at least {needed_hz} Hz",
        got_hz = short(.got_hz), needed_hz = short(.needed_hz)
    )]
    RateTooLow {
        /// Scheme that was chosen.
        scheme: Scheme,
        /// Rate that was given, Hz.
        got_hz: f64,
        /// The lowest rate that would do, Hz.
        needed_hz: f64,
    },
    /// Newton's method did not solve the stages of an implicit scheme.
    #[error(
        "the stages of the step at t = {t_s} s did not converge in {iterations} Newton iterations (last relative \
         correction {correction:.1e}): raise the rate, or check for a load that is too large for the structure", t_s = short(.t_s)
    )]
    NoConvergence {
        /// Start of the step, s.
        t_s: f64,
        /// Number of iterations made.
        iterations: usize,
        /// The last relative correction of the stage accelerations.
        correction: f64,
    },
    /// A step makes or loses energy that neither load nor dampers account for.
    #[error(
        "the step at t = {t_s} s changes the energy by a part of {defect:.1e} beyond the work done, even when divided into the smallest parts: \
         raise the rate, or check for a load that is too large for the structure", t_s = short(.t_s)
    )]
    Unbalanced {
        /// Start of the part of the step, s.
        t_s: f64,
        /// The unaccounted energy over the energy.
        defect: f64,
    },
    /// The new state is infinite or not a number.
    #[error("the state at t = {t_s} s is not finite: raise the rate, or check for a load that is too large for the structure", t_s = short(.t_s))]
    NotFinite {
        /// End of the step, s.
        t_s: f64,
    },
}
