//! Implicit methods whose stages are affine in their slopes: Gauss–Legendre and exponential collocation.
//!
//! With y = (x, ẋ) of n coordinates and a constant n×2n matrix Λ let N(t, y) = ẍ(t, y) − Λ y: Λ = 0 for
//! Gauss–Legendre, the linear part for the exponential method. The unknowns are the slopes Nᵢ at the stages,
//!
//! ```text
//! Yᵢ = y + Sᵢ y + Σⱼ Aᵢⱼ Nⱼ        Gᵢ = Nᵢ − N(tᵢ, Yᵢ) = 0        y⁺ = y + E y + Σⱼ Wⱼ Nⱼ
//! ```
//!
//! with 2n×2n matrices Sᵢ, E and 2n×n matrices Aᵢⱼ, Wⱼ that the method sets once for a step length. Fixed-point
//! iteration finds them where N changes little over the step, Newton's method elsewhere; both to rounding.
//!
//! Rounding in a step is as good as random, and the energy walks with its square root; an error of a matrix is the same
//! in every step, and moves the energy steadily: rounded to 2⁻⁵³, by 1e-12 to 1e-10 of itself in 1e7 steps (E. Hairer,
//! R. I. McLachlan, A. Razakarivony, "Achieving Brouwer's law with implicit Runge–Kutta methods", BIT 48 (2008)). So a
//! [`Matrix`] has 79 bits.
//!
//! Stages are lanes. A step is compiled for registers of four numbers, too: it takes half as long with six links.

mod fixed_point;
mod newton;

use alloc::vec::Vec;

use super::double_double::DoubleDouble;
use super::dynamics::{Dynamics, Excitation, StageLoads, Wide};
use super::error::IntegrateError;
use super::motion::Motion;
use crate::real::Real;
use resonarm_numeric::registers::{Task, four_wide};

/// A step has 1, 2, 4 … 2^(LEVELS − 1) = 256 equal parts.
pub(super) const LEVELS: usize = 9;
/// The most energy, relative to the energy, by which a part of a step may miss the work of load and dampers.
const ENERGY_DEFECT_LIMIT: f64 = 1e-3;
/// Below this energy, J, digits of it underflow: 2⁻¹⁰²² over 2⁻⁵².
const ENERGY_WHOLE_J: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// A method of S stages for N coordinates at one step length. Lanes beyond the last stage repeat it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step<const S: usize, const N: usize> {
    /// Step length h, s.
    h_s: f64,
    /// Nodes and weights of the quadrature under the method.
    c: [f64; S],
    b: [f64; S],
    /// Sᵢ, which multiplies the state at the start.
    start: Square<Wide, N>,
    /// Aᵢⱼ of every j.
    stage: [Matrix<Wide, N>; S],
    /// Aᵢⱼ of every j, rounded.
    rounded: [Columns<Wide, N>; S],
    /// E, and Wⱼ of every j, for the end of the step.
    end: Square<f64, N>,
    weights: [Matrix<f64, N>; S],
}

/// The matrices of a method for a step length, by stage, row and column. They are computed once, so by functions that
/// are compiled once.
pub(super) struct MethodCoefficients<'a, const S: usize> {
    /// Step length h, s.
    pub h_s: f64,
    /// Nodes and weights of the quadrature under the method.
    pub c: [DoubleDouble; S],
    pub b: [DoubleDouble; S],
    /// Sᵢ: i, row, column.
    pub start: &'a dyn Fn(usize, usize, usize) -> DoubleDouble,
    /// Aᵢⱼ: i, j, row, column.
    pub stage: &'a dyn Fn(usize, usize, usize, usize) -> DoubleDouble,
    /// E, by row and column.
    pub end: &'a dyn Fn(usize, usize) -> DoubleDouble,
    /// Wⱼ: j, row, column.
    pub weight: &'a dyn Fn(usize, usize, usize) -> DoubleDouble,
}

impl<const S: usize, const N: usize> Step<S, N> {
    pub fn new(of: &MethodCoefficients<S>) -> Step<S, N> {
        // Lanes beyond the last stage repeat it: they compute finite numbers that nobody reads.
        let last = |i: usize| i.min(S - 1);
        let mut c = [0.0; S];
        let mut b = [0.0; S];
        let mut stage = [Matrix::zero(); S];
        let mut rounded = [Matrix::zero().high; S];
        let mut weights = [Matrix::zero(); S];
        for j in 0..S {
            c[j] = of.c[j].high;
            b[j] = of.b[j].high;
            stage[j] = Matrix::new(&|i, row, column| (of.stage)(last(i), j, row, column));
            rounded[j] = stage[j].rounded();
            weights[j] = Matrix::new(&|_, row, column| (of.weight)(j, row, column));
        }
        Step {
            h_s: of.h_s,
            c,
            b,
            start: Square::new(&|i, row, column| (of.start)(last(i), row, column)),
            stage,
            rounded,
            end: Square::new(&|_, row, column| (of.end)(row, column)),
            weights,
        }
    }
}

