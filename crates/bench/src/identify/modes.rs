//! Identification of the modes in a record.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::{Complex, SMatrix, SymmetricEigen};
use serde::Serialize;

use super::mode_fit::{Lines, Pole};
use super::{Band, CHANNELS, IdentifyError, Record};
use resonarm_numeric::dft;

/// Largest number of peaks that are examined.
const MOST_PEAKS: usize = 24;
/// Ratio of a peak of the response's power to the median around it above which the peak is examined.
const STANDS_OUT: f64 = 4.0;
/// Ratio of the squared residuals without and with a pole above which a peak is a mode: a peak of a random
/// force needs no pole.
const GAIN: f64 = 10.0;
/// Largest share of noise in the power of the force at a mode.
pub const MOST_NOISE_SHARE: f64 = 0.01;
/// Half the width of a fit's band: at least this many hertz, and at least the next constant's lines.
const HALF_WIDTH_HZ: f64 = 0.5;
const HALF_WIDTH_LINES: f64 = 20.0;
/// Multiples of that width in which modes are sought that are too broad to stand out in it; the next constant
/// is the least ratio of such a mode's half bandwidth to the width.
const BROAD_WIDTHS: [usize; 2] = [4, 16];
const BROAD_SHARE: f64 = 0.2;
/// Distance in lines up to which two poles belong to one mode.
const ONE_MODE_LINES: usize = 2;
/// Least number of lines of a fit.
const LEAST_LINES: usize = 16;
/// γM of the exponential window of a response that dies out: the end is weighted by a thousandth.
const TAPER: f64 = 6.9;
/// Ratio of residual to noise below which the arm counts as linear.
const LINEAR: f64 = 3.0;

/// Part of the record that a mode was fitted to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FittedPart {
    /// The whole record, under the force.
    Forced,
    /// The ring-down after the force has ended, which is at least half of the record.
    RingDown,
}

/// A mode identified from readings, with standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct IdentifiedMode {
    /// Pole frequency |λ|/(2π) of the damped structure's eigenvalue λ, Hz. Unless the damping is proportional
    /// it differs from the natural frequency of the undamped structure; the command `modes` states both.
    pub pole_frequency_hz: f64,
    /// Standard deviation of the pole frequency, Hz.
    pub pole_frequency_deviation_hz: f64,
    /// Damping ratio of the pole, −Re λ/|λ|.
    pub pole_damping_ratio: f64,
    /// Standard deviation of the damping ratio.
    pub pole_damping_ratio_deviation: f64,
    /// Amplitudes of acceleration of B along x and y and C along x and y, relative to the largest, 1.
    pub shape: [f64; CHANNELS],
    /// Shape normalised to the modal mass 1 kg, 1/√kg, displacement over modal coordinate, from the residue of
    /// the response to the force; `None` in a ring-down, which has no force, and where the force has no part
    /// along the shape.
    pub shape_per_sqrt_kg: Option<[f64; CHANNELS]>,
    /// Root mean square of the residual over the instruments' noise; about 1 for a linear arm. If it is larger,
    /// the standard deviations are increased by this factor.
    pub residual: f64,
    /// Whether the residual is at most three times the noise. If not, the arm does not vibrate linearly or is
    /// disturbed, and the numbers are those of an equivalent linear arm.
    pub is_linear: bool,
    /// Number of lines of the transform that were fitted.
    pub lines: usize,
    /// Part of the record that the mode was fitted to.
    pub part: FittedPart,
}

/// A mode, or the reason why a peak is not one.
type Fitted = Result<IdentifiedMode, Rejection>;

/// Modes in a record, and peaks that are not modes.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// Modes in the order of their frequencies.
    pub modes: Vec<IdentifiedMode>,
    /// Peaks that are not modes, in the order of their frequencies.
    pub rejected: Vec<RejectedPeak>,
}

/// A peak of the response, or of the response over the force, that is not a mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RejectedPeak {
    /// Frequency of the peak, Hz.
    pub frequency_hz: f64,
    /// Reason why it is not a mode.
    pub reason: Rejection,
}

/// Reason why a peak is not a mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// The lines around it are described as well without a pole.
    NoPole,
    /// The head's noise has a share of the force's power above [`MOST_NOISE_SHARE`], which would bias frequency
    /// and damping by more than their deviations.
    ForceInNoise {
        /// Share of the noise, 0 to 1.
        share: f64,
    },
}

