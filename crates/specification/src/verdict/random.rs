//! Verdicts on random tests.
//!
//! An averaged density of ν degrees of freedom over the true one has the distribution χ²(ν)/ν, so the true density lies between
//! νP/χ²(0.975) and νP/χ²(0.025) with 95 % probability.
//!
//! Among 200 lines, ten intervals miss their density. So the whole profile is out only if lines are proven out at 1 % for all
//! tests together (S. Holm, "A Simple Sequentially Rejective Multiple Test Procedure", Scand. J. Statist. 6 (1979)), which are
//! divided among single lines, means of 5 and means of 15 adjacent lines. Adjacent lines of Hann's window have the correlations
//! 4/9 and 1/36 for one and two lines, so a mean of w lines has νw/(1 + 2((w − 1)/w · 4/9 + (w − 2)/w · 1/36)) degrees of freedom.
//!
//! Two lines at each edge of the profile are left out: windows mix them with what lies beyond the edge.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use nalgebra::Complex;
use resonarm_modal::spectra::{CrossSpectra, Segments, Signals};
use resonarm_numeric::dft::Fft;
use resonarm_numeric::distribution::{
    binomial_survival, chi_square_probability, chi_square_quantile, chi_square_survival,
};
use serde::Serialize;

use super::{Verdict, mean};
use crate::error::VerdictError;
use crate::file::Average;
use crate::profile::Profile;
use crate::random::{RandomTest, Schedule};
use crate::specification::Limits;

/// Correlations of adjacent lines, and of lines with one between them.
const CORRELATIONS: [f64; 2] = [4.0 / 9.0, 1.0 / 36.0];
/// Probability of a wrong *out*.
const ALPHA: f64 = 0.01;
/// Widths of the means of adjacent lines that are tested.
const WIDTHS: [usize; 2] = [5, 15];
/// Lines that are left out at each edge.
const EDGE: usize = 2;
/// Deviation by which a response may exceed its limit, dB; within as much below, it holds the control channel down.
const LIMIT_DB: f64 = 1.5;
/// Window over which the level of a record is found, s, and how far it may be from the full level, dB.
const LEVEL_S: f64 = 2.0;
const LEVEL_DB: f64 = 2.0;

/// Averaged density of a record, (m/s²)²/Hz.
#[derive(Clone, Copy, Debug)]
pub struct Density<'a> {
    /// Frequencies of the lines, Hz, evenly spaced.
    pub frequency_hz: &'a [f64],
    /// Densities of the lines.
    pub density: &'a [f64],
    /// Degrees of freedom of a line.
    pub degrees_of_freedom: f64,
}

/// Verdict on a line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LineVerdict {
    /// Frequency of the line, Hz.
    pub frequency_hz: f64,
    /// Density of the record, (m/s²)²/Hz.
    pub density: f64,
    /// Density that is specified at the line, (m/s²)²/Hz.
    pub demand: f64,
    /// Ends of the interval of 95 % confidence, dB relative to the specified density.
    pub interval_db: [f64; 2],
    /// Lower and upper tolerance at the line, dB.
    pub tolerance_db: [f64; 2],
    /// Whether a response is at its limit, so that the density may be too low.
    pub is_limited: bool,
    /// Verdict on the line alone.
    pub verdict: Verdict,
}

/// Verdict on the rms acceleration between the edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RmsVerdict {
    /// Rms of the judged lines, m/s².
    pub rms_m_s2: f64,
    /// Specified rms of the judged lines, m/s².
    pub demand_m_s2: f64,
    /// Ends of the interval of 95 % confidence, over the specified rms.
    pub interval: [f64; 2],
    /// Verdict, if the specification states a tolerance.
    pub verdict: Option<Verdict>,
}

/// Verdict on a response with a limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LimitVerdict {
    /// Name of the channel.
    pub channel: String,
    /// Largest density over its limit, dB.
    pub largest_db: f64,
    /// Frequency of the largest, Hz.
    pub largest_hz: f64,
    /// Verdict: the limit may be exceeded by 1.5 dB.
    pub verdict: Verdict,
}

