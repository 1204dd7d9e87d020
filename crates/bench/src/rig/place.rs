//! Names of places on a structure.

use alloc::string::{String, ToString};
use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Length of the longest name, bytes.
const MOST_BYTES: usize = 31;

/// Name of a point of a structure, `tip`, or of one of its degrees of freedom, `tip.z`; up to 31 bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct PlaceName {
    bytes: [u8; MOST_BYTES],
    length: u8,
}

impl PlaceName {
    /// Returns the name; `None` if it is empty or too long.
    pub fn new(name: &str) -> Option<PlaceName> {
        let mut bytes = [0; MOST_BYTES];
        bytes.get_mut(..name.len())?.copy_from_slice(name.as_bytes());
        (!name.is_empty()).then_some(PlaceName { bytes, length: name.len() as u8 })
    }

    /// Returns the name as text.
    pub fn as_str(&self) -> &str {
        // It was made of a text.
        str::from_utf8(&self.bytes[..usize::from(self.length)]).unwrap_or_default()
    }
}

impl fmt::Debug for PlaceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl Serialize for PlaceName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for PlaceName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<PlaceName, D::Error> {
        let name = String::deserialize(deserializer)?;
        let expected = "the name of a point, of 1 to 31 bytes".to_string();
        PlaceName::new(&name).ok_or_else(|| de::Error::invalid_value(de::Unexpected::Str(&name), &expected.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_kept_whole_or_not_taken() {
        assert_eq!(PlaceName::new("Spitze.z").unwrap().as_str(), "Spitze.z");
        let longest = "é".repeat(15);
        assert_eq!(PlaceName::new(&longest).unwrap().as_str(), longest);
        assert_eq!([PlaceName::new(""), PlaceName::new(&"é".repeat(16))], [None; 2]);
    }
}
