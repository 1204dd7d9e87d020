//! Every case on records of known kind: one that passes, and one with the flaw that fails it.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../../examples/confusion/bench.rs"]
mod bench;
#[path = "../../examples/confusion/plant.rs"]
mod plant;
#[path = "../../examples/confusion/random_loop.rs"]
mod random_loop;
mod random_loops;
mod randoms;
#[path = "../../examples/confusion/shock_loop.rs"]
mod shock_loop;
mod shocks;
#[path = "../../examples/confusion/sine_loop.rs"]
mod sine_loop;
mod sine_loops;
mod sines;

use resonarm_numeric::noise::Noise;
use resonarm_specification::Specification;

use plant::RATE;

use crate::{Base, Case, Context, Finding, RESTART_S, Record, Stimulus, Verdict, cases};

fn specification(text: &str) -> Specification {
    bench::specification(text).unwrap()
}

fn case(specification: &Specification, id: &str) -> &'static Case {
    cases(&specification.test).iter().find(|case| case.id == id).unwrap_or_else(|| panic!("there is no case {id}"))
}

/// Judges the run of a case beside the base run.
fn judged(specification: &Specification, id: &str, base: &Record, record: &Record) -> Finding {
    let base = Base::new(specification, base);
    let case = case(specification, id);
    let stimulus = base.stimulus(&specification.test, case.stimulus).unwrap_or(0);
    case.judge(&Context { specification, base: &base, record, stimulus })
}

/// Numbers of the cases without a stimulus that fail on a base run.
fn failing(specification: &Specification, record: &Record) -> Vec<&'static str> {
    let own = cases(&specification.test).iter().filter(|case| case.stimulus == Stimulus::None);
    let fails = |case: &&Case| judged(specification, case.id, record, record).verdict == Verdict::Failed;
    own.filter(fails).map(|case| case.id).collect()
}

#[track_caller]
fn passes(specification: &Specification, id: &str, base: &Record, record: &Record) {
    let found = judged(specification, id, base, record);
    assert_eq!(found.verdict, Verdict::Passed, "{id}: {:?}", found.measured);
}

#[track_caller]
fn fails(specification: &Specification, id: &str, base: &Record, record: &Record) {
    let found = judged(specification, id, base, record);
    assert_eq!(found.verdict, Verdict::Failed, "{id}: {:?}", found.measured);
}

/// The record with its drive and its readings multiplied from a sample on: by the samples of a ramp, then by 0.
fn ended(record: &Record, at: usize, ramp: usize) -> Record {
    let factor = |sample: usize| match sample.checked_sub(at) {
        None => 1.0,
        Some(late) if late < ramp => 1.0 - late as f64 / ramp as f64,
        Some(_) => 0.0,
    };
    let scaled = |values: &[f64]| values.iter().enumerate().map(|(k, value)| value * factor(k)).collect();
    Record {
        drive: scaled(&record.drive),
        reading: scaled(&record.reading),
        responses: record.responses.iter().map(|response| scaled(response)).collect(),
        ..*record
    }
}

/// A record that stops softly at a sample, and goes on as another one from a sample of that on when it is told to start again.
fn restarted(record: &Record, at: usize, again: &Record, from: usize) -> Record {
    let start = at + (RESTART_S * RATE as f64) as usize;
    let mut stopped = ended(record, at, RATE / 10);
    let join = |values: &mut Vec<f64>, later: &[f64]| {
        values.truncate(start);
        values.extend_from_slice(&later[from..]);
    };
    join(&mut stopped.drive, &again.drive);
    join(&mut stopped.reading, &again.reading);
    for (response, later) in stopped.responses.iter_mut().zip(&again.responses) {
        join(response, later);
    }
    stopped
}

/// The record with drive and readings multiplied.
fn scaled(record: &Record, factor: f64) -> Record {
    let scaled = |values: &[f64]| values.iter().map(|value| factor * value).collect();
    Record {
        drive: scaled(&record.drive),
        reading: scaled(&record.reading),
        responses: record.responses.iter().map(|response| scaled(response)).collect(),
        ..*record
    }
}

/// Returns white Gaussian noise of the given rms.
fn noise(seed: u64, samples: usize, rms: f64) -> Vec<f64> {
    let mut noise = Noise::new(seed, 7);
    (0..samples).map(|_| rms * noise.normal()).collect()
}

/// What a mode with 1 % of damping makes of white noise, by its poles, at [`RATE`].
fn mode(seed: u64, hz: f64, samples: usize, rms: f64) -> Vec<f64> {
    let turn = core::f64::consts::TAU * hz / RATE as f64;
    let decay = libm::exp(-0.01 * turn);
    let (mut last, mut before) = (0.0, 0.0);
    // The recursion whose poles are e^(−ζωT ± iωT).
    let step = |push: f64| {
        let next = 2.0 * decay * libm::cos(turn) * last - decay * decay * before + push;
        (before, last) = (last, next);
        next
    };
    let mut values: Vec<f64> = noise(seed, samples, 1.0).into_iter().map(step).collect();
    let own = rms / crate::record::rms(&values);
    values.iter_mut().for_each(|value| *value *= own);
    values
}

#[test]
fn numbers_of_cases_are_unique_and_rules_are_stated() {
    let all = [random_loop::SPECIFICATION, sines::SPECIFICATION, shock_loop::SPECIFICATION].map(specification);
    let mut ids: Vec<&str> = Vec::new();
    for specification in &all {
        for case in cases(&specification.test) {
            assert!(!case.rule.is_empty() && !case.title.is_empty());
            ids.push(case.id);
        }
    }
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), count);
}
