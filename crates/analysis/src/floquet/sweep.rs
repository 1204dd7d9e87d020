//! The exponent of a mode that hardly feels how an element varies; see [`super::exponents`].
//!
//! With p₀ = 1, H = φ²/D + R, D = s² + 2ζωs + ω² of the mode itself and R of all others, the equations are solved in
//! turn for each unknown:
//!
//! ```text
//! pₖ = −Σ_{l≠k} Tₖₗ pₗ/(1/Hₖ + Tₖₖ),     D(s) = −φ²τ/(1 + Rτ),  τ = Σₗ T₀ₗ pₗ
//! ```
//!
//! What is left out beyond the last harmonic changes s by the order of the square of p there: see [`window`].

use nalgebra::Complex;

use super::varied::{OMITTED, Varied};

/// The most harmonics on either side, in steps of [`Varied::step`].
const LARGEST_WINDOW: usize = 12;
const MOST: usize = 2 * LARGEST_WINDOW + 1;
/// Sweeps at most, of all, and with the same H.
const SWEEPS: usize = 40;
const SWEEPS_WITH: usize = 4;
/// A shift below this, over Ω, is a good start.
const LITTLE: f64 = 0.01;
/// Harmonics on either side to add where too much is left out.
const WIDER: usize = 3;
/// The last change of s over Ω, and of p.
const CONVERGED: f64 = 1e-10;
/// A mode whose other harmonics are larger than this takes many sweeps, if it ends at all.
const TOO_LARGE: f64 = 0.5;

/// Returns the exponent s of a mode; `None` if the sweeps don't converge.
pub(super) fn sweep(varied: &mut Varied, mode: usize) -> Option<Complex<f64>> {
    let square = varied.squares[mode];
    let damping = varied.dampings[mode];
    let linear = Complex::new(-0.5 * damping, libm::sqrt((square - 0.25 * damping * damping).max(0.0)));
    let mut at = Sweep { s: linear, p: [Complex::new(0.0, 0.0); MOST], window: window(varied, mode)? };
    // As if the element did not vary, and the other modes were rigid, where that is near.
    let shift = varied.coupling(0, linear) * varied.weights[mode] / (linear * 2.0 + damping);
    if shift.norm_sqr() < LITTLE * LITTLE * varied.omega * varied.omega {
        at.s -= shift;
    }
    at.p[LARGEST_WINDOW] = Complex::new(1.0, 0.0);
    let mut sweeps = 0;
    let mut before = None;
    while sweeps < SWEEPS {
        let start = at.s;
        let previous = before;
        let changed = at.with_compliance(varied, mode)?;
        sweeps += SWEEPS_WITH;
        let change = libm::sqrt((at.s - start).norm_sqr()) / varied.omega;
        before = Some(change);
        if changed.max(left(change, previous)) >= CONVERGED {
            continue;
        }
        if at.omitted(varied, mode) < OMITTED {
            return Some(at.s);
        }
        at.window += WIDER;
        if at.window > LARGEST_WINDOW {
            return None;
        }
    }
    None
}

/// Estimates the distance of s from its limit: each new H changes it by the same ratio of the change before, which is
/// near 1 if H is steep, as between two modes of almost the same frequency.
fn left(change: f64, before: Option<f64>) -> f64 {
    match before {
        Some(before) if change < before => change * change / (before - change),
        _ if change < CONVERGED => 0.0,
        _ => f64::INFINITY,
    }
}

/// Returns φ²/2ωΩ: a harmonic k that f = Σ Tₖₗ pₗ drives changes s by H f² times this, over Ω.
fn share(varied: &Varied, mode: usize) -> f64 {
    varied.weights[mode] / (2.0 * libm::sqrt(varied.squares[mode]) * varied.omega)
}

/// Harmonics on either side such that none beyond changes s by more than [`OMITTED`] Ω, were it at the sharpest
/// resonance: with H₁ ≈ 3 φ²/(2ωΩ) beside the mode, the k-th is driven by S_k and by S₁ (H₁S₁)ᵏ⁻¹, and changes s by the
/// square of this, H there and φ²/2ω. `None` if there would be too many.
fn window(varied: &Varied, mode: usize) -> Option<usize> {
    let rate = Complex::new(0.0, libm::sqrt(varied.squares[mode]));
    let share = share(varied, mode);
    let size = |at: usize| libm::sqrt(varied.coupling((at * varied.step) as isize, rate).norm_sqr());
    let mut again = size(1);
    let again_by = 3.0 * share * size(1);
    let mut window = LARGEST_WINDOW;
    while window > 1 && share * varied.sharpest * size(window) * size(window) < OMITTED {
        window -= 1;
    }
    for at in 1..LARGEST_WINDOW {
        if at >= window && share * varied.sharpest * again * again < OMITTED {
            return Some(at);
        }
        again *= again_by;
    }
    None
}

