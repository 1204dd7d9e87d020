//! Responses with the period of the drive that a branch over the frequency does not reach.
//!
//! Newton's method finds one response from each start, and continuation all those of its branch. Others may exist on
//! branches of their own: isolas, which close within the range, and branches that leave the range at both ends. Two
//! searches look for them; neither proves that there are no more. [`super::sub_harmonic`] seeks responses of 2 and 3
//! periods of the drive.
//!
//! - [`deflation`]: Newton's method from random responses at a few frequencies, kept away from the known ones.
//! - [`fold_curves`]: the folds of a branch, followed as the load varies, come back to the load at folds of other
//!   branches.
//!
//! A response found with few harmonics is first corrected with as many as the branch has: compared with another number,
//! a response of a known branch would count as a new one. If it is new, its branch is followed.

mod deflation;
mod fold_curves;

use alloc::vec::Vec;

use thiserror::Error;

use super::balance::Balance;
use super::both_ways::both_ways;
use super::continuation::{Continuation, Cut, Point, Slices, Work};
use super::detect::point_of;
use super::sub_harmonic::SubHarmonicSearch;
use crate::branch_options::{BifurcationKind, BranchOptions};
use crate::error::EndedEarly;
use crate::forced::{Coordinate, Forced};
use crate::orbit::{Bifurcation, Branch, BranchEnd, Orbit};
use crate::trace_options::TraceOptions;

/// Harmonics with which responses are sought, for smooth forces and for others.
const HARMONICS: [usize; 2] = [3, 5];
/// Two responses nearer than this, relative to their size, are one.
const SAME: f64 = 1e-3;

/// What a search for responses that no known branch reaches covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// Frequencies, evenly spaced within the range, at which random starts are tried.
    pub frequencies: usize,
    /// Starts at each frequency.
    pub starts: usize,
    /// Folds are followed while the load is between the amplitude over this and the amplitude times this.
    pub load_factor: f64,
    /// Whether more folds are followed: those of branches under 2 and 4 times the load, and those of structures whose
    /// forces are not smooth, which can have many.
    pub more_folds: bool,
    /// Whether responses of 2 and 3 periods of the drive are sought, too.
    pub sub_harmonics: bool,
}

impl Default for SearchOptions {
    /// 5 frequencies with 10 starts each, and loads from half to twice the amplitude.
    fn default() -> SearchOptions {
        SearchOptions { frequencies: 5, starts: 10, load_factor: 2.0, more_folds: false, sub_harmonics: false }
    }
}

impl SearchOptions {
    /// A search that covers more: 20 frequencies, loads up to 4 times the amplitude, and 2 and 3 periods of the drive.
    pub fn further() -> SearchOptions {
        let more = SearchOptions { frequencies: 20, load_factor: 4.0, ..SearchOptions::default() };
        SearchOptions { more_folds: true, sub_harmonics: true, ..more }
    }
}

/// The reason for which responses with the period of the drive were not searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NotSearched {
    /// `coordinate`: the branch does not vary the frequency.
    #[error("responses beside the branch were not searched: they are searched only where the frequency varies")]
    Coordinate,
    /// `early`: the branch ended early.
    #[error("responses beside the branch were not searched, since the branch ended early")]
    Early,
    /// `linear`: a linear structure has one response to each load.
    #[error("the structure is linear: no other responses exist")]
    Linear,
    /// `no-load`: the load is zero.
    #[error("responses beside the branch were not searched, since the load is zero")]
    NoLoad,
}

impl NotSearched {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            NotSearched::Coordinate => "coordinate",
            NotSearched::Early => "early",
            NotSearched::Linear => "linear",
            NotSearched::NoLoad => "no-load",
        }
    }

    /// Returns the reason for which nothing is searched beside a branch, if there is one.
    pub(super) fn of(forced: &Forced, branch: &Branch, coordinate: Coordinate) -> Option<NotSearched> {
        match branch.end {
            _ if forced.is_linear() => Some(NotSearched::Linear),
            _ if coordinate != Coordinate::FrequencyHz => Some(NotSearched::Coordinate),
            _ if forced.amplitude() == 0.0 => Some(NotSearched::NoLoad),
            BranchEnd::Early => Some(NotSearched::Early),
            _ => None,
        }
    }
}

/// What a search has covered.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Searched {
    /// The reason for which responses with the period of the drive were not searched, if they were not.
    pub not_searched: Option<NotSearched>,
    /// Frequencies at which random starts were tried, Hz.
    pub frequencies_hz: Vec<f64>,
    /// Starts at each of them.
    pub starts: usize,
    /// For each degree of freedom that is read, the largest displacement tried: a multiple of the largest of the branch.
    pub largest: Vec<f64>,
    /// The least and the largest load to which folds were followed; `None` if none was.
    pub loads: Option<[f64; 2]>,
    /// The number of branches found that leave a known one at a bifurcation and are not among the results.
    pub attached: usize,
    /// Where sub-harmonic responses were sought, if they were to be.
    pub sub_harmonics: Option<SubHarmonicSearch>,
    /// The work of the search itself, without that of following what it found: evaluations with few harmonics.
    pub work: Work,
}

