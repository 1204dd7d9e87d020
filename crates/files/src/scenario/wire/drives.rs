//! Motor drives, one a joint, by a protocol that comes with the program.

use serde::{Deserialize, Serialize};

use super::error::WireError;
use super::{WireSection, odrive};
use crate::scenario::Scenario;

/// For how long a torque is valid if the scenario doesn't say, s.
pub(super) const TIMEOUT_S: f64 = 0.5;

/// A protocol of drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PresetSpec {
    /// ODrive's CANSimple, in torque control.
    Odrive,
}

/// A drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveSpec {
    /// The number of its node, 0 to 63.
    pub node_id: u8,
    /// The joint that it turns, 1 or 2.
    pub joint: u8,
    /// Turns of the motor for one of the joint, not 0; without it 1.
    #[serde(default = "one")]
    pub gear_ratio: f64,
    /// The motor's torque for 1 A, N·m/A; without it currents are not sent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_constant_nm_a: Option<f64>,
}

fn one() -> f64 {
    1.0
}

impl WireSection {
    /// The section with the messages of its preset, if it has one.
    ///
    /// # Errors
    /// [`WireError::Preset`], [`WireError::Drive`].
    pub(super) fn expanded(&self, scenario: &Scenario) -> Result<Option<WireSection>, WireError> {
        let Some(preset) = self.preset else {
            return if self.drives.is_empty() && self.timeout_s.is_none() {
                Ok(None)
            } else {
                Err(WireError::Drives {
                    problem: "`drives` and `timeout_s` belong to a `preset`: give one, as \"odrive\"",
                })
            };
        };
        let own = [
            self.dbc != std::path::PathBuf::new(),
            self.node.is_some(),
            self.arm.is_some(),
            self.sync.is_some(),
            !self.commands.is_empty(),
            !self.events.is_empty(),
            !self.readings.is_empty(),
        ];
        if own.contains(&true) {
            return Err(WireError::Drives {
                problem: "with a `preset` the messages are given: leave out `dbc`, `node`, `arm`, `sync`, `commands`, \
                          `events` and `readings`",
            });
        }
        self.check_drives(scenario)?;
        match preset {
            PresetSpec::Odrive => Ok(Some(odrive::section(self, scenario.simulation.rate_hz))),
        }
    }

    fn check_drives(&self, scenario: &Scenario) -> Result<(), WireError> {
        if self.drives.is_empty() {
            let problem = "a preset needs at least one drive: drives = [{ node_id = 0, joint = 1 }]";
            return Err(WireError::Drives { problem });
        }
        if scenario.rig.shaker.is_some() {
            return Err(WireError::Drives {
                problem: "a drive exerts a torque, and a shaker takes none: leave out [rig.shaker]",
            });
        }
        for (place, drive) in self.drives.iter().enumerate() {
            let number = |name, got, expected| Err(WireError::Drive { place, name, got, expected });
            let before = &self.drives[..place];
            if drive.node_id > 63 || before.iter().any(|other| other.node_id == drive.node_id) {
                return number("node_id", drive.node_id.into(), "from 0 to 63, and another than those before");
            }
            if !(1..=2).contains(&drive.joint) || before.iter().any(|other| other.joint == drive.joint) {
                return number("joint", drive.joint.into(), "1 or 2, and another than those before");
            }
            if !drive.gear_ratio.is_finite() || drive.gear_ratio == 0.0 {
                return number("gear_ratio", drive.gear_ratio, "a number other than 0");
            }
            if let Some(got) = drive.torque_constant_nm_a.filter(|got| !(got.is_finite() && *got > 0.0)) {
                return number("torque_constant_nm_a", got, "a positive number");
            }
        }
        Ok(())
    }
}
