//! What a frame says.

use core::fmt;

use serde::Serialize;

use super::check::Fault;
use super::roles::{MessageRoles, action_name};
use crate::dbc::{Message, Signal};
use resonarm_numeric::number::short;
use resonarm_protocol::Frame;
use resonarm_wire::layout::Number;

/// A frame explained.
#[derive(Clone, Debug, PartialEq)]
pub enum Decoded {
    /// No message of the DBC has its identifier, or the one that has it can't be used; of CANopen drives, none has it.
    Foreign,
    /// It asks for a message: a remote frame, or one without data of a message that is sent on request.
    Request {
        /// The message.
        message: String,
        /// Whether the plant answers.
        is_answered: bool,
    },
    /// A message.
    Message(DecodedMessage),
}

/// What the receiver of a message makes of a frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Its form and protection are right.
    Taken {
        /// The frames lost before it, according to the counter.
        lost: u64,
    },
    /// It must not be used.
    Refused(Fault),
    /// The mapping does not use the message, or there is none: nothing is checked.
    Unmapped,
}

/// A message explained.
#[derive(Clone, Debug, PartialEq)]
pub struct DecodedMessage {
    /// Its name.
    pub message: String,
    /// The nodes that send it, according to the DBC; of CANopen drives the master, or a node and its joint.
    pub senders: Vec<String>,
    /// What its receiver makes of it.
    pub outcome: Outcome,
    /// The bytes of the payload.
    pub bytes: usize,
    /// The bytes of the message in the DBC.
    pub expected_bytes: usize,
    /// Its signals in the order of the DBC, without those that the switches do not select.
    pub signals: Vec<DecodedSignal>,
    /// What the whole message means.
    pub means: Vec<Meaning>,
}

impl DecodedMessage {
    /// The signals that the payload ends before.
    pub fn beyond(&self) -> impl Iterator<Item = &DecodedSignal> {
        self.signals.iter().filter(|signal| signal.value.is_none())
    }
}

/// A signal explained.
#[derive(Clone, Debug, PartialEq)]
pub struct DecodedSignal {
    /// Its name.
    pub name: String,
    /// Its value, in its unit; `None` if the payload ends before it.
    pub value: Option<f64>,
    /// Its unit, as in the DBC; empty without one.
    pub unit: String,
    /// The text that the DBC's value table has for it, or CANopen's words.
    pub text: Option<String>,
    /// What it means to the plant.
    pub means: Vec<Meaning>,
}

/// What a signal or a message means to the plant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Meaning {
    /// The alive counter.
    Counter,
    /// The checksum.
    Checksum,
    /// A load.
    Load {
        /// Its key in a scenario.
        name: &'static str,
        /// N or N·m.
        value: f64,
        /// The unit.
        unit: &'static str,
    },
    /// A request.
    Request {
        /// Its key in a scenario: `arm`, `disarm`, `reset` or `stop`.
        action: &'static str,
        /// Whether it counts in this frame: if a value counts when it changes, not while it stays.
        is_new: bool,
    },
    /// A condition of loads.
    Required {
        /// Whether loads count with this value.
        is_fulfilled: bool,
    },
    /// The message that answers samples in lockstep, or asks for readings.
    Sync,
    /// A reading, a state of the arm or a held load.
    Quantity {
        /// The name of its channel.
        name: &'static str,
        /// In the unit of the channel.
        value: f64,
        /// The unit.
        unit: &'static str,
    },
    /// Whether a reading is beyond the range of its sensor.
    Clipped {
        /// The name of its channel.
        name: &'static str,
        /// Whether it is.
        is_clipped: bool,
    },
    /// The state of the plant.
    State {
        /// Its name; `None` if the mapping has none for the value.
        name: Option<&'static str>,
    },
    /// The fault of the plant.
    Reason {
        /// Its name; `None` if the mapping has none for the value.
        name: Option<&'static str>,
    },
    /// The index of the sample.
    Sample,
    /// A step of the transfer of an object of a CANopen drive.
    Object {
        /// What the frame does: `read`, `value of`, `write`, `written`, `abort` and those of segments.
        action: &'static str,
        /// The object; `None` if no frame before says which it is.
        object: Option<ObjectName>,
    },
}

