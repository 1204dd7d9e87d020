//! A truncated or damaged recording made whole again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::scan::scan;
use super::schema::{Topic, metadata};
use super::sink::Sink;
use super::walk::{Part, Walk};
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
}

/// Copies everything that can be read of `input` into a new file `output`, which is whole.
///
/// The messages are copied byte for byte. The new file says in its metadata `resonarm.recovered` what it was made from,
/// and opens as [`Integrity::Unfinished`] unless the end of the run could be read.
///
/// # Errors
/// [`RecordingError::Whole`] if nothing is wrong with `input`, [`RecordingError::SameFile`] if `output` is `input`,
/// [`RecordingError::Metadata`] if `input` does not say any more when and by what it was made; else as for opening the one
/// and creating the other.
pub fn recover(
    input: impl AsRef<Path>,
    output: impl AsRef<Path>,
    existing: Existing,
) -> Result<Recovered, RecordingError> {
    let (input, output) = (input.as_ref(), output.as_ref());
    let scan = scan(input)?;
    if matches!(scan.integrity, Integrity::Complete | Integrity::Unfinished) {
        return Err(RecordingError::Whole { path: input.to_path_buf() });
    }
    if output.canonicalize().is_ok_and(|output| input.canonicalize().is_ok_and(|input| input == output)) {
        return Err(RecordingError::SameFile { path: input.to_path_buf() });
    }
    // What can't be opened afterwards is not recovered.
    Origin::of(input, &scan)?;
    let head = [metadata::RECORDING, metadata::CONFIGURATION]
        .map(|name| scan.required(input, name).map(|content| (name, content)));
    let [recording, configuration] = head;
    let head = [recording?, configuration?];
    let mut sink = Sink::create(output, existing, Compression::Lz4, &head)?;
    let copied = copy(input, scan.readable_bytes, &mut sink).and_then(|()| {
        let tail = [metadata::STATISTICS, metadata::LOST];
        let tail = tail.iter().filter_map(|name| Some((*name, scan.metadata.get(*name)?)));
        head.into_iter().chain(tail).try_for_each(|(name, content)| sink.metadata(name, content))?;
        sink.metadata(metadata::RECOVERED, &account(input, &scan.integrity))
    });
    if let Err(error) = copied {
        sink.abandon();
        return Err(error);
    }
    let messages = Topic::ALL.into_iter().map(|topic| sink.messages(topic)).sum();
    Ok(Recovered { path: output.to_path_buf(), bytes: sink.finish()?, messages, source: scan.integrity })
}

/// Copies the messages in the good part of a file.
fn copy(input: &Path, readable_bytes: u64, sink: &mut Sink) -> Result<(), RecordingError> {
    let mut walk = Walk::open(input)?;
    while walk.offset() < readable_bytes
        && let Some(part) = walk.next()?
    {
        if matches!(part, Part::Chunk) {
            walk.chunk().messages().try_for_each(|(topic, time_ns, bytes)| sink.bytes(topic, time_ns, bytes))?;
        }
    }
    Ok(())
}

/// What the new file says about the old.
fn account(input: &Path, source: &Integrity) -> BTreeMap<String, String> {
    let mut account = BTreeMap::from([(String::from("source"), input.display().to_string())]);
    if let Integrity::Truncated { readable_bytes, file_bytes, .. }
    | Integrity::Damaged { readable_bytes, file_bytes, .. } = source
    {
        account.insert(String::from("source_readable_bytes"), readable_bytes.to_string());
        account.insert(String::from("source_bytes"), file_bytes.to_string());
    }
    if let Integrity::Damaged { cause, .. } = source {
        account.insert(String::from("cause"), cause.clone());
    }
    account
}
