//! Harmonic balance of a structure: periodic responses as Fourier series (M. Krack, J. Gross, "Harmonic Balance for
//! Nonlinear Vibration Problems", 2019, Ch. 2), by alternating between frequency and time (T. M. Cameron, J. H.
//! Griffin, "An Alternating Frequency/Time Domain Method for Calculating the Steady-State Response of Nonlinear Dynamic
//! Systems", J. Appl. Mech. 56 (1989)). [`super::unknowns`] defines the unknowns.
//!
//! With the base frequency ω = Ω/ν and τ = ωt, ν being the periods of the drive after which the response repeats, the
//! unknowns X are the coefficients of 1, cos kτ, sin kτ, k = 1 … H, each of all m unknowns. For a chain, row k is the
//! unbalance over the stiffness scale and max(1, (k/ν)²); for modes, it is the displacement minus the displacement that
//! the forces cause.
//!
//! The derivatives by a parameter of the structure are differences of fourth order: rows depend on most parameters by a
//! polynomial of degree 2 at most, so that only rounding is left, and on the others smoothly.

mod homotopy;

use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;
use core::f64::consts::TAU;

use nalgebra::Complex;

use resonarm_dynamics::structure::{Assembly, Dof, Law, Linear, Parameter};
use resonarm_numeric::registers::{Task, widest};

use super::dense::dot;
use super::history::{FrictionDerivative, History, Stretch};
use super::linear::dynamic_stiffness_solve;
use super::samples::{Contacts, Jump, Samples};
use super::spectral::{operator, project};
use super::unknowns::{Body, Compliance, Condensed, Kept, Unknowns, Weights};
use crate::continuation::System;
use crate::forced::{Component, Coordinate, Forced};
use crate::orbit::Orbit;

pub(super) use homotopy::Homotopy;

/// Samples per period for a structure with a law that isn't smooth: a kink between two samples changes the harmonics by
/// the order of the square of their distance.
const ROUGH_SAMPLES: usize = 512;
/// Steps must not miss superharmonic resonances, where Ω times one of these is a natural frequency.
const SUPERHARMONICS: [f64; 3] = [1.0, 2.0, 3.0];
/// Steps may miss resonances narrower than this relative width.
const LEAST_DAMPING: f64 = 1e-5;
/// The step of a difference by a parameter, relative to its value, or to 1 in its unit if that is larger for an angle,
/// or the value is zero.
const PARAMETER_STEP: f64 = 1e-3;
/// Offsets and weights, over 12 steps, of differences of fourth order: central, and to one side where the structure
/// does not exist on the other, as with a negative mass.
const CENTRAL: [(f64, f64); 4] = [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)];
const ONE_SIDED: [(f64, f64); 5] = [(0.0, -25.0), (1.0, 48.0), (2.0, -36.0), (3.0, 16.0), (4.0, -3.0)];

/// The balance of a structure as one coordinate varies.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    pub forced: Forced,
    pub unknowns: Unknowns,
    pub coordinate: Coordinate,
    pub frequency_hz: f64,
    pub samples: Samples,
    /// The mode that a backbone keeps as an unknown of its own; only for modal structures.
    pub kept: Option<Kept>,
    evaluated: Evaluated,
    harmonics: usize,
    linear: Linear,
    /// For a chain, the largest stiffness, N·m, and the factor of each row.
    scale: f64,
    row_scales: Vec<f64>,
    compliances: Vec<Compliance>,
    /// The part of ∂Q/∂u and ∂Q/∂u̇ at each sample that comes from the states of friction, pair of unknowns by pair; empty
    /// without friction.
    by_state: [Vec<f64>; 2],
    /// ∂Q̂/∂X, column by column, and Q̂ and ∂Q̂/∂Ω/2π.
    operator: Vec<f64>,
    load: Vec<f64>,
    by_frequency: Vec<f64>,
}

/// The response to which the samples belong.
#[derive(Clone, Debug, Default)]
struct Evaluated {
    /// The truncation error, once it is known.
    truncation_error: Cell<Option<f64>>,
    /// Whether the samples belong to a response: false after the structure or the samples have changed.
    is_known: bool,
    x: Vec<f64>,
    frequency_hz: f64,
    amplitude: f64,
}

/// Adds the products of columns of weights and rows to a block of rows.
struct AddProducts<'a> {
    block: &'a mut [f64],
    /// Each product's weights in a column of a block with this many columns, and its row.
    weights: &'a [[f64; TOGETHER]],
    rows: &'a [Vec<f64>; TOGETHER],
}

/// Products that are added at once. Each sum has them added in their order, as if they came one by one.
const TOGETHER: usize = 8;

impl Task for AddProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let columns = self.rows[0].len();
        let rows: [&[f64]; TOGETHER] = core::array::from_fn(|product| &self.rows[product][..columns]);
        for (sums, weights) in self.block.chunks_exact_mut(columns).zip(self.weights) {
            for (c, sum) in sums.iter_mut().enumerate() {
                let mut value = *sum;
                for (weight, row) in weights.iter().zip(&rows) {
                    value += weight * row[c];
                }
                *sum = value;
            }
        }
    }
}

/// Products of a column of weights and a row, each of rank one, that wait to be added to a block.
///
/// Of ∂Q̂/∂X, which is stored by columns, the row is a force's harmonics, and the weights are the derivatives by the unknowns
/// of what the force is in proportion to.
struct Products {
    rows: [Vec<f64>; TOGETHER],
    weights: Vec<[f64; TOGETHER]>,
    /// How many wait to be added.
    waiting: usize,
}

impl Products {
    /// Products for a block with as many rows and columns.
    fn new(rows: usize, columns: usize) -> Products {
        let zeros = core::array::from_fn(|_| vec![0.0; columns]);
        Products { rows: zeros, weights: vec![[0.0; TOGETHER]; rows], waiting: 0 }
    }

