//! Branches beside a branch: those that leave it at a branch point or a period doubling, those to which none leads
//! ([`super::detached`], [`super::sub_harmonic`]), and the branches that leave these.
//!
//! At a branch point the other branch leaves along its tangent, see [`super::crossing`]. Where a branch loses a symmetry
//! (a pitchfork), the two sides of the other one are mirror images of each other: the symmetry maps one to the other, and
//! only one is followed. Elsewhere (a transcritical point) both sides are followed. A period doubling is a pitchfork of
//! the balance of twice the period, whose symmetry is the shift by a period: its direction is the null vector of
//! [`super::singular`], with the response on the even harmonics of the halved base frequency and the null vector on the
//! odd ones.

use alloc::vec::Vec;

use thiserror::Error;

use super::balance::Balance;
use super::both_ways::{FIRST_STEP, both_ways};
use super::branch::{Tracer, check, not_there};
use super::crossing::crossing;
use super::detached::{self, Found, NotSearched, SearchOptions, Searched};
use super::detect::{chord, point_of};
use super::orbit::{Bifurcation, Branch, BranchEnd};
use super::singular::{Singular, Singularity, doubled};
use super::sub_harmonic::{Places, SubHarmonicSearch};
use super::trace_options::TraceOptions;
use crate::branch_options::BifurcationKind;
use crate::continuation::{Continuation, System as _};
use crate::error::{AnalysisError, EndedEarly};
use crate::forced::{Coordinate, Forced};
use crate::refusal::StepRefusal;

/// The longest period, in those of the drive, whose branches are followed: beyond it, the doublings of a cascade follow
/// each other ever more closely.
const LONGEST_PERIOD: usize = 8;
/// The most branches that are followed.
const MOST_BRANCHES: usize = 64;
/// First steps along a branch, in the order in which they are tried, relative to the size of the response. The branches of a
/// cascade turn ever more sharply beside their doublings: of one with 8 periods the tangent turns by 0.4 rad in a step of
/// 1e-4. A shorter last step would leave too little of the response in the harmonics that the other branch has not.
const FIRST_STEPS: [f64; 4] = [FIRST_STEP, 1e-3, 1e-4, 1e-5];
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
    /// `detached`: no other branch leads to it. It has the period of the drive.
    Detached,
    /// `sub-harmonic`: no other branch leads to it, and it was found at a response that is nearly a free motion.
    SubHarmonic,
}

impl OriginKind {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            OriginKind::BranchPoint => BifurcationKind::BranchPoint.name(),
            OriginKind::PeriodDoubling => BifurcationKind::PeriodDoubling.name(),
            OriginKind::Detached => "detached",
            OriginKind::SubHarmonic => "sub-harmonic",
        }
    }
}

/// The beginning of a branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    /// What it begins with.
    pub kind: OriginKind,
    /// The coordinate there, or where the branch was found.
    pub value: f64,
    /// The branch that it leaves: 0 for the first, k for the kth of the branches that were followed; `None` for a
    /// detached or sub-harmonic one.
    pub parent: Option<usize>,
    /// The period of its responses, in periods of the drive.
    pub period: usize,
    /// Whether a symmetry maps the branch to a second one that leaves at the same place, its mirror image.
    pub is_mirrored: bool,
}

/// A branch that leaves another one, or to which none leads, whole or up to where it ended early.
#[derive(Clone, Debug)]
pub struct OtherBranch {
    /// The place where it begins.
    pub origin: Origin,
    /// The branch, with one response at least.
    pub traced: Result<Branch, EndedEarly<Branch>>,
}

/// The reason for which a branch was not followed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum NotFollowed {
    /// Its period is longer than 8 periods of the drive.
    #[error("a cascade of doublings beyond {} periods of the load", LONGEST_PERIOD)]
    Cascade,
    /// 64 branches were followed before.
    #[error("{} branches are followed at most", MOST_BRANCHES)]
    TooMany,
    /// No response was found on it.
    #[error("{0}")]
    Failed(AnalysisError),
}

