//! Structures with any elements: explicit steps between the switches of the elements.
//!
//! Each element is frozen on a [`Branch`], on which the equation of motion is smooth. A part of a step is one of the
//! method of order 8 of Dormand and Prince. Where one of the margins of the branches is negative at its end, it is made
//! anew with another length, until the margin is zero to rounding; there the elements whose margin is negative switch,
//! and the step goes on. Without this a switch inside a part would lower the order to 1 or 2.
//!
//! The armature of a shaker is part of the mass and the forces, and the current of its coil a state.
//!
//! A part turns the fastest motion by [`PHASE_RAD`]: ω² is that of the fastest mode, or of its faster decay where it is
//! overdamped, and of every element's stiffness over the mass that it meets, m⁻¹ = wᵀM⁻¹w, which is a bound since each
//! adds a matrix of rank one. A polynomial adds Σ |∂²V/∂xᵢ∂xⱼ|/√(mᵢ mⱼ), which bounds uᵀWHWᵀu for uᵀMu = 1, since
//! |wᵢᵀu| ≤ mᵢ^(−1/2). A shaker adds k and, by its coil, Bl²/L over the mass that it meets with its armature.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::error::StepError;
use super::locate::{Located, locate};
use super::{Engine, StateRef, StepLoad, check_coil, rows};
use crate::integrate::IntegrateError;
use crate::integrate::tableau::DOP853;
use crate::structure::armature::Armature;
use crate::structure::assembly::Assembly;
use crate::structure::body::Body;
use crate::structure::dof::Dof;
use crate::structure::element::{Branch, Element, Margin};
use crate::structure::limits::{MOST_COORDINATES, MOST_ELEMENTS};
use crate::structure::modes::{StructureMode, cholesky, solve_cholesky};
use crate::structure::polynomial::{MOST_ALL_DISPLACEMENTS, MOST_DISPLACEMENTS, Polynomial};
use crate::structure::position::Position;
use crate::structure::spec::Law;

/// The largest ωh of a part: the method then has a relative frequency error of 4e-11 and a damping ratio of 6e-12.
const PHASE_RAD: f64 = 0.4;
/// The largest decay rate times h of a part.
const DECAY: f64 = 1.0;
/// The largest decay rate of a coil's current times h of a part: a transient then errs by less than 1e-8 of itself.
const COIL_DECAY: f64 = 0.5;
/// The most parts of a step between two switches.
const MOST_PARTS: u32 = 256;
/// The most switches of a step that are located.
const MOST_EVENTS: u32 = 64;
/// The parts after a contact of Hunt and Crossley closes, where its force goes with the time to the power 1.5, start
/// with this share of their length, and double; before it opens they become as short.
const FIRST_SHARE: f64 = 1.0 / 64.0;

/// Lows of a margin up to this share of the change of its slope times the part are looked at: more than the cubic errs.
const DIP: f64 = 1e-3;

/// The state of a structure with elements.
#[derive(Clone, Copy, Debug)]
struct State {
    q: [f64; MOST_COORDINATES],
    v: [f64; MOST_COORDINATES],
    z: [f64; MOST_ELEMENTS],
    /// Current in the coil of a shaker, A.
    current_a: f64,
}

/// The rate of a state; that of q is v itself.
#[derive(Clone, Copy, Debug)]
struct Slope {
    acceleration: [f64; MOST_COORDINATES],
    z: [f64; MOST_ELEMENTS],
    current_a_s: f64,
}

/// State at which a part of a step starts.
#[derive(Clone, Copy, Debug)]
struct Start {
    state: State,
    slope: Slope,
    t_s: f64,
}

pub(super) type Branches = [Branch; MOST_ELEMENTS];

