//! Which way the frames of a log go.

use std::fs;

use super::*;
use crate::recording::Recording;

/// The direction of each frame of a log, as it is exported: T or R.
fn directions(lines: &str, scenario: Option<Scenario>) -> String {
    let folder = tempfile::tempdir().unwrap();
    let (log, path) = (folder.path().join("bus.log"), folder.path().join("bus.mcap"));
    fs::write(&log, lines).unwrap();
    let (existing, clock) = (Existing::Refuse, SampleClock::default());
    let options = ImportOptions { scenario, interface: None, existing, clock };
    import(&log, LogFormat::Candump, &path, &options).unwrap();
    let frames = Recording::open(&path).unwrap().frames().unwrap();
    frames.map(|frame| if frame.unwrap().direction == Direction::Sent { 'T' } else { 'R' }).collect()
}

/// Frames with identifiers that samples, commands and emergencies of Resonarm's protocol have, too.
const OF_ANOTHER_BUS: &str = "(1.0) can0 203#00 R\n(1.1) can0 201#00 T\n(1.2) can0 081#1122 R\n(1.3) can0 300#11 T\n";

#[test]
fn without_a_scenario_frames_go_the_way_that_the_log_says() {
    assert_eq!(directions(OF_ANOTHER_BUS, None), "RTRT");
}

#[test]
fn with_a_scenario_frames_of_its_network_go_the_way_of_their_sender() {
    assert_eq!(directions(OF_ANOTHER_BUS, Some(Scenario::default())), "TRTT");
}

#[test]
fn a_log_that_says_nothing_is_one_of_the_usual_network() {
    let silent = OF_ANOTHER_BUS.replace(" R\n", "\n").replace(" T\n", "\n");
    for scenario in [None, Some(Scenario::default())] {
        assert_eq!(directions(&silent, scenario), "TRTR");
    }
}
