//! The stable periodic responses of a structure at a frequency, and the states that reach them.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use resonarm_dynamics::structure::Dof;

use super::error::TimeDomainError;
use super::fates::{Attractor, BasinOutcome, fates};
use super::fixed_point::FixedPoint;
use super::map::StroboscopicMap;
use super::measure::{Measured, measure};
use super::settle::{SettleOptions, follow};
use crate::branch::trace;
use crate::detached::SearchOptions;
use crate::error::EndedEarly;
use crate::forced::{Coordinate, Forced};
use crate::orbit::{Branch, Reading};
use crate::phase_zero::phase_zero_states;
use crate::switching::{OtherBranch, OtherOptions, trace_branches};
use crate::trace_options::TraceOptions;

/// The branch is traced between these multiples of the frequency, or of natural frequencies beside it, to find the responses
/// at it.
const WINDOW: [f64; 2] = [0.75, 4.0 / 3.0];
/// The nearest natural frequencies within this factor count: the search for isolas tries responses of the order of the
/// largest on the branch, so that the branch has to pass the resonances of which an isola may be a part.
const BESIDE_RESONANCE: f64 = 3.0;
/// A grid of initial states reaches this many times as far as the largest stable response.
const REACH: f64 = 1.5;
/// Distance, as a fraction of its size, from an unstable response at which a trajectory starts.
const BESIDE: f64 = 1e-3;
/// Time constants of the slowest mode in which a trajectory that settles on a known response usually has come near it.
const CERTAIN_WITHIN: f64 = 10.0;

/// A stable periodic response of a structure.
#[derive(Clone, Debug, PartialEq)]
pub struct StableOrbit {
    /// Periods of the drive after which the response repeats.
    pub period: u32,
    /// Largest magnitude of its Floquet multipliers, over its own period.
    pub largest_multiplier: f64,
    /// The coordinates, rad or m·√kg.
    pub coordinates: Vec<Reading>,
    /// The degrees of freedom that are read, m or rad.
    pub readings: Vec<Reading>,
    /// The states at phase 0 of the drive: coordinates, rates, states of elements.
    pub section: Vec<Vec<f64>>,
    attractor: Attractor,
}

impl StableOrbit {
    fn new(map: &StroboscopicMap, read: &[Dof], found: &FixedPoint) -> Result<StableOrbit, TimeDomainError> {
        let Measured { coordinates, readings, section } =
            measure(map, read, &map.to_state(&found.point), found.period)?;
        Ok(StableOrbit {
            period: found.period,
            largest_multiplier: found.largest_multiplier,
            coordinates,
            readings,
            attractor: Attractor::new(map, found, &section),
            section,
        })
    }
}

/// Returns how far a grid of initial states extends in a coordinate, from 0, or past the responses in a rate, to show
/// the surroundings of the responses under a drive of this frequency.
pub fn reach(orbits: &[StableOrbit], index: usize, frequency_hz: f64) -> f64 {
    let of = |orbit: &StableOrbit| {
        let n = orbit.coordinates.len();
        orbit.coordinates[index % n].largest * if index < n { 1.0 } else { TAU * frequency_hz }
    };
    REACH * orbits.iter().map(of).fold(0.0, f64::max)
}

/// Returns the frequencies between which the branch is traced, Hz.
fn window(forced: &Forced, frequency_hz: f64) -> [f64; 2] {
    let resonances = || forced.assembly().modes().iter().map(|mode| mode.frequency_hz);
    let below = resonances().filter(|hz| (frequency_hz / BESIDE_RESONANCE..frequency_hz).contains(hz));
    let above = resonances().filter(|hz| (frequency_hz..frequency_hz * BESIDE_RESONANCE).contains(hz));
    let lowest = below.max_by(f64::total_cmp);
    let highest = above.min_by(f64::total_cmp);
    [WINDOW[0] * lowest.unwrap_or(frequency_hz), WINDOW[1] * highest.unwrap_or(frequency_hz)]
}

