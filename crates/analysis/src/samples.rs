//! A response at points of its period: the forces of the elements there, the unbalance of a chain, and their
//! derivatives.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_dynamics::structure::{
    Element, Law, Linearised, MOST_COORDINATES, MOST_DISPLACEMENTS, MOST_LINKS, Polynomial, Reaction,
};
use resonarm_numeric::dft::Fft;

use super::Forced;
use super::history::{History, has_history};
use super::ramp::Ramp;
use super::unknowns::{Body, Unknowns, Weights};
use crate::fourier::{Basis, uniform};

/// The least number of samples for which a fast transform is worth its preparation.
const LEAST_FAST: usize = 256;

/// Signals over a period.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    pub basis: Basis,
    /// Transforms of as many samples, if that is faster than projections: of a power of two that is not small.
    pub fft: Option<Fft>,
    /// 1, cos kτ, sin kτ, … at each sample, and their derivatives by time; see [`Samples::set_functions`].
    functions: Vec<f64>,
    rates: Vec<f64>,
    omega_rad_s: f64,
    /// u, u̇, ü, sample by sample.
    pub motion: [Vec<f64>; 3],
    /// u, u̇, ü of one unknown, before they are spread over `motion`, and its lines for a fast transform.
    signals: [Vec<f64>; 3],
    lines: Vec<Complex<f64>>,
    /// Q = Σ w f, for a chain with the unbalance: unknown by unknown.
    pub load: Vec<f64>,
    /// ∂Q/∂u, ∂Q/∂u̇, ∂Q/∂ü without the states' part, pair of unknowns by pair.
    pub by: [Vec<f64>; 3],
    /// h ∂Q/∂h with the interval h between samples, unknown by unknown.
    pub by_step: Vec<f64>,
    /// For a chain, ∂Q/∂(peak of the drive), unknown by unknown.
    pub by_drive: Vec<f64>,
    pub histories: Vec<History>,
    linearised: Linearised,
    /// Storage for the forces of an element.
    reactions: [Vec<f64>; 4],
}

/// An element in a position of the unknowns.
pub(super) struct Geometry {
    pub position: f64,
    pub velocity: f64,
    /// Derivative of the displacement by the unknowns, ∂x/∂u.
    pub direction: [f64; MOST_COORDINATES],
    /// For a chain, ∂²x/∂u² by rows and ∂v/∂u.
    curvature: Option<([f64; MOST_LINKS * MOST_LINKS], [f64; MOST_LINKS])>,
}

impl Geometry {
    /// Returns ∂v/∂u of one unknown.
    pub fn velocity_by_position(&self, unknown: usize) -> f64 {
        self.curvature.as_ref().map_or(0.0, |(_, turning)| turning[unknown])
    }
}

impl Samples {
    /// Storage for the elements of a structure; call [`Samples::set`] next.
    pub fn new(forced: &Forced, unknowns: &Unknowns) -> Samples {
        let with_state = forced.assembly.elements().iter().enumerate().filter(|(_, element)| has_history(element));
        Samples {
            basis: Basis::uniform(0, 0),
            fft: None,
            functions: vec![],
            rates: vec![],
            omega_rad_s: 0.0,
            motion: Default::default(),
            signals: Default::default(),
            lines: vec![],
            load: vec![],
            by: Default::default(),
            by_step: vec![],
            by_drive: vec![],
            histories: with_state.map(|(at, _)| History::new(at)).collect(),
            linearised: Linearised::new(unknowns.count()),
            reactions: Default::default(),
        }
    }

    /// Sets N points, and functions up to the harmonic `harmonics`.
    pub fn set(&mut self, harmonics: usize, samples: usize) {
        // If only the number of harmonics changes, the tables that are there stay valid.
        if self.count() != samples || self.basis.harmonics() == 0 {
            self.basis.set(harmonics, uniform(samples));
            let is_fast = samples.is_power_of_two() && samples >= LEAST_FAST;
            self.fft = is_fast.then(|| Fft::at_least(samples));
        } else if self.basis.harmonics() != harmonics {
            self.basis.resize(harmonics);
        } else {
            return;
        }
        self.functions.clear();
        self.rates.clear();
    }

