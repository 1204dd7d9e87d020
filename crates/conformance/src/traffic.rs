//! The frames received during a case: messages accepted, frames rejected and why, frames of others, commands.

use core::fmt;
use core::mem::discriminant;
use std::collections::BTreeMap;

use super::counters::is_command;
use super::damage::protect;
use resonarm_files::decoder::Fault;
use resonarm_protocol::{DecodeError, Frame, Id, Message, MessageKind, Network};

/// Most other identifiers that are counted separately; frames of further ones are counted together.
const MOST_OTHERS: usize = 16;

/// The frames received during a case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Frames accepted, by message; one of the tester's own kinds is from a second node in its place.
    pub taken: BTreeMap<MessageKind, u64>,
    /// Frames rejected, by message and reason.
    pub refused: Vec<Refused>,
    /// Frames with identifiers outside the network's, by identifier, for the first 16 identifiers.
    pub others: BTreeMap<Id, u64>,
    /// Frames of further identifiers.
    pub further_others: u64,
    /// Ranges of the commands received.
    pub commands: Commands,
    /// Frames of the node under test on a user protocol whose form is right, by message.
    pub user_taken: BTreeMap<String, u64>,
    /// Frames on a user protocol that were rejected, by message and kind of fault.
    pub user_refused: Vec<UserRefused>,
}

/// Frames of one message of a user protocol that were rejected for one kind of fault.
#[derive(Clone, Debug, PartialEq)]
pub struct UserRefused {
    /// Name of the message.
    pub message: String,
    /// The fault of the first of them.
    pub fault: Fault,
    /// The first of them.
    pub frame: Frame,
    /// Number of these frames.
    pub count: u64,
}

impl fmt::Display for UserRefused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} rejected: {}: {}", self.message, self.fault, self.frame)?;
        if self.count > 1 { write!(f, " ({} times)", self.count) } else { Ok(()) }
    }
}

/// Frames of one message that were rejected for the same reason.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// The error of the first of them.
    pub error: DecodeError,
    /// The first of them.
    pub frame: Frame,
    /// The same frame with the right CRC, if its CRC was wrong.
    pub expected: Option<Frame>,
    /// Number of these frames.
    pub count: u64,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.error, self.frame)?;
        if let Some(expected) = self.expected {
            write!(f, ", with the right CRC {expected}")?;
        }
        if self.count > 1 { write!(f, " ({} times)", self.count) } else { Ok(()) }
    }
}

/// The smallest and the largest of several values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest of the values.
    pub min: f64,
    /// Largest of the values.
    pub max: f64,
}

/// Names of the parts of loads: signals of Resonarm's protocol, and, of a user protocol, the force along a shaker.
const LOADS: [&str; 5] = ["force_x_n", "force_y_n", "torque1_nm", "torque2_nm", "force_n"];

/// The ranges of an exciter's commands.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Commands {
    /// Ranges of the parts that it commanded, N or N·m, by the part's key in a scenario.
    pub ranges: BTreeMap<&'static str, Range>,
}

impl Commands {
    /// Widens the ranges by a command.
    fn note(&mut self, message: &Message) {
        // The impedance head has signals of the same names, which are readings and not commands.
        if is_command(message) {
            message.signals(|name, value| self.note_part(name, value));
        }
    }

    /// Takes the part of a load by its key in a scenario, which is also the name of its signal; others are ignored.
    pub(super) fn note_part(&mut self, name: &str, value: f64) {
        if let Some(name) = LOADS.into_iter().find(|load| *load == name) {
            self.widen(name, Range { min: value, max: value });
        }
    }

    fn widen(&mut self, name: &'static str, by: Range) {
        let range = self.ranges.entry(name).or_insert(by);
        *range = Range { min: range.min.min(by.min), max: range.max.max(by.max) };
    }

    /// Adds the commands of another case.
    pub fn merge(&mut self, other: &Commands) {
        other.ranges.iter().for_each(|(name, range)| self.widen(name, *range));
    }
}

