//! Verdicts on swept sines.
//!
//! The reference, the drive if it is known, gives the phase: the argument of its analytic signal, whose rate is averaged over
//! several cycles, so that harmonics don't disturb it. The reading is multiplied by e^(−jφ) and averaged under Hann's window, whose
//! length 2/(b f) gives the bandwidth b f: this tracking filter has no phase shift, and takes in no harmonic. The same filter at
//! 1.5 times the frequency, between the fundamental and the second harmonic, reads the noise.
//!
//! A record also holds what a controller does before its test: loops are checked by noise, and structures identified by multisines
//! or noise. A sweep is told from these by its phase: with the size a and the phase ψ of the analytic signal, and the integral φ of
//! its averaged rate, |Σ a² e^(i(ψ − φ))|²/(Σ a²)² is 1 of a single sinusoid, whatever its amplitude does, and about 1/(T B) of noise
//! of the bandwidth B over the time T.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;
use core::ops::Range;

use nalgebra::Complex;
use resonarm_numeric::dft::Fft;
use serde::Serialize;

use super::random::LimitVerdict;
use super::{Begin, Verdict, mean};
use crate::error::VerdictError;
use crate::file::Measure;
use crate::sine::{SineTest, SweepRate};
use crate::specification::Limits;

/// Cycles of the lowest frequency over which the rate of the phase is averaged, twice.
const CYCLES: f64 = 4.0;
/// Points within the length of the filter's window.
const IN_WINDOW: f64 = 8.0;
/// Points to either side over which the noise is averaged.
const NOISE_POINTS: usize = 8;
/// Least part of the octaves of the sweep that a pass runs through, and that one that is whole does. The rest allows for noise of
/// the frequency at the ends.
const LEAST_PART: f64 = 0.5;
const WHOLE_PART: f64 = 0.95;
/// Cycles of the lowest frequency over which the reference must be one sinusoid, and the least measure of that.
const TONE_CYCLES: f64 = 16.0;
const LEAST_TONE: f64 = 0.5;
/// Largest ratio, either way, of the time of a sweep and that of the specified rate, and the least correlation of its frequency
/// with the time.
const MOST_TIMES: f64 = 4.0;
const LEAST_CORRELATION: f64 = 0.8;
/// Departure from the line through its middle at which a sweep ends, octaves, and the distance from an end of the range up to
/// which it has run through it.
const END: f64 = 0.15;
const EDGE: f64 = 0.03;
/// Amplitude of a sweep over that of a later one below which it was a sweep at low level before the test, −3 dB.
const FULL: f64 = 0.708;
/// Largest departure of the frequency from the sweep, octaves.
const MOST_DEPARTURE: f64 = 0.05;
/// Interval over which steps of the frequency are searched for, s; the part of the nominal step below which the frequency stands
/// still; and the largest share of such intervals of a sweep that is continuous.
const STEP_S: f64 = 0.1;
const STILL: f64 = 0.3;
const MOST_STILL: f64 = 0.15;
/// Jumps of the phase: length of the fit to either side, s and in cycles of the lowest frequency, and the time between two places.
const JUMP_S: f64 = 0.25;
const JUMP_CYCLES: f64 = 4.0;
const JUMP_STEP_S: f64 = 0.02;
/// Relative amounts by which a response may exceed its limit, and from which on below it holds the control channel down.
const LIMIT: f64 = 0.15;
const AT_LIMIT: f64 = 0.85;

/// Amplitudes at an instant of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SinePoint {
    /// Time from the start of the record, s.
    pub t_s: f64,
    /// Frequency of the sine at this instant, Hz.
    pub frequency_hz: f64,
    /// Amplitude that is specified there, m/s².
    pub demand_m_s2: f64,
    /// Amplitude of the fundamental, m/s².
    pub tracked_m_s2: f64,
    /// √2 times the rms, m/s².
    pub rms_m_s2: f64,
    /// Peak of the reading about this instant, m/s².
    pub peak_m_s2: f64,
    /// Deviation of the amplitude due to noise, m/s².
    pub noise_m_s2: f64,
    /// Whether a response is at its limit, so that the amplitude may be too low.
    pub is_limited: bool,
    /// Verdict on the judged reading.
    pub verdict: Verdict,
}

