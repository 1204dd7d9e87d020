//! Recordings written, read, truncated, damaged, recovered.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking, its helpers too")]

#[cfg(unix)]
mod channels;
mod crash;
mod damage;
mod messages;
#[path = "../common/no_alloc.rs"]
mod no_alloc;
mod real_time_alloc;
mod reference_recordings;
mod round_trip;
mod schemas;
mod times;
mod writing;

use std::error::Error;
use std::path::Path;

use resonarm::protocol::{Frame, Id};
use resonarm::realtime::OverrunCause;
use resonarm::recording::{
    Clipped, Configuration, Direction, Event, FrameRecord, Options, Record, Recorder, SampleRecord, StateRecord,
    Summary, TickRecord,
};
use resonarm::rig::{Load, Readings};
use resonarm::structure::{LoadSet, States};

/// The result of a test: any error fails it.
type TestResult<T = ()> = Result<T, Box<dyn Error>>;

/// The records of a plant at sample `sample`.
fn records_of(sample: u64) -> TestResult<Vec<Record>> {
    let x = sample as f64;
    let mut records = vec![
        Record::State(StateRecord {
            sample,
            states: States::new(&[1e-3 * x, -1e-4 * x, 0.1 + x, 0.2 - x], &[]).unwrap(),
            // A negative zero, and thirds, which use every digit of a double: with these a loss of any bit shows.
            load: Load::planar([0.0, -0.0], [x / 3.0, 1.0]),
            taken: LoadSet::NATIVE,
            is_end: false,
        }),
        Record::Sample(SampleRecord {
            sample,
            acceleration_b_m_s2: [x, 2.0 * x],
            acceleration_c_m_s2: [3.0 * x, 4.0 * x],
            head_force_n: [5.0, 6.0],
            clipped: Clipped::NONE,
            more: Readings::NONE,
        }),
        Record::Tick(TickRecord {
            sample,
            wakeup_ns: 1000 + sample,
            exec_ns: 2000,
            overruns: sample.is_multiple_of(7).into(),
            cause: sample.is_multiple_of(7).then_some(OverrunCause::WokeLate),
        }),
    ];
    // Readings that the plant sends, and the command that answers them.
    for (id, direction) in [(0x203, Direction::Sent), (0x201, Direction::Received)] {
        let frame = Frame::classic(Id::Standard(id), &sample.to_le_bytes())?;
        let time_ns = sample * 1_000_000 + u64::from(id);
        records.push(Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns: None, frame }));
    }
    if sample % 100 == 50 {
        let (time_ns, name) = (sample * 1_000_000, "state.fault");
        records.push(Record::Event(Event { sample, time_ns, name, value: -3 }));
    }
    Ok(records)
}

/// A configuration of two entries.
fn configuration() -> Configuration {
    Configuration::new().with("scenario", "preset = \"irb1600-fitted\"\n").with("seed", 42)
}

/// Options of a run in virtual time at 1 kHz.
fn options() -> Options {
    Options::virtual_time(1e-3, "memory")
}

/// Records `records` into `path`.
fn record(path: &Path, options: Options, records: &[Record]) -> TestResult<Summary> {
    let recorder = Recorder::create(path, &configuration(), options)?;
    let mut channel = recorder.channel("plant", 256)?;
    records.iter().try_for_each(|record| channel.push_blocking(record))?;
    Ok(recorder.finish(&[("overruns", "0".to_string())])?)
}

/// The records of a plant over samples `0..samples`.
fn run(samples: u64) -> TestResult<Vec<Record>> {
    Ok((0..samples).map(records_of).collect::<Result<Vec<_>, _>>()?.concat())
}

/// The file written again, with `alter` applied to the data of every message, and with correct checksums.
fn rewritten(path: &Path, mut alter: impl FnMut(&str, &mut Vec<u8>)) -> TestResult<Vec<u8>> {
    let bytes = std::fs::read(path)?;
    let options = mcap::WriteOptions::new().library("resonarm test").compression(None);
    let mut writer = options.create(std::io::Cursor::new(Vec::new()))?;
    let summary = mcap::Summary::read(&bytes)?.ok_or("no summary")?;
    for index in &summary.metadata_indexes {
        writer.write_metadata(&mcap::read::metadata(&bytes, index)?)?;
    }
    for message in mcap::MessageStream::new(&bytes)? {
        let mut message = message?;
        let mut data = message.data.into_owned();
        alter(&message.channel.topic, &mut data);
        message.data = data.into();
        writer.write(&message)?;
    }
    writer.finish()?;
    Ok(writer.into_inner().into_inner())
}
