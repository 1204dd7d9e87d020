//! Positions, velocities and accelerations of the points B (elbow) and C (tip) in the base frame.

use nalgebra::{Matrix2, Vector2};

use super::{Arm, Load, State};

/// Positions of the points, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Points {
    /// B = (l1 c1, l1 s1).
    pub b_m: Vector2<f64>,
    /// C = B + (l2 c12, l2 s12), Eq. (27).
    pub c_m: Vector2<f64>,
}

/// Accelerations of the points, m/s².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointMotion {
    /// Acceleration of B along x and y.
    pub b_m_s2: Vector2<f64>,
    /// Acceleration of C along x and y.
    pub c_m_s2: Vector2<f64>,
}

impl Arm {
    /// Positions of B and C.
    pub fn points(&self, alpha_rad: &Vector2<f64>) -> Points {
        let (first, second) = self.links(alpha_rad);
        Points { b_m: first, c_m: first + second }
    }

    /// The links as vectors: l1 (c1, s1) and l2 (c12, s12), m.
    fn links(&self, alpha_rad: &Vector2<f64>) -> (Vector2<f64>, Vector2<f64>) {
        let (s1, c1) = self.coefficients.link1.sincos_plus(alpha_rad.x);
        let (s12, c12) = self.coefficients.link2.sincos_plus(alpha_rad.x + alpha_rad.y);
        let p = &self.parameters;
        (Vector2::new(c1, s1) * p.length1_m, Vector2::new(c12, s12) * p.length2_m)
    }

    /// J, Eq. (28), m: the velocity of C is J α̇, and a force F at C acts on the joints as JᵀF.
    pub fn tip_jacobian(&self, alpha_rad: &Vector2<f64>) -> Matrix2<f64> {
        let points = self.points(alpha_rad);
        let (c, second) = (points.c_m, points.c_m - points.b_m);
        Matrix2::new(-c.y, -second.y, c.x, second.x)
    }

    /// Velocities of B and C, m/s.
    pub fn point_velocities(&self, state: &State) -> [Vector2<f64>; 2] {
        velocities(self.links(&state.alpha_rad), state)
    }

    /// Accelerations of B and C, with the centripetal terms.
    pub fn point_accelerations(&self, state: &State, acceleration_rad_s2: &Vector2<f64>) -> PointMotion {
        accelerations(self.links(&state.alpha_rad), state, acceleration_rad_s2)
    }

    /// Velocities of B and C, m/s, and their accelerations under a load.
    pub fn point_motion(&self, state: &State, load: &Load) -> ([Vector2<f64>; 2], PointMotion) {
        let links = self.links(&state.alpha_rad);
        (velocities(links, state), accelerations(links, state, &self.acceleration(state, load)))
    }
}

/// Velocities of B and C with the links as vectors: r turning with the rate w has w (−r_y, r_x).
fn velocities((first, second): (Vector2<f64>, Vector2<f64>), state: &State) -> [Vector2<f64>; 2] {
    let turning = |r: Vector2<f64>, w: f64| Vector2::new(-r.y, r.x) * w;
    let v = &state.alpha_dot_rad_s;
    let b_m_s = turning(first, v.x);
    [b_m_s, b_m_s + turning(second, v.x + v.y)]
}

/// Accelerations of B and C with the links as vectors: r turning with the rate w and the angular acceleration e adds e
/// (−r_y, r_x) − w² r; link 1 turns with α̇1, link 2 with α̇1 + α̇2.
fn accelerations(
    (first, second): (Vector2<f64>, Vector2<f64>),
    state: &State,
    acceleration_rad_s2: &Vector2<f64>,
) -> PointMotion {
    let turning = |r: Vector2<f64>, w: f64, e: f64| Vector2::new(-r.y, r.x) * e - r * (w * w);
    let (v, a) = (&state.alpha_dot_rad_s, acceleration_rad_s2);
    let b_m_s2 = turning(first, v.x, a.x);
    PointMotion { b_m_s2, c_m_s2: b_m_s2 + turning(second, v.x + v.y, a.x + a.y) }
}
