//! The derivative of a signal's Fourier coefficients by those of the response.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;

use super::fourier::values;
use super::samples::Samples;

/// 2/T ∫ f cos kτ and 2/T ∫ f sin kτ of one signal, k = −2H … 2H, at the place k + 2H: the first are even in k, the
/// second odd.
#[derive(Clone, Debug)]
struct Line {
    harmonics: usize,
    orders: Vec<[f64; 2]>,
}

impl Line {
    fn new(harmonics: usize) -> Line {
        Line { harmonics, orders: vec![[0.0; 2]; 4 * harmonics + 1] }
    }

    /// Sets the line to that of a signal and returns whether the signal is other than zero anywhere.
    fn transform(&mut self, samples: &Samples, signal: &[f64]) -> bool {
        if self.set_constant(signal) {
            return signal[0] != 0.0;
        }
        for k in 1..=2 * self.harmonics {
            self.set_order(k, samples.basis.project(k - 1, signal));
        }
        true
    }

    /// Sets the order zero to that of a signal, the others to zero, and returns whether the signal is constant, as the
    /// derivative of a linear force is, which needs no projections.
    fn set_constant(&mut self, signal: &[f64]) -> bool {
        let first = signal[0];
        let middle = 2 * self.harmonics;
        let constant = signal.iter().all(|value| *value == first);
        let mean = if constant { first } else { signal.iter().sum::<f64>() / signal.len() as f64 };
        self.orders.fill([0.0; 2]);
        self.orders[middle][0] = 2.0 * mean;
        constant
    }

    fn set_order(&mut self, k: usize, (cosine, sine): (f64, f64)) {
        let middle = 2 * self.harmonics;
        self.orders[middle + k] = [cosine, sine];
        self.orders[middle - k] = [cosine, -sine];
    }

    /// Sets the line to a sum of two lines, each times a factor.
    fn combine(&mut self, [(a, first), (b, second)]: [(f64, &Line); 2]) {
        for ((sum, of_first), of_second) in self.orders.iter_mut().zip(&first.orders).zip(&second.orders) {
            *sum = [a * of_first[0] + b * of_second[0], a * of_first[1] + b * of_second[1]];
        }
    }

    /// Returns the numbers at k − l and at k + l, k = 0 … H.
    fn around(&self, l: usize) -> impl Iterator<Item = [&[f64; 2]; 2]> {
        let middle = 2 * self.harmonics;
        let below = self.orders[middle - l..].iter().take(self.harmonics + 1);
        below.zip(&self.orders[middle + l..]).map(|(below, above)| [below, above])
    }
}

/// Sets two lines to those of two signals, and returns whether each signal is other than zero anywhere. With as many
/// samples as a fast transform takes, one transform has both.
fn transform_two(lines: [&mut Line; 2], samples: &Samples, signals: [&[f64]; 2]) -> [bool; 2] {
    let [first, second] = lines;
    let Some(fft) = samples.fft.as_ref().filter(|_| 2 * first.harmonics < samples.count() / 2) else {
        return [first.transform(samples, signals[0]), second.transform(samples, signals[1])];
    };
    let constant = [first.set_constant(signals[0]), second.set_constant(signals[1])];
    let acts = [0, 1].map(|d: usize| !constant[d] || signals[d][0] != 0.0);
    if constant == [true; 2] {
        return acts;
    }
    let mut values: Vec<_> = signals[0].iter().zip(signals[1]).map(|(re, im)| Complex::new(*re, *im)).collect();
    fft.forward(&mut values);
    let count = values.len();
    let scale = 1.0 / values.len() as f64;
    for k in 1..=2 * first.harmonics {
        // The transform of real signals is that of −k, conjugate.
        let above = values[k];
        let below = values[count - k];
        if !constant[0] {
            first.set_order(k, (scale * (above.re + below.re), scale * (below.im - above.im)));
        }
        if !constant[1] {
            second.set_order(k, (scale * (above.im + below.im), scale * (above.re - below.re)));
        }
    }
    acts
}

/// Returns the coefficients of a signal: its mean, then those of cos kτ and sin kτ, k = 1 … H.
pub(super) fn project(samples: &Samples, signal: &[f64], harmonics: usize, mut out: impl FnMut(usize, f64)) {
    out(0, signal.iter().sum::<f64>() / signal.len() as f64);
    for k in 1..=harmonics {
        let (c, s) = samples.basis.project(k - 1, signal);
        out(2 * k - 1, c);
        out(2 * k, s);
    }
}

