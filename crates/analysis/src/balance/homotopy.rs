//! The way from a linear structure, whose response is known, to the structure itself.
//!
//! The element forces Q are raised from those of a linear structure, L, by their share s from 0 to 1:
//!
//! ```text
//! R(X, s) = 0 with the forces (1 − s) (L X + C Ẋ) + s Q(X)
//! ```
//!
//! At s = 0 the response is that of a linear structure: it exists, is unique, and solves R = 0 in one step. Unless the
//! responses in between grow without bound, the curve of solutions can neither return to s = 0 nor end, so that it
//! arrives at s = 1, through folds in s if need be (H. B. Keller, "Numerical Solution of Bifurcation and Nonlinear
//! Eigenvalue Problems", 1977; E. L. Allgower, K. Georg, "Numerical Continuation Methods", 1990, Ch. 11). That is proved
//! for smooth forces; with corners it usually works.
//!
//! L has the linear elements. Where that fails because a closed contact or stuck friction changes the structure too
//! much, L also has a stiffness of the order of that of those elements ([`StartStructure`]). C is a damper in proportion
//! to the mass: it keeps the linear response bounded if the structure is next to undamped, and goes to zero with L.

use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::structure::{Element, Law, Linear};

use super::{Balance, Body, Pair};
use crate::continuation::System;
use crate::forced::Component;
use crate::refusal::StartStructure;

/// Below this damping ratio a mode counts as undamped.
const UNDAMPED: f64 = 1e-3;
/// Damping ratio that the artificial damper gives a mode whose natural frequency is the drive's.
const ARTIFICIAL: f64 = 0.02;

/// The balance with the share s of the element forces as its coordinate.
pub(in super::super) struct Homotopy {
    balance: Balance,
    /// The forces of the linear structure. Those of modes and of the drive are in the balance's compliance, except for a
    /// chain.
    start: Linear,
    /// For a chain, the direction of the drive at rest.
    drive: Vec<f64>,
    /// C over the mass, 1/s.
    damper: f64,
    /// Damping ratios of the modes.
    damping_ratios: Vec<f64>,
}

/// Returns the stiffness and the damping with which an element belongs to the linear structure.
fn linear_part(element: &Element) -> [f64; 2] {
    match element.law {
        Law::Linear { stiffness, damping } => [stiffness, damping],
        Law::Lugre { viscous, .. } => [0.0, viscous],
        ref law if law.seat().is_some() => {
            let at_rest = element.force(0.0, 0.0, 0.0);
            [at_rest.by_position, at_rest.by_velocity]
        }
        _ => [0.0; 2],
    }
}

/// Returns the stiffness of an element that is closed or sticks: half of it for a contact, which is closed for about
/// half of the period; 0 if it is closed at rest. `deflection` is the size of the displacements.
fn closed_stiffness(law: &Law, deflection: f64) -> f64 {
    if law.seat().is_some() {
        return 0.0;
    }
    match *law {
        Law::Gap { stiffness, .. } | Law::Friction { stiffness, .. } => stiffness,
        Law::Lugre { bristle_stiffness, .. } => bristle_stiffness,
        Law::KelvinVoigt { stiffness, .. } => 0.5 * stiffness,
        // The slope of k δ^1.5 at this deflection, halved.
        Law::HuntCrossley { stiffness, .. } => 0.75 * stiffness * libm::sqrt(deflection),
        Law::Cubic { .. } | Law::Linear { .. } | Law::Tanh { .. } => 0.0,
    }
}

