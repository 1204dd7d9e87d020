//! Stepped sweeps: a parameter of the excitation set to one value after the other, the motion carried over.
//!
//! A resonance of the arm is 0.004 Hz wide, and even steps over a few hertz miss it. So [`SweepFrequencies`] without a
//! number of steps has the frequencies of the stable motions of the computed branch, too, which are dense along a peak.

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use super::{StroboscopicMap, TimeDomainError};
use crate::{AnalysisError, EndedEarly, Resonance, forced_response};
use resonarm_dynamics::arm::{Arm, Load, Sine};

/// Most points of a sweep.
const MOST_POINTS: u32 = 1_000_000;
/// Evenly spaced frequencies of a sweep whose number is not given.
pub(crate) const STEPS: u32 = 101;

/// The parameter that is stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SweepParameter {
    /// The frequency of the excitation, Hz, at a constant amplitude.
    Frequency {
        /// The peak load.
        amplitude: Load,
    },
    /// The amplitude of the excitation at a constant frequency.
    Amplitude {
        /// The peak load at the value 1, for example 1 N·m or 1 N.
        unit: Load,
        /// The frequency, Hz.
        frequency_hz: f64,
    },
}

/// The order of the values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// From the lowest.
    Up,
    /// From the highest.
    Down,
}

impl Direction {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            Direction::Up => "up",
            Direction::Down => "down",
        }
    }
}

/// The values of a sweep, rising.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    values: Vec<f64>,
}

impl Grid {
    /// `points` values evenly spaced between two ends, given in either order, both among them.
    ///
    /// # Errors
    /// [`TimeDomainError::Interval`] unless both ends are numbers and differ, [`TimeDomainError::Points`] for fewer
    /// than two points or more than a million.
    pub fn new(from: f64, to: f64, points: u32) -> Result<Grid, TimeDomainError> {
        if !(from.is_finite() && to.is_finite() && from != to) {
            return Err(TimeDomainError::Interval { from, to });
        }
        if !(2..=MOST_POINTS).contains(&points) {
            return Err(TimeDomainError::Points { got: points, most: MOST_POINTS });
        }
        let (low, high, last) = (from.min(to), from.max(to), points - 1);
        let value = |rank| (low * f64::from(last - rank) + high * f64::from(rank)) / f64::from(last);
        Ok(Grid { values: (0..points).map(value).collect() })
    }

    /// The same with further values; those beyond the ends are left out.
    pub fn with(mut self, values: impl IntoIterator<Item = f64>) -> Grid {
        let (low, high) = (self.values[0], self.values[self.values.len() - 1]);
        self.values.extend(values.into_iter().filter(|value| (low..=high).contains(value)));
        self.values.sort_by(f64::total_cmp);
        self.values.dedup();
        self
    }

    /// The values, rising.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The values in the order of a sweep.
    pub fn in_order(&self, direction: Direction) -> Vec<f64> {
        match direction {
            Direction::Up => self.values.clone(),
            Direction::Down => self.values.iter().rev().copied().collect(),
        }
    }
}

/// The frequencies of a sweep, Hz, and what they miss.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepFrequencies {
    /// The frequencies.
    pub grid: Grid,
    /// The resonances in whose half-power band no step lies.
    pub stepped_over: Vec<Resonance>,
    /// Why the resonances are known only in a part of the interval; none if they are known in all of it.
    pub unknown_beyond: Option<AnalysisError>,
}

impl SweepFrequencies {
    /// `steps` frequencies between two ends, evenly spaced; without a number 101, and between them as many as the
    /// resonances of the forced response need.
    ///
    /// # Errors
    /// As [`Grid::new`] and [`StroboscopicMap::new`].
    pub fn new(
        arm: &Arm,
        load: &Load,
        [from_hz, to_hz]: [f64; 2],
        steps: Option<u32>,
    ) -> Result<SweepFrequencies, TimeDomainError> {
        let mut grid = Grid::new(from_hz, to_hz, steps.unwrap_or(STEPS))?;
        let ends = [from_hz.min(to_hz), from_hz.max(to_hz)];
        // Refuses invalid sweeps before the search for resonances.
        StroboscopicMap::new(arm, Sine { amplitude: *load, frequency_hz: ends[0] })?;
        let (branch, unknown_beyond) = match forced_response(arm, load, ends) {
            Ok(branch) => (branch, None),
            Err(EndedEarly { reason, so_far }) => (*so_far, Some(reason)),
        };
        let mut stepped_over = Vec::new();
        match steps {
            None => grid = grid.with(branch.stable_frequencies_hz()),
            Some(_) => stepped_over = branch.resonances_missed_by(grid.values()),
        }
        Ok(SweepFrequencies { grid, stepped_over, unknown_beyond })
    }
}

/// A stepped sweep of one arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// The parameter that is stepped.
    pub parameter: SweepParameter,
    /// Its values: Hz, or multiples of the unit load.
    pub grid: Grid,
    /// Their order.
    pub direction: Direction,
}

impl Sweep {
    /// The values in the order of the sweep.
    pub fn values(&self) -> Vec<f64> {
        self.grid.in_order(self.direction)
    }

    /// The excitations in the order of the sweep.
    pub fn sines(&self) -> Vec<Sine> {
        self.values().into_iter().map(|value| self.parameter.sine(value)).collect()
    }
}

impl SweepParameter {
    /// The excitation at a value.
    pub fn sine(&self, value: f64) -> Sine {
        match *self {
            SweepParameter::Frequency { amplitude } => Sine { amplitude, frequency_hz: value },
            SweepParameter::Amplitude { unit, frequency_hz } => Sine { amplitude: unit.scaled(value), frequency_hz },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::arm_at;
    use resonarm_dynamics::arm::Preset;

    /// A resonance is narrower than 0.1 Hz: few steps miss it, and frequencies without a number of steps don't.
    #[test]
    fn frequencies_resolve_a_resonance_or_say_that_they_do_not() {
        let (arm, load) = (arm_at(Preset::Irb1600Fitted, 0.0, 60.0), Load::torque_nm(1.0, 0.0));
        let few = SweepFrequencies::new(&arm, &load, [22.3, 21.9], Some(5)).unwrap();
        assert_eq!((few.grid.values().len(), few.stepped_over.len()), (5, 2));
        let all = SweepFrequencies::new(&arm, &load, [22.3, 21.9], None).unwrap();
        let values = all.grid.values();
        assert!(values.len() > 110 && all.stepped_over.is_empty() && all.unknown_beyond.is_none(), "{values:?}");
    }
}
