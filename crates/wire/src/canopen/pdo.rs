//! PDO parameters (CiA 301, section 7.5.2.35 to 7.5.2.38): what the master may write, and what a PDO holds.

use alloc::vec::Vec;

use super::Abort;
use super::dictionary::{Access, Address, Dictionary, Entry, Kind, Mappable, Object, Value, at};

/// PDOs in each direction.
pub const PDOS: u16 = 4;
/// The transmission type of PDOs that act, or are sent, without SYNC.
pub const EVENT_TYPE: u8 = 255;
/// Most entries of a PDO: each has at least one byte.
const MAPPED: u8 = 8;
/// The bit of an identifier that disables its PDO.
const DISABLED: u32 = 1 << 31;
/// The bit of an identifier that forbids remote frames.
const NO_REMOTE: u32 = 1 << 30;

/// Communication and mapping parameters of one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Direction {
    pub communication: u16,
    pub mapping: u16,
    /// The identifier of the first, without the node id.
    base: u16,
    mappable: Mappable,
}

pub(super) const RECEIVE: Direction =
    Direction { communication: 0x1400, mapping: 0x1600, base: 0x200, mappable: Mappable::Receive };
pub(super) const TRANSMIT: Direction =
    Direction { communication: 0x1800, mapping: 0x1A00, base: 0x180, mappable: Mappable::Transmit };

/// A PDO after a reset; without mapped entries it is disabled.
#[derive(Clone, Copy, Debug, Default)]
pub struct PdoDefaults<'a> {
    /// The mapped entries, as [`mapping_word`] gives them.
    pub mapped: &'a [u32],
    /// The transmission type.
    pub kind: u8,
    /// Sent: the event timer, ms; 0: none.
    pub event_timer_ms: u16,
}

/// An entry as a mapping parameter names it.
pub const fn mapping_word(address: Address, bits: u8) -> u32 {
    (address.index as u32) << 16 | (address.subindex as u32) << 8 | bits as u32
}

const RECEIVE_NAMES: [[&str; 4]; 2] = [
    ["RPDO 1 communication", "RPDO 2 communication", "RPDO 3 communication", "RPDO 4 communication"],
    ["RPDO 1 mapping", "RPDO 2 mapping", "RPDO 3 mapping", "RPDO 4 mapping"],
];
const TRANSMIT_NAMES: [[&str; 4]; 2] = [
    ["TPDO 1 communication", "TPDO 2 communication", "TPDO 3 communication", "TPDO 4 communication"],
    ["TPDO 1 mapping", "TPDO 2 mapping", "TPDO 3 mapping", "TPDO 4 mapping"],
];
const ENTRY_NAMES: [&str; 8] = ["Entry 1", "Entry 2", "Entry 3", "Entry 4", "Entry 5", "Entry 6", "Entry 7", "Entry 8"];

/// Adds the parameters of all PDOs of a node: those that it receives, then those that it sends.
pub fn add_pdos(dictionary: &mut Dictionary, node_id: u8, receive: &[PdoDefaults; 4], transmit: &[PdoDefaults; 4]) {
    for (direction, names, all) in [(RECEIVE, RECEIVE_NAMES, receive), (TRANSMIT, TRANSMIT_NAMES, transmit)] {
        for ((number, defaults), place) in (0..PDOS).zip(all).zip(0..) {
            let [communication, mapping] = names.map(|names| names.get(place).copied().unwrap_or(""));
            dictionary.add(communication_object((direction, number), communication, node_id, defaults));
            dictionary.add(mapping_object((direction, number), mapping, defaults));
        }
    }
}

