//! Swept-sine tests: an amplitude over frequency, and a sweep.
//!
//! A logarithmic sweep of r octaves a minute from f₁ has the frequency f(t) = f₁ e^(ct) with c = r ln 2/60 and the phase 2π f₁
//! (e^(ct) − 1)/c; a linear one of s Hz a second has f₁ + s t and 2π (f₁ t + s t²/2).

use alloc::vec::Vec;
use core::f64::consts::{LN_2, TAU};

use serde::Serialize;

use crate::GRAVITY_M_S2;
use crate::error::{Place, SpecificationError, missing};
use crate::file::{DwellSection, Measure, SegmentEntry, SineSection, any_positive, any_share, checked, positive};
use crate::profile::{Corner, Level, Profile};

const SECTION: &str = "sine";
/// Bandwidth of the judge's tracking filter over the frequency, by default.
const TRACKING: f64 = 0.15;
/// Largest bandwidth of the tracking filter over the frequency: a wider one would take in harmonics.
const MOST_TRACKING: f64 = 0.25;

/// Rate of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SweepRate {
    /// Logarithmic sweep, octaves a minute.
    OctavesPerMinute(f64),
    /// Linear sweep, hertz a second.
    HertzPerSecond(f64),
}

/// Quantity that is constant over a segment of a sine test, with its amplitude.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SineLevel {
    /// Constant amplitude of the displacement, m.
    Displacement(f64),
    /// Constant amplitude of the velocity, m/s.
    Velocity(f64),
    /// Constant amplitude of the acceleration, m/s².
    Acceleration(f64),
}

impl SineLevel {
    /// Returns the amplitude of the acceleration at a frequency, m/s².
    pub fn acceleration_m_s2(self, hz: f64) -> f64 {
        let (level, power) = self.parts();
        level * libm::pow(TAU * hz, power)
    }

    /// Returns the amplitude, and the power of ω by which it gives the acceleration.
    fn parts(self) -> (f64, f64) {
        match self {
            SineLevel::Displacement(level) => (level, 2.0),
            SineLevel::Velocity(level) => (level, 1.0),
            SineLevel::Acceleration(level) => (level, 0.0),
        }
    }

    /// Returns the frequency, Hz, at which two levels have the same acceleration: A₁ ω^p = A₂ ω^q. `None` if they are of the
    /// same kind.
    pub fn corner_hz(self, other: SineLevel) -> Option<f64> {
        let (a, p) = self.parts();
        let (b, q) = other.parts();
        (p != q).then(|| libm::pow(b / a, 1.0 / (p - q)) / TAU)
    }
}

/// Range of frequencies over which one quantity is constant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SineSegment {
    /// Frequency at which the segment begins, Hz.
    pub from_hz: f64,
    /// Frequency at which the segment ends, Hz.
    pub to_hz: f64,
    /// The amplitude that is held between them.
    pub level: SineLevel,
}

/// Search for resonances at which the test then stays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Dwell {
    /// Least ratio of the response and the level that makes a resonance.
    pub above_ratio: f64,
    /// Time at each resonance, s.
    pub seconds: f64,
}

/// A swept sine with its levels, sweeps and tolerances.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SineTest {
    /// Segments by rising frequency, each begins where the one before ends.
    pub segments: Vec<SineSegment>,
    /// Rate of the sweep.
    pub rate: SweepRate,
    /// Number of sweeps, up and down in turn.
    pub sweeps: u32,
    /// Largest relative deviation of the amplitude.
    pub tolerance: f64,
    /// Share of the time in which the amplitude must be within the tolerance, by default 1.
    pub share: f64,
    /// Relative deviation at which a controller ends the test, if it is stated.
    pub abort: Option<f64>,
    /// Largest relative deviation of the sweep rate, if it is stated.
    pub rate_tolerance: Option<f64>,
    /// Reading that is judged.
    pub measure: Measure,
    /// Bandwidth of the judge's tracking filter over the frequency, by default 0.15.
    pub tracking: f64,
    /// Largest rate of change of the controller's drive, dB/s, if it is stated.
    pub compression_db_s: Option<f64>,
    /// Dwell at resonances, if it is asked for.
    pub dwell: Option<Dwell>,
}

