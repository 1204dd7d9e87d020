//! Forced periodic motions as solutions of a system that continuation can follow.

use core::f64::consts::TAU;

use super::adapt::Spectral;
use super::continuation::System;
use super::fourier::Harmonics;
use super::{Coordinate, HarmonicBalance, Oscillator};

/// R(X, λ) = 0 of harmonic balance, λ being one coordinate.
#[derive(Clone, Debug)]
pub struct ForcedResponse<O: Oscillator> {
    balance: HarmonicBalance<O>,
    coordinate: Coordinate<O::Parameter>,
}

/// Steps must not miss superharmonic resonances, where Ω times one of these is a natural frequency.
const SUPERHARMONICS: [f64; 3] = [1.0, 2.0, 3.0];

/// Steps may miss resonances narrower than this relative width.
const LEAST_DAMPING: f64 = 1e-5;

impl<O: Oscillator> ForcedResponse<O> {
    /// The motions of a balance as a coordinate varies.
    pub fn new(balance: HarmonicBalance<O>, coordinate: Coordinate<O::Parameter>) -> ForcedResponse<O> {
        ForcedResponse { balance, coordinate }
    }

    /// The balance.
    pub fn balance(&self) -> &HarmonicBalance<O> {
        &self.balance
    }

    /// λ.
    pub fn coordinate(&self) -> Coordinate<O::Parameter> {
        self.coordinate
    }
}

impl<O: Oscillator> System for ForcedResponse<O> {
    fn dimension(&self) -> usize {
        self.balance.dimension()
    }

    fn evaluate(&mut self, x: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let n = x.len();
        if !self.balance.set_coordinate(self.coordinate, lambda) {
            return false;
        }
        self.balance.linearise(x);
        self.balance.residual(residual);
        self.balance.jacobian(Harmonics::Integer(self.balance.harmonics()), matrix, n + 1);
        self.balance.by_coordinate(self.coordinate, &mut matrix[n * (n + 1)..n * (n + 1) + n]);
        true
    }

    fn unit(&self) -> &'static str {
        self.balance.unit(self.coordinate)
    }

    /// Half the way to the nearest linear resonance, or, on top of it, half of its half-power bandwidth.
    fn parameter_step_limit(&self, lambda: f64) -> f64 {
        if self.coordinate != Coordinate::FrequencyHz {
            return f64::INFINITY;
        }
        let modes = self.balance.oscillator().modes();
        let limits = modes.iter().flat_map(|mode| {
            SUPERHARMONICS.map(|order| {
                let resonance_hz = mode.frequency_rad_s / (TAU * order);
                (0.5 * (lambda - resonance_hz).abs()).max(mode.damping_ratio.max(LEAST_DAMPING) * resonance_hz)
            })
        });
        limits.fold(f64::INFINITY, f64::min)
    }
}

impl<O: Oscillator> Spectral for ForcedResponse<O> {
    type Oscillator = O;

    fn balance_mut(&mut self) -> &mut HarmonicBalance<O> {
        &mut self.balance
    }

    fn others(&self) -> usize {
        0
    }

    fn set_harmonics(&mut self, harmonics: usize) {
        self.balance.set_harmonics(harmonics);
    }
}
