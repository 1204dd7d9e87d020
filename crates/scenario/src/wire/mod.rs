//! The section `[wire]`: a user protocol in place of Resonarm's. It maps the messages of a DBC to loads,
//! requests and readings, or names a preset.

mod checksum;
mod cia402;
mod compile;
mod conversion;
mod drives;
pub(crate) mod error;
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
pub use error::{Names, Place, ProtectionError, WireError};
pub use lacks::WireLack;
pub use signals::quantity::Quantities;
pub use signals::{REASONS, STATES};

use super::Scenario;
use crate::dbc::{self, Database};
use crate::error::ScenarioError;
use crate::text_file;
use resonarm_bench::node::WireSpec;

/// The user protocol that replaces Resonarm's own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WireSection {
    /// Protocol of drives that comes with the program, in place of a DBC.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<PresetSpec>,
    /// Drives of the preset, one for each joint.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<DriveSpec>,
    /// Time for which a torque of the drives stays valid in real time, s; without it 0.5.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timeout_s: Option<f64>,
    /// Path of the DBC file, relative to the scenario's folder.
    #[serde(skip_serializing_if = "is_empty")]
    pub dbc: PathBuf,
    /// Node of the plant in the DBC, the sender of all readings; without it senders are not checked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub node: Option<String>,
    /// Way in which the plant is armed if no event arms it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arm: Option<ArmSpec>,
    /// Frames that answer a sample in lockstep; without it the protocol has no lockstep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lockstep: Option<LockstepSpec>,
    /// Message that synchronises, for `lockstep = "sync"` and readings with `on = "sync"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sync: Option<String>,
    /// Messages that carry loads.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub commands: Vec<CommandSpec>,
    /// Messages that carry requests.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<EventSpec>,
    /// Messages that carry readings.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub readings: Vec<ReadingSpec>,
    /// Text of the DBC, once it has been read.
    #[serde(skip)]
    pub text: Option<String>,
}

fn is_empty(path: &Path) -> bool {
    path.as_os_str().is_empty()
}

/// Way in which a plant is armed when no message arms it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ArmSpec {
    /// The operator arms it in the live view.
    Operator,
    /// Its first commands arm it, if they are below a hundredth of the exciter's limits.
    ZeroCommand,
}

/// Frames that answer a sample in lockstep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LockstepSpec {
    /// One frame of each message with loads.
    Command,
    /// The message named by `sync`.
    Sync,
}

/// A message that carries loads.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandSpec {
    /// Name of the message in the DBC.
    pub message: String,
    /// Time for which a load stays valid in real time, s; without it `network.command_timeout_s`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timeout_s: Option<f64>,
    /// Alive counter of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counter: Option<CounterSpec>,
    /// Checksum of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checksum: Option<ChecksumSpec>,
    /// Index of the drive that the message is for, from 0. Each drive is armed separately.
    #[serde(default)]
    pub drive: usize,
    /// Force at the exciter along x.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_x_n: Option<InputSpec>,
    /// Force at the exciter along y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_y_n: Option<InputSpec>,
    /// Force at the exciter along z.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_z_n: Option<InputSpec>,
    /// Force at the exciter along the shaker.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_n: Option<InputSpec>,
    /// Torque at joint 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque1_nm: Option<InputSpec>,
    /// Torque at joint 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque2_nm: Option<InputSpec>,
    /// Torque at joint 3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque3_nm: Option<InputSpec>,
    /// Torque at joint 4.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque4_nm: Option<InputSpec>,
    /// Torque at joint 5.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque5_nm: Option<InputSpec>,
    /// Torque at joint 6.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque6_nm: Option<InputSpec>,
    /// Torque at joint 7.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque7_nm: Option<InputSpec>,
    /// Torque at joint 8.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque8_nm: Option<InputSpec>,
}

impl CommandSpec {
    /// Returns the input of the torque at a joint, numbered from 1.
    fn torque_nm(&mut self, joint: u8) -> Option<&mut Option<InputSpec>> {
        let inputs = [
            &mut self.torque1_nm,
            &mut self.torque2_nm,
            &mut self.torque3_nm,
            &mut self.torque4_nm,
            &mut self.torque5_nm,
            &mut self.torque6_nm,
            &mut self.torque7_nm,
            &mut self.torque8_nm,
        ];
        inputs.into_iter().nth(usize::from(joint).checked_sub(1)?)
    }
}

/// A signal that commands a load of `scale · value + offset`, in N or N·m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputSpec {
    /// Name of the signal in the DBC.
    pub signal: String,
    /// Load for one unit of the signal, N or N·m; without it the signal's unit is converted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Load at the value 0, N or N·m; without it 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// For a current: torque of the motor for 1 A, N·m/A, or force of a shaker, N/A. The signal's unit is then
    /// A or mA.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant_per_a: Option<f64>,
    /// Turns of the motor for one turn of the joint, by which the torque is multiplied; without it 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gear_ratio: Option<f64>,
}

