//! Numbers in messages, random numbers from a seed, discrete Fourier transforms, decimation of series, distributions of
//! statistics, small systems of equations, eigenvalues of real matrices, the widest registers of a processor.
//!
//! `no_std`: no clock, no thread, no file, no socket.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

pub mod decimate;
pub mod dft;
pub mod distribution;
pub mod eigenvalues;
pub mod linear_solve;
pub mod noise;
pub mod number;
pub mod registers;
pub mod seed;

/// A sinusoid against the drive: `Im(phasor · e^{iφ})`, with the drive at `sin φ`. The real part is in phase with the
/// drive.
pub type Phasor = nalgebra::Complex<f64>;
