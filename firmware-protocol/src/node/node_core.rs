//! The core of every node, whatever protocol it speaks: state, fault, timeouts, counts and events.
//!
//! Transitions are the truth of a run: whether it was armed, when that ended, why it faulted. They are counted, and wait
//! in a ring of their own that never loses the newest state. Everything else is a note: of those the newest are dropped
//! when too many wait, and [`NodeEvent::Lost`] tells how many.

use super::event::NodeEvent;
use super::frames::{FrameCounts, FrameFault};
use super::listening::Listening;
use super::queue::Queue;
use super::timing::Timing;
use crate::frame::Id;
use crate::message::Emergency;
use crate::state::{NodeState, StateEvent};

/// Transitions that wait to be fetched one by one. Where more wait, the last one leads to the newest state.
const TURNS: usize = 16;

/// Other events that wait to be fetched.
const NOTES: usize = 64;

/// A transition that waits to be fetched, with the fault that it tells.
#[derive(Clone, Copy, Debug)]
struct Turn {
    order: u32,
    from: NodeState,
    to: NodeState,
    fault: Option<Emergency>,
}

/// State, fault, timeouts, counts and events of a node.
#[derive(Clone, Debug)]
pub struct NodeCore {
    /// The time that the node listened: the clock of its timeouts.
    pub listening: Listening,
    /// Counts of the frames that came, by what became of them.
    pub counts: FrameCounts,
    state: NodeState,
    fault: Option<Emergency>,
    arms: u32,
    leaves: u32,
    /// Since when, in time listened, frames wait and none was sent.
    jammed_since_ns: Option<u64>,
    jam_timeout_ns: u64,
    turns: Queue<Turn, TURNS>,
    notes: Queue<(u32, NodeEvent), NOTES>,
    /// Number of the lost notes that were reported.
    told_lost: u64,
    /// The number of the next turn or note.
    order: u32,
}

impl NodeCore {
    /// Returns a node in the state boot-up.
    pub const fn new(timing: &Timing) -> NodeCore {
        NodeCore {
            listening: Listening::new(timing.look_period_ns),
            counts: FrameCounts { unsent: 0, refused: 0, other_sender: 0, overwritten: 0, limited_values: 0 },
            state: NodeState::BootUp,
            fault: None,
            arms: 0,
            leaves: 0,
            jammed_since_ns: None,
            jam_timeout_ns: timing.command_timeout_ns,
            turns: Queue::new(),
            notes: Queue::new(),
            told_lost: 0,
            order: 0,
        }
    }

    /// Starts to listen, and leaves the boot-up.
    pub fn start(&mut self, now_ns: u64) {
        self.listening.start(now_ns);
        self.turn(StateEvent::Started);
    }

    /// Returns the state of the node.
    pub const fn state(&self) -> NodeState {
        self.state
    }

    /// Whether the node is operational.
    pub fn is_operational(&self) -> bool {
        self.state == NodeState::Operational
    }

    /// The fault that is latched, if one is.
    pub const fn latched_fault(&self) -> Option<Emergency> {
        self.fault
    }

    /// Returns how often the node was armed.
    pub const fn arms(&self) -> u32 {
        self.arms
    }

    /// Returns how often an armed node was disarmed, or faulted.
    pub const fn leaves(&self) -> u32 {
        self.leaves
    }

    /// Follows the table of states; `false` if the table has no such event in this state. A fault is forgotten when it
    /// is reset.
    pub fn turn(&mut self, event: StateEvent) -> bool {
        self.go(event, None)
    }

    /// Faults and latches `emergency`; `false` if a fault is latched already.
    pub fn fail(&mut self, emergency: Emergency) -> bool {
        self.go(StateEvent::Fault, Some(emergency))
    }

