//! One pass through a recording, record by record, with every checksum checked before anything is handed out.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::{Record as McapRecord, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError, parse_record};

use super::schema::Topic;
use super::{RecordingError, lengths};

/// Longest record, and longest chunk once decompressed, that is believed: 256 MiB, far above what a recorder writes.
const LONGEST: usize = 1 << 28;
/// Bytes asked for at a time, so that a wrong length costs no more memory than the file has bytes.
const READ: usize = 1 << 16;
/// Opcode and length before every record, bytes (MCAP specification, "Records").
const RECORD_HEAD: u64 = 9;
/// Fields of a chunk before its compressed records, without the name of the compression, bytes (MCAP, "Chunk").
const CHUNK_HEAD: usize = 8 + 8 + 8 + 4 + 4 + 8;

/// A pass through a file.
pub(super) struct Walk {
    path: PathBuf,
    file: BufReader<File>,
    file_bytes: u64,
    reader: LinearReader,
    body: Vec<u8>,
    offset: u64,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Option<Topic>>,
    chunk: Chunk,
}

/// What comes next in the file.
pub(super) enum Part {
    /// A metadata record: name and content.
    Metadata(String, BTreeMap<String, String>),
    /// Messages: they are in [`Walk::chunk`] until the next part is read.
    Chunk,
    /// Something that carries no data: an index, a statistic.
    Other,
}

/// The messages of one chunk, in the order in which they were written.
#[derive(Default)]
pub(super) struct Chunk {
    bytes: Vec<u8>,
    messages: Vec<(Topic, u64, Range<usize>)>,
}

impl Chunk {
    /// Topic, log time (ns) and bytes of every message.
    pub fn messages(&self) -> impl Iterator<Item = (Topic, u64, &[u8])> {
        self.messages.iter().map(|(topic, time_ns, range)| (*topic, *time_ns, &self.bytes[range.clone()]))
    }
}

/// Why there is nothing to be had from a record.
enum Fault {
    /// The file ends inside it.
    Truncated,
    /// It is not what the format says.
    Damaged(String),
    /// It can't be read.
    Io(io::Error),
    /// A topic has another message type than it should.
    Schema(Topic, String),
}

impl From<McapError> for Fault {
    fn from(error: McapError) -> Fault {
        match error {
            McapError::UnexpectedEof => Fault::Truncated,
            McapError::BadChunkCrc { saved, calculated }
            | McapError::BadDataCrc { saved, calculated }
            | McapError::BadSummaryCrc { saved, calculated } => {
                Fault::Damaged(format!("the checksum is {calculated:#010x}, expected {saved:#010x}"))
            }
            error => Fault::Damaged(error.to_string()),
        }
    }
}

impl Walk {
    /// Starts at the beginning of the file.
    pub fn open(path: &Path) -> Result<Walk, RecordingError> {
        let failed = |source| RecordingError::Open { path: path.to_path_buf(), source: Arc::new(source) };
        let mut file = BufReader::with_capacity(1 << 16, File::open(path).map_err(failed)?);
        let file_bytes = file.get_ref().metadata().map_err(failed)?.len();
        let got = file.fill_buf().map_err(failed)?;
        let got = got[..got.len().min(MAGIC.len())].to_vec();
        if !MAGIC.starts_with(&got) || got.is_empty() {
            return Err(RecordingError::NotMcap { path: path.to_path_buf(), got });
        }
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_validate_data_section_crc(true)
            .with_validate_summary_section_crc(true)
            .with_check_finishes_after_end_magic(true)
            .with_record_length_limit(LONGEST);
        Ok(Walk {
            path: path.to_path_buf(),
            file,
            file_bytes,
            reader: LinearReader::new_with_options(options),
            body: Vec::new(),
            offset: got.len() as u64,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            chunk: Chunk::default(),
        })
    }

    /// Where the next record begins, bytes from the start of the file: everything before is good.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Size of the file when it was opened, bytes.
    pub fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Topics declared so far.
    pub fn topics(&self) -> impl Iterator<Item = Topic> {
        self.channels.values().filter_map(|topic| *topic)
    }

    /// The messages of the chunk read last.
    pub fn chunk(&self) -> &Chunk {
        &self.chunk
    }

    /// The error for a record at `offset` that is not what it should be.
    pub fn damaged(&self, offset: u64, cause: String) -> RecordingError {
        RecordingError::Damaged { path: self.path.clone(), offset, cause }
    }

    /// What comes next, `None` at the end of a whole file. After an error there is nothing more to be had.
    pub fn next(&mut self) -> Result<Option<Part>, RecordingError> {
        self.next_part().map_err(|fault| {
            let (path, offset) = (self.path.clone(), self.offset);
            match fault {
                Fault::Truncated => RecordingError::Truncated { path, offset, file_bytes: self.file_bytes },
                Fault::Damaged(cause) => self.damaged(offset, cause),
                Fault::Io(source) => RecordingError::Open { path, source: Arc::new(source) },
                Fault::Schema(topic, got) => {
                    RecordingError::Schema { path, topic: topic.name(), expected: topic.schema_name(), got }
                }
            }
        })
    }

