//! Curves of folds and of period doublings in two coordinates.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::adapt::adapt;
use super::continuation::{Continuation, Cut, Point, Slices, System, Work, at_parameter};
use super::locate::{FINE, search};
use super::orbit::{Bifurcation, BifurcationKind, Branch, BranchOptions};
use super::{AnalysisError, Coordinate, EndedEarly, HarmonicBalance, Oscillator, SingularResponse, Singularity};

/// A singular motion on a curve of them.
#[derive(Clone, Debug, PartialEq)]
pub struct SingularPoint {
    /// The coordinate of the branch on which the bifurcation was found.
    pub lambda: f64,
    /// The coordinate that was continued in.
    pub mu: f64,
    /// √(a² + b²) of the component at Ω of α1 and α2, rad.
    pub harmonic1_rad: [f64; 2],
    /// Fourier coefficients of the motion, rad.
    pub coefficients: Vec<f64>,
}

/// Where a curve turns back in `mu`.
#[derive(Clone, Debug, PartialEq)]
pub struct Turn {
    /// Whether it is a cusp: the curve turns back in both coordinates at once, and two folds meet and vanish.
    pub is_cusp: bool,
    /// The motion there.
    pub point: SingularPoint,
    /// The number of points of the curve before it.
    pub index: usize,
}

/// A curve of singular motions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SingularCurve {
    /// Its motions in order.
    pub points: Vec<SingularPoint>,
    /// Where it turns back, in order.
    pub turns: Vec<Turn>,
    /// The work of the continuation.
    pub work: Work,
}

