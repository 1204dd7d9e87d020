//! Stability of a periodic motion by its Floquet multipliers (A. H. Nayfeh, B. Balachandran, "Applied Nonlinear
//! Dynamics", 1995, Ch. 3).
//!
//! A variation y of the motion satisfies M y″ + G/ω y′ + S/ω² y = 0 in the phase τ = ωt. Its flow over one period, the
//! monodromy matrix, has the multipliers μ as eigenvalues; the motion is stable if all |μ| < 1. At damping ratios of
//! 1e-4 the multipliers are within a thousandth of the unit circle, so the flow is integrated by Gauss–Legendre
//! collocation with four stages, which has no numerical damping: order 8, relative frequency error −(ωh)⁸/25 401 600.
//! Where the excitation is so slow that this takes many thousands of steps, Hill's method has the multipliers
//! ([`super::hill`]).
//!
//! With A(τᵢ) known at the stages the stage accelerations kᵢ solve a linear system, once for the four columns together:
//!
//! ```text
//! kᵢ = Pᵢ (y + cᵢ h y′ + h² Σⱼ (a²)ᵢⱼ kⱼ) + Qᵢ (y′ + h Σⱼ aᵢⱼ kⱼ)        P = −M⁻¹S/ω²,  Q = −M⁻¹G/ω
//! ```

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::{Complex, Matrix2, Matrix4};

use super::eigenvalues::of_four;
use super::fourier::{Basis, Harmonics, Motion, uniform};
use super::gauss::{S, Tableau, steps_for};
use super::hill::{Hill, Rates};
use super::{HarmonicBalance, Instant, Oscillator};
use resonarm_numeric::linear_solve::solve;

/// The rounding error of a product of multipliers that is 1.
const ROUNDING: f64 = 1e-12;
/// Beyond this number of steps a period, Hill's method is faster.
const SLOW_STEPS: usize = 2048;
/// Hill's method is accepted if Liouville's formula holds to this error.
const LIOUVILLE: f64 = 1e-8;
/// Steps whose tables are computed together.
const CHUNK: usize = 2048;

/// The multipliers of a motion, and its stability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stability {
    /// μ, the largest magnitude first.
    pub multipliers: [Complex<f64>; 4],
    /// det of the monodromy matrix over exp ∫ tr A, less 1: zero by Liouville's formula, and a measure of the error.
    pub liouville_defect: f64,
}

impl Stability {
    /// Whether variations die out: all |μ| < 1.
    pub fn is_stable(&self) -> bool {
        self.multipliers[0].norm_sqr() < 1.0
    }

    /// Π (μᵢ + 1): changes sign where one multiplier passes −1, a period doubling.
    pub fn period_doubling_test(&self) -> f64 {
        self.multipliers.iter().map(|mu| mu + 1.0).product::<Complex<f64>>().re
    }

    /// Π (μᵢμⱼ − 1) over i < j, the determinant of the bialternate product less the identity (Kuznetsov, Ch. 10):
    /// changes sign where a complex pair passes the unit circle, a Neimark–Sacker point, or where two real ones have
    /// the product 1. Zero if a factor is within rounding of zero, as always without damping.
    pub fn neimark_sacker_test(&self) -> f64 {
        let mu = &self.multipliers;
        let pairs = (0..4).flat_map(|i| (i + 1..4).map(move |j| mu[i] * mu[j] - 1.0));
        let factors =
            pairs.map(|factor| if factor.norm_sqr() < ROUNDING * ROUNDING { Complex::new(0.0, 0.0) } else { factor });
        factors.product::<Complex<f64>>().re
    }
}

/// The work of computing stability.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StabilityWork {
    /// Motions whose multipliers were computed.
    pub motions: usize,
    /// Steps of the integration of their variations; none under an excitation so slow that Hill's method is used.
    pub steps: usize,
}

/// Computes multipliers; keeps the tables for the last number of harmonics and steps.
#[derive(Clone, Debug)]
pub struct Floquet {
    work: StabilityWork,
    tableau: Tableau,
    /// The steps a period of the tables, and the first step that they cover.
    tables: (usize, usize),
    basis: Basis,
    motion: Motion,
    rates: Vec<Rates<f64>>,
    hill: Hill,
}

impl Default for Floquet {
    fn default() -> Floquet {
        let basis = Basis::uniform(Harmonics::Integer(1), 0);
        Floquet {
            work: StabilityWork::default(),
            tableau: Tableau::new(),
            tables: (0, 0),
            basis,
            motion: Motion::default(),
            rates: Vec::new(),
            hill: Hill::default(),
        }
    }
}

