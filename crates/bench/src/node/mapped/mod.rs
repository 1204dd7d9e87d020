//! The plant's node on a user's own protocol: its messages are mapped to loads, requests and readings.
//!
//! Commands pass the same gate as those of Resonarm's protocol. They have no index, so the newest frames count as the
//! answer to the sample published last, and are judged together, once a sample. What a command does not say keeps the
//! share of the load that was taken last, for as long as that is valid.
//!
//! A drive is armed by its messages; the plant is operational as long as one drive is armed. A fault disarms all of them,
//! and none is armed again but by a message.

mod incoming;
pub mod mapping;
mod outgoing;

use alloc::vec;
use alloc::vec::Vec;

use super::guard::Guard;
use super::interface::{FrameCheck, FrameCounts, FrameFault, PlantInterface, PublishError, PublishedSample, WireEvent};
use super::{Refusal, Refusals, Timing};
use crate::rig::{Exciter, GateSpec};
use crate::structure::OUTPUTS;
use incoming::{Receiver, plus};
use mapping::{Action, Arming, Lockstep, Mapping, Trigger, Values};
use outgoing::{Said, Sender};
use resonarm_dynamics::arm::Load;
use resonarm_protocol::node::{Listening, Queue};
use resonarm_protocol::{
    Emergency, EmergencyCode, Frame, FrameFormat, Id, Node, NodeState, OperatorRequest, StateEvent, Trip,
};

/// Most events that wait to be fetched.
const EVENTS: usize = 64;

/// When commands are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// At the deadline of each sample; each message has its own timeout.
    Clock,
    /// When the sample published last has its answer; the timeout is that of the run.
    Lockstep,
}

/// The plant as a node of a user's protocol.
#[derive(Clone, Debug)]
pub struct MappedNode {
    receivers: Vec<Receiver>,
    senders: Vec<Sender>,
    arming: Arming,
    lockstep: Lockstep,
    pace: Pace,
    timing: Timing,
    exciter: Exciter,
    guard: Guard,
    state: NodeState,
    /// Whether each drive is armed.
    drives: Vec<bool>,
    listening: Listening,
    /// Whether the plant was armed by a first command, or is not to be any more.
    has_begun: bool,
    /// In lockstep by [`Lockstep::Sync`]: whether the sample published last has its answer.
    is_synced: bool,
    is_leaving: bool,
    jammed_since_ns: Option<u64>,
    values: Values,
    fault: Option<Emergency>,
    events: Queue<WireEvent, EVENTS>,
    frames: FrameCounts,
}

impl MappedNode {
    /// A node that publishes `rate_hz` samples a second for an exciter of these limits and those of its gate.
    pub fn new(
        mapping: Mapping,
        (rate_hz, pace): (u16, Pace),
        timing: Timing,
        exciter: Exciter,
        limits: GateSpec,
    ) -> MappedNode {
        let mut guard = Guard::new(rate_hz, &timing, exciter);
        guard.set_limits(limits);
        let of_messages = mapping.incoming.iter().map(|message| message.drive);
        let drives = of_messages.chain(mapping.outgoing.iter().map(|message| message.drive)).max();
        MappedNode {
            receivers: mapping.incoming.into_iter().map(Receiver::new).collect(),
            senders: mapping.outgoing.into_iter().map(Sender::new).collect(),
            arming: mapping.arming,
            lockstep: mapping.lockstep,
            pace,
            timing,
            exciter,
            guard,
            state: NodeState::BootUp,
            drives: vec![false; drives.map_or(1, |last| last + 1)],
            listening: Listening::new(timing.look_period_ns),
            has_begun: false,
            is_synced: false,
            is_leaving: false,
            jammed_since_ns: None,
            values: Values::default(),
            fault: None,
            events: Queue::new(),
            frames: FrameCounts::default(),
        }
    }

    fn transition(&mut self, event: StateEvent) -> bool {
        let Some(to) = self.state.next(event) else { return false };
        let from = core::mem::replace(&mut self.state, to);
        self.events.push(WireEvent::State { from, to });
        true
    }

    /// Leaves the state; from armed, the load ramps to zero.
    fn exit(&mut self, event: StateEvent) {
        if self.is_armed() {
            self.guard.release();
        }
        self.drives.fill(false);
        self.transition(event);
    }

    fn refuse_frame(&mut self, id: Id, check: FrameCheck) {
        self.frames.refused += 1;
        self.events.push(WireEvent::Frame(FrameFault::Mapped { id, check }));
    }

