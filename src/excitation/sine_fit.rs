//! The response to a sine: amplitude and phase of several channels at a known frequency.

use core::f64::consts::{PI, TAU};

use nalgebra::{Complex, Matrix3, Vector3};

/// A sinusoid against the drive: `Im(phasor · e^{iφ})`, with the drive at `sin φ`. The real part is in phase with the drive.
pub type Phasor = Complex<f64>;

/// The three-parameter sine fit (IEEE Std 1057) over a window, of N channels at once, as the samples come in.
///
/// Each channel is fitted by least squares with y = a sin φ + b cos φ + c, weighted by the Hann window, so that the arm's own
/// modes, which ring at other frequencies, hardly leak in: with w = sin² π(k+½)/n and the basis p = (sin φ, cos φ, 1), solve
/// (Σ w p pᵀ) x = Σ w y p.
#[derive(Clone, Debug)]
pub struct SineFit<const N: usize> {
    samples: u64,
    seen: u64,
    normal: Matrix3<f64>,
    moments: [Vector3<f64>; N],
}

impl<const N: usize> SineFit<N> {
    /// A fit over a window of `samples` samples.
    pub fn new(samples: u64) -> SineFit<N> {
        SineFit { samples, seen: 0, normal: Matrix3::zeros(), moments: [Vector3::zeros(); N] }
    }

    /// Takes in the sample number `k` of the window (0 is the first), at the phase `phase_cycles` of the drive.
    pub fn add(&mut self, k: u64, phase_cycles: f64, values: &[f64; N]) {
        let taper = libm::sin(PI * ((k as f64 + 0.5) / self.samples as f64));
        let weight = taper * taper;
        let (sine, cosine) = libm::sincos(TAU * phase_cycles);
        let basis = Vector3::new(sine, cosine, 1.0);
        self.normal += basis * basis.transpose() * weight;
        for (moment, value) in self.moments.iter_mut().zip(values) {
            *moment += basis * (weight * value);
        }
        self.seen += 1;
    }

    /// How many samples have been taken in.
    pub fn seen(&self) -> u64 {
        self.seen
    }

    /// The channels' phasors; `None` if the samples do not determine them.
    pub fn finish(&self) -> Option<[Phasor; N]> {
        let cholesky = self.normal.cholesky()?;
        Some(self.moments.map(|moment| {
            let x = cholesky.solve(&moment);
            Phasor::new(x.x, x.y)
        }))
    }
}
