//! The events of a node.

use super::frames::FrameFault;
use crate::frame::Id;
use crate::message::{Emergency, Refusal};
use crate::state::NodeState;

/// An event of a node, whatever protocol it speaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NodeEvent {
    /// The node changed its state.
    State {
        /// State that the node has left.
        from: NodeState,
        /// State that the node has entered.
        to: NodeState,
    },
    /// The node faulted, or refused to arm, with the reason; or a notice, its own or the partner's.
    Emergency(Emergency),
    /// The partner reports why it has faulted. If that ends this node's work, it is the cause of the fault that
    /// follows.
    PartnerEmergency(Emergency),
    /// The plant rejected a command.
    Refused(Refusal),
    /// A frame failed one of its checks.
    Frame(FrameFault),
    /// A frame was rejected whose identifier only this node sends: another network with other
    /// node ids or another profile has the same base.
    OtherSender(Id),
    /// So many events other than faults and changes of state were dropped, because too many waited.
    Lost(u64),
}
