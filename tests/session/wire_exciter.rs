//! The emulated exciter on protocols of users: free, in lockstep and in real time, recorded and simulated again.

use std::path::Path;
use std::thread;
use std::time::Duration;

use resonarm::bus::{Bus, memory};
use resonarm::node::ExciterOutcome;
use resonarm::realtime::SystemClock;
use resonarm::recording::{Direction, Existing, Recording, StateRecord};
use resonarm::replay::{self, Compared, DifferenceKind, Regression, ReplayError};
use resonarm::run::{BothReport, Mode, Options, PlantOutcome, RecordTo, RunError, Session, Signals};
use resonarm::scenario::{LockstepSpec, Scenario};

const DWELL: &str = "[excitation]\namplitude = { exciter_y = 6.0 }\n\
    profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 0.6, settle_s = 0.2 }\n";
const ODRIVE: &str = "[wire]\npreset = 'odrive'\ntimeout_s = 5.0\n\
    drives = [{ node_id = 0, joint = 1, gear_ratio = 10.0 }, { node_id = 1, joint = 2 }]\n";
const TORQUES: &str = "[excitation]\namplitude = { joint1 = 20.0, joint2 = 5.0 }\n\
    profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 0.6, settle_s = 0.2 }\n";

/// The bench of `tests/cli/wire`, which carries all readings each sample.
fn bench(more: &str) -> Scenario {
    let text = format!("{}\n{more}", include_str!("../cli/wire/bench.toml"));
    scenario(&text)
}

/// In lockstep, by one command a sample.
fn in_lockstep(mut scenario: Scenario) -> Scenario {
    scenario.wire.as_mut().unwrap().lockstep = Some(LockstepSpec::Command);
    scenario
}

fn scenario(text: &str) -> Scenario {
    let mut scenario = Scenario::parse(text, "test.toml").unwrap();
    if let Some(wire) = scenario.wire.as_mut().filter(|wire| wire.preset.is_none()) {
        wire.text = Some(include_str!("../cli/wire/bench.dbc").to_string());
    }
    scenario
}

fn both(scenario: &Scenario, mode: Mode, path: &Path) -> BothReport {
    let record = Some(RecordTo { path: path.to_path_buf(), existing: Existing::Overwrite });
    let session = Session::new(scenario.clone(), mode, Options { record, ..Options::default() }).unwrap();
    session.both(&Signals::default(), &mut |_event| {}).unwrap()
}

/// The run's states; it has ended in order, and is simulated again with the same bits.
fn whole(report: &BothReport, path: &Path) -> Vec<StateRecord> {
    assert_eq!(report.plant.outcome, PlantOutcome::Disarmed, "{report:?}");
    assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished), "{report:?}");
    assert_eq!((report.plant.bus.refused, report.exciter.bus.refused), (0, 0));
    assert_eq!((report.exciter.samples_played, report.exciter.missed_samples), (601, 0));
    let recording = Recording::open(path).unwrap();
    let resimulated = replay::resimulate(&recording).unwrap();
    assert!(resimulated.identical, "{resimulated:?}");
    recording.states().unwrap().map(Result::unwrap).collect()
}

#[test]
fn free_and_lockstep_have_the_same_bits_and_the_commanded_force_acts() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let scenario = in_lockstep(bench(DWELL));
    let free = whole(&both(&scenario, Mode::Free, &path), &path);
    let frames = Recording::open(&path).unwrap().frames().unwrap().map(Result::unwrap);
    let received = frames.filter(|frame| frame.direction == Direction::Received).count();
    // One arms, 600 are answers, one disarms.
    assert_eq!(received, 602);
    let profile = scenario.profile().unwrap();
    for (state, index) in free.iter().zip(0..600) {
        let asked_n = profile.load(index).force_n.y;
        assert!((state.load.force_n[1] - asked_n).abs() <= 0.5 * 0.02 + 1e-9, "{index}: {state:?} {asked_n}");
    }
    let lockstep = whole(&both(&scenario, Mode::Lockstep, &path), &path);
    let bits = |states: &[StateRecord]| -> Vec<_> {
        let numbers = |state: &StateRecord| {
            state.states.coordinates().iter().chain(&state.load.force_n).map(|x| x.to_bits()).collect::<Vec<_>>()
        };
        states[..600].iter().map(numbers).collect()
    };
    assert_eq!(bits(&free), bits(&lockstep));
}

