//! Power that dampers and elements turn into heat, for balances of energy.

use super::super::body::Body;
use super::*;

/// q̇ᵀDq̇ of the dampers of the joints or modes, and the losses of the elements, W.
pub(super) fn loss_w(of: &Assembly, q: &[f64], v: &[f64], states: &[f64]) -> f64 {
    let dampers_w: f64 = match &of.body {
        Body::Chain(chain) => chain.damping.iter().zip(v).map(|(damping, v)| damping * v * v).sum(),
        Body::Modal(modal) => {
            let rates = modal.omega_rad_s.iter().zip(&modal.damping_ratio).map(|(omega, zeta)| 2.0 * zeta * omega);
            rates.zip(v).map(|(rate, v)| rate * v * v).sum()
        }
    };
    let at = of.at(q);
    let element_w = |element: &Element| {
        let (x, v) = (at.element_displacement(element), at.element_velocity(element, v));
        element_loss_w(element, x, v, element.own(states))
    };
    dampers_w + of.elements().iter().map(element_w).sum::<f64>()
}

/// f v − ∂E/∂x v − ∂E/∂z ż, not negative, with the energy E of [`Law::energy_j`]. Where a contact would pull, its force is
/// zero and its spring relaxes, so that the loss is −∂E/∂x v.
fn element_loss_w(element: &Element, position: f64, velocity: f64, state: f64) -> f64 {
    let [seat, at_rest] = element.law.seat().unwrap_or_default();
    let x = position + seat;
    let (by_position, by_state) = match element.law {
        Law::Cubic { .. } => (element.force(position, 0.0, state).force, 0.0),
        Law::Gap { stiffness, gap, .. } => (stiffness * ((x - gap).max(0.0) + (x + gap).min(0.0)), 0.0),
        Law::KelvinVoigt { stiffness, gap, side, .. } => {
            (side.sign() * stiffness * (side.sign() * x - gap).max(0.0), 0.0)
        }
        Law::HuntCrossley { stiffness, gap, side, .. } => {
            (side.sign() * stiffness * libm::pow((side.sign() * x - gap).max(0.0), 1.5), 0.0)
        }
        Law::Friction { stiffness, .. } | Law::Lugre { bristle_stiffness: stiffness, .. } => (0.0, stiffness * state),
        Law::Linear { stiffness, .. } => (stiffness * x, 0.0),
        Law::Tanh { .. } => (0.0, 0.0),
    };
    let force = element.force(position, velocity, state).force;
    let rate = element.state_rate(position, velocity, state).rate;
    (force - (by_position - at_rest)) * velocity - by_state * rate
}
