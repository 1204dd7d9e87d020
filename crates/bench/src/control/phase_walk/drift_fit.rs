//! Fit of an amplitude's drift while it is read, next to a ringing mode.

use core::f64::consts::PI;

use nalgebra::{SMatrix, SVector};

use crate::excitation::Phasor;

/// Number of basis functions: constant; fundamental and its change; two harmonics; the ringing and its change.
const BASIS: usize = 13;

/// Fit of y ≈ c_0 + Re((c_1 + ċ_1 x) e^{iθ}) + Re(c_2 e^{2iθ}) + Re(c_3 e^{3iθ}) + Re((d + ḋ x) e^{iψ}), where x runs
/// from −½ to ½ over the window, θ is the phase of the drive and ψ that of the arm's other mode, which rings for longer
/// than a window: the fit separates its effect on a mean over the window from a drift.
///
/// Least squares weighted by the Hann window w: with the basis p, (Σ w p pᵀ) z = Σ w y p.
#[derive(Clone, Debug)]
pub(super) struct DriftFit {
    samples: u64,
    normal: SMatrix<f64, BASIS, BASIS>,
    moment: SVector<f64, BASIS>,
    /// Sums Σ w y² and, in the next field, Σ w.
    square: f64,
    weight: f64,
}

/// Drift that a fit has found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drift {
    /// Relative change ċ_1/c_1 of the amplitude over the window.
    pub change: Phasor,
    /// Standard deviation of the real and imaginary part of that change, times |c_1|.
    pub deviation: f64,
}

impl DriftFit {
    /// Returns a fit over a window of `samples` samples.
    pub fn new(samples: u64) -> DriftFit {
        DriftFit { samples, normal: SMatrix::zeros(), moment: SVector::zeros(), square: 0.0, weight: 0.0 }
    }

    /// Adds sample `k` of the window, counted from 0, at the phases θ and ψ, rad.
    pub fn add(&mut self, k: u64, phase_rad: f64, other_rad: f64, y: f64) {
        let x = (k as f64 + 0.5) / self.samples as f64 - 0.5;
        // The square root of the Hann window, which is cos² around the middle.
        let taper = libm::cos(PI * x);
        let w = taper * taper;
        let [(s1, c1), (s2, c2), (s3, c3)] = [1.0, 2.0, 3.0].map(|order: f64| libm::sincos(order * phase_rad));
        let (s, c) = libm::sincos(other_rad);
        let p = SVector::from([1.0, c1, s1, x * c1, x * s1, c2, s2, c3, s3, c, s, x * c, x * s]);
        self.normal += p * p.transpose() * w;
        self.moment += p * (w * y);
        self.square += w * y * y;
        self.weight += w;
    }

    /// Returns the drift; `None` if the samples do not determine it.
    ///
    /// White noise of standard deviation σ in n samples causes in ċ_1 the variance 2σ²/n ∫w²x²/(∫wx²)² = 56.2 σ²/n. σ²
    /// is the residual of the fit, (Σ w y² − zᵀ Σ w y p)/Σ w.
    pub fn finish(&self) -> Option<Drift> {
        // √56.2, of the variance above.
        const FACTOR: f64 = 7.5;
        let z = self.normal.cholesky()?.solve(&self.moment);
        // The residual follows from the sums. It is bounded at 0, where rounding may take it below.
        let variance = ((self.square - z.dot(&self.moment)) / self.weight).max(0.0);
        // Re(c e^{iθ}) = Re c cos θ − Im c sin θ.
        let amplitude = Phasor::new(z[1], -z[2]);
        let change = Phasor::new(z[3], -z[4]);
        let deviation = FACTOR * libm::sqrt(variance / self.samples as f64);
        Some(Drift { change: change / amplitude, deviation })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::fourier_filter::{real_product, unit};
    use resonarm_numeric::noise::Noise;

    /// 400 samples, 10 periods, beside ringing that decays and is as large as the fundamental.
    fn fit(mut noise: impl FnMut() -> f64) -> Drift {
        let mut fit = DriftFit::new(400);
        for k in 0..400 {
            let x = (k as f64 + 0.5) / 400.0 - 0.5;
            let phase = 0.157 * k as f64;
            let other = 0.29 * k as f64;
            let c = Phasor::new(3.0, -4.0) * (Phasor::new(0.002, 0.001) * x + 1.0);
            let ringing = real_product(&Phasor::new(2.0, 5.0), &unit(other)) * libm::exp(-0.1 * x);
            let y = 0.3 + real_product(&c, &unit(phase)) + libm::cos(3.0 * phase) + ringing + noise();
            fit.add(k, phase, other, y);
        }
        fit.finish().unwrap()
    }

    #[test]
    fn finds_the_drift_beside_ringing() {
        let Drift { change, deviation } = fit(|| 0.0);
        let error = change - Phasor::new(0.002, 0.001);
        assert!(libm::hypot(error.re, error.im) < 1e-5, "{change}");
        assert!(deviation < 1e-2, "{deviation}");
    }

    /// Over many windows of noise the drift scatters by the stated deviation.
    #[test]
    fn states_its_deviation() {
        let runs = 200;
        let mut noise = Noise::new(1, 0);
        let mut square = 0.0;
        let mut said = 0.0;
        for _ in 0..runs {
            let Drift { change, deviation } = fit(|| 0.1 * noise.normal());
            square += (5.0 * (change.re - 0.002)).powi(2) / f64::from(runs);
            said += deviation / f64::from(runs);
        }
        let ratio = square.sqrt() / said;
        // The deviation of 200 runs is known to within a twentieth.
        assert!((0.85..1.15).contains(&ratio), "{ratio}");
    }
}
