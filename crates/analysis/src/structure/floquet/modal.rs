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

use super::{StateVariation, Variations, identity};
use crate::dense::{Lu, dot};
use crate::structure::unknowns::{Body, Condensed};

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
    h: f64,
    /// S and G of each place.
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    /// Place and variation of each state.
    states: Vec<(usize, StateVariation)>,
    /// 1 + ½hCG, if G is not zero.
    implicit: Option<Lu>,
}

/// The flow over the period in steps over `points` points; none if it can't be computed.
pub(super) fn flow(of: &Variations, points: usize) -> Option<DMatrix<f64>> {
    let Body::Condensed(condensed) = &of.balance.unknowns.body else { return None };
    let n = condensed.modes.len();
    let size = 2 * n + of.states.len();
    let h = points as f64 * of.spacing_s;
    let half: Vec<Block> = condensed.modes.iter().map(|mode| block(mode, 0.5 * h)).collect();
    let m = of.unknowns();
    let coupling: Vec<f64> =
        (0..m * m).map(|pair| dot(&condensed.places[pair / m], &condensed.places[pair % m])).collect();
    let mut flow = identity(size);
    for middle in (points / 2..of.samples.count()).step_by(points) {
        let impulse = Impulse::new(of, condensed, &coupling, [middle, points], h)?;
        flow.chunks_exact_mut(size).for_each(|column| impulse.step(condensed, &half, &coupling, column));
    }
    Some(DMatrix::from_column_slice(size, size, &flow))
}

impl Impulse {
    fn new(
        of: &Variations,
        condensed: &Condensed,
        coupling: &[f64],
        [point, points]: [usize; 2],
        h: f64,
    ) -> Option<Impulse> {
        let m = of.unknowns();
        let diagonal = |d: usize| (0..m).map(|i| of.by(d, [i, i], point)).collect::<Vec<f64>>();
        let (stiffness, damping) = (diagonal(0), diagonal(1));
        let place = |state: usize| condensed.of_element[of.samples.histories[of.states[state]].element];
        let states = (0..of.states.len()).map(|state| (place(state), of.state(state, point, points))).collect();
        let mut implicit = None;
        if damping.iter().any(|g| *g != 0.0) {
            let mut lu = Lu::default();
            for (at, cell) in lu.zeroed(m).iter_mut().enumerate() {
                let (i, j) = (at % m, at / m);
                *cell = f64::from(u8::from(i == j)) + 0.5 * h * coupling[i * m + j] * damping[j];
            }
            lu.factor().ok()?;
            implicit = Some(lu);
        }
        Some(Impulse { h, stiffness, damping, states, implicit })
    }

    /// A step of one variation.
    fn step(&self, condensed: &Condensed, half: &[Block], coupling: &[f64], y: &mut [f64]) {
        let n = half.len();
        let seen = |y: &[f64], first: usize| -> Vec<f64> {
            condensed.places.iter().map(|place| dot(place, &y[first..first + n])).collect()
        };
        let start = if self.states.is_empty() { vec![] } else { seen(y, 0) };
        drift(half, y);
        let (x, mut v) = (seen(y, 0), seen(y, n));
        self.follow(&mut y[2 * n..], &start, &x, &v);
        let mut force: Vec<f64> = (0..x.len()).map(|i| self.stiffness[i] * x[i]).collect();
        for ((place, at), z) in self.states.iter().zip(&y[2 * n..]) {
            force[*place] += at.force * z;
        }
        if let Some(implicit) = &self.implicit {
            let m = x.len();
            (0..m).for_each(|i| force[i] += 0.5 * self.damping[i] * v[i]);
            let mut after: Vec<f64> =
                (0..m).map(|i| v[i] - self.h * dot(&coupling[i * m..(i + 1) * m], &force)).collect();
            implicit.solve(&mut after);
            (0..m).for_each(|i| force[i] += 0.5 * self.damping[i] * after[i]);
            v = after;
        }
        for (place, force) in condensed.places.iter().zip(&force) {
            let impulse = -self.h * force;
            y[n..2 * n].iter_mut().zip(place).for_each(|(rate, phi)| *rate += impulse * phi);
        }
        if !self.states.is_empty() {
            v = if self.implicit.is_some() { v } else { seen(y, n) };
        }
        drift(half, y);
        if !self.states.is_empty() {
            let end = seen(y, 0);
            self.follow(&mut y[2 * n..], &x, &end, &v);
        }
    }

    /// Half a step of the states, in which the places move from `from` to `to`, or at v.
    fn follow(&self, states: &mut [f64], from: &[f64], to: &[f64], v: &[f64]) {
        for (z, (place, at)) in states.iter_mut().zip(&self.states) {
            *z = match at.by_state {
                None => 0.0,
                Some(0.0) => *z + at.by_velocity * (to[*place] - from[*place]),
                Some(rate) => {
                    let decay = 0.5 * self.h * rate;
                    *z * libm::exp(decay) + at.by_velocity * v[*place] * libm::expm1(decay) / rate
                }
            };
        }
    }
}

/// Half a step of the linear structure.
fn drift(half: &[Block], y: &mut [f64]) {
    let n = half.len();
    for (i, [position, velocity]) in half.iter().enumerate() {
        let (q, rate) = (y[i], y[n + i]);
        y[i] = position[0] * q + position[1] * rate;
        y[n + i] = velocity[0] * q + velocity[1] * rate;
    }
}
