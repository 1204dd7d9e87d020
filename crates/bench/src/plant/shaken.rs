//! A structure that a shaker drives, as the converters sample it.
//!
//! The motion is that of [`Stepper::shaken`](resonarm_dynamics::structure::Stepper::shaken). Where the amplifier holds
//! the voltage, the current over a step is a polynomial and a transient, by the motion at its ends
//! ([`Circuit`]), and so are force and accelerations, which are linear in the current.

use nalgebra::Vector2;
use thiserror::Error;

use super::assembly_steps::AssemblySteps;
use super::sampler::{CurrentChange, Sampler};
use super::sampling::{Course, Filter};
use super::tested::{Placed, TestedAssembly};
use super::{PlantSpec, PlantSpecError};
use crate::rig::{Amplifier, Load, ShakerSpec};
use crate::structure::StructureError;
use resonarm_dynamics::structure::{Armature, Circuit, Coil, LEAST_DECAY, Stroke};
use resonarm_numeric::number::short;

/// The share of a shaker's direction along which a structure may be fixed: rounding of its sine or cosine.
const ROUNDING: f64 = 1e-9;

/// A shaker pushes along an axis along which the structure does not move.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "rig.shaker: `direction_deg` is {direction_deg}, and the structure does not move along {axis} where the exciter is: turn it along \
     an axis that moves, or place it by `rig.exciter.at`", direction_deg = short(.direction_deg)
)]
pub struct ShakerAcross {
    /// The given direction, degrees.
    pub direction_deg: f64,
    /// The axis along which the structure does not move: x or y.
    pub axis: &'static str,
}

/// The structure with its shaker.
#[derive(Clone, Debug)]
pub(super) struct Shaken {
    pub steps: AssemblySteps,
    spec: ShakerSpec,
    /// The unit vector along which the shaker pushes.
    direction: Vector2<f64>,
    coil: Circuit,
    step_s: f64,
    /// The armature at the start and at the end of a step, where the sampler has the motion of the sensors.
    start: ArmatureMotion,
    end: ArmatureMotion,
}

/// The motion of the armature at an instant, and the current in its coil.
#[derive(Clone, Copy, Debug, Default)]
struct ArmatureMotion {
    displacement_m: f64,
    velocity_m_s: f64,
    acceleration_m_s2: f64,
    current_a: f64,
    /// How each ampere in the coil changes the acceleration, m/s²/A.
    acceleration_per_ampere: f64,
}

impl ArmatureMotion {
    /// Velocity, m/s, and acceleration with another current, m/s².
    fn at_current(&self, current_a: f64) -> (f64, f64) {
        let change_a = current_a - self.current_a;
        (self.velocity_m_s, self.acceleration_m_s2 + self.acceleration_per_ampere * change_a)
    }
}

impl ShakerSpec {
    /// Its armature on a structure, where an exciter is.
    ///
    /// # Errors
    /// [`ShakerAcross`] if it pushes along an axis along which the structure can't move there.
    pub fn armature_at(&self, at: &Placed) -> Result<Armature, ShakerAcross> {
        let shares: [f64; 2] = self.direction().into();
        if let Some(axis) = (0..2).find(|&axis| at.along[axis].is_none() && shares[axis].abs() > ROUNDING) {
            return Err(ShakerAcross { direction_deg: self.direction_deg, axis: ["x", "y"][axis] });
        }
        let along = core::array::from_fn(|axis| at.along[axis].map(|dof| (dof, shares[axis])));
        let force_factor_n_a = self.force_factor_n_a;
        let resistance_ohm = self.resistance_ohm;
        let coil = match self.amplifier {
            Amplifier::Current => Coil::Current { force_factor_n_a },
            Amplifier::Voltage => Coil::Voltage { force_factor_n_a, resistance_ohm, inductance_h: self.inductance_h },
        };
        let ShakerSpec { moving_mass_kg: mass_kg, stiffness_n_m, damping_n_s_m, .. } = *self;
        Ok(Armature { along, mass_kg, stiffness_n_m, damping_n_s_m, coil })
    }
}

/// The coil of a shaker, for steps of `step_s`.
///
/// # Errors
/// [`PlantSpecError::Inductance`] if the current changes too slowly for the closed form of a step.
fn coil_of(spec: &ShakerSpec, step_s: f64) -> Result<Circuit, PlantSpecError> {
    let most_h = spec.resistance_ohm * step_s / LEAST_DECAY;
    if spec.amplifier == Amplifier::Voltage && spec.inductance_h > most_h {
        return Err(PlantSpecError::Inductance { got_h: spec.inductance_h, most_h });
    }
    let force_factor_n_a = spec.force_factor_n_a;
    let resistance_ohm = spec.resistance_ohm;
    let decay = step_s * resistance_ohm / spec.inductance_h;
    Ok(Circuit { force_factor_n_a, resistance_ohm, decay })
}

impl Shaken {
    /// The structure of a valid specification at sample 0, in steps of `step_s`, s.
    pub fn new(
        spec: &PlantSpec,
        tested: &TestedAssembly,
        shaker: ShakerSpec,
        step_s: f64,
    ) -> Result<Shaken, PlantSpecError> {
        let coil = coil_of(&shaker, step_s)?;
        let start = ArmatureMotion::default();
        let end = ArmatureMotion::default();
        let steps = AssemblySteps::new(spec, tested)?;
        let direction = shaker.direction();
        Ok(Shaken { steps, spec: shaker, direction, coil, step_s, start, end })
    }

