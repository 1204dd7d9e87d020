//! The mapped node as a run loop knows it.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::mapping::{Action, Lockstep, Trigger};
use super::outgoing::Sender;
use super::{MappedNode, Round};
use crate::node::cause::{FaultCause, RefusedFor};
use crate::node::interface::{FrameCounts, PlantInterface, PublishError, PublishedSample, WireEvent};
use crate::node::{Refusals, TimeBase};
use crate::structure::OUTPUTS;
use resonarm_dynamics::arm::Load;
use resonarm_protocol::{Emergency, EmergencyCode, Frame, FrameFormat, NodeState, OperatorRequest, StateEvent};

impl PlantInterface for MappedNode {
    fn start(&mut self, now_ns: u64) {
        self.plant.start(now_ns);
    }

    fn state(&self) -> NodeState {
        self.plant.state()
    }

    fn is_answered(&self) -> bool {
        self.round == Round::Answered
    }

    fn has_unnumbered_answers(&self) -> bool {
        self.time_base == TimeBase::Lockstep && self.lockstep == Lockstep::Command
    }

    fn is_ramping(&self) -> bool {
        self.plant.guard.ramp_left() > 0
    }

    fn latched_fault(&self) -> Option<Emergency> {
        self.plant.latched_fault()
    }

    fn arms(&self) -> u32 {
        self.plant.arms()
    }

    fn leaves(&self) -> u32 {
        self.plant.leaves()
    }

    fn fault_cause(&self) -> Option<FaultCause> {
        self.plant.fault_cause()
    }

    fn refusals(&self) -> &Refusals {
        self.plant.guard.refusals()
    }

    fn frames(&self) -> FrameCounts {
        self.plant.frames
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        self.plant.listening.look(now_ns);
        if let Some(sender) = self.senders.iter().position(|sender| sender.message.id == frame.id()) {
            return self.handle_own(sender, frame);
        }
        let Some(index) = self.receivers.iter().position(|receiver| receiver.message.id == frame.id()) else { return };
        if frame.format() == FrameFormat::Remote {
            return;
        }
        if let Err(check) = self.handle_message(now_ns, index, frame) {
            let name = self.receivers[index].message.name.clone();
            self.plant.refuse_frame(frame, check, RefusedFor::Message { name, check });
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
        self.plant.listening.look(now_ns);
        if self.time_base == TimeBase::Clock || !self.is_armed() {
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
        let listening = &self.plant.listening;
        if self.plant.is_jammed() {
            self.fault(now_ns, EmergencyCode::BusLoss, self.not_sent());
        } else if self.awaited().any(|receiver| receiver.is_timed_out(self.timeout_ns(receiver), listening)) {
            self.fault(now_ns, EmergencyCode::CommandTimeout, self.plant.guard.timeout_detail());
        }
    }

    fn next_deadline_ns(&self) -> u64 {
        let periodic = self.senders.iter().filter_map(Sender::due_ns).min();
        let command =
            self.awaited().map(|receiver| receiver.deadline_ns(self.timeout_ns(receiver), &self.plant.listening));
        periodic.into_iter().chain(command).min().unwrap_or(u64::MAX)
    }

    fn publish(&mut self, sample: &PublishedSample) -> Result<(), PublishError> {
        let PublishedSample { measurement, states, travel_m } = sample;
        self.plant.guard.measured(measurement.sample);
        self.plant.guard.set_travel(*travel_m);
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
                Trigger::Sync => self.time_base == TimeBase::Lockstep && self.lockstep == Lockstep::Sync,
                Trigger::Period(_) | Trigger::Request => false,
            };
            if is_due {
                self.queue(sender);
            }
        }
        Ok(())
    }

    fn load(&mut self) -> Load {
        self.values.load = self.plant.guard.load();
        self.values.load
    }

    fn fault(&mut self, _now_ns: u64, code: EmergencyCode, detail: u16) {
        if self.plant.fail(code, detail).is_some() {
            self.has_faulted();
        }
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
        self.plant.slip(periods);
    }

    fn waiting_frames(&mut self, most: usize, frames: &mut Vec<Frame>) {
        for sender in 0..self.senders.len() {
            if frames.len() < most && self.senders[sender].waits() {
                let status = self.status(self.senders[sender].message.drive);
                match self.senders[sender].frame(&self.values, &status) {
                    Some(frame) => frames.push(frame),
                    // A mapping that was not checked: its message is never sent.
                    None => self.plant.frames.unsent += u64::from(self.senders[sender].give_up()),
                }
            }
        }
    }

    fn frame_sent(&mut self) {
        if let Some(sender) = self.senders.iter_mut().find(|sender| sender.waits()) {
            self.plant.frames.limited_values += sender.sent();
        }
        self.plant.frame_sent(self.senders.iter().any(Sender::waits));
    }

    fn poll_event(&mut self) -> Option<WireEvent> {
        self.plant.poll_event()
    }

    fn boxed_clone(&self) -> Box<dyn PlantInterface> {
        Box::new(self.clone())
    }
}
