//! Structures in place of the two-link arm: the examples, and `resonarm structure`.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{complaint, document, names, resonarm};

pub(crate) fn example(name: &str) -> String {
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
    let examples: [(&str, &[f64]); 7] = [
        ("chain.toml", &[15.767_4, 24.921_8, 68.099_7, 110.632_7, 172.452_0, 306.284_6]),
        ("bracket.toml", &[63.4, 212.25, 388.0]),
        ("contact.toml", &[63.4, 212.25, 388.0]),
        ("friction.toml", &[41.0, 187.0]),
        ("hardening.toml", &[22.157_5, 48.896_6]),
        ("absorber.toml", &[0.138_9, 0.173_6]),
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
            [
                "configuration",
                "coordinates",
                "damping_ratios",
                "degrees_of_freedom",
                "natural_frequencies_hz",
                "points"
            ]
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
        ["configuration", "coordinates", "outcome", "points", "reason", "score", "simulated_s", "wall_s"],
        "{found:#}"
    );
    let score = &found["score"];
    assert_eq!((&score["at"], score["settled_points"].as_u64()), (&"tip.y".into(), Some(5)), "{score:#}");
    assert!(score["largest_frequency_deviation"].as_f64().unwrap() < 2e-5, "{score:#}");
    assert!(score["largest_amplitude_deviation"].as_f64().unwrap() < 1e-3, "{score:#}");
    let point = &found["points"][2];
    assert_eq!(names(&point["readings"]), ["tip.x", "tip.y"]);
    // The displacement lags the load as the walk says, in the direction of the load.
    let off_deg = point["readings"]["tip.y"]["phase_deg"].as_f64().unwrap() + point["lag_deg"].as_f64().unwrap();
    assert!(off_deg.abs() < 0.5, "{point:#}");
    assert!(fs::read_to_string(folder.path().join("walk.csv")).unwrap().starts_with("frequency_hz,lag_deg,"));
    let none = complaint(folder.path(), 2, &[&walk[..], &["--mode-number", "4"]].concat());
    insta::assert_snapshot!(none.trim(), @"resonarm: control: there is no mode 4: the structure has modes 1 to 3");
    let torque = complaint(folder.path(), 2, &[&walk[..], &["--drive", "joint1=4"]].concat());
    insta::assert_snapshot!(torque.trim(), @"resonarm: --drive joint1: there is no `joint1` in this structure: expected one of mid.x, mid.y, mid.z, tip.x, tip.y, tip.z");
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
[rig.sensors.b]
at = 'mid'
[excitation]
amplitude = { exciter_x = 12.0 }
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
    assert_eq!(names(&found), ["at", "configuration", "coordinates", "load", "points", "score"], "{found:#}");
    let (points, score) = (found["points"].as_array().unwrap(), &found["score"]);
    assert_eq!((points.len(), score["settled_points"].as_u64()), (5, Some(5)), "{found:#}");
    assert!(score["largest_amplitude_deviation"].as_f64().unwrap() < 1e-3, "{score:#}");
    for point in points {
        assert!(point["phase_deviation_deg"].as_f64().unwrap().abs() < 0.2, "{point:#}");
        assert_eq!(names(&point["readings"]), ["mid.x", "tip.x"]);
    }
}

/// The modes that are identified from readings are those of the structure, numbered alike.
#[test]
fn the_modes_of_a_structure_are_identified() {
    let folder = tempfile::tempdir().unwrap();
    let linear = STEPPED.split("[[structure.elements]]").next().unwrap();
    let random = "[rig.sensors.b]\nat = 'mid'\n[excitation]\namplitude = { exciter_x = 12.0 }\n\
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
        // Four standard deviations: with a fixed seed the test never fails by chance, and a false deviation shows.
        assert!(off("pole_frequency_hz", hz, "pole_frequency_deviation_hz") < 4.0, "{mode:#}");
        assert!(off("pole_damping_ratio", 0.02, "pole_damping_ratio_deviation") < 4.0, "{mode:#}");
    }
}

const SHAKER: &str = "[rig.shaker]
amplifier = 'voltage'
moving_mass_kg = 0.3
stiffness_n_m = 2e3
damping_n_s_m = 10.0
force_factor_n_a = 20.0
resistance_ohm = 2.0
inductance_h = 3e-4
stroke_m = 0.0127
current_limit_a = 15.0
voltage_limit_v = 60.0
";

