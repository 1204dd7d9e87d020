//! Lines of `candump` of can-utils: of its log format, `-L`, and of its view on a terminal.

use core::fmt;
use std::io::{self, Write};

use resonarm_protocol::{Frame, FrameFormat, FrameTextError, Id};

use super::date;
use super::error::CanLogError;
use super::{LogWriter, LoggedFrame};
use crate::recording::Direction;

/// Marks the identifiers of error frames, which report the state of the bus and were never on it (linux/can.h).
const ERROR_FRAME: u32 = 0x2000_0000;

/// Meanings of the bits of an error frame's identifier (linux/can/error.h).
const ERROR_CLASSES: [(u32, &str); 10] = [
    (0x001, "transmission timeout"),
    (0x002, "lost arbitration"),
    (0x004, "controller problem"),
    (0x008, "protocol violation"),
    (0x010, "transceiver problem"),
    (0x020, "no acknowledgement"),
    (0x040, "bus off"),
    (0x080, "bus error"),
    (0x100, "controller restarted"),
    (0x200, "error counters"),
];

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
        let second = logged.time_ns / 1_000_000_000;
        let microsecond = logged.time_ns % 1_000_000_000 / 1000;
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

/// A line of `candump`.
#[derive(Clone, Debug, PartialEq)]
pub struct CandumpLine {
    /// Time at which it was logged, ns, if the line has a time stamp.
    pub time_ns: Option<u64>,
    /// The interface, if the line names one.
    pub interface: Option<String>,
    /// Whether the logging node received or sent it, if the line says so.
    pub direction: Option<Direction>,
    /// The frame or error frame.
    pub content: CandumpContent,
}

/// Content of a line of `candump`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CandumpContent {
    /// A data or remote frame that was on the bus.
    Frame(Frame),
    /// A report of the CAN controller, which was never on the bus.
    ErrorFrame(ErrorFrame),
}

/// A report of the CAN controller about the state of the bus, which `Display` describes in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorFrame {
    /// The identifier without the mark of error frames.
    pub classes: u32,
}

impl fmt::Display for ErrorFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        let mut rest = self.classes;
        for (class, name) in ERROR_CLASSES {
            // Bits that have no name here remain in `rest`, and are reported as a number.
            if rest & class != 0 {
                write!(f, "{separator}{name}")?;
                separator = ", ";
                rest &= !class;
            }
        }
        if rest != 0 || separator.is_empty() { write!(f, "{separator}class {rest:#x}") } else { Ok(()) }
    }
}

/// Reads a line of `candump`, in one of these forms:
///
/// - `(TIME) INTERFACE FRAME [R|T]`, as `candump -L` writes it, the time in s with any number of digits;
/// - `[(TIME)] INTERFACE [RX|TX FLAGS] IDENTIFIER [LENGTH] BYTES`, its view on a terminal, with the times of `-t`, the
///   directions of `-x` and the characters of `-a` if they are there; a length of two digits is that of a CAN FD frame,
///   whose bit rate switch is known by `-x` alone;
/// - `FRAME` alone, as `cansend` takes it.
///
/// # Errors
/// The first fault of the line.
pub fn parse_line(line: &str) -> Result<CandumpLine, CanLogError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let (time_ns, words) = time(&words)?;
    let log = |interface: &str, frame: &str, direction| {
        // Before the frame is parsed: its identifier has more than 29 bits, and would be rejected.
        let content = match error_frame(frame.split_once('#').map_or("", |(id, _)| id)) {
            Some(error) => CandumpContent::ErrorFrame(error),
            None => CandumpContent::Frame(frame.parse().map_err(CanLogError::FrameText)?),
        };
        Ok(CandumpLine { time_ns, interface: Some(interface.to_owned()), direction, content })
    };
    match *words {
        [frame] if time_ns.is_none() => log("", frame, None).map(|line| CandumpLine { interface: None, ..line }),
        [interface, frame] if frame.contains('#') => log(interface, frame, None),
        [interface, frame, "R"] if frame.contains('#') => log(interface, frame, Some(Direction::Received)),
        [interface, frame, "T"] if frame.contains('#') => log(interface, frame, Some(Direction::Sent)),
        [interface, direction @ ("RX" | "TX"), switch @ ("B" | "-"), indicator @ ("E" | "-"), ref frame @ ..] => {
            let direction = if direction == "TX" { Direction::Sent } else { Direction::Received };
            let content = view(frame, switch == "B", indicator == "E")?;
            Ok(CandumpLine { time_ns, interface: Some(interface.to_owned()), direction: Some(direction), content })
        }
        // The view of `candump` without -x: it has no direction, and no flags of a CAN FD frame.
        [interface, ref frame @ ..] => {
            let content = view(frame, false, false)?;
            Ok(CandumpLine { time_ns, interface: Some(interface.to_owned()), direction: None, content })
        }
        [] => Err(CanLogError::CandumpLine),
    }
}

