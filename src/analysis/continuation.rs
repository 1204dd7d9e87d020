//! Pseudo-arclength continuation (Keller 1977; Seydel, "Practical Bifurcation and Stability Analysis", Ch. 4).
//!
//! It sees n equations R(x, λ) = 0 and nothing of what they mean. With z = (x, λ) and the unit tangent t, a step predicts
//! z⁰ = z + s t + ½ s² κ, κ being the change of the tangent per arclength in the step before, and solves
//!
//! ```text
//! ⎡ R_x  R_λ ⎤ ⎡δx⎤     ⎡   R(z)   ⎤
//! ⎢          ⎥ ⎢  ⎥ = − ⎢          ⎥      by Newton's method, and with (0, 1) on the right at the solution, the next t.
//! ⎣ t_xᵀ t_λ ⎦ ⎣δλ⎦     ⎣ t·(z−z⁰) ⎦
//! ```
//!
//! Scales. The response of a lightly damped arm is a circle in the plane of its Fourier coefficients, up to thousands of times
//! larger than what surrounds it, and passed within a thousandth of λ. Seen from the size of x itself all of it is smooth.
//! So lengths are measured relative to X = max(|x|, x₀), afresh at each step, and λ in units of Λ: the last unknown is
//! λ X/Λ, and a step is at most a fraction of X. A resonance ahead shows in x as 1/(distance) and is approached geometrically.
//!
//! Against jumps and reversals a step is taken back and halved if Newton needs more than its share, if the correction is more
//! than a fraction of the step, or if the tangent turns by more than an angle: another branch at that distance would have to be
//! parallel, and a reversal would turn the tangent by 180°.

use alloc::vec;
use alloc::vec::Vec;

use super::AnalysisError;
use super::dense::{Determinant, Lu, dot, norm};

/// n equations in n unknowns x and a parameter λ.
pub trait System {
    /// n.
    fn dimension(&self) -> usize;

    /// Writes R(x, λ) into `residual` (n) and its derivatives by x and then λ into `matrix`: n + 1 columns of n + 1 elements,
    /// of which the last is left alone. Says whether the system exists at λ.
    #[must_use]
    fn evaluate(&mut self, x: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool;

    /// The largest change of λ from here that is sure not to step over something, in the unit of λ.
    fn parameter_step_limit(&self, _lambda: f64) -> f64 {
        f64::INFINITY
    }
}

/// How to walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Λ as a fraction of λ, and at least `parameter_floor`.
    pub parameter_fraction: f64,
    /// The least Λ, in the unit of λ, positive.
    pub parameter_floor: f64,
    /// x₀: below this norm x counts as this large, positive.
    pub state_floor: f64,
    /// The largest step, relative to X.
    pub largest_step: f64,
    /// The smallest step before giving up, relative to X.
    pub smallest_step: f64,
    /// The largest angle between the tangents at the ends of a step, rad.
    pub largest_turn_rad: f64,
    /// The predictor's error that steps are chosen for, relative to X.
    pub predictor_error: f64,
}

/// The most Newton iterations in a step.
const NEWTON_LIMIT: usize = 6;
/// The most where the matrix may be nearly singular, as it is by a branch point: Newton's method then only halves the error.
const PATIENT_LIMIT: usize = 40;
/// The error, relative to X, at which Newton's method ends. The corrections go as δₖ₊₁ = C δₖ², so after two of them the next is
/// known as δₖ³/δₖ₋₁² and need not be made if it is below this; a first one must be below it itself.
const NEWTON_ERROR: f64 = 1e-11;
/// Only corrections below this are taken to be in the range of quadratic convergence.
const NEWTON_RANGE: f64 = 1e-3;
/// The largest correction, as a fraction of the step.
const CORRECTION_SHARE: f64 = 0.3;

impl Default for Settings {
    fn default() -> Settings {
        Settings {
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
    /// x.
    pub x: Vec<f64>,
    /// λ.
    pub lambda: f64,
    /// The arclength from the start, in units of the local X.
    pub arclength: f64,
    /// The direction of the branch: dx and, last, dλ·X/Λ, of unit length.
    pub tangent: Vec<f64>,
    /// The bordered determinant: it changes sign at a branch point, and not at a fold.
    pub determinant: Determinant,
}

/// What the walk has cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Evaluations of R and its derivatives.
    pub evaluations: usize,
    /// Factorizations of bordered matrices.
    pub factorizations: usize,
    /// Steps taken.
    pub steps: usize,
    /// Steps taken back.
    pub rejections: usize,
}

/// Why a step was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Newton's method did not converge.
    Newton,
    /// The correction was too large a part of the step.
    Correction,
    /// The tangent turned too far.
    Turn,
    /// A matrix had no inverse, or something was not a number.
    Singular,
    /// The system does not exist there.
    OutOfRange,
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Refusal::Newton => "Newton's method did not converge",
            Refusal::Correction => "the solution found was too far from the prediction",
            Refusal::Turn => "the branch turned too sharply",
            Refusal::Singular => "the equations were singular or not finite",
            Refusal::OutOfRange => "no such system exists there",
        })
    }
}

