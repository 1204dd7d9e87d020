//! The bits of a signal in a payload, numbered as in DBC files.
//!
//! Bit n is bit n mod 8 of byte ⌊n / 8⌋, and bit 0 is the least significant bit of its byte. A signal is a run
//! of bits in one of two orders, and its start bit is:
//!
//! - Intel (`@1` in a DBC): the *least* significant bit; the following ones have the numbers start + 1, start + 2, …
//! - Motorola (`@0`): the *most* significant bit; the following ones go down to bit 0 of the byte, then from bit 7 of
//!   the next byte, so that the numbers form a sawtooth: 3, 2, 1, 0, 15, 14, ….

use core::fmt;

use thiserror::Error;

use crate::PAYLOAD_MAX_BYTES;

/// Byte order of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ByteOrder {
    /// Little-endian, the least significant byte first; `@1` in a DBC.
    Intel,
    /// Big-endian, the most significant byte first; `@0` in a DBC.
    Motorola,
}

/// Number format of a signal's bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Number {
    /// An integer without sign.
    Unsigned,
    /// A signed integer in two's complement.
    Signed,
    /// An IEEE 754 number of 32 or 64 bits.
    Float,
}

/// Reason why a signal can't have this layout in a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum LayoutError {
    /// The width is not 1 to 64 bits.
    #[error("it has {got} bits: it must have 1 to 64")]
    Bits {
        /// Width that was given, bits.
        got: u64,
    },
    /// The width of a floating-point number is not 32 or 64 bits.
    #[error("it is a floating-point number of {got} bits: it must have 32 or 64")]
    FloatBits {
        /// Width that was given, bits.
        got: u64,
    },
    /// The payload is longer than that of any frame.
    #[error("the payload has {got} bytes: it may have at most {PAYLOAD_MAX_BYTES}")]
    Payload {
        /// Length that was given, bytes.
        got: usize,
    },
    /// Some bits lie beyond the end of the payload.
    #[error("from start bit {start_bit} its {bits} bits take {needed} bytes, but the payload has only {payload_bytes}")]
    PastEnd {
        /// Start bit of the signal.
        start_bit: u64,
        /// Width of the signal, bits.
        bits: u64,
        /// Least length of a payload that contains the signal, bytes.
        needed: u64,
        /// Length of the payload, bytes.
        payload_bytes: usize,
    },
}

/// Reason why a number can't be written into a payload.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InsertError {
    /// The payload ends before the signal.
    #[error("the payload has {got} bytes, but the signal needs {needed}")]
    Short {
        /// Length of the payload, bytes.
        got: usize,
        /// Least length that contains the signal, bytes.
        needed: usize,
    },
    /// The number has more bits than the signal.
    #[error("{got} does not fit {bits} bits")]
    Bits {
        /// Number that was given.
        got: i128,
        /// Width of the signal, bits.
        bits: u8,
    },
    /// The number is a fraction, NaN or infinity, or beyond the range of the bits.
    #[error("{got} can't be written as {number} of {bits} bits")]
    Number {
        /// Number that was given.
        got: f64,
        /// Number format of the signal.
        number: Number,
        /// Width of the signal, bits.
        bits: u8,
    },
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Number::Unsigned => "an unsigned integer",
            Number::Signed => "a signed integer",
            Number::Float => "a floating-point number",
        })
    }
}

/// Place and format of a signal's bits. All values of this type are valid, since the constructor checks.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Layout {
    start_bit: u16,
    bits: u8,
    byte_order: ByteOrder,
    number: Number,
    /// First and last byte with bits of the signal, and the number of less significant foreign bits in them.
    first: u8,
    last: u8,
    shift: u8,
}

impl Layout {
    /// Returns a signal of `bits` bits from `start_bit`, in a payload of `payload_bytes` bytes.
    ///
    /// # Errors
    /// [`LayoutError`] if there are not 1 to 64 bits, a floating-point number has not 32 or 64, or the payload does not
    /// contain them all.
    pub const fn new(
        start_bit: u64,
        bits: u64,
        byte_order: ByteOrder,
        number: Number,
        payload_bytes: usize,
    ) -> Result<Layout, LayoutError> {
        if payload_bytes > PAYLOAD_MAX_BYTES {
            return Err(LayoutError::Payload { got: payload_bytes });
        }
        if bits == 0 || bits > 64 {
            return Err(LayoutError::Bits { got: bits });
        }
        if matches!(number, Number::Float) && bits != 32 && bits != 64 {
            return Err(LayoutError::FloatBits { got: bits });
        }
        let first = start_bit / 8;
        // In the order of the run, byte after byte, the first bit of the signal is number `first_bit` of its byte.
        let first_bit = match byte_order {
            ByteOrder::Intel => start_bit % 8,
            ByteOrder::Motorola => 7 - start_bit % 8,
        };
        let bytes = (first_bit + bits).div_ceil(8);
        let needed = first.saturating_add(bytes);
        if needed > payload_bytes as u64 {
            return Err(LayoutError::PastEnd { start_bit, bits, needed, payload_bytes });
        }
        let shift = match byte_order {
            ByteOrder::Intel => first_bit,
            ByteOrder::Motorola => 8 * bytes - first_bit - bits,
        };
        let first = first as u8;
        let last = (needed - 1) as u8;
        Ok(Layout {
            start_bit: start_bit as u16,
            bits: bits as u8,
            byte_order,
            number,
            first,
            last,
            shift: shift as u8,
        })
    }

