//! Recorded readings for identification.

use alloc::vec::Vec;

use super::IdentifyError;
use crate::rig::RigSpec;

/// Number of acceleration channels: B along x and y, C along x and y.
pub const CHANNELS: usize = 4;

/// Least number of samples of a record; with fewer no band has enough lines.
const LEAST_SAMPLES: usize = 256;
/// The end of a record is 1/`END_PART` of it.
const END_PART: usize = 20;
/// Ratio of the root mean squares of the end and the whole below which a record has died out.
const DECAYED: f64 = 0.1;
/// Number of standard deviations above which a reading of the head is a force and not noise.
const CLEAR: f64 = 6.0;

/// Direction of the force that is taken as the input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// The direction with the largest readings of the head, which is that of the exciter.
    #[default]
    Principal,
    /// The x axis of the base frame.
    X,
    /// The y axis of the base frame.
    Y,
}

/// A band of frequencies, Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Lowest frequency of the band, positive.
    pub from_hz: f64,
    /// Highest frequency, above the lowest and below half the sample rate.
    pub to_hz: f64,
}

/// Readings at equal intervals, with the known noise of the instruments.
///
/// Force and accelerations of a sample have passed the same kind of converter ([`crate::rig::Converter`]).
/// Their ratio is the arm's response, apart from components that the converter aliases from above half the
/// sample rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    rate_hz: f64,
    force_n: Vec<f64>,
    /// Unit vector along which the force is taken.
    direction: [f64; 2],
    acceleration_m_s2: [Vec<f64>; CHANNELS],
    force_noise_n: f64,
    acceleration_noise_m_s2: [f64; CHANNELS],
    /// First sample with a force, and the first after the last one.
    forced: [usize; 2],
    has_shaker: bool,
}

impl Record {
    /// Returns a record at `rate_hz` samples per second by the instruments of `rig`. Each sample has the force
    /// in the head along x and y, N, and the accelerations of B and C along x and y, m/s².
    ///
    /// # Errors
    /// [`IdentifyError::TooShort`], and [`IdentifyError::NoForce`] if the head reads no force along `direction`.
    pub fn new(
        rate_hz: f64,
        rig: &RigSpec,
        samples: impl IntoIterator<Item = ([f64; 2], [f64; CHANNELS])>,
        direction: Direction,
    ) -> Result<Record, IdentifyError> {
        let mut head_n: Vec<[f64; 2]> = Vec::new();
        let mut acceleration_m_s2: [Vec<f64>; CHANNELS] = Default::default();
        for (force_n, accelerations) in samples {
            head_n.push(force_n);
            acceleration_m_s2.iter_mut().zip(accelerations).for_each(|(channel, value)| channel.push(value));
        }
        // Checked before anything is computed from the readings, which may be none.
        if head_n.len() < LEAST_SAMPLES {
            return Err(IdentifyError::TooShort { samples: head_n.len(), least: LEAST_SAMPLES });
        }
        let force_noise_n = rig.head.reading_noise(rate_hz);
        let [b, c] = [&rig.sensors.b, &rig.sensors.c].map(|sensor| sensor.reading_noise(rate_hz));
        let direction = unit(&head_n, direction);
        let force_n: Vec<f64> = head_n.iter().map(|[x, y]| x * direction[0] + y * direction[1]).collect();
        // Six standard deviations: white noise exceeds them in fewer than one of 10⁸ samples.
        let is_force = |force: &f64| libm::fabs(*force) > CLEAR * force_noise_n;
        let forced = match (force_n.iter().position(is_force), force_n.iter().rposition(is_force)) {
            (Some(first), Some(last)) => [first, last + 1],
            _ => return Err(IdentifyError::NoForce { noise_n: force_noise_n }),
        };
        // Ideal instruments have no noise, and weights of 1/0. Rounding of the values takes its place.
        let floor = |(index, channel): (usize, &Vec<f64>)| [b, b, c, c][index].max(1e-9 * rms(channel)).max(1e-12);
        let mut acceleration_noise_m_s2 = [0.0; CHANNELS];
        for (noise, found) in acceleration_noise_m_s2.iter_mut().zip(acceleration_m_s2.iter().enumerate().map(floor)) {
            *noise = found;
        }
        Ok(Record {
            rate_hz,
            force_n,
            direction,
            acceleration_m_s2,
            force_noise_n,
            acceleration_noise_m_s2,
            forced,
            has_shaker: rig.shaker.is_some(),
        })
    }

