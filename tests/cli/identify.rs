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
        assert_eq!((&found["averaging"], &found["averages"]), (&averaging.into(), &averages.into()));
        assert_eq!(found["modes"].as_array().unwrap().len(), 2, "{:#}", found["modes"]);
        for mode in 0..2 {
            let (found, computed) = (&found["modes"][mode], &computed["modes"][mode]);
            let ratio = |key: &str| number(&found[key]) / number(&computed[key]) - 1.0;
            assert!(ratio("pole_frequency_hz").abs() < 1e-4, "{found} {computed}");
            assert!(ratio("pole_damping_ratio").abs() < 0.05, "{found} {computed}");
        }
        assert_eq!(number(&found["direction"][1]).round(), 1.0);
        let count = found["frequency_hz"].as_array().unwrap().len();
        for response in found["responses"].as_array().unwrap() {
            assert_eq!(names(response), ["coherence", "h1", "h2", "response", "unit"]);
            assert_eq!(response["h1"].as_array().unwrap().len(), count);
            assert_eq!(response["coherence"].is_null(), averages == 1);
        }
    }
    let plot = ["identify", "random.mcap", "--from-hz", "10", "--to-hz", "70", "--plot", "found"];
    let said = resonarm(folder, &plot);
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(
        said.stdout.ends_with("written to found.svg, found.png, found.txt, found.csv, found.json\n"),
        "{}",
        said.stdout
    );
    let table = fs::read_to_string(folder.join("found.csv")).unwrap();
    assert_snapshot!(table.lines().next().unwrap(), @"frequency_hz,b_x_h1_modulus_m_s2_per_n,b_x_h1_phase_deg,b_x_h2_modulus_m_s2_per_n,b_x_h2_phase_deg,b_x_coherence,b_y_h1_modulus_m_s2_per_n,b_y_h1_phase_deg,b_y_h2_modulus_m_s2_per_n,b_y_h2_phase_deg,b_y_coherence,c_x_h1_modulus_m_s2_per_n,c_x_h1_phase_deg,c_x_h2_modulus_m_s2_per_n,c_x_h2_phase_deg,c_x_coherence,c_y_h1_modulus_m_s2_per_n,c_y_h1_phase_deg,c_y_h2_modulus_m_s2_per_n,c_y_h2_phase_deg,c_y_coherence");
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
    let found = document(folder, 1, &["identify", "braked.mcap", "--json"]);
    let missing = found["missing"].as_array().unwrap();
    assert_eq!(missing.iter().map(|mode| &mode["mode"]).collect::<Vec<_>>(), [1, 2]);
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
