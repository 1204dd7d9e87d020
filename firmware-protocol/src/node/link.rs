//! The common part of both nodes: transmitter and receiver, state, heartbeats and hellos, time listened.

use crate::{
    Capabilities, DecodeError, Emergency, EncodeError, Frame, FrameFormat, Heartbeat, Hello, Message, MessageKind,
    Network, Node, NodeState, Profile, Receiver, SamplesPerFrame, StateEvent, Transmitter,
};

use super::listening::Listening;
use super::node_core::{Happening, NodeCore};
use super::outbox::Outbox;
use super::{NodeEvent, Timing};

/// Most events that wait to be fetched, beside faults and changes of state.
const NOTES: usize = 64;

/// A node's connection to the bus, and its knowledge of its partner.
#[derive(Clone, Debug)]
pub struct Link {
    node: Node,
    transmitter: Transmitter,
    receiver: Receiver,
    outbox: Outbox,
    core: NodeCore<NodeEvent, NOTES>,
    hello: Hello,
    capabilities: Capabilities,
    timing: Timing,
    listening: Listening,
    heartbeat_at_ns: u64,
    hello_at_ns: u64,
    partner_heard_ns: u64,
    /// Since when, in time listened, frames wait and none was sent.
    jammed_since_ns: Option<u64>,
    refused_frames: u64,
    other_sender_frames: u64,
    /// Why the last of them was refused.
    refused_for: Option<DecodeError>,
    /// The identifier of a message received from another node although only this one sends it, not yet reported.
    second_sender: Option<u16>,
}

impl Link {
    /// A link in the state boot-up, of the node of `capabilities`.
    pub fn new(network: Network, rate_hz: u16, timing: Timing, capabilities: Capabilities) -> Link {
        Link {
            node: capabilities.node,
            transmitter: Transmitter::new(network),
            receiver: Receiver::new(network),
            outbox: Outbox::new(network),
            core: NodeCore::new(),
            hello: Hello::new(network.profile(), rate_hz),
            capabilities,
            timing,
            listening: Listening::new(timing.look_period_ns),
            heartbeat_at_ns: 0,
            hello_at_ns: 0,
            partner_heard_ns: 0,
            jammed_since_ns: None,
            refused_frames: 0,
            other_sender_frames: 0,
            refused_for: None,
            second_sender: None,
        }
    }

    /// Boot-up heartbeat, then pre-operational, then hello.
    pub fn start(&mut self, now_ns: u64) {
        self.listening.start(now_ns);
        self.send_heartbeat(now_ns);
        self.transition(now_ns, StateEvent::Started);
        self.send_hello(now_ns);
    }

    /// The node's state.
    pub fn state(&self) -> NodeState {
        self.core.state()
    }

    /// The fault that is latched, if one is.
    pub fn latched_fault(&self) -> Option<Emergency> {
        self.core.latched_fault()
    }

    /// How often the node was armed.
    pub fn arms(&self) -> u32 {
        self.core.arms()
    }

    /// How often an armed node was disarmed, or faulted.
    pub fn leaves(&self) -> u32 {
        self.core.leaves()
    }

    /// The node's own hello.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// Frames of the protocol that were refused.
    pub fn refused_frames(&self) -> u64 {
        self.refused_frames
    }

    /// Why the last of them was refused.
    pub fn refused_for(&self) -> Option<DecodeError> {
        self.refused_for
    }

    /// Those of them with identifiers that only this node sends ([`NodeEvent::OtherSender`]).
    pub fn other_sender_frames(&self) -> u64 {
        self.other_sender_frames
    }

    /// Frames that were lost on the way, by the gaps of counters.
    pub fn lost_frames(&self) -> u64 {
        self.receiver.lost()
    }

    /// Frames that will never be sent, as newer ones replaced them.
    pub fn unsent_frames(&self) -> u64 {
        self.outbox.unsent()
    }

    /// Follows the state table; returns `false` if it has no such event in this state.
    pub fn transition(&mut self, now_ns: u64, event: StateEvent) -> bool {
        let turn = self.core.turn(event);
        turn.is_some_and(|(from, _)| self.changed(now_ns, from))
    }