    /// Sets points at other phases than evenly spaced ones, rad, and functions up to the harmonic `harmonics`.
    pub fn set_phases(&mut self, harmonics: usize, phases_rad: impl Iterator<Item = f64>) {
        self.basis.set(harmonics, phases_rad);
        self.fft = None;
        self.functions.clear();
        self.rates.clear();
    }

    /// Number of samples a period, N.
    pub fn count(&self) -> usize {
        self.basis.samples()
    }

    /// Number of functions that a sample evaluates.
    fn functions_count(&self) -> usize {
        2 * self.basis.harmonics() + 1
    }

    /// Returns the first `rows` functions at a sample, after [`Samples::set_functions`].
    pub fn functions(&self, j: usize, rows: usize) -> &[f64] {
        &self.functions[j * self.functions_count()..][..rows]
    }

    /// Returns the rates of these functions, after [`Samples::set_rates`].
    pub fn rates(&self, j: usize, rows: usize) -> &[f64] {
        &self.rates[j * self.functions_count()..][..rows]
    }

    /// Computes the values that [`Samples::functions`] returns, which only the derivatives of elements with a state
    /// need.
    pub fn set_functions(&mut self) {
        let (count, samples) = (self.functions_count(), self.count());
        if !self.functions.is_empty() {
            return;
        }
        self.functions.resize(samples * count, 1.0);
        for k in 1..=count / 2 {
            let (cosines, sines) = self.basis.tables(k - 1);
            for j in 0..samples {
                self.functions[j * count + 2 * k - 1] = cosines[j];
                self.functions[j * count + 2 * k] = sines[j];
            }
        }
    }

    /// Computes the values that [`Samples::rates`] returns, from those of the functions.
    pub fn set_rates(&mut self) {
        let count = self.functions_count();
        if !self.rates.is_empty() {
            return;
        }
        self.rates.resize(self.functions.len(), 0.0);
        for (rates, functions) in self.rates.chunks_exact_mut(count).zip(self.functions.chunks_exact(count)) {
            for k in 1..=count / 2 {
                let rate = k as f64 * self.omega_rad_s;
                rates[2 * k - 1] = -rate * functions[2 * k];
                rates[2 * k] = rate * functions[2 * k - 1];
            }
        }
    }

    /// Computes u and u̇ of a series of all unknowns, and ü of a chain, whose forces depend on it; of modes ü stays
    /// zero.
    pub fn synthesise(&mut self, x: &[f64], unknowns: &Unknowns, omega_rad_s: f64) {
        if omega_rad_s != self.omega_rad_s {
            self.omega_rad_s = omega_rad_s;
            self.rates.clear();
        }
        let (samples, m) = (self.count(), unknowns.count());
        self.motion.iter_mut().for_each(|signal| signal.resize(samples * m, 0.0));
        let with_acceleration = matches!(unknowns.body, Body::Chain);
        // One unknown after the other in signals without gaps, which the sums over the harmonics pass many times.
        for i in 0..m {
            let [position, velocity, acceleration] = &mut self.signals;
            position.clear();
            position.resize(samples, x[i]);
            for signal in [&mut *velocity, &mut *acceleration] {
                signal.clear();
                signal.resize(samples, 0.0);
            }
            let pairs = (1..).zip(x[m..].chunks_exact(2 * m)).map(|(k, pair)| (k, pair[i], pair[m + i]));
            let is_fast = !with_acceleration && x.len() < samples * m;
            if let Some(fft) = self.fft.as_ref().filter(|_| is_fast) {
                self.lines.clear();
                self.lines.resize(samples, Complex::new(0.0, 0.0));
                self.lines[0].re = x[i];
                // Of u + i u̇/Ω, so that both are of the same order.
                for (k, a, b) in pairs {
                    let [position, velocity] = [Complex::new(a, -b), Complex::new(b, a) * k as f64].map(|of| of * 0.5);
                    let turned = |of: Complex<f64>| Complex::new(-of.im, of.re);
                    self.lines[k] = position + turned(velocity);
                    self.lines[samples - k] = position.conj() + turned(velocity.conj());
                }
                fft.backward(&mut self.lines);
                for ((position, velocity), value) in position.iter_mut().zip(velocity).zip(&self.lines) {
                    (*position, *velocity) = (value.re, omega_rad_s * value.im);
                }
            } else {
                for (k, a, b) in pairs {
                    let (tables, rate) = (self.basis.tables(k - 1), k as f64 * omega_rad_s);
                    add_sine(position, tables, [a, b]);
                    // cos kτ has the rate −kΩ sin kτ, sin kτ the rate kΩ cos kτ.
                    add_sine(velocity, tables, [rate * b, -rate * a]);
                    if with_acceleration {
                        add_sine(acceleration, tables, [-rate * rate * a, -rate * rate * b]);
                    }
                }
            }
            for (motion, signal) in self.motion.iter_mut().zip(&self.signals) {
                motion[i..].iter_mut().step_by(m).zip(signal).for_each(|(motion, value)| *motion = *value);
            }
        }
    }

