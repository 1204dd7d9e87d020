//! The reading of an instrument in a message.

/// Reading of one instrument along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// The value, in the unit of its signal.
    pub value: f64,
    /// The instrument clipped it. Also set in the frame when `value` is beyond the range of a single.
    pub saturated: bool,
}
