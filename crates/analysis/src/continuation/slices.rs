//! Points of a branch between two that are known.

use alloc::vec;
use alloc::vec::Vec;

use super::newton::{PATIENT_LIMIT, Plane, Solver};
use super::{ContinuationSettings, Point, System};
use crate::dense::{dot, norm, normalise};
use crate::error::AnalysisError;

/// The surfaces that cut a branch between two of its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cut {
    /// Planes that are perpendicular to the chord of the points.
    Chord,
    /// Planes of constant λ.
    Parameter,
}

/// Planes between two points of a branch, to solve for points in between.
#[derive(Clone, Debug)]
pub(crate) struct Slices {
    sigma: f64,
    size: f64,
    normal: Vec<f64>,
    n: usize,
    solver: Solver,
}

impl Slices {
    /// Planes between `a` and `b` for a system of n unknowns.
    pub fn new(n: usize, settings: &ContinuationSettings, [a, b]: [&Point; 2], cut: Cut) -> Slices {
        let size = settings.size(&a.x).max(settings.size(&b.x));
        let sigma = size / settings.lambda_scale(a.lambda);
        let mut slices = Slices { sigma, size, normal: vec![], n, solver: Solver::default() };
        slices.normal = slices.z(a).iter().zip(&slices.z(b)).map(|(a, b)| b - a).collect();
        if cut == Cut::Parameter {
            // With λ alone left in the normal the planes are those of constant λ.
            slices.normal[..n].fill(0.0);
        }
        normalise(&mut slices.normal);
        slices
    }

    fn z(&self, point: &Point) -> Vec<f64> {
        let mut z = point.x.clone();
        z.resize(self.n, 0.0);
        z.push(self.sigma * point.lambda);
        z
    }

    /// Returns the point a + fraction · (b − a), with the tangent of a.
    pub fn mix(&self, [a, b]: [&Point; 2], fraction: f64) -> Point {
        let between = |a: f64, b: f64| a + fraction * (b - a);
        Point {
            x: self.z(a)[..self.n].iter().zip(&self.z(b)).map(|(a, b)| between(*a, *b)).collect(),
            lambda: between(a.lambda, b.lambda),
            arclength: between(a.arclength, b.arclength),
            ..a.clone()
        }
    }

    /// Says whether a point lies in a plane between those of a and b.
    pub fn hold(&self, ends: [&Point; 2], point: &Point) -> bool {
        (0.0..=1.0).contains(&self.fraction(ends, point))
    }

    /// Returns the fraction of the way from a to b at which the plane through a point lies.
    pub fn fraction(&self, [a, b]: [&Point; 2], point: &Point) -> f64 {
        let [low, high, at] = [a, b, point].map(|point| dot(&self.normal, &self.z(point)));
        (at - low) / (high - low)
    }

    /// Returns the distance of two points, relative to X.
    pub fn distance(&self, a: &Point, b: &Point) -> f64 {
        let apart: Vec<f64> = self.z(a).iter().zip(&self.z(b)).map(|(a, b)| a - b).collect();
        norm(&apart) / self.size
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
        let n = self.n;
        let sigma = self.sigma;
        let through: Vec<f64> = self.z(a).iter().zip(&self.z(b)).map(|(a, b)| a + fraction * (b - a)).collect();
        let plane = Plane { normal: &self.normal, through: &through, sigma };
        let mut tangent = Vec::new();
        self.solver
            .correct(PATIENT_LIMIT, f64::INFINITY, system, &plane, self.size)
            .and_then(|_| self.solver.tangent(system, &plane, self.size, &mut tangent))
            .map_err(|refusal| AnalysisError::NoSolution { at: system.place(through[n] / sigma), refusal })?;
        Ok(Point {
            x: self.solver.z[..n].to_vec(),
            lambda: self.solver.z[n] / sigma,
            arclength: a.arclength + fraction * (b.arclength - a.arclength),
            tangent,
            determinant: self.solver.determinant(),
        })
    }

    /// Works like [`Slices::solve`]; if the plane passes so near a crossing of branches that rounding keeps Newton's
    /// method from converging, returns the point in the plane halfway from there to the farther of a and b. For
    /// searches for a crossing, which can continue from any point between.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if Newton's method finds neither.
    pub fn solve_beside(
        &mut self,
        system: &mut impl System,
        ends: [&Point; 2],
        fraction: f64,
    ) -> Result<Point, AnalysisError> {
        let farther = if fraction < 0.5 { 1.0 } else { 0.0 };
        self.solve(system, ends, fraction).or_else(|_| self.solve(system, ends, 0.5 * (fraction + farther)))
    }
}

/// The point of the branch between `a` and `b` at a value of λ.
///
/// # Errors
/// [`AnalysisError::NoSolution`] if Newton's method does not find it.
pub(crate) fn at_parameter(
    system: &mut impl System,
    settings: &ContinuationSettings,
    ends: [&Point; 2],
    lambda: f64,
) -> Result<Point, AnalysisError> {
    let fraction = (lambda - ends[0].lambda) / (ends[1].lambda - ends[0].lambda);
    let mut slices = Slices::new(system.dimension(), settings, ends, Cut::Parameter);
    Ok(Point { lambda, ..slices.solve(system, ends, fraction)? })
}

#[cfg(test)]
mod tests {
    use super::super::Continuation;
    use super::*;

    /// x (x − λ) = 0: the branches x = 0 and x = λ cross at λ = 0.
    struct Crossing;

    impl System for Crossing {
        fn dimension(&self) -> usize {
            1
        }

        fn evaluate(&mut self, x: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
            residual[0] = x[0] * (x[0] - lambda);
            matrix[0] = 2.0 * x[0] - lambda;
            matrix[2] = -x[0];
            true
        }
    }

    #[test]
    fn a_plane_through_a_crossing_of_branches_has_one_beside_it() {
        let settings = ContinuationSettings::default();
        let [a, b] = [-1.0, 3.0]
            .map(|lambda| Continuation::start(&mut Crossing, settings, &[0.0], lambda, 1.0).unwrap().point().clone());
        let a = Point { arclength: 0.0, ..a };
        let b = Point { arclength: 4.0, ..b };
        let mut slices = Slices::new(1, &settings, [&a, &b], Cut::Parameter);
        let at = |slices: &mut Slices, fraction| slices.solve_beside(&mut Crossing, [&a, &b], fraction).unwrap();
        assert!(slices.solve(&mut Crossing, [&a, &b], 0.25).is_err());
        let beside = at(&mut slices, 0.25);
        assert!((beside.lambda - 1.5).abs() < 1e-12 && (beside.arclength - 2.5).abs() < 1e-12, "{beside:?}");
        assert!((at(&mut slices, 0.75).lambda - 2.0).abs() < 1e-12);
    }
}