/// A walk along a branch.
#[derive(Clone, Debug)]
pub struct Walk {
    settings: Settings,
    point: Point,
    /// κ = Δt/s of the step before, in the scaling of `point`.
    curvature: Vec<f64>,
    /// X/Λ for which `point.tangent` is scaled.
    sigma: f64,
    step: f64,
    solver: Solver,
}

/// The storage of Newton's method, and its account.
#[derive(Clone, Debug, Default)]
struct Solver {
    lu: Lu,
    right: Vec<f64>,
    z: Vec<f64>,
    work: Work,
}

/// A plane that z is sought in: normal·(z − through) = 0, the last component of z being σλ.
struct Plane<'a> {
    normal: &'a [f64],
    through: &'a [f64],
    sigma: f64,
}

impl Solver {
    /// Newton's method from `plane.through` to the branch; the result is left in `self.z`, and the factors of the bordered
    /// matrix near it in `self.lu`. Returns the first correction, relative to `size`.
    fn correct(&mut self, system: &mut impl System, plane: &Plane, size: f64) -> Result<f64, Refusal> {
        self.correct_within(NEWTON_LIMIT, system, plane, size)
    }

    /// The same with another limit; beyond [`NEWTON_LIMIT`] a correction may also grow for once.
    fn correct_within(
        &mut self,
        limit: usize,
        system: &mut impl System,
        plane: &Plane,
        size: f64,
    ) -> Result<f64, Refusal> {
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
                return Err(Refusal::Singular);
            }
            if iteration == 0 {
                first = correction;
            }
            let next =
                if before.is_finite() { correction * correction * correction / (before * before) } else { correction };
            if correction < NEWTON_ERROR || (correction < NEWTON_RANGE && next < NEWTON_ERROR) {
                return Ok(first);
            }
            if correction > before && limit == NEWTON_LIMIT {
                break;
            }
            before = correction;
        }
        Err(Refusal::Newton)
    }

    /// R into `right` and the factors of the bordered matrix into `lu`, at `z`.
    fn linearise(&mut self, system: &mut impl System, plane: &Plane) -> Result<(), Refusal> {
        let n = system.dimension();
        let matrix = self.lu.zeroed(n + 1);
        self.right.clear();
        self.right.resize(n + 1, 0.0);
        self.work.evaluations += 1;
        if !system.evaluate(&self.z[..n], self.z[n] / plane.sigma, &mut self.right[..n], matrix) {
            return Err(Refusal::OutOfRange);
        }
        matrix[n * (n + 1)..].iter_mut().for_each(|by_lambda| *by_lambda /= plane.sigma);
        for (column, normal) in matrix.chunks_exact_mut(n + 1).zip(plane.normal) {
            column[n] = *normal;
        }
        self.work.factorizations += 1;
        self.lu.factor().map_err(|_| Refusal::Singular)
    }

    /// The unit vector along the branch, from the factors of the last iteration; `tangent` receives it.
    fn tangent(&self, tangent: &mut Vec<f64>, n: usize) -> Result<(), Refusal> {
        tangent.clear();
        tangent.resize(n + 1, 0.0);
        tangent[n] = 1.0;
        self.lu.solve(tangent);
        let length = norm(tangent);
        if !(length.is_finite() && length > 0.0) {
            return Err(Refusal::Singular);
        }
        tangent.iter_mut().for_each(|value| *value /= length);
        Ok(())
    }
}

impl Settings {
    /// Λ.
    pub(super) fn lambda_scale(&self, lambda: f64) -> f64 {
        (self.parameter_fraction * lambda.abs()).max(self.parameter_floor)
    }

    /// X.
    pub(super) fn size(&self, x: &[f64]) -> f64 {
        norm(x).max(self.state_floor)
    }
}

