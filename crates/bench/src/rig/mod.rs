//! The rig on a structure: exciter, impedance head and sensors.

mod chain;
mod conditioner;
pub(crate) mod converter;
mod error;
mod exciter;
mod fault;
mod filter;
mod gate;
pub(crate) mod load;
pub(crate) mod measurement;
pub(crate) mod name;
mod place;
mod reading;
pub(crate) mod readings;
pub(crate) mod sensor;
pub(crate) mod shaker;

pub(crate) use conditioner::Conditioner;
pub use converter::{Converter, Sampling};
pub use error::RigError;
pub use exciter::{Exciter, ExciterSpec};
pub use fault::{FaultAxis, FaultKind, FaultSpec, MOST_FAULTS};
pub use gate::GateSpec;
pub use load::{Load, MOST_JOINTS};
pub use measurement::Measurement;
pub use name::{InstrumentName, Section};
pub use place::PlaceName;
pub use reading::Reading;
pub use readings::{MOST_CHANNELS, MOST_MORE, Readings};
pub use sensor::{Measured, SensorSpec, SensorSpecs};
pub use shaker::{Amplifier, ShakerLimit, ShakerSpec};

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use chain::Instrument;
use fault::Fault;
use reading::MOST_AXES;

use crate::structure::channel::{Axis, Channel, Point};

/// A rig as a scenario states it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigSpec {
    /// Ideal exciter, which acts unless a shaker drives the arm.
    pub exciter: ExciterSpec,
    /// Shaker, if one drives the arm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shaker: Option<ShakerSpec>,
    /// Limits of commands beyond those of the exciter.
    #[serde(skip_serializing_if = "GateSpec::is_open")]
    pub gate: GateSpec,
    /// Sampling of the converters of all instruments.
    pub converter: Converter,
    /// Force side of the impedance head, between exciter and structure.
    #[serde(deserialize_with = "SensorSpec::head")]
    pub head: SensorSpec,
    /// Sensors. `b` and `c` are the accelerometers that the protocol carries; the acceleration side of the head
    /// is c.
    pub sensors: SensorSpecs,
    /// Faults of the instruments at stated times, at most [`MOST_FAULTS`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<FaultSpec>,
}

impl Default for RigSpec {
    fn default() -> RigSpec {
        RigSpec {
            exciter: ExciterSpec::default(),
            shaker: None,
            gate: GateSpec::default(),
            converter: Converter::default(),
            head: SensorSpec::of(Measured::Force),
            sensors: SensorSpecs::default(),
            faults: Vec::new(),
        }
    }
}

impl RigSpec {
    /// Returns the exciter that drives the structure.
    pub fn drive(&self) -> Exciter {
        self.shaker.map_or(Exciter::Ideal(self.exciter), Exciter::Shaker)
    }

    /// Returns the same rig with sensors without noise; faults keep theirs.
    #[must_use]
    pub fn without_noise(mut self) -> RigSpec {
        let SensorSpecs { b, c, more } = &mut self.sensors;
        for sensor in [&mut self.head, b, c].into_iter().chain(more.values_mut()) {
            *sensor = sensor.without_noise();
        }
        self
    }

    /// Returns whether the accelerometer C is where the exciter acts.
    pub fn c_is_driven(&self) -> bool {
        self.sensors.c.at.is_none() || self.sensors.c.at == self.exciter.at
    }

    /// Returns the head and all sensors, by name.
    pub fn instruments(&self) -> impl Iterator<Item = (InstrumentName, &SensorSpec)> {
        let SensorSpecs { b, c, more } = &self.sensors;
        let first = [(InstrumentName::HEAD, &self.head), (InstrumentName::B, b), (InstrumentName::C, c)];
        first.into_iter().chain(more.iter().map(|(name, sensor)| (*name, sensor)))
    }

    /// Builds an instrument with these axes and with its faults, after a check.
    fn instrument(
        &self,
        name: InstrumentName,
        sensor: &SensorSpec,
        along: &[Axis],
        (rate_hz, seed): (f64, u64),
    ) -> Result<Instrument, RigError> {
        sensor.check(name.section(), rate_hz)?;
        let own = self.faults.iter().enumerate().filter(|(_, fault)| fault.instrument == name);
        let faults = own.map(|(index, fault)| Fault::new(fault, (sensor.measures, along), index, (rate_hz, seed)));
        let faults = faults.collect::<Result<Vec<_>, _>>()?;
        Ok(Instrument::new(sensor, along, rate_hz, seed, name.stream()).with_faults(faults))
    }
}

/// The instruments. Each axis has its own stream of noise, all from one seed.
#[derive(Clone, Debug)]
pub struct Rig {
    exciter: Exciter,
    gate: GateSpec,
    head: Instrument,
    accelerometer_b: Instrument,
    accelerometer_c: Instrument,
    /// Other sensors, in the order of their channels.
    more: Vec<Instrument>,
}

/// Axes of the instruments that every rig has.
const PLANE: [Axis; 2] = [Axis::X, Axis::Y];

