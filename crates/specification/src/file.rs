//! Layout of a specification as a TOML file.

use alloc::string::String;
use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use crate::error::{Place, SpecificationError};
use crate::profile::Corner;
use crate::tolerance::ToleranceBand;

/// A specification as it stands in a TOML file, unchecked; [`Specification::new`](crate::Specification::new) checks it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecificationFile {
    pub(crate) spec: Header,
    pub(crate) random: Option<RandomSection>,
    pub(crate) sine: Option<SineSection>,
    pub(crate) shock: Option<ShockSection>,
    pub(crate) srs: Option<SrsSection>,
    pub(crate) schedule: Option<ScheduleSection>,
    pub(crate) dwell: Option<DwellSection>,
    #[serde(default)]
    pub(crate) control: Control,
    #[serde(default)]
    pub(crate) limits: LimitsSection,
}

impl SpecificationFile {
    /// Returns the files of breakpoints or of a pulse that the specification names, as they are written there.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        let random = self.random.iter().filter_map(|section| section.file.as_deref());
        let shock = self.shock.iter().filter_map(|section| section.file.as_deref());
        random.chain(shock).chain(self.srs.iter().filter_map(|section| section.file.as_deref()))
    }
}

/// Control channels and their average.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "struct ControlSection")]
pub struct Control {
    /// Names of the channels; none leaves the choice to the one who judges.
    pub channels: Vec<String>,
    /// Average over the channels.
    pub average: Average,
}

/// Average over several control channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Average {
    /// The mean of the channels' powers.
    #[default]
    Mean,
    /// The largest of the channels, line by line.
    Max,
    /// The smallest of the channels, line by line.
    Min,
}

impl Average {
    /// Returns the average of powers, or of squares.
    pub fn of(self, powers: impl Iterator<Item = f64>) -> f64 {
        match self {
            Average::Mean => {
                let (sum, count) = powers.fold((0.0, 0.0), |(sum, count), power| (sum + power, count + 1.0));
                sum / count
            }
            Average::Max => powers.fold(f64::NEG_INFINITY, f64::max),
            Average::Min => powers.fold(f64::INFINITY, f64::min),
        }
    }
}

/// Reading of a sine's amplitude that is judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// The fundamental, by a tracking filter.
    #[default]
    Tracked,
    /// √2 times the rms.
    Rms,
    /// The peak of the whole reading, harmonics included.
    Peak,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Header {
    pub kind: Kind,
    pub name: Option<String>,
    pub sources: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Kind {
    Random,
    Sine,
    Shock,
}

/// A tolerance at all frequencies, [low, high], or from frequencies on, [[Hz, low, high], …].
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a tolerance [low, high], dB, or bands [[Hz, low, high], …] from these frequencies on"
)]
pub(crate) enum ToleranceEntry {
    Everywhere([f64; 2]),
    Bands(Vec<[f64; 3]>),
}

