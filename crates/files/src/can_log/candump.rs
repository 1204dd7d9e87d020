//! Logs of `candump -L` of can-utils.

use std::io::{self, Write};

use super::{CanLogError, LogWriter, LoggedFrame};
use crate::recording::Direction;

/// Writes lines `(12.345678) vcan0 201#1122 T`: T for sent, R for received.
pub(super) struct Writer<W> {
    out: W,
    interface: String,
}

impl<W: Write> Writer<W> {
    pub fn new(out: W, interface: &str) -> Writer<W> {
        Writer { out, interface: interface.to_owned() }
    }
}

impl<W: Write> LogWriter for Writer<W> {
    fn write(&mut self, logged: &LoggedFrame) -> io::Result<()> {
        let (second, microsecond) = (logged.time_ns / 1_000_000_000, logged.time_ns % 1_000_000_000 / 1000);
        let direction = match logged.direction {
            Some(Direction::Received) => " R",
            Some(Direction::Sent) => " T",
            None => "",
        };
        writeln!(self.out, "({second}.{microsecond:06}) {} {}{direction}", self.interface, logged.frame)
    }

    fn finish(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Reads a line `(TIME) INTERFACE FRAME [R|T]`, the time in s with any number of digits.
///
/// # Errors
/// The first fault of the line.
pub fn parse_line(line: &str) -> Result<LoggedFrame, CanLogError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let (time, interface, frame, direction) = match words[..] {
        [time, interface, frame] => (time, interface, frame, None),
        [time, interface, frame, "R"] => (time, interface, frame, Some(Direction::Received)),
        [time, interface, frame, "T"] => (time, interface, frame, Some(Direction::Sent)),
        _ => return Err(CanLogError::CandumpLine),
    };
    let in_brackets = time.strip_prefix('(').and_then(|time| time.strip_suffix(')')).ok_or(CanLogError::CandumpLine)?;
    let time_ns = nanoseconds(in_brackets).ok_or_else(|| CanLogError::Time { got: time.to_owned() })?;
    let frame = frame.parse().map_err(CanLogError::FrameText)?;
    Ok(LoggedFrame { time_ns, interface: Some(interface.to_owned()), direction, frame })
}

/// Decimal seconds as whole nanoseconds, without floating-point rounding; further digits are cut off.
pub(super) fn nanoseconds(text: &str) -> Option<u64> {
    let (seconds, fraction) = text.split_once('.').unwrap_or((text, ""));
    let is_number = |digits: &str| digits.bytes().all(|byte| byte.is_ascii_digit());
    if seconds.is_empty() || !is_number(seconds) || !is_number(fraction) {
        return None;
    }
    let nine: String = fraction.chars().chain(core::iter::repeat('0')).take(9).collect();
    seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(nine.parse().ok()?)
}
