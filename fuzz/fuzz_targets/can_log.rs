//! Any file as a log of CAN frames: it is refused, or imported, and then every frame of it is in the recording.
//!
//! The first byte chooses the format.
#![no_main]

use std::fs;

use libfuzzer_sys::fuzz_target;
use resonarm::can_log::LogFormat;
use resonarm::import::{ImportOptions, SampleClock, import};
use resonarm::recording::{Existing, Recording};

fuzz_target!(|input: &[u8]| {
    let Some((&first, log)) = input.split_first() else { return };
    let format = LogFormat::ALL[usize::from(first) % LogFormat::ALL.len()];
    let folder = std::env::temp_dir().join(format!("resonarm-fuzz-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder for the files");
    let (path, imported) = (folder.join("log"), folder.join("imported.mcap"));
    fs::write(&path, log).expect("the log");
    let options =
        ImportOptions { scenario: None, interface: None, existing: Existing::Overwrite, clock: SampleClock::default() };
    if let Ok(done) = import(&path, format, &imported, &options) {
        let recording = Recording::open(&imported).expect("what was imported can be opened");
        let frames = recording.frames().expect("its frames").map(|frame| frame.expect("a whole frame"));
        assert_eq!(frames.count() as u64, done.frames);
    }
});
