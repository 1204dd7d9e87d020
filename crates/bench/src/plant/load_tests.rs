//! Torques at every joint, and forces of the exciter in three directions.

use super::tests::{SHAKER, ideal_rig, plant, shaken};
use super::*;
use crate::structure::ChannelName;
use alloc::string::ToString;
use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ChainSpec, Link, ModalSpec, ModeSpec, ShapeSpec, Stepper, StructureSpec,
};

fn spec() -> PlantSpec {
    PlantSpec { rig: ideal_rig(), ..shaken(SHAKER) }
}

/// Three links, of which the last is bent against the others.
fn chain() -> TestedAssembly {
    let link = |length_m: f64, mass_kg: f64, angle_deg: f64| Link {
        length_m,
        mass_kg,
        centre_of_mass_m: 0.5 * length_m,
        centre_of_mass_off_m: 0.0,
        inertia_kg_m2: mass_kg * length_m * length_m / 12.0,
        angle_deg,
        stiffness_nm_rad: 2e4,
        damping_nm_s_rad: 2.0,
    };
    let links = vec![link(0.5, 8.0, 40.0), link(0.4, 5.0, -50.0), link(0.3, 2.0, 30.0)];
    let body = BodySpec::Chain(ChainSpec { links, gravity_m_s2: 0.0, unstated: Vec::new() });
    let assembly = Assembly::new(&StructureSpec { body, elements: Vec::new() }).unwrap();
    TestedAssembly::at_rest(assembly, "tip", "joint2")
}

/// Two modes that move the tip along an axis.
fn modal(axis: Axis) -> TestedAssembly {
    let mode = |frequency_hz: f64| ModeSpec { frequency_hz, damping_ratio: 0.01 };
    let shapes = vec![ShapeSpec { point: "tip".into(), axis, by_mode: vec![0.5, -0.3] }];
    let body = BodySpec::Modal(ModalSpec { modes: vec![mode(20.0), mode(70.0)], shapes });
    let assembly = Assembly::new(&StructureSpec { body, elements: Vec::new() }).unwrap();
    TestedAssembly::at_rest(assembly, "tip", "tip")
}

fn inputs(plant: &Plant) -> Vec<ChannelName> {
    plant.inputs().channels().iter().map(|channel| channel.name).collect()
}

/// The plant moves as the structure does in steps under a torque at the same joint.
#[test]
fn a_torque_acts_at_the_last_joint_of_a_chain() {
    let (spec, tested) = (spec(), chain());
    let mut plant = Plant::new(&spec, &tested).unwrap();
    assert_eq!(inputs(&plant), ["torque1_nm", "torque2_nm", "torque3_nm", "force_x_n", "force_y_n"]);
    let rate_hz = spec.sample_rate_hz * f64::from(spec.steps_per_sample);
    let last = tested.assembly.dof("joint3").unwrap();
    let mut stepper = Stepper::new(&tested.assembly, &[last], spec.scheme, rate_hz).unwrap();
    for sample in 0..200_u32 {
        let torque_nm = 40.0 * libm::sin(0.12 * f64::from(sample));
        plant.advance(&Load::at_joint(2, torque_nm)).unwrap();
        for step in 0..spec.steps_per_sample {
            stepper.advance(f64::from(sample) / 1e3 + f64::from(step) / rate_hz, &[torque_nm]).unwrap();
        }
        for (got, expected) in plant.states().iter().zip(stepper.position()) {
            assert!((got - expected).abs() < 1e-12, "sample {sample}: {got} against {expected}");
        }
    }
    assert!(plant.states()[2].abs() > 1e-5, "{:?}", plant.states());
}

/// A structure that moves along z does under a force along z what one that moves along x does under one along x.
#[test]
fn the_exciter_pushes_along_z() {
    let [mut along_x, mut along_z] = [Axis::X, Axis::Z].map(|axis| Plant::new(&spec(), &modal(axis)).unwrap());
    assert_eq!(inputs(&along_z), ["torque1_nm", "torque2_nm", "force_x_n", "force_y_n", "force_z_n"]);
    for sample in 0..200 {
        let force_n = 30.0 * libm::sin(0.12 * f64::from(sample));
        along_x.advance(&Load::force_n(force_n, 0.0)).unwrap();
        let force_n = nalgebra::Vector3::new(0.0, 0.0, force_n);
        along_z.advance(&Load { force_n, ..Load::default() }).unwrap();
        assert_eq!(along_x.states(), along_z.states(), "sample {sample}");
        assert_eq!(along_x.travel_m(), along_z.travel_m(), "sample {sample}");
    }
    assert!(along_z.travel_m() > 1e-5, "{along_z:?}");
}

#[test]
fn a_load_that_nothing_takes_is_refused_and_the_plant_stays() {
    let says = |plant: &mut Plant, load: &Load| {
        let before = *plant.states();
        let refused = plant.advance(load).unwrap_err().to_string();
        assert_eq!((plant.sample(), *plant.states()), (0, before));
        refused
    };
    let along_z = Load { force_n: nalgebra::Vector3::new(0.0, 0.0, 1.0), ..Load::default() };
    for mut arm in [plant(&spec()), plant(&shaken(SHAKER))] {
        insta::allow_duplicates! {
            insta::assert_snapshot!(says(&mut arm, &Load::at_joint(2, 5.0)), @"sample 0: torque3_nm is 5: nothing of the structure takes this load; command 0, or place the exciter elsewhere");
            insta::assert_snapshot!(says(&mut arm, &along_z), @"sample 0: force_z_n is 1: nothing of the structure takes this load; command 0, or place the exciter elsewhere");
        }
    }
    let mut plate = Plant::new(&spec(), &modal(Axis::Z)).unwrap();
    insta::assert_snapshot!(says(&mut plate, &Load::force_n(2.0, 0.0)), @"sample 0: force_x_n is 2: nothing of the structure takes this load; command 0, or place the exciter elsewhere");
    let nan = Load { force_n: nalgebra::Vector3::new(0.0, 0.0, f64::NAN), ..Load::default() };
    assert!(plate.exciter().can_produce(&along_z) && !plate.exciter().can_produce(&nan));
    assert!(!plate.exciter().can_produce(&Load::at_joint(7, 1e6)));
}

#[test]
fn a_set_of_loads_has_them_in_the_order_of_the_table() {
    let set = LoadSet::native_and([10, 2]);
    assert_eq!((set.len(), set.has(2), set.has(3), set.has_native()), (6, true, false, true));
    assert_eq!(LoadSet::of_channels(&set.channels()), Some(set));
    let backwards: Vec<_> = set.channels().into_iter().rev().collect();
    assert_eq!(LoadSet::of_channels(&backwards), None);
    let load = set.load([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(load.parts(), [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 5.0, 6.0]);
    assert_eq!(set.parts(&load).collect::<Vec<_>>(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!((set.lacks(&load), LoadSet::NATIVE.lacks(&load)), (None, Some((2, 3.0))));
}
