//! From the parsed file to messages and signals that are checked.

use std::collections::HashMap;
use std::sync::Arc;

use can_dbc::{Dbc, NumericValue, SignalExtendedValueType, ValueDescription};
use resonarm_protocol::{Frame, FrameFormat, Id};
use resonarm_wire::PAYLOAD_MAX_BYTES;
use resonarm_wire::layout::{ByteOrder, Layout, Number};
use resonarm_wire::multiplex::Presence;
use resonarm_wire::signal::Signal as WireSignal;

use super::attributes::Attributes;
use super::multiplexing::Switches;
use super::statements::{MessageLine, Scan, scan};
use super::{Database, DbcError, Found, Message, Named, Problem, Signal};

pub(super) fn database(text: &str, origin: &str) -> Result<Database, DbcError> {
    let origin: Arc<str> = Arc::from(origin);
    let Scan { text, messages: lines, impossible } = scan(text);
    let dbc = Dbc::try_from(text.as_str())
        .map_err(|error| DbcError::Syntax { origin: origin.clone(), reason: reason(&error) })?;
    check_lines(&dbc, &lines, &origin)?;
    let file =
        File { origin: origin.clone(), attributes: Attributes::new(&dbc), types: types(&dbc), values: values(&dbc) };
    let switches = Switches::by_message(&dbc);
    let mut messages: Vec<Named<Message>> = Vec::new();
    for (message, line) in dbc.messages.iter().zip(&lines) {
        let value = file.message(message, line, switches.get(&message.id));
        let name = file.attributes.message_name(message.id, &message.name);
        messages.push(Named { name, symbol: message.name.clone(), line: line.line, value });
    }
    messages.extend(impossible.into_iter().map(|MessageLine { name, id, line, .. }| Named {
        symbol: name.clone(),
        name,
        line,
        value: Err(Problem::Id { got: id }),
    }));
    messages.sort_by_key(|message| message.line);
    refuse_twins(&mut messages, &lines);
    let nodes = dbc.nodes.iter().map(|node| file.attributes.node_name(&node.0)).collect();
    Ok(Database { strays: strays(&dbc, &lines), origin, nodes, messages })
}

/// What the parser says, in one line, with the place.
fn reason(error: &can_dbc::DbcError) -> String {
    let whole = error.to_string();
    // The first line is ` --> 3:1`, the third `3 | the text of the line`, the last ` = expected …`.
    let place = whole.lines().next().and_then(|first| first.trim().strip_prefix("--> ")?.split_once(':'));
    let Some((line, column)) = place else {
        return whole;
    };
    let text = whole.lines().nth(2).and_then(|third| third.split_once(" | ")).map_or("", |(_, text)| text);
    let shown: String = text.chars().take(80).collect();
    format!("line {line}, column {column} can't be read as DBC: {shown:?}")
}

/// Whether the lines found before are those of the messages and signals that the parser has found.
fn check_lines(dbc: &Dbc, lines: &[MessageLine], origin: &Arc<str>) -> Result<(), DbcError> {
    for (position, message) in dbc.messages.iter().enumerate() {
        let line = lines.get(position);
        let names = |line: &MessageLine| {
            line.signals.iter().map(|(name, _)| name).eq(message.signals.iter().map(|of| &of.name))
        };
        if !line.is_some_and(|line| line.name == message.name && names(line)) {
            let line = line.or(lines.last()).map_or(1, |line| line.line);
            return Err(DbcError::SharedLine { origin: origin.clone(), line });
        }
    }
    Ok(())
}

type Key<'a> = (can_dbc::MessageId, &'a str);

/// The floating-point types of signals, by their bits.
fn types(dbc: &Dbc) -> HashMap<Key<'_>, u64> {
    let listed = dbc.signal_extended_value_type_list.iter().filter_map(|of| {
        let bits = match of.signal_extended_value_type {
            SignalExtendedValueType::IEEEfloat32Bit => 32,
            SignalExtendedValueType::IEEEdouble64bit => 64,
            SignalExtendedValueType::SignedOrUnsignedInteger => return None,
        };
        Some(((of.message_id, of.signal_name.as_str()), bits))
    });
    listed.collect()
}

