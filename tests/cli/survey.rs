//! `survey`: folders of recordings, continued, refused, and identified together.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use insta::assert_snapshot;
use serde_json::Value;

use crate::{complaint, document, names, resonarm};

/// Three modes at three points, with an element that `elements` states.
fn beam(elements: &str) -> String {
    let modes = [(31.0, 0.01, [0.9, 0.4, 0.1]), (58.0, 0.015, [0.7, -0.8, -0.5]), (120.0, 0.02, [0.6, -0.5, 0.9])];
    let mode = |(hz, damping, [tip, mid, low]): &(f64, f64, [f64; 3])| {
        format!(
            "{{ frequency_hz = {hz}, damping_ratio = {damping}, shape = {{ 'tip.x' = {tip}, 'mid.x' = {mid}, 'low.x' = {low} }} }}"
        )
    };
    format!(
        "[structure]\nkind = 'modal'\nmodes = [{}]\n{elements}[excitation]\namplitude = {{ exciter_x = 20.0 }}\n\
         profile = {{ waveform = 'dwell', frequency_hz = 22.0, duration_s = 1.0, settle_s = 0.5 }}\n",
        modes.iter().map(mode).collect::<Vec<_>>().join(", ")
    )
}

fn write_beam(folder: &Path) {
    fs::write(folder.join("beam.toml"), beam("")).unwrap();
}

fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all: Vec<(String, Vec<u8>)> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read(&path).unwrap()))
        .collect();
    all.sort();
    all
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Two places of the exciter and two groups of accelerometers make one set of modes, with the shapes of the scenario. The same
/// command makes the same bytes; one that finds everything there changes nothing.
#[test]
fn a_survey_is_identified_as_a_whole() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_beam(folder);
    let survey =
        ["survey", "beam.toml", "--exciters", "tip,mid.x", "--sensors", "low.x", "--sensors", "mid.x", "--seed", "3"];
    let index = document(folder, 0, &[&survey[..], &["--out", "first", "--json"]].concat());
    assert_eq!(names(&index), ["build", "format", "plan", "runs"]);
    assert_eq!(index["plan"]["modes"], serde_json::json!([1, 2, 3]));
    assert_eq!(index["runs"].as_array().unwrap().len(), 4);
    assert_eq!(index, serde_json::from_slice::<Value>(&fs::read(folder.join("first/index.json")).unwrap()).unwrap());
    let found = document(folder, 0, &["identify", "first", "--json"]);
    assert_eq!(found["from_hz"], index["plan"]["from_hz"]);
    assert_eq!(found["survey"], index);
    let truth = [[0.9, 0.4, 0.1], [0.7, -0.8, -0.5], [0.6, -0.5, 0.9]];
    let at: Vec<&str> = found["at"].as_array().unwrap().iter().map(|at| at.as_str().unwrap()).collect();
    let modes = found["modes"].as_array().unwrap();
    assert_eq!(modes.len(), 3, "{modes:#?}");
    for (mode, truth) in modes.iter().zip(truth) {
        // A shape is known up to its sign: here the tip moves forward.
        let sign = number(&mode["shape_per_sqrt_kg"][at.iter().position(|at| *at == "tip.x").unwrap()]).signum();
        for (name, truth) in ["tip.x", "mid.x", "low.x"].iter().zip(truth) {
            let part = number(&mode["shape_per_sqrt_kg"][at.iter().position(|at| at == name).unwrap()]);
            assert!((sign * part - truth).abs() < 2e-3, "{name} {mode:#}");
        }
    }
    // The same bytes, and once more nothing new.
    let again = resonarm(folder, &[&survey[..], &["--out", "second"]].concat());
    assert_eq!(again.code, 0, "{}", again.stderr);
    assert_eq!(files(&folder.join("first")), files(&folder.join("second")));
    let kept = resonarm(folder, &[&survey[..], &["--out", "second"]].concat());
    assert!(kept.stderr.contains("second: 4 of 4 recordings are there already, and are kept"), "{}", kept.stderr);
    assert_eq!(files(&folder.join("first")), files(&folder.join("second")));
    assert_snapshot!(again.stdout, @r"
    random, peak 20 N at level 1, 15.50 to 156.00 Hz, 26 s a run, seed 3
    modes 1, 2, 3 in the band; the least half-power bandwidth, 6.200e-1 Hz, has 16.1 lines

      file           level   peak force (N)   exciter          accelerometers   length (s)   state
      run-01.mcap        1               20   tip.x                         2       26.000   done
      run-02.mcap        1               20   tip.x                         2       26.000   done
      run-03.mcap        1               20   mid.x                         3       26.000   done
      run-04.mcap        1               20   mid.x                         1       26.000   done
    written to second/index.json
    ");
}

