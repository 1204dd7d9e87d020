//! Errors of integration in time.

use thiserror::Error;

use resonarm_dynamics::integrate::IntegrateError;
use resonarm_dynamics::structure::{StepError, StructureError};
use resonarm_numeric::number::short;

/// Error of the integration of a forced structure in time.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TimeDomainError {
    /// The excitation has no period.
    #[error("excitation frequency {got_hz} Hz: it must be a positive number", got_hz = short(.got_hz))]
    Frequency {
        /// The given value, Hz.
        got_hz: f64,
    },
    /// A period of the excitation has too many steps.
    #[error(
        "at an excitation frequency of {got_hz} Hz, a period would take {steps:.1e} steps, more than {most}; choose at least \
         {lowest_hz:.2e} Hz, where the response is quasi-static", got_hz = short(.got_hz))]
    FrequencyTooLow {
        /// The given value, Hz.
        got_hz: f64,
        /// Steps that a period would take.
        steps: f64,
        /// Most steps a period may take.
        most: u32,
        /// The lowest frequency that would do, Hz.
        lowest_hz: f64,
    },
    /// The excitation's amplitude is not finite.
    #[error("the amplitude of the excitation is not finite: torque and force must be numbers")]
    Load,
    /// The ends of a sweep must be numbers, and different.
    #[error("the sweep goes from {from} to {to}: its ends must be two different numbers", from = short(.from), to = short(.to))]
    Interval {
        /// One end of the interval.
        from: f64,
        /// The other end of the interval.
        to: f64,
    },
    /// A sweep has too few points, or too many.
    #[error("the number of points of the sweep is {got}: it must be from 2, one at each end, to {most}")]
    Points {
        /// The number of points that was given.
        got: u32,
        /// Most points of a sweep.
        most: u32,
    },
    /// Vibration never dies out, since a mode has no damping.
    #[error("mode {mode} has the damping ratio {damping_ratio:e}, so no response settles; give the mode damping")]
    Undamped {
        /// Its number, from 1.
        mode: usize,
        /// Damping ratio ζ of the mode.
        damping_ratio: f64,
    },
    /// The structure has a rigid mode that nothing holds.
    #[error(
        "mode {mode} is rigid, at 0 Hz, so no response settles; give the mode the frequency \
         and the damping that it has on its soft supports"
    )]
    Rigid {
        /// Its number, from 1.
        mode: usize,
    },
    /// An option is not a positive number.
    #[error("{name} is {got}: it must be a positive number", got = short(.got))]
    Option {
        /// Name of the option.
        name: &'static str,
        /// The value that was given.
        got: f64,
    },
    /// An integration step failed.
    #[error("excited at {frequency_hz} Hz: {}", reason(source), frequency_hz = short(.frequency_hz))]
    Step {
        /// Frequency of the excitation, Hz.
        frequency_hz: f64,
        /// The reason for which the step failed.
        source: StepError,
    },
    /// No structure has this value of the swept parameter.
    #[error(transparent)]
    Structure(#[from] StructureError),
    /// A stop was requested.
    #[error("the computation was stopped before the response had settled")]
    Stopped,
}

/// Returns the reason, with advice for users who don't choose the step rate.
fn reason(error: &StepError) -> alloc::string::String {
    match error {
        StepError::Integrate(IntegrateError::NotFinite { t_s }) => {
            alloc::format!("the response grows without bound, {t_s:.2e} s after phase 0; lower the excitation")
        }
        StepError::Integrate(source) => alloc::format!("{source}"),
        other => alloc::format!("{other}"),
    }
}
