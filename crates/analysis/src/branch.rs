//! Branches of periodic motions: traced from one value of a coordinate to another, with stability and bifurcations.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::adapt::{Spectral, adapt};
use super::continuation::{Continuation, Point, System, at_parameter};
use super::curve::near;
use super::fourier::zeros;
use super::locate::doubled;
use super::orbit::{Bifurcation, BifurcationKind, Branch, BranchOptions, Orbit};
use super::start::enter;
use super::{AnalysisError, Coordinate, EndedEarly, Floquet, ForcedResponse, HarmonicBalance, Oscillator};

/// A point with the quantities tested at it.
#[derive(Clone, Debug)]
pub(super) struct Marked {
    pub point: Point,
    pub orbit: Orbit,
}

/// Traces a branch of motions with the period of the excitation from `options.from` to `options.to`.
///
/// # Errors
/// [`EndedEarly`], with the place, the reason, advice, and the branch up to there.
pub fn trace<O: Oscillator + Clone>(
    oscillator: O,
    frequency_hz: f64,
    coordinate: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Result<Branch, EndedEarly<Branch>> {
    let mut balance = HarmonicBalance::new(oscillator, frequency_hz, 1, options.least_harmonics);
    check(&mut balance, coordinate, options)?;
    let mut response = ForcedResponse::new(balance, coordinate);
    let continuation = enter(&mut response, options)?;
    Tracer::new(response, options).run(continuation)
}

/// Traces the branch of motions of twice the excitation's period that leaves a period doubling of a branch in
/// `coordinate`.
///
/// The first step goes along the null vector v: X on the even harmonics of the halved base frequency, v on the odd
/// ones. The branch ends where it leaves the interval of the options, or at a branch point, where it meets motions of
/// the single period again: beyond are the same motions, shifted by one period.
///
/// # Errors
/// [`AnalysisError::NotSingular`] if the bifurcation is of another kind; otherwise as [`trace`].
pub fn trace_doubled<O: Oscillator + Clone>(
    oscillator: O,
    bifurcation: &Bifurcation,
    coordinate: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Result<Branch, EndedEarly<Branch>> {
    if bifurcation.kind != BifurcationKind::PeriodDoubling {
        return Err(AnalysisError::NotSingular { kind: bifurcation.kind.name() }.into());
    }
    let (orbit, v) = (&bifurcation.orbit, &bifurcation.null_vector);
    let harmonics = 2 * orbit.harmonics() + 1;
    let mut balance = HarmonicBalance::new(oscillator, orbit.frequency_hz, 2, harmonics);
    check(&mut balance, coordinate, options)?;
    let mut response = ForcedResponse::new(balance, coordinate);
    let (mut x, mut direction) = (doubled(&orbit.coefficients), zeros(harmonics));
    x.resize(direction.len(), 0.0);
    for (k, pair) in v.chunks_exact(4).enumerate() {
        direction[8 * k + 2..8 * k + 6].copy_from_slice(pair);
    }
    direction.push(0.0);
    let continuation = Continuation::start_along(
        &mut response,
        options.continuation,
        &x,
        orbit.value,
        &direction,
        FIRST_DOUBLED_STEP,
    )?;
    Tracer::new(response, options).run(continuation)
}

/// The doubled branches from the period doublings of a branch, each with its end; see [`trace_doubled`]. A branch that
/// returns through another of the doublings is listed once for both.
pub fn trace_doublings<O: Oscillator + Clone>(
    oscillator: &O,
    branch: &Branch,
    coordinate: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Vec<Result<Branch, EndedEarly<Branch>>> {
    let mut branches: Vec<Result<Branch, EndedEarly<Branch>>> = Vec::new();
    for doubling in branch.bifurcations.iter().filter(|found| found.kind == BifurcationKind::PeriodDoubling) {
        let ends_here = |traced: &Result<Branch, _>| {
            let end = traced.as_ref().ok().and_then(|branch| branch.bifurcations.last());
            end.is_some_and(|end| {
                end.kind == BifurcationKind::BranchPoint && near(end.orbit.value, doubling.orbit.value)
            })
        };
        if !branches.iter().any(ends_here) {
            branches.push(trace_doubled(oscillator.clone(), doubling, coordinate, options));
        }
    }
    branches
}

/// The first step along a doubled branch, relative to the size of the motion.
const FIRST_DOUBLED_STEP: f64 = 1e-2;

/// Both ends must be numbers at which the system exists.
fn check<O: Oscillator>(
    balance: &mut HarmonicBalance<O>,
    coordinate: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Result<(), AnalysisError> {
    let (from, to) = (options.from, options.to);
    let exists = from.is_finite()
        && to.is_finite()
        && from != to
        && balance.set_coordinate(coordinate, to)
        && balance.set_coordinate(coordinate, from);
    let domain = match coordinate {
        Coordinate::FrequencyHz => "the positive frequencies",
        Coordinate::Parameter(_) => "the range of the parameter",
    };
    if exists { Ok(()) } else { Err(AnalysisError::Interval { from, to, unit: balance.unit(coordinate), domain }) }
}

/// A continuation with the quantities computed at each point.
pub(super) struct Tracer<'a, O: Oscillator> {
    pub response: ForcedResponse<O>,
    pub options: &'a BranchOptions,
    pub floquet: Floquet,
    pub branch: Branch,
    /// Whether a branch of doubled period has met the single one.
    pub rejoined: bool,
}

impl<'a, O: Oscillator + Clone> Tracer<'a, O> {
    fn new(response: ForcedResponse<O>, options: &'a BranchOptions) -> Tracer<'a, O> {
        Tracer { response, options, floquet: Floquet::default(), branch: Branch::default(), rejoined: false }
    }

    /// The branch, whole or up to where the continuation ended.
    fn run(mut self, mut continuation: Continuation) -> Result<Branch, EndedEarly<Branch>> {
        let reason = self.follow(&mut continuation).err();
        self.branch.work = continuation.work();
        self.branch.stability_work = self.floquet.work();
        let branch = self.in_order();
        match reason {
            None => Ok(branch),
            Some(reason) => Err(EndedEarly { reason, so_far: Box::new(branch) }),
        }
    }

    fn follow(&mut self, continuation: &mut Continuation) -> Result<(), AnalysisError> {
        adapt(&mut self.response, continuation, self.options)?;
        let mut older = None;
        let mut before = self.mark(continuation.point());
        self.branch.orbits.push(before.orbit.clone());
        loop {
            if self.branch.orbits.len() >= self.options.most_points {
                let at = self.response.place(before.point.lambda);
                return Err(AnalysisError::TooManyPoints { points: self.options.most_points, at });
            }
            continuation.advance(&mut self.response)?;
            adapt(&mut self.response, continuation, self.options)?;
            let end = self.end(&before.point, continuation.point())?;
            let after = self.mark(end.as_ref().unwrap_or(continuation.point()));
            self.branch.orbits.push(after.orbit.clone());
            self.detect(older.as_ref(), &before, &after)?;
            if end.is_some() || self.rejoined {
                return Ok(());
            }
            older = Some(before);
            before = after;
        }
    }

    /// The branch with its bifurcations in order.
    fn in_order(mut self) -> Branch {
        self.branch.bifurcations.sort_by(|a, b| a.orbit.arclength.total_cmp(&b.orbit.arclength));
        for bifurcation in &mut self.branch.bifurcations {
            let at = bifurcation.orbit.arclength;
            bifurcation.index = self.branch.orbits.partition_point(|orbit| orbit.arclength < at);
        }
        self.branch
    }

    /// If the branch has left the interval, the point where it did.
    fn end(&mut self, a: &Point, b: &Point) -> Result<Option<Point>, AnalysisError> {
        let Some(limit) = self.options.left_at(b.lambda) else { return Ok(None) };
        let point = at_parameter(&mut self.response, &self.options.continuation, [a, b], limit)?;
        Ok(Some(point))
    }

    /// All results for the motion at a point.
    fn mark(&mut self, point: &Point) -> Marked {
        let orbit = self.orbit(&point.x, point.lambda, point.arclength);
        Marked { point: point.clone(), orbit }
    }

    pub fn orbit(&mut self, x: &[f64], value: f64, arclength: f64) -> Orbit {
        let coordinate = self.response.coordinate();
        let balance = self.response.balance_mut();
        // The coordinate was valid when the point was solved for.
        let _ = balance.set_coordinate(coordinate, value);
        let (current, needed) = (balance.harmonics(), x.len() / 4);
        if current == needed {
            return Orbit::of(balance, &mut self.floquet, x, value, arclength);
        }
        balance.set_harmonics(needed);
        let orbit = Orbit::of(balance, &mut self.floquet, x, value, arclength);
        balance.set_harmonics(current);
        orbit
    }
}
