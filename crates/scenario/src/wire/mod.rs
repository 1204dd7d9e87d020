//! The user's own protocol in a scenario: which messages of a DBC are loads, requests and readings, or a preset.

mod checksum;
mod cia402;
mod compile;
mod conversion;
mod drives;
mod error;
mod exact;
mod lacks;
mod load;
mod odrive;
mod signals;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

pub use checksum::{AlgorithmSpec, ChecksumSpec, DataIdSpec, PartSpec};
pub use drives::{DriveSpec, PresetSpec};
pub use error::{Names, Place, WireError};
pub use lacks::WireLack;
pub use signals::quantity::{channel, readings};
pub use signals::{REASONS, STATES};

use super::{Scenario, ScenarioError};
use crate::dbc::{self, Database};
use crate::text_file;
use resonarm_bench::node::WireSpec;

/// The user's own protocol, in place of Resonarm's.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WireSection {
    /// A protocol of drives, in place of a DBC.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<PresetSpec>,
    /// Its drives.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<DriveSpec>,
    /// For how long its torques are valid in real time, s; without it 0.5.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timeout_s: Option<f64>,
    /// The DBC file; its path counts from the scenario's folder.
    #[serde(skip_serializing_if = "is_empty")]
    pub dbc: PathBuf,
    /// The plant's node in it, the sender of all readings; without it senders are not checked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub node: Option<String>,
    /// How the plant is armed if no event does it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arm: Option<ArmSpec>,
    /// What answers a sample in lockstep; without it there is no lockstep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lockstep: Option<LockstepSpec>,
    /// The message that synchronises, for `lockstep = "sync"` and readings with `on = "sync"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sync: Option<String>,
    /// The messages with loads.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub commands: Vec<CommandSpec>,
    /// The messages with requests.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<EventSpec>,
    /// The messages with readings.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub readings: Vec<ReadingSpec>,
    /// The text of the DBC, once it is read.
    #[serde(skip)]
    pub text: Option<String>,
}

fn is_empty(path: &Path) -> bool {
    path.as_os_str().is_empty()
}

/// How a plant is armed without a message for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ArmSpec {
    /// By the operator, in the live view.
    Operator,
    /// By first commands below a hundredth of the exciter's limits.
    ZeroCommand,
}

/// What answers a sample in lockstep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LockstepSpec {
    /// One frame of each message with loads.
    Command,
    /// The message named by `sync`.
    Sync,
}

/// A message with loads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandSpec {
    /// Its name.
    pub message: String,
    /// For how long a load is valid in real time, s; without it `network.command_timeout_s`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timeout_s: Option<f64>,
    /// Its alive counter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counter: Option<CounterSpec>,
    /// Its checksum.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checksum: Option<ChecksumSpec>,
    /// The number of the drive that it is for, from 0: each is armed by itself.
    #[serde(default)]
    pub drive: usize,
    /// Force at the tip along x.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_x_n: Option<InputSpec>,
    /// Force at the tip along y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_y_n: Option<InputSpec>,
    /// Force at the tip along the shaker.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_n: Option<InputSpec>,
    /// Torque at joint 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque1_nm: Option<InputSpec>,
    /// Torque at joint 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque2_nm: Option<InputSpec>,
}

/// A signal that is a load: `scale · value + offset`, in N or N·m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputSpec {
    /// Its name.
    pub signal: String,
    /// N or N·m for one unit of it; without it its unit says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// N or N·m at 0; without it 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// Of a current: the torque of the motor for 1 A, N·m/A, or of a shaker N/A; the signal is then one of A or mA.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant_per_a: Option<f64>,
    /// Turns of the motor for one of the joint, by which its torque is multiplied; without it 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gear_ratio: Option<f64>,
}

/// A message with a request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EventSpec {
    /// Its name.
    pub message: String,
    /// The signal; without it every frame of the message asks for what `on_frame` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signal: Option<String>,
    /// Values that arm.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arm: Vec<f64>,
    /// Values that disarm.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub disarm: Vec<f64>,
    /// Values that clear a fault.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reset: Vec<f64>,
    /// Values that stop the plant: a fault.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stop: Vec<f64>,
    /// Values of which it must have one before loads count.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub require: Vec<f64>,
    /// What a frame asks for if there is no signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on_frame: Option<RequestSpec>,
    /// Whether a value counts in every frame, or, the default, when it changes.
    #[serde(default)]
    pub every_frame: bool,
    /// The alive counter of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counter: Option<CounterSpec>,
    /// The checksum of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checksum: Option<ChecksumSpec>,
    /// The number of the drive that it is for.
    #[serde(default)]
    pub drive: usize,
}

/// What a frame asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RequestSpec {
    /// To arm.
    Arm,
    /// To disarm.
    Disarm,
    /// To clear a fault.
    Reset,
    /// To stop: a fault.
    Stop,
}

