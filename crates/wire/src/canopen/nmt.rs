//! Network management (NMT): commands, and states of a node's communication.

/// The state of a node's communication (CiA 301, section 7.3.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtState {
    /// The node has not sent its boot-up message yet.
    Initialising,
    /// SDOs are served, PDOs are not.
    PreOperational,
    /// SDOs are served, and PDOs are sent and received.
    Operational,
    /// Only network management and heartbeat are active.
    Stopped,
}

impl NmtState {
    /// Returns the byte of the state in a heartbeat.
    pub const fn byte(self) -> u8 {
        match self {
            NmtState::Initialising => 0,
            NmtState::Stopped => 4,
            NmtState::Operational => 5,
            NmtState::PreOperational => 127,
        }
    }

    /// Decodes the state of a heartbeat; `None` for an unknown byte.
    pub(super) const fn of(byte: u8) -> Option<NmtState> {
        match byte {
            0 => Some(NmtState::Initialising),
            4 => Some(NmtState::Stopped),
            5 => Some(NmtState::Operational),
            127 => Some(NmtState::PreOperational),
            _ => None,
        }
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

/// A command of network management.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtCommand {
    /// Enters the state operational.
    Start,
    /// Enters the state stopped.
    Stop,
    /// Enters the state pre-operational.
    PreOperational,
    /// Restores all values as after power-on, and boots.
    ResetNode,
    /// Restores the communication parameters as after power-on, and boots.
    ResetCommunication,
}

impl NmtCommand {
    pub(super) const fn of(byte: u8) -> Option<NmtCommand> {
        match byte {
            0x01 => Some(NmtCommand::Start),
            0x02 => Some(NmtCommand::Stop),
            0x80 => Some(NmtCommand::PreOperational),
            0x81 => Some(NmtCommand::ResetNode),
            0x82 => Some(NmtCommand::ResetCommunication),
            _ => None,
        }
    }

    /// Returns the byte of the command on the bus.
    pub const fn byte(self) -> u8 {
        match self {
            NmtCommand::Start => 0x01,
            NmtCommand::Stop => 0x02,
            NmtCommand::PreOperational => 0x80,
            NmtCommand::ResetNode => 0x81,
            NmtCommand::ResetCommunication => 0x82,
        }
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
