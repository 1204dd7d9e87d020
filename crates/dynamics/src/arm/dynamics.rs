//! The equation of motion: M, C, D, K, the acceleration, and the acceleration's derivatives.

use nalgebra::{Matrix2, Vector2};

use super::attachment::{AttachedExternal, solved};
use super::external::External;
use super::{Arm, Load, State};
use crate::integrate::{Motion, Rates};

/// Derivatives of α̈ with respect to the state, at one state and load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelerationJacobian {
    /// α̈ itself, rad/s².
    pub acceleration_rad_s2: Vector2<f64>,
    /// ∂α̈/∂α, 1/s².
    pub by_alpha: Matrix2<f64>,
    /// ∂α̈/∂α̇, 1/s.
    pub by_alpha_dot: Matrix2<f64>,
}

impl Arm {
    /// M(α,β), Eq. (19), kg·m², and the attachment's mass. Symmetric positive definite at every angle.
    pub fn mass_matrix(&self, alpha_rad: &Vector2<f64>) -> Matrix2<f64> {
        let (_, t) = self.coefficients.coupling::<true>(alpha_rad.y);
        self.mass_matrix_at(t) + self.attached_at(alpha_rad, |attachment| attachment.mass_kg)
    }

    /// M of the arm alone for t = a2 cos(β2+α2), kg·m².
    pub(super) fn mass_matrix_at(&self, t: f64) -> Matrix2<f64> {
        let c = &self.coefficients;
        Matrix2::new(c.a1 + 2.0 * t, c.a3 + t, c.a3 + t, c.a3)
    }

    /// C(α,α̇,β), Eq. (20), N·m·s/rad, in the form for which Ṁ − 2C is skew-symmetric.
    pub fn coriolis_matrix(&self, state: &State) -> Matrix2<f64> {
        let v = &state.alpha_dot_rad_s;
        let (h, _) = self.coefficients.coupling::<true>(state.alpha_rad.y);
        Matrix2::new(-h * v.y, -h * (v.x + v.y), h * v.x, 0.0)
    }

    /// D, Eq. (21), N·m·s/rad.
    pub fn damping_matrix(&self) -> Matrix2<f64> {
        let p = &self.parameters;
        Matrix2::new(p.damping1_nm_s_rad, 0.0, 0.0, p.damping2_nm_s_rad)
    }

    /// K, Eq. (22), N·m/rad.
    pub fn stiffness_matrix(&self) -> Matrix2<f64> {
        let p = &self.parameters;
        Matrix2::new(p.stiffness1_nm_rad, 0.0, 0.0, p.stiffness2_nm_rad)
    }

    /// The generalised force of a load, u + JᵀF (Eqs. 23, 24), N·m.
    pub fn generalised_force(&self, alpha_rad: &Vector2<f64>, load: &Load) -> Vector2<f64> {
        if load.force_n == Vector2::zeros() {
            return load.torque_nm;
        }
        load.torque_nm + self.tip_jacobian(alpha_rad).tr_mul(&load.force_n)
    }

    /// α̈ from Eq. (3), rad/s².
    pub fn acceleration(&self, state: &State, load: &Load) -> Vector2<f64> {
        self.rates_at(&state.into(), load).acceleration.into()
    }

    /// The same with the power.
    #[inline(always)]
    pub(super) fn rates_at(&self, motion: &Motion<f64>, load: &Load) -> Rates<f64> {
        let c = &self.coefficients;
        if let Some(attached) = &self.attached {
            let external = AttachedExternal::new(c, &attached.coefficients, load);
            return attached.coefficients.rates_anywhere(c, motion, &external);
        }
        let external = External::new(c, load);
        if external.follows_links {
            c.rates_anywhere::<true>(motion, &external)
        } else {
            c.rates_anywhere::<false>(motion, &external)
        }
    }

    /// α̈ and its derivatives at a state.
    ///
    /// From M α̈ = r follows ∂α̈/∂x = M⁻¹ (∂r/∂x − ∂M/∂x α̈). Only α2 enters M: ∂M/∂α2 = −a2 s [[2, 1], [1, 0]]. In r =
    /// u + JᵀF − Cα̇ − Dα̇ − Kα the derivative of Cα̇ by α2 replaces s by c, and ∂(JᵀF)/∂α is symmetric, because a
    /// constant force at C has a potential, as has the weight, whose share of r has the derivative −∂G/∂α: with P =
    /// F·(link 2), Q = F·(link 1), both turned as below, ∂(JᵀF)/∂α = −[[Q + P, P], [P, P]].
    pub fn acceleration_jacobian(&self, state: &State, load: &Load) -> AccelerationJacobian {
        if self.attached.is_some() {
            return self.attached_jacobian(state, self.acceleration(state, load), load);
        }
        let c = &self.coefficients;
        let (h, t) = c.coupling::<true>(state.alpha_rad.y);
        let (p, v) = (&self.parameters, &state.alpha_dot_rad_s);
        let force = External::new(c, load).at_angles(state.alpha_rad.into());
        let solve = |r: [f64; 2]| c.solve_mass(t, r);
        let acceleration = Vector2::from(solve(c.torques(&state.into(), h, force)));

        let mut by_alpha =
            self.tip_force_gradient(&state.alpha_rad, load) - self.stiffness_of_joints_and_weight(&state.alpha_rad);
        by_alpha.m12 += t * (2.0 * v.x + v.y) * v.y + h * (2.0 * acceleration.x + acceleration.y);
        by_alpha.m22 += -t * v.x * v.x + h * acceleration.x;
        let by_alpha_dot = Matrix2::new(
            2.0 * h * v.y - p.damping1_nm_s_rad,
            2.0 * h * (v.x + v.y),
            -2.0 * h * v.x,
            -p.damping2_nm_s_rad,
        );
        let solved = |m: &Matrix2<f64>| {
            let [left, right] = [[m.m11, m.m21], [m.m12, m.m22]].map(solve);
            Matrix2::new(left[0], right[0], left[1], right[1])
        };
        AccelerationJacobian {
            acceleration_rad_s2: acceleration,
            by_alpha: solved(&by_alpha),
            by_alpha_dot: solved(&by_alpha_dot),
        }
    }

    /// The same with an attachment, from the unbalance r(α, α̇, α̈) = 0: ∂α̈/∂x = −(∂r/∂α̈)⁻¹ ∂r/∂x.
    fn attached_jacobian(&self, state: &State, acceleration_rad_s2: Vector2<f64>, load: &Load) -> AccelerationJacobian {
        let at = self.inverse_dynamics(state, &acceleration_rad_s2, load);
        let by = |m: &Matrix2<f64>| {
            let [left, right] = [0, 1].map(|n| solved(&at.by_alpha_ddot, &-m.column(n)));
            Matrix2::from_columns(&[left, right])
        };
        AccelerationJacobian { acceleration_rad_s2, by_alpha: by(&at.by_alpha), by_alpha_dot: by(&at.by_alpha_dot) }
    }

    /// ∂(JᵀF)/∂α, N·m/rad, as [`Arm::acceleration_jacobian`] states it: Q = F·(l1 c1, l1 s1), P = F·(l2 c12, l2 s12).
    pub(super) fn tip_force_gradient(&self, alpha_rad: &Vector2<f64>, load: &Load) -> Matrix2<f64> {
        if load.force_n == Vector2::zeros() {
            return Matrix2::zeros();
        }
        let points = self.points(alpha_rad);
        let p = load.force_n.dot(&(points.c_m - points.b_m));
        let q = load.force_n.dot(&points.b_m);
        -Matrix2::new(q + p, p, p, p)
    }
}
