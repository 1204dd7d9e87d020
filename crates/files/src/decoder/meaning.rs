//! The meaning of a signal or a message to the plant.

use core::fmt;
use resonarm_bench::structure::ChannelName;

use serde::Serialize;

use resonarm_numeric::number::short;

/// Meaning of a signal or a message to the plant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Meaning {
    /// The alive counter of the message.
    Counter,
    /// The checksum of the message.
    Checksum,
    /// A load that is commanded to the plant.
    Load {
        /// Its key in a scenario.
        name: &'static str,
        /// Value of the load, in `unit`.
        value: f64,
        /// Unit of the load: N or N·m.
        unit: &'static str,
    },
    /// A request of the operator to the plant.
    Request {
        /// Its key in a scenario: `arm`, `disarm`, `reset` or `stop`.
        action: &'static str,
        /// Whether the request counts in this frame: a value counts when it changes, not while it stays.
        is_new: bool,
    },
    /// A condition for loads to count.
    Required {
        /// Whether loads count with this value.
        is_fulfilled: bool,
    },
    /// The message that answers samples in lockstep, or requests readings.
    Sync,
    /// A reading, a state of the arm or a held load.
    Quantity {
        /// The name of its channel.
        name: ChannelName,
        /// Value in the unit of the channel.
        value: f64,
        /// Unit of the channel.
        unit: &'static str,
    },
    /// Whether a reading is beyond the range of its sensor.
    Clipped {
        /// The name of its channel.
        name: ChannelName,
        /// Whether the reading is clipped.
        is_clipped: bool,
    },
    /// The state of the plant.
    State {
        /// Its name; `None` if the mapping has none for the value.
        name: Option<&'static str>,
    },
    /// The fault of the plant.
    Reason {
        /// Its name; `None` if the mapping has none for the value.
        name: Option<&'static str>,
    },
    /// The index of the sample.
    Sample,
    /// A step of the transfer of an object of a CANopen drive.
    Object {
        /// The action of the frame: `read`, `value of`, `write`, `written`, `abort` and those of segments.
        action: &'static str,
        /// The object; `None` if no earlier frame says which it is.
        object: Option<ObjectName>,
    },
}

/// An object of a CANopen drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ObjectName {
    /// Index in the object dictionary.
    pub index: u16,
    /// Subindex in the object dictionary.
    pub subindex: u8,
    /// Its name, and that of the entry if it has several.
    pub name: String,
}

impl fmt::Display for ObjectName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ObjectName { index, subindex: 0, name } => write!(f, "{index:04X} {name}"),
            ObjectName { index, subindex, name } => write!(f, "{index:04X}:{subindex:02X} {name}"),
        }
    }
}

impl fmt::Display for Meaning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Meaning::Counter => f.write_str("counter"),
            Meaning::Checksum => f.write_str("checksum"),
            Meaning::Load { name, value, .. } => write!(f, "load {name}={}", short(&rounded(*value))),
            Meaning::Request { action, is_new: true } => f.write_str(action),
            Meaning::Request { action, is_new: false } => write!(f, "{action}, unchanged"),
            Meaning::Required { is_fulfilled: true } => f.write_str("loads count"),
            Meaning::Required { is_fulfilled: false } => f.write_str("loads are ignored"),
            Meaning::Sync => f.write_str("sync"),
            Meaning::Quantity { name, value, .. } => write!(f, "{name}={}", short(&rounded(*value))),
            Meaning::Clipped { name, is_clipped: true } => write!(f, "{name} clipped"),
            Meaning::Clipped { name, is_clipped: false } => write!(f, "{name} not clipped"),
            Meaning::State { name } => f.write_str(name.unwrap_or("no state")),
            Meaning::Reason { name } => f.write_str(name.unwrap_or("no reason")),
            Meaning::Sample => f.write_str("sample"),
            Meaning::Object { action, object: None } => write!(f, "{action} an object that no earlier frame names"),
            Meaning::Object { action, object: Some(object) } => write!(f, "{action} {object}"),
        }
    }
}

/// Rounds to nine significant digits: products of scales have more, which mean nothing.
fn rounded(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}
