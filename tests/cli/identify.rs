//! `identify`: results from the readings of a recording against the arm's equations.

use std::fs;
use std::path::Path;

use insta::assert_snapshot;
use resonarm::recording::Recording;
use serde_json::Value;

use crate::{complaint, document, names, resonarm};

/// Runs an excitation of a small force and records it.
fn record(folder: &Path, name: &str, amplitude: &str, profile: &str) {
    let scenario = format!("[excitation]\namplitude = {{ {amplitude} }}\nprofile = {{ {profile} }}\n");
    let (scenario_file, recording) = (format!("{name}.toml"), format!("{name}.mcap"));
    fs::write(folder.join(&scenario_file), scenario).unwrap();
    let run = ["run", "--mode", "free", "--scenario", &scenario_file, "--record", &recording];
    assert_eq!(resonarm(folder, &run).code, 0);
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn modes_are_identified_from_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    record(
        folder,
        "random",
        "exciter_y = 6",
        "waveform = 'random', from_hz = 5, to_hz = 80, duration_s = 30, seed = 2",
    );
    record(folder, "impact", "exciter_y = 40", "waveform = 'impulse', pulse_s = 0.008, duration_s = 20");
    let computed = document(folder, 0, &["modes", "--json"]);
    for (recording, averaging, averages) in [("random.mcap", "welch", 15), ("impact.mcap", "single", 1)] {
        let found = document(folder, 0, &["identify", recording, "--json"]);
        let run = &found["runs"][0];
        assert_eq!((&run["averaging"], &run["averages"]), (&averaging.into(), &averages.into()));
        assert_eq!(found["modes"].as_array().unwrap().len(), 2, "{:#}", found["modes"]);
        for mode in 0..2 {
            let (found, computed) = (&found["modes"][mode], &computed["modes"][mode]);
            let ratio = |key: &str| number(&found[key]) / number(&computed[key]) - 1.0;
            assert!(ratio("pole_frequency_hz").abs() < 1e-4, "{found} {computed}");
            // The time constant of the first mode is 45 s: records of 20 and 30 s state its damping less well than its
            // frequency.
            assert!(ratio("pole_damping_ratio").abs() < 0.05, "{found} {computed}");
        }
        // The force acts along y.
        assert_eq!(number(&run["direction"][1]), 1.0);
        assert_eq!(found["at"], serde_json::json!(["joint2.x", "joint2.y", "tip.x", "tip.y"]));
        let count = run["frequency_hz"].as_array().unwrap().len();
        for response in run["responses"].as_array().unwrap() {
            assert_eq!(names(response), ["at", "coherence", "fitted", "h1", "h2", "response", "unit"]);
            assert_eq!(response["fitted"].as_array().unwrap().len(), count);
            assert_eq!(response["h1"].as_array().unwrap().len(), count);
            // Of a single record any response has the coherence 1, which says nothing.
            assert_eq!(response["coherence"].is_null(), averages == 1);
        }
    }
    let plot = ["identify", "random.mcap", "--from-hz", "10", "--to-hz", "70", "--plot", "found"];
    let said = resonarm(folder, &plot);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(
        said.stdout.ends_with(
            "written to found.svg, found.png, found.txt, found.csv, found.json, found-poles.svg, found-poles.png, found-poles.txt\n"
        ),
        "{}",
        said.stdout
    );
    let table = fs::read_to_string(folder.join("found.csv")).unwrap();
    assert_snapshot!(table.lines().next().unwrap(), @"frequency_hz,b_x_h1_modulus_m_s2_per_n,b_x_h1_phase_deg,b_x_h2_modulus_m_s2_per_n,b_x_h2_phase_deg,b_x_fitted_modulus_m_s2_per_n,b_x_fitted_phase_deg,b_x_coherence,b_y_h1_modulus_m_s2_per_n,b_y_h1_phase_deg,b_y_h2_modulus_m_s2_per_n,b_y_h2_phase_deg,b_y_fitted_modulus_m_s2_per_n,b_y_fitted_phase_deg,b_y_coherence,c_x_h1_modulus_m_s2_per_n,c_x_h1_phase_deg,c_x_h2_modulus_m_s2_per_n,c_x_h2_phase_deg,c_x_fitted_modulus_m_s2_per_n,c_x_fitted_phase_deg,c_x_coherence,c_y_h1_modulus_m_s2_per_n,c_y_h1_phase_deg,c_y_h2_modulus_m_s2_per_n,c_y_h2_phase_deg,c_y_fitted_modulus_m_s2_per_n,c_y_fitted_phase_deg,c_y_coherence");
    assert_snapshot!(complaint(folder, 2, &plot), @"resonarm: found.svg already exists: choose another place, or allow overwriting it (--overwrite)");
    // There is no resonance between the modes.
    let none = resonarm(folder, &["identify", "random.mcap", "--from-hz", "30", "--to-hz", "36"]);
    assert_eq!(none.code, 1, "{}", none.stdout);
    assert!(none.stderr.contains("there is no resonance from 30 to 36 Hz"), "{}", none.stderr);
}

