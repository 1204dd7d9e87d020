//! A CAN frame: identifier, format, payload.

use core::fmt;

/// A CAN identifier (ISO 11898-1): 11 bits (base format) or 29 bits (extended format).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Id {
    /// Standard identifier of 11 bits, `0..=0x7FF`.
    Standard(u16),
    /// Extended identifier of 29 bits, `0..=0x1FFF_FFFF`.
    Extended(u32),
}

impl Id {
    /// The identifier as a number, whatever its format.
    pub const fn raw(self) -> u32 {
        match self {
            Id::Standard(id) => id as u32,
            Id::Extended(id) => id,
        }
    }

    /// Whether the number fits its format.
    pub const fn is_valid(self) -> bool {
        match self {
            Id::Standard(id) => id <= 0x7FF,
            Id::Extended(id) => id <= 0x1FFF_FFFF,
        }
    }
}

impl fmt::Display for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Id::Standard(id) => write!(f, "{id:03X}"),
            Id::Extended(id) => write!(f, "{id:08X}"),
        }
    }
}

/// The format of a frame (ISO 11898-1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameFormat {
    /// Classical CAN data frame, 0 to 8 bytes.
    Classic,
    /// Classical CAN remote frame: a length and no data.
    Remote,
    /// CAN FD data frame, 0 to 8, 12, 16, 20, 24, 32, 48 or 64 bytes.
    Fd {
        /// BRS: the data phase runs at the second bit rate.
        bit_rate_switch: bool,
        /// ESI: the sender is error passive.
        error_state_indicator: bool,
    },
}

/// CAN frame, classical or FD. Every value of this type is valid: the constructors check.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    id: Id,
    format: FrameFormat,
    len: u8,
    data: [u8; 64],
}

/// Error of a frame that can't exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The identifier is too large for its format.
    Id(Id),
    /// The format does not have this length.
    Length {
        /// Length of the data given, bytes.
        got: usize,
        /// Format that the frame should have.
        format: FrameFormat,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FrameError::Id(Id::Standard(id)) => {
                write!(f, "identifier {id:#X} does not fit 11 bits (at most 0x7FF)")
            }
            FrameError::Id(Id::Extended(id)) => {
                write!(f, "identifier {id:#X} does not fit 29 bits (at most 0x1FFFFFFF)")
            }
            FrameError::Length { got, format: FrameFormat::Fd { .. } } => {
                write!(f, "a CAN FD frame can't hold {got} bytes: 0 to 8, 12, 16, 20, 24, 32, 48 or 64")
            }
            FrameError::Length { got, .. } => write!(f, "a classical CAN frame can't hold {got} bytes: 0 to 8"),
        }
    }
}

impl core::error::Error for FrameError {}

impl Frame {
    /// A frame of any format. For [`FrameFormat::Remote`] only the length of `data` counts.
    ///
    /// # Errors
    /// [`FrameError`] if the identifier or the length does not fit the format.
    pub fn new(id: Id, format: FrameFormat, data: &[u8]) -> Result<Frame, FrameError> {
        if !id.is_valid() {
            return Err(FrameError::Id(id));
        }
        let fits = match format {
            FrameFormat::Classic | FrameFormat::Remote => data.len() <= 8,
            FrameFormat::Fd { .. } => {
                matches!(data.len(), 0..=8 | 12 | 16 | 20 | 24 | 32 | 48 | 64)
            }
        };
        if !fits {
            return Err(FrameError::Length { got: data.len(), format });
        }
        let mut bytes = [0; 64];
        // The buffer of a remote frame stays zero, since frames are compared and hashed with the whole of it.
        if format != FrameFormat::Remote {
            bytes[..data.len()].copy_from_slice(data);
        }
        Ok(Frame { id, format, len: data.len() as u8, data: bytes })
    }

    /// A classical data frame.
    ///
    /// # Errors
    /// As [`Frame::new`].
    pub fn classic(id: Id, data: &[u8]) -> Result<Frame, FrameError> {
        Frame::new(id, FrameFormat::Classic, data)
    }

    /// A frame of this protocol, whose identifiers and lengths are valid by construction: of `length` bytes of `data`,
    /// which is zero beyond them.
    pub(crate) fn of_message(id: u16, format: FrameFormat, length: usize, data: [u8; 64]) -> Frame {
        debug_assert!(data[length..].iter().all(|byte| *byte == 0));
        Frame { id: Id::Standard(id), format, len: length as u8, data }
    }

    /// All bytes of the buffer: those beyond the length stay zero.
    pub(crate) const fn bytes_mut(&mut self) -> &mut [u8; 64] {
        &mut self.data
    }

    /// Returns the identifier of the frame.
    pub const fn id(&self) -> Id {
        self.id
    }

    /// Returns the format of the frame.
    pub const fn format(&self) -> FrameFormat {
        self.format
    }

    /// The payload, in bytes; empty for a remote frame.
    #[inline]
    pub fn data(&self) -> &[u8] {
        match self.format {
            FrameFormat::Remote => &[],
            _ => &self.data[..self.len as usize],
        }
    }

    /// The length the frame states, in bytes; of a remote frame the length requested.
    pub const fn len(&self) -> usize {
        self.len as usize
    }

    /// Whether the frame states a length of zero.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Writes the frame in the form of `candump` and `cansend`: `123#1122`, `123#R2`, `123##1AABB`.
impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.id)?;
        match self.format {
            FrameFormat::Classic => write!(f, "#")?,
            FrameFormat::Remote => write!(f, "#R{}", self.len)?,
            FrameFormat::Fd { bit_rate_switch, error_state_indicator } => {
                // The flags of linux/can.h: CANFD_BRS is 1, CANFD_ESI is 2.
                let flags = u8::from(bit_rate_switch) | u8::from(error_state_indicator) << 1;
                write!(f, "##{flags:X}")?;
            }
        }
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn writes_frames_as_candump_does() {
        let fd = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
        let cases = [
            (Frame::classic(Id::Standard(0x123), &[0x11, 0x22]), "123#1122"),
            (Frame::new(Id::Standard(0x123), FrameFormat::Remote, &[0; 2]), "123#R2"),
            (Frame::new(Id::Extended(0x123), fd, &[0xAA; 12]), "00000123##1AAAAAAAAAAAAAAAAAAAAAAAA"),
        ];
        for (frame, text) in cases {
            assert_eq!(frame.map(|frame| frame.to_string()), Ok(text.to_string()));
        }
    }

    #[test]
    fn refuses_what_the_format_cannot_hold() {
        assert_eq!(Frame::classic(Id::Standard(0x800), &[]), Err(FrameError::Id(Id::Standard(0x800))));
        let length = FrameError::Length { got: 9, format: FrameFormat::Classic };
        assert_eq!(Frame::classic(Id::Standard(1), &[0; 9]), Err(length));
        let fd = FrameFormat::Fd { bit_rate_switch: false, error_state_indicator: false };
        assert!(Frame::new(Id::Standard(1), fd, &[0; 9]).is_err());
        assert!(Frame::new(Id::Standard(1), fd, &[0; 64]).is_ok());
    }
}
