//! Finds bifurcations and peaks between the points of a branch.
//!
//! Each kind of bifurcation has a test function that changes sign at it: of a fold dλ along the branch, of a branch
//! point the bordered determinant, of a period doubling the distance of the least real multiplier from −1, of a
//! Neimark–Sacker point that of the largest complex one from the unit circle.

use nalgebra::Complex;

use super::balance::Balance;
use super::branch::{FRACTION, Tracer};
use super::floquet::stability;
use super::orbit::{Bifurcation, Orbit, Stability};
use crate::continuation::{Cut, Point, Slices, System};
use crate::dense::Determinant;
use crate::locate::search;
use crate::{AnalysisError, BifurcationKind};

use BifurcationKind::{BranchPoint, Fold, NeimarkSacker, PeriodDoubling};

/// Multipliers with a smaller imaginary part are real.
const REAL: f64 = 1e-9;
/// At a bifurcation of the motion a multiplier is this near its place on the unit circle: where two real ones become a
/// pair, or the other way round, a test function jumps and nothing happens.
const NEAR: f64 = 5e-3;
/// The most steps of the search for a peak, and the fraction of its interval at which it ends.
const PEAK: (usize, f64) = (8, 1e-5);

/// The test function of a kind.
fn value(kind: BifurcationKind, point: &Point, stability: Option<&Stability>, reference: Determinant) -> f64 {
    let multipliers = stability.map_or(&[][..], |stability| &stability.multipliers);
    let real = |mu: &&Complex<f64>| mu.im.abs() < REAL;
    match kind {
        BranchPoint => point.determinant.sign * libm::exp(point.determinant.log_magnitude - reference.log_magnitude),
        Fold => point.tangent.last().copied().unwrap_or(0.0),
        PeriodDoubling => multipliers.iter().filter(real).fold(0.0_f64, |least, mu| least.min(mu.re)) + 1.0,
        NeimarkSacker => {
            1.0 - multipliers.iter().filter(|mu| !real(mu)).fold(0.0_f64, |most, mu| most.max(mu.norm_sqr()))
        }
    }
}

/// Whether the multipliers at a bifurcation are those of its kind.
fn confirmed(kind: BifurcationKind, stability: Option<&Stability>) -> bool {
    let any = |near: &dyn Fn(&Complex<f64>) -> bool| stability.is_some_and(|s| s.multipliers.iter().any(near));
    match kind {
        Fold => true,
        BranchPoint => any(&|mu| (mu - 1.0).norm_sqr() < NEAR * NEAR),
        PeriodDoubling => any(&|mu| (mu + 1.0).norm_sqr() < NEAR * NEAR),
        NeimarkSacker => any(&|mu| mu.im.abs() > REAL && (mu.norm_sqr() - 1.0).abs() < NEAR),
    }
}

