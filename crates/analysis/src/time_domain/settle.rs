//! Follows a motion until it has settled, proved by the stroboscopic map.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::DVector;

use super::fixed_point::FixedPoint;
use super::map::{Strobe, size};
use super::measure::{UNSETTLED_PERIODS, measure};
use super::{StroboscopicMap, TimeDomainError};
use resonarm_dynamics::arm::State;

/// Longest period looked for, in periods of the excitation.
const LONGEST_PERIOD: u32 = 8;
/// Returns are checked after this fraction of the slowest time constant of the linear arm.
pub(super) const STRETCH: f64 = 0.25;
/// A motion that returns this near, relative to its size, has settled.
pub(super) const CLOSURE: f64 = 1e-9;
/// A motion of several periods is at least this many times as far from returning after one.
const FAR: f64 = 1e3;
/// The return after n periods must be this much nearer than the one after 1 to look for a motion of n periods.
const NEARER: f64 = 0.5;

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
    let followed = follow(map, start, options, stop)?;
    let measured = measure(map, &followed.start, followed.period.unwrap_or(UNSETTLED_PERIODS))?;
    Ok(Settled {
        period: followed.period,
        largest_multiplier: followed.largest_multiplier,
        settling_periods: followed.settling_periods,
        drift: followed.drift,
        amplitude_rad: measured.amplitude_rad,
        harmonic1_rad: measured.harmonic1_rad,
        section: if followed.period.is_some() { measured.section } else { followed.section },
        end: followed.end,
    })
}

/// The end of a transient, without measurements.
#[derive(Clone, Debug)]
pub(crate) struct Followed<S> {
    /// As [`Settled::period`].
    pub period: Option<u32>,
    /// As [`Settled::largest_multiplier`].
    pub largest_multiplier: Option<f64>,
    /// As [`Settled::settling_periods`].
    pub settling_periods: u64,
    /// As [`Settled::drift`].
    pub drift: f64,
    /// The state from which the motion is measured.
    pub start: S,
    /// Of a motion that doesn't settle, its section.
    pub section: Vec<S>,
    /// As [`Settled::end`].
    pub end: S,
}

/// Follows any forced system; see [`settle()`].
pub(crate) fn follow<M: Strobe>(
    map: &M,
    start: &M::State,
    options: &SettleOptions,
    stop: &dyn Fn() -> bool,
) -> Result<Followed<M::State>, TimeDomainError> {
    let wait = options.time_constants;
    if !(wait.is_finite() && wait > 0.0) {
        return Err(TimeDomainError::Option { name: "time_constants", got: wait });
    }
    let longest = libm::ceil(wait * map.time_constant_periods()) as u64;
    let stretch = (libm::ceil(STRETCH * map.time_constant_periods()) as u64).max(u64::from(LONGEST_PERIOD));
    let mut follower = Follower { map, trail: vec![map.to_point(start)], state: start.clone(), periods: 0, stop };
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
        } else if let Some(settled) = follower.returned(&before, waited) {
            return Ok(settled);
        }
    }
    follower.unsettled(options.section_points)
}

/// A motion being followed.
struct Follower<'a, M: Strobe> {
    map: &'a M,
    /// The last points of the section, the present one last.
    trail: Vec<DVector<f64>>,
    state: M::State,
    periods: u64,
    stop: &'a dyn Fn() -> bool,
}

impl<M: Strobe> Follower<'_, M> {
    fn point(&self) -> DVector<f64> {
        self.map.to_point(&self.state)
    }

    /// Plain integration.
    fn advance(&mut self, periods: u64) -> Result<(), TimeDomainError> {
        for period in 0..periods {
            if period % 64 == 0 && (self.stop)() {
                return Err(TimeDomainError::Stopped);
            }
            self.state = self.map.next(&self.state)?;
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
        (1..).zip(self.trail.iter().rev().skip(1)).map(move |(periods, past)| (periods, (&present - past).norm()))
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
    ) -> Result<Option<Followed<M::State>>, TimeDomainError> {
        let start = self.map.to_state(&found.point);
        self.state = start.clone();
        let unit = u64::from(found.period);
        self.advance(stretch.div_ceil(unit) * unit)?;
        let drift = found.distance(&self.point());
        Ok((drift <= CLOSURE).then(|| Followed {
            period: Some(found.period),
            largest_multiplier: Some(found.largest_multiplier),
            settling_periods,
            drift,
            start: start.clone(),
            section: vec![],
            end: start,
        }))
    }

    /// The present motion, if it may keep a constant and has come back to where it was a stretch before; of more than
    /// one period only if it is far from returning after one.
    fn returned(&self, before: &DVector<f64>, waited: u64) -> Option<Followed<M::State>> {
        let (present, near) = (self.point(), CLOSURE * size(before));
        let distance = (&present - before).norm();
        if !self.map.keeps_constants() || distance > near {
            return None;
        }
        let single = self.returns().next().map_or(f64::INFINITY, |(_, distance)| distance);
        let (period, _) = self.returns().find(|(_, distance)| *distance <= near)?;
        (period == 1 || single > FAR * near).then(|| Followed {
            period: Some(period),
            largest_multiplier: None,
            settling_periods: waited,
            drift: distance / size(before),
            start: self.state.clone(),
            section: vec![],
            end: self.state.clone(),
        })
    }

    /// The result for a motion that doesn't settle.
    fn unsettled(mut self, section_points: usize) -> Result<Followed<M::State>, TimeDomainError> {
        let settling_periods = self.periods;
        let nearest = self.returns().map(|(_, distance)| distance).fold(f64::INFINITY, f64::min);
        let (drift, start) = (nearest / size(&self.point()), self.state.clone());
        let mut section = Vec::with_capacity(section_points);
        for _ in 0..section_points {
            section.push(self.state.clone());
            self.advance(1)?;
        }
        let (period, largest_multiplier) = (None, None);
        Ok(Followed { period, largest_multiplier, settling_periods, drift, start, section, end: self.state })
    }
}
