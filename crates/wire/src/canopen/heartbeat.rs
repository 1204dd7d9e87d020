//! The heartbeats of other nodes that a node watches (CiA 301, section 7.2.8.2.2).

use super::dictionary::{Dictionary, at};
use super::errors::{CONSUMER_HEARTBEAT, CONSUMERS, consumer};

/// When each heartbeat that is watched was heard last, in time listened, ns; `None` before the first, from which on it
/// is watched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Consumers {
    heard_ns: [Option<u64>; CONSUMERS as usize],
}

impl Consumers {
    /// No heartbeat was heard.
    pub const fn new() -> Consumers {
        Consumers { heard_ns: [None; CONSUMERS as usize] }
    }

    /// The place of the entry that has the heartbeat of a node watched.
    pub fn place_of(&self, dictionary: &Dictionary, node_id: u8) -> Option<usize> {
        (0..self.heard_ns.len()).find(|place| {
            let (node, time_ns) = entry(dictionary, *place);
            node == node_id && time_ns > 0
        })
    }

    /// The heartbeat of this place has come.
    pub fn hear(&mut self, place: usize, listened_ns: u64) {
        if let Some(heard_ns) = self.heard_ns.get_mut(place) {
            *heard_ns = Some(listened_ns);
        }
    }

    /// The entry of this subindex was written: it is watched from the next heartbeat on.
    pub fn forget(&mut self, subindex: u8) {
        if let Some(heard_ns) = usize::from(subindex).checked_sub(1).and_then(|place| self.heard_ns.get_mut(place)) {
            *heard_ns = None;
        }
    }

    /// When each was heard last, and its time, ns.
    pub fn watched(&self, dictionary: &Dictionary) -> impl Iterator<Item = (u64, u64)> {
        let all = self.heard_ns.iter().enumerate();
        all.filter_map(move |(place, heard_ns)| Some(((*heard_ns)?, entry(dictionary, place).1)))
    }

    /// Whether one has not come for its time; it is watched again from the next one on.
    pub fn take_lost(&mut self, dictionary: &Dictionary, is_over: impl Fn(u64, u64) -> bool) -> bool {
        let mut is_lost = false;
        for (place, heard_ns) in self.heard_ns.iter_mut().enumerate() {
            let (_, time_ns) = entry(dictionary, place);
            if heard_ns.is_some_and(|heard_ns| is_over(heard_ns, time_ns)) {
                (*heard_ns, is_lost) = (None, true);
            }
        }
        is_lost
    }
}

/// The node and the time, ns, of an entry.
fn entry(dictionary: &Dictionary, place: usize) -> (u8, u64) {
    let word = dictionary.number(at(CONSUMER_HEARTBEAT, place as u8 + 1)) as u32;
    let (node_id, time_ms) = consumer(word);
    (node_id, u64::from(time_ms) * 1_000_000)
}
