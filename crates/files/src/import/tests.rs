//! Which way the frames of a log go.

use std::fs;

use resonarm_protocol::{ForceCommand, Message, Transmitter};

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

/// SavvyCAN's candump.log has frames of another network under identifiers of Resonarm's.
#[test]
fn a_log_that_says_nothing_is_one_of_the_usual_network_if_its_checksums_are() {
    let silent = OF_ANOTHER_BUS.replace(" R\n", "\n").replace(" T\n", "\n");
    assert_eq!(directions(&silent, None), "RRRR");
    assert_eq!(directions(&silent, Some(Scenario::default())), "TRTR");
    let mut transmitter = Transmitter::new(Network::default());
    let zero = Message::Force(ForceCommand { force_x_n: 0.0, force_y_n: 0.0, sample: 0 });
    let command = transmitter.frame(&zero).unwrap();
    let commands: String = (4..8).map(|tenths| format!("(1.{tenths}) can0 {command}\n")).collect();
    assert_eq!(directions(&(silent + &commands), None), "TRTRRRRR");
}

fn imported(lines: &str, interface: Option<&str>) -> Imported {
    let folder = tempfile::tempdir().unwrap();
    let (log, path) = (folder.path().join("bus.log"), folder.path().join("bus.mcap"));
    fs::write(&log, lines).unwrap();
    let (existing, clock) = (Existing::Refuse, SampleClock::default());
    let interface = interface.map(str::to_string);
    import(&log, LogFormat::Candump, &path, &ImportOptions { scenario: None, interface, existing, clock }).unwrap()
}

/// A log whose last line was cut by a power loss, one with a line that is none, and frames of a second interface.
#[test]
fn odd_lines_and_other_interfaces_are_counted_and_left_out() {
    let log = "(0.1) can0 100#1122334455667788_9\nhello\n(0.2) can1 101#\n(0.3) can0 102#\n(0.4) can0 101#0";
    let done = imported(log, None);
    let other = done.other_interfaces.iter().map(String::as_str).collect::<Vec<_>>();
    assert_eq!(
        (done.frames, done.interface.as_deref(), done.of_other_interfaces, &other[..]),
        (2, Some("can0"), 1, &["can1"][..])
    );
    let first = done.first_unreadable.unwrap();
    assert_eq!(done.unreadable, 2);
    assert!(first.ends_with(", line 2: there is no `#` between identifier and data, as in 123#1122"), "{first}");
    assert_eq!(imported(log, Some("can1")).frames, 1);
}

/// The view of a terminal has no times unless `candump` is asked for them, and without them there is nothing to place.
#[test]
fn the_view_of_candump_is_imported_with_its_times() {
    let done = imported(
        " (1.500000)  can0  123   [2]  11 22\n (1.750000)  can0  124  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B\n",
        None,
    );
    assert_eq!((done.frames, done.duration_s, done.unreadable), (2, 0.25, 0));
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("bus.log");
    fs::write(&log, "  can0  123   [2]  11 22\n").unwrap();
    let (existing, clock) = (Existing::Refuse, SampleClock::default());
    let options = ImportOptions { scenario: None, interface: None, existing, clock };
    let refused = import(&log, LogFormat::Candump, &folder.path().join("bus.mcap"), &options).unwrap_err().to_string();
    assert!(
        refused.ends_with(
            "line 1: the line has no time stamp: log with `candump -L`, or with `candump -t a` instead of `candump`"
        ),
        "{refused}"
    );
}
