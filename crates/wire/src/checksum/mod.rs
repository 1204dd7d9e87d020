//! Checksums of frames in one parametric form: a CRC or a sum over the payload and the parts before and after
//! it.
//!
//! The input bytes are, in order, the parts `before`; the bytes of the payload without those left out, from the
//! first to the last or reversed; the parts `after`. The checksum's own bits are never part of the input: see
//! [`Own`]. [`preset`] has the profiles of AUTOSAR and other common ones in this form.

mod algorithm;
pub mod preset;

use alloc::vec::Vec;

use thiserror::Error;

use crate::PAYLOAD_MAX_BYTES;
use crate::layout::{Bits, ByteOrder, InsertError, Layout, Number};
use resonarm_protocol::Id;

pub use algorithm::{Algorithm, Crc, Sum};
pub use preset::{DataId, Preset, PresetError, UnknownPreset};

/// Reason why a checksum is not possible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ChecksumError {
    /// The width is not 1 to 64 bits.
    #[error("the checksum has {got} bits: it must have 1 to 64")]
    Width {
        /// Width that was given, bits.
        got: u8,
    },
    /// A parameter has more bits than the checksum.
    #[error("{name} {got:#x} does not fit the {width} bits of the checksum")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Value of the parameter.
        got: u64,
        /// Width of the checksum, bits.
        width: u8,
    },
    /// The signal has another width than the checksum.
    #[error("its signal has {got} bits, but the checksum needs {expected}")]
    PlaceBits {
        /// Width of the signal, bits.
        got: u8,
        /// Width of the checksum, bits.
        expected: u8,
    },
    /// The signal is a floating-point number.
    #[error("its signal is a floating-point number: it must be an integer")]
    Float,
    /// The payload can't have the byte that is left out.
    #[error("byte {got} is to be left out, but a payload has at most {PAYLOAD_MAX_BYTES} bytes, counted from 0")]
    LeftOut {
        /// Index of the byte, from 0.
        got: usize,
    },
    /// A table is empty.
    #[error("its table is empty: it must have at least one value")]
    EmptyTable,
    /// An identifier or length enters with too few or too many bytes.
    #[error("{what} has {got} bytes: it must have 1 to {most}")]
    PartBytes {
        /// Part that is meant, in words.
        what: &'static str,
        /// Number of bytes that was given.
        got: u8,
        /// Largest number of bytes.
        most: u8,
    },
}

/// Reason why the checksum of a frame is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ChecksumFault {
    /// The payload ends before the checksum, or before a signal that it depends on.
    #[error("the payload has {got} bytes, but its checksum needs {needed}")]
    Short {
        /// Length of the payload, bytes.
        got: usize,
        /// Least length of the payload, bytes.
        needed: usize,
    },
    /// The checksum differs from the computed one.
    #[error("the checksum is {got:#x}, expected {expected:#x}")]
    Wrong {
        /// Checksum in the payload.
        got: u64,
        /// Checksum that was computed.
        expected: u64,
    },
    /// A fixed field that belongs to the protection is wrong.
    #[error("the {field} in the payload is {got:#x}, expected {expected:#x}")]
    Field {
        /// Field that is wrong.
        field: FieldKind,
        /// Value in the payload.
        got: u64,
        /// Value that it must have.
        expected: u64,
    },
}

/// Bytes that enter the checksum before or after the payload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// The low bytes of the frame's identifier, 1 to 4 of them.
    Id {
        /// Number of bytes, 1 to 4.
        bytes: u8,
        /// Order of the bytes.
        order: ByteOrder,
    },
    /// The low bytes of the length of the payload, in bytes; 1 to 8 of them.
    Length {
        /// Number of bytes, 1 to 8.
        bytes: u8,
        /// Order of the bytes.
        order: ByteOrder,
    },
    /// Constant bytes, the same in every frame.
    Bytes(Vec<u8>),
    /// One byte of a table, selected by the counter modulo the length of the table.
    ByCounter {
        /// Layout of the counter in the payload.
        counter: Layout,
        /// Bytes of the table, at least one.
        table: Vec<u8>,
    },
}

/// Treatment of the bytes that belong only to the checksum. In a byte that the checksum shares, its own bits are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Own {
    /// They are left out.
    #[default]
    LeftOut,
    /// They enter as zeros.
    Zero,
}