    /// Computes Q and its derivatives along the response.
    pub fn evaluate(&mut self, forced: &Forced, unknowns: &Unknowns, frequency_hz: f64) {
        let (samples, m) = (self.count(), unknowns.count());
        let is_chain = matches!(unknowns.body, Body::Chain);
        let [by_position, by_velocity, by_acceleration] = &mut self.by;
        for (signal, pairs) in [(&mut self.load, m), (by_position, m * m), (by_velocity, m * m)] {
            // The unbalance of a chain is written over all of them.
            if !is_chain {
                signal.clear();
            }
            signal.resize(pairs * samples, 0.0);
        }
        // Elements of modes leave it at zero.
        by_acceleration.resize(m * m * samples, 0.0);
        self.by_step.clear();
        self.by_step.resize(m * samples, 0.0);
        self.histories.iter_mut().for_each(History::clear);
        if let Body::Chain = unknowns.body {
            self.unbalance(forced, unknowns);
        }
        let step_s = TAU / (self.omega_rad_s * samples as f64);
        if let Body::Condensed(condensed) = &unknowns.body {
            for (e, element) in forced.assembly.elements().iter().enumerate() {
                self.along_one(e, &condensed.of_element[e], element, [step_s, frequency_hz]);
            }
            for (polynomial, displacements) in forced.assembly.polynomials().iter().zip(&condensed.of_polynomial) {
                self.along_places(polynomial, displacements, m);
            }
        } else {
            self.along_links(forced, unknowns, [step_s, frequency_hz]);
            for polynomial in forced.assembly.polynomials() {
                self.along_coordinates(forced, polynomial, m);
            }
        }
    }

    /// Adds the part of a polynomial whose displacements are sums of unknowns, of `m`.
    fn along_places(&mut self, polynomial: &Polynomial, displacements: &[Weights], m: usize) {
        let (samples, size) = (self.count(), displacements.len());
        let [mut x, mut forces] = [[0.0; MOST_DISPLACEMENTS]; 2];
        let mut stiffness = [0.0; MOST_DISPLACEMENTS * MOST_DISPLACEMENTS];
        for j in 0..samples {
            let motion = &self.motion[0][j * m..(j + 1) * m];
            x.iter_mut().zip(displacements).for_each(|(x, weights)| *x = sum(weights, motion));
            polynomial.forces(&x[..size], &mut forces[..size]);
            polynomial.stiffness(&x[..size], &mut stiffness);
            for (i, rows) in displacements.iter().enumerate() {
                for &(row, weight) in rows {
                    self.load[row * samples + j] += weight * forces[i];
                    for (k, columns) in displacements.iter().enumerate() {
                        for &(column, other) in columns {
                            self.by[0][(row * m + column) * samples + j] += weight * other * stiffness[i * size + k];
                        }
                    }
                }
            }
        }
    }

