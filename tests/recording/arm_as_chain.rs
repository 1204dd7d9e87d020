//! The recordings of the two-link arm, one sample on from each recorded state, by a chain of two links.

use resonarm::plant::{Placed, Places, Plant, TestedAssembly};
use resonarm::recording::{Recording, StateRecord};
use resonarm::scenario::Scenario;
use resonarm_dynamics::structure::{Assembly, BodySpec, ChainSpec, StructureSpec};

/// Paths are relative to the project's folder, in which tests run.
const OF_THE_ARM: [&str; 8] =
    ["demo", "force-control", "phase-walk", "controller-lost", "faulty-bus", "fd", "free-sweep", "lockstep-dwell"];
/// Of the largest of a state or an output so far.
const DEFECT: f64 = 1e-12;

fn placed(assembly: &Assembly, point: &str) -> Placed {
    Placed { along: ["x", "y"].map(|axis| assembly.dof(&format!("{point}.{axis}")).ok()) }
}

fn sensed(plant: &Plant) -> Vec<f64> {
    let mut outputs = vec![0.0; plant.structure().outputs().len()];
    plant.structure().sense(&mut outputs);
    outputs
}

/// The numbers agree, relative to the largest that each has been.
fn agree(got: &[f64], expected: &[f64], largest: &mut [f64], what: &str) {
    assert_eq!(got.len(), expected.len(), "{what}");
    for ((got, expected), largest) in got.iter().zip(expected).zip(largest) {
        *largest = largest.max(expected.abs());
        assert!((got - expected).abs() <= DEFECT * *largest, "{what}: {got}, recorded {expected}");
    }
}

/// Whole runs can't agree: with damping ratios of 1e-4 rounding grows. From each recorded state, and from what the
/// converters of the arm have gathered, a chain makes the next state, and what the converters sample there.
#[test]
fn chains_make_the_next_sample_of_every_recording_of_the_arm() {
    for name in OF_THE_ARM {
        let recording = Recording::open(format!("recordings/{name}.mcap")).unwrap();
        let mut arm_spec = Scenario::from_configuration(recording.configuration()).unwrap().plant_spec().unwrap();
        assert!(arm_spec.structure.is_none(), "{name}");
        arm_spec.seed = 0;
        let body = BodySpec::Chain(ChainSpec::from_arm(&arm_spec.parameters, arm_spec.pose));
        let assembly = Assembly::new(&StructureSpec { body, elements: vec![] }).unwrap();
        let [tip, joint2] = ["tip", "joint2"].map(|point| placed(&assembly, point));
        let places = Places { exciter: tip, accelerometer_b: joint2, accelerometer_c: tip };
        let mut chain_spec = arm_spec.clone();
        chain_spec.structure = Some(TestedAssembly { assembly, initial: vec![0.0; 4], places });
        let [mut arm, mut chain] = [&arm_spec, &chain_spec].map(|spec| Plant::new(spec).unwrap());
        let records: Vec<StateRecord> = recording.states().unwrap().map(Result::unwrap).collect();
        let (mut largest, mut most) = (vec![0.0; arm.states().len()], vec![0.0; sensed(&arm).len()]);
        arm = arm.at(records[0].sample, &records[0].states).unwrap();
        for pair in records.windows(2) {
            let what = format!("{name}, sample {}", pair[1].sample);
            chain = chain.restored(pair[0].sample, &arm.save()).unwrap();
            arm.advance(&pair[0].load()).unwrap();
            chain.advance(&pair[0].load()).unwrap();
            assert_eq!(*arm.states(), pair[1].states, "{what}");
            agree(chain.states(), &pair[1].states, &mut largest, &what);
            agree(&sensed(&chain), &sensed(&arm), &mut most, &what);
        }
        assert!(records.len() > 800, "{name}");
    }
}
