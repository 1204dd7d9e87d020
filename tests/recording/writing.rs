//! The writer: same bytes for the same records, and every loss is reported.

use std::fs;
use std::path::Path;

use resonarm::cut::cut;
use resonarm::recording::{
    Event, Existing, FlushPolicy, Integrity, Options, Pushed, Record, Recorder, Recording, RecordingError, Topic,
    recover,
};

use crate::{TestResult, configuration, options, record, records_of, run};

#[test]
fn the_same_records_give_the_same_bytes() -> TestResult {
    let directory = tempfile::tempdir()?;
    let (one, two) = (directory.path().join("one.mcap"), directory.path().join("two.mcap"));
    let records = run(2500)?;
    let summary = record(&one, options(), &records)?;
    record(&two, options(), &records)?;
    let bytes = fs::read(&one)?;
    assert!(bytes == fs::read(&two)?, "two recordings of the same records differ");
    assert_eq!(summary.bytes, bytes.len() as u64);
    assert_eq!(summary.samples, 2500);
    // Batches hold 500 samples, and a plot topic has a message every tenth sample.
    assert_eq!(summary.messages[Topic::States.name()], 5);
    assert_eq!(summary.messages[Topic::State.name()], 250);
    assert_eq!(summary.messages[Topic::Frames.name()], 5);
    assert_eq!(summary.lost["plant"], 0);
    Ok(())
}

#[test]
fn a_full_channel_loses_records_and_says_so() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let recorder = Recorder::create(&path, &configuration(), options())?;
    let mut channel = recorder.channel("plant", 2)?;
    let (mut stored, mut lost) = (0, 0);
    for sample in 0..20_000 {
        match channel.push(&records_of(sample)?[0]) {
            Pushed::Stored => stored += 1,
            Pushed::Lost => lost += 1,
        }
    }
    channel.push_blocking(&records_of(20_000)?[0])?; // so that what was lost lies between two samples
    stored += 1;
    let summary = recorder.finish(&[])?;
    assert!(lost > 0, "a channel of 2 records kept up with 20000");
    assert_eq!((summary.samples, summary.lost["plant"], channel.lost()), (stored, lost, lost));

    let recording = Recording::open(&path)?;
    assert_eq!(recording.summary().lost["plant"], lost);
    let mut reported = 0;
    for event in recording.events()? {
        let event = event?;
        assert_eq!(event.name, "recording.lost.plant");
        reported += event.value as u64;
    }
    assert_eq!(reported, lost);
    assert!(matches!(recording.states(), Err(RecordingError::Gap { .. })));
    assert_eq!(recording.records()?.filter(|record| matches!(record, Ok(Record::State(_)))).count() as u64, stored);
    Ok(())
}

#[test]
fn several_channels_keep_the_order_of_each() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let recorder = Recorder::create(&path, &configuration(), options())?;
    std::thread::scope(|scope| {
        let threads = ["plant", "exciter"].map(|name| {
            let mut channel = recorder.channel(name, 64)?;
            let wanted = move |record: &Record| matches!(record, Record::State(_)) == (name == "plant");
            Ok::<_, RecordingError>(scope.spawn(move || {
                let records = run(500).map_err(|error| error.to_string())?;
                let pushed = records.into_iter().filter(wanted).try_for_each(|record| channel.push_blocking(&record));
                pushed.map_err(|error| error.to_string())
            }))
        });
        for thread in threads {
            thread?.join().map_err(|_| "a thread has died")??;
        }
        Ok::<_, Box<dyn std::error::Error>>(())
    })?;
    let summary = recorder.finish(&[])?;
    assert_eq!(summary.lost.into_iter().collect::<Vec<_>>(), [("exciter".into(), 0), ("plant".into(), 0)]);
    let recording = Recording::open(&path)?;
    assert_eq!(recording.states()?.count(), 500);
    assert_eq!(recording.samples()?.count(), 500);
    // A command and its answer for each sample.
    assert_eq!(recording.frames()?.count(), 1000);
    Ok(())
}

