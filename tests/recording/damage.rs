//! Truncated and damaged files: reported precisely, and everything before the damage is read.

use std::fs;
use std::ops::Range;
use std::path::Path;

use proptest::prelude::*;
use resonarm::recording::{Existing, FlushPolicy, Integrity, Options, Recording, RecordingError, StateRecord, recover};

use crate::{TestResult, options, record, rewritten, run};

const SAMPLES: u64 = 300;

/// The bytes of a recording of 300 samples in chunks of 50.
fn bytes(directory: &Path) -> TestResult<Vec<u8>> {
    let path = directory.join("whole.mcap");
    record(&path, Options { flush: FlushPolicy::Samples(50), ..options() }, &run(SAMPLES)?)?;
    Ok(fs::read(path)?)
}

/// The states that were recorded.
fn states_recorded() -> TestResult<Vec<StateRecord>> {
    let state = |sample| match crate::records_of(sample)?[0] {
        resonarm::recording::Record::State(record) => Ok(record),
        other => Err(format!("{other:?} is not a state").into()),
    };
    (0..SAMPLES).map(state).collect()
}

/// Reads all readable states, which must be the beginning of those recorded. Returns their number.
fn read(path: &Path, recorded: &[StateRecord]) -> TestResult<usize> {
    Recording::open(path).map_or(Ok(0), |recording| read_opened(&recording, recorded))
}

/// [`read`] of a recording that is open.
fn read_opened(recording: &Recording, recorded: &[StateRecord]) -> TestResult<usize> {
    let states = recording.states()?.collect::<Result<Vec<_>, _>>()?;
    assert!(recorded.starts_with(&states), "states that were never recorded");
    for record in recording.records()? {
        record?;
    }
    Ok(states.len())
}

#[test]
fn every_cut_gives_what_was_flushed_before() -> TestResult {
    let directory = tempfile::tempdir()?;
    let whole = bytes(directory.path())?;
    let recorded = states_recorded()?;
    let path = directory.path().join("cut.mcap");
    let mut most = 0;
    // A prime number, so that the cuts come anywhere in records and not at their borders alone.
    for length in (0..whole.len()).step_by(61) {
        fs::write(&path, &whole[..length])?;
        let samples = read(&path, &recorded)?;
        // A chunk that is cut off is not read in part, as its checksum is of the whole.
        assert!(samples >= most && samples.is_multiple_of(50), "{samples} samples in {length} bytes, {most} in fewer");
        most = samples;
        if let Ok(recording) = Recording::open(&path) {
            let Integrity::Truncated { readable_bytes, file_bytes, last_sample } = recording.integrity() else {
                return Err(format!("{length} bytes are {:?}", recording.integrity()).into());
            };
            assert_eq!(*file_bytes, length as u64);
            assert!(readable_bytes <= file_bytes);
            assert_eq!(last_sample.map_or(0, |last| last + 1), samples as u64);
        }
    }
    assert_eq!(most, recorded.len());
    Ok(())
}