impl Rig {
    /// Checks the specification and seeds the noise. `rate_hz` is the sample rate, Hz, positive; `outputs` are
    /// what the converters sample: head, B and C first, then the channels of the other sensors
    /// ([`sensor_channels`](crate::structure::sensor_channels)).
    ///
    /// # Errors
    /// [`RigError`] names the first invalid value, and a sensor that `outputs` do not have.
    pub fn new(spec: &RigSpec, outputs: &[Channel], rate_hz: f64, seed: u64) -> Result<Rig, RigError> {
        let exciter = spec.drive();
        spec.exciter.check()?;
        exciter.check()?;
        spec.gate.check(&exciter)?;
        if spec.faults.len() > MOST_FAULTS {
            return Err(RigError::TooManyFaults { got: spec.faults.len(), most: MOST_FAULTS });
        }
        let is_known = |fault: &FaultSpec| spec.instruments().any(|(name, _)| name == fault.instrument);
        // A misspelt instrument must not silently lose its fault.
        if let Some(index) = spec.faults.iter().position(|fault| !is_known(fault)) {
            return Err(RigError::FaultInstrument { number: index + 1, got: spec.faults[index].instrument });
        }
        let plane = |name, sensor| spec.instrument(name, sensor, &PLANE, (rate_hz, seed));
        let more = spec.sensors.more.iter().map(|(name, sensor)| {
            let is_of = |channel: &&Channel| matches!(channel.point, Point::Sensor { name: of, .. } if of == *name);
            let along: Vec<Axis> = outputs.iter().filter(is_of).map(|channel| channel.axis).collect();
            if along.is_empty() {
                return Err(RigError::NotSensed { section: name.section() });
            }
            if let Some(got) = sensor.gravity_m_s2
                && !along.contains(&Axis::Y)
            {
                let expected = "left out: gravity is along y, and the sensor has no axis y";
                return Err(RigError::Spec { section: name.section(), name: "gravity_m_s2", got, expected });
            }
            spec.instrument(*name, sensor, &along, (rate_hz, seed))
        });
        Ok(Rig {
            exciter,
            gate: spec.gate,
            head: plane(InstrumentName::HEAD, &spec.head)?,
            accelerometer_b: plane(InstrumentName::B, &spec.sensors.b)?,
            accelerometer_c: plane(InstrumentName::C, &spec.sensors.c)?,
            more: more.collect::<Result<_, _>>()?,
        })
    }

    /// Returns the head, B, C and the other sensors, in this order.
    fn instruments(&mut self) -> impl Iterator<Item = &mut Instrument> {
        [&mut self.head, &mut self.accelerometer_b, &mut self.accelerometer_c].into_iter().chain(&mut self.more)
    }

    /// Returns the state of the instruments' filters, delays and faults at a sample, before its reading.
    pub fn gathered(&mut self) -> Vec<f64> {
        self.instruments().flat_map(Instrument::gathered).collect()
    }

    /// Continues at sample `sample` with the state from [`Rig::gathered`]. Returns `false` if it belongs to
    /// another rig; this rig must then not be used.
    #[must_use]
    pub fn restore(&mut self, sample: u64, gathered: &[f64]) -> bool {
        let mut numbers = gathered.iter().copied();
        self.instruments().all(|instrument| instrument.restore(sample, &mut numbers)) && numbers.next().is_none()
    }

    /// Returns the exciter of the structure.
    pub fn exciter(&self) -> &Exciter {
        &self.exciter
    }

    /// Returns the limits of commands beyond those of the exciter.
    pub fn gate(&self) -> &GateSpec {
        &self.gate
    }

    /// Returns the readings at sample `sample` of the converters' samples, in the order of the outputs: the
    /// force in the head along x and y, N, the accelerations of B and C along x and y, m/s², and what the other
    /// sensors measure. Every call draws new noise and advances the filters, so call it once per sample.
    pub fn measure(&mut self, sample: u64, sampled: &[f64]) -> Measurement {
        let mut more = Readings::NONE;
        let mut places = sampled.chunks(2);
        let mut plane = |instrument: &mut Instrument| {
            let [x, y, _] = instrument.read(sample, truth(places.next().unwrap_or_default()));
            [x, y]
        };
        let head_force_n = plane(&mut self.head);
        let acceleration_b_m_s2 = plane(&mut self.accelerometer_b);
        let acceleration_c_m_s2 = plane(&mut self.accelerometer_c);
        let mut rest = sampled.get(Measurement::CHANNELS..).unwrap_or_default();
        for instrument in &mut self.more {
            // The channels of a sensor stand next to each other, in the order of the instruments.
            let (own, after) = rest.split_at(instrument.axes().min(rest.len()));
            instrument.read(sample, truth(own)).into_iter().take(own.len()).for_each(|reading| more.push(reading));
            rest = after;
        }
        Measurement { sample, head_force_n, acceleration_b_m_s2, acceleration_c_m_s2, more }
    }
}

/// Returns the numbers as those of an instrument's axes, with zeros for missing ones.
fn truth(numbers: &[f64]) -> [f64; MOST_AXES] {
    core::array::from_fn(|place| numbers.get(place).copied().unwrap_or(0.0))
}

#[cfg(test)]
mod tests;
