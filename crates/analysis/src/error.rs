//! Errors of analyses, with advice.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use thiserror::Error;

use crate::refusal::{StartAttempt, StepRefusal};
use resonarm_dynamics::structure::{StepError, StructureError};
use resonarm_numeric::number::{rounded, short, significant};

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
        text += if number == 0 { ", and by raising the element forces from zero: " } else { "; " };
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
        "no periodic response was found at {at}. It was searched from rest ({from_rest}){}. Start elsewhere, lower the \
         excitation, follow the amplitude from a smaller one, or give a state of the response",
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
    /// The drive has a harmonic beyond those that a response may have.
    #[error("the load has the harmonic {order}, and responses have at most {most} harmonics: allow more")]
    LoadOrder {
        /// The highest order of the drive.
        order: usize,
        /// The most harmonics of a response.
        most: usize,
    },
    /// A backbone under a drive with harmonics.
    #[error("a backbone is the resonance under a single sine: leave the harmonics of the load out")]
    LoadHarmonics,
    /// A state near which a branch is to start has another number of finite numbers than a state of the structure.
    #[error(
        "the state to start from has {got} finite numbers: expected {expected}, the coordinates and their rates{}",
        if with_elements > expected { format!(", or {with_elements} with the states of the elements") } else { String::new() }
    )]
    StateSize {
        /// Finite numbers given, up to the first that is not finite.
        got: usize,
        /// Twice the number of coordinates.
        expected: usize,
        /// The same with the states of the elements.
        with_elements: usize,
    },
    /// The structure can't be integrated from a state near which a branch is to start.
    #[error("the structure can't be integrated over a period from the state to start from: {source}")]
    NotIntegrated {
        /// Reason for which a step failed.
        source: StepError,
    },
    /// No periodic response was found near a given state.
    #[error(
        "no periodic response was found near the given state at {at}. From the state the structure was integrated over \
         {period} {}, after which it is off by {change:.1e} of its size; Newton's method was started at this response with {harmonics} harmonics ({refusal}). \
         Give a state at phase 0 of the load, at this frequency and load",
        if *period == 1 { "period" } else { "periods" }
    )]
    NoStartNear {
        /// The start of the branch.
        at: Place,
        /// Periods of the drive over which the response was integrated.
        period: usize,
        /// How far the state was then from its start, relative to its size.
        change: f64,
        /// Number of harmonics with which Newton's method began.
        harmonics: usize,
        /// Reason for which it ended.
        refusal: StepRefusal,
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
    /// A branch would begin exactly where a harmonic has the natural frequency of an undamped mode.
    #[error(
        "harmonic {harmonic} of the first frequency is at {natural_hz} Hz, exactly the natural frequency of mode {mode}, which has no \
         damping of its own; begin a little beside it, or give the mode a damping ratio", natural_hz = significant(.natural_hz, 7)
    )]
    AtUndampedMode {
        /// The mode, from 1.
        mode: usize,
        /// Its natural frequency, Hz.
        natural_hz: f64,
        /// The harmonic that has this frequency.
        harmonic: usize,
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

impl<T: fmt::Debug> EndedEarly<T> {
    /// Returns the results of a continuation that came to this end.
    pub(crate) fn at_end(end: Result<(), AnalysisError>, so_far: T) -> Result<T, EndedEarly<T>> {
        match end {
            Ok(()) => Ok(so_far),
            Err(reason) => Err(EndedEarly { reason, so_far: Box::new(so_far) }),
        }
    }
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
