//! Verdicts on classical shocks.
//!
//! A shot is where the specified pulse p fits the record y best: a(t) = Σ p y/Σ p² is the amplitude of least squares of a pulse
//! that begins at t, and a shot is a maximum of it. The start is then refined between the samples.
//!
//! An identification at low level has such maxima, too, but they follow each other, where a shot comes from silence. So the test
//! begins with the first shot of those without an interruption by others up to the first one at full level.

use alloc::vec::Vec;
use core::ops::Range;

use serde::Serialize;

use super::{Begin, Verdict};
use crate::error::VerdictError;
use crate::shock::ShockTest;

/// Least part of the lowest stated level that makes a shot.
const LEAST: f64 = 0.5;
/// Least amplitude of a shot at full level, −3 dB.
const FULL: f64 = 0.708;
/// Steps of a sample in which the start of a pulse is refined.
const FINE: i32 = 20;
/// Most shots of a record.
const MOST_SHOTS: usize = 1000;
/// Time before a shot, with its compensation, that is silent, s and in lengths of the pulse, and the largest rms there over the
/// amplitude of the shot. The largest of the maxima of a minute of noise is about 4 times its rms.
const SILENT_S: f64 = 0.5;
const SILENT_PULSES: f64 = 10.0;
const SILENT: f64 = 0.2;
/// Largest amplitude of the first shot over its level.
const FIRST: f64 = 1.1;
/// Deviation of a Gaussian value over the median of its size.
const OF_MEDIAN: f64 = 1.482_602_218_505_602;

/// Samples between which a record's channel is quiet, and its noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quiet {
    /// Median of the samples, m/s².
    pub middle: f64,
    /// Deviation of the noise, m/s², by the median of the sizes: shots don't count.
    pub noise: f64,
}

impl Quiet {
    pub fn of(samples: &[f64]) -> Quiet {
        let middle = median(samples.to_vec());
        Quiet { middle, noise: OF_MEDIAN * median(samples.iter().map(|sample| (sample - middle).abs()).collect()) }
    }
}

/// Returns the median of values; 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    let half = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(half, f64::total_cmp).1
}

/// A shot at full level, or below.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shot {
    /// Start of the pulse, s from the start of the record.
    pub t_s: f64,
    /// Amplitude of the pulse that fits, over the peak of the full level.
    pub amplitude: f64,
    /// Whether the shot is at full level, and so is judged.
    pub is_full: bool,
    /// Largest deviation from the pulse over the peak.
    pub error: f64,
    /// Largest acceleration in the pulse over the peak.
    pub peak: f64,
    /// Relative deviation of the velocity change.
    pub velocity_change: f64,
    /// Velocity at the end of the compensation over the velocity change, if the compensation is stated.
    pub end_velocity: Option<f64>,
    /// Largest acceleration before and behind the pulse over the peak, if the compensation is stated.
    pub outside: Option<f64>,
    /// Verdict on this shot alone.
    pub verdict: Verdict,
}

/// Verdict on a classical shock.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShockVerdict {
    /// Verdict on the whole.
    pub verdict: Verdict,
    /// Time from the start of the record at which the first shot begins with its compensation, s.
    pub begins_s: f64,
    /// All shots from there on, in the order of time.
    pub shots: Vec<Shot>,
    /// Shots at full level.
    pub full: usize,
    /// Shots at full level that the specification asks for.
    pub asked: u32,
    /// Whether the first shot is at most 10 % above its level, if lower levels are stated.
    pub is_first_low: Option<bool>,
    /// Deviation of the noise, m/s².
    pub noise_m_s2: f64,
}