/// Most controllers wait for a reading before they do anything. In lockstep a plant on a user's protocol sent none before
/// it was armed, so that such a controller waited for ever.
#[test]
fn in_lockstep_a_controller_that_waits_for_a_reading_starts_and_gets_the_free_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let with_state = in_lockstep(bench(DWELL));
    // A plant that does not say its state counts as armed once it waits for an answer.
    let mut without_state = with_state.clone();
    without_state.wire.as_mut().unwrap().readings.iter_mut().for_each(|message| {
        message.signals.retain(|_, signal| signal.state.is_none() && signal.reason.is_none());
    });
    without_state.wire.as_mut().unwrap().readings.retain(|message| !message.signals.is_empty());
    let free = whole(&both(&with_state, Mode::Free, &path), &path);
    for scenario in [with_state, without_state] {
        let [mut near, mut far] = memory::pair(1024);
        let record = Some(RecordTo { path: path.clone(), existing: Existing::Overwrite });
        let options = Options { record, end_on_disarm: true, ..Options::default() };
        let session = Session::new(scenario, Mode::Lockstep, options).unwrap();
        let report = thread::scope(|scope| {
            let plant = scope.spawn(|| session.plant(&mut near, &Signals::default(), &mut |_| {}).unwrap());
            assert!(far.wait(Duration::from_secs(60)).unwrap(), "no reading before the plant is armed");
            let exciter = session.exciter(&mut far, &Signals::default()).unwrap();
            BothReport { plant: plant.join().unwrap(), exciter }
        });
        let lockstep = whole(&report, &path);
        let bits = |states: &[StateRecord]| -> Vec<_> {
            let numbers = |state: &StateRecord| {
                state.states.coordinates().iter().chain(&state.load.force_n).map(|x| x.to_bits()).collect::<Vec<_>>()
            };
            states[..600].iter().map(numbers).collect()
        };
        assert_eq!(bits(&free), bits(&lockstep));
    }
}

/// Plays the recorded plant to the exciter of a scenario, in lockstep.
fn against(recording: &Recording, exciter: Scenario) -> Compared {
    let [mut near, mut far] = memory::pair(1024);
    let session = Session::new(exciter, Mode::Lockstep, Options::default()).unwrap();
    let regression = Regression { speed: 0.0, limit_n: 0.0, limit_nm: 0.0, patience: Duration::from_secs(60) };
    let over = Signals::default();
    thread::scope(|scope| {
        let exciter = scope.spawn(|| session.exciter(&mut far, &over));
        let compared = replay::play_against(recording, &mut near, &SystemClock, regression, &Signals::default());
        over.stop();
        exciter.join().unwrap().unwrap();
        compared.unwrap()
    })
}

/// Such a recording was refused, and before that no controller was heard in it, after all the patience.
#[test]
fn a_controller_is_tested_against_a_recording_of_a_protocol_of_the_user() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let odrive = format!("{}\n{TORQUES}", ODRIVE.replace("[wire]", "[wire]\nlockstep = 'command'"));
    let of_bench = format!("{}\n{DWELL}", include_str!("../cli/wire/bench.toml"));
    for (text, louder) in
        [(of_bench, ("exciter_y = 6.0", "exciter_y = 7.0")), (odrive, ("joint2 = 5.0", "joint2 = 6.0"))]
    {
        let with = |from: &str, to: &str| {
            let scenario = scenario(&text.replace(from, to));
            if scenario.wire.as_ref().unwrap().preset.is_some() { scenario } else { in_lockstep(scenario) }
        };
        both(&with("", ""), Mode::Lockstep, &path);
        let recording = Recording::open(&path).unwrap();
        let same = against(&recording, with("", ""));
        assert_eq!(same.first_difference, None, "{text}");
        assert!(same.commands > 590, "{same:?}");
        let other = against(&recording, with(louder.0, louder.1)).first_difference.unwrap();
        assert!(matches!(other.kind, DifferenceKind::Command { .. }), "{other:?}");
        assert!((1..20).contains(&other.sample), "{other:?}");
        let shorter = against(&recording, with("duration_s = 0.6", "duration_s = 0.3")).first_difference.unwrap();
        assert!((290..=310).contains(&shorter.sample), "{shorter:?}");
    }
    let cia402 = format!("{}\n{TORQUES}", include_str!("../../examples/canopen/drives.toml"));
    both(&scenario(&cia402), Mode::Free, &path);
    let [mut alone, _far] = memory::pair(8);
    let regression = Regression { speed: 0.0, limit_n: 0.0, limit_nm: 0.0, patience: Duration::from_secs(60) };
    let recording = Recording::open(&path).unwrap();
    let refused = replay::play_against(&recording, &mut alone, &SystemClock, regression, &Signals::default());
    assert!(matches!(refused, Err(ReplayError::AgainstDrives)), "{refused:?}");
}

#[test]
fn without_a_lockstep_the_first_sample_arms_and_the_next_is_answered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let scenario = bench(DWELL);
    let states = whole(&both(&scenario, Mode::Free, &path), &path);
    let profile = scenario.profile().unwrap();
    for (state, index) in states[1..].iter().zip(0..600) {
        assert!(
            (state.load.force_n[1] - profile.load(index).force_n.y).abs() <= 0.5 * 0.02 + 1e-9,
            "{index}: {state:?}"
        );
    }
}

/// A run in which another controller than the scenario's has played is refused.
fn another_controller_has_no_responses(scenario: &Scenario, path: &Path) {
    let record = Some(RecordTo { path: path.to_path_buf(), existing: Existing::Overwrite });
    let session = Session::new(scenario.clone(), Mode::Free, Options { record, ..Options::default() }).unwrap();
    let other = bench(DWELL);
    let session = session.with_controller(move || other.controller().unwrap());
    session.both(&Signals::default(), &mut |_event| {}).unwrap();
    let said = replay::responses(&Recording::open(path).unwrap()).unwrap_err();
    assert!(matches!(said, ReplayError::Command { .. }), "{said}");
}

