//! Modes found by `identify` in readings of an arm driven by an ideal exciter or a shaker, against the arm's true
//! modes: the stated deviations hold over seeds, exciters and poses.

use resonarm::excitation::{ExcitationSpec, Profile, SweepLaw, Waveform};
use resonarm::identify::{Band, Direction, Identification, IdentifiedMode, Record, RigPlaces, modes};
use resonarm::integrate::Scheme;
use resonarm::plant::{Plant, PlantSpec, TestedAssembly};
use resonarm::rig::{Amplifier, Converter, Load, RigSpec, ShakerSpec};
use resonarm::structure::{Assembly, BodySpec, Preset, StructureMode, StructureSpec};

const RATE_HZ: f64 = 1000.0;
const BAND: Band = Band { from_hz: 10.0, to_hz: 80.0 };
/// Angles of the links, degrees.
const POSES: [[f64; 2]; 3] = [[30.0, 60.0], [17.3, 101.7], [30.0, 120.0]];

/// A modal exciter for some hundred newtons, as that of `scenarios/shaker.toml`, with the inductance of a larger coil.
const LARGE: ShakerSpec = ShakerSpec {
    direction_deg: 0.0,
    amplifier: Amplifier::Voltage,
    moving_mass_kg: 0.5,
    stiffness_n_m: 2000.0,
    damping_n_s_m: 10.0,
    force_factor_n_a: 20.0,
    resistance_ohm: 2.0,
    inductance_h: 2.1e-3,
    stroke_m: 0.0127,
    current_limit_a: 15.0,
    voltage_limit_v: 60.0,
};

/// No shaker, one in current mode, in voltage mode, and that of `scenarios/bk4809.toml`.
fn exciters() -> [Option<ShakerSpec>; 4] {
    let bk4809 = ShakerSpec {
        moving_mass_kg: 0.057,
        stiffness_n_m: 9932.0,
        damping_n_s_m: 21.51,
        force_factor_n_a: 6.78,
        inductance_h: 0.0,
        stroke_m: 0.004,
        current_limit_a: 6.56,
        voltage_limit_v: 13.1,
        ..LARGE
    };
    [None, Some(ShakerSpec { amplifier: Amplifier::Current, ..LARGE }), Some(LARGE), Some(bk4809)]
}

fn identified(
    shaker: Option<ShakerSpec>,
    angles_deg: [f64; 2],
    profile: Waveform,
    force_x_n: f64,
    seed: u64,
) -> Identification {
    identified_by(Converter::default(), shaker, angles_deg, profile, force_x_n, seed)
}

fn identified_by(
    converter: Converter,
    shaker: Option<ShakerSpec>,
    angles_deg: [f64; 2],
    profile: Waveform,
    force_x_n: f64,
    seed: u64,
) -> Identification {
    let amplitude = Load::force_n(force_x_n, 0.0);
    let profile = Profile::new(&ExcitationSpec { amplitude, ramp_s: 0.0, profile }, RATE_HZ).unwrap();
    let rig = RigSpec { shaker, converter, ..RigSpec::default() };
    let spec =
        PlantSpec { scheme: Scheme::default(), sample_rate_hz: RATE_HZ, steps_per_sample: 2, rig: rig.clone(), seed };
    let tested = TestedAssembly::at_rest(arm(angles_deg), "tip", "joint2");
    let mut plant = Plant::new(&spec, &tested).unwrap();
    let readings: Vec<_> = (0..profile.samples())
        .map(|n| {
            let [hx, hy, bx, by, cx, cy] = plant.measure().readings().map(|reading| reading.within_range().unwrap());
            plant.advance(&profile.load(n)).unwrap();
            ([hx, hy], [bx, by, cx, cy])
        })
        .collect();
    let places = RigPlaces::of_structure(&tested, &rig);
    modes(&[&Record::new(RATE_HZ, &rig, &places, readings, Direction::Principal).unwrap()], BAND).unwrap()
}

