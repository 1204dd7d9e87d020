//! What can go wrong with a bus, each with the way to mend it.

use alloc::string::String;

use thiserror::Error;

/// Why a bus could not be opened or used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BusError {
    /// The bus was closed by this end.
    #[error("the bus is closed")]
    Closed,
    /// The address is not one that any backend understands.
    #[error(
        "`{address}` is not a bus: {reason}. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0"
    )]
    Address {
        /// What was given.
        address: String,
        /// What is wrong with it.
        reason: String,
    },
}
