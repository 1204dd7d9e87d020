//! The path of a response through the state space.

use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::structure::{Assembly, Dof, StepError};

use super::error::TimeDomainError;
use super::map::{StroboscopicMap, states};

/// States of a path in a period of the drive.
const STATES: u32 = 400;

/// Returns the states of a response over `periods` periods of the drive, from its state at phase 0: 400 a period and
/// the last, dense enough to be drawn.
///
/// # Errors
/// [`TimeDomainError::Step`] if a step can't be made, [`TimeDomainError::FrequencyTooLow`] if a period takes too many
/// steps.
pub fn path(map: &StroboscopicMap, start: &[f64], periods: u32) -> Result<Vec<Vec<f64>>, TimeDomainError> {
    let dense = map.in_multiples_of(STATES)?;
    let every = dense.steps_per_period() / STATES;
    let mut state = start.to_vec();
    let mut passed = vec![];
    for _ in 0..periods {
        let reached = dense.visit(&state, |step, structure| {
            if step.is_multiple_of(every) {
                passed.push(states(structure));
            }
            Ok(())
        });
        state = match reached {
            Err(TimeDomainError::Step { source: StepError::TooStiff { needed_hz, .. }, .. }) => {
                // The path begins anew, since its states must be evenly spaced.
                return path(&map.finer(needed_hz)?, start, periods);
            }
            reached => reached?,
        };
    }
    passed.push(state);
    Ok(passed)
}

/// Returns the displacement, m or rad, and the velocity of a degree of freedom in a state.
pub fn section_point(assembly: &Assembly, dof: Dof, state: &[f64]) -> [f64; 2] {
    let (q, rest) = state.split_at(assembly.coordinates());
    let at = assembly.at(q);
    [at.displacement(dof), at.velocity(dof, &rest[..q.len()])]
}
