//! Maxima and widths of curves: an amplitude, rad, over a frequency, Hz, point by point; a curve may turn back in
//! frequency.

use alloc::vec::Vec;

/// A maximum of an amplitude along a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maximum {
    /// Frequency of the maximum, Hz.
    pub frequency_hz: f64,
    /// Amplitude at the maximum, rad.
    pub amplitude_rad: f64,
    /// The amount by which the amplitude falls before it rises higher again, on the side where it falls less, relative
    /// to the height.
    pub prominence: f64,
}

/// The maxima of a curve, its ends excluded, the highest first.
pub fn maxima(curve: &[(f64, f64)]) -> Vec<Maximum> {
    // Strict on one side only: of two equal neighbours at the top the first counts, and only once.
    let summit = |i: &usize| curve[*i].1 > curve[i - 1].1 && curve[*i].1 >= curve[i + 1].1;
    let inner = 1..curve.len().saturating_sub(1);
    let maximum = |i: usize| {
        let [frequency_hz, amplitude_rad] = vertex([curve[i - 1], curve[i], curve[i + 1]]);
        Maximum { frequency_hz, amplitude_rad, prominence: prominence(curve, i) }
    };
    let mut maxima: Vec<Maximum> = inner.filter(summit).map(maximum).collect();
    maxima.sort_by(|a, b| b.amplitude_rad.total_cmp(&a.amplitude_rad));
    maxima
}

/// The width of a resonance, Hz: of the frequencies at which the amplitude is more than 1/√2 of the highest maximum of
/// `curve`; none if there is no maximum. `all` has the points of the curve and may have more, which are not used for
/// interpolation.
pub fn half_power_width_hz(curve: &[(f64, f64)], all: &[(f64, f64)]) -> Option<f64> {
    let level = maxima(curve).first()?.amplitude_rad * core::f64::consts::FRAC_1_SQRT_2;
    let mut low = f64::INFINITY;
    let mut high = f64::NEG_INFINITY;
    let mut take = |hz: f64| (low, high) = (low.min(hz), high.max(hz));
    // All points above the level are inside the width; the crossings then take both ends outwards to the level itself.
    all.iter().filter(|point| point.1 >= level).for_each(|point| take(point.0));
    for (i, pair) in curve.windows(2).enumerate() {
        if (pair[0].1 < level) != (pair[1].1 < level) {
            take(crossing(curve, i, level));
        }
    }
    Some(high - low)
}

/// Returns the amount by which the curve falls from a summit before it rises above it, on the side where it falls less,
/// relative to its height.
fn prominence(curve: &[(f64, f64)], summit: usize) -> f64 {
    let height = curve[summit].1;
    let lowest = |low: f64, point: &(f64, f64)| low.min(point.1);
    let before = curve[..summit].iter().rev().take_while(|point| point.1 <= height).fold(height, lowest);
    let after = curve[summit + 1..].iter().take_while(|point| point.1 <= height).fold(height, lowest);
    1.0 - before.max(after) / height
}

/// Returns the top of the curve through three points whose middle one is the highest: both coordinates are quadratic in
/// the number of the step, y(t) = y₀ + (y₊ − y₋) t/2 + (y₊ − 2y₀ + y₋) t²/2. The continuation takes steps of almost
/// equal length; lengths in this plane would not do, since a leaning peak returns through the frequencies at which it
/// rose. The top is above the middle point by an eighth of the larger fall to its neighbours at most.
fn vertex([before, middle, after]: [(f64, f64); 3]) -> [f64; 2] {
    let quadratic = |of: fn(&(f64, f64)) -> f64| {
        let [low, centre, high] = [&before, &middle, &after].map(of);
        (centre, (high - low) / 2.0, (high - 2.0 * centre + low) / 2.0)
    };
    let (hz, rad) = (quadratic(|point| point.0), quadratic(|point| point.1));
    // A summit has a negative second difference unless rounding cancels it, and then the middle point is as good as
    // any.
    let t = if rad.2 < 0.0 { -rad.1 / (2.0 * rad.2) } else { 0.0 };
    [hz, rad].map(|(value, slope, half_curvature)| value + t * (slope + t * half_curvature))
}

/// The frequency at which a curve passes a level between points `i` and `i + 1`: by the cubic through these and their
/// neighbours, if the amplitude is monotonic through all four and the cubic stays between the two, otherwise by the
/// chord.
fn crossing(curve: &[(f64, f64)], i: usize, level: f64) -> f64 {
    let through = |points: &[(f64, f64)]| -> f64 {
        let weight = |k: usize| -> f64 {
            let others = points.iter().enumerate().filter(|(j, _)| *j != k);
            others.map(|(_, other)| (level - other.1) / (points[k].1 - other.1)).product()
        };
        points.iter().enumerate().map(|(k, point)| point.0 * weight(k)).sum()
    };
    let one_way = |points: &&[(f64, f64)]| {
        let rises = points.windows(2).filter(|pair| pair[1].1 > pair[0].1).count();
        let falls = points.windows(2).filter(|pair| pair[1].1 < pair[0].1).count();
        rises == 3 || falls == 3
    };
    let pair = &curve[i..i + 2];
    let between = |hz: &f64| (pair[0].0.min(pair[1].0)..=pair[0].0.max(pair[1].0)).contains(hz);
    let four = i.checked_sub(1).and_then(|first| curve.get(first..first + 4));
    four.filter(one_way).map(through).filter(between).unwrap_or_else(|| through(pair))
}
