//! Structures in place of the two-link arm: the examples, and `resonarm structure`.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{complaint, document, names, resonarm};

fn example(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/structures").join(name);
    path.display().to_string()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// Natural frequencies, Hz: of the chain and the plate by other code, in NumPy; of modes as the files state them; and
/// of the arm, whose hardening spring has no slope at rest.
#[test]
fn the_examples_have_their_modes() {
    let here = Path::new(".");
    let examples: [(&str, &[f64]); 6] = [
        ("chain.toml", &[15.767_4, 24.921_8, 68.099_7, 110.632_7, 172.452_0, 306.284_6]),
        ("bracket.toml", &[63.4, 212.25, 388.0]),
        ("contact.toml", &[63.4, 212.25, 388.0]),
        ("friction.toml", &[41.0, 187.0]),
        ("hardening.toml", &[22.157_5, 48.896_6]),
        ("plate.toml", &[36.411_9, 125.227_6, 135.716_4, 181.881_2]),
    ];
    for (name, expected) in examples {
        let modes = document(here, 0, &["modes", "--json", "--scenario", &example(name)]);
        let got: Vec<f64> =
            modes["modes"].as_array().unwrap().iter().map(|mode| mode["frequency_hz"].as_f64().unwrap()).collect();
        assert_eq!(got.len(), expected.len(), "{name}");
        for (got, expected) in got.iter().zip(expected) {
            assert!((got - expected).abs() < 1e-4, "{name}: {got} in place of {expected}");
        }
    }
}

/// What `structure --out` writes is the same structure, without the files.
#[test]
fn a_structure_is_written_without_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let out: PathBuf = folder.path().join("own.toml");
    let out = out.to_str().unwrap();
    for name in ["chain.toml", "contact.toml", "hardening.toml"] {
        let made = document(
            folder.path(),
            0,
            &["structure", "--json", "--scenario", &example(name), "--out", out, "--overwrite"],
        );
        assert_eq!(
            names(&made),
            ["configuration", "damping_ratios", "degrees_of_freedom", "natural_frequencies_hz", "points"]
        );
        assert!(!fs::read_to_string(out).unwrap().contains("file ="));
        let again = document(folder.path(), 0, &["structure", "--json", "--scenario", out]);
        for key in ["degrees_of_freedom", "points"] {
            assert_eq!(again[key], made[key], "{name}");
        }
        for key in ["natural_frequencies_hz", "damping_ratios"] {
            assert_eq!(numbers(&again[key]), numbers(&made[key]), "{name}");
        }
    }
    let there = complaint(folder.path(), 2, &["structure", "--scenario", &example("chain.toml"), "--out", out]);
    assert!(there.contains("own.toml"), "{there}");
}

/// What a walk in the closed loop reads, through encoder and decoder, is the computed branch.
#[test]
fn a_walk_on_the_bracket_is_on_its_branch() {
    let folder = tempfile::tempdir().unwrap();
    let walk = ["experiment", "walk", "--scenario", &example("bracket.toml"), "--points", "5"];
    let found = document(folder.path(), 0, &[&walk[..], &["--plot", "walk", "--json"]].concat());
    assert_eq!(
        names(&found),
        ["configuration", "outcome", "points", "reason", "score", "simulated_s", "wall_s"],
        "{found:#}"
    );
    let score = &found["score"];
    assert_eq!((&score["at"], score["settled_points"].as_u64()), (&"tip.y".into(), Some(5)), "{score:#}");
    assert!(score["largest_frequency_deviation"].as_f64().unwrap() < 2e-5, "{score:#}");
    assert!(score["largest_amplitude_deviation"].as_f64().unwrap() < 1e-3, "{score:#}");
    let point = &found["points"][2];
    let at: Vec<&str> =
        point["readings"].as_array().unwrap().iter().map(|reading| reading["at"].as_str().unwrap()).collect();
    assert_eq!(at, ["tip.x", "tip.y"]);
    // The displacement lags the load as the walk says, in the direction of the load.
    let off_deg = point["readings"][1]["phase_deg"].as_f64().unwrap() + point["phase_deg"].as_f64().unwrap();
    assert!(off_deg.abs() < 0.5, "{point:#}");
    assert!(fs::read_to_string(folder.path().join("walk.csv")).unwrap().starts_with("frequency_hz,phase_deg,"));
    let none = complaint(folder.path(), 2, &[&walk[..], &["--mode-number", "4"]].concat());
    insta::assert_snapshot!(none.trim(), @"resonarm: control: mode 4: modes are numbered from 1 to 3");
    let torque = complaint(folder.path(), 2, &[&walk[..], &["--torque1-nm", "4"]].concat());
    insta::assert_snapshot!(torque.trim(), @"resonarm: control: this load does not drive mode 1: choose another direction");
}