fn communication_object(
    (direction, number): (Direction, u16),
    name: &'static str,
    node_id: u8,
    defaults: &PdoDefaults,
) -> Object {
    let is_sent = direction == TRANSMIT;
    let disabled = if defaults.mapped.is_empty() { DISABLED } else { 0 };
    let id = u32::from(direction.base + 0x100 * number + u16::from(node_id)) | disabled;
    let mut entries = Vec::new();
    entries.push(Entry::new(0, "Largest subindex", Access::Const, Value::U8(if is_sent { 5 } else { 2 })));
    entries.push(Entry::new(1, "COB-ID", Access::ReadWrite, Value::U32(id)).by_node());
    entries.push(Entry::new(2, "Transmission type", Access::ReadWrite, Value::U8(defaults.kind)));
    if is_sent {
        entries.push(Entry::new(3, "Inhibit time", Access::ReadWrite, Value::U16(0)));
        entries.push(Entry::new(5, "Event timer", Access::ReadWrite, Value::U16(defaults.event_timer_ms)));
    }
    Object { index: direction.communication + number, name, kind: Kind::Record, entries }
}

fn mapping_object((direction, number): (Direction, u16), name: &'static str, defaults: &PdoDefaults) -> Object {
    let mut entries = Vec::new();
    let count = defaults.mapped.len() as u8;
    entries.push(Entry::new(0, "Number of entries", Access::ReadWrite, Value::U8(count)));
    for (subindex, name) in (1..=MAPPED).zip(ENTRY_NAMES) {
        let word = defaults.mapped.get(usize::from(subindex) - 1).copied().unwrap_or(0);
        entries.push(Entry::new(subindex, name, Access::ReadWrite, Value::U32(word)));
    }
    Object { index: direction.mapping + number, name, kind: Kind::Record, entries }
}

/// The parameters of one PDO.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pdo {
    pub direction: Direction,
    /// From 0.
    pub number: u16,
}

impl Pdo {
    fn communication(self, dictionary: &Dictionary, subindex: u8) -> u32 {
        dictionary.number(at(self.direction.communication + self.number, subindex)) as u32
    }

    /// Its identifier; `None` if it is disabled.
    pub fn id(self, dictionary: &Dictionary) -> Option<u16> {
        let word = self.communication(dictionary, 1);
        (word & DISABLED == 0).then_some((word & 0x7FF) as u16)
    }

    pub fn allows_remote(self, dictionary: &Dictionary) -> bool {
        self.communication(dictionary, 1) & NO_REMOTE == 0
    }

    /// The transmission type.
    pub fn kind(self, dictionary: &Dictionary) -> u8 {
        self.communication(dictionary, 2) as u8
    }

    pub fn inhibit_ns(self, dictionary: &Dictionary) -> u64 {
        u64::from(self.communication(dictionary, 3)) * 100_000
    }

    pub fn event_timer_ns(self, dictionary: &Dictionary) -> u64 {
        u64::from(self.communication(dictionary, 5)) * 1_000_000
    }

    /// The addresses mapped, in their order.
    pub fn mapped(self, dictionary: &Dictionary) -> impl Iterator<Item = Address> + '_ {
        let index = self.direction.mapping + self.number;
        let count = dictionary.number(at(index, 0)).clamp(0, MAPPED.into()) as u8;
        (1..=count).map(move |subindex| address_of(dictionary.number(at(index, subindex)) as u32))
    }
}

/// A PDO that is enabled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnabledPdo {
    /// Whether the node sends it, else it receives it.
    pub is_sent: bool,
    /// The transmission type.
    pub kind: u8,
    /// Of one that is sent: the event timer, ms; 0: none.
    pub event_timer_ms: u16,
    /// The bytes of the mapped entries.
    pub bytes: usize,
}

/// The PDOs that are enabled in a dictionary: those that the node receives, then those that it sends.
pub fn enabled_pdos(dictionary: &Dictionary) -> impl Iterator<Item = EnabledPdo> + '_ {
    let all =
        [RECEIVE, TRANSMIT].into_iter().flat_map(|direction| (0..PDOS).map(move |number| Pdo { direction, number }));
    all.filter(|pdo| pdo.id(dictionary).is_some()).map(|pdo| EnabledPdo {
        is_sent: pdo.direction == TRANSMIT,
        kind: pdo.kind(dictionary),
        event_timer_ms: if pdo.direction == TRANSMIT { pdo.communication(dictionary, 5) as u16 } else { 0 },
        bytes: pdo.mapped(dictionary).filter_map(|at| dictionary.entry(at).ok()).map(|entry| entry.value.len()).sum(),
    })
}

