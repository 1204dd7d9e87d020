//! Power spectra, cross spectra and frequency responses by averaging segments.
//!
//! P. D. Welch, "The Use of Fast Fourier Transform for the Estimation of Power Spectra", IEEE Trans. Audio Electroacoust. 15
//! (1967): a record is cut into segments that may overlap; each is multiplied by a window w and transformed,
//!
//! ```text
//! Xᵢ(k) = Σₙ w(n) xᵢ(n) e^(−2πi kn/N),   Sᵢⱼ(k) = 2/(fs Σ w²) ⟨conj(Xᵢ) Xⱼ⟩
//! ```
//!
//! with ⟨⟩ the mean over the segments. The spectra are one-sided densities: the factor 2 is absent at 0 Hz and, for an even
//! number of samples, at half the sample rate. They equal those of `scipy.signal.welch` and `csd` with `detrend=False`; SciPy
//! subtracts the mean unless asked not to.
//!
//! Windowed segments leak: a resonance whose half-power bandwidth 2ζf is not several lines wide comes out too low and too
//! wide, however many segments are averaged.

mod error;
mod responses;
mod shock;
mod window;

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;
use resonarm_numeric::dft::{Fft, Lines};
use resonarm_numeric::distribution;

pub use error::SpectraError;
pub use responses::{Estimator, FrequencyResponses};
pub use shock::ShockResponse;
pub use window::{Detrend, Window};

/// Way in which a record is cut into segments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segments {
    /// Number of samples N of a segment, at least 2. Lines are fs/N apart.
    pub length: usize,
    /// Number of samples that a segment shares with the next one, less than `length`. With Hann's window half a segment is
    /// usual: more adds little information.
    pub overlap: usize,
    /// Window of each segment.
    pub window: Window,
    /// Trend that is removed from each segment.
    pub detrend: Detrend,
}

impl Segments {
    /// A segment is usually at most this part of a record, so that at least nine half-overlapping ones are averaged.
    pub const USUAL_PART: f64 = 0.2;

    /// Returns half-overlapping segments with Hann's window, without removal of a trend.
    pub fn hann(length: usize) -> Segments {
        Segments { length, overlap: length / 2, window: Window::Hann, detrend: Detrend::None }
    }

    /// Returns segments in turn, without window and without removal of a trend: periods, or a whole record.
    pub fn rectangular(length: usize) -> Segments {
        Segments { length, overlap: 0, window: Window::Rectangular, detrend: Detrend::None }
    }

    /// Returns the largest power of two of samples that is at most this part of a record; `None` of a record that is too short.
    pub fn power_of_two(samples: usize, part: f64) -> Option<usize> {
        let most = (part * samples as f64) as usize;
        (most >= 2).then(|| 1 << most.ilog2())
    }

    /// Returns the first samples of the segments of a record.
    fn starts(&self, samples: usize) -> impl Iterator<Item = usize> + use<> {
        let count = if samples < self.length { 0 } else { (samples - self.length) / (self.length - self.overlap) + 1 };
        let step = self.length - self.overlap;
        (0..count).map(move |index| index * step)
    }

    /// Checks that segments fit a record.
    fn check(&self, samples: usize) -> Result<(), SpectraError> {
        if !(2..=samples).contains(&self.length) {
            return Err(SpectraError::Segment { segment: self.length, samples });
        }
        if self.overlap >= self.length {
            return Err(SpectraError::Overlap { segment: self.length, overlap: self.overlap });
        }
        Ok(())
    }

    /// Returns the degrees of freedom of a density that is averaged over the segments of one or several records, of which
    /// `counts` are the numbers of segments.
    ///
    /// Welch, as above, eq. 12: the densities of two segments that are m steps apart have the correlation ρₘ = [Σ w(n) w(n +
    /// m step)]²/[Σ w²]² for white noise, so a mean of S segments has the relative variance [S + 2 Σₘ (S − m) ρₘ]/S², and a
    /// χ² variable of ν degrees of freedom has 2/ν.
    pub fn degrees_of_freedom(&self, counts: &[usize]) -> f64 {
        let window = self.window.values(self.length);
        let step = self.length - self.overlap;
        let energy: f64 = window.iter().map(|w| w * w).sum();
        let correlations: Vec<f64> = (1..self.length.div_ceil(step))
            .map(|m| {
                let shared: f64 = window.iter().zip(&window[m * step..]).map(|(a, b)| a * b).sum();
                (shared / energy) * (shared / energy)
            })
            .collect();
        let sum = |count: &usize| {
            let pairs = correlations.iter().zip(1..*count).map(|(rho, m)| (*count - m) as f64 * rho);
            *count as f64 + 2.0 * pairs.sum::<f64>()
        };
        let total: usize = counts.iter().sum();
        2.0 * (total * total) as f64 / counts.iter().map(sum).sum::<f64>()
    }
}

