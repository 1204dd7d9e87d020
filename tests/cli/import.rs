//! `import`: logs of other tools as recordings.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use insta::assert_snapshot;
use resonarm::recording::{FrameRecord, Recording};

use crate::{complaint, document, resonarm};

/// A folder with the recording of a run in which a response is read, and its frames as logs.
fn exported() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let scenario = "[network]\nbase_id = 0x300\nplant_id = 3\nplant_converter = 'sinc5'\n[excitation]\namplitude = { joint1 = 60.0 }\n\
        profile = { waveform = 'dwell', frequency_hz = 22.1, duration_s = 0.5, settle_s = 0.1 }";
    fs::write(folder.path().join("run.toml"), scenario).unwrap();
    for arguments in [
        "run --mode free --scenario run.toml --duration-s 0.6 --record run.mcap",
        "export run.mcap --to candump",
        "export run.mcap --to asc",
        "export run.mcap --to blf",
    ] {
        let words: Vec<&str> = arguments.split(' ').collect();
        assert_eq!(resonarm(folder.path(), &words).code, 0, "{arguments}");
    }
    folder
}

fn frames(path: &Path) -> Vec<FrameRecord> {
    Recording::open(path).unwrap().frames().unwrap().map(Result::unwrap).collect()
}

/// Everything except the sample, which follows from the time, and digits that the logs don't have.
fn content(frame: &FrameRecord) -> String {
    format!("{:?} {} {}", frame.direction, frame.time_ns / 1000, frame.frame)
}

#[test]
fn exported_frames_are_imported_unchanged() {
    let folder = exported();
    let expected: Vec<String> = frames(&folder.path().join("run.mcap")).iter().map(content).collect();
    for log in ["run.log", "run.asc", "run.blf"] {
        let import = ["import", log, "back.mcap", "--scenario", "run.toml", "--json", "--overwrite"];
        let imported = document(folder.path(), 0, &import);
        assert_eq!(imported["frames"], expected.len());
        let found: Vec<String> = frames(&folder.path().join("back.mcap")).iter().map(content).collect();
        assert_eq!(found, expected, "{log}");
    }
    // `compare` reads the same responses from the imported frames.
    let said = resonarm(folder.path(), &["compare", "back.mcap", "--json"]);
    let ours = resonarm(folder.path(), &["compare", "run.mcap", "--json"]);
    assert_eq!((said.code, said.stdout), (ours.code, ours.stdout));
    assert_eq!(document(folder.path(), 0, &["inspect", "back.mcap", "--json"])["integrity"]["state"], "complete");
}

/// In a log of sent and received frames, queued frames are out of order.
#[test]
fn frames_out_of_order_keep_their_times() {
    let folder = tempfile::tempdir().unwrap();
    let lines = "(1700000000.050000) can0 123#01\n(1700000000.000000) can0 123#02\n(1700000000.049999) can0 123#03\n";
    fs::write(folder.path().join("queued.log"), lines).unwrap();
    document(folder.path(), 0, &["import", "queued.log", "run.mcap", "--json"]);
    let times =
        |name: &str| frames(&folder.path().join(name)).iter().map(|frame| frame.time_ns / 1000).collect::<Vec<_>>();
    assert_eq!(times("run.mcap"), [50_000, 0, 49_999]);
    for (format, log) in [("candump", "run.log"), ("asc", "run.asc"), ("blf", "run.blf")] {
        document(folder.path(), 0, &["export", "run.mcap", "--to", format, "--json"]);
        document(folder.path(), 0, &["import", log, "back.mcap", "--overwrite", "--json"]);
        assert_eq!(times("back.mcap"), [50_000, 0, 49_999], "{format}");
    }
}

#[test]
fn the_refusal_to_simulate_again_says_what_is_missing() {
    let folder = exported();
    for arguments in [&["import", "run.log", "a.mcap"][..], &["import", "run.log", "b.mcap", "--scenario", "run.toml"]]
    {
        assert_eq!(resonarm(folder.path(), arguments).code, 0);
    }
    assert_snapshot!(complaint(folder.path(), 2, &["resim", "a.mcap"]), @"resonarm: the recording was imported from run.log and holds only frames; a re-simulation needs the states and loads of the run (/plant/steps) and its scenario; use `replay` to play the frames");
    assert_snapshot!(complaint(folder.path(), 2, &["resim", "b.mcap"]), @"resonarm: the recording was imported from run.log and holds only frames; a re-simulation needs the states and loads of the run (/plant/steps); use `replay` to play the frames");
}

