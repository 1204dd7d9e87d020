//! The exciter's node as a run loop knows it, whatever protocol it speaks on the wire.

use alloc::vec::Vec;
use core::fmt;

use resonarm_protocol::{Emergency, Frame, NodeState};

use super::{Carried, ExciterLack, ExciterNode, ExciterOutcome, ExciterRemark, FrameCounts, WireEvent};
use resonarm_dynamics::arm::Load;

/// The exciter's node with its controller: frames and the time go in, frames and events come out. Nothing allocates
/// after construction.
pub trait ExciterInterface: fmt::Debug + Send {
    /// Boots the node.
    fn start(&mut self, now_ns: u64);

    /// The node's state: operational while its controller answers samples.
    fn state(&self) -> NodeState;

    /// How the work ended, once it has.
    fn outcome(&self) -> Option<ExciterOutcome>;

    /// Whether a plant has been heard.
    fn has_heard_plant(&self) -> bool;

    /// Samples answered so far, including lost ones.
    fn samples_played(&self) -> u64;

    /// Samples of the plant that were never complete.
    fn missed_samples(&self) -> u64;

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
    fn is_quiet(&self) -> bool;

    /// What was counted of frames.
    fn frames(&self) -> FrameCounts;

    /// The controller, with what it has read.
    fn carried(&self) -> &Carried;

    /// The controller, to steer it and to fetch what it has read.
    fn carried_mut(&mut self) -> &mut Carried;

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
    fn poll_event(&mut self) -> Option<WireEvent>;
}

impl ExciterInterface for ExciterNode {
    fn start(&mut self, now_ns: u64) {
        ExciterNode::start(self, now_ns);
    }

    fn state(&self) -> NodeState {
        ExciterNode::state(self)
    }

    fn outcome(&self) -> Option<ExciterOutcome> {
        ExciterNode::outcome(self)
    }

    fn has_heard_plant(&self) -> bool {
        ExciterNode::has_heard_plant(self)
    }

    fn samples_played(&self) -> u64 {
        ExciterNode::samples_played(self)
    }

    fn missed_samples(&self) -> u64 {
        ExciterNode::missed_samples(self)
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

    fn is_quiet(&self) -> bool {
        ExciterNode::is_quiet(self)
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

    fn carried(&self) -> &Carried {
        self.controller()
    }

    fn carried_mut(&mut self) -> &mut Carried {
        self.controller_mut()
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

    fn poll_event(&mut self) -> Option<WireEvent> {
        Some(WireEvent::of(&ExciterNode::poll_event(self)?, self.network()))
    }
}
