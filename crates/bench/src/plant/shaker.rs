//! Steps of an arm that a shaker drives.
//!
//! In current mode the coil's force is held over the step, like that of an ideal exciter. In voltage mode the current
//! and the motion of the armature depend on each other over the step: the motion gives a polynomial for the velocity,
//! this the current in closed form, and the current the next motion, until nothing changes. Each pass changes less than
//! the one before by a factor of about h Bl²/(R m), m being the mass that the coil drives: a thousandth for a shaker on
//! this arm.

use nalgebra::Vector2;

use super::PlantSpecError;
use crate::rig::{Amplifier, ShakerLimit, ShakerSpec};
use resonarm_dynamics::arm::{Arm, Load, State};
use resonarm_dynamics::integrate::{Excitation, IntegrateError, Integrator};
use resonarm_dynamics::structure::{Circuit, Current, LEAST_DECAY, Stroke};

/// Passes of a step in voltage mode before it counts as failed.
const MOST_PASSES: usize = 30;
/// Below this current, A, digits of it and of what moves with it underflow: 2⁻¹⁰²² over 2⁻⁵².
const CURRENT_WHOLE_A: f64 = f64::MIN_POSITIVE / f64::EPSILON;
/// Change of the current in a pass, relative, below which it is the last.
const PASS_LIMIT: f64 = 1e-12;

/// A shaker.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shaker {
    spec: ShakerSpec,
    coil: Circuit,
    step_s: f64,
    current_a: f64,
    /// The current over the last step.
    course: Current,
}

/// The drive of the arm, and of an attached armature, over a step.
#[derive(Clone, Copy, Debug)]
pub(super) enum Drive {
    /// A load that is held.
    Held(Load),
    /// A coil in voltage mode: its force is Σ polynomial τᵐ + transient e^{−λτ} with τ from 0 to 1 over the step, λ
    /// being [`Shaker::decay`].
    Coil {
        /// Coefficients of 1, τ … τ⁴, N.
        polynomial_n: [f64; 5],
        /// Coefficient of e^{−λτ}, N.
        transient_n: f64,
        /// The unit vector of the force.
        along: Vector2<f64>,
    },
}

impl Drive {
    /// The force of a coil without its transient at `tau` of the step, N; of a held load zero.
    pub fn along_n(&self, tau: f64) -> f64 {
        match self {
            Drive::Held(_) => 0.0,
            Drive::Coil { polynomial_n, .. } => polynomial_n.iter().rev().fold(0.0, |sum, term| sum * tau + term),
        }
    }

    /// The load at `tau` of the step, without a coil's transient.
    pub fn steady(&self, tau: f64) -> Load {
        match self {
            Drive::Held(load) => *load,
            Drive::Coil { along, .. } => Load { force_n: along * self.along_n(tau), ..Load::default() },
        }
    }
}

/// The coil's force over a step that starts at `start_s`.
struct CoilForce<'a> {
    shaker: &'a Shaker,
    current: Current,
    start_s: f64,
}

impl Excitation<Load> for CoilForce<'_> {
    fn load(&self, t_s: f64) -> Load {
        self.shaker.push(self.current.at((t_s - self.start_s) / self.shaker.step_s))
    }
}

/// The coil of a shaker, for steps of `step_s`.
///
/// # Errors
/// [`PlantSpecError::Inductance`] if the current changes too slowly for the closed form of a step.
pub(super) fn coil_of(spec: &ShakerSpec, step_s: f64) -> Result<Circuit, PlantSpecError> {
    let most_h = spec.resistance_ohm * step_s / LEAST_DECAY;
    if spec.amplifier == Amplifier::Voltage && spec.inductance_h > most_h {
        return Err(PlantSpecError::Inductance { got_h: spec.inductance_h, most_h });
    }
    let (force_factor_n_a, resistance_ohm) = (spec.force_factor_n_a, spec.resistance_ohm);
    let decay = step_s * resistance_ohm / spec.inductance_h;
    Ok(Circuit { force_factor_n_a, resistance_ohm, decay })
}

impl Shaker {
    /// A shaker without current, for steps of `step_s`.
    ///
    /// # Errors
    /// [`PlantSpecError::Inductance`] if the current changes too slowly for the closed form of a step.
    pub fn new(spec: ShakerSpec, step_s: f64) -> Result<Shaker, PlantSpecError> {
        let coil = coil_of(&spec, step_s)?;
        Ok(Shaker { spec, coil, step_s, current_a: 0.0, course: Current::ZERO })
    }

    /// The same shaker with a current in its coil.
    pub fn with_current(self, current_a: f64) -> Shaker {
        Shaker { current_a, ..self }
    }

    /// The current in the coil at the end of the last step, A.
    pub fn current_a(&self) -> f64 {
        self.current_a
    }