    /// Returns the sample rate, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Returns the number of samples.
    pub fn samples(&self) -> usize {
        self.force_n.len()
    }

    /// Returns the direction of the input force, as a unit vector.
    pub fn direction(&self) -> [f64; 2] {
        self.direction
    }

    /// Returns the force along that direction, N.
    pub(super) fn force_n(&self) -> &[f64] {
        &self.force_n
    }

    /// Returns the accelerations of all channels, m/s².
    pub(super) fn accelerations(&self) -> &[Vec<f64>; CHANNELS] {
        &self.acceleration_m_s2
    }

    /// Returns the standard deviation of the force's noise, N.
    pub(super) fn force_noise_n(&self) -> f64 {
        self.force_noise_n
    }

    /// Returns the standard deviations of the accelerations' noise, m/s²; for ideal instruments, the rounding
    /// error.
    pub(super) fn acceleration_noise_m_s2(&self) -> &[f64; CHANNELS] {
        &self.acceleration_noise_m_s2
    }

    /// Returns the first sample with a force, and the first after the last one.
    pub(super) fn forced(&self) -> [usize; 2] {
        self.forced
    }

    /// Returns whether a shaker is attached to the arm, so that the head reads a force while the arm moves.
    pub(super) fn has_shaker(&self) -> bool {
        self.has_shaker
    }

    /// Returns whether the record begins at rest and dies out, as after an impact on an arm that a shaker
    /// brakes: up to the first force, and at least in the first sample, no reading exceeds six standard
    /// deviations of its noise, and the root mean square of the last twentieth is less than a tenth of that of
    /// the whole, or noise.
    pub(super) fn dies_out(&self) -> bool {
        let length = self.samples() / END_PART;
        let mean_square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64;
        let accelerations = self.acceleration_m_s2.iter().zip(self.acceleration_noise_m_s2);
        accelerations.chain([(&self.force_n, self.force_noise_n)]).all(|(values, noise)| {
            let (begin, end) = (&values[..self.forced[0].max(1)], mean_square(&values[values.len() - length..]));
            let most = (DECAYED * DECAYED * mean_square(values)).max(2.0 * noise * noise);
            begin.iter().all(|value| libm::fabs(*value) <= CLEAR * noise) && end <= most
        })
    }

    /// Checks that a band is valid for this record.
    pub(super) fn check(&self, band: Band) -> Result<(), IdentifyError> {
        let Band { from_hz, to_hz } = band;
        if from_hz > 0.0 && from_hz < to_hz && to_hz < 0.5 * self.rate_hz {
            return Ok(());
        }
        Err(IdentifyError::Band { from_hz, to_hz, rate_hz: self.rate_hz })
    }
}

fn rms(values: &[f64]) -> f64 {
    libm::sqrt(values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64)
}

/// Returns the direction as a unit vector. The principal one is the eigenvector of Σ f fᵀ with the larger
/// eigenvalue, at the angle ½ atan2(2 Σ xy, Σ x² − Σ y²), with its larger component positive.
fn unit(head_n: &[[f64; 2]], direction: Direction) -> [f64; 2] {
    match direction {
        Direction::X => [1.0, 0.0],
        Direction::Y => [0.0, 1.0],
        Direction::Principal => {
            let sum = |term: fn(&[f64; 2]) -> f64| head_n.iter().map(term).sum::<f64>();
            let (xx, xy, yy) = (sum(|[x, _]| x * x), sum(|[x, y]| x * y), sum(|[_, y]| y * y));
            let angle = 0.5 * libm::atan2(2.0 * xy, xx - yy);
            let (sine, cosine) = libm::sincos(angle);
            // An eigenvector has no sign. Fixing it makes the phase of the responses reproducible.
            let larger = if libm::fabs(cosine) >= libm::fabs(sine) { cosine } else { sine };
            [cosine, sine].map(|component| component * libm::copysign(1.0, larger))
        }
    }
}
