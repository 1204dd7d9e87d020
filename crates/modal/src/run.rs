//! Measured data: records of time series, measured frequency responses, and the spectra that are fitted.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;
use resonarm_numeric::dft::Lines;

use crate::columns::{Columns, Lane};
use crate::error::ModalError;
use crate::model::{Grid, Quantity};
use crate::spectra::{SpectraError, check_finite, check_rate};

/// A record is at rest where the standard deviation is below this part of the peak.
const REST: f64 = 1e-3;
/// … or below this many standard deviations of the instrument's noise, if that is more.
const NOISY_REST: f64 = 1.2;
/// The first sample of a record at rest whose force begins at once is below this part of the peak, or this many standard
/// deviations of the noise.
const FIRST_REST: f64 = 0.03;
const FIRST_NOISY_REST: f64 = 6.0;
/// The end of a record is its last 1/`END_PART`, at least `LEAST_END` samples.
const END_PART: usize = 50;
const LEAST_END: usize = 20;
/// A force begins at the first sample above this part of its peak.
const ONSET: f64 = 0.01;
/// Least number of samples before the force from which rest is judged.
const LEAST_QUIET: usize = 8;

/// A band of frequencies, Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Lowest frequency, above 0.
    pub from_hz: f64,
    /// Highest frequency, above the lowest.
    pub to_hz: f64,
}

/// A channel of a record: samples of one degree of freedom.
#[derive(Clone, Copy, Debug)]
pub struct Channel<'a> {
    /// Number of the degree of freedom, a point and direction of the structure. A response with the number of a reference is
    /// its driving point; their directions must be the same.
    pub dof: usize,
    /// Samples at equal intervals.
    pub samples: &'a [f64],
    /// Standard deviation of the noise of the instrument in each sample, with rounding, if it is known. The identification
    /// estimates the noise itself, and compares.
    pub noise: Option<f64>,
}

/// Simultaneous samples of a run: all channels have the same number of samples.
#[derive(Clone, Debug)]
pub struct Record<'a> {
    /// Samples per second, Hz.
    pub rate_hz: f64,
    /// Forces, at least one. Several must not be proportional to each other.
    pub references: Vec<Channel<'a>>,
    /// Responses, at least one.
    pub responses: Vec<Channel<'a>>,
}

/// A measured frequency response.
#[derive(Clone, Copy, Debug)]
pub struct ResponseFunction<'a> {
    /// Degree of freedom of the force.
    pub reference: usize,
    /// Degree of freedom of the response.
    pub response: usize,
    /// Values at the frequencies of the set, in units of the response over those of the force.
    pub values: &'a [Complex<f64>],
}

/// Whether the transient of a record is a part of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TransientModel {
    /// A record that is at rest at both ends has no transient, all others do. Rest is a standard deviation below 0.1 % of
    /// the peak, or 1.2 times the known noise of the instrument, in the last 2 % of every response, and before the force begins;
    /// if that is at once, a first sample below 3 % of the peak, or six times the noise.
    #[default]
    Automatic,
    /// Every record has a transient. After an impact it can't be told from the response, which is a decay itself: the poles
    /// and shapes become wrong.
    Present,
    /// No record has a transient: whole periods of a settled response, or rest at both ends.
    Absent,
}

/// Variances of complex values at a line: those of a sample, as spectra are divided by √N.
#[derive(Clone, Debug)]
pub(crate) struct Variances {
    pub responses: Vec<f64>,
    pub references: Vec<f64>,
}

/// The spectra of a run in the band.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub grid: Grid,
    /// Spectra of the references as they were measured.
    pub measured_references: Columns,
    pub measured_responses: Columns,
    /// Spectra that are fitted: with the force of least noise in place of the measured one, see [`crate::noise`].
    pub references: Columns,
    pub responses: Columns,
    /// Variances of noise, from which the weights come; `None` while there are no weights.
    pub noise: Option<Variances>,
    /// Weights of the squared residuals of each response, or one column for all; none while all are 1.
    pub weights: Columns,
    pub transient: bool,
    /// Degrees of freedom of references and responses. In a set of frequency responses each output has its own reference.
    pub pairs: Pairs,
    /// Known noise of the instruments.
    pub reference_noise: Vec<Option<f64>>,
    pub response_noise: Vec<Option<f64>>,
    /// Distance of two lines, Hz.
    pub spacing_hz: f64,
    /// Whether the references have noise that is estimated: false for a set of frequency responses.
    pub noisy_references: bool,
}

/// Degrees of freedom of the references and responses of a run.
#[derive(Clone, Debug)]
pub(crate) enum Pairs {
    /// Every response to every reference.
    All { references: Vec<usize>, responses: Vec<usize> },
    /// One reference, of unit spectrum, for all: the reference and the response of each output.
    Each(Vec<[usize; 2]>),
}