/// Finds the stable periodic responses of a driven structure at a frequency, in order of the first displacement that is
/// read: those of the branch over the frequency, traced from ¾ to 4/3 of it and past the nearest resonances, of the isolas
/// that a search finds beside it ([`SearchOptions::default`]), and those in which the structure settles from beside an
/// unstable response of these, as one of twice the period. A branch that ended early is returned, too; responses beyond its
/// end are missing.
///
/// # Errors
/// [`StroboscopicMap::new`]; [`TimeDomainError::Step`] if a trajectory can't be followed; [`TimeDomainError::Stopped`]
/// if `stop` returned `true`.
pub fn stable_orbits(
    forced: &Forced,
    read: &[Dof],
    frequency_hz: f64,
    stop: &dyn Fn() -> bool,
) -> Result<(Vec<StableOrbit>, Option<EndedEarly<Branch>>), TimeDomainError> {
    let map = StroboscopicMap::new(forced, frequency_hz)?;
    let window = window(forced, frequency_hz);
    let options = TraceOptions::new(forced, Coordinate::FrequencyHz, window, read.to_vec());
    let (branch, early) = match trace(forced, window[0], Coordinate::FrequencyHz, &options) {
        Ok(branch) => (branch, None),
        Err(early) => ((*early.so_far).clone(), Some(early)),
    };
    let mut orbits: Vec<StableOrbit> = Vec::new();
    let mut unstable = Vec::new();
    let keep = |orbits: &mut Vec<StableOrbit>, found: Option<FixedPoint>| -> Result<bool, TimeDomainError> {
        let Some(found) = found else { return Ok(false) };
        if !orbits.iter().any(|orbit| orbit.attractor.holds(&found.point)) {
            orbits.push(StableOrbit::new(&map, read, &found)?);
        }
        Ok(true)
    };
    let wanted = OtherOptions { leaving: false, search: Some(SearchOptions::default()) };
    let others = trace_branches(forced, &branch, Coordinate::FrequencyHz, &options, &wanted).branches;
    let branches = core::iter::once(&branch).chain(others.iter().map(OtherBranch::branch));
    for state in branches.flat_map(|branch| phase_zero_states(forced, branch, frequency_hz, &options)) {
        // Without a stable fixed point here this response of its branch is unstable. The states beside it lead to
        // others, as of twice the period.
        if !keep(&mut orbits, FixedPoint::shoot(&map, &map.to_point(&state), 1))? {
            unstable.push(state);
        }
    }
    let beside = unstable.iter().map(|state| state.iter().map(|number| number * (1.0 + BESIDE)).collect());
    for start in leading_elsewhere(&map, &orbits, beside.collect(), stop)? {
        let followed = follow(&map, &start, &SettleOptions::default(), stop)?;
        if let Some(period) = followed.period {
            keep(&mut orbits, FixedPoint::shoot(&map, &map.to_point(&followed.start), period))?;
        }
    }
    let size = |orbit: &StableOrbit| orbit.readings.first().map_or(0.0, |reading| reading.largest);
    orbits.sort_by(|a, b| size(a).total_cmp(&size(b)));
    Ok((orbits, early))
}

/// Returns those of some initial states that are not certain to settle on one of the responses. Their fates are computed
/// side by side, and are certain long before a trajectory has settled, so that few have to be followed alone.
fn leading_elsewhere(
    map: &StroboscopicMap,
    orbits: &[StableOrbit],
    starts: Vec<Vec<f64>>,
    stop: &dyn Fn() -> bool,
) -> Result<Vec<Vec<f64>>, TimeDomainError> {
    if orbits.is_empty() || starts.is_empty() {
        return Ok(starts);
    }
    let fates = outcomes(map, orbits, &starts, CERTAIN_WITHIN, stop)?;
    let elsewhere = |fate: &BasinOutcome| !matches!(fate, BasinOutcome::Reaches { .. });
    Ok(starts.into_iter().zip(fates).filter_map(|(start, fate)| elsewhere(&fate).then_some(start)).collect())
}

/// Finds the stable periodic responses, other than the `known` ones, on which states given at phase 0 settle. Each is
/// integrated alone and for up to 40 time constants of the slowest mode, so that a few states are enough.
///
/// # Errors
/// As [`stable_orbits`].
pub fn further_orbits(
    forced: &Forced,
    read: &[Dof],
    frequency_hz: f64,
    known: &[StableOrbit],
    starts: &[Vec<f64>],
    stop: &dyn Fn() -> bool,
) -> Result<Vec<StableOrbit>, TimeDomainError> {
    let map = StroboscopicMap::new(forced, frequency_hz)?;
    let mut found: Vec<StableOrbit> = Vec::new();
    for start in starts {
        let followed = follow(&map, start, &SettleOptions::default(), stop)?;
        let Some(period) = followed.period else { continue };
        let Some(point) = FixedPoint::shoot(&map, &map.to_point(&followed.start), period) else { continue };
        if !known.iter().chain(&found).any(|orbit| orbit.attractor.holds(&point.point)) {
            found.push(StableOrbit::new(&map, read, &point)?);
        }
    }
    Ok(found)
}

/// Computes the fate of each initial state, given at phase 0, within `time_constants` of the structure's slowest mode.
///
/// All are integrated side by side, in stretches of a quarter of a time constant. A trajectory has reached a stable
/// response once it is within 1e-9 of it, relative to its size, or once it has approached it as the linearisation there
/// predicts: over one stretch that ends within 10 % of it, with a remainder of at most 1 % of the decay, or over
/// several with a remainder of at most a quarter of the decay each, until the deviation has halved. From there on the
/// remainder, which is of second order, falls faster than the deviation itself. Trajectories for which none of this
/// holds by the end of the wait are undecided.
///
/// # Errors
/// [`TimeDomainError::Option`] if the wait is no positive number, [`TimeDomainError::Step`] if a step can't be made for
/// another reason than that the trajectory grows without bound, [`TimeDomainError::Stopped`] if `stop` returned `true`.
pub fn outcomes(
    map: &StroboscopicMap,
    orbits: &[StableOrbit],
    starts: &[Vec<f64>],
    time_constants: f64,
    stop: &dyn Fn() -> bool,
) -> Result<Vec<BasinOutcome>, TimeDomainError> {
    let attractors: Vec<&Attractor> = orbits.iter().map(|orbit| &orbit.attractor).collect();
    fates(map, &attractors, starts, time_constants, stop)
}
