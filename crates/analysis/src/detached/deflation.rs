//! Deflation (P. E. Farrell, Á. Birkisson, S. W. Funke, "Deflation Techniques for Finding Distinct Solutions of
//! Nonlinear Partial Differential Equations", SIAM J. Sci. Comput. 37 (2015)).
//!
//! With known solutions kᵢ of R(x) = 0 the function M(x) R(x),
//!
//! ```text
//! M(x) = Π mᵢ,     mᵢ = 1 + 1/rᵢ²,     rᵢ = |x − kᵢ|/|kᵢ|,
//! ```
//!
//! has the other solutions of R only. Newton's step of it, (M J + R ∇Mᵀ) d = −M R, is a multiple of that of R, d₀ =
//! −J⁻¹R:
//!
//! ```text
//! d = d₀/(1 − ∇ln M · d₀),     ∇ln mᵢ · d₀ = −2 (x − kᵢ)·d₀/(|kᵢ|² rᵢ⁴ mᵢ).
//! ```
//!
//! Near a known solution d₀ leads to it, and d away from it.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use resonarm_numeric::noise::Noise;

use super::{SAME, Searcher};
use crate::adapt::begin;
use crate::balance::Balance;
use crate::branch_options::{BifurcationKind, BranchOptions};
use crate::continuation::{System, Work, at_parameter};
use crate::dense::{Lu, dot, norm};
use crate::detect::point_of;
use crate::forced::Coordinate;
use crate::orbit::Branch;

/// The sizes of random starts, over that of the largest response of the branch.
pub(super) const SHARES: [f64; 2] = [0.5, 4.0];
/// The most steps from a start. One whose steps are still longer than a share of the response after some of them is
/// given up: few of these converge.
const STEPS: usize = 30;
const WANDERS: (usize, f64) = (15, 0.6);
/// The longest step, relative to the response.
const LONGEST_STEP: f64 = 0.7;
/// A correction below this, relative to the response, is the last one.
const CORRECTION: f64 = 1e-8;
/// The seed of the random numbers; each frequency has a stream of its own.
const SEED: u64 = 1;

impl Searcher<'_> {
    /// Searches from random starts at frequencies within the range, and returns these.
    pub(super) fn deflation(&mut self) -> Vec<f64> {
        let [low, high] = self.range();
        let count = self.search.frequencies;
        let hz = |k: usize| low + (high - low) * k as f64 / (count + 1) as f64;
        let frequencies: Vec<f64> = (1..=count).map(hz).collect();
        let sizes = self.sizes();
        for (stream, frequency_hz) in (0..).zip(&frequencies) {
            self.at_frequency(*frequency_hz, &sizes, Noise::new(SEED, stream));
        }
        frequencies
    }

    /// Returns the largest first harmonic of each unknown along the branch.
    fn sizes(&self) -> Vec<f64> {
        let m = self.balance(self.options.branch.from, self.harmonics()).unknowns.count();
        let mut sizes = vec![0.0_f64; m];
        for orbit in self.known.iter().take(1).flat_map(|branch| &branch.orbits) {
            for (i, size) in sizes.iter_mut().enumerate() {
                *size = size.max(libm::hypot(orbit.coefficients[m + i], orbit.coefficients[2 * m + i]));
            }
        }
        sizes
    }

    /// Tries rest and random starts at a frequency, and follows the branches of the new responses.
    fn at_frequency(&mut self, frequency_hz: f64, sizes: &[f64], mut noise: Noise) {
        let mut balance = self.balance(frequency_hz, self.harmonics());
        let mut known = Vec::new();
        for branch in self.known() {
            known.extend(self.crossings(branch, &balance));
        }
        let mut newton = Newton::default();
        for x in &mut known {
            newton.correct(&mut balance, x, &[]);
        }
        for number in 0..self.search.starts {
            // The first start is from rest: a large branch leaves small responses aside.
            let mut x = match number {
                0 => vec![0.0; balance.dimension()],
                _ => start(sizes, balance.dimension(), &mut noise),
            };
            if !newton.correct(&mut balance, &mut x, &known) {
                continue;
            }
            // Other starts must not lead to it again, even if it has no counterpart with more harmonics.
            known.push(x.clone());
            if self.consider(frequency_hz, &x)
                && let Some(found) = self.found.last()
            {
                // Its branch may pass this frequency more than once.
                for mut x in self.crossings(found.branch(), &balance) {
                    if newton.correct(&mut balance, &mut x, &[]) && !known.iter().any(|known| same(known, &x)) {
                        known.push(x);
                    }
                }
            }
        }
        self.work += newton.work;
    }

    /// Follows the branch of a response found with few harmonics, and says whether it is a new one.
    fn consider(&mut self, frequency_hz: f64, x: &[f64]) -> bool {
        let mut balance = self.balance(frequency_hz, self.harmonics());
        let to = self.range()[1];
        match begin(&mut balance, &BranchOptions { from: frequency_hz, to, ..self.options.branch }, x) {
            Ok(seed) if !self.is_known(seed.point()) => self.follow(balance, seed),
            _ => false,
        }
    }

    /// Returns the responses of a branch at the frequency of a balance, with as many unknowns as it has.
    fn crossings(&self, branch: &Branch, balance: &Balance) -> Vec<Vec<f64>> {
        let frequency_hz = balance.frequency_hz;
        let n = balance.dimension();
        let m = balance.unknowns.count();
        // With its folds, the branch passes the frequency at most once between two points.
        let folds = branch.bifurcations.iter().filter(|found| found.kind == BifurcationKind::Fold);
        let mut orbits: Vec<_> = branch.orbits.iter().chain(folds.map(|fold| &fold.orbit)).collect();
        orbits.sort_by(|a, b| a.arclength.total_cmp(&b.arclength));
        let mut crossings = Vec::new();
        for pair in orbits.windows(2) {
            if (pair[0].value - frequency_hz) * (pair[1].value - frequency_hz) > 0.0 || pair[0].value == pair[1].value {
                continue;
            }
            let [a, b] = [point_of(pair[0]), point_of(pair[1])];
            let harmonics = a.x.len().max(b.x.len()) / m / 2;
            let mut fine = Balance::new(self.forced, frequency_hz, Coordinate::FrequencyHz, harmonics);
            let settings = &self.options.branch.continuation;
            let mut x = at_parameter(&mut fine, settings, [&a, &b], frequency_hz).map_or(a.x, |point| point.x);
            x.resize(n, 0.0);
            crossings.push(x);
        }
        crossings
    }
}

