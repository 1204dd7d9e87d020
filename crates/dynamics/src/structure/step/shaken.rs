//! Modes without elements that a shaker drives: the exact flow under a held command.
//!
//! Modes, armature and coil are one linear system under the command F. In the coordinates ωq, q̇ and √L i, whose
//! squares are energies, or q/h in place of ωq of a rigid mode, with ŵ = M⁻¹w = w/(1 + m wᵀw) and r = 2ζω q̇ + ω² q of each mode,
//!
//! ```text
//! (ωq)' = ω q̇        q̈ = −r + ŵ m wᵀr − ŵ (k wᵀq + c wᵀq̇ − f)        √L i' = −(R/√L) i − (Bl/√L) wᵀq̇ + (R/√L) F/Bl
//! ```
//!
//! with f = F, F − (Bl²/R) wᵀq̇, or (Bl/√L) √L i. A step multiplies by exp(Ah) and adds the integral of exp(Aτ) b F,
//! which is the last column of the exponential of A with the column b beside it and a row of zeros below. It is kept
//! less the identity, E = exp − 1, so that slow modes keep their digits in short steps: E of a 2⁻ˢ of the step by
//! Taylor's series, and s times E ← 2E + E².

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::error::StepError;
use super::{Engine, StateRef, StepLoad};
use crate::integrate::IntegrateError;
use crate::structure::armature::Armature;
use crate::structure::assembly::Assembly;
use crate::structure::limits::MOST_COORDINATES;
use crate::structure::modal::Modal;

/// Terms of the series: the next one is below 1e-17 of the sum.
const TERMS: u32 = 12;
/// The largest sum of the magnitudes of a row for the series.
const MOST_NORM: f64 = 0.25;
/// The most numbers of a state: q, q̇ and i.
const MOST_NUMBERS: usize = 2 * MOST_COORDINATES + 1;

/// Modes in motion with a shaker.
#[derive(Clone, Debug)]
struct Shaken {
    assembly: Assembly,
    armature: Armature,
    step_s: f64,
    /// Direction w of the armature, n numbers.
    direction: Vec<f64>,
    /// exp(Ah) − 1 in q, q̇ and i by rows, each with its factor of F at the end.
    flow: Vec<f64>,
    /// q, q̇ and, if it is a state, i.
    numbers: Vec<f64>,
    current_a: f64,
}

pub(super) fn engine(modal: &Modal, assembly: &Assembly, armature: &Armature, rate_hz: f64) -> Box<dyn Engine> {
    let n = assembly.coordinates();
    let mut direction = vec![0.0; n];
    armature.direction(&assembly.at(&[0.0; MOST_COORDINATES][..n]), &mut direction);
    let step_s = 1.0 / rate_hz;
    let flow = flow(modal, armature, &direction, step_s);
    let numbers = vec![0.0; 2 * n + usize::from(armature.coil.rate_1_s().is_some())];
    Box::new(Shaken {
        assembly: assembly.clone(),
        armature: *armature,
        step_s,
        direction,
        flow,
        numbers,
        current_a: 0.0,
    })
}

/// E by rows, each with its factor of F.
fn flow(modal: &Modal, armature: &Armature, w: &[f64], step_s: f64) -> Vec<f64> {
    let n = w.len();
    let coil = &armature.coil;
    let rate_1_s = coil.rate_1_s();
    let inductance_h = rate_1_s.map_or(0.0, |rate_1_s| coil.resistance_ohm() / rate_1_s);
    let states = 2 * n + usize::from(rate_1_s.is_some());
    let size = states + 1;
    let root = libm::sqrt(inductance_h);
    let square: f64 = w.iter().map(|w| w * w).sum();
    let lightness = 1.0 / (1.0 + armature.mass_kg * square);
    let damping_n_s_m = armature.damping_n_s_m + coil.drag_n_s_m();
    let force_factor_n_a = coil.force_factor_n_a();
    let per_position: Vec<f64> =
        modal.omega_rad_s.iter().map(|&omega| if omega > 0.0 { omega } else { 1.0 / step_s }).collect();
    let mut a = vec![0.0; size * size];
    for i in 0..n {
        let ratio = lightness * w[i];
        a[i * size + n + i] = per_position[i];
        let row = &mut a[(n + i) * size..(n + i + 1) * size];
        for j in 0..n {
            let omega = modal.omega_rad_s[j];
            let taken = armature.mass_kg * ratio * w[j] - f64::from(u8::from(i == j));
            row[j] = taken * omega - ratio * armature.stiffness_n_m * w[j] / per_position[j];
            row[n + j] = taken * 2.0 * modal.damping_ratio[j] * omega - ratio * damping_n_s_m * w[j];
        }
        match rate_1_s {
            None => row[states] = ratio,
            Some(_) => row[2 * n] = ratio * force_factor_n_a / root,
        }
    }
    if let Some(rate_1_s) = rate_1_s {
        let row = &mut a[2 * n * size..(2 * n + 1) * size];
        row[n..2 * n].iter_mut().zip(w).for_each(|(entry, w)| *entry = -force_factor_n_a / root * w);
        row[2 * n] = -rate_1_s;
        row[states] = rate_1_s * root / force_factor_n_a;
    }
    a.iter_mut().for_each(|entry| *entry *= step_s);
    let mut flow = exponential_less_one(size, a);
    // From ωq and √L i to q and i.
    let scale = |k: usize| {
        if k < n {
            per_position[k]
        } else if k == 2 * n && k < states {
            root
        } else {
            1.0
        }
    };
    flow.iter_mut().enumerate().for_each(|(k, entry)| *entry *= scale(k % size) / scale(k / size));
    flow.truncate(states * size);
    flow
}

