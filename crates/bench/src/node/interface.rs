//! The plant's node as a run loop knows it, whatever protocol it speaks on the wire.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;

use resonarm_protocol::node::{FrameCounts, NodeCore, NodeEvent};
use resonarm_protocol::{Emergency, EmergencyCode, Frame, NodeState, OperatorRequest};

use super::guard::Guard;
use super::{FaultCause, Refusals};
use crate::rig::Load;
use crate::rig::Measurement;
use crate::structure::ChannelName;

/// The plant's node: frames and the time go in, frames, loads and events come out. Nothing allocates after
/// construction.
pub trait PlantInterface: fmt::Debug + Send {
    /// State, fault, counts and events of the node.
    fn core(&self) -> &NodeCore;

    /// The same, to change it.
    fn core_mut(&mut self) -> &mut NodeCore;

    /// The gate that every command passes, with the load that acts.
    fn guard(&self) -> &Guard;

    /// How many frames wait to be sent.
    fn waiting(&self) -> usize;

    /// Boots the node.
    fn start(&mut self, now_ns: u64);

    /// The node's state.
    fn state(&self) -> NodeState {
        self.core().state()
    }

    /// Whether commands reach the structure.
    fn is_armed(&self) -> bool {
        self.core().is_operational()
    }

    /// How often the plant was armed.
    fn arms(&self) -> u32 {
        self.core().arms()
    }

    /// How often the armed plant was disarmed, or faulted. No event that is lost hides it.
    fn leaves(&self) -> u32 {
        self.core().leaves()
    }

    /// Why the plant has faulted, beyond the code: what its controller did.
    fn fault_cause(&self) -> Option<FaultCause> {
        self.guard().cause().filter(|_| self.state() == NodeState::Fault).cloned()
    }

    /// Whether the sample published last awaits no command.
    fn is_answered(&self) -> bool;

    /// Whether, in lockstep, readings are sent before the plant is armed for the first time; the specification of
    /// Resonarm's protocol says that none are.
    fn sends_unarmed_readings(&self) -> bool {
        true
    }

    /// Whether the load is ramping to zero.
    fn is_ramping(&self) -> bool {
        self.guard().ramp_left() > 0
    }

    /// The fault that is latched now, if one is.
    fn latched_fault(&self) -> Option<Emergency> {
        self.core().latched_fault()
    }

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
    fn refusals(&self) -> &Refusals {
        self.guard().refusals()
    }

    /// What was counted of frames.
    fn frames(&self) -> FrameCounts {
        self.core().counts
    }

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

    /// The load to hold from the sample published last to the next. Call it once a sample: after a fault or a disarm
    /// each call goes one step down the ramp.
    ///
    /// The ramp of n samples holds the last command times (n−1)/n, (n−2)/n … 0. Arming doesn't end it; the first
    /// command taken does.
    fn load(&mut self) -> Load;

    /// Faults from outside: the simulation failed, its shaker tripped, or ticks were missed. The load ramps to zero; if
    /// the simulation can't continue or the exciter is off, it is dropped at once.
    fn fault(&mut self, now_ns: u64, code: EmergencyCode, detail: u16);

    /// The bus is off: an armed plant faults. One that is not armed waits for the bus to come back.
    fn bus_lost(&mut self, now_ns: u64) {
        if self.is_armed() {
            self.fault(now_ns, EmergencyCode::BusLoss, self.core().not_sent(self.waiting()));
        }
    }

    /// Leaves the bus in good order: an armed plant is disarmed, and it is not armed again.
    fn leave(&mut self, now_ns: u64);

    /// Reports that the schedule has moved by `periods` missed sample periods.
    fn slip(&mut self, periods: u64) {
        let detail = u16::try_from(periods).unwrap_or(u16::MAX);
        let emergency = self.guard().emergency(EmergencyCode::ScheduleSlipped, detail);
        self.core_mut().note(NodeEvent::Emergency(emergency));
    }

    /// Appends at most `most` of the frames to send, in their order.
    fn waiting_frames(&mut self, most: usize, frames: &mut Vec<Frame>);

    /// Records that the bus has taken the first of the waiting frames.
    fn frame_sent(&mut self);

    /// The next event.
    fn poll_event(&mut self) -> Option<NodeEvent> {
        self.core_mut().poll()
    }

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

impl<'a> PublishedSample<'a> {
    /// The readings alone, of a structure at rest.
    pub fn of(measurement: &'a Measurement) -> PublishedSample<'a> {
        PublishedSample { measurement, states: &[], travel_m: 0.0 }
    }
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
        name: ChannelName,
        /// What it is.
        got: f64,
    },
}
