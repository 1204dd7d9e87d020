//! The first response of a branch near a given state at phase 0 of the drive.
//!
//! The structure is integrated from the state over some periods of the drive. Newton's method then begins at the Fourier
//! series of the response over the periods after which it returns. A state that is off the response by a little does not
//! return exactly: the difference between the end and the start is taken off the displacements, in proportion to time, so
//! that the series has no jump.

use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::integrate::{IntegrateError, Scheme};
use resonarm_dynamics::structure::{Dof, StepError, Stepper};

use super::adapt::begin;
use super::balance::Balance;
use super::trace_options::TraceOptions;
use super::unknowns::Body;
use crate::continuation::{Continuation, System};
use crate::dense::dot;
use crate::error::AnalysisError;
use crate::forced::Forced;
use crate::fourier::Basis;
use crate::refusal::StepRefusal;

/// Samples of a period.
const SAMPLES: usize = 256;
/// The most periods of the drive after which a response is expected to repeat.
const MOST_PERIODS: usize = 12;
/// A response has returned within this part of the size of its state.
const RETURNED: f64 = 1e-3;
/// It repeats after several periods if it returns within this part of the distance after one. A state off a response
/// that repeats after one may come near itself again as it circles about it, but not as near as this.
const NEARER: f64 = 1e-2;
/// The series begins with the harmonics whose sizes are above this part of the size of the series.
const NEGLECTED: f64 = 1e-4;
/// A response whose series differs from that of the start by more than this part is another one.
const ELSEWHERE: f64 = 0.5;
/// The most integration steps between two samples.
const MOST_STEPS: f64 = 1e4;

/// A response integrated from a state.
struct Course {
    /// Coordinates at the samples, n numbers each, the end included.
    coordinates: Vec<f64>,
    /// Distances of the states after 1, 2, … periods from the start, relative to the size of the start.
    distances: Vec<f64>,
}

/// Starts near a state at `options.branch.from`, with as many harmonics as the response needs; the balance is then one of
/// the response's period.
///
/// # Errors
/// [`AnalysisError::StateSize`] for a state that is none of the structure; [`AnalysisError::NotIntegrated`];
/// [`AnalysisError::NoStartNear`] if no response is found near it.
pub(super) fn start_near(
    balance: &mut Balance,
    options: &TraceOptions,
    state: &[f64],
) -> Result<Continuation, AnalysisError> {
    let assembly = balance.forced.assembly();
    let moving = 2 * assembly.coordinates();
    let all = 2 * assembly.coordinates() + assembly.element_states();
    if (state.len() != moving && state.len() != all) || !state.iter().all(|number| number.is_finite()) {
        let got = state.iter().take_while(|number| number.is_finite()).count();
        return Err(AnalysisError::StateSize { got, expected: moving, with_elements: all });
    }
    let mut whole = state.to_vec();
    whole.resize(all, 0.0);
    let course = course(&balance.forced, balance.frequency_hz, &whole)?;
    let period = course.period();
    let branch = &options.branch;
    let at = balance.place(options.branch.from);
    let mut around = Balance::of_period(
        &balance.forced,
        [period, branch.least_harmonics * period],
        balance.frequency_hz,
        balance.coordinate,
    );
    let series = course.series(&around);
    let m = around.unknowns.count();
    let [least, most] = [branch.least_harmonics, branch.most_harmonics].map(|harmonics| harmonics * period);
    let needed = needed_harmonics(&series, m).max(least).min(most);
    let mut harmonics = needed;
    let mut refusal = StepRefusal::Newton;
    for more in [needed, (2 * needed).min(most)] {
        harmonics = more;
        let mut guess = series.clone();
        guess.resize(m * (2 * harmonics + 1), 0.0);
        around.set_harmonics(harmonics);
        match begin(&mut around, branch, &guess) {
            Ok(continuation) => {
                let found = &continuation.point().x;
                let apart = |k: usize| found.get(k).copied().unwrap_or(0.0) - guess.get(k).copied().unwrap_or(0.0);
                let squares = (0..found.len().max(guess.len())).map(apart).map(|apart| apart * apart);
                if libm::sqrt(squares.sum()) <= ELSEWHERE * branch.continuation.size(&guess) {
                    *balance = around;
                    return Ok(continuation);
                }
                refusal = StepRefusal::Correction;
            }
            Err(AnalysisError::NoSolution { refusal: why, .. }) => refusal = why,
            Err(other) => return Err(other),
        }
    }
    let change = course.distances[period - 1];
    Err(AnalysisError::NoStartNear { at, period, change, harmonics, refusal })
}

