//! What a real-time thread asks for and does not get.

use core::fmt;

use serde::Serialize;

/// Something that a real-time thread needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wanted {
    /// Real-time scheduling by `SCHED_FIFO`.
    Priority,
    /// Memory locked into RAM.
    MemoryLock,
    /// A core to stay on.
    Core,
    /// Timers that aren't delayed to save power.
    TimerSlack,
    /// Cores that don't fall into idle states.
    CoresAwake,
}

/// Something that was asked for and refused.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Shortfall {
    /// Setting that the operating system denied.
    pub wanted: Wanted,
    /// The same in words, with its number.
    pub what: String,
    /// Error that the system returned.
    pub why: String,
    /// Way to get the setting granted.
    #[serde(rename = "mend")]
    pub fix: String,
}

impl fmt::Display for Shortfall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no {}: {}; to fix: {}", self.what, self.why, self.fix)
    }
}
