//! What users are told.

use std::fs;

use resonarm::recording::{
    Configuration, Existing, FlushPolicy, Options, Recorder, Recording, RecordingError, recover,
};

use crate::{Outcome, options, record, records_of, run};

/// The error, with the directory of the test taken out.
fn text<T>(result: Result<T, RecordingError>, directory: &tempfile::TempDir) -> Outcome<String> {
    match result {
        Ok(_) => Err("no error".into()),
        Err(error) => Ok(error.to_string().replace(&format!("{}/", directory.path().display()), "")),
    }
}

#[test]
fn of_files_that_cannot_be_created() -> Outcome {
    let directory = tempfile::tempdir()?;
    let create = |name: &str| Recorder::create(directory.path().join(name), &Configuration::new(), options());
    create("run.mcap")?;
    insta::assert_snapshot!(text(create("run.mcap"), &directory)?, @"");
    insta::assert_snapshot!(text(create("missing/run.mcap"), &directory)?, @"");
    fs::create_dir(directory.path().join("folder"))?;
    let overwrite = Options { existing: Existing::Overwrite, ..options() };
    let onto = Recorder::create(directory.path().join("folder"), &Configuration::new(), overwrite);
    insta::assert_snapshot!(text(onto, &directory)?, @"");
    Ok(())
}

#[test]
fn of_options_that_make_no_sense() -> Outcome {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let create = |options| text(Recorder::create(&path, &Configuration::new(), options), &directory);
    insta::assert_snapshot!(create(Options { dt_s: f64::NAN, ..options() })?, @"");
    insta::assert_snapshot!(create(Options { dt_s: 0.0, ..options() })?, @"");
    insta::assert_snapshot!(create(Options { batch_steps: 0, ..options() })?, @"");
    insta::assert_snapshot!(create(Options { plot_every_steps: 0, ..options() })?, @"");
    insta::assert_snapshot!(create(Options { flush: FlushPolicy::Steps(0), ..options() })?, @"");
    assert!(!path.exists(), "a refusal has made a file");
    let recorder = Recorder::create(&path, &Configuration::new(), options())?;
    insta::assert_snapshot!(text(recorder.channel("plant", 0), &directory)?, @"");
    Ok(())
}

#[test]
fn of_files_that_are_no_recordings() -> Outcome {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("file");
    let open = |bytes: &[u8]| -> Outcome<String> {
        fs::write(&path, bytes)?;
        text(Recording::open(&path), &directory)
    };
    insta::assert_snapshot!(open(b"")?, @"");
    insta::assert_snapshot!(open(b"(0.1) vcan0 123#00\n")?, @"");
    insta::assert_snapshot!(open(mcap::MAGIC)?, @"");
    let mut other = mcap::Writer::new(std::io::Cursor::new(Vec::new()))?;
    other.finish()?;
    insta::assert_snapshot!(open(&other.into_inner().into_inner())?, @"");
    insta::assert_snapshot!(text(Recording::open(directory.path().join("missing")), &directory)?, @"");
    insta::assert_snapshot!(text(Recording::open(directory.path()), &directory)?.replace(&directory.path().display().to_string(), "folder"), @"");
    Ok(())
}

/// A file with the given metadata `resonarm.recording` and one topic.
fn foreign(about: &[(&str, &str)], topic: &str, schema: &str) -> Outcome<Vec<u8>> {
    let options = mcap::WriteOptions::new().compression(None);
    let mut writer = options.create(std::io::Cursor::new(Vec::new()))?;
    let metadata = about.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
    writer.write_metadata(&mcap::records::Metadata { name: "resonarm.recording".into(), metadata })?;
    writer.write_metadata(&mcap::records::Metadata { name: "resonarm.configuration".into(), metadata: [].into() })?;
    let schema = writer.add_schema(schema, "protobuf", &[])?;
    writer.add_channel(schema, topic, "protobuf", &[].into())?;
    writer.finish()?;
    Ok(writer.into_inner().into_inner())
}

#[test]
fn of_recordings_of_another_kind() -> Outcome {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let good = [("format", "1"), ("dt_s", "0.001"), ("interface", "vcan0"), ("start_unix_ns", "0")];
    let open = |about: &[(&str, &str)], topic: &str, schema: &str| -> Result<Recording, RecordingError> {
        let bytes = foreign(about, topic, schema).unwrap_or_default();
        let _written = fs::write(&path, bytes);
        Recording::open(&path)
    };
    let (topic, schema) = ("/plant/samples", "resonarm.v1.SampleBatch");
    let recording = open(&good, topic, schema)?;
    insta::assert_snapshot!(text(recording.steps(), &directory)?, @"");
    insta::assert_snapshot!(text(open(&[("format", "2")], topic, schema), &directory)?, @"");
    insta::assert_snapshot!(text(open(&[("format", "1")], topic, schema), &directory)?, @"");
    insta::assert_snapshot!(text(open(&[("format", "1"), ("dt_s", "-1")], topic, schema), &directory)?, @"");
    insta::assert_snapshot!(text(open(&good, topic, "acme.Samples"), &directory)?, @"");
    Ok(())
}

#[test]
fn of_gaps() -> Outcome {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let records = [0, 1, 2, 7, 8, 20].map(|step| records_of(step).map(|records| records[0]));
    record(&path, options(), &records.into_iter().collect::<Result<Vec<_>, _>>()?)?;
    let recording = Recording::open(&path)?;
    insta::assert_snapshot!(text(recording.steps(), &directory)?, @"");
    assert_eq!(recording.records()?.count(), 6);
    Ok(())
}

#[test]
fn of_recoveries() -> Outcome {
    let directory = tempfile::tempdir()?;
    let (path, cut) = (directory.path().join("run.mcap"), directory.path().join("cut.mcap"));
    record(&path, options(), &run(200)?)?;
    insta::assert_snapshot!(text(recover(&path, &cut, Existing::Refuse), &directory)?, @"");
    let bytes = fs::read(&path)?;
    fs::write(&cut, &bytes[..bytes.len() / 2])?;
    insta::assert_snapshot!(text(recover(&cut, &cut, Existing::Overwrite), &directory)?, @"");
    assert_eq!(fs::metadata(&cut)?.len(), bytes.len() as u64 / 2);
    Ok(())
}
