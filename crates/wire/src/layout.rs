//! The bits of a signal in a payload, numbered as in DBC files.
//!
//! Bit n is bit n mod 8 of byte ⌊n / 8⌋, bit 0 the least significant of its byte. A signal is a run of bits in one of
//! two orders, and its start bit is:
//!
//! - Intel (`@1` in a DBC): the *least* significant bit; the following ones have the numbers start + 1, start + 2, …
//! - Motorola (`@0`): the *most* significant bit; the following ones go down to bit 0 of the byte, then from bit 7 of
//!   the next byte, so that the numbers form a sawtooth: 3, 2, 1, 0, 15, 14, ….

use core::fmt;

use thiserror::Error;

use crate::PAYLOAD_MAX_BYTES;

/// The order of the bytes of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ByteOrder {
    /// The least significant byte first; `@1` in a DBC.
    Intel,
    /// The most significant byte first; `@0` in a DBC.
    Motorola,
}

/// What the bits of a signal are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Number {
    /// An integer without sign.
    Unsigned,
    /// An integer in two's complement.
    Signed,
    /// A number of IEEE 754, of 32 or 64 bits.
    Float,
}

/// Why a signal can't lie so in a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum LayoutError {
    /// No bits, or too many.
    #[error("it has {got} bits: 1 to 64 do")]
    Bits {
        /// The bits given.
        got: u64,
    },
    /// A floating-point number of an impossible size.
    #[error("it is a floating-point number of {got} bits: 32 or 64 do")]
    FloatBits {
        /// The bits given.
        got: u64,
    },
    /// A payload longer than any frame has.
    #[error("the payload has {got} bytes: at most {PAYLOAD_MAX_BYTES} do")]
    Payload {
        /// The bytes given.
        got: usize,
    },
    /// Some bits lie behind the end of the payload.
    #[error("from start bit {start_bit} its {bits} bits take {needed} bytes, and the payload has {payload_bytes}")]
    PastEnd {
        /// The start bit.
        start_bit: u64,
        /// The bits of the signal.
        bits: u64,
        /// The bytes that a payload with all of the signal has at least.
        needed: u64,
        /// The bytes of the payload.
        payload_bytes: usize,
    },
}

/// Why a number can't be put into a payload.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InsertError {
    /// The payload ends before the signal.
    #[error("the payload has {got} bytes, and the signal needs {needed}")]
    Short {
        /// The bytes of the payload.
        got: usize,
        /// The bytes that hold all of the signal.
        needed: usize,
    },
    /// The number does not fit the bits.
    #[error("{got} does not fit {bits} bits")]
    Bits {
        /// The number.
        got: i128,
        /// The bits of the signal.
        bits: u8,
    },
    /// A fraction, NaN, an infinity or a number beyond the range of the bits.
    #[error("{got} can't be written as {number} of {bits} bits")]
    Number {
        /// The number.
        got: f64,
        /// What the bits are.
        number: Number,
        /// The bits of the signal.
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

/// Where the bits of a signal lie. Every value of this type is valid: the constructor checks.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Layout {
    start_bit: u16,
    bits: u8,
    byte_order: ByteOrder,
    number: Number,
    /// The first and the last byte with bits of it, and how many bits of lower significance are in those bytes.
    first: u8,
    last: u8,
    shift: u8,
}

impl Layout {
    /// A signal of `bits` bits from `start_bit`, in a payload of `payload_bytes` bytes.
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
        let (first, last) = (first as u8, (needed - 1) as u8);
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

    /// The start bit: the least significant bit for Intel, the most significant one for Motorola.
    pub const fn start_bit(&self) -> u16 {
        self.start_bit
    }

    /// How many bits it has, 1 to 64.
    pub const fn bits(&self) -> u8 {
        self.bits
    }

    /// The order of its bytes.
    pub const fn byte_order(&self) -> ByteOrder {
        self.byte_order
    }

    /// What the bits are.
    pub const fn number(&self) -> Number {
        self.number
    }

    /// The first byte that has bits of it.
    pub const fn first_byte(&self) -> usize {
        self.first as usize
    }

    /// The bytes that a payload has at least if it contains all of the signal.
    pub const fn needed_bytes(&self) -> usize {
        self.last as usize + 1
    }

    /// The largest integer without sign that fits: 2ⁿ − 1.
    pub const fn mask(&self) -> u64 {
        u64::MAX >> (64 - self.bits as u32)
    }

    /// Whether the same bits have the same significance in `other`: inside one byte the orders do not differ.
    pub const fn is_same_place(&self, other: &Layout) -> bool {
        let same_order = matches!(self.byte_order, ByteOrder::Intel) == matches!(other.byte_order, ByteOrder::Intel);
        self.bits == other.bits
            && self.first == other.first
            && self.last == other.last
            && self.shift == other.shift
            && (same_order || self.first == self.last)
    }

