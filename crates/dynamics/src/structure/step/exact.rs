//! Modes without elements: the exact flow of each under a held force.
//!
//! With σ = ζω, ω_d = ω √(1 − ζ²), e = exp(−σh), C and S the cosine and sine of ω_d h, and u = C + S σ/ω_d,
//!
//! ```text
//! q⁺ = e u q + e S/ω_d q̇ + (1 − e u)/ω² f        q̇⁺ = −e ω² S/ω_d q + e (C − S σ/ω_d) q̇ + e S/ω_d f
//! ```
//!
//! for q̈ + 2σ q̇ + ω² q = f. 1 − e u = (1 − e) + 2 e sin²(ω_d h/2) − e S σ/ω_d keeps its digits in short steps.
//!
//! A rigid mode, ω = 0, moves by h q̇ + h²/2 f. With ζ ≥ 1, s = ω √(ζ² − 1) and the decay rates a = ω²/b and b = σ + s,
//! e C, e S and e u are those of [`mode_transient`], and
//!
//! ```text
//! e (C − S σ/ω_d) = (b e^{−bh} − a e^{−ah})/2s        (1 − e u)/ω² = ((1 − e^{−ah})/a − (1 − e^{−bh})/b)/2s
//! ```
//!
//! Where 2sh is small these cancel. Then the left sides do not: the last is the series A(h) below with Ω = 0 of short steps.
//!
//! Under a sine f = p sin Ωt a step from t adds Im(p e^{iΩt} A) to q and Im(p e^{iΩt} Ȧ) to q̇, with the response
//! G(t) = exp(−σt) sin(ω_d t)/ω_d to an impulse and
//!
//! ```text
//! A(h) = ∫₀ʰ G(h − τ) e^{iΩτ} dτ        (A, Ȧ)(2k) = Φ(k) (A, Ȧ)(k) + e^{iΩk} (A, Ȧ)(k)
//! ```
//!
//! where Φ is the flow above. A short part k has a series: A = Σ Hⱼ kʲ⁺²/(j + 2)!, Ȧ = Σ Hⱼ kʲ⁺¹/(j + 1)!, with the
//! derivatives cⱼ = −2σ cⱼ₋₁ − ω² cⱼ₋₂ of Ġ at 0 and Hⱼ = cⱼ + iΩ Hⱼ₋₁. Nothing is divided by ω² − Ω² + 2iσΩ, so that
//! resonance, with damping or without, is as exact as the rest. A and Ȧ are kept as long as Ω is the same. The harmonics of
//! a periodic load are sines of their own.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;

use super::error::StepError;
use super::{Engine, LoadHarmonic, MOST_LOAD_HARMONICS, StateRef, StepLoad, rows};
use crate::integrate::IntegrateError;
use crate::structure::assembly::Assembly;
use crate::structure::dof::Dof;
use crate::structure::limits::MOST_MODES;
use crate::structure::modal::{Modal, Rates, mode_transient};

/// The constants of the flow of a mode.
#[derive(Clone, Copy, Debug)]
struct Flow {
    position: [f64; 3],
    velocity: [f64; 3],
    /// Stiffness ω², 1/s², and damping 2σ, 1/s.
    stiffness: f64,
    damping: f64,
}

/// Terms of the series: the next one is below 1e-20 of the sum.
const TERMS: u32 = 14;
/// The largest ωk, Ωk and σk of a part for the series.
const MOST_TURN: f64 = 0.25;
/// Most halvings of a step: from the longest finite step to such a part it takes fewer.
const MOST_HALVINGS: u32 = 2048;

/// A and Ȧ of the module's head.
type Driven = [Complex<f64>; 2];

impl Flow {
    fn new(omega_rad_s: f64, damping_ratio: f64, h_s: f64) -> Flow {
        if omega_rad_s == 0.0 {
            let position = [1.0, h_s, 0.5 * h_s * h_s];
            return Flow { position, velocity: [0.0, 1.0, h_s], stiffness: 0.0, damping: 0.0 };
        }
        if damping_ratio >= 1.0 {
            return Flow::overdamped(omega_rad_s, damping_ratio, h_s);
        }
        let sigma = damping_ratio * omega_rad_s;
        // (1 − ζ)(1 + ζ): no cancellation near ζ = 1.
        let damped = omega_rad_s * libm::sqrt((1.0 - damping_ratio) * (1.0 + damping_ratio));
        let decay = libm::exp(-sigma * h_s);
        let (sine, cosine) = libm::sincos(damped * h_s);
        let over = sine / damped;
        let half = libm::sin(0.5 * damped * h_s);
        let square = omega_rad_s * omega_rad_s;
        let held = -libm::expm1(-sigma * h_s) + decay * (2.0 * half * half - sigma * over);
        Flow {
            position: [decay * (cosine + sigma * over), decay * over, held / square],
            velocity: [-decay * square * over, decay * (cosine - sigma * over), decay * over],
            stiffness: square,
            damping: 2.0 * sigma,
        }
    }

