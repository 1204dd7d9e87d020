//! Follows a motion until it has settled, proved by the stroboscopic map.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Vector4;

use super::fixed_point::{FixedPoint, size_rad};
use super::measure::measure;
use super::{StroboscopicMap, TimeDomainError};
use resonarm_dynamics::arm::State;

/// Longest period looked for, in periods of the excitation.
const LONGEST_PERIOD: u32 = 8;
/// Returns are checked after this fraction of the slowest time constant of the linear arm.
pub(super) const STRETCH: f64 = 0.25;
/// A motion that returns this near, relative to its size, has settled.
pub(super) const CLOSURE: f64 = 1e-9;
/// The return after n periods must be this much nearer than the one after 1 to look for a motion of n periods.
const NEARER: f64 = 0.5;
/// Periods over which an unsettled motion is measured.
pub(super) const UNSETTLED_PERIODS: u32 = 64;

/// How long to wait, and what to keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettleOptions {
    /// Longest wait, in time constants of the slowest mode of the linear arm; a motion that has not settled by then is
    /// unsettled. Positive.
    pub time_constants: f64,
    /// How many points of the section to keep of a motion that doesn't settle.
    pub section_points: usize,
}

impl Default for SettleOptions {
    /// 40 time constants, in which a linear transient falls to 4e-18 of itself, and 200 points.
    fn default() -> SettleOptions {
        SettleOptions { time_constants: 40.0, section_points: 200 }
    }
}

/// A motion after its transient.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    /// Periods of the excitation after which the motion repeats; `None` if it did not settle within the wait: it is
    /// quasi-periodic, chaotic, of a period longer than 8, or still transient.
    pub period: Option<u32>,
    /// Largest magnitude of the Floquet multipliers over the motion's period: below 1, the transients' slowest decay.
    pub largest_multiplier: Option<f64>,
    /// Periods of plain integration until the end of the transient was proved.
    pub settling_periods: u64,
    /// How far the motion is from its start, relative to its size, after a quarter of a time constant of plain
    /// integration; for an unsettled motion its nearest return.
    pub drift: f64,
    /// max |αᵢ(t)| over the motion's period, between the steps too; over 64 periods if it is unsettled. rad.
    pub amplitude_rad: [f64; 2],
    /// Amplitude of αᵢ at the frequency of the excitation, over the same time, rad.
    pub harmonic1_rad: [f64; 2],
    /// The states at phase 0 of the excitation: as many as the period has, or as many as the options keep if it is
    /// unsettled.
    pub section: Vec<State>,
    /// The state at phase 0 from which a sweep continues.
    pub end: State,
}

/// Follows the arm from `start`, at phase 0, to the end of its transient.
///
/// With damping ratios of 1e-4 a transient takes tens of thousands of periods. So after every quarter of a time
/// constant Newton's method looks for a motion that repeats near the present one, and the next quarter of plain
/// integration shows whether the present motion approaches it as its linearisation predicts, so that it can only end
/// there (see `FixedPoint::captures`). Only then is the transient cut short. If no such motion captures the arm, as
/// after a fold, the whole transient is integrated. At the end plain integration from the motion found must return to
/// it within 1e-9 of its size.
///
/// `stop` is called regularly; `true` ends the wait.
///
/// # Errors
/// [`TimeDomainError::Option`] if the wait is no positive number, [`TimeDomainError::Integrate`] if a step can't be
/// made, [`TimeDomainError::Stopped`] if `stop` said so.
pub fn settle(
    map: &StroboscopicMap,
    start: &State,
    options: &SettleOptions,
    stop: &dyn Fn() -> bool,
) -> Result<Settled, TimeDomainError> {
    let wait = options.time_constants;
    if !(wait.is_finite() && wait > 0.0) {
        return Err(TimeDomainError::Option { name: "time_constants", got: wait });
    }
    let longest = libm::ceil(wait * map.time_constant_periods()) as u64;
    let stretch = (libm::ceil(STRETCH * map.time_constant_periods()) as u64).max(u64::from(LONGEST_PERIOD));
    let mut follower = Follower { map, trail: vec![map.point(start)], state: *start, periods: 0, stop };
    while follower.periods < longest {
        let before = follower.point();
        let candidates = follower.candidates();
        let unit = candidates.iter().fold(1, |unit, found| unit.max(u64::from(found.period)));
        let length = stretch.div_ceil(unit) * unit;
        let waited = follower.periods;
        follower.advance(length)?;
        let after = follower.point();
        let found = candidates.iter().find(|found| {
            found.distance(&before) <= CLOSURE || found.captures(&before, &after, length / u64::from(found.period))
        });
        if let Some(found) = found {
            let settling_periods = if found.distance(&before) <= CLOSURE { waited } else { waited + length };
            if let Some(settled) = follower.confirm(found, stretch, settling_periods)? {
                return Ok(settled);
            }
        }
    }
    follower.unsettled(options.section_points)
}

