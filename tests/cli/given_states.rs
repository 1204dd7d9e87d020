//! Branches that start on a given response, and loads of several harmonics.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::{complaint, document};

/// A hardening mode under a sine that dwells at 20.2 Hz.
const HARDENING: &str = "[structure]
kind = 'modal'
[[structure.modes]]
frequency_hz = 20.0
damping_ratio = 0.02
shape = { 'tip.x' = 0.4, 'mid.x' = 0.2 }
[[structure.elements]]
kind = 'cubic'
at = 'tip.x'
stiffness3_n_m3 = 2e8
[rig.sensors.b]
at = 'mid'
[excitation]
amplitude = { exciter_x = 12.0 }
profile = { waveform = 'dwell', frequency_hz = 20.2, duration_s = 3.0, settle_s = 2.0 }
";

fn folder_with(name: &str, text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), text).unwrap();
    folder
}

fn largest(point: &Value) -> f64 {
    point["readings"]["tip.x"]["largest"].as_f64().unwrap()
}

/// The first response of a branch from a state.
fn first_from(folder: &Path, state: &str) -> Value {
    let from_state = format!("--from-state={state}");
    let walk = ["continue", "--scenario", "hard.toml", "--drive", "tip.x=12", "--json", "--no-stability"];
    let found = document(folder, 0, &[&walk[..], &["--from-hz=20.2", "--to-hz=20.3", &from_state]].concat());
    assert!(found["configuration"]["continue"]["from_state"].is_array(), "{:#}", found["configuration"]);
    found["points"][0].clone()
}

/// From numbers, a point of a branch, a step of a sweep, a stable response of basins, and a recording of a run.
#[test]
fn a_branch_starts_on_what_other_commands_found() {
    let folder = folder_with("hard.toml", HARDENING);
    let folder = folder.path();
    let shared = ["--scenario", "hard.toml", "--drive", "tip.x=12", "--json"];
    let branch = document(folder, 0, &[&["continue"][..], &shared, &["--from-hz=20.2", "--to-hz=20.3"]].concat());
    let sweep = ["--from-hz=20.2", "--to-hz=20.25", "--points=2", "--direction=up"];
    let sweep = document(folder, 0, &[&["sweep"][..], &shared, &sweep].concat());
    let basins = document(folder, 0, &[&["basins"][..], &shared, &["--frequency-hz=20.2", "--points=3,3"]].concat());
    for (name, found) in [("branch.json", &branch), ("sweep.json", &sweep), ("basins.json", &basins)] {
        fs::write(folder.join(name), found.to_string()).unwrap();
    }
    let run = ["run", "--mode", "free", "--scenario", "hard.toml", "--record", "run.mcap", "--json"];
    document(folder, 0, &run);
    let expected = largest(&branch["points"][0]);
    let listed: Vec<f64> = serde_json::from_value(branch["points"][0]["state"].clone()).unwrap();
    let listed = format!("{},{}", listed[0], listed[1]);
    // The excitation has settled by 2.7 s, so that the state from there on is on the branch.
    let states =
        ["branch.json:points/0", "sweep.json:sweeps/0/points/0", "basins.json:motions/0", "run.mcap:2.7", &listed];
    for state in states {
        let found = largest(&first_from(folder, state));
        assert!((found / expected - 1.0).abs() < 1e-8, "{state}: {found} {expected}");
    }
}

#[test]
fn a_state_that_is_not_there_is_said() {
    let folder = folder_with("hard.toml", HARDENING);
    let folder = folder.path();
    fs::write(folder.join("found.json"), json!({ "points": [{ "state": [0.1, 0.2] }, { "value": 3 }] }).to_string())
        .unwrap();
    let says = |state: &str| {
        let from_state = format!("--from-state={state}");
        let walk = ["continue", "--scenario", "hard.toml", "--drive", "tip.x=12", "--from-hz=20", "--to-hz=21"];
        complaint(folder, 2, &[&walk[..], &[&from_state]].concat()).trim().to_owned()
    };
    insta::assert_snapshot!(says("found.json:points/7"), @"resonarm: --from-state found.json:points/7: `points` has entries 0 to 1, and no `7`");
    insta::assert_snapshot!(says("found.json:sweeps/0"), @"resonarm: --from-state found.json:sweeps/0: the document has the keys points, and no `sweeps`");
    insta::assert_snapshot!(says("found.json:points/1"), @"resonarm: --from-state found.json:points/1: no state is there; give points/17 of a document of continue, sweeps/0/points/3 of sweep, motions/0 of basins, or a time in seconds of a recording");
    insta::assert_snapshot!(says("gone.json:points/1"), @"resonarm: --from-state gone.json:points/1: the file can't be read: No such file or directory (os error 2)");
    insta::assert_snapshot!(says("0.1,0.2,0.3"), @"resonarm: along frequency_hz: the state to start from has 3 finite numbers: expected 2, the coordinates and their rates");
    assert!(says("nothing").contains("it must be numbers, as 0.01,0,0.3,0, or FILE:PLACE"), "{}", says("nothing"));
}

