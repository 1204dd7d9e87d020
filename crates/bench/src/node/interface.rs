//! The plant's node as a run loop knows it, whatever protocol it speaks on the wire.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;

use resonarm_protocol::node::{Happening, NodeEvent};
use resonarm_protocol::{Emergency, EmergencyCode, Frame, Id, Network, NodeState, OperatorRequest, Refusal};

use super::{FaultCause, PlantNode, Refusals};
use crate::rig::Measurement;
use resonarm_dynamics::arm::Load;

/// The plant's node: frames and the time go in, frames, loads and events come out. Nothing allocates after
/// construction.
pub trait PlantInterface: fmt::Debug + Send {
    /// Boots the node.
    fn start(&mut self, now_ns: u64);

    /// The node's state.
    fn state(&self) -> NodeState;

    /// Whether commands reach the structure.
    fn is_armed(&self) -> bool {
        self.state() == NodeState::Operational
    }

    /// How often the plant was armed.
    fn arms(&self) -> u32;

    /// How often the armed plant was disarmed, or faulted. No event that is lost hides it.
    fn leaves(&self) -> u32;

    /// Why the plant has faulted, beyond the code: what its controller did.
    fn fault_cause(&self) -> Option<FaultCause>;

    /// Whether the sample published last awaits no command.
    fn is_answered(&self) -> bool;

    /// Whether, in lockstep, readings are sent before the plant is armed for the first time; the specification of
    /// Resonarm's protocol says that none are.
    fn sends_unarmed_readings(&self) -> bool {
        true
    }

    /// Whether, in lockstep, any command counts as the answer to the sample published last, since commands don't name
    /// the sample that they answer.
    fn has_unnumbered_answers(&self) -> bool {
        false
    }

    /// Whether the load is ramping to zero.
    fn is_ramping(&self) -> bool;

    /// The fault that is latched now, if one is.
    fn latched_fault(&self) -> Option<Emergency>;

    /// The partner's fault that caused the latched fault, if the protocol has one.
    fn fault_reason(&self) -> Option<Emergency> {
        None
    }

    /// The index of the sample that the last command received answers, returned once; `None` if commands have none.
    fn take_echoed(&mut self) -> Option<u16> {
        None
    }

    /// Whether the sample published last is sent with the next one.
    fn holds_sample(&self) -> bool {
        false
    }

    /// Valid commands that did not reach the structure, by reason.
    fn refusals(&self) -> &Refusals;

    /// What was counted of frames.
    fn frames(&self) -> FrameCounts;

    /// Handles a frame from the bus; frames of other nodes are ignored.
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame);

    /// Executes an operator's request made at the plant itself, if the node's state allows it.
    fn execute(&mut self, now_ns: u64, request: OperatorRequest);

    /// Does what is due. Call it after the frames received, and before [`PlantInterface::load`].
    fn handle_deadline(&mut self, now_ns: u64);

    /// When [`PlantInterface::handle_deadline`] is to be called next, at the latest, ns.
    fn next_deadline_ns(&self) -> u64;

    /// Publishes a sample.
    ///
    /// # Errors
    /// [`PublishError`] if a value is not a number.
    fn publish(&mut self, sample: &PublishedSample) -> Result<(), PublishError>;

    /// The load to hold from the sample published last to the next. Call it once a sample.
    fn load(&mut self) -> Load;

    /// Faults from outside.
    fn fault(&mut self, now_ns: u64, code: EmergencyCode, detail: u16);

    /// The bus is off: an armed plant faults.
    fn bus_lost(&mut self, now_ns: u64);

    /// Leaves the bus in good order.
    fn leave(&mut self, now_ns: u64);

    /// Reports that the schedule has moved by `periods` missed sample periods.
    fn slip(&mut self, periods: u64);

    /// Appends at most `most` of the frames to send, in their order.
    fn waiting_frames(&mut self, most: usize, frames: &mut Vec<Frame>);

    /// Records that the bus has taken the first of the waiting frames.
    fn frame_sent(&mut self);

    /// The next event.
    fn poll_event(&mut self) -> Option<WireEvent>;

    /// A copy in the same state.
    fn boxed_clone(&self) -> Box<dyn PlantInterface>;
}

/// A sample as a node publishes it.
#[derive(Clone, Copy, Debug)]
pub struct PublishedSample<'a> {
    /// The readings of the instruments.
    pub measurement: &'a Measurement,
    /// The states of the structure at the sample, in the order of its channels.
    pub states: &'a [f64],
    /// The distance of the driven point from rest at the sample, m.
    pub travel_m: f64,
}

/// Why a sample can't be published.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PublishError {
    /// The protocol can't encode it.
    #[error(transparent)]
    Encode(#[from] resonarm_protocol::EncodeError),
    /// A reading is no number.
    #[error("{name} is {got}")]
    NotFinite {
        /// The name of the reading.
        name: &'static str,
        /// What it is.
        got: f64,
    },
}

/// What a node counted of frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Never sent, as newer ones replaced them.
    pub unsent: u64,
    /// Refused for their checks.
    pub refused: u64,
    /// Refused under identifiers that only the plant sends.
    pub other_sender: u64,
    /// Commands of a user's protocol that newer ones replaced before they could act.
    pub overwritten: u64,
    /// Values in frames that were sent which their signals could not represent: the nearest was sent.
    pub limited_values: u64,
}

/// An event of a node, whatever protocol it speaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WireEvent {
    /// The node changed its state.
    State {
        /// The state before.
        from: NodeState,
        /// The state now.
        to: NodeState,
    },
    /// The node faulted, or refused to arm, with the reason; or a notice, its own or the partner's.
    Emergency(Emergency),
    /// The partner reports why it has faulted.
    PartnerEmergency(Emergency),
    /// A command was refused.
    Refused(Refusal),
    /// A frame was refused for one of its checks.
    Frame(FrameFault),
    /// A frame was refused whose identifier only this node sends.
    OtherSender(Id),
    /// So many events other than faults and changes of state were dropped, as too many waited.
    Lost(u64),
}