/// Which branches are wanted beside the first one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OtherOptions {
    /// Whether the branches that leave others at branch points and period doublings are followed.
    pub leaving: bool,
    /// What is searched for responses that no branch reaches; `None` if nothing is.
    pub search: Option<SearchOptions>,
}

/// The branches beside the first one.
#[derive(Clone, Debug, Default)]
pub struct OtherBranches {
    /// The branches: first those to which no other leads, then those that leave others.
    pub branches: Vec<OtherBranch>,
    /// Beginnings of branches that were not followed, with the reason.
    pub left_out: Vec<(Origin, NotFollowed)>,
    /// What was searched, if anything was to be.
    pub searched: Option<Searched>,
}

/// A response at which branches cross, and the direction of one of them.
pub(super) struct Beginning {
    balance: Balance,
    x: Vec<f64>,
    lambda: f64,
    /// dX, and last dλ.
    direction: Vec<f64>,
    is_mirrored: bool,
    /// Whether both sides of the branch have the same responses.
    is_one_sided: bool,
}

/// Follows the branches beside a branch in `coordinate`: those that no branch reaches and a search finds, those that leave
/// a branch at its branch points and period doublings, and all that leave these in turn, up to 8 periods of the drive.
/// `options` are those of the branch.
///
/// A branch ends where it leaves the interval of the options, where it meets a branch of the kind that it leaves, or where
/// it closes. If it meets the other one at another bifurcation, it is listed once for both. A search proves nothing: others
/// may exist.
pub fn trace_branches(
    forced: &Forced,
    branch: &Branch,
    coordinate: Coordinate,
    options: &TraceOptions,
    wanted: &OtherOptions,
) -> OtherBranches {
    let OtherOptions { leaving, search } = wanted;
    let found = OtherBranches::default();
    let mut switching = Switching { forced, branch, coordinate, options, leaving: *leaving, found, followed: 0 };
    // The branches that leave the first one come first, so that a search does not count them as its own.
    switching.follow_bifurcations();
    if let Some(search) = search {
        let mut searched = switching.search(search);
        if search.sub_harmonics {
            searched.sub_harmonics = Some(switching.seek_sub_harmonics(&mut searched.attached));
        }
        switching.found.searched = Some(searched);
        switching.follow_bifurcations();
    }
    switching.found.in_order()
}

/// The branches that are known.
struct Switching<'a> {
    forced: &'a Forced,
    branch: &'a Branch,
    coordinate: Coordinate,
    options: &'a TraceOptions,
    /// Whether branches that leave others are followed.
    leaving: bool,
    found: OtherBranches,
    /// The number of branches whose bifurcations were followed.
    followed: usize,
}

impl Switching<'_> {
    /// A branch by its number.
    fn known(&self, number: usize) -> Option<&Branch> {
        match number.checked_sub(1) {
            None => Some(self.branch),
            Some(index) => self.found.branches.get(index).map(OtherBranch::branch),
        }
    }

    /// Follows the branches from the bifurcations of all branches, those that are found meanwhile among them.
    fn follow_bifurcations(&mut self) {
        if !self.leaving {
            return;
        }
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
        let number = self.followed;
        let options = self.options;
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

    /// Searches for responses with the period of the drive that lie on no known branch, and keeps their branches.
    fn search(&mut self, search: &SearchOptions) -> Searched {
        if let Some(reason) = NotSearched::of(self.forced, self.branch, self.coordinate) {
            return Searched { not_searched: Some(reason), ..Searched::default() };
        }
        let known = (0..).map_while(|number| self.known(number));
        let known: Vec<&Branch> = known.filter(|known| known.period() == Some(1)).collect();
        let (found, mut searched) = detached::search(self.forced, &known, self.options, search);
        for Found { value, traced, is_attached } in found {
            if is_attached {
                // It is followed from its bifurcation if such branches are.
                searched.attached += usize::from(!self.leaving);
                continue;
            }
            let origin = Origin { kind: OriginKind::Detached, value, parent: None, period: 1, is_mirrored: false };
            self.add(origin, || Some(traced));
        }
        searched
    }

    /// Seeks sub-harmonic responses, and follows the branches of those that lie on none that is known. Counts those that
    /// leave a branch with the period of the drive and are not kept.
    fn seek_sub_harmonics(&mut self, attached: &mut usize) -> SubHarmonicSearch {
        let branch = self.branch;
        let options = self.options;
        let places = Places::new(self.forced, branch, self.coordinate, options);
        let starts = match places.starts() {
            Ok(starts) => starts,
            Err(error) => return SubHarmonicSearch { values: Vec::new(), error: Some(error) },
        };
        let mut values: Vec<f64> = starts.iter().map(|start| start.value).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let mut dropped: Vec<Branch> = Vec::new();
        for start in &starts {
            for seed in places.seeds(start) {
                let mut known = (0..).map_while(|number| self.known(number)).chain(&dropped);
                if known.any(|known| places.lies_on(&seed, known)) {
                    continue;
                }
                let kind = OriginKind::SubHarmonic;
                let value = start.value;
                let period = start.period;
                let origin = Origin { kind, value, parent: None, period, is_mirrored: false };
                let traced = both_ways(seed.balance, seed.continuation, options, true);
                match traced {
                    Ok(branch) if !self.leaving && places.leaves_shorter_period(&branch) => dropped.push(branch),
                    traced => self.add(origin, || Some(traced)),
                }
            }
        }
        *attached += dropped.len();
        SubHarmonicSearch { values, error: None }
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
            Some(traced) => self.found.branches.push(OtherBranch { origin, traced }),
        }
    }
}

