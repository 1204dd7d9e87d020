//! Analysis of any structure: a planar chain of links or vibration modes, with point elements.
//!
//! Of the linear part: frequency responses ([`LinearResponse`]); its modes are
//! [`Assembly::modes`](resonarm_dynamics::structure::Assembly::modes). Of all of it: periodic motions under a
//! sinusoidal drive by harmonic balance, their branches by continuation ([`trace`]) in the frequency, the amplitude or
//! any parameter of the structure, with folds, peaks and stability, branches of doubled period ([`trace_doubled`]),
//! curves of folds and doublings in two coordinates ([`trace_singular`]), and backbones ([`backbone()`]); and by integration in time ([`time_domain`]).

mod adapt;
mod backbone;
mod balance;
mod branch;
mod curve;
mod detect;
mod floquet;
mod forced;
mod history;
mod linear;
mod nearest;
mod orbit;
mod phase_zero;
mod ramp;
mod samples;
mod singular;
mod spectral;
pub mod time_domain;
mod unknowns;
mod walk;

use phase_zero::phase_zero_states;

pub use backbone::{Backbone, BackboneMotion, BackboneOptions, backbone};
pub use branch::{trace, trace_doubled, trace_doublings};
pub use curve::{SingularCurve, SingularPoint, TracedCurve, Turn, trace_singular, trace_singular_curves};
pub use forced::{Coordinate, Forced};
pub use linear::LinearResponse;
pub use nearest::{Nearest, nearest};
pub use orbit::{Assess, Bifurcation, Branch, Orbit, Reading, Stability, TraceOptions, Unlocated};

#[cfg(test)]
mod tests;
