//! The states and errors that a CAN controller reports.

use serde::Serialize;

/// A CAN controller's state by its error counters (ISO 11898-1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum ControllerState {
    /// Error-active: it takes part. Also that of a controller that has reported nothing yet.
    #[default]
    #[serde(rename = "error-active")]
    Active,
    /// Still error-active, with 96 transmit or receive errors or more.
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
    /// Returns the name of the state in text.
    pub const fn name(self) -> &'static str {
        match self {
            ControllerState::Active => "error-active",
            ControllerState::Warning => "error-warning",
            ControllerState::Passive => "error-passive",
            ControllerState::BusOff => "bus-off",
        }
    }
}

/// The errors that the controller of this end has reported, by kind: each report counts as one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ControllerErrors {
    /// Faults seen on the wire: of a bit, the stuffing, the form, or the CRC.
    pub protocol: u64,
    /// Frames that no node acknowledged.
    pub no_ack: u64,
    /// The controller's memory for frames was full.
    pub overflow: u64,
    /// Number of times it entered [`ControllerState::Warning`].
    pub warning: u64,
    /// Number of times it entered [`ControllerState::Passive`].
    pub passive: u64,
    /// Number of times it entered [`ControllerState::BusOff`].
    pub bus_off: u64,
    /// Number of times that the controller was started again after bus-off.
    pub restarted: u64,
    /// Error frames of unknown kind: most adapters of python-can have a content that differs from maker to maker.
    pub other: u64,
}