/// A message with readings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReadingSpec {
    /// Its name.
    pub message: String,
    /// Every how many samples it is sent; without it and the two keys below the DBC's cycle time says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<u64>,
    /// How often it is sent by the clock, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// What it is sent on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<OnSpec>,
    /// Whether it is sent on request as well: a remote frame, or one of its identifier without data.
    #[serde(default)]
    pub on_request: bool,
    /// Its alive counter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counter: Option<CounterSpec>,
    /// Its checksum.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checksum: Option<ChecksumSpec>,
    /// The number of the drive of whose state it says something.
    #[serde(default)]
    pub drive: usize,
    /// What its signals say, by their names.
    pub signals: BTreeMap<String, SourceSpec>,
}

/// What a reading is sent on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OnSpec {
    /// On request alone.
    Remote,
    /// On the message named by `sync`.
    Sync,
}

/// What a signal says: one of the keys `quantity`, `clipped`, `state`, `reason`, `constant`, `sample`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SourceSpec {
    /// A reading, a state of the structure or a held load, by the name of its channel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<String>,
    /// 1 if this reading is beyond the range of its sensor, else 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clipped: Option<String>,
    /// Units of the signal for one of the quantity's; without it the signal's unit says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// The signal at 0; without it 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// Of a current: the torque of the motor for 1 A, N·m/A; the quantity is then a torque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant_per_a: Option<f64>,
    /// Turns of the motor for one of the joint, by which an angle or a rate is multiplied and a torque divided.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gear_ratio: Option<f64>,
    /// A number for each state: `boot-up`, `pre-operational`, `operational`, `fault`; 0 for those left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<BTreeMap<String, f64>>,
    /// A number for each fault, by its name, for `none` (0 if left out) and for `other` (1 if left out).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<BTreeMap<String, f64>>,
    /// Always this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant: Option<f64>,
    /// Whether it is the index of the sample, modulo what the signal can represent.
    pub sample: bool,
}

/// An alive counter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CounterSpec {
    /// Its signal.
    pub signal: String,
    /// How many values it has; without it as many as its bits, or as the checksum's profile says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<u64>,
    /// The most frames that may be lost in a row; without it 3, as with the largest step of 4 of AUTOSAR's profiles
    /// here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_lost: Option<u64>,
}

impl WireSection {
    /// Reads the DBC, if the messages are not those of a preset; its path counts from `folder`.
    ///
    /// # Errors
    /// [`WireError::Read`].
    pub fn read(&mut self, folder: &Path) -> Result<(), WireError> {
        if self.preset.is_some() {
            return Ok(());
        }
        self.check_no_preset()?;
        let path = folder.join(&self.dbc);
        let bytes = text_file::read_network(&path).map_err(|source| WireError::Read { path, source })?;
        self.text = Some(dbc::decode(&bytes).into_owned());
        Ok(())
    }

    /// The section with the messages of its preset, if it has one.
    ///
    /// # Errors
    /// [`WireError::Drives`], [`WireError::Drive`], [`WireError::DriveWith`], [`WireError::NeitherDbcNorPreset`].
    fn expanded(&self, scenario: &Scenario) -> Result<Option<WireSection>, WireError> {
        match self.preset {
            None => self.check_no_preset().map(|()| None),
            Some(preset) => {
                self.check_preset(scenario, preset)?;
                Ok(Some(odrive::section(self, scenario.simulation.rate_hz)))
            }
        }
    }

    /// The DBC.
    ///
    /// # Errors
    /// [`WireError::Dbc`] if it is none, [`WireError::NotRead`] before [`WireSection::read`].
    pub fn database(&self) -> Result<Database, WireError> {
        let text = self.text.as_ref().ok_or(WireError::NotRead)?;
        Ok(Database::parse(text.as_bytes(), &self.dbc.display().to_string())?)
    }
}

impl Scenario {
    /// The scenario's own protocol, if it has one.
    ///
    /// # Errors
    /// [`ScenarioError::Wire`] says what in `[wire]` can't be.
    pub fn wire_spec(&self) -> Result<Option<WireSpec>, ScenarioError> {
        let Some(section) = &self.wire else { return Ok(None) };
        if section.preset == Some(PresetSpec::Cia402) {
            let spec = cia402::spec(self, section)?;
            load::check_drives(self, &spec)?;
            return Ok(Some(WireSpec::Cia402(spec)));
        }
        let expanded = section.expanded(self)?;
        let section = expanded.as_ref().unwrap_or(section);
        let mapping = compile::mapping(self, section)?;
        load::check(self, section, &mapping)?;
        Ok(Some(WireSpec::Mapped(mapping)))
    }

    /// The DBC of the scenario's own protocol, or of its preset, if it has one: CANopen drives have none.
    ///
    /// # Errors
    /// [`ScenarioError::Wire`] if it was not read, or is none.
    pub fn wire_database(&self) -> Result<Option<Database>, ScenarioError> {
        let Some(section) = &self.wire else { return Ok(None) };
        if section.preset == Some(PresetSpec::Cia402) {
            return Ok(None);
        }
        let expanded = section.expanded(self)?;
        Ok(Some(expanded.as_ref().unwrap_or(section).database()?))
    }
}

#[cfg(test)]
mod tests;
