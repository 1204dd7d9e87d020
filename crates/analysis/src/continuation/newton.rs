//! Newton's method on the bordered system.

use alloc::vec::Vec;

use super::{System, Work};
use crate::dense::{Determinant, Lu, dot, norm};
use crate::refusal::StepRefusal;

/// The most Newton iterations in a step.
pub(super) const NEWTON_LIMIT: usize = 6;
/// The most where the matrix may be nearly singular, as near a branch point: Newton's method then only halves the
/// error.
pub(super) const PATIENT_LIMIT: usize = 40;
/// The error, relative to X, at which Newton's method ends. The corrections go as δₖ₊₁ = C δₖ², so after two of them
/// the next is known as δₖ³/δₖ₋₁² and need not be made if it is below this; a first one must be below it itself.
const NEWTON_ERROR: f64 = 1e-11;
/// Corrections below this count as being in the range of quadratic convergence.
const NEWTON_RANGE: f64 = 1e-3;
/// The most corrections with the same factors, and the largest ratio of one to the one before.
const REFINEMENTS: usize = 4;
const SLOWEST_RATIO: f64 = 0.05;
/// Where first corrections must be less than this, relative to X, steps are short because the derivatives change within
/// them. Those of another point then say nothing about the tangent.
const LEAST_REFINED: f64 = 1e-4;

/// The step of a difference along the tangent, relative to X.
const TANGENT_STEP: f64 = 1e-6;

/// Storage of Newton's method, with counts of its work.
#[derive(Clone, Debug, Default)]
pub(super) struct Solver {
    lu: Lu,
    right: Vec<f64>,
    /// The solution: x, and σλ.
    pub z: Vec<f64>,
    /// Whether the factors are those at a distance of the solution, from which it was refined.
    is_distant: bool,
    pub work: Work,
}

/// The plane in which z is sought: normal·(z − through) = 0, where the last component of z is σλ.
pub(super) struct Plane<'a> {
    pub normal: &'a [f64],
    pub through: &'a [f64],
    pub sigma: f64,
}

impl Solver {
    /// Newton's method from `plane.through` to the branch, in at most `limit` iterations; beyond [`NEWTON_LIMIT`] a correction
    /// may also grow once. The result is left in `self.z`, and the factors of the bordered matrix near it in `self.lu`. Returns
    /// the first correction, relative to `size`, which must not be above `largest`.
    pub fn correct(
        &mut self,
        limit: usize,
        largest: f64,
        system: &mut impl System,
        plane: &Plane,
        size: f64,
    ) -> Result<f64, StepRefusal> {
        let n = system.dimension();
        self.is_distant = false;
        self.z.clear();
        self.z.extend_from_slice(plane.through);
        let mut first = 0.0;
        let mut before = f64::INFINITY;
        for iteration in 0..limit {
            self.linearise(system, plane)?;
            self.right[n] = dot(plane.normal, &self.z) - dot(plane.normal, plane.through);
            self.lu.solve(&mut self.right);
            self.z.iter_mut().zip(&self.right).for_each(|(z, correction)| *z -= correction);
            let correction = norm(&self.right) / size;
            if !correction.is_finite() {
                return Err(StepRefusal::Singular);
            }
            if iteration == 0 {
                if correction > largest {
                    return Err(StepRefusal::Correction);
                }
                first = correction;
            }
            let next =
                if before.is_finite() { correction * correction * correction / (before * before) } else { correction };
            if correction < NEWTON_ERROR || (correction < NEWTON_RANGE && next < NEWTON_ERROR) {
                return Ok(first);
            }
            // A growing correction means divergence, except near a singular matrix, where the patient limit allows for
            // it.
            if correction > before && limit == NEWTON_LIMIT {
                break;
            }
            before = correction;
            if limit == NEWTON_LIMIT
                && largest > LEAST_REFINED
                && correction < NEWTON_RANGE
                && self.refine(system, plane, size, correction)
            {
                return Ok(first);
            }
        }
        Err(StepRefusal::Newton)
    }