    /// Begins a product, of zeros.
    fn begin(&mut self) {
        self.rows[self.waiting].fill(0.0);
        self.weights.iter_mut().for_each(|of| of[self.waiting] = 0.0);
    }

    /// Adds to a harmonic of the force.
    fn force(&mut self, row: usize, value: f64) {
        self.rows[self.waiting][row] += value;
    }

    /// Adds to a derivative.
    fn change(&mut self, column: usize, value: f64) {
        self.weights[column][self.waiting] += value;
    }

    /// Ends a product and adds all that wait to the block as soon as there are enough.
    fn end(&mut self, block: &mut [f64]) {
        self.waiting += 1;
        if self.waiting == TOGETHER {
            widest(AddProducts { block, weights: &self.weights, rows: &self.rows });
            self.waiting = 0;
        }
    }

    /// Adds the products that wait.
    fn finish(mut self, block: &mut [f64]) {
        if self.waiting > 0 {
            // They are too few for a whole set: the others are zero.
            self.rows[self.waiting..].iter_mut().for_each(|row| row.fill(0.0));
            widest(AddProducts { block, weights: &self.weights, rows: &self.rows });
        }
    }
}

/// Returns the size of the elements' displacements, or of a chain's coordinates, under a static unit drive: m or rad over N or
/// N·m.
pub(super) fn unit_deflection(forced: &Forced) -> f64 {
    unit_size(forced, &Unknowns::by_places(forced, 1))
}

/// Returns the size of the unknowns under a static unit drive.
pub(super) fn unit_state(forced: &Forced) -> f64 {
    unit_size(forced, &Unknowns::with_period(forced, 1))
}

fn unit_size(forced: &Forced, unknowns: &Unknowns) -> f64 {
    match &unknowns.body {
        Body::Condensed(condensed) => {
            let mut compliance = Compliance::default();
            condensed.compliance(0.0, None, &mut compliance);
            libm::sqrt(compliance.drive.iter().map(|[h, _]| h.re * h.re).sum())
        }
        Body::Chain => {
            let mut response: Vec<_> = forced.direction_at_rest().iter().map(|&w| Complex::new(w, 0.0)).collect();
            let solved = dynamic_stiffness_solve(&forced.assembly.linear(), 0.0, &mut response);
            solved.map_or(f64::NAN, |()| libm::sqrt(response.iter().map(|q| q.re * q.re).sum()))
        }
    }
}

/// max(1, (k/ν)²) of a row of coefficients.
fn order_squared(row: usize, period: usize) -> f64 {
    let order = row.div_ceil(2) as f64 / period as f64;
    (order * order).max(1.0)
}

/// Points of the period for H harmonics, so that what aliases onto them is negligible: a power of degree d has
/// components up to dH, of which those from N − H on alias.
fn samples_for(forced: &Forced, period: usize, harmonics: usize) -> usize {
    let rough = ROUGH_SAMPLES * period;
    let of_law = |law: &Law| match law {
        // A force of degree d reaches the harmonic dH, which aliases onto one up to H only if N ≤ (d + 1) H.
        Law::Cubic { stiffness5, .. } if *stiffness5 == 0.0 => 4 * harmonics + 4,
        Law::Cubic { .. } => 6 * harmonics + 6,
        Law::Linear { .. } => 4 * harmonics + 4,
        Law::Tanh { .. } => (12 * harmonics).max(rough / 4),
        _ => rough,
    };
    let laws = forced.assembly.elements().iter().map(|element| of_law(&element.law));
    // The force is one degree below the potential.
    let polynomials = forced.assembly.polynomials().iter().map(|of| of.degree() * (harmonics + 1));
    let samples = laws.chain(polynomials).fold(4 * harmonics + 4, usize::max);
    // A power of two has a fast transform.
    if forced.assembly.is_smooth() { samples } else { samples.next_power_of_two() }
}

/// The rows of cos kτ and sin kτ among those of all unknowns; for k = 0 that of 1, and none.
#[derive(Clone, Copy)]
struct Pair {
    first: usize,
    second: Option<usize>,
}

impl Pair {
    fn of(k: usize, unknowns: usize) -> Pair {
        let second = (k > 0).then_some(2 * k * unknowns);
        Pair { first: (2 * k).saturating_sub(1) * unknowns, second }
    }

    /// Returns the coefficients of one unknown.
    fn at(self, of: &[f64], unknown: usize) -> [f64; 2] {
        [of[self.first + unknown], self.second.map_or(0.0, |second| of[second + unknown])]
    }

    fn put(self, into: &mut [f64], unknown: usize, [first, second]: [f64; 2]) {
        into[self.first + unknown] = first;
        if let Some(at) = self.second {
            into[at + unknown] = second;
        }
    }
}

/// Returns the coefficients of H U, U = c − is of a harmonic c cos + s sin.
fn times(h: Complex<f64>, [c, s]: [f64; 2]) -> [f64; 2] {
    [h.re * c + h.im * s, h.re * s - h.im * c]
}

impl Balance {
    /// A balance for responses with the period of the drive.
    pub fn new(forced: &Forced, frequency_hz: f64, coordinate: Coordinate, harmonics: usize) -> Balance {
        Balance::of_period(forced, [1, harmonics], frequency_hz, coordinate)
    }

    /// A balance for responses with ν periods of the drive, with H harmonics of Ω/ν.
    pub fn of_period(
        forced: &Forced,
        [period, harmonics]: [usize; 2],
        frequency_hz: f64,
        coordinate: Coordinate,
    ) -> Balance {
        let unknowns = Unknowns::with_period(forced, period);
        let mut balance = Balance::of_unknowns(forced, unknowns, frequency_hz, coordinate);
        balance.set_harmonics(harmonics);
        balance
    }