    /// How many times a transient of the current decays by e over a step: infinite unless the amplifier holds the
    /// voltage of a coil with inductance.
    pub fn decay(&self) -> f64 {
        match self.spec.amplifier {
            Amplifier::Current => f64::INFINITY,
            Amplifier::Voltage => self.coil.decay,
        }
    }

    /// The force of the blocked shaker under a load, N.
    fn blocked_n(&self, load: &Load) -> f64 {
        self.spec.along_n(load)
    }

    /// Makes the end of a step the start of the next.
    pub fn step_on(&mut self) {
        core::mem::swap(&mut self.start, &mut self.end);
    }

    /// Reads the armature and the motion of the sensors, and how a current changes them, as those at the end of a step.
    pub fn read(&mut self, load: &Load, sampler: &mut Sampler) {
        let (displacement_m, velocity_m_s, current_a) = self.steps.shaker_state(self.blocked_n(load));
        let end = &mut sampler.end;
        let per_ampere = &mut sampler.end_per_ampere;
        let more_m_s2 = self.steps.read_at_current(current_a + 1.0, end);
        per_ampere.iter_mut().zip(&*end).for_each(|(per_ampere, at)| *per_ampere = at.acceleration);
        let acceleration_m_s2 = self.steps.read_at_current(current_a, end);
        per_ampere.iter_mut().zip(&*end).for_each(|(per_ampere, at)| *per_ampere -= at.acceleration);
        let acceleration_per_ampere = more_m_s2 - acceleration_m_s2;
        self.end =
            ArmatureMotion { displacement_m, velocity_m_s, acceleration_m_s2, current_a, acceleration_per_ampere };
    }

    /// The force in the head along x and y, N, at the end of the step.
    pub fn head_n(&self) -> [f64; 2] {
        let at = &self.end;
        let ShakerSpec { moving_mass_kg: mass_kg, stiffness_n_m, damping_n_s_m, .. } = self.spec;
        let taken_n =
            mass_kg * at.acceleration_m_s2 + damping_n_s_m * at.velocity_m_s + stiffness_n_m * at.displacement_m;
        (self.direction * (self.spec.force_factor_n_a * at.current_a - taken_n)).into()
    }

    /// The force in the head along x and y over the step under a load, N, and how the current differs over it from
    /// that at which its ends were read.
    pub fn course(&self, filter: &Filter, load: &Load) -> ([Course; 2], CurrentChange) {
        let start = &self.start;
        let end = &self.end;
        let blocked_n = self.blocked_n(load);
        let mut currents_a = [start.current_a, end.current_a];
        let mut transient_a = 0.0;
        let force_n: Course = match self.spec.amplifier {
            Amplifier::Current => [blocked_n, 0.0, 0.0, 0.0, 0.0, 0.0],
            Amplifier::Voltage => {
                let stroke = Stroke {
                    velocity_m_s: [start.velocity_m_s, end.velocity_m_s],
                    change_m_s: [self.step_s * start.acceleration_m_s2, self.step_s * end.acceleration_m_s2],
                    mean_m_s: (end.displacement_m - start.displacement_m) / self.step_s,
                };
                let voltage_v = blocked_n / self.spec.force_factor_n_a * self.spec.resistance_ohm;
                let (steady_a, left_a) = self.coil.current(start.current_a, voltage_v, &stroke).terms();
                currents_a = [steady_a[0], steady_a.iter().sum()];
                transient_a = left_a;
                let [c0, c1, c2, c3, c4] = steady_a;
                [c0, c1, c2, c3, c4, left_a].map(|current_a| self.spec.force_factor_n_a * current_a)
            }
        };
        let ends = [start.at_current(currents_a[0]), end.at_current(currents_a[1])];
        let acceleration = filter.course(ends, start.acceleration_per_ampere * transient_a);
        let taken_n = self.taken_n(filter, acceleration);
        let head_n: Course = core::array::from_fn(|term| force_n[term] - taken_n[term]);
        let along = [self.direction.x, self.direction.y].map(|share| head_n.map(|term| share * term));
        let ends_a = [currents_a[0] - start.current_a, currents_a[1] - end.current_a];
        (along, CurrentChange { ends_a, transient_a })
    }

    /// What the armature takes of the coil's force over the step with the acceleration s̈, N: m s̈ + c ṡ + k s.
    fn taken_n(&self, filter: &Filter, acceleration: Course) -> Course {
        let ArmatureMotion { displacement_m, velocity_m_s, .. } = self.start;
        let velocity = filter.velocity(velocity_m_s, acceleration);
        let displacement = filter.displacement((displacement_m, velocity_m_s), acceleration);
        let ShakerSpec { moving_mass_kg: mass_kg, stiffness_n_m, damping_n_s_m, .. } = self.spec;
        core::array::from_fn(|term| {
            mass_kg * acceleration[term] + damping_n_s_m * velocity[term] + stiffness_n_m * displacement[term]
        })
    }

    /// Checks the amplifier's limits at the end of a hold.
    ///
    /// # Errors
    /// [`StructureError::Tripped`] if one is exceeded.
    pub fn check_limits(&self, load: &Load) -> Result<(), StructureError> {
        let (displacement_m, velocity_m_s, current_a) = self.steps.shaker_state(self.blocked_n(load));
        match self.spec.exceeded(current_a, (displacement_m, velocity_m_s)) {
            Some((limit, got, most)) => Err(StructureError::Tripped { limit, got, most }),
            None => Ok(()),
        }
    }
}
