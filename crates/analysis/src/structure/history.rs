//! Elements with a state, over a period: the state follows from the motion, and its derivative too.
//!
//! From sample to sample the state changes as
//!
//! ```text
//! friction   z ← z + Δx, held within ±R/k
//! lugre      z ← E z + (1 − E) g/σ0 sign v,   E = exp(−σ0 |v| h/g),   v between the samples: exact at constant v
//! ```
//!
//! so that dz ← e dz + p (dx − dx₋) + s (dv + dv₋) + γ dΩ with numbers e, p, s, γ of each step. The periodic state of
//! friction is that of the second period, since what slips once forgets; that of LuGre solves z₀ = Πe z₀ + q, as does
//! the derivative. Friction that never slips is a spring, z = x: the motion begins at rest.

use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::structure::{Element, Law};

/// e, p, s and γ of a step.
#[derive(Clone, Copy, Debug, Default)]
struct StepDerivative {
    by_state: f64,
    by_change: f64,
    by_velocity: f64,
    by_frequency: f64,
}

/// A state over a period.
#[derive(Clone, Debug)]
pub(super) struct History {
    /// The number of the element.
    pub element: usize,
    /// x and v of the element at the samples.
    pub position: Vec<f64>,
    pub velocity: Vec<f64>,
    /// ∂x/∂u at the samples, m numbers each.
    pub direction: Vec<f64>,
    /// z at the samples.
    pub state: Vec<f64>,
    /// The step to each sample from the one before; to the first from the last.
    steps: Vec<StepDerivative>,
    /// Whether the state depends on the motion of the period alone.
    pub forgets: bool,
}

impl History {
    pub fn new(element: usize) -> History {
        History {
            element,
            position: vec![],
            velocity: vec![],
            direction: vec![],
            state: vec![],
            steps: vec![],
            forgets: true,
        }
    }

    pub fn clear(&mut self) {
        self.position.clear();
        self.velocity.clear();
        self.direction.clear();
    }

    /// The state over the period from `position` and `velocity`; samples are `step_s` apart.
    pub fn run(&mut self, law: &Law, step_s: f64, frequency_hz: f64) {
        let samples = self.position.len();
        self.state.clear();
        self.state.resize(samples, 0.0);
        self.steps.clear();
        self.steps.resize(samples, StepDerivative::default());
        match *law {
            Law::Friction { stiffness, slip } => self.run_friction(slip / stiffness),
            Law::Lugre { .. } => self.run_lugre(law, step_s, frequency_hz),
            _ => {}
        }
    }

    fn run_friction(&mut self, reach: f64) {
        let samples = self.position.len();
        let mut z = self.position[0].clamp(-reach, reach);
        self.forgets = false;
        for pass in 0..2 {
            for j in usize::from(pass == 0)..samples {
                let free = z + self.position[j] - self.position[(j + samples - 1) % samples];
                z = free.clamp(-reach, reach);
                let stuck = z == free;
                let one = f64::from(u8::from(stuck));
                self.steps[j] = StepDerivative { by_state: one, by_change: one, ..StepDerivative::default() };
                self.state[j] = z;
                self.forgets |= !stuck;
            }
        }
    }

    fn run_lugre(&mut self, law: &Law, step_s: f64, frequency_hz: f64) {
        let samples = self.position.len();
        let (mut product, mut sum) = (1.0, 0.0);
        for pass in 0..2 {
            let mut z = if pass == 0 || product == 1.0 { 0.0 } else { sum / (1.0 - product) };
            for j in 1..=samples {
                let v = 0.5 * (self.velocity[j % samples] + self.velocity[j - 1]);
                let (next, step) = lugre_step(law, z, v, step_s, frequency_hz);
                (self.steps[j % samples], self.state[j % samples]) = (step, next);
                product *= if pass == 0 { step.by_state } else { 1.0 };
                z = next;
            }
            sum = if pass == 0 { z } else { sum };
        }
        self.forgets = product < 1.0;
    }