/// Verdict on a random test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RandomVerdict {
    /// Verdict on the whole.
    pub verdict: Verdict,
    /// The lines that were judged, without those at the edges.
    pub lines: Vec<LineVerdict>,
    /// Verdict on the profile.
    pub profile: Verdict,
    /// Numbers of lines that are in, undecided and out, each line alone.
    pub counts: [usize; 3],
    /// Frequencies, Hz, of single lines that are proven out for the whole profile.
    pub proven_hz: Vec<f64>,
    /// Number of means of 5 and of 15 lines that are proven out for the whole profile.
    pub proven_means: usize,
    /// Degrees of freedom of a line.
    pub degrees_of_freedom: f64,
    /// Degrees of freedom at which a profile with the deviations of this one is decided with 95 % probability; none if it is
    /// decided, and if its deviation itself is at the tolerance.
    pub deciding_dof: Option<f64>,
    /// Whether the record has fewer degrees of freedom than the specification asks for.
    pub is_too_short: bool,
    /// Verdict on the rms.
    pub rms: RmsVerdict,
    /// Verdicts on responses with a limit.
    pub limits: Vec<LimitVerdict>,
    /// Deviation beyond which lines are counted, dB.
    pub counted_beyond_db: f64,
    /// Number of lines beyond it.
    pub counted: usize,
    /// Probability that a perfect controller has at least as many lines beyond it. This is a measure of the control, not of the
    /// tolerance: a controller may be within its tolerance, and still far from perfect.
    pub perfect_probability: f64,
    /// Largest deviation of lines beyond the alarm and the abort lines, if they are stated: their numbers.
    pub beyond: [Option<usize>; 2],
    /// Lowest and highest deviation of a line, dB.
    pub deviation_db: [f64; 2],
}

/// Returns the verdict on a line: `ratio` is its density over the specified one, tolerances in dB.
pub fn line_verdict(ratio: f64, degrees_of_freedom: f64, tolerance_db: [f64; 2]) -> Verdict {
    let factors = interval_factors(degrees_of_freedom);
    Verdict::of(factors.map(|factor| 10.0 * libm::log10(factor * ratio)), tolerance_db)
}

/// Returns the factors of a density that give the ends of its interval of 95 % confidence.
fn interval_factors(degrees_of_freedom: f64) -> [f64; 2] {
    [0.975, 0.025].map(|probability| degrees_of_freedom / chi_square_quantile(probability, degrees_of_freedom))
}

/// Returns the probability that a perfect controller has at least as many lines beyond ±`beyond_db` as there are among these
/// ratios of density and specified density.
///
/// Even and odd lines are counted apart, since adjacent lines are correlated; the smaller probability of both counts twice.
pub fn perfect_probability(ratios: &[f64], degrees_of_freedom: f64, beyond_db: f64) -> f64 {
    let [high, low] = [beyond_db, -beyond_db].map(|db| degrees_of_freedom * power(db));
    let probability = chi_square_survival(high, degrees_of_freedom) + chi_square_probability(low, degrees_of_freedom);
    let smallest = [0, 1].map(|first| {
        let own = || ratios.iter().skip(first).step_by(2);
        let count = own().filter(|ratio| is_beyond(**ratio, beyond_db)).count();
        binomial_survival(count, own().count(), probability)
    });
    (2.0 * smallest[0].min(smallest[1])).min(1.0)
}

/// Returns a ratio of powers that is stated in dB.
fn power(db: f64) -> f64 {
    libm::pow(10.0, 0.1 * db)
}

fn is_beyond(ratio: f64, beyond_db: f64) -> bool {
    (10.0 * libm::log10(ratio)).abs() > beyond_db
}

/// Returns the deviation beyond which lines are counted, dB: about three deviations of a line.
fn counted_beyond_db(degrees_of_freedom: f64) -> f64 {
    match degrees_of_freedom {
        few if few < 150.0 => 1.5,
        some if some < 500.0 => 1.0,
        _ => 0.6,
    }
}

/// A judged line with its tolerance as ratios of powers.
struct Line {
    ratio: f64,
    low: f64,
    high: f64,
}

impl Line {
    /// Returns the ratios to both ends of the tolerance; the lower one is infinite where a limit holds the density down.
    fn to_ends(&self) -> [f64; 2] {
        [self.ratio / self.low, self.ratio / self.high]
    }
}

/// Returns the probability, two-sided, of a mean of ratios to the ends of a tolerance if the true densities are at these ends.
fn probability([to_low, to_high]: [f64; 2], degrees_of_freedom: f64) -> f64 {
    let high = chi_square_survival(degrees_of_freedom * to_high, degrees_of_freedom);
    let low =
        if to_low.is_finite() { chi_square_probability(degrees_of_freedom * to_low, degrees_of_freedom) } else { 1.0 };
    2.0 * high.min(low)
}

