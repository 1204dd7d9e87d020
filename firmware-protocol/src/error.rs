//! Why a message can't be sent, and why a frame is refused.

use core::fmt;

use crate::e2e::{CounterFault, MAX_DELTA_COUNTER};
use crate::frame::FrameFormat;
use crate::message::MessageKind;

/// Why a message can't be sent. Nothing was sent and no counter moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EncodeError {
    /// A value is not a number or infinite.
    NotFinite {
        /// The message.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
        /// The value.
        got: f64,
    },
    /// A commanded value rounds beyond the range of its signal. Commands are never cut: the controller must know.
    OutOfRange {
        /// The message.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
        /// The value, in the unit of the signal.
        got: f64,
        /// The largest value that can be sent; the smallest is its negative.
        limit: f64,
    },
    /// An integer is not one that the signal can have.
    Invalid {
        /// The message.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
        /// The value.
        got: u32,
        /// The smallest value the signal can have.
        min: u32,
        /// The largest value the signal can have.
        max: u32,
    },
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EncodeError::NotFinite { kind, signal, got } => {
                write!(f, "{kind}: {signal} is {got}, which is not a finite number; nothing was sent")
            }
            EncodeError::OutOfRange { kind, signal, got, limit } => {
                write!(f, "{kind}: {signal} is {got}, beyond the range of ±{limit}; nothing was sent")
            }
            EncodeError::Invalid { kind, signal, got, min, max } => {
                write!(f, "{kind}: {signal} is {got}, not in {min} to {max}; nothing was sent")
            }
        }
    }
}

impl core::error::Error for EncodeError {}

/// Why a frame on one of the protocol's identifiers is refused. Its content must not be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecodeError {
    /// The frame is not a classical data frame.
    Format {
        /// The message of the identifier.
        kind: MessageKind,
        /// The format of the frame.
        got: FrameFormat,
    },
    /// The frame has the wrong length.
    Length {
        /// The message of the identifier.
        kind: MessageKind,
        /// Bytes in the frame.
        got: usize,
        /// Bytes in the message.
        expected: usize,
    },
    /// The CRC is wrong: the frame was damaged, or is another message under this identifier.
    Crc {
        /// The message of the identifier.
        kind: MessageKind,
        /// The CRC in the frame.
        got: u8,
        /// The CRC of its content.
        expected: u8,
    },
    /// The CRC is right and the counter is not.
    Counter {
        /// The message.
        kind: MessageKind,
        /// What is wrong with it.
        fault: CounterFault,
        /// The counter in the frame.
        got: u8,
        /// The counter of the frame before, if there was one.
        last: Option<u8>,
    },
    /// Bits that must be zero are not.
    Reserved {
        /// The message.
        kind: MessageKind,
        /// The byte of the frame, from 0.
        byte: usize,
        /// The bits that must be zero, as they came.
        got: u8,
    },
    /// A signal has the reserved count −32768, "not available".
    NotAvailable {
        /// The message.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
    },
    /// A signal has a value without a meaning.
    UnknownValue {
        /// The message.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
        /// The value.
        got: u16,
    },
}

impl DecodeError {
    /// The message under whose identifier the frame came.
    pub const fn kind(&self) -> MessageKind {
        match *self {
            DecodeError::Format { kind, .. }
            | DecodeError::Length { kind, .. }
            | DecodeError::Crc { kind, .. }
            | DecodeError::Counter { kind, .. }
            | DecodeError::Reserved { kind, .. }
            | DecodeError::NotAvailable { kind, .. }
            | DecodeError::UnknownValue { kind, .. } => kind,
        }
    }

    /// Whether the E2E protection refused the frame (CRC or counter), and not its form or content.
    pub const fn is_e2e(&self) -> bool {
        matches!(self, DecodeError::Crc { .. } | DecodeError::Counter { .. })
    }
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} refused: ", self.kind())?;
        match *self {
            DecodeError::Format { got: FrameFormat::Remote, .. } => f.write_str("a remote frame carries no data"),
            DecodeError::Format { .. } => f.write_str("a CAN FD frame on an identifier of the classic profile"),
            DecodeError::Length { got, expected, .. } => write!(f, "{got} bytes long instead of {expected}"),
            DecodeError::Crc { got, expected, .. } => {
                write!(f, "CRC {got:#04X} instead of {expected:#04X}")
            }
            DecodeError::Counter { fault, got, last, .. } => write_counter(f, fault, got, last),
            DecodeError::Reserved { byte, got, .. } => {
                write!(f, "byte {byte} has reserved bits set ({got:#04X})")
            }
            DecodeError::NotAvailable { signal, .. } => write!(f, "{signal} is not available"),
            DecodeError::UnknownValue { signal, got, .. } => write!(f, "{signal} has no value {got}"),
        }
    }
}

fn write_counter(f: &mut fmt::Formatter<'_>, fault: CounterFault, got: u8, last: Option<u8>) -> fmt::Result {
    match (fault, last) {
        (CounterFault::Repeated, _) => write!(f, "counter {got} again"),
        (CounterFault::WrongSequence, Some(last)) => {
            write!(f, "counter {got} after {last}, a step of more than {MAX_DELTA_COUNTER}")
        }
        (CounterFault::WrongSequence, None) => write!(f, "counter {got} out of sequence"),
        (CounterFault::Invalid, _) => write!(f, "counter {got} is not in 0 to 14"),
    }
}

impl core::error::Error for DecodeError {}
