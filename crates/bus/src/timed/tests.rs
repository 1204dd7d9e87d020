use resonarm_protocol::bits::of;
use resonarm_protocol::{FrameFormat, Id};

use super::*;
use resonarm_realtime::VirtualClock;

const US: u64 = 1000;
const MBIT: BitRates = BitRates::classical(1_000_000);

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::classic(Id::Standard(id), data).unwrap()
}

/// Frames of 119, 119 and 53 bits.
fn ramp() -> Frame {
    frame(0x123, &[1, 2, 3, 4, 5, 6, 7, 8])
}

fn force() -> Frame {
    frame(0x201, &[0x8A, 0, 0xF4, 1, 0x83, 0xFF, 0x34, 0x12])
}

fn urgent() -> Frame {
    frame(0, &[])
}

struct Bench {
    clock: VirtualClock,
    ends: Vec<TimedBus<VirtualClock>>,
}

impl Bench {
    fn new(nodes: usize, spec: Spec) -> Bench {
        let clock = VirtualClock::default();
        Bench { ends: hub(nodes, &spec, &clock), clock }
    }

    fn send(&mut self, node: usize, frame: &Frame) {
        assert_eq!(self.ends[node].send(frame).unwrap(), Sent::Queued);
    }

    /// The frames received at `node` up to `until_ns`, and when.
    fn heard(&mut self, node: usize, until_ns: u64) -> Vec<(Frame, u64)> {
        let mut heard = Vec::new();
        loop {
            while let Some(received) = self.ends[node].receive().unwrap() {
                heard.push((received.frame, self.clock.now_ns()));
            }
            match self.ends[node].next_event_ns().filter(|next_ns| *next_ns <= until_ns) {
                Some(next_ns) => self.clock.advance_to_ns(next_ns),
                None => return heard,
            }
        }
    }
}

#[test]
fn frames_take_their_bits_and_the_lower_identifier_goes_first() {
    let mut bench = Bench::new(3, Spec::new(MBIT));
    bench.send(0, &force());
    bench.send(1, &ramp());
    // The second starts behind the intermission of the first, whose 116 bits before it are heard by then.
    let heard = bench.heard(2, 1000 * US);
    assert_eq!(heard, [(ramp(), 116 * US), (force(), (119 + 116) * US)]);
    assert_eq!(bench.ends[0].traffic(), Traffic { frames: 2, error_frames: 0, bits: Bits { nominal: 238, data: 0 } });
}

#[test]
fn an_urgent_frame_waits_for_the_one_on_the_bus_and_for_those_of_its_node() {
    let mut bench = Bench::new(3, Spec::new(MBIT));
    let slow = frame(0x7FF, &[0xFF; 8]);
    bench.send(0, &slow);
    bench.heard(2, 0);
    bench.clock.advance_to_ns(50 * US);
    bench.send(1, &force());
    bench.send(1, &urgent());
    bench.send(0, &ramp());
    let heard = bench.heard(2, 1000 * US);
    let expected = [(slow, 123), (ramp(), 126 + 116), (force(), 126 + 119 + 116), (urgent(), 126 + 238 + 50)];
    assert_eq!(heard, expected.map(|(frame, us)| (frame, us * US)));
}

#[test]
fn an_extended_identifier_loses_to_the_standard_one_of_its_first_bits_and_data_goes_before_a_request() {
    let mut bench = Bench::new(4, Spec::new(MBIT));
    let extended = Frame::classic(Id::Extended(0x123 << 18), &[]).unwrap();
    let remote = Frame::new(Id::Standard(0x123), FrameFormat::Remote, &[]).unwrap();
    bench.send(0, &extended);
    bench.send(1, &remote);
    bench.send(2, &ramp());
    let order: Vec<Frame> = bench.heard(3, 1000 * US).into_iter().map(|(frame, _)| frame).collect();
    assert_eq!(order, [ramp(), remote, extended]);
}

#[test]
fn the_data_of_an_fd_frame_go_at_their_own_rate() {
    let mut bench = Bench::new(2, Spec::new(BitRates { nominal_hz: 500_000, data_hz: 5_000_000 }));
    let format = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
    let fd = Frame::new(Id::Standard(0x321), format, &[0x55; 64]).unwrap();
    bench.send(0, &fd);
    let Bits { nominal, data } = of(&fd);
    // The content alone has 512 bits, and the CRC of 21 bits, its stuff count and its fixed stuff bits belong to the
    // data phase, too.
    assert!(nominal >= 29 && data >= 550);
    assert_eq!(bench.heard(1, 1000 * US), [(fd, (nominal - 3) * 2000 + data * 200)]);
}

