//! A drive beside its communication: its state, its mode, the target that waits and the torque that acts.

use super::spec::{DriveSpec, TORQUE_MODE};
use resonarm_protocol::EmergencyCode;
use resonarm_protocol::node::Listening;
use resonarm_wire::canopen::cia402::{Command, DriveState, FOLLOWS, LIMITED, REMOTE, VOLTAGE, halts};
use resonarm_wire::canopen::dictionary::{Address, Value};
use resonarm_wire::canopen::{Abort, Device, NmtCommand};

/// A drive as a master commands it.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    spec: DriveSpec,
    state: DriveState,
    controlword: u16,
    mode: i8,
    /// The target received last, until it is judged, N·m at the joint.
    pending_nm: Option<f64>,
    /// Its share of the load that is held, N·m at the joint.
    acting_nm: f64,
    /// Whether that share has become zero since [`Axis::take_stopped`].
    is_stopped: bool,
    /// Whether it has been enabled since [`Axis::restart`].
    is_newly_enabled: bool,
    /// Whether the target judged last was refused.
    is_limited: bool,
    /// Whether it may not be enabled any more.
    is_leaving: bool,
    /// When a target was taken last, or the drive was enabled, in time listened.
    taken_ns: u64,
    fault: Option<EmergencyCode>,
    /// Counts the changes of state, mode and fault: a target received before one never acts after it.
    epoch: u32,
    /// Targets that newer ones replaced before they were judged.
    overwritten: u64,
}

impl Axis {
    /// A drive that is switched off.
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

    pub fn spec(&self) -> &DriveSpec {
        &self.spec
    }

    pub fn state(&self) -> DriveState {
        self.state
    }

    pub fn is_enabled(&self) -> bool {
        self.state == DriveState::OperationEnabled
    }

    /// Targets that newer ones replaced before they were judged.
    pub fn overwritten(&self) -> u64 {
        self.overwritten
    }

    pub fn mode(&self) -> i8 {
        self.mode
    }

    /// The fault that is latched.
    pub fn fault_code(&self) -> Option<EmergencyCode> {
        self.fault
    }

    /// Whether targets act.
    fn follows(&self) -> bool {
        self.is_enabled() && self.mode == TORQUE_MODE && !halts(self.controlword)
    }

    /// The statusword (object 6041).
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
            if self.is_leaving {
                return;
            }
            self.is_newly_enabled = true;
        }
        self.is_limited = false;
        self.state = to;
        self.begin_epoch();
        self.stop();
    }

    /// Targets that were received before now never act.
    fn begin_epoch(&mut self) {
        self.epoch = self.epoch.wrapping_add(1);
        self.pending_nm = None;
    }

    /// The target that waits is forgotten, and what acts acts no more.
    fn stop(&mut self) {
        self.pending_nm = None;
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

    /// Switches the drive off; a fault stays.
    pub fn disable(&mut self) {
        self.go(self.state.after(Command::DisableVoltage));
    }

    /// As a rising bit 7 of the controlword.
    pub fn reset(&mut self) {
        if self.state == DriveState::Fault {
            self.fault = None;
            self.go(DriveState::SwitchOnDisabled);
        }
    }

    /// Network management: a drive whose PDOs stop is switched off, and one that starts again is as after power-on.
    pub fn manage(&mut self, command: NmtCommand) {
        if command != NmtCommand::Start {
            self.disable();
        }
        if command == NmtCommand::ResetNode {
            self.reset();
            (self.controlword, self.mode) = (0, 0);
            self.begin_epoch();
        }
    }

    /// Faults; the reaction lasts until [`Axis::end_reaction`].
    pub fn fail(&mut self, code: EmergencyCode) {
        self.fault = Some(code);
        self.begin_epoch();
        self.go(DriveState::FaultReactionActive);
    }

    /// The load of a fault has become zero.
    pub fn end_reaction(&mut self) {
        if self.state == DriveState::FaultReactionActive {
            self.state = DriveState::Fault;
            self.begin_epoch();
        }
    }

    /// Is not enabled any more.
    pub fn leave(&mut self) {
        self.is_leaving = true;
        self.disable();
    }

    /// Whether its share of the load has become zero by itself since the last call.
    pub fn take_stopped(&mut self) -> bool {
        core::mem::take(&mut self.is_stopped)
    }

    /// Targets of a drive that has been enabled are awaited from now on.
    pub fn restart(&mut self, listening: &Listening) {
        if core::mem::take(&mut self.is_newly_enabled) {
            self.taken_ns = listening.listened_ns();
        }
    }

    /// Whether a target waits to be judged.
    pub fn is_new(&self) -> bool {
        self.pending_nm.is_some()
    }

    /// Its share of the load that acts, N·m at the joint.
    pub fn acting_nm(&self) -> f64 {
        self.acting_nm
    }

    /// Its share of the load that is judged, N·m at the joint.
    pub fn share_nm(&self) -> f64 {
        match self.pending_nm {
            _ if !self.follows() => 0.0,
            Some(target_nm) => target_nm,
            None => self.acting_nm,
        }
    }

    /// The target that waited has been judged.
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

    /// Whether it is enabled and no target has been taken for `timeout_ns`.
    pub fn is_timed_out(&self, timeout_ns: u64, listening: &Listening) -> bool {
        self.is_enabled() && listening.has_passed(self.taken_ns, timeout_ns)
    }

    /// When to check that next, ns.
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
                if core::mem::replace(&mut self.mode, mode) != mode {
                    self.begin_epoch();
                }
                if !self.follows() {
                    self.stop();
                }
            }
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
