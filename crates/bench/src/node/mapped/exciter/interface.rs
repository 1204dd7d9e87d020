//! The mapped exciter as a run loop knows it.

use alloc::vec::Vec;

use super::{Ask, MappedExciter, page};
use crate::node::work::Phase;
use crate::node::{Carried, ExciterInterface, ExciterLack, ExciterOutcome, ExciterRemark, FrameCounts, WireEvent};
use crate::rig::Measurement;
use crate::structure::LOADS;
use resonarm_dynamics::arm::Load;
use resonarm_protocol::{EmergencyCode, Frame, FrameFormat, NodeState};

impl MappedExciter {
    /// Asks for readings that come only when they are asked for.
    fn synchronise(&mut self, now_ns: u64) {
        let Some((due_ns, period_ns)) = self.sync else { return };
        if now_ns < due_ns || self.work.outcome().is_some() {
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

    fn not_sent(&self) -> u16 {
        u16::try_from(self.work.frames.unsent.saturating_add(self.queue.len() as u64)).unwrap_or(u16::MAX)
    }
}

impl ExciterInterface for MappedExciter {
    fn start(&mut self, now_ns: u64) {
        self.work.start(now_ns);
        // A plant that does not say its state may be in fault, with an enable that is still set.
        self.begins_anew = !self.says_state();
        // In real time the load in a frame that arms answers the sample before: a plant that has none is not asked yet.
        if self.lockstep.is_some() { self.ask_for_arming(now_ns) } else { self.work.asked(now_ns) }
    }

    fn state(&self) -> NodeState {
        self.work.state()
    }

    fn outcome(&self) -> Option<ExciterOutcome> {
        self.work.outcome()
    }

    fn has_heard_plant(&self) -> bool {
        self.work.has_heard
    }

    fn samples_played(&self) -> u64 {
        self.work.samples_played()
    }

    fn missed_samples(&self) -> u64 {
        self.work.missed_samples()
    }

    fn is_quiet(&self) -> bool {
        self.work.outcome().is_some() && self.queue.is_empty()
    }

    fn frames(&self) -> FrameCounts {
        self.work.frames
    }

    fn carried(&self) -> &Carried {
        &self.work.carried
    }

    fn carried_mut(&mut self) -> &mut Carried {
        &mut self.work.carried
    }

    fn check_load(&self, load: &Load) -> Result<(), ExciterLack> {
        if page::can_command(&self.pages, load) {
            return Ok(());
        }
        let Load { torque_nm, force_n } = load;
        let parts = [
            Load::torque_nm(torque_nm.x, 0.0),
            Load::torque_nm(0.0, torque_nm.y),
            Load::force_n(force_n.x, 0.0),
            Load::force_n(0.0, force_n.y),
        ];
        let part = parts.iter().position(|part| !page::can_command(&self.pages, part));
        Err(ExciterLack::Load { part: part.map_or("several parts", |place| LOADS[place].name) })
    }

    fn remarks(&self) -> Vec<ExciterRemark> {
        let unread: Vec<usize> = (0..Measurement::CHANNELS).filter(|place| !self.reads(*place)).collect();
        let every = self.samples.every;
        let remarks = [
            (!unread.is_empty()).then_some(ExciterRemark::Unread { unread }),
            (every > 1).then_some(ExciterRemark::Sparse { every }),
            self.drives.iter().any(|drive| !drive.says_state).then_some(ExciterRemark::State),
            (self.listeners[self.samples.counting].counts() == 0).then_some(ExciterRemark::Index),
        ];
        remarks.into_iter().flatten().collect()
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        self.work.listening.look(now_ns);
        if frame.format() == FrameFormat::Remote {
            return;
        }
        let id = frame.id();
        if let Some(place) = self.listeners.iter().position(|listener| listener.id() == id) {
            match self.listeners[place].hear(frame, &mut self.samples.readings) {
                Ok(heard) => self.take(now_ns, place, heard),
                Err(check) => self.work.refuse_frame(id, check),
            }
        } else if self.pages.iter().any(|page| page.is_of(id) && (page.is_command() || page.asks(Ask::Arm))) {
            self.work.second_sender(id).into_iter().for_each(|emergency| self.fault(emergency));
        }
    }

    fn handle_deadline(&mut self, now_ns: u64) {
        self.work.listening.look(now_ns);
        self.synchronise(now_ns);
        match self.work.phase {
            Phase::Arming if self.work.is_due(now_ns) => self.ask_for_arming(now_ns),
            Phase::Disarming(outcome) if self.work.is_due(now_ns) => self.disarm_again(now_ns, outcome),
            _ => self.work.timed_out(self.not_sent()).into_iter().for_each(|emergency| self.fault(emergency)),
        }
        if self.expects_unarmed_readings {
            self.answer_if_whole(now_ns);
        }
    }

    fn next_deadline_ns(&self) -> u64 {
        let sync_ns = self.sync.filter(|_| self.outcome().is_none()).map_or(u64::MAX, |(due_ns, _)| due_ns);
        let first_ns = if self.awaits_quiet() { self.last_at_ns() } else { u64::MAX };
        self.work.deadline_ns().min(sync_ns).min(first_ns)
    }

    fn rearm(&mut self, now_ns: u64) -> bool {
        if !self.work.rearm(now_ns) {
            return false;
        }
        (self.begins_anew, self.reason) = (true, None);
        self.drives.iter_mut().for_each(|drive| drive.state = None);
        self.listeners.iter_mut().for_each(super::Listener::forget);
        self.samples.restart();
        self.clear();
        true
    }

    fn leave(&mut self, now_ns: u64) {
        if self.work.leave() {
            self.disarm(now_ns, ExciterOutcome::Stopped);
        }
    }

    fn bus_lost(&mut self, _now_ns: u64) {
        if self.work.phase == Phase::Playing {
            self.fault(self.work.own(EmergencyCode::BusLoss, self.not_sent()));
        }
    }

    fn expect_unarmed_readings(&mut self) {
        self.expects_unarmed_readings = true;
    }

    fn plant_ended(&mut self, _now_ns: u64) {
        self.work.plant_ended();
    }

    fn next_frame(&mut self) -> Option<Frame> {
        while let Some((page, ask)) = self.queue.front().copied() {
            let page = &self.pages[page];
            if let Some(frame) = page.frame(ask, &self.load, self.counters[page.message]) {
                return Some(frame);
            }
            // A load that was checked can be sent: this is never reached.
            self.queue.pop_front();
            self.work.frames.unsent += 1;
        }
        None
    }

    fn frame_sent(&mut self) {
        if let Some((page, _)) = self.queue.pop_front() {
            let page = &self.pages[page];
            self.counters[page.message] = page.after(self.counters[page.message]);
        }
        self.work.frame_sent(!self.queue.is_empty());
        if self.queue.is_empty() {
            self.all_is_sent();
        }
    }

    fn poll_event(&mut self) -> Option<WireEvent> {
        self.work.poll_event()
    }
}
