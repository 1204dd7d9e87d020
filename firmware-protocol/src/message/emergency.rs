//! The emergency: why a node has faulted, or would not arm.

use core::fmt;

use super::{MessageKind, Payload};
use crate::error::DecodeError;
use crate::network::Node;

/// What has gone wrong. `SPEC.md` says what `detail` means for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum FaultCode {
    /// Plant: no valid command in time. Detail: commands refused since the last that was taken, at most 65535.
    CommandTimeout = 1,
    /// Exciter: no whole sample in time. Detail: the last sample answered.
    SensorTimeout = 2,
    /// The partner gave no sign of life in time. Detail: the partner's node id.
    HeartbeatLost = 3,
    /// The partner's heartbeat says that it has faulted or booted. Detail: the partner's node id.
    PartnerFault = 4,
    /// The partner's hello is missing or doesn't fit. Detail: the [`Mismatch`](super::Mismatch).
    Incompatible = 5,
    /// Exciter: its control loop asked for a command that can't be sent. Detail: 0.
    CommandOutOfRange = 6,
    /// Plant: the simulated arm or its integrator failed; the state is no longer meaningful. Detail: 0.
    SimulationFailed = 7,
    /// The node's loop missed ticks. Detail: how many, at most 65535.
    Overrun = 8,
    /// The node could not send: bus off, or a full queue. Detail: frames not sent, at most 65535.
    BusLoss = 9,
}

impl FaultCode {
    /// Every fault code.
    pub const ALL: [FaultCode; 9] = [
        FaultCode::CommandTimeout,
        FaultCode::SensorTimeout,
        FaultCode::HeartbeatLost,
        FaultCode::PartnerFault,
        FaultCode::Incompatible,
        FaultCode::CommandOutOfRange,
        FaultCode::SimulationFailed,
        FaultCode::Overrun,
        FaultCode::BusLoss,
    ];

    /// The fault of a code on the wire, if it is one.
    pub fn from_code(code: u16) -> Option<FaultCode> {
        FaultCode::ALL.into_iter().find(|known| *known as u16 == code)
    }
}

impl fmt::Display for FaultCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FaultCode::CommandTimeout => "no valid command in time",
            FaultCode::SensorTimeout => "no sensor data in time",
            FaultCode::HeartbeatLost => "the partner gave no sign of life in time",
            FaultCode::PartnerFault => "the partner has faulted or started again",
            FaultCode::Incompatible => "the partner does not fit",
            FaultCode::CommandOutOfRange => "a command beyond the range of its signal",
            FaultCode::SimulationFailed => "the simulation failed",
            FaultCode::Overrun => "ticks were missed",
            FaultCode::BusLoss => "frames could not be sent",
        })
    }
}

/// A node tells why it has faulted. With [`FaultCode::Incompatible`] in the state pre-operational: why it would not arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Emergency {
    /// The node.
    pub node: Node,
    /// What has gone wrong.
    pub code: FaultCode,
    /// More about it; the meaning depends on the code.
    pub detail: u16,
    /// The index, modulo 2¹⁶, of the sample at which it was found.
    pub sample: u16,
}

impl Emergency {
    pub(crate) const fn encode(&self) -> Payload {
        Payload::from_words(0, [self.code as u16, self.detail, self.sample])
    }

    pub(crate) fn decode(kind: MessageKind, payload: &Payload) -> Result<Emergency, DecodeError> {
        payload.check_flags(kind, 0)?;
        let [code, detail, sample] = payload.words();
        let unknown = DecodeError::UnknownValue { kind, signal: "code", got: code };
        Ok(Emergency { node: kind.sender(), code: FaultCode::from_code(code).ok_or(unknown)?, detail, sample })
    }
}
