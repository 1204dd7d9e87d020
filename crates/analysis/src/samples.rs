//! A response at points of its period: the forces of the elements there, the unbalance of a chain, and their
//! derivatives.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{FRAC_1_PI, TAU};

use nalgebra::Complex;
use resonarm_dynamics::structure::{
    Branch, Element, Law, Linearised, MOST_COORDINATES, MOST_DISPLACEMENTS, MOST_LINKS, Polynomial, Reaction,
};
use resonarm_numeric::dft::Fft;

use super::contact::{Acting, Instant, Motion, Part, parts};
use super::dense::add;
use super::history::History;
use super::ramp::Ramp;
use super::unknowns::{Body, Unknowns, Weights};
use crate::forced::Forced;
use crate::fourier::{Basis, uniform, values};

/// The least number of samples for which a fast transform is worth its preparation.
const LEAST_FAST: usize = 256;

/// Signals over a period.
#[derive(Clone, Debug, Default)]
pub(super) struct Samples {
    pub basis: Basis,
    /// Transforms of as many samples, if that is faster than projections: of a power of two that is not small.
    pub fft: Option<Fft>,
    /// 1, cos kτ, sin kτ, … at each sample, and their derivatives by time; see [`Samples::set_functions`].
    functions: Vec<f64>,
    rates: Vec<f64>,
    omega_rad_s: f64,
    /// The series of all unknowns.
    series: Vec<f64>,
    /// u, u̇, ü, sample by sample.
    pub motion: [Vec<f64>; 3],
    /// u, u̇, ü of one unknown, before they are spread over `motion`, and its lines for a fast transform.
    signals: [Vec<f64>; 3],
    lines: Vec<Complex<f64>>,
    /// Q = Σ w f, for a chain with the unbalance: unknown by unknown.
    pub load: Vec<f64>,
    /// ∂Q/∂u, ∂Q/∂u̇, ∂Q/∂ü without the states' part, pair of unknowns by pair.
    pub by: [Vec<f64>; 3],
    /// Where forces begin or end with a jump.
    pub jumps: Vec<Jump>,
    /// For a chain, ∂Q/∂(peak of the drive), unknown by unknown.
    pub by_drive: Vec<f64>,
    pub histories: Vec<History>,
    linearised: Linearised,
    /// Storage for x and v of an element at the samples, and for its forces.
    element: [Vec<f64>; 2],
    reactions: Reactions,
}

/// How a force counts that acts for a part of the period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Contacts {
    /// With the instants at which it begins and ends, so that the Fourier coefficients are those of the force.
    Located,
    /// At each sample with its mean over the interval around the sample: what the flow of variations needs.
    Averaged,
}

/// The derivative of Q by way of a phase φ at which a force begins or ends with a jump.
#[derive(Clone, Debug)]
pub(super) struct Jump {
    pub phase_rad: f64,
    /// Unknown and 1/π times the change of Q by −dφ: the derivative of its harmonic k by φ has the part cos kφ of it along
    /// cos kτ, and sin kφ along sin kτ.
    pub load: Vec<(usize, f64)>,
    /// Unknown, and ∂φ/∂u and ∂φ/∂u̇ by the response at φ.
    pub change: Vec<(usize, [f64; 2])>,
    /// f ∂φ/∂f with the frequency f, at constant displacements.
    pub by_frequency: f64,
}

impl Jump {
    /// The derivative where a part of an element begins or ends to act, at x and v; `along` has ∂x/∂u and ∂v/∂u of each
    /// unknown. φ is a zero of E(x, v), so that ∂φ = −∂E/E′.
    fn new(element: &Element, part: &Part, instant: &Instant, [x, v]: [f64; 2], along: &[(usize, [f64; 2])]) -> Jump {
        let Instant { phase_rad, begins, condition, slope, .. } = *instant;
        let open = element.law.reaction(Branch::Inner, x, v, 0.0);
        let force = element.law.reaction(part.branch, x, v, 0.0).force - open.force;
        // What begins later is less.
        let by_phase = force * if begins { -FRAC_1_PI } else { FRAC_1_PI };
        let [by_x, by_v] = [condition.by_depth, condition.by_rate_s].map(|by| -part.sign * by / slope);
        let change =
            |&(i, [direction, turning]): &(usize, [f64; 2])| (i, [by_x * direction + by_v * turning, by_v * direction]);
        Jump {
            phase_rad,
            load: along.iter().map(|(i, [direction, _])| (*i, by_phase * direction)).collect(),
            change: along.iter().map(change).collect(),
            by_frequency: by_v * v,
        }
    }
}

/// An element over a period.
struct Along<'a> {
    /// x and v at the samples.
    position: &'a [f64],
    velocity: &'a [f64],
    /// Of an element with a state, what counts of it there.
    state: Option<&'a [f64]>,
    motion: Motion<'a>,
}

