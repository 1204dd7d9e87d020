//! Implicit methods whose stages are affine in their slopes, solved by Newton's method: Gauss–Legendre and exponential
//! collocation.
//!
//! With y = (x, v) = (α, α̇) and a constant 2×4 matrix Λ let N(t, y) = α̈(t, y) − Λ y: Λ = 0 for Gauss–Legendre, the
//! linear arm for the exponential method. The unknowns are the slopes Nᵢ at the stages,
//!
//! ```text
//! Yᵢ = y + Sᵢ y + Σⱼ Aᵢⱼ Nⱼ        Gᵢ = Nᵢ − N(tᵢ, Yᵢ) = 0        y⁺ = y + E y + Σⱼ Wⱼ Nⱼ
//! ```
//!
//! with 4×4 matrices Sᵢ, E and 4×2 matrices Aᵢⱼ, Wⱼ that the method sets once for a step length. Newton's matrix has
//! the blocks δᵢⱼ I − (∂α̈/∂y − Λ) Aᵢⱼ. It takes the stiff part exactly, so it converges where fixed-point iteration,
//! which needs ωh < 1, does not.
//!
//! Rounding in a step is as good as random, and the energy walks with its square root; an error of a matrix is the same
//! in every step, and moves the energy steadily: rounded to 2⁻⁵³, by 1e-12 to 1e-10 of itself in 1e7 steps (E. Hairer,
//! R. I. McLachlan, A. Razakarivony, "Achieving Brouwer's law with implicit Runge–Kutta methods", BIT 48 (2008)). So a
//! [`Matrix`] has 79 bits.

use alloc::vec::Vec;
use core::array;

use super::double_double::DoubleDouble;
use super::linear_solve::solve;
use super::{Excitation, IntegrateError};
use crate::arm::{Arm, Load, State};

/// Newton's limit: where it converges it needs two to five iterations.
const MAX_ITERATIONS: usize = 8;
/// A correction below this part of the largest acceleration is the last one: the next would be its square, below
/// rounding.
const CORRECTION_LIMIT: f64 = 1e-9;
/// A step is divided into 1, 2, 4 … 2^(LEVELS − 1) = 256 parts.
pub(super) const LEVELS: usize = 9;
/// The most energy, as part of the energy, that a part of a step may make or lose beyond what load and dampers account
/// for.
const ENERGY_DEFECT_LIMIT: f64 = 1e-3;
/// Below this energy, J, digits of it underflow: 2⁻¹⁰²² over 2⁻⁵².
const ENERGY_WHOLE_J: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// A method of S stages at one step length.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Step<const S: usize> {
    /// h, s.
    pub h_s: f64,
    /// Nodes and weights of the quadrature under the method.
    pub c: [f64; S],
    pub b: [f64; S],
    /// Sᵢ, Aᵢⱼ.
    pub start: [Matrix<4>; S],
    pub stage: [[Matrix<2>; S]; S],
    /// E, Wⱼ.
    pub end: Matrix<4>,
    pub weights: [Matrix<2>; S],
}

/// A matrix of four rows and C columns. Each entry is the sum of its first 26 bits and the next 53: were the first part
/// all that `f64` holds, its product would be rounded to where the other part is lost, in every step the same way.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Matrix<const C: usize> {
    high: [[f64; C]; 4],
    low: [[f64; C]; 4],
}

impl<const C: usize> Matrix<C> {
    /// The matrix with these entries by row and column.
    pub fn new(entry: impl Fn(usize, usize) -> DoubleDouble) -> Matrix<C> {
        let part = |part: fn([f64; 2]) -> f64| {
            array::from_fn(|row| array::from_fn(|column| part(entry(row, column).head_and_tail())))
        };
        Matrix { high: part(|[high, _]| high), low: part(|[_, low]| low) }
    }

    /// sum += matrix · y.
    #[inline(always)]
    fn add_product(&self, y: &[f64; C], sum: &mut [f64; 4]) {
        for (value, (high, low)) in sum.iter_mut().zip(self.high.iter().zip(&self.low)) {
            *value += dot(high, y) + dot(low, y);
        }
    }
}

/// A method of S stages for the step and its parts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Collocation<const S: usize> {
    /// Λ.
    pub linear: [[f64; 4]; 2],
    /// The step lengths h, h/2, h/4 …
    pub levels: Vec<Step<S>>,
    /// The level that every step starts from. It is one for all, as far as it can be: where strong vibration swings the
    /// energy so far in a step that some steps have to be divided and others not, steps follow the state, and that does
    /// not keep the energy.
    pub least_level: usize,
    /// The largest ωh of a part, rad, with ω at the deflection where the step starts.
    pub phase_per_part_rad: f64,
}

