//! The stable response that a state of a forced system reaches.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::error::TimeDomainError;
use super::fixed_point::{Approach, FixedPoint, Linearised, SAME_POINT};
use super::map::StroboscopicMap;
use super::settle::{CLOSURE, STRETCH};

/// The fate of an initial state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BasinOutcome {
    /// It reaches a stable response.
    Reaches {
        /// Index of the stable response.
        orbit: usize,
        /// Periods of the excitation until this was certain.
        periods: u64,
    },
    /// Within the wait it reaches none of the known stable responses.
    Undecided,
    /// It grows without bound.
    Diverges,
}

/// A stable response as fixed points of the map's power, one for each of its periods.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Attractor {
    period: u32,
    points: Vec<FixedPoint>,
}

impl Attractor {
    /// The response of a fixed point, with the states of its section, which begin there.
    pub fn new(map: &StroboscopicMap, found: &FixedPoint, section: &[Vec<f64>]) -> Attractor {
        let later = section.get(1..).unwrap_or_default().iter();
        let mut points = vec![found.clone()];
        points.extend(later.filter_map(|state| FixedPoint::shoot(map, &map.to_point(state), found.period)));
        Attractor { period: found.period, points }
    }

    /// Says whether a point is one of the response's.
    pub fn holds(&self, point: &DVector<f64>) -> bool {
        self.points.iter().any(|own| own.distance(point) <= SAME_POINT)
    }
}

/// Computes the fate of each state of any forced system; see [`outcomes`](super::outcomes).
pub(crate) fn fates(
    map: &StroboscopicMap,
    attractors: &[&Attractor],
    starts: &[Vec<f64>],
    time_constants: f64,
    stop: &dyn Fn() -> bool,
) -> Result<Vec<BasinOutcome>, TimeDomainError> {
    if !(time_constants.is_finite() && time_constants > 0.0) {
        return Err(TimeDomainError::Option { name: "time_constants", got: time_constants });
    }
    let longest = libm::ceil(time_constants * map.time_constant_periods()) as u64;
    let unit = attractors.iter().fold(1, |unit, orbit| least_common_multiple(unit, u64::from(orbit.period)));
    // A multiple of every period, so that each point of an attractor is met again after a stretch.
    let stretch = (libm::ceil(STRETCH * map.time_constant_periods()) as u64).max(1).div_ceil(unit) * unit;
    let targets: Vec<Target<'_>> =
        attractors.iter().enumerate().flat_map(|(k, orbit)| Target::of(k, orbit, stretch)).collect();
    let mut outcomes = vec![BasinOutcome::Undecided; starts.len()];
    let mut travellers: Vec<Traveller> = (0..starts.len()).map(|start| Traveller::new(start, targets.len())).collect();
    let mut states = starts.to_vec();
    let mut periods = 0;
    while periods < longest && !travellers.is_empty() {
        let before: Vec<DVector<f64>> = states.iter().map(|state| map.to_point(state)).collect();
        advance(map, &mut states, stretch, stop)?;
        periods += stretch;
        for ((state, before), traveller) in states.iter().zip(&before).zip(&mut travellers) {
            outcomes[traveller.start] = if StroboscopicMap::is_finite(state) {
                match traveller.reaches(&targets, before, &map.to_point(state)) {
                    Some(orbit) => BasinOutcome::Reaches { orbit, periods },
                    None => BasinOutcome::Undecided,
                }
            } else {
                BasinOutcome::Diverges
            };
        }
        // The others continue together.
        (travellers, states) = travellers
            .into_iter()
            .zip(states)
            .filter(|(traveller, _)| outcomes[traveller.start] == BasinOutcome::Undecided)
            .unzip();
    }
    Ok(outcomes)
}

/// A point of a stable response, with the linearisation there.
struct Target<'a> {
    orbit: usize,
    point: &'a FixedPoint,
    linearised: Linearised<'a>,
}

impl<'a> Target<'a> {
    /// Returns the points of a response; `stretch` is in periods of the excitation.
    fn of(orbit: usize, attractor: &'a Attractor, stretch: u64) -> impl Iterator<Item = Target<'a>> {
        let returns = stretch / u64::from(attractor.period);
        attractor.points.iter().map(move |point| Target { orbit, point, linearised: point.linearised(returns) })
    }
}

/// A trajectory on its way from an initial state.
struct Traveller {
    /// The index of its initial state.
    start: usize,
    /// Its approach to each target.
    approaches: Vec<Option<Approach>>,
}

impl Traveller {
    fn new(start: usize, targets: usize) -> Traveller {
        Traveller { start, approaches: vec![None; targets] }
    }

    /// Returns the response that the trajectory reaches, if that is certain after a stretch from `before` to `after`.
    fn reaches(&mut self, targets: &[Target<'_>], before: &DVector<f64>, after: &DVector<f64>) -> Option<usize> {
        for (approach, target) in self.approaches.iter_mut().zip(targets) {
            *approach = target.linearised.approach(*approach, before, after);
        }
        let arrived = |(approach, target): &(&Option<Approach>, &Target<'_>)| {
            target.point.distance(after) <= CLOSURE || approach.is_some_and(Approach::is_certain)
        };
        self.approaches.iter().zip(targets).find(arrived).map(|(_, target)| target.orbit)
    }
}

/// Integrates, checking regularly whether to stop.
fn advance(
    map: &StroboscopicMap,
    states: &mut [Vec<f64>],
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
        map.advance_all(states, now as u32)?;
        left -= now;
    }
    Ok(())
}

fn least_common_multiple(a: u64, b: u64) -> u64 {
    let mut divisor = a;
    let mut rest = b;
    while rest > 0 {
        (divisor, rest) = (rest, divisor % rest);
    }
    a / divisor * b
}
