//! The plant's node on a user protocol, whose messages are mapped to loads, requests and readings.
//!
//! Commands pass the same gate as those of Resonarm's protocol. They have no index, so the newest frames count
//! as the answer to the last published sample, and are judged together, once per sample. A message that has not
//! been repeated keeps its part of the load for the duration of its timeout.
//!
//! A drive is armed by its messages, and the plant is operational as long as one drive is armed. A fault
//! disarms all drives, and only a message arms one again.

pub mod exciter;
mod incoming;
pub mod mapping;
mod outgoing;
mod protection;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::cause::{FaultCause, RefusedFor};
use super::guard::Guard;
use super::interface::{PlantInterface, PublishError, PublishedSample};
use super::time_base::TimeBase;
use crate::rig::{Exciter, GateSpec, Load};
use crate::structure::{ChannelName, OUTPUTS};
use incoming::Receiver;
use mapping::{Action, Arming, Lockstep, Mapping, Trigger, Values};
use outgoing::{Sender, Status};
use resonarm_protocol::node::{FrameCheck, FrameFault, NodeCore, Timing};
use resonarm_protocol::{EmergencyCode, Frame, FrameFormat, NodeState, OperatorRequest, Refusal, StateEvent, Trip};

/// Progress of the last published sample in lockstep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Round {
    /// No sample has been published since arming.
    NotBegun,
    /// The sample awaits its answer.
    Open,
    /// The sample has its answer.
    Answered,
}

/// The plant as a node of a user protocol.
#[derive(Clone, Debug)]
pub struct MappedNode {
    receivers: Vec<Receiver>,
    senders: Vec<Sender>,
    arming: Arming,
    lockstep: Lockstep,
    time_base: TimeBase,
    timing: Timing,
    exciter: Exciter,
    core: NodeCore,
    guard: Guard,
    /// Whether each drive is armed, by its index.
    drives: Vec<bool>,
    /// Whether the plant was armed by a first command, or must no longer be.
    has_begun: bool,
    /// Whether a sample has been published, which commands can answer.
    has_published: bool,
    round: Round,
    is_leaving: bool,
    values: Values,
}

impl MappedNode {
    /// Returns a node that publishes `rate_hz` samples per second, for an exciter with these limits and those
    /// of the gate.
    pub fn new(
        mapping: Mapping,
        (rate_hz, time_base): (u16, TimeBase),
        timing: Timing,
        exciter: Exciter,
        limits: GateSpec,
    ) -> MappedNode {
        // Drives are numbered by the scenario and need not be consecutive. A gap is a drive that nothing arms.
        let of_messages = mapping.incoming.iter().map(|message| message.drive);
        let drives = of_messages.chain(mapping.outgoing.iter().map(|message| message.drive)).max();
        MappedNode {
            receivers: mapping.incoming.into_iter().map(Receiver::new).collect(),
            senders: mapping.outgoing.into_iter().map(Sender::new).collect(),
            arming: mapping.arming,
            lockstep: mapping.lockstep,
            time_base,
            timing,
            exciter,
            core: NodeCore::new(&timing),
            guard: Guard::new(rate_hz, &timing, exciter, limits),
            drives: vec![false; drives.map_or(1, |last| last + 1)],
            has_begun: false,
            has_published: false,
            round: Round::NotBegun,
            is_leaving: false,
            values: Values::default(),
        }
    }

    /// Disarms all drives of the plant.
    fn exit(&mut self) {
        self.drives.fill(false);
        self.guard.disarm(&mut self.core);
    }

    /// Handles a frame with an identifier that the plant sends: a request, or another sender.
    fn handle_own(&mut self, sender: usize, frame: &Frame) {
        let message = &self.senders[sender].message;
        let is_remote = frame.format() == FrameFormat::Remote;
        // CAN FD has no remote frames, so that an empty data frame asks as well.
        let asks = is_remote || (frame.data().is_empty() && message.form().check(frame).is_ok());
        if asks && message.is_on_request {
            self.queue(|sender| sender.message.id == frame.id());
        } else if !asks {
            self.core.reject_sender(frame.id());
        }
    }