/// What a segment of a sine test asks of exciter and structure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SineFigures {
    /// First frequency of the sweep, Hz.
    pub from_hz: f64,
    /// Last frequency of the sweep, Hz.
    pub to_hz: f64,
    /// Time of one sweep through the segment, s.
    pub seconds: f64,
    /// Cycles of one sweep through the segment.
    pub cycles: f64,
    /// Largest amplitude of the acceleration, m/s².
    pub peak_m_s2: f64,
    /// Largest amplitude of the velocity, m/s.
    pub velocity_peak_m_s: f64,
    /// Largest amplitude of the displacement, m.
    pub displacement_peak_m: f64,
}

/// Points of a segment at which a largest force is searched for, per octave.
const IN_OCTAVE: f64 = 2000.0;

impl SineTest {
    pub(crate) fn new(section: &SineSection, dwell: Option<&DwellSection>) -> Result<SineTest, SpecificationError> {
        let from_hz = positive(SECTION, "from_hz", section.from_hz)?;
        let rates = [("rate_oct_min", section.rate_oct_min), ("hz_s", section.hz_s)];
        let rate = match rates {
            [(key, Some(rate)), (_, None)] => SweepRate::OctavesPerMinute(positive(SECTION, key, rate)?),
            [(_, None), (key, Some(rate))] => SweepRate::HertzPerSecond(positive(SECTION, key, rate)?),
            _ => {
                let got = rates.iter().filter(|(_, rate)| rate.is_some()).count();
                return Err(SpecificationError::OneOf { section: SECTION, keys: &["rate_oct_min", "hz_s"], got });
            }
        };
        let segments = segments(from_hz, section.to_hz, &section.segments)?;
        Ok(SineTest {
            segments,
            rate,
            sweeps: match section.sweeps {
                Some(0) => {
                    let place = Place { section: SECTION, key: "sweeps" };
                    return Err(SpecificationError::Value { place, got: 0.0, expected: "at least 1" });
                }
                sweeps => sweeps.unwrap_or(1),
            },
            tolerance: checked(SECTION, "tolerance", section.tolerance, |t| t > 0.0 && t < 1.0, "above 0 and below 1")?,
            share: any_share(SECTION, "share", section.share)?.unwrap_or(1.0),
            abort: any_positive(SECTION, "abort", section.abort)?,
            rate_tolerance: any_share(SECTION, "rate_tolerance", section.rate_tolerance)?,
            measure: section.measure.unwrap_or_default(),
            tracking: checked(
                SECTION,
                "tracking",
                section.tracking.unwrap_or(TRACKING),
                |b| b > 0.0 && b <= MOST_TRACKING,
                "above 0 and at most 0.25",
            )?,
            compression_db_s: any_positive(SECTION, "compression_db_s", section.compression_db_s)?,
            dwell: match dwell {
                Some(DwellSection { above_ratio, seconds }) => Some(Dwell {
                    above_ratio: checked("dwell", "above_ratio", *above_ratio, |ratio| ratio > 1.0, "above 1")?,
                    seconds: positive("dwell", "seconds", *seconds)?,
                }),
                None => None,
            },
        })
    }

    /// Makes the profile of a response limit, m/s².
    pub(crate) fn limit(corners: &[Corner]) -> Result<Profile, SpecificationError> {
        Profile::of_corners(corners, Level::Amplitude, 1.0, Place { section: "limits.response", key: "breakpoints" })
    }

    /// Returns the lowest and the highest frequency, Hz.
    pub fn band_hz(&self) -> [f64; 2] {
        match (self.segments.first(), self.segments.last()) {
            (Some(first), Some(last)) => [first.from_hz, last.to_hz],
            _ => [0.0; 2],
        }
    }

