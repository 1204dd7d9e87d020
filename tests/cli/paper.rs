//! `resonarm paper` from the user's side: its files, compared with the rest of the program and independent numbers, and
//! its messages.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use insta::assert_snapshot;
use resonarm::structure::{Assembly, BodySpec, Preset, StructureSpec};
use serde_json::Value;

/// The embedded settings.
const SETTINGS: &str = include_str!("../../scenarios/paper/settings.toml");

fn paper(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    command
        .arg("paper")
        .args(arguments)
        .current_dir(folder)
        .env("RESONARM_LOG", "resonarm::progress=off")
        .stdin(Stdio::null());
    command.output().unwrap()
}

/// Runs the program, which must fail for bad usage or input; returns its standard error.
fn complaint(folder: &Path, arguments: &[&str]) -> String {
    let output = paper(folder, arguments);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{output:?}");
    String::from_utf8(output.stderr).unwrap()
}

/// The rows of a CSV file by their columns; every row has as many as the header.
fn table(path: &Path) -> (Vec<String>, Vec<Vec<String>>) {
    let text = fs::read_to_string(path).unwrap();
    let mut rows = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let rows: Vec<Vec<String>> = rows.collect();
    assert!(rows.len() > 100 && rows.iter().all(|row| row.len() == header.len()), "{}", path.display());
    (header, rows)
}

/// How often a pose is named in a figure: at each of its peaks. The second ones of `irb1600-table1` are beyond 80 Hz,
/// and only in the panel of second zones.
fn peaks(figure: &str, preset: Preset) -> usize {
    let in_a_spectrum = if preset == Preset::Irb1600Fitted { 2 } else { 1 };
    if figure == "fig4" { in_a_spectrum + 2 } else { 2 * in_a_spectrum }
}

#[test]
fn every_figure_has_four_files_and_finite_numbers() {
    for preset in Preset::ALL {
        let folder = tempfile::tempdir().unwrap();
        for figure in ["fig3", "fig4", "fig5", "fig7", "fig9"] {
            let output = paper(folder.path(), &[figure, "--out", "out", "--preset", preset.name(), "--json"]);
            assert!(output.status.success(), "{output:?}");
            let document: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!(document["figures"][0]["figure"], figure);
            let files = document["figures"][0]["files"].as_array().unwrap();
            assert!(files.iter().all(|file| folder.path().join(file.as_str().unwrap()).is_file()), "{files:?}");
            let stem = folder.path().join("out").join(figure);
            let picture = fs::read_to_string(stem.with_extension("svg")).unwrap();
            let unit = if figure == "fig5" { "(N·m)" } else { "(Hz)" };
            assert!(picture.contains(unit) && !picture.contains("NaN"), "{figure}");
            if figure != "fig3" {
                crate::figures::unstable_responses_are_dashed(&picture);
            }
            for pose in ["0°", "30°", "60°", "90°", "120°", "150°"] {
                let seen = picture.matches(&format!(">{pose}<")).count();
                assert!(
                    !["fig4", "fig7"].contains(&figure) || seen == peaks(figure, preset),
                    "{figure}: {pose} {seen} times"
                );
            }
            assert!(serde_json::from_slice::<Value>(&fs::read(stem.with_extension("json")).unwrap()).is_ok());
            let (header, rows) = table(&stem.with_extension("csv"));
            let words = ["preset", "stability", "bifurcation"];
            for (column, name) in header.iter().enumerate().filter(|(_, name)| !words.contains(&name.as_str())) {
                let finite = |row: &Vec<String>| row[column].parse().is_ok_and(f64::is_finite);
                assert!(rows.iter().all(finite), "{figure}: {name}");
                let unit = ["_hz", "_rad", "_deg", "_nm", "_n", "_m"].iter().any(|unit| name.ends_with(unit));
                assert!(unit || name == "curve", "{figure}: {name}");
            }
        }
        assert_eq!(fs::read_to_string(folder.path().join("out/settings.toml")).unwrap(), SETTINGS);
    }
}