impl<const S: usize> Collocation<S> {
    /// One step, in equal parts as few as do: far from the pose the arm can be several times as stiff as in it, and a
    /// part that turns the phase too far finds no stages, or wrong ones. The number of parts is doubled until Newton's
    /// method converges in every part and every part keeps its energy balance; the work is bounded, and a step that
    /// can't be made well is an error.
    #[inline(never)]
    pub fn step(
        &self,
        arm: &Arm,
        t_s: f64,
        state: &State,
        excitation: &impl Excitation,
    ) -> Result<State, IntegrateError> {
        let mut failure = IntegrateError::NotFinite { t_s };
        for (level, step) in self.levels.iter().enumerate().skip(self.first_level(arm, state)) {
            let result = (0..1_u32 << level).try_fold(*state, |state, k| {
                step.advance(&self.linear, arm, t_s + f64::from(k) * step.h_s, &state, excitation)
            });
            match result {
                Ok(next) => return Ok(next),
                Err(error) => failure = error,
            }
        }
        Err(failure)
    }

    /// The first level whose parts keep the phase limit, or else the last.
    fn first_level(&self, arm: &Arm, state: &State) -> usize {
        if self.phase_per_part_rad == f64::INFINITY {
            return self.least_level;
        }
        let frequency_rad_s = arm.angular_frequency_bound_rad_s(&state.alpha_rad);
        let within = |step: &Step<S>| frequency_rad_s * step.h_s <= self.phase_per_part_rad;
        self.levels.iter().position(within).unwrap_or(LEVELS - 1).max(self.least_level)
    }
}

/// The first level whose parts turn small vibration of `arm` by `phase_rad` at most, or else the last.
pub(super) fn least_level<const S: usize>(arm: &Arm, levels: &[Step<S>], phase_rad: f64) -> usize {
    let [_, fastest_rad_s] = arm.angular_frequencies_rad_s();
    levels.iter().position(|step| fastest_rad_s * step.h_s <= phase_rad).unwrap_or(LEVELS - 1)
}

type Slopes<const S: usize> = [[f64; 2]; S];