/// Judges a record of shots, `rate_hz` samples a second. A record without a shot at full level is out; one with fewer than are
/// asked for is undecided.
///
/// If the begin of the test is searched for, it is that of the first shot after a silence of those that follow each other
/// without a pulse of noise between them up to the first one at full level, or else to the last one.
///
/// # Errors
/// [`VerdictError`] if no shot is in the record, or it is too short.
pub fn judge_shock(
    test: &ShockTest,
    rate_hz: f64,
    reading: &[f64],
    begin: Begin,
) -> Result<ShockVerdict, VerdictError> {
    let least_hz = LEAST_SAMPLES / test.duration_s;
    if rate_hz.is_nan() || rate_hz < least_hz {
        return Err(VerdictError::Rate { highest_hz: 1.0 / test.duration_s, rate_hz, least_hz });
    }
    let pulse = test.samples(rate_hz);
    if reading.len() <= pulse.len() {
        let [got_s, least_s] = [reading.len(), pulse.len() + 1].map(|samples| samples as f64 / rate_hz);
        return Err(VerdictError::TooShort { got_s, least_s });
    }
    if let Some(sample) = reading.iter().position(|sample| !sample.is_finite()) {
        return Err(resonarm_modal::spectra::SpectraError::NotFinite { record: 0, sample }.into());
    }
    let quiet = Quiet::of(reading);
    let energy: f64 = pulse.iter().map(|sample| sample * sample).sum();
    let fit = |start: usize| -> f64 {
        let products = pulse.iter().zip(&reading[start..]).map(|(pulse, sample)| pulse * (sample - quiet.middle));
        products.sum::<f64>() / energy
    };
    let mut fits: Vec<f64> = (0..reading.len() - pulse.len()).map(fit).collect();
    let levels = test.shots.iter().map(|shots| libm::pow(10.0, shots.level_db / 20.0));
    let least = LEAST * levels.fold(1.0, f64::min);
    let apart = pulse.len() + ((test.pre_s.unwrap_or(0.0) + test.post_s.unwrap_or(0.0)) * rate_hz) as usize;
    let mut starts = Vec::new();
    let mut largest = 0.0_f64;
    while starts.len() < MOST_SHOTS {
        let Some((start, amplitude)) = fits.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)) else {
            break;
        };
        largest = largest.max(amplitude);
        if amplitude < least {
            break;
        }
        starts.push((start, amplitude));
        let end = (start + apart).min(fits.len());
        // Neighbours of a shot fit nearly as well, and are not shots of their own.
        fits[start.saturating_sub(apart)..end].fill(f64::NEG_INFINITY);
    }
    starts.sort_unstable_by_key(|(start, _)| *start);
    let pre = (test.pre_s.unwrap_or(0.0) * rate_hz) as usize;
    let silence = (SILENT_S * rate_hz).max(SILENT_PULSES * pulse.len() as f64) as usize;
    let begins = |start: usize| start.saturating_sub(pre);
    let is_after_silence = |(start, amplitude): &(usize, f64)| {
        let before = &reading[begins(*start).saturating_sub(silence)..begins(*start)];
        let squares: f64 = before.iter().map(|sample| (sample - quiet.middle) * (sample - quiet.middle)).sum();
        libm::sqrt(squares / before.len().max(1) as f64) <= SILENT * amplitude * test.peak_m_s2
    };
    let first = match begin {
        Begin::Searched => first_of_test(&starts, is_after_silence),
        Begin::Start => 0,
    };
    starts.drain(..first);
    let Some((first, _)) = starts.first() else {
        return Err(VerdictError::NoShot { largest_percent: 100.0 * largest });
    };
    // What was played before the test is not its noise.
    let (begins, from) = match begin {
        Begin::Searched => (begins(*first), begins(*first).saturating_sub(silence)),
        Begin::Start => (0, 0),
    };
    let quiet = Quiet::of(&reading[from..]);
    let shots: Vec<Shot> = starts.iter().map(|(start, _)| shot(test, rate_hz, reading, *start, quiet)).collect();
    let full = shots.iter().filter(|shot| shot.is_full).count();
    let asked = crate::shock::full_level_shots(&test.shots);
    let is_first_low = match test.shots.first() {
        Some(first) if first.level_db < 0.0 => {
            Some(shots[0].amplitude <= FIRST * libm::pow(10.0, first.level_db / 20.0))
        }
        _ => None,
    };
    let of_shots = shots.iter().filter(|shot| shot.is_full).map(|shot| shot.verdict).max().unwrap_or(Verdict::Out);
    let missing = if full < asked as usize { Verdict::Undecided } else { Verdict::In };
    let first = if is_first_low == Some(false) { Verdict::Out } else { Verdict::In };
    let verdict = of_shots.max(missing).max(first);
    let begins_s = begins as f64 / rate_hz;
    Ok(ShockVerdict { verdict, begins_s, shots, full, asked, is_first_low, noise_m_s2: quiet.noise })
}

