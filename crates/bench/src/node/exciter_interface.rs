//! The exciter's node as a run loop uses it, whatever its protocol is.

use alloc::vec::Vec;
use core::fmt;

use resonarm_protocol::node::{FrameCounts, NodeCore, NodeEvent, Work};
use resonarm_protocol::{Emergency, Frame, NodeState};

use super::carried::{Carried, ExciterNode, ExciterOutcome};
use super::exciter_lack::{ExciterLack, ExciterRemark, names};
use crate::rig::{Load, Measurement};
use crate::structure::{LOADS, LoadSet};

/// The exciter's node with its controller: frames and time go in, frames and events come out. It allocates
/// nothing after construction.
pub trait ExciterInterface: fmt::Debug + Send {
    /// Returns state, fault, counts and events of the node.
    fn core(&self) -> &NodeCore;

    /// Returns the core for changes.
    fn core_mut(&mut self) -> &mut NodeCore;

    /// Returns the controller, the phase of its work and the answered samples.
    fn work(&self) -> &Work<Carried>;

    /// Returns the work for changes.
    fn work_mut(&mut self) -> &mut Work<Carried>;

    /// Returns the number of frames that wait to be sent.
    fn waiting(&self) -> usize;

    /// Boots the node at the time `now_ns`.
    fn start(&mut self, now_ns: u64);

    /// Returns the node's state; it is operational while its controller answers samples.
    fn state(&self) -> NodeState {
        self.core().state()
    }

    /// Returns how the work has ended; `None` while it goes on.
    fn outcome(&self) -> Option<ExciterOutcome> {
        self.work().outcome()
    }

    /// Returns whether a plant has been heard.
    fn has_heard_plant(&self) -> bool {
        self.work().has_heard
    }

    /// Returns the number of samples answered so far, including lost ones.
    fn samples_played(&self) -> u64 {
        self.work().samples_played()
    }

    /// Returns the sample periods by which the plant's schedule has moved, as reported; 0 if the protocol can't
    /// report it.
    fn slipped_periods(&self) -> u64 {
        0
    }

    /// Returns the plant's fault that caused this node's fault, if the protocol distinguishes it.
    fn plant_fault(&self) -> Option<Emergency> {
        None
    }

    /// Returns whether this node has faulted for lack of samples, and the plant may still report the reason.
    fn awaits_reason(&self) -> bool {
        false
    }

    /// Returns whether the work has ended and all frames have been sent.
    fn is_quiet(&self) -> bool {
        self.outcome().is_some() && self.waiting() == 0
    }

    /// Returns the counts of frames.
    fn frames(&self) -> FrameCounts {
        self.core().counts
    }

    /// Returns the controller with what it has read.
    fn carried(&self) -> &Carried {
        &self.work().controller
    }

    /// Returns the controller, to steer it and to fetch what it has read.
    fn carried_mut(&mut self) -> &mut Carried {
        &mut self.work_mut().controller
    }

    /// Returns the load that answers the last sample, with the sample's index on the bus; `None` if no load answers it.
    fn answering_load(&self) -> Option<(u16, Load)> {
        let (sample, load) = self.carried().last_answer()?;
        // The controller may have ended with a later sample, which no load answers.
        (sample + 1 == self.samples_played()).then_some((self.work().last_index, load))
    }

    /// Checks that the protocol can command a load. With Resonarm's protocol the encoder checks the ranges.
    ///
    /// # Errors
    /// [`ExciterLack`] names the part that can't be.
    fn check_load(&self, load: &Load) -> Result<(), ExciterLack> {
        match LoadSet::NATIVE.lacks(load) {
            Some((place, _)) => Err(ExciterLack::Native { part: LOADS[place].name }),
            None => Ok(()),
        }
    }

    /// Checks that the protocol carries every reading that the controller needs. A node of a user protocol is built only
    /// if it does.
    ///
    /// # Errors
    /// [`ExciterLack::NativeReadings`] names those that it does not carry.
    fn check_readings(&self) -> Result<(), ExciterLack> {
        Ok(())
    }

