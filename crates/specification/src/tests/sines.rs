//! Verdicts on swept sines of known amplitude, rate and distortion.

use core::f64::consts::TAU;

use resonarm_numeric::noise::Noise;

use super::{LOW_LEVELS, low_level, near, sine};
use crate::verdict::{Begin, SineVerdict, Verdict, judge_sine};
use crate::{Limits, Profile, ResponseLimit, SineTest, VerdictError};

const RATE_HZ: f64 = 1000.0;

/// A sweep from 15 to 60 Hz at 4 octaves a minute, of 3 m/s², with these keys.
fn specified(keys: &str) -> SineTest {
    sine(&format!("from_hz = 15\nrate_oct_min = 4\nsegments = [{{ to_hz = 60, acceleration_m_s2 = 3 }}]\n{keys}"))
}

/// Phases of a sweep at this rate, rad, with 2 s at its first and last frequency.
fn phases(rate_oct_min: f64) -> Vec<f64> {
    let test = sine(&format!(
        "from_hz = 15\nrate_oct_min = {rate_oct_min}\nsegments = [{{ to_hz = 60, acceleration_m_s2 = 3 }}]\ntolerance = 0.1"
    ));
    let sweep_s = test.sweep_s(15.0, 60.0);
    let at = |t_s: f64| {
        let (before, after) = ((t_s - 2.0).min(0.0), (t_s - 2.0 - sweep_s).max(0.0));
        test.phase_rad((t_s - 2.0).clamp(0.0, sweep_s)) + TAU * (15.0 * before + 60.0 * after)
    };
    (0..((sweep_s + 4.0) * RATE_HZ) as usize).map(|k| at(k as f64 / RATE_HZ)).collect()
}

/// Sines of these phases with noise.
fn record(phases: &[f64], of: impl Fn(f64) -> f64, noise: f64) -> Vec<f64> {
    let mut normal = Noise::new(4, 1);
    phases.iter().map(|phase| of(*phase) + noise * normal.normal()).collect()
}

fn judged(test: &SineTest, phases: &[f64], of: impl Fn(f64) -> f64, noise: f64) -> SineVerdict {
    let drive = record(phases, |phase| 20.0 * libm::sin(phase + 0.7), 0.0);
    judge_sine(test, &Limits::default(), RATE_HZ, &record(phases, of, noise), Some(&drive), &[], Begin::Searched)
        .unwrap()
}

#[test]
fn a_good_sweep_is_in() {
    let test = specified("tolerance = 0.1\nrate_tolerance = 0.1");
    let phases = phases(4.0);
    let found = judged(&test, &phases, |phase| 3.0 * libm::sin(phase), 0.05);
    assert_eq!(found.verdict, Verdict::In, "{:?} {:?}", found.shares, found.passes);
    assert_eq!(found.passes.len(), 1);
    assert!(found.extremes[0] > 0.99 && found.extremes[1] < 1.01, "{:?}", found.extremes);
    near(found.passes[0].rate, 4.0, 0.01);
    assert!(found.passes[0].still.unwrap() < 0.05, "{:?}", found.passes);
    assert!(found.passes[0].departure_octaves < 0.01, "{:?}", found.passes);
    // Without the drive the reading gives the phase.
    let reading = record(&phases, |phase| 3.0 * libm::sin(phase), 0.05);
    let alone = judge_sine(&test, &Limits::default(), RATE_HZ, &reading, None, &[], Begin::Searched).unwrap();
    assert_eq!((alone.verdict, alone.is_continuous), (Verdict::In, None));
    near(alone.extremes[1], found.extremes[1], 0.01);
}

