//! Errors of an export.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::ExportFormat;
use super::recording_part::RecordingPart;
use crate::recording::RecordingError;
use resonarm_numeric::number::short;
use resonarm_scenario::ScenarioError;

/// Error of an export.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The recording can't be read, or has a gap where the format needs every sample.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A file can't be written.
    #[error("can't write {}: {source}", path.display())]
    Write {
        /// Path of the file that can't be written.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The format can't hold the requested records.
    #[error("{format} can't hold {part}, only {}; use csv, which can hold all", RecordingPart::names(.format.parts()))]
    RecordingPart {
        /// Export format that was requested.
        format: ExportFormat,
        /// Records that were requested.
        part: RecordingPart,
    },
    /// The format can't hold the moving arm.
    #[error("{format} can't hold the moving arm; use foxglove")]
    MovingArm {
        /// Export format that was requested.
        format: ExportFormat,
    },
    /// The magnification of the vibrations is not positive.
    #[error("the magnification of the vibrations is {}: it must be above 0", short(.got))]
    Magnification {
        /// Requested magnification of the vibrations.
        got: f64,
    },
    /// The positions of the structure's points are not known.
    #[error(
        "the positions of the structure's points are not known, so it can't be drawn; leave out --moving-arm, or place the points \
         in [structure.points] of the scenario"
    )]
    NoPlaces,
    /// The recording's scenario has no structure that can be drawn.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The recording has no records that the format can hold.
    #[error("the recording has no records that {format} can hold: {}", RecordingPart::names(.format.parts()))]
    Nothing {
        /// Export format that was requested.
        format: ExportFormat,
    },
    /// No sample lies between the two times.
    #[error(
        "there is no sample from {} to {} s: the recording has those from {} to {} s",
        short(.from_s), short(.to_s), short(.first_s), short(.last_s)
    )]
    Interval {
        /// Start of the requested interval, s.
        from_s: f64,
        /// End of the requested interval, s.
        to_s: f64,
        /// The recording's first sample, s.
        first_s: f64,
        /// The recording's last sample, s.
        last_s: f64,
    },
    /// A sound file needs a whole number of samples a second.
    #[error("a sound file needs a whole number of samples a second, but the recording has {}", short(.rate_hz))]
    Rate {
        /// Sampling rate of the recording, Hz.
        rate_hz: f64,
    },
    /// A sound file states its length in 32 bits.
    #[error("{rows} samples of {channels} channels exceed the limit of a sound file, 4 GiB; choose a time range")]
    Long {
        /// Number of samples to be written.
        rows: u64,
        /// Number of channels to be written.
        channels: usize,
    },
}

/// Error of a text that is not the name of an [`ExportFormat`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}", unknown_format(.got))]
pub struct UnknownExportFormat {
    /// Text that names no export format.
    pub got: String,
}

fn unknown_format(got: &str) -> String {
    match got {
        "parquet" | "mf4" => {
            format!("use the Python package: `python3 -m resonarm export RECORDING --to {got}` (docs/python.md)")
        }
        _ => format!("it must be one of {}", ExportFormat::ALL.map(ExportFormat::name).join(", ")),
    }
}
