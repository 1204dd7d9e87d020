//! ASC logs of Vector's CANalyzer and CANoe.
//!
//! The head states a date, the base of the numbers and whether times are absolute or relative to the line before;
//! then each line is one frame. `docs/recording.md` says which lines are read.

use std::io::{self, Write};

use resonarm_protocol::{Frame, FrameFormat, Id};

use super::date;
use super::error::CanLogError;
use super::vector::{BRS, EDL, ESI, LONGEST_CLASSIC, dlc, flags, format, length, since};
use super::{LogWriter, LoggedFrame};
use crate::recording::Direction;

/// Writes frames of channel 1, with hexadecimal numbers and times relative to the start of the log.
pub(super) struct Writer<W> {
    out: W,
    /// Start of the log, ms of the UNIX epoch.
    start_ms: u64,
    has_head: bool,
}

impl<W: Write> Writer<W> {
    pub fn new(out: W, start_ns: u64) -> Writer<W> {
        Writer { out, start_ms: start_ns / 1_000_000, has_head: false }
    }

    /// Writes the head, once.
    fn begin(&mut self) -> io::Result<()> {
        if core::mem::replace(&mut self.has_head, true) {
            return Ok(());
        }
        let date = date::asc(date::utc(self.start_ms));
        // The first line of a log states its date, and the trigger block repeats it: readers take it from either.
        write!(self.out, "date {date}\nbase hex  timestamps absolute\ninternal events logged\n")?;
        writeln!(self.out, "Begin Triggerblock {date}\n   0.000000 Start of measurement")
    }
}

impl<W: Write> LogWriter for Writer<W> {
    fn write(&mut self, logged: &LoggedFrame) -> io::Result<()> {
        self.begin()?;
        // Times of this format have microseconds; further digits are cut off.
        let microseconds = since(logged, self.start_ms)? / 1000;
        let direction = if logged.direction == Some(Direction::Sent) { "Tx" } else { "Rx" };
        let frame = &logged.frame;
        let id = match frame.id() {
            Id::Standard(id) => format!("{id:X}"),
            Id::Extended(id) => format!("{id:X}x"),
        };
        let data: String = frame.data().iter().map(|byte| format!(" {byte:02X}")).collect();
        let dlc = dlc(frame);
        let length = frame.len();
        write!(self.out, "{:4}.{:06} ", microseconds / 1_000_000, microseconds % 1_000_000)?;
        match frame.format() {
            FrameFormat::Classic => writeln!(self.out, "1  {id:<15} {direction:<4} d {dlc:x}{data}"),
            FrameFormat::Remote => writeln!(self.out, "1  {id:<15} {direction:<4} r {dlc:x}"),
            FrameFormat::Fd { bit_rate_switch, error_state_indicator } => {
                let brs = u32::from(bit_rate_switch);
                let esi = u32::from(error_state_indicator);
                let flags = flags(frame.format());
                // After the data: duration, bits, flags, CRC and bit timings, of which only the flags are known.
                writeln!(
                    self.out,
                    "CANFD   1 {direction:<4} {id:>9} {:32} {brs} {esi} {dlc:x} {length:>2}{data} \
                     0 0 {flags:X} 0 0 0 0 0",
                    ""
                )
            }
        }
    }

    fn finish(&mut self) -> io::Result<()> {
        self.begin()?;
        writeln!(self.out, "End TriggerBlock")?;
        self.out.flush()
    }
}

/// The settings from the head of a log, and the time reached so far.
pub(super) struct Reader {
    /// Start of the log, ns of the UNIX epoch; 0 without a date.
    start_ns: u64,
    radix: u32,
    /// Whether times are relative to the line before.
    is_relative: bool,
    /// Time reached so far, ns; negative before the start of the log.
    time_ns: i64,
    /// Whether a trigger block has begun that has not ended.
    is_in_block: bool,
}

