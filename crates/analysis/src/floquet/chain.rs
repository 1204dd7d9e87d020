//! The flow of a chain's variations (δu, δu̇, δz): half a step of the structure that is linear about its rest, exact,
//! the impulse of what it leaves out, and another half.
//!
//! At rest M₀ δü + D δu̇ + K δu = 0, with the flow e^{hA}. Along the response M δü + G δu̇ + S δu + Σ w f_z δz = 0, and
//! with S′ = S − M M₀⁻¹K and G′ = G − M M₀⁻¹D the impulse is
//!
//! ```text
//! (M + ½hG′)(δu̇⁺ − δu̇) = −h (S′ δu + G′ δu̇ + Σ w f_z δz)
//! ```
//!
//! δz follows δx = wᵀδu and δv = wᵀδu̇ + ∂v/∂u δu.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::DMatrix;

use super::rows::{Rows, eliminate};
use super::{StateVariation, Variations};
use crate::dense::add;
use crate::samples::Geometry;

/// Terms of the series of e^A; with the steps of a periodic response the last is far below rounding.
const TERMS: usize = 16;

/// The structure about its rest.
struct Rest {
    /// M₀⁻¹K and M₀⁻¹D, by rows.
    rates: [Vec<f64>; 2],
    /// e^{½hA} and e^{hA} over (δu, δu̇), by rows.
    half: Vec<f64>,
    whole: Vec<f64>,
}

impl Rest {
    fn new(of: &Variations, h: f64) -> Option<Rest> {
        let linear = of.balance.forced.assembly().linear();
        let n = of.unknowns();
        let mut rates = [linear.stiffness.clone(), linear.damping.clone()];
        for matrix in &mut rates {
            eliminate(&mut linear.mass.clone(), matrix, n)?;
        }
        let a = DMatrix::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
            (true, _) => f64::from(u8::from(j == n + i)),
            (_, true) => -rates[0][(i - n) * n + j],
            _ => -rates[1][(i - n) * n + j - n],
        });
        let half = exponential(&(a * (0.5 * h)));
        let whole = &half * &half;
        let by_rows = |matrix: DMatrix<f64>| matrix.transpose().as_slice().to_vec();
        Some(Rest { rates, half: by_rows(half), whole: by_rows(whole) })
    }
}

/// Returns e^A by its series.
fn exponential(a: &DMatrix<f64>) -> DMatrix<f64> {
    let one = DMatrix::identity(a.nrows(), a.nrows());
    // Horner's rule, from the smallest term on.
    (1..=TERMS).rev().fold(one.clone(), |sum, term| &one + a * sum / term as f64)
}

/// Returns the flow over the period in steps over `points` points; `None` if it can't be computed.
pub(super) fn flow(of: &Variations, points: usize) -> Option<DMatrix<f64>> {
    let n = of.unknowns();
    let h = points as f64 * of.spacing_s;
    let rest = Rest::new(of, h)?;
    let mut flow = Rows::identity(2 * n + of.states.len());
    let mut impulse = Impulse::new(n, flow.width);
    let count = of.samples.count();
    flow.multiply(&rest.half);
    for middle in (points / 2..count).step_by(points) {
        let states = Impulse::states(of, [middle, points], h);
        impulse.way(&mut flow, n, &states);
        Impulse::turn(&mut flow, n, &states, h);
        impulse.act(of, &rest, middle, &states, h, &mut flow)?;
        let is_last = middle + points >= count;
        // The second half of a step and the first half of the next are one exact step, unless a state is followed
        // between them.
        if states.is_empty() {
            flow.multiply(if is_last { &rest.half } else { &rest.whole });
            continue;
        }
        Impulse::turn(&mut flow, n, &states, h);
        impulse.keep(&flow, n);
        flow.multiply(&rest.half);
        impulse.way(&mut flow, n, &states);
        if !is_last {
            impulse.keep(&flow, n);
            flow.multiply(&rest.half);
        }
    }
    Some(flow.matrix())
}

/// The impulse in the middle of a step, in storage that is kept.
struct Impulse {
    /// M, M + ½hG′, S′, G′.
    matrices: [Vec<f64>; 4],
    /// Force on each unknown, one row each.
    force: Vec<f64>,
    /// δu before the last half of a step.
    before: Vec<f64>,
}

