//! Errors in reading a log.

use std::io;
use std::path::PathBuf;

use resonarm_protocol::{FrameError, FrameTextError};
use thiserror::Error;

use super::blf::BlfFault;

/// An error in a log, or in a line of one.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CanLogError {
    /// The file can't be read.
    #[error("can't read {}: {source}", path.display())]
    Read {
        /// Path of the log that can't be read.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A line is not valid in its format.
    #[error("{}, line {line}: {source}", path.display())]
    Line {
        /// Path of the log with the line.
        path: PathBuf,
        /// The line, from 1 on.
        line: u64,
        /// The error in the line.
        source: Box<CanLogError>,
    },
    /// The rest of a BLF log can't be read.
    #[error("{}, byte {offset}: {fault}", path.display())]
    Blf {
        /// Path of the BLF log.
        path: PathBuf,
        /// Position of the object, or of its container, bytes from the start of the file.
        offset: u64,
        /// Reason for which the log can't be read from there on.
        fault: BlfFault,
    },
    /// A line is too long.
    #[error("the line is longer than {most} bytes")]
    LongLine {
        /// Longest accepted line, bytes.
        most: usize,
    },
    /// The line is not one of candump.
    #[error(
        "the line is not one of candump: expected (12.345678) vcan0 201#1122 of `candump -L`, or vcan0 201 [2] 11 22 of \
         its view"
    )]
    CandumpLine,
    /// The line has no time.
    #[error("the line has no time stamp: log with `candump -L`, or with `candump -t a` instead of `candump`")]
    NoTime,
    /// A frame before the UNIX epoch, or before the start of a log without a date.
    #[error("the frame's time, {time_ns} ns, is before the start of the log, which has no date")]
    BeforeEpoch {
        /// The time from the start of the log, ns.
        time_ns: i64,
    },
    /// The frame in a line of candump can't be read.
    #[error(transparent)]
    FrameText(FrameTextError),
    /// The line of an ASC log begins like a frame but is not one.
    #[error("the line is not a frame of an ASC log such as 0.001000 1 201 Rx d 2 11 22")]
    AscLine,
    /// The ASC log is cut short.
    #[error("the log is cut short: it ends {inside}")]
    Truncated {
        /// Element of the log within which it ends, in words.
        inside: &'static str,
    },
    /// The date of an ASC log is invalid.
    #[error("{got:?} is not a date such as Sat Sep 30 15:06:13.191 2017")]
    Date {
        /// Text found instead of the date.
        got: String,
    },
    /// The time in a line of candump is invalid.
    #[error("{got:?} is not a time in brackets such as (12.345678)")]
    Time {
        /// Text found instead of the time.
        got: String,
    },
    /// The line describes a frame that CAN does not allow.
    #[error(transparent)]
    Frame(#[from] FrameError),
}
