//! What every backend of `resonarm::bus` must do, whatever lies beneath it.
//!
//! `make` gives two ends of one bus on which nothing else is sent meanwhile; it is called afresh for each clause.

use std::time::{Duration, Instant};

use resonarm::bus::{Bus, BusError, Filter, Received, Sent, Statistics};
use resonarm::protocol::{Frame, FrameFormat, Id};

/// Two ends of one bus.
pub type Pair = (Box<dyn Bus>, Box<dyn Bus>);

/// Which formats the bus under test carries, beside classical data frames.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Formats {
    /// Remote frames and CAN FD.
    All,
    /// Remote frames; sending CAN FD is an error.
    #[cfg_attr(not(feature = "python-can"), allow(dead_code, reason = "only python-can has a classical bus"))]
    ClassicalOnly,
}

/// Longer than any backend needs for a frame on a loaded machine.
const PATIENCE: Duration = Duration::from_secs(5);
/// Long enough for a frame that must not come to come after all.
const SILENCE: Duration = Duration::from_millis(50);

/// Runs every clause; panics at the first that does not hold. `lost_beneath` counts the frames that were lost between
/// the two ends where neither can know of it.
pub fn contract(make: impl Fn() -> Pair, formats: Formats, lost_beneath: impl Fn() -> u64) {
    apart_from_overflow(&make, formats);
    no_frame_vanishes_uncounted(make(), &lost_beneath, 1);
    no_frame_vanishes_uncounted(make(), &lost_beneath, 50);
}

/// All but one, for a bus whose queues have no end.
pub fn apart_from_overflow(make: &impl Fn() -> Pair, formats: Formats) {
    keeps_order_and_content(make());
    a_batch_is_sent_as_its_frames_are(make());
    what_was_not_received_ends_a_wait(make());
    carries_remote_frames(make());
    carries_fd_frames(make(), formats);
    does_not_hear_itself(make());
    receives_nothing_at_once(make());
    wait_ends_at_the_timeout(make());
    wait_ends_with_a_frame(make());
    filters_by_identifier_and_mask(make());
    filters_by_format(make());
    empty_filters_pass_everything(make());
    answers_closed_after_close(make);
    close_still_sends_what_was_queued(make());
}

fn standard(id: u16, data: &[u8]) -> Frame {
    Frame::classic(Id::Standard(id), data).unwrap()
}

fn extended(id: u32) -> Frame {
    Frame::classic(Id::Extended(id), &[0xEE]).unwrap()
}

/// Sends, waiting while the transmit queue is full.
fn send(end: &mut dyn Bus, frame: &Frame) {
    #[allow(clippy::disallowed_methods, reason = "a test bounds itself in real time")]
    let start = Instant::now();
    while end.send(frame).unwrap() == Sent::QueueFull {
        assert!(start.elapsed() < PATIENCE, "the transmit queue stays full");
        end.wait(Duration::from_millis(1)).unwrap();
    }
}

/// Sends all, waiting while the transmit queue is full.
fn send_all(end: &mut dyn Bus, mut frames: &[Frame]) {
    #[allow(clippy::disallowed_methods, reason = "a test bounds itself in real time")]
    let start = Instant::now();
    while end.send_all(&mut frames).unwrap() == Sent::QueueFull {
        assert!(start.elapsed() < PATIENCE, "the transmit queue stays full");
        end.wait(Duration::from_millis(1)).unwrap();
    }
    assert!(frames.is_empty(), "{} frames are left", frames.len());
}

/// The next frame, which must come.
fn next(end: &mut dyn Bus) -> Received {
    assert!(end.wait(PATIENCE).unwrap(), "no frame came");
    end.receive().unwrap().expect("wait promised a frame")
}

/// The identifier of the frame that ends a series, and the filter that passes it.
const END_ID: u16 = 0x7FE;
const END_FILTER: Filter = Filter { id: Id::Standard(END_ID), mask: 0x7FF };

/// Sends these frames and one that ends them: what the other end receives before that one. The frames keep their order,
/// so nothing is under way any more, however slow the machine.
fn carry(near: &mut dyn Bus, far: &mut dyn Bus, frames: &[Frame]) -> Vec<Frame> {
    let end = standard(END_ID, &[]);
    frames.iter().for_each(|frame| send(near, frame));
    send(near, &end);
    std::iter::repeat_with(|| next(far).frame).take_while(|frame| *frame != end).collect()
}

