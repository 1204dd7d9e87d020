//! Logs read frame by frame.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::{CanLogError, LogFormat, LoggedFrame, asc, parse_line};

/// Set in the identifiers of a candump log's error frames, which tell of the bus and were never on it (linux/can.h).
const ERROR_FRAME: u32 = 0x2000_0000;

/// The frames of a log, in the order of its lines. Ends after the first error.
pub struct LoggedFrames {
    path: PathBuf,
    lines: BufReader<File>,
    line: u64,
    syntax: Syntax,
    others: u64,
    text: String,
    has_failed: bool,
}

enum Syntax {
    Candump,
    Asc(asc::Reader),
}

/// Opens a log.
///
/// # Errors
/// [`CanLogError::Read`] if the file can't be opened; [`CanLogError::Blf`] for [`LogFormat::Blf`].
pub fn read(path: &Path, format: LogFormat) -> Result<LoggedFrames, CanLogError> {
    let path = path.to_path_buf();
    let syntax = match format {
        LogFormat::Candump => Syntax::Candump,
        LogFormat::Asc => Syntax::Asc(asc::Reader::new()),
        LogFormat::Blf => return Err(CanLogError::Blf { path }),
    };
    match File::open(&path) {
        Ok(file) => {
            let lines = BufReader::new(file);
            Ok(LoggedFrames { path, lines, line: 0, syntax, others: 0, text: String::new(), has_failed: false })
        }
        Err(source) => Err(CanLogError::Read { path, source }),
    }
}

impl LoggedFrames {
    /// Lines so far that are no frames: error frames, and in ASC the head, comments and other events.
    pub fn others(&self) -> u64 {
        self.others
    }

    fn next_frame(&mut self) -> Result<Option<LoggedFrame>, CanLogError> {
        loop {
            self.text.clear();
            let read = self.lines.read_line(&mut self.text);
            if read.map_err(|source| CanLogError::Read { path: self.path.clone(), source })? == 0 {
                return Ok(None);
            }
            self.line += 1;
            let line = self.text.trim();
            let found = match &mut self.syntax {
                _ if line.is_empty() => continue,
                Syntax::Candump if is_error_frame(line) => Ok(None),
                Syntax::Candump => parse_line(line).map(Some),
                Syntax::Asc(reader) => reader.line(line),
            };
            match found {
                Ok(Some(frame)) => return Ok(Some(frame)),
                Ok(None) => self.others += 1,
                Err(source) => {
                    let (path, line, source) = (self.path.clone(), self.line, Box::new(source));
                    return Err(CanLogError::Line { path, line, source });
                }
            }
        }
    }
}

/// Whether a line of a candump log tells of an error frame.
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
