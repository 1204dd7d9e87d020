//! Fixed-point iteration for the stages of a step: Nᵢ ← N(tᵢ, y + Sᵢ y + Σⱼ Aᵢⱼ Nⱼ).
//!
//! A correction is ρ times the one before, ρ about h ‖∂N/∂y‖ (E. Hairer, G. Wanner, "Solving Ordinary Differential
//! Equations II", section IV.8): for the arm, whose springs are linear, N is quadratic in the state, and ρ a thousandth
//! at 4000 steps a second. An iteration takes three accelerations, and no derivatives as Newton's method does.
//!
//! Rounded matrices would do the same error in every step, so the last iteration uses those of 79 bits: it leaves ρ
//! times what the ones before it left.

use super::{Slopes, Solution, Stages, Wide, add_product};
use crate::arm::attachment::AttachedCoefficients;
use crate::arm::kernel::{Coefficients, Loads, Motion, Rates};
use crate::arm::real::Real;

/// Iterations before it is left to Newton's method.
const MOST_ITERATIONS: usize = 12;
/// The slowest ρ that is waited for.
const SLOWEST: f64 = 1.0 / 16.0;
/// What may be left, relative to the accelerations: what is left is the same way in many steps, so far below rounding.
const LEFT_LIMIT: f64 = 1e-18;

/// The slopes that solve the equations, `None` where the iteration does not converge fast.
#[inline(always)]
pub(super) fn solve<const S: usize>(stages: &Stages<S>) -> Option<Solution<S>> {
    let arm = stages.arm;
    let c = Coefficients::<Wide>::gather(|_lane| &arm.coefficients);
    let loads = Loads::gather(|lane| stages.loads[lane.min(S - 1)]);
    if let Some(attached) = arm.attached_coefficients() {
        let attached = AttachedCoefficients::<Wide>::gather(|_lane| attached);
        iterate(stages, &|motion| attached.rates_anywhere(&c, motion, &loads))
    } else if c.needs_links(&loads) {
        iterate(stages, &|motion| c.rates_anywhere::<true>(motion, &loads))
    } else {
        iterate(stages, &|motion| c.rates_anywhere::<false>(motion, &loads))
    }
}

#[inline(always)]
fn iterate<const S: usize>(stages: &Stages<S>, rates: &impl Fn(&Motion<Wide>) -> Rates<Wide>) -> Option<Solution<S>> {
    let first = stages.first_slopes();
    let Pass { mut slopes, size: mut before, .. } = pass(stages, &stages.rounded(&first), &first, rates);
    for _ in 1..MOST_ITERATIONS {
        let next = pass(stages, &stages.rounded(&slopes), &slopes, rates);
        let ratio = next.size / before;
        if next.size * ratio * ratio <= LEFT_LIMIT {
            let last = pass(stages, &stages.states(&next.slopes), &next.slopes, rates);
            return Some(Solution { slopes: last.slopes, work_j: stages.work_j(|i| last.power_w.lane(i)) });
        }
        if ratio > SLOWEST || ratio.is_nan() {
            return None;
        }
        (slopes, before) = (next.slopes, next.size);
    }
    None
}

/// What an iteration finds.
struct Pass<const S: usize> {
    slopes: Slopes<S>,
    /// By how much they differ from those before, relative to the accelerations.
    size: f64,
    power_w: Wide,
}

/// The slopes at `states`, against the `slopes` before.
#[inline(always)]
fn pass<const S: usize>(
    stages: &Stages<S>,
    states: &Motion<Wide>,
    slopes: &Slopes<S>,
    rates: &impl Fn(&Motion<Wide>) -> Rates<Wide>,
) -> Pass<S> {
    let Rates { acceleration_rad_s2: accelerations, power_w } = rates(states);
    let next = stages.slope(states, accelerations);
    let known = [0, 1].map(|row| Wide::gather(|i| slopes[i.min(S - 1)][row]));
    let difference = (next[0] - known[0]).abs() + (next[1] - known[1]).abs();
    let whole = accelerations[0].abs() + accelerations[1].abs();
    let (mut differences, mut wholes) = (0.0, f64::MIN_POSITIVE);
    let mut own = [[0.0; 2]; S];
    for (i, own) in own.iter_mut().enumerate() {
        differences += difference.lane(i);
        wholes += whole.lane(i);
        *own = [next[0].lane(i), next[1].lane(i)];
    }
    Pass { slopes: own, size: differences / wholes, power_w }
}

impl<const S: usize> Stages<'_, S> {
    /// All Yᵢ by rounded matrices.
    #[inline(always)]
    fn rounded(&self, slopes: &Slopes<S>) -> Motion<Wide> {
        let mut change = self.from_start;
        for (matrix, slope) in self.step.rounded.iter().zip(slopes) {
            add_product(&mut change, matrix, slope);
        }
        self.moved(&change)
    }
}
