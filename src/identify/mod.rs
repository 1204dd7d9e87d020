//! Identification: frequency responses and modes from what instruments recorded.
//!
//! A [`Record`] holds the force in the impedance head and the accelerations of B and C. [`frequency_response`] averages it as
//! a bench analyser does; [`modes`](fn@modes) fits natural frequencies and damping ratios to it. Both see readings only, none of
//! the arm.

mod error;
mod frequency_response;
mod least_squares;
mod mode_fit;
mod modes;
mod record;

pub use error::IdentifyError;
pub use frequency_response::{Averaging, FrequencyResponseEstimate, frequency_response};
pub use modes::{IdentifiedMode, Part, modes};
pub use record::{Band, CHANNELS, Direction, Record};

#[cfg(test)]
mod tests;