/// A second harmonic of 40 % moves the fundamental by less than 1 %, √2 rms by √1.16, and the peak by more.
#[test]
fn the_fundamental_is_read_beside_harmonics() {
    let phases = phases(4.0);
    let distorted = |phase: f64| 3.0 * libm::sin(phase) + 1.2 * libm::cos(2.0 * phase);
    let found = judged(&specified("tolerance = 0.05"), &phases, distorted, 0.0);
    assert_eq!(found.verdict, Verdict::In);
    for point in &found.points {
        near(point.tracked_m_s2, 3.0, 0.01);
        near(point.rms_m_s2, 3.0 * 1.16_f64.sqrt(), 0.02);
        near(point.peak_m_s2, 4.2, 0.02);
    }
    let reading = record(&phases, distorted, 0.0);
    let alone =
        judge_sine(&specified("tolerance = 0.05"), &Limits::default(), RATE_HZ, &reading, None, &[], Begin::Searched)
            .unwrap();
    assert_eq!(alone.verdict, Verdict::In, "{:?}", alone.extremes);
    let rms = judged(&specified("tolerance = 0.05\nmeasure = 'rms'"), &phases, distorted, 0.0);
    let peak = judged(&specified("tolerance = 0.05\nmeasure = 'peak'"), &phases, distorted, 0.0);
    assert_eq!([rms.verdict, peak.verdict], [Verdict::Out, Verdict::Out]);
}

#[test]
fn wrong_amplitudes_are_out_by_their_share_of_the_time() {
    let phases = phases(4.0);
    // 20 % too high from 30 to 33 Hz: log2(1.1)/log2(60/15/1.15²) of the judged time, 9 %.
    let test = specified("tolerance = 0.1");
    let (from, to) = (test.phase_rad(15.0), test.phase_rad(15.0 + 60.0 / 4.0 * 1.1_f64.log2()));
    let high = |phase: f64| if phase > from && phase < to { 3.6 } else { 3.0 };
    let found = judged(&test, &phases, |phase| high(phase) * libm::sin(phase), 0.01);
    assert_eq!(found.verdict, Verdict::Out);
    assert!(found.shares[2] > 0.04 && found.shares[2] < 0.12, "{:?}", found.shares);
    assert!(found.extremes_hz[1] > 29.0 && found.extremes_hz[1] < 34.0, "{:?}", found.extremes_hz);
    let most =
        judged(&specified("tolerance = 0.1\nshare = 0.8"), &phases, |phase| high(phase) * libm::sin(phase), 0.01);
    assert_eq!(most.verdict, Verdict::In, "{:?}", most.shares);
    let noisy = judged(&specified("tolerance = 0.03"), &phases, |phase| 3.0 * libm::sin(phase), 1.0);
    assert_eq!(noisy.verdict, Verdict::Undecided, "{:?}", noisy.shares);
}

#[test]
fn wrong_sweeps_are_out() {
    let test = specified("tolerance = 0.1\nrate_tolerance = 0.1");
    // 12 % too fast, where 10 % are allowed. The amplitude is right all the same.
    let fast = judged(&test, &phases(4.0 * 1.12), |phase| 3.0 * libm::sin(phase), 0.01);
    assert_eq!((fast.verdict, fast.rate, fast.amplitude), (Verdict::Out, Some(Verdict::Out), Verdict::In));
    let linear: Vec<f64> =
        (0..30_000).map(|k| f64::from(k) / RATE_HZ).map(|t_s| TAU * (15.0 + 0.5 * 45.0 / 30.0 * t_s) * t_s).collect();
    assert_eq!(judged(&test, &linear, |phase| 3.0 * libm::sin(phase), 0.01).rate, Some(Verdict::Out));
    // Steps of 1 s.
    let mut phase = 0.0;
    let stepped: Vec<f64> = (0..30_000)
        .map(|k| {
            phase += TAU * test.frequency_hz(f64::from(k / 1000)) / RATE_HZ;
            phase
        })
        .collect();
    let found = judged(&specified("tolerance = 0.1"), &stepped, |phase| 3.0 * libm::sin(phase), 0.01);
    assert_eq!((found.is_continuous, found.verdict), (Some(false), Verdict::Out), "{:?}", found.passes);
}

