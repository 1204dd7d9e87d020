//! Shocks that are specified by their shock response spectrum.

use alloc::string::String;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use serde::Serialize;

use crate::GRAVITY_M_S2;
use crate::csv::corners;
use crate::error::{Place, SpecificationError, idle, missing};
use crate::file::{AccelerationUnit, SrsSection, ToleranceEntry, any_share, checked, positive};
use crate::profile::{Level, Profile};
use crate::shock::{Shots, full_level_shots, shots};
use crate::tolerance::Tolerance;

const SECTION: &str = "srs";

/// A shock that is specified by the largest absolute accelerations of oscillators, to either side (maximax).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SrsTest {
    /// Unit in which the file states accelerations.
    pub unit: AccelerationUnit,
    /// Quality Q = 1/2ζ of the oscillators.
    pub quality: f64,
    /// Shock response spectrum, m/s².
    pub profile: Profile,
    /// Tolerance of the share of the lines.
    pub tolerance: Tolerance,
    /// Share of the lines that must be within the tolerance, by default 1.
    pub share: f64,
    /// Tolerance of the other lines; none if the share is 1.
    pub rest_tolerance: Option<Tolerance>,
    /// Natural frequencies in an octave.
    pub lines_per_octave: f64,
    /// Shots in turn, if they are stated.
    pub shots: Vec<Shots>,
}

/// What a shock response spectrum asks of a structure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SrsFigures {
    /// Number of natural frequencies at which the spectrum is judged.
    pub lines: usize,
    /// Largest acceleration of an oscillator, m/s².
    pub largest_m_s2: f64,
    /// Largest pseudo-velocity, the acceleration over 2πf, m/s.
    pub pseudo_velocity_m_s: f64,
    /// Least sample rate, Hz, ten times the highest natural frequency: a peak between two samples is then at most 5 % higher.
    pub least_rate_hz: f64,
    /// Number of shots at full level.
    pub shots: u32,
}

impl SrsTest {
    pub(crate) fn new(
        section: &SrsSection,
        read: &mut dyn FnMut(&str) -> Result<String, String>,
    ) -> Result<SrsTest, SpecificationError> {
        let factor = match section.unit {
            AccelerationUnit::Si => 1.0,
            AccelerationUnit::Gravity => GRAVITY_M_S2,
        };
        let place = |key| Place { section: SECTION, key };
        let corners = corners(SECTION, section.breakpoints.as_deref(), section.file.as_deref(), read)?;
        let bands = |key, entry: &ToleranceEntry| Tolerance::of_bands(entry.bands(), place(key));
        let share = any_share(SECTION, "share", section.share)?.unwrap_or(1.0);
        let rest = section.rest_tolerance_db.as_ref();
        let rest_key = "rest_tolerance_db";
        if rest.is_none() && share < 1.0 {
            return Err(missing(SECTION, Some(rest_key), "it holds for the lines beyond `share`"));
        }
        if rest.is_some() && share == 1.0 {
            let why = "all lines must be within `tolerance_db`, since `share` is 1";
            return Err(idle(SECTION, Some(rest_key), why));
        }
        Ok(SrsTest {
            unit: section.unit,
            quality: checked(SECTION, "q", section.q, |q| q > 0.5, "above 0.5")?,
            profile: Profile::of_corners(&corners, Level::Amplitude, factor, place("breakpoints"))?,
            tolerance: bands("tolerance_db", &section.tolerance_db)?,
            share,
            rest_tolerance: rest.map(|entry| bands(rest_key, entry)).transpose()?,
            lines_per_octave: checked(
                SECTION,
                "lines_per_octave",
                positive(SECTION, "lines_per_octave", section.lines_per_octave)?,
                |lines| (1.0..=192.0).contains(&lines),
                "from 1 to 192",
            )?,
            shots: shots(SECTION, section.shots.as_deref())?,
        })
    }

    /// Returns the natural frequencies of the lines, Hz, from the lowest frequency on, with the highest one.
    pub fn frequencies_hz(&self) -> Vec<f64> {
        let [from_hz, to_hz] = self.profile.band_hz();
        // The small number keeps a whole number of steps from being rounded down.
        let steps = libm::floor(libm::log2(to_hz / from_hz) * self.lines_per_octave + 1e-9) as usize;
        let line = |k: usize| (from_hz * libm::exp2(k as f64 / self.lines_per_octave)).min(to_hz);
        let mut lines: Vec<f64> = (0..=steps).map(line).collect();
        if lines.last().is_some_and(|last| *last < to_hz * (1.0 - 1e-9)) {
            lines.push(to_hz);
        }
        lines
    }

    /// Returns what the spectrum asks of a structure.
    pub fn figures(&self) -> SrsFigures {
        // Both are largest at a breakpoint, since they are powers of the frequency between them.
        let largest = |of: &dyn Fn(&[f64; 2]) -> f64| self.profile.points().iter().map(of).fold(0.0, f64::max);
        let [_, to_hz] = self.profile.band_hz();
        SrsFigures {
            lines: self.frequencies_hz().len(),
            largest_m_s2: largest(&|[_, level]| *level),
            pseudo_velocity_m_s: largest(&|[hz, level]| level / (TAU * hz)),
            least_rate_hz: 10.0 * to_hz,
            shots: full_level_shots(&self.shots),
        }
    }
}
