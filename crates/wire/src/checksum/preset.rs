//! Named checksums: the profiles of AUTOSAR FO PRS E2EProtocol, and common ones.
//!
//! Where a profile fixes the positions of its numbers, they count from the checksum, so that a header may stand
//! anywhere in the payload (`offset` in the standard). The checksum is at byte c:
//!
//! | preset | checksum | counter, values | others |
//! | --- | --- | --- | --- |
//! | `autosar-p1`, `-p1-alternating`, `-p1-low` | 8 bits | 4 bits anywhere, 15 | |
//! | `autosar-p1-nibble` | 8 bits | 4 bits anywhere, 15 | high half of byte c + 1: bits 8 to 11 of the data id |
//! | `autosar-p2` | 8 bits | low half of byte c + 1, 16 | |
//! | `autosar-p4` | 32 bits | c − 6, 16 bits, 65536 | c − 8: length, 16 bits; c − 4: data id, 32 bits |
//! | `autosar-p5` | 16 bits, Intel | c + 2, 8 bits, 256 | |
//! | `autosar-p6` | 16 bits | c + 4, 8 bits, 256 | c + 2: length, 16 bits |
//! | `autosar-p7` | 64 bits | c + 12, 32 bits, 2³² | c + 8: length, c + 16: data id, 32 bits each |
//! | `autosar-p11` | 8 bits | 4 bits anywhere, 15 | |
//! | `autosar-p11-nibble` | 8 bits | 4 bits anywhere, 15 | as `autosar-p1-nibble` |
//! | `crc8-j1850`, `crc8-2f`, `sum`, `xor` | 8 bits | any | |
//!
//! Profiles 4, 6 and 7 have all their numbers in Motorola byte order, profile 5 in Intel byte order. The length
//! is that of the whole payload. Length and data id are written and checked with the checksum;
//! the counter is not, see [`crate::counter`].

use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::str::FromStr;

use thiserror::Error;

use super::algorithm::{Algorithm, Crc, Sum};
use super::{Checksum, ChecksumError, Field, FieldKind, Part};
use crate::layout::{ByteOrder, Layout, Number};

/// A checksum that is known by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Preset {
    /// AUTOSAR profile 1, variant A: CRC-8 of SAE J1850 over both bytes of the data id, then the payload.
    AutosarP1,
    /// Profile 1, variant B: the low byte of the data id with an even counter, the high one with an odd counter.
    AutosarP1Alternating,
    /// Profile 1 with the low byte of the data id alone.
    AutosarP1Low,
    /// Profile 1, variant C: a data id of 12 bits, the upper four of them in the payload.
    AutosarP1Nibble,
    /// Profile 2: CRC-8 0x2F over the payload, then one of 16 data ids, by the counter.
    AutosarP2,
    /// Profile 4: CRC-32 0xF4ACFB13; length, counter and data id in the payload.
    AutosarP4,
    /// Profile 5: CRC-16 0x1021 over the payload, then the data id.
    AutosarP5,
    /// Profile 6: CRC-16 0x1021 over the payload with its length, then the data id.
    AutosarP6,
    /// Profile 7: CRC-64; length, counter and data id in the payload.
    AutosarP7,
    /// Profile 11, variant A: as profile 1, variant A.
    AutosarP11,
    /// Profile 11, variant C: as profile 1, variant C.
    AutosarP11Nibble,
    /// CRC-8 of SAE J1850 over the payload: polynomial 0x1D, start value and final exclusive or 0xFF.
    Crc8J1850,
    /// CRC-8 with the polynomial 0x2F over the payload, start value and final exclusive or 0xFF (AUTOSAR CRC8H2F).
    Crc82f,
    /// The sum of the bytes, modulo 256.
    Sum,
    /// The exclusive or of the bytes.
    Xor,
}