/// The modes are those of the structure alone, and responses at a controlled force are on its own branch.
#[test]
fn a_shaken_structure_is_identified_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let record = |name: &str, text: String| {
        fs::write(folder.join(format!("{name}.toml")), text).unwrap();
        let (scenario, recording) = (format!("{name}.toml"), format!("{name}.mcap"));
        document(folder, 0, &["run", "--mode", "free", "--scenario", &scenario, "--record", &recording, "--json"]);
        assert_eq!(resonarm(folder, &["resim", &recording]).code, 0);
        recording
    };
    let modes = STEPPED.split("[[structure.elements]]").next().unwrap();
    let random = "[excitation]\namplitude = { exciter_x = 12.0 }\n\
        profile = { waveform = 'random', from_hz = 10.0, to_hz = 60.0, duration_s = 8.0, seed = 3 }\n";
    let random = record("random", format!("{modes}{SHAKER}{random}"));
    let found = document(folder, 0, &["identify", &random, "--json"]);
    let found = found["modes"].as_array().unwrap();
    let hz: Vec<f64> = found.iter().map(|mode| mode["pole_frequency_hz"].as_f64().unwrap()).collect();
    assert!(hz.len() == 2 && (hz[0] - 20.0).abs() < 0.02 && (hz[1] - 43.0).abs() < 0.05, "{hz:?}");

    let stepped =
        STEPPED.replace("steps = 5, dwell_s = 4.0, settle_s = 3.0", "steps = 3, dwell_s = 2.0, settle_s = 1.0");
    let (_, excitation) = stepped.split_once("[excitation]").unwrap();
    let structure = format!("{modes}[rig.sensors.b]\nat = 'mid'\n");
    let control = excitation.replace("profile = {", "ramp_s = 0.2\nprofile = {");
    let control = format!("{structure}{SHAKER}[control]\nlaw = 'force-control'{control}");
    let found = document(folder, 0, &["compare", &record("control", control), "--json"]);
    let score = &found["score"];
    assert_eq!(score["settled_points"].as_u64(), Some(3), "{found:#}");
    assert!(score["largest_amplitude_deviation"].as_f64().unwrap() < 5e-3, "{score:#}");
    // In open loop the force of a shaker depends on how the structure moves: the points have different loads.
    let open = record("open", format!("{structure}{SHAKER}[excitation]{excitation}"));
    let refused = complaint(folder, 2, &["compare", &open]);
    assert!(refused.contains("but loads on a single branch differ by"), "{refused}");

    let lags = "[control]\nlaw = 'phase-walk'\namplitude = { exciter_x = 1.0 }\nfrom_lag_deg = 40\nto_lag_deg = 140\n";
    fs::write(folder.join("walk.toml"), format!("{structure}{SHAKER}{lags}")).unwrap();
    let walk = ["experiment", "walk", "--scenario", "walk.toml", "--drive", "shaker=12", "--points", "3", "--json"];
    let score = &document(folder, 0, &walk)["score"];
    assert_eq!(score["settled_points"].as_u64(), Some(3), "{score:#}");
    assert!(score["largest_amplitude_deviation"].as_f64().unwrap() < 5e-3, "{score:#}");
    let across =
        format!("{modes}{SHAKER}direction_deg = 90.0\n[excitation]{}", excitation.replace("exciter_x", "exciter_y"));
    fs::write(folder.join("across.toml"), across).unwrap();
    let refused = complaint(folder, 2, &["run", "--mode", "free", "--scenario", "across.toml"]);
    insta::assert_snapshot!(refused.trim(), @"resonarm: rig.shaker: `direction_deg` is 90, and the structure does not move along y where the exciter is: turn it along an axis that moves, or place it by `rig.exciter.at`");
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
        // A figure has more texts than that on its axes alone; none at all would be equal, too.
        assert!(shown.len() > 10);
        assert_eq!(again, shown, "{command}");
        assert!(page.contains(&format!("(images/structures/{}.svg)", name.display())), "{name:?}");
        drawn += 1;
    }
    // As many as the gallery shows: a command that is no longer read must not pass.
    assert_eq!(drawn, 7);
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
    let structure = |file: &str, rest: &[&str]| {
        let words = [&["structure", "--scenario", file], rest].concat();
        let said = resonarm(folder.path(), &words);
        assert_eq!(said.code, 0, "{}", said.stderr);
        said.stdout
    };
    let arm = structure("arm.toml", &[]);
    insta::assert_snapshot!(arm, @"
    irb1600-fitted at 0°, 60°
      link   length m     mass kg   centre m   inertia kg·m²    angle °   stiffness N·m/rad   damping N·m·s/rad
         1    0.63000     1.00000    0.00000        0.550000     0.0000 555000 0.9
         2    0.60000    50.58000    0.10000        1.500000    60.0000 128000 0.9
    points: joint1, joint2, tip
      mode   undamped frequency   damping ratio
         1           22.1575 Hz        1.595e-4
         2           48.8966 Hz        9.772e-4
    ");
    structure("arm.toml", &["--out", "preset.toml"]);
    assert_eq!(structure("preset.toml", &[]), arm);
}

