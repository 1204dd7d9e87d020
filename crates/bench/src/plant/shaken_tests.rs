//! A shaker on structures of a scenario, against closed forms.

use super::tests::{SHAKER, shaken};
use super::*;
use crate::excitation::{HarmonicFit, Phasor};
use crate::rig::{Amplifier, Converter, ShakerSpec};
use crate::structure::Channel;
use core::f64::consts::TAU;
use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, StructureSpec,
};

/// Modes at 20 and 57 Hz that move `tip` and `mid` along x and y.
pub(crate) fn modal(elements: Vec<ElementSpec>) -> TestedAssembly {
    let mode = |frequency_hz| ModeSpec { frequency_hz, damping_ratio: 0.01 };
    let shape = |point: &str, axis, of: [f64; 2]| ShapeSpec { point: point.into(), axis, by_mode: of.into() };
    let (x, y) = (Axis::X, Axis::Y);
    let shapes = vec![
        shape("tip", x, [0.5, -0.4]),
        shape("tip", y, [0.2, 0.3]),
        shape("mid", x, [0.3, 0.35]),
        shape("mid", y, [0.1, -0.2]),
    ];
    let body = BodySpec::Modal(ModalSpec { modes: vec![mode(20.0), mode(57.0)], shapes });
    TestedAssembly::at_rest(Assembly::new(&StructureSpec { body, elements }).unwrap(), "tip", "mid")
}

fn voltage(inductance_h: f64) -> ShakerSpec {
    ShakerSpec { amplifier: Amplifier::Voltage, inductance_h, ..SHAKER }
}

fn shakers() -> [ShakerSpec; 3] {
    [SHAKER, voltage(0.0), voltage(3e-4)]
}

fn sensed(plant: &Plant) -> [f64; OUTPUTS.len()] {
    let mut outputs = [0.0; OUTPUTS.len()];
    plant.structure().sense(&mut outputs);
    outputs
}

fn along(force_n: f64) -> Load {
    Load::planar([0.0; 2], (SHAKER.direction() * force_n).into())
}

/// a_C along the shaker over the head's force is −ω²R of the structure alone, R = Σ (e·φ)²/(ω₀² − ω² + 2iζω₀ω), and the
/// head's force over the command 1/(1 + R (k − ω²m + iωc)) of the coil's.
#[test]
fn head_and_point_are_those_of_the_closed_form() {
    const FREQUENCY_HZ: f64 = 25.0;
    const DAMPING_N_S_M: f64 = 60.0;
    let omega = TAU * FREQUENCY_HZ;
    let tested = modal(Vec::new());
    let e = SHAKER.direction();
    let receptance: Phasor = [(20.0, [0.5, 0.2]), (57.0, [-0.4, 0.3])]
        .map(|(own_hz, [x, y])| {
            let (own, along) = (TAU * own_hz, e.x * x + e.y * y);
            Phasor::new(along * along, 0.0) / Phasor::new(own * own - omega * omega, 0.02 * own * omega)
        })
        .iter()
        .sum();
    let armature = Phasor::new(SHAKER.stiffness_n_m - omega * omega * SHAKER.moving_mass_kg, omega * DAMPING_N_S_M);
    for shaker in [SHAKER, voltage(3e-4)].map(|of| ShakerSpec { damping_n_s_m: DAMPING_N_S_M, ..of }) {
        let mut spec = PlantSpec { sample_rate_hz: 4000.0, ..shaken(shaker) };
        spec.rig.converter = Converter::Sinc5;
        let mut plant = Plant::new(&spec, &tested).unwrap();
        let mut fit = HarmonicFit::<2, 3>::new(4000);
        for n in 0..24_000_u64 {
            let cycles = FREQUENCY_HZ * n as f64 / spec.sample_rate_hz;
            if n >= 20_000 {
                let [hx, hy, _, _, cx, cy] = sensed(&plant);
                let cycles = cycles - libm::floor(cycles);
                fit.add(n - 20_000, cycles, &[Some(e.x * hx + e.y * hy), Some(e.x * cx + e.y * cy)]);
            }
            plant.advance(&along(libm::sin(TAU * cycles))).unwrap();
        }
        let [[head, ..], [point, ..]] = fit.harmonics::<1>().unwrap();
        let (ratio, expected) = (point / head, receptance * (-omega * omega));
        assert!((ratio - expected).norm_sqr() < 1e-10 * expected.norm_sqr(), "{shaker:?}: {ratio} {expected}");
        if shaker.amplifier == Amplifier::Current {
            let expected = Phasor::new(1.0, 0.0) / (Phasor::new(1.0, 0.0) + receptance * armature);
            let share = libm::sqrt(head.norm_sqr() / expected.norm_sqr()) / gain(&spec, FREQUENCY_HZ);
            assert!((share - 1.0).abs() < 1e-5, "{head} {expected}");
        }
    }
}

