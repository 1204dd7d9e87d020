//! Exports recordings to the formats of other tools.
//!
//! States, samples, ticks, frames and events become tables. States and samples, which have one instant for each sample,
//! also become waveforms, and frames become logs. Records are read and written one by one, so that a recording may be
//! larger than the memory.

mod channels;
mod csv;
mod error;
mod foxglove;
mod log;
mod recording_part;
pub mod scene;
mod selection;
mod uff58;
mod wav;

use core::fmt;
use core::str::FromStr;
use std::path::{Path, PathBuf};

use crate::can_log::LogFormat;
use crate::recording::Recording;

pub use error::{ExportError, UnknownExportFormat};
pub use recording_part::{RecordingPart, UnknownRecordingPart};
pub use selection::{Selection, samples};

/// File format to which a recording is exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// A table of comma-separated values for each part, with a line of names.
    Csv,
    /// The frames as a log.
    Log(LogFormat),
    /// A copy for viewers: an MCAP file with a JSON message for every state and sample, events as `foxglove.Log`,
    /// and the moving arm or structure as `foxglove.SceneUpdate`.
    Foxglove,
    /// States and samples as functions of time: dataset 58 of the Universal File Format in ASCII, SDRC 1988.
    Uff58,
    /// States and samples as channels of a sound file of 32-bit floating-point numbers in SI units.
    Wav,
}

impl ExportFormat {
    /// All formats to which a recording can be exported.
    pub const ALL: [ExportFormat; 7] = [
        ExportFormat::Csv,
        ExportFormat::Log(LogFormat::Candump),
        ExportFormat::Log(LogFormat::Asc),
        ExportFormat::Log(LogFormat::Blf),
        ExportFormat::Foxglove,
        ExportFormat::Uff58,
        ExportFormat::Wav,
    ];

    /// Returns the name, as flags have it.
    pub const fn name(self) -> &'static str {
        match self {
            ExportFormat::Csv => "csv",
            ExportFormat::Log(format) => format.name(),
            ExportFormat::Foxglove => "foxglove",
            ExportFormat::Uff58 => "uff58",
            ExportFormat::Wav => "wav",
        }
    }

    /// Returns the kinds of records that the format can hold.
    pub const fn parts(self) -> &'static [RecordingPart] {
        match self {
            ExportFormat::Csv => &RecordingPart::ALL,
            ExportFormat::Log(_) => &[RecordingPart::Frames],
            ExportFormat::Foxglove => &[RecordingPart::States, RecordingPart::Samples, RecordingPart::Events],
            ExportFormat::Uff58 | ExportFormat::Wav => &[RecordingPart::States, RecordingPart::Samples],
        }
    }

    /// Checks that the format can hold the selection.
    ///
    /// # Errors
    /// [`ExportError::RecordingPart`], [`ExportError::MovingArm`] and [`ExportError::Magnification`].
    pub fn check(self, selection: &Selection) -> Result<(), ExportError> {
        if let Some(part) = selection.parts.iter().find(|part| !self.parts().contains(part)) {
            return Err(ExportError::RecordingPart { format: self, part: *part });
        }
        match selection.magnification {
            Some(_) if self != ExportFormat::Foxglove => Err(ExportError::MovingArm { format: self }),
            Some(got) if !(got.is_finite() && got > 0.0) => Err(ExportError::Magnification { got }),
            Some(_) | None => Ok(()),
        }
    }

    /// Returns the files that STEM stands for, with the content of each.
    pub fn files(self, stem: &Path, parts: &[RecordingPart]) -> Vec<(PathBuf, Vec<RecordingPart>)> {
        let named = |ending: String| {
            let mut name = stem.as_os_str().to_owned();
            // Appended, not `with_extension`, which would replace `.5` of a stem such as `run-0.5`.
            name.push(ending);
            PathBuf::from(name)
        };
        let of_each =
            |ending: &str| parts.iter().map(|part| (named(format!("-{}{ending}", part.name())), vec![*part])).collect();
        match self {
            ExportFormat::Csv => of_each(".csv"),
            ExportFormat::Wav => of_each(".wav"),
            ExportFormat::Foxglove => vec![(named(String::from("-foxglove.mcap")), parts.to_vec())],
            ExportFormat::Uff58 => vec![(named(String::from(".uff")), parts.to_vec())],
            ExportFormat::Log(format) => vec![(named(format.ending().to_owned()), parts.to_vec())],
        }
    }
}

impl fmt::Display for ExportFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ExportFormat {
    type Err = UnknownExportFormat;

    fn from_str(text: &str) -> Result<ExportFormat, UnknownExportFormat> {
        let found = ExportFormat::ALL.into_iter().find(|format| format.name() == text);
        found.ok_or_else(|| UnknownExportFormat { got: text.to_owned() })
    }
}

/// A file that was written.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ExportedFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Rows of a table, samples of a waveform, frames of a log.
    pub rows: u64,
    /// Columns of a table, waveforms, in order, with their units; empty for a log.
    pub columns: Vec<String>,
}

/// Writes a selection of a recording to the files that STEM stands for, overwriting existing ones: the caller checks
/// first, with [`ExportFormat::files`], which may be overwritten.
///
/// # Errors
/// [`ExportError`] if the format can't hold the selection, the selection is empty, or a file can't be read or written.
pub fn export(
    recording: &Recording,
    format: ExportFormat,
    selection: &Selection,
    stem: &Path,
) -> Result<Vec<ExportedFile>, ExportError> {
    format.check(selection)?;
    let files = format.files(stem, &selection.parts);
    let each = files.into_iter();
    match format {
        // All tables are written in one pass, so that the recording is read once.
        ExportFormat::Csv => csv::write(recording, selection, each),
        ExportFormat::Log(format) => each.map(|(path, _)| log::write(recording, format, selection, path)).collect(),
        ExportFormat::Foxglove => {
            each.map(|(path, parts)| foxglove::write(recording, selection, path, &parts)).collect()
        }
        ExportFormat::Uff58 => each.map(|(path, parts)| uff58::write(recording, selection, path, parts)).collect(),
        ExportFormat::Wav => {
            let file = |(path, parts): (PathBuf, Vec<RecordingPart>)| Some((path, *parts.first()?));
            each.filter_map(file).map(|(path, part)| wav::write(recording, selection, path, part)).collect()
        }
    }
}
