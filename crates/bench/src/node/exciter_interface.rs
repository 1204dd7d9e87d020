//! The exciter's node as a run loop knows it, whatever protocol it speaks on the wire.

use alloc::vec::Vec;
use core::fmt;

use resonarm_protocol::node::{FrameCounts, NodeCore, NodeEvent, Work};
use resonarm_protocol::{Emergency, Frame, NodeState};

use super::{Carried, ExciterLack, ExciterNode, ExciterOutcome, ExciterRemark};
use crate::rig::Load;

/// The exciter's node with its controller: frames and the time go in, frames and events come out. Nothing allocates
/// after construction.
pub trait ExciterInterface: fmt::Debug + Send {
    /// State, fault, counts and events of the node.
    fn core(&self) -> &NodeCore;

    /// The same, to change it.
    fn core_mut(&mut self) -> &mut NodeCore;

    /// The controller, the phase of its work and the samples answered.
    fn work(&self) -> &Work<Carried>;

    /// The same, to change it.
    fn work_mut(&mut self) -> &mut Work<Carried>;

    /// How many frames wait to be sent.
    fn waiting(&self) -> usize;

    /// Boots the node.
    fn start(&mut self, now_ns: u64);

    /// The node's state: operational while its controller answers samples.
    fn state(&self) -> NodeState {
        self.core().state()
    }

    /// How the work ended, once it has.
    fn outcome(&self) -> Option<ExciterOutcome> {
        self.work().outcome()
    }

    /// Whether a plant has been heard.
    fn has_heard_plant(&self) -> bool {
        self.work().has_heard
    }

    /// Samples answered so far, including lost ones.
    fn samples_played(&self) -> u64 {
        self.work().samples_played()
    }

    /// Samples of the plant that were never complete.
    fn missed_samples(&self) -> u64 {
        self.work().missed_samples()
    }

    /// Sample periods by which the plant said its schedule has moved; 0 if the protocol has no word for it.
    fn slipped_periods(&self) -> u64 {
        0
    }

    /// The plant's fault that is the reason of this node's, where the protocol tells it apart.
    fn plant_fault(&self) -> Option<Emergency> {
        None
    }

    /// Whether this node has faulted for lack of samples, and the plant may still say why.
    fn awaits_reason(&self) -> bool {
        false
    }

    /// Whether the work is done, and all frames are sent.
    fn is_quiet(&self) -> bool {
        self.outcome().is_some() && self.waiting() == 0
    }

    /// What was counted of frames.
    fn frames(&self) -> FrameCounts {
        self.core().counts
    }

    /// The controller, with what it has read.
    fn carried(&self) -> &Carried {
        &self.work().controller
    }

    /// The controller, to steer it and to fetch what it has read.
    fn carried_mut(&mut self) -> &mut Carried {
        &mut self.work_mut().controller
    }

    /// Refuses a load that the wire can't command; of Resonarm's protocol the encoder does.
    ///
    /// # Errors
    /// [`ExciterLack`] names the part that can't be.
    fn check_load(&self, _load: &Load) -> Result<(), ExciterLack> {
        Ok(())
    }

    /// What the exciter can't know on this wire.
    fn remarks(&self) -> Vec<ExciterRemark> {
        Vec::new()
    }

    /// Handles a frame from the bus; frames of other nodes are ignored.
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame);

    /// Does what is due.
    fn handle_deadline(&mut self, now_ns: u64);

    /// When [`ExciterInterface::handle_deadline`] is to be called next, at the latest, ns.
    fn next_deadline_ns(&self) -> u64;

    /// Starts over after a fault; `false` if no fault ended the work, or the node leaves.
    fn rearm(&mut self, now_ns: u64) -> bool;

    /// Leaves the bus in good order: disarms the plant. It has left when [`ExciterInterface::is_quiet`].
    fn leave(&mut self, now_ns: u64);

    /// The bus is off: a playing controller faults.
    fn bus_lost(&mut self, now_ns: u64);

    /// Says before the start that the plant is on a bus in lockstep, where it sends readings before it is armed: these
    /// answer no command, and must not be taken for its first sample.
    fn expect_unarmed_readings(&mut self) {}

    /// The plant has ended for good, by what the process knows that runs both; of protocols that say so themselves
    /// nothing follows.
    fn plant_ended(&mut self, _now_ns: u64) {}

    /// The next frame to send. It may change with any other call.
    fn next_frame(&mut self) -> Option<Frame>;

    /// The bus has taken the frame from [`ExciterInterface::next_frame`].
    fn frame_sent(&mut self);

    /// The next event.
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
