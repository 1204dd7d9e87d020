//! Finds the switch that selects a signal, from the lines `SG_MUL_VAL_`, or without one for the signal from the marks
//! `M`, `m0` and `m0M` of the signals.

use std::collections::HashMap;
use std::ops::RangeInclusive;

use resonarm_wire::layout::Layout;
use resonarm_wire::multiplex::{Condition, Presence};

use super::error::Problem;
use super::syntax::{MessageStatement, SignalStatement, Statements};

/// `SG_MUL_VAL_` statements of one message: the selected signal, with its switch and the values of the switch
/// that select it.
pub(super) type Switches<'a> = HashMap<&'a str, (&'a str, Vec<RangeInclusive<u64>>)>;

/// Collects the `SG_MUL_VAL_` statements of all messages by identifier, as written.
pub(super) fn switches(statements: &Statements) -> HashMap<u64, Switches<'_>> {
    let mut found: HashMap<u64, Switches<'_>> = HashMap::new();
    for of in &statements.switches {
        let (switch, values) = &of.value;
        let of_message = found.entry(of.message).or_default();
        let entry = of_message.entry(&of.signal).or_insert((switch, Vec::new()));
        // A signal may have several such lines, for which all their values select it.
        entry.1.extend(values.iter().cloned());
    }
    found
}

/// Returns whether a signal selects others, because it is marked so or an `SG_MUL_VAL_` says so.
pub(super) fn is_switch(signal: &SignalStatement, switches: Option<&Switches<'_>>) -> bool {
    signal.is_switch || switches.is_some_and(|of| of.values().any(|(switch, _)| *switch == signal.name))
}

/// Returns the payloads in which each signal of a message is present, or the problem that makes this unknown.
pub(super) fn presences(
    message: &MessageStatement,
    layouts: &[Result<Layout, Problem>],
    switches: Option<&Switches<'_>>,
) -> Vec<Result<Presence, Problem>> {
    let selected: Vec<_> = message.signals.iter().map(|signal| selected_by(message, signal, switches)).collect();
    // A switch may itself be selected by a switch. The loop climbs to the outermost one and collects a
    // condition for every step. With n signals, more than n steps mean that the switches select each other in a
    // circle.
    let chain = |start: usize| {
        let mut at = start;
        let mut conditions = Vec::new();
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
        // Outermost switch first, as a payload is read: an inner switch means nothing before the outer one
        // selects it.
        conditions.reverse();
        Ok(Presence::new(conditions))
    };
    (0..selected.len()).map(chain).collect()
}

/// Position of a switch in its message, and its values that select a signal.
type Selection = (usize, Vec<RangeInclusive<u64>>);

/// Returns the switch and values that select a signal; `None` if it is in every payload.
fn selected_by(
    message: &MessageStatement,
    signal: &SignalStatement,
    switches: Option<&Switches<'_>>,
) -> Result<Option<Selection>, Problem> {
    if let Some((switch, values)) = switches.and_then(|of| of.get(signal.name.as_str())) {
        let position = message.signals.iter().position(|other| other.name == *switch);
        let position = position.ok_or_else(|| Problem::UnknownSwitch { switch: switch.to_string() })?;
        return Ok(Some((position, values.clone())));
    }
    let Some(value) = signal.selected_by else {
        return Ok(None);
    };
    // Without `SG_MUL_VAL_` the mark `m0` names a value but no switch. It is the one switch that is always
    // present, if there is exactly one.
    let is_outermost = |other: &SignalStatement| other.is_switch && other.selected_by.is_none();
    let mut all = (0..).zip(&message.signals).filter(|(_, other)| is_outermost(other)).map(|(position, _)| position);
    match (all.next(), all.next()) {
        (None, _) => Err(Problem::NoSwitch),
        (Some(position), None) => Ok(Some((position, vec![value..=value]))),
        (Some(_), Some(_)) => Err(Problem::SeveralSwitches),
    }
}
