//! The plant's node as one or two CANopen drives in cyclic synchronous torque mode (CiA 301 v4.2, CiA 402-2).
//!
//! Targets pass the same gate as the commands of Resonarm's protocol. Those of all enabled drives are combined
//! into one load, which is judged once per sample, or in lockstep at SYNC; a rejected one is counted and never
//! acts. A drive acts only on targets that it has received since it was enabled.
//!
//! The plant is operational while a drive is in operation enabled. A fault stops all drives, each of which
//! sends an emergency and stays in fault until its own fault reset. Only controlwords enable a drive.
//!
//! In lockstep a SYNC answers the last published sample: what the drives received before it acts from that
//! sample on, and the PDOs that it requests are sent with the next sample. While no drive is enabled they are
//! sent at once.

mod axis;
mod master;
mod spec;
#[cfg(test)]
mod tests;

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::cause::RefusedFor;
use super::guard::Guard;
use super::interface::{PlantInterface, PublishError, PublishedSample};
use super::time_base::TimeBase;
use crate::rig::{Exciter, GateSpec, Load};
use crate::structure::{States, joint_channel_name};
use axis::Axis;
pub use master::Cia402Exciter;
use resonarm_protocol::node::{FrameCheck, FrameFault, NodeCore, Timing};
use resonarm_protocol::{Emergency, EmergencyCode, Frame, Node, NodeState, OperatorRequest, Refusal, StateEvent, Trip};
use resonarm_wire::canopen::dictionary::at;
use resonarm_wire::canopen::{Handled, Server};
pub use spec::{Cia402Spec, DriveSpec, TORQUE_MODE};

/// Returns the error code of a fault, for emergencies and object 603F (CiA 301, table 26; CiA 402-2).
///
/// | fault | code |
/// | --- | --- |
/// | no target in time | 8250: RPDO timeout |
/// | a heartbeat that a drive watches was lost | 8130: heartbeat error |
/// | the bus was lost, or took no frames | 8100: communication |
/// | a second SYNC for one sample, in lockstep | 8200: protocol error |
/// | the exciter tripped | FF01 |
/// | ticks were missed | FF02 |
/// | the simulation failed | 6100: internal software |
/// | others | 1000: generic error |
pub const fn error_code(code: EmergencyCode) -> u16 {
    match code {
        EmergencyCode::CommandTimeout => 0x8250,
        EmergencyCode::HeartbeatLost => 0x8130,
        EmergencyCode::BusLoss => 0x8100,
        EmergencyCode::SampleSequence => 0x8200,
        EmergencyCode::ExciterTripped => 0xFF01,
        EmergencyCode::Overrun => 0xFF02,
        EmergencyCode::SimulationFailed => 0x6100,
        _ => 0x1000,
    }
}

/// Returns the error register (object 1001): bit 0 for any error, 4 for communication errors, 7 for Resonarm's
/// own.
const fn error_register(code: u16) -> u8 {
    match code >> 12 {
        0x8 => 0x11,
        0xF => 0x81,
        _ => 0x01,
    }
}

#[derive(Clone, Debug)]
struct Drive {
    server: Server,
    axis: Axis,
}

impl Drive {
    /// Shows the state of the drive in the object dictionary.
    fn show(&mut self) {
        let code = self.axis.fault.map_or(0, error_code);
        let register = if code == 0 { 0 } else { error_register(code) };
        // A fault that has gone is announced by an emergency with code 0 (CiA 301), once.
        let is_over = code == 0 && self.server.dictionary().number(at(0x603F, 0)) != 0;
        self.server.set_register(register);
        for (index, number) in [
            (0x603F, f64::from(code)),
            (0x6041, f64::from(self.axis.statusword())),
            (0x6061, f64::from(self.axis.mode)),
        ] {
            self.server.set(at(index, 0), number);
        }
        if is_over {
            self.server.emergency(0, self.server.register(), [0; 5]);
        }
    }

