//! Identification: frequency responses and modes from recorded readings.
//!
//! A [`Record`] holds the force in the impedance head and the accelerations of the structure. [`frequency_response()`] averages
//! it like a bench analyser; [`modes`](fn@modes) fits poles and shapes to one or several, with [`resonarm_modal`]. Both use
//! readings only, and no model of the structure. [`joint_angles`] finds the arm's angles over time from the accelerations, given
//! its lengths and pose.

mod angle_history;
mod double_integration;
mod droop;
mod error;
mod frequency_response;
mod modes;
mod places;
mod record;
mod words;

pub use angle_history::{AngleHistory, AngleSettings, CHANNELS, Residual, joint_angles};
pub use double_integration::Integration;
pub use error::IdentifyError;
pub use frequency_response::{Averaging, FrequencyResponseEstimate, frequency_response};
pub use modes::{
    FunctionOf, Identification, IdentifiedMode, IdentifiedResidue, MOST_NOISE_SHARE, ReadingNoise, ResidualTerm,
    compare_levels, modes, modes_of_responses,
};
pub use places::{ReadingPlace, RigPlaces};
pub use record::{Direction, Record, RecordedResponse};
pub use resonarm_modal::{Band, ModeShift, Quantity};
pub use words::Remark;

#[cfg(test)]
mod angle_tests;
#[cfg(test)]
mod tests;
