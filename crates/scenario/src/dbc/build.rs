//! Builds checked messages and signals from the statements of a DBC.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use resonarm_protocol::{Frame, FrameFormat, Id};
use resonarm_wire::PAYLOAD_MAX_BYTES;
use resonarm_wire::layout::{ByteOrder, Layout, Number};
use resonarm_wire::multiplex::Presence;
use resonarm_wire::signal::Signal as WireSignal;

use super::attributes::Attributes;
use super::error::{DbcError, Problem};
use super::multiplexing::{self, Switches};
use super::syntax::{MessageStatement, OfSignal, SignalStatement, Statements};
use super::{Database, Found, Message, Named, Signal};

/// Largest 29-bit identifier; the next constant is the bit by which a DBC marks one.
const EXTENDED_MAX: u64 = 0x1FFF_FFFF;
const EXTENDED: u64 = 1 << 31;

pub(super) fn database(text: &str, origin: &str) -> Result<Database, DbcError> {
    let origin: Arc<str> = Arc::from(origin);
    let statements = Statements::parse(text).map_err(|error| DbcError::Syntax {
        origin: origin.clone(),
        line: error.line,
        column: error.column,
        expected: error.expected,
        got: error.got,
    })?;
    let file = File {
        origin: origin.clone(),
        attributes: Attributes::new(&statements),
        types: by_signal(&statements.types),
        values: by_signal(&statements.values),
        switches: multiplexing::switches(&statements),
        senders: statements.senders.iter().map(|(id, nodes)| (*id, nodes.as_slice())).collect(),
    };
    let mut messages: Vec<Named<Message>> = statements.messages.iter().map(|message| file.message(message)).collect();
    // Twins come first: a message whose identifier is ambiguous has no value, and `restrict` then leaves it
    // with that error.
    refuse_twins(&mut messages, &statements.messages);
    restrict_names(&mut messages);
    let listed = statements.nodes.iter();
    // Many files leave out nodes that their messages name.
    let senders = statements.messages.iter().flat_map(|message| &message.sender);
    let further = statements.senders.iter().flat_map(|(_, nodes)| nodes);
    let nodes = file.distinct_nodes(listed.chain(senders).chain(further));
    Ok(Database { strays: strays(&statements), origin, nodes, messages })
}

/// Indexes statements by message, with the identifier as written, and by signal.
fn by_signal<T>(statements: &[OfSignal<T>]) -> HashMap<Key<'_>, &T> {
    statements.iter().map(|of| ((of.message, of.signal.as_str()), &of.value)).collect()
}

type Key<'a> = (u64, &'a str);

/// Finds statements about signals or messages that the file does not define.
fn strays(statements: &Statements) -> Vec<Found> {
    fn of<'a, T>(
        keyword: &'static str,
        listed: &'a [OfSignal<T>],
    ) -> impl Iterator<Item = (&'static str, usize, Key<'a>)> {
        listed.iter().map(move |of| (keyword, of.line, (of.message, of.signal.as_str())))
    }
    let mut signals: HashMap<u64, (&str, HashSet<&str>)> = HashMap::new();
    for message in &statements.messages {
        let entry = signals.entry(message.id).or_insert((&message.name, HashSet::new()));
        entry.1.extend(message.signals.iter().map(|signal| signal.name.as_str()));
    }
    let all = of("SIG_VALTYPE_", &statements.types)
        .chain(of("SG_MUL_VAL_", &statements.switches))
        .chain(of("VAL_", &statements.values))
        .chain(of("CM_", &statements.comments));
    let strays = all.filter_map(|(statement, line, (id, signal))| {
        let (message, problem) = match signals.get(&id) {
            Some((_, known)) if known.contains(signal) => return None,
            Some((message, _)) => (message.to_string(), Problem::NoSuchSignal { statement }),
            None => (String::new(), Problem::NoSuchMessage { statement, id }),
        };
        Some(Found { line, message, signal: Some(signal.to_string()), problem })
    });
    strays.collect()
}

/// Everything in the file that messages and signals refer to.
struct File<'a> {
    origin: Arc<str>,
    attributes: Attributes<'a>,
    types: HashMap<Key<'a>, &'a u64>,
    values: HashMap<Key<'a>, &'a Vec<(i128, String)>>,
    switches: HashMap<u64, Switches<'a>>,
    senders: HashMap<u64, &'a [String]>,
}

