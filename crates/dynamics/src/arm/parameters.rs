//! The physical parameters (Table 1) and the pose.

use serde::{Deserialize, Serialize};

use super::{ArmError, Gravity};

/// The parameters of the arm; symbols of the paper in brackets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Moment of inertia of link 1 about joint A (I_A1), kg·m², positive.
    pub inertia1_kg_m2: f64,
    /// Moment of inertia of link 2 about its centre of mass (I_S2), kg·m², positive.
    pub inertia2_kg_m2: f64,
    /// Mass of link 2 (m2), kg, positive.
    pub mass2_kg: f64,
    /// Length of link 1, from joint A to joint B (l1), m, positive.
    pub length1_m: f64,
    /// Length of link 2, from joint B to the tip C (l2), m, positive.
    pub length2_m: f64,
    /// Distance of the centre of mass of link 2 from joint B (lc2), m, not negative.
    pub centre2_m: f64,
    /// Stiffness of joint 1 (k1), N·m/rad, positive.
    pub stiffness1_nm_rad: f64,
    /// Stiffness of joint 2 (k2), N·m/rad, positive.
    pub stiffness2_nm_rad: f64,
    /// Viscous damping of joint 1 (d1), N·m·s/rad, not negative.
    pub damping1_nm_s_rad: f64,
    /// Viscous damping of joint 2 (d2), N·m·s/rad, not negative.
    pub damping2_nm_s_rad: f64,
    /// Gravity, which the paper leaves out: `None` unless it is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<Gravity>,
}

impl Parameters {
    /// Checks that such an arm can exist. With these signs M is positive definite at every angle, but for rounding,
    /// which [`Arm::new`](super::Arm::new) checks.
    pub(super) fn check(&self) -> Result<(), ArmError> {
        let positive = [
            ("inertia1_kg_m2", self.inertia1_kg_m2),
            ("inertia2_kg_m2", self.inertia2_kg_m2),
            ("mass2_kg", self.mass2_kg),
            ("length1_m", self.length1_m),
            ("length2_m", self.length2_m),
            ("stiffness1_nm_rad", self.stiffness1_nm_rad),
            ("stiffness2_nm_rad", self.stiffness2_nm_rad),
        ];
        for (name, got) in positive {
            if !(got.is_finite() && got > 0.0) {
                return Err(ArmError::Parameter { name, got, expected: "a positive number" });
            }
        }
        let not_negative = [
            ("centre2_m", self.centre2_m),
            ("damping1_nm_s_rad", self.damping1_nm_s_rad),
            ("damping2_nm_s_rad", self.damping2_nm_s_rad),
        ];
        for (name, got) in not_negative {
            if !(got.is_finite() && got >= 0.0) {
                return Err(ArmError::Parameter { name, got, expected: "zero or a positive number" });
            }
        }
        self.gravity.map_or(Ok(()), |gravity| gravity.check())
    }
}

/// The pose of the arm: the constant part β of the joint angles, degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// β1: angle of link 1 against the x axis, degrees, −360 to 360.
    pub beta1_deg: f64,
    /// β2: angle of link 2 against link 1, degrees, −360 to 360; 0 is the straight arm.
    pub beta2_deg: f64,
}

impl Pose {
    fn check(angle: (&'static str, f64)) -> Result<(), ArmError> {
        let (name, got) = angle;
        // Written so that NaN fails too.
        if (-360.0..=360.0).contains(&got) { Ok(()) } else { Err(ArmError::Pose { name, got }) }
    }

    /// Checks that both angles are numbers from −360 to 360 degrees.
    ///
    /// # Errors
    /// [`ArmError::Pose`] names the invalid angle.
    pub fn validate(&self) -> Result<(), ArmError> {
        Pose::check(("beta1_deg", self.beta1_deg))?;
        Pose::check(("beta2_deg", self.beta2_deg))
    }
}

/// The coefficients of Eq. (26), kg·m².
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Inertia {
    /// a1 = I_A1 + I_S2 + m2 (l1² + lc2²)
    pub a1: f64,
    /// a2 = m2 l1 lc2
    pub a2: f64,
    /// a3 = I_S2 + m2 lc2²
    pub a3: f64,
}

impl Inertia {
    pub fn of(p: &Parameters) -> Inertia {
        let centre_squared = p.centre2_m * p.centre2_m;
        Inertia {
            a1: p.inertia1_kg_m2 + p.inertia2_kg_m2 + p.mass2_kg * (p.length1_m * p.length1_m + centre_squared),
            a2: p.mass2_kg * p.length1_m * p.centre2_m,
            a3: p.inertia2_kg_m2 + p.mass2_kg * centre_squared,
        }
    }
}
