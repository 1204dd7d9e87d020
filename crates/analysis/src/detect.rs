//! Finds bifurcations and peaks between the points of a branch.
//!
//! Each kind of bifurcation has a test function that changes sign at it, and not where multipliers meet: of a fold dλ
//! along the branch, of a branch point the bordered determinant, and of the others, with the multipliers μ (Y. A.
//! Kuznetsov, "Elements of Applied Bifurcation Theory", 2004, Ch. 10),
//!
//! ```text
//! period doubling     Π (μᵢ + 1)
//! Neimark–Sacker      Π (μᵢμⱼ − 1) over i < j
//! ```
//!
//! of which the sign counts, and of the magnitude only that of the least factor: the products of many modes leave the
//! range of numbers. The second also vanishes where two real multipliers have the product 1.
//!
//! A change between two points locates one bifurcation; two of a kind close together are found by [`Tracer::descend`].
//!
//! A factor below [`ROUNDING`] has no sign: without damping |μ|² − 1 of every pair is 0 all along the branch, and its
//! sign is rounding. Such factors are left out; if no other is left, no bifurcation is found at the response.

use alloc::vec::Vec;

use nalgebra::Complex;

use super::balance::Balance;
use super::branch::{FRACTION, Tracer, along};
use super::crossing::{Crossing, crossing};
use super::floquet::Floquet;
use super::orbit::{Bifurcation, Orbit, ROUNDING, Stability, Unlocated};
use super::singular::{Singular, Singularity};
use crate::branch_options::BifurcationKind;
use crate::continuation::{Cut, Point, Slices, System};
use crate::dense::Determinant;
use crate::error::AnalysisError;
use crate::search::{FINE, search};

use BifurcationKind::{BranchPoint, Fold, NeimarkSacker, PeriodDoubling};

/// Multipliers with a smaller imaginary part are real.
const REAL: f64 = 1e-9;
/// At a bifurcation of the response a multiplier is this near its place on the unit circle.
const NEAR: f64 = 5e-3;
/// Multipliers say nothing if the accuracy of the largest is worse than this fraction of it, or of 1.
const MOST_UNCERTAIN: f64 = 0.1;
/// The most steps down to a smallest magnitude.
const DESCENT_LIMIT: usize = 8;
/// Steps before a parabola through the points is trusted: the first points are far apart.
const DESCENT_LEAST: usize = 3;
/// The descent ends when a parabola promises less than this fraction of the value.
const PROMISE: f64 = 0.2;
/// The secant rule on the distance of a pair from the unit circle: its first step and its last one, as fractions of a
/// segment, and the most steps.
const FIRST_SECANT: f64 = 1e-3;
const LAST_SECANT: f64 = 1e-13;
const SECANT_LIMIT: usize = 12;
/// A pair is on the unit circle if |μ|² is 1 within this.
const CIRCLE: f64 = 1e-13;
/// The most steps of the search for a peak, and the fraction of its interval at which it ends.
const PEAK: (usize, f64) = (8, 1e-5);
/// A branch point is approached to this fraction of its segment before its own equations are solved.
const BESIDE: f64 = 1e-3;

/// A bifurcation between two points.
struct Crossed {
    point: Point,
    /// Whether it solves equations of its own, which only a branch point does.
    is_exact: bool,
    /// Whether the branch turns back there.
    turns_back: bool,
}

/// Returns the direction from a to b, dX and last dλ, with n components of X.
pub(super) fn chord(a: &Point, b: &Point, n: usize) -> Vec<f64> {
    let component = |of: &Point, i: usize| of.x.get(i).copied().unwrap_or(0.0);
    (0..n).map(|i| component(b, i) - component(a, i)).chain([b.lambda - a.lambda]).collect()
}

/// The sign of a product of real factors times the magnitude of its least, of those that have a sign; zero if none has
/// one, and not a number without factors.
fn signed_least(factors: impl Iterator<Item = f64>) -> f64 {
    let product = |(sign, least): (f64, f64), factor: f64| match factor.abs() {
        size if size < ROUNDING => (sign, least),
        size => (if factor < 0.0 { -sign } else { sign }, size.min(least)),
    };
    let mut factors = factors.peekable();
    let any = factors.peek().is_some();
    let (sign, least) = factors.fold((1.0, f64::INFINITY), product);
    match any {
        true if least == f64::INFINITY => 0.0,
        true => sign * least,
        false => f64::NAN,
    }
}

