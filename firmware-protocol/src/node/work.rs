//! The work of an exciter, whatever protocol it speaks.

use super::answering::{Answering, ExciterOutcome};
use super::node_core::NodeCore;
use super::timing::Timing;
use crate::message::{Emergency, EmergencyCode};
use crate::network::Node;
use crate::state::StateEvent;

/// Number of times that a plant that is silent, or that says it is armed, is asked to disarm.
const SILENT_TRIES: u32 = 3;
const ARMED_TRIES: u32 = 30;

/// The phase of an exciter's work; `A` is its controller's reason to give up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase<A> {
    /// Looking for the plant and arming it.
    Arming,
    /// Answering samples with loads.
    Playing,
    /// Disarming the plant, for this outcome.
    Disarming(ExciterOutcome<A>),
    /// The work has ended with this outcome.
    Done(ExciterOutcome<A>),
}

/// Consequence of a plant that has not reported in time that it is disarmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unanswered {
    /// The plant is asked again.
    Ask,
    /// The plant is silent: it has stopped or ended its run, and its own timeout disarms it in any case.
    Silent,
    /// The plant reports that it is armed, again and again.
    StillArmed,
}

/// The controller of an exciter, the phase of its work, and the samples answered.
///
/// Its methods that change the state of the node, or read the time, take the node's core.
#[derive(Clone, Debug)]
pub struct Work<C: Answering> {
    /// Controller that computes the load for each sample.
    pub controller: C,
    /// Current phase of the work.
    pub phase: Phase<C::Abort>,
    /// Whether the plant has been heard.
    pub has_heard: bool,
    /// The index on the wire of the sample that was answered last.
    pub last_index: u16,
    sample_timeout_ns: u64,
    retry_ns: u64,
    retry_at_ns: u64,
    tries: u32,
    heard_since_asked: bool,
    is_leaving: bool,
    /// The number of the sample that was answered last, from 0.
    answered: Option<u64>,
    missed: u64,
    /// Time listened at which the last whole sample came, or the plant was armed.
    sample_heard_ns: u64,
}

impl<C: Answering> Work<C> {
    /// The work of `controller`, not begun. The plant is asked to arm or disarm every `retry_ns`.
    pub fn new(controller: C, timing: &Timing, retry_ns: u64) -> Work<C> {
        Work {
            controller,
            phase: Phase::Arming,
            has_heard: false,
            last_index: 0,
            sample_timeout_ns: timing.partner_timeout_ns,
            retry_ns,
            retry_at_ns: 0,
            tries: 0,
            heard_since_asked: false,
            is_leaving: false,
            answered: None,
            missed: 0,
            sample_heard_ns: 0,
        }
    }

    /// Permits the first request to the plant from now on.
    pub fn start(&mut self, now_ns: u64) {
        self.retry_at_ns = now_ns;
    }

    /// Returns the outcome of the work, once it has ended.
    pub fn outcome(&self) -> Option<ExciterOutcome<C::Abort>> {
        match self.phase {
            Phase::Done(outcome) => Some(outcome),
            _ => None,
        }
    }

    /// Samples answered so far, including lost ones.
    pub fn samples_played(&self) -> u64 {
        self.answered.map_or(0, |last| last + 1)
    }

    /// Samples of the plant that were never complete.
    pub fn missed_samples(&self) -> u64 {
        self.missed
    }

    /// Whether the node leaves the bus.
    pub fn is_leaving(&self) -> bool {
        self.is_leaving
    }

    /// Notes that the plant was heard; returns whether it was for the first time.
    pub fn hear(&mut self) -> bool {
        self.heard_since_asked = true;
        !core::mem::replace(&mut self.has_heard, true)
    }

    /// Notes that the plant is asked for something now, so that it is due again one retry later.
    pub fn asked(&mut self, now_ns: u64) {
        self.retry_at_ns = now_ns.saturating_add(self.retry_ns);
        self.heard_since_asked = false;
    }

    /// Whether the plant has to be asked again.
    pub fn is_due(&self, now_ns: u64) -> bool {
        matches!(self.phase, Phase::Arming | Phase::Disarming(_)) && now_ns >= self.retry_at_ns
    }

    /// Begins to answer samples: the plant is armed.
    pub fn begin(&mut self, core: &mut NodeCore) {
        self.phase = Phase::Playing;
        self.sample_heard_ns = core.listening.listened_ns();
        core.turn(StateEvent::Arm);
    }

