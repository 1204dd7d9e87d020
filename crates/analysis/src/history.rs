//! Elements with a state, over a period: the state, and its derivative, follow from the response.
//!
//! From sample to sample the state changes as
//!
//! ```text
//! friction   z ← z + Δx, held within ±R/k; where v, linear in between, changes sign, first to the x there
//! lugre      z ← E z + (1 − E) g/σ0 sign v with E = exp(−σ0 |v| h/g), exact at constant v
//! ```
//!
//! so that dz ← e dz + p (dx − dx₋) + s₋ dv₋ + s dv + γ dΩ with numbers of each step. What counts at a sample is z, of
//! friction its mean over the interval around the sample, which changes smoothly where slip begins between two samples.
//! The periodic state of friction is that of the second period, since what slips forgets; that of LuGre solves z₀ = Πe
//! z₀ plus q, as does the derivative. Friction that doesn't slip is a spring, z = x − c, with c as near zero as the
//! slip allows: the vibration begins at rest.

use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::structure::Law;
use resonarm_numeric::registers::{Task, widest};

use super::ramp::Ramp;

/// The derivative of a step, and of what counts at its end: `part` (dz as if it were free to move) + `part_velocity`
/// dv.
#[derive(Clone, Copy, Debug, Default)]
struct StepDerivative {
    /// Coefficient e of the change of the state before.
    by_state: f64,
    /// Coefficient p of the change of the displacement over the step.
    by_change: f64,
    /// Coefficients s₋ and s of the changes of velocity at the start and the end.
    by_velocity: [f64; 2],
    /// Coefficient γ of the change of frequency.
    by_frequency: f64,
    /// For friction, whether the state ends free, and not held.
    free: f64,
    part: f64,
    part_velocity: f64,
}

/// The derivative of what counts of friction at the samples: dz = p dx + q dv + p c with numbers p and q of each sample,
/// and c the same in all of a stretch.
#[derive(Clone, Debug, Default)]
pub(super) struct FrictionDerivative {
    pub by_position: Vec<f64>,
    pub by_velocity: Vec<f64>,
    pub stretches: Vec<Stretch>,
}

/// Samples at which friction sticks where it came to rest before.
#[derive(Clone, Debug, Default)]
pub(super) struct Stretch {
    /// c as a sum over samples: the coefficients of dx and dv there.
    pub constant: Vec<(usize, [f64; 2])>,
    /// The samples, with their p.
    pub weights: Vec<(usize, f64)>,
}

/// A state over a period.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    /// The number of the element.
    pub element: usize,
    /// x and v of the element at the samples.
    pub position: Vec<f64>,
    pub velocity: Vec<f64>,
    /// ∂x/∂u at the samples, m numbers each.
    pub direction: Vec<f64>,
    /// z at the samples, and what counts there.
    pub state: Vec<f64>,
    pub mean: Vec<f64>,
    /// The step to each sample from the one before; to the first from the last.
    steps: Vec<StepDerivative>,
    /// Whether the state depends on the response of the period alone.
    pub forgets: bool,
    /// For friction that doesn't slip, the sample at which it is about to.
    anchor: Option<usize>,
}

impl History {
    pub fn new(element: usize) -> History {
        History { element, forgets: true, ..History::default() }
    }

    pub fn clear(&mut self) {
        self.position.clear();
        self.velocity.clear();
        self.direction.clear();
    }

    /// Says whether friction sticks at a sample.
    pub fn sticks(&self, sample: usize) -> bool {
        self.steps[sample].free * self.steps[sample].by_state > 0.0
    }

    /// Computes the state over the period from `position` and `velocity`; samples are `step_s` apart.
    pub fn run(&mut self, law: &Law, step_s: f64, frequency_hz: f64) {
        let samples = self.position.len();
        self.state.clear();
        self.state.resize(samples, 0.0);
        self.steps.clear();
        self.steps.resize(samples, StepDerivative::default());
        self.mean.clear();
        self.mean.resize(samples, 0.0);
        match *law {
            Law::Friction { stiffness, slip } => self.run_friction(slip / stiffness, step_s, frequency_hz),
            Law::Lugre { .. } => self.run_lugre(law, step_s, frequency_hz),
            _ => {}
        }
    }

