//! The plant's node of Resonarm's protocol: every command to the arm passes its gate.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::interface::{PlantInterface, PublishError, PublishedSample};
use resonarm_protocol::node::{Link, NodeCore, NodeEvent, Timing, Unused};
use resonarm_protocol::{
    Capabilities, Emergency, EmergencyCode, EncodeError, Frame, Heartbeat, Hello, Message, Mismatch, Network, Node,
    NodeState, OperatorCommand, OperatorRequest, Profile, Refusal, SamplesPerFrame, SensorPair, SensorValues,
    StateEvent, Trip,
};

use super::cause::RefusedFor;
use super::guard::Guard;
use super::sample;
use crate::rig::{Exciter, GateSpec, Load, Measurement};

/// The plant as a node: it publishes samples and accepts commands, which act only while it is armed.
#[derive(Clone, Debug)]
pub struct PlantNode {
    link: Link,
    guard: Guard,
    partner: Option<Hello>,
    /// Largest number of samples in a frame that the exciter accepts.
    partner_samples: SamplesPerFrame,
    /// Number of samples in a frame since arming.
    samples_per_frame: SamplesPerFrame,
    /// First sample of a frame of two, which is sent with the next.
    first: Option<SensorValues>,
    slipped_periods: u64,
    /// Index in the last received command, until [`PlantInterface::take_echoed`] takes it.
    echoed: Option<u16>,
    is_leaving: bool,
    /// Last fault of the exciter, until it leaves its fault state.
    exciter_fault: Option<Emergency>,
    /// Fault of the exciter that caused the node's last fault, if any.
    reason: Option<Emergency>,
    /// Load that the exciter in the same loop commands, with the index of the sample that it answers: its parts that no
    /// frame carries. `None` on a bus.
    handed_over: Option<(u16, Load)>,
}

impl PlantNode {
    /// Returns a node that publishes `rate_hz` samples per second for an exciter with these limits.
    pub fn new(network: Network, rate_hz: u16, timing: Timing, exciter: Exciter) -> PlantNode {
        let (force_limit_n, torque_limit_nm) = exciter.limits();
        let capabilities =
            Capabilities { node: Node::Plant, samples_per_frame: SamplesPerFrame::One, force_limit_n, torque_limit_nm };
        PlantNode {
            link: Link::new(network, rate_hz, timing, capabilities),
            guard: Guard::new(rate_hz, &timing, exciter, GateSpec::default()),
            partner: None,
            partner_samples: SamplesPerFrame::One,
            samples_per_frame: SamplesPerFrame::One,
            first: None,
            slipped_periods: 0,
            echoed: None,
            is_leaving: false,
            exciter_fault: None,
            reason: None,
            handed_over: None,
        }
    }

    /// Returns the node with frames of up to this many samples, for an exciter that accepts them (FD profile).
    pub fn with_samples_per_frame(mut self, most: SamplesPerFrame) -> PlantNode {
        self.link.set_samples_per_frame(most);
        self
    }

    /// Returns the node with these limits of its gate.
    pub fn with_limits(mut self, limits: GateSpec) -> PlantNode {
        self.guard.limits = limits;
        self
    }

    /// Returns the number of lost frames, by the gaps in the counters.
    pub fn lost_frames(&self) -> u64 {
        self.link.lost_frames()
    }

    /// Returns the sample periods by which the schedule has moved: the sum of all calls of
    /// [`PlantInterface::slip`].
    pub fn slipped_periods(&self) -> u64 {
        self.slipped_periods
    }

    /// Returns whether nothing is left to do after a fault, a disarm or [`PlantInterface::leave`]: the node is
    /// not armed, the load is zero and all frames have been sent.
    pub fn is_quiet(&self) -> bool {
        !self.is_armed() && !self.is_ramping() && self.waiting() == 0
    }

    /// Answers a new partner at once, so that it need not wait for the next hello.
    fn meet(&mut self, now_ns: u64, hello: Hello) {
        // A hello that repeats is not answered, or two nodes would answer each other forever.
        if self.partner.replace(hello).is_none() {
            self.link.send_hello(now_ns);
        }
    }

