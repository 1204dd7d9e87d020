//! Inverse dynamics: the torques that a given motion lacks, and how they change with the motion.

use nalgebra::{Matrix2, Vector2};

use super::{Arm, Load, State};

/// The unbalanced torque of a motion and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseDynamics {
    /// M α̈ + C α̇ + D α̇ + K α − u − JᵀF, N·m; zero along a true motion.
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
        let (sine, cosine) = libm::sincos(self.beta2_rad + state.alpha_rad.y);
        let (p, i) = (&self.parameters, &self.inertia);
        let (x, v, a) = (&state.alpha_rad, &state.alpha_dot_rad_s, acceleration_rad_s2);
        let (h, coupling) = (i.a2 * sine, i.a3 + i.a2 * cosine);
        let inner = Vector2::new(
            (i.a1 + 2.0 * i.a2 * cosine) * a.x + coupling * a.y - h * (2.0 * v.x + v.y) * v.y,
            coupling * a.x + i.a3 * a.y + h * v.x * v.x,
        );
        let springs = Vector2::new(p.stiffness1_nm_rad * x.x, p.stiffness2_nm_rad * x.y);
        let dampers = Vector2::new(p.damping1_nm_s_rad * v.x, p.damping2_nm_s_rad * v.y);
        inner + springs + dampers - self.generalised_force(x, load)
    }

    /// The unbalanced torque and its derivatives by α, α̇ and α̈.
    ///
    /// With h = a2 sin(β2+α2) and g = ∂h/∂α2 = a2 cos(β2+α2): only α2 enters M, so ∂(M α̈)/∂α2 = −h (2 α̈1 + α̈2, α̈1);
    /// Cα̇ = h (−2 α̇1 α̇2 − α̇2², α̇1²), so its derivative by α2 has g in place of h. A constant force at C has a
    /// potential: with P = F·(link 2), Q = F·(link 1), −∂(JᵀF)/∂α = [[Q + P, P], [P, P]].
    pub fn inverse_dynamics(&self, state: &State, acceleration_rad_s2: &Vector2<f64>, load: &Load) -> InverseDynamics {
        let (sine, cosine) = libm::sincos(self.beta2_rad + state.alpha_rad.y);
        let (p, i) = (&self.parameters, &self.inertia);
        let (x, v, a) = (&state.alpha_rad, &state.alpha_dot_rad_s, acceleration_rad_s2);
        let (h, g) = (i.a2 * sine, i.a2 * cosine);
        let (m11, m12) = (i.a1 + 2.0 * g, i.a3 + g);
        let coriolis = Vector2::new(-(2.0 * v.x + v.y) * v.y, v.x * v.x);
        let mut unbalance_nm = Vector2::new(
            m11 * a.x + m12 * a.y + h * coriolis.x + p.stiffness1_nm_rad * x.x + p.damping1_nm_s_rad * v.x,
            m12 * a.x + i.a3 * a.y + h * coriolis.y + p.stiffness2_nm_rad * x.y + p.damping2_nm_s_rad * v.y,
        ) - load.torque_nm;
        let mut by_alpha = Matrix2::new(
            p.stiffness1_nm_rad,
            g * coriolis.x - h * (2.0 * a.x + a.y),
            0.0,
            p.stiffness2_nm_rad + g * coriolis.y - h * a.x,
        );
        if load.force_n != Vector2::zeros() {
            let points = self.points(x);
            let (f, tip, link2) = (&load.force_n, points.c_m, points.c_m - points.b_m);
            unbalance_nm -= Vector2::new(f.y * tip.x - f.x * tip.y, f.y * link2.x - f.x * link2.y);
            let (whole, second) = (f.dot(&tip), f.dot(&link2));
            by_alpha += Matrix2::new(whole, second, second, second);
        }
        let by_alpha_dot = Matrix2::new(
            p.damping1_nm_s_rad - 2.0 * h * v.y,
            -2.0 * h * (v.x + v.y),
            2.0 * h * v.x,
            p.damping2_nm_s_rad,
        );
        InverseDynamics { unbalance_nm, by_alpha, by_alpha_dot, by_alpha_ddot: Matrix2::new(m11, m12, m12, i.a3) }
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
