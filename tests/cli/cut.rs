//! `cut` and `merge`; `inspect` with statistics and a figure.

use std::fs;
use std::path::Path;

use insta::assert_snapshot;

use crate::{complaint, document, resonarm};

/// A folder with the recording of a run.
fn recorded() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let run = ["run", "--mode", "free", "--duration-s", "0.3", "--record", "run.mcap"];
    assert_eq!(resonarm(folder.path(), &run).code, 0);
    folder
}

fn run(folder: &Path, arguments: &str) {
    let words: Vec<&str> = arguments.split(' ').collect();
    let ended = resonarm(folder, &words);
    assert_eq!(ended.code, 0, "{arguments}: {}", ended.stderr);
}

#[test]
fn a_section_is_a_recording() {
    let folder = recorded();
    run(folder.path(), "cut run.mcap part.mcap --from-s 0.1 --to-s 0.2");
    let states = &document(folder.path(), 0, &["inspect", "part.mcap", "--json"])["topics"]["/plant/steps"];
    // Both ends belong to the section: 0.1 to 0.2 s are 101 samples of 1 ms.
    assert_eq!(states["records"], 101);
    let verdict = document(folder.path(), 0, &["resim", "part.mcap", "--json"]);
    assert_eq!((&verdict["identical"], &verdict["samples"]), (&true.into(), &101.into()));
    let all = "diff run.mcap part.mcap --parts states,samples,frames --from-s 0.1 --to-s 0.2";
    run(folder.path(), all);
    assert_snapshot!(complaint(folder.path(), 2, &["cut", "run.mcap", "run.mcap", "--overwrite"]), @"resonarm: recording `run.mcap` can't be written over itself: name another file for the result");
    assert_snapshot!(complaint(folder.path(), 2, &["cut", "run.mcap", "part.mcap"]), @"resonarm: recording `part.mcap` already exists: name another file, or allow overwriting it (--overwrite)");
    assert_snapshot!(complaint(folder.path(), 2, &["cut", "run.mcap", "none.mcap", "--from-s", "7"]), @"resonarm: there is no sample from 7 to 0.35 s: the recording has those from 0 to 0.35 s");
}

#[test]
fn joined_sections_are_the_whole() {
    let folder = recorded();
    run(folder.path(), "cut run.mcap a.mcap --to-s 0.1");
    // The sample at 0.1 s is in the first section, and the next one begins behind it.
    run(folder.path(), "cut run.mcap b.mcap --from-s 0.101 --to-s 0.2");
    run(folder.path(), "cut run.mcap c.mcap --from-s 0.201");
    run(folder.path(), "merge a.mcap b.mcap c.mcap --out whole.mcap");
    run(folder.path(), "diff run.mcap whole.mcap --parts states,samples,frames,events");
    run(folder.path(), "resim whole.mcap");
    let said =
        |arguments: &[&str]| complaint(folder.path(), 2, &[&["merge"], arguments, &["--out", "new.mcap"]].concat());
    assert_snapshot!(said(&["b.mcap", "a.mcap"]), @"resonarm: recording `a.mcap` can't be joined to the one before it: it has samples from 0 on, expected samples after 200");
    run(folder.path(), "run --mode free --duration-s 0.05 --angles-deg 0,30 --record other.mcap");
    assert_snapshot!(said(&["a.mcap", "other.mcap"]), @"resonarm: recording `other.mcap` can't be joined to the one before it: it has another configuration (see `resonarm diff`), expected the same");
    run(folder.path(), "run --mode free --duration-s 0.05 --rate-hz 500 --record slow.mcap");
    assert_snapshot!(said(&["a.mcap", "slow.mcap"]), @"resonarm: recording `slow.mcap` can't be joined to the one before it: it has the sample period 0.002 s, expected the sample period 0.001 s");
    assert!(!folder.path().join("new.mcap").exists());
}

