//! `spec` and `verdict`: what tests ask for, and recordings judged against them.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{complaint, document, resonarm};

const RANDOM: &str = "[spec]
kind = 'random'
name = 'flat with slopes'
sources = ['own']
[random]
unit = '(m/s2)2/Hz'
breakpoints = [[10, 0.02], [20, 0.2], [100, 0.2], [200, 0.05]]
tolerance_db = [-3, 3]
[schedule]
levels_db = [-12, -6, -3, 0]
seconds = [10, 10, 10, 60]
[control]
channels = ['c.x']
";

/// Two modes whose tip is pushed: the structure of the force below.
const TWO_MODES: &str = "[structure]
kind = 'modal'
modes = [
    { frequency_hz = 31.3, damping_ratio = 0.02, shape = { 'tip.x' = 0.4, 'mid.x' = 0.22 } },
    { frequency_hz = 87.7, damping_ratio = 0.02, shape = { 'tip.x' = 0.35, 'mid.x' = -0.3 } },
]
[rig.exciter]
at = 'tip.x'
[rig.sensors.b]
at = 'mid'
[rig.sensors.c]
at = 'tip'
";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn near(found: &Value, expected: f64, relative: f64) {
    assert!((number(found) / expected - 1.0).abs() <= relative, "{found}, expected {expected}");
}

fn folder_with(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, text)| fs::write(folder.path().join(name), text).unwrap());
    folder
}

/// The figures of `tests/oracles/test-control.json`, and forces that an independent computation (NumPy) found for a mass and for
/// the structure: 51.8 N, and 46.4 N by sums over lines of 0.1 Hz.
#[test]
fn a_specification_states_what_it_asks_for() {
    let folder = folder_with(&[("spec.toml", RANDOM), ("two.toml", TWO_MODES)]);
    let arguments = ["spec", "spec.toml", "--mass-kg", "10", "--scenario", "two.toml", "--json"];
    let found = document(folder.path(), 0, &arguments);
    near(&found["rms_m_s2"], 5.1845189950473785, 1e-9);
    near(&found["velocity_rms_m_s"], 0.017455420089316814, 1e-9);
    near(&found["displacement_rms_m"], 0.000123670056963591, 1e-9);
    near(&found["peak_m_s2"], 3.0 * 5.1845189950473785, 1e-9);
    near(&found["forces"][0]["rms_n"], 51.845_189_950_473_79, 1e-9);
    near(&found["forces"][1]["rms_n"], 46.4, 0.005);
    near(&found["forces"][1]["peak_n"], 139.2, 0.005);
    assert_eq!(found["fits"], true, "{:#}", found["checks"]);
    assert_eq!(found["name"], "flat with slopes");
    let strong = RANDOM.replace("0.2]", "20]");
    fs::write(folder.path().join("strong.toml"), strong).unwrap();
    let said = resonarm(folder.path(), &["spec", "strong.toml", "--scenario", "two.toml"]);
    assert_eq!(said.code, 1, "{}", said.stderr);
    assert!(said.stdout.contains("does not fit"), "{}", said.stdout);
}

#[test]
fn presets_are_listed_printed_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let listed = document(folder.path(), 0, &["spec", "--json"]);
    assert_eq!(listed.as_array().unwrap().len(), 10);
    for preset in listed.as_array().unwrap() {
        let name = preset["name"].as_str().unwrap();
        assert!(!preset["sources"].as_array().unwrap().is_empty());
        let said = resonarm(folder.path(), &["spec", name, "--mass-kg", "2"]);
        assert_eq!((said.code, said.stderr.as_str()), (0, ""), "{name}");
        assert!(said.stdout.contains("force"), "{}", said.stdout);
        let printed = resonarm(folder.path(), &["spec", name, "--toml"]).stdout;
        fs::write(folder.path().join("mine.toml"), printed).unwrap();
        let [of_preset, of_file] =
            [name, "mine.toml"].map(|spec| document(folder.path(), 0, &["spec", spec, "--json"]));
        assert_eq!(of_preset, of_file);
    }
    for kind in ["navmat-p-9492", "iec-60945", "iec-60068-2-27", "mil-std-810-516-functional"] {
        let said = resonarm(folder.path(), &["spec", kind, "--plot", kind]);
        assert_eq!((said.code, said.stderr.as_str()), (0, ""));
        assert!(said.stdout.contains("written to"), "{}", said.stdout);
    }
    near(&document(folder.path(), 0, &["spec", "navmat-p-9492", "--json"])["rms_m_s2"], 6.064 * 9.80665, 1e-4);
    let said = complaint(folder.path(), 2, &["spec", "navmat"]);
    assert!(said.contains("neither a preset nor a file") && said.contains("navmat-p-9492"), "{said}");
    assert!(complaint(folder.path(), 2, &["spec", "none/spec.toml"]).contains("can't read the specification"));
    assert!(complaint(folder.path(), 2, &["spec", "navmat-p-9492", "--mass-kg", "0"]).contains("--mass-kg is 0"));
    fs::write(folder.path().join("bad.toml"), RANDOM.replace("[20, 0.2]", "[20, -0.2]")).unwrap();
    let said = complaint(folder.path(), 2, &["spec", "bad.toml"]);
    assert!(said.contains("bad.toml: [random] `breakpoints`, number 2: the level is -0.2"), "{said}");
}

