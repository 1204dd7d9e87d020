//! The rig on a structure: the exciter, the impedance head and the sensors.

mod chain;
pub(crate) mod converter;
mod exciter;
mod fault;
mod filter;
mod gate;
mod name;
mod place;
mod sensor;
mod shaker;

pub use chain::Reading;
pub use converter::{Converter, Sampling};
pub use exciter::{Exciter, ExciterSpec, RigError};
pub use fault::{FaultAxis, FaultKind, FaultSpec, MOST_FAULTS};
pub use gate::GateSpec;
pub use name::{InstrumentName, Section};
pub use place::PlaceName;
pub use sensor::{Measured, SensorSpec, SensorSpecs};
pub use shaker::{Amplifier, ShakerLimit, ShakerSpec};

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use chain::Instrument;
use fault::Fault;

/// The instruments of a rig in a scenario.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigSpec {
    /// The ideal exciter, unless a shaker drives the arm.
    pub exciter: ExciterSpec,
    /// The shaker, if one drives the arm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shaker: Option<ShakerSpec>,
    /// The limits of commands beyond the exciter's.
    #[serde(skip_serializing_if = "GateSpec::is_open")]
    pub gate: GateSpec,
    /// The sampling of the converters of all instruments.
    pub converter: Converter,
    /// The force side of the impedance head, between exciter and structure.
    #[serde(deserialize_with = "SensorSpec::head")]
    pub head: SensorSpec,
    /// The sensors. `b` and `c` are the accelerometers that the protocol carries; the acceleration side of the head is c.
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
    /// The exciter of the arm.
    pub fn drive(&self) -> Exciter {
        self.shaker.map_or(Exciter::Ideal(self.exciter), Exciter::Shaker)
    }

    /// The same rig with sensors without noise; faults keep theirs.
    #[must_use]
    pub fn without_noise(mut self) -> RigSpec {
        for sensor in [&mut self.head, &mut self.sensors.b, &mut self.sensors.c] {
            *sensor = sensor.without_noise();
        }
        self
    }

    /// The instruments that every rig has.
    fn instruments(&self) -> [(InstrumentName, &SensorSpec); 3] {
        let SensorSpecs { b, c } = &self.sensors;
        [(InstrumentName::HEAD, &self.head), (InstrumentName::B, b), (InstrumentName::C, c)]
    }

    /// The faults of an instrument, each with its own noise.
    fn faults_of(&self, name: InstrumentName, rate_hz: f64, seed: u64) -> Result<Vec<Fault>, RigError> {
        let measures =
            |name| self.instruments().into_iter().find(|(known, _)| *known == name).map(|(_, spec)| spec.measures);
        let own = self.faults.iter().enumerate().filter(|(_, fault)| fault.instrument == name);
        own.filter_map(|(index, fault)| Some(Fault::new(fault, measures(name)?, index, rate_hz, seed))).collect()
    }
}

/// The readings of one sample, of the motion in the middle of a hold before it ([`Converter::delay_samples`]); along x
/// and y of the base frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Index of the sample.
    pub sample: u64,
    /// Force in the impedance head, N.
    pub head_force_n: [Reading; 2],
    /// Acceleration of B, m/s².
    pub acceleration_b_m_s2: [Reading; 2],
    /// Acceleration of C, m/s².
    pub acceleration_c_m_s2: [Reading; 2],
}

impl Measurement {
    /// The number of readings in it.
    pub const CHANNELS: usize = 6;

    /// All readings: head x, y; B x, y; C x, y.
    pub fn readings(&self) -> [Reading; Measurement::CHANNELS] {
        let ([hx, hy], [bx, by], [cx, cy]) = (self.head_force_n, self.acceleration_b_m_s2, self.acceleration_c_m_s2);
        [hx, hy, bx, by, cx, cy]
    }
}

/// The instruments: each axis with its own stream of noise, all from one seed.
#[derive(Clone, Debug)]
pub struct Rig {
    exciter: Exciter,
    gate: GateSpec,
    head: Instrument,
    accelerometer_b: Instrument,
    accelerometer_c: Instrument,
}

impl Rig {
    /// Checks the specification and seeds the noise. `rate_hz` is the sample rate, Hz, positive.
    ///
    /// # Errors
    /// [`RigError`] names the first invalid value.
    pub fn new(spec: &RigSpec, rate_hz: f64, seed: u64) -> Result<Rig, RigError> {
        let exciter = spec.drive();
        spec.exciter.check()?;
        exciter.check()?;
        spec.gate.check(&exciter)?;
        if spec.faults.len() > MOST_FAULTS {
            return Err(RigError::TooManyFaults { got: spec.faults.len() });
        }
        if let Some((index, fault)) = spec
            .faults
            .iter()
            .enumerate()
            .find(|(_, fault)| spec.instruments().iter().all(|(name, _)| *name != fault.instrument))
        {
            return Err(RigError::FaultInstrument { number: index + 1, got: fault.instrument });
        }
        let instrument = |name: InstrumentName, sensor: &SensorSpec, stream| {
            sensor.check(name.section(), rate_hz)?;
            Ok(Instrument::new(sensor, rate_hz, seed, stream).with_faults(spec.faults_of(name, rate_hz, seed)?))
        };
        Ok(Rig {
            exciter,
            gate: spec.gate,
            head: instrument(InstrumentName::HEAD, &spec.head, 0)?,
            accelerometer_b: instrument(InstrumentName::B, &spec.sensors.b, 2)?,
            accelerometer_c: instrument(InstrumentName::C, &spec.sensors.c, 4)?,
        })
    }

    /// What filters, delays and faults of the instruments have gathered at a sample, before its reading.
    pub fn gathered(&mut self) -> Vec<f64> {
        let instruments = [&mut self.head, &mut self.accelerometer_b, &mut self.accelerometer_c];
        instruments.into_iter().flat_map(Instrument::gathered).collect()
    }

    /// Continues at sample `sample` with what [`Rig::gathered`] gave there; returns `false` if it was of another rig,
    /// and the rig is then not to be used.
    #[must_use]
    pub fn restore(&mut self, sample: u64, gathered: &[f64]) -> bool {
        let mut numbers = gathered.iter().copied();
        let instruments = [&mut self.head, &mut self.accelerometer_b, &mut self.accelerometer_c];
        instruments.into_iter().all(|instrument| instrument.restore(sample, &mut numbers)) && numbers.next().is_none()
    }

    /// The exciter of the arm.
    pub fn exciter(&self) -> &Exciter {
        &self.exciter
    }

    /// The limits of commands beyond the exciter's.
    pub fn gate(&self) -> &GateSpec {
        &self.gate
    }

    /// The readings at sample `sample` of the converters' samples: the force in the head along x and y, N, and the
    /// accelerations of B and C along x and y, m/s². Every call draws new noise and advances the filters, so call it
    /// once a sample.
    pub fn measure(&mut self, sample: u64, sampled: &[f64; Measurement::CHANNELS]) -> Measurement {
        let [hx, hy, bx, by, cx, cy] = *sampled;
        Measurement {
            sample,
            head_force_n: self.head.read(sample, [hx, hy]),
            acceleration_b_m_s2: self.accelerometer_b.read(sample, [bx, by]),
            acceleration_c_m_s2: self.accelerometer_c.read(sample, [cx, cy]),
        }
    }
}

#[cfg(test)]
mod tests;
