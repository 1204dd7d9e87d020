//! The exciter: an ideal source of force or joint torque with limits, or a shaker.

use serde::{Deserialize, Serialize};

use super::error::RigError;
use super::load::Load;
use super::name::Section;
use super::place::PlaceName;
use super::shaker::ShakerSpec;

/// Exciter of the structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exciter {
    /// An ideal force or torque, which acts as it is commanded.
    Ideal(ExciterSpec),
    /// A shaker at the tip.
    Shaker(ShakerSpec),
}

impl Default for Exciter {
    fn default() -> Exciter {
        Exciter::Ideal(ExciterSpec::default())
    }
}

impl Exciter {
    pub(super) fn check(&self) -> Result<(), RigError> {
        match self {
            Exciter::Ideal(spec) => spec.check(),
            Exciter::Shaker(spec) => spec.check(),
        }
    }

    /// Returns whether it can produce the load, given its limits and direction.
    pub fn can_produce(&self, load: &Load) -> bool {
        match self {
            Exciter::Ideal(spec) => spec.can_produce(load),
            Exciter::Shaker(spec) => spec.can_produce(load),
        }
    }

    /// Returns the size of a load in the quantities of the limits: the largest force along an axis, or along a
    /// shaker, N, and the largest torque at a joint, N·m.
    pub fn size(&self, load: &Load) -> (f64, f64) {
        let force_n = match self {
            Exciter::Ideal(_) => load.force_n.amax(),
            Exciter::Shaker(spec) => spec.along_n(load).abs(),
        };
        (force_n, load.torque_nm.amax())
    }

    /// Returns the largest force, N, and torque, N·m.
    pub fn limits(&self) -> (f64, f64) {
        match self {
            Exciter::Ideal(spec) => (spec.force_limit_n, spec.torque_limit_nm),
            Exciter::Shaker(spec) => (spec.force_limit_n(), 0.0),
        }
    }
}

/// An ideal exciter: commands act on the arm at once and exactly, up to a limit for each axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExciterSpec {
    /// Largest force along each axis, N, positive.
    pub force_limit_n: f64,
    /// Largest torque at each joint, N·m, positive.
    pub torque_limit_nm: f64,
    /// Place on a structure where it acts; on the two-link arm it acts at C.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<PlaceName>,
}

impl Default for ExciterSpec {
    /// 600 N and 1600 N·m, just inside the range of the protocol's classic profile.
    fn default() -> ExciterSpec {
        ExciterSpec { force_limit_n: 600.0, torque_limit_nm: 1600.0, at: None }
    }
}

impl ExciterSpec {
    pub(super) fn check(&self) -> Result<(), RigError> {
        for (name, got) in [("force_limit_n", self.force_limit_n), ("torque_limit_nm", self.torque_limit_nm)] {
            if !(got.is_finite() && got > 0.0) {
                return Err(RigError::Spec {
                    section: Section::Rig("exciter"),
                    name,
                    got,
                    expected: "a positive number",
                });
            }
        }
        Ok(())
    }

    /// Returns whether the exciter can produce the load.
    pub fn can_produce(&self, load: &Load) -> bool {
        load.force_n.iter().all(|force| force.abs() <= self.force_limit_n)
            && load.torque_nm.iter().all(|torque| torque.abs() <= self.torque_limit_nm)
    }
}