    /// A frame with an identifier that the plant sends: a request, or another sender.
    fn handle_own(&mut self, sender: usize, frame: &Frame) {
        let message = &self.senders[sender].message;
        let asks = frame.format() == FrameFormat::Remote || frame.data().is_empty();
        if asks && message.is_on_request {
            self.queue(sender);
        } else if !asks {
            self.frames.other_sender += 1;
            self.events.push(WireEvent::OtherSender(frame.id()));
        }
    }

    /// Handles a frame of a message that the plant takes.
    fn handle_message(&mut self, now_ns: u64, index: usize, frame: &Frame) -> Result<(), FrameCheck> {
        self.receivers[index].check(frame)?;
        for event in 0..self.receivers[index].message.events.len() {
            if let Some(action) = self.receivers[index].action(event, frame.data())? {
                self.act(now_ns, Some(self.receivers[index].message.drive), action);
            }
        }
        let waits_for_set = self.waits_for_set();
        let receiver = &mut self.receivers[index];
        if receiver.is_command() {
            let is_second = receiver.is_new() && waits_for_set;
            if receiver.receive(frame.data())? && is_second {
                self.guard.refuse(Refusal::Repeated);
                self.events.push(WireEvent::Refused(Refusal::Repeated));
                self.fault(now_ns, EmergencyCode::SampleSequence, self.values.sample as u16);
            }
        }
        if self.receivers[index].message.is_sync {
            self.synchronise(now_ns);
        }
        if self.waits_for_set() && self.has_set() {
            self.judge(now_ns);
        }
        Ok(())
    }

    /// Whether commands are judged as soon as there is one of each armed drive.
    fn waits_for_set(&self) -> bool {
        self.pace == Pace::Lockstep && self.lockstep == Lockstep::Command && self.is_armed()
    }

    fn has_set(&self) -> bool {
        let drives = &self.drives;
        let mut commands = self.receivers.iter().filter(|receiver| receiver.is_command());
        commands.all(|receiver| receiver.is_new() || !drives[receiver.message.drive])
    }

    fn synchronise(&mut self, now_ns: u64) {
        if self.pace == Pace::Lockstep && self.lockstep == Lockstep::Sync && self.is_armed() {
            if self.is_synced {
                return self.fault(now_ns, EmergencyCode::SampleSequence, self.values.sample as u16);
            }
            self.judge(now_ns);
            self.is_synced = true;
        } else {
            self.queue_all(Trigger::Sync);
        }
    }

    fn act(&mut self, now_ns: u64, drive: Option<usize>, action: Action) {
        match action {
            Action::Arm if !self.is_leaving => self.arm(drive),
            Action::Arm => {}
            Action::Disarm => self.disarm(drive),
            Action::Reset => {
                if self.transition(StateEvent::Reset) {
                    self.fault = None;
                }
            }
            Action::Stop => self.fault(now_ns, EmergencyCode::PartnerFault, u16::from(Node::Exciter.number())),
        }
    }

    /// Arms a drive, or all.
    fn arm(&mut self, drive: Option<usize>) {
        if !matches!(self.state, NodeState::PreOperational | NodeState::Operational) {
            return;
        }
        if self.state == NodeState::PreOperational {
            self.guard.arm(&self.listening);
            self.transition(StateEvent::Arm);
        }
        self.has_begun = true;
        let is_meant = |number: usize| drive.is_none_or(|drive| drive == number);
        let (drives, listening) = (&self.drives, &self.listening);
        let mut newly = self.receivers.iter_mut().filter(|receiver| {
            let number = receiver.message.drive;
            is_meant(number) && !drives[number]
        });
        newly.by_ref().for_each(|receiver| receiver.restart(listening));
        (0..self.drives.len()).filter(|number| is_meant(*number)).for_each(|number| self.drives[number] = true);
    }

    /// Disarms a drive, or all. With the last the load ramps to zero; that of a drive beside others is dropped, as that of
    /// a motor without current is.
    fn disarm(&mut self, drive: Option<usize>) {
        let is_meant = |number: usize| drive.is_none_or(|drive| drive == number);
        if !self.is_armed() || !(0..self.drives.len()).any(|number| is_meant(number) && self.drives[number]) {
            return;
        }
        if self.drives.iter().enumerate().all(|(number, armed)| !armed || is_meant(number)) {
            return self.exit(StateEvent::Disarm);
        }
        (0..self.drives.len()).filter(|number| is_meant(*number)).for_each(|number| self.drives[number] = false);
        let listening = &self.listening;
        let stopped = self.receivers.iter_mut().filter(|receiver| is_meant(receiver.message.drive));
        stopped.for_each(|receiver| receiver.restart(listening));
        self.guard.reduce(self.shares());
    }

    /// The sum of all armed drives' shares of the load.
    fn shares(&self) -> Load {
        let armed = self.receivers.iter().filter(|receiver| self.drives[receiver.message.drive]);
        armed.fold(Load::default(), |sum, receiver| plus(sum, receiver.share()))
    }

