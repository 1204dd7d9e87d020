//! Explicit steps of the arm, with formulas of its own.

use super::Load;
use super::coefficients::Coefficients;
use super::external::External;
use crate::integrate::Motion;
use crate::integrate::explicit::{Rk4Step, step_by};
use crate::integrate::tableau::{DOP853, Tableau};
use crate::real::Real;

/// One step of the classical method (as of its tableau): nodes 0, ½, ½, 1, each stage from the slope before it alone,
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
pub(super) fn rk4(
    arm: &Coefficients<f64>,
    h: &Rk4Step,
    motion: &Motion<f64>,
    external: &[External<f64>; 3],
) -> Motion<f64> {
    // Short enough to be inlined when only torques act.
    if follows_links(external) {
        return rk4_with_links(arm, h, motion, external);
    }
    let (next, small) = rk4_step::<false, false>(arm, h, motion, external);
    if small { next } else { rk4_far(arm, h, motion, external) }
}

#[inline(never)]
fn rk4_with_links(
    arm: &Coefficients<f64>,
    h: &Rk4Step,
    motion: &Motion<f64>,
    external: &[External<f64>; 3],
) -> Motion<f64> {
    let (next, small) = rk4_step::<false, true>(arm, h, motion, external);
    if small { next } else { rk4_far(arm, h, motion, external) }
}

#[inline(always)]
fn follows_links<T: Real, const N: usize>(external: &[External<T>; N]) -> bool {
    // Without a short cut, so that there is one branch.
    external.iter().fold(false, |any, external| any | external.follows_links)
}

#[cold]
#[inline(never)]
fn rk4_far(arm: &Coefficients<f64>, h: &Rk4Step, motion: &Motion<f64>, external: &[External<f64>; 3]) -> Motion<f64> {
    rk4_step::<true, true>(arm, h, motion, external).0
}

/// The state after the step, and whether all its angles were small.
#[inline(always)]
fn rk4_step<const FAR: bool, const LINKS: bool>(
    arm: &Coefficients<f64>,
    h: &Rk4Step,
    motion: &Motion<f64>,
    external: &[External<f64>; 3],
) -> (Motion<f64>, bool) {
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

// A function, and not two closures in the one above: with those the lanes are not computed side by side.
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

// Once for all kinds of excitation.
#[inline(never)]
pub(super) fn dop853(arm: &Coefficients<f64>, h_s: f64, motion: &Motion<f64>, loads: &[Load; 12]) -> Motion<f64> {
    let external = loads.each_ref().map(|load| External::new(arm, load));
    step(&DOP853, arm, h_s, motion, &external)
}

/// p + h q.
#[inline(always)]
fn moved(p: [f64; 2], h: f64, q: [f64; 2]) -> [f64; 2] {
    [p[0] + h * q[0], p[1] + h * q[1]]
}

#[inline(always)]
fn sum(p: [f64; 2], q: [f64; 2]) -> [f64; 2] {
    [p[0] + q[0], p[1] + q[1]]
}
