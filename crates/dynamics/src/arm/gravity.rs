//! Weight, exactly, about the static equilibrium. The paper leaves it out, and so does every preset.
//!
//! Gravity pulls along −y of the base frame. The springs are relaxed in the pose β; under the weight the joints sag by
//! α_st,
//!
//! ```text
//! K α_st + G(β + α_st) = 0        G(q) = (w1 cos q1 + w2 cos(q1+q2), w2 cos(q1+q2))
//! w1 = g (m1 lc1 + m2 l1)         w2 = g m2 lc2
//! ```
//!
//! and the vibration α is counted from there: q = β + α_st + α. So α = 0 remains the rest position, the links' angles
//! at rest are β + α_st, and Eq. (3) gains the term G(q) − G(β + α_st) on its left.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use super::{Arm, ArmError, Parameters};

/// Gravity, and the properties of link 1 that its weight needs besides [`Parameters`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gravity {
    /// Acceleration of gravity along −y (g), m/s², not negative; 9.80665 is the standard value.
    pub gravity_m_s2: f64,
    /// Mass of link 1 (m1), kg, not negative.
    pub mass1_kg: f64,
    /// Distance of the centre of mass of link 1 from joint A (lc1), m, not negative.
    pub centre1_m: f64,
}

/// Newton's limit for the equilibrium: for joints that hold the weight it needs three or four iterations.
const MAX_ITERATIONS: usize = 50;
/// A correction below this, rad, is the last one.
const CORRECTION_LIMIT_RAD: f64 = 1e-9;

impl Gravity {
    pub(super) fn check(&self) -> Result<(), ArmError> {
        for (name, got) in
            [("gravity_m_s2", self.gravity_m_s2), ("mass1_kg", self.mass1_kg), ("centre1_m", self.centre1_m)]
        {
            if !(got.is_finite() && got >= 0.0) {
                return Err(ArmError::Parameter { name, got, expected: "zero or a positive number" });
            }
        }
        Ok(())
    }

    /// w1, w2, N·m.
    pub(super) fn moments_nm(&self, p: &Parameters) -> [f64; 2] {
        [
            self.gravity_m_s2 * (self.mass1_kg * self.centre1_m + p.mass2_kg * p.length1_m),
            self.gravity_m_s2 * (p.mass2_kg * p.centre2_m),
        ]
    }
}

/// ∂G/∂q, N·m/rad, for moments w and link angles with the sines s1, s12.
pub(super) fn weight_gradient([w1, w2]: [f64; 2], s1: f64, s12: f64) -> Matrix2<f64> {
    let lower = -w2 * s12;
    Matrix2::new(-w1 * s1 + lower, lower, lower, lower)
}

/// α_st by Newton's method from the relaxed springs; zero without gravity, rad.
///
/// # Errors
/// [`ArmError::Collapse`] if the springs can't hold the weight: no equilibrium is found, or the one found is not
/// stable.
pub(super) fn static_deflection(p: &Parameters, beta_rad: [f64; 2]) -> Result<Vector2<f64>, ArmError> {
    let Some(gravity) = p.gravity else { return Ok(Vector2::zeros()) };
    let w = gravity.moments_nm(p);
    let stiffness = Matrix2::new(p.stiffness1_nm_rad, 0.0, 0.0, p.stiffness2_nm_rad);
    let mut sag = Vector2::zeros();
    for _ in 0..MAX_ITERATIONS {
        let (s1, c1) = libm::sincos(beta_rad[0] + sag.x);
        let (s12, c12) = libm::sincos(beta_rad[0] + beta_rad[1] + sag.x + sag.y);
        let tangent = stiffness + weight_gradient(w, s1, s12);
        let residual = stiffness * sag + Vector2::new(w[0] * c1 + w[1] * c12, w[1] * c12);
        if !(tangent.m11 > 0.0 && tangent.determinant() > 0.0) {
            break;
        }
        let Some(inverse) = tangent.try_inverse() else { break };
        let correction = inverse * residual;
        sag -= correction;
        if correction.amax() < CORRECTION_LIMIT_RAD {
            return Ok(sag);
        }
    }
    Err(ArmError::Collapse { gravity_m_s2: gravity.gravity_m_s2 })
}

impl Arm {
    /// α_st: how far the joints sag under the weight, from the relaxed springs to α = 0, rad; zero without gravity.
    pub fn static_deflection_rad(&self) -> Vector2<f64> {
        self.static_deflection_rad
    }

    /// K + ∂G/∂α at a deflection, with the spring of an attachment, N·m/rad: K itself without either. Symmetric.
    pub fn tangent_stiffness_matrix(&self, alpha_rad: &Vector2<f64>) -> Matrix2<f64> {
        self.stiffness_of_joints_and_weight(alpha_rad) + self.attached_stiffness(alpha_rad)
    }

    /// The same of the arm alone.
    pub(super) fn stiffness_of_joints_and_weight(&self, alpha_rad: &Vector2<f64>) -> Matrix2<f64> {
        let c = &self.coefficients;
        if c.weight == [0.0; 2] {
            return self.stiffness_matrix();
        }
        let (s1, _) = c.link1.sincos_plus(alpha_rad.x);
        let (s12, _) = c.link2.sincos_plus(alpha_rad.x + alpha_rad.y);
        self.stiffness_matrix() + weight_gradient(c.weight, s1, s12)
    }

    /// The potential energy of the weight less its value and slope at rest, J: with ½ αᵀKα it is the potential whose
    /// gradient is Kα + G(q) − G(q at rest).
    pub(super) fn weight_energy_j(&self, alpha_rad: &Vector2<f64>) -> f64 {
        let c = &self.coefficients;
        let [w1, w2] = c.weight;
        if c.weight == [0.0; 2] {
            return 0.0;
        }
        let both = alpha_rad.x + alpha_rad.y;
        let (s1, _) = c.link1.sincos_plus(alpha_rad.x);
        let (s12, _) = c.link2.sincos_plus(both);
        w1 * (s1 - c.link1.sine - c.link1.cosine * alpha_rad.x) + w2 * (s12 - c.link2.sine - c.link2.cosine * both)
    }
}
