//! Explicit Runge–Kutta methods, for one system or several side by side.
//!
//! With y = (x, ẋ) and f = (ẋ, ẍ): kᵢ = f(tₙ + cᵢh, yₙ + h Σⱼ aᵢⱼ kⱼ) and yₙ₊₁ = yₙ + h Σ bᵢ kᵢ.

use super::motion::Motion;
use super::tableau::{DOP853, RK4, Tableau};
use crate::real::Real;

/// An explicit method for steps of one length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExplicitMethod {
    /// Step length h, s.
    pub(crate) step_s: f64,
    pub(crate) kind: Explicit,
}

/// The explicit methods; the classical one has constants of its own, since it is written out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Explicit {
    Rk4(Rk4Step),
    Dop853,
}

/// A step h and the multiples of it in the classical method written out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rk4Step {
    /// h, ½h, ⅙h, s.
    pub full: f64,
    pub half: f64,
    pub sixth: f64,
    /// ½h², ¼h², ⅙h², s².
    pub half_square: f64,
    pub quarter_square: f64,
    pub sixth_square: f64,
}

impl Rk4Step {
    /// Makes the method for steps of `h_s`.
    pub fn new(h_s: f64) -> Rk4Step {
        Rk4Step {
            full: h_s,
            half: 0.5 * h_s,
            sixth: h_s / 6.0,
            half_square: 0.5 * h_s * h_s,
            quarter_square: 0.25 * h_s * h_s,
            sixth_square: h_s * h_s / 6.0,
        }
    }
}

/// One step of any system; `acceleration` computes that of a stage at its time.
#[inline(always)]
pub(crate) fn by_stages<const N: usize>(
    method: &ExplicitMethod,
    t_s: f64,
    motion: &Motion<f64, N>,
    acceleration: impl Fn(f64, &Motion<f64, N>) -> [f64; N],
) -> Motion<f64, N> {
    let h_s = method.step_s;
    match method.kind {
        Explicit::Rk4(_) => step_by(&RK4, h_s, motion, |i, stage| acceleration(t_s + RK4.c[i] * h_s, stage)),
        Explicit::Dop853 => step_by(&DOP853, h_s, motion, |i, stage| acceleration(t_s + DOP853.c[i] * h_s, stage)),
    }
}

/// One step of a method given by its tableau; `acceleration` computes the acceleration of a stage by its index.
#[inline(always)]
pub(crate) fn step_by<T: Real, const S: usize, const N: usize>(
    tableau: &Tableau<S>,
    h_s: f64,
    motion: &Motion<T, N>,
    acceleration: impl Fn(usize, &Motion<T, N>) -> [T; N],
) -> Motion<T, N> {
    let mut slopes = [Motion::splat(0.0); S];
    for i in 0..S {
        let stage = combined(motion, h_s, &tableau.a[i], &slopes);
        slopes[i] = Motion { x: stage.v, v: acceleration(i, &stage) };
    }
    combined(motion, h_s, &tableau.b, &slopes)
}

/// y + h Σⱼ wⱼ kⱼ, the sum first; weights of zero cost nothing.
#[inline(always)]
pub(crate) fn combined<T: Real, const S: usize, const N: usize>(
    y: &Motion<T, N>,
    h_s: f64,
    weights: &[f64; S],
    slopes: &[Motion<T, N>; S],
) -> Motion<T, N> {
    let mut total = Motion::splat(0.0);
    for (weight, slope) in weights.iter().zip(slopes) {
        if *weight != 0.0 {
            total = total.zip(slope, |sum, slope| sum + T::splat(*weight) * slope);
        }
    }
    y.zip(&total, |y, total| y + T::splat(h_s) * total)
}
