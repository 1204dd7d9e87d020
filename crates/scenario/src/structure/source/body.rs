//! Rigid-body geometry: frames, inertia, and the union of several bodies.

use nalgebra::{Matrix3, Rotation3, Vector3};

/// A frame: the position of its origin, m, and its rotation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub at: Vector3<f64>,
    pub turn: Matrix3<f64>,
}

impl Frame {
    /// Returns the reference frame itself.
    pub fn identity() -> Frame {
        Frame { at: Vector3::zeros(), turn: Matrix3::identity() }
    }

    /// Returns the frame at an origin with roll, pitch and yaw about the fixed axes x, y, z: Rz(yaw) Ry(pitch)
    /// Rx(roll), as in URDF.
    pub fn new(at: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Frame {
        Frame { at: Vector3::from(at), turn: *Rotation3::from_euler_angles(roll, pitch, yaw).matrix() }
    }

    /// Returns the inner frame, stated relative to this one, relative to this one's reference.
    pub fn then(&self, inner: &Frame) -> Frame {
        Frame { at: self.at + self.turn * inner.at, turn: self.turn * inner.turn }
    }
}

/// Mass and inertia of one body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inertial {
    /// Centre of mass and orientation of the inertia tensor's axes.
    pub frame: Frame,
    /// Mass as the file states it, kg; not checked.
    pub mass_kg: f64,
    /// Inertia tensor about the centre of mass as the file states it, kg·m²; not checked.
    pub inertia_kg_m2: Matrix3<f64>,
}

impl Inertial {
    /// Moment of inertia about a unit axis through the centre of mass, kg·m²; the axis is stated in the
    /// reference of `frame`.
    pub fn about(&self, axis: &Vector3<f64>) -> f64 {
        // The tensor is stated along the body's own axes, so the axis is turned into these: the moment is n′ᵀI n′ with
        // n′ = Rᵀn.
        let own = self.frame.turn.transpose() * axis;
        own.dot(&(self.inertia_kg_m2 * own))
    }

    /// Returns the principal moments of inertia, ascending, kg·m².
    pub fn principal_kg_m2(&self) -> [f64; 3] {
        let moments = self.inertia_kg_m2.symmetric_eigenvalues();
        let mut moments = [moments[0], moments[1], moments[2]];
        moments.sort_by(f64::total_cmp);
        moments
    }
}

/// Several bodies combined into one rigid body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Whole {
    /// Sum of the masses, kg.
    pub mass_kg: f64,
    /// Common centre of mass, m.
    pub centre: Vector3<f64>,
    /// Moment of inertia about the given axis through the centre of mass, kg·m².
    pub inertia_kg_m2: f64,
}

/// Combines bodies given in one frame, about a unit axis n; `None` if there are no bodies.
///
/// m = Σ m_b, c = Σ m_b c_b / m, and by the theorem of parallel axes (J. Steiner, 1840) I = Σ nᵀR_b I_b R_bᵀn + m_b
/// |n × (c_b − c)|².
pub(super) fn together(bodies: &[Inertial], axis: &Vector3<f64>) -> Option<Whole> {
    let mass_kg: f64 = bodies.iter().map(|body| body.mass_kg).sum();
    // All masses are positive here, as each body has been checked, so that only no body at all makes the quotient
    // below impossible.
    if bodies.is_empty() {
        return None;
    }
    let moment = bodies.iter().fold(Vector3::zeros(), |sum, body| sum + body.frame.at * body.mass_kg);
    let centre = moment / mass_kg;
    let about =
        |body: &Inertial| body.about(axis) + body.mass_kg * axis.cross(&(body.frame.at - centre)).norm_squared();
    Some(Whole { mass_kg, centre, inertia_kg_m2: bodies.iter().map(about).sum() })
}