/// Integrates from a state at phase 0 until the response has returned.
fn course(forced: &Forced, frequency_hz: f64, state: &[f64]) -> Result<Course, AnalysisError> {
    let fastest_hz = forced.assembly().modes().last().map_or(0.0, |mode| mode.frequency_hz);
    // A radian of the fastest mode at most.
    let mut steps = libm::ceil(core::f64::consts::TAU * fastest_hz / frequency_hz / SAMPLES as f64).max(1.0);
    loop {
        match integrated(forced, frequency_hz, state, steps) {
            Err(
                StepError::TooStiff { needed_hz, .. }
                | StepError::Integrate(IntegrateError::RateTooLow { needed_hz, .. }),
            ) if steps < MOST_STEPS => {
                let least = libm::ceil(needed_hz / frequency_hz / SAMPLES as f64);
                steps = least.max(2.0 * steps).min(MOST_STEPS);
            }
            course => return course.map_err(|source| AnalysisError::NotIntegrated { source }),
        }
    }
}

/// Integrates with so many steps between two samples.
fn integrated(forced: &Forced, frequency_hz: f64, state: &[f64], steps: f64) -> Result<Course, StepError> {
    let dofs: Vec<Dof> = forced.drives().iter().map(|(dof, _)| *dof).collect();
    let peaks: Vec<f64> = forced.drives().iter().map(|(_, share)| share * forced.amplitude()).collect();
    let n = forced.assembly().coordinates();
    let omega_rad_s = core::f64::consts::TAU * frequency_hz;
    let rate_hz = SAMPLES as f64 * steps * frequency_hz;
    let mut stepper = Stepper::new(forced.assembly(), &dofs, Scheme::Dop853, rate_hz)?;
    stepper.restore(state)?;
    let weighted = |position: &[f64], velocity: &[f64]| -> Vec<f64> {
        // A velocity over ω has the unit and the order of a displacement, so that both count in the distance.
        position.iter().copied().chain(velocity.iter().map(|v| v / omega_rad_s)).collect()
    };
    let start = weighted(&state[..n], &state[n..2 * n]);
    let size = libm::sqrt(dot(&start, &start)).max(f64::MIN_POSITIVE);
    let mut course = Course { coordinates: state[..n].to_vec(), distances: vec![] };
    for _ in 0..MOST_PERIODS {
        for step in 0..(SAMPLES * steps as usize) {
            let t_s = step as f64 / rate_hz;
            match stepper.advance_under(t_s, &forced.step_load(&peaks, omega_rad_s)) {
                // The state runs away: its first period is the best that there is.
                Err(StepError::Integrate(IntegrateError::NotFinite { .. })) if !course.distances.is_empty() => {
                    return Ok(course);
                }
                other => other?,
            }
            if (step + 1) % steps as usize == 0 {
                course.coordinates.extend_from_slice(stepper.position());
            }
        }
        let end = weighted(stepper.position(), stepper.velocity());
        let apart: Vec<f64> = end.iter().zip(&start).map(|(end, start)| end - start).collect();
        course.distances.push(libm::sqrt(dot(&apart, &apart)) / size);
        if course.returns() {
            break;
        }
    }
    Ok(course)
}

impl Course {
    /// Says whether the state has returned after the last period.
    fn returns(&self) -> bool {
        match self.distances[..] {
            [only] => only <= RETURNED,
            [first, .., last] => last <= RETURNED.min(NEARER * first),
            [] => false,
        }
    }

    /// The number of periods after which the response repeats; 1 if it returned after none.
    fn period(&self) -> usize {
        if self.returns() { self.distances.len() } else { 1 }
    }

    /// The Fourier series of the unknowns of a balance, without a jump from the end to the start.
    fn series(&self, balance: &Balance) -> Vec<f64> {
        let n = balance.forced.assembly().coordinates();
        let count = SAMPLES * balance.period();
        let m = balance.unknowns.count();
        let basis = Basis::uniform(count / 2 - 1, count);
        let orders = count / 2 - 1;
        let mut series = vec![0.0; m * (2 * orders + 1)];
        for i in 0..m {
            let unknown = |q: &[f64]| match &balance.unknowns.body {
                Body::Chain => q[i],
                Body::Condensed(condensed) => dot(&condensed.places[i], q),
            };
            let mut signal: Vec<f64> = self.coordinates.chunks_exact(n).take(count + 1).map(unknown).collect();
            let jump = signal[count] - signal[0];
            signal.truncate(count);
            signal.iter_mut().enumerate().for_each(|(j, value)| *value -= jump * j as f64 / count as f64);
            series[i] = signal.iter().sum::<f64>() / count as f64;
            for k in 1..=orders {
                let (cosine, sine) = basis.project(k - 1, &signal);
                series[(2 * k - 1) * m + i] = cosine;
                series[2 * k * m + i] = sine;
            }
        }
        series
    }
}

/// Returns how many harmonics of a series of m unknowns are not negligible.
fn needed_harmonics(series: &[f64], m: usize) -> usize {
    let whole = dot(series, series);
    let mut tail = 0.0;
    let pairs = series[m..].chunks_exact(2 * m);
    let orders = pairs.len();
    let negligible = pairs.rev().take_while(|pair| {
        tail += dot(pair, pair);
        tail <= NEGLECTED * NEGLECTED * whole
    });
    orders - negligible.count()
}
