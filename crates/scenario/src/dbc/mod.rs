//! DBC files: messages and signals of a user's own network.
//!
//! A third of the public files break some rule of the format. What is wrong with a message or a signal is an error only
//! if just that one is asked for; [`Database::problems`] lists it all. Two signals that share bits are both wrong, for
//! the file doesn't say which.
//!
//! From the attributes in use with many tools come the format of a frame (`VFrameFormat`, by its number or its word,
//! and `CANFD_BRS`), the cycle time (`GenMsgCycleTime`) and long names (`SystemMessageLongSymbol`,
//! `SystemSignalLongSymbol`, `SystemNodeLongSymbol`). A message without `VFrameFormat`, or with `J1939PG`, is a
//! classical frame; a CAN FD frame without `CANFD_BRS` switches its bit rate. 29-bit identifiers are those written with
//! bit 31.

mod attributes;
mod build;
mod codec;
mod error;
mod multiplexing;
mod statements;
mod text;

use std::path::Path;
use std::sync::Arc;

use resonarm_protocol::{FrameFormat, Id};
use resonarm_wire::multiplex::Presence;
use resonarm_wire::signal::Signal as WireSignal;

use crate::nearest::nearest;
use crate::text_file;

pub use codec::{Codec, CodecError};
pub use error::{DbcError, Problem};
pub use text::decode;

/// A DBC file.
#[derive(Clone, Debug)]
pub struct Database {
    origin: Arc<str>,
    nodes: Vec<String>,
    messages: Vec<Named<Message>>,
    /// Problems of what isn't there.
    strays: Vec<Found>,
}

/// A message, or why it can't be used.
#[derive(Clone, Debug)]
struct Named<T> {
    name: String,
    /// The name in its BO_ or SG_, if that is another one.
    symbol: String,
    line: usize,
    value: Result<T, Problem>,
}

/// A message of a DBC.
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

/// A signal of a DBC.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    name: String,
    wire: WireSignal,
    presence: Presence,
    is_switch: bool,
    limits: Option<[f64; 2]>,
    unit: String,
    values: Vec<(i64, String)>,
    receivers: Vec<String>,
}

/// A problem, and where it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The line of the message or signal, from 1 on.
    pub line: usize,
    /// The message.
    pub message: String,
    /// The signal, if it is one of a signal.
    pub signal: Option<String>,
    /// What is wrong.
    pub problem: Problem,
}

impl Database {
    /// Reads a file.
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
    /// [`DbcError::Syntax`] or [`DbcError::SharedLine`] if the text is no DBC; not what is wrong with single messages.
    pub fn parse(text: &[u8], origin: &str) -> Result<Database, DbcError> {
        build::database(&text::decode(text), origin)
    }

    /// Where it is from.
    pub fn origin(&self) -> &str {
        &self.origin
    }

    /// The names of the nodes.
    pub fn nodes(&self) -> &[String] {
        &self.nodes
    }

    /// The message of this name: the long one, or that of its `BO_`.
    ///
    /// # Errors
    /// [`DbcError::NoMessage`] with the nearest name, [`DbcError::Message`] if it can't be used.
    pub fn message(&self, name: &str) -> Result<&Message, DbcError> {
        let Some(found) = find(&self.messages, name) else {
            let (origin, suggestion) = (self.origin.clone(), suggestion(&self.messages, name));
            return Err(DbcError::NoMessage { origin, name: name.to_string(), suggestion });
        };
        found.value.as_ref().map_err(|problem| DbcError::Message {
            origin: self.origin.clone(),
            line: found.line,
            message: found.name.clone(),
            problem: problem.clone(),
        })
    }

    /// The messages without problems of their own, in the order of the file.
    pub fn messages(&self) -> impl Iterator<Item = &Message> {
        self.messages.iter().filter_map(|message| message.value.as_ref().ok())
    }

    /// The message with this identifier, if it has no problem.
    pub fn message_by_id(&self, id: Id) -> Option<&Message> {
        self.messages().find(|message| message.id == id)
    }

