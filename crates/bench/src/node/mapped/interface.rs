//! The mapped node as a run loop knows it.

use alloc::vec::Vec;

use super::mapping::{Action, Lockstep, Trigger};
use super::outgoing::Sender;
use super::{MappedNode, Pace, Round};
use crate::node::Refusals;
use crate::node::interface::{FrameCounts, PlantInterface, PublishError, PublishedSample, WireEvent};
use crate::structure::OUTPUTS;
use resonarm_dynamics::arm::Load;
use resonarm_protocol::{Emergency, EmergencyCode, Frame, FrameFormat, Node, NodeState, OperatorRequest, StateEvent};

impl PlantInterface for MappedNode {
    fn start(&mut self, now_ns: u64) {
        self.listening.start(now_ns);
        self.transition(StateEvent::Started);
    }

    fn state(&self) -> NodeState {
        self.state
    }

    fn is_answered(&self) -> bool {
        self.round == Round::Answered
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
        if self.is_armed() {
            self.round = Round::Open;
        }
        self.values.sample = measurement.sample;
        self.has_published = true;
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
                match self.senders[sender].frame(&self.values, &said) {
                    Some(frame) => frames.push(frame),
                    // A mapping that was not checked: its message is never sent.
                    None => self.frames.unsent += u64::from(self.senders[sender].give_up()),
                }
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