    /// A balance at a response of a branch in a coordinate, with as many harmonics; `None` if no such structure exists.
    pub fn at_orbit(forced: &Forced, coordinate: Coordinate, orbit: &Orbit) -> Option<Balance> {
        let mut balance = Balance::of_period(forced, [orbit.period, orbit.harmonics], orbit.frequency_hz, coordinate);
        (balance.set(Coordinate::Amplitude, orbit.drive) && balance.set_value(orbit.value)).then_some(balance)
    }

    /// A balance of these unknowns, before its number of harmonics is set.
    fn of_unknowns(forced: &Forced, unknowns: Unknowns, frequency_hz: f64, coordinate: Coordinate) -> Balance {
        let linear = forced.assembly.linear();
        let n = linear.coordinates;
        let scale = (0..n).map(|i| linear.stiffness[i * n + i]).fold(0.0, f64::max);
        Balance {
            samples: Samples::new(forced, &unknowns),
            forced: forced.clone(),
            unknowns,
            coordinate,
            frequency_hz,
            kept: None,
            evaluated: Evaluated::default(),
            harmonics: 0,
            linear,
            scale,
            row_scales: vec![],
            compliances: vec![],
            by_state: Default::default(),
            operator: vec![],
            load: vec![],
            by_frequency: vec![],
        }
    }

    /// Returns the balance with the displacements of the elements as unknowns, before its number of harmonics is set, and a
    /// response X in these; `None` if they are its unknowns.
    pub fn by_places(&self, x: &[f64]) -> Option<(Balance, Vec<f64>)> {
        let unknowns = Unknowns::by_places(&self.forced, self.period());
        if unknowns.count() == self.unknowns.count() {
            return None;
        }
        let Body::Condensed(condensed) = &unknowns.body else { return None };
        let displacement = |(q, phi): (&[f64], &Vec<f64>)| dot(q, phi);
        let rows = x.chunks_exact(self.unknowns.count());
        let x = rows.flat_map(|q| condensed.places.iter().map(move |phi| displacement((q, phi)))).collect();
        let balance = Balance {
            kept: self.kept,
            harmonics: self.harmonics,
            ..Balance::of_unknowns(&self.forced, unknowns, self.frequency_hz, self.coordinate)
        };
        Some((balance, x))
    }

    /// Changes the number of harmonics H.
    pub fn set_harmonics(&mut self, harmonics: usize) {
        self.harmonics = harmonics;
        self.evaluated.is_known = false;
        let samples = samples_for(&self.forced, self.period(), harmonics);
        // Derivatives need the orders up to 2H, the estimate of the truncation those up to 2H + 1.
        self.samples.set(2 * harmonics + 1, samples);
        self.compliances.resize(2 * harmonics + 1, Compliance::default());
        let m = self.unknowns.count();
        let period = self.period();
        let scale = |row: usize| 1.0 / (self.scale * order_squared(row / m, period));
        self.row_scales = (0..m * (2 * harmonics + 1)).map(scale).collect();
    }

    /// Number of harmonics, H.
    pub fn harmonics(&self) -> usize {
        self.harmonics
    }

    /// Number of periods of the drive after which the response repeats, ν.
    pub fn period(&self) -> usize {
        self.unknowns.period
    }

    /// Sets the coordinate that varies and returns whether such a response exists.
    #[must_use]
    pub fn set_value(&mut self, value: f64) -> bool {
        self.set(self.coordinate, value)
    }

    /// Sets a coordinate and returns whether such a response exists. If not, a parameter of the structure keeps its
    /// value.
    #[must_use]
    pub fn set(&mut self, coordinate: Coordinate, value: f64) -> bool {
        match coordinate {
            Coordinate::FrequencyHz => self.frequency_hz = value,
            Coordinate::Amplitude => self.forced.amplitude = value,
            Coordinate::Parameter(parameter) => {
                // Every evaluation sets the coordinate again: a structure is built anew only for another value.
                let assembly = &self.forced.assembly;
                if assembly.value(parameter) != Ok(value) {
                    let Ok(changed) = assembly.with(parameter, value) else { return false };
                    self.set_assembly(changed);
                }
            }
        }
        value.is_finite() && (value > 0.0 || coordinate != Coordinate::FrequencyHz)
    }

    /// Returns the value of a coordinate; not a number if the structure has no such parameter.
    pub fn value(&self, coordinate: Coordinate) -> f64 {
        match coordinate {
            Coordinate::FrequencyHz => self.frequency_hz,
            Coordinate::Amplitude => self.forced.amplitude,
            Coordinate::Parameter(parameter) => self.forced.assembly.value(parameter).unwrap_or(f64::NAN),
        }
    }

