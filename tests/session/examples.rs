//! The examples that run a session do what they say.

use std::path::{Path, PathBuf};
use std::process::Command;

/// `cargo test` builds the examples beside the tests.
fn example(name: &str) -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent().and_then(Path::parent).unwrap().join("examples").join(name)
}

fn succeeds(name: &str, arguments: &[&str]) -> String {
    let output = Command::new(example(name)).args(arguments).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{name}: {said}{}", String::from_utf8_lossy(&output.stderr));
    said
}

#[test]
fn a_controller_of_ones_own_damps_a_vibration() {
    assert!(succeeds("controller", &[]).contains("with the controller"));
}

#[test]
fn a_recording_is_simulated_again() {
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/free-sweep.mcap");
    assert!(succeeds("resimulate", &[recording]).ends_with("identical: true\n"));
}
