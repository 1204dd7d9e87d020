//! The exponent of a mode that hardly feels how an element varies; see [`super::exponents`].
//!
//! With p₀ = 1, H = φ²/D + R, D = s² + 2ζωs + ω² of the mode itself and R of all others, the equations are solved in turn
//! for each unknown:
//!
//! ```text
//! pₖ = −Σ_{l≠k} Tₖₗ pₗ/(1/Hₖ + Tₖₖ),     D(s) = −φ²τ/(1 + Rτ),  τ = Σₗ T₀ₗ pₗ
//! ```
//!
//! What is left out beyond the last harmonic changes s by the order of the square of p there.

use nalgebra::Complex;

use super::exponents::Varied;

/// Harmonics on either side, at first and at most, in steps of [`Varied::step`].
const WINDOW: usize = 3;
const LARGEST_WINDOW: usize = 9;
const MOST: usize = 2 * LARGEST_WINDOW + 1;
/// Sweeps at most, of all, and with the same H.
const SWEEPS: usize = 40;
const SWEEPS_WITH: usize = 4;
/// The largest |p| beyond which nothing is left out.
const TAIL: f64 = 1e-6;
/// The last change of s over Ω, and of p.
const CONVERGED: f64 = 1e-12;
/// A mode whose other harmonics are larger than this takes many sweeps, if it ends at all.
const TOO_LARGE: f64 = 0.5;

/// s; `None` if the sweeps don't converge.
pub(super) fn sweep(varied: &mut Varied, mode: usize) -> Option<Complex<f64>> {
    let (square, damping) = (varied.squares[mode], varied.dampings[mode]);
    let mut s = Complex::new(-0.5 * damping, libm::sqrt((square - 0.25 * damping * damping).max(0.0)));
    let mut window = WINDOW;
    let mut p = [Complex::new(0.0, 0.0); MOST];
    p[LARGEST_WINDOW] = Complex::new(1.0, 0.0);
    let mut sweeps = 0;
    while sweeps < SWEEPS {
        let changed = sweeps_with(varied, mode, &mut s, &mut p, window)?;
        sweeps += SWEEPS_WITH;
        if changed < CONVERGED {
            let ends = [0, 1].map(|from_end| {
                let [low, high] = [LARGEST_WINDOW - window + from_end, LARGEST_WINDOW + window - from_end];
                p[low].norm_sqr().max(p[high].norm_sqr())
            });
            if ends[0].max(ends[1]) < TAIL * TAIL {
                return Some(s);
            }
            window += 2;
            if window > LARGEST_WINDOW {
                return None;
            }
        }
    }
    None
}

/// Some sweeps with H at the first s; returns the largest change of them all of s, relative to Ω, and of p, relative to
/// p₀, in the last.
fn sweeps_with(
    varied: &mut Varied,
    mode: usize,
    s: &mut Complex<f64>,
    p: &mut [Complex<f64>; MOST],
    window: usize,
) -> Option<f64> {
    let (weight, start) = (varied.weights[mode], *s);
    let harmonic = |at: usize| (at as isize - LARGEST_WINDOW as isize) * varied.step as isize;
    let range = LARGEST_WINDOW - window..LARGEST_WINDOW + window + 1;
    let mut divisors = [Complex::new(0.0, 0.0); MOST];
    for at in range.clone().filter(|at| *at != LARGEST_WINDOW) {
        let rate = varied.rate(start, harmonic(at));
        let compliance = varied.compliance(rate);
        divisors[at] = -compliance / (compliance * varied.coupling(0, rate) + 1.0);
    }
    let step = varied.step;
    // Away from its pole, too, so that nothing is divided by zero.
    let square = varied.squares[mode];
    (varied.weights[mode], varied.squares[mode]) = (0.0, 2.0 * square + 1.0);
    let rest = varied.compliance(start);
    (varied.weights[mode], varied.squares[mode]) = (weight, square);
    let harmonic = |at: usize| (at as isize - LARGEST_WINDOW as isize) * step as isize;
    let mut last = 0.0;
    for _ in 0..SWEEPS_WITH {
        last = 0.0;
        let mut rates = [Complex::new(0.0, 0.0); MOST];
        range.clone().for_each(|at| rates[at] = varied.rate(*s, harmonic(at)));
        let force = |p: &[Complex<f64>; MOST], k: usize| -> Complex<f64> {
            range.clone().filter(|l| *l != k).map(|l| varied.coupling(harmonic(k) - harmonic(l), rates[l]) * p[l]).sum()
        };
        for k in range.clone().filter(|k| *k != LARGEST_WINDOW) {
            let next = divisors[k] * force(p, k);
            if !(next.norm_sqr() < TOO_LARGE * TOO_LARGE) {
                return None;
            }
            last = f64::max(last, (next - p[k]).norm_sqr());
            p[k] = next;
        }
        let tau = force(p, LARGEST_WINDOW) + varied.coupling(0, *s);
        let wanted = -tau * weight / (rest * tau + 1.0);
        let damping = varied.dampings[mode];
        let off = *s * *s + *s * damping + square - wanted;
        *s -= off / (*s * 2.0 + damping);
    }
    let moved = (*s - start).norm_sqr() / (varied.omega * varied.omega);
    Some(libm::sqrt(f64::max(moved, last)))
}
