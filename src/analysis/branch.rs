//! A branch of periodic motions: walked from one value of a coordinate to another, with stability and bifurcations.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;

use super::continuation::{Cut, Point, Settings, System, Walk, Work, between};
use super::extended::Singularity;
use super::floquet::Stability;
use super::fourier::zeros;
use super::locate::{polish, search};
use super::{AnalysisError, Coordinate, Floquet, ForcedResponse, HarmonicBalance, Oscillator};

/// How far a branch is walked, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BranchOptions {
    /// The coordinate at the start.
    pub from: f64,
    /// The coordinate at the end.
    pub to: f64,
    /// The most harmonics of the excitation.
    pub most_harmonics: usize,
    /// What the truncation to H harmonics may leave out, relative to the size of the motion.
    pub truncation: f64,
    /// The most points.
    pub most_points: usize,
    /// Steps and scales.
    pub walk: Settings,
}

impl BranchOptions {
    /// From one value to another with the usual settings.
    pub fn new(from: f64, to: f64) -> BranchOptions {
        let floor = 0.05 * (to - from).abs();
        let walk = Settings { parameter_floor: floor.max(f64::MIN_POSITIVE), ..Settings::default() };
        BranchOptions { from, to, most_harmonics: 64, truncation: 1e-9, most_points: 20_000, walk }
    }
}

/// A periodic motion on a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Orbit {
    /// The coordinate.
    pub value: f64,
    /// Ω/2π, Hz.
    pub frequency_hz: f64,
    /// The largest |α1| and |α2| over the period, rad.
    pub amplitude_rad: [f64; 2],
    /// √(a² + b²) of the component at Ω of α1 and α2, rad.
    pub harmonic1_rad: [f64; 2],
    /// Floquet multipliers, the largest first.
    pub stability: Stability,
    /// Fourier coefficients, rad: c₀ of α1 and α2, then aₖ of both, bₖ of both, k = 1 … H, of cos kΩt/ν and sin kΩt/ν.
    pub coefficients: Vec<f64>,
    /// The arclength from the start, in units of the local size of the motion.
    pub arclength: f64,
}

impl Orbit {
    /// Whether small disturbances die out.
    pub fn is_stable(&self) -> bool {
        self.stability.is_stable()
    }

    /// The Floquet multipliers.
    pub fn multipliers(&self) -> &[Complex<f64>; 4] {
        &self.stability.multipliers
    }

    /// H.
    pub fn harmonics(&self) -> usize {
        self.coefficients.len() / 4
    }
}

/// Kinds of bifurcation of periodic motions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BifurcationKind {
    /// `fold`: a multiplier passes 1 and the branch turns back (saddle-node, limit point).
    Fold,
    /// `period-doubling`: a multiplier passes −1 (flip).
    PeriodDoubling,
    /// `neimark-sacker`: a complex pair passes the unit circle (torus).
    NeimarkSacker,
    /// `branch-point`: two branches cross.
    BranchPoint,
}

impl BifurcationKind {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            BifurcationKind::Fold => "fold",
            BifurcationKind::PeriodDoubling => "period-doubling",
            BifurcationKind::NeimarkSacker => "neimark-sacker",
            BifurcationKind::BranchPoint => "branch-point",
        }
    }
}

/// A bifurcation on a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Bifurcation {
    /// Its kind.
    pub kind: BifurcationKind,
    /// The motion there.
    pub orbit: Orbit,
    /// How many points of the branch come before it.
    pub index: usize,
    /// The direction of the new motion: for a period doubling the series of frequencies ½, 1½, … that has the multiplier −1,
    /// for a fold the null vector; empty otherwise.
    pub null_vector: Vec<f64>,
}

/// A branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Branch {
    /// Its motions in order.
    pub orbits: Vec<Orbit>,
    /// Its bifurcations in order.
    pub bifurcations: Vec<Bifurcation>,
    /// What the walk has cost, without the location of bifurcations.
    pub work: Work,
}

/// A point with what is tested on it.
#[derive(Clone, Debug)]
struct Marked {
    point: Point,
    orbit: Orbit,
}

