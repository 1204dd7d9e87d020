//! Harmonic balance: periodic motions as Fourier series (M. Krack, J. Gross, "Harmonic Balance for Nonlinear Vibration
//! Problems", 2019, Ch. 2), by alternating between frequency and time (T. M. Cameron, J. H. Griffin, "An Alternating
//! Frequency/Time Domain Method for Calculating the Steady-State Response of Nonlinear Dynamic Systems", J. Appl. Mech.
//! 56 (1989)).
//!
//! With the base frequency ω = Ω/ν (ν = 1, or 2 on a branch of doubled period) and τ = ωt, the unknowns are the
//! coefficients X of α(τ), and the equations state that the unbalanced torque r(α, α̇, α̈, Ωt) has no component along
//! 1, cos kτ, sin kτ, k ≤ H. Row k is divided by the stiffness scale and by max(1, (k/ν)²), so that R is in rad and the
//! rows have similar size.
//!
//! Sampling: r is a product of motions, so its components reach beyond H. With N = 4H + 4 samples the components that
//! alias onto k ≤ H are N − k ≥ 3H + 4, where the series of a smooth motion is negligible; the blocks of the Jacobian
//! are needed up to component 2H + 1 < N/2.

mod forms;

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::{Complex, Matrix2, Vector2};

use super::fourier::{Basis, Harmonics, Motion, largest, mean, uniform};
use super::spectrum::Spectrum;
use super::{Instant, Linearisation, Oscillator};
pub(super) use forms::{FormGradient, Forms};

/// A quantity that can be varied along a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinate<P> {
    /// Ω/2π, Hz.
    FrequencyHz,
    /// A parameter of the system, in its own unit.
    Parameter(P),
}

/// The balance of one system with a number of harmonics, with its storage.
#[derive(Clone, Debug)]
pub struct HarmonicBalance<O: Oscillator> {
    oscillator: O,
    frequency_hz: f64,
    subharmonic: usize,
    harmonics: usize,
    /// Integer frequencies up to 2H + 1.
    basis: Basis,
    /// sin Ωt and cos Ωt at the samples.
    drive: Vec<(f64, f64)>,
    motion: Motion,
    /// r at the samples, by degree of freedom.
    unbalance: [Vec<f64>; 2],
    /// S, G, M at the samples.
    linear: Vec<Linearisation>,
    spectrum: Spectrum,
}

/// Samples for H harmonics; see the module documentation.
fn samples_for(harmonics: usize) -> usize {
    4 * harmonics + 4
}

/// 1 over the stiffness scale and max(1, (k/ν)²).
fn row_scale(order: f64, subharmonic: usize, stiffness: f64) -> f64 {
    let order = order / subharmonic as f64;
    1.0 / (stiffness * (order * order).max(1.0))
}

impl<O: Oscillator> HarmonicBalance<O> {
    /// The balance of motions with the period of the excitation (`subharmonic` 1) or a multiple of it.
    pub fn new(oscillator: O, frequency_hz: f64, subharmonic: usize, harmonics: usize) -> HarmonicBalance<O> {
        let mut balance = HarmonicBalance {
            oscillator,
            frequency_hz,
            subharmonic,
            harmonics,
            basis: Basis::uniform(Harmonics::Integer(0), 0),
            drive: Vec::new(),
            motion: Motion::default(),
            unbalance: [Vec::new(), Vec::new()],
            linear: Vec::new(),
            spectrum: Spectrum::default(),
        };
        balance.set_harmonics(harmonics);
        balance
    }

    /// Changes the number of harmonics H; coefficients X are then 2 (2H + 1) numbers.
    pub fn set_harmonics(&mut self, harmonics: usize) {
        let samples = samples_for(harmonics);
        self.harmonics = harmonics;
        self.basis.set(Harmonics::Integer(2 * harmonics + 1), uniform(samples));
        self.drive.clear();
        let phase = |j: usize| TAU * ((j * self.subharmonic) % samples) as f64 / samples as f64;
        self.drive.extend((0..samples).map(|j| libm::sincos(phase(j))));
    }

    /// H.
    pub fn harmonics(&self) -> usize {
        self.harmonics
    }

    /// ν.
    pub fn subharmonic(&self) -> usize {
        self.subharmonic
    }

    /// The system.
    pub fn oscillator(&self) -> &O {
        &self.oscillator
    }

