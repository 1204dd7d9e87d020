//! The object dictionary (CiA 301, section 7.4): typed entries by index and subindex.

use alloc::vec::Vec;

use super::Abort;

/// The most bytes of a string.
pub const TEXT_MAX_BYTES: usize = 32;

/// Index and subindex of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// The index of the object.
    pub index: u16,
    /// The entry in it; 0 of a variable.
    pub subindex: u8,
}

/// The address of a variable, or of the first entry of an object.
pub const fn at(index: u16, subindex: u8) -> Address {
    Address { index, subindex }
}

/// A string of at most [`TEXT_MAX_BYTES`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text {
    bytes: [u8; TEXT_MAX_BYTES],
    len: u8,
}

impl Text {
    /// The text; `None` if it is longer than [`TEXT_MAX_BYTES`].
    pub fn new(bytes: &[u8]) -> Option<Text> {
        let mut text = Text { bytes: [0; TEXT_MAX_BYTES], len: u8::try_from(bytes.len()).ok()? };
        text.bytes.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(text)
    }

    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.len.into()).unwrap_or(&[])
    }
}

/// A value with its type (CiA 301, section 7.4.7): little-endian on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// UNSIGNED8.
    U8(u8),
    /// UNSIGNED16.
    U16(u16),
    /// UNSIGNED32.
    U32(u32),
    /// INTEGER8.
    I8(i8),
    /// INTEGER16.
    I16(i16),
    /// INTEGER32.
    I32(i32),
    /// VISIBLE_STRING.
    Text(Text),
}

impl Value {
    /// The number of its type in an EDS (CiA 301, table 44).
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

    /// Its bytes on the wire.
    pub fn len(&self) -> usize {
        match self {
            Value::U8(_) | Value::I8(_) => 1,
            Value::U16(_) | Value::I16(_) => 2,
            Value::U32(_) | Value::I32(_) => 4,
            Value::Text(text) => text.bytes().len(),
        }
    }

    /// Whether it is a string without characters.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value as a number; `None` of a string.
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

    /// Writes it; returns how many bytes, at most [`TEXT_MAX_BYTES`].
    pub fn encode(&self, bytes: &mut [u8; TEXT_MAX_BYTES]) -> usize {
        let len = self.len();
        match self {
            Value::Text(text) => *bytes = text.bytes,
            // The low bytes of the two's complement are those of the shorter type.
            number => bytes[..8].copy_from_slice(&number.number().unwrap_or(0).to_le_bytes()),
        }
        len
    }

    /// A value of the same type from exactly its bytes.
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

    /// The value of the same type nearest to a number, rounded, and whether it is another by more than rounding. What
    /// is no number is 0 and counts as limited, and so does anything for a string.
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

/// Who may do what with an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It never changes.
    Const,
    /// The node changes it.
    ReadOnly,
    /// The master writes it.
    ReadWrite,
    /// The master writes it, and can't read it.
    WriteOnly,
}

impl Access {
    /// Whether the master may write it.
    pub const fn is_writable(self) -> bool {
        matches!(self, Access::ReadWrite | Access::WriteOnly)
    }

    /// Whether the master may read it.
    pub const fn is_readable(self) -> bool {
        !matches!(self, Access::WriteOnly)
    }
}

/// Into which PDOs an entry may be mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mappable {
    /// None.
    No,
    /// Those that the node receives.
    Receive,
    /// Those that the node sends.
    Transmit,
}

/// A value of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Its subindex.
    pub subindex: u8,
    /// Its name.
    pub name: &'static str,
    /// Who may do what with it.
    pub access: Access,
    /// Into which PDOs it may be mapped.
    pub mappable: Mappable,
    /// The value.
    pub value: Value,
    /// The value after a reset.
    pub initial: Value,
    /// The least and the largest number that may be written.
    pub limits: Option<(i64, i64)>,
    /// Whether the initial value is a constant plus the node id: an EDS says so.
    pub is_by_node: bool,
    /// Whether the value is not the one that was to be set, as that is beyond its type.
    pub is_limited: bool,
}

impl Entry {
    /// An entry that can be mapped nowhere, without limits.
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

    /// The same entry, mappable.
    #[must_use]
    pub const fn mappable(self, mappable: Mappable) -> Entry {
        Entry { mappable, ..self }
    }

