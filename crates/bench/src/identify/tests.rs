//! Modes and responses identified from readings of the simulated arm, against those of its equations.

use super::*;
use alloc::string::ToString;
use alloc::vec::Vec;

use nalgebra::Normed as _;

use crate::excitation::{ExcitationSpec, Phases, Profile, Waveform};
use crate::plant::tests::{damped, preset};
use crate::plant::{Plant, PlantSpec, TestedAssembly};
use crate::rig::{Load, RigSpec};
use resonarm_analysis::LinearResponse;
use resonarm_analysis::Quantity;
use resonarm_dynamics::integrate::Scheme;
use resonarm_dynamics::structure::StructureMode;

const RATE_HZ: f64 = 1000.0;
const BAND: Band = Band { from_hz: 5.0, to_hz: 80.0 };

fn spec() -> PlantSpec {
    PlantSpec {
        scheme: Scheme::default(),
        sample_rate_hz: RATE_HZ,
        steps_per_sample: 4,
        rig: RigSpec::default(),
        seed: 11,
    }
}

fn arm(beta2_deg: f64) -> TestedAssembly {
    preset([0.0, beta2_deg])
}

fn force(x_n: f64, y_n: f64) -> Load {
    Load::force_n(x_n, y_n)
}

/// The readings while a profile is played.
fn recorded(
    spec: &PlantSpec,
    arm: &TestedAssembly,
    amplitude: Load,
    profile: Waveform,
) -> Result<Record, IdentifyError> {
    let profile = Profile::new(&ExcitationSpec { amplitude, ramp_s: 0.0, profile }, RATE_HZ).unwrap();
    let mut plant = Plant::new(spec, arm).unwrap();
    let samples: Vec<_> = (0..profile.samples())
        .map(|n| {
            let [hx, hy, bx, by, cx, cy] = plant.measure().readings().map(|reading| reading.value);
            plant.advance(&profile.load(n)).unwrap();
            ([hx, hy], [bx, by, cx, cy])
        })
        .collect();
    Record::new(RATE_HZ, &spec.rig, samples, Direction::Principal)
}

const RANDOM: Waveform = Waveform::Random { from_hz: 5.0, to_hz: 80.0, duration_s: 40.0, spectrum: None, seed: 3 };
const IMPACT: Waveform = Waveform::Impulse { pulse_s: 0.008, duration_s: 30.0 };

/// Frequencies within 0.01 %, damping ratios within 5 %, and both within their deviations.
fn assert_found(record: &Record, beta2_deg: f64, part: FittedPart) {
    let found = modes(record, BAND).unwrap().modes;
    let arm = arm(beta2_deg);
    let expected = arm.assembly.modes();
    assert_eq!(found.len(), 2, "{found:?}");
    for (found, mode) in found.iter().zip(expected) {
        let off_hz = found.pole_frequency_hz - mode.frequency_hz;
        let off = found.pole_damping_ratio - mode.damping_ratio;
        assert!(off_hz.abs() < 1e-4 * mode.frequency_hz, "{found:?} {mode:?}");
        assert!(off.abs() < 0.05 * mode.damping_ratio, "{found:?} {mode:?}");
        assert!(off_hz.abs() < 4.0 * found.pole_frequency_deviation_hz, "{found:?} {mode:?}");
        assert!(off.abs() < 4.0 * found.pole_damping_ratio_deviation, "{found:?} {mode:?}");
        assert!(found.pole_damping_ratio_deviation < 0.05 * mode.damping_ratio, "{found:?} {mode:?}");
        assert!(found.is_linear && found.part == part, "{found:?}");
    }
}

#[test]
fn random_force_gives_frequencies_and_damping() {
    for beta2_deg in [60.0, 120.0] {
        assert_found(
            &recorded(&spec(), &arm(beta2_deg), force(3.0, 4.0), RANDOM).unwrap(),
            beta2_deg,
            FittedPart::Forced,
        );
    }
}

#[test]
fn an_impact_gives_frequencies_and_damping() {
    for beta2_deg in [60.0, 120.0] {
        assert_found(
            &recorded(&spec(), &arm(beta2_deg), force(18.0, 24.0), IMPACT).unwrap(),
            beta2_deg,
            FittedPart::RingDown,
        );
    }
}

