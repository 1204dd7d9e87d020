//! `compare`: what a closed loop has read beside what harmonic balance computes.

use std::fs;

use insta::assert_snapshot;
use serde_json::Value;

use crate::{complaint, document, names, resonarm};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn a_walk_lies_on_the_computed_branch() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let walk = ["experiment", "walk", "--torque1-nm", "20", "--points", "9", "--plot", "walk"];
    assert_eq!(resonarm(folder, &walk).code, 0);
    let found = document(folder, 0, &["compare", "walk.json", "--json"]);
    let points = found["points"].as_array().unwrap();
    assert_eq!(points.len(), 9);
    let keys = [
        "amplitude_deviation",
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
    assert!(points.iter().any(|point| point["computed_stable"] == false), "the walk crosses the unstable part");
    let said = resonarm(folder, &["compare", "walk.json", "--joint", "2", "--plot", "compared"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(
        said.stdout.ends_with("written to compared.svg, compared.png, compared.csv, compared.json\n"),
        "{}",
        said.stdout
    );
    assert_eq!(fs::read_to_string(folder.join("compared.csv")).unwrap().lines().count(), 10);
}

#[test]
fn says_what_can_t_be_compared() {
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
    assert_snapshot!(complaint(folder, 2, &["compare", "empty.json"]), @"resonarm: empty.json: there is no point in it");
    empty["points"] = Value::Array(vec![points[0].clone()]);
    empty["points"][0]["harmonic1_rad"][1] = 0.into();
    fs::write(folder.join("zero.json"), empty.to_string()).unwrap();
    assert_snapshot!(complaint(folder, 2, &["compare", "zero.json"]), @"resonarm: zero.json: point 0 has no positive frequency and amplitudes other than zero");
}
