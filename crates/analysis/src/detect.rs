//! Finds bifurcations between the points of a branch.
//!
//! Each kind of bifurcation has a test function that changes sign at it. A change between two points locates one. Two
//! of a kind between two points leave the sign unchanged, but the function comes near zero between them, so a smallest
//! magnitude at the middle of three points is followed down.

use alloc::vec;
use alloc::vec::Vec;

use super::adapt::Spectral;
use super::branch::{Marked, Tracer};
use super::continuation::{ContinuationSettings, Cut, Point, Slices, System, Work, not_located};
use super::extended::{Singularity, crossing};
use super::floquet::Stability;
use super::locate::{COARSE, FINE, branch_point, null_vector, polish, rejoin, search};
use super::orbit::{Bifurcation, BifurcationKind};
use super::{AnalysisError, Floquet, ForcedResponse, Oscillator};

use BifurcationKind::{BranchPoint, Fold, NeimarkSacker, PeriodDoubling};

/// A branch of doubled period meets the single one in a segment if it does so within this distance of its end, in units
/// of Λ.
const REACH: f64 = 0.1;
/// The most steps down to a smallest magnitude.
const DESCENT_LIMIT: usize = 8;
/// Steps before a parabola through the points is trusted: the first points are far apart.
const DESCENT_LEAST: usize = 3;
/// The descent ends when a parabola promises less than this fraction of the value.
const PROMISE: f64 = 0.2;

/// dλ along the branch: zero at a fold.
fn direction(point: &Point) -> f64 {
    point.tangent.last().copied().unwrap_or(0.0)
}

/// The test function of a kind at a point.
fn value(kind: BifurcationKind, point: &Point, stability: &Stability) -> f64 {
    match kind {
        BranchPoint => point.determinant.sign,
        Fold => direction(point),
        PeriodDoubling => stability.period_doubling_test(),
        NeimarkSacker => stability.neimark_sacker_test(),
    }
}

/// The same at a point whose stability is not known.
fn test<O: Oscillator>(
    kind: BifurcationKind,
    response: &mut ForcedResponse<O>,
    floquet: &mut Floquet,
    point: &Point,
) -> f64 {
    if kind == Fold {
        return direction(point);
    }
    let coordinate = response.coordinate();
    let balance = response.balance_mut();
    if !balance.set_coordinate(coordinate, point.lambda) {
        return f64::NAN;
    }
    value(kind, point, &floquet.stability(balance, &point.x))
}

fn crosses(values: [f64; 2]) -> bool {
    values[0] * values[1] < 0.0
}

