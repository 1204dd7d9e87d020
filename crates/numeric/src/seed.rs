//! Seeds in TOML, whose integers end at 2⁶³ − 1: larger ones are strings, decimal or hexadecimal with `0x`.

use alloc::string::String;
use core::fmt;

use serde::de::{Error, Visitor};
use serde::{Deserializer, Serializer};

/// Writes an integer, or a string where TOML has none.
pub fn serialize<S: Serializer>(seed: &u64, serializer: S) -> Result<S::Ok, S::Error> {
    match i64::try_from(*seed) {
        Ok(seed) => serializer.serialize_i64(seed),
        Err(_too_large) => serializer.collect_str(seed),
    }
}

/// Reads an integer or a string.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    deserializer.deserialize_any(Seed)
}

/// Reads a decimal or hexadecimal seed.
pub fn parse(text: &str) -> Result<u64, String> {
    let (digits, radix) = text.strip_prefix("0x").map_or((text, 10), |digits| (digits, 16));
    // `from_str_radix` takes a sign, too.
    let parsed = if digits.starts_with('+') { None } else { u64::from_str_radix(digits, radix).ok() };
    parsed
        .ok_or_else(|| String::from("a seed is a whole number from 0 to 18446744073709551615, or hexadecimal as 0x1F"))
}

struct Seed;

impl Visitor<'_> for Seed {
    type Value = u64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a whole number from 0 to 9223372036854775807, or up to 18446744073709551615 in quotes")
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<u64, E> {
        u64::try_from(value).map_err(|_negative| E::invalid_value(serde::de::Unexpected::Signed(value), &self))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<u64, E> {
        Ok(value)
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<u64, E> {
        parse(value).map_err(E::custom)
    }
}
