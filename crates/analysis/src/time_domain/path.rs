//! The path of a motion through the state space.

use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::arm::{Arm, State};
use resonarm_dynamics::integrate::{IntegrateError, Integrator, Scheme, Sine};

/// States of a path in a period of the excitation, and the least rate at which it is integrated, Hz.
const STATES: f64 = 400.0;
const RATE_HZ: f64 = 4000.0;

/// The states of a motion over `periods` periods of the excitation, from its state at phase 0: dense enough to be
/// drawn.
///
/// # Errors
/// [`IntegrateError`] if the excitation has no period, or a step has no solution.
pub fn path(arm: &Arm, sine: &Sine, start: &State, periods: u32) -> Result<Vec<State>, IntegrateError> {
    let least = libm::ceil(RATE_HZ / sine.frequency_hz / STATES).max(1.0);
    let steps_per_state = least.min(1000.0) as u32;
    let rate_hz = STATES * f64::from(steps_per_state) * sine.frequency_hz;
    let integrator = Integrator::new(Scheme::default(), rate_hz, arm)?;
    let (mut state, mut path) = (*start, vec![*start]);
    for step in 1..=STATES as u32 * steps_per_state * periods {
        state = integrator.step(arm, f64::from(step - 1) / rate_hz, &state, sine)?;
        if step % steps_per_state == 0 {
            path.push(state);
        }
    }
    Ok(path)
}