    /// Number of unknowns.
    pub fn dimension(&self) -> usize {
        2 * Harmonics::Integer(self.harmonics).rows()
    }

    /// The value of a coordinate.
    pub fn coordinate(&self, which: Coordinate<O::Parameter>) -> f64 {
        match which {
            Coordinate::FrequencyHz => self.frequency_hz,
            Coordinate::Parameter(parameter) => self.oscillator.parameter(parameter),
        }
    }

    /// The unit of a coordinate; empty if it has none.
    pub fn unit(&self, which: Coordinate<O::Parameter>) -> &'static str {
        match which {
            Coordinate::FrequencyHz => "Hz",
            Coordinate::Parameter(parameter) => self.oscillator.unit(parameter),
        }
    }

    /// Sets a coordinate; returns whether such a system exists.
    #[must_use]
    pub fn set_coordinate(&mut self, which: Coordinate<O::Parameter>, value: f64) -> bool {
        match which {
            Coordinate::FrequencyHz => {
                let valid = value.is_finite() && value > 0.0;
                if valid {
                    self.frequency_hz = value;
                }
                valid
            }
            Coordinate::Parameter(parameter) => self.oscillator.set_parameter(parameter, value),
        }
    }

    /// ω, rad/s.
    pub(super) fn base_rad_s(&self) -> f64 {
        TAU * self.frequency_hz / self.subharmonic as f64
    }

    /// The factor of the rows of frequency k (in units of ω).
    pub(super) fn row_scale(&self, order: f64) -> f64 {
        row_scale(order, self.subharmonic, self.oscillator.stiffness_scale())
    }

    fn instant(&self, j: usize) -> Instant {
        let (sine, cosine) = self.drive[j];
        let [position, velocity, acceleration] = core::array::from_fn(|d| self.motion.at(d, j));
        Instant { position, velocity, acceleration, sine, cosine }
    }

    /// Evaluates the motion X, its unbalance and the derivatives. The following methods are about this motion.
    pub fn linearise(&mut self, x: &[f64]) {
        self.basis.synthesise(x, self.base_rad_s(), &mut self.motion);
        self.linear.clear();
        for j in 0..self.basis.samples() {
            self.linear.push(self.oscillator.linearise(&self.instant(j)));
        }
        for (dof, signal) in self.unbalance.iter_mut().enumerate() {
            signal.clear();
            signal.extend(self.linear.iter().map(|at| at.unbalance[dof]));
        }
        self.spectrum.transform(&self.basis, &self.linear);
    }

    /// R(X).
    pub fn residual(&self, out: &mut [f64]) {
        self.project(&self.unbalance, out);
    }

    /// The components of a signal along the rows.
    fn project(&self, signal: &[Vec<f64>; 2], out: &mut [f64]) {
        for dof in 0..2 {
            out[dof] = mean(&signal[dof]) * self.row_scale(0.0);
            for k in 1..=self.harmonics {
                let (c, s) = self.basis.project(k - 1, &signal[dof]);
                let scale = self.row_scale(k as f64);
                out[4 * k - 2 + dof] = c * scale;
                out[4 * k + dof] = s * scale;
            }
        }
    }

    /// ∂R/∂X, column by column, columns `stride` apart; or, for half-odd frequencies, the operator on variations that
    /// change sign each period (Hill's matrix), whose null vector is a period doubling.
    pub(super) fn jacobian(&mut self, harmonics: Harmonics, matrix: &mut [f64], stride: usize) {
        let (omega, stiffness, nu) = (self.base_rad_s(), self.oscillator.stiffness_scale(), self.subharmonic);
        self.spectrum.assemble(harmonics, omega, |order| row_scale(order, nu, stiffness), matrix, stride);
    }

    /// ∂r/∂λ at the sample j for a coordinate λ; `linear` and `at` are those of the sample.
    fn by_coordinate_at(&self, which: Coordinate<O::Parameter>, at: &Instant, linear: &Linearisation) -> Vector2<f64> {
        match which {
            // At constant X, α̇ is in proportion to Ω and α̈ to Ω².
            Coordinate::FrequencyHz => {
                (linear.by_velocity * at.velocity + linear.by_acceleration * at.acceleration * 2.0) / self.frequency_hz
            }
            Coordinate::Parameter(parameter) => self.oscillator.by_parameter(parameter, at),
        }
    }

    /// ∂R/∂λ.
    pub fn by_coordinate(&mut self, which: Coordinate<O::Parameter>, out: &mut [f64]) {
        let mut signal = core::mem::take(&mut self.unbalance);
        for (j, linear) in self.linear.iter().enumerate() {
            let value = self.by_coordinate_at(which, &self.instant(j), linear);
            (signal[0][j], signal[1][j]) = (value.x, value.y);
        }
        self.project(&signal, out);
        for (dof, values) in signal.iter_mut().enumerate() {
            values.iter_mut().zip(&self.linear).for_each(|(value, at)| *value = at.unbalance[dof]);
        }
        self.unbalance = signal;
    }

    /// An estimate of what the truncation to H harmonics leaves out, rad: the balance fails in the components k > H by
    /// r̂ₖ, and a harmonic Z(kω)⁻¹ r̂ₖ would correct that, with the mean dynamic stiffness Z = S̄ + ikωḠ − k²ω²M̄. The
    /// largest of k = H + 1 … 2H + 1.
    pub fn truncation_error_rad(&self) -> f64 {
        let orders = self.harmonics + 1..=2 * self.harmonics + 1;
        self.missing(&self.basis, orders.map(|k| k - 1), &self.unbalance)
    }

    /// The largest |Z(kω)⁻¹ r̂ₖ| over the frequencies of the basis with these indices.
    fn missing(&self, basis: &Basis, indices: impl Iterator<Item = usize>, signal: &[Vec<f64>; 2]) -> f64 {
        let [s, g, m] = self.spectrum.means();
        let mut error: f64 = 0.0;
        for i in indices {
            let rate = basis.harmonics().order(i) * self.base_rad_s();
            let z = Matrix2::from_fn(|i, j| Complex::new(s[(i, j)] - rate * rate * m[(i, j)], rate * g[(i, j)]));
            let component = |dof: usize| {
                let (c, s) = basis.project(i, &signal[dof]);
                Complex::new(c, -s)
            };
            let missing = z
                .try_inverse()
                .map_or(f64::INFINITY, |inverse| (inverse * Vector2::new(component(0), component(1))).norm());
            error = error.max(missing);
        }
        error
    }

    /// The largest |α1| and |α2| over the period, rad.
    pub fn largest_rad(&mut self, x: &[f64]) -> [f64; 2] {
        largest(&self.basis, x, &mut self.motion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::arm_at;
    use crate::{ArmParameter, ForcedArm};
    use alloc::vec;
    use resonarm_dynamics::arm::{Load, Preset};

    fn balance(subharmonic: usize) -> HarmonicBalance<ForcedArm> {
        let load = Load { torque_nm: [1.0, 0.3].into(), force_n: [0.5, -0.7].into() };
        let arm = ForcedArm::new(arm_at(Preset::Irb1600Fitted, 25.0, 70.0), load, 60.0);
        HarmonicBalance::new(arm, 22.0, subharmonic, 4)
    }

    /// A motion of decaying harmonics, and a direction.
    fn series(rows: usize, seed: f64) -> Vec<f64> {
        (0..2 * rows).map(|i| 0.2 * libm::sin(seed + 1.7 * i as f64) * libm::exp(-0.25 * i as f64)).collect()
    }

    fn shifted(x: &[f64], direction: &[f64], h: f64) -> Vec<f64> {
        x.iter().zip(direction).map(|(x, d)| x + h * d).collect()
    }

    #[test]
    fn jacobian_is_the_derivative() {
        for subharmonic in [1, 2] {
            let mut balance = balance(subharmonic);
            let n = balance.dimension();
            let (x, direction) = (series(n / 2, 1.0), series(n / 2, 2.0));
            let mut residual = |x: &[f64], frequency_hz| {
                assert!(balance.set_coordinate(Coordinate::FrequencyHz, frequency_hz));
                let mut out = vec![0.0; n];
                balance.linearise(x);
                balance.residual(&mut out);
                out
            };
            let h = 1e-5;
            let seen: Vec<f64> = residual(&shifted(&x, &direction, h), 22.0)
                .iter()
                .zip(residual(&shifted(&x, &direction, -h), 22.0))
                .map(|(above, below)| (above - below) / (2.0 * h))
                .collect();
            let by_frequency: Vec<f64> =
                residual(&x, 22.001).iter().zip(residual(&x, 21.999)).map(|(a, b)| (a - b) / 0.002).collect();
            let mut matrix = vec![0.0; n * n];
            assert!(balance.set_coordinate(Coordinate::FrequencyHz, 22.0));
            balance.linearise(&x);
            balance.jacobian(Harmonics::Integer(4), &mut matrix, n);
            let mut column = vec![0.0; n];
            balance.by_coordinate(Coordinate::FrequencyHz, &mut column);
            for i in 0..n {
                let exact: f64 = (0..n).map(|j| matrix[i + n * j] * direction[j]).sum();
                assert!((exact - seen[i]).abs() < 1e-8, "row {i}: {exact} {}", seen[i]);
                assert!((column[i] - by_frequency[i]).abs() < 1e-8, "row {i}: {} {}", column[i], by_frequency[i]);
            }
        }
    }

    /// Hill's matrix of half-odd frequencies is the Jacobian of the doubled period at a motion of the single one.
    #[test]
    fn half_odd_matrix_is_the_odd_part_of_the_doubled_period() {
        let (mut single, mut double) = (balance(1), balance(2));
        let x = series(single.dimension() / 2, 1.0);
        single.linearise(&x);
        let half = Harmonics::HalfOdd(3);
        let (n, size) = (2 * half.rows(), 2 * Harmonics::Integer(9).rows());
        let (mut small, mut large) = (vec![0.0; n * n], vec![0.0; size * size]);
        single.jacobian(half, &mut small, n);
        double.set_harmonics(9);
        let mut embedded = vec![0.0; size];
        embedded[..2].copy_from_slice(&x[..2]);
        for k in 1..=4 {
            embedded[8 * k - 2..8 * k + 2].copy_from_slice(&x[4 * k - 2..4 * k + 2]);
        }
        double.linearise(&embedded);
        double.jacobian(Harmonics::Integer(9), &mut large, size);
        // Row 4p + i of the half-odd set, frequency p + ½, is row 4(2p + 1) − 2 + i of the doubled one.
        let place = |at: usize| 4 * (2 * (at / 4) + 1) - 2 + at % 4;
        for i in 0..n {
            for j in 0..n {
                let (small, large) = (small[i + n * j], large[place(i) + size * place(j)]);
                assert!((small - large).abs() < 1e-6 * (1.0 + large.abs()), "{i} {j}: {small} {large}");
            }
        }
    }

    #[test]
    fn gradient_of_a_form_is_its_derivative() {
        let coordinates = [Coordinate::FrequencyHz, Coordinate::Parameter(ArmParameter::Beta2Deg)];
        for harmonics in [Harmonics::Integer(4), Harmonics::HalfOdd(5)] {
            let mut balance = balance(1);
            let n = balance.dimension();
            let x = series(n / 2, 1.0);
            let size = 2 * harmonics.rows();
            let forms = Forms { harmonics, w: series(size / 2, 3.0), v: series(size / 2, 4.0) };
            let mut form = |x: &[f64], shift: [f64; 2]| {
                assert!(balance.set_coordinate(coordinates[0], 22.0 + shift[0]));
                assert!(balance.set_coordinate(coordinates[1], 70.0 + shift[1]));
                let mut matrix = vec![0.0; size * size];
                balance.linearise(x);
                balance.jacobian(harmonics, &mut matrix, size);
                (0..size * size).map(|at| forms.w[at % size] * matrix[at] * forms.v[at / size]).sum::<f64>()
            };
            let direction = series(n / 2, 5.0);
            let h = 1e-4;
            let along = (form(&shifted(&x, &direction, h), [0.0; 2]) - form(&shifted(&x, &direction, -h), [0.0; 2]))
                / (2.0 * h);
            let by = [[h, 0.0], [0.0, h]].map(|s| (form(&x, s) - form(&x, s.map(|s| -s))) / (2.0 * h));
            form(&x, [0.0; 2]);
            let mut gradient = FormGradient::default();
            let exact = gradient.compute(&mut balance, &x, &forms, coordinates);
            let product: f64 = gradient.by_x.iter().zip(&direction).map(|(g, d)| g * d).sum();
            assert!((product - along).abs() < 1e-6 * (1e-3 + along.abs()), "{product} {along}");
            for (exact, seen) in exact.iter().zip(by) {
                assert!((exact - seen).abs() < 1e-6 * (1e-3 + seen.abs()), "{exact} {seen}");
            }
        }
    }
}
