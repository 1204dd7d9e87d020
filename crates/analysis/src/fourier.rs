//! Truncated Fourier series of two functions on a uniform grid of one period.
//!
//! A series is a slice of coefficients, two (for α1 and α2) a row: `[c₀, a₁, b₁, a₂, b₂, …]` for
//! x(τ) = c₀ + Σ aₖ cos kτ + bₖ sin kτ. More harmonics are more rows at the end.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Vector2;

use super::dense::dot;

/// Which frequencies a series has, in units of the base frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Harmonics {
    /// A constant and 1, 2, … H: functions of the period of the grid.
    Integer(usize),
    /// ½, 1½, … H − ½: functions that change sign after one period of the grid.
    HalfOdd(usize),
}

impl Harmonics {
    /// Number of rows: of pairs of coefficients.
    pub fn rows(self) -> usize {
        match self {
            Harmonics::Integer(h) => 2 * h + 1,
            Harmonics::HalfOdd(h) => 2 * h,
        }
    }

    /// Rows of constants: 1 or 0.
    pub fn constants(self) -> usize {
        self.rows() % 2
    }

    /// Number of frequencies other than zero.
    pub fn count(self) -> usize {
        self.rows() / 2
    }

    /// Twice the i-th frequency, i from 0.
    pub fn twice_order(self, i: usize) -> usize {
        match self {
            Harmonics::Integer(_) => 2 * (i + 1),
            Harmonics::HalfOdd(_) => 2 * i + 1,
        }
    }

    /// The i-th frequency, i from 0.
    pub fn order(self, i: usize) -> f64 {
        0.5 * self.twice_order(i) as f64
    }
}

/// Tables of cos kτⱼ and sin kτⱼ, frequency by frequency, on N points τⱼ.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    harmonics: Harmonics,
    cosines: Vec<f64>,
    sines: Vec<f64>,
    /// sin τⱼ and cos τⱼ.
    turns: Vec<(f64, f64)>,
}

/// τⱼ = 2πj/N, j = 0 … N − 1.
pub(super) fn uniform(samples: usize) -> impl Iterator<Item = f64> {
    (0..samples).map(move |j| TAU * j as f64 / samples as f64)
}

impl Basis {
    /// The basis on τⱼ = 2πj/N, j = 0 … N − 1.
    pub fn uniform(harmonics: Harmonics, samples: usize) -> Basis {
        let mut basis = Basis { harmonics, cosines: Vec::new(), sines: Vec::new(), turns: Vec::new() };
        basis.set(harmonics, uniform(samples));
        basis
    }

    /// Sets the basis to the given points, rad, in the existing storage, by rotation from each frequency to the next:
    /// cos (k+1)τ + i sin (k+1)τ = (cos kτ + i sin kτ)(cos τ + i sin τ).
    pub fn set(&mut self, harmonics: Harmonics, phases_rad: impl Iterator<Item = f64>) {
        self.harmonics = harmonics;
        self.cosines.clear();
        self.sines.clear();
        self.turns.clear();
        let lowest = harmonics.order(0);
        for phase in phases_rad {
            self.turns.push(libm::sincos(phase));
            if harmonics.count() > 0 {
                let (sine, cosine) = libm::sincos(lowest * phase);
                self.cosines.push(cosine);
                self.sines.push(sine);
            }
        }
        self.fill();
    }

    /// Sets a basis of the harmonics 1, 2, … to those up to H on its points: tables that are there stay.
    pub fn resize(&mut self, harmonics: usize) {
        self.harmonics = Harmonics::Integer(harmonics);
        let kept = harmonics.max(1) * self.turns.len();
        self.cosines.truncate(kept);
        self.sines.truncate(kept);
        self.fill();
    }

    /// The tables that are missing, from the last that is there.
    fn fill(&mut self) {
        let points = self.turns.len();
        let known = self.cosines.len().checked_div(points).unwrap_or(0);
        for i in known.max(1)..self.harmonics.count() {
            for (j, (s, c)) in self.turns.iter().enumerate() {
                let before = (i - 1) * points + j;
                let (x, y) = (self.cosines[before], self.sines[before]);
                self.cosines.push(x * c - y * s);
                self.sines.push(y * c + x * s);
            }
        }
    }

    /// Which frequencies.
    pub fn harmonics(&self) -> Harmonics {
        self.harmonics
    }

    /// N.
    pub fn samples(&self) -> usize {
        self.turns.len()
    }

