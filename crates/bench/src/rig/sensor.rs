//! Specifications of instruments in a scenario.

use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use serde::de::{self, DeserializeSeed, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::error::RigError;
use super::name::{InstrumentName, Section};
use super::place::PlaceName;

/// Longest delay of a conversion, samples.
const MOST_DELAY_SAMPLES: u32 = 1000;
/// Largest number of bits of a converter, within the precision of f64.
const MOST_BITS: u32 = 48;

/// Quantity that an instrument measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// Force of the impedance head, N.
    Force,
    /// Acceleration of a point, m/s².
    Acceleration,
    /// Velocity of a point, m/s.
    Velocity,
    /// Displacement of a point from rest, m.
    Displacement,
    /// Angle of a joint from rest, rad.
    Angle,
}

/// Words of the key `measures`.
const WORDS: [(&str, Measured); 4] = [
    ("acceleration", Measured::Acceleration),
    ("velocity", Measured::Velocity),
    ("displacement", Measured::Displacement),
    ("angle", Measured::Angle),
];

impl Measured {
    /// Returns what a sensor measures at a place unless it states otherwise: at a joint, `joint2`, its angle,
    /// and elsewhere the acceleration.
    fn at(at: &PlaceName) -> Measured {
        let number = at.as_str().strip_prefix("joint");
        let is_joint = number.is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_digit()));
        if is_joint { Measured::Angle } else { Measured::Acceleration }
    }

    /// Returns whether an instrument that measures this has the key.
    fn has_key(self, key: &str) -> bool {
        self.keys().all.contains(&key)
    }
}

impl Serialize for Measured {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let word = WORDS.into_iter().find(|(_, of)| of == self);
        serializer.serialize_str(word.map_or("force", |(word, _)| word))
    }
}

impl<'de> Deserialize<'de> for Measured {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Measured, D::Error> {
        const NAMES: &[&str] = &["acceleration", "velocity", "displacement", "angle"];
        let got = String::deserialize(deserializer)?;
        let found = WORDS.into_iter().find(|(word, _)| *word == got);
        found.map(|(_, of)| of).ok_or_else(|| de::Error::unknown_variant(&got, NAMES))
    }
}

/// Keys of an instrument that end in a unit.
#[derive(Debug)]
struct Keys {
    range: &'static str,
    noise_rms: &'static str,
    noise_density: &'static str,
    resolution: &'static str,
    sensor_range: &'static str,
    /// All keys of the instrument, also those without a unit.
    all: &'static [&'static str],
}

/// Builds the keys of an instrument for a unit; `$own` are the keys that only it has.
macro_rules! keys {
    ($unit:literal, $($own:literal),*) => {
        Keys {
            range: concat!("range_", $unit),
            noise_rms: concat!("noise_rms_", $unit),
            noise_density: concat!("noise_density_", $unit, "_per_sqrt_hz"),
            resolution: concat!("resolution_", $unit),
            sensor_range: concat!("sensor_range_", $unit),
            all: &[
                concat!("range_", $unit),
                concat!("noise_rms_", $unit),
                concat!("noise_density_", $unit, "_per_sqrt_hz"),
                concat!("resolution_", $unit),
                "bits",
                "transverse",
                "gain",
                concat!("sensor_range_", $unit),
                "highpass_hz",
                "lowpass_hz",
                "delay_samples",
                $($own),*
            ],
        }
    };
}

static FORCE: Keys = keys!("n",);
static ACCELERATION: Keys = keys!("m_s2", "at", "measures", "gravity_m_s2");
static VELOCITY: Keys = keys!("m_s", "at", "measures");
static DISPLACEMENT: Keys = keys!("m", "at", "measures");
static ANGLE: Keys = keys!("rad", "at", "measures");

impl Measured {
    fn keys(self) -> &'static Keys {
        match self {
            Measured::Force => &FORCE,
            Measured::Acceleration => &ACCELERATION,
            Measured::Velocity => &VELOCITY,
            Measured::Displacement => &DISPLACEMENT,
            Measured::Angle => &ANGLE,
        }
    }
}