    /// How many times a transient of the current decays by e over a step: infinite unless the amplifier holds the
    /// voltage of a coil with inductance.
    pub fn decay(&self) -> f64 {
        match self.spec.amplifier {
            Amplifier::Current => f64::INFINITY,
            Amplifier::Voltage => self.coil.decay,
        }
    }

    /// The drive of the arm over the last step.
    pub fn drive(&self) -> Drive {
        match self.spec.amplifier {
            Amplifier::Current => Drive::Held(self.acting()),
            Amplifier::Voltage => {
                let force = |current_a: f64| self.spec.force_factor_n_a * current_a;
                let (steady_a, transient_a) = self.course.terms();
                let (polynomial_n, transient_n) = (steady_a.map(force), force(transient_a));
                Drive::Coil { polynomial_n, transient_n, along: self.spec.direction() }
            }
        }
    }

    /// The coil's force at the end of the last step.
    pub fn acting(&self) -> Load {
        self.push(self.current_a)
    }

    fn push(&self, current_a: f64) -> Load {
        let force_n = self.spec.direction() * (self.spec.force_factor_n_a * current_a);
        Load { force_n, ..Load::default() }
    }

    /// One step under a command.
    ///
    /// # Errors
    /// As [`Integrator::step`].
    pub fn step(
        &mut self,
        integrator: &Integrator,
        arm: &Arm,
        t_s: f64,
        state: &State,
        command: &Load,
    ) -> Result<State, IntegrateError> {
        let blocked_a = self.spec.along_n(command) / self.spec.force_factor_n_a;
        match self.spec.amplifier {
            Amplifier::Current => {
                self.current_a = blocked_a;
                integrator.step(arm, t_s, state, &self.acting())
            }
            Amplifier::Voltage => self.step_at_voltage(integrator, arm, t_s, state, blocked_a),
        }
    }

    fn step_at_voltage(
        &mut self,
        integrator: &Integrator,
        arm: &Arm,
        t_s: f64,
        state: &State,
        blocked_a: f64,
    ) -> Result<State, IntegrateError> {
        let start_a = self.start_a(arm, state, blocked_a);
        let [start_m, start_m_s, start_change] = self.armature(arm, state, start_a);
        let mut stroke = Stroke {
            velocity_m_s: [start_m_s, start_m_s + start_change],
            change_m_s: [start_change; 2],
            mean_m_s: start_m_s + 0.5 * start_change,
        };
        let (mut before_a, mut change) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..MOST_PASSES {
            let current = self.coil.current(start_a, blocked_a * self.spec.resistance_ohm, &stroke);
            let force = CoilForce { shaker: self, current, start_s: t_s };
            let next = integrator.step(arm, t_s, state, &force)?;
            let end_a = current.at(1.0);
            let [end_m, end_m_s, end_change] = self.armature(arm, &next, end_a);
            let size_a = end_a.abs() + blocked_a.abs() + start_a.abs();
            change = (end_a - before_a).abs() / size_a.max(CURRENT_WHOLE_A);
            if change <= PASS_LIMIT {
                (self.current_a, self.course) = (end_a, current);
                return Ok(next);
            }
            before_a = end_a;
            stroke = Stroke {
                velocity_m_s: [start_m_s, end_m_s],
                change_m_s: [start_change, end_change],
                mean_m_s: (end_m - start_m) / self.step_s,
            };
        }
        Err(IntegrateError::NoConvergence { t_s, iterations: MOST_PASSES, correction: change })
    }

    /// The current at the start of a step, A: without inductance it jumps with the voltage, V/R − Bl ṡ/R.
    fn start_a(&self, arm: &Arm, state: &State, blocked_a: f64) -> f64 {
        if self.coil.decay.is_finite() {
            return self.current_a;
        }
        let (_, velocity_m_s) = arm.attachment_motion(state);
        blocked_a - self.spec.force_factor_n_a * velocity_m_s / self.spec.resistance_ohm
    }

    /// s, m; ṡ, m/s; h s̈, m/s, of the armature at a state and current.
    fn armature(&self, arm: &Arm, state: &State, current_a: f64) -> [f64; 3] {
        let (displacement_m, velocity_m_s) = arm.attachment_motion(state);
        let acceleration = arm.acceleration(state, &self.push(current_a));
        let tip_m_s2 = arm.point_accelerations(state, &acceleration).c_m_s2;
        [displacement_m, velocity_m_s, self.step_s * self.spec.direction().dot(&tip_m_s2)]
    }

    /// The first limit that is exceeded at a state, with the value and the limit.
    pub fn exceeded(&self, arm: &Arm, state: &State) -> Option<(ShakerLimit, f64, f64)> {
        self.spec.exceeded(self.current_a, arm.attachment_motion(state))
    }
}
