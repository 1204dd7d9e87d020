//! What a command passes on its way to the structure, whatever wire it came over: the gate with its limits, the hold,
//! and the time for which it is valid. The guard arms, disarms and faults the node's core, so that the load follows.

use alloc::sync::Arc;

use resonarm_protocol::node::{NodeCore, NodeEvent};
use resonarm_protocol::{CommandGate, Emergency, EmergencyCode, Frame, Node, NodeState, Refusal, StateEvent};

use super::cause::{FaultCause, RefusedFor, Unheeded};
use super::hold::Hold;
use super::refusals::RefusedLoad;
use super::{Refusals, Timing};
use crate::rig::Load;
use crate::rig::{Exciter, GateSpec};

/// The gate of a plant's node, with the load that acts.
#[derive(Clone, Debug)]
pub struct Guard {
    exciter: Exciter,
    limits: GateSpec,
    rate_hz: u16,
    timeout_ns: u64,
    gate: CommandGate,
    hold: Hold,
    /// The sample measured last.
    sample: u64,
    /// The travel at that sample, m.
    travel_m: f64,
    /// When the last command was taken, or the plant was armed, in listening time.
    taken_ns: u64,
    refused_since_taken: u64,
    refusals: Refusals,
    unheeded: Unheeded,
    /// Why the node faulted last, beyond the code.
    cause: Option<FaultCause>,
}

impl Guard {
    /// A guard with the limits of an exciter and of its gate, for `rate_hz` samples a second.
    pub fn new(rate_hz: u16, timing: &Timing, exciter: Exciter, limits: GateSpec) -> Guard {
        Guard {
            exciter,
            limits,
            rate_hz,
            timeout_ns: timing.command_timeout_ns,
            gate: CommandGate::new(timing.command_age_ns, rate_hz),
            hold: Hold::new(timing.ramp_ns.saturating_mul(rate_hz.into()).div_ceil(1_000_000_000)),
            sample: 0,
            travel_m: 0.0,
            taken_ns: 0,
            refused_since_taken: 0,
            refusals: Refusals::default(),
            unheeded: Unheeded::default(),
            cause: None,
        }
    }

    /// Sets the limits beyond the exciter's.
    pub fn set_limits(&mut self, limits: GateSpec) {
        self.limits = limits;
    }

    /// A sample has been measured, at this distance of the driven point from rest, m.
    pub fn measured(&mut self, sample: u64, travel_m: f64) {
        (self.sample, self.travel_m) = (sample, travel_m);
    }

    /// The sample measured last.
    pub fn sample(&self) -> u64 {
        self.sample
    }

    /// Arms the plant: no sample has been answered since.
    pub fn arm(&mut self, core: &mut NodeCore) {
        self.gate.arm();
        self.heeded();
        self.taken_ns = core.listening.listened_ns();
        self.refused_since_taken = 0;
        core.turn(StateEvent::Arm);
    }

    /// Disarms an armed plant: a load that acts ramps to zero.
    pub fn disarm(&mut self, core: &mut NodeCore) {
        if core.turn(StateEvent::Disarm) {
            self.hold.release();
        }
    }

    /// Faults: a load that acts ramps to zero, or is dropped at once in a fault after which the exciter acts no more.
    /// Returns the emergency, or `None` if a fault is latched already.
    pub fn fault(&mut self, core: &mut NodeCore, code: EmergencyCode, detail: u16) -> Option<Emergency> {
        debug_assert!(!code.is_notice(), "{code:?} is no fault");
        match code {
            EmergencyCode::SimulationFailed | EmergencyCode::ExciterTripped => self.hold.drop_load(),
            _ => self.hold.release(),
        }
        let emergency = self.emergency(code, detail);
        if !core.fail(emergency) {
            return None;
        }
        let is_unheeded = code == EmergencyCode::CommandTimeout && !self.unheeded.is_empty();
        self.cause = is_unheeded.then(|| FaultCause::Unheeded(self.unheeded.clone()));
        Some(emergency)
    }

