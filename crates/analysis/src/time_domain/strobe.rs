//! The stroboscopic map: from the state at phase 0 of the excitation to the state one period later.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::DVector;

use super::TimeDomainError;
use super::map::Strobe;
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
pub(crate) const MOST_STEPS: u32 = 1_000_000;
/// Most steps whose loads are kept at once for [`StroboscopicMap::advance_all`].
const LONGEST_STRETCH: u32 = 4096;

/// N for modes of these frequencies, Hz, and damping ratios, and the time in which the slowest of their transients
/// falls by e, in periods of the excitation.
///
/// # Errors
/// [`TimeDomainError::Frequency`], [`TimeDomainError::FrequencyTooLow`], [`TimeDomainError::Undamped`].
pub(crate) fn steps_in_period(
    modes: impl Iterator<Item = (f64, f64)>,
    frequency_hz: f64,
) -> Result<(u32, f64), TimeDomainError> {
    if !(frequency_hz.is_finite() && frequency_hz > 0.0) {
        return Err(TimeDomainError::Frequency { got_hz: frequency_hz });
    }
    let mut needed: f64 = FEWEST_STEPS;
    let mut slowest_decay = f64::INFINITY;
    for (index, (mode_hz, damping_ratio)) in modes.enumerate() {
        if mode_hz == 0.0 {
            return Err(TimeDomainError::Rigid { mode: index + 1 });
        }
        if damping_ratio <= 0.0 {
            // −0 is 0, too.
            return Err(TimeDomainError::Undamped { mode: index + 1, damping_ratio: damping_ratio + 0.0 });
        }
        let phase_rad = libm::pow(AMPLITUDE_TOLERANCE * damping_ratio / FREQUENCY_ERROR, 0.125).min(1.0);
        needed = needed.max(TAU * mode_hz / (phase_rad * frequency_hz));
        // ζω, or, where the mode does not oscillate, the slower of two decays, ω (ζ − √(ζ² − 1)).
        let decay = match damping_ratio > 1.0 {
            true => TAU * mode_hz / (damping_ratio + libm::sqrt((damping_ratio - 1.0) * (damping_ratio + 1.0))),
            false => damping_ratio * TAU * mode_hz,
        };
        slowest_decay = slowest_decay.min(decay);
    }
    let steps = libm::ceil(needed);
    if steps > f64::from(MOST_STEPS) {
        let lowest_hz = needed * frequency_hz / f64::from(MOST_STEPS);
        return Err(TimeDomainError::FrequencyTooLow { got_hz: frequency_hz, steps, most: MOST_STEPS, lowest_hz });
    }
    Ok((steps as u32, frequency_hz / slowest_decay))
}

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
        let damped = modes(arm).map(|mode| (mode.frequency_hz, mode.damping_ratio));
        let (steps, time_constant_periods) = steps_in_period(damped.into_iter(), frequency_hz)?;
        let peak = &sine.amplitude;
        if !peak.torque_nm.iter().chain(&peak.force_n).all(|value| value.is_finite()) {
            return Err(TimeDomainError::Load);
        }
        let integrator = Integrator::new(SCHEME, f64::from(steps) * frequency_hz, arm)
            .map_err(|source| TimeDomainError::Integrate { frequency_hz, source })?;
        Ok(StroboscopicMap { arm, sine, integrator, steps, time_constant_periods })
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
}

impl Strobe for StroboscopicMap<'_> {
    type State = State;

    fn time_constant_periods(&self) -> f64 {
        self.time_constant_periods
    }

    fn keeps_constants(&self) -> bool {
        false
    }

    fn next(&self, state: &State) -> Result<State, TimeDomainError> {
        self.advance(state)
    }

    fn advance_together(&self, states: &mut [State], periods: u32) -> Result<(), TimeDomainError> {
        self.advance_all(states, periods);
        Ok(())
    }

    fn is_finite(state: &State) -> bool {
        state.is_finite()
    }

    fn to_point(&self, state: &State) -> DVector<f64> {
        let scale = 1.0 / (TAU * self.sine.frequency_hz);
        let (x, v) = (&state.alpha_rad, state.alpha_dot_rad_s * scale);
        DVector::from_row_slice(&[x.x, x.y, v.x, v.y])
    }

    fn to_state(&self, point: &DVector<f64>) -> State {
        let omega = TAU * self.sine.frequency_hz;
        State::new([point[0], point[1]], [omega * point[2], omega * point[3]])
    }
}