    fn go(&mut self, event: StateEvent, fault: Option<Emergency>) -> bool {
        let Some(to) = self.state.next(event) else { return false };
        let from = core::mem::replace(&mut self.state, to);
        // `None` for every event but a fault. Only a reset leaves the state fault, so only a reset forgets one.
        self.fault = fault;
        // The counts are taken here and not from the events, so that they are right however many transitions are
        // merged.
        self.arms = self.arms.saturating_add(u32::from(to == NodeState::Operational));
        self.leaves = self.leaves.saturating_add(u32::from(from == NodeState::Operational));
        let order = self.next_order();
        // If the ring is full, its last transition is extended to the new state. Whoever fetches it still ends
        // in the state of the node, and a fault in between is not forgotten.
        let is_full = self.turns.len() == TURNS;
        match self.turns.back_mut().filter(|_| is_full) {
            Some(last) => (last.to, last.fault) = (to, fault.or(last.fault)),
            None => self.turns.push(Turn { order, from, to, fault }),
        }
        true
    }

    /// Notes an event that is neither a change of state nor the fault that causes one; it is dropped, and counted, if
    /// too many wait.
    pub fn note(&mut self, event: NodeEvent) {
        let order = self.next_order();
        self.notes.push((order, event));
    }

    /// Counts and notes a frame that failed a check.
    pub fn reject(&mut self, fault: FrameFault) {
        self.counts.refused += 1;
        self.note(NodeEvent::Frame(fault));
    }

    /// Counts and notes a frame from another node with an identifier that only this node sends. It counts as rejected
    /// only if the caller adds it there: a plant of a user protocol has no check that such a frame fails.
    pub fn reject_sender(&mut self, id: Id) {
        self.counts.other_sender += 1;
        self.note(NodeEvent::OtherSender(id));
    }

    /// Notes that a frame waits to be sent, which begins the time of a jam.
    pub fn frame_waits(&mut self) {
        // The first frame that waits starts the time; those that join it don't prolong it.
        self.jammed_since_ns.get_or_insert(self.listening.listened_ns());
    }

    /// Notes that a frame was sent, or that those which waited were dropped. The time of a jam begins again if others
    /// wait, else it ends.
    pub fn frame_sent(&mut self, do_others_wait: bool) {
        self.jammed_since_ns = do_others_wait.then(|| self.listening.listened_ns());
    }

    /// Whether frames have waited for the timeout of commands and none could be sent.
    pub fn is_jammed(&self) -> bool {
        self.jammed_since_ns.is_some_and(|since_ns| self.listening.has_passed(since_ns, self.jam_timeout_ns))
    }

    /// Frames not sent, for the detail of a bus loss: `waiting` ones, and those that newer ones replaced.
    pub fn not_sent(&self, waiting: usize) -> u16 {
        u16::try_from(self.counts.unsent.saturating_add(waiting as u64)).unwrap_or(u16::MAX)
    }

    fn next_order(&mut self) -> u32 {
        let order = self.order;
        self.order = order.wrapping_add(1);
        order
    }

