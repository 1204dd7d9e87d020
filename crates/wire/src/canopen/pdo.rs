//! PDO parameters (CiA 301, sections 7.5.2.35 to 7.5.2.38): checks of what the master writes, and the content
//! of a PDO.

use alloc::vec::Vec;

use super::abort::Abort;
use super::dictionary::{Access, Address, Dictionary, Entry, Kind, Mappable, Object, Value, at};

/// Number of PDOs in each direction.
pub const PDOS: u16 = 4;
/// Transmission type of PDOs that act, or are sent, without SYNC.
pub const EVENT_TYPE: u8 = 255;
/// Largest number of entries in a PDO: 8 bytes, and each entry has at least one.
const MAPPED: u8 = 8;
/// Bit of a COB-ID that disables the PDO.
const DISABLED: u32 = 1 << 31;
/// Bit of a COB-ID that forbids remote frames.
const NO_REMOTE: u32 = 1 << 30;

/// Communication and mapping parameters of one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Direction {
    pub communication: u16,
    pub mapping: u16,
    /// Identifier of the first PDO, without the node id.
    base: u16,
    mappable: Mappable,
}

pub(super) const RECEIVE: Direction =
    Direction { communication: 0x1400, mapping: 0x1600, base: 0x200, mappable: Mappable::Receive };
pub(super) const TRANSMIT: Direction =
    Direction { communication: 0x1800, mapping: 0x1A00, base: 0x180, mappable: Mappable::Transmit };

/// Parameters of a PDO after a reset; a PDO without mapped entries is disabled.
#[derive(Clone, Copy, Debug, Default)]
pub struct PdoDefaults<'a> {
    /// Mapped entries, in the form of [`mapping_word`].
    pub mapped: &'a [u32],
    /// Transmission type of the PDO.
    pub kind: u8,
    /// Event timer of a sent PDO, ms; 0 for none.
    pub event_timer_ms: u16,
}

/// Returns the mapping parameter for an entry of `bits` bits.
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

/// Adds the parameters of all PDOs of a node: received ones first, then sent ones.
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
    // The predefined connection set of CiA 301: the PDOs of one direction are 100h apart.
    let id = u32::from(direction.base + 0x100 * number + u16::from(node_id)) | disabled;
    let mut entries = Vec::new();
    entries.push(Entry::new(0, "Largest subindex", Access::Const, Value::U8(if is_sent { 5 } else { 2 })));
    entries.push(Entry::new(1, "COB-ID", Access::ReadWrite, Value::U32(id)).by_node());
    entries.push(Entry::new(2, "Transmission type", Access::ReadWrite, Value::U8(defaults.kind)));
    if is_sent {
        // Subindex 4 is reserved in CiA 301, so 5 follows 3.
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

/// One PDO of a dictionary, whose parameters it reads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pdo {
    pub direction: Direction,
    /// Number of the PDO, from 0.
    pub number: u16,
}

impl Pdo {
    fn communication(self, dictionary: &Dictionary, subindex: u8) -> u32 {
        dictionary.number(at(self.direction.communication + self.number, subindex)) as u32
    }

    /// Returns the identifier; `None` if the PDO is disabled.
    pub fn id(self, dictionary: &Dictionary) -> Option<u16> {
        let word = self.communication(dictionary, 1);
        (word & DISABLED == 0).then_some((word & 0x7FF) as u16)
    }

    pub fn allows_remote(self, dictionary: &Dictionary) -> bool {
        self.communication(dictionary, 1) & NO_REMOTE == 0
    }

    /// Returns the transmission type.
    pub fn kind(self, dictionary: &Dictionary) -> u8 {
        self.communication(dictionary, 2) as u8
    }

    pub fn inhibit_ns(self, dictionary: &Dictionary) -> u64 {
        // The inhibit time counts in steps of 100 µs (CiA 301).
        u64::from(self.communication(dictionary, 3)) * 100_000
    }

    pub fn event_timer_ns(self, dictionary: &Dictionary) -> u64 {
        u64::from(self.communication(dictionary, 5)) * 1_000_000
    }

