//! The flow of variations (δq, δq̇, δz) of modes: exact half steps, and impulses of the elements in between.
//!
//! With the places' φ as rows of Φ, x = Φ δq, v = Φ δq̇, C = ΦΦᵀ, and the derivatives S and G of the forces, of which
//! polynomials couple places in S, the impulse is
//!
//! ```text
//! δq̇⁺ = δq̇ − h Φᵀ (S x + f_z z + ½ G (v + v⁺)),     (1 + ½hCG) v⁺ = v − h C (S x + f_z z + ½ G v)
//! ```
//!
//! with z after half a step of ż = a v + b z, exact at constant v; of friction z follows x.
//!
//! The columns of the flow are independent: [`LANES`] of them at a time are taken through the whole period, in
//! registers and the nearest cache. Between impulses that act the modes move in one exact step, however long: an open
//! contact and friction that slips cost nothing.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::DMatrix;
use resonarm_dynamics::structure::{Law, mode_transient};
use resonarm_numeric::registers::{Task, widest};

use super::rows::eliminate;
use super::{StateVariation, Variations};
use crate::dense::dot;
use crate::unknowns::Condensed;

/// Columns at a time.
const LANES: usize = 8;
/// One number for each of these columns.
type Lanes = [f64; LANES];

/// The flow of a mode over a time: (q, q̇) ← these rows.
type Block = [[f64; 2]; 2];

/// With σ = ζω and ω_d = ω √(1 − ζ²), but for rigid and overdamped modes, q(t) = e^{−σt} (q cos ω_d t + (q̇ + σq)/ω_d sin ω_d t).
fn block(&[omega, zeta]: &[f64; 2], t: f64) -> Block {
    // Rigid and overdamped modes have no damped frequency to divide by.
    if omega == 0.0 || zeta >= 1.0 {
        let sigma = zeta * omega;
        let [c, s] = mode_transient(omega, zeta, t);
        return [[c + sigma * s, s], [-omega * omega * s, c - sigma * s]];
    }
    let decay = zeta * omega;
    let damped = omega * libm::sqrt(1.0 - zeta * zeta);
    let (sine, cosine) = libm::sincos(damped * t);
    let scale = libm::exp(-decay * t);
    let s = sine / damped;
    [[scale * (cosine + decay * s), scale * s], [-scale * omega * omega * s, scale * (cosine - decay * s)]]
}

#[inline(always)]
fn add(target: &mut Lanes, source: &Lanes, factor: f64) {
    target.iter_mut().zip(source).for_each(|(target, source)| *target += factor * source);
}

/// Advances a mode by itself.
#[inline(always)]
fn step(&[[a, b], [c, d]]: &Block, q: Lanes, rate: Lanes) -> [Lanes; 2] {
    let [mut next, mut next_rate] = [[0.0; LANES]; 2];
    for lane in 0..LANES {
        next[lane] = a * q[lane] + b * rate[lane];
        next_rate[lane] = c * q[lane] + d * rate[lane];
    }
    [next, next_rate]
}

/// The impulse in the middle of a step.
struct Impulse {
    /// S and G of each place.
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    /// S between two places, by row and column.
    coupled: Vec<([usize; 2], f64)>,
    /// Place and variation of each state.
    states: Vec<(usize, StateVariation)>,
    /// 1 + ½hCG by rows, if G is not zero.
    implicit: Option<Vec<f64>>,
}

