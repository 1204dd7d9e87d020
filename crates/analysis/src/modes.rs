//! Natural modes of the arm linearised in its pose, M0 α̈ + K α = 0; K includes the weight if gravity is on.

use core::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};
use serde::Serialize;

use resonarm_dynamics::arm::Arm;

/// A natural mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mode {
    /// Natural frequency of the undamped arm, ω/(2π) with K φ = ω² M φ, Hz. The pole frequency |λ|/(2π) of the damped arm,
    /// [`arm_poles`](crate::arm_poles), differs from it by terms in ζ² if the damping is not proportional.
    pub frequency_hz: f64,
    /// Damping ratio ζ = φᵀDφ/(2ω), dimensionless: the modal one, without the coupling of the modes by D.
    pub damping_ratio: f64,
    /// φ = (φ1, φ2), rad, normalised to unit modal mass: φᵀM0φ = 1 kg·m². φ1 is positive; where it is zero, φ2 is.
    pub shape: [f64; 2],
}

/// The two natural modes of the arm in its pose, the lower frequency first.
///
/// With the Cholesky factor K = L Lᵀ and y = Lᵀφ the eigenproblem K φ = ω² M0 φ becomes S y = λ y with S = L⁻¹ M0 L⁻ᵀ
/// and λ = 1/ω². S is symmetric and one Jacobi rotation by the angle of tangent t makes it diagonal: with s12 t² + (s22
/// − s11) t − s12 = 0 and |t| ≤ 1, λ = s11 − t s12 has y = (1, −t)/√(1+t²), λ = s22 + t s12 has y = (t, 1)/√(1+t²) (C.
/// G. J. Jacobi, "Über ein leichtes Verfahren, die in der Theorie der Säcularstörungen vorkommenden Gleichungen
/// numerisch aufzulösen", 1846; G. H. Golub, C. F. Van Loan, "Matrix Computations", 4th edition 2013, section 8.5).
/// From yᵀy = 1 follows φᵀM0φ = λ ω² = 1 for φ = ω L⁻ᵀy. K is the stiffness at rest, diagonal without gravity.
///
/// [`Arm::angular_frequencies_rad_s`] has the same frequencies in closed form, Eq. (30); both agree to 1e-12.
pub fn modes(arm: &Arm) -> [Mode; 2] {
    let rest = Vector2::zeros();
    let (m, k) = (arm.mass_matrix(&rest), arm.tangent_stiffness_matrix(&rest));
    let l11 = libm::sqrt(k.m11);
    let l21 = k.m12 / l11;
    let l22 = libm::sqrt(k.m22 - l21 * l21);
    // L⁻ᵀ: its columns are the scaled unit vectors, (1/l11, 0) and (−l21/l11, 1)/l22.
    let scale = Matrix2::new(1.0 / l11, -l21 / (l11 * l22), 0.0, 1.0 / l22);
    let s = scale.transpose() * m * scale;
    let tangent = jacobi_tangent(s.m11, s.m12, s.m22);
    let norm = 1.0 / libm::sqrt(1.0 + tangent * tangent);
    let first = mode(arm, s.m11 - tangent * s.m12, scale * Vector2::new(norm, -tangent * norm));
    let second = mode(arm, s.m22 + tangent * s.m12, scale * Vector2::new(tangent * norm, norm));
    if first.frequency_hz <= second.frequency_hz { [first, second] } else { [second, first] }
}

/// t = sign(θ)/(|θ| + √(1 + θ²)) with θ = (s22 − s11)/(2 s12): the smaller root, tangent of the rotation that makes S
/// diagonal.
fn jacobi_tangent(s11: f64, s12: f64, s22: f64) -> f64 {
    if s12 == 0.0 {
        return 0.0;
    }
    let theta = (s22 - s11) / (2.0 * s12);
    libm::copysign(1.0 / (libm::fabs(theta) + libm::sqrt(1.0 + theta * theta)), theta)
}

/// The mode with λ = 1/ω² and L⁻ᵀy = `scaled`.
fn mode(arm: &Arm, lambda: f64, scaled: Vector2<f64>) -> Mode {
    let omega = 1.0 / libm::sqrt(lambda);
    let positive = if scaled.x != 0.0 { scaled.x > 0.0 } else { scaled.y > 0.0 };
    let shape = scaled * if positive { omega } else { -omega };
    let damping_ratio = shape.dot(&(arm.tangent_damping_matrix(&Vector2::zeros()) * shape)) / (2.0 * omega);
    Mode { frequency_hz: omega / TAU, damping_ratio, shape: shape.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::arm_at;
    use proptest::prelude::*;
    use resonarm_dynamics::arm::{Parameters, Pose, Preset};

    proptest! {
        #[test]
        fn eigenproblem_agrees_with_equation_30(
            preset in prop::sample::select(&Preset::ALL[..]), beta2_deg in -180.0..180.0,
        ) {
            let arm = arm_at(preset, 0.0, beta2_deg);
            for (mode, closed) in modes(&arm).iter().zip(arm.angular_frequencies_rad_s()) {
                prop_assert!((mode.frequency_hz * TAU / closed - 1.0).abs() < 1e-12, "{mode:?} {closed}");
            }
        }

        #[test]
        fn shapes_solve_the_eigenproblem(preset in prop::sample::select(&Preset::ALL[..]), beta2_deg in -180.0..180.0) {
            let arm = arm_at(preset, 0.0, beta2_deg);
            let m = arm.mass_matrix(&Vector2::zeros());
            let shapes = modes(&arm).map(|mode| Vector2::from(mode.shape));
            for (mode, shape) in modes(&arm).iter().zip(shapes) {
                let omega = TAU * mode.frequency_hz;
                let residual = arm.stiffness_matrix() * shape - m * shape * (omega * omega);
                prop_assert!(residual.norm() < 1e-9 * (arm.stiffness_matrix() * shape).norm(), "{residual}");
                prop_assert!((shape.dot(&(m * shape)) - 1.0).abs() < 1e-11 && shape.x > 0.0);
            }
            prop_assert!(shapes[0].dot(&(m * shapes[1])).abs() < 1e-11);
        }
    }

    /// Eq. (26) without coupling (a3 + a2 cos β2 = 0): each joint vibrates alone, and only its own damper damps it.
    #[test]
    fn uncoupled_joints_vibrate_alone() {
        let preset = Preset::Irb1600Fitted.parameters().unwrap();
        // a2 = 6 · 1 · 0.5 = 3 and a3 = 1.5 + 6 · 0.25 = 3, so that at β2 = 180° a3 + a2 cos β2 = 0 without rounding.
        let parameters = Parameters { mass2_kg: 6.0, length1_m: 1.0, centre2_m: 0.5, inertia2_kg_m2: 1.5, ..preset };
        let arm = Arm::new(parameters, Pose { beta1_deg: 0.0, beta2_deg: 180.0 }).unwrap();
        let [low, high] = modes(&arm);
        assert_eq!([low.shape[0] == 0.0, high.shape[1] == 0.0], [true, true], "{low:?} {high:?}");
        assert!(low.shape[1] > 0.0 && (low.frequency_hz * TAU - libm::sqrt(128_000.0 / 3.0)).abs() < 1e-11);
        assert!((low.damping_ratio - 0.9 / (2.0 * libm::sqrt(128_000.0 * 3.0))).abs() < 1e-15);
    }
}
