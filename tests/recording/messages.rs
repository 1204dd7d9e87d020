//! Messages to users.

use std::fs;

use resonarm::recording::{
    Compression, Configuration, Existing, FlushPolicy, Integrity, Options, Recorder, Recording, RecordingError, recover,
};

use crate::{TestResult, options, record, records_of, run};

/// The error, without the directory of the test.
fn text<T>(result: Result<T, RecordingError>, directory: &tempfile::TempDir) -> TestResult<String> {
    match result {
        Ok(_) => Err("no error".into()),
        Err(error) => Ok(error.to_string().replace(&format!("{}/", directory.path().display()), "")),
    }
}

#[test]
fn of_files_that_cannot_be_created() -> TestResult {
    let directory = tempfile::tempdir()?;
    let create = |name: &str| Recorder::create(directory.path().join(name), &Configuration::new(), options());
    let _there = create("run.mcap")?;
    insta::assert_snapshot!(text(create("run.mcap"), &directory)?, @"recording `run.mcap` already exists: name another file, or allow overwriting it (--overwrite)");
    insta::assert_snapshot!(text(create("missing/run.mcap"), &directory)?, @"can't create recording `missing/run.mcap`: No such file or directory (os error 2); name a file in a directory that exists and is writable");
    fs::create_dir(directory.path().join("folder"))?;
    let overwrite = Options { existing: Existing::Overwrite, ..options() };
    let onto = Recorder::create(directory.path().join("folder"), &Configuration::new(), overwrite);
    insta::assert_snapshot!(text(onto, &directory)?, @"can't create recording `folder`: Is a directory (os error 21); name a file in a directory that exists and is writable");
    Ok(())
}

#[test]
fn of_options_that_make_no_sense() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let create = |options| text(Recorder::create(&path, &Configuration::new(), options), &directory);
    insta::assert_snapshot!(create(Options { dt_s: f64::NAN, ..options() })?, @"recording option `dt_s` is NaN, expected a finite time above 0 s");
    insta::assert_snapshot!(create(Options { dt_s: -1e300, ..options() })?, @"recording option `dt_s` is -1e300, expected a finite time above 0 s");
    insta::assert_snapshot!(create(Options { dt_s: 0.0, ..options() })?, @"recording option `dt_s` is 0, expected a finite time above 0 s");
    insta::assert_snapshot!(create(Options { batch_samples: 0, ..options() })?, @"recording option `batch_samples` is 0, expected from 1 to 100000");
    insta::assert_snapshot!(create(Options { batch_samples: 100_001, ..options() })?, @"recording option `batch_samples` is 100001, expected from 1 to 100000");
    insta::assert_snapshot!(create(Options { plot_every_samples: 1001, ..options() })?, @"recording option `plot_every_samples` is 1001, expected at most 1000");
    insta::assert_snapshot!(create(Options { flush: FlushPolicy::Samples(0), ..options() })?, @"recording option `flush` is every 0 samples, expected at least 1");
    assert!(!path.exists(), "a refusal has made a file");
    let recorder = Recorder::create(&path, &Configuration::new(), options())?;
    insta::assert_snapshot!(text(recorder.channel("plant", 0), &directory)?, @"recording option `capacity` is 0, expected at least 1 record");
    Ok(())
}

#[test]
fn of_files_that_are_no_recordings() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("file");
    let open = |bytes: &[u8]| -> TestResult<String> {
        fs::write(&path, bytes)?;
        text(Recording::open(&path), &directory)
    };
    insta::assert_snapshot!(open(b"")?, @"`file` is not an MCAP file: it begins with nothing (it is empty)");
    insta::assert_snapshot!(open(b"(0.1) vcan0 123#00\n")?, @"`file` is not an MCAP file: it begins with `(0.1) vc`");
    insta::assert_snapshot!(open(mcap::MAGIC)?, @"recording `file` can't be read beyond byte 8, before its metadata `resonarm.recording`, so nothing of it can be recovered");
    let mut other = mcap::Writer::new(std::io::Cursor::new(Vec::new()))?;
    other.finish()?;
    let said = open(&other.into_inner().into_inner())?;
    insta::assert_snapshot!(said.split(", but by `mcap").next().unwrap_or_default(), @"`file` is an MCAP file without metadata `resonarm.recording`: it was not recorded by resonarm");
    insta::assert_snapshot!(text(Recording::open(directory.path().join("missing")), &directory)?, @"can't read recording `missing`: No such file or directory (os error 2)");
    insta::assert_snapshot!(text(Recording::open(directory.path()), &directory)?.replace(&directory.path().display().to_string(), "folder"), @"can't read recording `folder`: it is a folder, expected a regular file");
    Ok(())
}