    /// Adds the part of a polynomial of a chain: Σ wᵢ fᵢ, and Σ fᵢ ∂wᵢ/∂u + Σ wᵢ ∂²V/∂xᵢ∂xₖ wₖᵀ as its derivative.
    fn along_coordinates(&mut self, forced: &Forced, polynomial: &Polynomial, m: usize) {
        let (samples, size) = (self.count(), polynomial.at().len());
        let [mut x, mut forces] = [[0.0; MOST_DISPLACEMENTS]; 2];
        let mut stiffness = [0.0; MOST_DISPLACEMENTS * MOST_DISPLACEMENTS];
        let mut directions = [[0.0; MOST_LINKS]; MOST_DISPLACEMENTS];
        for j in 0..samples {
            let at = forced.assembly.at(&self.motion[0][j * m..(j + 1) * m]);
            for ((x, direction), dof) in x.iter_mut().zip(&mut directions).zip(polynomial.at()) {
                *x = at.displacement(*dof);
                at.direction(*dof, &mut direction[..m]);
            }
            polynomial.forces(&x[..size], &mut forces[..size]);
            polynomial.stiffness(&x[..size], &mut stiffness);
            let mut slopes = [0.0; MOST_LINKS * MOST_LINKS];
            for (i, (dof, w)) in polynomial.at().iter().zip(&directions).enumerate() {
                at.add_curvature(*dof, forces[i], &mut slopes[..m * m]);
                (0..m).for_each(|row| self.load[row * samples + j] += w[row] * forces[i]);
                for (k, other) in directions[..size].iter().enumerate() {
                    for pair in 0..m * m {
                        slopes[pair] += w[pair / m] * stiffness[i * size + k] * other[pair % m];
                    }
                }
            }
            (0..m * m).for_each(|pair| self.by[0][pair * samples + j] += slopes[pair]);
        }
    }

    /// Adds the part of the elements of a chain.
    fn along_links(&mut self, forced: &Forced, unknowns: &Unknowns, [step_s, frequency_hz]: [f64; 2]) {
        let (samples, m) = (self.count(), unknowns.count());
        for (e, element) in forced.assembly.elements().iter().enumerate() {
            let mut geometries: Vec<Geometry> = Vec::new();
            let history = self.histories.iter().position(|history| history.element == e);
            for j in 0..samples {
                let [u, v] = [0, 1].map(|d| &self.motion[d][j * m..(j + 1) * m]);
                let geometry = geometry(forced, unknowns, e, u, v);
                if let Some(history) = history {
                    let history = &mut self.histories[history];
                    history.position.push(geometry.position);
                    history.velocity.push(geometry.velocity);
                    history.direction.extend_from_slice(&geometry.direction[..m]);
                    geometries.push(geometry);
                } else {
                    let (reaction, by_step) = between_samples(element, [geometry.position, geometry.velocity], step_s);
                    self.add(j, m, &geometry, &reaction);
                    (0..m).for_each(|i| self.by_step[i * samples + j] += geometry.direction[i] * by_step);
                }
            }
            if let Some(history) = history {
                self.histories[history].run(element.law(), step_s, frequency_hz);
                for (j, geometry) in geometries.iter().enumerate() {
                    let z = self.histories[history].mean[j];
                    let reaction = element_force(element, [geometry.position, geometry.velocity], z);
                    self.add(j, m, geometry, &reaction);
                }
            }
        }
    }

    /// Adds the part of an element whose displacement is a sum of unknowns.
    fn along_one(&mut self, e: usize, weights: &Weights, element: &Element, [step_s, frequency_hz]: [f64; 2]) {
        let samples = self.count();
        let m = self.motion[0].len() / samples;
        let history = self.histories.iter().position(|history| history.element == e);
        if let Some(history) = history {
            let history = &mut self.histories[history];
            history.position.extend(self.motion[0].chunks_exact(m).map(|motion| sum(weights, motion)));
            history.velocity.extend(self.motion[1].chunks_exact(m).map(|motion| sum(weights, motion)));
            history.direction.resize(m * samples, 0.0);
            for (place, weight) in weights {
                history.direction.iter_mut().skip(*place).step_by(m).for_each(|along| *along = *weight);
            }
            history.run(element.law(), step_s, frequency_hz);
        }
        // The force, its derivatives by x, by v and by the interval, sample by sample.
        let reactions = &mut self.reactions;
        reactions.iter_mut().for_each(Vec::clear);
        for j in 0..samples {
            let [x, v] = [0, 1].map(|d| sum(weights, &self.motion[d][j * m..(j + 1) * m]));
            let (reaction, by_step) = match history {
                Some(history) => (element_force(element, [x, v], self.histories[history].mean[j]), 0.0),
                None => between_samples(element, [x, v], step_s),
            };
            let Reaction { force, by_position, by_velocity, .. } = reaction;
            let numbers = [force, by_position, by_velocity, by_step];
            reactions.iter_mut().zip(numbers).for_each(|(of_samples, number)| of_samples.push(number));
        }
        let [force, by_position, by_velocity, by_step] = &*reactions;
        // Most laws have only some of the derivatives.
        let [has_position, has_velocity, has_step] =
            [by_position, by_velocity, by_step].map(|by| by.iter().any(|by| *by != 0.0));
        for &(row, weight) in weights {
            let of_row = row * samples..(row + 1) * samples;
            add_times(&mut self.load[of_row.clone()], weight, force);
            if has_step {
                add_times(&mut self.by_step[of_row], weight, by_step);
            }
            for &(column, other) in weights {
                let of_pair = (row * m + column) * samples..(row * m + column + 1) * samples;
                if has_position {
                    add_times(&mut self.by[0][of_pair.clone()], weight * other, by_position);
                }
                if has_velocity {
                    add_times(&mut self.by[1][of_pair], weight * other, by_velocity);
                }
            }
        }
    }