/// A sweep through the range of frequencies, up or down.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SinePass {
    /// Start, s from the start of the record.
    pub from_s: f64,
    /// Time at which the sweep ends, s.
    pub to_s: f64,
    /// Frequency at which the sweep begins, Hz.
    pub from_hz: f64,
    /// Frequency at which the sweep ends, Hz.
    pub to_hz: f64,
    /// Rate by regression, in the unit of the specified one, positive.
    pub rate: f64,
    /// Largest departure of the frequency from the regression, octaves.
    pub departure_octaves: f64,
    /// Share of the intervals of 0.1 s in which the frequency stands still, if the drive is known.
    pub still: Option<f64>,
    /// Largest jump of the phase of the drive, rad, if the drive is known: the distance of two cubics that fit the phase before
    /// and behind an instant.
    pub phase_jump_rad: Option<f64>,
    /// Whether it runs through the whole range, but for its ends.
    pub is_whole: bool,
}

/// Verdict on a swept sine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SineVerdict {
    /// Verdict on the whole.
    pub verdict: Verdict,
    /// Verdict on the amplitude.
    pub amplitude: Verdict,
    /// Shares of the time in which the amplitude is in, undecided and out.
    pub shares: [f64; 3],
    /// Lowest and highest judged amplitude over the specified one.
    pub extremes: [f64; 2],
    /// Frequencies of these, Hz.
    pub extremes_hz: [f64; 2],
    /// Verdict on the rate, if the specification states its tolerance.
    pub rate: Option<Verdict>,
    /// Whether the sweep is continuous, not stepped, if the drive is known.
    pub is_continuous: Option<bool>,
    /// Time from the start of the record at which the first of the sweeps begins at an end of the specified range, s.
    pub begins_s: f64,
    /// Sweeps before that are left out: they were broken off, or 3 dB below a later one.
    pub left_out: usize,
    /// Sweeps that were found, without those that are left out.
    pub passes: Vec<SinePass>,
    /// Sweeps among them that run through the whole range.
    pub whole: usize,
    /// Sweeps that the specification asks for.
    pub asked: u32,
    /// Verdicts on responses with a limit.
    pub limits: Vec<LimitVerdict>,
    /// The instants that were judged.
    pub points: Vec<SinePoint>,
}

/// Phase of a reference with its rate.
struct Phase {
    rate_hz: f64,
    /// Samples on which an averaged frequency depends, to either side.
    reach: usize,
    /// Size of the analytic signal.
    size: Vec<f64>,
    /// Phase of the reference at each sample, rad, unwrapped.
    phase: Vec<f64>,
    /// Integral of the averaged rate of the phase, rad.
    smooth: Vec<f64>,
    /// Averaged frequency at each sample, Hz.
    frequency_hz: Vec<f64>,
}

impl Phase {
    fn new(reference: &[f64], rate_hz: f64, [from_hz, to_hz]: [f64; 2]) -> Phase {
        let transform = Fft::at_least(reference.len());
        let length = transform.length();
        let mut values: Vec<Complex<f64>> = reference.iter().map(|value| Complex::new(*value, 0.0)).collect();
        values.resize(length, Complex::new(0.0, 0.0));
        transform.forward(&mut values);
        let is_kept = |line: usize| {
            let hz = line as f64 * rate_hz / length as f64;
            2 * line <= length && hz >= 0.5 * from_hz && hz <= 1.5 * to_hz
        };
        values.iter_mut().enumerate().filter(|(line, _)| !is_kept(*line)).for_each(|(_, value)| *value *= 0.0);
        // Without its negative frequencies the signal is analytic: its argument is the phase of the sine.
        transform.backward(&mut values);
        let size = values[..reference.len()].iter().map(|value| libm::hypot(value.re, value.im)).collect();
        let mut phase = Vec::with_capacity(reference.len());
        let mut turned = 0.0;
        let mut before = values[0];
        for value in &values[..reference.len()] {
            let step = value * before.conj();
            turned += libm::atan2(step.im, step.re);
            phase.push(turned);
            before = *value;
        }
        let half = (0.5 * CYCLES / from_hz * rate_hz) as usize + 1;
        let steps: Vec<f64> = phase.windows(2).map(|pair| pair[1] - pair[0]).chain([0.0]).collect();
        // Averaged twice, which is a triangular window: beside its main lobe it falls off faster than a rectangular one.
        let steps = averaged(&averaged(&steps, half), half);
        let mut sum = 0.0;
        let running = |step: &f64| {
            let before = sum;
            sum += step;
            before
        };
        let smooth = steps.iter().map(running).collect();
        let frequency_hz = steps.iter().map(|step| step * rate_hz / TAU).collect();
        Phase { rate_hz, reach: 2 * half, size, phase, smooth, frequency_hz }
    }

