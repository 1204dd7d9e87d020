//! Loads that Resonarm's protocol does not carry: a free run on an ideal bus hands them to the plant, and every other run
//! refuses them by name.

use super::*;
use crate::replay;
use resonarm_bench::control::{Answer, Controller, Length, LoadKind, ResponsePoint};
use resonarm_bench::rig::{Load, Measurement};

const CHAIN: &str = "
    [structure]
    kind = 'chain'
    links = [
      { length_m = 0.5, mass_kg = 20.0, centre_of_mass_m = 0.25, inertia_kg_m2 = 0.5, stiffness_nm_rad = 4e5, damping_nm_s_rad = 80.0, angle_deg = 10.0 },
      { length_m = 0.4, mass_kg = 12.0, centre_of_mass_m = 0.2, inertia_kg_m2 = 0.2, stiffness_nm_rad = 2e5, damping_nm_s_rad = 40.0, angle_deg = 20.0 },
      { length_m = 0.3, mass_kg = 6.0, centre_of_mass_m = 0.15, inertia_kg_m2 = 0.05, stiffness_nm_rad = 1e5, damping_nm_s_rad = 20.0, angle_deg = 30.0 },
    ]
";

/// A structure whose tip moves along z.
const MODAL: &str = "
    [structure]
    kind = 'modal'
    modes = [
      { frequency_hz = 25.0, damping_ratio = 0.01, shape = { 'tip.z' = 0.8, 'tip.x' = 0.2, 'elbow.y' = 0.4 } },
      { frequency_hz = 61.0, damping_ratio = 0.01, shape = { 'tip.z' = -0.5, 'tip.x' = 0.6, 'elbow.y' = 0.7 } },
    ]
    [rig.exciter]
    at = 'tip'
    [rig.sensors.b]
    at = 'elbow'
    [rig.sensors.c]
    at = 'tip'
";

fn dwell(amplitude: &str) -> String {
    format!(
        "[excitation]\namplitude = {{ {amplitude} }}\nramp_s = 0.02\n\
         profile = {{ waveform = 'dwell', frequency_hz = 15.0, duration_s = 0.3, settle_s = 0.1 }}\n"
    )
}

fn session(text: &str, mode: Mode, options: Options) -> Session {
    Session::new(Scenario::parse(text, "test").unwrap(), mode, options).unwrap()
}

/// Runs both ends, and records. The recording has the load, repeats bit by bit, and its responses are read again.
#[test]
fn a_free_run_takes_every_load_that_the_structure_takes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    for (structure, amplitude, part) in [
        // The last number is the place of the load among all: eight torques, then the force along x, y and z.
        (CHAIN, "joint3 = 5.0", 2),
        (CHAIN, "joint1 = 4.0, joint3 = 5.0", 2),
        (MODAL, "exciter_z = 5.0", 10),
        (MODAL, "exciter_x = 3.0, exciter_z = 5.0", 10),
    ] {
        let record = Some(RecordTo { path: path.clone(), existing: Existing::Overwrite });
        let text = format!("{structure}{}", dwell(amplitude));
        let session = session(&text, Mode::Free, Options { record, ..Options::default() });
        let report = session.both(&Signals::default(), &mut |_| {}).unwrap();
        assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished), "{amplitude}: {report:?}");
        assert!(report.plant.error.is_none() && report.exciter.error.is_none(), "{amplitude}: {report:?}");
        let recording = Recording::open(&path).unwrap();
        let parts = recording.states().unwrap().map(|state| state.unwrap().load.parts());
        let most = parts.fold([0.0_f64; Load::PARTS], |most, parts| {
            core::array::from_fn(|place| most[place].max(parts[place].abs()))
        });
        assert!((most[part] - 5.0).abs() < 0.05, "{amplitude}: {most:?}");
        let driven = amplitude.split(',').count();
        assert_eq!(most.iter().filter(|most| **most > 0.1).count(), driven, "{amplitude}: {most:?}");
        assert!(replay::resimulate(&recording).unwrap().identical, "{amplitude}");
        let again = replay::responses(&recording).unwrap();
        assert_eq!(again, report.exciter.responses, "{amplitude}");
        assert_eq!(again.len(), 1, "{amplitude}");
    }
    // A controller on a bus would be compared by frames that lack a part of the load.
    let recording = Recording::open(&path).unwrap();
    let patience = Duration::ZERO;
    let regression = replay::Regression { speed: 0.0, limit_n: 0.0, limit_nm: 0.0, patience };
    let [mut near, _far] = memory::pair(64);
    let clock = ScriptedClock::default();
    let refused = replay::play_against(&recording, &mut near, &clock, regression, &Signals::default()).unwrap_err();
    insta::assert_snapshot!(refused, @"the recorded run has the load force_z_n, which a free run hands to the plant and no frame carries: a controller on a bus can't command it, and --against can't compare it; record a run with a protocol of your own that carries it ([wire])");
}