/// A number of the protection that has a fixed place in the payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    /// Length of the payload, bytes.
    Length,
    /// Data id, or a part of it.
    DataId,
}

impl core::fmt::Display for FieldKind {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            FieldKind::Length => "length",
            FieldKind::DataId => "data id",
        })
    }
}

/// A fixed field, written before the checksum is computed, and checked with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Meaning of the field.
    pub kind: FieldKind,
    /// Place of the field in the payload.
    pub layout: Layout,
    /// Data id, or the part of it; not used for the length.
    value: u64,
}

/// The checksum of a message. All values of this type are valid, since the constructors check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checksum {
    algorithm: Algorithm,
    place: Layout,
    own: Own,
    left_out: u64,
    reversed: bool,
    before: Vec<Part>,
    after: Vec<Part>,
    fields: Vec<Field>,
    /// Bits of the checksum itself in the payload.
    own_bits: Bits,
}

impl Checksum {
    /// Returns a checksum at `place` over all other bytes of the payload in order. Its bits count as an
    /// unsigned integer, even if the layout is signed.
    ///
    /// # Errors
    /// [`ChecksumError`] if the place is no integer of the width of the algorithm.
    pub fn new(algorithm: Algorithm, place: Layout) -> Result<Checksum, ChecksumError> {
        if place.number() == Number::Float {
            return Err(ChecksumError::Float);
        }
        if place.bits() != algorithm.width() {
            return Err(ChecksumError::PlaceBits { got: place.bits(), expected: algorithm.width() });
        }
        let own_bits = place.occupied();
        let own = Own::LeftOut;
        let left_out = 0;
        let reversed = false;
        let before = Vec::new();
        let after = Vec::new();
        let fields = Vec::new();
        Ok(Checksum { algorithm, place, own, left_out, reversed, before, after, fields, own_bits })
    }

    /// Returns the same checksum with its own bytes entering in this way.
    #[must_use]
    pub fn with_own(self, own: Own) -> Checksum {
        Checksum { own, ..self }
    }

    /// Returns the same checksum over the bytes of the payload from the last to the first.
    #[must_use]
    pub fn reversed(self) -> Checksum {
        Checksum { reversed: true, ..self }
    }

    /// Returns the same checksum without these bytes of the payload, counted from 0.
    ///
    /// # Errors
    /// [`ChecksumError::LeftOut`] if no payload has a byte.
    pub fn without(self, bytes: &[usize]) -> Result<Checksum, ChecksumError> {
        let mut left_out = self.left_out;
        for byte in bytes {
            if *byte >= PAYLOAD_MAX_BYTES {
                return Err(ChecksumError::LeftOut { got: *byte });
            }
            // 64 bytes at most, so one bit of a u64 for each.
            left_out |= 1 << byte;
        }
        Ok(Checksum { left_out, ..self })
    }

    /// Returns the same checksum with these parts, in order, before and after the bytes of the payload.
    ///
    /// # Errors
    /// [`ChecksumError`] if a table is empty, its counter no integer, or an identifier or a length has no or too many
    /// bytes.
    pub fn with_parts(self, before: Vec<Part>, after: Vec<Part>) -> Result<Checksum, ChecksumError> {
        for part in before.iter().chain(&after) {
            match part {
                Part::Id { bytes: 1..=4, .. } | Part::Length { bytes: 1..=8, .. } | Part::Bytes(_) => {}
                Part::Id { bytes, .. } => {
                    return Err(ChecksumError::PartBytes { what: "an identifier", got: *bytes, most: 4 });
                }
                Part::Length { bytes, .. } => {
                    return Err(ChecksumError::PartBytes { what: "a length", got: *bytes, most: 8 });
                }
                Part::ByCounter { table, .. } if table.is_empty() => return Err(ChecksumError::EmptyTable),
                Part::ByCounter { counter, .. } if counter.number() == Number::Float => {
                    return Err(ChecksumError::Float);
                }
                Part::ByCounter { .. } => {}
            }
        }
        Ok(Checksum { before, after, ..self })
    }

    fn with_fields(self, fields: Vec<Field>) -> Checksum {
        Checksum { fields, ..self }
    }

    /// Returns the place of the checksum in the payload.
    pub const fn place(&self) -> &Layout {
        &self.place
    }

