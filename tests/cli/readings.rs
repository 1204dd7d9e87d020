//! The readings of computed motions in the documents and tables of `continue`, `backbone` and `sweep`.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{document, names, resonarm};

const PLACES: [&str; 4] = ["b_x", "b_y", "c_x", "c_y"];
const QUANTITIES: [(&str, &str, &str); 3] =
    [("displacement", "m", "receptance"), ("velocity", "m_s", "mobility"), ("acceleration", "m_s2", "accelerance")];

/// The columns of readings in their order.
fn columns() -> Vec<String> {
    let mut columns = Vec::new();
    for place in PLACES {
        for (quantity, unit, _) in QUANTITIES {
            for part in
                [format!("amplitude_{unit}"), "lag_deg".into(), format!("real_{unit}"), format!("imaginary_{unit}")]
            {
                columns.push(format!("{place}_{quantity}_{part}"));
            }
        }
    }
    columns
}

/// A number of a point's readings by the name of its column.
fn reading(point: &Value, column: &str) -> f64 {
    let (place, rest) = column.split_at(3);
    let (quantity, part) = rest[1..].split_once('_').unwrap();
    point["readings"][place][quantity][part].as_f64().unwrap()
}

/// Checks that a table has the readings of these points after `others` other columns.
fn has_the_readings(path: &Path, others: usize, points: &[&Value]) {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns = columns();
    assert_eq!(header[others..], columns, "{}", path.display());
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), points.len(), "{}", path.display());
    for (row, point) in rows.iter().zip(points) {
        assert_eq!(row.len(), header.len());
        for (cell, column) in row[others..].iter().zip(&columns) {
            let (got, expected) = (cell.parse::<f64>().unwrap(), reading(point, column));
            assert!((got - expected).abs() <= 1e-15 * expected.abs(), "{column}: {got} {expected}");
        }
    }
}

fn array<'a>(value: &'a Value, name: &str) -> Vec<&'a Value> {
    value[name].as_array().unwrap().iter().collect()
}

/// Off the first resonance of 22.1575 Hz, and within its half-power width of 0.004 Hz, under a small force: a motion is
/// the frequency response times the force.
#[test]
fn a_small_force_gives_frf_times_the_force() {
    for ends in [["12", "12.5"], ["22.1570", "22.1585"]] {
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

/// Every motion of the document and of the table has readings at each degree of freedom, also bifurcations and doubled
/// branches.
#[test]
fn continue_reads_every_motion() {
    let folder = tempfile::tempdir().unwrap();
    let branch = ["continue", "--drive", "joint1=800", "--angles-deg", "0,75", "--from-hz", "46", "--to-hz", "50"];
    let flags = ["--at", "joint1,tip.y", "--doubled", "--plot", "branch", "--json"];
    let got = document(folder.path(), 0, &[branch.as_slice(), &flags].concat());
    let doubled = array(&got, "doubled");
    assert!(!doubled.is_empty());
    let parts = [&got].into_iter().chain(doubled);
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

/// A sweep settles on what `continue` computes: the same readings of the same motion, whose points B and C are joint 2
/// and the tip of the chain.
#[test]
fn sweep_reads_what_continue_does() {
    let folder = tempfile::tempdir().unwrap();
    let range = ["--from-hz", "21", "--to-hz", "21.5", "--json"];
    let steps = ["sweep", "--torque1-nm", "60", "--points", "2", "--direction", "up", "--plot", "sweep", "--readings"];
    let swept = document(folder.path(), 0, &[steps.as_slice(), &range].concat());
    let walk = ["continue", "--drive", "joint1=60", "--at", "joint2.x,joint2.y,tip.x,tip.y"];
    let branch = document(folder.path(), 0, &[walk.as_slice(), &range].concat());
    let (swept, computed) = (array(&swept["sweeps"][0], "points"), array(&branch, "points"));
    has_the_readings(&folder.path().join("sweep.csv"), 12, &swept);
    for (swept, computed) in [(swept[0], computed[0]), (swept[1], computed[computed.len() - 1])] {
        assert_eq!(swept["frequency_hz"], computed["frequency_hz"]);
        for (place, dof) in PLACES.into_iter().zip(["joint2.x", "joint2.y", "tip.x", "tip.y"]) {
            let computed = &computed["readings"][dof];
            let [amplitude, phase_deg] = ["amplitude", "phase_deg"].map(|key| computed[key].as_f64().unwrap());
            let got = reading(swept, &format!("{place}_displacement_amplitude_m"));
            assert!((got / amplitude - 1.0).abs() < 1e-5, "{dof}: {got} {amplitude}");
            let lag_deg = reading(swept, &format!("{place}_displacement_lag_deg"));
            assert!((lag_deg + phase_deg).abs() < 1e-3, "{dof}: {lag_deg} {phase_deg}");
        }
    }
}

#[test]
fn a_reading_in_numbers() {
    let point = ["continue", "--drive=joint1=10", "--from-hz=15", "--to-hz=15.1", "--at=tip.y", "--json"];
    let got = document(Path::new("."), 0, &point);
    let read = &got["points"][0]["readings"]["tip.y"];
    let number = |key: &str| format!("{:.5e}", read[key].as_f64().unwrap());
    assert_eq!([number("amplitude"), number("phase_deg")], ["3.21446e-5", "-2.04286e-2"]);
}

#[test]
fn the_help_explains_the_keys() {
    for command in ["sweep"] {
        let help = resonarm(Path::new("."), &[command, "--help"]).stdout;
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        for words in
            ["--readings", "c_x_acceleration_amplitude_m_s2", "amplitude sin(Ωt − lag)", "A times what `frf` gives"]
        {
            assert!(help.contains(words), "{command}: {words}");
        }
    }
}
