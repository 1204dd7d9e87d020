//! Structures by integration in time: stepped sweeps of the frequency or the amplitude of the drive or of any parameter
//! of the structure, settled motions and their sections at phase 0, the paths between the points of a section, basins
//! of attraction.

mod basins;
mod frequencies;
mod map;
mod measure;
mod path;
mod sweep;

pub use basins::{StableMotion, outcomes, reach, stable_motions};
pub use frequencies::{Resonance, SweepFrequencies};
pub use map::StroboscopicMap;
pub use measure::{Settled, settle};
pub use path::{path, section_point};
pub use sweep::Sweep;

#[cfg(test)]
mod tests;
