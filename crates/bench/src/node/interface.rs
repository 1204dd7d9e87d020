//! The plant's node as a run loop uses it, whatever its protocol is.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;

use resonarm_protocol::node::{FrameCounts, NodeCore, NodeEvent};
use resonarm_protocol::{Emergency, EmergencyCode, Frame, NodeState, OperatorRequest};

use super::cause::FaultCause;
use super::guard::Guard;
use super::refusals::Refusals;
use crate::rig::{Load, Measurement};
use crate::structure::{ChannelName, States};

/// The plant's node: frames and time go in, frames, loads and events come out. It allocates nothing after
/// construction.
pub trait PlantInterface: fmt::Debug + Send {
    /// Returns state, fault, counts and events of the node.
    fn core(&self) -> &NodeCore;

    /// Returns the core for changes.
    fn core_mut(&mut self) -> &mut NodeCore;

    /// Returns the gate that every command passes, with the load that acts.
    fn guard(&self) -> &Guard;

    /// Returns the number of frames that wait to be sent.
    fn waiting(&self) -> usize;

    /// Boots the node at the time `now_ns`.
    fn start(&mut self, now_ns: u64);

    /// Returns the state of the node.
    fn state(&self) -> NodeState {
        self.core().state()
    }

    /// Returns whether commands reach the structure.
    fn is_armed(&self) -> bool {
        self.core().is_operational()
    }

    /// Returns the cause of the plant's fault beyond the code, that is, what its controller did.
    fn fault_cause(&self) -> Option<FaultCause> {
        self.guard().cause.clone().filter(|_| self.state() == NodeState::Fault)
    }

    /// Returns whether the last published sample awaits no command.
    fn is_answered(&self) -> bool;

    /// Returns whether, in lockstep, readings are sent before the plant is first armed. By the specification of
    /// Resonarm's protocol none are.
    fn sends_unarmed_readings(&self) -> bool {
        true
    }

    /// Returns whether the load is ramping to zero.
    fn is_ramping(&self) -> bool {
        self.guard().ramp_left() > 0
    }

    /// Returns the latched fault, if there is one.
    fn latched_fault(&self) -> Option<Emergency> {
        self.core().latched_fault()
    }

    /// Returns the partner's fault that caused the latched fault, if the protocol reports it.
    fn fault_reason(&self) -> Option<Emergency> {
        None
    }

    /// Returns, once, the index of the sample that the last received command answers; `None` if commands have
    /// none.
    fn take_echoed(&mut self) -> Option<u16> {
        None
    }

    /// Returns whether the last published sample is sent together with the next one.
    fn holds_sample(&self) -> bool {
        false
    }

    /// Returns the counts of valid commands that did not reach the structure, by reason.
    fn refusals(&self) -> &Refusals {
        self.guard().refusals()
    }

    /// Returns the counts of frames.
    fn frames(&self) -> FrameCounts {
        self.core().counts
    }

    /// Handles a frame from the bus; frames of other nodes are ignored.
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame);

    /// Executes an operator's request that was made at the plant itself, if the node's state allows it.
    fn execute(&mut self, now_ns: u64, request: OperatorRequest);

    /// Does everything that is due. Call it after the received frames and before [`PlantInterface::load`].
    fn handle_deadline(&mut self, now_ns: u64);

    /// Returns the latest time at which [`PlantInterface::handle_deadline`] must be called next, ns.
    fn next_deadline_ns(&self) -> u64;

    /// Publishes a sample of readings and states.
    ///
    /// # Errors
    /// [`PublishError`] if a value is not a number.
    fn publish(&mut self, sample: &PublishedSample) -> Result<(), PublishError>;

    /// Returns the load to hold from the last published sample to the next. Call it once per sample: after a
    /// fault or a disarm each call goes one step down the ramp.
    /// A ramp of n samples holds the last command times (n−1)/n, (n−2)/n … 0. Arming does not end it; the first
    /// accepted command does.
    fn load(&mut self) -> Load;

    /// Hands over the load by which the exciter in the same loop answers the sample of index `index`. Its parts that the
    /// protocol does not carry act together with those in the frame that answers this sample, and with no other frame. A
    /// protocol that carries every load ignores it.
    fn hand_over(&mut self, _index: u16, _load: &Load) {}

    /// Enters a fault from outside: the simulation failed, its shaker tripped, or ticks were missed. The load
    /// ramps to zero; if the simulation can't continue or the exciter is off, it is dropped at once.
    fn fault(&mut self, now_ns: u64, code: EmergencyCode, detail: u16);

    /// Handles the loss of the bus: an armed plant faults; one that is not armed waits for the bus to return.
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

    /// Appends at most `most` of the waiting frames, in their order.
    fn waiting_frames(&mut self, most: usize, frames: &mut Vec<Frame>);

    /// Notes that the bus has taken the first of the waiting frames.
    fn frame_sent(&mut self);

    /// Returns the next event, if there is one.
    fn poll_event(&mut self) -> Option<NodeEvent> {
        self.core_mut().poll()
    }

    /// Returns a copy in the same state.
    fn boxed_clone(&self) -> Box<dyn PlantInterface>;
}

/// A sample as a node publishes it.
#[derive(Clone, Copy, Debug)]
pub struct PublishedSample<'a> {
    /// Readings of the instruments.
    pub measurement: &'a Measurement,
    /// States of the structure at the sample.
    pub states: &'a States,
    /// Distance of the driven point from rest at the sample, m; `None` if the gate does not limit it.
    pub travel_m: Option<f64>,
}

impl<'a> PublishedSample<'a> {
    /// Returns a sample of readings alone, of a structure at rest.
    pub fn of(measurement: &'a Measurement) -> PublishedSample<'a> {
        PublishedSample { measurement, states: &States::NONE, travel_m: Some(0.0) }
    }
}

/// Reason why a sample can't be published.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PublishError {
    /// The protocol can't encode the sample.
    #[error(transparent)]
    Encode(#[from] resonarm_protocol::EncodeError),
    /// A reading is infinite or not a number.
    #[error("{name} is {got}")]
    NotFinite {
        /// Name of the reading.
        name: ChannelName,
        /// Value of the reading.
        got: f64,
    },
}
