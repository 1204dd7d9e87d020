//! The exciter's node: arms the plant, lets a controller answer its samples, disarms it.

use super::link::Link;
use super::phase::{Leave, Phase};
use super::sequence::{Place, Sequence};
use super::{NodeEvent, Timing};
use crate::{
    Acceleration, Capabilities, Emergency, EmergencyCode, ForceCommand, Frame, Heartbeat, Hello, ImpedanceHead,
    Message, Mismatch, Network, Node, NodeState, OperatorCommand, OperatorRequest, SensorPair, SensorValues, Sensors,
    StateEvent, TorqueCommand,
};

use super::answering::{Answer, Answering, ExciterOutcome};

/// Time between two attempts to arm or disarm the plant, ns.
const RETRY_NS: u64 = 100_000_000;

/// An exciter's node, with its controller.
#[derive(Clone, Debug)]
pub struct ExciterNode<C: Answering> {
    link: Link,
    timing: Timing,
    controller: C,
    phase: Phase<C::Abort>,
    plant_hello: Option<Hello>,
    plant_state: Option<NodeState>,
    leave: Leave,
    retry_at_ns: u64,
    /// When the last new sample was received, in time listened.
    sample_heard_ns: u64,
    head: Option<ImpedanceHead>,
    b: Option<Acceleration>,
    sequence: Sequence,
    /// The last sample answered, counted from the first.
    answered: Option<u64>,
    missed_samples: u64,
    slipped_periods: u64,
    plant_fault: Option<Emergency>,
}

impl<C: Answering> ExciterNode<C> {
    /// A node with these capabilities of an exciter; `controller` answers a plant with `rate_hz` samples a
    /// second.
    ///
    /// With two samples per frame the controller answers both, and its answer to the second is held for two sample
    /// periods. In the classic profile capabilities are not sent; in the FD profile a command beyond their limits is a
    /// fault, [`EmergencyCode::CommandOutOfRange`], and is not sent.
    pub fn new(network: Network, rate_hz: u16, timing: Timing, capabilities: Capabilities, controller: C) -> Self {
        let capabilities = Capabilities { node: Node::Exciter, ..capabilities };
        ExciterNode {
            link: Link::new(network, rate_hz, timing, capabilities),
            timing,
            controller,
            phase: Phase::Arming,
            plant_hello: None,
            plant_state: None,
            leave: Leave::Stay,
            retry_at_ns: 0,
            sample_heard_ns: 0,
            head: None,
            b: None,
            sequence: Sequence::new(rate_hz),
            answered: None,
            missed_samples: 0,
            slipped_periods: 0,
            plant_fault: None,
        }
    }

    /// Boots: boot-up heartbeat, pre-operational, hello.
    pub fn start(&mut self, now_ns: u64) {
        self.link.start(now_ns);
        self.retry_at_ns = now_ns;
    }

    /// The node's state.
    pub fn state(&self) -> NodeState {
        self.link.state()
    }

    /// The controller.
    pub fn controller(&self) -> &C {
        &self.controller
    }

    /// The controller, to read its results.
    pub fn controller_mut(&mut self) -> &mut C {
        &mut self.controller
    }

    /// How the work ended, once it has.
    pub fn outcome(&self) -> Option<ExciterOutcome<C::Abort>> {
        match self.phase {
            Phase::Done(outcome) => Some(outcome),
            _ => None,
        }
    }

    /// Whether a plant has been heard.
    pub fn has_heard_plant(&self) -> bool {
        self.plant_state.is_some() || self.plant_hello.is_some()
    }

    /// Samples answered so far, including lost ones.
    pub fn samples_played(&self) -> u64 {
        self.answered.map_or(0, |n| n + 1)
    }

    /// Samples of the plant that were never complete.
    pub fn missed_samples(&self) -> u64 {
        self.missed_samples
    }

    /// Samples ignored because their index was repeated or older.
    pub fn stale_samples(&self) -> u64 {
        self.sequence.stale()
    }

    /// Sample periods by which the plant said its schedule has moved.
    pub fn slipped_periods(&self) -> u64 {
        self.slipped_periods
    }

    /// The network.
    pub fn network(&self) -> Network {
        self.link.network()
    }

    /// Frames of the protocol refused by the checks (E2E, length, values).
    pub fn refused_frames(&self) -> u64 {
        self.link.refused_frames()
    }

    /// Those of them with identifiers that only this node sends: another network has the same base.
    pub fn other_sender_frames(&self) -> u64 {
        self.link.other_sender_frames()
    }

    /// The plant's fault, reported after this node had missed its samples and faulted: the reason for the missing
    /// samples.
    pub fn plant_fault(&self) -> Option<Emergency> {
        self.plant_fault
    }

