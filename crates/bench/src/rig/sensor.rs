//! Specifications of instruments in a scenario.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::chain::{ChainSpec, Instrument, Keys};
use super::{PlaceName, RigError};

/// A two-axis accelerometer with conditioner and converter, its axes along x and y of the base frame.
///
/// The signal passes through, in this order: gravity, transverse sensitivity, gain, the sensor's noise, the sensor's
/// range, high-pass, low-pass, delay, and the converter with counts and range. The filters see the samples: they have
/// gain and phase of their analog counterparts at frequencies far below the sample rate, and can't remove components
/// folded before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self", default, deny_unknown_fields)]
pub struct AccelerometerSpec {
    /// Where it is on a structure; on the two-link arm its name is its place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<PlaceName>,
    /// Largest magnitude of the converter, m/s², positive.
    pub range_m_s2: f64,
    /// Standard deviation of the sensor's noise of a sample, m/s², not negative. `None`, as with a density: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_rms_m_s2: Option<f64>,
    /// Density of the sensor's noise, in place of its standard deviation: (m/s²)/√Hz, not negative, white up to half
    /// the sample rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_density_m_s2_per_sqrt_hz: Option<f64>,
    /// One count of the converter, m/s², not negative; 0 is an ideal converter. `None`, as with `bits`: ideal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolution_m_s2: Option<f64>,
    /// Bits of the converter over the range from −range to range, 2 to 48, in place of the resolution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bits: Option<u32>,
    /// The reading of gravity, along y, if it measures static accelerations: g, m/s², not negative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity_m_s2: Option<f64>,
    /// Share of the other axis that an axis reads, above −1 and below 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transverse: Option<f64>,
    /// Sensitivity against the stated one, −10 to 10 and not 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Largest magnitude that comes from the sensor to the filters, m/s², positive. Readings beyond are not marked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_range_m_s2: Option<f64>,
    /// Corner of the conditioner's high-pass of first order, Hz, below half the sample rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub highpass_hz: Option<f64>,
    /// Corner of the low-pass, a Butterworth of second order, Hz, below half the sample rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lowpass_hz: Option<f64>,
    /// Delay of the conversion, samples, at most 1000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_samples: Option<u32>,
}

impl Default for AccelerometerSpec {
    /// ±1600 m/s², 0.02 m/s² of noise, and 0.05 m/s² a count as on the wire.
    fn default() -> AccelerometerSpec {
        AccelerometerSpec {
            at: None,
            range_m_s2: 1600.0,
            noise_rms_m_s2: Some(0.02),
            noise_density_m_s2_per_sqrt_hz: None,
            resolution_m_s2: Some(0.05),
            bits: None,
            gravity_m_s2: None,
            transverse: None,
            gain: None,
            sensor_range_m_s2: None,
            highpass_hz: None,
            lowpass_hz: None,
            delay_samples: None,
        }
    }
}

impl AccelerometerSpec {
    pub(super) fn instrument(
        &self,
        instrument: &'static str,
        rate_hz: f64,
        seed: u64,
        stream: u64,
    ) -> Result<Instrument, RigError> {
        Instrument::new(&self.chain(instrument), rate_hz, seed, stream)
    }

    /// Standard deviation of a reading at `rate_hz` samples a second, m/s²: the sensor's noise, and the rounding to
    /// counts.
    pub fn reading_noise_m_s2(&self, rate_hz: f64) -> f64 {
        self.chain("").reading_noise(rate_hz)
    }

    fn chain(&self, instrument: &'static str) -> ChainSpec {
        const KEYS: Keys = Keys {
            range: "range_m_s2",
            noise_rms: "noise_rms_m_s2",
            noise_density: "noise_density_m_s2_per_sqrt_hz",
            resolution: "resolution_m_s2",
            sensor_range: "sensor_range_m_s2",
        };
        ChainSpec {
            instrument,
            keys: &KEYS,
            range: self.range_m_s2,
            noise_rms: self.noise_rms_m_s2,
            noise_density: self.noise_density_m_s2_per_sqrt_hz,
            resolution: self.resolution_m_s2,
            bits: self.bits,
            gravity: self.gravity_m_s2,
            transverse: self.transverse,
            gain: self.gain,
            sensor_range: self.sensor_range_m_s2,
            highpass_hz: self.highpass_hz,
            lowpass_hz: self.lowpass_hz,
            delay_samples: self.delay_samples,
        }
    }
}

