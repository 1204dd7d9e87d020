//! The path of a motion through the state space.

use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::arm::{Arm, Sine, State};
use resonarm_dynamics::integrate::{IntegrateError, Integrator, Scheme};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::arm_at;
    use resonarm_dynamics::arm::{Load, Preset};

    #[test]
    fn a_path_has_the_same_number_of_states_in_every_period() {
        let arm = arm_at(Preset::Irb1600Fitted, 0.0, 60.0);
        let start = State::new([0.0; 2], [0.0; 2]);
        for frequency_hz in [2.0, 22.0] {
            let path = path(&arm, &Sine { amplitude: Load::default(), frequency_hz }, &start, 2).unwrap();
            assert_eq!((path.len(), path[800]), (801, start));
        }
    }
}
