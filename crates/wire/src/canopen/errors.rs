//! Objects for errors: their history (1003), the error register (1001) and the monitored heartbeats (1016).

use alloc::vec;
use alloc::vec::Vec;

use super::NODE_ID_MAX;
use super::abort::Abort;
use super::dictionary::{Access, Address, Dictionary, Entry, Kind, Object, Value, at};

/// Address of the error register.
pub(super) const ERROR_REGISTER: Address = at(0x1001, 0);
/// Index of the error history.
const HISTORY: u16 = 0x1003;
/// Number of errors that the history keeps.
const HISTORY_LENGTH: u8 = 8;
/// Index of the monitored heartbeats.
pub(super) const CONSUMER_HEARTBEAT: u16 = 0x1016;
/// Number of heartbeats that a node can monitor.
pub(super) const CONSUMERS: u8 = 4;

const ERROR_NAMES: [&str; HISTORY_LENGTH as usize] =
    ["Error 1", "Error 2", "Error 3", "Error 4", "Error 5", "Error 6", "Error 7", "Error 8"];
const CONSUMER_NAMES: [&str; CONSUMERS as usize] = ["Heartbeat 1", "Heartbeat 2", "Heartbeat 3", "Heartbeat 4"];

/// Adds the error history (1003) and the monitored heartbeats (1016) to a dictionary.
pub fn add_error_objects(dictionary: &mut Dictionary) {
    // Subindex 0 is writable, since writing 0 to it clears the history (CiA 301); the errors themselves are not.
    let mut errors = vec![Entry::new(0, "Number of errors", Access::ReadWrite, Value::U8(0))];
    let names = (1..=HISTORY_LENGTH).zip(ERROR_NAMES);
    errors.extend(names.map(|(subindex, name)| Entry::new(subindex, name, Access::ReadOnly, Value::U32(0))));
    dictionary.add(Object { index: HISTORY, name: "Pre-defined error field", kind: Kind::Array, entries: errors });
    let mut consumers = Vec::from([Entry::new(0, "Largest subindex", Access::Const, Value::U8(CONSUMERS))]);
    let names = (1..=CONSUMERS).zip(CONSUMER_NAMES);
    consumers.extend(names.map(|(subindex, name)| Entry::new(subindex, name, Access::ReadWrite, Value::U32(0))));
    let name = "Consumer heartbeat time";
    dictionary.add(Object { index: CONSUMER_HEARTBEAT, name, kind: Kind::Array, entries: consumers });
}

/// Writes an error at the front of the history: the code, with the manufacturer's information in the upper
/// half.
pub(super) fn record_error(dictionary: &mut Dictionary, code: u16, more: u16) {
    // The newest error stands at subindex 1 (CiA 301), so the others move back, from the last to the first.
    for subindex in (2..=HISTORY_LENGTH).rev() {
        let before = dictionary.number(at(HISTORY, subindex - 1));
        dictionary.set(at(HISTORY, subindex), before as f64);
    }
    dictionary.set(at(HISTORY, 1), f64::from(u32::from(more) << 16 | u32::from(code)));
    let count = dictionary.number(at(HISTORY, 0)) + 1;
    dictionary.set(at(HISTORY, 0), count.min(HISTORY_LENGTH.into()) as f64);
}

/// Returns whether an entry of the history is empty, so that reading it must fail.
pub(super) fn is_empty(dictionary: &Dictionary, address: Address) -> bool {
    address.index == HISTORY && i64::from(address.subindex) > dictionary.number(at(HISTORY, 0))
}

/// Checks a master's write to the history, which can only be cleared with 0. Other addresses pass.
pub(super) fn check_history(address: Address, value: Value) -> Result<(), Abort> {
    if address == at(HISTORY, 0) && value.number() != Some(0) { Err(Abort::Value) } else { Ok(()) }
}

/// Decodes an entry of the monitored heartbeats: node id and time, ms; 0 ms means none.
pub(super) const fn consumer(word: u32) -> (u8, u16) {
    ((word >> 16) as u8, word as u16)
}

/// Checks a master's write to the monitored heartbeats: the node id must exist and not be monitored twice.
/// Other addresses pass.
pub(super) fn check_consumer(dictionary: &Dictionary, address: Address, value: Value) -> Result<(), Abort> {
    let (CONSUMER_HEARTBEAT, Some(word)) = (address.index, value.number()) else { return Ok(()) };
    let (node_id, time_ms) = consumer(word as u32);
    // A time of 0 ends the monitoring, so the node id does not matter.
    if time_ms == 0 {
        return Ok(());
    }
    if word >> 24 != 0 || !(1..=NODE_ID_MAX).contains(&node_id) {
        return Err(Abort::Value);
    }
    let is_same = |subindex: u8| {
        let (other, other_ms) = consumer(dictionary.number(at(CONSUMER_HEARTBEAT, subindex)) as u32);
        subindex != address.subindex && other == node_id && other_ms > 0
    };
    if (1..=CONSUMERS).any(is_same) { Err(Abort::Incompatible) } else { Ok(()) }
}
