//! Recordings at work again: their frames back on a bus, and their runs simulated again.

mod error;
mod player;
mod resimulation;

pub use error::ReplayError;
pub use player::{Playback, Played, play};
pub use resimulation::{Verdict, resimulate};

#[cfg(test)]
mod tests;
