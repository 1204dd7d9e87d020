//! The plant's node: every command to the arm passes its gate.

use resonarm_protocol::{
    Capabilities, Emergency, EmergencyCode, EncodeError, Frame, Heartbeat, Hello, Message, Mismatch, Network, Node,
    NodeState, OperatorCommand, OperatorRequest, Profile, SamplesPerFrame, SensorPair, SensorValues, StateEvent, Trip,
};

use resonarm_protocol::node::Link;

use super::cause::{FaultCause, RefusedFor};
use super::guard::Guard;
use super::sample;
use super::{NodeEvent, Refusal, Refusals, Timing};
use crate::rig::{Exciter, GateSpec, Measurement};
use resonarm_dynamics::arm::Load;

/// The plant as a node: publishes samples, takes commands, and passes them on only while armed.
#[derive(Clone, Debug)]
pub struct PlantNode {
    link: Link,
    guard: Guard,
    partner: Option<Hello>,
    /// The most samples in a frame that the exciter takes.
    partner_samples: SamplesPerFrame,
    /// How many samples a frame holds since arming.
    samples_per_frame: SamplesPerFrame,
    /// The first sample of a frame of two, sent with the next.
    first: Option<SensorValues>,
    slipped_periods: u64,
    /// The index in the command taken in last, until [`PlantNode::take_echoed`] takes it.
    echoed: Option<u16>,
    is_leaving: bool,
    /// The exciter's last fault, until it leaves its fault state.
    exciter_fault: Option<Emergency>,
    /// The exciter's fault that caused the last fault of the node, if any.
    reason: Option<Emergency>,
    /// Why the node faulted last, beyond the code.
    cause: Option<FaultCause>,
}

impl PlantNode {
    /// A node that publishes `rate_hz` samples a second for an exciter of these limits.
    pub fn new(network: Network, rate_hz: u16, timing: Timing, exciter: Exciter) -> PlantNode {
        let (force_limit_n, torque_limit_nm) = exciter.limits();
        let capabilities =
            Capabilities { node: Node::Plant, samples_per_frame: SamplesPerFrame::One, force_limit_n, torque_limit_nm };
        PlantNode {
            link: Link::new(network, rate_hz, timing, capabilities),
            guard: Guard::new(rate_hz, &timing, exciter),
            partner: None,
            partner_samples: SamplesPerFrame::One,
            samples_per_frame: SamplesPerFrame::One,
            first: None,
            slipped_periods: 0,
            echoed: None,
            is_leaving: false,
            exciter_fault: None,
            reason: None,
            cause: None,
        }
    }

    /// The node with frames of up to this many samples, for an exciter that takes them (FD profile).
    pub fn with_samples_per_frame(mut self, most: SamplesPerFrame) -> PlantNode {
        self.link.set_samples_per_frame(most);
        self
    }

    /// The node with limits of its gate.
    pub fn with_limits(mut self, limits: GateSpec) -> PlantNode {
        self.guard.set_limits(limits);
        self
    }

    /// Boots: boot-up heartbeat, pre-operational, hello.
    pub fn start(&mut self, now_ns: u64) {
        self.link.start(now_ns);
    }

    /// The node's state.
    pub fn state(&self) -> NodeState {
        self.link.state()
    }

    /// The fault that is latched now, if one is.
    pub fn latched_fault(&self) -> Option<Emergency> {
        self.link.latched_fault()
    }

    /// The exciter's fault that caused the latched fault, if any.
    pub fn fault_reason(&self) -> Option<Emergency> {
        self.reason.filter(|_| self.state() == NodeState::Fault)
    }

    /// How often the plant was armed.
    pub fn arms(&self) -> u32 {
        self.link.arms()
    }

    /// How often the armed plant was disarmed, or faulted.
    pub fn leaves(&self) -> u32 {
        self.link.leaves()
    }

    /// Why the plant faulted last, beyond the code of its fault.
    pub fn fault_cause(&self) -> Option<FaultCause> {
        self.cause.clone().filter(|_| self.state() == NodeState::Fault)
    }

    /// Whether commands reach the arm.
    pub fn is_armed(&self) -> bool {
        self.link.state() == NodeState::Operational
    }

    /// Whether the sample measured last awaits no answer: the answer has been taken, or the sample is sent with the
    /// next.
    pub fn is_answered(&self) -> bool {
        self.holds_sample() || self.guard.is_answered()
    }

    /// Whether the sample published last is sent with the next one.
    pub fn holds_sample(&self) -> bool {
        self.first.is_some()
    }

