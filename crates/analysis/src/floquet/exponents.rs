//! Floquet exponents of many modes that feel one smooth element, in the frequency domain.
//!
//! A variation e^{st} Σ pₖ e^{ikΩt} of the element's displacement satisfies
//!
//! ```text
//! pₖ/H(s + ikΩ) + Σₗ Tₖₗ pₗ = 0,     Tₖₗ = S_{k−l} + (s + ilΩ) G_{k−l}
//! ```
//!
//! with the compliance H(s) = Σ φ²/(ω² + 2ζωs + s²) and the Fourier coefficients of ∂f/∂x and ∂f/∂ẋ. The multipliers
//! are μ = e^{sT}, two for each mode. Most modes hardly feel how the element varies: sweeps that start at their linear
//! exponent find p and s at once ([`sweep`](super::sweep)). The search for the others starts from the flow of their own
//! modes alone, and Newton's method on all of them polishes the result ([`newton`](super::newton)). The set is complete
//! when there are as many multipliers as states, each a solution and no two the same; their product must be that of
//! Liouville's formula.

use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use nalgebra::Complex;

use super::newton::{polish, strongest};
use super::sweep::sweep;
use super::varied::Varied;
use super::{ACCURACY, Variations, modal, multipliers, sorted};
use crate::orbit::Stability;
use crate::unknowns::{Body, Condensed};

/// From this number of modes on, the search for exponents is faster than the flow.
pub(super) const LEAST_MODES: usize = 5;
/// The most modes whose search starts from their own flow.
const MOST_TOGETHER: usize = 10;
/// Exponents over a period that are nearer than this count as the same; their errors are far smaller.
const APART: f64 = 1e-6;
/// An exponent over a period that is this near to its guess is accepted as the one sought.
const NEAR: f64 = 0.03;
/// Multipliers whose imaginary part is below this are real.
const REAL: f64 = 1e-9;
/// The largest deviation of the logarithm of the product of all multipliers.
const LIOUVILLE: f64 = 1e-7;

/// e^{sT} and back: the exponent over a period, with its imaginary part within ±π.
fn over_period(s: Complex<f64>, period_s: f64) -> Complex<f64> {
    let angle = s.im * period_s;
    Complex::new(s.re * period_s, angle - TAU * libm::round(angle / TAU))
}

/// Exponents over a period, all different.
struct Found {
    exponents: Vec<Complex<f64>>,
}

impl Found {
    /// Returns the exponent of a multiplier, and its distance over a period from all that are known.
    fn distant(&self, mu: &Complex<f64>, period_s: f64) -> (Complex<f64>, f64) {
        let at = Complex::new(0.5 * libm::log(mu.norm_sqr()), libm::atan2(mu.im, mu.re));
        (at / period_s, self.exponents.iter().map(|other| apart(*other, at)).fold(f64::INFINITY, f64::min))
    }

    /// Says whether an exponent is already in the set.
    fn has(&self, at: Complex<f64>) -> bool {
        // First the part that takes no rounding of angles.
        self.exponents.iter().any(|other| (other.re - at.re).abs() < APART && apart(*other, at) < APART)
    }

    /// Adds the nearest new exponent to s: the first that is near, or else the nearest of some.
    fn add_near(&mut self, varied: &Varied, s: Complex<f64>, fastest_rad_s: f64) {
        let period_s = TAU / varied.omega;
        let mut best = None;
        let from = over_period(s, period_s);
        for harmonic in strongest(varied, s, fastest_rad_s) {
            let Some(polished) = polish(varied, varied.rate(s, harmonic)) else { continue };
            let at = over_period(polished, period_s);
            let off = apart(at, from);
            let is_new = !self.has(at);
            if is_new && best.is_none_or(|(_, least)| off < least) {
                best = Some((at, off));
                if off < NEAR {
                    break;
                }
            }
        }
        if let Some((at, _)) = best {
            self.add(at);
        }
    }

    /// Adds a new exponent and its conjugate.
    fn add(&mut self, at: Complex<f64>) {
        if self.has(at) {
            return;
        }
        // A real multiplier gets the angle 0 or π exactly, so that it is not taken for a conjugate pair.
        let sine = libm::sin(at.im);
        if (libm::exp(at.re) * sine).abs() < REAL {
            let im = if at.im.abs() > 0.5 * PI { PI } else { 0.0 };
            self.exponents.push(Complex::new(at.re, im));
        } else {
            self.exponents.extend([at, at.conj()]);
        }
    }
}

/// Returns the distance between two exponents over a period.
fn apart(a: Complex<f64>, b: Complex<f64>) -> f64 {
    let angle = a.im - b.im;
    libm::sqrt(Complex::new(a.re - b.re, angle - TAU * libm::round(angle / TAU)).norm_sqr())
}