impl ToleranceEntry {
    pub fn bands(&self) -> Vec<ToleranceBand> {
        let band = |[from_hz, low_db, high_db]: [f64; 3]| ToleranceBand { from_hz, low_db, high_db };
        match self {
            ToleranceEntry::Everywhere([low_db, high_db]) => alloc::vec![band([0.0, *low_db, *high_db])],
            ToleranceEntry::Bands(bands) => bands.iter().copied().map(band).collect(),
        }
    }
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RandomSection {
    pub unit: DensityUnit,
    pub breakpoints: Option<Vec<Corner>>,
    pub file: Option<String>,
    pub tolerance_db: ToleranceEntry,
    pub alarm_db: Option<ToleranceEntry>,
    pub abort_db: Option<ToleranceEntry>,
    pub abort_share: Option<f64>,
    pub rms_tolerance: Option<f64>,
    pub lines_hz: Option<f64>,
    pub dof: Option<f64>,
}

/// Unit in which a file states densities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
pub enum DensityUnit {
    /// (m/s²)²/Hz, the SI unit of a density.
    #[serde(rename = "(m/s2)2/Hz", alias = "(m/s²)²/Hz")]
    Si,
    /// g²/Hz, with the standard acceleration of gravity 9.80665 m/s².
    #[serde(rename = "g2/Hz", alias = "g²/Hz")]
    Gravity,
}

/// Unit in which a file states accelerations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
pub enum AccelerationUnit {
    /// m/s², the SI unit of an acceleration.
    #[serde(rename = "m/s2", alias = "m/s²")]
    Si,
    /// The standard acceleration of gravity, 9.80665 m/s².
    #[serde(rename = "g")]
    Gravity,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ScheduleSection {
    pub levels_db: Vec<f64>,
    pub seconds: Vec<f64>,
    pub ramp_down_s: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SineSection {
    pub from_hz: f64,
    pub to_hz: Option<f64>,
    pub rate_oct_min: Option<f64>,
    pub hz_s: Option<f64>,
    pub sweeps: Option<u32>,
    pub segments: Vec<SegmentEntry>,
    pub tolerance: f64,
    pub share: Option<f64>,
    pub abort: Option<f64>,
    pub rate_tolerance: Option<f64>,
    pub measure: Option<Measure>,
    pub tracking: Option<f64>,
    pub compression_db_s: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SegmentEntry {
    pub to_hz: Option<f64>,
    pub displacement_mm: Option<f64>,
    pub velocity_m_s: Option<f64>,
    pub acceleration_m_s2: Option<f64>,
    pub acceleration_g: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DwellSection {
    pub above_ratio: f64,
    pub seconds: f64,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ShockSection {
    pub pulse: PulseName,
    pub peak_m_s2: Option<f64>,
    pub peak_g: Option<f64>,
    pub duration_s: Option<f64>,
    pub file: Option<String>,
    pub rise_s: Option<f64>,
    pub fall_s: Option<f64>,
    pub pre_s: Option<f64>,
    pub post_s: Option<f64>,
    pub band: f64,
    pub velocity_tolerance: Option<f64>,
    pub end_velocity_tolerance: Option<f64>,
    pub outside: Option<f64>,
    pub shots: Option<Vec<ShotsEntry>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PulseName {
    HalfSine,
    SawTooth,
    Trapezoid,
    File,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ShotsEntry {
    pub level_db: f64,
    pub count: u32,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SrsSection {
    pub unit: AccelerationUnit,
    pub q: f64,
    pub breakpoints: Option<Vec<Corner>>,
    pub file: Option<String>,
    pub tolerance_db: ToleranceEntry,
    pub share: Option<f64>,
    pub rest_tolerance_db: Option<ToleranceEntry>,
    pub lines_per_octave: f64,
    pub shots: Option<Vec<ShotsEntry>>,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct LimitsSection {
    pub drive_peak_n: Option<f64>,
    pub sigma: Option<f64>,
    pub loss_ms: Option<f64>,
    pub gain_check_n: Option<f64>,
    pub response: Vec<ResponseEntry>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ResponseEntry {
    pub channel: String,
    pub breakpoints: Vec<Corner>,
}

/// Checks that a number is within a range.
pub(crate) fn checked(
    section: &'static str,
    key: &'static str,
    got: f64,
    is_valid: impl Fn(f64) -> bool,
    expected: &'static str,
) -> Result<f64, SpecificationError> {
    if got.is_finite() && is_valid(got) {
        Ok(got)
    } else {
        Err(SpecificationError::Value { place: Place { section, key }, got, expected })
    }
}

/// Checks that a number is positive.
pub(crate) fn positive(section: &'static str, key: &'static str, got: f64) -> Result<f64, SpecificationError> {
    checked(section, key, got, |number| number > 0.0, "a positive number")
}

/// Checks that a number, if it is given, is positive.
pub(crate) fn any_positive(
    section: &'static str,
    key: &'static str,
    got: Option<f64>,
) -> Result<Option<f64>, SpecificationError> {
    got.map(|got| positive(section, key, got)).transpose()
}

/// Checks that a share, if it is given, is above 0 and at most 1.
pub(crate) fn any_share(
    section: &'static str,
    key: &'static str,
    got: Option<f64>,
) -> Result<Option<f64>, SpecificationError> {
    got.map(|got| checked(section, key, got, |share| share > 0.0 && share <= 1.0, "above 0 and at most 1")).transpose()
}
