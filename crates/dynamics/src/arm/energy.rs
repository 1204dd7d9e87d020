//! Energy and power, for the energy balance of a simulation.

use super::{Arm, Load, State};
use crate::integrate::Motion;

/// The energy in the arm, J.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// E = ½ α̇ᵀ M α̇, Eq. (13) with the missing factor 2 restored, J, with the attachment's ½ m ṡ².
    pub kinetic_j: f64,
    /// V = ½ αᵀ K α, Eq. (10) less its constant, the weight's part less its value and slope at rest, and the
    /// attachment's ½ k s², J.
    pub potential_j: f64,
}

impl Energy {
    /// Kinetic and potential energy together, J.
    pub fn total_j(&self) -> f64 {
        self.kinetic_j + self.potential_j
    }
}

impl Arm {
    /// The energy at a state.
    pub fn energy(&self, state: &State) -> Energy {
        let (x, v) = (&state.alpha_rad, &state.alpha_dot_rad_s);
        let (_, t) = self.coefficients.coupling::<true>(x.y);
        let (kinetic_j, potential_j) = self.attached_energy_j(state);
        Energy {
            kinetic_j: 0.5 * v.dot(&(self.mass_matrix_at(t) * v)) + kinetic_j,
            potential_j: 0.5 * x.dot(&(self.stiffness_matrix() * x)) + self.weight_energy_j(x) + potential_j,
        }
    }

    /// The rate at which the energy changes, W: the power of the load less that of the dampers, α̇ᵀ(u + JᵀF) − α̇ᵀDα̇ −
    /// c ṡ².
    pub fn power_w(&self, state: &State, load: &Load) -> f64 {
        let v = &state.alpha_dot_rad_s;
        let loss_w = v.dot(&(self.damping_matrix() * v)) + self.attached_loss_w(state);
        v.dot(&self.generalised_force(&state.alpha_rad, load)) - loss_w
    }

    /// The energy without the weight's, J.
    pub(super) fn energy_of_motion_and_springs_j(&self, motion: &Motion<f64>) -> f64 {
        let own_j = self.coefficients.energy_j::<true>(motion);
        self.attached.as_ref().map_or(own_j, |attached| own_j + attached.coefficients.energy_j::<true>(motion))
    }
}