/// The default preset with its links at angles, degrees.
fn arm(angles_deg: [f64; 2]) -> Assembly {
    let chain = Preset::default().chain().unwrap().at_angles_deg(&angles_deg);
    Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] }).unwrap()
}

fn random(seed: u64) -> Waveform {
    Waveform::Random { from_hz: 10.0, to_hz: 80.0, duration_s: 20.0, spectrum: None, seed }
}

/// Errors of frequency and damping over their deviations, for each mode found that states them; every one must be a mode of the
/// arm.
fn errors(found: &Identification, angles_deg: [f64; 2]) -> Vec<f64> {
    let arm = arm(angles_deg);
    let of = |mode: &IdentifiedMode| {
        let near = |of: &&StructureMode| (mode.pole_frequency_hz / of.frequency_hz - 1.0).abs() < 0.01;
        let truth = arm.modes().iter().find(near).unwrap_or_else(|| panic!("{angles_deg:?}: {mode:?}"));
        let (frequency, damping) = (mode.pole_frequency_deviation_hz?, mode.pole_damping_ratio_deviation?);
        Some([
            (mode.pole_frequency_hz - truth.frequency_hz) / frequency,
            (mode.pole_damping_ratio - truth.damping_ratio) / damping,
        ])
    };
    found.modes.iter().filter_map(of).flatten().collect()
}

/// 95.4 % of normal errors are within two deviations; their number is within three deviations of that of a binomial
/// distribution.
fn assert_honest(errors: &[f64]) {
    let within = errors.iter().filter(|error| error.abs() < 2.0).count();
    let (count, share) = (errors.len() as f64, 0.954);
    let least = count * share - 3.0 * (count * share * (1.0 - share)).sqrt();
    assert!(within as f64 >= least, "{within} of {} within two deviations", errors.len());
    assert!(errors.iter().all(|error| error.abs() < 5.0), "{errors:?}");
}

#[test]
fn deviations_hold_over_seeds_exciters_and_poses() {
    let mut all = Vec::new();
    for shaker in exciters() {
        for pose in POSES {
            for seed in 1..=4 {
                let found = identified(shaker, pose, random(seed), 6.0, seed);
                assert_eq!(found.modes.len(), 2, "{shaker:?} {pose:?} seed {seed}: {found:?}");
                all.extend(errors(&found, pose));
            }
        }
    }
    assert_honest(&all);
    // The reason for the converter's filter: instantaneous readings of a shaker's force contain images of the command. What is
    // found in them states no deviation.
    let folded = identified_by(Converter::Instant, Some(LARGE), POSES[1], random(1), 6.0, 1);
    assert!(folded.modes.iter().all(|mode| !mode.doubts.is_empty()), "{folded:?}");
}

#[test]
fn a_swept_sine_finds_both_modes_with_every_exciter() {
    let mut all = Vec::new();
    for shaker in exciters() {
        for pose in POSES {
            let swept = Waveform::SweptSine { from_hz: 10.0, to_hz: 80.0, duration_s: 20.0, law: SweepLaw::Linear };
            let found = identified(shaker, pose, swept, 6.0, 5);
            assert_eq!(found.modes.len(), 2, "{shaker:?} {pose:?}: {found:?}");
            all.extend(errors(&found, pose));
        }
    }
    assert_honest(&all);
}

/// A shaker brakes the arm, so an impact shows little of the arm's own damping. The modes found are right.
#[test]
fn an_impact_finds_what_it_can() {
    let mut all = Vec::new();
    for shaker in exciters() {
        for pose in POSES {
            let found = identified(shaker, pose, Waveform::Impulse { pulse_s: 0.008, duration_s: 30.0 }, 40.0, 3);
            all.extend(errors(&found, pose));
            for mode in arm(pose).modes() {
                let near = |hz: f64| (hz / mode.frequency_hz - 1.0).abs() < 0.05;
                let is_found = found.modes.iter().any(|found| near(found.pole_frequency_hz));
                assert!(is_found || shaker.is_some(), "{pose:?}: {found:?}");
            }
        }
    }
    assert_honest(&all);
}
