//! `diff`: compares two recordings.

use std::fs;
use std::path::Path;

use insta::assert_snapshot;
use resonarm::recording::channels::Channels;
use resonarm::recording::{Clipped, Configuration, Options, Record, Recorder, SampleRecord, StateRecord};
use resonarm::rig::{Load, Readings};
use resonarm::structure::{LoadSet, States};

use crate::{complaint, document, resonarm};

/// Records a run.
fn record(folder: &Path, name: &str, duration_s: &str, beta2_deg: &str) {
    let run = [
        "run",
        "--mode",
        "free",
        "--duration-s",
        duration_s,
        "--angles-deg",
        &format!("0,{beta2_deg}"),
        "--record",
        name,
    ];
    assert_eq!(resonarm(folder, &run).code, 0);
}

#[test]
fn equal_runs_do_not_differ() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "a.mcap", "0.1", "60");
    record(folder.path(), "b.mcap", "0.1", "60");
    let said = resonarm(folder.path(), &["diff", "a.mcap", "b.mcap", "--parts", "states,samples,frames,events"]);
    assert_eq!((said.code, said.stderr.as_str()), (0, ""));
    assert_snapshot!(said.stdout, @r"
    states: 151 compared; all the same
    samples: 151 compared; all the same
    frames: 569 compared; all the same
    events: 4 compared; all the same
    ");
}

#[test]
fn the_first_and_the_largest_difference_are_found() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "a.mcap", "0.1", "60");
    record(folder.path(), "b.mcap", "0.08", "60.001");
    let both = ["diff", "a.mcap", "b.mcap", "--json"];
    let found = document(folder.path(), 1, &both);
    let states = &found["parts"][0];
    // After the excitation a run goes on for 50 ms: 151 samples of 0.1 s, 131 of 0.08 s.
    assert_eq!((&states["compared"], &states["only_in_a"], &states["only_in_b"]), (&131.into(), &20.into(), &0.into()));
    let first = states["first_difference"]["sample"].as_u64().unwrap();
    let channels = states["channels"].as_array().unwrap();
    // Both begin at rest; a thousandth of a degree shows as soon as the load moves them.
    assert!((1..50).contains(&first), "{states:#}");
    assert!(channels.iter().any(|channel| channel["name"] == "alpha1_rad"), "{states:#}");
    for channel in channels {
        assert!(
            channel["largest"].as_f64().unwrap() > 0.0 && channel["magnitude"].as_f64().unwrap() > 0.0,
            "{channel:#}"
        );
        assert!(channel["sample"].as_u64().unwrap() >= first, "{channel:#}");
    }
    let keys: Vec<_> = found["configuration"].as_array().unwrap().iter().map(|entry| entry["key"].clone()).collect();
    assert_eq!(keys, ["scenario.simulation.duration_s", "scenario.structure.angles_deg"]);

    let within = [&both[..], &["--parts", "states", "--tolerance", "0.1", "--to-s", "0.08"]].concat();
    assert_eq!(document(folder.path(), 0, &within)["same"], true);
    let frames = document(folder.path(), 1, &[&both[..], &["--parts", "frames"]].concat());
    assert_eq!(frames["parts"][0]["first_difference"]["what"], "frame");
    let said = resonarm(folder.path(), &["diff", "a.mcap", "b.mcap", "--parts", "events"]);
    assert_snapshot!(said.stdout, @r"
    events: 4 compared; first difference at sample 101: event is plant.leaving 50 at sample 101 in A, plant.leaving 50 at sample 81 in B
    scenario.simulation.duration_s: 0.1 in A, 0.08 in B
    scenario.structure.angles_deg: [0.0, 60.0] in A, [0.0, 60.001] in B
    ");
}

#[test]
fn recordings_that_cannot_be_compared_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "a.mcap", "0.1", "60");
    fs::write(folder.path().join("b.mcap"), "no recording").unwrap();
    let said = |arguments: &[&str]| complaint(folder.path(), 2, &[&["diff", "a.mcap"], arguments].concat());
    assert_snapshot!(said(&["b.mcap"]), @"resonarm: `b.mcap` is not an MCAP file: it begins with `no recor`");
    assert_snapshot!(said(&["a.mcap", "--tolerance=-1"]), @"resonarm: --tolerance is -1: it must be 0 or more");
    assert_snapshot!(said(&["a.mcap", "--from-s", "3"]), @"resonarm: there is no sample from 3 to 0.15 s: the recording has those from 0 to 0.15 s");
}

