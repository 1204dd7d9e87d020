//! Newton's method for the stages of a step.
//!
//! Its matrix has the blocks δᵢⱼ I − (∂α̈/∂y − Λ) Aᵢⱼ. It treats the stiff terms exactly, so it converges where
//! fixed-point iteration does not.

use core::array;

use super::super::IntegrateError;
use super::{Slopes, Solution, Stages, Wide};
use crate::arm::State;
use crate::arm::real::Real;
use resonarm_numeric::linear_solve;

/// Most iterations; where it converges it needs two to five.
const MOST_ITERATIONS: usize = 8;
/// A correction below this part of the largest acceleration is the last one: the next would be its square, below
/// rounding.
const CORRECTION_LIMIT: f64 = 1e-9;

/// The slopes that solve the equations.
///
/// # Errors
/// [`IntegrateError::NoConvergence`].
#[cold]
#[inline(never)]
pub(super) fn solve<const S: usize>(stages: &Stages<S>, t_s: f64) -> Result<Solution<S>, IntegrateError> {
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

/// One iteration. Returns the correction relative to the largest acceleration and the work of load and dampers over the
/// step, J; `None` if the matrix is singular.
fn iterate<const S: usize>(stages: &Stages<S>, slopes: &mut Slopes<S>) -> Option<(f64, f64)> {
    let mut matrix = [[[[0.0; 2]; S]; 2]; S];
    let mut residual = [[0.0; 2]; S];
    let mut largest = f64::MIN_POSITIVE;
    let states = stages.states(&[0, 1].map(|row| Wide::gather(|i| slopes[i.min(S - 1)][row])));
    for i in 0..S {
        let stage = states.lane(i);
        let jacobian = stages.arm.acceleration_jacobian(&State::from(stage), &stages.loads[i]);
        let acceleration: [f64; 2] = jacobian.acceleration_rad_s2.into();
        let slope = stages.slope(&stage, acceleration);
        let (p, q) = (&jacobian.by_alpha, &jacobian.by_alpha_dot);
        for row in 0..2 {
            largest = largest.max(libm::fabs(acceleration[row]));
            residual[i][row] = slopes[i][row] - slope[row];
            let lambda = &stages.linear[row];
            let by_y = [p[(row, 0)], p[(row, 1)], q[(row, 0)], q[(row, 1)]];
            let by_y: [f64; 4] = array::from_fn(|n| by_y[n] - lambda[n]);
            for (j, (entries, columns)) in matrix[i][row].iter_mut().zip(&stages.step.rounded).enumerate() {
                for (column, (entry, block)) in entries.iter_mut().zip(columns).enumerate() {
                    let slope: f64 = by_y.iter().zip(block).map(|(by, entry)| by * entry.lane(i)).sum();
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
    let power_w = |i: usize| stages.arm.rates(&State::from(states.lane(i)), &stages.loads[i]).power_w;
    Some((size / largest, stages.work_j(power_w)))
}
