//! The schemes on systems that are not structures of this crate.

use super::*;
use core::array;
use core::f64::consts::PI;

/// N masses of 1 kg in a row between two walls on N + 1 springs k, with dampers βk beside them, and cubic springs to
/// the ground.
struct Row<const N: usize> {
    stiffness_n_m: f64,
    beta_s: f64,
    cubic_n_m3: f64,
}

impl<const N: usize> Row<N> {
    /// ω of mode r from 1: 2 √k sin(rπ/(2N + 2)).
    fn frequency_rad_s(&self, mode: usize) -> f64 {
        2.0 * libm::sqrt(self.stiffness_n_m) * libm::sin(mode as f64 * PI / (2 * N + 2) as f64)
    }

    /// The force of the springs between the masses on mass n, per unit of k.
    fn pulled(x: &[f64; N], n: usize) -> f64 {
        let before = if n == 0 { 0.0 } else { x[n - 1] };
        before - 2.0 * x[n] + x.get(n + 1).copied().unwrap_or(0.0)
    }
}

impl<const N: usize> Dynamics<N> for Row<N> {
    type Load = [f64; N];

    fn rates(&self, motion: &Motion<f64, N>, load: &[f64; N]) -> Rates<f64, N> {
        let damping = |n| self.stiffness_n_m * self.beta_s * Row::pulled(&motion.v, n);
        let spring =
            |n: usize| self.stiffness_n_m * Row::pulled(&motion.x, n) - self.cubic_n_m3 * libm::pow(motion.x[n], 3.0);
        let power = |n: usize| (load[n] + damping(n)) * motion.v[n];
        Rates { acceleration: array::from_fn(|n| spring(n) + damping(n) + load[n]), power_w: (0..N).map(power).sum() }
    }

    fn jacobian(&self, motion: &Motion<f64, N>, load: &[f64; N]) -> Jacobian<N> {
        let tie = |row: usize, column: usize| match row.abs_diff(column) {
            0 => -2.0 * self.stiffness_n_m,
            1 => self.stiffness_n_m,
            _ => 0.0,
        };
        let cubic = |n: usize| 3.0 * self.cubic_n_m3 * motion.x[n] * motion.x[n];
        let by_position = |row, column| tie(row, column) - if row == column { cubic(row) } else { 0.0 };
        Jacobian {
            acceleration: self.rates(motion, load).acceleration,
            by_position: array::from_fn(|row| array::from_fn(|column| by_position(row, column))),
            by_velocity: array::from_fn(|row| array::from_fn(|column| self.beta_s * tie(row, column))),
        }
    }

    fn linear_part(&self) -> Jacobian<N> {
        self.jacobian(&Motion { x: [0.0; N], v: [0.0; N] }, &[0.0; N])
    }

    fn fastest_rad_s(&self) -> f64 {
        self.frequency_rad_s(N)
    }

    fn frequency_bound_rad_s(&self, x: &[f64; N]) -> f64 {
        let hardest = x.iter().map(|x| 3.0 * self.cubic_n_m3 * x * x).fold(0.0, f64::max);
        libm::sqrt(4.0 * self.stiffness_n_m + hardest)
    }

    fn energy_j(&self, motion: &Motion<f64, N>) -> f64 {
        let kinetic: f64 = motion.v.iter().map(|v| 0.5 * v * v).sum();
        let cubic: f64 = motion.x.iter().map(|x| 0.25 * self.cubic_n_m3 * libm::pow(*x, 4.0)).sum();
        let springs: f64 = (0..N).map(|n| -0.5 * self.stiffness_n_m * motion.x[n] * Row::pulled(&motion.x, n)).sum();
        kinetic + cubic + springs
    }
}

/// A force that is held.
struct Held<const N: usize>([f64; N]);

impl<const N: usize> Excitation<[f64; N]> for Held<N> {
    fn load(&self, _t_s: f64) -> [f64; N] {
        self.0
    }