/// Data id of a message, which distinguishes its checksum from that of every other message.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DataId {
    /// No data id, for presets without one.
    #[default]
    None,
    /// One number for every frame.
    One(u32),
    /// One byte for each value of the counter, for profile 2.
    ByCounter([u8; 16]),
}

/// Error: a name that belongs to no preset.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no checksum {name:?}: expected one of {}", Preset::names())]
pub struct UnknownPreset {
    /// Name that was given.
    pub name: String,
}

/// Reason why a message can't have the checksum of a preset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum PresetError {
    /// The checksum itself is not possible.
    #[error("{preset}: {source}")]
    Checksum {
        /// Preset that was requested.
        preset: Preset,
        /// Reason for the rejection.
        source: ChecksumError,
    },
    /// The checksum does not begin at a byte boundary, or has the wrong byte order.
    #[error("{preset}: its checksum is at {got}: at this byte the profile expects {expected}")]
    Place {
        /// Preset that was requested.
        preset: Preset,
        /// Layout of the checksum signal.
        got: Layout,
        /// Layout that the preset requires.
        expected: Layout,
    },
    /// A number of the profile would lie outside the payload.
    #[error(
        "{preset} has its {what} {at:+} bytes from the checksum, which is outside of the payload of {payload_bytes} bytes"
    )]
    Outside {
        /// Preset that was requested.
        preset: Preset,
        /// Number of the profile, in words.
        what: &'static str,
        /// Distance of its first byte from that of the checksum.
        at: i8,
        /// Length of the payload, bytes.
        payload_bytes: usize,
    },
    /// The profile needs a counter.
    #[error("{preset} needs a counter, but the message has none: give its signal as `counter`")]
    NoCounter {
        /// Preset that was requested.
        preset: Preset,
    },
    /// The counter is not where the profile requires it.
    #[error("{preset}: its counter is at {got}: the profile expects it at {expected}")]
    CounterPlace {
        /// Preset that was requested.
        preset: Preset,
        /// Layout of the counter signal.
        got: Layout,
        /// Layout that the profile requires.
        expected: Layout,
    },
    /// The counter has the wrong width.
    #[error("{preset}: its counter has {got} bits: the profile expects {expected}")]
    CounterBits {
        /// Preset that was requested.
        preset: Preset,
        /// Width of the counter signal, bits.
        got: u8,
        /// Width that the profile requires, bits.
        expected: u8,
    },
    /// The preset needs another kind of data id.
    #[error("{preset} expects {expected}")]
    DataIdKind {
        /// Preset that was requested.
        preset: Preset,
        /// Kind of data id that it needs, in words.
        expected: &'static str,
    },
    /// The data id is too large.
    #[error("{preset}: data id {got:#x} is too large: it must be at most {most:#x}")]
    DataId {
        /// Preset that was requested.
        preset: Preset,
        /// Data id that was given.
        got: u32,
        /// Largest data id of the preset.
        most: u32,
    },
}

impl Preset {
    /// All presets, in the order of the module's table.
    pub const ALL: [Preset; 15] = [
        Preset::AutosarP1,
        Preset::AutosarP1Alternating,
        Preset::AutosarP1Low,
        Preset::AutosarP1Nibble,
        Preset::AutosarP2,
        Preset::AutosarP4,
        Preset::AutosarP5,
        Preset::AutosarP6,
        Preset::AutosarP7,
        Preset::AutosarP11,
        Preset::AutosarP11Nibble,
        Preset::Crc8J1850,
        Preset::Crc82f,
        Preset::Sum,
        Preset::Xor,
    ];

