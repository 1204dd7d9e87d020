//! The reading of an instrument along one axis.

/// Reading of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Value in the sensor's unit.
    pub value: f64,
    /// Whether the reading, including noise, was beyond the converter's range, so that the value is the last
    /// count within it.
    pub clipped: bool,
}

impl Reading {
    /// Returns the value, unless it was clipped.
    pub fn within_range(&self) -> Option<f64> {
        (!self.clipped).then_some(self.value)
    }
}

/// Largest number of axes of an instrument.
pub(super) const MOST_AXES: usize = 3;

/// Number of readings of head, B and C, which the protocol carries.
pub(super) const NATIVE_CHANNELS: usize = 6;
