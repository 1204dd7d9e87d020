//! A drive without its communication: state, mode, waiting target and acting torque.

use super::spec::{DriveSpec, TORQUE_MODE};
use resonarm_protocol::EmergencyCode;
use resonarm_protocol::node::Listening;
use resonarm_wire::canopen::cia402::{Command, DriveState, FOLLOWS, LIMITED, REMOTE, VOLTAGE, halts};
use resonarm_wire::canopen::dictionary::{Address, Value};
use resonarm_wire::canopen::{Abort, Device, NmtCommand};

/// A drive as a master commands it.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub spec: DriveSpec,
    state: DriveState,
    controlword: u16,
    pub mode: i8,
    /// Last received target until it is judged, N·m at the joint.
    pending_nm: Option<f64>,
    /// Part of the held load that the drive exerts, N·m at the joint.
    pub acting_nm: f64,
    /// Whether that part has become zero since [`Axis::take_stopped`].
    is_stopped: bool,
    /// Whether the drive has been enabled since [`Axis::restart`].
    is_newly_enabled: bool,
    /// Whether the last judged target was rejected.
    is_limited: bool,
    /// Whether the drive may no longer be enabled.
    is_leaving: bool,
    /// Time of the last accepted target, or of enabling, ns of time listened.
    taken_ns: u64,
    /// Latched fault.
    pub fault: Option<EmergencyCode>,
    /// Counter of changes of state, mode and fault: a target received before a change never acts after it.
    epoch: u32,
    /// Number of targets that newer ones replaced before they were judged.
    pub overwritten: u64,
}

impl Axis {
    /// Returns a drive that is switched off.
    pub fn new(spec: DriveSpec) -> Axis {
        Axis {
            spec,
            state: DriveState::SwitchOnDisabled,
            controlword: 0,
            mode: 0,
            pending_nm: None,
            acting_nm: 0.0,
            is_stopped: false,
            is_newly_enabled: false,
            is_limited: false,
            is_leaving: false,
            taken_ns: 0,
            fault: None,
            epoch: 0,
            overwritten: 0,
        }
    }

    pub fn state(&self) -> DriveState {
        self.state
    }

    pub fn is_enabled(&self) -> bool {
        self.state == DriveState::OperationEnabled
    }

    /// Returns whether targets act: enabled, in the torque mode, not halted.
    fn follows(&self) -> bool {
        self.is_enabled() && self.mode == TORQUE_MODE && !halts(self.controlword)
    }

    /// Returns the statusword (object 6041).
    pub fn statusword(&self) -> u16 {
        let follows = if self.follows() { FOLLOWS } else { 0 };
        let limited = if self.is_limited { LIMITED } else { 0 };
        self.state.bits() | VOLTAGE | REMOTE | follows | limited
    }

    fn go(&mut self, to: DriveState) {
        if to == self.state {
            return;
        }
        if to == DriveState::OperationEnabled {
            // A drive that is leaving stays off whatever the master commands.
            if self.is_leaving {
                return;
            }
            self.is_newly_enabled = true;
        }
        // The bit of the statusword is about the last target in this state, and no target has been judged in the new
        // one.
        self.is_limited = false;
        self.state = to;
        self.begin_epoch();
        self.stop();
    }

    /// Starts a new epoch: targets that were received before never act.
    fn begin_epoch(&mut self) {
        self.epoch = self.epoch.wrapping_add(1);
        self.pending_nm = None;
    }

    /// Forgets the waiting target, and ends the acting torque.
    fn stop(&mut self) {
        self.pending_nm = None;
        // Remembered until the node asks, since the drive may be enabled again before that.
        self.is_stopped |= self.acting_nm != 0.0;
        self.acting_nm = 0.0;
    }

    fn control(&mut self, controlword: u16) {
        let before = core::mem::replace(&mut self.controlword, controlword);
        let to = self.state.after(Command::of(before, controlword));
        if self.state.is_fault() && !to.is_fault() {
            self.fault = None;
        }
        self.go(to);
        if !self.follows() {
            self.stop();
        }
    }