#[test]
fn logs_that_cannot_be_imported_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let said = |name: &str, log: &str, arguments: &[&str]| {
        fs::write(folder.path().join(name), log).unwrap();
        let said = complaint(folder.path(), 2, &[&["import", name, "new.mcap"], arguments].concat());
        assert!(!folder.path().join("new.mcap").exists(), "a recording is left: {said}");
        said
    };
    assert_snapshot!(said("a.log", "", &[]), @"resonarm: a.log has no frames");
    assert_snapshot!(said("a.log", "(1.0) can0 123#00\n", &["--interface", "can7"]), @"resonarm: a.log has no frames of interface can7");
    // A program that was stopped for 150 ms finds frames in its queue that are older than that.
    fs::write(folder.path().join("early.log"), "(1.0) can0 123#00\n(0.8) can0 124#00\n").unwrap();
    let early = resonarm(folder.path(), &["import", "early.log", "early.mcap"]);
    assert_snapshot!(early.stdout, @"early.mcap: 2 frames of 0.200 s; left out 0 of other interfaces and 0 lines or objects that are no frames");
    assert_snapshot!(said("a.log", "(1.0) can0 123#00\n(0.5) can0 123#00\n", &[]), @"resonarm: a.log: frame 2 is 500000000 ns earlier than the first: the log is not in order");
    assert_snapshot!(said("a.log", "\n  can0  123   [1]  00\n", &[]), @"resonarm: a.log has no frames; a.log, line 2: the line has no time stamp: log with `candump -L`, or with `candump -t a` instead of `candump`");
    assert_snapshot!(said("a.trc", "", &[]), @"resonarm: a.trc: `import` does not read .trc: convert it by `python -m can.logconvert a.trc NEW.blf` and import that, or call `resonarm.import_log` of the Python package");
    assert_snapshot!(said("a.txt", "(1.0) can0 123#00\n", &[]), @"resonarm: a.txt: the ending of the name does not state the format: give it by --from, one of candump, asc, blf");
    assert_snapshot!(said("a.blf", "LOGG", &[]), @"resonarm: a.blf, byte 0: the log is cut short: expected 4 more bytes, got 0");
    // A log is read twice, and a pipe can be read only once.
    assert!(Command::new("mkfifo").arg(folder.path().join("pipe")).status().unwrap().success());
    let from_pipe = ["import", "pipe", "new.mcap", "--from", "candump"];
    assert_snapshot!(complaint(folder.path(), 2, &from_pipe), @"resonarm: can't read pipe: it is a named pipe, expected a regular file, since a log is read twice");
    let mut piped = Command::new(env!("CARGO_BIN_EXE_resonarm"))
        .args(["import", "/dev/stdin", "new.mcap", "--from", "candump"])
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A program that refuses the pipe need not read it.
    let _refused = piped.stdin.take().unwrap().write_all(b"(1.0) can0 123#00\n");
    let piped = piped.wait_with_output().unwrap();
    let message = String::from_utf8(piped.stderr).unwrap();
    assert_eq!((piped.status.code(), folder.path().join("new.mcap").exists()), (Some(2), false), "{message}");
    // A log is not overwritten with its recording.
    fs::write(folder.path().join("a.log"), "(1.0) can0 123#00\n").unwrap();
    assert_snapshot!(complaint(folder.path(), 2, &["import", "a.log", "a.log", "--overwrite"]), @"resonarm: recording `a.log` can't be written over itself: name another file for the result");
    assert_eq!(fs::read_to_string(folder.path().join("a.log")).unwrap(), "(1.0) can0 123#00\n");
    fs::remove_file(folder.path().join("a.log")).unwrap();
    assert_snapshot!(complaint(folder.path(), 2, &["import", "a.log", "new.mcap"]), @"resonarm: can't read a.log: No such file or directory (os error 2)");
}

#[test]
fn a_single_line_without_a_frame_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    // Bit 29 of the identifier marks the report of a controller, which is no frame.
    fs::write(folder.path().join("a.log"), "(1.0) can0 123#00\n(1.5) can0 20000040#00\n(1.75) can0 123#00\n").unwrap();
    let said = resonarm(folder.path(), &["import", "a.log", "a.mcap"]);
    assert_snapshot!(said.stdout, @"a.mcap: 2 frames of 0.750 s; left out 0 of other interfaces and 1 line or object that is no frame");
}

#[test]
fn a_line_that_is_none_is_counted_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.log"), "(1.0) can0 123#00\n(1.5) can1 123#00\n(1.75) can0 101#0").unwrap();
    let said = resonarm(folder.path(), &["import", "a.log", "a.mcap"]);
    assert_snapshot!(said.stdout, @r"
    a.mcap: 1 frame of 0.000 s; left out 1 of other interfaces and 0 lines or objects that are no frames
    imported interface can0; the others are can1: choose one by --interface
    left out 1 line or object that can't be read; the first: a.log, line 3: the data must be pairs of hexadecimal digits
    ");
    assert_eq!((said.code, frames(&folder.path().join("a.mcap")).len()), (1, 1));
}

#[test]
fn one_interface_of_several() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.log"), "(1.0) can0 123#00\n(1.5) can1 201#00\n(1.75) can0 7FF#R\n").unwrap();
    let said = resonarm(folder.path(), &["import", "a.log", "a.mcap", "--interface", "can0"]);
    assert_snapshot!(said.stdout, @r"
    a.mcap: 2 frames of 0.750 s; left out 1 of other interfaces and 0 lines or objects that are no frames
    imported interface can0; the others are can1: choose one by --interface
    ");
    let one = resonarm(folder.path(), &["import", "a.log", "b.mcap", "--interface", "can1"]);
    assert_snapshot!(one.stdout, @r"
    b.mcap: 1 frame of 0.000 s; left out 2 of other interfaces and 0 lines or objects that are no frames
    imported interface can1; the others are can0: choose one by --interface
    ");
    // Without a scenario samples are taken to last 1 ms.
    assert_eq!(frames(&folder.path().join("a.mcap")).iter().map(|frame| frame.sample).collect::<Vec<_>>(), [0, 750]);
}
