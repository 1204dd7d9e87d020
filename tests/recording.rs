//! Recordings written and read back.

use std::error::Error;
use std::path::Path;

use resonarm::protocol::{Frame, Id};
use resonarm::recording::{
    Configuration, Direction, Event, FrameRecord, Options, Record, Recorder, SampleRecord, StepRecord, Summary,
    TickRecord, Topic,
};

/// What a plant records at step `step`.
fn records(step: u64) -> Result<Vec<Record>, Box<dyn Error>> {
    let x = step as f64;
    let mut records = vec![
        Record::Step(StepRecord {
            step,
            alpha_rad: [1e-3 * x, -1e-4 * x],
            alpha_dot_rad_s: [0.1 + x, 0.2 - x],
            torque_nm: [0.0, -0.0],
            force_n: [x / 3.0, 1.0],
        }),
        Record::Sample(SampleRecord {
            step,
            acceleration_b_m_s2: [x, 2.0 * x],
            acceleration_c_m_s2: [3.0 * x, 4.0 * x],
            head_force_n: [5.0, 6.0],
        }),
        Record::Tick(TickRecord {
            step,
            wakeup_ns: 1000 + step,
            exec_ns: 2000,
            overruns: step.is_multiple_of(7).into(),
        }),
    ];
    for (id, direction) in [(0x203, Direction::Sent), (0x201, Direction::Received)] {
        let frame = Frame::classic(Id::Standard(id), &step.to_le_bytes())?;
        let time_ns = step * 1_000_000 + u64::from(id);
        records.push(Record::Frame(FrameRecord { step, direction, time_ns, bus_timestamp_ns: None, frame }));
    }
    if step % 100 == 50 {
        let (time_ns, name) = (step * 1_000_000, "plant.state.fault");
        records.push(Record::Event(Event { step, time_ns, name, value: -3 }));
    }
    Ok(records)
}

/// Records steps `0..steps` into `path`.
fn record(path: &Path, steps: u64) -> Result<Summary, Box<dyn Error>> {
    let configuration = Configuration::new().with("scenario", "preset = \"irb1600-fitted\"\n").with("seed", 42);
    let recorder = Recorder::create(path, &configuration, Options::virtual_time(1e-3, "memory"))?;
    let mut channel = recorder.channel("plant", 256)?;
    for step in 0..steps {
        records(step)?.into_iter().try_for_each(|record| channel.push_blocking(record))?;
    }
    Ok(recorder.finish(&[("overruns", "0".to_string())])?)
}

#[test]
fn the_same_records_give_the_same_bytes() -> Result<(), Box<dyn Error>> {
    let directory = tempfile::tempdir()?;
    let (one, two) = (directory.path().join("one.mcap"), directory.path().join("two.mcap"));
    let summary = record(&one, 2500)?;
    record(&two, 2500)?;
    let bytes = std::fs::read(&one)?;
    assert!(bytes == std::fs::read(&two)?, "two recordings of the same records differ");
    assert_eq!(summary.bytes, bytes.len() as u64);
    assert_eq!(summary.steps, 2500);
    assert_eq!(summary.messages_in(Topic::Steps), 25);
    assert_eq!(summary.messages_in(Topic::State), 250);
    assert_eq!(summary.messages_in(Topic::Frames), 5000);
    assert_eq!(summary.lost["plant"], 0);
    println!("{} bytes a step", bytes.len() / 2500);
    Ok(())
}
