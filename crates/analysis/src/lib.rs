//! Analysis of structures by computation instead of simulated measurement: the reference for bench measurements.
//!
//! The linear structure: natural modes, frequency responses ([`frf`]). The nonlinear structure ([`structure`]): periodic
//! motions by harmonic balance, their branches by [`continuation`], stability and bifurcations, backbones; and by
//! integration in time ([`time_domain`]) stepped sweeps, stroboscopic sections, basins of attraction.
//!
//! Harmonic balance is used, not collocation of a boundary value problem: forced motions are nearly sinusoidal, so a few
//! harmonics describe them, where 40 intervals of degree 4 have 640 unknowns.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod bending;
mod branch_options;
pub mod continuation;
mod dense;
mod eigenvalues;
mod error;
mod fourier;
pub mod frf;
mod gauss;
mod grid;
mod integrators;
mod nearest;
mod peaks;
mod poles;
mod resonances;
mod rows;
mod search;
pub mod structure;
pub mod time_domain;

pub use bending::Bending;
pub use branch_options::{BifurcationKind, BranchOptions};
pub use error::{AnalysisError, EndedEarly, Place};
pub use frf::{FrfError, Quantity, UnknownQuantity, continuous_phase};
pub use grid::frequencies_hz;
pub use integrators::{EnergyDrift, ModeError, energy_drift, mode_errors};
pub use nearest::Distances;
pub use peaks::{Maximum, half_power_width_hz, maxima};
pub use poles::{Pole, longest_time_constant_s, structure_poles};
pub use rows::{segments, stretches};

#[cfg(test)]
mod tests;
