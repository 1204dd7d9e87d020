//! The heartbeat as in CANopen (CiA 301, "heartbeat protocol").

use super::payload::Payload;
use crate::error::DecodeError;
use crate::kind::MessageKind;
use crate::network::Node;
use crate::state::NodeState;

/// State that a node reports in its heartbeat. Unprotected, one byte, so that any CANopen tool reads it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Heartbeat {
    /// Node that sends the heartbeat.
    pub node: Node,
    /// State in which the node is.
    pub state: NodeState,
}

impl Heartbeat {
    pub(crate) const fn encode(&self) -> Payload {
        Payload { flags: 0, bytes: [self.state.heartbeat_byte(), 0, 0, 0, 0, 0] }
    }

    pub(crate) fn decode(kind: MessageKind, payload: &Payload) -> Result<Heartbeat, DecodeError> {
        let [byte, ..] = payload.bytes;
        let unknown = DecodeError::UnknownValue { kind, signal: "state", got: byte.into() };
        Ok(Heartbeat { node: kind.sender(), state: NodeState::from_heartbeat_byte(byte).ok_or(unknown)? })
    }
}