/// μᵢμⱼ − 1 of every pair of conjugates, with one of them, and of every two real ones. The others come in conjugates,
/// whose product is positive.
fn pairs(of: &[Complex<f64>]) -> impl Iterator<Item = (Complex<f64>, f64)> + '_ {
    let conjugates = of.iter().filter(|mu| mu.im > 0.0).map(|mu| (*mu, mu.norm_sqr() - 1.0));
    let of_reals = |(i, mu): (usize, &Complex<f64>)| {
        let (mu, others) = (*mu, if mu.im == 0.0 { &of[i + 1..] } else { &[] });
        others.iter().filter(|other| other.im == 0.0).map(move |other| (mu, mu.re * other.re - 1.0))
    };
    conjugates.chain(of.iter().enumerate().flat_map(of_reals))
}

/// The multipliers, if they are known and say where they are; otherwise none.
fn known_multipliers(stability: Option<&Stability>) -> &[Complex<f64>] {
    let Some(stability) = stability else { return &[] };
    let largest = stability.multipliers.first().map_or(0.0, |mu| libm::sqrt(mu.norm_sqr()));
    if stability.accuracy < MOST_UNCERTAIN * largest.max(1.0) { &stability.multipliers } else { &[] }
}

/// The test function of a kind; not a number if the multipliers that it needs are not known.
fn value(kind: BifurcationKind, point: &Point, stability: Option<&Stability>, reference: Determinant) -> f64 {
    let multipliers = known_multipliers(stability);
    match kind {
        // Over a determinant nearby, since the values themselves leave the range of numbers.
        BranchPoint => point.determinant.sign * libm::exp(point.determinant.log_magnitude - reference.log_magnitude),
        Fold => point.tangent.last().copied().unwrap_or(0.0),
        PeriodDoubling => {
            // Of two conjugates the product is positive.
            let factor = |mu: &Complex<f64>| if mu.im == 0.0 { mu.re + 1.0 } else { libm::sqrt((mu + 1.0).norm_sqr()) };
            signed_least(multipliers.iter().map(factor))
        }
        NeimarkSacker => signed_least(pairs(multipliers).map(|(_, factor)| factor)),
    }
}

/// Returns the test function of a kind at a point whose stability is not known.
fn test(
    floquet: &mut Floquet,
    balance: &mut Balance,
    kind: BifurcationKind,
    point: &Point,
    reference: Determinant,
) -> f64 {
    // The tangent and the determinant of the point tell of these, so that no multipliers are computed.
    let known = matches!(kind, Fold | BranchPoint);
    let found = if known || !balance.set_value(point.lambda) { None } else { floquet.stability(balance, &point.x) };
    value(kind, point, found.as_ref(), reference)
}

/// Pairs of multipliers whose product is 1 but for rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Marginal {
    pairs: usize,
    /// Those of them that are conjugates.
    conjugates: usize,
}

impl Marginal {
    fn of(stability: Option<&Stability>) -> Marginal {
        let multipliers = stability.map_or(&[][..], |stability| &stability.multipliers);
        let count = |Marginal { pairs, conjugates }, (mu, _): (Complex<f64>, f64)| Marginal {
            pairs: pairs + 1,
            conjugates: conjugates + usize::from(is_complex(mu)),
        };
        pairs(multipliers).filter(|(_, factor)| factor.abs() < ROUNDING).fold(Marginal::default(), count)
    }
}

fn is_complex(mu: Complex<f64>) -> bool {
    mu.im.abs() > REAL
}

/// Says whether the multipliers at a bifurcation are those of its kind. `before` are the pairs that also have the
/// product 1 at the response before it.
fn confirmed(kind: BifurcationKind, stability: Option<&Stability>, before: Marginal) -> bool {
    let multipliers = known_multipliers(stability);
    let any = |at: f64| multipliers.iter().any(|mu| (mu - at).norm_sqr() < NEAR * NEAR);
    match kind {
        Fold => true,
        BranchPoint => any(1.0),
        PeriodDoubling => any(-1.0),
        NeimarkSacker => {
            let mut by_distance: Vec<_> = pairs(multipliers).collect();
            by_distance.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
            // Beside the pairs that have the product 1 all along, one more must have come to it.
            let near = by_distance.iter().take(before.pairs + 1).filter(|(_, factor)| factor.abs() < NEAR);
            near.filter(|(mu, _)| is_complex(*mu)).count() > before.conjugates
        }
    }
}