    /// Corrects z further with the factors of the last iteration, and returns whether that suffices. If not, z is as before.
    ///
    /// With the matrix at a distance δₖ of the solution, the corrections fall as δₖ₊₁ = C δₖ δₖ₊₁: by the same ratio each.
    fn refine(&mut self, system: &mut impl System, plane: &Plane, size: f64, correction: f64) -> bool {
        let n = system.dimension();
        let start = self.z.clone();
        let mut before = correction;
        for _ in 0..REFINEMENTS {
            if !system.evaluate_residual(&self.z[..n], self.z[n] / plane.sigma, &mut self.right[..n]) {
                break;
            }
            self.right[n] = dot(plane.normal, &self.z) - dot(plane.normal, plane.through);
            self.lu.solve(&mut self.right);
            self.z.iter_mut().zip(&self.right).for_each(|(z, correction)| *z -= correction);
            let correction = norm(&self.right) / size;
            let ratio = correction / before;
            // Slower than this, another matrix takes less time.
            if ratio.is_nan() || ratio >= SLOWEST_RATIO {
                break;
            }
            if correction * ratio < (1.0 - ratio) * NEWTON_ERROR {
                self.is_distant = true;
                return true;
            }
            before = correction;
        }
        self.z = start;
        false
    }

    /// Computes R into `right` and the factors of the bordered matrix into `lu`, at `z`.
    fn linearise(&mut self, system: &mut impl System, plane: &Plane) -> Result<(), StepRefusal> {
        let n = system.dimension();
        let matrix = self.lu.zeroed(n + 1);
        self.right.clear();
        self.right.resize(n + 1, 0.0);
        self.work.evaluations += 1;
        if !system.evaluate(&self.z[..n], self.z[n] / plane.sigma, &mut self.right[..n], matrix) {
            return Err(StepRefusal::OutOfRange);
        }
        // The last unknown is σλ, and ∂R/∂(σλ) = R_λ/σ.
        matrix[n * (n + 1)..].iter_mut().for_each(|by_lambda| *by_lambda /= plane.sigma);
        for (column, normal) in matrix.chunks_exact_mut(n + 1).zip(plane.normal) {
            column[n] = *normal;
        }
        self.work.factorizations += 1;
        self.lu.factor().map_err(|_| StepRefusal::Singular)
    }

    /// The bordered determinant of the last iteration.
    pub fn determinant(&self) -> Determinant {
        self.lu.determinant()
    }

    /// The unit vector along the branch, from the factors of the last iteration; `tangent` receives it.
    ///
    /// Of factors at a distance it is corrected once, by the change of R along it.
    pub fn tangent(
        &mut self,
        system: &mut impl System,
        plane: &Plane,
        size: f64,
        tangent: &mut Vec<f64>,
    ) -> Result<(), StepRefusal> {
        let n = system.dimension();
        tangent.clear();
        tangent.resize(n + 1, 0.0);
        // R_x dx + R_λ dλ = 0 and normal · dz = 1: the solution points along the branch, to the side of the normal.
        tangent[n] = 1.0;
        self.lu.solve(tangent);
        if self.is_distant {
            let step = TANGENT_STEP * size / norm(tangent);
            let ahead: Vec<f64> = self.z.iter().zip(&*tangent).map(|(z, t)| z + step * t).collect();
            if system.evaluate_residual(&ahead[..n], ahead[n] / plane.sigma, &mut self.right[..n]) {
                self.right[n] = step * (dot(plane.normal, tangent) - 1.0);
                self.lu.solve(&mut self.right);
                tangent.iter_mut().zip(&self.right).for_each(|(t, correction)| *t -= correction / step);
            }
            // The system is left at the solution, whose evaluation is the next that is needed.
            let _ = system.evaluate_residual(&self.z[..n], self.z[n] / plane.sigma, &mut self.right[..n]);
        }
        let length = norm(tangent);
        if !(length.is_finite() && length > 0.0) {
            return Err(StepRefusal::Singular);
        }
        tangent.iter_mut().for_each(|value| *value /= length);
        Ok(())
    }
}
