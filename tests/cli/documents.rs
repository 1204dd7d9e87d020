//! The JSON documents that scripts rely on, and the numbers in them.

use serde_json::Value;

use crate::{document, names, resonarm};

fn here() -> &'static std::path::Path {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn oracles(kind: &str) -> Vec<Value> {
    let file: Value = serde_json::from_str(include_str!("../oracles/oracles.json")).unwrap();
    file[kind].as_array().unwrap().clone()
}

/// The preset with the I_S2 of a case.
fn preset(case: &Value) -> &'static str {
    if case["I_S2"] == 1.5 { "irb1600-fitted" } else { "irb1600-table1" }
}

#[test]
fn modes_are_those_of_the_oracles() {
    for case in oracles("modes") {
        let beta2 = case["beta2_deg"].to_string();
        let got =
            document(here(), 0, &["modes", "--preset", preset(&case), "--angles-deg", &format!("0,{beta2}"), "--json"]);
        assert_eq!(names(&got), ["configuration", "coordinates", "modes"]);
        let modes = got["modes"].as_array().unwrap();
        assert_eq!(modes.len(), 2);
        for (i, mode) in modes.iter().enumerate() {
            assert_eq!(
                names(mode),
                ["damping_ratio", "frequency_hz", "pole_damping_ratio", "pole_frequency_hz", "shape"]
            );
            for name in ["frequency_hz", "damping_ratio"] {
                let (got, expected) = (mode[name].as_f64().unwrap(), case[name][i].as_f64().unwrap());
                assert!((got / expected - 1.0).abs() < 1e-9, "{name}: {got}, expected {expected}");
            }
        }
    }
}

/// Over β2, the poses of the oracles among the others: the same modes, and the CSV and the figure of them.
#[test]
fn modes_over_beta2_are_those_of_the_oracles() {
    for preset_name in ["irb1600-table1", "irb1600-fitted"] {
        let over = ["--over", "link2.angle_deg", "--from", "-150", "--to", "150", "--points", "11"];
        let range = [&["modes", "--preset", preset_name], &over[..]].concat();
        let got = document(here(), 0, &[range.as_slice(), &["--json"]].concat());
        let poses = got["points"].as_array().unwrap();
        assert_eq!((names(&got), poses.len()), (vec!["configuration", "coordinates", "over", "points"], 11));
        assert_eq!(
            (&got["over"], &got["configuration"]["structure"]["preset"]),
            (&"link2.angle_deg".into(), &preset_name.into())
        );
        let mut compared = 0;
        for case in oracles("modes").iter().filter(|case| preset(case) == preset_name) {
            let pose = poses.iter().find(|pose| pose["value"].as_f64() == case["beta2_deg"].as_f64()).unwrap();
            for (i, mode) in pose["modes"].as_array().unwrap().iter().enumerate() {
                let (got, expected) =
                    (mode["frequency_hz"].as_f64().unwrap(), case["frequency_hz"][i].as_f64().unwrap());
                assert!((got / expected - 1.0).abs() < 1e-9, "{got}, expected {expected}");
            }
            compared += 1;
        }
        // The poses that the oracles have of each preset.
        assert_eq!(compared, 6);
        // An angle and its opposite mirror each other.
        for key in ["frequency_hz", "damping_ratio"] {
            let [first, last] = [0, 10].map(|k: usize| poses[k]["modes"][1][key].as_f64().unwrap());
            assert!((first / last - 1.0).abs() < 1e-12, "{key}: {first} {last}");
        }

        let folder = tempfile::tempdir().unwrap();
        let csv = crate::resonarm(folder.path(), &range);
        let mut lines = csv.stdout.lines();
        let header = lines.next().unwrap();
        assert!(
            header
                .starts_with("link2_angle_deg,frequency1_hz,damping_ratio1,shape1_alpha1,shape1_alpha2,frequency2_hz,")
        );
        for (line, pose) in lines.by_ref().zip(poses) {
            let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
            let modes = &pose["modes"];
            let expected = [&pose["value"], &modes[0]["frequency_hz"], &modes[0]["damping_ratio"]];
            let near = |got: f64, expected: &Value| (got - expected.as_f64().unwrap()).abs() <= 1e-14 * got.abs();
            assert!(values.iter().zip(expected).all(|(got, expected)| near(*got, expected)), "{line} {pose}");
            assert!(values.len() == 9 && near(values[5], &modes[1]["frequency_hz"]), "{line} {pose}");
        }
        plots_beside_its_data(folder.path(), &range, &csv.stdout, &got);
    }
}