/// A load of two harmonics: a sweep in time settles on the computed branch.
#[test]
fn loads_have_harmonics() {
    let folder = folder_with("hard.toml", HARDENING);
    let folder = folder.path();
    let shared = ["--scenario", "hard.toml", "--drive=tip.x=12", "--drive-harmonic=3=6@90", "--json"];
    let ends = ["--from-hz=19", "--to-hz=19.2"];
    let branch = document(folder, 0, &[&["continue"][..], &shared, &ends].concat());
    let sweep = document(folder, 0, &[&["sweep"][..], &shared, &ends, &["--points=2", "--direction=up"]].concat());
    let [computed, settled] = [&branch["points"][0], &sweep["sweeps"][0]["points"][0]].map(largest);
    assert!((computed / settled - 1.0).abs() < 1e-6, "{computed} {settled}");
    let plain =
        document(folder, 0, &[&["continue", "--scenario=hard.toml", "--drive=tip.x=12", "--json"][..], &ends].concat());
    // The harmonic changes the response by far more than the two ways to compute it differ.
    assert!((largest(&plain["points"][0]) / computed - 1.0).abs() > 1e-3, "{computed}");
    assert_eq!(
        branch["configuration"]["drive_harmonics"],
        json!([{ "order": 3, "amplitude": 6.0, "phase_deg": 90.0 }])
    );
    let refused = |arguments: &[&str]| complaint(folder, 2, arguments).trim().to_owned();
    let backbone = ["backbone", "--scenario=hard.toml", "--drive=tip.x=12", "--drive-harmonic=3=6"];
    insta::assert_snapshot!(refused(&backbone), @"resonarm: a backbone is the resonance under one sine: leave --drive-harmonic out");
    let twice = [&["continue"][..], &shared, &ends, &["--drive-harmonic=3=1"]].concat();
    insta::assert_snapshot!(refused(&twice), @"resonarm: --drive-harmonic 3 is given twice: give each harmonic once");
    let first = ["sweep", "--drive=joint1=60", "--from-hz=21", "--to-hz=22", "--drive-harmonic=1=3"];
    assert!(refused(&first).contains("harmonic 1: expected a whole number from 2 to 50"), "{}", refused(&first));
}

/// A polynomial is listed, warned of if its potential is unbounded, and computed like any element.
#[test]
fn polynomials_are_listed_and_warned_of() {
    let polynomial =
        "[[structure.elements]]\nkind = 'polynomial'\nat = ['tip.x']\nterms = [{ powers = [3], energy = 3e6 }]\n";
    let text = HARDENING.replace("[rig.sensors.b]", &format!("{polynomial}[rig.sensors.b]"));
    let folder = folder_with("hard.toml", &text);
    let outcome = crate::resonarm(folder.path(), &["structure", "--scenario", "hard.toml"]);
    assert!(outcome.stdout.contains("element 2: polynomial at tip.x, 1 term"), "{}", outcome.stdout);
    assert!(
        outcome.stderr.contains("structure.elements, number 2: the potential falls without bound along -tip.x"),
        "{}",
        outcome.stderr
    );
    let walk = ["continue", "--scenario=hard.toml", "--drive=tip.x=12", "--json", "--parameter=element2.energy1"];
    let ends = ["--from=1e6", "--to=3e6", "--frequency-hz=20.2"];
    let outcome = crate::resonarm(folder.path(), &[&walk[..], &ends].concat());
    let found: Value = serde_json::from_str(&outcome.stdout).unwrap();
    assert_eq!(found["ended"], "at-end", "{found:#}");
    let mean = |point: &Value| point["readings"]["tip.x"]["mean"].as_f64().unwrap();
    // 3c x² pushes the mean to the negative side.
    assert!(mean(&found["points"][0]) < 0.0, "{:#}", found["points"][0]);
}
