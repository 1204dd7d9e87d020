//! State, fault and events of a node, whatever protocol it speaks.
//!
//! Transitions are the truth of a run: whether it was armed, when that ended, why it faulted. They are counted, and wait
//! in a ring of their own that never loses the newest state. Everything else is a note: of those the newest are dropped
//! when too many wait, and how many is told.

use super::queue::Queue;
use crate::{Emergency, NodeState, StateEvent};

/// Transitions that wait to be fetched one by one. Where more wait, the last one leads to the newest state.
const TURNS: usize = 16;

/// A transition that waits to be fetched, with the fault that it tells.
#[derive(Clone, Copy, Debug)]
struct Turn {
    order: u32,
    from: NodeState,
    to: NodeState,
    fault: Option<Emergency>,
}

/// Something that happened to a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Happening<N> {
    /// It faulted, for this reason; its transition follows.
    Fault(Emergency),
    /// It changed its state.
    State {
        /// The state before.
        from: NodeState,
        /// The state now.
        to: NodeState,
    },
    /// A note.
    Note(N),
    /// So many notes were dropped, as too many waited.
    Lost(u64),
}

/// State, fault and events of a node; at most `NOTES` notes wait to be fetched.
#[derive(Clone, Debug)]
pub struct NodeCore<N, const NOTES: usize> {
    state: NodeState,
    fault: Option<Emergency>,
    arms: u32,
    leaves: u32,
    turns: Queue<Turn, TURNS>,
    notes: Queue<(u32, N), NOTES>,
    /// Of the notes lost, those that were told.
    told_lost: u64,
    /// The number of the next turn or note.
    order: u32,
}

impl<N, const NOTES: usize> Default for NodeCore<N, NOTES> {
    fn default() -> NodeCore<N, NOTES> {
        NodeCore::new()
    }
}

impl<N, const NOTES: usize> NodeCore<N, NOTES> {
    /// The state boot-up.
    pub const fn new() -> NodeCore<N, NOTES> {
        NodeCore {
            state: NodeState::BootUp,
            fault: None,
            arms: 0,
            leaves: 0,
            turns: Queue::new(),
            notes: Queue::new(),
            told_lost: 0,
            order: 0,
        }
    }

    /// The state.
    pub const fn state(&self) -> NodeState {
        self.state
    }

    /// The fault that is latched, if one is.
    pub const fn latched_fault(&self) -> Option<Emergency> {
        self.fault
    }

    /// How often the node was armed.
    pub const fn arms(&self) -> u32 {
        self.arms
    }

    /// How often an armed node was disarmed, or faulted.
    pub const fn leaves(&self) -> u32 {
        self.leaves
    }

    /// Follows the table of states; returns the states before and after, or `None` if the table has no such event in
    /// this state. A fault is forgotten when it is reset.
    pub fn turn(&mut self, event: StateEvent) -> Option<(NodeState, NodeState)> {
        self.go(event, None)
    }

    /// Faults and latches `emergency`; `false` if a fault is latched already.
    pub fn fail(&mut self, emergency: Emergency) -> bool {
        self.go(StateEvent::Fault, Some(emergency)).is_some()
    }

    fn go(&mut self, event: StateEvent, fault: Option<Emergency>) -> Option<(NodeState, NodeState)> {
        let to = self.state.next(event)?;
        let from = core::mem::replace(&mut self.state, to);
        self.fault = fault;
        self.arms = self.arms.saturating_add(u32::from(to == NodeState::Operational));
        self.leaves = self.leaves.saturating_add(u32::from(from == NodeState::Operational));
        let order = self.next_order();
        let is_full = self.turns.len() == TURNS;
        match self.turns.back_mut().filter(|_| is_full) {
            Some(last) => (last.to, last.fault) = (to, fault.or(last.fault)),
            None => self.turns.push(Turn { order, from, to, fault }),
        }
        Some((from, to))
    }

    /// Notes something; it is dropped, and counted, if too many notes wait.
    pub fn note(&mut self, note: N) {
        let order = self.next_order();
        self.notes.push((order, note));
    }

    fn next_order(&mut self) -> u32 {
        let order = self.order;
        self.order = order.wrapping_add(1);
        order
    }

    /// The next that happened, in its order. Notes that were dropped are told behind those that were not.
    pub fn poll(&mut self) -> Option<Happening<N>> {
        let note = self.notes.front().map(|(order, _)| *order);
        let lost = self.notes.lost().saturating_sub(self.told_lost);
        if note.is_none() && lost > 0 {
            self.told_lost = self.notes.lost();
            return Some(Happening::Lost(lost));
        }
        match self.turns.front_mut() {
            Some(turn) if note.is_none_or(|note| (turn.order.wrapping_sub(note) as i32) < 0) => {
                if let Some(fault) = turn.fault.take() {
                    return Some(Happening::Fault(fault));
                }
                self.turns.pop().map(|Turn { from, to, .. }| Happening::State { from, to })
            }
            _ => self.notes.pop().map(|(_, note)| Happening::Note(note)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EmergencyCode, Node};
    use std::vec::Vec;

    type Core = NodeCore<u32, 64>;

    fn all(core: &mut Core) -> Vec<Happening<u32>> {
        core::iter::from_fn(|| core.poll()).collect()
    }

    #[test]
    fn three_hundred_notes_on_both_sides_hide_no_transition() {
        let mut core = Core::new();
        core.turn(StateEvent::Started);
        (0..300).for_each(|note| core.note(note));
        core.turn(StateEvent::Arm);
        core.turn(StateEvent::Disarm);
        (0..300).for_each(|note| core.note(note));
        assert_eq!((core.arms(), core.leaves()), (1, 1));
        let happened = all(&mut core);
        let states: Vec<_> = happened.iter().filter(|one| matches!(one, Happening::State { .. })).collect();
        assert_eq!(states.len(), 3, "{happened:?}");
        assert!(happened.contains(&Happening::Lost(536)));
        assert_eq!(happened.iter().filter(|one| matches!(one, Happening::Note(_))).count(), 64);
        assert_eq!(core.poll(), None);
    }

    #[test]
    fn what_happened_is_told_in_its_order() {
        let mut core = Core::new();
        let emergency = Emergency { node: Node::Plant, code: EmergencyCode::BusLoss, detail: 3, sample: 9 };
        core.note(1);
        core.turn(StateEvent::Started);
        core.note(2);
        assert!(core.fail(emergency) && !core.fail(emergency));
        core.note(3);
        let (boot, idle, fault) = (NodeState::BootUp, NodeState::PreOperational, NodeState::Fault);
        let expected = [
            Happening::Note(1),
            Happening::State { from: boot, to: idle },
            Happening::Note(2),
            Happening::Fault(emergency),
            Happening::State { from: idle, to: fault },
            Happening::Note(3),
        ];
        assert_eq!(all(&mut core), expected);
        assert_eq!(core.latched_fault(), Some(emergency));
        core.turn(StateEvent::Reset);
        assert_eq!((core.latched_fault(), core.state()), (None, idle));
    }

    #[test]
    fn of_a_hundred_transitions_the_last_told_is_the_state() {
        let mut core = Core::new();
        core.turn(StateEvent::Started);
        for _ in 0..50 {
            core.turn(StateEvent::Arm);
            core.turn(StateEvent::Disarm);
        }
        core.turn(StateEvent::Arm);
        assert_eq!((core.arms(), core.leaves()), (51, 50));
        let happened = all(&mut core);
        assert_eq!(happened.len(), TURNS);
        assert!(matches!(happened.last(), Some(Happening::State { to: NodeState::Operational, .. })), "{happened:?}");
    }
}
