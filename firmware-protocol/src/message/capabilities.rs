//! The capabilities of a node of the FD profile, in addition to its hello.

use super::fd::{self, FdBytes, FdReader};
use crate::error::{DecodeError, EncodeError};
use crate::kind::MessageKind;
use crate::network::Node;

/// The most samples in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum SamplesPerFrame {
    /// One sample, in the message [`Sensors`](super::Sensors).
    #[default]
    One = 1,
    /// Two samples, in the message [`SensorPair`](super::SensorPair).
    Two = 2,
}

impl SamplesPerFrame {
    /// All variants, in the order of their numbers.
    pub const ALL: [SamplesPerFrame; 2] = [SamplesPerFrame::One, SamplesPerFrame::Two];

    /// The variant for a number, if it is 1 or 2.
    pub fn from_number(number: u8) -> Option<SamplesPerFrame> {
        SamplesPerFrame::ALL.into_iter().find(|known| *known as u8 == number)
    }
}

/// Capabilities that a node announces. They follow its hello.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capabilities {
    /// Node whose capabilities these are.
    pub node: Node,
    /// The most samples in a frame that it sends (plant) or accepts (exciter).
    pub samples_per_frame: SamplesPerFrame,
    /// The largest force along one axis that it accepts (plant) or commands (exciter), in newtons; 0 if it has none.
    pub force_limit_n: f64,
    /// The largest torque at one joint that it accepts or commands, in newton metres; 0 if it has none.
    pub torque_limit_nm: f64,
}

impl Capabilities {
    const SAMPLES: usize = 3;

    pub(super) fn encode(&self, kind: MessageKind) -> Result<FdBytes, EncodeError> {
        let mut bytes = [0; 64];
        bytes[Self::SAMPLES] = self.samples_per_frame as u8;
        let limits = [("force_limit_n", self.force_limit_n), ("torque_limit_nm", self.torque_limit_nm)];
        for (k, (signal, limit)) in limits.into_iter().enumerate() {
            bytes[fd::VALUES + 4 * k..][..4].copy_from_slice(&fd::limit(kind, signal, limit)?.to_le_bytes());
        }
        Ok(bytes)
    }

    pub(super) fn decode(reader: &FdReader) -> Result<Capabilities, DecodeError> {
        let kind = reader.kind;
        // Capabilities have no sample, so the bytes of its index are reserved like the two after it.
        reader.zero(4..8)?;
        let got = reader.bytes[Self::SAMPLES];
        let unknown = DecodeError::UnknownValue { kind, signal: "samples_per_frame", got: got.into() };
        let samples_per_frame = SamplesPerFrame::from_number(got).ok_or(unknown)?;
        let limit = |signal, at| match reader.single(signal, at)? {
            value if value < 0.0 => Err(DecodeError::Negative { kind, signal }),
            value => Ok(value),
        };
        Ok(Capabilities {
            node: kind.sender(),
            samples_per_frame,
            force_limit_n: limit("force_limit_n", fd::VALUES)?,
            torque_limit_nm: limit("torque_limit_nm", fd::VALUES + 4)?,
        })
    }
}