    /// Returns the amplitude of the acceleration at a frequency, m/s²; `None` beyond the sweep.
    pub fn acceleration_m_s2(&self, hz: f64) -> Option<f64> {
        let segment = self.segments.iter().find(|segment| hz >= segment.from_hz && hz <= segment.to_hz)?;
        Some(segment.level.acceleration_m_s2(hz))
    }

    /// Returns the time of a sweep from one frequency to another, s.
    pub fn sweep_s(&self, from_hz: f64, to_hz: f64) -> f64 {
        match self.rate {
            SweepRate::OctavesPerMinute(rate) => 60.0 * libm::log2(to_hz / from_hz) / rate,
            SweepRate::HertzPerSecond(rate) => (to_hz - from_hz) / rate,
        }
    }

    /// Returns the cycles of a sweep from one frequency to another.
    pub fn cycles(&self, from_hz: f64, to_hz: f64) -> f64 {
        match self.rate {
            SweepRate::OctavesPerMinute(rate) => 60.0 * (to_hz - from_hz) / (rate * LN_2),
            SweepRate::HertzPerSecond(rate) => 0.5 * (from_hz + to_hz) * (to_hz - from_hz) / rate,
        }
    }

    /// Returns the frequency, Hz, a time after the start of the first sweep, s.
    pub fn frequency_hz(&self, t_s: f64) -> f64 {
        let [from_hz, _] = self.band_hz();
        match self.rate {
            SweepRate::OctavesPerMinute(rate) => from_hz * libm::exp(rate * LN_2 / 60.0 * t_s),
            SweepRate::HertzPerSecond(rate) => from_hz + rate * t_s,
        }
    }

    /// Returns the phase, rad, a time after the start of the first sweep, s.
    pub fn phase_rad(&self, t_s: f64) -> f64 {
        let [from_hz, _] = self.band_hz();
        match self.rate {
            SweepRate::OctavesPerMinute(rate) => {
                let c = rate * LN_2 / 60.0;
                TAU * from_hz * libm::expm1(c * t_s) / c
            }
            SweepRate::HertzPerSecond(rate) => TAU * (from_hz + 0.5 * rate * t_s) * t_s,
        }
    }

    /// Returns the rate of the sweep at a frequency, Hz/s.
    pub fn rate_hz_s(&self, hz: f64) -> f64 {
        match self.rate {
            SweepRate::OctavesPerMinute(rate) => rate * LN_2 / 60.0 * hz,
            SweepRate::HertzPerSecond(rate) => rate,
        }
    }

    /// Returns η = Q² ḟ/fₙ² of a mode: how fast the sweep passes its resonance. Below 0.1 the resonance is reached to 98 %; a
    /// controller that regulates the amplitude alone is wrong by about η/π at it.
    ///
    /// C. Lalanne, "Mechanical Vibration and Shock Analysis", volume 1, 3rd edition 2014, chapter 9.
    pub fn sweep_parameter(&self, frequency_hz: f64, damping_ratio: f64) -> f64 {
        let quality = 0.5 / damping_ratio;
        quality * quality * self.rate_hz_s(frequency_hz) / (frequency_hz * frequency_hz)
    }

    /// Returns what each segment asks of exciter and structure.
    pub fn figures(&self) -> Vec<SineFigures> {
        let figures = |segment: &SineSegment| {
            let SineSegment { from_hz, to_hz, level } = *segment;
            // Each quantity is a power of the frequency over the segment, so it is largest at an end.
            let largest = |power: i32| {
                let at = |hz: f64| level.acceleration_m_s2(hz) / libm::pow(TAU * hz, f64::from(power));
                at(from_hz).max(at(to_hz))
            };
            SineFigures {
                from_hz,
                to_hz,
                seconds: self.sweep_s(from_hz, to_hz),
                cycles: self.cycles(from_hz, to_hz),
                peak_m_s2: largest(0),
                velocity_peak_m_s: largest(1),
                displacement_peak_m: largest(2),
            }
        };
        self.segments.iter().map(figures).collect()
    }

