//! What a node of the FD profile can do beyond its hello.

use super::MessageKind;
use super::fd::{self, FdBytes, FdReader};
use crate::error::{DecodeError, EncodeError};
use crate::network::Node;

/// What a node can do. It follows the node's hello.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capabilities {
    /// The node.
    pub node: Node,
    /// The most samples in a frame that it sends (plant) or takes (exciter): 1 or 2.
    pub samples_per_frame: u8,
    /// The largest force along one axis that it takes (plant) or commands (exciter), in newtons; 0 if it has none.
    pub force_limit_n: f64,
    /// The largest torque at one joint that it takes or commands, in newton metres; 0 if it has none.
    pub torque_limit_nm: f64,
}

impl Capabilities {
    /// The most samples that a frame holds.
    pub const SAMPLES_PER_FRAME_MAX: u8 = 2;

    const SAMPLES: usize = 3;

    pub(super) fn encode(&self, kind: MessageKind) -> Result<FdBytes, EncodeError> {
        let (signal, got, max) = ("samples_per_frame", self.samples_per_frame, Self::SAMPLES_PER_FRAME_MAX);
        if !(1..=max).contains(&got) {
            return Err(EncodeError::Invalid { kind, signal, got: got.into(), min: 1, max: max.into() });
        }
        let mut bytes = [0; 64];
        bytes[Self::SAMPLES] = got;
        let limits = [("force_limit_n", self.force_limit_n), ("torque_limit_nm", self.torque_limit_nm)];
        for (k, (signal, limit)) in limits.into_iter().enumerate() {
            bytes[fd::VALUES + 4 * k..][..4].copy_from_slice(&fd::limit(kind, signal, limit)?.to_le_bytes());
        }
        Ok(bytes)
    }

    pub(super) fn decode(reader: &FdReader) -> Result<Capabilities, DecodeError> {
        let kind = reader.kind;
        reader.zero(4..8)?;
        let samples_per_frame = reader.bytes[Self::SAMPLES];
        if !(1..=Self::SAMPLES_PER_FRAME_MAX).contains(&samples_per_frame) {
            let got = samples_per_frame.into();
            return Err(DecodeError::UnknownValue { kind, signal: "samples_per_frame", got });
        }
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
