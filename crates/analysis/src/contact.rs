//! Forces that act for a part of the period: contacts, and gaps with a side each.
//!
//! Such a force is χ g. Its law g goes on smoothly beyond the contact, as k δ + c δ̇ does; χ is 1 while the contact is
//! closed and 0 otherwise. The phases a at which it closes and b at which it opens are zeros of δ or g along the series of
//! the response, and the Fourier coefficients of χ follow from them in closed form:
//!
//! ```text
//! χ₀ = (b − a)/2π,     χₙ = i (exp(−inb) − exp(−ina))/2πn
//! ```
//!
//! The samples of the series of χ up to n = N/2 − 1 are weights of the samples of g. For g of order H and the harmonic k
//! of the force, their sum over N samples is the integral 2/2π ∫ g cos kτ dτ from a to b, without an error of sampling,
//! as long as H + k < N/2, since no product of the three aliases onto the mean (L. N. Trefethen, J. A. C. Weideman, "The Exponentially Convergent
//! Trapezoidal Rule", SIAM Rev. 56 (2014), on trigonometric polynomials). As a and b move,
//!
//! ```text
//! d 1/π ∫ g cos kτ dτ = 1/π ∫ dg cos kτ dτ + 1/π g(b) cos kb db − 1/π g(a) cos ka da
//! ```
//!
//! of which g(b) = 0, and g(a) = 0 but for a damper, c δ̇ as it closes ([`Instant::jumps`]). So the coefficients have
//! continuous derivatives by the response. Where samples alone say whether a contact is closed, they jump by c δ̇, and
//! invent folds.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_dynamics::structure::{Branch, Law};
use resonarm_numeric::dft::Fft;

/// Steps to a zero; halving alone reaches rounding within these.
const ZERO_STEPS: usize = 60;
/// A zero, and a turn, is located within this phase, rad.
const LOCATED_RAD: f64 = 1e-15;

/// A part of a law that acts on a branch alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub branch: Branch,
    /// The depth is δ = `sign` x − `gap`.
    pub sign: f64,
    gap: f64,
    /// The part acts while all of these are positive.
    conditions: [Option<Condition>; 2],
}

/// E = α δ + τ δ̇ + β.
#[derive(Clone, Copy, Debug)]
pub(super) struct Condition {
    pub by_depth: f64,
    pub by_rate_s: f64,
    constant: f64,
    /// Whether the force jumps where the condition changes.
    jumps: bool,
}

/// Where a part begins or ends to act.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant {
    pub phase_rad: f64,
    pub begins: bool,
    /// Whether the force jumps there.
    pub jumps: bool,
    /// The condition that changes, and dE/dτ.
    pub condition: Condition,
    pub slope: f64,
}

/// Displacement, velocity and acceleration of an element at a phase.
pub(super) type Motion<'a> = &'a dyn Fn(f64) -> [f64; 3];

/// Returns the parts of a law that act on a branch alone, if it has some.
///
/// Where the force of Hunt and Crossley closes or opens it rises as δ^1.5, which samples resolve; its part is where it
/// would not pull.
pub(super) fn parts(law: &Law) -> [Option<Part>; 2] {
    // x counts from rest.
    let seat = law.seat().map_or(0.0, |[seat, _]| seat);
    let pressed = Condition { by_depth: 1.0, by_rate_s: 0.0, constant: 0.0, jumps: false };
    let part = |branch: Branch, sign: f64, gap: f64, conditions: [Option<Condition>; 2]| {
        Some(Part { branch, sign, gap: gap - sign * seat, conditions })
    };
    match *law {
        Law::Gap { gap, .. } if gap > 0.0 => [(Branch::Upper, 1.0), (Branch::Lower, -1.0)]
            .map(|(branch, sign)| part(branch, sign, gap, [Some(pressed), None])),
        Law::KelvinVoigt { damping: 0.0, gap, side, .. } => {
            [part(Branch::Upper, side.sign(), gap, [Some(pressed), None]), None]
        }
        Law::KelvinVoigt { stiffness, damping, gap, side, .. } => {
            // k δ + c δ̇, over k.
            let pushes = Condition { by_rate_s: damping / stiffness, ..pressed };
            let conditions = [Some(Condition { jumps: true, ..pressed }), Some(pushes)];
            [part(Branch::Upper, side.sign(), gap, conditions), None]
        }
        Law::HuntCrossley { damping, gap, side, .. } if damping > 0.0 => {
            let pushes = Condition { by_depth: 0.0, by_rate_s: damping, constant: 1.0, jumps: false };
            [part(Branch::Upper, side.sign(), gap, [Some(pushes), None]), None]
        }
        _ => [None; 2],
    }
}