/// Returns the indices of single lines that are proven out, by Holm's procedure, and the number of means that are.
fn proven(lines: &[Line], degrees_of_freedom: f64) -> (Vec<usize>, usize) {
    let family = ALPHA / (1 + WIDTHS.len()) as f64;
    let single: Vec<f64> = lines.iter().map(|line| probability(line.to_ends(), degrees_of_freedom)).collect();
    // Holm's procedure tests the smallest probability first, and stops at the first one that proves nothing.
    let mut order: Vec<usize> = (0..lines.len()).collect();
    order.sort_by(|a, b| single[*a].total_cmp(&single[*b]));
    let is_proven = |rank: usize, index: usize| single[index] <= family / (lines.len() - rank) as f64;
    let count = order.iter().enumerate().take_while(|(rank, index)| is_proven(*rank, **index)).count();
    let mut out = order[..count].to_vec();
    out.sort_unstable();
    let mut means = 0;
    for width in WIDTHS {
        let windows = lines.windows(width).len();
        let w = width as f64;
        let correlated = (w - 1.0) / w * CORRELATIONS[0] + (w - 2.0) / w * CORRELATIONS[1];
        let freedom = degrees_of_freedom * w / (1.0 + 2.0 * correlated);
        let is_out = |window: &&[Line]| {
            let sums =
                window.iter().map(Line::to_ends).fold([0.0; 2], |sums, ends| [sums[0] + ends[0], sums[1] + ends[1]]);
            probability(sums.map(|sum| sum / w), freedom) <= family / windows as f64
        };
        means += lines.windows(width).filter(is_out).count();
    }
    (out, means)
}

/// Returns the first and the last line that is judged, `EDGE` lines within the edges of a profile.
fn judged(frequency_hz: &[f64], [from_hz, to_hz]: [f64; 2]) -> Result<Range<usize>, VerdictError> {
    let spacing_hz = if frequency_hz.len() > 1 { frequency_hz[1] - frequency_hz[0] } else { 0.0 };
    // Frequencies of lines are multiples of a rounded spacing, and may miss an edge by the last bit.
    let slack = 1e-6 * spacing_hz;
    let first = frequency_hz.iter().position(|hz| *hz >= from_hz - slack).unwrap_or(frequency_hz.len()) + EDGE;
    let end =
        frequency_hz.iter().rposition(|hz| *hz <= to_hz + slack).map_or(0, |last| (last + 1).saturating_sub(EDGE));
    if first < end { Ok(first..end) } else { Err(VerdictError::NoLines { from_hz, to_hz, spacing_hz }) }
}

