//! The continuation along a branch: predictor, corrector and choice of steps.

use alloc::vec;
use alloc::vec::Vec;

use super::newton::{NEWTON_LIMIT, Plane, Solver};
use super::{ContinuationSettings, Point, System, Work};
use crate::dense::{Determinant, dot, norm, normalise};
use crate::error::AnalysisError;
use crate::refusal::StepRefusal;

/// The largest correction, as a fraction of the step.
const CORRECTION_SHARE: f64 = 0.3;

/// A continuation along a branch.
#[derive(Clone, Debug)]
pub struct Continuation {
    settings: ContinuationSettings,
    point: Point,
    /// κ = Δt/s of the step before, in the scaling of `point`.
    curvature: Vec<f64>,
    /// X/Λ for which `point.tangent` is scaled.
    sigma: f64,
    step: f64,
    solver: Solver,
    /// Storage of a step: the prediction, and the tangent at the solution.
    through: Vec<f64>,
    tangent: Vec<f64>,
}

impl Continuation {
    /// Starts at the solution near `x` at `lambda`, towards larger λ if `direction` is positive, otherwise towards
    /// smaller.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if Newton's method finds none from there.
    pub fn start(
        system: &mut impl System,
        settings: ContinuationSettings,
        x: &[f64],
        lambda: f64,
        direction: f64,
    ) -> Result<Continuation, AnalysisError> {
        Continuation::start_within(NEWTON_LIMIT, system, settings, x, lambda, direction)
    }

    /// Works like [`Continuation::start`] with another limit of Newton's iterations, in which the corrections may also grow:
    /// for starts far from the solution, any one of which will do.
    pub(crate) fn start_within(
        limit: usize,
        system: &mut impl System,
        settings: ContinuationSettings,
        x: &[f64],
        lambda: f64,
        direction: f64,
    ) -> Result<Continuation, AnalysisError> {
        let n = system.dimension();
        let mut solver = Solver::default();
        let mut normal = vec![0.0; n + 1];
        // The first plane is that of constant λ: x is solved for at the given value.
        normal[n] = direction.signum();
        let mut through = x.to_vec();
        through.resize(n + 1, 0.0);
        // The size of x is not known before it is solved for: a second solution refines the first.
        let mut sigma = 1.0;
        for _ in 0..2 {
            let size = settings.size(&through[..n]);
            sigma = size / settings.lambda_scale(lambda);
            through[n] = sigma * lambda;
            solver
                .correct(limit, f64::INFINITY, system, &Plane { normal: &normal, through: &through, sigma }, size)
                .map_err(|refusal| AnalysisError::NoSolution { at: system.place(lambda), refusal })?;
            through[..n].copy_from_slice(&solver.z[..n]);
        }
        let mut tangent = Vec::new();
        let size = settings.size(&through[..n]);
        let plane = Plane { normal: &normal, through: &through, sigma };
        solver
            .tangent(system, &plane, size, &mut tangent)
            .map_err(|refusal| AnalysisError::NoSolution { at: system.place(lambda), refusal })?;
        let point =
            Point { x: through[..n].to_vec(), lambda, arclength: 0.0, determinant: solver.determinant(), tangent };
        // A tenth of the largest step, since the curvature of the branch is not known yet.
        Ok(Continuation::at(settings, point, sigma, 0.1 * settings.largest_step, solver))
    }

    /// Starts from a known point in a known direction: dx, and dλ as the last element.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if Newton's method does not find the branch within reach of a small step.
    pub fn start_along(
        system: &mut impl System,
        settings: ContinuationSettings,
        x: &[f64],
        lambda: f64,
        direction: &[f64],
        step: f64,
    ) -> Result<Continuation, AnalysisError> {
        let n = system.dimension();
        let size = settings.size(x);
        let sigma = size / settings.lambda_scale(lambda);
        let mut tangent = direction.to_vec();
        tangent[n] *= sigma;
        normalise(&mut tangent);
        let point = Point { x: x.to_vec(), lambda, arclength: 0.0, determinant: Determinant::default(), tangent };
        let mut continuation = Continuation::at(settings, point, sigma, step, Solver::default());
        continuation
            .attempt(system, step)
            .map_err(|refusal| AnalysisError::NoSolution { at: system.place(lambda), refusal })?;
        Ok(continuation)
    }

    fn at(settings: ContinuationSettings, point: Point, sigma: f64, step: f64, solver: Solver) -> Continuation {
        let curvature = vec![0.0; point.tangent.len()];
        Continuation { settings, point, curvature, sigma, step, solver, through: Vec::new(), tangent: Vec::new() }
    }

    /// The point that the last step has reached.
    pub fn point(&self) -> &Point {
        &self.point
    }

    /// Work done so far.
    pub fn work(&self) -> Work {
        self.solver.work
    }

    /// Takes this as the next step to try, relative to X.
    pub(crate) fn set_step(&mut self, step: f64) {
        self.step = step;
    }

    /// Advances to the next point and returns it.
    ///
    /// # Errors
    /// [`AnalysisError::Stuck`] with the place and the reason if even the smallest step is rejected.
    pub fn advance(&mut self, system: &mut impl System) -> Result<&Point, AnalysisError> {
        loop {
            let step = self.limited_step(system);
            match self.attempt(system, step) {
                Ok(()) => return Ok(&self.point),
                Err(refusal) => {
                    self.solver.work.rejections += 1;
                    self.step = 0.5 * step;
                    if self.step < self.settings.smallest_step {
                        let at = system.place(self.point.lambda);
                        let arclength = self.point.arclength;
                        return Err(AnalysisError::Stuck { at, arclength, step: self.step, refusal });
                    }
                }
            }
        }
    }

