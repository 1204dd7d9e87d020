//! Meaning of the DBC attributes that affect frames: format, cycle time, and long names.

use std::collections::HashMap;

use resonarm_protocol::FrameFormat;

use super::error::Problem;
use super::syntax::{AttributeOwner, AttributeValue, Statements};

/// Values of `VFrameFormat` as the vendors of the format list them: the index and its word.
const FORMATS: [(u64, &str); 5] =
    [(0, "StandardCAN"), (1, "ExtendedCAN"), (3, "J1939PG"), (14, "StandardCAN_FD"), (15, "ExtendedCAN_FD")];

/// Largest payload of a classical CAN frame, bytes.
const CLASSIC_MAX_BYTES: u64 = 8;

/// Lookup tables of the attributes in a file. Message identifiers are those written in the file, with bit 31
/// set for 29-bit identifiers.
pub(super) struct Attributes<'a> {
    messages: HashMap<(u64, &'a str), &'a AttributeValue>,
    signals: HashMap<(u64, &'a str, &'a str), &'a AttributeValue>,
    nodes: HashMap<(&'a str, &'a str), &'a AttributeValue>,
    defaults: HashMap<&'a str, &'a AttributeValue>,
    /// The words of enumerated attributes, by the name of the attribute.
    words: HashMap<&'a str, &'a [String]>,
}

impl<'a> Attributes<'a> {
    pub(super) fn new(statements: &'a Statements) -> Attributes<'a> {
        let defaults = statements.attribute_defaults.iter().map(|(name, value)| (name.as_str(), value));
        let words = statements.attribute_words.iter().map(|(name, words)| (name.as_str(), words.as_slice()));
        let mut attributes = Attributes {
            messages: HashMap::new(),
            signals: HashMap::new(),
            nodes: HashMap::new(),
            defaults: defaults.collect(),
            words: words.collect(),
        };
        for of in &statements.attributes {
            let name = of.name.as_str();
            let value = &of.value;
            match &of.of {
                AttributeOwner::Message(id) => drop(attributes.messages.insert((*id, name), value)),
                AttributeOwner::Signal(id, signal) => drop(attributes.signals.insert((*id, signal, name), value)),
                AttributeOwner::Node(node) => drop(attributes.nodes.insert((node, name), value)),
                AttributeOwner::Other => {}
            }
        }
        attributes
    }

    /// Returns the value of a message's attribute, else its default. A word of a list may be written as such or as its
    /// index.
    fn of_message(&self, id: u64, name: &'a str) -> Option<&'a AttributeValue> {
        self.messages.get(&(id, name)).or_else(|| self.defaults.get(name)).copied()
    }

    /// Returns the cycle time of a message, ms, if it is stated and positive.
    pub(super) fn cycle_time_ms(&self, id: u64) -> Option<f64> {
        number(self.of_message(id, "GenMsgCycleTime")?).filter(|time_ms| time_ms.is_finite() && *time_ms > 0.0)
    }

    /// Returns the frame format of a message of this length. Without `VFrameFormat` a message that no classical frame
    /// can hold is one of CAN FD.
    pub(super) fn format(&self, id: u64, bytes: u64) -> Result<FrameFormat, Problem> {
        let is_fd = match self.of_message(id, "VFrameFormat") {
            // Without the attribute nothing but the length tells a message of CAN FD.
            None => bytes > CLASSIC_MAX_BYTES,
            Some(value) => match self.format_index(value) {
                Some(14 | 15) => true,
                Some(0 | 1 | 3) => false,
                _ => return Err(Problem::Format { got: self.word(value, "VFrameFormat") }),
            },
        };
        Ok(if is_fd { self.fd(id) } else { FrameFormat::Classic })
    }

    /// Returns the format of a message of CAN FD, which switches its bit rate unless `CANFD_BRS` is 0.
    pub(super) fn fd(&self, id: u64) -> FrameFormat {
        let switch = self.of_message(id, "CANFD_BRS").map(|value| self.word(value, "CANFD_BRS"));
        FrameFormat::Fd { bit_rate_switch: !matches!(switch.as_deref(), Some("0")), error_state_indicator: false }
    }

    /// Returns the index of a `VFrameFormat`. Some files have a list of other words in another order: the word counts.
    fn format_index(&self, value: &AttributeValue) -> Option<u64> {
        // The word is looked up before the index is compared: in a file with its own list, index 1 may well
        // stand for another word than `ExtendedCAN`.
        let word = self.word(value, "VFrameFormat");
        let known = FORMATS.iter().find(|(index, name)| *name == word || index.to_string() == word);
        known.map(|(index, _)| *index)
    }

    /// Returns the value as a word of the attribute's list, else as it is written.
    fn word(&self, value: &AttributeValue, name: &str) -> String {
        let index = number(value).filter(|index| *index >= 0.0 && index.fract() == 0.0);
        let listed = index.and_then(|index| self.words.get(name)?.get(index as usize));
        match (listed, value) {
            (Some(word), _) => word.clone(),
            (None, AttributeValue::Text(text)) => text.clone(),
            (None, AttributeValue::Number(number)) => number.to_string(),
        }
    }

    /// Returns the long name of a message, or its symbol if it has none.
    pub(super) fn message_name(&self, id: u64, symbol: &str) -> String {
        long(self.messages.get(&(id, "SystemMessageLongSymbol")), symbol)
    }

    /// Returns the long name of a signal, or its symbol if it has none.
    pub(super) fn signal_name(&self, id: u64, symbol: &str) -> String {
        long(self.signals.get(&(id, symbol, "SystemSignalLongSymbol")), symbol)
    }

    /// Returns the long name of a node, or its symbol if it has none.
    pub(super) fn node_name(&self, symbol: &str) -> String {
        long(self.nodes.get(&(symbol, "SystemNodeLongSymbol")), symbol)
    }
}

/// Returns an attribute as a number. Some tools write numbers in quotes.
fn number(value: &AttributeValue) -> Option<f64> {
    match value {
        AttributeValue::Number(number) => Some(*number),
        AttributeValue::Text(text) => text.trim().parse().ok(),
    }
}

fn long(name: Option<&&AttributeValue>, symbol: &str) -> String {
    match name {
        Some(AttributeValue::Text(name)) if !name.is_empty() => name.clone(),
        _ => symbol.to_string(),
    }
}