/// Says whether a test function has changed its sign; false if a value is unknown.
fn crosses([a, b]: [f64; 2]) -> bool {
    a * b < 0.0
}

/// The minimum of the parabola through three points, between the outer two, and its place; none if there is none, or if
/// it is practically the middle point.
fn vertex(s: [f64; 3], f: [f64; 3]) -> Option<Vertex> {
    let is_least = f[1] <= f[0] && f[1] <= f[2] && f[1] > 0.0;
    let slopes = [(f[1] - f[0]) / (s[1] - s[0]), (f[2] - f[1]) / (s[2] - s[1])];
    let curvature = (slopes[1] - slopes[0]) / (s[2] - s[0]);
    if !(is_least && curvature > 0.0) {
        return None;
    }
    let at_middle = slopes[0] + curvature * (s[1] - s[0]);
    let at = s[1] - 0.5 * at_middle / curvature;
    // A vertex that is practically one of the three points would not narrow them.
    let margin = 1e-6 * (s[2] - s[0]);
    let is_inside = at > s[0] + margin && at < s[2] - margin && (at - s[1]).abs() > margin;
    is_inside.then(|| Vertex { at, value: f[1] - 0.25 * at_middle * at_middle / curvature })
}

/// The lowest point of a parabola.
struct Vertex {
    at: f64,
    value: f64,
}