impl Impulse {
    fn new(of: &Variations, condensed: &Condensed, coupling: &[f64], h: f64, [point, points]: [usize; 2]) -> Impulse {
        let m = of.unknowns();
        let diagonal = |d: usize| (0..m).map(|i| of.by(d, [i, i], point)).collect::<Vec<f64>>();
        let stiffness = diagonal(0);
        let damping = diagonal(1);
        let pairs = (0..m * m).map(|pair| [pair / m, pair % m]).filter(|[i, j]| i != j);
        let coupled = pairs.map(|pair| (pair, of.by(0, pair, point))).filter(|(_, s)| *s != 0.0).collect();
        let place = |state: usize| condensed.of_element[of.samples.histories[of.states[state]].element][0].0;
        let states = (0..of.states.len()).map(|state| (place(state), of.state(state, point, points))).collect();
        let implicit = damping.iter().any(|g| *g != 0.0).then(|| {
            let cell = |(at, c): (usize, &f64)| f64::from(u8::from(at / m == at % m)) + 0.5 * h * c * damping[at % m];
            coupling.iter().enumerate().map(cell).collect()
        });
        Impulse { stiffness, damping, coupled, states, implicit }
    }

    /// Says whether no force acts, and the states of elements are held at zero already.
    fn is_idle(&self, before: Option<&Impulse>) -> bool {
        let held = |of: &Impulse| of.states.iter().all(|(_, at)| at.by_state.is_none());
        let known = self.states.is_empty() || before.is_some_and(|before| held(self) && held(before));
        known && self.implicit.is_none() && self.coupled.is_empty() && self.stiffness.iter().all(|s| *s == 0.0)
    }

    /// Says whether the states need no value at the end of the step, but can be followed past it: those of friction
    /// that sticks on both sides, or is about to slip.
    fn passes(&self, after: &Impulse) -> bool {
        let rigid = |at: &StateVariation| matches!(at.by_state, None | Some(0.0));
        let pairs = || self.states.iter().zip(&after.states).map(|((_, before), (_, after))| (before, after));
        pairs().all(|(before, after)| {
            let alike = before.by_state == after.by_state && before.by_velocity == after.by_velocity;
            rigid(before) && rigid(after) && (alike || after.by_state.is_none())
        })
    }
}

/// The event after the modes have moved by themselves.
#[derive(Clone, Copy)]
enum Then {
    /// The impulse of a step.
    Strike(usize),
    /// The states of a step follow to its end.
    Follow(usize),
    Nothing,
}

/// The events of a period, or of a part: how long the modes move by themselves, and what happens then.
struct Plan<'a> {
    condensed: &'a Condensed,
    h: f64,
    /// Matrix C = ΦΦᵀ of the places, by rows.
    coupling: Vec<f64>,
    impulses: Vec<Impulse>,
    /// The flow of the modes over as many halves of a step; empty where it is not needed.
    halves: Vec<Vec<Block>>,
    events: Vec<(usize, Then)>,
    /// Whether a state follows v.
    by_velocity: bool,
}

