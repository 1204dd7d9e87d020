//! Curves of folds and of period doublings in two coordinates.

use alloc::vec::Vec;

use super::adapt::adapt;
use super::continuation::{Point, Walk, at_parameter};
use super::orbit::{Bifurcation, BifurcationKind, BranchOptions};
use super::{AnalysisError, Coordinate, HarmonicBalance, Oscillator, SingularResponse, Singularity};

/// A singular motion on a curve of them.
#[derive(Clone, Debug, PartialEq)]
pub struct SingularPoint {
    /// The coordinate of the branch that the bifurcation was found on.
    pub lambda: f64,
    /// The coordinate that was continued in.
    pub mu: f64,
    /// √(a² + b²) of the component at Ω of α1 and α2, rad.
    pub harmonic1_rad: [f64; 2],
    /// Fourier coefficients of the motion, rad.
    pub coefficients: Vec<f64>,
}

/// Follows a fold or a period doubling of a branch in `lambda` as `mu` goes from `options.from`, where it was found, to
/// `options.to`. The curve may turn back (at a cusp it does so sharply); it ends where it leaves the interval.
///
/// # Errors
/// [`AnalysisError::NotSingular`] if the bifurcation is of another kind; else as [`super::trace`].
pub fn trace_singular<O: Oscillator>(
    oscillator: O,
    bifurcation: &Bifurcation,
    lambda: Coordinate<O::Parameter>,
    mu: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Result<Vec<SingularPoint>, AnalysisError> {
    let kind = match bifurcation.kind {
        BifurcationKind::Fold => Singularity::Fold,
        BifurcationKind::PeriodDoubling => Singularity::PeriodDoubling,
        other => return Err(AnalysisError::NotSingular { kind: other.name() }),
    };
    let orbit = &bifurcation.orbit;
    let mut balance = HarmonicBalance::new(oscillator, orbit.frequency_hz, 1, orbit.harmonics());
    let (from, to) = (options.from, options.to);
    let exists = from.is_finite() && to.is_finite() && from != to && balance.set_coordinate(mu, to);
    if !(exists && balance.set_coordinate(mu, from) && balance.set_coordinate(lambda, orbit.value)) {
        return Err(AnalysisError::Interval { from, to, domain: "the range of the second coordinate" });
    }
    let x = &orbit.coefficients;
    let scale = options.walk.lambda_scale(orbit.value) / options.walk.size(x);
    let mut singular = SingularResponse::near(balance, kind, lambda, Some(mu), scale, x)?;
    let start = singular.join(orbit.value, x);
    let mut walk = Walk::start(&mut singular, options.walk, &start, from, to - from)?;
    let mut points = Vec::new();
    loop {
        adapt(&mut singular, &mut walk, options)?;
        points.push(singular_point(&singular, walk.point()));
        let before = walk.point().clone();
        if points.len() >= options.most_points {
            return Err(AnalysisError::TooManyPoints { points: points.len(), lambda: before.lambda });
        }
        let after = walk.advance(&mut singular)?;
        if let Some(limit) = options.left_at(after.lambda) {
            let last = at_parameter(&mut singular, &options.walk, [&before, after], limit)?;
            points.push(singular_point(&singular, &last));
            return Ok(points);
        }
    }
}

fn singular_point<O: Oscillator>(singular: &SingularResponse<O>, point: &Point) -> SingularPoint {
    let (lambda, x) = singular.split(&point.x);
    let harmonic1_rad = [0, 1].map(|dof| libm::sqrt(x[2 + dof] * x[2 + dof] + x[4 + dof] * x[4 + dof]));
    SingularPoint { lambda, mu: point.lambda, harmonic1_rad, coefficients: x.to_vec() }
}