/// When a part acts.
#[derive(Clone, Debug, Default)]
pub(super) struct Acting {
    /// The weights of the samples.
    pub weights: Vec<f64>,
    pub instants: Vec<Instant>,
    /// The changes of conditions in an interval.
    changes: Vec<Change>,
    lines: Vec<Complex<f64>>,
}

/// A change of a condition, by its number.
#[derive(Clone, Copy, Debug)]
struct Change {
    phase_rad: f64,
    number: usize,
    condition: Condition,
}

impl Acting {
    /// Finds when a part of an element acts, from x and v of the element at samples that are `step_s` apart, and between them.
    /// `fft` is the transform of as many samples, if there is one.
    pub fn find(
        &mut self,
        part: &Part,
        [position, velocity]: [&[f64]; 2],
        motion: Motion,
        step_s: f64,
        fft: Option<&Fft>,
    ) {
        let count = position.len();
        let spacing_rad = TAU / position.len() as f64;
        let depth = |j: usize| [part.sign * position[j] - part.gap, part.sign * velocity[j]];
        let omega_rad_s = spacing_rad / step_s;
        self.instants.clear();
        let acts_first = part.conditions.iter().flatten().all(|condition| condition.at(depth(0)) > 0.0);
        let mut start = depth(0);
        for j in 0..count {
            // The last interval ends at the first sample, a period later.
            let end = depth((j + 1) % count);
            let mut met = [true; 2];
            self.changes.clear();
            for (number, condition) in part.conditions.iter().enumerate() {
                let Some(condition) = *condition else { continue };
                met[number] = condition.at(start) > 0.0;
                if condition.stays([start, end], step_s) {
                    continue;
                }
                let along = |phase: f64| part.value(&condition, motion(phase), omega_rad_s);
                let ends = [j as f64 * spacing_rad, (j + 1) as f64 * spacing_rad];
                let signs = [start, end].map(|at| condition.at(at) > 0.0);
                zeros(along, ends, signs, |phase_rad| self.changes.push(Change { phase_rad, number, condition }));
            }
            self.changes.sort_by(|a, b| a.phase_rad.total_cmp(&b.phase_rad));
            for Change { phase_rad, number, condition } in &self.changes {
                let acted = met == [true; 2];
                met[*number] = !met[*number];
                let begins = met == [true; 2];
                if begins != acted {
                    let [_, slope] = part.value(condition, motion(*phase_rad), omega_rad_s);
                    let phase_rad = *phase_rad;
                    let jumps = condition.jumps;
                    self.instants.push(Instant { phase_rad, begins, jumps, condition: *condition, slope });
                }
            }
            start = end;
        }
        self.set_weights(count, acts_first, fft);
    }