/// The copies of the schemas at the end of a file have no checksum: the recovered file has those that the messages were
/// read with.
#[test]
fn a_wrong_number_in_a_schema_is_not_recovered() -> TestResult {
    let directory = tempfile::tempdir()?;
    let (whole, recorded) = (bytes(directory.path())?, states_recorded()?);
    let name = b"torque2_nm";
    let places: Vec<usize> =
        whole.windows(name.len()).enumerate().filter(|(_, window)| window == name).map(|(place, _)| place).collect();
    assert!(places.len() > 1, "{places:?}");
    for place in places {
        let mut bytes = whole.clone();
        // Behind the name: the tag of the field's number, and the number.
        assert_eq!(bytes[place + name.len()], 0x18);
        bytes[place + name.len() + 1] ^= 71;
        let (path, repaired) = (directory.path().join("damaged.mcap"), directory.path().join("repaired.mcap"));
        fs::write(&path, &bytes)?;
        assert!(matches!(Recording::open(&path)?.integrity(), Integrity::Damaged { .. }), "{place}");
        recover(&path, &repaired, Existing::Overwrite)?;
        let repaired = Recording::open(&repaired)?;
        assert_eq!(*repaired.integrity(), Integrity::Unfinished, "{place}");
        assert_eq!(repaired.states()?.collect::<Result<Vec<_>, _>>()?, recorded);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..ProptestConfig::default() })]

    /// One wrong byte anywhere is detected or has no effect.
    #[test]
    fn a_wrong_byte_gives_no_wrong_record(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 1..=255_u8), 100),
    ) {
        let directory = tempfile::tempdir()?;
        let fail = |error: Box<dyn std::error::Error>| TestCaseError::fail(error.to_string());
        let whole = bytes(directory.path()).map_err(fail)?;
        let recorded = states_recorded().map_err(fail)?;
        let path = directory.path().join("flipped.mcap");
        for (index, flip) in flips {
            let mut bytes = whole.clone();
            bytes[index.index(whole.len())] ^= flip;
            fs::write(&path, &bytes)?;
            if let Ok(recording) = Recording::open(&path) {
                // A byte that hides a whole chunk shows as a gap: an error, and no wrong record either.
                let _seen = read_opened(&recording, &recorded);
                prop_assert_ne!(recording.integrity(), &Integrity::Complete, "byte {}", index.index(whole.len()));
            }
        }
    }

    /// Whatever the damage, a recovered file can be read, and holds only recorded states.
    #[test]
    fn what_is_recovered_was_recorded(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 1..=255_u8), 1..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let directory = tempfile::tempdir()?;
        let fail = |error: Box<dyn std::error::Error>| TestCaseError::fail(error.to_string());
        let mut bytes = bytes(directory.path()).map_err(fail)?;
        let recorded = states_recorded().map_err(fail)?;
        for (index, flip) in flips {
            let place = index.index(bytes.len());
            bytes[place] ^= flip;
        }
        bytes.truncate(cut.map_or(bytes.len(), |cut| cut.index(bytes.len())));
        let (path, repaired) = (directory.path().join("damaged.mcap"), directory.path().join("repaired.mcap"));
        fs::write(&path, &bytes)?;
        if recover(&path, &repaired, Existing::Refuse).is_ok() {
            let recording = Recording::open(&repaired)?;
            prop_assert_eq!(recording.integrity(), &Integrity::Unfinished);
            for record in recording.records()? {
                if let resonarm::recording::Record::State(state) = record? {
                    prop_assert_eq!(Some(&state), recorded.get(state.sample as usize));
                }
            }
        } else {
            prop_assert!(!repaired.exists());
        }
        prop_assert_eq!(fs::read_dir(directory.path())?.count(), 2 + usize::from(repaired.exists()));
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
        read(&path, &states_recorded().map_err(fail)?).map_err(fail)?;
    }
}

#[test]
fn a_cut_recording_is_recovered_whole() -> TestResult {
    let directory = tempfile::tempdir()?;
    let whole = bytes(directory.path())?;
    let (cut, repaired) = (directory.path().join("cut.mcap"), directory.path().join("repaired.mcap"));
    fs::write(&cut, &whole[..whole.len() * 2 / 3])?;
    let before = Recording::open(&cut)?;
    let recovered = recover(&cut, &repaired, Existing::Refuse)?;
    assert_eq!(&recovered.source, before.integrity());
    assert_eq!(recovered.bytes, fs::metadata(&repaired)?.len());
    let after = Recording::open(&repaired)?;
    assert_eq!(after.integrity(), &Integrity::Unfinished);
    assert_eq!((after.origin(), after.configuration()), (before.origin(), before.configuration()));
    assert_eq!(after.summary().topics, before.summary().topics);
    let states = after.states()?.collect::<Result<Vec<_>, _>>()?;
    assert!(states.len() >= 100 && states_recorded()?.starts_with(&states));
    Ok(())
}

