//! The MCAP file being written: topics, messages, metadata.

use std::collections::BTreeMap;
use std::fs::{File, Metadata};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::{self, MessageHeader};
use mcap::write::NoSeek;
use mcap::{WriteOptions, Writer};

use super::contents::RawMessage;
use super::error::RecordingError;
use super::options::Compression;
use super::schema::Topic;

/// Compression level of Zstandard: its default.
const ZSTD_LEVEL: u32 = 3;

/// The file being written. `NoSeek` lets a chunk reach the file only whole, so that a killed file is whole up to a
/// chunk.
pub(super) struct Sink {
    path: PathBuf,
    writer: Writer<NoSeek<BufWriter<Counted>>>,
    /// Counts of each of [`Topic::ALL`] that the file declares.
    channels: [Option<Written>; Topic::ALL.len()],
    buffer: Vec<u8>,
    unflushed: bool,
}

/// A file that counts the written bytes: a pipe or a device has no size.
struct Counted {
    file: File,
    bytes: u64,
}

impl io::Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// What a file has when it is finished.
pub(super) struct Finished {
    /// Metadata that identify the file.
    pub metadata: Metadata,
    /// Size of the file, bytes.
    pub bytes: u64,
}

/// The times of a message, ns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stamp {
    pub log_ns: u64,
    pub publish_ns: u64,
}

/// Counts for one topic.
struct Written {
    id: u16,
    messages: u64,
}

impl Sink {
    /// Writes the head of a new file: `metadata` records first, flushed, then topics with messages of some types and
    /// their schemas. Messages to users call it `path`.
    pub fn begin(
        file: File,
        path: &Path,
        compression: Compression,
        metadata: &[(&str, &BTreeMap<String, String>)],
        schemas: impl IntoIterator<Item = (Topic, Vec<u8>)>,
    ) -> Result<Sink, RecordingError> {
        let compression = match compression {
            Compression::None => None,
            Compression::Zstd => Some(mcap::Compression::Zstd),
        };
        let writer = WriteOptions::new()
            .library(concat!("resonarm ", env!("CARGO_PKG_VERSION")))
            .compression(compression)
            .compression_level(ZSTD_LEVEL)
            // The recorder has one thread, which `leave_core` can keep off the core of the real-time loop. The
            // library would start more.
            .compression_threads(0)
            .disable_seeking(true)
            .create(NoSeek::new(BufWriter::new(Counted { file, bytes: 0 })))
            .map_err(|error| RecordingError::write(path, error))?;
        let channels = [const { None }; Topic::ALL.len()];
        let mut sink = Sink { path: path.to_path_buf(), writer, channels, buffer: Vec::new(), unflushed: true };
        // The head is flushed before anything else, so that even a run that is killed before its first chunk says what
        // it was.
        metadata.iter().try_for_each(|(name, content)| sink.metadata(name, content))?;
        sink.flush()?;
        schemas.into_iter().try_for_each(|(of, schema)| sink.declare(of, &schema))?;
        Ok(sink)
    }

    /// Declares a topic with the schema of its messages.
    fn declare(&mut self, topic: Topic, schema: &[u8]) -> Result<(), RecordingError> {
        let id = self
            .writer
            .add_schema(topic.schema_name(), "protobuf", schema)
            .and_then(|schema| self.writer.add_channel(schema, topic.name(), "protobuf", &BTreeMap::new()))
            .map_err(|error| RecordingError::write(&self.path, error))?;
        self.channels[topic as usize] = Some(Written { id, messages: 0 });
        Ok(())
    }

    /// Encodes one message and writes it to the file.
    pub fn message(&mut self, topic: Topic, stamp: Stamp, message: &impl prost::Message) -> Result<(), RecordingError> {
        let mut buffer = core::mem::take(&mut self.buffer);
        buffer.clear();
        let written = match message.encode(&mut buffer) {
            Ok(()) => {
                let log_time_ns = stamp.log_ns;
                let publish_time_ns = stamp.publish_ns;
                // `raw` gives it its number.
                let sequence = 0;
                self.raw(RawMessage { topic, layout: None, sequence, log_time_ns, publish_time_ns, bytes: &buffer })
            }
            Err(error) => Err(RecordingError::Write { path: self.path.clone(), source: Arc::new(error.into()) }),
        };
        self.buffer = buffer;
        written
    }

    /// Writes one message that is serialised already.
    pub fn raw(&mut self, message: RawMessage<'_>) -> Result<(), RecordingError> {
        // Every topic is declared at the beginning.
        let Some(channel) = &mut self.channels[message.topic as usize] else { return Ok(()) };
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.messages as u32, // wraps, as MCAP's sequence numbers may
            log_time: message.log_time_ns,
            publish_time: message.publish_time_ns,
        };
        channel.messages += 1;
        self.unflushed = true;
        self.writer
            .write_to_known_channel(&header, message.bytes)
            .map_err(|error| RecordingError::write(&self.path, error))
    }

    /// Writes a metadata record; it goes outside the chunks.
    pub fn metadata(&mut self, name: &str, content: &BTreeMap<String, String>) -> Result<(), RecordingError> {
        self.unflushed = true;
        self.writer
            .write_metadata(&records::Metadata { name: name.to_string(), metadata: content.clone() })
            .map_err(|error| RecordingError::write(&self.path, error))
    }

    /// Closes the chunk and passes everything to the operating system, if there is anything new.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        if core::mem::take(&mut self.unflushed) {
            self.writer.flush().map_err(|error| RecordingError::write(&self.path, error))?;
        }
        Ok(())
    }

    /// Returns the path of the recording.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the number of messages written so far in a topic.
    pub fn messages(&self, topic: Topic) -> u64 {
        self.channels[topic as usize].as_ref().map_or(0, |channel| channel.messages)
    }

    /// Writes summary and footer and puts the file on the disk.
    pub fn finish(mut self) -> Result<Finished, RecordingError> {
        let finished = self.writer.finish();
        let path = self.path.clone();
        // The file is taken out even if the summary failed: dropping the library's writer would try to finish it once
        // more.
        let mut file = self.into_file();
        finished.map_err(|error| RecordingError::write(&path, error))?;
        io::Write::flush(&mut file)
            .and_then(|()| {
                let Counted { file, bytes } = file.get_ref();
                synchronise(file)?;
                Ok(Finished { metadata: file.metadata()?, bytes: *bytes })
            })
            .map_err(|source| RecordingError::Write { path, source: Arc::new(source) })
    }

    /// Abandons a file that can't be written any more, without a footer: it must not look whole.
    pub fn abandon(self) {
        // A `BufWriter` that is dropped would try to write its rest once more. Taken apart it lets go of it.
        let _unwritten = self.into_file().into_parts();
    }

    fn into_file(self) -> BufWriter<Counted> {
        self.writer.into_inner().into_inner()
    }
}

/// Puts a file on the disk. For pipes and devices fsync(2) fails with EINVAL, since it does not apply.
fn synchronise(file: &File) -> io::Result<()> {
    match file.sync_all() {
        Err(error) if error.kind() == io::ErrorKind::InvalidInput && !file.metadata()?.is_file() => Ok(()),
        synchronised => synchronised,
    }
}