    /// Computes the weights from the instants, and from whether the part acts at the phase 0.
    fn set_weights(&mut self, count: usize, acts_first: bool, fft: Option<&Fft>) {
        self.weights.clear();
        if self.instants.is_empty() {
            self.weights.resize(count, if acts_first { 1.0 } else { 0.0 });
            return;
        }
        self.lines.clear();
        self.lines.resize(count, Complex::new(0.0, 0.0));
        self.lines[0].re = if acts_first { 1.0 } else { 0.0 };
        for Instant { phase_rad, begins, .. } in &self.instants {
            let sign = if *begins { -1.0 } else { 1.0 };
            // What acts from a to 2π has the length 2π − a.
            self.lines[0].re += sign * phase_rad / TAU;
            let (sine, cosine) = libm::sincos(*phase_rad);
            let turn = Complex::new(cosine, -sine);
            // A closing takes from the integral what an opening adds, whichever of them comes first in the period.
            // i exp(−inφ)/2πn.
            let mut line = Complex::new(0.0, sign / TAU);
            for n in 1..count.div_ceil(2) {
                line *= turn;
                self.lines[n] += line / n as f64;
            }
        }
        for n in 1..count.div_ceil(2) {
            self.lines[count - n] = self.lines[n].conj();
        }
        match fft {
            Some(fft) => {
                fft.backward(&mut self.lines);
                self.weights.extend(self.lines.iter().map(|line| line.re));
            }
            None => {
                let weight = |j: usize| {
                    let of = |(n, line): (usize, &Complex<f64>)| {
                        let (sine, cosine) = libm::sincos(TAU * ((j * n) % count) as f64 / count as f64);
                        line.re * cosine - line.im * sine
                    };
                    self.lines.iter().enumerate().map(of).sum::<f64>()
                };
                self.weights.extend((0..count).map(weight));
            }
        }
    }
}

impl Part {
    /// E and dE/dτ of a condition.
    fn value(&self, condition: &Condition, [x, v, a]: [f64; 3], omega_rad_s: f64) -> [f64; 2] {
        let [depth, rate, acceleration] = [self.sign * x - self.gap, self.sign * v, self.sign * a];
        let slope = condition.by_depth * rate + condition.by_rate_s * acceleration;
        [condition.at([depth, rate]), slope / omega_rad_s]
    }
}

impl Condition {
    fn at(&self, [depth, rate]: [f64; 2]) -> f64 {
        self.by_depth * depth + self.by_rate_s * rate + self.constant
    }

    /// Says whether E keeps its sign between two samples, which have δ and δ̇, on the cubic H of Hermite: with D = δ₁ − δ₀,
    /// V = h δ̇ and s from 0 to 1, H = δ₀ + V₀ s + (3D − 2V₀ − V₁) s² + (V₀ + V₁ − 2D) s³ and E = α H + τ/h H′ + β.
    fn stays(&self, [start, end]: [[f64; 2]; 2], step_s: f64) -> bool {
        let rate = self.by_rate_s / step_s;
        let [v0, v1] = [start[1], end[1]].map(|v| v * step_s);
        let change = end[0] - start[0];
        let square = 3.0 * change - 2.0 * v0 - v1;
        let cube = v0 + v1 - 2.0 * change;
        let first = self.at(start);
        let linear = self.by_depth * v0 + 2.0 * rate * square;
        let quadratic = self.by_depth * square + 3.0 * rate * cube;
        // A cubic lies between its coefficients of Bernstein.
        let inner = [first + linear / 3.0, first + (2.0 * linear + quadratic) / 3.0, self.at(end)];
        inner.iter().all(|value| (*value > 0.0) == (first > 0.0))
    }
}

/// Calls `found` with the phases between two at which E changes its sign; `along` returns E and dE/dτ, and `signs` says
/// whether E is positive at the ends. If it has the same sign there, it can change twice beside a turn between them.
fn zeros(along: impl Fn(f64) -> [f64; 2], [from, to]: [f64; 2], signs: [bool; 2], mut found: impl FnMut(f64)) {
    if signs[0] != signs[1] {
        return found(zero(&along, [from, to], signs[0]));
    }
    let positive = signs[0];
    // Towards zero at the start, and away from it at the end.
    let towards = |phase: f64| (along(phase)[1] < 0.0) == positive;
    if !towards(from) || towards(to) {
        return;
    }
    let [mut before, mut after] = [from, to];
    for _ in 0..ZERO_STEPS {
        let middle = 0.5 * (before + after);
        if (along(middle)[0] > 0.0) != positive {
            found(zero(&along, [from, middle], positive));
            return found(zero(&along, [middle, to], !positive));
        }
        if after - before <= LOCATED_RAD * to.max(1.0) {
            return;
        }
        *(if towards(middle) { &mut before } else { &mut after }) = middle;
    }
}

