//! What can go wrong in an analysis, and what to try.

use thiserror::Error;

use super::continuation::Refusal;

/// Why an analysis has no result.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum AnalysisError {
    /// A matrix has no inverse.
    #[error("a {size} x {size} matrix has no inverse")]
    Singular {
        /// Rows of the matrix.
        size: usize,
    },
    /// There is no solution where one was looked for.
    #[error(
        "no solution at {lambda:.6}: {refusal}; try to start elsewhere, away from a resonance, or with less excitation"
    )]
    NoSolution {
        /// λ.
        lambda: f64,
        /// Why.
        refusal: Refusal,
    },
    /// A branch could not be followed further.
    #[error(
        "the branch could not be followed beyond {lambda:.6} (arclength {arclength:.3}, step {step:.1e}): {refusal}; \
         try smaller steps, more harmonics, or to start from the other end"
    )]
    Stuck {
        /// λ at the last point.
        lambda: f64,
        /// The arclength there.
        arclength: f64,
        /// The last step tried.
        step: f64,
        /// Why it was refused.
        refusal: Refusal,
    },
    /// A bifurcation that shows between two points could not be located.
    #[error("a bifurcation between {lambda:.6} and {to:.6} could not be located; try smaller steps or more harmonics")]
    NotLocated {
        /// λ before it.
        lambda: f64,
        /// λ after it.
        to: f64,
    },
    /// The series of a motion does not end.
    #[error("at {lambda:.6} the motion needs more than {harmonics} harmonics; try to allow more, or less excitation")]
    TooManyHarmonics {
        /// λ.
        lambda: f64,
        /// The most that was allowed.
        harmonics: usize,
    },
    /// A branch has more points than were allowed.
    #[error(
        "the branch has more than {points} points and has come to {lambda:.6}; try to allow more points or larger steps"
    )]
    TooManyPoints {
        /// The most that was allowed.
        points: usize,
        /// λ at the last point.
        lambda: f64,
    },
    /// The interval is none.
    #[error(
        "the interval from {from} to {to} can't be walked: both ends must be numbers, different, and inside {domain}"
    )]
    Interval {
        /// Where the walk was to start.
        from: f64,
        /// Where it was to end.
        to: f64,
        /// What would do.
        domain: &'static str,
    },
    /// Only folds and period doublings have curves, and only period doublings doubled branches.
    #[error("a {kind} can't be followed this way; try a fold or a period doubling")]
    NotSingular {
        /// What was given.
        kind: &'static str,
    },
}
