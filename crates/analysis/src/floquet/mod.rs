//! Stability of a structure's periodic response by its Floquet multipliers, the eigenvalues of the flow of variations
//! over a period.
//!
//! The flow of modes, and of a chain that isn't smooth, is computed on 2L points of the period. A step goes over 2 of
//! them with the derivatives in its middle: half a step of the linear structure, exact, the impulse of the terms that
//! this leaves out, and another half (G. Strang, 1968). This is symmetric, with errors in h², h⁴, …; where the response
//! is smooth, steps over 4 and 8 points remove the first two, as in Romberg's sum (64 Φ₂ − 20 Φ₄ + Φ₈)/45 (W. Romberg,
//! 1955). Without damping each of the three flows is symplectic, so that its multipliers are on the unit circle or come
//! in pairs μ, 1/μ, whatever the step; the sum is not, and its multipliers would leave the circle by its error. So the
//! flows are not added up, but their distances in the group, by A. Cayley's transform (E. Hairer, C. Lubich, G. Wanner,
//! "Geometric Numerical Integration", 2006, Sec. IV.8.3):
//!
//! ```text
//! Wₖ = 2 (Φₖ − Φ₂)(Φₖ + Φ₂)⁻¹,     W = (W₈ − 20 W₄)/45,     Φ = (1 − W/2)⁻¹ (1 + W/2) Φ₂
//! ```
//!
//! With Φₖ = exp(h²A + h⁴B + …) Φ, Wₖ is the logarithm of Φₖ Φ₂⁻¹ up to h⁶: W₄ = 3h²A + 15h⁴B and W₈ = 15h²A + 255h⁴B, so
//! that W = −h²A − h⁴B cancels both. If Φ₂ and Φₖ are symplectic Wₖ is Hamiltonian, hence W, and Φ is symplectic. Where
//! damping is large Φ₂ has no accurate inverse, and the sum is taken. W = −W₄/3 cancels h² alone: how far the largest |μ|
//! is from that of this flow is the accuracy that a response states.
//!
//! The variations of a smooth chain are integrated by collocation of order 8, [`collocation`].
//!
//! The multipliers of many modes with one smooth element are found in the frequency domain, [`exponents`].
//!
//! Where the response is symmetric, x(t + T/2) = −x(t), and the forces are, the derivatives repeat after half a period.
//! With the flow Φ½ over one half then Φ = Φ½², and the multipliers are the squares of the eigenvalues of Φ½.
//!
//! The state of a friction element that slips is a state of the flow. One that doesn't slip is a spring.

mod chain;
mod collocation;
mod exponents;
mod modal;
mod newton;
mod rows;
mod sweep;
mod varied;

use alloc::vec::Vec;

use nalgebra::{Complex, DMatrix};

use super::balance::Balance;
use super::orbit::Stability;
use super::samples::{Contacts, Geometry, Samples, geometry};
use super::unknowns::Body;
use resonarm_dynamics::structure::Law;
use resonarm_numeric::eigenvalues::eigenvalues;

/// Steps in a period of the fastest mode, for modes and for a chain, and in a period of the response's highest
/// harmonic.
const STEPS: [f64; 3] = [8.0, 48.0, 4.0];
/// The least number of steps, for smooth responses and for others.
const LEAST_STEPS: [f64; 2] = [64.0, 512.0];

/// The flow is computed with twice the steps until Σμ and Σμ² are this accurate, relative to the largest term, or the steps
/// are this many times as many. The magnitudes alone may be exact where the multipliers are not: those of a single pair
/// follow from the damping.
const ACCURATE: f64 = 1e-5;
const MOST_REFINED: f64 = 8.0;

/// Derivatives that differ by less than this part of the largest are the same.
const REPEATED: f64 = 1e-10;
/// The accuracy of |μ| by collocation and by exponents, which tests compare with finer flows.
const ACCURACY: f64 = 1e-8;
/// Below this ln |det Φ| damping is not small, and Φ has no accurate inverse.
const LEAST_LOG: f64 = -7.0;

/// The variations along a response.
pub(super) struct Variations<'a> {
    pub balance: &'a Balance,
    pub samples: Samples,
    /// The histories of elements whose state is one of the flow.
    pub states: Vec<usize>,
    /// Time between neighbouring points, s.
    pub spacing_s: f64,
}

/// State of an element in a variation at a point: δż = a δv + b δz, δf = f_z δz. A friction element holds z if b is
/// `None`.
pub(super) struct StateVariation {
    pub by_velocity: f64,
    pub by_state: Option<f64>,
    pub force: f64,
}

