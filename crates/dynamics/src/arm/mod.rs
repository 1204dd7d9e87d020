//! The arm: two links with compliant joints (Gierlak & Warmiński 2023, IRB 1600), without approximation.
//!
//! The joint angles are qᵢ = βᵢ + αᵢ (Eq. 1): the pose β is constant, α is the vibration. Eq. 3, the equation of
//! motion, is
//!
//! ```text
//! M(α,β) α̈ + C(α,α̇,β) α̇ + D α̇ + K α = u + J(α,β)ᵀ F
//! ```
//!
//! with torques u at the joints and a force F at the tip, point C. Point B is the elbow. An [`Attachment`] moves with
//! the tip, and every method here includes it. Equation numbers in this module are those of P. Gierlak, J. Warmiński,
//! "Analysis of Bifurcation Vibrations of an Industrial Robot Arm System with Joints Compliance", Appl. Sci. 2023, 13,
//! 11941.

pub(crate) mod angle;
mod attachment;
pub(crate) mod coefficients;
mod dynamics;
mod energy;
mod error;
mod excitation;
pub(crate) mod explicit;
pub(crate) mod external;
mod gravity;
mod inverse_dynamics;
mod kernel;
mod kinematics;
mod modes;
mod parameters;
mod preset;
mod stages;
mod types;

pub use attachment::Attachment;
pub use dynamics::AccelerationJacobian;
pub use energy::Energy;
pub use error::ArmError;
pub use excitation::Sine;
pub use gravity::Gravity;
pub use inverse_dynamics::InverseDynamics;
pub use kinematics::{PointMotion, Points};
pub use parameters::{Parameters, Pose};
pub use preset::Preset;
pub use types::{Load, State};

use attachment::Attached;
use coefficients::Coefficients;
use nalgebra::Vector2;

/// The least det M over a3 (a1 − a3) in the straight arm: Cramer's rule then keeps ten digits of α̈.
const LEAST_DETERMINANT: f64 = 1e-6;

/// An arm with valid parameters in a valid pose, with its constants computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    parameters: Parameters,
    pose: Pose,
    static_deflection_rad: Vector2<f64>,
    attached: Option<Attached>,
    pub(crate) coefficients: Coefficients<f64>,
}

impl Arm {
    /// Checks the parameters and the pose and makes an arm of them.
    ///
    /// # Errors
    /// [`ArmError`] names the first impossible value, or says that the joints can't hold the arm's weight, or that the
    /// values, possible one by one, don't make an arm that can be computed.
    pub fn new(parameters: Parameters, pose: Pose) -> Result<Arm, ArmError> {
        parameters.check()?;
        pose.validate()?;
        let relaxed_rad = [pose.beta1_deg.to_radians(), pose.beta2_deg.to_radians()];
        let sag = gravity::static_deflection(&parameters, relaxed_rad)?;
        let coefficients = Coefficients::new(&parameters, [relaxed_rad[0] + sag.x, relaxed_rad[1] + sag.y]);
        let arm = Arm { parameters, pose, static_deflection_rad: sag, attached: None, coefficients };
        arm.check()?;
        Ok(arm)
    }

    /// Checks that M stays positive definite at every angle despite rounding: det M = a3 (a1 − a3) − a2² cos² is least
    /// in the straight arm.
    fn check(&self) -> Result<(), ArmError> {
        let (whole, a2) = (self.coefficients.a3_a1_less_a3, self.coefficients.a2);
        let got = (whole - a2 * a2) / whole;
        // NaN is not in the range, either.
        if !(LEAST_DETERMINANT..=1.0).contains(&got) {
            return Err(ArmError::SingularMass { got, least: LEAST_DETERMINANT });
        }
        let got_rad_s = self.angular_frequencies_rad_s();
        if !got_rad_s.iter().all(|omega| omega.is_finite() && *omega > 0.0) {
            return Err(ArmError::Frequencies { got_hz: got_rad_s.map(|omega| omega / core::f64::consts::TAU) });
        }
        Ok(())
    }

    /// The same arm with d1 = d2 = 0, and an attachment without its damper.
    #[must_use]
    pub fn without_dampers(&self) -> Arm {
        let mut arm = self.clone();
        (arm.parameters.damping1_nm_s_rad, arm.parameters.damping2_nm_s_rad) = (0.0, 0.0);
        arm.coefficients.d = [0.0; 2];
        if let Some(attached) = &mut arm.attached {
            attached.attachment.damping_n_s_m = 0.0;
            attached.coefficients.damping_n_s_m = 0.0;
        }
        arm
    }

    /// β + α_st: the angles of the joints at rest, rad.
    pub(crate) fn joint_angles_at_rest_rad(&self) -> [f64; 2] {
        let sag_rad = self.static_deflection_rad;
        [self.pose.beta1_deg.to_radians() + sag_rad.x, self.pose.beta2_deg.to_radians() + sag_rad.y]
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
