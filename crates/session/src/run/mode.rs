//! The three run loops, by name.

use core::fmt;
use core::str::FromStr;

use thiserror::Error;

use resonarm_bus::timed;

/// The run loop that drives the plant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Samples at absolute deadlines of the clock.
    #[default]
    RealTime,
    /// Simulated time: the plant waits for the command that answers each sample.
    Lockstep,
    /// Simulated time without a bus: plant and exciter of the scenario in one loop.
    Free,
}

impl Mode {
    /// All modes of a run.
    pub const ALL: [Mode; 3] = [Mode::RealTime, Mode::Lockstep, Mode::Free];

    /// Returns its name in text.
    pub const fn name(self) -> &'static str {
        match self {
            Mode::RealTime => "real-time",
            Mode::Lockstep => "lockstep",
            Mode::Free => "free",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Mode {
    type Err = UnknownMode;

    fn from_str(text: &str) -> Result<Mode, UnknownMode> {
        let found = Mode::ALL.into_iter().find(|mode| mode.name() == text);
        found.ok_or_else(|| UnknownMode { got: text.to_owned() })
    }
}

/// Error of a text that is not the name of a [`Mode`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("unknown mode `{got}`: it must be one of real-time, lockstep, free")]
pub struct UnknownMode {
    /// Text that names no mode.
    pub got: String,
}

/// Connection between the nodes of a run that has both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Network {
    /// A bus on which every frame arrives at once: each sample is answered before the next.
    Ideal,
    /// A bus with faults, or on which frames take their time: the nodes keep the deadlines of real time.
    Real(Option<timed::Spec>),
}

impl Network {
    /// Returns the name of the bus between the nodes in a recording of both, in a run of this mode.
    pub(super) const fn interface(self, mode: Mode) -> &'static str {
        match (mode, self) {
            (Mode::Free, _) => "none",
            (Mode::Lockstep, Network::Real(Some(_))) => "timed",
            (Mode::RealTime | Mode::Lockstep, _) => "memory",
        }
    }
}
