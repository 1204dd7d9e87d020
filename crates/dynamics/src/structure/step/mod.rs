//! Structures in time: one step after the other under loads that are held over the step.
//!
//! What makes the step depends on the structure:
//!
//! - a chain, with smooth elements or none: the scheme that is asked for, by an
//!   [`Integrator`](crate::integrate::Integrator);
//! - modes without elements: exactly, by the flow of each mode, whatever the scheme;
//! - all others: explicit steps of order 8 between the switches of the elements, whatever the scheme; a switch is
//!   located to rounding and the step goes on behind it.
//!
//! With a shaker's [`Armature`], whose command is held, a chain is stepped by the scheme, too, and its coil in closed
//! form; modes without elements exactly, with the coil; all others by the explicit steps, with the coil's current as a
//! state. So is a chain under a coil whose current changes too slowly for the closed form of a step.

mod chains;
mod coil;
mod driver;
mod error;
mod exact;
mod lanes;
mod locate;
mod piecewise;
mod shaken;

pub use error::StepError;
pub use lanes::{STAGE_TIMES, SineSteps};

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;

use super::armature::{Armature, ArmatureMotion, Coil};
use super::assembly::Assembly;
use super::body::Body;
use super::dof::Dof;
use super::element::Branch;
use super::limits::{MOST_COORDINATES, MOST_ELEMENTS};
use super::position::Kinematics;
use crate::integrate::{IntegrateError, Scheme};
use driver::Driver;

/// Engine that makes the steps of a structure.
trait Engine: fmt::Debug + Send + Sync {
    /// State at the end of the last step.
    fn state(&self) -> StateRef<'_>;
    /// Takes up a state; the slices are of the right lengths.
    fn set(&mut self, state: StateRef);
    /// One step from the time `t_s`, s. After an error the state is as before.
    fn advance(&mut self, t_s: f64, load: &StepLoad<'_>) -> Result<(), StepError>;
    /// Writes q̈ at the state, with `current_a` in place of the current of a shaker's coil.
    fn acceleration(&self, load: &[f64], current_a: Option<f64>, out: &mut [f64]);
    /// Writes what degrees of freedom do at the state, as [`Engine::acceleration`] takes loads and current; `false` if it
    /// has no faster way than by the acceleration.
    fn read(&self, _load: &[f64], _current_a: Option<f64>, _dofs: &[Dof], _out: &mut [Kinematics]) -> bool {
        false
    }
    /// Takes each of some states, coordinates and rates, through the same steps, side by side; `false` if it can't, with
    /// the states as before.
    fn advance_together(&self, _steps: &SineSteps<'_>, _states: &mut [Vec<f64>]) -> bool {
        false
    }
    /// Switches so far, and steps whose switches were not all located.
    fn counters(&self) -> [u64; 2] {
        [0, 0]
    }
    /// A copy in the same state.
    fn boxed_clone(&self) -> Box<dyn Engine>;
}

impl Clone for Box<dyn Engine> {
    fn clone(&self) -> Box<dyn Engine> {
        self.boxed_clone()
    }
}

/// The most harmonics of a periodic load beside its fundamental.
pub const MOST_LOAD_HARMONICS: usize = 8;

/// A harmonic of a periodic load, ratio · sin(kΩt + phase) beside sin Ωt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadHarmonic {
    /// Order k, from 2.
    pub order: usize,
    /// Its amplitude over that of the fundamental.
    pub ratio: f64,
    /// Phase at the start of the period, rad.
    pub phase_rad: f64,
}

impl LoadHarmonic {
    /// sin φ + Σ ratio · sin(kφ + phase) of the fundamental and harmonics at the phase φ, rad.
    pub fn sum(phase_rad: f64, harmonics: &[LoadHarmonic]) -> f64 {
        let own = |of: &LoadHarmonic| of.ratio * libm::sin(of.order as f64 * phase_rad + of.phase_rad);
        libm::sin(phase_rad) + harmonics.iter().map(own).sum::<f64>()
    }
}

/// The loads over a step, one for each degree of freedom of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepLoad<'a> {
    /// The same over the step, N or N·m.
    Held(&'a [f64]),
    /// amplitude · sin(Ωt), exact inside the step.
    Sine {
        /// The peaks, N or N·m.
        amplitude: &'a [f64],
        /// Angular frequency Ω, rad/s.
        omega_rad_s: f64,
    },
    /// amplitude · (sin Ωt + Σ ratio · sin(kΩt + phase)), exact inside the step.
    Periodic {
        /// The amplitudes of the fundamental, N or N·m.
        amplitude: &'a [f64],
        /// Angular frequency Ω, rad/s.
        omega_rad_s: f64,
        /// Harmonics that all loads have, at most [`MOST_LOAD_HARMONICS`].
        harmonics: &'a [LoadHarmonic],
    },
}

