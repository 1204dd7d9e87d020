//! The object dictionary (CiA 301, section 7.4): typed entries by index and subindex.

use alloc::vec::Vec;

use super::abort::Abort;

/// Longest string of a dictionary, bytes.
pub const TEXT_MAX_BYTES: usize = 32;

/// Address of an entry: index and subindex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// Index of the object.
    pub index: u16,
    /// Subindex of the entry; 0 for a variable.
    pub subindex: u8,
}

/// Returns the address of an entry; a shorthand for tables.
pub const fn at(index: u16, subindex: u8) -> Address {
    Address { index, subindex }
}

/// A string of at most [`TEXT_MAX_BYTES`], stored inline so that the server never allocates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text {
    bytes: [u8; TEXT_MAX_BYTES],
    len: u8,
}

impl Text {
    /// Returns the text; `None` if it is longer than [`TEXT_MAX_BYTES`].
    pub fn new(bytes: &[u8]) -> Option<Text> {
        let mut text = Text { bytes: [0; TEXT_MAX_BYTES], len: u8::try_from(bytes.len()).ok()? };
        text.bytes.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(text)
    }

    /// Returns the bytes of the text.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.len.into()).unwrap_or(&[])
    }
}

/// A typed value (CiA 301, section 7.4.7), little-endian on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// UNSIGNED8 of CiA 301.
    U8(u8),
    /// UNSIGNED16 of CiA 301.
    U16(u16),
    /// UNSIGNED32 of CiA 301.
    U32(u32),
    /// INTEGER8 of CiA 301.
    I8(i8),
    /// INTEGER16 of CiA 301.
    I16(i16),
    /// INTEGER32 of CiA 301.
    I32(i32),
    /// VISIBLE_STRING of CiA 301, at most [`TEXT_MAX_BYTES`].
    Text(Text),
}

impl Value {
    /// Returns the number of the type in an EDS (CiA 301, table 44).
    pub const fn type_number(&self) -> u16 {
        match self {
            Value::I8(_) => 0x02,
            Value::I16(_) => 0x03,
            Value::I32(_) => 0x04,
            Value::U8(_) => 0x05,
            Value::U16(_) => 0x06,
            Value::U32(_) => 0x07,
            Value::Text(_) => 0x09,
        }
    }

    /// Returns the length on the bus, bytes.
    pub fn len(&self) -> usize {
        match self {
            Value::U8(_) | Value::I8(_) => 1,
            Value::U16(_) | Value::I16(_) => 2,
            Value::U32(_) | Value::I32(_) => 4,
            Value::Text(text) => text.bytes().len(),
        }
    }

    /// Returns whether it is an empty string.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the value as a number; `None` for a string.
    pub const fn number(&self) -> Option<i64> {
        Some(match *self {
            Value::U8(value) => value as i64,
            Value::U16(value) => value as i64,
            Value::U32(value) => value as i64,
            Value::I8(value) => value as i64,
            Value::I16(value) => value as i64,
            Value::I32(value) => value as i64,
            Value::Text(_) => return None,
        })
    }

    /// Writes the bytes of the value and returns their number, at most [`TEXT_MAX_BYTES`].
    pub fn encode(&self, bytes: &mut [u8; TEXT_MAX_BYTES]) -> usize {
        let len = self.len();
        match self {
            Value::Text(text) => *bytes = text.bytes,
            // The low bytes of the two's complement are those of the shorter type.
            number => bytes[..8].copy_from_slice(&number.number().unwrap_or(0).to_le_bytes()),
        }
        len
    }

    /// Decodes a value of the same type, from exactly as many bytes as the type has.
    ///
    /// # Errors
    /// [`Abort::LengthTooLow`] or [`Abort::LengthTooHigh`].
    pub fn decode(&self, bytes: &[u8]) -> Result<Value, Abort> {
        if let Value::Text(_) = self {
            return Text::new(bytes).map(Value::Text).ok_or(Abort::LengthTooHigh);
        }
        match bytes.len() {
            got if got < self.len() => return Err(Abort::LengthTooLow),
            got if got > self.len() => return Err(Abort::LengthTooHigh),
            _ => {}
        }
        // Padding with zeros is enough, as the cast to a signed type takes only its own low bits.
        let mut all = [0; 4];
        all[..bytes.len()].copy_from_slice(bytes);
        let word = u32::from_le_bytes(all);
        Ok(match self {
            Value::U8(_) | Value::Text(_) => Value::U8(word as u8),
            Value::U16(_) => Value::U16(word as u16),
            Value::U32(_) => Value::U32(word),
            Value::I8(_) => Value::I8(word as i8),
            Value::I16(_) => Value::I16(word as i16),
            Value::I32(_) => Value::I32(word as i32),
        })
    }