    /// The index of the sample that the last command received answers, also if it was refused; returned once.
    pub fn take_echoed(&mut self) -> Option<u16> {
        self.echoed.take()
    }

    /// The network.
    pub fn network(&self) -> Network {
        self.link.network()
    }

    /// Frames of the protocol refused for their checks (E2E, length, values).
    pub fn refused_frames(&self) -> u64 {
        self.link.refused_frames()
    }

    /// Those of them received under identifiers that only the plant sends: another network uses its base.
    pub fn other_sender_frames(&self) -> u64 {
        self.link.other_sender_frames()
    }

    /// Lost frames, by the gaps in the counters.
    pub fn lost_frames(&self) -> u64 {
        self.link.lost_frames()
    }

    /// Frames never sent, because newer ones replaced them.
    pub fn unsent_frames(&self) -> u64 {
        self.link.unsent_frames()
    }

    /// Valid commands that did not reach the arm, by reason.
    pub fn refusals(&self) -> &Refusals {
        self.guard.refusals()
    }

    /// Sample periods by which the schedule has moved: the sum of all calls of [`PlantNode::slip`].
    pub fn slipped_periods(&self) -> u64 {
        self.slipped_periods
    }

    /// Whether the load is ramping to zero.
    pub fn is_ramping(&self) -> bool {
        self.guard.ramp_left() > 0
    }

    /// Whether nothing is left to do after a fault, a disarm or [`PlantNode::leave`]: the node is unarmed, the load is
    /// zero and all frames are sent.
    pub fn is_quiet(&self) -> bool {
        !self.is_armed() && !self.is_ramping() && !self.link.has_frames()
    }