/// A branch that was found and followed.
pub(super) struct Found {
    /// The frequency at which it was found, Hz.
    pub value: f64,
    pub traced: Result<Branch, EndedEarly<Branch>>,
    /// Whether it meets another branch at a branch point.
    pub is_attached: bool,
}

impl Found {
    fn branch(&self) -> &Branch {
        self.traced.as_ref().unwrap_or_else(|early| &early.so_far)
    }
}

/// Searches the range of the first of the known branches over the frequency for responses of the period of the drive
/// that lie on none of these. All known branches have that period. Equal inputs have equal results.
pub(super) fn search(
    forced: &Forced,
    known: &[&Branch],
    options: &TraceOptions,
    search: &SearchOptions,
) -> (Vec<Found>, Searched) {
    let mut searcher =
        Searcher { forced, options, search, known, found: Vec::new(), work: Work::default(), loads: None };
    let frequencies_hz = searcher.deflation();
    searcher.fold_curves();
    let Searcher { found, work, loads, .. } = searcher;
    let largest = |(reading, peak): (usize, &Orbit)| deflation::SHARES[1] * peak.readings[reading].largest;
    let largest = known.first().map_or_else(Vec::new, |branch| branch.peaks.iter().enumerate().map(largest).collect());
    let starts = if frequencies_hz.is_empty() { 0 } else { search.starts };
    (found, Searched { starts, frequencies_hz, largest, loads, work, ..Searched::default() })
}

/// The state of a search.
struct Searcher<'a> {
    forced: &'a Forced,
    options: &'a TraceOptions,
    search: &'a SearchOptions,
    /// The branches that were known before, first the one whose range is searched.
    known: &'a [&'a Branch],
    found: Vec<Found>,
    work: Work,
    loads: Option<[f64; 2]>,
}

impl Searcher<'_> {
    /// The known branches, those found meanwhile last.
    fn known(&self) -> impl Iterator<Item = &Branch> {
        self.known.iter().copied().chain(self.found.iter().map(Found::branch))
    }

    /// The range of the branch, Hz.
    fn range(&self) -> [f64; 2] {
        let BranchOptions { from, to, .. } = self.options.branch;
        [from.min(to), from.max(to)]
    }

    /// The number of harmonics with which responses are sought.
    fn harmonics(&self) -> usize {
        HARMONICS[usize::from(!self.forced.assembly().is_smooth())]
    }

    /// Returns a balance at a frequency.
    fn balance(&self, frequency_hz: f64, harmonics: usize) -> Balance {
        Balance::new(self.forced, frequency_hz, Coordinate::FrequencyHz, harmonics)
    }

    /// Says whether a response lies on a known branch.
    fn is_known(&self, response: &Point) -> bool {
        self.known().any(|branch| self.lies_on(branch, response))
    }

    /// Says whether a response lies on a branch: whether the branch, in the plane through the response that is
    /// perpendicular to one of its steps, is there.
    fn lies_on(&self, branch: &Branch, response: &Point) -> bool {
        let settings = &self.options.branch.continuation;
        let m = self.balance(response.lambda, self.harmonics()).unknowns.count();
        branch.orbits.windows(2).any(|pair| {
            let [a, b] = [0, 1].map(|end| point_of(&pair[end]));
            let n = a.x.len().max(b.x.len()).max(response.x.len());
            let mut slices = Slices::new(n, settings, [&a, &b], Cut::Chord);
            let fraction = slices.fraction([&a, &b], response);
            let reach = slices.distance(&a, &b);
            let between = slices.mix([&a, &b], fraction);
            if !(0.0..=1.0).contains(&fraction) || slices.distance(&between, response) > reach {
                return false;
            }
            let mut balance = self.balance(a.lambda, n / m / 2);
            // At a branch point the equations are singular, and the point between the two is near enough.
            let point = slices.solve(&mut balance, [&a, &b], fraction).unwrap_or(between);
            slices.distance(&point, response) < SAME
        })
    }

    /// Follows the branch of a new response, and keeps it. Returns whether there is one.
    fn follow(&mut self, balance: Balance, seed: Continuation) -> bool {
        let value = seed.point().lambda;
        // Beyond a branch point it goes on, so that an isola is followed all around.
        let mut found = Found { value, traced: both_ways(balance, seed, self.options, false), is_attached: false };
        // A response that can't be followed anywhere is no branch.
        if found.branch().orbits.len() < 2 {
            return false;
        }
        // A branch that could be followed in part may be part of this one.
        let middle = |part: &Found| part.branch().orbits.get(part.branch().orbits.len() / 2).map(point_of);
        let holds = |part: &Found| {
            part.traced.is_err() && middle(part).is_some_and(|point| self.lies_on(found.branch(), &point))
        };
        let parts: Vec<bool> = self.found.iter().map(holds).collect();
        let mut parts = parts.into_iter();
        self.found.retain(|_| parts.next() != Some(true));
        let meets = |at: &Bifurcation| {
            let at_kind = matches!(at.kind, BifurcationKind::Fold | BifurcationKind::BranchPoint);
            let others = self.found.iter().filter(|other| !other.is_attached).map(Found::branch);
            let point = point_of(&at.orbit);
            at_kind && self.known.iter().copied().chain(others).any(|other| self.lies_on(other, &point))
        };
        found.is_attached = found.branch().bifurcations.iter().any(meets);
        self.found.push(found);
        true
    }
}
