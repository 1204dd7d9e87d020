//! Curves of folds and of period doublings of a structure's periodic responses in two coordinates.

use alloc::vec::Vec;

use super::adapt::{Spectral, adapt};
use super::balance::Balance;
use super::branch::orbit_of;
use super::orbit::{Bifurcation, Branch, Orbit};
use super::singular::{Singular, Singularity};
use super::trace_options::TraceOptions;
use crate::branch_options::{BifurcationKind, BranchOptions};
use crate::continuation::{Continuation, Cut, Point, Slices, System, Work, at_parameter};
use crate::error::{AnalysisError, EndedEarly};
use crate::forced::{Coordinate, Forced};
use crate::search::{FINE, search};

/// A periodic response at a bifurcation, on a curve of such bifurcations.
#[derive(Clone, Debug, PartialEq)]
pub struct SingularPoint {
    /// The coordinate of the branch on which the bifurcation was found.
    pub lambda: f64,
    /// The coordinate that was continued in.
    pub mu: f64,
    /// The periodic response, at `lambda`, without its stability.
    pub orbit: Orbit,
}

/// A point at which a curve turns back in `mu`.
#[derive(Clone, Debug, PartialEq)]
pub struct Turn {
    /// Whether it is a cusp: the curve turns back in both coordinates at once, and two folds meet and vanish.
    pub is_cusp: bool,
    /// The point of the curve at which it turns.
    pub point: SingularPoint,
    /// The number of points of the curve before it.
    pub index: usize,
}

/// A curve of folds or of period doublings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SingularCurve {
    /// Its points in order.
    pub points: Vec<SingularPoint>,
    /// The points at which the curve turns back, in order.
    pub turns: Vec<Turn>,
    /// The work of the continuation.
    pub work: Work,
}

/// A curve with the kind of its bifurcations, whole or up to where it ended early.
pub type TracedCurve = (BifurcationKind, Result<SingularCurve, EndedEarly<SingularCurve>>);

impl SingularCurve {
    /// Returns the points at the value of `mu` at which the curve begins: the first, and the last if the curve returns
    /// to it.
    pub fn on_the_branch(&self) -> impl Iterator<Item = &SingularPoint> {
        let first = self.points.first();
        let back = self.points.last().filter(|last| first.is_some_and(|first| near(last.mu, first.mu)));
        first.into_iter().chain(back)
    }
}

/// Follows a fold or a period doubling of a branch in `lambda` as `mu` goes from its value there to
/// `options.branch.to`. The curve may turn back, sharply at a cusp; it ends where it leaves the interval.
///
/// # Errors
/// [`AnalysisError::NotSingular`] if the bifurcation is of another kind; otherwise as [`super::trace`].
pub fn trace_singular(
    forced: &Forced,
    bifurcation: &Bifurcation,
    [lambda, mu]: [Coordinate; 2],
    options: &TraceOptions,
) -> Result<SingularCurve, EndedEarly<SingularCurve>> {
    let (mut singular, mut continuation, options) = begin(forced, bifurcation, [lambda, mu], options)?;
    let mut curve = SingularCurve::default();
    let end = follow(&mut singular, &mut continuation, &options, &mut curve);
    curve.work = continuation.work();
    EndedEarly::at_end(end, curve)
}

/// Follows each fold and each period doubling of a branch in `lambda` as `mu` goes from its value there to
/// `options.branch.to`, each curve with its kind and its end. A curve that returns through another of these
/// bifurcations is listed once for both.
pub fn trace_singular_curves(
    forced: &Forced,
    branch: &Branch,
    coordinates: [Coordinate; 2],
    options: &TraceOptions,
) -> Vec<TracedCurve> {
    let mut curves: Vec<TracedCurve> = Vec::new();
    let followed = [BifurcationKind::Fold, BifurcationKind::PeriodDoubling];
    for bifurcation in branch.bifurcations.iter().filter(|found| followed.contains(&found.kind)) {
        let from = Balance::at_orbit(forced, coordinates[0], &bifurcation.orbit)
            .map_or(f64::NAN, |at| at.value(coordinates[1]));
        let ends_here = |(kind, curve): &TracedCurve| {
            let last = curve.as_ref().ok().and_then(|curve| curve.points.last());
            *kind == bifurcation.kind
                && last.is_some_and(|end| near(end.mu, from) && near(end.lambda, bifurcation.orbit.value))
        };
        if !curves.iter().any(ends_here) {
            curves.push((bifurcation.kind, trace_singular(forced, bifurcation, coordinates, options)));
        }
    }
    curves
}

