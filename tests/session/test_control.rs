//! Tests controlled by their specifications: the examples, recorded, judged and simulated again; and user protocols.

use std::fs;
use std::path::{Path, PathBuf};

use resonarm::control::{Abort, Answer, StopReason, TestPhase};
use resonarm::judge::{JudgeOptions, judge};
use resonarm::node::ExciterOutcome;
use resonarm::plant::Plant;
use resonarm::recording::{Existing, Recording};
use resonarm::replay::resimulate;
use resonarm::run::{BothReport, Mode, Options, PlantOutcome, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;
use resonarm::scenario::specification;
use resonarm::specification::verdict::Verdict;

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/test-control").join(name)
}

fn both(scenario: Scenario, mode: Mode, path: Option<&Path>) -> BothReport {
    let record = path.map(|path| RecordTo { path: path.to_path_buf(), existing: Existing::Overwrite });
    let session = Session::new(scenario, mode, Options { record, ..Options::default() }).unwrap();
    session.both(&Signals::default(), &mut |_event| {}).unwrap()
}

/// Each example finishes, its recording holds the specification, and it repeats bit for bit. One of them runs in lockstep, where
/// the two nodes take turns in threads of their own, which takes twice the processor time.
#[test]
fn the_examples_are_in_their_specifications() {
    let folder = tempfile::tempdir().unwrap();
    // Loop check and identification come first: the tests begin where their verdicts find them.
    for (name, mode, begins_s) in
        [("random", Mode::Free, 40.0..70.0), ("sine", Mode::Free, 76.0..82.0), ("shock", Mode::Lockstep, 74.0..80.0)]
    {
        let path = folder.path().join(format!("{name}.mcap"));
        let scenario = Scenario::read(&example(&format!("{name}-exciter.toml"))).unwrap();
        let report = both(scenario.clone(), mode, Some(&path));
        assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished), "{name}");
        assert_eq!((report.plant.outcome, report.plant.bus.refused), (PlantOutcome::Disarmed, 0), "{name}");
        let test = report.exciter.test.as_ref().unwrap();
        assert_eq!((test.progress.phase, test.progress.level_db), (TestPhase::Ended, Some(0.0)), "{name}");
        assert_eq!(test.lines.is_empty(), name != "random", "{name}");
        let recording = Recording::open(&path).unwrap();
        let specification = specification::read(&example(&format!("{name}.toml"))).unwrap();
        let reference = (name == "sine").then(|| String::from("force_x_n"));
        let options = JudgeOptions { reference, ..JudgeOptions::default() };
        let judged = judge(&specification, &recording, &options).unwrap();
        assert_eq!(judged.verdict, Verdict::In, "{name}: {:?}", judged.found);
        assert!(begins_s.contains(&judged.begins.unwrap().at_s), "{name}: {:?}", judged.begins);
        // The controller of the recording is that of the files, even without them.
        let restored = Scenario::from_configuration(recording.configuration()).unwrap();
        assert_eq!(restored.control, scenario.control, "{name}");
        restored.controller().unwrap();
        assert!(resimulate(&recording).unwrap().identical, "{name}");
    }
}

/// On a user protocol that carries C with every sample, without the head.
#[test]
fn a_test_is_controlled_on_a_user_protocol() {
    let folder = tempfile::tempdir().unwrap();
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/own-protocol");
    let wire = fs::read_to_string(own.join("exciter.toml")).unwrap();
    let (wire, _) = wire.split_once("[excitation]").unwrap();
    let plant = fs::read_to_string(example("sine-exciter.toml")).unwrap();
    fs::write(folder.path().join("exciter.toml"), format!("{wire}\n{plant}")).unwrap();
    fs::copy(own.join("bench.dbc"), folder.path().join("bench.dbc")).unwrap();
    // A count of this protocol is 0.01 g, too coarse for the antiresonance.
    let text = fs::read_to_string(example("sine.toml")).unwrap();
    let text = text.replace("tolerance = 0.1\nrate", "tolerance = 0.1\nshare = 0.99\nrate");
    fs::write(folder.path().join("sine.toml"), text).unwrap();
    let path = folder.path().join("own.mcap");
    let report = both(Scenario::read(&folder.path().join("exciter.toml")).unwrap(), Mode::Free, Some(&path));
    assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished));
    let specification = specification::read(&folder.path().join("sine.toml")).unwrap();
    let reference = Some(String::from("force_x_n"));
    let options = JudgeOptions { reference, ..JudgeOptions::default() };
    let judged = judge(&specification, &Recording::open(&path).unwrap(), &options).unwrap();
    assert_eq!(judged.verdict, Verdict::In, "{:?}", judged.found);
}

/// A dead sensor: the loop check refuses the test after at most 3 N, and the reason is the run's.
#[test]
fn a_refused_test_ends_the_run_with_its_reason() {
    let mut scenario = Scenario::read(&example("random-exciter.toml")).unwrap();
    let fault = "instrument = 'c'\nkind = 'dropout'\nfrom_s = 0";
    scenario.rig.faults.push(toml::from_str(fault).unwrap());
    let report = both(scenario, Mode::Free, None);
    let Some(ExciterOutcome::Aborted(Abort::Test(StopReason::OpenLoop { drive_n, .. }))) = report.exciter.outcome
    else {
        panic!("{:?}", report.exciter.outcome);
    };
    assert_eq!((drive_n, report.plant.outcome), (1.0, PlantOutcome::Disarmed));
}

/// The laws take no memory for a sample, from the loop check to the first seconds of their level.
#[test]
fn the_laws_take_no_memory() {
    for name in ["random", "sine", "shock"] {
        let scenario = Scenario::read(&example(&format!("{name}-exciter.toml"))).unwrap();
        let (mut controller, mut plant): (_, Plant) = (scenario.controller().unwrap(), scenario.plant().unwrap());
        let mut phases = Vec::with_capacity(16);
        for _ in 0..90_000 {
            let sample = plant.measure();
            let (answer, progress) =
                assert_no_alloc::assert_no_alloc(|| (controller.answer(&sample), controller.test_progress().unwrap()));
            let Answer::Hold(load) = answer else { break };
            if phases.last() != Some(&progress.phase) {
                phases.push(progress.phase);
            }
            plant.advance(&load).unwrap();
        }
        let all = [TestPhase::Silence, TestPhase::LoopCheck, TestPhase::Identification, TestPhase::Level];
        assert_eq!(phases[..4], all, "{name}");
    }
}
