//! Classical shocks: a pulse of acceleration, with weaker pulses before and after it that bring a shaker back to rest.

use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use serde::Serialize;

use crate::error::{Place, SpecificationError, idle, missing};
use crate::file::{PulseName, ShockSection, ShotsEntry, any_positive, any_share, checked, positive};
use crate::{GRAVITY_M_S2, csv};

const SECTION: &str = "shock";

/// Shape of a pulse over its duration D, 0 outside of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PulseShape {
    /// Half of a sine, sin(πt/D) over its duration D.
    HalfSine,
    /// t/D: it rises to the peak, and ends there.
    SawTooth,
    /// It rises to the peak, stays there, and falls.
    Trapezoid {
        /// Time of the rise, s.
        rise_s: f64,
        /// Time of the fall, s.
        fall_s: f64,
    },
    /// Straight between points: times, s, from 0 to the duration, and accelerations over the peak.
    Points(Vec<[f64; 2]>),
}

/// Number of shots at a level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shots {
    /// Level, dB, at most 0.
    pub level_db: f64,
    /// Number of shots at this level.
    pub count: u32,
}

/// A classical shock, with its compensation and its tolerances.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShockTest {
    /// Shape of the pulse.
    pub shape: PulseShape,
    /// Peak of the pulse's acceleration, m/s².
    pub peak_m_s2: f64,
    /// Duration of the pulse, s.
    pub duration_s: f64,
    /// Time of the compensation before the pulse, s, if it is stated.
    pub pre_s: Option<f64>,
    /// Time of the compensation after the pulse, s, if it is stated.
    pub post_s: Option<f64>,
    /// Largest deviation from the pulse, over the peak.
    pub band: f64,
    /// Largest relative deviation of the velocity change, if it is stated.
    pub velocity_tolerance: Option<f64>,
    /// Largest velocity at the end over the velocity change, if it is stated.
    pub end_velocity_tolerance: Option<f64>,
    /// Largest acceleration outside of the pulse over the peak, if it is stated.
    pub outside: Option<f64>,
    /// Shots in turn, if they are stated.
    pub shots: Vec<Shots>,
}

/// What a shock asks of exciter and structure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ShockFigures {
    /// Peak of the pulse's acceleration, m/s².
    pub peak_m_s2: f64,
    /// Velocity change of the pulse, m/s.
    pub velocity_change_m_s: f64,
    /// Largest acceleration of the compensation over the peak, if there is any.
    pub compensation: Option<f64>,
    /// Largest velocity, m/s; without compensation the velocity change.
    pub velocity_peak_m_s: f64,
    /// Difference of the largest and the smallest displacement, m; none without compensation, as the structure would move away.
    pub stroke_m: Option<f64>,
    /// Number of shots at full level.
    pub shots: u32,
}

impl ShockTest {
    pub(crate) fn new(
        section: &ShockSection,
        read: &mut dyn FnMut(&str) -> Result<String, String>,
    ) -> Result<ShockTest, SpecificationError> {
        let Pulse { shape, peak_m_s2, duration_s } = pulse(section, read)?;
        if section.pre_s.is_some() != section.post_s.is_some() {
            let key = Some(if section.pre_s.is_none() { "pre_s" } else { "post_s" });
            let why = "the compensation needs both, since velocity and displacement end at 0";
            return Err(missing(SECTION, key, why));
        }
        Ok(ShockTest {
            shape,
            peak_m_s2,
            duration_s,
            pre_s: any_positive(SECTION, "pre_s", section.pre_s)?,
            post_s: any_positive(SECTION, "post_s", section.post_s)?,
            band: checked(SECTION, "band", section.band, |band| band > 0.0 && band < 1.0, "above 0 and below 1")?,
            velocity_tolerance: any_share(SECTION, "velocity_tolerance", section.velocity_tolerance)?,
            end_velocity_tolerance: any_share(SECTION, "end_velocity_tolerance", section.end_velocity_tolerance)?,
            outside: any_share(SECTION, "outside", section.outside)?,
            shots: shots(SECTION, section.shots.as_deref())?,
        })
    }