    /// cos kτⱼ and sin kτⱼ of the i-th frequency for all j.
    pub fn tables(&self, i: usize) -> (&[f64], &[f64]) {
        let range = i * self.samples()..(i + 1) * self.samples();
        (&self.cosines[range.clone()], &self.sines[range])
    }

    /// The functions and their first two derivatives by time at the points; τ runs at `omega_rad_s`. The series may
    /// have fewer harmonics than the basis.
    pub fn synthesise(&self, coefficients: &[f64], omega_rad_s: f64, motion: &mut Motion) {
        motion.reset(self.samples());
        let constants = self.harmonics.constants();
        for dof in 0..2 {
            let [position, velocity, acceleration] = &mut motion.0[dof];
            if constants == 1 {
                position.fill(coefficients[dof]);
            }
            for (i, pair) in coefficients[2 * constants..].chunks_exact(4).enumerate() {
                let (a, b) = (pair[dof], pair[2 + dof]);
                let rate = self.harmonics.order(i) * omega_rad_s;
                let (va, vb, square) = (rate * a, rate * b, rate * rate);
                let (cosines, sines) = self.tables(i);
                let motion = position.iter_mut().zip(velocity.iter_mut()).zip(acceleration.iter_mut());
                for (((x, v), a2), (c, s)) in motion.zip(cosines.iter().zip(sines)) {
                    let value = a * c + b * s;
                    *x += value;
                    *v += vb * c - va * s;
                    *a2 -= square * value;
                }
            }
        }
    }

    /// 2/N Σⱼ f(τⱼ) cos kτⱼ and the same with sin kτⱼ, for the i-th frequency k.
    pub fn project(&self, i: usize, values: &[f64]) -> (f64, f64) {
        let (cosines, sines) = self.tables(i);
        let scale = 2.0 / self.samples() as f64;
        (scale * dot(values, cosines), scale * dot(values, sines))
    }
}

/// α, α̇ and α̈ of both joints at the points of a grid: `[dof][derivative][point]`.
#[derive(Clone, Debug, Default)]
pub(super) struct Motion([[Vec<f64>; 3]; 2]);

impl Motion {
    fn reset(&mut self, samples: usize) {
        for signal in self.0.iter_mut().flatten() {
            signal.clear();
            signal.resize(samples, 0.0);
        }
    }

    /// The `derivative`-th derivative (0, 1, 2) at the point j.
    pub fn at(&self, derivative: usize, j: usize) -> Vector2<f64> {
        Vector2::new(self.0[0][derivative][j], self.0[1][derivative][j])
    }
}

/// Mean of samples.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// An empty series with H harmonics.
pub(super) fn zeros(harmonics: usize) -> Vec<f64> {
    vec![0.0; 2 * Harmonics::Integer(harmonics).rows()]
}

/// The largest |x(τ)| of each of the two functions of a series with integer frequencies.
///
/// A grid of 4H points or more has a point next to the largest value that is at least 0.69 of it: |x″| ≤ H² max |x|
/// (S. Bernstein, "Sur l'ordre de la meilleure approximation des fonctions continues par des polynômes de degré donné",
/// 1912), so that over half a spacing at most (π/4)²/2 of it is lost. Every peak of the grid as high as that is
/// polished by Newton's method on x′ = 0.
pub(super) fn largest(basis: &Basis, coefficients: &[f64], motion: &mut Motion) -> [f64; 2] {
    basis.synthesise(coefficients, 1.0, motion);
    let count = basis.samples();
    core::array::from_fn(|dof| {
        let position = &motion.0[dof][0];
        let highest = position[..count].iter().fold(0.0_f64, |highest, value| highest.max(value.abs()));
        let is_peak = |j: &usize| {
            let [before, here, after] =
                [position[(j + count - 1) % count], position[*j], position[(j + 1) % count]].map(f64::abs);
            here >= 0.69 * highest && here >= before && here >= after
        };
        let peaks = (0..count).filter(is_peak);
        peaks.fold(highest, |largest, j| largest.max(peak(coefficients, dof, TAU * j as f64 / count as f64, count)))
    })
}

