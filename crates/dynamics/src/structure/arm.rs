//! The two-link arm as a chain, so that elements act on it too.

use alloc::vec;
use alloc::vec::Vec;

use super::spec::{ChainSpec, Link};
use crate::arm::{Gravity, Parameters, Pose};

impl ChainSpec {
    /// The chain of two links that moves as the arm does.
    ///
    /// The arm knows link 1 by its inertia about joint A, I_A1 = I₁ + m₁ lc₁², and with gravity by m₁ lc₁. Without
    /// gravity the chain has 1 kg at A. With it m₁ and lc₁ are the arm's, unless m₁ lc₁² is more than I_A1: then lc₁ is
    /// less and m₁ more, with the same product.
    pub fn from_arm(parameters: &Parameters, pose: Pose) -> ChainSpec {
        let p = parameters;
        let (mass1_kg, centre1_m) = p.gravity.map_or((1.0, 0.0), |gravity| mass_and_centre(&gravity, p.inertia1_kg_m2));
        let first = Link {
            length_m: p.length1_m,
            mass_kg: mass1_kg,
            centre_of_mass_m: centre1_m,
            centre_of_mass_off_m: 0.0,
            inertia_kg_m2: p.inertia1_kg_m2 - mass1_kg * centre1_m * centre1_m,
            angle_deg: pose.beta1_deg,
            stiffness_nm_rad: p.stiffness1_nm_rad,
            damping_nm_s_rad: p.damping1_nm_s_rad,
        };
        let second = Link {
            length_m: p.length2_m,
            mass_kg: p.mass2_kg,
            centre_of_mass_m: p.centre2_m,
            centre_of_mass_off_m: 0.0,
            inertia_kg_m2: p.inertia2_kg_m2,
            angle_deg: pose.beta2_deg,
            stiffness_nm_rad: p.stiffness2_nm_rad,
            damping_nm_s_rad: p.damping2_nm_s_rad,
        };
        let gravity_m_s2 = p.gravity.map_or(0.0, |gravity| gravity.gravity_m_s2);
        ChainSpec { links: vec![first, second], gravity_m_s2, unstated: Vec::new() }
    }

    /// The arm that moves as this chain does, with its pose; none for another number of links, and for a centre of mass
    /// off the line of its link.
    pub fn to_arm(&self) -> Option<(Parameters, Pose)> {
        let [first, second] = self.links[..] else { return None };
        if first.centre_of_mass_off_m != 0.0 || second.centre_of_mass_off_m != 0.0 {
            return None;
        }
        let (mass1_kg, centre1_m) = (first.mass_kg, first.centre_of_mass_m);
        let gravity = Gravity { gravity_m_s2: self.gravity_m_s2, mass1_kg, centre1_m };
        let parameters = Parameters {
            inertia1_kg_m2: first.inertia_kg_m2 + mass1_kg * centre1_m * centre1_m,
            inertia2_kg_m2: second.inertia_kg_m2,
            mass2_kg: second.mass_kg,
            length1_m: first.length_m,
            length2_m: second.length_m,
            centre2_m: second.centre_of_mass_m,
            stiffness1_nm_rad: first.stiffness_nm_rad,
            stiffness2_nm_rad: second.stiffness_nm_rad,
            damping1_nm_s_rad: first.damping_nm_s_rad,
            damping2_nm_s_rad: second.damping_nm_s_rad,
            gravity: (self.gravity_m_s2 != 0.0).then_some(gravity),
        };
        Some((parameters, Pose { beta1_deg: first.angle_deg, beta2_deg: second.angle_deg }))
    }
}

/// m₁ and lc₁ of the chain.
fn mass_and_centre(gravity: &Gravity, inertia1_kg_m2: f64) -> (f64, f64) {
    let moment = gravity.mass1_kg * gravity.centre1_m;
    if moment == 0.0 {
        (1.0, 0.0)
    } else if moment * gravity.centre1_m < inertia1_kg_m2 {
        (gravity.mass1_kg, gravity.centre1_m)
    } else {
        let centre_m = 0.5 * inertia1_kg_m2 / moment;
        (moment / centre_m, centre_m)
    }
}
