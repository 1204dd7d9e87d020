//! Frames in the log files of other tools: `candump` of can-utils, ASC and BLF of Vector.
//!
//! Writers take frames one by one, and readers return them one by one: none is kept.

mod asc;
mod blf;
mod candump;
mod date;
mod error;
mod reader;
mod vector;

use std::io::{Seek, Write};

use resonarm_protocol::Frame;

use crate::recording::Direction;

pub use blf::BlfFault;
pub use candump::{CandumpContent, CandumpLine, ErrorFrame, parse_line};
pub use error::CanLogError;
pub use reader::{LoggedFrames, read};

/// A frame in a log.
#[derive(Clone, Debug, PartialEq)]
pub struct LoggedFrame {
    /// Time at which it was logged, ns: of the UNIX epoch, or from the start of a log that has no date.
    pub time_ns: u64,
    /// Its interface or channel, if the log names one.
    pub interface: Option<String>,
    /// Whether the logging node received or sent it, if the log says so.
    pub direction: Option<Direction>,
    /// Frame as it was on the bus.
    pub frame: Frame,
}

/// A format of logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// Lines as `candump -L` of can-utils writes them, the direction last: `(12.345678) vcan0 201#1122 T`; its view on a
    /// terminal is read as well if it has times.
    Candump,
    /// The text format of Vector's CANalyzer and CANoe; times have microseconds.
    Asc,
    /// The binary format of Vector's CANalyzer and CANoe; written uncompressed, read compressed or not.
    Blf,
}

impl LogFormat {
    /// All formats that can be read.
    pub const ALL: [LogFormat; 3] = [LogFormat::Candump, LogFormat::Asc, LogFormat::Blf];

    /// Returns the name, as flags use it.
    pub const fn name(self) -> &'static str {
        match self {
            LogFormat::Candump => "candump",
            LogFormat::Asc => "asc",
            LogFormat::Blf => "blf",
        }
    }

    /// Returns the extension of its files.
    pub const fn ending(self) -> &'static str {
        match self {
            LogFormat::Candump => ".log",
            LogFormat::Asc => ".asc",
            LogFormat::Blf => ".blf",
        }
    }

    /// Makes a writer of this format. A candump log names `interface` in every line; the others call it channel 1, and
    /// their times count from the millisecond of `start_ns`, ns. No frame may be earlier.
    pub fn writer<'a, W: Write + Seek + 'a>(self, out: W, interface: &str, start_ns: u64) -> Box<dyn LogWriter + 'a> {
        match self {
            LogFormat::Candump => Box::new(candump::Writer::new(out, interface)),
            LogFormat::Asc => Box::new(asc::Writer::new(out, start_ns)),
            LogFormat::Blf => Box::new(blf::Writer::new(out, start_ns)),
        }
    }
}

/// Writes the frames of a log, in order.
pub trait LogWriter {
    /// Writes one frame. Its interface is the log's.
    ///
    /// # Errors
    /// The error of the operating system; [`InvalidInput`](std::io::ErrorKind::InvalidInput) if the frame is earlier
    /// than the start of a log that counts from there.
    fn write(&mut self, frame: &LoggedFrame) -> std::io::Result<()>;

    /// Writes the end of the log. A log without it may not be readable.
    ///
    /// # Errors
    /// The error of the operating system.
    fn finish(&mut self) -> std::io::Result<()>;
}

#[cfg(test)]
mod tests;
