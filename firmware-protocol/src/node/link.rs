//! The common part of both nodes on Resonarm's protocol: transmitter and receiver, heartbeats and hellos.

use super::event::NodeEvent;
use super::frames::FrameFault;
use super::node_core::NodeCore;
use super::timing::Timing;
use crate::error::{DecodeError, EncodeError};
use crate::frame::{Frame, FrameFormat, Id};
use crate::kind::MessageKind;
use crate::message::{Capabilities, Emergency, Heartbeat, Hello, Message, SamplesPerFrame};
use crate::network::{Network, Node, Profile};
use crate::receiver::Receiver;
use crate::state::{NodeState, StateEvent};
use crate::transmitter::Transmitter;

use super::outbox::Outbox;

/// Reason for which a frame of the protocol is no message for this node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unused {
    /// The frame failed a check.
    Rejected(DecodeError),
    /// Another node sent it although only this node sends messages with its identifier.
    SecondSender(u16),
}

/// A node's connection to the bus, and its knowledge of its partner.
#[derive(Clone, Debug)]
pub struct Link {
    /// State, fault, timeouts, counts and events. A change of its state is announced by [`Link::announce`].
    pub core: NodeCore,
    node: Node,
    transmitter: Transmitter,
    receiver: Receiver,
    outbox: Outbox,
    hello: Hello,
    capabilities: Capabilities,
    timing: Timing,
    /// The state in the last heartbeat.
    announced: NodeState,
    heartbeat_at_ns: u64,
    hello_at_ns: u64,
    partner_heard_ns: u64,
}

impl Link {
    /// A link in the state boot-up, of the node of `capabilities`.
    pub fn new(network: Network, rate_hz: u16, timing: Timing, capabilities: Capabilities) -> Link {
        Link {
            core: NodeCore::new(&timing),
            node: capabilities.node,
            transmitter: Transmitter::new(network),
            receiver: Receiver::new(network),
            outbox: Outbox::new(network),
            hello: Hello::new(network.profile(), rate_hz),
            capabilities,
            timing,
            announced: NodeState::BootUp,
            heartbeat_at_ns: 0,
            hello_at_ns: 0,
            partner_heard_ns: 0,
        }
    }

    /// Boot-up heartbeat, then pre-operational, then hello.
    pub fn start(&mut self, now_ns: u64) {
        self.send_heartbeat(now_ns);
        // The boot-up heartbeat is queued before the node leaves boot-up: with it receivers forget the node's
        // counters, which start at 0 again.
        self.core.start(now_ns);
        self.announce(now_ns);
        self.send_hello(now_ns);
    }

    /// Follows the table of states and announces the new state, if the table has such an event in this one.
    pub fn transition(&mut self, now_ns: u64, event: StateEvent) {
        self.core.turn(event);
        self.announce(now_ns);
    }

    /// Sends a heartbeat if the state has changed since the last one. A command that waits is dropped with the armed
    /// state.
    pub fn announce(&mut self, now_ns: u64) {
        if self.announced == self.core.state() {
            return;
        }
        // A command that is sent after the heartbeat would be one of a node that is not armed.
        if self.announced == NodeState::Operational {
            self.outbox.clear_command();
        }
        self.send_heartbeat(now_ns);
    }

    /// The node's own hello.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// Frames that were lost on the way, by the gaps of counters.
    pub fn lost_frames(&self) -> u64 {
        self.receiver.lost()
    }

    /// The message in a frame; `None` if the frame is of another protocol.
    ///
    /// # Errors
    /// [`Unused`] says why the frame is no message for this node.
    pub fn accept(&mut self, now_ns: u64, frame: &Frame) -> Result<Option<Message>, Unused> {
        self.core.listening.look(now_ns);
        let received = self.receiver.accept(frame);
        let kind = match &received {
            Ok(Some(message)) => message.kind(),
            Ok(None) => return Ok(None),
            Err(error) => return Err(self.reject(*error)),
        };
        if kind.sender() == self.node {
            // An operator's station may send requests in place of the exciter.
            let is_request = kind == MessageKind::Operator;
            return if is_request { Ok(None) } else { Err(Unused::SecondSender(kind.id(self.network()))) };
        }
        // Only messages that have passed all checks count as a sign of life of the partner.
        self.partner_heard_ns = self.core.listening.listened_ns();
        received.map_err(Unused::Rejected)
    }

