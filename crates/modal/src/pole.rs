//! Poles and what they stand for.

use core::f64::consts::TAU;

use nalgebra::Complex;

use crate::complex::magnitude;

/// Returns the natural frequency |λ|/2π of a pole, Hz.
pub(crate) fn frequency_hz(pole: Complex<f64>) -> f64 {
    magnitude(pole) / TAU
}

/// Returns the damping ratio −Re λ/|λ|.
pub(crate) fn damping_ratio(pole: Complex<f64>) -> f64 {
    -pole.re / magnitude(pole)
}

/// Returns the pole of a natural frequency and damping ratio, with positive imaginary part.
pub(crate) fn pole(frequency_hz: f64, damping_ratio: f64) -> Complex<f64> {
    let damped = libm::sqrt(1.0 - damping_ratio * damping_ratio);
    Complex::new(-damping_ratio, damped) * (TAU * frequency_hz)
}

/// Returns the standard deviations of frequency, Hz, and damping ratio, from the covariance of Re λ and Im λ, to first
/// order.
pub(crate) fn deviations(pole: Complex<f64>, covariance: [[f64; 2]; 2]) -> [f64; 2] {
    let size = magnitude(pole);
    let a = pole.re;
    let b = pole.im;
    let cube = size * size * size;
    let of = |gradient: [f64; 2]| {
        let [x, y] = gradient;
        let variance = x * x * covariance[0][0] + 2.0 * x * y * covariance[0][1] + y * y * covariance[1][1];
        libm::sqrt(variance.max(0.0))
    };
    // d|λ| = (a da + b db)/|λ|, and d(−a/|λ|) = (−b² da + ab db)/|λ|³.
    [of([a / (TAU * size), b / (TAU * size)]), of([-b * b / cube, a * b / cube])]
}

/// Returns the block of a pole in a covariance of (Re λ, Im λ) of `poles` poles by rows.
pub(crate) fn block(covariance: &[f64], poles: usize, pole: usize) -> [[f64; 2]; 2] {
    let at = |i: usize, j: usize| covariance[(2 * pole + i) * 2 * poles + 2 * pole + j];
    [[at(0, 0), at(0, 1)], [at(1, 0), at(1, 1)]]
}
