//! Implicit methods whose stages are affine in their slopes: Gauss–Legendre and exponential collocation.
//!
//! With y = (x, v) = (α, α̇) and a constant 2×4 matrix Λ let N(t, y) = α̈(t, y) − Λ y: Λ = 0 for Gauss–Legendre, the
//! linear arm for the exponential method. The unknowns are the slopes Nᵢ at the stages,
//!
//! ```text
//! Yᵢ = y + Sᵢ y + Σⱼ Aᵢⱼ Nⱼ        Gᵢ = Nᵢ − N(tᵢ, Yᵢ) = 0        y⁺ = y + E y + Σⱼ Wⱼ Nⱼ
//! ```
//!
//! with 4×4 matrices Sᵢ, E and 4×2 matrices Aᵢⱼ, Wⱼ that the method sets once for a step length. Fixed-point iteration
//! finds them where N changes little over the step, Newton's method elsewhere; both to rounding.
//!
//! Rounding in a step is as good as random, and the energy walks with its square root; an error of a matrix is the same
//! in every step, and moves the energy steadily: rounded to 2⁻⁵³, by 1e-12 to 1e-10 of itself in 1e7 steps (E. Hairer,
//! R. I. McLachlan, A. Razakarivony, "Achieving Brouwer's law with implicit Runge–Kutta methods", BIT 48 (2008)). So a
//! [`Matrix`] has 79 bits.
//!
//! Stages are lanes of the crate `wide`: with plain arrays, which the compiler splits between sums over stages and
//! matrices, a step takes 1.2 times as long. Its `mul_add` is not used: it rounds once or twice, depending on the
//! processor.

mod fixed_point;
mod newton;

use alloc::vec::Vec;
use core::array;

use wide::f64x4;

use super::double_double::DoubleDouble;
use super::{Excitation, IntegrateError};
use crate::arm::kernel::Motion;
use crate::arm::real::Real;
use crate::arm::{Arm, Load, State};

/// A step has 1, 2, 4 … 2^(LEVELS − 1) = 256 equal parts.
pub(super) const LEVELS: usize = 9;
/// The most energy, relative to the energy, by which a part of a step may miss the work of load and dampers.
const ENERGY_DEFECT_LIMIT: f64 = 1e-3;
/// Below this energy, J, digits of it underflow: 2⁻¹⁰²² over 2⁻⁵².
const ENERGY_WHOLE_J: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// One number a stage; lanes beyond the last stage repeat it.
type Wide = f64x4;

/// A method of S stages at one step length.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Step<const S: usize> {
    /// h, s.
    h_s: f64,
    /// Nodes and weights of the quadrature under the method.
    c: [f64; S],
    b: [f64; S],
    /// Sᵢ.
    start: Matrix<Wide, 4>,
    /// Aᵢⱼ of every j.
    stage: [Matrix<Wide, 2>; S],
    /// Aᵢⱼ of every j, rounded.
    rounded: [Columns<Wide, 2>; S],
    /// E, Wⱼ.
    end: Matrix<f64, 4>,
    weights: [Matrix<f64, 2>; S],
}

/// The matrices of a method for a step length, by stage, row and column.
pub(super) struct MethodCoefficients<const S: usize, Start, Stage, End, Weight> {
    /// h, s.
    pub h_s: f64,
    /// Nodes and weights of the quadrature under the method.
    pub c: [DoubleDouble; S],
    pub b: [DoubleDouble; S],
    /// Sᵢ: i, row, column.
    pub start: Start,
    /// Aᵢⱼ: i, j, row, column.
    pub stage: Stage,
    /// E: row, column.
    pub end: End,
    /// Wⱼ: j, row, column.
    pub weight: Weight,
}

impl<const S: usize> Step<S> {
    pub fn new(
        of: &MethodCoefficients<
            S,
            impl Fn(usize, usize, usize) -> DoubleDouble,
            impl Fn(usize, usize, usize, usize) -> DoubleDouble,
            impl Fn(usize, usize) -> DoubleDouble,
            impl Fn(usize, usize, usize) -> DoubleDouble,
        >,
    ) -> Step<S> {
        let last = |i: usize| i.min(S - 1);
        let stage = array::from_fn(|j| Matrix::new(|i, row, column| (of.stage)(last(i), j, row, column)));
        Step {
            h_s: of.h_s,
            c: of.c.map(|node| node.high),
            b: of.b.map(|weight| weight.high),
            start: Matrix::new(|i, row, column| (of.start)(last(i), row, column)),
            rounded: array::from_fn(|j| Matrix::rounded(&stage[j])),
            stage,
            end: Matrix::new(|_, row, column| (of.end)(row, column)),
            weights: array::from_fn(|j| Matrix::new(|_, row, column| (of.weight)(j, row, column))),
        }
    }
}