/// An object of a CANopen drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ObjectName {
    /// Its index.
    pub index: u16,
    /// Its subindex.
    pub subindex: u8,
    /// Its name, and that of the entry if it has several.
    pub name: String,
}

impl fmt::Display for ObjectName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ObjectName { index, subindex: 0, name } => write!(f, "{index:04X} {name}"),
            ObjectName { index, subindex, name } => write!(f, "{index:04X}:{subindex:02X} {name}"),
        }
    }
}

impl fmt::Display for Meaning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Meaning::Counter => f.write_str("counter"),
            Meaning::Checksum => f.write_str("checksum"),
            Meaning::Load { name, value, .. } => write!(f, "load {name}={}", short(&rounded(*value))),
            Meaning::Request { action, is_new: true } => f.write_str(action),
            Meaning::Request { action, is_new: false } => write!(f, "{action}, unchanged"),
            Meaning::Required { is_fulfilled: true } => f.write_str("loads count"),
            Meaning::Required { is_fulfilled: false } => f.write_str("loads do not count"),
            Meaning::Sync => f.write_str("sync"),
            Meaning::Quantity { name, value, .. } => write!(f, "{name}={}", short(&rounded(*value))),
            Meaning::Clipped { name, is_clipped: true } => write!(f, "{name} clipped"),
            Meaning::Clipped { name, is_clipped: false } => write!(f, "{name} not clipped"),
            Meaning::State { name } => f.write_str(name.unwrap_or("no state")),
            Meaning::Reason { name } => f.write_str(name.unwrap_or("no reason")),
            Meaning::Sample => f.write_str("sample"),
            Meaning::Object { action, object: None } => write!(f, "{action} an object that no frame before names"),
            Meaning::Object { action, object: Some(object) } => write!(f, "{action} {object}"),
        }
    }
}

/// To nine significant digits: products of scales have more, which mean nothing.
fn rounded(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}

/// A message, its outcome still open.
pub(super) fn message(
    message: &Message,
    frame: &Frame,
    mut roles: Option<&mut MessageRoles>,
    is_taken: bool,
) -> DecodedMessage {
    let payload = frame.data();
    let is_there = |signal: &&Signal| signal.presence().is_in(payload) != Some(false);
    let signals = message.signals().filter(is_there).map(|signal| {
        let value = signal.decode(payload);
        let means = match (&mut roles, value) {
            (Some(roles), Some(value)) => roles.meanings(signal.name(), value, is_taken),
            _ => Vec::new(),
        };
        let (name, unit) = (signal.name().to_string(), signal.unit().to_string());
        DecodedSignal { name, value, unit, text: value.and_then(|_| text(signal, payload)), means }
    });
    let signals = signals.collect();
    let requests = roles.as_ref().map_or(&[][..], |roles| roles.requests());
    let requests = requests.iter().map(|action| Meaning::Request { action: action_name(*action), is_new: true });
    let sync = roles.as_ref().filter(|roles| roles.is_sync()).map(|_| Meaning::Sync);
    DecodedMessage {
        message: message.name().to_string(),
        senders: message.senders().to_vec(),
        outcome: Outcome::Unmapped,
        bytes: payload.len(),
        expected_bytes: message.length(),
        signals,
        means: requests.chain(sync).collect(),
    }
}

/// The text of the value table for the signal's raw number.
fn text(signal: &Signal, payload: &[u8]) -> Option<String> {
    let layout = signal.wire().layout();
    let raw = match layout.number() {
        Number::Signed => layout.extract_i64(payload)?,
        Number::Unsigned => i64::try_from(layout.extract_u64(payload)?).ok()?,
        Number::Float => return None,
    };
    signal.values().iter().find(|(number, _)| *number == raw).map(|(_, text)| text.clone())
}
