//! Fixed-point iteration for the stages of a step: Nᵢ ← N(tᵢ, y + Sᵢ y + Σⱼ Aᵢⱼ Nⱼ).
//!
//! A correction is ρ times the one before, ρ about h ‖∂N/∂y‖ (E. Hairer, G. Wanner, "Solving Ordinary Differential
//! Equations II", 1996, section IV.8): for the arm, whose springs are linear, N is quadratic in the state, and ρ a
//! thousandth at 4000 steps a second. An iteration takes one acceleration a stage and, unlike Newton's method, no
//! derivatives.
//!
//! Rounded matrices would make the same error in every step, so the last iteration uses those of 79 bits: it leaves ρ
//! times the error of the ones before it.

use core::array;

use super::{Solution, Stages, Wide, add_product};
use crate::arm::Load;
use crate::arm::attachment::{AttachedCoefficients, AttachedExternal};
use crate::arm::external::External;
use crate::arm::kernel::{Coefficients, Motion, Rates};
use crate::arm::real::Real;

/// Most iterations, the first included, before Newton's method takes over.
const MOST_ITERATIONS: usize = 14;
/// The largest ρ that is accepted.
const SLOWEST: f64 = 1.0 / 16.0;
/// Largest remaining error, relative to the accelerations: far below rounding, as it has the same sign in many steps.
const LEFT_LIMIT: f64 = 1e-18;

/// The equation of motion at all stages of a step.
trait Equation {
    fn rates(&self, motion: &Motion<Wide>) -> Rates<Wide>;
}

/// The equation of the arm alone; `LINKS` is that of [`Coefficients::acceleration`].
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

/// The equation of an arm with an attachment.
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

/// How the states of an iteration are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MadeOf {
    /// The state at the start of the step.
    Start,
    /// From the previous slopes, by rounded matrices.
    Rounded,
    /// From the previous slopes, by matrices of 79 bits: the last iteration.
    Whole,
}

/// One loop for all kinds, so that the code is short: at each tick of 1 kHz it is no longer in the caches.
#[inline(always)]
fn iterate<const S: usize>(stages: &Stages<S>, equation: &impl Equation) -> Option<Solution<S>> {
    let (mut made_of, mut slopes, mut before) = (MadeOf::Start, [Wide::splat(0.0); 2], None);
    for _ in 0..MOST_ITERATIONS {
        let states = match made_of {
            MadeOf::Start => stages.moved(&[Wide::splat(0.0); 4]),
            MadeOf::Rounded => stages.rounded(&slopes),
            MadeOf::Whole => stages.states(&slopes),
        };
        let Rates { acceleration_rad_s2: accelerations, power_w } = equation.rates(&states);
        let next = stages.slope(&states, accelerations);
        let size = size::<S>([next[0] - slopes[0], next[1] - slopes[1]]) / size::<S>(accelerations);
        slopes = next;
        match (made_of, before) {
            (MadeOf::Start, _) => made_of = MadeOf::Rounded,
            (MadeOf::Rounded, None) => before = Some(size),
            (MadeOf::Rounded, Some(known)) => {
                let ratio = size / known;
                if size * ratio * ratio <= LEFT_LIMIT {
                    made_of = MadeOf::Whole;
                } else if ratio > SLOWEST || ratio.is_nan() {
                    return None;
                }
                before = Some(size);
            }
            (MadeOf::Whole, _) => {
                let slopes = array::from_fn(|i| slopes.map(|slope| slope.lane(i)));
                return Some(Solution { slopes, work_j: stages.work_j(|i| power_w.lane(i)) });
            }
        }
    }
    None
}

/// Σ |aᵢ| over rows and stages, kept above zero.
#[inline(always)]
fn size<const S: usize>(a: [Wide; 2]) -> f64 {
    let both = a[0].abs() + a[1].abs();
    (0..S).map(|i| both.lane(i)).fold(f64::MIN_POSITIVE, |sum, x| sum + x)
}

impl<const S: usize> Stages<'_, S> {
    /// A value of the load at every stage, computed once if the load is the same at all.
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
