//! Frequency responses, averaged as by a bench analyser.

use alloc::vec::Vec;

use nalgebra::Complex;
use resonarm_modal::spectra::{CrossSpectra, Segments, Signals, SpectraError};

use super::error::IdentifyError;
use super::record::Record;
use resonarm_modal::Band;

/// Least number of samples of a segment.
const LEAST_SEGMENT: usize = 16;

/// Method of averaging a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Averaging {
    /// Averages segments of this many samples with a Hann window, half overlapping, for noise and sweeps. A resonance narrower
    /// than a few lines comes out too low and too wide.
    Welch(usize),
    /// Averages periods of this many samples without a window, from the first force on. The first period has
    /// the initial transient and is left out if there are more than two.
    Periods(usize),
    /// Takes the whole record once, without a window, for an impact. Where the force is silent it is set to
    /// zero.
    Single,
}

/// Estimated frequency responses of the accelerations over the force.
#[derive(Clone, Debug, PartialEq)]
pub struct FrequencyResponseEstimate {
    /// Method of averaging that was used.
    pub averaging: Averaging,
    /// Number of segments or periods that were averaged.
    pub averages: usize,
    /// Frequencies of the lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// Estimate H1 = S_fa/S_ff of each response, (m/s²)/N, in which noise of the acceleration averages out.
    pub h1: Vec<Vec<Complex<f64>>>,
    /// Estimate H2 = S_aa/S_af of each response, in which noise of the force averages out.
    pub h2: Vec<Vec<Complex<f64>>>,
    /// Coherence γ² = |S_fa|²/(S_ff S_aa), 0 to 1; `None` without averages, where it would always be 1.
    pub coherence: Option<Vec<Vec<f64>>>,
}

/// Estimates the frequency responses of the accelerations over the force in a band.
///
/// # Errors
/// [`IdentifyError`] if the band or the segments don't fit the record, or the force has no energy at one of the lines.
pub fn frequency_response(
    record: &Record,
    band: Band,
    averaging: Averaging,
) -> Result<FrequencyResponseEstimate, IdentifyError> {
    record.check(band)?;
    let samples = record.samples();
    let [begin, end] = record.forced;
    let (start, segments) = match averaging {
        Averaging::Single => (0, Segments::rectangular(samples)),
        Averaging::Welch(length) => {
            check_segment(length, samples)?;
            (0, Segments::hann(length))
        }
        Averaging::Periods(length) => {
            check_segment(length, samples - begin)?;
            // Of two periods both are kept: one alone would give no coherence.
            let is_settled = (samples - begin) / length > 2;
            (begin + if is_settled { length } else { 0 }, Segments::rectangular(length))
        }
    };
    let spacing_hz = record.rate_hz() / segments.length as f64;
    let first = libm::ceil(band.from_hz / spacing_hz) as usize;
    let lines = first..libm::floor(band.to_hz / spacing_hz) as usize + 1;
    if lines.is_empty() {
        let least = libm::ceil(record.rate_hz() / (band.to_hz - band.from_hz)) as usize;
        return Err(IdentifyError::TooShort { samples: segments.length, least });
    }
    // Behind an impact the head reads only noise, which would add to the whole spectrum of the force.
    let is_kept = |n: usize| averaging != Averaging::Single || (begin..end).contains(&n);
    let keep = |(n, force): (usize, &f64)| if is_kept(n) { *force } else { 0.0 };
    let force_n: Vec<f64> = record.force_n.iter().enumerate().map(keep).collect();
    let outputs: Vec<&[f64]> = record.responses().iter().map(|response| &response.acceleration_m_s2[start..]).collect();
    let signals = [Signals { inputs: &[&force_n[start..]], outputs: &outputs }];
    let spectra = CrossSpectra::estimate(record.rate_hz(), &signals, &segments).map_err(|error| match error {
        SpectraError::NotFinite { sample, .. } => IdentifyError::NotFinite { reading: start + sample },
        other => IdentifyError::Modal(other.into()),
    })?;
    let force = &spectra.between_inputs[0][0];
    if lines.clone().all(|line| force[line].re <= 0.0) {
        return Err(IdentifyError::NoEnergy(band));
    }
    let of_outputs = |value: &dyn Fn(usize, usize) -> Complex<f64>| -> Vec<Vec<Complex<f64>>> {
        (0..outputs.len()).map(|output| lines.clone().map(|line| value(output, line)).collect()).collect()
    };
    let cross = |output: usize, line: usize| spectra.to_outputs[0][output][line];
    let power = |output: usize, line: usize| Complex::new(spectra.outputs[output][line], 0.0);
    let coherence = |output: usize| {
        let of_line = |line: usize| cross(output, line).norm_sqr() / (force[line].re * spectra.outputs[output][line]);
        lines.clone().map(of_line).collect()
    };
    Ok(FrequencyResponseEstimate {
        averaging,
        averages: spectra.averages,
        frequency_hz: spectra.frequency_hz[lines.clone()].to_vec(),
        h1: of_outputs(&|output, line| cross(output, line) / force[line].re),
        h2: of_outputs(&|output, line| power(output, line) / cross(output, line).conj()),
        coherence: (spectra.averages > 1).then(|| (0..outputs.len()).map(coherence).collect()),
    })
}

fn check_segment(segment: usize, samples: usize) -> Result<(), IdentifyError> {
    if (LEAST_SEGMENT..=samples).contains(&segment) { Ok(()) } else { Err(IdentifyError::Segment { segment, samples }) }
}