/// Modes are numbered as in the arm, and a missing one is listed with the reason.
#[test]
fn a_missing_mode_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let shaker = "structure.angles_deg = [30, 60]\n[rig.shaker]\namplifier = 'voltage'\nmoving_mass_kg = 0.5\nstiffness_n_m = 2000.0\n\
        damping_n_s_m = 10.0\nforce_factor_n_a = 20.0\nresistance_ohm = 2.0\ninductance_h = 2.1e-3\nstroke_m = 0.0127\n\
        current_limit_a = 15.0\nvoltage_limit_v = 60.0\n[excitation]\namplitude = { exciter_x = 40 }\n\
        profile = { waveform = 'impulse', pulse_s = 0.008, duration_s = 20 }\n";
    fs::write(folder.join("braked.toml"), shaker).unwrap();
    fs::write(folder.join("instant.toml"), format!("rig.converter = 'instant'\n{shaker}")).unwrap();
    for name in ["braked", "instant"] {
        let (scenario, recording) = (format!("{name}.toml"), format!("{name}.mcap"));
        let run = ["run", "--mode", "free", "--scenario", &scenario, "--record", &recording];
        assert_eq!(resonarm(folder, &run).code, 0);
    }
    let found = document(folder, 0, &["identify", "braked.mcap", "--json"]);
    let [missing] = &found["missing"].as_array().unwrap()[..] else { panic!("{:#}", found["missing"]) };
    assert_eq!((&missing["mode"], &missing["reason"]), (&1.into(), &"force-in-noise".into()));
    // The shaker's force has noise at the other mode, too.
    let mode = &found["modes"][0];
    assert_eq!((&mode["mode"], &mode["pole_frequency_deviation_hz"]), (&2.into(), &Value::Null));
    assert!(mode["doubts"].as_array().unwrap().iter().any(|doubt| doubt["reason"] == "force-in-noise"), "{mode:#}");
    let said = resonarm(folder, &["identify", "braked.mcap"]);
    assert!(said.stderr.contains("mode 1, at 22.16 Hz in the scenario, was not found: "), "{}", said.stderr);
    assert!(!said.stderr.contains("images"), "{}", said.stderr);
    let said = resonarm(folder, &["identify", "instant.mcap"]);
    assert!(said.stderr.contains("rig.converter is `instant`: the head reads images"), "{}", said.stderr);
    // The second mode keeps its number if it is alone in the band.
    let random = "waveform = 'random', from_hz = 40, to_hz = 60, duration_s = 20, seed = 2";
    record(folder, "second", "exciter_y = 6", random);
    let found = document(folder, 0, &["identify", "second.mcap", "--json"]);
    assert_eq!((&found["modes"][0]["mode"], found["missing"].as_array().unwrap().len()), (&2.into(), 0));
}

/// Strong dampers couple the modes: what is identified are the poles, which `modes` states beside the frequencies of the
/// undamped arm. Both were called undamped frequencies, 47 stated deviations apart.
#[test]
fn poles_are_compared_with_poles() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scenario = "[structure]\nangles_deg = [30.0, 60.0]\n\
        set = { 'link1.damping_nm_s_rad' = 60.0, 'link2.damping_nm_s_rad' = 60.0 }\n\
        [rig.head]\nnoise_rms_n = 0.02\n[rig.sensors.b]\nnoise_rms_m_s2 = 0.03\n\
        [rig.sensors.c]\nnoise_rms_m_s2 = 0.03\n[excitation]\namplitude = { exciter_x = 40.0 }\n\
        profile = { waveform = \"random\", from_hz = 5.0, to_hz = 120.0, duration_s = 20.0 }\n";
    fs::write(folder.join("damped.toml"), scenario).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "damped.toml", "--record", "damped.mcap", "--json"];
    document(folder, 0, &run);
    let found = document(folder, 0, &["identify", "damped.mcap", "--json"]);
    let computed = document(folder, 0, &["modes", "--scenario", "damped.toml", "--json"]);
    let (found, computed) = (&found["modes"][0], &computed["modes"][0]);
    let deviations = |of: &str| {
        let off = number(&found["pole_frequency_hz"]) - number(&computed[of]);
        (off / number(&found["pole_frequency_deviation_hz"])).abs()
    };
    assert!(deviations("pole_frequency_hz") < 5.0, "{found:#} {computed:#}");
    assert!(deviations("frequency_hz") > 5.0, "{found:#} {computed:#}");
    let ratio = number(&found["pole_damping_ratio"]) / number(&computed["pole_damping_ratio"]);
    assert!((ratio - 1.0).abs() < 0.01, "{found:#} {computed:#}");
    assert!(found.get("frequency_hz").is_none(), "{found:#}");
    let said = resonarm(folder, &["identify", "damped.mcap"]).stdout;
    assert!(said.contains("pole frequency |λ|/2π (Hz)") && !said.contains("undamped"), "{said}");
}

#[test]
fn recordings_without_modes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let random = |duration_s: &str| format!("waveform = 'random', from_hz = 5, to_hz = 80, duration_s = {duration_s}");
    record(folder, "torque", "joint1 = 5", &random("2"));
    record(folder, "short", "exciter_y = 5", &random("0.1"));
    record(folder, "force", "exciter_y = 5", &random("4"));
    fs::write(folder.join("notes.txt"), "no recording").unwrap();
    let says = |arguments: &[&str]| complaint(folder, 2, &[&["identify"], arguments].concat());
    assert_snapshot!(says(&["torque.mcap"]), @"resonarm: the impedance head reads no force beyond its own noise (0.012 N): expected an excitation by a force at the head; apply a larger one");
    assert_snapshot!(says(&["short.mcap"]), @"resonarm: the record has 150 samples, but at least 256 are needed: record for longer");
    assert_snapshot!(says(&["force.mcap", "--from-hz", "200", "--to-hz", "300"]), @"resonarm: the force has no energy from 200 to 300 Hz: drive the structure there, or name the band that was driven");
    assert_snapshot!(says(&["force.mcap", "--segment-s", "-1"]), @"resonarm: --segment-s: it must be positive");
    assert_snapshot!(says(&["force.mcap", "--segment-s", "100"]), @"resonarm: a segment has 100000 samples: it must have from 16 to as many as the record, 4050");
    assert_snapshot!(says(&["notes.txt"]), @"resonarm: `notes.txt` is not an MCAP file: it begins with `no recor`");
}