    /// Returns the width, 1 to 64 bits.
    pub const fn bits(&self) -> u8 {
        self.bits
    }

    /// Returns the number format.
    pub const fn number(&self) -> Number {
        self.number
    }

    /// Returns the first byte that has bits of the signal.
    pub const fn first_byte(&self) -> usize {
        self.first as usize
    }

    /// Returns the least length of a payload that contains the signal, bytes.
    pub const fn needed_bytes(&self) -> usize {
        self.last as usize + 1
    }

    /// Returns the largest unsigned integer that fits: 2ⁿ − 1.
    pub const fn mask(&self) -> u64 {
        u64::MAX >> (64 - self.bits as u32)
    }

    /// Returns whether `other` has the same bits with the same significance: within one byte the byte orders do
    /// not differ.
    pub const fn is_same_place(&self, other: &Layout) -> bool {
        // Comparing enums with `==` is not const.
        let same_order = matches!(self.byte_order, ByteOrder::Intel) == matches!(other.byte_order, ByteOrder::Intel);
        self.bits == other.bits
            && self.first == other.first
            && self.last == other.last
            && self.shift == other.shift
            && (same_order || self.first == self.last)
    }

    /// Returns the set of bits that the signal takes of a payload.
    pub fn occupied(&self) -> Bits {
        let mut payload = [0; PAYLOAD_MAX_BYTES];
        self.store(self.mask(), &mut payload);
        Bits(payload)
    }

    /// Reads the bits as an unsigned integer, whatever the number format is; `None` if the payload ends before
    /// the signal.
    ///
    /// The bytes from the first to the last, at most 9, are taken as one integer in the byte order of the
    /// signal. It is shifted right by the number of less significant foreign bits, and masked.
    pub fn extract_u64(&self, payload: &[u8]) -> Option<u64> {
        let window = self.window(payload.get(self.first as usize..=self.last as usize)?);
        Some((window >> self.shift) as u64 & self.mask())
    }

    /// Reads the bits as a two's complement integer, whatever the number format is; `None` if the payload ends
    /// before the signal.
    pub fn extract_i64(&self, payload: &[u8]) -> Option<i64> {
        let unused = 64 - u32::from(self.bits);
        // Shifting the sign bit to the top and back extends it, since a right shift of a signed integer repeats
        // the sign.
        self.extract_u64(payload).map(|raw| (raw << unused) as i64 >> unused)
    }

    /// Reads the number in its own format: for an integer of more than 53 bits the closest f64; a
    /// floating-point number may be NaN or infinite. `None` if the payload ends before the signal.
    pub fn extract_f64(&self, payload: &[u8]) -> Option<f64> {
        match self.number {
            Number::Unsigned => self.extract_u64(payload).map(|raw| raw as f64),
            Number::Signed => self.extract_i64(payload).map(|raw| raw as f64),
            Number::Float if self.bits == 32 => {
                self.extract_u64(payload).map(|raw| f64::from(f32::from_bits(raw as u32)))
            }
            Number::Float => self.extract_u64(payload).map(f64::from_bits),
        }
    }

    /// Writes the bits of an unsigned integer, whatever the number format is, and leaves all others unchanged.
    ///
    /// # Errors
    /// [`InsertError`] if it needs more bits or more payload; the payload is then unchanged.
    pub fn insert_u64(&self, raw: u64, payload: &mut [u8]) -> Result<(), InsertError> {
        if raw > self.mask() {
            return Err(InsertError::Bits { got: i128::from(raw), bits: self.bits });
        }
        self.check_length(payload)?;
        self.store(raw, payload);
        Ok(())
    }

    /// Writes the bits of a two's complement integer, whatever the number format is, and leaves all others
    /// unchanged.
    ///
    /// # Errors
    /// The errors of [`Layout::insert_u64`].
    pub fn insert_i64(&self, raw: i64, payload: &mut [u8]) -> Result<(), InsertError> {
        let unused = 64 - u32::from(self.bits);
        if raw << unused >> unused != raw {
            return Err(InsertError::Bits { got: i128::from(raw), bits: self.bits });
        }
        self.insert_u64(raw as u64 & self.mask(), payload)
    }