    /// Returns how far the signal is one sinusoid, from 0 to 1, over `half` samples to either side of each.
    fn tone(&self, half: usize) -> Vec<f64> {
        let turned = |(size, (phase, smooth)): (&f64, (&f64, &f64))| {
            let (sine, cosine) = libm::sincos(phase - smooth);
            [size * size * cosine, size * size * sine, size * size]
        };
        let parts: Vec<[f64; 3]> = self.size.iter().zip(self.phase.iter().zip(&self.smooth)).map(turned).collect();
        let mean = |part: usize| averaged(&parts.iter().map(|parts| parts[part]).collect::<Vec<_>>(), half);
        let [re, im, power] = [mean(0), mean(1), mean(2)];
        let share = |((re, im), power): ((&f64, &f64), &f64)| {
            let ratio = libm::hypot(*re, *im) / power.max(f64::MIN_POSITIVE);
            ratio * ratio
        };
        re.iter().zip(&im).zip(&power).map(share).collect()
    }

    /// Returns the largest jump of the phase in a range of samples, rad. The filter of the analytic signal has smeared a jump over
    /// about two periods of its bandwidth, which are left out between the fits.
    fn largest_jump_rad(&self, range: Range<usize>, [from_hz, to_hz]: [f64; 2]) -> f64 {
        let samples = |seconds: f64| libm::ceil(seconds * self.rate_hz) as usize;
        let count = samples(JUMP_S.max(JUMP_CYCLES / from_hz)).max(5);
        let gap = samples(2.0 / (1.5 * to_hz - 0.5 * from_hz));
        let weights = cubic_ahead(count, gap);
        let jump = |sample: usize| {
            let before = self.phase.get((sample + 1).checked_sub(gap + count)?..=sample - gap)?;
            let behind = self.phase.get(sample + gap..sample + gap + count)?;
            // Off the phase in the middle, since one of thousands of turns would be rounded.
            let middle = self.phase[sample];
            let fit = |weight: (&f64, &f64)| weight.0 * (weight.1 - middle);
            let [before, behind]: [f64; 2] =
                [weights.iter().zip(before).map(fit).sum(), weights.iter().zip(behind.iter().rev()).map(fit).sum()];
            Some((behind - before).abs())
        };
        range.step_by(samples(JUMP_STEP_S).max(1)).filter_map(jump).fold(0.0, f64::max)
    }

    /// Returns the frequency at a sample, Hz, by the slope of the unsmoothed phase over `half` samples to either side.
    fn slope_hz(&self, sample: usize, half: usize) -> Option<f64> {
        let window = self.phase.get(sample.checked_sub(half)?..=sample + half)?;
        let at = |k: usize| k as f64 - half as f64;
        let moment: f64 = window.iter().enumerate().map(|(k, phase)| at(k) * phase).sum();
        let square: f64 = (0..window.len()).map(|k| at(k) * at(k)).sum();
        Some(moment / square * self.rate_hz / TAU)
    }
}

