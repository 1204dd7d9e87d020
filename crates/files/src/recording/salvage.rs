//! Finds every whole record of a damaged file, wherever it is.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::MAGIC;
use mcap::records::{Record as McapRecord, op};

use super::checked_reader::{self, RECORD_HEAD};
use super::contents::{CHUNK_HEAD, Contents, Fault, LONGEST, parse};
use super::error::RecordingError;

/// Bytes searched at a time.
const WINDOW: u64 = 1 << 16;
/// The first bytes of this program's metadata records, after opcode and length: the length of the name, below 256, and
/// this.
const OUR_METADATA: &[u8] = b"resonarm.";

/// A part of the file from which nothing could be read.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct LostChunk {
    /// Position of the part, bytes.
    pub offset: u64,
    /// Size of the lost part, bytes.
    pub bytes: u64,
    /// First and last log time that it states, ns, where they are plausible.
    pub log_times_ns: Option<(u64, u64)>,
    /// Damage of the chunk, in words.
    pub cause: String,
}

/// Next readable piece of the file.
pub(super) enum Piece {
    /// A metadata record: name and content.
    Metadata(String, BTreeMap<String, String>),
    /// Messages, which are in [`Salvage::contents`] until the next piece is read.
    Chunk {
        /// Position of the chunk, bytes.
        offset: u64,
        /// Size of the chunk in the file, bytes.
        bytes: u64,
    },
    /// A record without data.
    Other,
    /// A part up to the next piece from which nothing could be read.
    Lost(LostChunk),
}

/// A pass through a file that continues behind damaged parts.
///
/// A record is an opcode, a length and that many bytes. A wrong byte inside a chunk spoils only that chunk: its
/// checksum shows the damage, and the next record begins where its length says. If the length itself is wrong, no
/// record is found there, and the pass searches for the next chunk whose lengths agree, or the next metadata record of
/// this program.
pub(super) struct Salvage {
    path: PathBuf,
    file: File,
    file_bytes: u64,
    offset: u64,
    /// Declarations, and the messages of the chunk read last.
    pub contents: Contents,
    body: Vec<u8>,
    /// Whether messages outside chunks are accepted: they have no checksum of their own.
    takes_bare_messages: bool,
}

impl Salvage {
    /// Starts behind the magic bytes, which must be right.
    pub fn open(path: &Path, takes_bare_messages: bool) -> Result<Salvage, RecordingError> {
        let file = checked_reader::open(path)?;
        let failed = |source| RecordingError::Open { path: path.to_path_buf(), source: Arc::new(source) };
        let file_bytes = file.metadata().map_err(failed)?.len();
        let contents = Contents::default();
        let body = Vec::new();
        let path = path.to_path_buf();
        let offset = MAGIC.len() as u64;
        Ok(Salvage { path, file, file_bytes, offset, contents, body, takes_bare_messages })
    }

    /// Restarts the same file, with all declarations in it known.
    pub fn again(self) -> Salvage {
        Salvage { offset: MAGIC.len() as u64, ..self }
    }

    /// Returns the next piece; `None` at the end of the file.
    pub fn next(&mut self) -> Result<Option<Piece>, RecordingError> {
        self.piece().map_err(|source| RecordingError::Open { path: self.path.clone(), source: Arc::new(source) })
    }

    fn piece(&mut self) -> io::Result<Option<Piece>> {
        let offset = self.offset;
        if offset >= self.file_bytes || self.ends_here()? {
            return Ok(None);
        }
        let Some((opcode, length)) = self.head(offset)? else {
            let cause = "no record begins here, or it is cut off";
            return self.lose(offset + 1, String::from(cause)).map(Some);
        };
        let bytes = RECORD_HEAD + length;
        self.body.resize(usize::try_from(length).unwrap_or(LONGEST), 0);
        self.file.read_exact_at(&mut self.body, offset + RECORD_HEAD)?;
        // The body is moved out, since `read` borrows `self`. Its memory is used again for the next record.
        let body = core::mem::take(&mut self.body);
        let read = self.read(opcode, &body, bytes);
        self.body = body;
        match read {
            Ok(piece) => {
                self.offset = offset + bytes;
                Ok(Some(piece))
            }
            Err(Fault::Io(error)) => Err(error),
            Err(fault) => {
                // Where the next record would be if this one's length is right.
                let next = offset + bytes;
                // If a record stands there, only the content of this one is damaged.
                let follows = next == self.file_bytes || self.head(next)?.is_some();
                self.lose(if follows { next } else { offset + 1 }, cause(fault)).map(Some)
            }
        }
    }

    /// Interprets a whole record.
    fn read(&mut self, opcode: u8, body: &[u8], bytes: u64) -> Result<Piece, Fault> {
        match opcode {
            op::CHUNK => {
                self.contents.read_chunk(body)?;
                Ok(Piece::Chunk { offset: self.offset, bytes })
            }
            op::METADATA => match parse(opcode, body)? {
                McapRecord::Metadata(metadata) => Ok(Piece::Metadata(metadata.name, metadata.metadata)),
                _ => Ok(Piece::Other),
            },
            op::SCHEMA | op::CHANNEL => self.contents.read_record(opcode, body).map(|()| Piece::Other),
            op::MESSAGE if self.takes_bare_messages => {
                self.contents.read_message(body)?;
                Ok(Piece::Chunk { offset: self.offset, bytes })
            }
            op::MESSAGE => Err(Fault::Damaged(String::from("a message without a checksum in a damaged file"))),
            _ => Ok(Piece::Other),
        }
    }

