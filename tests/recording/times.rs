//! Times, samples and instruments stated in messages.

use std::fs;
use std::time::Duration;

use resonarm::cut::merge;
use resonarm::protocol::{Frame, Id};
use resonarm::recording::{
    Clipped, Direction, Event, Existing, FrameRecord, Integrity, Options, Record, Recorder, Recording, RunTime,
    SampleRecord, StateRecord,
};
use resonarm::rig::{Load, Readings};
use resonarm::structure::{LoadSet, States};

use crate::{TestResult, configuration, options, record, rewritten, run};

/// The reading of the machine's clocks when the loop's clock read 0, ns of the UNIX epoch.
const CLOCK_EPOCH_UNIX_NS: u64 = 1_700_000_000_000_000_000;
/// The reading of the loop's clock at the start of the run, ns: the recorder was created some time before.
const BEGUN_NS: u64 = 5_000_000_000;
/// Both together.
const START_UNIX_NS: u64 = CLOCK_EPOCH_UNIX_NS + BEGUN_NS;

fn never() -> Duration {
    Duration::ZERO
}

/// Records sample 7 of a run, with a frame taken in 7.5 ms and an event 7.75 ms after its start; returns topic,
/// log time and publish time of every message.
fn stamps(path: &std::path::Path, options: Options) -> TestResult<Vec<(String, u64, u64)>> {
    let recorder = Recorder::create(path, &configuration(), options)?;
    let mut channel = recorder.channel("plant", 64)?;
    channel.begin(BEGUN_NS);
    let frame = Frame::classic(Id::Standard(0x201), &[1])?;
    let (sample, direction, bus_timestamp_ns) = (7, Direction::Received, Some(START_UNIX_NS + 7_400_000));
    let time_ns = 7_500_000;
    channel.push_blocking(&Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns, frame }))?;
    channel.push_blocking(&Record::Event(Event { sample, time_ns: 7_750_000, name: "state.fault", value: 0 }))?;
    channel.push_blocking(&crate::records_of(7)?[0])?;
    recorder.finish(&[])?;
    let bytes = fs::read(path)?;
    let messages = mcap::MessageStream::new(&bytes)?;
    let stamp = |message: mcap::Message<'_>| (message.channel.topic.clone(), message.log_time, message.publish_time);
    Ok(messages.map(|message| message.map(stamp)).collect::<Result<_, _>>()?)
}

/// The event first, which waits for no batch.
fn expected(log_ns: u64, publish_ns: u64) -> Vec<(String, u64, u64)> {
    ["/events", "/can/frames", "/plant/steps"].map(|topic| (topic.to_string(), log_ns, publish_ns)).into()
}

/// Makes options for a sample period, an interface, and a clock with its epoch.
type Kind = fn(f64, &str, u64, fn() -> Duration) -> Options;

#[test]
fn log_times_are_simulated_and_publish_times_the_walls() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let options = |kind: Kind| Options {
        existing: Existing::Overwrite,
        plot_every_samples: 0,
        ..kind(1e-3, "vcan0", CLOCK_EPOCH_UNIX_NS, never)
    };
    let wall_ns = START_UNIX_NS + 7_750_000;

    assert_eq!(stamps(&path, options(Options::real_time))?, expected(START_UNIX_NS + 7_000_000, wall_ns));
    let recording = Recording::open(&path)?;
    let origin = recording.origin();
    assert_eq!((origin.time, origin.start_unix_ns), (RunTime::RealTime, Some(START_UNIX_NS)));
    // The bus stamped the frame 7.4 ms after the start of the run: 0.1 ms before the loop took it in, not 5 s before.
    let frame = recording.frames()?.next().ok_or("no frame")??;
    assert_eq!((frame.time_ns, frame.bus_timestamp_ns), (7_500_000, Some(START_UNIX_NS + 7_400_000)));

    assert_eq!(stamps(&path, options(Options::lockstep))?, expected(7_000_000, wall_ns));
    let origin = Recording::open(&path)?.origin().clone();
    assert_eq!((origin.time, origin.start_unix_ns), (RunTime::Lockstep, Some(START_UNIX_NS)));

    let simulated = Options { time: RunTime::Simulated, clock_epoch_unix_ns: None, ..options(Options::lockstep) };
    assert_eq!(stamps(&path, simulated)?, expected(7_000_000, 7_000_000));
    let origin = Recording::open(&path)?.origin().clone();
    assert_eq!((origin.time, origin.start_unix_ns), (RunTime::Simulated, None));
    Ok(())
}

