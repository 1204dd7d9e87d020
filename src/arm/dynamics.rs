//! The equation of motion: M, C, D, K, the acceleration, and the acceleration's derivatives.

use nalgebra::{Matrix2, Vector2};

use super::{Arm, Load, State};

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
    /// Sine and cosine of β2 + α2.
    fn elbow(&self, alpha2_rad: f64) -> (f64, f64) {
        libm::sincos(self.beta2_rad + alpha2_rad)
    }

    /// M(α,β), Eq. (19), kg·m². Symmetric positive definite at every angle.
    pub fn mass_matrix(&self, alpha_rad: &Vector2<f64>) -> Matrix2<f64> {
        let (_, cosine) = self.elbow(alpha_rad.y);
        self.mass_matrix_at(cosine)
    }

    fn mass_matrix_at(&self, cosine: f64) -> Matrix2<f64> {
        let a = &self.inertia;
        let coupling = a.a3 + a.a2 * cosine;
        Matrix2::new(a.a1 + 2.0 * a.a2 * cosine, coupling, coupling, a.a3)
    }

    /// C(α,α̇,β), Eq. (20), N·m·s/rad, in the form for which Ṁ − 2C is skew-symmetric.
    pub fn coriolis_matrix(&self, state: &State) -> Matrix2<f64> {
        let (sine, _) = self.elbow(state.alpha_rad.y);
        let (v, h) = (&state.alpha_dot_rad_s, self.inertia.a2 * sine);
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
        let (sine, cosine) = self.elbow(state.alpha_rad.y);
        let r = self.generalised_force(&state.alpha_rad, load) - self.internal_force(state, self.inertia.a2 * sine);
        self.solve_mass(cosine, &r)
    }

    /// Cα̇ + Dα̇ + Kα, N·m, with h = a2 sin(β2+α2): Cα̇ = h (−2 α̇1 α̇2 − α̇2², α̇1²).
    fn internal_force(&self, state: &State, h: f64) -> Vector2<f64> {
        let (p, x, v) = (&self.parameters, &state.alpha_rad, &state.alpha_dot_rad_s);
        Vector2::new(
            p.damping1_nm_s_rad * v.x + p.stiffness1_nm_rad * x.x - h * (2.0 * v.x + v.y) * v.y,
            p.damping2_nm_s_rad * v.y + p.stiffness2_nm_rad * x.y + h * v.x * v.x,
        )
    }

    /// M⁻¹ r by Cramer's rule; det M = a1 a3 − a3² − a2² cos² > 0.
    fn solve_mass(&self, cosine: f64, r: &Vector2<f64>) -> Vector2<f64> {
        let a = &self.inertia;
        let (m11, m12, m22) = (a.a1 + 2.0 * a.a2 * cosine, a.a3 + a.a2 * cosine, a.a3);
        let inverse_determinant = 1.0 / (m11 * m22 - m12 * m12);
        Vector2::new((m22 * r.x - m12 * r.y) * inverse_determinant, (m11 * r.y - m12 * r.x) * inverse_determinant)
    }

    /// α̈ and its derivatives at a state.
    ///
    /// From M α̈ = r follows ∂α̈/∂x = M⁻¹ (∂r/∂x − ∂M/∂x α̈). Only α2 enters M: ∂M/∂α2 = −a2 s [[2, 1], [1, 0]]. In
    /// r = u + JᵀF − Cα̇ − Dα̇ − Kα the derivative of Cα̇ by α2 replaces s by c, and ∂(JᵀF)/∂α is symmetric, because a
    /// constant force at C has a potential: with P = F·(link 2), Q = F·(link 1), both turned as below,
    /// ∂(JᵀF)/∂α = −[[Q + P, P], [P, P]].
    pub fn acceleration_jacobian(&self, state: &State, load: &Load) -> AccelerationJacobian {
        let (sine, cosine) = self.elbow(state.alpha_rad.y);
        let (h, h_by_alpha2) = (self.inertia.a2 * sine, self.inertia.a2 * cosine);
        let (p, v) = (&self.parameters, &state.alpha_dot_rad_s);
        let force = self.generalised_force(&state.alpha_rad, load);
        let acceleration = self.solve_mass(cosine, &(force - self.internal_force(state, h)));

        let mut by_alpha = -self.stiffness_matrix() + self.tip_force_gradient(&state.alpha_rad, load);
        by_alpha.m12 += h_by_alpha2 * (2.0 * v.x + v.y) * v.y + h * (2.0 * acceleration.x + acceleration.y);
        by_alpha.m22 += -h_by_alpha2 * v.x * v.x + h * acceleration.x;
        let by_alpha_dot = Matrix2::new(
            2.0 * h * v.y - p.damping1_nm_s_rad,
            2.0 * h * (v.x + v.y),
            -2.0 * h * v.x,
            -p.damping2_nm_s_rad,
        );
        let columns = |m: &Matrix2<f64>| {
            Matrix2::from_columns(&[
                self.solve_mass(cosine, &m.column(0).into_owned()),
                self.solve_mass(cosine, &m.column(1).into_owned()),
            ])
        };
        AccelerationJacobian {
            acceleration_rad_s2: acceleration,
            by_alpha: columns(&by_alpha),
            by_alpha_dot: columns(&by_alpha_dot),
        }
    }

    /// ∂(JᵀF)/∂α, N·m/rad, as [`Arm::acceleration_jacobian`] states it: Q = F·(l1 c1, l1 s1), P = F·(l2 c12, l2 s12).
    fn tip_force_gradient(&self, alpha_rad: &Vector2<f64>, load: &Load) -> Matrix2<f64> {
        if load.force_n == Vector2::zeros() {
            return Matrix2::zeros();
        }
        let points = self.points(alpha_rad);
        let p = load.force_n.dot(&(points.c_m - points.b_m));
        let q = load.force_n.dot(&points.b_m);
        -Matrix2::new(q + p, p, p, p)
    }
}
