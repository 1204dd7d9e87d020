//! The stroboscopic map: from the state at phase 0 of the excitation to the state one period later.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::{Matrix4, Vector4};

use super::TimeDomainError;
use crate::modes;
use resonarm_dynamics::arm::{Arm, Sine, State};
use resonarm_dynamics::ensemble;
use resonarm_dynamics::integrate::{Excitation, IntegrateError, Integrator, Scheme};

/// The scheme: negligible damping at these steps, and two to ten times as fast here as the implicit ones.
const SCHEME: Scheme = Scheme::Dop853;
/// The scheme's relative frequency error is this times (ωh)⁸.
const FREQUENCY_ERROR: f64 = 6.4e-8;
/// The largest relative error of an amplitude by the scheme.
const AMPLITUDE_TOLERANCE: f64 = 1e-8;
/// Fewest steps in a period of the excitation, so that its harmonics are followed too.
const FEWEST_STEPS: f64 = 40.0;
/// Most steps in a period of the excitation.
const MOST_STEPS: u32 = 1_000_000;
/// Most steps whose loads are kept at once for [`StroboscopicMap::advance_all`].
const LONGEST_STRETCH: u32 = 4096;
/// Difference for the map's derivative, relative to the motion's size: the error of central differences, its square
/// times a sixth of the third derivative, and the rounding, 1e-16 over it, are then both near 1e-11.
const DIFFERENCE: f64 = 3e-5;

/// The map of one arm under one excitation.
///
/// A period has a whole number of steps N, so each period repeats the same phases exactly. N keeps the frequency error
/// of the scheme, −6.4e-8 (ωh)⁸ relative, below 1e-8 ζ in both modes: at resonance an amplitude changes by a relative
/// detuning over ζ, so it is exact to about 1e-8. The effect of the scheme's damping, 2.26e-8 (ωh)⁹ against ζ, is
/// smaller still.
#[derive(Clone, Debug)]
pub struct StroboscopicMap<'a> {
    arm: &'a Arm,
    sine: Sine,
    integrator: Integrator,
    steps: u32,
    /// Time in which the slowest transient of the linear arm falls by e, in periods of the excitation.
    time_constant_periods: f64,
}

impl<'a> StroboscopicMap<'a> {
    /// The map of `arm` under `sine`.
    ///
    /// # Errors
    /// [`TimeDomainError::Frequency`], [`TimeDomainError::FrequencyTooLow`] or [`TimeDomainError::Load`] if the
    /// excitation has no period, one of more than a million steps, or no finite amplitude;
    /// [`TimeDomainError::Undamped`] if the arm's transients never end.
    pub fn new(arm: &'a Arm, sine: Sine) -> Result<StroboscopicMap<'a>, TimeDomainError> {
        let frequency_hz = sine.frequency_hz;
        if !(frequency_hz.is_finite() && frequency_hz > 0.0) {
            return Err(TimeDomainError::Frequency { got_hz: frequency_hz });
        }
        let peak = &sine.amplitude;
        if !peak.torque_nm.iter().chain(&peak.force_n).all(|value| value.is_finite()) {
            return Err(TimeDomainError::Load);
        }
        let mut needed: f64 = FEWEST_STEPS;
        let mut slowest_decay = f64::INFINITY;
        for (index, mode) in modes(arm).iter().enumerate() {
            let damping_ratio = mode.damping_ratio;
            if damping_ratio <= 0.0 {
                return Err(TimeDomainError::Undamped { mode: index + 1, damping_ratio });
            }
            let phase_rad = libm::pow(AMPLITUDE_TOLERANCE * damping_ratio / FREQUENCY_ERROR, 0.125).min(1.0);
            needed = needed.max(TAU * mode.frequency_hz / (phase_rad * frequency_hz));
            slowest_decay = slowest_decay.min(damping_ratio * TAU * mode.frequency_hz);
        }
        let steps = libm::ceil(needed);
        if steps > f64::from(MOST_STEPS) {
            let lowest_hz = needed * frequency_hz / f64::from(MOST_STEPS);
            return Err(TimeDomainError::FrequencyTooLow { got_hz: frequency_hz, steps, most: MOST_STEPS, lowest_hz });
        }
        let integrator = Integrator::new(SCHEME, steps * frequency_hz, arm)
            .map_err(|source| TimeDomainError::Integrate { frequency_hz, source })?;
        let time_constant_periods = frequency_hz / slowest_decay;
        Ok(StroboscopicMap { arm, sine, integrator, steps: steps as u32, time_constant_periods })
    }

    /// The arm.
    pub(super) fn arm(&self) -> &'a Arm {
        self.arm
    }

    /// N: integration steps in a period.
    pub fn steps_per_period(&self) -> u32 {
        self.steps
    }

    /// The excitation.
    pub fn sine(&self) -> &Sine {
        &self.sine
    }

    /// Time in which the slowest transient of the linear arm falls by e, in periods of the excitation.
    pub fn time_constant_periods(&self) -> f64 {
        self.time_constant_periods
    }