/// The same scenario on another day is another run.
#[test]
fn parts_of_two_runs_are_not_joined() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = |name: &str| directory.path().join(name);
    for (name, first, epoch_ns) in [("a", 0, 0), ("b", 10, 0), ("c", 10, 5)] {
        let options = Options::real_time(1e-3, "vcan0", CLOCK_EPOCH_UNIX_NS + epoch_ns, never);
        let records = (first..first + 10).map(crate::records_of).collect::<TestResult<Vec<_>>>()?.concat();
        record(&path(name), options, &records)?;
    }
    let [a, b, c] = ["a", "b", "c"].map(|name| Recording::open(path(name)));
    let (a, b, c) = (a?, b?, c?);
    assert_eq!(merge(&[&a, &b], &path("whole"), Existing::Refuse)?.samples, 20);
    assert_eq!(Recording::open(path("whole"))?.origin().start_unix_ns, a.origin().start_unix_ns);
    let refused = merge(&[&a, &c], &path("other"), Existing::Refuse).err().ok_or("two runs were joined")?;
    let said = refused.to_string().replace(&format!("{}/", directory.path().display()), "");
    insta::assert_snapshot!(said, @"recording `c` can't be joined to the one before it: it has a run that began 1700000000.000000005 s after the UNIX epoch, expected one that began 1700000000.000000000 s after the UNIX epoch");
    Ok(())
}

#[test]
fn the_end_of_a_run_and_what_was_clipped_are_marked() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let mut records = run(250)?;
    let end = StateRecord {
        sample: 250,
        states: States::new(&[0.1, 0.2, 0.3, 0.4], &[]).unwrap(),
        load: Load::default(),
        taken: LoadSet::NATIVE,
        is_end: true,
    };
    let at_the_limit = |clipped| SampleRecord {
        sample: 250,
        acceleration_b_m_s2: [0.0, 1600.0],
        acceleration_c_m_s2: [0.0; 2],
        head_force_n: [-650.0, 0.0],
        clipped,
        more: Readings::NONE,
    };
    let clipped = Clipped { acceleration_b: [false, true], head_force: [true, false], ..Clipped::NONE };
    records.extend([Record::Sample(at_the_limit(clipped)), Record::State(end)]);
    record(&path, options(), &records)?;
    let recording = Recording::open(&path)?;
    assert_eq!(recording.summary().clipped_samples, 1);
    let states = recording.states()?.collect::<Result<Vec<_>, _>>()?;
    assert_eq!(states.iter().filter(|state| state.is_end).collect::<Vec<_>>(), [&end]);
    assert_eq!(states.last(), Some(&end));
    let samples = recording.samples()?.collect::<Result<Vec<_>, _>>()?;
    assert_eq!(samples.last(), Some(&at_the_limit(clipped)));
    Ok(())
}

#[test]
fn a_batch_that_states_another_period_is_damage() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    record(&path, Options { batch_samples: 100, ..options() }, &run(300)?)?;
    let mut batches = 0;
    let bytes = rewritten(&path, |topic, data| {
        batches += u32::from(topic == "/plant/steps");
        let stated = [&[0x11_u8][..], &1e-3_f64.to_le_bytes()].concat(); // field 2, of 64 bits (Protobuf, "Encoding")
        if topic == "/plant/steps" && batches == 2 {
            let place = data.windows(9).position(|window| window == stated).unwrap();
            data[place + 1..place + 9].copy_from_slice(&2e-3_f64.to_le_bytes());
        }
    })?;
    fs::write(&path, bytes)?;
    let recording = Recording::open(&path)?;
    let Integrity::Damaged { cause, .. } = recording.integrity() else {
        return Err(format!("{:?}", recording.integrity()).into());
    };
    insta::assert_snapshot!(cause, @"a batch states the sample period 0.002 s, expected 0.001 s");
    Ok(())
}