    fn is_constant(&self) -> bool {
        true
    }
}

/// The closed form by modes sin(nrπ/(N + 1)): each goes to its static deflection as a damped oscillator.
fn row_under_a_held_force<const N: usize>(row: &Row<N>, force_n: &[f64; N], t_s: f64) -> [f64; N] {
    let shape = |n: usize, mode: usize| libm::sin((n + 1) as f64 * mode as f64 * PI / (N + 1) as f64);
    array::from_fn(|n| {
        (1..=N)
            .map(|mode| {
                let omega = row.frequency_rad_s(mode);
                let decay = 0.5 * row.beta_s * omega * omega;
                let damped = libm::sqrt(omega * omega - decay * decay);
                let (sine, cosine) = libm::sincos(damped * t_s);
                let step = 1.0 - libm::exp(-decay * t_s) * (cosine + decay / damped * sine);
                // The squares of a mode's sines sum to (N + 1)/2.
                let modal_n: f64 = (0..N).map(|n| shape(n, mode) * force_n[n]).sum::<f64>() * 2.0 / (N + 1) as f64;
                shape(n, mode) * modal_n / (omega * omega) * step
            })
            .sum()
    })
}

/// Five masses, a hundred steps of half a radian of the fastest mode.
#[test]
fn a_linear_row_under_a_held_force_is_exact_by_the_exponential_schemes() {
    let row = Row::<5> { stiffness_n_m: 400.0, beta_s: 1e-3, cubic_n_m3: 0.0 };
    let force_n = [3.0, 0.0, -1.0, 2.0, 0.5];
    for scheme in [Scheme::Exponential, Scheme::Exponential8] {
        let integrator = Integrator::new(scheme, 80.0, &row).unwrap();
        let mut motion = Motion { x: [0.0; 5], v: [0.0; 5] };
        for k in 0..100_u32 {
            motion = integrator.step(&row, f64::from(k) / 80.0, &motion, &Held(force_n)).unwrap();
        }
        let expected = row_under_a_held_force(&row, &force_n, 100.0 / 80.0);
        let apart = motion.x.iter().zip(&expected).map(|(got, expected)| (got - expected).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-14, "{scheme}: {apart}, {:?}", motion.x);
    }
}

/// Hard cubic springs on one mass and on three: the order of every scheme, and the energy balance that the implicit
/// ones check in every step.
#[test]
fn nonlinear_rows_converge_with_the_order_of_the_scheme() {
    fn order<const N: usize>(scheme: Scheme) -> f64 {
        let row = Row::<N> { stiffness_n_m: 2e4, beta_s: 1e-5, cubic_n_m3: 3e6 };
        let start = Motion { x: array::from_fn(|n| 0.05 / (n + 1) as f64), v: [1.0; N] };
        let end = |scheme: Scheme, rate_hz: f64| {
            let integrator = Integrator::new(scheme, rate_hz, &row).unwrap();
            let steps = (0.1 * rate_hz) as u32;
            let step = |motion, k| integrator.step(&row, f64::from(k) / rate_hz, &motion, &Held([20.0; N])).unwrap();
            (0..steps).fold(start, step)
        };
        let truth = end(Scheme::Exponential8, 16_000.0);
        let rate_hz = if scheme.order() == 4 { 2000.0 } else { 1000.0 };
        let error = |rate_hz: f64| {
            let got = end(scheme, rate_hz);
            got.x.iter().zip(&truth.x).map(|(got, truth)| (got - truth).abs()).fold(0.0, f64::max)
        };
        libm::log2(error(rate_hz) / error(2.0 * rate_hz))
    }
    for scheme in Scheme::ALL {
        for order in [order::<1>(scheme), order::<3>(scheme)] {
            assert!((order - f64::from(scheme.order())).abs() < 0.5, "{scheme}: observed order {order}");
        }
    }
}