    /// For each sample in order calls `with` with dz as a row over the unknowns and, last, the frequency. `basis` gives
    /// the functions of the unknowns, and their derivatives by time, at a sample; unknown `active[i]` of function r is
    /// in the column r · active + i.
    pub fn derivative<'a>(
        &self,
        unknowns: usize,
        active: &[usize],
        basis: impl Fn(usize) -> (&'a [f64], &'a [f64]),
        frequency_hz: f64,
        mut with: impl FnMut(usize, &[f64]),
    ) {
        let (samples, count) = (self.position.len(), basis(0).0.len());
        let columns = count * active.len() + 1;
        let product: f64 = self.steps.iter().map(|step| step.by_state).product();
        let mut row = vec![0.0; columns];
        let advance = |row: &mut [f64], j: usize| {
            let before = (j + samples - 1) % samples;
            let (step, [here, last]) = (self.steps[j], [basis(j), basis(before)]);
            let direction = |j: usize, i: usize| self.direction[j * unknowns + active[i]];
            for r in 0..count {
                for i in 0..active.len() {
                    let (w, w0) = (direction(j, i), direction(before, i));
                    let cell = &mut row[r * active.len() + i];
                    *cell = step.by_state * *cell
                        + step.by_change * (w * here.0[r] - w0 * last.0[r])
                        + step.by_velocity * (w * here.1[r] + w0 * last.1[r]);
                }
            }
            let rates = (self.velocity[j] + self.velocity[before]) / frequency_hz;
            row[columns - 1] = step.by_state * row[columns - 1] + step.by_velocity * rates + step.by_frequency;
        };
        if product < 1.0 {
            (1..=samples).for_each(|j| advance(&mut row, j % samples));
            row.iter_mut().for_each(|value| *value /= 1.0 - product);
        } else {
            let here = basis(0).0;
            let factor = self.steps[0].by_change;
            for (r, cells) in row[..columns - 1].chunks_exact_mut(active.len()).enumerate() {
                cells.iter_mut().enumerate().for_each(|(i, cell)| *cell = factor * self.direction[active[i]] * here[r]);
            }
        }
        with(0, &row);
        for j in 1..samples {
            advance(&mut row, j);
            with(j, &row);
        }
    }
}

/// A step of LuGre's state at the velocity v, and its derivative.
fn lugre_step(law: &Law, z: f64, v: f64, step_s: f64, frequency_hz: f64) -> (f64, StepDerivative) {
    let Law::Lugre { bristle_stiffness, coulomb, breakaway, stribeck, .. } = *law else {
        return (z, StepDerivative::default());
    };
    let ratio = v / stribeck;
    let bell = (breakaway - coulomb) * libm::exp(-ratio * ratio);
    let (g, slope) = (coulomb + bell, -2.0 * ratio / stribeck * bell);
    let (sign, decay) = (if v < 0.0 { -1.0 } else { 1.0 }, bristle_stiffness * v.abs() * step_s / g);
    let (end, kept) = (sign * g / bristle_stiffness, libm::exp(-decay));
    let share = -libm::expm1(-decay);
    // d(decay)/dv and d(end)/dv; (1 − E) end → v h for small v, with derivative h.
    let decay_by_v = sign * bristle_stiffness * step_s / g * (1.0 - v * slope / g);
    let by_velocity = kept * (end - z) * decay_by_v + share * sign * slope / bristle_stiffness;
    // At a frequency df higher the samples are h df/f closer.
    let by_frequency = -kept * (end - z) * decay / frequency_hz;
    let step = StepDerivative { by_state: kept, by_velocity: 0.5 * by_velocity, by_frequency, by_change: 0.0 };
    (end + (z - end) * kept, step)
}

/// Whether an element has a history.
pub(super) fn has_history(element: &Element) -> bool {
    element.law().has_state()
}
