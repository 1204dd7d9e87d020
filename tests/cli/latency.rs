//! `latency`, and what a run in real time does without its privileges.

use std::path::Path;

use insta::assert_snapshot;

use crate::{complaint, document, names};

fn here() -> &'static Path {
    Path::new(".")
}

#[test]
fn both_loops_are_measured_at_each_rate() {
    let found =
        document(here(), 0, &["latency", "--rate-hz", "1000,2000", "--turn-s", "0.05", "--turns", "2", "--json"]);
    assert_eq!(names(&found), ["findings", "rates", "thread"]);
    let rates = found["rates"].as_array().unwrap();
    assert_eq!(rates.iter().map(|at| at["rate_hz"].as_f64().unwrap()).collect::<Vec<_>>(), [1000.0, 2000.0]);
    for at in rates {
        let p50 = |name: &str| at[name]["p50"].as_f64().unwrap();
        assert!(p50("bare_us") > 0.0 && p50("execution_us") > 0.0, "{at:#}");
        assert_eq!(at["ratio_p50"].as_f64().unwrap(), p50("plant_us") / p50("bare_us"));
    }
}

/// With a recording, which keeps the last turn: a file that is there is not written over unasked.
#[test]
fn the_plant_s_turns_are_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let turns = ["latency", "--turn-s", "0.05", "--turns", "2", "--rt", "off", "--record", "turn.mcap", "--json"];
    let found = document(folder.path(), 0, &turns);
    assert_eq!(found["rates"][0]["lost_records"], 0);
    let inspected = document(folder.path(), 0, &["inspect", "turn.mcap", "--json"]);
    assert_eq!(inspected["integrity"]["state"], "complete", "{inspected:#}");
    assert!(inspected["duration_s"].as_f64().unwrap() >= 0.05, "{inspected:#}");
    let said = complaint(folder.path(), 2, &turns);
    assert_snapshot!(said, @"resonarm: recording `turn.mcap` already exists: name another file, or allow overwriting it (--overwrite)");
}

#[test]
fn what_is_required_and_not_to_be_had_ends_the_run() {
    let said =
        complaint(here(), 3, &["latency", "--turn-s", "0.05", "--turns", "1", "--rt", "require", "--core", "1023"]);
    // The cores are the machine's, the privileges the user's.
    let core = said.find("no core 1023: ").unwrap();
    assert!(said.starts_with("resonarm: the thread of the run must be a real-time thread, and has "), "{said}");
    assert!(said[core..].contains("to mend: choose a core that this process may use: ["), "{said}");
    assert!(said.trim_end().ends_with("; without it: --rt auto"), "{said}");
}

#[test]
fn a_core_is_not_asked_for_with_rt_off() {
    let said = complaint(here(), 2, &["latency", "--rt", "off", "--core", "0"]);
    assert_snapshot!(said, @"resonarm: --core 0 asks for what --rt off leaves out: give one of them");
    let said = complaint(here(), 2, &["latency", "--rt", "off", "--cores-awake"]);
    assert_snapshot!(said, @"resonarm: --cores-awake asks for what --rt off leaves out: give one of them");
    let said = complaint(here(), 2, &["latency", "--turn-s", "0.0001"]);
    assert_snapshot!(said, @"resonarm: --turn-s is 0.0001: at 1000 Hz there is no sample in it");
    let said = complaint(here(), 2, &["latency", "--turn-s", "-1"]);
    assert_snapshot!(said, @"resonarm: --turn-s is -1: cannot convert float seconds to Duration: value is negative; it is a time in seconds, 0 or more");
}