/// A structure with elements in motion.
#[derive(Clone, Debug)]
pub(super) struct Piecewise {
    pub(super) assembly: Assembly,
    step_s: f64,
    drive: Vec<Dof>,
    armature: Option<Armature>,
    /// ω², 1/s², and decay rate, 1/s, that the armature adds.
    armature_bounds: [f64; 2],
    /// ∂x/∂q of the drive and the elements of modes, n numbers each; of a chain they follow the motion.
    drive_rows: Vec<f64>,
    element_rows: Vec<f64>,
    /// The same of the displacements of the polynomials, one after the other.
    polynomial_rows: Vec<f64>,
    /// wᵀM⁻¹w of each element, and of each displacement of the polynomials, at rest.
    mobility: [f64; MOST_ELEMENTS],
    polynomial_mobility: [f64; MOST_ALL_DISPLACEMENTS],
    /// ω² of the fastest mode, 1/s².
    fastest_squared: f64,
    state: State,
    branches: Branches,
    events: u64,
    fallbacks: u64,
}

pub(super) fn engine(
    assembly: &Assembly,
    drive: &[Dof],
    armature: Option<&Armature>,
    rate_hz: f64,
) -> Result<Box<dyn Engine>, StepError> {
    let n = assembly.coordinates();
    let elements: Vec<Dof> = assembly.elements().iter().map(|element| element.at).collect();
    let mut element_rows = rows(assembly, &elements);
    let rest = [0.0; MOST_COORDINATES];
    let at = assembly.at(&rest[..n]);
    for (row, element) in element_rows.chunks_exact_mut(n).zip(assembly.elements()) {
        at.element_direction(element, row);
    }
    let displacements: Vec<Dof> = assembly.polynomials().iter().flat_map(Polynomial::at).copied().collect();
    let omega = assembly.modes().iter().map(StructureMode::fastest_rad_s).fold(0.0, f64::max);
    let mut stepped = Piecewise {
        assembly: assembly.clone(),
        step_s: 1.0 / rate_hz,
        drive: drive.to_vec(),
        armature: armature.copied(),
        armature_bounds: armature.map_or([0.0; 2], |armature| armature.bounds(assembly)),
        drive_rows: rows(assembly, drive),
        element_rows,
        polynomial_rows: rows(assembly, &displacements),
        mobility: [0.0; MOST_ELEMENTS],
        polynomial_mobility: [0.0; MOST_ALL_DISPLACEMENTS],
        fastest_squared: omega * omega,
        state: State { q: rest, v: rest, z: [0.0; MOST_ELEMENTS], current_a: 0.0 },
        branches: [Branch::Inner; MOST_ELEMENTS],
        events: 0,
        fallbacks: 0,
    };
    stepped.add_mobility();
    for (branch, element) in stepped.branches.iter_mut().zip(assembly.elements()) {
        *branch = element.law.branch(0.0, 0.0, 0.0);
    }
    if let Some(armature) = armature {
        check_coil(&armature.coil, f64::from(MOST_PARTS) * COIL_DECAY / stepped.step_s)?;
    }
    // A rate that is too low already at rest is refused now.
    stepped.parts(0.0, stepped.step_s, &stepped.state)?;
    Ok(Box::new(stepped))
}

impl Piecewise {
    fn add_mobility(&mut self) {
        let n = self.assembly.coordinates();
        let mut mass = self.assembly.linear().mass;
        // Positive definite: the modes were computed.
        let factored = cholesky(n, &mut mass).is_some();
        let mut solved = vec![0.0; n];
        let elements = self.mobility.iter_mut().zip(self.element_rows.chunks_exact(n));
        let polynomials = self.polynomial_mobility.iter_mut().zip(self.polynomial_rows.chunks_exact(n));
        for (mobility, row) in elements.chain(polynomials) {
            solved.copy_from_slice(row);
            solve_cholesky(n, &mass, &mut solved);
            *mobility = if factored { row.iter().zip(&solved).map(|(w, solved)| w * solved).sum() } else { f64::NAN };
        }
    }

    /// The structure at a state.
    fn at<'a>(&'a self, state: &'a State) -> Position<'a> {
        self.assembly.at(&state.q[..self.assembly.coordinates()])
    }

