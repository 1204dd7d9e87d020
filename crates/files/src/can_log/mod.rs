//! Frames in the log files of other tools: `candump -L` of can-utils, ASC and BLF of Vector.
//!
//! Every writer takes one frame after the other, and every reader gives one after the other: none is kept.

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
pub use candump::parse_line;
pub use error::CanLogError;
use reader::Entry;
pub use reader::{LoggedFrames, read};

/// A frame and what a log says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct LoggedFrame {
    /// When it was seen, ns: of the UNIX epoch, or from the start of a log that has no date.
    pub time_ns: u64,
    /// On which interface, or on which channel, where the log says.
    pub interface: Option<String>,
    /// Whether the node that logged received or sent it, where the log says.
    pub direction: Option<Direction>,
    /// The frame.
    pub frame: Frame,
}

/// A format of logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// Lines as `candump -L` of can-utils writes them, with the direction behind: `(12.345678) vcan0 201#1122 T`.
    Candump,
    /// The text format of Vector's CANalyzer and CANoe; times have microseconds.
    Asc,
    /// The binary format of Vector's CANalyzer and CANoe; written uncompressed, read compressed as well.
    Blf,
}

impl LogFormat {
    /// All formats.
    pub const ALL: [LogFormat; 3] = [LogFormat::Candump, LogFormat::Asc, LogFormat::Blf];

    /// The name, as flags have it.
    pub const fn name(self) -> &'static str {
        match self {
            LogFormat::Candump => "candump",
            LogFormat::Asc => "asc",
            LogFormat::Blf => "blf",
        }
    }

    /// How the names of its files end.
    pub const fn ending(self) -> &'static str {
        match self {
            LogFormat::Candump => ".log",
            LogFormat::Asc => ".asc",
            LogFormat::Blf => ".blf",
        }
    }

    /// A writer of this format. A candump log names `interface` in every line, the others call it channel 1; their
    /// times count from the millisecond of `start_ns`, ns, than which no frame may be earlier.
    pub fn writer<'a, W: Write + Seek + 'a>(self, out: W, interface: &str, start_ns: u64) -> Box<dyn LogWriter + 'a> {
        match self {
            LogFormat::Candump => Box::new(candump::Writer::new(out, interface)),
            LogFormat::Asc => Box::new(asc::Writer::new(out, start_ns)),
            LogFormat::Blf => Box::new(blf::Writer::new(out, start_ns)),
        }
    }
}

/// Takes the frames of a log, in their order.
pub trait LogWriter {
    /// Writes one frame. Its interface is that of the log.
    ///
    /// # Errors
    /// What the system says; [`InvalidInput`](std::io::ErrorKind::InvalidInput) if it is earlier than the start of a
    /// log that counts from there.
    fn write(&mut self, frame: &LoggedFrame) -> std::io::Result<()>;

    /// Writes what belongs at the end. A log without it may not be readable.
    ///
    /// # Errors
    /// What the system says.
    fn finish(&mut self) -> std::io::Result<()>;
}

#[cfg(test)]
mod tests;
