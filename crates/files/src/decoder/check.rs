//! Reasons for which a receiver rejects a frame.

use thiserror::Error;

use resonarm_bench::node::mapped::mapping::{ProtectionFault, Unreadable};
use resonarm_wire::canopen::listen::Malformed;

/// Reason for which the receiver of a message rejects a frame.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Fault {
    /// The payload ends before a signal that the mapping uses.
    #[error("the payload of {got} bytes ends before {signal}")]
    Short {
        /// Number of bytes in the payload.
        got: usize,
        /// Name of the first signal that does not fit into the payload.
        signal: String,
    },
    /// The checksum or counter is wrong.
    #[error(transparent)]
    Protection(#[from] ProtectionFault),
    /// A signal that the mapping uses is not a finite number.
    #[error("{signal} is {value}, expected a finite number")]
    NotFinite {
        /// Name of the signal that is not finite.
        signal: String,
        /// Value of the signal: infinite or NaN.
        value: f64,
    },
    /// A frame of CANopen that breaks its rules.
    #[error(transparent)]
    CanOpen(#[from] Malformed),
}

impl Fault {
    /// Returns the kind of fault, without its numbers, for counts.
    pub const fn kind(&self) -> &'static str {
        match self {
            Fault::Protection(ProtectionFault::Checksum(_)) => "checksum",
            Fault::Protection(ProtectionFault::Counter(_) | ProtectionFault::Lost { .. }) => "counter",
            Fault::Protection(
                ProtectionFault::Format { .. } | ProtectionFault::Long { .. } | ProtectionFault::Short { .. },
            )
            | Fault::Short { .. }
            | Fault::NotFinite { .. }
            | Fault::CanOpen(_) => "form or content",
        }
    }

    /// Makes the fault of a signal that can't be read in a payload of `got` bytes.
    pub(super) fn of_signal(signal: &str, got: usize, unreadable: Unreadable) -> Fault {
        let signal = signal.to_string();
        match unreadable {
            Unreadable::Short => Fault::Short { got, signal },
            Unreadable::NotFinite(value) => Fault::NotFinite { signal, value },
        }
    }
}
