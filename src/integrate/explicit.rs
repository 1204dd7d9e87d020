//! Explicit Runge–Kutta methods, for one arm or eight side by side.
//!
//! With y = (α, α̇) and f = (α̇, α̈): kᵢ = f(tₙ + cᵢh, yₙ + h Σⱼ aᵢⱼ kⱼ) and yₙ₊₁ = yₙ + h Σ bᵢ kᵢ.

use crate::arm::kernel::{Coefficients, Loads, Motion};
use crate::arm::real::Real;

/// The coefficients of a method of S stages; `a` is strictly lower triangular.
pub(crate) struct Tableau<const S: usize> {
    pub a: [[f64; S]; S],
    pub b: [f64; S],
    pub c: [f64; S],
}

/// The classical method (W. Kutta 1901): stage i starts from stage i − 1's slope alone, over `RK4_NODES[i]` of the step.
const RK4_NODES: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
/// Weights of the slopes.
const RK4_WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// One step of the classical method. Stages 2 and 3 are at the same time: `load` is asked at 0, ½ and 1 of the step.
#[inline(always)]
pub(crate) fn rk4<T: Real>(
    arm: &Coefficients<T>,
    h_s: f64,
    motion: &Motion<T>,
    load: impl Fn(f64) -> Loads<T>,
) -> Motion<T> {
    let middle = load(0.5);
    let loads = [load(0.0), middle, middle, load(1.0)];
    let mut slope = slope_at(arm, motion, &loads[0]);
    let mut next = moved(motion, &slope, T::splat(h_s * RK4_WEIGHTS[0]));
    for i in 1..4 {
        slope = slope_at(arm, &moved(motion, &slope, T::splat(h_s * RK4_NODES[i])), &loads[i]);
        next = moved(&next, &slope, T::splat(h_s * RK4_WEIGHTS[i]));
    }
    next
}

/// One step of a method given by its tableau; `load` is asked at the nodes cᵢ.
#[inline(always)]
pub(crate) fn step<T: Real, const S: usize>(
    tableau: &Tableau<S>,
    arm: &Coefficients<T>,
    h_s: f64,
    motion: &Motion<T>,
    load: impl Fn(f64) -> Loads<T>,
) -> Motion<T> {
    let zero = [T::splat(0.0); 2];
    let mut slopes = [Motion { x: zero, v: zero }; S];
    for i in 0..S {
        let stage = combined(motion, h_s, &tableau.a[i], &slopes);
        slopes[i] = slope_at(arm, &stage, &load(tableau.c[i]));
    }
    combined(motion, h_s, &tableau.b, &slopes)
}

/// f at a stage.
#[inline(always)]
fn slope_at<T: Real>(arm: &Coefficients<T>, stage: &Motion<T>, load: &Loads<T>) -> Motion<T> {
    Motion { x: stage.v, v: arm.acceleration(stage, load) }
}

/// y + h k.
#[inline(always)]
fn moved<T: Real>(y: &Motion<T>, k: &Motion<T>, h: T) -> Motion<T> {
    Motion { x: [y.x[0] + h * k.x[0], y.x[1] + h * k.x[1]], v: [y.v[0] + h * k.v[0], y.v[1] + h * k.v[1]] }
}

/// y + h Σⱼ wⱼ kⱼ, the sum first; weights of zero cost nothing.
#[inline(always)]
fn combined<T: Real, const S: usize>(
    y: &Motion<T>,
    h_s: f64,
    weights: &[f64; S],
    slopes: &[Motion<T>; S],
) -> Motion<T> {
    let zero = [T::splat(0.0); 2];
    let mut sum = Motion { x: zero, v: zero };
    for (weight, slope) in weights.iter().zip(slopes) {
        if *weight != 0.0 {
            sum = moved(&sum, slope, T::splat(*weight));
        }
    }
    moved(y, &sum, T::splat(h_s))
}
