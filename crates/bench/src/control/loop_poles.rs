//! Poles of the control loop, with filter, feedback and delay around all modes.
//!
//! The filter passes the structure's other modes, weakly and late, so that the feedback can drive them. The
//! gain is therefore computed: the largest one for which the loop is stable, even if the command is two samples
//! late.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::DMatrix;

use super::fourier_filter::unit;
use super::mode_model::{ModeModel, SeenMode};
use crate::excitation::Phasor;
use crate::rig::Sampling;
use crate::rig::converter::MOST_ORDER;
use resonarm_dynamics::structure::mode_transient;

/// The loop of an envelope feedback at one drive frequency.
#[derive(Clone, Copy, Debug)]
pub struct Loop {
    /// Mode that is controlled, with the other modes.
    pub model: ModeModel,
    /// Sampling of the accelerometers.
    pub sampling: Sampling,
    /// Adaptation µ of the filter, per sample.
    pub adaptation: f64,
    /// Gain g of the feedback, 1/s.
    pub gain_1_s: f64,
    /// Angular frequency of the drive, rad/s.
    pub omega_rad_s: f64,
    /// Number of samples by which a command acts late, in addition to the one that it always takes.
    pub delay: usize,
}

/// Number of filter states: the constant, three orders, the tone of the other mode.
const FILTER: usize = 9;
/// Least size of the matrix: that of two modes under a delay of 18 samples with the longest converter filter.
const STATES: usize = 36;
/// Nodes and weights of Gauss–Legendre quadrature with five points, over a hold from 0 to 1.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668_01, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_44, 0.239_314_335_249_683_24),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_6, 0.239_314_335_249_683_24),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

impl SeenMode {
    /// Returns s(t) and ṡ(t) of a mode from s(0), ṡ(0) under a load u held for a time t: s − s∞ with s∞ =
    /// u/(mω²) rings with e^{−ζωt}, ω_d = ω√(1 − ζ²), or decays for ζ ≥ 1. The acceleration of a rigid mode,
    /// u/m, does not depend on its share, so that no loop feels it: the share is left at 0.
    fn advance(&self, [s, rate]: [f64; 2], u: f64, t_s: f64) -> [f64; 2] {
        let SeenMode { angular_frequency_rad_s: omega, damping_ratio: zeta, modal_mass: mass } = *self;
        if omega == 0.0 {
            return [0.0, 0.0];
        }
        // Deviations from the static rest position under u obey the free equation of motion.
        let rest = u / (mass * omega * omega);
        let sigma = zeta * omega;
        if zeta >= 1.0 {
            let [c, s_of_rate] = mode_transient(omega, zeta, t_s);
            let x = s - rest;
            let moved = c * x + s_of_rate * (rate + sigma * x);
            return [rest + moved, (c - sigma * s_of_rate) * rate - omega * omega * s_of_rate * x];
        }
        let damped = omega * libm::sqrt(1.0 - zeta * zeta);
        let (sine, cosine) = libm::sincos(damped * t_s);
        let decay = libm::exp(-sigma * t_s);
        let x = s - rest;
        let b = (rate + sigma * x) / damped;
        let y = decay * (x * cosine + b * sine);
        let dy = decay * ((b * damped - sigma * x) * cosine - (x * damped + sigma * b) * sine);
        [rest + y, dy]
    }

    fn acceleration(&self, [s, rate]: [f64; 2], u: f64) -> f64 {
        let SeenMode { angular_frequency_rad_s: omega, damping_ratio: zeta, modal_mass: mass } = *self;
        u / mass - 2.0 * zeta * omega * rate - omega * omega * s
    }
}

impl Loop {
    /// Number of partial sums of the converter's filter.
    fn sums(&self) -> usize {
        self.sampling.converter.order().saturating_sub(1)
    }

    /// Number of states of the structure: share and rate of each mode.
    fn moving(&self) -> usize {
        2 * (1 + self.model.others().len())
    }

    /// Number of states of the whole loop.
    fn size(&self) -> usize {
        self.moving() + self.sums() + FILTER + 1 + self.delay
    }

