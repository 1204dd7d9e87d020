//! What the nodes of users' protocols have in common: the state with its fault, the gate, the events and the counts.

use resonarm_protocol::node::{Listening, Queue};
use resonarm_protocol::{Emergency, EmergencyCode, Id, Node, NodeState, Refusal, StateEvent};

use super::Timing;
use super::guard::Guard;
use super::interface::{FrameCheck, FrameCounts, FrameFault, WireEvent};
use crate::rig::{Exciter, GateSpec};

/// Most events that wait to be fetched.
const EVENTS: usize = 64;

/// State, gate, events and counts of a plant's node.
#[derive(Clone, Debug)]
pub(super) struct PlantState {
    pub guard: Guard,
    pub listening: Listening,
    pub frames: FrameCounts,
    state: NodeState,
    fault: Option<Emergency>,
    events: Queue<WireEvent, EVENTS>,
    /// Since when, in time listened, frames wait and none was sent.
    jammed_since_ns: Option<u64>,
    jam_timeout_ns: u64,
}

impl PlantState {
    /// The state boot-up, with the limits of an exciter and of its gate, at `rate_hz` samples a second.
    pub fn new(rate_hz: u16, timing: &Timing, exciter: Exciter, limits: GateSpec) -> PlantState {
        let mut guard = Guard::new(rate_hz, timing, exciter);
        guard.set_limits(limits);
        PlantState {
            guard,
            listening: Listening::new(timing.look_period_ns),
            frames: FrameCounts::default(),
            state: NodeState::BootUp,
            fault: None,
            events: Queue::new(),
            jammed_since_ns: None,
            jam_timeout_ns: timing.command_timeout_ns,
        }
    }

    /// Starts to listen, and leaves the boot-up.
    pub fn start(&mut self, now_ns: u64) {
        self.listening.start(now_ns);
        self.transition(StateEvent::Started);
    }

    /// The state.
    pub fn state(&self) -> NodeState {
        self.state
    }

    /// Follows the table of states; returns `false` if it has no such event in this state. A load that acts ramps to
    /// zero when it leaves operational, and a fault is forgotten when it is reset.
    pub fn transition(&mut self, event: StateEvent) -> bool {
        let Some(to) = self.state.next(event) else { return false };
        let from = core::mem::replace(&mut self.state, to);
        match from {
            NodeState::Operational => self.guard.release(),
            NodeState::Fault => self.fault = None,
            NodeState::BootUp | NodeState::PreOperational => {}
        }
        self.events.push(WireEvent::State { from, to });
        true
    }

    /// Faults; returns the emergency, or `None` if a fault is latched already.
    pub fn fail(&mut self, code: EmergencyCode, detail: u16) -> Option<Emergency> {
        debug_assert!(!code.is_notice(), "{code:?} is no fault");
        self.guard.fault(code);
        if self.state == NodeState::Fault {
            return None;
        }
        let emergency = self.emergency(code, detail);
        self.events.push(WireEvent::Emergency(emergency));
        self.transition(StateEvent::Fault);
        self.fault = Some(emergency);
        Some(emergency)
    }

    /// The fault that is latched, if one is.
    pub fn latched_fault(&self) -> Option<Emergency> {
        self.fault
    }

    /// Reports that the schedule has moved by `periods` missed sample periods.
    pub fn slip(&mut self, periods: u64) {
        let detail = u16::try_from(periods).unwrap_or(u16::MAX);
        self.events.push(WireEvent::Emergency(self.emergency(EmergencyCode::ScheduleSlipped, detail)));
    }

    fn emergency(&self, code: EmergencyCode, detail: u16) -> Emergency {
        Emergency { node: Node::Plant, code, detail, sample: self.guard.sample() as u16 }
    }

    /// Counts and reports a load that was refused before the gate.
    pub fn refuse(&mut self, refusal: Refusal) {
        self.guard.refuse(refusal);
        self.report_refusal(refusal);
    }

    /// Reports a load that the gate has refused, and counted.
    pub fn report_refusal(&mut self, refusal: Refusal) {
        self.events.push(WireEvent::Refused(refusal));
    }

    /// Counts and reports a frame that failed a check.
    pub fn refuse_frame(&mut self, id: Id, check: FrameCheck) {
        self.frames.refused += 1;
        self.events.push(WireEvent::Frame(FrameFault::Mapped { id, check }));
    }

    /// Counts and reports a frame that only this node sends.
    pub fn refuse_sender(&mut self, id: Id) {
        self.frames.other_sender += 1;
        self.events.push(WireEvent::OtherSender(id));
    }

    /// A frame waits.
    pub fn frame_waits(&mut self) {
        self.jammed_since_ns.get_or_insert(self.listening.listened_ns());
    }

    /// A frame was sent, and others wait or not.
    pub fn frame_sent(&mut self, do_others_wait: bool) {
        self.jammed_since_ns = do_others_wait.then(|| self.listening.listened_ns());
    }

    /// Whether frames have waited for the timeout and none could be sent.
    pub fn is_jammed(&self) -> bool {
        self.jammed_since_ns.is_some_and(|since_ns| self.listening.has_passed(since_ns, self.jam_timeout_ns))
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<WireEvent> {
        self.events.pop()
    }
}
