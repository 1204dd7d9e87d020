//! Sub-harmonic responses, of 2 and of 3 periods of the drive, on branches to which no other branch leads.
//!
//! A lightly damped structure can vibrate nearly freely at Ω/ν, while the drive only makes up for the damping: to first
//! order the response is a free motion of the undamped structure at Ω/ν, in one of a few phases, and the linear response at
//! Ω (A. H. Nayfeh, D. T. Mook, "Nonlinear Oscillations", 1979, Sec. 4.1.4). Newton's method starts from such sums, with
//! the free motions of every mode, from [`free_motions`], at a few places of the interval. Shifted by a period of the drive
//! a response is the same, so the phases of one such period are enough.

use alloc::vec;
use alloc::vec::Vec;

use super::adapt::adapt;
use super::backbone::{BackboneOptions, FreeMotion, free_motions};
use super::balance::Balance;
use super::detect::point_of;
use super::orbit::{Branch, BranchEnd, Orbit};
use super::trace_options::TraceOptions;
use crate::branch_options::BifurcationKind;
use crate::continuation::{Continuation, System as _, at_parameter};
use crate::dense::{Lu, dot, norm};
use crate::error::AnalysisError;
use crate::forced::{Coordinate, Forced};

/// Frequencies of the interval, or values of another coordinate, at which they are sought.
const PLACES: usize = 5;
/// Phases of the free motion.
const PHASES: usize = 12;
/// Harmonics of the free motion with which Newton's method starts.
const HARMONICS: usize = 7;
/// Most iterations of Newton's method.
const ITERATIONS: usize = 20;
/// A response has the period of the drive if its other harmonics are below this fraction of it.
const PART: f64 = 1e-3;
/// The free motions are followed from this size to this one, relative to the largest response of the first branch, with a
/// truncation error of this, and at most so many points.
const SIZES: [f64; 2] = [1e-2, 20.0];
const TRUNCATION: f64 = 1e-3;
const MOST_POINTS: usize = 300;
/// Two responses are one, shifted or mirrored, if their sizes agree within this, or within this many tolerances of the
/// truncation error.
const SAME: f64 = 1e-6;
const SAME_TOLERANCES: f64 = 10.0;

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

/// A response from which a branch is followed.
pub(super) struct Seed {
    pub balance: Balance,
    pub continuation: Continuation,
}

/// The places at which sub-harmonic responses are sought.
pub(super) struct Places<'a> {
    forced: &'a Forced,
    coordinate: Coordinate,
    options: &'a TraceOptions,
    frequency_hz: f64,
    /// The size of the largest response of the first branch.
    largest: f64,
}

/// A sum of a free motion and the linear response: the value of the coordinate, the period ν, and the free motion.
pub(super) struct Start {
    pub value: f64,
    pub period: usize,
    series: Vec<f64>,
}

