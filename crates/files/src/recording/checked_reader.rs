//! Reads a recording once, record by record, and checks every checksum before it returns a record.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::MAGIC;
use mcap::records::{Record as McapRecord, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::contents::{Contents, Fault, LONGEST, parse};
use super::error::RecordingError;
use super::lengths;
use crate::staged::file_kind;

/// Bytes read at a time, so that a wrong length takes no more memory than the file has bytes.
const READ: usize = 1 << 16;
/// Opcode and length before every record, bytes (MCAP specification, "Records").
pub(super) const RECORD_HEAD: u64 = 9;

/// Reads a file from beginning to end.
pub(super) struct CheckedReader {
    path: PathBuf,
    file: BufReader<File>,
    /// Size of the file when it was opened, bytes.
    pub file_bytes: u64,
    reader: LinearReader,
    body: Vec<u8>,
    /// Position of the next record, bytes from the start of the file: everything before is valid.
    pub offset: u64,
    /// Declarations, and the messages of the chunk read last.
    pub contents: Contents,
    /// Number of messages read so far, of all topics, also of those that others added.
    pub messages: u64,
    /// Position of the first message outside a chunk: only the checksum of the data section covers it.
    first_bare_message: Option<u64>,
    layout: FileLayout,
}

/// Positions of records in the file, to be compared with its index and its footer, which other readers use.
#[derive(Default)]
struct FileLayout {
    /// Offset and length of every chunk, attachment and metadata record, in order.
    indexable: Vec<(u64, u64)>,
    chunks: u64,
    indexed_chunks: u64,
    /// Whether the record that ends the data section has been read.
    has_data_end: bool,
    /// Position of the first record behind the data section, and of the first summary offset.
    summary_start: Option<u64>,
    summary_offset_start: Option<u64>,
}

/// A record at the top level of the file.
pub(super) enum TopLevelRecord {
    /// The head of the file: which library wrote it.
    Header(String),
    /// A metadata record: name and content.
    Metadata(String, BTreeMap<String, String>),
    /// Messages, which are in [`CheckedReader::contents`] until the next record is read.
    Chunk,
    /// A message outside a chunk; it is also in [`CheckedReader::contents`].
    BareMessage,
    /// The file's own statistics: its number of messages.
    Statistics(u64),
    /// A record without data: an index, a schema.
    Other,
}

impl CheckedReader {
    /// Starts at the beginning of the file.
    pub fn open(path: &Path) -> Result<CheckedReader, RecordingError> {
        let failed = |source| RecordingError::Open { path: path.to_path_buf(), source: Arc::new(source) };
        let mut file = BufReader::with_capacity(1 << 16, open(path)?);
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
            // Bytes behind the end would be a second file, or the rest of a longer one that was written over.
            .with_check_finishes_after_end_magic(true)
            .with_record_length_limit(LONGEST);
        Ok(CheckedReader {
            path: path.to_path_buf(),
            file,
            file_bytes,
            reader: LinearReader::new_with_options(options),
            body: Vec::new(),
            offset: got.len() as u64,
            contents: Contents::default(),
            messages: 0,
            first_bare_message: None,
            layout: FileLayout::default(),
        })
    }

    /// Makes the error for a damaged record at `offset`.
    pub fn damaged(&self, offset: u64, cause: String) -> RecordingError {
        RecordingError::Damaged { path: self.path.clone(), offset, cause }
    }

    /// Returns the next record; `None` at the end of a whole file. After an error it must not be called again.
    pub fn next(&mut self) -> Result<Option<TopLevelRecord>, RecordingError> {
        self.next_top_level().map_err(|fault| {
            let path = self.path.clone();
            let offset = self.offset;
            match fault {
                Fault::Truncated => RecordingError::Truncated { path, offset, file_bytes: self.file_bytes },
                Fault::Damaged(cause) => self.damaged(offset, cause),
                // Chunks have checksums of their own, which were right.
                Fault::DataSection(cause) => self.damaged(self.first_bare_message.unwrap_or(offset), cause),
                Fault::Io(source) => RecordingError::Open { path, source: Arc::new(source) },
                Fault::Channels(topic, cause) => RecordingError::Channels { path, topic, cause },
                Fault::Schema(topic, got) => {
                    RecordingError::Schema { path, topic: topic.name(), expected: topic.schema_name(), got }
                }
            }
        })
    }

    fn next_top_level(&mut self) -> Result<Option<TopLevelRecord>, Fault> {
        let Some(opcode) = self.next_record()? else { return Ok(None) };
        // The body is moved out, since `top_level` borrows the reader. Its memory is used again for the next
        // record.
        let body = core::mem::take(&mut self.body);
        let record = self.top_level(opcode, &body);
        self.body = body;
        // After a fault the offset stays at the beginning of the record, which the error names.
        if record.is_ok() {
            self.offset += RECORD_HEAD + self.body.len() as u64;
        }
        record.map(Some)
    }

    /// Reads the next record into `self.body` and returns its opcode.
    fn next_record(&mut self) -> Result<Option<u8>, Fault> {
        while let Some(event) = self.reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(need) => {
                    // The reader asks for as much as a length in the file states, which may be wrong.
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

    /// Interprets a record at the top level of the file.
    fn top_level(&mut self, opcode: u8, body: &[u8]) -> Result<TopLevelRecord, Fault> {
        if !lengths::fit(opcode, body) {
            return Err(Fault::Damaged(String::from("a length that is longer than its record")));
        }
        self.layout.follow(opcode, body, self.offset).map_err(Fault::Damaged)?;
        match opcode {
            op::HEADER => match parse(opcode, body)? {
                McapRecord::Header(header) => Ok(TopLevelRecord::Header(header.library)),
                _ => Ok(TopLevelRecord::Other),
            },
            op::CHUNK => {
                self.contents.read_chunk(body)?;
                self.messages += self.contents.message_count;
                Ok(TopLevelRecord::Chunk)
            }
            op::METADATA => match parse(opcode, body)? {
                McapRecord::Metadata(metadata) => Ok(TopLevelRecord::Metadata(metadata.name, metadata.metadata)),
                _ => Ok(TopLevelRecord::Other),
            },
            op::MESSAGE => {
                self.contents.read_message(body)?;
                self.messages += self.contents.message_count;
                self.first_bare_message.get_or_insert(self.offset);
                Ok(TopLevelRecord::BareMessage)
            }
            // Behind the data section they are repeated.
            op::SCHEMA | op::CHANNEL if !self.layout.has_data_end => {
                self.contents.read_record(opcode, body).map(|()| TopLevelRecord::Other)
            }
            op::STATISTICS => Ok(TopLevelRecord::Statistics(lengths::number_at(body, 0))),
            0 => Err(Fault::Damaged(String::from("a record with opcode 0"))),
            _ => Ok(TopLevelRecord::Other),
        }
    }
}

/// Opens a recording for reading. Anything but a regular file is rejected before it is opened: a pipe would wait for
/// its other end, a device may have none.
pub(super) fn open(path: &Path) -> Result<File, RecordingError> {
    let failed = |source| RecordingError::Open { path: path.to_path_buf(), source: Arc::new(source) };
    let found = fs::metadata(path).map_err(failed)?;
    if !found.is_file() {
        return Err(RecordingError::NotAFile { path: path.to_path_buf(), got: file_kind(found.file_type()) });
    }
    File::open(path).map_err(failed)
}

impl FileLayout {
    /// Tracks the record at `offset`. The error describes how index or footer contradict the file.
    fn follow(&mut self, opcode: u8, body: &[u8], offset: u64) -> Result<(), String> {
        let number = |place: usize| lengths::number_at(body, place);
        if self.has_data_end && opcode != op::FOOTER {
            self.summary_start.get_or_insert(offset);
        }
        match opcode {
            op::CHUNK | op::MESSAGE | op::METADATA | op::ATTACHMENT if self.has_data_end => {
                return Err(String::from("a record of data behind the end of the data section"));
            }
            op::CHUNK | op::METADATA | op::ATTACHMENT => {
                self.chunks += u64::from(opcode == op::CHUNK);
                self.indexable.push((offset, RECORD_HEAD + body.len() as u64));
            }
            op::CHUNK_INDEX => {
                self.indexed_chunks += 1;
                self.check_indexed("chunk", number(16), number(24))?;
            }
            op::ATTACHMENT_INDEX => self.check_indexed("attachment", number(0), number(8))?,
            op::METADATA_INDEX => self.check_indexed("metadata record", number(0), number(8))?,
            op::DATA_END => self.has_data_end = true,
            op::SUMMARY_OFFSET => {
                self.summary_offset_start.get_or_insert(offset);
            }
            op::FOOTER => self.check_footer(offset, number(0), number(8))?,
            _ => {}
        }
        Ok(())
    }

    fn check_indexed(&self, what: &str, offset: u64, bytes: u64) -> Result<(), String> {
        // Records were added in the order of the file, so the list is sorted.
        match self.indexable.binary_search(&(offset, bytes)) {
            Ok(_) => Ok(()),
            Err(_) => Err(format!("the index names a {what} of {bytes} bytes at byte {offset}, where none is")),
        }
    }

    /// Compares the statements of the footer with the file; 0 states nothing (MCAP specification, "Footer").
    fn check_footer(&self, offset: u64, summary_start: u64, summary_offset_start: u64) -> Result<(), String> {
        if !self.has_data_end {
            return Err(String::from("a footer without the record that ends the data section"));
        }
        let stated = [
            ("the summary", summary_start, self.summary_start),
            ("the group of summary offsets", summary_offset_start, self.summary_offset_start),
        ];
        for (what, stated, found) in stated {
            let found = found.unwrap_or(offset);
            // 0 states that the file has no such section (MCAP specification).
            if stated != 0 && stated != found {
                return Err(format!("the footer states byte {stated} as the beginning of {what}, expected {found}"));
            }
        }
        if self.indexed_chunks != 0 && self.indexed_chunks != self.chunks {
            let indexed = self.indexed_chunks;
            let chunks = self.chunks;
            return Err(format!("the index names {indexed} chunks, of which the file has {chunks}"));
        }
        Ok(())
    }
}
