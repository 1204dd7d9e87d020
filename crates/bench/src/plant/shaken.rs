//! A structure that a shaker drives, as the converters sample it.
//!
//! The motion is that of [`Stepper::shaken`](resonarm_dynamics::structure::Stepper::shaken). Where the amplifier holds
//! the voltage, the current over a step is a polynomial and a transient, by the motion at its ends
//! ([`Circuit`]), and so are force and accelerations, which are linear in the current.

use nalgebra::Vector2;
use thiserror::Error;

use super::assembly_steps::AssemblySteps;
use super::other_sensors::{CurrentChange, OtherSensors};
use super::sampling::{Course, Filter, PointMotion, ShakenStep, Sums};
use super::stepped::Stepped;
use super::tested::{Placed, TestedAssembly};
use super::{PlantSpec, PlantSpecError};
use crate::rig::{Amplifier, Load, Measurement, ShakerSpec};
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
    coil: Circuit,
    step_s: f64,
}

/// The motion of a structure and of the armature on it at an instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShakenMotion {
    points: PointMotion,
    /// s, m; ṡ, m/s; s̈, m/s².
    armature: [f64; 3],
    /// In the coil, A.
    current_a: f64,
    /// Accelerations of B, C, and along the armature by each ampere in the coil, m/s²/A.
    per_ampere: ([Vector2<f64>; 2], f64),
}

impl ShakenMotion {
    /// The points with another current.
    fn points_at(&self, current_a: f64) -> PointMotion {
        let (change_a, mut points) = (current_a - self.current_a, self.points);
        points.acceleration_m_s2.iter_mut().zip(&self.per_ampere.0).for_each(|(point, by)| *point += by * change_a);
        points
    }