/// Returns the zero between two phases, at the first of which E is positive or not, by Newton's method within them.
fn zero(along: impl Fn(f64) -> [f64; 2], [mut from, mut to]: [f64; 2], positive: bool) -> f64 {
    let mut phase = 0.5 * (from + to);
    for _ in 0..ZERO_STEPS {
        let [value, slope] = along(phase);
        if (value > 0.0) == positive {
            from = phase;
        } else {
            to = phase;
        }
        let newton = phase - value / slope;
        let next = if newton >= from && newton <= to { newton } else { 0.5 * (from + to) };
        if (next - phase).abs() <= LOCATED_RAD * to.max(1.0) {
            return next;
        }
        phase = next;
    }
    phase
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_dynamics::structure::Side;

    const RATE: f64 = 3.0;
    const GAP: f64 = 0.8;
    const LAG_S: f64 = 0.1;
    const COUNT: usize = 64;
    const ORDERS: usize = 6;
    const LAW: Law = Law::KelvinVoigt { stiffness: 1.0, damping: LAG_S, gap: GAP, side: Side::Positive, preload: 0.0 };

    /// The coefficients of cos kτ and sin kτ of the force that x = a cos(τ − shift) has in a damped contact, τ being 3t, by
    /// way of the samples; then their derivatives by a.
    fn coefficients(amplitude: f64, shift: f64) -> Vec<[f64; 2]> {
        let motion = |phase: f64| {
            let (sine, cosine) = libm::sincos(phase - shift);
            [amplitude * cosine, -amplitude * RATE * sine, -amplitude * RATE * RATE * cosine]
        };
        let angle = |j: usize| TAU * j as f64 / COUNT as f64;
        let [position, velocity] = [0, 1].map(|d| (0..COUNT).map(|j| motion(angle(j))[d]).collect::<Vec<f64>>());
        let mut acting = Acting::default();
        let step_s = angle(1) / RATE;
        let part = parts(&LAW)[0].unwrap();
        acting.find(&part, [&position, &velocity], &motion, step_s, Some(&Fft::at_least(COUNT)));
        assert_eq!(acting.instants.len(), 2);
        let mut sums = vec![[0.0; 2]; 2 * ORDERS];
        let add = |sums: &mut [[f64; 2]], phase: f64, value: f64| {
            for (k, sum) in sums.iter_mut().enumerate() {
                let (s, c) = libm::sincos(k as f64 * phase);
                sum[0] += value * c;
                sum[1] += value * s;
            }
        };
        for (j, weight) in acting.weights.iter().enumerate() {
            let by_amplitude = position[j] + LAG_S * velocity[j];
            let weight = 2.0 / COUNT as f64 * weight;
            add(&mut sums[..ORDERS], angle(j), weight * (by_amplitude - GAP));
            add(&mut sums[ORDERS..], angle(j), weight * by_amplitude / amplitude);
        }
        for instant in acting.instants.iter().filter(|instant| instant.jumps) {
            let [x, v, _] = motion(instant.phase_rad);
            let by_amplitude = -x / amplitude / instant.slope;
            add(&mut sums[ORDERS..], instant.phase_rad, -2.0 / TAU * LAG_S * v * by_amplitude);
        }
        sums
    }

    /// The same coefficients of the force itself, by Simpson's rule on many points from closing to opening. With a = 1 it
    /// closes where cos θ = g; δ + γ δ̇ = √(1 + γ²r²) cos(θ + arctan γr) − g, and it opens where that is zero.
    fn expected(shift: f64) -> Vec<[f64; 2]> {
        let lag = LAG_S * RATE;
        let closes = -libm::acos(GAP);
        let opens = libm::acos(GAP / libm::sqrt(1.0 + lag * lag)) - libm::atan(lag);
        let points = 2000;
        let step = (opens - closes) / f64::from(points);
        let of = |k: usize| {
            let value = |theta: f64| {
                let force = libm::cos(theta) - lag * libm::sin(theta) - GAP;
                let (s, c) = libm::sincos(k as f64 * (theta + shift));
                [force * c, force * s]
            };
            let mut sums = [0.0; 2];
            for i in 0..=points {
                let weight = if i == 0 || i == points { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                let value = value(closes + f64::from(i) * step);
                (0..2).for_each(|d| sums[d] += weight * step / 3.0 * value[d]);
            }
            sums.map(|sum| sum * 2.0 / TAU)
        };
        (0..ORDERS).map(of).collect()
    }

    fn largest_difference(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
        let of = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
        a.iter().zip(b).map(of).fold(0.0, f64::max)
    }

    /// Wherever the contact closes and opens between the samples, also around the phase 0.
    #[test]
    fn a_force_that_begins_with_a_jump_has_the_coefficients_of_its_integrals() {
        for place in 0..23 {
            let shift = f64::from(place) * 0.4;
            let off = largest_difference(&coefficients(1.0, shift)[..ORDERS], &expected(shift));
            assert!(off < 1e-12, "{shift}: {off:e}");
        }
    }

    /// The derivative is that of the value, by a difference of fourth order, also where the contact closes at a sample
    /// or next to it.
    #[test]
    fn the_derivative_is_continuous_where_a_contact_closes_at_a_sample() {
        let h = 1e-3;
        let at_sample = libm::acos(GAP) + 11.0 * TAU / COUNT as f64;
        for beside in [-1e-2, -1e-4, -1e-7, 0.0, 1e-7, 1e-4, 1e-2] {
            let of = |amplitude: f64| coefficients(amplitude, at_sample + beside);
            let [far_below, below, above, far_above] = [-2.0, -1.0, 1.0, 2.0].map(|step| of(1.0 + step * h));
            let difference = |k: usize| {
                let near = [0, 1].map(|d| above[k][d] - below[k][d]);
                let far = [0, 1].map(|d| far_above[k][d] - far_below[k][d]);
                [0, 1].map(|d| (8.0 * near[d] - far[d]) / (12.0 * h))
            };
            let seen: Vec<[f64; 2]> = (0..ORDERS).map(difference).collect();
            let off = largest_difference(&seen, &of(1.0)[ORDERS..]);
            assert!(off < 1e-9, "{beside}: {off:e}");
        }
    }

    /// A vibration that enters a contact between two samples and leaves it before the next one.
    #[test]
    fn a_contact_between_two_samples_is_found() {
        let half = 0.5 * TAU / COUNT as f64;
        let undamped = Law::KelvinVoigt { stiffness: 1.0, damping: 0.0, gap: GAP, side: Side::Positive, preload: 0.0 };
        let amplitude = GAP / libm::cos(0.5 * half);
        let motion = |phase: f64| {
            let (sine, cosine) = libm::sincos(phase - half);
            [amplitude * cosine, -amplitude * sine, -amplitude * cosine]
        };
        let angle = |j: usize| TAU * j as f64 / COUNT as f64;
        let [position, velocity] = [0, 1].map(|d| (0..COUNT).map(|j| motion(angle(j))[d]).collect::<Vec<f64>>());
        assert!(position.iter().all(|x| *x < GAP));
        let mut acting = Acting::default();
        acting.find(&parts(&undamped)[0].unwrap(), [&position, &velocity], &motion, angle(1), None);
        let phases: Vec<f64> = acting.instants.iter().map(|instant| instant.phase_rad).collect();
        assert!((phases[0] - 0.5 * half).abs() < 1e-13 && (phases[1] - 1.5 * half).abs() < 1e-13, "{phases:?}");
        let mean = acting.weights.iter().sum::<f64>() / COUNT as f64;
        assert!((mean - half / TAU).abs() < 1e-13, "{mean}");
    }
}
