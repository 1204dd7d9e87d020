use core::cell::Cell;
use std::path::Path;

use super::*;
use crate::run::{Mode, Session, Signals};
use resonarm_bus::{Bus, memory};
use resonarm_files::recording::{Direction, FrameRecord, Integrity, Options, Record, Recorder, Recording};
use resonarm_protocol::{Frame, Id};
use resonarm_realtime::{Clock, SystemClock};
use resonarm_scenario::Scenario;

const SCENARIO: &str = "
    [excitation]
    amplitude = { joint1 = 60.0 }
    profile = { waveform = 'dwell', frequency_hz = 22.1, duration_s = 0.5, settle_s = 0.1 }
";

/// Records a free run of the scenario; the file may state another one, with which the recorded loads give other states.
fn record(path: &Path, simulated: &str, stated: &str) -> Recording {
    let (simulated, stated) = (Scenario::parse(simulated, "test").unwrap(), Scenario::parse(stated, "test").unwrap());
    let recorder =
        Recorder::create(path, &stated.configuration("free").unwrap(), Options::virtual_time(1e-3, "none")).unwrap();
    let options = crate::run::Options { end_on_disarm: true, ..Default::default() };
    let session = Session::new(simulated, Mode::Free, options).unwrap();
    let report = session.free(Some(recorder), &Signals::default(), &mut |_| {}).unwrap();
    assert!(report.plant.error.is_none(), "{report:?}");
    Recording::open(path).unwrap()
}

/// Given the recorded frames, the controller reads bit-identical responses.
#[test]
fn responses_are_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("same.mcap");
    let again = responses(&record(&path, SCENARIO, SCENARIO)).unwrap();
    let session = Session::new(Scenario::parse(SCENARIO, "test").unwrap(), Mode::Free, Default::default()).unwrap();
    let read = session.both(&Signals::default(), &mut |_| {}).unwrap().exciter.responses;
    assert_eq!((&again, again.len()), (&read, 1));
    let stated = SCENARIO.replace("22.1", "22.2");
    let error = responses(&record(&folder.path().join("other.mcap"), SCENARIO, &stated)).unwrap_err();
    insta::assert_snapshot!(error, @"the recorded command at sample 1 is joint1 = 8.3 N·m, but the scenario in the recording gives joint1 = 8.35 N·m, so another controller was recorded; run plant and exciter with the same scenario");
    let error = responses(&record(&folder.path().join("none.mcap"), SCENARIO, "")).unwrap_err();
    assert!(matches!(error, ReplayError::Scenario(_)), "{error}");
}

#[test]
fn a_run_simulated_again_is_identical() {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(&folder.path().join("same.mcap"), SCENARIO, SCENARIO);
    let verdict = resimulate(&recording).unwrap();
    let integrity = Integrity::Complete;
    // Half a second of the excitation, then 50 ms in which the load ramps to zero, with both ends.
    let (samples, steps) = (551, 2 * 550);
    let expected = Verdict { identical: true, integrity, samples, steps, first_divergence: None, max_drift_rad: 0.0 };
    assert_eq!(verdict, expected);
}

#[test]
fn another_arm_diverges_at_the_first_sample_that_moves() {
    let folder = tempfile::tempdir().unwrap();
    let other = format!("{SCENARIO}\n[structure.set]\n'link2.stiffness_nm_rad' = 128001.0");
    let recording = record(&folder.path().join("other.mcap"), SCENARIO, &other);
    let verdict = resimulate(&recording).unwrap();
    // The profile's sample 0 is zero, so the arm first moves at sample 2.
    assert_eq!((verdict.identical, verdict.first_divergence), (false, Some(2)));
    assert!(verdict.max_drift_rad > 1e-9 && verdict.max_drift_rad < 1e-3, "{verdict:?}");
}

#[test]
fn plays_frames_in_order_with_their_timing() {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(&folder.path().join("play.mcap"), SCENARIO, SCENARIO);
    let expected: Vec<_> = recording.frames().unwrap().map(|record| record.unwrap()).collect();
    let mut ends = memory::hub(2, 1 << 13);
    let (mut receiver, mut sender) = (ends.pop().unwrap(), ends.pop().unwrap());
    let clock = SystemClock;
    let begun_ns = resonarm_realtime::Clock::now_ns(&clock);
    let all = Playback { speed: 5.0, ..Playback::default() };
    let played = play(&recording, &mut sender, &clock, &all, &Signals::default()).unwrap();
    let took_s = (resonarm_realtime::Clock::now_ns(&clock) - begun_ns) as f64 * 1e-9;
    assert_eq!(played.frames, expected.len() as u64);
    assert!(took_s >= played.recorded_s / 5.0 && (played.recorded_s - 0.55).abs() < 1e-9, "{took_s} {played:?}");
    for record in &expected {
        assert_eq!(receiver.receive().unwrap().map(|received| received.frame), Some(record.frame));
    }
    let commands = Playback { speed: 1e3, direction: Some(Direction::Received), ..Playback::default() };
    let played = play(&recording, &mut sender, &clock, &commands, &Signals::default()).unwrap();
    let received = expected.iter().filter(|record| record.direction == Direction::Received).count();
    assert_eq!(played.frames, received as u64);
    // At least a command for each of the 500 samples.
    assert!(played.frames > 500);
}

