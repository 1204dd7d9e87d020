//! Newton's method on the bordered system.

use alloc::vec::Vec;

use super::{StepRefusal, System, Work};
use crate::dense::{Determinant, Lu, dot, norm};

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
/// Storage of Newton's method, with counts of its work.
#[derive(Clone, Debug, Default)]
pub(super) struct Solver {
    lu: Lu,
    right: Vec<f64>,
    /// The solution: x, and σλ.
    pub z: Vec<f64>,
    pub work: Work,
}

/// The plane in which z is sought: normal·(z − through) = 0, where the last component of z is σλ.
pub(super) struct Plane<'a> {
    pub normal: &'a [f64],
    pub through: &'a [f64],
    pub sigma: f64,
}

impl Solver {
    /// Newton's method from `plane.through` to the branch; the result is left in `self.z`, and the factors of the
    /// bordered matrix near it in `self.lu`. Returns the first correction, relative to `size`.
    pub fn correct(&mut self, system: &mut impl System, plane: &Plane, size: f64) -> Result<f64, StepRefusal> {
        self.correct_within(NEWTON_LIMIT, system, plane, size)
    }

    /// Works like [`Solver::correct`] with another limit; beyond [`NEWTON_LIMIT`] a correction may also grow once.
    pub fn correct_within(
        &mut self,
        limit: usize,
        system: &mut impl System,
        plane: &Plane,
        size: f64,
    ) -> Result<f64, StepRefusal> {
        let n = system.dimension();
        self.z.clear();
        self.z.extend_from_slice(plane.through);
        let (mut first, mut before) = (0.0, f64::INFINITY);
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
        }
        Err(StepRefusal::Newton)
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
    pub fn tangent(&self, tangent: &mut Vec<f64>, n: usize) -> Result<(), StepRefusal> {
        tangent.clear();
        tangent.resize(n + 1, 0.0);
        // R_x dx + R_λ dλ = 0 and normal · dz = 1: the solution points along the branch, to the side of the normal.
        tangent[n] = 1.0;
        self.lu.solve(tangent);
        let length = norm(tangent);
        if !(length.is_finite() && length > 0.0) {
            return Err(StepRefusal::Singular);
        }
        tangent.iter_mut().for_each(|value| *value /= length);
        Ok(())
    }
}