    /// Returns the name of the preset in a scenario.
    pub const fn name(self) -> &'static str {
        match self {
            Preset::AutosarP1 => "autosar-p1",
            Preset::AutosarP1Alternating => "autosar-p1-alternating",
            Preset::AutosarP1Low => "autosar-p1-low",
            Preset::AutosarP1Nibble => "autosar-p1-nibble",
            Preset::AutosarP2 => "autosar-p2",
            Preset::AutosarP4 => "autosar-p4",
            Preset::AutosarP5 => "autosar-p5",
            Preset::AutosarP6 => "autosar-p6",
            Preset::AutosarP7 => "autosar-p7",
            Preset::AutosarP11 => "autosar-p11",
            Preset::AutosarP11Nibble => "autosar-p11-nibble",
            Preset::Crc8J1850 => "crc8-j1850",
            Preset::Crc82f => "crc8-2f",
            Preset::Sum => "sum",
            Preset::Xor => "xor",
        }
    }

    fn names() -> String {
        Preset::ALL.map(Preset::name).join(", ")
    }

    /// Returns the number of values of the profile's counter; `None` if the preset does not define one.
    pub const fn counter_values(self) -> Option<u64> {
        match self {
            Preset::AutosarP1 | Preset::AutosarP1Alternating | Preset::AutosarP1Low | Preset::AutosarP1Nibble => {
                Some(15)
            }
            Preset::AutosarP11 | Preset::AutosarP11Nibble => Some(15),
            Preset::AutosarP2 => Some(16),
            Preset::AutosarP4 => Some(1 << 16),
            Preset::AutosarP5 | Preset::AutosarP6 => Some(1 << 8),
            Preset::AutosarP7 => Some(1 << 32),
            Preset::Crc8J1850 | Preset::Crc82f | Preset::Sum | Preset::Xor => None,
        }
    }

    /// Builds the checksum at `place`, in payloads of `payload_bytes`, with the counter of the message if it
    /// has one.
    ///
    /// # Errors
    /// [`PresetError`] if checksum or counter are not where the profile has them, a number of the profile would lie
    /// outside of the payload, or the data id is not of the preset's kind or too large.
    pub fn checksum(
        self,
        place: Layout,
        counter: Option<Layout>,
        data_id: &DataId,
        payload_bytes: usize,
    ) -> Result<Checksum, PresetError> {
        let builder = Builder { preset: self, place, payload_bytes };
        builder.check_place()?;
        if let Some(counter) = counter {
            builder.check_counter(counter)?;
        }
        let algorithm = self.algorithm().map_err(|source| builder.impossible(source))?;
        let (before, after) = builder.parts(counter, data_id)?;
        let checksum = Checksum::new(algorithm, place).and_then(|checksum| checksum.with_parts(before, after));
        let fields = builder.fields(data_id)?;
        Ok(checksum.map_err(|source| builder.impossible(source))?.with_fields(fields))
    }

    /// Returns the algorithm of the preset.
    ///
    /// Profiles 1 and 11 call the CRC-8 with 0xFF as a *continued* start value, which the CRC library inverts
    /// to 0, and invert the result once more than the library does. What remains is the plain remainder.
    pub(super) fn algorithm(self) -> Result<Algorithm, ChecksumError> {
        let crc = |width, polynomial, start, xor_out, reflect| {
            Crc::new(width, polynomial, start, xor_out, reflect).map(Algorithm::Crc)
        };
        match self {
            Preset::AutosarP1
            | Preset::AutosarP1Alternating
            | Preset::AutosarP1Low
            | Preset::AutosarP1Nibble
            | Preset::AutosarP11
            | Preset::AutosarP11Nibble => crc(8, 0x1D, 0, 0, false),
            Preset::AutosarP2 | Preset::Crc82f => crc(8, 0x2F, 0xFF, 0xFF, false),
            Preset::AutosarP4 => crc(32, 0xF4AC_FB13, 0xFFFF_FFFF, 0xFFFF_FFFF, true),
            Preset::AutosarP5 | Preset::AutosarP6 => crc(16, 0x1021, 0xFFFF, 0, false),
            Preset::AutosarP7 => crc(64, 0x42F0_E1EB_A9EA_3693, u64::MAX, u64::MAX, true),
            Preset::Crc8J1850 => crc(8, 0x1D, 0xFF, 0xFF, false),
            Preset::Sum => Sum::new(8, 0, 0, false).map(Algorithm::Sum),
            Preset::Xor => Ok(Algorithm::Xor { start: 0 }),
        }
    }

    /// Returns where the profile has its counter: distance of its first byte from that of the checksum, width,
    /// byte order.
    const fn counter_place(self) -> Option<(i8, u8, ByteOrder)> {
        match self {
            Preset::AutosarP2 => Some((1, 4, ByteOrder::Intel)),
            Preset::AutosarP4 => Some((-6, 16, ByteOrder::Motorola)),
            Preset::AutosarP5 => Some((2, 8, ByteOrder::Intel)),
            Preset::AutosarP6 => Some((4, 8, ByteOrder::Intel)),
            Preset::AutosarP7 => Some((12, 32, ByteOrder::Motorola)),
            _ => None,
        }
    }

    const fn is_nibble(self) -> bool {
        matches!(self, Preset::AutosarP1Nibble | Preset::AutosarP11Nibble)
    }
}