impl OtherBranches {
    /// Returns the same with the branches that leave others last, and with the numbers that they have then.
    fn in_order(mut self) -> OtherBranches {
        let is_leaving = |branch: &OtherBranch| branch.origin.parent.is_some();
        let mut order: Vec<usize> = (0..self.branches.len()).collect();
        order.sort_by_key(|index| is_leaving(&self.branches[*index]));
        let new = |old: usize| match old.checked_sub(1) {
            None => 0,
            Some(index) => order.iter().position(|at| *at == index).map_or(old, |at| at + 1),
        };
        let origins = self.branches.iter_mut().map(|branch| &mut branch.origin);
        for origin in origins.chain(self.left_out.iter_mut().map(|(origin, _)| origin)) {
            origin.parent = origin.parent.map(new);
        }
        self.branches.sort_by_key(is_leaving);
        self
    }
}

impl OtherBranch {
    /// Returns the branch, whole or not.
    pub fn branch(&self) -> &Branch {
        self.traced.as_ref().unwrap_or_else(|early| &early.so_far)
    }
}

impl Beginning {
    /// Solves for the response at a bifurcation of a branch, and for the direction of the other branch.
    ///
    /// # Errors
    /// [`AnalysisError::NoSolution`] if no branch crosses there; otherwise as [`super::trace`].
    pub fn new(
        forced: &Forced,
        parent: &Branch,
        bifurcation: &Bifurcation,
        coordinate: Coordinate,
        options: &TraceOptions,
    ) -> Result<Beginning, AnalysisError> {
        let orbit = &bifurcation.orbit;
        let settings = &options.branch.continuation;
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
            let m = balance.unknowns.count();
            let size = direction.len();
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
    pub fn follow(&self, options: &TraceOptions) -> Option<Result<Branch, EndedEarly<Branch>>> {
        let settings = options.branch.continuation;
        let begin = |side: f64| {
            let direction: Vec<f64> = self.direction.iter().map(|value| side * value).collect();
            let begin = |step: f64| {
                let mut balance = self.balance.clone();
                Continuation::start_along(&mut balance, settings, &self.x, self.lambda, &direction, step)
                    .map(|continuation| (balance, continuation))
            };
            let [first, others @ ..] = FIRST_STEPS;
            others.into_iter().fold(begin(first), |begun, step| begun.or_else(|_| begin(step)))
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
        if !self.is_one_sided {
            return Some(both_ways(balance, continuation, options, true));
        }
        let lost = self.direction.split_last().map(|(_, along)| along.to_vec());
        Some(Tracer { is_switched: true, lost, ..Tracer::new(balance, options) }.run(continuation))
    }
}