    /// Shows position, velocity and the torque that acted up to the sample in the object dictionary.
    fn measure(&mut self, states: &States, held: &Load) -> Result<(), PublishError> {
        let spec = self.axis.spec;
        let joint = self.axis.spec.joint;
        let moved = [(states.coordinates(), false), (states.rates(), true)].map(|(of_joints, is_rate)| {
            let got = of_joints.get(joint).copied().unwrap_or(f64::NAN);
            if got.is_finite() {
                Ok(got)
            } else {
                Err(PublishError::NotFinite { name: joint_channel_name(joint, is_rate), got })
            }
        });
        let [angle_rad, rate_rad_s] = [moved[0]?, moved[1]?];
        // The torque that has acted up to the sample, as a drive would measure it, and not the one that is held
        // next.
        let torque_nm = held.torque_nm[joint];
        self.server.set(at(0x6064, 0), angle_rad * spec.counts_per_rad());
        self.server.set(at(0x606C, 0), rate_rad_s * spec.counts_per_rad());
        self.server.set(at(0x6077, 0), torque_nm / spec.torque_step_nm());
        Ok(())
    }

    fn load(&self, torque_nm: f64) -> Load {
        Load::at_joint(self.axis.spec.joint, torque_nm)
    }
}

/// The plant as CANopen drives.
#[derive(Clone, Debug)]
pub struct Cia402Node {
    drives: Vec<Drive>,
    timeout_ns: u64,
    time_base: TimeBase,
    core: NodeCore,
    guard: Guard,
    /// Time of the last call that stated one, ns.
    now_ns: u64,
    /// Whether the last published sample has its answer, in lockstep.
    is_synced: bool,
    /// Load from the sample before to the last published one.
    held: Load,
}

impl Cia402Node {
    /// Returns a node that publishes `rate_hz` samples per second, for an exciter with these limits and those
    /// of the gate.
    pub fn new(
        spec: &Cia402Spec,
        (rate_hz, time_base): (u16, TimeBase),
        timing: Timing,
        exciter: Exciter,
        limits: GateSpec,
    ) -> Cia402Node {
        let timeout_ns = if time_base == TimeBase::Clock { spec.timeout_ns } else { timing.command_timeout_ns };
        let drive = |drive: &DriveSpec| Drive {
            server: Server::new(drive.node_id, drive.dictionary(), timeout_ns),
            axis: Axis::new(*drive),
        };
        Cia402Node {
            drives: spec.drives.iter().map(drive).collect(),
            timeout_ns,
            time_base,
            core: NodeCore::new(&timing),
            guard: Guard::new(rate_hz, &timing, exciter, limits),
            now_ns: 0,
            is_synced: false,
            held: Load::default(),
        }
    }

    fn look(&mut self, now_ns: u64) {
        self.core.listening.look(now_ns);
        self.now_ns = now_ns;
        let listened_ns = self.core.listening.listened_ns();
        self.drives.iter_mut().for_each(|drive| drive.server.look(listened_ns));
    }

    /// Lets the plant's state and the load follow the states of the drives, and shows them in the object
    /// dictionaries.
    fn settle(&mut self) {
        // Counted, where `any` would stop at the first drive and leave the marks of the others for the next call.
        let is_stopped = self.drives.iter_mut().filter_map(|drive| drive.axis.take_stopped().then_some(())).count() > 0;
        let is_any_enabled = self.drives.iter().any(|drive| drive.axis.is_enabled());
        // Each drive leaves its fault by its own reset. The plant leaves its own with the first of them, since that
        // drive may be enabled again.
        if self.state() == NodeState::Fault && self.drives.iter().any(|drive| !drive.axis.state().is_fault()) {
            self.core.turn(StateEvent::Reset);
        }
        if is_any_enabled && self.state() == NodeState::PreOperational {
            self.guard.arm(&mut self.core);
        } else if !is_any_enabled && self.is_armed() {
            self.guard.disarm(&mut self.core);
        } else if is_stopped && self.is_armed() {
            // Other drives are still enabled, or this one halts. Its torque drops at once, as that of a motor
            // without current.
            self.guard.reduce(self.sum(|axis| axis.acting_nm));
        }
        let listening = self.core.listening;
        let is_reaction_over = self.guard.ramp_left() == 0;
        for drive in &mut self.drives {
            drive.axis.restart(&listening);
            if is_reaction_over {
                drive.axis.end_reaction();
            }
            drive.show();
        }
        self.core.counts.unsent = self.drives.iter().map(|drive| drive.server.unsent()).sum();
        self.core.counts.overwritten = self.drives.iter().map(|drive| drive.axis.overwritten).sum();
        if self.waiting() > 0 {
            self.core.frame_waits();
        }
    }

