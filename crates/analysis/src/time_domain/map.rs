//! The stroboscopic map of a structure.

use alloc::vec;
use alloc::vec::Vec;
use core::cell::{OnceCell, RefCell};
use core::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use resonarm_dynamics::integrate::{IntegrateError, Scheme};
use resonarm_dynamics::structure::{Assembly, Dof, STAGE_TIMES, SineSteps, StepError, Stepper};

use super::error::TimeDomainError;
use crate::forced::Forced;

/// Difference for the map's derivative, relative to the response's size: the error of central differences, its square
/// times a sixth of the third derivative, and the rounding, 1e-16 over it, are then both near 1e-11.
const DIFFERENCE: f64 = 3e-5;
/// Most steps whose sines are kept at once.
const LONGEST_STRETCH: u32 = 4096;
/// The scheme's relative frequency error is this times (ωh)⁸.
const FREQUENCY_ERROR: f64 = 6.4e-8;
/// The largest relative error of an amplitude by the scheme.
const AMPLITUDE_TOLERANCE: f64 = 1e-8;
/// Fewest steps in a period of the excitation, so that its harmonics are followed too.
const FEWEST_STEPS: f64 = 40.0;
/// Most steps in a period of the excitation.
const MOST_STEPS: u32 = 1_000_000;

