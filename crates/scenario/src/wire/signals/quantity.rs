//! Quantities of the plant that signals carry.

use crate::Scenario;
use crate::dbc::Signal;
use crate::nearest::nearest;
use crate::wire::SourceSpec;
use crate::wire::conversion::{factor, known};
use crate::wire::error::{Place, WireError};
use resonarm_bench::node::mapped::mapping::{Source, Value};
use resonarm_bench::rig::InstrumentName;
use resonarm_bench::structure::{Channel, Kind, LOADS, LoadSet, OUTPUTS, Point, Quantity, STATES};

/// Returns the readings that a signal can carry: those of every rig, then those of the scenario's other
/// sensors.
///
/// # Errors
/// [`WireError::Structure`] if the scenario makes no structure that they could read.
pub fn readings(scenario: &Scenario) -> Result<Vec<Channel>, WireError> {
    let mut channels = OUTPUTS.to_vec();
    if !scenario.rig.sensors.more.is_empty() && scenario.foreign_structure().is_none() {
        let tested = scenario.under_test().map_err(|error| WireError::Structure { reason: error.to_string() })?;
        channels.extend(tested.places.more_channels());
    }
    Ok(channels)
}

/// Returns the channels that a signal can carry, with their values: these readings, states and held loads.
fn channels(readings: &[Channel]) -> impl Iterator<Item = (Channel, Value)> {
    let readings = readings.iter().copied().enumerate().map(|(place, channel)| (channel, Value::Reading(place)));
    let loads = LoadSet::NATIVE.places().map(|place| (LOADS[place], Value::Load(place)));
    let states = STATES.into_iter().filter(|channel| channel.kind != Kind::Load).enumerate();
    readings.chain(states.map(|(place, channel)| (channel, Value::State(place)))).chain(loads)
}

/// Returns the channel of a value, given these [`readings`]; for [`Value::Clipped`] that of the reading.
pub fn channel(readings: &[Channel], value: Value) -> Option<Channel> {
    let of = match value {
        Value::Clipped(place) => Value::Reading(place),
        value => value,
    };
    channels(readings).find(|(_, other)| *other == of).map(|(channel, _)| channel)
}

fn unknown(place: &Place, name: &str, known: impl Iterator<Item = Channel>) -> WireError {
    let names: Vec<String> = known.map(|channel| channel.name.to_string()).collect();
    let suggestion = nearest(name, names.iter().map(String::as_str));
    WireError::Quantity { place: place.clone(), got: name.to_string(), suggestion, known: names.join(", ") }
}

/// Returns the index of a reading among these [`readings`].
pub(in crate::wire) fn reading(readings: &[Channel], place: &Place, name: &str) -> Result<usize, WireError> {
    let index = readings.iter().position(|channel| channel.name == name);
    index.ok_or_else(|| unknown(place, name, readings.iter().copied()))
}

/// Builds the source of a signal that carries a quantity: one of these [`readings`], a state or a held load.
pub(in crate::wire) fn source(
    scenario: &Scenario,
    readings: &[Channel],
    place: &Place,
    name: &str,
    spec: &SourceSpec,
    signal: &Signal,
) -> Result<Source, WireError> {
    let found = channels(readings).find(|(channel, _)| channel.name == name);
    let (channel, value) = found.ok_or_else(|| unknown(place, name, channels(readings).map(|(channel, _)| channel)))?;
    if channel.kind == Kind::Internal && scenario.rig.shaker.is_none() {
        let problem = "is a state of the shaker, and the scenario has no [rig.shaker]";
        return Err(WireError::Input { place: place.clone(), input: channel.name, problem });
    }
    let scale = scale(place, spec, &channel, signal)?;
    let offset = spec.offset.unwrap_or(0.0);
    if !offset.is_finite() {
        let expected = "a finite number";
        return Err(WireError::Number { place: place.clone(), name: "offset", got: offset, expected });
    }
    if let Some((most, limit)) = largest(scenario, &channel) {
        check_range(place, signal, &channel, (scale * most, offset), limit)?;
    }
    Ok(Source::Value { value, scale, offset })
}

/// Returns the units of the signal for one unit of the quantity.
///
/// Behind a gear of ratio n a motor turns n times as far and fast, and has 1/n of the torque.
fn scale(place: &Place, spec: &SourceSpec, channel: &Channel, signal: &Signal) -> Result<f64, WireError> {
    let checked = |name, value: Option<f64>| match value {
        Some(got) if !got.is_finite() || got == 0.0 => {
            let expected = "a number other than 0";
            Err(WireError::Number { place: place.clone(), name, got, expected })
        }
        value => Ok(value),
    };
    let (scale, gear) = (checked("scale", spec.scale)?, checked("gear_ratio", spec.gear_ratio)?.unwrap_or(1.0));
    let constant = checked("constant_per_a", spec.constant_per_a)?;
    let quantity = if constant.is_some() { Quantity::Current } else { channel.quantity };
    let of_motor = match channel.quantity {
        Quantity::Angle | Quantity::AngularVelocity => gear,
        _ => 1.0 / gear,
    };
    let units = match scale {
        Some(scale) => scale,
        None => match factor(quantity, signal.unit()) {
            Some(factor) => 1.0 / factor,
            None => {
                let (got, expected) = (signal.unit().to_string(), quantity.unit());
                return Err(WireError::Unit { place: place.clone(), got, expected, known: known(quantity) });
            }
        },
    };
    Ok(units * of_motor / constant.unwrap_or(1.0))
}

/// Returns the largest magnitude of a quantity that has a limit, with the key that limits it.
fn largest(scenario: &Scenario, channel: &Channel) -> Option<(f64, String)> {
    let rig = &scenario.rig;
    let (force_n, torque_nm) = rig.drive().limits();
    let range = |name: InstrumentName| {
        let (_, sensor) = rig.instruments().find(|(of, _)| *of == name)?;
        Some((sensor.range, format!("{}.{}", name.section(), sensor.range_key())))
    };
    match (channel.vector.as_str(), channel.point) {
        ("acceleration_b_m_s2", _) => range(InstrumentName::B),
        ("acceleration_c_m_s2", _) => range(InstrumentName::C),
        ("head_force_n", _) => range(InstrumentName::HEAD),
        (_, Point::Sensor { name, .. }) => range(name),
        ("force_n", _) => Some((force_n, String::from("rig.exciter.force_limit_n"))),
        ("torque_nm", _) => Some((torque_nm, String::from("rig.exciter.torque_limit_nm"))),
        _ => None,
    }
}

fn check_range(
    place: &Place,
    signal: &Signal,
    channel: &Channel,
    (most, offset): (f64, f64),
    limit: String,
) -> Result<(), WireError> {
    let [least, largest] = signal.wire().range();
    let (from, to) = (offset - most.abs(), offset + most.abs());
    // One count of slack: a range that ends at a round number in the DBC often misses the limit by the last
    // count, and the signal saturates there.
    let count = signal.wire().resolution().unwrap_or(0.0);
    if from >= least - count && to <= largest + count {
        return Ok(());
    }
    Err(WireError::Range {
        place: place.clone(),
        least,
        most: largest,
        unit: signal.unit().to_string(),
        what: channel.name.to_string(),
        from,
        to,
        limit,
    })
}
