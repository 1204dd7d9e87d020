//! Branches of periodic motions: walked from one value of a coordinate to another, with stability and bifurcations.

use alloc::vec;
use alloc::vec::Vec;

use super::adapt::{Spectral, adapt};
use super::continuation::{Point, Walk, Work, at_parameter};
use super::extended::Singularity;
use super::floquet::Stability;
use super::fourier::zeros;
use super::locate::{COARSE, FINE, branch_point, doubled, polish, rejoin, search};
use super::orbit::{Bifurcation, BifurcationKind, Branch, BranchOptions, Orbit};
use super::{AnalysisError, Coordinate, Floquet, ForcedResponse, HarmonicBalance, Oscillator};

/// A point with what is tested on it.
#[derive(Clone, Debug)]
struct Marked {
    point: Point,
    orbit: Orbit,
}

/// Two branches meet in a segment if they do within this distance of its end, in units of Λ.
const REACH: f64 = 0.1;

/// Walks a branch of motions with the period of the excitation from `options.from` to `options.to`.
///
/// # Errors
/// [`AnalysisError`], with the place, the reason and what to try.
pub fn trace<O: Oscillator + Clone>(
    oscillator: O,
    frequency_hz: f64,
    coordinate: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Result<Branch, AnalysisError> {
    let mut balance = HarmonicBalance::new(oscillator, frequency_hz, 1, options.least_harmonics);
    check(&mut balance, coordinate, options)?;
    let mut response = ForcedResponse::new(balance, coordinate);
    let start = zeros(options.least_harmonics);
    let direction = options.to - options.from;
    let walk = Walk::start(&mut response, options.walk, &start, options.from, direction)?;
    Tracer::new(response, options).run(walk)
}

/// Walks the branch of motions of twice the excitation's period that leaves a period doubling of a branch in `coordinate`.
///
/// The first step goes along the null vector v: X on the even harmonics of the halved base frequency, v on the odd ones. The
/// branch ends where it leaves the interval of the options, or at a branch point, where it meets motions of the single period
/// again: beyond lie the same motions, shifted by one period.
///
/// # Errors
/// [`AnalysisError::NotSingular`] if the bifurcation is of another kind; else as [`trace`].
pub fn trace_doubled<O: Oscillator + Clone>(
    oscillator: O,
    bifurcation: &Bifurcation,
    coordinate: Coordinate<O::Parameter>,
    options: &BranchOptions,
) -> Result<Branch, AnalysisError> {
    if bifurcation.kind != BifurcationKind::PeriodDoubling {
        return Err(AnalysisError::NotSingular { kind: bifurcation.kind.name() });
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
    let walk = Walk::start_along(&mut response, options.walk, &x, orbit.value, &direction, FIRST_DOUBLED_STEP)?;
    Tracer::new(response, options).run(walk)
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
    if exists { Ok(()) } else { Err(AnalysisError::Interval { from, to, domain }) }
}

/// The walk, with what is computed at each point.
struct Tracer<'a, O: Oscillator> {
    response: ForcedResponse<O>,
    options: &'a BranchOptions,
    floquet: Floquet,
    branch: Branch,
}

impl<'a, O: Oscillator + Clone> Tracer<'a, O> {
    fn new(response: ForcedResponse<O>, options: &'a BranchOptions) -> Tracer<'a, O> {
        let branch = Branch { orbits: Vec::new(), bifurcations: Vec::new(), work: Work::default() };
        Tracer { response, options, floquet: Floquet::default(), branch }
    }

    fn run(mut self, mut walk: Walk) -> Result<Branch, AnalysisError> {
        adapt(&mut self.response, &mut walk, self.options)?;
        let mut before = self.mark(walk.point());
        self.branch.orbits.push(before.orbit.clone());
        loop {
            if self.branch.orbits.len() >= self.options.most_points {
                let points = self.options.most_points;
                return Err(AnalysisError::TooManyPoints { points, lambda: before.point.lambda });
            }
            walk.advance(&mut self.response)?;
            adapt(&mut self.response, &mut walk, self.options)?;
            let end = self.end(&before.point, walk.point())?;
            let after = self.mark(end.as_ref().unwrap_or(walk.point()));
            self.detect(&before, &after)?;
            self.branch.orbits.push(after.orbit.clone());
            if end.is_some() || self.rejoined() {
                self.branch.work = walk.work();
                return Ok(self.branch);
            }
            before = after;
        }
    }

    /// Whether a branch of doubled period has met the single one.
    fn rejoined(&self) -> bool {
        let Some(last) = self.branch.bifurcations.last() else { return false };
        let fresh = last.kind == BifurcationKind::BranchPoint && last.index + 1 == self.branch.orbits.len();
        let mut harmonics = last.orbit.coefficients[2..].chunks_exact(4).step_by(2);
        fresh
            && self.response.balance().subharmonic() == 2
            && harmonics.all(|odd| odd.iter().all(|value| *value == 0.0))
    }

    /// If the branch has left the interval, the point where it did.
    fn end(&mut self, a: &Point, b: &Point) -> Result<Option<Point>, AnalysisError> {
        let Some(limit) = self.options.left_at(b.lambda) else { return Ok(None) };
        let point = at_parameter(&mut self.response, &self.options.walk, [a, b], limit)?;
        Ok(Some(point))
    }

    /// Everything about the motion at a point.
    fn mark(&mut self, point: &Point) -> Marked {
        let orbit = self.orbit(&point.x, point.lambda, point.arclength);
        Marked { point: point.clone(), orbit }
    }

    fn orbit(&mut self, x: &[f64], value: f64, arclength: f64) -> Orbit {
        let coordinate = self.response.coordinate();
        let balance = self.response.balance_mut();
        // The coordinate was valid when the point was solved for.
        let _ = balance.set_coordinate(coordinate, value);
        let (walked, needed) = (balance.harmonics(), x.len() / 4);
        if walked == needed {
            return Orbit::of(balance, &mut self.floquet, x, value, arclength);
        }
        balance.set_harmonics(needed);
        let orbit = Orbit::of(balance, &mut self.floquet, x, value, arclength);
        balance.set_harmonics(walked);
        orbit
    }

    /// Locates what has changed sign between two neighbouring points.
    fn detect(&mut self, a: &Marked, b: &Marked) -> Result<(), AnalysisError> {
        use BifurcationKind::*;
        let direction = |marked: &Marked| marked.point.tangent.last().copied().unwrap_or(0.0);
        let tests = [
            (BranchPoint, [a, b].map(|marked| marked.point.determinant.sign)),
            (Fold, [direction(a), direction(b)]),
            (PeriodDoubling, [a, b].map(|marked| marked.orbit.stability.period_doubling_test())),
            (NeimarkSacker, [a, b].map(|marked| marked.orbit.stability.neimark_sacker_test())),
        ];
        let first = self.branch.bifurcations.len();
        let crosses = |values: [f64; 2]| values[0] * values[1] < 0.0;
        for (kind, values) in tests {
            // A branch that ends in the side of another turns back there: a branch point, and no fold of its own.
            let turned = kind == Fold && crosses(tests[0].1);
            if crosses(values) && !turned {
                self.locate(kind, [&a.point, &b.point], values)?;
            }
        }
        let order = |a: &Bifurcation, b: &Bifurcation| a.orbit.arclength.total_cmp(&b.orbit.arclength);
        self.branch.bifurcations[first..].sort_by(order);
        Ok(())
    }

    fn locate(&mut self, kind: BifurcationKind, ends: [&Point; 2], values: [f64; 2]) -> Result<(), AnalysisError> {
        let settings = &self.options.walk;
        let located = match kind {
            BifurcationKind::Fold => {
                let test = |_: &mut ForcedResponse<O>, point: &Point| point.tangent.last().copied().unwrap_or(0.0);
                let guess = search(&mut self.response, settings, ends, values, COARSE, test)?;
                self.polished(Singularity::Fold, &guess)?
            }
            BifurcationKind::PeriodDoubling => {
                let guess = self.search_multipliers(ends, values, COARSE, Stability::period_doubling_test)?;
                self.polished(Singularity::PeriodDoubling, &guess)?
            }
            BifurcationKind::NeimarkSacker => {
                let point = self.search_multipliers(ends, values, FINE, Stability::neimark_sacker_test)?;
                Some((point, vec![]))
            }
            BifurcationKind::BranchPoint => {
                let doubled = self.response.balance().subharmonic() > 1;
                let joint = if doubled { rejoin(&self.response, settings, ends[1]).ok() } else { None };
                let near = |point: &Point| {
                    (point.lambda - ends[1].lambda).abs() <= REACH * settings.lambda_scale(point.lambda)
                };
                let point = match joint.filter(near) {
                    Some(point) => point,
                    None => branch_point(&self.response, settings, ends)?,
                };
                Some((point, vec![]))
            }
        };
        let Some((point, null_vector)) = located else { return Ok(()) };
        let orbit = self.orbit(&point.x, point.lambda, point.arclength);
        if kind == BifurcationKind::NeimarkSacker && !has_pair_on_the_circle(&orbit.stability) {
            return Ok(());
        }
        let index = self.branch.orbits.len();
        self.branch.bifurcations.push(Bifurcation { kind, orbit, index, null_vector });
        Ok(())
    }
}

impl<O: Oscillator + Clone> Tracer<'_, O> {
    /// The solution of the extended system near `guess`, with its null vector.
    fn polished(&self, kind: Singularity, guess: &Point) -> Result<Option<(Point, Vec<f64>)>, AnalysisError> {
        let located = polish(&self.response, &self.options.walk, kind, guess)?;
        let null_vector = located.singular.null_vector().to_vec();
        Ok(Some((Point { x: located.x, lambda: located.lambda, ..guess.clone() }, null_vector)))
    }

    /// Searches for the zero of a function of the multipliers.
    fn search_multipliers(
        &mut self,
        ends: [&Point; 2],
        values: [f64; 2],
        tolerance: f64,
        function: fn(&Stability) -> f64,
    ) -> Result<Point, AnalysisError> {
        let floquet = &mut self.floquet;
        let test = |response: &mut ForcedResponse<O>, point: &Point| {
            let coordinate = response.coordinate();
            let balance = response.balance_mut();
            let exists = balance.set_coordinate(coordinate, point.lambda);
            if exists { function(&floquet.stability(balance, &point.x)) } else { f64::NAN }
        };
        search(&mut self.response, &self.options.walk, ends, values, tolerance, test)
    }
}

/// Whether a pair of multipliers is on the unit circle, and not at ±1: the test function also vanishes where the product of two
/// real multipliers is 1.
fn has_pair_on_the_circle(stability: &Stability) -> bool {
    stability.multipliers.iter().any(|mu| mu.im.abs() > 1e-6 && (mu.norm_sqr() - 1.0).abs() < 2e-6)
}
