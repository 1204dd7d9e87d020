//! The plant, sample by sample, with an ideal exciter and with a shaker.

use super::*;
use crate::excitation::{HarmonicFit, Phasor};
use crate::rig::{Amplifier, Converter, Measured, SensorSpec, SensorSpecs, ShakerSpec};
use nalgebra::Vector2;
use resonarm_analysis::LinearResponse;
use resonarm_analysis::Quantity;
use resonarm_dynamics::structure::{Assembly, BodySpec, ChainSpec, Preset, StructureSpec};

/// A chain of two links at rest, with the exciter at its tip and accelerometers at its elbow and its tip.
pub(crate) fn tested(chain: ChainSpec) -> TestedAssembly {
    let spec = StructureSpec { body: BodySpec::Chain(chain), elements: vec![] };
    TestedAssembly::at_rest(Assembly::new(&spec).unwrap(), "tip", "joint2")
}

/// The default preset with its links at angles, degrees.
pub(crate) fn preset(angles_deg: [f64; 2]) -> TestedAssembly {
    damped(angles_deg, 1.0)
}

/// The same with the dampers of its joints times a factor.
pub(crate) fn damped(angles_deg: [f64; 2], factor: f64) -> TestedAssembly {
    let mut chain = Preset::default().chain().unwrap().at_angles_deg(&angles_deg);
    chain.links.iter_mut().for_each(|link| link.damping_nm_s_rad *= factor);
    tested(chain)
}

pub(super) const ANGLES_DEG: [f64; 2] = [20.0, 60.0];

/// A plant of the preset that begins with these angles, rad, and rates, rad/s.
fn plant_from(spec: &PlantSpec, initial: [f64; 4]) -> Plant {
    Plant::new(spec, &TestedAssembly { initial: initial.into(), ..preset(ANGLES_DEG) }).unwrap()
}

/// The same at rest.
pub(super) fn plant(spec: &PlantSpec) -> Plant {
    plant_from(spec, [0.0; 4])
}

/// Returns the Euclidean norm of some numbers.
fn norm(numbers: &[f64]) -> f64 {
    numbers.iter().map(|number| number * number).sum::<f64>().sqrt()
}

fn spec() -> PlantSpec {
    PlantSpec {
        scheme: Scheme::default(),
        sample_rate_hz: 1000.0,
        steps_per_sample: 4,
        rig: RigSpec::default(),
        seed: 1,
    }
}

#[test]
fn same_commands_give_the_same_bits() {
    let [mut a, mut b] = [(); 2].map(|()| plant(&spec()));
    for k in 0..500_u32 {
        assert_eq!(a.measure(), b.measure());
        let load = Load::force_n(f64::from(k % 17) - 8.0, 3.0);
        a.advance(&load).unwrap();
        b.advance(&load).unwrap();
        assert_eq!(a.states(), b.states());
    }
    assert_eq!(a.sample(), 500);
    assert!(norm(a.states().coordinates()) > 1e-6);
}

#[test]
fn at_rest_the_instruments_read_the_held_force() {
    let mut plant = plant(&spec());
    for _ in 0..5 {
        plant.advance(&Load::force_n(50.0, -20.0)).unwrap();
    }
    let head = plant.measure().head_force_n;
    assert!((head[0].value - 50.0).abs() < 0.1 && (head[1].value + 20.0).abs() < 0.1, "{head:?}");
}

#[test]
fn the_travel_is_that_of_the_tip_and_of_a_shaker_its_armature() {
    assert_eq!(plant(&spec()).travel_m(), 0.0);
    let away = [-0.2, 0.0, 5.0, 0.0];
    let plant = plant_from(&spec(), away);
    // The chord of an arc about joint A.
    let assembly = preset(ANGLES_DEG).assembly;
    let radius_m = norm(&assembly.rest_m().unwrap()[2]);
    assert!((plant.travel_m() - 2.0 * radius_m * libm::sin(0.1)).abs() < 1e-12);

    let shaken = plant_from(&shaken(SHAKER), away);
    let moved_m = ["tip.x", "tip.y"].map(|name| assembly.displacement(assembly.dof(name).unwrap(), &away[..2]));
    let moved_m = Vector2::from(moved_m);
    assert!((shaken.travel_m() - SHAKER.direction().dot(&moved_m).abs()).abs() < 1e-12 && shaken.travel_m() > 0.0);
}

