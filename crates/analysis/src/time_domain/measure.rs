//! Settled responses of a structure, and their readings.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_dynamics::structure::{Dof, StepError, Stepper};

use super::error::TimeDomainError;
use super::map::StroboscopicMap;
use super::settle::{SettleOptions, follow};
use crate::orbit::Reading;

/// Periods over which an unsettled response is measured.
const UNSETTLED_PERIODS: u32 = 64;
/// Bisections of a step to locate the turning point in it.
const BISECTIONS: usize = 40;

/// A response after its transient.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    /// Periods of the drive after which the response repeats; `None` if it did not settle within the wait: it is
    /// quasi-periodic, chaotic, of a period longer than 8, or still transient.
    pub period: Option<u32>,
    /// Largest magnitude of the Floquet multipliers over the response's period. Also `None` for a response that keeps a
    /// constant, as the state of friction that sticks.
    pub largest_multiplier: Option<f64>,
    /// Periods of plain integration until the end of the transient was proved.
    pub settling_periods: u64,
    /// Distance of the response from its start, relative to its size, after a quarter of a time constant of plain
    /// integration; for an unsettled response its nearest return.
    pub drift: f64,
    /// The coordinates over the response's period, over 64 periods if it is unsettled; rad, or m·√kg.
    pub coordinates: Vec<Reading>,
    /// The degrees of freedom that are read, likewise; m or rad.
    pub readings: Vec<Reading>,
    /// The states at phase 0 of the drive, coordinates, rates, states of elements: as many as the period has, or as
    /// many as the options keep if it is unsettled.
    pub section: Vec<Vec<f64>>,
    /// The state at phase 0 from which a sweep continues.
    pub end: Vec<f64>,
}

/// Follows a structure from `start`, at phase 0, to the end of its transient.
/// With damping ratios of 1e-4 a transient takes tens of thousands of periods. So after every quarter of a time
/// constant Newton's method looks for a periodic response near the present state. The transient is cut short once plain
/// integration has approached that response as its linearisation predicts, near it to within 1 % of the decay or until
/// the deviation has halved, so that it can only end there (see `Approach::is_certain`). If it approaches no such
/// response, as after a fold, the whole transient is integrated. At the end plain integration from the response found
/// must return to it within 1e-9 of its size.
///
/// A response that keeps a constant has settled where it returns to within 1e-9 of its size after a quarter of a time
/// constant.
///
/// `stop` is called regularly; `true` ends the wait.
///
/// # Errors
/// [`TimeDomainError::Option`] if the wait is no positive number, [`TimeDomainError::Step`] if a step can't be made,
/// [`TimeDomainError::Stopped`] if `stop` returned `true`.
pub fn settle(
    map: &StroboscopicMap,
    read: &[Dof],
    start: &[f64],
    options: &SettleOptions,
    stop: &dyn Fn() -> bool,
) -> Result<Settled, TimeDomainError> {
    let followed = follow(map, start, options, stop)?;
    let measured = measure(map, read, &followed.start, followed.period.unwrap_or(UNSETTLED_PERIODS))?;
    Ok(Settled {
        period: followed.period,
        largest_multiplier: followed.largest_multiplier,
        settling_periods: followed.settling_periods,
        drift: followed.drift,
        coordinates: measured.coordinates,
        readings: measured.readings,
        section: if followed.period.is_some() { measured.section } else { followed.section },
        end: followed.end,
    })
}

/// The measurements of a response.
pub(super) struct Measured {
    pub coordinates: Vec<Reading>,
    pub readings: Vec<Reading>,
    /// The states at phase 0.
    pub section: Vec<Vec<f64>>,
}

/// A displacement, its rate and its acceleration.
type Motion = [f64; 3];

/// Sums over a response for one displacement.
#[derive(Clone, Debug, Default)]
struct Sums {
    mean: f64,
    harmonic: Complex<f64>,
    largest: f64,
    last: Option<Motion>,
}

impl Sums {
    fn add(&mut self, motion: Motion, phase: Complex<f64>, step_s: f64) {
        self.mean += motion[0];
        self.harmonic += phase * motion[0];
        self.turn(motion, step_s);
    }

    /// Updates the largest displacement with a step: its end or, if the displacement turned, the turning point in it.
    fn turn(&mut self, motion: Motion, step_s: f64) {
        self.largest = self.largest.max(libm::fabs(motion[0]));
        if let Some(last) = self.last.filter(|last| last[1] * motion[1] < 0.0) {
            self.largest = self.largest.max(peak([last, motion], step_s));
        }
        self.last = Some(motion);
    }