    /// The next event, in the order in which they happened. A fault comes before the transition that it causes. Notes
    /// that were dropped are told behind those that were not.
    pub fn poll(&mut self) -> Option<NodeEvent> {
        let note = self.notes.front().map(|(order, _)| *order);
        let lost = self.notes.lost().saturating_sub(self.told_lost);
        // The queue drops the newest notes when it is full, so that those which are lost come behind all that wait.
        if note.is_none() && lost > 0 {
            self.told_lost = self.notes.lost();
            return Some(NodeEvent::Lost(lost));
        }
        match self.turns.front_mut() {
            // The sign of the wrapped difference orders both, also when the counter overflows.
            Some(turn) if note.is_none_or(|note| (turn.order.wrapping_sub(note) as i32) < 0) => {
                // The transition stays in front, for the next call.
                if let Some(fault) = turn.fault.take() {
                    return Some(NodeEvent::Emergency(fault));
                }
                self.turns.pop().map(|Turn { from, to, .. }| NodeEvent::State { from, to })
            }
            _ => self.notes.pop().map(|(_, event)| event),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EmergencyCode, Node};
    use std::vec::Vec;

    fn new_core() -> NodeCore {
        NodeCore::new(&Timing::real_time(1000))
    }

    fn all(core: &mut NodeCore) -> Vec<NodeEvent> {
        core::iter::from_fn(|| core.poll()).collect()
    }

    /// A note with a number.
    fn note(number: u32) -> NodeEvent {
        NodeEvent::OtherSender(Id::Extended(number))
    }

    #[test]
    fn three_hundred_notes_on_both_sides_hide_no_transition() {
        let mut core = new_core();
        core.turn(StateEvent::Started);
        (0..300).for_each(|number| core.note(note(number)));
        core.turn(StateEvent::Arm);
        core.turn(StateEvent::Disarm);
        (0..300).for_each(|number| core.note(note(number)));
        assert_eq!((core.arms(), core.leaves()), (1, 1));
        let happened = all(&mut core);
        let states: Vec<_> = happened.iter().filter(|one| matches!(one, NodeEvent::State { .. })).collect();
        assert_eq!(states.len(), 3, "{happened:?}");
        // Of 600 notes 64 have waited.
        assert!(happened.contains(&NodeEvent::Lost(536)));
        assert_eq!(happened.iter().filter(|one| matches!(one, NodeEvent::OtherSender(_))).count(), 64);
        assert_eq!(core.poll(), None);
    }

    #[test]
    fn what_happened_is_told_in_its_order() {
        let mut core = new_core();
        let emergency = Emergency { node: Node::Plant, code: EmergencyCode::BusLoss, detail: 3, sample: 9 };
        core.note(note(1));
        core.turn(StateEvent::Started);
        core.note(note(2));
        assert!(core.fail(emergency) && !core.fail(emergency));
        core.note(note(3));
        let boot = NodeState::BootUp;
        let idle = NodeState::PreOperational;
        let fault = NodeState::Fault;
        let expected = [
            note(1),
            NodeEvent::State { from: boot, to: idle },
            note(2),
            NodeEvent::Emergency(emergency),
            NodeEvent::State { from: idle, to: fault },
            note(3),
        ];
        assert_eq!(all(&mut core), expected);
        assert_eq!(core.latched_fault(), Some(emergency));
        core.turn(StateEvent::Reset);
        assert_eq!((core.latched_fault(), core.state()), (None, idle));
    }

    #[test]
    fn of_a_hundred_transitions_the_last_told_is_the_state() {
        let mut core = new_core();
        core.turn(StateEvent::Started);
        for _ in 0..50 {
            core.turn(StateEvent::Arm);
            core.turn(StateEvent::Disarm);
        }
        core.turn(StateEvent::Arm);
        assert_eq!((core.arms(), core.leaves()), (51, 50));
        let happened = all(&mut core);
        // 102 transitions, of which the last 87 are merged into the sixteenth.
        assert_eq!(happened.len(), TURNS);
        assert!(matches!(happened.last(), Some(NodeEvent::State { to: NodeState::Operational, .. })), "{happened:?}");
    }

    #[test]
    fn frames_that_wait_jam_the_bus_after_the_timeout() {
        let mut core = new_core();
        core.start(0);
        core.frame_waits();
        let listen = |core: &mut NodeCore, ticks: u64| {
            let from = core.listening.listened_ns();
            (1..=ticks).for_each(|tick| core.listening.look(from + tick * 1_000_000));
            core.is_jammed()
        };
        assert!(!listen(&mut core, 19), "the timeout is 20 ms");
        core.frame_sent(true);
        assert!(!listen(&mut core, 19) && listen(&mut core, 1));
        core.counts.unsent = 5;
        assert_eq!((core.not_sent(3), core.not_sent(1 << 20)), (8, u16::MAX));
        core.frame_sent(false);
        assert!(!listen(&mut core, 100));
    }
}
