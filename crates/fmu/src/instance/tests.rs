use super::*;
use crate::content::{Settings, token};
use crate::variables::{Causality, Kind};
use resonarm_scenario::Scenario;

/// An instance of an FMU of this scenario, with its folder.
fn made(text: &str) -> (tempfile::TempDir, Instance) {
    let folder = tempfile::tempdir().unwrap();
    let content = Content { settings: Settings::default(), scenario: Scenario::parse(text, "here").unwrap() };
    let files = content.files().unwrap();
    files.iter().for_each(|(name, data)| std::fs::write(folder.path().join(name), data).unwrap());
    let instance = Instance::new(folder.path(), &token(&files), true).unwrap();
    (folder, instance)
}

/// The value references of the variables with these names.
fn of(instance: &Instance, name: &str) -> u32 {
    instance.variables.iter().position(|variable| variable.name == name).unwrap() as u32
}

fn started(instance: &mut Instance, start_s: f64) {
    instance.enter_initialization(start_s).unwrap();
    instance.exit_initialization().unwrap();
    assert!(!instance.update_discrete_states().unwrap());
    instance.enter_step().unwrap();
}

fn outputs(instance: &mut Instance) -> Vec<u64> {
    let of_type = |variable: &Variable| variable.causality == Causality::Output && variable.kind == Kind::Float64;
    let references: Vec<usize> = (0..instance.variables.len()).filter(|at| of_type(&instance.variables[*at])).collect();
    references.into_iter().map(|at| instance.float64(at as u32).unwrap().to_bits()).collect()
}

#[test]
fn samples_fall_at_their_times_in_steps_that_are_added_up() {
    let (_folder, mut instance) = made("simulation.rate_hz = 100");
    let sample = of(&instance, "sample");
    started(&mut instance, 0.1);
    // 0.01 s is no binary fraction: times that are added up are off by rounding.
    let mut time_s = 0.1;
    // 30 s, in which the sum of the steps drifts by some 1e-13 s: far less than `TOLERANCE_SAMPLES`.
    for step in 1..=3_000_u64 {
        instance.step(time_s, 0.01).unwrap();
        time_s += 0.01;
        assert_eq!(instance.uint64(sample).unwrap(), step);
    }
    assert!(time_s != 30.1);
}

#[test]
fn the_load_is_the_one_that_was_set_when_the_hold_began() {
    let (_folder, mut instance) = made("");
    let (_other, mut whole) = made("");
    let force = of(&instance, "load.force_x_n");
    [&mut instance, &mut whole].into_iter().for_each(|instance| started(instance, 0.0));
    for sample in 0..20_u32 {
        let (at_s, force_n) = (f64::from(sample) * 1e-3, f64::from(sample % 7));
        for one in [&mut instance, &mut whole] {
            one.set(force, Value::Float64(force_n)).unwrap();
        }
        whole.step(at_s, 1e-3).unwrap();
        // One sample in two steps: the load that is set between them must not act before the next sample.
        instance.step(at_s, 0.4e-3).unwrap();
        instance.set(force, Value::Float64(-5.0)).unwrap();
        instance.step(at_s + 0.4e-3, 0.6e-3).unwrap();
        assert_eq!(outputs(&mut instance), outputs(&mut whole));
    }
}

/// A chain of three links has an input at its last joint, and a structure that moves along z one along z.
#[test]
fn an_fmu_has_inputs_for_all_loads_that_its_structure_takes() {
    let link = "{ length_m = 0.3, mass_kg = 2.0, centre_of_mass_m = 0.1, inertia_kg_m2 = 0.02, angle_deg = 30, stiffness_nm_rad = 1e4, damping_nm_s_rad = 2.0 }";
    let chain = format!("structure = {{ kind = 'chain', links = [{link}, {link}, {link}] }}");
    let plate = "[structure]\nkind = 'modal'\n\
        modes = [{ frequency_hz = 20, damping_ratio = 0.01, shape = { 'tip.x' = 0.5, 'tip.z' = 0.8 } }]";
    for (text, last, expected) in [
        (chain.as_str(), "load.torque3_nm", "torque1_nm torque2_nm torque3_nm force_x_n force_y_n"),
        (plate, "load.force_z_n", "force_x_n force_z_n"),
    ] {
        let (_folder, mut instance) = made(text);
        let inputs = instance.variables.iter().filter_map(|variable| variable.name.strip_prefix("load."));
        assert_eq!(inputs.collect::<Vec<_>>().join(" "), expected);
        let (_other, mut still) = made(text);
        let reference = of(&instance, last);
        [&mut instance, &mut still].into_iter().for_each(|instance| started(instance, 0.0));
        instance.set(reference, Value::Float64(3.0)).unwrap();
        [&mut instance, &mut still].into_iter().for_each(|instance| assert!(!instance.step(0.0, 0.02).unwrap()));
        assert_ne!(outputs(&mut instance), outputs(&mut still), "{last}");
    }
}