/// What converter and hold leave of a sine.
fn gain(spec: &PlantSpec, frequency_hz: f64) -> f64 {
    let sampling = crate::rig::Sampling { rate_hz: spec.sample_rate_hz, converter: spec.rig.converter };
    sampling.gain(frequency_hz) * sampling.hold(frequency_hz)
}

#[test]
fn a_saved_shaken_structure_continues_with_the_same_bits() {
    let at = Place::Dof { point: "mid".into(), axis: Axis::X };
    let friction = ElementSpec::Point { at, to: None, law: Law::Friction { stiffness: 1e5, slip: 3.0 } };
    for tested in [modal(Vec::new()), modal(vec![friction])] {
        for (shaker, converter) in shakers().into_iter().flat_map(|of| Converter::ALL.map(|converter| (of, converter)))
        {
            let mut spec = shaken(shaker);
            spec.rig.converter = converter;
            let mut plant = Plant::new(&spec, &tested).unwrap();
            let load = |n: u64| along(20.0 * libm::sin(0.14 * n as f64));
            (0..30).for_each(|n| plant.advance(&load(n)).unwrap());
            let mut restored = [
                Plant::new(&spec, &tested).unwrap().restored(30, &plant.save()).unwrap(),
                Plant::new(&spec, &tested).unwrap().at(30, plant.states()).unwrap(),
            ];
            for n in 30..50 {
                plant.advance(&load(n)).unwrap();
                restored.iter_mut().for_each(|plant| plant.advance(&load(n)).unwrap());
                assert_eq!(restored[0].save(), plant.save(), "{shaker:?}, {converter:?}");
                assert_eq!(*restored[1].states(), *plant.states());
            }
            let names: Vec<&str> =
                plant.structure().states().iter().map(|channel: &Channel| channel.name.as_str()).collect();
            assert_eq!(names[4], "coil_current_a");
        }
    }
}

#[test]
fn trips_at_its_limits_on_modes() {
    let trips = |shaker: ShakerSpec| {
        let mut plant = Plant::new(&shaken(shaker), &modal(Vec::new())).unwrap();
        loop {
            let before = plant.save();
            if let Err(error) = plant.advance(&along(60.0)) {
                assert_eq!(plant.save(), before);
                return error.to_string();
            }
            assert!(plant.sample() < 1000);
        }
    };
    insta::assert_snapshot!(trips(ShakerSpec { stroke_m: 1e-4, ..SHAKER }), @"sample 3: the shaker trips: the armature's displacement would be 0.000118 m, and 0.0001 m is its limit (`rig.shaker.stroke_m`): drive less, or take a larger shaker");
    insta::assert_snapshot!(trips(ShakerSpec { current_limit_a: 1.0, ..voltage(3e-4) }), @"sample 0: the shaker trips: the current would be 2.890113 A, and 1 A is its limit (`rig.shaker.current_limit_a`): drive less, or take a larger shaker");
    insta::assert_snapshot!(trips(ShakerSpec { voltage_limit_v: 7.0, ..SHAKER }), @"sample 3: the shaker trips: the amplifier's voltage would be 7.143527 V, and 7 V is its limit (`rig.shaker.voltage_limit_v`): drive less, or take a larger shaker");
}

#[test]
fn says_where_a_shaker_cannot_push() {
    let mut across = modal(Vec::new());
    across.places.exciter.along[1] = None;
    let says =
        |shaker: ShakerSpec, tested: &TestedAssembly| Plant::new(&shaken(shaker), tested).unwrap_err().to_string();
    insta::assert_snapshot!(says(SHAKER, &across), @"rig.shaker: `direction_deg` is 30, and the structure does not move along y where the exciter is: turn it along an axis that moves, or place it by `rig.exciter.at`");
    assert!(Plant::new(&shaken(ShakerSpec { direction_deg: 180.0, ..SHAKER }), &across).is_ok());
    insta::assert_snapshot!(says(voltage(0.1), &modal(Vec::new())), @"rig.shaker: `inductance_h` is 0.1: at this resistance and step in voltage mode it must be at most 0.01");
}
