//! The gate of the plant in whole runs: a load that changes too fast, and an arm that is driven too far.

use std::path::Path;

use resonarm::protocol::{EmergencyCode, Refusal, Trip};
use resonarm::recording::{Existing, Recording};
use resonarm::replay::resimulate;
use resonarm::rig::Load;
use resonarm::run::{ExciterEnd, Mode, Options, PlantOutcome, PlantReport, RecordTo, Session, Signals, fault_text};
use resonarm::scenario::Scenario;

/// A state as far as the gate is concerned: the load held from it on, and how far the tip is from rest, m.
struct Moment {
    load: Load,
    travel_m: f64,
}

/// Runs both ends over a bus in memory.
fn run(text: &str, mode: Mode, path: &Path) -> (PlantReport, Vec<Moment>) {
    let record = Some(RecordTo { path: path.to_path_buf(), existing: Existing::Overwrite });
    let scenario = Scenario::parse(text, "test").unwrap();
    let assembly = scenario.under_test().unwrap().assembly;
    let session = Session::new(scenario, mode, Options { record, ..Options::default() });
    let report = session.unwrap().both(&Signals::default(), &mut |_event| {}).unwrap().plant;
    let recording = Recording::open(path).unwrap();
    assert!(resimulate(&recording).unwrap().identical);
    let tip = ["tip.x", "tip.y"].map(|name| assembly.dof(name).unwrap());
    let moments = recording.states().unwrap().map(|state| {
        let state = state.unwrap();
        let load = state.load;
        let [x_m, y_m] = tip.map(|dof| assembly.displacement(dof, state.states.coordinates()));
        Moment { load, travel_m: libm::hypot(x_m, y_m) }
    });
    (report, moments.collect())
}

fn events(path: &Path, name: &str) -> usize {
    let recording = Recording::open(path).unwrap();
    recording.events().unwrap().filter(|event| event.as_ref().unwrap().name == name).count()
}

/// A bus with a bit rate: a free run has the deadlines of real time.
const NETWORK: &str = "network = { bit_rate_hz = 1000000 }\n";

#[test]
fn an_impulse_is_refused_where_the_rate_of_change_is_limited() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    // Up to π · 100 N / 0.05 s = 6283 N/s.
    let impulse = format!(
        "{NETWORK}[excitation]\namplitude = {{ exciter_x = 100.0 }}\n\
         profile = {{ waveform = 'impulse', pulse_s = 0.05, duration_s = 0.5 }}\n"
    );
    let (free, moments) = run(&impulse, Mode::Free, &path);
    assert!(free.outcome.is_good() && free.refused.rate_of_change == 0, "{free:?}");
    assert!(moments.iter().any(|moment| moment.load.force_n.x > 99.0));

    // A limit just above the steepest change is no obstacle, and one below it is.
    let (fast, _) = run(&format!("{impulse}[rig.gate]\nforce_rate_limit_n_per_s = 6400.0\n"), Mode::Free, &path);
    assert!(fast.outcome.is_good() && fast.refused.rate_of_change == 0, "{fast:?}");

    let (slow, moments) = run(&format!("{impulse}[rig.gate]\nforce_rate_limit_n_per_s = 5000.0\n"), Mode::Free, &path);
    assert_eq!(slow.outcome, PlantOutcome::Faulted);
    let emergency = slow.emergency.unwrap();
    assert_eq!(emergency.code, EmergencyCode::CommandTimeout);
    assert_eq!(Refusal::from_detail(emergency.detail).1, Some(Refusal::RateOfChange));
    insta::assert_snapshot!(fault_text(&emergency, None, None, None), @"fault of the plant, code 1: no valid command in time (20 rejected, the last because it changes the load too fast), at sample 23; to fix it: lower the excitation or its frequency, lengthen its ramp, or raise rig.gate's limits of the rate of change");
    assert!(slow.refused.rate_of_change > 0);
    assert_eq!(events(&path, "plant.command.rate_of_change") as u64, slow.refused.rate_of_change);
    let jump = |pair: &[Moment]| (pair[1].load.force_n - pair[0].load.force_n).amax();
    // 5000 N/s for 1 ms, also where the load goes back to zero.
    assert!(moments.windows(2).all(|pair| jump(pair) <= 5.0 + 1e-9));
}

