//! A line of a log: a frame alone, or as `candump -L` writes it.

use crate::can_log::{self, CanLogError, LoggedFrame};
use crate::protocol::{Frame, FrameTextError};

/// A frame and what stood before it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LogLine {
    /// When it was seen, s, where the log says.
    pub time_s: Option<f64>,
    /// On which interface, where the log says.
    pub interface: Option<String>,
    /// The frame.
    pub frame: Frame,
}

impl LogLine {
    /// Reads `FRAME` or `(TIME) INTERFACE FRAME [DIRECTION]`.
    ///
    /// # Errors
    /// What the line has that it can't have.
    pub fn parse(line: &str) -> Result<LogLine, String> {
        let line = line.trim();
        if !line.contains(char::is_whitespace) {
            let frame = line.parse().map_err(|error: FrameTextError| error.to_string())?;
            return Ok(LogLine { time_s: None, interface: None, frame });
        }
        match can_log::parse_line(line) {
            Ok(LoggedFrame { time_ns, interface, frame, .. }) => {
                // Digit by digit: a count of nanoseconds in our days has more digits than a number of this type.
                let (seconds, rest) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000);
                Ok(LogLine { time_s: format!("{seconds}.{rest:09}").parse().ok(), interface, frame })
            }
            Err(CanLogError::CandumpLine) => {
                Err(String::from("it is neither a frame, as 201#1122, nor a line of `candump -L`"))
            }
            Err(error) => Err(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_frames_and_lines_of_logs() {
        let frame = "201#1122".parse().unwrap();
        let alone = LogLine { time_s: None, interface: None, frame };
        assert_eq!(LogLine::parse(" 201#1122 "), Ok(alone));
        let logged = LogLine { time_s: Some(1436509052.249713), interface: Some(String::from("vcan0")), frame };
        assert_eq!(LogLine::parse("(1436509052.249713) vcan0 201#1122"), Ok(logged.clone()));
        assert_eq!(LogLine::parse("(1436509052.249713) vcan0 201#1122 R"), Ok(logged));
    }

    #[test]
    fn says_what_is_wrong() {
        let said = |line| LogLine::parse(line).unwrap_err();
        insta::assert_snapshot!(said("  vcan0  201   [2]  11 22"), @"it is neither a frame, as 201#1122, nor a line of `candump -L`");
        insta::assert_snapshot!(said("(now) vcan0 201#1122"), @r#""(now)" is not a time in brackets such as (12.345678)"#);
        insta::assert_snapshot!(said("201#112"), @"the data must be pairs of hexadecimal digits");
    }
}
