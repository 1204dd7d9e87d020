//! Angles from the readings of the simulated arm, against its own states.

use super::*;
use alloc::string::ToString;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use crate::plant::{Plant, PlantSpec, TestedAssembly, tests};
use crate::rig::{Load, RigSpec, SensorSpec};
use resonarm_dynamics::integrate::Scheme;

const RATE_HZ: f64 = 1000.0;
const WAYS: [Integration; 2] = [Integration::Frequency, Integration::Time];

fn arm(beta2_deg: f64) -> TestedAssembly {
    tests::preset([20.0, beta2_deg])
}

fn spec(seed: u64) -> PlantSpec {
    PlantSpec { scheme: Scheme::default(), sample_rate_hz: RATE_HZ, steps_per_sample: 4, rig: RigSpec::default(), seed }
}

fn ideal(mut spec: PlantSpec) -> PlantSpec {
    for sensor in [&mut spec.rig.sensors.b, &mut spec.rig.sensors.c] {
        *sensor = SensorSpec { range: 1e6, noise_rms: None, resolution: None, ..*sensor };
    }
    spec
}

/// A run: its readings, and the true angles at the instants of the readings.
struct Run {
    arm: TestedAssembly,
    rig: RigSpec,
    readings: Vec<[f64; CHANNELS]>,
    alpha_rad: Vec<[f64; 2]>,
    from_hz: f64,
}

/// Plays a load, a function of the time; the readings of sample 0 are left out, as they don't belong to the middle of a
/// hold.
fn run(spec: &PlantSpec, beta2_deg: f64, samples: usize, load: impl Fn(f64) -> Load) -> Run {
    let arm = arm(beta2_deg);
    let mut plant = Plant::new(spec, &arm).unwrap();
    // A reading belongs to the middle of a hold that began this many holds before the last.
    let late = spec.rig.converter.holds_late();
    let (mut readings, mut alpha_rad) = (Vec::new(), alloc::vec![[0.0; 2]; late]);
    plant.measure();
    for k in 0..samples {
        let before = *plant.states();
        plant.advance(&load(k as f64 / RATE_HZ)).unwrap();
        let [_, _, bx, by, cx, cy] = plant.measure().readings().map(|reading| reading.value);
        readings.push([bx, by, cx, cy]);
        // Hermite's cubic in the middle: (x0 + x1)/2 + (v0 − v1)/(8 rate).
        let after = *plant.states();
        let middle = |joint: usize| {
            (before.coordinates()[joint] + after.coordinates()[joint]) * 0.5
                + (before.rates()[joint] - after.rates()[joint]) * (0.125 / RATE_HZ)
        };
        alpha_rad.push([middle(0), middle(1)]);
    }
    alpha_rad.truncate(samples);
    let from_hz = 0.25 * arm.assembly.modes()[0].frequency_hz;
    Run { arm, rig: spec.rig.clone(), readings, alpha_rad, from_hz }
}

impl Run {
    fn settings(&self, integration: Integration) -> AngleSettings {
        AngleSettings { integration, from_hz: self.from_hz, starts_at_rest: false }
    }

    fn angles(&self, settings: AngleSettings) -> Result<AngleHistory, IdentifyError> {
        joint_angles(&self.arm.measured_links_m().unwrap(), RATE_HZ, &self.rig, &self.readings, settings)
    }
}

fn dwell(hz: f64, torque1_nm: f64) -> impl Fn(f64) -> Load {
    move |t_s| Load::torque_nm(torque1_nm * libm::sin(TAU * hz * t_s), 0.0)
}

/// The angles less their slow part: a running mean with Gaussian weights, 0.06 s of standard deviation, which takes
/// 1e-15 of 22 Hz.
fn without_slow(alpha_rad: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let reach: isize = 360;
    let weight = |lag: isize| libm::exp(-0.5 * (lag as f64 / 60.0) * (lag as f64 / 60.0));
    let total: f64 = (-reach..=reach).map(weight).sum();
    let at = |n: isize, joint: usize| alpha_rad[n.clamp(0, alpha_rad.len() as isize - 1) as usize][joint];
    let mean = |n: isize, joint| (-reach..=reach).map(|lag| weight(lag) * at(n + lag, joint)).sum::<f64>() / total;
    (0..alpha_rad.len() as isize).map(|n| [0, 1].map(|joint| at(n, joint) - mean(n, joint))).collect()
}