    /// Whether this node has faulted for lack of samples, and the plant has not yet reported its state.
    pub fn awaits_reason(&self) -> bool {
        self.has_missed_samples() && self.plant_state == Some(NodeState::Operational) && self.plant_fault.is_none()
    }

    fn has_missed_samples(&self) -> bool {
        let Phase::Done(ExciterOutcome::Faulted(own)) = &self.phase else { return false };
        (own.node, own.code) == (Node::Exciter, EmergencyCode::SensorTimeout)
    }

    /// Frames that were never sent, as newer ones replaced them.
    pub fn unsent_frames(&self) -> u64 {
        self.link.unsent_frames()
    }

    /// Whether the work is done, and all frames are sent.
    pub fn is_quiet(&self) -> bool {
        matches!(self.phase, Phase::Done(_)) && !self.link.has_frames()
    }

    /// Ends the work now: disarms the plant, even if it was only asked to arm. The outcome follows the plant's answer.
    pub fn stop(&mut self, now_ns: u64) {
        match self.phase {
            Phase::Playing => self.disarm(now_ns, ExciterOutcome::Stopped),
            Phase::Arming if self.plant_hello.is_some() => self.disarm(now_ns, ExciterOutcome::Stopped),
            Phase::Arming => self.phase = Phase::Done(ExciterOutcome::Stopped),
            Phase::Disarming(_) | Phase::Done(_) => {}
        }
    }

    /// Starts over after a fault: resets itself, arms the plant, and restarts the controller. `false` if no fault
    /// ended the work, or the node leaves.
    pub fn rearm(&mut self, now_ns: u64) -> bool {
        if !matches!(self.phase, Phase::Done(ExciterOutcome::Faulted(_))) || self.leave != Leave::Stay {
            return false;
        }
        self.link.transition(now_ns, StateEvent::Reset);
        self.phase = Phase::Arming;
        // By then it knows the plant's state after the fault.
        self.retry_at_ns = now_ns.saturating_add(RETRY_NS);
        (self.head, self.b, self.answered, self.plant_fault) = (None, None, None, None);
        self.sequence = Sequence::new(self.link.hello().rate_hz);
        self.controller.restart();
        true
    }

    /// Leaves the bus in good order: stops like [`ExciterNode::stop`], then sends its leaving. It has
    /// left when [`ExciterNode::is_quiet`].
    pub fn leave(&mut self, now_ns: u64) {
        if self.leave == Leave::Stay {
            self.leave = Leave::Asked;
            self.stop(now_ns);
            self.send_leaving();
        }
    }

    fn send_leaving(&mut self) {
        if self.leave == Leave::Asked && matches!(self.phase, Phase::Done(_)) {
            self.leave = Leave::Announced;
            self.link.send_emergency(self.emergency(EmergencyCode::Leaving, 0));
        }
    }

    /// The bus is off: a playing controller faults. Otherwise the node waits for the bus to come back.
    pub fn bus_lost(&mut self, now_ns: u64) {
        if self.phase == Phase::Playing {
            self.fault(now_ns, EmergencyCode::BusLoss, self.link.not_sent());
        }
    }

