//! `resonarm backbone` as a process: the table, the document, the figure, and its messages on bad input.

use std::process::{Command, Output, Stdio};

use serde_json::Value;

fn resonarm(arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
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
    insta::assert_snapshot!(done("backbone --torque1-nm=10 --to-rad=0.1"), @r"
    irb1600-fitted, β1 = 0°, β2 = 60°, mode 1 from 22.157526 Hz: in phase quadrature with a torque at joint 1

      frequency Hz   largest |α1| rad   largest |α2| rad            N·m
         22.157527         0.00026250         0.00020550         0.0530
         22.157527         0.00032812         0.00025689         0.0663
         22.157527         0.00041016         0.00032114         0.0829
         22.157526         0.00051271         0.00040146         0.1036
         22.157526         0.00064089         0.00050188         0.1295
         22.157526         0.00080113         0.00062744         0.1619
         22.157525         0.00100144         0.00078444         0.2023
         22.157524         0.00125184         0.00098077         0.2529
         22.157523         0.00156486         0.00122631         0.3161
         22.157520         0.00195618         0.00153342         0.3952
         22.157517         0.00244537         0.00191761         0.4940
         22.157511         0.00305694         0.00239832         0.6175
         22.157502         0.00382154         0.00299993         0.7718
         22.157488         0.00477749         0.00375308         0.9648
         22.157467         0.00597274         0.00469630         1.2060
         22.157433         0.00746728         0.00587806         1.5076
         22.157381         0.00933620         0.00735955         1.8847
         22.157298         0.01167348         0.00921804         2.3561
         22.157170         0.01459681         0.01155141         2.9456
         22.156970         0.01825359         0.01448393         3.6830
         22.156657         0.02282849         0.01817384         4.6056
         22.156170         0.02855290         0.02282321         5.7606
         22.155411         0.03571680         0.02869082         7.2078
         22.154232         0.04468345         0.03610861         9.0233
         22.153497         0.04949438         0.04012078        10.0000

    softening: -0.004030 Hz (-0.0182 %) at |α1| = 0.049494 rad; at small amplitudes a of α1, df/d(a²) = -1.68247 Hz/rad²
    ");
    insta::assert_snapshot!(done("backbone --undamped --mode=2 --beta2-deg=120 --to-rad=0.01"), @r"
    irb1600-fitted, β1 = 0°, β2 = 120°, mode 2 from 40.363745 Hz: nonlinear normal mode of the arm without dampers

      frequency Hz   largest |α1| rad   largest |α2| rad
         40.363745         0.00000127         0.00003331
         40.363745         0.00000159         0.00004164
         40.363745         0.00000199         0.00005205
         40.363745         0.00000248         0.00006506
         40.363745         0.00000310         0.00008132
         40.363745         0.00000388         0.00010165
         40.363745         0.00000485         0.00012706
         40.363745         0.00000606         0.00015883
         40.363745         0.00000757         0.00019854
         40.363745         0.00000947         0.00024817
         40.363745         0.00001184         0.00031022
         40.363745         0.00001480         0.00038777
         40.363745         0.00001850         0.00048471
         40.363746         0.00002312         0.00060589
         40.363746         0.00002891         0.00075737
         40.363747         0.00003614         0.00094671
         40.363748         0.00004519         0.00118339
         40.363749         0.00005650         0.00147924
         40.363752         0.00007065         0.00184905
         40.363756         0.00008836         0.00231132
         40.363763         0.00011051         0.00288916
         40.363773         0.00013823         0.00361146
         40.363789         0.00017294         0.00451435
         40.363814         0.00021641         0.00564298
         40.363853         0.00027089         0.00705379
         40.363914         0.00033919         0.00881734
         40.363963         0.00038512         0.01000000

    hardening: +0.000218 Hz (+0.0005 %) at |α2| = 0.010000 rad; at small amplitudes a of α2, df/d(a²) = +2.18148 Hz/rad²
    ");
}

/// Each point of the curve is next to the peak of the forced response under the excitation in its row.
#[test]
fn a_document_that_the_forced_response_passes_through() {
    let curve = document("backbone --force-x-n=60 --beta1-deg=30 --beta2-deg=120");
    assert_eq!((curve["kind"].as_str(), curve["bending"].as_str()), (Some("phase-quadrature"), Some("softening")));
    assert!(curve["frequency_shift_hz"].as_f64().unwrap() < 0.0);
    let points = curve["points"].as_array().unwrap();
    let number = |point: &Value, key: &str| point[key].as_f64().unwrap();
    assert!((number(&points[points.len() - 1], "force_n") / 60.0 - 1.0).abs() < 1e-9);
    for point in [&points[points.len() / 2], &points[points.len() - 2]] {
        let (hz, force) = (number(point, "frequency_hz"), number(point, "force_n"));
        let arguments = format!(
            "continue --force-x-n={force} --beta1-deg=30 --beta2-deg=120 --from-hz={} --to-hz={}",
            hz - 0.5,
            hz + 0.5
        );
        let branch = document(&arguments);
        let of = |point: &Value| point["harmonic1_rad"][0].as_f64().unwrap();
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
    let said = done(&format!("backbone --torque1-nm=60 --plot={}", stem.display()));
    insta::assert_snapshot!(said.replace(&folder.path().display().to_string(), "."), @r"
    irb1600-fitted, β1 = 0°, β2 = 60°, mode 1 from 22.157526 Hz: in phase quadrature with a torque at joint 1

    softening: -0.093994 Hz (-0.4242 %) at |α1| = 0.274462 rad; at small amplitudes a of α1, df/d(a²) = -1.68246 Hz/rad²
    written to ./backbone.svg, ./backbone.png, ./backbone.txt, ./backbone-response.csv, ./backbone.csv, ./backbone.json
    ");
    let svg = std::fs::read_to_string(stem.with_extension("svg")).unwrap();
    for words in ["phase quadrature", "unstable", "fold", "response to a torque at joint 1 of 60 N·m"] {
        assert!(svg.contains(words), "{words}");
    }
    assert!(stem.with_extension("png").exists());
    let read = |ending: &str| std::fs::read_to_string(format!("{}{ending}", stem.display())).unwrap();
    let curve: Value = serde_json::from_str(&read(".json")).unwrap();
    assert_eq!(read(".csv").lines().count(), 1 + curve["points"].as_array().unwrap().len());
    assert!(read(".csv").lines().next().unwrap().ends_with(",torque1_nm"));
    assert_eq!(read("-response.csv").lines().filter(|line| line.ends_with(",marginal,fold")).count(), 2);
}

/// A figure of branches has its numbers in files beside it, with the inputs; its title states the excitation, but not
/// an angle that varies.
#[test]
fn figures_of_branches_have_their_numbers_beside_them() {
    let folder = tempfile::tempdir().unwrap();
    let stem = folder.path().join("branch");
    let command = "continue --parameter=beta2_deg --torque1-nm=60 --frequency-hz=22 --from-deg=55 --to-deg=60";
    let said = done(&format!("{command} --curves-in=amplitude --curves-to=50 --plot={}", stem.display()));
    let said = said.replace(&folder.path().display().to_string(), ".");
    insta::assert_snapshot!(said.lines().last().unwrap(), @"written to ./branch.svg, ./branch.png, ./branch.txt, ./branch.csv, ./branch-curves.svg, ./branch-curves.png, ./branch-curves.txt, ./branch-curves.csv, ./branch.json");
    let read = |ending: &str| std::fs::read_to_string(format!("{}{ending}", stem.display())).unwrap();
    let svg = read(".svg");
    assert!(svg.contains("irb1600-fitted, β₁ = 0°, 60 N·m at joint 1, 22 Hz"), "{svg}");
    let document: Value = serde_json::from_str(&read(".json")).unwrap();
    let configuration = &document["configuration"];
    assert_eq!(configuration["torque_nm"], serde_json::json!([60.0, 0.0]));
    assert_eq!(configuration["parameters"]["mass2_kg"].as_f64(), Some(50.58));
    assert_eq!(configuration["continue"]["frequency_hz"].as_f64(), Some(22.0));
    let csv = read(".csv");
    insta::assert_snapshot!(csv.lines().next().unwrap(), @"branch,beta2_deg,frequency_hz,amplitude1_rad,amplitude2_rad,harmonic1_alpha1_rad,harmonic1_alpha2_rad,largest_multiplier,stability,bifurcation");
    let [points, events] = ["points", "bifurcations"].map(|key| document[key].as_array().unwrap().len());
    assert_eq!((csv.lines().count(), events), (1 + points + events, 2));
    insta::assert_snapshot!(read("-curves.csv").lines().next().unwrap(), @"curve,kind,beta2_deg,torque1_nm,harmonic1_alpha1_rad,harmonic1_alpha2_rad");
    assert!(read("-curves.svg").contains("irb1600-fitted, β₁ = 0°, torque at joint 1, 22 Hz"));
}

/// The examples at the end of a help text work: each succeeds, and those with a folder or a figure write one.
#[test]
fn examples_of_the_help_run() {
    for command in ["continue", "backbone", "sweep", "poincare"] {
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
            let mut words = example.split_whitespace().skip_while(|word| !["--out", "--plot"].contains(word));
            if let (Some(flag), Some(name)) = (words.next(), words.next()) {
                let name = if flag == "--plot" { format!("{name}.svg") } else { String::from(name) };
                assert!(folder.path().join(&name).exists(), "{example}: no {name}");
            }
        }
    }
}

#[test]
fn help_lists_every_flag() {
    insta::assert_snapshot!(done("backbone -h"), @r"
    Follows a resonance of the arm, or of a scenario's structure, to larger amplitudes: its frequency,
    the excitation it needs, whether it hardens or softens

    Usage: resonarm backbone [OPTIONS]

    Options:
          --preset <NAME>       Parameter set: irb1600-fitted or irb1600-table1 [default:
                                irb1600-fitted]
      -v, --verbose...          Log more: -v for what happens, -vv for every detail
          --beta1-deg <DEG>     Angle β1 of link 1 against the x axis, degrees [default: 0]
          --no-title            Leave the title and the line below it out of figures, as papers want
                                them; the caption in STEM.txt has both
          --beta2-deg <DEG>     Angle β2 of link 2 against link 1, degrees; 0 is the straight arm
                                [default: 60]
          --scenario <FILE>     TOML file with the whole scenario, in place of the defaults; flags take
                                precedence
          --mode <N>            Linear mode in which the curve begins, from 1, by frequency; the arm has
                                two [default: 1]
          --undamped            The nonlinear normal mode without dampers, which takes no excitation
          --torque1-nm <A>      Amplitude of a torque at joint 1, N·m
          --force-x-n <A>       Amplitude of a force at point C along x, N
          --force-y-n <A>       Amplitude of a force at point C along y, N
          --drive <DOF>         Of a scenario's structure: what is driven, point and axis as tip.x, or a
                                joint as joint2
          --amplitude <A>       Amplitude at --drive, N, or N·m at a joint
          --at <DOF>            Of a structure: where the motion is read, separated by commas [default:
                                where it is driven]
          --to <X>              Of a structure: the curve ends where the first of --at reaches this, m,
                                or rad at a joint, or where the excitation reaches --amplitude
          --to-rad <RAD>        The curve ends where |α1| or |α2| reaches this, rad, or where the
                                excitation reaches the amplitude given [default: 0.3]
          --most-harmonics <N>  Most harmonics that a motion may take [default: 64]
          --most-points <N>     Most points of a branch [default: 20000]
          --largest-step <X>    Largest step along a branch, as a fraction of the motion's size
                                [default: 0.25]
          --readings            Add what a bench reads at B and C to the points in JSON and CSV: the
                                fundamental of displacement, velocity and acceleration
          --plot <STEM>         Plot to STEM.svg and STEM.png, over the forced response if an amplitude
                                of the excitation is given; caption, CSV and JSON beside them, of the
                                forced response STEM-response.csv
          --overwrite           Overwrite existing files
          --json                Print one JSON document
      -h, --help                Print help (see more with '--help')
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
    insta::assert_snapshot!(says(2, "backbone --mode=3"), @"resonarm: --mode is 3: the arm has modes 1 and 2");
    insta::assert_snapshot!(says(2, "backbone --to-rad=0"), @"resonarm: --to-rad is 0: it must be above 0 and at most 3.1416 rad");
    insta::assert_snapshot!(says(2, "backbone --to-rad=NaN"), @r"
    error: invalid value 'NaN' for '--to-rad <RAD>': it must be a finite number

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says(2, "backbone --torque1-nm=0"), @"resonarm: the excitation's amplitude, of --torque1-nm or --force-x-n and --force-y-n, is 0: it must be a finite number other than 0");
    insta::assert_snapshot!(says(2, "backbone --force-x-n=NaN"), @r"
    error: invalid value 'NaN' for '--force-x-n <A>': it must be a finite number

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says(2, "backbone --largest-step=0"), @"resonarm: --largest-step is 0: it must be from 0.000001 to 1");
    insta::assert_snapshot!(says(2, "backbone --preset=none"), @"resonarm: there is no preset `none`: the presets are irb1600-table1, irb1600-fitted");
    insta::assert_snapshot!(says(2, "backbone --to-rad=0.01 --plot=/no/such/folder/stem"), @"resonarm: can't write /no/such/folder/stem.svg: No such file or directory (os error 2); check that the folder exists and that you may write there");
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
    let (table, reason) = partial("backbone --most-points=5");
    insta::assert_snapshot!(table, @r"
    irb1600-fitted, β1 = 0°, β2 = 60°, mode 1 from 22.157526 Hz: in phase quadrature with a torque at joint 1

      frequency Hz   largest |α1| rad   largest |α2| rad            N·m
         22.157526         0.00078754         0.00061679         0.1591
         22.157525         0.00098446         0.00077113         0.1989
         22.157524         0.00123061         0.00096412         0.2486
         22.157523         0.00153832         0.00120548         0.3108
         22.157521         0.00192299         0.00150737         0.3885

    softening: -0.000005 Hz (-0.0000 %) at |α1| = 0.001923 rad; at small amplitudes a of α1, df/d(a²) = -1.68247 Hz/rad²
    ");
    insta::assert_snapshot!(reason, @"resonarm: along the backbone: the branch has more than 5 points and has come to 22.157521 Hz; try to allow more points or larger steps (--most-points, --largest-step); the 5 motions before that are in the results");
    let (document, reason) = partial("backbone --most-harmonics=3 --json");
    insta::assert_snapshot!(reason, @"resonarm: along the backbone: at 22.157517 Hz the motion needs more than 3 harmonics; try to allow more, or less excitation (--most-harmonics); the 5 motions before that are in the results");
    let document: Value = serde_json::from_str(&document).unwrap();
    assert_eq!(document["points"].as_array().unwrap().len(), 5);
    assert_eq!(format!("resonarm: {}", document["ended_early"][0].as_str().unwrap()), reason);
}

/// A branch that ends early has the first motions and bifurcations of the whole one, and its figure is drawn.
#[test]
fn a_branch_that_ends_early_is_kept() {
    let command = "continue --torque1-nm=60 --from-hz=21 --to-hz=23";
    let whole = document(command);
    assert!(whole["ended_early"].is_null());
    let folder = tempfile::tempdir().unwrap();
    let stem = folder.path().join("branch");
    let (early, reason) = partial(&format!("{command} --most-points=50 --json --plot={}", stem.display()));
    insta::assert_snapshot!(reason, @"resonarm: along frequency_hz: the branch has more than 50 points and has come to 22.153542 Hz; try to allow more points or larger steps (--most-points, --largest-step); the 50 motions before that are in the results");
    let early: Value = serde_json::from_str(&early).unwrap();
    assert_eq!(early["points"].as_array().unwrap()[..], whole["points"].as_array().unwrap()[..50]);
    assert_eq!(early["bifurcations"], whole["bifurcations"]);
    assert!(stem.with_extension("png").exists());
    let (summary, _) = partial(&format!("{command} --most-points=10"));
    assert!(summary.starts_with("branch: 10 motions, 0 of them unstable"), "{summary}");
}

/// Curves of folds that end early do not change the branch; each is kept as far as it came.
#[test]
fn curves_that_end_early_leave_the_branch() {
    let command = "continue --torque1-nm=60 --from-hz=21 --to-hz=23 --curves-in=amplitude --curves-to=5";
    let (early, reason) = partial(&format!("{command} --most-points=60 --json"));
    insta::assert_snapshot!(reason, @r"
    resonarm: along frequency_hz: the branch has more than 60 points and has come to 22.244301 Hz; try to allow more points or larger steps (--most-points, --largest-step); the 60 motions before that are in the results
    resonarm: along torque1_nm: the branch has more than 60 points and has come to 24.192237 N·m; try to allow more points or larger steps (--most-points, --largest-step); the 60 motions before that are in the results
    resonarm: along torque1_nm: the branch has more than 60 points and has come to 24.506233 N·m; try to allow more points or larger steps (--most-points, --largest-step); the 60 motions before that are in the results
    ");
    let early: Value = serde_json::from_str(&early).unwrap();
    assert_eq!(early["ended_early"].as_array().unwrap().len(), reason.lines().count());
    assert_eq!(early["curves"].as_array().unwrap().len(), 2);
}

/// `continue` accepts an interval without a resonance, refuses an impossible one, and reports where and why a
/// continuation ended early, and what to try.
#[test]
fn continue_reports_its_failures() {
    assert!(done("continue --torque1-nm=60 --from-hz=3 --to-hz=10").contains("0 of them unstable"));
    let says = |code, arguments: &str| {
        let output = resonarm(&format!("continue {arguments}"));
        assert_eq!(output.status.code(), Some(code), "{arguments}: {}", text(&output.stderr));
        text(&output.stderr)
    };
    insta::assert_snapshot!(says(2, "--torque1-nm=60 --from-hz=22 --to-hz=22"), @"resonarm: along frequency_hz: the interval from 22 to 22 Hz can't be walked: both ends must be numbers, different, and inside the positive frequencies");
    insta::assert_snapshot!(says(2, "--torque1-nm=60 --from-hz=-1 --to-hz=22"), @"resonarm: along frequency_hz: the interval from -1 to 22 Hz can't be walked: both ends must be numbers, different, and inside the positive frequencies");
    insta::assert_snapshot!(says(2, "--torque1-nm=60 --from-hz=22 --to-hz=NaN"), @r"
    error: invalid value 'NaN' for '--to-hz <F>': it must be a finite number

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says(2, "--torque1-nm=60 --from-hz=21"), @"resonarm: --parameter frequency needs its interval: --from-hz a --to-hz b");
    insta::assert_snapshot!(says(2, "--torque1-nm=60 --from-hz=21 --to-hz=22 --to-deg=3"), @"resonarm: --to-deg is not for --parameter frequency: its interval is --from-hz a --to-hz b");
    insta::assert_snapshot!(says(2, "--torque1-nm=60 --from-hz=21 --to-hz=22 --frequency-hz=3"), @"resonarm: --frequency-hz is for runs in another parameter: leave it out");
    insta::assert_snapshot!(says(2, "--from-hz=21 --to-hz=22"), @"resonarm: give the excitation: --torque1-nm A, or --force-x-n A and --force-y-n A");
    insta::assert_snapshot!(says(2, "--parameter=amplitude --torque1-nm=60 --frequency-hz=22 --from-nm=1 --to-nm=2"), @"resonarm: the amplitude is what varies: leave --torque1-nm out");
    insta::assert_snapshot!(says(2, "--parameter=amplitude --from-nm=1 --to-nm=2"), @"resonarm: --frequency-hz is missing: it must be a positive number");
    insta::assert_snapshot!(says(2, "--parameter=wind --torque1-nm=60"), @"resonarm: --parameter is `wind`: it must be one of frequency, amplitude, beta1_deg, beta2_deg, inertia1_kg_m2, inertia2_kg_m2, mass2_kg, length1_m, length2_m, centre2_m, stiffness1_nm_rad, stiffness2_nm_rad, damping1_nm_s_rad, damping2_nm_s_rad");
    insta::assert_snapshot!(says(2, "--parameter=mass2_kg --torque1-nm=60 --frequency-hz=22 --from=36 --to=-1"), @"resonarm: along mass2_kg: the interval from 36 to -1 kg can't be walked: both ends must be numbers, different, and inside the range of the parameter");
    insta::assert_snapshot!(says(1, "--torque1-nm=600000 --from-hz=21 --to-hz=22"), @"resonarm: along frequency_hz: no solution at 21.000000 Hz: Newton's method did not converge; try to start elsewhere, away from a resonance, or with less excitation");
    insta::assert_snapshot!(says(1, "--torque1-nm=60 --from-hz=21 --to-hz=23 --most-harmonics=4"), @"resonarm: along frequency_hz: at 22.062334 Hz the motion needs more than 4 harmonics; try to allow more, or less excitation (--most-harmonics); the 14 motions before that are in the results");
    insta::assert_snapshot!(says(1, "--torque1-nm=60 --from-hz=21 --to-hz=23 --most-points=10"), @"resonarm: along frequency_hz: the branch has more than 10 points and has come to 21.868289 Hz; try to allow more points or larger steps (--most-points, --largest-step); the 10 motions before that are in the results");
}
