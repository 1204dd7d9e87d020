//! Analysis of the arm by computation instead of simulated measurement: the reference for bench measurements.
//!
//! The linearised arm: natural [`modes`](mod@modes), frequency responses ([`frf`]). The nonlinear arm: periodic motions
//! by harmonic balance, their branches by [`continuation`], stability and bifurcations, backbones. Every structure
//! ([`structure`]): the same, and by integration in time ([`time_domain`]) stepped sweeps, stroboscopic sections, basins
//! of attraction.
//!
//! Harmonic balance is used, not collocation of a boundary value problem: the arm's forced motions are nearly
//! sinusoidal, so a few harmonics describe them, where 40 intervals of degree 4 have 640 unknowns.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod adapt;
mod arm_parameter;
mod backbone;
mod branch;
pub mod continuation;
mod curve;
mod dense;
mod detect;
mod eigenvalues;
mod error;
mod extended;
mod floquet;
mod forced_arm;
mod fourier;
pub mod frf;
mod gauss;
mod grid;
mod harmonic_balance;
mod hill;
mod integrators;
mod locate;
pub mod modes;
mod nearest;
mod orbit;
mod oscillator;
mod peaks;
mod poles;
mod quadrature;
mod readings;
mod resonances;
mod response;
mod rows;
mod spectrum;
mod start;
pub mod structure;
pub mod time_domain;

pub use arm_parameter::{ArmParameter, UnknownArmParameter};
pub use backbone::{Backbone, BackboneOptions, BackbonePoint, Bending, backbone};
pub use branch::{trace, trace_doubled, trace_doublings};
pub use curve::{SingularCurve, SingularPoint, Turn, trace_singular, trace_singular_curves};
pub use error::{AnalysisError, EndedEarly, Place};
pub use extended::{SingularResponse, Singularity};
pub use floquet::{Floquet, Stability, StabilityWork};
pub use forced_arm::ForcedArm;
pub use frf::{Drive, FrequencyResponse, FrfError, Quantity, Response, UnknownTerm, continuous_phase};
pub use grid::frequencies_hz;
pub use harmonic_balance::{Coordinate, HarmonicBalance};
pub use integrators::{EnergyDrift, ModeError, energy_drift, mode_errors};
pub use modes::{Mode, modes};
pub use nearest::{Distances, MeasuredMotion, Nearest, nearest};
pub use orbit::{Bifurcation, BifurcationKind, Branch, BranchOptions, Orbit};
pub use oscillator::{Instant, LinearMode, Linearisation, Oscillator};
pub use peaks::{Maximum, half_power_width_hz, maxima};
pub use poles::{Pole, arm_poles, structure_poles};
pub use readings::Readings;
pub use resonances::response_around;
pub use response::ForcedResponse;
pub use rows::{Row, segments, stretches};

#[cfg(test)]
mod tests;
