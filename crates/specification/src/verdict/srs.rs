//! Verdicts on shocks that are specified by their response spectrum.

use alloc::vec::Vec;
use core::f64::consts::FRAC_PI_2;
use core::ops::Range;

use resonarm_modal::spectra::{ShockResponse, SpectraError};
use serde::Serialize;

use super::shock::Quiet;
use super::{Verdict, mean};
use crate::error::VerdictError;
use crate::srs::SrsTest;

/// Size of a sample, in the noise and in the largest sample, from which on it belongs to a shot.
const ABOVE_NOISE: f64 = 8.0;
const ABOVE_LARGEST: f64 = 0.05;
/// Longest quiet time within a shot, in periods of the lowest oscillator.
const QUIET_PERIODS: f64 = 3.0;
/// Least mean deviation of a shot at full level, dB.
const FULL_DB: f64 = -3.0;

/// Response of an oscillator, with its verdict.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SrsLine {
    /// Natural frequency of the oscillator, Hz.
    pub frequency_hz: f64,
    /// Largest acceleration to either side, m/s².
    pub response_m_s2: f64,
    /// Acceleration that is specified there, m/s².
    pub demand_m_s2: f64,
    /// Deviation of the spectrum from the specified one, dB.
    pub deviation_db: f64,
    /// Verdict by the tolerance of the share of the lines.
    pub verdict: Verdict,
}

/// A shot with its response spectrum.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SrsShot {
    /// First sample above the noise, s from the start of the record.
    pub t_s: f64,
    /// Largest acceleration of the record, m/s².
    pub peak_m_s2: f64,
    /// Mean deviation of the lines, dB.
    pub level_db: f64,
    /// Whether the shot is at full level, and so is judged.
    pub is_full: bool,
    /// Shares of the lines that are in, undecided and out.
    pub shares: [f64; 3],
    /// The lines of its response spectrum.
    pub lines: Vec<SrsLine>,
    /// Verdict on this shot alone.
    pub verdict: Verdict,
}

/// Verdict on a shock by its response spectrum.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SrsVerdict {
    /// Verdict on the whole.
    pub verdict: Verdict,
    /// All shots of the record, in the order of time.
    pub shots: Vec<SrsShot>,
    /// Shots at full level.
    pub full: usize,
    /// Shots at full level that the specification asks for.
    pub asked: u32,
    /// Deviation of the noise, m/s².
    pub noise_m_s2: f64,
}

/// Judges a record of shots, `rate_hz` samples a second. A record without a shot at full level is out; one with fewer than are
/// asked for is undecided.
///
/// White noise of deviation σ moves an oscillator of natural frequency f and quality Q by √(π/2 · f Q · 2σ²/fs) (J. W. Miles,
/// 1954), which is the deviation of a line.
///
/// # Errors
/// [`VerdictError`] if no shot is in the record, or its rate is below ten times the highest natural frequency.
pub fn judge_srs(test: &SrsTest, rate_hz: f64, reading: &[f64]) -> Result<SrsVerdict, VerdictError> {
    let [lowest_hz, highest_hz] = test.profile.band_hz();
    let least_hz = test.figures().least_rate_hz;
    // Frequencies of lines are rounded.
    if rate_hz.is_nan() || rate_hz < least_hz * (1.0 - 1e-9) {
        return Err(VerdictError::Rate { highest_hz, rate_hz, least_hz });
    }
    if let Some(sample) = reading.iter().position(|sample| !sample.is_finite()) {
        return Err(SpectraError::NotFinite { record: 0, sample }.into());
    }
    let quiet = Quiet::of(reading);
    let centred: Vec<f64> = reading.iter().map(|sample| sample - quiet.middle).collect();
    let period = libm::ceil(rate_hz / lowest_hz) as usize;
    let ranges = events(&centred, quiet.noise, (QUIET_PERIODS * period as f64) as usize);
    let shots = ranges.iter().map(|range| shot(test, rate_hz, &centred, range.clone(), quiet.noise, period));
    let shots = shots.collect::<Result<Vec<_>, _>>()?;
    if shots.is_empty() {
        return Err(VerdictError::NoShot { largest_percent: 0.0 });
    }
    let full = shots.iter().filter(|shot| shot.is_full).count();
    let asked = test.figures().shots;
    let of_shots = shots.iter().filter(|shot| shot.is_full).map(|shot| shot.verdict).max().unwrap_or(Verdict::Out);
    let missing = if full < asked as usize { Verdict::Undecided } else { Verdict::In };
    Ok(SrsVerdict { verdict: of_shots.max(missing), shots, full, asked, noise_m_s2: quiet.noise })
}

