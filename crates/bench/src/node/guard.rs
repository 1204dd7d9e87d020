//! The path of a command to the structure, whatever the protocol: the gate with its limits, the hold, and the
//! time for which it is valid. The guard arms, disarms and faults the node's core, and the load follows.

use super::refusals::{Refusals, RefusedLoad};
use resonarm_protocol::node::{NodeCore, NodeEvent, Timing};
use resonarm_protocol::{CommandGate, Emergency, EmergencyCode, Node, NodeState, Refusal, StateEvent};

use super::cause::{FaultCause, Unheeded};
use super::hold::Hold;
use crate::rig::{Exciter, GateSpec, Load};

/// The gate of a plant's node, with the load that acts.
#[derive(Clone, Debug)]
pub struct Guard {
    exciter: Exciter,
    /// Limits beyond those of the exciter.
    pub(super) limits: GateSpec,
    rate_hz: u16,
    timeout_ns: u64,
    gate: CommandGate,
    hold: Hold,
    /// Index of the last measured sample.
    pub(super) sample: u64,
    /// Travel of the driven point at that sample, m, if it is limited.
    travel_m: Option<f64>,
    /// Time of the last accepted command, or of arming, ns of time listened.
    taken_ns: u64,
    refused_since_taken: u64,
    refusals: Refusals,
    /// What was received since the last accepted command and not used.
    pub(super) unheeded: Unheeded,
    /// Cause of the node's last fault, beyond the code.
    pub(super) cause: Option<FaultCause>,
}

impl Guard {
    /// Returns a guard with the limits of an exciter and of its gate, for `rate_hz` samples per second.
    pub fn new(rate_hz: u16, timing: &Timing, exciter: Exciter, limits: GateSpec) -> Guard {
        Guard {
            exciter,
            limits,
            rate_hz,
            timeout_ns: timing.command_timeout_ns,
            gate: CommandGate::new(timing.command_age_ns, rate_hz),
            // The ramp is stated in time and counted in samples, rounded up, so that it is never shorter than
            // stated.
            hold: Hold::new(timing.ramp_ns.saturating_mul(rate_hz.into()).div_ceil(1_000_000_000)),
            sample: 0,
            travel_m: Some(0.0),
            taken_ns: 0,
            refused_since_taken: 0,
            refusals: Refusals::default(),
            unheeded: Unheeded::default(),
            cause: None,
        }
    }

    /// Notes a measured sample with the distance of the driven point from rest, m. The distance may be left out if the
    /// gate does not limit it.
    pub fn measured(&mut self, sample: u64, travel_m: Option<f64>) {
        self.sample = sample;
        self.travel_m = travel_m;
    }

    /// Arms the plant; no sample counts as answered.
    pub fn arm(&mut self, core: &mut NodeCore) {
        self.gate.arm();
        // Frames that were rejected before the plant was armed can't be the reason of a timeout after it.
        self.heeded();
        // The timeout runs from arming on, so that a controller that arms the plant and then says nothing is noticed.
        self.taken_ns = core.listening.listened_ns();
        self.refused_since_taken = 0;
        core.turn(StateEvent::Arm);
    }

    /// Disarms an armed plant; an acting load ramps to zero.
    pub fn disarm(&mut self, core: &mut NodeCore) {
        // Only an operational plant turns. In every other state the load is zero already, or ramps to it.
        if core.turn(StateEvent::Disarm) {
            self.hold.release();
        }
    }

    /// Puts the node into the fault state. An acting load ramps to zero, or is dropped at once in a fault that leaves
    /// the exciter without effect. Returns the emergency, or `None` if a fault is latched already.
    pub fn fault(&mut self, core: &mut NodeCore, code: EmergencyCode, detail: u16) -> Option<Emergency> {
        debug_assert!(!code.is_notice(), "{code:?} is no fault");
        match code {
            // There is nothing to ramp: the simulation can't continue, or the exciter exerts no load any more.
            EmergencyCode::SimulationFailed | EmergencyCode::ExciterTripped => self.hold.take(Load::default()),
            _ => self.hold.release(),
        }
        let emergency = self.emergency(code, detail);
        // Only the first fault is latched and reported. Those that follow from it would hide the reason.
        if !core.fail(emergency) {
            return None;
        }
        // Rejected frames explain a command timeout, and no other fault.
        let is_unheeded = code == EmergencyCode::CommandTimeout && !self.unheeded.is_empty();
        self.cause = is_unheeded.then(|| FaultCause::Unheeded(self.unheeded.clone()));
        Some(emergency)
    }

    /// Returns an emergency of the plant at the last measured sample.
    pub fn emergency(&self, code: EmergencyCode, detail: u16) -> Emergency {
        Emergency { node: Node::Plant, code, detail, sample: self.sample as u16 }
    }

    /// Accepts a command that answers the sample of index `index` and holds its load, if `state` and all limits
    /// allow. The state is that of the core, or another one if the drives that the command is for are not
    /// ready.
    ///
    /// # Errors
    /// The reason of the rejection, which is counted and noted.
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
                // The first rejected load is kept with its sample: the counts alone do not tell what the
                // controller asked for.
                self.refusals.keep_load(RefusedLoad { sample: self.sample, load, refusal });
                self.refuse(core, refusal);
                Err(refusal)
            }
        }
    }

    /// Notes that everything commanded is accepted: what came before and was not used causes nothing that
    /// follows.
    pub fn heeded(&mut self) {
        self.unheeded = Unheeded::default();
    }

    /// Counts and notes a rejected command.
    pub fn refuse(&mut self, core: &mut NodeCore, refusal: Refusal) {
        self.refused_since_taken += 1;
        self.refusals.add(refusal);
        core.note(NodeEvent::Refused(refusal));
    }

    /// Returns whether commands have been rejected since the last accepted one.
    pub fn has_refused(&self) -> bool {
        self.refused_since_taken > 0
    }

    /// Returns whether the last measured sample has its answer.
    pub fn is_answered(&self) -> bool {
        self.gate.answered() == Some(self.sample)
    }

    /// Returns whether the plant has listened for longer than the timeout since the last accepted command.
    pub fn is_timed_out(&self, core: &NodeCore) -> bool {
        core.listening.has_passed(self.taken_ns, self.timeout_ns)
    }

    /// Returns the time at which to check [`Guard::is_timed_out`] next, ns.
    pub fn deadline_ns(&self, core: &NodeCore) -> u64 {
        core.listening.next_look_ns(self.taken_ns, self.timeout_ns)
    }

    /// Returns the detail of [`EmergencyCode::CommandTimeout`].
    pub fn timeout_detail(&self) -> u16 {
        // The last reason is that of the whole run. It belongs to this timeout only if a command was rejected since
        // the last accepted one.
        Refusal::detail(self.refused_since_taken, self.refusals.last().filter(|_| self.has_refused()))
    }

    /// Returns the counts of valid commands that were rejected, by reason.
    pub fn refusals(&self) -> &Refusals {
        &self.refusals
    }

    /// Holds a part of the held load, without that of a drive which has stopped.
    pub fn reduce(&mut self, load: Load) {
        self.hold.take(load);
    }

    /// Starts the ramp to zero.
    pub fn release(&mut self) {
        self.hold.release();
    }

    /// Returns the load of the next sample period, one step down a running ramp.
    pub fn load(&mut self) -> Load {
        self.hold.next()
    }

    /// Returns the number of samples until the ramp ends; 0 if none runs.
    pub fn ramp_left(&self) -> u64 {
        self.hold.ramp_left()
    }
}