/// The force of an element over a period.
#[derive(Clone, Debug, Default)]
struct Reactions {
    /// The force and its derivatives by x and v, sample by sample.
    numbers: [Vec<f64>; 3],
    /// The instants at which the force jumps, each with the part of the law that begins or ends to act.
    jumps: Vec<(Part, Instant)>,
    acting: Acting,
}

impl Reactions {
    fn compute(&mut self, element: &Element, along: &Along, of_interval: Interval, fft: Option<&Fft>) {
        let Interval { step_s, contacts, .. } = of_interval;
        let Along { position, velocity, state, motion } = *along;
        self.numbers.iter_mut().for_each(Vec::clear);
        self.jumps.clear();
        let put = |of: Reaction, numbers: &mut [Vec<f64>; 3]| {
            let of = [of.force, of.by_position, of.by_velocity];
            numbers.iter_mut().zip(of).for_each(|(of_samples, number)| of_samples.push(number));
        };
        let samples = || position.iter().zip(velocity).map(|(x, v)| [*x, *v]);
        if let Some(state) = state {
            let at = |(at, state): ([f64; 2], &f64)| element_force(element, at, *state);
            return samples().zip(state).for_each(|of| put(at(of), &mut self.numbers));
        }
        let parts = parts(&element.law);
        if parts[0].is_none() {
            return samples().for_each(|[x, v]| put(element.force(x, v, 0.0), &mut self.numbers));
        }
        if contacts == Contacts::Averaged {
            return samples().for_each(|at| put(around_sample(element, at, step_s), &mut self.numbers));
        }
        // The force of an open contact is constant.
        let open = element.law.reaction(Branch::Inner, 0.0, 0.0, 0.0);
        samples().for_each(|_| put(open, &mut self.numbers));
        for part in parts.into_iter().flatten() {
            self.acting.find(&part, [position, velocity], motion, step_s, fft);
            // Where a condition only touches zero, its phase has no derivative.
            let jumps = self.acting.instants.iter().filter(|of| of.jumps && of.slope != 0.0);
            self.jumps.extend(jumps.map(|of| (part, *of)));
            for (j, (weight, [x, v])) in self.acting.weights.iter().zip(samples()).enumerate() {
                if *weight != 0.0 {
                    let closed = element.law.reaction(part.branch, x, v, 0.0);
                    self.numbers[0][j] += weight * (closed.force - open.force);
                    self.numbers[1][j] += weight * closed.by_position;
                    self.numbers[2][j] += weight * closed.by_velocity;
                }
            }
        }
    }
}