/// Judges the density of the control channel. `limits` are the densities of responses with a limit, at the same lines, with the
/// name of the channel and the limit.
///
/// # Errors
/// [`VerdictError::NoLines`] if no line is left between the edges.
pub fn judge_density(
    test: &RandomTest,
    control: &Density<'_>,
    limits: &[(&str, &Profile, &[f64])],
) -> Result<RandomVerdict, VerdictError> {
    let range = judged(control.frequency_hz, test.profile.band_hz())?;
    let freedom = control.degrees_of_freedom;
    let factors = interval_factors(freedom);
    let at_limit = |index: usize| {
        let hz = control.frequency_hz[index];
        limits
            .iter()
            .any(|(_, limit, density)| limit.at(hz).is_some_and(|limit| density[index] >= limit * power(-LIMIT_DB)))
    };
    let mut lines = Vec::with_capacity(range.len());
    let mut judged = Vec::with_capacity(range.len());
    for index in range {
        let hz = control.frequency_hz[index];
        let density = control.density[index];
        let Some(demand) = test.profile.at(hz) else { continue };
        let is_limited = at_limit(index);
        let [low_db, high_db] = test.tolerance.at(hz);
        let ratio = density / demand;
        let low_db = if is_limited { f64::NEG_INFINITY } else { low_db };
        let interval_db = factors.map(|factor| 10.0 * libm::log10(factor * ratio));
        let verdict = Verdict::of(interval_db, [low_db, high_db]);
        let tolerance_db = [low_db, high_db];
        lines.push(LineVerdict { frequency_hz: hz, density, demand, interval_db, tolerance_db, is_limited, verdict });
        judged.push(Line { ratio, low: power(low_db), high: power(high_db) });
    }
    let (out, proven_means) = proven(&judged, freedom);
    let counts = Verdict::ALL.map(|verdict| lines.iter().filter(|line| line.verdict == verdict).count());
    let profile = Verdict::decided(!out.is_empty() || proven_means > 0, counts[0] == lines.len());
    let limits: Vec<LimitVerdict> =
        limits.iter().map(|(channel, limit, density)| limit_verdict(channel, limit, density, control)).collect();
    let rms = rms_verdict(test, &lines, freedom, control.frequency_hz);
    let is_too_short = test.least_dof.is_some_and(|least| freedom < least);
    let mut verdict = limits.iter().map(|limit| limit.verdict).chain(rms.verdict).fold(profile, Verdict::max);
    // The specification asks for more averages than the record has, so that the record can't be in.
    if is_too_short {
        verdict = verdict.max(Verdict::Undecided);
    }
    let ratios: Vec<f64> = judged.iter().map(|line| line.ratio).collect();
    let beyond_db = counted_beyond_db(freedom);
    let deviations = || ratios.iter().map(|ratio| 10.0 * libm::log10(*ratio));
    let beyond = [&test.alarm, &test.abort].map(|tolerance| {
        let tolerance = tolerance.as_ref()?;
        let is_beyond = |(line, db): &(&LineVerdict, f64)| {
            let [low, high] = tolerance.at(line.frequency_hz);
            *db > high || (*db < low && !line.is_limited)
        };
        Some(lines.iter().zip(deviations()).filter(is_beyond).count())
    });
    Ok(RandomVerdict {
        verdict,
        profile,
        counts,
        proven_hz: out.iter().map(|index| lines[*index].frequency_hz).collect(),
        proven_means,
        degrees_of_freedom: freedom,
        deciding_dof: if profile == Verdict::Undecided { deciding_dof(&lines, &ratios) } else { None },
        is_too_short,
        rms,
        limits,
        counted_beyond_db: beyond_db,
        counted: ratios.iter().filter(|ratio| is_beyond(**ratio, beyond_db)).count(),
        perfect_probability: perfect_probability(&ratios, freedom, beyond_db),
        beyond,
        deviation_db: [deviations().fold(f64::INFINITY, f64::min), deviations().fold(f64::NEG_INFINITY, f64::max)],
        lines,
    })
}

/// Judges a response by its limit, as the lines of the control channel by the upper end of their tolerance.
fn limit_verdict(channel: &str, limit: &Profile, density: &[f64], control: &Density<'_>) -> LimitVerdict {
    let limited = control.frequency_hz.iter().zip(density);
    let limited: Vec<(f64, f64)> = limited.filter_map(|(hz, density)| Some((*hz, density / limit.at(*hz)?))).collect();
    let lines: Vec<Line> =
        limited.iter().map(|(_, ratio)| Line { ratio: *ratio, low: 0.0, high: power(LIMIT_DB) }).collect();
    let (out, means) = proven(&lines, control.degrees_of_freedom);
    let factors = interval_factors(control.degrees_of_freedom);
    let largest = limited.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0.0, 0.0));
    let verdict = Verdict::decided(!out.is_empty() || means > 0, largest.1 * factors[1] <= power(LIMIT_DB));
    LimitVerdict { channel: channel.into(), largest_db: 10.0 * libm::log10(largest.1), largest_hz: largest.0, verdict }
}

/// Judges the rms of the lines. The sum of lines P has the degrees of freedom ν (Σ P)²/Σᵢⱼ ρᵢⱼ PᵢPⱼ, with the correlations ρ of the
/// lines.
fn rms_verdict(test: &RandomTest, lines: &[LineVerdict], freedom: f64, frequency_hz: &[f64]) -> RmsVerdict {
    let spacing_hz = if frequency_hz.len() > 1 { frequency_hz[1] - frequency_hz[0] } else { 0.0 };
    let sum: f64 = lines.iter().map(|line| line.density).sum();
    let demand: f64 = lines.iter().map(|line| line.demand).sum();
    let product =
        |apart: usize| -> f64 { lines.iter().zip(lines.iter().skip(apart)).map(|(a, b)| a.density * b.density).sum() };
    let correlated = product(0) + 2.0 * (CORRELATIONS[0] * product(1) + CORRELATIONS[1] * product(2));
    let factors = interval_factors(freedom * sum * sum / correlated);
    let interval = factors.map(|factor| libm::sqrt(factor * sum / demand));
    let low = |tolerance: f64| if lines.iter().any(|line| line.is_limited) { 0.0 } else { 1.0 - tolerance };
    RmsVerdict {
        rms_m_s2: libm::sqrt(sum * spacing_hz),
        demand_m_s2: libm::sqrt(demand * spacing_hz),
        interval,
        verdict: test.rms_tolerance.map(|tolerance| Verdict::of(interval, [low(tolerance), 1.0 + tolerance])),
    }
}