impl Floquet {
    /// The steps a period of a motion.
    fn steps_for<O: Oscillator>(balance: &HarmonicBalance<O>) -> usize {
        let fastest = balance.oscillator().modes()[1].frequency_rad_s;
        steps_for(TAU * fastest / balance.base_rad_s(), balance.harmonics())
    }

    /// The stability of the motion X of the balance.
    pub fn stability<O: Oscillator>(&mut self, balance: &HarmonicBalance<O>, x: &[f64]) -> Stability {
        self.work.motions += 1;
        let steps = Floquet::steps_for(balance);
        let slow = if steps > SLOW_STEPS { self.stability_by_hill(balance, x) } else { None };
        slow.unwrap_or_else(|| self.stability_with(balance, x, steps))
    }

    /// The same by Hill's method; none if that fails.
    fn stability_by_hill<O: Oscillator>(&mut self, balance: &HarmonicBalance<O>, x: &[f64]) -> Option<Stability> {
        self.basis.set(frequencies(balance), uniform(Hill::SAMPLES));
        self.tables = (0, 0);
        self.basis.synthesise(x, balance.base_rad_s(), &mut self.motion);
        self.linearise(balance);
        let exponents = self.hill.exponents(&self.rates)?;
        let trace = self.rates.iter().map(|(_, q)| q.trace()).sum::<f64>() / self.rates.len() as f64;
        let sum: f64 = exponents.iter().map(|exponent| 2.0 * exponent.re).sum();
        let liouville_defect = libm::exp(TAU * (sum - trace)) - 1.0;
        let [a, b] = exponents.map(|exponent| {
            let (sine, cosine) = libm::sincos(TAU * (exponent.im - libm::round(exponent.im)));
            Complex::new(cosine, sine) * libm::exp(TAU * exponent.re)
        });
        let multipliers = largest_first([a, a.conj(), b, b.conj()]);
        (liouville_defect.abs() < LIOUVILLE).then_some(Stability { multipliers, liouville_defect })
    }

    /// Its work.
    pub fn work(&self) -> StabilityWork {
        self.work
    }

    /// The same with a given number of steps.
    fn stability_with<O: Oscillator>(&mut self, balance: &HarmonicBalance<O>, x: &[f64], steps: usize) -> Stability {
        let (monodromy, log_determinant) = self.monodromy(balance, x, steps);
        let multipliers = largest_first(of_four(&monodromy));
        let liouville_defect = monodromy.determinant() / libm::exp(log_determinant) - 1.0;
        Stability { multipliers, liouville_defect }
    }

    /// The flow of (y, y′) over the period, and ∫ tr A dτ = ∫ tr Q dτ.
    pub(super) fn monodromy<O: Oscillator>(
        &mut self,
        balance: &HarmonicBalance<O>,
        x: &[f64],
        steps: usize,
    ) -> (Matrix4<f64>, f64) {
        self.work.steps += steps;
        let h = TAU / steps as f64;
        let mut trace = 0.0;
        let mut flow = Matrix4::identity();
        for first in (0..steps).step_by(CHUNK) {
            self.prepare(frequencies(balance), steps, first);
            self.basis.synthesise(x, balance.base_rad_s(), &mut self.motion);
            self.linearise(balance);
            for step in self.rates.chunks_exact(S) {
                for (weight, (_, q)) in self.tableau.b.iter().zip(step) {
                    trace += h * weight * q.trace();
                }
                flow = self.step(h, step, &flow);
            }
        }
        (flow, trace)
    }

    /// The tables for the stages of the steps from the first.
    fn prepare(&mut self, harmonics: Harmonics, steps: usize, first: usize) {
        if self.basis.harmonics() != harmonics || self.tables != (steps, first) {
            let c = self.tableau.c;
            let stages = S * first..S * steps.min(first + CHUNK);
            let phases = stages.map(|at| TAU * ((at / S) as f64 + c[at % S]) / steps as f64);
            self.basis.set(harmonics, phases);
            self.tables = (steps, first);
        }
    }

    /// P and Q at the stages.
    fn linearise<O: Oscillator>(&mut self, balance: &HarmonicBalance<O>) {
        let (cosines, sines) = self.basis.tables(balance.subharmonic() - 1);
        let rate = 1.0 / balance.base_rad_s();
        self.rates.clear();
        for (j, (&cosine, &sine)) in cosines.iter().zip(sines).enumerate() {
            let [position, velocity, acceleration] = core::array::from_fn(|d| self.motion.at(d, j));
            let linear = balance.oscillator().linearise(&Instant { position, velocity, acceleration, sine, cosine });
            let m = &linear.by_acceleration;
            let scale = -rate / (m.m11 * m.m22 - m.m12 * m.m21);
            let inverse = Matrix2::new(m.m22, -m.m12, -m.m21, m.m11) * scale;
            self.rates.push((inverse * linear.by_position * rate, inverse * linear.by_velocity));
        }
    }