impl Places<'_> {
    /// The places along a branch.
    pub fn new<'a>(
        forced: &'a Forced,
        branch: &Branch,
        coordinate: Coordinate,
        options: &'a TraceOptions,
    ) -> Places<'a> {
        let largest = branch.orbits.iter().map(|orbit| norm(&orbit.coefficients)).fold(0.0, f64::max);
        let frequency_hz = branch.orbits.first().map_or(f64::NAN, |orbit| orbit.frequency_hz);
        Places { forced, coordinate, options, frequency_hz, largest }
    }

    /// Returns the starts, one for each mode, period and place.
    ///
    /// # Errors
    /// [`AnalysisError::NotLinear`] if an element keeps small free motions from being linear.
    pub fn starts(&self) -> Result<Vec<Start>, AnalysisError> {
        let [from, to] = [self.options.branch.from, self.options.branch.to];
        let mut starts = Vec::new();
        // Without a size of the responses it is not known which free motions matter.
        if self.largest == 0.0 {
            return Ok(starts);
        }
        if self.coordinate == Coordinate::FrequencyHz {
            let [low, high] = [from.min(to), from.max(to)];
            for motions in self.free_motions(self.forced, [low, high])? {
                for period in SubHarmonicSearch::PERIODS {
                    let nu = period as f64;
                    let hz = || motions.iter().map(|motion| motion.frequency_hz * nu);
                    let [low, high] = [hz().fold(f64::INFINITY, f64::min).max(low), hz().fold(0.0, f64::max).min(high)];
                    let places = between([low, high]).into_iter().filter(|_| low < high);
                    starts.extend(places.filter_map(|hz| start(&motions, hz, period, hz)));
                }
            }
            return Ok(starts);
        }
        for value in between([from, to]) {
            let mut balance = Balance::new(self.forced, self.frequency_hz, self.coordinate, 1);
            if !balance.set_value(value) {
                continue;
            }
            for motions in self.free_motions(&balance.forced, [self.frequency_hz; 2])? {
                starts.extend(
                    SubHarmonicSearch::PERIODS
                        .iter()
                        .filter_map(|period| start(&motions, value, *period, self.frequency_hz)),
                );
            }
        }
        Ok(starts)
    }

    /// Returns the free motions of each mode whose frequency can be that of a sub-harmonic response in an interval of the
    /// drive's, Hz.
    fn free_motions(&self, forced: &Forced, [low, high]: [f64; 2]) -> Result<Vec<Vec<FreeMotion>>, AnalysisError> {
        let free = forced.without_dissipation()?;
        let mut all = Vec::new();
        for (mode, of_mode) in free.assembly.modes().iter().enumerate() {
            if of_mode.frequency_hz == 0.0 {
                continue;
            }
            let Ok(driven) = Forced::free(&free.assembly, mode) else { continue };
            let read = driven.drives.iter().map(|(dof, _)| *dof).collect();
            let mut options = BackboneOptions::new(&driven, mode, f64::INFINITY, f64::INFINITY, read);
            let own = of_mode.frequency_hz;
            let [least, most] =
                [low / SubHarmonicSearch::PERIODS[1] as f64, high / SubHarmonicSearch::PERIODS[0] as f64];
            // The motions begin at the natural frequency, which may be outside.
            options.branch.from = least.min(0.9 * own);
            options.branch.to = most.max(1.1 * own);
            options.branch.truncation = TRUNCATION;
            options.branch.most_harmonics = HARMONICS;
            options.branch.ends_if_truncated = false;
            options.branch.most_points = MOST_POINTS;
            options.branch.continuation.state_floor = SIZES[0] * self.largest;
            match free_motions(&driven, &options, SIZES[1] * self.largest) {
                Ok(motions) => all.push(motions),
                Err(AnalysisError::NotDriven { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(all)
    }

    /// Returns the responses to which Newton's method leads from a start, each once, with as many harmonics as it needs.
    pub fn seeds(&self, start: &Start) -> Vec<Seed> {
        let nu = start.period;
        let branch = &self.options.branch;
        let frequency_hz = if self.coordinate == Coordinate::FrequencyHz { start.value } else { self.frequency_hz };
        let harmonics = [nu, HARMONICS.max(branch.least_harmonics) * nu];
        let mut balance = Balance::of_period(self.forced, harmonics, frequency_hz, self.coordinate);
        if !balance.set_value(start.value) {
            return vec![];
        }
        let m = balance.unknowns.count();
        let linear = linear(&mut balance);
        let mut seeds = Vec::new();
        let mut known = Vec::<[f64; 2]>::new();
        for phase in 0..PHASES {
            let phase_rad = core::f64::consts::TAU * phase as f64 / (PHASES * nu) as f64;
            let mut x = shifted(&start.series, m, phase_rad);
            x.resize(linear.len(), 0.0);
            x.iter_mut().zip(&linear).for_each(|(x, linear)| *x += linear);
            let mut balance = balance.clone();
            let settings = branch.continuation;
            let begun = Continuation::start_within(ITERATIONS, &mut balance, settings, &x, start.value, 1.0);
            let Ok(mut continuation) = begun else { continue };
            let is_new = |continuation: &Continuation, known: &[[f64; 2]]| {
                let sizes = sizes(&continuation.point().x, m, nu);
                sizes[1] > PART * sizes[0] && !known.iter().any(|other| are_same(*other, sizes, branch.truncation))
            };
            if !is_new(&continuation, &known) {
                continue;
            }
            known.push(sizes(&continuation.point().x, m, nu));
            // With few harmonics a response may exist that is none.
            if adapt(&mut balance, &mut continuation, branch).is_ok() && is_new(&continuation, &[]) {
                seeds.push(Seed { balance, continuation });
            }
        }
        seeds
    }

    /// Says whether a branch ends where it meets one with the period of the drive: it leaves that one at a period doubling.
    pub fn leaves_shorter_period(&self, branch: &Branch) -> bool {
        let met = branch.bifurcations.iter().rfind(|found| found.kind == BifurcationKind::BranchPoint);
        let Some(met) = met else { return false };
        let m = Balance::new(self.forced, met.orbit.frequency_hz, self.coordinate, 1).unknowns.count();
        let [whole, others] = sizes(&met.orbit.coefficients, m, met.orbit.period);
        branch.end == BranchEnd::Rejoined && others < PART * whole
    }

    /// Says whether a branch has the response of a seed, possibly shifted or mirrored.
    pub fn lies_on(&self, seed: &Seed, branch: &Branch) -> bool {
        let point = seed.continuation.point();
        let nu = seed.balance.period();
        if branch.period() != Some(nu) {
            return false;
        }
        let m = seed.balance.unknowns.count();
        let sought = point.lambda;
        let own = sizes(&point.x, m, nu);
        let mut orbits: Vec<&Orbit> = branch.orbits.iter().collect();
        orbits.extend(branch.bifurcations.iter().map(|found| &found.orbit));
        orbits.sort_by(|a, b| a.arclength.total_cmp(&b.arclength));
        orbits.windows(2).any(|pair| {
            let ends = [0, 1].map(|end| point_of(pair[end]));
            if (ends[0].lambda - sought) * (ends[1].lambda - sought) > 0.0 || ends[0].lambda == ends[1].lambda {
                return false;
            }
            let mut balance = seed.balance.clone();
            balance.set_harmonics(pair[0].harmonics.max(pair[1].harmonics));
            let settings = &self.options.branch.continuation;
            let found = at_parameter(&mut balance, settings, [&ends[0], &ends[1]], sought);
            found.is_ok_and(|found| are_same(sizes(&found.x, m, nu), own, self.options.branch.truncation))
        })
    }
}

/// Returns places within an interval, evenly spaced.
fn between([low, high]: [f64; 2]) -> Vec<f64> {
    (0..PLACES).map(|place| low + (place as f64 + 0.5) / PLACES as f64 * (high - low)).collect()
}

/// Returns the start with the free motion at the frequency Ω/ν, between two that are known; `None` if the motions do not
/// reach it.
fn start(motions: &[FreeMotion], value: f64, period: usize, frequency_hz: f64) -> Option<Start> {
    let off = |motion: &FreeMotion| motion.frequency_hz - frequency_hz / period as f64;
    let pair = motions.windows(2).find(|pair| off(&pair[0]) * off(&pair[1]) <= 0.0)?;
    let share = off(&pair[0]) / (off(&pair[0]) - off(&pair[1]));
    let size = pair[0].series.len().max(pair[1].series.len());
    let at = |end: usize, i: usize| pair[end].series.get(i).copied().unwrap_or(0.0);
    let series = (0..size).map(|i| at(0, i) + share * (at(1, i) - at(0, i))).collect();
    share.is_finite().then_some(Start { value, period, series })
}

/// Returns the linear response of a balance, or rest if there is none: the first step of Newton's method from rest.
fn linear(balance: &mut Balance) -> Vec<f64> {
    let n = balance.dimension();
    let mut lu = Lu::default();
    let mut residual = vec![0.0; n];
    let rest = vec![0.0; n];
    balance.derivatives(&rest, &[], &mut residual, lu.zeroed(n), n);
    if lu.factor().is_err() {
        return rest;
    }
    lu.solve(&mut residual);
    residual.iter().map(|value| -value).collect()
}

/// Returns a series of m unknowns shifted in time: u(τ + φ), φ being a phase of the first harmonic.
fn shifted(series: &[f64], m: usize, phase_rad: f64) -> Vec<f64> {
    let mut shifted = series[..m].to_vec();
    for (k, pair) in (1..).zip(series[m..].chunks_exact(2 * m)) {
        let (sine, cosine) = libm::sincos(f64::from(k) * phase_rad);
        let (c, s) = pair.split_at(m);
        shifted.extend(c.iter().zip(s).map(|(c, s)| c * cosine + s * sine));
        shifted.extend(c.iter().zip(s).map(|(c, s)| s * cosine - c * sine));
    }
    shifted
}

/// Returns the size of a series of m unknowns, and that of its harmonics that the drive has not. Neither a shift in time
/// nor an exchange of equal places changes them.
fn sizes(series: &[f64], m: usize, period: usize) -> [f64; 2] {
    let harmonics = (1_usize..).zip(series[m..].chunks_exact(2 * m));
    let others = harmonics.filter(|(k, _)| k % period != 0).map(|(_, pair)| dot(pair, pair)).sum();
    [norm(series), libm::sqrt(others)]
}

/// Says whether two responses with these sizes are the same.
fn are_same(a: [f64; 2], b: [f64; 2], truncation: f64) -> bool {
    let tolerance = SAME.max(SAME_TOLERANCES * truncation) * a[0];
    (a[0] - b[0]).abs() < tolerance && (a[1] - b[1]).abs() < tolerance
}
