//! What keeps a log from being read.

use std::io;
use std::path::PathBuf;

use resonarm_protocol::FrameError;
use thiserror::Error;

use super::BlfFault;
use resonarm_protocol::FrameTextError;

/// What is wrong with a log, or with a line of one.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CanLogError {
    /// The file can't be read.
    #[error("can't read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A line is none of the format.
    #[error("{}, line {line}: {source}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1 on.
        line: u64,
        /// What is wrong with it.
        source: Box<CanLogError>,
    },
    /// A BLF log can't be read on.
    #[error("{}, byte {offset}: {fault}", path.display())]
    Blf {
        /// The file.
        path: PathBuf,
        /// Where the object begins, or the container that it is in, bytes from the start of the file.
        offset: u64,
        /// What is wrong with it.
        fault: BlfFault,
    },
    /// A line that is longer than any of a log.
    #[error("it is longer than {most} bytes")]
    LongLine {
        /// The longest that is read, bytes.
        most: usize,
    },
    /// A line that is none of a candump log.
    #[error("it is not a line of `candump -L`, as (12.345678) vcan0 201#1122")]
    CandumpLine,
    /// A frame of a candump log that can't be read.
    #[error(transparent)]
    FrameText(FrameTextError),
    /// A line of an ASC log that begins as a frame and does not go on as one.
    #[error("it is not a frame of an ASC log, as 0.001000 1 201 Rx d 2 11 22")]
    AscLine,
    /// A date of an ASC log.
    #[error("{got:?} is no date, as Sat Sep 30 15:06:13.191 2017")]
    Date {
        /// What stands there.
        got: String,
    },
    /// A time of a candump log.
    #[error("{got:?} is no time in brackets, as (12.345678)")]
    Time {
        /// What stands there.
        got: String,
    },
    /// A frame that can't exist.
    #[error("{0}")]
    Frame(FrameError),
}

impl From<FrameError> for CanLogError {
    fn from(error: FrameError) -> CanLogError {
        CanLogError::Frame(error)
    }
}
