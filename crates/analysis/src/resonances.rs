//! Resonances on a branch over the frequency, with their widths.

use alloc::vec::Vec;
use core::f64::consts::FRAC_1_SQRT_2;

use super::orbit::{Branch, BranchOptions};
use super::{AnalysisError, Coordinate, ForcedArm, trace};
use resonarm_dynamics::arm::{Arm, Load};

/// The forced motions of an arm are computed this far beyond the frequencies of interest: a part of their distance, and
/// at least a part of the highest.
const MARGIN: [f64; 2] = [0.15, 1e-3];

/// The forced motions of an arm around two frequencies, Hz, which may be equal, in steps that turn by
/// `largest_turn_rad` at most.
///
/// # Errors
/// [`AnalysisError`] if the branch can't be followed from one end to the other.
pub fn response_around(
    arm: &Arm,
    load: &Load,
    [a_hz, b_hz]: [f64; 2],
    largest_turn_rad: f64,
) -> Result<Branch, AnalysisError> {
    let (low_hz, high_hz) = (a_hz.min(b_hz), a_hz.max(b_hz));
    let margin_hz = (MARGIN[0] * (high_hz - low_hz)).max(MARGIN[1] * high_hz);
    let mut options = BranchOptions::new(low_hz - margin_hz, high_hz + margin_hz);
    options.continuation.largest_turn_rad = largest_turn_rad;
    let forced = ForcedArm::new(arm.clone(), *load, 1.0);
    Ok(trace(forced, options.from, Coordinate::FrequencyHz, &options)?)
}

/// A maximum of an amplitude along a curve over the frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Summit {
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// The amplitude.
    pub amplitude: f64,
    /// The ends of the band around it in which the amplitude is at least 1/√2 of that, Hz.
    pub band_hz: [f64; 2],
}

impl Summit {
    /// The width of the band, Hz.
    pub fn width_hz(&self) -> f64 {
        self.band_hz[1] - self.band_hz[0]
    }

    /// Whether none of these frequencies lies in the band.
    pub fn is_missed_by(&self, frequencies_hz: &[f64]) -> bool {
        let [low, high] = self.band_hz;
        !frequencies_hz.iter().any(|hz| (low..=high).contains(hz))
    }
}

/// The maxima of a curve, frequency in Hz and amplitude, from which it falls to less than 1/√2 on both sides.
pub(crate) fn summits(curve: &[(f64, f64)]) -> Vec<Summit> {
    let is_summit = |k: &usize| curve[*k].1 > curve[k - 1].1 && curve[*k].1 >= curve[k + 1].1;
    let summit = |k: usize| {
        let (top, level) = (curve[k], FRAC_1_SQRT_2 * curve[k].1);
        let ends = [falls(top, curve[..k].iter().rev(), level)?, falls(top, curve[k..].iter(), level)?];
        let band_hz = [ends[0][0].min(ends[1][0]), ends[0][1].max(ends[1][1])];
        Some(Summit { frequency_hz: top.0, amplitude: top.1, band_hz })
    };
    (1..curve.len().saturating_sub(1)).filter(is_summit).filter_map(summit).collect()
}

/// The least and the largest frequency on the way down from a summit to `level`; none if it rises above the summit
/// before.
fn falls<'a>(top: (f64, f64), way: impl Iterator<Item = &'a (f64, f64)>, level: f64) -> Option<[f64; 2]> {
    let [mut low, mut high] = [top.0; 2];
    let mut last = top;
    for &point in way {
        if point.1 > top.1 {
            return None;
        }
        let below = point.1 < level;
        let part = if below { (last.1 - level) / (last.1 - point.1) } else { 1.0 };
        let hz = last.0 + part * (point.0 - last.0);
        (low, high) = (low.min(hz), high.max(hz));
        if below {
            return Some([low, high]);
        }
        last = point;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::arm_at;
    use resonarm_dynamics::arm::Preset;

    #[test]
    fn a_response_around_one_frequency_goes_a_thousandth_beyond_it() {
        let arm = arm_at(Preset::Irb1600Fitted, 0.0, 60.0);
        let branch = response_around(&arm, &Load::torque_nm(1e-3, 0.0), [30.0; 2], 0.1).unwrap();
        let ends = [branch.orbits.first(), branch.orbits.last()].map(|orbit| orbit.unwrap().frequency_hz);
        assert!((ends[0] - 29.97).abs() < 1e-9 && (ends[1] - 30.03).abs() < 1e-9, "{ends:?}");
    }
}