impl<const S: usize> Step<S> {
    fn advance(
        &self,
        linear: &[[f64; 4]; 2],
        arm: &Arm,
        t_s: f64,
        state: &State,
        excitation: &impl Excitation,
    ) -> Result<State, IntegrateError> {
        let loads: [Load; S] = array::from_fn(|i| excitation.load(t_s + self.c[i] * self.h_s));
        let y = vector(state);
        let first = arm.acceleration(state, &loads[0]);
        let [low1, low2] = times(linear, &y);
        let mut slopes = [[first.x - low1, first.y - low2]; S];
        let from_start: [[f64; 4]; S] = array::from_fn(|i| {
            let mut change = [0.0; 4];
            self.start[i].add_product(&y, &mut change);
            change
        });
        let mut correction = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            let Some((size, work_j)) = self.newton(linear, arm, &loads, &y, &from_start, &mut slopes) else { break };
            correction = size;
            if correction < CORRECTION_LIMIT {
                return self.finish(arm, t_s, state, &y, &slopes, work_j);
            }
        }
        Err(IntegrateError::NoConvergence { t_s, iterations: MAX_ITERATIONS, correction })
    }

    /// The state of stage i.
    fn stage_state(&self, i: usize, y: &[f64; 4], from_start: &[f64; 4], slopes: &Slopes<S>) -> State {
        let mut change = *from_start;
        for (matrix, slope) in self.stage[i].iter().zip(slopes) {
            matrix.add_product(slope, &mut change);
        }
        moved(y, &change)
    }

    /// One iteration of Newton's method. Returns the correction relative to the largest acceleration and the work of
    /// load and dampers over the step, J; `None` if the matrix is singular.
    fn newton(
        &self,
        linear: &[[f64; 4]; 2],
        arm: &Arm,
        loads: &[Load; S],
        y: &[f64; 4],
        from_start: &[[f64; 4]; S],
        slopes: &mut Slopes<S>,
    ) -> Option<(f64, f64)> {
        let mut matrix = [[[[0.0; 2]; S]; 2]; S];
        let mut residual = [[0.0; 2]; S];
        let (mut largest, mut work_j) = (f64::MIN_POSITIVE, 0.0);
        for i in 0..S {
            let stage = self.stage_state(i, y, &from_start[i], slopes);
            let jacobian = arm.acceleration_jacobian(&stage, &loads[i]);
            work_j += self.h_s * self.b[i] * arm.power_w(&stage, &loads[i]);
            let acceleration = jacobian.acceleration_rad_s2;
            let own = times(linear, &vector(&stage));
            let (p, q) = (&jacobian.by_alpha, &jacobian.by_alpha_dot);
            for row in 0..2 {
                largest = largest.max(libm::fabs(acceleration[row]));
                residual[i][row] = slopes[i][row] - (acceleration[row] - own[row]);
                let lambda = &linear[row];
                let by_y = [
                    p[(row, 0)] - lambda[0],
                    p[(row, 1)] - lambda[1],
                    q[(row, 0)] - lambda[2],
                    q[(row, 1)] - lambda[3],
                ];
                for (j, block) in self.stage[i].iter().enumerate() {
                    for (column, entry) in matrix[i][row][j].iter_mut().enumerate() {
                        let slope: f64 = (0..4).map(|n| by_y[n] * (block.high[n][column] + block.low[n][column])).sum();
                        let unit = if i == j && row == column { 1.0 } else { 0.0 };
                        *entry = unit - slope;
                    }
                }
            }
        }
        let right = residual.as_flattened_mut().as_chunks_mut::<1>().0;
        solve(matrix.as_flattened_mut().as_flattened_mut().as_flattened_mut(), right)?;
        let mut size = 0.0_f64;
        for (slope, step) in slopes.as_flattened_mut().iter_mut().zip(residual.as_flattened()) {
            *slope -= step;
            // NaN counts as infinite.
            size = if libm::fabs(*step) <= size { size } else { libm::fabs(*step) };
        }
        Some((size / largest, work_j))
    }

    /// The state at the end of the step from the solved slopes, if the energy it gained is the work done.
    fn finish(
        &self,
        arm: &Arm,
        t_s: f64,
        state: &State,
        y: &[f64; 4],
        slopes: &Slopes<S>,
        work_j: f64,
    ) -> Result<State, IntegrateError> {
        // The small parts first: rounding then stays that of one sum.
        let mut change = times(&self.end.low, y);
        for part in [|weight: &Matrix<2>| weight.low, |weight: &Matrix<2>| weight.high] {
            self.weights.iter().zip(slopes).for_each(|(weight, slope)| add_times(&mut change, &part(weight), slope));
        }
        let linear = times(&self.end.high, y);
        let next = moved(y, &array::from_fn(|n| linear[n] + change[n]));
        let (before, after) = (arm.energy(state).total_j(), arm.energy(&next).total_j());
        let defect_j = libm::fabs(after - before - work_j);
        if defect_j <= ENERGY_DEFECT_LIMIT * before.max(after).max(ENERGY_WHOLE_J) {
            Ok(next)
        } else if defect_j.is_finite() {
            Err(IntegrateError::Unbalanced { t_s, defect: defect_j / before.max(after) })
        } else {
            Err(IntegrateError::NotFinite { t_s: t_s + self.h_s })
        }
    }
}

fn vector(state: &State) -> [f64; 4] {
    let (x, v) = (&state.alpha_rad, &state.alpha_dot_rad_s);
    [x.x, x.y, v.x, v.y]
}

/// The state y + `change`.
#[inline(always)]
fn moved(y: &[f64; 4], change: &[f64; 4]) -> State {
    let [x1, x2, v1, v2] = array::from_fn(|n| y[n] + change[n]);
    State::new([x1, x2], [v1, v2])
}

/// Matrix times vector.
#[inline(always)]
fn times<const R: usize>(matrix: &[[f64; 4]; R], y: &[f64; 4]) -> [f64; R] {
    array::from_fn(|row| dot(&matrix[row], y))
}

/// Scalar product, in pairs.
#[inline(always)]
fn dot<const C: usize>(row: &[f64; C], y: &[f64; C]) -> f64 {
    let pair = |n: usize| row[n] * y[n] + row[n + 1] * y[n + 1];
    if C == 4 { pair(0) + pair(2) } else { pair(0) }
}

/// sum += matrix · slope.
#[inline(always)]
fn add_times(sum: &mut [f64; 4], matrix: &[[f64; 2]; 4], slope: &[f64; 2]) {
    for (value, row) in sum.iter_mut().zip(matrix) {
        *value += dot(row, slope);
    }
}
