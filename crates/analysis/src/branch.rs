//! Branches of a structure's periodic responses: traced from one value of a coordinate to another, with folds, peaks,
//! stability and other bifurcations.

use alloc::boxed::Box;
use alloc::vec::Vec;

use nalgebra::Complex;
use resonarm_dynamics::structure::Dof;

use super::adapt::adapt;
use super::balance::Balance;
use super::floquet::Floquet;
use super::orbit::{Bifurcation, Branch, BranchEnd, Orbit, Reading};
use super::spectral::largest;
use super::start::start;
use super::trace_options::{Assess, TraceOptions};
use super::walk::Walk;
use crate::branch_options::BifurcationKind;
use crate::continuation::{Continuation, Cut, Point, Slices, System, at_parameter};
use crate::dense::{dot, norm};
use crate::error::{AnalysisError, EndedEarly};
use crate::forced::{Coordinate, Forced};

/// The most times that the step of a jump is halved. Branches nearer than 2⁻¹⁶ of a step count as one.
const MOST_HALVINGS: usize = 16;
/// A branch that turns by less than this between two points beside each other passes a branch point between them, if the
/// determinant changes its sign.
const LITTLE_RAD: f64 = 0.1;
/// A branch is closed if it passes its first response at less than this fraction of the step.
const SAME_SHARE: f64 = 0.05;
/// A fold or a peak is located to this fraction of its segment; the coordinate is then exact to the square.
pub(super) const FRACTION: f64 = 1e-7;
/// A response whose other harmonics are below this fraction of it repeats after fewer periods, and one whose part without a
/// symmetry is below it has the symmetry: a branch of more periods, or without the symmetry, is further from such responses, but
/// for the bifurcation at which it begins or ends.
const SIMPLER: f64 = 1e-6;

/// Traces a branch of responses with the period of the drive from `options.branch.from` to `options.branch.to`. The
/// coordinate that doesn't vary is `frequency_hz`, or the amplitude of `forced`.
///
/// # Errors
/// [`EndedEarly`], with the place, the reason, advice, and the branch up to that place.
pub fn trace(
    forced: &Forced,
    frequency_hz: f64,
    coordinate: Coordinate,
    options: &TraceOptions,
) -> Result<Branch, EndedEarly<Branch>> {
    let mut balance = Balance::new(forced, frequency_hz, coordinate, options.branch.least_harmonics);
    check(&mut balance, options)?;
    let continuation = start(&mut balance, options)
        .map_err(|error| balance.unknowns.undamped_at(balance.omega_rad_s(), balance.harmonics()).unwrap_or(error))?;
    let [at, missed] = [options.branch.from, options.branch.to].map(|value| balance.place(value));
    let branch = Tracer::new(balance, options).run(continuation)?;
    if branch.end == BranchEnd::AtStart {
        return Err(EndedEarly { reason: AnalysisError::CameBack { at, missed }, so_far: Box::new(branch) });
    }
    Ok(branch)
}

/// Checks that both ends, and the frequency, are numbers at which the system exists.
pub(super) fn check(balance: &mut Balance, options: &TraceOptions) -> Result<(), AnalysisError> {
    balance.unknowns.check_held(balance.forced.assembly())?;
    let order = balance.forced.highest_order();
    let most = options.branch.most_harmonics;
    if order > most {
        return Err(AnalysisError::LoadOrder { order, most });
    }
    let from = options.branch.from;
    let to = options.branch.to;
    let known = balance.coordinate == Coordinate::FrequencyHz
        || (balance.frequency_hz.is_finite() && balance.frequency_hz > 0.0);
    let exists = from != to && balance.set_value(to) && balance.set_value(from);
    if exists && known { Ok(()) } else { Err(not_there(balance, options)) }
}

/// The error if the system does not exist at both ends.
pub(super) fn not_there(balance: &Balance, options: &TraceOptions) -> AnalysisError {
    let domain = match balance.coordinate {
        Coordinate::FrequencyHz => "the positive frequencies",
        Coordinate::Amplitude => "the amplitudes of the drive",
        Coordinate::Parameter(_) => "the range of the parameter",
    };
    AnalysisError::Interval { from: options.branch.from, to: options.branch.to, unit: balance.unit(), domain }
}

