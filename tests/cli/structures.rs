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