/// Line of a mode, with the width of the band in which it was found.
struct Centre {
    line: usize,
    /// Number of lines on both sides.
    half: usize,
}

/// A part of a record, transformed without a window, in and around a band.
struct Stretch<'a> {
    record: &'a Record,
    part: FittedPart,
    samples: usize,
    /// First line and number of lines of the band.
    band: (usize, usize),
    /// Number of the first line that was computed.
    first: usize,
    channels: [Vec<Complex<f64>>; CHANNELS],
    force: Vec<Complex<f64>>,
    /// γM of the exponential window e^(−γn), if there is one.
    taper: Option<f64>,
}

/// Identifies the modes whose peaks stand out in the band.
///
/// # Errors
/// [`IdentifyError`] if the band is not in the record, the force has no energy in it, or no peak stands out there.
pub fn modes(record: &Record, band: Band) -> Result<Identification, IdentifyError> {
    record.check(band)?;
    check_energy(record, band)?;
    let stretch = Stretch::new(record, band)?;
    let (mut centres, mut rejected): (Vec<Centre>, Vec<RejectedPeak>) = (Vec::new(), Vec::new());
    let half = half_width(stretch.spacing_hz());
    for peak in stretch.peaks(half) {
        let mode = match stretch.fit(peak, half, None)? {
            Ok(mode) => mode,
            Err(reason) => {
                rejected.push(RejectedPeak { frequency_hz: peak as f64 * stretch.spacing_hz(), reason });
                continue;
            }
        };
        // A peak of the response and one of the response over the force may belong to the same mode.
        stretch.add(&mut centres, &mode, half, ONE_MODE_LINES);
    }
    stretch.add_broad(&mut centres)?;
    if centres.is_empty() && rejected.is_empty() {
        return Err(IdentifyError::NoResonance { from_hz: band.from_hz, to_hz: band.to_hz });
    }
    let mut found: Vec<IdentifiedMode> = Vec::new();
    // The modes are fitted again once all are known, so that no band reaches more than half way to a neighbour.
    for Centre { line, half } in &centres {
        let others = centres.iter().map(|other| other.line).filter(|other| other != line);
        found.extend(stretch.fit(*line, *half, others.map(|other| other.abs_diff(*line)).min())?);
    }
    found.sort_by(|a, b| a.pole_frequency_hz.total_cmp(&b.pole_frequency_hz));
    rejected.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    Ok(Identification { modes: found, rejected })
}

/// Checks that the force was more than noise in the band, over the samples with a force: its mean power there
/// exceeds four times that of the noise, and a thousandth of that at all frequencies, since an abrupt end
/// leaks.
fn check_energy(record: &Record, band: Band) -> Result<(), IdentifyError> {
    let [start, end] = record.forced();
    // A short pulse has few lines, so at least 256 are computed.
    let period = (end - start).max(256);
    let first = libm::floor(band.from_hz * period as f64 / record.rate_hz()) as usize;
    let count = libm::ceil(band.to_hz * period as f64 / record.rate_hz()) as usize + 1 - first;
    let transform = dft::Lines::new(period, end - start, first, count);
    let force = transform.transform(record.force_n()[start..end].iter().map(|value| Complex::new(*value, 0.0)));
    let power = force.iter().map(Complex::norm_sqr).sum::<f64>() / count as f64;
    let noise = record.force_noise_n() * record.force_noise_n() * (end - start) as f64;
    // The mean power at all frequencies, by Parseval's theorem.
    let total: f64 = record.force_n()[start..end].iter().map(|force| force * force).sum();
    if power > 4.0 * noise && power > 1e-3 * total {
        return Ok(());
    }
    Err(IdentifyError::NoEnergy { from_hz: band.from_hz, to_hz: band.to_hz })
}