/// A matrix of 2N rows and N columns, by columns; or one in each lane.
type Columns<T, const N: usize> = [Motion<T, N>; N];

/// Matrix of 2N rows and N columns with entries of 79 bits: each is the sum of its first 26 bits and the next 53. If
/// the first part had all 53 bits of `f64`, rounding its product would swallow the second part, the same way in every
/// step.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Matrix<T, const N: usize> {
    high: Columns<T, N>,
    low: Columns<T, N>,
}

impl<T: Real, const N: usize> Matrix<T, N> {
    fn zero() -> Matrix<T, N> {
        Matrix { high: [Motion::splat(0.0); N], low: [Motion::splat(0.0); N] }
    }

    /// The matrix with these entries by lane, row and column.
    fn new(entry: &dyn Fn(usize, usize, usize) -> DoubleDouble) -> Matrix<T, N> {
        let mut matrix = Matrix::zero();
        for (column, (high, low)) in matrix.high.iter_mut().zip(&mut matrix.low).enumerate() {
            for row in 0..N {
                [high.x[row], low.x[row]] = lanes(&|i| entry(i, row, column));
                [high.v[row], low.v[row]] = lanes(&|i| entry(i, N + row, column));
            }
        }
        matrix
    }

    fn rounded(&self) -> Columns<T, N> {
        let mut rounded = self.high;
        for (rounded, low) in rounded.iter_mut().zip(&self.low) {
            *rounded = rounded.zip(low, |high, low| high + low);
        }
        rounded
    }
}

/// Both parts of an entry, a lane each.
fn lanes<T: Real>(entry: &dyn Fn(usize) -> DoubleDouble) -> [T; 2] {
    [T::gather(|i| entry(i).head_and_tail()[0]), T::gather(|i| entry(i).head_and_tail()[1])]
}

/// A matrix of 2N rows and columns, as [`Matrix`]: the columns that positions are multiplied by, and those of
/// velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Square<T, const N: usize> {
    high: [Columns<T, N>; 2],
    low: [Columns<T, N>; 2],
}

impl<T: Real, const N: usize> Square<T, N> {
    /// The matrix with these entries by lane, row and column.
    fn new(entry: &dyn Fn(usize, usize, usize) -> DoubleDouble) -> Square<T, N> {
        let half = |half: usize| Matrix::new(&|i, row, column| entry(i, row, half * N + column));
        let [positions, velocities] = [half(0), half(1)];
        Square { high: [positions.high, velocities.high], low: [positions.low, velocities.low] }
    }
}

/// sum += matrix · y of a square one.
#[inline(always)]
fn add_square_product<T: Real, const N: usize>(
    sum: &mut Motion<T, N>,
    [by_position, by_velocity]: &[Columns<T, N>; 2],
    y: &Motion<f64, N>,
) {
    let x = product(by_position, &y.x);
    let v = product(by_velocity, &y.v);
    *sum = sum.zip(&x.zip(&v, |x, v| x + v), |sum, product| sum + product);
}

/// Up to so many coordinates the sums of all rows of a [`Motion`] of [`Wide`] fit in the registers of SSE2 and NEON.
const NARROW: usize = 2;

/// The product matrix · y of a matrix by columns.
#[inline(always)]
fn product<T: Real, const N: usize>(matrix: &Columns<T, N>, y: &[f64; N]) -> Motion<T, N> {
    // From the first product on: 0 + (−0) would be 0.
    let first = Motion::splat(y[0]);
    let mut sum = matrix[0].zip(&first, |entry, y| entry * y);
    if N <= NARROW {
        for n in 1..N {
            let factor = T::splat(y[n]);
            sum = sum.zip(&matrix[n], |sum, entry| sum + entry * factor);
        }
        return sum;
    }
    // The same sums, one row after the other, by plain loops: with eight coordinates a closure would be called.
    for row in 0..N {
        let mut x = sum.x[row];
        for n in 1..N {
            x = x + matrix[n].x[row] * T::splat(y[n]);
        }
        sum.x[row] = x;
    }
    for row in 0..N {
        let mut v = sum.v[row];
        for n in 1..N {
            v = v + matrix[n].v[row] * T::splat(y[n]);
        }
        sum.v[row] = v;
    }
    sum
}

/// sum += matrix · y.
#[inline(always)]
fn add_product<T: Real, const N: usize>(sum: &mut Motion<T, N>, matrix: &Columns<T, N>, y: &[f64; N]) {
    *sum = sum.zip(&product(matrix, y), |sum, product| sum + product);
}

