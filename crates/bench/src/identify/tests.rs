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
    Record::new(RATE_HZ, &spec.rig, &RigPlaces::of_structure(arm, &spec.rig), samples, Direction::Principal)
}

fn identified(record: &Record, band: Band) -> Vec<IdentifiedMode> {
    modes(&[record], band).unwrap().modes
}

const RANDOM: Waveform = Waveform::Random { from_hz: 5.0, to_hz: 80.0, duration_s: 20.0, spectrum: None, seed: 3 };

/// Modal shapes of both modes at the accelerometers, up to the sign.
const POINTS: [&str; CHANNELS] = ["joint2.x", "joint2.y", "tip.x", "tip.y"];

/// Displacements of B and C in a mode of modal mass 1 kg. Small motions: the velocities of both points at rest are those of the
/// mode.
fn true_shape(arm: &TestedAssembly, mode: &StructureMode) -> [f64; CHANNELS] {
    let assembly = &arm.assembly;
    POINTS.map(|name| assembly.at(&[0.0; 2]).velocity(assembly.dof(name).unwrap(), &mode.shape))
}

/// Frequencies, damping ratios and shapes within four of their deviations; the force is oblique, so that the shapes are those
/// of axes turned to it.
#[test]
fn an_oblique_random_force_gives_poles_and_shapes() {
    for beta2_deg in [60.0, 120.0] {
        // With ten times the dampers the record has lines enough in a half-power bandwidth.
        let arm = damped([0.0, beta2_deg], 10.0);
        let poles = resonarm_analysis::structure_poles(&arm.assembly);
        let found = modes(&[&recorded(&spec(), &arm, force(3.0, 4.0), RANDOM).unwrap()], BAND).unwrap();
        assert_eq!((found.modes.len(), &found.at[..]), (2, &POINTS.map(ToString::to_string)[..]));
        for ((mode, truth), pole) in found.modes.iter().zip(arm.assembly.modes()).zip(poles.iter().flatten()) {
            assert!(mode.doubts.is_empty(), "{mode:?}");
            let off_hz = mode.pole_frequency_hz - pole.pole_frequency_hz;
            assert!(off_hz.abs() < 4.0 * mode.pole_frequency_deviation_hz.unwrap(), "{mode:?} {pole:?}");
            let off = mode.pole_damping_ratio - pole.pole_damping_ratio;
            assert!(off.abs() < 4.0 * mode.pole_damping_ratio_deviation.unwrap(), "{mode:?} {pole:?}");
            assert!(mode.pole_damping_ratio_deviation.unwrap() < 0.01 * pole.pole_damping_ratio, "{mode:?}");
            let expected = true_shape(&arm, truth);
            let (shape, deviation) =
                (mode.shape_per_sqrt_kg.as_ref().unwrap(), mode.shape_deviation_per_sqrt_kg.as_ref().unwrap());
            let sign = (shape[3].unwrap() * expected[3]).signum();
            for ((found, deviation), expected) in shape.iter().zip(deviation).zip(expected) {
                let (off, deviation) = (sign * found.unwrap() - expected, deviation.unwrap());
                // The shape of the undamped arm: the dampers turn it by less than a thousandth.
                assert!(off.abs() < 4.0 * deviation + 1e-3 * expected.abs(), "{found:?} ± {deviation}: {expected}");
            }
            // The driving point moves along the force: 3 : 4.
            let along = 0.6 * expected[2] + 0.8 * expected[3];
            let mass = 1.0 / (along * along);
            let off = mode.modal_mass_kg.unwrap() - mass;
            assert!(off.abs() < 4.0 * mode.modal_mass_deviation_kg.unwrap() + 2e-3 * mass, "{mode:?} {mass}");
        }
        for noise in &found.noise {
            assert!((noise.estimated / noise.instrument.unwrap() - 1.0).abs() < 0.1, "{noise:?}");
        }
    }
}