impl StepLoad<'_> {
    /// Held loads, or peaks.
    const fn numbers(&self) -> &[f64] {
        match self {
            StepLoad::Held(numbers)
            | StepLoad::Sine { amplitude: numbers, .. }
            | StepLoad::Periodic { amplitude: numbers, .. } => numbers,
        }
    }

    /// Returns the factor by which the numbers are multiplied at a time.
    fn factor(&self, t_s: f64) -> f64 {
        match self {
            StepLoad::Held(_) => 1.0,
            StepLoad::Sine { omega_rad_s, .. } => libm::sin(omega_rad_s * t_s),
            StepLoad::Periodic { omega_rad_s, harmonics, .. } => LoadHarmonic::sum(omega_rad_s * t_s, harmonics),
        }
    }
}

/// A state: coordinates, rates, the current of a shaker's coil, states of elements, branches of elements.
#[derive(Clone, Copy, Debug)]
struct StateRef<'a> {
    q: &'a [f64],
    v: &'a [f64],
    /// One number, or none without a shaker.
    coil: &'a [f64],
    z: &'a [f64],
    branches: &'a [Branch],
}

/// A structure that is stepped. Nothing allocates after it is made; the same loads give the same bits.
#[derive(Clone, Debug)]
pub struct Stepper {
    assembly: Assembly,
    scheme: Scheme,
    step_s: f64,
    loads: usize,
    armature: Option<Armature>,
    engine: Box<dyn Engine>,
}

impl Stepper {
    /// A stepper at rest, for `rate_hz` steps a second, with loads along the degrees of freedom of `drive`: forces, N,
    /// and torques, N·m, in this order.
    ///
    /// # Errors
    /// [`IntegrateError::Rate`] if the rate is not a positive number, [`IntegrateError::RateTooLow`] with the lowest
    /// valid rate if the scheme needs a higher one, [`StepError::TooStiff`] if the explicit steps between switches do.
    pub fn new(assembly: &Assembly, drive: &[Dof], scheme: Scheme, rate_hz: f64) -> Result<Stepper, StepError> {
        let engine = match &assembly.body {
            _ if !(rate_hz.is_finite() && rate_hz > 0.0) => return Err(IntegrateError::Rate { got_hz: rate_hz }.into()),
            Body::Chain(chain) if assembly.is_smooth() => {
                chains::engine(chain, assembly, chains::Drive::Loads(drive), scheme, rate_hz)?
            }
            Body::Modal(modal) if !assembly.has_elements() => exact::engine(modal, assembly, drive, rate_hz),
            _ => piecewise::engine(assembly, drive, None, rate_hz)?,
        };
        let assembly = assembly.clone();
        let step_s = 1.0 / rate_hz;
        Ok(Stepper { assembly, scheme, step_s, loads: drive.len(), armature: None, engine })
    }

    /// A stepper at rest, for `rate_hz` steps a second, of a structure that a shaker alone drives: the load is the
    /// force that it would exert were it blocked, N. Of modes, and of chains with elements that switch, the steps are the
    /// same whatever the scheme.
    ///
    /// # Errors
    /// As [`Stepper::new`]; [`StepError::Coil`] if the explicit steps can't follow the current of the coil.
    pub fn shaken(
        assembly: &Assembly,
        armature: &Armature,
        scheme: Scheme,
        rate_hz: f64,
    ) -> Result<Stepper, StepError> {
        let driver = Driver::new(armature, 1.0 / rate_hz);
        let engine = match (&assembly.body, driver) {
            _ if !(rate_hz.is_finite() && rate_hz > 0.0) => return Err(IntegrateError::Rate { got_hz: rate_hz }.into()),
            (Body::Chain(chain), Some(driver)) if assembly.is_smooth() => {
                chains::engine(chain, assembly, chains::Drive::Shaker(driver), scheme, rate_hz)?
            }
            (Body::Modal(modal), _) if !assembly.has_elements() => shaken::engine(modal, assembly, armature, rate_hz),
            _ => piecewise::engine(assembly, &[], Some(armature), rate_hz)?,
        };
        let assembly = assembly.clone();
        let step_s = 1.0 / rate_hz;
        Ok(Stepper { assembly, scheme, step_s, loads: 1, armature: Some(*armature), engine })
    }

    /// The structure that is stepped.
    pub fn assembly(&self) -> &Assembly {
        &self.assembly
    }

    /// The scheme that was asked for.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// Length of a step, s.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The coordinates q, n numbers.
    pub fn position(&self) -> &[f64] {
        self.engine.state().q
    }

