//! Runs that are watched: what they tell, what they do when they are asked, and that nothing else depends on it.

use std::sync::{Arc, Mutex};

use super::*;
use resonarm_bench::control::SetPoint;
use resonarm_bus::memory;
use resonarm_files::recording::{Direction, Event, FrameRecord};

fn session(folder: &tempfile::TempDir, name: &str) -> Session {
    let record = Some(RecordTo { path: folder.path().join(name), existing: Existing::Refuse });
    Session::new(scenario(), Mode::Free, Options { record, ..Options::default() }).unwrap()
}

/// The recording of a run, and its bytes.
fn recorded(report: &PlantReport) -> (Recording, Vec<u8>) {
    let path = &report.recording.as_ref().unwrap().path;
    (Recording::open(path).unwrap(), std::fs::read(path).unwrap())
}

fn events(recording: &Recording) -> Vec<(String, i64)> {
    recording.events().unwrap().map(Result::unwrap).map(|Event { name, value, .. }| (name, value)).collect()
}

#[test]
fn a_watched_run_is_the_same_and_passes_on_all_that_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let alone = session(&folder, "alone.mcap").both(&Signals::default(), &mut |_| {}).unwrap();
    let (watch, mut watcher) = watch();
    watcher.want_frames(true);
    let seen = session(&folder, "seen.mcap").watched(watch).both(&Signals::default(), &mut |_| {}).unwrap();
    let (recording, bytes) = recorded(&seen.plant);
    assert_eq!(bytes, recorded(&alone.plant).1);
    let (mut records, mut responses) = (Vec::new(), Vec::new());
    watcher.take(usize::MAX, |end, one| match (end, one) {
        (End::Plant, Notice::Record(record)) => records.push(*record),
        (End::ExciterBesidePlant, Notice::Response(point)) => responses.push(*point),
        other => panic!("{other:?}"),
    });
    assert_eq!(watcher.lost(), 0);
    assert_eq!(responses, seen.exciter.responses);
    let pick = |record: &Record| match record {
        Record::State(state) => Some(*state),
        _ => None,
    };
    let states: Vec<_> = recording.states().unwrap().map(Result::unwrap).collect();
    assert_eq!(records.iter().filter_map(pick).collect::<Vec<_>>(), states);
    let samples = records.iter().filter_map(|record| match record {
        Record::Sample(sample) => Some(*sample),
        _ => None,
    });
    assert!(samples.eq(recording.samples().unwrap().map(Result::unwrap)));
    let frames = records.iter().filter_map(|record| match record {
        Record::Frame(frame) => Some(*frame),
        _ => None,
    });
    assert!(frames.eq(recording.frames().unwrap().map(Result::unwrap)));
    let named = records.iter().filter_map(|record| match record {
        Record::Event(event) => Some((event.name.to_owned(), event.value)),
        _ => None,
    });
    assert!(named.eq(events(&recording)));
}

#[test]
fn a_disarm_that_is_asked_for_is_recorded_and_ends_the_run_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let (watch, mut watcher) = watch();
    let mut ask = |event| {
        if matches!(event, RunEvent::Armed { .. }) {
            watcher.ask(Request::Disarm).unwrap();
        }
    };
    let report = session(&folder, "run.mcap").watched(watch).both(&Signals::default(), &mut ask).unwrap();
    assert_eq!((report.plant.outcome, report.exciter.outcome), (PlantOutcome::Disarmed, Some(ExciterOutcome::Stopped)));
    let events = events(&recorded(&report.plant).0);
    let place = |name: &str| events.iter().position(|(found, _)| found == name);
    let order = [
        place("state.operational"),
        place("request.disarm"),
        events.iter().rposition(|(name, _)| name == "state.pre_operational"),
    ];
    assert!(order.is_sorted() && order[0].is_some(), "{events:?}");
}

/// Arming takes the way of a frame: without a partner's hello it is refused.
#[test]
fn a_plant_without_a_partner_is_not_armed_by_asking() {
    let mut ends = memory::hub(2, 64);
    let mut near = ends.pop().unwrap();
    let options = Options { patience: Some(Duration::from_millis(60)), ..Options::default() };
    let (watch, mut watcher) = watch();
    let session = Session::new(scenario(), Mode::Lockstep, options).unwrap().watched(watch);
    let mut refused = Vec::new();
    let report = session.plant(&mut near, &Signals::default(), &mut |event| match event {
        RunEvent::Ready => watcher.ask(Request::Arm).unwrap(),
        RunEvent::NotArmed { fault } => refused.push(fault.code),
        other => panic!("{other:?}"),
    });
    assert_eq!(report.unwrap().outcome, PlantOutcome::NotArmed);
    assert_eq!(refused, [EmergencyCode::Incompatible as u16]);
}

