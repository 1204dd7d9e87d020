//! Frames that no good controller sends.

use super::*;
use resonarm_numeric::noise::Noise;

/// Profile 1 bit by bit: the remainder of the data id and the first seven bytes by x⁸ + x⁴ + x³ + x² + 1.
fn profile1(payload: &[u8]) -> u8 {
    [0x23, 0x01]
        .iter()
        .chain(&payload[..7])
        .fold(0, |crc: u8, byte| (0..8).fold(crc ^ byte, |crc, _| crc << 1 ^ if crc & 0x80 == 0 { 0 } else { 0x1D }))
}

struct Bytes(Noise);

impl Bytes {
    fn number(&mut self) -> u64 {
        let normal = self.0.normal();
        normal.to_bits().wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20
    }

    fn below(&mut self, most: u64) -> u64 {
        self.number() % most
    }
}

/// 10⁶ frames: with bits flipped, cut, repeated, old, of other formats, of noise; a good one now and then. No load acts
/// that no frame with a right checksum commands, none beyond the limits, and none while unarmed.
#[test]
fn a_million_hostile_frames_command_nothing_wrong() {
    let mut rig = Rig::new();
    let mut bytes = Bytes(Noise::new(7, 0));
    let mut old = rig.frame(DRIVE, 0, true, false);
    let mut commanded = vec![0.0];
    let limit_n = exciter().limits().0;
    for number in 0..1_000_000_u64 {
        let counts = (bytes.below(60_000) as i64 - 30_000) as i16;
        let good = match number % 20 {
            0 => Some(rig.frame(DRIVE, counts / 8, bytes.below(50) != 0, bytes.below(10) == 0)),
            _ => None,
        };
        let frame = good.unwrap_or_else(|| hostile(&mut bytes, &old));
        if frame.id() == DRIVE && frame.data().len() == 8 && profile1(frame.data()) == frame.data()[7] {
            let counts = i16::from_le_bytes([frame.data()[0], frame.data()[1]]);
            commanded.push(f64::from(counts) * COUNT_N);
        }
        old = good.unwrap_or(old);
        rig.node.handle_frame(rig.now_ns, &frame);
        if bytes.below(8) == 0 {
            let was_ramping = rig.node.is_ramping();
            let load = force_n(rig.tick());
            let is_idle = !rig.node.is_armed() && !was_ramping && !rig.node.is_ramping();
            assert!(load.abs() <= limit_n, "{number}: {load}");
            assert!(!is_idle || load == 0.0, "{number}: {load} while {:?}", rig.node.state());
            assert!(!rig.node.is_armed() || was_ramping || commanded.contains(&load), "{number}: {load}");
            commanded = vec![load, 0.0];
            rig.sent.clear();
            rig.events.clear();
        }
    }
    let refused = rig.node.frames().refused;
    assert!(refused > 500_000, "{refused} of a million were rejected");
    assert!(rig.node.refusals().total() > 0);
}

fn hostile(bytes: &mut Bytes, old: &Frame) -> Frame {
    let mut payload = [0; 8];
    payload.copy_from_slice(&old.data()[..8]);
    let classic = FrameFormat::Classic;
    let (id, format, length) = match bytes.below(7) {
        0 => {
            let bit = bytes.below(64) as usize;
            payload[bit / 8] ^= 1 << (bit % 8);
            (DRIVE, classic, 8)
        }
        1 => (DRIVE, classic, bytes.below(8) as usize),
        2 => (DRIVE, classic, 8),
        3 => (DRIVE, FrameFormat::Remote, bytes.below(9) as usize),
        4 => (Id::Extended(0x100), classic, 8),
        5 => (DRIVE, FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false }, 8),
        _ => {
            payload = bytes.number().wrapping_mul(0xD134_2543_DE82_EF95).to_le_bytes();
            (DRIVE, classic, 8)
        }
    };
    Frame::new(id, format, &payload[..length]).unwrap()
}

/// The frame would arm, but for the end of its load.
#[test]
fn a_refused_frame_asks_for_nothing() {
    let mut message = drive(DRIVE, 0, LoadInput::ForceX);
    message.protection = Protection::default();
    message.commands[0].signal = signal(24, 32, Number::Float, 1.0);
    let mut rig = Rig::of(mapping(vec![message]), TimeBase::Clock);
    let not_a_number = f32::NAN.to_le_bytes();
    let [a, b, c, d] = not_a_number;
    for payload in [&[0, 0, 1, 0][..], &[0, 0, 1, a, b, c, d, 0]] {
        rig.node.handle_frame(0, &Frame::new(DRIVE, FrameFormat::Classic, payload).unwrap());
        rig.tick();
        assert_eq!(rig.node.state(), NodeState::PreOperational, "{payload:?}");
    }
    assert_eq!(rig.node.frames().refused, 2);
}

#[test]
fn each_check_says_what_it_found() {
    let mut rig = Rig::new();
    let good = rig.frame(DRIVE, 10, false, false);
    let cut = Frame::new(DRIVE, FrameFormat::Classic, &good.data()[..4]).unwrap();
    let mut wrong = [0; 8];
    wrong.copy_from_slice(good.data());
    wrong[0] ^= 1;
    let wrong = Frame::new(DRIVE, FrameFormat::Classic, &wrong).unwrap();
    for frame in [cut, wrong, good, good] {
        rig.node.handle_frame(0, &frame);
    }
    for _ in 0..6 {
        rig.frame(DRIVE, 0, false, false);
    }
    let late = rig.frame(DRIVE, 0, false, false);
    rig.node.handle_frame(0, &late);
    rig.tick();
    let check = |event: &NodeEvent| match event {
        NodeEvent::Frame(FrameFault::Mapped { id: DRIVE, check }) => Some(*check),
        _ => None,
    };
    let checks: Vec<FrameCheck> = rig.events.iter().filter_map(check).collect();
    assert_eq!(checks, [FrameCheck::Checksum, FrameCheck::Checksum, FrameCheck::Counter, FrameCheck::Counter]);
    assert_eq!(rig.node.frames().refused, 4);
}
