//! The readings of computed responses in the documents and tables of `continue`, `backbone` and `sweep`.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{document, names};

fn array<'a>(value: &'a Value, name: &str) -> Vec<&'a Value> {
    value[name].as_array().unwrap().iter().collect()
}

/// Off the first resonance of 22.1575 Hz, and within its half-power width of 0.004 Hz, under a small force: the
/// response is the frequency response function times the force.
#[test]
fn a_small_force_gives_frf_times_the_force() {
    for ends in [["12", "12.5"], ["22.1570", "22.1585"]] {
        // A negative force turns all phases by half a turn, which an amplitude without its sign would not.
        let force_n = -2e-4;
        let range = ["--angles-deg", "30,60", "--at", "joint2.x,joint2.y,tip.x,tip.y", "--json"];
        let range = [&range[..], &["--from-hz", ends[0], "--to-hz", ends[1]]].concat();
        let branch = document(Path::new("."), 0, &[&["continue", "--drive", "tip.x=-2e-4"], &range[..]].concat());
        let points = array(&branch, "points");
        let frf = ["frf", "--drive", "tip.x", "--points", "2"];
        let frf = document(Path::new("."), 0, &[frf.as_slice(), &range].concat());
        for (k, point) in [(0, points[0]), (1, points[points.len() - 1])] {
            assert_eq!(point["frequency_hz"], frf["frequency_hz"][k]);
            for curve in array(&frf, "responses") {
                let read = &point["readings"][curve["at"].as_str().unwrap()];
                let [re, im] = [0, 1].map(|part: usize| curve["value"][k][part].as_f64().unwrap() * force_n);
                let [amplitude, phase_deg] = ["amplitude", "phase_deg"].map(|key| read[key].as_f64().unwrap());
                assert!((amplitude / libm::hypot(re, im) - 1.0).abs() < 1e-5, "{curve} {read}");
                assert!((phase_deg - libm::atan2(im, re).to_degrees()).abs() < 1e-3, "{curve} {read}");
            }
        }
    }
}

/// Every response in the document and in the table has readings at each degree of freedom, at bifurcations and on
/// branches that leave the first, too.
#[test]
fn continue_reads_every_response() {
    let folder = tempfile::tempdir().unwrap();
    let branch = ["continue", "--drive", "joint1=800", "--angles-deg", "0,75", "--from-hz", "46", "--to-hz", "50"];
    let flags = ["--at", "joint1,tip.y", "--branches", "--plot", "branch", "--json"];
    let got = document(folder.path(), 0, &[branch.as_slice(), &flags].concat());
    let branches = array(&got, "branches");
    assert!(!branches.is_empty());
    let parts = [&got].into_iter().chain(branches);
    let all: Vec<&Value> =
        parts.clone().flat_map(|part| [array(part, "points"), array(part, "bifurcations")].concat()).collect();
    for point in &all {
        assert_eq!(names(&point["readings"]), ["joint1", "tip.y"], "{point}");
        assert_eq!(names(&point["readings"]["tip.y"]), ["amplitude", "largest", "mean", "phase_deg", "unit"]);
    }
    // The table follows the order of the branch.
    let text = fs::read_to_string(folder.path().join("branch.csv")).unwrap();
    assert_eq!(text.lines().count(), all.len() + 1);
    let head = "branch,frequency_hz,drive,largest_multiplier,stability,bifurcation,joint1_largest_rad,";
    assert!(text.starts_with(head), "{}", &text[..200]);
    let second: Vec<&str> = text.lines().nth(1).unwrap().split(',').collect();
    let first = &all[0]["readings"]["joint1"]["largest"];
    // The first reading is in the seventh column, and has all its digits.
    assert_eq!(second[6].parse::<f64>().ok(), first.as_f64());
}

/// In phase quadrature the mode lags by 90°; the other mode changes it a little.
#[test]
fn backbone_reads_every_point() {
    let curve = ["backbone", "--drive", "joint1=10", "--at", "joint1,joint2.y", "--to", "0.1", "--json"];
    let got = document(Path::new("."), 0, &curve);
    let points = array(&got, "points");
    assert!(points.len() > 5);
    let phase_deg = points[points.len() - 1]["readings"]["joint2.y"]["phase_deg"].as_f64().unwrap();
    assert!((phase_deg + 90.0).abs() < 1.0, "{phase_deg}");
}

/// A sweep settles on the responses that `continue` computes, with the same readings.
#[test]
fn sweep_reads_what_continue_does() {
    let folder = tempfile::tempdir().unwrap();
    let range = ["--drive", "joint1=60", "--at", "joint2.x,tip.y", "--from-hz", "21", "--to-hz", "21.5", "--json"];
    let steps = ["sweep", "--points", "2", "--direction", "up", "--plot", "sweep"];
    let swept = document(folder.path(), 0, &[steps.as_slice(), &range].concat());
    let branch = document(folder.path(), 0, &[["continue"].as_slice(), &range].concat());
    let (swept, computed) = (array(&swept["sweeps"][0], "points"), array(&branch, "points"));
    for (swept, computed) in [(swept[0], computed[0]), (swept[1], computed[computed.len() - 1])] {
        assert_eq!(swept["frequency_hz"], computed["frequency_hz"]);
        for dof in ["joint2.x", "tip.y"] {
            let number = |point: &Value, key: &str| point["readings"][dof][key].as_f64().unwrap();
            for key in ["largest", "amplitude"] {
                let (got, expected) = (number(swept, key), number(computed, key));
                assert!((got / expected - 1.0).abs() < 1e-5, "{dof} {key}: {got} {expected}");
            }
            let turned = number(swept, "phase_deg") - number(computed, "phase_deg");
            // Phases are equal up to whole turns.
            assert!((turned - 360.0 * (turned / 360.0).round()).abs() < 1e-3, "{dof}: {turned}");
        }
    }
    let text = fs::read_to_string(folder.path().join("sweep.csv")).unwrap();
    let head = "direction,frequency_hz,period,largest_multiplier,settling_periods,drift,joint2_x_largest_m,";
    assert!(text.starts_with(head), "{text}");
}

#[test]
fn a_reading_in_numbers() {
    let point = ["continue", "--drive=joint1=10", "--from-hz=15", "--to-hz=15.1", "--at=tip.y", "--json"];
    let got = document(Path::new("."), 0, &point);
    let read = &got["points"][0]["readings"]["tip.y"];
    let number = |key: &str| format!("{:.5e}", read[key].as_f64().unwrap());
    assert_eq!([number("amplitude"), number("phase_deg")], ["3.21446e-5", "-2.04286e-2"]);
}
