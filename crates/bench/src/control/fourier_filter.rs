//! Adaptive Fourier filter: harmonics of a signal of known phase, updated sample by sample.

use core::f64::consts::PI;

use crate::excitation::Phasor;

/// Number of harmonics in the model, the constant included.
const HARMONICS: usize = 4;

/// Tracks y ≈ Σ_h Re(c_h e^{ihθ}), h = 0 … 3, and one further tone, Re(d e^{iψ}), which the drive does not
/// cause: the arm's other mode, which would otherwise leak into the fundamental.
///
/// Least mean squares (B. Widrow, M. E. Hoff, "Adaptive Switching Circuits", IRE WESCON Conv. Rec. 4 (1960)): with the
/// error e = y − Σ of a sample, c_h += 2µ e e^{−ihθ}, and d likewise; c_0 is real. A coefficient follows with the rate
/// µ a sample. In a closed loop it is more precise, sooner, than a lock-in of equal bandwidth, since the harmonics are
/// modelled and not averaged away (P. Hippold, M. Scheel, L. Renson, M. Krack, "Robust and fast backbone tracking via
/// phase-locked loops", 2024, arXiv:2403.06639).
#[derive(Clone, Copy, Debug)]
pub struct FourierFilter {
    adaptation: f64,
    /// Rotation of the other tone per sample, rad.
    other_step_rad: f64,
    other_phase_rad: f64,
    coefficients: [Phasor; HARMONICS],
    other: Phasor,
}

impl FourierFilter {
    /// Returns a filter that adapts with the rate `adaptation` per sample (µ, dimensionless, below 1/4), with a
    /// further tone that rotates by `other_step_rad` per sample.
    pub fn new(adaptation: f64, other_step_rad: f64) -> FourierFilter {
        let zero = Phasor::new(0.0, 0.0);
        FourierFilter { adaptation, other_step_rad, other_phase_rad: 0.0, coefficients: [zero; HARMONICS], other: zero }
    }

    /// Updates the filter with the sample `y` at the phase `phase_rad` of the drive.
    pub fn update(&mut self, y: f64, phase_rad: f64) {
        let turn = unit(phase_rad);
        let mut turns = [Phasor::new(1.0, 0.0); HARMONICS];
        for h in 1..HARMONICS {
            turns[h] = turns[h - 1] * turn;
        }
        let other_turn = unit(self.other_phase_rad);
        let model: f64 = self.coefficients.iter().zip(&turns).map(|(c, t)| real_product(c, t)).sum();
        let error = y - model - real_product(&self.other, &other_turn);
        // The gradient of e² with respect to each coefficient, up to the sign: least mean squares steps against
        // it.
        let gain = 2.0 * self.adaptation * error;
        // The constant is real, so its imaginary part is never updated.
        self.coefficients[0].re += gain;
        for (coefficient, t) in self.coefficients.iter_mut().zip(&turns).skip(1) {
            *coefficient += t.conj() * gain;
        }
        self.other += other_turn.conj() * gain;
        // Kept within a turn: a phase that grows for minutes would lose the digits that the sine needs.
        self.other_phase_rad = wrapped(self.other_phase_rad + self.other_step_rad);
    }

    /// Returns the fundamental c_1: the signal contains Re(c_1 e^{iθ}), in its unit.
    pub fn fundamental(&self) -> Phasor {
        self.coefficients[1]
    }
}

/// Returns e^{i angle} for an angle in rad.
pub(super) fn unit(angle_rad: f64) -> Phasor {
    let (sine, cosine) = libm::sincos(angle_rad);
    Phasor::new(cosine, sine)
}

/// Returns the magnitude of a phasor.
pub(super) fn size(phasor: Phasor) -> f64 {
    libm::hypot(phasor.re, phasor.im)
}

/// Returns the real part of a product, Re(a b).
pub(super) fn real_product(a: &Phasor, b: &Phasor) -> f64 {
    a.re * b.re - a.im * b.im
}

/// Returns the same angle within ±π.
pub(super) fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - 2.0 * PI * libm::rint(angle_rad / (2.0 * PI))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_fundamental_beside_harmonics_and_another_tone() {
        let step = 0.139;
        let other_step = 0.8;
        let mut filter = FourierFilter::new(0.05, other_step);
        let wanted = Phasor::new(3.0, -4.0);
        for k in 0..2000 {
            let phase = step * f64::from(k);
            let other_phase = other_step * f64::from(k) + 1.0;
            let y =
                2.0 + real_product(&wanted, &unit(phase)) + 0.5 * libm::cos(3.0 * phase) + 7.0 * libm::cos(other_phase);
            filter.update(y, phase);
        }
        let error = filter.fundamental() - wanted;
        assert!(libm::hypot(error.re, error.im) < 1e-6, "{error}");
    }
}
