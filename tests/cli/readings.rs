//! `--readings`: the readings a bench would take of computed motions, in the documents and tables of `continue`,
//! `backbone` and `sweep`.

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

/// Off the first resonance of 22.1575 Hz, and within its half-power width of 0.004 Hz, under a small force: the
/// frequency response times the force, and the frequency response's phase is the lag with the other sign.
#[test]
fn a_small_force_gives_frf_times_the_force() {
    for ends in [["12", "12.5"], ["22.1570", "22.1585"]] {
        let force_n = -2e-4;
        let range = ["--beta1-deg", "30", "--from-hz", ends[0], "--to-hz", ends[1]];
        let branch = ["continue", "--force-x-n=-2e-4", "--readings", "--json"];
        let branch = document(Path::new("."), 0, &[branch.as_slice(), &range].concat());
        let points = array(&branch, "points");
        for (quantity, unit, of_frf) in QUANTITIES {
            let frf = ["frf", "--drive", "force-x", "--points", "2", "--json", "--quantity", of_frf];
            let frf = document(Path::new("."), 0, &[frf.as_slice(), &range].concat());
            for (k, point) in [(0, points[0]), (1, points[points.len() - 1])] {
                assert_eq!(point["frequency_hz"], frf["frequency_hz"][k]);
                for curve in array(&frf, "responses").into_iter().skip(2) {
                    let place = curve["response"].as_str().unwrap().replace('-', "_");
                    let [re, im] = [0, 1].map(|part: usize| curve["value"][k][part].as_f64().unwrap() * force_n);
                    let got = |part: &str| reading(point, &format!("{place}_{quantity}_{part}"));
                    for (part, expected) in [("real", re), ("imaginary", im), ("amplitude", libm::hypot(re, im))] {
                        let got = got(&format!("{part}_{unit}"));
                        assert!((got / expected - 1.0).abs() < 1e-5, "{place} {quantity} {part}: {got} {expected}");
                    }
                    let turned = got("lag_deg") + libm::atan2(im, re).to_degrees();
                    assert!(turned.abs() < 1e-3, "{place} {quantity}: {turned}");
                }
            }
        }
    }
}

/// Every motion of the document and of the table has readings, also bifurcations and doubled branches; without the flag
/// none has.
#[test]
fn continue_reads_every_motion() {
    let folder = tempfile::tempdir().unwrap();
    let branch = ["continue", "--torque1-nm", "800", "--beta2-deg", "75", "--from-hz", "46", "--to-hz", "50"];
    let flags = ["--doubled", "--plot", "branch", "--json", "--readings"];
    let got = document(folder.path(), 0, &[branch.as_slice(), &flags].concat());
    let doubled = array(&got, "doubled");
    assert!(!doubled.is_empty());
    let parts = [&got].into_iter().chain(doubled);
    let all: Vec<&Value> =
        parts.clone().flat_map(|part| [array(part, "points"), array(part, "bifurcations")].concat()).collect();
    for point in &all {
        assert_eq!(names(&point["readings"]), PLACES, "{point}");
    }
    // The table follows the order of the branch; one point is enough to check.
    let text = fs::read_to_string(folder.path().join("branch.csv")).unwrap();
    assert_eq!(text.lines().count(), all.len() + 1);
    let first: Vec<String> = text.lines().take(2).map(|line| format!("{line}\n")).collect();
    fs::write(folder.path().join("first.csv"), first.concat()).unwrap();
    has_the_readings(&folder.path().join("first.csv"), 9, &all[..1]);

    let without = document(folder.path(), 0, &[branch.as_slice(), &["--json"]].concat());
    assert!(array(&without, "points").iter().all(|point| point.get("readings").is_none()));
    let plot = resonarm(folder.path(), &[branch.as_slice(), &["--plot", "plain"]].concat());
    assert_eq!(plot.code, 0, "{}", plot.stderr);
    let header = fs::read_to_string(folder.path().join("plain.csv")).unwrap();
    assert!(header.lines().next().unwrap().ends_with(",largest_multiplier,stability,bifurcation"), "{header}");
}