/// Structures of three modes, and of two that are close: random forces of a minute, no mode missing, none invented, shapes and
/// damping ratios at the true values.
#[test]
fn modes_of_known_structures_are_right() {
    let three = |damping: [f64; 3]| {
        [(31.0, damping[0], 0.9, 0.4), (58.0, damping[1], -0.7, 0.8), (120.0, damping[2], 0.6, -0.5)].to_vec()
    };
    let pair = |hz: f64| [(50.0, 0.01, 0.9, 0.4), (hz, 0.01, -0.7, 0.8)].to_vec();
    let cases = [
        ("i_base", three([0.01, 0.015, 0.02]), 5e-4),
        ("i_hi", three([0.05; 3]), 5e-4),
        ("i_hh", three([0.1; 3]), 5e-4),
        ("i_low", three([0.001; 3]), 2e-3),
        ("i_cl", pair(51.0), 5e-4),
        ("i_cl2", pair(53.0), 5e-4),
    ];
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, modes, damping_bound) in cases {
        let text = structure(&modes, "", 20.0, 60.0, 1);
        let found = document(folder, 0, &["identify", &played(folder, name, &text), "--json"]);
        assert_eq!((&found["from_hz"], &found["to_hz"]), (&5.0.into(), &200.0.into()));
        assert_eq!((&found["at"], &found["missing"]), (&serde_json::json!(["mid.x", "tip.x"]), &serde_json::json!([])));
        let identified = found["modes"].as_array().unwrap();
        assert_eq!(identified.len(), modes.len(), "{name}: {:#}", found["modes"]);
        for ((mode, (hz, damping, tip, mid)), index) in identified.iter().zip(&modes).zip(1..) {
            assert_eq!((&mode["mode"], &mode["doubts"]), (&index.into(), &serde_json::json!([])), "{name}");
            let z = |value: &Value, truth: f64, deviation: &Value| {
                let z = (number(value) - truth) / number(deviation);
                assert!(z.abs() < 4.0, "{name}, mode {index}: {value} ± {deviation}, truth {truth}");
            };
            z(&mode["pole_frequency_hz"], *hz, &mode["pole_frequency_deviation_hz"]);
            z(&mode["pole_damping_ratio"], *damping, &mode["pole_damping_ratio_deviation"]);
            let off = number(&mode["pole_damping_ratio"]) / damping - 1.0;
            assert!(off.abs() < damping_bound, "{name}, mode {index}: {off}");
            let [found_mid, found_tip] = [0, 1].map(|place| number(&mode["shape_per_sqrt_kg"][place]));
            let ratio = found_mid / found_tip / (mid / tip) - 1.0;
            assert!(ratio.abs() < 5e-4, "{name}, mode {index}: ratio of the shape {ratio}");
            // Where the force acts a shape is positive.
            for (place, truth) in [mid * tip.signum(), tip.abs()].into_iter().enumerate() {
                z(&mode["shape_per_sqrt_kg"][place], truth, &mode["shape_deviation_per_sqrt_kg"][place]);
            }
            // Of the shape that is 1 at the tip, where the force acts.
            z(&mode["modal_mass_kg"], 1.0 / (tip * tip), &mode["modal_mass_deviation_kg"]);
        }
        for noise in found["noise"].as_array().unwrap() {
            let off = number(&noise["estimated"]) / number(&noise["instrument"]) - 1.0;
            assert!(off.abs() < 0.1, "{name}: {noise:#}");
        }
    }
}

/// A modal structure with modes (Hz, damping ratio, shape at tip and mid) and a random force at its tip, N.
fn structure(modes: &[(f64, f64, f64, f64)], elements: &str, force_n: f64, duration_s: f64, seed: u64) -> String {
    let mode = |(hz, damping, tip, mid): &(f64, f64, f64, f64)| {
        format!("{{ frequency_hz = {hz}, damping_ratio = {damping}, shape = {{ 'tip.x' = {tip}, 'mid.x' = {mid} }} }}")
    };
    let modes: Vec<String> = modes.iter().map(mode).collect();
    format!(
        "[structure]\nkind = 'modal'\nmodes = [{}]\n{elements}[simulation]\nseed = {seed}\n[rig.exciter]\nat = 'tip'\n\
         [rig.sensors.b]\nat = 'mid'\n[rig.sensors.c]\nat = 'tip'\n[excitation]\namplitude = {{ exciter_x = {force_n} }}\n\
         profile = {{ waveform = 'random', from_hz = 5, to_hz = 200, duration_s = {duration_s}, seed = {seed} }}\n",
        modes.join(", ")
    )
}

/// Runs a scenario and returns the name of its recording.
fn played(folder: &Path, name: &str, scenario: &str) -> String {
    let (file, recording) = (format!("{name}.toml"), format!("{name}.mcap"));
    fs::write(folder.join(&file), scenario).unwrap();
    assert_eq!(resonarm(folder, &["run", "--mode", "free", "--scenario", &file, "--record", &recording]).code, 0);
    recording
}

const THREE: [(f64, f64, f64, f64); 3] = [(31.0, 0.01, 0.9, 0.4), (58.0, 0.015, -0.7, 0.8), (120.0, 0.02, 0.6, -0.5)];

