//! Modes at the place of an element that varies over a period: compliance and couplings of harmonics; see
//! [`super::exponents`].

use alloc::vec::Vec;

use nalgebra::Complex;
use resonarm_numeric::registers::{Task, widest};

use super::{Variations, largest, repeats_after_half};
use crate::unknowns::Condensed;

/// Fourier coefficients below this part of the largest are none.
const NEGLIGIBLE: f64 = 1e-13;
/// The largest change of an exponent by the harmonics that are left out, over Ω, were they at the sharpest resonance.
pub(super) const OMITTED: f64 = 1e-10;

/// Modes at the place of an element, and the element along the response.
pub(super) struct Varied {
    /// φ², ω² and 2ζω of each mode.
    pub weights: Vec<f64>,
    pub squares: Vec<f64>,
    pub dampings: Vec<f64>,
    /// Angular frequency of the response Ω, rad/s.
    pub omega: f64,
    /// S and G of the harmonics 0, `step`, 2 `step` …; all beyond are negligible.
    pub coefficients: Vec<[Complex<f64>; 2]>,
    /// 2 if odd harmonics vanish, or else 1.
    pub step: usize,
    /// Whether G is not zero.
    pub damps: bool,
    /// The largest |H| of a mode at its resonance.
    pub sharpest: f64,
}

impl Varied {
    /// Computes them; `None` if there are not enough samples for the element.
    pub fn new(of: &Variations, condensed: &Condensed) -> Option<Varied> {
        let phi = &condensed.places[0];
        let count = of.samples.count();
        let half = count / 2;
        let signals = [&of.samples.by[0], &of.samples.by[1]];
        let limits = signals.map(|signal| NEGLIGIBLE * largest(signal));
        let repeats = (0..2).all(|d| repeats_after_half(signals[d], limits[d]));
        // A signal with half the period has even harmonics only, and half the samples hold all of it.
        let (step, length) = if repeats { (2, half) } else { (1, count) };
        let resonance = |(phi, [omega, zeta]): (&f64, &[f64; 2])| phi * phi / (2.0 * zeta * omega * omega);
        let (cosines, sines) = of.samples.basis.tables(0);
        // A plain sum for each order, and not a fast transform: the loop below ends as soon as the coefficients are
        // negligible.
        let coefficient = |order: usize| {
            signals.map(|signal| {
                let mut sum = Complex::new(0.0, 0.0);
                let mut turn = 0;
                for value in &signal[..length] {
                    sum += Complex::new(cosines[turn], -sines[turn]) * *value;
                    // The angle at sample m is 2π m·order·step/count, so that its place in the tables advances by the
                    // same number each time.
                    turn = (turn + order * step) % count;
                }
                sum / length as f64
            })
        };
        let mut coefficients = Vec::new();
        let mut last = 0;
        for order in 0..length / 2 {
            let both: [Complex<f64>; 2] = coefficient(order);
            let counts = (0..2).any(|d| both[d].norm_sqr() > limits[d] * limits[d]);
            coefficients.push(both);
            last = if counts { order } else { last };
            // Three negligible orders in a row end the series: one alone may vanish by symmetry.
            if order > last + 2 {
                coefficients.truncate(last + 1);
                return Some(Varied {
                    weights: phi.iter().map(|phi| phi * phi).collect(),
                    squares: condensed.modes.iter().map(|[omega, _]| omega * omega).collect(),
                    dampings: condensed.modes.iter().map(|[omega, zeta]| 2.0 * zeta * omega).collect(),
                    omega: of.balance.omega_rad_s(),
                    coefficients,
                    step,
                    damps: limits[1] > 0.0,
                    sharpest: phi.iter().zip(&condensed.modes).map(resonance).fold(0.0, f64::max),
                });
            }
        }
        None
    }