    /// Advances the linear loop by one sample: the structure under the held load, the reading of its
    /// acceleration, filter, command.
    ///
    /// The filter's coefficients are taken as z = c e^{ihθ}, which rotate by a constant angle per sample, so the loop
    /// does not depend on time. The command Re(2iωm g (−a) e^{iθ⁺}) with a = −c_1/(ω² G), G the converter's gain, and
    /// θ⁺ = θ + (1 + l) ωT, l the number of holds by which a reading is late, is Re(2i m g/(ωG) e^{i(1+l)ωT} z_1).
    fn step(&self, x: &[f64]) -> Vec<f64> {
        let period_s = 1.0 / self.sampling.rate_hz;
        let model = &self.model;
        let (structure, rest) = x.split_at(self.moving());
        let (sums, rest) = rest.split_at(self.sums());
        let (filter, commands) = rest.split_at(FILTER);
        let mut next = Vec::with_capacity(x.len());
        // The acting load is the oldest pending command.
        let contributions = self.hold(structure, commands[0], &mut next);
        let y = contributions[0] + sums.first().unwrap_or(&0.0);
        next.extend((0..sums.len()).map(|late| contributions[late + 1] + sums.get(late + 1).unwrap_or(&0.0)));
        let error = y - filter[0] - filter[1] - filter[3] - filter[5] - filter[7];
        let gain = 2.0 * self.adaptation * error;
        next.push(filter[0] + gain);
        // The command acts from the next sample on, and the reading is late by the holds of the converter: the
        // feedback is turned ahead by both.
        let omega = self.omega_rad_s;
        let ahead_rad = (1.0 + self.sampling.converter.holds_late() as f64) * omega * period_s;
        let droop = self.sampling.gain(omega / TAU);
        let steps = [omega, 2.0 * omega, 3.0 * omega, model.tone_rad_s()];
        let mut command = 0.0;
        for (index, step) in steps.iter().enumerate() {
            let z = Phasor::new(filter[1 + 2 * index] + gain, filter[2 + 2 * index]);
            if index == 0 {
                let feedback = Phasor::new(0.0, 2.0 * model.mode.modal_mass * self.gain_1_s / (omega * droop));
                command = (feedback * unit(ahead_rad) * z).re;
            }
            // In these coordinates every coefficient rotates by a constant angle, so the loop is time-invariant
            // and has eigenvalues.
            let turned = z * unit(step * period_s);
            next.extend([turned.re, turned.im]);
        }
        next.extend(&commands[1..]);
        next.push(command);
        next
    }

    /// Advances the structure over a hold of the load `u` and appends its states to `next`. Returns the
    /// contributions of its acceleration to the readings after this hold and the following ones.
    fn hold(&self, structure: &[f64], u: f64, next: &mut Vec<f64>) -> [f64; MOST_ORDER] {
        let period_s = 1.0 / self.sampling.rate_hz;
        let converter = self.sampling.converter;
        let modes = core::iter::once(&self.model.mode).chain(self.model.others());
        let mut read = [0.0; MOST_ORDER];
        for (mode, state) in modes.zip(structure.chunks_exact(2)) {
            let start = [state[0], state[1]];
            let at = |x: f64| mode.acceleration(mode.advance(start, u, x * period_s), u);
            next.extend(mode.advance(start, u, period_s));
            // An instantaneous converter reads the middle of the hold.
            if converter.order() == 0 {
                read[0] += at(0.5);
            }
            for (x, weight) in GAUSS {
                let acceleration = weight * at(x);
                for (piece, sum) in read.iter_mut().enumerate().take(converter.order()) {
                    *sum += acceleration * converter.piece(piece, x)[0];
                }
            }
        }
        read
    }

    /// Returns the matrix of one sample: its columns are the unit states one sample later. Unused states stay
    /// zero.
    fn matrix(&self) -> DMatrix<f64> {
        let size = self.size();
        let whole = size.max(STATES);
        let mut matrix = DMatrix::zeros(whole, whole);
        for column in 0..size {
            // The loop is linear, so its action on the unit states is its matrix.
            let mut state = alloc::vec![0.0; size];
            state[column] = 1.0;
            for (row, value) in self.step(&state).into_iter().enumerate() {
                matrix[(row, column)] = value;
            }
        }
        matrix
    }
}

