//! Poles of the control loop: filter, feedback and delay around both modes.

use alloc::vec::Vec;

use nalgebra::SMatrix;

use super::ModeModel;
use super::fourier_filter::unit;
use crate::excitation::Phasor;

/// The loop of an envelope feedback at one frequency of the drive.
#[derive(Clone, Copy, Debug)]
pub struct Loop {
    /// The mode and its neighbour.
    pub model: ModeModel,
    /// Samples a second, Hz.
    pub rate_hz: f64,
    /// µ of the filter, a sample.
    pub adaptation: f64,
    /// g, 1/s.
    pub gain_1_s: f64,
    /// Angular frequency of the drive, rad/s.
    pub omega_rad_s: f64,
    /// How many samples late a command acts, beyond the one that it takes anyway.
    pub delay: usize,
}

/// States of the arm: angle's share and rate of both modes.
const ARM: usize = 4;
/// States of the filter: the constant, three orders, the other mode's tone.
const FILTER: usize = 9;
/// States of the loop with the largest delay.
const STATES: usize = 32;
/// The largest delay that can be computed, samples.
pub const MOST_DELAY: usize = STATES - ARM - FILTER - 1;

/// A mode held under a constant load for a time t: s(t) and ṡ(t) from s(0), ṡ(0) and u.
struct Oscillator {
    omega: f64,
    zeta: f64,
    mass: f64,
}

impl Oscillator {
    /// s − s∞ with s∞ = u/(mω²) rings with e^{−ζωt}, ω_d = ω√(1 − ζ²).
    fn advance(&self, [s, rate]: [f64; 2], u: f64, t_s: f64) -> [f64; 2] {
        let rest = u / (self.mass * self.omega * self.omega);
        let sigma = self.zeta * self.omega;
        let damped = self.omega * libm::sqrt(1.0 - self.zeta * self.zeta);
        let (sine, cosine) = libm::sincos(damped * t_s);
        let decay = libm::exp(-sigma * t_s);
        let x = s - rest;
        let b = (rate + sigma * x) / damped;
        let y = decay * (x * cosine + b * sine);
        let dy = decay * ((b * damped - sigma * x) * cosine - (x * damped + sigma * b) * sine);
        [rest + y, dy]
    }

    fn acceleration(&self, [s, rate]: [f64; 2], u: f64) -> f64 {
        u / self.mass - 2.0 * self.zeta * self.omega * rate - self.omega * self.omega * s
    }
}

impl Loop {
    /// One sample of the linear loop: the arm under the load held, its acceleration in the middle, filter, command.
    ///
    /// The filter's coefficients are taken as z = c e^{ihθ}, which turn by a constant angle a sample, so the loop does
    /// not depend on time. The command Re(2iωm g (−a) e^{iθ⁺}) with a = −c_1/ω² and θ⁺ = θ + ωT is Re(2i m g/ω e^{iωT}
    /// z_1).
    fn step(&self, x: &[f64]) -> Vec<f64> {
        let period_s = 1.0 / self.rate_hz;
        let model = &self.model;
        let modes = [
            Oscillator { omega: model.angular_frequency_rad_s, zeta: model.damping_ratio, mass: model.modal_mass },
            Oscillator {
                omega: model.other_angular_frequency_rad_s,
                zeta: model.other_damping_ratio,
                mass: model.other_modal_mass,
            },
        ];
        // The load that acts is the oldest on its way.
        let u = x[ARM + FILTER];
        let mut y = 0.0;
        let mut next = Vec::with_capacity(x.len());
        for (mode, state) in modes.iter().zip(x.chunks_exact(2)) {
            let start = [state[0], state[1]];
            y += mode.acceleration(mode.advance(start, u, 0.5 * period_s), u);
            next.extend(mode.advance(start, u, period_s));
        }
        let filter = &x[ARM..ARM + FILTER];
        let error = y - filter[0] - filter[1] - filter[3] - filter[5] - filter[7];
        let gain = 2.0 * self.adaptation * error;
        next.push(filter[0] + gain);
        let omega = self.omega_rad_s;
        let steps = [omega, 2.0 * omega, 3.0 * omega, model.other_angular_frequency_rad_s];
        let mut command = 0.0;
        for (index, step) in steps.iter().enumerate() {
            let z = Phasor::new(filter[1 + 2 * index] + gain, filter[2 + 2 * index]);
            if index == 0 {
                let feedback = Phasor::new(0.0, 2.0 * model.modal_mass * self.gain_1_s / omega);
                command = (feedback * unit(omega * period_s) * z).re;
            }
            let turned = z * unit(step * period_s);
            next.extend([turned.re, turned.im]);
        }
        next.extend(&x[ARM + FILTER + 1..]);
        next.push(command);
        next
    }