    /// Returns the largest amplitude of a quantity over the sweep, and its frequency, Hz; `gain` as of
    /// [`RandomTest::rms_through`](crate::RandomTest::rms_through).
    pub fn largest_through(&self, gain: impl Fn(f64) -> f64) -> (f64, f64) {
        let mut largest = (0.0, 0.0);
        for segment in &self.segments {
            let ratio = segment.to_hz / segment.from_hz;
            let count = libm::ceil(IN_OCTAVE * libm::log2(ratio)).max(1.0) as usize;
            for k in 0..=count {
                let hz = segment.from_hz * libm::pow(ratio, k as f64 / count as f64);
                let value = segment.level.acceleration_m_s2(hz) * gain(hz);
                if value > largest.0 {
                    largest = (value, hz);
                }
            }
        }
        largest
    }
}

/// Checks the segments; a last frequency that is left out is the corner to the next level.
fn segments(
    from_hz: f64,
    to_hz: Option<f64>,
    entries: &[SegmentEntry],
) -> Result<Vec<SineSegment>, SpecificationError> {
    let place = Place { section: SECTION, key: "segments" };
    let levels = entries.iter().zip(1..).map(|(entry, number)| level(entry, number, place));
    let levels = levels.collect::<Result<Vec<_>, _>>()?;
    let mut found: Vec<SineSegment> = Vec::new();
    let mut before = from_hz;
    for ((entry, level), index) in entries.iter().zip(&levels).zip(0..) {
        let corner = || levels.get(index + 1).and_then(|next| level.corner_hz(*next));
        let is_last = index + 1 == entries.len();
        let end = if is_last { entry.to_hz.or(to_hz) } else { entry.to_hz.or_else(corner) };
        let Some(end_hz) = end else {
            let why = "the last segment needs `to_hz`, and so does one before a segment of the same quantity";
            return Err(missing(SECTION, Some("to_hz"), why));
        };
        // Checked in the order of the file, so that the message names the first segment that does not fit.
        let rises = end_hz > before && end_hz.is_finite();
        place.check(index + 1, "its last frequency, Hz,", end_hz, rises, "above its first one")?;
        found.push(SineSegment { from_hz: before, to_hz: end_hz, level: *level });
        before = end_hz;
    }
    match (found.last(), to_hz) {
        (None, _) => Err(SpecificationError::TooShort { place, got: 0, least: 1 }),
        (Some(last), Some(to_hz)) if last.to_hz != to_hz => Err(SpecificationError::Value {
            place: Place { section: SECTION, key: "to_hz" },
            got: to_hz,
            expected: "the last frequency of the last segment",
        }),
        _ => Ok(found),
    }
}

/// Returns the level of a segment, which is stated in one unit.
fn level(entry: &SegmentEntry, number: usize, place: Place) -> Result<SineLevel, SpecificationError> {
    type Make = fn(f64) -> SineLevel;
    let stated: [(Option<f64>, Make); 4] = [
        (entry.displacement_mm, |mm| SineLevel::Displacement(1e-3 * mm)),
        (entry.velocity_m_s, SineLevel::Velocity),
        (entry.acceleration_m_s2, SineLevel::Acceleration),
        (entry.acceleration_g, |g| SineLevel::Acceleration(GRAVITY_M_S2 * g)),
    ];
    let given: Vec<(f64, Make)> = stated.iter().filter_map(|(value, make)| value.map(|value| (value, *make))).collect();
    match given[..] {
        [(value, make)] => place.check_positive(number, "the level", value).map(|()| make(value)),
        _ => Err(SpecificationError::OneOf {
            section: "sine.segments",
            keys: &["displacement_mm", "velocity_m_s", "acceleration_m_s2", "acceleration_g"],
            got: given.len(),
        }),
    }
}
