//! Branches followed to both sides of a response that lies within the interval.

use alloc::boxed::Box;

use super::balance::Balance;
use super::branch::Tracer;
use super::detect::{chord, point_of};
use super::orbit::{Branch, BranchEnd};
use super::trace_options::TraceOptions;
use crate::branch_options::BranchOptions;
use crate::continuation::Continuation;
use crate::error::EndedEarly;

/// First step along a branch, relative to the size of the response.
pub(super) const FIRST_STEP: f64 = 1e-2;

/// Follows a branch from a response within the interval to both sides, in one piece. A branch that is `switched` ends where
/// it meets another one.
///
/// # Errors
/// [`EndedEarly`] with as much of the branch as could be followed.
pub(super) fn both_ways(
    mut balance: Balance,
    begin: Continuation,
    options: &TraceOptions,
    is_switched: bool,
) -> Result<Branch, EndedEarly<Branch>> {
    let (half, early) = match follow(balance.clone(), begin, options, is_switched) {
        Ok(half) => (half, None),
        Err(EndedEarly { reason, so_far }) => (*so_far, Some(reason)),
    };
    let branch = &options.branch;
    let ended = |reason, so_far| EndedEarly { reason, so_far: Box::new(so_far) };
    // Where the branch met another one its last response is one beyond.
    let last = half.orbits.len().saturating_sub(if half.end == BranchEnd::Rejoined { 2 } else { 1 });
    let (Some(at), false) = (half.orbits.get(last), half.end == BranchEnd::Closed) else {
        return early.map_or(Ok(half.clone()), |reason| Err(ended(reason, half)));
    };
    balance.set_harmonics(at.harmonics);
    // The ends of the whole are named from where it begins now.
    let (from, to) = if half.end == BranchEnd::AtEnd { (branch.to, branch.from) } else { (branch.from, branch.to) };
    let settings = branch.continuation;
    let x = &at.coefficients;
    let begin = match (half.end, last.checked_sub(1).and_then(|before| half.orbits.get(before))) {
        (BranchEnd::AtStart | BranchEnd::AtEnd, _) => {
            Continuation::start(&mut balance, settings, x, at.value, to - from).map(Some)
        }
        (_, Some(before)) => {
            let direction = chord(&point_of(at), &point_of(before), x.len());
            Continuation::start_along(&mut balance, settings, x, at.value, &direction, FIRST_STEP).map(Some)
        }
        (_, None) => Ok(None),
    };
    let begin = match begin {
        Ok(Some(begin)) => begin,
        Ok(None) => return early.map_or(Ok(half.clone()), |reason| Err(ended(reason, half))),
        Err(reason) => return Err(ended(early.unwrap_or(reason), half)),
    };
    let options = TraceOptions { branch: BranchOptions { from, to, ..*branch }, ..options.clone() };
    match (follow(balance, begin, &options, is_switched), early) {
        (Ok(whole), Some(reason)) => Err(ended(reason, whole)),
        (Err(again), Some(reason)) => Err(EndedEarly { reason, ..again }),
        (whole, None) => whole,
    }
}

/// Follows a branch to one side.
fn follow(
    balance: Balance,
    begin: Continuation,
    options: &TraceOptions,
    is_switched: bool,
) -> Result<Branch, EndedEarly<Branch>> {
    Tracer { is_switched, ..Tracer::new(balance, options) }.run(begin)
}