    /// A sample is answered, so many samples after the one before, of which every `every`th is; returns its number.
    pub fn next_sample(&mut self, core: &NodeCore, ahead: u64, every: u64) -> u64 {
        let ahead = ahead.max(1);
        let sample = self.answered.map_or(0, |last| last.saturating_add(ahead));
        if self.answered.is_some() {
            // One of `every` samples is answered, so at a distance of `every` none is missing.
            self.missed += (ahead / every).saturating_sub(1);
        }
        self.answered = Some(sample);
        self.last_index = sample as u16;
        self.sample_heard_ns = core.listening.listened_ns();
        sample
    }

    /// Begins to disarm the plant; the work ends with this outcome once the plant has answered.
    pub fn disarm(&mut self, core: &mut NodeCore, outcome: ExciterOutcome<C::Abort>) {
        self.phase = Phase::Disarming(outcome);
        self.tries = 1;
        core.turn(StateEvent::Disarm);
    }

    /// Decides what follows when the plant has not reported in time that it is disarmed.
    pub fn unanswered(&mut self) -> Unanswered {
        // A silent plant is given up sooner than one that reports that it is armed: its own timeout disarms it.
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
    pub fn fault(&mut self, core: &mut NodeCore, emergency: Emergency) {
        core.fail(emergency);
        self.phase = Phase::Done(ExciterOutcome::Faulted(emergency));
    }

    /// An emergency of this node.
    pub fn own(&self, code: EmergencyCode, detail: u16) -> Emergency {
        Emergency { node: Node::Exciter, code, detail, sample: self.last_index }
    }

    /// A fault of the plant; without a code that is known it is this node's, for its partner's.
    pub fn of_plant(&self, code: Option<EmergencyCode>) -> Emergency {
        let known = |code| Emergency { node: Node::Plant, code, detail: 0, sample: self.last_index };
        let unknown = || self.own(EmergencyCode::PartnerFault, u16::from(Node::Plant.number()));
        code.map_or_else(unknown, known)
    }

    /// The fault of an exciter that answers samples and hears none, or sends nothing, if it is one. `waiting` frames
    /// wait.
    pub fn timed_out(&self, core: &NodeCore, waiting: usize) -> Option<Emergency> {
        if self.phase != Phase::Playing {
            None
        } else if core.is_jammed() {
            // Checked before the samples: a bus that takes no frame may be why none are heard.
            Some(self.own(EmergencyCode::BusLoss, core.not_sent(waiting)))
        } else if core.listening.has_passed(self.sample_heard_ns, self.sample_timeout_ns) {
            Some(self.own(EmergencyCode::SensorTimeout, self.last_index))
        } else {
            None
        }
    }

    /// Returns the time at which to call the node next for its work, at the latest, ns.
    pub fn deadline_ns(&self, core: &NodeCore) -> u64 {
        match self.phase {
            Phase::Arming | Phase::Disarming(_) => self.retry_at_ns,
            Phase::Playing => core.listening.next_look_ns(self.sample_heard_ns, self.sample_timeout_ns),
            Phase::Done(_) => u64::MAX,
        }
    }

    /// Begins anew after a fault; `false` if no fault ended the work, or the node leaves.
    pub fn rearm(&mut self, core: &mut NodeCore, now_ns: u64) -> bool {
        if !matches!(self.phase, Phase::Done(ExciterOutcome::Faulted(_))) || self.is_leaving {
            return false;
        }
        core.turn(StateEvent::Reset);
        // Samples count from arming, so that the controller begins at sample 0 again.
        self.phase = Phase::Arming;
        self.answered = None;
        self.last_index = 0;
        self.controller.restart();
        // By the first attempt the plant has said its state.
        self.asked(now_ns);
        true
    }

    /// Begins to leave the bus; returns whether the plant has to be disarmed for that.
    pub fn leave(&mut self) -> bool {
        let is_first = !core::mem::replace(&mut self.is_leaving, true);
        // A node that disarms the plant already, or is done, has nothing to stop.
        is_first && matches!(self.phase, Phase::Arming | Phase::Playing)
    }

    /// Ends the work, since the plant has ended for good.
    pub fn plant_ended(&mut self, core: &mut NodeCore) {
        match self.phase {
            Phase::Playing => {
                self.phase = Phase::Done(ExciterOutcome::PlantLeft);
                core.turn(StateEvent::Disarm);
            }
            // A plant that leaves disarms itself, which is all that was asked of it.
            Phase::Disarming(outcome) => self.phase = Phase::Done(outcome),
            Phase::Arming | Phase::Done(_) => {}
        }
    }
}
