//! Fixed-point iteration for the stages of a step: Nᵢ ← N(tᵢ, y + Sᵢ y + Σⱼ Aᵢⱼ Nⱼ).
//!
//! A correction is ρ times the one before, ρ about h ‖∂N/∂y‖ (E. Hairer, G. Wanner, "Solving Ordinary Differential
//! Equations II", 1996, section IV.8): for an arm, whose springs are linear, N is quadratic in the state, and ρ a
//! thousandth at 4000 steps a second. An iteration takes one acceleration a stage and, unlike Newton's method, no
//! derivatives.
//!
//! Rounded matrices would make the same error in every step, so the last iteration uses those of 79 bits: it leaves ρ
//! times the error of the ones before it.

use super::{Solution, Stages, add_product, of_stage};
use crate::integrate::dynamics::{Dynamics, Rates, SolveStages, StageEquation, Wide};
use crate::integrate::motion::Motion;
use crate::real::Real;

/// Most iterations, the first included, before Newton's method takes over.
const MOST_ITERATIONS: usize = 14;
/// The largest ρ that is accepted.
const SLOWEST: f64 = 1.0 / 16.0;
/// Largest remaining error, relative to the accelerations: far below rounding, as it has the same sign in many steps.
const LEFT_LIMIT: f64 = 1e-18;

/// The slopes that solve the equations, `None` where the iteration does not converge fast.
#[inline(always)]
pub(super) fn solve<D: Dynamics<N>, const S: usize, const N: usize>(
    stages: &Stages<D, S, N>,
) -> Option<Solution<S, N>> {
    stages.dynamics.solve_stages(&stages.loads, Iteration { stages })
}

/// The iteration, for any equation.
struct Iteration<'a, D: Dynamics<N>, const S: usize, const N: usize> {
    stages: &'a Stages<'a, D, S, N>,
}

/// Way in which the states of an iteration are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MadeOf {
    /// The state at the start of the step.
    Start,
    /// The states follow from the previous slopes, by rounded matrices.
    Rounded,
    /// The states follow from the previous slopes, by matrices of 79 bits: the last iteration.
    Whole,
}

impl<D: Dynamics<N>, const S: usize, const N: usize> SolveStages<N> for Iteration<'_, D, S, N> {
    type Solution = Option<Solution<S, N>>;

    // One loop for all kinds of states, so that the code is short: at each tick of 1 kHz it is no longer in the caches.
    #[inline(always)]
    fn solve(self, equation: &impl StageEquation<N>) -> Option<Solution<S, N>> {
        let stages = self.stages;
        let mut made_of = MadeOf::Start;
        let mut slopes = [Wide::splat(0.0); N];
        let mut before = None;
        for _ in 0..MOST_ITERATIONS {
            let states = match made_of {
                MadeOf::Start => stages.moved(&Motion::splat(0.0)),
                MadeOf::Rounded => stages.rounded(&slopes),
                MadeOf::Whole => stages.states(&slopes),
            };
            let Rates { acceleration, power_w } = equation.rates(&states);
            let next = stages.slope(&states, acceleration);
            let size = size::<S, N>(less(next, slopes)) / size::<S, N>(acceleration);
            slopes = next;
            // The first slopes are compared with zeros, which says nothing of how fast the iteration converges.
            match (made_of, before) {
                (MadeOf::Start, _) => made_of = MadeOf::Rounded,
                (MadeOf::Rounded, None) => before = Some(size),
                (MadeOf::Rounded, Some(known)) => {
                    let ratio = size / known;
                    // The slopes now err by about ρ times this correction, and the last iteration leaves ρ times that.
                    if size * ratio * ratio <= LEFT_LIMIT {
                        made_of = MadeOf::Whole;
                    } else if ratio > SLOWEST || ratio.is_nan() {
                        return None;
                    }
                    before = Some(size);
                }
                (MadeOf::Whole, _) => {
                    let mut of_stages = [[0.0; N]; S];
                    for (stage, of) in of_stages.iter_mut().enumerate() {
                        *of = of_stage(&slopes, stage);
                    }
                    return Some(Solution { slopes: of_stages, work_j: stages.work_j(|i| power_w.lane(i)) });
                }
            }
        }
        None
    }
}

#[inline(always)]
fn less<const N: usize>(mut a: [Wide; N], b: [Wide; N]) -> [Wide; N] {
    for n in 0..N {
        a[n] = a[n] - b[n];
    }
    a
}

/// Σ |aᵢ| over rows and stages, kept above zero.
#[inline(always)]
fn size<const S: usize, const N: usize>(a: [Wide; N]) -> f64 {
    let rows = (1..N).fold(a[0].abs(), |sum, n| sum + a[n].abs());
    (0..S).map(|i| rows.lane(i)).fold(f64::MIN_POSITIVE, |sum, x| sum + x)
}

impl<D: Dynamics<N>, const S: usize, const N: usize> Stages<'_, D, S, N> {
    /// All Yᵢ by rounded matrices.
    #[inline(always)]
    fn rounded(&self, slopes: &[Wide; N]) -> Motion<Wide, N> {
        let mut change = self.from_start;
        for (j, matrix) in self.step.rounded.iter().enumerate() {
            add_product(&mut change, matrix, &of_stage(slopes, j));
        }
        self.moved(&change)
    }
}
