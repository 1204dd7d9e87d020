//! The mapped exciter as a run loop knows it.

use super::{Ask, MappedExciter, Phase};
use crate::node::{Carried, ExciterInterface, ExciterOutcome, FrameCounts, WireEvent};
use resonarm_protocol::{EmergencyCode, Frame, FrameFormat, NodeState, StateEvent};

impl MappedExciter {
    /// The latest time of the next deadline of the phase, ns.
    fn phase_deadline_ns(&self) -> u64 {
        match self.phase {
            Phase::Arming | Phase::Disarming(_) => self.retry_at_ns,
            Phase::Playing => self.listening.next_look_ns(self.samples.heard_ns, self.timing.partner_timeout_ns),
            Phase::Done(_) => u64::MAX,
        }
    }

    /// Asks for readings that come only when they are asked for.
    fn synchronise(&mut self, now_ns: u64) {
        let Some((due_ns, period_ns)) = self.sync else { return };
        if now_ns < due_ns || matches!(self.phase, Phase::Done(_)) {
            return;
        }
        let next_ns = due_ns.saturating_add(period_ns);
        self.sync = Some((if next_ns > now_ns { next_ns } else { now_ns.saturating_add(period_ns) }, period_ns));
        for page in 0..self.pages.len() {
            if self.pages[page].is_sync {
                self.push(page, Ask::Arm);
            }
        }
    }

    fn is_jammed(&self) -> bool {
        let timeout_ns = self.timing.command_timeout_ns;
        self.jammed_since_ns.is_some_and(|since_ns| self.listening.has_passed(since_ns, timeout_ns))
    }

    fn not_sent(&self) -> u16 {
        u16::try_from(self.frames.unsent.saturating_add(self.queue.len() as u64)).unwrap_or(u16::MAX)
    }
}

impl ExciterInterface for MappedExciter {
    fn start(&mut self, now_ns: u64) {
        self.listening.start(now_ns);
        self.transition(StateEvent::Started);
        // In real time the load in a frame that arms answers the sample before: a plant that has none is not asked yet.
        if self.lockstep.is_some() { self.ask_for_arming(now_ns) } else { self.retry(now_ns) }
    }

    fn state(&self) -> NodeState {
        self.state
    }

    fn outcome(&self) -> Option<ExciterOutcome> {
        match self.phase {
            Phase::Done(outcome) => Some(outcome),
            _ => None,
        }
    }

    fn has_heard_plant(&self) -> bool {
        self.has_heard
    }

    fn samples_played(&self) -> u64 {
        self.samples.answered.map_or(0, |last| last + 1)
    }

    fn missed_samples(&self) -> u64 {
        self.samples.missed
    }

    fn is_quiet(&self) -> bool {
        matches!(self.phase, Phase::Done(_)) && self.queue.is_empty()
    }

    fn frames(&self) -> FrameCounts {
        self.frames
    }

    fn carried(&self) -> &Carried {
        &self.carried
    }

    fn carried_mut(&mut self) -> &mut Carried {
        &mut self.carried
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        self.listening.look(now_ns);
        if frame.format() == FrameFormat::Remote {
            return;
        }
        let id = frame.id();
        if let Some(place) = self.listeners.iter().position(|listener| listener.id() == id) {
            match self.listeners[place].hear(frame, &mut self.samples.readings) {
                Ok(heard) => self.take(now_ns, place, heard),
                Err(check) => {
                    self.frames.refused += 1;
                    self.events.push(WireEvent::Frame(crate::node::FrameFault::Mapped { id, check }));
                }
            }
        } else if self.pages.iter().any(|page| page.is_of(id) && (page.is_command() || page.asks(Ask::Arm))) {
            self.meet_second_sender(id);
        }
    }

    fn handle_deadline(&mut self, now_ns: u64) {
        self.listening.look(now_ns);
        self.synchronise(now_ns);
        let timeout_ns = self.timing.partner_timeout_ns;
        match self.phase {
            Phase::Arming if now_ns >= self.retry_at_ns => self.ask_for_arming(now_ns),
            Phase::Disarming(outcome) if now_ns >= self.retry_at_ns => self.disarm_again(now_ns, outcome),
            Phase::Playing if self.is_jammed() => self.fault(self.own(EmergencyCode::BusLoss, self.not_sent())),
            Phase::Playing if self.listening.has_passed(self.samples.heard_ns, timeout_ns) => {
                self.fault(self.own(EmergencyCode::SensorTimeout, self.last_sample()));
            }
            _ => {}
        }
    }

    fn next_deadline_ns(&self) -> u64 {
        let sync_ns = self.sync.filter(|_| self.outcome().is_none()).map_or(u64::MAX, |(due_ns, _)| due_ns);
        self.phase_deadline_ns().min(sync_ns)
    }

    fn rearm(&mut self, now_ns: u64) -> bool {
        if !matches!(self.phase, Phase::Done(ExciterOutcome::Faulted(_))) || self.is_leaving {
            return false;
        }
        self.transition(StateEvent::Reset);
        (self.phase, self.begins_anew, self.reason) = (Phase::Arming, true, None);
        self.drives.iter_mut().for_each(|drive| drive.state = None);
        self.listeners.iter_mut().for_each(super::Listener::forget);
        self.samples.restart();
        self.carried.restart();
        // By then the plant has said its state.
        self.clear();
        self.retry(now_ns);
        true
    }

    fn leave(&mut self, now_ns: u64) {
        if !self.is_leaving {
            self.is_leaving = true;
            self.stop(now_ns);
        }
    }

    fn bus_lost(&mut self, _now_ns: u64) {
        if self.phase == Phase::Playing {
            self.fault(self.own(EmergencyCode::BusLoss, self.not_sent()));
        }
    }

    fn plant_ended(&mut self, _now_ns: u64) {
        match self.phase {
            Phase::Playing => {
                self.clear();
                self.transition(StateEvent::Disarm);
                self.phase = Phase::Done(ExciterOutcome::PlantLeft);
            }
            Phase::Disarming(outcome) => self.phase = Phase::Done(outcome),
            Phase::Arming | Phase::Done(_) => {}
        }
    }

    fn next_frame(&mut self) -> Option<Frame> {
        while let Some((page, ask)) = self.queue.front().copied() {
            let page = &self.pages[page];
            if let Some(frame) = page.frame(ask, &self.load, self.counters[page.message]) {
                return Some(frame);
            }
            // A load that was checked can be sent: this is never reached.
            self.queue.pop_front();
            self.frames.unsent += 1;
        }
        None
    }

    fn frame_sent(&mut self) {
        if let Some((page, _)) = self.queue.pop_front() {
            let page = &self.pages[page];
            self.counters[page.message] = page.after(self.counters[page.message]);
        }
        self.jammed_since_ns = (!self.queue.is_empty()).then(|| self.listening.listened_ns());
        if self.queue.is_empty() {
            self.all_is_sent();
        }
    }

    fn poll_event(&mut self) -> Option<WireEvent> {
        self.events.pop()
    }
}
