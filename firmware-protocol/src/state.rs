//! The states of a node, as in CANopen (CiA 301), and the table of their transitions.

use core::fmt;

/// The state of a node. The discriminant is its byte in a heartbeat (CiA 301).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NodeState {
    /// The node has just started; it reports this once.
    BootUp = 0x00,
    /// The node runs, exchanges hellos and measures; the force is zero.
    PreOperational = 0x7F,
    /// Armed: commands reach the arm.
    Operational = 0x05,
    /// A fault has latched; the force ramps to zero and stays there. CANopen's "stopped".
    Fault = 0x04,
}

/// An event that changes a node's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StateEvent {
    /// The node has finished its start.
    Started,
    /// The operator arms the node, which must have found its partner compatible.
    Arm,
    /// The operator disarms the node.
    Disarm,
    /// The operator clears a latched fault.
    Reset,
    /// The node has found a fault.
    Fault,
}

/// All transitions: from, event, to. Other pairs change nothing.
const TRANSITIONS: [(NodeState, StateEvent, NodeState); 7] = [
    (NodeState::BootUp, StateEvent::Started, NodeState::PreOperational),
    (NodeState::BootUp, StateEvent::Fault, NodeState::Fault),
    (NodeState::PreOperational, StateEvent::Arm, NodeState::Operational),
    (NodeState::PreOperational, StateEvent::Fault, NodeState::Fault),
    (NodeState::Operational, StateEvent::Disarm, NodeState::PreOperational),
    (NodeState::Operational, StateEvent::Fault, NodeState::Fault),
    (NodeState::Fault, StateEvent::Reset, NodeState::PreOperational),
];

impl NodeState {
    /// All states a node can have.
    pub const ALL: [NodeState; 4] =
        [NodeState::BootUp, NodeState::PreOperational, NodeState::Operational, NodeState::Fault];

    /// The byte of the state in a heartbeat (CiA 301).
    pub const fn heartbeat_byte(self) -> u8 {
        self as u8
    }

    /// The state of a heartbeat's byte, if there is one.
    pub fn from_heartbeat_byte(byte: u8) -> Option<NodeState> {
        NodeState::ALL.into_iter().find(|state| state.heartbeat_byte() == byte)
    }

    /// The state after `event`, or `None` if `event` is not accepted in this one.
    pub fn next(self, event: StateEvent) -> Option<NodeState> {
        TRANSITIONS.into_iter().find(|(from, on, _)| (*from, *on) == (self, event)).map(|(_, _, to)| to)
    }
}

impl StateEvent {
    /// All events that can change a node's state.
    pub const ALL: [StateEvent; 5] =
        [StateEvent::Started, StateEvent::Arm, StateEvent::Disarm, StateEvent::Reset, StateEvent::Fault];
}

impl fmt::Display for NodeState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NodeState::BootUp => "boot-up",
            NodeState::PreOperational => "pre-operational",
            NodeState::Operational => "operational",
            NodeState::Fault => "fault",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heartbeat_bytes_convert_in_both_directions() {
        let known: std::vec::Vec<u8> =
            (0..=255).filter(|&byte| NodeState::from_heartbeat_byte(byte).is_some()).collect();
        assert_eq!(known, [0x00, 0x04, 0x05, 0x7F]);
        for state in NodeState::ALL {
            assert_eq!(NodeState::from_heartbeat_byte(state.heartbeat_byte()), Some(state));
        }
    }

    #[test]
    fn only_a_reset_leaves_a_fault() {
        for event in StateEvent::ALL {
            let expected = (event == StateEvent::Reset).then_some(NodeState::PreOperational);
            assert_eq!(NodeState::Fault.next(event), expected, "{event:?}");
        }
    }

    #[test]
    fn only_arm_in_pre_operational_arms() {
        for state in NodeState::ALL {
            for event in StateEvent::ALL {
                let arms = state == NodeState::PreOperational && event == StateEvent::Arm;
                assert_eq!(state.next(event) == Some(NodeState::Operational), arms, "{state:?} {event:?}");
            }
        }
    }

    #[test]
    fn a_fault_is_possible_in_every_other_state() {
        for state in NodeState::ALL {
            let expected = (state != NodeState::Fault).then_some(NodeState::Fault);
            assert_eq!(state.next(StateEvent::Fault), expected, "{state:?}");
        }
    }

    #[test]
    fn no_transition_occurs_twice() {
        for (i, (from, on, _)) in TRANSITIONS.iter().enumerate() {
            assert!(TRANSITIONS[..i].iter().all(|(f, o, _)| (f, o) != (from, on)), "{from:?} {on:?}");
        }
    }
}
