//! What the attributes of a DBC mean.

use std::collections::HashMap;

use can_dbc::{AttributeDefinition, AttributeValue, AttributeValueType, Dbc, MessageId};
use resonarm_protocol::FrameFormat;

use super::Problem;

/// The words of `VFrameFormat` by their index, as the makers of the format list them.
const FORMATS: [(u64, &str); 5] =
    [(0, "StandardCAN"), (1, "ExtendedCAN"), (3, "J1939PG"), (14, "StandardCAN_FD"), (15, "ExtendedCAN_FD")];

/// The attributes of a file, to look up.
pub(super) struct Attributes<'a> {
    messages: HashMap<(MessageId, &'a str), &'a AttributeValue>,
    signals: HashMap<(MessageId, &'a str, &'a str), &'a AttributeValue>,
    nodes: HashMap<(&'a str, &'a str), &'a AttributeValue>,
    defaults: HashMap<&'a str, &'a AttributeValue>,
    /// The words of those that are one of a list.
    words: HashMap<&'a str, &'a [String]>,
}

impl<'a> Attributes<'a> {
    pub(super) fn new(dbc: &'a Dbc) -> Attributes<'a> {
        let messages = dbc.attribute_values_message.iter();
        let signals = dbc.attribute_values_signal.iter();
        let nodes = dbc.attribute_values_node.iter();
        Attributes {
            messages: messages.map(|of| ((of.message_id, of.name.as_str()), &of.value)).collect(),
            signals: signals
                .map(|of| ((of.message_id, of.signal_name.as_str(), of.name.as_str()), &of.value))
                .collect(),
            nodes: nodes.map(|of| ((of.node_name.as_str(), of.name.as_str()), &of.value)).collect(),
            defaults: dbc.attribute_defaults.iter().map(|of| (of.name.as_str(), &of.value)).collect(),
            words: dbc.attribute_definitions.iter().filter_map(words).collect(),
        }
    }

    /// The value of a message's attribute, else its default. A word of a list may be written as such or as its index.
    fn of_message(&self, id: MessageId, name: &'a str) -> Option<&'a AttributeValue> {
        self.messages.get(&(id, name)).or_else(|| self.defaults.get(name)).copied()
    }

    /// The cycle time of a message, ms, if it is stated and positive.
    pub(super) fn cycle_time_ms(&self, id: MessageId) -> Option<f64> {
        number(self.of_message(id, "GenMsgCycleTime")?).filter(|time_ms| time_ms.is_finite() && *time_ms > 0.0)
    }

    /// The format of the frames of a message.
    pub(super) fn format(&self, id: MessageId) -> Result<FrameFormat, Problem> {
        let Some(value) = self.of_message(id, "VFrameFormat") else {
            return Ok(FrameFormat::Classic);
        };
        match self.format_index(value) {
            Some(14 | 15) => {
                let switch = self.of_message(id, "CANFD_BRS").map(|value| self.word(value, "CANFD_BRS"));
                let bit_rate_switch = !matches!(switch.as_deref(), Some("0"));
                Ok(FrameFormat::Fd { bit_rate_switch, error_state_indicator: false })
            }
            Some(0 | 1 | 3) => Ok(FrameFormat::Classic),
            _ => Err(Problem::Format { got: self.word(value, "VFrameFormat") }),
        }
    }

    /// The index of a `VFrameFormat`. Some files have a list of other words in another order: the word counts.
    fn format_index(&self, value: &AttributeValue) -> Option<u64> {
        let word = self.word(value, "VFrameFormat");
        let known = FORMATS.iter().find(|(index, name)| *name == word || index.to_string() == word);
        known.map(|(index, _)| *index)
    }

    /// The value as a word of the attribute's list, else as it is written.
    fn word(&self, value: &AttributeValue, name: &str) -> String {
        let index = number(value).filter(|index| *index >= 0.0 && index.fract() == 0.0);
        let listed = index.and_then(|index| self.words.get(name)?.get(index as usize));
        match (listed, value) {
            (Some(word), _) => word.clone(),
            (None, AttributeValue::String(text)) => text.clone(),
            (None, AttributeValue::Uint(number)) => number.to_string(),
            (None, AttributeValue::Int(number)) => number.to_string(),
            (None, AttributeValue::Double(number)) => number.to_string(),
        }
    }

    /// The long name of a message.
    pub(super) fn message_name(&self, id: MessageId, symbol: &str) -> String {
        long(self.messages.get(&(id, "SystemMessageLongSymbol")), symbol)
    }

    /// The long name of a signal.
    pub(super) fn signal_name(&self, id: MessageId, symbol: &str) -> String {
        long(self.signals.get(&(id, symbol, "SystemSignalLongSymbol")), symbol)
    }

    /// The long name of a node.
    pub(super) fn node_name(&self, symbol: &str) -> String {
        long(self.nodes.get(&(symbol, "SystemNodeLongSymbol")), symbol)
    }
}

fn words(definition: &AttributeDefinition) -> Option<(&str, &[String])> {
    match definition {
        AttributeDefinition::Message(name, AttributeValueType::Enum(words)) => Some((name, words)),
        _ => None,
    }
}

/// A number as such, or as the text that some tools write.
fn number(value: &AttributeValue) -> Option<f64> {
    match value {
        AttributeValue::Uint(number) => Some(*number as f64),
        AttributeValue::Int(number) => Some(*number as f64),
        AttributeValue::Double(number) => Some(*number),
        AttributeValue::String(text) => text.trim().parse().ok(),
    }
}

fn long(name: Option<&&AttributeValue>, symbol: &str) -> String {
    match name {
        Some(AttributeValue::String(name)) if !name.is_empty() => name.clone(),
        _ => symbol.to_string(),
    }
}