    /// Adds the unbalance of a chain under its drive.
    fn unbalance(&mut self, forced: &Forced, unknowns: &Unknowns) {
        let (samples, n) = (self.count(), unknowns.count());
        self.by_drive.clear();
        self.by_drive.resize(n * samples, 0.0);
        let (mut direction, mut force) = ([0.0; MOST_LINKS], [0.0; MOST_LINKS]);
        let components = forced.components().map(|of| (of.order * unknowns.period, of.parts));
        let waves: Vec<(usize, [f64; 2])> = components.filter(|(order, _)| *order <= self.basis.harmonics()).collect();
        for j in 0..samples {
            let [u, v, a] = [0, 1, 2].map(|d| &self.motion[d][j * n..(j + 1) * n]);
            let along = |(order, [c, s]): &(usize, [f64; 2])| {
                let (cosines, sines) = self.basis.tables(order - 1);
                c * cosines[j] + s * sines[j]
            };
            let wave: f64 = waves.iter().map(along).sum();
            let at = forced.assembly.at(u);
            forced.direction(&at, &mut direction[..n]);
            force.iter_mut().zip(&direction).for_each(|(force, w)| *force = w * forced.amplitude * wave);
            at.linearise(v, a, &force[..n], &mut self.linearised);
            // The direction of the drive turns with the structure, so that its force acts like a stiffness.
            forced.add_curvature(&at, -forced.amplitude * wave, &mut self.linearised.by_position);
            for (i, (unbalance, along)) in self.linearised.unbalance.iter().zip(&direction).enumerate() {
                self.load[i * samples + j] = *unbalance;
                self.by_drive[i * samples + j] = -along * wave;
            }
            let of = &self.linearised;
            let matrices = [&of.by_position, &of.by_velocity, &of.by_acceleration];
            for (signal, matrix) in self.by.iter_mut().zip(matrices) {
                (0..n * n).for_each(|pair| signal[pair * samples + j] = matrix[pair]);
            }
        }
    }

    /// Adds w f and its derivatives at a sample: ∂(w f) = f ∂w + w (f_x wᵀ du + f_v (wᵀ du̇ + ∂v/∂u du)).
    fn add(&mut self, j: usize, m: usize, at: &Geometry, reaction: &Reaction) {
        let samples = self.count();
        let Reaction { force, by_position, by_velocity, .. } = *reaction;
        for i in 0..m {
            let w = at.direction[i];
            self.load[i * samples + j] += w * force;
            for k in 0..m {
                let cell = (i * m + k) * samples + j;
                let mut stiffness = w * at.direction[k] * by_position;
                if let Some((curvature, turning)) = &at.curvature {
                    stiffness += force * curvature[i * m + k] + by_velocity * w * turning[k];
                }
                self.by[0][cell] += stiffness;
                self.by[1][cell] += w * at.direction[k] * by_velocity;
            }
        }
    }
}

/// Returns a displacement, or its rate, from those of the unknowns.
fn sum(weights: &Weights, of: &[f64]) -> f64 {
    weights.iter().map(|(place, weight)| weight * of[*place]).sum()
}

/// Adds `factor` times a signal to another.
fn add_times(to: &mut [f64], factor: f64, signal: &[f64]) {
    to.iter_mut().zip(signal).for_each(|(to, value)| *to += factor * value);
}

/// Adds a cos kτ + b sin kτ to a signal.
fn add_sine(signal: &mut [f64], (cosines, sines): (&[f64], &[f64]), [a, b]: [f64; 2]) {
    signal.iter_mut().zip(cosines.iter().zip(sines)).for_each(|(value, (c, s))| *value += a * c + b * s);
}