    /// The flow of a mode with ζ ≥ 1, which does not oscillate.
    fn overdamped(omega_rad_s: f64, damping_ratio: f64, h_s: f64) -> Flow {
        let sigma = damping_ratio * omega_rad_s;
        let square = omega_rad_s * omega_rad_s;
        let [c, s] = mode_transient(omega_rad_s, damping_ratio, h_s);
        let rates = Rates::new(omega_rad_s, damping_ratio);
        let slow = rates.slow;
        let fast = rates.fast();
        let gap = 2.0 * rates.half_gap;
        // Where 2sh is small, the quotients of the module's head cancel, and its left sides are taken. The last of
        // them cancels itself in steps that are short against all rates: there it is the series.
        let (back, held) = if gap * h_s > MOST_TURN {
            let back = (fast * libm::exp(-fast * h_s) - slow * libm::exp(-slow * h_s)) / gap;
            (back, (libm::expm1(-fast * h_s) / fast - libm::expm1(-slow * h_s) / slow) / gap)
        } else if sigma * h_s > MOST_TURN {
            (c - sigma * s, (1.0 - c - sigma * s) / square)
        } else {
            (c - sigma * s, Flow::series(omega_rad_s, damping_ratio, 0.0, h_s)[0].re)
        };
        Flow {
            position: [c + sigma * s, s, held],
            velocity: [-square * s, back, s],
            stiffness: square,
            damping: 2.0 * sigma,
        }
    }

    /// A and Ȧ of a step under e^{iΩt}, Ω being `drive_rad_s`.
    fn driven(omega_rad_s: f64, damping_ratio: f64, drive_rad_s: f64, h_s: f64) -> Driven {
        let mut part_s = h_s;
        let mut halvings = 0;
        // Of an overdamped mode the damping is the fastest.
        let fastest = omega_rad_s.max(drive_rad_s.abs()).max(damping_ratio * omega_rad_s);
        while fastest * part_s > MOST_TURN && halvings < MOST_HALVINGS {
            part_s *= 0.5;
            halvings += 1;
        }
        let mut sum = Flow::series(omega_rad_s, damping_ratio, drive_rad_s, part_s);
        for _ in 0..halvings {
            let Flow { position: [a, b, _], velocity: [d, e, _], .. } = Flow::new(omega_rad_s, damping_ratio, part_s);
            let (sine, cosine) = libm::sincos(drive_rad_s * part_s);
            let turn = Complex::new(cosine, sine);
            let [q, v] = sum;
            sum = [q * turn + (q * a + v * b), v * turn + (q * d + v * e)];
            part_s *= 2.0;
        }
        sum
    }

    /// The same by the series, of a short part of a step.
    fn series(omega_rad_s: f64, damping_ratio: f64, drive_rad_s: f64, part_s: f64) -> Driven {
        let turn = omega_rad_s * part_s;
        let damping = 2.0 * damping_ratio * turn;
        let stiffness = turn * turn;
        let drive = Complex::new(0.0, drive_rad_s * part_s);
        // cⱼ kʲ, that before it, and Hⱼ kʲ.
        let mut own = 1.0;
        let mut before = 0.0;
        let mut both = Complex::new(1.0, 0.0);
        let mut factorial = 1.0;
        let mut sum = [Complex::new(0.0, 0.0); 2];
        for term in 0..TERMS {
            factorial /= f64::from(term + 1);
            sum = [sum[0] + both * (factorial / f64::from(term + 2)), sum[1] + both * factorial];
            (own, before) = (-damping * own - stiffness * before, own);
            both = drive * both + own;
        }
        [sum[0] * (part_s * part_s), sum[1] * part_s]
    }
}

/// Modes in motion, with their flows over a step.
#[derive(Clone, Debug)]
struct Exact {
    step_s: f64,
    /// ω, rad/s, and ζ.
    modes: Vec<(f64, f64)>,
    flows: Vec<Flow>,
    /// The last sines: the fundamental and harmonics.
    driven: Vec<DrivenModes>,
    /// The shapes of the drive, n numbers a load.
    drive: Vec<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
}

/// A and Ȧ of each mode under a sine of frequency Ω, rad/s; not a number before the first.
#[derive(Clone, Debug)]
struct DrivenModes {
    rad_s: f64,
    modes: Vec<Driven>,
}

pub(super) fn engine(modal: &Modal, assembly: &Assembly, drive: &[Dof], rate_hz: f64) -> Box<dyn Engine> {
    let step_s = 1.0 / rate_hz;
    let modes: Vec<(f64, f64)> =
        modal.omega_rad_s.iter().zip(&modal.damping_ratio).map(|(&omega, &zeta)| (omega, zeta)).collect();
    let flows: Vec<Flow> = modes.iter().map(|&(omega, zeta)| Flow::new(omega, zeta, step_s)).collect();
    let rest = vec![0.0; flows.len()];
    let none = DrivenModes { rad_s: f64::NAN, modes: vec![Driven::default(); flows.len()] };
    let driven = vec![none; 1 + MOST_LOAD_HARMONICS];
    let q = rest.clone();
    let v = rest;
    Box::new(Exact { step_s, modes, flows, driven, drive: rows(assembly, drive), q, v })
}