impl Variations<'_> {
    /// Returns the variations along the response X, on two points a step of at least so many steps; `samples` is
    /// storage.
    fn new<'a>(balance: &'a Balance, x: &[f64], steps: f64, mut samples: Samples) -> Variations<'a> {
        // Steps over 2, 4 and 8 points must all divide the period.
        let points = 8 * libm::ceil(steps / 4.0) as usize;
        samples.set(balance.harmonics().max(balance.period()), points);
        samples.synthesise(x, &balance.unknowns, balance.omega_rad_s());
        samples.evaluate(&balance.forced, &balance.unknowns, balance.frequency_hz, Contacts::Averaged);
        add_stuck_friction(balance, &mut samples);
        if !balance.forced.assembly().is_smooth() {
            average(&mut samples);
        }
        let states = (0..samples.histories.len()).filter(|&at| samples.histories[at].forgets).collect();
        let spacing_s = 1.0 / (balance.base_hz() * points as f64);
        Variations { balance, samples, states, spacing_s }
    }

    /// Number of unknowns of a harmonic, m.
    pub fn unknowns(&self) -> usize {
        self.balance.unknowns.count()
    }

    /// Returns an element of ∂Q/∂u (0), ∂Q/∂u̇ (1) or ∂Q/∂ü (2) at a point.
    pub fn by(&self, derivative: usize, [i, j]: [usize; 2], point: usize) -> f64 {
        let pair = i * self.unknowns() + j;
        self.samples.by[derivative][pair * self.samples.count() + point]
    }

    /// Says whether all derivatives repeat after half a period.
    fn repeat_after_half(&self) -> bool {
        let half = self.samples.count() / 2;
        let alike = |a: f64, b: f64, size: f64| (a - b).abs() <= REPEATED * size;
        let mut signals = self.samples.by.iter().flat_map(|signals| signals.chunks_exact(2 * half));
        let of_state = |at: &StateVariation| [at.by_velocity, at.by_state.unwrap_or(f64::INFINITY), at.force];
        let state_repeats = |state: usize, point: usize| {
            let [a, b] = [point, point + half].map(|point| of_state(&self.state(state, point, 2)));
            a.iter().zip(b).all(|(a, b)| *a == b || alike(*a, b, a.abs()))
        };
        half.is_multiple_of(2)
            && signals.all(|signal| repeats_after_half(signal, REPEATED * largest(signal)))
            && (0..self.states.len()).all(|state| (1..half).step_by(2).all(|point| state_repeats(state, point)))
    }

    /// Returns the element of a state at a point.
    pub fn geometry(&self, state: usize, point: usize) -> Geometry {
        let m = self.unknowns();
        let history = &self.samples.histories[self.states[state]];
        let [u, v] = [0, 1].map(|d| &self.samples.motion[d][point * m..(point + 1) * m]);
        geometry(&self.balance.forced, &self.balance.unknowns, history.element, u, v)
    }

    /// Returns a state in a step over `points` points around a point: friction that is held anywhere in the step holds.
    pub fn state(&self, state: usize, point: usize, points: usize) -> StateVariation {
        let history = &self.samples.histories[self.states[state]];
        let element = &self.balance.forced.assembly().elements()[history.element];
        if let Law::Friction { stiffness, .. } = element.law {
            let count = self.samples.count();
            let stuck = (1..=points).all(|j| history.sticks((point + j - points / 2) % count));
            let by_velocity = f64::from(u8::from(stuck));
            return StateVariation { by_velocity, by_state: stuck.then_some(0.0), force: stiffness };
        }
        let x = history.position[point];
        let v = history.velocity[point];
        let z = history.state[point];
        let rate = element.state_rate(x, v, z);
        let force = element.force(x, v, z).by_state;
        StateVariation { by_velocity: rate.by_velocity, by_state: Some(rate.by_state), force }
    }
}

/// Returns the largest magnitude of a signal over the period.
fn largest(signal: &[f64]) -> f64 {
    signal.iter().fold(0.0, |largest, value| f64::max(largest, value.abs()))
}

/// Says whether the halves of a signal differ nowhere by more than a limit.
fn repeats_after_half(signal: &[f64], limit: f64) -> bool {
    let (first, second) = signal.split_at(signal.len() / 2);
    first.iter().zip(second).all(|(a, b)| (a - b).abs() <= limit)
}

/// Computes stability, in storage that is kept between the responses of one structure.
#[derive(Debug, Default)]
pub(super) struct Floquet {
    samples: Option<Samples>,
    /// For smooth chains, the stages to which the samples are set.
    stages: Option<collocation::Stages>,
}