#[test]
fn a_step_that_fails_changes_nothing() {
    let mut plant = plant(&spec());
    plant.advance(&Load::force_n(1.0, 1.0)).unwrap();
    let before = *plant.states();
    let error = plant.advance(&Load::torque_nm(f64::MAX, f64::MAX)).unwrap_err();
    assert!(matches!(error, PlantError::Integrate { sample: 1, .. }), "{error}");
    assert_eq!((plant.sample(), *plant.states()), (1, before));
}

#[test]
fn says_what_is_wrong_with_a_plant() {
    let says = |spec: PlantSpec| Plant::new(&spec, &preset(ANGLES_DEG)).unwrap_err().to_string();
    insta::assert_snapshot!(says(PlantSpec { steps_per_sample: 0, ..spec() }), @"`steps_per_sample` is 0: it must be even, since the instruments sample in the middle, and from 2 to 1000");
    insta::assert_snapshot!(says(PlantSpec { steps_per_sample: 5, ..spec() }), @"`steps_per_sample` is 5: it must be even, since the instruments sample in the middle, and from 2 to 1000");
    insta::assert_snapshot!(says(PlantSpec { steps_per_sample: 1002, ..spec() }), @"`steps_per_sample` is 1002: it must be even, since the instruments sample in the middle, and from 2 to 1000");
    assert!(Plant::new(&PlantSpec { steps_per_sample: MOST_STEPS_PER_SAMPLE, ..spec() }, &preset(ANGLES_DEG)).is_ok());
    let lost = TestedAssembly { initial: vec![0.0, f64::NAN, 0.0, 1.0], ..preset(ANGLES_DEG) };
    insta::assert_snapshot!(Plant::new(&spec(), &lost).unwrap_err(), @"the initial state [0.0, NaN, 0.0, 1.0] is not finite: give finite numbers, coordinates before rates");
    insta::assert_snapshot!(says(PlantSpec { sample_rate_hz: 0.0, ..spec() }), @"the integration rate is 0 Hz: it must be a positive number");
}

/// A shaker of the size of a modal exciter for some hundred newtons.
pub(super) const SHAKER: ShakerSpec = ShakerSpec {
    direction_deg: 30.0,
    amplifier: Amplifier::Current,
    moving_mass_kg: 0.8,
    stiffness_n_m: 5e3,
    damping_n_s_m: 10.0,
    force_factor_n_a: 20.0,
    resistance_ohm: 2.0,
    inductance_h: 3e-4,
    stroke_m: 0.02,
    current_limit_a: 15.0,
    voltage_limit_v: 60.0,
};

/// A rig of instruments without noise and counts.
pub(crate) fn ideal_rig() -> RigSpec {
    let ideal = |measures| SensorSpec { noise_rms: Some(0.0), resolution: Some(0.0), ..SensorSpec::of(measures) };
    let (head, accelerometer) = (ideal(Measured::Force), ideal(Measured::Acceleration));
    RigSpec {
        head,
        sensors: SensorSpecs { b: accelerometer, c: accelerometer, ..SensorSpecs::default() },
        ..RigSpec::default()
    }
}

/// A plant with a shaker and instruments without noise and resolution.
pub(super) fn shaken(shaker: ShakerSpec) -> PlantSpec {
    let rig = RigSpec { shaker: Some(shaker), ..ideal_rig() };
    PlantSpec { rig, ..spec() }
}

fn sine(n: u64, frequency_hz: f64, force_n: f64) -> Load {
    let phase_rad = core::f64::consts::TAU * frequency_hz * n as f64 / 1000.0;
    let force = SHAKER.direction() * (force_n * libm::sin(phase_rad));
    Load::planar([0.0; 2], force.into())
}

