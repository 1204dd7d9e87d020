//! Resonances on a curve over the frequency, with their widths.

use alloc::vec::Vec;
use core::f64::consts::FRAC_1_SQRT_2;

/// A maximum of an amplitude along a curve over the frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Summit {
    /// Frequency of the resonance, Hz.
    pub frequency_hz: f64,
    /// Amplitude at the resonance.
    pub amplitude: f64,
    /// The ends of the band around it in which the amplitude is at least 1/√2 of that, Hz.
    pub band_hz: [f64; 2],
}

impl Summit {
    /// The width of the band, Hz.
    pub fn width_hz(&self) -> f64 {
        self.band_hz[1] - self.band_hz[0]
    }

    /// Says whether none of these frequencies lies in the band.
    pub fn is_missed_by(&self, frequencies_hz: &[f64]) -> bool {
        let [low, high] = self.band_hz;
        !frequencies_hz.iter().any(|hz| (low..=high).contains(hz))
    }
}

/// The maxima of a curve, frequency in Hz and amplitude, from which it falls to less than 1/√2 on both sides.
pub(crate) fn summits(curve: &[(f64, f64)]) -> Vec<Summit> {
    let is_summit = |k: &usize| curve[*k].1 > curve[k - 1].1 && curve[*k].1 >= curve[k + 1].1;
    let summit = |k: usize| {
        let top = curve[k];
        let level = FRAC_1_SQRT_2 * curve[k].1;
        let ends = [falls(top, curve[..k].iter().rev(), level)?, falls(top, curve[k..].iter(), level)?];
        let band_hz = [ends[0][0].min(ends[1][0]), ends[0][1].max(ends[1][1])];
        Some(Summit { frequency_hz: top.0, amplitude: top.1, band_hz })
    };
    (1..curve.len().saturating_sub(1)).filter(is_summit).filter_map(summit).collect()
}

/// Returns the least and the largest frequency on the way down from a summit to `level`; `None` if the curve rises
/// above the summit before.
fn falls<'a>(top: (f64, f64), way: impl Iterator<Item = &'a (f64, f64)>, level: f64) -> Option<[f64; 2]> {
    let [mut low, mut high] = [top.0; 2];
    let mut last = top;
    for &point in way {
        if point.1 > top.1 {
            return None;
        }
        let below = point.1 < level;
        // Where the straight line between two points crosses the level.
        let part = if below { (last.1 - level) / (last.1 - point.1) } else { 1.0 };
        let hz = last.0 + part * (point.0 - last.0);
        low = low.min(hz);
        high = high.max(hz);
        if below {
            return Some([low, high]);
        }
        last = point;
    }
    None
}