/// With `--plot` the data are in files beside the figure, and standard output lists them, or with `--json` has the
/// document.
fn plots_beside_its_data(folder: &std::path::Path, command: &[&str], csv: &str, document: &Value) {
    let plot = [command, &["--plot", "figure"]].concat();
    let said = crate::resonarm(folder, &plot).stdout;
    assert!(said == "written to figure.svg, figure.png, figure.txt, figure.csv, figure.json\n", "{} bytes", said.len());
    assert!(folder.join("figure.svg").exists() && folder.join("figure.png").exists());
    assert!(std::fs::read_to_string(folder.join("figure.csv")).unwrap() == csv);
    let json = std::fs::read_to_string(folder.join("figure.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&json).unwrap(), *document);
    assert_eq!(crate::document(folder, 0, &[plot.as_slice(), &["--overwrite", "--json"]].concat()), *document);
}

#[test]
fn a_plotted_response_leaves_standard_output_readable() {
    let folder = tempfile::tempdir().unwrap();
    let frf = ["frf", "--drive", "joint1", "--at", "joint1,joint2,joint2.y,tip.x,tip.y"];
    let csv = crate::resonarm(folder.path(), &frf).stdout;
    let with_json = document(folder.path(), 0, &[&frf[..], &["--json"]].concat());
    plots_beside_its_data(folder.path(), &frf, &csv, &with_json);
    // One unit per axis: rad and m are separate.
    let svg = std::fs::read_to_string(folder.path().join("figure.svg")).unwrap();
    let axes = ["receptance (rad per N·m)", "receptance (m per N·m)", "phase (°)"];
    assert!(axes.iter().all(|axis| svg.contains(&format!(">{axis}<"))), "{svg}");
    // Every response is in the legend of its modulus and in that of the phases.
    for response in ["joint1", "joint2", "joint2.y", "tip.x", "tip.y"] {
        assert_eq!(svg.matches(&format!(">{response}<")).count(), 2, "{response}");
    }
}

/// The default frequencies include the peak of a lightly damped mode: half a width off the natural frequency the
/// modulus is 1/√2 of it.
#[test]
fn default_frequencies_meet_the_peaks() {
    let drive = ["frf", "--drive", "tip.x", "--quantity", "accelerance"];
    let got = document(here(), 0, &[drive.as_slice(), &["--json"]].concat());
    let modulus = |at: &Value| libm::hypot(at[0].as_f64().unwrap(), at[1].as_f64().unwrap());
    let values = got["responses"][0]["value"].as_array().unwrap();
    let largest = values.iter().map(modulus).fold(0.0, f64::max);
    let modes = document(here(), 0, &["modes", "--json"]);
    let natural = modes["modes"][0]["frequency_hz"].as_f64().unwrap();
    // A range that begins at the natural frequency has it as its first point.
    let ends = [natural, natural * 1.5].map(|hz| hz.to_string());
    let near = ["--from-hz", &ends[0], "--to-hz", &ends[1], "--points", "2", "--json"];
    let peak = modulus(&document(here(), 0, &[drive.as_slice(), &near].concat())["responses"][0]["value"][0]);
    assert!((largest / peak - 1.0).abs() < 1e-3, "{largest} of {peak}");
}

/// Every response has its unit, in the document and in the columns; both have the same numbers. At rest α1 is the
/// torque over the stiffness of the joint, and B moves by l1 α1, along y with link 1 along x.
#[test]
fn responses_have_their_units() {
    let range = ["frf", "--from-hz", "0", "--to-hz", "60", "--points", "7", "--at", "joint1,joint2.y"];
    let got = document(here(), 0, &[range.as_slice(), &["--json"]].concat());
    let expected = ["configuration", "coordinates", "drive", "frequency_hz", "quantity", "responses"];
    assert_eq!(names(&got), expected);
    let curves = got["responses"].as_array().unwrap();
    let said = curves.iter().map(|curve| (curve["at"].as_str().unwrap(), curve["unit"].as_str().unwrap()));
    assert_eq!(said.collect::<Vec<_>>(), [("joint1", "rad per N·m"), ("joint2.y", "m per N·m")]);
    let at_rest = [0, 1].map(|k: usize| curves[k]["value"][0][0].as_f64().unwrap());
    // 555 000 N·m/rad is the stiffness of joint 1, and 0.63 m the length of link 1.
    assert!((at_rest[0] * 555_000.0 - 1.0).abs() < 1e-14 && (at_rest[1] / at_rest[0] - 0.63).abs() < 1e-14);

    let csv = crate::resonarm(here(), &range);
    let mut lines = csv.stdout.lines();
    let header = "frequency_hz,joint1_modulus_rad_per_nm,joint1_phase_deg,joint2_y_modulus_m_per_nm,joint2_y_phase_deg";
    assert_eq!(lines.next(), Some(header));
    for (k, line) in lines.by_ref().enumerate() {
        let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
        for (curve, polar) in curves.iter().zip(values[1..].chunks(2)) {
            let [re, im] = [0, 1].map(|part: usize| curve["value"][k][part].as_f64().unwrap());
            // Modulus and phase of the table, back to real and imaginary part.
            let (sine, cosine) = libm::sincos(polar[1].to_radians());
            let error = (polar[0] * cosine - re).abs() + (polar[0] * sine - im).abs();
            assert!(error < 1e-14 * polar[0], "{line} {curve}");
        }
    }
    let force = ["frf", "--drive", "tip.x", "--at", "joint2,tip.x", "--quantity", "accelerance", "--points", "2"];
    let header = crate::resonarm(here(), &force).stdout.lines().next().map(String::from).unwrap();
    assert!(
        header.contains(",joint2_modulus_rad_s2_per_n,") && header.contains(",tip_x_modulus_m_s2_per_n,"),
        "{header}"
    );
}

/// Every trajectory is met to 1e-9 (rad, rad/s) at 32 kHz, by the default scheme.
#[test]
fn simulate_meets_the_oracles() {
    let mut worst = 0.0_f64;
    for case in oracles("trajectories") {
        let text = |name: &str| case[name].to_string();
        let initial = case["initial"].as_array().unwrap().iter().map(Value::to_string).collect::<Vec<_>>().join(",");
        for (i, t_s) in case["t_s"].as_array().unwrap().iter().enumerate().skip(1) {
            let angles = format!("{},{}", text("beta1_deg"), text("beta2_deg"));
            let loads = [("joint1", "torque1_nm"), ("tip.x", "force_x_n"), ("tip.y", "force_y_n")];
            let loads = loads.iter().filter(|(_, key)| case[key].as_f64() != Some(0.0));
            let loads: Vec<String> = loads.map(|(dof, key)| format!("--drive={dof}={}", text(key))).collect();
            let start = ["simulate", "--preset", preset(&case), "--angles-deg", &angles, "--initial", &initial];
            let loads: Vec<&str> = loads.iter().map(String::as_str).collect();
            let (hz, length) = (text("excitation_hz"), t_s.to_string());
            let rest = ["--frequency-hz", &hz, "--rate-hz", "32000", "--duration-s", &length, "--json"];
            let simulate = [&start[..], &loads, &rest];
            let got = document(here(), 0, &simulate.concat());
            let keys = ["configuration", "coordinates", "element_states", "position", "steps", "steps_not_located"];
            assert_eq!(names(&got), [&keys[..], &["switches", "t_s", "velocity", "wall_s"]].concat());
            assert_eq!((&got["t_s"], got["steps"].as_f64()), (t_s, t_s.as_f64().map(|t_s| t_s * 32e3)));
            for (name, of_case) in [("position", "alpha_rad"), ("velocity", "alpha_dot_rad_s")] {
                for k in 0..2 {
                    let (got, expected) = (got[name][k].as_f64().unwrap(), case[of_case][i][k].as_f64().unwrap());
                    worst = worst.max((got - expected).abs());
                }
            }
        }
    }
    // Without a difference nothing would have been compared.
    assert!(worst < 1e-9 && worst > 0.0, "{worst:e}");
}

/// Every document has the structure with all of its parameters; headers state the differences from the preset.
#[test]
fn a_changed_arm_is_in_every_document_and_header() {
    let folder = tempfile::tempdir().unwrap();
    let text = "structure = { angles_deg = [20, 30], set = { 'link2.mass_kg' = 40 } }
        excitation.amplitude.exciter_x = 1
        excitation.profile = { waveform = 'dwell', frequency_hz = 10, duration_s = 0.3, settle_s = 0.1 }";
    std::fs::write(folder.path().join("own.toml"), text).unwrap();
    let commands: [&[&str]; 9] = [
        &["modes"],
        &["frf", "--points", "2"],
        &["simulate", "--duration-s", "0.01"],
        &["integrators", "--drift-steps", "10"],
        &["continue", "--drive", "joint1=1", "--from-hz", "10", "--to-hz", "10.1"],
        &["backbone", "--mode", "1", "--to", "0.001"],
        &["poincare", "--drive", "joint1=1", "--frequency-hz", "10", "--time-constants", "0.01"],
        &["run", "--mode", "free", "--duration-s", "0.1"],
        &["demo", "--speed", "0"],
    ];
    for command in commands {
        let got = document(folder.path(), 0, &[command, &["--scenario", "own.toml", "--json"]].concat());
        let structure = &got["configuration"]["structure"];
        assert_eq!(structure["angles_deg"], serde_json::json!([20.0, 30.0]), "{command:?}");
        assert_eq!(structure["links"][1]["mass_kg"].as_f64(), Some(40.0), "{command:?}");
        if matches!(command[0], "run" | "demo") {
            assert_eq!(
                got["configuration"]["drive"],
                serde_json::json!({ "tip.x": { "amplitude": 1.0, "unit": "N" } }),
                "{command:?}"
            );
        }
    }
    for command in [["modes"].as_slice(), &["integrators", "--drift-steps", "10"]] {
        let header = crate::resonarm(folder.path(), &[command, &["--scenario", "own.toml"]].concat()).stdout;
        let expected = "irb1600-fitted with link2.mass_kg = 40 (preset 50.58) at 20°, 30°";
        assert!(header.starts_with(expected), "{header}");
    }
    let plot = ["frf", "--points", "2", "--plot", "figure", "--scenario", "own.toml"];
    assert_eq!(crate::resonarm(folder.path(), &plot).code, 0);
    let svg = std::fs::read_to_string(folder.path().join("figure.svg")).unwrap();
    assert!(svg.contains(">irb1600-fitted with link2.mass_kg = 40 (preset 50.58) at 20°, 30°<"), "{svg}");
    let caption = std::fs::read_to_string(folder.path().join("figure.txt")).unwrap();
    insta::assert_snapshot!(caption, @"
    Frequency response to a load at joint1
    irb1600-fitted with link2.mass_kg = 40 (preset 50.58) at 20°, 30°
    ");
}

/// Headers, figures and documents call a structure by its name; the caption has what is set, if it is too much for a line.
#[test]
fn a_named_structure_is_called_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(
        folder.join("own.toml"),
        "structure = { name = 'lab arm', set = { 'link1.length_m' = 0.6, 'link2.mass_kg' = 40 } }",
    )
    .unwrap();
    let header = crate::resonarm(folder, &["modes", "--scenario", "own.toml"]).stdout;
    assert!(
        header.starts_with("lab arm with link1.length_m = 0.6 (preset 0.63), link2.mass_kg = 40 (preset 50.58)\n"),
        "{header}"
    );
    let plot = ["frf", "--points", "2", "--plot", "figure", "--scenario", "own.toml", "--json"];
    assert_eq!(document(folder, 0, &plot)["configuration"]["structure"]["name"], "lab arm");
    let read = |file: &str| std::fs::read_to_string(folder.join(file)).unwrap();
    assert!(read("figure.svg").contains(">lab arm with 2 changed parameters<"));
    assert!(
        read("figure.txt").ends_with("\nset: link1.length_m = 0.6 (preset 0.63), link2.mass_kg = 40 (preset 50.58)\n")
    );
}

#[test]
fn a_pose_may_come_from_a_scenario_and_flags_take_precedence() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("arm.toml"),
        "[structure]\npreset = 'irb1600-table1'\nangles_deg = [0.0, 30.0]\n",
    )
    .unwrap();
    let modes = |arguments: &[&str]| document(folder.path(), 0, &[&["modes", "--json"], arguments].concat());
    assert_eq!(modes(&["--scenario", "arm.toml"]), modes(&["--preset", "irb1600-table1", "--angles-deg", "0,30"]));
    let both = ["--scenario", "arm.toml", "--preset", "irb1600-fitted"];
    assert_eq!(modes(&both), modes(&["--preset", "irb1600-fitted", "--angles-deg", "0,30"]));
}