    /// The same entry with limits of what may be written.
    #[must_use]
    pub const fn within(self, least: i64, most: i64) -> Entry {
        Entry { limits: Some((least, most)), ..self }
    }

    /// The same entry, with an initial value that depends on the node id.
    #[must_use]
    pub const fn by_node(self) -> Entry {
        Entry { is_by_node: true, ..self }
    }
}

/// What an object is (CiA 301, table 42).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One value.
    Variable,
    /// Values of one type, with their number at subindex 0.
    Array,
    /// Values, with the largest subindex at subindex 0.
    Record,
}

impl Kind {
    /// Its number in an EDS.
    pub const fn number(self) -> u8 {
        match self {
            Kind::Variable => 7,
            Kind::Array => 8,
            Kind::Record => 9,
        }
    }
}

/// An object.
#[derive(Clone, Debug)]
pub struct Object {
    /// Its index.
    pub index: u16,
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub kind: Kind,
    /// Its entries, in the order of their subindices.
    pub entries: Vec<Entry>,
}

/// An object dictionary.
#[derive(Clone, Debug, Default)]
pub struct Dictionary {
    objects: Vec<Object>,
}

impl Dictionary {
    /// A dictionary without objects.
    pub fn new() -> Dictionary {
        Dictionary::default()
    }

    /// Adds an object in place of the one of its index, if there is one.
    pub fn add(&mut self, object: Object) {
        match self.objects.binary_search_by_key(&object.index, |other| other.index) {
            Ok(place) => self.objects[place] = object,
            Err(place) => self.objects.insert(place, object),
        }
    }

    /// Adds a variable.
    pub fn variable(&mut self, index: u16, entry: Entry) {
        self.add(Object { index, name: entry.name, kind: Kind::Variable, entries: alloc::vec![entry] });
    }

    /// The objects, in the order of their indices.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// The entry at an address.
    ///
    /// # Errors
    /// [`Abort::NoObject`] or [`Abort::NoSubindex`].
    pub fn entry(&self, address: Address) -> Result<&Entry, Abort> {
        let object = self.object(address.index).ok_or(Abort::NoObject)?;
        object.entries.iter().find(|entry| entry.subindex == address.subindex).ok_or(Abort::NoSubindex)
    }

    /// The object of an index.
    pub fn object(&self, index: u16) -> Option<&Object> {
        let place = self.objects.binary_search_by_key(&index, |object| object.index).ok()?;
        self.objects.get(place)
    }

    fn entry_mut(&mut self, address: Address) -> Option<&mut Entry> {
        let place = self.objects.binary_search_by_key(&address.index, |object| object.index).ok()?;
        self.objects.get_mut(place)?.entries.iter_mut().find(|entry| entry.subindex == address.subindex)
    }

    /// The number at an address; 0 if there is none.
    pub fn number(&self, address: Address) -> i64 {
        self.entry(address).ok().and_then(|entry| entry.value.number()).unwrap_or(0)
    }

    /// Sets a value of the node's own, the nearest that its type can represent; an address without an entry changes
    /// nothing.
    pub fn set(&mut self, address: Address, number: f64) {
        if let Some(entry) = self.entry_mut(address) {
            (entry.value, entry.is_limited) = entry.value.nearest(number);
        }
    }

    /// The value that a master would write with these bytes.
    ///
    /// # Errors
    /// [`Abort`] says why it may not.
    pub fn judge(&self, address: Address, bytes: &[u8]) -> Result<Value, Abort> {
        let entry = self.entry(address)?;
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

    /// Stores a value of the entry's type.
    pub(super) fn store(&mut self, address: Address, value: Value) {
        if let Some(entry) = self.entry_mut(address) {
            (entry.value, entry.is_limited) = (value, false);
        }
    }

    /// Gives the objects of these indices their initial values.
    pub(super) fn reset(&mut self, indices: core::ops::RangeInclusive<u16>) {
        let meant = self.objects.iter_mut().filter(|object| indices.contains(&object.index));
        for entry in meant.flat_map(|object| object.entries.iter_mut()) {
            (entry.value, entry.is_limited) = (entry.initial, false);
        }
    }
}
