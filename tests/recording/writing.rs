//! The writer: same bytes for the same records, nothing lost unseen.

use std::fs;
use std::path::Path;

use resonarm::recording::{Existing, FlushPolicy, Options, Pushed, Record, Recorder, Recording, RecordingError, Topic};

use crate::{Outcome, configuration, options, record, records_of, run};

#[test]
fn the_same_records_give_the_same_bytes() -> Outcome {
    let directory = tempfile::tempdir()?;
    let (one, two) = (directory.path().join("one.mcap"), directory.path().join("two.mcap"));
    let records = run(2500)?;
    let summary = record(&one, options(), &records)?;
    record(&two, options(), &records)?;
    let bytes = fs::read(&one)?;
    assert!(bytes == fs::read(&two)?, "two recordings of the same records differ");
    assert_eq!(summary.bytes, bytes.len() as u64);
    assert_eq!(summary.samples, 2500);
    assert_eq!(summary.messages_in(Topic::States), 5);
    assert_eq!(summary.messages_in(Topic::State), 250);
    assert_eq!(summary.messages_in(Topic::Frames), 5);
    assert_eq!(summary.lost["plant"], 0);
    Ok(())
}

#[test]
fn a_full_channel_loses_records_and_says_so() -> Outcome {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let recorder = Recorder::create(&path, &configuration(), options())?;
    let mut channel = recorder.channel("plant", 2)?;
    let (mut stored, mut lost) = (0, 0);
    for sample in 0..20_000 {
        match channel.push(records_of(sample)?[0]) {
            Pushed::Stored => stored += 1,
            Pushed::Lost => lost += 1,
        }
    }
    channel.push_blocking(records_of(20_000)?[0])?; // so that what was lost lies between two samples
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
fn several_channels_keep_the_order_of_each() -> Outcome {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let recorder = Recorder::create(&path, &configuration(), options())?;
    std::thread::scope(|scope| {
        let threads = ["plant", "exciter"].map(|name| {
            let mut channel = recorder.channel(name, 64)?;
            let wanted = move |record: &Record| matches!(record, Record::State(_)) == (name == "plant");
            Ok::<_, RecordingError>(scope.spawn(move || {
                let records = run(500).map_err(|error| error.to_string())?;
                let pushed = records.into_iter().filter(wanted).try_for_each(|record| channel.push_blocking(record));
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
    assert_eq!(recording.frames()?.count(), 1000);
    Ok(())
}

#[test]
fn a_dropped_recorder_leaves_a_whole_file() -> Outcome {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let recorder = Recorder::create(&path, &configuration(), options())?;
    let mut channel = recorder.channel("plant", 64)?;
    run(10)?.into_iter().try_for_each(|record| channel.push_blocking(record))?;
    drop(recorder);
    let recording = Recording::open(&path)?;
    assert_eq!(recording.states()?.count(), 10);
    assert!(matches!(channel.push_blocking(records_of(10)?[0]), Err(RecordingError::Finished { .. })));
    Ok(())
}

/// `/dev/full` takes no byte: every write fails as on a full disk.
#[test]
fn a_full_disk_is_reported_at_once() -> Outcome {
    let full = Options { existing: Existing::Overwrite, ..options() };
    match Recorder::create("/dev/full", &configuration(), full) {
        Err(error @ RecordingError::Write { .. }) => {
            insta::assert_snapshot!(error, @"can't write recording `/dev/full`: No space left on device (os error 28); what was flushed before can be read");
            Ok(())
        }
        other => Err(format!("expected a failure to write, got {other:?}").into()),
    }
}

/// A pipe takes the head of the file and refuses what comes once nobody reads it: as a disk that fills up during the
/// run.
#[test]
fn a_failure_during_the_run_reaches_the_producer_and_the_end() -> Outcome {
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
        records.into_iter().find_map(|record| channel.push_blocking(record).err())
    });
    let expected = "Broken pipe";
    assert!(refused.is_some_and(|error| error.to_string().contains(expected)));
    assert!(recorder.failure().is_some_and(|error| error.to_string().contains(expected)));
    assert!(recorder.channel("late", 16).is_err_and(|error| error.to_string().contains(expected)));
    assert!(recorder.finish(&[]).is_err_and(|error| error.to_string().contains(expected)));
    Ok(())
}

#[test]
fn refuses_to_overwrite_unless_asked() -> Outcome {
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

/// What happens to a file while it is written.
enum Lost {
    File,
    Replaced,
    Folder,
}

#[test]
fn a_recording_that_was_deleted_or_replaced_meanwhile_is_said() -> Outcome {
    let directory = tempfile::tempdir()?;
    for (number, lost) in [Lost::File, Lost::Replaced, Lost::Folder].into_iter().enumerate() {
        let folder = directory.path().join(number.to_string());
        fs::create_dir(&folder)?;
        let path = folder.join("run.mcap");
        let options = Options { existing: Existing::Overwrite, ..options() };
        let recorder = Recorder::create(&path, &configuration(), options)?;
        let mut channel = recorder.channel("plant", 64)?;
        run(10)?.into_iter().try_for_each(|record| channel.push_blocking(record))?;
        match lost {
            Lost::File => fs::remove_file(&path)?,
            Lost::Replaced => fs::remove_file(&path).and_then(|()| fs::write(&path, "something else"))?,
            Lost::Folder => fs::remove_dir_all(&folder)?,
        }
        let error = recorder.finish(&[]).err().ok_or("a file that is gone was called written")?.to_string();
        assert_eq!(
            error.replace(&folder.display().to_string(), "DIR"),
            "recording `DIR/run.mcap` was deleted, moved or replaced while it was written: what was recorded is not there"
        );
    }
    Ok(())
}