    /// ṡ, m/s, and s̈ with another current, m/s².
    fn armature_at(&self, current_a: f64) -> (f64, f64) {
        let [_, velocity_m_s, acceleration_m_s2] = self.armature;
        (velocity_m_s, acceleration_m_s2 + self.per_ampere.1 * (current_a - self.current_a))
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
        let (force_factor_n_a, resistance_ohm) = (self.force_factor_n_a, self.resistance_ohm);
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
    let (force_factor_n_a, resistance_ohm) = (spec.force_factor_n_a, spec.resistance_ohm);
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
        Ok(Shaken { steps: AssemblySteps::new(spec, tested)?, spec: shaker, coil, step_s })
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

    /// The motion under a load.
    fn motion(&self, load: &Load) -> ShakenMotion {
        let (displacement_m, velocity_m_s, current_a) = self.steps.shaker_state(self.blocked_n(load));
        let (points, acceleration_m_s2) = self.steps.motion_at_current(current_a);
        let (more, along_more_m_s2) = self.steps.motion_at_current(current_a + 1.0);
        let per_point = |point: usize| more.acceleration_m_s2[point] - points.acceleration_m_s2[point];
        ShakenMotion {
            points,
            armature: [displacement_m, velocity_m_s, acceleration_m_s2],
            current_a,
            per_ampere: (core::array::from_fn(per_point), along_more_m_s2 - acceleration_m_s2),
        }
    }

    /// Force in the head, N, and accelerations of B and C, m/s², along x and y, under a load.
    pub fn instant(&self, load: &Load) -> [f64; Measurement::CHANNELS] {
        let at = self.motion(load);
        let ShakerSpec { moving_mass_kg: mass_kg, stiffness_n_m, damping_n_s_m, .. } = self.spec;
        let [displacement_m, velocity_m_s, acceleration_m_s2] = at.armature;
        let taken_n = mass_kg * acceleration_m_s2 + damping_n_s_m * velocity_m_s + stiffness_n_m * displacement_m;
        let head_n = self.spec.direction() * (self.spec.force_factor_n_a * at.current_a - taken_n);
        let [b, c] = at.points.acceleration_m_s2;
        [head_n.x, head_n.y, b.x, b.y, c.x, c.y]
    }

    /// A step between the motions at its ends, under a load.
    fn step(&self, [start, end]: [&ShakenMotion; 2], load: &Load) -> ShakenStep {
        let blocked_n = self.blocked_n(load);
        let (mut currents_a, mut transient_a) = ([start.current_a, end.current_a], 0.0);
        let force_n: Course = match self.spec.amplifier {
            Amplifier::Current => [blocked_n, 0.0, 0.0, 0.0, 0.0, 0.0],
            Amplifier::Voltage => {
                let ([s0, v0, a0], [s1, v1, a1]) = (start.armature, end.armature);
                let stroke = Stroke {
                    velocity_m_s: [v0, v1],
                    change_m_s: [self.step_s * a0, self.step_s * a1],
                    mean_m_s: (s1 - s0) / self.step_s,
                };
                let voltage_v = blocked_n / self.spec.force_factor_n_a * self.spec.resistance_ohm;
                let (steady_a, left_a) = self.coil.current(start.current_a, voltage_v, &stroke).terms();
                (currents_a, transient_a) = ([steady_a[0], steady_a.iter().sum()], left_a);
                let [c0, c1, c2, c3, c4] = steady_a;
                [c0, c1, c2, c3, c4, left_a].map(|current_a| self.spec.force_factor_n_a * current_a)
            }
        };
        let [armature_start, armature_end] = [start.armature_at(currents_a[0]), end.armature_at(currents_a[1])];
        ShakenStep {
            start: start.points_at(currents_a[0]),
            end: end.points_at(currents_a[1]),
            transient_m_s2: start.per_ampere.0.map(|by| by * transient_a),
            armature: [armature_start, armature_end],
            armature_transient_m_s2: start.per_ampere.1 * transient_a,
            displacement_m: start.armature[0],
            shaker: self.spec,
            force_n,
            change: CurrentChange {
                ends_a: [currents_a[0] - start.current_a, currents_a[1] - end.current_a],
                transient_a,
            },
        }
    }

    /// Reads the motion of the sensors beside B and C, and how a current changes it, as that at the end of a step.
    fn read_more(&self, more: &mut OtherSensors, load: &Load) {
        if more.is_empty() {
            return;
        }
        let (_, _, current_a) = self.steps.shaker_state(self.blocked_n(load));
        self.steps.more_at_current(current_a + 1.0, &mut more.end);
        let per_ampere = more.end_per_ampere.iter_mut().zip(&more.end);
        per_ampere.for_each(|(per_ampere, at)| *per_ampere = at.acceleration);
        self.steps.more_at_current(current_a, &mut more.end);
        let per_ampere = more.end_per_ampere.iter_mut().zip(&more.end);
        per_ampere.for_each(|(per_ampere, at)| *per_ampere -= at.acceleration);
    }

    /// Settles the converters of the sensors beside B and C at the state without a load.
    pub fn settle_more(&self, more: &mut OtherSensors, filter: Option<&Filter>) {
        self.read_more(more, &Load::default());
        more.step_on();
        more.settle(filter);
    }

    /// Makes the `steps` steps of a hold from the time `start_s`, s; returns what converters without a filter sample.
    pub fn hold(
        &mut self,
        (start_s, steps): (f64, u32),
        load: &Load,
        (filter, sums): (Option<&Filter>, &mut Sums),
        more: &mut OtherSensors,
    ) -> Result<[f64; Measurement::CHANNELS], StructureError> {
        let mut sampled = [0.0; Measurement::CHANNELS];
        let mut before = filter.map(|_| self.motion(load));
        if filter.is_some() {
            self.read_more(more, load);
        }
        for part in 0..steps {
            self.steps.advance(start_s + f64::from(part) * self.step_s, load)?;
            if let (Some(filter), Some(start)) = (filter, &before) {
                let end = self.motion(load);
                let step = self.step([start, &end], load);
                filter.add_shaken(sums, part as usize, &step);
                if !more.is_empty() {
                    more.step_on();
                    self.read_more(more, load);
                    more.add(filter, part as usize, step.change);
                }
                before = Some(end);
            } else if 2 * (part + 1) == steps {
                sampled = self.instant(load);
                self.read_more(more, load);
                more.sample();
            }
        }
        let (displacement_m, velocity_m_s, current_a) = self.steps.shaker_state(self.blocked_n(load));
        match self.spec.exceeded(current_a, (displacement_m, velocity_m_s)) {
            Some((limit, got, most)) => Err(StructureError::Tripped { limit, got, most }),
            None => Ok(sampled),
        }
    }
}