/// Returns the index of the shot with which the test begins, by the starts and amplitudes of all; their number if it does not.
fn first_of_test(starts: &[(usize, f64)], is_after_silence: impl Fn(&(usize, f64)) -> bool) -> usize {
    let is_full = |shot: &(usize, f64)| shot.1 >= FULL;
    let full = starts.iter().position(|shot| is_full(shot) && is_after_silence(shot));
    let first_full = full.or_else(|| starts.iter().position(is_full)).unwrap_or(starts.len());
    let before = starts[..first_full].iter().rev().take_while(|shot| is_after_silence(shot)).count();
    first_full - before
}

/// Least samples of a pulse.
const LEAST_SAMPLES: f64 = 8.0;

/// Measures and judges the shot whose pulse begins about a sample.
fn shot(test: &ShockTest, rate_hz: f64, reading: &[f64], start: usize, quiet: Quiet) -> Shot {
    let count = libm::round(test.duration_s * rate_hz) as usize + 1;
    let middle = quiet.middle;
    let samples =
        |from: usize, to: usize| reading[from..to.min(reading.len())].iter().map(move |sample| sample - middle);
    // The pulse at the samples from the one before its start on, if it begins `late` samples behind `start`.
    let from = start.saturating_sub(1);
    let reference = |late: f64| {
        (0..count + 2).map(move |k| test.acceleration_m_s2((k as f64 - (start - from) as f64 - late) / rate_hz))
    };
    let fit = |late: f64| {
        let [product, energy] = samples(from, from + count + 2)
            .zip(reference(late))
            .fold([0.0; 2], |[product, energy], (sample, pulse)| [product + sample * pulse, energy + pulse * pulse]);
        // The part of the record's energy that the pulse explains, with its amplitude.
        (product * product / energy, product / energy)
    };
    let fine = (-FINE..=FINE).map(|step| f64::from(step) / f64::from(FINE));
    let best = fine.map(|late| (late, fit(late))).max_by(|a, b| a.1.0.total_cmp(&b.1.0));
    let (late, (_, amplitude)) = best.unwrap_or((0.0, (0.0, 0.0)));
    let peak = test.peak_m_s2;
    let inside = |k: usize| {
        let t_s = (k as f64 - (start - from) as f64 - late) / rate_hz;
        t_s >= 0.0 && t_s <= test.duration_s
    };
    let mut error = 0.0_f64;
    let mut largest = 0.0_f64;
    let mut sum = 0.0;
    let mut nominal = 0.0;
    for (k, (sample, pulse)) in samples(from, from + count + 2).zip(reference(late)).enumerate() {
        if inside(k) {
            error = error.max((sample - pulse).abs() / peak);
            largest = largest.max(sample / peak);
            sum += sample;
            nominal += pulse;
        }
    }
    let velocity_change = sum / nominal - 1.0;
    let noise = quiet.noise;
    // A sum of n samples has √n times the noise of one.
    let of_sum = |samples: usize| noise * libm::sqrt(samples as f64) / nominal.abs();
    let judge = |value: f64, noise: f64, most: f64| Verdict::of_noisy(value, noise, [f64::NEG_INFINITY, most]);
    let surroundings = match (test.pre_s, test.post_s) {
        (Some(pre_s), Some(post_s)) => {
            let range: Range<usize> =
                start.saturating_sub((pre_s * rate_hz) as usize)..start + count + (post_s * rate_hz) as usize;
            Some(range.start..range.end.min(reading.len()))
        }
        _ => None,
    };
    let end_velocity = surroundings.clone().map(|range| samples(range.start, range.end).sum::<f64>() / nominal);
    let outside = surroundings.clone().map(|range| {
        let before = samples(range.start, start.saturating_sub(1).max(range.start));
        let behind = samples((start + count + 1).min(range.end), range.end);
        before.chain(behind).fold(0.0_f64, |largest, sample| largest.max(sample.abs())) / peak
    });
    let mut verdict = judge(error, noise / peak, test.band);
    if let Some(most) = test.velocity_tolerance {
        verdict = verdict.max(judge(velocity_change.abs(), of_sum(count), most));
    }
    if let (Some(most), Some(end), Some(range)) = (test.end_velocity_tolerance, end_velocity, &surroundings) {
        verdict = verdict.max(judge(end.abs(), of_sum(range.len()), most));
    }
    if let (Some(most), Some(outside)) = (test.outside, outside) {
        verdict = verdict.max(judge(outside, noise / peak, most));
    }
    Shot {
        t_s: (start as f64 + late) / rate_hz,
        amplitude,
        is_full: amplitude >= FULL,
        error,
        peak: largest,
        velocity_change,
        end_velocity,
        outside,
        verdict,
    }
}