/// The records are there, and the end is missing.
#[test]
fn an_abandoned_recording_does_not_look_whole() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let recorder = Recorder::create(&path, &configuration(), options())?;
    let mut channel = recorder.channel("plant", 64)?;
    run(10)?.into_iter().try_for_each(|record| channel.push_blocking(&record))?;
    drop(recorder);
    let recording = Recording::open(&path)?;
    let Integrity::Truncated { last_sample, .. } = recording.integrity() else {
        return Err(format!("given up, but {:?}", recording.integrity()).into());
    };
    assert_eq!((recording.states()?.count(), *last_sample), (10, Some(9)));
    assert!(matches!(channel.push_blocking(&records_of(10)?[0]), Err(RecordingError::Finished { .. })));
    Ok(())
}

/// Nothing was recorded: the name is free for another try, and a file to be overwritten is still there.
#[test]
fn an_abandoned_recording_without_a_record_leaves_nothing() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let overwrite = Options { existing: Existing::Overwrite, ..options() };
    for options in [options(), overwrite.clone()] {
        drop(Recorder::create(&path, &configuration(), options)?);
        assert_eq!(fs::read_dir(directory.path())?.count(), 0);
    }
    fs::write(&path, "what was there")?;
    drop(Recorder::create(&path, &configuration(), overwrite.clone())?);
    assert_eq!(fs::read_to_string(&path)?, "what was there");
    assert_eq!(fs::read_dir(directory.path())?.count(), 1);
    // With the first record the file replaces the existing one.
    record(&path, overwrite, &run(3)?)?;
    assert_eq!(Recording::open(&path)?.states()?.count(), 3);
    assert_eq!(fs::read_dir(directory.path())?.count(), 1);
    Ok(())
}

/// A recording made from others gets its name when it is whole, or never.
#[test]
fn a_cut_that_fails_leaves_what_was_there() -> TestResult {
    let directory = tempfile::tempdir()?;
    let (path, part) = (directory.path().join("run.mcap"), directory.path().join("part.mcap"));
    // More names of events than are copied, after states that are.
    let names = (0..1001).map(|name| &*format!("event.{name}").leak());
    let event = |name| Record::Event(Event { sample: 50, time_ns: 0, name, value: 0 });
    record(&path, options(), &run(50)?.into_iter().chain(names.map(event)).collect::<Vec<_>>())?;
    let recording = Recording::open(&path)?;
    let failed = cut(&recording, 0..=u64::MAX, &part, Existing::Refuse);
    assert!(matches!(failed, Err(RecordingError::Names { .. })), "{failed:?}");
    assert!(!part.exists());
    fs::write(&part, "what was there")?;
    let failed = cut(&recording, 0..=u64::MAX, &part, Existing::Overwrite);
    assert!(matches!(failed, Err(RecordingError::Names { .. })), "{failed:?}");
    assert_eq!(fs::read_to_string(&part)?, "what was there");
    assert_eq!(fs::read_dir(directory.path())?.count(), 2, "a part of a file is left");
    Ok(())
}

/// Left by a process with the same id, as processes in containers have.
#[test]
fn a_partial_file_left_by_a_killed_process_is_no_obstacle() -> TestResult {
    let directory = tempfile::tempdir()?;
    let (path, part) = (directory.path().join("run.mcap"), directory.path().join("part.mcap"));
    record(&path, options(), &run(50)?)?;
    let whole = fs::read(&path)?;
    fs::write(&path, &whole[..whole.len() - 100])?;
    for left in [".part", ".0.part", ".1.part"] {
        fs::write(directory.path().join(format!(".part.mcap.{}{left}", std::process::id())), "left")?;
        recover(&path, &part, Existing::Overwrite)?;
        assert_eq!(Recording::open(&part)?.states()?.count(), 50);
        assert_eq!(cut(&Recording::open(&path)?, 0..=9, &part, Existing::Overwrite)?.samples, 10);
        assert_eq!(Recording::open(&part)?.states()?.count(), 10);
    }
    Ok(())
}