impl From<Happening<WireEvent>> for WireEvent {
    fn from(happening: Happening<WireEvent>) -> WireEvent {
        match happening {
            Happening::Fault(emergency) => WireEvent::Emergency(emergency),
            Happening::State { from, to } => WireEvent::State { from, to },
            Happening::Note(event) => event,
            Happening::Lost(events) => WireEvent::Lost(events),
        }
    }
}

impl WireEvent {
    /// An event of a node of Resonarm's protocol on `network`.
    pub fn of(event: &NodeEvent, network: Network) -> WireEvent {
        match *event {
            NodeEvent::State { from, to } => WireEvent::State { from, to },
            NodeEvent::Emergency(emergency) => WireEvent::Emergency(emergency),
            NodeEvent::PartnerEmergency(emergency) => WireEvent::PartnerEmergency(emergency),
            NodeEvent::Refused(refusal) => WireEvent::Refused(refusal),
            NodeEvent::Frame(_) => WireEvent::Frame(FrameFault::Protocol),
            NodeEvent::Lost(events) => WireEvent::Lost(events),
            NodeEvent::OtherSender(error) => WireEvent::OtherSender(Id::Standard(error.kind().id(network))),
        }
    }
}

/// Which of its checks a frame failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameFault {
    /// A check of the protocol of Resonarm: E2E, length or values.
    Protocol,
    /// A check of a user's message.
    Mapped {
        /// The identifier.
        id: Id,
        /// The check.
        check: FrameCheck,
    },
}

/// The checks of a user's message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameCheck {
    /// It is a CAN FD frame and the message a classic one, or the reverse.
    Format,
    /// The payload ends before a signal, or is longer than the message.
    Length,
    /// The checksum is wrong.
    Checksum,
    /// The counter repeats, or more frames were lost than are allowed.
    Counter,
    /// A signal is no finite number.
    Value,
}

impl fmt::Display for FrameCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FrameCheck::Format => "one of CAN FD and classic CAN was expected, and the other came",
            FrameCheck::Length => "its length does not fit the message",
            FrameCheck::Checksum => "its checksum is wrong",
            FrameCheck::Counter => "its counter is repeated, or too many frames were lost before it",
            FrameCheck::Value => "a signal in it is no finite number",
        })
    }
}

impl PlantInterface for PlantNode {
    fn start(&mut self, now_ns: u64) {
        PlantNode::start(self, now_ns);
    }

    fn state(&self) -> NodeState {
        PlantNode::state(self)
    }

    fn arms(&self) -> u32 {
        PlantNode::arms(self)
    }

    fn leaves(&self) -> u32 {
        PlantNode::leaves(self)
    }

    fn fault_cause(&self) -> Option<FaultCause> {
        PlantNode::fault_cause(self)
    }

    fn is_answered(&self) -> bool {
        PlantNode::is_answered(self)
    }

    fn sends_unarmed_readings(&self) -> bool {
        false
    }

    fn is_ramping(&self) -> bool {
        PlantNode::is_ramping(self)
    }

    fn latched_fault(&self) -> Option<Emergency> {
        PlantNode::latched_fault(self)
    }

    fn fault_reason(&self) -> Option<Emergency> {
        PlantNode::fault_reason(self)
    }

    fn take_echoed(&mut self) -> Option<u16> {
        PlantNode::take_echoed(self)
    }

    fn holds_sample(&self) -> bool {
        PlantNode::holds_sample(self)
    }

    fn refusals(&self) -> &Refusals {
        PlantNode::refusals(self)
    }

    fn frames(&self) -> FrameCounts {
        FrameCounts {
            unsent: self.unsent_frames(),
            refused: self.refused_frames(),
            other_sender: self.other_sender_frames(),
            overwritten: 0,
            limited_values: 0,
        }
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        PlantNode::handle_frame(self, now_ns, frame);
    }

    fn execute(&mut self, now_ns: u64, request: OperatorRequest) {
        PlantNode::execute(self, now_ns, request);
    }

    fn handle_deadline(&mut self, now_ns: u64) {
        PlantNode::handle_deadline(self, now_ns);
    }

    fn next_deadline_ns(&self) -> u64 {
        PlantNode::next_deadline_ns(self)
    }

    fn publish(&mut self, sample: &PublishedSample) -> Result<(), PublishError> {
        self.set_travel(sample.travel_m);
        Ok(PlantNode::publish(self, sample.measurement)?)
    }

    fn load(&mut self) -> Load {
        PlantNode::load(self)
    }

    fn fault(&mut self, now_ns: u64, code: EmergencyCode, detail: u16) {
        PlantNode::fault(self, now_ns, code, detail);
    }

    fn bus_lost(&mut self, now_ns: u64) {
        PlantNode::bus_lost(self, now_ns);
    }

    fn leave(&mut self, now_ns: u64) {
        PlantNode::leave(self, now_ns);
    }

    fn slip(&mut self, periods: u64) {
        PlantNode::slip(self, periods);
    }

    fn waiting_frames(&mut self, most: usize, frames: &mut Vec<Frame>) {
        frames.extend(PlantNode::waiting_frames(self).take(most));
    }

    fn frame_sent(&mut self) {
        PlantNode::frame_sent(self);
    }

    fn poll_event(&mut self) -> Option<WireEvent> {
        Some(WireEvent::of(&PlantNode::poll_event(self)?, self.network()))
    }

    fn boxed_clone(&self) -> Box<dyn PlantInterface> {
        Box::new(self.clone())
    }
}
