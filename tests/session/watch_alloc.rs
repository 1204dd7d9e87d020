//! A watched loop allocates no memory: its notices go into a ring, or are counted as lost. The guard aborts the
//! process at the first allocation.

use assert_no_alloc::assert_no_alloc;
use resonarm::control::SetPoint;
use resonarm::protocol::{Frame, FrameFormat, Id};
use resonarm::recording::{Direction, Event, FrameRecord, Record, TickRecord};
use resonarm::rig::Load;
use resonarm::run::{CommandRecord, End, Notice, Request, watch};

#[test]
fn notices_losses_and_requests_allocate_nothing() {
    let (watch, mut watcher) = watch();
    watcher.want_frames(true);
    let mut watched = watch.open(End::Exciter);
    let set = Request::Set(SetPoint { load: 3.0, frequency_hz: 22.0, phase_deg: 0.0 });
    watcher.ask(set).unwrap();
    watcher.ask(Request::Disarm).unwrap();
    let format = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
    let frame = Frame::new(Id::Standard(0x209), format, &[7; 64]).unwrap();
    let asked = assert_no_alloc(|| {
        for sample in 0..20_000 {
            watched.notify(Notice::Record(Record::Tick(TickRecord {
                sample,
                wakeup_ns: 1,
                exec_ns: 2,
                overruns: 0,
                cause: None,
            })));
            watched.notify(Notice::Record(Record::Event(Event { sample, time_ns: 0, name: "state.fault", value: 0 })));
            watched.notify(Notice::Command(CommandRecord { sample, load: Load::force_n(1.0, 0.0) }));
            watched.notify_frame(|| FrameRecord {
                sample,
                direction: Direction::Sent,
                time_ns: 0,
                bus_timestamp_ns: None,
                frame,
            });
        }
        [watched.request(), watched.request(), watched.request()]
    });
    assert_eq!(asked, [Some(set), Some(Request::Disarm), None]);
    let (mut taken, lost) = (0, watcher.lost());
    watcher.take(usize::MAX, |_, _| taken += 1);
    assert!(lost > 0 && taken > 0, "{lost} lost, {taken} taken");
    assert_eq!(taken + lost, 80_000);
    drop(watcher);
    assert_no_alloc(|| watched.notify(Notice::Command(CommandRecord { sample: 0, load: Load::default() })));
}
