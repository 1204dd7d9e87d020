//! Follows a trajectory until it has settled, proved by the stroboscopic map.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::DVector;

use super::error::TimeDomainError;
use super::fixed_point::{Approach, FixedPoint};
use super::map::{StroboscopicMap, size};

/// Longest period looked for, in periods of the excitation.
const LONGEST_PERIOD: usize = 12;
/// The fewest periods between two checks.
const LEAST_STRETCH: u64 = 8;
/// Returns are checked after this fraction of the slowest time constant of the linear structure.
pub(super) const STRETCH: f64 = 0.25;
/// A response that returns this near, relative to its size, has settled.
pub(super) const CLOSURE: f64 = 1e-9;
/// A response of several periods is at least this many times as far from returning after one.
const FAR: f64 = 1e3;
/// The return after n periods must be this much nearer than the one after 1 to look for a response of n periods.
const NEARER: f64 = 0.5;

/// The options of a search for a settled response: its longest time, and the points that it keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettleOptions {
    /// Longest wait, in time constants of the slowest mode of the linear structure; a response that has not settled by
    /// then is unsettled. Positive.
    pub time_constants: f64,
    /// The number of points of the section to keep of a response that doesn't settle.
    pub section_points: usize,
}

impl Default for SettleOptions {
    /// 40 time constants, in which a linear transient falls to 4e-18 of itself, and 200 points.
    fn default() -> SettleOptions {
        SettleOptions { time_constants: 40.0, section_points: 200 }
    }
}

/// The end of a transient, without measurements.
#[derive(Clone, Debug)]
pub(crate) struct Followed {
    /// The same as [`Settled::period`](crate::time_domain::Settled::period).
    pub period: Option<u32>,
    /// The same as [`Settled::largest_multiplier`](crate::time_domain::Settled::largest_multiplier).
    pub largest_multiplier: Option<f64>,
    /// The same as [`Settled::settling_periods`](crate::time_domain::Settled::settling_periods).
    pub settling_periods: u64,
    /// The same as [`Settled::drift`](crate::time_domain::Settled::drift).
    pub drift: f64,
    /// The state from which the response is measured.
    pub start: Vec<f64>,
    /// The section of a response that doesn't settle.
    pub section: Vec<Vec<f64>>,
    /// The same as [`Settled::end`](crate::time_domain::Settled::end).
    pub end: Vec<f64>,
}

/// Follows any forced system; see [`settle()`](crate::time_domain::settle()).
pub(crate) fn follow(
    map: &StroboscopicMap,
    start: &[f64],
    options: &SettleOptions,
    stop: &dyn Fn() -> bool,
) -> Result<Followed, TimeDomainError> {
    let wait = options.time_constants;
    if !(wait.is_finite() && wait > 0.0) {
        return Err(TimeDomainError::Option { name: "time_constants", got: wait });
    }
    let longest = libm::ceil(wait * map.time_constant_periods()) as u64;
    let stretch = (libm::ceil(STRETCH * map.time_constant_periods()) as u64).max(LEAST_STRETCH);
    let mut follower = Follower { map, trail: vec![map.to_point(start)], state: start.to_vec(), periods: 0, stop };
    let mut candidates: Vec<Candidate> = vec![];
    while follower.periods < longest {
        let before = follower.point();
        // Newton's method is costly: candidates are kept as long as the trajectory approaches them.
        if candidates.is_empty() {
            candidates = follower.candidates();
        }
        let unit = candidates.iter().fold(1, |unit, candidate| unit.max(u64::from(candidate.point.period)));
        // A whole number of returns to each candidate: at most one of them has more than one period.
        let length = stretch.div_ceil(unit) * unit;
        let waited = follower.periods;
        follower.advance(length)?;
        let after = follower.point();
        candidates.retain_mut(|candidate| candidate.is_still_one(&before, &after, length));
        if let Some(found) = candidates.iter().find(|candidate| candidate.is_certain(&before)) {
            let settling_periods = if found.holds(&before) { waited } else { waited + length };
            if let Some(settled) = follower.confirm(&found.point, stretch, settling_periods)? {
                return Ok(settled);
            }
            candidates.clear();
        } else if let Some(settled) = follower.returned(&before, waited) {
            return Ok(settled);
        }
    }
    follower.unsettled(options.section_points)
}