/// A survey whose process is killed during its third run is continued, with the same bytes in the end.
#[test]
#[allow(clippy::disallowed_methods, reason = "it waits for another process")]
fn a_killed_survey_is_continued() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_beam(folder);
    let survey = ["survey", "beam.toml", "--exciters", "tip.x,mid.x,low.x", "--levels", "1,2", "--duration-s", "20"];
    let whole = resonarm(folder, &[&survey[..], &["--out", "whole"]].concat());
    assert_eq!(whole.code, 0, "{}", whole.stderr);
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    command.args(survey).args(["--out", "killed"]).current_dir(folder).env_remove("RESONARM_LOG");
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let killed = folder.join("killed");
    let states = || -> Vec<String> {
        let text = fs::read(killed.join("index.json")).unwrap_or_default();
        let index: Value = serde_json::from_slice(&text).unwrap_or_default();
        let runs = index["runs"].as_array().cloned().unwrap_or_default();
        runs.iter().map(|run| run["state"].as_str().unwrap().to_owned()).collect()
    };
    while !states().iter().any(|state| state == "done") {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was killed");
        // Far shorter than a run, so that several of them are left when it is killed.
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let left = states();
    assert!(left.iter().any(|state| state == "planned"), "{left:?}");
    // What was recorded by then can be identified, with exit code 1, since it is not all.
    let part = resonarm(folder, &["identify", "killed"]);
    assert_eq!(part.code, 1, "{}", part.stderr);
    assert!(part.stderr.contains("runs of the survey have no complete recording, and are left out"), "{}", part.stderr);
    let again = resonarm(folder, &[&survey[..], &["--out", "killed"]].concat());
    assert_eq!(again.code, 0, "{}", again.stderr);
    assert!(again.stderr.contains("recordings are there already, and are kept"), "{}", again.stderr);
    assert_eq!(files(&folder.join("whole")), files(&killed));
}

/// Another plan never replaces recordings unless that is allowed; neither do recordings that are not a survey's.
#[test]
fn other_recordings_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_beam(folder);
    let short = ["survey", "beam.toml", "--duration-s", "1", "--sensors", "mid.x", "--out", "survey"];
    assert_eq!(resonarm(folder, &short).code, 0);
    let before = files(&folder.join("survey"));
    let refused = |flags: &[&str]| complaint(folder, 2, &[&short[..], flags].concat());
    assert_snapshot!(refused(&["--seed", "1"]), @"resonarm: survey/index.json holds another survey: there plan.seed is 0, here 1; repeat the command that began it to continue it, choose another folder, or allow overwriting it (--overwrite)");
    assert_snapshot!(refused(&["--force-n", "3"]), @"resonarm: survey/index.json holds another survey: there plan.force_n is 20.0, here 3.0; repeat the command that began it to continue it, choose another folder, or allow overwriting it (--overwrite)");
    fs::write(folder.join("beam.toml"), beam("").replace("0.015", "0.025")).unwrap();
    assert_snapshot!(refused(&[]), @r#"resonarm: survey/index.json holds another survey: there plan.scenario.structure.modes is [{"damping_ratio":0.01,"frequency_hz":31.0,"shape":{"low.x":0.1,"mid.x":0.4,"tip.x":0.9}},{"damping_ratio":0.015,"frequency_hz":58.0,"shape":{"low.x":-0.5,"mid.x":-0.8,"tip.x":0.7}},{"damping_ratio":0.02,"frequency_hz":120.0,"shape":{"low.x":0.9,"mid.x":-0.5,"tip.x":0.6}}], here [{"damping_ratio":0.01,"frequency_hz":31.0,"shape":{"low.x":0.1,"mid.x":0.4,"tip.x":0.9}},{"damping_ratio":0.025,"frequency_hz":58.0,"shape":{"low.x":-0.5,"mid.x":-0.8,"tip.x":0.7}},{"damping_ratio":0.02,"frequency_hz":120.0,"shape":{"low.x":0.9,"mid.x":-0.5,"tip.x":0.6}}]; repeat the command that began it to continue it, choose another folder, or allow overwriting it (--overwrite)"#);
    assert_eq!(files(&folder.join("survey")), before);
    assert_eq!(resonarm(folder, &[&short[..], &["--overwrite"]].concat()).code, 0);
    assert_ne!(files(&folder.join("survey")), before);
    fs::remove_file(folder.join("survey/index.json")).unwrap();
    assert_snapshot!(refused(&[]), @"resonarm: survey/run-01.mcap already exists: choose another folder, or allow overwriting it (--overwrite)");
    fs::write(folder.join("survey/index.json"), "{}").unwrap();
    assert_snapshot!(refused(&[]), @"resonarm: survey/index.json is not the index of a survey: missing field `format` at line 1 column 2");
    assert_snapshot!(complaint(folder, 2, &["identify", "survey"]), @"resonarm: survey/index.json is not the index of a survey: missing field `format` at line 1 column 2");
    // Nothing of a plan that can't be is written.
    assert_snapshot!(complaint(folder, 2, &["survey", "beam.toml", "--exciters", "top.x", "--out", "none"]), @"resonarm: --exciters top.x: the structure has no such point or degree of freedom; there are low.x, mid.x, tip.x");
    assert!(!folder.join("none").exists());
    assert_snapshot!(complaint(folder, 2, &["survey", "beam.toml", "--sensors", "tip.x,", "--out", "none"]), @r"
    error: invalid value 'tip.x,' for '--sensors <DOF>': it must be points or degrees of freedom with commas between them, as tip.x,mid

    For more information, try '--help'.
    ");
}

/// A run that fails is in the index with its reason; the others are done. Its limit is of the acceleration.
#[test]
fn a_failed_run_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("beam.toml"), beam("[limits]\nacceleration_m_s2 = 40.0\n")).unwrap();
    // 40 times the force is beyond the limit, and the force itself is far below.
    let survey = ["survey", "beam.toml", "--duration-s", "2", "--levels", "1,40", "--force-n", "1", "--out", "survey"];
    let said = resonarm(folder, &survey);
    assert_eq!(said.code, 1, "{}{}", said.stdout, said.stderr);
    let index: Value = serde_json::from_slice(&fs::read(folder.join("survey/index.json")).unwrap()).unwrap();
    let states: Vec<&Value> = index["runs"].as_array().unwrap().iter().map(|run| &run["state"]).collect();
    assert_eq!(states, ["done", "failed"], "{index:#}");
    let reason = index["runs"][1]["reason"].as_str().unwrap();
    assert!(said.stderr.contains(&format!("run-02.mcap failed: {reason}")), "{}", said.stderr);
    assert!(reason.contains("acceleration"), "{reason}");
    // A failed run is tried again.
    assert_eq!(resonarm(folder, &survey).code, 1);
}

