//! The motion of a branch that is nearest to a measured one.

use super::{Branch, Orbit};

/// A measured motion: frequency of the excitation, and amplitudes of α1 and α2 at that frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredMotion {
    /// Hz.
    pub frequency_hz: f64,
    /// √(a² + b²) of α1 and α2, rad.
    pub harmonic1_rad: [f64; 2],
}

/// Relative deviations that count as equal distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distances {
    /// That of the frequency.
    pub frequency: f64,
    /// That of the amplitude.
    pub amplitude: f64,
}

impl Default for Distances {
    /// 2e-5 of the frequency and 1e-3 of the amplitude: the accuracy of a closed loop on the bench.
    fn default() -> Distances {
        Distances { frequency: 2e-5, amplitude: 1e-3 }
    }
}

/// The place of a branch that is nearest to a measured motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The motion there.
    pub motion: MeasuredMotion,
    /// Whether the computed motion is stable.
    pub is_stable: bool,
    /// Measured over computed frequency, less 1.
    pub frequency_deviation: f64,
    /// Measured over computed amplitudes, less 1.
    pub amplitude_deviation: [f64; 2],
    /// The distance in units of [`Distances`].
    pub distance: f64,
}

/// The place of the branch nearest to a measured motion by frequency and the amplitude of one joint (0 or 1), in units
/// of `distances`; `None` for a branch of fewer than two motions.
/// Between two motions the curve is taken as straight.
pub fn nearest(branch: &Branch, measured: &MeasuredMotion, joint: usize, distances: Distances) -> Option<Nearest> {
    let place = |orbit: &Orbit| {
        let frequency = (orbit.frequency_hz / measured.frequency_hz - 1.0) / distances.frequency;
        let amplitude = (orbit.harmonic1_rad[joint] / measured.harmonic1_rad[joint] - 1.0) / distances.amplitude;
        [frequency, amplitude]
    };
    let Foot { distance, share, pair } = foot(&branch.orbits, place)?;
    let between = |of: &dyn Fn(&Orbit) -> f64| of(pair[0]) + share * (of(pair[1]) - of(pair[0]));
    let frequency_hz = between(&|orbit| orbit.frequency_hz);
    let harmonic1_rad = [0, 1].map(|joint| between(&|orbit| orbit.harmonic1_rad[joint]));
    Some(Nearest {
        motion: MeasuredMotion { frequency_hz, harmonic1_rad },
        is_stable: pair[0].is_stable(),
        frequency_deviation: measured.frequency_hz / frequency_hz - 1.0,
        amplitude_deviation: [0, 1].map(|joint| measured.harmonic1_rad[joint] / harmonic1_rad[joint] - 1.0),
        distance,
    })
}

/// The place of a curve that is nearest to the origin.
pub(crate) struct Foot<'a, T> {
    /// Its distance.
    pub distance: f64,
    /// Between two neighbours, this share of the way from the first to the second.
    pub share: f64,
    /// The neighbours.
    pub pair: [&'a T; 2],
}

/// The place nearest to the origin of the polygon through the places of `all`; `None` if there are fewer than two.
///
/// With p the vector to a place and d that to the next from there, the foot of the perpendicular is at −p·d/d·d of the
/// way, between 0 and 1.
pub(crate) fn foot<T>(all: &[T], place: impl Fn(&T) -> [f64; 2]) -> Option<Foot<'_, T>> {
    let mut best: Option<Foot<'_, T>> = None;
    for pair in all.windows(2) {
        let ([x0, y0], [x1, y1]) = (place(&pair[0]), place(&pair[1]));
        let (dx, dy) = (x1 - x0, y1 - y0);
        let square = dx * dx + dy * dy;
        let share = if square > 0.0 { (-(x0 * dx + y0 * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
        let distance = libm::hypot(x0 + share * dx, y0 + share * dy);
        if best.as_ref().is_none_or(|best| distance < best.distance) {
            best = Some(Foot { distance, share, pair: [&pair[0], &pair[1]] });
        }
    }
    best
}
