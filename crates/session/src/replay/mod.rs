//! Recordings at work again: their frames back on a bus or against a live controller, their runs simulated again, their
//! responses read again.

mod against;
mod error;
mod player;
mod readings;
mod repetition;
mod resimulation;
mod responses;
mod verdict;
mod wire_controller;
mod wire_responses;

pub use against::{Compared, Difference, DifferenceKind, Regression, play_against};
pub use error::ReplayError;
pub use player::{Playback, Played, play};
pub use readings::{ReadingsVerdict, resimulate_readings};
pub use resimulation::resimulate;
pub use responses::{responses, timed_responses};
pub use verdict::Verdict;

#[cfg(test)]
mod against_tests;
#[cfg(test)]
mod tests;