impl<'a> Plan<'a> {
    fn new(of: &Variations, condensed: &'a Condensed, [points, parts]: [usize; 2]) -> Plan<'a> {
        let m = of.unknowns();
        let h = points as f64 * of.spacing_s;
        let coupling: Vec<f64> =
            (0..m * m).map(|pair| dot(&condensed.places[pair / m], &condensed.places[pair % m])).collect();
        let middles = (points / 2..of.samples.count() / parts).step_by(points);
        let impulses: Vec<Impulse> =
            middles.map(|middle| Impulse::new(of, condensed, &coupling, h, [middle, points])).collect();
        let mut events = Vec::new();
        let mut since = 0;
        let steps = impulses.len();
        for (step, impulse) in impulses.iter().enumerate() {
            since += 1;
            // A step whose impulse does nothing adds two halves to the time in which the modes move by themselves.
            if !impulse.is_idle(step.checked_sub(1).map(|before| &impulses[before])) {
                events.push((since, Then::Strike(step)));
                since = 0;
            }
            since += 1;
            if !impulse.states.is_empty() && impulses.get(step + 1).is_none_or(|after| !impulse.passes(after)) {
                events.push((since, Then::Follow(step)));
                since = 0;
            }
        }
        events.push((since, Then::Nothing));
        // Few different lengths occur: the exponentials of each are computed once.
        let mut halves = vec![Vec::new(); 2 * steps + 1];
        for (count, _) in &events {
            if halves[*count].is_empty() {
                halves[*count] = condensed.modes.iter().map(|mode| block(mode, 0.5 * h * *count as f64)).collect();
            }
        }
        let law = |at: usize| of.balance.forced.assembly().elements()[of.samples.histories[at].element].law;
        let by_velocity = of.states.iter().any(|&at| !matches!(law(at), Law::Friction { .. }));
        Plan { condensed, h, coupling, impulses, halves, events, by_velocity }
    }
}

/// Returns the flow of modes over the first of `parts` equal parts of the period, in steps over `points` points; `None`
/// if it can't be computed.
pub(super) fn flow(of: &Variations, condensed: &Condensed, [points, parts]: [usize; 2]) -> Option<DMatrix<f64>> {
    let plan = Plan::new(of, condensed, [points, parts]);
    let n = condensed.modes.len();
    let width = 2 * condensed.modes.len() + of.states.len();
    let mut flow = DMatrix::zeros(width, width);
    for first in (0..width).step_by(LANES) {
        let columns = widest(Columns::new(n, of.states.len(), &plan, first))?;
        for column in first..(first + LANES).min(width) {
            for (row, lanes) in columns.q.iter().chain(&columns.rate).chain(&columns.z).enumerate() {
                flow[(row, column)] = lanes[column - first];
            }
        }
    }
    Some(flow)
}

/// Some columns of the flow.
struct Columns<'a> {
    plan: &'a Plan<'a>,
    q: Vec<Lanes>,
    rate: Vec<Lanes>,
    z: Vec<Lanes>,
    /// x at the last event, x, v, and the forces, place by place.
    before: Vec<Lanes>,
    x: Vec<Lanes>,
    v: Vec<Lanes>,
    force: Vec<Lanes>,
}

impl<'a> Task for Columns<'a> {
    type Output = Option<Columns<'a>>;

    /// Carries the columns through all events of the plan.
    #[inline(always)]
    fn run(mut self) -> Option<Columns<'a>> {
        let plan = self.plan;
        for &(halves, then) in &plan.events {
            match then {
                Then::Strike(step) => {
                    let impulse = &plan.impulses[step];
                    self.drift(&plan.halves[halves], plan.by_velocity || impulse.implicit.is_some());
                    self.follow(impulse);
                    self.strike(impulse)?;
                }
                Then::Follow(step) => {
                    self.drift(&plan.halves[halves], false);
                    self.follow(&plan.impulses[step]);
                    self.force.fill([0.0; LANES]);
                }
                Then::Nothing => self.drift(&plan.halves[halves], false),
            }
            self.before.copy_from_slice(&self.x);
        }
        Some(self)
    }
}