#[test]
fn a_loop_is_closed_on_the_readings_of_the_wire() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let control = "[control]\nlaw = 'force-control'\namplitude = { exciter_y = 4.0 }\n\
        [control.profile]\nwaveform = 'dwell'\nfrequency_hz = 14.0\nduration_s = 2.0\nsettle_s = 1.4\n";
    let scenario = bench(control);
    let report = both(&scenario, Mode::Free, &path);
    assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished), "{report:?}");
    let [point] = &report.exciter.responses[..] else { panic!("{:?}", report.exciter.responses) };
    assert!((point.load / 4.0 - 1.0).abs() < 0.02, "{point:?}");
    // `compare` reads the same from the frames of the recording.
    assert_eq!(replay::responses(&Recording::open(&path).unwrap()).unwrap(), report.exciter.responses);
    let in_lockstep = both(&in_lockstep(scenario.clone()), Mode::Lockstep, &path);
    assert_eq!(replay::responses(&Recording::open(&path).unwrap()).unwrap(), in_lockstep.exciter.responses);
    another_controller_has_no_responses(&scenario, &path);
    // The same arm by Resonarm's own protocol, whose counts are others: here they are 0.005 m/s².
    let own = Scenario { wire: None, ..scenario };
    let [expected] = &both(&own, Mode::Free, &path).exciter.responses[..] else { panic!("no response") };
    let near = |got: f64, of: f64| (got - of).abs() < 0.01;
    let [got, of] = [point, expected].map(|point| point.acceleration_c_m_s2[1]);
    assert!(near(got.re, of.re) && near(got.im, of.im), "{got} {of}");
}

#[test]
fn in_real_time_it_plays_in_one_process() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut scenario = bench(&DWELL.replace("duration_s = 0.6", "duration_s = 0.3"));
    // Longer than a busy machine stops a process.
    (scenario.wire.as_mut().unwrap().commands[0].timeout_s, scenario.network.partner_timeout_s) = (Some(5.0), 5.0);
    let report = both(&scenario, Mode::RealTime, &path);
    assert_eq!(report.plant.outcome, PlantOutcome::Disarmed, "{report:?}");
    assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished), "{report:?}");
    assert!(replay::resimulate(&Recording::open(&path).unwrap()).unwrap().identical);
}

#[test]
fn drives_are_armed_and_turn_both_joints() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let in_lockstep = ODRIVE.replace("[wire]", "[wire]\nlockstep = 'command'");
    let cia402 = include_str!("../../examples/canopen/drives.toml");
    for (wire, mode) in
        [(ODRIVE, Mode::Free), (&in_lockstep, Mode::Lockstep), (cia402, Mode::Free), (cia402, Mode::Lockstep)]
    {
        let scenario = scenario(&format!("{wire}\n{TORQUES}"));
        let report = both(&scenario, mode, &path);
        assert_eq!(report.plant.outcome, PlantOutcome::Disarmed, "{report:?}");
        assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished), "{report:?}");
        let recording = Recording::open(&path).unwrap();
        assert!(replay::resimulate(&recording).unwrap().identical);
        let most = recording.states().unwrap().map(Result::unwrap).fold([0.0_f64; 2], |most, state| {
            [most[0].max(state.load.torque_nm[0]), most[1].max(state.load.torque_nm[1])]
        });
        assert!((most[0] - 20.0).abs() < 0.5 && (most[1] - 5.0).abs() < 0.2, "{mode} {most:?}");
    }
}

#[test]
fn what_the_wire_lacks_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let said = |scenario: Scenario| {
        let record = Some(RecordTo { path: path.clone(), existing: Existing::Refuse });
        let session = Session::new(scenario, Mode::Free, Options { record, ..Options::default() }).unwrap();
        let error: RunError = session.both(&Signals::default(), &mut |_event| {}).unwrap_err();
        assert!(!path.exists());
        error.to_string()
    };
    insta::assert_snapshot!(said(bench(&DWELL.replace("exciter_y", "exciter_x"))), @"the exciter's load has more force_x_n than any signal of [[wire.commands]] can command: map it there, or change the excitation");
    let mut blind = bench(
        "[control]\nlaw = 'force-control'\namplitude = { exciter_y = 4.0 }\n\
        profile = { waveform = 'dwell', frequency_hz = 14.0, duration_s = 2.0, settle_s = 1.4 }\n",
    );
    blind.wire.as_mut().unwrap().readings[1].every = Some(5);
    insta::assert_snapshot!(said(blind), @"the controller reads head_force_x_n, head_force_y_n, but no message of every sample carries them: give a [[wire.readings]] with `every = 1` and that `quantity`");
    let cia402 = format!("{}\n{DWELL}", include_str!("../../examples/canopen/drives.toml"));
    insta::assert_snapshot!(said(scenario(&cia402)), @"the exciter's load has more force_y_n than any drive of wire.drives can exert: change the excitation");
}