    /// Their rates q̇, n numbers.
    pub fn velocity(&self) -> &[f64] {
        self.engine.state().v
    }

    /// The states of the elements that have one.
    pub fn element_states(&self) -> &[f64] {
        self.engine.state().z
    }

    /// The current in the coil of the shaker at the end of the last step, A; `None` without a shaker.
    pub fn current_a(&self) -> Option<f64> {
        self.engine.state().coil.first().copied()
    }

    /// The motion of the shaker's armature; `None` without a shaker.
    pub fn armature_motion(&self) -> Option<ArmatureMotion> {
        let armature = self.armature.as_ref()?;
        Some(armature.motion(&self.assembly.at(self.position()), self.velocity()))
    }

    /// Returns how often an element switched its branch.
    pub fn events(&self) -> u64 {
        self.engine.counters()[0]
    }

    /// Returns how many steps met more switches than are located: the rest of such a step goes on in explicit steps
    /// with the branches that hold where each starts, so that its error is of first order.
    pub fn fallbacks(&self) -> u64 {
        self.engine.counters()[1]
    }

    /// One step from the time `t_s`, s, with the loads held.
    ///
    /// # Errors
    /// [`StepError::Loads`] if there is not one for each degree of freedom of the drive, or for the shaker;
    /// [`StepError::Integrate`] if an implicit scheme can't make the step; [`StepError::TooStiff`] if the elements,
    /// pressed this far or moved this fast, need shorter steps; [`IntegrateError::NotFinite`]. The state is then as before.
    pub fn advance(&mut self, t_s: f64, load: &[f64]) -> Result<(), StepError> {
        self.advance_under(t_s, &StepLoad::Held(load))
    }

    /// The same under loads that may vary over the step.
    ///
    /// # Errors
    /// As [`Stepper::advance`], [`StepError::NotHeld`] with a shaker, and [`StepError::Harmonics`].
    pub fn advance_under(&mut self, t_s: f64, load: &StepLoad<'_>) -> Result<(), StepError> {
        self.check_loads(load.numbers())?;
        if let StepLoad::Periodic { harmonics, .. } = load
            && harmonics.len() > MOST_LOAD_HARMONICS
        {
            return Err(StepError::Harmonics { got: harmonics.len(), most: MOST_LOAD_HARMONICS });
        }
        if self.armature.is_some() && !matches!(load, StepLoad::Held(_)) {
            return Err(StepError::NotHeld);
        }
        self.engine.advance(t_s, load)
    }

    /// Takes each of some states, coordinates and rates, through the same steps, side by side in the lanes of the
    /// processor. Each ends as [`Stepper::restore`] and [`Stepper::advance_under`] would take it, bit for bit; one that
    /// grows without bound ends in numbers that are not finite. The state of the stepper does not change.
    ///
    /// Chains of at most three links with smooth elements are stepped so by `dop853`. For all other structures the
    /// result is `false`, and the states are as before: the implicit schemes, the default among them, take a number of
    /// iterations that differs from motion to motion.
    ///
    /// # Errors
    /// [`StepError::Loads`] if there is not one amplitude for each degree of freedom of the drive.
    pub fn advance_together(&self, steps: &SineSteps<'_>, states: &mut [Vec<f64>]) -> Result<bool, StepError> {
        self.check_loads(steps.amplitude)?;
        Ok(self.engine.advance_together(steps, states))
    }

    /// Writes q̈ at the state under loads, n numbers.
    ///
    /// # Errors
    /// [`StepError::Loads`].
    pub fn acceleration(&self, load: &[f64], out: &mut [f64]) -> Result<(), StepError> {
        self.check_loads(load)?;
        self.engine.acceleration(load, None, out);
        Ok(())
    }

    /// Writes what degrees of freedom do at the state under loads, one after the other.
    ///
    /// # Errors
    /// [`StepError::Loads`].
    pub fn read(&self, load: &[f64], dofs: &[Dof], out: &mut [Kinematics]) -> Result<(), StepError> {
        self.check_loads(load)?;
        self.read_with(load, None, dofs, out);
        Ok(())
    }

    /// The same with a current in the coil of the shaker, A; without a shaker without a load.
    pub fn read_at_current(&self, current_a: f64, dofs: &[Dof], out: &mut [Kinematics]) {
        self.read_with(&[], Some(current_a), dofs, out);
    }

    fn read_with(&self, load: &[f64], current_a: Option<f64>, dofs: &[Dof], out: &mut [Kinematics]) {
        if self.engine.read(load, current_a, dofs, out) {
            return;
        }
        let mut acceleration = [0.0; MOST_COORDINATES];
        let v = self.velocity();
        let a = &mut acceleration[..v.len()];
        self.engine.acceleration(load, current_a, a);
        let at = self.assembly.at(self.position());
        out.iter_mut().zip(dofs).for_each(|(out, dof)| *out = at.kinematics(*dof, v, a));
    }