    /// With c = 2/N Σ x e^(−iΩt), i·c is the component that leads the drive by its argument. The rectangle rule over
    /// whole periods is exact but for the harmonics from the steps in a period on.
    fn reading(&self, samples: f64) -> Reading {
        let harmonic1 = Complex::new(-self.harmonic.im, self.harmonic.re) * (2.0 / samples);
        Reading { largest: self.largest, mean: self.mean / samples, harmonic1 }
    }
}

/// Returns |x| where ẋ = 0 in a step, by the quintic with x, ẋ and ẍ at both ends (C. Hermite, 1878): its error is
/// (h⁶/46080) x⁽⁶⁾ at most, 4e-10 of a sine of 40 steps a period.
fn peak([start, end]: [Motion; 2], step_s: f64) -> f64 {
    let h = step_s;
    // In s = t/h: x = Σ cₖ sᵏ.
    let [x0, v0, a0] = [start[0], h * start[1], h * h * start[2]];
    let [x1, v1, a1] = [end[0], h * end[1], h * h * end[2]];
    let dx = x1 - x0 - v0 - 0.5 * a0;
    let dv = v1 - v0 - a0;
    let da = a1 - a0;
    let c =
        [x0, v0, 0.5 * a0, 10.0 * dx - 4.0 * dv + 0.5 * da, -15.0 * dx + 7.0 * dv - da, 6.0 * dx - 3.0 * dv + 0.5 * da];
    // Horner's scheme for Σ k cₖ sᵏ⁻¹.
    let rate = |s: f64| (1..6).rev().fold(0.0, |sum, k| sum * s + k as f64 * c[k]);
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        // Before the turn the rate still has the sign that it has at the start.
        if (rate(middle) > 0.0) == (v0 > 0.0) {
            low = middle;
        } else {
            high = middle;
        }
    }
    let s = 0.5 * (low + high);
    libm::fabs(c.iter().rev().fold(0.0, |sum, c| sum * s + c))
}

/// Returns the coordinates, then the degrees of freedom that are read, at a state.
fn motions(structure: &Stepper, read: &[Dof], load: f64, out: &mut [Motion]) -> Result<(), StepError> {
    let q = structure.position();
    let v = structure.velocity();
    let mut a = vec![0.0; q.len()];
    structure.acceleration(&[load], &mut a)?;
    let (coordinates, dofs) = out.split_at_mut(q.len());
    for (i, motion) in coordinates.iter_mut().enumerate() {
        *motion = [q[i], v[i], a[i]];
    }
    let at = structure.assembly().at(q);
    for (motion, dof) in dofs.iter_mut().zip(read) {
        *motion = [at.displacement(*dof), at.velocity(*dof, v), at.acceleration(*dof, v, &a)];
    }
    Ok(())
}

/// Measures `periods` periods from `start`, at phase 0.
pub(super) fn measure(
    map: &StroboscopicMap,
    read: &[Dof],
    start: &[f64],
    periods: u32,
) -> Result<Measured, TimeDomainError> {
    let n = map.forced().assembly().coordinates();
    let mut sums = vec![Sums::default(); n + read.len()];
    let mut at = vec![[0.0; 3]; n + read.len()];
    let mut state = start.to_vec();
    let mut section = Vec::with_capacity(periods as usize);
    let step_s = 1.0 / (map.frequency_hz() * f64::from(map.steps_per_period()));
    for _ in 0..periods {
        section.push(state.clone());
        let reached = map.visit(&state, |step, structure| {
            motions(structure, read, map.load(step), &mut at)?;
            let (sine, cosine) = libm::sincos(TAU * f64::from(step) / f64::from(map.steps_per_period()));
            sums.iter_mut().zip(&at).for_each(|(sums, at)| sums.add(*at, Complex::new(cosine, -sine), step_s));
            Ok(())
        });
        state = match reached {
            Err(TimeDomainError::Step { source: StepError::TooStiff { needed_hz, .. }, .. }) => {
                // The measurement begins anew, so that all of its sums have one length of step.
                return measure(&map.finer(needed_hz)?, read, start, periods);
            }
            reached => reached?,
        };
    }
    // The last step ends where the next period begins.
    let first = |step: u32, structure: &Stepper| {
        if step == 0 { motions(structure, read, map.load(0), &mut at) } else { Ok(()) }
    };
    map.visit(&state, first)?;
    sums.iter_mut().zip(&at).for_each(|(sums, at)| sums.turn(*at, step_s));
    let samples = f64::from(periods) * f64::from(map.steps_per_period());
    let mut coordinates: Vec<Reading> = sums.iter().map(|sums| sums.reading(samples)).collect();
    let readings = coordinates.split_off(n);
    Ok(Measured { coordinates, readings, section })
}