    fn arm(&mut self, now_ns: u64) {
        if self.is_leaving {
            return self.link.send_emergency(self.guard.emergency(EmergencyCode::Leaving, self.ramp_detail()));
        }
        let mismatch = match &self.partner {
            None => Some(Mismatch::NoHello),
            Some(partner) => self.link.hello().mismatch(partner),
        };
        if let Some(mismatch) = mismatch {
            self.link.send_emergency(self.guard.emergency(EmergencyCode::Incompatible, mismatch as u16));
            return;
        }
        // Both nodes must agree on the number of samples, so the smaller one is used while armed.
        self.samples_per_frame = self.link.samples_per_frame().min(self.partner_samples);
        self.guard.arm(&mut self.link.core);
        self.link.announce(now_ns);
    }

    /// Disarms an armed plant; the load ramps to zero.
    fn disarm(&mut self, now_ns: u64) {
        self.guard.disarm(&mut self.link.core);
        self.link.announce(now_ns);
    }

    /// Follows the exciter's state: its restart or fault ends the arming.
    fn watch(&mut self, now_ns: u64, state: NodeState) {
        if state == NodeState::BootUp {
            self.forget_partner();
        }
        // A fault that the exciter has left is no longer the reason of anything that follows.
        if state != NodeState::Fault {
            self.exciter_fault = None;
        }
        if matches!(state, NodeState::BootUp | NodeState::Fault) && self.is_armed() {
            self.fault_of_exciter(now_ns);
        }
    }

    /// Enters a fault because of the exciter's fault. If the exciter has timed out waiting for a sample because
    /// its commands were rejected, as in lockstep, the plant reports that cause: no valid command was received.
    fn fault_of_exciter(&mut self, now_ns: u64) {
        let has_waited = self.exciter_fault.is_some_and(|said| said.code == EmergencyCode::SensorTimeout);
        // Both ends would otherwise blame each other: the exciter for the missing sample, the plant for the
        // exciter's fault.
        if has_waited && self.guard.has_refused() {
            self.command_timeout(now_ns);
        } else {
            self.fault(now_ns, EmergencyCode::PartnerFault, u16::from(Node::Exciter.number()));
            self.reason = self.exciter_fault;
        }
    }

    /// Enters a fault for lack of a valid command. If the exciter has reported a fault, that is the reason,
    /// even if its heartbeat is still under way.
    fn command_timeout(&mut self, now_ns: u64) {
        self.fault(now_ns, EmergencyCode::CommandTimeout, self.guard.timeout_detail());
        self.reason = self.exciter_fault;
    }

    fn forget_partner(&mut self) {
        self.partner = None;
        self.partner_samples = SamplesPerFrame::One;
    }

    /// Handles the exciter's departure: it is forgotten, and an armed plant disarms.
    fn exciter_left(&mut self, now_ns: u64, emergency: Emergency) {
        self.forget_partner();
        self.link.core.note(NodeEvent::Emergency(emergency));
        self.disarm(now_ns);
    }

    /// Accepts a command, or rejects it with a reason.
    ///
    /// Beyond the travel limit an operational plant faults: it would otherwise be driven on once it swings
    /// back.
    fn take(&mut self, now_ns: u64, index: u16, carried: &Load) {
        // Taken also from a command that the gate rejects: the run times the round trip by it, which does not depend
        // on the load.
        self.echoed = Some(index);
        let load = self.completed(index, carried);
        let state = self.state();
        match self.guard.take(&mut self.link.core, state, index, load) {
            Ok(()) => self.guard.heeded(),
            Err(Refusal::Travel) => self.fault(now_ns, EmergencyCode::ExciterTripped, Trip::Travel as u16),
            Err(_) => {}
        }
    }