    /// Returns the mapped addresses in order.
    pub fn mapped(self, dictionary: &Dictionary) -> impl Iterator<Item = Address> + '_ {
        let index = self.direction.mapping + self.number;
        let count = dictionary.number(at(index, 0)).clamp(0, MAPPED.into()) as u8;
        (1..=count).map(move |subindex| address_of(dictionary.number(at(index, subindex)) as u32))
    }
}

/// An enabled PDO, for the calculation of bus load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnabledPdo {
    /// Whether the node sends it; otherwise it receives it.
    pub is_sent: bool,
    /// Transmission type of the PDO.
    pub kind: u8,
    /// Event timer of a sent PDO, ms; 0 for none.
    pub event_timer_ms: u16,
    /// Length of the mapped entries, bytes.
    pub bytes: usize,
}

/// Returns the enabled PDOs of a dictionary: received ones first, then sent ones.
pub fn enabled_pdos(dictionary: &Dictionary) -> impl Iterator<Item = EnabledPdo> + '_ {
    let all =
        [RECEIVE, TRANSMIT].into_iter().flat_map(|direction| (0..PDOS).map(move |number| Pdo { direction, number }));
    all.filter(|pdo| pdo.id(dictionary).is_some()).map(|pdo| EnabledPdo {
        is_sent: pdo.direction == TRANSMIT,
        kind: pdo.kind(dictionary),
        // Subindex 5 of a received PDO would be a deadline for its master, which these nodes don't have.
        event_timer_ms: if pdo.direction == TRANSMIT { pdo.communication(dictionary, 5) as u16 } else { 0 },
        bytes: pdo.mapped(dictionary).filter_map(|at| dictionary.entry(at).ok()).map(|entry| entry.value.len()).sum(),
    })
}

fn address_of(word: u32) -> Address {
    at((word >> 16) as u16, (word >> 8) as u8)
}

/// Checks a master's write to a PDO parameter; other addresses pass.
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
        // Type 252 would need samples kept from SYNC to request, which these nodes don't do. 253, on request,
        // exists only for sent PDOs.
        2 if matches!(number, 0..=240 | 254 | 255) || (number == 253 && pdo.direction == TRANSMIT) => Ok(()),
        2 => Err(Abort::Value),
        // CiA 301 allows a new inhibit time only while the PDO is disabled.
        3 if pdo.id(dictionary).is_some() => Err(Abort::DeviceState),
        _ => Ok(()),
    }
}

/// Checks an identifier: it must not change while its PDO is enabled, and must not be one of the restricted
/// ones (CiA 301, table 38).
fn check_id(before: Option<u16>, word: u32) -> Result<(), Abort> {
    if word & !(DISABLED | NO_REMOTE | 0x7FF) != 0 {
        return Err(Abort::Value);
    }
    let id = (word & 0x7FF) as u16;
    let is_restricted = matches!(id, 0..=0x0FF | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x7FF);
    let is_enabled = word & DISABLED == 0;
    // A PDO that is disabled may keep any identifier, since none of its frames is sent or taken.
    if is_enabled && (is_restricted || before.is_some_and(|before| before != id)) {
        return Err(Abort::Value);
    }
    Ok(())
}

fn check_mapping(dictionary: &Dictionary, pdo: Pdo, subindex: u8, number: i64) -> Result<(), Abort> {
    let index = pdo.direction.mapping + pdo.number;
    // CiA 301 prescribes the order in which a mapping is changed: disable the PDO, set the number of entries to
    // 0, write the entries, set the number, enable. A mapping that is half written can so never act.
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

/// Returns the length of an entry that may be mapped, bytes.
fn mapped_bytes(dictionary: &Dictionary, direction: Direction, word: u32) -> Result<usize, Abort> {
    let entry = dictionary.entry(address_of(word))?;
    let bytes = entry.value.len();
    let fits = entry.mappable == direction.mappable && 8 * bytes == (word & 0xFF) as usize;
    if fits { Ok(bytes) } else { Err(Abort::NotMappable) }
}