impl Homotopy {
    /// The way from a linear structure to that of a balance, whose coordinates are set; `None` if the structure has no
    /// element with the stiffness that this way begins with. `deflection` is the size of the displacements.
    pub fn new(balance: &Balance, from: StartStructure, deflection: f64) -> Option<Homotopy> {
        let balance = balance.clone();
        let m = balance.unknowns.count();
        let assembly = balance.forced.assembly();
        let share = match from {
            StartStructure::Linear => 0.0,
            StartStructure::Closed { share } => share,
        };
        let mut start = match balance.unknowns.body {
            Body::Chain => balance.linear.clone(),
            Body::Condensed(_) => {
                let zero = || vec![0.0; m * m];
                Linear { coordinates: m, mass: zero(), damping: zero(), stiffness: zero() }
            }
        };
        let mut any = false;
        for (e, element) in assembly.elements().iter().enumerate() {
            let added = share * closed_stiffness(&element.law, deflection);
            any |= added > 0.0;
            match &balance.unknowns.body {
                Body::Chain => {
                    let rest = vec![0.0; m];
                    let mut direction = vec![0.0; m];
                    assembly.at(&rest).element_direction(element, &mut direction);
                    for (pair, stiffness) in start.stiffness.iter_mut().enumerate() {
                        *stiffness += added * direction[pair / m] * direction[pair % m];
                    }
                }
                Body::Condensed(condensed) => {
                    let [stiffness, damping] = linear_part(element);
                    for (i, weight) in &condensed.of_element[e] {
                        for (j, other) in &condensed.of_element[e] {
                            start.stiffness[i * m + j] += weight * other * (stiffness + added);
                            start.damping[i * m + j] += weight * other * damping;
                        }
                    }
                }
            }
        }
        if share > 0.0 && !any {
            return None;
        }
        let (damping_ratios, least) = match &balance.unknowns.body {
            Body::Chain => {
                let ratios = assembly.modes().iter().map(|mode| mode.damping_ratio);
                (vec![], ratios.fold(f64::INFINITY, f64::min))
            }
            Body::Condensed(condensed) => {
                let ratios: Vec<f64> = condensed.modes.iter().map(|mode| mode[1]).collect();
                // The dampers between points add φᵀCφ to 2ζω.
                let by_elements = |mode: usize| -> f64 {
                    let of_pair = |(pair, damping): (usize, &f64)| {
                        damping * condensed.places[pair / m][mode] * condensed.places[pair % m][mode]
                    };
                    start.damping.iter().enumerate().map(of_pair).sum()
                };
                let all = condensed.modes.iter().enumerate().filter(|(_, [omega, _])| *omega > 0.0);
                let all = all.map(|(mode, [omega, zeta])| zeta + 0.5 * by_elements(mode) / omega);
                (ratios, all.fold(f64::INFINITY, f64::min))
            }
        };
        let damper = if least < UNDAMPED { 2.0 * ARTIFICIAL * balance.omega_rad_s() } else { 0.0 };
        if let Body::Chain = balance.unknowns.body {
            start.damping.iter_mut().zip(&start.mass).for_each(|(damping, mass)| *damping += damper * mass);
        }
        let drive = balance.forced.direction_at_rest();
        Some(Homotopy { balance, start, drive, damper, damping_ratios })
    }

    /// Gives every mode this share of the artificial damper.
    fn set_damper(&mut self, share: f64) {
        let damper = share * self.damper;
        if let Body::Condensed(condensed) = &mut self.balance.unknowns.body {
            let modes = condensed.modes.iter_mut().zip(&self.damping_ratios).filter(|([omega, _], _)| *omega > 0.0);
            // A damper c in proportion to the mass adds c/2ω to the damping ratio of each mode.
            modes.for_each(|([omega, zeta], own)| *zeta = own + 0.5 * damper / *omega);
        }
    }

    /// Returns the dynamic stiffness K − r²M and rD of a pair of unknowns at a rate r.
    fn at_rate(&self, rate: f64, pair: usize) -> [f64; 2] {
        [self.start.stiffness[pair] - rate * rate * self.start.mass[pair], rate * self.start.damping[pair]]
    }

