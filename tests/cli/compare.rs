//! `compare`: the readings of a closed loop against the results of harmonic balance.

use std::fs;
use std::path::Path;

use insta::assert_snapshot;
use resonarm::protocol::{Hello, Message, Network, Receiver, Transmitter};
use resonarm::recording::{Options, Record, Recorder, Recording};
use serde_json::Value;

use crate::{complaint, document, names, resonarm};

/// A mode at 0 Hz that only an element holds: its mean position is not computed, but what was measured is kept.
#[test]
fn a_walk_without_a_computed_branch_keeps_its_points() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = r#"
        [structure]
        kind = "modal"
        modes = [
            { frequency_hz = 0.0, damping_ratio = 0.0, shape = { "tip.x" = 0.5 } },
            { frequency_hz = 40.0, damping_ratio = 0.01, shape = { "tip.x" = 0.5 } },
        ]
        elements = [{ kind = "cubic", at = "tip.x", stiffness3_n_m3 = 1e6 }]
        [rig.exciter]
        at = "tip.x"
        [rig.sensors.b]
        at = "tip.x"
        [rig.sensors.c]
        at = "tip.x"
    "#;
    fs::write(folder.path().join("held.toml"), scenario).unwrap();
    let walk = ["experiment", "walk", "--scenario", "held.toml", "--drive", "tip.x=0.5", "--mode-number", "2"];
    let output = resonarm(folder.path(), &[walk.as_slice(), &["--points", "3", "--json"]].concat());
    let walked: Value = serde_json::from_str(&output.stdout).unwrap();
    assert_eq!(walked["points"].as_array().unwrap().len(), 3);
    assert!(output.stderr.contains("no branch is computed beside the points: mode 1 is rigid"), "{}", output.stderr);
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn a_walk_is_on_the_computed_branch() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let walk = ["experiment", "walk", "--drive", "joint1=20", "--points", "9", "--plot", "walk"];
    assert_eq!(resonarm(folder, &walk).code, 0);
    let found = document(folder, 0, &["compare", "walk.json", "--json"]);
    let points = found["points"].as_array().unwrap();
    assert_eq!(points.len(), 9);
    let keys = [
        "amplitude_deviation",
        "computed_stable",
        "distortion",
        "excitation",
        "excitation_deviation",
        "force_harmonics",
        "frequency_deviation",
        "frequency_hz",
        "lag_deg",
        "phase_deviation_deg",
        "readings",
        "settled",
        "tries",
    ];
    for point in points {
        assert_eq!(names(point), keys);
        assert_eq!(names(&point["readings"]), ["joint2.x", "joint2.y", "tip.x", "tip.y"]);
        assert!(number(&point["amplitude_deviation"]).abs() < 2e-3, "{point}");
        assert!(number(&point["phase_deviation_deg"]).abs() < 1.0, "{point}");
    }
    let score = &found["score"];
    assert!(number(&score["largest_frequency_deviation"]) < 3e-5, "{found:#}");
    assert!(points.iter().any(|point| point["computed_stable"] == false), "the walk crosses the unstable section");
    let said = resonarm(folder, &["compare", "walk.json", "--at", "joint2.y", "--plot", "compared"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(said.stdout.contains("settled points on the computed branch of joint2.y within "), "{}", said.stdout);
    assert!(
        said.stdout.ends_with("written to compared.svg, compared.png, compared.txt, compared.csv, compared.json\n"),
        "{}",
        said.stdout
    );
    assert_eq!(fs::read_to_string(folder.join("compared.csv")).unwrap().lines().count(), 10);
    let elsewhere = complaint(folder, 2, &["compare", "walk.json", "--at", "joint2"]);
    assert_snapshot!(elsewhere, @"resonarm: walk.json: --at joint2: the points were measured at other degrees of freedom; choose one of joint2.x, joint2.y, tip.x, tip.y");
    // A point from a clipped accelerometer, which was drawn as settled, unmarked and judged.
    let mut clipped: Value = serde_json::from_str(&fs::read_to_string(folder.join("walk.json")).unwrap()).unwrap();
    let reading = &mut clipped["points"][4]["readings"]["joint2.y"];
    reading["clipped"] = true.into();
    // Clipping takes some per cent off an amplitude: three, which would be far above the score below.
    reading["amplitude"] = (0.97 * number(&reading["amplitude"])).into();
    fs::write(folder.join("clipped.json"), clipped.to_string()).unwrap();
    let said = resonarm(folder, &["compare", "clipped.json", "--at", "joint2.y", "--plot", "marked"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    let plotted: Value = serde_json::from_str(&fs::read_to_string(folder.join("marked.json")).unwrap()).unwrap();
    assert_eq!(plotted["points"][4]["readings"]["joint2.y"]["clipped"], true);
    assert!(number(&plotted["score"]["largest_amplitude_deviation"]) < 0.01, "{plotted:#}");
    assert_eq!(plotted["score"]["settled_points"], 8);
    assert!(fs::read_to_string(folder.join("marked.svg")).unwrap().contains(">from clipped readings<"));
}

/// A document of another program has the links or modes, the load, and of each point its frequency and an amplitude.
#[test]
fn points_of_another_program_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = r#"{
        "configuration": {
            "structure": { "kind": "modal", "modes": [{ "frequency_hz": 20, "damping_ratio": 0.01, "shape": { "tip.x": 0.5 } }] },
            "drive": { "tip.x": { "amplitude": 8 } }
        },
        "points": [{ "frequency_hz": 20, "readings": { "tip.x": { "amplitude": 6.3e-3 } }, "settled": true }]
    }"#;
    fs::write(folder.join("lab.json"), text).unwrap();
    let found = document(folder, 0, &["compare", "lab.json", "--json"]);
    assert_eq!((&found["at"], &found["load"]), (&"tip.x".into(), &"8 N at tip.x".into()));
    // At the natural frequency φ²F/(2ζω²) = 0.25·8/(0.02·(40π)²) m.
    let expected_m = 100.0 / (40.0 * core::f64::consts::PI).powi(2);
    let off = 6.3e-3 / expected_m - 1.0;
    let point = &found["points"][0];
    assert!(
        (number(&point["amplitude_deviation"]) - off).abs() < 1e-3 && point["phase_deviation_deg"].is_null(),
        "{point}"
    );
    let refused = |from: &str, to: &str| {
        fs::write(folder.join("wrong.json"), text.replace(from, to)).unwrap();
        complaint(folder, 2, &["compare", "wrong.json"])
    };
    assert_snapshot!(refused(r#""amplitude": 8"#, r#""amplitude": 8, "unit": "kN""#), @"resonarm: the load at tip.x is in kN, expected N");
    assert_snapshot!(refused(r#""amplitude": 8"#, r#""amplitude": 0"#), @"resonarm: the load at tip.x is 0: it must be a finite number other than 0");
    assert_snapshot!(refused("6.3e-3", r#"6.3, "unit": "mm""#), @"resonarm: wrong.json: point 0: the reading at tip.x is in mm, expected m");
}

#[test]
fn reports_documents_that_can_t_be_compared() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // A backbone is measured at loads that grow, so its points are not those of one branch.
    let walk = ["experiment", "walk", "--drive", "joint1=10", "--points", "3", "--backbone", "--plot", "backbone"];
    assert_eq!(resonarm(folder, &walk).code, 0);
    assert_snapshot!(complaint(folder, 2, &["compare", "none.json"]), @"resonarm: none.json can't be read: No such file or directory (os error 2)");
    fs::write(folder.join("text.json"), "frequency").unwrap();
    assert_snapshot!(complaint(folder, 2, &["compare", "text.json"]), @"resonarm: text.json is not a document of `experiment walk --json`: expected ident at line 1 column 2");
    let loads = complaint(folder, 2, &["compare", "backbone.json"]);
    assert!(loads.starts_with("resonarm: backbone.json: its points have loads from "), "{loads}");
    let mut empty: Value = serde_json::from_str(&fs::read_to_string(folder.join("backbone.json")).unwrap()).unwrap();
    let points = empty["points"].take();
    empty["points"] = Value::Array(Vec::new());
    fs::write(folder.join("empty.json"), empty.to_string()).unwrap();
    assert_snapshot!(complaint(folder, 2, &["compare", "empty.json"]), @"resonarm: empty.json: it has no points to compare");
    empty["points"] = Value::Array(vec![points[0].clone()]);
    // Zero is an amplitude, of a reading below the resolution; less is none.
    empty["points"][0]["readings"]["tip.x"]["amplitude"] = (-1).into();
    fs::write(folder.join("zero.json"), empty.to_string()).unwrap();
    assert_snapshot!(complaint(folder, 2, &["compare", "zero.json"]), @"resonarm: zero.json: point 0 must have readings, with amplitudes of 0 or more");
}

/// A recording gives the same as the document of the run: the controller reads the same from its frames.
#[test]
fn a_recording_is_compared_by_what_its_controller_reads() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let walk =
        ["experiment", "walk", "--drive", "joint1=20", "--points", "5", "--plot", "walk", "--record", "walk.mcap"];
    assert_eq!(resonarm(folder, &walk).code, 0);
    let of_document = document(folder, 0, &["compare", "walk.json", "--json"]);
    let of_recording = document(folder, 0, &["compare", "walk.mcap", "--json"]);
    assert_eq!(of_recording["points"].as_array().unwrap().len(), 5);
    // Equal in all digits: the frames in the recording are those that the controller read.
    assert_eq!(of_recording, of_document);
    let said = resonarm(folder, &["compare", "walk.mcap", "--plot", "compared"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(said.stdout.contains("settled points on the computed branch of "), "{}", said.stdout);
    assert_eq!(fs::read_to_string(folder.join("compared.csv")).unwrap().lines().count(), 6);
}

/// Runs a scenario free and records it as NAME.mcap.
fn record(folder: &std::path::Path, name: &str, scenario: &str) {
    let (scenario_file, recording) = (format!("{name}.toml"), format!("{name}.mcap"));
    fs::write(folder.join(&scenario_file), scenario).unwrap();
    let run = ["run", "--mode", "free", "--scenario", &scenario_file, "--record", &recording];
    assert_eq!(resonarm(folder, &run).code, 0);
}

/// Dwells in open loop, the arm damped so that they settle.
fn dwells(rest: &str) -> String {
    format!(
        "[structure.set]\n'link1.damping_nm_s_rad' = 100.0\n'link2.damping_nm_s_rad' = 50.0\n[excitation]\namplitude = {{ exciter_x = 300.0 }}\nprofile = {{ waveform = 'stepped-sine', \
         from_hz = 19.0, to_hz = 24.0, steps = 3, dwell_s = 5.0, settle_s = 4.0 }}\n{rest}"
    )
}

#[test]
fn dwells_in_open_loop_are_on_the_branch_of_the_force_that_acted() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    record(folder, "ideal", &dwells(""));
    let found = document(folder, 0, &["compare", "ideal.mcap", "--json"]);
    for point in found["points"].as_array().unwrap() {
        assert_eq!(point["settled"], true);
        assert!(number(&point["amplitude_deviation"]).abs() < 1e-3, "{point}");
    }
    let shaker = "[rig.shaker]\nmoving_mass_kg = 0.1\nstiffness_n_m = 2e3\ndamping_n_s_m = 110.0\nforce_factor_n_a = 30.0\n\
        resistance_ohm = 6.0\ninductance_h = 3e-4\nstroke_m = 0.03\ncurrent_limit_a = 22.0\nvoltage_limit_v = 250.0\n";
    record(folder, "shaker", &dwells(shaker));
    let refused = complaint(folder, 2, &["compare", "shaker.mcap"]);
    assert!(refused.starts_with("resonarm: shaker.mcap: its points have loads from "), "{refused}");
}

/// The recording of a dwell whose plant announces another DBC.
fn of_another_dbc(path: &Path) {
    let dwell = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/lockstep-dwell.mcap");
    let dwell = Recording::open(dwell).unwrap();
    let options = Options::virtual_time(dwell.origin().dt_s, "none");
    let recorder = Recorder::create(path, dwell.configuration(), options).unwrap();
    let mut channel = recorder.channel("plant", 1024).unwrap();
    let mut receiver = Receiver::new(Network::default());
    for frame in dwell.frames().unwrap() {
        let mut record = frame.unwrap();
        if let Ok(Some(Message::PlantHello(hello))) = receiver.accept(&record.frame) {
            // One bit of the hash is another DBC.
            let other = Message::PlantHello(Hello { dbc_hash: hello.dbc_hash ^ 1, ..hello });
            record.frame = Transmitter::new(Network::default()).frame(&other).unwrap();
        }
        channel.push_blocking(&Record::Frame(record)).unwrap();
    }
    recorder.finish(&[]).unwrap();
}

#[test]
fn reports_why_a_recording_can_t_be_compared() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    of_another_dbc(&folder.join("old.mcap"));
    assert_snapshot!(complaint(folder, 2, &["compare", "old.mcap"]), @"resonarm: a controller of this version rejects the recorded plant (another DBC); use the version that recorded it");
    // A sweep dwells at no frequency, so that no response is read.
    let swept = "waveform = 'swept-sine', from_hz = 20, to_hz = 24, duration_s = 1";
    record(folder, "swept", &format!("[excitation]\namplitude = {{ exciter_x = 5 }}\nprofile = {{ {swept} }}\n"));
    assert_snapshot!(complaint(folder, 2, &["compare", "swept.mcap"]), @"resonarm: swept.mcap holds no responses: no response was read before its end; responses are read with [control] or with an [excitation] with `dwell`, `stepped-sine` or `sine-list`: `resonarm experiment walk --drive DOF=A --record walk.mcap` makes such a recording");
    fs::write(folder.join("text.mcap"), "frequency").unwrap();
    assert_snapshot!(complaint(folder, 2, &["compare", "text.mcap"]), @"resonarm: `text.mcap` is not an MCAP file: it begins with `frequenc`");
}