/// A structure that is stiff far beyond the band: the acceleration of its tip is nearly that of a mass, the force over it.
fn recorded(folder: &Path, name: &str, seconds: u32, profile: &str, amplitude: f64) {
    let scenario = format!(
        "[structure]
kind = 'modal'
modes = [{{ frequency_hz = 1.0, damping_ratio = 0.05, shape = {{ 'tip.x' = 1.0, 'mid.x' = 1.0 }} }}]
[rig.exciter]
at = 'tip.x'
[rig.sensors.b]
at = 'mid'
[rig.sensors.c]
at = 'tip'
[excitation]
amplitude = {{ exciter_x = {amplitude} }}
profile = {{ {profile}, duration_s = {seconds} }}
"
    );
    fs::write(folder.join(format!("{name}.toml")), scenario).unwrap();
    let (file, recording) = (format!("{name}.toml"), format!("{name}.mcap"));
    let said = resonarm(folder, &["run", "--mode", "free", "--scenario", &file, "--record", &recording]);
    assert_eq!(said.code, 0, "{}", said.stderr);
}

/// The density of the record itself is the specification that it meets; one of four times that is far out.
#[test]
fn a_random_record_is_judged() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recorded(folder, "random", 60, "waveform = 'random', from_hz = 5, to_hz = 100, seed = 3", 20.0);
    let psd =
        ["plot", "random.mcap", "--of", "psd", "--channels", "acceleration_c_x_m_s2", "--segment-s", "1", "--json"];
    let found = document(folder, 0, &psd);
    let density: Vec<f64> = serde_json::from_value(found["channels"]["acceleration_c_x_m_s2"]["psd"].clone()).unwrap();
    let mean = |lines: core::ops::Range<usize>| density[lines.clone()].iter().sum::<f64>() / lines.len() as f64;
    let points = [15, 40, 80].map(|hz| format!("[{hz}, {:e}]", mean(hz - 5..hz + 5))).join(", ");
    let spec = |factor: f64, tolerance: f64| {
        let unit = "unit = '(m/s2)2/Hz'\nlines_hz = 1";
        let points = points.split("], ").map(|point| point.trim_matches(['[', ']']).split_once(", ").unwrap());
        let points = points.map(|(hz, level)| format!("[{hz}, {:e}]", factor * level.parse::<f64>().unwrap()));
        let points = points.collect::<Vec<_>>().join(", ");
        format!(
            "spec = {{ kind = 'random', sources = [] }}\ncontrol = {{ channels = ['c.x'] }}\n[random]\n{unit}\nbreakpoints = [{points}]\n\
             tolerance_db = [-{tolerance}, {tolerance}]\nrms_tolerance = 0.2"
        )
    };
    for (name, text) in [("good", spec(1.0, 3.0)), ("high", spec(4.0, 3.0)), ("narrow", spec(1.0, 0.3))] {
        fs::write(folder.join(format!("{name}.toml")), text).unwrap();
    }
    let good = document(folder, 0, &["verdict", "good.toml", "random.mcap", "--json", "--plot", "good"]);
    assert_eq!(good["verdict"], "in", "{:#}", good["found"]["counts"]);
    assert_eq!(good["found"]["counts"][0], 62);
    assert!(number(&good["found"]["degrees_of_freedom"]) > 150.0);
    assert!(fs::read_to_string(folder.join("good.csv")).unwrap().starts_with("frequency_hz,measured,is_out\n17,"));
    let said = resonarm(folder, &["verdict", "high.toml", "random.mcap"]);
    assert_eq!(said.code, 1, "{}", said.stderr);
    assert!(
        said.stdout.ends_with("verdict: out\n") && said.stderr.contains("no stretch within 2 dB"),
        "{}",
        said.stdout
    );
    let written = ["--junit", "good.xml", "--report", "good.html"];
    let said = resonarm(folder, &[&["verdict", "good.toml", "random.mcap"][..], &written].concat());
    assert_eq!(said.code, 0, "{}", said.stderr);
    assert!(said.stdout.ends_with("written to good.xml, good.html\n"), "{}", said.stdout);
    let junit = fs::read_to_string(folder.join("good.xml")).unwrap();
    assert!(
        junit.contains("<testsuite name=\"resonarm verdict\" tests=\"3\" failures=\"0\" skipped=\"0\">"),
        "{junit}"
    );
    assert!(junit.contains("name=\"profile\"></testcase>") && junit.contains("name=\"rms\"></testcase>"), "{junit}");
    let page = fs::read_to_string(folder.join("good.html")).unwrap();
    // One file that loads nothing, for light and dark, with the figure and its tolerance.
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
    let mut links = page.split("http").skip(1);
    assert!(links.all(|link| link.starts_with("://www.w3.org/2000/svg\"")), "{page}");
    for part in
        ["prefers-color-scheme:dark", "<svg ", ">tolerance</text>", "<p class=\"good\">in</p>", "<td>profile</td>"]
    {
        assert!(page.contains(part), "{part}");
    }
    assert!(
        complaint(folder, 2, &[&["verdict", "good.toml", "random.mcap"][..], &written].concat())
            .contains("good.xml already exists")
    );
    let own = ["verdict", "good.toml", "random.mcap", "--report", "random.mcap", "--overwrite"];
    assert!(complaint(folder, 2, &own).contains("can't be written over itself"));
    let written = ["--junit", "high.xml", "--report", "high.html"];
    assert_eq!(resonarm(folder, &[&["verdict", "high.toml", "random.mcap"][..], &written].concat()).code, 1);
    let junit = fs::read_to_string(folder.join("high.xml")).unwrap();
    assert!(
        junit.contains("failures=\"3\"") && junit.contains("<failure message=\"out: of 62 lines 0 are in"),
        "{junit}"
    );
    assert!(fs::read_to_string(folder.join("high.html")).unwrap().contains("<p class=\"bad\">out</p>"));
    // No record is long enough for the narrow tolerance: the exit code is the user's choice.
    let narrow = ["verdict", "narrow.toml", "random.mcap", "--from-s", "1"];
    let said = resonarm(folder, &narrow);
    assert_eq!(said.code, 1);
    assert!(
        said.stdout.ends_with("verdict: undecided\n") || said.stdout.ends_with("verdict: out\n"),
        "{}",
        said.stdout
    );
    let short =
        document(folder, 0, &["verdict", "good.toml", "random.mcap", "--to-s", "4", "--undecided", "pass", "--json"]);
    assert_eq!(short["verdict"], "undecided");
    document(folder, 1, &["verdict", "good.toml", "random.mcap", "--to-s", "4", "--json"]);
    for (undecided, word) in [("pass", "<skipped message=\"undecided: "), ("fail", "<failure message=\"undecided: ")] {
        let junit = format!("{undecided}.xml");
        let short = ["verdict", "good.toml", "random.mcap", "--to-s", "4", "--undecided", undecided, "--junit", &junit];
        resonarm(folder, &short);
        let junit = fs::read_to_string(folder.join(junit)).unwrap();
        assert!(junit.contains(word), "{junit}");
    }
    // What can't be judged.
    let force = ["verdict", "good.toml", "random.mcap", "--channels", "head_force_x_n"];
    assert!(complaint(folder, 2, &force).contains("head_force_x_n is in N"));
    let none = ["verdict", "navmat-p-9492", "random.mcap"];
    assert!(complaint(folder, 2, &none).contains("acceleration_c_x_m_s2"));
    let fast = ["verdict", "navmat-p-9492", "random.mcap", "--channels", "c.x"];
    assert!(complaint(folder, 2, &fast).contains("the specification reaches 2000 Hz"));
    let reference = ["verdict", "good.toml", "random.mcap", "--reference", "head_force_x_n"];
    assert!(complaint(folder, 2, &reference).contains("a reference gives the phase of a sine"));
}