impl Tracer<'_> {
    /// Locates the bifurcations between the last two points of the branch, a and b, and pairs of one kind beside a, of
    /// which `older` is the point before; records those that can't be located.
    pub fn detect(&mut self, older: Option<&Point>, a: &Point, b: &Point) {
        let [.., before, after] = self.branch.orbits.as_slice() else { return };
        let stabilities = [before.stability.clone(), after.stability.clone()];
        let earlier = older.and_then(|older| Some((older, self.branch.orbits.iter().nth_back(2)?.stability.clone())));
        let assessed = stabilities[0].is_some();
        for kind in [BranchPoint, Fold, PeriodDoubling, NeimarkSacker] {
            // A branch that ends on another one turns back there: a branch point, not a fold.
            if kind == Fold && !self.rejoined {
                self.meet([a, b]);
            }
            if (kind != Fold && !assessed) || (kind == Fold && self.rejoined) {
                continue;
            }
            let reference = a.determinant;
            let at = |point: &Point, stability: &Option<Stability>| value(kind, point, stability.as_ref(), reference);
            let values = [at(a, &stabilities[0]), at(b, &stabilities[1])];
            let marginal = Marginal::of(stabilities[0].as_ref());
            if crosses(values) {
                self.find(kind, [a, b], values, marginal);
            } else if let Some((older, stability)) = earlier.as_ref().filter(|_| kind != BranchPoint) {
                let values = [at(older, stability), values[0], values[1]];
                // Where forces aren't smooth the multipliers jump, so that their test functions have no minimum to
                // follow.
                let smooth = self.balance.forced.assembly().is_smooth();
                if (smooth || kind == Fold) && !crosses([values[0], values[1]]) {
                    self.descend(kind, [older, a, b], values, marginal);
                }
            }
        }
    }

    /// Ends the branch between two points if it has there the symmetry again that it has lost, which forces that aren't smooth may
    /// hide from the determinant: its part without the symmetry changes its sign, and the branch turns back.
    fn meet(&mut self, ends: [&Point; 2]) {
        let Some(lost) = self.lost.as_ref() else { return };
        let along = |point: &Point| along(lost, &point.x);
        let values = ends.map(along);
        let slopes = ends.map(|end| end.tangent.last().copied().unwrap_or(0.0));
        if !(crosses(values) && crosses(slopes)) {
            return;
        }
        let settings = &self.options.branch.continuation;
        let Ok(point) = search(&mut self.balance, settings, ends, values, FINE, |_, point| along(point)) else {
            return;
        };
        let orbit = self.orbit(&point);
        let is_before = |found: &Bifurcation| found.kind != BranchPoint || found.orbit.arclength < ends[0].arclength;
        self.branch.bifurcations.retain(is_before);
        self.branch.bifurcations.push(Bifurcation { kind: BranchPoint, orbit, index: 0 });
        self.rejoined = true;
    }

    /// Locates two bifurcations of a kind between two points. They leave the sign of the test function as it is, but
    /// the function comes near zero between them. So if its magnitude is smallest at the middle one of three points, it
    /// is followed down by parabolas; if the sign changes on the way, the bifurcations on both sides are located.
    fn descend(&mut self, kind: BifurcationKind, points: [&Point; 3], values: [f64; 3], marginal: Marginal) {
        let sign = values[1].signum();
        let mut f = values.map(|value| value * sign);
        let mut points = points.map(Clone::clone);
        for step in 0..DESCENT_LIMIT {
            let s = [0, 1, 2].map(|i| points[i].arclength);
            let Some(lowest) = vertex(s, f) else { return };
            if step >= DESCENT_LEAST && lowest.value > (1.0 - PROMISE) * f[1] {
                return;
            }
            let half = usize::from(lowest.at > s[1]);
            let ends = [&points[half], &points[half + 1]];
            let settings = &self.options.branch.continuation;
            let mut slices = Slices::new(self.balance.dimension(), settings, ends, Cut::Chord);
            let fraction = (lowest.at - s[half]) / (s[half + 1] - s[half]);
            let Ok(point) = slices.solve_beside(&mut self.balance, ends, fraction) else { return };
            let new = sign * test(&mut self.floquet, &mut self.balance, kind, &point, point.determinant);
            if new < 0.0 {
                let before = points[half].clone();
                let after = points[half + 1].clone();
                self.find(kind, [&before, &point], [sign * f[half], sign * new], marginal);
                return self.find(kind, [&point, &after], [sign * new, sign * f[half + 1]], marginal);
            }
            // Keeps three points with the lowest in the middle: the new one becomes the middle or an outer one.
            let outer = if new < f[1] { 2 * (1 - half) } else { 2 * half };
            if new < f[1] {
                points.swap(outer, 1);
                f.swap(outer, 1);
                points[1] = point;
                f[1] = new;
            } else {
                points[outer] = point;
                f[outer] = new;
            }
        }
    }

    /// Locates the bifurcation between two points at which the test function of its kind has these values, of opposite
    /// signs; records it if it can't be located.
    fn find(&mut self, kind: BifurcationKind, ends: [&Point; 2], values: [f64; 2], marginal: Marginal) {
        let located = match kind {
            BranchPoint => self.crossing(ends, values),
            _ => self
                .locate(kind, ends, values, FRACTION)
                .map(|found| found.map(|point| Crossed { point, is_exact: false, turns_back: false })),
        };
        let Crossed { point, is_exact, turns_back } = match located {
            Ok(Some(located)) => located,
            Ok(None) => return,
            Err(_) => {
                let index = self.branch.orbits.partition_point(|orbit| orbit.arclength <= ends[0].arclength);
                self.branch.unlocated.push(Unlocated { kind, between: ends.map(|end| end.lambda), index });
                return;
            }
        };
        let point = match kind {
            PeriodDoubling => self.doubling(ends, &point).unwrap_or(point),
            NeimarkSacker => self.on_the_circle(ends, &point, marginal).unwrap_or(point),
            _ => point,
        };
        // Where a branch meets responses of fewer periods, or with the symmetry that it has lost, it turns back: to its own
        // responses, shifted or mirrored.
        let is_met = kind == BranchPoint && self.is_simpler(&point);
        let orbit = self.orbit(&point);
        if is_exact || is_met || confirmed(kind, orbit.stability.as_ref(), marginal) {
            self.rejoined |= is_met || (self.is_switched && turns_back);
            self.branch.bifurcations.push(Bifurcation { kind, orbit, index: 0 });
        }
    }

    /// Returns the Neimark–Sacker point near a point that the test function has led to, where the pair of multipliers
    /// nearest to the unit circle is on it but for rounding: |μ|² − 1 of that pair has a slope there along the branch,
    /// so that the secant rule finds its zero in a few responses. `None` if that leads elsewhere, or if the multipliers
    /// jump, as those of forces that aren't smooth.
    fn on_the_circle(&mut self, ends: [&Point; 2], point: &Point, marginal: Marginal) -> Option<Point> {
        if !self.balance.forced.assembly().is_smooth() {
            return None;
        }
        let settings = &self.options.branch.continuation;
        let mut slices = Slices::new(self.balance.dimension(), settings, ends, Cut::Chord);
        let multipliers = self.multipliers_at(point)?;
        let mut by_distance: Vec<_> = pairs(&multipliers).collect();
        by_distance.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        // Beyond those that are on the circle all along the branch.
        let (mut mu, mut off) = *by_distance.get(marginal.pairs).filter(|(mu, _)| is_complex(*mu))?;
        let mut at = (point.arclength - ends[0].arclength) / (ends[1].arclength - ends[0].arclength);
        let mut next = at + if at < 0.5 { FIRST_SECANT } else { -FIRST_SECANT };
        for _ in 0..SECANT_LIMIT {
            let found = slices.solve(&mut self.balance, ends, next).ok()?;
            let multipliers = self.multipliers_at(&found)?;
            let conjugates = multipliers.iter().filter(|mu| mu.im > REAL);
            // The pair is the one nearest to where it was before: others may be as near to the circle.
            mu = *conjugates.min_by(|a, b| (*a - mu).norm_sqr().total_cmp(&(*b - mu).norm_sqr()))?;
            let moved = next - at;
            let new = mu.norm_sqr() - 1.0;
            if moved.abs() < LAST_SECANT || new.abs() < CIRCLE {
                return (0.0..=1.0).contains(&next).then_some(found);
            }
            let slope = (new - off) / moved;
            at = next;
            off = new;
            next = at - off / slope;
            if !next.is_finite() {
                return None;
            }
        }
        None
    }

    /// Returns the multipliers of the response at a point of the branch.
    fn multipliers_at(&mut self, point: &Point) -> Option<Vec<Complex<f64>>> {
        let exists = self.balance.set_value(point.lambda);
        let found = if exists { self.floquet.stability(&self.balance, &point.x) } else { None };
        found.map(|stability| stability.multipliers)
    }

    /// Returns the period doubling near a point that the multipliers have led to, by its extended system; `None` if that
    /// leads elsewhere, or the forces aren't smooth.
    fn doubling(&self, ends: [&Point; 2], point: &Point) -> Option<Point> {
        let settings = &self.options.branch.continuation;
        let mut balance = self.balance.clone();
        balance.set_harmonics((point.x.len() / balance.unknowns.count() - 1) / 2);
        if !(balance.forced.assembly().is_smooth() && balance.set_value(point.lambda)) {
            return None;
        }
        let (singular, z, _) = Singular::solved(&balance, Singularity::PeriodDoubling, settings, &point.x).ok()?;
        let (lambda, x) = singular.split(&z);
        let located = Point { x: x.to_vec(), lambda, ..point.clone() };
        let size = self.balance.dimension().max(located.x.len());
        Slices::new(size, settings, ends, Cut::Chord).hold(ends, &located).then_some(located)
    }

    /// Says whether the branch has a branch point between two points.
    pub fn has_branch_point(&mut self, a: &Point, b: &Point) -> bool {
        let values = [a, b].map(|point| value(BranchPoint, point, None, a.determinant));
        let found = if crosses(values) { self.crossing([a, b], values).ok().flatten() } else { None };
        let Some(Crossed { point, is_exact, .. }) = found else { return false };
        let stability = |tracer: &mut Self| tracer.floquet.stability(&tracer.balance, &point.x);
        is_exact || confirmed(BranchPoint, self.at(&point, stability).as_ref(), Marginal::default())
    }

    /// Returns the branch point between two points at which the determinant has these values, of opposite signs; `None`
    /// if the branch has none there, or the determinant jumps.
    fn crossing(&mut self, ends: [&Point; 2], values: [f64; 2]) -> Result<Option<Crossed>, AnalysisError> {
        let settings = self.options.branch.continuation;
        let smooth = self.balance.forced.assembly().is_smooth();
        if let Some(near) = self.locate(BranchPoint, ends, values, BESIDE)? {
            match self.crossing_near(ends, &near) {
                Ok(Some((found, turns_back))) => {
                    let point = Point { x: found.x, lambda: found.lambda, ..near };
                    let size = self.balance.dimension().max(point.x.len());
                    if Slices::new(size, &settings, ends, Cut::Chord).hold(ends, &point) {
                        return Ok(Some(Crossed { point, is_exact: true, turns_back }));
                    }
                }
                Ok(None) if smooth => return Ok(None),
                Ok(None) | Err(_) => {}
            }
        }
        let turns_back = crosses(ends.map(|end| end.tangent.last().copied().unwrap_or(0.0)));
        let located = self.locate(BranchPoint, ends, values, FINE)?;
        Ok(located.map(|point| Crossed { point, is_exact: false, turns_back }))
    }

    /// Returns the branch point near a point between two others by its extended system, and whether this branch turns
    /// back there; `None` if no branches cross there.
    fn crossing_near(&mut self, [a, b]: [&Point; 2], near: &Point) -> Result<Option<(Crossing, bool)>, AnalysisError> {
        let mut balance = self.balance.clone();
        balance.set_harmonics(near.x.len() / balance.unknowns.count() / 2);
        if !balance.set_value(near.lambda) {
            return Ok(None);
        }
        let direction = chord(a, b, near.x.len());
        let found = crossing(&balance, &self.options.branch.continuation, &near.x, &direction)?;
        Ok(found.map(|found| {
            let direction = chord(a, b, found.x.len());
            let turns_back = found.turns_back(found.along(&direction));
            (found, turns_back)
        }))
    }

    /// Returns where the test function of a kind vanishes between two points at which it has these values, of opposite
    /// signs, to a fraction of the segment; `None` if it jumps there.
    fn locate(
        &mut self,
        kind: BifurcationKind,
        ends: [&Point; 2],
        values: [f64; 2],
        tolerance: f64,
    ) -> Result<Option<Point>, AnalysisError> {
        let floquet = &mut self.floquet;
        let reference = ends[0].determinant;
        let test = |balance: &mut Balance, point: &Point| test(floquet, balance, kind, point, reference);
        let settings = &self.options.branch.continuation;
        let smooth = self.balance.forced.assembly().is_smooth();
        match search(&mut self.balance, settings, ends, values, tolerance, test) {
            Ok(point) => Ok(Some(point)),
            // At a corner of a branch the determinant and the multipliers may jump.
            Err(_) if kind != Fold && !smooth => Ok(None),
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
                Some([a, b, c]) => Some(([a, b, c].map(point_of), [a, b, c].map(size))),
                _ => None,
            };
            let located = around.and_then(|(points, sizes)| self.peak_among(reading, points, sizes));
            let peak = located.map_or(highest, |point| self.orbit(&point));
            self.branch.peaks.push(peak);
        }
    }

    /// Locates the maxima of a reading that lie between the points of the branch, in order.
    pub fn located_maxima(&mut self, reading: usize) -> Vec<Point> {
        let sizes: Vec<f64> = self.branch.orbits.iter().map(|orbit| orbit.readings[reading].largest).collect();
        let is_maximum = |k: &usize| sizes[*k] > sizes[k - 1] && sizes[*k] >= sizes[k + 1];
        let mut found = Vec::new();
        for k in (1..sizes.len().saturating_sub(1)).filter(is_maximum) {
            let points = [k - 1, k, k + 1].map(|k| point_of(&self.branch.orbits[k]));
            found.extend(self.peak_among(reading, points, [sizes[k - 1], sizes[k], sizes[k + 1]]));
        }
        found
    }

    /// Returns the largest response between three points of these sizes, whose middle one is the largest, by parabolas
    /// through three; `None` if it is that of the middle point.
    fn peak_among(&mut self, reading: usize, mut points: [Point; 3], mut sizes: [f64; 3]) -> Option<Point> {
        let harmonics = self.balance.harmonics();
        // The points may have different numbers of harmonics: the most of them describes all three.
        let needed = points.iter().map(|point| point.x.len()).max()? / self.balance.unknowns.count() / 2;
        self.balance.set_harmonics(needed);
        let dof = self.options.read[reading];
        let mut found = false;
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
            let size = self.largest_at(&point, dof);
            let outer = if size > sizes[1] { 2 * (1 - half) } else { 2 * half };
            if size > sizes[1] {
                points.swap(outer, 1);
                sizes.swap(outer, 1);
                points[1] = point;
                sizes[1] = size;
                found = true;
            } else {
                points[outer] = point;
                sizes[outer] = size;
            }
        }
        self.balance.set_harmonics(harmonics);
        let [_, middle, _] = points;
        found.then_some(middle)
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

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::super::branch::Tracer;
    use super::super::tests::{modal, oracles};
    use super::super::{Coordinate, Forced, TraceOptions};
    use super::*;

    fn tests_of(multipliers: &[[f64; 2]]) -> [f64; 2] {
        let multipliers: Vec<_> = multipliers.iter().map(|[re, im]| Complex::new(*re, *im)).collect();
        let stability = Stability { multipliers, accuracy: 0.0, conservative: false };
        let point =
            Point { x: vec![], lambda: 0.0, arclength: 0.0, tangent: vec![], determinant: Determinant::default() };
        [PeriodDoubling, NeimarkSacker].map(|kind| value(kind, &point, Some(&stability), Determinant::default()))
    }

    /// Two real multipliers that become a pair, or the other way round, are no bifurcation, on either side of the unit
    /// circle and of its centre.
    #[test]
    fn tests_do_not_jump_where_multipliers_meet() {
        for at in [1.01, 0.99, -1.01, -0.99] {
            let [apart, together] = [[[at + 1e-6, 0.0], [at - 1e-6, 0.0]], [[at, 1e-6], [at, -1e-6]]]
                .map(|[a, b]| tests_of(&[[1.3, 0.0], a, b, [0.7, 0.0]]));
            for (apart, together) in apart.iter().zip(together) {
                assert!((apart - together).abs() < 1e-4, "{at}: {apart} {together}");
            }
        }
        let [doubling, _] = [[-0.99, 0.0], [-1.01, 0.0]].map(|mu| tests_of(&[mu, [0.5, 0.1], [0.5, -0.1]])[0]);
        assert!((doubling - 0.01).abs() < 1e-12, "{doubling}");
        let pair = |size: f64| tests_of(&[[0.6 * size, 0.8 * size], [0.6 * size, -0.8 * size], [0.2, 0.0]])[1];
        assert!(pair(0.99) < 0.0 && pair(1.01) > 0.0);
    }

    /// A pair without damping has no sign, and leaves that of another pair as it is; it confirms nothing.
    #[test]
    fn a_pair_on_the_unit_circle_does_not_count() {
        let pair =
            |size: f64, turn: f64| [1.0, -1.0].map(|sign| [size * libm::cos(turn), sign * size * libm::sin(turn)]);
        let undamped = [-1e-16, 0.0, 1e-16].map(|off| pair(1.0 + off, 1.0));
        for [a, b] in undamped {
            assert_eq!(tests_of(&[a, b])[1], 0.0);
            let beside = |size: f64| tests_of(&[a, b, pair(size, 2.0)[0], pair(size, 2.0)[1]])[1];
            assert!(beside(0.99) < -1e-3 && beside(1.01) > 1e-3);
        }
        let of = |numbers: &[[f64; 2]]| Stability {
            multipliers: numbers.iter().map(|[re, im]| Complex::new(*re, *im)).collect(),
            accuracy: 0.0,
            conservative: true,
        };
        let [[a, b], ..] = undamped;
        let saddle = of(&[a, b, [1.25, 0.0], [0.8, 0.0]]);
        let one = Marginal { pairs: 1, conjugates: 1 };
        assert_eq!(Marginal::of(Some(&of(&[a, b, [1.3, 0.0], [0.8, 0.0]]))), one);
        assert!(!confirmed(NeimarkSacker, Some(&saddle), one));
        let [c, d] = pair(1.0 + 1e-8, 2.0);
        assert!(confirmed(NeimarkSacker, Some(&of(&[a, b, c, d])), one));
    }

    /// A bifurcation that is detected and can't be located is recorded, and those after it are located.
    #[test]
    fn what_is_not_located_is_noted() {
        let assembly = modal(&oracles("modal")[0]);
        let tip = assembly.dof("tip.x").unwrap();
        let forced = Forced::new(assembly, tip, 10.0);
        let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [18.0, 26.0], vec![tip]);
        let balance = Balance::new(&forced, 18.0, Coordinate::FrequencyHz, 5);
        let n = balance.dimension();
        let point = |lambda: f64, direction: f64, arclength: f64| Point {
            x: vec![f64::NAN; n],
            lambda,
            arclength,
            tangent: vec![direction; n + 1],
            determinant: Determinant { sign: 1.0, log_magnitude: 0.0 },
        };
        let mut tracer = Tracer::new(balance, &options);
        let ends = [point(20.0, 1.0, 0.0), point(20.1, -1.0, 0.1)];
        ends.iter().for_each(|end| {
            let orbit = tracer.orbit(end);
            tracer.branch.orbits.push(orbit);
        });
        tracer.detect(None, &ends[0], &ends[1]);
        let expected = Unlocated { kind: Fold, between: [20.0, 20.1], index: 1 };
        assert_eq!((&tracer.branch.unlocated[..], tracer.branch.bifurcations.len()), (&[expected][..], 0));
    }
}
