//! The frequencies of a structure's sweep.

use alloc::vec::Vec;

use resonarm_dynamics::structure::Dof;

use super::StroboscopicMap;
use crate::resonances::{Summit, summits};
use crate::structure::{Branch, Coordinate, Forced, TraceOptions, trace};
use crate::time_domain::{Grid, STEPS, TimeDomainError};
use crate::{AnalysisError, EndedEarly};

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

impl Branch {
    /// The maxima of each displacement that is read, from which the branch falls to less than 1/√2 on both sides.
    pub fn resonances(&self) -> Vec<Resonance> {
        let readings = self.orbits.first().map_or(0, |orbit| orbit.readings.len());
        let of = |reading: usize| {
            let curve: Vec<(f64, f64)> =
                self.orbits.iter().map(|orbit| (orbit.frequency_hz, orbit.readings[reading].largest)).collect();
            summits(&curve).into_iter().map(move |Summit { frequency_hz, amplitude, width_hz }| Resonance {
                reading,
                frequency_hz,
                largest: amplitude,
                width_hz,
            })
        };
        (0..readings).flat_map(of).collect()
    }
}

/// The frequencies of a sweep, Hz, and what they miss; see [`crate::time_domain::SweepFrequencies`].
#[derive(Clone, Debug, PartialEq)]
pub struct SweepFrequencies {
    /// The frequencies.
    pub grid: Grid,
    /// The resonances that are narrower than the steps.
    pub stepped_over: Vec<Resonance>,
    /// Why the resonances are known only in a part of the interval; none if they are known in all of it.
    pub unknown_beyond: Option<AnalysisError>,
}

impl SweepFrequencies {
    /// `steps` frequencies between two ends, evenly spaced; without a number 101, and between them those of the stable
    /// motions of the branch. Resonances are looked for in the displacements `read`.
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
        let step_hz = grid.values()[1] - grid.values()[0];
        let ends = [from_hz.min(to_hz), from_hz.max(to_hz)];
        // Refuses invalid sweeps before the search for resonances.
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
            Some(_) => stepped_over.extend(branch.resonances().into_iter().filter(|found| found.width_hz < step_hz)),
        }
        Ok(SweepFrequencies { grid, stepped_over, unknown_beyond })
    }
}