/// An instrument with conditioner and converter; its axes are those of the base frame.
///
/// The signal passes, in this order, gravity, transverse sensitivity, gain, the sensor's noise, the sensor's
/// range, high-pass, low-pass, delay, and the converter with counts and range. The filters work on the samples:
/// they have gain and phase of their analog counterparts at frequencies far below the sample rate, and can't
/// remove components that were aliased before.
///
/// Numbers are in the unit of what it measures, and their keys in a scenario end with it: `range_m_s2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorSpec {
    /// Quantity that it measures.
    pub measures: Measured,
    /// Place on the structure; `None` where the rig defines it.
    pub at: Option<PlaceName>,
    /// Largest magnitude that the converter reads, positive.
    pub range: f64,
    /// Standard deviation of the sensor's noise in a sample, not negative. `None`, also with a density, means
    /// no noise of this kind.
    pub noise_rms: Option<f64>,
    /// Density of the sensor's noise, in place of its standard deviation: the unit over √Hz, not negative,
    /// white up to half the sample rate.
    pub noise_density: Option<f64>,
    /// One count of the converter, not negative; 0 is an ideal converter. `None`, also with `bits`, is ideal.
    pub resolution: Option<f64>,
    /// Bits of the converter over the range from −range to range, 2 to 48, in place of the resolution.
    pub bits: Option<u32>,
    /// Gravity g that the sensor reads along y, m/s², not negative, for an accelerometer that measures static
    /// acceleration.
    pub gravity_m_s2: Option<f64>,
    /// Share of the other axis that an axis reads, above −1 and below 1.
    pub transverse: Option<f64>,
    /// Actual sensitivity over the stated one, −10 to 10 and not 0.
    pub gain: Option<f64>,
    /// Largest magnitude that the sensor passes to the filters, positive. Readings beyond it are not marked as
    /// clipped.
    pub sensor_range: Option<f64>,
    /// Corner of the conditioner's first-order high-pass, Hz, below half the sample rate.
    pub highpass_hz: Option<f64>,
    /// Corner of the conditioner's low-pass, a second-order Butterworth filter, Hz, below half the sample rate.
    pub lowpass_hz: Option<f64>,
    /// Delay of the conversion, samples, at most 1000.
    pub delay_samples: Option<u32>,
}

impl SensorSpec {
    /// Returns an instrument with default range, noise and counts: for accelerations ±1600 m/s², 0.02 m/s² and
    /// 0.05 m/s² per count; for forces ±650 N, 0.01 N and 0.02 N per count, the counts of the protocol; for
    /// velocities ±10 m/s, 0.1 mm/s and 0.1 mm/s per count; for displacements ±0.1 m, 1 µm and 1 µm per count;
    /// for angles ±3.2 rad, 1 µrad and 1 µrad per count.
    pub fn of(measures: Measured) -> SensorSpec {
        let (range, noise_rms, resolution) = match measures {
            Measured::Force => (650.0, 0.01, 0.02),
            Measured::Acceleration => (1600.0, 0.02, 0.05),
            Measured::Velocity => (10.0, 1e-4, 1e-4),
            Measured::Displacement => (0.1, 1e-6, 1e-6),
            Measured::Angle => (3.2, 1e-6, 1e-6),
        };
        SensorSpec {
            measures,
            at: None,
            range,
            noise_rms: Some(noise_rms),
            noise_density: None,
            resolution: Some(resolution),
            bits: None,
            gravity_m_s2: None,
            transverse: None,
            gain: None,
            sensor_range: None,
            highpass_hz: None,
            lowpass_hz: None,
            delay_samples: None,
        }
    }

    /// Returns the same instrument without the sensor's noise.
    #[must_use]
    pub fn without_noise(self) -> SensorSpec {
        SensorSpec { noise_rms: Some(0.0), noise_density: None, ..self }
    }

    /// Returns the largest magnitude that it reads: the converter's range, or the sensor's if that is smaller.
    pub fn largest_reading(&self) -> f64 {
        self.sensor_range.map_or(self.range, |sensor| sensor.min(self.range))
    }

