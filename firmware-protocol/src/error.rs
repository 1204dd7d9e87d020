//! Errors of sending a message, and reasons for which a frame is rejected.

use core::fmt;

use crate::e2e::{CounterFault, MAX_DELTA_COUNTER, Protection};
use crate::frame::FrameFormat;
use crate::kind::MessageKind;

/// Error of sending a message. Nothing was sent and no counter moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EncodeError {
    /// A value is not a number or infinite.
    NotFinite {
        /// The message that was to be sent.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
        /// Value of the signal: infinite or NaN.
        got: f64,
    },
    /// A commanded value rounds beyond the range of its signal. Commands are never clipped: the controller must know.
    OutOfRange {
        /// The message that was to be sent.
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
        /// The message that was to be sent.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
        /// Integer that the signal can't have.
        got: u32,
        /// The smallest value the signal can have.
        min: u32,
        /// The largest value the signal can have.
        max: u32,
    },
    /// A limit is less than zero.
    Negative {
        /// The message that was to be sent.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
        /// The value, in the unit of the signal.
        got: f64,
    },
    /// The network's profile has no such message.
    OtherProfile {
        /// The message that the profile does not have.
        kind: MessageKind,
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
            EncodeError::Negative { kind, signal, got } => {
                write!(f, "{kind}: {signal} is {got}, less than 0; nothing was sent")
            }
            EncodeError::OtherProfile { kind } => {
                write!(f, "{kind}: the network's profile has no such message; nothing was sent")
            }
        }
    }
}

impl core::error::Error for EncodeError {}

/// Reason for which a frame on one of the protocol's identifiers is rejected. Its content must not be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecodeError {
    /// The frame is not of the format that the message has in the network's profile.
    Format {
        /// The message of the identifier.
        kind: MessageKind,
        /// The format of the frame.
        got: FrameFormat,
    },
    /// The network's profile has no such message.
    OtherProfile {
        /// The message of the identifier.
        kind: MessageKind,
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
        got: u16,
        /// The CRC of its content.
        expected: u16,
        /// The profile that states its width.
        protection: Protection,
    },
    /// The CRC is right and the counter is not.
    Counter {
        /// The message of the identifier.
        kind: MessageKind,
        /// Reason why the counter is wrong.
        fault: CounterFault,
        /// The counter in the frame.
        got: u8,
    },
    /// Bits that must be zero are not.
    Reserved {
        /// The message of the identifier.
        kind: MessageKind,
        /// The byte of the frame, from 0.
        byte: usize,
        /// The bits that must be zero, as received.
        got: u8,
    },
    /// A signal has the reserved count −32768, "not available".
    NotAvailable {
        /// The message of the identifier.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
    },
    /// A single is not a number or infinite.
    NotFinite {
        /// The message of the identifier.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
    },
    /// A limit is less than zero.
    Negative {
        /// The message of the identifier.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
    },
    /// A signal has a value without a meaning.
    UnknownValue {
        /// The message of the identifier.
        kind: MessageKind,
        /// The signal, by the name of its field.
        signal: &'static str,
        /// Raw value that has no meaning.
        got: u16,
    },
}

impl DecodeError {
    /// The message of the frame's identifier.
    pub const fn kind(&self) -> MessageKind {
        match *self {
            DecodeError::Format { kind, .. }
            | DecodeError::OtherProfile { kind }
            | DecodeError::Length { kind, .. }
            | DecodeError::Crc { kind, .. }
            | DecodeError::Counter { kind, .. }
            | DecodeError::Reserved { kind, .. }
            | DecodeError::NotAvailable { kind, .. }
            | DecodeError::NotFinite { kind, .. }
            | DecodeError::Negative { kind, .. }
            | DecodeError::UnknownValue { kind, .. } => kind,
        }
    }
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} rejected: ", self.kind())?;
        match *self {
            DecodeError::Format { got: FrameFormat::Remote, .. } => {
                f.write_str("expected a data frame, got a remote frame")
            }
            DecodeError::Format { got: FrameFormat::Fd { .. }, .. } => {
                f.write_str("expected a classical frame, got a CAN FD frame")
            }
            DecodeError::Format { .. } => f.write_str("expected a CAN FD frame, got a classical frame"),
            DecodeError::OtherProfile { .. } => f.write_str("the network's profile has no such message"),
            DecodeError::Length { got, expected, .. } => write!(f, "{got} bytes long instead of {expected}"),
            DecodeError::Crc { got, expected, protection: Protection::Profile11, .. } => {
                write!(f, "CRC {got:#04X} instead of {expected:#04X}")
            }
            DecodeError::Crc { got, expected, protection: Protection::Profile5, .. } => {
                write!(f, "CRC {got:#06X} instead of {expected:#06X}")
            }
            DecodeError::Counter { fault: CounterFault::Repeated, got, .. } => write!(f, "counter {got} was repeated"),
            DecodeError::Counter { fault: CounterFault::WrongSequence { last }, got, .. } => {
                write!(f, "counter {got} after {last}, a step of more than {MAX_DELTA_COUNTER}")
            }
            DecodeError::Counter { fault: CounterFault::Invalid, got, .. } => {
                write!(f, "counter {got} is not in 0 to {}", Protection::Profile11.counter_max())
            }
            DecodeError::Reserved { byte, got, .. } => {
                write!(f, "byte {byte} has reserved bits set ({got:#04X})")
            }
            DecodeError::NotAvailable { signal, .. } => write!(f, "{signal} is not available"),
            DecodeError::NotFinite { signal, .. } => write!(f, "{signal} is not a finite number"),
            DecodeError::Negative { signal, .. } => write!(f, "{signal} is less than 0"),
            DecodeError::UnknownValue { signal, got, .. } => write!(f, "{got} is not a value of {signal}"),
        }
    }
}