    /// Returns the unit of a coordinate.
    pub fn unit_of(&self, coordinate: Coordinate) -> &'static str {
        match coordinate {
            Coordinate::FrequencyHz => "Hz",
            Coordinate::Amplitude => self.forced.unit(),
            Coordinate::Parameter(parameter) => parameter.unit(),
        }
    }

    /// Takes another structure of the same kind; the scale of the rows stays.
    fn set_assembly(&mut self, assembly: Assembly) {
        self.forced.assembly = assembly;
        self.evaluated.is_known = false;
        self.linear = self.forced.assembly.linear();
        if let Body::Condensed(_) = self.unknowns.body {
            self.unknowns = Unknowns::with_period(&self.forced, self.period());
        }
    }

    /// Base frequency of the Fourier series, Ω/2πν, Hz.
    pub fn base_hz(&self) -> f64 {
        self.frequency_hz / self.period() as f64
    }

    /// ω = Ω/ν, rad/s.
    pub fn omega_rad_s(&self) -> f64 {
        TAU * self.base_hz()
    }

    /// Evaluates the response X and the forces along it, unless it was the last one. The following methods use this
    /// response.
    pub fn evaluate_orbit(&mut self, x: &[f64]) {
        let frequency_hz = self.frequency_hz;
        let amplitude = self.forced.amplitude;
        let known = &mut self.evaluated;
        // The choice of the number of harmonics and the readings of a point ask for the same response in turn.
        if known.is_known && known.x == x && known.frequency_hz == frequency_hz && known.amplitude == amplitude {
            return;
        }
        known.x.clear();
        known.x.extend_from_slice(x);
        known.truncation_error.set(None);
        known.is_known = true;
        known.frequency_hz = frequency_hz;
        known.amplitude = amplitude;
        let m = self.unknowns.count();
        let omega = self.omega_rad_s();
        self.samples.synthesise(x, &self.unknowns, omega);
        self.samples.evaluate(&self.forced, &self.unknowns, self.frequency_hz, Contacts::Located);
        self.load.clear();
        self.load.resize(x.len(), 0.0);
        let count = self.samples.count();
        let load = &mut self.load;
        for i in 0..m {
            let signal = &self.samples.load[i * count..(i + 1) * count];
            project(&self.samples, signal, self.harmonics, |row, value| load[row * m + i] = value);
        }
    }

    /// Returns the harmonic k ≤ 2H + 1 of signals of all unknowns as complex numbers, of u = Re(U e^{ikτ}).
    fn harmonic(&self, signals: &[f64], k: usize) -> Vec<Complex<f64>> {
        let count = self.samples.count();
        let of = |i: usize| {
            let signal = &signals[i * count..(i + 1) * count];
            let (c, s) = self.samples.basis.project(k - 1, signal);
            Complex::new(c, -s)
        };
        (0..self.unknowns.count()).map(of).collect()
    }

    /// Estimates the error of the truncation to H harmonics, in the unit of u: the largest of the harmonics k = H + 1 …
    /// 2H + 1 that the linear structure makes of the balance's residual there.
    pub fn truncation_error(&self) -> f64 {
        // The choice of the number of harmonics and the point of the branch ask for the same.
        let known = &self.evaluated.truncation_error;
        known.get().unwrap_or_else(|| {
            let error = self.missing(&self.samples.load, &[]);
            known.set(Some(error));
            error
        })
    }

    /// Estimates how far a variation of the response last linearised, a null vector of the matrix or a part of it, is
    /// from one that includes the harmonics left out, in its own unit. States of elements are taken as held.
    pub fn variation_error(&self, variation: &[f64]) -> f64 {
        let m = self.unknowns.count();
        let count = self.samples.count();
        let mut moved = self.samples.clone();
        moved.synthesise(variation, &self.unknowns, self.omega_rad_s());
        let mut signals = vec![0.0; m * count];
        for (by, motion) in self.samples.by.iter().zip(&moved.motion) {
            for (pair, by) in by.chunks_exact(count).enumerate() {
                let i = pair / m;
                let k = pair % m;
                let signal = &mut signals[i * count..(i + 1) * count];
                let moves = motion.iter().skip(k).step_by(m);
                signal.iter_mut().zip(by).zip(moves).for_each(|((sum, by), moves)| *sum += by * moves);
            }
        }
        let change = |jump: &Jump| -> f64 {
            let at = moved.at_phase(jump.phase_rad, m);
            jump.change
                .iter()
                .map(|&(i, [by_position, by_velocity])| by_position * at[0][i] + by_velocity * at[1][i])
                .sum()
        };
        let changes: Vec<_> = self.samples.jumps.iter().map(|jump| (jump, change(jump))).collect();
        self.missing(&signals, &changes)
    }

    /// Returns the largest of the harmonics k = H + 1 … 2H + 1 that the linear structure makes of forces, with those of
    /// jumps by the changes of their phases.
    fn missing(&self, signals: &[f64], jumps: &[(&Jump, f64)]) -> f64 {
        let mut compliance = Compliance::default();
        let missing = |k: usize| {
            let rate = k as f64 * self.omega_rad_s();
            let mut load = self.harmonic(signals, k);
            for (jump, change) in jumps {
                let (sine, cosine) = libm::sincos(k as f64 * jump.phase_rad);
                jump.load.iter().for_each(|(i, part)| load[*i] += Complex::new(cosine, -sine) * part * *change);
            }
            match &self.unknowns.body {
                Body::Chain => dynamic_stiffness_solve(&self.linear, rate, &mut load)
                    .map_or(f64::INFINITY, |()| libm::sqrt(load.iter().map(|q| q.norm_sqr()).sum())),
                Body::Condensed(condensed) => {
                    condensed.compliance(rate, None, &mut compliance);
                    let m = load.len();
                    let row = |i: usize| (0..m).map(|j| compliance.places[i * m + j][0] * load[j]).sum::<Complex<_>>();
                    libm::sqrt((0..m).map(|i| row(i).norm_sqr()).sum())
                }
            }
        };
        (self.harmonics + 1..=2 * self.harmonics + 1).map(missing).fold(0.0, f64::max)
    }

    /// Computes ∂Q̂/∂X with the states' part into `self.operator`, and ∂Q̂/∂(Ω/2π) at constant X.
    fn linearise(&mut self) {
        let m = self.unknowns.count();
        let omega = self.omega_rad_s();
        let harmonics = self.harmonics;
        let size = self.load.len();
        let count = self.samples.count();
        let frictions = self.frictions();
        // The derivatives of elements and polynomials of modes are symmetric; those of a chain are not.
        let is_symmetric = matches!(self.unknowns.body, Body::Condensed(_));
        self.operator.resize(size * size, 0.0);
        operator(&self.samples, &self.by_state, [m, harmonics], omega, is_symmetric, &mut self.operator);
        self.by_frequency.clear();
        self.by_frequency.resize(size, 0.0);
        let mut signal = vec![0.0; count];
        let mut by_acceleration = vec![0.0; count];
        for i in 0..m {
            // At constant X, u̇ is in proportion to Ω and ü to Ω².
            for (d, sums) in [(1, &mut signal), (2, &mut by_acceleration)] {
                sums.fill(0.0);
                if d == 2 && is_symmetric {
                    // The forces of elements do not depend on ü.
                    continue;
                }
                for k in 0..m {
                    let by = &self.samples.by[d][(i * m + k) * count..][..count];
                    let moves = self.samples.motion[d].iter().skip(k).step_by(m);
                    sums.iter_mut().zip(by).zip(moves).for_each(|((sum, by), moves)| *sum += by * moves);
                }
            }
            for (sum, by_acceleration) in signal.iter_mut().zip(&by_acceleration) {
                *sum = (*sum + 2.0 * by_acceleration) / self.frequency_hz;
            }
            let out = &mut self.by_frequency;
            project(&self.samples, &signal, harmonics, |row, value| out[row * m + i] = value);
        }
        self.add_jumps();
        self.add_stretches(&frictions);
        self.add_histories();
    }

    /// Returns the derivatives of friction elements whose displacement is a sum of unknowns, each with the number of its
    /// history, and adds the parts that belong to single samples to `self.by_state`.
    fn frictions(&mut self) -> Vec<(usize, FrictionDerivative)> {
        self.by_state.iter_mut().for_each(Vec::clear);
        let Body::Condensed(condensed) = &self.unknowns.body else { return vec![] };
        let m = self.unknowns.count();
        let count = self.samples.count();
        let mut frictions = Vec::new();
        for (number, history) in self.samples.histories.iter().enumerate() {
            let Law::Friction { stiffness, .. } = self.forced.assembly.elements()[history.element].law else {
                continue;
            };
            let derivative = history.friction_derivative();
            for (by_state, of_sample) in
                self.by_state.iter_mut().zip([&derivative.by_position, &derivative.by_velocity])
            {
                by_state.resize(m * m * count, 0.0);
                for (i, weight) in &condensed.of_element[history.element] {
                    for (k, other) in &condensed.of_element[history.element] {
                        let by_pair = &mut by_state[(i * m + k) * count..][..count];
                        let factor = weight * other * stiffness;
                        by_pair.iter_mut().zip(of_sample).for_each(|(sum, by)| *sum += factor * by);
                    }
                }
            }
            frictions.push((number, derivative));
        }
        frictions
    }

    /// Adds the parts of friction's derivatives that are the same along a stretch: the force's harmonics, of one at the
    /// samples of the stretch, times the change of the stretch's constant by the unknowns.
    fn add_stretches(&mut self, frictions: &[(usize, FrictionDerivative)]) {
        let Body::Condensed(condensed) = &self.unknowns.body else { return };
        if frictions.is_empty() {
            return;
        }
        self.samples.set_functions();
        let m = self.unknowns.count();
        let size = self.load.len();
        let omega = self.omega_rad_s();
        let rows = size / m;
        let count = self.samples.count();
        let mut products = Products::new(size, size);
        for (number, derivative) in frictions {
            let element = self.samples.histories[*number].element;
            let Law::Friction { stiffness, .. } = self.forced.assembly.elements()[element].law else { continue };
            for Stretch { constant, weights: of_samples } in &derivative.stretches {
                let mut force = vec![0.0; rows];
                let mut change = vec![0.0; rows];
                for &(j, part) in of_samples {
                    let scale = 2.0 * stiffness * part / count as f64;
                    force.iter_mut().zip(self.samples.functions(j, rows)).for_each(|(sum, f)| *sum += scale * f);
                }
                // The mean has the factor 1/N where harmonics have 2/N.
                force[0] *= 0.5;
                for &(j, [by_position, by_velocity]) in constant {
                    let functions = self.samples.functions(j, rows);
                    change.iter_mut().zip(functions).for_each(|(sum, f)| *sum += by_position * f);
                    for (k, (changes, of)) in
                        (1..).zip(change[1..].chunks_exact_mut(2).zip(functions[1..].chunks_exact(2)))
                    {
                        let rate = by_velocity * f64::from(k) * omega;
                        changes[0] -= rate * of[1];
                        changes[1] += rate * of[0];
                    }
                }
                products.begin();
                for (r, (force, change)) in force.iter().zip(&change).enumerate() {
                    for (i, weight) in &condensed.of_element[element] {
                        products.force(r * m + i, weight * force);
                        products.change(r * m + i, weight * change);
                    }
                }
                products.end(&mut self.operator);
            }
        }
        products.finish(&mut self.operator);
    }

    /// Adds the parts of derivatives by way of the phases at which forces jump.
    fn add_jumps(&mut self) {
        if self.samples.jumps.is_empty() {
            return;
        }
        let m = self.unknowns.count();
        let size = self.load.len();
        let omega = self.omega_rad_s();
        let mut products = Products::new(size, size);
        for Jump { phase_rad, load, change, by_frequency } in &self.samples.jumps {
            products.begin();
            let by_frequency = by_frequency / self.frequency_hz;
            let mut force = |row: usize, value: f64| {
                products.force(row, value);
                self.by_frequency[row] += value * by_frequency;
            };
            let waves: Vec<_> = (1..=self.harmonics).map(|k| libm::sincos(k as f64 * phase_rad)).collect();
            for &(i, part) in load {
                // The constant gets half of what each harmonic gets, as the mean of a signal does.
                force(i, 0.5 * part);
                for (row, (sine, cosine)) in (1..).step_by(2).zip(&waves) {
                    force(row * m + i, part * cosine);
                    force((row + 1) * m + i, part * sine);
                }
            }
            for &(i, [by_position, by_velocity]) in change {
                products.change(i, by_position);
                for (row, (sine, cosine)) in (1_usize..).step_by(2).zip(&waves) {
                    let rate = by_velocity * row.div_ceil(2) as f64 * omega;
                    products.change(row * m + i, by_position * cosine - rate * sine);
                    products.change((row + 1) * m + i, by_position * sine + rate * cosine);
                }
            }
            products.end(&mut self.operator);
        }
        products.finish(&mut self.operator);
    }

    /// Adds the part of the derivatives that comes from the elements' states.
    fn add_histories(&mut self) {
        let is_condensed = matches!(self.unknowns.body, Body::Condensed(_));
        let elements = self.forced.assembly.elements();
        let is_friction = |history: &History| matches!(elements[history.element].law, Law::Friction { .. });
        // Friction between places that are sums of unknowns has been added by stretches.
        let remains = |history: &&History| !(is_condensed && is_friction(history));
        if !self.samples.histories.iter().any(|history| remains(&history)) {
            return;
        }
        self.samples.set_functions();
        self.samples.set_rates();
        let m = self.unknowns.count();
        let size = self.load.len();
        let rows = size / m;
        let count = self.samples.count();
        let samples = &self.samples;
        let operator = &mut self.operator;
        let by_frequency = &mut self.by_frequency;
        for history in samples.histories.iter().filter(remains) {
            let element = &elements[history.element];
            // The displacement of a chain's element has a direction of its own at each sample; that of others is a sum of
            // unknowns with fixed weights, and is taken as the only unknown until the end.
            let spread: Vec<Weights> = match &self.unknowns.body {
                Body::Condensed(condensed) => vec![condensed.of_element[history.element].clone()],
                Body::Chain => {
                    let moves = |i: &usize| (0..count).any(|j| history.direction[j * m + i] != 0.0);
                    (0..m).filter(moves).map(|i| vec![(i, 1.0)]).collect()
                }
            };
            let active = spread.len();
            let turns = matches!(self.unknowns.body, Body::Chain);
            let direction = |j: usize, i: usize| if turns { history.direction[j * m + spread[i][0].0] } else { 1.0 };
            if active == 0 {
                continue;
            }
            let basis = |j: usize| (samples.functions(j, rows), samples.rates(j, rows));
            // Row by row of the element's own unknowns, all columns beside each other.
            let columns = rows * active + 1;
            let mut block = vec![0.0; rows * active * columns];
            let mut products = Products::new(rows * active, columns);
            let add = |j: usize, by: &[f64]| {
                let by_state = match element.law {
                    Law::Friction { stiffness, .. } => stiffness,
                    _ => element.force(history.position[j], history.velocity[j], history.state[j]).by_state,
                };
                let functions = samples.functions(j, rows);
                let waiting = products.waiting;
                for (r, of_function) in products.weights.chunks_exact_mut(active).enumerate() {
                    let scale = by_state * functions[r] * if r == 0 { 1.0 } else { 2.0 } / count as f64;
                    for (i, weight) in of_function.iter_mut().enumerate() {
                        weight[waiting] = scale * direction(j, i);
                    }
                }
                products.rows[waiting].copy_from_slice(by);
                products.end(&mut block);
            };
            history.derivative(direction, active, basis, self.frequency_hz, add);
            products.finish(&mut block);
            for (r, sums) in block.chunks_exact(columns).enumerate() {
                for (i, weight) in &spread[r % active] {
                    let row = r / active * m + i;
                    by_frequency[row] += weight * sums[columns - 1];
                    for (c, sum) in sums[..columns - 1].iter().enumerate() {
                        for (k, other) in &spread[c % active] {
                            operator[(c / active * m + k) * size + row] += weight * other * sum;
                        }
                    }
                }
            }
        }
    }

    /// Returns the components of the drive by their orders of the base frequency ω, those that the harmonics cover.
    fn components(&self) -> impl Iterator<Item = Component> + '_ {
        let of_base = |of: Component| Component { order: of.order * self.period(), ..of };
        self.forced.components().map(of_base).filter(|of| of.order <= self.harmonics)
    }

    /// Returns the component of the drive along the harmonic k of ω; zeros if there is none.
    fn driven(&self, k: usize) -> [f64; 2] {
        self.components().filter(|of| of.order == k).fold([0.0; 2], |[c, s], of| [c + of.parts[0], s + of.parts[1]])
    }

    /// Writes the derivatives of the rows by the drive's peak, for the response last evaluated.
    pub fn by_amplitude(&self, out: &mut [f64]) {
        let m = self.unknowns.count();
        out[..self.load.len()].fill(0.0);
        for i in 0..m {
            match &self.unknowns.body {
                Body::Chain => {
                    let signal = &self.samples.by_drive[i * self.samples.count()..][..self.samples.count()];
                    let scales = &self.row_scales;
                    project(&self.samples, signal, self.harmonics, |row, value| {
                        out[row * m + i] = value * scales[row * m + i];
                    });
                }
                Body::Condensed(_) => {
                    for k in 1..=self.harmonics {
                        let driven = self.driven(k);
                        if driven != [0.0; 2] {
                            let [h, _] = self.compliances[k].drive[i];
                            // The rows take off the displacement that the drive causes.
                            Pair::of(k, m).put(out, i, times(h, driven).map(|driven| -driven));
                        }
                    }
                }
            }
        }
    }

    /// Writes the derivatives of the rows by Ω/2π, for the response last linearised.
    fn rows_by_frequency(&self, out: &mut [f64]) {
        let m = self.unknowns.count();
        let period = self.period();
        if let Body::Chain = self.unknowns.body {
            let rows = self.by_frequency.iter().zip(&self.row_scales);
            out.iter_mut().zip(rows).for_each(|(out, (by, scale))| *out = by * scale);
            return;
        }
        for k in 0..=self.harmonics {
            let compliance = &self.compliances[k];
            let by_rate = TAU * k as f64 / period as f64;
            let rows = Pair::of(k, m);
            let driven = self.driven(k);
            for i in 0..m {
                let mut slope = [0.0; 2];
                for j in 0..m {
                    let [h, turned] = compliance.places[i * m + j];
                    // Product rule: d(H Q) = H dQ + dH Q, with the derivative of H by its own rate kΩ/ν.
                    let by = times(h, rows.at(&self.by_frequency, j));
                    let turned = times(turned * by_rate, rows.at(&self.load, j));
                    (0..2).for_each(|d| slope[d] += by[d] + turned[d]);
                }
                if driven != [0.0; 2] {
                    let driven = times(compliance.drive[i][1] * by_rate, driven);
                    (0..2).for_each(|d| slope[d] -= self.forced.amplitude * driven[d]);
                }
                rows.put(out, i, slope);
            }
        }
    }

    /// Writes the derivatives of the rows at the response X by a parameter of the structure; not numbers if structures
    /// to neither side exist. The response then has to be evaluated again.
    fn rows_by_parameter(&mut self, x: &[f64], parameter: Parameter, out: &mut [f64]) {
        let here = self.forced.assembly.clone();
        let value = here.value(parameter).unwrap_or(f64::NAN);
        let scale = if value == 0.0 || parameter.unit() == "°" { value.abs().max(1.0) } else { value.abs() };
        let step = PARAMETER_STEP * scale;
        // Central where the structure exists on both sides, or else to one side: above, then below.
        let stencils: [(f64, &[(f64, f64)]); 3] = [(step, &CENTRAL), (step, &ONE_SIDED), (-step, &ONE_SIDED)];
        let mut row = vec![0.0; x.len()];
        'stencils: for (step, stencil) in stencils {
            out[..x.len()].fill(0.0);
            for (offset, weight) in stencil {
                let Ok(shifted) = here.with(parameter, value + offset * step) else { continue 'stencils };
                self.set_assembly(shifted);
                self.evaluate_orbit(x);
                self.set_compliances();
                self.residual(x, &mut row);
                out.iter_mut().zip(&row).for_each(|(sum, row)| *sum += weight / (12.0 * step) * row);
            }
            self.set_assembly(here);
            return;
        }
        self.set_assembly(here);
        out[..x.len()].fill(f64::NAN);
    }

    /// Computes R(X) and its derivatives by X and then by coordinates, each in a column of `stride` numbers.
    pub fn derivatives(
        &mut self,
        x: &[f64],
        coordinates: &[Coordinate],
        residual: &mut [f64],
        matrix: &mut [f64],
        stride: usize,
    ) {
        let size = x.len();
        let columns = x.len()..;
        // Differences by a parameter evaluate other structures. They come first, so that the samples end at this
        // response.
        for (column, coordinate) in columns.clone().zip(coordinates) {
            if let Coordinate::Parameter(parameter) = *coordinate {
                self.rows_by_parameter(x, parameter, &mut matrix[column * stride..][..size]);
            }
        }
        self.evaluate_orbit(x);
        self.linearise();
        self.set_compliances();
        self.residual(x, residual);
        self.rows(matrix, stride);
        for (column, coordinate) in columns.zip(coordinates) {
            let out = &mut matrix[column * stride..][..size];
            match coordinate {
                Coordinate::FrequencyHz => self.rows_by_frequency(out),
                Coordinate::Amplitude => self.by_amplitude(out),
                Coordinate::Parameter(_) => {}
            }
        }
    }

    /// Computes the compliance H of a modal structure at every harmonic.
    fn set_compliances(&mut self) {
        let omega = self.omega_rad_s();
        let Body::Condensed(condensed) = &self.unknowns.body else { return };
        for (k, compliance) in self.compliances.iter_mut().enumerate().take(self.harmonics + 1) {
            let kept = self.kept.filter(|_| k == 1);
            condensed.compliance(k as f64 * omega, kept.map(|kept| kept.mode), compliance);
        }
    }

    /// Writes R of the response last evaluated. With U = c − is of a harmonic c cos + s sin, H U has the coefficients
    /// Re H c + Im H s and Re H s − Im H c.
    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        let m = self.unknowns.count();
        let Body::Condensed(condensed) = &self.unknowns.body else {
            let rows = self.load.iter().zip(&self.row_scales);
            residual.iter_mut().zip(rows).for_each(|(out, (load, scale))| *out = load * scale);
            return;
        };
        for k in 0..=self.harmonics {
            let compliance = &self.compliances[k];
            let kept = self.kept.filter(|_| k == 1);
            let rows = Pair::of(k, m);
            let driven = self.driven(k);
            for i in 0..m {
                let mut value = rows.at(x, i);
                // H₁ leaves out the kept mode, which moves the place by φ c cos Ωt.
                value[0] -= kept.map_or(0.0, |kept| condensed.places[i][kept.mode] * kept.cosine);
                for j in 0..m {
                    let part = times(compliance.places[i * m + j][0], rows.at(&self.load, j));
                    (0..2).for_each(|d| value[d] += part[d]);
                }
                if driven != [0.0; 2] {
                    let driven = times(compliance.drive[i][0], driven);
                    (0..2).for_each(|d| value[d] -= self.forced.amplitude * driven[d]);
                }
                rows.put(residual, i, value);
            }
        }
    }

    /// Writes ∂R/∂X of the response last linearised.
    fn rows(&self, matrix: &mut [f64], stride: usize) {
        let m = self.unknowns.count();
        let size = self.load.len();
        let columns = || self.operator.chunks_exact(size);
        let Body::Condensed(condensed) = &self.unknowns.body else {
            for (out, operator) in matrix.chunks_mut(stride).zip(columns()) {
                let rows = operator.iter().zip(&self.row_scales);
                out.iter_mut().zip(rows).for_each(|(out, (operator, scale))| *out = operator * scale);
            }
            return;
        };
        for (column, (out, operator)) in matrix.chunks_mut(stride).zip(columns()).enumerate() {
            let coupled = &condensed.coupled[column % m];
            for k in 0..=self.harmonics {
                let compliance = &self.compliances[k];
                let rows = Pair::of(k, m);
                for i in 0..m {
                    let mut value = [0.0; 2];
                    let own = [i];
                    for &j in if condensed.is_by_modes { &own[..] } else { coupled } {
                        let part = times(compliance.places[i * m + j][0], rows.at(operator, j));
                        (0..2).for_each(|d| value[d] += part[d]);
                    }
                    rows.put(out, i, value);
                }
            }
            // The displacement itself, of which H Q is taken off: the identity.
            out[column] += 1.0;
        }
    }

    /// The balance of the mode that is kept, whose first harmonic c cos Ωt is `kept`, in cos Ωt and in sin Ωt, N/√kg:
    /// the rows, and their derivatives by X and by Ω/2π. For the response last evaluated, with Q its forces,
    ///
    /// ```text
    /// (ω² − Ω²) c + Σ φ Q_c = 0,     −2ζωΩ c − φ_d p + Σ φ Q_s = 0
    /// ```
    pub fn kept_rows(&self, mut row: impl FnMut(usize, f64, f64), mut by: impl FnMut(usize, usize, f64)) {
        let m = self.unknowns.count();
        let size = self.load.len();
        let rate = self.omega_rad_s();
        let (Some(kept), Body::Condensed(condensed)) = (self.kept, &self.unknowns.body) else { return };
        let [omega, zeta] = condensed.modes[kept.mode];
        let own = [
            (omega * omega - rate * rate) * kept.cosine,
            -2.0 * zeta * omega * rate * kept.cosine - condensed.drive[kept.mode] * self.forced.amplitude,
        ];
        let own_slope = [-2.0 * rate * TAU * kept.cosine, -2.0 * zeta * omega * TAU * kept.cosine];
        for part in 0..2 {
            let sum = |of: &[f64]| -> f64 {
                condensed.places.iter().enumerate().map(|(i, phi)| phi[kept.mode] * of[(part + 1) * m + i]).sum()
            };
            row(part, own[part] + sum(&self.load), own_slope[part] + sum(&self.by_frequency));
            for (column, operator) in self.operator.chunks_exact(size).enumerate() {
                by(part, column, sum(operator));
            }
        }
    }

    /// Returns the displacement at a degree of freedom, as a series, for the response last evaluated.
    pub fn displacement(&self, dof: Dof) -> Vec<f64> {
        let m = self.unknowns.count();
        let count = self.samples.count();
        match &self.unknowns.body {
            Body::Chain => {
                let at = |j: usize| self.forced.assembly.displacement(dof, &self.samples.motion[0][j * m..(j + 1) * m]);
                self.series((0..count).map(at), 2 * self.harmonics + 1)
            }
            Body::Condensed(condensed) => self.along(condensed, &self.forced.assembly.direction_at_rest(dof)),
        }
    }

    /// Returns a coordinate of the structure, as a series, for the response last evaluated.
    pub fn coordinate_series(&self, coordinate: usize) -> Vec<f64> {
        let m = self.unknowns.count();
        let count = self.samples.count();
        match &self.unknowns.body {
            Body::Chain => {
                let at = |j: usize| self.samples.motion[0][j * m + coordinate];
                self.series((0..count).map(at), self.harmonics)
            }
            Body::Condensed(condensed) => {
                let mut direction = vec![0.0; condensed.modes.len()];
                direction[coordinate] = 1.0;
                self.along(condensed, &direction)
            }
        }
    }

    /// Returns the series of a signal at the samples, up to an order.
    fn series(&self, signal: impl Iterator<Item = f64>, orders: usize) -> Vec<f64> {
        let mut series = vec![0.0; 2 * orders + 1];
        project(&self.samples, &signal.collect::<Vec<_>>(), orders, |row, value| series[row] = value);
        series
    }

    /// Returns the series of a displacement Σ `direction` q of modes.
    fn along(&self, condensed: &Condensed, direction: &[f64]) -> Vec<f64> {
        let m = self.unknowns.count();
        let omega = self.omega_rad_s();
        let mut series = Vec::with_capacity(2 * self.harmonics + 1);
        for k in 0..=self.harmonics {
            let load = |i: usize| match k {
                0 => Complex::new(self.load[i], 0.0),
                _ => Complex::new(self.load[(2 * k - 1) * m + i], -self.load[2 * k * m + i]),
            };
            let loads: Vec<_> = (0..m).map(load).collect();
            let [c, s] = self.driven(k);
            let drive = Complex::new(c, -s) * self.forced.amplitude;
            let kept = self.kept.filter(|_| k == 1);
            let x = condensed.harmonic(k as f64 * omega, direction, kept, drive, &loads);
            series.push(x.re);
            if k > 0 {
                series.push(-x.im);
            }
        }
        series
    }
}

