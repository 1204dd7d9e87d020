//! Frames as text, in the form of can-utils: `123#1122`, `123#R2`, `123##1AABB`.

use core::fmt;
use core::str::FromStr;

use crate::frame::{Frame, FrameError, FrameFormat, Id};

/// Error of a text that is not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameTextError {
    /// There is no `#`.
    NoHash,
    /// The identifier is not of 3 or 8 hexadecimal digits.
    Id,
    /// `#R` is not followed by a length from 0 to 8.
    RemoteLength,
    /// `##` is not followed by a hexadecimal digit for the flags.
    Flags,
    /// The data are not pairs of hexadecimal digits.
    Data,
    /// `_` is not followed by a raw DLC, a hexadecimal digit from 9 to F, or not behind a frame of 8 bytes.
    RawDlc,
    /// The text describes a frame that CAN does not allow.
    Frame(FrameError),
}

impl fmt::Display for FrameTextError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FrameTextError::NoHash => f.write_str("there is no `#` between identifier and data, as in 123#1122"),
            FrameTextError::Id => f.write_str("the identifier must have 3 hexadecimal digits (11 bits) or 8 (29 bits)"),
            FrameTextError::RemoteLength => f.write_str("after `#R` of a remote frame, expected its length, 0 to 8"),
            FrameTextError::Flags => f.write_str(
                "after `##` of a CAN FD frame, expected a hexadecimal digit for its flags, as in 123##1AABB",
            ),
            FrameTextError::Data => f.write_str("the data must be pairs of hexadecimal digits"),
            FrameTextError::RawDlc => f.write_str(
                "after `_` of a classical frame of 8 bytes, expected its DLC, a hexadecimal digit from 9 to F",
            ),
            FrameTextError::Frame(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for FrameTextError {}

/// Reads the form of `cansend`; the inverse of [`Frame`]'s `Display`. A classical frame of 8 bytes may end with its raw
/// DLC, `_9` to `_F`, as `candump -8` writes it; it means 8 bytes as well (ISO 11898-1), and is not kept.
impl FromStr for Frame {
    type Err = FrameTextError;

    fn from_str(text: &str) -> Result<Frame, FrameTextError> {
        let (id, rest) = text.split_once('#').ok_or(FrameTextError::NoHash)?;
        let id = identifier(id).ok_or(FrameTextError::Id)?;
        let (format, digits) = if let Some(rest) = rest.strip_prefix('#') {
            // Bit 0 is BRS and bit 1 ESI, as in linux/can.h. Others, like CANFD_FDF (4), say nothing that `##`
            // doesn't, and are ignored.
            let flags = rest.chars().next().and_then(|c| c.to_digit(16)).ok_or(FrameTextError::Flags)?;
            let bit_rate_switch = flags & 1 != 0;
            let error_state_indicator = flags & 2 != 0;
            (FrameFormat::Fd { bit_rate_switch, error_state_indicator }, &rest[1..])
        } else {
            return classical(id, rest);
        };
        with_data(id, format, digits)
    }
}

/// A classical data or remote frame, from what follows `#`.
fn classical(id: Id, text: &str) -> Result<Frame, FrameTextError> {
    let (text, raw_dlc) = text.split_once('_').map_or((text, None), |(text, raw_dlc)| (text, Some(raw_dlc)));
    let frame = if let Some(length) = text.strip_prefix(['R', 'r']) {
        // `#R` alone asks for no data, as in can-utils.
        let length = match length.as_bytes() {
            [] => 0,
            // A number is not parsed, since that would also take a sign.
            [digit @ b'0'..=b'8'] => usize::from(digit - b'0'),
            _ => return Err(FrameTextError::RemoteLength),
        };
        Frame::new(id, FrameFormat::Remote, &[0; 8][..length]).map_err(FrameTextError::Frame)?
    } else {
        with_data(id, FrameFormat::Classic, text)?
    };
    // In a classical frame the DLC 9 to 15 mean 8 bytes as well, so only a frame of 8 bytes can have one of them.
    match raw_dlc.map(str::as_bytes) {
        None | Some([b'9' | b'A'..=b'F' | b'a'..=b'f']) if raw_dlc.is_none() || frame.len() == 8 => Ok(frame),
        _ => Err(FrameTextError::RawDlc),
    }
}

fn identifier(text: &str) -> Option<Id> {
    // The digits are checked first, because `from_str_radix` would also take a sign.
    let number = text.bytes().all(|c| c.is_ascii_hexdigit()).then(|| u32::from_str_radix(text, 16).ok())??;
    match text.len() {
        3 => u16::try_from(number).ok().map(Id::Standard),
        8 => Some(Id::Extended(number)),
        _ => None,
    }
}

/// The data frame with the data in `text`: pairs of digits, which dots may separate.
fn with_data(id: Id, format: FrameFormat, text: &str) -> Result<Frame, FrameTextError> {
    let mut bytes = [0; 64];
    let mut length = 0;
    let mut digits = text.chars().filter(|c| *c != '.').map(|c| c.to_digit(16));
    while let Some(high) = digits.next() {
        let pair = high.zip(digits.next().flatten()).zip(bytes.get_mut(length));
        let ((high, low), byte) = pair.ok_or(FrameTextError::Data)?;
        *byte = (high << 4 | low) as u8;
        length += 1;
    }
    Frame::new(id, format, &bytes[..length]).map_err(FrameTextError::Frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn reads_what_it_writes() {
        for text in ["123#", "123#1122", "00000123#R8", "123##1AABB", "7FF##3", "1FFFFFFF#0102030405060708"] {
            assert_eq!(text.parse::<Frame>().map(|frame| frame.to_string()), Ok(text.to_string()));
        }
        assert_eq!("123#11.22".parse::<Frame>(), "123#1122".parse());
        assert_eq!("123#r".parse::<Frame>(), "123#R0".parse());
        for (text, same) in [("123#1122334455667788_9", "123#1122334455667788"), ("00000123#R8_f", "00000123#R8")] {
            assert_eq!(text.parse::<Frame>(), same.parse(), "{text}");
        }
    }

    #[test]
    fn says_what_is_wrong_with_a_text() {
        let long = std::format!("123##0{}", "00".repeat(65));
        let cases = [
            ("123", FrameTextError::NoHash),
            ("12#00", FrameTextError::Id),
            ("+12#00", FrameTextError::Id),
            ("123#R9", FrameTextError::RemoteLength),
            ("123#R+3", FrameTextError::RemoteLength),
            ("123##", FrameTextError::Flags),
            ("123#0", FrameTextError::Data),
            ("123#0é", FrameTextError::Data),
            ("123#1122334455667788_8", FrameTextError::RawDlc),
            ("123#1122334455667788_", FrameTextError::RawDlc),
            ("123#11_9", FrameTextError::RawDlc),
            ("123#R2_9", FrameTextError::RawDlc),
            ("123##01122334455667788_9", FrameTextError::Data),
            (&long, FrameTextError::Data),
            ("800#00", FrameTextError::Frame(FrameError::Id(Id::Standard(0x800)))),
        ];
        for (text, error) in cases {
            assert_eq!(text.parse::<Frame>(), Err(error), "{text}");
        }
        let length = FrameError::Length { got: 9, format: FrameFormat::Classic };
        assert_eq!("123#000102030405060708".parse::<Frame>(), Err(FrameTextError::Frame(length)));
    }
}
