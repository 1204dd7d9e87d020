//! What the nodes of users' protocols have in common: the state with its fault, the gate, the events and the counts.

use resonarm_protocol::node::{Listening, NodeCore};
use resonarm_protocol::{Emergency, EmergencyCode, Frame, Id, Node, NodeState, Refusal, StateEvent};

use super::Timing;
use super::cause::{FaultCause, RefusedFor};
use super::guard::Guard;
use super::interface::{FrameCheck, FrameCounts, FrameFault, WireEvent};
use crate::rig::{Exciter, GateSpec};

/// Most events that wait to be fetched, beside faults and changes of state.
const NOTES: usize = 64;

/// State, gate, events and counts of a plant's node.
#[derive(Clone, Debug)]
pub(super) struct PlantState {
    pub guard: Guard,
    pub listening: Listening,
    pub frames: FrameCounts,
    core: NodeCore<WireEvent, NOTES>,
    /// Why the plant faulted last, beyond the code.
    cause: Option<FaultCause>,
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
            core: NodeCore::new(),
            cause: None,
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
        self.core.state()
    }

    /// How often the plant was armed.
    pub fn arms(&self) -> u32 {
        self.core.arms()
    }

    /// How often the armed plant was disarmed, or faulted.
    pub fn leaves(&self) -> u32 {
        self.core.leaves()
    }

    /// Follows the table of states; returns `false` if it has no such event in this state. A load that acts ramps to
    /// zero when it leaves operational, and a fault is forgotten when it is reset.
    pub fn transition(&mut self, event: StateEvent) -> bool {
        let Some((from, _)) = self.core.turn(event) else { return false };
        match from {
            NodeState::Operational => self.guard.release(),
            NodeState::Fault => self.cause = None,
            NodeState::BootUp | NodeState::PreOperational => {}
        }
        true
    }

    /// Faults; returns the emergency, or `None` if a fault is latched already. A load that acts ramps to zero.
    pub fn fail(&mut self, code: EmergencyCode, detail: u16) -> Option<Emergency> {
        let unheeded = if code == EmergencyCode::CommandTimeout { self.guard.unheeded() } else { None };
        self.fail_for(code, detail, unheeded.map(FaultCause::Unheeded))
    }

    /// The same, for a known cause.
    pub fn fail_for(&mut self, code: EmergencyCode, detail: u16, cause: Option<FaultCause>) -> Option<Emergency> {
        debug_assert!(!code.is_notice(), "{code:?} is no fault");
        self.guard.fault(code);
        let (from, emergency) = (self.core.state(), self.emergency(code, detail));
        if !self.core.fail(emergency) {
            return None;
        }
        if from == NodeState::Operational {
            self.guard.release();
        }
        self.cause = cause;
        Some(emergency)
    }

    /// The fault that is latched, if one is.
    pub fn latched_fault(&self) -> Option<Emergency> {
        self.core.latched_fault()
    }

    /// Why that fault is latched, beyond its code.
    pub fn fault_cause(&self) -> Option<FaultCause> {
        self.cause.clone()
    }

    /// Reports that the schedule has moved by `periods` missed sample periods.
    pub fn slip(&mut self, periods: u64) {
        let detail = u16::try_from(periods).unwrap_or(u16::MAX);
        self.core.note(WireEvent::Emergency(self.emergency(EmergencyCode::ScheduleSlipped, detail)));
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
        self.core.note(WireEvent::Refused(refusal));
    }

    /// Counts and reports a frame that failed a check.
    pub fn refuse_frame(&mut self, frame: &Frame, check: FrameCheck, why: RefusedFor) {
        self.frames.refused += 1;
        self.guard.refuse_frame(frame, why);
        self.core.note(WireEvent::Frame(FrameFault::Mapped { id: frame.id(), check }));
    }

    /// Counts and reports a frame that only this node sends.
    pub fn refuse_sender(&mut self, id: Id) {
        self.frames.other_sender += 1;
        self.core.note(WireEvent::OtherSender(id));
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
        self.core.poll().map(WireEvent::from)
    }
}
