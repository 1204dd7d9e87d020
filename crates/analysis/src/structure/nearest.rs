//! The place of a structure's branch that is nearest to a measured motion.

use super::Orbit;
use crate::Distances;
use crate::nearest::{Foot, foot};

/// The place of a branch that is nearest to a measured motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Measured over computed frequency, less 1.
    pub frequency_deviation: f64,
    /// Measured over computed amplitude of the fundamental, less 1.
    pub amplitude_deviation: f64,
    /// The phase of the fundamental there, by which it leads the drive, rad.
    pub phase_rad: f64,
    /// Whether the computed motion is stable, as [`Orbit::is_stable`].
    pub is_stable: Option<bool>,
}

/// The place nearest to a motion measured at `frequency_hz` with the amplitude `amplitude` of the fundamental of the
/// branch's reading number `reading`, in units of `distances`; `None` if the branch has fewer than two motions or no
/// such reading. Between two motions the fundamental is taken as straight.
pub fn nearest(
    orbits: &[Orbit],
    reading: usize,
    [frequency_hz, amplitude]: [f64; 2],
    distances: Distances,
) -> Option<Nearest> {
    let size = |orbit: &Orbit| {
        orbit.readings.get(reading).map_or(f64::NAN, |of| libm::hypot(of.harmonic1.re, of.harmonic1.im))
    };
    let place = |orbit: &Orbit| {
        let frequency = (orbit.frequency_hz / frequency_hz - 1.0) / distances.frequency;
        [frequency, (size(orbit) / amplitude - 1.0) / distances.amplitude]
    };
    let Foot { share, pair: [first, second], .. } = foot(orbits, place)?;
    let harmonic1 = [first, second].map(|orbit| orbit.readings.get(reading).map(|reading| reading.harmonic1));
    let [Some(from), Some(to)] = harmonic1 else { return None };
    let there = from + (to - from) * share;
    let there_hz = first.frequency_hz + share * (second.frequency_hz - first.frequency_hz);
    Some(Nearest {
        frequency_deviation: frequency_hz / there_hz - 1.0,
        amplitude_deviation: amplitude / (size(first) + share * (size(second) - size(first))) - 1.0,
        phase_rad: libm::atan2(there.im, there.re),
        is_stable: first.is_stable(),
    })
}