/// The exponent s and the harmonics p of a sweep in progress.
struct Sweep {
    s: Complex<f64>,
    p: [Complex<f64>; MOST],
    window: usize,
}

impl Sweep {
    /// Returns the change of s, over Ω, by the first harmonics that are left out, at the sharpest resonance.
    fn omitted(&self, varied: &Varied, mode: usize) -> f64 {
        let step = varied.step as isize;
        let window = self.window as isize;
        let drive = |k: isize| {
            let driven: Complex<f64> = (-window..=window)
                .map(|l| {
                    let p = self.p[(LARGEST_WINDOW as isize + l) as usize];
                    varied.coupling((k - l) * step, varied.rate(self.s, l * step)) * p
                })
                .sum();
            driven.norm_sqr()
        };
        let largest = [-window - 2, -window - 1, window + 1, window + 2].into_iter().map(drive).fold(0.0, f64::max);
        share(varied, mode) * varied.sharpest * largest
    }

    /// Some sweeps with H at the first s; returns the largest change of p, relative to p₀, in the last.
    fn with_compliance(&mut self, varied: &mut Varied, mode: usize) -> Option<f64> {
        let weight = varied.weights[mode];
        let square = varied.squares[mode];
        let damping = varied.dampings[mode];
        // Away from its pole, too, so that nothing is divided by zero.
        varied.weights[mode] = 0.0;
        varied.squares[mode] = 2.0 * square + 1.0;
        let rest = varied.compliance(self.s);
        varied.weights[mode] = weight;
        varied.squares[mode] = square;
        let step = varied.step as isize;
        let harmonic = |at: usize| (at as isize - LARGEST_WINDOW as isize) * step;
        let range = LARGEST_WINDOW - self.window..LARGEST_WINDOW + self.window + 1;
        let mut divisors = [Complex::new(0.0, 0.0); MOST];
        for at in range.clone().filter(|at| *at != LARGEST_WINDOW) {
            let rate = varied.rate(self.s, harmonic(at));
            let compliance = varied.compliance(rate);
            // −1/(1/Hₖ + Tₖₖ), written so that nothing is divided by Hₖ, which may vanish.
            divisors[at] = -compliance / (compliance * varied.coupling(0, rate) + 1.0);
        }
        // S and G by the difference of two harmonics.
        let table: [[Complex<f64>; 2]; 2 * MOST] =
            core::array::from_fn(|at| varied.coefficients_of((at as isize - MOST as isize) * step));
        let mut last = 0.0;
        for _ in 0..SWEEPS_WITH {
            last = 0.0;
            let s = self.s;
            let force = |p: &[Complex<f64>; MOST], k: usize| {
                let mut by_position = Complex::new(0.0, 0.0);
                let mut by_rate = Complex::new(0.0, 0.0);
                for l in range.clone() {
                    let [stiffness, damping] = table[MOST + k - l];
                    by_position += stiffness * p[l];
                    if varied.damps {
                        by_rate += damping * varied.rate(s, harmonic(l)) * p[l];
                    }
                }
                by_position + by_rate
            };
            for k in range.clone().filter(|k| *k != LARGEST_WINDOW) {
                // The divisor holds the own term Tₖₖ pₖ, so the force is that of the others.
                let own = core::mem::take(&mut self.p[k]);
                let next = divisors[k] * force(&self.p, k);
                if next.norm_sqr().is_nan() || next.norm_sqr() >= TOO_LARGE * TOO_LARGE {
                    return None;
                }
                last = f64::max(last, (next - own).norm_sqr());
                self.p[k] = next;
            }
            let tau = force(&self.p, LARGEST_WINDOW);
            let wanted = -tau * weight / (rest * tau + 1.0);
            // A step of Newton's method for D(s) = −φ²τ/(1 + Rτ), with D′ = 2s + 2ζω.
            let change = (s * s + s * damping + square - wanted) / (s * 2.0 + damping);
            self.s -= change;
            if last < CONVERGED * CONVERGED && change.norm_sqr() < CONVERGED * CONVERGED * varied.omega * varied.omega {
                break;
            }
        }
        Some(libm::sqrt(last))
    }
}
