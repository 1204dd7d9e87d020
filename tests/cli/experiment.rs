//! `experiment fig9` and `experiment walk`: their output and refusals.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use insta::assert_snapshot;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::{complaint, document, names, resonarm};

/// A brake that settles the arm within some seconds, and instruments without noise.
const BENCH: &str = "structure.angles_deg = [-76.5413, 120]\nsimulation = { scheme = 'rk4' }\n\
    [rig.shaker]\nmoving_mass_kg = 0.01\nstiffness_n_m = 0\ndamping_n_s_m = 400\nforce_factor_n_a = 30\nresistance_ohm = 1\n\
    inductance_h = 0\nstroke_m = 0.1\ncurrent_limit_a = 22\nvoltage_limit_v = 1000\n\
    [rig.sensors.b]\nnoise_rms_m_s2 = 0\n[rig.sensors.c]\nnoise_rms_m_s2 = 0\n[rig.head]\nnoise_rms_n = 0\n";

const SMALL: [&str; 12] = [
    "experiment",
    "fig9",
    "--scenario",
    "bench.toml",
    "--first-force-n",
    "12",
    "--second-force-n",
    "4",
    "--points",
    "3",
    "--step-hz",
    "8",
];

#[test]
fn both_zones_are_measured_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("bench.toml"), BENCH).unwrap();
    let said = resonarm(folder, &[&SMALL[..], &["--plot", "zones"]].concat());
    assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
    for words in ["zone 1: 12 N along x", "zone 2: 4 N along x", "jumps     measured: none", "written to zones.svg"] {
        assert!(said.stdout.contains(words), "{words}: {}", said.stdout);
    }
    let found: Value = serde_json::from_str(&fs::read_to_string(folder.join("zones.json")).unwrap()).unwrap();
    assert_eq!(names(&found), ["configuration", "coordinates", "interrupted", "simulated_s", "wall_s", "zones"]);
    for zone in found["zones"].as_array().unwrap() {
        assert_eq!(
            names(zone),
            ["backbone", "computed", "down", "drive", "mode_number", "range_hz", "up", "walk"],
            "{zone:#}"
        );
        for (run, points) in [("walk", 3), ("backbone", 10), ("up", 5), ("down", 5)] {
            let run = &zone[run];
            assert_eq!(run["outcome"], "finished");
            let points_read = run["points"].as_array().unwrap();
            // Near a resonance a sine takes smaller steps, so that it may have some points more.
            assert!((points..=points + 2).contains(&points_read.len()), "{run:#}");
            // The head's resolution is coarse for the smallest force of the backbone.
            let unsettled = points_read.iter().filter(|point| point["settled"] == false).count();
            assert!(unsettled == 0 || (points == 10 && unsettled <= 2), "{run:#}");
        }
        assert_eq!(zone["computed"]["jumps"], Value::Null);
    }
    let csv = fs::read_to_string(folder.join("zones.csv")).unwrap();
    assert!(csv.starts_with("zone,run,frequency_hz,"), "{csv}");
    over_the_papers_curves(folder);
    // An existing figure is not overwritten.
    assert!(complaint(folder, 2, &[&SMALL[..], &["--plot", "zones"]].concat()).contains("--overwrite"));
}

