//! `resonarm sweep` and `resonarm poincare` as processes: stopped by Ctrl-C and resumed, and their messages on bad
//! input.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};

const SWEEP: [&str; 10] = [
    "sweep",
    "--angles-deg=0,60",
    "--drive=joint1=60",
    "--from-hz=22.05",
    "--to-hz=22.15",
    "--points=25",
    "--direction=both",
    "--time-constants=40",
    "--initial=0,0,0,0",
    "--preset=irb1600-fitted",
];

fn resonarm(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn into(folder: &Path, arguments: &[&str]) -> Command {
    std::fs::create_dir_all(folder).unwrap();
    let mut command = resonarm(arguments);
    command.arg("--plot").arg(folder.join("sweep"));
    command
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn lines(path: &Path) -> usize {
    std::fs::read_to_string(path).map_or(0, |text| text.lines().count())
}

/// Checks every hundredth of a second, for a minute at most: the awaited work takes a fraction of a second of processor
/// time.
#[allow(clippy::disallowed_methods, reason = "it waits for another process")]
fn wait_until(what: &str, reached: impl Fn() -> bool) {
    let waited = (0..6000).any(|_| {
        let now = reached();
        if !now {
            std::thread::sleep(Duration::from_millis(10));
        }
        now
    });
    assert!(waited, "waited a minute for {what}");
}

/// Ctrl-C in the middle: the same command resumes, and ends with the files of an uninterrupted run, byte for byte.
#[test]
fn a_stopped_sweep_resumes_to_the_same_result() {
    let folder = tempfile::tempdir().unwrap();
    let (stopped, whole) = (folder.path().join("stopped"), folder.path().join("whole"));
    let partial = stopped.join("sweep.partial.jsonl");

    let first = into(&stopped, &SWEEP).spawn().unwrap();
    // The remaining 40 points take seconds of processor time, so some are left even if this process is delayed now.
    wait_until("ten points", || lines(&partial) > 10);
    kill_process(Pid::from_child(&first), Signal::INT).unwrap();
    let output = first.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", errors(&output));
    // The first line of a journal has the inputs.
    let kept = lines(&partial) - 1;
    assert!(
        errors(&output).contains(&format!("stopped after {kept} of 50 points; the same command resumes from there"))
    );
    assert!(kept < 50 && !stopped.join("sweep.csv").exists());

    // Points of another pose would be taken for those of this one.
    let other = into(&stopped, &[&SWEEP[..1], &["--angles-deg=0,90"], &SWEEP[2..]].concat()).output().unwrap();
    assert_eq!(other.status.code(), Some(2));
    let had = "sweep.partial.jsonl was started with configuration.structure.angles_deg = [0.0,60.0], but this command has [0.0,90.0]";
    assert!(errors(&other).contains(had), "{}", errors(&other));

    let resumed = into(&stopped, &SWEEP).output().unwrap();
    assert!(resumed.status.success() && !partial.exists(), "{}", errors(&resumed));
    assert!(errors(&resumed).contains(&format!("resuming after {kept} of 50 points")), "{}", errors(&resumed));
    assert!(into(&whole, &SWEEP).output().unwrap().status.success());
    for file in ["sweep.csv", "sweep.json", "sweep.svg", "sweep.png", "sweep.txt"] {
        let [a, b] = [&stopped, &whole].map(|folder| std::fs::read(folder.join(file)).unwrap());
        assert!(a == b && !a.is_empty(), "{file}");
    }
}

/// The sections of a diagram, as JSON: stepped up, the period doubles, and each section has as many points as periods.
#[test]
fn a_diagram_is_one_json_document() {
    let arguments = [
        "poincare",
        "--angles-deg=0,75",
        "--parameter=amplitude",
        "--drive=joint1",
        "--frequency-hz=46.3",
        "--from=200",
        "--to=300",
        "--points=3",
        "--direction=up",
        "--json",
    ];
    let output = resonarm(&arguments).output().unwrap();
    assert!(output.status.success(), "{}", errors(&output));
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let responses = document["motions"].as_array().unwrap();
    let of = |key: &str| responses.iter().map(|response| response[key].as_f64().unwrap()).collect::<Vec<_>>();
    assert_eq!((of("value"), of("period")), (vec![200.0, 250.0, 300.0], vec![1.0, 2.0, 2.0]));
    for response in responses {
        assert_eq!(response["section"].as_array().unwrap().len() as f64, response["period"].as_f64().unwrap());
        assert_eq!(response["direction"], "up");
    }
}

#[test]
fn bad_input_has_exit_code_2() {
    let says = |arguments: &str| {
        let arguments: Vec<&str> = arguments.split(' ').collect();
        let output = resonarm(&arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", errors(&output));
        errors(&output).trim_end().to_string()
    };
    let sweep = |arguments: &str| says(&format!("sweep --from-hz=21 --to-hz=23 {arguments}"));
    insta::assert_snapshot!(sweep("--drive=joint1=60 --points=5 --over=link2.angle_deg=60,90,60"), @r"
    error: invalid value 'link2.angle_deg=60,90,60' for '--over <NAME=X,…>': 60 is given twice: give each value once

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(sweep("--points=5"), @"resonarm: the excitation is missing: give it by --drive DOF=A, with DOF one of joint2.x, joint2.y, tip.x, tip.y, joint1, joint2");
    insta::assert_snapshot!(sweep("--drive=joint1=0"), @r"
    error: invalid value 'joint1=0' for '--drive <DOF=A>': the amplitude must be a number other than 0

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(sweep("--drive=joint1=60 --points=1"), @"resonarm: the number of points of the sweep is 1: it must be from 2, one at each end, to 1000000");
    insta::assert_snapshot!(says("sweep --drive=joint1=60 --from-hz=23 --to-hz=23"), @"resonarm: the sweep goes from 23 to 23: its ends must be two different numbers");
    insta::assert_snapshot!(says("sweep --drive=joint1=60 --from-hz=-1 --to-hz=21"), @"resonarm: excitation frequency -1 Hz: it must be a positive number");
    insta::assert_snapshot!(sweep("--drive=joint1=60 --time-constants=-1"), @"resonarm: time_constants is -1: it must be a positive number");
    insta::assert_snapshot!(sweep("--drive=joint1=60 --initial=0,1"), @"resonarm: --initial has 2 numbers, expected 4: alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s");
    insta::assert_snapshot!(sweep("--drive=joint1=60 --initial=0,1,NaN,0"), @r"
    error: invalid value 'NaN' for '--initial <Q,V>': it must be a finite number

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says("poincare --drive=joint1=60"), @"resonarm: the frequency of the excitation is missing: give --frequency-hz F");
    insta::assert_snapshot!(says("poincare --parameter=amplitude --frequency-hz=22 --drive=joint1=60 --from=1 --to=2"), @"resonarm: the amplitude is the quantity that varies: give --drive joint1 without one");
    insta::assert_snapshot!(says("poincare --parameter=amplitude --drive=joint1 --frequency-hz=22 --from-hz=1 --to-hz=2"), @"resonarm: --from-hz is not for --parameter amplitude; give its interval by --from a --to b");
    insta::assert_snapshot!(sweep("--drive=joint1=60 --points=4000000000"), @"resonarm: the number of points of the sweep is 4000000000: it must be from 2, one at each end, to 1000000");
    insta::assert_snapshot!(says("sweep --drive=joint1=60 --from-hz=NaN --to-hz=21"), @r"
    error: invalid value 'NaN' for '--from-hz <F>': it must be a finite number

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says("sweep --drive=joint1=60 --from-hz=1e-6 --to-hz=21 --direction=down"), @"resonarm: at an excitation frequency of 1e-6 Hz, a period would take 9.2e8 steps, more than 1000000; choose at least 9.21e-4 Hz, where the response is quasi-static");
    insta::assert_snapshot!(says("poincare --drive=joint1=60 --frequency-hz=22 --to-hz=23"), @"resonarm: --to-hz is not for a section without --parameter");
    insta::assert_snapshot!(says("poincare --drive=joint1=60 --frequency-hz=22 --points=3"), @r"
    error: the following required arguments were not provided:
      --parameter <NAME>

    Usage: resonarm poincare --parameter <NAME> --drive <DOF=A> --frequency-hz <F> --points <N>

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says("poincare --drive=joint1=60 --frequency-hz=22 --section-points=0"), @r"
    error: invalid value '0' for '--section-points <N>': it must be an integer from 1 to 1000000

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(says("poincare --parameter=amplitude --drive=joint1 --frequency-hz=22 --from=2 --to=2"), @"resonarm: the sweep goes from 2 to 2: its ends must be two different numbers");
    insta::assert_snapshot!(says("poincare --parameter=frequency --frequency-hz=22 --drive=joint1=60"), @"resonarm: --parameter frequency needs an interval: give it by --from-hz a --to-hz b");
}

/// More load than the arm can bear is not bad usage: it is found during the computation.
#[test]
fn a_response_that_can_not_be_followed_has_exit_code_1() {
    let output = resonarm(&["sweep", "--drive=joint1=1e9", "--from-hz=21", "--to-hz=23"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let says = errors(&output);
    insta::assert_snapshot!(says.lines().last().unwrap_or_default(), @"resonarm: excited at 21 Hz: the response grows without bound, 3.25e-3 s after phase 0; lower the excitation");
}

/// A range without a resonance is accepted.
#[test]
fn a_range_without_a_resonance_is_swept() {
    let output = resonarm(&["sweep", "--drive=joint1=60", "--from-hz=5", "--to-hz=10", "--points=6"]).output().unwrap();
    assert!(output.status.success(), "{}", errors(&output));
    insta::assert_snapshot!(String::from_utf8_lossy(&output.stdout), @r"
    irb1600-fitted at 0°, 60°, stepped up: 6 responses
      largest joint1  1.329212e-4 rad at 10.000000 Hz
    irb1600-fitted at 0°, 60°, stepped down: 6 responses
      largest joint1  1.329212e-4 rad at 10.000000 Hz
      up and down agree
    ");
}

fn json(arguments: &[&str]) -> serde_json::Value {
    let output = resonarm(arguments).arg("--json").output().unwrap();
    assert!(output.status.success(), "{}", errors(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn largest(points: &serde_json::Value, of: impl Fn(&serde_json::Value) -> &serde_json::Value) -> f64 {
    points.as_array().unwrap().iter().map(|point| of(point).as_f64().unwrap()).fold(0.0, f64::max)
}

/// The help's own example: the sweep reaches the branch's peak, up to the jump.
#[test]
fn a_sweep_sees_the_resonance() {
    let band = ["--from-hz=21", "--to-hz=28"];
    let branch = json(&[&["continue", "--drive=tip.x=20", "--at=joint1"], &band[..]].concat());
    let sweep = ["sweep", "--drive=tip.x=20", "--at=joint1", "--over=link2.angle_deg=60", "--direction=down"];
    let sweep = json(&[&sweep[..], &band].concat());
    let continued = largest(&branch["points"], |point| &point["readings"]["joint1"]["largest"]);
    let swept = largest(&sweep["sweeps"][0]["points"], |point| &point["readings"]["joint1"]["largest"]);
    assert!((continued - 0.0905).abs() < 1e-4 && (swept / continued - 1.0).abs() < 0.01, "{continued} {swept}");
    assert_eq!(sweep["sweeps"][0]["stepped_over"], serde_json::json!([]));
}

/// With --points the sweep reports that it stepped over the resonance.
#[test]
fn a_sweep_reports_what_it_stepped_over() {
    let arguments = ["sweep", "--drive=tip.x=20", "--from-hz=21", "--to-hz=28", "--points=11", "--direction=up"];
    let output = resonarm(&arguments).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("stepped over: the resonance of tip.x at 22.14"), "{text}");
    let document = json(&arguments);
    let stepped_over = document["sweeps"][0]["stepped_over"].as_array().unwrap();
    assert!(stepped_over.iter().any(|found| found["at"] == "tip.x" && found["width_hz"].as_f64().unwrap() < 0.1));
}

/// Swapping the ends gives the same sweep.
#[test]
fn a_sweep_accepts_its_ends_in_either_order() {
    let sweep = |from, to| json(&["sweep", "--drive=joint1=1", from, to, "--points=3"])["sweeps"].clone();
    assert_eq!(sweep("--from-hz=24", "--to-hz=20"), sweep("--from-hz=20", "--to-hz=24"));
}

/// Every command that writes keeps existing results unless they may be overwritten.
#[test]
fn results_are_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    // Of each command one of the files that it would write is there already.
    let commands: [(&str, &[&str]); 6] = [
        ("sweep.csv", &["sweep", "--drive=joint1=1", "--from-hz=20", "--to-hz=24", "--points=2", "--plot=sweep"]),
        ("poincare.json", &["poincare", "--drive=joint1=1", "--frequency-hz=20", "--plot=poincare"]),
        ("a.svg", &["continue", "--drive=joint1=1", "--from-hz=20", "--to-hz=21", "--plot=a"]),
        ("b-response.csv", &["backbone", "--drive=joint1=1", "--plot=b"]),
        ("c.png", &["frf", "--plot=c"]),
        ("d.svg", &["modes", "--over=link2.angle_deg", "--from=0", "--to=9", "--plot=d"]),
    ];
    for (file, command) in commands {
        let path = folder.path().join(file);
        std::fs::write(&path, "mine").unwrap();
        let refused = resonarm(command).current_dir(folder.path()).output().unwrap();
        assert_eq!(refused.status.code(), Some(2), "{file}");
        let says = errors(&refused);
        assert!(
            says.ends_with("already exists: choose another place, or allow overwriting it (--overwrite)\n"),
            "{says}"
        );
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
        let allowed = resonarm(command).arg("--overwrite").current_dir(folder.path()).output().unwrap();
        assert!(allowed.status.success(), "{file}: {}", errors(&allowed));
        // The refusal was due to the flag that was missing, and to nothing else.
        assert_ne!(std::fs::read(&path).unwrap(), b"mine");
    }
}

/// A motion that grows beyond all bounds gives a negative verdict with a message in every command where it can occur.
#[test]
fn a_numerical_blow_up_is_exit_code_1_everywhere() {
    for command in [
        &["simulate", "--drive=joint1=1e12", "--frequency-hz=22", "--duration-s=1"][..],
        &["simulate", "--scheme=rk4", "--initial=1e200,0,0,0", "--duration-s=1"],
        &["sweep", "--drive=joint1=1e12", "--from-hz=21", "--to-hz=23", "--points=2"],
        &["poincare", "--drive=joint1=1e12", "--frequency-hz=22"],
        &["continue", "--drive=joint1=1e12", "--from-hz=21", "--to-hz=23"],
        // Nearly half a turn of the joint.
        &["backbone", "--drive=joint1=1e12", "--to=3.1"],
    ] {
        let output = resonarm(command).output().unwrap();
        let says = errors(&output);
        assert_eq!(output.status.code(), Some(1), "{command:?}: {says}");
        let why = ["lower the excitation", "too large for the structure"];
        assert!(why.iter().any(|words| says.contains(words)), "{says}");
    }
}