    /// Returns the load of a command that answers the sample `index`, with the parts that no frame carries. Parts that
    /// were handed over for another sample stay 0.
    ///
    /// A free run must not differ from one in lockstep in the sign of a zero. So the parts in the frame are copied, with
    /// their sign, and of the others a zero is positive, as it is without a controller in the loop.
    fn completed(&self, index: u16, carried: &Load) -> Load {
        let mut load = match self.handed_over {
            Some((answered, load)) if answered == index => Load::from_parts(&load.parts().map(|part| part + 0.0)),
            _ => Load::default(),
        };
        let [torque1_nm, torque2_nm, x_n, y_n] = carried.native_parts();
        load.torque_nm[0] = torque1_nm;
        load.torque_nm[1] = torque2_nm;
        load.force_n.x = x_n;
        load.force_n.y = y_n;
        load
    }

    /// Publishes one sample per frame, or two: then the one with an even index is sent with the next.
    fn publish_fd(&mut self, measurement: &Measurement) -> Result<(), EncodeError> {
        let sensors = sample::sensors(measurement);
        // The second of two samples completes the pair, also if the plant was disarmed in between.
        if let Some(first) = self.first.take() {
            let sample = sensors.sample.wrapping_sub(1);
            return self.link.send(&Message::SensorPair(SensorPair { values: [first, sensors.values], sample }));
        }
        match self.samples_per_frame {
            SamplesPerFrame::Two if sensors.sample.is_multiple_of(2) && self.is_armed() => {
                self.first = Some(sensors.values);
                // The first sample is checked now, although it is sent later: the error belongs to the sample
                // that has it.
                Message::Sensors(sensors).check(self.link.network())
            }
            SamplesPerFrame::One | SamplesPerFrame::Two => self.link.send(&Message::Sensors(sensors)),
        }
    }

    fn ramp_detail(&self) -> u16 {
        u16::try_from(self.guard.ramp_left()).unwrap_or(u16::MAX)
    }

    /// Returns the next frame to send. Fetch it again after any other call, which may change it.
    pub fn next_frame(&self) -> Option<Frame> {
        self.link.next_frame()
    }

    /// Returns the next frame, which then counts as sent.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        let frame = self.next_frame()?;
        self.frame_sent();
        Some(frame)
    }
}

impl PlantInterface for PlantNode {
    fn core(&self) -> &NodeCore {
        &self.link.core
    }

    fn core_mut(&mut self) -> &mut NodeCore {
        &mut self.link.core
    }

    fn guard(&self) -> &Guard {
        &self.guard
    }

    fn waiting(&self) -> usize {
        self.link.waiting()
    }

    fn start(&mut self, now_ns: u64) {
        self.link.start(now_ns);
    }

    /// Returns whether the last measured sample awaits no answer: it has one, or is sent with the next sample.
    fn is_answered(&self) -> bool {
        self.holds_sample() || self.guard.is_answered()
    }

    fn sends_unarmed_readings(&self) -> bool {
        false
    }

    fn fault_reason(&self) -> Option<Emergency> {
        self.reason.filter(|_| self.state() == NodeState::Fault)
    }

    fn take_echoed(&mut self) -> Option<u16> {
        self.echoed.take()
    }

    fn holds_sample(&self) -> bool {
        self.first.is_some()
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        let message = match self.link.accept(now_ns, frame) {
            Ok(Some(message)) => message,
            Ok(None) => return,
            Err(Unused::Rejected(error)) => return self.guard.unheeded.refuse(frame, RefusedFor::Protocol(error)),
            Err(Unused::SecondSender(identifier)) => {
                return self.fault(now_ns, EmergencyCode::SecondSender, identifier);
            }
        };
        match message {
            Message::Operator(OperatorCommand { request, target: Node::Plant }) => self.execute(now_ns, request),
            Message::Force(c) => self.take(now_ns, c.sample, &Load::force_n(c.force_x_n, c.force_y_n)),
            Message::Torque(c) => self.take(now_ns, c.sample, &Load::torque_nm(c.torque1_nm, c.torque2_nm)),
            Message::ExciterHello(hello) => self.meet(now_ns, hello),
            Message::Heartbeat(Heartbeat { node: Node::Exciter, state }) => self.watch(now_ns, state),
            // A node that states no capabilities gets one sample a frame, which every exciter accepts.
            Message::Capabilities(exciter) => self.partner_samples = exciter.samples_per_frame,
            Message::Emergency(emergency) if emergency.code == EmergencyCode::Leaving => {
                self.exciter_left(now_ns, emergency)
            }
            Message::Emergency(emergency) if !emergency.code.is_notice() => {
                self.exciter_fault = Some(emergency);
                self.link.core.note(NodeEvent::PartnerEmergency(emergency));
            }
            _ => {}
        }
    }

