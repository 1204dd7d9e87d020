//! The load on a structure.

use nalgebra::Vector2;

/// The load that an exciter puts on a structure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Torques at joints 1 and 2, N·m.
    pub torque_nm: Vector2<f64>,
    /// Force at the exciter's point along x and y of the base frame, N.
    pub force_n: Vector2<f64>,
}

impl Load {
    /// Torques at joints 1 and 2, N·m, without a force.
    pub fn torque_nm(joint1_nm: f64, joint2_nm: f64) -> Load {
        Load { torque_nm: Vector2::new(joint1_nm, joint2_nm), ..Load::default() }
    }

    /// A force at the exciter's point, N, without torques.
    pub fn force_n(x_n: f64, y_n: f64) -> Load {
        Load { force_n: Vector2::new(x_n, y_n), ..Load::default() }
    }

    /// The load times a factor (dimensionless).
    #[inline]
    pub fn scaled(&self, factor: f64) -> Load {
        Load { torque_nm: self.torque_nm * factor, force_n: self.force_n * factor }
    }
}
