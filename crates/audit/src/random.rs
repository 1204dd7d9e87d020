//! Cases of random tests.
//!
//! The accuracy of the control is judged by [`judge_random`], which knows how estimates scatter. Two statistics look at the
//! signals themselves: over short segments the lines of an honest controller scatter nearly as χ² with 2 degrees of freedom.
//! Frames that are joined under windows scatter less, to about 0.6 of its variance, and a record narrower than χ² as a whole is
//! good control: the loop corrects the scatter of its own estimate.

use alloc::vec::Vec;
use core::ops::Range;

use resonarm_numeric::distribution::chi_square_quantile;
use resonarm_specification::verdict::{self, RandomOptions, RandomVerdict, judge_random};
use resonarm_specification::{Average, RandomTest, Test};

use crate::case::{Base, Case, Context, Finding, Judged, Measure, NO_LEVEL, SETTLE_S, Stimulus, Verdict};
use crate::reaction::{RISE_S, Reaction};
use crate::record::{Record, db, largest, rms, running_rms};
use crate::spectrum::Segments;

/// Window over which the level is searched for, s, and how far it may be from the full level, dB.
const LEVEL_S: f64 = 2.0;
const LEVEL_DB: f64 = 2.0;
/// Time before the end of the drive that is not judged, s: the ramp.
const RAMP_S: f64 = 0.15;
/// Least time of level that the cases about accuracy judge, s.
const LEAST_S: f64 = 20.0;
/// Time from a stimulus by which the level must be back, s, and over which it is then judged, s.
const RECOVERY_S: f64 = 25.0;
const RECOVERED_S: f64 = 10.0;
/// Time at the end of a record in which an ended test has no drive, s.
const QUIET_S: f64 = 0.02;
/// Time from the full level by which a controller must have given up, s.
const GIVE_UP_S: f64 = 10.0;
/// Largest distance of segments that are searched for repetitions.
const REPETITIONS: usize = 90;