/// Returns the equations, and a continuation that begins at the bifurcation, with options for the interval from there.
fn begin(
    forced: &Forced,
    bifurcation: &Bifurcation,
    [lambda, mu]: [Coordinate; 2],
    options: &TraceOptions,
) -> Result<(Singular, Continuation, TraceOptions), AnalysisError> {
    let kind = match bifurcation.kind {
        BifurcationKind::Fold => Singularity::Fold,
        BifurcationKind::PeriodDoubling => Singularity::PeriodDoubling,
        other => return Err(AnalysisError::NotSingular { kind: other.name() }),
    };
    let x = &bifurcation.orbit.coefficients;
    let to = options.branch.to;
    let domain = "the range of the second coordinate";
    let refused = |from: f64, unit: &'static str| AnalysisError::Interval { from, to, unit, domain };
    let mut balance = Balance::at_orbit(forced, lambda, &bifurcation.orbit).ok_or_else(|| refused(f64::NAN, ""))?;
    let from = balance.value(mu);
    let unit = balance.unit_of(mu);
    // The far end is tried first, so that the balance is left at the near one.
    let exists = from.is_finite() && to.is_finite() && from != to && balance.set(mu, to);
    if !(exists && balance.set(mu, from)) {
        return Err(refused(from, unit));
    }
    let branch = options.branch.between(from, to);
    let (singular, z, _) = Singular::solved(&balance, kind, &branch.continuation, x)?;
    // The bifurcation needed as many harmonics; with fewer the curve would not begin at it.
    let least_harmonics = branch.least_harmonics.max(singular.harmonics().div_ceil(singular.period()));
    let options = TraceOptions { branch: BranchOptions { least_harmonics, ..branch }, ..options.clone() };
    let mut singular = singular.with(mu);
    let continuation = Continuation::start(&mut singular, branch.continuation, &z, from, to - from)?;
    Ok((singular, continuation, options))
}

/// Continues to the end of the interval.
fn follow(
    singular: &mut Singular,
    continuation: &mut Continuation,
    options: &TraceOptions,
    curve: &mut SingularCurve,
) -> Result<(), AnalysisError> {
    let branch = &options.branch;
    loop {
        adapt(singular, continuation, branch)?;
        curve.points.push(singular_point(singular, continuation.point(), options));
        let before = continuation.point().clone();
        let points = curve.points.len();
        if points >= branch.most_points {
            return Err(AnalysisError::TooManyPoints { points, at: singular.place(before.lambda) });
        }
        let after = continuation.advance(singular)?;
        if along_mu(&before) * along_mu(after) < 0.0 {
            let (is_cusp, point) = turn(singular, options, [&before, after])?;
            curve.turns.push(Turn { is_cusp, point, index: points });
        }
        if let Some(limit) = branch.left_at(after.lambda) {
            let last = at_parameter(singular, &branch.continuation, [&before, after], limit)?;
            curve.points.push(singular_point(singular, &last, options));
            return Ok(());
        }
    }
}

/// dλ/ds counts as zero below this fraction of its value beside the point: a cusp is located far more exactly.
const STANDS: f64 = 1e-4;
/// Two ends nearer than this, relative, are one point: bifurcations are located to about 1e-12.
const SAME: f64 = 1e-8;

/// Says whether two values of a coordinate belong to the same bifurcation.
pub(super) fn near(a: f64, b: f64) -> bool {
    libm::fabs(a - b) <= SAME * libm::fabs(b)
}

/// Derivative of the second parameter along the curve, dμ/ds.
fn along_mu(point: &Point) -> f64 {
    point.tangent.last().copied().unwrap_or(0.0)
}

/// The point between two of the curve at which it turns back in μ, dμ/ds = 0, and whether that is a cusp.
///
/// With the extended system's unknowns (λ, X) and μ the curve is smooth through a cusp, where its tangent is (0, v, 0),
/// v being the null vector: dλ/ds = 0, too. Along R = 0 and g = 0 the tangent is a function of the arclength s whose
/// part by μ passes zero with a slope, so its zero is found as exactly as rounding lets it, and λ and μ, which are even
/// in the distance from it to first order, more exactly still.
fn turn(
    singular: &mut Singular,
    options: &TraceOptions,
    ends: [&Point; 2],
) -> Result<(bool, SingularPoint), AnalysisError> {
    let n = singular.dimension();
    let settings = &options.branch.continuation;
    let mut slices = Slices::new(n, settings, ends, Cut::Chord);
    // Solved again in the planes of the search: the tangents at the ends then have the sign of those between them.
    let solved = [slices.solve(singular, ends, 0.0)?, slices.solve(singular, ends, 1.0)?];
    let values = [along_mu(&solved[0]), along_mu(&solved[1])];
    let ends = [&solved[0], &solved[1]];
    let point = search(singular, settings, ends, values, FINE, |_, point| along_mu(point))?;
    let by_lambda = libm::fabs(point.tangent[0]);
    let beside = libm::fabs(solved[0].tangent[0]).max(libm::fabs(solved[1].tangent[0]));
    Ok((by_lambda < STANDS * beside, singular_point(singular, &point, options)))
}

fn singular_point(singular: &mut Singular, point: &Point, options: &TraceOptions) -> SingularPoint {
    let (lambda, x) = singular.split(&point.x);
    let x = x.to_vec();
    let orbit =
        singular.orbit(&point.x, point.lambda, |balance| orbit_of(balance, options, &x, lambda, point.arclength));
    SingularPoint { lambda, mu: point.lambda, orbit }
}