    fn run_friction(&mut self, reach: f64, step_s: f64, frequency_hz: f64) {
        let samples = self.position.len();
        // Any start within the limits will do: what slips forgets it in the first of the two periods.
        let mut z = self.position[0].clamp(-reach, reach);
        for pass in 0..2 {
            self.forgets = false;
            // The first pass begins at the first sample. The second comes to it from the last one, as the period goes
            // round.
            for j in usize::from(pass == 0)..samples {
                let before = (j + samples - 1) % samples;
                let velocity = [self.velocity[before], self.velocity[j]];
                let step = friction_step(z, self.position[j] - self.position[before], velocity, reach, step_s);
                let held = step.free.clamp(-reach, reach);
                // A state that was held once no longer depends on where it began.
                self.forgets |= !(step.passed && held == step.free);
                let one = |yes: bool| f64::from(u8::from(yes));
                let passed = one(step.passed);
                let free = one(held == step.free);
                // e₂ (e₁ (dz + da) + dx − dx₋ − da), and in products of v and h the frequency cancels.
                let by_velocity = step.by_velocity.map(|by| (passed - 1.0) * by);
                let by_frequency = -(by_velocity[0] * velocity[0] + by_velocity[1] * velocity[1]) / frequency_hz;
                let (mean, part, part_velocity) = held_mean(step.free, velocity[1], reach, step_s);
                self.steps[j] = StepDerivative {
                    by_state: passed,
                    by_change: 1.0,
                    by_velocity,
                    by_frequency,
                    free,
                    part,
                    part_velocity,
                };
                self.state[j] = held;
                self.mean[j] = mean;
                z = held;
            }
        }
        if !self.forgets {
            self.stick(reach);
        }
    }

    /// Computes the state of friction that doesn't slip.
    fn stick(&mut self, reach: f64) {
        let x = &self.position;
        let extreme = |sign: f64| (0..x.len()).fold(0, |top, j| if sign * x[j] > sign * x[top] { j } else { top });
        let [high, low] = [extreme(1.0), extreme(-1.0)];
        self.anchor = if x[high] > reach {
            Some(high)
        } else if x[low] < -reach {
            Some(low)
        } else {
            None
        };
        // The largest displacement that is out of reach leaves the state just at its limit there.
        let shift = self.anchor.map_or(0.0, |at| x[at] - reach.copysign(x[at]));
        self.state.iter_mut().zip(x).for_each(|(z, x)| *z = x - shift);
        self.mean.copy_from_slice(&self.state);
    }

    fn run_lugre(&mut self, law: &Law, step_s: f64, frequency_hz: f64) {
        let samples = self.position.len();
        let mut product = 1.0;
        let mut sum = 0.0;
        for pass in 0..2 {
            // A period maps z onto Πe z + q. The first pass, from zero, gives Πe and q; the second begins at the fixed
            // point.
            let mut z = if pass == 0 || product == 1.0 { 0.0 } else { sum / (1.0 - product) };
            for j in 1..=samples {
                let v = 0.5 * (self.velocity[j % samples] + self.velocity[j - 1]);
                let (next, step) = lugre_step(law, z, v, step_s, frequency_hz);
                self.steps[j % samples] = step;
                self.state[j % samples] = next;
                product *= if pass == 0 { step.by_state } else { 1.0 };
                z = next;
            }
            sum = if pass == 0 { z } else { sum };
        }
        self.forgets = product < 1.0;
        self.mean.copy_from_slice(&self.state);
    }