impl<'a> File<'a> {
    fn message(&self, statement: &'a MessageStatement) -> Named<Message> {
        let MessageStatement { line, id, name: symbol, .. } = statement;
        let name = self.attributes.message_name(*id, symbol);
        let checked = self.checked(statement, &name);
        let (value, restriction) = match checked {
            Ok((message, restriction)) => (Ok(message), restriction),
            Err(problem) => (Err(problem), None),
        };
        Named { name, symbol: symbol.clone(), line: *line, value, restriction }
    }

    /// Returns the message, with the reason if it can be decoded but not used by its name.
    fn checked(&self, statement: &'a MessageStatement, name: &str) -> Result<(Message, Option<Problem>), Problem> {
        let id = match statement.id {
            id @ 0..=0x7FF => Id::Standard(id as u16),
            id if (EXTENDED..=EXTENDED | EXTENDED_MAX).contains(&id) => Id::Extended((id - EXTENDED) as u32),
            got => return Err(Problem::Id { got }),
        };
        let (stated, unknown) = match self.attributes.format(statement.id, statement.bytes) {
            Ok(format) => (format, None),
            // An unknown format is no reason to lose the message. It is read as a classical frame and marked,
            // so that it can be decoded but not used by its name.
            Err(problem) => (FrameFormat::Classic, Some(problem)),
        };
        let too_long = Problem::Length { got: statement.bytes, format: stated };
        // Beyond the longest payload of CAN FD no frame can be decoded at all.
        let length = usize::try_from(statement.bytes).ok().filter(|length| *length <= PAYLOAD_MAX_BYTES);
        let length = length.ok_or(too_long.clone())?;
        // What is longer than its format allows can still be read: frames of CAN FD hold it.
        let is_possible = Frame::new(id, stated, &[0; PAYLOAD_MAX_BYTES][..length]).is_ok();
        let format = if is_possible { stated } else { self.attributes.fd(statement.id) };
        let restriction = unknown.or((!is_possible).then_some(too_long));
        let further = self.senders.get(&statement.id).copied().unwrap_or_default();
        let message = Message {
            origin: self.origin.clone(),
            line: statement.line,
            id,
            format,
            length,
            cycle_time_ms: self.attributes.cycle_time_ms(statement.id),
            senders: self.distinct_nodes(statement.sender.iter().chain(further)),
            signals: self.signals(statement, length),
            name: name.to_string(),
        };
        Ok((message, restriction))
    }

    /// Returns the long names of nodes, each once, in the order of their first mention.
    fn distinct_nodes<'n>(&self, symbols: impl Iterator<Item = &'n String>) -> Vec<String> {
        let mut nodes = Vec::new();
        for node in symbols.map(|symbol| self.attributes.node_name(symbol)) {
            if !nodes.contains(&node) {
                nodes.push(node);
            }
        }
        nodes
    }

    fn signals(&self, message: &MessageStatement, length: usize) -> Vec<Named<Signal>> {
        let layouts: Vec<_> = message.signals.iter().map(|signal| self.layout(message.id, signal, length)).collect();
        let switches = self.switches.get(&message.id);
        let presences = multiplexing::presences(message, &layouts, switches);
        let mut signals: Vec<Named<Signal>> = Vec::new();
        for (position, signal) in message.signals.iter().enumerate() {
            let name = self.attributes.signal_name(message.id, &signal.name);
            let value = match (&layouts[position], &presences[position]) {
                (Err(problem), _) | (_, Err(problem)) => Err(problem.clone()),
                (Ok(layout), Ok(presence)) => self
                    .signal(message.id, signal, &name, *layout, presence)
                    .map(|of| Signal { is_switch: multiplexing::is_switch(signal, switches), ..of }),
            };
            let inexact = value.as_ref().ok().and_then(|of| of.wire.check_exact().err()).map(Problem::Value);
            signals.push(Named { name, symbol: signal.name.clone(), line: signal.line, value, restriction: inexact });
        }
        // Overlaps need the presences of all signals, since signals selected by different values of a switch
        // may share bits.
        restrict_overlaps(&mut signals, &layouts, &presences);
        restrict_names(&mut signals);
        signals
    }

    fn layout(&self, id: u64, signal: &SignalStatement, length: usize) -> Result<Layout, Problem> {
        let of_float = match self.types.get(&(id, signal.name.as_str())) {
            Some(1) => Some(32),
            Some(2) => Some(64),
            _ => None,
        };
        let number = match of_float {
            Some(expected) if expected != signal.bits => {
                return Err(Problem::ValueTypeBits { got: signal.bits, expected });
            }
            Some(_) => Number::Float,
            None if signal.is_signed => Number::Signed,
            None => Number::Unsigned,
        };
        let order = if signal.is_intel { ByteOrder::Intel } else { ByteOrder::Motorola };
        Ok(Layout::new(signal.start_bit, signal.bits, order, number, length)?)
    }

    fn signal(
        &self,
        message: u64,
        signal: &SignalStatement,
        name: &str,
        layout: Layout,
        presence: &Presence,
    ) -> Result<Signal, Problem> {
        Ok(Signal {
            name: name.to_string(),
            wire: WireSignal::new(layout, signal.factor, signal.offset)?,
            presence: presence.clone(),
            is_switch: signal.is_switch,
            limits: (signal.limits != [0.0, 0.0]).then_some(signal.limits),
            unit: signal.unit.clone(),
            values: self.values.get(&(message, signal.name.as_str())).map_or(Vec::new(), |values| values.to_vec()),
            receivers: signal.receivers.iter().map(|node| self.attributes.node_name(node)).collect(),
        })
    }
}