    /// Returns the acceleration of the pulse a time after its start, s, at full level, m/s².
    pub fn acceleration_m_s2(&self, t_s: f64) -> f64 {
        let duration_s = self.duration_s;
        if !(t_s >= 0.0 && t_s <= duration_s) {
            return 0.0;
        }
        let share = match &self.shape {
            PulseShape::HalfSine => libm::sin(PI * t_s / duration_s),
            // The edge is at the last instant, whose acceleration is that behind it.
            PulseShape::SawTooth if t_s == duration_s => 0.0,
            PulseShape::SawTooth => t_s / duration_s,
            PulseShape::Trapezoid { rise_s, fall_s } => {
                let rise = if *rise_s > 0.0 { t_s / rise_s } else { 1.0 };
                let fall = if *fall_s > 0.0 { (duration_s - t_s) / fall_s } else { 1.0 };
                rise.min(fall).clamp(0.0, 1.0)
            }
            PulseShape::Points(points) => {
                let above = points.partition_point(|[time_s, _]| *time_s < t_s).clamp(1, points.len() - 1);
                let [[t1, a1], [t2, a2]] = [points[above - 1], points[above]];
                a1 + (a2 - a1) * ((t_s - t1) / (t2 - t1))
            }
        };
        self.peak_m_s2 * share
    }

    /// Returns the velocity change of the pulse at full level, m/s: 2AD/π of a half-sine, AD/2 of a saw-tooth.
    pub fn velocity_change_m_s(&self) -> f64 {
        self.peak_m_s2
            * match &self.shape {
                PulseShape::HalfSine => 2.0 * self.duration_s / PI,
                PulseShape::SawTooth => 0.5 * self.duration_s,
                PulseShape::Trapezoid { rise_s, fall_s } => self.duration_s - 0.5 * (rise_s + fall_s),
                PulseShape::Points(points) => area(points),
            }
    }

    /// Returns the samples of the pulse, `rate_hz` a second, from its start to its end.
    pub fn samples(&self, rate_hz: f64) -> Vec<f64> {
        let count = libm::round(self.duration_s * rate_hz) as usize;
        // The instants are those of the duration in equal parts, so that the last one is its end.
        (0..=count).map(|k| self.acceleration_m_s2(self.duration_s * (k as f64 / count.max(1) as f64))).collect()
    }

    /// Returns the pulse with its compensation, `rate_hz` samples a second, and the index of the pulse's first sample; `None`
    /// if the specification states no compensation.
    ///
    /// The compensation is a sum of raised-cosine bells before and after the pulse, each over half or all of its time. The
    /// amplitudes are those of least squares for which the sums that stand for ∫a dt and ∬a dt² are 0 at the end: with the
    /// bells' ends E, 2 × n, and those of the pulse e, they are −Eᵀ(EEᵀ)⁻¹e.
    pub fn compensated(&self, rate_hz: f64) -> Option<(Vec<f64>, usize)> {
        let pre_s = self.pre_s?;
        let post_s = self.post_s?;
        let pulse = self.samples(rate_hz);
        let [before, after] = [pre_s, post_s].map(|s| (s * rate_hz) as usize);
        let count = before + pulse.len() + after;
        let mut bells: Vec<(usize, usize)> = Vec::new();
        for (start, length) in [(0, before), (before + pulse.len(), after)] {
            bells.extend(
                [(0, length / 2), (length / 4, length / 2), (length - length / 2, length / 2), (0, length)]
                    .map(|(offset, width)| (start + offset, width)),
            );
        }
        let bell = |width: usize| (0..width).map(move |k| 0.5 - 0.5 * libm::cos(TAU * k as f64 / width as f64));
        // The sums of v(k) and of its running sums, over samples: a sample at k stays in count − k running sums.
        let ends = |start: usize, values: &mut dyn Iterator<Item = f64>| {
            values.enumerate().fold([0.0, 0.0], |[sum, double], (k, value)| {
                [sum + value, double + value * (count - start - k) as f64]
            })
        };
        let of_pulse = ends(before, &mut pulse.iter().copied());
        let of_bells: Vec<[f64; 2]> = bells.iter().map(|(start, width)| ends(*start, &mut bell(*width))).collect();
        let product = |i: usize, j: usize| of_bells.iter().map(|end| end[i] * end[j]).sum::<f64>();
        let [a, b, d] = [product(0, 0), product(0, 1), product(1, 1)];
        let determinant = a * d - b * b;
        let factors =
            [(d * of_pulse[0] - b * of_pulse[1]) / determinant, (a * of_pulse[1] - b * of_pulse[0]) / determinant];
        let mut record = vec![0.0; count];
        record[before..before + pulse.len()].copy_from_slice(&pulse);
        for ((start, width), end) in bells.iter().zip(&of_bells) {
            let amplitude = -(end[0] * factors[0] + end[1] * factors[1]);
            for (sample, value) in record[*start..].iter_mut().zip(bell(*width)) {
                *sample += amplitude * value;
            }
        }
        record.iter().all(|sample| sample.is_finite()).then_some((record, before))
    }