/// Far above its only mode the structure is a mass of 1 kg, so a sweep of constant force has a constant acceleration; the
/// converter of the accelerometer reads less by sinc⁵ at 40 Hz and 1 kHz, 1.3 %.
#[test]
fn a_swept_sine_is_judged() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recorded(folder, "sweep", 60, "waveform = 'swept-sine', law = 'logarithmic', from_hz = 10, to_hz = 40", 5.0);
    let spec = |level: f64, rate: f64| {
        format!(
            "spec = {{ kind = 'sine', sources = [] }}\ncontrol = {{ channels = ['c.x'] }}\n[sine]\nfrom_hz = 10\nrate_oct_min = {rate}\n\
             segments = [{{ to_hz = 40, acceleration_m_s2 = {level} }}]\ntolerance = 0.1\nrate_tolerance = 0.1"
        )
    };
    for (name, text) in [("good", spec(5.0, 2.0)), ("low", spec(6.0, 2.0)), ("slow", spec(5.0, 1.0))] {
        fs::write(folder.join(format!("{name}.toml")), text).unwrap();
    }
    let judged = |name: &str, code: i32| {
        let spec = format!("{name}.toml");
        let arguments = ["verdict", &spec, "sweep.mcap", "--reference", "head_force_x_n", "--json", "--plot", name];
        document(folder, code, &arguments)
    };
    let good = judged("good", 0);
    assert_eq!((&good["verdict"], &good["found"]["is_continuous"]), (&"in".into(), &true.into()));
    near(&good["found"]["passes"][0]["rate"], 2.0, 0.02);
    assert_eq!(good["begins_by"], "sweep");
    assert!(number(&good["begins_s"]) < 0.5, "{}", good["begins_s"]);
    let given = ["verdict", "good.toml", "sweep.mcap", "--reference", "head_force_x_n", "--from-s", "0", "--json"];
    assert_eq!(document(folder, 0, &given)["begins_by"], "given");
    assert_eq!(judged("low", 1)["found"]["amplitude"], "out");
    let slow = judged("slow", 1);
    assert_eq!((&slow["found"]["amplitude"], &slow["found"]["rate"]), (&"in".into(), &"out".into()));
    // Noise is no sweep: the test has not begun.
    recorded(folder, "noise", 20, "waveform = 'random', from_hz = 5, to_hz = 60, seed = 3", 20.0);
    let none = ["verdict", "good.toml", "noise.mcap", "--junit", "none.xml"];
    let said = resonarm(folder, &none);
    assert_eq!(said.code, 1, "{}", said.stderr);
    assert!(
        said.stdout.contains("\nbegin of the test: not found; no sweep between 11.50 and 34.78 Hz"),
        "{}",
        said.stdout
    );
    assert!(said.stdout.contains("\nverdict: undecided; no test begins in the record\n"), "{}", said.stdout);
    let junit = fs::read_to_string(folder.join("none.xml")).unwrap();
    assert!(junit.contains("name=\"begin of the test\"><failure message=\"undecided: no sweep between"), "{junit}");
    let none = document(folder, 1, &["verdict", "good.toml", "noise.mcap", "--json"]);
    assert_eq!((&none["verdict"], &none["begins_s"]), (&"undecided".into(), &serde_json::Value::Null));
    // What is undecided otherwise may pass by choice; a record without the test may not.
    let pass = ["verdict", "good.toml", "noise.mcap", "--undecided", "pass", "--junit", "pass.xml"];
    let said = resonarm(folder, &pass);
    assert_eq!(said.code, 1, "{}", said.stdout);
    assert!(said.stdout.contains("\nverdict: undecided; no test begins in the record\n"), "{}", said.stdout);
    let junit = fs::read_to_string(folder.join("pass.xml")).unwrap();
    assert!(junit.contains("name=\"begin of the test\"><failure message=\"undecided: no sweep between"), "{junit}");
}