    fn check_loads(&self, load: &[f64]) -> Result<(), StepError> {
        if load.len() == self.loads { Ok(()) } else { Err(StepError::Loads { got: load.len(), expected: self.loads }) }
    }

    /// Returns the number of states: coordinates, rates, the current of a shaker's coil, states of elements.
    pub fn states(&self) -> usize {
        2 * self.assembly.coordinates() + self.engine.state().coil.len() + self.assembly.element_states()
    }

    /// Returns how many numbers [`Stepper::save`] writes: the states, and the branch of every element, 1, 0 or −1.
    pub fn saved_len(&self) -> usize {
        self.states() + self.engine.state().branches.len()
    }

    /// Writes all that the next step depends on.
    ///
    /// # Errors
    /// [`StepError::Saved`] if there is not room for [`Stepper::saved_len`] numbers.
    pub fn save(&self, saved: &mut [f64]) -> Result<(), StepError> {
        let StateRef { q, v, coil, z, branches } = self.engine.state();
        let numbers = [q, v, coil, z];
        if saved.len() != numbers.map(<[f64]>::len).iter().sum::<usize>() + branches.len() {
            return Err(self.not_saved(saved.len()));
        }
        let mut rest = saved;
        for part in numbers {
            let (own, after) = rest.split_at_mut(part.len());
            own.copy_from_slice(part);
            rest = after;
        }
        rest.iter_mut().zip(branches).for_each(|(code, branch)| {
            *code = match branch {
                Branch::Inner => 0.0,
                Branch::Upper => 1.0,
                Branch::Lower => -1.0,
            };
        });
        Ok(())
    }

    /// Takes up what [`Stepper::save`] wrote, or the states alone: the branches are then those on which the states are.
    ///
    /// # Errors
    /// [`StepError::Saved`] if the numbers are more or fewer, or one is not finite; nothing changes then.
    pub fn restore(&mut self, saved: &[f64]) -> Result<(), StepError> {
        let n = self.assembly.coordinates();
        let states = self.states();
        // A number that is not finite counts as the end, so that the message says where it is.
        let finite = saved.iter().position(|number| !number.is_finite()).unwrap_or(saved.len());
        if finite != saved.len() || (finite != states && finite != self.saved_len()) {
            return Err(self.not_saved(finite));
        }
        let (states, codes) = saved.split_at(states);
        let (q, rest) = states.split_at(n);
        let (v, rest) = rest.split_at(n);
        let (coil, z) = rest.split_at(self.engine.state().coil.len());
        let at = self.assembly.at(q);
        let mut branches = [Branch::Inner; MOST_ELEMENTS];
        for (i, (branch, element)) in branches.iter_mut().zip(self.assembly.elements()).enumerate() {
            *branch = match codes.get(i) {
                Some(0.0) => Branch::Inner,
                Some(code) if *code > 0.0 => Branch::Upper,
                Some(_) => Branch::Lower,
                None => element.law.branch(
                    at.element_displacement(element),
                    at.element_velocity(element, v),
                    element.own(z),
                ),
            };
        }
        let branches = &branches[..self.engine.state().branches.len()];
        self.engine.set(StateRef { q, v, coil, z, branches });
        Ok(())
    }

    fn not_saved(&self, got: usize) -> StepError {
        StepError::Saved { got, states: self.states(), all: self.saved_len() }
    }
}

/// ∂x/∂q at rest of every degree of freedom, n numbers each, one after the other: of modes those everywhere.
fn rows(assembly: &Assembly, dofs: &[Dof]) -> Vec<f64> {
    let n = assembly.coordinates();
    let rest = [0.0; MOST_COORDINATES];
    let mut rows = alloc::vec![0.0; n * dofs.len()];
    let at = assembly.at(&rest[..n]);
    for (row, dof) in rows.chunks_exact_mut(n).zip(dofs) {
        at.load_direction(*dof, row);
    }
    rows
}

/// Refuses a coil whose current decays faster than `most_1_s`, 1/s.
fn check_coil(coil: &Coil, most_1_s: f64) -> Result<(), StepError> {
    match *coil {
        Coil::Voltage { resistance_ohm, inductance_h: got_h, .. } if got_h > 0.0 => {
            let least_h = resistance_ohm / most_1_s;
            if got_h >= least_h { Ok(()) } else { Err(StepError::Coil { got_h, least_h }) }
        }
        _ => Ok(()),
    }
}