/// Returns the time at the beginning of a line, ns, and the words behind it: `(12.345678)`, or `(2015-07-10
/// 08:17:32.249713)` of `candump -t A`.
fn time<'a, 'b>(words: &'a [&'b str]) -> Result<(Option<u64>, &'a [&'b str]), CanLogError> {
    let failed = |got: &str| CanLogError::Time { got: got.to_owned() };
    match words {
        [day, time, rest @ ..] if day.starts_with('(') && !day.ends_with(')') && time.ends_with(')') => {
            let got = format!("{day} {time}");
            let date = got.strip_prefix('(').and_then(|date| date.strip_suffix(')'));
            let time_ns = date.and_then(date::unix_ns_from_iso).ok_or_else(|| failed(&got))?;
            Ok((Some(time_ns), rest))
        }
        [time, rest @ ..] if time.starts_with('(') => {
            let in_brackets = time.strip_prefix('(').and_then(|time| time.strip_suffix(')'));
            let time_ns = in_brackets.and_then(date::nanoseconds).ok_or_else(|| failed(time))?;
            Ok((Some(time_ns), rest))
        }
        words => Ok((None, words)),
    }
}

/// Returns the error frame if an identifier has the mark of error frames.
fn error_frame(id: &str) -> Option<ErrorFrame> {
    let id = u32::from_str_radix(id, 16).ok().filter(|_| id.len() == 8)?;
    (id & ERROR_FRAME != 0).then_some(ErrorFrame { classes: id & !ERROR_FRAME })
}

/// Parses `123 [2] 11 22`, `123 [02] 11 22` of CAN FD, `123 {9} 11 22 …` with a raw DLC, `123 [2] remote request`.
fn view(words: &[&str], bit_rate_switch: bool, error_state_indicator: bool) -> Result<CandumpContent, CanLogError> {
    let [id, length, data @ ..] = words else { return Err(CanLogError::CandumpLine) };
    if let Some(error) = error_frame(id) {
        return Ok(CandumpContent::ErrorFrame(error));
    }
    let frame = || -> Option<Result<Frame, FrameTextError>> {
        // `from_str_radix` also takes a sign, which no identifier has.
        let number = u32::from_str_radix(id, 16).ok().filter(|_| id.bytes().all(|digit| digit.is_ascii_hexdigit()))?;
        let id = match id.len() {
            3 => Id::Standard(number as u16),
            8 => Id::Extended(number),
            _ => return Some(Err(FrameTextError::Id)),
        };
        let in_brackets = |open, close| length.strip_prefix(open).and_then(|text| text.strip_suffix(close));
        let (digits, length): (usize, usize) = match (in_brackets('[', ']'), in_brackets('{', '}')) {
            (Some(digits), _) => (digits.len(), digits.parse().ok()?),
            // A raw DLC from 9 on means 8 bytes.
            (None, Some(dlc)) => (1, usize::from_str_radix(dlc, 16).ok().filter(|dlc| *dlc < 16)?.min(8)),
            (None, None) => return None,
        };
        let is_fd = digits == 2;
        if !is_fd && *data == ["remote", "request"] {
            return Some(Frame::new(id, FrameFormat::Remote, [0; 8].get(..length)?).map_err(FrameTextError::Frame));
        }
        let bytes: Option<Vec<u8>> = data.get(..length)?.iter().map(|byte| hexadecimal_byte(byte)).collect();
        // Behind the bytes stand at most their characters.
        if data.get(length).is_some_and(|characters| !characters.starts_with('\'')) {
            return None;
        }
        let format =
            if is_fd { FrameFormat::Fd { bit_rate_switch, error_state_indicator } } else { FrameFormat::Classic };
        Some(Frame::new(id, format, &bytes?).map_err(FrameTextError::Frame))
    };
    let frame = frame().ok_or(CanLogError::CandumpLine)?;
    frame.map(CandumpContent::Frame).map_err(CanLogError::FrameText)
}

