//! The plant's node: the gate through which every command to the arm passes.

use resonarm_protocol::{
    Acceleration, Emergency, EncodeError, FaultCode, Frame, Heartbeat, Hello, ImpedanceHead, Message, Mismatch,
    Network, Node, NodeState, OperatorCommand, OperatorRequest, StateEvent,
};

use super::link::Link;
use super::{NodeEvent, Refusal, Timing};
use crate::arm::Load;
use crate::rig::{ExciterSpec, Measurement};

/// The plant as a node: publishes samples, takes commands, and lets none through unless armed.
#[derive(Clone, Debug)]
pub struct PlantNode {
    link: Link,
    timing: Timing,
    rate_hz: u16,
    exciter: ExciterSpec,
    partner: Option<Hello>,
    partner_heard_ns: u64,
    /// The sample published last.
    step: u64,
    held: Load,
    /// The sample that the last command taken answers, since arming.
    answered: Option<u64>,
    command_taken_ns: u64,
    refused_since_taken: u16,
    ramp_left: u64,
    /// Why the node faulted last.
    emergency: Option<Emergency>,
}

impl PlantNode {
    /// A node that publishes `rate_hz` samples a second for an exciter of these limits.
    pub fn new(network: Network, rate_hz: u16, timing: Timing, exciter: ExciterSpec) -> PlantNode {
        PlantNode {
            link: Link::new(Node::Plant, network, rate_hz, timing),
            timing,
            rate_hz,
            exciter,
            partner: None,
            partner_heard_ns: 0,
            step: 0,
            held: Load::default(),
            answered: None,
            command_taken_ns: 0,
            refused_since_taken: 0,
            ramp_left: 0,
            emergency: None,
        }
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
        self.emergency.filter(|_| self.state() == NodeState::Fault)
    }

    /// Whether commands reach the arm.
    pub fn is_armed(&self) -> bool {
        self.link.state() == NodeState::Operational
    }

    /// Whether a command that answers the sample published last has been taken.
    pub fn is_answered(&self) -> bool {
        self.answered == Some(self.step)
    }

    /// Frames of the protocol refused for their checks (E2E, length, values).
    pub fn refused_frames(&self) -> u64 {
        self.link.refused_frames()
    }

    /// Frames that gaps in the counters say were lost.
    pub fn lost_frames(&self) -> u64 {
        self.link.lost_frames()
    }

    /// Frames not sent because they were not fetched in time.
    pub fn unsent_frames(&self) -> u64 {
        self.link.unsent_frames()
    }