#[test]
fn a_state_as_bytes_continues_with_the_same_bits_in_another_instance() {
    let text = "rig = { converter = 'sinc5', sensors.b = { lowpass_hz = 300, delay_samples = 3 } }";
    let (_folder, mut instance) = made(text);
    let (_other, mut fresh) = made(text);
    let force = of(&instance, "load.force_x_n");
    started(&mut instance, 0.0);
    instance.set(force, Value::Float64(20.0)).unwrap();
    instance.step(0.0, 0.0123).unwrap();
    let saved = instance.save().unwrap();
    let bytes = instance.serialize(&saved).unwrap();
    fresh.restore(&fresh.deserialize(&bytes).unwrap()).unwrap();
    for step in 0..10 {
        let at_s = 0.0123 + f64::from(step) * 0.0007;
        [&mut instance, &mut fresh].into_iter().for_each(|instance| assert!(!instance.step(at_s, 0.0007).unwrap()));
        assert_eq!(outputs(&mut instance), outputs(&mut fresh));
    }
    // In front of and within the version of the format, behind it, within the times, and before the last byte.
    for cut in [0, 7, 8, 60, bytes.len() - 1] {
        assert!(matches!(fresh.deserialize(&bytes[..cut]), Err(Fault::Saved(_))), "{cut}");
    }
    let error = fresh.deserialize(&[&bytes[..], &[0]].concat()).unwrap_err();
    insta::assert_snapshot!(error.in_call("fmi3DeserializeFMUState"), @"fmi3DeserializeFMUState: the bytes are not a state of this FMU: it ends before its last number, or after it");
}

#[test]
fn parameters_are_those_of_the_scenario_until_they_are_set() {
    let (_folder, mut instance) = made("structure.angles_deg = [0, 75]\nsimulation.seed = 9");
    let (beta, seed) = (of(&instance, "parameter.link2.angle_deg"), of(&instance, "parameter.seed"));
    assert_eq!((instance.float64(beta).unwrap(), instance.uint64(seed).unwrap()), (75.0, 9));
    // The seed gives the noise of the readings, so that another one changes the outputs.
    let rest = outputs(&mut instance);
    instance.set(seed, Value::UInt64(10)).unwrap();
    assert_ne!(outputs(&mut instance), rest);
    started(&mut instance, 0.0);
    let error = instance.set(seed, Value::UInt64(11)).unwrap_err();
    insta::assert_snapshot!(error.in_call("fmi3SetUInt64"), @"fmi3SetUInt64: `parameter.seed` can't be set in step mode: parameters are fixed once initialization mode is left");
    instance.reset().unwrap();
    assert_eq!((instance.uint64(seed).unwrap(), outputs(&mut instance)), (9, rest));
}

#[test]
fn calls_out_of_their_state_are_refused() {
    let (_folder, mut instance) = made("");
    let error = instance.step(0.0, 1e-3).unwrap_err();
    insta::assert_snapshot!(error.in_call("fmi3DoStep"), @"fmi3DoStep is not allowed in the state Instantiated: it is allowed in step mode");
    assert!(
        instance.terminate().is_err() && instance.enter_event().is_err() && instance.exit_initialization().is_err()
    );
    let error = instance.enter_initialization(f64::INFINITY).unwrap_err();
    insta::assert_snapshot!(error.in_call("fmi3EnterInitializationMode"), @"fmi3EnterInitializationMode: the start time is inf s: it must be finite");
    started(&mut instance, 0.0);
    instance.terminate().unwrap();
    let sample = of(&instance, "sample");
    assert_eq!(instance.uint64(sample).unwrap(), 0);
    instance.fail();
    let error = instance.uint64(sample).unwrap_err();
    insta::assert_snapshot!(error.in_call("fmi3GetUInt64"), @"fmi3GetUInt64 is not allowed in the state after an error: it is allowed in all states but that after an error");
}
