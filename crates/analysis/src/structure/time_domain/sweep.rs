//! Stepped sweeps of a structure.

use alloc::vec::Vec;

use super::StroboscopicMap;
use crate::structure::{Coordinate, Forced};
use crate::time_domain::TimeDomainError;

/// A stepped sweep: the frequency or the amplitude of the drive, or a parameter of the structure, is set to one value
/// after the other, and the motion settles at each from where the last one ended.
///
/// The state is carried over as it is: coordinates count from the rest of each structure. With one value the sweep is
/// a single motion, whose section [`settle`](super::settle()) returns; over many the sections are a bifurcation
/// diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// The structure and its drive.
    pub forced: Forced,
    /// The frequency of the drive, Hz, where it is not swept.
    pub frequency_hz: f64,
    /// The quantity that is swept: frequency, amplitude, or a parameter of the structure.
    pub over: Coordinate,
    /// Its values in the order of the sweep, as [`Grid::in_order`](crate::time_domain::Grid::in_order) has them.
    pub values: Vec<f64>,
}

impl Sweep {
    /// The stroboscopic map at a value.
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

    /// Refuses a sweep with a value at which nothing can be computed.
    ///
    /// # Errors
    /// As [`Sweep::map`], for the first such value.
    pub fn check(&self) -> Result<(), TimeDomainError> {
        self.values.iter().try_for_each(|value| self.map(*value).map(drop))
    }
}
