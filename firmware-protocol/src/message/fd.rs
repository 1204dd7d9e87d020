//! The layout of CAN FD frames: IEEE 754 singles, little-endian, after eight bytes of header.
//!
//! | bytes | content |
//! | --- | --- |
//! | 0, 1 | CRC-16 (E2E Profile 5) |
//! | 2 | counter |
//! | 3 | flags or a small number of the message |
//! | 4, 5 | sample index |
//! | 6, 7 | zero, or defined by the message |
//! | 8… | singles |

use core::ops::Range;

use crate::error::{DecodeError, EncodeError};
use crate::kind::MessageKind;

/// The bytes of a frame; CRC and counter are still zero, and bytes beyond its length are not sent.
pub(crate) type FdBytes = [u8; 64];

/// The first byte that is not protection.
const CONTENT: usize = 3;
/// Byte with the flags of the message.
pub(super) const FLAGS: usize = 3;
/// First byte of the sample index.
const SAMPLE: usize = 4;
/// First byte of the first single-precision value.
pub(super) const VALUES: usize = 8;

/// The content of a frame whose length and protection are right.
pub(crate) struct FdReader<'a> {
    pub(super) kind: MessageKind,
    pub(super) bytes: &'a [u8],
}

/// A command: two singles and the sample index.
pub(super) fn command(
    kind: MessageKind,
    signals: [&'static str; 2],
    values: [f64; 2],
    sample: u16,
) -> Result<FdBytes, EncodeError> {
    let mut bytes = with_sample(sample);
    for axis in 0..2 {
        let single = commanded(kind, signals[axis], values[axis])?;
        bytes[VALUES + 4 * axis..][..4].copy_from_slice(&single.to_le_bytes());
    }
    Ok(bytes)
}

/// Bytes with a sample index.
pub(super) fn with_sample(sample: u16) -> FdBytes {
    let mut bytes = [0; 64];
    bytes[SAMPLE..SAMPLE + 2].copy_from_slice(&sample.to_le_bytes());
    bytes
}

/// The single nearest to a commanded value, ties to even; a value beyond the range is rejected.
fn commanded(kind: MessageKind, signal: &'static str, got: f64) -> Result<f32, EncodeError> {
    // The conversion rounds before it overflows: a value that rounds to the largest single is in range, and a larger
    // one gives an infinity.
    let single = got as f32;
    if !got.is_finite() {
        Err(EncodeError::NotFinite { kind, signal, got })
    } else if !single.is_finite() {
        Err(EncodeError::OutOfRange { kind, signal, got, limit: f32::MAX.into() })
    } else {
        Ok(single)
    }
}

/// The single nearest to a measured value, ties to even; a value beyond the range becomes its end, flagged by `true`.
pub(super) fn measured(kind: MessageKind, signal: &'static str, got: f64) -> Result<(f32, bool), EncodeError> {
    let single = got as f32;
    if !got.is_finite() {
        Err(EncodeError::NotFinite { kind, signal, got })
    } else if !single.is_finite() {
        // The infinity has kept the sign of the value.
        Ok((f32::MAX.copysign(single), true))
    } else {
        Ok((single, false))
    }
}

/// The single of a limit: zero or more.
pub(super) fn limit(kind: MessageKind, signal: &'static str, got: f64) -> Result<f32, EncodeError> {
    match commanded(kind, signal, got)? {
        single if single < 0.0 => Err(EncodeError::Negative { kind, signal, got }),
        single => Ok(single),
    }
}

impl FdReader<'_> {
    /// A single, which must be finite.
    pub(super) fn single(&self, signal: &'static str, at: usize) -> Result<f64, DecodeError> {
        let mut word = [0; 4];
        word.copy_from_slice(&self.bytes[at..at + 4]);
        let value = f32::from_le_bytes(word);
        if value.is_finite() { Ok(value.into()) } else { Err(DecodeError::NotFinite { kind: self.kind, signal }) }
    }

    /// Flags, of which only those in `used` may be set.
    pub(super) fn flags(&self, at: usize, used: u8) -> Result<u8, DecodeError> {
        match self.bytes[at] & !used {
            0 => Ok(self.bytes[at]),
            got => Err(DecodeError::Reserved { kind: self.kind, byte: at, got }),
        }
    }

    /// Refuses content in these bytes.
    pub(super) fn zero(&self, bytes: Range<usize>) -> Result<(), DecodeError> {
        match bytes.clone().find(|&byte| self.bytes[byte] != 0) {
            None => Ok(()),
            Some(byte) => Err(DecodeError::Reserved { kind: self.kind, byte, got: self.bytes[byte] }),
        }
    }

    pub(super) fn sample(&self) -> u16 {
        u16::from_le_bytes([self.bytes[SAMPLE], self.bytes[SAMPLE + 1]])
    }

    /// The two singles of a command, and its sample index.
    pub(super) fn command(&self, signals: [&'static str; 2]) -> Result<([f64; 2], u16), DecodeError> {
        // Bytes 3, 6 and 7 of a command have no signal. What is set there is rejected, so a later version can
        // use it.
        self.zero(CONTENT..SAMPLE)?;
        self.zero(6..8)?;
        Ok(([self.single(signals[0], VALUES)?, self.single(signals[1], VALUES + 4)?], self.sample()))
    }
}
