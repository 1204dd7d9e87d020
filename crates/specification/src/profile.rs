//! Levels over frequency that are straight between breakpoints over logarithmic axes.
//!
//! Between (f₁, P₁) and (f₂, P₂) the level is P₁ (f/f₁)ⁿ with n = ln(P₂/P₁)/ln(f₂/f₁). A slope of s dB/octave of a power is n =
//! s/(10 log₁₀ 2), of an amplitude s/(20 log₁₀ 2): 3 dB/octave of a density is n = 0.9966, not 1.

use alloc::vec::Vec;
use core::f64::consts::{LOG10_2, TAU};

use serde::{Deserialize, Serialize};

use crate::error::{Place, SpecificationError};

/// Breakpoint of a file: a point, or a slope that leads from the first point down or from the last one up.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "expected a breakpoint [Hz, level], or a slope { from_hz, db_octave } at the start or { to_hz, db_octave } behind a point"
)]
pub(crate) enum Corner {
    /// Frequency, Hz, and level.
    Point([f64; 2]),
    /// The level rises from this frequency by a slope to the next point.
    From { from_hz: f64, db_octave: f64 },
    /// The level continues from the point before by a slope to this frequency.
    To { to_hz: f64, db_octave: f64 },
}

/// Kind of the levels of a profile, which relates them to dB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    /// Powers and densities: 10 log₁₀ of a ratio.
    Power,
    /// Amplitudes: 20 log₁₀ of a ratio.
    Amplitude,
}

impl Level {
    /// Returns the exponent of a slope in dB/octave.
    fn exponent(self, db_octave: f64) -> f64 {
        let db = if self == Level::Power { 10.0 } else { 20.0 };
        db_octave / (db * LOG10_2)
    }
}

/// A level over frequency, straight between its points over logarithmic axes; beyond its ends it is not defined.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Profile {
    /// Frequencies, Hz, rising, and levels, positive: at least two.
    points: Vec<[f64; 2]>,
}

impl Profile {
    /// Makes a profile of its points: frequencies, Hz, positive and rising, and positive levels.
    ///
    /// # Errors
    /// [`SpecificationError`] names the first point that does not fit, as of the list `breakpoints`.
    pub fn new(points: &[[f64; 2]]) -> Result<Profile, SpecificationError> {
        let corners: Vec<Corner> = points.iter().map(|point| Corner::Point(*point)).collect();
        Profile::of_corners(&corners, Level::Power, 1.0, Place { section: "random", key: "breakpoints" })
    }

    /// Makes a profile of the corners of a file, whose levels are multiplied by `factor`.
    pub(crate) fn of_corners(
        corners: &[Corner],
        level: Level,
        factor: f64,
        place: Place,
    ) -> Result<Profile, SpecificationError> {
        if corners.len() < 2 {
            return Err(SpecificationError::TooShort { place, got: corners.len(), least: 2 });
        }
        let frequency = |corner: &Corner| match *corner {
            Corner::Point([hz, _]) | Corner::From { from_hz: hz, .. } | Corner::To { to_hz: hz, .. } => hz,
        };
        let mut before = 0.0;
        for (corner, number) in corners.iter().zip(1..) {
            let hz = frequency(corner);
            let rises = hz > before && hz.is_finite();
            place.check(number, "the frequency, Hz,", hz, rises, "positive and above the one before")?;
            before = hz;
            match *corner {
                Corner::Point([_, value]) => place.check_positive(number, "the level", value)?,
                Corner::From { db_octave, .. } | Corner::To { db_octave, .. } => {
                    let is_valid = db_octave.abs() <= MOST_DB_OCTAVE;
                    place.check(number, "the slope, dB/octave,", db_octave, is_valid, "from -200 to 200")?;
                }
            }
        }
        let lost = |number, slope, side| Err(SpecificationError::Slope { place, number, slope, side });
        let mut points: Vec<[f64; 2]> = Vec::with_capacity(corners.len());
        for (index, corner) in corners.iter().enumerate() {
            let by_slope = |[hz, value]: [f64; 2], db_octave, to_hz: f64| {
                [to_hz, value * libm::pow(to_hz / hz, level.exponent(db_octave))]
            };
            let point = match *corner {
                Corner::Point([hz, value]) => [hz, factor * value],
                Corner::From { from_hz, db_octave } => match corners.get(index + 1) {
                    Some(Corner::Point([hz, value])) => by_slope([*hz, factor * value], db_octave, from_hz),
                    _ => return lost(index + 1, "from_hz", "after"),
                },
                Corner::To { to_hz, db_octave } => match points.last() {
                    Some(last) => by_slope(*last, db_octave, to_hz),
                    None => return lost(1, "to_hz", "before"),
                },
            };
            place.check_positive(index + 1, "the level by the slope", point[1])?;
            points.push(point);
        }
        Ok(Profile { points })
    }