/// A matrix of four rows and C columns, by columns; or one in each lane.
type Columns<T, const C: usize> = [[T; 4]; C];

/// Such a matrix with entries of 79 bits: each is the sum of its first 26 bits and the next 53. If the first part had
/// all 53 bits of `f64`, rounding its product would swallow the second part, the same way in every step.
#[derive(Clone, Debug, PartialEq)]
struct Matrix<T, const C: usize> {
    high: Columns<T, C>,
    low: Columns<T, C>,
}

impl<T: Real, const C: usize> Matrix<T, C> {
    /// The matrix with these entries by lane, row and column.
    fn new(entry: impl Fn(usize, usize, usize) -> DoubleDouble) -> Matrix<T, C> {
        let part = |part: fn([f64; 2]) -> f64| {
            columns(|row, column| T::gather(|i| part(entry(i, row, column).head_and_tail())))
        };
        Matrix { high: part(|[high, _]| high), low: part(|[_, low]| low) }
    }

    fn rounded(&self) -> Columns<T, C> {
        columns(|row, column| self.high[column][row] + self.low[column][row])
    }
}

fn columns<T, const C: usize>(entry: impl Fn(usize, usize) -> T) -> Columns<T, C> {
    array::from_fn(|column| array::from_fn(|row| entry(row, column)))
}

/// sum += matrix · y, of two or four columns, in pairs: the processor works on the pairs at the same time.
#[inline(always)]
fn add_product<T: Real, const C: usize>(sum: &mut [T; 4], matrix: &Columns<T, C>, y: &[f64; C]) {
    let pair = |row: usize, n: usize| matrix[n][row] * T::splat(y[n]) + matrix[n + 1][row] * T::splat(y[n + 1]);
    for (row, sum) in sum.iter_mut().enumerate() {
        let product = if C == 4 { pair(row, 0) + pair(row, 2) } else { pair(row, 0) };
        *sum = *sum + product;
    }
}

/// A method of S stages for the step and its parts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Collocation<const S: usize> {
    /// Λ.
    pub linear: [[f64; 4]; 2],
    /// The step lengths h, h/2, h/4 …
    pub levels: Vec<Step<S>>,
    /// The level that every step starts from, the same for all where possible: steps that depend on the state, as when
    /// strong vibration makes some be divided and others not, don't conserve the energy.
    pub least_level: usize,
    /// The largest ωh of a part, rad, with ω at the deflection where the step starts.
    pub phase_per_part_rad: f64,
}

impl<const S: usize> Collocation<S> {
    /// One step, in as few equal parts as possible: far from the pose the arm can be several times as stiff, and in a
    /// part that turns the phase too far the stages are not found, or are wrong. The number of parts is doubled until
    /// the stages are found and the energy balance holds in every part; the work is bounded, and a step that fails in
    /// the smallest parts is an error.
    #[inline(never)]
    pub fn step(
        &self,
        arm: &Arm,
        t_s: f64,
        state: &State,
        excitation: &impl Excitation,
    ) -> Result<State, IntegrateError> {
        let mut level = self.first_level(arm, state);
        loop {
            match self.parts(level, arm, t_s, state, excitation) {
                Err(_) if level + 1 < LEVELS => level += 1,
                result => return result,
            }
        }
    }

    /// One step, in the parts of a level.
    #[inline(always)]
    fn parts(
        &self,
        level: usize,
        arm: &Arm,
        t_s: f64,
        state: &State,
        excitation: &impl Excitation,
    ) -> Result<State, IntegrateError> {
        let (step, mut state) = (&self.levels[level], *state);
        for k in 0..1_u32 << level {
            state = step.advance(&self.linear, arm, t_s + f64::from(k) * step.h_s, &state, excitation)?;
        }
        Ok(state)
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

/// The slopes of the stages.
type Slopes<const S: usize> = [[f64; 2]; S];

/// The solved equations of a step.
struct Solution<const S: usize> {
    slopes: Slopes<S>,
    /// The work that goes into motion and springs over the step, J.
    work_j: f64,
}

/// The equations of the stages of one step.
struct Stages<'a, const S: usize> {
    step: &'a Step<S>,
    linear: &'a [[f64; 4]; 2],
    arm: &'a Arm,
    loads: [Load; S],
    /// Whether the load is the same at all stages.
    held: bool,
    y: [f64; 4],
    /// Sᵢ y.
    from_start: [Wide; 4],
}

impl<const S: usize> Step<S> {
    #[inline(always)]
    fn advance(
        &self,
        linear: &[[f64; 4]; 2],
        arm: &Arm,
        t_s: f64,
        state: &State,
        excitation: &impl Excitation,
    ) -> Result<State, IntegrateError> {
        let y = vector(state);
        let mut from_start = [Wide::splat(0.0); 4];
        add_product(&mut from_start, &self.start.low, &y);
        add_product(&mut from_start, &self.start.high, &y);
        let held = excitation.is_constant();
        let loads = if held {
            [excitation.load(t_s); S]
        } else {
            array::from_fn(|i| excitation.load(t_s + self.c[i] * self.h_s))
        };
        let stages = Stages { step: self, linear, arm, loads, held, y, from_start };
        let solution = match fixed_point::solve(&stages) {
            Some(solution) => solution,
            None => newton::solve(&stages, t_s)?,
        };
        self.finish(&stages, t_s, state, &solution)
    }

