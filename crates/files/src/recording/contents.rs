//! The schemas, topics and messages inside the chunks of a file.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::ops::Range;
use std::sync::Arc;

use mcap::records::{Record as McapRecord, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, parse_record};

use super::layout::{ChannelsError, Layout};
use super::lengths;
use super::schema::Topic;

/// Longest accepted record: 256 MiB, far above what a recorder writes.
pub(super) const LONGEST: usize = 1 << 28;
/// Longest accepted chunk after decompression: 64 MiB, where a recorder writes some 1 MiB, and other tools up to 4 MiB.
/// A few bytes may decompress to any length.
const LONGEST_CHUNK: u64 = 1 << 26;
/// Fields of a chunk before its compressed records, without the name of the compression, bytes (MCAP, "Chunk").
pub(super) const CHUNK_HEAD: usize = 8 + 8 + 8 + 4 + 4 + 8;

/// Reason for which a record can't be used.
pub(super) enum Fault {
    /// The file ends inside the record.
    Truncated,
    /// The content of the record contradicts the MCAP format.
    Damaged(String),
    /// The checksum of the whole data section is wrong: any record before its end may be damaged.
    DataSection(String),
    /// The record can't be read.
    Io(io::Error),
    /// A topic has another message type than it should.
    Schema(Topic, String),
    /// A topic has other channels than it should.
    Channels(String, ChannelsError),
}

impl From<McapError> for Fault {
    fn from(error: McapError) -> Fault {
        match error {
            McapError::UnexpectedEof => Fault::Truncated,
            McapError::BadDataCrc { saved, calculated } => Fault::DataSection(checksum(saved, calculated)),
            McapError::BadChunkCrc { saved, calculated } | McapError::BadSummaryCrc { saved, calculated } => {
                Fault::Damaged(checksum(saved, calculated))
            }
            // A decompressor that gets no memory says nothing about the file.
            McapError::DecompressionError(said) if says_no_memory(&said) => {
                Fault::Io(io::ErrorKind::OutOfMemory.into())
            }
            McapError::Io(error) if says_no_memory(&error.to_string()) => Fault::Io(io::ErrorKind::OutOfMemory.into()),
            error => Fault::Damaged(error.to_string()),
        }
    }
}

/// Says whether a decompressor reported that it got no memory: Zstandard's `ZSTD_error_memory_allocation`, LZ4's
/// `LZ4F_ERROR_allocation_failed`.
fn says_no_memory(said: &str) -> bool {
    said.contains("not enough memory") || said.contains("ERROR_allocation_failed")
}

fn checksum(saved: u32, calculated: u32) -> String {
    format!("the checksum is {calculated:#010x}, expected {saved:#010x}")
}

/// Declarations of the chunks read so far, and the messages of the last.
#[derive(Default)]
pub(super) struct Contents {
    schemas: BTreeMap<u16, (String, Vec<u8>)>,
    channels: BTreeMap<u16, Option<Declared>>,
    bytes: Vec<u8>,
    messages: Vec<Message>,
    /// Number of messages of all topics, also of those that others added, in the chunk read last.
    pub message_count: u64,
}

/// A declared topic of this program.
#[derive(Clone)]
pub(super) struct Declared {
    pub topic: Topic,
    /// The schema as it is in the file.
    pub schema: Vec<u8>,
    /// Positions of the numbers in its messages, for states and readings.
    pub layout: Option<Arc<Layout>>,
}

struct Message {
    channel: u16,
    sequence: u32,
    log_time_ns: u64,
    publish_time_ns: u64,
    range: Range<usize>,
}

/// A message as it is in the file.
#[derive(Clone, Copy)]
pub(super) struct RawMessage<'a> {
    pub topic: Topic,
    pub layout: Option<&'a Arc<Layout>>,
    /// Its number within the topic, from 0, in files that the recorder wrote; others may have 0 throughout.
    pub sequence: u32,
    pub log_time_ns: u64,
    pub publish_time_ns: u64,
    pub bytes: &'a [u8],
}

impl Contents {
    /// Returns the topics of this program declared so far.
    pub fn declared(&self) -> impl Iterator<Item = &Declared> {
        self.channels.values().flatten()
    }

