//! What both nodes share: the protocol's ends, the state, heartbeats and hellos.

use resonarm_protocol::{
    Emergency, EncodeError, Frame, Heartbeat, Hello, Message, Network, Node, NodeState, Receiver, StateEvent,
    Transmitter,
};

use super::queue::Queue;
use super::{NodeEvent, Timing};

/// Frames that wait to be sent: a sample's three, and what a state change adds.
const OUTBOX: usize = 32;
/// Events that wait to be fetched.
const EVENTS: usize = 64;

#[derive(Clone, Debug)]
pub(super) struct Link {
    node: Node,
    transmitter: Transmitter,
    receiver: Receiver,
    outbox: Queue<Frame>,
    events: Queue<NodeEvent>,
    state: NodeState,
    hello: Hello,
    timing: Timing,
    heartbeat_at_ns: u64,
    hello_at_ns: u64,
    refused_frames: u64,
}

impl Link {
    pub fn new(node: Node, network: Network, rate_hz: u16, timing: Timing) -> Link {
        Link {
            node,
            transmitter: Transmitter::new(network),
            receiver: Receiver::new(network),
            outbox: Queue::new(OUTBOX),
            events: Queue::new(EVENTS),
            state: NodeState::BootUp,
            hello: Hello::classic(rate_hz),
            timing,
            heartbeat_at_ns: 0,
            hello_at_ns: 0,
            refused_frames: 0,
        }
    }

    /// Boot-up heartbeat, then pre-operational, then hello.
    pub fn start(&mut self, now_ns: u64) {
        self.send_heartbeat(now_ns);
        self.transition(now_ns, StateEvent::Started);
        self.send_hello(now_ns);
    }

    pub fn state(&self) -> NodeState {
        self.state
    }

    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// Frames of the protocol that could not be taken.
    pub fn refused_frames(&self) -> u64 {
        self.refused_frames
    }

    /// Frames that a gap of a counter says were lost on the way.
    pub fn lost_frames(&self) -> u64 {
        self.receiver.lost()
    }

    /// Frames not sent because the outbox was full.
    pub fn unsent_frames(&self) -> u64 {
        self.outbox.lost()
    }

    /// Follows the state table; `false` if the event means nothing in this state.
    pub fn transition(&mut self, now_ns: u64, event: StateEvent) -> bool {
        let Some(to) = self.state.next(event) else { return false };
        let from = core::mem::replace(&mut self.state, to);
        self.events.push(NodeEvent::State { from, to });
        self.send_heartbeat(now_ns);
        true
    }

    /// The message in a frame, if it is one for this node.
    pub fn accept(&mut self, frame: &Frame) -> Option<Message> {
        match self.receiver.accept(frame) {
            Ok(message) => message.filter(|message| message.kind().sender() != self.node),
            Err(error) => {
                self.refused_frames += 1;
                self.events.push(NodeEvent::Frame(error));
                None
            }
        }
    }

    /// Queues a message.
    ///
    /// # Errors
    /// [`EncodeError`] if the protocol can't say it.
    pub fn send(&mut self, message: &Message) -> Result<(), EncodeError> {
        let frame = self.transmitter.frame(message)?;
        self.outbox.push(frame);
        Ok(())
    }

    /// Queues a message of this room's own making; the protocol can say all of them.
    fn send_own(&mut self, message: &Message) {
        let sent = self.send(message);
        debug_assert!(sent.is_ok(), "{message:?}: {sent:?}");
    }

    pub fn send_emergency(&mut self, emergency: Emergency) {
        self.events.push(NodeEvent::Emergency(emergency));
        self.send_own(&Message::Emergency(emergency));
    }

    pub fn send_hello(&mut self, now_ns: u64) {
        self.hello_at_ns = now_ns + self.timing.hello_period_ns;
        self.send_own(&match self.node {
            Node::Plant => Message::PlantHello(self.hello),
            Node::Exciter => Message::ExciterHello(self.hello),
        });
    }

    fn send_heartbeat(&mut self, now_ns: u64) {
        self.heartbeat_at_ns = now_ns + self.timing.heartbeat_period_ns;
        self.send_own(&Message::Heartbeat(Heartbeat { node: self.node, state: self.state }));
    }

    /// Sends the heartbeat and the hello that are due.
    pub fn handle_deadline(&mut self, now_ns: u64) {
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

    pub fn tell(&mut self, event: NodeEvent) {
        self.events.push(event);
    }

    pub fn poll_transmit(&mut self) -> Option<Frame> {
        self.outbox.pop()
    }

    pub fn poll_event(&mut self) -> Option<NodeEvent> {
        self.events.pop()
    }
}