fn states(spec: &PlantSpec, samples: u64) -> States {
    let mut plant = plant(spec);
    for n in 0..samples {
        plant.advance(&sine(n, 21.0, 80.0)).unwrap();
    }
    *plant.states()
}

/// How far two states are apart, rad, with rates divided by an angular frequency of 141 rad/s.
fn distance(a: &States, b: &States) -> f64 {
    let apart = |a: &[f64], b: &[f64]| norm(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>());
    libm::hypot(apart(a.coordinates(), b.coordinates()), apart(a.rates(), b.rates()) * 5e-5_f64.sqrt())
}

#[test]
fn a_shaker_without_mass_is_the_ideal_exciter() {
    let nothing = ShakerSpec { moving_mass_kg: 0.0, stiffness_n_m: 0.0, damping_n_s_m: 0.0, ..SHAKER };
    let ideal = PlantSpec { rig: RigSpec { shaker: None, ..shaken(nothing).rig }, ..spec() };
    let [mut with, mut without] = [shaken(nothing), ideal].map(|spec| plant(&spec));
    for n in 0..500 {
        let (a, b) = (with.measure(), without.measure());
        for (a, b) in a.readings().iter().zip(&b.readings()) {
            assert!((a.value - b.value).abs() < 1e-9 * (1.0 + a.value.abs()), "{n}: {a:?} {b:?}");
        }
        with.advance(&sine(n, 21.0, 80.0)).unwrap();
        without.advance(&sine(n, 21.0, 80.0)).unwrap();
    }
    let [with, without] = [with, without].map(|plant| *plant.states());
    assert!(distance(&with, &without) < 1e-10 && norm(without.coordinates()) > 1e-4);
}

fn size(phasor: Phasor) -> f64 {
    libm::hypot(phasor.re, phasor.im)
}

/// Force in the head and acceleration of the tip by linear theory, against the command's phase: with the tip's
/// receptance G along the shaker and Z = k − mω² + iωc, s = G H, H = Bl i − Z s and, at a voltage V, (R + iωL) i = V −
/// iω Bl s.
fn theory(shaker: &ShakerSpec, frequency_hz: f64, force_n: f64) -> (Phasor, Phasor) {
    let assembly = preset(ANGLES_DEG).assembly;
    let linear = LinearResponse::new(&assembly);
    let omega = core::f64::consts::TAU * frequency_hz;
    let tip = ["tip.x", "tip.y"].map(|name| assembly.dof(name).unwrap());
    let along = shaker.direction();
    let g = (0..4).fold(Phasor::new(0.0, 0.0), |g, n| {
        let receptance = linear.at(Quantity::Receptance, tip[n / 2], tip[n % 2], frequency_hz).unwrap();
        g + receptance * (along[n / 2] * along[n % 2])
    });
    let z = Phasor::new(shaker.stiffness_n_m - shaker.moving_mass_kg * omega * omega, omega * shaker.damping_n_s_m);
    let one = Phasor::new(1.0, 0.0);
    let push = match shaker.amplifier {
        Amplifier::Current => Phasor::new(force_n, 0.0),
        Amplifier::Voltage => {
            let (bl, r) = (shaker.force_factor_n_a, shaker.resistance_ohm);
            let impedance = Phasor::new(r, omega * shaker.inductance_h);
            // s = G Bl i/(1 + G Z).
            let motional = Phasor::new(0.0, omega * bl * bl) * g / (one + g * z);
            Phasor::new(force_n * r, 0.0) / (impedance + motional)
        }
    };
    let head = push / (one + g * z);
    (head, -(g * head) * (omega * omega))
}

