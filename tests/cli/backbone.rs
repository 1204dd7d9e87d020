//! `resonarm backbone` as a process: the table, the document, the figure, and its messages on bad input.

use std::process::{Command, Output, Stdio};

use serde_json::Value;

fn resonarm(arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    // Help is wrapped at the width of a terminal, which COLUMNS would state.
    command.args(arguments.split(' ')).env_remove("COLUMNS").stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).trim_end().to_string()
}

fn done(arguments: &str) -> String {
    let output = resonarm(arguments);
    assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn document(arguments: &str) -> Value {
    serde_json::from_str(&done(&format!("{arguments} --json"))).unwrap()
}

/// The first mode at β2 = 60° softens; a mode of the undamped arm has no excitation and almost the same frequencies.
#[test]
fn a_table_with_its_reading() {
    insta::assert_snapshot!(done("backbone --drive=joint1=10 --at=joint1,joint2 --to=0.1"), @r"
    irb1600-fitted at 0°, 60°, mode 1 from 22.157526 Hz: in phase quadrature with a load at joint1

      frequency Hz   largest joint1 rad   largest joint2 rad            N·m
         22.157527          1.649711e-4          1.291410e-4         0.0333
         22.157527          2.062150e-4          1.614322e-4         0.0417
         22.157527          2.577704e-4          2.017996e-4         0.0521
         22.157527          3.222156e-4          2.522641e-4         0.0651
         22.157527          4.027736e-4          3.153529e-4         0.0814
         22.157526          5.034734e-4          3.942267e-4         0.1017
         22.157526          6.293518e-4          4.928389e-4         0.1272
         22.157526          7.867054e-4          6.161354e-4         0.1589
         22.157525          9.834061e-4          7.703048e-4         0.1987
         22.157524          1.229296e-3          9.630926e-4         0.2484
         22.157523          1.536679e-3          1.204196e-3         0.3104
         22.157521          1.920941e-3          1.505761e-3         0.3881
         22.157517          2.401321e-3          1.883007e-3         0.4851
         22.157512          3.001876e-3          2.355016e-3         0.6063
         22.157503          3.752694e-3          2.945731e-3         0.7579
         22.157490          4.691412e-3          3.685221e-3         0.9474
         22.157469          5.865109e-3          4.611292e-3         1.1843
         22.157437          7.332694e-3          5.771536e-3         1.4805
         22.157386          9.167891e-3          7.225968e-3         1.8507
         22.157307          1.146298e-2          9.050407e-3         2.3136
         22.157183          1.433352e-2          1.134085e-2         2.8925
         22.156989          1.792423e-2          1.421918e-2         3.6165
         22.156688          2.241640e-2          1.784052e-2         4.5224
         22.156218          2.803724e-2          2.240294e-2         5.6565
         22.155486          3.507142e-2          2.816004e-2         7.0773
         22.154349          4.387562e-2          3.543708e-2         8.8595
         22.153497          4.949438e-2          4.012078e-2        10.0000

    softening: -0.004030 Hz (-0.0182 %) at joint1 4.949438e-2 rad; at small amplitudes a of joint1, df/d(a²) = -1.682467e0 Hz/rad²
    ");
    insta::assert_snapshot!(done("backbone --undamped --mode=2 --angles-deg=0,120 --at=joint2,joint1 --to=0.01"), @r"
    irb1600-fitted at 0°, 120°, mode 2 from 40.363745 Hz: nonlinear normal mode of the structure without damping

      frequency Hz   largest joint2 rad   largest joint1 rad       energy J
         40.363745          3.333334e-5          1.271438e-6    7.155968e-5
         40.363745          4.166668e-5          1.589311e-6    1.118120e-4
         40.363745          5.208335e-5          1.986659e-6    1.747062e-4
         40.363745          6.510419e-5          2.483355e-6    2.729785e-4
         40.363745          8.138025e-5          3.104243e-6    4.265289e-4
         40.363745          1.017253e-4          3.880381e-6    6.664514e-4
         40.363745          1.271567e-4          4.850598e-6    1.041330e-3
         40.363745          1.589459e-4          6.063435e-6    1.627079e-3
         40.363745          1.986824e-4          7.579589e-6    2.542310e-3
         40.363745          2.483531e-4          9.474947e-6    3.972360e-3
         40.363745          3.104415e-4          1.184440e-5    6.206813e-3
         40.363745          3.880520e-4          1.480663e-5    9.698145e-3
         40.363745          4.850653e-4          1.851004e-5    1.515335e-2
         40.363746          6.063321e-4          2.314029e-5    2.367711e-2
         40.363746          7.579158e-4          2.892965e-5    3.699549e-2
         40.363747          9.473959e-4          3.616877e-5    5.780545e-2
         40.363748          1.184247e-3          4.522142e-5    9.032101e-2
         40.363749          1.480311e-3          5.654312e-5    1.411266e-1
         40.363752          1.850393e-3          7.070445e-5    2.205103e-1
         40.363756          2.312998e-3          8.842046e-5    3.445474e-1
         40.363763          2.891258e-3          1.105879e-4    5.383553e-1
         40.363773          3.614088e-3          1.383323e-4    8.411803e-1
         40.363789          4.517636e-3          1.730674e-4     1.314344e0
         40.363814          5.647085e-3          2.165718e-4     2.053664e0
         40.363853          7.058920e-3          2.710858e-4     3.208852e0
         40.363915          8.823749e-3          3.394365e-4     5.013835e0
         40.363963          1.000000e-2          3.851195e-4     6.439578e0

    hardening: +0.000218 Hz (+0.0005 %) at joint2 1.000000e-2 rad; at small amplitudes a of joint2, df/d(a²) = +2.181479e0 Hz/rad²
    ");
}

/// Each point of the curve is next to the peak of the forced response under the excitation in its row.
#[test]
fn a_document_that_the_forced_response_passes_through() {
    let curve = document("backbone --drive=tip.x=60 --angles-deg=30,120 --at=joint1 --to=1");
    assert_eq!((curve["kind"].as_str(), curve["bending"].as_str()), (Some("phase-quadrature"), Some("softening")));
    assert!(curve["frequency_shift_hz"].as_f64().unwrap() < 0.0);
    let points = curve["points"].as_array().unwrap();
    let number = |point: &Value, key: &str| point[key].as_f64().unwrap();
    // The curve ends at the load that was given, since it comes there before the displacement of 1 rad.
    assert!((number(&points[points.len() - 1], "drive") / 60.0 - 1.0).abs() < 1e-9);
    // One point in the middle of the curve, and one near its end, where it bends most.
    for point in [&points[points.len() / 2], &points[points.len() - 2]] {
        let (hz, force) = (number(point, "frequency_hz"), number(point, "drive"));
        let arguments = format!(
            "continue --drive=tip.x={force} --angles-deg=30,120 --at=joint1 --from-hz={} --to-hz={}",
            hz - 0.5,
            hz + 0.5
        );
        let branch = document(&arguments);
        let of = |point: &Value| point["readings"]["joint1"]["amplitude"].as_f64().unwrap();
        let highest = branch["points"].as_array().unwrap().iter().map(of).fold(0.0, f64::max);
        // No point of the branch is above the peak, which the continuation may miss by a step.
        let ratio = highest / of(point);
        assert!((0.95..1.000_1).contains(&ratio), "{hz} Hz, {force} N: {ratio}");
    }
}

#[test]
fn a_figure_over_the_forced_response() {
    let folder = tempfile::tempdir().unwrap();
    let stem = folder.path().join("backbone");
    let said = done(&format!("backbone --drive=joint1=60 --plot={}", stem.display()));
    insta::assert_snapshot!(said.replace(&folder.path().display().to_string(), "."), @r"
    irb1600-fitted at 0°, 60°, mode 1 from 22.157526 Hz: in phase quadrature with a load at joint1

    softening: -0.093993 Hz (-0.4242 %) at joint1 2.744624e-1 rad; at small amplitudes a of joint1, df/d(a²) = -1.682464e0 Hz/rad²
    written to ./backbone.svg, ./backbone.png, ./backbone.txt, ./backbone.csv, ./backbone.json, ./backbone-response.csv
    ");
    let svg = std::fs::read_to_string(stem.with_extension("svg")).unwrap();
    for words in ["phase quadrature", "unstable", "fold", "response to 60 N·m at joint1"] {
        assert!(svg.contains(words), "{words}");
    }
    assert!(stem.with_extension("png").exists());
    let read = |ending: &str| std::fs::read_to_string(format!("{}{ending}", stem.display())).unwrap();
    let curve: Value = serde_json::from_str(&read(".json")).unwrap();
    assert_eq!(read(".csv").lines().count(), 1 + curve["points"].as_array().unwrap().len());
    assert!(read(".csv").starts_with("frequency_hz,drive,joint1_largest_rad,"));
    // A folded resonance has two folds.
    assert_eq!(read("-response.csv").lines().filter(|line| line.contains(",marginal,fold,")).count(), 2);
}

/// A figure of branches has its numbers in files beside it, with the inputs; its title states the excitation, but not
/// an angle that varies.
#[test]
fn figures_of_branches_have_their_numbers_beside_them() {
    let folder = tempfile::tempdir().unwrap();
    let stem = folder.path().join("branch");
    let command = "continue --parameter=link2.angle_deg --drive=joint1=60 --frequency-hz=22 --from=55 --to=60";
    let said = done(&format!("{command} --curves-in=amplitude --curves-to=50 --plot={}", stem.display()));
    let said = said.replace(&folder.path().display().to_string(), ".");
    insta::assert_snapshot!(said.lines().last().unwrap(), @"written to ./branch.svg, ./branch.png, ./branch.txt, ./branch.csv, ./branch.json, ./branch-curves.svg, ./branch-curves.png, ./branch-curves.txt, ./branch-curves.csv");
    let read = |ending: &str| std::fs::read_to_string(format!("{}{ending}", stem.display())).unwrap();
    let svg = read(".svg");
    assert!(svg.contains("irb1600-fitted at 0°, …, 60 N·m at joint1, 22 Hz"), "{svg}");
    let document: Value = serde_json::from_str(&read(".json")).unwrap();
    let configuration = &document["configuration"];
    assert_eq!(configuration["drive"], serde_json::json!({ "joint1": { "amplitude": 60.0, "unit": "N·m" } }));
    // A preset is stated by its links: 50.58 kg is the mass of link 2 in it.
    assert_eq!(configuration["structure"]["links"][1]["mass_kg"].as_f64(), Some(50.58));
    assert_eq!(configuration["continue"]["frequency_hz"].as_f64(), Some(22.0));
    let csv = read(".csv");
    insta::assert_snapshot!(csv.lines().next().unwrap(), @"branch,link2_angle_deg,frequency_hz,drive,largest_multiplier,stability,bifurcation,joint1_largest_rad,joint1_mean_rad,joint1_amplitude_rad,joint1_phase_deg");
    let [points, events] = ["points", "bifurcations"].map(|key| document[key].as_array().unwrap().len());
    // A header, and a line for each point and each fold.
    assert_eq!((csv.lines().count(), events), (1 + points + events, 2));
    insta::assert_snapshot!(read("-curves.csv").lines().next().unwrap(), @"curve,kind,link2_angle_deg,amplitude,joint1_amplitude_rad");
    assert!(read("-curves.svg").contains("irb1600-fitted at 0°, …, driven at joint1, 22 Hz"));
}

/// The examples at the end of a help text work: each succeeds, and those with a folder or a figure write one.
#[test]
fn examples_of_the_help_run() {
    for command in ["continue", "backbone", "sweep", "poincare"] {
        // An example over two lines ends the first with a backslash, as in a shell.
        let help = done(&format!("{command} --help")).replace("\\\n", "");
        let folder = tempfile::tempdir().unwrap();
        let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/structures/hardening.toml");
        std::fs::copy(scenario, folder.path().join("hardening.toml")).unwrap();
        let examples: Vec<&str> = help.lines().filter_map(|line| line.strip_prefix("  resonarm ")).collect();
        assert!(examples.len() >= 3, "{command}: {help}");
        for example in examples {
            let mut program = Command::new(env!("CARGO_BIN_EXE_resonarm"));
            let output =
                program.args(example.split_whitespace()).current_dir(&folder).stdin(Stdio::null()).output().unwrap();
            assert!(output.status.success(), "{example}: {}", text(&output.stderr));
            // What is behind the flag is the name of what the example writes.
            let mut words = example.split_whitespace().skip_while(|word| !["--out", "--plot"].contains(word));
            if let (Some(flag), Some(name)) = (words.next(), words.next()) {
                let name = if flag == "--plot" { format!("{name}.svg") } else { String::from(name) };
                assert!(folder.path().join(&name).exists(), "{example}: no {name}");
            }
        }
    }
}

#[test]
fn short_help_has_options_in_groups() {
    insta::assert_snapshot!(done("backbone -h"), @r"
    Follows a resonance to larger amplitudes: its frequency and its excitation

    Usage: resonarm backbone [OPTIONS]

    What is simulated:
          --scenario <FILE>   TOML file with the whole scenario; flags take precedence over it
          --preset <NAME>     Parameters of the two-link arm [default: irb1600-fitted] [possible values:
                              irb1600-table1, irb1600-fitted]
          --angles-deg <A,B>  Angle of each link, degrees [default: 0,60]
          --set <NAME=X>      Value of a structure's parameter, as link2.mass_kg=40; may be repeated

    Excitation and response:
          --mode <N>       Linear mode in which the curve begins, from 1, by frequency [default: 1]
          --drive <DOF=A>  Load A·sin(2πft), as tip.x=20, N, or joint1=60, N·m; may be repeated
          --at <DOF>       Degrees of freedom to read, as tip.x,joint1 [default: where the loads act]

    Range and steps:
          --to <X>  Displacement at which the curve ends, m, or rad at a joint [default: 0.3 at a joint]

    Computation:
          --undamped            Follow the nonlinear normal mode of the undamped structure
          --most-harmonics <N>  Largest number of harmonics of a response, from 3 to 1000 [default: 64]
          --tolerance <X>       Largest error from the neglected harmonics, relative to the response
          --most-points <N>     Most points of a branch [default: 20000]
          --largest-step <X>    Largest step along the branch, relative to the response [default: 0.25]

    Output:
          --plot <STEM>  Plot to STEM.svg and STEM.png, with caption, CSV and JSON
          --overwrite    Overwrite existing files
          --json         Print the results as one JSON document

    Common to all commands:
      -v, --verbose...  Log more: -v for what happens, -vv for every detail
      -q, --quiet       Log errors only, and show no progress
      -h, --help        Print help: -h in short, --help with all options, explanations and examples
      -V, --version     Print the version
    ");
}

#[test]
fn bad_input_is_refused() {
    let says = |code, arguments: &str| {
        let output = resonarm(arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {}", text(&output.stderr));
        assert!(output.stdout.is_empty());
        text(&output.stderr)
    };
    insta::assert_snapshot!(says(2, "backbone --mode=3"), @"resonarm: along the backbone: there is no mode 3: the structure has modes 1 to 2");
    insta::assert_snapshot!(says(2, "backbone --to=0"), @"resonarm: --to is 0: it must be a positive number");
    insta::assert_snapshot!(says(2, "backbone --to=NaN"), @r"
    error: invalid value 'NaN' for '--to <X>': it must be a finite number

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says(2, "backbone --drive=joint1=0"), @r"
    error: invalid value 'joint1=0' for '--drive <DOF=A>': the amplitude must be a number other than 0

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says(2, "backbone --drive=tip.x=NaN"), @r"
    error: invalid value 'tip.x=NaN' for '--drive <DOF=A>': it must be a finite number

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says(2, "backbone --largest-step=0"), @"resonarm: --largest-step is 0: it must be from 0.000001 to 1");
    insta::assert_snapshot!(says(2, "backbone --preset=none"), @"
    error: invalid value 'none' for '--preset <NAME>': there is no preset `none`: expected one of irb1600-table1, irb1600-fitted

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says(2, "backbone --to=0.01 --plot=/no/such/folder/stem"), @"resonarm: can't write /no/such/folder/stem.svg: No such file or directory (os error 2); check that the folder exists and that you may write there");
}

/// The result so far is printed, the reason for the early end reported, and the exit code is that of a negative
/// verdict.
fn partial(arguments: &str) -> (String, String) {
    let output = resonarm(arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments}: {}", text(&output.stderr));
    (text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_curve_that_ends_early_is_kept() {
    let (table, reason) = partial("backbone --at=joint1,joint2 --most-points=5");
    insta::assert_snapshot!(table, @r"
    irb1600-fitted at 0°, 60°, mode 1 from 22.157526 Hz: in phase quadrature with a load at joint1

      frequency Hz   largest joint1 rad   largest joint2 rad            N·m
         22.157525          1.000127e-3          7.834124e-4         0.2021
         22.157524          1.250198e-3          9.794844e-4         0.2526
         22.157523          1.562809e-3          1.224697e-3         0.3157
         22.157520          1.953607e-3          1.531405e-3         0.3947
         22.157517          2.442158e-3          1.915090e-3         0.4933

    softening: -0.000008 Hz (-0.0000 %) at joint1 2.442158e-3 rad; at small amplitudes a of joint1, df/d(a²) = -1.682467e0 Hz/rad²
    ");
    insta::assert_snapshot!(reason, @"resonarm: along the backbone: the branch was followed to 22.157517 Hz, where it reached the limit of 5 points; allow more points or larger steps (--most-points, --largest-step); the 5 responses before that are in the results");
    let (document, reason) = partial("backbone --most-harmonics=3 --json");
    insta::assert_snapshot!(reason, @"resonarm: along the backbone: at 22.157517 Hz the response needs more than 3 harmonics; lower the excitation, or allow more harmonics (--most-harmonics); the 4 responses before that are in the results");
    let document: Value = serde_json::from_str(&document).unwrap();
    assert_eq!(document["points"].as_array().unwrap().len(), 4);
    assert_eq!(format!("resonarm: {}", document["ended_early"][0].as_str().unwrap()), reason);
}

/// A branch that ends early has the first responses and bifurcations of the whole one, and its figure is drawn.
#[test]
fn a_branch_that_ends_early_is_kept() {
    let command = "continue --drive=joint1=60 --from-hz=21 --to-hz=23";
    let whole = document(command);
    assert!(whole["ended_early"].is_null());
    let folder = tempfile::tempdir().unwrap();
    let stem = folder.path().join("branch");
    let (early, reason) = partial(&format!("{command} --most-points=50 --json --plot={}", stem.display()));
    insta::assert_snapshot!(reason, @"resonarm: along frequency_hz: the branch was followed to 22.153542 Hz, where it reached the limit of 50 points; allow more points or larger steps (--most-points, --largest-step); the 50 responses before that are in the results");
    let early: Value = serde_json::from_str(&early).unwrap();
    assert_eq!(early["points"].as_array().unwrap()[..], whole["points"].as_array().unwrap()[..50]);
    // Both folds are on the first 50 points.
    assert_eq!(early["bifurcations"], whole["bifurcations"]);
    assert!(stem.with_extension("png").exists());
    let (summary, _) = partial(&format!("{command} --most-points=10"));
    assert!(summary.starts_with("10 responses, 0 of them unstable"), "{summary}");
}

/// Curves of folds that end early do not change the branch; each is kept as far as it came.
#[test]
fn curves_that_end_early_leave_the_branch() {
    let command = "continue --drive=joint1=60 --from-hz=21 --to-hz=23 --curves-in=amplitude --curves-to=5";
    let (early, reason) = partial(&format!("{command} --most-points=60 --json"));
    insta::assert_snapshot!(reason, @r"
    resonarm: along frequency_hz: the branch was followed to 22.244301 Hz, where it reached the limit of 60 points; allow more points or larger steps (--most-points, --largest-step); the 60 responses before that are in the results
    resonarm: along amplitude: the branch was followed to 24.192237 N·m, where it reached the limit of 60 points; allow more points or larger steps (--most-points, --largest-step); the 60 responses before that are in the results
    resonarm: along amplitude: the branch was followed to 24.506233 N·m, where it reached the limit of 60 points; allow more points or larger steps (--most-points, --largest-step); the 60 responses before that are in the results
    ");
    let early: Value = serde_json::from_str(&early).unwrap();
    assert_eq!(early["ended_early"].as_array().unwrap().len(), reason.lines().count());
    assert_eq!(early["curves"].as_array().unwrap().len(), 2);
}

/// `continue` accepts an interval without a resonance, refuses an impossible one, and reports where and why a
/// continuation ended early, and what to try.
#[test]
fn continue_reports_its_failures() {
    assert!(done("continue --drive=joint1=60 --from-hz=3 --to-hz=10").contains("0 of them unstable"));
    let says = |code, arguments: &str| {
        let output = resonarm(&format!("continue {arguments}"));
        assert_eq!(output.status.code(), Some(code), "{arguments}: {}", text(&output.stderr));
        text(&output.stderr)
    };
    insta::assert_snapshot!(says(2, "--drive=joint1=60 --from-hz=22 --to-hz=22"), @"resonarm: along frequency_hz: invalid interval from 22 to 22 Hz: the ends must be two different numbers within the positive frequencies");
    insta::assert_snapshot!(says(2, "--drive=joint1=60 --from-hz=-1 --to-hz=22"), @"resonarm: along frequency_hz: invalid interval from -1 to 22 Hz: the ends must be two different numbers within the positive frequencies");
    insta::assert_snapshot!(says(2, "--drive=joint1=60 --from-hz=22 --to-hz=NaN"), @r"
    error: invalid value 'NaN' for '--to-hz <F>': it must be a finite number

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says(2, "--drive=joint1=60 --from-hz=21"), @"resonarm: --parameter frequency needs an interval: give it by --from-hz a --to-hz b");
    insta::assert_snapshot!(says(2, "--drive=joint1=60 --from-hz=21 --to-hz=22 --to=3"), @"resonarm: --to is not for --parameter frequency; give its interval by --from-hz a --to-hz b");
    insta::assert_snapshot!(says(2, "--drive=joint1=60 --from-hz=21 --to-hz=22 --frequency-hz=3"), @"resonarm: --frequency-hz is for runs in another parameter: leave --frequency-hz out");
    insta::assert_snapshot!(says(2, "--from-hz=21 --to-hz=22"), @"resonarm: the excitation is missing: give it by --drive DOF=A, with DOF one of joint2.x, joint2.y, tip.x, tip.y, joint1, joint2");
    insta::assert_snapshot!(says(2, "--parameter=amplitude --drive=joint1=60 --frequency-hz=22 --from=1 --to=2"), @"resonarm: the amplitude is the quantity that varies: give --drive joint1 without one");
    insta::assert_snapshot!(says(2, "--parameter=amplitude --drive=joint1 --from=1 --to=2"), @"resonarm: --frequency-hz is missing: it must be a positive number");
    insta::assert_snapshot!(says(2, "--parameter=wind --drive=joint1=60"), @"resonarm: --parameter wind: there is no parameter `wind` in this structure: expected one of link1.length_m, link1.mass_kg, link1.centre_of_mass_m, link1.centre_of_mass_off_m, link1.inertia_kg_m2, link1.angle_deg, link1.stiffness_nm_rad, link1.damping_nm_s_rad, link2.length_m, link2.mass_kg, link2.centre_of_mass_m, link2.centre_of_mass_off_m, link2.inertia_kg_m2, link2.angle_deg, link2.stiffness_nm_rad, link2.damping_nm_s_rad, gravity_m_s2; or frequency, or amplitude");
    insta::assert_snapshot!(says(2, "--parameter=link2.mass_kg --drive=joint1=60 --frequency-hz=22 --from=36 --to=-1"), @"resonarm: along link2.mass_kg: invalid interval from 36 to -1 kg: the ends must be two different numbers within the range of the parameter");
    insta::assert_snapshot!(says(2, "--drive=joint1=60 --from-hz=21 --to-hz=23 --tolerance=0.5"), @"resonarm: --tolerance is 0.5: it must be from 1e-14 to 0.1");
    insta::assert_snapshot!(says(1, "--drive=joint1=60 --from-hz=21 --to-hz=23 --most-points=10"), @"resonarm: along frequency_hz: the branch was followed to 21.868289 Hz, where it reached the limit of 10 points; allow more points or larger steps (--most-points, --largest-step); the 10 responses before that are in the results");
}

/// A branch that turns back to its start says so, is kept, and ends with exit code 1.
#[test]
fn a_branch_that_comes_back_says_so() {
    let flags = "continue --drive=joint1=1000 --from-hz=22 --to-hz=22.2";
    let (document, reason) = partial(&format!("{flags} --json"));
    let document: Value = serde_json::from_str(&document).unwrap();
    assert_eq!(document["ended"], "at-start");
    assert!(reason.contains("left the interval at its start, 22.000000 Hz; 22.200000 Hz was not reached"), "{reason}");
    assert_eq!(format!("resonarm: {}", document["ended_early"][0].as_str().unwrap()), reason);
}

/// A branch goes on with the most harmonics that are allowed, and says how many responses would need more.
#[test]
fn a_branch_with_too_few_harmonics_states_its_error() {
    let flags = "--drive=joint1=60 --from-hz=21 --to-hz=23";
    let document =
        |more: &str| -> Value { serde_json::from_str(&done(&format!("continue {flags} {more} --json"))).unwrap() };
    // Four harmonics are too few for the tolerance of 1e-9; with 64 each response takes as many as it needs.
    let (few, all) = (document("--most-harmonics=4"), document("--most-harmonics=64"));
    assert_eq!([&few["ended"], &all["ended"]], ["at-end"; 2]);
    assert_eq!(all["configuration"]["continue"]["tolerance"], 1e-9);
    let beyond = |of: &Value| {
        let points = of["points"].as_array().unwrap();
        points.iter().filter(|point| point["truncation_error"].as_f64().unwrap() > 1e-9).count()
    };
    assert_eq!(beyond(&all), 0);
    let told = done(&format!("continue {flags} --most-harmonics=4"));
    assert!(told.contains(&format!("{} responses would need more than 4 harmonics", beyond(&few))), "{told}");
    assert!(done(&format!("continue {flags} --most-harmonics=4 --tolerance=1e-3")).find("would need").is_none());
}
