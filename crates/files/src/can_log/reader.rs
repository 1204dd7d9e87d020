//! Reads logs frame by frame.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use super::{CanLogError, LogFormat, LoggedFrame, asc, blf, parse_line};

/// Set in the identifiers of a candump log's error frames, which report the bus's state and were never on it
/// (linux/can.h).
const ERROR_FRAME: u32 = 0x2000_0000;

/// Longest accepted line, bytes: far above what a frame needs.
const LONGEST_LINE: usize = 1 << 20;

/// A line of a text, or an object of a BLF log.
pub(super) enum Entry {
    Frame(LoggedFrame),
    Other,
}

/// The frames of a log, in its order. Ends after the first error.
pub struct LoggedFrames {
    entries: Entries,
    others: u64,
    has_failed: bool,
}

enum Entries {
    Lines(Lines),
    Objects(blf::Reader),
}

/// The lines of a text.
struct Lines {
    path: PathBuf,
    file: BufReader<File>,
    /// The last line, and its number, from 1.
    bytes: Vec<u8>,
    number: u64,
    syntax: Syntax,
}

enum Syntax {
    Candump,
    Asc(asc::Reader),
}

impl Syntax {
    fn end(&self) -> Result<(), CanLogError> {
        match self {
            // Nothing says where a log of candump ends.
            Syntax::Candump => Ok(()),
            Syntax::Asc(reader) => reader.end(),
        }
    }
}

/// Opens a log.
///
/// # Errors
/// [`CanLogError::Read`] if the file can't be opened; [`CanLogError::Blf`] if it should be a BLF log and does not begin
/// like one.
pub fn read(path: &Path, format: LogFormat) -> Result<LoggedFrames, CanLogError> {
    let entries = match format {
        LogFormat::Candump => Entries::Lines(Lines::open(path, Syntax::Candump)?),
        LogFormat::Asc => Entries::Lines(Lines::open(path, Syntax::Asc(asc::Reader::new()))?),
        LogFormat::Blf => Entries::Objects(blf::Reader::open(path)?),
    };
    Ok(LoggedFrames { entries, others: 0, has_failed: false })
}

impl LoggedFrames {
    /// Lines or objects so far that are not frames: error frames, comments and other events, the head of an ASC log.
    pub fn others(&self) -> u64 {
        self.others
    }

    fn next_frame(&mut self) -> Result<Option<LoggedFrame>, CanLogError> {
        loop {
            let entry = match &mut self.entries {
                Entries::Lines(lines) => lines.next()?,
                Entries::Objects(objects) => objects.next()?,
            };
            match entry {
                Some(Entry::Frame(frame)) => return Ok(Some(frame)),
                Some(Entry::Other) => self.others += 1,
                None => return Ok(None),
            }
        }
    }
}

impl Lines {
    fn open(path: &Path, syntax: Syntax) -> Result<Lines, CanLogError> {
        let path = path.to_path_buf();
        match File::open(&path) {
            Ok(file) => Ok(Lines { path, file: BufReader::new(file), bytes: Vec::new(), number: 0, syntax }),
            Err(source) => Err(CanLogError::Read { path, source }),
        }
    }

    /// The entry in the next line that is not empty; `None` at the end.
    fn next(&mut self) -> Result<Option<Entry>, CanLogError> {
        loop {
            self.bytes.clear();
            let read = self.file.by_ref().take(LONGEST_LINE as u64 + 1).read_until(b'\n', &mut self.bytes);
            let read = read.map_err(|source| CanLogError::Read { path: self.path.clone(), source })?;
            self.number += u64::from(read > 0);
            let failed = |source| {
                let (path, line) = (self.path.clone(), self.number);
                CanLogError::Line { path, line, source: Box::new(source) }
            };
            if read == 0 {
                return self.syntax.end().map(|()| None).map_err(failed);
            }
            if read > LONGEST_LINE {
                return Err(failed(CanLogError::LongLine { most: LONGEST_LINE }));
            }
            // Comments and names may be in any code page; the rest is ASCII.
            let text = String::from_utf8_lossy(&self.bytes);
            let line = text.trim();
            if line.is_empty() {
                continue;
            }
            let found = match &mut self.syntax {
                Syntax::Candump if is_error_frame(line) => Ok(None),
                Syntax::Candump => parse_line(line).map(Some),
                Syntax::Asc(reader) if self.bytes.ends_with(b"\n") => reader.line(line),
                Syntax::Asc(reader) => reader.last_line(line),
            };
            return found.map(|frame| Some(frame.map_or(Entry::Other, Entry::Frame))).map_err(failed);
        }
    }
}

/// Whether a line of a candump log is an error frame.
fn is_error_frame(line: &str) -> bool {
    let id = line.split_whitespace().nth(2).and_then(|frame| frame.split_once('#')).map(|(id, _)| id);
    let id = id.filter(|id| id.len() == 8).and_then(|id| u32::from_str_radix(id, 16).ok());
    id.is_some_and(|id| id & ERROR_FRAME != 0)
}

impl Iterator for LoggedFrames {
    type Item = Result<LoggedFrame, CanLogError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.has_failed {
            return None;
        }
        let next = self.next_frame().transpose();
        self.has_failed = matches!(next, Some(Err(_)));
        next
    }
}