    /// Returns the derivative of what counts of friction.
    ///
    /// While it sticks dz = dx + c. A new stretch begins with the first change after the state was held, from zero, and
    /// where it was held before the velocity changed sign: there, dz is the change from where it turned.
    pub fn friction_derivative(&self) -> FrictionDerivative {
        let samples = self.steps.len();
        let mut found = FrictionDerivative {
            by_position: self.steps.iter().map(|step| step.part).collect(),
            by_velocity: self.steps.iter().map(|step| step.part_velocity).collect(),
            stretches: vec![],
        };
        let Some(first) = self.steps.iter().position(|step| step.by_state * step.free == 0.0) else {
            // It never slips: dz = dx, minus that at the sample at which it is about to.
            found.by_position.fill(1.0);
            found.by_velocity.fill(0.0);
            if let Some(anchor) = self.anchor {
                let weights = (0..samples).map(|j| (j, 1.0)).collect();
                found.stretches.push(Stretch { constant: vec![(anchor, [-1.0, 0.0])], weights });
            }
            return found;
        };
        // The state after the first of these steps does not depend on the one before, which is known when the period has
        // come back to it.
        let mut current = None;
        for turn in 0..=samples {
            let j = (first + turn) % samples;
            let step = &self.steps[j];
            let before = (j + samples - 1) % samples;
            let counts = turn > 0 && step.part != 0.0;
            let stretch = current.filter(|_| step.by_state > 0.0);
            current = None;
            if !(counts || step.free > 0.0) {
                continue;
            }
            let stretch = stretch.unwrap_or_else(|| {
                let constant = vec![(before, [-1.0, step.by_velocity[0]]), (j, [0.0, step.by_velocity[1]])];
                found.stretches.push(Stretch { constant, weights: vec![] });
                found.stretches.len() - 1
            });
            if counts {
                found.stretches[stretch].weights.push((j, step.part));
            }
            current = (step.free > 0.0).then_some(stretch);
        }
        found
    }

    /// For each sample in order, calls `with` with the derivative of the state that counts there, a row over the
    /// unknowns and,
    /// last, the frequency. `basis` gives the functions of the unknowns, and their derivatives by time, at a sample;
    /// `direction` the derivative of x by the unknown i at a sample. Unknown i of function r is in the column r · `active` + i.
    pub fn derivative<'a>(
        &self,
        direction: impl Fn(usize, usize) -> f64,
        active: usize,
        basis: impl Fn(usize) -> (&'a [f64], &'a [f64]),
        frequency_hz: f64,
        mut with: impl FnMut(usize, &[f64]),
    ) {
        let samples = self.position.len();
        let count = basis(0).0.len();
        let columns = count * active + 1;
        let product: f64 = self.steps.iter().map(|step| step.by_state * step.free).product();
        let mut row = vec![0.0; columns];
        let mut counted = vec![0.0; columns];
        let advance = |row: &mut [f64], counted: &mut [f64], j: usize| {
            let before = (j + samples - 1) % samples;
            let step = &self.steps[j];
            let [here, last] = [j, before].map(&basis);
            for i in 0..active {
                let directions = [direction(j, i), direction(before, i)];
                let row = &mut row[i..columns - 1];
                let counted = &mut counted[i..columns - 1];
                widest(Advance { step, row, counted, stride: active, directions, here, last });
            }
            let [v0, v] = [self.velocity[before], self.velocity[j]];
            let rates = (step.by_velocity[0] * v0 + step.by_velocity[1] * v) / frequency_hz;
            let free = step.by_state * row[columns - 1] + rates + step.by_frequency;
            counted[columns - 1] = step.part * free;
            row[columns - 1] = step.free * free;
        };
        if product < 1.0 {
            (1..=samples).for_each(|j| advance(&mut row, &mut counted, j % samples));
            // The state that a period makes of no change is that of the fixed point, by 1 − Πe.
            row.iter_mut().for_each(|value| *value /= 1.0 - product);
            for j in 1..=samples {
                advance(&mut row, &mut counted, j % samples);
                with(j % samples, &counted);
            }
        } else if self.steps[0].by_change > 0.0 {
            self.stuck_derivative(direction, active, |j| basis(j).0, with);
        }
    }

    /// Works like [`History::derivative`] for friction that doesn't slip: dx, minus that at the anchor.
    fn stuck_derivative<'a>(
        &self,
        direction: impl Fn(usize, usize) -> f64,
        active: usize,
        functions: impl Fn(usize) -> &'a [f64],
        mut with: impl FnMut(usize, &[f64]),
    ) {
        let moves = |j: usize, at: usize| direction(j, at % active) * functions(j)[at / active];
        let columns = functions(0).len() * active;
        let mut row = vec![0.0; columns + 1];
        for j in 0..self.position.len() {
            for (at, value) in row[..columns].iter_mut().enumerate() {
                *value = moves(j, at) - self.anchor.map_or(0.0, |anchor| moves(anchor, at));
            }
            with(j, &row);
        }
    }
}

