//! What can go wrong with a recording.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use mcap::McapError;

/// Why a recording can't be written or read.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file is there already, and overwriting was not asked for.
    #[error("recording `{path}` already exists: name another file, or allow overwriting it (--overwrite)")]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The file can't be created.
    #[error("can't create recording `{path}`: {source}; name a file in a directory that exists and is writable")]
    Create {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: Arc<io::Error>,
    },
    /// An option has a value that makes no sense.
    #[error("recording option `{option}` is {got}, expected {expected}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// Its value.
        got: String,
        /// Which values it may have.
        expected: &'static str,
    },
    /// Writing failed, for example because the disk is full.
    #[error("can't write recording `{path}`: {source}; what was flushed before can be read")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: Arc<io::Error>,
    },
    /// The MCAP library refused a record.
    #[error("can't write recording `{path}`: {source}; what was flushed before can be read")]
    Format {
        /// The file.
        path: PathBuf,
        /// What the library says.
        source: Arc<McapError>,
    },
    /// The writer thread ended by itself.
    #[error("the thread that writes recording `{path}` has died; what was flushed before can be read")]
    WriterDied {
        /// The file.
        path: PathBuf,
    },
    /// A record came after the recording was finished.
    #[error("recording `{path}` is finished: it takes no more records")]
    Finished {
        /// The file.
        path: PathBuf,
    },
}

impl RecordingError {
    /// A failure while writing `path`.
    pub(super) fn write(path: &std::path::Path, error: McapError) -> RecordingError {
        let path = path.to_path_buf();
        match error {
            McapError::Io(source) => RecordingError::Write { path, source: Arc::new(source) },
            source => RecordingError::Format { path, source: Arc::new(source) },
        }
    }
}
