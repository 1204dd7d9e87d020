//! Recovers a truncated or damaged recording.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::error::RecordingError;
use super::options::Compression;
use super::salvage::{LostChunk, Piece, Salvage};
use super::scan::{Scan, Tally, lost, scan};
use super::schema::{Topic, metadata};
use super::sink::Sink;
use super::summary::Integrity;
use crate::staged::Existing;
use crate::staged::{Staged, same_file};

/// Result of a recovery: the new file, and the data that the old one lacks.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Recovered {
    /// Path of the new file.
    pub path: PathBuf,
    /// Size of the new file, bytes.
    pub bytes: u64,
    /// Number of messages that were recovered.
    pub messages: u64,
    /// Damage of the old file.
    pub source: Integrity,
    /// The parts of the old file from which nothing could be read.
    pub lost_chunks: Vec<LostChunk>,
    /// States that are missing between others that were recovered. Missing states before the first or behind the last
    /// are unknown.
    pub missing_samples: Vec<MissingSamples>,
}

/// A range of missing samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct MissingSamples {
    /// Index of the first missing sample.
    pub first: u64,
    /// Index of the last missing sample.
    pub last: u64,
}

/// Copies everything that can be read of `input` into a new file `output`, which is whole. Damaged chunks are left out.
///
/// The messages are copied byte for byte. The new file states its source in its metadata `resonarm.recovered`, and
/// opens as [`Integrity::Unfinished`]. It gets its name when it is on the disk, so that an existing file is kept if the
/// recovery fails.
///
/// # Errors
/// [`RecordingError::Whole`] if nothing is wrong with `input`, [`RecordingError::SameFile`] if `output` is `input`,
/// [`RecordingError::NothingRecovered`] if no message is left, [`RecordingError::Metadata`] if the description of
/// `input` is lost; else as for opening the one and creating the other.
pub fn recover(
    input: impl AsRef<Path>,
    output: impl AsRef<Path>,
    existing: Existing,
) -> Result<Recovered, RecordingError> {
    let input = input.as_ref();
    let output = output.as_ref();
    // A scan ends at the first damage. The survey goes on behind it, since metadata from the end of the run may still
    // be whole.
    let mut scan = scan(input)?;
    let salvage = survey(input, &mut scan)?;
    let about = scan.required(input, metadata::RECORDING)?;
    let configuration = scan.required(input, metadata::CONFIGURATION)?;
    if matches!(scan.integrity, Integrity::Complete | Integrity::Unfinished) {
        return Err(RecordingError::Whole { path: input.to_path_buf() });
    }
    if same_file(input, output) {
        return Err(RecordingError::SameFile { path: input.to_path_buf() });
    }
    // A file that could not be opened afterwards would not be recovered.
    scan.origin(input)?;
    let head = [(metadata::RECORDING, about), (metadata::CONFIGURATION, configuration)];
    let (mut staged, file) = Staged::create(output, existing).map_err(|error| RecordingError::create(output, error))?;
    let schemas = salvage.contents.declared().map(|declared| (declared.topic, declared.schema.clone()));
    let mut sink = Sink::begin(file, output, Compression::Zstd, &head, schemas)?;
    let filled = fill(&mut sink, salvage, input, &scan).and_then(|copied| {
        head.into_iter().try_for_each(|(name, content)| sink.metadata(name, content))?;
        finish(&mut sink, input, &scan, &copied)?;
        Ok(copied)
    });
    let copied = match filled {
        Ok(copied) => copied,
        Err(error) => {
            sink.abandon();
            return Err(error);
        }
    };
    let messages = messages(&sink);
    let bytes = sink.finish()?.bytes;
    staged.publish().map_err(|error| RecordingError::publish(output, error))?;
    let lost_chunks = copied.lost;
    let missing_samples = copied.missing;
    Ok(Recovered { path: output.to_path_buf(), bytes, messages, source: scan.integrity, lost_chunks, missing_samples })
}

/// Writes the remaining messages, of which there must be at least one.
fn fill(sink: &mut Sink, salvage: Salvage, input: &Path, scan: &Scan) -> Result<Copied, RecordingError> {
    if let Some(start) = scan.metadata.get(metadata::START) {
        sink.metadata(metadata::START, start)?;
    }
    // Everything is counted anew. Only the sample period is kept: a batch that states another one is damaged, or of
    // another run.
    let expected = Tally { dt_s: scan.tally.dt_s, ..Tally::default() };
    let copied = copy(salvage, expected, sink)?;
    if messages(sink) == 0 {
        let path = input.to_path_buf();
        let integrity = scan.integrity.clone();
        return Err(RecordingError::NothingRecovered { path, integrity });
    }
    Ok(copied)
}