#[test]
fn full_mailboxes_refuse_and_the_bus_is_taken_for_the_sum_of_the_bits() {
    let mut bench = Bench::new(2, Spec::new(MBIT));
    let (mut sent, mut refused, mut heard) = (0, 0, Vec::new());
    for k in 0..2000_u32 {
        heard.extend(bench.heard(1, u64::from(k) * 50 * US));
        bench.clock.advance_to_ns(u64::from(k) * 50 * US);
        match bench.ends[0].send(&frame(0x100, &k.to_le_bytes())).unwrap() {
            Sent::Queued => sent += 1,
            Sent::QueueFull => refused += 1,
        }
    }
    // At 50 µs a frame more come than fit, as each takes some 80 bits of 1 µs, so that the mailboxes are full most of
    // the time.
    heard.extend(bench.heard(1, u64::MAX - 1));
    assert_eq!((heard.len(), sent + refused), (sent, 2000));
    assert!(refused > 500, "{refused}");
    let sum = heard.iter().fold(Bits::default(), |sum, (frame, _)| sum.plus(of(frame)));
    assert_eq!(bench.ends[1].traffic(), Traffic { frames: sent as u64, error_frames: 0, bits: sum });
    // Never idle in between: the last ends when all bits but its intermission have passed.
    assert_eq!(heard.last().unwrap().1, (sum.nominal - 3) * US);
}

#[test]
fn a_babbling_node_of_the_highest_priority_starves_the_others() {
    let mut bench = Bench::new(3, Spec::new(MBIT));
    (0..3).for_each(|_| bench.send(2, &urgent()));
    bench.send(0, &force());
    // 53 bits each: a new one waits before the one on the bus has ended.
    for k in 1..=200 {
        let heard = bench.heard(1, k * 53 * US);
        assert!(heard.iter().all(|(frame, _)| *frame == urgent()), "{k}");
        bench.ends[2].send(&urgent()).unwrap();
    }
    let heard = bench.heard(1, 12_000 * US);
    assert_eq!(heard.last().map(|(frame, _)| *frame), Some(force()));
}

#[test]
fn a_frame_destroyed_by_an_error_is_sent_again_until_it_is_heard() {
    let mut bench = Bench::new(2, Spec { bit_error_rate: 1e-3, seed: 5, ..Spec::new(MBIT) });
    let mut heard = Vec::new();
    for k in 0..2000_u32 {
        bench.send(0, &frame(0x100, &k.to_le_bytes()));
        heard.extend(bench.heard(1, u64::from(k + 1) * 2000 * US));
    }
    let numbers: Vec<u32> = heard.iter().map(|(f, _)| u32::from_le_bytes(f.data().try_into().unwrap())).collect();
    assert_eq!(numbers, (0..2000).collect::<Vec<_>>());
    // About 80 bits before the intermission, so 1 − (1 − p)^80 = 7.7 % of the tries fail; four standard errors of 2166.
    let failed = bench.ends[0].traffic().error_frames as f64;
    assert!((failed / (2000.0 + failed) - 0.077).abs() < 4.0 * (0.077_f64 * 0.923 / 2166.0).sqrt(), "{failed}");
}

/// The bits of a try of `frame` that an error at `bit` ends, and the receive errors of the other node.
fn failed_try(frame: &Frame, bit: u64, [sender, other]: [ErrorCounters; 2]) -> (Bits, u16) {
    let mut bench = Bench::new(2, Spec::new(BitRates { nominal_hz: 1_000_000, data_hz: 4_000_000 }));
    bench.send(0, frame);
    let mut wire = bench.ends[0].lock();
    (wire.controllers[0].counters, wire.controllers[1].counters) = (sender, other);
    wire.begin(0, 0, Some(bit));
    drop(wire);
    while bench.ends[0].traffic().error_frames == 0 {
        let next_ns = bench.ends[0].next_event_ns().unwrap();
        bench.clock.advance_to_ns(next_ns);
    }
    (bench.ends[0].traffic().bits, bench.ends[1].error_counters().receive - other.receive)
}

/// 6 bits where all see the error at once, 12 where the others see it by the flag alone.
#[test]
fn error_flags_overlap_as_far_as_the_others_see_the_error_late() {
    let (active, passive) = (ErrorCounters::default(), ErrorCounters { transmit: 0, receive: 128 });
    let flags = |bit, counters| {
        // SOF, ten zeros of the identifier with two stuff bits, a one.
        let (bits, receive_errors) = failed_try(&frame(1, &[]), bit, counters);
        assert_eq!(bits.data, 0);
        (bits.nominal - (bit + 1) - 8 - 3, receive_errors)
    };
    assert_eq!(flags(0, [active; 2]), (12, 1));
    assert_eq!(flags(1, [active; 2]), (12, 1));
    assert_eq!(flags(5, [active; 2]), (6, 1));
    // A one that became a zero behind a zero: the fourth bit of the flag is the sixth zero.
    assert_eq!(flags(13, [active; 2]), (10, 1));
    // A passive receiver's flag is recessive and makes none longer.
    assert_eq!(flags(1, [active, passive]), (6, 1));
    // A passive sender's flag is recessive: what it leaves shows by the sixth bit, but for the one that is wrong.
    assert_eq!(flags(1, [passive, active]), (6 + 5, 1));
    assert_eq!(flags(0, [passive, active]), (6, 0));
    // In the data phase the others count the flag's first bits at the data bit rate.
    let format = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
    let fd = Frame::new(Id::Standard(0x555), format, &[0x55; 8]).unwrap();
    let head = of(&fd).nominal - 12;
    // ESI, DLC 1000, data 01|0: behind a one the zero became a one.
    let (bits, receive_errors) = failed_try(&fd, head + 7, [active; 2]);
    assert_eq!((bits, receive_errors), (Bits { nominal: head + 6 + 8 + 3, data: 8 + 6 }, 1));
}

