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

pub mod spectra;

#[cfg(test)]
mod tests;