    /// Returns the standard deviation of the sensor's noise: white noise of density d up to half the sample
    /// rate has d √(rate/2).
    pub(super) fn sensor_noise(&self, rate_hz: f64) -> f64 {
        match (self.noise_rms, self.noise_density) {
            (_, Some(density)) => density * libm::sqrt(0.5 * rate_hz),
            (rms, None) => rms.unwrap_or(0.0),
        }
    }

    /// Returns one count. With n bits 2ⁿ − 1 counts are used, as many below 0 as above, so that one is
    /// range/(2ⁿ⁻¹ − 1).
    pub(super) fn count(&self) -> f64 {
        match (self.resolution, self.bits) {
            (_, Some(bits)) => self.range / (libm::exp2(f64::from(bits) - 1.0) - 1.0),
            (resolution, None) => resolution.unwrap_or(0.0),
        }
    }

    /// Returns the standard deviation of a reading at `rate_hz` samples per second: the sensor's noise, and
    /// rounding to counts q, which adds q/√12.
    pub fn reading_noise(&self, rate_hz: f64) -> f64 {
        let noise = self.sensor_noise(rate_hz);
        let count = self.count();
        libm::sqrt(noise * noise + count * count / 12.0)
    }

    /// Returns the key of the range in a scenario.
    pub fn range_key(&self) -> &'static str {
        self.measures.keys().range
    }

    /// Rejects specifications that no instrument can have; `section` names the instrument.
    pub(super) fn check(&self, section: Section, rate_hz: f64) -> Result<(), RigError> {
        let keys = self.measures.keys();
        let within = |name, value: Option<f64>, expected, fits: &dyn Fn(f64) -> bool| match value {
            Some(got) if !fits(got) => Err(RigError::Spec { section, name, got, expected }),
            _ => Ok(()),
        };
        let not_both = |names, both| if both { Err(RigError::Both { section, names }) } else { Ok(()) };
        let positive = |name, value| within(name, value, "a positive number", &|got: f64| got.is_finite() && got > 0.0);
        let not_negative =
            |name, value| within(name, value, "zero or a positive number", &|got: f64| got.is_finite() && got >= 0.0);
        let whole = |number: Option<u32>| number.map(f64::from);
        positive(keys.range, Some(self.range))?;
        not_both([keys.noise_rms, keys.noise_density], self.noise_rms.is_some() && self.noise_density.is_some())?;
        not_both([keys.resolution, "bits"], self.resolution.is_some() && self.bits.is_some())?;
        not_negative(keys.noise_rms, self.noise_rms)?;
        not_negative(keys.noise_density, self.noise_density)?;
        not_negative(keys.resolution, self.resolution)?;
        let expected = "at most the range, or no count is within it";
        within(keys.resolution, self.resolution, expected, &|got| got <= self.range)?;
        within("bits", whole(self.bits), "from 2 to 48", &|got| (2.0..=f64::from(MOST_BITS)).contains(&got))?;
        not_negative("gravity_m_s2", self.gravity_m_s2)?;
        within("transverse", self.transverse, "above -1 and below 1", &|got| got.abs() < 1.0)?;
        positive(keys.sensor_range, self.sensor_range)?;
        let expected = "a number from -10 to 10, and not 0";
        within("gain", self.gain, expected, &|got| got != 0.0 && got.abs() <= 10.0)?;
        for (name, corner_hz) in [("highpass_hz", self.highpass_hz), ("lowpass_hz", self.lowpass_hz)] {
            let expected = "above 0 and below half the sample rate";
            within(name, corner_hz, expected, &|got| got > 0.0 && got < 0.5 * rate_hz)?;
        }
        // A high-pass above the low-pass would leave no band between them.
        let low = self.lowpass_hz.unwrap_or(f64::INFINITY);
        within("highpass_hz", self.highpass_hz, "below `lowpass_hz`, or nothing passes", &|got| got < low)?;
        let most = f64::from(MOST_DELAY_SAMPLES);
        within("delay_samples", whole(self.delay_samples), "at most 1000", &|got| got <= most)
    }

    /// Reads the head, as `[rig.head]` states it.
    pub(super) fn head<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SensorSpec, D::Error> {
        deserializer.deserialize_map(SpecVisitor(Some(Measured::Force)))
    }
}