    /// An emergency of the plant, at the sample measured last.
    pub fn emergency(&self, code: EmergencyCode, detail: u16) -> Emergency {
        Emergency { node: Node::Plant, code, detail, sample: self.sample as u16 }
    }

    /// States why the plant has faulted, beyond the code.
    pub fn set_cause(&mut self, cause: FaultCause) {
        self.cause = Some(cause);
    }

    /// Why the plant faulted last, beyond the code.
    pub fn cause(&self) -> Option<&FaultCause> {
        self.cause.as_ref()
    }

    /// Holds the load of a command that answers the sample of index `index`, if `state` and all limits allow. The state
    /// is the core's, or another if the drives that the command is for are not ready.
    ///
    /// # Errors
    /// Why not; it is counted and noted.
    pub fn take(&mut self, core: &mut NodeCore, state: NodeState, index: u16, load: Load) -> Result<(), Refusal> {
        let rate_hz = f64::from(self.rate_hz);
        let check = self.limits.command_check(&self.exciter, rate_hz, self.travel_m, [self.hold.load(), &load]);
        match self.gate.take(state, self.sample, index, &check) {
            Ok(()) => {
                self.hold.take(load);
                self.taken_ns = core.listening.listened_ns();
                self.refused_since_taken = 0;
                Ok(())
            }
            Err(refusal) => {
                self.refusals.keep_load(RefusedLoad { sample: self.sample, load, refusal });
                self.refuse(core, refusal);
                Err(refusal)
            }
        }
    }

    /// All that was commanded is taken: what came before and was not used is no cause of anything that follows.
    pub fn heeded(&mut self) {
        self.unheeded = Unheeded::default();
    }

    /// Notes a frame that was refused.
    pub fn refuse_frame(&mut self, frame: &Frame, why: RefusedFor) {
        self.unheeded.refuse(frame, why);
    }

    /// Notes a command that came before the message `condition` had a value that is required.
    pub fn command_early(&mut self, condition: &Arc<str>) {
        self.unheeded.command_early(condition);
    }

    /// Counts and notes a command that was refused.
    pub fn refuse(&mut self, core: &mut NodeCore, refusal: Refusal) {
        self.refused_since_taken += 1;
        self.refusals.add(refusal);
        core.note(NodeEvent::Refused(refusal));
    }

    /// Whether commands have been refused since the last one that was taken.
    pub fn has_refused(&self) -> bool {
        self.refused_since_taken > 0
    }

    /// Whether the sample measured last has its answer.
    pub fn is_answered(&self) -> bool {
        self.gate.answered() == Some(self.sample)
    }

    /// Whether an armed plant has listened for longer than the timeout since the last command that was taken.
    pub fn is_timed_out(&self, core: &NodeCore) -> bool {
        core.listening.has_passed(self.taken_ns, self.timeout_ns)
    }

    /// When to check [`Guard::is_timed_out`] next, ns.
    pub fn deadline_ns(&self, core: &NodeCore) -> u64 {
        core.listening.next_look_ns(self.taken_ns, self.timeout_ns)
    }

    /// The detail of [`EmergencyCode::CommandTimeout`].
    pub fn timeout_detail(&self) -> u16 {
        Refusal::detail(self.refused_since_taken, self.refusals.last().filter(|_| self.has_refused()))
    }

    /// Valid commands that were refused, by reason.
    pub fn refusals(&self) -> &Refusals {
        &self.refusals
    }

    /// Holds a load that is a part of the one held: that of a drive which has stopped is left out.
    pub fn reduce(&mut self, load: Load) {
        self.hold.take(load);
    }

    /// Starts the ramp to zero.
    pub fn release(&mut self) {
        self.hold.release();
    }

    /// The load of the next sample period: one step down the ramp, if one runs.
    pub fn load(&mut self) -> Load {
        self.hold.next()
    }

    /// Samples until the ramp ends; 0 if none runs.
    pub fn ramp_left(&self) -> u64 {
        self.hold.ramp_left()
    }
}