fn largest(alpha_rad: &[[f64; 2]], joint: usize) -> f64 {
    alpha_rad.iter().fold(0.0, |largest, alpha| largest.max(alpha[joint].abs()))
}

/// The angles, with zeros before the first.
fn padded(found: &AngleHistory) -> Vec<[f64; 2]> {
    let mut padded = alloc::vec![[0.0; 2]; found.first];
    padded.extend(&found.alpha_rad);
    padded
}

/// Largest difference of either angle over the largest angle of the joint.
fn difference(found: &AngleHistory, expected: &[[f64; 2]]) -> f64 {
    let expected = &expected[found.first..found.first + found.alpha_rad.len()];
    let of = |joint: usize| {
        let pairs = found.alpha_rad.iter().zip(expected);
        let off = pairs.fold(0.0_f64, |off, (found, expected)| off.max((found[joint] - expected[joint]).abs()));
        off / largest(expected, joint)
    };
    of(0).max(of(1))
}

/// Weak and strong vibration near the first resonance, with ideal instruments.
#[test]
fn ideal_readings_give_the_angles() {
    for beta2_deg in [60.0, 120.0] {
        let hz = arm(beta2_deg).assembly.modes()[0].frequency_hz;
        for (torque1_nm, least_rad, most_off) in [(1.0, 3e-4, 1e-4), (100.0, 0.04, 1e-3)] {
            let run = run(&ideal(spec(0)), beta2_deg, 4000, dwell(hz, torque1_nm));
            let expected = without_slow(&run.alpha_rad);
            assert!(largest(&expected, 0) > least_rad, "{}", largest(&expected, 0));
            let ways = WAYS.map(|integration| run.angles(run.settings(integration)).unwrap());
            for (found, integration) in ways.iter().zip(WAYS) {
                let off = difference(found, &expected);
                assert!(off < most_off, "{integration:?} β2 {beta2_deg} {torque1_nm} N·m: {off}");
                assert!(found.residual.over_noise.is_none() && found.residual.over_displacement < 2e-3);
                assert!(found.deviation_rad.iter().all(|sigma| *sigma == [0.0; 2]));
            }
            let off = difference(&ways[0], &padded(&ways[1]));
            assert!(off < 3e-5, "the ways at β2 {beta2_deg} {torque1_nm} N·m: {off}");
        }
    }
}

/// A beginning from rest has angles from the first reading on; any other beginning is left out, as is the end.
#[test]
fn ends_are_left_out_but_a_beginning_from_rest() {
    let run = run(&ideal(spec(0)), 60.0, 4000, dwell(24.0, 20.0));
    for integration in WAYS {
        let ends = libm::ceil(4.0 * RATE_HZ / run.from_hz) as usize;
        let settings = run.settings(integration);
        let found = run.angles(settings).unwrap();
        assert_eq!((found.first, found.alpha_rad.len()), (ends, 4000 - 2 * ends));
        let found = run.angles(AngleSettings { starts_at_rest: true, ..settings }).unwrap();
        assert_eq!((found.first, found.alpha_rad.len()), (0, 4000 - ends));
        // The small part of a sudden start below the corner is missing.
        let off = difference(&found, &run.alpha_rad);
        assert!(off < 1e-2, "{integration:?}: {off}");
    }
}

/// Readings with noise and counts, over many seeds: errors over stated deviations have a mean square of 1, and stay
/// within 5.
#[test]
fn stated_deviations_are_those_over_seeds() {
    let play = |spec: &PlantSpec| run(spec, 60.0, 3000, dwell(24.0, 40.0));
    let exact = play(&ideal(spec(0)));
    for integration in WAYS {
        let exact = exact.angles(exact.settings(integration)).unwrap();
        let (mut squares, mut residuals, mut worst, mut count) = ([0.0; 2], 0.0, 0.0_f64, 0);
        let seeds = 12;
        for seed in 0..seeds {
            let run = play(&spec(seed));
            let found = run.angles(run.settings(integration)).unwrap();
            for ((found, sigma), exact) in found.alpha_rad.iter().zip(&found.deviation_rad).zip(&exact.alpha_rad) {
                for joint in 0..2 {
                    let off = (found[joint] - exact[joint]) / sigma[joint];
                    squares[joint] += off * off;
                    worst = worst.max(off.abs());
                }
            }
            count += found.alpha_rad.len();
            residuals += found.residual.over_noise.unwrap() / seeds as f64;
        }
        for square in squares {
            let ratio = libm::sqrt(square / count as f64);
            assert!((0.8..1.2).contains(&ratio), "{integration:?}: {ratio}");
        }
        assert!(worst < 5.0 && (residuals - 1.0).abs() < 0.1, "{integration:?}: {worst} {residuals}");
    }
}

