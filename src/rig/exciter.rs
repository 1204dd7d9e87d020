//! The exciter: an ideal force (or joint torque) source with limits.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::arm::Load;
use crate::number::short;

/// What no rig can be.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RigError {
    /// A value of the specification is impossible.
    #[error("{instrument}: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Spec {
        /// The instrument, as it is called in a scenario.
        instrument: &'static str,
        /// The value, as it is called in a scenario.
        name: &'static str,
        /// What was given.
        got: f64,
        /// What would do.
        expected: &'static str,
    },
}

/// An ideal exciter: what is commanded acts on the arm at once and exactly, up to a limit an axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExciterSpec {
    /// Largest force along each axis, N, positive.
    pub force_limit_n: f64,
    /// Largest torque at each joint, N·m, positive.
    pub torque_limit_nm: f64,
}

impl Default for ExciterSpec {
    /// 600 N, 1600 N·m: just inside what the wire's classic profile can say.
    fn default() -> ExciterSpec {
        ExciterSpec { force_limit_n: 600.0, torque_limit_nm: 1600.0 }
    }
}

impl ExciterSpec {
    pub(super) fn check(&self) -> Result<(), RigError> {
        for (name, got) in [("force_limit_n", self.force_limit_n), ("torque_limit_nm", self.torque_limit_nm)] {
            if !(got.is_finite() && got > 0.0) {
                return Err(RigError::Spec { instrument: "rig.exciter", name, got, expected: "a positive number" });
            }
        }
        Ok(())
    }

    /// Whether the exciter can produce the load.
    pub fn can_produce(&self, load: &Load) -> bool {
        load.force_n.iter().all(|force| force.abs() <= self.force_limit_n)
            && load.torque_nm.iter().all(|torque| torque.abs() <= self.torque_limit_nm)
    }
}