/// With noiseless instruments the only errors are the images of the held force, and the harmonics of the arm's own
/// nonlinearity, which may appear as modes of no weight.
#[test]
fn ideal_instruments_are_almost_exact() {
    let mut ideal = spec();
    let rig = &mut ideal.rig;
    for accelerometer in [&mut rig.sensors.b, &mut rig.sensors.c] {
        (accelerometer.noise_rms, accelerometer.resolution) = (None, None);
    }
    (rig.head.noise_rms, rig.head.resolution) = (None, None);
    let arm = damped([0.0, 60.0], 10.0);
    let found = identified(&recorded(&ideal, &arm, force(0.0, 0.01), RANDOM).unwrap(), BAND);
    let poles = resonarm_analysis::structure_poles(&arm.assembly);
    for pole in poles.into_iter().flatten() {
        let off_hz = |mode: &IdentifiedMode| (mode.pole_frequency_hz - pole.pole_frequency_hz).abs();
        let found = found.iter().min_by(|a, b| off_hz(a).total_cmp(&off_hz(b))).unwrap();
        assert!((found.pole_frequency_hz / pole.pole_frequency_hz - 1.0).abs() < 1e-7, "{found:?} {pole:?}");
        assert!((found.pole_damping_ratio / pole.pole_damping_ratio - 1.0).abs() < 1e-5, "{found:?} {pole:?}");
    }
}

/// Conditioners that differ between the head and the accelerometers change neither poles nor shapes.
#[test]
fn conditioners_that_differ_are_made_alike() {
    let arm = damped([0.0, 60.0], 10.0);
    let mut filtered = spec();
    let (head, c) = (&mut filtered.rig.head, &mut filtered.rig.sensors.c);
    (head.highpass_hz, head.delay_samples) = (Some(0.5), Some(2));
    (c.lowpass_hz, c.delay_samples) = (Some(150.0), Some(3));
    let [plain, filtered] = [spec(), filtered].map(|spec| {
        let found = identified(&recorded(&spec, &arm, force(0.0, 6.0), RANDOM).unwrap(), BAND);
        assert_eq!(found.len(), 2);
        found
    });
    for (plain, filtered) in plain.iter().zip(&filtered) {
        let off_hz = plain.pole_frequency_hz - filtered.pole_frequency_hz;
        assert!(off_hz.abs() < 3.0 * plain.pole_frequency_deviation_hz.unwrap(), "{plain:?} {filtered:?}");
        let shapes = [plain, filtered].map(|mode| mode.shape_per_sqrt_kg.clone().unwrap());
        let deviation = plain.shape_deviation_per_sqrt_kg.as_ref().unwrap();
        for ((a, b), deviation) in shapes[0].iter().zip(&shapes[1]).zip(deviation) {
            assert!((a.unwrap() - b.unwrap()).abs() < 4.0 * deviation.unwrap(), "{plain:?} {filtered:?}");
        }
    }
}

