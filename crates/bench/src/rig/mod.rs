//! The rig on the arm: the exciter, the impedance head at C and the accelerometers at B and C.

mod chain;
pub(crate) mod converter;
mod exciter;
mod fault;
mod filter;
mod gate;
mod place;
mod sensor;
mod shaker;

pub use chain::Reading;
pub use converter::{Converter, Sampling};
pub use exciter::{Exciter, ExciterSpec, RigError};
pub use fault::{FaultAxis, FaultKind, FaultSpec, InstrumentName, MOST_FAULTS};
pub use gate::GateSpec;
pub use place::PlaceName;
pub use sensor::{AccelerometerSpec, ForceSensorSpec};
pub use shaker::{Amplifier, ShakerLimit, ShakerSpec};

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use chain::Instrument;
use fault::Fault;

/// The instruments of a rig in a scenario.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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
    /// The accelerometer at the elbow, point B.
    pub accelerometer_b: AccelerometerSpec,
    /// The accelerometer at the tip, point C.
    pub accelerometer_c: AccelerometerSpec,
    /// The force side of the impedance head at C. Its acceleration side is the accelerometer at C.
    pub impedance_head: ForceSensorSpec,
    /// Faults of the instruments at stated times, at most [`MOST_FAULTS`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<FaultSpec>,
}

impl RigSpec {
    /// The exciter of the arm.
    pub fn drive(&self) -> Exciter {
        self.shaker.map_or(Exciter::Ideal(self.exciter), Exciter::Shaker)
    }

    /// The same rig with sensors without noise; faults keep theirs.
    #[must_use]
    pub fn without_noise(mut self) -> RigSpec {
        for accelerometer in [&mut self.accelerometer_b, &mut self.accelerometer_c] {
            (accelerometer.noise_rms_m_s2, accelerometer.noise_density_m_s2_per_sqrt_hz) = (Some(0.0), None);
        }
        let head = &mut self.impedance_head;
        (head.noise_rms_n, head.noise_density_n_per_sqrt_hz) = (Some(0.0), None);
        self
    }

    /// The faults of an instrument, each with its own noise.
    fn faults_of(&self, name: InstrumentName, rate_hz: f64, seed: u64) -> Result<Vec<Fault>, RigError> {
        let own = self.faults.iter().enumerate().filter(|(_, fault)| fault.instrument == name);
        own.map(|(index, fault)| Fault::new(fault, index, rate_hz, seed)).collect()
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
        let faults = |name| spec.faults_of(name, rate_hz, seed);
        let (head, b, c) = (&spec.impedance_head, &spec.accelerometer_b, &spec.accelerometer_c);
        let head = head.instrument("rig.impedance_head", rate_hz, seed, 0)?;
        let b = b.instrument("rig.accelerometer_b", rate_hz, seed, 2)?;
        let c = c.instrument("rig.accelerometer_c", rate_hz, seed, 4)?;
        Ok(Rig {
            exciter,
            gate: spec.gate,
            head: head.with_faults(faults(InstrumentName::ImpedanceHead)?),
            accelerometer_b: b.with_faults(faults(InstrumentName::AccelerometerB)?),
            accelerometer_c: c.with_faults(faults(InstrumentName::AccelerometerC)?),
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
