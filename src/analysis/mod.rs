//! Nonlinear dynamics of the arm: periodic motions, their branches, stability and bifurcations.

mod adapt;
mod backbone;
mod branch;
pub mod continuation;
mod curve;
mod dense;
mod detect;
mod error;
mod extended;
mod floquet;
mod forced_arm;
mod fourier;
mod harmonic_balance;
mod locate;
mod orbit;
mod oscillator;
mod response;
mod spectrum;
mod start;

pub use backbone::{Backbone, BackboneOptions, BackbonePoint, Bending, backbone};
pub use branch::{trace, trace_doubled};
pub use curve::{SingularPoint, trace_singular};
pub use error::AnalysisError;
pub use extended::{SingularResponse, Singularity};
pub use floquet::{Floquet, Stability};
pub use forced_arm::{ArmParameter, ForcedArm};
pub use harmonic_balance::{Coordinate, HarmonicBalance};
pub use orbit::{Bifurcation, BifurcationKind, Branch, BranchOptions, Orbit};
pub use oscillator::{Instant, LinearMode, Linearisation, Oscillator};
pub use response::ForcedResponse;

#[cfg(test)]
mod tests;
