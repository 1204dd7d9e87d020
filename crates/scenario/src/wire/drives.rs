//! Motor drives, one for each joint, whose protocol comes with the program.

use serde::{Deserialize, Serialize};

use super::WireSection;
use super::error::WireError;
use super::signals::quantity::Quantities;
use crate::Scenario;
use resonarm_bench::rig::MOST_JOINTS;

/// Time for which a torque stays valid unless the scenario states one, s.
pub(super) const TIMEOUT_S: f64 = 0.5;

/// Protocol of the drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PresetSpec {
    /// ODrive's CANSimple, in torque control.
    Odrive,
    /// CANopen drives in cyclic synchronous torque (CiA 301, CiA 402).
    Cia402,
}

impl PresetSpec {
    /// Returns the name in a scenario.
    pub const fn name(self) -> &'static str {
        match self {
            PresetSpec::Odrive => "odrive",
            PresetSpec::Cia402 => "cia402",
        }
    }

    /// Returns the range of node ids, with the words for an error.
    const fn node_ids(self) -> ([u8; 2], &'static str) {
        match self {
            PresetSpec::Odrive => ([0, 63], "from 0 to 63, and another than those before"),
            PresetSpec::Cia402 => ([1, 127], "from 1 to 127, and another than those before"),
        }
    }
}

/// A motor drive at a joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveSpec {
    /// Node id: 0 to 63, with CANopen 1 to 127.
    pub node_id: u8,
    /// Joint that the drive turns, from 1 at the base.
    pub joint: u8,
    /// Turns of the motor for one turn of the joint, not 0; without it 1.
    #[serde(default = "one")]
    pub gear_ratio: f64,
    /// ODrive: torque constant of the motor, N·m/A; without it currents are not sent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_constant_nm_a: Option<f64>,
    /// CANopen: rated torque of the motor, N·m, an integer in mN·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rated_torque_nm: Option<f64>,
    /// CANopen: encoder counts for one turn of the motor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_counts_per_turn: Option<u32>,
}

impl DriveSpec {
    /// Returns a given key that belongs to the other preset.
    fn foreign_key(&self, preset: PresetSpec) -> Option<&'static str> {
        let given = [
            ("torque_constant_nm_a", PresetSpec::Odrive, self.torque_constant_nm_a.is_some()),
            ("rated_torque_nm", PresetSpec::Cia402, self.rated_torque_nm.is_some()),
            ("encoder_counts_per_turn", PresetSpec::Cia402, self.encoder_counts_per_turn.is_some()),
        ];
        given.into_iter().find(|(_, of, is_given)| *is_given && *of != preset).map(|(name, _, _)| name)
    }
}

fn one() -> f64 {
    1.0
}

impl WireSection {
    /// Rejects keys of a preset where there is none.
    ///
    /// # Errors
    /// [`WireError::Section`], [`WireError::NeitherDbcNorPreset`].
    pub(super) fn check_no_preset(&self) -> Result<(), WireError> {
        if !self.drives.is_empty() || self.timeout_s.is_some() {
            let problem = "`drives` and `timeout_s` belong to a `preset`: give one, as \"odrive\"";
            return Err(WireError::Section { key: "[wire]", problem });
        }
        let is_nothing = self.dbc.as_os_str().is_empty() && self.text.is_none();
        if is_nothing { Err(WireError::NeitherDbcNorPreset) } else { Ok(()) }
    }

    /// Checks what all presets require: no keys of a DBC, and valid drives.
    ///
    /// # Errors
    /// [`WireError::Section`], [`WireError::Drive`], [`WireError::DriveWith`].
    pub(super) fn check_preset(&self, scenario: &Scenario, preset: PresetSpec) -> Result<(), WireError> {
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
            return Err(WireError::Section {
                key: "[wire]",
                problem: "with a `preset` the messages are given: leave out `dbc`, `node`, `arm`, `sync`, `commands`, \
                          `events` and `readings`",
            });
        }
        self.check_drives(scenario, preset)
    }

    fn check_drives(&self, scenario: &Scenario, preset: PresetSpec) -> Result<(), WireError> {
        if self.drives.is_empty() {
            let problem = "a preset needs at least one drive: drives = [{ node_id = 0, joint = 1 }]";
            return Err(WireError::Section { key: "[wire]", problem });
        }
        if scenario.rig.shaker.is_some() {
            let problem = "a drive exerts a torque, but a shaker can't: leave out [rig.shaker]";
            return Err(WireError::Section { key: "[wire]", problem });
        }
        let loads = Quantities::of_scenario(scenario)?.loads();
        let has_joint = |joint: u8| (1..=MOST_JOINTS).contains(&joint.into()) && loads.has(usize::from(joint) - 1);
        for (place, drive) in self.drives.iter().enumerate() {
            let number = |name, got, expected| Err(WireError::Drive { place, name, got, expected });
            let before = &self.drives[..place];
            let ([least, most], expected) = preset.node_ids();
            let is_known = (least..=most).contains(&drive.node_id);
            if !is_known || before.iter().any(|other| other.node_id == drive.node_id) {
                return number("node_id", drive.node_id.into(), expected);
            }
            if !has_joint(drive.joint) || before.iter().any(|other| other.joint == drive.joint) {
                return number(
                    "joint",
                    drive.joint.into(),
                    "the number of a joint of the structure, and another than those before",
                );
            }
            if !drive.gear_ratio.is_finite() || drive.gear_ratio == 0.0 {
                return number("gear_ratio", drive.gear_ratio, "a number other than 0");
            }
            if let Some(name) = drive.foreign_key(preset) {
                return Err(WireError::DriveWith { place, name, preset: preset.name() });
            }
            if let Some(got) = drive.torque_constant_nm_a.filter(|got| !(got.is_finite() && *got > 0.0)) {
                return number("torque_constant_nm_a", got, "a positive number");
            }
        }
        Ok(())
    }
}