impl<O: Oscillator + Clone> Tracer<'_, O> {
    /// Locates the bifurcations between two neighbouring points, and a possible pair near the first of them.
    pub fn detect(&mut self, older: Option<&Marked>, a: &Marked, b: &Marked) -> Result<(), AnalysisError> {
        let turned = crosses([a, b].map(|marked| marked.point.determinant.sign));
        for kind in [BranchPoint, Fold, PeriodDoubling, NeimarkSacker] {
            let at = |marked: &Marked| value(kind, &marked.point, &marked.orbit.stability);
            let values = [at(a), at(b)];
            if crosses(values) {
                // A branch that ends on another one turns back there: a branch point, not a fold.
                if !(kind == Fold && turned) {
                    self.locate(kind, [&a.point, &b.point], values)?;
                }
            } else if let Some(older) = older.filter(|_| kind != BranchPoint) {
                let values = [at(older), values[0], values[1]];
                if !crosses([values[0], values[1]]) {
                    self.descend(kind, [&older.point, &a.point, &b.point], values)?;
                }
            }
        }
        Ok(())
    }

    /// If the magnitude is smallest at the middle one of three points, follows it down by parabolas; if the sign
    /// changes on the way, locates the bifurcations on both sides.
    fn descend(&mut self, kind: BifurcationKind, points: [&Point; 3], values: [f64; 3]) -> Result<(), AnalysisError> {
        let sign = values[1].signum();
        let mut f = values.map(|value| value * sign);
        let mut points = points.map(Clone::clone);
        for step in 0..DESCENT_LIMIT {
            let s = [0, 1, 2].map(|i| points[i].arclength);
            let Some((lowest, promised)) = vertex(s, f) else { return Ok(()) };
            if step >= DESCENT_LEAST && promised > (1.0 - PROMISE) * f[1] {
                return Ok(());
            }
            let half = usize::from(lowest > s[1]);
            let ends = [&points[half], &points[half + 1]];
            let mut slices = Slices::new(self.response.dimension(), &self.options.continuation, ends, Cut::Chord);
            let fraction = (lowest - s[half]) / (s[half + 1] - s[half]);
            let point = slices.solve_beside(&mut self.response, ends, fraction)?;
            let new = sign * test(kind, &mut self.response, &mut self.floquet, &point);
            if new < 0.0 {
                self.locate(kind, [&points[half], &point], [sign * f[half], sign * new])?;
                return self.locate(kind, [&point, &points[half + 1]], [sign * new, sign * f[half + 1]]);
            }
            // Keeps three points with the lowest in the middle: the new one becomes the middle or an outer one.
            let outer = if new < f[1] { 2 * (1 - half) } else { 2 * half };
            if new < f[1] {
                points.swap(outer, 1);
                f.swap(outer, 1);
                (points[1], f[1]) = (point, new);
            } else {
                (points[outer], f[outer]) = (point, new);
            }
        }
        Ok(())
    }

    /// Locates a bifurcation between two points of the branch.
    fn locate(&mut self, kind: BifurcationKind, ends: [&Point; 2], values: [f64; 2]) -> Result<(), AnalysisError> {
        let (point, null_vector) = match kind {
            BranchPoint => (self.crossing(ends)?, vec![]),
            Fold => self.singular(Singularity::Fold, kind, ends, values)?,
            PeriodDoubling => self.singular(Singularity::PeriodDoubling, kind, ends, values)?,
            NeimarkSacker => {
                let solve = |response: &_, settings: &_, guess: &_| {
                    crossing::neimark_sacker(response, settings, guess).map(|(point, work)| (point, vec![], work))
                };
                (self.by_extended_system(kind, ends, values, solve)?.0, vec![])
            }
        };
        let orbit = self.orbit(&point.x, point.lambda, point.arclength);
        if kind != NeimarkSacker || has_pair_on_the_circle(&orbit.stability) {
            self.branch.bifurcations.push(Bifurcation { kind, orbit, index: 0, null_vector });
        }
        Ok(())
    }

    /// The point where the test function is zero, by a search along the branch.
    fn zero(
        &mut self,
        kind: BifurcationKind,
        ends: [&Point; 2],
        values: [f64; 2],
        tolerance: f64,
    ) -> Result<Point, AnalysisError> {
        let floquet = &mut self.floquet;
        let function = |response: &mut ForcedResponse<O>, point: &Point| test(kind, response, floquet, point);
        search(&mut self.response, &self.options.continuation, ends, values, tolerance, function)
    }

    /// A fold or a period doubling, with its null vector.
    fn singular(
        &mut self,
        singularity: Singularity,
        kind: BifurcationKind,
        ends: [&Point; 2],
        values: [f64; 2],
    ) -> Result<(Point, Vec<f64>), AnalysisError> {
        let solve = |response: &_, settings: &_, guess: &Point| {
            let located = polish(response, settings, singularity, guess)?;
            let null_vector = located.singular.null_vector().to_vec();
            Ok((Point { x: located.x, lambda: located.lambda, ..guess.clone() }, null_vector, located.work))
        };
        let (point, found) = self.by_extended_system(kind, ends, values, solve)?;
        let null_vector = match found {
            Some(null_vector) => null_vector,
            None => null_vector(&self.response, &self.options.continuation, singularity, &point)?,
        };
        Ok((point, null_vector))
    }

    /// A bifurcation by its extended system, from a coarse search, or from a fine one if that converges elsewhere: to
    /// the other of a close pair. If this fails too, the result is that of the fine search, without a null vector.
    fn by_extended_system(
        &mut self,
        kind: BifurcationKind,
        ends: [&Point; 2],
        values: [f64; 2],
        solve: impl Fn(&ForcedResponse<O>, &ContinuationSettings, &Point) -> Result<(Point, Vec<f64>, Work), AnalysisError>,
    ) -> Result<(Point, Option<Vec<f64>>), AnalysisError> {
        let settings = &self.options.continuation;
        let mut last = None;
        for tolerance in [COARSE, FINE] {
            let guess = self.zero(kind, ends, values, tolerance)?;
            if let Ok((point, null_vector, work)) = solve(&self.response, settings, &guess) {
                self.branch.location_work += work;
                let size = self.response.dimension().max(point.x.len());
                if Slices::new(size, settings, ends, Cut::Chord).hold(ends, &point) {
                    return Ok((point, Some(null_vector)));
                }
            }
            last = Some(guess);
        }
        let point = last.ok_or_else(|| not_located(&self.response, ends))?;
        Ok((point, None))
    }

    /// A branch point: for a branch of doubled period first where it meets the single one.
    fn crossing(&mut self, ends: [&Point; 2]) -> Result<Point, AnalysisError> {
        let settings = &self.options.continuation;
        if self.response.balance().subharmonic() == 2 {
            let end = ends[1];
            let reach = REACH * settings.lambda_scale(end.lambda);
            let joint = rejoin(&self.response, settings, end).ok();
            if let Some(point) = joint.filter(|point| (point.lambda - end.lambda).abs() <= reach) {
                self.rejoined = true;
                return Ok(point);
            }
        }
        let (point, work) = branch_point(&self.response, settings, ends)?;
        self.branch.location_work += work;
        Ok(point)
    }
}

/// The minimum of the parabola through three points, between the outer two, and its place; none if there is none, or if
/// it is practically the middle point.
fn vertex(s: [f64; 3], f: [f64; 3]) -> Option<(f64, f64)> {
    if f[1] > f[0] || f[1] > f[2] || f[1] <= 0.0 {
        return None;
    }
    let slopes = [(f[1] - f[0]) / (s[1] - s[0]), (f[2] - f[1]) / (s[2] - s[1])];
    let curvature = (slopes[1] - slopes[0]) / (s[2] - s[0]);
    if curvature.is_nan() || curvature <= 0.0 {
        return None;
    }
    let at_middle = slopes[0] + curvature * (s[1] - s[0]);
    let lowest = s[1] - 0.5 * at_middle / curvature;
    let margin = 1e-6 * (s[2] - s[0]);
    let inside = lowest > s[0] + margin && lowest < s[2] - margin && (lowest - s[1]).abs() > margin;
    inside.then(|| (lowest, f[1] - 0.25 * at_middle * at_middle / curvature))
}

/// Whether a pair of multipliers is on the unit circle, and not at ±1: the test function also vanishes where the
/// product of two real multipliers is 1.
fn has_pair_on_the_circle(stability: &Stability) -> bool {
    stability.multipliers.iter().any(|mu| mu.im.abs() > 1e-6 && (mu.norm_sqr() - 1.0).abs() < 2e-6)
}