impl<'a> Stretch<'a> {
    /// Takes the ring-down, if that is most of the record, or else the whole record.
    fn new(record: &'a Record, band: Band) -> Result<Stretch<'a>, IdentifyError> {
        let [_, end] = record.forced();
        // With a shaker there is no ring-down without force: the armature continues to load the arm, and the
        // head reads that.
        let rings_down = !record.has_shaker() && 2 * end <= record.samples();
        let (part, from) = if rings_down { (FittedPart::RingDown, end) } else { (FittedPart::Forced, 0) };
        let samples = record.samples() - from;
        let spacing_hz = record.rate_hz() / samples as f64;
        let low = libm::ceil(band.from_hz / spacing_hz).max(1.0) as usize;
        let count = (libm::floor(band.to_hz / spacing_hz) as usize + 1).saturating_sub(low);
        let half = half_width(spacing_hz);
        if count < LEAST_LINES || 4 * half >= samples {
            let least = libm::ceil(LEAST_LINES as f64 * record.rate_hz() / (band.to_hz - band.from_hz)) as usize;
            return Err(IdentifyError::TooShort { samples, least: least.max(4 * half + 1) });
        }
        // A fit at the edge of the band extends beyond it, for a broad mode by half its frequency.
        let first = (low / 2).min(low.saturating_sub(half + 1));
        let behind = low + count;
        let end = (behind + half).max(behind + behind / 2).min(samples / 2).max(behind + 1);
        let transform = dft::Lines::new(samples, samples, first, end - first);
        let taper = (part == FittedPart::Forced && record.dies_out()).then_some(TAPER);
        let window = |n: usize| taper.map_or(1.0, |taper| libm::exp(-taper * n as f64 / samples as f64));
        let windowed = |(n, value): (usize, &f64)| Complex::new(value * window(n), 0.0);
        let lines = |values: &[f64]| transform.transform(values[from..].iter().enumerate().map(windowed));
        let channels = core::array::from_fn(|i| lines(&record.accelerations()[i]));
        Ok(Stretch {
            record,
            part,
            samples,
            band: (low, count),
            first,
            channels,
            force: lines(record.force_n()),
            taper,
        })
    }

    /// Returns the mean square of the exponential window; 1 without one.
    fn window_power(&self) -> f64 {
        self.taper.map_or(1.0, |taper| -libm::expm1(-2.0 * taper) / (2.0 * taper))
    }

    /// Returns the spacing of the lines, Hz.
    fn spacing_hz(&self) -> f64 {
        self.record.rate_hz() / self.samples as f64
    }

    /// Adds a mode to the centres, unless one is within `apart` lines already.
    fn add(&self, centres: &mut Vec<Centre>, mode: &IdentifiedMode, half: usize, apart: usize) {
        let line = libm::round(mode.pole_frequency_hz / self.spacing_hz()) as usize;
        if !centres.iter().any(|other| other.line.abs_diff(line) <= apart) {
            centres.push(Centre { line, half });
        }
    }

    /// Adds the modes that are too broad to stand out in the usual width.
    fn add_broad(&self, centres: &mut Vec<Centre>) -> Result<(), IdentifyError> {
        let usual = half_width(self.spacing_hz());
        for half in BROAD_WIDTHS.map(|width| width * usual).into_iter().filter(|half| 2 * half <= self.band.1) {
            for peak in self.peaks(half) {
                let Ok(mode) = self.fit_within(peak, half)? else { continue };
                let bandwidth = mode.pole_damping_ratio * mode.pole_frequency_hz / self.spacing_hz();
                let is_in_band = (self.band.0..self.band.0 + self.band.1)
                    .contains(&(libm::round(mode.pole_frequency_hz / self.spacing_hz()) as usize));
                if is_in_band && bandwidth >= BROAD_SHARE * usual as f64 {
                    self.add(centres, &mode, half, libm::ceil(bandwidth) as usize);
                }
            }
        }
        Ok(())
    }

    /// Returns the lines at which the response over the force stands out, then those at which the response
    /// does.
    ///
    /// A mode is at a peak of the ratio. There a shaker's force drops out; the response peaks elsewhere, at the modes
    /// of arm and armature together. A free response has no force to divide by.
    fn peaks(&self, half: usize) -> Vec<usize> {
        let mut response = alloc::vec![0.0; self.band.1];
        for (lines, noise) in self.channels.iter().zip(self.record.acceleration_noise_m_s2()) {
            self.add_power(&mut response, lines, 1.0 / (noise * noise));
        }
        if self.part == FittedPart::RingDown {
            return self.peaks_of(&response, half);
        }
        // The power of the force is bounded from below by its noise: that of a line is M σ², 3/2 as much under
        // the Hann window.
        let noise_n = self.record.force_noise_n();
        let least = 1.5 * self.samples as f64 * self.window_power() * (noise_n * noise_n).max(f64::MIN_POSITIVE);
        let mut force = alloc::vec![least; self.band.1];
        self.add_power(&mut force, &self.force, 1.0);
        let ratio: Vec<f64> = response.iter().zip(&force).map(|(response, force)| response / force).collect();
        let mut peaks = self.peaks_of(&ratio, half);
        peaks.extend(self.peaks_of(&response, half));
        peaks
    }

    /// Adds `weight` times the power of the band's lines under a Hann window, applied as a convolution: leakage
    /// falls with the third power of the distance.
    fn add_power(&self, power: &mut [f64], lines: &[Complex<f64>], weight: f64) {
        let first = self.band.0;
        for (power, near) in power.iter_mut().zip(lines[first - 1 - self.first..].windows(3)) {
            *power += weight * (near[1] - (near[0] + near[2]) * 0.5).norm_sqr();
        }
    }

    /// Returns the lines of the band at which a power stands out from the `half` lines on both sides, the
    /// highest first.
    fn peaks_of(&self, power: &[f64], half: usize) -> Vec<usize> {
        let (first, count) = self.band;
        let mut open = alloc::vec![true; count];
        let mut peaks = Vec::new();
        for _ in 0..MOST_PEAKS {
            let highest = (0..count).filter(|k| open[*k]).max_by(|a, b| power[*a].total_cmp(&power[*b]));
            let Some(peak) = highest else { break };
            let (low, high) = (peak.saturating_sub(half), (peak + half + 1).min(count));
            let mut around: Vec<f64> = (low..high).filter(|k| k.abs_diff(peak) > 4).map(|k| power[k]).collect();
            around.sort_by(f64::total_cmp);
            // The median ignores other peaks in the neighbourhood, which a mean would not.
            let median = around.get(around.len() / 2).copied().unwrap_or(f64::INFINITY);
            // At the edge of a part that was already examined there is only the skirt of another peak.
            let is_top = (peak == 0 || open[peak - 1]) && (peak + 1 == count || open[peak + 1]);
            if is_top && power[peak] > STANDS_OUT * median {
                peaks.push(first + peak);
            }
            open[low..high].fill(false);
        }
        peaks
    }

    /// Fits the mode at a line to `half` lines on both sides, if there is one; `neighbour` is the distance to
    /// the nearest other mode, lines.
    fn fit(&self, centre: usize, half: usize, neighbour: Option<usize>) -> Result<Fitted, IdentifyError> {
        let room = neighbour.map_or(usize::MAX, |lines| lines / 2);
        let mut half = half.min(room);
        let mut fitted = self.fit_within(centre, half)?;
        // A mode that is broad relative to the band is fitted in a wider one.
        if let Ok(mode) = &fitted {
            let bandwidth = mode.pole_damping_ratio * mode.pole_frequency_hz / self.spacing_hz();
            // Six half bandwidths to each side contain nearly all of a resonance; the limit keeps the band
            // above 0 Hz.
            let wide = libm::ceil(6.0 * bandwidth).min(0.5 * centre as f64) as usize;
            if wide > half && half < room {
                half = wide.min(room);
                fitted = self.fit_within(centre, half)?;
            }
        }
        Ok(fitted)
    }

    fn fit_within(&self, centre: usize, half: usize) -> Result<Fitted, IdentifyError> {
        let first = centre.saturating_sub(half).max(self.first).max(1);
        let end = (centre + half + 1).min(self.first + self.force.len());
        let (count, samples) = (end - first, self.samples);
        if count < LEAST_LINES {
            return Err(IdentifyError::TooShort { samples, least: samples * LEAST_LINES / count.max(1) });
        }
        let within = first - self.first..end - self.first;
        let noise = self.record.acceleration_noise_m_s2();
        let channels = self.channels.each_ref().map(|lines| &lines[within.clone()]);
        // All channels are combined into one response with the best ratio of signal to noise, and one pole is
        // fitted to it.
        let combination = strongest(&channels, noise);
        let response =
            (0..count).map(|k| (0..CHANNELS).map(|i| channels[i][k] * (combination[i] / noise[i])).sum()).collect();
        let root = libm::sqrt(samples as f64 * self.window_power());
        let force = (self.part == FittedPart::Forced).then(|| self.force[within].to_vec());
        let noises = [root, self.record.force_noise_n() * root];
        let lines = Lines { samples, centre, first, response, force, taper: self.taper, noise: noises };
        // A pole far from the peak belongs to another mode, or to none.
        let is_mode = |pole: &Pole| pole.gain > GAIN && libm::fabs(pole.x[0]) < 0.25 * count as f64;
        let Some(pole) = lines.fit(0.0).filter(is_mode) else { return Ok(Err(Rejection::NoPole)) };
        if pole.force_noise_share > MOST_NOISE_SHARE {
            return Ok(Err(Rejection::ForceInNoise { share: pole.force_noise_share }));
        }
        // λ = rate · ln p = rate/M · (−x₁ + 2πi (centre + x₀)).
        let scale = self.spacing_hz();
        let (decay, turns) = (pole.x[1] * scale, TAU * (centre as f64 + pole.x[0]) * scale);
        let size = libm::hypot(decay, turns);
        let parts = core::array::from_fn(|i| combination[i] * noise[i]);
        let largest = parts
            .iter()
            .fold(0.0, |largest: f64, part| if libm::fabs(*part) > libm::fabs(largest) { *part } else { largest });
        let shape = parts.map(|part| part / largest);
        let reading = core::array::from_fn(|i| combination[i] / noise[i]);
        let lambda = Complex::new(-decay, turns);
        let residue = pole.residue.map(|residue| residue * self.record.rate_hz());
        let mass_normalised = residue.and_then(|residue| self.mass_normalised(&shape, &reading, lambda, residue));
        Ok(Ok(IdentifiedMode {
            pole_frequency_hz: size / TAU,
            pole_frequency_deviation_hz: pole.deviation[0] * scale,
            pole_damping_ratio: decay / size,
            pole_damping_ratio_deviation: pole.deviation[1] * scale / size,
            shape,
            shape_per_sqrt_kg: mass_normalised,
            residual: pole.residual,
            is_linear: pole.residual <= LINEAR,
            lines: count,
            part: self.part,
        }))
    }
}

impl Stretch<'_> {
    /// Returns the shape of modal mass 1 kg. `reading` are the weights that combine the channels to the
    /// response.
    ///
    /// The shape φ = c s, driven along e, has the accelerance z² φ φₑ/((z − λ)(z − λ*)) at z = iω, whose residue at λ
    /// is λ² φ φₑ/(λ − λ*). So the response Σ wᵢ aᵢ with the residue r has c² = Re(r (λ − λ*)/λ²)/(Σ wᵢ sᵢ · sₑ).
    fn mass_normalised(
        &self,
        shape: &[f64; CHANNELS],
        reading: &[f64; CHANNELS],
        lambda: Complex<f64>,
        residue: Complex<f64>,
    ) -> Option<[f64; CHANNELS]> {
        let direction = self.record.direction();
        let driven = shape[2] * direction[0] + shape[3] * direction[1];
        let read: f64 = shape.iter().zip(reading).map(|(shape, weight)| shape * weight).sum();
        let product = (residue * Complex::new(0.0, 2.0 * lambda.im) / (lambda * lambda)).re;
        let square = product / (read * driven);
        (square > 0.0 && square.is_finite()).then(|| shape.map(|part| part * libm::sqrt(square)))
    }
}

/// Returns half the width of a fit's band, lines.
fn half_width(spacing_hz: f64) -> usize {
    libm::ceil((HALF_WIDTH_HZ / spacing_hz).max(HALF_WIDTH_LINES)) as usize
}

/// Returns the real unit vector v for which vᵀy, with y the channels in units of their noise, has most power
/// over the lines. Near a mode it is the mode's shape, which combines all channels, while the noise of vᵀy
/// stays 1. It is the eigenvector of Re Σ y y* with the largest eigenvalue.
fn strongest(channels: &[&[Complex<f64>]; CHANNELS], noise: &[f64; CHANNELS]) -> [f64; CHANNELS] {
    let power = SMatrix::<f64, CHANNELS, CHANNELS>::from_fn(|i, j| {
        let products = channels[i].iter().zip(channels[j]).map(|(a, b)| (a * b.conj()).re);
        products.sum::<f64>() / (noise[i] * noise[j])
    });
    let eigen = SymmetricEigen::new(power);
    let column = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    core::array::from_fn(|i| column[i])
}