/// Of recordings of a bus alone the frames are compared; if there is nothing to compare, that is said.
#[test]
fn recordings_without_samples_are_compared_by_their_frames() {
    let folder = tempfile::tempdir().unwrap();
    for (name, payload) in [("a", "0102"), ("b", "0103")] {
        fs::write(folder.path().join(format!("{name}.log")), format!("(1.000000) can0 123#{payload} R\n")).unwrap();
        let import = ["import", &format!("{name}.log"), &format!("{name}.mcap")];
        assert_eq!(resonarm(folder.path(), &import).code, 0);
    }
    let said = resonarm(folder.path(), &["diff", "a.mcap", "b.mcap"]);
    assert_eq!(said.code, 1, "{}", said.stderr);
    assert!(said.stdout.starts_with("frames: 1 compared; first difference at sample 0: frame is "), "{}", said.stdout);
    document(folder.path(), 0, &["diff", "a.mcap", "a.mcap", "--json"]);
    let said = complaint(folder.path(), 2, &["diff", "a.mcap", "a.mcap", "--parts", "states,events"]);
    assert_snapshot!(said, @"resonarm: nothing to compare: neither recording has states, events; choose others by --parts, of states, samples, frames, events");
}

/// A recording of two samples, of which only what is marked differs from others, the last state as the end of the run
/// and readings as clipped, and the current of a coil.
fn marked(folder: &Path, name: &str, is_end: bool, clipped: Clipped, coil_current_a: Option<f64>) {
    let channels = Channels::arm(coil_current_a.is_some());
    let options = Options { channels, ..Options::virtual_time(1e-3, "none") };
    let recorder = Recorder::create(folder.join(name), &Configuration::new(), options).unwrap();
    let mut channel = recorder.channel("plant", 64).unwrap();
    for sample in 0..2 {
        let zero = [0.0; 2];
        let is_end = is_end && sample == 1;
        let clipped = if sample == 1 { clipped } else { Clipped::NONE };
        let state = StateRecord {
            sample,
            states: States::new(&[0.0; 4], coil_current_a.as_slice()).unwrap(),
            load: Load::default(),
            taken: LoadSet::NATIVE,
            is_end,
        };
        channel.push_blocking(&Record::State(state)).unwrap();
        let (acceleration_b_m_s2, acceleration_c_m_s2, head_force_n) = (zero, zero, zero);
        let more = Readings::NONE;
        let readings = SampleRecord { sample, acceleration_b_m_s2, acceleration_c_m_s2, head_force_n, clipped, more };
        channel.push_blocking(&Record::Sample(readings)).unwrap();
    }
    recorder.finish(&[]).unwrap();
}

#[test]
fn marks_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let some = Clipped { acceleration_b: [false, true], head_force: [true, false], ..Clipped::NONE };
    marked(folder.path(), "a.mcap", true, some, Some(1.5));
    marked(folder.path(), "b.mcap", false, Clipped::NONE, Some(1.5));
    marked(folder.path(), "without-coil.mcap", true, some, None);
    let both = ["diff", "a.mcap", "b.mcap", "--tolerance", "0.5"];
    let said = resonarm(folder.path(), &both);
    assert_eq!(said.code, 1, "{}", said.stdout);
    assert_snapshot!(said.stdout, @r"
    states: 2 compared; first difference at sample 1: is_end is 1 in A, 0 in B
    samples: 2 compared; first difference at sample 1: clipped is acceleration_b_y_m_s2 and head_force_x_n in A, none in B
    ");
    assert_eq!(document(folder.path(), 1, &[&both[..], &["--json"]].concat())["same"], false);
    // A coil that only one of them has is not compared.
    document(folder.path(), 0, &["diff", "a.mcap", "without-coil.mcap", "--json"]);
}

#[test]
fn the_current_of_a_coil_is_compared() {
    let folder = tempfile::tempdir().unwrap();
    marked(folder.path(), "a.mcap", true, Clipped::NONE, Some(1.5));
    marked(folder.path(), "b.mcap", true, Clipped::NONE, Some(1.25));
    let said = resonarm(folder.path(), &["diff", "a.mcap", "b.mcap", "--parts", "states"]);
    assert_eq!(said.code, 1, "{}", said.stdout);
    assert_snapshot!(said.stdout, @r"
    states: 2 compared; first difference at sample 0: coil_current_a is 1.5 in A, 1.25 in B
      coil_current_a: at most 0.25 apart, at sample 0; at most 1.5 in A
    ");
    document(folder.path(), 0, &["diff", "a.mcap", "b.mcap", "--tolerance", "0.2", "--json"]);
}
