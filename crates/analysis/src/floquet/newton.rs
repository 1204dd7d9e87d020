//! The exponent of a mode by Newton's method; see [`super::exponents`].
//!
//! With A(s) p = e₀ and Aᵀ q = e₀ of the equations of some harmonics, 1/p₀ vanishes at an exponent, and its
//! derivative is qᵀA′p/p₀²: s ← s − p₀/(qᵀA′p). The k-th harmonic, if it is left out, changes s by H f g/(qᵀA′p),
//! with f = Σ Tₖₗ pₗ, which drives it, and g = Σ qₗ Tₗₖ.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;

use super::varied::{OMITTED, Varied};

/// Harmonics on either side, at first and at most, in steps of [`Varied::step`].
const WINDOWS: [usize; 4] = [6, 9, 14, 24];
/// The number of harmonics tried as p₀.
const TRIED: usize = 4;
/// Iterations after which Newton's method gives up.
const ITERATIONS: usize = 8;
/// The error over Ω.
const CONVERGED: f64 = 1e-10;
/// A longer step over Ω than this leads elsewhere.
const FARTHEST: f64 = 0.1;

/// Returns an exponent near s of a variation of which p₀ is a large part; `None` if there is none.
pub(super) fn polish(varied: &Varied, mut s: Complex<f64>) -> Option<Complex<f64>> {
    let mut before = 0.0;
    for window in WINDOWS {
        let mut solver = Solver::new(window);
        for _ in 0..ITERATIONS {
            let (change, omitted) = solver.iterate(varied, s)?;
            let step = libm::sqrt(change.norm_sqr()) / varied.omega;
            if step.is_nan() || step >= FARTHEST {
                return None;
            }
            s -= change;
            // The next step is at most the same part of this one as this one is of the one before, also near a double
            // exponent.
            let error = step * (step / before).min(1.0);
            before = step;
            if error < CONVERGED {
                if omitted < OMITTED * varied.omega {
                    return Some(s);
                }
                // Converged, but with too few harmonics: the next window begins from this s.
                break;
            }
        }
    }
    None
}

/// Returns the harmonics k with the largest H(s + ikΩ) up to a frequency, the largest first.
pub(super) fn strongest(varied: &Varied, s: Complex<f64>, fastest_rad_s: f64) -> Vec<isize> {
    let most = libm::ceil(fastest_rad_s / varied.omega) as isize + 1;
    let mut sizes: Vec<_> = (-most..=most).map(|k| (k, varied.compliance(varied.rate(s, k)).norm_sqr())).collect();
    sizes.sort_by(|a, b| b.1.total_cmp(&a.1));
    sizes.truncate(TRIED);
    sizes.into_iter().map(|(k, _)| k).collect()
}

/// The equations of 2 · window + 1 harmonics, by rows.
struct Solver {
    window: usize,
    a: Vec<Complex<f64>>,
    slopes: Vec<Complex<f64>>,
    pivots: Vec<usize>,
}

impl Solver {
    fn new(window: usize) -> Solver {
        let n = 2 * window + 1;
        let zero = Complex::new(0.0, 0.0);
        Solver { window, a: vec![zero; n * n], slopes: vec![zero; n], pivots: vec![0; n] }
    }

    /// Returns the step of s, and the change of s by the first harmonics that are left out, at the sharpest resonance.
    fn iterate(&mut self, varied: &Varied, s: Complex<f64>) -> Option<(Complex<f64>, f64)> {
        let n = self.slopes.len();
        let window = self.window;
        let harmonic = |at: usize| (at as isize - window as isize) * varied.step as isize;
        for k in 0..n {
            let rate = varied.rate(s, harmonic(k));
            let [stiffness, slope] = varied.stiffness(rate);
            self.slopes[k] = slope;
            for l in 0..n {
                self.a[l * n + k] = varied.coupling(harmonic(l) - harmonic(k), rate);
            }
            self.a[k * n + k] += stiffness;
        }
        self.factor()?;
        let unit = || {
            let mut unit = vec![Complex::new(0.0, 0.0); n];
            unit[self.window] = Complex::new(1.0, 0.0);
            unit
        };
        let mut p = unit();
        let mut q = unit();
        self.solve(&mut p);
        self.solve_transposed(&mut q);
        let mut slope: Complex<f64> = (0..n).map(|k| q[k] * self.slopes[k] * p[k]).sum();
        if varied.damps {
            for (k, left) in q.iter().enumerate() {
                for (l, right) in p.iter().enumerate() {
                    let [_, by_rate] = varied.coefficients_of(harmonic(k) - harmonic(l));
                    slope += left * by_rate * right;
                }
            }
        }
        let driven = |at: isize| {
            let k = at * varied.step as isize;
            let mut products = [Complex::new(0.0, 0.0); 2];
            for l in 0..n {
                products[0] += varied.coupling(k - harmonic(l), varied.rate(s, harmonic(l))) * p[l];
                products[1] += varied.coupling(harmonic(l) - k, varied.rate(s, k)) * q[l];
            }
            (products[0] * products[1] / slope).norm_sqr()
        };
        let beyond = window as isize + 1;
        let omitted = [-beyond - 1, -beyond, beyond, beyond + 1].into_iter().map(driven).fold(0.0, f64::max);
        Some((p[self.window] / slope, varied.sharpest * libm::sqrt(omitted)))
    }

    /// PA = LU, in place.
    fn factor(&mut self) -> Option<()> {
        let n = self.slopes.len();
        for k in 0..n {
            let size = |row: usize| self.a[row * n + k].norm_sqr();
            let pivot = (k..n).fold(k, |best, row| if size(row) > size(best) { row } else { best });
            if !(size(pivot) > 0.0 && size(pivot).is_finite()) {
                return None;
            }
            self.pivots[k] = pivot;
            // Whole rows are exchanged, L included, so that solving first exchanges all elements of the right side.
            (0..n).for_each(|column| self.a.swap(k * n + column, pivot * n + column));
            let (upper, lower) = self.a.split_at_mut((k + 1) * n);
            let above = &upper[k * n..];
            let inverse = above[k].inv();
            for row in lower.chunks_exact_mut(n) {
                let factor = row[k] * inverse;
                row[k] = factor;
                for (cell, above) in row[k + 1..].iter_mut().zip(&above[k + 1..]) {
                    *cell -= factor * above;
                }
            }
        }
        Some(())
    }

    fn solve(&self, b: &mut [Complex<f64>]) {
        let n = b.len();
        (0..n).for_each(|k| b.swap(k, self.pivots[k]));
        for k in 0..n {
            let known: Complex<f64> = (0..k).map(|l| self.a[k * n + l] * b[l]).sum();
            b[k] -= known;
        }
        for k in (0..n).rev() {
            let known: Complex<f64> = (k + 1..n).map(|l| self.a[k * n + l] * b[l]).sum();
            b[k] = (b[k] - known) / self.a[k * n + k];
        }
    }

    fn solve_transposed(&self, b: &mut [Complex<f64>]) {
        let n = b.len();
        for k in 0..n {
            let known: Complex<f64> = (0..k).map(|l| self.a[l * n + k] * b[l]).sum();
            b[k] = (b[k] - known) / self.a[k * n + k];
        }
        for k in (0..n).rev() {
            let known: Complex<f64> = (k + 1..n).map(|l| self.a[l * n + k] * b[l]).sum();
            b[k] -= known;
        }
        (0..n).rev().for_each(|k| b.swap(k, self.pivots[k]));
    }
}
