//! Reads DBC files: the messages and signals of a user's CAN network.
//!
//! A third of the public DBC files break some rule of the format. A broken rule is an error only for those who
//! ask for just this message or signal by name; [`Database::problems`] lists all of them. Some broken items can
//! still be read, as a payload has exactly one value of each: signals that share bits, integers of more than 53
//! bits, and messages or signals with the same name. They are decoded, and rejected when they are requested by
//! name, to be written or to act as a load.
//!
//! Attributes that many tools use supply the format of a frame (`VFrameFormat`, by its number or its word, and
//! `CANFD_BRS`), the cycle time (`GenMsgCycleTime`) and long names (`SystemMessageLongSymbol`,
//! `SystemSignalLongSymbol`, `SystemNodeLongSymbol`). A message with `J1939PG`, or without `VFrameFormat` and
//! with at most 8 bytes, is a classical frame; a longer one without `VFrameFormat` is a CAN FD frame; one
//! without `CANFD_BRS` switches its bit rate. 29-bit identifiers are those written with bit 31.

mod attributes;
mod build;
mod codec;
mod error;
mod lexer;
mod multiplexing;
mod syntax;
mod text;

use std::path::Path;
use std::sync::Arc;

use resonarm_protocol::{FrameFormat, Id};
use resonarm_wire::layout::Number;
use resonarm_wire::multiplex::Presence;
use resonarm_wire::signal::Signal as WireSignal;

use crate::nearest::nearest;
use crate::text_file;

pub use codec::{Codec, CodecError};
pub use error::{DbcError, Problem};
pub(crate) use syntax::NO_NODE;
pub use text::decode;

/// Contents of a DBC file: nodes, messages and signals, with the problems found in them.
#[derive(Clone, Debug)]
pub struct Database {
    origin: Arc<str>,
    nodes: Vec<String>,
    messages: Vec<Named<Message>>,
    /// Statements about messages or signals that the file does not define.
    strays: Vec<Found>,
}

/// A message or signal with its names and line, or the reason why it can't be used.
#[derive(Clone, Debug)]
struct Named<T> {
    name: String,
    /// Name in `BO_` or `SG_`, which differs from `name` if the file states a long name.
    symbol: String,
    line: usize,
    value: Result<T, Problem>,
    /// Reason why it can be decoded, but not requested by name.
    restriction: Option<Problem>,
}

impl<T> Named<T> {
    /// Returns the rule that it breaks, if it breaks one.
    fn problem(&self) -> Option<&Problem> {
        self.value.as_ref().err().or(self.restriction.as_ref())
    }

    /// Returns the value, or the problem that keeps it from being requested by name.
    fn usable(&self) -> Result<&T, &Problem> {
        let value = self.value.as_ref()?;
        self.restriction.as_ref().map_or(Ok(value), Err)
    }
}

/// A message of a DBC: identifier, frame format, length, and signals.
#[derive(Clone, Debug)]
pub struct Message {
    origin: Arc<str>,
    line: usize,
    name: String,
    id: Id,
    format: FrameFormat,
    length: usize,
    cycle_time_ms: Option<f64>,
    senders: Vec<String>,
    signals: Vec<Named<Signal>>,
}

/// A signal of a DBC: bits, scaling, unit, and when it is present.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    name: String,
    wire: WireSignal,
    presence: Presence,
    is_switch: bool,
    limits: Option<[f64; 2]>,
    unit: String,
    values: Vec<(i128, String)>,
    receivers: Vec<String>,
}

/// A problem and its place in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The line of the message or signal, from 1 on.
    pub line: usize,
    /// Name of the message; empty if the file has no message with the identifier.
    pub message: String,
    /// Name of the signal, if the problem is about a signal.
    pub signal: Option<String>,
    /// Rule that the message or signal breaks.
    pub problem: Problem,
}

impl Database {
    /// Reads a DBC file.
    ///
    /// # Errors
    /// [`DbcError::Read`] if it can't be read or has more than 16 MiB; else as [`Database::parse`].
    pub fn read(path: &Path) -> Result<Database, DbcError> {
        let bytes =
            text_file::read_network(path).map_err(|source| DbcError::Read { path: path.to_path_buf(), source })?;
        Database::parse(&bytes, &path.display().to_string())
    }