    fn sum(&self, of: impl Fn(&Axis) -> f64) -> Load {
        self.drives.iter().fold(Load::default(), |sum, drive| sum + drive.load(of(&drive.axis)))
    }

    /// Judges the received targets as the answer to the last published sample.
    fn judge(&mut self, now_ns: u64) {
        if self.guard.is_answered() || !self.drives.iter().any(|drive| drive.axis.is_new()) {
            return;
        }
        let index = self.guard.sample as u16;
        let load = self.sum(Axis::share_nm);
        let state = self.state();
        let outcome = self.guard.take(&mut self.core, state, index, load);
        let listening = self.core.listening;
        // A cause of a later timeout is forgotten only if every enabled drive got a target: one drive may still
        // be starving.
        if outcome.is_ok() && self.drives.iter().all(|drive| drive.axis.is_new() || !drive.axis.is_enabled()) {
            self.guard.heeded();
        }
        self.drives.iter_mut().for_each(|drive| drive.axis.judged(outcome.is_ok(), &listening));
        if outcome == Err(Refusal::Travel) {
            self.fault(now_ns, EmergencyCode::ExciterTripped, Trip::Travel as u16);
        }
    }

    fn synchronise(&mut self, now_ns: u64, was_armed: bool) {
        // A second SYNC for one sample would answer the next sample before it is published, and shift all later
        // answers.
        if self.time_base == TimeBase::Lockstep && was_armed && self.is_armed() {
            if self.is_synced {
                return self.fault(now_ns, EmergencyCode::SampleSequence, self.guard.sample as u16);
            }
            self.judge(now_ns);
            self.is_synced = true;
        } else {
            self.drives.iter_mut().for_each(|drive| drive.server.release(now_ns));
        }
    }
}

impl PlantInterface for Cia402Node {
    fn core(&self) -> &NodeCore {
        &self.core
    }

    fn core_mut(&mut self) -> &mut NodeCore {
        &mut self.core
    }

    fn guard(&self) -> &Guard {
        &self.guard
    }

    fn waiting(&self) -> usize {
        self.drives.iter().map(|drive| drive.server.waiting()).sum()
    }

    fn start(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
        self.drives.iter_mut().for_each(|drive| drive.server.boot(now_ns));
        self.core.start(now_ns);
        self.settle();
    }

    fn is_answered(&self) -> bool {
        match self.time_base {
            TimeBase::Clock => self.guard.is_answered(),
            TimeBase::Lockstep => self.is_synced,
        }
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        self.look(now_ns);
        // Whether the plant was armed is asked before the frame acts: a SYNC that enables the first drive, by a
        // controlword that waited for it, answers no sample.
        let was_armed = self.is_armed();
        let mut is_sync = false;
        let mut refused = None;
        let mut is_other_sender = false;
        for place in 0..self.drives.len() {
            let Drive { server, axis } = &mut self.drives[place];
            match server.handle_frame(now_ns, frame, axis) {
                Handled::Foreign | Handled::Taken => {}
                Handled::Sync => is_sync = true,
                Handled::Nmt(command) => axis.manage(command),
                Handled::Length => {
                    refused = Some((FrameCheck::Length, RefusedFor::CanOpen(FrameCheck::Length)));
                }
                Handled::ShortPdo { number, mapped } => {
                    refused = Some((FrameCheck::Length, RefusedFor::ShortPdo { number, mapped }));
                }
                Handled::Format => {
                    refused = Some((FrameCheck::Format, RefusedFor::CanOpen(FrameCheck::Format)));
                }
                Handled::OtherSender => is_other_sender = true,
            }
            for _ in 0..self.drives[place].server.take_dropped() {
                self.guard.refuse(&mut self.core, Refusal::Late);
            }
        }
        // A frame counts once, even if it concerns several drives.
        if let Some((check, why)) = refused {
            self.core.reject(FrameFault::Mapped { id: frame.id(), check });
            self.guard.unheeded.refuse(frame, why);
        }
        if is_other_sender {
            self.core.reject_sender(frame.id());
        }
        self.settle();
        // States are settled before SYNC acts: a drive that this frame has enabled takes part.
        if is_sync {
            self.synchronise(now_ns, was_armed);
            self.settle();
        }
    }

