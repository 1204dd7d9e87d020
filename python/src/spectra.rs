//! Spectra of a recording's channels: power spectral densities, frequency responses with their coherence, and shock
//! response spectra.

use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyByteArray;
use resonarm::modal::spectra::{self, CrossSpectra, Detrend, Estimator, Segments, ShockResponse, Window};
use resonarm::signals::Signals;

use crate::errors;
use crate::recording::Recording;
use crate::rows::{Rows, numbers};

/// Channels by their names, and the first and the last simulated time, s.
type Wanted = (Vec<String>, [Option<f64>; 2]);

/// Length of a segment, s, or `None` for the usual one; part of it that overlaps; window and trend, by their names.
type Cut = (Option<f64>, f64, String, String);

/// Name and unit of each channel, and how many of its values are clipped.
type Channels = Vec<(String, &'static str, usize)>;

/// The number of segments, the degrees of freedom, the noise bandwidth, Hz, and the factors of the confidence 0.95.
type Average = (usize, f64, f64, [f64; 2]);

/// Probability with which a density is within the stated factors.
const CONFIDENCE: f64 = 0.95;

fn read(recording: &Recording, (names, range): &Wanted) -> PyResult<Signals> {
    Signals::read(&recording.inner, names, *range).map_err(errors::signals)
}

fn channels(signals: &Signals) -> Channels {
    let of = signals.channels.iter().zip(&signals.clipped);
    of.map(|(channel, clipped)| (channel.name.to_string(), channel.quantity.unit(), *clipped)).collect()
}

fn segments(signals: &Signals, (segment_s, part, window, detrend): &Cut) -> PyResult<Segments> {
    let window = Window::ALL.into_iter().find(|known| known.name() == window).ok_or_else(|| {
        let known = Window::ALL.map(Window::name).join(", ");
        errors::value(format!("window is {window:?}: it must be one of {known}"))
    })?;
    let detrend = Detrend::ALL.into_iter().find(|known| known.name() == detrend).ok_or_else(|| {
        let known = Detrend::ALL.map(Detrend::name).join(", ");
        errors::value(format!("detrend is {detrend:?}: it must be one of {known}"))
    })?;
    if !(0.0..1.0).contains(part) {
        return Err(errors::value(format!("overlap is {part}: it must be from 0 to below 1")));
    }
    let length = match segment_s {
        Some(segment_s) => (segment_s * signals.rate_hz).round() as usize,
        None => Segments::power_of_two(signals.count(), Segments::USUAL_PART).unwrap_or(signals.count()),
    };
    Ok(Segments { length, overlap: (part * length as f64) as usize, window, detrend })
}

/// The spectra of signals, the first of which are inputs.
fn estimate(signals: &Signals, inputs: usize, cut: &Cut) -> PyResult<CrossSpectra> {
    let values: Vec<&[f64]> = signals.values.iter().map(Vec::as_slice).collect();
    let (inputs, outputs) = values.split_at(inputs);
    let record = spectra::Signals { inputs, outputs };
    CrossSpectra::estimate(signals.rate_hz, &[record], &segments(signals, cut)?).map_err(errors::value)
}

fn average(spectra: &CrossSpectra) -> Average {
    let factors = spectra.confidence_factors(CONFIDENCE);
    (spectra.averages, spectra.degrees_of_freedom, spectra.noise_bandwidth_hz, factors)
}

/// Power spectral densities without the droop of the converters: rows of the frequency and the density of each channel.
#[pyfunction]
pub fn densities<'py>(
    py: Python<'py>,
    recording: &Recording,
    wanted: Wanted,
    cut: Cut,
) -> PyResult<(Channels, Average, Bound<'py, PyByteArray>)> {
    let (signals, spectra) = py.detach(|| {
        let signals = read(recording, &wanted)?;
        let mut spectra = estimate(&signals, 0, &cut)?;
        spectra.outputs.iter_mut().for_each(|density| signals.correct_droop(&spectra.frequency_hz, density));
        Ok::<_, PyErr>((signals, spectra))
    })?;
    let mut rows = Rows::default();
    for (line, hz) in spectra.frequency_hz.iter().enumerate() {
        rows.numbers(&[*hz]);
        spectra.outputs.iter().for_each(|density| rows.numbers(&density[line..=line]));
    }
    Ok((channels(&signals), average(&spectra), rows.into_bytes(py)?))
}

/// Frequency responses H1 of channels to the first: rows of the frequency, then real and imaginary part, coherence and
/// standard deviation of each.
#[pyfunction]
pub fn frequency_responses<'py>(
    py: Python<'py>,
    recording: &Recording,
    wanted: Wanted,
    cut: Cut,
) -> PyResult<(Channels, Average, Bound<'py, PyByteArray>)> {
    let (signals, spectra, found) = py.detach(|| {
        let signals = read(recording, &wanted)?;
        if let (Some(name), Some(first)) = (wanted.0.first(), signals.channels.first())
            // A vector stands for all its components, and a response has one reference.
            && first.name.as_str() != name
        {
            let message = format!("reference {name} is a vector: name one of its components, as {}", first.name);
            return Err(errors::value(message));
        }
        let spectra = estimate(&signals, 1, &cut)?;
        let found = spectra.responses(Estimator::H1).map_err(errors::value)?;
        Ok((signals, spectra, found))
    })?;
    let outputs = 0..found.responses.len();
    let deviations: Vec<Option<Vec<f64>>> = outputs.map(|output| found.standard_deviation(output, 0)).collect();
    let mut rows = Rows::default();
    for (line, hz) in spectra.frequency_hz.iter().enumerate() {
        rows.numbers(&[*hz]);
        for (output, deviation) in deviations.iter().enumerate() {
            // The index 0 is the only input, the reference.
            let value = found.responses[output][0][line];
            // A single segment has no deviation.
            let deviation = deviation.as_ref().map_or(f64::NAN, |deviation| deviation[line]);
            rows.numbers(&[value.re, value.im, found.coherence[output][line], deviation]);
        }
    }
    Ok((channels(&signals), average(&spectra), rows.into_bytes(py)?))
}

/// Shock response spectra at these frequencies, Hz: rows of the responses to the positive and to the negative side of each
/// channel.
#[pyfunction]
pub fn shock_responses<'py>(
    py: Python<'py>,
    recording: &Recording,
    wanted: Wanted,
    quality: f64,
    frequency_hz: PyBackedBytes,
) -> PyResult<(Channels, Bound<'py, PyByteArray>)> {
    let (signals, found) = py.detach(|| {
        let signals = read(recording, &wanted)?;
        let frequency_hz = numbers(&frequency_hz);
        let of = |values: &Vec<f64>| ShockResponse::estimate(signals.rate_hz, values, quality, &frequency_hz);
        let found = signals.values.iter().map(of).collect::<Result<Vec<_>, _>>().map_err(errors::value)?;
        Ok::<_, PyErr>((signals, found))
    })?;
    let mut rows = Rows::default();
    for line in 0..found.first().map_or(0, |first| first.frequency_hz.len()) {
        found.iter().for_each(|of| rows.numbers(&[of.positive[line], of.negative[line]]));
    }
    Ok((channels(&signals), rows.into_bytes(py)?))
}
