//! Network management (NMT): commands, and states of a node's communication.

/// The state of a node's communication (CiA 301, section 7.3.2). The discriminant is its byte in a heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtState {
    /// The node has not sent its boot-up message yet.
    Initialising = 0,
    /// SDOs are served, PDOs are not.
    PreOperational = 127,
    /// SDOs are served, and PDOs are sent and received.
    Operational = 5,
    /// Only network management and heartbeat are active.
    Stopped = 4,
}

impl NmtState {
    /// Returns the byte of the state in a heartbeat.
    pub const fn byte(self) -> u8 {
        self as u8
    }

    /// Decodes the state of a heartbeat; `None` for an unknown byte.
    pub(super) fn of(byte: u8) -> Option<NmtState> {
        // A heartbeat has a toggle bit only in node guarding, which these nodes don't have, so that the whole byte
        // counts.
        use NmtState::{Initialising, Operational, PreOperational, Stopped};
        [Initialising, PreOperational, Operational, Stopped].into_iter().find(|state| state.byte() == byte)
    }

    /// Returns the name of the state.
    pub const fn name(self) -> &'static str {
        match self {
            NmtState::Initialising => "initialising",
            NmtState::PreOperational => "pre-operational",
            NmtState::Operational => "operational",
            NmtState::Stopped => "stopped",
        }
    }
}

/// A command of network management. The discriminant is its byte on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtCommand {
    /// Enters the state operational.
    Start = 0x01,
    /// Enters the state stopped.
    Stop = 0x02,
    /// Enters the state pre-operational.
    PreOperational = 0x80,
    /// Restores all values as after power-on, and boots.
    ResetNode = 0x81,
    /// Restores the communication parameters as after power-on, and boots.
    ResetCommunication = 0x82,
}

impl NmtCommand {
    pub(super) fn of(byte: u8) -> Option<NmtCommand> {
        use NmtCommand::{PreOperational, ResetCommunication, ResetNode, Start, Stop};
        let all = [Start, Stop, PreOperational, ResetNode, ResetCommunication];
        all.into_iter().find(|command| command.byte() == byte)
    }

    /// Returns the byte of the command on the bus.
    pub const fn byte(self) -> u8 {
        self as u8
    }

    /// Returns the name of the command.
    pub const fn name(self) -> &'static str {
        match self {
            NmtCommand::Start => "start",
            NmtCommand::Stop => "stop",
            NmtCommand::PreOperational => "enter pre-operational",
            NmtCommand::ResetNode => "reset node",
            NmtCommand::ResetCommunication => "reset communication",
        }
    }
}