/// In voltage mode the coil damps the arm so much that it settles within seconds. Readings are those of the continuous
/// motion, through the converter's gain and delay: near the resonance, where the coil's force is many times that in the
/// head, instantaneous readings contain its steps as well.
#[test]
fn head_and_tip_are_those_of_linear_theory() {
    let shaker = ShakerSpec { amplifier: Amplifier::Voltage, ..SHAKER };
    for (converter, bound) in [(Converter::Sinc5, 1e-4), (Converter::Sinc3, 1e-4), (Converter::Sinc1, 2e-2)] {
        for frequency_hz in [15.0, 21.8, 22.4, 30.0] {
            let rig = RigSpec { converter, ..shaken(shaker).rig };
            let mut plant = plant(&PlantSpec { rig, ..shaken(shaker) });
            let (from, to) = (14_000, 16_000);
            let mut fit = HarmonicFit::<3, 3>::new(to - from);
            for n in 0..to {
                if n >= from {
                    let sample = plant.measure();
                    let [head_x, head_y, _, _, tip_x, tip_y] = sample.readings().map(|reading| reading.value);
                    let along = |x: f64, y: f64| SHAKER.direction().dot(&Vector2::new(x, y));
                    // A sine held from sample to sample lags by half a period.
                    let phase = frequency_hz * (n as f64 - converter.delay_samples() - 0.5) / 1000.0;
                    let across = head_y * SHAKER.direction().x - head_x * SHAKER.direction().y;
                    fit.add(
                        n - from,
                        phase - libm::floor(phase),
                        &[Some(along(head_x, head_y)), Some(along(tip_x, tip_y)), Some(across)],
                    );
                }
                plant.advance(&sine(n, frequency_hz, 0.5)).unwrap();
            }
            let harmonics: [[Phasor; 1]; 3] = fit.harmonics().unwrap();
            let x = core::f64::consts::PI * frequency_hz / 1000.0;
            let (head, tip) = theory(&shaker, frequency_hz, 0.5 * libm::sin(x) / x);
            let gain = converter.gain(frequency_hz / 1000.0);
            for (seen, expected) in [(harmonics[0][0], head), (harmonics[1][0], tip)] {
                let off = size(seen / gain - expected) / size(expected);
                assert!(off < bound, "{converter:?} {frequency_hz}: {off}");
            }
            assert!(size(harmonics[2][0]) < 1e-12);
        }
    }
}

/// At the resonance of the arm alone, where little force is needed, most of the coil's force moves the armature.
#[test]
fn the_force_drops_out_at_the_resonance() {
    let natural_hz = preset(ANGLES_DEG).assembly.modes()[0].frequency_hz;
    let off = size(theory(&SHAKER, natural_hz - 3.0, 1.0).0);
    let on = size(theory(&SHAKER, natural_hz, 1.0).0);
    assert!(off > 0.5 && on < 0.1 * off, "{off} {on}");
}

#[test]
fn every_scheme_carries_a_shaker() {
    for amplifier in [Amplifier::Current, Amplifier::Voltage] {
        let fine = states(&PlantSpec { steps_per_sample: 32, ..shaken(ShakerSpec { amplifier, ..SHAKER }) }, 300);
        let size_rad = norm(fine.coordinates());
        assert!(size_rad > 1e-4);
        for scheme in Scheme::ALL {
            let coarse = states(&PlantSpec { scheme, ..shaken(ShakerSpec { amplifier, ..SHAKER }) }, 300);
            let limit = if scheme.order() == 4 { 1e-4 } else { 1e-5 };
            assert!(distance(&coarse, &fine) < limit * size_rad, "{scheme} {amplifier:?}: {coarse:?} {fine:?}");
        }
    }
}

/// The coil is coupled to the order of the velocity's polynomial.
#[test]
fn a_shaker_in_voltage_mode_converges_with_the_fifth_order() {
    let shaker = ShakerSpec { amplifier: Amplifier::Voltage, inductance_h: 5e-3, ..SHAKER };
    let at = |steps_per_sample| {
        let spec = PlantSpec { sample_rate_hz: 100.0, steps_per_sample, ..shaken(shaker) };
        states(&spec, 30)
    };
    let exact = at(64);
    let errors = [4, 8, 16].map(|steps| distance(&at(steps), &exact));
    assert!(errors[0] > 24.0 * errors[1] && errors[1] > 24.0 * errors[2], "{errors:?}");
}

