//! Free runs on a bus with bit rates and faults.

use super::super::mode::Network;
use super::*;
use resonarm_bus::timed;
use resonarm_protocol::bits::BitRates;

/// The report of a free run, its states, and the bytes of its recording.
fn free(session: &Session) -> (BothReport, Vec<Vec<u64>>, Vec<u8>) {
    let report = session.both(&Signals::default(), &mut |_| {}).unwrap();
    let path = report.plant.recording.as_ref().unwrap().path.clone();
    (report, states_of(&Recording::open(&path).unwrap()), std::fs::read(path).unwrap())
}

fn session(text: &str, folder: &tempfile::TempDir) -> Session {
    let scenario = Scenario::parse(&format!("{SCENARIO}\n{text}"), "test").unwrap();
    let record = Some(RecordTo { path: folder.path().join("run.mcap"), existing: Existing::Overwrite });
    Session::new(scenario, Mode::Free, Options { record, ..Options::default() }).unwrap()
}

fn moving(states: &[Vec<u64>]) -> &[Vec<u64>] {
    let still = states.iter().take_while(|state| **state == [0; 8]).count();
    &states[still..]
}

#[test]
fn on_a_bus_that_carries_them_frames_that_take_their_time_change_no_state() {
    let folder = tempfile::tempdir().unwrap();
    for (profile, rates) in [
        ("classic", "bit_rate_hz = 1_000_000"),
        ("classic", "bit_rate_hz = 600_000"),
        ("fd", "bit_rate_hz = 1_000_000\ndata_bit_rate_hz = 4_000_000"),
    ] {
        let network = format!("[network]\nprofile = '{profile}'\n");
        let (ideal, prompt, _) = free(&session(&network, &folder));
        assert_eq!(ideal.exciter.outcome, Some(ExciterOutcome::Finished));
        let timed = format!("{network}{rates}");
        let (report, late, bytes) = free(&session(&timed, &folder));
        assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished));
        assert_eq!((report.plant.outcome, report.exciter.missed_samples), (PlantOutcome::Disarmed, 0));
        assert_eq!((report.plant.bus.dropped, report.plant.refused.late), (0, 0));
        // Armed some samples later, and the disarm is taken in before the sample after.
        let (late_moving, prompt_moving) = (moving(&late), moving(&prompt));
        let together = late_moving.len().min(prompt_moving.len());
        assert!(together > 1500 && late_moving[..together] == prompt_moving[..together], "{timed}");
        assert!(late_moving.len().abs_diff(prompt_moving.len()) <= 1);
        assert!(free(&session(&timed, &folder)).2 == bytes, "the same bytes");
    }
}

#[test]
fn on_a_bus_that_is_too_slow_samples_are_missed_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = session("", &folder);
    session.network = Network::Real(Some(timed::Spec::new(BitRates::classical(400_000))));
    session.timing = session.scenario().real_time_timing().unwrap();
    let (report, ..) = free(&session);
    assert!(report.exciter.missed_samples > 100, "{:?}", report.exciter);
    assert!(report.plant.bus.dropped > 100, "{:?}", report.plant.bus);
}

#[test]
fn a_node_that_babbles_with_the_highest_priority_ends_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let text = "[network]\nbit_rate_hz = 1_000_000\n[[network.faults]]\nnode = 'exciter'\nkind = 'babble'\nrate_hz = 20000\n\
        from_s = 0.5\n";
    let (report, ..) = free(&session(text, &folder));
    let fault = report.plant.fault.unwrap();
    assert_eq!(fault.code, EmergencyCode::CommandTimeout as u16, "{fault:?}");
    assert!((500..530).contains(&fault.sample), "{fault:?}");
}

#[test]
fn faults_of_the_network_are_seeded_and_the_run_survives_what_it_can() {
    let folder = tempfile::tempdir().unwrap();
    let text = |seed: u64| {
        let faults = "[[network.faults]]\nnode = 'plant'\nkind = 'loss'\nprobability = 0.05\nfrom_s = 0.2\n\
            [[network.faults]]\nnode = 'exciter'\nkind = 'bit_error'\nprobability = 0.02\ndirection = 'receive'\nfrom_s = 0.2\n";
        format!("{faults}[network]\nbit_rate_hz = 1_000_000\nbit_error_rate = 1e-4\n[rig.head]\ngain = 1.{seed}")
    };
    let (report, _, bytes) = free(&session(&text(1), &folder));
    assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished));
    assert!(report.exciter.missed_samples > 50 && report.exciter.bus.refused > 50, "{:?}", report.exciter);
    assert!(free(&session(&text(1), &folder)).2 == bytes, "the same bytes");
}

#[test]
fn a_controller_that_is_bus_off_faults_the_run() {
    let folder = tempfile::tempdir().unwrap();
    for (node, code) in [("plant", EmergencyCode::BusLoss), ("exciter", EmergencyCode::CommandTimeout)] {
        let text = format!("[[network.faults]]\nnode = '{node}'\nkind = 'bus_off'\nfrom_s = 0.5\nto_s = 0.6");
        let session = session(&text, &folder);
        let mut events = Vec::new();
        let report = session.both(&Signals::default(), &mut |event| events.push(event)).unwrap();
        assert_eq!(report.plant.fault.map(|fault| fault.code), Some(code as u16), "{node}");
        let is_off = |event: &RunEvent| matches!(event, RunEvent::BusLost { cause: BusLoss::BusOff, .. });
        let is_plant = node == "plant";
        assert_eq!((events.iter().any(is_off), report.plant.bus_loss.is_some()), (is_plant, is_plant), "{node}");
        assert_eq!(report.plant.bus.errors.bus_off, u64::from(is_plant), "{node}");
    }
}

#[test]
fn a_plant_that_cannot_be_armed_in_10_s_of_simulated_time_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let session = session("[[network.faults]]\nnode = 'plant'\nkind = 'link_down'\nfrom_s = 0\n", &folder);
    let (report, ..) = free(&session);
    insta::assert_snapshot!(report.plant.error.unwrap(), @"plant and exciter made no progress: the plant is pre-operational, the exciter pre-operational");
}