/// Two modes, the tip on a spring that hardens, under a stepped sine.
const STEPPED: &str = "[structure]
kind = 'modal'
[[structure.modes]]
frequency_hz = 20.0
damping_ratio = 0.02
shape = { 'tip.x' = 0.4, 'mid.x' = 0.2 }
[[structure.modes]]
frequency_hz = 43.0
damping_ratio = 0.02
shape = { 'tip.x' = 0.3, 'mid.x' = -0.3 }
[[structure.elements]]
kind = 'cubic'
at = 'tip.x'
stiffness3_n_m3 = 2e8
[rig.accelerometer_b]
at = 'mid'
[excitation]
amplitude = { force_x_n = 12.0 }
profile = { waveform = 'stepped-sine', from_hz = 19.0, to_hz = 21.0, steps = 5, dwell_s = 4.0, settle_s = 3.0 }
";

/// Responses in open loop lie on the computed branch, in phase as well.
#[test]
fn responses_of_a_recording_are_compared_with_the_branch() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("stepped.toml"), STEPPED).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "stepped.toml", "--record", "stepped.mcap", "--json"];
    document(folder.path(), 0, &run);
    let found = document(folder.path(), 0, &["compare", "stepped.mcap", "--json"]);
    assert_eq!(names(&found), ["at", "configuration", "points", "score"], "{found:#}");
    let (points, score) = (found["points"].as_array().unwrap(), &found["score"]);
    assert_eq!((points.len(), score["settled_points"].as_u64()), (5, Some(5)), "{found:#}");
    assert!(score["largest_amplitude_deviation"].as_f64().unwrap() < 1e-3, "{score:#}");
    for point in points {
        assert!(point["phase_deviation_deg"].as_f64().unwrap().abs() < 0.2, "{point:#}");
        let at: Vec<&str> =
            point["readings"].as_array().unwrap().iter().map(|reading| reading["at"].as_str().unwrap()).collect();
        assert_eq!(at, ["tip.x", "mid.x"]);
    }
}

/// The modes that are identified from readings are those of the structure, numbered alike.
#[test]
fn the_modes_of_a_structure_are_identified() {
    let folder = tempfile::tempdir().unwrap();
    let linear = STEPPED.split("[[structure.elements]]").next().unwrap();
    let random = "[rig.accelerometer_b]\nat = 'mid'\n[excitation]\namplitude = { force_x_n = 12.0 }\n\
        profile = { waveform = 'random', from_hz = 10.0, to_hz = 60.0, duration_s = 16.0, seed = 3 }\n";
    fs::write(folder.path().join("random.toml"), format!("{linear}{random}")).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "random.toml", "--record", "random.mcap", "--json"];
    document(folder.path(), 0, &run);
    let found = document(folder.path(), 0, &["identify", "random.mcap", "--json"]);
    let modes = found["modes"].as_array().unwrap();
    assert_eq!((modes.len(), &found["missing"]), (2, &serde_json::json!([])), "{:#}", found["missing"]);
    for (index, (mode, hz)) in modes.iter().zip([20.0, 43.0]).enumerate() {
        assert_eq!(mode["mode"], index + 1);
        let off = |key: &str, of: f64, deviation: &str| {
            (mode[key].as_f64().unwrap() - of).abs() / mode[deviation].as_f64().unwrap()
        };
        assert!(off("frequency_hz", hz, "frequency_deviation_hz") < 4.0, "{mode:#}");
        assert!(off("damping_ratio", 0.02, "damping_ratio_deviation") < 4.0, "{mode:#}");
    }
}

