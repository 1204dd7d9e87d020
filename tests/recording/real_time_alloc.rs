//! Recording from a real-time loop: `push` neither allocates nor frees, whether or not the record is kept.

use std::error::Error;

use assert_no_alloc::assert_no_alloc;
use resonarm::protocol::{Frame, Id};
use resonarm::recording::{
    Clipped, Configuration, Direction, Event, FrameRecord, Options, Pushed, Record, Recorder, RecordingError,
    SampleRecord, StateRecord, TickRecord,
};
use resonarm::rig::{Load, Readings};
use resonarm::structure::{LoadSet, States};

#[test]
fn push_does_not_allocate() -> Result<(), Box<dyn Error>> {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let recorder = Recorder::create(&path, &Configuration::new(), Options::virtual_time(1e-3, "memory"))?;
    // One channel takes all 50000 records even if the writer sleeps, and the other loses most of them: both paths are
    // guarded.
    let mut wide = recorder.channel("wide", 65_536)?;
    let mut narrow = recorder.channel("narrow", 1)?;
    let frame = Frame::classic(Id::Standard(0x203), &[1, 2, 3])?;
    let pair = [1.0, 2.0];
    let mut push_all = |sample: u64| {
        let time_ns = sample * 1_000_000;
        let (load, taken) = (Load::planar(pair, pair), LoadSet::NATIVE);
        let (acceleration_b_m_s2, acceleration_c_m_s2, head_force_n) = (pair, pair, pair);
        let (direction, bus_timestamp_ns, clipped) = (Direction::Sent, Some(1), Clipped::NONE);
        let records = [
            Record::State(StateRecord {
                sample,
                states: States::new(&[1.0, 2.0, 1.0, 2.0], &[]).unwrap(),
                load,
                taken,
                is_end: false,
            }),
            Record::Sample(SampleRecord {
                sample,
                acceleration_b_m_s2,
                acceleration_c_m_s2,
                head_force_n,
                clipped,
                more: Readings::NONE,
            }),
            Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns, frame }),
            Record::Tick(TickRecord { sample, wakeup_ns: 1, exec_ns: 2, overruns: 0, cause: None }),
            Record::Event(Event { sample, time_ns, name: "state.fault", value: 1 }),
        ];
        records.into_iter().for_each(|record| assert_eq!(wide.push(&record), Pushed::Stored));
        records.into_iter().filter(|record| narrow.push(record) == Pushed::Lost).count()
    };
    let lost = assert_no_alloc(|| (0..10_000).map(&mut push_all).sum::<usize>());
    let summary = recorder.finish(&[])?;
    assert!(lost > 0, "the narrow channel has lost nothing, so losing was not tested");
    assert_eq!((summary.lost["wide"], summary.lost["narrow"]), (0, lost as u64));

    let late = Record::Tick(TickRecord { sample: 10_000, wakeup_ns: 1, exec_ns: 2, overruns: 0, cause: None });
    assert_eq!(assert_no_alloc(|| wide.push(&late)), Pushed::Lost);
    assert!(matches!(wide.push_blocking(&late), Err(RecordingError::Finished { .. })));
    Ok(())
}