#[test]
fn the_modes_of_an_arm_are_a_structure() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arm.toml"), "[structure]\nangles_deg = [0.0, 75.0]\n").unwrap();
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
            // The file states its numbers in full, so that the difference is that of the computation alone.
            assert!((own / arm - 1.0).abs() < 1e-9, "{key}: {own} in place of {arm}");
        }
    }
    let says = |words: &[&str]| complaint(folder.path(), 2, words);
    insta::assert_snapshot!(says(&["structure"]).trim(), @"resonarm: the structure is missing: give --scenario FILE, --from-modes FILE or --from-identified FILE");
    let hardening = example("hardening.toml");
    let refused = says(&["structure", "--from-modes", &hardening]).replace(&hardening, "hardening.toml");
    insta::assert_snapshot!(refused.trim(), @"resonarm: hardening.toml: the structure has elements (1), but only its linear part has modes; leave them out, and add them to the modal structure");
}

/// An oscillator that hardens so that its resonance folds over, from 10.88 to 11.28 Hz at 5 N, in `osc.toml`.
fn oscillator() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"
        [structure]
        kind = "modal"
        name = "oscillator"
        modes = [{ frequency_hz = 10.0, damping_ratio = 0.03, shape = { "tip.x" = 1.0 } }]
        [[structure.elements]]
        kind = "cubic"
        at = "tip.x"
        stiffness3_n_m3 = 4e6
    "#;
    fs::write(folder.path().join("osc.toml"), text).unwrap();
    folder
}

/// A command on it.
fn on_oscillator<'a>(command: &'a str, more: &'a str) -> Vec<&'a str> {
    [command, "--scenario", "osc.toml"].into_iter().chain(more.split_whitespace()).collect()
}

