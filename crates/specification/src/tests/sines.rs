//! Verdicts on swept sines of known amplitude, rate and distortion.

use core::f64::consts::TAU;

use resonarm_numeric::noise::Noise;

use super::{near, sine};
use crate::verdict::{SineVerdict, Verdict, judge_sine};
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
    judge_sine(test, &Limits::default(), RATE_HZ, &record(phases, of, noise), Some(&drive), &[]).unwrap()
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
    let alone = judge_sine(&test, &Limits::default(), RATE_HZ, &reading, None, &[]).unwrap();
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
    let alone = judge_sine(&specified("tolerance = 0.05"), &Limits::default(), RATE_HZ, &reading, None, &[]).unwrap();
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
    let noise = record(&up, |_| 0.0, 1.0);
    let error = judge_sine(&test, &Limits::default(), RATE_HZ, &noise, None, &[]).unwrap_err();
    assert!(matches!(error, VerdictError::NoSweep { .. }), "{error}");
    let error = judge_sine(&test, &Limits::default(), 200.0, &noise, None, &[]).unwrap_err();
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
    let judged = |level: f64| judge_sine(&test, &limits(level), RATE_HZ, &reading, Some(&drive), &[&response]).unwrap();
    assert_eq!(
        judge_sine(&test, &Limits::default(), RATE_HZ, &reading, Some(&drive), &[]).unwrap().verdict,
        Verdict::Out
    );
    // Beside the notch the response is twice the limit.
    let found = judged(3.0);
    assert_eq!((found.limits[0].verdict, found.verdict), (Verdict::Out, Verdict::Out));
    near(found.limits[0].largest_db, 20.0 * libm::log10(2.0), 0.01);
    let found = judged(6.0);
    assert_eq!(found.limits[0].verdict, Verdict::In);
}
