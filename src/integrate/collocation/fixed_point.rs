//! Fixed-point iteration for the stages of a step: Nᵢ ← N(tᵢ, y + Sᵢ y + Σⱼ Aᵢⱼ Nⱼ).
//!
//! A correction is ρ times the one before, ρ about h ‖∂N/∂y‖ (E. Hairer, G. Wanner, "Solving Ordinary Differential
//! Equations II", section IV.8): for the arm, whose springs are linear, N is quadratic in the state, and ρ a thousandth
//! at 4000 steps a second. An iteration takes an acceleration a stage, and no derivatives as Newton's method does.
//!
//! Rounded matrices would do the same error in every step, so the last iteration uses those of 79 bits: it leaves ρ
//! times what the ones before it left.

use core::array;

use super::{Solution, Stages, Wide, add_product};
use crate::arm::Load;
use crate::arm::attachment::{AttachedCoefficients, AttachedExternal};
use crate::arm::external::External;
use crate::arm::kernel::{Coefficients, Motion, Rates};
use crate::arm::real::Real;

/// Iterations before it is left to Newton's method.
const MOST_ITERATIONS: usize = 12;
/// The slowest ρ that is waited for.
const SLOWEST: f64 = 1.0 / 16.0;
/// What may be left, relative to the accelerations: what is left is the same way in many steps, so far below rounding.
const LEFT_LIMIT: f64 = 1e-18;

/// The equation of motion at all stages of a step.
trait Equation {
    fn rates(&self, motion: &Motion<Wide>) -> Rates<Wide>;
}

/// That of the arm alone; `LINKS` as [`Coefficients::acceleration`] has it.
struct Alone<const LINKS: bool> {
    arm: Coefficients<Wide>,
    external: External<Wide>,
}

impl<const LINKS: bool> Equation for Alone<LINKS> {
    #[inline(always)]
    fn rates(&self, motion: &Motion<Wide>) -> Rates<Wide> {
        self.arm.rates_anywhere::<LINKS>(motion, &self.external)
    }
}

/// That of an arm with an attachment.
struct WithAttachment {
    arm: Coefficients<Wide>,
    attached: AttachedCoefficients<Wide>,
    external: AttachedExternal<Wide>,
}

impl Equation for WithAttachment {
    #[inline(always)]
    fn rates(&self, motion: &Motion<Wide>) -> Rates<Wide> {
        self.attached.rates_anywhere(&self.arm, motion, &self.external)
    }
}

/// The slopes that solve the equations, `None` where the iteration does not converge fast.
#[inline(always)]
pub(super) fn solve<const S: usize>(stages: &Stages<S>) -> Option<Solution<S>> {
    let own = &stages.arm.coefficients;
    let arm = Coefficients::<Wide>::gather(|_lane| own);
    if let Some(attached) = stages.arm.attached_coefficients() {
        let external = stages.of_loads(|load| AttachedExternal::new(own, attached, load));
        let external = AttachedExternal::gather(|lane| external[lane.min(S - 1)]);
        let attached = AttachedCoefficients::<Wide>::gather(|_lane| attached);
        return iterate(stages, &WithAttachment { arm, attached, external });
    }
    let external = stages.of_loads(|load| External::new(own, load));
    let external = External::gather(|lane| external[lane.min(S - 1)]);
    if external.follows_links {
        iterate(stages, &Alone::<true> { arm, external })
    } else {
        iterate(stages, &Alone::<false> { arm, external })
    }
}

#[inline(always)]
fn iterate<const S: usize>(stages: &Stages<S>, equation: &impl Equation) -> Option<Solution<S>> {
    let first = stages.first_slope().map(Wide::splat);
    let Pass { mut slopes, size: mut before, .. } = pass(stages, &stages.rounded(&first), &first, equation);
    for _ in 1..MOST_ITERATIONS {
        let next = pass(stages, &stages.rounded(&slopes), &slopes, equation);
        let ratio = next.size / before;
        if next.size * ratio * ratio <= LEFT_LIMIT {
            let slopes = array::from_fn(|i| [next.slopes[0].lane(i), next.slopes[1].lane(i)]);
            let last = pass(stages, &stages.states(&slopes), &next.slopes, equation);
            let slopes = array::from_fn(|i| [last.slopes[0].lane(i), last.slopes[1].lane(i)]);
            return Some(Solution { slopes, work_j: stages.work_j(|i| last.power_w.lane(i)) });
        }
        if ratio > SLOWEST || ratio.is_nan() {
            return None;
        }
        (slopes, before) = (next.slopes, next.size);
    }
    None
}

/// What an iteration finds.
struct Pass {
    slopes: [Wide; 2],
    /// By how much they differ from those before, relative to the accelerations.
    size: f64,
    power_w: Wide,
}

/// The slopes at `states`, against the `slopes` before.
#[inline(always)]
fn pass<const S: usize>(
    stages: &Stages<S>,
    states: &Motion<Wide>,
    slopes: &[Wide; 2],
    equation: &impl Equation,
) -> Pass {
    let Rates { acceleration_rad_s2: accelerations, power_w } = equation.rates(states);
    let next = stages.slope(states, accelerations);
    let difference = (next[0] - slopes[0]).abs() + (next[1] - slopes[1]).abs();
    let whole = accelerations[0].abs() + accelerations[1].abs();
    let sum = |of: Wide| (0..S).map(|i| of.lane(i)).fold(f64::MIN_POSITIVE, |sum, x| sum + x);
    Pass { slopes: next, size: sum(difference) / sum(whole), power_w }
}

impl<const S: usize> Stages<'_, S> {
    /// What is made of the load at every stage, once where it is the same.
    #[inline(always)]
    fn of_loads<E: Copy>(&self, made: impl Fn(&Load) -> E) -> [E; S] {
        if self.held { [made(&self.loads[0]); S] } else { array::from_fn(|i| made(&self.loads[i])) }
    }

    /// All Yᵢ by rounded matrices.
    #[inline(always)]
    fn rounded(&self, slopes: &[Wide; 2]) -> Motion<Wide> {
        let mut change = self.from_start;
        for (j, matrix) in self.step.rounded.iter().enumerate() {
            add_product(&mut change, matrix, &[slopes[0].lane(j), slopes[1].lane(j)]);
        }
        self.moved(&change)
    }
}