/// Metadata have no checksum: a wrong character in them is detected only when they are read.
#[test]
fn a_recording_that_could_not_be_opened_is_not_recovered() -> TestResult {
    let directory = tempfile::tempdir()?;
    let mut whole = bytes(directory.path())?;
    let (cut, repaired) = (directory.path().join("cut.mcap"), directory.path().join("repaired.mcap"));
    let key = b"dt_s";
    let place = whole.windows(key.len()).position(|bytes| bytes == key).ok_or("no such key")?;
    // Between key and value are the four bytes of the length of the value.
    whole[place + key.len() + 4] = b'x';
    fs::write(&cut, &whole[..whole.len() * 2 / 3])?;
    let message = |error: RecordingError| error.to_string().replace(&directory.path().display().to_string(), "DIR");
    let refused = recover(&cut, &repaired, Existing::Refuse).map_err(message);
    assert_eq!(refused.as_ref().err(), Recording::open(&cut).map_err(message).err().as_ref());
    assert!(refused.is_err_and(|message| message.contains("dt_s")) && !repaired.exists());
    Ok(())
}

/// One wrong byte anywhere in a chunk, its length and opcode included, loses only that chunk.
#[test]
fn one_wrong_byte_costs_one_chunk() -> TestResult {
    let directory = tempfile::tempdir()?;
    let whole = bytes(directory.path())?;
    let (path, repaired) = (directory.path().join("damaged.mcap"), directory.path().join("repaired.mcap"));
    let recorded = states_recorded()?;
    let second = chunk(&whole, 1).ok_or("no second chunk")?;
    let middle = usize::midpoint(second.start, second.end);
    // A record begins with an opcode of one byte and a length of eight.
    for place in (second.start..second.start + 9).chain([second.start + 50, middle]) {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x41;
        fs::write(&path, &bytes)?;
        let recovered = recover(&path, &repaired, Existing::Overwrite)?;
        let samples = Recording::open(&repaired)?.records()?.filter_map(|record| match record {
            Ok(resonarm::recording::Record::State(state)) => Some(state.sample),
            _ => None,
        });
        let samples: Vec<_> = samples.collect();
        let expected: Vec<_> = (0..recorded.len() as u64).filter(|sample| !(50..100).contains(sample)).collect();
        assert_eq!(samples, expected, "byte {} of the chunk: {recovered:?}", place - second.start);
        let missing: Vec<_> = recovered.missing_samples.iter().map(|missing| (missing.first, missing.last)).collect();
        assert_eq!(missing, [(50, 99)], "byte {} of the chunk", place - second.start);
    }
    Ok(())
}

/// The range of the chunk with this number.
fn chunk(bytes: &[u8], number: usize) -> Option<Range<usize>> {
    const CHUNK: u8 = 0x06; // MCAP specification, "Chunk"
    records(bytes).filter(|record| bytes[record.start] == CHUNK).nth(number)
}

/// The ranges of the records of a file.
fn records(bytes: &[u8]) -> impl Iterator<Item = Range<usize>> {
    let mut offset = mcap::MAGIC.len();
    std::iter::from_fn(move || {
        // Behind the opcode; it counts neither the opcode nor itself.
        let length = u64::from_le_bytes(bytes.get(offset + 1..offset + 9)?.try_into().ok()?);
        let record = offset..offset + 9 + usize::try_from(length).ok()?;
        offset = record.end;
        Some(record)
    })
}

