//! Verdicts on shots of known shape, by their pulse and by their response spectrum.

use resonarm_modal::spectra::ShockResponse;
use resonarm_numeric::noise::Noise;

use super::{LOW_LEVELS, low_level, near, shock, srs};
use crate::verdict::{Begin, Verdict, judge_shock, judge_srs};
use crate::{ShockTest, VerdictError};

const RATE_HZ: f64 = 1000.0;

const KEYS: &str = "pulse = 'half-sine'\npeak_m_s2 = 20\nduration_s = 0.02\npre_s = 0.1\npost_s = 0.1\nband = 0.2\n\
    velocity_tolerance = 0.15\nend_velocity_tolerance = 0.1\noutside = 0.25\n";

fn specified(shots: &str) -> ShockTest {
    shock(&format!("{KEYS}{shots}"))
}

/// A record with a shot every second, each with these factors, after a second of noise.
fn record(shot: &[f64], factors: &[f64], noise: f64) -> Vec<f64> {
    let mut normal = Noise::new(8, 2);
    let mut record: Vec<f64> = (0..1000 * (factors.len() + 2)).map(|_| noise * normal.normal()).collect();
    for (factor, number) in factors.iter().zip(1..) {
        for (sample, value) in record[1000 * number..].iter_mut().zip(shot) {
            *sample += factor * value;
        }
    }
    record
}

#[test]
fn good_shots_are_in() {
    let test = specified("shots = [{ level_db = -12, count = 1 }, { level_db = 0, count = 3 }]");
    let (shot, start) = test.compensated(RATE_HZ).unwrap();
    let found = judge_shock(&test, RATE_HZ, &record(&shot, &[0.25, 1.0, 1.0, 1.0], 0.02), Begin::Searched).unwrap();
    assert_eq!(found.verdict, Verdict::In, "{:?}", found.shots);
    assert_eq!((found.shots.len(), found.full, found.asked, found.is_first_low), (4, 3, 3, Some(true)));
    // Shots are a sixth of the record.
    near(found.noise_m_s2, 0.02, 0.25);
    near(found.shots[1].t_s, 2.0 + start as f64 / RATE_HZ, 1e-4);
    for shot in &found.shots[1..] {
        near(shot.amplitude, 1.0, 0.01);
        assert!(shot.error < 0.01 && shot.velocity_change.abs() < 0.01, "{shot:?}");
        assert!(shot.end_velocity.unwrap().abs() < 0.01 && shot.outside.unwrap() < 0.13, "{shot:?}");
    }
    // A third one is missing.
    let found = judge_shock(&test, RATE_HZ, &record(&shot, &[0.25, 1.0, 1.0], 0.02), Begin::Searched).unwrap();
    assert_eq!((found.verdict, found.full), (Verdict::Undecided, 2));
    // The first one is at full level.
    let found = judge_shock(&test, RATE_HZ, &record(&shot, &[1.0, 1.0, 1.0], 0.02), Begin::Searched).unwrap();
    assert_eq!((found.verdict, found.is_first_low), (Verdict::Out, Some(false)));
    // None is at full level.
    let found = judge_shock(&test, RATE_HZ, &record(&shot, &[0.25, 0.5], 0.02), Begin::Searched).unwrap();
    assert_eq!((found.verdict, found.full), (Verdict::Out, 0));
}

/// A pulse that begins between two samples is found there, and its error is that of the noise.
#[test]
fn a_pulse_between_samples_is_in() {
    let test = shock("pulse = 'half-sine'\npeak_m_s2 = 20\nduration_s = 0.02\nband = 0.02\nvelocity_tolerance = 0.02");
    let late: Vec<f64> = (0..30).map(|k| test.acceleration_m_s2((f64::from(k) - 3.35) / RATE_HZ)).collect();
    let found = judge_shock(&test, RATE_HZ, &record(&late, &[1.0], 1e-3), Begin::Searched).unwrap();
    assert_eq!(found.verdict, Verdict::In, "{:?}", found.shots);
    near(found.shots[0].t_s, 1.003_35, 1e-9);
}