pub(crate) const CASES: &[Case] = &[
    Case {
        id: "R01",
        title: "comes to the full level",
        rule: "at least half of the specified time within 2 dB of the specified rms, over 2 s",
        stimulus: Stimulus::None,
        judge: full_level,
    },
    Case {
        id: "R02",
        title: "holds the profile",
        rule: "no line, and no mean of 5 or 15 lines, is proven out of its tolerance at 1 % for the whole; inconclusive where lines are undecided",
        stimulus: Stimulus::None,
        judge: profile,
    },
    Case {
        id: "R03",
        title: "holds the rms",
        rule: "rms between the edges within the specified tolerance, or 10 %",
        stimulus: Stimulus::None,
        judge: whole_rms,
    },
    Case {
        id: "R04",
        title: "drives with a Gaussian signal",
        rule: "kurtosis of the drive from 2.6 to 3.4, crest factor at least 2.5",
        stimulus: Stimulus::None,
        judge: gaussian,
    },
    Case {
        id: "R05",
        title: "draws new phases",
        rule: "variance of segments over that of χ² from 0.55 to 1.3; no segment of the drive matches an earlier one 4 times better than chance",
        stimulus: Stimulus::None,
        judge: new_phases,
    },
    Case {
        id: "R06",
        title: "goes through its levels",
        rule: "at least 1.5 s within 2 dB of each specified level of −5 dB or less; at most +1.5 dB of the specified rms over 2 s, or what a perfect controller exceeds once in 1000 times",
        stimulus: Stimulus::None,
        judge: schedule,
    },
    Case {
        id: "R07",
        title: "stays at full level as long as specified",
        rule: "at most 1 s less than specified",
        stimulus: Stimulus::None,
        judge: duration,
    },
    Case {
        id: "R08",
        title: "drives within the band",
        rule: "less than 2 % of the power of the drive more than 15 lines beyond the profile",
        stimulus: Stimulus::None,
        judge: band,
    },
    Case {
        id: "R09",
        title: "ends its drive with the test",
        rule: "the drive is 0 at the end of the run",
        stimulus: Stimulus::None,
        judge: quiet_end,
    },
    Case {
        id: "R10",
        title: "refuses a dead channel",
        rule: "at most 10 % of the largest drive of the base run, then none",
        stimulus: Stimulus::DeadFromStart,
        judge: refuses,
    },
    Case {
        id: "R11",
        title: "refuses an open cable",
        rule: "at most 10 % of the largest drive of the base run, then none",
        stimulus: Stimulus::OpenFromStart,
        judge: refuses,
    },
    Case {
        id: "R12",
        title: "stops when the channel reads nothing",
        rule: "no drive after 600 ms, or 100 ms more than the specified time; a ramp of at least 15 ms; no larger drive than a steady one has once in 1000 times",
        stimulus: Stimulus::Dead,
        judge: lost,
    },
    Case {
        id: "R13",
        title: "stops when the channel reads noise",
        rule: "no drive after 600 ms, or 100 ms more than the specified time; a ramp of at least 15 ms; no larger drive than a steady one has once in 1000 times",
        stimulus: Stimulus::Open,
        judge: lost,
    },
    Case {
        id: "R14",
        title: "aborts at three times the level",
        rule: "no drive after 1 s",
        stimulus: Stimulus::Gain(3.0),
        judge: aborts,
    },
    Case {
        id: "R15",
        title: "equalises again when the plant has changed",
        rule: "within 2 dB of the specified rms 25 s after the channel reads 3 dB less",
        stimulus: Stimulus::Gain(0.708),
        judge: equalises,
    },
    Case {
        id: "R16",
        title: "heeds clipped readings",
        rule: "no drive 10 s after the full level would be reached; inconclusive if no reading is clipped",
        stimulus: Stimulus::Clipped(CLIPPED_SIGMA),
        judge: gives_up,
    },
    Case {
        id: "R17",
        title: "keeps the limit of a response",
        rule: "the response at most 1.5 dB beyond its limit; no line out at which the response of the base run is below it",
        stimulus: Stimulus::ResponseLimit(6.0),
        judge: notches,
    },
    Case {
        id: "R18",
        title: "stops softly when told to",
        rule: "no drive after 500 ms; a ramp of at least 15 ms",
        stimulus: Stimulus::Stop,
        judge: stops,
    },
    Case {
        id: "R19",
        title: "begins low after an abort",
        rule: "in the first 6 s at most 10 % of the largest drive of the base run",
        stimulus: Stimulus::Restart,
        judge: restarts,
    },
    Case {
        id: "R20",
        title: "goes on after a gap of 150 ms",
        rule: "no larger drive than a steady one has once in 1000 times; from 1 s after the gap began an rms over 2 s as of R06; still driving 8 s later",
        stimulus: Stimulus::Gap(0.15),
        judge: bridges,
    },
    Case {
        id: "R21",
        title: "keeps the limit of the drive",
        rule: "never beyond the limit, and no drive 10 s after the full level would be reached",
        stimulus: Stimulus::DriveLimit(0.43),
        judge: limits_drive,
    },
    Case {
        id: "R22",
        title: "refuses an inverted sensor",
        rule: "at most 10 % of the largest drive of the base run; inconclusive beyond it, since the level is kept all the same",
        stimulus: Stimulus::Inverted,
        judge: inverted,
    },
    Case {
        id: "R23",
        title: "scatters as a perfect controller",
        rule: "a perfect controller has as many lines beyond the counted deviation with a probability of at least 0.01",
        stimulus: Stimulus::None,
        judge: perfect,
    },
];

/// Returns the specified rms, m/s².
fn demand(test: &RandomTest) -> f64 {
    libm::sqrt(test.profile.moment(0))
}

/// Returns the samples at full level: from where the rms over 2 s is within 2 dB of the specified one to where it last is, or to the
/// end of the drive without the ramp; none if it is for less than 1 s.
pub(crate) fn level(test: &RandomTest, record: &Record) -> Option<Range<usize>> {
    let window = record.samples(LEVEL_S);
    let demand = demand(test);
    let is_full = |rms: &f64| db(rms / demand).abs() < LEVEL_DB;
    let running = running_rms(&record.reading, window);
    let first = running.iter().position(is_full)?;
    let last = running.iter().rposition(is_full)?;
    // A controller that rushes through the full level, as on its way to a higher one, has not held it.
    if running.iter().filter(|rms| is_full(rms)).count() < record.samples(1.0) {
        return None;
    }
    let end = record.drive_end().saturating_sub(record.samples(RAMP_S)).min(last + window);
    (end > first + window).then_some(first + window..end)
}

