//! Frequency responses, averaged as by a bench analyser.

use alloc::vec::Vec;
use core::f64::consts::PI;

use nalgebra::Complex;

use super::{Band, CHANNELS, IdentifyError, Record};
use resonarm_numeric::dft::Lines;

/// Method of averaging a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Averaging {
    /// Averages segments of this many samples with a Hann window, half overlapping (P. D. Welch, "The Use of
    /// Fast Fourier Transform for the Estimation of Power Spectra", IEEE Trans. Audio Electroacoust. 15
    /// (1967)), for noise and sweeps. A resonance narrower than two lines comes out too low and too wide.
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
    /// Estimate H1 = S_fa/S_ff of each channel, (m/s²)/N, in which noise of the acceleration averages out.
    pub h1: [Vec<Complex<f64>>; CHANNELS],
    /// Estimate H2 = S_aa/S_af of each channel, in which noise of the force averages out.
    pub h2: [Vec<Complex<f64>>; CHANNELS],
    /// Coherence γ² = |S_fa|²/(S_ff S_aa), 0 to 1; `None` without averages, where it would always be 1.
    pub coherence: Option<[Vec<f64>; CHANNELS]>,
}

/// Averages of the spectra, line by line.
struct Spectra {
    ff: Vec<f64>,
    aa: [Vec<f64>; CHANNELS],
    fa: [Vec<Complex<f64>>; CHANNELS],
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
    let (length, starts, hann): (usize, Vec<usize>, bool) = match averaging {
        Averaging::Single => (samples, [0].to_vec(), false),
        Averaging::Welch(length) => {
            check_segment(length, samples)?;
            (length, (0..=samples - length).step_by((length / 2).max(1)).collect(), true)
        }
        Averaging::Periods(length) => {
            let [start, _] = record.forced();
            check_segment(length, samples - start)?;
            let all: Vec<usize> = (start..=samples - length).step_by(length).collect();
            // Of two periods both are kept: one alone would give no coherence.
            let settled = if all.len() > 2 { all[1..].to_vec() } else { all };
            (length, settled, false)
        }
    };
    let spacing_hz = record.rate_hz() / length as f64;
    let first = libm::ceil(band.from_hz / spacing_hz) as usize;
    let count = (libm::floor(band.to_hz / spacing_hz) as usize + 1).saturating_sub(first);
    if count == 0 {
        let least = libm::ceil(record.rate_hz() / (band.to_hz - band.from_hz)) as usize;
        return Err(IdentifyError::TooShort { samples: length, least });
    }
    let transform = Lines::new(length, length, first, count);
    let taper: Vec<f64> = (0..length).map(|n| if hann { squared_sine(n, length) } else { 1.0 }).collect();
    let lines = |values: &[f64], start: usize| {
        transform.transform(values[start..].iter().zip(&taper).map(|(value, taper)| Complex::new(value * taper, 0.0)))
    };
    let force_n = force(record, averaging);
    let mut spectra = Spectra::new(count);
    for start in &starts {
        let force = lines(&force_n, *start);
        let accelerations: [_; CHANNELS] = core::array::from_fn(|i| lines(&record.accelerations()[i], *start));
        spectra.add(&force, &accelerations);
    }
    if spectra.ff.iter().all(|power| *power <= 0.0) {
        return Err(IdentifyError::NoEnergy { from_hz: band.from_hz, to_hz: band.to_hz });
    }
    let frequency_hz = (0..count).map(|k| (first + k) as f64 * spacing_hz).collect();
    Ok(spectra.estimate(averaging, starts.len(), frequency_hz))
}

/// Returns the force; for a single record without the noise before and after it.
fn force(record: &Record, averaging: Averaging) -> Vec<f64> {
    let [start, end] = record.forced();
    let keep = |n: usize| averaging != Averaging::Single || (start..end).contains(&n);
    record.force_n().iter().enumerate().map(|(n, force)| if keep(n) { *force } else { 0.0 }).collect()
}

fn check_segment(segment: usize, samples: usize) -> Result<(), IdentifyError> {
    if (16..=samples).contains(&segment) { Ok(()) } else { Err(IdentifyError::Segment { segment, samples }) }
}

/// Returns the value of the Hann window at a sample.
fn squared_sine(n: usize, length: usize) -> f64 {
    let sine = libm::sin(PI * (n as f64 / length as f64));
    sine * sine
}

impl Spectra {
    fn new(count: usize) -> Spectra {
        let zeros = || alloc::vec![0.0; count];
        let complex = || alloc::vec![Complex::new(0.0, 0.0); count];
        Spectra { ff: zeros(), aa: core::array::from_fn(|_| zeros()), fa: core::array::from_fn(|_| complex()) }
    }

    fn add(&mut self, force: &[Complex<f64>], accelerations: &[Vec<Complex<f64>>; CHANNELS]) {
        for (k, f) in force.iter().enumerate() {
            self.ff[k] += f.norm_sqr();
            for (i, acceleration) in accelerations.iter().enumerate() {
                self.aa[i][k] += acceleration[k].norm_sqr();
                self.fa[i][k] += f.conj() * acceleration[k];
            }
        }
    }

    fn estimate(&self, averaging: Averaging, averages: usize, frequency_hz: Vec<f64>) -> FrequencyResponseEstimate {
        let lines = 0..self.ff.len();
        let h1 = |i: usize| lines.clone().map(|k| self.fa[i][k] / self.ff[k]).collect();
        let h2 = |i: usize| lines.clone().map(|k| (self.fa[i][k].conj() / self.aa[i][k]).inv()).collect();
        let coherence =
            |i: usize| lines.clone().map(|k| self.fa[i][k].norm_sqr() / (self.ff[k] * self.aa[i][k])).collect();
        FrequencyResponseEstimate {
            averaging,
            averages,
            frequency_hz,
            h1: core::array::from_fn(h1),
            h2: core::array::from_fn(h2),
            coherence: (averages > 1).then(|| core::array::from_fn(coherence)),
        }
    }
}
