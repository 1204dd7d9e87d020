//! The frequencies of a structure's sweep.
//!
//! A resonance of the arm is 0.004 Hz wide, and even steps over a few hertz miss it. So [`SweepFrequencies`] without a
//! number of steps also has the frequencies of the stable responses of the computed branch, which are dense along a
//! peak.

use alloc::vec::Vec;

use resonarm_dynamics::structure::Dof;

use super::error::TimeDomainError;
use super::map::StroboscopicMap;
use super::sweep::{Grid, STEPS};
use crate::balance::Balance;
use crate::branch::{Tracer, trace};
use crate::error::{AnalysisError, EndedEarly};
use crate::forced::{Coordinate, Forced};
use crate::orbit::{Branch, Orbit};
use crate::resonances::summits;
use crate::trace_options::TraceOptions;

/// A maximum of a displacement along a branch over the frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resonance {
    /// The degree of freedom, by its number among those read.
    pub reading: usize,
    /// The frequency of the largest displacement, Hz.
    pub frequency_hz: f64,
    /// The largest displacement, m or rad.
    pub largest: f64,
    /// The width of the band around it in which the displacement is at least 1/√2 of that, Hz.
    pub width_hz: f64,
}

/// Returns the maxima of each displacement that is read, from which the branch falls to less than 1/√2 on both sides,
/// and in whose band none of some frequencies lies; each located between the points of the branch.
fn missed(forced: &Forced, options: &TraceOptions, branch: &Branch, frequencies_hz: &[f64]) -> Vec<Resonance> {
    let mut balance =
        Balance::new(forced, options.branch.from, Coordinate::FrequencyHz, options.branch.least_harmonics);
    if !balance.set_value(options.branch.from) {
        return Vec::new();
    }
    let mut tracer = Tracer::new(balance, options);
    tracer.branch = branch.clone();
    let mut found = Vec::new();
    for (reading, &dof) in options.read.iter().enumerate() {
        let of = |orbit: &Orbit| [orbit.arclength, orbit.frequency_hz, orbit.readings[reading].largest];
        let mut curve: Vec<[f64; 3]> = branch.orbits.iter().map(of).collect();
        for maximum in tracer.located_maxima(reading) {
            curve.push([maximum.arclength, maximum.lambda, tracer.largest_at(&maximum, dof)]);
        }
        curve.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let curve: Vec<(f64, f64)> = curve.iter().map(|[_, hz, largest]| (*hz, *largest)).collect();
        let missed = summits(&curve).into_iter().filter(|summit| summit.is_missed_by(frequencies_hz));
        found.extend(missed.map(|summit| Resonance {
            reading,
            frequency_hz: summit.frequency_hz,
            largest: summit.amplitude,
            width_hz: summit.width_hz(),
        }));
    }
    found
}

/// The frequencies of a sweep, Hz, and the resonances that they miss.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepFrequencies {
    /// Frequencies of the sweep, Hz.
    pub grid: Grid,
    /// The resonances in whose half-power band no step lies.
    pub stepped_over: Vec<Resonance>,
    /// The reason for which the resonances are known only in a part of the interval; `None` if they are known in all of
    /// it.
    pub unknown_beyond: Option<AnalysisError>,
}

impl SweepFrequencies {
    /// Returns `steps` evenly spaced frequencies between two ends; without a number 101, and between them those of the
    /// stable responses of the branch. Resonances are looked for in the displacements `read`.
    ///
    /// # Errors
    /// As [`Grid::new`] and [`StroboscopicMap::new`].
    pub fn new(
        forced: &Forced,
        read: &[Dof],
        [from_hz, to_hz]: [f64; 2],
        steps: Option<u32>,
    ) -> Result<SweepFrequencies, TimeDomainError> {
        let mut grid = Grid::new(from_hz, to_hz, steps.unwrap_or(STEPS))?;
        let ends = [from_hz.min(to_hz), from_hz.max(to_hz)];
        // Rejects invalid sweeps before the search for resonances.
        StroboscopicMap::new(forced, ends[0])?;
        let options = TraceOptions::new(forced, Coordinate::FrequencyHz, ends, read.to_vec());
        let (branch, unknown_beyond) = match trace(forced, ends[0], Coordinate::FrequencyHz, &options) {
            Ok(branch) => (branch, None),
            Err(EndedEarly { reason, so_far }) => (*so_far, Some(reason)),
        };
        let mut stepped_over = Vec::new();
        match steps {
            None => {
                let stable = branch.orbits.iter().filter(|orbit| orbit.is_stable() == Some(true));
                grid = grid.with(stable.map(|orbit| orbit.frequency_hz));
            }
            Some(_) => stepped_over = missed(forced, &options, &branch, grid.values()),
        }
        Ok(SweepFrequencies { grid, stepped_over, unknown_beyond })
    }
}