#[test]
fn wrong_shots_are_out() {
    let test = specified("");
    let (shot, start) = test.compensated(RATE_HZ).unwrap();
    let judged = |shot: &[f64], factor: f64| {
        judge_shock(&test, RATE_HZ, &record(shot, &[factor], 0.02), Begin::Searched).unwrap()
    };
    let high = judged(&shot, 1.3);
    assert_eq!(high.verdict, Verdict::Out);
    near(high.shots[0].error, 0.3, 0.02);
    near(high.shots[0].velocity_change, 0.3, 0.02);
    let short = shock(&KEYS.replace("duration_s = 0.02", "duration_s = 0.014")).compensated(RATE_HZ).unwrap().0;
    assert_eq!(judged(&short, 1.0).verdict, Verdict::Out);
    // Without compensation the velocity change stays.
    let mut alone = vec![0.0; shot.len()];
    alone[start..start + 21].copy_from_slice(&test.samples(RATE_HZ));
    let found = judged(&alone, 1.0);
    assert_eq!(found.verdict, Verdict::Out);
    near(found.shots[0].end_velocity.unwrap(), 1.0, 0.02);
    assert!(found.shots[0].error < 0.01, "{found:?}");
    // The tolerance lies within the noise.
    let wide = shock(&KEYS.replace("velocity_tolerance = 0.15", "velocity_tolerance = 0.5"));
    let noisy = judge_shock(&wide, RATE_HZ, &record(&shot, &[1.18], 0.4), Begin::Searched).unwrap();
    assert_eq!(noisy.verdict, Verdict::Undecided, "{:?}", noisy.shots);
    let inverted = judge_shock(&test, RATE_HZ, &record(&shot, &[-1.0], 0.02), Begin::Searched);
    assert!(matches!(inverted, Err(VerdictError::NoShot { .. })), "{inverted:?}");
    let slow = judge_shock(&test, 100.0, &shot, Begin::Searched);
    assert!(matches!(slow, Err(VerdictError::Rate { .. })), "{slow:?}");
}

#[test]
fn shock_response_spectra_are_judged_line_by_line() {
    let pulse = specified("").compensated(RATE_HZ).unwrap().0;
    let keys = |breakpoints: &str| {
        format!(
            "unit = 'm/s2'\nq = 10\nbreakpoints = [{breakpoints}]\ntolerance_db = [-1.5, 3]\nshare = 0.9\n\
             rest_tolerance_db = [-3, 6]\nlines_per_octave = 6\nshots = [{{ level_db = 0, count = 2 }}]"
        )
    };
    let lines = srs(&keys("[20, 1], [80, 1]")).frequencies_hz();
    let mut continued = pulse.clone();
    continued.resize(pulse.len() + 500, 0.0);
    let response = ShockResponse::estimate(RATE_HZ, &continued, 10.0, &lines).unwrap().maximax();
    let breakpoints: Vec<String> =
        lines.iter().zip(&response).map(|(hz, level)| format!("[{hz:?}, {level:?}]")).collect();
    let test = srs(&keys(&breakpoints.join(", ")));
    let judged = |factors: &[f64], noise: f64| judge_srs(&test, RATE_HZ, &record(&pulse, factors, noise)).unwrap();
    let found = judged(&[1.0, 1.0], 0.01);
    assert_eq!((found.verdict, found.full, found.asked), (Verdict::In, 2, 2), "{:?}", found.shots);
    assert!(found.shots[0].lines.iter().all(|line| line.deviation_db.abs() < 0.1), "{found:?}");
    near(found.shots[0].t_s, 1.0, 0.1);
    // 1.3 is 2.3 dB, below the upper tolerance of 3 dB.
    assert_eq!(judged(&[1.3, 1.3], 0.01).verdict, Verdict::In);
    // 3.5 dB: every line is above the tolerance of the nine tenths, none beyond that of the rest.
    let high = judged(&[1.5, 1.5], 0.01);
    assert_eq!((high.verdict, high.shots[0].shares[2]), (Verdict::Out, 1.0));
    // 0.8 is −1.9 dB, below the lower tolerance of −1.5 dB.
    assert_eq!(judged(&[0.8, 0.8], 0.01).verdict, Verdict::Out);
    assert_eq!(judged(&[1.0], 0.01).verdict, Verdict::Undecided);
    assert_eq!((judged(&[0.25], 0.01).verdict, judged(&[0.25], 0.01).full), (Verdict::Out, 0));
    // 2.8 dB with noise of a tenth of the response.
    assert_eq!(judged(&[1.38, 1.38], 0.7).verdict, Verdict::Undecided);
    let slow = judge_srs(&test, 500.0, &pulse);
    assert!(matches!(slow, Err(VerdictError::Rate { .. })), "{slow:?}");
}