/// Marks signals that share bits in the same payload. They can be decoded, but writing one of them would change
/// the other.
fn restrict_overlaps(
    signals: &mut [Named<Signal>],
    layouts: &[Result<Layout, Problem>],
    presences: &[Result<Presence, Problem>],
) {
    let bits: Vec<_> = layouts.iter().map(|layout| layout.as_ref().ok().map(Layout::occupied)).collect();
    // All pairs: a message has at most a few hundred signals, and `first_common` compares bit sets.
    for one in 0..signals.len() {
        for other in 0..one {
            let (Some(mine), Some(others)) = (&bits[one], &bits[other]) else { continue };
            let Some(bit) = mine.first_common(others) else { continue };
            let are_apart = match (&presences[one], &presences[other]) {
                (Ok(mine), Ok(others)) => mine.excludes(others),
                // Of a signal that is wrong anyway, it isn't known when it is present.
                _ => true,
            };
            if !are_apart {
                for (of, with) in [(one, other), (other, one)] {
                    let problem = Problem::Overlap { other: signals[with].name.clone(), line: signals[with].line, bit };
                    restrict(&mut signals[of], problem);
                }
            }
        }
    }
}

/// Marks messages or signals with the same name. They can be decoded, but the name does not identify one of
/// them.
fn restrict_names<T>(of: &mut [Named<T>]) {
    let mut lines: HashMap<String, (usize, usize)> = HashMap::new();
    for position in 0..of.len() {
        let name = of[position].name.clone();
        if let Some((first, line)) = lines.get(&name).copied() {
            let problem = Problem::NameTwice { line: of[position].line };
            restrict(&mut of[first], problem);
            restrict(&mut of[position], Problem::NameTwice { line });
        } else {
            lines.insert(name, (position, of[position].line));
        }
    }
}

/// Rejects all messages that share an identifier: attributes and further senders in the file could belong to
/// either.
fn refuse_twins(messages: &mut [Named<Message>], statements: &[MessageStatement]) {
    let mut first: HashMap<u64, usize> = HashMap::new();
    for (position, statement) in statements.iter().enumerate() {
        let Some(one) = first.get(&statement.id).copied() else {
            first.insert(statement.id, position);
            continue;
        };
        for (of, with) in [(one, position), (position, one)] {
            let problem = Problem::IdTwice { other: messages[with].name.clone(), line: messages[with].line };
            if messages[of].value.is_ok() {
                messages[of].value = Err(problem);
            }
        }
    }
}

/// Notes why something can only be read, if there is no reason yet.
fn restrict<T>(named: &mut Named<T>, problem: Problem) {
    if named.value.is_ok() && named.restriction.is_none() {
        named.restriction = Some(problem);
    }
}

impl Message {
    /// Returns whether the message is sent in CAN FD frames.
    pub const fn is_fd(&self) -> bool {
        matches!(self.format, FrameFormat::Fd { .. })
    }
}
