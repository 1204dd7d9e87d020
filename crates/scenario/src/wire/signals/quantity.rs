//! Quantities of the plant that signals carry.

use crate::Scenario;
use crate::dbc::Signal;
use crate::nearest::nearest;
use crate::wire::SourceSpec;
use crate::wire::conversion::signal_factor;
use crate::wire::error::{Place, WireError};
use resonarm_bench::node::mapped::mapping::{Source, Value};
use resonarm_bench::rig::InstrumentName;
use resonarm_bench::structure::{
    COIL_CURRENT, Channel, Coordinates, Kind, LOADS, LoadSet, OUTPUTS, Point, Quantity, coordinate_channels,
};
use resonarm_fmu_import::NamedChannels;

/// The quantities of a plant that signals can carry, each kind in the order in which the plant publishes it.
#[derive(Clone, Debug)]
pub struct Quantities {
    readings: Vec<Channel>,
    states: Vec<Channel>,
    loads: LoadSet,
}

impl Quantities {
    /// Returns the quantities of the scenario's plant. For a structure that a program makes, the states are assumed to
    /// be those of a two-link arm; a run rejects it if they are not.
    ///
    /// # Errors
    /// [`WireError::Structure`] if the scenario has no valid structure.
    pub fn of_scenario(scenario: &Scenario) -> Result<Quantities, WireError> {
        let impossible = |reason: String| WireError::Structure { reason };
        if scenario.is_fmu() {
            let channels = scenario.structure.fmu_channels(&scenario.rig);
            let NamedChannels { states, loads, sensors } = channels.map_err(|error| impossible(error.to_string()))?;
            return Ok(Quantities { readings: [&OUTPUTS[..], &sensors].concat(), states, loads });
        }
        if scenario.foreign_structure().is_some() {
            let states = coordinate_channels(Coordinates::Joints, 2);
            return Ok(Quantities { readings: OUTPUTS.to_vec(), states, loads: LoadSet::NATIVE });
        }
        let tested = scenario.under_test().map_err(|error| impossible(error.to_string()))?;
        let readings = [&OUTPUTS[..], &tested.places.more_channels()].concat();
        let states = tested.states(scenario.rig.shaker.is_some());
        Ok(Quantities { readings, states, loads: tested.load_set() })
    }

    /// Returns the readings: of the impedance head, of sensors B and C, and of the scenario's other sensors.
    pub fn readings(&self) -> &[Channel] {
        &self.readings
    }

    /// Returns the coordinates and their rates, which come first among the states.
    pub fn moving(&self) -> &[Channel] {
        let count = self.states.iter().take_while(|channel| channel.kind == Kind::State).count();
        &self.states[..count]
    }

    /// Returns the loads that the plant accepts.
    pub fn loads(&self) -> LoadSet {
        self.loads
    }

    /// Returns the channel of a value; for [`Value::Clipped`] that of the reading.
    pub fn channel(&self, value: Value) -> Option<Channel> {
        match value {
            Value::Clipped(place) | Value::Reading(place) => self.readings.get(place).copied(),
            Value::State(place) => self.states.get(place).copied(),
            Value::Load(place) => LOADS.get(place).filter(|_| self.loads.has(place)).copied(),
        }
    }

    fn all(&self) -> impl Iterator<Item = (Channel, Value)> {
        let of = |channels: &[Channel], value: fn(usize) -> Value| {
            channels
                .iter()
                .copied()
                .enumerate()
                .map(move |(place, channel)| (channel, value(place)))
                .collect::<Vec<_>>()
        };
        let loads = self.loads.places().map(|place| (LOADS[place], Value::Load(place)));
        of(&self.readings, Value::Reading).into_iter().chain(of(&self.states, Value::State)).chain(loads)
    }

    /// Returns the index of a reading.
    pub(in crate::wire) fn reading(&self, place: &Place, name: &str) -> Result<usize, WireError> {
        let index = self.readings.iter().position(|channel| channel.name == name);
        index.ok_or_else(|| unknown(place, name, self.readings.iter().copied()))
    }

    /// Builds the source of a signal that carries a quantity.
    pub(in crate::wire) fn source(
        &self,
        scenario: &Scenario,
        place: &Place,
        name: &str,
        spec: &SourceSpec,
        signal: &Signal,
    ) -> Result<Source, WireError> {
        let Some((channel, value)) = self.all().find(|(channel, _)| channel.name == name) else {
            if COIL_CURRENT.name == name {
                let problem = "is a state of the shaker, but the scenario has no [rig.shaker]";
                return Err(WireError::Input { place: place.clone(), input: COIL_CURRENT.name, problem });
            }
            return Err(unknown(place, name, self.all().map(|(channel, _)| channel)));
        };
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
}

fn unknown(place: &Place, name: &str, known: impl Iterator<Item = Channel>) -> WireError {
    let names: Vec<String> = known.map(|channel| channel.name.to_string()).collect();
    let suggestion = nearest(name, names.iter().map(String::as_str));
    let place = place.clone();
    let got = name.to_string();
    let known = names.join(", ");
    WireError::Name { place, what: "quantity", got, suggestion, known }
}

/// Returns the units of the signal for one unit of the quantity.
///
/// With a gear of ratio n, a motor turns n times as far and fast, and has 1/n of the torque.
fn scale(place: &Place, spec: &SourceSpec, channel: &Channel, signal: &Signal) -> Result<f64, WireError> {
    let checked = |name, value: Option<f64>| match value {
        Some(got) if !got.is_finite() || got == 0.0 => {
            let expected = "a number other than 0";
            Err(WireError::Number { place: place.clone(), name, got, expected })
        }
        value => Ok(value),
    };
    let scale = checked("scale", spec.scale)?;
    let gear = checked("gear_ratio", spec.gear_ratio)?.unwrap_or(1.0);
    let constant = checked("constant_per_a", spec.constant_per_a)?;
    let quantity = if constant.is_some() { Quantity::Current } else { channel.quantity };
    let of_motor = match channel.quantity {
        Quantity::Angle | Quantity::AngularVelocity => gear,
        _ => 1.0 / gear,
    };
    let units = match scale {
        Some(scale) => scale,
        None => 1.0 / signal_factor(place, quantity, signal)?,
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
    let from = offset - most.abs();
    let to = offset + most.abs();
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
