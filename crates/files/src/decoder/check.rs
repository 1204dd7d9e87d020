//! Reasons for which a receiver rejects a frame.

use thiserror::Error;

use resonarm_bench::node::mapped::mapping::{ProtectionFault, Unreadable};
use resonarm_wire::canopen::listen::Malformed;

/// Why the receiver of a message refuses a frame of it.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Fault {
    /// The payload ends before a signal that the mapping uses.
    #[error("its {got} bytes end before {signal}")]
    Short {
        /// The bytes of the payload.
        got: usize,
        /// Name of the first signal that does not fit into the payload.
        signal: String,
    },
    /// Its checksum or counter is wrong.
    #[error(transparent)]
    Protection(#[from] ProtectionFault),
    /// A signal that the mapping uses is no finite number.
    #[error("{signal} is {value}, no finite number")]
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
    /// Names the kind of fault, without its numbers, for counts.
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
}

impl Fault {
    /// A signal that can't be read in a payload of `got` bytes.
    pub(super) fn of_signal(signal: &str, got: usize, unreadable: Unreadable) -> Fault {
        let signal = signal.to_string();
        match unreadable {
            Unreadable::Short => Fault::Short { got, signal },
            Unreadable::NotFinite(value) => Fault::NotFinite { signal, value },
        }
    }
}