/// Returns the weights of `count` values at 0, 1, … whose sum is the cubic of least squares through them, at `ahead` beyond the
/// last one: with orthonormal polynomials pⱼ over the values, Σⱼ pⱼ(k) pⱼ(x).
fn cubic_ahead(count: usize, ahead: usize) -> Vec<f64> {
    let at = |k: usize| 2.0 * k as f64 / (count - 1) as f64 - 1.0;
    let all = count + ahead;
    let mut weights = vec![0.0; count];
    let mut found: Vec<Vec<f64>> = Vec::new();
    for power in 0..4 {
        let mut own: Vec<f64> = (0..all).map(|k| libm::pow(at(k), f64::from(power))).collect();
        for lower in &found {
            let product: f64 = own[..count].iter().zip(lower).map(|(a, b)| a * b).sum();
            own.iter_mut().zip(lower).for_each(|(own, lower)| *own -= product * lower);
        }
        let size = libm::sqrt(own[..count].iter().map(|value| value * value).sum());
        own.iter_mut().for_each(|value| *value /= size);
        weights.iter_mut().zip(&own).for_each(|(weight, value)| *weight += value * own[all - 1]);
        found.push(own);
    }
    weights
}

/// Returns the means over `half` values to either side, over fewer at the ends.
fn averaged(values: &[f64], half: usize) -> Vec<f64> {
    let mut sums = vec![0.0; values.len() + 1];
    for (index, value) in values.iter().enumerate() {
        sums[index + 1] = sums[index] + value;
    }
    let mean = |index: usize| {
        let from = index.saturating_sub(half);
        let to = (index + half + 1).min(values.len());
        (sums[to] - sums[from]) / (to - from) as f64
    };
    (0..values.len()).map(mean).collect()
}

/// Readings of a channel at an instant.
struct Reading {
    tracked: f64,
    noise: f64,
    rms: f64,
    peak: f64,
}

/// Reads a channel under Hann's window of `2 half + 1` samples about a sample.
fn read(channel: &[f64], middle: f64, phase: &Phase, sample: usize, half: usize) -> Reading {
    let zero = Complex::new(0.0, 0.0);
    let mut tracked = zero;
    let mut noise = zero;
    let mut square = 0.0;
    let mut weight = 0.0;
    let mut peak = 0.0_f64;
    let window = sample - half..=sample + half;
    for (index, (value, turn)) in window.clone().zip(channel[window.clone()].iter().zip(&phase.smooth[window])) {
        let w = 0.5 + 0.5 * libm::cos(TAU * (index as f64 - sample as f64) / (2 * half + 2) as f64);
        let value = value - middle;
        let turn = turn - phase.smooth[sample];
        let (sine, cosine) = libm::sincos(turn);
        tracked += Complex::new(cosine, -sine) * (w * value);
        let (sine, cosine) = libm::sincos(1.5 * turn);
        noise += Complex::new(cosine, -sine) * (w * value);
        square += w * value * value;
        weight += w;
        peak = peak.max(value.abs());
    }
    let size = |sum: Complex<f64>| 2.0 * libm::hypot(sum.re, sum.im) / weight;
    Reading { tracked: size(tracked), noise: size(noise), rms: libm::sqrt(2.0 * square / weight), peak }
}