/// A motion being followed.
struct Follower<'a> {
    map: &'a StroboscopicMap<'a>,
    /// The last points of the section, the present one last.
    trail: Vec<Vector4<f64>>,
    state: State,
    periods: u64,
    stop: &'a dyn Fn() -> bool,
}

impl Follower<'_> {
    fn point(&self) -> Vector4<f64> {
        self.map.point(&self.state)
    }

    /// Plain integration.
    fn advance(&mut self, periods: u64) -> Result<(), TimeDomainError> {
        for period in 0..periods {
            if period % 64 == 0 && (self.stop)() {
                return Err(TimeDomainError::Stopped);
            }
            self.state = self.map.advance(&self.state)?;
            if self.trail.len() > LONGEST_PERIOD as usize {
                self.trail.remove(0);
            }
            self.trail.push(self.point());
        }
        self.periods += periods;
        Ok(())
    }

    /// How far the present point is from that of n periods ago, for n from 1.
    fn returns(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        let present = self.point();
        (1..).zip(self.trail.iter().rev().skip(1)).map(move |(periods, past)| (periods, (present - past).norm()))
    }

    /// The periodic motions near the present one: of one period, and of the number of periods after which it returns
    /// nearest.
    fn candidates(&self) -> Vec<FixedPoint> {
        let mut periods = vec![1];
        let single = self.returns().next().map_or(0.0, |(_, distance)| distance);
        let nearest = self.returns().skip(1).min_by(|a, b| a.1.total_cmp(&b.1));
        periods.extend(nearest.filter(|(_, distance)| *distance < NEARER * single).map(|(periods, _)| periods));
        let present = self.point();
        periods.into_iter().filter_map(|periods| FixedPoint::shoot(self.map, &present, periods)).collect()
    }

    /// Continues by plain integration from the motion found: it has settled if it stays there.
    fn confirm(
        &mut self,
        found: &FixedPoint,
        stretch: u64,
        settling_periods: u64,
    ) -> Result<Option<Settled>, TimeDomainError> {
        let start = self.map.state(&found.point);
        self.state = start;
        let unit = u64::from(found.period);
        self.advance(stretch.div_ceil(unit) * unit)?;
        let drift = found.distance(&self.point());
        if drift > CLOSURE {
            return Ok(None);
        }
        let measured = measure(self.map, &start, found.period)?;
        Ok(Some(Settled {
            period: Some(found.period),
            largest_multiplier: Some(found.largest_multiplier),
            settling_periods,
            drift,
            amplitude_rad: measured.amplitude_rad,
            harmonic1_rad: measured.harmonic1_rad,
            section: measured.section,
            end: start,
        }))
    }

    /// The result for a motion that doesn't settle.
    fn unsettled(mut self, section_points: usize) -> Result<Settled, TimeDomainError> {
        let settling_periods = self.periods;
        let nearest = self.returns().map(|(_, distance)| distance).fold(f64::INFINITY, f64::min);
        let drift = nearest / size_rad(&self.point());
        let measured = measure(self.map, &self.state, UNSETTLED_PERIODS)?;
        let mut section = Vec::with_capacity(section_points);
        for _ in 0..section_points {
            section.push(self.state);
            self.advance(1)?;
        }
        let (amplitude_rad, harmonic1_rad) = (measured.amplitude_rad, measured.harmonic1_rad);
        Ok(Settled {
            period: None,
            largest_multiplier: None,
            settling_periods,
            drift,
            amplitude_rad,
            harmonic1_rad,
            section,
            end: self.state,
        })
    }
}