struct Builder {
    preset: Preset,
    place: Layout,
    payload_bytes: usize,
}

impl Builder {
    const fn impossible(&self, source: ChecksumError) -> PresetError {
        PresetError::Checksum { preset: self.preset, source }
    }

    /// Returns the layout of a field that begins `at` bytes after the checksum, at bit `first` of that byte.
    fn field(
        &self,
        what: &'static str,
        (at, first): (i8, u64),
        bits: u8,
        order: ByteOrder,
    ) -> Result<Layout, PresetError> {
        let start = match order {
            ByteOrder::Intel => first,
            ByteOrder::Motorola => 7 - first,
        };
        let outside = PresetError::Outside { preset: self.preset, what, at, payload_bytes: self.payload_bytes };
        // Profiles 4, 6 and 7 have numbers before the checksum or behind it, so that either end of the payload may be
        // passed.
        let byte = u64::try_from(self.place.first_byte() as i64 + i64::from(at)).map_err(|_| outside)?;
        Layout::new(8 * byte + start, u64::from(bits), order, Number::Unsigned, self.payload_bytes).map_err(|_| outside)
    }

    fn check_place(&self) -> Result<(), PresetError> {
        let preset = self.preset;
        let got = self.place;
        let (bits, order) = match preset {
            Preset::AutosarP4 => (32, ByteOrder::Motorola),
            Preset::AutosarP5 => (16, ByteOrder::Intel),
            Preset::AutosarP6 => (16, ByteOrder::Motorola),
            Preset::AutosarP7 => (64, ByteOrder::Motorola),
            _ => (8, ByteOrder::Intel),
        };
        if got.bits() != bits {
            return Err(self.impossible(ChecksumError::PlaceBits { got: got.bits(), expected: bits }));
        }
        let expected = self.field("checksum", (0, 0), bits, order)?;
        if got.is_same_place(&expected) { Ok(()) } else { Err(PresetError::Place { preset, got, expected }) }
    }

    fn check_counter(&self, got: Layout) -> Result<(), PresetError> {
        let preset = self.preset;
        if let Some((at, bits, order)) = preset.counter_place() {
            let expected = self.field("counter", (at, 0), bits, order)?;
            if !got.is_same_place(&expected) {
                return Err(PresetError::CounterPlace { preset, got, expected });
            }
        } else if preset.counter_values().is_some() && got.bits() != 4 {
            return Err(PresetError::CounterBits { preset, got: got.bits(), expected: 4 });
        }
        Ok(())
    }

    fn data_id(&self, data_id: &DataId, most: u32) -> Result<u32, PresetError> {
        match data_id {
            DataId::One(got) if *got <= most => Ok(*got),
            DataId::One(got) => Err(PresetError::DataId { preset: self.preset, got: *got, most }),
            _ => Err(PresetError::DataIdKind { preset: self.preset, expected: "one data id" }),
        }
    }