    /// Returns the messages of the chunk read last, in the order in which they were written.
    pub fn messages(&self) -> impl Iterator<Item = RawMessage<'_>> {
        self.messages_from(0).map(|(_, message)| message)
    }

    /// Works like [`Contents::messages`], from place `first` on, with their places.
    pub fn messages_from(&self, first: usize) -> impl Iterator<Item = (usize, RawMessage<'_>)> {
        self.messages.iter().enumerate().skip(first).filter_map(|(place, message)| {
            let declared = self.channels.get(&message.channel)?.as_ref()?;
            let raw = RawMessage {
                topic: declared.topic,
                layout: declared.layout.as_ref(),
                sequence: message.sequence,
                log_time_ns: message.log_time_ns,
                publish_time_ns: message.publish_time_ns,
                bytes: &self.bytes[message.range.clone()],
            };
            Some((place, raw))
        })
    }

    /// Reads a message that stands alone, outside a chunk.
    pub fn read_message(&mut self, body: &[u8]) -> Result<(), Fault> {
        self.clear();
        self.read_record(op::MESSAGE, body)
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.messages.clear();
        self.message_count = 0;
    }

    /// Decompresses a chunk, compares its checksum, and gathers its messages.
    pub fn read_chunk(&mut self, body: &[u8]) -> Result<(), Fault> {
        if let McapRecord::Chunk { header, data } = parse(op::CHUNK, body)? {
            // Checked before anything is decompressed: a few bytes may state any size, and grow to it.
            if header.uncompressed_size > LONGEST_CHUNK {
                return Err(Fault::Damaged(format!(
                    "a chunk states {} bytes after decompression, more than the limit of {LONGEST_CHUNK}",
                    header.uncompressed_size
                )));
            }
            let expected = CHUNK_HEAD + header.compression.len() + data.len();
            if expected != body.len() {
                return Err(Fault::Damaged(format!("a chunk of {} bytes states {expected}", body.len())));
            }
        }
        self.clear();
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST_CHUNK as usize);
        let mut reader = LinearReader::new_with_options(options);
        let head = [&[op::CHUNK][..], &(body.len() as u64).to_le_bytes()].concat();
        let mut source = head.chain(body);
        while let Some(event) = reader.next_event() {
            match event.map_err(in_chunk)? {
                LinearReadEvent::ReadRequest(need) => {
                    let read = source.read(reader.insert(need)).map_err(Fault::Io)?;
                    reader.notify_read(read);
                }
                LinearReadEvent::Record { data, opcode } if is_for_chunks(opcode) => self.read_record(opcode, data)?,
                LinearReadEvent::Record { opcode, .. } => {
                    return Err(Fault::Damaged(format!("a record with opcode {opcode} in a chunk")));
                }
            }
        }
        Ok(())
    }

    /// Interprets a record inside a chunk, or one outside: a declaration or a message.
    pub fn read_record(&mut self, opcode: u8, body: &[u8]) -> Result<(), Fault> {
        match parse(opcode, body)? {
            McapRecord::Schema { header, data } => {
                let schema = (header.name, data.into_owned());
                // The first one counts: those in chunks have a checksum, and come before the copies at the end.
                if self.schemas.get(&header.id).is_some_and(|known| *known != schema) {
                    return Err(Fault::Damaged(format!("another schema {} than before", header.id)));
                }
                self.schemas.insert(header.id, schema);
            }
            McapRecord::Channel(channel) => {
                let topic = Topic::ALL.into_iter().find(|topic| topic.name() == channel.topic);
                let (schema, data) =
                    self.schemas.get(&channel.schema_id).map_or(("", &[][..]), |(name, data)| (name, data));
                let is_ours = |topic: Topic| topic.schema_name() == schema && channel.message_encoding == "protobuf";
                if let Some(topic) = topic.filter(|topic| !is_ours(*topic)) {
                    return Err(Fault::Schema(topic, format!("{schema} ({})", channel.message_encoding)));
                }
                let is_of_numbers = |of: &Topic| matches!(of, Topic::States | Topic::Samples);
                let layout = topic.filter(is_of_numbers).map(|of| Layout::read(of, data).map(Arc::new));
                let layout = layout.transpose().map_err(|cause| Fault::Channels(channel.topic.clone(), cause))?;
                let schema = data.to_vec();
                let declared = topic.map(|topic| Declared { topic, schema, layout });
                self.channels.insert(channel.id, declared);
            }
            McapRecord::Message { header, data } => match self.channels.get(&header.channel_id) {
                Some(Some(_)) => {
                    self.message_count += 1;
                    let start = self.bytes.len();
                    self.bytes.extend_from_slice(&data);
                    self.messages.push(Message {
                        channel: header.channel_id,
                        sequence: header.sequence,
                        log_time_ns: header.log_time,
                        publish_time_ns: header.publish_time,
                        range: start..self.bytes.len(),
                    });
                }
                Some(None) => self.message_count += 1, // a topic that others added
                None => return Err(Fault::Damaged(format!("a message of unknown channel {}", header.channel_id))),
            },
            _ => {}
        }
        Ok(())
    }
}

/// Says whether a chunk may hold such a record (MCAP specification, "Chunk").
const fn is_for_chunks(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE)
}

/// Parses the fields of a record.
pub(super) fn parse(opcode: u8, body: &[u8]) -> Result<McapRecord<'_>, Fault> {
    if !lengths::fit(opcode, body) {
        return Err(Fault::Damaged(String::from("a length that is longer than its record")));
    }
    Ok(parse_record(opcode, body)?)
}

/// Makes a fault of an error inside a chunk. The chunk is there to its last byte, so it can't be cut short.
fn in_chunk(error: McapError) -> Fault {
    match error {
        McapError::UnexpectedEof => Fault::Damaged(String::from("a chunk that ends inside a record")),
        error => Fault::from(error),
    }
}