/// Follows a fold or a period doubling of a branch in `lambda` as `mu` goes from `options.from`, where it was found, to
/// `options.to`. The curve may turn back, sharply at a cusp; it ends where it leaves the interval.
///
/// # Errors
/// [`AnalysisError::NotSingular`] if the bifurcation is of another kind; otherwise as [`super::trace`].
pub fn trace_singular<O: Oscillator>(
    oscillator: O,
    bifurcation: &Bifurcation,
    lambda: Coordinate<O::Parameter>,
    mu: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Result<SingularCurve, EndedEarly<SingularCurve>> {
    let (mut singular, mut continuation) = begin(oscillator, bifurcation, lambda, mu, options)?;
    let mut curve = SingularCurve::default();
    let reason = follow(&mut singular, &mut continuation, options, &mut curve).err();
    curve.work = continuation.work();
    match reason {
        None => Ok(curve),
        Some(reason) => Err(EndedEarly { reason, so_far: Box::new(curve) }),
    }
}

/// dλ/ds counts as zero below this fraction of its value beside the point: a cusp is located far more exactly.
pub(super) const STANDS: f64 = 1e-4;
/// Two ends nearer than this, relative, are one point: bifurcations are located to about 1e-12.
const SAME: f64 = 1e-8;

/// Follows each fold and each period doubling of a branch in `lambda` as `mu` goes from its value there to
/// `options.to`, each curve with its kind and its end. A curve that returns through another of these bifurcations is
/// listed once for both.
pub fn trace_singular_curves<O: Oscillator + Clone>(
    oscillator: &O,
    branch: &Branch,
    lambda: Coordinate<O::Parameter>,
    mu: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Vec<(BifurcationKind, Result<SingularCurve, EndedEarly<SingularCurve>>)> {
    let mut curves: Vec<(BifurcationKind, Result<SingularCurve, EndedEarly<SingularCurve>>)> = Vec::new();
    let followed = [BifurcationKind::Fold, BifurcationKind::PeriodDoubling];
    for bifurcation in branch.bifurcations.iter().filter(|found| followed.contains(&found.kind)) {
        let from = match mu {
            Coordinate::FrequencyHz => bifurcation.orbit.frequency_hz,
            Coordinate::Parameter(which) => oscillator.parameter(which),
        };
        let ends_here = |(kind, curve): &(BifurcationKind, Result<SingularCurve, _>)| {
            let last = curve.as_ref().ok().and_then(|curve| curve.points.last());
            *kind == bifurcation.kind
                && last.is_some_and(|end| near(end.mu, from) && near(end.lambda, bifurcation.orbit.value))
        };
        if !curves.iter().any(ends_here) {
            let options = options.between(from, options.to);
            curves.push((bifurcation.kind, trace_singular(oscillator.clone(), bifurcation, lambda, mu, &options)));
        }
    }
    curves
}

/// Whether two values of a coordinate belong to the same bifurcation.
pub(super) fn near(a: f64, b: f64) -> bool {
    libm::fabs(a - b) <= SAME * libm::fabs(b)
}

impl SingularCurve {
    /// The points at the value of `mu` at which the curve begins: the first, and the last if the curve returns to it.
    pub fn on_the_branch(&self) -> impl Iterator<Item = &SingularPoint> {
        let first = self.points.first();
        let back = self.points.last().filter(|last| first.is_some_and(|first| near(last.mu, first.mu)));
        first.into_iter().chain(back)
    }
}

/// The equations, and a continuation that begins at the bifurcation.
fn begin<O: Oscillator>(
    oscillator: O,
    bifurcation: &Bifurcation,
    lambda: Coordinate<O::Parameter>,
    mu: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Result<(SingularResponse<O>, Continuation), AnalysisError> {
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
        let unit = balance.unit(mu);
        return Err(AnalysisError::Interval { from, to, unit, domain: "the range of the second coordinate" });
    }
    let x = &orbit.coefficients;
    let scale = options.continuation.lambda_scale(orbit.value) / options.continuation.size(x);
    let mut singular = SingularResponse::near(balance, kind, lambda, Some(mu), scale, x)?;
    let start = singular.join(orbit.value, x);
    let continuation = Continuation::start(&mut singular, options.continuation, &start, from, to - from)?;
    Ok((singular, continuation))
}

/// Continues to the end of the interval.
fn follow<O: Oscillator>(
    singular: &mut SingularResponse<O>,
    continuation: &mut Continuation,
    options: &BranchOptions,
    curve: &mut SingularCurve,
) -> Result<(), AnalysisError> {
    loop {
        adapt(singular, continuation, options)?;
        curve.points.push(singular_point(singular, continuation.point()));
        let (before, points) = (continuation.point().clone(), curve.points.len());
        if points >= options.most_points {
            return Err(AnalysisError::TooManyPoints { points, at: singular.place(before.lambda) });
        }
        let after = continuation.advance(singular)?;
        if along_mu(&before) * along_mu(after) < 0.0 {
            let (is_cusp, point) = turn(singular, options, [&before, after])?;
            curve.turns.push(Turn { is_cusp, point, index: points });
        }
        if let Some(limit) = options.left_at(after.lambda) {
            let last = at_parameter(singular, &options.continuation, [&before, after], limit)?;
            curve.points.push(singular_point(singular, &last));
            return Ok(());
        }
    }
}

/// dμ/ds.
fn along_mu(point: &Point) -> f64 {
    point.tangent[point.tangent.len() - 1]
}

/// The point between two of the curve at which it turns back in μ, dμ/ds = 0, and whether that is a cusp.
///
/// With the extended system's unknowns (λ, X) and μ the curve is smooth through a cusp, where its tangent is (0, v, 0),
/// v being the null vector: dλ/ds = 0, too. Along R = 0 and g = 0 the tangent is a function of the arclength s whose
/// part by μ passes zero with a slope, so its zero is found as exactly as rounding lets it, and λ and μ, which are even
/// in the distance from it to first order, more exactly still.
fn turn<O: Oscillator>(
    singular: &mut SingularResponse<O>,
    options: &BranchOptions,
    ends: [&Point; 2],
) -> Result<(bool, SingularPoint), AnalysisError> {
    let n = singular.dimension();
    let mut slices = Slices::new(n, &options.continuation, ends, Cut::Chord);
    let solved = [slices.solve(singular, ends, 0.0)?, slices.solve(singular, ends, 1.0)?];
    let values = [along_mu(&solved[0]), along_mu(&solved[1])];
    let ends = [&solved[0], &solved[1]];
    let point = search(singular, &options.continuation, ends, values, FINE, |_, point| along_mu(point))?;
    let by_lambda = libm::fabs(point.tangent[0]);
    let beside = libm::fabs(solved[0].tangent[0]).max(libm::fabs(solved[1].tangent[0]));
    Ok((by_lambda < STANDS * beside, singular_point(singular, &point)))
}

fn singular_point<O: Oscillator>(singular: &SingularResponse<O>, point: &Point) -> SingularPoint {
    let (lambda, x) = singular.split(&point.x);
    let harmonic1_rad = [0, 1].map(|dof| libm::sqrt(x[2 + dof] * x[2 + dof] + x[4 + dof] * x[4 + dof]));
    SingularPoint { lambda, mu: point.lambda, harmonic1_rad, coefficients: x.to_vec() }
}