/// A periodic response in which the present trajectory may end.
struct Candidate {
    point: FixedPoint,
    approach: Option<Approach>,
}

impl Candidate {
    /// Says whether a point is within the closure of a settled response.
    fn holds(&self, point: &DVector<f64>) -> bool {
        self.point.distance(point) <= CLOSURE
    }

    /// Says whether the present trajectory, after a stretch of `length` periods, still approaches this response or has
    /// reached it.
    fn is_still_one(&mut self, before: &DVector<f64>, after: &DVector<f64>, length: u64) -> bool {
        let linearised = self.point.linearised(length / u64::from(self.point.period));
        self.approach = linearised.approach(self.approach, before, after);
        self.approach.is_some() || self.holds(before)
    }

    /// Says whether the present trajectory, which was at `before` a stretch ago, can only end in this response.
    fn is_certain(&self, before: &DVector<f64>) -> bool {
        self.holds(before) || self.approach.is_some_and(Approach::is_certain)
    }
}

/// A trajectory being followed.
struct Follower<'a> {
    map: &'a StroboscopicMap,
    /// The last points of the section, the present one last.
    trail: Vec<DVector<f64>>,
    state: Vec<f64>,
    periods: u64,
    stop: &'a dyn Fn() -> bool,
}

impl Follower<'_> {
    fn point(&self) -> DVector<f64> {
        self.map.to_point(&self.state)
    }

    /// Integrates the trajectory over some periods and keeps its last points.
    fn advance(&mut self, periods: u64) -> Result<(), TimeDomainError> {
        for period in 0..periods {
            if period % 64 == 0 && (self.stop)() {
                return Err(TimeDomainError::Stopped);
            }
            self.state = self.map.advance(&self.state)?;
            if self.trail.len() > LONGEST_PERIOD {
                // The trail has a few points, so that moving them costs nothing beside a period of integration.
                self.trail.remove(0);
            }
            self.trail.push(self.point());
        }
        self.periods += periods;
        Ok(())
    }

    /// Returns the distance of the present point from that of n periods ago, for n from 1.
    fn returns(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        let present = self.point();
        (1..).zip(self.trail.iter().rev().skip(1)).map(move |(periods, past)| (periods, (&present - past).norm()))
    }

    /// Returns the periodic responses near the present point: of one period, and of the number of periods after which
    /// it returns nearest.
    fn candidates(&self) -> Vec<Candidate> {
        let mut periods = vec![1];
        let single = self.returns().next().map_or(0.0, |(_, distance)| distance);
        let nearest = self.returns().skip(1).min_by(|a, b| a.1.total_cmp(&b.1));
        periods.extend(nearest.filter(|(_, distance)| *distance < NEARER * single).map(|(periods, _)| periods));
        let present = self.point();
        let points = periods.into_iter().filter_map(|periods| FixedPoint::shoot(self.map, &present, periods));
        points.map(|point| Candidate { point, approach: None }).collect()
    }

    /// Continues by plain integration from the response found: it has settled if it stays there.
    fn confirm(
        &mut self,
        found: &FixedPoint,
        stretch: u64,
        settling_periods: u64,
    ) -> Result<Option<Followed>, TimeDomainError> {
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

    /// Returns the present response, if it may keep a constant and has come back to where it was a stretch before; one
    /// of more than one period only if it is far from returning after one.
    fn returned(&self, before: &DVector<f64>, waited: u64) -> Option<Followed> {
        let present = self.point();
        let near = CLOSURE * size(before);
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

    /// Returns the result for a response that doesn't settle.
    fn unsettled(mut self, section_points: usize) -> Result<Followed, TimeDomainError> {
        let settling_periods = self.periods;
        let nearest = self.returns().map(|(_, distance)| distance).fold(f64::INFINITY, f64::min);
        let drift = nearest / size(&self.point());
        let start = self.state.clone();
        let mut section = Vec::with_capacity(section_points);
        for _ in 0..section_points {
            section.push(self.state.clone());
            self.advance(1)?;
        }
        let period = None;
        let largest_multiplier = None;
        Ok(Followed { period, largest_multiplier, settling_periods, drift, start, section, end: self.state })
    }
}