/// Returns the decay rate of the slowest motion of the loop, 1/s: −ln|λ|/T of the largest eigenvalue; negative
/// if it grows.
pub fn slowest_decay_1_s(control: &Loop) -> f64 {
    // The loop is stable if every eigenvalue of one sample lies within the unit circle.
    let largest = control.matrix().complex_eigenvalues().iter().map(|e| libm::hypot(e.re, e.im)).fold(0.0, f64::max);
    -libm::log(largest) * control.sampling.rate_hz
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{ModeNumber, Modelled};
    use crate::plant::tests;
    use crate::rig::{Converter, Load, RigSpec};

    fn control(mode: ModeNumber, converter: Converter, gain_1_s: f64, delay: usize) -> Loop {
        let tested = tests::preset([30.0, 60.0]);
        let of = Modelled::new(&tested, &RigSpec::default()).unwrap();
        let model = ModeModel::new(&of, &Load::force_n(1.0, 0.0), 1.0, mode).unwrap();
        let sampling = Sampling { rate_hz: 1000.0, converter };
        let omega_rad_s = model.mode.angular_frequency_rad_s;
        Loop { model, sampling, adaptation: 5.0 * gain_1_s / 1000.0, gain_1_s, omega_rad_s, delay }
    }

    /// An overdamped mode, and a critical one, follow their equation of motion: two halves of a hold are the whole, and the
    /// rate changes as the acceleration says. Of a rigid one only the acceleration u/m counts.
    #[test]
    fn overdamped_and_rigid_modes_follow_their_equation() {
        for zeta in [1.0, 1.4, 30.0] {
            let mode = SeenMode { angular_frequency_rad_s: 40.0, damping_ratio: zeta, modal_mass: -2.5 };
            let start = [0.3, -5.0];
            let u = 7.0;
            let t_s = 0.01;
            let whole = mode.advance(start, u, t_s);
            let half = mode.advance(mode.advance(start, u, 0.5 * t_s), u, 0.5 * t_s);
            assert!(
                (whole[0] - half[0]).abs() < 1e-14 && (whole[1] - half[1]).abs() < 1e-12,
                "{zeta}: {whole:?} {half:?}"
            );
            let h = 1e-6;
            let before = mode.advance(start, u, t_s - 1e-6);
            let after = mode.advance(start, u, t_s + 1e-6);
            assert!(((after[0] - before[0]) / (2.0 * h) - whole[1]).abs() < 1e-6, "{zeta}");
            assert!(((after[1] - before[1]) / (2.0 * h) - mode.acceleration(whole, u)).abs() < 1e-4, "{zeta}");
        }
        let rigid = SeenMode { angular_frequency_rad_s: 0.0, damping_ratio: 0.0, modal_mass: 2.0 };
        assert_eq!((rigid.advance([0.0; 2], 7.0, 0.01), rigid.acceleration([0.0; 2], 7.0)), ([0.0; 2], 3.5));
    }

    /// The decay of the slowest eigenvalue equals that of the simulated loop.
    #[test]
    fn the_slowest_pole_gives_the_decay_of_the_loop() {
        for (mode, converter, gain_1_s, delay) in [
            (ModeNumber::FIRST, Converter::Instant, 10.0, 0),
            (ModeNumber::SECOND, Converter::Instant, 22.0, 0),
            (ModeNumber::FIRST, Converter::Sinc5, 10.0, 3),
        ] {
            let control = control(mode, converter, gain_1_s, delay);
            let size = control.size();
            let mut state: Vec<f64> = (0..size).map(|k| if k < control.moving() { 1.0 } else { 0.0 }).collect();
            let norm = |state: &[f64]| libm::sqrt(state.iter().map(|x| x * x).sum::<f64>());
            let first = 20_000;
            let last = 80_000;
            let mut early = 0.0;
            for k in 0..last {
                if k == first {
                    early = norm(&state);
                }
                state = control.step(&state);
                // Keeps the state far from the largest and the smallest number.
                let scale = if norm(&state) > 1e100 || norm(&state) < 1e-100 { 1.0 / norm(&state) } else { 1.0 };
                early *= scale;
                state.iter_mut().for_each(|x| *x *= scale);
            }
            let seen = -libm::log(norm(&state) / early) / f64::from(last - first) * control.sampling.rate_hz;
            let computed = slowest_decay_1_s(&control);
            assert!((seen - computed).abs() < 0.02 * computed.abs().max(1.0), "{mode:?}: {seen} {computed}");
        }
    }
}