#[test]
fn the_table_states_deviations_and_noise() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let recording = played(folder, "random", &structure(&THREE, "", 20.0, 10.0, 1));
    let said = resonarm(folder, &["identify", &recording]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert_snapshot!(said.stdout, @r"
    random.mcap: 10.050 s, force along (1.000, 0.000), 5 to 200 Hz; 15 averages

      mode   pole frequency |λ|/2π (Hz)   damping ratio         modal mass (kg)      shape (1/√kg): mid.x, tip.x
         1           31.000027 ± 1e-4   1.0002e-2 ± 4e-6      1.23458 ± 1e-4   +0.4000 +0.9000
         2           58.000322 ± 2e-4   1.4996e-2 ± 3e-6      2.04075 ± 2e-4   -0.7999 +0.7000
         3          120.000046 ± 4e-4   1.9997e-2 ± 3e-6      2.77783 ± 3e-4   -0.5000 +0.6000

      noise of a sample         estimated   instrument
      head, tip.x (N)             1.124e-2     1.155e-2
      b-x, mid.x (m/s²)           2.443e-2     2.466e-2
      c-x, tip.x (m/s²)           2.553e-2     2.466e-2
    ");
}

/// Exciter and accelerometers at other points in each recording: the shapes join all points.
#[test]
fn recordings_of_a_survey_are_fitted_together() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let at_tip = structure(&THREE, "", 20.0, 10.0, 1);
    let first = played(folder, "tip", &at_tip.replace("[rig.sensors.b]\nat = 'mid'", "[rig.sensors.b]\nat = 'tip'"));
    let second = played(folder, "roved", &structure(&THREE, "", 20.0, 10.0, 2));
    let at_mid = structure(&THREE, "", 20.0, 10.0, 3).replace("[rig.exciter]\nat = 'tip'", "[rig.exciter]\nat = 'mid'");
    let third = played(folder, "mid", &at_mid);
    let found = document(folder, 0, &["identify", &first, &second, &third, "--json"]);
    assert_eq!(found["at"], serde_json::json!(["tip.x", "mid.x"]));
    let forces: Vec<&Value> = found["runs"].as_array().unwrap().iter().map(|run| &run["force"]).collect();
    assert_eq!(forces, ["tip.x", "tip.x", "mid.x"]);
    let modes = found["modes"].as_array().unwrap();
    assert_eq!(modes.len(), 3, "{modes:#?}");
    for (mode, (hz, damping, tip, mid)) in modes.iter().zip(THREE) {
        let near = |key: &str, truth: f64, deviation: &str| {
            let z = (number(&mode[key]) - truth) / number(&mode[deviation]);
            assert!(z.abs() < 4.0, "{mode:#}");
        };
        near("pole_frequency_hz", hz, "pole_frequency_deviation_hz");
        near("pole_damping_ratio", damping, "pole_damping_ratio_deviation");
        let shape = &mode["shape_per_sqrt_kg"];
        assert!((number(&shape[1]) / number(&shape[0]) / (mid / tip) - 1.0).abs() < 2e-3, "{mode:#}");
    }
    let said = resonarm(folder, &["identify", &first, &third, "--plot", "both"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    let table = fs::read_to_string(folder.join("both.csv")).unwrap();
    assert!(table.starts_with("run,frequency_hz,b_x_h1_modulus"), "{}", table.lines().next().unwrap());
    let other = played(folder, "other", &structure(&THREE[..2], "", 20.0, 2.0, 1));
    assert_snapshot!(complaint(folder, 2, &["identify", &first, &other]), @"resonarm: other.mcap has another structure than tip.mcap: give recordings of one structure");
    assert_snapshot!(complaint(folder, 2, &["identify", &first, &third, "--angles", "a.csv"]), @"resonarm: --angles takes one recording, got 2: give each its own command");
}

/// A cubic spring shows in the modes at two forces; without it the structure is linear.
#[test]
fn two_levels_tell_whether_a_structure_is_linear() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let spring = "[[structure.elements]]\nkind = 'cubic'\nat = 'tip.x'\nstiffness3_n_m3 = 1e8\n";
    for (name, elements, is_linear) in [("linear", "", true), ("spring", spring, false)] {
        let [low, high] = [5.0, 20.0].map(|force_n| {
            let text = structure(&[(31.0, 0.02, 0.9, 0.4), (58.0, 0.02, -0.7, 0.8)], elements, force_n, 20.0, 1);
            played(folder, &format!("{name}-{force_n}"), &text)
        });
        let found = document(folder, 0, &["identify", &low, "--other-level", &high, "--json"]);
        let [levels] = &found["levels"].as_array().unwrap()[..] else { panic!("{found:#}") };
        assert_eq!(levels["linear"], is_linear, "{levels:#}");
        assert_eq!(levels["modes"].as_array().unwrap().len(), 2);
        let first = &found["modes"][0];
        assert_eq!(first["pole_frequency_deviation_hz"].is_null(), !is_linear, "{first:#}");
        let is_doubted = first["doubts"].as_array().unwrap().iter().any(|doubt| doubt["reason"] == "nonlinear");
        assert_eq!(is_doubted, !is_linear, "{first:#}");
        let said = resonarm(folder, &["identify", &low, "--other-level", &high]).stdout;
        assert!(said.contains(if is_linear { "\n  linear: no mode" } else { "\n  not linear: a mode" }), "{said}");
        assert_eq!(said.contains("no deviation, modes 1, 2: the structure is not linear"), !is_linear, "{said}");
    }
}

/// The table of angles against the states of the run, which are in the recording.
#[test]
fn angles_are_identified_from_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let dwell = "waveform = 'dwell', frequency_hz = 22, duration_s = 4, settle_s = 1";
    record(folder, "dwell", "joint1 = 60", dwell);
    let states: Vec<_> =
        Recording::open(folder.join("dwell.mcap")).unwrap().states().unwrap().map(Result::unwrap).collect();
    for domain in ["frequency", "time"] {
        let table = format!("{domain}.csv");
        let flags = ["identify", "dwell.mcap", "--angles", &table, "--integration", domain];
        let found = document(folder, 0, &[flags.as_slice(), &["--json"]].concat());
        assert_eq!(found["integration"], domain);
        let residual = number(&found["residual_over_noise"]);
        // What rigid links leave is the noise of the instruments.
        assert!((0.8..1.2).contains(&residual), "{residual}");
        let text = fs::read_to_string(folder.join(&table)).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("time_s,alpha1_rad,alpha2_rad,alpha1_deviation_rad,alpha2_deviation_rad"));
        let rows: Vec<Vec<f64>> =
            lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
        assert_eq!(rows.len() as u64, found["samples"].as_u64().unwrap());
        // The run begins at rest, so the table begins with the run, in the middle of the first hold.
        assert_eq!(rows[0][0], 0.0005);
        for row in &rows {
            let after = &states[(row[0] * 1000.0 + 0.5).round() as usize];
            let before = &states[(row[0] * 1000.0 - 0.5).round() as usize];
            for joint in 0..2 {
                let middle = 0.5 * (before.states.coordinates()[joint] + after.states.coordinates()[joint])
                    // The cubic through both angles and their rates, in its middle.
                    + 0.125e-3 * (before.states.rates()[joint] - after.states.rates()[joint]);
                let off = (row[1 + joint] - middle).abs();
                // Five standard deviations, and the share of a sudden start below the corner.
                assert!(off < 5.0 * row[3 + joint] + 1e-2 * number(&found["largest_rad"][joint]), "{row:?} {middle}");
            }
        }
    }
    let again = ["identify", "dwell.mcap", "--angles", "time.csv"];
    assert_snapshot!(complaint(folder, 2, &again), @"resonarm: time.csv already exists: choose another place, or allow overwriting it (--overwrite)");
    let said = resonarm(folder, &[again.as_slice(), &["--overwrite", "--from-hz", "5"]].concat());
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert_snapshot!(said.stdout, @r"
    dwell.mcap: angles from 0.0005 to 3.2475 s, integrated in the frequency domain from 5.000 Hz on

      joint   largest (rad)   deviation (rad)
          1        1.291e-2            3.5e-6
          2        1.015e-2            7.2e-6

      residual over displacement 5.0e-4; over the noise 1.06
    written to time.csv
    ");
}