fn address_of(word: u32) -> Address {
    at((word >> 16) as u16, (word >> 8) as u8)
}

/// Whether the master may write `value` to a PDO parameter; other addresses pass.
pub(super) fn check(dictionary: &Dictionary, address: Address, value: Value) -> Result<(), Abort> {
    let Some(number) = value.number() else { return Ok(()) };
    for direction in [RECEIVE, TRANSMIT] {
        let is_in = |base: u16| (base..base + PDOS).contains(&address.index);
        if is_in(direction.communication) {
            let pdo = Pdo { direction, number: address.index - direction.communication };
            return check_communication(dictionary, pdo, address.subindex, number);
        }
        if is_in(direction.mapping) {
            let pdo = Pdo { direction, number: address.index - direction.mapping };
            return check_mapping(dictionary, pdo, address.subindex, number);
        }
    }
    Ok(())
}

fn check_communication(dictionary: &Dictionary, pdo: Pdo, subindex: u8, number: i64) -> Result<(), Abort> {
    match subindex {
        1 => check_id(pdo.id(dictionary), number as u32),
        2 if matches!(number, 0..=240 | 254 | 255) || (number == 253 && pdo.direction == TRANSMIT) => Ok(()),
        2 => Err(Abort::Value),
        3 if pdo.id(dictionary).is_some() => Err(Abort::DeviceState),
        _ => Ok(()),
    }
}

/// An identifier may not change while its PDO is enabled, and must not be one of those that CiA 301 restricts (table
/// 38).
fn check_id(before: Option<u16>, word: u32) -> Result<(), Abort> {
    if word & !(DISABLED | NO_REMOTE | 0x7FF) != 0 {
        return Err(Abort::Value);
    }
    let id = (word & 0x7FF) as u16;
    let is_restricted = matches!(id, 0..=0x0FF | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x7FF);
    let is_enabled = word & DISABLED == 0;
    if is_enabled && (is_restricted || before.is_some_and(|before| before != id)) {
        return Err(Abort::Value);
    }
    Ok(())
}

fn check_mapping(dictionary: &Dictionary, pdo: Pdo, subindex: u8, number: i64) -> Result<(), Abort> {
    let index = pdo.direction.mapping + pdo.number;
    if pdo.id(dictionary).is_some() {
        return Err(Abort::DeviceState);
    }
    if subindex > 0 {
        let is_counted = dictionary.number(at(index, 0)) > 0;
        return match number {
            _ if is_counted => Err(Abort::DeviceState),
            0 => Ok(()),
            word => mapped_bytes(dictionary, pdo.direction, word as u32).map(drop),
        };
    }
    let count = u8::try_from(number).ok().filter(|count| *count <= MAPPED).ok_or(Abort::MappingLength)?;
    let words = (1..=count).map(|subindex| dictionary.number(at(index, subindex)) as u32);
    let sum = words.map(|word| mapped_bytes(dictionary, pdo.direction, word)).sum::<Result<usize, Abort>>()?;
    if sum > 8 { Err(Abort::MappingLength) } else { Ok(()) }
}

/// The bytes of an entry that may be mapped.
fn mapped_bytes(dictionary: &Dictionary, direction: Direction, word: u32) -> Result<usize, Abort> {
    let entry = dictionary.entry(address_of(word))?;
    let bytes = entry.value.len();
    let fits = entry.mappable == direction.mappable && 8 * bytes == (word & 0xFF) as usize;
    if fits { Ok(bytes) } else { Err(Abort::NotMappable) }
}
