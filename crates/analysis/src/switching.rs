//! Branches that leave another one at a branch point or a period doubling, and the branches that leave these.
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

/// The beginning of a branch that leaves another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    /// Kind of the bifurcation at which it leaves: a branch point or a period doubling.
    pub kind: BifurcationKind,
    /// The coordinate there.
    pub value: f64,
    /// The branch that it leaves: 0 for the first, k for the kth of the branches that were followed.
    pub parent: usize,
    /// The period of its responses, in periods of the drive.
    pub period: usize,
    /// Whether a symmetry maps the branch to a second one that leaves at the same place, its mirror image.
    pub is_mirrored: bool,
}

/// A branch that leaves another one, whole or up to where it ended early.
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

/// The branches that leave a branch, and those that leave these.
#[derive(Clone, Debug, Default)]
pub struct SwitchedBranches {
    /// The branches in the order in which they were followed: each after the one that it leaves.
    pub branches: Vec<SwitchedBranch>,
    /// Beginnings of branches that were not followed, with the reason.
    pub left_out: Vec<(Origin, NotFollowed)>,
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

/// Follows the branches that leave a branch in `coordinate` at its branch points and period doublings, and all that
/// leave these in turn, up to 8 periods of the drive. `options` are those of the branch.
///
/// A branch ends where it leaves the interval of the options, or where it meets a branch of the kind that it leaves. If
/// that is at another bifurcation, it is listed once for both.
pub fn trace_branches(
    forced: &Forced,
    branch: &Branch,
    coordinate: Coordinate,
    options: &TraceOptions,
) -> SwitchedBranches {
    let mut found = SwitchedBranches::default();
    let mut parent = 0_usize;
    loop {
        let of_parent = match parent.checked_sub(1) {
            None => branch,
            Some(index) => match found.branches.get(index) {
                Some(switched) => switched.branch(),
                None => return found,
            },
        };
        // The last branch point of a branch that met another one is where it did.
        let met = usize::from(of_parent.end == BranchEnd::Rejoined);
        let bifurcations = of_parent.bifurcations.len() - met;
        let (mut added, mut left_out) = (Vec::new(), Vec::new());
        for bifurcation in &of_parent.bifurcations[..bifurcations] {
            let period = match bifurcation.kind {
                BifurcationKind::BranchPoint => bifurcation.orbit.period,
                BifurcationKind::PeriodDoubling => 2 * bifurcation.orbit.period,
                BifurcationKind::Fold | BifurcationKind::NeimarkSacker => continue,
            };
            let (kind, value) = (bifurcation.kind, bifurcation.orbit.value);
            let origin = Origin { kind, value, parent, period, is_mirrored: false };
            if period > LONGEST_PERIOD {
                left_out.push((origin, NotFollowed::Cascade));
                continue;
            }
            let beginning = match Beginning::new(forced, of_parent, bifurcation, coordinate, options) {
                Ok(beginning) => beginning,
                Err(reason) => {
                    left_out.push((origin, NotFollowed::Failed(reason)));
                    continue;
                }
            };
            let followed = found.branches.iter().chain(&added).map(SwitchedBranch::branch);
            let is_known = core::iter::once(branch)
                .chain(followed)
                .enumerate()
                .any(|(number, other)| number != parent && beginning.lies_on(other, period, options));
            if is_known {
                continue;
            }
            let origin = Origin { value: beginning.lambda, is_mirrored: beginning.is_mirrored, ..origin };
            if found.branches.len() + added.len() >= MOST_BRANCHES {
                left_out.push((origin, NotFollowed::TooMany));
                continue;
            }
            match beginning.follow(options) {
                None => {}
                Some(Err(EndedEarly { reason, so_far })) if so_far.orbits.is_empty() => {
                    left_out.push((origin, NotFollowed::Failed(reason)));
                }
                Some(traced) => added.push(SwitchedBranch { origin, traced }),
            }
        }
        found.branches.append(&mut added);
        found.left_out.append(&mut left_out);
        parent += 1;
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
        match forward {
            Ok(half) if !self.is_one_sided && matches!(half.end, BranchEnd::AtStart | BranchEnd::AtEnd) => {
                Some(back(balance, half, options))
            }
            forward => Some(forward),
        }
    }
}

fn switched(balance: Balance, begin: Continuation, options: &TraceOptions) -> Result<Branch, EndedEarly<Branch>> {
    Tracer { is_switched: true, ..Tracer::new(balance, options) }.run(begin)
}

/// Follows a branch that has left the interval, from there to its other end: in one piece.
fn back(mut balance: Balance, half: Branch, options: &TraceOptions) -> Result<Branch, EndedEarly<Branch>> {
    let Some(last) = half.orbits.last() else { return Ok(half) };
    balance.set_harmonics(last.harmonics);
    let branch = &options.branch;
    // The ends of the whole are named from where it begins now.
    let (from, to) = if half.end == BranchEnd::AtEnd { (branch.to, branch.from) } else { (branch.from, branch.to) };
    let options = TraceOptions { branch: BranchOptions { from, to, ..*branch }, ..options.clone() };
    match Continuation::start(&mut balance, branch.continuation, &last.coefficients, last.value, to - from) {
        Ok(begin) => switched(balance, begin, &options),
        Err(reason) => Err(EndedEarly { reason, so_far: Box::new(half) }),
    }
}
