//! `compare`: the readings of a closed loop against the results of harmonic balance.

use std::fs;
use std::path::Path;

use insta::assert_snapshot;
use resonarm::protocol::{Hello, Message, Network, Receiver, Transmitter};
use resonarm::recording::{Options, Record, Recorder, Recording};
use serde_json::Value;

use crate::{complaint, document, names, resonarm};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn a_walk_is_on_the_computed_branch() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let walk = ["experiment", "walk", "--torque1-nm", "20", "--points", "9", "--plot", "walk"];
    assert_eq!(resonarm(folder, &walk).code, 0);
    let found = document(folder, 0, &["compare", "walk.json", "--json"]);
    let points = found["points"].as_array().unwrap();
    assert_eq!(points.len(), 9);
    let keys = [
        "amplitude_deviation",
        "clipped",
        "computed_frequency_hz",
        "computed_harmonic1_rad",
        "computed_stable",
        "frequency_deviation",
        "frequency_hz",
        "harmonic1_rad",
        "settled",
    ];
    for point in points {
        assert_eq!(names(point), keys);
        let amplitude = number(&point["harmonic1_rad"][0]) / number(&point["computed_harmonic1_rad"][0]) - 1.0;
        assert!(
            (amplitude - number(&point["amplitude_deviation"][0])).abs() < 1e-12 && amplitude.abs() < 2e-3,
            "{point}"
        );
    }
    assert!(number(&found["largest_frequency_deviation"]) < 3e-5, "{found:#}");
    assert!(points.iter().any(|point| point["computed_stable"] == false), "the walk crosses the unstable section");
    let said = resonarm(folder, &["compare", "walk.json", "--joint", "2", "--plot", "compared"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(
        said.stdout.ends_with("written to compared.svg, compared.png, compared.txt, compared.csv, compared.json\n"),
        "{}",
        said.stdout
    );
    assert_eq!(fs::read_to_string(folder.join("compared.csv")).unwrap().lines().count(), 10);
    // A point from a clipped accelerometer at C, which was drawn as settled, unmarked and judged.
    let mut clipped: Value = serde_json::from_str(&fs::read_to_string(folder.join("walk.json")).unwrap()).unwrap();
    clipped["points"][4]["clipped"] = serde_json::json!([false, true]);
    clipped["points"][4]["harmonic1_rad"][1] = (0.97 * number(&clipped["points"][4]["harmonic1_rad"][1])).into();
    fs::write(folder.join("clipped.json"), clipped.to_string()).unwrap();
    let said = resonarm(folder, &["compare", "clipped.json", "--plot", "marked"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    let plotted: Value = serde_json::from_str(&fs::read_to_string(folder.join("marked.json")).unwrap()).unwrap();
    assert_eq!(plotted["points"][4]["clipped"], serde_json::json!([false, true]));
    assert!(number(&plotted["largest_amplitude_deviation"][1]) < 0.01, "{plotted:#}");
    assert!(fs::read_to_string(folder.join("marked.svg")).unwrap().contains(">from clipped readings<"));
}

#[test]
fn reports_documents_that_can_t_be_compared() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let walk = ["experiment", "walk", "--torque1-nm", "10", "--points", "3", "--backbone", "--plot", "backbone"];
    assert_eq!(resonarm(folder, &walk).code, 0);
    assert_snapshot!(complaint(folder, 2, &["compare", "none.json"]), @"resonarm: none.json can't be read: No such file or directory (os error 2)");
    fs::write(folder.join("text.json"), "frequency").unwrap();
    assert_snapshot!(complaint(folder, 2, &["compare", "text.json"]), @"resonarm: text.json is no document of `experiment walk --json`: expected ident at line 1 column 2");
    let loads = complaint(folder, 2, &["compare", "backbone.json"]);
    assert!(loads.starts_with("resonarm: backbone.json: its points are of loads from "), "{loads}");
    let mut empty: Value = serde_json::from_str(&fs::read_to_string(folder.join("backbone.json")).unwrap()).unwrap();
    let points = empty["points"].take();
    empty["points"] = Value::Array(Vec::new());
    fs::write(folder.join("empty.json"), empty.to_string()).unwrap();
    assert_snapshot!(complaint(folder, 2, &["compare", "empty.json"]), @"resonarm: empty.json: it has no points");
    empty["points"] = Value::Array(vec![points[0].clone()]);
    empty["points"][0]["harmonic1_rad"][1] = 0.into();
    fs::write(folder.join("zero.json"), empty.to_string()).unwrap();
    assert_snapshot!(complaint(folder, 2, &["compare", "zero.json"]), @"resonarm: zero.json: point 0 has no positive frequency and amplitudes other than zero");
}

/// A recording gives the same as the document of the run: the controller reads the same from its frames.
#[test]
fn a_recording_is_compared_by_what_its_controller_reads() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let walk = ["experiment", "walk", "--torque1-nm", "20", "--points", "5", "--plot", "walk", "--record", "walk.mcap"];
    assert_eq!(resonarm(folder, &walk).code, 0);
    let of_document = document(folder, 0, &["compare", "walk.json", "--json"]);
    let of_recording = document(folder, 0, &["compare", "walk.mcap", "--json"]);
    assert_eq!(of_recording["points"].as_array().unwrap().len(), 5);
    assert_eq!(of_recording, of_document);
    let said = resonarm(folder, &["compare", "walk.mcap", "--plot", "compared"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(said.stdout.contains("largest of settled points without clipped readings: "), "{}", said.stdout);
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
        let [of_1, of_2] = [0, 1].map(|joint| number(&point["amplitude_deviation"][joint]).abs());
        assert!(of_1 < 1e-3 && of_2 < 5e-3, "{point}");
    }
    let shaker = "[rig.shaker]\nmoving_mass_kg = 0.1\nstiffness_n_m = 2e3\ndamping_n_s_m = 110.0\nforce_factor_n_a = 30.0\n\
        resistance_ohm = 6.0\ninductance_h = 3e-4\nstroke_m = 0.03\ncurrent_limit_a = 22.0\nvoltage_limit_v = 250.0\n";
    record(folder, "shaker", &dwells(shaker));
    let refused = complaint(folder, 2, &["compare", "shaker.mcap"]);
    assert!(refused.starts_with("resonarm: shaker.mcap: its points are of loads from "), "{refused}");
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
    assert_snapshot!(complaint(folder, 2, &["compare", "old.mcap"]), @"resonarm: a controller of this version refuses the recorded plant (another DBC): read it with the version that recorded it");
    let swept = "waveform = 'swept-sine', from_hz = 20, to_hz = 24, duration_s = 1";
    record(folder, "swept", &format!("[excitation]\namplitude = {{ exciter_x = 5 }}\nprofile = {{ {swept} }}\n"));
    assert_snapshot!(complaint(folder, 2, &["compare", "swept.mcap"]), @"resonarm: swept.mcap holds no responses: none was read before its end; responses are read with [control] or with an [excitation] with `dwell`, `stepped-sine` or `sine-list`: `resonarm experiment walk --torque1-nm 20 --record walk.mcap` makes such a recording");
    fs::write(folder.join("text.mcap"), "frequency").unwrap();
    assert_snapshot!(complaint(folder, 2, &["compare", "text.mcap"]), @"resonarm: `text.mcap` is not an MCAP file: it begins with `frequenc`");
}
