//! Fit of the response to a sine: harmonics of several channels at a known frequency.

use core::f64::consts::{PI, TAU};

use nalgebra::{SMatrix, SVector};

pub use resonarm_numeric::Phasor;

/// Fit of the fundamental alone: the three-parameter sine fit of IEEE Std 1057, "IEEE Standard for Digitizing
/// Waveform Recorders", 2007.
pub type SineFit<const N: usize> = HarmonicFit<N, 3>;

/// Fit of harmonics 1 … (P − 1)/2 over a window, of N channels at once, as the samples come in; P is odd.
///
/// Each channel is fitted by least squares with y = c + Σ_h (a_h sin hφ + b_h cos hφ), weighted by the Hann window, so
/// that the arm's modes, ringing at other frequencies, hardly leak in: with w = sin² π(k+½)/n and the basis p = (1, sin
/// φ, cos φ, sin 2φ, …), solve (Σ w p pᵀ) x = Σ w y p. Each channel sums only over its own samples: clipped ones are
/// left out and do not shift the rest.
#[derive(Clone, Debug)]
pub struct HarmonicFit<const N: usize, const P: usize> {
    samples: u64,
    /// Normal matrix Σ w p pᵀ over all samples.
    normal: SMatrix<f64, P, P>,
    /// Normal matrices of the channels that lack samples.
    own_normals: [Option<SMatrix<f64, P, P>>; N],
    moments: [SVector<f64, P>; N],
}

impl<const N: usize, const P: usize> HarmonicFit<N, P> {
    /// Returns a fit over a window of `samples` samples.
    pub fn new(samples: u64) -> HarmonicFit<N, P> {
        HarmonicFit { samples, normal: SMatrix::zeros(), own_normals: [None; N], moments: [SVector::zeros(); N] }
    }

    /// Adds sample `k` of the window, counted from 0, at the phase `phase_cycles` of the drive. A channel
    /// without a value has no sample.
    pub fn add(&mut self, k: u64, phase_cycles: f64, values: &[Option<f64>; N]) {
        // Half a sample in, so that the window is symmetric and no sample has weight zero.
        let taper = libm::sin(PI * ((k as f64 + 0.5) / self.samples as f64));
        let weight = taper * taper;
        let mut basis = SVector::<f64, P>::zeros();
        basis[0] = 1.0;
        for order in 1..=P / 2 {
            let (sine, cosine) = libm::sincos(TAU * (order as f64 * phase_cycles));
            basis[2 * order - 1] = sine;
            basis[2 * order] = cosine;
        }
        let square = basis * basis.transpose() * weight;
        for (channel, value) in values.iter().enumerate() {
            let own_normal = &mut self.own_normals[channel];
            let Some(value) = value else {
                // From its first missing sample on the channel has a normal matrix of its own, which starts
                // from the shared one. Without clipping, all channels share one matrix.
                own_normal.get_or_insert(self.normal);
                continue;
            };
            if let Some(own_normal) = own_normal {
                *own_normal += square;
            }
            self.moments[channel] += basis * (weight * value);
        }
        self.normal += square;
    }

    /// Returns the normal matrix Σ w p pᵀ of a channel.
    fn normal(&self, channel: usize) -> &SMatrix<f64, P, P> {
        self.own_normals[channel].as_ref().unwrap_or(&self.normal)
    }

    /// Returns the phasor of each channel's fundamental; `None` if the samples do not determine it.
    pub fn finish(&self) -> Option<[Phasor; N]> {
        Some(self.harmonics::<1>()?.map(|[fundamental]| fundamental))
    }

    /// Returns the phasors of each channel's harmonics 1, 2, … `ORDERS`; `None` if the samples do not determine
    /// them.
    pub fn harmonics<const ORDERS: usize>(&self) -> Option<[[Phasor; ORDERS]; N]> {
        const { assert!(2 * ORDERS < P, "more harmonics than are fitted") };
        let mut all = [[Phasor::new(0.0, 0.0); ORDERS]; N];
        for (channel, (harmonics, moment)) in all.iter_mut().zip(&self.moments).enumerate() {
            let x = self.normal(channel).cholesky()?.solve(moment);
            *harmonics = core::array::from_fn(|index| Phasor::new(x[2 * index + 1], x[2 * index + 2]));
        }
        Some(all)
    }
}