/// `paper fig9 --measured` draws the document: a curve for each zone under its force, and every settled point in its
/// place.
fn over_the_papers_curves(folder: &Path) {
    let drawn = document(folder, 0, &["paper", "fig9", "--measured", "zones.json", "--out", "paper", "--json"]);
    // SVG, PNG, caption, CSV and JSON.
    assert_eq!(drawn["figures"][0]["files"].as_array().unwrap().len(), 5, "{drawn}");
    let read = |file: &str| fs::read_to_string(folder.join(file)).unwrap();
    let json = |file: &str| serde_json::from_str::<Value>(&read(file)).unwrap();
    let (zones, figure) = (json("zones.json"), json("paper/fig9.json"));
    let mut expected = Vec::new();
    for zone in zones["zones"].as_array().unwrap() {
        for way in ["up", "down", "walk"] {
            let points = zone[way]["points"].as_array().unwrap();
            expected.extend(points.iter().filter(|point| point["settled"] == true).map(|point| (way, point)));
        }
    }
    let measured = figure["measured"].as_array().unwrap();
    assert_eq!(measured.len(), expected.len());
    let dofs: Vec<&str> =
        figure["curves"][0]["read"]["at"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    assert_eq!(dofs.len(), 2, "{dofs:?}");
    for (point, (way, expected)) in measured.iter().zip(expected) {
        assert_eq!((&point["way"], &point["frequency_hz"]), (&way.into(), &expected["frequency_hz"]));
        for (seen, name) in point["amplitude"].as_array().unwrap().iter().zip(&dofs) {
            let expected = expected["readings"][name]["amplitude"].as_f64().unwrap();
            assert!((seen.as_f64().unwrap() - expected).abs() <= 1e-14 * expected, "{point} {expected}");
        }
    }
    let curves = figure["curves"].as_array().unwrap();
    let forces = curves.iter().map(|curve| (curve["label"].as_str().unwrap(), &curve["motions"][0]["excitation"]));
    assert_eq!(forces.collect::<Vec<_>>(), [("12 N", &12.0.into()), ("4 N", &4.0.into())]);
    assert_eq!(figure["panels"][0]["range"], serde_json::json!([26.0, 46.0]));
    let svg = read("paper/fig9.svg");
    for words in ["sine up", "sine down", "phase walk", "measured on computed", "120°"] {
        assert!(svg.contains(words), "{words}");
    }
}

#[test]
fn impossible_measurements_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let refusal = |flags: &[&str]| complaint(folder.path(), 2, &[&["experiment", "fig9"], flags].concat());
    assert_snapshot!(refusal(&["--from-hz", "30"]), @"resonarm: --from-hz is 30: it must be above 0 and below the first natural frequency, 26.84 Hz");
    assert_snapshot!(refusal(&["--to-hz", "40"]), @"resonarm: --to-hz is 40: it must be above the second natural frequency, 40.36 Hz");
    assert_snapshot!(refusal(&["--step-hz", "0"]), @"resonarm: --step-hz is 0: it must be positive, with at most 10000 steps from 26 to 46 Hz");
    assert_snapshot!(refusal(&["--first-force-n", "1000"]), @"resonarm: control.amplitude.exciter_x is 1000, beyond the shaker's blocked force, 660 N: lower it, or raise the limit if the exciter has more");
    assert_snapshot!(refusal(&["--second-force-n", "0"]), @"resonarm: --second-force-n is 0: it must be a positive number");
    assert_snapshot!(refusal(&["--rate-hz", "300"]), @"resonarm: control: the sample rate of 300 Hz is too low for a mode at 40.36 Hz: it must be at least 445 Hz");
}

/// A shaker along y in a scenario; no flag repeats the direction.
#[test]
fn a_walk_goes_along_the_shaker_of_its_scenario() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let bench = BENCH.replace("damping_n_s_m = 400", "damping_n_s_m = 20\ndirection_deg = 90");
    fs::write(folder.join("bench.toml"), &bench).unwrap();
    let walk = ["experiment", "walk", "--scenario", "bench.toml", "--points", "3", "--json"];
    let walked = document(folder, 0, &[&walk[..], &["--drive", "shaker=4"]].concat());
    assert_eq!(walked["configuration"]["drive"], serde_json::json!({ "tip.y": { "amplitude": 4.0, "unit": "N" } }));
    let message = complaint(folder, 2, &["experiment", "walk", "--drive", "shaker=4"]);
    assert_snapshot!(message, @"resonarm: --drive shaker=4 acts along a shaker, but the scenario has none: add [rig.shaker], or name a degree of freedom, as tip.x");
    let refused = |drive: &[&str]| complaint(folder, 2, &[&["experiment", "walk", "--points", "3"], drive].concat());
    assert_snapshot!(refused(&["--drive", "joint2.x=4"]), @"resonarm: --drive joint2.x: the exciter of the scenario acts on joint1, joint2, tip.x, tip.y; choose one of these, or place the exciter there by `rig.exciter.at`");
    assert_snapshot!(refused(&["--drive", "joint1"]), @"resonarm: --drive joint1 has no amplitude: give --drive joint1=A, in N·m");
    assert_snapshot!(refused(&["--drive", "joint1=4", "--drive", "joint1=5"]), @"resonarm: --drive joint1 is given twice: give each load once");
    assert_snapshot!(refused(&["--drive", "joint1=4", "--drive", "tip.x=5"]), @"resonarm: control.amplitude: excitation: forces and torques are both given: a command carries only one kind; set the other to 0");
    assert_snapshot!(refused(&[]), @"resonarm: the excitation is missing: give it by --drive DOF=A, with DOF one of joint2.x, joint2.y, tip.x, tip.y, joint1, joint2");
    // Without a load in the flags, the walk takes that of the scenario.
    let dwell = "[excitation]\namplitude = { exciter_y = 4 }\nprofile = { waveform = 'dwell', frequency_hz = 20, duration_s = 1, settle_s = 0.1 }\n";
    fs::write(folder.join("bench.toml"), format!("{bench}{dwell}")).unwrap();
    assert_eq!(
        document(folder, 0, &walk)["configuration"]["drive"],
        serde_json::json!({ "tip.y": { "amplitude": 4.0, "unit": "N" } })
    );
}