    /// Returns the forces of the linear structure, as [`Balance`] has those of the elements. With x = c cos + s sin, the
    /// velocity of a harmonic is kω (s cos − c sin).
    fn start_load(&self, x: &[f64]) -> Vec<f64> {
        let balance = &self.balance;
        let mut load = vec![0.0; x.len()];
        let m = balance.unknowns.count();
        let omega = balance.omega_rad_s();
        for k in 0..=balance.harmonics {
            let rows = Pair::of(k, m);
            for i in 0..m {
                let mut sum = [0.0; 2];
                for j in 0..m {
                    let [c, s] = rows.at(x, j);
                    let [stiff, damp] = self.at_rate(k as f64 * omega, i * m + j);
                    sum[0] += stiff * c + damp * s;
                    sum[1] += stiff * s - damp * c;
                }
                rows.put(&mut load, i, sum);
            }
        }
        if let Body::Chain = balance.unknowns.body {
            for Component { order, parts } in balance.components() {
                let rows = Pair::of(order, m);
                for (i, along) in self.drive.iter().enumerate() {
                    let [c, s] = rows.at(&load, i);
                    let driven = parts.map(|part| balance.forced.amplitude * along * part);
                    rows.put(&mut load, i, [c - driven[0], s - driven[1]]);
                }
            }
        }
        load
    }

    /// Changes the balance's operator to that of the mixture of forces with the share s.
    fn mix_operator(&mut self, s: f64) {
        let m = self.balance.unknowns.count();
        let size = self.balance.load.len();
        let omega = self.balance.omega_rad_s();
        let mut operator = core::mem::take(&mut self.balance.operator);
        operator.iter_mut().for_each(|by| *by *= s);
        for k in 0..=self.balance.harmonics {
            let Pair { first, second } = Pair::of(k, m);
            for pair in 0..m * m {
                let i = pair / m;
                let j = pair % m;
                let [stiff, damp] = self.at_rate(k as f64 * omega, pair);
                let mut add = |row: usize, column: usize, by: f64| {
                    operator[(column + j) * size + row + i] += (1.0 - s) * by;
                };
                add(first, first, stiff);
                if let Some(second) = second {
                    add(first, second, damp);
                    add(second, first, -damp);
                    add(second, second, stiff);
                }
            }
        }
        self.balance.operator = operator;
    }

    /// Writes H Q − H_d p of these forces Q and the drive p, with the compliance H as it is set.
    fn respond(&mut self, load: Vec<f64>, amplitude: f64, out: &mut [f64]) {
        let rest = vec![0.0; load.len()];
        let own = core::mem::replace(&mut self.balance.forced.amplitude, amplitude);
        self.balance.load = load;
        self.balance.residual(&rest, out);
        self.balance.forced.amplitude = own;
    }
}

impl System for Homotopy {
    fn dimension(&self) -> usize {
        System::dimension(&self.balance)
    }

    fn evaluate(&mut self, x: &[f64], s: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let size = x.len();
        let amplitude = self.balance.forced.amplitude;
        self.balance.evaluate_orbit(x);
        self.balance.linearise();
        let start = self.start_load(x);
        let whole = self.balance.load.clone();
        let change: Vec<f64> = whole.iter().zip(&start).map(|(whole, start)| whole - start).collect();
        let mixed: Vec<f64> = start.iter().zip(&change).map(|(start, change)| start + s * change).collect();
        self.mix_operator(s);
        self.set_damper(1.0 - s);
        self.balance.set_compliances();
        self.balance.load.clone_from(&mixed);
        self.balance.residual(x, residual);
        self.balance.rows(matrix, size + 1);
        // Product rule: dR/ds = H (Q − L) + dH/ds (forces) − dH_d/ds p.
        let by_share = &mut matrix[size * (size + 1)..][..size];
        self.respond(change, 0.0, by_share);
        if let (Body::Condensed(condensed), true) = (&self.balance.unknowns.body, self.damper > 0.0) {
            let omega = self.balance.omega_rad_s();
            let mut compliances = core::mem::take(&mut self.balance.compliances);
            for (k, compliance) in compliances.iter_mut().enumerate() {
                condensed.compliance_by_damper(k as f64 * omega, -self.damper, compliance);
            }
            self.balance.compliances = compliances;
            let mut by_damper = vec![0.0; size];
            self.respond(mixed, amplitude, &mut by_damper);
            by_share.iter_mut().zip(by_damper).for_each(|(by, damper)| *by += damper);
        }
        // The load is that of the mixture, not of the response.
        self.balance.evaluated.is_known = false;
        s.is_finite()
    }
}
