//! The description of a run in its recording.

use std::collections::BTreeMap;

/// Everything that determines a run, as keys and values: scenario, seed, scheme, initial state, protocol hash.
///
/// It is written before the first record, so that a killed run has it, and once more at the end.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Configuration(BTreeMap<String, String>);

impl Configuration {
    /// Returns a configuration without any key.
    pub fn new() -> Configuration {
        Configuration::default()
    }

    /// The configuration with `key` set to `value`, which may be a whole document (TOML, JSON).
    #[must_use]
    pub fn with(mut self, key: impl Into<String>, value: impl ToString) -> Configuration {
        self.0.insert(key.into(), value.to_string());
        self
    }

    /// Returns the value of `key`, if it is set.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(String::as_str)
    }

    /// Returns keys and values, in order of the keys.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().map(|(key, value)| (key.as_str(), value.as_str()))
    }

    /// Returns all keys with their values.
    pub const fn entries(&self) -> &BTreeMap<String, String> {
        &self.0
    }
}

impl From<BTreeMap<String, String>> for Configuration {
    fn from(entries: BTreeMap<String, String>) -> Configuration {
        Configuration(entries)
    }
}
