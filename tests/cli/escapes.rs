//! Control characters in foreign files: on a terminal they could move the cursor, rename its window or hide lines.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use insta::assert_snapshot;
use resonarm::recording::{Configuration, Event, Options, Record, Recorder};

use crate::{CommandResult, document, resonarm};

/// A title for the window in a control sequence of seven bits, one of eight, a line that overwrites itself, an override
/// of the direction of writing, and a forged line.
const HOSTILE: &str = "\u{1b}]0;owned\u{7}\u{9b}2J\rgood\u{202e}dab\u{7f}\nintegrity    complete";

/// A recording with `name` as its bus, a key and an event.
fn record(path: &Path, name: &str) {
    let configuration = Configuration::new().with("scenario", name).with("key", name).with(name, "value");
    let recorder = Recorder::create(path, &configuration, Options::virtual_time(1e-3, name)).unwrap();
    let mut channel = recorder.channel("plant", 16).unwrap();
    let event: &'static str = String::from(name).leak();
    let event = Event { sample: 0, time_ns: 0, name: event, value: 0 };
    channel.push_blocking(&Record::Event(event)).unwrap();
    recorder.finish(&[("frames", name.to_owned())]).unwrap();
}

/// Checks that a terminal receives only text.
fn check(arguments: &[&str], outcome: &CommandResult) {
    for text in [&outcome.stdout, &outcome.stderr] {
        let control = |letter: &char| letter.is_control() && !matches!(letter, '\n' | '\t') || *letter == '\u{202e}';
        assert_eq!(text.chars().find(control), None, "{arguments:?}: {text:?}");
    }
    assert!(outcome.stdout.contains("owned") || outcome.stderr.contains("owned"), "{arguments:?}");
}

#[test]
fn names_in_a_recording_are_escaped() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder.path().join("hostile.mcap"), HOSTILE);
    record(&folder.path().join("other.mcap"), "harmless");
    for arguments in [
        ["inspect", "hostile.mcap"].as_slice(),
        &["inspect", "hostile.mcap", "--statistics"],
        &["inspect", "hostile.mcap", "--statistics", "--json"],
        &["diff", "hostile.mcap", "other.mcap", "--parts", "events"],
        &["diff", "hostile.mcap", "other.mcap", "--parts", "events", "--json"],
        &["resim", "hostile.mcap"],
    ] {
        check(arguments, &resonarm(folder.path(), arguments));
    }
    let summary = document(folder.path(), 0, &["inspect", "hostile.mcap", "--json"]);
    assert_eq!(summary["origin"]["interface"], HOSTILE, "a document has the very name");
    let text = resonarm(folder.path(), &["inspect", "hostile.mcap", "--statistics"]).stdout;
    let is_shown = |line: &&str| line.starts_with("bus ") || line.starts_with("frames ") || line.starts_with('\\');
    assert_snapshot!(text.lines().filter(is_shown).collect::<Vec<_>>().join("\n"), @r"
    bus          \u{1b}]0;owned\u{7}\u{9b}2J\rgood\u{202e}dab\u{7f}\nintegrity    complete
    frames       \u{1b}]0;owned\u{7}\u{9b}2J\rgood\u{202e}dab\u{7f}\nintegrity    complete
    \u{1b}]0;owned\u{7}\u{9b}2J\rgood\u{202e}dab\u{7f}\nintegrity    complete            1
    \u{1b}]0;owned\u{7}\u{9b}2J\rgood\u{202e}dab\u{7f}
    \u{1b}]0;owned\u{7}\u{9b}2J\rgood\u{202e}dab\u{7f}
    ");
    assert_eq!(text.lines().filter(|line| line.starts_with("integrity ")).count(), 3, "its line, and in two documents");
}

#[test]
fn names_in_a_damaged_or_foreign_file_are_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile.mcap");
    let mut writer = mcap::WriteOptions::new().library(HOSTILE).create(std::io::Cursor::new(Vec::new())).unwrap();
    writer.finish().unwrap();
    fs::write(&path, writer.into_inner().into_inner()).unwrap();
    for arguments in [["inspect", "hostile.mcap"].as_slice(), &["recover", "hostile.mcap", "new.mcap"]] {
        check(arguments, &resonarm(folder.path(), arguments));
    }
    // The cause of damage, in a warning and in a verdict: an unknown compression.
    fs::remove_file(&path).unwrap();
    record(&path, "owned");
    let mut bytes = fs::read(&path).unwrap();
    let place = bytes.windows(8).position(|bytes| bytes == b"\x04\0\0\0zstd").unwrap();
    bytes[place + 4..place + 8].copy_from_slice(b"\x1b[2J");
    fs::write(&path, bytes).unwrap();
    for arguments in [
        ["inspect", "hostile.mcap"].as_slice(),
        &["diff", "hostile.mcap", "hostile.mcap"],
        &["export", "hostile.mcap", "--to", "csv"],
        &["recover", "hostile.mcap", "new.mcap"],
    ] {
        let CommandResult { stdout, stderr, .. } = resonarm(folder.path(), arguments);
        assert!(!stdout.contains('\x1b') && !stderr.contains('\x1b'), "{arguments:?}: {stdout:?}{stderr:?}");
        assert!(stdout.contains(r"\u{1b}[2J") || stderr.contains(r"\u{1b}[2J"), "{arguments:?}: {stdout}{stderr}");
    }
}

#[test]
fn names_in_a_log_are_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let name = "\u{1b}]0;owned\u{7}\u{9b}2J\u{202e}";
    fs::write(folder.path().join("two.log"), format!("(1.0) {name} 123#00\n(1.1) can0 123#00\n")).unwrap();
    fs::write(folder.path().join("time.log"), format!("({name}) can0 123#00\n")).unwrap();
    fs::write(folder.path().join("date.asc"), format!("date {name}\n")).unwrap();
    for log in ["two.log", "time.log", "date.asc"] {
        let arguments = ["import", log, "new.mcap"];
        check(&arguments, &resonarm(folder.path(), &arguments));
    }
    for (line, is_json) in [(format!("(1.0) {name} 123#00\n"), false), (format!("(1.0) {name} 123#00\n"), true)] {
        let arguments = ["protocol", "decode", "--json"];
        let mut decode = Command::new(env!("CARGO_BIN_EXE_resonarm"))
            .args(if is_json { &arguments[..] } else { &arguments[..2] })
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        decode.stdin.take().unwrap().write_all(line.as_bytes()).unwrap();
        let output = decode.wait_with_output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        let code = output.status.code().unwrap();
        check(&arguments, &CommandResult { code, stdout: text(output.stdout), stderr: text(output.stderr) });
    }
}