/// The runs of another level tell whether the structure is linear.
#[test]
fn levels_of_a_survey_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let spring = "[[structure.elements]]\nkind = 'cubic'\nat = 'tip.x'\nstiffness3_n_m3 = 1e8\n";
    for (name, elements, is_linear) in [("linear", "", true), ("spring", spring, false)] {
        fs::write(folder.join(format!("{name}.toml")), beam(elements)).unwrap();
        let scenario = format!("{name}.toml");
        // Of two noises, so that the verdict is not due to one of them.
        for seed in ["1", "2"] {
            let out = format!("{name}-{seed}");
            let levels = [
                "--levels",
                "1,4",
                "--force-n",
                "5",
                "--highest-mode",
                "2",
                "--duration-s",
                "10",
                "--seed",
                seed,
                "--out",
                &out,
            ];
            assert_eq!(resonarm(folder, &[&["survey", &scenario], &levels[..]].concat()).code, 0);
            let found = document(folder, 0, &["identify", &out, "--json"]);
            let [levels] = &found["levels"].as_array().unwrap()[..] else { panic!("{found:#}") };
            assert_eq!((number(&levels["level"]), &levels["linear"]), (4.0, &is_linear.into()), "{levels:#}");
            // The runs of the document are those that were fitted: those of the first level.
            assert_eq!(found["runs"].as_array().unwrap().len(), 1);
        }
    }
}

