//! Limits of commands beyond those of the exciter: how fast a load may change, and how far the arm may be
//! driven.

use serde::{Deserialize, Serialize};

use super::error::RigError;
use super::exciter::Exciter;
use super::load::Load;
use super::name::Section;
use resonarm_protocol::{CommandCheck, Limit};

/// Limits of the gate in a scenario; by default there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GateSpec {
    /// Largest rate of change of the force along each axis, or along a shaker, N/s, positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_rate_limit_n_per_s: Option<f64>,
    /// Largest rate of change of the torque at each joint, N·m/s, positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_rate_limit_nm_per_s: Option<f64>,
    /// Largest travel, m, positive: displacement of the tip from rest, or with a shaker that of its armature.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub travel_limit_m: Option<f64>,
}

impl GateSpec {
    /// Returns whether it has no limit.
    pub(super) fn is_open(&self) -> bool {
        *self == GateSpec::default()
    }

    pub(super) fn check(&self, exciter: &Exciter) -> Result<(), RigError> {
        let spec = |name, got, expected| Err(RigError::Spec { section: Section::Rig("gate"), name, got, expected });
        let limits = [
            ("force_rate_limit_n_per_s", self.force_rate_limit_n_per_s),
            ("torque_rate_limit_nm_per_s", self.torque_rate_limit_nm_per_s),
            ("travel_limit_m", self.travel_limit_m),
        ];
        for (name, limit) in limits {
            if let Some(got) = limit.filter(|got| !(got.is_finite() && *got > 0.0)) {
                return spec(name, got, "a positive number");
            }
        }
        match (exciter, self.torque_rate_limit_nm_per_s, self.travel_limit_m) {
            (Exciter::Shaker(_), Some(got), _) => {
                spec("torque_rate_limit_nm_per_s", got, "left out with a shaker, which exerts no torque")
            }
            (Exciter::Shaker(shaker), None, Some(got)) if got >= shaker.stroke_m => {
                spec("travel_limit_m", got, "below `rig.shaker.stroke_m`, at which the shaker trips")
            }
            _ => Ok(()),
        }
    }

    /// Returns the values by which the gate checks a command for `load`, while `held` acts at `rate_hz` samples
    /// per second and the travel is `travel_m`. A travel that is limited and not known is beyond its limit.
    ///
    /// A change Δ at a largest rate r takes Δ/r seconds, that is, f Δ/r sample periods; the longer of force and
    /// torque counts.
    pub fn command_check(
        &self,
        exciter: &Exciter,
        rate_hz: f64,
        travel_m: Option<f64>,
        [held, load]: [&Load; 2],
    ) -> CommandCheck {
        let (force_n, torque_nm) = exciter.size(&(*load - *held));
        let periods = |change: f64, limit: Option<f64>| limit.map_or(0.0, |limit| rate_hz * change / limit);
        let within = |is_within| if is_within { Limit::Within } else { Limit::Beyond };
        CommandCheck {
            range: within(exciter.can_produce(load)),
            change_periods: periods(force_n, self.force_rate_limit_n_per_s)
                .max(periods(torque_nm, self.torque_rate_limit_nm_per_s)),
            travel: within(
                self.travel_limit_m.is_none_or(|limit_m| travel_m.is_some_and(|travel_m| travel_m <= limit_m)),
            ),
        }
    }
}
