//! Cases of swept sines, on a structure whose acceleration is the force over 1 kg.

use resonarm_specification::{SineTest, Test};

use super::{RATE, ended, failing, fails, judged, mode, noise, passes, restarted, scaled, specification};
use crate::{Base, Record, Stimulus, Verdict};

pub(super) const SPECIFICATION: &str = "[spec]
kind = 'sine'
sources = []
[sine]
from_hz = 15
rate_oct_min = 4
segments = [{ to_hz = 60, acceleration_m_s2 = 3 }]
tolerance = 0.1
rate_tolerance = 0.1
";

/// Silence, the rise to the amplitude and the time there before the sweep, samples; and the silence at the end.
const STARTS: [usize; 3] = [RATE, 2 * RATE, RATE];
const QUIET: usize = 5 * RATE;

fn test() -> SineTest {
    match specification(SPECIFICATION).test {
        Test::Sine(test) => test,
        other => panic!("{other:?}"),
    }
}

/// A sweep whose phase, rad, and amplitude, m/s², are functions of the time from its start, s, which lasts some seconds.
fn run(phase: impl Fn(f64) -> f64, amplitude: impl Fn(f64) -> f64, sweep_s: f64) -> Record {
    let [quiet, rise, stay] = STARTS;
    let start = quiet + rise + stay;
    let end = start + (sweep_s * RATE as f64) as usize;
    let sample = |k: usize| {
        let t_s = (k as f64 - start as f64) / RATE as f64;
        // Before the sweep the frequency is the first one.
        let turn = if t_s < 0.0 { core::f64::consts::TAU * 15.0 * t_s } else { phase(t_s) };
        let level = (k as f64 - quiet as f64) / rise as f64;
        amplitude(t_s) * level.clamp(0.0, 1.0) * libm::cos(turn)
    };
    let drive: Vec<f64> = (0..end + QUIET).map(|k| if k < end { sample(k) } else { 0.0 }).collect();
    let reading: Vec<f64> = drive.iter().enumerate().map(|(k, drive)| drive + 0.01 * ((k % 7) as f64 - 3.0)).collect();
    let responses = vec![reading.iter().map(|reading| 0.5 * reading).collect()];
    let record = Record { rate_hz: RATE as f64, drive, reading, responses, is_disarmed: false };
    ended(&record, end - RATE / 10, RATE / 10)
}

fn honest() -> Record {
    let test = test();
    run(|t_s| test.phase_rad(t_s), |_| 3.0, test.sweep_s(15.0, 60.0))
}

#[test]
fn an_honest_controller_passes() {
    let specification = specification(SPECIFICATION);
    let record = honest();
    for id in ["S01", "S02", "S03", "S04", "S05", "S06"] {
        passes(&specification, id, &record, &record);
    }
    // The middle of the sweep is at 30 Hz, 15 s from its start at 4 s.
    let at = Base::new(&specification, &record).stimulus(&specification.test, Stimulus::Dead).unwrap();
    assert!(at.abs_diff(19 * RATE) < RATE, "{at}");
}

#[test]
fn a_flaw_of_the_sweep_fails_the_case_for_it() {
    let specification = specification(SPECIFICATION);
    let test = test();
    let sweep_s = test.sweep_s(15.0, 60.0);
    let phase = |t_s: f64| test.phase_rad(t_s);
    // 12 % too fast, where 10 % are allowed.
    let faster = test.sweep_s(15.0, 60.0) / 1.12;
    // Steps of 1 s: whole seconds at a constant frequency, with a continuous phase.
    let hz = |t_s: f64| test.frequency_hz(t_s.floor());
    let stepped = |t_s: f64| {
        let before: f64 = (0..t_s.floor() as usize).map(|second| hz(second as f64)).sum();
        core::f64::consts::TAU * (before + hz(t_s) * (t_s - t_s.floor()))
    };
    // A sweep by hertz a second in the time of the logarithmic one: its mean rate is right, its law is not.
    let linear = |t_s: f64| core::f64::consts::TAU * (15.0 + 0.5 * 45.0 / sweep_s * t_s) * t_s;
    for (expected, record) in [
        (&["S01", "S06"][..], run(phase, |_| 3.0 * core::f64::consts::SQRT_2, sweep_s)),
        (&["S02"], run(|t_s| phase(1.12 * t_s), |_| 3.0, faster)),
        (&["S02"], run(linear, |_| 3.0, sweep_s)),
        (&["S03"], run(stepped, |_| 3.0, sweep_s)),
        // The phase of the present frequency times the time: f(t)t in place of the integral of f.
        (&["S02"], run(|t_s| core::f64::consts::TAU * test.frequency_hz(t_s) * t_s, |_| 3.0, sweep_s)),
        // A jump of 1.9 rad in the middle.
        (&["S04"], run(|t_s| phase(t_s) + if t_s > 15.0 { 1.9 } else { 0.0 }, |_| 3.0, sweep_s)),
        (&["S06"], run(phase, |t_s| if t_s < -0.5 { 4.5 } else { 3.0 }, sweep_s)),
        (&["S01"], run(phase, |t_s| if (14.0..16.0).contains(&t_s) { 4.0 } else { 3.0 }, sweep_s)),
    ] {
        let found = failing(&specification, &record);
        assert!(expected.iter().all(|id| found.contains(id)), "{expected:?}: {found:?}");
    }
    let mut on = honest();
    let end = on.drive.len() - QUIET;
    for (k, drive) in on.drive.iter_mut().enumerate().skip(end) {
        *drive = 0.5 * libm::sin(0.1 * k as f64);
    }
    let found = failing(&specification, &on);
    assert!(found.contains(&"S05"), "{found:?}");
}