/// Returns the geometry of an element at u and u̇.
pub(super) fn geometry(forced: &Forced, unknowns: &Unknowns, element: usize, u: &[f64], v: &[f64]) -> Geometry {
    let mut direction = [0.0; MOST_COORDINATES];
    if let Body::Condensed(condensed) = &unknowns.body {
        let weights = &condensed.of_element[element];
        weights.iter().for_each(|(place, weight)| direction[*place] = *weight);
        return Geometry { position: sum(weights, u), velocity: sum(weights, v), direction, curvature: None };
    }
    let (at, element, n) = (forced.assembly.at(u), &forced.assembly.elements()[element], u.len());
    at.element_direction(element, &mut direction);
    let velocity = direction.iter().zip(v).map(|(w, v)| w * v).sum();
    let position = at.element_displacement(element);
    if element.at().is_angle() {
        return Geometry { position, velocity, direction, curvature: None };
    }
    let (mut curvature, mut turning) = ([0.0; MOST_LINKS * MOST_LINKS], [0.0; MOST_LINKS]);
    at.add_curvature(element.at(), 1.0, &mut curvature);
    if let Some(to) = element.to() {
        at.add_curvature(to, -1.0, &mut curvature);
    }
    for (turning, row) in turning.iter_mut().zip(curvature.chunks_exact(n)) {
        *turning = row.iter().zip(v).map(|(c, v)| c * v).sum();
    }
    Geometry { position, velocity, direction, curvature: Some((curvature, turning)) }
}

/// Returns the force of an element at a displacement, a velocity and a state.
pub(super) fn element_force(element: &Element, [position, velocity]: [f64; 2], state: f64) -> Reaction {
    let mut reaction = element.force(position, velocity, state);
    if let Law::Friction { stiffness, .. } = *element.law() {
        // The state, which is held within its reach, has all of the force.
        reaction = Reaction { force: stiffness * state, by_state: stiffness, ..Reaction::default() };
    }
    reaction
}

/// Returns the force of an element without a state as it counts at a sample: where a contact opens or closes within
/// half an interval h, its mean over the interval around the sample with x moving at v. So the mean over the samples,
/// and its derivative, change continuously with the response, though the law has a kink, or a jump to c δ̇ where a
/// damped contact closes.
///
/// The second number is h ∂f/∂h.
fn between_samples(element: &Element, [position, velocity]: [f64; 2], step_s: f64) -> (Reaction, f64) {
    let plain = || (element.force(position, velocity, 0.0), 0.0);
    let [seat, at_rest] = element.law().seat().unwrap_or_default();
    let position = position + seat;
    match *element.law() {
        Law::Gap { stiffness, gap, .. } => {
            let [upper, lower] = [1.0, -1.0].map(|sign| {
                let ramp = Ramp::new(sign * position - gap, sign * velocity, step_s);
                (sign * ramp.mean, ramp.by_position, ramp.by_velocity)
            });
            let reaction = Reaction {
                force: stiffness * (upper.0 + lower.0) - at_rest,
                by_position: stiffness * (upper.1 + lower.1),
                by_velocity: stiffness * (upper.2 + lower.2),
                by_state: 0.0,
            };
            (reaction, reaction.by_velocity * velocity)
        }
        Law::KelvinVoigt { stiffness, damping, gap, side, .. } => {
            let sign = side.sign();
            let (depth, rate) = (sign * position - gap, sign * velocity);
            if depth.abs() >= 0.5 * rate.abs() * step_s || (damping > 0.0 && rate < 0.0) {
                return plain();
            }
            let ramp = Ramp::new(depth, rate, step_s);
            // The damper acts for the part ½ + δ/(δ̇ h) of the interval.
            let reaction = Reaction {
                force: sign * (stiffness * ramp.mean + damping * (0.5 * rate + depth / step_s)) - at_rest,
                by_position: stiffness * ramp.by_position + damping / step_s,
                by_velocity: stiffness * ramp.by_velocity + 0.5 * damping,
                by_state: 0.0,
            };
            (reaction, sign * (stiffness * ramp.by_velocity * rate - damping * depth / step_s))
        }
        _ => plain(),
    }
}