#[test]
fn natural_frequencies_are_those_of_modes_and_of_the_oracles() {
    let folder = tempfile::tempdir().unwrap();
    assert!(paper(folder.path(), &["fig3", "--out", "."]).status.success());
    let (header, rows) = table(&folder.path().join("fig3.csv"));
    assert_eq!(header, ["preset", "beta2_deg", "frequency1_hz", "frequency2_hz"]);
    let oracles: Value = serde_json::from_str(include_str!("../oracles/oracles.json")).unwrap();
    let mut compared = 0;
    for row in rows {
        let preset = *Preset::ALL.iter().find(|preset| preset.name() == row[0]).unwrap();
        let [beta2_deg, f1, f2] = [1, 2, 3].map(|column| row[column].parse::<f64>().unwrap());
        let mut chain = preset.chain().unwrap();
        chain.links.iter_mut().zip([0.0, beta2_deg]).for_each(|(link, angle_deg)| link.angle_deg = angle_deg);
        let inertia2_kg_m2 = chain.links[1].inertia_kg_m2;
        let arm = Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] }).unwrap();
        let found: Vec<f64> = arm.modes().iter().map(|mode| mode.frequency_hz).collect();
        assert_eq!(found, [f1, f2], "{row:?}");
        let known = oracles["modes"].as_array().unwrap().iter().find(|oracle| {
            oracle["I_S2"].as_f64() == Some(inertia2_kg_m2) && oracle["beta2_deg"].as_f64() == Some(beta2_deg)
        });
        for (index, seen) in [f1, f2].into_iter().enumerate().filter(|_| known.is_some()) {
            let expected = known.unwrap()["frequency_hz"][index].as_f64().unwrap();
            assert!((seen / expected - 1.0).abs() < 1e-10, "{row:?}");
            compared += 1;
        }
    }
    assert_eq!(compared, 24);
}

/// The message for the embedded settings with one text replaced.
fn changed(from: &str, to: &str, what: &str) -> String {
    assert!(SETTINGS.contains(from), "{from}");
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("changed.toml"), SETTINGS.replacen(from, to, 1)).unwrap();
    complaint(folder.path(), &[what, "--settings", "changed.toml", "--out", "out"])
}

#[test]
fn bad_input_is_refused_with_the_accepted_values() {
    let unknown = changed("height_m = -0.2", "hight_m = -0.2", "fig7");
    assert!(unknown.starts_with("resonarm: changed.toml: TOML parse error"), "{unknown}");
    assert_snapshot!(unknown.lines().last().unwrap(), @"Did you mean `height_m`?");
    assert_snapshot!(changed("height_m = -0.2", "height_m = -0.5", "fig7"), @"resonarm: at β2 = 150° the tip is 0.320 m from joint 1 and can't be on the line at a height of -0.5 m: bring line.height_m closer to 0, or bend the arm less");
    let folder = tempfile::tempdir().unwrap();
    assert_snapshot!(complaint(folder.path(), &["fig3"]), @"resonarm: the folder for the figures is missing: give --out DIR");
    assert_snapshot!(complaint(folder.path(), &["fig3", "--settings", "none.toml", "--out", "out"]), @"resonarm: can't read the settings none.toml: No such file or directory (os error 2)");
    let measured = |what, file| complaint(folder.path(), &[what, "--measured", file, "--out", "out"]);
    assert_snapshot!(measured("fig9", "none.json"), @"resonarm: can't read none.json: No such file or directory (os error 2)");
    assert_snapshot!(measured("fig4", "none.json"), @"resonarm: --measured is for `paper fig9`: leave it out, or choose that figure");
    fs::write(folder.path().join("walk.json"), r#"{ "configuration": {}, "points": [] }"#).unwrap();
    assert_snapshot!(measured("fig9", "walk.json"), @"resonarm: walk.json is not a document of `experiment fig9 --json`: missing field `structure` at line 1 column 21");
    assert!(!folder.path().join("out").exists());
    fs::write(folder.path().join("file"), "").unwrap();
    let output = paper(folder.path(), &["fig3", "--out", "file/out"]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert_snapshot!(String::from_utf8(output.stderr).unwrap(), @"resonarm: can't write file/out: Not a directory (os error 20)");
}
