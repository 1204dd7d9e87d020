//! Errors of analyses, with advice.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use thiserror::Error;

use super::StartAttempt;
use super::continuation::StepRefusal;
use resonarm_dynamics::structure::StructureError;
use resonarm_numeric::number::{rounded, short};

/// A value of the parameter of a continuation, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Value of the parameter λ.
    pub value: f64,
    /// Its unit, as in `22.1 Hz`; empty if it has none.
    pub unit: &'static str,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", rounded(&self.value, 6), UnitSuffix(self.unit))
    }
}

/// A unit after a number.
struct UnitSuffix(&'static str);

impl fmt::Display for UnitSuffix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let space = if self.0.is_empty() || self.0 == "°" { "" } else { " " };
        write!(f, "{space}{}", self.0)
    }
}

fn no_resonance(damping_ratio: &f64) -> String {
    match *damping_ratio >= 1.0 && damping_ratio.is_finite() {
        true => format!("is overdamped, with the damping ratio {}", short(damping_ratio)),
        false => String::from("is rigid, at 0 Hz"),
    }
}

/// Lists the homotopies that were tried at a start.
fn attempted(attempts: &[StartAttempt]) -> String {
    let mut text = String::new();
    for (number, attempt) in attempts.iter().enumerate() {
        text += if number == 0 { ". Element forces raised from zero " } else { "; " };
        text += &format!("{attempt}");
    }
    text
}

/// Error of an analysis that has no result, or ended early.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum AnalysisError {
    /// A matrix has no inverse.
    #[error("a {size} x {size} matrix has no inverse")]
    Singular {
        /// Rows of the matrix.
        size: usize,
    },
    /// No solution was found where one was sought.
    #[error("no solution at {at}: {refusal}; start elsewhere, away from a resonance, or lower the excitation")]
    NoSolution {
        /// Parameter at the last point.
        at: Place,
        /// Reason for which the step was rejected.
        refusal: StepRefusal,
    },
    /// No periodic response was found at the start of a branch.
    #[error(
        "no periodic response was found at {at}. Newton's method from rest: {from_rest}{}; start elsewhere, lower the excitation, or follow the amplitude from a smaller one",
        attempted(attempts)
    )]
    NoStart {
        /// The start of the branch.
        at: Place,
        /// Reason for which Newton's method from rest ended.
        from_rest: StepRefusal,
        /// The homotopies that were tried.
        attempts: Vec<StartAttempt>,
    },
    /// A branch could not be followed further.
    #[error(
        "the branch could not be followed beyond {at} (arclength {arclength}, step {step:.1e}): {refusal}; \
         use smaller steps or more harmonics, or start from the other end", arclength = rounded(.arclength, 3)
    )]
    Stuck {
        /// λ at the last point.
        at: Place,
        /// Arclength at the last point.
        arclength: f64,
        /// The last step tried.
        step: f64,
        /// Reason for which the step was rejected.
        refusal: StepRefusal,
    },
    /// A bifurcation that shows between two points could not be located.
    #[error("a bifurcation between {from} and {to} could not be located; use smaller steps or more harmonics")]
    NotLocated {
        /// Parameter at the point before it.
        from: Place,
        /// Parameter at the point after it.
        to: Place,
    },
    /// The Fourier series of a periodic response does not converge.
    #[error(
        "at {at} the response needs more than {harmonics} harmonics; lower the excitation, or allow more harmonics"
    )]
    TooManyHarmonics {
        /// Parameter at the last point.
        at: Place,
        /// The most that was allowed.
        harmonics: usize,
    },
    /// The branch turned back and left the interval at its start.
    #[error(
        "the branch turned back and left the interval at its start, {at}; {missed} was not reached: start at the other end"
    )]
    CameBack {
        /// The start of the branch.
        at: Place,
        /// The end that it did not reach.
        missed: Place,
    },
    /// A branch has more points than were allowed.
    #[error(
        "the branch was followed to {at}, where it reached the limit of {points} points; allow more points or larger steps"
    )]
    TooManyPoints {
        /// The most that was allowed.
        points: usize,
        /// λ at the last point.
        at: Place,
    },
    /// The interval is invalid.
    #[error(
        "invalid interval from {from} to {to}{}: the ends must be two different numbers within {domain}",
        UnitSuffix(unit), from = short(.from), to = short(.to))]
    Interval {
        /// The value at which the continuation was to start.
        from: f64,
        /// The value at which it was to end.
        to: f64,
        /// The unit of both.
        unit: &'static str,
        /// The values that are valid, in words.
        domain: &'static str,
    },
    /// The excitation does not bring a mode to quadrature.
    #[error(
        "this excitation does not drive mode {mode}, {at}: the mode never lags the load by 90°; drive the structure at another point or along another axis"
    )]
    NotDriven {
        /// The mode, 1 or 2.
        mode: usize,
        /// Natural frequency of the mode.
        at: Place,
    },
    /// There is no such mode.
    #[error("there is no mode {got}: the structure has modes 1 to {most}")]
    NoMode {
        /// The given number, from 1.
        got: usize,
        /// The number of modes.
        most: usize,
    },
    /// The mode doesn't oscillate.
    #[error("mode {mode} {}, so it has no resonance: choose another mode", no_resonance(damping_ratio))]
    NoResonance {
        /// The mode, from 1.
        mode: usize,
        /// Its damping ratio; below 1 of a rigid mode.
        damping_ratio: f64,
    },
    /// Only an element holds a rigid mode.
    #[error(
        "mode {mode} is rigid, at 0 Hz, and only element {element} holds it, so the mean position of the vibration is not \
         computed; integrate in time, or give the mode the frequency that it has on its soft supports"
    )]
    HeldByElement {
        /// The mode, from 1.
        mode: usize,
        /// The first such element, from 1.
        element: usize,
    },
    /// Small vibrations of the structure are not linear.
    #[error(
        "element {element}, {law}, acts at infinitesimal amplitude, but a backbone must begin as a linear mode; leave the element out, \
         or give a contact a gap"
    )]
    NotLinear {
        /// The number of the element, from 1.
        element: usize,
        /// Law of the element, by its name.
        law: &'static str,
    },
    /// The undamped structure is not defined, since an element dissipates energy.
    #[error(
        "element {element}, {law}, dissipates energy, so the undamped structure is not defined: leave the element out"
    )]
    Dissipates {
        /// The number of the element, from 1.
        element: usize,
        /// Law of the element, by its name.
        law: &'static str,
    },
    /// The specification does not describe a valid structure.
    #[error(transparent)]
    Structure(#[from] StructureError),
    /// The bifurcation is of a kind without curves: only folds and period doublings have them, and only period
    /// doublings have doubled branches.
    #[error("a {kind} can't be followed this way; choose a fold or a period doubling")]
    NotSingular {
        /// Kind of the bifurcation that was given.
        kind: &'static str,
    },
}

/// A continuation that ended early: the reason, and the results found before. The results are empty if it never began.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{reason}")]
pub struct EndedEarly<T: fmt::Debug> {
    /// The reason and the place of the end, and the remedy.
    pub reason: AnalysisError,
    /// The results up to there.
    pub so_far: Box<T>,
}

impl<T: Default + fmt::Debug> From<AnalysisError> for EndedEarly<T> {
    fn from(reason: AnalysisError) -> EndedEarly<T> {
        EndedEarly { reason, so_far: Box::default() }
    }
}

impl<T: fmt::Debug> From<EndedEarly<T>> for AnalysisError {
    fn from(early: EndedEarly<T>) -> AnalysisError {
        early.reason
    }
}