    /// Reads the text of a file, which is from `origin`: UTF-8, or if it is not, the code page 1252 of Windows.
    ///
    /// # Errors
    /// [`DbcError::Syntax`] if the text is not a DBC; faults of single messages are not errors.
    pub fn parse(text: &[u8], origin: &str) -> Result<Database, DbcError> {
        build::database(&text::decode(text), origin)
    }

    /// Returns the path or name of the source, for messages.
    pub fn origin(&self) -> &str {
        &self.origin
    }

    /// Returns the names of the nodes: those of `BU_`, then those that only messages name as their senders.
    pub fn nodes(&self) -> &[String] {
        &self.nodes
    }

    /// Returns the message of this name, either the long one or that of its `BO_`.
    ///
    /// # Errors
    /// [`DbcError::NoMessage`] with the nearest name, [`DbcError::Message`] if it can't be used.
    pub fn message(&self, name: &str) -> Result<&Message, DbcError> {
        let Some(found) = find(&self.messages, name) else {
            let origin = self.origin.clone();
            let suggestion = suggestion(&self.messages, name);
            return Err(DbcError::NoMessage { origin, name: name.to_string(), suggestion });
        };
        found.usable().map_err(|problem| DbcError::Message {
            origin: self.origin.clone(),
            line: found.line,
            message: found.name.clone(),
            problem: problem.clone(),
        })
    }

    /// Returns the messages that can be read, in the order of the file.
    pub fn messages(&self) -> impl Iterator<Item = &Message> {
        self.messages.iter().filter_map(|message| message.value.as_ref().ok())
    }

    /// Returns the message with this identifier, if it can be read.
    pub fn message_by_id(&self, id: Id) -> Option<&Message> {
        self.messages().find(|message| message.id == id)
    }

    /// Returns all problems of the file, in the order of its lines.
    pub fn problems(&self) -> Vec<Found> {
        let mut found = self.strays.clone();
        for named in &self.messages {
            let at = |line, signal, problem: &Problem| Found {
                line,
                message: named.name.clone(),
                signal,
                problem: problem.clone(),
            };
            found.extend(named.problem().map(|problem| at(named.line, None, problem)));
            if let Ok(message) = &named.value {
                let wrong = message.signals.iter().filter_map(|signal| Some((signal, signal.problem()?)));
                found.extend(wrong.map(|(signal, problem)| at(signal.line, Some(signal.name.clone()), problem)));
            }
        }
        found.sort_by_key(|found| found.line);
        found
    }
}

impl Message {
    /// Returns the long name, or the symbol if there is none.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the line in the file, from 1 on.
    pub const fn line(&self) -> usize {
        self.line
    }

    /// Returns the identifier of the frame, of 11 or 29 bits.
    pub const fn id(&self) -> Id {
        self.id
    }

    /// Returns the format of its frames.
    pub const fn format(&self) -> FrameFormat {
        self.format
    }

    /// Returns the length of its payload, bytes.
    pub const fn length(&self) -> usize {
        self.length
    }

    /// Returns the cycle time, ms; `None` if the file states none, or 0.
    pub const fn cycle_time_ms(&self) -> Option<f64> {
        self.cycle_time_ms
    }

    /// Returns the nodes that send it, that of its `BO_` first.
    pub fn senders(&self) -> &[String] {
        &self.senders
    }

    /// Returns the signal of this name, either the long one or that of its `SG_`.
    ///
    /// # Errors
    /// [`DbcError::NoSignal`] with the nearest name, [`DbcError::Signal`] if it can't be used.
    pub fn signal(&self, name: &str) -> Result<&Signal, DbcError> {
        let Some(found) = find(&self.signals, name) else {
            return Err(DbcError::NoSignal {
                origin: self.origin.clone(),
                line: self.line,
                message: self.name.clone(),
                name: name.to_string(),
                suggestion: suggestion(&self.signals, name),
            });
        };
        found.usable().map_err(|problem| DbcError::Signal {
            origin: self.origin.clone(),
            line: found.line,
            message: self.name.clone(),
            signal: found.name.clone(),
            problem: problem.clone(),
        })
    }