    /// One step of the four columns: a system of 8 equations for the stages, with a right-hand side a column.
    fn step(&self, h: f64, rates: &[(Matrix2<f64>, Matrix2<f64>)], flow: &Matrix4<f64>) -> Matrix4<f64> {
        let t = &self.tableau;
        let (mut rows, mut stages) = ([[0.0; 2 * S]; 2 * S], [[0.0; 4]; 2 * S]);
        for (i, (p, q)) in rates.iter().enumerate() {
            for r in 0..2 {
                let (row, right) = (&mut rows[2 * i + r], &mut stages[2 * i + r]);
                for j in 0..S {
                    let (a, a2) = (h * t.a[i][j], h * h * t.a_squared[i][j]);
                    row[2 * j] = -(a2 * p[(r, 0)] + a * q[(r, 0)]);
                    row[2 * j + 1] = -(a2 * p[(r, 1)] + a * q[(r, 1)]);
                }
                row[2 * i + r] += 1.0;
                for column in 0..4 {
                    let y = [0, 1].map(|d| flow[(d, column)] + t.c[i] * h * flow[(2 + d, column)]);
                    right[column] = p[(r, 0)] * y[0]
                        + p[(r, 1)] * y[1]
                        + q[(r, 0)] * flow[(2, column)]
                        + q[(r, 1)] * flow[(3, column)];
                }
            }
        }
        if solve(rows.as_flattened_mut(), &mut stages).is_none() {
            return Matrix4::from_element(f64::NAN);
        }
        let mut next = *flow;
        for column in 0..4 {
            for d in 0..2 {
                next[(d, column)] += h * flow[(2 + d, column)];
                for i in 0..S {
                    let k = stages[2 * i + d][column];
                    next[(d, column)] += h * h * t.b_bar[i] * k;
                    next[(2 + d, column)] += h * t.b[i] * k;
                }
            }
        }
        next
    }
}

/// The frequencies of the motion, and of the excitation.
fn frequencies<O: Oscillator>(balance: &HarmonicBalance<O>) -> Harmonics {
    Harmonics::Integer(balance.harmonics().max(balance.subharmonic()))
}

fn largest_first(mut multipliers: [Complex<f64>; 4]) -> [Complex<f64>; 4] {
    multipliers.sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()).then(b.im.total_cmp(&a.im)));
    multipliers
}

#[cfg(test)]
mod tests {
    use nalgebra::Normed as _;

    use super::*;
    use crate::tests::arm_at;
    use crate::{BranchOptions, Coordinate, ForcedArm, Orbit, trace};
    use resonarm_dynamics::arm::{Load, Preset};

    /// Under a slow excitation, weak or so strong that the modes are modulated by many harmonics, Hill's method has the
    /// multipliers of the flow.
    #[test]
    fn hills_method_has_the_multipliers_of_the_flow() {
        for (hz, torque_nm) in [(0.5, 60.0), (0.2, 60.0), (0.2, 6e3), (0.1, 4e3), (0.05, 3e3)] {
            let (balance, orbit) = slow_motion(hz, torque_nm);
            let mut floquet = Floquet::default();
            let x = &orbit.coefficients;
            let flow = floquet.stability_with(&balance, x, Floquet::steps_for(&balance));
            let hill = floquet.stability_by_hill(&balance, x).unwrap();
            for (a, b) in flow.multipliers.iter().zip(&hill.multipliers) {
                assert!((a - b).norm() < 1e-8, "{hz} Hz, {torque_nm} N·m: {flow:?} {hill:?}");
            }
            assert!(hill.liouville_defect.abs() < 1e-10, "{hill:?}");
        }
        // It fails where the frequencies taken can't describe the modulation.
        let (balance, orbit) = slow_motion(0.1, 2e4);
        assert_eq!(Floquet::default().stability_by_hill(&balance, &orbit.coefficients), None);
    }

    /// The motion under a slow torque, mostly at joint 2, which modulates the modes.
    fn slow_motion(hz: f64, torque_nm: f64) -> (HarmonicBalance<ForcedArm>, Orbit) {
        let forced = ForcedArm::new(arm_at(Preset::Irb1600Fitted, 0.0, 60.0), Load::torque_nm(0.3, 1.0), torque_nm);
        let options = BranchOptions { most_points: 1, ..BranchOptions::new(hz, 2.0 * hz) };
        let orbit = trace(forced.clone(), hz, Coordinate::FrequencyHz, &options).unwrap_err().so_far.orbits.remove(0);
        (HarmonicBalance::new(forced, hz, 1, orbit.harmonics()), orbit)
    }
}