/// Returns the stretches of samples above the noise, with at most `quiet` samples below it in turn.
fn events(samples: &[f64], noise: f64, quiet: usize) -> Vec<Range<usize>> {
    let largest = samples.iter().fold(0.0_f64, |largest, sample| largest.max(sample.abs()));
    let least = (ABOVE_NOISE * noise).max(ABOVE_LARGEST * largest);
    let mut found: Vec<Range<usize>> = Vec::new();
    if largest == 0.0 {
        return found;
    }
    for (index, _) in samples.iter().enumerate().filter(|(_, sample)| sample.abs() >= least) {
        match found.last_mut() {
            Some(range) if index <= range.end + quiet => range.end = index + 1,
            _ => found.push(index..index + 1),
        }
    }
    found
}

fn shot(
    test: &SrsTest,
    rate_hz: f64,
    samples: &[f64],
    range: Range<usize>,
    noise: f64,
    period: usize,
) -> Result<SrsShot, VerdictError> {
    // What is below the threshold at both ends belongs to the shot, and the lowest oscillator must turn back after it.
    let from = range.start.saturating_sub(period);
    let to = (range.end + period).min(samples.len());
    let mut record = samples[from..to].to_vec();
    record.resize(record.len() + period, 0.0);
    let frequency_hz = test.frequencies_hz();
    let responses = ShockResponse::estimate(rate_hz, &record, test.quality, &frequency_hz)?.maximax();
    let mut lines = Vec::with_capacity(frequency_hz.len());
    let mut rest = Verdict::In;
    for (hz, response) in frequency_hz.iter().zip(&responses) {
        let Some(demand) = test.profile.at(*hz) else { continue };
        let own = libm::sqrt(FRAC_PI_2 * hz * test.quality * 2.0 * noise * noise / rate_hz);
        let db = |value: f64| 20.0 * libm::log10(value.max(f64::MIN_POSITIVE) / demand);
        let judge = |tolerance: [f64; 2]| {
            let ends = tolerance.map(|db| libm::pow(10.0, db / 20.0));
            Verdict::of_noisy(response / demand, own / demand, ends)
        };
        if let Some(tolerance) = &test.rest_tolerance {
            rest = rest.max(judge(tolerance.at(*hz)));
        }
        lines.push(SrsLine {
            frequency_hz: *hz,
            response_m_s2: *response,
            demand_m_s2: demand,
            deviation_db: db(*response),
            verdict: judge(test.tolerance.at(*hz)),
        });
    }
    let shares = Verdict::ALL
        .map(|verdict| lines.iter().filter(|line| line.verdict == verdict).count() as f64 / lines.len().max(1) as f64);
    let level_db = mean(&lines.iter().map(|line| line.deviation_db).collect::<Vec<_>>());
    Ok(SrsShot {
        t_s: range.start as f64 / rate_hz,
        peak_m_s2: record.iter().fold(0.0, |largest, sample| sample.abs().max(largest)),
        level_db,
        is_full: level_db >= FULL_DB,
        verdict: Verdict::of_share(shares[0], shares[2], test.share).max(rest),
        shares,
        lines,
    })
}