#[test]
fn recordings_without_angles_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let dwell = "waveform = 'dwell', frequency_hz = 22, duration_s = 1, settle_s = 0.2";
    record(folder, "short", "joint1 = 5", dwell);
    let says = |arguments: &[&str]| complaint(folder, 2, &[&["identify", "short.mcap"], arguments].concat());
    assert_snapshot!(says(&["--angles", "a.csv", "--from-hz", "2"]), @"resonarm: the record has 1050 samples, but at least 2500 are needed for angles from 2.000 Hz on: record for longer, or raise the lower corner");
    assert_snapshot!(says(&["--angles", "a.csv", "--from-hz", "-2"]), @"resonarm: the lower corner is -2 Hz: it must be above 0 and below half the sample rate, 1000 Hz");
    assert_snapshot!(says(&["--angles", "a.csv", "--from-hz", "500"]), @"resonarm: the lower corner is 500 Hz: it must be above 0 and below half the sample rate, 1000 Hz");
    let first_line = |arguments: &[&str]| says(arguments).lines().next().unwrap().to_string();
    assert_snapshot!(first_line(&["--angles", "a.csv", "--segment-s", "2"]), @"error: the argument '--angles <FILE>' cannot be used with '--segment-s <S>'");
    assert_snapshot!(first_line(&["--integration", "time"]), @"error: the following required arguments were not provided:");
    assert_snapshot!(says(&["--angles", "no/a.csv"]), @"resonarm: can't write no/a.csv: No such file or directory (os error 2)");
    let clipping = "[excitation]\namplitude = { joint1 = 200 }\nprofile = { waveform = 'dwell', frequency_hz = 22, \
                    duration_s = 2, settle_s = 1 }\n[rig.sensors.c]\nrange_m_s2 = 50\n";
    fs::write(folder.join("clipping.toml"), clipping).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "clipping.toml", "--record", "clipping.mcap"];
    assert_eq!(resonarm(folder, &run).code, 0);
    let clipped = complaint(folder, 2, &["identify", "clipping.mcap", "--angles", "a.csv"]);
    let (count, rest) = clipped.strip_prefix("resonarm: ").unwrap().split_once(' ').unwrap();
    assert!(count.parse::<u32>().unwrap() > 10, "{clipped}");
    assert_snapshot!(rest, @"samples have a reading beyond the range of its sensor: reduce the force, or increase the sensor's range");
    assert!(!folder.join("a.csv").exists());
}

/// Accelerance of `THREE` between two points, as [real, imaginary], m/s² per N.
fn accelerance(hz: f64, response: usize, force: usize) -> [f64; 2] {
    let w = std::f64::consts::TAU * hz;
    THREE.iter().fold([0.0, 0.0], |[re, im], (mode_hz, damping, tip, mid)| {
        let (shape, of) = ([tip, mid], std::f64::consts::TAU * mode_hz);
        let (a, b) = (of * of - w * w, 2.0 * damping * of * w);
        let scale = -w * w * shape[response] * shape[force] / (a * a + b * b);
        [re + scale * a, im - scale * b]
    })
}

/// How a file has its values: in ASCII, after their frequencies, or binary of single precision.
#[derive(Clone, Copy, PartialEq)]
enum Layout {
    Ascii,
    Listed,
    Binary,
}

/// A file of frequency responses: units of mm and N, two nodes and a line through them, a coherence that is no response, and
/// responses at nodes 1 and 2 to a force at node 1 along x; the second one reads against x.
fn universal_file(layout: Layout) -> Vec<u8> {
    let (is_binary, is_listed) = (layout == Layout::Binary, layout == Layout::Listed);
    let mut bytes = format!(
        "    -1\n   164\n{:10}{:<20}{:10}\n{:>25}{:>25}{:>25}\n{:>25}\n    -1\n",
        1, "mm, N", 2, "1.00000000000000000D+03", "1.0D+00", "1.0D+00", "0.0D+00"
    )
    .into_bytes();
    let nodes = [(1, "1.00000E+02-2.50000E+01", "0.00000E+00"), (2, "2.00000E+02 0.00000E+00", "5.00000E+01")];
    bytes.extend(b"    -1\n    15\n");
    for (node, x_and_y, z) in nodes {
        bytes.extend(format!("{node:10}{:10}{:10}{:10}  {x_and_y}  {z}\n", 0, 0, 1).bytes());
    }
    bytes.extend(format!("    -1\n    -1\n    82\n{:10}{:10}{:10}\nNONE\n{:10}{:10}\n    -1\n", 1, 2, 1, 1, 2).bytes());
    let lines = 381;
    // A linear congruential generator, summed to nearly normal noise.
    let mut state = 1_u64;
    let mut noise = || {
        let uniform = |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(uniform).sum::<f64>() - 6.0
    };
    for (kind, response, direction, sign) in [(6, 0, 1, 1.0), (4, 0, 1, 1.0), (4, 1, -1, -1.0)] {
        let values: Vec<f64> = (0..lines)
            .flat_map(|k| accelerance(10.0 + 0.5 * f64::from(k), response, 0))
            .map(|part| sign * 1000.0 * (part + 1e-3 * noise()))
            .collect();
        let head = if is_binary {
            format!("    58b{:6}{:6}{:12}{:12}{:6}{:6}{:12}{:12}", 1, 2, 11, 4 * values.len(), 0, 0, 0, 0)
        } else {
            String::from("    58")
        };
        bytes.extend(format!("    -1\n{head}\nNONE\nNONE\nNONE\nNONE\nNONE\n").bytes());
        let node = response + 1;
        bytes.extend(
            format!(
                "{kind:5}{:10}{:5}{:10} {:10}{node:10}{direction:4} {:10}{:10}{:4}\n",
                0, 0, 0, "NONE", "NONE", 1, 1
            )
            .bytes(),
        );
        let [spacing, first, step] = if is_listed { [0.0, 0.0, 0.0] } else { [1.0, 10.0, 0.5] };
        bytes.extend(format!("{:10}{lines:10}{spacing:10}{first:13.5E}{step:13.5E}{:13.5E}\n", 5, 0.0).bytes());
        for (data, unit) in [(18, "Hz"), (12, "mm/s^2"), (13, "N"), (0, "NONE")] {
            bytes.extend(format!("{data:10}{:5}{:5}{:5} {:20} {unit:20}\n", 0, 0, 0, "NONE").bytes());
        }
        if is_binary {
            values.iter().for_each(|value| bytes.extend((*value as f32).to_le_bytes()));
        } else {
            let listed = |(pair, k): (&[f64], i32)| [10.0 + 0.5 * f64::from(k), pair[0], pair[1]];
            let values = match layout {
                Layout::Listed => values.chunks(2).zip(0..).flat_map(listed).collect(),
                Layout::Ascii | Layout::Binary => values,
            };
            for row in values.chunks(6) {
                let row: Vec<String> = row.iter().map(|value| format!("{value:13.5E}")).collect();
                bytes.extend(format!("{}\n", row.concat()).bytes());
            }
        }
        bytes.extend(b"    -1\n");
    }
    bytes
}