    /// Takes in a frame from the bus; one of another protocol means nothing.
    pub fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        let Some(message) = self.link.accept(frame) else { return };
        self.partner_heard_ns = now_ns;
        match message {
            Message::Operator(OperatorCommand { request, target: Node::Plant }) => self.obey(now_ns, request),
            Message::Force(c) => self.take(now_ns, c.sample, Load::force_n(c.force_x_n, c.force_y_n)),
            Message::Torque(c) => self.take(now_ns, c.sample, Load::torque_nm(c.torque1_nm, c.torque2_nm)),
            Message::ExciterHello(hello) => self.greet(now_ns, hello),
            Message::Heartbeat(Heartbeat { node: Node::Exciter, state }) => self.watch(now_ns, state),
            _ => {}
        }
    }

    /// A new partner is answered at once, so that it need not wait for the next hello.
    fn greet(&mut self, now_ns: u64, hello: Hello) {
        if self.partner.replace(hello).is_none() {
            self.link.send_hello(now_ns);
        }
    }

    fn obey(&mut self, now_ns: u64, request: OperatorRequest) {
        match request {
            OperatorRequest::Arm if self.state() == NodeState::PreOperational => self.arm(now_ns),
            OperatorRequest::Disarm if self.is_armed() => self.leave(now_ns, StateEvent::Disarm),
            OperatorRequest::Reset => {
                self.link.transition(now_ns, StateEvent::Reset);
            }
            OperatorRequest::Arm | OperatorRequest::Disarm => {}
        }
    }

    fn arm(&mut self, now_ns: u64) {
        let mismatch = match &self.partner {
            None => Some(Mismatch::NoHello),
            Some(partner) => self.link.hello().mismatch(partner),
        };
        if let Some(mismatch) = mismatch {
            self.link.send_emergency(self.emergency(FaultCode::Incompatible, mismatch as u16));
            return;
        }
        self.held = Load::default();
        self.answered = None;
        self.command_taken_ns = now_ns;
        self.refused_since_taken = 0;
        self.link.transition(now_ns, StateEvent::Arm);
    }

    /// The exciter's own state: a restart or a fault of an armed exciter ends the arming.
    fn watch(&mut self, now_ns: u64, state: NodeState) {
        if state == NodeState::BootUp {
            self.partner = None;
        }
        if matches!(state, NodeState::BootUp | NodeState::Fault) && self.is_armed() {
            self.fault(now_ns, FaultCode::PartnerFault, u16::from(Node::Exciter.id()));
        }
    }

    /// The gate: every command is taken here or refused with a reason.
    fn take(&mut self, now_ns: u64, sample: u16, load: Load) {
        match self.check(sample, &load) {
            Ok(answered) => {
                self.held = load;
                self.answered = Some(answered);
                self.command_taken_ns = now_ns;
                self.refused_since_taken = 0;
            }
            Err(refusal) => {
                self.refused_since_taken = self.refused_since_taken.saturating_add(1);
                self.link.tell(NodeEvent::Refused(refusal));
            }
        }
    }

    fn check(&self, sample: u16, load: &Load) -> Result<u64, Refusal> {
        if !self.is_armed() {
            return Err(Refusal::NotArmed);
        }
        // Modulo 2¹⁶; a sample still to come has an age of nearly 2¹⁶.
        let age = u64::from((self.step as u16).wrapping_sub(sample));
        let limit = u64::from(self.rate_hz) * self.timing.command_age_ns / 1_000_000_000;
        let answered = self.step.checked_sub(age).filter(|_| age <= limit).ok_or(Refusal::Late)?;
        if self.answered.is_some_and(|last| answered < last) {
            return Err(Refusal::OutOfOrder);
        }
        if !self.exciter.can_produce(load) {
            return Err(Refusal::OutOfRange);
        }
        Ok(answered)
    }

    /// Does what is due: heartbeats, hellos, and the timeouts of an armed plant.
    pub fn handle_deadline(&mut self, now_ns: u64) {
        self.link.handle_deadline(now_ns);
        if !self.is_armed() {
            return;
        }
        if now_ns >= self.command_taken_ns + self.timing.command_timeout_ns {
            self.fault(now_ns, FaultCode::CommandTimeout, self.refused_since_taken);
        } else if now_ns >= self.partner_heard_ns + self.timing.partner_timeout_ns {
            self.fault(now_ns, FaultCode::HeartbeatLost, u16::from(Node::Exciter.id()));
        }
    }

    /// When [`PlantNode::handle_deadline`] is to be called next.
    pub fn next_deadline_ns(&self) -> u64 {
        let link = self.link.next_deadline_ns();
        if !self.is_armed() {
            return link;
        }
        let command = self.command_taken_ns + self.timing.command_timeout_ns;
        let partner = self.partner_heard_ns + self.timing.partner_timeout_ns;
        link.min(command).min(partner)
    }

    /// Publishes a sample: impedance head, accelerometer B, accelerometer C.
    ///
    /// # Errors
    /// [`EncodeError`] if a value is not a number; the frames before it are sent.
    pub fn publish(&mut self, measurement: &Measurement) -> Result<(), EncodeError> {
        self.step = measurement.step;
        let sample = measurement.step as u16;
        let [x, y] = measurement.head_force_n;
        self.link.send(&Message::Head(ImpedanceHead {
            force_x_n: x.value,
            force_y_n: y.value,
            x_saturated: x.clipped,
            y_saturated: y.clipped,
            sample,
        }))?;
        let acceleration = |[x, y]: [crate::rig::Reading; 2]| Acceleration {
            acceleration_x_m_s2: x.value,
            acceleration_y_m_s2: y.value,
            x_saturated: x.clipped,
            y_saturated: y.clipped,
            sample,
        };
        self.link.send(&Message::AccelerometerB(acceleration(measurement.acceleration_b_m_s2)))?;
        self.link.send(&Message::AccelerometerC(acceleration(measurement.acceleration_c_m_s2)))
    }

    /// The load to hold from the sample published last to the next. Call it once a sample: after a fault or a disarm each
    /// call goes one step down the ramp.
    ///
    /// The ramp of n samples holds the last command times (n−1)/n, (n−2)/n … 0.
    pub fn load(&mut self) -> Load {
        if self.is_armed() {
            return self.held;
        }
        if self.ramp_left == 0 {
            return Load::default();
        }
        self.ramp_left -= 1;
        self.held.scaled(self.ramp_left as f64 / self.ramp_samples() as f64)
    }

    fn ramp_samples(&self) -> u64 {
        (u64::from(self.rate_hz) * self.timing.ramp_ns).div_ceil(1_000_000_000).max(1)
    }

    /// Faults from outside: the simulation failed, ticks were missed, the bus was lost.
    pub fn fault(&mut self, now_ns: u64, code: FaultCode, detail: u16) {
        if self.state() == NodeState::Fault {
            return;
        }
        let emergency = self.emergency(code, detail);
        self.emergency = Some(emergency);
        self.link.send_emergency(emergency);
        self.leave(now_ns, StateEvent::Fault);
    }

    /// Leaves whatever state this is; from armed, the load ramps to zero.
    fn leave(&mut self, now_ns: u64, event: StateEvent) {
        if self.is_armed() {
            self.ramp_left = self.ramp_samples();
        }
        self.link.transition(now_ns, event);
    }

    fn emergency(&self, code: FaultCode, detail: u16) -> Emergency {
        Emergency { node: Node::Plant, code, detail, sample: self.step as u16 }
    }

    /// The next frame to send.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        self.link.poll_transmit()
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<NodeEvent> {
        self.link.poll_event()
    }
}