    /// The bits it takes of a payload.
    pub fn occupied(&self) -> Bits {
        let mut payload = [0; PAYLOAD_MAX_BYTES];
        self.store(self.mask(), &mut payload);
        Bits(payload)
    }

    /// The bits as an integer without sign, whatever the number is; None if the payload ends before the signal.
    ///
    /// The bytes from the first to the last, at most 9, are one integer, in the byte order of the signal; it is
    /// shifted to the right by the bits that are less significant than the signal's, and masked.
    pub fn extract_u64(&self, payload: &[u8]) -> Option<u64> {
        let window = self.window(payload.get(self.first as usize..=self.last as usize)?);
        Some((window >> self.shift) as u64 & self.mask())
    }

    /// The bits as an integer in two's complement, whatever the number is; None if the payload ends before the signal.
    pub fn extract_i64(&self, payload: &[u8]) -> Option<i64> {
        let unused = 64 - u32::from(self.bits);
        // To the top and back: the shift to the right of a signed number repeats its sign.
        self.extract_u64(payload).map(|raw| (raw << unused) as i64 >> unused)
    }

    /// The number that the bits are, of an integer of more than 53 bits the nearest f64; a floating-point number may be
    /// NaN or infinite. None if the payload ends before the signal.
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

    /// Writes the bits of an integer without sign, whatever the number is, and leaves all others as they are.
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

    /// Writes the bits of an integer in two's complement, whatever the number is, and leaves all others as they are.
    ///
    /// # Errors
    /// As [`Layout::insert_u64`].
    pub fn insert_i64(&self, raw: i64, payload: &mut [u8]) -> Result<(), InsertError> {
        let unused = 64 - u32::from(self.bits);
        if raw << unused >> unused != raw {
            return Err(InsertError::Bits { got: i128::from(raw), bits: self.bits });
        }
        self.insert_u64(raw as u64 & self.mask(), payload)
    }

    /// Writes a number as what the bits are, and leaves all others as they are. A floating-point number of 32 bits is
    /// the nearest to `value`; NaN and infinities are written as such.
    ///
    /// # Errors
    /// [`InsertError`] if an integer can't be `value`, a finite number is beyond those of 32 bits, or the payload ends
    /// before the signal; the payload is then unchanged.
    pub fn insert_f64(&self, value: f64, payload: &mut [u8]) -> Result<(), InsertError> {
        let refused = InsertError::Number { got: value, number: self.number, bits: self.bits };
        match self.number {
            Number::Float if self.bits == 32 => {
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

    /// The bytes as one integer, in the byte order of the signal.
    fn window(&self, bytes: &[u8]) -> u128 {
        let append = |window: u128, byte: &u8| window << 8 | u128::from(*byte);
        match self.byte_order {
            ByteOrder::Intel => bytes.iter().rev().fold(0, append),
            ByteOrder::Motorola => bytes.iter().fold(0, append),
        }
    }

    /// Puts `raw`, which fits, into a payload that is long enough.
    fn store(&self, raw: u64, payload: &mut [u8]) {
        let bytes = &mut payload[self.first as usize..=self.last as usize];
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

/// As a DBC writes it: `16|12@1-`, and `float` behind a floating-point number.
impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let order = u8::from(self.byte_order == ByteOrder::Intel);
        let sign = if self.number == Number::Unsigned { '+' } else { '-' };
        write!(f, "{}|{}@{order}{sign}", self.start_bit, self.bits)?;
        if self.number == Number::Float { f.write_str(" float") } else { Ok(()) }
    }
}

/// A set of bits of a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Bits([u8; PAYLOAD_MAX_BYTES]);

impl Bits {
    /// No bits.
    pub const NONE: Bits = Bits([0; PAYLOAD_MAX_BYTES]);

    /// The bits of the set in byte `byte`, as ones; zero beyond the longest payload.
    pub fn in_byte(&self, byte: usize) -> u8 {
        self.0.get(byte).copied().unwrap_or(0)
    }

    /// The bit of least number that is in both sets.
    pub fn first_common(&self, other: &Bits) -> Option<u16> {
        let common = |byte: usize| self.0[byte] & other.0[byte];
        let byte = (0..PAYLOAD_MAX_BYTES).find(|byte| common(*byte) != 0)?;
        Some(8 * byte as u16 + common(byte).trailing_zeros() as u16)
    }
}

#[cfg(test)]
#[path = "layout_tests.rs"]
mod tests;
