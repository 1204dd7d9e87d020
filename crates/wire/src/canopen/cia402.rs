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

/// A state of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// The drive initialises.
    NotReady,
    /// Parameters may be set; no voltage.
    SwitchOnDisabled,
    /// Voltage may be switched on.
    ReadyToSwitchOn,
    /// Voltage is on; no torque.
    SwitchedOn,
    /// Targets act.
    OperationEnabled,
    /// Stopped, and held so until it is disabled or enabled.
    QuickStopActive,
    /// A fault: the torque goes to zero.
    FaultReactionActive,
    /// A fault is latched.
    Fault,
}

/// What a controlword asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Shutdown.
    Shutdown,
    /// Switch on; of an enabled drive, disable operation.
    SwitchOn,
    /// Enable operation.
    EnableOperation,
    /// Disable voltage.
    DisableVoltage,
    /// Quick stop.
    QuickStop,
    /// Fault reset: bit 7 rises.
    FaultReset,
}

/// The bit of a controlword that resets a fault when it rises.
const RESET: u16 = 1 << 7;
/// The bit of a controlword that halts.
const HALT: u16 = 1 << 8;

impl Command {
    /// What a controlword asks for after the one `before`.
    pub const fn of(before: u16, controlword: u16) -> Command {
        if controlword & RESET != 0 && before & RESET == 0 {
            return Command::FaultReset;
        }
        match controlword & 0xF {
            low if low & 0x2 == 0 => Command::DisableVoltage,
            low if low & 0x4 == 0 => Command::QuickStop,
            low if low & 0x1 == 0 => Command::Shutdown,
            0x7 => Command::SwitchOn,
            _ => Command::EnableOperation,
        }
    }

    /// Its name in CiA 402.
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

/// Whether a controlword halts: the drive stays enabled, without torque.
pub const fn halts(controlword: u16) -> bool {
    controlword & HALT != 0
}

/// All transitions by commands; other pairs change nothing.
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
    /// Every state.
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

    /// The state after a command; the same if it changes nothing.
    pub fn after(self, command: Command) -> DriveState {
        let transition = TRANSITIONS.iter().find(|(from, on, _)| *from == self && *on == command);
        transition.map_or(self, |(_, _, to)| *to)
    }

    /// Its bits of the statusword: 0 to 3, 5 and 6.
    pub const fn bits(self) -> u16 {
        match self {
            DriveState::NotReady => 0x00,
            DriveState::SwitchOnDisabled => 0x40,
            DriveState::ReadyToSwitchOn => 0x21,
            DriveState::SwitchedOn => 0x23,
            DriveState::OperationEnabled => 0x27,
            DriveState::QuickStopActive => 0x07,
            DriveState::FaultReactionActive => 0x0F,
            DriveState::Fault => 0x08,
        }
    }

    /// The state in a statusword; `None` if its bits are those of none. In quick stop active and in those that are
    /// enabled bit 5 tells, in the others it has no meaning.
    pub fn of(statusword: u16) -> Option<DriveState> {
        DriveState::ALL.into_iter().find(|state| {
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

    /// Its name in CiA 402.
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

    /// Whether it is a fault.
    pub const fn is_fault(self) -> bool {
        matches!(self, DriveState::FaultReactionActive | DriveState::Fault)
    }
}

/// The bit of a statusword that says that voltage is there.
pub const VOLTAGE: u16 = 1 << 4;
/// The bit of a statusword that says that the drive takes commands from the bus.
pub const REMOTE: u16 = 1 << 9;
/// The bit of a statusword that says that the target is not taken for a limit.
pub const LIMITED: u16 = 1 << 11;
/// The bit of a statusword that says, in a cyclic mode, that the drive follows its target.
pub const FOLLOWS: u16 = 1 << 12;
