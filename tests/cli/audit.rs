//! `audit`: a player without control, which knows nothing of what it shakes, on a structure that needs no control.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{complaint, document, resonarm};

/// Far above its only mode the structure is a mass of 1 kg: a force of 3 N is an acceleration of 3 m/s².
const PLANT: &str = "[structure]
kind = 'modal'
modes = [{ frequency_hz = 1.0, damping_ratio = 0.05, shape = { 'tip.x' = 1.0, 'mid.x' = 1.0 } }]
[rig.exciter]
at = 'tip.x'
[rig.sensors.b]
at = 'mid'
[rig.sensors.c]
at = 'tip'
";

const PLAYER: &str = "[excitation]
amplitude = { exciter_x = 3.0 }
profile = { waveform = 'swept-sine', law = 'logarithmic', from_hz = 15, to_hz = 60, duration_s = 30 }
";

const SPECIFICATION: &str = "[spec]
kind = 'sine'
sources = ['own']
[sine]
from_hz = 15
rate_oct_min = 4
segments = [{ to_hz = 60, acceleration_m_s2 = 3 }]
tolerance = 0.1
rate_tolerance = 0.1
";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("plant.toml", PLANT), ("player.toml", PLAYER), ("sine.toml", SPECIFICATION)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

const AUDIT: [&str; 7] =
    ["audit", "--scenario", "plant.toml", "--specification", "sine.toml", "--controller", "player.toml"];

fn verdicts(document: &Value) -> BTreeMap<&str, &str> {
    let cases = document["cases"].as_array().unwrap().iter();
    cases.map(|case| (case["case"].as_str().unwrap(), case["verdict"].as_str().unwrap())).collect()
}