/// Noise or a multisine with an rms of a tenth of the peak, as an identification plays them, and a second of silence.
fn identified(kind: &str, seed: u64) -> Vec<f64> {
    let mut played = low_level(kind, RATE_HZ, [2.0, 300.0], 20_000, seed);
    let rms = libm::sqrt(played.iter().map(|value| value * value).sum::<f64>() / played.len() as f64);
    played.iter_mut().for_each(|value| *value *= 2.0 / rms);
    played.resize(played.len() + 1000, 0.0);
    played
}

#[test]
fn a_test_begins_with_its_first_shot() {
    let test = specified("shots = [{ level_db = -12, count = 2 }, { level_db = 0, count = 3 }]");
    let (shot, start) = test.compensated(RATE_HZ).unwrap();
    let shots = record(&shot, &[0.25, 0.25, 1.0, 1.0, 1.0], 0.02);
    for kind in LOW_LEVELS {
        for seed in 1..=4 {
            let record = [identified(kind, seed), shots.clone()].concat();
            let found = judge_shock(&test, RATE_HZ, &record, Begin::Searched).unwrap();
            assert_eq!(found.verdict, Verdict::In, "{kind} {seed}: {:?}", found.shots);
            assert_eq!((found.shots.len(), found.is_first_low), (5, Some(true)), "{kind} {seed}: {:?}", found.shots);
            near(found.begins_s, 22.0 + (start as f64 - 100.0) / RATE_HZ, 1e-3);
            near(found.shots[0].t_s, 22.0 + start as f64 / RATE_HZ, 1e-4);
            near(found.noise_m_s2, 0.02, 0.4);
        }
    }
    // Where all of the record counts, pulses of the mode do, too.
    let record = [identified("mode", 1), shots].concat();
    assert!(judge_shock(&test, RATE_HZ, &record, Begin::Start).unwrap().shots.len() > 5);
}

/// Pulses at low level, by which a structure is identified, are no shots, or shots below the full level.
#[test]
fn pulses_at_low_level_before_the_test_do_not_disturb_it() {
    let test = specified("shots = [{ level_db = -12, count = 1 }, { level_db = 0, count = 3 }]");
    let shot = test.compensated(RATE_HZ).unwrap().0;
    // The lowest level is −12 dB, 0.25, and half of it makes a shot: 0.05 is none, 0.2 is one.
    for (pulse, shots) in [(0.05, 4), (0.2, 8)] {
        let record = record(&shot, &[pulse, pulse, pulse, pulse, 0.25, 1.0, 1.0, 1.0], 0.02);
        let found = judge_shock(&test, RATE_HZ, &record, Begin::Searched).unwrap();
        assert_eq!((found.verdict, found.shots.len(), found.full), (Verdict::In, shots, 3), "{:?}", found.shots);
    }
}

#[test]
fn a_test_whose_shots_never_come_has_no_begin() {
    let test = specified("shots = [{ level_db = -12, count = 2 }, { level_db = 0, count = 3 }]");
    for kind in LOW_LEVELS {
        for seed in 1..=4 {
            let found = judge_shock(&test, RATE_HZ, &identified(kind, seed), Begin::Searched);
            assert!(matches!(found, Err(VerdictError::NoShot { .. })), "{kind} {seed}: {found:?}");
        }
    }
}
