//! Reasons for which the continuation rejects a step, or a branch has no first response.

use core::fmt;

use thiserror::Error;

/// Most points of the homotopy.
pub(crate) const MOST_POINTS: usize = 1000;

/// Reason for which the continuation rejected a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum StepRefusal {
    /// Newton's method did not converge.
    #[error("Newton's method did not converge")]
    Newton,
    /// The correction was too large a fraction of the step.
    #[error("the solution found was too far from the prediction")]
    Correction,
    /// The tangent turned too far.
    #[error("the branch turned too sharply")]
    Turn,
    /// A matrix had no inverse, or something was not a number.
    #[error("the equations were singular or not finite")]
    Singular,
    /// The system does not exist there.
    #[error("no such system exists there")]
    OutOfRange,
}

/// A linear structure from which a structure is approached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartStructure {
    /// The modes or links at rest, with the linear elements.
    Linear,
    /// The same with closed contacts and stuck friction as springs.
    Closed {
        /// Factor of their stiffness.
        share: f64,
    },
}

impl fmt::Display for StartStructure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StartStructure::Linear => f.write_str("the linear structure"),
            StartStructure::Closed { share: 1.0 } => f.write_str("closed contacts and stuck friction"),
            StartStructure::Closed { share } => {
                write!(f, "closed contacts and stuck friction with {share} times their stiffness")
            }
        }
    }
}

/// Reason for which a homotopy ended before it found a response.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum StartEnd {
    /// A step was rejected.
    #[error("{0}")]
    Step(StepRefusal),
    /// The curve returned to the linear structure.
    #[error("the curve returned to zero")]
    Returned,
    /// The curve had too many points.
    #[error("the curve has more than {} points", MOST_POINTS)]
    TooLong,
    /// The response could not be solved for with all the harmonics that it needs.
    #[error("the response was not found with more harmonics")]
    Harmonics,
}

/// A homotopy that found no response.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("from {from} with {harmonics} harmonics, up to {:.0} % of the forces ({end})", 100.0 * .share)]
pub struct StartAttempt {
    /// The structure at its start.
    pub from: StartStructure,
    /// Number of harmonics of the homotopy.
    pub harmonics: usize,
    /// The share of the element forces that it reached, from 0 to 1.
    pub share: f64,
    /// The reason of its end.
    pub end: StartEnd,
}