/// exp(A) − 1 of a matrix by rows.
fn exponential_less_one(size: usize, mut a: Vec<f64>) -> Vec<f64> {
    let norm = a.chunks_exact(size).map(|row| row.iter().map(|entry| entry.abs()).sum::<f64>()).fold(0.0, f64::max);
    let mut halvings = 0;
    let mut share = 1.0;
    while norm * share > MOST_NORM {
        share *= 0.5;
        halvings += 1;
    }
    a.iter_mut().for_each(|entry| *entry *= share);
    // A (1 + A/2 (1 + A/3 (…))).
    let mut sum = a.iter().map(|entry| entry / f64::from(TERMS)).collect::<Vec<f64>>();
    for term in (1..TERMS).rev() {
        let inner = product(size, &a, &sum);
        let divisor = f64::from(term);
        sum.iter_mut().zip(&a).zip(inner).for_each(|((sum, a), inner)| *sum = (a + inner) / divisor);
    }
    for _ in 0..halvings {
        let square = product(size, &sum, &sum);
        sum.iter_mut().zip(square).for_each(|(sum, square)| *sum = 2.0 * *sum + square);
    }
    sum
}

fn product(size: usize, a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; size * size];
    for (row, of) in product.chunks_exact_mut(size).zip(a.chunks_exact(size)) {
        for (factor, other) in of.iter().zip(b.chunks_exact(size)) {
            row.iter_mut().zip(other).for_each(|(entry, other)| *entry += factor * other);
        }
    }
    product
}

impl Shaken {
    /// The coordinates q and their rates q̇.
    fn motion(&self) -> (&[f64], &[f64]) {
        self.numbers[..2 * self.direction.len()].split_at(self.direction.len())
    }
}

impl Engine for Shaken {
    fn state(&self) -> StateRef<'_> {
        let (q, v) = self.motion();
        StateRef { q, v, coil: core::slice::from_ref(&self.current_a), z: &[], branches: &[] }
    }

    fn set(&mut self, state: StateRef) {
        let StateRef { q, v, coil, .. } = state;
        let numbers = q.iter().chain(v).chain(coil);
        self.numbers.iter_mut().zip(numbers).for_each(|(number, of)| *number = *of);
        self.current_a = coil.first().copied().unwrap_or(0.0);
    }

    fn advance(&mut self, t_s: f64, load: &StepLoad<'_>) -> Result<(), StepError> {
        let blocked_n = load.numbers().first().copied().unwrap_or(0.0);
        let states = self.numbers.len();
        let mut next = [0.0; MOST_NUMBERS];
        let mut finite = true;
        for ((next, row), number) in next.iter_mut().zip(self.flow.chunks_exact(states + 1)).zip(&self.numbers) {
            // The change is summed first, and added to the number last, so that a small one keeps its digits.
            let change = row.iter().zip(&self.numbers).map(|(factor, number)| factor * number).sum::<f64>();
            *next = number + (change + row[states] * blocked_n);
            finite &= next.is_finite();
        }
        if !finite {
            return Err(IntegrateError::NotFinite { t_s: t_s + self.step_s }.into());
        }
        self.numbers.copy_from_slice(&next[..states]);
        let (q, v) = self.motion();
        let velocity_m_s = self.armature.motion(&self.assembly.at(q), v).velocity_m_s;
        let state_a = self.numbers.last().copied().unwrap_or(0.0);
        self.current_a = self.armature.coil.current_a(state_a, blocked_n, velocity_m_s);
        Ok(())
    }

    fn acceleration(&self, load: &[f64], current_a: Option<f64>, out: &mut [f64]) {
        let (q, v) = self.motion();
        let at = self.assembly.at(q);
        let motion = self.armature.motion(&at, v);
        let blocked_n = load.first().copied().unwrap_or(0.0);
        let coil = &self.armature.coil;
        let current_a = current_a.unwrap_or_else(|| coil.current_a(self.current_a, blocked_n, motion.velocity_m_s));
        let push_n = self.armature.push_n(coil.force_factor_n_a() * current_a, &motion);
        let mut force = [0.0; MOST_COORDINATES];
        force.iter_mut().zip(&self.direction).for_each(|(force, w)| *force = w * push_n);
        let added = Some((self.armature.mass_kg, &self.direction[..]));
        at.accelerate_with(v, &force[..q.len()], added, out);
    }

    fn boxed_clone(&self) -> Box<dyn Engine> {
        Box::new(self.clone())
    }
}