    /// x and v of an element at a state, where the structure is `at`.
    fn element_motion(&self, index: usize, element: &Element, at: &Position<'_>, state: &State) -> (f64, f64) {
        let n = self.assembly.coordinates();
        let q = &state.q[..n];
        let v = &state.v[..n];
        match self.assembly.body {
            Body::Modal(_) => {
                let row = &self.element_rows[index * n..(index + 1) * n];
                let dot = |of: &[f64]| row.iter().zip(of).map(|(w, of)| w * of).sum();
                (dot(q), dot(v))
            }
            Body::Chain(_) => (at.element_displacement(element), at.element_velocity(element, v)),
        }
    }

    /// x and v of the displacements of a polynomial, whose first is number `first` of all, at a state, where the
    /// structure is `at`.
    fn polynomial_motion(
        &self,
        (first, polynomial): (usize, &Polynomial),
        at: &Position<'_>,
        state: &State,
    ) -> [[f64; MOST_DISPLACEMENTS]; 2] {
        let [mut x, mut v] = [[0.0; MOST_DISPLACEMENTS]; 2];
        let n = self.assembly.coordinates();
        let q = &state.q[..n];
        let rates = &state.v[..n];
        for (k, dof) in polynomial.at().iter().enumerate() {
            (x[k], v[k]) = match self.assembly.body {
                Body::Modal(_) => {
                    let row = &self.polynomial_rows[(first + k) * n..(first + k + 1) * n];
                    let dot = |of: &[f64]| row.iter().zip(of).map(|(w, of)| w * of).sum();
                    (dot(q), dot(rates))
                }
                Body::Chain(_) => (at.displacement(*dof), at.velocity(*dof, rates)),
            };
        }
        [x, v]
    }

    /// The polynomials, each with the number of its first displacement among all.
    fn polynomials(&self) -> impl Iterator<Item = (usize, &Polynomial)> {
        self.assembly.polynomials().iter().scan(0, |first, polynomial| {
            let own = *first;
            *first += polynomial.at().len();
            Some((own, polynomial))
        })
    }

