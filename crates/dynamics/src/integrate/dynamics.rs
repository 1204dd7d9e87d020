//! Interface of a mechanical system to the integrators: its rates of change, its linear part, a bound of its
//! frequencies, its energy. Static, so that a step compiles to the code of the one system.

use core::array;

use super::motion::Motion;
use crate::real::{Lanes, Real};

/// One number for each stage of a step.
pub type Wide = Lanes<4>;

/// The rates of change of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates<T, const N: usize = 2> {
    /// ẍ, 1/s² of the unit of x.
    pub acceleration: [T; N],
    /// The rate at which loads and dampers change [`Dynamics::energy_j`], W.
    pub power_w: T,
}

/// ẍ and its derivatives at a motion, by row and column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jacobian<const N: usize> {
    /// ẍ at the motion.
    pub acceleration: [f64; N],
    /// ∂ẍ/∂x, 1/s² for coordinates of one unit.
    pub by_position: [[f64; N]; N],
    /// ∂ẍ/∂ẋ, 1/s, by row and column.
    pub by_velocity: [[f64; N]; N],
}

/// The load as a function of time.
pub trait Excitation<Load> {
    /// The load at the time `t_s`, s since the start of the simulation.
    fn load(&self, t_s: f64) -> Load;

    /// Whether the load is the same at all times, so that one evaluation is enough.
    fn is_constant(&self) -> bool {
        false
    }
}

/// The loads at the stages of a step.
#[derive(Clone, Copy, Debug)]
pub struct StageLoads<Load, const S: usize> {
    pub(crate) at: [Load; S],
    /// Whether the load is the same at all.
    pub(crate) held: bool,
}

impl<Load, const S: usize> StageLoads<Load, S> {
    /// The load at a stage; beyond the last that of the last.
    #[inline(always)]
    pub fn at(&self, stage: usize) -> &Load {
        &self.at[stage.min(S - 1)]
    }
}

/// The rates at all stages of a step, a lane each.
pub trait StageEquation<const N: usize> {
    /// The rates at one motion a stage, under the loads of the stages.
    fn rates(&self, motion: &Motion<Wide, N>) -> Rates<Wide, N>;
}

/// Solution of the equation of the stages; a trait, since a closure can't be generic.
pub trait SolveStages<const N: usize> {
    /// Type of the solution.
    type Solution;

    /// Solves for the stages.
    fn solve(self, equation: &impl StageEquation<N>) -> Self::Solution;
}

/// A mechanical system of N coordinates x: ẍ = f(x, ẋ, load).
///
/// Implementations compute without clock, allocation or randomness, with transcendental functions of `libm`, so that
/// the same motions have the same bits on every machine.
pub trait Dynamics<const N: usize> {
    /// Load that acts on the system from outside at an instant.
    type Load: Copy;

    /// The rates under a load.
    fn rates(&self, motion: &Motion<f64, N>, load: &Self::Load) -> Rates<f64, N>;

    /// ẍ and its derivatives under a load.
    fn jacobian(&self, motion: &Motion<f64, N>, load: &Self::Load) -> Jacobian<N>;

    /// The linear part: the derivatives at rest without a load.
    fn linear_part(&self) -> Jacobian<N>;

    /// ω of the fastest mode of the linear part without dampers, rad/s, positive.
    fn fastest_rad_s(&self) -> f64;

    /// A bound of the natural angular frequencies at a position, rad/s.
    fn frequency_bound_rad_s(&self, position: &[f64; N]) -> f64;

    /// The energy whose rate of change is [`Rates::power_w`], J.
    fn energy_j(&self, motion: &Motion<f64, N>) -> f64;

    /// Solves for the stages of a step under their loads. Override it if several motions side by side cost less than
    /// one after the other; the bits of each must be those of [`Dynamics::rates`].
    #[inline(always)]
    fn solve_stages<const S: usize, V: SolveStages<N>>(
        &self,
        loads: &StageLoads<Self::Load, S>,
        solve: V,
    ) -> V::Solution {
        solve.solve(&OneByOne { dynamics: self, loads })
    }
}

/// The stages of any system, one after the other.
struct OneByOne<'a, D: ?Sized, Load, const S: usize> {
    dynamics: &'a D,
    loads: &'a StageLoads<Load, S>,
}

impl<D: Dynamics<N> + ?Sized, const N: usize, const S: usize> StageEquation<N> for OneByOne<'_, D, D::Load, S> {
    #[inline(always)]
    fn rates(&self, motion: &Motion<Wide, N>) -> Rates<Wide, N> {
        let stage: [Rates<f64, N>; Wide::WIDTH] =
            array::from_fn(|i| self.dynamics.rates(&motion.lane(i), self.loads.at(i)));
        Rates {
            acceleration: array::from_fn(|n| Wide::gather(|i| stage[i].acceleration[n])),
            power_w: Wide::gather(|i| stage[i].power_w),
        }
    }
}
