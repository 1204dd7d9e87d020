//! Sampling of the continuous motion by the converters, step by step.
//!
//! A converter with a filter reads ∫ M_N(u) x(t_n − uT) du ([`Converter`]). Over an integration step of length h, with
//! τ from 0 to 1, an acceleration is
//!
//! ```text
//! a(τ) = a₀ + a₁ τ + a₂ τ² + g e^{−λτ}
//! ```
//!
//! where g is from the transient of a coil's current ([`Current`](resonarm_dynamics::structure::Current)) and the polynomial has
//! the values of the rest at both ends and its integral, the change of velocity: A = a(0), B = a(1), and the mean m
//! give a₂ = 3 (A + B) − 6 m and a₁ = B − A − a₂. Velocity and displacement along a shaker follow by integration, and
//! the head's force is F − m s̈ − c ṡ − k s. So every channel is a polynomial of degree 4 and an exponential, whose
//! weighted integrals are sums with constant factors. The relative error is (ωh)⁴/720 of an amplitude, 2·10⁻⁶ at 59 Hz
//! and 2000 steps a second, and (ωh/λ)² of a transient, to which the arm responds as well: less than 10⁻⁵ there.

use alloc::vec::Vec;

use super::PlantSpec;
use crate::rig::Converter;
use crate::rig::converter::MOST_ORDER;

/// Coefficients of 1, τ … τ⁴ and of e^{−λτ}.
const TERMS: usize = 6;

/// A channel over a step: coefficients of 1, τ … τ⁴ and of e^{−λτ}.
pub(super) type Course = [f64; TERMS];

/// The factors of a step within its hold, for every term: for the reading after this hold and those after the next
/// ones.
type Factors = [[f64; TERMS]; MOST_ORDER];

/// The filter of a converter, prepared for the steps of a hold.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    /// For every step of a hold.
    factors: Vec<Factors>,
    converter: Converter,
    order: usize,
    step_s: f64,
    /// λ, infinite without a coil.
    decay: f64,
    /// Mean of the transient e^{−λτ} over a step, τ from 0 to 1.
    transient_mean: f64,
}

impl Filter {
    /// The filter of a plant's converter, if it has one; `decay` is λ of its coil, infinite without one.
    pub fn new(spec: &PlantSpec, step_s: f64, decay: f64) -> Option<Filter> {
        let converter = spec.rig.converter;
        let steps = spec.steps_per_sample;
        let factors = |step: u32| core::array::from_fn(|piece| factors(converter, piece, step, steps, decay));
        (converter != Converter::Instant).then(|| Filter {
            factors: (0..steps).map(factors).collect(),
            converter,
            order: converter.order(),
            step_s,
            decay,
            transient_mean: if decay.is_infinite() { 0.0 } else { -libm::expm1(-decay) / decay },
        })
    }

    /// The sums of a channel after a constant value: the sum for the reading `ahead` holds later contains the holds
    /// older than `ahead`.
    pub fn settled(&self, value: f64) -> [f64; MOST_ORDER] {
        core::array::from_fn(|ahead| {
            let weight: f64 = (ahead + 1..self.order).map(|piece| self.converter.piece_integral(piece)).sum();
            weight * value
        })
    }

    /// Adds step `index` of a hold to the sums of a channel.
    #[inline(always)]
    pub fn add(&self, sums: &mut [f64; MOST_ORDER], index: usize, course: &Course) {
        let Some(factors) = self.factors.get(index) else { return };
        for (sum, factors) in sums.iter_mut().zip(factors).take(self.order) {
            *sum += factors.iter().zip(course).map(|(factor, term)| factor * term).sum::<f64>();
        }
    }

    /// An acceleration between the velocities and accelerations at the ends of a step, with that by a coil's transient
    /// at its start.
    #[inline(always)]
    pub fn course(&self, [(v0, a0), (v1, a1)]: [(f64, f64); 2], g: f64) -> Course {
        let square = 3.0 * (a0 + a1) - 6.0 * ((v1 - v0) / self.step_s - g * self.transient_mean);
        [a0, a1 - a0 - square, square, 0.0, 0.0, g]
    }

    /// The velocity over a step with an acceleration, from that at its start: with s̈ = a₀ + a₁τ + a₂τ² + g e^{−λτ} it is
    /// ṡ(0) + h (a₀τ + a₁τ²/2 + a₂τ³/3 + g (1 − e^{−λτ})/λ).
    pub fn velocity(&self, rate: f64, [a0, a1, a2, _, _, g]: Course) -> Course {
        let h = self.step_s;
        let g1 = if self.decay.is_infinite() { 0.0 } else { g / self.decay };
        [rate + h * g1, h * a0, 0.5 * h * a1, h * a2 / 3.0, 0.0, -h * g1]
    }

    /// The displacement over a step with an acceleration, from displacement and velocity at its start: s(0) + h ṡ(0) τ +
    /// h² (a₀τ²/2 + a₁τ³/6 + a₂τ⁴/12 + g τ/λ − g (1 − e^{−λτ})/λ²).
    pub fn displacement(&self, (s, rate): (f64, f64), [a0, a1, a2, _, _, g]: Course) -> Course {
        let h = self.step_s;
        let square = self.step_s * self.step_s;
        let g1 = if self.decay.is_infinite() { 0.0 } else { g / self.decay };
        let g2 = if self.decay.is_infinite() { 0.0 } else { g1 / self.decay };
        [s - square * g2, h * rate + square * g1, 0.5 * square * a0, square * a1 / 6.0, square * a2 / 12.0, square * g2]
    }
}

/// The factors of a step: with M_N over it as Σ_r c_r y^r, y = τ/n, they are ∫ τ^m Σ_r c_r (τ/n)^r dτ/n, and of the
/// exponential likewise with X_r = ∫ τ^r e^{−λτ} dτ.
fn factors(converter: Converter, piece: usize, step: u32, steps: u32, decay: f64) -> [f64; TERMS] {
    let n = f64::from(steps);
    let spline = converter.piece(piece, f64::from(step) / n);
    let exponential = exponential_moments(decay);
    let mut factors = [0.0; TERMS];
    let mut scale = 1.0 / n;
    for (r, c) in spline.iter().enumerate() {
        for (m, factor) in factors.iter_mut().enumerate().take(TERMS - 1) {
            *factor += c * scale / (m + r + 1) as f64;
        }
        factors[TERMS - 1] += c * scale * exponential[r];
        scale /= n;
    }
    factors
}

/// X_r = ∫₀¹ τ^r e^{−λτ} dτ: X_0 = (1 − e^{−λ})/λ, X_r = (r X_{r−1} − e^{−λ})/λ, which loses r!/λ^r units of rounding:
/// 1e-9 at the least λ of a coil. Zero for an infinite λ.
fn exponential_moments(decay: f64) -> [f64; MOST_ORDER] {
    let mut moments = [0.0; MOST_ORDER];
    if decay.is_finite() {
        let end = libm::exp(-decay);
        let mut last = -libm::expm1(-decay) / decay;
        for (r, moment) in moments.iter_mut().enumerate() {
            if r > 0 {
                last = (r as f64 * last - end) / decay;
            }
            *moment = last;
        }
    }
    moments
}
