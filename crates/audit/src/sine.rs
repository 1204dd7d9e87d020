//! Cases of swept sines.

use alloc::vec::Vec;
use core::ops::Range;

use resonarm_specification::verdict::SineVerdict;
use resonarm_specification::{SineTest, SweepRate, Test};

use crate::case::{Base, Case, Context, Finding, Judged, Measure, NO_LEVEL, Stimulus};
use crate::random::{ended, refuses_within};
use crate::reaction::Reaction;
use crate::record::{largest, running_rms};

/// Time without samples, s.
const GAP_S: f64 = 0.15;
/// Change of the level that a controller is told to make, dB.
const LEVEL_DB: f64 = -3.0;

pub(crate) const CASES: &[Case] = &[
    Case {
        id: "S01",
        title: "holds the amplitude",
        rule: "as many whole sweeps as specified; the fundamental within the specified tolerance for 90 % of the time, and never beyond 2.5 times it",
        stimulus: Stimulus::None,
        judge: amplitude,
    },
    Case {
        id: "S02",
        title: "sweeps at the specified rate",
        rule: "rate within 10 %; at most 0.05 octaves from the specified law",
        stimulus: Stimulus::None,
        judge: rate,
    },
    Case {
        id: "S03",
        title: "sweeps without steps",
        rule: "the frequency stands still in at most 15 % of the intervals of 0.1 s",
        stimulus: Stimulus::None,
        judge: continuity,
    },
    Case {
        id: "S04",
        title: "keeps its phase",
        rule: "between two cubics that fit the phase of the drive before and behind any instant of the sweep at most 0.3 rad",
        stimulus: Stimulus::None,
        judge: phase,
    },
    Case {
        id: "S05",
        title: "ends its drive with the test",
        rule: "the drive is 0 at the end of the run",
        stimulus: Stimulus::None,
        judge: quiet_end,
    },
    Case {
        id: "S06",
        title: "starts without overshoot",
        rule: "from the start of the sine to the sweep the channel reads at most 1.3 times the first amplitude; before, as during an identification, at most the largest one",
        stimulus: Stimulus::None,
        judge: start,
    },
    Case {
        id: "S07",
        title: "holds the fundamental of a distorted response",
        rule: "the median of the fundamental moves by at most 3 % when the channel reads a second harmonic of 40 %",
        stimulus: Stimulus::Harmonic(0.4),
        judge: tracks,
    },
    Case {
        id: "S08",
        title: "stops when the channel reads nothing",
        rule: "no drive after 500 ms; a ramp of at least 10 ms or 0.3 periods; no more than 3 times the drive before",
        stimulus: Stimulus::Dead,
        judge: lost,
    },
    Case {
        id: "S09",
        title: "stops when the channel reads noise",
        rule: "no drive after 500 ms; a ramp of at least 10 ms or 0.3 periods; no more than 3 times the drive before",
        stimulus: Stimulus::Open,
        judge: lost,
    },
    Case {
        id: "S10",
        title: "stops softly when told to",
        rule: "no drive after 300 ms; a ramp of at least 10 ms or 0.3 periods",
        stimulus: Stimulus::Stop,
        judge: stops,
    },
    Case {
        id: "S11",
        title: "aborts at three times the level",
        rule: "no drive after 500 ms; a ramp of at least 10 ms or 0.3 periods",
        stimulus: Stimulus::Gain(3.0),
        judge: aborts,
    },
    Case {
        id: "S12",
        title: "refuses a dead channel",
        rule: "at most half of the largest drive of the base run, then none",
        stimulus: Stimulus::DeadFromStart,
        judge: dead,
    },
    Case {
        id: "S13",
        title: "begins low after an abort",
        rule: "in the first 2.2 s at most a quarter of the largest drive of the base run",
        stimulus: Stimulus::Restart,
        judge: restarts,
    },
    Case {
        id: "S14",
        title: "keeps its phase when the level changes",
        rule: "told to lower the level by 3 dB, the fundamental is 2 to 4 dB lower 2 s later than in the base run there; the phase of the drive as of S04",
        stimulus: Stimulus::Level(LEVEL_DB),
        judge: changes_level,
    },
    Case {
        id: "S15",
        title: "goes on after a gap of 150 ms",
        rule: "after the gap the channel reads at most 1.6 times the amplitude, or 1.6 times what it reads in the gap, or the drive is at most 1.6 times that of the base run there; still driving 3 s later",
        stimulus: Stimulus::Gap(GAP_S),
        judge: bridges,
    },
    Case {
        id: "S16",
        title: "keeps the limit of a response",
        rule: "the response at most 15 % beyond its limit",
        stimulus: Stimulus::ResponseLimit(6.0),
        judge: notches,
    },
    Case {
        id: "S17",
        title: "passes through light resonances",
        rule: "the fundamental at most 50 % above the specified amplitude in a whole sweep",
        stimulus: Stimulus::LightModes(0.01),
        judge: light_modes,
    },
];

