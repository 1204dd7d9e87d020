use std::path::Path;

use super::*;
use crate::bus::{Bus, memory};
use crate::node::{ExciterNode, PlantNode};
use crate::plant::Plant;
use crate::realtime::{SampleRate, SystemClock};
use crate::recording::{Direction, Options, Recorder, Recording};
use crate::run::{PlantSide, Signals, Tape, free};
use crate::scenario::Scenario;

const SCENARIO: &str = "
    [excitation]
    amplitude = { torque1_nm = 60.0 }
    profile = { waveform = 'dwell', frequency_hz = 22.1, duration_s = 0.5, settle_s = 0.1 }
";

/// Records a free run of the scenario; the loads of a run with other parameters tell another story.
fn record(path: &Path, simulated: &str, stated: &str) -> Recording {
    let (simulated, stated) = (Scenario::parse(simulated, "test").unwrap(), Scenario::parse(stated, "test").unwrap());
    let recorder =
        Recorder::create(path, &stated.configuration("free").unwrap(), Options::virtual_time(1e-3, "none")).unwrap();
    let plant = Plant::new(&simulated.plant_spec().unwrap()).unwrap();
    let (network, timing) = (simulated.network().unwrap(), simulated.lockstep_timing().unwrap());
    let node = PlantNode::new(network, 1000, timing, *plant.exciter());
    let mut side = PlantSide::new(plant, node, Tape::Whole(recorder.channel("plant", 4096).unwrap()));
    let mut exciter = ExciterNode::new(network, 1000, timing, simulated.profile().unwrap());
    let rate = SampleRate::new(1000.0).unwrap();
    free(&mut side, &mut exciter, rate, None, &Signals::default(), |_| {}).unwrap();
    drop(side);
    recorder.finish(&[]).unwrap();
    Recording::open(path).unwrap()
}

#[test]
fn a_run_simulated_again_is_identical() {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(&folder.path().join("same.mcap"), SCENARIO, SCENARIO);
    let verdict = resimulate(&recording).unwrap();
    assert_eq!(verdict, Verdict { identical: true, steps: 501, first_divergence: None, max_drift_rad: 0.0 });
}

#[test]
fn another_arm_diverges_at_its_first_moving_step() {
    let folder = tempfile::tempdir().unwrap();
    let other = format!("{SCENARIO}\n[arm.parameters]\nstiffness2_nm_rad = 128001.0");
    let recording = record(&folder.path().join("other.mcap"), SCENARIO, &other);
    let verdict = resimulate(&recording).unwrap();
    // The profile's sample 0 is zero, so the arm first moves at step 2.
    assert_eq!((verdict.identical, verdict.first_divergence), (false, Some(2)));
    assert!(verdict.max_drift_rad > 1e-9 && verdict.max_drift_rad < 1e-3, "{verdict:?}");
}

#[test]
fn plays_frames_in_order_with_their_timing() {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(&folder.path().join("play.mcap"), SCENARIO, SCENARIO);
    let expected: Vec<_> = recording.frames().unwrap().map(|record| record.unwrap()).collect();
    let mut ends = memory::hub(2, 1 << 13);
    let (mut ear, mut mouth) = (ends.pop().unwrap(), ends.pop().unwrap());
    let clock = SystemClock;
    let begun_ns = crate::realtime::Clock::now_ns(&clock);
    let all = Playback { speed: 5.0, direction: None };
    let played = play(&recording, &mut mouth, &clock, all, &Signals::default()).unwrap();
    let took_s = (crate::realtime::Clock::now_ns(&clock) - begun_ns) as f64 * 1e-9;
    assert_eq!(played.frames, expected.len() as u64);
    assert!(took_s >= played.recorded_s / 5.0 && (played.recorded_s - 0.5).abs() < 1e-9, "{took_s} {played:?}");
    for record in &expected {
        assert_eq!(ear.receive().unwrap().map(|received| received.frame), Some(record.frame));
    }
    let commands = Playback { speed: 1e3, direction: Some(Direction::Received) };
    let played = play(&recording, &mut mouth, &clock, commands, &Signals::default()).unwrap();
    let received = expected.iter().filter(|record| record.direction == Direction::Received).count();
    assert_eq!(played.frames, received as u64);
    assert!(played.frames > 500);
}

#[test]
fn says_what_cannot_be_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(&folder.path().join("bad.mcap"), SCENARIO, SCENARIO);
    let mut mouth = memory::hub(2, 64).pop().unwrap();
    let stopped = Playback { speed: 0.0, direction: None };
    let error = play(&recording, &mut mouth, &SystemClock, stopped, &Signals::default()).unwrap_err();
    insta::assert_snapshot!(error, @"the speed is 0: it must be a positive number; 1 is the recorded speed");
}
