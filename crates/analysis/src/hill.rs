//! Multipliers under an excitation that is slow against the modes, by Hill's infinite determinant about each mode (G.
//! W. Hill, "On the part of the motion of the lunar perigee which is a function of the mean motions of the sun and
//! moon", Acta Math. 8 (1886); for several degrees of freedom V. V. Bolotin, "The Dynamic Stability of Elastic
//! Systems", 1964).
//!
//! A variation is e^λτ times a function of the period, y = Σ vₖ e^(λ + ik)τ, and y″ = P y + Q y′ becomes N(λ) v = 0,
//!
//! ```text
//! Nₖₗ(λ) = (λ + ik)² δₖₗ − P̂ₖ₋ₗ − (λ + il) Q̂ₖ₋ₗ
//! ```
//!
//! with the Fourier coefficients of P and Q. λ and λ + ik have the same multiplier e^2πλ, so one λ of each mode is
//! enough, and the conjugates. The mode's frequency is modulated slowly and little, so few k about it matter, while
//! integration has to follow every cycle of the mode. Newton's method for v and λ together (H. Unger, "Nichtlineare
//! Behandlung von Eigenwertaufgaben", Z. Angew. Math. Mech. 30 (1950)), from the exponents of the mean:
//!
//! ```text
//! N(λ) u = N′(λ) v        λ ← λ − v*v / v*u        v ← u / |u|
//! ```

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::{Complex, Matrix2, Matrix4, Vector2};

use super::dense::Lu;
use super::eigenvalues::of_four;

/// Frequencies on each side of a mode's: the smallest sufficient of these numbers.
const WIDTHS: [usize; 4] = [4, 8, 16, 32];
/// The largest fraction of a variation in the outermost frequencies; the error of λ is of the order of its square.
const EDGE: f64 = 1e-8;
/// Newton's limit, and the change of λ, relative, that ends it.
const NEWTON: (usize, f64) = (12, 1e-14);

/// P and Q, or their Fourier coefficients.
pub(super) type Rates<T> = (Matrix2<T>, Matrix2<T>);

/// The exponents λ with positive imaginary part, one of each mode, and the storage for finding them.
#[derive(Clone, Debug, Default)]
pub(super) struct Hill {
    /// P̂ₘ and Q̂ₘ, m = 0 … 2K; those of −m are the conjugates.
    series: Vec<Rates<Complex<f64>>>,
    /// The variation, from −K to K.
    v: Vec<Vector2<Complex<f64>>>,
    lu: Lu,
    right: Vec<f64>,
}

impl Hill {
    /// Samples of P and Q over the period that [`Hill::exponents`] needs.
    pub const SAMPLES: usize = 4 * WIDTHS[WIDTHS.len() - 1] + 4;

    /// λ of both modes, from samples of P and Q at equal distances over the period. None if a mode does not oscillate,
    /// or if more frequencies matter than are available.
    pub fn exponents(&mut self, rates: &[Rates<f64>]) -> Option<[Complex<f64>; 2]> {
        self.transform(rates);
        let beginnings = self.exponents_of_the_mean()?;
        let mut found = [Complex::new(0.0, 0.0); 2];
        for (found, beginning) in found.iter_mut().zip(beginnings) {
            *found = WIDTHS.iter().find_map(|width| self.exponent(beginning, *width))?;
        }
        Some(found)
    }

    fn transform(&mut self, rates: &[Rates<f64>]) {
        let count = rates.len();
        self.series.clear();
        for m in 0..=2 * WIDTHS[WIDTHS.len() - 1] {
            let mut sum = (Matrix2::zeros(), Matrix2::zeros());
            for (j, (p, q)) in rates.iter().enumerate() {
                let (sine, cosine) = libm::sincos(TAU * ((j * m) % count) as f64 / count as f64);
                let turn = Complex::new(cosine, -sine) / count as f64;
                sum.0 += p.map(|value| turn * value);
                sum.1 += q.map(|value| turn * value);
            }
            self.series.push(sum);
        }
    }