/// Noise 4 dB below the level, within a tolerance of 9 dB: the full level is never reached, so no choice makes this a passed test.
#[test]
fn a_random_test_that_never_reaches_its_level_does_not_pass() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recorded(folder, "low", 5, "waveform = 'random', from_hz = 5, to_hz = 100, seed = 3", 20.0);
    let psd = ["plot", "low.mcap", "--of", "psd", "--channels", "acceleration_c_x_m_s2", "--segment-s", "1", "--json"];
    let found = document(folder, 0, &psd);
    let density: Vec<f64> = serde_json::from_value(found["channels"]["acceleration_c_x_m_s2"]["psd"].clone()).unwrap();
    let level = density[15..80].iter().sum::<f64>() / 65.0 * libm::pow(10.0, 0.4);
    let spec = format!(
        "spec = {{ kind = 'random', sources = [] }}\ncontrol = {{ channels = ['c.x'] }}\n[random]\nunit = '(m/s2)2/Hz'\n\
         breakpoints = [[15, {level:e}], [80, {level:e}]]\ntolerance_db = [-9, 9]\nlines_hz = 1\n"
    );
    fs::write(folder.join("high.toml"), spec).unwrap();
    let judged = ["verdict", "high.toml", "low.mcap", "--undecided", "pass", "--junit", "low.xml"];
    let said = resonarm(folder, &judged);
    assert!(said.stdout.contains("\nverdict: undecided; no test begins in the record\n"), "{}", said.stdout);
    assert_eq!(said.code, 1);
    let junit = fs::read_to_string(folder.join("low.xml")).unwrap();
    assert!(
        junit.contains("name=\"begin of the test\"><failure message=\"undecided: no stretch is at full level"),
        "{junit}"
    );
    // A range that is given begins with the test.
    let given = ["verdict", "high.toml", "low.mcap", "--undecided", "pass", "--from-s", "0.5"];
    assert_eq!(resonarm(folder, &given).code, 0);
}
