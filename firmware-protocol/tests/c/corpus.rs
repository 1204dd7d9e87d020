//! The golden frames as inputs of the fuzzer, `c/fuzz`.

use std::path::{Path, PathBuf};
use std::process::Command;

use resonarm_protocol::{FrameFormat, Id};
use serde_json::Value;

use super::{build, common};

/// A file for each case of the golden frames: the profile, and a record for each frame. Every second file asks for the
/// right CRC of what the fuzzer changes.
fn write_corpus() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("corpus");
    std::fs::create_dir_all(&folder).unwrap();
    let mut files = Vec::new();
    for (profile, text) in
        [include_str!("../../vectors/classic.json"), include_str!("../../vectors/fd.json")].into_iter().enumerate()
    {
        let held: Value = serde_json::from_str(text).unwrap();
        for (number, case) in held["cases"].as_array().unwrap().iter().enumerate() {
            let mut input = vec![profile as u8];
            for step in case["steps"].as_array().unwrap() {
                let frame = common::frame(step["frame"].as_str().unwrap());
                let format = match frame.format() {
                    FrameFormat::Classic => 0,
                    FrameFormat::Remote => 1,
                    FrameFormat::Fd { .. } => 2,
                };
                let extended = u8::from(matches!(frame.id(), Id::Extended(_))) << 2;
                let protected = u8::from(number % 2 == 1) << 3;
                let [low, high, ..] = frame.id().raw().to_le_bytes();
                input.extend([1, format | extended | protected, low, high, frame.data().len() as u8]);
                input.extend(frame.data());
            }
            let path = folder.join(format!("{profile}-{number}"));
            std::fs::write(&path, input).unwrap();
            files.push(path);
        }
    }
    files
}

#[test]
fn a_node_stands_golden_frames_changed_at_random() {
    let files = write_corpus();
    assert!(files.len() > 50, "{}", files.len());
    let output = Command::new(build("fuzz_node")).args(["1", "200"]).args(files).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
