//! Branches that leave another one at a branch point or a period doubling, sub-harmonic branches, and the branches that
//! leave these.
//!
//! At a branch point the other branch leaves along its tangent, see [`super::crossing`]. Where a branch loses a symmetry
//! (a pitchfork), the two sides of the other one are mirror images of each other: the symmetry maps one to the other, and
//! only one is followed. Elsewhere (a transcritical point) both sides are followed. A period doubling is a pitchfork of
//! the balance of twice the period, whose symmetry is the shift by a period: its direction is the null vector of
//! [`super::singular`], with the response on the even harmonics of the halved base frequency and the null vector on the
//! odd ones.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;

use super::balance::Balance;
use super::branch::{Tracer, check, not_there};
use super::crossing::crossing;
use super::detect::{chord, point_of};
use super::orbit::{Bifurcation, Branch, BranchEnd, TraceOptions};
use super::singular::{Singular, Singularity, doubled};
use super::sub_harmonic::{Places, Seed};
use super::{Coordinate, Forced};
use crate::continuation::{Continuation, StepRefusal, System as _};
use crate::{AnalysisError, BifurcationKind, BranchOptions, EndedEarly};

/// The longest period, in those of the drive, whose branches are followed: beyond it, the doublings of a cascade follow
/// each other ever more closely.
const LONGEST_PERIOD: usize = 8;
/// The most branches that are followed.
const MOST_BRANCHES: usize = 64;
/// First steps along a branch, in the order in which they are tried, relative to the size of the response.
const FIRST_STEPS: [f64; 3] = [1e-2, 1e-3, 1e-4];
/// Two branches have a branch point in common if they have one within this, relative, or within this many tolerances of
/// the truncation error.
const SAME: f64 = 1e-8;
const SAME_TOLERANCES: f64 = 10.0;

/// What a branch begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OriginKind {
    /// `branch-point`: it leaves another branch at a branch point.
    BranchPoint,
    /// `period-doubling`: it leaves another branch at a period doubling.
    PeriodDoubling,
    /// `sub-harmonic`: it is detached, and was found at a response that is nearly a free motion.
    SubHarmonic,
}

impl OriginKind {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            OriginKind::BranchPoint => BifurcationKind::BranchPoint.name(),
            OriginKind::PeriodDoubling => BifurcationKind::PeriodDoubling.name(),
            OriginKind::SubHarmonic => "sub-harmonic",
        }
    }
}

/// The beginning of a branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    /// What it begins with.
    pub kind: OriginKind,
    /// The coordinate there.
    pub value: f64,
    /// The branch that it leaves: 0 for the first, k for the kth of the branches that were followed; `None` for a
    /// sub-harmonic one.
    pub parent: Option<usize>,
    /// The period of its responses, in periods of the drive.
    pub period: usize,
    /// Whether a symmetry maps the branch to a second one that leaves at the same place, its mirror image.
    pub is_mirrored: bool,
}

/// A branch that leaves another one, or a sub-harmonic one, whole or up to where it ended early.
#[derive(Clone, Debug)]
pub struct SwitchedBranch {
    /// The place where it begins.
    pub origin: Origin,
    /// The branch, with one response at least.
    pub traced: Result<Branch, EndedEarly<Branch>>,
}

/// The reason for which a branch was not followed.
#[derive(Clone, Debug, PartialEq)]
pub enum NotFollowed {
    /// Its period is longer than 8 periods of the drive.
    Cascade,
    /// 64 branches were followed before.
    TooMany,
    /// No response was found on it.
    Failed(AnalysisError),
}

impl fmt::Display for NotFollowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NotFollowed::Cascade => write!(f, "a cascade of doublings beyond {LONGEST_PERIOD} periods of the load"),
            NotFollowed::TooMany => write!(f, "{MOST_BRANCHES} branches are followed at most"),
            NotFollowed::Failed(error) => error.fmt(f),
        }
    }
}

/// Where sub-harmonic responses were sought.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SubHarmonicSearch {
    /// The values of the coordinate, in order.
    pub values: Vec<f64>,
    /// The reason for which free motions are not defined, without which nothing was sought.
    pub error: Option<AnalysisError>,
}

impl SubHarmonicSearch {
    /// The periods that are sought, in those of the drive.
    pub const PERIODS: [usize; 2] = [2, 3];
}

