//! Errors of reading, writing and cutting recordings.

use std::io;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;

use mcap::McapError;

use super::layout::ChannelsError;
use super::schema::FORMAT;
use super::summary::Integrity;

/// Error of a recording that can't be written or read.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file already exists, and overwriting was not requested.
    #[error("recording `{path}` already exists: name another file, or allow overwriting it (--overwrite)")]
    Exists {
        /// Path of the existing file.
        path: PathBuf,
    },
    /// The file can't be created.
    #[error("can't create recording `{path}`: {source}; name a file in a directory that exists and is writable")]
    Create {
        /// Path of the file that can't be created.
        path: PathBuf,
        /// Error of the operating system.
        source: Arc<io::Error>,
    },
    /// An option has an invalid value.
    #[error("recording option `{option}` is {got}, expected {expected}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// Value that the option has.
        got: String,
        /// Description of the valid values.
        expected: &'static str,
    },
    /// Writing failed, for example because the disk is full.
    #[error("can't write recording `{path}`: {source}")]
    Write {
        /// Path of the recording that can't be written.
        path: PathBuf,
        /// Error of the operating system.
        source: Arc<io::Error>,
    },
    /// The MCAP library rejected a record.
    #[error("can't write recording `{path}`: {source}")]
    Format {
        /// Path of the recording that can't be written.
        path: PathBuf,
        /// Error of the MCAP library.
        source: Arc<McapError>,
    },
    /// The writer thread ended unexpectedly.
    #[error("the thread that writes recording `{path}` ended unexpectedly")]
    WriterDied {
        /// Path of the recording that is incomplete.
        path: PathBuf,
    },
    /// The file can't be opened or read.
    #[error("can't read recording `{path}`: {source}")]
    Open {
        /// Path of the recording that can't be read.
        path: PathBuf,
        /// Error of the operating system.
        source: Arc<io::Error>,
    },
    /// The path is that of a folder, a pipe or a device.
    #[error("can't read recording `{path}`: it is {got}, expected a regular file")]
    NotAFile {
        /// Path at which there is no regular file.
        path: PathBuf,
        /// Kind of file that is there, such as a folder.
        got: &'static str,
    },
    /// The file is not an MCAP file.
    #[error("`{path}` is not an MCAP file: it begins with {}", begins(.got))]
    NotMcap {
        /// Path of the file that is not MCAP.
        path: PathBuf,
        /// Its first bytes, at most 8.
        got: Vec<u8>,
    },
    /// The file ends inside a record: the run that wrote it was killed, or a copy was cut short.
    #[error("recording `{path}` ends at byte {file_bytes} inside the record that begins at byte {offset}")]
    Truncated {
        /// Path of the truncated recording.
        path: PathBuf,
        /// Position of the first incomplete record, bytes.
        offset: u64,
        /// Size of the file, bytes.
        file_bytes: u64,
    },
    /// A checksum or a layout is wrong.
    #[error("recording `{path}` is damaged in the record that begins at byte {offset}: {cause}")]
    Damaged {
        /// Path of the damaged recording.
        path: PathBuf,
        /// Position of the record, bytes.
        offset: u64,
        /// Checksum or layout that is wrong.
        cause: String,
    },
    /// The file is an MCAP file, but not a recording.
    #[error(
        "`{path}` is an MCAP file without metadata `{name}`: it was not recorded by resonarm{}", but_by(.library)
    )]
    NotARecording {
        /// Path of the MCAP file.
        path: PathBuf,
        /// Name of the metadata record.
        name: &'static str,
        /// The library that wrote the file, as its head says; empty if it doesn't.
        library: String,
    },
    /// The file was cut off, or is damaged, before its head was whole, so nothing can be recovered.
    #[error(
        "recording `{path}` can't be read beyond byte {readable_bytes}, before its metadata `{name}`, so nothing of it can be recovered"
    )]
    NothingLeft {
        /// Path of the unreadable recording.
        path: PathBuf,
        /// Name of the metadata record.
        name: &'static str,
        /// Number of bytes that can be read.
        readable_bytes: u64,
    },
    /// An entry of the metadata is missing or invalid.
    #[error("recording `{path}` states `{key}` as `{got}` in its metadata `{name}`, expected {expected}")]
    Metadata {
        /// Path of the recording with this metadata.
        path: PathBuf,
        /// Name of the metadata record.
        name: &'static str,
        /// Key of the metadata entry.
        key: String,
        /// Its value; empty if it is missing.
        got: String,
        /// Description of the valid values.
        expected: &'static str,
    },
    /// The file has a format that this version can't read.
    #[error(
        "recording `{path}` has format {format}, written by resonarm {writer}, but this program, resonarm {version}, reads \
         format {FORMAT}; read it with the program that wrote it", version = env!("CARGO_PKG_VERSION")
    )]
    OtherFormat {
        /// Path of the recording in the other format.
        path: PathBuf,
        /// Version of its format.
        format: u32,
        /// Version of the program that wrote it.
        writer: String,
    },
    /// A topic has another message type than expected.
    #[error(
        "recording `{path}` has messages `{got}` in topic `{topic}`, expected `{expected} (protobuf)`; read it with the \
         version of resonarm that wrote it"
    )]
    Schema {
        /// Path of the recording with this topic.
        path: PathBuf,
        /// Name of the topic.
        topic: &'static str,
        /// The message type it should have.
        expected: &'static str,
        /// Message type and encoding that it has.
        got: String,
    },
    /// A topic has other channels than this version knows.
    #[error("recording `{path}` has {cause}, in topic `{topic}`; read it with the version of resonarm that wrote it")]
    Channels {
        /// Path of the recording with this topic.
        path: PathBuf,
        /// Name of the topic.
        topic: String,
        /// Error in its channels.
        cause: ChannelsError,
    },
    /// A record does not match the channels of its recording.
    #[error(
        "a record of {got} numbers can't be written to recording `{path}`, whose topic `{topic}` has {expected} channels: \
         set `Options::channels` to those of the plant"
    )]
    Row {
        /// Path of the recording that is being written.
        path: PathBuf,
        /// Name of the topic.
        topic: &'static str,
        /// Number of channels of the topic.
        expected: usize,
        /// Number of values of the record.
        got: usize,
    },
    /// The file lacks a topic.
    #[error("recording `{path}` has no topic `{topic}`: another tool has removed it; use the original file")]
    MissingTopic {
        /// Path of the recording without the topic.
        path: PathBuf,
        /// Name of the topic.
        topic: &'static str,
    },
    /// Samples are missing, so the recording is not continuous.
    #[error(
        "recording `{path}` is not continuous in topic `{topic}`: expected sample {expected}, got sample {got}{}; {}",
        in_all(*.gaps), why_not_continuous(*.expected, *.got)
    )]
    Gap {
        /// Path of the recording with the gap.
        path: PathBuf,
        /// Name of the topic.
        topic: &'static str,
        /// The sample expected first after the gap.
        expected: u64,
        /// The sample found there.
        got: u64,
        /// Number of gaps in the samples of the recording.
        gaps: u64,
    },
    /// There is nothing to recover.
    #[error("recording `{path}` is whole: there is nothing to recover")]
    Whole {
        /// Path of the undamaged recording.
        path: PathBuf,
    },
    /// The file is so damaged, or cut so short, that no message is left.
    #[error("nothing of recording `{path}` could be recovered: {integrity}; no file was written")]
    NothingRecovered {
        /// Path of the recording from which nothing was recovered.
        path: PathBuf,
        /// Damage of the recording.
        integrity: Integrity,
    },
    /// There is no record to copy: for the selected samples, or at all.
    #[error("there is nothing to copy: {}; no file was written", nothing_of(.sources, .samples))]
    NothingToCopy {
        /// The recordings, with their damage.
        sources: Vec<(PathBuf, Integrity)>,
        /// The samples that were selected.
        samples: RangeInclusive<u64>,
    },
    /// The file is no longer at its path.
    #[error("recording `{path}` was deleted, moved or replaced while it was written, so its records are lost")]
    Gone {
        /// Path at which the recording was created.
        path: PathBuf,
    },
    /// A recording would be written over itself.
    #[error("recording `{path}` can't be written over itself: name another file for the result")]
    SameFile {
        /// Path that is both source and destination.
        path: PathBuf,
    },
    /// A recording is not of the same run as the one before it, or does not follow it.
    #[error("recording `{path}` can't be joined to the one before it: it has {got}, expected {expected}")]
    Apart {
        /// Path of the recording that does not follow.
        path: PathBuf,
        /// Property in which the recording differs.
        got: String,
        /// Property that would fit the recording before it.
        expected: String,
    },
    /// The events have more names than can be copied.
    #[error("recording `{path}` has events of more than {most} names, so it can't be copied")]
    Names {
        /// Path of the recording with these events.
        path: PathBuf,
        /// Largest number of names.
        most: usize,
    },
    /// A record arrived after the recording was finished.
    #[error("recording `{path}` is finished and accepts no more records")]
    Finished {
        /// Path of the finished recording.
        path: PathBuf,
    },
}

