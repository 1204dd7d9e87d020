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
//! Under a sine f = p sin Ωt the motion is that flow without a force, of the difference from the forced vibration
//! q = Im(Q e^{iΩt}), Q = p/(ω² − Ω² + 2iσΩ); without damping that grows at resonance, where no step can be made.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::{Engine, StateRef, StepError, StepLoad, rows};
use crate::structure::MOST_MODES;
use crate::structure::assembly::Assembly;
use crate::structure::dof::Dof;
use crate::structure::modal::Modal;

/// The constants of the flow of a mode.
#[derive(Clone, Copy, Debug)]
struct Flow {
    position: [f64; 3],
    velocity: [f64; 3],
    /// ω², 2σ.
    stiffness: f64,
    damping: f64,
}

/// The forced vibration of each mode at an instant.
struct Forced {
    q: [f64; MOST_MODES],
    v: [f64; MOST_MODES],
}

impl Flow {
    fn new(omega_rad_s: f64, damping_ratio: f64, h_s: f64) -> Flow {
        let sigma = damping_ratio * omega_rad_s;
        // (1 − ζ)(1 + ζ): no cancellation near ζ = 1.
        let damped = omega_rad_s * libm::sqrt((1.0 - damping_ratio) * (1.0 + damping_ratio));
        let decay = libm::exp(-sigma * h_s);
        let (sine, cosine) = libm::sincos(damped * h_s);
        let (over, half) = (sine / damped, libm::sin(0.5 * damped * h_s));
        let square = omega_rad_s * omega_rad_s;
        let held = -libm::expm1(-sigma * h_s) + decay * (2.0 * half * half - sigma * over);
        Flow {
            position: [decay * (cosine + sigma * over), decay * over, held / square],
            velocity: [-decay * square * over, decay * (cosine - sigma * over), decay * over],
            stiffness: square,
            damping: 2.0 * sigma,
        }
    }
}

/// Modes in motion.
#[derive(Clone, Debug)]
struct Exact {
    step_s: f64,
    flows: Vec<Flow>,
    /// The shapes of the drive, n numbers a load.
    drive: Vec<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
}

pub(super) fn engine(modal: &Modal, assembly: &Assembly, drive: &[Dof], rate_hz: f64) -> Box<dyn Engine> {
    let step_s = 1.0 / rate_hz;
    let modes = modal.omega_rad_s.iter().zip(&modal.damping_ratio);
    let flows: Vec<Flow> = modes.map(|(&omega, &zeta)| Flow::new(omega, zeta, step_s)).collect();
    let rest = vec![0.0; flows.len()];
    Box::new(Exact { step_s, flows, drive: rows(assembly, drive), q: rest.clone(), v: rest })
}

impl Exact {
    /// The forced vibration under the peaks of the forces at a time.
    fn forced(&self, peaks: &[f64; MOST_MODES], omega_rad_s: f64, t_s: f64) -> Forced {
        let mut forced = Forced { q: [0.0; MOST_MODES], v: [0.0; MOST_MODES] };
        let (sine, cosine) = libm::sincos(omega_rad_s * t_s);
        for (i, flow) in self.flows.iter().enumerate() {
            let (real, imaginary) = (flow.stiffness - omega_rad_s * omega_rad_s, flow.damping * omega_rad_s);
            let scale = peaks[i] / (real * real + imaginary * imaginary);
            forced.q[i] = scale * (real * sine - imaginary * cosine);
            forced.v[i] = scale * omega_rad_s * (real * cosine + imaginary * sine);
        }
        forced
    }

    /// Adds `sign` times a motion.
    fn shift(&mut self, sign: f64, by: &Forced) {
        self.q.iter_mut().zip(by.q).for_each(|(q, by)| *q += sign * by);
        self.v.iter_mut().zip(by.v).for_each(|(v, by)| *v += sign * by);
    }

    /// One step under held forces.
    fn flow(&mut self, t_s: f64, forces: &[f64; MOST_MODES]) -> Result<(), StepError> {
        let n = self.flows.len();
        let [mut q, mut v] = [[0.0; MOST_MODES]; 2];
        let mut finite = true;
        for (i, flow) in self.flows.iter().enumerate() {
            let (x, rate, force) = (self.q[i], self.v[i], forces[i]);
            let Flow { position: [a, b, c], velocity: [d, e, f], .. } = *flow;
            (q[i], v[i]) = (a * x + b * rate + c * force, d * x + e * rate + f * force);
            finite &= q[i].is_finite() & v[i].is_finite();
        }
        if !finite {
            return Err(StepError::NotFinite { t_s: t_s + self.step_s });
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
            StepLoad::Held(load) => self.flow(t_s, &self.forces(load)),
            StepLoad::Sine { amplitude, omega_rad_s } => {
                let (forces, before) = (self.forces(amplitude), [self.q.clone(), self.v.clone()]);
                self.shift(-1.0, &self.forced(&forces, omega_rad_s, t_s));
                let made = self.flow(t_s, &[0.0; MOST_MODES]);
                self.shift(1.0, &self.forced(&forces, omega_rad_s, t_s + self.step_s));
                let finite = self.q.iter().chain(&self.v).all(|number| number.is_finite());
                if made.is_err() || !finite {
                    [self.q, self.v] = before;
                    return Err(StepError::NotFinite { t_s: t_s + self.step_s });
                }
                Ok(())
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
