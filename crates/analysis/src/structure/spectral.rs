//! The derivative of a signal's Fourier coefficients by those of the motion.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use super::samples::Samples;

/// 2/T ∫ f cos kτ and 2/T ∫ f sin kτ of one signal, k = 0 … 2H.
#[derive(Clone, Debug, Default)]
struct Line {
    cosines: Vec<f64>,
    sines: Vec<f64>,
}

impl Line {
    /// Of a signal; none if it is zero everywhere.
    fn of(samples: &Samples, signal: &[f64], harmonics: usize) -> Option<Line> {
        let first = signal[0];
        let constant = signal.iter().all(|value| *value == first);
        if constant && first == 0.0 {
            return None;
        }
        let mut line = Line { cosines: vec![0.0; 2 * harmonics + 1], sines: vec![0.0; 2 * harmonics + 1] };
        line.cosines[0] = 2.0 * if constant { first } else { signal.iter().sum::<f64>() / signal.len() as f64 };
        if !constant {
            for k in 1..=2 * harmonics {
                (line.cosines[k], line.sines[k]) = samples.basis.project(k - 1, signal);
            }
        }
        Some(line)
    }
}

/// The coefficients of a signal: its mean, then those of cos kτ and sin kτ, k = 1 … H.
pub(super) fn project(samples: &Samples, signal: &[f64], harmonics: usize, mut out: impl FnMut(usize, f64)) {
    out(0, signal.iter().sum::<f64>() / signal.len() as f64);
    for k in 1..=harmonics {
        let (c, s) = samples.basis.project(k - 1, signal);
        out(2 * k - 1, c);
        out(2 * k, s);
    }
}

/// ∂Q̂/∂X of the samples without the states' part, m (2H + 1) square, column by column.
///
/// A column of cos lτ makes the signal U cos lτ − V sin lτ and one of sin lτ makes U sin lτ + V cos lτ, with U = S −
/// l²Ω²M and V = lΩG. With A and B the lines of a signal, its product with cos lτ has along cos kτ and sin kτ the
/// components ½(A|k−l| + A_k+l) and ½(B_k+l ± B|k−l|), that with sin lτ ½(B_k+l ∓ B|k−l|) and ½(A|k−l| − A_k+l), the
/// upper sign for k > l; along 1 half of the first of each.
pub(super) fn operator(samples: &Samples, unknowns: usize, harmonics: usize, omega_rad_s: f64, matrix: &mut [f64]) {
    let (m, size) = (unknowns, unknowns * (2 * harmonics + 1));
    matrix[..size * size].fill(0.0);
    let count = samples.count();
    for pair in 0..m * m {
        let lines: [Option<Line>; 3] =
            core::array::from_fn(|d| Line::of(samples, &samples.by[d][pair * count..(pair + 1) * count], harmonics));
        if lines.iter().all(Option::is_none) {
            continue;
        }
        let (i, j) = (pair / m, pair % m);
        for l in 0..=harmonics {
            let rate = l as f64 * omega_rad_s;
            let (u, v) = combine(&lines, rate, harmonics);
            for k in 0..=harmonics {
                let block = product(&u, &v, k, l);
                for (c, column) in block.iter().enumerate().skip(usize::from(l == 0)) {
                    for (r, value) in column.iter().enumerate().skip(usize::from(k == 0)) {
                        let row = (2 * k + r).saturating_sub(1) * m + i;
                        let at = (2 * l + c).saturating_sub(1) * m + j;
                        matrix[at * size + row] += value;
                    }
                }
            }
        }
    }
}

/// U and V at a rate l Ω.
fn combine(lines: &[Option<Line>; 3], rate: f64, harmonics: usize) -> (Line, Line) {
    let zero = || Line { cosines: vec![0.0; 2 * harmonics + 1], sines: vec![0.0; 2 * harmonics + 1] };
    let (mut u, mut v) = (zero(), zero());
    let targets = [(0, 1.0), (1, rate), (2, -rate * rate)];
    for (which, factor) in targets {
        let Some(line) = &lines[which] else { continue };
        let target = if which == 1 { &mut v } else { &mut u };
        target.cosines.iter_mut().zip(&line.cosines).for_each(|(t, s)| *t += factor * s);
        target.sines.iter_mut().zip(&line.sines).for_each(|(t, s)| *t += factor * s);
    }
    (u, v)
}