/// Channels of one record: all have the same number of samples.
#[derive(Clone, Copy, Debug)]
pub struct Signals<'a> {
    /// Inputs, such as forces; none for power spectra alone.
    pub inputs: &'a [&'a [f64]],
    /// Outputs, such as accelerations.
    pub outputs: &'a [&'a [f64]],
}

/// Averaged power and cross spectra of inputs and outputs, one-sided densities in (unit · unit)/Hz.
///
/// The names of the fields are those of the sums: `conj(first) · second`.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossSpectra {
    /// Frequencies of the lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// Number of segments that were averaged.
    pub averages: usize,
    /// Degrees of freedom ν of the densities, 2 for a single segment. At 0 Hz and half the sample rate, whose lines are real,
    /// it is half as many.
    pub degrees_of_freedom: f64,
    /// Equivalent noise bandwidth of the window, fs Σ w²/(Σ w)², Hz. The mean square of a sinusoid is its density times this
    /// bandwidth.
    pub noise_bandwidth_hz: f64,
    /// Densities between the inputs: `[i][j][line]` is conj(Xᵢ) Xⱼ.
    pub between_inputs: Vec<Vec<Vec<Complex<f64>>>>,
    /// Densities from inputs to outputs: `[i][o][line]` is conj(Xᵢ) Yₒ.
    pub to_outputs: Vec<Vec<Vec<Complex<f64>>>>,
    /// Densities of the outputs: `[o][line]` is |Yₒ|².
    pub outputs: Vec<Vec<f64>>,
}

impl CrossSpectra {
    /// Averages the segments of one or several records with the same channels, `rate_hz` samples per second.
    ///
    /// # Errors
    /// [`SpectraError`] if the records don't have the same channels, or the segments don't fit them.
    pub fn estimate(rate_hz: f64, records: &[Signals<'_>], segments: &Segments) -> Result<CrossSpectra, SpectraError> {
        check_records(rate_hz, records, segments)?;
        let inputs = records[0].inputs.len();
        let outputs = records[0].outputs.len();
        let length = segments.length;
        let window = segments.window.values(segments.length);
        let lines = length / 2 + 1;
        let complex = || vec![Complex::new(0.0, 0.0); lines];
        let mut between_inputs = vec![vec![complex(); inputs]; inputs];
        let mut to_outputs = vec![vec![complex(); outputs]; inputs];
        let mut powers = vec![vec![0.0; lines]; outputs];

        let mut transform = Transform::new(length);
        let mut counts = Vec::new();
        for record in records {
            let starts = segments.starts(samples(record));
            let mut count = 0;
            for start in starts {
                let mut spectrum = |channel: &&[f64]| {
                    let mut segment = channel[start..start + length].to_vec();
                    segments.detrend.remove(&mut segment);
                    segment.iter_mut().zip(&window).for_each(|(sample, w)| *sample *= w);
                    transform.lines(&segment)
                };
                let x: Vec<_> = record.inputs.iter().map(&mut spectrum).collect();
                for (i, first) in x.iter().enumerate() {
                    for (j, second) in x.iter().enumerate() {
                        add_product(&mut between_inputs[i][j], first, second);
                    }
                }
                for (o, channel) in record.outputs.iter().enumerate() {
                    let y = spectrum(channel);
                    x.iter().enumerate().for_each(|(i, first)| add_product(&mut to_outputs[i][o], first, &y));
                    powers[o].iter_mut().zip(&y).for_each(|(sum, line)| *sum += line.norm_sqr());
                }
                count += 1;
            }
            counts.push(count);
        }

        let averages: usize = counts.iter().sum();
        let energy: f64 = window.iter().map(|w| w * w).sum();
        let area: f64 = window.iter().sum();
        let scale = |line: usize| {
            let sides = if line == 0 || 2 * line == length { 1.0 } else { 2.0 };
            sides / (rate_hz * energy * averages as f64)
        };
        for sums in between_inputs.iter_mut().chain(&mut to_outputs).flatten() {
            sums.iter_mut().enumerate().for_each(|(line, sum)| *sum *= scale(line));
        }
        for sums in &mut powers {
            sums.iter_mut().enumerate().for_each(|(line, sum)| *sum *= scale(line));
        }
        Ok(CrossSpectra {
            frequency_hz: (0..lines).map(|line| line as f64 * rate_hz / length as f64).collect(),
            averages,
            degrees_of_freedom: segments.degrees_of_freedom(&counts),
            noise_bandwidth_hz: rate_hz * energy / (area * area),
            between_inputs,
            to_outputs,
            outputs: powers,
        })
    }

    /// Returns the two factors by which a density of an input or output is multiplied for the interval that contains the true
    /// density with the probability `confidence`, 0 to 1: ν/χ²(½ + ½c) and ν/χ²(½ − ½c), with χ²(p) the quantile of ν degrees
    /// of freedom. The signal must be Gaussian, and its density smooth over a few lines.
    ///
    /// J. S. Bendat, A. G. Piersol, "Random Data", 4th edition 2010, section 8.5.
    pub fn confidence_factors(&self, confidence: f64) -> [f64; 2] {
        let freedom = self.degrees_of_freedom;
        [0.5 + 0.5 * confidence, 0.5 - 0.5 * confidence]
            .map(|probability| freedom / distribution::chi_square_quantile(probability, freedom))
    }
}

/// Fourier transform of real segments of one length; a power of two takes the shortest time.
enum Transform {
    PowerOfTwo(Fft),
    AnyLength(Lines),
}

impl Transform {
    fn new(length: usize) -> Transform {
        if length.is_power_of_two() {
            // Bluestein's transform of any length takes two of these, each over more than one and a half times as many
            // values.
            return Transform::PowerOfTwo(Fft::at_least(length));
        }
        Transform::AnyLength(Lines::new(length, length, 0, length / 2 + 1))
    }

