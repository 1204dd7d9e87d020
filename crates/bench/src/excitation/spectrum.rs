//! Shape of a power spectral density, as vibration tests specify it.

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use super::error::ExcitationError;

/// Largest number of breakpoints; the tables of test standards have some tens at most.
const MOST_BREAKPOINTS: usize = 1000;

/// Breakpoints (frequency in Hz, level) of a power spectral density, with straight lines between them on logarithmic
/// axes, as in vibration tests (IEC 60068-2-64). Only the ratios of the levels count: the amplitude sets the scale.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Spectrum(pub Vec<[f64; 2]>);

impl Spectrum {
    /// Checks the breakpoints: 2 to 1000, with positive levels and frequencies that increase from `from_hz` to
    /// `to_hz`.
    pub(super) fn check(&self, from_hz: f64, to_hz: f64) -> Result<(), ExcitationError> {
        let Spectrum(points) = self;
        let ([first_hz, _], [last_hz, _]) = match points.as_slice() {
            [first, .., last] if points.len() <= MOST_BREAKPOINTS => (*first, *last),
            _ => return Err(ExcitationError::Breakpoints { got: points.len(), most: MOST_BREAKPOINTS }),
        };
        for [hz, level] in points.iter().copied() {
            if !(level.is_finite() && level > 0.0) {
                return Err(ExcitationError::Level { hz, level });
            }
        }
        // Written with the comparison that must hold, so that NaN counts as a violation.
        let rises = |pair: &&[[f64; 2]]| pair[0][0] < pair[1][0];
        if let Some(pair) = points.windows(2).find(|pair| !rises(pair)) {
            return Err(ExcitationError::BreakpointOrder { before_hz: pair[0][0], hz: pair[1][0] });
        }
        for (name, band_hz, hz) in [("from_hz", from_hz, first_hz), ("to_hz", to_hz, last_hz)] {
            if hz != band_hz {
                return Err(ExcitationError::BreakpointEnd { name, band_hz, hz });
            }
        }
        Ok(())
    }

    /// Returns the level at a frequency of the band: ln L is linear in ln f between breakpoints.
    pub(super) fn level(&self, hz: f64) -> f64 {
        let Spectrum(points) = self;
        let last = points.len().saturating_sub(2);
        let segment = points.partition_point(|[point_hz, _]| *point_hz <= hz).saturating_sub(1).min(last);
        let pair = points.get(segment..segment + 2).and_then(|pair| <[[f64; 2]; 2]>::try_from(pair).ok());
        let Some([[f1, l1], [f2, l2]]) = pair else { return 1.0 };
        // Clamped, as a line may lie beyond the band by rounding.
        let part = (libm::log(hz / f1) / libm::log(f2 / f1)).clamp(0.0, 1.0);
        libm::exp(libm::log(l1) * (1.0 - part) + libm::log(l2) * part)
    }
}
