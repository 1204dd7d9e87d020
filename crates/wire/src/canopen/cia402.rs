//! The state machine of a drive (CiA 402-2, section "Controlling the power drive system").
//!
//! | controlword | command | from | to |
//! | --- | --- | --- | --- |
//! | `xxxx x110` | shutdown | switch on disabled, switched on, operation enabled | ready to switch on |
//! | `xxxx 0111` | switch on, disable operation | ready to switch on, operation enabled | switched on |
//! | `xxxx 1111` | enable operation | ready to switch on, switched on, quick stop active | operation enabled |
//! | `xxxx xx0x` | disable voltage | all but faults | switch on disabled |
//! | `xxxx x01x` | quick stop | ready to switch on, switched on | switch on disabled |
//! | | | operation enabled | quick stop active |
//! | bit 7 rises | fault reset | fault | switch on disabled |

/// State of a drive (CiA 402). The discriminant has the bits that code it in a statusword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// The drive initialises itself.
    NotReady = 0x00,
    /// Parameters may be set; the power stage has no voltage.
    SwitchOnDisabled = 0x40,
    /// Voltage may be switched on.
    ReadyToSwitchOn = 0x21,
    /// The power stage has voltage but exerts no torque.
    SwitchedOn = 0x23,
    /// Targets act on the motor.
    OperationEnabled = 0x27,
    /// The drive has stopped and stays so until it is disabled or enabled.
    QuickStopActive = 0x07,
    /// A fault has occurred, and the torque goes to zero.
    FaultReactionActive = 0x0F,
    /// A fault is latched until it is reset.
    Fault = 0x08,
}

/// Command of a controlword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Shutdown: voltage may be switched on.
    Shutdown,
    /// Switch on; for an enabled drive, disable operation.
    SwitchOn,
    /// Enable operation: targets act from now on.
    EnableOperation,
    /// Disable voltage: the torque is gone at once.
    DisableVoltage,
    /// Quick stop: an enabled drive stops and stays enabled.
    QuickStop,
    /// Fault reset, by the rising edge of bit 7.
    FaultReset,
}

/// Bit of the controlword whose rising edge resets a fault.
const RESET: u16 = 1 << 7;
/// Bit of the controlword that halts the drive.
const HALT: u16 = 1 << 8;

impl Command {
    /// Decodes the command of a controlword, given the controlword `before` it.
    pub const fn of(before: u16, controlword: u16) -> Command {
        // Only the edge counts: a master that leaves the bit set must not reset every later fault as well.
        if controlword & RESET != 0 && before & RESET == 0 {
            return Command::FaultReset;
        }
        // The order of the tests is that of the masks in CiA 402: bit 1 low disables voltage whatever the other
        // bits are, then bit 2 low is a quick stop. Only then do bits 0 and 3 count.
        match controlword & 0xF {
            low if low & 0x2 == 0 => Command::DisableVoltage,
            low if low & 0x4 == 0 => Command::QuickStop,
            low if low & 0x1 == 0 => Command::Shutdown,
            0x7 => Command::SwitchOn,
            _ => Command::EnableOperation,
        }
    }

    /// Returns the name of the command in CiA 402.
    pub const fn name(self) -> &'static str {
        match self {
            Command::Shutdown => "shutdown",
            Command::SwitchOn => "switch on",
            Command::EnableOperation => "enable operation",
            Command::DisableVoltage => "disable voltage",
            Command::QuickStop => "quick stop",
            Command::FaultReset => "fault reset",
        }
    }
}

/// Returns whether a controlword halts the drive, which then stays enabled without torque.
pub const fn halts(controlword: u16) -> bool {
    controlword & HALT != 0
}