#[test]
fn run_reports_steps_bus_and_recording() {
    let folder = tempfile::tempdir().unwrap();
    let run = ["run", "--mode", "free", "--duration-s", "0.5", "--record", "run.mcap", "--json"];
    let got = document(folder.path(), 0, &run);
    let keys = [
        "bus",
        "bus_loss",
        "configuration",
        "error",
        "exciter",
        "exec_us",
        "fault",
        "outcome",
        "overrun_causes",
        "overruns",
        "pacing",
        "partner_fault",
        "recording",
        "refused",
        "responses",
        "round_trip_us",
        "samples",
        "slipped",
        "steps",
        "wakeup_us",
    ];
    assert_eq!(names(&got), keys);
    assert_eq!(names(&got["bus"]), ["dropped", "errors", "malformed", "other_sender", "received", "refused", "sent"]);
    // The sine is at a zero after 0.5 s, so there is nothing to ramp. Two integration steps a sample.
    assert_eq!((&got["samples"], &got["steps"], &got["overruns"]), (&501.into(), &1000.into(), &0.into()));
    assert_eq!((&got["outcome"], &got["recording"]), (&"completed".into(), &"run.mcap".into()));
    assert!(got["bus"]["received"].as_u64() > Some(500) && got["bus"]["sent"].as_u64() > Some(1500), "{got}");
    let without = document(folder.path(), 0, &["run", "--mode", "free", "--duration-s", "0.1", "--json"]);
    assert!(without["recording"].is_null());

    let resim = document(folder.path(), 0, &["resim", "run.mcap", "--json"]);
    assert_eq!(names(&resim), ["first_divergence", "identical", "integrity", "max_drift_rad", "samples", "steps"]);
    assert_eq!(
        (&resim["identical"], &resim["samples"], &resim["steps"]),
        (&true.into(), &got["samples"], &got["steps"])
    );
    assert!(resim["first_divergence"].is_null() && resim["max_drift_rad"] == 0.0);
}