    /// All that is wrong, in the order of the file.
    pub fn problems(&self) -> Vec<Found> {
        let mut found = self.strays.clone();
        for named in &self.messages {
            let at = |line, signal, problem: &Problem| Found {
                line,
                message: named.name.clone(),
                signal,
                problem: problem.clone(),
            };
            match &named.value {
                Err(problem) => found.push(at(named.line, None, problem)),
                Ok(message) => {
                    let wrong =
                        message.signals.iter().filter_map(|signal| Some((signal, signal.value.as_ref().err()?)));
                    found.extend(wrong.map(|(signal, problem)| at(signal.line, Some(signal.name.clone()), problem)));
                }
            }
        }
        found.sort_by_key(|found| found.line);
        found
    }
}

impl Message {
    /// Its name: the long one, if it has one.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its line in the file, from 1 on.
    pub const fn line(&self) -> usize {
        self.line
    }

    /// Its identifier.
    pub const fn id(&self) -> Id {
        self.id
    }

    /// The format of its frames.
    pub const fn format(&self) -> FrameFormat {
        self.format
    }

    /// The length of its payload, bytes.
    pub const fn length(&self) -> usize {
        self.length
    }

    /// Its cycle time, ms; None if the file states none, or 0.
    pub const fn cycle_time_ms(&self) -> Option<f64> {
        self.cycle_time_ms
    }

    /// The nodes that send it, that of its `BO_` first.
    pub fn senders(&self) -> &[String] {
        &self.senders
    }

    /// The signal of this name: the long one, or that of its `SG_`.
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
        found.value.as_ref().map_err(|problem| DbcError::Signal {
            origin: self.origin.clone(),
            line: found.line,
            message: self.name.clone(),
            signal: found.name.clone(),
            problem: problem.clone(),
        })
    }

    /// The line of a signal in the file, from 1 on; that of the message if there is no such signal.
    pub fn line_of(&self, name: &str) -> usize {
        find(&self.signals, name).map_or(self.line, |found| found.line)
    }

    /// The signals without problems, in the order of the file.
    pub fn signals(&self) -> impl Iterator<Item = &Signal> {
        self.signals.iter().filter_map(|signal| signal.value.as_ref().ok())
    }

    /// The codec of the whole message.
    pub const fn codec(&self) -> Codec<'_> {
        Codec::new(self)
    }
}

impl Signal {
    /// Its name: the long one, if it has one.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its bits, scale and offset.
    pub const fn wire(&self) -> &WireSignal {
        &self.wire
    }

    /// In which payloads it is present.
    pub const fn presence(&self) -> &Presence {
        &self.presence
    }

    /// Whether it selects other signals.
    pub const fn is_switch(&self) -> bool {
        self.is_switch
    }

    /// The least and the largest value that the file allows, in its unit; None if the file says nothing, which it does
    /// by two zeros. What the bits can represent is another range: [`WireSignal::range`].
    pub const fn limits(&self) -> Option<[f64; 2]> {
        self.limits
    }

    /// Its unit, as in the file.
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// Raw numbers that have a name.
    pub fn values(&self) -> &[(i64, String)] {
        &self.values
    }

    /// The nodes that receive it.
    pub fn receivers(&self) -> &[String] {
        &self.receivers
    }

    /// Its value in a payload; None if it is not in it: the payload is too short, or it is multiplexed and not
    /// selected.
    pub fn decode(&self, payload: &[u8]) -> Option<f64> {
        if self.presence.is_in(payload)? { self.wire.decode(payload) } else { None }
    }
}

/// The one of this name, or else of this symbol.
fn find<'a, T>(of: &'a [Named<T>], name: &str) -> Option<&'a Named<T>> {
    of.iter().find(|named| named.name == name).or_else(|| of.iter().find(|named| named.symbol == name))
}

fn suggestion<T>(of: &[Named<T>], name: &str) -> Option<String> {
    nearest(name, of.iter().map(|named| named.name.as_str()))
}

#[cfg(test)]
mod tests;