    /// Returns the lines from 0 Hz to half the sample rate.
    fn lines(&mut self, segment: &[f64]) -> Vec<Complex<f64>> {
        let values = segment.iter().map(|sample| Complex::new(*sample, 0.0));
        match self {
            Transform::PowerOfTwo(fft) => {
                let mut values: Vec<_> = values.collect();
                fft.forward(&mut values);
                values.truncate(segment.len() / 2 + 1);
                values
            }
            Transform::AnyLength(lines) => lines.transform(values),
        }
    }
}

/// Adds conj(first) · second.
fn add_product(sums: &mut [Complex<f64>], first: &[Complex<f64>], second: &[Complex<f64>]) {
    for ((sum, first), second) in sums.iter_mut().zip(first).zip(second) {
        *sum += first.conj() * second;
    }
}

/// Returns the number of samples of a record, whose channels were checked to be equally long.
fn samples(record: &Signals<'_>) -> usize {
    record.inputs.iter().chain(record.outputs).next().map_or(0, |channel| channel.len())
}

/// Checks that a sample rate is possible.
pub(crate) fn check_rate(rate_hz: f64) -> Result<(), SpectraError> {
    if rate_hz > 0.0 && rate_hz.is_finite() { Ok(()) } else { Err(SpectraError::Rate { rate_hz }) }
}

/// Checks that all samples of a channel of a record are numbers.
pub(crate) fn check_finite(record: usize, samples: &[f64]) -> Result<(), SpectraError> {
    match samples.iter().position(|sample| !sample.is_finite()) {
        Some(sample) => Err(SpectraError::NotFinite { record, sample }),
        None => Ok(()),
    }
}

fn check_records(rate_hz: f64, records: &[Signals<'_>], segments: &Segments) -> Result<(), SpectraError> {
    check_rate(rate_hz)?;
    let first = records.first().ok_or(SpectraError::NoRecord)?;
    let inputs = first.inputs.len();
    let outputs = first.outputs.len();
    for (index, record) in records.iter().enumerate() {
        let length = samples(record);
        let same = record.inputs.len() == inputs && record.outputs.len() == outputs;
        if !same || record.inputs.iter().chain(record.outputs).any(|channel| channel.len() != length) {
            return Err(SpectraError::Channels { record: index, inputs, outputs });
        }
        segments.check(length)?;
        record.inputs.iter().chain(record.outputs).try_for_each(|channel| check_finite(index, channel))?;
    }
    Ok(())
}