    /// The state at the end of the step from the solved slopes, if the energy it gained is the work done.
    #[inline(always)]
    fn finish(
        &self,
        stages: &Stages<S>,
        t_s: f64,
        state: &State,
        solution: &Solution<S>,
    ) -> Result<State, IntegrateError> {
        let mut change = [0.0; 4];
        // The small terms first: rounding is then that of one sum.
        add_product(&mut change, &self.end.low, &stages.y);
        for (weight, slope) in self.weights.iter().zip(&solution.slopes) {
            add_product(&mut change, &weight.low, slope);
        }
        for (weight, slope) in self.weights.iter().zip(&solution.slopes) {
            add_product(&mut change, &weight.high, slope);
        }
        add_product(&mut change, &self.end.high, &stages.y);
        let [x1, x2, v1, v2] = array::from_fn(|row| stages.y[row] + change[row]);
        let next = State::new([x1, x2], [v1, v2]);
        let [before, after] = [state, &next].map(|state| stages.arm.energy_of_motion_and_springs_j(&state.into()));
        let defect_j = libm::fabs(after - before - solution.work_j);
        if defect_j <= ENERGY_DEFECT_LIMIT * before.max(after).max(ENERGY_WHOLE_J) {
            Ok(next)
        } else if defect_j.is_finite() {
            Err(IntegrateError::Unbalanced { t_s, defect: defect_j / before.max(after) })
        } else {
            Err(IntegrateError::NotFinite { t_s: t_s + self.h_s })
        }
    }
}

impl<const S: usize> Stages<'_, S> {
    /// The slope at the start of the step under the first stage's load.
    #[inline(always)]
    fn first_slope(&self) -> [f64; 2] {
        let [x1, x2, v1, v2] = self.y;
        let start = State::new([x1, x2], [v1, v2]);
        let acceleration = self.arm.acceleration(&start, &self.loads[0]);
        self.slope(&Motion::from(&start), acceleration.into())
    }

    /// N = α̈ − Λy.
    #[inline(always)]
    fn slope<T: Real>(&self, y: &Motion<T>, acceleration_rad_s2: [T; 2]) -> [T; 2] {
        let row = |row: usize| {
            let [by_x1, by_x2, by_v1, by_v2] = self.linear[row].map(T::splat);
            acceleration_rad_s2[row] - ((by_x1 * y.x[0] + by_x2 * y.x[1]) + (by_v1 * y.v[0] + by_v2 * y.v[1]))
        };
        [row(0), row(1)]
    }

    /// All Yᵢ.
    #[inline(always)]
    fn states(&self, slopes: &[Wide; 2]) -> Motion<Wide> {
        let mut change = self.from_start;
        let at = |j: usize| slopes.map(|slope| slope.lane(j));
        for (j, matrix) in self.step.stage.iter().enumerate() {
            add_product(&mut change, &matrix.low, &at(j));
        }
        for (j, matrix) in self.step.stage.iter().enumerate() {
            add_product(&mut change, &matrix.high, &at(j));
        }
        self.moved(&change)
    }

    /// The states y + `change`.
    #[inline(always)]
    fn moved(&self, change: &[Wide; 4]) -> Motion<Wide> {
        let row = |row: usize| Wide::splat(self.y[row]) + change[row];
        Motion { x: [row(0), row(1)], v: [row(2), row(3)] }
    }

    /// The work that goes into motion and springs over the step, J: h Σ bᵢ times the power at stage i.
    #[inline(always)]
    fn work_j(&self, power_w: impl Fn(usize) -> f64) -> f64 {
        let sum_w: f64 = (0..S).map(|i| self.step.b[i] * power_w(i)).sum();
        self.step.h_s * sum_w
    }
}

fn vector(state: &State) -> [f64; 4] {
    let (x, v) = (&state.alpha_rad, &state.alpha_dot_rad_s);
    [x.x, x.y, v.x, v.y]
}
