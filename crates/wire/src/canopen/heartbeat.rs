//! Monitoring of other nodes' heartbeats (CiA 301, section 7.2.8.2.2).

use super::dictionary::{Dictionary, at};
use super::errors::{CONSUMER_HEARTBEAT, CONSUMERS, consumer};

/// Time of the last heartbeat of each monitored node, ns of time listened. `None` before the first one, with
/// which monitoring begins.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Consumers {
    heard_ns: [Option<u64>; CONSUMERS as usize],
}

impl Consumers {
    /// Returns the index of the entry that monitors a node.
    pub fn place_of(&self, dictionary: &Dictionary, node_id: u8) -> Option<usize> {
        (0..self.heard_ns.len()).find(|place| {
            let (node, time_ns) = entry(dictionary, *place);
            node == node_id && time_ns > 0
        })
    }

    /// Notes the heartbeat of the entry with this index.
    pub fn hear(&mut self, place: usize, listened_ns: u64) {
        if let Some(heard_ns) = self.heard_ns.get_mut(place) {
            *heard_ns = Some(listened_ns);
        }
    }

    /// Restarts the entry of this subindex, which was written: monitoring begins with the next heartbeat.
    pub fn forget(&mut self, subindex: u8) {
        // Subindex 0 is the number of entries, and monitors nothing.
        if let Some(heard_ns) = usize::from(subindex).checked_sub(1).and_then(|place| self.heard_ns.get_mut(place)) {
            *heard_ns = None;
        }
    }

    /// Returns the last time and the time limit of every running entry, ns.
    pub fn watched(&self, dictionary: &Dictionary) -> impl Iterator<Item = (u64, u64)> {
        let all = self.heard_ns.iter().enumerate();
        all.filter_map(move |(place, heard_ns)| Some(((*heard_ns)?, entry(dictionary, place).1)))
    }

    /// Returns whether a heartbeat is overdue. Its monitoring stops and restarts with the next one.
    pub fn take_lost(&mut self, dictionary: &Dictionary, is_over: impl Fn(u64, u64) -> bool) -> bool {
        let mut is_lost = false;
        for (place, heard_ns) in self.heard_ns.iter_mut().enumerate() {
            let (_, time_ns) = entry(dictionary, place);
            if heard_ns.is_some_and(|heard_ns| is_over(heard_ns, time_ns)) {
                // An overdue heartbeat is reported once. Without this reset the node would report it again at
                // every call.
                *heard_ns = None;
                is_lost = true;
            }
        }
        is_lost
    }
}

/// Returns node id and time limit, ns, of an entry.
fn entry(dictionary: &Dictionary, place: usize) -> (u8, u64) {
    let word = dictionary.number(at(CONSUMER_HEARTBEAT, place as u8 + 1)) as u32;
    let (node_id, time_ms) = consumer(word);
    (node_id, u64::from(time_ms) * 1_000_000)
}
