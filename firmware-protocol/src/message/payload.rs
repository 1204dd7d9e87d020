//! The common layout of protected messages: four flag bits and six bytes besides CRC and counter.

use super::measured::Measured;
use crate::error::{DecodeError, EncodeError};
use crate::kind::MessageKind;
use crate::scaling::{Count, RAW_NOT_AVAILABLE, Scale};

/// The content of a message: the flags (high nibble of byte 1) and bytes 2 to 7.
///
/// A heartbeat, which is unprotected and one byte long, is in `bytes[0]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Payload {
    pub(crate) flags: u8,
    pub(crate) bytes: [u8; 6],
}

/// The first byte of `Payload::bytes` within the frame.
pub(crate) const OFFSET: usize = 2;

/// Flag bits of messages with two axes: x is saturated, y is saturated.
const SATURATED: [u8; 2] = [1, 2];

impl Payload {
    /// Packs three words, each with its low byte first.
    pub(crate) const fn from_words(flags: u8, words: [u16; 3]) -> Payload {
        let [[a, b], [c, d], [e, f]] = [words[0].to_le_bytes(), words[1].to_le_bytes(), words[2].to_le_bytes()];
        Payload { flags, bytes: [a, b, c, d, e, f] }
    }

    /// The three little-endian words.
    pub(crate) const fn words(&self) -> [u16; 3] {
        let [a, b, c, d, e, f] = self.bytes;
        [u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]), u16::from_le_bytes([e, f])]
    }

    /// Refuses flags other than those in `used`.
    pub(crate) const fn check_flags(&self, kind: MessageKind, used: u8) -> Result<(), DecodeError> {
        match self.flags & !used {
            0 => Ok(()),
            // The flags are the high nibble of byte 1, and are reported as they stand in it.
            reserved => Err(DecodeError::Reserved { kind, byte: 1, got: reserved << 4 }),
        }
    }

    /// Refuses content in the bytes from `first` on, counted within the frame.
    pub(crate) fn check_zero_from(&self, kind: MessageKind, first: usize) -> Result<(), DecodeError> {
        match self.bytes.iter().enumerate().skip(first - OFFSET).find(|(_, byte)| **byte != 0) {
            None => Ok(()),
            Some((place, &got)) => Err(DecodeError::Reserved { kind, byte: place + OFFSET, got }),
        }
    }

    /// Two commanded values and a sample index. A value beyond the range is rejected, never clipped.
    pub(crate) fn from_command(
        kind: MessageKind,
        scale: Scale,
        signals: [&'static str; 2],
        values: [f64; 2],
        sample: u16,
    ) -> Result<Payload, EncodeError> {
        let mut words = [0, 0, sample];
        for axis in 0..2 {
            let signal = signals[axis];
            let got = values[axis];
            words[axis] = match scale.count(got) {
                Count::InRange(raw) => raw.cast_unsigned(),
                Count::Beyond(_) => return Err(EncodeError::OutOfRange { kind, signal, got, limit: scale.max() }),
                Count::NotFinite => return Err(EncodeError::NotFinite { kind, signal, got }),
            };
        }
        Ok(Payload::from_words(0, words))
    }

    /// The two commanded values and the sample index.
    pub(crate) fn to_command(
        self,
        kind: MessageKind,
        scale: Scale,
        signals: [&'static str; 2],
    ) -> Result<([f64; 2], u16), DecodeError> {
        self.check_flags(kind, 0)?;
        self.values(kind, scale, signals)
    }

    /// Two measured values and a sample index. A value beyond the range is set to its end and flagged.
    pub(crate) fn from_measured(
        kind: MessageKind,
        scale: Scale,
        signals: [&'static str; 2],
        axes: [Measured; 2],
        sample: u16,
    ) -> Result<Payload, EncodeError> {
        let mut flags = 0;
        let mut words = [0, 0, sample];
        for (axis, Measured { value: got, saturated }) in axes.into_iter().enumerate() {
            let (raw, is_beyond) = match scale.count(got) {
                Count::InRange(raw) => (raw, false),
                // The flag of a sensor that clipped: without it a reader knows the true value to half a count
                // (SPEC.md, section 3).
                Count::Beyond(end) => (end, true),
                Count::NotFinite => return Err(EncodeError::NotFinite { kind, signal: signals[axis], got }),
            };
            flags |= if saturated || is_beyond { SATURATED[axis] } else { 0 };
            words[axis] = raw.cast_unsigned();
        }
        Ok(Payload::from_words(flags, words))
    }

    /// The two measured values, whether each is saturated, and the sample index.
    pub(crate) fn to_measured(
        self,
        kind: MessageKind,
        scale: Scale,
        signals: [&'static str; 2],
    ) -> Result<([Measured; 2], u16), DecodeError> {
        let [x, y] = SATURATED;
        self.check_flags(kind, x | y)?;
        let (values, sample) = self.values(kind, scale, signals)?;
        let measured = |axis: usize| Measured { value: values[axis], saturated: self.flags & SATURATED[axis] != 0 };
        Ok(([0, 1].map(measured), sample))
    }

    fn values(
        self,
        kind: MessageKind,
        scale: Scale,
        signals: [&'static str; 2],
    ) -> Result<([f64; 2], u16), DecodeError> {
        let words = self.words();
        let mut values = [0.0; 2];
        for axis in 0..2 {
            let raw = words[axis].cast_signed();
            // A peer of a later version may send it; this one has no use for a sample that is not whole.
            if raw == RAW_NOT_AVAILABLE {
                return Err(DecodeError::NotAvailable { kind, signal: signals[axis] });
            }
            values[axis] = scale.value(raw);
        }
        Ok((values, words[2]))
    }
}