impl Walk {
    /// Starts at the solution near `x` at `lambda`, towards larger λ if `direction` is positive, else towards smaller.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if Newton's method finds none from there.
    pub fn start(
        system: &mut impl System,
        settings: Settings,
        x: &[f64],
        lambda: f64,
        direction: f64,
    ) -> Result<Walk, AnalysisError> {
        let n = system.dimension();
        let mut solver = Solver::default();
        let mut normal = vec![0.0; n + 1];
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
                .correct(system, &Plane { normal: &normal, through: &through, sigma }, size)
                .map_err(|refusal| AnalysisError::NoSolution { lambda, refusal })?;
            through[..n].copy_from_slice(&solver.z[..n]);
        }
        let mut tangent = Vec::new();
        solver.tangent(&mut tangent, n).map_err(|refusal| AnalysisError::NoSolution { lambda, refusal })?;
        let point =
            Point { x: through[..n].to_vec(), lambda, arclength: 0.0, determinant: solver.lu.determinant(), tangent };
        let step = 0.1 * settings.largest_step;
        Ok(Walk { settings, point, curvature: vec![0.0; n + 1], sigma, step, solver })
    }

    /// Starts from a point and a direction that are known: dx, and dλ as last element.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if Newton's method does not find the branch within reach of a small step.
    pub fn start_along(
        system: &mut impl System,
        settings: Settings,
        x: &[f64],
        lambda: f64,
        direction: &[f64],
        step: f64,
    ) -> Result<Walk, AnalysisError> {
        let n = system.dimension();
        let size = settings.size(x);
        let sigma = size / settings.lambda_scale(lambda);
        let mut tangent = direction.to_vec();
        tangent[n] *= sigma;
        let length = norm(&tangent);
        tangent.iter_mut().for_each(|value| *value /= length);
        let point = Point { x: x.to_vec(), lambda, arclength: 0.0, determinant: Determinant::default(), tangent };
        let solver = Solver::default();
        let mut walk = Walk { settings, point, curvature: vec![0.0; n + 1], sigma, step, solver };
        walk.attempt(system, step).map_err(|refusal| AnalysisError::NoSolution { lambda, refusal })?;
        Ok(walk)
    }

    /// Where the walk is.
    pub fn point(&self) -> &Point {
        &self.point
    }

    /// What it has cost.
    pub fn work(&self) -> Work {
        self.solver.work
    }

    /// The next point.
    ///
    /// # Errors
    /// [`AnalysisError::Stuck`] with the place and the reason if even the smallest step is refused.
    pub fn advance(&mut self, system: &mut impl System) -> Result<&Point, AnalysisError> {
        loop {
            let step = self.limited_step(system);
            match self.attempt(system, step) {
                Ok(()) => return Ok(&self.point),
                Err(refusal) => {
                    self.solver.work.rejections += 1;
                    self.step = 0.5 * step;
                    if self.step < self.settings.smallest_step {
                        let (lambda, arclength) = (self.point.lambda, self.point.arclength);
                        return Err(AnalysisError::Stuck { lambda, arclength, step: self.step, refusal });
                    }
                }
            }
        }
    }

    /// The step wanted, no longer than what the system says about λ.
    fn limited_step(&self, system: &impl System) -> f64 {
        let size = self.settings.size(&self.point.x);
        let n = self.point.x.len();
        let rate = (self.point.tangent[n] / self.sigma).abs() * size;
        let limit = system.parameter_step_limit(self.point.lambda);
        if rate * self.step > limit { limit / rate } else { self.step }
    }

    /// One step of the length `step` relative to X, if it is good.
    fn attempt(&mut self, system: &mut impl System, step: f64) -> Result<(), Refusal> {
        let n = system.dimension();
        let size = self.settings.size(&self.point.x);
        let length = step * size;
        let mut through = self.point.x.clone();
        through.push(self.sigma * self.point.lambda);
        for ((z, t), k) in through.iter_mut().zip(&self.point.tangent).zip(&self.curvature) {
            *z += length * (t + 0.5 * length * k);
        }
        let plane = Plane { normal: &self.point.tangent, through: &through, sigma: self.sigma };
        let error = self.solver.correct(system, &plane, size)?;
        if error > CORRECTION_SHARE * step {
            return Err(Refusal::Correction);
        }
        let mut tangent = Vec::new();
        self.solver.tangent(&mut tangent, n)?;
        let turn = libm::acos(dot(&tangent, &self.point.tangent).clamp(-1.0, 1.0));
        if !(turn <= self.settings.largest_turn_rad) {
            return Err(Refusal::Turn);
        }
        for ((k, new), old) in self.curvature.iter_mut().zip(&tangent).zip(&self.point.tangent) {
            *k = (new - old) / length;
        }
        self.take(n, tangent, step);
        self.choose_step(step, error, turn);
        Ok(())
    }

    /// Makes the solution in the solver the point of the walk.
    fn take(&mut self, n: usize, tangent: Vec<f64>, step: f64) {
        self.solver.work.steps += 1;
        self.point.x.copy_from_slice(&self.solver.z[..n]);
        self.point.lambda = self.solver.z[n] / self.sigma;
        self.point.tangent = tangent;
        self.point.arclength += step;
        self.point.determinant = self.solver.lu.determinant();
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
        let by_turn = 0.6 * self.settings.largest_turn_rad / turn.max(1e-6);
        self.step = (step * by_error.min(by_turn).clamp(0.3, 2.0)).min(self.settings.largest_step);
    }

    /// Solves again at this point with another number of unknowns: `x` gains zeros at the end, or loses its end.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if Newton's method finds no solution there.
    pub fn resize(&mut self, system: &mut impl System) -> Result<(), AnalysisError> {
        let (old, n) = (self.point.x.len(), system.dimension());
        let fit = |z: &mut Vec<f64>| {
            let last = z[old];
            z.truncate(n.min(old));
            z.resize(n, 0.0);
            z.push(last);
        };
        self.point.x.resize(n, 0.0);
        fit(&mut self.point.tangent);
        fit(&mut self.curvature);
        let mut through = self.point.x.clone();
        through.push(self.sigma * self.point.lambda);
        let size = self.settings.size(&self.point.x);
        let lambda = self.point.lambda;
        let plane = Plane { normal: &self.point.tangent, through: &through, sigma: self.sigma };
        let mut tangent = Vec::new();
        self.solver
            .correct(system, &plane, size)
            .and_then(|_| self.solver.tangent(&mut tangent, n))
            .map_err(|refusal| AnalysisError::NoSolution { lambda, refusal })?;
        self.take(n, tangent, 0.0);
        self.solver.work.steps -= 1;
        Ok(())
    }
}

