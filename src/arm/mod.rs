//! The arm: two links with compliant joints (Gierlak & Warmiński 2023, IRB 1600), exactly.
//!
//! The joint angles are qᵢ = βᵢ + αᵢ (Eq. 1): the pose β is constant, the vibration α is what moves. The equation of motion
//! (Eq. 3) is
//!
//! ```text
//! M(α,β) α̈ + C(α,α̇,β) α̇ + D α̇ + K α = u + J(α,β)ᵀ F
//! ```
//!
//! with torques u at the joints and a force F at the tip, point C. Point B is the elbow. Equation numbers in this module
//! are those of P. Gierlak, J. Warmiński, "Analysis of Bifurcation Vibrations of an Industrial Robot Arm System with Joints
//! Compliance", Appl. Sci. 2023, 13, 11941.

mod angle;
mod dynamics;
mod energy;
mod error;
mod gravity;
mod inverse_dynamics;
pub(crate) mod kernel;
mod kinematics;
mod modes;
mod parameters;
mod preset;
pub(crate) mod real;
mod types;

pub use dynamics::AccelerationJacobian;
pub use energy::Energy;
pub use error::ArmError;
pub use gravity::Gravity;
pub use inverse_dynamics::InverseDynamics;
pub use kinematics::{PointMotion, Points};
pub use parameters::{Parameters, Pose};
pub use preset::Preset;
pub use types::{Load, State};

use kernel::Coefficients;
use nalgebra::Vector2;

/// An arm with valid parameters in a valid pose: everything constant about it, ready for computing.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    parameters: Parameters,
    pose: Pose,
    static_deflection_rad: Vector2<f64>,
    pub(crate) coefficients: Coefficients<f64>,
}

impl Arm {
    /// Checks the parameters and the pose and makes an arm of them.
    ///
    /// # Errors
    /// [`ArmError`] names the first value that no arm can have, or says that the joints can't hold the arm's weight.
    pub fn new(parameters: Parameters, pose: Pose) -> Result<Arm, ArmError> {
        parameters.check()?;
        pose.validate()?;
        let relaxed_rad = [pose.beta1_deg.to_radians(), pose.beta2_deg.to_radians()];
        let sag = gravity::static_deflection(&parameters, relaxed_rad)?;
        let coefficients = Coefficients::new(&parameters, [relaxed_rad[0] + sag.x, relaxed_rad[1] + sag.y]);
        Ok(Arm { parameters, pose, static_deflection_rad: sag, coefficients })
    }

    /// The same arm with d1 = d2 = 0.
    #[must_use]
    pub fn without_dampers(&self) -> Arm {
        let mut arm = self.clone();
        (arm.parameters.damping1_nm_s_rad, arm.parameters.damping2_nm_s_rad) = (0.0, 0.0);
        arm.coefficients.d = [0.0; 2];
        arm
    }

    /// The parameters the arm was made of.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The pose the arm was made in.
    pub fn pose(&self) -> Pose {
        self.pose
    }
}

#[cfg(test)]
pub(crate) mod tests;
