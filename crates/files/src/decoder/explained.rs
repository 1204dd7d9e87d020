//! The explanation of a frame.

use super::check::Fault;
use super::meaning::Meaning;
use super::roles::{MessageRoles, action_name};
use resonarm_protocol::Frame;
use resonarm_scenario::dbc::{Message, Signal};

/// Explanation of one frame: whether it belongs to the protocol, and its content.
#[derive(Clone, Debug, PartialEq)]
pub enum Decoded {
    /// No message of the DBC has its identifier, or the one that has it can't be used. For CANopen drives, no object
    /// has it.
    Foreign,
    /// A request for a message: a remote frame, or one without data of a message that is sent on request.
    Request {
        /// Name of the requested message.
        message: String,
        /// Whether the plant answers.
        is_answered: bool,
    },
    /// A message with its signals.
    Message(DecodedMessage),
}

/// Outcome of a receiver's checks of a frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The receiver accepts the frame: its form and protection are right.
    Taken {
        /// Number of frames lost before it, according to the counter.
        lost: u64,
    },
    /// The receiver rejects the frame.
    Refused(Fault),
    /// The mapping does not use the message, or there is no mapping: nothing is checked.
    Unmapped,
}

/// Explanation of a message and of each of its signals.
#[derive(Clone, Debug, PartialEq)]
pub struct DecodedMessage {
    /// Name of the message in the DBC.
    pub message: String,
    /// The nodes that send it, according to the DBC; for CANopen drives the master, or a node and its joint.
    pub senders: Vec<String>,
    /// Outcome of the receiver's checks.
    pub outcome: Outcome,
    /// Number of bytes in the payload.
    pub bytes: usize,
    /// Number of bytes in the message of the DBC.
    pub expected_bytes: usize,
    /// Its signals in the order of the DBC, without those that the switches do not select.
    pub signals: Vec<DecodedSignal>,
    /// Meanings of the message as a whole.
    pub means: Vec<Meaning>,
}

impl DecodedMessage {
    /// Returns the signals that lie beyond the end of the payload.
    pub fn beyond(&self) -> impl Iterator<Item = &DecodedSignal> {
        self.signals.iter().filter(|signal| signal.value.is_none())
    }
}

/// Explanation of one signal of a message.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DecodedSignal {
    /// Name of the signal in the DBC.
    pub name: String,
    /// Its value, in its unit; `None` if the payload ends before it.
    pub value: Option<f64>,
    /// The exact integer, if the signal has more bits than `value` can hold.
    pub large: Option<LargeInteger>,
    /// Its unit, as in the DBC; empty without one.
    pub unit: String,
    /// The text of the DBC's value table, or CANopen's words.
    pub text: Option<String>,
    /// Meanings of the signal's value to the plant.
    pub means: Vec<Meaning>,
}

/// An integer of more than 53 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LargeInteger {
    /// Raw integer, before factor and offset.
    pub raw: i128,
    /// The value, if that is an integer, too.
    pub value: Option<i128>,
}

/// Makes a message whose outcome is still unknown.
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
        let name = signal.name().to_string();
        let unit = signal.unit().to_string();
        // Beyond 53 bits the `f64` is rounded; the exact integer is stated beside it.
        let is_large = value.is_some() && signal.wire().check_exact().is_err();
        let large = if is_large { signal.raw(payload) } else { None };
        let large = large.map(|raw| LargeInteger { raw, value: signal.large_integer(payload) });
        DecodedSignal {
            name,
            value,
            large,
            unit,
            text: value.and_then(|_| signal.text(payload)).map(str::to_string),
            means,
        }
    });
    let signals = signals.collect();
    let requests = roles.as_ref().map_or(&[][..], |roles| &roles.requests);
    let requests = requests.iter().map(|action| Meaning::Request { action: action_name(*action), is_new: true });
    let sync = roles.as_ref().filter(|roles| roles.is_sync).map(|_| Meaning::Sync);
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
