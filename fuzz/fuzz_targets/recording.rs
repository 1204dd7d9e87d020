//! Any file as a recording: it is refused, or read to its end or to an error, and recovered likewise.
#![no_main]

use std::fs;

use libfuzzer_sys::fuzz_target;
use resonarm::recording::{Existing, Recording, recover};

fuzz_target!(|bytes: &[u8]| {
    let folder = std::env::temp_dir().join(format!("resonarm-fuzz-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder for the file");
    let (damaged, repaired) = (folder.join("damaged.mcap"), folder.join("repaired.mcap"));
    fs::write(&damaged, bytes).expect("the file");
    if let Ok(recording) = Recording::open(&damaged) {
        let _ = recording.summary();
        let _ = recording.records().map(|records| records.take_while(Result::is_ok).count());
    }
    if recover(&damaged, &repaired, Existing::Overwrite).is_ok() {
        let recording = Recording::open(&repaired).expect("what was recovered can be opened");
        let records = recording.records().expect("its records");
        records.for_each(|record| drop(record.expect("a whole record")));
    }
});