    /// Returns the points: frequencies, Hz, and levels.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// Returns the lowest and the highest frequency, Hz.
    pub fn band_hz(&self) -> [f64; 2] {
        match (self.points.first(), self.points.last()) {
            (Some([from_hz, _]), Some([to_hz, _])) => [*from_hz, *to_hz],
            _ => [0.0; 2],
        }
    }

    /// Returns the level at a frequency, Hz; `None` beyond the ends of the profile.
    pub fn at(&self, hz: f64) -> Option<f64> {
        let [from_hz, to_hz] = self.band_hz();
        // Frequencies of lines are rounded.
        if !(hz >= from_hz * (1.0 - ROUNDING) && hz <= to_hz * (1.0 + ROUNDING)) {
            return None;
        }
        let above = self.points.iter().position(|[point_hz, _]| *point_hz >= hz).unwrap_or(self.points.len() - 1);
        // The first point ends no segment, so that the first segment holds there.
        let [[f1, p1], [f2, p2]] = [self.points[above.max(1) - 1], self.points[above.max(1)]];
        Some(p1 * libm::pow(hz / f1, libm::log(p2 / p1) / libm::log(f2 / f1)))
    }

    /// Returns ∫ P(f) (2πf)ᵏ df over the profile. Of a density of acceleration, k = 0 gives the mean square of acceleration,
    /// −2 of velocity, −4 of displacement.
    ///
    /// With the exponent n of a segment, m = n + k + 1, q = P₁ (2πf₁)ᵏ and L = ln(f₂/f₁), a segment gives q f₁ (e^(mL) − 1)/m,
    /// which tends to q f₁ L for m → 0.
    pub fn moment(&self, k: i32) -> f64 {
        let segment = |pair: &[[f64; 2]]| {
            let [[f1, p1], [f2, p2]] = [pair[0], pair[1]];
            let octaves = libm::log(f2 / f1);
            let m = libm::log(p2 / p1) / octaves + f64::from(k) + 1.0;
            let q = p1 * libm::pow(TAU * f1, f64::from(k));
            let stretch = if (m * octaves).abs() < 1e-12 { octaves } else { libm::expm1(m * octaves) / m };
            q * f1 * stretch
        };
        self.points.windows(2).map(segment).sum()
    }

    /// Returns the statistical bandwidth B = (∫G df)²/∫G² df, Hz: over T s, the mean square of noise with this density scatters as
    /// that of 2BT independent values (J. S. Bendat, A. G. Piersol, "Random Data", 4th edition 2010, section 8.3).
    pub fn statistical_bandwidth_hz(&self) -> f64 {
        let squares = Profile { points: self.points.iter().map(|[hz, level]| [*hz, level * level]).collect() };
        let mean_square = self.moment(0);
        mean_square * mean_square / squares.moment(0)
    }
}

/// Relative rounding of the frequency of a line.
const ROUNDING: f64 = 1e-9;
/// Largest slope that a profile may have, dB/octave.
const MOST_DB_OCTAVE: f64 = 200.0;