/// A controller that gives up at 40 of 60 Hz, and one that sweeps up but not down, have not carried out the test.
#[test]
fn sweeps_that_are_missing_or_broken_off_leave_the_test_undecided() {
    let whole = phases(4.0);
    let test = specified("tolerance = 0.1");
    let end = ((2.0 + test.sweep_s(15.0, 40.0)) * RATE_HZ) as usize;
    let found = judged(&test, &whole[..end], |phase| 3.0 * libm::sin(phase), 0.01);
    assert_eq!(
        (found.amplitude, found.whole, found.verdict),
        (Verdict::In, 0, Verdict::Undecided),
        "{:?}",
        found.passes
    );
    let twice = specified("tolerance = 0.1\nsweeps = 2");
    let found = judged(&twice, &whole, |phase| 3.0 * libm::sin(phase), 0.01);
    assert_eq!((found.whole, found.asked, found.verdict), (1, 2, Verdict::Undecided));
}

#[test]
fn up_and_down_are_two_sweeps_and_noise_is_none() {
    let test = specified("tolerance = 0.1\nsweeps = 2");
    let up = phases(4.0);
    let last = up[up.len() - 1];
    let both: Vec<f64> = up.iter().copied().chain(up.iter().rev().map(|phase| 2.0 * last - phase)).collect();
    let found = judged(&test, &both, |phase| 3.0 * libm::sin(phase), 0.01);
    assert_eq!((found.passes.len(), found.verdict), (2, Verdict::In), "{:?}", found.passes);
    assert!(found.passes[0].to_hz > 50.0 && found.passes[1].to_hz < 18.0);
    // No sinusoid at all: its phase must not be taken for a sweep.
    let noise = record(&up, |_| 0.0, 1.0);
    let error = judge_sine(&test, &Limits::default(), RATE_HZ, &noise, None, &[], Begin::Searched).unwrap_err();
    assert!(matches!(error, VerdictError::NoSweep { .. }), "{error}");
    let error = judge_sine(&test, &Limits::default(), 200.0, &noise, None, &[], Begin::Searched).unwrap_err();
    assert!(matches!(error, VerdictError::Rate { .. }), "{error}");
}

#[test]
fn a_notch_may_be_low() {
    let (test, phases) = (specified("tolerance = 0.1"), phases(4.0));
    let [from, to] = [30.0, 40.0].map(|hz: f64| test.phase_rad(test.sweep_s(15.0, hz)));
    let size = |phase: f64| if phase > from && phase < to { 1.5 } else { 3.0 };
    let drive = record(&phases, libm::sin, 0.0);
    let reading = record(&phases, |phase| size(phase) * libm::sin(phase), 0.0);
    let response = record(&phases, |phase| 2.0 * size(phase) * libm::sin(phase), 0.0);
    let limits = |level: f64| Limits {
        response: vec![ResponseLimit {
            channel: "b.x".into(),
            profile: Profile::new(&[[25.0, level], [45.0, level]]).unwrap(),
        }],
        ..Limits::default()
    };
    let judged = |level: f64| {
        judge_sine(&test, &limits(level), RATE_HZ, &reading, Some(&drive), &[&response], Begin::Searched).unwrap()
    };
    assert_eq!(
        judge_sine(&test, &Limits::default(), RATE_HZ, &reading, Some(&drive), &[], Begin::Searched).unwrap().verdict,
        Verdict::Out
    );
    // Beside the notch the response is twice the limit.
    let found = judged(3.0);
    assert_eq!((found.limits[0].verdict, found.verdict), (Verdict::Out, Verdict::Out));
    near(found.limits[0].largest_db, 20.0 * libm::log10(2.0), 0.01);
    let found = judged(6.0);
    assert_eq!(found.limits[0].verdict, Verdict::In);
}

/// What a controller plays before its test, with the rms of a sine of 3 m/s² 12 dB below its level, and 2 s of silence.
fn before(kind: &str, seed: u64) -> Vec<f64> {
    let mut played = low_level(kind, RATE_HZ, [15.0, 60.0], 30_000, seed);
    let rms = libm::sqrt(played.iter().map(|value| value * value).sum::<f64>() / played.len() as f64);
    let level = 0.25 * 3.0 * core::f64::consts::FRAC_1_SQRT_2 / rms;
    played.iter_mut().for_each(|value| *value *= level);
    played.resize(played.len() + 2000, 0.0);
    played
}