impl RecordingError {
    /// Makes the error of a file that can't be created.
    pub(super) fn create(path: &std::path::Path, source: io::Error) -> RecordingError {
        let path = path.to_path_buf();
        match source.kind() {
            io::ErrorKind::AlreadyExists => RecordingError::Exists { path },
            _ => RecordingError::Create { path, source: Arc::new(source) },
        }
    }

    /// Makes the error of a file that can't be given its name.
    pub(super) fn publish(path: &std::path::Path, source: io::Error) -> RecordingError {
        let path = path.to_path_buf();
        match source.kind() {
            io::ErrorKind::AlreadyExists => RecordingError::Exists { path },
            _ => RecordingError::Write { path, source: Arc::new(source) },
        }
    }

    /// Makes the error of a failure while writing `path`.
    pub(super) fn write(path: &std::path::Path, error: McapError) -> RecordingError {
        let path = path.to_path_buf();
        match error {
            McapError::Io(source) => RecordingError::Write { path, source: Arc::new(source) },
            source => RecordingError::Format { path, source: Arc::new(source) },
        }
    }
}

/// Describes the number of gaps, for a message.
fn in_all(gaps: u64) -> String {
    if gaps == 0 { String::new() } else { format!(" ({gaps} such gaps in all)") }
}

/// Describes possible reasons for a discontinuous recording, for a message.
const fn why_not_continuous(expected: u64, got: u64) -> &'static str {
    match got < expected {
        true => "records are repeated or late; use the original file",
        false => "the run lost records, or the file was recovered from a damaged one",
    }
}

/// Describes which library wrote a file, for a message.
fn but_by(library: &str) -> String {
    match library {
        "" => String::new(),
        library => format!(
            ", but by `{}`",
            library.chars().filter(|character| !character.is_control()).take(80).collect::<String>()
        ),
    }
}

/// Describes recordings without a record of these samples, for a message.
fn nothing_of(sources: &[(PathBuf, Integrity)], samples: &RangeInclusive<u64>) -> String {
    let of = match samples.clone().into_inner() {
        (0, u64::MAX) => String::new(),
        (first, last) => format!(" of samples {first} to {last}"),
    };
    let each = |(path, integrity): &(PathBuf, Integrity)| match integrity {
        Integrity::Complete => format!("recording `{}` has no record{of}", path.display()),
        wrong => format!("recording `{}` has no record{of} that can be read ({wrong})", path.display()),
    };
    sources.iter().map(each).collect::<Vec<_>>().join(", ")
}

/// Describes the first bytes of a file, for a message.
fn begins(bytes: &[u8]) -> String {
    match bytes {
        [] => String::from("nothing (it is empty)"),
        bytes => format!("`{}`", bytes.escape_ascii()),
    }
}