    fn execute(&mut self, now_ns: u64, request: OperatorRequest) {
        match request {
            OperatorRequest::Arm if self.state() == NodeState::PreOperational => self.arm(now_ns),
            OperatorRequest::Arm => {}
            OperatorRequest::Disarm => self.disarm(now_ns),
            OperatorRequest::Reset => self.link.transition(now_ns, StateEvent::Reset),
        }
    }

    fn handle_deadline(&mut self, now_ns: u64) {
        self.link.handle_deadline(now_ns);
        if !self.is_armed() {
            return;
        }
        // A jammed bus comes first, since it may be the reason why no command and no heartbeat has come.
        if self.link.core.is_jammed() {
            self.fault(now_ns, EmergencyCode::BusLoss, self.link.core.not_sent(self.waiting()));
        } else if self.guard.is_timed_out(&self.link.core) {
            self.command_timeout(now_ns);
        } else if self.link.is_partner_lost() {
            self.fault(now_ns, EmergencyCode::HeartbeatLost, u16::from(Node::Exciter.number()));
        }
    }

    fn next_deadline_ns(&self) -> u64 {
        let link = self.link.next_deadline_ns();
        if !self.is_armed() {
            return link;
        }
        link.min(self.guard.deadline_ns(&self.link.core)).min(self.link.partner_deadline_ns())
    }

    /// Publishes impedance head, accelerometer B and accelerometer C; in the FD profile all in one frame, alone
    /// or with the sample before it. If a value is not a number, the frames before it are sent.
    fn publish(&mut self, sample: &PublishedSample) -> Result<(), PublishError> {
        let PublishedSample { measurement, travel_m, .. } = sample;
        self.guard.measured(measurement.sample, *travel_m);
        Ok(match self.link.network().profile() {
            Profile::Classic => sample::classic(measurement).iter().try_for_each(|message| self.link.send(message)),
            Profile::Fd => self.publish_fd(measurement),
        }?)
    }

    fn load(&mut self) -> Load {
        self.guard.load()
    }

    fn hand_over(&mut self, index: u16, load: &Load) {
        self.handed_over = Some((index, *load));
    }

    fn fault(&mut self, now_ns: u64, code: EmergencyCode, detail: u16) {
        if let Some(emergency) = self.guard.fault(&mut self.link.core, code, detail) {
            self.reason = None;
            self.link.send_fault(now_ns, emergency);
        }
    }

    fn slip(&mut self, periods: u64) {
        self.slipped_periods = self.slipped_periods.saturating_add(periods);
        let detail = u16::try_from(periods).unwrap_or(u16::MAX);
        self.link.send_emergency(self.guard.emergency(EmergencyCode::ScheduleSlipped, detail));
    }

    fn leave(&mut self, now_ns: u64) {
        if self.is_leaving {
            return;
        }
        self.is_leaving = true;
        // The ramp begins before the emergency is made, which states how many samples the ramp still takes.
        self.guard.release();
        self.link.send_emergency(self.guard.emergency(EmergencyCode::Leaving, self.ramp_detail()));
        self.disarm(now_ns);
    }

    fn waiting_frames(&mut self, most: usize, frames: &mut Vec<Frame>) {
        frames.extend(self.link.waiting_frames().take(most));
    }

    fn frame_sent(&mut self) {
        self.link.frame_sent();
    }

    fn boxed_clone(&self) -> Box<dyn PlantInterface> {
        Box::new(self.clone())
    }
}
