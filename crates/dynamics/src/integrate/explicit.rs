//! Explicit Runge–Kutta methods, for one system or several side by side.
//!
//! With y = (x, ẋ) and f = (ẋ, ẍ): kᵢ = f(tₙ + cᵢh, yₙ + h Σⱼ aᵢⱼ kⱼ) and yₙ₊₁ = yₙ + h Σ bᵢ kᵢ.

use super::motion::Motion;
use super::tableau::Tableau;
use crate::real::Real;

/// One step of a method given by its tableau; `acceleration` computes that of a stage at its time.
#[inline(always)]
pub(super) fn step<const S: usize, const N: usize>(
    tableau: &Tableau<S>,
    h_s: f64,
    t_s: f64,
    motion: &Motion<f64, N>,
    acceleration: impl Fn(f64, &Motion<f64, N>) -> [f64; N],
) -> Motion<f64, N> {
    let mut slopes = [Motion::splat(0.0); S];
    for i in 0..S {
        let stage = combined(motion, h_s, &tableau.a[i], &slopes);
        slopes[i] = Motion { x: stage.v, v: acceleration(t_s + tableau.c[i] * h_s, &stage) };
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