#[test]
fn modes_are_identified_from_measured_responses() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, layout) in [("ascii.uff", Layout::Ascii), ("listed.uff", Layout::Listed), ("binary.uff", Layout::Binary)]
    {
        fs::write(folder.join(name), universal_file(layout)).unwrap();
        let found = document(folder, 0, &["identify", name, "--json"]);
        assert_eq!((&found["at"], &found["others"]), (&serde_json::json!(["node1.x", "node2.x"]), &1.into()));
        let positions = serde_json::json!({ "node1": [0.1, -0.025, 0.0], "node2": [0.2, 0.0, 0.05] });
        assert_eq!(found["positions_m"], positions);
        let modes = found["modes"].as_array().unwrap();
        assert_eq!(modes.len(), 3, "{name}: {:#}", found["modes"]);
        for (mode, (hz, damping, tip, mid)) in modes.iter().zip(THREE) {
            let z = |value: &Value, truth: f64, deviation: &Value| {
                assert!(((number(value) - truth) / number(deviation)).abs() < 4.0, "{name}: {mode:#}");
            };
            z(&mode["pole_frequency_hz"], hz, &mode["pole_frequency_deviation_hz"]);
            z(&mode["pole_damping_ratio"], damping, &mode["pole_damping_ratio_deviation"]);
            let sign = tip.signum();
            for (place, truth) in [sign * tip, sign * mid].into_iter().enumerate() {
                z(&mode["shape_per_sqrt_kg"][place], truth, &mode["shape_deviation_per_sqrt_kg"][place]);
            }
        }
    }
    let said = resonarm(folder, &["identify", "ascii.uff", "--plot", "measured"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(
        said.stdout.starts_with("ascii.uff: 2 frequency responses, 10 to 200 Hz; 1 other function left out\n"),
        "{}",
        said.stdout
    );
    assert!(folder.join("measured-poles.svg").exists());
    let says = |name: &str, flags: &[&str]| complaint(folder, 2, &[&["identify", name], flags].concat());
    assert_snapshot!(says("ascii.uff", &["--segment-s", "1"]), @"resonarm: --segment-s needs readings over time, and ascii.uff has frequency responses: leave it out");
    assert_snapshot!(says("ascii.uff", &["listed.uff"]), @"resonarm: ascii.uff has frequency responses, which are identified alone: give one such file, or recordings");
    assert_snapshot!(says("ascii.uff", &["--mac", "computed"]), @"resonarm: --mac computed needs a scenario, and ascii.uff has frequency responses: name a document of `identify --json`");
    assert_snapshot!(says("ascii.uff", &["--uff", "ascii.uff", "--overwrite"]), @"resonarm: ascii.uff can't be written over itself, since this command reads it: name another file for the result");
    // What was written is read: the same responses, in other units, and the same nodes.
    let first = document(folder, 0, &["identify", "ascii.uff", "--uff", "again.uff", "--json"]);
    let again = document(folder, 0, &["identify", "again.uff", "--mac", "measured.json", "--json"]);
    assert_eq!((&again["positions_m"], &again["at"]), (&first["positions_m"], &first["at"]));
    assert_eq!(again["others"], 0);
    for (one, other) in first["modes"].as_array().unwrap().iter().zip(again["modes"].as_array().unwrap()) {
        let ratio = number(&other["pole_frequency_hz"]) / number(&one["pole_frequency_hz"]);
        assert!((ratio - 1.0).abs() < 1e-8, "{one:#} {other:#}");
    }
    assert!((0..3).all(|mode| (number(&again["mac"]["values"][mode][mode]) - 1.0).abs() < 1e-9), "{:#}", again["mac"]);
    // The nodes of dataset 2411 and the elements of 2412 in place of 15 and 82. A structure of the modes has its points at them.
    let text = String::from_utf8(universal_file(Layout::Ascii)).unwrap();
    let ends = ["    -1\n    15\n", "    -1\n    58\n"].map(|begin| text.find(begin).unwrap());
    let node = |number: u8, at: &str| format!("{number:10}{:10}{:10}{:10}\n{at}\n", 0, 0, 1);
    let nodes = [node(1, "  1.0D+02 -2.5D+01  0.0D+00"), node(2, "  2.0D+02  0.0D+00  5.0D+01")].concat();
    let beam =
        format!("{:10}{:10}{:10}{:10}{:10}{:10}\n{:10}{:10}{:10}\n{:10}{:10}\n", 1, 21, 1, 1, 7, 2, 0, 1, 1, 2, 1);
    let geometry = format!("    -1\n  2411\n{nodes}    -1\n    -1\n  2412\n{beam}    -1\n");
    fs::write(folder.join("mesh.uff"), [&text[..ends[0]], &geometry, &text[ends[1]..]].concat()).unwrap();
    let mesh = document(folder, 0, &["identify", "mesh.uff", "--json"]);
    assert_eq!(
        (&mesh["positions_m"], &mesh["lines"]),
        (&first["positions_m"], &serde_json::json!([["node1", "node2"]]))
    );
    assert_eq!(first["lines"], mesh["lines"]);
    fs::write(folder.join("mesh.json"), mesh.to_string()).unwrap();
    let structure = document(folder, 0, &["structure", "--from-identified", "mesh.json", "--json"]);
    let section = &structure["configuration"]["structure"];
    assert_eq!((&section["points"], &section["lines"]), (&mesh["positions_m"], &mesh["lines"]));
    let written = |name: &str, text: String| fs::write(folder.join(name), text).unwrap();
    written("cut.uff", text[..text.len() - 100].to_string());
    assert_snapshot!(says("cut.uff", &[]), @"resonarm: cut.uff: dataset 58 has no end: the file is cut off");
    written("none.uff", text.split("    -1\n    58").take(2).collect::<Vec<_>>().join("    -1\n    58"));
    assert_snapshot!(says("none.uff", &[]), @"resonarm: none.uff has no frequency response (dataset 58 of function type 4); it has coherences (1): export the measured responses over a force from the program that made it");
    written("strain.uff", text.replace("        12    0    0    0", "         3    0    0    0"));
    assert_snapshot!(says("strain.uff", &[]), @"resonarm: strain.uff, frequency response 1: its response has the data type 3: expected displacement, velocity or acceleration, 8, 11 or 12 in record 9; export it with the channel's quantity");
    written("real.uff", text.replace(&format!("{:10}{:10}{:10}", 5, 381, 1), &format!("{:10}{:10}{:10}", 2, 381, 1)));
    assert_snapshot!(says("real.uff", &[]), @"resonarm: real.uff, frequency response 1: its values have the type 2: expected complex numbers, 5 or 6, so export real and imaginary part");
    let listed = String::from_utf8(universal_file(Layout::Listed)).unwrap();
    written("uneven.uff", listed.replacen("1.05000E1", "1.07000E1", 2));
    assert_snapshot!(says("uneven.uff", &[]), @"resonarm: uneven.uff, frequency response 1: its frequencies have steps from 0.300000 to 0.700000 Hz: expected equal steps, so export it with an even spacing");
    written("node.uff", text.replacen("  5.00000E+01", "", 1));
    assert_snapshot!(says("node.uff", &[]), @"resonarm: node.uff, dataset 15: a node is `2         0         0         1  2.00000E+02 0.00000E+00`: expected its number, two coordinate systems, a colour and three coordinates");
    let mut binary = universal_file(Layout::Binary);
    let end = binary.len() - 100;
    binary.drain(end..end + 8);
    fs::write(folder.join("short.uff"), binary).unwrap();
    assert_snapshot!(says("short.uff", &[]), @"resonarm: short.uff: dataset 58b is binary, and does not end where its first line states: export it anew, or as ASCII");
}

/// Files that other programs wrote. None has responses over a force, and each is refused with what it has.
#[test]
fn files_of_other_programs_are_refused_with_their_content() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracles/pyuff");
    let says = |name: &str| complaint(&folder, 2, &["identify", name]);
    assert_snapshot!(says("binary8byte.uff"), @"resonarm: binary8byte.uff has no frequency response (dataset 58 of function type 4); it has time responses (1): export the measured responses over a force from the program that made it");
    assert_snapshot!(says("time-history-not-all-columns-filled.uff"), @"resonarm: time-history-not-all-columns-filled.uff has no frequency response (dataset 58 of function type 4); it has time responses (1): export the measured responses over a force from the program that made it");
    assert_snapshot!(says("mesh_test_uff2412_mixed.uff"), @"resonarm: mesh_test_uff2412_mixed.uff has no frequency response (dataset 58 of function type 4); it has the datasets 18, 15, 2412: export the measured responses over a force from the program that made it");
    assert_snapshot!(says("uff55_translation.uff"), @"resonarm: uff55_translation.uff has no frequency response (dataset 58 of function type 4); it has the datasets 55 (mode shapes: name it as `file` of a modal structure): export the measured responses over a force from the program that made it");
    assert_snapshot!(says("non_ascii_header.uff"), @"resonarm: non_ascii_header.uff, frequency response 1: its response has the data type 1: expected displacement, velocity or acceleration, 8, 11 or 12 in record 9; export it with the channel's quantity");
}