    /// Returns the line of a signal in the file, from 1 on, or that of the message if there is no such signal.
    pub fn line_of(&self, name: &str) -> usize {
        find(&self.signals, name).map_or(self.line, |found| found.line)
    }

    /// Returns the signals that can be read, in the order of the file.
    pub fn signals(&self) -> impl Iterator<Item = &Signal> {
        self.signals.iter().filter_map(|signal| signal.value.as_ref().ok())
    }

    /// Returns the signals that can be read and written, in the order of the file.
    fn writable_signals(&self) -> impl Iterator<Item = &Signal> {
        self.signals.iter().filter_map(|signal| signal.usable().ok())
    }

    /// Returns the codec of the whole message.
    pub const fn codec(&self) -> Codec<'_> {
        Codec::new(self)
    }
}

impl Signal {
    /// Returns the long name, or the symbol if there is none.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns its bits, scale and offset.
    pub const fn wire(&self) -> &WireSignal {
        &self.wire
    }

    /// Returns the condition for payloads that contain it.
    pub const fn presence(&self) -> &Presence {
        &self.presence
    }

    /// Returns whether it selects other signals.
    pub const fn is_switch(&self) -> bool {
        self.is_switch
    }

    /// Returns the least and the largest value that the file allows, in its unit; `None` if the file states
    /// none, which it does by two zeros. The range of the bits is another one: [`WireSignal::range`].
    pub const fn limits(&self) -> Option<[f64; 2]> {
        self.limits
    }

    /// Returns its unit as in the file.
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// Returns the value table: raw numbers and their names.
    pub fn values(&self) -> &[(i128, String)] {
        &self.values
    }

    /// Returns the nodes that receive it.
    pub fn receivers(&self) -> &[String] {
        &self.receivers
    }

    /// Returns its value in a payload; `None` if the payload does not contain it, because it is too short or
    /// selects other signals.
    pub fn decode(&self, payload: &[u8]) -> Option<f64> {
        if self.presence.is_in(payload)? { self.wire.decode(payload) } else { None }
    }

    /// Returns its raw number in a payload if that is an integer, whether the signal is selected or not; `None`
    /// for a floating-point signal that is not an integer, or if the payload is too short.
    pub fn raw(&self, payload: &[u8]) -> Option<i128> {
        let layout = self.wire.layout();
        match layout.number() {
            Number::Unsigned => layout.extract_u64(payload).map(i128::from),
            Number::Signed => layout.extract_i64(payload).map(i128::from),
            // The integers that every floating-point number of 64 bits near them can tell apart.
            // Below 9e15, less than 2^53, every integer is a distinct f64.
            Number::Float => {
                layout.extract_f64(payload).filter(|raw| raw.fract() == 0.0 && raw.abs() < 9e15).map(|raw| raw as i128)
            }
        }
    }

    /// Returns the name in the value table of its raw number in a payload.
    pub fn text(&self, payload: &[u8]) -> Option<&str> {
        if self.values.is_empty() {
            return None;
        }
        let raw = self.raw(payload)?;
        self.values.iter().find(|(number, _)| *number == raw).map(|(_, text)| text.as_str())
    }

    /// Returns its value as an integer if it has more bits than a floating-point number keeps, and factor and
    /// offset are integers.
    pub fn large_integer(&self, payload: &[u8]) -> Option<i128> {
        self.wire.check_exact().err()?;
        let integer = |number: f64| (number.fract() == 0.0 && number.abs() < 9e15).then_some(number as i128);
        let factor = integer(self.wire.scale())?;
        let offset = integer(self.wire.offset())?;
        self.raw(payload)?.checked_mul(factor)?.checked_add(offset)
    }
}

/// Finds an entry by its long name, or else by its symbol: a long name wins over the symbol of another entry.
fn find<'a, T>(of: &'a [Named<T>], name: &str) -> Option<&'a Named<T>> {
    of.iter().find(|named| named.name == name).or_else(|| of.iter().find(|named| named.symbol == name))
}

fn suggestion<T>(of: &[Named<T>], name: &str) -> Option<String> {
    nearest(name, of.iter().map(|named| named.name.as_str()))
}

#[cfg(test)]
mod tests;