    /// Handles a frame of a message that the plant receives.
    fn handle_message(&mut self, now_ns: u64, index: usize, frame: &Frame) -> Result<(), FrameCheck> {
        self.receivers[index].check(frame)?;
        let drive = self.receivers[index].message.drive;
        // Compared after the requests of this frame, which may meet a condition or violate it.
        let was_ready = self.is_ready(drive);
        // Requests come before the load: a frame that arms and commands at once must find the drive armed.
        for event in 0..self.receivers[index].message.events.len() {
            match self.receivers[index].action(event, frame.data())? {
                Some(Action::Stop) => self.stop(index, event),
                Some(action) => self.act(now_ns, Some(drive), action),
                None => {}
            }
        }
        if self.is_ready(drive) != was_ready {
            self.drop_waiting(drive);
        }
        if self.receivers[index].is_command() {
            self.receive(now_ns, index, frame)?;
        }
        if self.receivers[index].message.is_sync {
            self.synchronise(now_ns);
        }
        if self.waits_for_set() && self.round == Round::Open && self.has_set() {
            self.judge(now_ns);
        }
        Ok(())
    }

    /// Returns whether every signal of a drive with required values has one of them.
    fn is_ready(&self, drive: usize) -> bool {
        self.receivers.iter().all(|receiver| receiver.message.drive != drive || receiver.is_ready())
    }

    /// Rejects waiting loads: they were received under other conditions than those that hold now.
    fn drop_waiting(&mut self, drive: usize) {
        for receiver in &mut self.receivers {
            if receiver.message.drive == drive && receiver.is_new() {
                receiver.judged(false, &self.core.listening);
                self.guard.refuse(&mut self.core, Refusal::NotArmed);
            }
        }
    }

    /// Handles event `event` of message `index`, which requests a stop.
    fn stop(&mut self, index: usize, event: usize) {
        let Receiver { message, .. } = &self.receivers[index];
        let signal = message.events.get(event).filter(|event| event.signal.is_some());
        let signal = signal.and_then(|signal| Some((signal.name.clone(), self.receivers[index].value(event)?)));
        let cause = FaultCause::Stop { message: message.name.clone(), signal };
        if self.fail(EmergencyCode::StopRequested, 0) {
            self.guard.cause = Some(cause);
        }
    }

    /// Enters a fault; `false` if one is latched already. It disarms all drives, and no first command arms them
    /// again.
    fn fail(&mut self, code: EmergencyCode, detail: u16) -> bool {
        if self.guard.fault(&mut self.core, code, detail).is_none() {
            return false;
        }
        self.has_begun = true;
        self.drives.fill(false);
        true
    }

    /// Takes in a load. In lockstep by commands, a load before the first sample answers nothing, and a second
    /// one for the same sample would shift all later ones.
    fn receive(&mut self, now_ns: u64, index: usize, frame: &Frame) -> Result<(), FrameCheck> {
        let waits_for_set = self.waits_for_set();
        let round = self.round;
        let receiver = &mut self.receivers[index];
        let was_new = receiver.is_new();
        let is_second = was_new || round == Round::Answered;
        if !receiver.receive(frame.data())? {
            return Ok(());
        }
        if !waits_for_set {
            self.core.counts.overwritten += u64::from(was_new);
            return Ok(());
        }
        if round == Round::NotBegun {
            receiver.judged(false, &self.core.listening);
            self.guard.refuse(&mut self.core, Refusal::NotArmed);
        } else if is_second {
            self.guard.refuse(&mut self.core, Refusal::Repeated);
            self.fault(now_ns, EmergencyCode::SampleSequence, self.values.sample as u16);
        }
        Ok(())
    }

    /// Returns whether commands are judged as soon as there is one for each armed drive.
    fn waits_for_set(&self) -> bool {
        self.time_base == TimeBase::Lockstep && self.lockstep == Lockstep::Command && self.is_armed()
    }

