//! Uses of recordings: plays their frames on a bus or to a live controller, re-simulates their runs, and reads their
//! responses again.

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