    /// ẍ and ż on the branches.
    fn slope(&self, state: &State, branches: &Branches, (load, t_s): (&StepLoad<'_>, f64)) -> Slope {
        let n = self.assembly.coordinates();
        let mut force = [0.0; MOST_COORDINATES];
        let mut z = [0.0; MOST_ELEMENTS];
        let mut row = [0.0; MOST_COORDINATES];
        let is_modal = matches!(self.assembly.body, Body::Modal(_));
        let at = self.at(state);
        let factor = load.factor(t_s);
        for (i, (dof, load)) in self.drive.iter().zip(load.numbers()).enumerate() {
            if !is_modal {
                at.direction(*dof, &mut row);
            }
            let row = if is_modal { &self.drive_rows[i * n..(i + 1) * n] } else { &row[..n] };
            force.iter_mut().zip(row).for_each(|(force, w)| *force += w * (factor * load));
        }
        for (i, element) in self.assembly.elements().iter().enumerate() {
            let (position, velocity) = self.element_motion(i, element, &at, state);
            let own = element.own(&state.z);
            let pull = element.law.reaction(branches[i], position, velocity, own).force;
            if let Some(state) = element.state {
                z[state] = element.law.state_rate(branches[i], velocity, own).rate;
            }
            // Elements that are open need no direction.
            if pull == 0.0 {
                continue;
            }
            if !is_modal {
                at.element_direction(element, &mut row);
            }
            let row = if is_modal { &self.element_rows[i * n..(i + 1) * n] } else { &row[..n] };
            force.iter_mut().zip(row).for_each(|(force, w)| *force -= w * pull);
        }
        for (first, polynomial) in self.polynomials() {
            let motion = self.polynomial_motion((first, polynomial), &at, state);
            let pulls = polynomial.forces_in(&motion[0]);
            for (k, (dof, pull)) in polynomial.at().iter().zip(pulls).enumerate() {
                if !is_modal {
                    at.direction(*dof, &mut row);
                }
                let row = if is_modal { &self.polynomial_rows[(first + k) * n..][..n] } else { &row[..n] };
                force.iter_mut().zip(row).for_each(|(force, w)| *force -= w * pull);
            }
        }
        let v = &state.v[..n];
        let mut acceleration = [0.0; MOST_COORDINATES];
        let mut added = None;
        let mut current_a_s = 0.0;
        if let Some(armature) = &self.armature {
            let blocked_n = factor * load.numbers().first().copied().unwrap_or(0.0);
            let push = armature.push(&at, v, state.current_a, blocked_n);
            armature.direction(&at, &mut row[..n]);
            force.iter_mut().zip(&row[..n]).for_each(|(force, w)| *force += w * push.force_n);
            added = Some((armature.mass_kg, &row[..n]));
            current_a_s = push.current_a_s;
        }
        at.accelerate_with(v, &force[..n], added, &mut acceleration[..n]);
        Slope { acceleration, z, current_a_s }
    }

    /// One step of the method.
    fn moved(&self, from: &Start, branches: &Branches, load: &StepLoad<'_>, h_s: f64) -> State {
        let Start { state: from, slope: first, t_s } = from;
        let n = self.assembly.coordinates();
        let m = self.assembly.element_states();
        let mut velocities = [from.v; DOP853.c.len()];
        let mut slopes = [*first; DOP853.c.len()];
        let combined = |weights: &[f64], velocities: &[[f64; MOST_COORDINATES]], slopes: &[Slope]| {
            let mut stage = *from;
            for ((weight, velocity), slope) in weights.iter().zip(velocities).zip(slopes) {
                if *weight == 0.0 {
                    continue;
                }
                let weight = h_s * weight;
                add(&mut stage.q[..n], weight, velocity);
                add(&mut stage.v[..n], weight, &slope.acceleration);
                add(&mut stage.z[..m], weight, &slope.z);
                stage.current_a += weight * slope.current_a_s;
            }
            stage
        };
        for i in 1..DOP853.c.len() {
            let stage = combined(&DOP853.a[i][..i], &velocities, &slopes);
            velocities[i] = stage.v;
            slopes[i] = self.slope(&stage, branches, (load, t_s + DOP853.c[i] * h_s));
        }
        combined(&DOP853.b, &velocities, &slopes)
    }

    fn start(&self, state: &State, load: &StepLoad<'_>, t_s: f64) -> Start {
        Start { state: *state, slope: self.slope(state, &self.branches, (load, t_s)), t_s }
    }

    /// The margins of an element.
    fn margins(&self, index: usize, element: &Element, at: &Position<'_>, state: &State) -> [Option<Margin>; 2] {
        let (position, velocity) = self.element_motion(index, element, at, state);
        element.law.margins(self.branches[index], position, velocity, element.own(&state.z))
    }

    /// The least of the margins; negative where an element has left its branch.
    fn margin(&self, state: &State) -> f64 {
        let at = self.at(state);
        let mut least = f64::INFINITY;
        for (i, element) in self.assembly.elements().iter().enumerate() {
            for margin in self.margins(i, element, &at, state).iter().flatten() {
                least = least.min(margin.value);
            }
        }
        least
    }

    /// Returns a time in a part of `h_s` at which a margin that is not negative at its ends may be: the first of the
    /// lows of the margins' cubics through both ends.
    fn dip_s(&self, start: &State, end: &State, h_s: f64) -> Option<f64> {
        let [at_start, at_end] = [start, end].map(|state| self.at(state));
        let mut first = None::<f64>;
        for (i, element) in self.assembly.elements().iter().enumerate() {
            let ends = [(&at_start, start), (&at_end, end)];
            let [margins, later] = ends.map(|(at, state)| self.margins(i, element, at, state));
            let margins = margins.into_iter().zip(later);
            for (start, end) in margins.filter_map(|(start, end)| Some((start?, end?))) {
                if let Some(at_s) = dip_s([start, end], h_s) {
                    first = Some(first.map_or(at_s, |first| first.min(at_s)));
                }
            }
        }
        first
    }

    /// Switches the elements that have left their branch; whether a contact of Hunt and Crossley closes.
    fn switch(&mut self, state: &mut State) -> bool {
        let mut rough = false;
        for i in 0..self.assembly.elements().len() {
            let element = self.assembly.elements()[i];
            let margins = self.margins(i, &element, &self.at(state), state);
            if let Some(Margin { to, .. }) = margins.into_iter().flatten().find(|margin| margin.value < 0.0) {
                self.branches[i] = to;
                self.events += 1;
                // Only such a contact starts with a force like t^1.5, which a method of order 8 follows in short
                // parts alone.
                rough |= to == Branch::Upper && matches!(element.law, Law::HuntCrossley { .. });
                if let Some(own) = element.state {
                    state.z[own] = element.law.state_on(to, state.z[own]);
                }
            }
        }
        rough
    }

    /// Whether a contact of Hunt and Crossley ends at a state.
    fn opens_roughly(&self, state: &State) -> bool {
        let at = self.at(state);
        let opens = |(i, element): (usize, &Element)| {
            let mut margins = self.margins(i, element, &at, state).into_iter().flatten();
            self.branches[i] == Branch::Upper && margins.any(|margin| margin.value < 0.0)
        };
        let elements = self.assembly.elements().iter().enumerate();
        elements.filter(|(_, element)| matches!(element.law, Law::HuntCrossley { .. })).any(opens)
    }

    /// Returns the number of parts in which the next `h_s` are made from a state.
    fn parts(&self, t_s: f64, h_s: f64, state: &State) -> Result<u32, StepError> {
        // Within a part an element may be pressed further, and be stiffer, than where the part starts.
        let reach_s = (PHASE_RAD / libm::sqrt(self.fastest_squared)).min(h_s);
        let [squared, decay] = self.armature_bounds;
        let at = self.at(state);
        let mut squared = self.fastest_squared + squared;
        let mut decay = decay;
        for (i, element) in self.assembly.elements().iter().enumerate() {
            let (position, velocity) = self.element_motion(i, element, &at, state);
            let [stiffness, damping, rate] = element.law.steepest(position, velocity, reach_s);
            // Each element adds a matrix of rank one to K, and so at most this to the largest ω² (H. Weyl's
            // inequality).
            squared += self.mobility[i] * stiffness;
            decay += self.mobility[i] * damping + rate;
        }
        for (first, polynomial) in self.polynomials() {
            let [mut reach, v] = self.polynomial_motion((first, polynomial), &at, state);
            let size = polynomial.at().len();
            let mut bound = [0.0; MOST_DISPLACEMENTS * MOST_DISPLACEMENTS];
            reach.iter_mut().zip(v).for_each(|(x, v)| *x = x.abs() + v.abs() * reach_s);
            polynomial.most_stiffness(&reach[..size], &mut bound);
            let mobility = &self.polynomial_mobility[first..first + size];
            for (pair, bound) in bound[..size * size].iter().enumerate() {
                squared += libm::sqrt(mobility[pair / size] * mobility[pair % size]) * bound;
            }
        }
        let coil = self.armature.and_then(|of| of.coil.rate_1_s()).map_or(0.0, |rate_1_s| rate_1_s / COIL_DECAY);
        let parts = libm::ceil(h_s * (libm::sqrt(squared) / PHASE_RAD).max(decay / DECAY).max(coil)).max(1.0);
        if parts <= f64::from(MOST_PARTS) {
            Ok(parts as u32)
        } else {
            let needed_hz = libm::ceil(parts / f64::from(MOST_PARTS) / self.step_s);
            Err(StepError::TooStiff { t_s, most: MOST_PARTS, needed_hz })
        }
    }

    /// One step; the number of switches beyond [`MOST_EVENTS`] makes it a fallback.
    fn whole_step(&mut self, t_s: f64, load: &StepLoad<'_>) -> Result<State, StepError> {
        let mut state = self.state;
        let mut done_s = 0.0;
        let mut share = 1.0;
        let first_event = self.events;
        // Every pass makes a part or switches, and both are bounded.
        loop {
            if self.margin(&state) < 0.0 {
                if self.switch(&mut state) {
                    share = FIRST_SHARE;
                }
                if self.events - first_event > u64::from(MOST_EVENTS) {
                    self.fallbacks += 1;
                    return self.unlocated(t_s, done_s, state, load);
                }
                continue;
            }
            let left_s = self.step_s - done_s;
            if left_s <= 0.0 {
                return Ok(state);
            }
            let part_s = left_s / f64::from(self.parts(t_s, left_s, &state)?);
            let h_s = share * part_s;
            // After a rough start the parts double until they are whole again.
            share = (2.0 * share).min(1.0);
            let start = self.start(&state, load, t_s + done_s);
            let trial = |h_s: f64| {
                let next = self.moved(&start, &self.branches, load, h_s);
                let margin = self.margin(&next);
                (next, margin)
            };
            let before = self.margin(&state);
            let mut located = locate(h_s, before, trial);
            // No margin is negative at the end, but one may have been in between: a short contact, or a short slip.
            if located.after_s == h_s
                && let Some(dip_s) = self.dip_s(&state, &located.state, h_s)
                && trial(dip_s).1 < 0.0
            {
                located = locate(dip_s, before, trial);
            }
            let Located { state: next, after_s } = located;
            if after_s < h_s && after_s > FIRST_SHARE * part_s && self.opens_roughly(&next) {
                // Towards the end of such a contact half of the way each time.
                state = self.moved(&start, &self.branches, load, 0.5 * after_s);
                done_s += 0.5 * after_s;
                continue;
            }
            // The last part ends with the step.
            done_s = if after_s == left_s { self.step_s } else { done_s + after_s };
            state = next;
            if !self.is_finite(&state) {
                return Err(IntegrateError::NotFinite { t_s: t_s + self.step_s }.into());
            }
        }
    }

    /// The rest of a step without looking for switches: each part on the branches that hold where it starts.
    fn unlocated(&mut self, t_s: f64, done_s: f64, mut state: State, load: &StepLoad<'_>) -> Result<State, StepError> {
        let left_s = self.step_s - done_s;
        let parts = self.parts(t_s, left_s, &state)?;
        let h_s = left_s / f64::from(parts);
        for part in 0..parts {
            self.set_branches(&mut state);
            let start = self.start(&state, load, t_s + done_s + f64::from(part) * h_s);
            state = self.moved(&start, &self.branches, load, h_s);
        }
        self.set_branches(&mut state);
        if self.is_finite(&state) {
            Ok(state)
        } else {
            Err(IntegrateError::NotFinite { t_s: t_s + self.step_s }.into())
        }
    }

    /// The branches on which a state is, with slipping friction at its limit.
    fn set_branches(&mut self, state: &mut State) {
        for i in 0..self.assembly.elements().len() {
            let element = self.assembly.elements()[i];
            let (position, velocity) = self.element_motion(i, &element, &self.at(state), state);
            self.branches[i] = element.law.branch(position, velocity, element.own(&state.z));
            if let Some(own) = element.state {
                state.z[own] = element.law.state_on(self.branches[i], state.z[own]);
            }
        }
    }

    fn armature_velocity_m_s(&self, armature: &Armature) -> f64 {
        let StateRef { q, v, .. } = self.state();
        armature.motion(&self.assembly.at(q), v).velocity_m_s
    }

    /// The current of a shaker's coil after a step under a command, where it is not a state.
    fn set_current(&mut self, load: &[f64]) {
        if let (Some(armature), [blocked_n, ..]) = (self.armature, load) {
            let velocity_m_s = self.armature_velocity_m_s(&armature);
            self.state.current_a = armature.coil.current_a(self.state.current_a, *blocked_n, velocity_m_s);
        }
    }

    fn is_finite(&self, state: &State) -> bool {
        let n = self.assembly.coordinates();
        let m = self.assembly.element_states();
        let numbers = state.q[..n].iter().chain(&state.v[..n]).chain(&state.z[..m]).chain([&state.current_a]);
        numbers.fold(true, |all, number| all & number.is_finite())
    }
}

/// sum += weight · of.
fn add(sum: &mut [f64], weight: f64, of: &[f64]) {
    sum.iter_mut().zip(of).for_each(|(sum, of)| *sum += weight * of);
}

/// Returns the time at which a margin that falls at the start and rises at the end of `h_s` is least, if that is not
/// clearly positive. With the share s of h, m from its ends and slopes d is the cubic of C. Hermite, whose slope is A
/// s² + B s + C,
///
/// ```text
/// A = 6 (m₀ − m₁) + 3h (d₀ + d₁)     B = −6 (m₀ − m₁) − 4h d₀ − 2h d₁     C = h d₀
/// ```
fn dip_s([start, end]: [Margin; 2], h_s: f64) -> Option<f64> {
    let fall = h_s * start.rate?;
    let rise = h_s * end.rate?;
    if !(fall < 0.0 && rise > 0.0) {
        return None;
    }
    let drop = start.value - end.value;
    let a = 6.0 * drop + 3.0 * (fall + rise);
    let b = -6.0 * drop - 4.0 * fall - 2.0 * rise;
    // Both roots without cancellation (q = −½ (B + sign(B) √(B² − 4AC)), then q/A and C/q).
    let larger = -0.5 * (b + libm::copysign(libm::sqrt((b * b - 4.0 * a * fall).max(0.0)), b));
    let at = [larger / a, fall / larger].into_iter().find(|at| *at > 0.0 && *at < 1.0)?;
    let back = 1.0 - at;
    let turn = at * (1.0 - at);
    let value = start.value * back * back * (1.0 + 2.0 * at) + end.value * at * at * (3.0 - 2.0 * at);
    let low = value + turn * (back * fall - at * rise);
    (low < DIP * (rise - fall)).then_some(at * h_s)
}

impl Engine for Piecewise {
    fn state(&self) -> StateRef<'_> {
        let n = self.assembly.coordinates();
        let m = self.assembly.element_states();
        let State { q, v, z, current_a } = &self.state;
        let coil = if self.armature.is_some() { core::slice::from_ref(current_a) } else { &[] };
        let branches = &self.branches[..self.assembly.elements().len()];
        StateRef { q: &q[..n], v: &v[..n], coil, z: &z[..m], branches }
    }

