//! The flow of variations (δq, δq̇, δz) of modes: exact half steps, and impulses of the elements in between.
//!
//! With the places' φ as rows of Φ, x = Φ δq, v = Φ δq̇ and C = ΦΦᵀ the impulse is
//!
//! ```text
//! δq̇⁺ = δq̇ − h Φᵀ (S x + f_z z + ½ G (v + v⁺)),     (1 + ½hCG) v⁺ = v − h C (S x + f_z z + ½ G v)
//! ```
//!
//! with z after half a step of ż = a v + b z, exact at constant v; of friction z follows x.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::DMatrix;

use super::rows::{Rows, add, eliminate};
use super::{StateVariation, Variations};
use crate::dense::dot;
use crate::structure::unknowns::Condensed;

/// The flow of a mode over a time: (q, q̇) ← these rows.
type Block = [[f64; 2]; 2];

/// With σ = ζω and ω_d = ω √(1 − ζ²), q(t) = e^{−σt} (q cos ω_d t + (q̇ + σq)/ω_d sin ω_d t).
fn block(&[omega, zeta]: &[f64; 2], t: f64) -> Block {
    let (decay, damped) = (zeta * omega, omega * libm::sqrt(1.0 - zeta * zeta));
    let (sine, cosine) = libm::sincos(damped * t);
    let (scale, s) = (libm::exp(-decay * t), sine / damped);
    [[scale * (cosine + decay * s), scale * s], [-scale * omega * omega * s, scale * (cosine - decay * s)]]
}

/// What a step needs at its middle.
struct Impulse {
    /// S and G of each place.
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    /// Place and variation of each state.
    states: Vec<(usize, StateVariation)>,
    /// 1 + ½hCG by rows, if G is not zero.
    implicit: Option<Vec<f64>>,
}

/// The flow, and rows of one number a place that are kept.
struct Flow<'a> {
    condensed: &'a Condensed,
    h: f64,
    half: Vec<Block>,
    whole: Vec<Block>,
    /// C by rows.
    coupling: Vec<f64>,
    rows: Rows,
    /// x at the last whole and at the last half step, v, and the forces.
    before: Vec<f64>,
    x: Vec<f64>,
    v: Vec<f64>,
    force: Vec<f64>,
}

/// The flow of modes over the period in steps over `points` points; none if it can't be computed.
pub(super) fn flow(of: &Variations, condensed: &Condensed, points: usize) -> Option<DMatrix<f64>> {
    let (n, m, h) = (condensed.modes.len(), of.unknowns(), points as f64 * of.spacing_s);
    let blocks = |t: f64| condensed.modes.iter().map(|mode| block(mode, t)).collect();
    let coupling = (0..m * m).map(|pair| dot(&condensed.places[pair / m], &condensed.places[pair % m])).collect();
    let rows = Rows::identity(2 * n + of.states.len());
    let empty = || vec![0.0; m * rows.width()];
    let (before, x, v, force) = (empty(), empty(), empty(), empty());
    let (half, whole) = (blocks(0.5 * h), blocks(h));
    let mut flow = Flow { condensed, h, half, whole, coupling, rows, before, x, v, force };
    let count = of.samples.count();
    Flow::see(condensed, &flow.rows, 0, &mut flow.before);
    flow.drift(false);
    for middle in (points / 2..count).step_by(points) {
        let is_last = middle + points >= count;
        let impulse = Impulse::new(of, &flow, [middle, points])?;
        if of.states.is_empty() {
            flow.strike(&impulse)?;
            flow.drift(!is_last);
            continue;
        }
        flow.strike_with_states(&impulse)?;
        if !is_last {
            flow.drift(false);
        }
    }
    Some(flow.rows.matrix())
}

impl Impulse {
    fn new(of: &Variations, flow: &Flow, [point, points]: [usize; 2]) -> Option<Impulse> {
        let m = of.unknowns();
        let diagonal = |d: usize| (0..m).map(|i| of.by(d, [i, i], point)).collect::<Vec<f64>>();
        let (stiffness, damping) = (diagonal(0), diagonal(1));
        let place = |state: usize| flow.condensed.of_element[of.samples.histories[of.states[state]].element];
        let states = (0..of.states.len()).map(|state| (place(state), of.state(state, point, points))).collect();
        let implicit = damping.iter().any(|g| *g != 0.0).then(|| {
            let cell = |(at, coupling): (usize, &f64)| {
                f64::from(u8::from(at / m == at % m)) + 0.5 * flow.h * coupling * damping[at % m]
            };
            flow.coupling.iter().enumerate().map(cell).collect()
        });
        Some(Impulse { stiffness, damping, states, implicit })
    }
}

