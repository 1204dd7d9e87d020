//! Signals of a mapping: their uses, counters and checksums, and the numbers for states and faults.

use std::collections::{BTreeMap, HashMap};

use super::CounterSpec;
use super::error::{Place, WireError};
use crate::dbc::Message;
use crate::nearest::nearest;
use resonarm_bench::node::mapped::mapping::Source;
use resonarm_protocol::EmergencyCode;
use resonarm_wire::checksum::Preset;
use resonarm_wire::counter::Counter;

pub(super) mod quantity;

/// Names of the states, in the order of their numbers.
pub const STATES: [&str; 4] = ["boot-up", "pre-operational", "operational", "fault"];
/// Faults of a mapped plant, by their names in a scenario.
pub const REASONS: [(&str, EmergencyCode); 7] = [
    ("command-timeout", EmergencyCode::CommandTimeout),
    ("stop", EmergencyCode::StopRequested),
    ("overrun", EmergencyCode::Overrun),
    ("bus-loss", EmergencyCode::BusLoss),
    ("sequence", EmergencyCode::SampleSequence),
    ("exciter-tripped", EmergencyCode::ExciterTripped),
    ("simulation-failed", EmergencyCode::SimulationFailed),
];

/// Use of each signal of a message, to find signals that are used twice.
#[derive(Default)]
pub(super) struct Used(HashMap<String, String>);

impl Used {
    /// Notes that the signal of `place` is used as `what`.
    pub fn take(&mut self, place: &Place, what: &str) -> Result<(), WireError> {
        let signal = place.signal.clone().unwrap_or_default();
        match self.0.insert(signal, what.to_string()) {
            None => Ok(()),
            Some(one) => Err(WireError::Twice { place: place.clone(), one, other: what.to_string() }),
        }
    }
}

/// Builds the alive counter of a message.
pub(super) fn counter(
    place: &Place,
    spec: &CounterSpec,
    message: &Message,
    preset: Option<Preset>,
    used: &mut Used,
) -> Result<Counter, WireError> {
    let place = place.of(&spec.signal);
    used.take(&place, "the counter")?;
    let layout = *message.signal(&spec.signal)?.wire().layout();
    // A counter of 64 bits would have 2^64 values, which does not fit u64; one less is close enough.
    let all = 1_u64.checked_shl(layout.bits().into()).unwrap_or(u64::MAX);
    // What the scenario states wins; a profile such as AUTOSAR 1 leaves out the value 15 of its 4 bits.
    let values = spec.values.or(preset.and_then(Preset::counter_values)).unwrap_or(all);
    Counter::new(layout, values).map_err(|error| WireError::protection(&place, error))
}

/// Returns a source with one number for each state.
pub(super) fn states(place: &Place, numbers: &BTreeMap<String, f64>) -> Result<Source, WireError> {
    check_names(place, "state", numbers, &STATES)?;
    Ok(Source::State(STATES.map(|name| numbers.get(name).copied().unwrap_or(0.0))))
}

/// Returns a source with one number for each fault.
pub(super) fn reasons(place: &Place, numbers: &BTreeMap<String, f64>) -> Result<Source, WireError> {
    let known: Vec<&str> = REASONS.iter().map(|(name, _)| *name).chain(["none", "other"]).collect();
    check_names(place, "fault", numbers, &known)?;
    let codes = REASONS.iter().filter_map(|(name, code)| Some((*code, *numbers.get(*name)?))).collect();
    let number = |name, default| numbers.get(name).copied().unwrap_or(default);
    Ok(Source::Reason { none: number("none", 0.0), other: number("other", 1.0), codes })
}

fn check_names(
    place: &Place,
    what: &'static str,
    numbers: &BTreeMap<String, f64>,
    known: &[&str],
) -> Result<(), WireError> {
    let Some(got) = numbers.keys().find(|name| !known.contains(&name.as_str())) else { return Ok(()) };
    let suggestion = nearest(got, known.iter().copied());
    Err(WireError::Name { place: place.clone(), what, got: got.clone(), suggestion, known: known.join(", ") })
}