impl System for Balance {
    fn dimension(&self) -> usize {
        self.unknowns.count() * (2 * self.harmonics + 1)
    }

    fn evaluate(&mut self, x: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        if !self.set_value(lambda) {
            return false;
        }
        self.derivatives(x, &[self.coordinate], residual, matrix, x.len() + 1);
        true
    }

    fn evaluate_residual(&mut self, x: &[f64], lambda: f64, residual: &mut [f64]) -> bool {
        // The few samples of smooth forces take little more time with the derivatives.
        if self.forced.assembly().is_smooth() || !self.set_value(lambda) {
            return false;
        }
        self.evaluate_orbit(x);
        self.set_compliances();
        self.residual(x, residual);
        true
    }

    fn unit(&self) -> &'static str {
        self.unit_of(self.coordinate)
    }

    /// Half the way to the nearest linear resonance, or, at a resonance, half of its half-power bandwidth.
    fn parameter_step_limit(&self, lambda: f64) -> f64 {
        if self.coordinate != Coordinate::FrequencyHz {
            return f64::INFINITY;
        }
        let limits = self.forced.assembly.modes().iter().flat_map(|mode| {
            SUPERHARMONICS.map(|order| {
                let resonance_hz = mode.frequency_hz / order;
                (0.5 * (lambda - resonance_hz).abs()).max(mode.damping_ratio.max(LEAST_DAMPING) * resonance_hz)
            })
        });
        limits.fold(f64::INFINITY, f64::min)
    }
}
