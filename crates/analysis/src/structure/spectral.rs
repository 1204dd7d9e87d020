//! The derivative of a signal's Fourier coefficients by those of the motion.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use super::samples::Samples;

/// 2/T ∫ f cos kτ and 2/T ∫ f sin kτ of one signal, k = −2H … 2H, at the place k + 2H: the cosines are even in k, the
/// sines odd.
#[derive(Clone, Debug)]
struct Line {
    cosines: Vec<f64>,
    sines: Vec<f64>,
}

impl Line {
    fn new(harmonics: usize) -> Line {
        Line { cosines: vec![0.0; 4 * harmonics + 1], sines: vec![0.0; 4 * harmonics + 1] }
    }

    /// Becomes that of a signal; returns whether the signal is other than zero anywhere.
    fn transform(&mut self, samples: &Samples, signal: &[f64]) -> bool {
        let (first, middle) = (signal[0], self.cosines.len() / 2);
        let constant = signal.iter().all(|value| *value == first);
        if constant {
            self.cosines.fill(0.0);
            self.sines.fill(0.0);
        }
        self.cosines[middle] = 2.0 * if constant { first } else { signal.iter().sum::<f64>() / signal.len() as f64 };
        if !constant {
            for k in 1..=middle {
                let (cosine, sine) = samples.basis.project(k - 1, signal);
                (self.cosines[middle + k], self.sines[middle + k]) = (cosine, sine);
                (self.cosines[middle - k], self.sines[middle - k]) = (cosine, -sine);
            }
        }
        !constant || first != 0.0
    }

    /// Becomes a sum of lines, each times a factor.
    fn combine<'a>(&mut self, of: impl Iterator<Item = (f64, &'a Line)>) {
        self.cosines.fill(0.0);
        self.sines.fill(0.0);
        for (factor, line) in of {
            self.cosines.iter_mut().zip(&line.cosines).for_each(|(sum, value)| *sum += factor * value);
            self.sines.iter_mut().zip(&line.sines).for_each(|(sum, value)| *sum += factor * value);
        }
    }

    /// From k = −l and from k = l on: the numbers at k − l and at k + l, k = 0, 1 …
    fn around(&self, l: usize) -> [[&[f64]; 2]; 2] {
        let middle = self.cosines.len() / 2;
        [middle - l, middle + l].map(|at| [&self.cosines[at..], &self.sines[at..]])
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
/// components ½(A_k−l + A_k+l) and ½(B_k+l + B_k−l), that with sin lτ ½(B_k+l − B_k−l) and ½(A_k−l − A_k+l); along 1
/// half of the first of each.
pub(super) fn operator(samples: &Samples, unknowns: usize, harmonics: usize, omega_rad_s: f64, matrix: &mut [f64]) {
    let (m, size, count) = (unknowns, unknowns * (2 * harmonics + 1), samples.count());
    matrix[..size * size].fill(0.0);
    let mut lines = [(); 3].map(|()| Line::new(harmonics));
    let [mut u, mut v] = [(); 2].map(|()| Line::new(harmonics));
    for pair in 0..m * m {
        let mut acts = [false; 3];
        for ((line, acts), signals) in lines.iter_mut().zip(&mut acts).zip(&samples.by) {
            *acts = line.transform(samples, &signals[pair * count..(pair + 1) * count]);
        }
        if acts == [false; 3] {
            continue;
        }
        let (i, j) = (pair / m, pair % m);
        for l in 0..=harmonics {
            let rate = l as f64 * omega_rad_s;
            let factors = [1.0, rate, -rate * rate];
            let of = |which: usize| (acts[which] && factors[which] != 0.0).then_some((factors[which], &lines[which]));
            u.combine(of(0).into_iter().chain(of(2)));
            v.combine(of(1).into_iter());
            let ([[cu_minus, su_minus], [cu_plus, su_plus]], [[cv_minus, sv_minus], [cv_plus, sv_plus]]) =
                (u.around(l), v.around(l));
            // The columns of cos lτ and sin lτ, or that of 1.
            let (first, others) = matrix[(2 * l).saturating_sub(1) * m * size..].split_at_mut(m * size);
            let cosine = &mut first[j * size..(j + 1) * size];
            cosine[i] = 0.5 * (0.5 * (cu_minus[0] + cu_plus[0]) - 0.5 * (sv_plus[0] - sv_minus[0]));
            for k in 1..=harmonics {
                let row = (2 * k - 1) * m + i;
                cosine[row] = 0.5 * (cu_minus[k] + cu_plus[k]) - 0.5 * (sv_plus[k] - sv_minus[k]);
                cosine[row + m] = 0.5 * (su_plus[k] + su_minus[k]) - 0.5 * (cv_minus[k] - cv_plus[k]);
            }
            if l == 0 {
                continue;
            }
            let sine = &mut others[j * size..(j + 1) * size];
            sine[i] = 0.5 * (0.5 * (su_plus[0] - su_minus[0]) + 0.5 * (cv_minus[0] + cv_plus[0]));
            for k in 1..=harmonics {
                let row = (2 * k - 1) * m + i;
                sine[row] = 0.5 * (su_plus[k] - su_minus[k]) + 0.5 * (cv_minus[k] + cv_plus[k]);
                sine[row + m] = 0.5 * (cu_minus[k] - cu_plus[k]) + 0.5 * (sv_plus[k] + sv_minus[k]);
            }
        }
    }
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
