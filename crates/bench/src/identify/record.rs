//! Recorded readings for identification.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;

use super::error::IdentifyError;
use super::places::RigPlaces;
use crate::rig::{Conditioner, Converter, RigSpec};
use crate::structure::Axis;
use resonarm_modal::Band;
use resonarm_numeric::dft;

/// Least number of samples of a record; with fewer no band has enough lines.
const LEAST_SAMPLES: usize = 256;
/// Number of standard deviations above which a reading of the head is a force and not noise.
const CLEAR: f64 = 6.0;
/// Number of standard deviations by which noise may turn the direction of a force.
const TURNED: f64 = 5.0;

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

/// Accelerations along one degree of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedResponse {
    /// Name of the reading: the sensor and its axis, such as `c-x`.
    pub name: String,
    /// Degree of freedom, such as `tip.x`.
    pub at: String,
    /// Readings, m/s², less gravity.
    pub(super) acceleration_m_s2: Vec<f64>,
    /// Known standard deviation of the noise, m/s²; `None` of ideal instruments, and where a filter colours the noise.
    pub(super) noise_m_s2: Option<f64>,
}

/// Readings at equal intervals, with the known noise of the instruments.
///
/// Force and accelerations of a sample have passed the same kind of converter ([`Converter`]). Conditioners that differ are
/// made alike: every channel passes the filters and delays of the others as well. Their ratio is then the structure's response,
/// apart from components that the converter aliases from above half the sample rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    rate_hz: f64,
    pub(super) converter: Converter,
    /// Force along its direction, N.
    pub(super) force_n: Vec<f64>,
    direction: [f64; 2],
    /// Degrees of freedom along the exciter's x and y.
    pub(super) exciter: [Option<String>; 2],
    responses: Vec<RecordedResponse>,
    /// Standard deviation of the force's noise, N; in the next field, if an estimate can be compared with it.
    force_noise_n: f64,
    pub(super) known_force_noise_n: Option<f64>,
    /// First sample with a force, and the first after the last one.
    pub(super) forced: [usize; 2],
}

