//! Which stable motion a state of a forced system reaches.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::TimeDomainError;
use super::fixed_point::{FixedPoint, SAME_POINT};
use super::map::Strobe;
use super::settle::{CLOSURE, STRETCH};

/// The fate of an initial state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BasinOutcome {
    /// It reaches a stable motion.
    Reaches {
        /// Its index.
        motion: usize,
        /// Periods of the excitation until this was certain.
        periods: u64,
    },
    /// Within the wait it reaches none of the known stable motions.
    Undecided,
    /// It grows without bound.
    Diverges,
}

/// A stable motion as fixed points of the map's power, one for each of its periods.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Attractor {
    period: u32,
    points: Vec<FixedPoint>,
}

impl Attractor {
    /// The motion of a fixed point, with the states of its section, which begin there.
    pub fn new<M: Strobe>(map: &M, found: &FixedPoint, section: &[M::State]) -> Attractor {
        let later = section.get(1..).unwrap_or_default().iter();
        let mut points = vec![found.clone()];
        points.extend(later.filter_map(|state| FixedPoint::shoot(map, &map.to_point(state), found.period)));
        Attractor { period: found.period, points }
    }

    /// Whether a point is one of the motion's.
    pub fn holds(&self, point: &DVector<f64>) -> bool {
        self.points.iter().any(|own| own.distance(point) <= SAME_POINT)
    }

    /// Whether a motion that went from `before` to `after` in so many periods of the excitation ends here.
    fn captures(&self, before: &DVector<f64>, after: &DVector<f64>, periods: u64) -> bool {
        let returns = periods / u64::from(self.period);
        let near = |point: &FixedPoint| point.distance(after) <= CLOSURE || point.captures(before, after, returns);
        self.points.iter().any(near)
    }
}

/// The fate of each state of any forced system; see [`outcomes`](super::outcomes).
pub(crate) fn fates<M: Strobe>(
    map: &M,
    attractors: &[&Attractor],
    starts: &[M::State],
    time_constants: f64,
    stop: &dyn Fn() -> bool,
) -> Result<Vec<BasinOutcome>, TimeDomainError> {
    if !(time_constants.is_finite() && time_constants > 0.0) {
        return Err(TimeDomainError::Option { name: "time_constants", got: time_constants });
    }
    let longest = libm::ceil(time_constants * map.time_constant_periods()) as u64;
    let unit = attractors.iter().fold(1, |unit, motion| least_common_multiple(unit, u64::from(motion.period)));
    let stretch = (libm::ceil(STRETCH * map.time_constant_periods()) as u64).max(1).div_ceil(unit) * unit;
    let mut outcomes = vec![BasinOutcome::Undecided; starts.len()];
    let mut left: Vec<usize> = (0..starts.len()).collect();
    let mut states = starts.to_vec();
    let mut periods = 0;
    while periods < longest && !left.is_empty() {
        let before: Vec<DVector<f64>> = states.iter().map(|state| map.to_point(state)).collect();
        advance(map, &mut states, stretch, stop)?;
        periods += stretch;
        for (slot, state) in states.iter().enumerate() {
            let after = map.to_point(state);
            outcomes[left[slot]] = if !M::is_finite(state) {
                BasinOutcome::Diverges
            } else if let Some(motion) =
                attractors.iter().position(|motion| motion.captures(&before[slot], &after, stretch))
            {
                BasinOutcome::Reaches { motion, periods }
            } else {
                BasinOutcome::Undecided
            };
        }
        // The others continue together.
        let is_undecided = |slot: &usize| outcomes[left[*slot]] == BasinOutcome::Undecided;
        let slots: Vec<usize> = (0..left.len()).filter(is_undecided).collect();
        (left, states) = slots.into_iter().map(|slot| (left[slot], states[slot].clone())).unzip();
    }
    Ok(outcomes)
}

/// Integrates, checking regularly whether to stop.
fn advance<M: Strobe>(
    map: &M,
    states: &mut [M::State],
    periods: u64,
    stop: &dyn Fn() -> bool,
) -> Result<(), TimeDomainError> {
    const AT_ONCE: u64 = 64;
    let mut left = periods;
    while left > 0 {
        if stop() {
            return Err(TimeDomainError::Stopped);
        }
        let now = left.min(AT_ONCE);
        map.advance_together(states, now as u32)?;
        left -= now;
    }
    Ok(())
}

fn least_common_multiple(a: u64, b: u64) -> u64 {
    let (mut divisor, mut rest) = (a, b);
    while rest > 0 {
        (divisor, rest) = (rest, divisor % rest);
    }
    a / divisor * b
}
