//! Tables of the functions of truncated Fourier series: 1, cos kτ and sin kτ, k = 1 … H.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use resonarm_numeric::registers::{Task, widest};

use super::dense::dot;

/// Tables of cos kτⱼ and sin kτⱼ, frequency by frequency, on N points τⱼ.
#[derive(Clone, Debug, Default)]
pub(super) struct Basis {
    /// Number of harmonics, H.
    harmonics: usize,
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
    pub fn uniform(harmonics: usize, samples: usize) -> Basis {
        let mut basis = Basis::default();
        basis.set(harmonics, uniform(samples));
        basis
    }

    /// Sets the basis to the given points, rad, in the existing storage, by rotation from each frequency to the next:
    /// cos (k+1)τ + i sin (k+1)τ = (cos kτ + i sin kτ)(cos τ + i sin τ).
    pub fn set(&mut self, harmonics: usize, phases_rad: impl Iterator<Item = f64>) {
        self.harmonics = harmonics;
        self.cosines.clear();
        self.sines.clear();
        self.turns.clear();
        for phase in phases_rad {
            let (sine, cosine) = libm::sincos(phase);
            self.turns.push((sine, cosine));
            if harmonics > 0 {
                self.cosines.push(cosine);
                self.sines.push(sine);
            }
        }
        self.fill();
    }

    /// Sets a basis of the harmonics 1, 2, … to those up to H on its points: tables that are there stay.
    pub fn resize(&mut self, harmonics: usize) {
        self.harmonics = harmonics;
        // The first table stays even without harmonics, since all others are made from it.
        let kept = harmonics.max(1) * self.turns.len();
        self.cosines.truncate(kept);
        self.sines.truncate(kept);
        self.fill();
    }

    /// The tables that are missing, from the last that is there.
    fn fill(&mut self) {
        // Table by table, so that the product sums of `project` run over adjacent numbers.
        let points = self.turns.len();
        let known = self.cosines.len().checked_div(points).unwrap_or(0);
        for i in known.max(1)..self.harmonics {
            for (j, (s, c)) in self.turns.iter().enumerate() {
                let before = (i - 1) * points + j;
                let x = self.cosines[before];
                let y = self.sines[before];
                self.cosines.push(x * c - y * s);
                self.sines.push(y * c + x * s);
            }
        }
    }

    /// Number of harmonics, H.
    pub fn harmonics(&self) -> usize {
        self.harmonics
    }

    /// Number of samples a period, N.
    pub fn samples(&self) -> usize {
        self.turns.len()
    }

    /// cos kτⱼ and sin kτⱼ of the i-th frequency for all j.
    pub fn tables(&self, i: usize) -> (&[f64], &[f64]) {
        let range = i * self.samples()..(i + 1) * self.samples();
        (&self.cosines[range.clone()], &self.sines[range])
    }

    /// 2/N Σⱼ f(τⱼ) cos kτⱼ and the same with sin kτⱼ, for the i-th frequency k.
    pub fn project(&self, i: usize, values: &[f64]) -> (f64, f64) {
        let scale = 2.0 / self.samples() as f64;
        let [cosine, sine] = widest(Project { values, tables: self.tables(i) });
        (scale * cosine, scale * sine)
    }
}

/// Σⱼ f(τⱼ) cos kτⱼ and Σⱼ f(τⱼ) sin kτⱼ.
struct Project<'a> {
    values: &'a [f64],
    tables: (&'a [f64], &'a [f64]),
}

impl Task for Project<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run(self) -> [f64; 2] {
        [dot(self.values, self.tables.0), dot(self.values, self.tables.1)]
    }
}

/// Returns x, x′ and x″ of a series at a phase; multiples of the angle by rotation.
pub(super) fn values(series: &[f64], phase_rad: f64) -> [f64; 3] {
    let (sine, cosine) = libm::sincos(phase_rad);
    let mut c = 1.0;
    let mut s = 0.0;
    let mut sum = [series[0], 0.0, 0.0];
    for (i, pair) in series[1..].chunks_exact(2).enumerate() {
        (c, s) = (c * cosine - s * sine, s * cosine + c * sine);
        let k = (i + 1) as f64;
        let value = pair[0] * c + pair[1] * s;
        sum[0] += value;
        sum[1] += k * (pair[1] * c - pair[0] * s);
        sum[2] -= k * k * value;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_basis_of_another_size_is_as_if_new() {
        let mut basis = Basis::uniform(5, 24);
        for harmonics in [9, 3, 0, 4] {
            basis.resize(harmonics);
            let new = Basis::uniform(harmonics, 24);
            assert_eq!(basis.harmonics(), new.harmonics());
            // Without harmonics the first table is kept for those to come.
            (0..harmonics).for_each(|i| assert_eq!(basis.tables(i), new.tables(i), "{harmonics}: {i}"));
        }
    }
}