    /// Returns the wanted step, limited to the length that the system allows for λ.
    fn limited_step(&self, system: &impl System) -> f64 {
        let size = self.settings.size(&self.point.x);
        let n = self.point.x.len();
        // dλ over the relative step: the last element of the tangent is that of σλ.
        let rate = (self.point.tangent[n] / self.sigma).abs() * size;
        let limit = system.parameter_step_limit(self.point.lambda);
        if rate * self.step > limit { limit / rate } else { self.step }
    }

    /// Tries one step of the length `step` relative to X and returns whether it is accepted.
    fn attempt(&mut self, system: &mut impl System, step: f64) -> Result<(), StepRefusal> {
        let n = system.dimension();
        let size = self.settings.size(&self.point.x);
        let length = step * size;
        self.begin_at_point();
        for ((z, t), k) in self.through.iter_mut().zip(&self.point.tangent).zip(&self.curvature) {
            // Along a parabola: with the tangent here, and the curvature of the step before.
            *z += length * (t + 0.5 * length * k);
        }
        let plane = Plane { normal: &self.point.tangent, through: &self.through, sigma: self.sigma };
        // A correction that is large against the step may lead to a neighbouring branch.
        let error = self.solver.correct(NEWTON_LIMIT, CORRECTION_SHARE * step, system, &plane, size)?;
        self.solver.tangent(system, &plane, size, &mut self.tangent)?;
        // Rounding can bring the product of two unit vectors beyond 1, where the arc cosine is not a number.
        let turn = libm::acos(dot(&self.tangent, &self.point.tangent).clamp(-1.0, 1.0));
        if turn.is_nan() || turn > self.settings.largest_turn_rad {
            return Err(StepRefusal::Turn);
        }
        for ((k, new), old) in self.curvature.iter_mut().zip(&self.tangent).zip(&self.point.tangent) {
            *k = (new - old) / length;
        }
        self.take(n, step);
        self.choose_step(step, error, turn);
        Ok(())
    }

    /// Sets the prediction to the point of the continuation.
    fn begin_at_point(&mut self) {
        self.through.clear();
        self.through.extend_from_slice(&self.point.x);
        self.through.push(self.sigma * self.point.lambda);
    }

    /// Takes the solver's solution and tangent as the point of the continuation.
    fn take(&mut self, n: usize, step: f64) {
        self.solver.work.steps += 1;
        self.point.x.copy_from_slice(&self.solver.z[..n]);
        self.point.lambda = self.solver.z[n] / self.sigma;
        core::mem::swap(&mut self.point.tangent, &mut self.tangent);
        self.point.arclength += step;
        self.point.determinant = self.solver.determinant();
        self.rescale();
    }

    /// Brings the tangent and the curvature to the scales of the point.
    fn rescale(&mut self) {
        let n = self.point.x.len();
        let sigma = self.settings.size(&self.point.x) / self.settings.lambda_scale(self.point.lambda);
        let ratio = sigma / self.sigma;
        self.sigma = sigma;
        self.point.tangent[n] *= ratio;
        let length = norm(&self.point.tangent);
        self.point.tangent.iter_mut().for_each(|value| *value /= length);
        // κ = d²z/ds², and ds grows with the length of the tangent in the new scales.
        self.curvature[n] *= ratio;
        self.curvature.iter_mut().for_each(|value| *value /= length * length);
    }

    /// The error of the predictor grows with the cube of the step, the turn with the step.
    fn choose_step(&mut self, step: f64, error: f64, turn: f64) {
        let by_error = libm::cbrt(self.settings.predictor_error / error.max(1e-12));
        // Less than the largest turn: steps that aim at the limit itself would often be undone.
        let by_turn = 0.6 * self.settings.largest_turn_rad / turn.max(1e-6);
        // Both estimates hold for steps of about this length, so the length changes by a limited factor.
        self.step = (step * by_error.min(by_turn).clamp(0.3, 2.0)).min(self.settings.largest_step);
    }

    /// Solves again at this point with another number of unknowns: `x` gains zeros at the end, or loses its end. The
    /// first point of a branch keeps its λ; others move in the plane that is normal to the branch.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if Newton's method finds no solution there.
    pub fn resize(&mut self, system: &mut impl System) -> Result<(), AnalysisError> {
        let old = self.point.x.len();
        let n = system.dimension();
        let fit = |z: &mut Vec<f64>| {
            let last = z[old];
            z.truncate(n.min(old));
            z.resize(n, 0.0);
            z.push(last);
        };
        self.point.x.resize(n, 0.0);
        fit(&mut self.point.tangent);
        fit(&mut self.curvature);
        self.begin_at_point();
        let size = self.settings.size(&self.point.x);
        let lambda = self.point.lambda;
        let is_first = self.point.arclength == 0.0;
        let mut along_lambda = Vec::new();
        if is_first {
            along_lambda.resize(n, 0.0);
            along_lambda.push(self.point.tangent[n].signum());
        }
        let normal = if is_first { &along_lambda } else { &self.point.tangent };
        let plane = Plane { normal, through: &self.through, sigma: self.sigma };
        self.solver
            .correct(NEWTON_LIMIT, f64::INFINITY, system, &plane, size)
            .and_then(|_| self.solver.tangent(system, &plane, size, &mut self.tangent))
            .map_err(|refusal| AnalysisError::NoSolution { at: system.place(lambda), refusal })?;
        self.take(n, 0.0);
        // `take` has counted a step, but the point was only solved again.
        self.solver.work.steps -= 1;
        if is_first {
            // Exactly the start of the interval, without the rounding of σλ/σ.
            self.point.lambda = lambda;
        }
        Ok(())
    }
}