/// A two-axis force sensor with conditioner and converter; its chain is that of an [`AccelerometerSpec`], without
/// gravity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self", default, deny_unknown_fields)]
pub struct ForceSensorSpec {
    /// Largest magnitude of the converter, N, positive.
    pub range_n: f64,
    /// Standard deviation of the sensor's noise of a sample, N, not negative. `None`, as with a density: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_rms_n: Option<f64>,
    /// Density of the sensor's noise, in place of its standard deviation: N/√Hz, not negative, white up to half the
    /// sample rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_density_n_per_sqrt_hz: Option<f64>,
    /// One count of the converter, N, not negative; 0 is an ideal converter. `None`, as with `bits`: ideal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolution_n: Option<f64>,
    /// Bits of the converter over the range from −range to range, 2 to 48, in place of the resolution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bits: Option<u32>,
    /// Share of the other axis that an axis reads, above −1 and below 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transverse: Option<f64>,
    /// Sensitivity against the stated one, −10 to 10 and not 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Largest magnitude that comes from the sensor to the filters, N, positive. Readings beyond are not marked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_range_n: Option<f64>,
    /// Corner of the conditioner's high-pass of first order, Hz, below half the sample rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub highpass_hz: Option<f64>,
    /// Corner of the low-pass, a Butterworth of second order, Hz, below half the sample rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lowpass_hz: Option<f64>,
    /// Delay of the conversion, samples, at most 1000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_samples: Option<u32>,
}

impl Default for ForceSensorSpec {
    /// ±650 N, 0.01 N of noise, and 0.02 N a count as on the wire.
    fn default() -> ForceSensorSpec {
        ForceSensorSpec {
            range_n: 650.0,
            noise_rms_n: Some(0.01),
            noise_density_n_per_sqrt_hz: None,
            resolution_n: Some(0.02),
            bits: None,
            transverse: None,
            gain: None,
            sensor_range_n: None,
            highpass_hz: None,
            lowpass_hz: None,
            delay_samples: None,
        }
    }
}

impl ForceSensorSpec {
    pub(super) fn instrument(
        &self,
        instrument: &'static str,
        rate_hz: f64,
        seed: u64,
        stream: u64,
    ) -> Result<Instrument, RigError> {
        Instrument::new(&self.chain(instrument), rate_hz, seed, stream)
    }

    /// Standard deviation of a reading at `rate_hz` samples a second, N: the sensor's noise, and the rounding to
    /// counts.
    pub fn reading_noise_n(&self, rate_hz: f64) -> f64 {
        self.chain("").reading_noise(rate_hz)
    }

    fn chain(&self, instrument: &'static str) -> ChainSpec {
        const KEYS: Keys = Keys {
            range: "range_n",
            noise_rms: "noise_rms_n",
            noise_density: "noise_density_n_per_sqrt_hz",
            resolution: "resolution_n",
            sensor_range: "sensor_range_n",
        };
        ChainSpec {
            instrument,
            keys: &KEYS,
            range: self.range_n,
            noise_rms: self.noise_rms_n,
            noise_density: self.noise_density_n_per_sqrt_hz,
            resolution: self.resolution_n,
            bits: self.bits,
            gravity: None,
            transverse: self.transverse,
            gain: self.gain,
            sensor_range: self.sensor_range_n,
            highpass_hz: self.highpass_hz,
            lowpass_hz: self.lowpass_hz,
            delay_samples: self.delay_samples,
        }
    }
}

/// A key of noise or counts that is absent in both forms takes its default.
impl<'de> Deserialize<'de> for AccelerometerSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<AccelerometerSpec, D::Error> {
        let (mut spec, default) = (AccelerometerSpec::deserialize(deserializer)?, AccelerometerSpec::default());
        if spec.noise_density_m_s2_per_sqrt_hz.is_none() {
            spec.noise_rms_m_s2 = spec.noise_rms_m_s2.or(default.noise_rms_m_s2);
        }
        if spec.bits.is_none() {
            spec.resolution_m_s2 = spec.resolution_m_s2.or(default.resolution_m_s2);
        }
        Ok(spec)
    }
}

impl Serialize for AccelerometerSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        AccelerometerSpec::serialize(self, serializer)
    }
}

/// A key of noise or counts that is absent in both forms takes its default.
impl<'de> Deserialize<'de> for ForceSensorSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<ForceSensorSpec, D::Error> {
        let (mut spec, default) = (ForceSensorSpec::deserialize(deserializer)?, ForceSensorSpec::default());
        if spec.noise_density_n_per_sqrt_hz.is_none() {
            spec.noise_rms_n = spec.noise_rms_n.or(default.noise_rms_n);
        }
        if spec.bits.is_none() {
            spec.resolution_n = spec.resolution_n.or(default.resolution_n);
        }
        Ok(spec)
    }
}

impl Serialize for ForceSensorSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        ForceSensorSpec::serialize(self, serializer)
    }
}