/// The texts of a picture: titles, axes with their numbers, legends.
fn texts(svg: &Path) -> Vec<String> {
    let svg = fs::read_to_string(svg).unwrap();
    svg.split("<text").skip(1).map(|text| text.split("</text>").next().unwrap().to_owned()).collect()
}

/// Each command of the gallery draws the picture below it, as far as its texts say.
#[test]
fn the_gallery_is_drawn_by_its_commands() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = fs::read_to_string(here.join("docs/gallery.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut drawn = 0;
    for command in page.lines().filter_map(|line| line.strip_prefix("resonarm ")) {
        let (command, stem) = command.split_once(" --plot ").unwrap();
        let name = Path::new(stem).file_name().unwrap();
        let again = folder.path().join(name);
        let words: Vec<&str> = command.split(' ').collect();
        let said = resonarm(here, &[&words[..], &["--plot", again.to_str().unwrap()]].concat());
        assert_eq!(said.code, 0, "{command}: {}", said.stderr);
        let [shown, again] = [here.join(stem), again].map(|stem| texts(&stem.with_extension("svg")));
        assert!(shown.len() > 10);
        assert_eq!(again, shown, "{command}");
        assert!(page.contains(&format!("(images/structures/{}.svg)", name.display())), "{name:?}");
        drawn += 1;
    }
    assert_eq!(drawn, 6);
}

#[test]
fn a_structure_is_shown() {
    let shown = |name: &str| resonarm(Path::new("."), &["structure", "--scenario", &example(name)]).stdout;
    insta::assert_snapshot!(shown("friction.toml"), @"
    bolted beam with an element, friction
    points: joint, tip
    element 1: friction between tip.y and joint.y, slip_force_n = 15, stiffness_n_m = 40000
      mode   undamped frequency   damping ratio
         1           41.0000 Hz        2.000e-3
         2          187.0000 Hz        3.000e-3
    ");
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arm.toml"), "").unwrap();
    let none = complaint(folder.path(), 2, &["structure", "--scenario", "arm.toml"]);
    insta::assert_snapshot!(none.trim(), @"resonarm: arm.toml: the scenario has no [structure]: its plant is the two-link arm of [arm], which `resonarm modes` shows");
}

#[test]
fn the_modes_of_an_arm_are_a_structure() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arm.toml"), "[arm]\nbeta2_deg = 75.0\n").unwrap();
    let shown = resonarm(folder.path(), &["structure", "--from-modes", "arm.toml", "--out", "modes.toml"]).stdout;
    insta::assert_snapshot!(shown, @"
    2 modes
    points: joint2, tip
      mode   undamped frequency   damping ratio
         1           23.1383 Hz        1.577e-4
         2           45.7423 Hz        9.317e-4
    written to modes.toml
    ");
    let modes = |file: &str| document(folder.path(), 0, &["modes", "--json", "--scenario", file])["modes"].clone();
    let (own, arm) = (modes("modes.toml"), modes("arm.toml"));
    for (own, arm) in own.as_array().unwrap().iter().zip(arm.as_array().unwrap()) {
        for key in ["frequency_hz", "damping_ratio"] {
            let [own, arm] = [own, arm].map(|mode| mode[key].as_f64().unwrap());
            assert!((own / arm - 1.0).abs() < 1e-9, "{key}: {own} in place of {arm}");
        }
    }
    let says = |words: &[&str]| complaint(folder.path(), 2, words);
    insta::assert_snapshot!(says(&["structure"]).trim(), @"resonarm: give --scenario FILE, or --from-modes FILE");
    let hardening = example("hardening.toml");
    let refused = says(&["structure", "--from-modes", &hardening]).replace(&hardening, "hardening.toml");
    insta::assert_snapshot!(refused.trim(), @"resonarm: hardening.toml: the structure has elements, 1, and modes are of its linear part: leave them out, and add them to the modes");
}
