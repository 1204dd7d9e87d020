//! One axis of a sensor with its converter: noise, then rounding to counts, then range.

use serde::{Deserialize, Serialize};

use super::RigError;
use super::noise::Noise;

/// What one axis says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// The value, in the sensor's unit.
    pub value: f64,
    /// Whether the reading, noise included, was beyond the range, so that the value is the last count within it.
    pub clipped: bool,
}

/// A two-axis accelerometer with its converter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AccelerometerSpec {
    /// Largest magnitude it can tell, m/s², positive.
    pub range_m_s2: f64,
    /// Standard deviation of the noise of a sample, m/s², not negative.
    pub noise_rms_m_s2: f64,
    /// One count of the converter, m/s², not negative; 0 is an ideal converter.
    pub resolution_m_s2: f64,
}

impl Default for AccelerometerSpec {
    /// ±1600 m/s², 0.02 m/s² of noise, and 0.05 m/s² a count as on the wire.
    fn default() -> AccelerometerSpec {
        AccelerometerSpec { range_m_s2: 1600.0, noise_rms_m_s2: 0.02, resolution_m_s2: 0.05 }
    }
}

impl AccelerometerSpec {
    pub(super) fn sensor(&self, instrument: &'static str, seed: u64, stream: u64) -> Result<Sensor, RigError> {
        let names = ["range_m_s2", "noise_rms_m_s2", "resolution_m_s2"];
        let values = [self.range_m_s2, self.noise_rms_m_s2, self.resolution_m_s2];
        Sensor::new(instrument, names, values, Noise::new(seed, stream))
    }
}

/// A two-axis force sensor with its converter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ForceSensorSpec {
    /// Largest magnitude it can tell, N, positive.
    pub range_n: f64,
    /// Standard deviation of the noise of a sample, N, not negative.
    pub noise_rms_n: f64,
    /// One count of the converter, N, not negative; 0 is an ideal converter.
    pub resolution_n: f64,
}

impl Default for ForceSensorSpec {
    /// ±650 N, 0.01 N of noise, and 0.02 N a count as on the wire.
    fn default() -> ForceSensorSpec {
        ForceSensorSpec { range_n: 650.0, noise_rms_n: 0.01, resolution_n: 0.02 }
    }
}

impl ForceSensorSpec {
    pub(super) fn sensor(&self, instrument: &'static str, seed: u64, stream: u64) -> Result<Sensor, RigError> {
        let names = ["range_n", "noise_rms_n", "resolution_n"];
        let values = [self.range_n, self.noise_rms_n, self.resolution_n];
        Sensor::new(instrument, names, values, Noise::new(seed, stream))
    }
}

/// One axis at work, in whatever unit its specification has.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    /// Largest magnitude it says: the last count within the range.
    largest: f64,
    noise_rms: f64,
    resolution: f64,
    noise: Noise,
}

impl Sensor {
    fn new(
        instrument: &'static str,
        names: [&'static str; 3],
        values: [f64; 3],
        noise: Noise,
    ) -> Result<Sensor, RigError> {
        let [range, noise_rms, resolution] = values;
        if !(range.is_finite() && range > 0.0) {
            return Err(RigError::Spec { instrument, name: names[0], got: range, expected: "a positive number" });
        }
        for (name, got) in [(names[1], noise_rms), (names[2], resolution)] {
            if !(got.is_finite() && got >= 0.0) {
                return Err(RigError::Spec { instrument, name, got, expected: "zero or a positive number" });
            }
        }
        if resolution > range {
            let expected = "at most the range, or no count is within it";
            return Err(RigError::Spec { instrument, name: names[2], got: resolution, expected });
        }
        Ok(Sensor { largest: largest(range, resolution), noise_rms, resolution, noise })
    }

    /// What the axis says of `truth`, as a converter does: the next noise added, rounded to the nearest count, and if that is
    /// beyond the range the last count within it, marked.
    pub fn read(&mut self, truth: f64) -> Reading {
        let noisy = truth + self.noise_rms * self.noise.next();
        let counted = if self.resolution > 0.0 { libm::rint(noisy / self.resolution) * self.resolution } else { noisy };
        let clipped = counted.abs() > self.largest;
        Reading { value: counted.clamp(-self.largest, self.largest), clipped }
    }
}

/// The largest magnitude that a converter says: of whole counts the last within the range. A range that is a whole number of
/// counts but for the rounding of the two numbers counts as one.
fn largest(range: f64, resolution: f64) -> f64 {
    const ROUNDING: f64 = 1e-9;
    if resolution == 0.0 { range } else { libm::floor(range / resolution * (1.0 + ROUNDING)) * resolution }
}