/// A torque does not act through the impedance head, which then reads only noise: there is no distortion to report.
#[test]
fn a_torque_has_no_distortion() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let distortions = |document: &Value, key: &str| -> Vec<Value> {
        let points = document[key].as_array().unwrap();
        assert!(!points.is_empty(), "{document}");
        points.iter().flat_map(|point| [point["distortion"].clone(), point["force_harmonics"].clone()]).collect()
    };
    let walk = |load| document(folder, 0, &["experiment", "walk", "--drive", load, "--points", "3", "--json"]);
    assert!(distortions(&walk("joint1=10"), "points").iter().all(Value::is_null));
    assert!(distortions(&walk("tip.x=10"), "points").iter().all(|value| !value.is_null()));
    for (amplitude, has_one) in [("joint1", false), ("exciter_x", true)] {
        let dwell = "profile = { waveform = 'dwell', frequency_hz = 18, duration_s = 1, settle_s = 0.5 }";
        fs::write(folder.join("dwell.toml"), format!("[excitation]\namplitude = {{ {amplitude} = 20 }}\n{dwell}\n"))
            .unwrap();
        let run = document(folder, 0, &["run", "--mode", "free", "--scenario", "dwell.toml", "--json"]);
        assert!(distortions(&run, "responses").iter().all(|value| value.is_null() != has_one), "{run}");
    }
}

/// Ctrl-C during the walks: the points read so far are kept and shown, without a verdict on incomplete zones.
#[test]
#[allow(clippy::disallowed_methods, reason = "it waits for another process")]
fn an_interrupted_experiment_is_not_judged() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    command.args(["experiment", "fig9", "--plot", "zones"]).current_dir(folder).env_remove("RESONARM_LOG");
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // The threads of the runs start after the signal handlers are installed.
    while threads(&child) < 3 {
        thread::sleep(Duration::from_millis(20));
    }
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let output = child.wait_with_output().unwrap();
    let [stdout, stderr] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!(output.status.code(), Some(1), "{stdout}{stderr}");
    for words in ["folds", "jumps", "off in frequency"] {
        assert!(!stdout.contains(words), "{words}: {stdout}");
    }
    assert!(stdout.contains("not compared") && stdout.contains("\ninterrupted after "), "{stdout}");
    assert!(
        stderr.contains("interrupted: zones with unfinished runs are not compared with the computed response"),
        "{stderr}"
    );
    let found: Value = serde_json::from_str(&fs::read_to_string(folder.join("zones.json")).unwrap()).unwrap();
    assert_eq!(found["interrupted"], true);
    assert!(found["zones"].as_array().unwrap().iter().all(|zone| zone["computed"].is_null()), "{found}");
    assert!(fs::read_to_string(folder.join("zones.svg")).unwrap().contains("interrupted"));
}

/// The number of threads of a process.
fn threads(child: &Child) -> usize {
    fs::read_dir(format!("/proc/{}/task", child.id())).map_or(0, Iterator::count)
}