fn hexadecimal_byte(digits: &str) -> Option<u8> {
    let is_byte = digits.len() == 2 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    is_byte.then(|| u8::from_str_radix(digits, 16).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the frame of a line as text, or a description of its other content.
    fn frame(line: &str) -> String {
        match parse_line(line) {
            Ok(CandumpLine { content: CandumpContent::Frame(frame), .. }) => frame.to_string(),
            Ok(CandumpLine { content: CandumpContent::ErrorFrame(error), .. }) => format!("error: {error}"),
            Err(error) => error.to_string(),
        }
    }

    /// Lines as lib.c of can-utils prints them, without options and with -x, -a, -8 and -t.
    #[test]
    fn the_view_of_a_terminal_is_read() {
        for (line, expected) in [
            ("  can0  123   [2]  11 22", "123#1122"),
            ("  vcan0  1F334455   [8]  11 22 33 44 55 66 77 88   '.\"3D Uf '", "1F334455#1122334455667788"),
            ("  can0  123   [0] ", "123#"),
            ("  can0  123   [3]  remote request", "123#R3"),
            ("  can0  123  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B", "123##0000102030405060708090A0B"),
            ("  can0  TX B E  123  [02]  AA BB", "123##3AABB"),
            ("  can0  RX - -  123   {9}  11 22 33 44 55 66 77 88", "123#1122334455667788"),
            (" (1436509052.249713)  can0  123   [1]  11", "123#11"),
            ("  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME", "error: controller problem"),
        ] {
            assert_eq!(frame(line), expected, "{line}");
        }
        let wrong = CanLogError::CandumpLine.to_string();
        for line in ["", "can0 123 [2] 11", "can0 123 [2] 11 2", "can0 123 [2] 11 22 33", "can0 xyz [0]", "can0 123 [9"]
        {
            assert_eq!(frame(line), wrong, "{line}");
        }
        let times = |line: &str| parse_line(line).map(|line| line.time_ns).ok().flatten();
        assert_eq!(times("(2015-07-10 06:17:32.249713) can0 123 [1] 11"), Some(1_436_509_052_249_713_000));
        assert_eq!((times("(000.000123) can0 123 [0]"), times("can0 123 [0]")), (Some(123_000), None));
        let directions = ["can0 TX - - 123 [0]", "can0 RX - - 123 [0]", "can0 123 [0]"].map(|line| {
            let line = parse_line(line).unwrap();
            (line.direction, line.interface.unwrap())
        });
        let expected = [Some(Direction::Sent), Some(Direction::Received), None];
        assert_eq!(directions, expected.map(|direction| (direction, "can0".to_string())));
    }

    #[test]
    fn error_frames_say_what_the_controller_reports() {
        assert_eq!(
            frame("(1.0) can0 200000A8#0000000000000000"),
            "error: protocol violation, no acknowledgement, bus error"
        );
        assert_eq!(frame("20000000#"), "error: class 0x0");
        assert_eq!(frame("(1.0) can0 20000801#00"), "error: transmission timeout, class 0x800");
    }
}