#[test]
fn errors_all_the_time_end_in_bus_off_and_the_controller_comes_back_after_1408_bits() {
    // Of a thousand bits not one is right: every try fails at its first bit, which the other sees by the error flag
    // alone and answers with an error flag, after 1 + 12 + 8 + 3 bits.
    let mut bench = Bench::new(2, Spec { bit_error_rate: 0.999_999, ..Spec::new(MBIT) });
    bench.send(0, &ramp());
    bench.heard(1, 15 * 24 * US);
    assert_eq!(bench.ends[0].error_counters(), ErrorCounters { transmit: 120, receive: 0 });
    assert_eq!(bench.ends[0].error_counters().state(), ErrorState::Active);
    // From the 16th on it is passive: nobody sees its flag, and it waits 8 bits more. The 32nd ends 3 bits before the
    // bus is free.
    let off_us = 16 * 24 + 16 * (1 + 6 + 8 + 3 + 8);
    bench.heard(1, (off_us - 4) * US);
    assert_eq!(bench.ends[0].error_counters().state(), ErrorState::Passive);
    bench.clock.advance_to_ns((off_us - 3) * US);
    assert!(matches!(bench.ends[0].send(&ramp()), Err(BusError::BusOff { .. })));
    assert!(matches!(bench.ends[0].receive(), Err(BusError::BusOff { .. })));
    assert_eq!(bench.ends[1].error_counters(), ErrorCounters { transmit: 0, receive: 16 });
    assert_eq!(
        bench.ends[1].traffic(),
        Traffic { frames: 0, error_frames: 32, bits: Bits { nominal: 16 * 24 + 16 * 18, data: 0 } }
    );
    let back_us = off_us + 128 * 11;
    bench.clock.advance_to_ns(back_us * US - 1);
    assert!(bench.ends[0].receive().is_err());
    bench.clock.advance_to_ns(back_us * US);
    assert_eq!(bench.ends[0].receive().unwrap(), None);
    assert_eq!(bench.ends[0].error_counters(), ErrorCounters::default());
    // Its frames to send are dropped.
    assert_eq!(bench.ends[0].next_event_ns(), None);
}

#[test]
fn frames_of_the_others_let_a_controller_come_back_too() {
    let mut bench = Bench::new(3, Spec::new(MBIT));
    bench.ends[0].lock().controllers[0].counters.transmit = 256;
    bench.ends[0].lock().controllers[0].judge();
    // 127 frames, and between them no idle bus.
    // A frame ends with 11 recessive bits: ACK delimiter, end of frame and intermission. So 128 frames in a row are a
    // recovery.
    for k in 1..=127_u64 {
        bench.send(1, &urgent());
        bench.heard(2, (k * 53 - 3) * US);
        bench.clock.advance_to_ns(k * 53 * US);
        assert!(bench.ends[0].receive().is_err(), "{k}");
    }
    bench.send(1, &urgent());
    bench.heard(2, (128 * 53 - 3) * US);
    assert_eq!(bench.ends[0].receive().unwrap(), None);
}

#[test]
fn without_anybody_to_acknowledge_a_controller_becomes_passive_and_keeps_sending() {
    let mut bench = Bench::new(2, Spec::new(MBIT));
    drop(bench.ends.pop());
    bench.send(0, &ramp());
    // 119 − 3 − 8 bits to the end of the ACK slot, then the error frame; 16 tries until it is passive.
    bench.heard(0, 16 * (108 + 17) * US - 3 * US);
    assert_eq!(bench.ends[0].error_counters(), ErrorCounters { transmit: 128, receive: 0 });
    bench.heard(0, 100_000 * US);
    assert_eq!(bench.ends[0].error_counters(), ErrorCounters { transmit: 128, receive: 0 });
    assert!(bench.ends[0].traffic().error_frames > 700);
    assert_eq!(bench.ends[0].traffic().frames, 0);
}
