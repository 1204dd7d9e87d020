//! Nonlinear dynamics of the arm: periodic motions, their branches, stability and bifurcations.

mod dense;
mod error;
mod forced_arm;
mod fourier;
mod harmonic_balance;
mod oscillator;
mod spectrum;

pub use error::AnalysisError;
pub use forced_arm::{ArmParameter, ForcedArm};
pub use harmonic_balance::{Coordinate, HarmonicBalance};
pub use oscillator::{Instant, Linearisation, Oscillator};