/// Harmonics of the base frequency to start with.
const FIRST_HARMONICS: usize = 3;
/// Below this fraction of the truncation allowed, the last harmonic is dropped.
const DROP_SHARE: f64 = 1e-3;
/// Steps of the search along the branch end at this fraction of a segment; it starts the extended systems.
const COARSE: f64 = 1e-2;
/// And at this where there is no extended system.
const FINE: f64 = 1e-12;

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
    let mut balance = HarmonicBalance::new(oscillator, frequency_hz, 1, FIRST_HARMONICS);
    check(&mut balance, coordinate, options)?;
    let mut response = ForcedResponse::new(balance, coordinate);
    let start = zeros(FIRST_HARMONICS);
    let direction = options.to - options.from;
    let walk = Walk::start(&mut response, options.walk, &start, options.from, direction)?;
    Tracer::new(response, options).run(walk)
}

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
        self.adapt(&mut walk)?;
        let mut before = self.mark(walk.point());
        self.branch.orbits.push(before.orbit.clone());
        loop {
            if self.branch.orbits.len() >= self.options.most_points {
                let points = self.options.most_points;
                return Err(AnalysisError::TooManyPoints { points, lambda: before.point.lambda });
            }
            walk.advance(&mut self.response)?;
            self.adapt(&mut walk)?;
            let end = self.end(&before.point, walk.point())?;
            let after = self.mark(end.as_ref().unwrap_or(walk.point()));
            self.detect(&before, &after)?;
            self.branch.orbits.push(after.orbit.clone());
            if end.is_some() {
                self.branch.work = walk.work();
                return Ok(self.branch);
            }
            before = after;
        }
    }

    /// If the branch has left the interval, the point where it did.
    fn end(&mut self, a: &Point, b: &Point) -> Result<Option<Point>, AnalysisError> {
        let (low, high) = (self.options.from.min(self.options.to), self.options.from.max(self.options.to));
        let limit = if b.lambda < low {
            low
        } else if b.lambda > high {
            high
        } else {
            return Ok(None);
        };
        let fraction = (limit - a.lambda) / (b.lambda - a.lambda);
        let mut point = between(&mut self.response, &self.options.walk, [a, b], fraction, Cut::Parameter)?;
        point.lambda = limit;
        Ok(Some(point))
    }

    /// More harmonics until the truncation error is small enough; fewer where the last says nothing.
    fn adapt(&mut self, walk: &mut Walk) -> Result<(), AnalysisError> {
        loop {
            let point = walk.point();
            let (lambda, size) = (point.lambda, self.options.walk.size(&point.x));
            let balance = self.response.balance_mut();
            balance.linearise(&point.x);
            let harmonics = balance.harmonics();
            let allowed = self.options.truncation * size;
            let error = balance.truncation_error_rad();
            if error > allowed {
                if harmonics >= self.options.most_harmonics * balance.subharmonic() {
                    return Err(AnalysisError::TooManyHarmonics { lambda, harmonics });
                }
                balance.set_harmonics(harmonics + 1 + harmonics / 8);
                walk.resize(&mut self.response)?;
                continue;
            }
            let last = point.x[point.x.len() - 4..].iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
            let least = FIRST_HARMONICS * balance.subharmonic();
            if harmonics > least && error.max(last) < DROP_SHARE * allowed {
                balance.set_harmonics(harmonics - 1);
                walk.resize(&mut self.response)?;
            }
            return Ok(());
        }
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
        let row = 4 * balance.subharmonic() - 2;
        let harmonic1_rad = [0, 1].map(|dof| {
            let (a, b) = (x[row + dof], x[row + 2 + dof]);
            libm::sqrt(a * a + b * b)
        });
        Orbit {
            value,
            frequency_hz: balance.coordinate(Coordinate::FrequencyHz),
            amplitude_rad: balance.largest_rad(x),
            harmonic1_rad,
            stability: self.floquet.stability(balance, x),
            coefficients: x.to_vec(),
            arclength,
        }
    }

    /// Locates what has changed sign between two neighbouring points.
    fn detect(&mut self, a: &Marked, b: &Marked) -> Result<(), AnalysisError> {
        use BifurcationKind::*;
        let direction = |marked: &Marked| marked.point.tangent.last().copied().unwrap_or(0.0);
        let tests = [
            (Fold, [direction(a), direction(b)]),
            (BranchPoint, [a, b].map(|marked| marked.point.determinant.sign)),
            (PeriodDoubling, [a, b].map(|marked| marked.orbit.stability.period_doubling_test())),
            (NeimarkSacker, [a, b].map(|marked| marked.orbit.stability.neimark_sacker_test())),
        ];
        let first = self.branch.bifurcations.len();
        for (kind, values) in tests {
            if values[0] * values[1] < 0.0 {
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
                let reference = ends[0].determinant.log_magnitude;
                let scaled = |point: &Point| {
                    point.determinant.sign * libm::exp(point.determinant.log_magnitude - reference)
                };
                let values = ends.map(scaled);
                Some((search(&mut self.response, settings, ends, values, FINE, |_, point| scaled(point))?, vec![]))
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
    stability.multipliers.iter().any(|mu| mu.im.abs() > 1e-6 && (mu.norm() - 1.0).abs() < 1e-6)
}
