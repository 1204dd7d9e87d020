//! Branches of a structure's periodic motions: traced from one value of a coordinate to another, with folds, peaks,
//! stability and other bifurcations.

use alloc::boxed::Box;

use nalgebra::Complex;
use resonarm_dynamics::structure::Dof;

use super::adapt::adapt;
use super::balance::Balance;
use super::floquet::Floquet;
use super::orbit::{Assess, Branch, Orbit, Reading, Stability, TraceOptions};
use super::spectral::largest;
use super::walk::Walk;
use super::{Coordinate, Forced};
use crate::continuation::{Continuation, Point, System, at_parameter};
use crate::{AnalysisError, EndedEarly};

/// Multiples of the frequency at which to start if Newton's method finds no motion from rest.
const DETOURS: [f64; 2] = [0.7, 1.4];
/// The most times that the step of a jump is halved. Branches nearer than 2⁻¹⁶ of a step count as one.
const MOST_HALVINGS: usize = 16;
/// A fold or a peak is located to this fraction of its segment; the coordinate is then exact to the square.
pub(super) const FRACTION: f64 = 1e-7;

/// Traces a branch of motions with the period of the drive from `options.branch.from` to `options.branch.to`. The
/// coordinate that doesn't vary is `frequency_hz`, or the amplitude of `forced`.
///
/// # Errors
/// [`EndedEarly`], with the place, the reason, advice, and the branch up to there.
pub fn trace(
    forced: &Forced,
    frequency_hz: f64,
    coordinate: Coordinate,
    options: &TraceOptions,
) -> Result<Branch, EndedEarly<Branch>> {
    let mut balance = Balance::new(forced, frequency_hz, coordinate, options.branch.least_harmonics);
    check(&mut balance, options)?;
    let mut walk = Walk::new(enter(&mut balance, options)?);
    let mut tracer = Tracer { balance, options, floquet: Floquet::default(), branch: Branch::default() };
    let reason = tracer.follow(&mut walk).err();
    tracer.locate_peaks();
    let mut branch = tracer.branch;
    branch.work = walk.work();
    branch.bifurcations.sort_by(|a, b| a.orbit.arclength.total_cmp(&b.orbit.arclength));
    for bifurcation in &mut branch.bifurcations {
        let at = bifurcation.orbit.arclength;
        bifurcation.index = branch.orbits.partition_point(|orbit| orbit.arclength < at);
    }
    match reason {
        None => Ok(branch),
        Some(reason) => Err(EndedEarly { reason, so_far: Box::new(branch) }),
    }
}

/// Both ends, and the frequency, must be numbers at which the system exists.
fn check(balance: &mut Balance, options: &TraceOptions) -> Result<(), AnalysisError> {
    balance.unknowns.check_held()?;
    let (from, to, unit) = (options.branch.from, options.branch.to, balance.unit());
    let domain = match balance.coordinate {
        Coordinate::FrequencyHz => "the positive frequencies",
        Coordinate::Amplitude => "the amplitudes of the drive",
    };
    let known = balance.coordinate == Coordinate::FrequencyHz
        || (balance.frequency_hz.is_finite() && balance.frequency_hz > 0.0);
    let exists = from != to && balance.set_value(to) && balance.set_value(from);
    if exists && known { Ok(()) } else { Err(AnalysisError::Interval { from, to, unit, domain }) }
}

/// Starts at `options.branch.from`: from rest, or, if that is too far, from the end of a continuation in frequency that
/// starts away from the resonance.
fn enter(balance: &mut Balance, options: &TraceOptions) -> Result<Continuation, AnalysisError> {
    let branch = &options.branch;
    let direction = branch.to - branch.from;
    let rest = alloc::vec![0.0; balance.dimension()];
    let first = match Continuation::start(balance, branch.continuation, &rest, branch.from, direction) {
        Ok(continuation) => return Ok(continuation),
        Err(error) => error,
    };
    let mut detours = DETOURS;
    if balance.coordinate == Coordinate::FrequencyHz && direction < 0.0 {
        detours.reverse();
    }
    for detour in detours {
        if let Ok(continuation) = approach(balance, options, detour) {
            return Ok(continuation);
        }
    }
    Err(first)
}

/// Continues in frequency from `detour` times the wanted frequency to it, and starts there.
fn approach(balance: &mut Balance, options: &TraceOptions, detour: f64) -> Result<Continuation, AnalysisError> {
    let branch = &options.branch;
    // The interval was checked.
    let _ = balance.set_value(branch.from);
    let mut swept = balance.clone();
    swept.coordinate = Coordinate::FrequencyHz;
    let wanted_hz = balance.frequency_hz;
    swept.set_harmonics(branch.least_harmonics);
    let rest = alloc::vec![0.0; swept.dimension()];
    let mut walk =
        Walk::new(Continuation::start(&mut swept, branch.continuation, &rest, detour * wanted_hz, 1.0 - detour)?);
    for _ in 0..branch.most_points {
        adapt(&mut swept, &mut walk.continuation, branch)?;
        let before = walk.point().clone();
        walk.advance(&mut swept, &branch.continuation)?;
        let after = walk.point();
        if (before.lambda - wanted_hz) * (after.lambda - wanted_hz) <= 0.0 {
            let point = at_parameter(&mut swept, &branch.continuation, [&before, after], wanted_hz)?;
            balance.set_harmonics(swept.harmonics());
            let direction = branch.to - branch.from;
            return Continuation::start(balance, branch.continuation, &point.x, branch.from, direction);
        }
    }
    Err(AnalysisError::TooManyPoints { points: branch.most_points, at: swept.place(walk.point().lambda) })
}

