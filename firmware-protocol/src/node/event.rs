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
    /// A command did not reach the arm.
    Refused(Refusal),
    /// A frame of the protocol could not be taken.
    Frame(DecodeError),
}
