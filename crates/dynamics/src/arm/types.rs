//! State and load of the arm.

use nalgebra::Vector2;

use crate::integrate::Motion;

/// The vibration of the arm about its pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// α: deflections of joints 1 and 2, rad.
    pub alpha_rad: Vector2<f64>,
    /// α̇, rad/s.
    pub alpha_dot_rad_s: Vector2<f64>,
}

impl State {
    /// The state with α = `(alpha1_rad, alpha2_rad)` and α̇ = `(alpha1_dot_rad_s, alpha2_dot_rad_s)`.
    pub fn new(alpha_rad: [f64; 2], alpha_dot_rad_s: [f64; 2]) -> State {
        State { alpha_rad: alpha_rad.into(), alpha_dot_rad_s: alpha_dot_rad_s.into() }
    }

    /// Whether all four numbers are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        let (x, v) = (&self.alpha_rad, &self.alpha_dot_rad_s);
        x.x.is_finite() & x.y.is_finite() & v.x.is_finite() & v.y.is_finite()
    }
}

impl From<&State> for Motion<f64> {
    #[inline(always)]
    fn from(state: &State) -> Motion<f64> {
        Motion { x: state.alpha_rad.into(), v: state.alpha_dot_rad_s.into() }
    }
}

impl From<State> for Motion<f64> {
    #[inline(always)]
    fn from(state: State) -> Motion<f64> {
        Motion::from(&state)
    }
}

impl From<Motion<f64>> for State {
    #[inline(always)]
    fn from(motion: Motion<f64>) -> State {
        State { alpha_rad: motion.x.into(), alpha_dot_rad_s: motion.v.into() }
    }
}

/// The load on the arm from outside: the right-hand side of Eq. (3).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// u: torques at joints 1 and 2, N·m.
    pub torque_nm: Vector2<f64>,
    /// F: force at point C along x and y of the base frame, N.
    pub force_n: Vector2<f64>,
}

impl Load {
    /// A torque u at the joints, N·m, and no force.
    pub fn torque_nm(u1_nm: f64, u2_nm: f64) -> Load {
        Load { torque_nm: Vector2::new(u1_nm, u2_nm), ..Load::default() }
    }

    /// A force F at point C, N, and no torque.
    pub fn force_n(fx_n: f64, fy_n: f64) -> Load {
        Load { force_n: Vector2::new(fx_n, fy_n), ..Load::default() }
    }

    /// The load times a factor (dimensionless).
    #[inline]
    pub fn scaled(&self, factor: f64) -> Load {
        Load { torque_nm: self.torque_nm * factor, force_n: self.force_n * factor }
    }
}
