//! Explicit Runge–Kutta.

use super::Excitation;
use crate::arm::{Arm, State};

/// Nodes of the classical method (W. Kutta 1901): stage i starts from stage i − 1's slope over `NODES[i]` of the step.
const NODES: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
/// Weights of the slopes.
const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// yₙ₊₁ = yₙ + h Σ bᵢ kᵢ with kᵢ = f(tₙ + cᵢh, yₙ + cᵢ h kᵢ₋₁), for y = (α, α̇).
pub(super) fn step(arm: &Arm, t_s: f64, h: f64, state: &State, excitation: &impl Excitation) -> State {
    let mut slope = State::default();
    let mut next = *state;
    for (node, weight) in NODES.into_iter().zip(WEIGHTS) {
        let stage = moved(state, &slope, node * h);
        let load = excitation.load(t_s + node * h);
        slope = State { alpha_rad: stage.alpha_dot_rad_s, alpha_dot_rad_s: arm.acceleration(&stage, &load) };
        next = moved(&next, &slope, weight * h);
    }
    next
}

/// `state` + h · `slope`.
fn moved(state: &State, slope: &State, h: f64) -> State {
    State {
        alpha_rad: state.alpha_rad + slope.alpha_rad * h,
        alpha_dot_rad_s: state.alpha_dot_rad_s + slope.alpha_dot_rad_s * h,
    }
}