/// Returns the test and what was found of it in the base run.
fn found<'a>(context: &'a Context<'_>) -> Result<(&'a SineTest, &'a SineVerdict), &'static str> {
    match (&context.specification.test, &context.base.sine) {
        (Test::Sine(test), Some(found)) => Ok((test, found)),
        _ => Err(NO_LEVEL),
    }
}

/// Judges a base run that has no sweep. One whose amplitude came to half of the first one has begun its test, and not run it.
fn no_sweep(context: &Context<'_>) -> Judged {
    let Test::Sine(test) = &context.specification.test else { return Err(NO_LEVEL) };
    let [from_hz, _] = test.band_hz();
    let demand = test.acceleration_m_s2(from_hz).ok_or(NO_LEVEL)?;
    let rms =
        running_rms(&context.record.reading, context.record.samples(2.0 / from_hz)).into_iter().fold(0.0, f64::max);
    if core::f64::consts::SQRT_2 * rms < 0.5 * demand {
        return Err(NO_LEVEL);
    }
    Ok(Finding::of([Measure::at_least("whole sweeps", 0.0, "", f64::from(test.sweeps))]))
}

fn amplitude(context: &Context<'_>) -> Judged {
    let Ok((test, found)) = found(context) else { return no_sweep(context) };
    // Instants are as far apart as the filter is long, which is inversely proportional to the frequency.
    let [within, all] = found.points.iter().fold([0.0, 0.0], |[within, all], point| {
        let error = point.tracked_m_s2 / point.demand_m_s2 - 1.0;
        let time = 1.0 / point.frequency_hz;
        let is_within = error.abs() <= test.tolerance || (point.is_limited && error < 0.0);
        [if is_within { within + time } else { within }, all + time]
    });
    let [low, high] = found.extremes.map(|ratio| 100.0 * (ratio - 1.0));
    let worst = 250.0 * test.tolerance;
    Ok(Finding::of([
        Measure::at_least("whole sweeps", found.whole as f64, "", f64::from(test.sweeps)),
        Measure::at_least("time within the tolerance", 100.0 * within / all, "%", 90.0),
        Measure::at_least("lowest amplitude", low, "%", -worst),
        Measure::at_most("highest amplitude", high, "%", worst),
    ]))
}

fn rate(context: &Context<'_>) -> Judged {
    let (test, found) = found(context)?;
    let pass = found.passes.first().ok_or(NO_LEVEL)?;
    let (SweepRate::OctavesPerMinute(nominal) | SweepRate::HertzPerSecond(nominal)) = test.rate;
    Ok(Finding::of([
        Measure::within("rate over the specified one", pass.rate / nominal, "", [0.9, 1.1]),
        Measure::at_most("departure from the law", pass.departure_octaves, "octaves", 0.05),
    ]))
}

fn continuity(context: &Context<'_>) -> Judged {
    let (_, found) = found(context)?;
    let still = found.passes.first().and_then(|pass| pass.still).ok_or(NO_LEVEL)?;
    Ok(Finding::of([Measure::at_most("intervals in which it stands still", 100.0 * still, "%", 15.0)]))
}

fn phase(context: &Context<'_>) -> Judged {
    let (_, found) = found(context)?;
    let jump = found.passes.first().and_then(|pass| pass.phase_jump_rad).ok_or(NO_LEVEL)?;
    Ok(Finding::of([Measure::at_most("largest jump of the phase", jump, "rad", 0.3)]))
}

fn quiet_end(context: &Context<'_>) -> Judged {
    const AFTER_S: f64 = 3.0;
    let (_, found) = found(context)?;
    let last = found.passes.last().ok_or(NO_LEVEL)?;
    let end = context.record.samples(last.to_s + AFTER_S);
    ended(context, context.record.len() > end)
}