/// Writes the known statistics of the end of the run, and the source of the new file.
fn finish(sink: &mut Sink, input: &Path, scan: &Scan, copied: &Copied) -> Result<(), RecordingError> {
    if let Some(statistics) = scan.metadata.get(metadata::STATISTICS) {
        sink.metadata(metadata::STATISTICS, statistics)?;
    }
    // Without metadata `resonarm.lost` the new file opens as what it is: recovered.
    sink.metadata(metadata::RECOVERED, &account(input, scan, copied))
}

fn messages(sink: &Sink) -> u64 {
    Topic::ALL.into_iter().map(|topic| sink.messages(topic)).sum()
}

/// Makes a first pass: metadata behind the damage go into `scan`, and the second pass knows all declarations.
fn survey(input: &Path, scan: &mut Scan) -> Result<Salvage, RecordingError> {
    // In a file that is only cut short everything before the end has been checked, messages outside chunks too.
    let is_damaged = matches!(scan.integrity, Integrity::Damaged { .. });
    let mut salvage = Salvage::open(input, !is_damaged)?;
    while let Some(piece) = salvage.next()? {
        if let Piece::Metadata(name, content) = piece {
            scan.metadata.entry(name).or_insert(content);
        }
    }
    scan.lost = lost(input, &scan.metadata)?;
    Ok(salvage.again())
}

/// Result of copying: the parts that were left out, and the samples that are missing.
struct Copied {
    lost: Vec<LostChunk>,
    missing: Vec<MissingSamples>,
}

/// Copies the messages of every chunk that is whole.
fn copy(mut salvage: Salvage, mut tally: Tally, sink: &mut Sink) -> Result<Copied, RecordingError> {
    let mut lost = Vec::new();
    let mut missing = Vec::new();
    while let Some(piece) = salvage.next()? {
        match piece {
            Piece::Chunk { offset, bytes } => match tally.clone().with(&salvage.contents) {
                // A chunk is copied whole or not at all: the tally takes it in on a copy, which is dropped if a
                // message is wrong.
                Ok(with) => {
                    missing.extend(between(&tally, &with));
                    tally = with;
                    salvage.contents.messages().try_for_each(|message| sink.raw(message))?;
                }
                Err(cause) => lost.push(LostChunk { offset, bytes, log_times_ns: None, cause }),
            },
            Piece::Lost(chunk) => lost.push(chunk),
            Piece::Metadata(..) | Piece::Other => {}
        }
    }
    Ok(Copied { lost, missing })
}

/// Returns the states that are missing between a chunk and those before it.
fn between(before: &Tally, with: &Tally) -> Option<MissingSamples> {
    let [before, with] = [before, with].map(|tally| &tally.topics[Topic::States as usize]);
    let expected = before.expected?;
    let first = with.first_of_chunk?;
    (first > expected).then(|| MissingSamples { first: expected, last: first - 1 })
}

/// Returns metadata of the new file about the recording from which it was recovered.
fn account(input: &Path, scan: &Scan, copied: &Copied) -> BTreeMap<String, String> {
    let mut account = BTreeMap::from([(String::from("source"), input.display().to_string())]);
    let mut note = |key: &str, value: String| account.insert(String::from(key), value);
    if let Integrity::Truncated { readable_bytes, file_bytes, .. }
    | Integrity::Damaged { readable_bytes, file_bytes, .. } = &scan.integrity
    {
        note("source_readable_bytes", readable_bytes.to_string());
        note("source_bytes", file_bytes.to_string());
    }
    if let Integrity::Damaged { cause, .. } = &scan.integrity {
        note("cause", cause.clone());
    }
    note("lost_chunks", copied.lost.len().to_string());
    note("lost_bytes", copied.lost.iter().map(|chunk| chunk.bytes).sum::<u64>().to_string());
    let missing: Vec<_> = copied.missing.iter().map(|missing| format!("{}-{}", missing.first, missing.last)).collect();
    note("missing_samples", missing.join(" "));
    scan.lost.iter().for_each(|(channel, count)| drop(note(&format!("lost_records.{channel}"), count.to_string())));
    account
}
