//! The point of a branch that is nearest to a measured response.

use crate::orbit::Orbit;

/// Relative deviations that count as equal distances in a search for the nearest point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distances {
    /// Relative deviation of the frequency.
    pub frequency: f64,
    /// Relative deviation of the amplitude.
    pub amplitude: f64,
}

impl Default for Distances {
    /// 2e-5 of the frequency and 1e-3 of the amplitude: the accuracy of a closed loop on the bench.
    fn default() -> Distances {
        Distances { frequency: 2e-5, amplitude: 1e-3 }
    }
}

/// The point of a curve that is nearest to the origin.
pub(crate) struct Foot<'a, T> {
    /// Distance of that point from the origin.
    pub distance: f64,
    /// Position between the two neighbours, as a share of the way from the first to the second.
    pub share: f64,
    /// The neighbours of that point on the curve.
    pub pair: [&'a T; 2],
}

/// Returns the point nearest to the origin on the polygon through the points of `all`; `None` if there are fewer than
/// two.
///
/// With p the vector to a point and d that to the next from there, the foot of the perpendicular is at −p·d/d·d of the
/// way, between 0 and 1.
pub(crate) fn foot<T>(all: &[T], place: impl Fn(&T) -> [f64; 2]) -> Option<Foot<'_, T>> {
    let mut best: Option<Foot<'_, T>> = None;
    for pair in all.windows(2) {
        let [x0, y0] = place(&pair[0]);
        let [x1, y1] = place(&pair[1]);
        let dx = x1 - x0;
        let dy = y1 - y0;
        let square = dx * dx + dy * dy;
        let share = if square > 0.0 { (-(x0 * dx + y0 * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
        let distance = libm::hypot(x0 + share * dx, y0 + share * dy);
        if best.as_ref().is_none_or(|best| distance < best.distance) {
            best = Some(Foot { distance, share, pair: [&pair[0], &pair[1]] });
        }
    }
    best
}

/// The point of a branch that is nearest to a measured response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Measured over computed frequency, less 1.
    pub frequency_deviation: f64,
    /// Measured over computed amplitude of the fundamental, less 1.
    pub amplitude_deviation: f64,
    /// The phase of the fundamental there, by which it leads the drive, rad.
    pub phase_rad: f64,
    /// Whether the computed response is stable, as [`Orbit::is_stable`].
    pub is_stable: Option<bool>,
}

/// Returns the point nearest to a response measured at `frequency_hz` with the amplitude `amplitude` of the fundamental
/// of the branch's reading number `reading`, in units of `distances`; `None` if the branch has fewer than two points or
/// no such reading. Between two points the fundamental is taken as straight.
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
    // The phase is that of the chord between the two phasors, but the amplitude that between their lengths: where the
    // phases differ, the chord comes nearer to zero than the response does.
    Some(Nearest {
        frequency_deviation: frequency_hz / there_hz - 1.0,
        amplitude_deviation: amplitude / (size(first) + share * (size(second) - size(first))) - 1.0,
        phase_rad: libm::atan2(there.im, there.re),
        is_stable: first.is_stable(),
    })
}
