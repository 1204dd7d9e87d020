//! Explicit Runge–Kutta methods, for one arm or several side by side.
//!
//! With y = (α, α̇) and f = (α̇, α̈): kᵢ = f(tₙ + cᵢh, yₙ + h Σⱼ aᵢⱼ kⱼ) and yₙ₊₁ = yₙ + h Σ bᵢ kᵢ.

use crate::arm::external::External;
use crate::arm::kernel::{Coefficients, Motion};
use crate::arm::real::Real;

/// The coefficients of a method of S stages; `a` is strictly lower triangular.
pub(crate) struct Tableau<const S: usize> {
    pub a: [[f64; S]; S],
    pub b: [f64; S],
    pub c: [f64; S],
}

/// The classical method (W. Kutta, "Beitrag zur näherungsweisen Integration totaler Differentialgleichungen", Z. Math.
/// Phys. 46 (1901)), for arms that [`rk4`] has no formula for.
pub(super) const RK4: Tableau<4> = Tableau {
    a: [[0.0; 4], [0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    b: [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    c: [0.0, 0.5, 0.5, 1.0],
};

/// A step h and the multiples of it in the classical method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rk4Step<T> {
    /// h, ½h, ⅙h, s.
    full: T,
    half: T,
    sixth: T,
    /// ½h², ¼h², ⅙h², s².
    half_square: T,
    quarter_square: T,
    sixth_square: T,
}

impl<T: Real> Rk4Step<T> {
    /// For steps of `h_s`, the same in every lane.
    #[inline(always)]
    pub fn new(h_s: f64) -> Rk4Step<T> {
        Rk4Step {
            full: T::splat(h_s),
            half: T::splat(0.5 * h_s),
            sixth: T::splat(h_s / 6.0),
            half_square: T::splat(0.5 * h_s * h_s),
            quarter_square: T::splat(0.25 * h_s * h_s),
            sixth_square: T::splat(h_s * h_s / 6.0),
        }
    }
}

/// One step of the classical method (as of [`RK4`]): nodes 0, ½, ½, 1, each stage from the slope before it alone,
/// weights 1/6, 1/3, 1/3, 1/6. For x' = v, v' = a the velocities in it can be written out, which leaves
///
/// ```text
/// x₂ = x + ½hv    x₃ = x₂ + ¼h²a₁    x₄ = x + hv + ½h²a₂    x⁺ = x + hv + ⅙h²(a₁ + a₂ + a₃)
/// v₂ = v + ½ha₁   v₃ = v + ½ha₂      v₄ = v + ha₃           v⁺ = v + ⅙h(a₁ + 2a₂ + 2a₃ + a₄)
/// ```
///
/// `external` has the forces at 0, ½ and 1 of the step: stages 2 and 3 are at the same time.
///
/// The step is made as if all angles were small; if one was not, it is made again with the sines of large angles.
#[inline(always)]
pub(crate) fn rk4<T: Real>(
    arm: &Coefficients<T>,
    h: &Rk4Step<T>,
    motion: &Motion<T>,
    external: &[External<T>; 3],
) -> Motion<T> {
    let (next, small) = if follows_links(external) {
        rk4_step::<T, false, true>(arm, h, motion, external)
    } else {
        rk4_step::<T, false, false>(arm, h, motion, external)
    };
    if small { next } else { rk4_far(arm, h, motion, external) }
}

/// [`rk4`] of a single arm: short enough to be inlined when only torques act on it.
#[inline(always)]
pub(crate) fn rk4_single(
    arm: &Coefficients<f64>,
    h: &Rk4Step<f64>,
    motion: &Motion<f64>,
    external: &[External<f64>; 3],
) -> Motion<f64> {
    if follows_links(external) {
        return rk4_single_with_links(arm, h, motion, external);
    }
    let (next, small) = rk4_step::<f64, false, false>(arm, h, motion, external);
    if small { next } else { rk4_far(arm, h, motion, external) }
}

#[inline(never)]
fn rk4_single_with_links(
    arm: &Coefficients<f64>,
    h: &Rk4Step<f64>,
    motion: &Motion<f64>,
    external: &[External<f64>; 3],
) -> Motion<f64> {
    rk4(arm, h, motion, external)
}

#[inline(always)]
fn follows_links<T: Real, const N: usize>(external: &[External<T>; N]) -> bool {
    // Without a short cut, so that there is one branch.
    external.iter().fold(false, |any, external| any | external.follows_links)
}

#[cold]
#[inline(never)]
fn rk4_far<T: Real>(
    arm: &Coefficients<T>,
    h: &Rk4Step<T>,
    motion: &Motion<T>,
    external: &[External<T>; 3],
) -> Motion<T> {
    rk4_step::<T, true, true>(arm, h, motion, external).0
}

/// The state after the step, and whether all its angles were small.
#[inline(always)]
fn rk4_step<T: Real, const FAR: bool, const LINKS: bool>(
    arm: &Coefficients<T>,
    h: &Rk4Step<T>,
    motion: &Motion<T>,
    external: &[External<T>; 3],
) -> (Motion<T>, bool) {
    let [x, v] = [motion.x, motion.v];
    let half = moved(x, h.half, v);
    let full = moved(x, h.full, v);
    let a1 = arm.acceleration::<FAR, LINKS>(motion, &external[0]);
    let a2 = arm.acceleration::<FAR, LINKS>(&Motion { x: half, v: moved(v, h.half, a1) }, &external[1]);
    let third = Motion { x: moved(half, h.quarter_square, a1), v: moved(v, h.half, a2) };
    let a3 = arm.acceleration::<FAR, LINKS>(&third, &external[1]);
    let fourth = Motion { x: moved(full, h.half_square, a2), v: moved(v, h.full, a3) };
    let a4 = arm.acceleration::<FAR, LINKS>(&fourth, &external[2]);
    let inner = sum(a2, a3);
    let first_three = sum(a1, inner);
    let next =
        Motion { x: moved(full, h.sixth_square, first_three), v: moved(v, h.sixth, sum(first_three, sum(inner, a4))) };
    let small = arm.within_reach::<LINKS>(x)
        & arm.within_reach::<LINKS>(half)
        & arm.within_reach::<LINKS>(third.x)
        & arm.within_reach::<LINKS>(fourth.x);
    (next, small)
}

/// One step of a method given by its tableau, of one motion or several side by side; `external` has the forces at the
/// nodes cᵢ.
#[inline(always)]
pub(crate) fn step<T: Real, const S: usize>(
    tableau: &Tableau<S>,
    arm: &Coefficients<T>,
    h_s: f64,
    motion: &Motion<T>,
    external: &[External<f64>; S],
) -> Motion<T> {
    if follows_links(external) {
        step_with::<T, S, true>(tableau, arm, h_s, motion, external)
    } else {
        step_with::<T, S, false>(tableau, arm, h_s, motion, external)
    }
}

#[inline(always)]
fn step_with<T: Real, const S: usize, const LINKS: bool>(
    tableau: &Tableau<S>,
    arm: &Coefficients<T>,
    h_s: f64,
    motion: &Motion<T>,
    external: &[External<f64>; S],
) -> Motion<T> {
    step_by(tableau, h_s, motion, |i, stage| {
        arm.acceleration::<true, LINKS>(stage, &External::gather(|_lane| external[i]))
    })
}

/// One step of a method given by its tableau; `acceleration` computes the acceleration of a stage by its index.
#[inline(always)]
pub(super) fn step_by<T: Real, const S: usize>(
    tableau: &Tableau<S>,
    h_s: f64,
    motion: &Motion<T>,
    acceleration: impl Fn(usize, &Motion<T>) -> [T; 2],
) -> Motion<T> {
    let zero = [T::splat(0.0); 2];
    let mut slopes = [Motion { x: zero, v: zero }; S];
    for i in 0..S {
        let stage = combined(motion, h_s, &tableau.a[i], &slopes);
        slopes[i] = Motion { x: stage.v, v: acceleration(i, &stage) };
    }
    combined(motion, h_s, &tableau.b, &slopes)
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
    let mut total = Motion { x: zero, v: zero };
    for (weight, slope) in weights.iter().zip(slopes) {
        if *weight != 0.0 {
            total =
                Motion { x: moved(total.x, T::splat(*weight), slope.x), v: moved(total.v, T::splat(*weight), slope.v) };
        }
    }
    Motion { x: moved(y.x, T::splat(h_s), total.x), v: moved(y.v, T::splat(h_s), total.v) }
}

/// p + h q.
#[inline(always)]
fn moved<T: Real>(p: [T; 2], h: T, q: [T; 2]) -> [T; 2] {
    [p[0] + h * q[0], p[1] + h * q[1]]
}

#[inline(always)]
fn sum<T: Real>(p: [T; 2], q: [T; 2]) -> [T; 2] {
    [p[0] + q[0], p[1] + q[1]]
}
