//! Analysis of structures by computation instead of simulated measurement: the reference for bench measurements.
//!
//! The linear part of a structure has frequency responses ([`LinearResponse`]) and modes
//! ([`Assembly::modes`](resonarm_dynamics::structure::Assembly::modes)). For the whole structure, harmonic balance
//! computes periodic responses to a sinusoidal drive, and continuation ([`trace`]) follows their branches in the
//! frequency, the amplitude or any parameter of the structure, with folds, peaks and stability. It also follows the
//! branches that leave a branch, and those that a search finds beside it ([`trace_branches`]), curves of folds and
//! doublings in two coordinates
//! ([`trace_singular`]), and backbones ([`backbone()`]). Integration in time ([`time_domain`]) computes stepped sweeps,
//! stroboscopic sections and basins of attraction.
//!
//! Harmonic balance is used, not collocation of a boundary value problem: forced responses are nearly sinusoidal, so a
//! few harmonics describe them, where 40 intervals of degree 4 have 640 unknowns.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod adapt;
mod backbone;
mod balance;
mod bending;
mod both_ways;
mod branch;
mod branch_options;
mod contact;
pub mod continuation;
mod continuous_phase;
mod crossing;
mod curve;
mod dense;
mod detached;
mod detect;
mod error;
mod floquet;
mod forced;
mod fourier;
mod gauss;
mod grid;
mod history;
mod integrators;
mod linear;
mod nearest;
mod orbit;
mod peaks;
mod phase_zero;
mod poles;
mod quantity;
mod ramp;
mod refusal;
mod resonances;
mod rows;
mod samples;
mod search;
mod singular;
mod spectral;
mod start;
mod start_near;
mod sub_harmonic;
mod switching;
pub mod time_domain;
mod trace_options;
mod unknowns;
mod walk;

pub use backbone::{Backbone, BackboneOptions, BackboneOrbit, backbone};
pub use bending::Bending;
pub use branch::trace;
pub use branch_options::{BifurcationKind, BranchOptions};
pub use continuous_phase::continuous_phase;
pub use curve::{SingularCurve, SingularPoint, TracedCurve, Turn, trace_singular, trace_singular_curves};
pub use detached::{NotSearched, SearchOptions, Searched};
pub use error::{AnalysisError, EndedEarly, Place};
pub use forced::{Coordinate, Forced};
pub use grid::frequencies_hz;
pub use integrators::{EnergyDrift, ModeError, energy_drift, mode_errors};
pub use linear::{FrfError, LinearResponse};
pub use nearest::{Distances, Nearest, nearest};
pub use orbit::{Beat, Bifurcation, Branch, BranchEnd, Orbit, Reading, Stability, Unlocated, Verdict};
pub use peaks::{Maximum, half_power_width_hz, maxima};
pub use phase_zero::phase_zero_state;
pub use poles::{Pole, longest_time_constant_s, structure_poles};
pub use quantity::{Quantity, UnknownQuantity};
pub use refusal::{StartAttempt, StartEnd, StartStructure, StepRefusal};
pub use rows::{segments, stretches};
pub use sub_harmonic::SubHarmonicSearch;
pub use switching::{NotFollowed, Origin, OriginKind, OtherBranch, OtherBranches, OtherOptions, trace_branches};
pub use trace_options::{Assess, TraceOptions};

#[cfg(test)]
mod tests;