/// Judges a record of a swept sine, `rate_hz` samples a second. `reference` is the drive; without it the reading itself gives the
/// phase, and a stepped sweep is not told from a continuous one. `responses` are the channels of [`Limits::response`]. A record
/// with fewer whole sweeps than are asked for is undecided.
///
/// A sweep is a stretch in which the reference is one sinusoid whose frequency runs through at least half of the octaves, in a
/// quarter of the specified time to four times it. If the begin of the test is searched for, it is that of the first sweep that
/// runs through the whole range and has at least 0.708 times the amplitude of every later one; sweeps before it are left out. If
/// there is no such sweep, it is that of the first one.
///
/// The ends of the sweep are left out by the bandwidth of the filter.
///
/// # Errors
/// [`VerdictError`] if no sweep is in the record, its rate is too low, or the channels don't fit.
pub fn judge_sine(
    test: &SineTest,
    limits: &Limits,
    rate_hz: f64,
    reading: &[f64],
    reference: Option<&[f64]>,
    responses: &[&[f64]],
    begin: Begin,
) -> Result<SineVerdict, VerdictError> {
    let [lowest_hz, highest_hz] = test.band_hz();
    let least_hz = 4.0 * highest_hz;
    if rate_hz.is_nan() || rate_hz < least_hz {
        return Err(VerdictError::Rate { highest_hz, rate_hz, least_hz });
    }
    let least_s = 2.0 / (test.tracking * lowest_hz);
    if (reading.len() as f64) < least_s * rate_hz {
        return Err(VerdictError::TooShort { got_s: reading.len() as f64 / rate_hz, least_s });
    }
    let is_equal = |channel: &[f64]| channel.len() == reading.len();
    if responses.len() != limits.response.len() || !reference.into_iter().chain(responses.iter().copied()).all(is_equal)
    {
        return Err(VerdictError::Channels);
    }
    if let Some(sample) = reading.iter().position(|sample| !sample.is_finite()) {
        return Err(resonarm_modal::spectra::SpectraError::NotFinite { record: 0, sample }.into());
    }
    let phase = Phase::new(reference.unwrap_or(reading), rate_hz, [lowest_hz, highest_hz]);
    let judged_hz = [lowest_hz * (1.0 + test.tracking), highest_hz / (1.0 + test.tracking)];
    let ranges = passes(test, &phase, judged_hz);
    if ranges.is_empty() {
        return Err(VerdictError::NoSweep { from_hz: judged_hz[0], to_hz: judged_hz[1] });
    }
    let middles: Vec<f64> = core::iter::once(reading).chain(responses.iter().copied()).map(mean).collect();
    let mut sweeps: Vec<Sweep> = Vec::new();
    for Stretch { range, within } in ranges {
        let mut points: Vec<(SinePoint, f64)> = Vec::new();
        let mut over_limit: Vec<(f64, f64)> = vec![(0.0, 0.0); responses.len()];
        let mut sample = range.start as f64;
        while (sample as usize) < range.end {
            let index = sample as usize;
            let hz = phase.frequency_hz[index];
            let length = 2.0 / (test.tracking * hz) * rate_hz;
            let half = (0.5 * length) as usize;
            let step = length / IN_WINDOW;
            sample += step;
            let Some(demand) = test.acceleration_m_s2(hz) else { continue };
            if index < within.start + half || index + half >= within.end {
                continue;
            }
            let own = read(reading, middles[0], &phase, index, half);
            let mut is_limited = false;
            for ((response, limit), place) in responses.iter().zip(&limits.response).zip(0..) {
                let Some(limit) = limit.profile.at(hz) else { continue };
                let ratio = read(response, middles[place + 1], &phase, index, half).tracked / limit;
                is_limited |= ratio >= AT_LIMIT;
                if ratio > over_limit[place].0 {
                    over_limit[place] = (ratio, hz);
                }
            }
            let point = SinePoint {
                t_s: index as f64 / rate_hz,
                frequency_hz: hz,
                demand_m_s2: demand,
                tracked_m_s2: own.tracked,
                rms_m_s2: own.rms,
                peak_m_s2: own.peak,
                noise_m_s2: own.noise,
                is_limited,
                verdict: Verdict::In,
            };
            points.push((point, step / rate_hz));
        }
        judge_points(test, &mut points);
        sweeps.push(Sweep { pass: pass(test, &phase, range, judged_hz, reference.is_some()), points, over_limit });
    }
    let left_out = match begin {
        Begin::Searched => first_of_test(&sweeps),
        Begin::Start => 0,
    };
    Ok(conclude(test, limits, sweeps.split_off(left_out), left_out))
}

/// A sweep with what was read during it.
struct Sweep {
    pass: SinePass,
    /// Judged instants with the time that each stands for, s.
    points: Vec<(SinePoint, f64)>,
    /// Largest ratio of each response and its limit, with its frequency, Hz.
    over_limit: Vec<(f64, f64)>,
}

impl Sweep {
    /// Returns the median of the amplitude over the specified one; 0 without a judged instant.
    fn level(&self) -> f64 {
        let mut ratios: Vec<f64> =
            self.points.iter().map(|(point, _)| point.tracked_m_s2 / point.demand_m_s2).collect();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).copied().unwrap_or(0.0)
    }
}

