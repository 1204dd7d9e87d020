//! Structures by integration in time: the reference for bench measurements and computed branches. The module computes
//! stepped sweeps of the frequency or the amplitude of the drive or of any parameter, settled responses and their
//! sections at phase 0, the paths between the points of a section, and basins of attraction.
//!
//! The state is sampled once a period of the excitation, always at phase 0: that is the stroboscopic map. A response
//! that repeats after n periods is a fixed point of its nth power, a quasi-periodic one a closed curve, a chaotic one a
//! scatter. The map is followed until the end of the transient is proved ([`SettleOptions`]), or from many states to
//! the fixed points that they reach ([`BasinOutcome`]).

mod basins;
mod error;
mod fates;
mod fixed_point;
mod frequencies;
mod hysteresis;
mod map;
mod measure;
mod path;
mod settle;
mod sweep;

pub use basins::{StableOrbit, further_orbits, outcomes, reach, stable_orbits};
pub use error::TimeDomainError;
pub use fates::BasinOutcome;
pub use frequencies::{Resonance, SweepFrequencies};
pub use hysteresis::hysteresis;
pub use map::StroboscopicMap;
pub use measure::{Settled, settle};
pub use path::{path, section_point};
pub use settle::SettleOptions;
pub use sweep::{Direction, Grid, Sweep};

#[cfg(test)]
mod tests;