/// `/dev/full` takes no byte: every write fails as on a full disk.
#[test]
fn a_full_disk_is_reported_at_once() -> TestResult {
    let full = Options { existing: Existing::Overwrite, ..options() };
    match Recorder::create("/dev/full", &configuration(), full) {
        Err(error @ RecordingError::Write { .. }) => {
            insta::assert_snapshot!(error, @"can't write recording `/dev/full`: No space left on device (os error 28)");
            Ok(())
        }
        other => Err(format!("expected a failure to write, got {other:?}").into()),
    }
}

/// A pipe takes the head of the file and refuses the rest once nobody reads it, like a disk that fills up during the
/// run.
#[test]
fn a_failure_during_the_run_reaches_the_producer_and_the_end() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&path).status()?;
    assert!(made.success());
    let reader = {
        let path = path.clone();
        std::thread::spawn(move || fs::File::open(path)) // opening either end waits for the other
    };
    let piped = Options { existing: Existing::Overwrite, flush: FlushPolicy::Samples(10), ..options() };
    let recorder = Recorder::create(&path, &configuration(), piped)?;
    drop(reader.join().map_err(|_| "the reader has died")??);
    let mut channel = recorder.channel("plant", 16)?;
    let refused = (0..100_000).find_map(|sample| {
        let records = records_of(sample).ok()?;
        records.into_iter().find_map(|record| channel.push_blocking(&record).err())
    });
    let expected = "Broken pipe";
    assert!(refused.is_some_and(|error| error.to_string().contains(expected)));
    assert!(recorder.failure().is_some_and(|error| error.to_string().contains(expected)));
    assert!(recorder.channel("late", 16).is_err_and(|error| error.to_string().contains(expected)));
    assert!(recorder.finish(&[]).is_err_and(|error| error.to_string().contains(expected)));
    Ok(())
}

#[test]
fn refuses_to_overwrite_unless_asked() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path: &Path = &directory.path().join("run.mcap");
    record(path, options(), &run(3)?)?;
    let before = fs::read(path)?;
    assert!(matches!(Recorder::create(path, &configuration(), options()), Err(RecordingError::Exists { .. })));
    assert!(fs::read(path)? == before, "a refusal has changed the file");
    record(path, Options { existing: Existing::Overwrite, ..options() }, &run(5)?)?;
    assert_eq!(Recording::open(path)?.states()?.count(), 5);
    Ok(())
}

/// Changes of a file while it is written.
enum Lost {
    File,
    Replaced,
    Folder,
}

#[test]
fn a_recording_deleted_or_replaced_meanwhile_is_reported() -> TestResult {
    let directory = tempfile::tempdir()?;
    for (number, lost) in [Lost::File, Lost::Replaced, Lost::Folder].into_iter().enumerate() {
        let folder = directory.path().join(number.to_string());
        fs::create_dir(&folder)?;
        let path = folder.join("run.mcap");
        let options = Options { existing: Existing::Overwrite, ..options() };
        let recorder = Recorder::create(&path, &configuration(), options)?;
        let mut channel = recorder.channel("plant", 64)?;
        run(10)?.into_iter().try_for_each(|record| channel.push_blocking(&record))?;
        match lost {
            Lost::File => fs::remove_file(&path)?,
            Lost::Replaced => fs::remove_file(&path).and_then(|()| fs::write(&path, "something else"))?,
            Lost::Folder => fs::remove_dir_all(&folder)?,
        }
        let error = recorder.finish(&[]).err().ok_or("a file that is gone was called written")?.to_string();
        assert_eq!(
            error.replace(&folder.display().to_string(), "DIR"),
            "recording `DIR/run.mcap` was deleted, moved or replaced while it was written, so its records are lost"
        );
    }
    Ok(())
}
