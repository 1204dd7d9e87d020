//! The checksum of a message in a scenario, either a named preset or an algorithm with its parameters.

use serde::{Deserialize, Serialize};

use super::error::{Place, WireError};
use super::signals::Used;
use crate::dbc::Message;
use resonarm_wire::checksum::{Algorithm, Checksum, ChecksumError, Crc, DataId, Own, Part, Preset, Sum};
use resonarm_wire::layout::{ByteOrder, Layout};

/// A checksum as a scenario states it, by a `preset` or by an `algorithm`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChecksumSpec {
    /// Name of the signal that holds the checksum.
    pub signal: String,
    /// Name of a preset, such as `autosar-p1`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// Data id of a preset, or the 16 data ids of AUTOSAR profile 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data_id: Option<DataIdSpec>,
    /// Algorithm to compute, of the same width as the signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub algorithm: Option<AlgorithmSpec>,
    /// CRC: the polynomial without its highest power.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polynomial: Option<u64>,
    /// Initial value of the algorithm; without it 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<u64>,
    /// Value that is XORed to the result; without it 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub xor_out: Option<u64>,
    /// CRC: whether the bits of every byte and of the result are reflected.
    #[serde(skip_serializing_if = "is_false")]
    pub reflect: bool,
    /// Sum: whether the bytes are subtracted from the initial value.
    #[serde(skip_serializing_if = "is_false")]
    pub subtract: bool,
    /// Whether the bytes of the payload are taken from the last to the first.
    #[serde(skip_serializing_if = "is_false")]
    pub reversed: bool,
    /// Whether the checksum's own bytes enter as zeros; otherwise they are left out.
    #[serde(skip_serializing_if = "is_false")]
    pub own_as_zero: bool,
    /// Bytes of the payload that are left out, from 0.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub leave_out: Vec<usize>,
    /// Bytes that enter before the payload.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub before: Vec<PartSpec>,
    /// Bytes that enter after the payload.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub after: Vec<PartSpec>,
}

fn is_false(flag: &bool) -> bool {
    !flag
}

/// Data id of a preset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum DataIdSpec {
    /// One number for all frames.
    One(u32),
    /// One byte for each value of the counter.
    ByCounter([u8; 16]),
}

/// Algorithm of a checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AlgorithmSpec {
    /// A cyclic redundancy check.
    Crc,
    /// The sum of the bytes.
    Sum,
    /// The sum of the half bytes.
    NibbleSum,
    /// The exclusive or of the bytes.
    Xor,
}

/// Bytes that a checksum covers in addition to the payload: a constant byte, or one of these tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum PartSpec {
    /// A constant byte among what the checksum covers.
    Byte(u8),
    /// The low bytes of the identifier, the least significant first.
    Id {
        /// Number of bytes, 1 to 4.
        id_bytes: u8,
        /// Whether the most significant byte is first.
        #[serde(default, skip_serializing_if = "is_false")]
        motorola: bool,
    },
    /// The low bytes of the payload's length, the least significant first.
    Length {
        /// Number of bytes, 1 to 8.
        length_bytes: u8,
        /// Whether the most significant byte is first.
        #[serde(default, skip_serializing_if = "is_false")]
        motorola: bool,
    },
    /// One byte of a table, selected by the counter of the message modulo the table's length.
    ByCounter {
        /// Bytes of the table.
        by_counter: Vec<u8>,
    },
}

impl ChecksumSpec {
    /// Parses the preset, if the section names one.
    ///
    /// # Errors
    /// [`WireError::Protection`] for an unknown one.
    pub(super) fn known(&self, place: &Place) -> Result<Option<Preset>, WireError> {
        let parse = |name: &String| name.parse().map_err(|error| WireError::protection(&place.of(&self.signal), error));
        self.preset.as_ref().map(parse).transpose()
    }

    /// Builds the checksum of a message with this counter.
    ///
    /// # Errors
    /// [`WireError`] if the checksum is not possible.
    pub(super) fn checksum(
        &self,
        place: &Place,
        message: &Message,
        counter: Option<Layout>,
        used: &mut Used,
    ) -> Result<Checksum, WireError> {
        let place = place.of(&self.signal);
        used.take(&place, "the checksum")?;
        let layout = *message.signal(&self.signal)?.wire().layout();
        let problem = |problem| WireError::Message { place: place.clone(), problem };
        match (self.known(&place)?, self.algorithm) {
            (Some(preset), None) if self.has_no_parameters() => {
                let data_id = match &self.data_id {
                    None => DataId::None,
                    Some(DataIdSpec::One(id)) => DataId::One(*id),
                    Some(DataIdSpec::ByCounter(ids)) => DataId::ByCounter(*ids),
                };
                let checksum = preset.checksum(layout, counter, &data_id, message.length());
                checksum.map_err(|error| WireError::protection(&place, error))
            }
            (Some(_), _) => {
                Err(problem("a `preset` has only a `data_id` beside it: leave out the parameters of an algorithm"))
            }
            (None, Some(_)) if self.data_id.is_some() => {
                Err(problem("`data_id` belongs to a `preset`: give its bytes in `before` or `after`"))
            }
            (None, Some(algorithm)) => {
                let parts =
                    |parts: &[PartSpec]| parts.iter().map(|part| part.part(counter)).collect::<Option<Vec<_>>>();
                let (Some(before), Some(after)) = (parts(&self.before), parts(&self.after)) else {
                    return Err(problem("`by_counter` needs the message's `counter`"));
                };
                let checksum = self.parametric(algorithm, layout, before, after);
                checksum.map_err(|error| WireError::protection(&place, error))
            }
            (None, None) => Err(problem("give its `preset`, or its `algorithm`")),
        }
    }