/// The sweep itself is good. The player notices neither a lost signal nor one of three times the level, nor a dead channel.
#[test]
fn a_player_passes_the_cases_about_its_sweep_and_fails_those_about_its_readings() {
    let folder = folder();
    let folder = folder.path();
    let found =
        document(folder, 1, &[&AUDIT[..], &["--json", "--junit", "audit.xml", "--report", "audit.html"]].concat());
    let expected = [
        ("S01", "passed"),
        ("S02", "passed"),
        ("S03", "passed"),
        ("S04", "passed"),
        ("S05", "passed"),
        ("S06", "passed"),
        ("S07", "passed"),
        ("S08", "failed"),
        ("S09", "failed"),
        ("S10", "skipped"),
        ("S11", "failed"),
        ("S12", "failed"),
        ("S13", "skipped"),
        ("S14", "skipped"),
        ("S15", "passed"),
        ("S16", "skipped"),
        ("S17", "skipped"),
    ];
    assert_eq!(verdicts(&found), BTreeMap::from(expected), "{found:#}");
    assert_eq!((&found["passed"], &found["failed"], &found["skipped"]), (&8.into(), &4.into(), &5.into()));
    // The lost signal reads exactly nothing, from the middle of the sweep on.
    let lost = found["cases"].as_array().unwrap().iter().find(|case| case["case"] == "S08").unwrap();
    assert_eq!(lost["measured"][0]["most"], 500.0);
    let recording = lost["recording"].as_str().unwrap();
    let said = resonarm(folder, &["export", recording, "--to", "csv", "--out", "lost"]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    let junit = fs::read_to_string(folder.join("audit.xml")).unwrap();
    assert!(junit.contains("<testsuite name=\"resonarm audit\" tests=\"17\" failures=\"4\" skipped=\"5\">"), "{junit}");
    assert!(
        junit.contains("name=\"S08 stops when the channel reads nothing\"><failure message=\"time to no drive"),
        "{junit}"
    );
    let page = fs::read_to_string(folder.join("audit.html")).unwrap();
    for part in
        ["<p class=\"bad\">failed</p>", "<td class=\"good\">passed</td>", "prefers-color-scheme:dark", "<td>S12 "]
    {
        assert!(page.contains(part), "{part}");
    }
    // It repeats bit for bit.
    // Runs that are there are not overwritten.
    fs::remove_dir_all(folder.join("resonarm-audit")).unwrap();
    assert_eq!(document(folder, 1, &[&AUDIT[..], &["--json"]].concat()), found);
}

/// The noise itself is as specified: the excitation's peak is 20 N, its density that of 4.06 N between 5 and 100 Hz. The player has
/// no levels, goes on whatever it reads, and does not equalise; in a gap it only misses samples.
#[test]
fn a_player_of_noise_fails_the_cases_that_ask_for_control() {
    let folder = folder();
    let folder = folder.path();
    let player = "[excitation]\namplitude = { exciter_x = 20.0 }\n\
        profile = { waveform = 'random', from_hz = 5, to_hz = 100, seed = 3, duration_s = 70 }\n";
    let random = "[spec]\nkind = 'random'\nsources = []\n[random]\nunit = '(m/s2)2/Hz'\n\
        breakpoints = [[5, 0.174], [100, 0.174]]\ntolerance_db = [-3, 3]\nlines_hz = 1\n";
    fs::write(folder.join("noise.toml"), player).unwrap();
    fs::write(folder.join("random.toml"), random).unwrap();
    let audit =
        ["audit", "--scenario", "plant.toml", "--specification", "random.toml", "--controller", "noise.toml", "--json"];
    let found = document(folder, 1, &audit);
    let of = |verdict: &str| -> Vec<&str> {
        verdicts(&found).into_iter().filter(|(_, found)| *found == verdict).map(|(case, _)| case).collect()
    };
    assert_eq!(of("passed"), ["R01", "R02", "R03", "R04", "R05", "R07", "R08", "R09", "R20", "R23"], "{found:#}");
    assert_eq!(of("failed"), ["R06", "R10", "R11", "R12", "R13", "R14", "R15", "R16"]);
    // It holds its level also with an inverted sensor.
    assert_eq!(of("inconclusive"), ["R22"]);
    assert_eq!(of("skipped"), ["R17", "R18", "R19", "R21"]);
    // Readings that are 3 dB less stay so: 20 log 0.708.
    let drifted = found["cases"].as_array().unwrap().iter().find(|case| case["case"] == "R15").unwrap();
    let level_db = drifted["measured"][0]["value"].as_f64().unwrap();
    assert!((level_db + 3.0).abs() < 0.3, "{level_db}");
}

#[test]
fn chosen_cases_alone_are_run() {
    let folder = folder();
    let folder = folder.path();
    let said = resonarm(folder, &[&AUDIT[..], &["--case", "S01", "--case", "S02", "--out", "runs"]].concat());
    assert_eq!((said.code, said.stderr.as_str()), (0, ""), "{}", said.stdout);
    let lines: Vec<&str> = said.stdout.lines().collect();
    assert_eq!(lines[0], "begin of the test: 0.000 s into the undisturbed run, with the sweep");
    let held = "passed        S01 holds the amplitude: whole sweeps 1 (at least 1); time within the tolerance 100 % (at least 90)";
    assert!(lines[1].starts_with(held), "{}", lines[1]);
    assert_eq!(lines[3], "2 passed, 0 failed, 0 inconclusive, 0 skipped");
    let runs: Vec<_> = fs::read_dir(folder.join("runs")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    // Both cases judge the undisturbed run, and need none of their own.
    assert_eq!(runs, ["base"]);
    // Its specification is another one.
    fs::write(folder.join("fast.toml"), SPECIFICATION.replace("rate_oct_min = 4", "rate_oct_min = 8")).unwrap();
    let fast = [&AUDIT[..4], &["fast.toml"], &AUDIT[5..], &["--case", "S02"]].concat();
    let said = resonarm(folder, &fast);
    assert_eq!(said.code, 1, "{}", said.stdout);
    assert!(said.stdout.contains("rule: rate within 10 %"), "{}", said.stdout);
}

/// A specification of an earlier audit is audited again, into the same folder.
#[test]
fn an_audit_overwrites_neither_its_inputs_nor_earlier_runs() {
    let folder = folder();
    let folder = folder.path();
    let spec = folder.join("runs/base/spec.toml");
    fs::create_dir_all(spec.parent().unwrap()).unwrap();
    fs::write(&spec, SPECIFICATION).unwrap();
    let again =
        [&AUDIT[..4], &["runs/base/spec.toml"], &AUDIT[5..], &["--case", "S01", "--out", "runs", "--overwrite"]];
    assert!(complaint(folder, 2, &again.concat()).contains("spec.toml"));
    let kept = [&AUDIT[..], &["--case", "S01", "--out", "runs"]].concat();
    assert!(complaint(folder, 2, &kept).contains("already exists"));
    assert_eq!(fs::read_to_string(&spec).unwrap(), SPECIFICATION);
}

/// A controller that does nothing fails the case about its level, and every other one decides nothing.
#[test]
fn a_test_that_never_begins_is_not_passed() {
    let folder = folder();
    let folder = folder.path();
    let random = "[spec]\nkind = 'random'\nsources = []\n[random]\nunit = '(m/s2)2/Hz'\nbreakpoints = [[10, 10], [60, 10]]\n\
        tolerance_db = [-3, 3]\nlines_hz = 1\n[schedule]\nlevels_db = [-6, 0]\nseconds = [5, 100]\n";
    fs::write(folder.join("random.toml"), random).unwrap();
    let found = document(folder, 1, &[&AUDIT[..4], &["random.toml"], &AUDIT[5..], &["--json"]].concat());
    let found = verdicts(&found);
    assert_eq!((found["R01"], found["R18"], found["R21"]), ("failed", "skipped", "skipped"));
    assert!(
        found.iter().all(|(case, verdict)| *case == "R01" || *verdict != "passed" && *verdict != "failed"),
        "{found:?}"
    );
}

/// Audits a reference controller on the plant of `examples/test-control` by some cases, all of which it passes.
fn audited(folder: &Path, kind: &str, cases: &[&str]) -> Value {
    audited_on("test-control/plant.toml", folder, kind, cases)
}

/// Audits a reference controller on a plant of `examples` by some cases, all of which it passes.
fn audited_on(plant: &str, folder: &Path, kind: &str, cases: &[&str]) -> Value {
    let examples = std::path::absolute("examples").unwrap();
    let file = |name: &str| examples.join(name).to_str().unwrap().to_owned();
    let [plant, specification, controller] =
        [plant, &format!("test-control/{kind}.toml"), &format!("test-control/{kind}-exciter.toml")].map(file);
    let mut arguments = vec!["audit", "--scenario", &plant, "--specification", &specification];
    arguments.extend(["--controller", &controller, "--json"]);
    arguments.extend(cases.iter().flat_map(|case| ["--case", case]));
    let found = document(folder, 0, &arguments);
    assert_eq!(verdicts(&found), cases.iter().map(|case| (*case, "passed")).collect(), "{found:#}");
    found
}

/// Samples from the stimulus of a case to the first one without a drive; `None` if the controller went on to the end of the run.
fn ended_after(found: &Value, case: &str) -> Option<u64> {
    let case = found["cases"].as_array().unwrap().iter().find(|found| found["case"] == case).unwrap();
    let [from, to] = ["stimulus_sample", "drive_end_sample"].map(|key| case[key].as_u64().unwrap());
    case["ended_by"].is_string().then_some(to - from)
}

/// Checks the figures of `docs/audit.md`: each is stated there in the row of its case, and is what the law makes expect, within a
/// number of samples. The last 100 samples are the ramp.
fn ends_as_stated(found: &Value, expected: &[(&str, f64, f64)]) {
    let text = fs::read_to_string("docs/audit.md").unwrap();
    let (_, text) = text.split_once("## What stops the reference controllers").unwrap();
    for (case, acts, within) in expected {
        let samples = ended_after(found, case).unwrap();
        // Without the ramp, which every end has.
        assert!((samples as f64 - 100.0 - acts).abs() <= *within, "{case}: {samples}");
        let row = text.lines().find(|line| line.starts_with("| ") && line.contains(&format!("| {case}, "))).unwrap();
        let stated = row.split_once(&format!("| {case}, ")).unwrap().1.split(" | ").nth(1).unwrap();
        assert_eq!(stated.trim_end_matches(" |"), samples.to_string(), "{row}");
    }
}

#[test]
fn a_reference_controller_of_random_tests_ends_as_stated() {
    let folder = tempfile::tempdir().unwrap();
    let cases = ["R10", "R11", "R12", "R13", "R14", "R16", "R18", "R19", "R20", "R22"];
    let found = audited(folder.path(), "random", &cases);
    // The loop check has 19 hops of 512 samples. The rms is that of a window of 210 samples, in ten parts, of noise with about 80
    // degrees of freedom: its mean square scatters by 16 %. It is 7 dB too low when four fifths of the window are lost, and 5 dB
    // too high when a share s of it is three times as large, 1 + 8 s = 3.16.
    let (window, part) = (210.0, 21.0);
    ends_as_stated(
        &found,
        &[
            ("R10", 9728.0, 0.0),
            ("R11", 9728.0, 0.0),
            ("R22", 9728.0, 0.0),
            ("R12", 30.0, 0.0),
            ("R13", 0.8 * window, 0.16 * window + part),
            ("R14", 0.27 * window, 0.16 * window + part),
            // The last sample of the ramp has no drive.
            ("R18", -1.0, 0.0),
        ],
    );
    assert_eq!(ended_after(&found, "R20"), None);
    let limits = found["cases"].as_array().unwrap().iter().find(|case| case["case"] == "R16").unwrap();
    // The level counts once a window of 2 s has −2 dB, of which 26 % are then at it. There 4.6 % of the samples are clipped: a
    // count that gains 49 with each, and loses 1 with each other one, is at 250 after 190. Then comes the ramp.
    let late_s = limits["measured"][0]["value"].as_f64().unwrap();
    assert!((late_s - (0.19 + 0.1 - 0.26 * 2.0)).abs() < 0.25, "{late_s}");
}

#[test]
fn a_reference_controller_of_sines_ends_as_stated() {
    let folder = tempfile::tempdir().unwrap();
    let cases = ["S07", "S08", "S09", "S10", "S11", "S12", "S13", "S14", "S15"];
    let found = audited(folder.path(), "sine", &cases);
    // The middle of a logarithmic sweep is at the geometric mean. The filter answers a step by 1 − (1 + x) e^(−x), x = 2πB t with
    // B = 0.15 f: a quarter is left at x = 2.69, and half at 1.68.
    let rate = 2.0 * core::f64::consts::PI * 0.15 * (15.0_f64 * 110.0).sqrt() / 1000.0;
    ends_as_stated(
        &found,
        &[
            ("S08", 30.0, 0.0),
            ("S09", 2.69 / rate + 100.0, 5.0),
            ("S11", 1.68 / rate + 20.0, 5.0),
            // The last steps of the ramp are less than a count of the protocol.
            ("S12", 9728.0, 5.0),
            ("S10", -1.0, 0.0),
        ],
    );
    assert_eq!(ended_after(&found, "S15"), None);
    // The words are a part of the recorded scenario, so that a run can be simulated again.
    let said = resonarm(folder.path(), &["resim", "resonarm-audit/S14/run.mcap"]);
    assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
}

/// The plant of `examples/audit` has a protocol without the head's force, on which a load is valid for 0.1 s.
#[test]
fn a_gap_longer_than_a_load_of_the_user_s_protocol_is_valid_does_not_end_the_test() {
    let folder = tempfile::tempdir().unwrap();
    let found = audited_on("audit/plant.toml", folder.path(), "random", &["R17", "R20"]);
    assert_eq!(ended_after(&found, "R20"), None);
}

#[test]
fn what_can_not_be_audited_is_refused() {
    let folder = folder();
    let folder = folder.path();
    let says = |arguments: &[&str]| complaint(folder, 2, arguments);
    assert!(says(&AUDIT[..5]).contains("no controller is given"));
    assert!(
        says(&[&AUDIT[..], &["--case", "R01"]].concat()).contains("unknown case \"R01\", expected one of S01, S02")
    );
    assert!(says(&[&AUDIT[..6], &["plant.toml"]].concat()).contains("neither a section [control] nor [excitation]"));
    // Refused before the bus is opened, which does not exist.
    let on_bus = [&AUDIT[..5], &["--bus", "none0", "--operator", "say stop", "--", "true"]].concat();
    assert!(says(&on_bus).contains("--operator \"say stop\" has no {word}"));
    fs::write(folder.join("two.toml"), format!("{SPECIFICATION}[control]\nchannels = ['b.x', 'c.x']\n")).unwrap();
    assert!(says(&[&AUDIT[..4], &["two.toml"], &AUDIT[5..]].concat()).contains("an audit has one control channel"));
    fs::write(folder.join("audit.xml"), "").unwrap();
    assert!(says(&[&AUDIT[..], &["--junit", "audit.xml"]].concat()).contains("already exists"));
}