#[test]
fn a_drive_that_must_end_is_timed() {
    let specification = specification(SPECIFICATION);
    let base = honest();
    let at = Base::new(&specification, &base).stimulus(&specification.test, Stimulus::Dead).unwrap();
    let soft = ended(&base, at + RATE / 8, RATE / 10);
    for id in ["S08", "S09", "S10", "S11"] {
        passes(&specification, id, &base, &soft);
        // At any phase of the sine.
        for late in 0..8 {
            fails(&specification, id, &base, &ended(&base, at + RATE / 8 + 4 * late, 0));
        }
        fails(&specification, id, &base, &ended(&base, at + RATE, RATE / 10));
        // The controller goes on driving.
        fails(&specification, id, &base, &base);
    }
    let mut louder = soft.clone();
    louder.drive[at..].iter_mut().for_each(|drive| *drive *= 4.0);
    fails(&specification, "S08", &base, &louder);
    let before = ended(&base, at - 4 * RATE, RATE / 10);
    assert!(matches!(judged(&specification, "S08", &base, &before).verdict, Verdict::Inconclusive(_)));
    // An antiresonance later in the sweep, at which the drive is ten times as large, says nothing about it.
    let antiresonant = |record: &Record| {
        let mut record = record.clone();
        record.drive[at + 5 * RATE..at + 6 * RATE].iter_mut().for_each(|drive| *drive *= 10.0);
        record
    };
    passes(&specification, "S08", &antiresonant(&base), &antiresonant(&soft));
}

#[test]
fn starts_gaps_and_limits_are_judged() {
    let specification = specification(SPECIFICATION);
    let base = honest();
    let at = Base::new(&specification, &base).stimulus(&specification.test, Stimulus::Dead).unwrap();
    let refused = scaled(&ended(&base, 3 * RATE, RATE / 10), 0.4);
    passes(&specification, "S12", &base, &refused);
    fails(&specification, "S12", &base, &base);
    // The record ends as the plant is disarmed.
    let end = refused.drive.iter().rposition(|drive| *drive != 0.0).unwrap() + 3;
    let cut = |is_disarmed| Record {
        drive: refused.drive[..end].to_vec(),
        reading: refused.reading[..end].to_vec(),
        is_disarmed,
        ..refused.clone()
    };
    passes(&specification, "S12", &base, &cut(true));
    fails(&specification, "S12", &base, &cut(false));
    // It is silent for 2 s, and rises for 2 s to the amplitude of the sweep, or begins at that.
    let quiet = |values: &[f64]| [&vec![0.0; RATE], values].concat();
    let (drive, reading) = (quiet(&base.drive), quiet(&base.reading));
    let again = Record { drive, reading, responses: vec![], ..base.clone() };
    passes(&specification, "S13", &base, &restarted(&base, at, &again, 0));
    fails(&specification, "S13", &base, &restarted(&base, at, &again, 5 * RATE));
    // It never stopped, or does not begin again.
    for record in [&base, &ended(&base, at, RATE / 10)] {
        assert!(matches!(judged(&specification, "S13", &base, record).verdict, Verdict::Inconclusive(_)));
    }
    passes(&specification, "S15", &base, &base);
    let louder = |record: &Record, factor: f64| {
        let mut louder = record.clone();
        for values in [&mut louder.drive, &mut louder.reading] {
            values[at + RATE / 5..at + RATE].iter_mut().for_each(|value| *value *= factor);
        }
        louder
    };
    let loud = louder(&base, 2.0);
    fails(&specification, "S15", &base, &loud);
    // A light mode vibrates more by itself when the drive comes back.
    passes(&specification, "S15", &base, &Record { drive: base.drive.clone(), ..loud.clone() });
    // At an antiresonance the structure itself vibrates more in the gap, which no controller can prevent.
    let mut freed = loud;
    freed.reading[at..at + 3 * RATE / 20].iter_mut().for_each(|reading| *reading *= 3.0);
    passes(&specification, "S15", &base, &freed);
    fails(&specification, "S15", &base, &louder(&freed, 3.0));
    fails(&specification, "S15", &base, &ended(&base, at + RATE, RATE / 10));
    let [[_, limit], _] =
        Base::new(&specification, &base).response_limit(&specification.test, &base.responses[0], 6.0).unwrap();
    // The response has half of the amplitude.
    assert!((limit / (1.5 * libm::pow(10.0, -0.3)) - 1.0).abs() < 0.05, "{limit}");
    let text =
        format!("{SPECIFICATION}[[limits.response]]\nchannel = 'b.x'\nbreakpoints = [[15, {limit}], [60, {limit}]]\n");
    let limited = super::specification(&text);
    fails(&limited, "S16", &base, &base);
    passes(&limited, "S16", &base, &scaled(&base, 0.5));
}