/// Returns the index of the sweep with which the test begins: the first one that is whole and not at a lower level than a later
/// one, or else the first one.
fn first_of_test(sweeps: &[Sweep]) -> usize {
    let is_of_test = |(index, sweep): (usize, &Sweep)| {
        let later = sweeps[index..].iter().filter(|later| later.pass.is_whole).map(Sweep::level);
        sweep.pass.is_whole && sweep.level() >= FULL * later.fold(0.0, f64::max)
    };
    sweeps.iter().enumerate().position(is_of_test).unwrap_or(0)
}

/// Returns the judged reading of a point.
fn value(test: &SineTest, point: &SinePoint) -> f64 {
    match test.measure {
        Measure::Tracked => point.tracked_m_s2,
        Measure::Rms => point.rms_m_s2,
        Measure::Peak => point.peak_m_s2,
    }
}

/// Averages the noise over adjacent points, and judges each. An amplitude has the deviation of one of the two components of the
/// noise: the other one turns its phase.
fn judge_points(test: &SineTest, points: &mut [(SinePoint, f64)]) {
    let squares: Vec<f64> = points.iter().map(|(point, _)| point.noise_m_s2 * point.noise_m_s2).collect();
    for ((point, _), square) in points.iter_mut().zip(averaged(&squares, NOISE_POINTS)) {
        point.noise_m_s2 = libm::sqrt(0.5 * square);
        let ratio = value(test, point) / point.demand_m_s2;
        let noise = point.noise_m_s2 / point.demand_m_s2;
        let [low, high] = [if point.is_limited { 0.0 } else { 1.0 - test.tolerance }, 1.0 + test.tolerance];
        point.verdict = Verdict::of_noisy(ratio, noise, [low, high]);
    }
}

/// Samples of a sweep.
struct Stretch {
    /// Samples at which the frequency is within the judged range.
    range: Range<usize>,
    /// Samples that a filter may take in: those beyond the judged range, too, but at an end that is broken off.
    within: Range<usize>,
}

/// Straight line of least squares through the frequency over the time, or through its logarithm, as the specified law is.
struct Line {
    is_logarithmic: bool,
    /// Value in the middle, and the sample of the record there.
    middle: f64,
    center: f64,
    /// Slope of the line, by sample.
    slope: f64,
    correlation: f64,
}

impl Line {
    fn new(test: &SineTest, phase: &Phase, range: Range<usize>) -> Line {
        let is_logarithmic = matches!(test.rate, SweepRate::OctavesPerMinute(_));
        let at = |hz: &f64| if is_logarithmic { libm::log2(*hz) } else { *hz };
        let values: Vec<f64> = phase.frequency_hz[range.clone()].iter().map(at).collect();
        let middle = mean(&values);
        let half = 0.5 * (values.len() as f64 - 1.0);
        let [product, time, square] =
            values.iter().enumerate().fold([0.0; 3], |[product, time, square], (k, value)| {
                let k = k as f64 - half;
                let value = value - middle;
                [product + k * value, time + k * k, square + value * value]
            });
        let slope = product / time.max(f64::MIN_POSITIVE);
        let correlation = product / libm::sqrt(time * square).max(f64::MIN_POSITIVE);
        Line { is_logarithmic, middle, center: range.start as f64 + half, slope, correlation }
    }

    /// Returns how far the frequency at a sample is from the line, octaves.
    fn departure(&self, phase: &Phase, sample: usize) -> f64 {
        let fitted = self.middle + self.slope * (sample as f64 - self.center);
        let fitted_hz = if self.is_logarithmic { libm::exp2(fitted) } else { fitted };
        libm::log2(phase.frequency_hz[sample] / fitted_hz.max(f64::MIN_POSITIVE)).abs()
    }
}

