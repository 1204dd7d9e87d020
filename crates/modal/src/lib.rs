//! Modal testing: from measured time series to spectra, frequency responses, poles and mode shapes, with deviations that
//! can be trusted.
//!
//! [`spectra`] averages windowed segments into power and cross spectra ([`spectra::CrossSpectra`]) and frequency
//! responses ([`spectra::FrequencyResponses`]), as a signal analyser does.
//!
//! Channels are slices of samples at equal intervals. Units are those of the caller: a force in N and an acceleration in
//! m/s² give frequency responses in (m/s²)/N and residues in 1/(kg·rad/s).
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
    Shape, Warning, assurance,
};
pub use run::{Band, Channel, Record, ResponseFunction, TransientModel};
pub use start::{Cluster, OrderPoles, Stabilisation};

#[cfg(test)]
mod tests;
