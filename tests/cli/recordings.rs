//! Recordings that can't be written or read, and what is said of those that are not whole or not true.

use std::fs::{self, OpenOptions};
use std::path::Path;

use insta::assert_snapshot;
use resonarm::recording::{Options, Record, Recorder, Recording};

use crate::{complaint, document, resonarm};

/// Long enough for more than one chunk: in virtual time there is one every 1000 steps.
const RUN: [&str; 7] = ["run", "--mode", "free", "--duration-s", "2.5", "--record", "run.mcap"];

/// A folder with the recording of a run.
fn recorded() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(resonarm(folder.path(), &RUN).code, 0);
    folder
}

#[test]
fn a_place_where_nothing_can_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let run = ["run", "--mode", "free", "--duration-s", "0.5", "--record", "no/such/folder/run.mcap"];
    assert_snapshot!(complaint(folder.path(), 2, &run), @"resonarm: can't create recording `no/such/folder/run.mcap`: No such file or directory (os error 2); name a file in a directory that exists and is writable");
}

#[test]
fn a_recording_that_exists_is_kept_until_it_is_given_up() {
    let folder = recorded();
    let path = folder.path().join("run.mcap");
    let before = fs::read(&path).unwrap();
    assert_snapshot!(complaint(folder.path(), 2, &RUN), @"resonarm: recording `run.mcap` already exists: name another file, or allow overwriting it (--overwrite)");
    assert_eq!(fs::read(&path).unwrap(), before);
    fs::write(&path, "something else").unwrap();
    assert_eq!(resonarm(folder.path(), &[RUN.as_slice(), &["--overwrite"]].concat()).code, 0);
    assert_eq!(fs::read(&path).unwrap(), before);
}

#[test]
fn a_truncated_recording_is_used_as_far_as_it_goes() {
    let folder = recorded();
    let path = folder.path().join("run.mcap");
    let whole = document(folder.path(), 0, &["inspect", "run.mcap", "--json"]);
    assert_eq!(whole["integrity"]["state"], "complete");
    let length = fs::metadata(&path).unwrap().len();
    OpenOptions::new().write(true).open(&path).unwrap().set_len(length * 3 / 4).unwrap();

    let cut = document(folder.path(), 1, &["inspect", "run.mcap", "--json"]);
    assert_eq!(cut["integrity"]["state"], "truncated");
    let steps = cut["topics"]["/plant/steps"]["records"].as_u64().unwrap();
    assert!((1000..2500).contains(&steps), "{steps}");
    let resim = resonarm(folder.path(), &["resim", "run.mcap"]);
    assert_eq!((resim.code, resim.stdout), (0, format!("identical: {steps} steps, bit for bit\n")));
    assert!(resim.stderr.contains("WARN the recording is truncated: "), "{}", resim.stderr);

    let recovered = resonarm(folder.path(), &["recover", "run.mcap", "whole.mcap"]);
    assert_eq!((recovered.code, recovered.stderr.as_str()), (0, ""));
    assert!(recovered.stdout.starts_with("the recording is truncated: "), "{}", recovered.stdout);
    let mended = document(folder.path(), 1, &["inspect", "whole.mcap", "--json"]);
    assert_eq!((&mended["integrity"]["state"], &mended["topics"]), (&"unfinished".into(), &cut["topics"]));
    let resim = resonarm(folder.path(), &["resim", "whole.mcap"]);
    assert_eq!((resim.code, resim.stdout), (0, format!("identical: {steps} steps, bit for bit\n")));
    assert_snapshot!(complaint(folder.path(), 2, &["recover", "run.mcap", "whole.mcap"]), @"resonarm: recording `whole.mcap` already exists: name another file, or allow overwriting it (--overwrite)");
    assert_snapshot!(complaint(folder.path(), 2, &["recover", "whole.mcap", "again.mcap"]), @"resonarm: recording `whole.mcap` is whole: there is nothing to recover");
    assert_snapshot!(complaint(folder.path(), 2, &["recover", "run.mcap", "run.mcap"]), @"resonarm: recording `run.mcap` can't be recovered onto itself: name another file for the result");
    let again = document(folder.path(), 0, &["recover", "run.mcap", "whole.mcap", "--overwrite", "--json"]);
    assert_eq!(again["source"], cut["integrity"]);
}

#[test]
fn files_that_are_no_recordings() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("notes.txt"), "no recording").unwrap();
    for command in [["inspect", "notes.txt"].as_slice(), &["resim", "notes.txt"], &["recover", "notes.txt", "new.mcap"]]
    {
        assert_eq!(
            complaint(folder.path(), 2, command),
            "resonarm: `notes.txt` is not an MCAP file: it begins with `no recor`\n"
        );
    }
    assert_snapshot!(complaint(folder.path(), 2, &["resim", "none.mcap"]), @"resonarm: can't read recording `none.mcap`: No such file or directory (os error 2)");
    assert_snapshot!(complaint(folder.path(), 2, &["replay", "none.mcap", "--bus", "vcan0"]), @"resonarm: can't read recording `none.mcap`: No such file or directory (os error 2)");
}

/// The recording once more, with one state off by one unit in its last place.
fn doctor(from: &Path, to: &Path, step: u64) {
    let recording = Recording::open(from).unwrap();
    let options = Options::virtual_time(recording.origin().dt_s, "none");
    let recorder = Recorder::create(to, recording.configuration(), options).unwrap();
    let mut channel = recorder.channel("plant", 1024).unwrap();
    for record in recording.steps().unwrap() {
        let mut record = record.unwrap();
        if record.step == step {
            record.alpha_rad[0] = record.alpha_rad[0].next_up();
        }
        channel.push_blocking(Record::Step(record)).unwrap();
    }
    recorder.finish(&[]).unwrap();
}

#[test]
fn a_state_that_is_off_by_a_bit_is_found() {
    let folder = recorded();
    doctor(&folder.path().join("run.mcap"), &folder.path().join("doctored.mcap"), 321);
    let verdict = document(folder.path(), 1, &["resim", "doctored.mcap", "--json"]);
    assert_eq!((&verdict["identical"], &verdict["first_divergence"]), (&false.into(), &321.into()));
    let drift_rad = verdict["max_drift_rad"].as_f64().unwrap();
    assert!(drift_rad > 0.0 && drift_rad < 1e-15, "{drift_rad:e}");
    let said = resonarm(folder.path(), &["resim", "doctored.mcap"]);
    assert_eq!(said.code, 1);
    assert!(said.stdout.starts_with("differs from step 321 on; "), "{}", said.stdout);
}