    /// Returns the value of the same type closest to a number, rounded, and whether the number was limited to
    /// the type's range. NaN becomes 0 and counts as limited; a string stays as it is and counts as limited.
    pub fn nearest(&self, number: f64) -> (Value, bool) {
        let (least, most) = match self {
            Value::U8(_) => (0.0, f64::from(u8::MAX)),
            Value::U16(_) => (0.0, f64::from(u16::MAX)),
            Value::U32(_) => (0.0, f64::from(u32::MAX)),
            Value::I8(_) => (f64::from(i8::MIN), f64::from(i8::MAX)),
            Value::I16(_) => (f64::from(i16::MIN), f64::from(i16::MAX)),
            Value::I32(_) => (f64::from(i32::MIN), f64::from(i32::MAX)),
            Value::Text(_) => return (*self, true),
        };
        let rounded = libm::round(number);
        // Negated, so that NaN, which is in no order with the limits, counts as limited.
        let is_limited = !(rounded >= least && rounded <= most);
        let near = rounded.clamp(least, most);
        let value = match self {
            Value::U8(_) => Value::U8(near as u8),
            Value::U16(_) => Value::U16(near as u16),
            Value::U32(_) => Value::U32(near as u32),
            Value::I8(_) => Value::I8(near as i8),
            Value::I16(_) => Value::I16(near as i16),
            Value::I32(_) | Value::Text(_) => Value::I32(near as i32),
        };
        (value, is_limited)
    }
}

/// Access rights of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Constant for the life of the node.
    Const,
    /// The node changes it, and the master reads it.
    ReadOnly,
    /// The master reads and writes it.
    ReadWrite,
    /// The master writes it, but can't read it.
    WriteOnly,
}

impl Access {
    /// Returns whether the master may write the entry.
    pub const fn is_writable(self) -> bool {
        matches!(self, Access::ReadWrite | Access::WriteOnly)
    }

    /// Returns whether the master may read the entry.
    pub const fn is_readable(self) -> bool {
        !matches!(self, Access::WriteOnly)
    }
}

/// PDOs that an entry may be mapped to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mappable {
    /// No PDO at all.
    No,
    /// PDOs that the node receives.
    Receive,
    /// PDOs that the node sends.
    Transmit,
}

/// An entry of an object: name, rights, value, limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Subindex within the object.
    pub subindex: u8,
    /// Name of the entry in an EDS.
    pub name: &'static str,
    /// Access rights of the master.
    pub access: Access,
    /// PDOs that it may be mapped to.
    pub mappable: Mappable,
    /// Present value of the entry.
    pub value: Value,
    /// Value of the entry after a reset.
    pub initial: Value,
    /// Least and largest number that the master may write; `None` without limits.
    pub limits: Option<(i64, i64)>,
    /// Whether the initial value is a constant plus the node id, which an EDS states as `$NODEID+…`.
    pub is_by_node: bool,
    /// Whether the value was limited to the range of its type.
    pub is_limited: bool,
}

impl Entry {
    /// Returns an entry that can't be mapped and has no limits.
    pub const fn new(subindex: u8, name: &'static str, access: Access, value: Value) -> Entry {
        Entry {
            subindex,
            name,
            access,
            mappable: Mappable::No,
            value,
            initial: value,
            limits: None,
            is_by_node: false,
            is_limited: false,
        }
    }

    /// Returns the same entry, mappable to these PDOs.
    #[must_use]
    pub const fn mappable(self, mappable: Mappable) -> Entry {
        Entry { mappable, ..self }
    }

    /// Returns the same entry, with limits for what the master may write.
    #[must_use]
    pub const fn within(self, least: i64, most: i64) -> Entry {
        Entry { limits: Some((least, most)), ..self }
    }

    /// Returns the same entry, marked as having an initial value that depends on the node id.
    #[must_use]
    pub const fn by_node(self) -> Entry {
        Entry { is_by_node: true, ..self }
    }
}

/// Kind of object (CiA 301, table 42).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A single value, at subindex 0.
    Variable,
    /// Values of one type, with their number at subindex 0.
    Array,
    /// Values of several types, with the largest subindex at subindex 0.
    Record,
}