/// What the samples of an evaluation have in common.
#[derive(Clone, Copy, Debug)]
struct Interval {
    step_s: f64,
    frequency_hz: f64,
    contacts: Contacts,
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
        let with_state = forced.assembly.elements().iter().enumerate().filter(|(_, element)| element.law.has_state());
        Samples {
            histories: with_state.map(|(at, _)| History::new(at)).collect(),
            linearised: Linearised::new(unknowns.count()),
            ..Samples::default()
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
        let count = self.functions_count();
        let samples = self.count();
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
        self.series.clear();
        self.series.extend_from_slice(x);
        let samples = self.count();
        let m = unknowns.count();
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
                    *position = value.re;
                    *velocity = omega_rad_s * value.im;
                }
            } else {
                for (k, a, b) in pairs {
                    let tables = self.basis.tables(k - 1);
                    let rate = k as f64 * omega_rad_s;
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
    pub fn evaluate(&mut self, forced: &Forced, unknowns: &Unknowns, frequency_hz: f64, contacts: Contacts) {
        let samples = self.count();
        let m = unknowns.count();
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
        self.jumps.clear();
        self.histories.iter_mut().for_each(History::clear);
        if let Body::Chain = unknowns.body {
            self.unbalance(forced, unknowns);
        }
        let of_interval = Interval { step_s: TAU / (self.omega_rad_s * samples as f64), frequency_hz, contacts };
        if let Body::Condensed(condensed) = &unknowns.body {
            for (e, element) in forced.assembly.elements().iter().enumerate() {
                self.along_one(e, &condensed.of_element[e], element, of_interval);
            }
            for (polynomial, displacements) in forced.assembly.polynomials().iter().zip(&condensed.of_polynomial) {
                self.along_places(polynomial, displacements, m);
            }
        } else {
            self.along_links(forced, unknowns, of_interval);
            for polynomial in forced.assembly.polynomials() {
                self.along_coordinates(forced, polynomial, m);
            }
        }
    }

    /// Adds the part of a polynomial whose displacements are sums of unknowns, of `m`.
    fn along_places(&mut self, polynomial: &Polynomial, displacements: &[Weights], m: usize) {
        let samples = self.count();
        let size = displacements.len();
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
        let samples = self.count();
        let size = polynomial.at().len();
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
    fn along_links(&mut self, forced: &Forced, unknowns: &Unknowns, of_interval: Interval) {
        let samples = self.count();
        let m = unknowns.count();
        let mut reactions = core::mem::take(&mut self.reactions);
        for (e, element) in forced.assembly.elements().iter().enumerate() {
            let history = self.histories.iter().position(|history| history.element == e);
            let at = |motion: &[Vec<f64>; 3], j: usize| {
                let [u, v] = [0, 1].map(|d| &motion[d][j * m..(j + 1) * m]);
                geometry(forced, unknowns, e, u, v)
            };
            if history.is_none() && parts(&element.law)[0].is_none() {
                for j in 0..samples {
                    let geometry = at(&self.motion, j);
                    self.add(j, m, &geometry, &element.force(geometry.position, geometry.velocity, 0.0));
                }
                continue;
            }
            let geometries: Vec<Geometry> = (0..samples).map(|j| at(&self.motion, j)).collect();
            self.element.iter_mut().for_each(Vec::clear);
            for geometry in &geometries {
                self.element[0].push(geometry.position);
                self.element[1].push(geometry.velocity);
            }
            if let Some(history) = history {
                geometries
                    .iter()
                    .for_each(|at| self.histories[history].direction.extend_from_slice(&at.direction[..m]));
                self.run_history(history, &element.law, of_interval);
            }
            let at_phase = |phase_rad: f64| {
                let [u, v, a] = self.at_phase(phase_rad, m);
                (geometry(forced, unknowns, e, &u, &v), v, a)
            };
            let motion = |phase_rad: f64| {
                let (at, v, a) = at_phase(phase_rad);
                // d(∂x/∂u u̇)/dt.
                let part = |i: usize| at.direction[i] * a[i] + at.velocity_by_position(i) * v[i];
                [at.position, at.velocity, (0..m).map(part).sum()]
            };
            let state = history.map(|history| &self.histories[history].mean[..]);
            let [position, velocity] = &self.element;
            let along = Along { position, velocity, state, motion: &motion };
            reactions.compute(element, &along, of_interval, self.fft.as_ref());
            let jump = |(part, instant): &(Part, Instant)| {
                let (at, ..) = at_phase(instant.phase_rad);
                let along: Vec<_> = (0..m).map(|i| (i, [at.direction[i], at.velocity_by_position(i)])).collect();
                Jump::new(element, part, instant, [at.position, at.velocity], &along)
            };
            let jumps: Vec<Jump> = reactions.jumps.iter().map(jump).collect();
            self.jumps.extend(jumps);
            for (j, geometry) in geometries.iter().enumerate() {
                let [force, by_position, by_velocity] = reactions.numbers.each_ref().map(|of_samples| of_samples[j]);
                self.add(j, m, geometry, &Reaction { force, by_position, by_velocity, by_state: 0.0 });
            }
        }
        self.reactions = reactions;
    }

    /// Adds the part of an element whose displacement is a sum of unknowns.
    fn along_one(&mut self, e: usize, weights: &Weights, element: &Element, of_interval: Interval) {
        let samples = self.count();
        let m = self.motion[0].len() / samples;
        for (signal, motion) in self.element.iter_mut().zip(&self.motion) {
            signal.clear();
            signal.extend(motion.chunks_exact(m).map(|motion| sum(weights, motion)));
        }
        let history = self.histories.iter().position(|history| history.element == e);
        if let Some(history) = history {
            let direction = &mut self.histories[history].direction;
            direction.resize(m * samples, 0.0);
            for (place, weight) in weights {
                direction.iter_mut().skip(*place).step_by(m).for_each(|along| *along = *weight);
            }
            self.run_history(history, &element.law, of_interval);
        }
        let mut reactions = core::mem::take(&mut self.reactions);
        let omega = self.omega_rad_s;
        let series: Vec<f64> = match parts(&element.law)[0] {
            Some(_) => self.series.chunks_exact(m).map(|of| sum(weights, of)).collect(),
            None => vec![],
        };
        let motion = |phase_rad: f64| {
            let [x, v, a] = values(&series, phase_rad);
            [x, omega * v, omega * omega * a]
        };
        let state = history.map(|history| &self.histories[history].mean[..]);
        let [position, velocity] = &self.element;
        let along = Along { position, velocity, state, motion: &motion };
        reactions.compute(element, &along, of_interval, self.fft.as_ref());
        for (part, instant) in &reactions.jumps {
            let along: Vec<_> = weights.iter().map(|(i, weight)| (*i, [*weight, 0.0])).collect();
            let [x, v, _] = motion(instant.phase_rad);
            self.jumps.push(Jump::new(element, part, instant, [x, v], &along));
        }
        let [force, by_position, by_velocity] = &reactions.numbers;
        // Most laws have only some of the derivatives.
        let [has_position, has_velocity] = [by_position, by_velocity].map(|by| by.iter().any(|by| *by != 0.0));
        for &(row, weight) in weights {
            add(&mut self.load[row * samples..(row + 1) * samples], force, weight);
            for &(column, other) in weights {
                let of_pair = (row * m + column) * samples..(row * m + column + 1) * samples;
                if has_position {
                    add(&mut self.by[0][of_pair.clone()], by_position, weight * other);
                }
                if has_velocity {
                    add(&mut self.by[1][of_pair], by_velocity, weight * other);
                }
            }
        }
        self.reactions = reactions;
    }

    /// Computes a history from the x and v of its element that were stored last.
    fn run_history(&mut self, history: usize, law: &Law, of_interval: Interval) {
        let history = &mut self.histories[history];
        history.position.extend_from_slice(&self.element[0]);
        history.velocity.extend_from_slice(&self.element[1]);
        history.run(law, of_interval.step_s, of_interval.frequency_hz);
    }

    /// Returns u, u̇ and ü of the `m` unknowns at a phase.
    pub fn at_phase(&self, phase_rad: f64, m: usize) -> [Vec<f64>; 3] {
        let mut at = [(); 3].map(|()| Vec::with_capacity(m));
        for i in 0..m {
            let series: Vec<f64> = self.series.iter().skip(i).step_by(m).copied().collect();
            let mut rate = 1.0;
            for (at, value) in at.iter_mut().zip(values(&series, phase_rad)) {
                at.push(rate * value);
                rate *= self.omega_rad_s;
            }
        }
        at
    }

    /// Adds the unbalance of a chain under its drive.
    fn unbalance(&mut self, forced: &Forced, unknowns: &Unknowns) {
        let samples = self.count();
        let n = unknowns.count();
        self.by_drive.clear();
        self.by_drive.resize(n * samples, 0.0);
        let mut direction = [0.0; MOST_LINKS];
        let mut force = [0.0; MOST_LINKS];
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
                // A load is taken off the unbalance, hence the sign.
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
    let at = forced.assembly.at(u);
    let element = &forced.assembly.elements()[element];
    let n = u.len();
    at.element_direction(element, &mut direction);
    let velocity = direction.iter().zip(v).map(|(w, v)| w * v).sum();
    let position = at.element_displacement(element);
    if element.at.is_angle() {
        return Geometry { position, velocity, direction, curvature: None };
    }
    let mut curvature = [0.0; MOST_LINKS * MOST_LINKS];
    let mut turning = [0.0; MOST_LINKS];
    at.add_curvature(element.at, 1.0, &mut curvature);
    if let Some(to) = element.to {
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
    if let Law::Friction { stiffness, .. } = element.law {
        // The state, which is held within its reach, has all of the force.
        reaction = Reaction { force: stiffness * state, by_state: stiffness, ..Reaction::default() };
    }
    reaction
}

/// Returns the force of a contact or a gap as it counts at a sample alone: where it opens or closes within half an
/// interval h, its mean over the interval around the sample with x moving at v. The jump to c δ̇ as a damped contact
/// closes is an impulse in the derivative by x then.
fn around_sample(element: &Element, [position, velocity]: [f64; 2], step_s: f64) -> Reaction {
    let plain = || element.force(position, velocity, 0.0);
    let [seat, at_rest] = element.law.seat().unwrap_or_default();
    let position = position + seat;
    match element.law {
        Law::Gap { stiffness, gap, .. } => {
            let [upper, lower] = [1.0, -1.0].map(|sign| {
                let ramp = Ramp::new(sign * position - gap, sign * velocity, step_s);
                (sign * ramp.mean, ramp.by_position, ramp.by_velocity)
            });
            Reaction {
                force: stiffness * (upper.0 + lower.0) - at_rest,
                by_position: stiffness * (upper.1 + lower.1),
                by_velocity: stiffness * (upper.2 + lower.2),
                by_state: 0.0,
            }
        }
        Law::KelvinVoigt { stiffness, damping, gap, side, .. } => {
            let sign = side.sign();
            let depth = sign * position - gap;
            let rate = sign * velocity;
            if depth.abs() >= 0.5 * rate.abs() * step_s || (damping > 0.0 && rate < 0.0) {
                return plain();
            }
            let ramp = Ramp::new(depth, rate, step_s);
            // The damper acts for the part ½ + δ/(δ̇ h) of the interval.
            Reaction {
                force: sign * (stiffness * ramp.mean + damping * (0.5 * rate + depth / step_s)) - at_rest,
                by_position: stiffness * ramp.by_position + damping / step_s,
                by_velocity: stiffness * ramp.by_velocity + 0.5 * damping,
                by_state: 0.0,
            }
        }
        _ => plain(),
    }
}