impl Flow<'_> {
    /// Half a step of the linear structure, or a whole one.
    fn drift(&mut self, whole: bool) {
        let (blocks, n) = (if whole { &self.whole } else { &self.half }, self.half.len());
        for (i, [[a, b], [c, d]]) in blocks.iter().enumerate() {
            let (position, velocity) = self.rows.pair(i, n + i);
            for (q, rate) in position.iter_mut().zip(velocity) {
                (*q, *rate) = (a * *q + b * *rate, c * *q + d * *rate);
            }
        }
    }

    /// The displacements or, with the rows from n on, the velocities of the places.
    fn see(condensed: &Condensed, rows: &Rows, first: usize, seen: &mut [f64]) {
        seen.fill(0.0);
        for (seen, place) in seen.chunks_exact_mut(rows.width()).zip(&condensed.places) {
            place.iter().enumerate().for_each(|(mode, phi)| rows.add_to(seen, first + mode, *phi));
        }
    }

    /// The impulse.
    fn strike(&mut self, impulse: &Impulse) -> Option<()> {
        let (n, m, width, h) = (self.half.len(), self.condensed.places.len(), self.rows.width(), self.h);
        Flow::see(self.condensed, &self.rows, 0, &mut self.x);
        self.force.fill(0.0);
        for i in 0..m {
            let force = &mut self.force[i * width..(i + 1) * width];
            add(force, &self.x[i * width..], impulse.stiffness[i]);
            for (s, (_, at)) in impulse.states.iter().enumerate().filter(|(_, (place, _))| *place == i) {
                self.rows.add_to(force, 2 * n + s, at.force);
            }
        }
        if let Some(implicit) = &impulse.implicit {
            Flow::see(self.condensed, &self.rows, n, &mut self.v);
            let row = |i: usize| i * width..(i + 1) * width;
            (0..m).for_each(|i| add(&mut self.force[row(i)], &self.v[row(i)], 0.5 * impulse.damping[i]));
            for i in 0..m {
                for j in 0..m {
                    add(&mut self.v[row(i)], &self.force[row(j)], -h * self.coupling[i * m + j]);
                }
            }
            eliminate(&mut implicit.clone(), &mut self.v, m)?;
            (0..m).for_each(|i| add(&mut self.force[row(i)], &self.v[row(i)], 0.5 * impulse.damping[i]));
        }
        for (place, force) in self.condensed.places.iter().zip(self.force.chunks_exact(width)) {
            place.iter().enumerate().for_each(|(mode, phi)| self.rows.add(n + mode, force, -h * phi));
        }
        Some(())
    }

    /// From the middle of a step, where its first half has come to, to its end, with the states.
    fn strike_with_states(&mut self, impulse: &Impulse) -> Option<()> {
        let n = self.half.len();
        let see = |of: &mut Flow| {
            Flow::see(of.condensed, &of.rows, 0, &mut of.x);
            Flow::see(of.condensed, &of.rows, n, &mut of.v);
        };
        see(self);
        self.follow(impulse);
        self.strike(impulse)?;
        Flow::see(self.condensed, &self.rows, n, &mut self.v);
        self.before.copy_from_slice(&self.x);
        self.drift(false);
        Flow::see(self.condensed, &self.rows, 0, &mut self.x);
        self.follow(impulse);
        self.before.copy_from_slice(&self.x);
        Some(())
    }

    /// Half a step of the states, in which the places move from `before` to `x`, or at `v`.
    fn follow(&mut self, impulse: &Impulse) {
        let (n, width) = (self.half.len(), self.rows.width());
        for (s, (place, at)) in impulse.states.iter().enumerate() {
            let seen = place * width..(place + 1) * width;
            let (_, state) = self.rows.split(2 * n, s);
            match at.by_state {
                None => state.fill(0.0),
                Some(0.0) => {
                    add(state, &self.x[seen.clone()], at.by_velocity);
                    add(state, &self.before[seen], -at.by_velocity);
                }
                Some(rate) => {
                    let decay = 0.5 * self.h * rate;
                    let kept = libm::exp(decay);
                    state.iter_mut().for_each(|z| *z *= kept);
                    add(state, &self.v[seen], at.by_velocity * libm::expm1(decay) / rate);
                }
            }
        }
    }
}