/// The branches that leave a branch, sub-harmonic ones, and those that leave these.
#[derive(Clone, Debug, Default)]
pub struct SwitchedBranches {
    /// The branches in the order in which they were followed: each after the one that it leaves.
    pub branches: Vec<SwitchedBranch>,
    /// Beginnings of branches that were not followed, with the reason.
    pub left_out: Vec<(Origin, NotFollowed)>,
    /// Where sub-harmonic responses were sought.
    pub sub_harmonics: SubHarmonicSearch,
}

/// A response at which branches cross, and the direction of one of them.
struct Beginning {
    balance: Balance,
    x: Vec<f64>,
    lambda: f64,
    /// dX, and last dλ.
    direction: Vec<f64>,
    is_mirrored: bool,
    /// Whether both sides of the branch have the same responses.
    is_one_sided: bool,
}

/// Follows the branches that leave a branch in `coordinate` at its branch points and period doublings, the sub-harmonic
/// branches of 2 and 3 periods of the drive that are found, and all that leave these in turn, up to 8 periods of the drive.
/// `options` are those of the branch.
///
/// A branch ends where it leaves the interval of the options, where it meets a branch of the kind that it leaves, or where
/// it closes. If it meets the other one at another bifurcation, it is listed once for both.
pub fn trace_branches(
    forced: &Forced,
    branch: &Branch,
    coordinate: Coordinate,
    options: &TraceOptions,
) -> SwitchedBranches {
    let mut switching =
        Switching { forced, branch, coordinate, options, found: SwitchedBranches::default(), followed: 0 };
    switching.follow_bifurcations();
    switching.seek_sub_harmonics();
    switching.follow_bifurcations();
    switching.found
}

/// The branches that are known.
struct Switching<'a> {
    forced: &'a Forced,
    branch: &'a Branch,
    coordinate: Coordinate,
    options: &'a TraceOptions,
    found: SwitchedBranches,
    /// The number of branches whose bifurcations were followed.
    followed: usize,
}

impl Switching<'_> {
    /// A branch by its number.
    fn known(&self, number: usize) -> Option<&Branch> {
        match number.checked_sub(1) {
            None => Some(self.branch),
            Some(index) => self.found.branches.get(index).map(SwitchedBranch::branch),
        }
    }

    /// Follows the branches from the bifurcations of all branches, those that are found meanwhile among them.
    fn follow_bifurcations(&mut self) {
        while let Some(parent) = self.known(self.followed) {
            // The last branch point of a branch that met another one is where it did.
            let met = usize::from(parent.end == BranchEnd::Rejoined);
            for index in 0..parent.bifurcations.len() - met {
                self.follow_bifurcation(index);
            }
            self.followed += 1;
        }
    }

    /// Follows the branch from a bifurcation of the branch whose turn it is, unless it is known.
    fn follow_bifurcation(&mut self, index: usize) {
        let (number, options) = (self.followed, self.options);
        let Some(parent) = self.known(number) else { return };
        let bifurcation = &parent.bifurcations[index];
        let (kind, period) = match bifurcation.kind {
            BifurcationKind::BranchPoint => (OriginKind::BranchPoint, bifurcation.orbit.period),
            BifurcationKind::PeriodDoubling => (OriginKind::PeriodDoubling, 2 * bifurcation.orbit.period),
            BifurcationKind::Fold | BifurcationKind::NeimarkSacker => return,
        };
        let value = bifurcation.orbit.value;
        let origin = Origin { kind, value, parent: Some(number), period, is_mirrored: false };
        if period > LONGEST_PERIOD {
            return self.found.left_out.push((origin, NotFollowed::Cascade));
        }
        let beginning = match Beginning::new(self.forced, parent, bifurcation, self.coordinate, options) {
            Ok(beginning) => beginning,
            Err(reason) => return self.found.left_out.push((origin, NotFollowed::Failed(reason))),
        };
        let mut others = (0..).map_while(|other| self.known(other)).enumerate().filter(|(other, _)| *other != number);
        if others.any(|(_, other)| beginning.lies_on(other, period, options)) {
            return;
        }
        let origin = Origin { value: beginning.lambda, is_mirrored: beginning.is_mirrored, ..origin };
        self.add(origin, || beginning.follow(options));
    }

    /// Seeks sub-harmonic responses, and follows the branches of those that lie on none that is known.
    fn seek_sub_harmonics(&mut self) {
        let (branch, options) = (self.branch, self.options);
        let places = Places::new(self.forced, branch, self.coordinate, options);
        let starts = match places.starts() {
            Ok(starts) => starts,
            Err(error) => return self.found.sub_harmonics.error = Some(error),
        };
        let mut values: Vec<f64> = starts.iter().map(|start| start.value).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        self.found.sub_harmonics.values = values;
        for start in &starts {
            for seed in places.seeds(start) {
                let mut known = (0..).map_while(|number| self.known(number));
                if known.any(|known| places.lies_on(&seed, known)) {
                    continue;
                }
                let (kind, value, period) = (OriginKind::SubHarmonic, start.value, start.period);
                let origin = Origin { kind, value, parent: None, period, is_mirrored: false };
                self.add(origin, || Some(follow_seed(seed, options)));
            }
        }
    }

    /// Adds the branch that `follow` returns, if there may be another one.
    fn add(&mut self, origin: Origin, follow: impl FnOnce() -> Option<Result<Branch, EndedEarly<Branch>>>) {
        if self.found.branches.len() >= MOST_BRANCHES {
            return self.found.left_out.push((origin, NotFollowed::TooMany));
        }
        match follow() {
            None => {}
            Some(Err(EndedEarly { reason, so_far })) if so_far.orbits.is_empty() => {
                self.found.left_out.push((origin, NotFollowed::Failed(reason)));
            }
            Some(traced) => self.found.branches.push(SwitchedBranch { origin, traced }),
        }
    }
}