    /// Returns what the exciter can't know with this protocol.
    fn remarks(&self) -> Vec<ExciterRemark> {
        Vec::new()
    }

    /// Handles a frame from the bus; frames of other nodes are ignored.
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame);

    /// Does everything that is due at `now_ns`.
    fn handle_deadline(&mut self, now_ns: u64);

    /// Returns the latest time at which [`ExciterInterface::handle_deadline`] must be called next, ns.
    fn next_deadline_ns(&self) -> u64;

    /// Starts over after a fault. Returns `false` if no fault ended the work, or the node is leaving.
    fn rearm(&mut self, now_ns: u64) -> bool;

    /// Leaves the bus in good order by disarming the plant. The node has left when
    /// [`ExciterInterface::is_quiet`].
    fn leave(&mut self, now_ns: u64);

    /// Handles the loss of the bus: a playing controller faults.
    fn bus_lost(&mut self, now_ns: u64);

    /// States before the start that the plant is on a bus in lockstep, where it sends readings before it is
    /// armed. These answer no command and must not be taken for its first sample.
    fn expect_unarmed_readings(&mut self) {}

    /// States that the plant has ended for good, as the process knows that runs both. Nothing follows with
    /// protocols that report it themselves.
    fn plant_ended(&mut self, _now_ns: u64) {}

    /// Returns the next frame to send. It may change with any other call.
    fn next_frame(&mut self) -> Option<Frame>;

    /// Notes that the bus has taken the frame from [`ExciterInterface::next_frame`].
    fn frame_sent(&mut self);

    /// Returns the next event, if there is one.
    fn poll_event(&mut self) -> Option<NodeEvent> {
        self.core_mut().poll()
    }
}

impl ExciterInterface for ExciterNode {
    fn core(&self) -> &NodeCore {
        ExciterNode::core(self)
    }

    fn core_mut(&mut self) -> &mut NodeCore {
        ExciterNode::core_mut(self)
    }

    fn work(&self) -> &Work<Carried> {
        ExciterNode::work(self)
    }

    fn work_mut(&mut self) -> &mut Work<Carried> {
        ExciterNode::work_mut(self)
    }

    fn waiting(&self) -> usize {
        ExciterNode::waiting(self)
    }

    fn check_readings(&self) -> Result<(), ExciterLack> {
        let needs = self.carried().controller.needs().into_iter();
        let needed: Vec<_> = needs.filter(|needed| needed.place >= Measurement::CHANNELS).collect();
        if needed.is_empty() { Ok(()) } else { Err(ExciterLack::NativeReadings { needed: names(&needed) }) }
    }

    fn start(&mut self, now_ns: u64) {
        ExciterNode::start(self, now_ns);
    }

    fn has_heard_plant(&self) -> bool {
        ExciterNode::has_heard_plant(self)
    }

    fn slipped_periods(&self) -> u64 {
        ExciterNode::slipped_periods(self)
    }

    fn plant_fault(&self) -> Option<Emergency> {
        ExciterNode::plant_fault(self)
    }

    fn awaits_reason(&self) -> bool {
        ExciterNode::awaits_reason(self)
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        ExciterNode::handle_frame(self, now_ns, frame);
    }

    fn handle_deadline(&mut self, now_ns: u64) {
        ExciterNode::handle_deadline(self, now_ns);
    }

    fn next_deadline_ns(&self) -> u64 {
        ExciterNode::next_deadline_ns(self)
    }

    fn rearm(&mut self, now_ns: u64) -> bool {
        ExciterNode::rearm(self, now_ns)
    }

    fn leave(&mut self, now_ns: u64) {
        ExciterNode::leave(self, now_ns);
    }

    fn bus_lost(&mut self, now_ns: u64) {
        ExciterNode::bus_lost(self, now_ns);
    }

    fn next_frame(&mut self) -> Option<Frame> {
        ExciterNode::next_frame(self)
    }

    fn frame_sent(&mut self) {
        ExciterNode::frame_sent(self);
    }
}
