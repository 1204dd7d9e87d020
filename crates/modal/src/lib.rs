//! Modal testing: from measured time series to spectra, frequency responses, poles and mode shapes, with deviations that
//! can be trusted.
//!
//! [`spectra`] averages windowed segments into power and cross spectra ([`spectra::CrossSpectra`]) and frequency
//! responses ([`spectra::FrequencyResponses`]), as a signal analyser does.
//!
//! [`identify_records`] finds the modes of a structure from records of forces and responses, [`identify_responses`] from
//! measured frequency responses. Both return an [`Identification`]:
//!
//! 1. Poles over rising orders, by the poly-reference least-squares complex frequency-domain estimator from averaged frequency
//!    responses, form a stabilisation diagram; clusters of them are the start.
//! 2. The whole record's spectra without a window are fitted by maximum likelihood, with common poles, free residues and the
//!    transient of the record. Averaged frequency responses would be biased by leakage, however good a fit looks.
//! 3. The likelihood decides on the number of modes.
//! 4. Weights follow from the noise of responses and forces, which the residuals show.
//! 5. Every figure has a standard deviation, which counts the noise that all responses have from the force in common. Where
//!    none can be stated honestly, [`Mode::deviations`] says why.
//!
//! [`compare_levels`] tells a nonlinear structure from a linear one by two levels of excitation.
//!
//! Channels are slices of samples at equal intervals, and numbers name their degrees of freedom. Units are those of the
//! caller: with forces in N and accelerations in m/s², shapes are in 1/√kg and modal masses in kg.
//!
//! `no_std`: no clock, no thread, no file, no socket. Transcendental functions are from `libm`, and every sum has a fixed
//! order, so that results are bit-identical on every machine.
#![cfg_attr(not(test), no_std)]

extern crate alloc;
// The example of closed-form records names the crate; tests share it.
#[cfg(test)]
extern crate self as resonarm_modal;

mod cholesky;
mod columns;
mod complex;
mod deviations;
mod doubts;
mod error;
mod fit;
mod identify;
mod model;
mod modes;
mod noise;
mod order;
mod pole;
mod run;
pub mod spectra;
mod start;

pub use doubts::{ModeShift, compare_levels, judge_levels};
pub use error::ModalError;
pub use identify::{Options, Start, identify_records, identify_responses};
pub use model::{Quantity, ResidueKind};
pub use modes::{
    ChannelNoise, Component, Doubt, Floor, Identification, Mode, PoleDeviations, ResidualTerms, Residue, RunReport,
    Shape, Warning, assurance, normal,
};
pub use run::{Band, Channel, Record, ResponseFunction, TransientModel};
pub use start::{Cluster, OrderPoles, Stabilisation};

#[cfg(test)]
mod tests;