/// The columns of cos lτ and sin lτ, each along cos kτ and sin kτ; for l = 0 the second is that of 1, and for k = 0 the
/// second entry that along 1.
fn product(u: &Line, v: &Line, k: usize, l: usize) -> [[f64; 2]; 2] {
    let (sum, difference) = (k + l, k.abs_diff(l));
    let sign = if k > l { 1.0 } else { -1.0 };
    let by_cosine = |f: &Line| {
        let (a, b) = (f.cosines[difference] + f.cosines[sum], f.sines[sum] + sign * f.sines[difference]);
        [0.5 * a, 0.5 * b]
    };
    let by_sine = |f: &Line| {
        let (a, b) = (f.sines[sum] - sign * f.sines[difference], f.cosines[difference] - f.cosines[sum]);
        [0.5 * a, 0.5 * b]
    };
    let [uc, us, vc, vs] = [by_cosine(u), by_sine(u), by_cosine(v), by_sine(v)];
    let mut columns = [[uc[0] - vs[0], uc[1] - vs[1]], [us[0] + vc[0], us[1] + vc[1]]];
    if l == 0 {
        columns[1] = columns[0];
    }
    if k == 0 {
        columns.iter_mut().for_each(|column| column[1] = 0.5 * column[0]);
    }
    columns
}

/// The largest |x(τ)| of a series of one signal, with as many frequencies as the samples' functions at most: the
/// highest samples, each polished by Newton's method on x′ = 0.
pub(super) fn largest(samples: &Samples, series: &[f64]) -> f64 {
    let count = samples.count();
    let mut signal = vec![series[0]; count];
    for (k, pair) in series[1..].chunks_exact(2).enumerate() {
        let (cosines, sines) = samples.basis.tables(k);
        let tables = cosines.iter().zip(sines);
        signal.iter_mut().zip(tables).for_each(|(value, (c, s))| *value += pair[0] * c + pair[1] * s);
    }
    signal.iter_mut().for_each(|value| *value = value.abs());
    let highest = signal.iter().fold(0.0_f64, |highest, value| highest.max(*value));
    let is_peak = |j: &usize| {
        let [before, after] = [signal[(j + count - 1) % count], signal[(j + 1) % count]];
        signal[*j] >= PEAK_SHARE * highest && signal[*j] >= before && signal[*j] >= after
    };
    let peaks = (0..count).filter(is_peak).map(|j| polished(series, TAU * j as f64 / count as f64, count));
    peaks.fold(highest, f64::max)
}

/// Samples below this fraction of the highest are next to no largest value: see `crate::fourier::largest`.
const PEAK_SHARE: f64 = 0.69;
/// Steps of Newton's method to a peak.
const PEAK_STEPS: usize = 4;

/// The height of the peak next to a phase of a grid.
fn polished(series: &[f64], mut phase_rad: f64, samples: usize) -> f64 {
    let spacing = TAU / samples as f64;
    let [mut value, mut slope, mut curvature] = values(series, phase_rad);
    for _ in 0..PEAK_STEPS {
        if curvature == 0.0 {
            break;
        }
        phase_rad += (-slope / curvature).clamp(-spacing, spacing);
        let [x, v, a] = values(series, phase_rad);
        if x.abs() < value.abs() {
            break;
        }
        (value, slope, curvature) = (x, v, a);
    }
    value.abs()
}

/// x, x′ and x″ of a series at a phase; multiples of the angle by rotation.
fn values(series: &[f64], phase_rad: f64) -> [f64; 3] {
    let (sine, cosine) = libm::sincos(phase_rad);
    let (mut c, mut s, mut sum) = (1.0, 0.0, [series[0], 0.0, 0.0]);
    for (i, pair) in series[1..].chunks_exact(2).enumerate() {
        (c, s) = (c * cosine - s * sine, s * cosine + c * sine);
        let (k, value) = ((i + 1) as f64, pair[0] * c + pair[1] * s);
        sum[0] += value;
        sum[1] += k * (pair[1] * c - pair[0] * s);
        sum[2] -= k * k * value;
    }
    sum
}