    /// Returns the least length of a payload, bytes, that holds the checksum, its fields and the counters of
    /// its tables.
    pub fn needed_bytes(&self) -> usize {
        let counters = self.before.iter().chain(&self.after).map(|part| match part {
            Part::ByCounter { counter, .. } => counter.needed_bytes(),
            _ => 0,
        });
        let fields = self.fields.iter().map(|field| field.layout.needed_bytes());
        counters.chain(fields).fold(self.place.needed_bytes(), usize::max)
    }

    /// Computes the checksum of a frame with this identifier and payload, whatever its own bits and fields
    /// contain; `None` if the payload ends before something that it depends on.
    pub fn compute(&self, id: Id, payload: &[u8]) -> Option<u64> {
        if payload.len() < self.needed_bytes() {
            return None;
        }
        let mut state = self.parts(&self.before, self.algorithm.begin(), id, payload)?;
        for position in 0..payload.len() {
            let byte = if self.reversed { payload.len() - 1 - position } else { position };
            let own = self.own_bits.in_byte(byte);
            let is_out = byte < PAYLOAD_MAX_BYTES && self.left_out >> byte & 1 == 1;
            if !(is_out || own == u8::MAX && self.own == Own::LeftOut) {
                // The checksum's own bits are masked, so that the result does not depend on what the payload
                // holds there.
                state = self.algorithm.step(state, payload[byte] & !own);
            }
        }
        Some(self.algorithm.end(self.parts(&self.after, state, id, payload)?))
    }

    fn parts(&self, parts: &[Part], begin: u64, id: Id, payload: &[u8]) -> Option<u64> {
        let mut state = begin;
        for part in parts {
            state = match part {
                Part::Id { bytes, order } => self.number(state, u64::from(id.raw()), *bytes, *order),
                Part::Length { bytes, order } => self.number(state, payload.len() as u64, *bytes, *order),
                Part::Bytes(bytes) => bytes.iter().fold(state, |state, byte| self.algorithm.step(state, *byte)),
                Part::ByCounter { counter, table } => {
                    let entry = counter.extract_u64(payload)? % table.len() as u64;
                    self.algorithm.step(state, table[entry as usize])
                }
            };
        }
        Some(state)
    }

    fn number(&self, state: u64, number: u64, bytes: u8, order: ByteOrder) -> u64 {
        (0..bytes).fold(state, |state, position| {
            let byte = if order == ByteOrder::Intel { position } else { bytes - 1 - position };
            self.algorithm.step(state, (number >> (8 * byte)) as u8)
        })
    }

    /// Writes the fields, then the checksum. All other content, including the counter, must already be in the
    /// payload.
    ///
    /// # Errors
    /// [`InsertError`] if the payload is too short, or too long for its length field; it may then have some of the
    /// fields.
    pub fn write(&self, id: Id, payload: &mut [u8]) -> Result<(), InsertError> {
        let short = InsertError::Short { got: payload.len(), needed: self.needed_bytes() };
        for field in &self.fields {
            let value = field.right(payload);
            field.layout.insert_u64(value, payload)?;
        }
        let checksum = self.compute(id, payload).ok_or(short)?;
        self.place.insert_u64(checksum, payload)
    }

    /// Checks the checksum of a frame, then the fields.
    ///
    /// # Errors
    /// [`ChecksumFault`]: the frame must not be used.
    pub fn check(&self, id: Id, payload: &[u8]) -> Result<(), ChecksumFault> {
        let short = ChecksumFault::Short { got: payload.len(), needed: self.needed_bytes() };
        let (Some(got), Some(expected)) = (self.place.extract_u64(payload), self.compute(id, payload)) else {
            return Err(short);
        };
        // The checksum comes first: if it is wrong, any bit may be, and a wrong field would only be a symptom.
        if got != expected {
            return Err(ChecksumFault::Wrong { got, expected });
        }
        for field in &self.fields {
            let expected = field.right(payload);
            let got = field.layout.extract_u64(payload).ok_or(short)?;
            if got != expected {
                return Err(ChecksumFault::Field { field: field.kind, got, expected });
            }
        }
        Ok(())
    }
}

impl Field {
    /// Returns the value that the field must have in this payload.
    const fn right(&self, payload: &[u8]) -> u64 {
        match self.kind {
            FieldKind::Length => payload.len() as u64,
            FieldKind::DataId => self.value,
        }
    }
}

#[cfg(test)]
mod tests;