/// A wrong byte in the opcode, the length, or the beginning, middle or end of the content of every record.
#[test]
fn a_wrong_byte_in_any_record_is_an_error() -> TestResult {
    let directory = tempfile::tempdir()?;
    let whole = bytes(directory.path())?;
    let recorded = states_recorded()?;
    let path = directory.path().join("flipped.mcap");
    let places: Vec<usize> = records(&whole)
        .flat_map(|record| {
            let (start, end) = (record.start, record.end);
            [start, start + 1, start + 8, start + 9, usize::midpoint(start + 9, end), end - 1]
        })
        .filter(|place| *place < whole.len())
        .collect();
    assert!(places.len() > 6 * 30, "{} places", places.len());
    for place in places {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x15;
        fs::write(&path, &bytes)?;
        match Recording::open(&path) {
            Ok(recording) => {
                assert_ne!(recording.integrity(), &Integrity::Complete, "byte {place}");
                let _seen = read_opened(&recording, &recorded);
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    Ok(())
}

/// Invalid messages with correct checksums, as another program may write them: truncated, and with a wrong byte.
#[test]
fn a_wrong_message_is_refused_or_read() -> TestResult {
    let directory = tempfile::tempdir()?;
    let (path, altered) = (directory.path().join("whole.mcap"), directory.path().join("altered.mcap"));
    record(&path, Options { batch_samples: 10, ..options() }, &run(60)?)?;
    for topic in ["/plant/steps", "/plant/samples", "/can/frames", "/timing/ticks", "/events"] {
        let mut refused = 0;
        for place in 0..120 {
            let mut change = |of: &str, data: &mut Vec<u8>| {
                if of == topic && place % 2 == 0 {
                    data.truncate(data.len().saturating_sub(1 + place));
                } else if let (true, Some(byte)) = (of == topic, data.get_mut(place)) {
                    *byte ^= 0x91;
                }
            };
            fs::write(&altered, rewritten(&path, &mut change)?)?;
            match Recording::open(&altered) {
                Ok(recording) if matches!(recording.integrity(), Integrity::Damaged { .. }) => refused += 1,
                Ok(recording) => recording.records()?.for_each(drop),
                Err(_) => refused += 1,
            }
        }
        // A wrong byte in a number mostly makes another valid number, so not all are refused.
        assert!(refused > 20, "{topic}: {refused} of 120 refused");
    }
    Ok(())
}

/// A recording whose chunk is `records`, compressed, and states a length once decompressed.
fn with_chunk(path: &Path, records: &[u8], states: u64) -> TestResult<String> {
    record(path, Options { existing: Existing::Overwrite, ..options() }, &run(3)?)?;
    let whole = fs::read(path)?;
    let first = chunk(&whole, 0).ok_or("no chunk")?;
    let head: [&[u8]; 7] = [
        &[0; 16], // the times of its messages
        &states.to_le_bytes(),
        &[0; 4], // no checksum
        &4_u32.to_le_bytes(),
        b"zstd",
        &(records.len() as u64).to_le_bytes(),
        records,
    ];
    let body = head.concat();
    let bytes = [&whole[..first.start], &[0x06], &(body.len() as u64).to_le_bytes(), &body, &whole[first.end..]];
    fs::write(path, bytes.concat())?;
    match Recording::open(path)?.integrity() {
        Integrity::Damaged { cause, .. } => Ok(cause.clone()),
        other => Err(format!("{other:?}").into()),
    }
}

/// A few bytes may state, and decompress to, any length. Refusing them at the stated length or at the first invalid
/// record takes neither time nor memory.
#[test]
fn a_chunk_that_claims_too_much_or_holds_no_records_is_refused_at_once() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    // A frame of Zstandard (RFC 8878): no checksum, its length in 8 bytes, 128 KiB of zeros as one byte and a count.
    let zeros = |bytes: u64| {
        let blocks = bytes >> 17;
        let block = |n: u64| [&((1 << 20) | 1 << 1 | u32::from(n + 1 == blocks)).to_le_bytes()[..3], &[0]].concat();
        let window = [&[0x28, 0xB5, 0x2F, 0xFD, 0b1100_0000, 0x38][..], &bytes.to_le_bytes()].concat();
        [window, (0..blocks).flat_map(block).collect()].concat()
    };
    insta::assert_snapshot!(with_chunk(&path, &zeros(1 << 30), 1 << 30)?, @"a chunk states 1073741824 bytes after decompression, more than the limit of 67108864");
    insta::assert_snapshot!(with_chunk(&path, &zeros(1 << 26), 1 << 26)?, @"a record with opcode 0 in a chunk");
    insta::assert_snapshot!(with_chunk(&path, &zeros(1 << 17), u64::MAX)?, @"a chunk states 18446744073709551615 bytes after decompression, more than the limit of 67108864");
    Ok(())
}