    fn has_no_parameters(&self) -> bool {
        // Comparing with a section that has the preset's keys alone covers every parameter, including those
        // added later.
        let bare = ChecksumSpec {
            signal: self.signal.clone(),
            preset: self.preset.clone(),
            data_id: self.data_id.clone(),
            ..ChecksumSpec::default()
        };
        *self == bare
    }

    fn parametric(
        &self,
        algorithm: AlgorithmSpec,
        place: Layout,
        before: Vec<Part>,
        after: Vec<Part>,
    ) -> Result<Checksum, ChecksumError> {
        let width = place.bits();
        let start = self.start.unwrap_or(0);
        let xor_out = self.xor_out.unwrap_or(0);
        let sum = || Sum::new(width, start, xor_out, self.subtract);
        let algorithm = match algorithm {
            AlgorithmSpec::Crc => {
                Algorithm::Crc(Crc::new(width, self.polynomial.unwrap_or(0), start, xor_out, self.reflect)?)
            }
            AlgorithmSpec::Sum => Algorithm::Sum(sum()?),
            AlgorithmSpec::NibbleSum => Algorithm::NibbleSum(sum()?),
            // The initial value and the final XOR of an XOR checksum commute, so both fold into the initial
            // value.
            AlgorithmSpec::Xor => {
                let both = start ^ xor_out;
                let refused = ChecksumError::Parameter { name: "start", got: both, width: 8 };
                Algorithm::Xor { start: u8::try_from(both).map_err(|_beyond| refused)? }
            }
        };
        let own = if self.own_as_zero { Own::Zero } else { Own::LeftOut };
        let checksum = Checksum::new(algorithm, place)?.with_own(own).without(&self.leave_out)?;
        let checksum = if self.reversed { checksum.reversed() } else { checksum };
        checksum.with_parts(before, after)
    }
}

impl PartSpec {
    /// Returns the part; `None` if it needs a counter and there is none.
    fn part(&self, counter: Option<Layout>) -> Option<Part> {
        let order = |motorola| if motorola { ByteOrder::Motorola } else { ByteOrder::Intel };
        Some(match self {
            PartSpec::Byte(byte) => Part::Bytes(vec![*byte]),
            PartSpec::Id { id_bytes, motorola } => Part::Id { bytes: *id_bytes, order: order(*motorola) },
            PartSpec::Length { length_bytes, motorola } => {
                Part::Length { bytes: *length_bytes, order: order(*motorola) }
            }
            PartSpec::ByCounter { by_counter } => Part::ByCounter { counter: counter?, table: by_counter.clone() },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_protocol::Id;
    use resonarm_wire::layout::Number;

    fn spec(text: &str) -> ChecksumSpec {
        toml::from_str(text).unwrap()
    }

    /// Returns the checksum of the digits 1 to 9 and a place for itself in the last byte.
    fn check(text: &str) -> u64 {
        let place = Layout::new(72, 8, ByteOrder::Intel, Number::Unsigned, 10).unwrap();
        let spec = spec(&format!("signal = 'Crc'\n{text}"));
        let parts = |parts: &[PartSpec]| parts.iter().map(|part| part.part(None).unwrap()).collect();
        let before = parts(&spec.before);
        let after = parts(&spec.after);
        let checksum = spec.parametric(spec.algorithm.unwrap(), place, before, after).unwrap();
        checksum.compute(Id::Standard(0x102), b"123456789\0").unwrap()
    }

    /// The check values of CRC-8/SAE-J1850, CRC-8/AUTOSAR and CRC-8/MAXIM-DOW, and sums by hand.
    #[test]
    fn algorithms_by_their_parameters() {
        let j1850 = "algorithm = 'crc'\npolynomial = 0x1D\nstart = 0xFF\nxor_out = 0xFF";
        assert_eq!(check(j1850), 0x4B);
        assert_eq!(check("algorithm = 'crc'\npolynomial = 0x2F\nstart = 0xFF\nxor_out = 0xFF"), 0xDF);
        assert_eq!(check("algorithm = 'crc'\npolynomial = 0x31\nreflect = true"), 0xA1);
        let digits: u64 = b"123456789".iter().map(|digit| u64::from(*digit)).sum();
        assert_eq!(check("algorithm = 'sum'"), digits % 256);
        assert_eq!(check("algorithm = 'sum'\nsubtract = true"), (0x10000 - digits) % 256);
        assert_eq!(
            check("algorithm = 'sum'\nleave_out = [0]\nbefore = [1]\nafter = [{ id_bytes = 2 }]"),
            (digits - 48 + 3) % 256
        );
        assert_eq!(
            check("algorithm = 'xor'\nstart = 1"),
            u64::from(b"123456789".iter().fold(1, |sum, digit| sum ^ digit))
        );
    }
}