#[test]
fn a_set_point_becomes_commands_that_pass_the_gate() {
    let folder = tempfile::tempdir().unwrap();
    let (watch, mut watcher) = watch();
    let mut scenario = scenario();
    scenario.simulation.duration_s = Some(4.0);
    let steered = scenario.steered(scenario.rig.converter).unwrap();
    let limit = steered.limit();
    let record = Some(RecordTo { path: folder.path().join("run.mcap"), existing: Existing::Refuse });
    let session = Session::new(scenario, Mode::Free, Options { record, ..Options::default() }).unwrap();
    let session = session.with_controller(move || Box::new(steered.clone())).watched(watch);
    let set = SetPoint { load: 0.25 * limit, frequency_hz: 15.0, phase_deg: 0.0 };
    let report = session.both(&Signals::default(), &mut |event| {
        if matches!(event, RunEvent::Armed { .. }) {
            // The first is beyond the limit and must be refused, without an effect on the second.
            watcher.ask(Request::Set(SetPoint { load: 2.0 * limit, ..set })).unwrap();
            watcher.ask(Request::Set(set)).unwrap();
        }
    });
    let report = report.unwrap();
    assert_eq!(report.plant.outcome, PlantOutcome::Completed);
    assert_eq!(report.plant.refused, RefusedCommands::default());
    let [point] = &report.exciter.responses[..] else { panic!("{:?}", report.exciter.responses) };
    assert!((point.load / set.load - 1.0).abs() < 1e-3 && point.frequency_hz == 15.0, "{point:?}");
    let (recording, _) = recorded(&report.plant);
    let largest_n = recording.states().unwrap().map(|state| state.unwrap().load.force_n[0].abs()).fold(0.0, f64::max);
    // The force goes over the bus in counts, and the samples of a sine miss its peaks.
    assert!((largest_n / set.load - 1.0).abs() < 2e-3, "{largest_n}");
    let events = events(&recording);
    let thousandths = (set.load * 1e3).round() as i64;
    let expected = [("request.load_thousandths", thousandths), ("request.frequency_mhz", 15_000)];
    assert!(expected.iter().all(|(name, value)| events.contains(&((*name).to_owned(), *value))), "{events:?}");
    // The exciter reports that the controller refused the request; the plant beside it records what was asked.
    let (mut names, mut set_points) = (Vec::new(), Vec::new());
    watcher.take(usize::MAX, |end, one| match (end, one) {
        (End::ExciterBesidePlant, Notice::Record(Record::Event(event))) => names.push(event.name),
        (End::ExciterBesidePlant, Notice::SetPoint(set_point)) => set_points.push(*set_point),
        (End::Plant | End::CoreWatch, Notice::SetPoint(_)) => panic!("only an exciter has a set-point"),
        _ => {}
    });
    assert_eq!(names, ["request.refused"]);
    assert_eq!(set_points, [set]);
}

/// The frames of an exciter alone, as it sees them; those of one beside a plant are passed on by the plant.
#[test]
fn an_exciter_alone_passes_on_its_frames_and_one_beside_a_plant_none() {
    let [mut near, mut far] = memory::pair(1024);
    let session = Session::new(scenario(), Mode::Lockstep, Options::default()).unwrap();
    let ((alone, mut watcher), (beside, mut plant_watcher)) = (watch(), watch());
    [&watcher, &plant_watcher].iter().for_each(|watcher| watcher.want_frames(true));
    let plant =
        Session::new(scenario(), Mode::Lockstep, Options { end_on_disarm: true, ..Options::default() }).unwrap();
    let plant = plant.watched(beside);
    let exciter = std::thread::spawn(move || session.watched(alone).exciter(&mut far, &Signals::default()).unwrap());
    plant.plant(&mut near, &Signals::default(), &mut |_| {}).unwrap();
    let played = exciter.join().unwrap().samples_played;
    let frames = |watcher: &mut Watcher| {
        let mut frames = Vec::new();
        watcher.take(usize::MAX, |_, one| {
            if let Notice::Record(Record::Frame(frame)) = one {
                frames.push(*frame);
            }
        });
        assert_eq!(watcher.lost(), 0);
        frames
    };
    let (seen, plants) = (frames(&mut watcher), frames(&mut plant_watcher));
    let of = |frames: &[FrameRecord], direction| -> Vec<_> {
        frames.iter().filter(|frame| frame.direction == direction).map(|frame| frame.frame).collect()
    };
    let (sent, received) = (of(&seen, Direction::Sent), of(&seen, Direction::Received));
    assert!(sent.len() as u64 >= played && received.len() as u64 >= played, "{played}");
    // In the order of the bus; at its end the other node may have left.
    assert!(of(&plants, Direction::Received).starts_with(&sent[..sent.len() - 4]));
    assert!(of(&plants, Direction::Sent).starts_with(&received[..received.len() - 4]));
    let command =
        |frame: &&FrameRecord| frame.direction == Direction::Sent && frame.frame.id() == sent[sent.len() / 2].id();
    let samples: Vec<u64> = seen.iter().filter(command).map(|frame| frame.sample).collect();
    // The last sample is answered by a disarm, and by no command.
    assert!(samples.iter().copied().eq(0..played - 1), "{} of {played}, {:?}", samples.len(), samples.last());
}

/// Time stands before sample 100 until the third call, and the run is that without a hold.
#[test]
fn a_plant_in_lockstep_holds_before_a_sample_until_it_may_go_on() {
    let [mut near, mut far] = memory::pair(1024);
    let signals = Arc::new(Signals::default());
    let calls = Arc::new(Mutex::new(Vec::new()));
    let (seen, noted) = (Arc::clone(&signals), Arc::clone(&calls));
    let options = Options { end_on_disarm: true, ..Options::default() };
    let plant = Session::new(scenario(), Mode::Lockstep, options.clone()).unwrap().held_at(100, move || {
        let mut noted = noted.lock().unwrap();
        noted.push(seen.done());
        noted.len() == 3
    });
    let session = Session::new(scenario(), Mode::Lockstep, Options::default()).unwrap();
    let exciter = std::thread::spawn(move || session.exciter(&mut far, &Signals::default()).unwrap());
    let held = plant.plant(&mut near, &signals, &mut |_| {}).unwrap();
    exciter.join().unwrap();
    assert_eq!(*calls.lock().unwrap(), [100; 3]);
    let alone =
        Session::new(scenario(), Mode::Lockstep, options).unwrap().both(&Signals::default(), &mut |_| {}).unwrap();
    assert_eq!((held.outcome, held.samples), (PlantOutcome::Disarmed, alone.plant.samples));
}