/// The slopes of a stage.
#[inline(always)]
fn of_stage<const N: usize>(slopes: &[Wide; N], stage: usize) -> [f64; N] {
    let mut of_stage = [0.0; N];
    for n in 0..N {
        of_stage[n] = slopes[n].lane(stage);
    }
    of_stage
}

/// Λ, by row and column: its share of positions, and of velocities.
pub(super) type LinearPart<const N: usize> = [[[f64; N]; N]; 2];

/// A method of S stages for the step and its parts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Collocation<const S: usize, const N: usize> {
    /// Λ; zero for Gauss–Legendre.
    pub linear: LinearPart<N>,
    /// The step lengths h, h/2, h/4 …
    pub levels: Vec<Step<S, N>>,
    /// The level that every step starts from, the same for all where possible: steps that depend on the state, as when
    /// strong vibration makes some be divided and others not, don't conserve the energy.
    pub least_level: usize,
    /// The largest ωh of a part, rad, with ω at the deflection where the step starts.
    pub phase_per_part_rad: f64,
}

impl<const S: usize, const N: usize> Collocation<S, N> {
    /// One step, in as few equal parts as possible: far from rest the arm can be several times as stiff, and in a
    /// part that turns the phase too far the stages are not found, or are wrong. The number of parts is doubled until
    /// the stages are found and the energy balance holds in every part; the work is bounded, and a step that fails in
    /// the smallest parts is an error.
    #[inline(never)]
    pub fn step<D: Dynamics<N>>(
        &self,
        dynamics: &D,
        t_s: f64,
        y: &Motion<f64, N>,
        excitation: &impl Excitation<D::Load>,
    ) -> Result<Motion<f64, N>, IntegrateError> {
        four_wide(WholeStep { method: self, dynamics, t_s, y, excitation })
    }

    /// One step, in the parts of a level.
    #[inline(always)]
    fn parts<D: Dynamics<N>>(
        &self,
        level: usize,
        dynamics: &D,
        t_s: f64,
        y: &Motion<f64, N>,
        excitation: &impl Excitation<D::Load>,
    ) -> Result<Motion<f64, N>, IntegrateError> {
        let step = &self.levels[level];
        let mut y = *y;
        for k in 0..1_u32 << level {
            y = step.advance(&self.linear, dynamics, t_s + f64::from(k) * step.h_s, &y, excitation)?;
        }
        Ok(y)
    }

    /// The first level whose parts keep the phase limit, or else the last.
    fn first_level(&self, dynamics: &impl Dynamics<N>, y: &Motion<f64, N>) -> usize {
        if self.phase_per_part_rad == f64::INFINITY {
            return self.least_level;
        }
        let frequency_rad_s = dynamics.frequency_bound_rad_s(&y.x);
        let within = |step: &Step<S, N>| frequency_rad_s * step.h_s <= self.phase_per_part_rad;
        self.levels.iter().position(within).unwrap_or(LEVELS - 1).max(self.least_level)
    }
}

/// A step, for any registers.
struct WholeStep<'a, D, E, const S: usize, const N: usize> {
    method: &'a Collocation<S, N>,
    dynamics: &'a D,
    t_s: f64,
    y: &'a Motion<f64, N>,
    excitation: &'a E,
}

impl<D: Dynamics<N>, E: Excitation<D::Load>, const S: usize, const N: usize> Task for WholeStep<'_, D, E, S, N> {
    type Output = Result<Motion<f64, N>, IntegrateError>;

    #[inline(always)]
    fn run(self) -> Result<Motion<f64, N>, IntegrateError> {
        let WholeStep { method, dynamics, t_s, y, excitation } = self;
        let mut level = method.first_level(dynamics, y);
        loop {
            match method.parts(level, dynamics, t_s, y, excitation) {
                // Whatever failed in these parts, smaller ones may do; only in the smallest it is an error.
                Err(_) if level + 1 < LEVELS => level += 1,
                result => return result,
            }
        }
    }
}

/// The first level whose parts turn small vibration at `fastest_rad_s` by `phase_rad` at most, or else the last.
pub(super) fn least_level<const S: usize, const N: usize>(
    fastest_rad_s: f64,
    levels: &[Step<S, N>],
    phase_rad: f64,
) -> usize {
    levels.iter().position(|step| fastest_rad_s * step.h_s <= phase_rad).unwrap_or(LEVELS - 1)
}

/// The slopes of the stages.
type Slopes<const S: usize, const N: usize> = [[f64; N]; S];

/// The solved equations of a step.
struct Solution<const S: usize, const N: usize> {
    slopes: Slopes<S, N>,
    /// The work that goes into motion and springs over the step, J.
    work_j: f64,
}

/// The equations of the stages of one step.
struct Stages<'a, D: Dynamics<N>, const S: usize, const N: usize> {
    step: &'a Step<S, N>,
    linear: &'a LinearPart<N>,
    dynamics: &'a D,
    loads: StageLoads<D::Load, S>,
    y: Motion<f64, N>,
    /// Sᵢ y of every stage.
    from_start: Motion<Wide, N>,
}

