//! Nonlinear dynamics of the arm: periodic motions, their branches, stability and bifurcations.

mod branch;
pub mod continuation;
mod dense;
mod extended;
mod error;
mod floquet;
mod forced_arm;
mod fourier;
mod harmonic_balance;
mod locate;
mod oscillator;
mod response;
mod spectrum;

pub use branch::{Bifurcation, BifurcationKind, Branch, BranchOptions, Orbit, trace};
pub use error::AnalysisError;
pub use forced_arm::{ArmParameter, ForcedArm};
pub use harmonic_balance::{Coordinate, HarmonicBalance};
pub use oscillator::{Instant, LinearMode, Linearisation, Oscillator};
pub use floquet::{Floquet, Stability};
pub use response::ForcedResponse;

#[cfg(test)]
mod tests;
