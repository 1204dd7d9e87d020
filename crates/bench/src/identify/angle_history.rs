//! Angles of the joints over time from the accelerometers' readings, by double integration and inverse
//! kinematics.
//!
//! The paper finds the angles of the measured motion in the same way: "the acceleration signals were integrated twice
//! to obtain the point displacements, and then the angular displacements of the links were calculated using the
//! kinematics equations" (P. Gierlak, J. Warmiński, "Analysis of Bifurcation Vibrations of an Industrial Robot Arm
//! System with Joints Compliance", *Appl. Sci.* 2023, 13, 11941).
//!
//! A link of length l that turns by θ moves its end, against its start, by l sin θ across its rest position and by −l
//! (1 − cos θ) along it. With g the high-pass of the [double integration](super::Integration) and d its displacement,
//! the component across is
//!
//! ```text
//! d·t/l = g[sin θ]     so that, as g[θ] = θ,     θ = d·t/l + g[θ − sin θ]
//! ```
//!
//! t the unit vector across. Each round gains a factor of θ²/2. Link 1 ends at B and has turned by α1; link 2 goes from
//! there to C and has turned by α1 + α2. A mean θ0, which no accelerometer shows, matters only in θ0²; therefore the
//! component along a link, where it matters in θ0, is not used. That component, g[l (1 − cos θ)], shows whether the
//! readings are those of two rigid links.

use alloc::vec::Vec;

use nalgebra::Vector2;

use super::double_integration::{Integration, Integrator, Pair};
use super::droop::without_droop;
use super::error::IdentifyError;
use crate::rig::{Converter, RigSpec};

/// Number of accelerations: B along x and y, C along x and y.
pub const CHANNELS: usize = 4;

/// Length of each end, in periods of the corner; the effects of the record's ends have then fallen to about
/// 1e-5.
const END_PERIODS: f64 = 4.0;
/// Largest angle of a vibration, rad. The iteration converges well below π/2.
const LARGEST_RAD: f64 = 1.0;
/// Change of an angle, rad, below which the iteration ends, at the latest after [`MOST_ROUNDS`], enough for a
/// factor of 1/2.
const CHANGE_RAD: f64 = 1e-13;
const MOST_ROUNDS: usize = 40;

/// Settings for angles from accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleSettings {
    /// Method of double integration.
    pub integration: Integration,
    /// Lower corner f0, Hz, above 0 and below half the sample rate. A vibration at f has the gain 1 − (1 +
    /// (f/f0)⁴)⁻³: 0.875 at f0, 0.9998 at twice f0.
    pub from_hz: f64,
    /// Whether the arm was at rest before the first reading, and the accelerometers read no gravity. Then the
    /// beginning has angles, too.
    pub starts_at_rest: bool,
}

/// Angles of the joints over a part of a record.
#[derive(Clone, Debug, PartialEq)]
pub struct AngleHistory {
    /// Index of the first reading with angles. The first and last four periods of the corner have none, as the
    /// motion before and after the record is unknown; a beginning from rest has them.
    pub first: usize,
    /// α1 and α2 at each reading from there on, rad, without components below the corner: their means are zero.
    pub alpha_rad: Vec<[f64; 2]>,
    /// Standard deviations of α1 and α2, rad, by the instruments' white noise; 0 for ideal instruments.
    pub deviation_rad: Vec<[f64; 2]>,
    /// Displacements along the links that rigid links do not explain, root mean square.
    pub residual: Residual,
}

impl AngleHistory {
    /// Drops the first `readings` readings that have angles.
    pub fn leave_out(&mut self, readings: usize) {
        let readings = readings.min(self.alpha_rad.len());
        self.alpha_rad.drain(..readings);
        self.deviation_rad.drain(..readings);
        self.first += readings;
    }
}

/// Residual of the displacements along rigid links, root mean square over both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Residual over that of the instruments' noise; `None` for ideal instruments. About 1 if the readings are
    /// those of the arm and the vibration is small.
    pub over_noise: Option<f64>,
    /// Residual over the displacements across the links. In large-amplitude vibration it is about as large as
    /// the mean angles, rad.
    pub over_displacement: f64,
}