    /// Executes an operator's request. Only a master enables drives, so an operator can disarm them and reset
    /// faults.
    fn execute(&mut self, now_ns: u64, request: OperatorRequest) {
        self.look(now_ns);
        match request {
            OperatorRequest::Arm => {}
            OperatorRequest::Disarm => self.drives.iter_mut().for_each(|drive| drive.axis.disable()),
            OperatorRequest::Reset => self.drives.iter_mut().for_each(|drive| drive.axis.reset()),
        }
        self.settle();
    }

    fn handle_deadline(&mut self, now_ns: u64) {
        self.look(now_ns);
        if self.time_base == TimeBase::Clock {
            self.judge(now_ns);
        }
        self.drives.iter_mut().for_each(|drive| drive.server.handle_deadline(now_ns));
        self.settle();
        let listening = self.core.listening;
        let lost =
            |drive: &mut Drive| drive.server.takes_heartbeat_loss(|since, time| listening.has_passed(since, time));
        // Counted for the same reason as in `settle`: every drive must take its loss.
        if self.drives.iter_mut().filter_map(|drive| lost(drive).then_some(())).count() > 0 {
            self.fault(now_ns, EmergencyCode::HeartbeatLost, u16::from(Node::Exciter.number()));
        }
        if !self.is_armed() {
            return;
        }
        if self.core.is_jammed() {
            self.fault(now_ns, EmergencyCode::BusLoss, self.core.not_sent(self.waiting()));
        } else if self.drives.iter().any(|drive| drive.axis.is_timed_out(self.timeout_ns, &listening)) {
            self.fault(now_ns, EmergencyCode::CommandTimeout, self.guard.timeout_detail());
        }
    }

    fn next_deadline_ns(&self) -> u64 {
        let timers = self.drives.iter().filter_map(|drive| drive.server.next_deadline_ns());
        let timeout = |drive: &Drive| drive.axis.deadline_ns(self.timeout_ns, &self.core.listening);
        let watched = self.drives.iter().flat_map(|drive| drive.server.watched_heartbeats());
        let heartbeats = watched.map(|(heard_ns, time_ns)| self.core.listening.next_look_ns(heard_ns, time_ns));
        timers.chain(self.drives.iter().filter_map(timeout)).chain(heartbeats).min().unwrap_or(u64::MAX)
    }

    fn publish(&mut self, sample: &PublishedSample) -> Result<(), PublishError> {
        let PublishedSample { measurement, states, travel_m } = sample;
        self.guard.measured(measurement.sample, *travel_m);
        self.is_synced = false;
        let held = self.held;
        let now_ns = self.now_ns;
        for drive in &mut self.drives {
            drive.measure(states, &held)?;
            drive.server.sampled(now_ns);
            drive.server.release(now_ns);
        }
        self.settle();
        Ok(())
    }

    fn load(&mut self) -> Load {
        self.held = self.guard.load();
        self.held
    }

    fn fault(&mut self, _now_ns: u64, code: EmergencyCode, detail: u16) {
        let Some(Emergency { sample, .. }) = self.guard.fault(&mut self.core, code, detail) else { return };
        let [a, b] = detail.to_le_bytes();
        let [c, d] = sample.to_le_bytes();
        let number = error_code(code);
        for drive in &mut self.drives {
            drive.axis.fail(code);
            // CiA 301 leaves five bytes to the manufacturer: here detail and index of the sample, low byte first.
            drive.server.emergency(number, error_register(number), [a, b, c, d, 0]);
        }
        self.settle();
    }

    fn leave(&mut self, now_ns: u64) {
        self.look(now_ns);
        self.drives.iter_mut().for_each(|drive| drive.axis.leave());
        self.settle();
    }

    fn waiting_frames(&mut self, most: usize, frames: &mut Vec<Frame>) {
        self.drives.iter().for_each(|drive| drive.server.frames(most, frames));
    }

    fn frame_sent(&mut self) {
        if let Some(drive) = self.drives.iter_mut().find(|drive| drive.server.waiting() > 0) {
            self.core.counts.limited_values += drive.server.sent();
        }
        self.core.frame_sent(self.waiting() > 0);
    }

    fn boxed_clone(&self) -> Box<dyn PlantInterface> {
        Box::new(self.clone())
    }
}