#[test]
fn backbone_reads_every_point() {
    let folder = tempfile::tempdir().unwrap();
    let curve = ["backbone", "--torque1-nm", "10", "--to-rad", "0.1", "--plot", "curve", "--json", "--readings"];
    let got = document(folder.path(), 0, &curve);
    let points = array(&got, "points");
    assert!(points.len() > 5);
    // The mode lags by 90°, so the acceleration leads by as much; the other mode changes it a little.
    let lag_deg = reading(points[points.len() - 1], "b_y_acceleration_lag_deg");
    assert!((lag_deg + 90.0).abs() < 1.0, "{lag_deg}");
    has_the_readings(&folder.path().join("curve.csv"), 6, &points);
    let response = fs::read_to_string(folder.path().join("curve-response.csv")).unwrap();
    assert!(response.lines().next().unwrap().ends_with("c_y_acceleration_imaginary_m_s2"), "{response}");
    let free = document(folder.path(), 0, &["backbone", "--undamped", "--to-rad", "0.01", "--readings", "--json"]);
    assert!(array(&free, "points").iter().all(|point| names(&point["readings"]) == PLACES));
}

/// A sweep settles on what `continue` computes: the same readings of the same motion.
#[test]
fn sweep_reads_what_continue_does() {
    let folder = tempfile::tempdir().unwrap();
    let range = ["--torque1-nm", "60", "--from-hz", "21", "--to-hz", "21.5", "--readings", "--json"];
    let steps = ["sweep", "--points", "2", "--direction", "up", "--plot", "sweep"];
    let swept = document(folder.path(), 0, &[steps.as_slice(), &range].concat());
    let branch = document(folder.path(), 0, &[["continue"].as_slice(), &range].concat());
    let (swept, computed) = (array(&swept["sweeps"][0], "points"), array(&branch, "points"));
    has_the_readings(&folder.path().join("sweep.csv"), 12, &swept);
    for (swept, computed) in [(swept[0], computed[0]), (swept[1], computed[computed.len() - 1])] {
        assert_eq!(swept["frequency_hz"], computed["frequency_hz"]);
        for column in columns().iter().filter(|column| !column.contains("_lag_")) {
            let amplitude = reading(computed, &column.replace("real", "amplitude").replace("imaginary", "amplitude"));
            let (got, expected) = (reading(swept, column), reading(computed, column));
            assert!((got - expected).abs() < 1e-5 * amplitude, "{column}: {got} {expected}");
        }
    }
}

#[test]
fn a_reading_in_numbers() {
    let point = ["continue", "--torque1-nm=10", "--from-hz=15", "--to-hz=15.1", "--readings", "--json"];
    let got = document(Path::new("."), 0, &point);
    let mut text = String::new();
    for (quantity, _, _) in QUANTITIES {
        for (part, value) in got["points"][0]["readings"]["c_y"][quantity].as_object().unwrap() {
            text.push_str(&format!("{quantity}.{part} {:.5e}\n", value.as_f64().unwrap()));
        }
    }
    insta::assert_snapshot!(text, @r"
    displacement.amplitude_m 3.21446e-5
    displacement.imaginary_m -1.14611e-8
    displacement.lag_deg 2.04286e-2
    displacement.real_m 3.21446e-5
    velocity.amplitude_m_s 3.02956e-3
    velocity.imaginary_m_s 3.02956e-3
    velocity.lag_deg -8.99796e1
    velocity.real_m_s 1.08018e-6
    acceleration.amplitude_m_s2 2.85529e-1
    acceleration.imaginary_m_s2 1.01805e-4
    acceleration.lag_deg -1.79980e2
    acceleration.real_m_s2 -2.85529e-1
    ");
}

#[test]
fn the_help_explains_the_keys() {
    for command in ["continue", "backbone", "sweep"] {
        let help = resonarm(Path::new("."), &[command, "--help"]).stdout;
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        for words in
            ["--readings", "c_x_acceleration_amplitude_m_s2", "amplitude sin(Ωt − lag)", "A times what `frf` gives"]
        {
            assert!(help.contains(words), "{command}: {words}");
        }
    }
}