/// Returns the degrees of freedom at which 95 % of profiles with the deviation of this one are decided.
///
/// A line of ν degrees of freedom scatters by 4.343 √(2/ν) dB. It is in if its deviation and half of its interval, 1.96 of these,
/// stay within the tolerance, and with 95 % probability none of n lines scatters by more than √(2 ln(n/0.05)) of them. The
/// deviation of the control without its scatter is taken from means of 15 lines.
fn deciding_dof(lines: &[LineVerdict], ratios: &[f64]) -> Option<f64> {
    let width = WIDTHS[1].min(ratios.len());
    let margin = ratios.windows(width).zip(lines.windows(width)).map(|(ratios, lines)| {
        let db = 10.0 * libm::log10(mean(ratios));
        let [low, high] = lines[width / 2].tolerance_db;
        (high - db).min(db - low)
    });
    let margin = margin.fold(f64::INFINITY, f64::min);
    let largest = libm::sqrt(2.0 * libm::log(lines.len() as f64 / 0.05));
    let scatter = 10.0 * core::f64::consts::LOG10_E * (super::CONFIDENT + largest) / margin;
    (margin > 0.0 && margin.is_finite()).then_some(2.0 * scatter * scatter)
}

/// Levels of a record in the course of a random test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LevelVerdict {
    /// Longest stretch at full level, in samples. Ramps at its ends are left out, and so are up to 2 s at each of them. `None` if
    /// there is none of 4 s.
    #[serde(skip)]
    pub longest: Option<Range<usize>>,
    /// Time at full level, s, of all stretches together.
    pub full_s: f64,
    /// Time at full level that the specification asks for, s, if it states a schedule.
    pub asked_s: Option<f64>,
    /// Highest rms over 2 s relative to the specified one, dB.
    pub highest_db: f64,
    /// Start of these 2 s, s from the start of the record.
    pub highest_s: f64,
    /// Out if the record proves that the level exceeded the specified one by 2 dB at any time, with a probability of error of 1 %
    /// for the whole; undecided if it is at full level for less time than the specification asks for.
    pub verdict: Verdict,
}

/// Finds the stretches of a record at full level: in which the rms within the band of the profile stays within 2 dB of the
/// specified one, over 2 s. `None` if the record is shorter than two of these windows.
///
/// The square of an rms over the time T has 2T (∫G df)²/∫G² df degrees of freedom for the density G of the profile.
pub fn judge_level(test: &RandomTest, rate_hz: f64, samples: &[f64]) -> Option<LevelVerdict> {
    let window = libm::ceil(LEVEL_S * rate_hz) as usize;
    if window == 0 || samples.len() < 2 * window {
        return None;
    }
    let [from_hz, to_hz] = test.profile.band_hz();
    let specified = test.profile.moment(0);
    // Running sums make the mean square of every window a difference, whatever the window's length.
    let mut sums = vec![0.0; samples.len() + 1];
    for (index, sample) in within_band(samples, rate_hz, [from_hz, to_hz]).iter().enumerate() {
        sums[index + 1] = sums[index] + sample * sample;
    }
    let ratio = |start: usize| (sums[start + window] - sums[start]) / window as f64 / specified;
    let is_full = |start: usize| (10.0 * libm::log10(ratio(start))).abs() <= LEVEL_DB;
    let starts = samples.len() - window + 1;
    let mut stretches: Vec<Range<usize>> = Vec::new();
    let mut first = None;
    for start in 0..=starts {
        if start < starts && is_full(start) {
            first.get_or_insert(start);
        } else if let Some(first) = first.take() {
            // The first window may hold a part of the ramp up, the last one of the ramp down.
            let from = if first == 0 { 0 } else { first + window };
            let to = if start == starts { samples.len() } else { start };
            if to >= from + 2 * window {
                stretches.push(from..to);
            }
        }
    }
    let (highest, highest_at) = (0..starts).map(|start| (ratio(start), start)).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let lines = (0..).map(|line| from_hz + f64::from(line) * test.lines_hz).take_while(|hz| *hz <= to_hz);
    let squares: f64 = lines.filter_map(|hz| test.profile.at(hz)).map(|density| density * density).sum();
    let freedom = 2.0 * LEVEL_S * specified * specified / (squares * test.lines_hz);
    let chance = chi_square_survival(freedom * highest / libm::pow(10.0, 0.1 * LEVEL_DB), freedom);
    let windows = samples.len() as f64 / window as f64;
    let full_s = stretches.iter().map(Range::len).sum::<usize>() as f64 / rate_hz;
    // What may have been left out at the ends of stretches.
    let unseen_s = 2.0 * LEVEL_S * stretches.len() as f64;
    let asked_s = test.schedule.as_ref().map(Schedule::full_level_s);
    let verdict = if highest > 1.0 && chance * windows < ALPHA {
        Verdict::Out
    } else if asked_s.is_some_and(|asked_s| full_s + unseen_s < asked_s) {
        Verdict::Undecided
    } else {
        Verdict::In
    };
    Some(LevelVerdict {
        longest: stretches.into_iter().max_by_key(Range::len),
        full_s,
        asked_s,
        highest_db: 10.0 * libm::log10(highest),
        highest_s: highest_at as f64 / rate_hz,
        verdict,
    })
}