/// With noiseless instruments the only error is that of the polynomials for the other mode.
#[test]
fn ideal_instruments_are_almost_exact() {
    let mut ideal = spec();
    let rig = &mut ideal.rig;
    for accelerometer in [&mut rig.sensors.b, &mut rig.sensors.c] {
        (accelerometer.noise_rms, accelerometer.resolution) = (None, None);
    }
    (rig.head.noise_rms, rig.head.resolution) = (None, None);
    for profile in [RANDOM, IMPACT] {
        let record = recorded(&ideal, &arm(60.0), force(0.0, 0.01), profile).unwrap();
        let found = modes(&record, BAND).unwrap().modes;
        for (found, mode) in found.iter().zip(arm(60.0).assembly.modes()) {
            assert!((found.pole_frequency_hz / mode.frequency_hz - 1.0).abs() < 1e-7, "{found:?} {mode:?}");
            assert!((found.pole_damping_ratio / mode.damping_ratio - 1.0).abs() < 1e-3, "{found:?} {mode:?}");
            // A ring-down has no force to compare with.
            assert_eq!(found.shape_per_sqrt_kg.is_some(), found.part == FittedPart::Forced);
            found.shape_per_sqrt_kg.iter().for_each(|shape| assert_shape(shape, mode, 60.0, 2e-3));
        }
    }
}

/// Points of the accelerometers.
const POINTS: [&str; CHANNELS] = ["joint2.x", "joint2.y", "tip.x", "tip.y"];

/// The displacements of B and C in a mode of modal mass 1 kg, up to the sign, within a fraction of the largest.
fn assert_shape(found: &[f64; CHANNELS], mode: &StructureMode, beta2_deg: f64, within: f64) {
    let assembly = arm(beta2_deg).assembly;
    // Small motions: the velocities of both points at rest are those of the mode.
    let expected = POINTS.map(|name| assembly.velocity(assembly.dof(name).unwrap(), &[0.0; 2], &mode.shape));
    let largest = expected.iter().fold(0.0_f64, |largest, part| largest.max(part.abs()));
    let sign = (found[3] * expected[3]).signum();
    for (found, expected) in found.iter().zip(expected) {
        assert!((sign * found - expected).abs() < within * largest, "{found:?} {expected:?} of {largest}");
    }
}

#[test]
fn noisy_records_give_the_modal_mass() {
    let found = modes(&recorded(&spec(), &arm(60.0), force(3.0, 4.0), RANDOM).unwrap(), BAND).unwrap().modes;
    for (found, mode) in found.iter().zip(arm(60.0).assembly.modes()) {
        assert_shape(&found.shape_per_sqrt_kg.unwrap(), mode, 60.0, 0.03);
    }
}

#[test]
fn the_shape_is_that_of_the_mode() {
    let record = recorded(&spec(), &arm(60.0), force(18.0, 24.0), IMPACT).unwrap();
    let assembly = arm(60.0).assembly;
    let (linear, drive) = (LinearResponse::new(&assembly), assembly.dof("tip.y").unwrap());
    for mode in modes(&record, BAND).unwrap().modes {
        let at = |name| linear.at(Quantity::Accelerance, drive, assembly.dof(name).unwrap(), mode.pole_frequency_hz);
        let shape = POINTS.map(|name| at(name).unwrap());
        let largest = shape.iter().max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap();
        for (found, expected) in mode.shape.iter().zip(&shape) {
            assert!((expected / largest - *found).norm() < 0.01, "{mode:?} {shape:?}");
        }
    }
}