/// Computes the angles behind the accelerations of B and C along x and y, m/s², read `rate_hz` times a second
/// by the instruments of `rig`. B is at the end of the first and C at the end of the second of two links, which
/// at rest lead by `links_m` from their starts to their ends. No reading may be clipped. The droop of the
/// converters is corrected, the rest of the instruments' chains is not.
///
/// # Errors
/// [`IdentifyError`] if the corner is outside the record's band, the record consists only of its ends, a reading is not
/// finite, or the angles exceed 1 rad.
pub fn joint_angles(
    links_m: &[Vector2<f64>; 2],
    rate_hz: f64,
    rig: &RigSpec,
    readings: &[[f64; CHANNELS]],
    settings: AngleSettings,
) -> Result<AngleHistory, IdentifyError> {
    let [first, end, silence] = stretch(readings, rate_hz, settings)?;
    let integrator = Integrator::new(settings.integration, readings.len(), silence, rate_hz, settings.from_hz);
    let [d_b, d_c] =
        [0, 2].map(|channel| integrator.displacements(&accelerations(readings, channel, settings, rig.converter)));
    let links = Links::new(links_m);
    let (across, along) = links.displacements(&d_b, &d_c);
    let turns = turns(&integrator, &across)?;
    let noise_m_s2 = [&rig.sensors.b, &rig.sensors.c].map(|sensor| sensor.reading_noise(rate_hz));
    // The same gain holds for both points, since both are integrated with the same corner.
    let noise_m = noise_m_s2.map(|noise| noise * integrator.noise_gain_s2());
    let shortened: Vec<Pair> =
        turns.iter().map(|turn| Pair::new(one_less_cos(turn.re), one_less_cos(turn.im))).collect();
    let left = integrator.passed(&shortened);
    // Along a link the end moves by −l(1 − cos θ), so for rigid links this sum is zero.
    let left: Vec<Pair> = along.iter().zip(left).map(|(along, shortened)| along + shortened).collect();
    let kept = &turns[first..end];
    Ok(AngleHistory {
        first,
        alpha_rad: kept.iter().map(|turn| [turn.re, turn.im - turn.re]).collect(),
        deviation_rad: kept.iter().map(|turn| links.deviation_rad(*turn, noise_m)).collect(),
        residual: links.residual(&left[first..end], &across[first..end], noise_m),
    })
}

/// Returns the first reading with angles, the first after the last, and the number of readings of an end.
fn stretch(readings: &[[f64; CHANNELS]], rate_hz: f64, settings: AngleSettings) -> Result<[usize; 3], IdentifyError> {
    let AngleSettings { from_hz, starts_at_rest, .. } = settings;
    if !(from_hz > 0.0 && from_hz < 0.5 * rate_hz) {
        return Err(IdentifyError::Corner { from_hz, rate_hz });
    }
    if let Some(reading) = readings.iter().position(|values| values.iter().any(|value| !value.is_finite())) {
        return Err(IdentifyError::NotFinite { reading });
    }
    let samples = readings.len();
    let period = rate_hz / from_hz;
    let end = libm::ceil(END_PERIODS * period);
    let first = if starts_at_rest { 0.0 } else { end };
    let least = first + end + libm::ceil(period);
    if (samples as f64) < least {
        return Err(IdentifyError::NoMiddle { samples, least, from_hz });
    }
    Ok([first as usize, samples - end as usize, end as usize])
}

/// Returns the accelerations of a point without the droop of the converters. Unless the record starts at rest,
/// their mean is removed: next to the silence around the record it would be a step.
fn accelerations(
    readings: &[[f64; CHANNELS]],
    channel: usize,
    settings: AngleSettings,
    converter: Converter,
) -> Vec<Pair> {
    let mut values: Vec<Pair> = readings.iter().map(|values| Pair::new(values[channel], values[channel + 1])).collect();
    if !settings.starts_at_rest {
        let mean = values.iter().sum::<Pair>() / values.len() as f64;
        values.iter_mut().for_each(|value| *value -= mean);
    }
    without_droop(&values, converter)
}