/// Three points of a walk through its resonance, recorded and drawn.
#[test]
fn the_demo_walks_on_a_structure() {
    let folder = oscillator();
    let walk = "[control]\nlaw = \"phase-walk\"\namplitude = { exciter_x = 1.0 }\npoints = 3\nfrom_lag_deg = 60.0\n\
                to_lag_deg = 120.0\n";
    let text = fs::read_to_string(folder.path().join("osc.toml")).unwrap() + walk;
    fs::write(folder.path().join("osc.toml"), text).unwrap();
    let shown = resonarm(folder.path(), &on_oscillator("demo", "--speed 0 --out out")).stdout;
    let head: Vec<&str> = shown.lines().take(4).collect();
    insta::assert_snapshot!(head.join("\n"), @"
    structure    oscillator with an element, cubic
    modes        10.00 Hz (damping ratio 3.0e-2, time constant 0.5 s)
    control      phase walk of 3 points at 1 N, lags 60° to 120°
    bus          in memory, 1000 samples a second, in lockstep, as fast as possible
    ");
    assert_eq!(shown.lines().filter(|line| line.contains(" Hz  ") && line.contains('°')).count(), 3, "{shown}");
    for name in ["demo.mcap", "response.svg", "response.png"] {
        assert!(folder.path().join("out").join(name).exists(), "{name}");
    }
}

#[test]
fn backbones_of_structures() {
    let folder = oscillator();
    // Large steps keep the table short.
    let shown = |more: &str| resonarm(folder.path(), &on_oscillator("backbone", more)).stdout;
    insta::assert_snapshot!(shown("--drive tip.x=5 --largest-step 1"), @"
    oscillator with an element, cubic, mode 1 from 10.000000 Hz: in phase quadrature with a load at tip.x

      frequency Hz    largest tip.x m              N
         10.000019        7.036194e-5         0.0167
         10.000075        1.407240e-4         0.0333
         10.000301        2.814484e-4         0.0667
         10.001204        5.629009e-4         0.1333
         10.004815        1.125835e-3         0.2668
         10.019247        2.251929e-3         0.5344
         10.076797        4.505848e-3         1.0748
         10.304096        9.024943e-3         2.1975
         11.164130        1.808130e-2         4.7445
         11.264510        1.889511e-2         5.0000

    hardening: +1.264491 Hz (+12.6449 %) at tip.x 1.889511e-2 m; at small amplitudes a of tip.x, df/d(a²) = +3.799543e3 Hz/m²
    ");
    let free = document(folder.path(), 0, &on_oscillator("backbone", "--at tip.x --to 0.02 --undamped --json"));
    assert!(free["configuration"].get("drive").is_none(), "{free:#}");
    assert_eq!((&free["kind"], &free["bending"]), (&"nonlinear-normal-mode".into(), &"hardening".into()));
    let names = ["energy_j", "frequency_hz", "harmonics", "readings"];
    let last = free["points"].as_array().unwrap().last().unwrap();
    assert_eq!(super::names(last), names);
    // The last point is located at --to, not only beyond it.
    assert!((last["readings"]["tip.x"]["largest"].as_f64().unwrap() - 0.02).abs() < 1e-9);
    // A load changes nothing, and the command says so.
    let loaded = resonarm(folder.path(), &on_oscillator("backbone", "--drive tip.x --to 0.02 --undamped --json"));
    assert!(
        loaded.stderr.contains("a free vibration has no excitation: the load at tip.x changes nothing"),
        "{}",
        loaded.stderr
    );
    let loaded: serde_json::Value = serde_json::from_str(&loaded.stdout).unwrap();
    assert_eq!(loaded["points"], free["points"]);

    let plotted = on_oscillator("backbone", "--drive tip.x=5 --plot curve");
    let said = resonarm(folder.path(), &plotted).stdout;
    let last = "written to curve.svg, curve.png, curve.txt, curve.csv, curve.json, curve-response.csv";
    assert_eq!(said.trim().lines().last(), Some(last));
    let svg = fs::read_to_string(folder.path().join("curve.svg")).unwrap();
    for words in ["phase quadrature", "unstable", "fold", "response to 5 N at tip.x", "largest tip.x (m)"] {
        assert!(svg.contains(words), "{words}");
    }
}

/// The sweeps jump at the folds, and both stable responses between the folds have basins.
#[test]
fn sweeps_and_basins_of_structures() {
    let folder = oscillator();
    let command = on_oscillator("sweep", "--drive tip.x=5 --from-hz 10 --to-hz 12 --plot swept");
    insta::assert_snapshot!(resonarm(folder.path(), &command).stdout, @"
    oscillator with an element, cubic, stepped up: 131 responses
      largest tip.x  1.890013e-2 m at 11.260000 Hz
    oscillator with an element, cubic, stepped down: 131 responses
      largest tip.x  1.708365e-2 m at 10.880000 Hz
      up and down differ from 10.886808 to 11.280000 Hz
    written to swept.csv, swept.json, swept.svg, swept.png, swept.txt
    ");
    let text = fs::read_to_string(folder.path().join("swept.json")).unwrap();
    let swept: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(names(&swept), ["configuration", "coordinates", "sweeps"]);
    let point = &swept["sweeps"][0]["points"][0];
    let keys = ["drift", "frequency_hz", "largest_multiplier", "period", "readings", "settling_periods", "state"];
    assert_eq!(names(point), keys);

    let few = on_oscillator("sweep", "--drive tip.x=5 --from-hz 9 --to-hz 16 --points 3 --direction up");
    insta::assert_snapshot!(resonarm(folder.path(), &few).stdout, @"
    oscillator with an element, cubic, stepped up: 3 responses
      largest tip.x  5.724230e-3 m at 9.000000 Hz
      stepped over: the resonance of tip.x at 11.257063 Hz, 1.890093e-2 m in the forced response, is 0.970644 Hz wide, less than a step; use more --points, or leave --points out
    ");

    let command = on_oscillator("basins", "--drive tip.x=5 --frequency-hz 11.08 --points 7,7 --plot basins");
    insta::assert_snapshot!(resonarm(folder.path(), &command).stdout, @"
    49 states: q1_m_sqrt_kg from -0.02732 to 0.02732, q1_dot_m_sqrt_kg_s from -1.902 to 1.902
    response 1: largest tip.x 6.007680e-3 m; reached by 24 of these 49 states
    response 2: largest tip.x 1.821289e-2 m; reached by 25 of these 49 states
    written to basins.csv, basins.json, basins.svg, basins.png, basins.txt
    ");
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    let found: Value = serde_json::from_str(&read("basins.json")).unwrap();
    let keys = ["cells", "configuration", "coordinates", "diverging", "motions", "over", "undecided"];
    assert_eq!(names(&found), keys);
    assert_eq!(found["over"], serde_json::json!(["q1_m_sqrt_kg", "q1_dot_m_sqrt_kg_s"]));
    assert_eq!(read("basins.csv").lines().next(), Some("q1_m_sqrt_kg,q1_dot_m_sqrt_kg_s,outcome,motion,periods"));
    assert!(read("basins.svg").contains("dq₁/dt (m·√kg/s)"));
}

/// Without stability the responses, peaks and folds are the same.
#[test]
fn a_branch_without_stability() {
    let folder = oscillator();
    let all = "--drive tip.x=5 --from-hz 9 --to-hz 13";
    let [whole, bare] = ["--json", "--json --no-stability"]
        .map(|more| document(folder.path(), 0, &on_oscillator("continue", &format!("{all} {more}"))));
    assert_eq!(bare["configuration"]["continue"]["stability"], false);
    let without = |list: &Value| {
        let mut list = list.as_array().unwrap().clone();
        for point in &mut list {
            for key in ["stable", "multipliers", "stability", "multiplier_accuracy"] {
                point[key] = Value::Null;
            }
        }
        list
    };
    for key in ["points", "bifurcations", "peaks"] {
        assert_eq!(bare[key].as_array().unwrap(), &without(&whole[key]), "{key}");
    }
    assert!(whole["points"].as_array().unwrap().iter().all(|point| point["stable"].is_boolean()));
    assert_eq!(whole["bifurcations"].as_array().unwrap().len(), 2);
    let shown = resonarm(folder.path(), &on_oscillator("continue", &format!("{all} --no-stability"))).stdout;
    let lines: Vec<&str> = shown.lines().skip(1).collect();
    insta::assert_snapshot!(lines.join("\n"), @"
    stability not computed: bifurcations other than folds are not found
    fold at 11.2802890 Hz: tip.x 1.870850e-2 m
    fold at 10.8842870 Hz: tip.x 9.901828e-3 m
    largest response of tip.x at 11.2570627 Hz: tip.x 1.890093e-2 m
    responses were searched at 5 frequencies with 10 starts each, up to 7.56e-2 m at tip.x, and along folds for loads from 2.82 to 10.0 N: found none; others may exist
    ");
}

/// Sections over a parameter, and sweeps at several of its values, of modes with an element.
#[test]
fn sections_and_sweeps_over_a_parameter() {
    let folder = oscillator();
    let section = on_oscillator("poincare", "--drive tip.x=5 --frequency-hz 11.08 --plot section");
    insta::assert_snapshot!(resonarm(folder.path(), &section).stdout, @r"
    1 response with the period of the excitation
    written to section.csv, section.json, section.svg, section.png, section.txt
    ");
    let svg = fs::read_to_string(folder.path().join("section.svg")).unwrap();
    assert!(svg.contains("tip.x (m)") && svg.contains("dtip.x/dt (m/s)"), "{svg}");
    let over = "--drive tip.x=5 --frequency-hz 11 --parameter element1.stiffness3_n_m3 --from 1e5 --to 8e6 --points 5";
    let diagram = document(folder.path(), 0, &on_oscillator("poincare", &format!("{over} --json --plot diagram")));
    let responses = diagram["motions"].as_array().unwrap();
    // Five values in two directions.
    assert_eq!(responses.len(), 10);
    assert_eq!(
        names(&responses[0]),
        ["direction", "drift", "period", "readings", "section", "settling_periods", "value"]
    );
    // At the first value both directions settle on the only response.
    let size = |k: usize| responses[k]["readings"]["tip.x"]["largest"].as_f64().unwrap();
    assert_eq!((responses[0]["value"].as_f64(), responses[9]["value"].as_f64()), (Some(1e5), Some(1e5)));
    assert!((size(0) / size(9) - 1.0).abs() < 1e-6, "{} {}", size(0), size(9));
    let csv = fs::read_to_string(folder.path().join("diagram.csv")).unwrap();
    assert_eq!(csv.lines().next(), Some("direction,element1_stiffness3_n_m3,period,q1_m_sqrt_kg,q1_dot_m_sqrt_kg_s"));

    let over = "--drive tip.x=1 --from-hz 9 --to-hz 11 --points 3 --direction up --over mode1.damping_ratio=0.02,0.1";
    let swept = document(folder.path(), 0, &on_oscillator("sweep", &format!("{over} --json --plot both")));
    assert_eq!(swept["over"], "mode1.damping_ratio");
    let largest =
        [0, 1].map(|k: usize| swept["sweeps"][k]["points"][1]["readings"]["tip.x"]["largest"].as_f64().unwrap());
    // At the natural frequency a fifth of the damping is five times the response, less what the spring takes off.
    assert!(largest[0] > 2.0 * largest[1], "{largest:?}");
    assert_eq!([0, 1].map(|k: usize| swept["sweeps"][k]["value"].as_f64()), [Some(0.02), Some(0.1)]);
    let svg = fs::read_to_string(folder.path().join("both.svg")).unwrap();
    assert!(svg.contains("mode1.damping_ratio = 0.02") && svg.contains("mode1.damping_ratio = 0.1"));
}

/// A branch in a value of the element, with its curve of folds, drawn.
#[test]
fn a_branch_in_a_parameter_of_an_element() {
    let folder = oscillator();
    let all = "--drive tip.x=5 --parameter element1.stiffness3_n_m3 --frequency-hz 11 --from 1e5 --to 8e6 \
               --curves-in mode1.damping_ratio --curves-to 0.02 --plot branch";
    let shown = resonarm(folder.path(), &on_oscillator("continue", all)).stdout;
    assert!(shown.contains("curve of folds"), "{shown}");
    let svg = fs::read_to_string(folder.path().join("branch-curves.svg")).unwrap();
    assert!(svg.contains("mode1.damping_ratio") && svg.contains("element1.stiffness3_n_m3 (N/m³)"));
    let head = fs::read_to_string(folder.path().join("branch-curves.csv")).unwrap();
    let names = "curve,kind,element1_stiffness3_n_m3,mode1_damping_ratio,tip_x_amplitude_m";
    assert_eq!(head.lines().next(), Some(names));
    let says = |more: &str| complaint(folder.path(), 2, &on_oscillator("continue", more)).trim().to_owned();
    insta::assert_snapshot!(
        says("--drive tip.x=5 --parameter link1.mass_kg --frequency-hz 11 --from 1 --to 2"),
        @"resonarm: --parameter link1.mass_kg: there is no parameter `link1.mass_kg` in this structure: expected one of mode1.frequency_hz, mode1.damping_ratio, element1.stiffness3_n_m3, element1.stiffness5_n_m5; or frequency, or amplitude"
    );
    insta::assert_snapshot!(
        says("--drive tip.x=5 --from-hz 9 --to-hz 13 --curves-in frequency --curves-to 9"),
        @"resonarm: --curves-in frequency is the quantity in which the branch is followed already: choose another"
    );
}

/// What the commands ask for, and what has no meaning for a structure, or for the arm.
#[test]
fn analyses_of_structures_refuse_in_words() {
    let folder = oscillator();
    let says = |command: &str, more: &str| {
        complaint(folder.path(), 2, &on_oscillator(command, more)).trim().trim_start_matches("resonarm: ").to_owned()
    };
    let backbone = |more: &str| says("backbone", &format!("--drive tip.x {more}"));
    insta::assert_snapshot!(says("backbone", ""), @"the excitation is missing: give it by --drive DOF=A, with DOF one of tip.x");
    insta::assert_snapshot!(backbone(""), @"the end of the curve is missing: give the displacement of tip.x at which it ends, in m, by --to X, or the load at which it ends, by --drive tip.x=A");
    insta::assert_snapshot!(says("backbone", "--undamped --to 0.1"), @"the degree of freedom to read is missing: give it by --at DOF, one of tip.x");
    insta::assert_snapshot!(says("backbone", "--at tip.x --undamped"), @"the end of the curve is missing: give the displacement of tip.x at which it ends, in m, by --to X");
    insta::assert_snapshot!(says("backbone", "--drive tip.x=3 --undamped"), @"the end of the curve is missing: give the displacement of tip.x at which it ends, in m, by --to X");
    insta::assert_snapshot!(backbone("--to=-1"), @"--to is -1: it must be a positive number");
    insta::assert_snapshot!(backbone("--to 0.1 --mode 3"), @"along the backbone: there is no mode 3: the structure has modes 1 to 1");
    let continued = |more: &str| says("continue", more);
    insta::assert_snapshot!(continued("--drive tip.x --from-hz 9 --to-hz 10"), @"--drive tip.x has no amplitude: give --drive tip.x=A, in N");
    insta::assert_snapshot!(continued("--drive tip.x=1 --drive tip.x=2 --from-hz 9 --to-hz 10"), @"--drive tip.x is given twice: give each load once");
    insta::assert_snapshot!(continued("--drive tip.x=1 --parameter amplitude --frequency-hz 9 --from 1 --to 2"), @"the amplitude is the quantity that varies: give --drive tip.x without one");
    insta::assert_snapshot!(says("integrators", ""), @"the structure consists of modes, which are stepped by their exact solution, not by a scheme: use a chain");
    insta::assert_snapshot!(says("modes", "--angles-deg 1"), @"--angles-deg turns the links of a chain, but the scenario's [structure] is of the kind modal: leave --angles-deg out");
    insta::assert_snapshot!(says("modes", "--preset irb1600-fitted"), @"--preset irb1600-fitted is a structure of its own, but the scenario's [structure] is of the kind modal: leave --preset out");
    insta::assert_snapshot!(says("modes", "--set mode2.frequency_hz=3"), @"structure.set: `mode2.frequency_hz` is 3: there is no parameter `mode2.frequency_hz` in this structure: expected one of mode1.frequency_hz, mode1.damping_ratio, element1.stiffness3_n_m3, element1.stiffness5_n_m5");
    let sweep = |more: &str| says("sweep", &format!("--drive tip.x=1 --from-hz 9 --to-hz 10 {more}"));
    insta::assert_snapshot!(sweep("--initial 0"), @"--initial has 1 numbers, expected 2: q1_m_sqrt_kg, q1_dot_m_sqrt_kg_s");
    insta::assert_snapshot!(sweep("--over link2.angle_deg=1,2"), @"--over: there is no parameter `link2.angle_deg` in this structure: expected one of mode1.frequency_hz, mode1.damping_ratio, element1.stiffness3_n_m3, element1.stiffness5_n_m5");
    insta::assert_snapshot!(sweep("--over mode1.damping_ratio=-1"), @"--over: mode 1: `damping_ratio` is -1: it must be a number from 0");
    let basins = |more: &str| says("basins", &format!("--drive tip.x=5 --frequency-hz 13 {more}"));
    insta::assert_snapshot!(basins("--coordinates q1_m_sqrt_kg,q3"), @"--coordinates: unknown coordinate `q3`: the coordinates are q1_m_sqrt_kg, q1_dot_m_sqrt_kg_s");
    insta::assert_snapshot!(basins("--coordinates q1_m_sqrt_kg,q1_m_sqrt_kg"), @"--coordinates names q1_m_sqrt_kg twice: give two different ones");
    let section = |more: &str| says("poincare", &format!("--drive tip.x=3 {more}"));
    insta::assert_snapshot!(section(""), @"the frequency of the excitation is missing: give --frequency-hz F");
    insta::assert_snapshot!(section("--frequency-hz 10 --parameter mode1.frequency_hz --from-hz 9 --to-hz 10"), @"--from-hz is not for --parameter mode1.frequency_hz; give its interval by --from a --to b");
    let friction = example("friction.toml");
    let refused = |more: &str| {
        let command = ["backbone", "--scenario", &friction, "--drive", "tip.y", "--to", "1"];
        let command: Vec<&str> = command.into_iter().chain(more.split_whitespace()).collect();
        complaint(folder.path(), 2, &command).trim().trim_start_matches("resonarm: ").to_owned()
    };
    insta::assert_snapshot!(refused(""), @"along the backbone: element 1, friction, acts at infinitesimal amplitude, but a backbone must begin as a linear mode; leave the element out, or give a contact a gap");
    insta::assert_snapshot!(refused("--undamped"), @"element 1, friction, dissipates energy, so the undamped structure is not defined: leave the element out");
}

/// Two masses of 2 kg, free, as a finite-element program writes them: rigid modes at 0 Hz, or nearly so by rounding.
const FREE: &str = "    -1
   164
         1SI: Meter (newton)         2
  1.00000000000000000e+00  1.00000000000000000e+00  1.00000000000000000e+00
  2.73149999999999977e+02
    -1
    -1
    55
a
b
c
d
e
         1         2         2         8         2         3
         2         4         0         1
  0.00000e+00  4.00000e+00  0.00000e+00  0.00000e+00
         1
  1.00000e+00  0.00000e+00  0.00000e+00
         2
  1.00000e+00  0.00000e+00  0.00000e+00
    -1
    -1
    55
a
b
c
d
e
         1         2         2         8         2         3
         2         4         0         2
  3.10000e-05  4.00000e+00  0.00000e+00  0.00000e+00
         1
  0.00000e+00  1.00000e+00  0.00000e+00
         2
  0.00000e+00  1.00000e+00  0.00000e+00
    -1
    -1
    55
a
b
c
d
e
         1         2         2         8         2         3
         2         4         0         3
  1.20000e+02  4.00000e+00  1.00000e-02  0.00000e+00
         1
  0.00000e+00  1.00000e+00  0.00000e+00
         2
  0.00000e+00 -1.00000e+00  0.00000e+00
    -1
";

/// Every command on a structure that nothing holds: the closed forms, and what is refused in words.
#[test]
fn a_free_structure_through_the_commands() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("free.uff"), FREE).unwrap();
    let scenario = "[structure]\nkind = 'modal'\nfile = 'free.uff'\nnodes = { tip = 2, end = 1 }\n\
        [rig.exciter]\nat = 'tip'\n[excitation]\namplitude = { exciter_y = 2.0 }\n[excitation.profile]\nwaveform = 'dwell'\n\
        frequency_hz = 30.0\nsettle_s = 0.1\nduration_s = 0.5\n";
    fs::write(folder.path().join("free.toml"), scenario).unwrap();
    let on = |arguments: &str| {
        let all: Vec<&str> = arguments.split(' ').chain(["--scenario", "free.toml"]).collect();
        document(folder.path(), 0, &all)
    };
    let modes = on("modes --json");
    assert_eq!(modes["modes"][0]["frequency_hz"], 0.0);
    assert!((modes["modes"][2]["frequency_hz"].as_f64().unwrap() - 120.0).abs() < 1e-9);
    let frf = on("frf --json --drive tip.y --quantity accelerance --from-hz 1 --to-hz 2 --points 2");
    let line = numbers(&frf["responses"][0]["value"][0]);
    assert!((line[0] - 0.25).abs() < 1e-3 && line[1].abs() < 1e-5, "{line:?}");
    // x = F/m (t/Ω − sin(Ωt)/Ω²) along x, where nothing is elastic, after ten periods: Ft/mΩ.
    let moved = on("simulate --json --drive tip.x=4 --frequency-hz 5 --duration-s 2");
    let q = numbers(&moved["position"]);
    assert!((0.5 * q[0] - 2.0 / (10.0 * std::f64::consts::PI)).abs() < 1e-9, "{q:?}");
    let branch = on("continue --json --drive tip.y=3 --from-hz 110 --to-hz 130");
    assert!(branch["points"].as_array().unwrap().len() > 3);
    on("run --mode free --record free.mcap --json");
    assert_eq!(resonarm(folder.path(), &["resim", "free.mcap"]).code, 0);
    let refused = |code: i32, arguments: &str| {
        let all: Vec<&str> = arguments.split(' ').chain(["--scenario", "free.toml"]).collect();
        complaint(folder.path(), code, &all)
    };
    insta::assert_snapshot!(refused(2, "sweep --drive tip.y=3 --from-hz 110 --to-hz 130").trim(), @"resonarm: mode 1 is rigid, at 0 Hz, so no response settles; give the mode the frequency and the damping that it has on its soft supports");
    insta::assert_snapshot!(refused(2, "backbone --drive tip.y=3 --mode 1").trim(), @"resonarm: along the backbone: mode 1 is rigid, at 0 Hz, so it has no resonance: choose another mode");
    insta::assert_snapshot!(refused(2, "frf --drive tip.y --from-hz 0").trim(), @"resonarm: the response at 0 Hz is infinite: mode 1 is rigid, so nothing holds the structure; start above 0 Hz");
    insta::assert_snapshot!(refused(2, "experiment walk --points 3").trim(), @"resonarm: control: mode 1 does not oscillate: it is rigid, at 0 Hz, or overdamped; choose a mode that has a resonance");
}

/// Doubtful moments of inertia are told, by link and numbers; the chain is computed.
#[test]
fn an_impossible_inertia_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let robot = "<robot name='r'><link name='base'/><link name='l1'><inertial><origin xyz='0.25 0 0'/><mass value='8'/>\
        <inertia ixx='0.001' ixy='0' ixz='0' iyy='0.001' iyz='0' izz='0.5'/></inertial></link><link name='tool'/>\
        <joint name='a1' type='revolute'><parent link='base'/><child link='l1'/><axis xyz='0 0 1'/></joint>\
        <joint name='t' type='fixed'><parent link='l1'/><child link='tool'/><origin xyz='0.5 0 0'/></joint></robot>";
    fs::write(folder.path().join("r.urdf"), robot).unwrap();
    let scenario = "[structure]\nkind = 'chain'\nfile = 'r.urdf'\n\
        joints = [{ name = 'a1', stiffness_nm_rad = 3e4, damping_nm_s_rad = 10.0 }]\n";
    fs::write(folder.path().join("r.toml"), scenario).unwrap();
    for command in ["structure", "modes"] {
        let shown = resonarm(folder.path(), &[command, "--scenario", "r.toml"]);
        let told = shown.stderr;
        assert_eq!(shown.code, 0, "{told}");
        assert!(told.contains("link `l1`: its principal moments of inertia are 0.001, 0.001 and 0.5 kg·m²"), "{told}");
    }
}

/// A bracket on a base: its transmissibility, its branch in m/s², and what a rig and a reading refuse.
#[test]
fn a_structure_on_a_base() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = "[structure]\nkind = 'modal'\n[[structure.modes]]\nfrequency_hz = 20.0\ndamping_ratio = 0.05\n\
        shape = { 'tip.z' = 0.5 }\nparticipation = { 'base.z' = 2.0 }\n";
    fs::write(folder.path().join("base.toml"), format!("{scenario}[rig.exciter]\nat = 'tip.z'\n")).unwrap();
    fs::write(folder.path().join("moved.toml"), format!("{scenario}[rig.exciter]\nat = 'base.z'\n")).unwrap();
    let on = |arguments: &str| {
        let all: Vec<&str> = arguments.split(' ').chain(["--json", "--scenario", "base.toml"]).collect();
        document(folder.path(), 0, &all)
    };
    let frf = on("frf --drive base.z --at tip.z --quantity accelerance --from-hz 20 --to-hz 40 --points 2");
    let peak = numbers(&frf["responses"][0]["value"][0]);
    assert!((peak[0] - 1.0).abs() < 1e-9 && (peak[1] + 10.0).abs() < 1e-9, "{peak:?}");
    assert_eq!(frf["responses"][0]["unit"], "m/s² per m/s²");
    let branch = on("continue --drive base.z=3 --at tip.z --from-hz 15 --to-hz 25");
    let omega = 40.0 * std::f64::consts::PI;
    let largest = branch["peaks"][0]["readings"]["tip.z"]["largest"].as_f64().unwrap();
    assert!((largest / (3.0 / (2.0 * 0.05 * omega * omega)) - 1.0).abs() < 1e-2, "{largest}");
    let refused = |arguments: &str| {
        let all: Vec<&str> = arguments.split(' ').collect();
        complaint(folder.path(), 2, &all)
    };
    insta::assert_snapshot!(refused("continue --drive base.z=3 --from-hz 15 --to-hz 25 --scenario base.toml").trim(), @"resonarm: base.z is the base, from which displacements count: choose by --at where the response is read, at one of the points tip");
    insta::assert_snapshot!(refused("run --mode free --scenario moved.toml").trim(), @"resonarm: rig.exciter: `at` is `base.z`, the moving base: it is driven by an acceleration, but a rig commands forces. To move the base, use frf, continue, simulate, sweep or basins; for a run, describe the free structure, with the mass of the table and modes at 0 Hz, and place the exciter at the table");
}