    /// The eigenvalues with positive imaginary part of (y, y′) under the mean of P and Q; y′ is measured in units of
    /// √|P|, which evens out the matrix.
    fn exponents_of_the_mean(&self) -> Option<[Complex<f64>; 2]> {
        let (p, q) = self.series.first()?;
        let unit = libm::sqrt(p.iter().fold(0.0, |largest: f64, value| largest.max(value.re.abs())));
        let mut matrix = Matrix4::zeros();
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            matrix[(i, 2 + j)] = if i == j { unit } else { 0.0 };
            matrix[(2 + i, j)] = p[(i, j)].re / unit;
            matrix[(2 + i, 2 + j)] = q[(i, j)].re;
        }
        let mut rising = of_four(&matrix).into_iter().filter(|value| value.im > 0.0);
        Some([rising.next()?, rising.next()?])
    }

    /// P̂ₘ and Q̂ₘ.
    fn at(&self, m: isize) -> Rates<Complex<f64>> {
        let (p, q) = self.series[m.unsigned_abs()];
        if m < 0 { (p.map(|z| z.conj()), q.map(|z| z.conj())) } else { (p, q) }
    }

    /// Newton's method with 2K + 1 frequencies. None if it does not converge, or they are too few.
    fn exponent(&mut self, beginning: Complex<f64>, width: usize) -> Option<Complex<f64>> {
        let mut lambda = beginning;
        self.v.clear();
        self.v.resize(2 * width + 1, Vector2::zeros());
        let (p, q) = self.at(0);
        let n = Matrix2::identity() * (lambda * lambda) - p - q * lambda;
        let [first, second] = [Vector2::new(-n.m12, n.m11), Vector2::new(n.m22, -n.m21)];
        let shape = if first.norm() > second.norm() { first } else { second };
        self.v[width] = shape / Complex::new(shape.norm(), 0.0);
        for _ in 0..NEWTON.0 {
            let change = self.improve(lambda, width)?;
            lambda -= change;
            if change.norm_sqr() <= NEWTON.1 * NEWTON.1 * lambda.norm_sqr() {
                let edge = self.v[0].norm().max(self.v[2 * width].norm());
                return (edge < EDGE).then_some(lambda);
            }
        }
        None
    }

    /// One iteration: `v` becomes the new one, and the change of λ is returned. Complex equations as real ones of twice
    /// the size, (a + ib)(x + iy) = (ax − by) + i (bx + ay).
    fn improve(&mut self, lambda: Complex<f64>, width: usize) -> Option<Complex<f64>> {
        let count = 2 * width + 1;
        let half = 2 * count;
        let shifted = |at: usize| lambda + Complex::new(0.0, at as f64 - width as f64);
        self.right.clear();
        self.right.resize(2 * half, 0.0);
        self.lu.zeroed(2 * half);
        for l in 0..count {
            for k in 0..count {
                let (p, q) = self.at(k as isize - l as isize);
                let mut right = -(q * self.v[l]);
                let mut block = -p - q * shifted(l);
                if k == l {
                    block += Matrix2::identity() * (shifted(k) * shifted(k));
                    right += self.v[k] * (shifted(k) * 2.0);
                }
                let matrix = self.lu.elements();
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let (row, column, z) = (2 * k + i, 2 * l + j, block[(i, j)]);
                    matrix[row + 2 * half * column] = z.re;
                    matrix[half + row + 2 * half * column] = z.im;
                    matrix[row + 2 * half * (half + column)] = -z.im;
                    matrix[half + row + 2 * half * (half + column)] = z.re;
                }
                for i in 0..2 {
                    self.right[2 * k + i] += right[i].re;
                    self.right[half + 2 * k + i] += right[i].im;
                }
            }
        }
        self.lu.factor().ok()?;
        self.lu.solve(&mut self.right);
        let u = |k: usize| Vector2::from_fn(|i, _| Complex::new(self.right[2 * k + i], self.right[half + 2 * k + i]));
        let (mut along, mut size) = (Complex::new(0.0, 0.0), 0.0);
        for (k, v) in self.v.iter().enumerate() {
            along += v.dotc(&u(k));
            size += u(k).norm_squared();
        }
        let size = libm::sqrt(size);
        for k in 0..count {
            self.v[k] = u(k) / Complex::new(size, 0.0);
        }
        // |v| was 1.
        let change = Complex::new(1.0, 0.0) / along;
        (change.re.is_finite() && change.im.is_finite()).then_some(change)
    }
}
