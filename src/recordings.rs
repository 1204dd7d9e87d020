//! Flags, steps and notes that the commands on recordings share.

use std::fs::File;
use std::path::Path;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::help::heading;
use resonarm::recording::{Existing, Integrity, Recording};

/// A range of simulated time: its beginning and its end.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = heading::RECORDS)]
pub(crate) struct TimeRange {
    /// First simulated time, s [default: the beginning].
    #[arg(long, value_name = "S")]
    pub from_s: Option<f64>,
    /// Last simulated time, s [default: the end].
    #[arg(long, value_name = "S")]
    pub to_s: Option<f64>,
}

/// Opens a recording, and warns if it is not whole.
pub(crate) fn open(path: &Path) -> Result<Recording, Failure> {
    let recording = Recording::open(path)?;
    integrity_note(recording.integrity()).iter().for_each(|note| tracing::warn!("{note}"));
    Ok(recording)
}

/// Opens one of several recordings, and warns with its path if it is not whole.
pub(crate) fn open_one(path: impl AsRef<Path>) -> Result<Recording, Failure> {
    let recording = Recording::open(path)?;
    warn_of_one(&recording);
    Ok(recording)
}

/// Warns if one of several recordings is not whole.
pub(crate) fn warn_of_one(recording: &Recording) {
    let path = recording.path().display();
    integrity_note(recording.integrity()).iter().for_each(|note| tracing::warn!("{path}: {note}"));
}

/// Returns the verdict of a command that has used the readable part of a recording: negative if it is not whole,
/// however well the rest went.
pub(crate) fn verdict(recording: &Recording) -> Verdict {
    Verdict::of(*recording.integrity() == Integrity::Complete)
}

/// Returns the note on a recording that is not whole.
pub(crate) fn integrity_note(integrity: &Integrity) -> Option<String> {
    let last = |sample: &Option<u64>| sample.map_or(String::from("no sample"), |last| format!("samples up to {last}"));
    match integrity {
        Integrity::Complete => None,
        Integrity::Unfinished => Some(String::from("the recording was recovered from a truncated or damaged one")),
        Integrity::Incomplete { cause } => Some(format!("the recording is not whole: {cause}")),
        Integrity::Truncated { readable_bytes, file_bytes, last_sample } => Some(format!(
            "the recording is truncated: {readable_bytes} of {file_bytes} bytes can be read, {}",
            last(last_sample)
        )),
        Integrity::Damaged { readable_bytes, file_bytes, last_sample, cause } => Some(format!(
            "the recording is damaged ({cause}): {readable_bytes} of {file_bytes} bytes can be read, {}",
            last(last_sample)
        )),
    }
}

/// Says whether an existing recording is overwritten or is an error.
pub(crate) const fn existing(overwrite: bool) -> Existing {
    if overwrite { Existing::Overwrite } else { Existing::Refuse }
}

/// Waits for the reader of a named pipe to which a command will record, and keeps the pipe open until the returned value
/// is dropped: the recorder, which has no way to give up, then doesn't wait. Until here signals end the process.
pub(crate) fn wait_for_reader(path: &Path) -> Result<Option<File>, Failure> {
    resonarm::wait_for_reader(path).map_err(Failure::write(path))
}
