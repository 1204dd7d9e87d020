//! The exciter's node: arms the plant, lets a controller answer its samples, disarms it.

use super::event::NodeEvent;
use super::link::{Link, Unused};
use super::node_core::NodeCore;
use super::sequence::{Place, Sequence};
use super::timing::Timing;
use super::work::{Phase, Work};
use crate::frame::Frame;
use crate::message::{
    Acceleration, Capabilities, Emergency, EmergencyCode, ForceCommand, Heartbeat, Hello, ImpedanceHead, Message,
    Mismatch, OperatorCommand, OperatorRequest, SensorPair, SensorValues, Sensors, TorqueCommand,
};
use crate::network::{Network, Node};
use crate::state::NodeState;

use super::answering::{Answer, Answering, ExciterOutcome};

/// Time between two attempts to arm or disarm the plant, ns.
const RETRY_NS: u64 = 100_000_000;

/// An exciter's node, with its controller.
///
/// The node is a state machine: it opens no socket, reads no clock, starts no thread and allocates nothing. The caller
/// owns the CAN controller and the clock, passes frames and times in, and sends the frames that it fetches.
///
/// # Kinds of methods
/// - *Input*: [`start`](Self::start) once, then [`handle_frame`](Self::handle_frame) for each frame received and
///   [`handle_deadline`](Self::handle_deadline) when time has passed. [`bus_lost`](Self::bus_lost) reports that the CAN
///   controller is bus off. All take the time and return at once. The controller is called within `handle_frame`.
/// - *Output*: [`next_frame`](Self::next_frame) with [`frame_sent`](Self::frame_sent), or
///   [`poll_transmit`](Self::poll_transmit) where the driver takes every frame; [`poll_event`](Self::poll_event);
///   [`next_deadline_ns`](Self::next_deadline_ns).
/// - *Requests of the caller*: [`stop`](Self::stop) disarms the plant, [`leave`](Self::leave) disarms it and announces
///   that the node leaves the bus; if the plant may be armed, the outcome follows its answer. [`rearm`](Self::rearm)
///   resets the node after a fault and restarts the controller; the plant is armed by the calls that follow.
/// - *Queries*: all other methods with `&self`. They change nothing and may be called at any time.
///
/// # Order of calls
/// 1. Pass every frame that waits in the receive queue to `handle_frame`, in the order of arrival. Otherwise
///    a timeout may end although the frame that would have prevented it has been received.
/// 2. Call `handle_deadline`.
/// 3. Send: fetch `next_frame`, give it to the driver, and call `frame_sent` once the driver has accepted it. If it has
///    not, keep nothing: fetch the frame again later, since an input may have replaced it by a newer command. The
///    counter of a frame is used up by `frame_sent`, not by `next_frame`.
/// 4. Fetch the events until there are none. Few can wait: beyond that, changes of state are merged into one that leads
///    to the newest state, and other events are dropped and counted ([`NodeEvent::Lost`]).
/// 5. Wait for a frame or for `next_deadline_ns`, whichever comes first. Ask for the deadline after the last input,
///    since every input may move it.
///
/// To end, call `leave` and continue with this loop until [`is_quiet`](Self::is_quiet).
///
/// # Time
/// `now_ns` is nanoseconds of one monotonic clock of any origin, the same for all calls. Timeouts (of the partner, of
/// samples and of a bus that takes no frame) do not run on it directly, but on the time that the node *listened*:
/// between two inputs at most [`Timing::look_period_ns`] counts, so a node that was itself suspended does not report
/// its partner as lost. A time before that of an earlier call counts as no time. Heartbeats, hellos and repeated
/// requests follow the clock. Samples are identified by index, never by time.
#[derive(Clone, Debug)]
pub struct ExciterNode<C: Answering> {
    link: Link,
    work: Work<C>,
    plant_hello: Option<Hello>,
    plant_state: Option<NodeState>,
    has_announced_leaving: bool,
    head: Option<ImpedanceHead>,
    b: Option<Acceleration>,
    sequence: Sequence,
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
        // The link takes the node's role from here, so a wrong one of the caller must not get through.
        let capabilities = Capabilities { node: Node::Exciter, ..capabilities };
        ExciterNode {
            link: Link::new(network, rate_hz, timing, capabilities),
            work: Work::new(controller, &timing, RETRY_NS),
            plant_hello: None,
            plant_state: None,
            has_announced_leaving: false,
            head: None,
            b: None,
            sequence: Sequence::new(rate_hz),
            slipped_periods: 0,
            plant_fault: None,
        }
    }

    /// Boots: boot-up heartbeat, pre-operational, hello.
    pub fn start(&mut self, now_ns: u64) {
        self.link.start(now_ns);
        self.work.start(now_ns);
    }

    /// State, fault, counts and events of the node.
    pub fn core(&self) -> &NodeCore {
        &self.link.core
    }

    /// The core of the node, to fetch its events.
    pub fn core_mut(&mut self) -> &mut NodeCore {
        &mut self.link.core
    }

    /// The controller, the phase of its work and the samples answered.
    pub fn work(&self) -> &Work<C> {
        &self.work
    }

    /// The work, to read the controller's results.
    pub fn work_mut(&mut self) -> &mut Work<C> {
        &mut self.work
    }

    /// Returns the state of the node.
    pub fn state(&self) -> NodeState {
        self.link.core.state()
    }

    /// Returns the controller that answers the samples.
    pub fn controller(&self) -> &C {
        &self.work.controller
    }

    /// Returns the outcome of the work, once it has ended.
    pub fn outcome(&self) -> Option<ExciterOutcome<C::Abort>> {
        self.work.outcome()
    }

    /// Whether a plant has been heard.
    pub fn has_heard_plant(&self) -> bool {
        self.plant_state.is_some() || self.plant_hello.is_some()
    }

    /// Samples answered so far, including lost ones.
    pub fn samples_played(&self) -> u64 {
        self.work.samples_played()
    }

    /// Samples ignored because their index was repeated or older.
    pub fn stale_samples(&self) -> u64 {
        self.sequence.stale()
    }

    /// Sample periods by which the plant said its schedule has moved.
    pub fn slipped_periods(&self) -> u64 {
        self.slipped_periods
    }

    /// Returns the network on which the node works.
    pub fn network(&self) -> Network {
        self.link.network()
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
        let Phase::Done(ExciterOutcome::Faulted(own)) = &self.work.phase else { return false };
        (own.node, own.code) == (Node::Exciter, EmergencyCode::SensorTimeout)
    }

    /// Returns the number of frames that wait to be sent.
    pub fn waiting(&self) -> usize {
        self.link.waiting()
    }

    /// Whether the work is done, and all frames are sent.
    pub fn is_quiet(&self) -> bool {
        self.outcome().is_some() && self.waiting() == 0
    }

    /// Ends the work now: disarms the plant, even if it was only asked to arm. The outcome follows the plant's answer.
    pub fn stop(&mut self, now_ns: u64) {
        match self.work.phase {
            Phase::Playing => self.disarm(now_ns, ExciterOutcome::Stopped),
            // The request to arm may be on its way, so the plant is disarmed all the same.
            Phase::Arming if self.plant_hello.is_some() => self.disarm(now_ns, ExciterOutcome::Stopped),
            // Nothing was asked of the plant: a request is sent only after its hello.
            Phase::Arming => self.work.phase = Phase::Done(ExciterOutcome::Stopped),
            Phase::Disarming(_) | Phase::Done(_) => {}
        }
    }

    /// Starts over after a fault: resets itself, arms the plant, and restarts the controller. `false` if no fault
    /// ended the work, or the node leaves.
    pub fn rearm(&mut self, now_ns: u64) -> bool {
        if !self.work.rearm(&mut self.link.core, now_ns) {
            return false;
        }
        self.link.announce(now_ns);
        // Parts of a sample from before the fault must not join those after it.
        self.head = None;
        self.b = None;
        self.plant_fault = None;
        self.sequence = Sequence::new(self.link.hello().rate_hz);
        true
    }

    /// Leaves the bus in good order: stops like [`ExciterNode::stop`], then sends its leaving. It has
    /// left when [`ExciterNode::is_quiet`].
    pub fn leave(&mut self, now_ns: u64) {
        if self.work.leave() {
            self.stop(now_ns);
        }
        self.send_leaving();
    }

    fn send_leaving(&mut self) {
        if self.work.is_leaving() && self.outcome().is_some() && !self.has_announced_leaving {
            self.has_announced_leaving = true;
            self.link.send_emergency(self.work.own(EmergencyCode::Leaving, 0));
        }
    }

    /// The bus is off: a playing controller faults. Otherwise the node waits for the bus to come back.
    pub fn bus_lost(&mut self, now_ns: u64) {
        if self.work.phase == Phase::Playing {
            self.fault(now_ns, self.work.own(EmergencyCode::BusLoss, self.link.core.not_sent(self.waiting())));
        }
    }

    /// Takes a frame from the bus; frames of other protocols are ignored.
    pub fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        let message = match self.link.accept(now_ns, frame) {
            Ok(Some(message)) => message,
            Ok(None) | Err(Unused::Rejected(_)) => return,
            Err(Unused::SecondSender(identifier)) => return self.meet_second_sender(now_ns, identifier),
        };
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
        if self.outcome().is_none() {
            self.fault(now_ns, self.work.own(EmergencyCode::SecondSender, identifier));
        }
    }

    /// Takes a plant's hello; the first one is answered at once. An exciter that has ended neither arms nor checks
    /// a plant.
    fn take_hello(&mut self, now_ns: u64, hello: Hello) {
        let mismatch = self.link.hello().mismatch(&hello);
        let is_new = self.plant_hello.is_none();
        // A plant whose hello does not fit counts as one that has said none, so that nothing is asked of it.
        self.plant_hello = mismatch.is_none().then_some(hello);
        match (self.work.phase, mismatch) {
            (Phase::Done(_), Some(_)) => {}
            (_, Some(mismatch)) => {
                self.fault(now_ns, self.work.own(EmergencyCode::Incompatible, mismatch as u16));
            }
            (Phase::Arming, None) if is_new => self.ask_for_arming(now_ns),
            (_, None) if is_new => self.link.send_hello(now_ns),
            (_, None) => {}
        }
    }

    fn watch(&mut self, now_ns: u64, state: NodeState) {
        self.plant_state = Some(state);
        if state == NodeState::BootUp {
            // A plant that boots may be another one, so it must say hello again before it is armed.
            self.plant_hello = None;
        }
        match (self.work.phase, state) {
            (Phase::Arming, NodeState::Operational) if self.plant_hello.is_some() => {
                self.work.begin(&mut self.link.core);
                self.link.announce(now_ns);
            }
            (Phase::Playing, NodeState::BootUp | NodeState::Fault) => {
                self.fault(now_ns, self.work.of_plant(None));
            }
            // An operator's station, for example, has disarmed the plant. Disarming it again does no harm, and its
            // next heartbeat ends the work as usual.
            (Phase::Playing, NodeState::PreOperational) => self.disarm(now_ns, ExciterOutcome::Stopped),
            (Phase::Disarming(outcome), NodeState::PreOperational | NodeState::Fault) => {
                self.work.phase = Phase::Done(outcome)
            }
            _ => {}
        }
    }

    fn heed(&mut self, now_ns: u64, emergency: Emergency) {
        match emergency.code {
            EmergencyCode::ScheduleSlipped => {
                self.link.core.note(NodeEvent::Emergency(emergency));
                self.slipped_periods += u64::from(emergency.detail);
            }
            EmergencyCode::Leaving => self.take_leaving(now_ns, emergency),
            _ => self.heed_fault(now_ns, emergency),
        }
    }

    /// The plant leaves the bus. Before arming, another plant may appear.
    fn take_leaving(&mut self, now_ns: u64, emergency: Emergency) {
        self.link.core.note(NodeEvent::Emergency(emergency));
        // Whatever node comes next has to say hello first, like after a boot.
        self.plant_hello = None;
        self.plant_state = None;
        self.work.plant_ended(&mut self.link.core);
        self.link.announce(now_ns);
    }

    /// The plant's emergency describes its fault better than its heartbeat.
    fn heed_fault(&mut self, now_ns: u64, emergency: Emergency) {
        let incompatible = emergency.code == EmergencyCode::Incompatible;
        let no_hello_yet = incompatible && emergency.detail == Mismatch::NoHello as u16;
        // The plant has not read this node's hello. It is sent with every attempt to arm, so the next one may
        // succeed.
        if no_hello_yet {
            return;
        }
        let phase = self.work.phase;
        // The fault is the plant's, so this node latches its emergency and sends none of its own. While arming, other
        // faults of the plant are reset by the next request.
        if phase == Phase::Playing || (phase == Phase::Arming && incompatible) {
            self.work.fault(&mut self.link.core, emergency);
            self.link.announce(now_ns);
        } else if self.has_missed_samples() && emergency.code != EmergencyCode::PartnerFault {
            // A consequence of this node's own fault is no reason for it.
            self.link.core.note(NodeEvent::PartnerEmergency(emergency));
            self.plant_fault = Some(emergency);
        }
    }

    /// Takes a sample in: in the classic profile it is complete with its last frame, accelerometer C.
    fn sample(&mut self, now_ns: u64, c: Acceleration) {
        // Both are taken in any case, so that parts of an incomplete sample never join those of the next.
        let whole = self.head.take().zip(self.b.take());
        if let Some((head, b)) = whole.filter(|(head, b)| head.sample == c.sample && b.sample == c.sample) {
            let command = self.whole(now_ns, c.sample, &SensorValues::from_classic(&head, &b, &c));
            self.command(now_ns, command);
        }
    }

    /// The second of two samples in a frame is answered: a command for the first would be too late.
    fn pair(&mut self, now_ns: u64, pair: &SensorPair) {
        let [first, second] = &pair.values;
        // The controller sees every sample; its answer to the first is dropped.
        self.whole(now_ns, pair.sample, first);
        let command = self.whole(now_ns, pair.sample.wrapping_add(1), second);
        self.command(now_ns, command);
    }

    /// The command that answers the whole sample of this index, if there is one.
    fn whole(&mut self, now_ns: u64, index: u16, values: &SensorValues) -> Option<Message> {
        match self.work.phase {
            Phase::Playing => {}
            // The plant still waits for a command: the request was lost.
            Phase::Disarming(_) => {
                self.request(OperatorRequest::Disarm);
                return None;
            }
            Phase::Arming | Phase::Done(_) => return None,
        }
        let ahead = match self.sequence.judge(index) {
            Place::Stale => return None,
            Place::Broken => {
                self.fault(now_ns, self.work.own(EmergencyCode::SampleSequence, index));
                return None;
            }
            Place::Ahead(ahead) => u64::from(ahead),
            Place::First => 1,
        };
        let n = self.work.next_sample(&self.link.core, ahead, 1);
        // The number of a sample counts from arming and the index from the plant's start, so both differ.
        self.work.last_index = index;
        let outcome = match self.work.controller.answer(n, values) {
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
        // Neither more than the node has stated nor more than the signal can hold may be sent, not
        // even cut.
        if command.is_some_and(|command| !self.link.is_stated(&command) || self.link.send(&command).is_err()) {
            self.fault(now_ns, self.work.own(EmergencyCode::CommandOutOfRange, 0));
        }
    }

    fn ask_for_arming(&mut self, now_ns: u64) {
        self.work.asked(now_ns);
        if self.plant_hello.is_none() {
            return;
        }
        // The plant refuses to arm without this node's hello, and may have missed the one before.
        self.link.send_hello(now_ns);
        // A latched fault must be reset before the plant can be armed.
        if self.plant_state == Some(NodeState::Fault) {
            self.request(OperatorRequest::Reset);
        }
        self.request(OperatorRequest::Arm);
    }

    fn disarm(&mut self, now_ns: u64, outcome: ExciterOutcome<C::Abort>) {
        self.work.disarm(&mut self.link.core, outcome);
        self.work.asked(now_ns);
        self.request(OperatorRequest::Disarm);
        self.link.announce(now_ns);
    }

    fn request(&mut self, request: OperatorRequest) {
        let sent = self.link.send(&Message::Operator(OperatorCommand { request, target: Node::Plant }));
        debug_assert!(sent.is_ok(), "{sent:?}");
    }

    fn fault(&mut self, now_ns: u64, emergency: Emergency) {
        self.work.fault(&mut self.link.core, emergency);
        self.link.send_fault(now_ns, emergency);
    }

    /// Does the work that is due: heartbeats, hellos, retries, and the timeouts of a playing controller.
    pub fn handle_deadline(&mut self, now_ns: u64) {
        self.link.handle_deadline(now_ns);
        match self.work.phase {
            Phase::Arming if self.work.is_due(now_ns) => self.ask_for_arming(now_ns),
            // Before the retry: otherwise a plant that has vanished would be asked for ever.
            Phase::Disarming(_) if self.link.is_partner_lost() => {
                self.fault(now_ns, self.work.own(EmergencyCode::HeartbeatLost, u16::from(Node::Plant.number())));
            }
            Phase::Disarming(outcome) if self.work.is_due(now_ns) => self.disarm(now_ns, outcome),
            _ => {
                if let Some(emergency) = self.work.timed_out(&self.link.core, self.waiting()) {
                    self.fault(now_ns, emergency);
                }
            }
        }
        self.send_leaving();
    }

    /// The latest time for the next call of [`ExciterNode::handle_deadline`].
    pub fn next_deadline_ns(&self) -> u64 {
        let deadline_ns = self.link.next_deadline_ns().min(self.work.deadline_ns(&self.link.core));
        match self.work.phase {
            // Only an exciter that waits for the plant to disarm watches the plant's signs of life (SPEC.md, section
            // 9, code 3). A playing one watches the samples.
            Phase::Disarming(_) => deadline_ns.min(self.link.partner_deadline_ns()),
            _ => deadline_ns,
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

    /// Returns the next event, or `None` if there is none.
    pub fn poll_event(&mut self) -> Option<NodeEvent> {
        self.link.core.poll()
    }
}