/// The names of raw numbers of signals.
fn values(dbc: &Dbc) -> HashMap<Key<'_>, Vec<(i64, String)>> {
    let listed = dbc.value_descriptions.iter().filter_map(|of| match of {
        ValueDescription::Signal { message_id, name, value_descriptions } => {
            let values = value_descriptions.iter().map(|value| (value.id, value.description.clone())).collect();
            Some(((*message_id, name.as_str()), values))
        }
        ValueDescription::EnvironmentVariable { .. } => None,
    });
    listed.collect()
}

/// Types given to signals that aren't there.
fn strays(dbc: &Dbc, lines: &[MessageLine]) -> Vec<Found> {
    let messages: HashMap<_, _> =
        dbc.messages.iter().zip(lines).map(|(message, line)| (message.id, (message, line.line))).collect();
    let listed = dbc.signal_extended_value_type_list.iter().filter_map(|of| {
        let found = messages.get(&of.message_id);
        if found.is_some_and(|(message, _)| message.signals.iter().any(|signal| signal.name == of.signal_name)) {
            return None;
        }
        let (message, line) = found.map_or((String::new(), 1), |(message, line)| (message.name.clone(), *line));
        Some(Found { line, message, signal: Some(of.signal_name.clone()), problem: Problem::ValueTypeOfNothing })
    });
    listed.collect()
}

/// What is known of the whole file.
struct File<'a> {
    origin: Arc<str>,
    attributes: Attributes<'a>,
    types: HashMap<Key<'a>, u64>,
    values: HashMap<Key<'a>, Vec<(i64, String)>>,
}

impl<'a> File<'a> {
    fn message(
        &self,
        message: &'a can_dbc::Message,
        line: &MessageLine,
        switches: Option<&Switches<'a>>,
    ) -> Result<Message, Problem> {
        let id = match message.id {
            can_dbc::MessageId::Standard(id) => Id::Standard(id),
            can_dbc::MessageId::Extended(id) => Id::Extended(id),
        };
        let format = self.attributes.format(message.id)?;
        let length = usize::try_from(message.size).unwrap_or(usize::MAX);
        let zeros = [0; PAYLOAD_MAX_BYTES].get(..length).ok_or(Problem::Length { got: message.size, format })?;
        Frame::new(id, format, zeros).map_err(|_| Problem::Length { got: message.size, format })?;
        let senders = message.transmitter.iter().chain(switches.iter().flat_map(|of| of.senders)).map(String::as_str);
        let mut unique: Vec<String> = Vec::new();
        for sender in senders.map(|sender| self.attributes.node_name(sender)) {
            if !unique.contains(&sender) {
                unique.push(sender);
            }
        }
        let name = self.attributes.message_name(message.id, &message.name);
        Ok(Message {
            origin: self.origin.clone(),
            line: line.line,
            id,
            format,
            length,
            cycle_time_ms: self.attributes.cycle_time_ms(message.id),
            senders: unique,
            signals: self.signals(message, line, length, switches),
            name,
        })
    }

    fn signals(
        &self,
        message: &can_dbc::Message,
        line: &MessageLine,
        length: usize,
        switches: Option<&Switches<'a>>,
    ) -> Vec<Named<Signal>> {
        let layouts: Vec<_> = message.signals.iter().map(|signal| self.layout(message.id, signal, length)).collect();
        let presences = super::multiplexing::presences(message, &layouts, switches);
        let mut signals: Vec<Named<Signal>> = Vec::new();
        for (position, signal) in message.signals.iter().enumerate() {
            let name = self.attributes.signal_name(message.id, &signal.name);
            let value = match (&layouts[position], &presences[position]) {
                (Err(problem), _) | (_, Err(problem)) => Err(problem.clone()),
                (Ok(layout), Ok(presence)) => self.signal(message, signal, &name, *layout, presence),
            };
            let line = line.signals.get(position).map_or(line.line, |(_, line)| *line);
            signals.push(Named { name, symbol: signal.name.clone(), line, value });
        }
        refuse_overlaps(&mut signals, &layouts, &presences);
        refuse_names(&mut signals);
        signals
    }