    /// Returns S and G of a harmonic.
    #[inline(always)]
    pub fn coefficients_of(&self, harmonic: isize) -> [Complex<f64>; 2] {
        let Some(of) = self.coefficients.get(harmonic.unsigned_abs() / self.step) else {
            return [Complex::new(0.0, 0.0); 2];
        };
        if harmonic < 0 { of.map(|of| of.conj()) } else { *of }
    }

    /// Returns T of two harmonics by their difference and the second's rate s + ilΩ.
    #[inline(always)]
    pub fn coupling(&self, difference: isize, rate: Complex<f64>) -> Complex<f64> {
        let [s, g] = self.coefficients_of(difference);
        if self.damps { s + rate * g } else { s }
    }

    /// Returns the exponent of a harmonic of the disturbance, s + ikΩ, 1/s.
    pub fn rate(&self, s: Complex<f64>, harmonic: isize) -> Complex<f64> {
        Complex::new(s.re, s.im + harmonic as f64 * self.omega)
    }

    /// Returns the compliance H of the linear structure at an exponent.
    pub fn compliance(&self, s: Complex<f64>) -> Complex<f64> {
        let add = |lanes: &mut [[f64; 4]; 4], lane: usize, [weight, _]: [f64; 2], [re, im]: [f64; 2]| {
            let scale = weight / (re * re + im * im);
            lanes[0][lane] += re * scale;
            lanes[1][lane] -= im * scale;
        };
        widest(OverModes { of: self, s, add })[0]
    }

    /// Returns 1/H and its derivative.
    pub fn stiffness(&self, s: Complex<f64>) -> [Complex<f64>; 2] {
        let add = |lanes: &mut [[f64; 4]; 4], lane: usize, [weight, damping]: [f64; 2], [re, im]: [f64; 2]| {
            let inverse = 1.0 / (re * re + im * im);
            let a = re * inverse;
            let b = -im * inverse;
            let c = weight * (2.0 * s.re + damping);
            let d = weight * 2.0 * s.im;
            let e = a * a - b * b;
            let f = 2.0 * a * b;
            lanes[0][lane] += weight * a;
            lanes[1][lane] += weight * b;
            lanes[2][lane] -= e * c - f * d;
            lanes[3][lane] -= e * d + f * c;
        };
        let [value, slope] = widest(OverModes { of: self, s, add });
        let inverse = value.inv();
        [inverse, -slope * inverse * inverse]
    }
}

/// Two complex sums over modes in four lanes, by φ² and 2ζω and by the parts of ω² + 2ζωs + s².
struct OverModes<'a, F> {
    of: &'a Varied,
    s: Complex<f64>,
    add: F,
}

impl<F: Fn(&mut [[f64; 4]; 4], usize, [f64; 2], [f64; 2])> Task for OverModes<'_, F> {
    type Output = [Complex<f64>; 2];

    #[inline(always)]
    fn run(self) -> [Complex<f64>; 2] {
        let OverModes { of, s, add } = self;
        let mut lanes = [[0.0; 4]; 4];
        let s2 = s * s;
        let parts = |damping: f64, square: f64| [square + damping * s.re + s2.re, damping * s.im + s2.im];
        let fours = [&of.weights, &of.squares, &of.dampings].map(|of| of.as_chunks::<4>());
        for ((weights, squares), dampings) in fours[0].0.iter().zip(fours[1].0).zip(fours[2].0) {
            for lane in 0..4 {
                add(&mut lanes, lane, [weights[lane], dampings[lane]], parts(dampings[lane], squares[lane]));
            }
        }
        for ((weight, square), damping) in fours[0].1.iter().zip(fours[1].1).zip(fours[2].1) {
            add(&mut lanes, 0, [*weight, *damping], parts(*damping, *square));
        }
        // There are four lanes on every processor, and they are added in a fixed order: the bits do not depend on the
        // width of its registers.
        let [a, b, c, d] = lanes.map(|lane| (lane[0] + lane[1]) + (lane[2] + lane[3]));
        [Complex::new(a, b), Complex::new(c, d)]
    }
}