/// The derivatives by all functions of one unknown over a step.
struct Advance<'a> {
    step: &'a StepDerivative,
    /// Every so many numbers belong to the unknown.
    row: &'a mut [f64],
    counted: &'a mut [f64],
    stride: usize,
    /// ∂x/∂u at the end of the step and at its start.
    directions: [f64; 2],
    /// The functions and their rates there.
    here: (&'a [f64], &'a [f64]),
    last: (&'a [f64], &'a [f64]),
}

impl Task for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let step = self.step;
        let [w, w0] = self.directions;
        let [here, last] = [self.here, self.last].map(|(functions, rates)| functions.iter().zip(rates));
        let functions = here.zip(last).map(|((x, v), (x0, v0))| [*x, *v, *x0, *v0]);
        let one = |((row, counted), [x, v, x0, v0]): ((&mut f64, &mut f64), [f64; 4])| {
            let free = step.by_state * *row
                + step.by_change * (w * x - w0 * x0)
                + step.by_velocity[1] * w * v
                + step.by_velocity[0] * w0 * v0;
            *counted = step.part * free + step.part_velocity * w * v;
            *row = step.free * free;
        };
        if self.stride == 1 {
            self.row.iter_mut().zip(self.counted).zip(functions).for_each(one);
        } else {
            let counted = self.counted.iter_mut().step_by(self.stride);
            self.row.iter_mut().step_by(self.stride).zip(counted).zip(functions).for_each(one);
        }
    }
}

/// A step of friction.
struct FrictionStep {
    /// z at its end, before it is held.
    free: f64,
    /// Whether z was free where v changes sign.
    passed: bool,
    /// Derivatives by v₋ and v of the way a from the sample before to where v changes sign.
    by_velocity: [f64; 2],
}

/// Where v changes sign, a = h v₋²/(2 (v₋ − v)).
fn friction_step(z: f64, change: f64, [v0, v]: [f64; 2], reach: f64, step_s: f64) -> FrictionStep {
    // Without a turn the whole change of x is a way in one direction, at whose end z is held.
    if v0 * v >= 0.0 {
        return FrictionStep { free: z + change, passed: true, by_velocity: [0.0; 2] };
    }
    let share = v0 / (v0 - v);
    // v falls linearly to zero in `share` of the step, so that the way is half of v₋ times that time.
    let way = 0.5 * step_s * v0 * share;
    let turning = (z + way).clamp(-reach, reach);
    let by_velocity = [0.5 * step_s * share * (2.0 - share), 0.5 * step_s * share * share];
    FrictionStep { free: turning + (change - way), passed: turning == z + way, by_velocity }
}

/// Returns the mean over the interval around a sample of z that would be `free` there and moves at v, but is held; and
/// its derivatives by both.
fn held_mean(free: f64, velocity: f64, reach: f64, step_s: f64) -> (f64, f64, f64) {
    let sign = if velocity < 0.0 { -1.0 } else { 1.0 };
    let ramp = Ramp::new(reach - sign * free, -sign * velocity, step_s);
    (sign * (reach - ramp.mean), ramp.by_position, ramp.by_velocity)
}

