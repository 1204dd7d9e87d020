//! Which switch selects a signal, from the marks `M`, `m0`, `m0M` of the signals and the lines `SG_MUL_VAL_`.

use std::collections::HashMap;
use std::ops::RangeInclusive;

use can_dbc::{Dbc, MessageId, MultiplexIndicator};
use resonarm_wire::layout::Layout;
use resonarm_wire::multiplex::{Condition, Presence};

use super::Problem;

/// What the lines of a file say of one message besides its own.
#[derive(Default)]
pub(super) struct Switches<'a> {
    /// By the selected signal: its switch, and the values.
    extended: HashMap<&'a str, (&'a str, Vec<RangeInclusive<u64>>)>,
    /// Nodes that send it, too.
    pub(super) senders: &'a [String],
}

impl<'a> Switches<'a> {
    /// Those of all messages that have some.
    pub(super) fn by_message(dbc: &'a Dbc) -> HashMap<MessageId, Switches<'a>> {
        let mut found: HashMap<MessageId, Switches<'a>> = HashMap::new();
        for of in &dbc.extended_multiplex {
            let extended = &mut found.entry(of.message_id).or_default().extended;
            let values = of.mappings.iter().map(|mapping| mapping.min_value..=mapping.max_value);
            let entry = extended.entry(&of.signal_name).or_insert((&of.multiplexor_signal_name, Vec::new()));
            entry.1.extend(values);
        }
        for of in &dbc.message_transmitters {
            found.entry(of.message_id).or_default().senders = &of.transmitter;
        }
        found
    }
}

/// Whether a signal is marked as one that selects others.
pub(super) fn is_switch(signal: &can_dbc::Signal) -> bool {
    matches!(
        signal.multiplexer_indicator,
        MultiplexIndicator::Multiplexor | MultiplexIndicator::MultiplexorAndMultiplexedSignal(_)
    )
}

/// In which payloads each signal of a message is present, or why that can't be said.
pub(super) fn presences(
    message: &can_dbc::Message,
    layouts: &[Result<Layout, Problem>],
    switches: Option<&Switches<'_>>,
) -> Vec<Result<Presence, Problem>> {
    let selected: Vec<_> = message.signals.iter().map(|signal| selected_by(message, signal, switches)).collect();
    let chain = |start: usize| {
        let (mut at, mut conditions) = (start, Vec::new());
        while let Some((switch, values)) = selected[at].clone()? {
            if conditions.len() == selected.len() {
                return Err(Problem::SwitchCircle);
            }
            let name = || message.signals[switch].name.clone();
            let layout = layouts[switch]
                .clone()
                .map_err(|problem| Problem::Switch { switch: name(), problem: Box::new(problem) })?;
            conditions.push(Condition::new(layout, values)?);
            at = switch;
        }
        conditions.reverse();
        Ok(Presence::new(conditions))
    };
    (0..selected.len()).map(chain).collect()
}

/// The position of a switch, and its values that select.
type Selection = (usize, Vec<RangeInclusive<u64>>);

/// What selects a signal; None if it is in every payload.
fn selected_by(
    message: &can_dbc::Message,
    signal: &can_dbc::Signal,
    switches: Option<&Switches<'_>>,
) -> Result<Option<Selection>, Problem> {
    let mark = match signal.multiplexer_indicator {
        MultiplexIndicator::MultiplexedSignal(value) | MultiplexIndicator::MultiplexorAndMultiplexedSignal(value) => {
            Some(value)
        }
        MultiplexIndicator::Multiplexor | MultiplexIndicator::Plain => None,
    };
    if let Some((switch, values)) = switches.and_then(|of| of.extended.get(signal.name.as_str())) {
        let position = message.signals.iter().position(|other| other.name == *switch);
        let position = position.ok_or_else(|| Problem::UnknownSwitch { switch: switch.to_string() })?;
        if !is_switch(&message.signals[position]) {
            return Err(Problem::UnmarkedSwitch { switch: switch.to_string() });
        }
        // Tools disagree on a mark outside of the list: it selects for some, for others it doesn't.
        return match mark.filter(|mark| !values.iter().any(|range| range.contains(mark))) {
            Some(mark) => Err(Problem::UnlistedMark { mark }),
            None => Ok(Some((position, values.clone()))),
        };
    }
    let Some(value) = mark else {
        return Ok(None);
    };
    let is_outermost = |other: &can_dbc::Signal| other.multiplexer_indicator == MultiplexIndicator::Multiplexor;
    let mut all = (0..).zip(&message.signals).filter(|(_, other)| is_outermost(other)).map(|(position, _)| position);
    match (all.next(), all.next()) {
        (None, _) => Err(Problem::NoSwitch),
        (Some(position), None) => Ok(Some((position, vec![value..=value]))),
        (Some(_), Some(_)) => Err(Problem::SeveralSwitches),
    }
}
