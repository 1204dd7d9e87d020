//! What a node tells of itself.

use crate::{DecodeError, Emergency, NodeState, Refusal};

/// Something that happened to a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NodeEvent {
    /// The node changed its state.
    State {
        /// The state before.
        from: NodeState,
        /// The state now.
        to: NodeState,
    },
    /// The node faulted, or would not arm, and why; or a notice, its own or the partner's.
    Emergency(Emergency),
    /// The partner says why it has faulted. Where that ends this node's work it is the reason of the fault that
    /// follows.
    PartnerEmergency(Emergency),
    /// A command did not reach the arm.
    Refused(Refusal),
    /// A frame of the protocol could not be taken.
    Frame(DecodeError),
    /// A frame could not be taken that came under an identifier which only this node sends: another network with other
    /// node ids or another profile has the same base.
    OtherSender(DecodeError),
}