/// Far from the resonances, where a segment is long enough, H1 and H2 are the responses of the equations.
#[test]
fn averaged_responses_are_those_of_the_equations() {
    const LONG: Waveform = Waveform::Random { from_hz: 5.0, to_hz: 80.0, duration_s: 40.0, spectrum: None, seed: 3 };
    const IMPACT: Waveform = Waveform::Impulse { pulse_s: 0.008, duration_s: 30.0 };
    let far = Band { from_hz: 26.0, to_hz: 32.0 };
    let periodic =
        Waveform::Multisine { from_hz: 5.0, to_hz: 80.0, period_s: 4.0, periods: 12, phases: Phases::Random, seed: 1 };
    let cases =
        [(LONG, Averaging::Welch(4000), 19), (periodic, Averaging::Periods(4000), 10), (IMPACT, Averaging::Single, 1)];
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

/// The fitted response is that of the equations, of each accelerometer axis, though the axes were turned to the force.
#[test]
fn fitted_responses_are_those_of_the_equations() {
    let arm = damped([0.0, 60.0], 10.0);
    let record = recorded(&spec(), &arm, force(3.0, 4.0), RANDOM).unwrap();
    let found = modes(&[&record], BAND).unwrap();
    let linear = LinearResponse::new(&arm.assembly);
    let dof = |name: &str| arm.assembly.dof(name).unwrap();
    for hz in [15.0, 22.0, 30.0, 48.0, 60.0] {
        let expected = |read: &RecordedResponse| {
            let at = |drive| linear.at(Quantity::Accelerance, dof(drive), dof(&read.at), hz).unwrap();
            at("tip.x") * 0.6 + at("tip.y") * 0.8
        };
        let largest = record.responses().iter().map(|read| expected(read).norm()).fold(0.0, f64::max);
        for (response, read) in record.responses().iter().enumerate() {
            let fitted = found.fitted(0, response, hz).unwrap();
            assert!(
                (fitted - expected(read)).norm() < 5e-3 * largest + 1e-3,
                "{hz} {}: {fitted} of {largest}",
                read.at
            );
        }
    }
}

/// Strong vibration is not linear, as the residuals of all readings show: they are one doubt.
#[test]
fn strong_vibration_has_no_deviations() {
    let found = identified(&recorded(&spec(), &arm(60.0), force(0.0, 500.0), RANDOM).unwrap(), BAND);
    assert!(!found.is_empty());
    for mode in &found {
        assert!(mode.pole_frequency_deviation_hz.is_none() && mode.shape_deviation_per_sqrt_kg.is_none(), "{mode:?}");
        let above: Vec<_> = mode.doubts.iter().filter(|doubt| doubt.reason == "above-instrument").collect();
        let [doubt] = &above[..] else { panic!("{mode:?}") };
        assert!(doubt.text.contains(" other readings are above 1.5 times: the structure"), "{doubt:?}");
    }
}

#[test]
fn says_why_a_record_can_t_be_identified() {
    let short = Waveform::Random { from_hz: 5.0, to_hz: 80.0, duration_s: 0.2, spectrum: None, seed: 3 };
    let error = |record: Result<Record, IdentifyError>, band| {
        record.and_then(|record| modes(&[&record], band)).unwrap_err().to_string()
    };
    let (spec, arm) = (spec(), arm(60.0));
    insta::assert_snapshot!(error(recorded(&spec, &arm, force(0.0, 5.0), short), BAND), @"the record has 200 samples, but at least 256 are needed: record for longer");
    let random = |duration_s| Waveform::Random { from_hz: 5.0, to_hz: 80.0, duration_s, spectrum: None, seed: 3 };
    let torque = Load::torque_nm(5.0, 0.0);
    insta::assert_snapshot!(error(recorded(&spec, &arm, torque, random(2.0)), BAND), @"the impedance head reads no force beyond its own noise (0.012 N): expected an excitation by a force at the head; apply a larger one");
    let record = recorded(&spec, &arm, force(0.0, 5.0), random(10.0)).unwrap();
    insta::assert_snapshot!(error(Ok(record.clone()), Band { from_hz: 200.0, to_hz: 300.0 }), @"the force has no energy from 200 to 300 Hz: drive the structure there, or name the band that was driven");
    // Peaks of the random force are no modes.
    assert_eq!(identified(&record, Band { from_hz: 30.0, to_hz: 36.0 }), []);
    let none = IdentifyError::NoResonance(Band { from_hz: 30.0, to_hz: 36.0 });
    insta::assert_snapshot!(none, @"there is no resonance from 30 to 36 Hz: widen the band, or record for longer");
    insta::assert_snapshot!(error(Ok(record.clone()), Band { from_hz: 30.0, to_hz: 600.0 }), @"the band is from 30 to 600 Hz: it must rise, from above 0 to below half the sample rate, 1000 Hz");
    insta::assert_snapshot!(error(Ok(record.clone()), Band { from_hz: 22.0, to_hz: 22.5 }), @"the band has 6 lines, but at least 8 are needed: record for longer, or widen the band");
    insta::assert_snapshot!(frequency_response(&record, BAND, Averaging::Welch(8)).unwrap_err(), @"a segment has 8 samples: it must have from 16 to as many as the record, 10000");
    let elsewhere = recorded(&spec, &arm, force(4.0, 5.0), random(10.0)).unwrap();
    let oblique = recorded(&spec, &arm, force(5.0, 4.0), random(10.0)).unwrap();
    insta::assert_snapshot!(modes(&[&oblique, &elsewhere], BAND).unwrap_err(), @"recording 1, counted from 0, has a force along another direction at the same point: expected the same direction, or one along another axis");
}