/// Shapes against those of another recording, and against the structure's own.
#[test]
fn shapes_are_compared_with_others() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let [first, second] = [("first", 1), ("second", 2)]
        .map(|(name, seed)| played(folder, name, &structure(&THREE, "", 20.0, 10.0, seed)));
    let said = resonarm(folder, &["identify", &first, "--plot", "first"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(!folder.join("first-mac.svg").exists());
    for other in ["first.json", "computed"] {
        let found = document(folder, 0, &["identify", &second, "--mac", other, "--json"]);
        let mac = &found["mac"];
        assert_eq!((&mac["with"], &mac["at"]), (&other.into(), &serde_json::json!(["mid.x", "tip.x"])));
        assert_eq!(mac["rows"], serde_json::json!(["1: 31.00 Hz", "2: 58.00 Hz", "3: 120.00 Hz"]));
        assert_eq!(mac["columns"], mac["rows"]);
        for (row, (.., tip, mid)) in THREE.iter().enumerate() {
            for (column, (.., other_tip, other_mid)) in THREE.iter().enumerate() {
                let (product, own) = (tip * other_tip + mid * other_mid, tip * tip + mid * mid);
                let expected = product * product / own / (other_tip * other_tip + other_mid * other_mid);
                let got = number(&mac["values"][row][column]);
                assert!((got - expected).abs() < 1e-3, "{other}: {got} at {row}, {column}, expected {expected}");
            }
        }
    }
    let said = resonarm(folder, &["identify", &second, "--mac", "computed", "--plot", "second"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    let table = said.stdout.split("\n  modal assurance").nth(1).unwrap();
    assert!(table.starts_with(" criterion with computed modes, over mid.x, tip.x\n"), "{table}");
    assert!(table.contains("   1: 31.00 Hz          1.000          0.088          0.195\n"), "{table}");
    assert!(table.contains(", second-mac.svg, second-mac.png, second-mac.txt\n"), "{table}");
    let figure = fs::read_to_string(folder.join("second-mac.svg")).unwrap();
    assert!(["1.00", "0.09", "0.20", "computed modes"].iter().all(|text| figure.contains(text)));
    let says = |flags: &[&str]| complaint(folder, 2, &[&["identify", second.as_str()], flags].concat());
    fs::write(
        folder.join("one.json"),
        r#"{"at":["tip.x","a.y"],"modes":[{"mode":null,"pole_frequency_hz":31,"complex_shape":[[1,0],[0.5,0]]}]}"#,
    )
    .unwrap();
    assert_snapshot!(says(&["--mac", "one.json"]), @"resonarm: --mac: of the degrees of freedom of these modes (mid.x, tip.x) and one.json (tip.x, a.y) all shapes have tip.x in common: expected at least 2, since the criterion of one is always 1");
    fs::write(folder.join("none.json"), r#"{"at":[],"modes":[]}"#).unwrap();
    assert_snapshot!(says(&["--mac", "none.json"]), @"resonarm: none.json has no modes to compare with");
    assert_snapshot!(says(&["--mac", "first.csv"]), @"resonarm: first.csv is not a document of `identify --json`: expected ident at line 1 column 2");
    assert_snapshot!(says(&["--mac", "first.json", "--plot", "first", "--overwrite"]), @"resonarm: first.json can't be written over itself, since this command reads it: name another file for the result");
}

/// Modes in a file for other programs; this one reads them as a structure.
#[test]
fn identified_modes_are_written_as_a_universal_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let recording = played(folder, "random", &structure(&THREE, "", 20.0, 10.0, 1));
    let flags: [&str; 4] = ["identify", &recording, "--uff", "found.uff"];
    let found = document(folder, 0, &[&flags[..], &["--json"]].concat());
    fs::write(
        folder.join("read.toml"),
        "[structure]\nkind = 'modal'\nfile = 'found.uff'\nnodes = { mid = 1, tip = 2 }\n",
    )
    .unwrap();
    let read = document(folder, 0, &["modes", "--scenario", "read.toml", "--json"]);
    for (one, mode) in found["modes"].as_array().unwrap().iter().zip(read["modes"].as_array().unwrap()) {
        for (written, value) in [("pole_frequency_hz", "frequency_hz"), ("pole_damping_ratio", "damping_ratio")] {
            assert!((number(&mode[value]) / number(&one[written]) - 1.0).abs() < 1e-6, "{one:#} {mode:#}");
        }
    }
    let text = fs::read_to_string(folder.join("found.uff")).unwrap();
    assert!(text.lines().all(|line| line.len() <= 80), "{text}");
    let mode = format!("pole frequency {:.6} Hz", number(&found["modes"][0]["pole_frequency_hz"]));
    assert!(text.contains(&mode) && text.contains("\nnodes: 1 mid, 2 tip "), "{text}");
    let again = document(folder, 0, &["identify", "found.uff", "--json"]);
    let functions = again["functions"].as_array().unwrap();
    let of = |key: &str| functions.iter().map(|of| of[key].as_str().unwrap()).collect::<Vec<_>>();
    assert_eq!((of("response"), of("force")), (vec!["node1.x", "node2.x"], vec!["node2.x", "node2.x"]));
    let [written, value] = [&functions[0]["measured"][7][0], &found["runs"][0]["responses"][0]["h1"][7][0]].map(number);
    assert!((written / value - 1.0).abs() < 1e-12, "{written} {value}");
    assert_snapshot!(complaint(folder, 2, &flags), @"resonarm: found.uff already exists: choose another place, or allow overwriting it (--overwrite)");
    assert_snapshot!(complaint(folder, 2, &["identify", &recording, "--uff", &recording, "--overwrite"]), @"resonarm: random.mcap can't be written over itself, since this command reads it: name another file for the result");
}

/// Identified modes as a structure of a scenario: those of the document to the last digit, and those of the truth.
#[test]
fn identified_modes_are_a_structure() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let recording = played(folder, "random", &structure(&THREE, "", 20.0, 10.0, 1));
    let found = resonarm(folder, &["identify", &recording, "--json"]).stdout;
    fs::write(folder.join("found.json"), &found).unwrap();
    let found: Value = serde_json::from_str(&found).unwrap();
    let said = resonarm(folder, &["structure", "--from-identified", "found.json", "--out", "found.toml"]);
    assert_eq!((said.code, said.stderr.as_str()), (0, ""));
    assert_snapshot!(said.stdout, @"
    3 modes
    points: mid, tip
      mode   undamped frequency   damping ratio
         1           31.0000 Hz        1.000e-2
         2           58.0003 Hz        1.500e-2
         3          120.0000 Hz        2.000e-2
    written to found.toml
    ");
    let made = document(folder, 0, &["structure", "--scenario", "found.toml", "--json"]);
    let made = made["configuration"]["structure"]["modes"].as_array().unwrap();
    for ((made, found), (hz, damping, tip, mid)) in made.iter().zip(found["modes"].as_array().unwrap()).zip(THREE) {
        assert_eq!(made["frequency_hz"], found["pole_frequency_hz"]);
        assert_eq!(made["damping_ratio"], found["pole_damping_ratio"]);
        assert!((number(&made["frequency_hz"]) / hz - 1.0).abs() < 2e-5, "{made:#}");
        assert!((number(&made["damping_ratio"]) / damping - 1.0).abs() < 2e-3, "{made:#}");
        // Shapes are known but for their sign.
        let sign = number(&made["shape"]["tip.x"]).signum() * tip.signum();
        for (index, (name, truth)) in [("mid.x", mid), ("tip.x", tip)].into_iter().enumerate() {
            assert_eq!(made["shape"][name], found["shape_per_sqrt_kg"][index]);
            assert!((sign * number(&made["shape"][name]) - truth).abs() < 1e-3, "{name}: {made:#}");
        }
    }
    let says = |text: &str| {
        fs::write(folder.join("other.json"), text).unwrap();
        complaint(folder, 2, &["structure", "--from-identified", "other.json"])
    };
    let mode = |shape: &str| {
        format!(
            r#"{{"at":["tip.x"],"modes":[{{"pole_frequency_hz":31,"pole_damping_ratio":0.01,"shape_per_sqrt_kg":{shape},"doubts":[]}}]}}"#
        )
    };
    assert_snapshot!(says(&mode("null")), @"resonarm: other.json: mode 1, at 31.00 Hz, has no modal mass (shape_per_sqrt_kg): place an accelerometer where the force acts");
    assert_snapshot!(says(&mode("[1,2]")), @"resonarm: other.json: mode 1, at 31.00 Hz, has 2 components, expected 1, one for each of `at`");
    assert_snapshot!(says(r#"{"at":[],"modes":[]}"#), @"resonarm: other.json has no modes to make a structure of");
    assert_snapshot!(says("{}"), @"resonarm: other.json is not a document of `identify --json`: missing field `at` at line 1 column 2");
    let doubtful = mode("[1]").replace("[]}", r#"[{"reason":"not-white","text":"the residual is not white"}]}"#);
    fs::write(folder.join("other.json"), doubtful).unwrap();
    let said = resonarm(folder, &["structure", "--from-identified", "other.json"]);
    assert!(
        said.code == 0 && said.stderr.contains("mode 1, at 31.00 Hz, has no deviations: the residual is not white"),
        "{}",
        said.stderr
    );
}