    /// Judges the loads that were received, as the answer to the sample published last.
    fn judge(&mut self, now_ns: u64) {
        if !self.receivers.iter().any(Receiver::is_new) {
            return;
        }
        if self.arming == Arming::ZeroCommand && !self.has_begun && self.is_nearly_zero() {
            return self.arm(None);
        }
        let is_ready =
            self.receivers.iter().all(|receiver| receiver.is_ready() || !self.drives[receiver.message.drive]);
        let state = if is_ready { self.state } else { NodeState::PreOperational };
        let index = self.guard.sample() as u16;
        let outcome = self.guard.take(state, &self.listening, index, self.shares());
        let listening = &self.listening;
        self.receivers.iter_mut().for_each(|receiver| receiver.judged(outcome.is_ok(), listening));
        if let Err(refusal) = outcome {
            self.events.push(WireEvent::Refused(refusal));
            if refusal == Refusal::Travel {
                self.fault(now_ns, EmergencyCode::ExciterTripped, Trip::Travel as u16);
            }
        }
    }

    /// Whether the loads received are within a hundredth of the exciter's limits.
    fn is_nearly_zero(&self) -> bool {
        let load = self.receivers.iter().fold(Load::default(), |sum, receiver| plus(sum, receiver.share()));
        let ((force_n, torque_nm), (force_limit_n, torque_limit_nm)) =
            (self.exciter.size(&load), self.exciter.limits());
        force_n <= 0.01 * force_limit_n && torque_nm <= 0.01 * torque_limit_nm
    }

    fn queue(&mut self, sender: usize) {
        if !self.senders[sender].queue() {
            self.frames.unsent += 1;
        }
        self.jammed_since_ns.get_or_insert(self.listening.listened_ns());
    }

    fn queue_all(&mut self, trigger: Trigger) {
        for sender in 0..self.senders.len() {
            if self.senders[sender].message.trigger == trigger {
                self.queue(sender);
            }
        }
    }

    fn said(&self, drive: usize) -> Said {
        let is_idle = self.state == NodeState::Operational && !self.drives[drive];
        let state = if is_idle { NodeState::PreOperational } else { self.state };
        Said { state, fault: self.latched_fault() }
    }

    fn timeout_ns(&self, receiver: &Receiver) -> u64 {
        match self.pace {
            Pace::Clock => receiver.message.timeout_ns,
            Pace::Lockstep => self.timing.command_timeout_ns,
        }
    }

    /// The command messages of armed drives.
    fn awaited(&self) -> impl Iterator<Item = &Receiver> {
        self.receivers.iter().filter(|receiver| receiver.is_command() && self.drives[receiver.message.drive])
    }

    fn not_sent(&self) -> u16 {
        let waiting = self.senders.iter().filter(|sender| sender.waits()).count() as u64;
        u16::try_from(self.frames.unsent.saturating_add(waiting)).unwrap_or(u16::MAX)
    }
}

impl PlantInterface for MappedNode {
    fn start(&mut self, now_ns: u64) {
        self.listening.start(now_ns);
        self.transition(StateEvent::Started);
    }

    fn state(&self) -> NodeState {
        self.state
    }

    fn is_answered(&self) -> bool {
        match self.lockstep {
            Lockstep::Command => self.guard.is_answered(),
            Lockstep::Sync => self.is_synced,
        }
    }

    fn is_ramping(&self) -> bool {
        self.guard.ramp_left() > 0
    }

    fn latched_fault(&self) -> Option<Emergency> {
        self.fault.filter(|_| self.state == NodeState::Fault)
    }

    fn fault_reason(&self) -> Option<Emergency> {
        None
    }

    fn take_echoed(&mut self) -> Option<u16> {
        None
    }

    fn holds_sample(&self) -> bool {
        false
    }

    fn refusals(&self) -> &Refusals {
        self.guard.refusals()
    }

    fn frames(&self) -> FrameCounts {
        self.frames
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        self.listening.look(now_ns);
        if let Some(sender) = self.senders.iter().position(|sender| sender.message.id == frame.id()) {
            return self.handle_own(sender, frame);
        }
        let Some(index) = self.receivers.iter().position(|receiver| receiver.message.id == frame.id()) else { return };
        if frame.format() == FrameFormat::Remote {
            return;
        }
        if let Err(check) = self.handle_message(now_ns, index, frame) {
            self.refuse_frame(frame.id(), check);
        }
    }