/// Returns a random start: a first harmonic, with a size and a phase of its own for each unknown.
fn start(sizes: &[f64], dimension: usize, noise: &mut Noise) -> Vec<f64> {
    let m = sizes.len();
    let mut x = vec![0.0; dimension];
    // Even on a logarithmic scale, so that small responses are tried as often as large ones.
    let ratio = libm::log(SHARES[1] / SHARES[0]);
    for (i, size) in sizes.iter().enumerate() {
        let amplitude = size * SHARES[0] * libm::exp(ratio * noise.uniform());
        let phase = TAU * noise.uniform();
        x[m + i] = amplitude * libm::cos(phase);
        x[2 * m + i] = amplitude * libm::sin(phase);
    }
    x
}

/// Says whether two responses with the same number of harmonics are one.
fn same(a: &[f64], b: &[f64]) -> bool {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    libm::sqrt(square) < SAME * norm(a).max(norm(b))
}

/// Storage of Newton's method, with counts of its work.
#[derive(Default)]
struct Newton {
    lu: Lu,
    step: Vec<f64>,
    work: Work,
}

impl Newton {
    /// Corrects a response at the frequency of a balance, away from known ones, and returns whether it converged.
    fn correct(&mut self, balance: &mut Balance, x: &mut [f64], known: &[Vec<f64>]) -> bool {
        let n = x.len();
        for step in 0..STEPS {
            self.step.clear();
            self.step.resize(n, 0.0);
            let matrix = self.lu.zeroed(n);
            balance.derivatives(x, &[], &mut self.step, matrix, n);
            self.work.evaluations += 1;
            self.work.factorizations += 1;
            if self.lu.factor().is_err() {
                return false;
            }
            self.lu.solve(&mut self.step);
            self.step.iter_mut().for_each(|step| *step = -*step);
            let mut gradient = 0.0;
            for known in known {
                let away: Vec<f64> = x.iter().zip(known).map(|(x, known)| x - known).collect();
                let size = dot(known, known);
                let r2 = dot(&away, &away) / size;
                gradient -= 2.0 * dot(&away, &self.step) / (size * r2 * r2 * (1.0 + 1.0 / r2));
            }
            let size = norm(x);
            let length = norm(&self.step) / (1.0 - gradient).abs();
            if !length.is_finite() || (step >= WANDERS.0 && length > WANDERS.1 * size) {
                return false;
            }
            // From rest the first step leads to the linear response.
            let shortened = if size > 0.0 { (LONGEST_STEP * size / length).min(1.0) } else { 1.0 };
            // Deflation changes the length of Newton's step, and its sense where the divisor is negative, but not its
            // line.
            let factor = shortened / (1.0 - gradient);
            x.iter_mut().zip(&self.step).for_each(|(x, step)| *x += factor * step);
            if length < CORRECTION * size {
                return true;
            }
        }
        false
    }
}