impl Floquet {
    /// Returns the stability of the response X of a balance; `None` if the multipliers can't be computed.
    pub fn stability(&mut self, balance: &Balance, x: &[f64]) -> Option<Stability> {
        let conservative = balance.forced.is_conservative();
        // The impulses of the flow act at one place each.
        let found = match balance.by_places(x) {
            Some((by_places, x)) => self.multipliers(&by_places, &x),
            None => self.multipliers(balance, x),
        };
        found.map(|found| Stability { conservative, ..found })
    }

    /// Computes the multipliers and their accuracy.
    fn multipliers(&mut self, balance: &Balance, x: &[f64]) -> Option<Stability> {
        let of_harmonics = (STEPS[2] * balance.harmonics() as f64).max(LEAST_STEPS[0]);
        if matches!(balance.unknowns.body, Body::Chain) && balance.forced.assembly().is_smooth() {
            let new = || Samples::new(&balance.forced, &balance.unknowns);
            return collocation::stability(balance, x, self.samples.get_or_insert_with(new), &mut self.stages);
        }
        let fast = match &balance.unknowns.body {
            Body::Condensed(condensed) => {
                let oscillates = |[omega, zeta]: &[f64; 2]| *omega > 0.0 && *zeta < 1.0;
                let is_wide = condensed.modes.len() >= exponents::LEAST_MODES;
                condensed.places.len() == 1 && is_wide && condensed.modes.iter().all(oscillates)
            }
            Body::Chain => false,
        };
        // The search for exponents may give up; the flow always applies.
        let found = if fast && balance.forced.assembly().is_smooth() {
            self.with(balance, x, of_harmonics, exponents::stability)
        } else {
            None
        };
        found.or_else(|| self.by_fine_flow(balance, x))
    }

    /// Computes the stability by flows with more and more steps until it is accurate enough, or there are as many steps as
    /// are allowed. Where elements are stiffer along the response than the modes, or its period is a multiple of the
    /// drive's, the first steps may be too long.
    fn by_fine_flow(&mut self, balance: &Balance, x: &[f64]) -> Option<Stability> {
        let smooth = balance.forced.assembly().is_smooth();
        let mut steps = steps(balance);
        let most = MOST_REFINED * steps;
        loop {
            let Flowed { stability, error } = self.with(balance, x, steps, |variations| by_flow(variations))?;
            // Where derivatives jump the error falls only with the step.
            if !smooth || error <= ACCURATE || steps >= most {
                return Some(stability);
            }
            steps *= 2.0;
        }
    }

    /// Calls `find` with the variations along a response and returns its result.
    fn with<T>(
        &mut self,
        balance: &Balance,
        x: &[f64],
        steps: f64,
        find: impl FnOnce(&mut Variations) -> Option<T>,
    ) -> Option<T> {
        let samples = self.samples.take().unwrap_or_else(|| Samples::new(&balance.forced, &balance.unknowns));
        let mut variations = Variations::new(balance, x, steps, samples);
        let found = find(&mut variations);
        self.samples = Some(variations.samples);
        found
    }
}

/// Returns the number of steps of the flow.
fn steps(balance: &Balance) -> f64 {
    let assembly = balance.forced.assembly();
    let fastest_hz = assembly.modes().last().map_or(0.0, |mode| mode.frequency_hz);
    let smooth = assembly.is_smooth();
    let condensed = matches!(balance.unknowns.body, Body::Condensed(_));
    let of_modes = STEPS[usize::from(!condensed)] * fastest_hz / balance.base_hz();
    let of_harmonics = STEPS[2] * balance.harmonics() as f64;
    of_modes.max(of_harmonics).max(LEAST_STEPS[usize::from(!smooth)])
}

/// A stability by flows.
struct Flowed {
    stability: Stability,
    /// How far Σμ or Σμ² is from that of a coarser method, relative to the largest term or 1.
    error: f64,
}

/// Computes the stability by the flow.
fn by_flow(of: &Variations) -> Option<Flowed> {
    let Body::Condensed(condensed) = &of.balance.unknowns.body else {
        return extrapolated(|points| chain::flow(of, points), of.balance);
    };
    if of.balance.forced.assembly().is_smooth() || !of.repeat_after_half() {
        return extrapolated(|points| modal::flow(of, condensed, [points, 1]), of.balance);
    }
    let of_half = |points: usize| {
        let roots = multipliers(modal::flow(of, condensed, [points, 2])?)?;
        Some(sorted(roots.iter().map(|root| root * root).collect()))
    };
    compared(of_half(2)?, &of_half(4)?)
}

