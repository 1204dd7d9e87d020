//! The operator's command: arm, disarm, reset.

use super::payload::Payload;
use crate::error::DecodeError;
use crate::kind::MessageKind;
use crate::network::Node;
use crate::state::StateEvent;

/// An operator's request to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum OperatorRequest {
    /// Let commands reach the arm.
    Arm = 1,
    /// Reduce the force to zero.
    Disarm = 2,
    /// Clear a latched fault.
    Reset = 3,
}

impl OperatorRequest {
    /// All requests, in the order of their numbers.
    pub const ALL: [OperatorRequest; 3] = [OperatorRequest::Arm, OperatorRequest::Disarm, OperatorRequest::Reset];

    /// The request for a number, if there is one.
    pub fn from_number(number: u8) -> Option<OperatorRequest> {
        OperatorRequest::ALL.into_iter().find(|known| *known as u8 == number)
    }

    /// The event that the request causes at its target.
    pub const fn event(self) -> StateEvent {
        match self {
            OperatorRequest::Arm => StateEvent::Arm,
            OperatorRequest::Disarm => StateEvent::Disarm,
            OperatorRequest::Reset => StateEvent::Reset,
        }
    }
}

/// The operator arms, disarms or resets a node. The answer is the node's heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct OperatorCommand {
    /// Request that the node should carry out.
    pub request: OperatorRequest,
    /// The node it is for.
    pub target: Node,
}

impl OperatorCommand {
    pub(crate) const fn encode(&self) -> Payload {
        Payload { flags: 0, bytes: [self.request as u8, self.target.number(), 0, 0, 0, 0] }
    }

    pub(crate) fn decode(payload: &Payload) -> Result<OperatorCommand, DecodeError> {
        let kind = MessageKind::Operator;
        payload.check_flags(kind, 0)?;
        // Bytes 2 and 3 are request and target. What is behind them has no signal and must be zero.
        payload.check_zero_from(kind, 4)?;
        let [request, target, ..] = payload.bytes;
        let unknown = |signal, got: u8| DecodeError::UnknownValue { kind, signal, got: got.into() };
        Ok(OperatorCommand {
            request: OperatorRequest::from_number(request).ok_or(unknown("request", request))?,
            target: Node::from_number(target).ok_or(unknown("target", target))?,
        })
    }
}