/// Returns N for modes of these frequencies, Hz, and damping ratios, and the time in which the slowest of their
/// transients falls by e, in periods of the excitation.
///
/// # Errors
/// [`TimeDomainError::Frequency`], [`TimeDomainError::FrequencyTooLow`], [`TimeDomainError::Undamped`].
fn steps_in_period(modes: impl Iterator<Item = (f64, f64)>, frequency_hz: f64) -> Result<(u32, f64), TimeDomainError> {
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
        // From 6.4e-8 (ωh)⁸ ≤ 1e-8 ζ, and at most a radian per step.
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

/// The map of one structure under one sine. A state has the coordinates, their rates and the states of the elements.
///
/// A period has a whole number of steps N, so that each period repeats the same phases exactly. N keeps the frequency
/// error of the scheme, −6.4e-8 (ωh)⁸ relative, below 1e-8 ζ in every mode: at resonance an amplitude changes by a
/// relative detuning over ζ, so it is exact to about 1e-8. The effect of the scheme's damping, 2.26e-8 (ωh)⁹ against ζ,
/// is smaller still. There are more steps if the structure asks for more; where elements need still more in some
/// trajectory, that period is integrated again with them.
#[derive(Debug)]
pub struct StroboscopicMap {
    forced: Forced,
    frequency_hz: f64,
    steps: u32,
    time_constant_periods: f64,
    stepper: RefCell<Stepper>,
    /// The drive at the stages of all steps of a period, for states side by side: every period has the same. Computed
    /// when it is first needed, and only of a period of at most [`LONGEST_STRETCH`] steps.
    sines: OnceCell<Vec<[f64; STAGE_TIMES.len()]>>,
    /// Factors that turn a state into a point of the section.
    weights: Vec<f64>,
}

impl StroboscopicMap {
    /// The scheme: its damping is negligible at these steps, and it is two to ten times as fast as the implicit ones.
    const SCHEME: Scheme = Scheme::Dop853;

    /// The map of a structure driven at `frequency_hz`, Hz.
    ///
    /// # Errors
    /// [`TimeDomainError::Frequency`], [`TimeDomainError::FrequencyTooLow`] or [`TimeDomainError::Load`] if the drive
    /// has no period, one of more than a million steps, or no finite amplitude; [`TimeDomainError::Undamped`] if
    /// transients of the linear structure never end; [`TimeDomainError::Step`] if no step can be made.
    pub fn new(forced: &Forced, frequency_hz: f64) -> Result<StroboscopicMap, TimeDomainError> {
        if !forced.amplitude.is_finite() {
            return Err(TimeDomainError::Load);
        }
        let modes = forced.assembly.modes().iter().map(|mode| (mode.frequency_hz, mode.damping_ratio));
        let (steps, time_constant_periods) = steps_in_period(modes, frequency_hz)?;
        StroboscopicMap::with_steps(forced, frequency_hz, f64::from(steps), 1, time_constant_periods)
    }

    /// A map with at least so many steps in a period, and a multiple of `unit`.
    fn with_steps(
        forced: &Forced,
        frequency_hz: f64,
        least: f64,
        unit: u32,
        time_constant_periods: f64,
    ) -> Result<StroboscopicMap, TimeDomainError> {
        let unit_steps = f64::from(unit);
        let steps = libm::ceil(least / unit_steps) * unit_steps;
        let most = MOST_STEPS;
        if steps > f64::from(most) {
            let lowest_hz = steps * frequency_hz / f64::from(most);
            return Err(TimeDomainError::FrequencyTooLow { got_hz: frequency_hz, steps, most, lowest_hz });
        }
        let dofs: Vec<Dof> = forced.drives.iter().map(|(dof, _)| *dof).collect();
        let stepper = Stepper::new(&forced.assembly, &dofs, Self::SCHEME, steps * frequency_hz);
        let stepper = match stepper {
            Err(StepError::Integrate(IntegrateError::RateTooLow { needed_hz, .. })) => {
                // At least one step more: rounding of the rate must not lead to the same number again.
                let more = libm::ceil(needed_hz / frequency_hz).max(steps + 1.0);
                return StroboscopicMap::with_steps(forced, frequency_hz, more, unit, time_constant_periods);
            }
            made => made.map_err(|source| TimeDomainError::Step { frequency_hz, source })?,
        };
        Ok(StroboscopicMap {
            forced: forced.clone(),
            frequency_hz,
            steps: steps as u32,
            time_constant_periods,
            stepper: RefCell::new(stepper),
            sines: OnceCell::new(),
            weights: weights(&forced.assembly, TAU * frequency_hz),
        })
    }

    /// Returns the same map with at least this many steps a second, and twice as many as here.
    pub(super) fn finer(&self, needed_hz: f64) -> Result<StroboscopicMap, TimeDomainError> {
        // Twice as many at least, so that few repetitions reach what an element needs.
        let steps = libm::ceil(needed_hz / self.frequency_hz).max(2.0 * f64::from(self.steps));
        StroboscopicMap::with_steps(&self.forced, self.frequency_hz, steps, 1, self.time_constant_periods)
    }

    /// Returns the same map with as many steps in a period or more, a multiple of `unit`.
    pub(super) fn in_multiples_of(&self, unit: u32) -> Result<StroboscopicMap, TimeDomainError> {
        let least = f64::from(self.steps);
        StroboscopicMap::with_steps(&self.forced, self.frequency_hz, least, unit, self.time_constant_periods)
    }

    /// Returns the state one period after `state`, both at phase 0: coordinates, rates, states of elements.
    ///
    /// # Errors
    /// [`TimeDomainError::Step`] if a step can't be made.
    pub fn advance(&self, state: &[f64]) -> Result<Vec<f64>, TimeDomainError> {
        match self.visit(state, |_step, _structure| Ok(())) {
            Err(TimeDomainError::Step { source: StepError::TooStiff { needed_hz, .. }, .. }) => {
                self.finer(needed_hz)?.advance(state)
            }
            reached => reached,
        }
    }

    /// Advances states at phase 0 by a number of periods. The states of a chain of at most three links with smooth
    /// elements are integrated side by side, bit-identical with [`StroboscopicMap::advance`]. A trajectory that grows
    /// without bound ends in numbers that are not finite.
    ///
    /// # Errors
    /// [`TimeDomainError::Step`] if a step can't be made for another reason.
    pub fn advance_all(&self, states: &mut [Vec<f64>], periods: u32) -> Result<(), TimeDomainError> {
        if self.advance_side_by_side(states, periods)? {
            return Ok(());
        }
        for state in states {
            for _ in 0..periods {
                if !Self::is_finite(state) {
                    break;
                }
                *state = match self.advance(state) {
                    Err(error) if diverges(&error) => vec![f64::NAN; state.len()],
                    reached => reached?,
                };
            }
        }
        Ok(())
    }

    /// Advances states side by side if the structure allows it; otherwise returns `false`.
    fn advance_side_by_side(&self, states: &mut [Vec<f64>], periods: u32) -> Result<bool, TimeDomainError> {
        let failed = |source| TimeDomainError::Step { frequency_hz: self.frequency_hz, source };
        let stepper = self.stepper.borrow();
        let amplitude = self.amplitudes();
        let omega_rad_s = TAU * self.frequency_hz;
        let h_s = stepper.step_s();
        let at = |step| STAGE_TIMES.map(|part| self.forced.wave(omega_rad_s * (self.time_s(step) + part * h_s)));
        let mut together = |sines: &[_], times| {
            stepper.advance_together(&SineSteps { amplitude: &amplitude, sines, times }, states).map_err(failed)
        };
        if self.steps <= LONGEST_STRETCH {
            return together(self.sines.get_or_init(|| (0..self.steps).map(at).collect()), periods);
        }
        for _ in 0..periods {
            for first in (0..self.steps).step_by(LONGEST_STRETCH as usize) {
                let last = (first + LONGEST_STRETCH).min(self.steps);
                if !together(&(first..last).map(at).collect::<Vec<_>>(), 1)? {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Returns the peaks of the loads, one for each degree of freedom that is driven.
    fn amplitudes(&self) -> Vec<f64> {
        self.forced.drives.iter().map(|(_, share)| share * self.forced.amplitude).collect()
    }

    /// Time in which the slowest transient of the linear structure falls by e, in periods of the drive.
    pub fn time_constant_periods(&self) -> f64 {
        self.time_constant_periods
    }

    /// The structure and its drive.
    pub fn forced(&self) -> &Forced {
        &self.forced
    }

    /// The frequency of the drive, Hz.
    pub fn frequency_hz(&self) -> f64 {
        self.frequency_hz
    }

    /// Integration steps in a period.
    pub fn steps_per_period(&self) -> u32 {
        self.steps
    }

    /// Runs one period; calls back with each step's number, 0 to N − 1, and the structure at its start.
    pub(super) fn visit(
        &self,
        state: &[f64],
        mut visit: impl FnMut(u32, &Stepper) -> Result<(), StepError>,
    ) -> Result<Vec<f64>, TimeDomainError> {
        let failed = |source| TimeDomainError::Step { frequency_hz: self.frequency_hz, source };
        let mut stepper = self.stepper.borrow_mut();
        let amplitude = self.amplitudes();
        let load = self.forced.step_load(&amplitude, TAU * self.frequency_hz);
        stepper.restore(state).map_err(failed)?;
        for step in 0..self.steps {
            visit(step, &stepper).map_err(failed)?;
            stepper.advance_under(self.time_s(step), &load).map_err(failed)?;
        }
        Ok(states(&stepper))
    }

    /// Returns the time at the start of a step, s since phase 0.
    fn time_s(&self, step: u32) -> f64 {
        f64::from(step) / (f64::from(self.steps) * self.frequency_hz)
    }

    /// Returns the drive at the start of a step.
    pub(super) fn load(&self, step: u32) -> f64 {
        self.forced.amplitude * self.forced.wave(TAU * f64::from(step) / f64::from(self.steps))
    }
}

/// Returns the size of a response, the reference of relative distances; the floor is for a system at rest.
pub(super) fn size(point: &DVector<f64>) -> f64 {
    point.norm().max(1e-12)
}

/// Returns the state of a structure: coordinates, rates, states of elements.
pub(super) fn states(of: &Stepper) -> Vec<f64> {
    of.position().iter().chain(of.velocity()).chain(of.element_states()).copied().collect()
}

/// Returns the factors of a state: 1/Ω for rates; 1/|∂x/∂q| for the state of an element, so that it is in the unit of
/// the coordinates.
fn weights(assembly: &Assembly, omega_rad_s: f64) -> Vec<f64> {
    let n = assembly.coordinates();
    let mut weights = vec![1.0; n];
    weights.resize(2 * n, 1.0 / omega_rad_s);
    let rest = vec![0.0; n];
    let mut direction = vec![0.0; n];
    let at = assembly.at(&rest);
    for element in assembly.elements().iter().filter(|element| element.law.has_state()) {
        at.element_direction(element, &mut direction);
        let length = libm::sqrt(direction.iter().map(|w| w * w).sum());
        weights.push(if length > 0.0 { 1.0 / length } else { 1.0 });
    }
    weights
}

/// Says whether the error is that of a trajectory that grows without bound.
fn diverges(error: &TimeDomainError) -> bool {
    matches!(error, TimeDomainError::Step { source: StepError::Integrate(IntegrateError::NotFinite { .. }), .. })
}

/// Methods for the search for settled responses.
impl StroboscopicMap {
    /// Says whether a response may keep an arbitrary constant for good, as the state of friction that sticks: it is
    /// then no isolated fixed point, and has settled when it returns.
    pub(crate) fn keeps_constants(&self) -> bool {
        self.forced.assembly.element_states() > 0
    }

    /// Says whether all numbers of a state are finite.
    pub(crate) fn is_finite(state: &[f64]) -> bool {
        state.iter().all(|number| number.is_finite())
    }

    /// Returns the state as a point of the section, rates over Ω: all of the size of the vibration.
    pub(crate) fn to_point(&self, state: &[f64]) -> DVector<f64> {
        DVector::from_iterator(state.len(), state.iter().zip(&self.weights).map(|(number, weight)| number * weight))
    }

    /// Returns the state at a point of the section.
    pub(crate) fn to_state(&self, point: &DVector<f64>) -> Vec<f64> {
        point.iter().zip(&self.weights).map(|(number, weight)| number / weight).collect()
    }

    /// Returns the point `periods` periods later.
    pub(crate) fn image(&self, point: &DVector<f64>, periods: u32) -> Result<DVector<f64>, TimeDomainError> {
        let state = (0..periods).try_fold(self.to_state(point), |state, _period| self.advance(&state))?;
        Ok(self.to_point(&state))
    }

    /// Returns the derivative of [`StroboscopicMap::image`] by the point, by central differences; `None` if a
    /// trajectory beside it grows without bound.
    pub(crate) fn derivative(&self, point: &DVector<f64>, periods: u32) -> Option<DMatrix<f64>> {
        let n = point.len();
        let difference = DIFFERENCE * size(point);
        // Shifts each coordinate in turn ahead and behind.
        let moved = |k: usize| {
            let mut moved = point.clone();
            moved[k / 2] += if k.is_multiple_of(2) { difference } else { -difference };
            moved
        };
        let points: Vec<DVector<f64>> = (0..2 * n).map(moved).collect();
        let mut states: Vec<Vec<f64>> = points.iter().map(|point| self.to_state(point)).collect();
        self.advance_all(&mut states, periods).ok()?;
        let mut matrix = DMatrix::zeros(n, n);
        for (column, (ends, images)) in points.chunks_exact(2).zip(states.chunks_exact(2)).enumerate() {
            // The difference actually added, after rounding.
            let width = ends[0][column] - ends[1][column];
            let change = self.to_point(&images[0]) - self.to_point(&images[1]);
            matrix.set_column(column, &(change / width));
        }
        matrix.iter().all(|value| value.is_finite()).then_some(matrix)
    }
}