/// In voltage mode the coil brakes the arm so much that within a minute first its energy and then its current
/// underflows.
#[test]
fn an_arm_whose_motion_dies_out_under_its_shaker_keeps_running() {
    let shaker = ShakerSpec { amplifier: Amplifier::Voltage, resistance_ohm: 2.0, ..SHAKER };
    for exponent in [150, 155, 158, 160, 162, 200, 300, 306, 308, 310, 312, 315] {
        let small = libm::exp10(-f64::from(exponent));
        let mut plant = plant_from(&shaken(shaker), [small, -small, 0.0, 0.0]);
        for _ in 0..300 {
            plant.advance(&Load::default()).unwrap();
        }
        assert!(norm(plant.states().coordinates()) < 10.0 * small, "{small}");
    }
}

#[test]
fn a_shaker_trips_at_its_limits() {
    let trips = |shaker: ShakerSpec| {
        let mut plant = plant(&shaken(shaker));
        for n in 0..4000 {
            let before = *plant.states();
            if let Err(error) = plant.advance(&sine(n, 22.0, 100.0)) {
                assert_eq!(*plant.states(), before);
                return error.to_string();
            }
        }
        panic!("no trip");
    };
    insta::assert_snapshot!(trips(ShakerSpec { stroke_m: 0.002, ..SHAKER }), @"sample 361: the shaker trips: the armature's displacement would be 0.002026 m, and 0.002 m is its limit (`rig.shaker.stroke_m`): drive less, or take a larger shaker");
    insta::assert_snapshot!(trips(ShakerSpec { voltage_limit_v: 10.5, ..SHAKER }), @"sample 11: the shaker trips: the amplifier's voltage would be 10.512061 V, and 10.5 V is its limit (`rig.shaker.voltage_limit_v`): drive less, or take a larger shaker");
    let weak = ShakerSpec { amplifier: Amplifier::Voltage, current_limit_a: 3.0, ..SHAKER };
    insta::assert_snapshot!(trips(weak), @"sample 5: the shaker trips: the current would be 3.032735 A, and 3 A is its limit (`rig.shaker.current_limit_a`): drive less, or take a larger shaker");
}

#[test]
fn says_what_is_wrong_with_a_shaker() {
    let says = |shaker: ShakerSpec| Plant::new(&shaken(shaker), &preset(ANGLES_DEG)).unwrap_err().to_string();
    insta::assert_snapshot!(says(ShakerSpec { force_factor_n_a: 0.0, ..SHAKER }), @"rig.shaker: `force_factor_n_a` is 0: it must be a positive number");
    insta::assert_snapshot!(says(ShakerSpec { moving_mass_kg: -1.0, ..SHAKER }), @"rig.shaker: `moving_mass_kg` is -1: it must be zero or a positive number");
    let slow = ShakerSpec { amplifier: Amplifier::Voltage, inductance_h: 0.1, ..SHAKER };
    insta::assert_snapshot!(says(slow), @"rig.shaker: `inductance_h` is 0.1: at this resistance and step in voltage mode it must be at most 0.01");
    assert!(Plant::new(&shaken(ShakerSpec { amplifier: Amplifier::Current, ..slow }), &preset(ANGLES_DEG)).is_ok());
}

#[test]
fn a_shaker_takes_forces_along_itself_and_within_its_limits() {
    let along = |force_n: f64| Load::planar([0.0; 2], (SHAKER.direction() * force_n).into());
    assert!(SHAKER.can_produce(&along(300.0)) && !SHAKER.can_produce(&along(300.1)));
    // As the wire rounds it.
    assert!(SHAKER.can_produce(&Load::force_n(8.66, 5.0)) && !SHAKER.can_produce(&Load::force_n(8.66, 5.2)));
    assert!(!SHAKER.can_produce(&Load::torque_nm(1.0, 0.0)));
    let weak = ShakerSpec { amplifier: Amplifier::Voltage, voltage_limit_v: 10.0, ..SHAKER };
    assert_eq!(weak.force_limit_n(), 100.0);
}
