//! Structures by integration in time, as [`crate::time_domain`] has the arm: stepped sweeps, settled motions, basins of
//! attraction.

mod basins;
mod frequencies;
mod map;
mod measure;

pub use basins::{StableMotion, outcomes, reach, stable_motions};
pub use frequencies::{Resonance, SweepFrequencies};
pub use map::StroboscopicMap;
pub use measure::{Settled, settle};

#[cfg(test)]
mod tests;
