//! A line of a log: a frame alone, or as `candump -L` writes it.

use resonarm::can_log::{self, CanLogError, LoggedFrame};
use resonarm::protocol::{Frame, FrameTextError};

/// A frame and its time and interface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LogLine {
    /// Its time, s, if the log has it.
    pub time_s: Option<f64>,
    /// Its interface, if the log has it.
    pub interface: Option<String>,
    pub frame: Frame,
}

impl LogLine {
    /// Reads `FRAME` or `(TIME) INTERFACE FRAME [DIRECTION]`.
    ///
    /// # Errors A description of the invalid text.
    pub fn parse(line: &str) -> Result<LogLine, String> {
        let line = line.trim();
        if !line.contains(char::is_whitespace) {
            let frame = line.parse().map_err(|error: FrameTextError| error.to_string())?;
            return Ok(LogLine { time_s: None, interface: None, frame });
        }
        match can_log::parse_line(line) {
            Ok(LoggedFrame { time_ns, interface, frame, .. }) => {
                // Seconds and remainder separately: a present-day count of nanoseconds has more digits than this type.
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
