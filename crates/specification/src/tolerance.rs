//! Tolerances over frequency, in dB.

use alloc::vec;
use alloc::vec::Vec;

use serde::Serialize;

use crate::error::{Place, SpecificationError};

/// Tolerance that holds from a frequency on, up to the next one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ToleranceBand {
    /// Frequency from which on it holds, Hz.
    pub from_hz: f64,
    /// Lowest deviation, dB, negative.
    pub low_db: f64,
    /// Highest deviation, dB, positive.
    pub high_db: f64,
}

/// Lower and upper tolerance, which may depend on the frequency.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Tolerance {
    bands: Vec<ToleranceBand>,
}

impl Tolerance {
    /// Makes a tolerance that holds at every frequency, dB.
    pub fn everywhere([low_db, high_db]: [f64; 2]) -> Tolerance {
        Tolerance { bands: vec![ToleranceBand { from_hz: 0.0, low_db, high_db }] }
    }

    /// Checks the bands of a file: the frequencies rise, and 0 dB is within each.
    pub(crate) fn of_bands(bands: Vec<ToleranceBand>, place: Place) -> Result<Tolerance, SpecificationError> {
        if bands.is_empty() {
            return Err(SpecificationError::TooShort { place, got: 0, least: 1 });
        }
        let mut before = f64::NEG_INFINITY;
        for (&ToleranceBand { from_hz, low_db, high_db }, number) in bands.iter().zip(1..) {
            // Written so that a number that is not finite fails each check.
            let rises = from_hz >= 0.0 && from_hz > before && from_hz.is_finite();
            place.check(number, "the frequency, Hz,", from_hz, rises, "at least 0 and above the one before")?;
            let is_below = low_db < 0.0 && low_db.is_finite();
            place.check(number, "the lower end, dB,", low_db, is_below, "a negative number")?;
            place.check_positive(number, "the upper end, dB,", high_db)?;
            before = from_hz;
        }
        Ok(Tolerance { bands })
    }

    /// Returns the bands, by rising frequency.
    pub fn bands(&self) -> &[ToleranceBand] {
        &self.bands
    }

    /// Returns the lowest and the highest deviation at a frequency, dB. Below the first band its tolerance holds.
    pub fn at(&self, hz: f64) -> [f64; 2] {
        let above = self.bands.iter().rposition(|band| band.from_hz <= hz).unwrap_or(0);
        let band = self.bands[above];
        [band.low_db, band.high_db]
    }
}