    /// Returns the parts before and after the payload.
    fn parts(&self, counter: Option<Layout>, data_id: &DataId) -> Result<(Vec<Part>, Vec<Part>), PresetError> {
        let preset = self.preset;
        let counter = || counter.ok_or(PresetError::NoCounter { preset });
        let id = |most| self.data_id(data_id, most).map(u32::to_le_bytes);
        Ok(match preset {
            Preset::AutosarP1 | Preset::AutosarP11 => {
                let [low, high, ..] = id(0xFFFF)?;
                (vec![Part::Bytes(vec![low, high])], vec![])
            }
            Preset::AutosarP1Alternating => {
                let [low, high, ..] = id(0xFFFF)?;
                (vec![Part::ByCounter { counter: counter()?, table: vec![low, high] }], vec![])
            }
            Preset::AutosarP1Low => (vec![Part::Bytes(vec![id(0xFF)?[0]])], vec![]),
            // The profile covers the low byte of the id and a zero byte; the upper four bits are in the
            // payload.
            Preset::AutosarP1Nibble | Preset::AutosarP11Nibble => (vec![Part::Bytes(vec![id(0xFFF)?[0], 0])], vec![]),
            Preset::AutosarP2 => {
                let DataId::ByCounter(table) = data_id else {
                    return Err(PresetError::DataIdKind { preset, expected: "16 data ids, one for each counter" });
                };
                (vec![], vec![Part::ByCounter { counter: counter()?, table: table.to_vec() }])
            }
            Preset::AutosarP5 => {
                let [low, high, ..] = id(0xFFFF)?;
                (vec![], vec![Part::Bytes(vec![low, high])])
            }
            Preset::AutosarP6 => {
                let [low, high, ..] = id(0xFFFF)?;
                // Profile 6 takes the high byte of the data id first, where profile 5 takes the low one.
                (vec![], vec![Part::Bytes(vec![high, low])])
            }
            Preset::AutosarP4 | Preset::AutosarP7 => (vec![], vec![]),
            Preset::Crc8J1850 | Preset::Crc82f | Preset::Sum | Preset::Xor => match data_id {
                DataId::None => (vec![], vec![]),
                _ => return Err(PresetError::DataIdKind { preset, expected: "no data id" }),
            },
        })
    }

    /// Returns the fields of the profile in the payload, apart from checksum and counter.
    fn fields(&self, data_id: &DataId) -> Result<Vec<Field>, PresetError> {
        let length = |at, bits| {
            let layout = self.field("length", (at, 0), bits, ByteOrder::Motorola)?;
            Ok(Field { kind: FieldKind::Length, layout, value: 0 })
        };
        let id = |at| {
            let layout = self.field("data id", (at, 0), 32, ByteOrder::Motorola)?;
            Ok(Field { kind: FieldKind::DataId, layout, value: u64::from(self.data_id(data_id, u32::MAX)?) })
        };
        Ok(match self.preset {
            Preset::AutosarP4 => vec![length(-8, 16)?, id(-4)?],
            Preset::AutosarP6 => vec![length(2, 16)?],
            Preset::AutosarP7 => vec![length(8, 32)?, id(16)?],
            preset if preset.is_nibble() => {
                let layout = self.field("data id", (1, 4), 4, ByteOrder::Intel)?;
                let value = u64::from(self.data_id(data_id, 0xFFF)? >> 8);
                vec![Field { kind: FieldKind::DataId, layout, value }]
            }
            _ => vec![],
        })
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Preset {
    type Err = UnknownPreset;

    fn from_str(name: &str) -> Result<Preset, UnknownPreset> {
        let found = Preset::ALL.into_iter().find(|preset| preset.name() == name);
        found.ok_or_else(|| UnknownPreset { name: name.to_string() })
    }
}