/// Returns the part of samples within a band of frequencies, by the Fourier transform of the whole.
fn within_band(samples: &[f64], rate_hz: f64, [from_hz, to_hz]: [f64; 2]) -> Vec<f64> {
    let transform = Fft::at_least(samples.len());
    let length = transform.length();
    let mut values: Vec<Complex<f64>> = samples.iter().map(|sample| Complex::new(*sample, 0.0)).collect();
    values.resize(length, Complex::new(0.0, 0.0));
    transform.forward(&mut values);
    for (line, value) in values.iter_mut().enumerate() {
        let hz = line.min(length - line) as f64 * rate_hz / length as f64;
        if !(hz >= from_hz && hz <= to_hz) {
            *value = Complex::new(0.0, 0.0);
        }
    }
    transform.backward(&mut values);
    values[..samples.len()].iter().map(|value| value.re / length as f64).collect()
}

/// What a random test is judged with.
#[derive(Clone, Copy, Debug)]
pub struct RandomOptions<'a> {
    /// Readings of the control channels, m/s².
    pub control: &'a [&'a [f64]],
    /// Channels of the responses with a limit, in the order of [`Limits::response`].
    pub responses: &'a [&'a [f64]],
    /// Average over the control channels.
    pub average: Average,
}

/// Judges a record of a random test at full level, `rate_hz` samples a second.
///
/// Densities are means over half-overlapping segments with Hann's window, whose length gives the specified spacing of the lines.
/// For several control channels the degrees of freedom are those of one, as if their scatter were the same.
///
/// # Errors
/// [`VerdictError`] if the record is too short or too slowly sampled, or the channels don't fit.
pub fn judge_random(
    test: &RandomTest,
    limits: &Limits,
    rate_hz: f64,
    options: &RandomOptions<'_>,
) -> Result<RandomVerdict, VerdictError> {
    let [_, highest_hz] = test.profile.band_hz();
    let least_hz = 2.0 * (highest_hz + test.lines_hz);
    if rate_hz.is_nan() || rate_hz < least_hz {
        return Err(VerdictError::Rate { highest_hz, rate_hz, least_hz });
    }
    let length = libm::round(rate_hz / test.lines_hz) as usize;
    let samples = options.control.first().map_or(0, |channel| channel.len());
    if samples < length {
        return Err(VerdictError::TooShort { got_s: samples as f64 / rate_hz, least_s: length as f64 / rate_hz });
    }
    if options.control.is_empty() || options.responses.len() != limits.response.len() {
        return Err(VerdictError::Channels);
    }
    let channels: Vec<&[f64]> = options.control.iter().chain(options.responses).copied().collect();
    let record = Signals { inputs: &[], outputs: &channels };
    let spectra = CrossSpectra::estimate(rate_hz, &[record], &Segments::hann(length))?;
    let (control, responses) = spectra.outputs.split_at(options.control.len());
    let average = |line: usize| options.average.of(control.iter().map(|density| density[line]));
    let density: Vec<f64> = (0..spectra.frequency_hz.len()).map(average).collect();
    let limits: Vec<(&str, &Profile, &[f64])> = limits
        .response
        .iter()
        .zip(responses)
        .map(|(limit, density)| (limit.channel.as_str(), &limit.profile, density.as_slice()))
        .collect();
    let density = Density {
        frequency_hz: &spectra.frequency_hz,
        density: &density,
        degrees_of_freedom: spectra.degrees_of_freedom,
    };
    judge_density(test, &density, &limits)
}