/// The command on the bus has no field for these loads, also where the bus is a simulated one with a bit rate.
#[test]
fn a_run_on_a_bus_refuses_what_the_protocol_does_not_carry() {
    let bit_rate = "[network]\nbit_rate_hz = 1000000\n";
    for (mode, network) in [(Mode::Lockstep, ""), (Mode::Free, bit_rate)] {
        let text = format!("{CHAIN}{}{network}", dwell("joint3 = 5.0"));
        let refused = session(&text, mode, Options::default()).both(&Signals::default(), &mut |_| {}).unwrap_err();
        insta::allow_duplicates! {
            insta::assert_snapshot!(refused, @"the exciter's load has torque3_nm, but Resonarm's protocol carries only torque1_nm, torque2_nm, force_x_n and force_y_n: change the excitation, or map a user protocol by [wire]");
        }
    }
}

/// A node for the host of an FMU is on the host's bus.
#[test]
fn a_hosted_exciter_refuses_what_the_protocol_does_not_carry() {
    let session = session(&format!("{CHAIN}{}", dwell("joint3 = 5.0")), Mode::Free, Options::default());
    assert!(matches!(session.hosted_exciter(), Err(RunError::WireLacks(_))));
}

/// Loads that the native protocol carries are checked as well: the run would otherwise end in a fault at sample 1.
#[test]
fn a_run_of_both_ends_refuses_a_load_that_acts_on_nothing() {
    let along_z = MODAL.replace("at = 'tip'", "at = 'tip.z'");
    for mode in [Mode::Free, Mode::Lockstep] {
        let session = session(&format!("{along_z}{}", dwell("exciter_y = 5.0")), mode, Options::default());
        let refused = session.both(&Signals::default(), &mut |_| {}).unwrap_err();
        assert!(
            refused
                .to_string()
                .starts_with("the load has `exciter_y` = 5, but the structure accepts only `exciter_x` at tip.z;"),
            "{refused}"
        );
    }
}

/// Nothing is written for a load that nothing of the structure takes.
#[test]
fn a_free_run_refuses_a_load_that_the_structure_does_not_take() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let record = Some(RecordTo { path: path.clone(), existing: Existing::Refuse });
    let session = session(&dwell("joint3 = 5.0"), Mode::Free, Options { record, ..Options::default() });
    let refused = session.both(&Signals::default(), &mut |_| {}).unwrap_err();
    insta::assert_snapshot!(refused, @"the load has `joint3` = 5, but the structure accepts only `joint1`, `joint2`, `exciter_x` at tip.x, `exciter_y` at tip.y; choose one of these, or place the exciter elsewhere by `rig.exciter.at`");
    assert!(!path.exists());
}

/// Holds a torque at joint 3 for some samples.
#[derive(Debug)]
struct AtJoint3;

impl Controller for AtJoint3 {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Torque
    }

    fn restart(&mut self) {}

    fn answer(&mut self, sample: &Measurement) -> Answer {
        if sample.sample < 50 { Answer::Hold(Load::at_joint(2, 5.0)) } else { Answer::Finished }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Samples(50)
    }
}

#[test]
fn a_controller_of_the_callers_own_may_command_them_in_a_free_run() {
    let outcome = |mode| {
        let session = session(CHAIN, mode, Options::default()).with_controller(|| Box::new(AtJoint3));
        session.both(&Signals::default(), &mut |_| {}).unwrap().exciter
    };
    assert_eq!(outcome(Mode::Free).outcome, Some(ExciterOutcome::Finished));
    let on_a_bus = outcome(Mode::Lockstep);
    assert!(matches!(on_a_bus.outcome, Some(ExciterOutcome::Faulted(_))), "{on_a_bus:?}");
}