impl<'a> Columns<'a> {
    /// The columns of the identity from `first` on.
    fn new(n: usize, states: usize, plan: &'a Plan, first: usize) -> Columns<'a> {
        let unit = |row: usize| core::array::from_fn(|lane| f64::from(u8::from(row == first + lane)));
        let rows = |from: usize, count: usize| (from..from + count).map(unit).collect::<Vec<Lanes>>();
        let places = || vec![[0.0; LANES]; plan.condensed.places.len()];
        let before = places();
        let x = places();
        let v = places();
        let force = places();
        let q = rows(0, n);
        let rate = rows(n, n);
        let z = rows(2 * n, states);
        let mut columns = Columns { plan, q, rate, z, before, x, v, force };
        for (seen, place) in columns.before.iter_mut().zip(&plan.condensed.places) {
            columns.q.iter().zip(place).for_each(|(q, phi)| add(seen, q, *phi));
        }
        columns
    }

    /// Applies the impulse of the forces, and moves the modes by themselves; then computes x, and v if `rates` is set.
    #[inline(always)]
    fn drift(&mut self, blocks: &[Block], rates: bool) {
        let places = &self.plan.condensed.places;
        let h = self.plan.h;
        let modes = blocks.iter().zip(self.q.iter_mut().zip(&mut self.rate));
        if let ([phi], [force]) = (&places[..], &self.force[..]) {
            // With one place x and v stay in registers.
            let impulse = force.map(|force| -h * force);
            let [mut x, mut v] = [[0.0; LANES]; 2];
            for ((block, (q, rate)), phi) in modes.zip(phi) {
                let mut struck = *rate;
                add(&mut struck, &impulse, *phi);
                let [next, next_rate] = step(block, *q, struck);
                add(&mut x, &next, *phi);
                if rates {
                    add(&mut v, &next_rate, *phi);
                }
                *q = next;
                *rate = next_rate;
            }
            self.x[0] = x;
            self.v[0] = if rates { v } else { self.v[0] };
            return;
        }
        self.x.fill([0.0; LANES]);
        if rates {
            self.v.fill([0.0; LANES]);
        }
        for (i, (block, (q, rate))) in modes.enumerate() {
            let mut struck = *rate;
            places.iter().zip(&self.force).for_each(|(place, force)| add(&mut struck, force, -h * place[i]));
            let [next, next_rate] = step(block, *q, struck);
            places.iter().zip(&mut self.x).for_each(|(place, x)| add(x, &next, place[i]));
            if rates {
                places.iter().zip(&mut self.v).for_each(|(place, v)| add(v, &next_rate, place[i]));
            }
            *q = next;
            *rate = next_rate;
        }
    }

    /// Computes the forces of an impulse at x and v; v then holds the velocity after it.
    fn strike(&mut self, impulse: &Impulse) -> Option<()> {
        let m = self.x.len();
        let h = self.plan.h;
        let coupling = &self.plan.coupling;
        for (i, force) in self.force.iter_mut().enumerate() {
            *force = self.x[i].map(|x| impulse.stiffness[i] * x);
            for ((_, at), z) in impulse.states.iter().zip(&self.z).filter(|((place, _), _)| *place == i) {
                add(force, z, at.force);
            }
        }
        for &([row, column], stiffness) in &impulse.coupled {
            add(&mut self.force[row], &self.x[column], stiffness);
        }
        let Some(implicit) = &impulse.implicit else {
            if self.plan.by_velocity {
                (0..m * m).for_each(|pair| add(&mut self.v[pair / m], &self.force[pair % m], -h * coupling[pair]));
            }
            return Some(());
        };
        (0..m).for_each(|i| add(&mut self.force[i], &self.v[i], 0.5 * impulse.damping[i]));
        (0..m * m).for_each(|pair| add(&mut self.v[pair / m], &self.force[pair % m], -h * coupling[pair]));
        // v becomes that after the impulse. Half the damper's force is from v before it, the other half from v after
        // it.
        eliminate(&mut implicit.clone(), self.v.as_flattened_mut(), m)?;
        (0..m).for_each(|i| add(&mut self.force[i], &self.v[i], 0.5 * impulse.damping[i]));
        Some(())
    }

    /// Advances the states while the places move from `before` to `x`, or for half a step at `v`.
    fn follow(&mut self, impulse: &Impulse) {
        for ((place, at), state) in impulse.states.iter().zip(&mut self.z) {
            match at.by_state {
                // Friction that slips is held at its limit, whatever the variation.
                None => state.fill(0.0),
                // Friction that sticks follows the place.
                Some(0.0) => {
                    add(state, &self.x[*place], at.by_velocity);
                    add(state, &self.before[*place], -at.by_velocity);
                }
                Some(rate) => {
                    let decay = 0.5 * self.plan.h * rate;
                    let kept = libm::exp(decay);
                    state.iter_mut().for_each(|z| *z *= kept);
                    add(state, &self.v[*place], at.by_velocity * libm::expm1(decay) / rate);
                }
            }
        }
    }
}