/// Recordings that exist are listed where they are, and identified together.
#[test]
fn recordings_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (seed, force_n) in [(1, 5), (2, 20)] {
        let excitation = format!(
            "amplitude = {{ exciter_x = {force_n} }}\nprofile = {{ waveform = 'random', from_hz = 5, to_hz = 200, duration_s = 10, seed = {seed} }}\n"
        );
        let text = beam("");
        let text = text.split("[excitation]\n").next().unwrap().to_owned() + "[excitation]\n" + &excitation;
        fs::write(folder.join("run.toml"), text).unwrap();
        let recording = format!("r{seed}.mcap");
        let run = ["run", "--mode", "free", "--scenario", "run.toml", "--record", &recording];
        assert_eq!(resonarm(folder, &run).code, 0);
    }
    let list = ["survey", "--from", "r1.mcap,r2.mcap", "--levels", "1,4", "--out", "."];
    let index = document(folder, 0, &[&list[..], &["--json"]].concat());
    assert_eq!(index["runs"][1]["file"], "r2.mcap");
    assert_eq!((number(&index["runs"][1]["level"]), number(&index["runs"][1]["force_n"])), (4.0, 20.0));
    assert_eq!(index["runs"][0]["exciter"], serde_json::json!(["tip.x"]));
    let found = document(folder, 0, &["identify", ".", "--json"]);
    assert_eq!((found["modes"].as_array().unwrap().len(), &found["levels"][0]["linear"]), (3, &true.into()));
    assert_snapshot!(complaint(folder, 2, &list), @"resonarm: ./index.json already exists: choose another place, or allow overwriting it (--overwrite)");
    let refused = |flags: &[&str]| {
        complaint(folder, 2, &[&["survey", "--from", "r1.mcap,r2.mcap", "--out", "new"], flags].concat())
    };
    assert_snapshot!(refused(&["--levels", "1"]), @"resonarm: the number of --levels is 1: it must be left out, or one level for each of the 2 recordings");
    assert!(refused(&["--duration-s", "1"]).contains("cannot be used with"));
    assert_snapshot!(complaint(folder, 2, &["identify", ".", "--other-level", "r2.mcap"]), @"resonarm: --other-level is for recordings: a survey has its other levels itself; leave it out");
    // Elsewhere the index has full paths.
    let index = document(folder, 0, &["survey", "--from", "r1.mcap", "--out", "new", "--json"]);
    assert_eq!(index["runs"][0]["file"], folder.join("r1.mcap").canonicalize().unwrap().to_str().unwrap());
    assert_eq!(document(folder, 0, &["identify", "new", "--json"])["modes"].as_array().unwrap().len(), 3);
}

/// The labelled files hold the truth, and responses that other programs, and `identify` itself, can use.
#[test]
fn labelled_files_are_scored_on_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_beam(folder);
    let survey = ["survey", "beam.toml", "--exciters", "mid.x", "--labelled", "--out", "data"];
    let said = resonarm(folder, &survey);
    assert_eq!(said.code, 0, "{}", said.stderr);
    let listed = "written to data/index.json, data/run-01.uff, data/run-01-samples.csv, data/labelled.json\n";
    assert!(said.stdout.ends_with(listed), "{}", said.stdout);
    let truth: Value = serde_json::from_slice(&fs::read(folder.join("data/labelled.json")).unwrap()).unwrap();
    assert_eq!(names(&truth), ["in_band", "modes", "nodes", "runs"]);
    assert_eq!(truth["nodes"], serde_json::json!({ "low": 1, "mid": 2, "tip": 3 }));
    let second = &truth["modes"][1];
    assert!((number(&second["pole_frequency_hz"]) - 58.0).abs() < 1e-9, "{second:#}");
    assert!((number(&second["shape_per_sqrt_kg"]["mid.x"]) + 0.8).abs() < 1e-12, "{second:#}");
    // 1/0.8² kg where the force acts.
    assert!((number(&second["modal_mass_kg"]["mid.x"]) - 1.5625).abs() < 1e-12, "{second:#}");
    let run = &truth["runs"][0];
    let header = fs::read_to_string(folder.join("data/run-01-samples.csv")).unwrap();
    let header: Vec<&str> = header.lines().next().unwrap().split(',').collect();
    let mut at = Vec::new();
    for channel in run["channels"].as_array().unwrap() {
        assert!(header.contains(&channel["column"].as_str().unwrap()), "{channel} {header:?}");
        at.push(channel["at"].as_str().unwrap());
    }
    assert_eq!(at, ["mid.x", "low.x", "mid.x", "tip.x"]);
    // The default head: 0.01 N, and 0.02 N a count.
    let expected = libm::sqrt(0.01 * 0.01 + 0.02 * 0.02 / 12.0);
    assert!((number(&run["channels"][0]["noise"]) - expected).abs() < 1e-15);
    let found = document(folder, 0, &["identify", "data/run-01.uff", "--json"]);
    // Averaged responses have leakage, which may look like another mode beside a true one.
    let modes = found["modes"].as_array().unwrap();
    for truth in truth["modes"].as_array().unwrap() {
        let off = |mode: &Value| number(&mode["pole_frequency_hz"]) / number(&truth["pole_frequency_hz"]) - 1.0;
        assert!(modes.iter().any(|mode| off(mode).abs() < 2e-3), "{truth:#} {modes:#?}");
    }
}