    /// Writes a number in its own format and leaves all other bits unchanged. A floating-point number of 32
    /// bits becomes the one closest to `value`; NaN and infinities are written as such.
    ///
    /// # Errors
    /// [`InsertError`] if an integer can't be `value`, a finite number is beyond those of 32 bits, or the payload ends
    /// before the signal; the payload is then unchanged.
    pub fn insert_f64(&self, value: f64, payload: &mut [u8]) -> Result<(), InsertError> {
        let refused = InsertError::Number { got: value, number: self.number, bits: self.bits };
        match self.number {
            Number::Float if self.bits == 32 => {
                // The cast rounds to nearest and overflows to infinity, which is how a number beyond f32 is
                // found.
                let single = value as f32;
                if value.is_finite() && !single.is_finite() {
                    return Err(refused);
                }
                self.insert_u64(u64::from(single.to_bits()), payload)
            }
            Number::Float => self.insert_u64(value.to_bits(), payload),
            Number::Unsigned => {
                // 2⁶⁴ is the least number beyond; the cast of any smaller one is exact if it has no fraction.
                let fits = (0.0..18_446_744_073_709_551_616.0).contains(&value) && value as u64 as f64 == value;
                if fits { self.insert_u64(value as u64, payload) } else { Err(refused) }
            }
            Number::Signed => {
                const LIMIT: f64 = 9_223_372_036_854_775_808.0;
                let fits = (-LIMIT..LIMIT).contains(&value) && value as i64 as f64 == value;
                if fits { self.insert_i64(value as i64, payload) } else { Err(refused) }
            }
        }
    }

    const fn check_length(&self, payload: &[u8]) -> Result<(), InsertError> {
        if payload.len() < self.needed_bytes() {
            return Err(InsertError::Short { got: payload.len(), needed: self.needed_bytes() });
        }
        Ok(())
    }

    /// Returns the bytes as one integer, in the byte order of the signal. A signal of 64 bits that starts
    /// inside a byte spans 9 bytes, hence u128.
    fn window(&self, bytes: &[u8]) -> u128 {
        let append = |window: u128, byte: &u8| window << 8 | u128::from(*byte);
        match self.byte_order {
            ByteOrder::Intel => bytes.iter().rev().fold(0, append),
            ByteOrder::Motorola => bytes.iter().fold(0, append),
        }
    }

    /// Writes `raw`, which fits, into a payload that is long enough.
    fn store(&self, raw: u64, payload: &mut [u8]) {
        let bytes = &mut payload[self.first as usize..=self.last as usize];
        // Bits of other signals in the first and the last byte are read first, and written back as they were.
        let others = self.window(bytes) & !(u128::from(self.mask()) << self.shift);
        let mut window = others | u128::from(raw) << self.shift;
        let mut put = |byte: &mut u8| {
            *byte = window as u8;
            window >>= 8;
        };
        match self.byte_order {
            ByteOrder::Intel => bytes.iter_mut().for_each(&mut put),
            ByteOrder::Motorola => bytes.iter_mut().rev().for_each(&mut put),
        }
    }
}

impl fmt::Debug for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Writes the layout as a DBC does: `16|12@1-`, with `float` behind a floating-point number.
impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let order = u8::from(self.byte_order == ByteOrder::Intel);
        let sign = if self.number == Number::Unsigned { '+' } else { '-' };
        write!(f, "{}|{}@{order}{sign}", self.start_bit, self.bits)?;
        if self.number == Number::Float { f.write_str(" float") } else { Ok(()) }
    }
}

/// A set of bits of a payload, one bit for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Bits([u8; PAYLOAD_MAX_BYTES]);

impl Bits {
    /// The set without any bit.
    pub const NONE: Bits = Bits([0; PAYLOAD_MAX_BYTES]);

    /// Returns the bits of the set in byte `byte`; zero beyond the longest payload.
    pub fn in_byte(&self, byte: usize) -> u8 {
        self.0.get(byte).copied().unwrap_or(0)
    }

    /// Returns the lowest bit that is in both sets.
    pub fn first_common(&self, other: &Bits) -> Option<u16> {
        let common = |byte: usize| self.0[byte] & other.0[byte];
        let byte = (0..PAYLOAD_MAX_BYTES).find(|byte| common(*byte) != 0)?;
        Some(8 * byte as u16 + common(byte).trailing_zeros() as u16)
    }
}

#[cfg(test)]
#[path = "layout_tests.rs"]
mod tests;
