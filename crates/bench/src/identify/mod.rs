//! Identification: frequency responses and modes from recorded readings.
//!
//! A [`Record`] holds the force in the impedance head and the accelerations of B and C.
//! [`frequency_response()`] averages it like a bench analyser; [`modes`](fn@modes) fits natural frequencies and
//! damping ratios to it. Both use readings only, and no model of the arm. [`joint_angles`] finds the arm's
//! angles over time from the accelerations, given its lengths and pose.

mod angle_history;
mod double_integration;
mod droop;
mod error;
mod frequency_response;
mod least_squares;
mod mode_fit;
mod modes;
mod record;

pub use angle_history::{AngleHistory, AngleSettings, Residual, joint_angles};
pub use double_integration::Integration;
pub use error::IdentifyError;
pub use frequency_response::{Averaging, FrequencyResponseEstimate, frequency_response};
pub use modes::{FittedPart, Identification, IdentifiedMode, MOST_NOISE_SHARE, RejectedPeak, Rejection, modes};
pub use record::{Band, CHANNELS, Direction, Record};

#[cfg(test)]
mod angle_tests;
#[cfg(test)]
mod tests;
