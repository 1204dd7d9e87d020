//! What the exciters of users' protocols have in common: the phases of their work, state, events and counts.

use alloc::boxed::Box;

use super::interface::{FrameCheck, FrameCounts, FrameFault, WireEvent};
use super::{Carried, ExciterOutcome, TimeBase, Timing};
use crate::control::Controller;
use resonarm_protocol::node::{Listening, NodeCore};
use resonarm_protocol::{Emergency, EmergencyCode, Id, Node, NodeState, StateEvent};

/// Most events that wait to be fetched, beside faults and changes of state.
const NOTES: usize = 64;
/// Time between two attempts to arm or disarm the plant, ns. In lockstep longer than a busy machine stops a process: a
/// second command would count as the answer to the first sample.
const RETRY_NS: u64 = 100_000_000;
const LOCKSTEP_RETRY_NS: u64 = 400_000_000;
/// How often a plant that is silent, or that says it is armed, is asked to disarm.
const SILENT_TRIES: u32 = 3;
const ARMED_TRIES: u32 = 30;

/// The phase of the work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase {
    /// Arming the plant.
    Arming,
    /// Answering samples.
    Playing,
    /// Disarming the plant, for this outcome.
    Disarming(ExciterOutcome),
    /// The work has ended with this outcome.
    Done(ExciterOutcome),
}

/// What follows when the plant has not said in time that it is disarmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unanswered {
    /// It is asked again.
    Ask,
    /// It is silent: it has stopped or ended its run, and its own timeout disarms it in any case.
    Silent,
    /// It says that it is armed, again and again.
    StillArmed,
}

/// The work of an exciter: its controller and phase, state, events and counts.
#[derive(Debug)]
pub(super) struct Work {
    pub carried: Carried,
    pub phase: Phase,
    pub listening: Listening,
    pub frames: FrameCounts,
    pub has_heard: bool,
    core: NodeCore<WireEvent, NOTES>,
    timing: Timing,
    retry_ns: u64,
    retry_at_ns: u64,
    tries: u32,
    heard_since_asked: bool,
    is_leaving: bool,
    /// Since when, in time listened, frames wait and none was sent.
    jammed_since_ns: Option<u64>,
    /// The index of the sample that was answered last, from 0.
    answered: Option<u64>,
    missed: u64,
    /// When the last whole sample came, or the plant was armed, in time listened.
    sample_heard_ns: u64,
}

impl Work {
    /// The work of `controller`, not begun.
    pub fn new(time_base: TimeBase, timing: Timing, controller: Box<dyn Controller>) -> Work {
        Work {
            carried: Carried::new(controller),
            phase: Phase::Arming,
            listening: Listening::new(timing.look_period_ns),
            frames: FrameCounts::default(),
            has_heard: false,
            core: NodeCore::new(),
            timing,
            retry_ns: if time_base == TimeBase::Lockstep { LOCKSTEP_RETRY_NS } else { RETRY_NS },
            retry_at_ns: 0,
            tries: 0,
            heard_since_asked: false,
            is_leaving: false,
            jammed_since_ns: None,
            answered: None,
            missed: 0,
            sample_heard_ns: 0,
        }
    }

    /// Starts to listen.
    pub fn start(&mut self, now_ns: u64) {
        self.listening.start(now_ns);
        self.transition(StateEvent::Started);
    }

    pub fn state(&self) -> NodeState {
        self.core.state()
    }

    /// How the work ended, once it has.
    pub fn outcome(&self) -> Option<ExciterOutcome> {
        match self.phase {
            Phase::Done(outcome) => Some(outcome),
            _ => None,
        }
    }

    fn transition(&mut self, event: StateEvent) {
        self.core.turn(event);
    }

    /// The plant was heard; whether it was for the first time.
    pub fn hear(&mut self) -> bool {
        self.heard_since_asked = true;
        !core::mem::replace(&mut self.has_heard, true)
    }

    /// The plant is asked for something now.
    pub fn asked(&mut self, now_ns: u64) {
        self.retry_at_ns = now_ns.saturating_add(self.retry_ns);
        self.heard_since_asked = false;
    }

    /// Whether the plant has to be asked again.
    pub fn is_due(&self, now_ns: u64) -> bool {
        matches!(self.phase, Phase::Arming | Phase::Disarming(_)) && now_ns >= self.retry_at_ns
    }

    /// The plant is armed.
    pub fn begin(&mut self) {
        self.phase = Phase::Playing;
        self.sample_heard_ns = self.listening.listened_ns();
        self.transition(StateEvent::Arm);
    }

    /// A sample is answered, so many samples after the one before, of which every `every`th is; its index.
    pub fn next_sample(&mut self, ahead: u64, every: u64) -> u64 {
        let ahead = ahead.max(1);
        let sample = self.answered.map_or(0, |last| last.saturating_add(ahead));
        if self.answered.is_some() {
            self.missed += (ahead / every).saturating_sub(1);
        }
        (self.answered, self.sample_heard_ns) = (Some(sample), self.listening.listened_ns());
        sample
    }

    /// Samples answered so far, including lost ones.
    pub fn samples_played(&self) -> u64 {
        self.answered.map_or(0, |last| last + 1)
    }