impl Serialize for SensorSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let keys = self.measures.keys();
        let mut map = serializer.serialize_map(None)?;
        if let Some(at) = &self.at {
            map.serialize_entry("at", at)?;
        }
        // The quantity is written only where it differs from the default of the place, so that scenarios stay
        // short.
        if self.at.is_some_and(|at| self.measures != Measured::at(&at)) {
            map.serialize_entry("measures", &self.measures)?;
        }
        let number = |map: &mut S::SerializeMap, key: &str, value: Option<f64>| match value {
            Some(value) => map.serialize_entry(key, &value),
            None => Ok(()),
        };
        number(&mut map, keys.range, Some(self.range))?;
        number(&mut map, keys.noise_rms, self.noise_rms)?;
        number(&mut map, keys.noise_density, self.noise_density)?;
        number(&mut map, keys.resolution, self.resolution)?;
        if let Some(bits) = self.bits {
            map.serialize_entry("bits", &bits)?;
        }
        number(&mut map, "gravity_m_s2", self.gravity_m_s2)?;
        number(&mut map, "transverse", self.transverse)?;
        number(&mut map, "gain", self.gain)?;
        number(&mut map, keys.sensor_range, self.sensor_range)?;
        number(&mut map, "highpass_hz", self.highpass_hz)?;
        number(&mut map, "lowpass_hz", self.lowpass_hz)?;
        if let Some(samples) = self.delay_samples {
            map.serialize_entry("delay_samples", &samples)?;
        }
        map.end()
    }
}

/// Reads a key of an instrument that measures this, or, for a sensor that may measure anything, a key of any
/// instrument.
struct KeySeed(Option<Measured>);

impl<'de> DeserializeSeed<'de> for KeySeed {
    type Value = String;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<String, D::Error> {
        let name = String::deserialize(deserializer)?;
        let expected = self.0.unwrap_or(Measured::Acceleration).keys().all;
        let is_known = match self.0 {
            Some(measures) => measures.has_key(&name),
            None => WORDS.iter().any(|(_, measures)| measures.has_key(&name)),
        };
        if is_known { Ok(name) } else { Err(de::Error::unknown_field(&name, expected)) }
    }
}

/// Reads the specification of an instrument that measures this, or, for a sensor other than B and C, what its
/// key `measures` or its place says.
struct SpecVisitor(Option<Measured>);

