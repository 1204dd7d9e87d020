//! The events of a node.

use crate::{DecodeError, Emergency, NodeState, Refusal};

/// An event of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NodeEvent {
    /// The node changed its state.
    State {
        /// The state before.
        from: NodeState,
        /// The state now.
        to: NodeState,
    },
    /// The node faulted, or refused to arm, with the reason; or a notice, its own or the partner's.
    Emergency(Emergency),
    /// The partner reports why it has faulted. If that ends this node's work, it is the cause of the fault that
    /// follows.
    PartnerEmergency(Emergency),
    /// The plant refused a command.
    Refused(Refusal),
    /// A frame of the protocol was refused.
    Frame(DecodeError),
    /// A frame was refused whose identifier only this node sends: another network with other
    /// node ids or another profile has the same base.
    OtherSender(DecodeError),
    /// So many events other than faults and changes of state were dropped, as too many waited.
    Lost(u64),
}