    /// Returns what the shock asks of exciter and structure; the compensation is sampled 1000 times over the pulse.
    pub fn figures(&self) -> ShockFigures {
        let rate_hz = SAMPLES / self.duration_s;
        let compensated = self.compensated(rate_hz);
        let pulse = libm::round(self.duration_s * rate_hz) as usize + 1;
        let mut figures = ShockFigures {
            peak_m_s2: self.peak_m_s2,
            velocity_change_m_s: self.velocity_change_m_s(),
            compensation: None,
            velocity_peak_m_s: self.velocity_change_m_s(),
            stroke_m: None,
            shots: full_level_shots(&self.shots),
        };
        if let Some((record, start)) = compensated {
            let outside = record[..start].iter().chain(&record[start + pulse..]);
            let largest = outside.fold(0.0_f64, |largest, sample| largest.max(sample.abs()));
            let mut velocity = 0.0;
            let mut place = 0.0;
            let mut fastest = 0.0_f64;
            let mut low = 0.0_f64;
            let mut high = 0.0_f64;
            for sample in &record {
                velocity += sample / rate_hz;
                place += velocity / rate_hz;
                fastest = fastest.max(velocity.abs());
                low = low.min(place);
                high = high.max(place);
            }
            figures.compensation = Some(largest / self.peak_m_s2);
            figures.velocity_peak_m_s = fastest;
            figures.stroke_m = Some(high - low);
        }
        figures
    }
}

/// A pulse as a file states it.
struct Pulse {
    shape: PulseShape,
    peak_m_s2: f64,
    duration_s: f64,
}

/// Checks the pulse: a shape with its peak and duration, or a table that has both.
fn pulse(
    section: &ShockSection,
    read: &mut dyn FnMut(&str) -> Result<String, String>,
) -> Result<Pulse, SpecificationError> {
    let parts = [("rise_s", section.rise_s), ("fall_s", section.fall_s)];
    if section.pulse != PulseName::Trapezoid
        && let Some((key, _)) = parts.iter().find(|(_, part)| part.is_some())
    {
        return Err(idle(SECTION, Some(key), "only a trapezoid has it"));
    }
    match section.pulse {
        PulseName::HalfSine => pulse_of_shape(section, |_| Ok(PulseShape::HalfSine)),
        PulseName::SawTooth => pulse_of_shape(section, |_| Ok(PulseShape::SawTooth)),
        PulseName::Trapezoid => pulse_of_shape(section, |duration_s| {
            let part = |(key, got): (&'static str, Option<f64>)| {
                let got = got.ok_or(missing(SECTION, Some(key), "a trapezoid rises and falls"))?;
                checked(SECTION, key, got, |got| got >= 0.0 && got <= duration_s, "from 0 to duration_s")
            };
            let [rise_s, fall_s] = [part(parts[0])?, part(parts[1])?];
            if rise_s + fall_s > duration_s {
                let expected = "at most `duration_s` less `rise_s`";
                let place = Place { section: SECTION, key: "fall_s" };
                return Err(SpecificationError::Value { place, got: fall_s, expected });
            }
            Ok(PulseShape::Trapezoid { rise_s, fall_s })
        }),
        PulseName::File => {
            for (key, given) in
                [("peak_m_s2", section.peak_m_s2), ("peak_g", section.peak_g), ("duration_s", section.duration_s)]
            {
                if given.is_some() {
                    return Err(idle(SECTION, Some(key), "the file of the pulse has it"));
                }
            }
            let file = section.file.as_deref().ok_or(missing(SECTION, Some("file"), "the pulse is that of a file"))?;
            let text = read(file).map_err(|message| SpecificationError::File { file: file.to_owned(), message })?;
            pulse_of_points(&csv::pulse(&text, file)?)
        }
    }
}