/// Where a branch is cut between two of its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// By planes that are perpendicular to their chord.
    Chord,
    /// At values of λ.
    Parameter,
}

/// Planes between two points of a branch, to solve for points in between.
#[derive(Clone, Debug)]
pub(super) struct Slices {
    sigma: f64,
    size: f64,
    normal: Vec<f64>,
    n: usize,
    solver: Solver,
}

impl Slices {
    /// Planes between `a` and `b` for a system of n unknowns.
    pub fn new(n: usize, settings: &Settings, [a, b]: [&Point; 2], cut: Cut) -> Slices {
        let size = settings.size(&a.x).max(settings.size(&b.x));
        let sigma = size / settings.lambda_scale(a.lambda);
        let mut slices = Slices { sigma, size, normal: vec![], n, solver: Solver::default() };
        slices.normal = slices.z(a).iter().zip(&slices.z(b)).map(|(a, b)| b - a).collect();
        if cut == Cut::Parameter {
            slices.normal[..n].fill(0.0);
        }
        let length = norm(&slices.normal);
        slices.normal.iter_mut().for_each(|value| *value /= length);
        slices
    }

    fn z(&self, point: &Point) -> Vec<f64> {
        let mut z = point.x.clone();
        z.resize(self.n, 0.0);
        z.push(self.sigma * point.lambda);
        z
    }

    /// The point a + fraction · (b − a), with the tangent of a.
    pub fn mix(&self, [a, b]: [&Point; 2], fraction: f64) -> Point {
        let between = |a: f64, b: f64| a + fraction * (b - a);
        Point {
            x: self.z(a)[..self.n].iter().zip(&self.z(b)).map(|(a, b)| between(*a, *b)).collect(),
            lambda: between(a.lambda, b.lambda),
            arclength: between(a.arclength, b.arclength),
            ..a.clone()
        }
    }

    /// The point of the branch in the plane through a + fraction · (b − a), starting from there.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if Newton's method does not find it.
    pub fn solve(
        &mut self,
        system: &mut impl System,
        [a, b]: [&Point; 2],
        fraction: f64,
    ) -> Result<Point, AnalysisError> {
        let (n, sigma) = (self.n, self.sigma);
        let through: Vec<f64> = self.z(a).iter().zip(&self.z(b)).map(|(a, b)| a + fraction * (b - a)).collect();
        let plane = Plane { normal: &self.normal, through: &through, sigma };
        let mut tangent = Vec::new();
        self.solver
            .correct_within(PATIENT_LIMIT, system, &plane, self.size)
            .and_then(|_| self.solver.tangent(&mut tangent, n))
            .map_err(|refusal| AnalysisError::NoSolution { lambda: through[n] / sigma, refusal })?;
        Ok(Point {
            x: self.solver.z[..n].to_vec(),
            lambda: self.solver.z[n] / sigma,
            arclength: a.arclength + fraction * (b.arclength - a.arclength),
            tangent,
            determinant: self.solver.lu.determinant(),
        })
    }
}

/// The point of the branch between `a` and `b` at a value of λ.
///
/// # Errors
/// [`AnalysisError::NoSolution`] if Newton's method does not find it.
pub(super) fn at_parameter(
    system: &mut impl System,
    settings: &Settings,
    ends: [&Point; 2],
    lambda: f64,
) -> Result<Point, AnalysisError> {
    let fraction = (lambda - ends[0].lambda) / (ends[1].lambda - ends[0].lambda);
    let mut slices = Slices::new(system.dimension(), settings, ends, Cut::Parameter);
    Ok(Point { lambda, ..slices.solve(system, ends, fraction)? })
}