/// Time that passes by sleeping alone, and a signal that comes at a time.
struct Scripted<'a> {
    now_ns: Cell<u64>,
    signals: &'a Signals,
    stop_at_ns: u64,
}

impl Clock for Scripted<'_> {
    fn now_ns(&self) -> u64 {
        self.now_ns.get()
    }

    fn sleep_until_ns(&self, deadline_ns: u64) {
        self.now_ns.set(self.now_ns.get().max(deadline_ns));
        if self.now_ns.get() >= self.stop_at_ns {
            self.signals.stop();
        }
    }
}

fn scripted(signals: &Signals, stop_at_ns: u64) -> Scripted<'_> {
    Scripted { now_ns: Cell::new(1_000_000_000), signals, stop_at_ns }
}

/// A recording of two frames, an hour apart.
fn two_frames(path: &Path) -> Recording {
    let stated = Scenario::parse(SCENARIO, "test").unwrap().configuration("free").unwrap();
    let recorder = Recorder::create(path, &stated, Options::virtual_time(1e-3, "none")).unwrap();
    let mut channel = recorder.channel("plant", 16).unwrap();
    for sample in [0, 3_600_000] {
        let frame = Frame::classic(Id::Standard(0x203), &[1, 2, 3]).unwrap();
        let (direction, time_ns, bus_timestamp_ns) = (Direction::Sent, sample * 1_000_000, None);
        let record = FrameRecord { sample, direction, time_ns, bus_timestamp_ns, frame };
        channel.push_blocking(&Record::Frame(record)).unwrap();
    }
    recorder.finish(&[]).unwrap();
    Recording::open(path).unwrap()
}

#[test]
fn a_signal_ends_the_wait_for_the_next_frame() {
    let folder = tempfile::tempdir().unwrap();
    let recording = two_frames(&folder.path().join("two.mcap"));
    let mut ends = memory::hub(2, 64);
    let (mut near, mut far) = (ends.pop().unwrap(), ends.pop().unwrap());
    far.send(&Frame::classic(Id::Standard(0x123), &[]).unwrap()).unwrap(); // nobody reads it for the player
    let signals = Signals::default();
    let clock = scripted(&signals, 3_000_000_000);
    let played = play(&recording, &mut near, &clock, &Playback::default(), &signals).unwrap();
    assert_eq!(played.frames, 1);
    assert!(clock.now_ns() < 4_000_000_000, "the signal came at 3 s, the player ended at {} ns", clock.now_ns());
    assert!(near.receive().unwrap().is_none(), "the player leaves what comes in unread");
}

#[test]
fn speed_0_is_as_fast_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let recording = two_frames(&folder.path().join("two.mcap"));
    let mut near = memory::hub(2, 64).pop().unwrap();
    let signals = Signals::default();
    let clock = scripted(&signals, u64::MAX);
    let played =
        play(&recording, &mut near, &clock, &Playback { speed: 0.0, ..Playback::default() }, &signals).unwrap();
    assert_eq!((played.frames, played.recorded_s, clock.now_ns()), (2, 3600.0, 1_000_000_000));
}

/// A pass is as long as its latest frame says, in whatever order they stand: the next begins a sample period later.
#[test]
fn a_pass_ends_with_its_latest_frame() {
    let folder = tempfile::tempdir().unwrap();
    let stated = Scenario::parse(SCENARIO, "test").unwrap().configuration("free").unwrap();
    let path = folder.path().join("queued.mcap");
    let recorder = Recorder::create(&path, &stated, Options::virtual_time(1e-3, "none")).unwrap();
    let mut channel = recorder.channel("plant", 16).unwrap();
    for time_ns in [0, 90_000_000, 40_000_000] {
        let frame = Frame::classic(Id::Standard(0x203), &[1, 2, 3]).unwrap();
        let (sample, direction, bus_timestamp_ns) = (0, Direction::Sent, None);
        channel
            .push_blocking(&Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns, frame }))
            .unwrap();
    }
    recorder.finish(&[]).unwrap();
    let mut near = memory::hub(2, 64).pop().unwrap();
    let signals = Signals::default();
    let clock = scripted(&signals, u64::MAX);
    let begun_ns = clock.now_ns();
    let twice = Playback { times: 2, ..Playback::default() };
    let played = play(&Recording::open(&path).unwrap(), &mut near, &clock, &twice, &signals).unwrap();
    // A sample period of 1 ms behind the latest frame, which is not the last in the file, begins the second pass.
    assert_eq!((played.frames, clock.now_ns() - begun_ns), (6, 91_000_000 + 90_000_000));
}

#[test]
fn says_what_cannot_be_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let recording = two_frames(&folder.path().join("bad.mcap"));
    let mut sender = memory::hub(2, 64).pop().unwrap();
    let mut error = |speed| {
        play(&recording, &mut sender, &SystemClock, &Playback { speed, ..Playback::default() }, &Signals::default())
            .unwrap_err()
    };
    insta::assert_snapshot!(error(-1.0), @"the speed is -1: it must be 0 (as fast as possible), or from 0.001 to 1000000; 1 is the recorded speed");
    for speed in [1e-12, 1e-300, 2e6, f64::INFINITY, f64::NAN] {
        assert!(matches!(error(speed), ReplayError::Speed { .. }), "{speed}");
    }
}
