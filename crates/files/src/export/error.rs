//! Errors of an export.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::{ExportFormat, RecordingPart};
use crate::recording::RecordingError;
use resonarm_numeric::number::short;
use resonarm_scenario::ScenarioError;

/// Why a recording can't be exported.
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
    /// The format can't hold what was asked for.
    #[error("{format} holds no {part}, only {}; csv holds all", names(.format.parts()))]
    RecordingPart {
        /// Export format that was requested.
        format: ExportFormat,
        /// What was asked for.
        part: RecordingPart,
    },
    /// The moving arm in a format that has no room for it.
    #[error("{format} holds no moving arm, only foxglove does")]
    MovingArm {
        /// Export format that was requested.
        format: ExportFormat,
    },
    /// Vibrations can't be drawn so many times as large.
    #[error("vibrations can't be drawn {} times as large: it must be above 0", short(.got))]
    Magnification {
        /// Requested magnification of the vibrations.
        got: f64,
    },
    /// Nothing says where the points of the structure are.
    #[error(
        "nothing says where the points of the structure are, so it can't be drawn: leave out --moving-arm; a scenario places \
         them in [structure.points]"
    )]
    NoPlaces,
    /// The recording's scenario makes nothing that could be drawn.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// There is nothing to write.
    #[error("the recording has nothing that {format} holds: {}", names(.format.parts()))]
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
    /// A sound file has a whole number of samples a second.
    #[error("a sound file has a whole number of samples a second, the recording {}", short(.rate_hz))]
    Rate {
        /// Sampling rate of the recording, Hz.
        rate_hz: f64,
    },
    /// A sound file states its length in 32 bits.
    #[error("{rows} samples of {channels} channels are more than a sound file holds, 4 GiB: choose a time range")]
    Long {
        /// Number of samples to be written.
        rows: u64,
        /// Number of channels to be written.
        channels: usize,
    },
}

fn names(parts: &[RecordingPart]) -> String {
    parts.iter().map(|part| part.name()).collect::<Vec<_>>().join(", ")
}

/// A text that names no [`ExportFormat`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}", unknown_format(.got))]
pub struct UnknownExportFormat {
    /// Text that names no export format.
    pub got: String,
}

fn unknown_format(got: &str) -> String {
    match got {
        "parquet" | "mf4" => {
            format!("the Python package writes it: `python3 -m resonarm export RECORDING --to {got}` (docs/python.md)")
        }
        _ => format!("it is one of {}", ExportFormat::ALL.map(ExportFormat::name).join(", ")),
    }
}

/// A text that names no [`RecordingPart`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("it is one of {}", names(&RecordingPart::ALL))]
pub struct UnknownRecordingPart {
    /// Text that names no part of a recording.
    pub got: String,
}