    fn has_set(&self) -> bool {
        let drives = &self.drives;
        let mut commands = self.receivers.iter().filter(|receiver| receiver.is_command());
        commands.all(|receiver| receiver.is_new() || !drives[receiver.message.drive])
    }

    fn synchronise(&mut self, now_ns: u64) {
        if self.time_base == TimeBase::Lockstep && self.lockstep == Lockstep::Sync && self.is_armed() {
            match self.round {
                Round::NotBegun => {}
                Round::Open => {
                    self.judge(now_ns);
                    self.round = Round::Answered;
                }
                Round::Answered => self.fault(now_ns, EmergencyCode::SampleSequence, self.values.sample as u16),
            }
        } else {
            self.queue(|sender| sender.message.trigger == Trigger::Sync);
        }
    }

    fn act(&mut self, now_ns: u64, drive: Option<usize>, action: Action) {
        match action {
            Action::Arm if !self.is_leaving => self.arm(drive),
            Action::Arm => {}
            Action::Disarm => self.disarm(drive),
            Action::Reset => {
                self.core.turn(StateEvent::Reset);
            }
            Action::Stop => self.fault(now_ns, EmergencyCode::StopRequested, 0),
        }
    }

    /// Arms one drive, or all.
    fn arm(&mut self, drive: Option<usize>) {
        match self.state() {
            NodeState::BootUp | NodeState::Fault => return,
            NodeState::PreOperational => {
                self.guard.arm(&mut self.core);
                self.round = Round::NotBegun;
            }
            NodeState::Operational => {}
        }
        self.has_begun = true;
        let is_meant = |number: usize| drive.is_none_or(|drive| drive == number);
        for receiver in &mut self.receivers {
            let number = receiver.message.drive;
            if is_meant(number) && !self.drives[number] {
                // A load that was received before the drive was armed never acts.
                if receiver.is_new() {
                    self.guard.refuse(&mut self.core, Refusal::NotArmed);
                }
                receiver.restart(&self.core.listening);
            }
        }
        (0..self.drives.len()).filter(|number| is_meant(*number)).for_each(|number| self.drives[number] = true);
    }

    /// Disarms one drive, or all. With the last one the load ramps to zero; the load of a drive next to others
    /// is dropped, as that of a motor without current is.
    fn disarm(&mut self, drive: Option<usize>) {
        let is_meant = |number: usize| drive.is_none_or(|drive| drive == number);
        if !self.is_armed() || !(0..self.drives.len()).any(|number| is_meant(number) && self.drives[number]) {
            return;
        }
        if self.drives.iter().enumerate().all(|(number, armed)| !armed || is_meant(number)) {
            return self.exit();
        }
        (0..self.drives.len()).filter(|number| is_meant(*number)).for_each(|number| self.drives[number] = false);
        let listening = &self.core.listening;
        let stopped = self.receivers.iter_mut().filter(|receiver| is_meant(receiver.message.drive));
        stopped.for_each(|receiver| receiver.restart(listening));
        self.guard.reduce(self.shares());
    }

    /// Returns the sum of all armed drives' parts of the load.
    fn shares(&self) -> Load {
        let armed = self.receivers.iter().filter(|receiver| self.drives[receiver.message.drive]);
        armed.fold(Load::default(), |sum, receiver| sum + receiver.share())
    }