impl<'de> Visitor<'de> for SpecVisitor {
    type Value = SensorSpec;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the keys of an instrument")
    }

    /// Reads the keys. Noise or counts that are absent in both forms take their default.
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<SensorSpec, A::Error> {
        let mut at = None;
        let mut measures = None;
        let mut bits = None;
        let mut delay_samples = None;
        let mut numbers: Vec<(String, f64)> = Vec::new();
        // The quantity is known only after all keys, in whatever order they come, so numbers are collected
        // first.
        while let Some(key) = map.next_key_seed(KeySeed(self.0))? {
            match key.as_str() {
                "at" => at = Some(map.next_value::<PlaceName>()?),
                "measures" => measures = Some(map.next_value::<Measured>()?),
                "bits" => bits = Some(map.next_value()?),
                "delay_samples" => delay_samples = Some(map.next_value()?),
                _ => numbers.push((key, map.next_value()?)),
            }
        }
        let measured = match (self.0, measures, &at) {
            (Some(only), Some(got), _) if got != only => {
                let message = "`measures` can only be \"acceleration\" here: b and c are the accelerometers that the \
                    protocol carries; give another sensor a name of its own";
                return Err(de::Error::custom(message));
            }
            (Some(only), ..) => only,
            (None, _, None) => return Err(de::Error::missing_field("at")),
            (None, measures, Some(at)) => measures.unwrap_or(Measured::at(at)),
        };
        let keys = measured.keys();
        let default = SensorSpec::of(measured);
        let mut spec = SensorSpec { at, bits, delay_samples, noise_rms: None, resolution: None, ..default };
        for (key, value) in numbers {
            let key = key.as_str();
            match key {
                "gravity_m_s2" if measured == Measured::Acceleration => spec.gravity_m_s2 = Some(value),
                "transverse" => spec.transverse = Some(value),
                "gain" => spec.gain = Some(value),
                "highpass_hz" => spec.highpass_hz = Some(value),
                "lowpass_hz" => spec.lowpass_hz = Some(value),
                _ if key == keys.range => spec.range = value,
                _ if key == keys.noise_rms => spec.noise_rms = Some(value),
                _ if key == keys.noise_density => spec.noise_density = Some(value),
                _ if key == keys.resolution => spec.resolution = Some(value),
                _ if key == keys.sensor_range => spec.sensor_range = Some(value),
                // The key belongs to a sensor that measures something else.
                _ => return Err(de::Error::unknown_field(key, keys.all)),
            }
        }
        // A density replaces the default standard deviation, and `bits` the default resolution.
        if spec.noise_density.is_none() {
            spec.noise_rms = spec.noise_rms.or(default.noise_rms);
        }
        if spec.bits.is_none() {
            spec.resolution = spec.resolution.or(default.resolution);
        }
        Ok(spec)
    }
}

/// A sensor other than B and C.
struct NamedSensor(SensorSpec);

impl<'de> Deserialize<'de> for NamedSensor {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<NamedSensor, D::Error> {
        Ok(NamedSensor(deserializer.deserialize_map(SpecVisitor(None))?))
    }
}

/// Accelerometer B or C, which can measure nothing else.
struct Accelerometer(SensorSpec);

impl<'de> Deserialize<'de> for Accelerometer {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Accelerometer, D::Error> {
        Ok(Accelerometer(deserializer.deserialize_map(SpecVisitor(Some(Measured::Acceleration)))?))
    }
}

/// Sensors of a rig, by their names.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorSpecs {
    /// Accelerometer B, on the arm at the elbow.
    pub b: SensorSpec,
    /// Accelerometer C, on the arm at the tip.
    pub c: SensorSpec,
    /// Other sensors, by name. The protocol does not carry them; recordings, user protocols and programs do.
    pub more: BTreeMap<InstrumentName, SensorSpec>,
}

impl Default for SensorSpecs {
    /// Accelerometers B and C, and no other sensor.
    fn default() -> SensorSpecs {
        let accelerometer = SensorSpec::of(Measured::Acceleration);
        SensorSpecs { b: accelerometer, c: accelerometer, more: BTreeMap::new() }
    }
}

impl Serialize for SensorSpecs {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("b", &self.b)?;
        map.serialize_entry("c", &self.c)?;
        self.more.iter().try_for_each(|(name, sensor)| map.serialize_entry(name, sensor))?;
        map.end()
    }
}

impl<'de> Deserialize<'de> for SensorSpecs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<SensorSpecs, D::Error> {
        deserializer.deserialize_map(SensorsVisitor)
    }
}

/// Visitor that reads the section `[rig.sensors]`.
struct SensorsVisitor;

impl<'de> Visitor<'de> for SensorsVisitor {
    type Value = SensorSpecs;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("sensors, each with a name")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<SensorSpecs, A::Error> {
        let mut sensors = SensorSpecs::default();
        while let Some(name) = map.next_key::<InstrumentName>()? {
            match name {
                InstrumentName::B => sensors.b = map.next_value::<Accelerometer>()?.0,
                InstrumentName::C => sensors.c = map.next_value::<Accelerometer>()?.0,
                InstrumentName::HEAD => {
                    let message = "the impedance head has the section [rig.head]: give the sensor another name";
                    return Err(de::Error::custom(message));
                }
                name => {
                    sensors.more.insert(name, map.next_value::<NamedSensor>()?.0);
                }
            }
        }
        Ok(sensors)
    }
}