/// The next frames, so many, and that no more come.
fn exactly(end: &mut dyn Bus, count: usize) -> Vec<Frame> {
    let frames: Vec<Frame> = (0..count).map(|_| next(end).frame).collect();
    assert!(!end.wait(SILENCE).unwrap(), "more than {count} frames: {:?} behind {frames:?}", end.receive());
    frames
}

fn keeps_order_and_content((mut near, mut far): Pair) {
    // Later frames have lower identifiers, and so a higher priority: a bus that sorted by it would change the order.
    let frames: Vec<Frame> = (0..200u8)
        .map(|k| match k % 3 {
            0 => standard(0x7FF - u16::from(k), &vec![k; usize::from(k % 9)]),
            1 => standard(0x100, &[k, 1, 2, 3, 4, 5, 6, 7]),
            _ => extended(0x1FFF_FFFF - u32::from(k)),
        })
        .collect();
    let mut last_ns = 0;
    // Fifty at a time fit the smallest queue of a bus under test, which has 64 places.
    for half in frames.chunks(50) {
        half.iter().for_each(|frame| send(&mut *near, frame));
        for frame in half {
            let received = next(&mut *far);
            assert_eq!(received.frame, *frame);
            if let Some(stamp_ns) = received.timestamp_ns {
                assert!(stamp_ns >= last_ns, "timestamps go back from {last_ns} to {stamp_ns}");
                last_ns = stamp_ns;
            }
        }
    }
    assert_eq!(
        near.statistics(),
        Statistics { sent: 200, queue_full: near.statistics().queue_full, ..Default::default() }
    );
    assert_eq!(far.statistics(), Statistics { received: 200, ..Default::default() });
}

/// Frames of both lengths of identifiers, more than any backend takes in one go, between single ones.
fn a_batch_is_sent_as_its_frames_are((mut near, mut far): Pair) {
    let frames: Vec<Frame> =
        (0..60u8).map(|k| if k % 2 == 0 { standard(0x100, &[k]) } else { extended(0x1000 + u32::from(k)) }).collect();
    // Single frames around the batch show that both ways of sending share one queue.
    let (first, last) = (standard(1, &[1, 2]), standard(2, &[3]));
    send(&mut *near, &first);
    send_all(&mut *near, &frames);
    send(&mut *near, &last);
    assert_eq!(next(&mut *far).frame, first);
    for frame in &frames {
        assert_eq!(next(&mut *far).frame, *frame);
    }
    assert_eq!(next(&mut *far).frame, last);
    assert_eq!(near.send_all(&mut &[][..]).unwrap(), Sent::Queued, "nothing is sent at once");
    assert_eq!((near.statistics().sent, far.statistics().received), (62, 62));
}

/// Also where a backend takes in several frames in one go.
fn what_was_not_received_ends_a_wait((mut near, mut far): Pair) {
    let frames = [1, 2, 3].map(|id| standard(id, &[]));
    send_all(&mut *near, &frames);
    for frame in frames {
        assert_eq!(next(&mut *far).frame, frame);
    }
    assert!(!far.wait(Duration::ZERO).unwrap());
    // What comes now is found though the call before found nothing.
    send(&mut *near, &frames[0]);
    assert_eq!(next(&mut *far).frame, frames[0]);
}

fn carries_remote_frames((mut near, mut far): Pair) {
    for len in [0, 5, 8] {
        let frame = Frame::new(Id::Standard(0x321), FrameFormat::Remote, &[0; 8][..len]).unwrap();
        send(&mut *near, &frame);
        assert_eq!(next(&mut *far).frame, frame);
    }
}

fn carries_fd_frames((mut near, mut far): Pair, formats: Formats) {
    // Both ends of the range, the longest classical length, and 12, the shortest that only CAN FD has.
    for (len, bit_rate_switch) in [(0, false), (8, true), (12, false), (64, true)] {
        let format = FrameFormat::Fd { bit_rate_switch, error_state_indicator: false };
        let data: Vec<u8> = (1..=len).collect();
        let frame = Frame::new(Id::Extended(0x1234_5678), format, &data).unwrap();
        if formats == Formats::ClassicalOnly {
            assert!(near.send(&frame).is_err(), "a classical bus must refuse {frame}");
            continue;
        }
        send(&mut *near, &frame);
        assert_eq!(next(&mut *far).frame, frame);
    }
}

