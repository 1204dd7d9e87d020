//! Random tests: a density of acceleration over frequency.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use resonarm_modal::spectra::Segments;
use resonarm_numeric::distribution::chi_square_quantile;
use serde::Serialize;

use crate::GRAVITY_M_S2;
use crate::csv::corners;
use crate::error::{Place, SpecificationError};
use crate::file::{DensityUnit, RandomSection, ScheduleSection, any_positive, any_share, checked};
use crate::profile::{Corner, Level, Profile};
use crate::tolerance::Tolerance;

const SECTION: &str = "random";

/// A random test: the density of the acceleration at the control channel, with its tolerance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RandomTest {
    /// Unit in which the file states densities.
    pub unit: DensityUnit,
    /// Density of acceleration, (m/s²)²/Hz.
    pub profile: Profile,
    /// Tolerance of a line.
    pub tolerance: Tolerance,
    /// Deviation beyond which a controller warns, if it is stated.
    pub alarm: Option<Tolerance>,
    /// Deviation beyond which a controller ends the test, if it is stated.
    pub abort: Option<Tolerance>,
    /// Share of the lines beyond `abort` that ends the test, if it is stated.
    pub abort_share: Option<f64>,
    /// Largest relative deviation of the rms acceleration, if it is stated.
    pub rms_tolerance: Option<f64>,
    /// Spacing of the lines, Hz: by default a tenth of the lowest frequency.
    pub lines_hz: f64,
    /// Least degrees of freedom of a verdict, if they are stated.
    pub least_dof: Option<f64>,
    /// Levels of the test in turn, if they are stated.
    pub schedule: Option<Schedule>,
}

/// Levels of a random test in turn, the last of them at full level.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Schedule {
    /// Levels, dB below full level, and times, s.
    pub steps: Vec<ScheduleStep>,
    /// Time of the ramp at the end, s, if it is stated.
    pub ramp_down_s: Option<f64>,
}

/// A level of a schedule.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ScheduleStep {
    /// Level, dB, at most 0.
    pub level_db: f64,
    /// Time at this level, s.
    pub seconds: f64,
}

impl Schedule {
    pub(crate) fn new(section: &ScheduleSection) -> Result<Schedule, SpecificationError> {
        const SECTION: &str = "schedule";
        let levels = &section.levels_db;
        let seconds = &section.seconds;
        // Checked first: `zip` would drop what the longer list has more.
        if levels.len() != seconds.len() {
            let keys = ["levels_db", "seconds"];
            let got = [levels.len(), seconds.len()];
            return Err(SpecificationError::Lengths { section: SECTION, keys, got });
        }
        let key = |key| Place { section: SECTION, key };
        for ((&level_db, &seconds), number) in levels.iter().zip(seconds).zip(1..) {
            let is_low = level_db <= 0.0 && level_db.is_finite();
            key("levels_db").check(number, "the level, dB,", level_db, is_low, "at most 0")?;
            key("seconds").check_positive(number, "the time, s,", seconds)?;
        }
        key("levels_db").check_last_level(levels.len(), levels.last().copied())?;
        let step = |(&level_db, &seconds)| ScheduleStep { level_db, seconds };
        Ok(Schedule {
            steps: levels.iter().zip(seconds).map(step).collect(),
            ramp_down_s: any_positive(SECTION, "ramp_down_s", section.ramp_down_s)?,
        })
    }

    /// Returns the time at full level, s.
    pub fn full_level_s(&self) -> f64 {
        self.steps.iter().filter(|step| step.level_db == 0.0).map(|step| step.seconds).sum()
    }

    /// Returns the whole time without the ramp, s.
    pub fn duration_s(&self) -> f64 {
        self.steps.iter().map(|step| step.seconds).sum()
    }
}

/// What a random test asks of the exciter and the structure, at full level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RandomFigures {
    /// Rms of the acceleration at full level, m/s².
    pub rms_m_s2: f64,
    /// Rms of the velocity at full level, m/s.
    pub velocity_rms_m_s: f64,
    /// Rms of the displacement at full level, m.
    pub displacement_rms_m: f64,
    /// Ratio of peak and rms that the peaks have: the sigma limit, or 3.
    pub crest: f64,
    /// Peak of the acceleration to be expected, m/s².
    pub peak_m_s2: f64,
    /// Peak of the velocity to be expected, m/s.
    pub velocity_peak_m_s: f64,
    /// Peak of the displacement to be expected, m.
    pub displacement_peak_m: f64,
    /// Expected upward zero crossings of the acceleration a second, √(m₂/m₀)/2π (S. O. Rice, 1944).
    pub zero_crossings_hz: f64,
    /// Expected cycles at full level, if the schedule states its time.
    pub cycles: Option<f64>,
    /// Time of the schedule, s, if there is one.
    pub duration_s: Option<f64>,
    /// Degrees of freedom of a line that is averaged over the full level, if the schedule states its time.
    pub degrees_of_freedom: Option<f64>,
    /// Range, dB, in which 95 % of the lines of a perfect controller lie at these degrees of freedom.
    pub perfect_db: Option<[f64; 2]>,
}

/// Peaks that a Gaussian signal is usually taken to reach, in rms.
const CREST: f64 = 3.0;
/// Points of the integral over frequency of a force, per octave.
const IN_OCTAVE: f64 = 2000.0;

/// Returns the densities of a unit in SI units, (m/s²)²/Hz.
fn factor(unit: DensityUnit) -> f64 {
    match unit {
        DensityUnit::Si => 1.0,
        DensityUnit::Gravity => GRAVITY_M_S2 * GRAVITY_M_S2,
    }
}

