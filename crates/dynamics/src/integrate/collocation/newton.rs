//! Newton's method for the stages of a step.
//!
//! Its matrix has the blocks δᵢⱼ I − (∂ẍ/∂y − Λ) Aᵢⱼ. It treats the stiff terms exactly, so it converges where
//! fixed-point iteration does not.

use super::{Slopes, Solution, Stages};
use crate::integrate::dynamics::{Dynamics, Jacobian, Wide};
use crate::integrate::error::IntegrateError;
use crate::real::Real;
use resonarm_numeric::linear_solve;

/// Most iterations; where it converges it needs two to five.
const MOST_ITERATIONS: usize = 8;
/// A correction below this part of the largest acceleration is the last one: the next would be its square, below
/// rounding.
const CORRECTION_LIMIT: f64 = 1e-9;
/// A correction is compared with at least this part of the terms whose sum the acceleration is. At rest under a load these
/// terms cancel, and their sum is rounding, below which no correction can get.
const LEAST_SUM: f64 = 1e-4;

/// The slopes that solve the equations.
///
/// # Errors
/// [`IntegrateError::NoConvergence`].
#[cold]
#[inline(never)]
pub(super) fn solve<D: Dynamics<N>, const S: usize, const N: usize>(
    stages: &Stages<D, S, N>,
    t_s: f64,
) -> Result<Solution<S, N>, IntegrateError> {
    // From the start of the step, not from where the fixed-point iteration has failed, which may be far away.
    let mut slopes = [stages.first_slope(); S];
    let mut correction = f64::INFINITY;
    for _ in 0..MOST_ITERATIONS {
        let Some((size, work_j)) = iterate(stages, &mut slopes) else { break };
        correction = size;
        if correction < CORRECTION_LIMIT {
            return Ok(Solution { slopes, work_j });
        }
    }
    Err(IntegrateError::NoConvergence { t_s, iterations: MOST_ITERATIONS, correction })
}

/// Makes one iteration. Returns the correction relative to the largest acceleration and the work of load and dampers
/// over the step, J; `None` if the matrix is singular.
fn iterate<D: Dynamics<N>, const S: usize, const N: usize>(
    stages: &Stages<D, S, N>,
    slopes: &mut Slopes<S, N>,
) -> Option<(f64, f64)> {
    let mut matrix = [[[[0.0; N]; S]; N]; S];
    let mut residual = [[0.0; N]; S];
    let mut largest = f64::MIN_POSITIVE;
    let mut guess = [Wide::splat(0.0); N];
    for row in 0..N {
        guess[row] = Wide::gather(|i| slopes[i.min(S - 1)][row]);
    }
    let states = stages.states(&guess);
    for i in 0..S {
        let stage = states.lane(i);
        let Jacobian { acceleration, by_position, by_velocity } = stages.dynamics.jacobian(&stage, stages.loads.at(i));
        let slope = stages.slope(&stage, acceleration);
        for row in 0..N {
            let terms = by_position[row].iter().zip(&stage.x).chain(by_velocity[row].iter().zip(&stage.v));
            let terms: f64 = terms.map(|(by, number)| libm::fabs(by * number)).sum();
            largest = largest.max(libm::fabs(acceleration[row])).max(LEAST_SUM * terms);
            residual[i][row] = slopes[i][row] - slope[row];
            let mut by_x = by_position[row];
            let mut by_v = by_velocity[row];
            for n in 0..N {
                by_x[n] -= stages.linear[0][row][n];
                by_v[n] -= stages.linear[1][row][n];
            }
            let by_y = || by_x.iter().chain(&by_v);
            // Rounded matrices do here: an error in Newton's matrix slows the convergence, but does not move the
            // solution.
            for (j, (entries, columns)) in matrix[i][row].iter_mut().zip(&stages.step.rounded).enumerate() {
                for (column, (entry, block)) in entries.iter_mut().zip(columns).enumerate() {
                    let block = block.x.iter().chain(&block.v);
                    let slope: f64 = by_y().zip(block).map(|(by, entry)| by * entry.lane(i)).sum();
                    let unit = if i == j && row == column { 1.0 } else { 0.0 };
                    *entry = unit - slope;
                }
            }
        }
    }
    let right = residual.as_flattened_mut().as_chunks_mut::<1>().0;
    linear_solve::solve(matrix.as_flattened_mut().as_flattened_mut().as_flattened_mut(), right)?;
    let mut size = 0.0_f64;
    for (slope, step) in slopes.as_flattened_mut().iter_mut().zip(residual.as_flattened()) {
        *slope -= step;
        // NaN counts as infinite.
        size = if libm::fabs(*step) <= size { size } else { libm::fabs(*step) };
    }
    // The power before the correction: at the last one it changes by 1e-9 of itself, and the energy balance asks for
    // a thousandth.
    let power_w = |i: usize| stages.dynamics.rates(&states.lane(i), stages.loads.at(i)).power_w;
    Some((size / largest, stages.work_j(power_w)))
}