    /// The matrix of a sample: its columns are what becomes of the unit states. States beyond those that the delay
    /// takes stay zero.
    fn matrix(&self) -> SMatrix<f64, STATES, STATES> {
        let size = ARM + FILTER + 1 + self.delay;
        let mut matrix = SMatrix::zeros();
        for column in 0..size {
            let mut state = alloc::vec![0.0; size];
            state[column] = 1.0;
            for (row, value) in self.step(&state).into_iter().enumerate() {
                matrix[(row, column)] = value;
            }
        }
        matrix
    }
}

/// How fast the slowest motion of the loop dies out, 1/s: −ln|λ|/T of the largest eigenvalue; negative if it grows.
pub fn slowest_decay_1_s(control: &Loop) -> f64 {
    let largest = control.matrix().complex_eigenvalues().iter().map(|e| libm::hypot(e.re, e.im)).fold(0.0, f64::max);
    -libm::log(largest) * control.rate_hz
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::{Arm, Load, Pose, Preset};
    use crate::control::ModeNumber;

    fn control(mode: ModeNumber, gain_1_s: f64, delay: usize) -> Loop {
        let pose = Pose { beta1_deg: 30.0, beta2_deg: 60.0 };
        let arm = Arm::new(Preset::default().parameters().unwrap(), pose).unwrap();
        let model = ModeModel::new(&arm, &Load::force_n(1.0, 0.0), mode);
        let (rate_hz, omega_rad_s) = (1000.0, model.angular_frequency_rad_s);
        Loop { model, rate_hz, adaptation: 5.0 * gain_1_s / rate_hz, gain_1_s, omega_rad_s, delay }
    }

    /// The decay of the slowest eigenvalue is that of the loop itself, sample by sample.
    #[test]
    fn the_slowest_pole_is_what_remains() {
        for (mode, gain_1_s, delay) in
            [(ModeNumber::First, 10.0, 0), (ModeNumber::Second, 22.0, 0), (ModeNumber::First, 10.0, 3)]
        {
            let control = control(mode, gain_1_s, delay);
            let size = ARM + FILTER + 1 + delay;
            let mut state: Vec<f64> = (0..size).map(|k| if k < ARM { 1.0 } else { 0.0 }).collect();
            let norm = |state: &[f64]| libm::sqrt(state.iter().map(|x| x * x).sum::<f64>());
            let (first, last) = (20_000, 80_000);
            let mut early = 0.0;
            for k in 0..last {
                if k == first {
                    early = norm(&state);
                }
                state = control.step(&state);
                // Far from the largest and the smallest number.
                let scale = if norm(&state) > 1e100 || norm(&state) < 1e-100 { 1.0 / norm(&state) } else { 1.0 };
                early *= scale;
                state.iter_mut().for_each(|x| *x *= scale);
            }
            let seen = -libm::log(norm(&state) / early) / f64::from(last - first) * control.rate_hz;
            let computed = slowest_decay_1_s(&control);
            assert!((seen - computed).abs() < 0.02 * computed.abs().max(1.0), "{mode:?}: {seen} {computed}");
        }
    }
}