    /// Judges the received loads as the answer to the last published sample.
    fn judge(&mut self, now_ns: u64) {
        self.refuse_unarmed();
        if !self.has_published || !self.receivers.iter().any(Receiver::is_new) {
            return;
        }
        // The first commands only arm. They are near zero, so nothing is lost when they don't act.
        if self.arming == Arming::ZeroCommand && !self.has_begun && self.is_nearly_zero() {
            return self.arm(None);
        }
        let unready =
            self.receivers.iter().find(|receiver| !receiver.is_ready() && self.drives[receiver.message.drive]);
        if let Some(receiver) = unready {
            self.guard.unheeded.command_early(&receiver.message.name);
        }
        let is_ready = unready.is_none();
        let are_all_new = self.awaited().all(Receiver::is_new);
        // A drive that lacks a required value makes the plant count as not armed for this command: the gate
        // rejects it.
        let state = if is_ready { self.state() } else { NodeState::PreOperational };
        let index = self.guard.sample as u16;
        let load = self.shares();
        let outcome = self.guard.take(&mut self.core, state, index, load);
        if outcome.is_ok() && are_all_new {
            self.guard.heeded();
        }
        let listening = &self.core.listening;
        self.receivers.iter_mut().for_each(|receiver| receiver.judged(outcome.is_ok(), listening));
        if outcome.is_ok() && self.lockstep == Lockstep::Command {
            self.round = Round::Answered;
        }
        if outcome == Err(Refusal::Travel) {
            self.fault(now_ns, EmergencyCode::ExciterTripped, Trip::Travel as u16);
        }
    }

    /// Rejects loads to drives that are not armed, next to an armed one, each by itself.
    fn refuse_unarmed(&mut self) {
        let is_armed = self.is_armed();
        for receiver in &mut self.receivers {
            if is_armed && !self.drives[receiver.message.drive] && receiver.is_new() {
                receiver.judged(false, &self.core.listening);
                self.guard.refuse(&mut self.core, Refusal::NotArmed);
            }
        }
    }

    /// Returns whether the received loads are within a hundredth of the exciter's limits.
    fn is_nearly_zero(&self) -> bool {
        let load = self.receivers.iter().fold(Load::default(), |sum, receiver| sum + receiver.share());
        let (force_n, torque_nm) = self.exciter.size(&load);
        let (force_limit_n, torque_limit_nm) = self.exciter.limits();
        force_n <= 0.01 * force_limit_n && torque_nm <= 0.01 * torque_limit_nm
    }

    /// Queues the messages that are due.
    fn queue(&mut self, mut is_due: impl FnMut(&mut Sender) -> bool) {
        for sender in &mut self.senders {
            if is_due(sender) {
                self.core.counts.unsent += u64::from(!sender.queue());
                self.core.frame_waits();
            }
        }
    }

    /// Returns state and fault of a drive, as readings report them.
    fn status(&self, drive: usize) -> Status {
        // The node is operational while any drive is armed. A drive that is not reports itself as
        // pre-operational.
        let is_idle = self.state() == NodeState::Operational && !self.drives[drive];
        let state = if is_idle { NodeState::PreOperational } else { self.state() };
        Status { state, fault: self.latched_fault() }
    }

    fn timeout_ns(&self, receiver: &Receiver) -> u64 {
        match self.time_base {
            TimeBase::Clock => receiver.message.timeout_ns,
            TimeBase::Lockstep => self.timing.command_timeout_ns,
        }
    }

    /// Returns the command messages of armed drives.
    fn awaited(&self) -> impl Iterator<Item = &Receiver> {
        self.receivers.iter().filter(|receiver| receiver.is_command() && self.drives[receiver.message.drive])
    }
}