/// A continuation with the quantities computed at each point.
pub(super) struct Tracer<'a> {
    pub balance: Balance,
    pub options: &'a TraceOptions,
    pub floquet: Floquet,
    pub branch: Branch,
}

impl Tracer<'_> {
    fn follow(&mut self, walk: &mut Walk) -> Result<(), AnalysisError> {
        let branch = &self.options.branch;
        adapt(&mut self.balance, &mut walk.continuation, branch)?;
        let mut before = walk.point().clone();
        self.push(&before);
        loop {
            if self.branch.orbits.len() >= branch.most_points {
                let at = self.balance.place(before.lambda);
                return Err(AnalysisError::TooManyPoints { points: branch.most_points, at });
            }
            self.step(walk, &before)?;
            let reached = walk.point();
            let end = match branch.left_at(reached.lambda) {
                Some(limit) => Some(at_parameter(&mut self.balance, &branch.continuation, [&before, reached], limit)?),
                None => None,
            };
            let after = end.clone().unwrap_or_else(|| reached.clone());
            self.push(&after);
            self.detect(&before, &after);
            before = after;
            if end.is_some() {
                return Ok(());
            }
        }
    }

    /// The next point after `before`. A step that comes to another branch, which passes close by, is taken again in
    /// halves.
    ///
    /// Along one branch the bordered determinant changes its sign at branch points only. So if it does in a step
    /// without one, the step has jumped. Where forces aren't smooth, corners change it, too.
    fn step(&mut self, walk: &mut Walk, before: &Point) -> Result<(), AnalysisError> {
        let (branch, smooth) = (&self.options.branch, self.balance.forced.assembly.is_smooth());
        let (start, harmonics) = (walk.clone(), self.balance.harmonics());
        for _ in 0..MOST_HALVINGS {
            walk.advance(&mut self.balance, &branch.continuation)?;
            adapt(&mut self.balance, &mut walk.continuation, branch)?;
            let reached = walk.point().clone();
            if !smooth || before.determinant.sign * reached.determinant.sign >= 0.0 {
                return Ok(());
            }
            if self.branch_point(before, &reached).is_some() {
                return Ok(());
            }
            *walk = start.clone();
            walk.continuation.set_step(0.5 * (reached.arclength - before.arclength));
            self.balance.set_harmonics(harmonics);
        }
        walk.advance(&mut self.balance, &branch.continuation)?;
        adapt(&mut self.balance, &mut walk.continuation, branch)
    }

    fn push(&mut self, point: &Point) {
        let orbit = self.orbit(point);
        self.branch.orbits.push(orbit);
    }

    /// The stability of the motion last evaluated, if it is asked for.
    fn stability(&mut self, x: &[f64]) -> Option<Stability> {
        if self.options.assess == Assess::Multipliers { self.floquet.stability(&self.balance, x) } else { None }
    }

    /// Evaluates the motion at a point, with the harmonics of the point, and reads it.
    fn at<T>(&mut self, point: &Point, read: impl FnOnce(&mut Self) -> T) -> T {
        let (current, needed) = (self.balance.harmonics(), point.x.len() / self.balance.unknowns.count() / 2);
        if current != needed {
            self.balance.set_harmonics(needed);
        }
        // The coordinate was valid when the point was solved for.
        let _ = self.balance.set_value(point.lambda);
        self.balance.evaluate_motion(&point.x);
        let result = read(self);
        if current != needed {
            self.balance.set_harmonics(current);
        }
        result
    }

    /// All results for the motion at a point.
    pub fn orbit(&mut self, point: &Point) -> Orbit {
        self.at(point, |tracer| Orbit {
            value: point.lambda,
            frequency_hz: tracer.balance.frequency_hz,
            drive: tracer.balance.forced.amplitude,
            readings: tracer.options.read.iter().map(|&dof| reading(&tracer.balance, dof)).collect(),
            stability: tracer.stability(&point.x),
            harmonics: tracer.balance.harmonics(),
            coefficients: point.x.clone(),
            arclength: point.arclength,
        })
    }

    /// The largest displacement in the motion at a point, without the other results.
    pub fn largest_at(&mut self, point: &Point, dof: Dof) -> f64 {
        self.at(point, |tracer| reading(&tracer.balance, dof).largest)
    }
}

/// The motion at a degree of freedom, of the motion last evaluated.
pub(super) fn reading(balance: &Balance, dof: Dof) -> Reading {
    reading_of(balance, &balance.displacement(dof))
}

/// The same of a series.
pub(super) fn reading_of(balance: &Balance, series: &[f64]) -> Reading {
    let largest = largest(&balance.samples, series);
    Reading { largest, mean: series[0], harmonic1: Complex::new(series[2], series[1]) }
}