/// Returns ∂Q̂/∂X of the samples without the states' part, m (2H + 1) square, column by column.
///
/// A column of cos lτ makes the signal U cos lτ − V sin lτ and one of sin lτ makes U sin lτ + V cos lτ, with U = S −
/// l²Ω²M and V = lΩG. With A and B the lines of a signal, its product with cos lτ has along cos kτ and sin kτ the
/// components ½(A_k−l + A_k+l) and ½(B_k+l + B_k−l), that with sin lτ ½(B_k+l − B_k−l) and ½(A_k−l − A_k+l); along 1
/// half of the first of each.
///
/// `by_state` has parts of the derivatives by u and u̇ that are added to those of the samples, or is empty. Of symmetric
/// derivatives one of two pairs is transformed.
pub(super) fn operator(
    samples: &Samples,
    by_state: &[Vec<f64>; 2],
    [m, harmonics]: [usize; 2],
    omega_rad_s: f64,
    is_symmetric: bool,
    matrix: &mut [f64],
) {
    let size = m * (2 * harmonics + 1);
    let count = samples.count();
    matrix[..size * size].fill(0.0);
    let mut lines = [(); 3].map(|()| Line::new(harmonics));
    let mut combined = Line::new(harmonics);
    let mut sums: [Vec<f64>; 2] = Default::default();
    for pair in (0..m * m).filter(|pair| !is_symmetric || pair / m <= pair % m) {
        let of_pair = pair * count..(pair + 1) * count;
        let mut signals = samples.by.each_ref().map(|by| &by[of_pair.clone()]);
        for (d, sum) in sums.iter_mut().enumerate().filter(|(d, _)| !by_state[*d].is_empty()) {
            sum.clear();
            sum.extend(signals[d].iter().zip(&by_state[d][of_pair.clone()]).map(|(by, of_state)| by + of_state));
            signals[d] = sum;
        }
        let [first, second, third] = &mut lines;
        let [of_position, of_velocity] = transform_two([first, second], samples, [signals[0], signals[1]]);
        let acts = [of_position, of_velocity, third.transform(samples, signals[2])];
        if acts == [false; 3] {
            continue;
        }
        let i = pair / m;
        let j = pair % m;
        for l in 0..=harmonics {
            let rate = l as f64 * omega_rad_s;
            let u = if acts[2] {
                combined.combine([(1.0, &lines[0]), (-rate * rate, &lines[2])]);
                &combined
            } else {
                &lines[0]
            };
            let v = |order: f64| rate * order;
            let around = || u.around(l).zip(lines[1].around(l));
            // The columns of cos lτ and sin lτ, or that of 1.
            let (first, others) = matrix[(2 * l).saturating_sub(1) * m * size..].split_at_mut(m * size);
            let cosine = around().map(|([u, up], [g, gp])| {
                let (v, vp) = (g.map(v), gp.map(v));
                [0.5 * (u[0] + up[0]) - 0.5 * (vp[1] - v[1]), 0.5 * (up[1] + u[1]) - 0.5 * (v[0] - vp[0])]
            });
            put(&mut first[j * size..(j + 1) * size], [m, i], cosine);
            if l > 0 {
                let sine = around().map(|([u, up], [g, gp])| {
                    let (v, vp) = (g.map(v), gp.map(v));
                    [0.5 * (up[1] - u[1]) + 0.5 * (v[0] + vp[0]), 0.5 * (u[0] - up[0]) + 0.5 * (vp[1] + v[1])]
                });
                put(&mut others[j * size..(j + 1) * size], [m, i], sine);
            }
        }
        if is_symmetric && i != j {
            for columns in matrix[..size * size].chunks_exact_mut(m * size) {
                for row in (0..size).step_by(m) {
                    columns[i * size + row + j] = columns[j * size + row + i];
                }
            }
        }
    }
}

/// Puts the components along cos kτ and sin kτ, k = 0 … H, into the rows of one of `m` unknowns; along 1 half the first.
fn put(column: &mut [f64], [m, i]: [usize; 2], mut components: impl Iterator<Item = [f64; 2]>) {
    let (constant, others) = column.split_at_mut(m);
    if let Some([first, _]) = components.next() {
        constant[i] = 0.5 * first;
    }
    for (rows, [cosine, sine]) in others.chunks_exact_mut(2 * m).zip(components) {
        rows[i] = cosine;
        rows[m + i] = sine;
    }
}

/// Returns the largest |x(τ)| of a series of one signal, with as many frequencies as the samples' functions at most:
/// the highest samples, each polished by Newton's method on x′ = 0.
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

/// Samples below this fraction of the highest are next to no largest value: a grid of 4H points or more has a point next
/// to the largest value that is at least 0.69 of it. |x″| ≤ H² max |x| (S. Bernstein, "Sur l'ordre de la meilleure
/// approximation des fonctions continues par des polynômes de degré donné", 1912), so that over half a spacing at most
/// (π/4)²/2 of it is lost.
const PEAK_SHARE: f64 = 0.69;
/// Steps of Newton's method to a peak.
const PEAK_STEPS: usize = 4;

/// Returns the height of the peak next to a phase of a grid.
fn polished(series: &[f64], mut phase_rad: f64, samples: usize) -> f64 {
    let spacing = TAU / samples as f64;
    let [mut value, mut slope, mut curvature] = values(series, phase_rad);
    for _ in 0..PEAK_STEPS {
        if curvature == 0.0 {
            break;
        }
        // At most to the neighbouring sample, since the peak lies between the two.
        phase_rad += (-slope / curvature).clamp(-spacing, spacing);
        let [x, v, a] = values(series, phase_rad);
        // A step that goes down has left the peak: the value before it stands.
        if x.abs() < value.abs() {
            break;
        }
        value = x;
        slope = v;
        curvature = a;
    }
    value.abs()
}
