//! Pseudo-arclength continuation (H. B. Keller, "Numerical Solution of Bifurcation and Nonlinear Eigenvalue Problems",
//! 1977; R. Seydel, "Practical Bifurcation and Stability Analysis", 2010, Ch. 4).
//!
//! The continuation sees n equations R(x, λ) = 0 and none of their meaning. With z = (x, λ) and the unit tangent t, a
//! step
//! predicts z⁰ = z + s t + ½ s² κ, κ being the change of the tangent per arclength in the step before, and solves
//!
//! ```text
//! ⎡ R_x  R_λ ⎤ ⎡δx⎤     ⎡   R(z)   ⎤
//! ⎢          ⎥ ⎢  ⎥ = − ⎢          ⎥     by Newton's method, and with (0, 1) on the right at the solution, the next t.
//! ⎣ t_xᵀ t_λ ⎦ ⎣δλ⎦     ⎣ t·(z−z⁰) ⎦
//! ```
//!
//! Scales. The response of a lightly damped arm is a circle in the plane of its Fourier coefficients, up to thousands
//! of times larger than what surrounds it, and passed within a thousandth of λ. Relative to the size of x itself all of
//! it is smooth. So lengths are measured relative to X = max(|x|, x₀), updated at each step, and λ in units of Λ: the
//! last unknown is λ X/Λ, and a step is at most a fraction of X. A resonance ahead shows in x as 1/(distance) and is
//! approached geometrically.
//!
//! Against jumps and reversals a step is undone and halved if Newton's method needs too many iterations, if the
//! correction is more than a fraction of the step, or if the tangent turns by more than an angle: another branch at
//! that distance would have to be parallel, and a reversal would turn the tangent by 180°.

mod newton;
mod predictor_corrector;
mod slices;

use alloc::vec::Vec;
use core::ops::AddAssign;

pub use predictor_corrector::Continuation;
pub(super) use slices::{Cut, Slices, at_parameter};

use super::dense::norm;
use crate::error::{AnalysisError, Place};

pub use super::dense::Determinant;

/// A system of n equations in n unknowns x and a parameter λ.
pub trait System {
    /// Number of unknowns n.
    fn dimension(&self) -> usize;

    /// Writes R(x, λ) into `residual` (n) and its derivatives by x and then λ into `matrix`: n + 1 columns of n + 1
    /// elements, of which the last is not written. Returns whether the system exists at λ.
    #[must_use]
    fn evaluate(&mut self, x: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool;

    /// Writes R(x, λ) alone into `residual`, where that takes much less time than the derivatives, and returns whether it
    /// has. At a solution, Newton's method then goes on with the factors that it has.
    fn evaluate_residual(&mut self, _x: &[f64], _lambda: f64, _residual: &mut [f64]) -> bool {
        false
    }

    /// The unit of λ, for messages; empty if it has none.
    fn unit(&self) -> &'static str {
        ""
    }

    /// A value of λ with its unit.
    fn place(&self, lambda: f64) -> Place {
        Place { value: lambda, unit: self.unit() }
    }

    /// Returns the largest change of λ from here that can't step over a feature of the system, in the unit of λ.
    fn parameter_step_limit(&self, _lambda: f64) -> f64 {
        f64::INFINITY
    }
}

/// The settings of a continuation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContinuationSettings {
    /// Λ as a fraction of λ, and at least `parameter_floor`.
    pub parameter_fraction: f64,
    /// The least Λ, in the unit of λ, positive.
    pub parameter_floor: f64,
    /// x₀: below this norm x counts as this large, positive.
    pub state_floor: f64,
    /// The largest step, relative to X.
    pub largest_step: f64,
    /// The smallest step, below which the continuation ends, relative to X.
    pub smallest_step: f64,
    /// The largest angle between the tangents at the ends of a step, rad.
    pub largest_turn_rad: f64,
    /// The predictor's error at which the step length aims, relative to X.
    pub predictor_error: f64,
}

impl Default for ContinuationSettings {
    fn default() -> ContinuationSettings {
        ContinuationSettings {
            parameter_fraction: 0.2,
            parameter_floor: 1e-6,
            state_floor: 1e-6,
            largest_step: 0.25,
            smallest_step: 1e-9,
            largest_turn_rad: 0.35,
            predictor_error: 4e-3,
        }
    }
}

/// A solution and how the branch passes through it.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// The unknowns x of the equations at this point.
    pub x: Vec<f64>,
    /// The value of the parameter λ at this point.
    pub lambda: f64,
    /// The arclength from the start, in units of the local X.
    pub arclength: f64,
    /// The direction of the branch: dx and, last, dλ·X/Λ, of unit length.
    pub tangent: Vec<f64>,
    /// The bordered determinant: it changes sign at a branch point, and not at a fold.
    pub determinant: Determinant,
}

/// The error if a bifurcation between two points could not be located.
pub(super) fn not_located(system: &impl System, ends: [&Point; 2]) -> AnalysisError {
    let [from, to] = ends.map(|end| system.place(end.lambda));
    AnalysisError::NotLocated { from, to }
}

/// Counts of the work of a continuation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Evaluations of R and its derivatives.
    pub evaluations: usize,
    /// Factorizations of bordered matrices.
    pub factorizations: usize,
    /// Steps that were accepted.
    pub steps: usize,
    /// Steps that were undone and tried again, shorter.
    pub rejections: usize,
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Work) {
        self.evaluations += other.evaluations;
        self.factorizations += other.factorizations;
        self.steps += other.steps;
        self.rejections += other.rejections;
    }
}

impl ContinuationSettings {
    /// Scale Λ of the parameter at a value.
    pub(crate) fn lambda_scale(&self, lambda: f64) -> f64 {
        (self.parameter_fraction * lambda.abs()).max(self.parameter_floor)
    }

    /// Size X of the unknowns, the unit of the arclength.
    pub(crate) fn size(&self, x: &[f64]) -> f64 {
        norm(x).max(self.state_floor)
    }
}