/// The angles agree with the arm's states within three deviations, except as often as chance allows.
#[test]
fn angles_are_those_of_the_states_within_their_deviations() {
    let run = run(&spec(7), 60.0, 6000, dwell(24.0, 40.0));
    let expected = without_slow(&run.alpha_rad);
    for integration in WAYS {
        let found = run.angles(run.settings(integration)).unwrap();
        let expected = &expected[found.first..];
        let mut within = 0;
        for ((found, sigma), expected) in found.alpha_rad.iter().zip(&found.deviation_rad).zip(expected) {
            within += usize::from((0..2).all(|joint| (found[joint] - expected[joint]).abs() < 3.0 * sigma[joint]));
        }
        let part = within as f64 / found.alpha_rad.len() as f64;
        assert!(part > 0.97, "{integration:?}: {part}");
    }
}

/// Gravity in the readings is an offset, and the residual shows a faulty instrument.
#[test]
fn gravity_is_left_out_and_contradictions_are_reported() {
    let mut heavy = spec(1);
    heavy.rig.sensors.b.gravity_m_s2 = Some(9.80665);
    let (plain, heavy) = (run(&spec(1), 60.0, 4000, dwell(24.0, 40.0)), run(&heavy, 60.0, 4000, dwell(24.0, 40.0)));
    let found = heavy.angles(heavy.settings(Integration::Frequency)).unwrap();
    let expected = plain.angles(plain.settings(Integration::Frequency)).unwrap();
    let off = difference(&found, &padded(&expected));
    // The counts of B differ by a fraction of 0.05 m/s².
    assert!(off < 1e-2, "{off}");
    assert!((0.5..2.0).contains(&found.residual.over_noise.unwrap()), "{:?}", found.residual);
    let mut weak = spec(1);
    weak.rig.sensors.b.gain = Some(0.9);
    let weak = run(&weak, 60.0, 4000, dwell(24.0, 40.0));
    let residual = weak.angles(weak.settings(Integration::Time)).unwrap().residual;
    assert!(residual.over_noise.unwrap() > 5.0 && residual.over_displacement > 0.02, "{residual:?}");
}

#[test]
fn says_why_there_are_no_angles() {
    let mut run = run(&spec(0), 60.0, 1000, dwell(24.0, 1.0));
    let says = |run: &Run, from_hz| {
        let settings = AngleSettings { from_hz, ..run.settings(Integration::Time) };
        run.angles(settings).unwrap_err().to_string()
    };
    insta::assert_snapshot!(says(&run, 0.0), @"the lower corner is 0 Hz: it must be above 0 and below half the sample rate, 1000 Hz");
    insta::assert_snapshot!(says(&run, f64::NAN), @"the lower corner is NaN Hz: it must be above 0 and below half the sample rate, 1000 Hz");
    insta::assert_snapshot!(says(&run, 5.0), @"the record has 1000 samples, but at least 1800 are needed for angles from 5.000 Hz on: record for longer, or raise the lower corner");
    insta::assert_snapshot!(says(&run, 1e-300), @"the record has 1000 samples, but at least 9e303 are needed for angles from 0.000 Hz on: record for longer, or raise the lower corner");
    run.from_hz = 20.0;
    run.readings.iter_mut().for_each(|reading| reading[1] *= 1e6);
    let error = run.angles(run.settings(Integration::Frequency)).unwrap_err();
    assert!(matches!(error, IdentifyError::TooLarge { most_rad: 1.0, .. }), "{error}");
    let error = IdentifyError::TooLarge { angle_rad: 16.25, most_rad: 1.0 };
    insta::assert_snapshot!(error, @"the displacements give angles of up to 16.250 rad: a vibration of the arm must have at most 1 rad; check the readings, or raise the lower corner");
    run.readings[17][2] = f64::NAN;
    insta::assert_snapshot!(says(&run, 20.0), @"reading 17, counted from 0, has an acceleration that is not a finite number: correct the record, or leave the reading out");
}