/// In lockstep both ends wait as long for each other: whoever gives up first, both say why the command was refused.
#[test]
fn in_lockstep_a_refused_command_ends_with_its_reason_at_both_ends() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let text = "network = { lockstep_timeout_s = 0.4 }\n[excitation]\namplitude = { exciter_x = 100.0 }\n\
         profile = { waveform = 'impulse', pulse_s = 0.05, duration_s = 0.5 }\n\
         [rig.gate]\nforce_rate_limit_n_per_s = 5000.0\n";
    let record = Some(RecordTo { path: path.clone(), existing: Existing::Overwrite });
    let scenario = Scenario::parse(text, "test").unwrap();
    let session = Session::new(scenario, Mode::Lockstep, Options { record, ..Options::default() }).unwrap();
    let report = session.both(&Signals::default(), &mut |_event| {}).unwrap();
    let of_plant = fault_text(&report.plant.emergency.unwrap(), None, report.plant.partner_fault.as_ref(), None);
    let of_exciter = ExciterEnd::from(&report.exciter).reason.unwrap();
    for text in [&of_plant, &of_exciter] {
        assert!(text.contains("it changes the load too fast"), "{text}");
        assert!(text.contains("raise rig.gate's limits of the rate of change"), "{text}");
    }
    let faults = Recording::open(&path).unwrap().summary().faults;
    assert_eq!((faults.len(), faults[0].code), (1, EmergencyCode::CommandTimeout as i64), "{faults:?}");
    let waited = report.plant.partner_fault.map(|said| said.code as i64);
    assert_eq!(faults[0].partner_code, waited);
}

#[test]
fn an_arm_driven_beyond_its_travel_is_let_go_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let dwell = format!(
        "{NETWORK}[excitation]\namplitude = {{ exciter_x = 40.0 }}\nramp_s = 0.2\n\
         profile = {{ waveform = 'dwell', frequency_hz = 18.0, duration_s = 2.0, settle_s = 0.1 }}\n"
    );
    for mode in [Mode::Free, Mode::Lockstep] {
        let (free, moments) = run(&dwell, mode, &path);
        assert!(free.outcome.is_good(), "{free:?}");
        let limit_m = 0.5 * moments.iter().map(|moment| moment.travel_m).fold(0.0, f64::max);
        let (report, moments) = run(&format!("{dwell}[rig.gate]\ntravel_limit_m = {limit_m}\n"), mode, &path);
        assert_eq!((report.outcome, report.refused.travel), (PlantOutcome::Faulted, 1));
        assert_eq!(events(&path, "plant.command.travel"), 1);
        let emergency = report.emergency.unwrap();
        assert_eq!((emergency.code, emergency.detail), (EmergencyCode::ExciterTripped, Trip::Travel as u16));
        if mode == Mode::Free {
            insta::assert_snapshot!(fault_text(&emergency, None, None, None), @"fault of the plant, code 14: the exciter has tripped (the travel), at sample 131; to fix it: lower the excitation, or raise rig.gate.travel_limit_m");
        }
        // The first sample beyond is the one whose command trips it, and no load acts from there on.
        let tripped = moments.iter().position(|moment| moment.travel_m > limit_m).unwrap();
        assert_eq!(tripped, usize::from(emergency.sample));
        assert!(moments[tripped - 1].load != Load::default());
        assert!(moments[tripped..].iter().all(|moment| moment.load == Load::default()));
        let furthest_m = moments.iter().map(|moment| moment.travel_m).fold(0.0, f64::max);
        // The arm swings on by the velocity that it has, without a load.
        assert!(furthest_m < 1.5 * limit_m, "{furthest_m}");
    }
}