/// Returns the multipliers; `None` if it is not certain that they are all, so that the flow has to be computed.
pub(super) fn stability(of: &mut Variations) -> Option<Stability> {
    let balance = of.balance;
    let Body::Condensed(condensed) = &balance.unknowns.body else { return None };
    let mut varied = Varied::new(of, condensed)?;
    let modes = condensed.modes.len();
    let period_s = TAU / varied.omega;
    let mut found = Found { exponents: Vec::with_capacity(2 * modes) };
    let mut together = Vec::new();
    for mode in 0..modes {
        match sweep(&mut varied, mode) {
            Some(s) => found.add(over_period(s, period_s)),
            None => together.push(mode),
        }
        if together.len() > MOST_TOGETHER {
            return None;
        }
    }
    let fastest = together.iter().map(|&mode| condensed.modes[mode][0]).fold(0.0, f64::max);
    let mut guesses: Vec<_> =
        guesses(of, condensed, &varied, &together)?.iter().map(|mu| found.distant(mu, period_s)).collect();
    // The most distant first: a guess near a known exponent is probably that exponent.
    guesses.sort_by(|a, b| b.1.total_cmp(&a.1));
    for (s, _) in guesses {
        if found.exponents.len() < 2 * modes {
            found.add_near(&varied, s, fastest);
        }
    }
    // Liouville: the exponents sum to the mean trace of the flow's matrix, −Σ 2ζω − Σ φ² G₀.
    let trace = varied.dampings.iter().sum::<f64>() + varied.weights.iter().sum::<f64>() * varied.coefficients[0][1].re;
    let missing = |found: &Found| -trace * period_s - found.exponents.iter().map(|at| at.re).sum::<f64>();
    if found.exponents.len() + 1 == 2 * modes {
        // A single one is real, and negative multipliers are even in number.
        let negative = found.exponents.iter().filter(|at| at.im == PI).count();
        let im = if negative.is_multiple_of(2) { 0.0 } else { PI };
        found.add_near(&varied, Complex::new(missing(&found), im) / period_s, fastest);
    }
    let is_all = found.exponents.len() == 2 * modes && missing(&found).abs() < LIOUVILLE;
    if !is_all {
        return None;
    }
    let multiplier = |at: &Complex<f64>| {
        let (sine, cosine) = libm::sincos(at.im);
        // The sine of the rounded π is not zero.
        let sine = if at.im == PI { 0.0 } else { sine };
        Complex::new(cosine, sine) * libm::exp(at.re)
    };
    let multipliers = sorted(found.exponents.iter().map(multiplier).collect());
    Some(Stability { multipliers, accuracy: ACCURACY, conservative: false })
}

/// Returns initial guesses of multipliers: those of the flow of the modes up to somewhat beyond the fastest of some,
/// where the others give way as at rest, which changes the derivatives in `of`.
fn guesses(
    of: &mut Variations,
    condensed: &Condensed,
    varied: &Varied,
    together: &[usize],
) -> Option<Vec<Complex<f64>>> {
    if together.is_empty() {
        return Some(Vec::new());
    }
    let fastest = together.iter().map(|&mode| condensed.modes[mode][0]).fold(0.0, f64::max);
    let limit = (1.5 * fastest).max(fastest + 2.0 * varied.omega);
    let (own, others): (Vec<usize>, Vec<usize>) =
        (0..condensed.modes.len()).partition(|&mode| condensed.modes[mode][0] <= limit);
    let pick = |phi: &[f64]| own.iter().map(|&mode| phi[mode]).collect::<Vec<f64>>();
    let gives: f64 = others.iter().map(|&mode| varied.weights[mode] / varied.squares[mode]).sum();
    let own = Condensed {
        of_element: condensed.of_element.clone(),
        of_polynomial: condensed.of_polynomial.clone(),
        coupled: condensed.coupled.clone(),
        is_by_modes: false,
        places: condensed.places.iter().map(|phi| pick(phi)).collect(),
        drive: pick(&condensed.drive),
        modes: own.iter().map(|&mode| condensed.modes[mode]).collect(),
    };
    // The static compliance of the other modes, c, is in series with the element: S becomes S/(1 + cS), and G becomes
    // G/(1 + cS)².
    let [stiffness, damping, _] = &mut of.samples.by;
    for (s, g) in stiffness.iter_mut().zip(damping) {
        let share = 1.0 / (1.0 + gives * *s);
        *s *= share;
        *g = *g * share * share;
    }
    multipliers(modal::flow(of, &own, [2, 1])?)
}
