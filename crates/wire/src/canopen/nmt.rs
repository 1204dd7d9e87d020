//! Network management: what it commands, and the states of a node's communication.

/// The state of a node's communication (CiA 301, section 7.3.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtState {
    /// Before boot-up.
    Initialising,
    /// SDOs, and no PDOs.
    PreOperational,
    /// SDOs and PDOs.
    Operational,
    /// Network management and heartbeat alone.
    Stopped,
}

impl NmtState {
    /// Its byte in a heartbeat.
    pub const fn byte(self) -> u8 {
        match self {
            NmtState::Initialising => 0,
            NmtState::Stopped => 4,
            NmtState::Operational => 5,
            NmtState::PreOperational => 127,
        }
    }

    /// The state in a heartbeat; `None` if there is no such.
    pub(super) const fn of(byte: u8) -> Option<NmtState> {
        match byte {
            0 => Some(NmtState::Initialising),
            4 => Some(NmtState::Stopped),
            5 => Some(NmtState::Operational),
            127 => Some(NmtState::PreOperational),
            _ => None,
        }
    }

    /// Its name.
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
    /// To operational.
    Start,
    /// To stopped.
    Stop,
    /// To pre-operational.
    PreOperational,
    /// All values as after power-on, and boot-up.
    ResetNode,
    /// The values of communication as after power-on, and boot-up.
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

    /// Its byte on the wire.
    pub const fn byte(self) -> u8 {
        match self {
            NmtCommand::Start => 0x01,
            NmtCommand::Stop => 0x02,
            NmtCommand::PreOperational => 0x80,
            NmtCommand::ResetNode => 0x81,
            NmtCommand::ResetCommunication => 0x82,
        }
    }

    /// Its name.
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
