//! Errors of the paper's figures and claims.

use thiserror::Error;

use super::measured::MeasuredError;
use super::settings::SettingsError;
use resonarm_analysis::AnalysisError;
use resonarm_dynamics::structure::{StepError, StructureError};
use resonarm_numeric::number::{rounded, short};

/// Error of a figure or claim that could not be computed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PaperError {
    /// The settings are invalid, or ask for something impossible.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The measured points can't be used.
    #[error(transparent)]
    Measured(#[from] MeasuredError),
    /// The preset can't be read, or the arm is invalid.
    #[error(transparent)]
    Structure(#[from] StructureError),
    /// A curve could not be followed.
    #[error("{structure} at β2 = {beta2_deg}°, {drive}: {source}", beta2_deg = short(.beta2_deg))]
    Analysis {
        /// The name of the preset or of the structure.
        structure: String,
        /// β2 of the pose, degrees.
        beta2_deg: f64,
        /// The excitation in words.
        drive: String,
        /// The reason, and what to try.
        source: Box<AnalysisError>,
    },
    /// An integration step failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The curve of a claim has no resonance where one is expected.
    #[error(
        "{structure} at β2 = {beta2_deg}°: the branch has no periodic response between {from_hz} and {to_hz} Hz",
        beta2_deg = short(.beta2_deg), from_hz = rounded(.from_hz, 3), to_hz = rounded(.to_hz, 3)
    )]
    NoResponse {
        /// The name of the preset or of the structure.
        structure: String,
        /// β2 of the pose, degrees.
        beta2_deg: f64,
        /// Start of the range, Hz.
        from_hz: f64,
        /// End of the range, Hz.
        to_hz: f64,
    },
}