    /// Switches the drive off; a fault remains latched.
    pub fn disable(&mut self) {
        self.go(self.state.after(Command::DisableVoltage));
    }

    /// Resets a fault, as a rising bit 7 of the controlword does.
    pub fn reset(&mut self) {
        if self.state == DriveState::Fault {
            self.fault = None;
            self.go(DriveState::SwitchOnDisabled);
        }
    }

    /// Follows network management: a drive whose PDOs stop is switched off, and one that is reset is as after
    /// power-on.
    pub fn manage(&mut self, command: NmtCommand) {
        if command != NmtCommand::Start {
            self.disable();
        }
        if command == NmtCommand::ResetNode {
            self.reset();
            self.controlword = 0;
            self.mode = 0;
            self.begin_epoch();
        }
    }

    /// Puts the axis into the fault state. Its reaction lasts until [`Axis::end_reaction`].
    pub fn fail(&mut self, code: EmergencyCode) {
        self.fault = Some(code);
        self.begin_epoch();
        self.go(DriveState::FaultReactionActive);
    }

    /// Ends the reaction to a fault, once the load has become zero.
    pub fn end_reaction(&mut self) {
        if self.state == DriveState::FaultReactionActive {
            self.state = DriveState::Fault;
            self.begin_epoch();
        }
    }

    /// Switches the drive off for good.
    pub fn leave(&mut self) {
        self.is_leaving = true;
        self.disable();
    }

    /// Returns whether its part of the load has become zero by itself since the last call.
    pub fn take_stopped(&mut self) -> bool {
        core::mem::take(&mut self.is_stopped)
    }

    /// Starts the timeout of a drive that has been enabled.
    pub fn restart(&mut self, listening: &Listening) {
        if core::mem::take(&mut self.is_newly_enabled) {
            self.taken_ns = listening.listened_ns();
        }
    }

    /// Returns whether a target waits to be judged.
    pub fn is_new(&self) -> bool {
        self.pending_nm.is_some()
    }

    /// Returns the part of the load that is judged: the waiting target, or what acts, N·m at the joint.
    pub fn share_nm(&self) -> f64 {
        match self.pending_nm {
            _ if !self.follows() => 0.0,
            Some(target_nm) => target_nm,
            None => self.acting_nm,
        }
    }

    /// Notes that the waiting target has been judged.
    pub fn judged(&mut self, is_taken: bool, listening: &Listening) {
        if is_taken {
            self.acting_nm = self.share_nm();
        }
        if self.pending_nm.take().is_some() {
            self.is_limited = !is_taken;
            if is_taken {
                self.taken_ns = listening.listened_ns();
            }
        }
    }

    /// Returns whether it is enabled and no target has been accepted for `timeout_ns`.
    pub fn is_timed_out(&self, timeout_ns: u64, listening: &Listening) -> bool {
        self.is_enabled() && listening.has_passed(self.taken_ns, timeout_ns)
    }

    /// Returns the time at which to check that next, ns.
    pub fn deadline_ns(&self, timeout_ns: u64, listening: &Listening) -> Option<u64> {
        self.is_enabled().then(|| listening.next_look_ns(self.taken_ns, timeout_ns))
    }
}

impl Device for Axis {
    fn write(&mut self, address: Address, value: Value) -> Result<(), Abort> {
        match (address.index, value) {
            (0x6040, Value::U16(controlword)) => self.control(controlword),
            (0x6060, Value::I8(mode)) => {
                if !matches!(mode, 0 | TORQUE_MODE) {
                    return Err(Abort::Value);
                }
                // A target that was received in another mode has another meaning.
                if core::mem::replace(&mut self.mode, mode) != mode {
                    self.begin_epoch();
                }
                if !self.follows() {
                    self.stop();
                }
            }
            // A target to a drive that is not enabled is stored in the dictionary and never acts.
            (0x6071, Value::I16(target)) if self.is_enabled() => {
                let target_nm = f64::from(target) * self.spec.torque_step_nm();
                self.overwritten += u64::from(self.pending_nm.replace(target_nm).is_some());
            }
            _ => {}
        }
        Ok(())
    }

    fn epoch(&self) -> u32 {
        self.epoch
    }
}