/// The height of the peak next to a phase of a grid.
fn peak(coefficients: &[f64], dof: usize, mut phase_rad: f64, samples: usize) -> f64 {
    let spacing = TAU / samples as f64;
    let [mut value, mut slope, mut curvature] = evaluate(coefficients, dof, phase_rad);
    for _ in 0..4 {
        if curvature == 0.0 {
            break;
        }
        phase_rad += (-slope / curvature).clamp(-spacing, spacing);
        let [x, v, a] = evaluate(coefficients, dof, phase_rad);
        if x.abs() < value.abs() {
            break;
        }
        (value, slope, curvature) = (x, v, a);
    }
    value.abs()
}

/// x, x′, x″ of one of the functions at a phase; multiples of the angle by rotation.
fn evaluate(coefficients: &[f64], dof: usize, phase_rad: f64) -> [f64; 3] {
    let (sine, cosine) = libm::sincos(phase_rad);
    let (mut c, mut s) = (1.0, 0.0);
    let mut sum = [coefficients[dof], 0.0, 0.0];
    for (i, pair) in coefficients[2..].chunks_exact(4).enumerate() {
        (c, s) = (c * cosine - s * sine, s * cosine + c * sine);
        let (k, a, b) = ((i + 1) as f64, pair[dof], pair[2 + dof]);
        sum[0] += a * c + b * s;
        sum[1] += k * (b * c - a * s);
        sum[2] -= k * k * (a * c + b * s);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_basis_of_another_size_is_as_if_new() {
        let mut basis = Basis::uniform(Harmonics::Integer(5), 24);
        for harmonics in [9, 3, 0, 4] {
            basis.resize(harmonics);
            let new = Basis::uniform(Harmonics::Integer(harmonics), 24);
            assert_eq!(basis.harmonics(), new.harmonics());
            // Without harmonics the first table is kept for those to come.
            (0..harmonics).for_each(|i| assert_eq!(basis.tables(i), new.tables(i), "{harmonics}: {i}"));
        }
    }

    #[test]
    fn projection_undoes_synthesis() {
        for harmonics in [Harmonics::Integer(5), Harmonics::HalfOdd(5)] {
            let basis = Basis::uniform(harmonics, 24);
            let coefficients: Vec<f64> = (0..2 * harmonics.rows()).map(|i| libm::sin(1.0 + i as f64)).collect();
            let mut motion = Motion::default();
            basis.synthesise(&coefficients, 3.0, &mut motion);
            for dof in 0..2 {
                for i in 0..harmonics.count() {
                    let at = 2 * (harmonics.constants() + 2 * i) + dof;
                    let (c, s) = basis.project(i, &motion.0[dof][0]);
                    assert!((c - coefficients[at]).abs() < 1e-14 && (s - coefficients[at + 2]).abs() < 1e-14);
                    let rate = 3.0 * harmonics.order(i);
                    let (c, s) = basis.project(i, &motion.0[dof][1]);
                    assert!(
                        (c / rate - coefficients[at + 2]).abs() < 1e-13 && (s / rate + coefficients[at]).abs() < 1e-13
                    );
                }
            }
        }
    }

    /// sin τ + ⅓ sin 3τ has its peaks where cos τ + cos 3τ = 2 cos 2τ cos τ = 0: at 45°, with the height √½ + ⅓ √½.
    #[test]
    fn finds_the_peak_between_the_samples() {
        let mut coefficients = zeros(3);
        coefficients[4] = 1.0;
        coefficients[12] = 1.0 / 3.0;
        coefficients[5] = -2.0;
        let basis = Basis::uniform(Harmonics::Integer(3), 14);
        let [first, second] = largest(&basis, &coefficients, &mut Motion::default());
        assert!((first - libm::sqrt(0.5) * 4.0 / 3.0).abs() < 1e-12, "{first}");
        assert!((second - 2.0).abs() < 1e-12, "{second}");
    }

    /// The higher, 1.001, of two peaks of nearly the same height, at any shift against the grid: sin τ + 0.001 cos 2τ.
    #[test]
    fn finds_the_higher_of_two_peaks() {
        let basis = Basis::uniform(Harmonics::Integer(2), 14);
        for shift in (0..40).map(|k| f64::from(k) * TAU / 40.0) {
            let mut coefficients = zeros(2);
            (coefficients[2], coefficients[4]) = libm::sincos(shift);
            let (sine, cosine) = libm::sincos(2.0 * shift);
            (coefficients[6], coefficients[8]) = (1e-3 * cosine, -1e-3 * sine);
            let [largest, none] = largest(&basis, &coefficients, &mut Motion::default());
            assert!((largest - 1.001).abs() < 1e-12 && none == 0.0, "{shift}: {largest}");
        }
    }
}
