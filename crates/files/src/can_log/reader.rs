//! Reads logs frame by frame.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use super::candump::{CandumpContent, parse_line};
use super::error::CanLogError;
use super::{LogFormat, LoggedFrame, asc, blf};

/// Longest accepted line, bytes: far above what a frame needs.
const LONGEST_LINE: usize = 1 << 20;

/// A line of a text, or an object of a BLF log.
pub(super) enum Entry {
    Frame(LoggedFrame),
    Other,
    /// A frame that can't be read, while the next entry can.
    Unreadable(CanLogError),
}

/// Iterator over the frames of a log, in its order. A line or object that can't be read is left out and counted, as one
/// odd line must not cost a whole log; the frames end with the first error behind which nothing can be read.
pub struct LoggedFrames {
    entries: Entries,
    /// Number of lines or objects so far that are not frames: error frames, comments and other events, the head of an
    /// ASC log.
    pub others: u64,
    /// Number of lines or objects so far that were left out since they can't be read.
    pub unreadable: u64,
    /// Error of the first of them.
    pub first_unreadable: Option<CanLogError>,
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
    has_ended: bool,
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

/// Opens a log for reading.
pub(super) fn open(path: &Path) -> Result<BufReader<File>, CanLogError> {
    let failed = |source| CanLogError::Read { path: path.to_path_buf(), source };
    File::open(path).map(BufReader::new).map_err(failed)
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
    Ok(LoggedFrames { entries, others: 0, unreadable: 0, first_unreadable: None, has_failed: false })
}

impl LoggedFrames {
    fn next_frame(&mut self) -> Result<Option<LoggedFrame>, CanLogError> {
        loop {
            let entry = match &mut self.entries {
                Entries::Lines(lines) => lines.next()?,
                Entries::Objects(objects) => objects.next()?,
            };
            match entry {
                Some(Entry::Frame(frame)) => return Ok(Some(frame)),
                Some(Entry::Other) => self.others += 1,
                Some(Entry::Unreadable(error)) => {
                    self.unreadable += 1;
                    self.first_unreadable.get_or_insert(error);
                }
                None => return Ok(None),
            }
        }
    }
}

impl Lines {
    fn open(path: &Path, syntax: Syntax) -> Result<Lines, CanLogError> {
        let file = open(path)?;
        let path = path.to_path_buf();
        let bytes = Vec::new();
        Ok(Lines { path, file, bytes, number: 0, syntax, has_ended: false })
    }

    /// Returns the entry in the next line that is not empty; `None` at the end.
    fn next(&mut self) -> Result<Option<Entry>, CanLogError> {
        loop {
            self.bytes.clear();
            let read = self.file.by_ref().take(LONGEST_LINE as u64 + 1).read_until(b'\n', &mut self.bytes);
            let read = read.map_err(|source| CanLogError::Read { path: self.path.clone(), source })?;
            self.number += u64::from(read > 0);
            let failed = |source| {
                let path = self.path.clone();
                let line = self.number;
                CanLogError::Line { path, line, source: Box::new(source) }
            };
            if read == 0 {
                // The truncation is reported once. The next call then ends the iteration.
                let end = self.syntax.end().err().filter(|_| !core::mem::replace(&mut self.has_ended, true));
                return Ok(end.map(|error| Entry::Unreadable(failed(error))));
            }
            // The end of such a line is unknown, so nothing behind it can be read: this ends the log, unlike other
            // faults of a line.
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
                Syntax::Candump => candump(line),
                Syntax::Asc(reader) if self.bytes.ends_with(b"\n") => reader.line(line),
                Syntax::Asc(reader) => reader.last_line(line),
            };
            return Ok(Some(match found {
                Ok(Some(frame)) => Entry::Frame(frame),
                Ok(None) => Entry::Other,
                Err(error) => Entry::Unreadable(failed(error)),
            }));
        }
    }
}

/// Returns the frame in a line of candump; `None` for an error frame.
fn candump(line: &str) -> Result<Option<LoggedFrame>, CanLogError> {
    let line = parse_line(line)?;
    let CandumpContent::Frame(frame) = line.content else { return Ok(None) };
    let time_ns = line.time_ns.ok_or(CanLogError::NoTime)?;
    Ok(Some(LoggedFrame { time_ns, interface: line.interface, direction: line.direction, frame }))
}

impl Iterator for LoggedFrames {
    type Item = Result<LoggedFrame, CanLogError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.has_failed {
            return None;
        }
        let next = self.next_frame().transpose();
        // After an error the position in the file is unknown, so that further entries would be guesses.
        self.has_failed = matches!(next, Some(Err(_)));
        next
    }
}