impl SwitchedBranch {
    /// Returns the branch, whole or not.
    pub fn branch(&self) -> &Branch {
        match &self.traced {
            Ok(branch) => branch,
            Err(early) => &early.so_far,
        }
    }
}

impl Beginning {
    /// Solves for the response at a bifurcation of a branch, and for the direction of the other branch.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if no branch crosses there; otherwise as [`super::trace`].
    fn new(
        forced: &Forced,
        parent: &Branch,
        bifurcation: &Bifurcation,
        coordinate: Coordinate,
        options: &TraceOptions,
    ) -> Result<Beginning, AnalysisError> {
        let (orbit, settings) = (&bifurcation.orbit, &options.branch.continuation);
        let x = &orbit.coefficients;
        let mut balance = Balance::of_period(forced, [orbit.period, orbit.harmonics], orbit.frequency_hz, coordinate);
        check(&mut balance, options)?;
        if !(balance.set(Coordinate::Amplitude, orbit.drive) && balance.set_value(orbit.value)) {
            return Err(not_there(&balance, options));
        }
        if bifurcation.kind == BifurcationKind::PeriodDoubling {
            let (singular, z, _) = Singular::solved(&balance, Singularity::PeriodDoubling, settings, x)?;
            let (lambda, x) = singular.split(&z);
            let mut direction = singular.null_vector();
            let (m, size) = (balance.unknowns.count(), direction.len());
            direction.push(0.0);
            let mut start = doubled(x, m);
            start.resize(size, 0.0);
            let orders = [2 * orbit.period, (size / m - 1) / 2];
            let balance = Balance::of_period(&balance.forced, orders, orbit.frequency_hz, coordinate);
            return Ok(Beginning { balance, x: start, lambda, direction, is_mirrored: false, is_one_sided: true });
        }
        let ends = [bifurcation.index.saturating_sub(1), bifurcation.index];
        let ends = ends.map(|index| parent.orbits.get(index).unwrap_or(orbit)).map(point_of);
        let along = |n: usize| chord(&ends[0], &ends[1], n);
        let at = balance.place(orbit.value);
        let none = AnalysisError::NoSolution { at, refusal: StepRefusal::Newton };
        let found = crossing(&balance, settings, x, &along(x.len()))?.ok_or(none)?;
        let other = 1 - found.along(&along(found.x.len()));
        let harmonics = (found.x.len() / balance.unknowns.count() - 1) / 2;
        balance.set_harmonics(harmonics);
        Ok(Beginning {
            balance,
            is_mirrored: found.turns_back(other),
            is_one_sided: found.turns_back(other),
            lambda: found.lambda,
            direction: found.tangents[other].clone(),
            x: found.x,
        })
    }