#[test]
fn doctor_says_what_can_be_fixed() {
    let got = document(here(), 0, &["doctor", "--json"]);
    let findings = got["findings"].as_array().unwrap();
    let subjects: Vec<_> = findings.iter().map(|finding| finding["subject"].as_str().unwrap()).collect();
    assert_eq!(&subjects[..4], ["SocketCAN", "CAN interfaces", "python-can", "live view"]);
    let live = if cfg!(feature = "live") { "in this build" } else { "not in this build" };
    assert_eq!(findings[3]["state"], live);
    let python = findings[2]["state"].as_str().unwrap();
    assert_eq!(python.starts_with("in this build"), cfg!(feature = "python-can"), "{python}");
    assert!(findings.len() > 3 && findings.iter().all(|finding| names(finding) == ["mend", "state", "subject"]));
}

/// The curve from one fold of a branch turns back in a cusp and returns at the other fold.
#[test]
fn curves_of_folds_are_in_files_beside_the_branch() {
    let branch = ["continue", "--drive", "joint1=60", "--from-hz", "21", "--to-hz", "23.5", "--json"];
    let got = document(here(), 0, &[branch.as_slice(), &["--curves-in", "amplitude", "--curves-to", "5"]].concat());
    let keys = [
        "bifurcations",
        "configuration",
        "coordinates",
        "curves",
        "ended",
        "isolas",
        "peaks",
        "points",
        "searched",
        "unlocated",
        "wall_s",
    ];
    assert_eq!(names(&got), keys);
    let folds: Vec<f64> =
        got["bifurcations"].as_array().unwrap().iter().map(|fold| fold["frequency_hz"].as_f64().unwrap()).collect();
    let curves = got["curves"].as_array().unwrap();
    assert_eq!((folds.len(), curves.len(), curves[0]["kind"].as_str()), (2, 1, Some("fold")));
    let points = curves[0]["points"].as_array().unwrap();
    let at = |k: usize, name: &str| points[k][name].as_f64().unwrap();
    for (k, fold) in [(0, folds[0]), (points.len() - 1, folds[1])] {
        assert!((at(k, "frequency_hz") / fold - 1.0).abs() < 1e-9 && at(k, "amplitude") == 60.0, "{}", points[k]);
    }
    let cusp_nm = (0..points.len()).map(|k| at(k, "amplitude")).fold(f64::INFINITY, f64::min);
    assert!(cusp_nm > 5.0 && cusp_nm < 20.0, "{cusp_nm}");
}