    /// Returns opcode and length of the record at `offset`, if one can be there.
    fn head(&self, offset: u64) -> io::Result<Option<(u8, u64)>> {
        let mut head = [0; RECORD_HEAD as usize];
        if offset.checked_add(RECORD_HEAD).is_none_or(|end| end > self.file_bytes) {
            return Ok(None);
        }
        self.file.read_exact_at(&mut head, offset)?;
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        // The length may be damaged, so it is bounded before memory is reserved by it.
        let fits = length <= self.file_bytes - offset - RECORD_HEAD && length <= LONGEST as u64;
        Ok((fits && (op::HEADER..=op::DATA_END).contains(&opcode)).then_some((opcode, length)))
    }

    /// Says whether the file ends here, in order.
    fn ends_here(&self) -> io::Result<bool> {
        let mut rest = [0; MAGIC.len()];
        if self.file_bytes - self.offset != MAGIC.len() as u64 {
            return Ok(false);
        }
        self.file.read_exact_at(&mut rest, self.offset)?;
        Ok(rest == MAGIC)
    }

    /// Gives up the bytes between here and the next record at `from` or later.
    fn lose(&mut self, from: u64, cause: String) -> io::Result<Piece> {
        let offset = self.offset;
        let known = self.head(from)?.is_some() || from == self.file_bytes;
        self.offset = if from > offset + 1 && known { from } else { self.search(from)? };
        let bytes = self.offset - offset;
        Ok(Piece::Lost(LostChunk { offset, bytes, log_times_ns: self.stated_times(offset)?, cause }))
    }

    /// Returns the next position, at `from` or later, at which a chunk or a metadata record begins; the end of the file
    /// if there is none.
    fn search(&self, from: u64) -> io::Result<u64> {
        let mut window = vec![0; WINDOW as usize];
        let mut start = from;
        while start < self.file_bytes {
            let length = WINDOW.min(self.file_bytes - start) as usize;
            self.file.read_exact_at(&mut window[..length], start)?;
            for (place, byte) in window[..length].iter().enumerate() {
                // `begins` reads from the file itself, so a record across two windows is found, too.
                if matches!(*byte, op::CHUNK | op::METADATA) && self.begins(start + place as u64)? {
                    return Ok(start + place as u64);
                }
            }
            start += length as u64;
        }
        Ok(self.file_bytes)
    }

    /// Says whether a chunk whose lengths agree, or a metadata record of this program, begins at `offset`.
    fn begins(&self, offset: u64) -> io::Result<bool> {
        let Some((opcode, length)) = self.head(offset)? else { return Ok(false) };
        let mut body = [0; CHUNK_HEAD + 8]; // the longest name of a compression has 4 letters
        let known = body.len().min(usize::try_from(length).unwrap_or(body.len()));
        self.file.read_exact_at(&mut body[..known], offset + RECORD_HEAD)?;
        let body = &body[..known];
        if opcode == op::METADATA {
            // The length of the name is below 256, so its three higher bytes are 0.
            return Ok(body.get(1..4) == Some(&[0; 3]) && body[4..].starts_with(OUR_METADATA));
        }
        let number =
            |at: usize| body.get(at..at + 4).map(|bytes| bytes.iter().rev().fold(0, |n, b| n << 8 | u64::from(*b)));
        let Some(name) = number(28).filter(|name| *name <= 4) else { return Ok(false) };
        // The length of the compressed records has eight bytes, low half first. Together with the head it must be the
        // length of the chunk.
        let records = number(32 + name as usize).zip(number(36 + name as usize)).map(|(low, high)| high << 32 | low);
        Ok(records.and_then(|records| records.checked_add(CHUNK_HEAD as u64 + name)) == Some(length))
    }

    /// Returns first and last log time of the chunk at `offset`, if there is one and they are in order.
    fn stated_times(&self, offset: u64) -> io::Result<Option<(u64, u64)>> {
        let mut times = [0; 16];
        let mut opcode = [0];
        if offset + RECORD_HEAD + 16 > self.file_bytes {
            return Ok(None);
        }
        self.file.read_exact_at(&mut opcode, offset)?;
        self.file.read_exact_at(&mut times, offset + RECORD_HEAD)?;
        let (first, last) = times.split_at(8);
        let time = |bytes: &[u8]| bytes.iter().rev().fold(0, |n, b| n << 8 | u64::from(*b));
        let first = time(first);
        let last = time(last);
        Ok((opcode == [op::CHUNK] && first <= last).then_some((first, last)))
    }
}

fn cause(fault: Fault) -> String {
    match fault {
        Fault::Truncated => String::from("the file ends inside it"),
        Fault::Damaged(cause) | Fault::DataSection(cause) => cause,
        Fault::Io(error) => error.to_string(),
        Fault::Schema(topic, got) => format!("topic {} has messages {got}", topic.name()),
        Fault::Channels(topic, cause) => format!("topic {topic} has {cause}"),
    }
}