/// Returns the test. Another kind of test has none of these cases.
fn test<'a>(context: &Context<'a>) -> Result<&'a RandomTest, &'static str> {
    match &context.specification.test {
        Test::Random(test) => Ok(test),
        _ => Err(NO_LEVEL),
    }
}

/// Returns the test, and the full level of the base run, which must be long enough to be judged.
fn at_level<'a>(context: &Context<'a>) -> Result<(&'a RandomTest, Range<usize>), &'static str> {
    let test = test(context)?;
    let level = context.base.level.clone().ok_or(NO_LEVEL)?;
    if level.len() < context.record.samples(LEAST_S) {
        return Err("the base run has less than 20 s at full level");
    }
    Ok((test, level))
}

/// Judges the density over a range of samples of a record, by the specification of the run.
fn judged(context: &Context<'_>, record: &Record, range: Range<usize>) -> Result<RandomVerdict, &'static str> {
    const UNSUITED: &str = "the record does not suit the specification";
    let test = test(context).map_err(|_| UNSUITED)?;
    let control = record.reading.get(range.clone()).ok_or(UNSUITED)?;
    let limits = &context.specification.limits;
    // A run without a limit may record a response all the same.
    let responses = record.responses.iter().take(limits.response.len()).map(|response| response.get(range.clone()));
    let responses = &responses.collect::<Option<Vec<&[f64]>>>().ok_or(UNSUITED)?;
    let options = RandomOptions { control: &[control], responses, average: Average::Mean };
    judge_random(test, limits, record.rate_hz, &options).map_err(|_| UNSUITED)
}

/// Length of a segment in samples, and its first and last line within the edges of the profile.
fn segment(test: &RandomTest, rate_hz: f64) -> (usize, [usize; 2]) {
    let length = libm::round(rate_hz / test.lines_hz) as usize;
    let [first, last] = test.profile.band_hz().map(|hz| hz / test.lines_hz);
    // Two lines at each edge are left out, as in the verdict: the window mixes them with what lies beyond the edge.
    (length, [libm::ceil(first) as usize + 2, (libm::floor(last) as usize).saturating_sub(2)])
}

fn full_level(context: &Context<'_>) -> Judged {
    let test = test(context)?;
    let asked_s = test.schedule.as_ref().map_or(2.0 * LEAST_S, |schedule| schedule.full_level_s());
    // The level may be left again, as by a controller that goes on to a higher one.
    let demand = demand(test);
    let is_full = |rms: &&f64| db(**rms / demand).abs() < LEVEL_DB;
    let found_s = context.base.level.clone().map_or(0.0, |level| {
        let running = running_rms(&context.record.reading[level], context.record.samples(LEVEL_S));
        running.iter().filter(is_full).count() as f64 / context.record.rate_hz
    });
    Ok(Finding::of([Measure::at_least("time at full level", found_s, "s", 0.5 * asked_s)]))
}

fn profile(context: &Context<'_>) -> Judged {
    let (_, level) = at_level(context)?;
    let found = judged(context, context.record, level)?;
    let [low, high] = found.deviation_db;
    let mut finding = Finding::of([
        Measure::at_most("lines proven out", found.proven_hz.len() as f64, "", 0.0),
        Measure::at_most("means of lines proven out", found.proven_means as f64, "", 0.0),
        Measure { name: "lowest line", value: low, unit: "dB", least: None, most: None },
        Measure { name: "highest line", value: high, unit: "dB", least: None, most: None },
        Measure { name: "degrees of freedom", value: found.degrees_of_freedom, unit: "", least: None, most: None },
    ]);
    if found.profile == verdict::Verdict::Undecided {
        finding.verdict = Verdict::Inconclusive("lines are undecided: judge a longer record".into());
    }
    Ok(finding)
}

fn whole_rms(context: &Context<'_>) -> Judged {
    let (test, level) = at_level(context)?;
    let found = judged(context, context.record, level)?;
    let tolerance = test.rms_tolerance.unwrap_or(0.1);
    let ratio = found.rms.rms_m_s2 / found.rms.demand_m_s2;
    Ok(Finding::of([Measure::within("rms over the specified one", ratio, "", [1.0 - tolerance, 1.0 + tolerance])]))
}

fn gaussian(context: &Context<'_>) -> Judged {
    let (_, level) = at_level(context)?;
    let drive = &context.record.drive[level];
    let mean = drive.iter().sum::<f64>() / drive.len() as f64;
    let moment = |power: i32| {
        drive.iter().map(|value| libm::pow(value - mean, f64::from(power))).sum::<f64>() / drive.len() as f64
    };
    let variance = moment(2);
    Ok(Finding::of([
        Measure::within("kurtosis of the drive", moment(4) / (variance * variance), "", [2.6, 3.4]),
        Measure::at_least("crest factor of the drive", largest(drive) / libm::sqrt(variance), "", 2.5),
    ]))
}

fn new_phases(context: &Context<'_>) -> Judged {
    let (test, level) = at_level(context)?;
    let (length, lines) = segment(test, context.record.rate_hz);
    // The statistic of the variance takes segments that share no sample. Repetitions are searched for at half the
    // distance, so that frames of any position are met.
    let apart = Segments::new(&context.record.reading[level.clone()], length, length, lines);
    let overlapping = Segments::new(&context.record.drive[level], length, length / 2, lines);
    if apart.count() < 10 {
        return Err("the level has less than 10 segments");
    }
    Ok(Finding::of([
        Measure::within("variance of segments over that of χ²", apart.variance(), "", [0.55, 1.3]),
        Measure::at_most("match with an earlier segment over chance", overlapping.largest_match(REPETITIONS), "", 4.0),
    ]))
}

fn schedule(context: &Context<'_>) -> Judged {
    let (test, _) = at_level(context)?;
    const STEP_S: f64 = 0.25;
    let record = context.record;
    let window = record.samples(1.0);
    let step = record.samples(STEP_S).max(1);
    let levels: Vec<f64> =
        running_rms(&record.reading, window).iter().step_by(step).map(|rms| db(rms / demand(test))).collect();
    let rising = levels.iter().skip_while(|level| **level <= -20.0).take_while(|level| **level <= -2.0);
    let rising: Vec<f64> = rising.copied().collect();
    let asked = test.schedule.iter().flat_map(|schedule| &schedule.steps).filter(|step| step.level_db <= -5.0);
    let mut measured: Vec<Measure> = asked
        .map(|asked| {
            let count = rising.iter().filter(|level| (*level - asked.level_db).abs() < 2.0).count();
            let least = f64::min(1.5, 0.5 * asked.seconds);
            Measure::at_least("time at a lower level", STEP_S * count as f64, "s", least)
        })
        .collect();
    let until = &record.reading[..record.drive_end().min(record.len())];
    let most = running_rms(until, record.samples(LEVEL_S)).into_iter().fold(0.0, f64::max);
    measured.push(largest_rms(test, until.len() as f64 / record.rate_hz, most));
    Ok(Finding::of(measured))
}

/// Readings are clipped at so many times the specified rms.
const CLIPPED_SIGMA: f64 = 2.0;
/// Largest rms over 2 s that is always allowed, over the specified one, dB.
const MOST_RMS_DB: f64 = 1.5;
/// Probability with which a perfect controller exceeds a larger one in a record.
const FALSE_RMS: f64 = 1e-3;

/// Returns the largest rms over 2 s that is allowed in a record, over the specified one, dB.
///
/// The mean square over T of noise of the statistical bandwidth B has 2BT degrees of freedom. Means over windows that begin at
/// any sample scatter as four times as many as there are windows side by side.
pub(crate) fn most_rms_db(test: &RandomTest, seconds: f64) -> f64 {
    let freedom = 2.0 * test.profile.statistical_bandwidth_hz() * LEVEL_S;
    let windows = 4.0 * (seconds / LEVEL_S).max(1.0);
    let most = chi_square_quantile(1.0 - FALSE_RMS / windows, freedom) / freedom;
    (10.0 * libm::log10(most)).max(MOST_RMS_DB)
}

/// The largest rms over 2 s of a record.
fn largest_rms(test: &RandomTest, seconds: f64, most: f64) -> Measure {
    Measure::at_most("largest rms over 2 s", db(most / demand(test)), "dB", most_rms_db(test, seconds))
}

fn duration(context: &Context<'_>) -> Judged {
    let (test, level) = at_level(context)?;
    let Some(schedule) = &test.schedule else {
        return Ok(Finding::skipped("the specification states no schedule"));
    };
    // The window of 2 s before the level is at full level for the most part.
    let found_s = level.len() as f64 / context.record.rate_hz + LEVEL_S;
    Ok(Finding::of([Measure::at_least("time at full level", found_s, "s", schedule.full_level_s() - 1.0)]))
}

fn band(context: &Context<'_>) -> Judged {
    let (test, level) = at_level(context)?;
    let record = context.record;
    let (length, _) = segment(test, record.rate_hz);
    let drive = Segments::new(&record.drive[level], length, length / 2, [0, length / 2]);
    let [from_hz, to_hz] = test.profile.band_hz();
    let margin_hz = 15.0 * test.lines_hz;
    // Segments have every second line.
    let is_outside = |line: usize| {
        let hz = (2 * line) as f64 * test.lines_hz;
        hz > to_hz + margin_hz || hz < from_hz - margin_hz
    };
    let [outside, all] = drive.powers().iter().enumerate().fold([0.0, 0.0], |[outside, all], (line, power)| {
        [if is_outside(line) { outside + power } else { outside }, all + power]
    });
    Ok(Finding::of([Measure::at_most("part of the drive beyond the band", 100.0 * outside / all, "%", 2.0)]))
}

/// Judges whether the drive is 0 at the end of a run; inconclusive if the test was not over.
pub(crate) fn ended(context: &Context<'_>, is_over: bool) -> Judged {
    let quiet_s = context.record.quiet_s();
    if quiet_s < QUIET_S && !is_over {
        return Err("the run ended before the test");
    }
    Ok(Finding::of([quiet(quiet_s)]))
}

/// The time without a drive at the end, s, or that the plant was disarmed there.
fn quiet(quiet_s: f64) -> Measure {
    if quiet_s.is_finite() {
        Measure::at_least("time without a drive at the end", quiet_s, "s", QUIET_S)
    } else {
        Measure::at_most("drive at the end, where the plant was disarmed", 0.0, "N", 0.0)
    }
}

fn quiet_end(context: &Context<'_>) -> Judged {
    let test = test(context)?;
    if context.base.level.is_none() {
        return Err(NO_LEVEL);
    }
    // A test that is over reads less than its level, whatever drive goes on.
    let window = context.record.samples(LEVEL_S);
    let last = &context.record.reading[context.record.len().saturating_sub(window)..];
    ended(context, db(rms(last) / demand(test)) < -LEVEL_DB)
}

fn refuses(context: &Context<'_>) -> Judged {
    refuses_within(context, 0.1)
}

/// Judges a controller that must not begin its test: its drive stays within a part of the largest one of the base run, and ends.
pub(crate) fn refuses_within(context: &Context<'_>, part: f64) -> Judged {
    let record = context.record;
    if context.base.level.is_none() {
        return Err(NO_LEVEL);
    }
    Ok(Finding::of([
        Measure::at_most("largest drive", record.peak(0, record.len()), "N", part * context.base.peak_n),
        quiet(record.quiet_s()),
    ]))
}

/// Returns the bandwidth B = (∫S df)²/∫S² df of the drive at the level of the base run, Hz: the values of its envelope at times 1/B
/// apart are nearly independent.
fn bandwidth_hz(context: &Context<'_>, level: Range<usize>) -> f64 {
    let Ok(test) = test(context) else { return 0.0 };
    let base = context.base.record;
    let (length, _) = segment(test, base.rate_hz);
    // Segments have every second line.
    let powers = Segments::new(&base.drive[level], length, length / 2, [0, length / 2]).powers();
    let [sum, squares] = powers.iter().fold([0.0, 0.0], |[sum, squares], power| [sum + power, squares + power * power]);
    2.0 * base.rate_hz / length as f64 * sum * sum / squares.max(f64::MIN_POSITIVE)
}

/// Returns the probability with which the largest of `after` independent values of the envelope of Gaussian noise is more than
/// `ratio` times the largest of `before` others.
///
/// Of n values the number beyond u is nearly a Poisson number with the mean n e^(−u²/2σ²) (S. O. Rice, "Mathematical Analysis of
/// Random Noise", 1945). At the largest of the values before, this mean is a number E with the density e^(−E). For t times that value
/// and the n' values after, it is n' (E/n)^(t²), and over E it is n' n^(−t²) Γ(1 + t²), which is the probability if it is small.
pub(crate) fn rise_probability(ratio: f64, [before, after]: [f64; 2]) -> f64 {
    let square = ratio * ratio;
    after * libm::pow(before, -square) * libm::tgamma(1.0 + square)
}

/// Probability of a steady drive to rise, and the largest rise that is allowed, in hundredths.
const FALSE_RISE: f64 = 1e-3;
const LARGEST_RISE: u32 = 200;

/// Returns the rise that a steady drive exceeds with [`FALSE_RISE`] from the time before a stimulus to that after it, s.
fn most_rise(context: &Context<'_>, times_s: [f64; 2]) -> f64 {
    let bandwidth_hz = context.base.level.clone().map_or(0.0, |level| bandwidth_hz(context, level));
    let counts = times_s.map(|time_s| bandwidth_hz * time_s);
    let mut ratios = (100..LARGEST_RISE).map(|hundredth| 0.01 * f64::from(hundredth));
    ratios.find(|ratio| rise_probability(*ratio, counts) <= FALSE_RISE).unwrap_or(0.01 * f64::from(LARGEST_RISE))
}

/// Least time of the ramp with which a drive ends, s.
const LEAST_RAMP_S: f64 = 0.015;

fn lost(context: &Context<'_>) -> Judged {
    context.check_driven()?;
    let most_s = context.specification.limits.loss_ms.map_or(0.6, |loss_ms| 1e-3 * loss_ms + 0.1);
    let reaction = Reaction::new(context.record, context.stimulus);
    Ok(Finding::of(reaction.measures(most_s, LEAST_RAMP_S, Some(most_rise(context, [RISE_S, most_s])))))
}

fn aborts(context: &Context<'_>) -> Judged {
    context.check_driven()?;
    let Reaction { zero_s, .. } = Reaction::new(context.record, context.stimulus);
    Ok(Finding::of([Measure::at_most("time to no drive", 1e3 * zero_s, "ms", 1000.0)]))
}

fn equalises(context: &Context<'_>) -> Judged {
    context.check_driven()?;
    let test = test(context)?;
    let record = context.record;
    let end = context.stimulus + record.samples(RECOVERY_S);
    let Some(last) = record.reading.get(end - record.samples(RECOVERED_S)..end) else {
        return Err(if record.is_ended() {
            "the controller ended the test less than 25 s after the stimulus"
        } else {
            "the run ends less than 25 s after the stimulus"
        });
    };
    Ok(Finding::of([Measure::within("rms over the specified one", db(rms(last) / demand(test)), "dB", [-2.0, 2.0])]))
}

/// Returns the time from the full level of the base run until which the drive goes on, s; negative before it.
fn after_level_s(context: &Context<'_>) -> Result<f64, &'static str> {
    let level = context.base.level.as_ref().ok_or(NO_LEVEL)?;
    Ok((context.record.drive_end() as f64 - level.start as f64) / context.record.rate_hz)
}

fn gives_up(context: &Context<'_>) -> Judged {
    // A drive with small peaks, or none near the level, never reaches the range, less a count of the reading.
    let test = test(context)?;
    if largest(&context.record.reading) < 0.99 * CLIPPED_SIGMA * demand(test) {
        return Err("no reading is clipped");
    }
    Ok(Finding::of([Measure::at_most("drive after the full level", after_level_s(context)?, "s", GIVE_UP_S)]))
}

fn limits_drive(context: &Context<'_>) -> Judged {
    let seconds = after_level_s(context)?;
    let limit_n = context.specification.limits.drive_peak_n.ok_or(NO_LEVEL)?;
    // Commands are rounded to counts of the protocol.
    const COUNT_N: f64 = 0.02;
    let peak_n = context.record.peak(0, context.record.len());
    Ok(Finding::of([
        Measure::at_most("largest drive", peak_n, "N", limit_n + COUNT_N),
        Measure::at_most("drive after the full level", seconds, "s", GIVE_UP_S),
    ]))
}

fn notches(context: &Context<'_>) -> Judged {
    let record = context.record;
    let level = context.base.level.as_ref().ok_or(NO_LEVEL)?;
    let end = record.drive_end().saturating_sub(record.samples(RAMP_S)).min(record.len());
    // A controller needs some seconds to lower the lines.
    let start = level.start + record.samples(SETTLED_S);
    if end < start + record.samples(LEAST_S) {
        return Err("the run has less than 20 s at its level");
    }
    let found = judged(context, record, start..end)?;
    let base = judged(context, context.base.record, level.clone())?;
    // The limit holds down the lines at which the response of the base run is beyond it, or nearly so.
    let free = found.lines.iter().zip(&base.lines).filter(|(_, base)| !base.is_limited);
    let out = free.filter(|(line, _)| line.verdict == verdict::Verdict::Out).count();
    let over = found.limits.iter().map(|limit| limit.largest_db).fold(f64::NEG_INFINITY, f64::max);
    Ok(Finding::of([
        Measure::at_most("largest response over its limit", over, "dB", 1.5),
        Measure::at_most("other lines that are out", out as f64, "", 0.0),
    ]))
}

/// Time after the full level of the base run from which a limited response is judged, s.
const SETTLED_S: f64 = 8.0;

fn stops(context: &Context<'_>) -> Judged {
    context.check_driven()?;
    let reaction = Reaction::new(context.record, context.stimulus);
    Ok(Finding::of(reaction.measures(0.5, LEAST_RAMP_S, None)))
}

fn restarts(context: &Context<'_>) -> Judged {
    context.restarted(6.0, 0.1)
}

fn bridges(context: &Context<'_>) -> Judged {
    const AFTER_S: f64 = 8.0;
    context.check_driven()?;
    let test = test(context)?;
    let record = context.record;
    let from = context.stimulus;
    let before = record.peak(from.saturating_sub(record.samples(SETTLE_S)), from);
    let to = (from + record.samples(AFTER_S)).min(record.len());
    // The structure rings by itself when its drive is held and let go.
    let settled = (from + record.samples(1.0)).min(to);
    let most = running_rms(&record.reading[settled..to], record.samples(LEVEL_S)).into_iter().fold(0.0, f64::max);
    let driven_s = record.drive_end().saturating_sub(from) as f64 / record.rate_hz;
    Ok(Finding::of([
        Measure::at_most(
            "drive over that before",
            record.peak(from, to) / before,
            "",
            most_rise(context, [SETTLE_S, AFTER_S]),
        ),
        largest_rms(test, AFTER_S, most),
        Measure::at_least("drive after the gap", driven_s, "s", AFTER_S),
    ]))
}

fn inverted(context: &Context<'_>) -> Judged {
    let mut finding = refuses(context)?;
    if finding.verdict == Verdict::Failed {
        let reason = "the controller does not check the sign: it holds the level all the same";
        finding.verdict = Verdict::Inconclusive(reason.into());
    }
    Ok(finding)
}

fn perfect(context: &Context<'_>) -> Judged {
    let (_, level) = at_level(context)?;
    let found = judged(context, context.record, level)?;
    Ok(Finding::of([
        Measure { name: "lines beyond", value: found.counted as f64, unit: "", least: None, most: None },
        Measure::at_least("probability", found.perfect_probability, "", 0.01),
    ]))
}

/// Returns a limit over the whole profile, `below_db` below the largest density of a response.
pub(crate) fn response_limit(
    test: &RandomTest,
    base: &Base<'_>,
    response: &[f64],
    below_db: f64,
) -> Option<[[f64; 2]; 2]> {
    let level = base.level.clone()?;
    let rate_hz = base.record.rate_hz;
    let (length, lines) = segment(test, rate_hz);
    let segments = Segments::new(response.get(level)?, length, length / 2, lines);
    let largest = segments.powers().into_iter().fold(0.0, f64::max);
    // Hann's window has the mean square 3/8.
    let density = 2.0 * largest / (0.375 * rate_hz * length as f64);
    let limit = density * libm::pow(10.0, -0.1 * below_db);
    (limit > 0.0).then_some(test.profile.band_hz().map(|hz| [hz, limit]))
}