/// With gravity α counts from the arm at rest under its weight, and β is the pose before it sags.
#[test]
fn modes_state_the_sag_under_gravity() {
    let folder = tempfile::tempdir().unwrap();
    let gravity = "[structure]\ngravity_m_s2 = 9.80665\nset = { 'link1.mass_kg' = 30.0, 'link1.centre_of_mass_m' = 0.1, \
        'link1.inertia_kg_m2' = 0.25 }\n";
    std::fs::write(folder.path().join("heavy.toml"), gravity).unwrap();
    let found = document(folder.path(), 0, &["modes", "--scenario", "heavy.toml", "--json"]);
    let structure = &found["configuration"]["structure"];
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let of = |link: usize, key: &str| number(&structure["links"][link][key]);
    let sag_rad = [0, 1].map(|joint| number(&found["configuration"]["static_deflection_rad"][joint]));
    // K α + G(β + α) = 0 at the links' angles q.
    let q1 = of(0, "angle_deg").to_radians() + sag_rad[0];
    let q12 = q1 + of(1, "angle_deg").to_radians() + sag_rad[1];
    let g = 9.80665;
    let second = g * of(1, "mass_kg") * of(1, "centre_of_mass_m") * libm::cos(q12);
    let first = g * (30.0 * 0.1 + of(1, "mass_kg") * of(0, "length_m")) * libm::cos(q1) + second;
    for (joint, moment_nm) in [first, second].into_iter().enumerate() {
        let spring_nm = of(joint, "stiffness_nm_rad") * sag_rad[joint];
        assert!((spring_nm + moment_nm).abs() < 1e-9 * moment_nm.abs() && sag_rad[joint] != 0.0, "{sag_rad:?}");
    }
    let said = resonarm(folder.path(), &["modes", "--scenario", "heavy.toml"]).stdout;
    let line = format!(
        "the structure sags under its weight by {:+.5} rad in joint 1, {:+.5} rad in joint 2",
        sag_rad[0], sag_rad[1]
    );
    assert!(said.contains(&line), "{said}");
    let light = document(folder.path(), 0, &["modes", "--json"]);
    assert!(light["configuration"]["static_deflection_rad"].is_null());
}