    fn set(&mut self, state: StateRef) {
        let StateRef { q, v, coil, z, branches } = state;
        self.state.current_a = coil.first().copied().unwrap_or(0.0);
        self.state.q[..q.len()].copy_from_slice(q);
        self.state.v[..v.len()].copy_from_slice(v);
        self.state.z[..z.len()].copy_from_slice(z);
        self.branches[..branches.len()].copy_from_slice(branches);
    }

    fn advance(&mut self, t_s: f64, load: &StepLoad<'_>) -> Result<(), StepError> {
        let branches = self.branches;
        let counters = [self.events, self.fallbacks];
        match self.whole_step(t_s, load) {
            Ok(state) => {
                self.state = state;
                self.set_current(load.numbers());
                Ok(())
            }
            Err(error) => {
                // The state was not touched yet; the branches were.
                self.branches = branches;
                [self.events, self.fallbacks] = counters;
                Err(error)
            }
        }
    }

    fn acceleration(&self, load: &[f64], current_a: Option<f64>, out: &mut [f64]) {
        let mut state = self.state;
        let mut blocked_n = [0.0];
        let load = match (current_a, &self.armature) {
            (Some(current_a), Some(armature)) => {
                state.current_a = current_a;
                blocked_n[0] = armature.coil.blocked_n(current_a, self.armature_velocity_m_s(armature));
                &blocked_n
            }
            _ => load,
        };
        let slope = self.slope(&state, &self.branches, (&StepLoad::Held(load), 0.0));
        out.iter_mut().zip(slope.acceleration).for_each(|(out, acceleration)| *out = acceleration);
    }

    fn counters(&self) -> [u64; 2] {
        [self.events, self.fallbacks]
    }

    fn boxed_clone(&self) -> Box<dyn Engine> {
        Box::new(self.clone())
    }
}
