//! Exported recordings: their files, messages and refusals. `tests/recording/test_export.py` compares the contents by
//! independent readers.

use std::fs;
use std::path::Path;

use insta::assert_snapshot;
use resonarm::recording::{Options, Record, Recorder, Recording, SampleRecord, StateRecord};

use crate::{complaint, document, resonarm};

/// A folder with the recording of a run of 50 ms, followed by 50 ms in which it ends.
fn recorded() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let run = ["run", "--mode", "free", "--duration-s", "0.05", "--record", "run.mcap"];
    assert_eq!(resonarm(folder.path(), &run).code, 0);
    folder
}

#[test]
fn files_are_named_after_the_recording_and_listed() {
    let folder = recorded();
    let said = resonarm(folder.path(), &["export", "run.mcap", "--to", "csv", "--parts", "events,states,events"]);
    assert_eq!((said.code, said.stderr.as_str()), (0, "writing run-states.csv, run-events.csv\n"));
    assert_snapshot!(said.stdout, @r"
    run-states.csv: 101 rows of sample, time_s, alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s, torque1_nm, torque2_nm, force_x_n, force_y_n, is_end
    run-events.csv: 4 rows of sample, time_s, name, value
    ");
    let log = document(folder.path(), 0, &["export", "run.mcap", "--to", "blf", "--out", "other", "--json"]);
    assert_eq!((&log["format"], &log["files"][0]["path"]), (&"blf".into(), &"other.blf".into()));
    assert!(log["files"][0]["rows"].as_u64().unwrap() > 100, "{log}");
}

/// Files are written to the current folder or where --out says, never beside a recording elsewhere.
#[test]
fn files_are_written_to_the_given_place() {
    let folder = recorded();
    let folder = folder.path();
    for name in ["far", "here"] {
        fs::create_dir(folder.join(name)).unwrap();
    }
    fs::rename(folder.join("run.mcap"), folder.join("far/run.mcap")).unwrap();
    let export = ["export", "../far/run.mcap", "--to", "candump"];
    for (place, out, expected) in [
        ("here", None, "here/run.log"),
        ("here", Some("../far"), "far/run.log"),
        ("here", Some("other.v1"), "here/other.v1.log"),
    ] {
        let out: Vec<&str> = out.into_iter().flat_map(|out| ["--out", out]).collect();
        let said = resonarm(&folder.join(place), &[&export[..], &out].concat());
        let said_first = said.stderr.lines().next().unwrap().trim_start_matches("writing ").to_owned();
        assert_eq!(said.code, 0, "{}", said.stderr);
        let [written, expected] = [folder.join(place).join(said_first), folder.join(expected)];
        assert_eq!(written.canonicalize().unwrap(), expected.canonicalize().unwrap());
    }
    assert_eq!(fs::read_dir(folder.join("here")).unwrap().count(), 2);
    assert_eq!(fs::read_dir(folder.join("far")).unwrap().count(), 2);
}

#[test]
fn existing_files_are_kept_without_overwrite() {
    let folder = recorded();
    fs::write(folder.path().join("run-samples.wav"), "mine").unwrap();
    let export = ["export", "run.mcap", "--to", "wav"];
    assert_snapshot!(complaint(folder.path(), 2, &export), @"resonarm: run-samples.wav already exists: choose another place, or allow overwriting it (--overwrite)");
    assert!(!folder.path().join("run-states.wav").exists(), "a file is written before all are asked for");
    assert_eq!(resonarm(folder.path(), &[&export[..], &["--overwrite"]].concat()).code, 0);
    assert!(fs::read(folder.path().join("run-samples.wav")).unwrap().starts_with(b"RIFF"));
}

#[test]
fn contents_that_a_format_cannot_hold_are_refused() {
    let folder = recorded();
    let said = |arguments: &[&str]| complaint(folder.path(), 2, &[&["export", "run.mcap", "--to"], arguments].concat());
    assert_snapshot!(said(&["wav", "--parts", "frames"]), @"resonarm: wav can't hold frames, only states, samples; use csv, which can hold all");
    assert_snapshot!(said(&["csv", "--moving-arm", "1"]), @"resonarm: csv can't hold the moving arm; use foxglove");
    assert_snapshot!(said(&["foxglove", "--moving-arm=-1"]), @"resonarm: the magnification of the vibrations is -1: it must be above 0");
    assert_snapshot!(said(&["csv", "--from-s", "0.2"]), @"resonarm: there is no sample from 0.2 to 0.1 s: the recording has those from 0 to 0.1 s");
    assert_snapshot!(said(&["csv", "--to-s=-0.1"]), @"resonarm: there is no sample from 0 to -0.1 s: the recording has those from 0 to 0.1 s");
    assert_snapshot!(said(&["csv", "--out", "none/x"]), @"resonarm: can't write none/x: No such file or directory (os error 2)");
    let first = |arguments: &[&str]| said(arguments).lines().next().unwrap().to_owned();
    assert_snapshot!(first(&["parquet"]), @"error: invalid value 'parquet' for '--to <FORMAT>': use the Python package: `python3 -m resonarm export RECORDING --to parquet` (docs/python.md)");
    assert_snapshot!(first(&["mf4"]), @"error: invalid value 'mf4' for '--to <FORMAT>': use the Python package: `python3 -m resonarm export RECORDING --to mf4` (docs/python.md)");
    assert_snapshot!(first(&["xls"]), @"error: invalid value 'xls' for '--to <FORMAT>': it must be one of csv, candump, asc, blf, foxglove, uff58, wav");
}

/// The recording without one of its states.
fn with_gap(folder: &Path) {
    let recording = Recording::open(folder.join("run.mcap")).unwrap();
    let options = Options::virtual_time(recording.origin().dt_s, "none");
    let recorder = Recorder::create(folder.join("gap.mcap"), recording.configuration(), options).unwrap();
    let mut channel = recorder.channel("plant", 1024).unwrap();
    for record in recording.states().unwrap().map(Result::unwrap).filter(|record| record.sample != 20) {
        channel.push_blocking(&Record::State(record)).unwrap();
    }
    recorder.finish(&[]).unwrap();
}

#[test]
fn a_gap_is_refused_where_every_sample_is_needed() {
    let folder = recorded();
    with_gap(folder.path());
    assert_snapshot!(complaint(folder.path(), 2, &["export", "gap.mcap", "--to", "wav"]), @"
    writing gap-states.wav
    resonarm: recording `gap.mcap` is not continuous in topic `/plant/steps`: expected sample 20, got sample 21 (1 such gaps in all); the run lost records, or the file was recovered from a damaged one
    ");
    let table = document(folder.path(), 0, &["export", "gap.mcap", "--to", "csv", "--json"]);
    assert_eq!(table["files"][0]["rows"], 100);
}

/// A failed export keeps existing files, and leaves no partial file.
#[test]
fn a_failed_export_keeps_files_that_may_be_overwritten() {
    let folder = recorded();
    with_gap(folder.path());
    // The gap is found at once; the damage, after the first samples, only during the export.
    let bytes = fs::read(folder.path().join("run.mcap")).unwrap();
    let there = ["gap.uff", "gap-states.wav"];
    there.iter().for_each(|name| fs::write(folder.path().join(name), "mine").unwrap());
    for format in ["uff58", "wav"] {
        complaint(folder.path(), 2, &["export", "gap.mcap", "--to", format, "--parts", "states", "--overwrite"]);
    }
    for name in there {
        assert_eq!(fs::read_to_string(folder.path().join(name)).unwrap(), "mine", "{name}");
    }
    // A full disk, simulated by a limit of 2 KiB.
    for (format, name) in [
        ("csv", "run-states.csv"),
        ("candump", "run.log"),
        ("asc", "run.asc"),
        ("blf", "run.blf"),
        ("foxglove", "run-foxglove.mcap"),
        ("uff58", "run.uff"),
        ("wav", "run-states.wav"),
    ] {
        fs::write(folder.path().join(name), "mine").unwrap();
        let script = format!("ulimit -f 4; exec \"$0\" export run.mcap --to {format} --overwrite");
        let program = env!("CARGO_BIN_EXE_resonarm");
        let ended =
            std::process::Command::new("dash").args(["-c", &script, program]).current_dir(folder.path()).output();
        let ended = ended.unwrap();
        assert!(matches!(ended.status.code(), Some(2 | 3)), "{format}: {ended:?}");
        assert_eq!(fs::read_to_string(folder.path().join(name)).unwrap(), "mine", "{format}");
        fs::remove_file(folder.path().join(name)).unwrap();
    }
    assert_eq!(fs::read(folder.path().join("run.mcap")).unwrap(), bytes);
    let mut names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["gap-states.wav", "gap.mcap", "gap.uff", "run.mcap"]);
}

/// A foreign recording may state any sample.
#[test]
fn the_last_of_all_samples_is_exported() {
    let folder = recorded();
    let recording = Recording::open(folder.path().join("run.mcap")).unwrap();
    let options = Options::virtual_time(recording.origin().dt_s, "none");
    let recorder = Recorder::create(folder.path().join("last.mcap"), recording.configuration(), options).unwrap();
    let mut channel = recorder.channel("plant", 1024).unwrap();
    for (sample, state) in (u64::MAX - 2..=u64::MAX).zip(recording.states().unwrap()) {
        channel.push_blocking(&Record::State(StateRecord { sample, ..state.unwrap() })).unwrap();
    }
    for (sample, readings) in (u64::MAX - 2..=u64::MAX).zip(recording.samples().unwrap()) {
        channel.push_blocking(&Record::Sample(SampleRecord { sample, ..readings.unwrap() })).unwrap();
    }
    recorder.finish(&[]).unwrap();
    for format in ["csv", "uff58", "wav", "foxglove"] {
        let written = document(folder.path(), 0, &["export", "last.mcap", "--to", format, "--json"]);
        // A copy for Foxglove has states and samples in one file.
        let rows = if format == "foxglove" { 6 } else { 3 };
        assert_eq!(written["files"][0]["rows"], rows, "{format}");
    }
    document(folder.path(), 0, &["inspect", "last.mcap", "--statistics", "--plot", "last", "--json"]);
    document(folder.path(), 0, &["cut", "last.mcap", "part.mcap", "--json"]);
    document(folder.path(), 0, &["diff", "last.mcap", "part.mcap", "--json"]);
    assert_eq!(resonarm(folder.path(), &["resim", "last.mcap"]).code, 0);
}
