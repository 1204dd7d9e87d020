//! Stepped sweeps and their values.

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use super::error::TimeDomainError;
use super::map::StroboscopicMap;
use crate::forced::{Coordinate, Forced};

/// Most points of a sweep.
const MOST_POINTS: u32 = 1_000_000;
/// Number of evenly spaced frequencies in a sweep if the user gives none.
pub(crate) const STEPS: u32 = 101;

/// The order of the values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// From the lowest value to the highest.
    Up,
    /// From the highest value to the lowest.
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
    /// Returns `points` values evenly spaced between two ends, given in either order, both among them.
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
        let low = from.min(to);
        let high = from.max(to);
        let last = points - 1;
        let value = |rank| (low * f64::from(last - rank) + high * f64::from(rank)) / f64::from(last);
        Ok(Grid { values: (0..points).map(value).collect() })
    }

    /// Returns the grid with further values; those beyond the ends are left out.
    pub fn with(mut self, values: impl IntoIterator<Item = f64>) -> Grid {
        let low = self.values[0];
        let high = self.values[self.values.len() - 1];
        self.values.extend(values.into_iter().filter(|value| (low..=high).contains(value)));
        self.values.sort_by(f64::total_cmp);
        self.values.dedup();
        self
    }

    /// The values in rising order.
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

/// A stepped sweep: the frequency or the amplitude of the drive, or a parameter of the structure, is set to one value
/// after the other, and the response settles at each from where the last one ended.
///
/// The state is carried over as it is: coordinates count from the rest of each structure. With one value the sweep is a
/// single response, whose section [`settle`](super::settle()) returns; over many the sections are a bifurcation
/// diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// The structure and its drive.
    pub forced: Forced,
    /// The frequency of the drive, Hz, if the frequency is not swept.
    pub frequency_hz: f64,
    /// The quantity that is swept: frequency, amplitude, or a parameter of the structure.
    pub over: Coordinate,
    /// Its values in the order of the sweep, as [`Grid::in_order`](crate::time_domain::Grid::in_order) has them.
    pub values: Vec<f64>,
}

impl Sweep {
    /// Returns the stroboscopic map at a value.
    ///
    /// # Errors
    /// [`TimeDomainError::Structure`] if no structure has this value of the parameter; otherwise as
    /// [`StroboscopicMap::new`].
    pub fn map(&self, value: f64) -> Result<StroboscopicMap, TimeDomainError> {
        match self.over {
            Coordinate::FrequencyHz => StroboscopicMap::new(&self.forced, value),
            Coordinate::Amplitude => StroboscopicMap::new(&self.forced.with_amplitude(value), self.frequency_hz),
            Coordinate::Parameter(parameter) => {
                StroboscopicMap::new(&self.forced.with_parameter(parameter, value)?, self.frequency_hz)
            }
        }
    }

    /// Rejects a sweep with a value at which nothing can be computed.
    ///
    /// # Errors
    /// As [`Sweep::map`], for the first such value.
    pub fn check(&self) -> Result<(), TimeDomainError> {
        self.values.iter().try_for_each(|value| self.map(*value).map(drop))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_rise_and_go_in_the_order_of_a_sweep() {
        insta::assert_snapshot!(Grid::new(23.0, 23.0, 10).unwrap_err(), @"the sweep goes from 23 to 23: its ends must be two different numbers");
        insta::assert_snapshot!(Grid::new(f64::NAN, 21.0, 10).unwrap_err(), @"the sweep goes from NaN to 21: its ends must be two different numbers");
        insta::assert_snapshot!(Grid::new(21.0, 23.0, 1).unwrap_err(), @"the number of points of the sweep is 1: it must be from 2, one at each end, to 1000000");
        assert_eq!(Grid::new(23.0, 21.0, 3).unwrap().values(), [21.0, 22.0, 23.0]);
        let more = Grid::new(21.0, 23.0, 2).unwrap().with([24.0, 22.5, 21.0]);
        assert_eq!(more.in_order(Direction::Down), [23.0, 22.5, 21.0]);
    }
}