    /// Faults, and latches `emergency`; `false` if a fault is latched already.
    pub fn fail(&mut self, now_ns: u64, emergency: Emergency) -> bool {
        let from = self.core.state();
        self.core.fail(emergency) && self.changed(now_ns, from)
    }

    /// The state was `from` until now.
    fn changed(&mut self, now_ns: u64, from: NodeState) -> bool {
        if from == NodeState::Operational {
            self.outbox.clear_command();
        }
        self.send_heartbeat(now_ns);
        true
    }

    /// The message in a frame, if it is one for this node.
    pub fn accept(&mut self, now_ns: u64, frame: &Frame) -> Option<Message> {
        self.listening.look(now_ns);
        match self.receiver.accept(frame) {
            Ok(message) => {
                let message = message?;
                let kind = message.kind();
                if kind.sender() == self.node {
                    // An operator's station may send requests in place of the exciter.
                    if kind != MessageKind::Operator {
                        self.second_sender = Some(kind.id(self.network()));
                    }
                    return None;
                }
                self.partner_heard_ns = self.listening.listened_ns();
                Some(message)
            }
            Err(error) => {
                self.refuse(error);
                None
            }
        }
    }

    /// Counts and reports a refused frame. A remote frame is a request, not a message of another
    /// sender.
    fn refuse(&mut self, error: DecodeError) {
        let kind = error.kind();
        let is_question = matches!(error, DecodeError::Format { got: FrameFormat::Remote, .. });
        let is_other_sender = kind.sender() == self.node && kind != MessageKind::Operator && !is_question;
        self.refused_frames += 1;
        self.refused_for = Some(error);
        self.other_sender_frames += u64::from(is_other_sender);
        let event = if is_other_sender { NodeEvent::OtherSender } else { NodeEvent::Frame };
        self.core.note(event(error));
    }

    /// The most samples per frame that this node sends or accepts.
    pub fn samples_per_frame(&self) -> SamplesPerFrame {
        self.capabilities.samples_per_frame
    }

    /// Sets the most samples per frame that this node sends or accepts.
    pub fn set_samples_per_frame(&mut self, most: SamplesPerFrame) {
        self.capabilities.samples_per_frame = most;
    }

    /// The time that the node listened.
    pub fn listening(&self) -> &Listening {
        &self.listening
    }

    /// The identifier of a message that another node sends in this one's place, once.
    pub fn take_second_sender(&mut self) -> Option<u16> {
        self.second_sender.take()
    }

    /// The network.
    pub fn network(&self) -> Network {
        self.receiver.network()
    }

    /// Whether a command is within what this node has stated: the limits of its capabilities, which it sends in the FD
    /// profile.
    pub fn is_stated(&self, command: &Message) -> bool {
        let Capabilities { force_limit_n, torque_limit_nm, .. } = self.capabilities;
        let (values, limit) = match command {
            _ if self.network().profile() != Profile::Fd => return true,
            Message::Force(command) => ([command.force_x_n, command.force_y_n], force_limit_n),
            Message::Torque(command) => ([command.torque1_nm, command.torque2_nm], torque_limit_nm),
            _ => return true,
        };
        values.iter().all(|value| value.abs() <= limit)
    }

    /// Queues a message.
    ///
    /// # Errors
    /// [`EncodeError`] if the protocol can't encode it.
    pub fn send(&mut self, message: &Message) -> Result<(), EncodeError> {
        self.outbox.push(message)?;
        self.jammed_since_ns.get_or_insert(self.listening.listened_ns());
        Ok(())
    }

    /// Queues a message made by this module, which can always be encoded.
    fn send_own(&mut self, message: &Message) {
        let sent = self.send(message);
        debug_assert!(sent.is_ok(), "{message:?}: {sent:?}");
    }

    /// Queues an emergency that is no fault of the node, and reports it.
    pub fn send_emergency(&mut self, emergency: Emergency) {
        self.core.note(NodeEvent::Emergency(emergency));
        self.send_own(&Message::Emergency(emergency));
    }

