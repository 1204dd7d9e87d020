//! Errors, quantities and phase of frequency responses. [`LinearResponse`] computes the responses.
//!
//! [`LinearResponse`]: crate::LinearResponse

use thiserror::Error;

use resonarm_numeric::number::short;

mod phase;
mod quantity;

pub use phase::continuous_phase;
pub use quantity::{Quantity, UnknownQuantity};

/// Error of a frequency response that does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FrfError {
    /// The frequency is not zero or a positive number.
    #[error("frequency {got_hz} Hz: it must be zero or a positive number", got_hz = short(.got_hz))]
    Frequency {
        /// The given value, Hz.
        got_hz: f64,
    },
    /// The response is infinite: a structure without damping at a natural frequency.
    #[error(
        "the response at {frequency_hz} Hz is infinite, since nothing damps this mode; give the structure damping, or choose another frequency", frequency_hz = short(.frequency_hz))]
    Unbounded {
        /// Frequency at which it is infinite, Hz.
        frequency_hz: f64,
    },
    /// Nothing holds the structure at 0 Hz.
    #[error("the response at 0 Hz is infinite: mode {mode} is rigid, so nothing holds the structure; start above 0 Hz")]
    Rigid {
        /// The mode, from 1.
        mode: usize,
    },
}