/// A file with the given metadata `resonarm.recording` and one topic.
fn foreign(about: &[(&str, &str)], topic: &str, schema: &str) -> TestResult<Vec<u8>> {
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
fn of_recordings_of_another_kind() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let delay = ("reading_delay_samples", "2.5");
    let good = [("format", "5"), ("dt_s", "0.001"), ("time", "simulated"), ("plot_every_samples", "10"), delay];
    let open = |about: &[(&str, &str)], topic: &str, schema: &str| -> Result<Recording, RecordingError> {
        let bytes = foreign(about, topic, schema).unwrap_or_default();
        let _written = fs::write(&path, bytes);
        Recording::open(&path)
    };
    let (topic, schema) = ("/can/frames", "resonarm.v1.FrameBatch");
    let recording = open(&good, topic, schema)?;
    insta::assert_snapshot!(text(recording.states(), &directory)?, @"recording `run.mcap` has no topic `/plant/steps`: another tool has removed it; use the original file");
    insta::assert_snapshot!(text(open(&[("format", "6"), ("version", "9.1.0")], topic, "acme.Samples"), &directory)?, @"recording `run.mcap` has format 6, written by resonarm 9.1.0, but this program, resonarm 0.1.0, reads format 5; read it with the program that wrote it");
    insta::assert_snapshot!(text(open(&[("format", "2"), ("version", "0.0.9")], topic, schema), &directory)?, @"recording `run.mcap` has format 2, written by resonarm 0.0.9, but this program, resonarm 0.1.0, reads format 5; read it with the program that wrote it");
    insta::assert_snapshot!(text(open(&[("format", "three")], topic, schema), &directory)?, @"recording `run.mcap` states `format` as `three` in its metadata `resonarm.recording`, expected a version of the format");
    insta::assert_snapshot!(text(open(&[("format", "5")], topic, schema), &directory)?, @"recording `run.mcap` states `dt_s` as `` in its metadata `resonarm.recording`, expected a time in s");
    insta::assert_snapshot!(text(open(&[("format", "5"), ("dt_s", "-1")], topic, schema), &directory)?, @"recording `run.mcap` states `dt_s` as `-1` in its metadata `resonarm.recording`, expected a finite time above 0 s");
    insta::assert_snapshot!(text(open(&good, topic, "acme.Samples"), &directory)?, @"recording `run.mcap` has messages `acme.Samples (protobuf)` in topic `/can/frames`, expected `resonarm.v1.FrameBatch (protobuf)`; read it with the version of resonarm that wrote it");
    Ok(())
}

#[test]
fn of_gaps() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let records = [0, 1, 2, 7, 8, 20].map(|sample| records_of(sample).map(|records| records[0]));
    record(&path, options(), &records.into_iter().collect::<Result<Vec<_>, _>>()?)?;
    let recording = Recording::open(&path)?;
    insta::assert_snapshot!(text(recording.states(), &directory)?, @"recording `run.mcap` is not continuous in topic `/plant/steps`: expected sample 3, got sample 7 (2 such gaps in all); the run lost records, or the file was recovered from a damaged one");
    assert_eq!(recording.records()?.count(), 6);
    Ok(())
}

/// The text with `N` for every word that begins with a digit.
fn without_numbers(text: &str) -> String {
    let word = |word: &str| match word.find(|letter: char| !letter.is_alphanumeric()) {
        end if word.starts_with(|letter: char| letter.is_numeric()) => {
            format!("N{}", &word[end.unwrap_or(word.len())..])
        }
        _ => word.to_string(),
    };
    text.split_inclusive(' ').map(word).collect()
}

#[test]
fn of_integrity() -> TestResult {
    let directory = tempfile::tempdir()?;
    let (path, cut) = (directory.path().join("run.mcap"), directory.path().join("cut.mcap"));
    let options = Options { compression: Compression::None, flush: FlushPolicy::Samples(50), ..options() };
    record(&path, options, &run(200)?)?;
    let integrity = |bytes: &[u8]| -> TestResult<String> {
        fs::write(&cut, bytes)?;
        Ok(Recording::open(&cut)?.integrity().to_string())
    };
    let mut bytes = fs::read(&path)?;
    let whole = bytes.clone();
    assert_eq!(integrity(&whole)?, "complete");
    // The number of bytes depends on the commit and the compiler, named in the head, so the snapshot leaves it out.
    let half = &whole[..whole.len() / 2];
    insta::assert_snapshot!(without_numbers(&integrity(half)?), @"truncated: N of N bytes can be read, up to sample N");
    insta::assert_snapshot!(without_numbers(&integrity(&whole[..1200])?), @"truncated: N of N bytes can be read, which contain no sample");
    bytes[whole.len() / 2] ^= 1;
    insta::assert_snapshot!(without_numbers(&integrity(&bytes)?), @"damaged at byte N of N (the checksum is N, expected N): the records before it can be read, up to sample N");
    fs::write(&cut, half)?;
    if let Integrity::Truncated { readable_bytes, .. } = Recording::open(&cut)?.integrity() {
        bytes.truncate(*readable_bytes as usize); // what a lost power supply leaves: the length is there, the data is not
        bytes.extend([0; 500]);
    }
    insta::assert_snapshot!(without_numbers(&integrity(&bytes)?), @"damaged at byte N of N (a record with opcode N): the records before it can be read, up to sample N");
    bytes = whole;
    bytes.push(0);
    insta::assert_snapshot!(without_numbers(&integrity(&bytes)?), @"damaged at byte N of N (file has more bytes after end magic): the records before it can be read, up to sample N");
    Ok(())
}

#[test]
fn of_recoveries() -> TestResult {
    let directory = tempfile::tempdir()?;
    let (path, cut) = (directory.path().join("run.mcap"), directory.path().join("cut.mcap"));
    record(&path, options(), &run(200)?)?;
    insta::assert_snapshot!(text(recover(&path, &cut, Existing::Refuse), &directory)?, @"recording `run.mcap` is whole: there is nothing to recover");
    let bytes = fs::read(&path)?;
    fs::write(&cut, &bytes[..bytes.len() / 2])?;
    insta::assert_snapshot!(text(recover(&cut, &cut, Existing::Overwrite), &directory)?, @"recording `cut.mcap` can't be written over itself: name another file for the result");
    assert_eq!(fs::metadata(&cut)?.len(), bytes.len() as u64 / 2);
    Ok(())
}