impl Record {
    /// Returns a record at `rate_hz` samples per second by the instruments of `rig`. Each sample has the force in the head along
    /// x and y, N, and the readings in the order of `places`. Readings without a degree of freedom, and those that never change,
    /// are left out. Where the structure moves along one axis only, the force is taken along that.
    ///
    /// # Errors
    /// [`IdentifyError::TooShort`], [`IdentifyError::NoResponse`], and [`IdentifyError::NoForce`] if the head reads no force
    /// along `direction`.
    pub fn new<R: AsRef<[f64]>>(
        rate_hz: f64,
        rig: &RigSpec,
        places: &RigPlaces,
        samples: impl IntoIterator<Item = ([f64; 2], R)>,
        direction: Direction,
    ) -> Result<Record, IdentifyError> {
        let mut head_n: Vec<[f64; 2]> = Vec::new();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); places.readings.len()];
        for (force_n, readings) in samples {
            head_n.push(force_n);
            columns.iter_mut().zip(readings.as_ref()).for_each(|(column, value)| column.push(*value));
        }
        // Checked before anything is computed from the readings, which may be none.
        if head_n.len() < LEAST_SAMPLES {
            return Err(IdentifyError::TooShort { samples: head_n.len(), least: LEAST_SAMPLES });
        }
        let force_noise_n = rig.head.reading_noise(rate_hz);
        let direction = match (direction, &places.exciter) {
            (Direction::Principal, [Some(_), None]) => [1.0, 0.0],
            (Direction::Principal, [None, Some(_)]) => [0.0, 1.0],
            _ => unit(&head_n, direction, force_noise_n),
        };
        let mut force_n: Vec<f64> = head_n.iter().map(|[x, y]| x * direction[0] + y * direction[1]).collect();
        // Six standard deviations: white noise exceeds them in fewer than one of 10⁸ samples.
        let is_force = |force: &f64| libm::fabs(*force) > CLEAR * force_noise_n;
        let forced = match (force_n.iter().position(is_force), force_n.iter().rposition(is_force)) {
            (Some(first), Some(last)) => [first, last + 1],
            _ => return Err(IdentifyError::NoForce { noise_n: force_noise_n }),
        };
        let changes = |column: &[f64]| column.iter().any(|value| *value != column[0]);
        let used = || {
            let readings = places.readings.iter().zip(&columns);
            readings.filter_map(|(reading, column)| Some((reading, reading.at.as_ref()?, column)))
        };
        let used = || used().filter(|(_, _, column)| column.len() == head_n.len() && changes(column));
        let head = rig.head.conditioner(rate_hz);
        let mut conditioners: Vec<Conditioner> = vec![head];
        for (reading, ..) in used() {
            let conditioner = reading.sensor.conditioner(rate_hz);
            if !conditioners.contains(&conditioner) {
                conditioners.push(conditioner);
            }
        }
        let make_alike = |values: &mut [f64], own: &Conditioner| {
            conditioners.iter().filter(|other| *other != own).for_each(|other| other.apply(values));
        };
        let is_white = conditioners.iter().all(Conditioner::has_no_filter);
        make_alike(&mut force_n, &head);
        let responses: Vec<RecordedResponse> = used()
            .map(|(reading, at, column)| {
                // Filters that reject constants have removed gravity already.
                let removed = if reading.axis == Axis::Y && reading.sensor.highpass_hz.is_none() {
                    reading.sensor.gravity_m_s2.unwrap_or(0.0)
                } else {
                    0.0
                };
                let mut acceleration_m_s2: Vec<f64> = column.iter().map(|value| value - removed).collect();
                make_alike(&mut acceleration_m_s2, &reading.sensor.conditioner(rate_hz));
                let noise = reading.sensor.reading_noise(rate_hz);
                RecordedResponse {
                    name: reading.name.clone(),
                    at: at.clone(),
                    acceleration_m_s2,
                    noise_m_s2: (is_white && noise > 0.0).then_some(noise),
                }
            })
            .collect();
        if responses.is_empty() {
            return Err(IdentifyError::NoResponse);
        }
        Ok(Record {
            rate_hz,
            converter: rig.converter,
            force_n,
            direction,
            exciter: places.exciter.clone(),
            responses,
            force_noise_n,
            known_force_noise_n: (is_white && force_noise_n > 0.0).then_some(force_noise_n),
            forced,
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

    /// Returns the responses of the record, in the order of its channels.
    pub fn responses(&self) -> &[RecordedResponse] {
        &self.responses
    }

    /// Checks that a band is valid for this record, and that the force was more than noise in it, over the samples with a force:
    /// its mean power there exceeds four times that of the noise, and a thousandth of that at all frequencies, since an abrupt
    /// end leaks.
    ///
    /// # Errors
    /// [`IdentifyError::Band`], [`IdentifyError::NoEnergy`].
    pub fn check(&self, band: Band) -> Result<(), IdentifyError> {
        let Band { from_hz, to_hz } = band;
        if !(from_hz > 0.0 && from_hz < to_hz && to_hz < 0.5 * self.rate_hz) {
            return Err(IdentifyError::Band { band, rate_hz: self.rate_hz });
        }
        let [start, end] = self.forced;
        // A short pulse has few lines, so at least 256 are computed.
        let period = (end - start).max(256);
        let first = libm::floor(from_hz * period as f64 / self.rate_hz) as usize;
        let count = libm::ceil(to_hz * period as f64 / self.rate_hz) as usize + 1 - first;
        let transform = dft::Lines::new(period, end - start, first, count);
        let force = transform.transform(self.force_n[start..end].iter().map(|value| Complex::new(*value, 0.0)));
        let power = force.iter().map(Complex::norm_sqr).sum::<f64>() / count as f64;
        let noise = self.force_noise_n * self.force_noise_n * (end - start) as f64;
        // The mean power at all frequencies, by Parseval's theorem.
        let total: f64 = self.force_n[start..end].iter().map(|force| force * force).sum();
        if power > 4.0 * noise && power > 1e-3 * total {
            return Ok(());
        }
        Err(IdentifyError::NoEnergy(band))
    }

    /// Returns the share of the head's noise in the power of the force over the half-power bandwidth of a mode, or at the line
    /// next to it.
    pub fn noise_share(&self, frequency_hz: f64, damping_ratio: f64) -> f64 {
        let spacing_hz = self.rate_hz / self.samples() as f64;
        let line = |hz: f64| (libm::round(hz / spacing_hz).max(0.0) as usize).min(self.samples() / 2);
        let half_hz = damping_ratio.abs().min(1.0) * frequency_hz;
        let first = line(frequency_hz - half_hz);
        let last = line(frequency_hz + half_hz);
        let transform = dft::Lines::new(self.samples(), self.samples(), first, last - first + 1);
        let force = transform.transform(self.force_n.iter().map(|value| Complex::new(*value, 0.0)));
        let power = force.iter().map(Complex::norm_sqr).sum::<f64>() / force.len() as f64;
        let noise = self.force_noise_n * self.force_noise_n * self.samples() as f64;
        if power > 0.0 { (noise / power).min(1.0) } else { 1.0 }
    }
}

/// Returns the direction as a unit vector. The principal one is the eigenvector of Σ f fᵀ with the larger eigenvalue, at the
/// angle ½ atan2(2 Σ xy, Σ x² − Σ y²), with its larger component positive; it is an axis if noise explains the difference.
fn unit(head_n: &[[f64; 2]], direction: Direction, noise_n: f64) -> [f64; 2] {
    match direction {
        Direction::X => [1.0, 0.0],
        Direction::Y => [0.0, 1.0],
        Direction::Principal => {
            let sum = |term: fn(&[f64; 2]) -> f64| head_n.iter().map(term).sum::<f64>();
            let (xx, xy, yy) = (sum(|[x, _]| x * x), sum(|[x, y]| x * y), sum(|[_, y]| y * y));
            let angle = 0.5 * libm::atan2(2.0 * xy, xx - yy);
            let (sine, cosine) = libm::sincos(angle);
            let is_along_x = libm::fabs(cosine) >= libm::fabs(sine);
            let (larger, smaller) = if is_along_x { (cosine, sine) } else { (sine, cosine) };
            // The noise of Σ xy over Σ x² of a force along x is σ/√(Σ x²).
            if libm::fabs(smaller) <= TURNED * noise_n / libm::sqrt(xx + yy) {
                return if is_along_x { [1.0, 0.0] } else { [0.0, 1.0] };
            }
            // An eigenvector has no sign. Fixing it makes the phase of the responses reproducible.
            [cosine, sine].map(|component| component * libm::copysign(1.0, larger))
        }
    }
}
