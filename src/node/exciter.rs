//! The exciter controller's node: arms the plant, answers its samples as a controller says, disarms.

use alloc::boxed::Box;

use resonarm_protocol::{
    Acceleration, Capabilities, Emergency, EmergencyCode, Frame, Heartbeat, Hello, ImpedanceHead, Message, Mismatch,
    Network, Node, NodeState, OperatorCommand, OperatorRequest, SamplesPerFrame, SensorPair, Sensors, StateEvent,
};

use resonarm_protocol::node::{Link, Place, Queue, Sequence};

use super::sample;
use super::{NodeEvent, Timing};
use crate::arm::Load;
use crate::control::{Abort, Answer, Controller, LoadKind, ResponsePoint};
use crate::rig::Measurement;

/// Time between two tries to arm or disarm the plant, ns.
const RETRY_NS: u64 = 100_000_000;
/// Responses that wait to be fetched.
const RESPONSES: usize = 16;

/// How a controller's work ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The controller has finished and the plant is disarmed.
    Finished,
    /// The controller has given up, and the plant is disarmed.
    Aborted(Abort),
    /// It was stopped before the end, and the plant disarmed.
    Stopped,
    /// The plant left the bus before the end, and disarmed itself.
    PlantLeft,
    /// A fault ended it: this node's own or the plant's.
    Faulted(Emergency),
}

/// What the controller is at.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Looking for the plant and arming it.
    Arming,
    /// Answering samples.
    Playing,
    /// Disarming the plant, for this outcome.
    Disarming(Outcome),
    Done(Outcome),
}

/// Where a controller stands in leaving the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Leave {
    /// Not asked to.
    Stay,
    /// Asked to; it is told when the work is done.
    Asked,
    /// Told.
    Told,
}

/// The exciter controller as a node.
#[derive(Debug)]
pub struct ExciterNode {
    link: Link,
    timing: Timing,
    controller: Box<dyn Controller>,
    phase: Phase,
    plant_hello: Option<Hello>,
    plant_state: Option<NodeState>,
    leave: Leave,
    retry_at_ns: u64,
    /// When the last new sample came in, of the time listened.
    sample_heard_ns: u64,
    head: Option<ImpedanceHead>,
    b: Option<Acceleration>,
    sequence: Sequence,
    /// The last sample answered, counted from the first.
    answered: Option<u64>,
    missed_samples: u64,
    slipped_periods: u64,
    responses: Queue<ResponsePoint, RESPONSES>,
}