    /// Takes a frame from the bus; frames of other protocols are ignored.
    pub fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        let message = self.link.accept(now_ns, frame);
        if let Some(identifier) = self.link.take_second_sender() {
            self.meet_second_sender(now_ns, identifier);
        }
        let Some(message) = message else { return };
        match message {
            Message::PlantHello(hello) => self.take_hello(now_ns, hello),
            Message::Heartbeat(Heartbeat { node: Node::Plant, state }) => self.watch(now_ns, state),
            Message::Emergency(emergency) => self.heed(now_ns, emergency),
            Message::Head(head) => self.head = Some(head),
            Message::AccelerometerB(b) => self.b = Some(b),
            Message::AccelerometerC(c) => self.sample(now_ns, c),
            Message::Sensors(Sensors { values, sample }) => {
                let command = self.whole(now_ns, sample, &values);
                self.command(now_ns, command);
            }
            Message::SensorPair(pair) => self.pair(now_ns, &pair),
            _ => {}
        }
        self.send_leaving();
    }

    /// Another node sends this one's messages: either of the two may control the plant.
    fn meet_second_sender(&mut self, now_ns: u64, identifier: u16) {
        if !matches!(self.phase, Phase::Done(_)) {
            self.fault(now_ns, EmergencyCode::SecondSender, identifier);
        }
    }

    /// Takes a plant's hello; the first one is answered at once. An exciter that has ended neither arms nor checks
    /// a plant.
    fn take_hello(&mut self, now_ns: u64, hello: Hello) {
        let mismatch = self.link.hello().mismatch(&hello);
        let is_new = self.plant_hello.is_none();
        self.plant_hello = mismatch.is_none().then_some(hello);
        match (self.phase, mismatch) {
            (Phase::Done(_), Some(_)) => {}
            (_, Some(mismatch)) => self.fault(now_ns, EmergencyCode::Incompatible, mismatch as u16),
            (Phase::Arming, None) if is_new => self.ask_for_arming(now_ns),
            (_, None) if is_new => self.link.send_hello(now_ns),
            (_, None) => {}
        }
    }

    fn watch(&mut self, now_ns: u64, state: NodeState) {
        self.plant_state = Some(state);
        if state == NodeState::BootUp {
            self.plant_hello = None;
        }
        match (self.phase, state) {
            (Phase::Arming, NodeState::Operational) if self.plant_hello.is_some() => {
                self.phase = Phase::Playing;
                self.sample_heard_ns = self.link.listening().listened_ns();
                self.link.transition(now_ns, StateEvent::Arm);
            }
            (Phase::Playing, NodeState::BootUp | NodeState::Fault) => {
                self.fault(now_ns, EmergencyCode::PartnerFault, u16::from(Node::Plant.number()));
            }
            (Phase::Playing, NodeState::PreOperational) => self.disarm(now_ns, ExciterOutcome::Stopped),
            (Phase::Disarming(outcome), NodeState::PreOperational | NodeState::Fault) => {
                self.phase = Phase::Done(outcome)
            }
            _ => {}
        }
    }

    fn heed(&mut self, now_ns: u64, emergency: Emergency) {
        match emergency.code {
            EmergencyCode::ScheduleSlipped => {
                self.link.report(NodeEvent::Emergency(emergency));
                self.slipped_periods += u64::from(emergency.detail);
            }
            EmergencyCode::Leaving => self.take_leaving(now_ns, emergency),
            _ => self.heed_fault(now_ns, emergency),
        }
    }

    /// The plant leaves the bus. Before arming, another plant may appear.
    fn take_leaving(&mut self, now_ns: u64, emergency: Emergency) {
        self.link.report(NodeEvent::Emergency(emergency));
        (self.plant_hello, self.plant_state) = (None, None);
        match self.phase {
            Phase::Playing => {
                self.phase = Phase::Done(ExciterOutcome::PlantLeft);
                self.link.transition(now_ns, StateEvent::Disarm);
            }
            Phase::Disarming(outcome) => self.phase = Phase::Done(outcome),
            Phase::Arming | Phase::Done(_) => {}
        }
    }

    /// The plant's emergency describes its fault better than its heartbeat.
    fn heed_fault(&mut self, now_ns: u64, emergency: Emergency) {
        let incompatible = emergency.code == EmergencyCode::Incompatible;
        let no_hello_yet = incompatible && emergency.detail == Mismatch::NoHello as u16;
        if no_hello_yet {
            return;
        }
        if self.phase == Phase::Playing || (self.phase == Phase::Arming && incompatible) {
            self.link.fail(now_ns, emergency);
            self.phase = Phase::Done(ExciterOutcome::Faulted(emergency));
        } else if self.has_missed_samples() && emergency.code != EmergencyCode::PartnerFault {
            // A consequence of this node's own fault is no reason for it.
            self.link.report(NodeEvent::PartnerEmergency(emergency));
            self.plant_fault = Some(emergency);
        }
    }

    /// In the classic profile a sample is complete with its last frame, accelerometer C.
    fn sample(&mut self, now_ns: u64, c: Acceleration) {
        let whole = self.head.take().zip(self.b.take());
        if let Some((head, b)) = whole.filter(|(head, b)| head.sample == c.sample && b.sample == c.sample) {
            let command = self.whole(now_ns, c.sample, &SensorValues::from_classic(&head, &b, &c));
            self.command(now_ns, command);
        }
    }

    /// The second of two samples in a frame is answered: a command for the first would be too late.
    fn pair(&mut self, now_ns: u64, pair: &SensorPair) {
        let [first, second] = &pair.values;
        self.whole(now_ns, pair.sample, first);
        let command = self.whole(now_ns, pair.sample.wrapping_add(1), second);
        self.command(now_ns, command);
    }

    /// The command that answers the whole sample of this index, if there is one.
    fn whole(&mut self, now_ns: u64, index: u16, values: &SensorValues) -> Option<Message> {
        match self.phase {
            Phase::Playing => {}
            // The plant still waits for a command: the request was lost.
            Phase::Disarming(_) => {
                self.request(OperatorRequest::Disarm);
                return None;
            }
            Phase::Arming | Phase::Done(_) => return None,
        }
        let n = match (self.sequence.judge(index), self.answered) {
            (Place::Stale, _) => return None,
            (Place::Broken, _) => {
                self.fault(now_ns, EmergencyCode::SampleSequence, index);
                return None;
            }
            (Place::Ahead(ahead), Some(last)) => {
                self.missed_samples += u64::from(ahead) - 1;
                last + u64::from(ahead)
            }
            (Place::First | Place::Ahead(_), _) => 0,
        };
        self.sample_heard_ns = self.link.listening().listened_ns();
        self.answered = Some(n);
        let outcome = match self.controller.answer(n, values) {
            Answer::HoldForce { force_x_n, force_y_n } => {
                return Some(Message::Force(ForceCommand { force_x_n, force_y_n, sample: index }));
            }
            Answer::HoldTorque { torque1_nm, torque2_nm } => {
                return Some(Message::Torque(TorqueCommand { torque1_nm, torque2_nm, sample: index }));
            }
            Answer::Finished => ExciterOutcome::Finished,
            Answer::Aborted(abort) => ExciterOutcome::Aborted(abort),
        };
        self.disarm(now_ns, outcome);
        None
    }

    fn command(&mut self, now_ns: u64, command: Option<Message>) {
        if command.is_some_and(|command| !self.link.is_stated(&command) || self.link.send(&command).is_err()) {
            self.fault(now_ns, EmergencyCode::CommandOutOfRange, 0);
        }
    }

    fn ask_for_arming(&mut self, now_ns: u64) {
        self.retry_at_ns = now_ns.saturating_add(RETRY_NS);
        if self.plant_hello.is_none() {
            return;
        }
        self.link.send_hello(now_ns);
        if self.plant_state == Some(NodeState::Fault) {
            self.request(OperatorRequest::Reset);
        }
        self.request(OperatorRequest::Arm);
    }

    fn disarm(&mut self, now_ns: u64, outcome: ExciterOutcome<C::Abort>) {
        self.phase = Phase::Disarming(outcome);
        self.retry_at_ns = now_ns.saturating_add(RETRY_NS);
        self.request(OperatorRequest::Disarm);
        self.link.transition(now_ns, StateEvent::Disarm);
    }

    fn request(&mut self, request: OperatorRequest) {
        let sent = self.link.send(&Message::Operator(OperatorCommand { request, target: Node::Plant }));
        debug_assert!(sent.is_ok(), "{sent:?}");
    }

    fn fault(&mut self, now_ns: u64, code: EmergencyCode, detail: u16) {
        let emergency = self.emergency(code, detail);
        self.link.send_fault(now_ns, emergency);
        self.phase = Phase::Done(ExciterOutcome::Faulted(emergency));
    }

    fn emergency(&self, code: EmergencyCode, detail: u16) -> Emergency {
        Emergency { node: Node::Exciter, code, detail, sample: self.last_sample() }
    }

    /// The index of the last sample answered.
    fn last_sample(&self) -> u16 {
        self.sequence.last().unwrap_or(0)
    }

    /// Does the work that is due: heartbeats, hellos, retries, and the timeouts of a playing controller.
    pub fn handle_deadline(&mut self, now_ns: u64) {
        self.link.handle_deadline(now_ns);
        match self.phase {
            Phase::Arming if now_ns >= self.retry_at_ns => self.ask_for_arming(now_ns),
            Phase::Disarming(_) if self.link.is_partner_lost() => {
                self.fault(now_ns, EmergencyCode::HeartbeatLost, u16::from(Node::Plant.number()));
            }
            Phase::Disarming(outcome) if now_ns >= self.retry_at_ns => self.disarm(now_ns, outcome),
            Phase::Playing if self.link.is_jammed() => {
                self.fault(now_ns, EmergencyCode::BusLoss, self.link.not_sent());
            }
            Phase::Playing if self.is_sensor_lost() => {
                self.fault(now_ns, EmergencyCode::SensorTimeout, self.last_sample());
            }
            _ => {}
        }
        self.send_leaving();
    }

    fn is_sensor_lost(&self) -> bool {
        self.link.listening().has_passed(self.sample_heard_ns, self.timing.partner_timeout_ns)
    }

    /// The latest time for the next call of [`ExciterNode::handle_deadline`].
    pub fn next_deadline_ns(&self) -> u64 {
        let link = self.link.next_deadline_ns();
        match self.phase {
            Phase::Arming => link.min(self.retry_at_ns),
            Phase::Disarming(_) => link.min(self.retry_at_ns).min(self.link.partner_deadline_ns()),
            Phase::Playing => {
                let sensors = self.link.listening().next_look_ns(self.sample_heard_ns, self.timing.partner_timeout_ns);
                link.min(sensors)
            }
            Phase::Done(_) => link,
        }
    }

    /// The next frame to send. It may change with any other call.
    pub fn next_frame(&self) -> Option<Frame> {
        self.link.next_frame()
    }

    /// The bus has taken the frame from [`ExciterNode::next_frame`].
    pub fn frame_sent(&mut self) {
        self.link.frame_sent();
    }

    /// The next frame, marked as sent.
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
