//! The ends of a case before its script is over.

use super::times::ms;
use resonarm_bus::BusError;

/// Reason why a case ends early.
#[derive(Debug)]
pub(super) enum Stop {
    /// The node does what it must not. This may be due to a hold-up of the tester.
    Failed(String),
    /// A frame of the node is wrong, regardless of hold-ups.
    Wrong(String),
    /// The node doesn't do in time what it must: this may be due to a stop of the node.
    Late(String),
    /// The node does what it must, but too late: it may have been stopped often, too briefly to be noticed.
    Slow(String),
    /// The node does what is a fault unless it is chance: it fails if it does so in each of several tries.
    Chance(String),
    /// The case is undecided.
    Inconclusive(String),
    /// The case is not to be tried, or can't be here.
    Skipped(String),
    /// The bus is lost.
    Bus(BusError),
}

impl From<BusError> for Stop {
    fn from(error: BusError) -> Stop {
        Stop::Bus(error)
    }
}

pub(super) fn failed<T>(text: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::Failed(text.into()))
}

pub(super) fn wrong<T>(text: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::Wrong(text.into()))
}

pub(super) fn late<T>(text: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::Late(text.into()))
}

/// The required message, in words, came this much later.
pub(super) fn slow<T>(text: impl Into<String>, late_ns: u64) -> Result<T, Stop> {
    Err(Stop::Slow(format!("{}, but {} later", text.into(), ms(late_ns))))
}

/// A message required at once came later, in words.
pub(super) fn not_at_once<T>(text: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::Slow(text.into()))
}

pub(super) fn skipped<T>(text: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::Skipped(text.into()))
}

pub(super) fn inconclusive<T>(text: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::Inconclusive(text.into()))
}