    /// Faults, and queues the emergency that says why.
    pub fn send_fault(&mut self, now_ns: u64, emergency: Emergency) {
        self.send_own(&Message::Emergency(emergency));
        self.fail(now_ns, emergency);
    }

    /// Queues the hello, in the FD profile followed by the capabilities.
    pub fn send_hello(&mut self, now_ns: u64) {
        self.hello_at_ns = now_ns.saturating_add(self.timing.early(self.timing.hello_period_ns));
        self.send_own(&match self.node {
            Node::Plant => Message::PlantHello(self.hello),
            Node::Exciter => Message::ExciterHello(self.hello),
        });
        if self.network().profile() == Profile::Fd {
            self.send_own(&Message::Capabilities(self.capabilities));
        }
    }

    fn send_heartbeat(&mut self, now_ns: u64) {
        self.heartbeat_at_ns = now_ns.saturating_add(self.timing.early(self.timing.heartbeat_period_ns));
        self.send_own(&Message::Heartbeat(Heartbeat { node: self.node, state: self.state() }));
    }

    /// Checks the clock, and sends the heartbeat and the hello that are due.
    pub fn handle_deadline(&mut self, now_ns: u64) {
        self.listening.look(now_ns);
        if now_ns >= self.heartbeat_at_ns {
            self.send_heartbeat(now_ns);
        }
        if now_ns >= self.hello_at_ns {
            self.send_hello(now_ns);
        }
    }

    /// When the next heartbeat or hello is due.
    pub fn next_deadline_ns(&self) -> u64 {
        self.heartbeat_at_ns.min(self.hello_at_ns)
    }

    /// Whether the partner's heartbeat has timed out.
    pub fn is_partner_lost(&self) -> bool {
        self.listening.has_passed(self.partner_heard_ns, self.timing.partner_timeout_ns)
    }

    /// When to check [`Link::is_partner_lost`] next.
    pub fn partner_deadline_ns(&self) -> u64 {
        self.listening.next_look_ns(self.partner_heard_ns, self.timing.partner_timeout_ns)
    }

    /// Whether frames have waited for the bus timeout and none could be sent.
    pub fn is_jammed(&self) -> bool {
        self.jammed_since_ns.is_some_and(|since_ns| self.listening.has_passed(since_ns, self.timing.command_timeout_ns))
    }

    /// Frames not sent, for the detail of a bus loss: waiting, or replaced by newer ones.
    pub fn not_sent(&self) -> u16 {
        let frames = self.outbox.unsent().saturating_add(self.outbox.waiting() as u64);
        u16::try_from(frames).unwrap_or(u16::MAX)
    }

    /// Reports an event that is no fault of the node, and no change of its state.
    pub fn report(&mut self, event: NodeEvent) {
        self.core.note(event);
    }

    /// The next frame to send.
    pub fn next_frame(&self) -> Option<Frame> {
        Some(self.transmitter.next(&self.outbox.contents().next()?))
    }

    /// The next frame has been sent: its counter is used.
    pub fn frame_sent(&mut self) {
        if let Some(kind) = self.outbox.pop() {
            self.transmitter.sent(kind);
        }
        self.jammed_since_ns = (self.outbox.waiting() > 0).then(|| self.listening.listened_ns());
    }

    /// The frames that wait, in the order of sending, each with the counter it will have.
    pub fn waiting_frames(&self) -> impl Iterator<Item = Frame> {
        let mut transmitter = self.transmitter.clone();
        self.outbox.contents().map(move |content| {
            let frame = transmitter.next(&content);
            transmitter.sent(content.kind());
            frame
        })
    }

    /// Whether frames wait.
    pub fn has_frames(&self) -> bool {
        self.outbox.waiting() > 0
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<NodeEvent> {
        Some(match self.core.poll()? {
            Happening::Fault(emergency) => NodeEvent::Emergency(emergency),
            Happening::State { from, to } => NodeEvent::State { from, to },
            Happening::Note(event) => event,
            Happening::Lost(events) => NodeEvent::Lost(events),
        })
    }
}
