//! Fixed-point iteration for the stages of a step: Nᵢ ← N(tᵢ, y + Sᵢ y + Σⱼ Aᵢⱼ Nⱼ).
//!
//! A correction is ρ times the one before, ρ about h ‖∂N/∂y‖ (E. Hairer, G. Wanner, "Solving Ordinary Differential
//! Equations II", section IV.8): for the arm, whose springs are linear, N is quadratic in the state, and ρ a thousandth
//! at 4000 steps a second. An iteration takes three accelerations, and no derivatives as Newton's method does.
//!
//! Rounded matrices would do the same error in every step, so the last iteration uses those of 79 bits: it leaves ρ
//! times what the ones before it left.

use super::{Slopes, Solution, Stages, Wide, add_product};
use crate::arm::State;
use crate::arm::kernel::{Coefficients, Loads, Motion};
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
    if arm.attachment().is_some() {
        return iterate(stages, &|motion: &Motion<Wide>| {
            let mut accelerations = [Wide::splat(0.0); 2];
            for i in 0..S {
                let own = arm.acceleration(&State::from(motion.lane(i)), &stages.loads[i]);
                (accelerations[0].0[i], accelerations[1].0[i]) = (own.x, own.y);
            }
            accelerations
        });
    }
    let c = Coefficients::<Wide>::gather(|_lane| &arm.coefficients);
    let loads = Loads::gather(|lane| stages.loads[lane.min(S - 1)]);
    if c.needs_links(&loads) {
        iterate(stages, &|motion: &Motion<Wide>| c.acceleration_anywhere::<true>(motion, &loads))
    } else {
        iterate(stages, &|motion: &Motion<Wide>| c.acceleration_anywhere::<false>(motion, &loads))
    }
}

#[inline(always)]
fn iterate<const S: usize>(
    stages: &Stages<S>,
    acceleration: &impl Fn(&Motion<Wide>) -> [Wide; 2],
) -> Option<Solution<S>> {
    let first = stages.first_slopes();
    let (mut slopes, mut before) = pass(stages, &stages.rounded(&first), &first, acceleration);
    for _ in 1..MOST_ITERATIONS {
        let size;
        (slopes, size) = pass(stages, &stages.rounded(&slopes), &slopes, acceleration);
        let ratio = size / before;
        if size * ratio * ratio <= LEFT_LIMIT {
            let last = stages.states(&slopes);
            let work_j = stages.work_j(&last);
            return Some(Solution { slopes: pass(stages, &last, &slopes, acceleration).0, work_j });
        }
        if ratio > SLOWEST || ratio.is_nan() {
            return None;
        }
        before = size;
    }
    None
}

/// The slopes at `states`, and by how much they differ from `slopes` relative to the accelerations.
#[inline(always)]
fn pass<const S: usize>(
    stages: &Stages<S>,
    states: &Motion<Wide>,
    slopes: &Slopes<S>,
    acceleration: &impl Fn(&Motion<Wide>) -> [Wide; 2],
) -> (Slopes<S>, f64) {
    let accelerations = acceleration(states);
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
    (own, differences / wholes)
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