/// Far from the resonances, where a segment is long enough, H1 and H2 are the responses of the equations.
#[test]
fn averaged_responses_are_those_of_the_equations() {
    let far = Band { from_hz: 26.0, to_hz: 32.0 };
    let periodic =
        Waveform::Multisine { from_hz: 5.0, to_hz: 80.0, period_s: 4.0, periods: 12, phases: Phases::Random, seed: 1 };
    let cases = [
        (RANDOM, Averaging::Welch(4000), 19),
        (periodic, Averaging::Periods(4000), 10),
        (IMPACT, Averaging::Single, 1),
    ];
    for (waveform, averaging, averages) in cases {
        let amplitude = if averaging == Averaging::Single { force(0.0, 400.0) } else { force(0.0, 20.0) };
        // With strong damping the arm's motion settles within a segment.
        let damped = damped([0.0, 60.0], 60.0);
        let record = recorded(&spec(), &damped, amplitude, waveform).unwrap();
        let (linear, tip) = (LinearResponse::new(&damped.assembly), damped.assembly.dof("tip.y").unwrap());
        let estimate = frequency_response(&record, far, averaging).unwrap();
        assert_eq!(estimate.averages, averages);
        assert_eq!(estimate.coherence.is_some(), averages > 1);
        for (k, hz) in estimate.frequency_hz.iter().enumerate() {
            let expected = linear.at(Quantity::Accelerance, tip, tip, *hz).unwrap();
            let (h1, h2) = (estimate.h1[3][k], estimate.h2[3][k]);
            assert!((h1 - expected).norm() < 0.1 * expected.norm(), "{averaging:?} {hz}: {h1} {expected}");
            assert!((h2 - expected).norm() < 0.1 * expected.norm(), "{averaging:?} {hz}: {h2} {expected}");
            let coherence = estimate.coherence.as_ref().map_or(1.0, |coherence| coherence[3][k]);
            assert!((0.9..=1.0 + 1e-12).contains(&coherence), "{averaging:?} {hz}: {coherence}");
        }
    }
}

/// Strong vibration is not linear, as the residual shows.
#[test]
fn strong_vibration_is_reported_as_not_linear() {
    let record = recorded(&spec(), &arm(60.0), force(0.0, 500.0), RANDOM).unwrap();
    assert!(modes(&record, BAND).unwrap().modes.iter().any(|mode| !mode.is_linear));
}

#[test]
fn says_why_a_record_can_t_be_identified() {
    let short = Waveform::Random { from_hz: 5.0, to_hz: 80.0, duration_s: 0.2, spectrum: None, seed: 3 };
    let error = |record: Result<Record, IdentifyError>, band| {
        record.and_then(|record| modes(&record, band)).unwrap_err().to_string()
    };
    let (spec, arm) = (spec(), arm(60.0));
    insta::assert_snapshot!(error(recorded(&spec, &arm, force(0.0, 5.0), short), BAND), @"the record has 200 samples, but at least 256 are needed: record for longer");
    let random = |duration_s| Waveform::Random { from_hz: 5.0, to_hz: 80.0, duration_s, spectrum: None, seed: 3 };
    let torque = Load::torque_nm(5.0, 0.0);
    insta::assert_snapshot!(error(recorded(&spec, &arm, torque, random(2.0)), BAND), @"the impedance head reads no force beyond its own noise (0.012 N): expected an excitation by a force at the head; apply a larger one");
    let record = recorded(&spec, &arm, force(0.0, 5.0), random(10.0)).unwrap();
    insta::assert_snapshot!(error(Ok(record.clone()), Band { from_hz: 200.0, to_hz: 300.0 }), @"the force has no energy from 200 to 300 Hz: drive the structure there, or name the band that was driven");
    // Peaks of the random force are no modes.
    let between = modes(&record, Band { from_hz: 30.0, to_hz: 36.0 }).unwrap();
    assert!(between.modes.is_empty() && between.rejected.iter().all(|peak| peak.reason == Rejection::NoPole));
    let none = IdentifyError::NoResonance { from_hz: 30.0, to_hz: 36.0 };
    insta::assert_snapshot!(none, @"there is no resonance from 30 to 36 Hz: widen the band, or record for longer");
    insta::assert_snapshot!(error(Ok(record.clone()), Band { from_hz: 30.0, to_hz: 600.0 }), @"the band is from 30 to 600 Hz: it must rise, from above 0 to below half the sample rate, 1000 Hz");
    insta::assert_snapshot!(error(Ok(record.clone()), Band { from_hz: 22.0, to_hz: 22.5 }), @"the record has 10000 samples, but at least 32000 are needed: record for longer");
    insta::assert_snapshot!(frequency_response(&record, BAND, Averaging::Welch(8)).unwrap_err(), @"a segment has 8 samples: it must have from 16 to as many as the record, 10000");
}
