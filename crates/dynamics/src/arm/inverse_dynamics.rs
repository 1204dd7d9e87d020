//! Inverse dynamics: the torques that a given motion lacks, and how they change with the motion.

use nalgebra::{Matrix2, Vector2};

use super::external::External;
use super::{Arm, Load, State};

/// The unbalanced torque of a motion and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseDynamics {
    /// M α̈ + C α̇ + D α̇ + K α − u − JᵀF with the attachment, N·m; zero along a true motion.
    pub unbalance_nm: Vector2<f64>,
    /// ∂/∂α, N·m/rad.
    pub by_alpha: Matrix2<f64>,
    /// ∂/∂α̇, N·m·s/rad.
    pub by_alpha_dot: Matrix2<f64>,
    /// ∂/∂α̈ = M, kg·m².
    pub by_alpha_ddot: Matrix2<f64>,
}

impl Arm {
    /// Eq. (3) with everything on one side, N·m, at any α̈ (rad/s²), true or not.
    pub fn unbalance_nm(&self, state: &State, acceleration_rad_s2: &Vector2<f64>, load: &Load) -> Vector2<f64> {
        let alone = self.unbalance_of_arm_nm(state, acceleration_rad_s2, load);
        if self.attached.is_none() { alone } else { alone + self.attached_unbalance_nm(state, acceleration_rad_s2) }
    }

    /// The same without the attachment.
    pub(super) fn unbalance_of_arm_nm(
        &self,
        state: &State,
        acceleration_rad_s2: &Vector2<f64>,
        load: &Load,
    ) -> Vector2<f64> {
        let c = &self.coefficients;
        let (h, t) = c.coupling::<true>(state.alpha_rad.y);
        let force = External::new(c, load).at_angles(state.alpha_rad.into());
        let inner = self.mass_matrix_at(t) * acceleration_rad_s2;
        inner - Vector2::from(c.torques(&state.into(), h, force))
    }

    /// The unbalanced torque and its derivatives by α, α̇ and α̈.
    ///
    /// With h = a2 sin(β2+α2) and t = ∂h/∂α2 = a2 cos(β2+α2): only α2 enters M, so ∂(M α̈)/∂α2 = −h (2 α̈1 + α̈2, α̈1);
    /// Cα̇ = h (−2 α̇1 α̇2 − α̇2², α̇1²), so its derivative by α2 has t in place of h. The springs, the weight and the
    /// force at the tip add K + ∂G/∂α − ∂(JᵀF)/∂α.
    pub fn inverse_dynamics(&self, state: &State, acceleration_rad_s2: &Vector2<f64>, load: &Load) -> InverseDynamics {
        let (h, t) = self.coefficients.coupling::<true>(state.alpha_rad.y);
        let (p, x, v, a) = (&self.parameters, &state.alpha_rad, &state.alpha_dot_rad_s, acceleration_rad_s2);
        let mut by_alpha = self.stiffness_of_joints_and_weight(x) - self.tip_force_gradient(x, load);
        by_alpha.m12 -= t * (2.0 * v.x + v.y) * v.y + h * (2.0 * a.x + a.y);
        by_alpha.m22 += t * v.x * v.x - h * a.x;
        let by_alpha_dot = Matrix2::new(
            p.damping1_nm_s_rad - 2.0 * h * v.y,
            -2.0 * h * (v.x + v.y),
            2.0 * h * v.x,
            p.damping2_nm_s_rad,
        );
        let unbalance_nm = self.unbalance_of_arm_nm(state, a, load);
        let alone = InverseDynamics { unbalance_nm, by_alpha, by_alpha_dot, by_alpha_ddot: self.mass_matrix_at(t) };
        self.add_attached(state, a, alone)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Preset;
    use crate::arm::tests::arm;

    #[test]
    fn is_the_equation_of_motion_and_its_derivative() {
        let arm = arm(Preset::Irb1600Fitted, 20.0, 70.0);
        let load = Load { torque_nm: [60.0, -10.0].into(), force_n: [30.0, -25.0].into() };
        let (x, v) = (Vector2::new(0.2, -0.3), Vector2::new(12.0, -20.0));
        let state = State { alpha_rad: x, alpha_dot_rad_s: v };
        let truth = arm.acceleration(&state, &load);
        assert!(arm.unbalance_nm(&state, &truth, &load).norm() < 1e-9 * 555_000.0);

        let a = truth + Vector2::new(100.0, -50.0);
        let exact = arm.inverse_dynamics(&state, &a, &load);
        let at = |x, v, a| arm.unbalance_nm(&State { alpha_rad: x, alpha_dot_rad_s: v }, &a, &load);
        assert!((exact.unbalance_nm - at(x, v, a)).norm() < 1e-9);
        for column in 0..2 {
            let mut e = Vector2::zeros();
            e[column] = 1e-5;
            let close = |exact: Vector2<f64>, seen: Vector2<f64>| {
                assert!((exact - seen / 2e-5).norm() < 1e-6 * (1.0 + exact.norm()), "{exact} {seen}");
            };
            close(exact.by_alpha.column(column).into(), at(x + e, v, a) - at(x - e, v, a));
            close(exact.by_alpha_dot.column(column).into(), at(x, v + e, a) - at(x, v - e, a));
            close(exact.by_alpha_ddot.column(column).into(), at(x, v, a + e) - at(x, v, a - e));
        }
    }
}