/// A free plate with 20 accelerometers and three places of the exciter: its shapes are those of the scenario, and its rigid modes
/// stay out of the band.
#[test]
fn a_free_plate_has_its_shapes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/structures/free-plate.toml");
    let plan = ["--exciters", "p1.z,p7.z,p10.z", "--highest-mode", "7", "--duration-s", "6", "--out", "plate"];
    let index = document(folder, 0, &[&["survey", scenario], &plan[..], &["--json"]].concat());
    // A free plate has three rigid modes that move its points along z: up and down, and two tilts.
    assert_eq!(index["plan"]["modes"], serde_json::json!([4, 5, 6, 7]));
    for run in index["runs"].as_array().unwrap() {
        assert_eq!(run["sensors"].as_array().unwrap().len(), 20, "{run:#}");
    }
    let found = document(folder, 0, &["identify", "plate", "--mac", "computed", "--report", "plate.html", "--json"]);
    let values = found["mac"]["values"].as_array().unwrap();
    assert_eq!((values.len(), found["mac"]["at"].as_array().unwrap().len()), (4, 20));
    for (row, of_row) in values.iter().enumerate() {
        for (column, value) in of_row.as_array().unwrap().iter().map(number).enumerate() {
            // Twenty points tell these modes apart: each is like itself, and nearly orthogonal to the others.
            assert!(if row == column { value > 0.999 } else { value < 0.1 }, "{row}, {column}: {value}");
        }
    }
    let page = fs::read_to_string(folder.join("plate.html")).unwrap();
    assert!(page.contains("Rigid modes are below the band, and left out: 1, 2, 3."), "{}", &page[..3000]);
    assert!(page.contains("<h2>Against computed modes</h2>"));
    // The column of remarks is left out where there are none.
    let has_remarks = |mode: &Value| ["doubts", "warnings"].iter().any(|of| !mode[*of].as_array().unwrap().is_empty());
    let has_remarks = found["modes"].as_array().unwrap().iter().any(has_remarks);
    assert_eq!(page.contains("<th scope=\"col\" class=\"name\">remarks</th>"), has_remarks);
    assert_eq!(page.contains("<td class=\"text"), has_remarks);
}

/// The report is one file that loads nothing.
#[test]
fn a_report_is_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_beam(folder);
    let survey = ["survey", "beam.toml", "--levels", "1,2", "--out", "data"];
    assert_eq!(resonarm(folder, &survey).code, 0);
    let report = ["identify", "data", "--report", "report.html"];
    let said = resonarm(folder, &report);
    assert!(said.code == 0 && said.stdout.ends_with("written to report.html\n"), "{}{}", said.stdout, said.stderr);
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>\n<html lang=\"en\">\n"), "{}", &page[..100]);
    assert!(page.contains("default-src 'none'; style-src 'sha256-"), "{}", &page[..600]);
    for word in ["<script", " style=", " src=", "url(", "@import", "href="] {
        assert!(!page.contains(word), "{word}");
    }
    for heading in [
        "Modes",
        "Against level 2",
        "Shapes",
        "Modal assurance criterion",
        "Poles over the order",
        "Noise",
        "Recordings",
    ] {
        assert!(page.contains(&format!("<h2>{heading}</h2>")), "{heading}");
    }
    // Responses and poles; without --mac there is no third figure.
    assert_eq!(page.matches("<svg ").count(), 2);
    assert!(page.contains("Linear: no mode shifts"));
    let index: Value = serde_json::from_slice(&fs::read(folder.join("data/index.json")).unwrap()).unwrap();
    for run in index["runs"].as_array().unwrap() {
        for key in ["seed", "excitation_seed"] {
            assert!(page.contains(&format!("<td>{}</td>", run[key])), "{run:#}");
        }
    }
    // The same input produces the same file.
    let again = ["identify", "data", "--report", "again.html"];
    assert_eq!(resonarm(folder, &again).code, 0);
    assert_eq!(page, fs::read_to_string(folder.join("again.html")).unwrap());
    // A report over a recording of the survey was written once.
    for input in ["data/run-01.mcap", "data/index.json"] {
        let over = ["identify", "data", "--report", input, "--overwrite"];
        assert!(complaint(folder, 2, &over).contains("can't be written over itself"), "{input}");
    }
    assert_snapshot!(complaint(folder, 2, &report), @"resonarm: report.html already exists: choose another place, or allow overwriting it (--overwrite)");
}
