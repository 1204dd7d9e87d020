//! A truncated or damaged recording made whole again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::salvage::{LostChunk, Piece, Salvage};
use super::scan::{Scan, Tally, scan};
use super::schema::{Topic, metadata};
use super::sink::Sink;
use super::staged::{Staged, same_file};
use super::{Compression, Existing, Integrity, Origin, RecordingError};

/// What was recovered.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Recovered {
    /// The new file.
    pub path: PathBuf,
    /// Its size, bytes.
    pub bytes: u64,
    /// Messages recovered.
    pub messages: u64,
    /// What was wrong with the old file.
    pub source: Integrity,
    /// The parts of the old file from which nothing could be had.
    pub lost_chunks: Vec<LostChunk>,
    /// States that are missing between others that were recovered. What is missing before the first or behind the last is not
    /// known.
    pub missing_samples: Vec<MissingSamples>,
}

/// Samples that are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct MissingSamples {
    /// The first.
    pub first: u64,
    /// The last.
    pub last: u64,
}

/// Copies everything that can be read of `input` into a new file `output`, which is whole. Damaged chunks are left out.
///
/// The messages are copied byte for byte. The new file says in its metadata `resonarm.recovered` what it was made from,
/// and opens as [`Integrity::Unfinished`] unless the end of the run could be read and nothing is left out. It takes its name
/// when it is on the disk, so that nothing that was there before is lost if recovery fails.
///
/// # Errors
/// [`RecordingError::Whole`] if nothing is wrong with `input`, [`RecordingError::SameFile`] if `output` is `input`,
/// [`RecordingError::NothingRecovered`] if no message is left, [`RecordingError::Metadata`] if `input` does not say any more
/// when and by what it was made; else as for opening the one and creating the other.
pub fn recover(
    input: impl AsRef<Path>,
    output: impl AsRef<Path>,
    existing: Existing,
) -> Result<Recovered, RecordingError> {
    let (input, output) = (input.as_ref(), output.as_ref());
    let mut scan = scan(input)?;
    let first = survey(input, &mut scan)?;
    let about = scan.required(input, metadata::RECORDING)?;
    let configuration = scan.required(input, metadata::CONFIGURATION)?;
    if matches!(scan.integrity, Integrity::Complete | Integrity::Unfinished) {
        return Err(RecordingError::Whole { path: input.to_path_buf() });
    }
    if same_file(input, output) {
        return Err(RecordingError::SameFile { path: input.to_path_buf() });
    }
    // What can't be opened afterwards is not recovered.
    Origin::of(input, &scan)?;
    let head = [(metadata::RECORDING, about), (metadata::CONFIGURATION, configuration)];
    let (staged, file) = Staged::create(output, existing)?;
    let mut sink = Sink::begin(file, output, Compression::Lz4, &head)?;
    let copied = copy(first, &mut sink).and_then(|copied| {
        // Without the counts of lost records the new file opens as what it is: not all of the run.
        let whole = copied.lost.is_empty();
        let tail = [Some(metadata::STATISTICS), whole.then_some(metadata::LOST)].into_iter().flatten();
        let tail = tail.filter_map(|name| Some((name, scan.metadata.get(name)?)));
        head.into_iter().chain(tail).try_for_each(|(name, content)| sink.metadata(name, content))?;
        sink.metadata(metadata::RECOVERED, &account(input, &scan.integrity, &copied))?;
        Ok(copied)
    });
    let messages = Topic::ALL.into_iter().map(|topic| sink.messages(topic)).sum();
    let copied = match copied {
        Ok(copied) if messages > 0 => copied,
        Ok(_) => {
            sink.abandon();
            return Err(RecordingError::NothingRecovered { path: input.to_path_buf(), integrity: scan.integrity });
        }
        Err(error) => {
            sink.abandon();
            return Err(error);
        }
    };
    let bytes = sink.finish()?.len();
    staged.publish()?;
    Ok(Recovered {
        path: output.to_path_buf(),
        bytes,
        messages,
        source: scan.integrity,
        lost_chunks: copied.lost,
        missing_samples: copied.missing,
    })
}

/// A first pass: metadata behind what is damaged go into `scan`, and what is declared anywhere is known to the second.
fn survey(input: &Path, scan: &mut Scan) -> Result<Salvage, RecordingError> {
    let mut salvage = Salvage::open(input)?;
    while let Some(piece) = salvage.next()? {
        if let Piece::Metadata(name, content) = piece {
            scan.metadata.entry(name).or_insert(content);
        }
    }
    Ok(salvage.again())
}

/// What copying came to.
struct Copied {
    lost: Vec<LostChunk>,
    missing: Vec<MissingSamples>,
}

/// Copies the messages of every chunk that is whole.
fn copy(mut salvage: Salvage, sink: &mut Sink) -> Result<Copied, RecordingError> {
    let (mut lost, mut missing, mut tally) = (Vec::new(), Vec::new(), Tally::default());
    while let Some(piece) = salvage.next()? {
        match piece {
            Piece::Chunk { offset, bytes } => match tally.clone().with(salvage.contents()) {
                Ok(with) => {
                    missing.extend(between(&tally, &with));
                    tally = with;
                    salvage.contents().messages().try_for_each(|message| sink.raw(message))?;
                }
                Err(cause) => lost.push(LostChunk { offset, bytes, log_times_ns: None, cause }),
            },
            Piece::Lost(chunk) => lost.push(chunk),
            Piece::Metadata(..) | Piece::Other => {}
        }
    }
    Ok(Copied { lost, missing })
}

/// The states that are missing between a chunk and those before it.
fn between(before: &Tally, with: &Tally) -> Option<MissingSamples> {
    let [before, with] = [before, with].map(|tally| &tally.topics[Topic::Steps as usize]);
    let (expected, first) = (before.expected?, with.first_of_chunk?);
    (first > expected).then(|| MissingSamples { first: expected, last: first - 1 })
}

/// What the new file says about the old.
fn account(input: &Path, source: &Integrity, copied: &Copied) -> BTreeMap<String, String> {
    let mut account = BTreeMap::from([(String::from("source"), input.display().to_string())]);
    let mut note = |key: &str, value: String| account.insert(String::from(key), value);
    if let Integrity::Truncated { readable_bytes, file_bytes, .. }
    | Integrity::Damaged { readable_bytes, file_bytes, .. } = source
    {
        note("source_readable_bytes", readable_bytes.to_string());
        note("source_bytes", file_bytes.to_string());
    }
    if let Integrity::Damaged { cause, .. } = source {
        note("cause", cause.clone());
    }
    note("lost_chunks", copied.lost.len().to_string());
    note("lost_bytes", copied.lost.iter().map(|chunk| chunk.bytes).sum::<u64>().to_string());
    let missing: Vec<_> = copied.missing.iter().map(|missing| format!("{}-{}", missing.first, missing.last)).collect();
    note("missing_samples", missing.join(" "));
    account
}