/// A continuation with the quantities computed at each point.
pub(super) struct Tracer<'a> {
    pub balance: Balance,
    pub options: &'a TraceOptions,
    pub floquet: Floquet,
    pub branch: Branch,
    /// Whether the branch leaves another one, and ends where it meets such a branch.
    pub is_switched: bool,
    /// Direction dX in which the branch left responses with a symmetry that its own have not.
    pub lost: Option<Vec<f64>>,
    /// Whether it has met one.
    pub rejoined: bool,
}

impl<'a> Tracer<'a> {
    pub fn new(balance: Balance, options: &'a TraceOptions) -> Tracer<'a> {
        Tracer {
            balance,
            options,
            floquet: Floquet::default(),
            branch: Branch::default(),
            is_switched: false,
            lost: None,
            rejoined: false,
        }
    }

    /// Runs the continuation and returns the branch, whole or up to where the continuation ended, with its bifurcations
    /// in order and its peaks.
    pub fn run(mut self, continuation: Continuation) -> Result<Branch, EndedEarly<Branch>> {
        let mut walk = Walk::new(continuation);
        let end = self.follow(&mut walk);
        self.locate_peaks();
        let mut branch = self.branch;
        branch.work = walk.work();
        // A pair between earlier points is found after the bifurcations of later ones.
        branch.bifurcations.sort_by(|a, b| a.orbit.arclength.total_cmp(&b.orbit.arclength));
        if self.rejoined {
            // What was found beyond the branch point is on responses that the branch has already.
            let met = branch.bifurcations.iter().rposition(|found| found.kind == BifurcationKind::BranchPoint);
            branch.bifurcations.truncate(met.map_or(0, |met| met + 1));
        }
        for bifurcation in &mut branch.bifurcations {
            let at = bifurcation.orbit.arclength;
            bifurcation.index = branch.orbits.partition_point(|orbit| orbit.arclength < at);
        }
        // A branch that could not be followed further keeps the end that it has from the start, an early one.
        let end = end.map(|end| branch.end = end);
        EndedEarly::at_end(end, branch)
    }

    fn follow(&mut self, walk: &mut Walk) -> Result<BranchEnd, AnalysisError> {
        let branch = &self.options.branch;
        adapt(&mut self.balance, &mut walk.continuation, branch)?;
        let mut older = None;
        let mut before = walk.point().clone();
        let first = before.clone();
        self.push(&before);
        loop {
            if self.branch.orbits.len() >= branch.most_points {
                let at = self.balance.place(before.lambda);
                return Err(AnalysisError::TooManyPoints { points: branch.most_points, at });
            }
            self.step(walk, &before)?;
            let reached = walk.point();
            let left_at = branch.left_at(reached.lambda);
            let end = match left_at {
                Some(limit) => Some(at_parameter(&mut self.balance, &branch.continuation, [&before, reached], limit)?),
                None => None,
            };
            let after = end.clone().unwrap_or_else(|| reached.clone());
            // Only a branch that begins within the interval can come back to its first response.
            let may_close = left_at.is_none() && older.is_some() && first.lambda != branch.from;
            let closed = if may_close { self.passed(&first, [&before, &after]) } else { None };
            let is_closed = closed.is_some();
            let after = closed.unwrap_or(after);
            self.push(&after);
            if !self.rejoined {
                self.detect(older.as_ref(), &before, &after);
            }
            older = Some(core::mem::replace(&mut before, after));
            if self.rejoined {
                return Ok(BranchEnd::Rejoined);
            }
            if is_closed {
                return Ok(BranchEnd::Closed);
            }
            if let Some(limit) = left_at {
                return Ok(if limit == branch.to { BranchEnd::AtEnd } else { BranchEnd::AtStart });
            }
        }
    }

    /// Returns the point of the branch in the plane through a response that is perpendicular to the step from `a` to `b`,
    /// if the step has passed that response.
    ///
    /// The distance is compared with the step: the opposite side of a closed branch is further away, since a step turns
    /// the tangent by little.
    fn passed(&mut self, response: &Point, ends: [&Point; 2]) -> Option<Point> {
        let settings = &self.options.branch.continuation;
        let mut slices = Slices::new(self.balance.dimension(), settings, ends, Cut::Chord);
        let fraction = slices.fraction(ends, response);
        if !(0.0..=1.0).contains(&fraction) {
            return None;
        }
        let point = slices.solve(&mut self.balance, ends, fraction).ok()?;
        // With another number of harmonics the response is not the same, by the truncation error.
        let reach = SAME_SHARE * slices.distance(ends[0], ends[1]) + 2.0 * self.options.branch.truncation;
        (slices.distance(&point, response) < reach).then_some(point)
    }

    /// Takes the step from `before` to the next point. A step that jumps to another branch, which passes close by, is
    /// taken again in halves.
    ///
    /// Along one branch the bordered determinant changes its sign at branch points only. So if it does in a step
    /// without one, the step has jumped. Where a contact is touched, the branch may turn back almost to where it came from
    /// within a tiny part of a step: beyond that, the tangent at an acute angle to the one before leads back, and the
    /// determinant has the other sign. Shorter steps follow the turn, while a branch passes a branch point ever
    /// straighter. At corners of friction the determinant may change, too. A step to a response that repeats after fewer
    /// periods, or has the symmetry that the branch has lost, has jumped as well: it has left a branch that meets such
    /// responses at a bifurcation and turns back there.
    fn step(&mut self, walk: &mut Walk, before: &Point) -> Result<(), AnalysisError> {
        let branch = &self.options.branch;
        let assembly = &self.balance.forced.assembly;
        let smooth = assembly.is_smooth();
        let has_corners = assembly.elements().iter().any(|element| element.law.has_state());
        let start = walk.clone();
        let harmonics = self.balance.harmonics();
        for _ in 0..MOST_HALVINGS {
            walk.advance(&mut self.balance, &branch.continuation)?;
            adapt(&mut self.balance, &mut walk.continuation, branch)?;
            let reached = walk.point().clone();
            let is_simpler = self.is_simpler(&reached) && !self.is_simpler(before);
            let crosses = before.determinant.sign * reached.determinant.sign < 0.0;
            let may_cross = has_corners
                || !crosses
                || if smooth { self.has_branch_point(before, &reached) } else { turns_little(before, &reached) };
            if !is_simpler && may_cross {
                return Ok(());
            }
            // Back to the start of the step, with its harmonics: half the step may stay on the branch.
            *walk = start.clone();
            walk.continuation.set_step(0.5 * (reached.arclength - before.arclength));
            self.balance.set_harmonics(harmonics);
        }
        // Even the shortest step arrives on the other branch: the two count as one, and the trace continues. If the other
        // has another period or symmetry, they meet here.
        walk.advance(&mut self.balance, &branch.continuation)?;
        adapt(&mut self.balance, &mut walk.continuation, branch)?;
        let reached = walk.point().clone();
        if self.is_simpler(&reached) && !self.is_simpler(before) {
            let orbit = self.orbit(&reached);
            self.branch.bifurcations.push(Bifurcation { kind: BifurcationKind::BranchPoint, orbit, index: 0 });
            self.rejoined = true;
        }
        Ok(())
    }

    /// Says whether a response repeats after fewer periods than its branch, or has the symmetry that the branch has lost.
    pub fn is_simpler(&self, response: &Point) -> bool {
        self.is_shorter(response) || self.lost.as_ref().is_some_and(|lost| is_perpendicular(lost, &response.x))
    }

    /// Says whether a response repeats after fewer periods of the drive than its branch: whether, for a prime divisor p of
    /// these, next to nothing of it is in harmonics that are no multiples of p.
    fn is_shorter(&self, response: &Point) -> bool {
        let m = self.balance.unknowns.count();
        let period = self.balance.period();
        let is_prime = |p: usize| (2..p).all(|divisor| !p.is_multiple_of(divisor));
        let rows = || response.x.chunks_exact(m).enumerate();
        (2..=period).filter(|p| period.is_multiple_of(*p) && is_prime(*p)).any(|p| {
            // Rows 2k − 1 and 2k are those of harmonic k.
            let others = rows().filter(|(row, _)| !row.div_ceil(2).is_multiple_of(p));
            let others: f64 = others.map(|(_, row)| dot(row, row)).sum();
            libm::sqrt(others) < SIMPLER * norm(&response.x)
        })
    }

    fn push(&mut self, point: &Point) {
        let orbit = self.orbit(point);
        self.branch.orbits.push(orbit);
    }

    /// Evaluates the response at a point, with the harmonics of the point, and reads it.
    pub fn at<T>(&mut self, point: &Point, read: impl FnOnce(&mut Self) -> T) -> T {
        let current = self.balance.harmonics();
        let needed = point.x.len() / self.balance.unknowns.count() / 2;
        if current != needed {
            self.balance.set_harmonics(needed);
        }
        // The coordinate was valid when the point was solved for.
        let _ = self.balance.set_value(point.lambda);
        self.balance.evaluate_orbit(&point.x);
        let result = read(self);
        if current != needed {
            self.balance.set_harmonics(current);
        }
        result
    }

    /// Returns all results for the response at a point.
    pub fn orbit(&mut self, point: &Point) -> Orbit {
        self.at(point, |tracer| {
            let orbit = orbit_of(&tracer.balance, tracer.options, &point.x, point.lambda, point.arclength);
            let is_assessed = tracer.options.assess == Assess::Multipliers;
            let stability = if is_assessed { tracer.floquet.stability(&tracer.balance, &point.x) } else { None };
            Orbit { stability, ..orbit }
        })
    }

    /// Returns the largest displacement of the response at a point, without the other results.
    pub fn largest_at(&mut self, point: &Point, dof: Dof) -> f64 {
        self.at(point, |tracer| reading(&tracer.balance, dof).largest)
    }
}

/// Says whether a response has next to nothing of the direction in which a branch lost a symmetry, and so has the symmetry.
///
/// A symmetry R, such as x(t) → −x(t + T/2) or the exchange of two equal masses, maps the coefficients of a response to one of
/// the same size, and Rx = x for the responses that have it. The branch leaves them along a φ with Rφ = −φ. So
/// φ·x = Rφ·Rx = −φ·x, which is 0. The numbers of harmonics may differ.
fn is_perpendicular(direction: &[f64], x: &[f64]) -> bool {
    along(direction, x).abs() < SIMPLER * norm(direction) * norm(x)
}

/// Returns the scalar product of a direction with a response.
pub(super) fn along(direction: &[f64], x: &[f64]) -> f64 {
    direction.iter().zip(x).map(|(a, b)| a * b).sum()
}

/// Says whether a branch turns by little between two points.
fn turns_little(a: &Point, b: &Point) -> bool {
    // The numbers of harmonics may differ.
    let (Some((last_a, others_a)), Some((last_b, others_b))) = (a.tangent.split_last(), b.tangent.split_last()) else {
        return false;
    };
    let along: f64 = others_a.iter().zip(others_b).map(|(a, b)| a * b).sum();
    libm::acos((along + last_a * last_b).clamp(-1.0, 1.0)) < LITTLE_RAD
}

/// Returns the response last evaluated, without its stability.
pub(super) fn orbit_of(balance: &Balance, options: &TraceOptions, x: &[f64], value: f64, arclength: f64) -> Orbit {
    Orbit {
        value,
        frequency_hz: balance.frequency_hz,
        drive: balance.forced.amplitude,
        period: balance.period(),
        readings: options.read.iter().map(|&dof| reading(balance, dof)).collect(),
        stability: None,
        harmonics: balance.harmonics(),
        truncation_error: balance.truncation_error() / options.branch.continuation.size(x),
        coefficients: x.to_vec(),
        arclength,
    }
}

/// Returns the reading of a degree of freedom in the response last evaluated.
pub(super) fn reading(balance: &Balance, dof: Dof) -> Reading {
    reading_of(balance, &balance.displacement(dof))
}

/// Returns the reading of a series.
pub(super) fn reading_of(balance: &Balance, series: &[f64]) -> Reading {
    let largest = largest(&balance.samples, series);
    let drive = 2 * balance.period();
    Reading { largest, mean: series[0], harmonic1: Complex::new(series[drive], series[drive - 1]) }
}