/// Solves for the angles θ of both links behind g[sin θ], rad.
fn turns(integrator: &Integrator, across: &[Pair]) -> Result<Vec<Pair>, IdentifyError> {
    let mut turns = across.to_vec();
    for _round in 0..MOST_ROUNDS {
        // Checked in every round, since a diverging iteration grows beyond the limit before it overflows.
        let largest = turns.iter().fold(0.0_f64, |largest, turn| largest.max(turn.re.abs()).max(turn.im.abs()));
        if largest > LARGEST_RAD {
            return Err(IdentifyError::TooLarge { angle_rad: largest, most_rad: LARGEST_RAD });
        }
        let bent: Vec<Pair> = turns.iter().map(|turn| Pair::new(less_sin(turn.re), less_sin(turn.im))).collect();
        let mut change = 0.0_f64;
        for ((turn, across), bent) in turns.iter_mut().zip(across).zip(integrator.passed(&bent)) {
            let next = across + bent;
            change = change.max((next - *turn).norm_sqr());
            *turn = next;
        }
        if change < CHANGE_RAD * CHANGE_RAD {
            break;
        }
    }
    Ok(turns)
}

/// Returns θ − sin θ. For small angles its rounding, 1e-16 θ, is below any noise.
fn less_sin(turn: f64) -> f64 {
    turn - libm::sin(turn)
}

/// Returns 1 − cos θ as 2 sin² θ/2, which keeps its digits for small angles.
fn one_less_cos(turn: f64) -> f64 {
    let sine = libm::sin(0.5 * turn);
    2.0 * sine * sine
}

/// The two links at rest.
struct Links {
    length_m: [f64; 2],
    /// Unit vectors along the links, from start to end.
    along: [Vector2<f64>; 2],
    /// Unit vectors across the links, in the direction of growing angles.
    across: [Vector2<f64>; 2],
}

impl Links {
    fn new(links: &[Vector2<f64>; 2]) -> Links {
        let along = links.map(|link| link.normalize());
        Links {
            length_m: links.map(|link| link.norm()),
            along,
            across: along.map(|unit| Vector2::new(-unit.y, unit.x)),
        }
    }

    /// Returns the displacements of the links' ends against their starts, over the lengths: across and along.
    fn displacements(&self, d_b: &[Pair], d_c: &[Pair]) -> (Vec<Pair>, Vec<Pair>) {
        let part = |units: &[Vector2<f64>; 2]| {
            let dot = |link: usize, d: Pair| (units[link].x * d.re + units[link].y * d.im) / self.length_m[link];
            d_b.iter().zip(d_c).map(|(b, c)| Pair::new(dot(0, *b), dot(1, c - b))).collect()
        };
        (part(&self.across), part(&self.along))
    }

    /// Returns the standard deviations of α1 and α2, rad, from those of the displacements of B and C, m, which
    /// are equal along x and y and independent.
    ///
    /// From l sin θ = d·t follows δθ = t·δd/(l cos θ). With s = t/(l cos θ) of each link, δα1 = s1·δB and
    /// δα2 = s2·(δC − δB) − s1·δB, so that
    ///
    /// ```text
    /// σ(α1)² = σ_B² |s1|²      σ(α2)² = σ_C² |s2|² + σ_B² |s1 + s2|²
    /// ```
    fn deviation_rad(&self, turn: Pair, noise_m: [f64; 2]) -> [f64; 2] {
        let [s1, s2] = [(0, turn.re), (1, turn.im)]
            .map(|(link, turn)| self.across[link] / (self.length_m[link] * libm::cos(turn)));
        let [b, c] = noise_m;
        [b * s1.norm(), libm::hypot(c * s2.norm(), b * (s1 + s2).norm())]
    }

    /// Returns the residual along the links, over the lengths, given the displacements across. Noise alone
    /// gives σ_B² for link 1 and σ_B² + σ_C² for link 2.
    fn residual(&self, left: &[Pair], across: &[Pair], noise_m: [f64; 2]) -> Residual {
        let [l1, l2] = self.length_m;
        let mean_square = |values: &[Pair]| {
            let square = |value: &Pair| (l1 * value.re) * (l1 * value.re) + (l2 * value.im) * (l2 * value.im);
            values.iter().map(square).sum::<f64>() / values.len() as f64
        };
        let left = mean_square(left);
        let all = mean_square(across);
        let noise = 2.0 * noise_m[0] * noise_m[0] + noise_m[1] * noise_m[1];
        Residual {
            over_noise: (noise > 0.0).then(|| libm::sqrt(left / noise)),
            over_displacement: if all > 0.0 { libm::sqrt(left / all) } else { 0.0 },
        }
    }
}
