//! What is bolted to the arm: the exciter, the impedance head at C and the accelerometers at B and C.

mod exciter;
mod noise;
mod sensor;

pub use exciter::{ExciterSpec, RigError};
pub use sensor::{AccelerometerSpec, ForceSensorSpec, Reading};

use serde::{Deserialize, Serialize};

use crate::arm::{Load, PointMotion};
use sensor::Sensor;

/// The instruments of a rig, as a scenario states them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigSpec {
    /// What drives the arm.
    pub exciter: ExciterSpec,
    /// The accelerometer at the elbow, point B.
    pub accelerometer_b: AccelerometerSpec,
    /// The accelerometer at the tip, point C.
    pub accelerometer_c: AccelerometerSpec,
    /// The force side of the impedance head at C. Its acceleration side is the accelerometer at C.
    pub impedance_head: ForceSensorSpec,
}

/// What the instruments say at one sample, of the truth half a sample period before; x and y of the base frame.
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

/// The instruments at work: each axis with its own stream of noise, all from one seed.
#[derive(Clone, Debug)]
pub struct Rig {
    exciter: ExciterSpec,
    head: [Sensor; 2],
    accelerometer_b: [Sensor; 2],
    accelerometer_c: [Sensor; 2],
}

impl Rig {
    /// Checks the specification and seeds the noise.
    ///
    /// # Errors
    /// [`RigError`] names the first value that no instrument can have.
    pub fn new(spec: &RigSpec, seed: u64) -> Result<Rig, RigError> {
        spec.exciter.check()?;
        let (b, c, head) = (&spec.accelerometer_b, &spec.accelerometer_c, &spec.impedance_head);
        Ok(Rig {
            exciter: spec.exciter,
            head: [head.sensor("rig.impedance_head", seed, 0)?, head.sensor("rig.impedance_head", seed, 1)?],
            accelerometer_b: [b.sensor("rig.accelerometer_b", seed, 2)?, b.sensor("rig.accelerometer_b", seed, 3)?],
            accelerometer_c: [c.sensor("rig.accelerometer_c", seed, 4)?, c.sensor("rig.accelerometer_c", seed, 5)?],
        })
    }

    /// The exciter's specification.
    pub fn exciter(&self) -> &ExciterSpec {
        &self.exciter
    }

    /// What the instruments say of the true accelerations and the true load. Every call draws new noise, so it is made once
    /// a sample.
    pub fn measure(&mut self, sample: u64, motion: &PointMotion, load: &Load) -> Measurement {
        let read = |sensors: &mut [Sensor; 2], truth: [f64; 2]| [sensors[0].read(truth[0]), sensors[1].read(truth[1])];
        Measurement {
            sample,
            head_force_n: read(&mut self.head, load.force_n.into()),
            acceleration_b_m_s2: read(&mut self.accelerometer_b, motion.b_m_s2.into()),
            acceleration_c_m_s2: read(&mut self.accelerometer_c, motion.c_m_s2.into()),
        }
    }
}

#[cfg(test)]
mod tests;