    fn next_part(&mut self) -> Result<Option<Part>, Fault> {
        let Some(opcode) = self.next_record()? else { return Ok(None) };
        let body = core::mem::take(&mut self.body);
        let part = self.part(opcode, &body);
        self.body = body;
        if part.is_ok() {
            self.offset += RECORD_HEAD + self.body.len() as u64;
        }
        part.map(Some)
    }

    /// Puts the next record into `self.body` and returns its opcode.
    fn next_record(&mut self) -> Result<Option<u8>, Fault> {
        while let Some(event) = self.reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(need) => {
                    let space = self.reader.insert(need.min(READ));
                    let read = self.file.read(space).map_err(Fault::Io)?;
                    self.reader.notify_read(read);
                }
                LinearReadEvent::Record { data, opcode } => {
                    self.body.clear();
                    self.body.extend_from_slice(data);
                    return Ok(Some(opcode));
                }
            }
        }
        Ok(None)
    }

    /// Makes sense of a record at the top level of the file.
    fn part(&mut self, opcode: u8, body: &[u8]) -> Result<Part, Fault> {
        match opcode {
            op::CHUNK => self.read_chunk(body).map(|()| Part::Chunk),
            op::METADATA => match parse(opcode, body)? {
                McapRecord::Metadata(metadata) => Ok(Part::Metadata(metadata.name, metadata.metadata)),
                _ => Ok(Part::Other),
            },
            op::MESSAGE => Err(Fault::Damaged(String::from("a message outside a chunk"))),
            0 => Err(Fault::Damaged(String::from("a record with opcode 0"))),
            _ => Ok(Part::Other),
        }
    }

    /// Decompresses a chunk, compares its checksum, and gathers its messages.
    fn read_chunk(&mut self, body: &[u8]) -> Result<(), Fault> {
        if let McapRecord::Chunk { header, data } = parse(op::CHUNK, body)? {
            let expected = CHUNK_HEAD + header.compression.len() + data.len();
            if expected != body.len() {
                return Err(Fault::Damaged(format!("a chunk of {} bytes states {expected}", body.len())));
            }
        }
        self.chunk.bytes.clear();
        self.chunk.messages.clear();
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST);
        let mut reader = LinearReader::new_with_options(options);
        let head = [&[op::CHUNK][..], &(body.len() as u64).to_le_bytes()].concat();
        let mut source = head.chain(body);
        while let Some(event) = reader.next_event() {
            match event.map_err(in_chunk)? {
                LinearReadEvent::ReadRequest(need) => {
                    let read = source.read(reader.insert(need)).map_err(Fault::Io)?;
                    reader.notify_read(read);
                }
                LinearReadEvent::Record { data, opcode } => self.read_in_chunk(opcode, data)?,
            }
        }
        Ok(())
    }

    /// Makes sense of a record inside a chunk.
    fn read_in_chunk(&mut self, opcode: u8, body: &[u8]) -> Result<(), Fault> {
        if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
            return Ok(());
        }
        match parse(opcode, body)? {
            McapRecord::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            McapRecord::Channel(channel) => {
                let topic = Topic::ALL.into_iter().find(|topic| topic.name() == channel.topic);
                let schema = self.schemas.get(&channel.schema_id).map_or("", String::as_str);
                match topic {
                    Some(topic) if schema != topic.schema_name() || channel.message_encoding != "protobuf" => {
                        return Err(Fault::Schema(topic, format!("{schema} ({})", channel.message_encoding)));
                    }
                    topic => self.channels.insert(channel.id, topic),
                };
            }
            McapRecord::Message { header, data } => match self.channels.get(&header.channel_id) {
                Some(Some(topic)) => {
                    let start = self.chunk.bytes.len();
                    self.chunk.bytes.extend_from_slice(&data);
                    self.chunk.messages.push((*topic, header.log_time, start..self.chunk.bytes.len()));
                }
                Some(None) => {} // a topic that others added
                None => return Err(Fault::Damaged(format!("a message of unknown channel {}", header.channel_id))),
            },
            _ => {}
        }
        Ok(())
    }
}

/// The fields of a record.
fn parse(opcode: u8, body: &[u8]) -> Result<McapRecord<'_>, Fault> {
    if !lengths::fit(opcode, body) {
        return Err(Fault::Damaged(String::from("a length that is longer than its record")));
    }
    Ok(parse_record(opcode, body)?)
}

/// What an error inside a chunk means. The chunk is there to its last byte, so it can't be cut short.
fn in_chunk(error: McapError) -> Fault {
    match error {
        McapError::UnexpectedEof => Fault::Damaged(String::from("a chunk that ends inside a record")),
        error => Fault::from(error),
    }
}
