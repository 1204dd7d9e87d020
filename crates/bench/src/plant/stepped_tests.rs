//! A structure of one's own, against the same one of the library.

use super::tests::{SHAKER, shaken};
use super::*;
use crate::rig::Converter;
use crate::structure::{Channel, Coordinates, coordinate_channels};
use resonarm_dynamics::structure::{Assembly, Axis, BodySpec, ModalSpec, ModeSpec, ShapeSpec, StructureSpec};

const OMEGA_RAD_S: f64 = 120.0;
/// The displacement along x over the coordinate, 1/√kg.
const SHAPE: f64 = 0.5;
const STEP_S: f64 = 1e-3 / 4.0;

/// An undamped mode that moves the tip along x.
#[derive(Clone, Debug)]
struct Mode {
    channels: Vec<Channel>,
    /// Displacement q and rate q̇ of the oscillator.
    state: [f64; 2],
}

fn mode() -> Mode {
    Mode { channels: coordinate_channels(Coordinates::Modes, 1), state: [1e-3, 0.02] }
}

impl Mode {
    fn acceleration(&self, load: &Load) -> f64 {
        SHAPE * load.force_n.x - OMEGA_RAD_S * OMEGA_RAD_S * self.state[0]
    }
}

impl Stepped for Mode {
    fn states(&self) -> &[Channel] {
        &self.channels
    }

    /// The flow about the deflection that the load holds.
    fn advance(&mut self, _t_s: f64, load: &Load) -> Result<(), StructureError> {
        if load.force_n.y != 0.0 {
            return Err(StructureError::Own);
        }
        let (sine, cosine) = libm::sincos(OMEGA_RAD_S * STEP_S);
        let held = SHAPE * load.force_n.x / (OMEGA_RAD_S * OMEGA_RAD_S);
        let [x, v] = [self.state[0] - held, self.state[1]];
        self.state = [held + x * cosine + v / OMEGA_RAD_S * sine, v * cosine - x * OMEGA_RAD_S * sine];
        Ok(())
    }

    /// It moves along x of the tip, where accelerometer C is.
    fn read(&self, _t_s: f64, load: &Load, out: &mut [Kinematics]) -> Result<(), StructureError> {
        let (velocity, acceleration) = (SHAPE * self.state[1], SHAPE * self.acceleration(load));
        out[2] = Kinematics { velocity, acceleration, ..Kinematics::default() };
        Ok(())
    }

    fn travel_m(&self) -> f64 {
        SHAPE * self.state[0].abs()
    }

    fn save(&self, states: &mut [f64]) {
        states.copy_from_slice(&self.state);
    }

    fn restore(&mut self, states: &[f64]) -> Result<(), StructureError> {
        self.state.copy_from_slice(states);
        Ok(())
    }

    fn boxed_clone(&self) -> Box<dyn Stepped> {
        Box::new(self.clone())
    }
}

fn spec(converter: Converter) -> PlantSpec {
    let mut spec = PlantSpec { steps_per_sample: 4, ..shaken(SHAKER) };
    (spec.rig.shaker, spec.rig.converter) = (None, converter);
    spec
}

/// The same mode of the library.
fn modal(spec: &PlantSpec) -> Plant {
    let shape = |point: &str, by_mode: f64| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: vec![by_mode] };
    let frequency_hz = OMEGA_RAD_S / core::f64::consts::TAU;
    let modes = vec![ModeSpec { frequency_hz, damping_ratio: 0.0 }];
    let body = BodySpec::Modal(ModalSpec { modes, shapes: vec![shape("tip", SHAPE), shape("still", 0.0)] });
    let assembly = Assembly::new(&StructureSpec { body, elements: Vec::new() }).unwrap();
    let at = |name: &str| Placed { along: [Some(assembly.dof(name).unwrap()), None] };
    let places = Places {
        exciter: at("tip.x"),
        exciter_z: None,
        accelerometer_b: at("still.x"),
        accelerometer_c: at("tip.x"),
        more: vec![],
    };
    Plant::new(spec, &TestedAssembly { initial: mode().state.to_vec(), places, assembly }).unwrap()
}

#[test]
fn a_structure_of_ones_own_is_read_as_that_of_the_library() {
    for converter in Converter::ALL {
        let spec = spec(converter);
        let mut plants = [Plant::stepped(&spec, Box::new(mode())).unwrap(), modal(&spec)];
        assert_eq!(plants[0].structure().states(), plants[1].structure().states());
        for n in 0..200 {
            let load = Load::force_n(30.0 * libm::sin(0.1 * f64::from(n)), 0.0);
            let sensed = plants.each_ref().map(|plant| {
                let mut outputs = [0.0; OUTPUTS.len()];
                plant.structure().sense(&mut outputs);
                outputs
            });
            for (own, expected) in sensed[0].iter().zip(sensed[1]) {
                assert!((own - expected).abs() < 1e-9 * expected.abs().max(1.0), "{converter:?}, {n}: {sensed:?}");
            }
            assert!((plants[0].travel_m() - plants[1].travel_m()).abs() < 1e-12);
            plants.iter_mut().for_each(|plant| plant.advance(&load).unwrap());
        }
    }
}

#[test]
fn a_hold_that_fails_returns_to_its_start() {
    let mut plant = Plant::stepped(&spec(Converter::Sinc3), Box::new(mode())).unwrap();
    plant.advance(&Load::force_n(1.0, 0.0)).unwrap();
    let before = plant.save();
    let error = plant.advance(&Load::force_n(1.0, 1.0)).unwrap_err();
    insta::assert_snapshot!(error, @"sample 1: the structure's own program could not make the step");
    assert_eq!(plant.save(), before);
    let again = Plant::stepped(&spec(Converter::Sinc3), Box::new(mode())).unwrap().restored(1, &before);
    assert_eq!(again.unwrap().save(), before);
    let shaker = Plant::stepped(&shaken(SHAKER), Box::new(mode())).unwrap_err();
    insta::assert_snapshot!(shaker, @"rig.shaker needs a structure of the scenario, as its armature moves with it: leave it out here; a structure that the program makes is driven by the ideal exciter of `rig.exciter`");
}
