//! Names of a rig's instruments.

use alloc::string::String;
use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Length of the longest name, bytes.
const MOST_BYTES: usize = 15;

/// Name of a sensor in a scenario: a lower-case letter, then lower-case letters, digits and underscores, at
/// most 15.
///
/// The name is part of the names of the sensor's channels: `acceleration_m3_z_m_s2` belongs to the sensor `m3`.
/// The impedance head has the name `head`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstrumentName {
    bytes: [u8; MOST_BYTES],
    length: u8,
}

impl InstrumentName {
    /// Accelerometer B, at the elbow of the arm.
    pub const B: InstrumentName = InstrumentName::of(b"b");
    /// Accelerometer C, at the tip of the arm.
    pub const C: InstrumentName = InstrumentName::of(b"c");
    /// The force side of the impedance head.
    pub const HEAD: InstrumentName = InstrumentName::of(b"head");

    /// Returns the name; `None` if it has other characters, or too many.
    pub fn new(name: &str) -> Option<InstrumentName> {
        let mut bytes = name.bytes();
        let begins = bytes.next().is_some_and(|first| first.is_ascii_lowercase());
        let goes_on = bytes.all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_');
        (begins && goes_on && name.len() <= MOST_BYTES).then(|| InstrumentName::of(name.as_bytes()))
    }

    /// Returns a name whose validity is known.
    const fn of(name: &[u8]) -> InstrumentName {
        let mut bytes = [0; MOST_BYTES];
        let mut place = 0;
        while place < name.len() {
            bytes[place] = name[place];
            place += 1;
        }
        InstrumentName { bytes, length: name.len() as u8 }
    }

    /// Returns the name as text.
    pub fn as_str(&self) -> &str {
        // It was made of ASCII characters.
        str::from_utf8(&self.bytes[..usize::from(self.length)]).unwrap_or_default()
    }

    /// Returns the first stream of the instrument's noise, which has one stream for each axis. It follows from
    /// the name, so that other sensors change nothing.
    pub(super) fn stream(self) -> u64 {
        match self {
            InstrumentName::HEAD => 0,
            InstrumentName::B => 2,
            InstrumentName::C => 4,
            _ => {
                // FNV-1a hash. The highest bit distinguishes it from the streams of faults, and the lowest two
                // bits are the axis.
                let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
                (self.as_str().bytes().fold(0xcbf2_9ce4_8422_2325, hash) | 1 << 63) & !3
            }
        }
    }

    /// Returns the section of the instrument in a scenario.
    pub fn section(self) -> Section {
        if self == InstrumentName::HEAD { Section::Rig("head") } else { Section::Sensor(self) }
    }
}

impl fmt::Display for InstrumentName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl fmt::Debug for InstrumentName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl Serialize for InstrumentName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for InstrumentName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<InstrumentName, D::Error> {
        let name = String::deserialize(deserializer)?;
        let expected = "a lower-case letter, then at most 14 lower-case letters, digits or underscores";
        InstrumentName::new(&name).ok_or_else(|| de::Error::invalid_value(de::Unexpected::Str(&name), &expected))
    }
}

/// A section of `[rig]` in a scenario, for messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// A section such as `[rig.exciter]` or `[rig.head]`.
    Rig(&'static str),
    /// The section `[rig.sensors.NAME]` of a sensor.
    Sensor(InstrumentName),
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Section::Rig(section) => write!(f, "rig.{section}"),
            Section::Sensor(name) => write!(f, "rig.sensors.{name}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_part_of_the_name_of_a_column() {
        assert_eq!(InstrumentName::new("m3_left").unwrap().as_str(), "m3_left");
        assert_eq!(
            [InstrumentName::new("b"), InstrumentName::new("head")],
            [Some(InstrumentName::B), Some(InstrumentName::HEAD)]
        );
        for name in ["", "3m", "_m", "M3", "m-3", "m.z", "größe", "sixteen_letters_"] {
            assert_eq!(InstrumentName::new(name), None, "{name}");
        }
    }
}
