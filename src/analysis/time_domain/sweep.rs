//! Stepped sweeps: a parameter of the excitation set to one value after the other, the motion carried over.

use serde::{Deserialize, Serialize};

use super::{SettleOptions, Settled, StroboscopicMap, TimeDomainError, settle};
use crate::arm::{Arm, Load, State};
use crate::integrate::Sine;

/// Most points of a sweep.
const MOST_POINTS: u32 = 1_000_000;

/// What is stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SweepParameter {
    /// The frequency of the excitation, Hz, at a constant amplitude.
    Frequency {
        /// The load at the crest.
        amplitude: Load,
    },
    /// The amplitude of the excitation at a constant frequency.
    Amplitude {
        /// The load at the crest for the value 1: 1 N·m or 1 N, say.
        unit: Load,
        /// The frequency, Hz.
        frequency_hz: f64,
    },
}

/// Which way the values go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// From the lowest.
    Up,
    /// From the highest.
    Down,
}

/// Evenly spaced values, both ends among them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    from: f64,
    to: f64,
    points: u32,
}

impl Grid {
    /// `points` values from `from` up to `to`.
    ///
    /// # Errors
    /// [`TimeDomainError::Interval`] unless both are numbers and `to` is above `from`, [`TimeDomainError::Points`] for less than
    /// two points or more than a million.
    pub fn new(from: f64, to: f64, points: u32) -> Result<Grid, TimeDomainError> {
        if !(from.is_finite() && to.is_finite() && from < to) {
            return Err(TimeDomainError::Interval { from, to });
        }
        if !(2..=MOST_POINTS).contains(&points) {
            return Err(TimeDomainError::Points { got: points, most: MOST_POINTS });
        }
        Ok(Grid { from, to, points })
    }

    /// The lowest value.
    pub fn from(&self) -> f64 {
        self.from
    }

    /// The highest value.
    pub fn to(&self) -> f64 {
        self.to
    }

    /// How many values there are.
    pub fn points(&self) -> u32 {
        self.points
    }

    /// The value with this number, counted from 0 in the direction; the same bits both ways.
    pub fn value(&self, direction: Direction, index: u32) -> f64 {
        let last = self.points - 1;
        let rank = match direction {
            Direction::Up => index.min(last),
            Direction::Down => last.saturating_sub(index),
        };
        (self.from * f64::from(last - rank) + self.to * f64::from(rank)) / f64::from(last)
    }
}

/// A stepped sweep of one arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// What is stepped.
    pub parameter: SweepParameter,
    /// Its values: Hz, or multiples of the unit load.
    pub grid: Grid,
    /// Which way they go.
    pub direction: Direction,
}

impl Sweep {
    /// The value with this number, counted from 0 in the direction of the sweep.
    pub fn value(&self, index: u32) -> f64 {
        self.grid.value(self.direction, index)
    }

    /// The excitation at the value with this number.
    pub fn sine(&self, index: u32) -> Sine {
        let value = self.value(index);
        match self.parameter {
            SweepParameter::Frequency { amplitude } => Sine { amplitude, frequency_hz: value },
            SweepParameter::Amplitude { unit, frequency_hz } => Sine { amplitude: unit.scaled(value), frequency_hz },
        }
    }

    /// The settled motion at the value with this number, the excitation stepping to it at phase 0 with the arm in the state
    /// `start`: at rest, or where the motion before ended.
    ///
    /// # Errors
    /// As [`StroboscopicMap::new`] and [`settle`].
    pub fn respond(
        &self,
        arm: &Arm,
        index: u32,
        start: &State,
        options: &SettleOptions,
        stop: &dyn Fn() -> bool,
    ) -> Result<Settled, TimeDomainError> {
        settle(&StroboscopicMap::new(arm, self.sine(index))?, start, options, stop)
    }
}
