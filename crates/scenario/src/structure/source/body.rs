//! Rigid bodies: frames, and what several bodies are together.

use nalgebra::{Matrix3, Rotation3, Vector3};

/// A frame: where its origin is, m, and how it is turned.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub at: Vector3<f64>,
    pub turn: Matrix3<f64>,
}

impl Frame {
    /// The frame that others count from.
    pub fn identity() -> Frame {
        Frame { at: Vector3::zeros(), turn: Matrix3::identity() }
    }

    /// An origin with roll, pitch and yaw about the fixed axes x, y, z: Rz(yaw) Ry(pitch) Rx(roll).
    pub fn new(at: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Frame {
        Frame { at: Vector3::from(at), turn: *Rotation3::from_euler_angles(roll, pitch, yaw).matrix() }
    }

    /// A frame stated in this one, in the frame that this one is stated in.
    pub fn then(&self, inner: &Frame) -> Frame {
        Frame { at: self.at + self.turn * inner.at, turn: self.turn * inner.turn }
    }
}

/// The mass and inertia of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inertial {
    /// Where the centre of mass is, and how the axes of the inertia are turned.
    pub frame: Frame,
    /// kg, as the file states it.
    pub mass_kg: f64,
    /// About the centre of mass, kg·m², as the file states it.
    pub inertia_kg_m2: Matrix3<f64>,
}

impl Inertial {
    /// The moment about an axis of unit length in the frame that `frame` is stated in, through the centre of mass,
    /// kg·m².
    pub fn about(&self, axis: &Vector3<f64>) -> f64 {
        let own = self.frame.turn.transpose() * axis;
        own.dot(&(self.inertia_kg_m2 * own))
    }

    /// The principal moments, the least first, kg·m².
    pub fn principal_kg_m2(&self) -> [f64; 3] {
        let moments = self.inertia_kg_m2.symmetric_eigenvalues();
        let mut moments = [moments[0], moments[1], moments[2]];
        moments.sort_by(f64::total_cmp);
        moments
    }
}

/// Bodies that are rigidly one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Whole {
    /// kg.
    pub mass_kg: f64,
    /// m.
    pub centre: Vector3<f64>,
    /// About the axis through the centre, kg·m².
    pub inertia_kg_m2: f64,
}

/// What bodies in one frame are together, about an axis n of unit length; `None` of none.
///
/// m = Σ m_b, c = Σ m_b c_b / m, and by the theorem of parallel axes (J. Steiner, 1840) I = Σ nᵀR_b I_b R_bᵀn + m_b
/// |n × (c_b − c)|².
pub(super) fn together(bodies: &[Inertial], axis: &Vector3<f64>) -> Option<Whole> {
    let mass_kg: f64 = bodies.iter().map(|body| body.mass_kg).sum();
    if bodies.is_empty() {
        return None;
    }
    let moment = bodies.iter().fold(Vector3::zeros(), |sum, body| sum + body.frame.at * body.mass_kg);
    let centre = moment / mass_kg;
    let about =
        |body: &Inertial| body.about(axis) + body.mass_kg * axis.cross(&(body.frame.at - centre)).norm_squared();
    Some(Whole { mass_kg, centre, inertia_kg_m2: bodies.iter().map(about).sum() })
}
