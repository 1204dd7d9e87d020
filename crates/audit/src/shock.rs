//! Cases of classical shocks.

use resonarm_specification::verdict::{ShockVerdict, Shot};
use resonarm_specification::{ShockTest, Test};

use crate::case::{Case, Context, Finding, Judged, Measure, Stimulus};

pub(crate) const CASES: &[Case] = &[
    Case {
        id: "K01",
        title: "shoots the pulse",
        rule: "every shot at full level within the specified band about the pulse, and as many as specified",
        stimulus: Stimulus::None,
        judge: pulse,
    },
    Case {
        id: "K02",
        title: "changes the velocity",
        rule: "velocity change within the specified tolerance, or 15 %",
        stimulus: Stimulus::None,
        judge: velocity_change,
    },
    Case {
        id: "K03",
        title: "is quiet beside the pulse",
        rule: "beside the pulse at most the specified part of the peak, or 45 %",
        stimulus: Stimulus::None,
        judge: outside,
    },
    Case {
        id: "K04",
        title: "brings the structure to rest",
        rule: "velocity at the end at most the specified part of the velocity change, or 10 %",
        stimulus: Stimulus::None,
        judge: end_velocity,
    },
    Case {
        id: "K05",
        title: "begins below the full level",
        rule: "the first shot at most 0.55 of the peak",
        stimulus: Stimulus::None,
        judge: first_shot,
    },
];

/// Why a record without a shot decides nothing.
const NO_SHOT: &str = "the run has no shot at full level";

/// Returns the test and what was found of it in the base run.
fn found<'a>(context: &Context<'a>) -> Result<(&'a ShockTest, &'a ShockVerdict), &'static str> {
    match (&context.specification.test, &context.base.shock) {
        (Test::Shock(test), Some(found)) => Ok((test, found)),
        _ => Err(NO_SHOT),
    }
}

/// Returns the largest of a figure over the shots at full level; none if there is no such shot, or one without the figure.
fn largest(found: &ShockVerdict, figure: impl Fn(&Shot) -> Option<f64>) -> Option<f64> {
    // Without a shot the largest figure would be 0, and every limit kept.
    let mut full = found.shots.iter().filter(|shot| shot.is_full).peekable();
    full.peek()?;
    full.try_fold(0.0_f64, |largest, shot| Some(largest.max(figure(shot)?.abs())))
}

/// Judges the largest of a figure over the shots at full level, in %, by the specified limit.
fn worst(
    context: &Context<'_>,
    name: &'static str,
    figure: impl Fn(&Shot) -> Option<f64>,
    most: impl Fn(&ShockTest) -> f64,
) -> Judged {
    let (test, found) = found(context)?;
    let value = largest(found, figure).ok_or(NO_SHOT)?;
    Ok(Finding::of([Measure::at_most(name, 100.0 * value, "%", 100.0 * most(test))]))
}

fn pulse(context: &Context<'_>) -> Judged {
    let Test::Shock(test) = &context.specification.test else { return Err(NO_SHOT) };
    let found = context.base.shock.as_ref();
    let error = found.and_then(|found| largest(found, |shot| Some(shot.error)));
    // Shots in the other direction are none, but they are not nothing either.
    if error.is_none() && crate::record::largest(&context.record.reading) < 0.5 * test.peak_m_s2 {
        return Err(NO_SHOT);
    }
    let (full, asked) = found.map_or((0, 1), |found| (found.full, found.asked));
    let mut measured = alloc::vec![Measure::at_least("shots at full level", full as f64, "", f64::from(asked))];
    measured.extend(error.map(|error| Measure::at_most("error over the peak", 100.0 * error, "%", 100.0 * test.band)));
    Ok(Finding::of(measured))
}

fn velocity_change(context: &Context<'_>) -> Judged {
    let most = |test: &ShockTest| test.velocity_tolerance.unwrap_or(0.15);
    worst(context, "error of the velocity change", |shot| Some(shot.velocity_change), most)
}

fn outside(context: &Context<'_>) -> Judged {
    worst(context, "beside the pulse over the peak", |shot| shot.outside, |test| test.outside.unwrap_or(0.45))
}

fn end_velocity(context: &Context<'_>) -> Judged {
    let most = |test: &ShockTest| test.end_velocity_tolerance.unwrap_or(0.1);
    worst(context, "velocity at the end over the change", |shot| shot.end_velocity, most)
}

fn first_shot(context: &Context<'_>) -> Judged {
    let (_, found) = found(context)?;
    let first = found.shots.first().ok_or(NO_SHOT)?;
    Ok(Finding::of([Measure::at_most("first shot over the full level", first.amplitude, "", 0.55)]))
}