impl Exact {
    /// Computes what sines add to the position and the rate of each mode in a step from a time: sin Ωt with these peaks
    /// of the forces, and its harmonics.
    fn sines(
        &mut self,
        peaks: &[f64; MOST_MODES],
        (omega_rad_s, harmonics): (f64, &[LoadHarmonic]),
        t_s: f64,
    ) -> [[f64; 2]; MOST_MODES] {
        let mut added = [[0.0; 2]; MOST_MODES];
        let fundamental = LoadHarmonic { order: 1, ratio: 1.0, phase_rad: 0.0 };
        let all = core::iter::once(&fundamental).chain(harmonics);
        for (of, LoadHarmonic { order, ratio, phase_rad }) in self.driven.iter_mut().zip(all) {
            let rad_s = *order as f64 * omega_rad_s;
            // The NaN before the first sine is unequal to every Ω.
            if of.rad_s != rad_s {
                for (driven, &(omega, zeta)) in of.modes.iter_mut().zip(&self.modes) {
                    *driven = Flow::driven(omega, zeta, rad_s, self.step_s);
                }
                of.rad_s = rad_s;
            }
            let (sine, cosine) = libm::sincos(rad_s * t_s + phase_rad);
            for ((added, driven), peak) in added.iter_mut().zip(&of.modes).zip(peaks) {
                // Im(p e^{iΩt} A) = p (Re A sin Ωt + Im A cos Ωt).
                for (added, driven) in added.iter_mut().zip(driven) {
                    *added += ratio * peak * (driven.re * sine + driven.im * cosine);
                }
            }
        }
        added
    }

    /// One step, with what the forces add to the position and the rate of a mode.
    fn step(&mut self, t_s: f64, added: impl Fn(usize, &Flow) -> [f64; 2]) -> Result<(), StepError> {
        let n = self.flows.len();
        // Into copies: after an error the state is as before.
        let [mut q, mut v] = [[0.0; MOST_MODES]; 2];
        let mut finite = true;
        for (i, flow) in self.flows.iter().enumerate() {
            let x = self.q[i];
            let rate = self.v[i];
            let [moved, pushed] = added(i, flow);
            let Flow { position: [a, b, _], velocity: [d, e, _], .. } = *flow;
            q[i] = a * x + b * rate + moved;
            v[i] = d * x + e * rate + pushed;
            finite &= q[i].is_finite() & v[i].is_finite();
        }
        if !finite {
            return Err(IntegrateError::NotFinite { t_s: t_s + self.step_s }.into());
        }
        self.q.copy_from_slice(&q[..n]);
        self.v.copy_from_slice(&v[..n]);
        Ok(())
    }

    /// Φᵀf of every mode.
    fn forces(&self, load: &[f64]) -> [f64; MOST_MODES] {
        let mut forces = [0.0; MOST_MODES];
        for (shape, load) in self.drive.chunks_exact(self.flows.len()).zip(load) {
            forces.iter_mut().zip(shape).for_each(|(force, shape)| *force += shape * load);
        }
        forces
    }
}

impl Engine for Exact {
    fn state(&self) -> StateRef<'_> {
        StateRef { q: &self.q, v: &self.v, coil: &[], z: &[], branches: &[] }
    }

    fn set(&mut self, state: StateRef) {
        self.q.copy_from_slice(state.q);
        self.v.copy_from_slice(state.v);
    }

    fn advance(&mut self, t_s: f64, load: &StepLoad<'_>) -> Result<(), StepError> {
        match *load {
            StepLoad::Held(load) => {
                let forces = self.forces(load);
                self.step(t_s, |i, flow| [flow.position[2] * forces[i], flow.velocity[2] * forces[i]])
            }
            StepLoad::Sine { amplitude, omega_rad_s } => {
                let added = self.sines(&self.forces(amplitude), (omega_rad_s, &[]), t_s);
                self.step(t_s, |i, _| added[i])
            }
            StepLoad::Periodic { amplitude, omega_rad_s, harmonics } => {
                let added = self.sines(&self.forces(amplitude), (omega_rad_s, harmonics), t_s);
                self.step(t_s, |i, _| added[i])
            }
        }
    }

    fn acceleration(&self, load: &[f64], _current_a: Option<f64>, out: &mut [f64]) {
        let forces = self.forces(load);
        for (i, (flow, out)) in self.flows.iter().zip(out).enumerate() {
            *out = forces[i] - flow.damping * self.v[i] - flow.stiffness * self.q[i];
        }
    }

    fn boxed_clone(&self) -> Box<dyn Engine> {
        Box::new(self.clone())
    }
}
