//! Files cut short and damaged: said precisely, and everything before is given.

use std::fs;
use std::path::Path;

use proptest::prelude::*;
use resonarm::recording::{Existing, FlushPolicy, Integrity, Options, Recording, RecordingError, StepRecord, recover};

use crate::{Outcome, options, record, run};

const STEPS: u64 = 300;

/// The bytes of a recording of 300 steps in chunks of 50.
fn bytes(directory: &Path) -> Outcome<Vec<u8>> {
    let path = directory.join("whole.mcap");
    record(&path, Options { flush: FlushPolicy::Steps(50), ..options() }, &run(STEPS)?)?;
    Ok(fs::read(path)?)
}

/// The steps that were recorded.
fn steps_recorded() -> Outcome<Vec<StepRecord>> {
    let step = |step| match crate::records_of(step)?[0] {
        resonarm::recording::Record::Step(record) => Ok(record),
        other => Err(format!("{other:?} is not a step").into()),
    };
    (0..STEPS).map(step).collect()
}

/// Reads all that can be read; whatever comes must be a beginning of what was recorded. Returns how many steps came.
fn read(path: &Path, recorded: &[StepRecord]) -> Outcome<usize> {
    let Ok(recording) = Recording::open(path) else { return Ok(0) };
    let steps = recording.steps()?.collect::<Result<Vec<_>, _>>()?;
    assert!(recorded.starts_with(&steps), "steps that were never recorded");
    for record in recording.records()? {
        record?;
    }
    Ok(steps.len())
}

#[test]
fn every_cut_gives_what_was_flushed_before() -> Outcome {
    let directory = tempfile::tempdir()?;
    let whole = bytes(directory.path())?;
    let recorded = steps_recorded()?;
    let path = directory.path().join("cut.mcap");
    let mut most = 0;
    for length in (0..whole.len()).step_by(61) {
        fs::write(&path, &whole[..length])?;
        let steps = read(&path, &recorded)?;
        assert!(steps >= most && steps.is_multiple_of(50), "{steps} steps in {length} bytes, {most} in fewer");
        most = steps;
        if let Ok(recording) = Recording::open(&path) {
            let Integrity::Truncated { readable_bytes, file_bytes, last_step } = recording.integrity() else {
                return Err(format!("{length} bytes are {:?}", recording.integrity()).into());
            };
            assert_eq!(*file_bytes, length as u64);
            assert!(readable_bytes <= file_bytes);
            assert_eq!(last_step.map_or(0, |last| last + 1), steps as u64);
        }
    }
    assert_eq!(most, recorded.len());
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..ProptestConfig::default() })]

    /// One byte anywhere: seen, or of no consequence.
    #[test]
    fn a_wrong_byte_gives_no_wrong_record(flips in prop::collection::vec((any::<prop::sample::Index>(), 1..=255_u8), 100)) {
        let directory = tempfile::tempdir()?;
        let fail = |error: Box<dyn std::error::Error>| TestCaseError::fail(error.to_string());
        let whole = bytes(directory.path()).map_err(fail)?;
        let recorded = steps_recorded().map_err(fail)?;
        let path = directory.path().join("flipped.mcap");
        for (index, flip) in flips {
            let mut bytes = whole.clone();
            bytes[index.index(whole.len())] ^= flip;
            fs::write(&path, &bytes)?;
            // A byte that hides a whole chunk is seen as a gap: an error, and no wrong record either.
            let _seen = read(&path, &recorded);
            if let Ok(recording) = Recording::open(&path) {
                prop_assert_ne!(recording.integrity(), &Integrity::Complete, "byte {}", index.index(whole.len()));
            }
        }
    }

    /// Bytes that only begin like a recording.
    #[test]
    fn garbage_never_panics(length in 0..5000_usize, garbage in prop::collection::vec(any::<u8>(), 0..3000)) {
        let directory = tempfile::tempdir()?;
        let fail = |error: Box<dyn std::error::Error>| TestCaseError::fail(error.to_string());
        let mut bytes = bytes(directory.path()).map_err(fail)?;
        bytes.truncate(length);
        bytes.extend(garbage);
        let path = directory.path().join("garbage.mcap");
        fs::write(&path, &bytes)?;
        read(&path, &steps_recorded().map_err(fail)?).map_err(fail)?;
    }
}

#[test]
fn a_cut_recording_is_recovered_whole() -> Outcome {
    let directory = tempfile::tempdir()?;
    let whole = bytes(directory.path())?;
    let (cut, mended) = (directory.path().join("cut.mcap"), directory.path().join("mended.mcap"));
    fs::write(&cut, &whole[..whole.len() * 2 / 3])?;
    let before = Recording::open(&cut)?;
    let recovered = recover(&cut, &mended, Existing::Refuse)?;
    assert_eq!(&recovered.source, before.integrity());
    assert_eq!(recovered.bytes, fs::metadata(&mended)?.len());
    let after = Recording::open(&mended)?;
    assert_eq!(after.integrity(), &Integrity::Unfinished);
    assert_eq!((after.origin(), after.configuration()), (before.origin(), before.configuration()));
    assert_eq!(after.summary().topics, before.summary().topics);
    let steps = after.steps()?.collect::<Result<Vec<_>, _>>()?;
    assert!(steps.len() >= 100 && steps_recorded()?.starts_with(&steps));
    Ok(())
}

/// Metadata carry no checksum: a wrong character in them is seen only when they are read.
#[test]
fn a_recording_that_could_not_be_opened_is_not_recovered() -> Outcome {
    let directory = tempfile::tempdir()?;
    let mut whole = bytes(directory.path())?;
    let (cut, mended) = (directory.path().join("cut.mcap"), directory.path().join("mended.mcap"));
    let key = b"start_unix_ns";
    let place = whole.windows(key.len()).position(|bytes| bytes == key).ok_or("no such key")?;
    whole[place + key.len() + 4] = b'x';
    fs::write(&cut, &whole[..whole.len() * 2 / 3])?;
    let message = |error: RecordingError| error.to_string().replace(&directory.path().display().to_string(), "DIR");
    let refused = recover(&cut, &mended, Existing::Refuse).map_err(message);
    assert_eq!(refused.as_ref().err(), Recording::open(&cut).map_err(message).err().as_ref());
    assert!(refused.is_err_and(|message| message.contains("start_unix_ns")) && !mended.exists());
    Ok(())
}