/// Returns the stretches in which the reference is one sinusoid whose frequency runs through the judged range, or at least half
/// of its octaves, at a rate that may be meant for the specified one.
fn passes(test: &SineTest, phase: &Phase, judged_hz: [f64; 2]) -> Vec<Stretch> {
    let [lowest_hz, _] = test.band_hz();
    let tone = phase.tone((0.5 * TONE_CYCLES / lowest_hz * phase.rate_hz) as usize);
    let is_tone = |sample: usize| {
        let hz = phase.frequency_hz[sample];
        hz >= judged_hz[0] && hz <= judged_hz[1] && tone[sample] >= LEAST_TONE
    };
    let mut found = Vec::new();
    let mut first = None;
    for sample in 0..=tone.len() {
        match (first, sample < tone.len() && is_tone(sample)) {
            (None, true) => first = Some(sample),
            (Some(start), false) => {
                found.extend(swept(test, phase, start..sample, judged_hz));
                first = None;
            }
            _ => {}
        }
    }
    found
}

/// Returns the sweep in a stretch of a sinusoid. One that is broken off is followed by whatever the reference does then, as the
/// ringing of a structure; it is cut off where the frequency leaves the line through the middle of the sweep.
fn swept(test: &SineTest, phase: &Phase, stretch: Range<usize>, [from_hz, to_hz]: [f64; 2]) -> Option<Stretch> {
    let hz = |sample: usize| phase.frequency_hz[sample];
    let least = LEAST_PART * libm::log2(to_hz / from_hz);
    let is_long = |range: &Range<usize>| least > 0.0 && libm::log2(hz(range.end - 1) / hz(range.start)).abs() >= least;
    let by_frequency = |a: &usize, b: &usize| hz(*a).total_cmp(&hz(*b));
    let low = stretch.clone().min_by(by_frequency)?;
    let high = stretch.max_by(by_frequency)?;
    let mut range = low.min(high)..low.max(high) + 1;
    let times = range.len() as f64 / phase.rate_hz / test.sweep_s(hz(low), hz(high));
    if !is_long(&range) || !(1.0 / MOST_TIMES..=MOST_TIMES).contains(&times) {
        return None;
    }
    let tenth = range.len() / 10;
    let line = Line::new(test, phase, range.start + tenth..range.end - tenth);
    if line.correlation.abs() < LEAST_CORRELATION {
        return None;
    }
    let is_off = |sample: &usize| line.departure(phase, *sample) > END;
    range.start += range.clone().take_while(is_off).count();
    range.end -= range.clone().rev().take_while(is_off).count();
    let is_edge = |sample: usize| [from_hz, to_hz].iter().any(|edge| libm::log2(hz(sample) / edge).abs() < EDGE);
    let mut within = 0..phase.phase.len();
    // The averaged frequency takes in what is beyond a broken end.
    if !range.is_empty() && !is_edge(range.start) {
        range.start += phase.reach;
        within.start = range.start;
    }
    if !range.is_empty() && !is_edge(range.end - 1) {
        range.end = range.end.saturating_sub(phase.reach);
        within.end = range.end;
    }
    (!range.is_empty() && is_long(&range)).then_some(Stretch { range, within })
}

/// Measures the rate of a pass through a range of frequencies.
fn pass(test: &SineTest, phase: &Phase, range: Range<usize>, [from_hz, to_hz]: [f64; 2], is_drive: bool) -> SinePass {
    let line = Line::new(test, phase, range.clone());
    let still = || {
        let step = (STEP_S * phase.rate_hz) as usize;
        let measured = range.clone().step_by(step.max(1)).map(|sample| phase.slope_hz(sample, step));
        let measured: Vec<f64> = measured.flatten().collect();
        let is_still = |pair: &&[f64]| (pair[1] - pair[0]).abs() < STILL * STEP_S * test.rate_hz_s(pair[0]);
        let count = measured.windows(2).filter(is_still).count();
        count as f64 / (measured.len().max(2) - 1) as f64
    };
    let [first_hz, last_hz] = [range.start, range.end - 1].map(|sample| phase.frequency_hz[sample]);
    SinePass {
        from_s: range.start as f64 / phase.rate_hz,
        to_s: range.end as f64 / phase.rate_hz,
        from_hz: first_hz,
        to_hz: last_hz,
        rate: line.slope.abs() * phase.rate_hz * if line.is_logarithmic { 60.0 } else { 1.0 },
        departure_octaves: range.clone().map(|sample| line.departure(phase, sample)).fold(0.0, f64::max),
        still: is_drive.then(still),
        phase_jump_rad: is_drive.then(|| phase.largest_jump_rad(range.clone(), test.band_hz())),
        is_whole: libm::log2(last_hz / first_hz).abs() >= WHOLE_PART * libm::log2(to_hz / from_hz),
    }
}