impl<const S: usize, const N: usize> Step<S, N> {
    #[inline(always)]
    fn advance<D: Dynamics<N>>(
        &self,
        linear: &LinearPart<N>,
        dynamics: &D,
        t_s: f64,
        y: &Motion<f64, N>,
        excitation: &impl Excitation<D::Load>,
    ) -> Result<Motion<f64, N>, IntegrateError> {
        let mut from_start = Motion::splat(0.0);
        // The small terms first, as in `finish`.
        add_square_product(&mut from_start, &self.start.low, y);
        add_square_product(&mut from_start, &self.start.high, y);
        let held = excitation.is_constant();
        let mut at = [excitation.load(if held { t_s } else { t_s + self.c[0] * self.h_s }); S];
        if !held {
            for (at, c) in at.iter_mut().zip(&self.c).skip(1) {
                *at = excitation.load(t_s + c * self.h_s);
            }
        }
        let loads = StageLoads { at, held };
        let stages = Stages { step: self, linear, dynamics, loads, y: *y, from_start };
        let solution = match fixed_point::solve(&stages) {
            Some(solution) => solution,
            None => newton::solve(&stages, t_s)?,
        };
        self.finish(&stages, t_s, &solution)
    }

    /// The state at the end of the step from the solved slopes, if the energy it gained is the work done.
    #[inline(always)]
    fn finish<D: Dynamics<N>>(
        &self,
        stages: &Stages<D, S, N>,
        t_s: f64,
        solution: &Solution<S, N>,
    ) -> Result<Motion<f64, N>, IntegrateError> {
        let mut change = Motion::splat(0.0);
        // The small terms first: rounding is then that of one sum.
        add_square_product(&mut change, &self.end.low, &stages.y);
        for (weight, slope) in self.weights.iter().zip(&solution.slopes) {
            add_product(&mut change, &weight.low, slope);
        }
        for (weight, slope) in self.weights.iter().zip(&solution.slopes) {
            add_product(&mut change, &weight.high, slope);
        }
        add_square_product(&mut change, &self.end.high, &stages.y);
        let next = stages.y.zip(&change, |y, change| y + change);
        // Stages can converge to a wrong step. The energy shows it: it changes by more or less than the work done.
        let before = stages.dynamics.energy_j(&stages.y);
        let after = stages.dynamics.energy_j(&next);
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

impl<D: Dynamics<N>, const S: usize, const N: usize> Stages<'_, D, S, N> {
    /// The slope at the start of the step under the first stage's load.
    #[inline(always)]
    fn first_slope(&self) -> [f64; N] {
        let acceleration = self.dynamics.rates(&self.y, self.loads.at(0)).acceleration;
        self.slope(&self.y, acceleration)
    }

    /// N = ẍ − Λy.
    #[inline(always)]
    fn slope<T: Real>(&self, y: &Motion<T, N>, acceleration: [T; N]) -> [T; N] {
        let [by_position, by_velocity] = self.linear;
        let dot = |row: &[f64; N], of: &[T; N]| {
            (1..N).fold(T::splat(row[0]) * of[0], |sum, n| sum + T::splat(row[n]) * of[n])
        };
        let mut slope = acceleration;
        for row in 0..N {
            slope[row] = acceleration[row] - (dot(&by_position[row], &y.x) + dot(&by_velocity[row], &y.v));
        }
        slope
    }

    /// The states Yᵢ of all stages, by matrices of 79 bits.
    #[inline(always)]
    fn states(&self, slopes: &[Wide; N]) -> Motion<Wide, N> {
        let mut change = self.from_start;
        for (j, matrix) in self.step.stage.iter().enumerate() {
            add_product(&mut change, &matrix.low, &of_stage(slopes, j));
        }
        for (j, matrix) in self.step.stage.iter().enumerate() {
            add_product(&mut change, &matrix.high, &of_stage(slopes, j));
        }
        self.moved(&change)
    }

    /// The states y + `change`.
    #[inline(always)]
    fn moved(&self, change: &Motion<Wide, N>) -> Motion<Wide, N> {
        let mut moved = *change;
        for n in 0..N {
            moved.x[n] = Wide::splat(self.y.x[n]) + change.x[n];
            moved.v[n] = Wide::splat(self.y.v[n]) + change.v[n];
        }
        moved
    }

    /// The work that goes into motion and springs over the step, J: h Σ bᵢ times the power at stage i.
    #[inline(always)]
    fn work_j(&self, power_w: impl Fn(usize) -> f64) -> f64 {
        let sum_w: f64 = (0..S).map(|i| self.step.b[i] * power_w(i)).sum();
        self.step.h_s * sum_w
    }
}