impl Tracer<'_> {
    /// Locates the bifurcations between the last two points of the branch.
    pub fn detect(&mut self, a: &Point, b: &Point) -> Result<(), AnalysisError> {
        let [.., before, after] = self.branch.orbits.as_slice() else { return Ok(()) };
        let stabilities = [before.stability.clone(), after.stability.clone()];
        let assessed = stabilities[0].is_some();
        for kind in [BranchPoint, Fold, PeriodDoubling, NeimarkSacker] {
            if kind != Fold && !assessed {
                continue;
            }
            let Some(point) = self.locate(kind, [a, b], &stabilities)? else { continue };
            let orbit = self.orbit(&point);
            if confirmed(kind, orbit.stability.as_ref()) {
                self.branch.bifurcations.push(Bifurcation { kind, orbit, index: 0 });
            }
        }
        Ok(())
    }

    /// The branch point between two points, if the branch has one there.
    pub fn branch_point(&mut self, a: &Point, b: &Point) -> Option<Point> {
        let point = self.locate(BranchPoint, [a, b], &[None, None]).ok().flatten()?;
        let harmonics = self.balance.harmonics();
        self.balance.set_harmonics(point.x.len() / self.balance.unknowns.count() / 2);
        let found = if self.balance.set_value(point.lambda) { stability(&self.balance, &point.x) } else { None };
        self.balance.set_harmonics(harmonics);
        confirmed(BranchPoint, found.as_ref()).then_some(point)
    }

    /// Where the test function of a kind vanishes between two points with these stabilities; none if it doesn't.
    fn locate(
        &mut self,
        kind: BifurcationKind,
        [a, b]: [&Point; 2],
        stabilities: &[Option<Stability>; 2],
    ) -> Result<Option<Point>, AnalysisError> {
        let reference = a.determinant;
        let at = |point: &Point, stability: &Option<Stability>| value(kind, point, stability.as_ref(), reference);
        let values = [at(a, &stabilities[0]), at(b, &stabilities[1])];
        if values[0] * values[1] >= 0.0 {
            return Ok(None);
        }
        let test = |balance: &mut Balance, point: &Point| {
            let known = matches!(kind, Fold | BranchPoint);
            let found = if known || !balance.set_value(point.lambda) { None } else { stability(balance, &point.x) };
            value(kind, point, found.as_ref(), reference)
        };
        let settings = &self.options.branch.continuation;
        match search(&mut self.balance, settings, [a, b], values, FRACTION, test) {
            Ok(point) => Ok(Some(point)),
            // At a corner of a branch there may be nothing to converge to.
            Err(_) if !self.balance.forced.assembly().is_smooth() => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Locates the peak of every reading.
    pub fn locate_peaks(&mut self) {
        for reading in 0..self.options.read.len() {
            let size = |orbit: &Orbit| orbit.readings[reading].largest;
            let orbits = &self.branch.orbits;
            let top = (0..orbits.len()).fold(0, |top, k| if size(&orbits[k]) > size(&orbits[top]) { k } else { top });
            let Some(highest) = orbits.get(top).cloned() else { continue };
            let around = match orbits.get(top.wrapping_sub(1)..top + 2) {
                Some([a, b, c]) => Some([a, b, c].map(point_of)),
                _ => None,
            };
            let located = around.and_then(|points| self.peak_among(reading, points));
            self.branch.peaks.push(located.unwrap_or(highest));
        }
    }

    /// The largest motion between three points whose middle one is the largest, by parabolas through three; none if it
    /// is that of the middle point.
    fn peak_among(&mut self, reading: usize, mut points: [Point; 3]) -> Option<Orbit> {
        let harmonics = self.balance.harmonics();
        let needed = points.iter().map(|point| point.x.len()).max()? / self.balance.unknowns.count() / 2;
        self.balance.set_harmonics(needed);
        let mut sizes = points.clone().map(|point| self.orbit(&point).readings[reading].largest);
        let mut best = None;
        let span = points[2].arclength - points[0].arclength;
        for _ in 0..PEAK.0 {
            let s = [0, 1, 2].map(|i| points[i].arclength);
            let slopes = [(sizes[1] - sizes[0]) / (s[1] - s[0]), (sizes[2] - sizes[1]) / (s[2] - s[1])];
            let curvature = (slopes[1] - slopes[0]) / (s[2] - s[0]);
            let at = s[1] - 0.5 * (slopes[0] + curvature * (s[1] - s[0])) / curvature;
            if !(curvature < 0.0 && at > s[0] && at < s[2] && (at - s[1]).abs() > PEAK.1 * span) {
                break;
            }
            let half = usize::from(at > s[1]);
            let ends = [&points[half], &points[half + 1]];
            let settings = &self.options.branch.continuation;
            let mut slices = Slices::new(self.balance.dimension(), settings, ends, Cut::Chord);
            let fraction = (at - s[half]) / (s[half + 1] - s[half]);
            let Ok(point) = slices.solve(&mut self.balance, ends, fraction) else { break };
            let orbit = self.orbit(&point);
            let size = orbit.readings[reading].largest;
            let outer = if size > sizes[1] { 2 * (1 - half) } else { 2 * half };
            if size > sizes[1] {
                points.swap(outer, 1);
                sizes.swap(outer, 1);
                (points[1], sizes[1], best) = (point, size, Some(orbit));
            } else {
                (points[outer], sizes[outer]) = (point, size);
            }
        }
        self.balance.set_harmonics(harmonics);
        best
    }
}

/// The point of an orbit, without its tangent.
pub(super) fn point_of(orbit: &Orbit) -> Point {
    Point {
        x: orbit.coefficients.clone(),
        lambda: orbit.value,
        arclength: orbit.arclength,
        tangent: alloc::vec![],
        determinant: Determinant::default(),
    }
}