/// Returns when a sweep left the end of the specified range, s from the start of the record; the start itself at the least.
fn begins_s(test: &SineTest, pass: &SinePass) -> f64 {
    let [lowest_hz, highest_hz] = test.band_hz();
    let before_s = if pass.from_hz < pass.to_hz {
        test.sweep_s(lowest_hz, pass.from_hz)
    } else {
        test.sweep_s(pass.from_hz, highest_hz)
    };
    (pass.from_s - before_s).max(0.0)
}

fn conclude(test: &SineTest, limits: &Limits, sweeps: Vec<Sweep>, left_out: usize) -> SineVerdict {
    let mut over_limit: Vec<(f64, f64)> = vec![(0.0, 0.0); limits.response.len()];
    let mut passes = Vec::new();
    let mut points = Vec::new();
    for sweep in sweeps {
        for (largest, own) in over_limit.iter_mut().zip(sweep.over_limit) {
            if own.0 > largest.0 {
                *largest = own;
            }
        }
        passes.push(sweep.pass);
        points.extend(sweep.points);
    }
    let begins_s = passes.first().map_or(0.0, |pass| begins_s(test, pass));
    let all: f64 = points.iter().map(|(_, seconds)| seconds).sum();
    let shares = Verdict::ALL.map(|verdict| {
        let own = points.iter().filter(|(point, _)| point.verdict == verdict);
        own.fold(0.0, |sum, (_, seconds)| sum + seconds) / all.max(f64::MIN_POSITIVE)
    });
    let amplitude =
        if points.is_empty() { Verdict::Undecided } else { Verdict::of_share(shares[0], shares[2], test.share) };
    let ratio = |point: &SinePoint| (value(test, point) / point.demand_m_s2, point.frequency_hz);
    let ratios = || points.iter().map(|(point, _)| ratio(point));
    let lowest = ratios().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
    let highest = ratios().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
    let (SweepRate::OctavesPerMinute(nominal) | SweepRate::HertzPerSecond(nominal)) = test.rate;
    let rate = test.rate_tolerance.map(|tolerance| {
        let is_in = |pass: &SinePass| {
            (pass.rate / nominal - 1.0).abs() <= tolerance && pass.departure_octaves <= MOST_DEPARTURE
        };
        if passes.iter().all(is_in) { Verdict::In } else { Verdict::Out }
    });
    let is_continuous =
        passes.iter().map(|pass| pass.still).try_fold(true, |all, still| Some(all && still? <= MOST_STILL));
    let limits: Vec<LimitVerdict> = limits
        .response
        .iter()
        .zip(&over_limit)
        .map(|(limit, (ratio, hz))| LimitVerdict {
            channel: limit.channel.clone(),
            largest_db: 20.0 * libm::log10(*ratio),
            largest_hz: *hz,
            verdict: if *ratio <= 1.0 + LIMIT { Verdict::In } else { Verdict::Out },
        })
        .collect();
    let stepped = if is_continuous == Some(false) { Verdict::Out } else { Verdict::In };
    let whole = passes.iter().filter(|pass| pass.is_whole).count();
    let missing = if whole < test.sweeps as usize { Verdict::Undecided } else { Verdict::In };
    let others = rate.into_iter().chain([stepped, missing]).chain(limits.iter().map(|limit| limit.verdict));
    SineVerdict {
        verdict: others.fold(amplitude, Verdict::max),
        amplitude,
        shares,
        extremes: [lowest.0, highest.0],
        extremes_hz: [lowest.1, highest.1],
        rate,
        is_continuous,
        begins_s,
        left_out,
        passes,
        whole,
        asked: test.sweeps,
        limits,
        points: points.into_iter().map(|(point, _)| point).collect(),
    }
}
