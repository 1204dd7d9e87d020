//! Lines of a log: a frame alone, or a line of `candump`.

use resonarm::can_log::{self, CanLogError, CandumpContent, CandumpLine, ErrorFrame};
use resonarm::protocol::Frame;

/// Content of a line of a log.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum LogEntry {
    Frame(LogLine),
    /// A report of the CAN controller.
    ErrorFrame {
        /// Its time, s, if the log has it.
        time_s: Option<f64>,
        /// Its interface, if the log has it.
        interface: Option<String>,
        error: ErrorFrame,
    },
}

/// A frame and its time and interface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LogLine {
    /// Its time, s, if the log has it.
    pub time_s: Option<f64>,
    /// Its interface, if the log has it.
    pub interface: Option<String>,
    pub frame: Frame,
}

impl LogEntry {
    /// Reads `FRAME`, `(TIME) INTERFACE FRAME [DIRECTION]`, or a line of the view of `candump` on a terminal.
    ///
    /// # Errors
    /// A description of the invalid text.
    pub fn parse(line: &str) -> Result<LogEntry, String> {
        let CandumpLine { time_ns, interface, content, .. } =
            can_log::parse_line(line).map_err(|error| match error {
                CanLogError::CandumpLine => {
                    String::from("it is neither a frame, as 201#1122, nor a line of `candump` or `candump -L`")
                }
                error => error.to_string(),
            })?;
        // Seconds and remainder separately: a present-day count of nanoseconds has more digits than this type.
        let seconds = |time_ns: u64| format!("{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000).parse().ok();
        let time_s = time_ns.and_then(seconds);
        Ok(match content {
            CandumpContent::Frame(frame) => LogEntry::Frame(LogLine { time_s, interface, frame }),
            CandumpContent::ErrorFrame(error) => LogEntry::ErrorFrame { time_s, interface, error },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_frames_and_lines_of_logs() {
        let frame = "201#1122".parse().unwrap();
        let alone = LogLine { time_s: None, interface: None, frame };
        assert_eq!(LogEntry::parse(" 201#1122 "), Ok(LogEntry::Frame(alone)));
        let logged = LogLine { time_s: Some(1436509052.249713), interface: Some(String::from("vcan0")), frame };
        for line in [
            "(1436509052.249713) vcan0 201#1122",
            "(1436509052.249713) vcan0 201#1122 R",
            " (1436509052.249713)  vcan0  201   [2]  11 22",
        ] {
            assert_eq!(LogEntry::parse(line), Ok(LogEntry::Frame(logged.clone())), "{line}");
        }
        let view = LogLine { time_s: None, ..logged };
        assert_eq!(LogEntry::parse("  vcan0  201   [2]  11 22"), Ok(LogEntry::Frame(view)));
        let error = ErrorFrame { classes: 0x4 };
        let expected = LogEntry::ErrorFrame { time_s: Some(0.5), interface: Some(String::from("can0")), error };
        assert_eq!(LogEntry::parse("(0.5) can0 20000004#0004000000000000"), Ok(expected));
    }

    #[test]
    fn says_what_is_wrong() {
        let said = |line| LogEntry::parse(line).unwrap_err();
        insta::assert_snapshot!(said("  vcan0  201   [2]  11"), @"it is neither a frame, as 201#1122, nor a line of `candump` or `candump -L`");
        insta::assert_snapshot!(said("(now) vcan0 201#1122"), @r#""(now)" is not a time in brackets such as (12.345678)"#);
        insta::assert_snapshot!(said("201#112"), @"the data must be pairs of hexadecimal digits");
    }
}