impl Pairs {
    /// Degrees of freedom [reference, response] of an output and a reference of the run.
    pub fn dofs(&self, output: usize, reference: usize) -> [usize; 2] {
        match self {
            Pairs::All { references, responses } => [references[reference], responses[output]],
            Pairs::Each(pairs) => pairs[output],
        }
    }
}

impl Run {
    /// Returns the whole record's spectra in the band: discrete Fourier transforms without a window, divided by √N, so that
    /// noise has the variance of a sample at every line.
    pub fn of_record(
        index: usize,
        record: &Record<'_>,
        band: Band,
        quantity: Quantity,
        transient: TransientModel,
    ) -> Result<Run, ModalError> {
        check_record(index, record)?;
        let samples = record.references[0].samples.len();
        check_band(band, 0.5 * record.rate_hz)?;
        let spacing_hz = record.rate_hz / samples as f64;
        let first = libm::ceil(band.from_hz / spacing_hz) as usize;
        let last = (libm::floor(band.to_hz / spacing_hz) as usize).min(samples / 2);
        let lines = (last + 1).saturating_sub(first);
        if lines == 0 {
            return Err(ModalError::TooFewLines { lines, least: 1 });
        }
        let transform = Lines::new(samples, samples, first, lines);
        let scale = 1.0 / libm::sqrt(samples as f64);
        let spectra = |channels: &[Channel<'_>]| {
            let mut columns = Columns::zeros(lines, channels.len());
            for (index, channel) in channels.iter().enumerate() {
                columns.set(index, &transform.transform(channel.samples.iter().map(|x| Complex::new(x * scale, 0.0))));
            }
            columns
        };
        let references = spectra(&record.references);
        let responses = spectra(&record.responses);
        let frequency_hz = (first..=last).map(|line| line as f64 * spacing_hz).collect();
        let dofs = |channels: &[Channel<'_>]| channels.iter().map(|channel| channel.dof).collect();
        let noise = |channels: &[Channel<'_>]| channels.iter().map(|channel| channel.noise).collect();
        let grid = Grid::new(frequency_hz, record.rate_hz, quantity);
        let pairs = Pairs::All { references: dofs(&record.references), responses: dofs(&record.responses) };
        let run = Run {
            transient: match transient {
                TransientModel::Automatic => !rests(record),
                TransientModel::Present => true,
                TransientModel::Absent => false,
            },
            reference_noise: noise(&record.references),
            response_noise: noise(&record.responses),
            noisy_references: true,
            ..Run::measured(grid, references, responses, pairs, spacing_hz)
        };
        run.check_power(index)?;
        Ok(run)
    }

    /// Returns a set of frequency responses as the responses to a unit force at every line.
    pub fn of_functions(
        frequency_hz: &[f64],
        functions: &[ResponseFunction<'_>],
        band: Band,
        quantity: Quantity,
    ) -> Result<Run, ModalError> {
        let spacing_hz = check_frequencies(frequency_hz)?;
        let lines = frequency_hz.len();
        if functions.is_empty() {
            return Err(ModalError::NoData);
        }
        for (response, function) in functions.iter().enumerate() {
            if function.values.len() != lines {
                return Err(ModalError::Length { response, values: function.values.len(), lines });
            }
            if let Some(sample) =
                function.values.iter().position(|value| !(value.re.is_finite() && value.im.is_finite()))
            {
                return Err(SpectraError::NotFinite { record: response, sample }.into());
            }
        }
        check_band(band, frequency_hz[lines - 1])?;
        // Frequencies rise, so that those of the band are neighbours.
        let lines =
            frequency_hz.partition_point(|f| *f < band.from_hz)..frequency_hz.partition_point(|f| *f <= band.to_hz);
        if lines.is_empty() {
            return Err(ModalError::TooFewLines { lines: 0, least: 1 });
        }
        // With a unit spectrum as the force a measured frequency response is the spectrum of a response: one
        // identification serves both.
        let ones = vec![Complex::new(1.0, 0.0); lines.len()];
        let references = Columns::of_values(lines.len(), [ones.as_slice()].into_iter());
        let values = functions.iter().map(|function| &function.values[lines.clone()]);
        let responses = Columns::of_values(lines.len(), values.collect::<Vec<_>>().into_iter());
        // Without a transient the sample rate has no meaning.
        let grid = Grid::new(frequency_hz[lines.clone()].to_vec(), 2.0 * frequency_hz[lines.end - 1], quantity);
        let pairs = Pairs::Each(functions.iter().map(|function| [function.reference, function.response]).collect());
        let run = Run::measured(grid, references, responses, pairs, spacing_hz);
        run.check_power(0)?;
        Ok(run)
    }

    /// A run with these spectra, without a transient, weights and known noise.
    fn measured(grid: Grid, references: Columns, responses: Columns, pairs: Pairs, spacing_hz: f64) -> Run {
        Run {
            grid,
            noise: None,
            weights: Columns::default(),
            transient: false,
            pairs,
            reference_noise: vec![None; references.count()],
            response_noise: vec![None; responses.count()],
            spacing_hz,
            noisy_references: false,
            measured_references: references.clone(),
            measured_responses: responses.clone(),
            references,
            responses,
        }
    }

    pub fn outputs(&self) -> usize {
        self.responses.count()
    }

    pub fn inputs(&self) -> usize {
        self.references.count()
    }

    /// Weights of an output, if there are any.
    pub fn weights_of(&self, output: usize) -> Option<&[Lane]> {
        match self.weights.count() {
            0 => None,
            1 => Some(self.weights.column(0)),
            _ => Some(self.weights.column(output)),
        }
    }

    /// Discards weights and corrections: the spectra are those that were measured.
    pub fn reset(&mut self) {
        self.noise = None;
        self.weights = Columns::default();
        self.references = self.measured_references.clone();
        self.responses = self.measured_responses.clone();
    }

    /// Checks that every channel has power in the band.
    fn check_power(&self, run: usize) -> Result<(), ModalError> {
        let silent = |column: &[Lane]| column.as_flattened().iter().all(|value| *value == 0.0);
        if let Some(reference) = self.references.iter().position(silent) {
            let [dof, _] = self.pairs.dofs(0, reference);
            return Err(ModalError::NoPower { run, dof });
        }
        if let Some(output) = self.responses.iter().position(silent) {
            let [_, dof] = self.pairs.dofs(output, 0);
            return Err(ModalError::Silent { run, dof });
        }
        Ok(())
    }
}

fn check_record(index: usize, record: &Record<'_>) -> Result<(), ModalError> {
    let Record { rate_hz, references, responses } = record;
    check_rate(*rate_hz)?;
    let inputs = references.len();
    let outputs = responses.len();
    if inputs == 0 || outputs == 0 {
        return Err(ModalError::NoData);
    }
    let samples = references[0].samples.len();
    for channel in references.iter().chain(responses) {
        if channel.samples.len() != samples {
            return Err(SpectraError::Channels { record: index, inputs, outputs }.into());
        }
        check_finite(index, channel.samples)?;
    }
    Ok(())
}

fn check_band(band: Band, most_hz: f64) -> Result<(), ModalError> {
    let Band { from_hz, to_hz } = band;
    if from_hz > 0.0 && from_hz < to_hz && to_hz <= most_hz {
        return Ok(());
    }
    Err(ModalError::Band { from_hz, to_hz, most_hz })
}

/// Checks that frequencies rise in equal steps, to a thousandth of a step, and returns the step.
fn check_frequencies(frequency_hz: &[f64]) -> Result<f64, ModalError> {
    let lines = frequency_hz.len();
    if lines < 2 {
        return Err(ModalError::TooFewLines { lines, least: 2 });
    }
    let step = (frequency_hz[lines - 1] - frequency_hz[0]) / (lines - 1) as f64;
    let fits = |line: usize| (frequency_hz[line] - frequency_hz[0] - step * line as f64).abs() <= 1e-3 * step;
    match (0..lines).find(|line| !(step > 0.0 && fits(*line))) {
        Some(line) => Err(ModalError::Frequencies { line, frequency_hz: frequency_hz[line] }),
        None => Ok(step),
    }
}

/// Returns whether a record is at rest at both ends.
fn rests(record: &Record<'_>) -> bool {
    let samples = record.references[0].samples.len();
    let peak = |values: &[f64]| values.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
    // The tail is long enough for a standard deviation to mean something, also of a short record.
    let end = (samples / END_PART).max(LEAST_END).min(samples);
    let onsets = record.references.iter().map(|channel| {
        let least = ONSET * peak(channel.samples);
        channel.samples.iter().position(|value| value.abs() > least).unwrap_or(samples)
    });
    let onset = onsets.min().unwrap_or(0);
    record.responses.iter().all(|channel| {
        let peak = peak(channel.samples);
        let quiet = &channel.samples[..onset];
        let tail = &channel.samples[samples - end..];
        let noise = channel.noise.unwrap_or(0.0);
        let still = (REST * peak).max(NOISY_REST * noise);
        // Of so few samples a standard deviation says little. The first one alone is judged then, by a wider limit,
        // since the response begins with the force.
        let begins = if onset < LEAST_QUIET {
            let least = (FIRST_REST * peak).max(FIRST_NOISY_REST * noise);
            channel.samples.first().is_some_and(|first| first.abs() < least)
        } else {
            deviation(quiet) < still
        };
        begins && deviation(tail) < still
    })
}

/// Returns the root mean square of what is left without the mean.
fn deviation(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    libm::sqrt(values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count)
}