fn does_not_hear_itself((mut near, mut far): Pair) {
    send(&mut *near, &standard(1, &[]));
    send(&mut *far, &standard(2, &[]));
    assert_eq!(exactly(&mut *near, 1), [standard(2, &[])]);
    assert_eq!(exactly(&mut *far, 1), [standard(1, &[])]);
}

fn receives_nothing_at_once((mut near, mut far): Pair) {
    for end in [&mut near, &mut far] {
        #[allow(clippy::disallowed_methods, reason = "a test measures real time")]
        let start = Instant::now();
        assert_eq!(end.receive().unwrap(), None);
        assert!(start.elapsed() < PATIENCE, "receive blocked for {:?}", start.elapsed());
        assert!(!end.wait(Duration::ZERO).unwrap());
    }
}

fn wait_ends_at_the_timeout((mut near, _far): Pair) {
    let timeout = Duration::from_millis(30);
    #[allow(clippy::disallowed_methods, reason = "a test measures real time")]
    let start = Instant::now();
    assert!(!near.wait(timeout).unwrap());
    assert!(start.elapsed() >= timeout, "wait came back after {:?}", start.elapsed());
    assert!(start.elapsed() < PATIENCE, "wait came back after {:?}", start.elapsed());
}

fn wait_ends_with_a_frame((mut near, mut far): Pair) {
    let sender = std::thread::spawn(move || {
        // In place of a sleep, which clippy.toml leaves to `realtime::clock`. It is long enough for the near end to be
        // waiting.
        far.wait(SILENCE).unwrap();
        send(&mut *far, &standard(0x55, &[1]));
        far
    });
    assert!(near.wait(PATIENCE).unwrap(), "the frame did not wake the waiting end");
    assert!(near.wait(Duration::ZERO).unwrap(), "waiting must not take the frame");
    assert_eq!(near.receive().unwrap().map(|received| received.frame), Some(standard(0x55, &[1])));
    assert!(!near.wait(Duration::ZERO).unwrap());
    sender.join().unwrap();
}

fn filters_by_identifier_and_mask((mut near, mut far): Pair) {
    let exactly = Filter { id: Id::Standard(0x123), mask: 0x7FF };
    // The bits that the mask leaves out do not count, in the filter no more than in the frame: 0x200 to 0x20F pass.
    let block = Filter { id: Id::Standard(0x204), mask: 0x7F0 };
    far.set_filters(&[exactly, block, END_FILTER]).unwrap();
    let frames = [0x122, 0x123, 0x124, 0x1FF, 0x200, 0x20F, 0x210].map(|id| standard(id, &[]));
    let ids: Vec<u32> = carry(&mut *near, &mut *far, &frames).iter().map(|frame| frame.id().raw()).collect();
    assert_eq!(ids, [0x123, 0x200, 0x20F]);
}

fn filters_by_format((mut near, mut far): Pair) {
    let both = [standard(0x123, &[]), extended(0x123)];
    far.set_filters(&[Filter { id: Id::Standard(0x123), mask: 0x7FF }, END_FILTER]).unwrap();
    assert_eq!(carry(&mut *near, &mut *far, &both), both[..1]);
    far.set_filters(&[Filter { id: Id::Extended(0x123), mask: 0x1FFF_FFFF }, END_FILTER]).unwrap();
    assert_eq!(carry(&mut *near, &mut *far, &both), both[1..]);
    far.set_filters(&[Filter { id: Id::Extended(0), mask: 0 }, END_FILTER]).unwrap();
    assert_eq!(carry(&mut *near, &mut *far, &both), both[1..], "a mask of zero still asks for the format");
}

fn empty_filters_pass_everything((mut near, mut far): Pair) {
    let remote = Frame::new(Id::Standard(0x7FF), FrameFormat::Remote, &[]).unwrap();
    let all = [standard(0, &[1]), extended(0x1FFF_FFFF), remote];
    far.set_filters(&[END_FILTER]).unwrap();
    assert_eq!(carry(&mut *near, &mut *far, &all), []);
    far.set_filters(&[]).unwrap();
    assert_eq!(carry(&mut *near, &mut *far, &all), all);
}