/// A message that carries a request.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EventSpec {
    /// Name of the message in the DBC.
    pub message: String,
    /// Signal that carries the request; without it every frame of the message is the request `on_frame`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signal: Option<String>,
    /// Values of the signal that arm the plant.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arm: Vec<f64>,
    /// Values of the signal that disarm the plant.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub disarm: Vec<f64>,
    /// Values of the signal that clear a fault.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reset: Vec<f64>,
    /// Values of the signal that stop the plant with a fault.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stop: Vec<f64>,
    /// Commands are ignored until the signal has one of these values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub require: Vec<f64>,
    /// Request that every frame makes if there is no signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on_frame: Option<RequestSpec>,
    /// Whether a value counts in every frame. By default it counts when it changes.
    #[serde(default)]
    pub every_frame: bool,
    /// Alive counter of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counter: Option<CounterSpec>,
    /// Checksum of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checksum: Option<ChecksumSpec>,
    /// Index of the drive that the message is for, from 0.
    #[serde(default)]
    pub drive: usize,
}

/// Request of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RequestSpec {
    /// Arms the plant: from now on its commands act.
    Arm,
    /// Disarms the plant: no load acts any more.
    Disarm,
    /// Clears a fault, so that the plant can be armed again.
    Reset,
    /// Stops the plant with a fault.
    Stop,
}

/// A message that carries readings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReadingSpec {
    /// Name of the message in the DBC.
    pub message: String,
    /// Number of samples from one frame to the next; without it and the two keys below, the DBC's cycle time
    /// decides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<u64>,
    /// Period in time, s, in place of a number of samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// Event that sends it, in place of a period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<OnSpec>,
    /// Whether it is also sent on request: by a remote frame, or by a frame of its identifier without data.
    #[serde(default)]
    pub on_request: bool,
    /// Alive counter of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counter: Option<CounterSpec>,
    /// Checksum of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checksum: Option<ChecksumSpec>,
    /// Index of the drive whose state it reports, from 0.
    #[serde(default)]
    pub drive: usize,
    /// Content of each signal, by the signal's name.
    pub signals: BTreeMap<String, SourceSpec>,
}

/// Event that sends a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OnSpec {
    /// A request: the message is sent for no other reason.
    Remote,
    /// The message named by `sync`.
    Sync,
}

/// Content of a signal: one of the keys `quantity`, `clipped`, `state`, `reason`, `constant`, `sample`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SourceSpec {
    /// A reading, a state of the structure or a held load, by its channel name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<String>,
    /// 1 while this reading is clipped at the range of its sensor, else 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clipped: Option<String>,
    /// Units of the signal for one unit of the quantity; without it the signal's unit is converted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Value of the signal at 0; without it 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// For a current: torque of the motor for 1 A, N·m/A. The quantity is then a torque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant_per_a: Option<f64>,
    /// Turns of the motor for one turn of the joint, by which an angle or rate is multiplied and a torque
    /// divided.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gear_ratio: Option<f64>,
    /// A number for each state: `boot-up`, `pre-operational`, `operational`, `fault`; 0 for those left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<BTreeMap<String, f64>>,
    /// A number for each fault, by its name, for `none` (0 if left out) and for `other` (1 if left out).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<BTreeMap<String, f64>>,
    /// Constant value of the signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant: Option<f64>,
    /// Whether it carries the index of the sample, modulo the signal's range.
    pub sample: bool,
}

/// An alive counter, which counts up with every frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CounterSpec {
    /// Name of the signal that holds the counter.
    pub signal: String,
    /// Number of values; without it as many as its bits allow, or as the checksum's profile states.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<u64>,
    /// Largest number of consecutive frames that may be lost; without it 3, as with AUTOSAR's largest counter
    /// step of 4.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_lost: Option<u64>,
}

impl WireSection {
    /// Reads the DBC, unless the messages are those of a preset; its path is relative to `folder`.
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

    /// Returns the section with the messages of its preset written out, if it has one.
    ///
    /// # Errors
    /// [`WireError::Section`], [`WireError::Drive`], [`WireError::DriveWith`], [`WireError::NeitherDbcNorPreset`].
    fn expanded(&self, scenario: &Scenario) -> Result<Option<WireSection>, WireError> {
        match self.preset {
            None => self.check_no_preset().map(|()| None),
            Some(preset) => {
                self.check_preset(scenario, preset)?;
                Ok(Some(odrive::section(self, scenario.simulation.rate_hz)))
            }
        }
    }

    /// Parses the DBC.
    ///
    /// # Errors
    /// [`WireError::Dbc`] if it is invalid, [`WireError::NotRead`] before [`WireSection::read`].
    pub fn database(&self) -> Result<Database, WireError> {
        let text = self.text.as_ref().ok_or(WireError::NotRead)?;
        Ok(Database::parse(text.as_bytes(), &self.dbc.display().to_string())?)
    }
}

impl Scenario {
    /// Compiles the scenario's user protocol, if it has one.
    ///
    /// # Errors
    /// [`ScenarioError::Wire`] with the invalid part of `[wire]`.
    pub fn wire_spec(&self) -> Result<Option<WireSpec>, ScenarioError> {
        let Some(section) = &self.wire else { return Ok(None) };
        // CANopen drives have an object dictionary and a state machine, which a table of messages can't
        // express.
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

    /// Returns the DBC of the user protocol or of its preset, if there is one: CANopen drives have none.
    ///
    /// # Errors
    /// [`ScenarioError::Wire`] if it was not read, or is invalid.
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