    /// Handles a frame from the bus; frames of other protocols are ignored.
    pub fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        let refused = self.link.refused_frames();
        let message = self.link.accept(now_ns, frame);
        if self.link.refused_frames() > refused
            && let Some(error) = self.link.refused_for()
        {
            self.guard.refuse_frame(frame, RefusedFor::Protocol(error));
        }
        if let Some(identifier) = self.link.take_second_sender() {
            self.fault(now_ns, EmergencyCode::SecondSender, identifier);
        }
        let Some(message) = message else { return };
        match message {
            Message::Operator(OperatorCommand { request, target: Node::Plant }) => self.execute(now_ns, request),
            Message::Force(c) => self.take(now_ns, c.sample, Load::force_n(c.force_x_n, c.force_y_n)),
            Message::Torque(c) => self.take(now_ns, c.sample, Load::torque_nm(c.torque1_nm, c.torque2_nm)),
            Message::ExciterHello(hello) => self.meet(now_ns, hello),
            Message::Heartbeat(Heartbeat { node: Node::Exciter, state }) => self.watch(now_ns, state),
            Message::Capabilities(exciter) => self.partner_samples = exciter.samples_per_frame,
            Message::Emergency(emergency) if emergency.code == EmergencyCode::Leaving => {
                self.exciter_left(now_ns, emergency)
            }
            Message::Emergency(emergency) if !emergency.code.is_notice() => {
                self.exciter_fault = Some(emergency);
                self.link.report(NodeEvent::PartnerEmergency(emergency));
            }
            _ => {}
        }
    }

    /// Answers a new partner at once, so that it need not wait for the next hello.
    fn meet(&mut self, now_ns: u64, hello: Hello) {
        if self.partner.replace(hello).is_none() {
            self.link.send_hello(now_ns);
        }
    }

    /// Executes an operator's request, from a frame or made at the plant itself, if the plant's state allows it.
    pub fn execute(&mut self, now_ns: u64, request: OperatorRequest) {
        match request {
            OperatorRequest::Arm if self.state() == NodeState::PreOperational => self.arm(now_ns),
            OperatorRequest::Disarm if self.is_armed() => self.exit(now_ns, StateEvent::Disarm),
            OperatorRequest::Reset => {
                self.link.transition(now_ns, StateEvent::Reset);
            }
            OperatorRequest::Arm | OperatorRequest::Disarm => {}
        }
    }

    fn arm(&mut self, now_ns: u64) {
        if self.is_leaving {
            return self.link.send_emergency(self.emergency(EmergencyCode::Leaving, self.ramp_detail()));
        }
        let mismatch = match &self.partner {
            None => Some(Mismatch::NoHello),
            Some(partner) => self.link.hello().mismatch(partner),
        };
        if let Some(mismatch) = mismatch {
            self.link.send_emergency(self.emergency(EmergencyCode::Incompatible, mismatch as u16));
            return;
        }
        self.guard.arm(self.link.listening());
        self.samples_per_frame = self.link.samples_per_frame().min(self.partner_samples);
        self.link.transition(now_ns, StateEvent::Arm);
    }

    /// Handles the exciter's state: a restart or a fault of the exciter ends the arming.
    fn watch(&mut self, now_ns: u64, state: NodeState) {
        if state == NodeState::BootUp {
            self.forget_partner();
        }
        if state != NodeState::Fault {
            self.exciter_fault = None;
        }
        if matches!(state, NodeState::BootUp | NodeState::Fault) && self.is_armed() {
            self.fault_of_exciter(now_ns);
        }
    }

    /// The exciter's fault is the plant's, too. If the exciter timed out waiting for a sample because its commands were
    /// refused, as in lockstep, the plant reports the cause: no valid command was received.
    fn fault_of_exciter(&mut self, now_ns: u64) {
        let has_waited = self.exciter_fault.is_some_and(|said| said.code == EmergencyCode::SensorTimeout);
        if has_waited && self.guard.has_refused() {
            self.command_timeout(now_ns);
        } else {
            self.fault(now_ns, EmergencyCode::PartnerFault, u16::from(Node::Exciter.number()));
            self.reason = self.exciter_fault;
        }
    }

    /// Faults for lack of a valid command. If the exciter has reported a fault, that is the reason, even if its
    /// heartbeat is still on its way.
    fn command_timeout(&mut self, now_ns: u64) {
        self.fault(now_ns, EmergencyCode::CommandTimeout, self.guard.timeout_detail());
        (self.reason, self.cause) = (self.exciter_fault, self.guard.unheeded().map(FaultCause::Unheeded));
    }

    fn forget_partner(&mut self) {
        (self.partner, self.partner_samples) = (None, SamplesPerFrame::One);
    }

    /// The exciter leaves the bus: it is forgotten, and an armed plant disarms.
    fn exciter_left(&mut self, now_ns: u64, emergency: Emergency) {
        self.forget_partner();
        self.link.report(NodeEvent::Emergency(emergency));
        if self.is_armed() {
            self.exit(now_ns, StateEvent::Disarm);
        }
    }

    /// Takes a command, or refuses it with a reason.
    ///
    /// Beyond the travel an operational plant faults: it would be driven on once it swings back.
    fn take(&mut self, now_ns: u64, index: u16, load: Load) {
        self.echoed = Some(index);
        let outcome = self.guard.take(self.link.state(), self.link.listening(), index, load);
        if outcome.is_ok() {
            self.guard.heeded();
        }
        if let Err(refusal) = outcome {
            self.link.report(NodeEvent::Refused(refusal));
            if refusal == Refusal::Travel {
                self.fault(now_ns, EmergencyCode::ExciterTripped, Trip::Travel as u16);
            }
        }
    }

    /// Does what is due: heartbeats, hellos, and the timeouts of an armed plant.
    pub fn handle_deadline(&mut self, now_ns: u64) {
        self.link.handle_deadline(now_ns);
        if !self.is_armed() {
            return;
        }
        if self.link.is_jammed() {
            self.fault(now_ns, EmergencyCode::BusLoss, self.link.not_sent());
        } else if self.guard.is_timed_out(self.link.listening()) {
            self.command_timeout(now_ns);
        } else if self.link.is_partner_lost() {
            self.fault(now_ns, EmergencyCode::HeartbeatLost, u16::from(Node::Exciter.number()));
        }
    }

    /// When [`PlantNode::handle_deadline`] is to be called next, at the latest.
    pub fn next_deadline_ns(&self) -> u64 {
        let link = self.link.next_deadline_ns();
        if !self.is_armed() {
            return link;
        }
        link.min(self.guard.deadline_ns(self.link.listening())).min(self.link.partner_deadline_ns())
    }

    /// States the travel at the sample that is published next, m. By default it is zero.
    pub fn set_travel(&mut self, travel_m: f64) {
        self.guard.set_travel(travel_m);
    }

    /// Publishes a sample: impedance head, accelerometer B, accelerometer C; in the FD profile all in one frame, alone
    /// or with the sample before it.
    ///
    /// # Errors
    /// [`EncodeError`] if a value is not a number; the frames before it are sent.
    pub fn publish(&mut self, measurement: &Measurement) -> Result<(), EncodeError> {
        self.guard.measured(measurement.sample);
        match self.link.network().profile() {
            Profile::Classic => sample::classic(measurement).iter().try_for_each(|message| self.link.send(message)),
            Profile::Fd => self.publish_fd(measurement),
        }
    }

    /// One sample a frame, or two: then the one with an even index is sent with the next.
    fn publish_fd(&mut self, measurement: &Measurement) -> Result<(), EncodeError> {
        let sensors = sample::sensors(measurement);
        if let Some(first) = self.first.take() {
            let sample = sensors.sample.wrapping_sub(1);
            return self.link.send(&Message::SensorPair(SensorPair { values: [first, sensors.values], sample }));
        }
        match self.samples_per_frame {
            SamplesPerFrame::Two if sensors.sample.is_multiple_of(2) && self.is_armed() => {
                self.first = Some(sensors.values);
                Message::Sensors(sensors).check(self.link.network())
            }
            SamplesPerFrame::One | SamplesPerFrame::Two => self.link.send(&Message::Sensors(sensors)),
        }
    }

    /// The load to hold from the sample published last to the next. Call it once a sample: after a fault or a disarm
    /// each call goes one step down the ramp.
    ///
    /// The ramp of n samples holds the last command times (n−1)/n, (n−2)/n … 0. Arming doesn't end it; the first
    /// command taken does.
    pub fn load(&mut self) -> Load {
        self.guard.load()
    }

    /// Faults from outside: the simulation failed, its shaker tripped, or ticks were missed. The load ramps to zero; if
    /// the simulation can't continue or the exciter is off, it is dropped at once.
    pub fn fault(&mut self, now_ns: u64, code: EmergencyCode, detail: u16) {
        debug_assert!(!code.is_notice(), "{code:?} is no fault");
        self.guard.fault(code);
        if self.state() == NodeState::Fault {
            return;
        }
        let emergency = self.emergency(code, detail);
        (self.reason, self.cause) = (None, None);
        if self.is_armed() {
            self.guard.release();
        }
        self.link.send_fault(now_ns, emergency);
    }

    /// The bus is off: an armed plant faults. One that is not armed waits for the bus to come back.
    pub fn bus_lost(&mut self, now_ns: u64) {
        if self.is_armed() {
            self.fault(now_ns, EmergencyCode::BusLoss, self.link.not_sent());
        }
    }

    /// Reports that the schedule has moved by `periods` missed sample periods. The sample index continues without gap.
    pub fn slip(&mut self, periods: u64) {
        self.slipped_periods = self.slipped_periods.saturating_add(periods);
        let detail = u16::try_from(periods).unwrap_or(u16::MAX);
        self.link.send_emergency(self.emergency(EmergencyCode::ScheduleSlipped, detail));
    }

    /// Leaves the bus in good order: announces it, and disarms if armed. The plant is not armed again; it has left when
    /// [`PlantNode::is_quiet`].
    pub fn leave(&mut self, now_ns: u64) {
        if self.is_leaving {
            return;
        }
        self.is_leaving = true;
        if self.is_armed() {
            self.guard.release();
        }
        self.link.send_emergency(self.emergency(EmergencyCode::Leaving, self.ramp_detail()));
        if self.is_armed() {
            self.exit(now_ns, StateEvent::Disarm);
        }
    }

    /// Leaves the current state; from armed, the load ramps to zero.
    fn exit(&mut self, now_ns: u64, event: StateEvent) {
        if self.is_armed() {
            self.guard.release();
        }
        self.link.transition(now_ns, event);
    }

    fn ramp_detail(&self) -> u16 {
        u16::try_from(self.guard.ramp_left()).unwrap_or(u16::MAX)
    }

    fn emergency(&self, code: EmergencyCode, detail: u16) -> Emergency {
        Emergency { node: Node::Plant, code, detail, sample: self.guard.sample() as u16 }
    }

    /// The next frame to send. Fetch it again after any other call, which may change it.
    pub fn next_frame(&self) -> Option<Frame> {
        self.link.next_frame()
    }

    /// All frames to send, in their order: [`PlantNode::next_frame`] returns the first, and the second after
    /// [`PlantNode::frame_sent`].
    pub fn waiting_frames(&self) -> impl Iterator<Item = Frame> {
        self.link.waiting_frames()
    }

    /// Records that the bus has taken the frame of [`PlantNode::next_frame`].
    pub fn frame_sent(&mut self) {
        self.link.frame_sent();
    }

    /// The next frame, which then counts as sent.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        let frame = self.next_frame()?;
        self.frame_sent();
        Some(frame)
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<NodeEvent> {
        self.link.poll_event()
    }
}