/// Sends far more than an end that does not listen can keep: each frame is refused with [`Sent::QueueFull`], received,
/// counted as dropped, or lost beneath; those that are received keep their order. `at_once` are sent in one go; what
/// the queue refuses of them is given up.
fn no_frame_vanishes_uncounted((mut near, mut far): Pair, lost_beneath: &impl Fn() -> u64, at_once: usize) {
    const ATTEMPTS: u32 = 20_000;
    let lost_before = lost_beneath();
    let all: Vec<Frame> = (0..ATTEMPTS).map(|k| standard(0x100, &k.to_le_bytes())).collect();
    let mut refused = 0;
    for mut batch in all.chunks(at_once) {
        let outcome = near.send_all(&mut batch).unwrap();
        assert_eq!(outcome == Sent::QueueFull, !batch.is_empty(), "{} are left", batch.len());
        refused += batch.len() as u64;
    }
    let tx = near.statistics();
    assert_eq!(tx.sent + refused, u64::from(ATTEMPTS));
    // A batch that is refused counts once, however many of its frames are left.
    assert!(tx.queue_full <= refused && (tx.queue_full > 0) == (refused > 0), "{refused} refused: {tx:?}");
    // The end is known by the counts and not by a pause, which a busy machine makes as well.
    let (mut kept, mut silence) = (Vec::new(), Duration::ZERO);
    while far.statistics().received + far.statistics().dropped < tx.sent && silence < PATIENCE {
        silence = if far.wait(SILENCE).unwrap() { Duration::ZERO } else { silence + SILENCE };
        kept.extend(far.receive().unwrap().map(|received| received.frame));
    }
    assert!(!far.wait(SILENCE).unwrap(), "more came than was sent: {tx:?} {:?}", far.statistics());
    let rx = far.statistics();
    let lost = lost_beneath() - lost_before;
    assert_eq!(rx.received, kept.len() as u64);
    let counted = rx.received + rx.dropped;
    // The losses beneath are those of all interfaces of the machine, so that they are a bound and no equation.
    assert!((counted..=counted + lost).contains(&tx.sent), "{tx:?} {rx:?}, {lost} lost beneath");
    let numbers: Vec<u32> = kept.iter().map(|f| u32::from_le_bytes(f.data().try_into().unwrap())).collect();
    assert!(numbers.is_sorted_by(|a, b| a < b), "frames out of order");
    // Without a single refusal or loss this clause would have shown nothing.
    assert!(tx.queue_full + rx.dropped > 0, "the bus under test must overflow: {tx:?} {rx:?}");
    send(&mut *near, &standard(0x101, &[]));
    assert_eq!(next(&mut *far).frame, standard(0x101, &[]), "the bus must work after an overflow");
    assert_eq!(far.statistics().dropped, rx.dropped);
}

fn answers_closed_after_close(make: &impl Fn() -> Pair) {
    let (mut near, mut far) = make();
    send(&mut *near, &standard(1, &[]));
    next(&mut *far);
    // The second is taken in with the first, where a backend does so, and is gone with the bus.
    send_all(&mut *far, &[standard(3, &[]), standard(4, &[])]);
    assert_eq!(next(&mut *near).frame, standard(3, &[]));
    let before = near.statistics();
    near.close().unwrap();
    assert!(matches!(near.send(&standard(1, &[])), Err(BusError::Closed)));
    assert!(matches!(near.send_all(&mut &[standard(1, &[])][..]), Err(BusError::Closed)));
    assert!(matches!(near.receive(), Err(BusError::Closed)));
    assert!(matches!(near.wait(Duration::ZERO), Err(BusError::Closed)));
    assert!(matches!(near.set_filters(&[]), Err(BusError::Closed)));
    assert!(matches!(near.close(), Err(BusError::Closed)));
    assert_eq!(near.statistics(), before);
    far.send(&standard(2, &[])).expect("the other end lives on");
    assert_eq!(far.receive().unwrap(), None);
    // Nobody receives that frame, and a kernel may still have it when the next pair opens, which would hear it. What is
    // sent behind it shows that it has passed.
    let (mut near, mut far) = make();
    carry(&mut *near, &mut *far, &[]);
}

fn close_still_sends_what_was_queued((mut near, mut far): Pair) {
    let frames: Vec<Frame> = (0..20).map(|id| standard(id, &[7])).collect();
    frames.iter().for_each(|frame| send(&mut *near, frame));
    near.close().unwrap();
    assert_eq!(exactly(&mut *far, frames.len()), frames);
}
