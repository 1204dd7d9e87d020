//! The first response of a branch: Newton's method from rest, or along a homotopy from a linear structure.

use alloc::vec;
use alloc::vec::Vec;

use super::adapt::begin;
use super::balance::{Balance, Homotopy, unit_deflection};
use super::start_near::start_near;
use super::trace_options::TraceOptions;
use crate::continuation::{Continuation, ContinuationSettings, System, at_parameter};
use crate::error::AnalysisError;
use crate::refusal::{MOST_POINTS, StartAttempt, StartEnd, StartStructure, StepRefusal};

/// Harmonics of the homotopy, for smooth forces and for others, in the order in which they are tried. The first response
/// is then corrected with as many as it needs.
const HARMONICS: [[usize; 3]; 2] = [[7, 15, 31], [9, 15, 31]];
/// The structures with which the homotopy begins, in the order in which they are tried.
const STRUCTURES: [StartStructure; 3] =
    [StartStructure::Linear, StartStructure::Closed { share: 1.0 }, StartStructure::Closed { share: 0.25 }];
/// The unit of the share of the element forces, and the largest step relative to the size of the response.
const SHARE_SCALE: f64 = 0.25;
const LARGEST_STEP: f64 = 0.5;

/// Starts at `options.branch.from`, with as many harmonics as the response needs; near a state if one is given, see
/// [`start_near`].
///
/// Without one Newton's method from rest comes first: its first step leads to the linear response, so that it succeeds wherever the
/// response is nearly linear.
///
/// # Errors
/// [`AnalysisError::NoStart`] with all that was tried; otherwise as [`start_near`].
pub(super) fn start(balance: &mut Balance, options: &TraceOptions) -> Result<Continuation, AnalysisError> {
    if let Some(state) = &options.near {
        return start_near(balance, options, state);
    }
    let branch = &options.branch;
    let rest = vec![0.0; balance.dimension()];
    let from_rest = match begin(balance, branch, &rest) {
        Ok(continuation) => return Ok(continuation),
        Err(AnalysisError::NoSolution { refusal, .. }) => refusal,
        Err(other) => return Err(other),
    };
    let smooth = balance.forced.assembly().is_smooth();
    let mut attempts: Vec<StartAttempt> = Vec::new();
    for harmonics in HARMONICS[usize::from(!smooth)] {
        // The limits of the branch hold for the homotopy too. Where they make two entries of the list equal, the second
        // is skipped below.
        let harmonics = harmonics.max(branch.least_harmonics).min(branch.most_harmonics);
        for from in STRUCTURES {
            if attempts.iter().any(|tried| tried.from == from && tried.harmonics == harmonics) {
                continue;
            }
            balance.set_harmonics(harmonics);
            match approach(balance, options, from) {
                Ok(Some(x)) => match begin(balance, branch, &x) {
                    Ok(continuation) => return Ok(continuation),
                    Err(_) => attempts.push(StartAttempt { from, harmonics, share: 1.0, end: StartEnd::Harmonics }),
                },
                Ok(None) => {}
                Err((share, end)) => attempts.push(StartAttempt { from, harmonics, share, end }),
            }
        }
    }
    Err(AnalysisError::NoStart { at: balance.place(branch.from), from_rest, attempts })
}

/// Follows the homotopy from a linear structure and returns the response at its end, or how far it went and why it
/// ended; `None` if the structure has no elements for which it was made.
fn approach(
    balance: &Balance,
    options: &TraceOptions,
    from: StartStructure,
) -> Result<Option<Vec<f64>>, (f64, StartEnd)> {
    // The static deflection under the drive. Only a contact by Hunt and Crossley needs it, whose slope is zero without
    // a deflection.
    let deflection = unit_deflection(&balance.forced) * balance.forced.amplitude().abs();
    let Some(mut homotopy) = Homotopy::new(balance, from, deflection) else { return Ok(None) };
    let settings = ContinuationSettings {
        // The share has one scale from 0 to 1, whatever its value.
        parameter_fraction: 0.0,
        parameter_floor: SHARE_SCALE,
        largest_step: LARGEST_STEP,
        ..options.branch.continuation
    };
    let refusal = |error: AnalysisError| match error {
        AnalysisError::NoSolution { refusal, .. } | AnalysisError::Stuck { refusal, .. } => StartEnd::Step(refusal),
        _ => StartEnd::Step(StepRefusal::Newton),
    };
    let rest = vec![0.0; homotopy.dimension()];
    let mut continuation =
        Continuation::start(&mut homotopy, settings, &rest, 0.0, 1.0).map_err(|error| (0.0, refusal(error)))?;
    let mut furthest = 0.0_f64;
    for _ in 0..MOST_POINTS {
        let before = continuation.point().clone();
        let after = continuation.advance(&mut homotopy).map_err(|error| (furthest, refusal(error)))?.clone();
        if after.lambda >= 1.0 {
            let end = at_parameter(&mut homotopy, &settings, [&before, &after], 1.0);
            return end.map(|point| Some(point.x)).map_err(|error| (1.0, refusal(error)));
        }
        // A negative share means nothing: the curve has come back to the linear structure and has passed through it.
        if after.lambda < 0.0 {
            return Err((furthest, StartEnd::Returned));
        }
        furthest = furthest.max(after.lambda);
    }
    Err((furthest, StartEnd::TooLong))
}