impl ExciterNode {
    /// A node that lets `controller` answer a plant with `rate_hz` samples a second.
    pub fn new(network: Network, rate_hz: u16, timing: Timing, controller: Box<dyn Controller>) -> ExciterNode {
        ExciterNode {
            link: Link::new(network, rate_hz, timing, capabilities(controller.load_kind())),
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
            responses: Queue::new(),
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

    /// How it ended, once it has.
    pub fn outcome(&self) -> Option<Outcome> {
        match self.phase {
            Phase::Done(outcome) => Some(outcome),
            _ => None,
        }
    }

    /// Whether a plant has been heard.
    pub fn has_heard_plant(&self) -> bool {
        self.plant_state.is_some() || self.plant_hello.is_some()
    }

    /// Samples answered so far, those lost on the way included.
    pub fn samples_played(&self) -> u64 {
        self.answered.map_or(0, |n| n + 1)
    }

    /// Samples of the plant that never came in whole.
    pub fn missed_samples(&self) -> u64 {
        self.missed_samples
    }

    /// Samples that came with the index of one answered before, or an older one, and were ignored.
    pub fn stale_samples(&self) -> u64 {
        self.sequence.stale()
    }

    /// Sample periods by which the plant said its schedule has moved.
    pub fn slipped_periods(&self) -> u64 {
        self.slipped_periods
    }

    /// Frames of the protocol refused for their checks (E2E, length, values).
    pub fn refused_frames(&self) -> u64 {
        self.link.refused_frames()
    }

    /// Frames that were never sent: newer ones took their place before they could be.
    pub fn unsent_frames(&self) -> u64 {
        self.link.unsent_frames()
    }

    /// Whether the work is done, and all frames are sent.
    pub fn is_quiet(&self) -> bool {
        matches!(self.phase, Phase::Done(_)) && !self.link.has_frames()
    }

    /// Ends the work now: disarms the plant, also one only asked to arm. The outcome is there when it has answered.
    pub fn stop(&mut self, now_ns: u64) {
        match self.phase {
            Phase::Playing => self.disarm(now_ns, Outcome::Stopped),
            Phase::Arming if self.plant_hello.is_some() => self.disarm(now_ns, Outcome::Stopped),
            Phase::Arming => self.phase = Phase::Done(Outcome::Stopped),
            Phase::Disarming(_) | Phase::Done(_) => {}
        }
    }

    /// Begins anew after a fault: resets itself, arms the plant, and restarts the controller. `false` if no fault
    /// ended it, or it leaves.
    pub fn rearm(&mut self, now_ns: u64) -> bool {
        if !matches!(self.phase, Phase::Done(Outcome::Faulted(_))) || self.leave != Leave::Stay {
            return false;
        }
        self.link.transition(now_ns, StateEvent::Reset);
        self.phase = Phase::Arming;
        // By then it has heard the plant's state after what went wrong.
        self.retry_at_ns = now_ns.saturating_add(RETRY_NS);
        (self.head, self.b, self.answered) = (None, None, None);
        self.sequence = Sequence::new(self.link.hello().rate_hz);
        self.controller.restart();
        true
    }

    /// Leaves the bus in good order: as [`ExciterNode::stop`], and when the work is done tells that it leaves. It has
    /// left when [`ExciterNode::is_quiet`].
    pub fn leave(&mut self, now_ns: u64) {
        if self.leave == Leave::Stay {
            self.leave = Leave::Asked;
            self.stop(now_ns);
            self.tell_leave();
        }
    }

    fn tell_leave(&mut self) {
        if self.leave == Leave::Asked && matches!(self.phase, Phase::Done(_)) {
            self.leave = Leave::Told;
            self.link.send_emergency(self.emergency(EmergencyCode::Leaving, 0));
        }
    }

    /// The bus is off: a controller at work faults. One that is not waits for the bus to come back.
    pub fn bus_lost(&mut self, now_ns: u64) {
        if self.phase == Phase::Playing {
            self.fault(now_ns, EmergencyCode::BusLoss, self.link.not_sent());
        }
    }

    /// Takes in a frame from the bus; one of another protocol means nothing.
    pub fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        let message = self.link.accept(now_ns, frame);
        if let Some(identifier) = self.link.take_second_sender() {
            self.meet_second_sender(now_ns, identifier);
        }
        let Some(message) = message else { return };
        match message {
            Message::PlantHello(hello) => self.greet(now_ns, hello),
            Message::Heartbeat(Heartbeat { node: Node::Plant, state }) => self.watch(now_ns, state),
            Message::Emergency(emergency) => self.heed(now_ns, emergency),
            Message::Head(head) => self.head = Some(head),
            Message::AccelerometerB(b) => self.b = Some(b),
            Message::AccelerometerC(c) => self.sample(now_ns, c),
            Message::Sensors(Sensors { values, sample }) => {
                let load = self.whole(now_ns, sample, |n| sample::from_values(n, &values));
                self.command(now_ns, load, sample);
            }
            Message::SensorPair(pair) => self.pair(now_ns, &pair),
            _ => {}
        }
        self.tell_leave();
    }

    /// Another node sends this one's messages: which of the two the plant obeys is chance.
    fn meet_second_sender(&mut self, now_ns: u64, identifier: u16) {
        if !matches!(self.phase, Phase::Done(_)) {
            self.fault(now_ns, EmergencyCode::SecondSender, identifier);
        }
    }

    /// A plant says what it speaks; its first hello is answered at once. An exciter that has ended arms none and judges
    /// none.
    fn greet(&mut self, now_ns: u64, hello: Hello) {
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
            (Phase::Playing, NodeState::PreOperational) => self.disarm(now_ns, Outcome::Stopped),
            (Phase::Disarming(outcome), NodeState::PreOperational | NodeState::Fault) => {
                self.phase = Phase::Done(outcome)
            }
            _ => {}
        }
    }

    fn heed(&mut self, now_ns: u64, emergency: Emergency) {
        match emergency.code {
            EmergencyCode::ScheduleSlipped => {
                self.link.tell(NodeEvent::Emergency(emergency));
                self.slipped_periods += u64::from(emergency.detail);
            }
            EmergencyCode::Leaving => self.part(now_ns, emergency),
            _ => self.heed_fault(now_ns, emergency),
        }
    }

    /// The plant leaves the bus. Before it was armed another may come.
    fn part(&mut self, now_ns: u64, emergency: Emergency) {
        self.link.tell(NodeEvent::Emergency(emergency));
        (self.plant_hello, self.plant_state) = (None, None);
        match self.phase {
            Phase::Playing => {
                self.phase = Phase::Done(Outcome::PlantLeft);
                self.link.transition(now_ns, StateEvent::Disarm);
            }
            Phase::Disarming(outcome) => self.phase = Phase::Done(outcome),
            Phase::Arming | Phase::Done(_) => {}
        }
    }