impl PlantInterface for MappedNode {
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
        self.senders.iter().filter(|sender| sender.waits).count()
    }

    fn start(&mut self, now_ns: u64) {
        self.core.start(now_ns);
    }

    fn is_answered(&self) -> bool {
        self.round == Round::Answered
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        self.core.listening.look(now_ns);
        if let Some(sender) = self.senders.iter().position(|sender| sender.message.id == frame.id()) {
            return self.handle_own(sender, frame);
        }
        // A mapping has a handful of messages, for which a search is as fast as a table and needs none.
        let Some(index) = self.receivers.iter().position(|receiver| receiver.message.id == frame.id()) else { return };
        if frame.format() == FrameFormat::Remote {
            return;
        }
        if let Err(check) = self.handle_message(now_ns, index, frame) {
            let name = self.receivers[index].message.name.clone();
            self.core.reject(FrameFault::Mapped { id: frame.id(), check });
            self.guard.unheeded.refuse(frame, RefusedFor::Message { name, check });
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
        self.core.listening.look(now_ns);
        // In lockstep an armed plant judges when the set of commands is complete, and not by the clock.
        if self.time_base == TimeBase::Clock || !self.is_armed() {
            self.judge(now_ns);
        }
        self.queue(|sender| sender.take_due(now_ns));
        if !self.is_armed() {
            return;
        }
        let listening = &self.core.listening;
        if self.core.is_jammed() {
            self.fault(now_ns, EmergencyCode::BusLoss, self.core.not_sent(self.waiting()));
        } else if self.awaited().any(|receiver| receiver.is_timed_out(self.timeout_ns(receiver), listening)) {
            self.fault(now_ns, EmergencyCode::CommandTimeout, self.guard.timeout_detail());
        }
    }

    fn next_deadline_ns(&self) -> u64 {
        let periodic = self.senders.iter().filter_map(Sender::due_ns).min();
        let command =
            self.awaited().map(|receiver| receiver.deadline_ns(self.timeout_ns(receiver), &self.core.listening));
        periodic.into_iter().chain(command).min().unwrap_or(u64::MAX)
    }

    fn publish(&mut self, sample: &PublishedSample) -> Result<(), PublishError> {
        let PublishedSample { measurement, states, travel_m } = sample;
        self.guard.measured(measurement.sample, *travel_m);
        if self.is_armed() {
            self.round = Round::Open;
        }
        self.values.sample = measurement.sample;
        // From here on there is a sample that a command can answer.
        self.has_published = true;
        let readings = measurement.readings().into_iter().chain(measurement.more.iter());
        for (place, reading) in readings.enumerate() {
            if !reading.value.is_finite() {
                let name = OUTPUTS.get(place).map_or_else(|| ChannelName::of_reading(place), |channel| channel.name);
                return Err(PublishError::NotFinite { name, got: reading.value });
            }
            self.values.readings[place] = reading.value;
            self.values.clipped[place] = reading.clipped;
        }
        self.values.states = **states;
        let is_after_sync = self.time_base == TimeBase::Lockstep && self.lockstep == Lockstep::Sync;
        self.queue(|sender| match sender.message.trigger {
            Trigger::Every(samples) => measurement.sample.is_multiple_of(samples),
            Trigger::Sync => is_after_sync,
            Trigger::Period(_) | Trigger::Request => false,
        });
        Ok(())
    }

    fn load(&mut self) -> Load {
        // Readings of the load state what acts, ramps included, and not what was commanded.
        self.values.load = self.guard.load();
        self.values.load
    }

    fn fault(&mut self, _now_ns: u64, code: EmergencyCode, detail: u16) {
        self.fail(code, detail);
    }

    fn leave(&mut self, _now_ns: u64) {
        self.is_leaving = true;
        if self.is_armed() {
            self.exit();
        }
    }

    fn waiting_frames(&mut self, most: usize, frames: &mut Vec<Frame>) {
        for sender in 0..self.senders.len() {
            if frames.len() < most && self.senders[sender].waits {
                let status = self.status(self.senders[sender].message.drive);
                match self.senders[sender].frame(&self.values, &status) {
                    Some(frame) => frames.push(frame),
                    // Only a mapping that was not checked gets here. Its message is never sent.
                    None => self.core.counts.unsent += u64::from(core::mem::take(&mut self.senders[sender].waits)),
                }
            }
        }
    }

    fn frame_sent(&mut self) {
        if let Some(sender) = self.senders.iter_mut().find(|sender| sender.waits) {
            self.core.counts.limited_values += sender.sent();
        }
        self.core.frame_sent(self.senders.iter().any(|sender| sender.waits));
    }

    fn boxed_clone(&self) -> Box<dyn PlantInterface> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests;