/// Checks peak and duration of a pulse; `shape` returns its shape by the duration.
fn pulse_of_shape(
    section: &ShockSection,
    shape: impl FnOnce(f64) -> Result<PulseShape, SpecificationError>,
) -> Result<Pulse, SpecificationError> {
    if section.file.is_some() {
        return Err(idle(SECTION, Some("file"), "the pulse is not that of a file: use `pulse = \"file\"`"));
    }
    let peak_m_s2 = match (section.peak_m_s2, section.peak_g) {
        (Some(peak), None) => positive(SECTION, "peak_m_s2", peak)?,
        (None, Some(peak)) => GRAVITY_M_S2 * positive(SECTION, "peak_g", peak)?,
        (m_s2, g) => {
            let got = usize::from(m_s2.is_some()) + usize::from(g.is_some());
            return Err(SpecificationError::OneOf { section: SECTION, keys: &["peak_m_s2", "peak_g"], got });
        }
    };
    let duration_s =
        section.duration_s.ok_or(missing(SECTION, Some("duration_s"), "the shape of the pulse has this duration"))?;
    let duration_s = positive(SECTION, "duration_s", duration_s)?;
    Ok(Pulse { shape: shape(duration_s)?, peak_m_s2, duration_s })
}

/// Least velocity change of a pulse over its peak and duration: verdicts are relative to it.
const LEAST_CHANGE: f64 = 0.01;

/// Checks the points of a pulse, times, s, and accelerations, m/s². The times are then counted from the first one.
fn pulse_of_points(points: &[[f64; 2]]) -> Result<Pulse, SpecificationError> {
    let place = Place { section: SECTION, key: "file" };
    let [first, .., last] = points else {
        return Err(SpecificationError::TooShort { place, got: points.len(), least: 2 });
    };
    let mut before = f64::NEG_INFINITY;
    for (&[time_s, acceleration], number) in points.iter().zip(1..) {
        place.check(number, "the time, s,", time_s, time_s > before && time_s.is_finite(), "above the one before")?;
        let is_finite = acceleration.is_finite();
        place.check(number, "the acceleration, m/s²,", acceleration, is_finite, "a finite number")?;
        before = time_s;
    }
    let peak_m_s2 = points.iter().fold(0.0_f64, |peak, [_, acceleration]| peak.max(acceleration.abs()));
    let duration_s = last[0] - first[0];
    let shape: Vec<[f64; 2]> = points.iter().map(|[t, a]| [t - first[0], a / peak_m_s2]).collect();
    let change = area(&shape) / duration_s;
    // Of a file with zeros alone it is not a number.
    if change.is_nan() || change.abs() < LEAST_CHANGE {
        return Err(SpecificationError::NoVelocityChange { place, got: change });
    }
    Ok(Pulse { shape: PulseShape::Points(shape), peak_m_s2, duration_s })
}

/// Returns the area under points, straight between them.
fn area(points: &[[f64; 2]]) -> f64 {
    points.windows(2).map(|pair| 0.5 * (pair[1][0] - pair[0][0]) * (pair[0][1] + pair[1][1])).sum()
}

/// Samples over a pulse for the figures of its compensation.
const SAMPLES: f64 = 1000.0;

/// Returns the number of shots at full level, of which there is one if none are stated.
pub(crate) fn full_level_shots(shots: &[Shots]) -> u32 {
    if shots.is_empty() { 1 } else { shots.iter().filter(|shots| shots.level_db == 0.0).map(|shots| shots.count).sum() }
}

/// Checks shots: levels of at most 0 dB, the last one full.
pub(crate) fn shots(section: &'static str, entries: Option<&[ShotsEntry]>) -> Result<Vec<Shots>, SpecificationError> {
    let Some(entries) = entries else { return Ok(Vec::new()) };
    let place = Place { section, key: "shots" };
    for (&ShotsEntry { level_db, count }, number) in entries.iter().zip(1..) {
        let is_low = level_db <= 0.0 && level_db.is_finite();
        place.check(number, "the level, dB,", level_db, is_low, "at most 0")?;
        place.check(number, "the number of shots", 0.0, count > 0, "at least 1")?;
    }
    place.check_last_level(entries.len(), entries.last().map(|last| last.level_db))?;
    Ok(entries.iter().map(|&ShotsEntry { level_db, count }| Shots { level_db, count }).collect())
}
