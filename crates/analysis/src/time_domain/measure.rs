//! Amplitudes and readings of a motion.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;

use super::{StroboscopicMap, TimeDomainError};
use crate::Readings;
use crate::readings::Sums;
use resonarm_dynamics::arm::State;

/// Periods over which an unsettled motion is measured.
pub(crate) const UNSETTLED_PERIODS: u32 = 64;

/// The measurements of a motion.
pub(super) struct Measured {
    /// max |αᵢ(t)|, rad.
    pub amplitude_rad: [f64; 2],
    /// |cᵢ| with cᵢ = 2/(nN) Σₖ αᵢ(tₖ) e^(−iΩtₖ), rad. The rectangle rule over whole periods is exact but for the
    /// harmonics from N − 1 up, N being the steps in a period.
    pub harmonic1_rad: [f64; 2],
    /// The states at phase 0.
    pub section: Vec<State>,
}

/// A step in which an angle turns back: its number in the period, the state at its start and α̇ at its end.
struct Turn {
    joint: usize,
    step: u32,
    start: State,
    end_rate_rad_s: f64,
    /// The larger |α| at the two ends, rad.
    reached_rad: f64,
}

/// Measures `periods` periods from `start`, at phase 0.
pub(super) fn measure(map: &StroboscopicMap, start: &State, periods: u32) -> Result<Measured, TimeDomainError> {
    let mut section = Vec::with_capacity(periods as usize);
    let mut sums = [Complex::new(0.0, 0.0); 2];
    let mut turns: Vec<Turn> = Vec::new();
    let mut last: Option<(u32, State)> = None;
    let (mut state, mut largest) = (*start, [0.0_f64; 2]);
    for period in 0..=periods {
        if period < periods {
            section.push(state);
        }
        state = map.advance_visiting(&state, |step, state| {
            if let Some((last_step, last_state)) = last {
                for joint in 0..2 {
                    turns.extend(turn(joint, last_step, &last_state, state));
                }
            }
            last = (period < periods).then_some((step, *state));
            if period < periods {
                let (sine, cosine) = libm::sincos(TAU * f64::from(step) / f64::from(map.steps_per_period()));
                for joint in 0..2 {
                    sums[joint] += Complex::new(cosine, -sine) * state.alpha_rad[joint];
                    largest[joint] = largest[joint].max(libm::fabs(state.alpha_rad[joint]));
                }
            }
            Ok(())
        })?;
    }
    let weight = 2.0 / (f64::from(periods) * f64::from(map.steps_per_period()));
    let harmonic1_rad = sums.map(|sum| weight * libm::hypot(sum.re, sum.im));
    Ok(Measured { amplitude_rad: peaks(map, &turns, largest)?, harmonic1_rad, section })
}

/// The bench readings of the motion from `start`, at phase 0, over `period` periods of the excitation after which it
/// repeats, or over 64 if it has no period. By the rectangle rule, as for [`Settled::harmonic1_rad`](super::Settled).
///
/// # Errors
/// [`TimeDomainError::Integrate`] if a step can't be made.
pub fn readings(map: &StroboscopicMap, start: &State, period: Option<u32>) -> Result<Readings, TimeDomainError> {
    let (mut sums, mut state) = (Sums::new(map.arm()), *start);
    for _ in 0..period.unwrap_or(UNSETTLED_PERIODS).max(1) {
        state = map.advance_visiting(&state, |step, state| {
            sums.add(state, TAU * f64::from(step) / f64::from(map.steps_per_period()));
            Ok(())
        })?;
    }
    Ok(sums.finish(map.sine().frequency_hz))
}

/// The turn of a joint between two states a step apart, if there is one.
fn turn(joint: usize, step: u32, start: &State, end: &State) -> Option<Turn> {
    let (rate, end_rate) = (start.alpha_dot_rad_s[joint], end.alpha_dot_rad_s[joint]);
    let reached_rad = libm::fabs(start.alpha_rad[joint]).max(libm::fabs(end.alpha_rad[joint]));
    (rate * end_rate < 0.0).then_some(Turn { joint, step, start: *start, end_rate_rad_s: end_rate, reached_rad })
}

/// The largest |αᵢ|, between the steps too.
///
/// Only turns that reach almost as far as the farthest can contain it: within a step of phase ωh a peak rises above the
/// steps' ends by at most (ωh)²/8 of its height.
fn peaks(map: &StroboscopicMap, turns: &[Turn], largest: [f64; 2]) -> Result<[f64; 2], TimeDomainError> {
    let mut peaks = largest;
    for turn in turns.iter().filter(|turn| turn.reached_rad >= 0.8 * largest[turn.joint]) {
        peaks[turn.joint] = peaks[turn.joint].max(peak(map, turn)?);
    }
    Ok(peaks)
}

/// |α| where α̇ = 0 within a step: the time by the secant rule and one iteration of Newton's method, t − α̇/α̈, with
/// the state integrated to that time; what is left of α̇ takes α̇²/(2α̈) off α.
fn peak(map: &StroboscopicMap, turn: &Turn) -> Result<f64, TimeDomainError> {
    let Turn { joint, step, ref start, end_rate_rad_s, .. } = *turn;
    let rate = start.alpha_dot_rad_s[joint];
    let within = |part_s: f64| part_s.clamp(1e-6 * map.step_s(), map.step_s());
    let mut part_s = within(map.step_s() * rate / (rate - end_rate_rad_s));
    let state = map.part_of_step(step, start, part_s)?;
    part_s = within(part_s - state.alpha_dot_rad_s[joint] / map.acceleration(step, part_s, &state)[joint]);
    let state = map.part_of_step(step, start, part_s)?;
    let (left, acceleration) = (state.alpha_dot_rad_s[joint], map.acceleration(step, part_s, &state)[joint]);
    Ok(libm::fabs(state.alpha_rad[joint] - left * left / (2.0 * acceleration)))
}