/// The reading with weak noise, judged with the drive that is 20 times as large, and by itself.
fn judged_both(test: &SineTest, played: &[f64], begin: Begin) -> [Result<SineVerdict, VerdictError>; 2] {
    let mut normal = Noise::new(4, 1);
    let reading: Vec<f64> = played.iter().map(|value| value + 0.02 * normal.normal()).collect();
    let drive: Vec<f64> = played.iter().map(|value| 20.0 * value).collect();
    let limits = Limits::default();
    [Some(&drive[..]), None].map(|drive| judge_sine(test, &limits, RATE_HZ, &reading, drive, &[], begin))
}

/// A sine of these phases with an amplitude, m/s².
fn played(phases: &[f64], amplitude: f64) -> Vec<f64> {
    phases.iter().map(|phase| amplitude * libm::sin(*phase)).collect()
}

#[test]
fn a_test_begins_with_its_sweep() {
    let test = specified("tolerance = 0.1\nrate_tolerance = 0.1");
    let sweep = played(&phases(4.0), 3.0);
    for kind in LOW_LEVELS {
        for seed in 1..=4 {
            let record = [before(kind, seed), sweep.clone()].concat();
            for found in judged_both(&test, &record, Begin::Searched) {
                let found = found.unwrap();
                assert_eq!((found.verdict, found.passes.len()), (Verdict::In, 1), "{kind} {seed}: {:?}", found.passes);
                // After 2 s at the first frequency.
                assert!((found.begins_s - 34.0).abs() < 0.3, "{kind} {seed}: {}", found.begins_s);
                assert_eq!(found.left_out, 0);
            }
        }
    }
}

/// The first attempt is 20 % too high, and is broken off at 40 Hz.
#[test]
fn sweeps_before_the_test_are_left_out() {
    let test = specified("tolerance = 0.1\nrate_tolerance = 0.1");
    let whole = phases(4.0);
    let end = ((2.0 + test.sweep_s(15.0, 40.0)) * RATE_HZ) as usize;
    // The second is whole and 12 dB too low: a sweep at low level, by which a structure is looked at.
    for first in [played(&whole[..end], 3.6), played(&whole, 0.75)] {
        let begins_s = first.len() as f64 / RATE_HZ + 34.0;
        let record = [first, before("multisine", 1), played(&whole, 3.0)].concat();
        for found in judged_both(&test, &record, Begin::Searched) {
            let found = found.unwrap();
            assert_eq!((found.verdict, found.left_out), (Verdict::In, 1), "{:?}", found.passes);
            assert!((found.begins_s - begins_s).abs() < 0.3, "{} {begins_s}", found.begins_s);
        }
        // All of a record that starts with the test is judged.
        for found in judged_both(&test, &record, Begin::Start) {
            let found = found.unwrap();
            assert_eq!((found.verdict, found.left_out, found.passes.len()), (Verdict::Out, 0, 2), "{:?}", found.passes);
        }
    }
}

/// The silence after it is no part of a sweep that is broken off.
#[test]
fn a_sweep_that_is_broken_off_ends_there() {
    let test = specified("tolerance = 0.1");
    let end = ((2.0 + test.sweep_s(15.0, 40.0)) * RATE_HZ) as usize;
    let record = [played(&phases(4.0)[..end], 3.0), vec![0.0; 20_000]].concat();
    for found in judged_both(&test, &record, Begin::Searched) {
        let found = found.unwrap();
        assert_eq!((found.amplitude, found.whole, found.verdict), (Verdict::In, 0, Verdict::Undecided));
        assert!((found.passes[0].to_hz - 40.0).abs() < 2.0, "{:?}", found.passes);
    }
}

#[test]
fn a_test_whose_sweep_never_comes_has_no_begin() {
    let test = specified("tolerance = 0.1");
    let dwell: Vec<f64> = (0..60_000).map(|k| TAU * 30.0 * f64::from(k) / RATE_HZ).collect();
    let records = LOW_LEVELS.iter().flat_map(|kind| (1..=4).map(|seed| before(kind, seed)));
    for record in records.chain([played(&dwell, 3.0), [before("multisine", 1), before("noise", 1)].concat()]) {
        for found in judged_both(&test, &record, Begin::Searched) {
            assert!(matches!(found, Err(VerdictError::NoSweep { .. })), "{found:?}");
        }
    }
}