impl Impulse {
    fn new(n: usize, width: usize) -> Impulse {
        let square = vec![0.0; n * n];
        let mut before = vec![0.0; n * width];
        (0..n).for_each(|i| before[i * width + i] = 1.0);
        Impulse { matrices: [(); 4].map(|()| square.clone()), force: vec![0.0; n * width], before }
    }

    fn keep(&mut self, flow: &Rows, n: usize) {
        self.before.copy_from_slice(flow.rows(0..n));
    }

    fn states(of: &Variations, [middle, points]: [usize; 2], h: f64) -> Vec<(Geometry, StateVariation, f64)> {
        let state = |state: usize| {
            let at = of.state(state, middle, points);
            let decay = 0.5 * h * at.by_state.unwrap_or(0.0);
            (of.geometry(state, middle), at, decay)
        };
        (0..of.states.len()).map(state).collect()
    }

    /// Advances the states by half a step at the response in its middle: for friction by the turn of w, for others by
    /// the whole half step, exact at constant δv.
    fn turn(flow: &mut Rows, n: usize, states: &[(Geometry, StateVariation, f64)], h: f64) {
        let width = flow.width;
        for (s, (geometry, at, decay)) in states.iter().enumerate() {
            let (moving, state) = flow.split(2 * n, s);
            let Some(rate) = at.by_state else {
                state.fill(0.0);
                continue;
            };
            let by_velocity = at.by_velocity * if rate == 0.0 { 0.5 * h } else { libm::expm1(*decay) / rate };
            let kept = libm::exp(*decay);
            state.iter_mut().for_each(|z| *z *= kept);
            for k in 0..n {
                add(state, &moving[k * width..], by_velocity * geometry.velocity_by_position(k));
                if rate != 0.0 {
                    add(state, &moving[(n + k) * width..], by_velocity * geometry.direction[k]);
                }
            }
        }
    }

    /// Advances the states of friction by the displacement since `before`.
    fn way(&self, flow: &mut Rows, n: usize, states: &[(Geometry, StateVariation, f64)]) {
        let width = flow.width;
        for (s, (geometry, at, _)) in states.iter().enumerate().filter(|(_, (_, at, _))| at.by_state == Some(0.0)) {
            let (moving, state) = flow.split(2 * n, s);
            for k in 0..n {
                let factor = at.by_velocity * geometry.direction[k];
                add(state, &moving[k * width..], factor);
                add(state, &self.before[k * width..(k + 1) * width], -factor);
            }
        }
    }

    /// Applies the impulse at a point.
    fn act(
        &mut self,
        of: &Variations,
        rest: &Rest,
        point: usize,
        states: &[(Geometry, StateVariation, f64)],
        h: f64,
        flow: &mut Rows,
    ) -> Option<()> {
        let n = of.unknowns();
        let width = flow.width;
        let [mass, left, stiffness, damping] = &mut self.matrices;
        for (at, mass) in mass.iter_mut().enumerate() {
            *mass = of.by(2, [at / n, at % n], point);
        }
        for i in 0..n {
            for j in 0..n {
                let of_rest = |rates: &[f64]| (0..n).map(|k| mass[i * n + k] * rates[k * n + j]).sum::<f64>();
                stiffness[i * n + j] = of.by(0, [i, j], point) - of_rest(&rest.rates[0]);
                damping[i * n + j] = of.by(1, [i, j], point) - of_rest(&rest.rates[1]);
                left[i * n + j] = mass[i * n + j] + 0.5 * h * damping[i * n + j];
            }
        }
        self.force.fill(0.0);
        for (i, force) in self.force.chunks_exact_mut(width).enumerate() {
            for k in 0..n {
                flow.add_to(force, k, stiffness[i * n + k]);
                flow.add_to(force, n + k, damping[i * n + k]);
            }
            for (s, (geometry, at, _)) in states.iter().enumerate() {
                flow.add_to(force, 2 * n + s, geometry.direction[i] * at.force);
            }
        }
        eliminate(left, &mut self.force, n)?;
        flow.add(n, &self.force, -h);
        Some(())
    }
}