impl Traffic {
    /// Takes a frame, and the receiver's result for it.
    pub(super) fn note(&mut self, network: Network, frame: &Frame, decoded: &Result<Option<Message>, DecodeError>) {
        match decoded {
            Ok(Some(message)) => {
                *self.taken.entry(message.kind()).or_default() += 1;
                self.commands.note(message);
            }
            Ok(None) => self.note_other(frame.id()),
            Err(error) => self.refuse(network, frame, *error),
        }
    }

    fn refuse(&mut self, network: Network, frame: &Frame, error: DecodeError) {
        // A node tends to repeat its fault. The first frame shows it, and the others are only counted.
        match self.refused.iter_mut().find(|refused| is_alike(&refused.error, &error)) {
            Some(refused) => refused.count += 1,
            None => {
                let expected = matches!(error, DecodeError::Crc { .. })
                    .then(|| with_right_crc(network, error.kind(), frame))
                    .flatten();
                self.refused.push(Refused { error, frame: *frame, expected, count: 1 });
            }
        }
    }

    /// The frames of these messages that were rejected.
    pub(super) fn refused_of(&self, holds: impl Fn(MessageKind) -> bool) -> impl Iterator<Item = &Refused> {
        self.refused.iter().filter(move |refused| holds(refused.error.kind()))
    }

    /// Counts a frame that neither protocol nor mapping has.
    pub(super) fn note_other(&mut self, id: Id) {
        // Nodes of other protocols may use any number of identifiers; the report must stay bounded.
        if self.others.len() < MOST_OTHERS || self.others.contains_key(&id) {
            *self.others.entry(id).or_default() += 1;
        } else {
            self.further_others += 1;
        }
    }

    /// Counts a frame of a user protocol that was rejected.
    pub(super) fn note_user_refused(&mut self, message: &str, fault: &Fault, frame: &Frame) {
        let is_alike = |refused: &&mut UserRefused| {
            refused.message == message
                && discriminant(&refused.fault) == discriminant(fault)
                && refused.fault.kind() == fault.kind()
        };
        match self.user_refused.iter_mut().find(is_alike) {
            Some(refused) => refused.count += 1,
            None => self.user_refused.push(UserRefused {
                message: String::from(message),
                fault: fault.clone(),
                frame: *frame,
                count: 1,
            }),
        }
    }

    /// The frames received in place of an expected message.
    pub(super) fn in_place_of(&self, kind: MessageKind) -> String {
        if let Some(refused) = self.refused_of(|refused| refused == kind).next() {
            return format!("{refused}");
        }
        let taken: u64 = self.taken.values().sum();
        let refused: u64 = self.refused.iter().map(|refused| refused.count).sum();
        if let Some(first) = self.refused.first() {
            return format!("{taken} frames of the network taken and {refused} rejected, the first: {first}");
        }
        match (taken, self.others_text()) {
            (0, others) if others.is_empty() => String::from("nothing"),
            (0, others) => format!("frames with other identifiers only: {others}"),
            (taken, _) => format!("{taken} other frames of the network"),
        }
    }

    /// The identifiers of others, with their numbers of frames.
    pub fn others_text(&self) -> String {
        let mut texts: Vec<String> = self.others.iter().map(|(id, count)| format!("{id} ({count})")).collect();
        if self.further_others > 0 {
            texts.push(format!("more ({})", self.further_others));
        }
        texts.join(", ")
    }
}

/// Whether two frames were rejected for the same reason.
fn is_alike(one: &DecodeError, other: &DecodeError) -> bool {
    let fault = |error: &DecodeError| match error {
        DecodeError::Counter { fault, .. } => Some(discriminant(fault)),
        _ => None,
    };
    one.kind() == other.kind() && discriminant(one) == discriminant(other) && fault(one) == fault(other)
}

fn with_right_crc(network: Network, kind: MessageKind, frame: &Frame) -> Option<Frame> {
    let mut data = frame.data().to_vec();
    protect(&mut data, kind.data_id(network)?);
    Frame::new(frame.id(), frame.format(), &data).ok()
}
