use std::sync::OnceLock;
use std::sync::atomic::AtomicU64;

use super::*;
use crate::recording::Event;

/// A record may arrive between a check that finds the channels empty and the next.
#[test]
fn the_first_record_has_the_start_of_the_run_whenever_it_comes() {
    const EPOCH_NS: u64 = 1_700_000_000_000_000_000;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let shared = Arc::new(Shared { path, failure: OnceLock::new(), start_clock_ns: AtomicU64::new(0) });
    let options = Options::real_time(1e-3, "vcan0", EPOCH_NS, || Duration::ZERO);
    let (control, commands) = mpsc::channel();
    let mut writer = Writer::create(Arc::clone(&shared), &Configuration::new(), options, commands).unwrap();
    let (mut ring, records) = rtrb::RingBuffer::new(4);
    control.send(Control::Open(Source::new(String::from("plant"), records, Arc::default()))).unwrap();
    assert!(writer.take_commands().is_none());
    assert_eq!((writer.take_at_most(TURN).unwrap(), writer.output.times.start_unix_ns), (0, None));
    shared.start_clock_ns.store(5_000, Ordering::Release);
    assert!(slots::push(&mut ring, &Record::Event(Event { sample: 0, time_ns: 0, name: "state.boot_up", value: 0 })));
    assert_eq!((writer.take_at_most(TURN).unwrap(), writer.output.times.start_unix_ns), (1, Some(EPOCH_NS + 5_000)));
}