    /// Counts and notes a frame that failed a check. A remote frame is a request, not a message of another sender.
    fn reject(&mut self, error: DecodeError) -> Unused {
        let kind = error.kind();
        let is_question = matches!(error, DecodeError::Format { got: FrameFormat::Remote, .. });
        if kind.sender() == self.node && kind != MessageKind::Operator && !is_question {
            self.core.counts.refused += 1;
            self.core.reject_sender(Id::Standard(kind.id(self.network())));
        } else {
            self.core.reject(FrameFault::Protocol(error));
        }
        Unused::Rejected(error)
    }

    /// The most samples per frame that this node sends or accepts.
    pub fn samples_per_frame(&self) -> SamplesPerFrame {
        self.capabilities.samples_per_frame
    }

    /// Sets the most samples per frame that this node sends or accepts.
    pub fn set_samples_per_frame(&mut self, most: SamplesPerFrame) {
        self.capabilities.samples_per_frame = most;
    }

    /// Returns the network on which the node works.
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
        // A NaN compares false, so that it is never within the limits.
        values.iter().all(|value| value.abs() <= limit)
    }

    /// Queues a message for sending.
    ///
    /// # Errors
    /// [`EncodeError`] if the protocol can't encode it.
    pub fn send(&mut self, message: &Message) -> Result<(), EncodeError> {
        self.outbox.push(message)?;
        // The outbox counts since its start, so the number is taken over and not added.
        self.core.counts.unsent = self.outbox.unsent();
        self.core.frame_waits();
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

    /// Queues the emergency that says why the node has faulted, and announces the state.
    pub fn send_fault(&mut self, now_ns: u64, emergency: Emergency) {
        self.send_own(&Message::Emergency(emergency));
        self.announce(now_ns);
    }

    /// Queues the hello, in the FD profile followed by the capabilities.
    pub fn send_hello(&mut self, now_ns: u64) {
        // Every hello moves the next one, also a hello out of turn: the period is the most between two.
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
        self.announced = self.core.state();
        self.send_own(&Message::Heartbeat(Heartbeat { node: self.node, state: self.announced }));
    }

    /// Checks the clock, and sends the heartbeat and the hello that are due.
    pub fn handle_deadline(&mut self, now_ns: u64) {
        self.core.listening.look(now_ns);
        if now_ns >= self.heartbeat_at_ns {
            self.send_heartbeat(now_ns);
        }
        if now_ns >= self.hello_at_ns {
            self.send_hello(now_ns);
        }
    }

    /// Returns the time at which the next heartbeat or hello is due.
    pub fn next_deadline_ns(&self) -> u64 {
        self.heartbeat_at_ns.min(self.hello_at_ns)
    }

    /// Whether the partner's heartbeat has timed out.
    pub fn is_partner_lost(&self) -> bool {
        self.core.listening.has_passed(self.partner_heard_ns, self.timing.partner_timeout_ns)
    }

    /// Returns the time at which to check [`Link::is_partner_lost`] next.
    pub fn partner_deadline_ns(&self) -> u64 {
        self.core.listening.next_look_ns(self.partner_heard_ns, self.timing.partner_timeout_ns)
    }

    /// The next frame to send.
    pub fn next_frame(&self) -> Option<Frame> {
        // The frame is made when it is fetched: what newer messages replaced has used no counter.
        Some(self.transmitter.next(&self.outbox.contents().next()?))
    }

    /// The next frame has been sent: its counter is used.
    pub fn frame_sent(&mut self) {
        if let Some(kind) = self.outbox.pop() {
            self.transmitter.sent(kind);
        }
        // Any frame that the bus takes shows that it works, and restarts the time of a jam.
        self.core.frame_sent(self.outbox.waiting() > 0);
    }

    /// The frames that wait, in the order of sending, each with the counter it will have.
    pub fn waiting_frames(&self) -> impl Iterator<Item = Frame> {
        // The counters advance on a copy, since none of these frames is sent yet.
        let mut transmitter = self.transmitter.clone();
        self.outbox.contents().map(move |content| {
            let frame = transmitter.next(&content);
            transmitter.sent(content.kind());
            frame
        })
    }

    /// Returns the number of frames that wait to be sent.
    pub fn waiting(&self) -> usize {
        self.outbox.waiting()
    }
}