/// With a recording truncated before its first record, and one without a record.
#[test]
fn nothing_to_copy_is_an_error() {
    let folder = recorded();
    let bytes = fs::read(folder.path().join("run.mcap")).unwrap();
    // The first chunk follows the metadata.
    let zstd = bytes.windows(8).position(|bytes| bytes == b"\x04\0\0\0zstd").unwrap();
    fs::write(folder.path().join("head.mcap"), &bytes[..zstd]).unwrap();
    assert_eq!(document(folder.path(), 1, &["inspect", "head.mcap", "--json"])["samples"], serde_json::Value::Null);
    let recorder = resonarm::recording::Recorder::create(
        folder.path().join("empty.mcap"),
        resonarm::recording::Recording::open(folder.path().join("run.mcap")).unwrap().configuration(),
        resonarm::recording::Options::virtual_time(1e-3, "none"),
    );
    recorder.unwrap().finish(&[]).unwrap();
    let files = fs::read_dir(folder.path()).unwrap().count();
    let said = |arguments: &[&str]| {
        let said = complaint(folder.path(), 1, arguments);
        let line = said.lines().find(|line| line.starts_with("resonarm: ")).unwrap_or_default();
        // The head contains the commit and the compiler: its length varies between machines.
        line.replace(&zstd.to_string(), "N").replace(&(zstd - 37).to_string(), "M")
    };
    assert_snapshot!(said(&["cut", "head.mcap", "part.mcap"]), @"resonarm: there is nothing to copy: recording `head.mcap` has no record that can be read (truncated: M of N bytes can be read, which contain no sample); no file was written");
    assert_snapshot!(said(&["cut", "head.mcap", "part.mcap", "--from-s", "0.1"]), @"resonarm: there is nothing to copy: recording `head.mcap` has no record that can be read (truncated: M of N bytes can be read, which contain no sample); no file was written");
    assert_snapshot!(said(&["cut", "empty.mcap", "part.mcap"]), @"resonarm: there is nothing to copy: recording `empty.mcap` has no record; no file was written");
    assert_snapshot!(said(&["merge", "head.mcap", "empty.mcap", "--out", "part.mcap"]), @"resonarm: there is nothing to copy: recording `head.mcap` has no record that can be read (truncated: M of N bytes can be read, which contain no sample), recording `empty.mcap` has no record; no file was written");
    // An empty recording in between does not hide that the next does not follow.
    let said = complaint(folder.path(), 2, &["merge", "run.mcap", "empty.mcap", "run.mcap", "--out", "part.mcap"]);
    assert_snapshot!(said, @"resonarm: recording `run.mcap` can't be joined to the one before it: it has samples from 0 on, expected samples after 350");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), files, "a file is left");
}

#[test]
fn a_recording_in_numbers_and_as_a_figure() {
    let folder = recorded();
    let inspect = ["inspect", "run.mcap", "--statistics", "--plot", "run", "--json"];
    let found = document(folder.path(), 0, &inspect);
    run(folder.path(), "export run.mcap --to csv --parts samples");
    let table = fs::read_to_string(folder.path().join("run-samples.csv")).unwrap();
    let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    for channel in found["statistics"]["channels"].as_array().unwrap() {
        let name = channel["name"].as_str().unwrap();
        let Some(column) = head.iter().position(|title| *title == name) else { continue };
        let values: Vec<f64> =
            table.lines().skip(1).map(|line| line.split(',').nth(column).unwrap().parse().unwrap()).collect();
        let count = values.len() as f64;
        let expected = [
            values.iter().copied().fold(f64::INFINITY, f64::min),
            values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            values.iter().sum::<f64>() / count,
            (values.iter().map(|value| value * value).sum::<f64>() / count).sqrt(),
        ];
        let got = ["least", "largest", "mean", "rms"].map(|key| channel[key].as_f64().unwrap());
        assert_eq!(got, expected, "{name}");
    }
    assert_eq!(found["statistics"]["channels"].as_array().unwrap().len(), 14);
    assert_eq!(found["problems"], serde_json::json!([]));
    assert_eq!((&found["statistics"]["lost_frames"], &found["statistics"]["foreign_frames"]), (&0.into(), &0.into()));
    let frames = found["topics"]["/can/frames"]["records"].as_u64().unwrap();
    let messages = found["statistics"]["messages"].as_object().unwrap();
    assert_eq!(messages.values().map(|count| count.as_u64().unwrap()).sum::<u64>(), frames);
    let figure = fs::read_to_string(folder.path().join("run.svg")).unwrap();
    // No torque acts in this run, and channels that are 0 all the time are not drawn.
    assert!(figure.contains("alpha1_rad") && figure.contains("head_force_x_n") && !figure.contains("torque1_nm"));
    // The figure is there now, and is not overwritten.
    assert_eq!(complaint(folder.path(), 2, &inspect).lines().count(), 1);
    let text = resonarm(folder.path(), &["inspect", "run.mcap", "--statistics"]).stdout;
    assert!(text.contains("\nhead_force_x_n ") && text.contains("\nforeign frames "), "{text}");
}