    fn layout(&self, id: can_dbc::MessageId, signal: &can_dbc::Signal, length: usize) -> Result<Layout, Problem> {
        let number = match (self.types.get(&(id, signal.name.as_str())), signal.value_type) {
            (Some(bits), _) if *bits != signal.size => {
                return Err(Problem::ValueTypeBits { got: signal.size, expected: *bits });
            }
            (Some(_), _) => Number::Float,
            (None, can_dbc::ValueType::Signed) => Number::Signed,
            (None, can_dbc::ValueType::Unsigned) => Number::Unsigned,
        };
        let order = match signal.byte_order {
            can_dbc::ByteOrder::LittleEndian => ByteOrder::Intel,
            can_dbc::ByteOrder::BigEndian => ByteOrder::Motorola,
        };
        Ok(Layout::new(signal.start_bit, signal.size, order, number, length)?)
    }

    fn signal(
        &self,
        message: &can_dbc::Message,
        signal: &can_dbc::Signal,
        name: &str,
        layout: Layout,
        presence: &Presence,
    ) -> Result<Signal, Problem> {
        let limits = [&signal.min, &signal.max].map(|limit| match limit {
            NumericValue::Uint(limit) => *limit as f64,
            NumericValue::Int(limit) => *limit as f64,
            NumericValue::Double(limit) => *limit,
        });
        Ok(Signal {
            name: name.to_string(),
            wire: WireSignal::new(layout, signal.factor, signal.offset)?,
            presence: presence.clone(),
            is_switch: super::multiplexing::is_switch(signal),
            limits: (limits != [0.0, 0.0]).then_some(limits),
            unit: signal.unit.clone(),
            values: self.values.get(&(message.id, signal.name.as_str())).cloned().unwrap_or_default(),
            receivers: signal.receivers.iter().map(|node| self.attributes.node_name(node)).collect(),
        })
    }
}

/// Signals that share bits, and may be in the same payload, are both wrong.
fn refuse_overlaps(
    signals: &mut [Named<Signal>],
    layouts: &[Result<Layout, Problem>],
    presences: &[Result<Presence, Problem>],
) {
    let bits: Vec<_> = layouts.iter().map(|layout| layout.as_ref().ok().map(Layout::occupied)).collect();
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
                    refuse(&mut signals[of], problem);
                }
            }
        }
    }
}

/// Messages or signals of the same name are all wrong.
fn refuse_names<T>(of: &mut [Named<T>]) {
    let mut lines: HashMap<String, (usize, usize)> = HashMap::new();
    for position in 0..of.len() {
        let name = of[position].name.clone();
        if let Some((first, line)) = lines.get(&name).copied() {
            let problem = Problem::NameTwice { line: of[position].line };
            refuse(&mut of[first], problem);
            refuse(&mut of[position], Problem::NameTwice { line });
        } else {
            lines.insert(name, (position, of[position].line));
        }
    }
}

/// Messages with the same identifier are all wrong: what the file says of the identifier can be of either.
fn refuse_twins(messages: &mut [Named<Message>], lines: &[MessageLine]) {
    let mut first: HashMap<u64, usize> = HashMap::new();
    let at = |messages: &[Named<Message>], line| messages.iter().position(|message| message.line == line);
    for MessageLine { id, line, .. } in lines {
        if let (Some(one), Some(other)) = (first.get(id).copied(), at(messages, *line)) {
            for (of, with) in [(one, other), (other, one)] {
                let problem = Problem::IdTwice { other: messages[with].name.clone(), line: messages[with].line };
                refuse(&mut messages[of], problem);
            }
        } else if let Some(position) = at(messages, *line) {
            first.insert(*id, position);
        }
    }
    refuse_names(messages);
}

/// Notes a problem, if there is none yet.
fn refuse<T>(named: &mut Named<T>, problem: Problem) {
    if named.value.is_ok() {
        named.value = Err(problem);
    }
}

impl Message {
    /// Whether frames of it are of CAN FD.
    pub const fn is_fd(&self) -> bool {
        matches!(self.format, FrameFormat::Fd { .. })
    }
}