    /// Says whether a branch with this period has a branch point at the same place.
    fn lies_on(&self, other: &Branch, period: usize, options: &TraceOptions) -> bool {
        let tolerance = SAME.max(SAME_TOLERANCES * options.branch.truncation) * self.lambda.abs();
        other.bifurcations.iter().any(|found| {
            found.kind == BifurcationKind::BranchPoint
                && found.orbit.period == period
                && (found.orbit.value - self.lambda).abs() <= tolerance
        })
    }

    /// Follows the branch, to one side if the other has the same responses, otherwise in one piece to both; `None` if it
    /// leaves the interval at once.
    fn follow(&self, options: &TraceOptions) -> Option<Result<Branch, EndedEarly<Branch>>> {
        let settings = options.branch.continuation;
        let begin = |side: f64| {
            let direction: Vec<f64> = self.direction.iter().map(|value| side * value).collect();
            let begin = |step: f64| {
                let mut balance = self.balance.clone();
                Continuation::start_along(&mut balance, settings, &self.x, self.lambda, &direction, step)
                    .map(|continuation| (balance, continuation))
            };
            let [first, second, third] = FIRST_STEPS;
            begin(first).or_else(|_| begin(second)).or_else(|_| begin(third))
        };
        let is_outside = |at: &Continuation| options.branch.left_at(at.point().lambda).is_some();
        let (balance, continuation) = match begin(1.0) {
            Ok((_, at)) if is_outside(&at) && self.is_one_sided => return None,
            Ok((_, at)) if is_outside(&at) => match begin(-1.0) {
                Ok((_, at)) if is_outside(&at) => return None,
                Ok(begun) => begun,
                Err(reason) => return Some(Err(reason.into())),
            },
            Ok(begun) => begun,
            Err(reason) => return Some(Err(reason.into())),
        };
        let forward = switched(balance.clone(), continuation, options);
        Some(if self.is_one_sided { forward } else { forward.and_then(|half| back(balance, half, options)) })
    }
}

/// Follows the branch of a sub-harmonic response, in one piece.
fn follow_seed(Seed { balance, continuation }: Seed, options: &TraceOptions) -> Result<Branch, EndedEarly<Branch>> {
    switched(balance.clone(), continuation, options).and_then(|half| back(balance, half, options))
}

/// Follows a branch that leaves another one, or has no known end.
fn switched(balance: Balance, begin: Continuation, options: &TraceOptions) -> Result<Branch, EndedEarly<Branch>> {
    Tracer { is_switched: true, ..Tracer::new(balance, options) }.run(begin)
}

/// Follows a branch that has not closed from its end to the other one: in one piece.
fn back(mut balance: Balance, half: Branch, options: &TraceOptions) -> Result<Branch, EndedEarly<Branch>> {
    let branch = &options.branch;
    // Where the branch met another one its last response is one beyond.
    let from = half.orbits.len().saturating_sub(if half.end == BranchEnd::Rejoined { 2 } else { 1 });
    let (Some(last), false) = (half.orbits.get(from), half.end == BranchEnd::Closed) else { return Ok(half) };
    balance.set_harmonics(last.harmonics);
    // The ends of the whole are named from where it begins now.
    let (from_value, to) =
        if half.end == BranchEnd::AtEnd { (branch.to, branch.from) } else { (branch.from, branch.to) };
    let begin = match half.end {
        BranchEnd::AtStart | BranchEnd::AtEnd => {
            let direction = to - from_value;
            Continuation::start(&mut balance, branch.continuation, &last.coefficients, last.value, direction)
        }
        _ => {
            let Some(before) = from.checked_sub(1).and_then(|before| half.orbits.get(before)) else { return Ok(half) };
            let direction = chord(&point_of(last), &point_of(before), last.coefficients.len());
            let [first, ..] = FIRST_STEPS;
            let (settings, x) = (branch.continuation, &last.coefficients);
            Continuation::start_along(&mut balance, settings, x, last.value, &direction, first)
        }
    };
    let options = TraceOptions { branch: BranchOptions { from: from_value, to, ..*branch }, ..options.clone() };
    match begin {
        Ok(begin) => switched(balance, begin, &options),
        Err(reason) => Err(EndedEarly { reason, so_far: Box::new(half) }),
    }
}