/// All transitions by commands. A command in any other state changes nothing.
const TRANSITIONS: [(DriveState, Command, DriveState); 16] = {
    use Command::{DisableVoltage, EnableOperation, FaultReset, QuickStop, Shutdown, SwitchOn};
    use DriveState::{Fault, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    [
        (SwitchOnDisabled, Shutdown, ReadyToSwitchOn),
        (ReadyToSwitchOn, SwitchOn, SwitchedOn),
        (ReadyToSwitchOn, EnableOperation, OperationEnabled),
        (ReadyToSwitchOn, DisableVoltage, SwitchOnDisabled),
        (ReadyToSwitchOn, QuickStop, SwitchOnDisabled),
        (SwitchedOn, EnableOperation, OperationEnabled),
        (SwitchedOn, Shutdown, ReadyToSwitchOn),
        (SwitchedOn, DisableVoltage, SwitchOnDisabled),
        (SwitchedOn, QuickStop, SwitchOnDisabled),
        (OperationEnabled, SwitchOn, SwitchedOn),
        (OperationEnabled, Shutdown, ReadyToSwitchOn),
        (OperationEnabled, DisableVoltage, SwitchOnDisabled),
        (OperationEnabled, QuickStop, QuickStopActive),
        (QuickStopActive, DisableVoltage, SwitchOnDisabled),
        (QuickStopActive, EnableOperation, OperationEnabled),
        (Fault, FaultReset, SwitchOnDisabled),
    ]
};
impl DriveState {
    /// All states, in the order of the standard's state machine.
    pub const ALL: [DriveState; 8] = [
        DriveState::NotReady,
        DriveState::SwitchOnDisabled,
        DriveState::ReadyToSwitchOn,
        DriveState::SwitchedOn,
        DriveState::OperationEnabled,
        DriveState::QuickStopActive,
        DriveState::FaultReactionActive,
        DriveState::Fault,
    ];

    /// Returns the state after a command; the same state if the command has no effect there.
    pub fn after(self, command: Command) -> DriveState {
        // Sixteen entries: a linear search is fast enough for the rate at which controlwords come.
        let transition = TRANSITIONS.iter().find(|(from, on, _)| *from == self && *on == command);
        transition.map_or(self, |(_, _, to)| *to)
    }

    /// Returns the bits of the statusword that code the state: 0 to 3, 5 and 6.
    pub const fn bits(self) -> u16 {
        self as u16
    }

    /// Decodes the state of a statusword; `None` if the bits code no state. Bit 5 distinguishes quick stop
    /// active and the enabled states, and has no meaning in the others.
    pub fn of(statusword: u16) -> Option<DriveState> {
        DriveState::ALL.into_iter().find(|state| {
            // 0x6F are the six bits that code a state; 0x4F is the same without bit 5.
            let mask = match state {
                DriveState::NotReady
                | DriveState::SwitchOnDisabled
                | DriveState::FaultReactionActive
                | DriveState::Fault => 0x4F,
                _ => 0x6F,
            };
            statusword & mask == state.bits()
        })
    }

    /// Returns the name of the state in CiA 402.
    pub const fn name(self) -> &'static str {
        match self {
            DriveState::NotReady => "not ready to switch on",
            DriveState::SwitchOnDisabled => "switch on disabled",
            DriveState::ReadyToSwitchOn => "ready to switch on",
            DriveState::SwitchedOn => "switched on",
            DriveState::OperationEnabled => "operation enabled",
            DriveState::QuickStopActive => "quick stop active",
            DriveState::FaultReactionActive => "fault reaction active",
            DriveState::Fault => "fault",
        }
    }

    /// Returns whether the state is a fault.
    pub const fn is_fault(self) -> bool {
        matches!(self, DriveState::FaultReactionActive | DriveState::Fault)
    }
}

/// Bit of the statusword: the power stage has voltage.
pub const VOLTAGE: u16 = 1 << 4;
/// Bit of the statusword: the drive takes commands from the bus.
pub const REMOTE: u16 = 1 << 9;
/// Bit of the statusword: a limit keeps the drive from its target.
pub const LIMITED: u16 = 1 << 11;
/// Bit of the statusword: the drive follows its target, in a cyclic mode.
pub const FOLLOWS: u16 = 1 << 12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_statusword_says_its_state_whatever_its_other_bits() {
        for state in DriveState::ALL {
            for other in [0, VOLTAGE, REMOTE | LIMITED, FOLLOWS | 0x8000] {
                assert_eq!(DriveState::of(state.bits() | other), Some(state));
            }
        }
        // Bit 5 says nothing of a drive that is switched off or in fault.
        assert_eq!(DriveState::of(0x60), Some(DriveState::SwitchOnDisabled));
        assert_eq!(DriveState::of(0x28), Some(DriveState::Fault));
        assert_eq!(DriveState::of(0x05), None);
    }
}