    /// The state one period after `state`, which is at phase 0.
    ///
    /// # Errors
    /// [`TimeDomainError::Integrate`] if a step can't be made.
    pub fn advance(&self, state: &State) -> Result<State, TimeDomainError> {
        self.advance_visiting(state, |_step, _state| Ok(()))
    }

    /// The states a number of periods after `states`, all at phase 0, side by side; each has the bits of
    /// [`StroboscopicMap::advance`], and a motion that grows without bound has a state that is not finite.
    pub fn advance_all(&self, states: &mut [State], periods: u32) {
        let h_s = self.integrator.step_s();
        let loads = |step| ensemble::NODES.map(|part| self.sine.load(self.time_s(step) + part * h_s));
        let stretches = self.steps.div_ceil(LONGEST_STRETCH);
        // Usually a period is one stretch, and its loads are computed once for all periods.
        let (rounds, times) = if stretches == 1 { (1, periods) } else { (periods, 1) };
        for _ in 0..rounds {
            for first in (0..stretches).map(|stretch| stretch * LONGEST_STRETCH) {
                let last = (first + LONGEST_STRETCH).min(self.steps);
                let stretch: Vec<_> = (first..last).map(loads).collect();
                ensemble::advance(self.arm, h_s, &stretch, times, states);
            }
        }
    }

    /// One period; calls back with each step's number, 0 to N − 1, and the state at its start.
    pub(super) fn advance_visiting(
        &self,
        state: &State,
        mut visit: impl FnMut(u32, &State) -> Result<(), TimeDomainError>,
    ) -> Result<State, TimeDomainError> {
        let mut state = *state;
        for step in 0..self.steps {
            visit(step, &state)?;
            state = self
                .integrator
                .step(self.arm, self.time_s(step), &state, &self.sine)
                .map_err(|source| self.failed(source))?;
        }
        Ok(state)
    }

    /// The state `part_s` after the start of a step, within the step.
    pub(super) fn part_of_step(&self, step: u32, state: &State, part_s: f64) -> Result<State, TimeDomainError> {
        let integrator = Integrator::new(SCHEME, 1.0 / part_s, self.arm).map_err(|source| self.failed(source))?;
        integrator.step(self.arm, self.time_s(step), state, &self.sine).map_err(|source| self.failed(source))
    }

    /// α̈ at a time `part_s` after the start of a step, rad/s².
    pub(super) fn acceleration(&self, step: u32, part_s: f64, state: &State) -> [f64; 2] {
        self.arm.acceleration(state, &self.sine.load(self.time_s(step) + part_s)).into()
    }

    /// The step h, s.
    pub(super) fn step_s(&self) -> f64 {
        self.integrator.step_s()
    }

    /// Time at the start of a step, s since phase 0: small, so that the phase is as exact in the last period as in the
    /// first.
    fn time_s(&self, step: u32) -> f64 {
        f64::from(step) / (f64::from(self.steps) * self.sine.frequency_hz)
    }

    fn failed(&self, source: IntegrateError) -> TimeDomainError {
        TimeDomainError::Integrate { frequency_hz: self.sine.frequency_hz, source }
    }

    /// The state as a point of the section, (α1, α2, α̇1/Ω, α̇2/Ω), rad, Ω = 2πf: all four of the size of the
    /// vibration.
    pub(super) fn point(&self, state: &State) -> Vector4<f64> {
        let scale = 1.0 / (TAU * self.sine.frequency_hz);
        let (x, v) = (&state.alpha_rad, state.alpha_dot_rad_s * scale);
        Vector4::new(x.x, x.y, v.x, v.y)
    }

    /// The state at a point of the section.
    pub(super) fn state(&self, point: &Vector4<f64>) -> State {
        let omega = TAU * self.sine.frequency_hz;
        State::new([point.x, point.y], [omega * point.z, omega * point.w])
    }

    /// The point `periods` periods on.
    pub(super) fn image(&self, point: &Vector4<f64>, periods: u32) -> Result<Vector4<f64>, TimeDomainError> {
        let mut state = self.state(point);
        for _ in 0..periods {
            state = self.advance(&state)?;
        }
        Ok(self.point(&state))
    }

    /// The derivative of [`StroboscopicMap::image`] by the point, by central differences for a motion of this size;
    /// `None` if a motion beside it grows without bound.
    pub(super) fn derivative(&self, point: &Vector4<f64>, periods: u32, size_rad: f64) -> Option<Matrix4<f64>> {
        let difference = DIFFERENCE * size_rad;
        // Ahead and behind of each coordinate in turn.
        let points: [Vector4<f64>; 8] = core::array::from_fn(|k| {
            let mut moved = *point;
            moved[k / 2] += if k % 2 == 0 { difference } else { -difference };
            moved
        });
        let mut states = points.map(|point| self.state(&point));
        self.advance_all(&mut states, periods);
        let mut matrix = Matrix4::zeros();
        for (column, (ends, images)) in points.chunks_exact(2).zip(states.chunks_exact(2)).enumerate() {
            // The difference actually added, after rounding.
            let width = ends[0][column] - ends[1][column];
            let change = self.point(&images[0]) - self.point(&images[1]);
            matrix.set_column(column, &(change / width));
        }
        matrix.iter().all(|value| value.is_finite()).then_some(matrix)
    }
}