    pub fn missed_samples(&self) -> u64 {
        self.missed
    }

    fn last_sample(&self) -> u16 {
        self.answered.unwrap_or(0) as u16
    }

    /// The plant is to be disarmed, for this outcome.
    pub fn disarm(&mut self, outcome: ExciterOutcome) {
        (self.phase, self.tries) = (Phase::Disarming(outcome), 1);
        self.transition(StateEvent::Disarm);
    }

    /// What follows when the plant has not said in time that it is disarmed.
    pub fn unanswered(&mut self) -> Unanswered {
        if !self.heard_since_asked && self.tries >= SILENT_TRIES {
            Unanswered::Silent
        } else if self.tries >= ARMED_TRIES {
            Unanswered::StillArmed
        } else {
            self.tries += 1;
            Unanswered::Ask
        }
    }

    /// Ends the work by a fault.
    pub fn fault(&mut self, emergency: Emergency) {
        self.core.fail(emergency);
        self.phase = Phase::Done(ExciterOutcome::Faulted(emergency));
    }

    /// A fault of this node.
    pub fn own(&self, code: EmergencyCode, detail: u16) -> Emergency {
        Emergency { node: Node::Exciter, code, detail, sample: self.last_sample() }
    }

    /// A fault of the plant; without a code that is known it is this node's, for its partner's.
    pub fn of_plant(&self, code: Option<EmergencyCode>) -> Emergency {
        let known = |code| Emergency { node: Node::Plant, code, detail: 0, sample: self.last_sample() };
        let unknown = || self.own(EmergencyCode::PartnerFault, u16::from(Node::Plant.number()));
        code.map_or_else(unknown, known)
    }

    /// The fault of an exciter at work that hears no samples or sends nothing, if it is one. `unsent` frames wait.
    pub fn timed_out(&self, unsent: u16) -> Option<Emergency> {
        let has_passed = |since_ns, timeout_ns| self.listening.has_passed(since_ns, timeout_ns);
        let is_jammed = self.jammed_since_ns.is_some_and(|since| has_passed(since, self.timing.command_timeout_ns));
        if self.phase != Phase::Playing {
            None
        } else if is_jammed {
            Some(self.own(EmergencyCode::BusLoss, unsent))
        } else if has_passed(self.sample_heard_ns, self.timing.partner_timeout_ns) {
            Some(self.own(EmergencyCode::SensorTimeout, self.last_sample()))
        } else {
            None
        }
    }

    /// When to call the node next, at the latest, ns.
    pub fn deadline_ns(&self) -> u64 {
        match self.phase {
            Phase::Arming | Phase::Disarming(_) => self.retry_at_ns,
            Phase::Playing => self.listening.next_look_ns(self.sample_heard_ns, self.timing.partner_timeout_ns),
            Phase::Done(_) => u64::MAX,
        }
    }

    /// Begins anew after a fault; `false` if no fault ended the work, or the node leaves.
    pub fn rearm(&mut self, now_ns: u64) -> bool {
        if !matches!(self.phase, Phase::Done(ExciterOutcome::Faulted(_))) || self.is_leaving {
            return false;
        }
        self.transition(StateEvent::Reset);
        (self.phase, self.answered) = (Phase::Arming, None);
        self.carried.restart();
        // By the first attempt the plant has said its state.
        self.asked(now_ns);
        true
    }

    /// Whether the plant has to be disarmed as the node leaves.
    pub fn leave(&mut self) -> bool {
        let is_first = !core::mem::replace(&mut self.is_leaving, true);
        is_first && matches!(self.phase, Phase::Arming | Phase::Playing)
    }

    /// The plant has ended for good.
    pub fn plant_ended(&mut self) {
        match self.phase {
            Phase::Playing => {
                self.transition(StateEvent::Disarm);
                self.phase = Phase::Done(ExciterOutcome::PlantLeft);
            }
            Phase::Disarming(outcome) => self.phase = Phase::Done(outcome),
            Phase::Arming | Phase::Done(_) => {}
        }
    }

    /// A frame waits.
    pub fn frame_waits(&mut self) {
        self.jammed_since_ns.get_or_insert(self.listening.listened_ns());
    }

    /// A frame was sent, and others wait or not.
    pub fn frame_sent(&mut self, do_others_wait: bool) {
        self.jammed_since_ns = do_others_wait.then(|| self.listening.listened_ns());
    }

    /// Counts and reports a frame that failed a check.
    pub fn refuse_frame(&mut self, id: Id, check: FrameCheck) {
        self.frames.refused += 1;
        self.core.note(WireEvent::Frame(FrameFault::Mapped { id, check }));
    }

    /// Another node sends this one's messages: either of the two may control the plant. Counts and reports the frame;
    /// the fault, unless the work has ended.
    pub fn second_sender(&mut self, id: Id) -> Option<Emergency> {
        self.frames.refused += 1;
        self.frames.other_sender += 1;
        self.core.note(WireEvent::OtherSender(id));
        self.outcome().is_none().then(|| self.own(EmergencyCode::SecondSender, id.raw() as u16))
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<WireEvent> {
        self.core.poll().map(WireEvent::from)
    }
}