impl RandomTest {
    pub(crate) fn new(
        section: &RandomSection,
        schedule: Option<&ScheduleSection>,
        read: &mut dyn FnMut(&str) -> Result<alloc::string::String, alloc::string::String>,
    ) -> Result<RandomTest, SpecificationError> {
        let place = |key| Place { section: SECTION, key };
        let corners = corners(SECTION, section.breakpoints.as_deref(), section.file.as_deref(), read)?;
        let profile = Profile::of_corners(&corners, Level::Power, factor(section.unit), place("breakpoints"))?;
        let bands = |key, entry: &crate::file::ToleranceEntry| Tolerance::of_bands(entry.bands(), place(key));
        let [from_hz, _] = profile.band_hz();
        Ok(RandomTest {
            unit: section.unit,
            tolerance: bands("tolerance_db", &section.tolerance_db)?,
            alarm: section.alarm_db.as_ref().map(|entry| bands("alarm_db", entry)).transpose()?,
            abort: section.abort_db.as_ref().map(|entry| bands("abort_db", entry)).transpose()?,
            abort_share: any_share(SECTION, "abort_share", section.abort_share)?,
            rms_tolerance: any_share(SECTION, "rms_tolerance", section.rms_tolerance)?,
            lines_hz: any_positive(SECTION, "lines_hz", section.lines_hz)?.unwrap_or(0.1 * from_hz),
            least_dof: section
                .dof
                .map(|dof| checked(SECTION, "dof", dof, |dof| dof >= 2.0, "at least 2"))
                .transpose()?,
            schedule: schedule.map(Schedule::new).transpose()?,
            profile,
        })
    }

    /// Makes the profile of a response limit, (m/s²)²/Hz.
    pub(crate) fn limit(&self, corners: &[Corner]) -> Result<Profile, SpecificationError> {
        let place = Place { section: "limits.response", key: "breakpoints" };
        Profile::of_corners(corners, Level::Power, factor(self.unit), place)
    }

    /// Returns what the test asks of the exciter and the structure. `sigma` is the limit of the drive's peaks in rms.
    pub fn figures(&self, sigma: Option<f64>) -> RandomFigures {
        let rms = |k| libm::sqrt(self.profile.moment(k));
        let [rms_m_s2, velocity_rms_m_s, displacement_rms_m] = [0, -2, -4].map(rms);
        let crest = sigma.unwrap_or(CREST);
        let zero_crossings_hz = libm::sqrt(self.profile.moment(2) / self.profile.moment(0)) / TAU;
        let full_s = self.schedule.as_ref().map(Schedule::full_level_s);
        // Segments of 1/Δf that overlap by half. The small number keeps a whole number of them from being rounded
        // down.
        let segments = full_s.map(|seconds| libm::floor(2.0 * seconds * self.lines_hz + 1e-9) - 1.0);
        let degrees_of_freedom =
            segments.filter(|segments| *segments >= 1.0).map(|segments| hann_degrees_of_freedom(segments as usize));
        RandomFigures {
            rms_m_s2,
            velocity_rms_m_s,
            displacement_rms_m,
            crest,
            peak_m_s2: crest * rms_m_s2,
            velocity_peak_m_s: crest * velocity_rms_m_s,
            displacement_peak_m: crest * displacement_rms_m,
            zero_crossings_hz,
            cycles: full_s.map(|seconds| seconds * zero_crossings_hz),
            duration_s: self.schedule.as_ref().map(Schedule::duration_s),
            degrees_of_freedom,
            perfect_db: degrees_of_freedom.map(perfect_db),
        }
    }

    /// Returns the rms of a quantity whose frequency response to the acceleration is known: `gain` is the modulus of the
    /// response at a frequency, Hz, in the quantity's unit per m/s². The force at the exciter is that of one over the
    /// accelerance.
    ///
    /// ∫ P |H|² df by the trapezoidal rule over 2000 points an octave.
    pub fn rms_through(&self, gain: impl Fn(f64) -> f64) -> f64 {
        let [from_hz, to_hz] = self.profile.band_hz();
        let count = libm::ceil(IN_OCTAVE * libm::log2(to_hz / from_hz)).max(1.0) as usize;
        let ratio = to_hz / from_hz;
        let at = |k: usize| {
            let hz = from_hz * libm::pow(ratio, k as f64 / count as f64);
            let gain = gain(hz);
            (hz, self.profile.at(hz).unwrap_or(0.0) * gain * gain)
        };
        let mut sum = 0.0;
        let mut before = at(0);
        for k in 1..=count {
            let point = at(k);
            sum += 0.5 * (point.0 - before.0) * (point.1 + before.1);
            before = point;
        }
        libm::sqrt(sum)
    }
}

/// Returns the degrees of freedom of a mean over half-overlapping segments with Hann's window.
pub fn hann_degrees_of_freedom(segments: usize) -> f64 {
    // The correlation of Hann segments depends on the overlap alone, for any length that is a multiple of 4.
    Segments::hann(8).degrees_of_freedom(&[segments])
}

/// Returns the range, dB, in which 95 % of the lines of a perfect controller lie.
pub fn perfect_db(degrees_of_freedom: f64) -> [f64; 2] {
    [0.025, 0.975].map(|probability| {
        10.0 * libm::log10(chi_square_quantile(probability, degrees_of_freedom) / degrees_of_freedom)
    })
}