/// Returns the stability by multipliers, whose accuracy is their distance from less exact ones.
fn compared(multipliers: Vec<Complex<f64>>, coarse: &[Complex<f64>]) -> Option<Flowed> {
    let largest = |of: &[Complex<f64>]| of.first().map(|mu| libm::sqrt(mu.norm_sqr()));
    let size = largest(&multipliers)?;
    let accuracy = (size - largest(coarse)?).abs();
    // Sums of powers are smooth functions of the flow where multipliers meet, and real.
    let sums = |of: &[Complex<f64>]| [of.iter().map(|mu| mu.re).sum::<f64>(), of.iter().map(|mu| (mu * mu).re).sum()];
    let [first, second] = sums(&multipliers);
    let [of_coarse, second_of_coarse] = sums(coarse);
    let size = size.max(1.0);
    let error = ((first - of_coarse) / size).abs().max(((second - second_of_coarse) / (size * size)).abs());
    Some(Flowed { stability: Stability { multipliers, accuracy, conservative: false }, error })
}

/// Computes the stability by flows over the period, extrapolated for smooth responses.
fn extrapolated(flow: impl Fn(usize) -> Option<DMatrix<f64>>, balance: &Balance) -> Option<Flowed> {
    let finest = flow(2)?;
    let middle = flow(4)?;
    if !balance.forced.assembly().is_smooth() {
        return compared(multipliers(finest)?, &multipliers(middle)?);
    }
    let coarsest = flow(8)?;
    let (whole, coarse) = if libm::log(finest.determinant().abs()) > LEAST_LOG {
        let [fourth, eighth] = [middle, coarsest].map(|other| distance(&other, &finest));
        let fourth = fourth?;
        let eighth = eighth?;
        (moved(&finest, &((eighth - &fourth * 20.0) / 45.0))?, moved(&finest, &(fourth / -3.0))?)
    } else {
        let coarse = (&finest * 4.0 - &middle) / 3.0;
        ((finest * 64.0 - middle * 20.0 + coarsest) / 45.0, coarse)
    };
    compared(multipliers(whole)?, &multipliers(coarse)?)
}

/// Returns 2 (Φₖ − Φ)(Φₖ + Φ)⁻¹; `None` if it does not exist.
fn distance(other: &DMatrix<f64>, flow: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    // Solved for the transpose, since the inverse is on the right.
    let transposed = (other + flow).transpose().lu().solve(&((other - flow) * 2.0).transpose())?;
    Some(transposed.transpose())
}

/// Returns (1 − W/2)⁻¹ (1 + W/2) Φ; `None` if it does not exist.
fn moved(flow: &DMatrix<f64>, by: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let one = DMatrix::identity(flow.nrows(), flow.nrows());
    let half = by * 0.5;
    (&one - &half).lu().solve(&((one + half) * flow))
}

/// Adds friction that doesn't slip as a spring.
fn add_stuck_friction(balance: &Balance, samples: &mut Samples) {
    let m = balance.unknowns.count();
    let count = samples.count();
    for history in samples.histories.iter().filter(|history| !history.forgets) {
        let Law::Friction { stiffness, .. } = balance.forced.assembly().elements()[history.element].law else {
            continue;
        };
        for j in 0..count {
            let w = &history.direction[j * m..(j + 1) * m];
            for pair in 0..m * m {
                samples.by[0][pair * count + j] += stiffness * w[pair / m] * w[pair % m];
            }
        }
    }
}

/// Replaces the derivatives at a point by their mean over the step around it, by the trapezoidal rule, so that jumps in
/// them do not matter to the first order.
fn average(samples: &mut Samples) {
    let count = samples.count();
    for signal in samples.by.iter_mut().flat_map(|signal| signal.chunks_exact_mut(count)) {
        let first = signal[0];
        let mut before = signal[count - 1];
        for j in 0..count {
            let here = signal[j];
            let after = if j + 1 < count { signal[j + 1] } else { first };
            signal[j] = 0.25 * (before + after) + 0.5 * here;
            before = here;
        }
    }
}

/// Computes multipliers as eigenvalues of the flow; `None` if they can't be computed.
fn multipliers(mut flow: DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    let n = flow.nrows();
    if flow.iter().any(|value| !value.is_finite()) {
        return None;
    }
    // By columns: those of the transpose are the same.
    eigenvalues(n, flow.as_mut_slice()).map(sorted)
}

/// Sorts multipliers, the largest magnitude first.
fn sorted(mut multipliers: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    // Of a conjugate pair the one with the positive imaginary part comes first, so that the order is unique.
    multipliers.sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()).then(b.im.total_cmp(&a.im)));
    multipliers
}

#[cfg(test)]
mod tests;