fn start(context: &Context<'_>) -> Judged {
    let (test, found) = found(context)?;
    let [from_hz, _] = test.band_hz();
    let demand = test.acceleration_m_s2(from_hz).ok_or(NO_LEVEL)?;
    // From there on the level is another one.
    let begin = context.record.samples(found.begins_s).min(context.record.len());
    let reading = &context.record.reading[..begin];
    // The sine starts where the channel last read little, over two periods.
    let window = context.record.samples(2.0 / from_hz);
    let weak = STARTED * core::f64::consts::FRAC_1_SQRT_2 * demand;
    let start = running_rms(reading, window).iter().rposition(|rms| *rms < weak).map_or(0, |last| last + window);
    let (before, sine) = reading.split_at(start.min(begin));
    let highest = found.points.iter().map(|point| point.demand_m_s2).fold(demand, f64::max);
    Ok(Finding::of([
        Measure::at_most("reading over the first amplitude", largest(sine) / demand, "", 1.3),
        Measure::at_most("reading before the sine over the largest amplitude", largest(before) / highest, "", 1.0),
    ]))
}

/// Part of the first amplitude beyond which a sine has started.
const STARTED: f64 = 0.3;

/// Returns the specified amplitude and the frequency of the base run at a sample, or the next one that was judged.
fn at(context: &Context<'_>, sample: usize) -> Result<[f64; 2], &'static str> {
    let (_, found) = found(context)?;
    let t_s = sample as f64 / context.record.rate_hz;
    let point = found.points.iter().find(|point| point.t_s >= t_s).or(found.points.last()).ok_or(NO_LEVEL)?;
    Ok([point.demand_m_s2, point.frequency_hz])
}

/// Judges the end of the drive after a stimulus: the largest time, s, and how much more drive there may be meanwhile.
fn reacts(context: &Context<'_>, most_s: f64, most_rise: Option<f64>) -> Judged {
    context.check_driven()?;
    let [_, hz] = at(context, context.stimulus)?;
    let reaction = Reaction::new(context.record, context.stimulus);
    // A sine is below its rms for up to a quarter of a period, so that a hard stop may look like a short ramp.
    Ok(Finding::of(reaction.measures(most_s, f64::max(0.01, 0.3 / hz), most_rise)))
}

fn lost(context: &Context<'_>) -> Judged {
    reacts(context, 0.5, Some(3.0))
}

fn stops(context: &Context<'_>) -> Judged {
    reacts(context, 0.3, None)
}

fn aborts(context: &Context<'_>) -> Judged {
    reacts(context, 0.5, None)
}

/// A sine controller may look for its response with more drive than a random one: half of the largest drive.
fn dead(context: &Context<'_>) -> Judged {
    refuses_within(context, 0.5)
}

fn restarts(context: &Context<'_>) -> Judged {
    context.restarted(2.2, 0.25)
}

/// Returns the median of the tracked fundamental over the specified amplitude, over the judged instants in a range of time, s.
fn median_level(found: &SineVerdict, range_s: Range<f64>) -> Option<f64> {
    let points = found.points.iter().filter(|point| range_s.contains(&point.t_s));
    let mut ratios: Vec<f64> = points.map(|point| point.tracked_m_s2 / point.demand_m_s2).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

fn changes_level(context: &Context<'_>) -> Judged {
    // Time after the word in which the level may change, and over which it is then measured, s.
    const CHANGE_S: f64 = 2.0;
    const MEASURED_S: f64 = 3.0;
    const TOLERANCE_DB: f64 = 1.0;
    context.check_driven()?;
    let own = Base::new(context.specification, context.record);
    let found = own.sine.as_ref().ok_or("the run has no sweep")?;
    let after_s = context.stimulus as f64 / context.record.rate_hz + CHANGE_S;
    // At a mode a loop has an error of its own, which the base run has at the same frequency.
    let level = |found: &SineVerdict| median_level(found, after_s..after_s + MEASURED_S);
    let levels = [context.base.sine.as_ref().and_then(level), level(found)];
    let jump = found.passes.first().and_then(|pass| pass.phase_jump_rad);
    let ([Some(before), Some(after)], Some(jump)) = (levels, jump) else {
        return Err("the run ends before its level can be measured");
    };
    let change_db = 20.0 * libm::log10(after / before);
    Ok(Finding::of([
        Measure::within("change of the level", change_db, "dB", [LEVEL_DB - TOLERANCE_DB, LEVEL_DB + TOLERANCE_DB]),
        Measure::at_most("largest jump of the phase", jump, "rad", 0.3),
    ]))
}

fn tracks(context: &Context<'_>) -> Judged {
    let own = Base::new(context.specification, context.record);
    let base = context.base.sine.as_ref().ok_or(NO_LEVEL)?;
    let found = own.sine.as_ref().filter(|found| found.whole > 0).ok_or("the run has no whole sweep")?;
    let level = |found: &SineVerdict| median_level(found, 0.0..f64::INFINITY).ok_or("the sweep has no judged instant");
    let moved = 100.0 * (level(found)? / level(base)? - 1.0);
    Ok(Finding::of([Measure::within("change of the median fundamental", moved, "%", [-3.0, 3.0])]))
}

fn bridges(context: &Context<'_>) -> Judged {
    const AFTER_S: f64 = 3.0;
    const MOST_AFTER_GAP: f64 = 1.6;
    context.check_driven()?;
    let (test, _) = found(context)?;
    let record = context.record;
    let from = context.stimulus;
    let to = (from + record.samples(AFTER_S)).min(record.len());
    let [first, _] = at(context, from)?;
    let [last, _] = at(context, to)?;
    let back = (from + record.samples(GAP_S)).min(to);
    let peak = |range| record.reading.get(range).map_or(0.0, largest) / first.max(last);
    let driven_s = record.drive_end().saturating_sub(from) as f64 / record.rate_hz;
    // A structure that is driven hard at an antiresonance vibrates more by itself when the drive ends.
    let own = peak(from..back).max(1.0);
    // A light mode that vibrated by itself in the gap beats with the drive behind it, without more of that.
    let window = record.samples(2.0 / test.band_hz()[0]);
    let [driven, usual] = [record, context.base.record].map(|record| {
        let after = record.drive.get(back..to).unwrap_or_default();
        running_rms(after, window).into_iter().fold(0.0, f64::max)
    });
    let rise = driven / usual.max(f64::MIN_POSITIVE);
    let reading = Measure::at_most("reading over the amplitude", peak(back..to), "", MOST_AFTER_GAP * own);
    Ok(Finding::of([
        if rise > MOST_AFTER_GAP { reading } else { Measure { most: None, ..reading } },
        Measure { name: "drive over that of the base run", value: rise, unit: "", least: None, most: None },
        Measure::at_least("drive after the gap", driven_s, "s", AFTER_S),
    ]))
}

fn notches(context: &Context<'_>) -> Judged {
    let own = Base::new(context.specification, context.record);
    let found = own.sine.as_ref().ok_or("the run has no sweep")?;
    let over = found.limits.iter().map(|limit| libm::pow(10.0, limit.largest_db / 20.0)).fold(0.0, f64::max);
    Ok(Finding::of([Measure::at_most("largest response over its limit", over, "", 1.15)]))
}

fn light_modes(context: &Context<'_>) -> Judged {
    if context.base.level.is_none() {
        return Err(NO_LEVEL);
    }
    let own = Base::new(context.specification, context.record);
    let found = own.sine.as_ref().filter(|found| found.whole > 0).ok_or("the run has no whole sweep")?;
    Ok(Finding::of([Measure::at_most("highest amplitude", 100.0 * (found.extremes[1] - 1.0), "%", 50.0)]))
}

/// Returns a limit over the whole sweep, `below_db` below the largest amplitude of a response.
pub(crate) fn response_limit(
    test: &SineTest,
    base: &Base<'_>,
    response: &[f64],
    below_db: f64,
) -> Option<[[f64; 2]; 2]> {
    let level = base.level.clone()?;
    let [from_hz, _] = test.band_hz();
    // Over two periods of the lowest frequency, √2 times the rms is the amplitude.
    let window = base.record.samples(2.0 / from_hz);
    let largest = running_rms(response.get(level)?, window).into_iter().fold(0.0, f64::max);
    let limit = largest * core::f64::consts::SQRT_2 * libm::pow(10.0, -below_db / 20.0);
    (limit > 0.0).then_some(test.band_hz().map(|hz| [hz, limit]))
}