/// Takes a step of LuGre's state at the velocity v, and returns it with its derivative.
fn lugre_step(law: &Law, z: f64, v: f64, step_s: f64, frequency_hz: f64) -> (f64, StepDerivative) {
    let Law::Lugre { bristle_stiffness, coulomb, breakaway, stribeck, .. } = *law else {
        return (z, StepDerivative::default());
    };
    let ratio = v / stribeck;
    let bell = (breakaway - coulomb) * libm::exp(-ratio * ratio);
    let g = coulomb + bell;
    let slope = -2.0 * ratio / stribeck * bell;
    let sign = if v < 0.0 { -1.0 } else { 1.0 };
    let decay = bristle_stiffness * v.abs() * step_s / g;
    let end = sign * g / bristle_stiffness;
    let kept = libm::exp(-decay);
    // 1 − E, without cancellation at a small decay.
    let share = -libm::expm1(-decay);
    // d(decay)/dv and d(end)/dv; (1 − E) end → v h for small v, with derivative h.
    let decay_by_v = sign * bristle_stiffness * step_s / g * (1.0 - v * slope / g);
    let by_velocity = kept * (end - z) * decay_by_v + share * sign * slope / bristle_stiffness;
    // At a frequency df higher the samples are h df/f closer.
    let by_frequency = -kept * (end - z) * decay / frequency_hz;
    let step = StepDerivative {
        by_state: kept,
        by_velocity: [0.5 * by_velocity; 2],
        by_frequency,
        free: 1.0,
        part: 1.0,
        ..StepDerivative::default()
    };
    (end + (z - end) * kept, step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fourier::{Basis, uniform};

    const SAMPLES: usize = 64;
    const HARMONICS: usize = 3;

    /// The derivative of friction by stretches is that from sample to sample, whether it slips in both directions, in one
    /// step, or not at all.
    #[test]
    fn the_derivative_of_friction_is_that_of_its_steps() {
        let omega = 3.0;
        let basis = Basis::uniform(HARMONICS, SAMPLES);
        let step_s = core::f64::consts::TAU / (omega * SAMPLES as f64);
        assert_eq!(uniform(SAMPLES).count(), basis.samples());
        let columns = 2 * HARMONICS + 1;
        let mut functions = vec![vec![1.0; columns]; SAMPLES];
        let mut rates = vec![vec![0.0; columns]; SAMPLES];
        for k in 1..=HARMONICS {
            let (cosines, sines) = basis.tables(k - 1);
            let rate = k as f64 * omega;
            for j in 0..SAMPLES {
                functions[j][2 * k - 1] = cosines[j];
                functions[j][2 * k] = sines[j];
                rates[j][2 * k - 1] = -rate * sines[j];
                rates[j][2 * k] = rate * cosines[j];
            }
        }
        let x = [0.1, 1.0, 0.3, -0.2, 0.5, 0.4, 0.1];
        let along = |of: &[f64]| of.iter().zip(&x).map(|(f, x)| f * x).sum::<f64>();
        let mut stretches = Vec::new();
        for reach in [1e-3, 0.05, 0.4, 0.8, 1.2, 1.5, 10.0] {
            let mut history = History::new(0);
            history.position = functions.iter().map(|of| along(of)).collect();
            history.velocity = rates.iter().map(|of| along(of)).collect();
            history.run(&Law::Friction { stiffness: 2.0, slip: 2.0 * reach }, step_s, omega);
            let found = history.friction_derivative();
            stretches.push(found.stretches.len());
            let mut rows = vec![vec![0.0; columns]; SAMPLES];
            for (j, row) in rows.iter_mut().enumerate() {
                for (c, value) in row.iter_mut().enumerate() {
                    *value = found.by_position[j] * functions[j][c] + found.by_velocity[j] * rates[j][c];
                }
            }
            for Stretch { constant, weights } in &found.stretches {
                for &(j, weight) in weights {
                    for (c, value) in rows[j].iter_mut().enumerate() {
                        let of = |&(at, [by_position, by_velocity]): &(usize, [f64; 2])| {
                            by_position * functions[at][c] + by_velocity * rates[at][c]
                        };
                        *value += weight * constant.iter().map(of).sum::<f64>();
                    }
                }
            }
            let basis = |j: usize| (&functions[j][..], &rates[j][..]);
            let mut seen = 0;
            history.derivative(
                |_, _| 1.0,
                1,
                basis,
                omega,
                |j, expected| {
                    seen += 1;
                    // The last is the derivative by the frequency, which is zero: only lengths count for friction.
                    assert!(expected[columns].abs() < 1e-12, "{reach} {j}: {expected:?}");
                    let off = rows[j].iter().zip(expected).map(|(got, expected)| (got - expected).abs());
                    assert!(off.fold(0.0, f64::max) < 1e-12, "{reach} {j}: {:?}, expected {expected:?}", rows[j]);
                },
            );
            assert_eq!(seen, SAMPLES);
        }
        assert_eq!(stretches, [4, 4, 3, 3, 2, 2, 0]);
    }
}
