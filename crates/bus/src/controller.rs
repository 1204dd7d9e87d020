//! What a CAN controller tells of itself.

use serde::Serialize;

/// How far a CAN controller has come by the errors that it counts (ISO 11898-1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum ControllerState {
    /// Error-active: it takes part. So is one that has told nothing yet.
    #[default]
    #[serde(rename = "error-active")]
    Active,
    /// Error-active still, with 96 transmit or receive errors or more.
    #[serde(rename = "error-warning")]
    Warning,
    /// Error-passive, with 128 or more: it takes part, can't destroy the frames of others, and waits before it sends
    /// again.
    #[serde(rename = "error-passive")]
    Passive,
    /// Bus-off, with 256 transmit errors or more: it takes no part.
    #[serde(rename = "bus-off")]
    BusOff,
}

impl ControllerState {
    /// Its name in text.
    pub const fn name(self) -> &'static str {
        match self {
            ControllerState::Active => "error-active",
            ControllerState::Warning => "error-warning",
            ControllerState::Passive => "error-passive",
            ControllerState::BusOff => "bus-off",
        }
    }
}

/// What the controller of this end has told of errors, by kind: each time it told so counts as one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ControllerErrors {
    /// Faults seen on the wire: of a bit, the stuffing, the form, or the CRC.
    pub protocol: u64,
    /// Frames that nobody acknowledged.
    pub no_ack: u64,
    /// Its own memory for frames was full.
    pub overflow: u64,
    /// It became [`ControllerState::Warning`].
    pub warning: u64,
    /// It became [`ControllerState::Passive`].
    pub passive: u64,
    /// It became [`ControllerState::BusOff`].
    pub bus_off: u64,
    /// It was started again after that.
    pub restarted: u64,
    /// Error frames that don't tell a kind: what stands in those of most adapters of python-can differs from maker to
    /// maker.
    pub other: u64,
}

impl ControllerErrors {
    /// Whether it has told of none.
    pub fn is_none(&self) -> bool {
        *self == ControllerErrors::default()
    }
}