impl core::error::Error for DecodeError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Frame, Id};
    use crate::message::{ForceCommand, Hello, ImpedanceHead, Message};
    use crate::network::Network;
    use crate::receiver::Receiver;
    use crate::transmitter::Transmitter;
    use crate::{Profile, Version};
    use std::string::{String, ToString};
    use std::vec::Vec;

    fn unsendable(message: Message) -> String {
        Transmitter::new(Network::default()).frame(&message).unwrap_err().to_string()
    }

    #[test]
    fn says_why_a_message_cannot_be_sent() {
        let force = |force_x_n| Message::Force(ForceCommand { force_x_n, force_y_n: 0.0, sample: 0 });
        insta::assert_snapshot!(unsendable(force(700.0)), @"ForceCommand: force_x_n is 700, beyond the range of ±655.34; nothing was sent");
        insta::assert_snapshot!(unsendable(force(f64::NAN)), @"ForceCommand: force_x_n is NaN, which is not a finite number; nothing was sent");
        let x_saturated = false;
        let y_saturated = false;
        let head = ImpedanceHead { force_x_n: 0.0, force_y_n: f64::INFINITY, x_saturated, y_saturated, sample: 0 };
        insta::assert_snapshot!(unsendable(Message::Head(head)), @"ImpedanceHead: force_y_n is inf, which is not a finite number; nothing was sent");
        let version = Version { major: 1, minor: 0 };
        let hello = Hello { version, dbc_hash: 0, profile: Profile::Classic, rate_hz: 0 };
        insta::assert_snapshot!(unsendable(Message::ExciterHello(hello)), @"ExciterHello: rate_hz is 0, not in 1 to 65535; nothing was sent");
    }

    /// The receiver's errors for each frame in turn.
    fn refusals(frames: &[(u16, FrameFormat, &[u8])]) -> String {
        let mut receiver = Receiver::new(Network::default());
        let say = |&(id, format, data): &(u16, FrameFormat, &[u8])| {
            let mut bytes = [0; 64];
            bytes[..data.len()].copy_from_slice(data);
            let kind = MessageKind::from_id(Network::default(), Id::Standard(id)).unwrap();
            if let (8, Some(data_id), 0) = (data.len(), kind.data_id(Network::default()), data[0]) {
                bytes[0] = crate::e2e::profile11::crc(data_id, bytes.first_chunk().unwrap());
            }
            let frame = Frame::new(Id::Standard(id), format, &bytes[..data.len()]).unwrap();
            receiver.accept(&frame).map_or_else(|error| error.to_string(), |_| "taken".to_string())
        };
        frames.iter().map(say).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn says_why_a_frame_is_refused() {
        let classic = FrameFormat::Classic;
        let fd = FrameFormat::Fd { bit_rate_switch: false, error_state_indicator: false };
        // A CRC of 0 is replaced by the right one.
        insta::assert_snapshot!(refusals(&[
            (0x201, FrameFormat::Remote, &[0; 8]),
            (0x201, fd, &[0; 8]),
            (0x203, classic, &[0; 7]),
            (0x702, classic, &[0; 2]),
            (0x201, classic, &[1; 8]),
            (0x201, classic, &[0, 4, 0, 0, 0, 0, 0, 0]),
            (0x201, classic, &[0, 4, 0, 0, 0, 0, 0, 0]),
            (0x201, classic, &[0, 3, 0, 0, 0, 0, 0, 0]),
            (0x201, classic, &[0, 15, 0, 0, 0, 0, 0, 0]),
            (0x201, classic, &[0, 0x14, 0, 0, 0, 0, 0, 0]),
            (0x200, classic, &[0, 0, 1, 1, 0, 0, 9, 0]),
            (0x200, classic, &[0, 1, 7, 1, 0, 0, 0, 0]),
            (0x204, classic, &[0, 0, 0, 0, 0, 0x80, 0, 0]),
            (0x701, classic, &[0x42]),
        ]), @r"
        ForceCommand rejected: expected a data frame, got a remote frame
        ForceCommand rejected: expected a classical frame, got a CAN FD frame
        ImpedanceHead rejected: 7 bytes long instead of 8
        ExciterHeartbeat rejected: 2 bytes long instead of 1
        ForceCommand rejected: CRC 0x01 instead of 0x81
        taken
        ForceCommand rejected: counter 4 was repeated
        ForceCommand rejected: counter 3 after 4, a step of more than 4
        ForceCommand rejected: counter 15 is not in 0 to 14
        ForceCommand rejected: byte 1 has reserved bits set (0x10)
        OperatorCommand rejected: byte 6 has reserved bits set (0x09)
        OperatorCommand rejected: 7 is not a value of request
        AccelerometerB rejected: acceleration_y_m_s2 is not available
        PlantHeartbeat rejected: 66 is not a value of state
        ");
    }
}
