//! The values of stepped sweeps.

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use super::TimeDomainError;

/// Most points of a sweep.
const MOST_POINTS: u32 = 1_000_000;
/// Evenly spaced frequencies of a sweep whose number is not given.
pub(crate) const STEPS: u32 = 101;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_rise_and_go_in_the_order_of_a_sweep() {
        insta::assert_snapshot!(Grid::new(23.0, 23.0, 10).unwrap_err(), @"a sweep from 23 to 23: both ends must be numbers, and different");
        insta::assert_snapshot!(Grid::new(f64::NAN, 21.0, 10).unwrap_err(), @"a sweep from NaN to 21: both ends must be numbers, and different");
        insta::assert_snapshot!(Grid::new(21.0, 23.0, 1).unwrap_err(), @"a sweep of 1 points: it must have from 2, one at each end, to 1000000");
        assert_eq!(Grid::new(23.0, 21.0, 3).unwrap().values(), [21.0, 22.0, 23.0]);
        let more = Grid::new(21.0, 23.0, 2).unwrap().with([24.0, 22.5, 21.0]);
        assert_eq!(more.in_order(Direction::Down), [23.0, 22.5, 21.0]);
    }
}
