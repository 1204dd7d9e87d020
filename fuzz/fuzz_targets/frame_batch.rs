//! Any message as a batch of frames, in a recording whose checksums are right: it is refused or read without panic.
#![no_main]

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;

use libfuzzer_sys::fuzz_target;
use mcap::records::{MessageHeader, Record};
use resonarm::recording::Recording;

/// A recording from which the metadata are taken.
const RECORDING: &[u8] = include_bytes!("../../recordings/free-sweep.mcap");

fuzz_target!(|message: &[u8]| {
    let folder = std::env::temp_dir().join(format!("resonarm-fuzz-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder for the file");
    let path = folder.join("frames.mcap");
    let file = BufWriter::new(File::create(&path).expect("the file"));
    let mut writer = mcap::WriteOptions::new().library("resonarm fuzz").create(file).expect("the head");
    for record in mcap::read::LinearReader::new(RECORDING).expect("the reference recording") {
        if let Record::Metadata(metadata) = record.expect("a whole record") {
            writer.write_metadata(&metadata).expect("the metadata");
        }
    }
    // The reader goes by the name of the schema, so that its text can be left out.
    let schema = writer.add_schema("resonarm.v1.FrameBatch", "protobuf", &[]).expect("the schema");
    let id = writer.add_channel(schema, "/can/frames", "protobuf", &BTreeMap::new()).expect("the topic");
    let header = MessageHeader { channel_id: id, sequence: 0, log_time: 0, publish_time: 0 };
    writer.write_to_known_channel(&header, message).expect("the message");
    writer.finish().expect("the end");
    drop(writer);
    let recording = Recording::open(&path).expect("the metadata are right");
    let _ = recording.records().map(|records| records.take_while(Result::is_ok).count());
});