/// Told to lower its level by 3 dB in the middle of the sweep, a controller does so in 50 ms.
#[test]
fn a_change_of_level_keeps_the_phase() {
    let specification = specification(SPECIFICATION);
    let (test, base) = (test(), honest());
    let sweep_s = test.sweep_s(15.0, 60.0);
    let lowered = |jump: f64, db: f64| {
        let amplitude = move |t_s: f64| 3.0 * libm::pow(10.0, db / 20.0 * ((t_s - 15.0) / 0.05).clamp(0.0, 1.0));
        run(|t_s| test.phase_rad(t_s) + if t_s > 15.0 { jump } else { 0.0 }, amplitude, sweep_s)
    };
    passes(&specification, "S14", &base, &lowered(0.0, -3.0));
    // A sine that is made anew begins with another phase, and one that does not hear the word stays as it is.
    fails(&specification, "S14", &base, &lowered(1.0, -3.0));
    fails(&specification, "S14", &base, &lowered(0.0, 0.0));
    fails(&specification, "S14", &base, &lowered(0.0, -6.0));
    // One that ends is not judged.
    let stopped = ended(&base, base.len() / 2, RATE / 10);
    let found = judged(&specification, "S14", &base, &stopped);
    assert!(matches!(found.verdict, Verdict::Inconclusive(_)), "{found:?}");
}

/// What a controller plays before its test is not taken for the sweep.
#[test]
fn a_controller_may_identify_the_structure_before_its_sweep() {
    let specification = specification(SPECIFICATION);
    let sweep = honest();
    for seed in 1..=3 {
        // Noise, and what a mode of the structure makes of it.
        let before = [noise(seed, 15 * RATE, 0.3), mode(seed, 30.0, 15 * RATE, 0.3)].concat();
        let joined = |values: &[f64]| [&before[..], values].concat();
        let responses = sweep.responses.iter().map(|response| joined(response)).collect();
        let record = Record { drive: joined(&sweep.drive), reading: joined(&sweep.reading), responses, ..sweep };
        for id in ["S01", "S02", "S03", "S04", "S05", "S06"] {
            passes(&specification, id, &record, &record);
        }
        // The sweep begins 4 s into its record, and its middle is 15 s later.
        let base = Base::new(&specification, &record);
        assert!((base.begins_s.unwrap() - 34.0).abs() < 0.3, "{:?}", base.begins_s);
        let at = base.stimulus(&specification.test, Stimulus::Dead).unwrap();
        assert!(at.abs_diff(49 * RATE) < RATE, "{at}");
        // Too high until the sweep.
        let loud = Record { reading: joined(&scaled(&sweep, 1.5).reading), ..record.clone() };
        fails(&specification, "S06", &loud, &loud);
        // An identification beyond the level of the test.
        let mut beyond = record.clone();
        beyond.reading[10 * RATE] = 3.3;
        fails(&specification, "S06", &beyond, &beyond);
        // The sweep never comes.
        let quiet = vec![0.0; sweep.drive.len()];
        let none = Record { drive: joined(&quiet), reading: joined(&quiet), ..record };
        for case in crate::cases(&specification.test) {
            let verdict = judged(&specification, case.id, &none, &none).verdict;
            assert!(matches!(verdict, Verdict::Inconclusive(_)), "{}: {verdict:?}", case.id);
        }
    }
}

#[test]
fn light_resonances_are_judged_by_the_highest_amplitude() {
    let specification = specification(SPECIFICATION);
    let (test, base) = (test(), honest());
    let sweep_s = test.sweep_s(15.0, 60.0);
    // For 2 s about 30 Hz the loop is too slow.
    let resonant = |high: f64| {
        let amplitude = move |t_s: f64| if (14.0..16.0).contains(&t_s) { high } else { 3.0 };
        run(|t_s| test.phase_rad(t_s), amplitude, sweep_s)
    };
    passes(&specification, "S17", &base, &resonant(3.9));
    fails(&specification, "S17", &base, &resonant(5.4));
    // One that gives up decides nothing.
    let aborted = ended(&base, base.len() / 2, RATE / 10);
    assert!(matches!(judged(&specification, "S17", &base, &aborted).verdict, Verdict::Inconclusive(_)));
}

#[test]
fn a_record_without_a_sweep_decides_nothing() {
    let specification = specification(SPECIFICATION);
    let none = Record { drive: vec![0.0; 10 * RATE], reading: vec![0.0; 10 * RATE], ..honest() };
    for case in crate::cases(&specification.test) {
        let verdict = judged(&specification, case.id, &none, &none).verdict;
        assert!(matches!(verdict, Verdict::Inconclusive(_)), "{}: {verdict:?}", case.id);
    }
}