impl Kind {
    /// Returns the object code in an EDS.
    pub const fn number(self) -> u8 {
        match self {
            Kind::Variable => 7,
            Kind::Array => 8,
            Kind::Record => 9,
        }
    }
}

/// An object of the dictionary, with its entries.
#[derive(Clone, Debug)]
pub struct Object {
    /// Index of the object.
    pub index: u16,
    /// Name of the object in an EDS.
    pub name: &'static str,
    /// Kind of the object.
    pub kind: Kind,
    /// Entries in the order of their subindices.
    pub entries: Vec<Entry>,
}

/// An object dictionary, sorted by index.
#[derive(Clone, Debug, Default)]
pub struct Dictionary {
    objects: Vec<Object>,
}

impl Dictionary {
    /// Returns a dictionary without objects.
    pub fn new() -> Dictionary {
        Dictionary::default()
    }

    /// Adds an object to the dictionary. It replaces the object of the same index, if there is one.
    pub fn add(&mut self, object: Object) {
        match self.objects.binary_search_by_key(&object.index, |other| other.index) {
            Ok(place) => self.objects[place] = object,
            Err(place) => self.objects.insert(place, object),
        }
    }

    /// Adds a variable, an object with a single entry.
    pub fn variable(&mut self, index: u16, entry: Entry) {
        self.add(Object { index, name: entry.name, kind: Kind::Variable, entries: alloc::vec![entry] });
    }

    /// Returns the objects in the order of their indices.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// Returns the entry at an address.
    ///
    /// # Errors
    /// [`Abort::NoObject`] or [`Abort::NoSubindex`].
    pub fn entry(&self, address: Address) -> Result<&Entry, Abort> {
        let object = self.object(address.index).ok_or(Abort::NoObject)?;
        object.entries.iter().find(|entry| entry.subindex == address.subindex).ok_or(Abort::NoSubindex)
    }

    /// Returns the object of an index.
    pub fn object(&self, index: u16) -> Option<&Object> {
        let place = self.objects.binary_search_by_key(&index, |object| object.index).ok()?;
        self.objects.get(place)
    }

    fn entry_mut(&mut self, address: Address) -> Option<&mut Entry> {
        let place = self.objects.binary_search_by_key(&address.index, |object| object.index).ok()?;
        self.objects.get_mut(place)?.entries.iter_mut().find(|entry| entry.subindex == address.subindex)
    }

    /// Returns the number at an address; 0 if it has none.
    pub fn number(&self, address: Address) -> i64 {
        self.entry(address).ok().and_then(|entry| entry.value.number()).unwrap_or(0)
    }

    /// Sets a value on behalf of the node, the closest that its type can represent. An address without an entry
    /// changes nothing.
    pub fn set(&mut self, address: Address, number: f64) {
        if let Some(entry) = self.entry_mut(address) {
            (entry.value, entry.is_limited) = entry.value.nearest(number);
        }
    }

    /// Returns the value that a master would write with these bytes, without storing it.
    ///
    /// # Errors
    /// [`Abort`] says why it may not.
    pub fn judge(&self, address: Address, bytes: &[u8]) -> Result<Value, Abort> {
        let entry = self.entry(address)?;
        // Rights are checked before the length: a master that writes to a read-only entry is told so, whatever
        // it writes.
        if !entry.access.is_writable() {
            return Err(Abort::ReadOnly);
        }
        let value = entry.value.decode(bytes)?;
        match (entry.limits, value.number()) {
            (Some((least, _)), Some(number)) if number < least => Err(Abort::ValueTooLow),
            (Some((_, most)), Some(number)) if number > most => Err(Abort::ValueTooHigh),
            _ => Ok(value),
        }
    }

    /// Stores a value, which must be of the entry's type.
    pub(super) fn store(&mut self, address: Address, value: Value) {
        if let Some(entry) = self.entry_mut(address) {
            entry.value = value;
            entry.is_limited = false;
        }
    }

    /// Restores the initial values of the objects in a range of indices.
    pub(super) fn reset(&mut self, indices: core::ops::RangeInclusive<u16>) {
        let meant = self.objects.iter_mut().filter(|object| indices.contains(&object.index));
        for entry in meant.flat_map(|object| object.entries.iter_mut()) {
            entry.value = entry.initial;
            entry.is_limited = false;
        }
    }
}
