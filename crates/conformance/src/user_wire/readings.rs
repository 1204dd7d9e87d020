//! Periods and delays of the readings in which a plant reports its state and its load.
//!
//! A plant says what it is in readings that come from time to time: whatever a case waits for is awaited for as long as
//! that takes at the most.

use super::monitor::Heard;
use super::protocol::UserWire;
use super::tester::Tester;
use crate::times::{MARGIN_NS, MS};
use resonarm_bench::node::mapped::mapping::{LoadInput, Outgoing, Source, Value};
use resonarm_bench::rig::MOST_JOINTS;
use resonarm_bench::structure::{LOAD_NAMES, OUTPUTS};

/// Period at which a CANopen drive reports its statusword after power-on, ns.
const STATUSWORD_NS: u64 = 10 * MS;

/// Returns the period of a reading that reports this, ns: the shortest period of those that come by themselves, and
/// often.
pub(super) fn said_every_ns(on: &UserWire, says: impl Fn(&Source) -> bool) -> Option<u64> {
    let has = |message: &&Outgoing| message.signals.iter().any(|signal| says(&signal.source));
    on.frequent_readings().filter(has).filter_map(|message| on.sent_every_ns(message)).min()
}

/// Whether a signal distinguishes fault from operational.
fn is_of_fault(source: &Source) -> bool {
    match source {
        Source::State([_, _, armed, fault]) => (armed - fault).abs() > 0.0,
        Source::Reason { .. } => true,
        Source::Value { .. } | Source::Sample { .. } => false,
    }
}

/// Whether a reading that comes by itself, and often, distinguishes fault from operational.
pub(super) fn says_state(t: &Tester) -> bool {
    t.on.mapping().is_none() || said_every_ns(t.on, is_of_fault).is_some()
}

/// Returns the time within which a plant has reported its state, ns from the cause: it may see the cause two samples
/// later, a reading that comes this often follows, and a machine may hold it up.
fn within_ns(on: &UserWire, said_every_ns: Option<u64>) -> u64 {
    said_every_ns.unwrap_or(STATUSWORD_NS) + 4 * on.period_ns() + MARGIN_NS
}

/// Returns the time within which a plant has reported a fault, ns from its cause on; without a reading that does, that
/// within which it has reported a load.
pub(super) fn fault_within_ns(t: &Tester) -> u64 {
    within_ns(t.on, said_every_ns(t.on, is_of_fault).or_else(|| load_every_ns(t)))
}

/// Returns the time within which a plant has reported the state that it is in, ns from when it entered it.
pub(super) fn state_within_ns(t: &Tester) -> u64 {
    within_ns(t.on, said_every_ns(t.on, |source| matches!(source, Source::State(_))))
}

/// Returns the time within which a plant has reported a load, ns from when the tester has accepted it: the emulated
/// exciter commands it in answer to a reading, and a later reading says it.
pub(super) fn load_within_ns(t: &Tester) -> u64 {
    100 * MS + 20 * t.on.period_ns() + 2 * load_every_ns(t).unwrap_or(0)
}

/// Returns the period of a reading that reports the load of the cases, ns.
fn load_every_ns(t: &Tester) -> Option<u64> {
    let values = load_values(t);
    said_every_ns(t.on, |source| matches!(source, Source::Value { value, .. } if values.iter().any(|v| v.1 == *value)))
}

/// The quantities that can say the load of the cases, with their names: that which is held, and that which the head
/// measures.
fn load_values(t: &Tester) -> Vec<(&'static str, Value)> {
    let (held, head): (usize, Option<&'static str>) = match t.on.input() {
        LoadInput::Torque(joint) => (joint, None),
        LoadInput::ForceX => (MOST_JOINTS, Some("head_force_x_n")),
        LoadInput::ForceY => (MOST_JOINTS + 1, Some("head_force_y_n")),
        LoadInput::ForceZ => (MOST_JOINTS + 2, None),
        LoadInput::Along(_) => return Vec::new(),
    };
    let held = LOAD_NAMES.get(held).map(|name| (*name, Value::Load(held)));
    let of_head = |name| OUTPUTS.iter().position(|channel| channel.name == name);
    let head = head.and_then(|name| Some((name, Value::Reading(of_head(name)?))));
    held.into_iter().chain(head).collect()
}

/// The names of the quantities that say the load of the cases, where readings that come by themselves have them.
pub(super) fn load_readings(t: &Tester) -> Vec<&'static str> {
    let is_said = |wanted: Value| {
        let is_it = |source: &Source| matches!(source, Source::Value { value, .. } if *value == wanted);
        t.on.mapping().is_none() || said_every_ns(t.on, is_it).is_some()
    };
    load_values(t).into_iter().filter(|(_, value)| is_said(*value)).map(|(name, _)| name).collect()
}

/// The loads that it says from frame `from` on, N or N·m.
pub(super) fn loads<'t>(heard: &'t [Heard], names: &'t [&'static str]) -> impl Iterator<Item = (&'t Heard, f64)> {
    heard.iter().filter_map(|heard| names.iter().find_map(|name| heard.quantity(name)).map(|value| (heard, value)))
}
