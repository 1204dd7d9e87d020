//! Chains with smooth elements that a shaker drives: the coil and the links over a step.
//!
//! In current mode the coil's force is held over the step. In voltage mode the current and the motion of the armature
//! depend on each other over the step: the motion gives a polynomial for the velocity, this the current in closed form
//! ([`Circuit`]), and the current the next motion, until nothing changes. Each pass changes less than the one before by
//! a factor of about h Bl²/(R m), m being the mass that the coil drives: a thousandth for a shaker on an arm.

use super::chains::{Course, Stepped};
use super::driver::Driver;
use super::error::StepError;
use crate::integrate::{IntegrateError, Motion};
use crate::structure::coil::{Circuit, Stroke};

/// Passes of a step in voltage mode before it counts as failed.
const MOST_PASSES: usize = 30;
/// Below this current, A, digits of it and of what moves with it underflow: 2⁻¹⁰²² over 2⁻⁵².
const CURRENT_WHOLE_A: f64 = f64::MIN_POSITIVE / f64::EPSILON;
/// Change of the current in a pass, relative, below which it is the last.
const PASS_LIMIT: f64 = 1e-12;

impl<const N: usize> Stepped<N> {
    /// The motion after a step from the time `t_s`, s, and the current at its end, A, while the force of the blocked
    /// shaker, N, is held.
    pub(super) fn shaken(&self, driver: &Driver, t_s: f64, blocked_n: f64) -> Result<(Motion<f64, N>, f64), StepError> {
        let force_factor_n_a = driver.armature.coil.force_factor_n_a();
        let blocked_a = blocked_n / force_factor_n_a;
        let Some(circuit) = driver.circuit else {
            let held = self.driven(Course::Held(force_factor_n_a * blocked_a), &[1.0]);
            return Ok((self.step(t_s, &held)?, blocked_a));
        };
        let voltage_v = blocked_a * circuit.resistance_ohm;
        let start_a = self.start_a(driver, &circuit, blocked_a);
        let [start_m, start_m_s, start_change] = self.stroke(driver, &self.motion, start_a);
        // The first guess: the acceleration at the start lasts over the whole step.
        let mut stroke = Stroke {
            velocity_m_s: [start_m_s, start_m_s + start_change],
            change_m_s: [start_change; 2],
            mean_m_s: start_m_s + 0.5 * start_change,
        };
        let mut before_a = f64::INFINITY;
        let mut change = f64::INFINITY;
        for _ in 0..MOST_PASSES {
            let current = circuit.current(start_a, voltage_v, &stroke);
            let course = Course::Coil { current, force_factor_n_a, start_s: t_s, step_s: driver.step_s };
            let next = self.step(t_s, &self.driven(course, &[1.0]))?;
            let end_a = current.at(1.0);
            let [end_m, end_m_s, end_change] = self.stroke(driver, &next, end_a);
            // Relative to all currents of the step, so that one that passes through zero converges, too.
            let size_a = end_a.abs() + blocked_a.abs() + start_a.abs();
            change = (end_a - before_a).abs() / size_a.max(CURRENT_WHOLE_A);
            if change <= PASS_LIMIT {
                return Ok((next, end_a));
            }
            before_a = end_a;
            stroke = Stroke {
                velocity_m_s: [start_m_s, end_m_s],
                change_m_s: [start_change, end_change],
                mean_m_s: (end_m - start_m) / driver.step_s,
            };
        }
        Err(IntegrateError::NoConvergence { t_s, iterations: MOST_PASSES, correction: change }.into())
    }

    /// The current at the start of a step, A: without inductance it jumps with the voltage, V/R − Bl ṡ/R.
    fn start_a(&self, driver: &Driver, circuit: &Circuit, blocked_a: f64) -> f64 {
        if circuit.decay.is_finite() {
            return driver.current_a;
        }
        let velocity_m_s = self.links.armature(&self.motion, &self.load(&[0.0])).velocity;
        blocked_a - circuit.force_factor_n_a * velocity_m_s / circuit.resistance_ohm
    }

    /// s, m; ṡ, m/s; h s̈, m/s, of the armature at a motion and a current.
    fn stroke(&self, driver: &Driver, motion: &Motion<f64, N>, current_a: f64) -> [f64; 3] {
        let load = self.load(&[driver.armature.coil.force_factor_n_a() * current_a]);
        let at = self.links.armature(motion, &load);
        [at.displacement, at.velocity, driver.step_s * at.acceleration]
    }
}