impl Reader {
    pub fn new() -> Reader {
        // Until a head says otherwise numbers are hexadecimal and times absolute, as this program writes them.
        Reader { start_ns: 0, radix: 16, is_relative: false, time_ns: 0, is_in_block: false }
    }

    /// Returns the frame in a line; `None` for the head, comments and events of other kinds.
    pub fn line(&mut self, line: &str) -> Result<Option<LoggedFrame>, CanLogError> {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["date", ref date @ ..] => self.date(date).map(|()| None),
            [begin, block, ref date @ ..] if is_trigger_block(("begin", begin), block) => {
                self.is_in_block = true;
                // Without a date, the log begins at 0.
                if date.is_empty() { Ok(None) } else { self.date(date).map(|()| None) }
            }
            [end, block, ..] if is_trigger_block(("end", end), block) => {
                self.is_in_block = false;
                Ok(None)
            }
            ["base", base, "timestamps", times, ..] => {
                self.radix = if base == "dec" { 10 } else { 16 };
                self.is_relative = times == "relative";
                Ok(None)
            }
            [time, ref rest @ ..] => match signed_nanoseconds(time) {
                Some(time_ns) => self.event(time_ns, rest),
                None => Ok(None),
            },
            [] => Ok(None),
        }
    }

    /// Works like [`Reader::line`], for a last line without an end: an event that is no frame may be the beginning of
    /// one.
    pub fn last_line(&mut self, line: &str) -> Result<Option<LoggedFrame>, CanLogError> {
        // Such as `0.5000` of `0.500000 1 201 Rx …`: it would pass for an event of another kind.
        let is_event = line.split_whitespace().next().is_some_and(|time| signed_nanoseconds(time).is_some());
        match self.line(line)? {
            None if is_event => Err(CanLogError::Truncated { inside: "inside this line" }),
            found => Ok(found),
        }
    }

    /// Rejects a log that is cut short, once there is no further line.
    pub fn end(&self) -> Result<(), CanLogError> {
        if self.is_in_block { Err(CanLogError::Truncated { inside: "inside a trigger block" }) } else { Ok(()) }
    }

    fn date(&mut self, words: &[&str]) -> Result<(), CanLogError> {
        let text = words.join(" ");
        let unix_ns = date::from_asc(&text).and_then(date::unix_ns);
        self.start_ns = unix_ns.ok_or(CanLogError::Date { got: text })?;
        Ok(())
    }

    /// Returns an event with its time.
    fn event(&mut self, time_ns: i64, words: &[&str]) -> Result<Option<LoggedFrame>, CanLogError> {
        // Every event counts, also those that are no frames: relative times are relative to the line before, whatever
        // it holds.
        let before_ns = if self.is_relative { self.time_ns } else { 0 };
        self.time_ns = before_ns.saturating_add(time_ns);
        let (channel, direction, frame) = match *words {
            [channel, id, direction @ ("Rx" | "Tx"), kind @ ("d" | "r"), ref rest @ ..] => {
                (channel, direction, self.classic(id, kind, rest)?)
            }
            ["CANFD", channel, direction @ ("Rx" | "Tx"), id, ref rest @ ..] if id != "ErrorFrame" => {
                (channel, direction, self.fd(id, rest)?)
            }
            // The head of a frame, and nothing else.
            [_, _, "Rx" | "Tx"] => return Err(CanLogError::AscLine),
            _ => return Ok(None),
        };
        let early = CanLogError::BeforeEpoch { time_ns: self.time_ns };
        Ok(Some(LoggedFrame {
            time_ns: self.start_ns.checked_add_signed(self.time_ns).ok_or(early)?,
            interface: Some(channel.to_owned()),
            direction: Some(if direction == "Tx" { Direction::Sent } else { Direction::Received }),
            frame,
        }))
    }

    /// Parses `ID Rx d DLC BYTES …` and `ID Rx r [DLC …]`.
    fn classic(&self, id: &str, kind: &str, words: &[&str]) -> Result<Frame, CanLogError> {
        let length = words.first().map(|dlc| self.number(dlc)).transpose();
        if kind == "r" {
            // Old logs state no length.
            let length = length.ok().flatten().unwrap_or(0).min(LONGEST_CLASSIC as u32) as usize;
            return Ok(Frame::new(self.id(id)?, FrameFormat::Remote, &[0; 8][..length])?);
        }
        let length = length?.ok_or(CanLogError::AscLine)?.min(LONGEST_CLASSIC as u32) as usize;
        let data = self.data(words.get(1..=length).ok_or(CanLogError::AscLine)?)?;
        Ok(Frame::classic(self.id(id)?, &data)?)
    }

    /// Parses `ID [NAME] BRS ESI DLC LENGTH BYTES … [DURATION BITS FLAGS …]`. Classical frames on a CAN FD channel have
    /// this form, too; the flags show it. A remote frame has no bytes, and its DLC says how many it requests.
    fn fd(&self, id: &str, words: &[&str]) -> Result<Frame, CanLogError> {
        let is_bit = |word: Option<&&str>| matches!(word, Some(&("0" | "1")));
        // The symbolic name is optional. Without it the two bits BRS and ESI follow the identifier at once.
        let words = if is_bit(words.first()) && is_bit(words.get(1)) { words } else { words.get(1..).unwrap_or(&[]) };
        let [brs, esi, dlc, bytes, rest @ ..] = words else { return Err(CanLogError::AscLine) };
        let dlc = usize::from_str_radix(dlc, 16).ok().and_then(length).ok_or(CanLogError::AscLine)?;
        let bytes = bytes.parse::<usize>().map_err(|_| CanLogError::AscLine)?;
        let mut data = self.data(rest.get(..bytes).ok_or(CanLogError::AscLine)?)?;
        // The flags stand behind the duration and the number of bits. A line that ends before them counts as a CAN FD
        // frame.
        let flags = rest.get(bytes + 2).and_then(|flags| u32::from_str_radix(flags, 16).ok()).unwrap_or(EDL);
        let set = |flag: u32, bit: &str| if bit == "1" { flag } else { 0 };
        let format = match format(flags | set(BRS, brs) | set(ESI, esi)) {
            // No classical frame has so many bytes: whoever wrote the flags left them out.
            FrameFormat::Classic if bytes > LONGEST_CLASSIC => format(EDL | set(BRS, brs) | set(ESI, esi)),
            FrameFormat::Remote => {
                data.resize(dlc.min(LONGEST_CLASSIC), 0);
                FrameFormat::Remote
            }
            format => format,
        };
        Ok(Frame::new(self.id(id)?, format, &data)?)
    }

    fn id(&self, text: &str) -> Result<Id, CanLogError> {
        match text.strip_suffix(['x', 'X']) {
            // In logs with `base dec` the x stands behind a decimal number.
            Some(digits) => self.number(digits).map(Id::Extended),
            None => u16::try_from(self.number(text)?).map(Id::Standard).map_err(|_| CanLogError::AscLine),
        }
    }

    fn number(&self, digits: &str) -> Result<u32, CanLogError> {
        u32::from_str_radix(digits, self.radix).map_err(|_| CanLogError::AscLine)
    }

    fn data(&self, words: &[&str]) -> Result<Vec<u8>, CanLogError> {
        words.iter().map(|word| u8::from_str_radix(word, self.radix).map_err(|_| CanLogError::AscLine)).collect()
    }
}

/// Works like [`date::nanoseconds`], with a minus before times that are earlier than the start of the log.
fn signed_nanoseconds(text: &str) -> Option<i64> {
    let (text, sign) = text.strip_prefix('-').map_or((text, 1), |text| (text, -1));
    Some(sign * i64::try_from(date::nanoseconds(text)?).ok()?)
}

/// Says whether words begin, or end, a trigger block: the first is the wanted one.
fn is_trigger_block((wanted, first): (&str, &str), block: &str) -> bool {
    first.eq_ignore_ascii_case(wanted) && block.eq_ignore_ascii_case("triggerblock")
}