    fn execute(&mut self, now_ns: u64, request: OperatorRequest) {
        self.act(
            now_ns,
            None,
            match request {
                OperatorRequest::Arm => Action::Arm,
                OperatorRequest::Disarm => Action::Disarm,
                OperatorRequest::Reset => Action::Reset,
            },
        );
    }

    fn handle_deadline(&mut self, now_ns: u64) {
        self.listening.look(now_ns);
        if self.pace == Pace::Clock || !self.is_armed() {
            self.judge(now_ns);
        }
        for sender in 0..self.senders.len() {
            if self.senders[sender].take_due(now_ns) {
                self.queue(sender);
            }
        }
        if !self.is_armed() {
            return;
        }
        let (listening, timeout_ns) = (&self.listening, self.timing.command_timeout_ns);
        if self.jammed_since_ns.is_some_and(|since_ns| listening.has_passed(since_ns, timeout_ns)) {
            self.fault(now_ns, EmergencyCode::BusLoss, self.not_sent());
        } else if self.awaited().any(|receiver| receiver.is_timed_out(self.timeout_ns(receiver), listening)) {
            self.fault(now_ns, EmergencyCode::CommandTimeout, self.guard.timeout_detail());
        }
    }

    fn next_deadline_ns(&self) -> u64 {
        let periodic = self.senders.iter().filter_map(Sender::due_ns).min();
        let command = self.awaited().map(|receiver| receiver.deadline_ns(self.timeout_ns(receiver), &self.listening));
        periodic.into_iter().chain(command).min().unwrap_or(u64::MAX)
    }

    fn publish(&mut self, sample: &PublishedSample) -> Result<(), PublishError> {
        let PublishedSample { measurement, states, travel_m } = sample;
        self.guard.measured(measurement.sample);
        self.guard.set_travel(*travel_m);
        self.is_synced = false;
        self.values.sample = measurement.sample;
        for (place, reading) in measurement.readings().iter().enumerate() {
            if !reading.value.is_finite() {
                return Err(PublishError::NotFinite { name: OUTPUTS[place].name, got: reading.value });
            }
            (self.values.readings[place], self.values.clipped[place]) = (reading.value, reading.clipped);
        }
        self.values.states.iter_mut().zip(*states).for_each(|(to, from)| *to = *from);
        for sender in 0..self.senders.len() {
            let is_due = match self.senders[sender].message.trigger {
                Trigger::Every(samples) => measurement.sample.is_multiple_of(samples),
                Trigger::Sync => self.pace == Pace::Lockstep && self.lockstep == Lockstep::Sync,
                Trigger::Period(_) | Trigger::Request => false,
            };
            if is_due {
                self.queue(sender);
            }
        }
        Ok(())
    }

    fn load(&mut self) -> Load {
        self.values.load = self.guard.load();
        self.values.load
    }

    fn fault(&mut self, _now_ns: u64, code: EmergencyCode, detail: u16) {
        debug_assert!(!code.is_notice(), "{code:?} is no fault");
        self.guard.fault(code);
        if self.state == NodeState::Fault {
            return;
        }
        let emergency = Emergency { node: Node::Plant, code, detail, sample: self.guard.sample() as u16 };
        self.fault = Some(emergency);
        self.has_begun = true;
        self.events.push(WireEvent::Emergency(emergency));
        self.exit(StateEvent::Fault);
    }

    fn bus_lost(&mut self, now_ns: u64) {
        if self.is_armed() {
            self.fault(now_ns, EmergencyCode::BusLoss, self.not_sent());
        }
    }

    fn leave(&mut self, _now_ns: u64) {
        self.is_leaving = true;
        if self.is_armed() {
            self.exit(StateEvent::Disarm);
        }
    }

    fn slip(&mut self, periods: u64) {
        let detail = u16::try_from(periods).unwrap_or(u16::MAX);
        let sample = self.guard.sample() as u16;
        let notice = Emergency { node: Node::Plant, code: EmergencyCode::ScheduleSlipped, detail, sample };
        self.events.push(WireEvent::Emergency(notice));
    }

    fn waiting_frames(&mut self, most: usize, frames: &mut Vec<Frame>) {
        for sender in 0..self.senders.len() {
            if frames.len() < most && self.senders[sender].waits() {
                let said = self.said(self.senders[sender].message.drive);
                frames.extend(self.senders[sender].frame(&self.values, &said));
            }
        }
    }

    fn frame_sent(&mut self) {
        if let Some(sender) = self.senders.iter_mut().find(|sender| sender.waits()) {
            self.frames.limited_values += sender.sent();
        }
        let is_waiting = self.senders.iter().any(Sender::waits);
        self.jammed_since_ns = is_waiting.then(|| self.listening.listened_ns());
    }

    fn poll_event(&mut self) -> Option<WireEvent> {
        self.events.pop()
    }
}
