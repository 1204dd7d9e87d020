//! `experiment fig9`: what it says, and what it refuses.

use std::fs;

use insta::assert_snapshot;

use crate::{complaint, document, names, resonarm};

/// A brake that settles the arm within a second.
const BENCH: &str = "arm = { beta1_deg = -76.5413, beta2_deg = 120 }\nsimulation = { scheme = 'rk4' }\n\
    [rig.shaker]\nmoving_mass_kg = 0.01\nstiffness_n_m = 0\ndamping_n_s_m = 1000\nforce_factor_n_a = 30\nresistance_ohm = 1\n\
    inductance_h = 0\nstroke_m = 0.1\ncurrent_limit_a = 22\nvoltage_limit_v = 1000\n";

const SMALL: [&str; 12] = [
    "experiment",
    "fig9",
    "--scenario",
    "bench.toml",
    "--first-force-n",
    "10",
    "--second-force-n",
    "1",
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
    for words in ["zone 1: 10 N along x", "zone 2: 1 N along x", "jumps     measured: none", "written to zones.svg"] {
        assert!(said.stdout.contains(words), "{words}: {}", said.stdout);
    }
    let found = document(folder, 0, &[&SMALL[..], &["--json"]].concat());
    assert_eq!(names(&found), ["configuration", "simulated_s", "wall_s", "zones"]);
    for zone in found["zones"].as_array().unwrap() {
        assert_eq!(
            names(zone),
            ["backbone", "computed", "down", "force_n", "mode_number", "range_hz", "up", "walk"],
            "{zone:#}"
        );
        for (run, points) in [("walk", 3), ("backbone", 10), ("up", 5), ("down", 5)] {
            let run = &zone[run];
            assert_eq!(run["outcome"], "finished");
            let points_read = run["points"].as_array().unwrap();
            assert!((points..=points + 2).contains(&points_read.len()), "{run:#}");
            assert!(points_read.iter().all(|point| point["settled"] == true), "{run:#}");
        }
        assert_eq!(zone["computed"]["jumps"], serde_json::Value::Null);
    }
    let csv = fs::read_to_string(folder.join("zones.csv")).unwrap();
    assert!(csv.starts_with("zone,run,frequency_hz,"), "{csv}");
    // What was drawn is not drawn over.
    assert!(complaint(folder, 2, &[&SMALL[..], &["--plot", "zones"]].concat()).contains("--overwrite"));
}

#[test]
fn what_can_not_be_measured_is_said_before_it_is_tried() {
    let folder = tempfile::tempdir().unwrap();
    let refusal = |flags: &[&str]| complaint(folder.path(), 2, &[&["experiment", "fig9"], flags].concat());
    assert_snapshot!(refusal(&["--from-hz", "30"]), @"resonarm: --from-hz is 30: it must be above 0 and below the natural frequency of 26.84 Hz, so that the zone holds it");
    assert_snapshot!(refusal(&["--to-hz", "40"]), @"resonarm: --to-hz is 40: it must be above the natural frequency of 40.36 Hz, so that the zone holds it");
    assert_snapshot!(refusal(&["--step-hz", "0"]), @"resonarm: --step-hz is 0: it must be positive, and at least 0.0020, the range in 10000 steps");
    assert_snapshot!(refusal(&["--first-force-n", "1000"]), @"resonarm: control.amplitude.force_x_n is 1000, beyond the shaker's blocked force, 660: lower it, or raise the limit if the exciter has more");
    assert_snapshot!(refusal(&["--second-force-n", "0"]), @"resonarm: control.amplitude: excitation: the amplitude is 0: set `force_x_n`, `force_y_n`, `torque1_nm` or `torque2_nm`");
    assert_snapshot!(refusal(&["--rate-hz", "300"]), @"resonarm: control: 300 samples a second are too few for a mode at 40.36 Hz: at least 445 are needed");
}