    /// The plant's own word of why it faulted says more than its heartbeat.
    fn heed_fault(&mut self, now_ns: u64, emergency: Emergency) {
        let incompatible = emergency.code == EmergencyCode::Incompatible;
        let no_hello_yet = incompatible && emergency.detail == Mismatch::NoHello as u16;
        if no_hello_yet {
            return;
        }
        if self.phase == Phase::Playing || (self.phase == Phase::Arming && incompatible) {
            self.link.tell(NodeEvent::Emergency(emergency));
            self.link.transition(now_ns, StateEvent::Fault);
            self.phase = Phase::Done(Outcome::Faulted(emergency));
        }
    }

    /// In the classic profile a sample is whole when its last frame, accelerometer C, is in.
    fn sample(&mut self, now_ns: u64, c: Acceleration) {
        let whole = self.head.take().zip(self.b.take());
        if let Some((head, b)) = whole.filter(|(head, b)| head.sample == c.sample && b.sample == c.sample) {
            let load = self.whole(now_ns, c.sample, |n| sample::from_classic(n, &head, &b, &c));
            self.command(now_ns, load, c.sample);
        }
    }

    /// Of two samples in a frame the second is answered: a command for the first would come too late.
    fn pair(&mut self, now_ns: u64, pair: &SensorPair) {
        let ([first, second], index) = (&pair.values, pair.sample.wrapping_add(1));
        self.whole(now_ns, pair.sample, |n| sample::from_values(n, first));
        let load = self.whole(now_ns, index, |n| sample::from_values(n, second));
        self.command(now_ns, load, index);
    }

    /// The load to command in answer to a whole sample of this index, if there is one; `measurement` makes the sample
    /// for its number since arming.
    fn whole(&mut self, now_ns: u64, index: u16, measurement: impl Fn(u64) -> Measurement) -> Option<Load> {
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
        let answer = self.controller.answer(&measurement(n));
        while let Some(point) = self.controller.poll_response() {
            self.responses.push(point);
        }
        let outcome = match answer {
            Answer::Hold(load) => return Some(load),
            Answer::Finished => Outcome::Finished,
            Answer::Aborted(abort) => Outcome::Aborted(abort),
        };
        self.disarm(now_ns, outcome);
        None
    }

    fn command(&mut self, now_ns: u64, load: Option<Load>, sample: u16) {
        let message = load.map(|load| sample::command(self.controller.load_kind(), &load, sample));
        if message.is_some_and(|message| self.link.send(&message).is_err()) {
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

    fn disarm(&mut self, now_ns: u64, outcome: Outcome) {
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
        self.link.send_emergency(emergency);
        self.link.transition(now_ns, StateEvent::Fault);
        self.phase = Phase::Done(Outcome::Faulted(emergency));
    }

    fn emergency(&self, code: EmergencyCode, detail: u16) -> Emergency {
        Emergency { node: Node::Exciter, code, detail, sample: self.last_sample() }
    }

    /// The index of the last sample answered.
    fn last_sample(&self) -> u16 {
        self.sequence.last().unwrap_or(0)
    }

    /// Does what is due: heartbeats, hellos, tries, and the timeouts of a playing controller.
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
        self.tell_leave();
    }

    fn is_sensor_lost(&self) -> bool {
        self.link.listening().has_passed(self.sample_heard_ns, self.timing.partner_timeout_ns)
    }

    /// When [`ExciterNode::handle_deadline`] is to be called next, at the latest.
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

    /// The next frame to send, as it is now. Ask again after any other call: it may be another by then.
    pub fn next_frame(&self) -> Option<Frame> {
        self.link.next_frame()
    }

    /// The bus has taken the frame that [`ExciterNode::next_frame`] gave.
    pub fn frame_sent(&mut self) {
        self.link.frame_sent();
    }

    /// The next frame, as one that is sent.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        let frame = self.next_frame()?;
        self.frame_sent();
        Some(frame)
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<NodeEvent> {
        self.link.poll_event()
    }

    /// The next response read.
    pub fn poll_response(&mut self) -> Option<ResponsePoint> {
        self.responses.pop()
    }
}

/// What the exciter commands: as much as the wire carries, of one kind.
fn capabilities(kind: LoadKind) -> Capabilities {
    let (force_limit_n, torque_limit_nm) = match kind {
        LoadKind::Force => (f32::MAX.into(), 0.0),
        LoadKind::Torque => (0.0, f32::MAX.into()),
    };
    Capabilities { node: Node::Exciter, samples_per_frame: SamplesPerFrame::Two, force_limit_n, torque_limit_nm }
}
