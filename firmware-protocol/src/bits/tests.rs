use proptest::prelude::*;
use std::vec::Vec;

use super::*;

/// The bits of `count` digits of a number.
fn digits(value: u32, count: usize) -> Vec<u8> {
    (0..count).rev().map(|k| (value >> k & 1) as u8).collect()
}

/// The remainder of the bits, as a polynomial over GF(2) times x¹⁵, by long division.
fn crc_15(bits: &[u8]) -> Vec<u8> {
    // The polynomial with its highest power, x¹⁵: 8000h + 4599h.
    let divisor = digits(0xC599, 16);
    let mut rest = [bits, &[0; 15]].concat();
    for k in 0..bits.len() {
        if rest[k] == 1 {
            divisor.iter().enumerate().for_each(|(j, digit)| rest[k + j] ^= digit);
        }
    }
    rest.split_off(bits.len())
}

/// The bits with stuff bits: after each five equal ones of the result so far.
fn stuffed(bits: &[u8]) -> Vec<u8> {
    let mut line: Vec<u8> = Vec::new();
    let mut since = 0;
    for bit in bits {
        line.push(*bit);
        if line.len() - since >= 5 && line[line.len() - 5..].iter().all(|last| last == bit) {
            since = line.len();
            line.push(1 - bit);
        }
    }
    line
}

/// All bits before DLC or ESI.
fn head(frame: &Frame) -> Vec<u8> {
    let fd = match frame.format() {
        FrameFormat::Fd { bit_rate_switch, .. } => Some(u8::from(bit_rate_switch)),
        _ => None,
    };
    let request = u8::from(frame.format() == FrameFormat::Remote);
    let identifier = match frame.id() {
        Id::Standard(id) => [&digits(u32::from(id), 11)[..], &[request, 0]].concat(),
        Id::Extended(id) => [&digits(id >> 18, 11)[..], &[1, 1], &digits(id, 18), &[request]].concat(),
    };
    let last = match (fd, frame.id()) {
        (Some(switch), _) => [1, 0, switch].to_vec(),
        (None, Id::Standard(_)) => [0].to_vec(),
        (None, Id::Extended(_)) => [0, 0].to_vec(),
    };
    [&[0][..], &identifier, &last].concat()
}

fn data(frame: &Frame) -> Vec<u8> {
    frame.data().iter().flat_map(|byte| digits(u32::from(*byte), 8)).collect()
}

/// The whole classical frame as on the wire.
fn classical(frame: &Frame) -> Vec<u8> {
    let mut bits = [head(frame), digits(frame.len() as u32, 4), data(frame)].concat();
    bits.extend(crc_15(&bits));
    [&stuffed(&bits)[..], &[1; 13]].concat()
}

const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// The FD frame as on the wire up to BRS, and from there to the delimiter, with the CRC's bits taken from `noise`.
fn fd(frame: &Frame, indicator: bool, noise: u32) -> (Vec<u8>, Vec<u8>) {
    let head = head(frame);
    let code = LENGTHS.iter().position(|len| *len == frame.len()).unwrap() as u32;
    let bits = [&head[..], &[u8::from(indicator)], &digits(code, 4), &data(frame)].concat();
    let mut line = stuffed(&bits);
    // No stuff bit follows the last bit.
    if stuffed(&bits[..bits.len() - 1]).len() + 2 == line.len() {
        line.pop();
    }
    let check = digits(noise, 4 + if frame.len() > 16 { 21 } else { 17 });
    for (k, bit) in check.iter().enumerate() {
        if k % 4 == 0 {
            line.push(1 - line.last().unwrap());
        }
        line.push(*bit);
    }
    line.push(1);
    let tail = line.split_off(stuffed(&head).len());
    (line, tail)
}

fn id() -> impl Strategy<Value = Id> {
    prop_oneof![(0..=0x7FF_u16).prop_map(Id::Standard), (0..=0x1FFF_FFFF_u32).prop_map(Id::Extended)]
}

/// Arbitrary bytes, and bytes with long runs.
fn bytes(len: usize) -> impl Strategy<Value = Vec<u8>> {
    // Bytes of long runs: among arbitrary ones stuff bits are too seldom for their corner cases.
    let run = proptest::sample::select(&[0x00, 0xFF, 0xF0, 0x0F, 0x3C, 0xC3, 0x78, 0x87, 0x1E, 0xE1, 0x07, 0xF8][..]);
    prop_oneof![proptest::collection::vec(any::<u8>(), len), proptest::collection::vec(run, len)]
}

fn id_format(frame: &Frame) -> IdFormat {
    if matches!(frame.id(), Id::Standard(_)) { IdFormat::Standard } else { IdFormat::Extended }
}

fn is_within_bounds(frame: &Frame) -> bool {
    let [least, most] = [Stuffing::None, Stuffing::Worst]
        .map(|stuffing| bounds(id_format(frame), frame.format(), frame.len(), stuffing));
    let bits = of(frame);
    (least.nominal..=most.nominal).contains(&bits.nominal) && (least.data..=most.data).contains(&bits.data)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_classical_frame_has_the_bits_of_its_string(
        id in id(), data in (0..=8_usize).prop_flat_map(bytes), remote: bool,
    ) {
        let format = if remote { FrameFormat::Remote } else { FrameFormat::Classic };
        let frame = Frame::new(id, format, &data).unwrap();
        prop_assert_eq!(of(&frame), Bits { nominal: classical(&frame).len() as u64, data: 0 });
        prop_assert!(is_within_bounds(&frame));
    }

    #[test]
    fn an_fd_frame_has_the_bits_of_its_string_whatever_its_crc(
        id in id(), data in proptest::sample::select(&LENGTHS[..]).prop_flat_map(bytes),
        switch: bool, indicator: bool, noise: u32,
    ) {
        let format = FrameFormat::Fd { bit_rate_switch: switch, error_state_indicator: indicator };
        let frame = Frame::new(id, format, &data).unwrap();
        let (head, tail) = fd(&frame, indicator, noise);
        let line = [&head[..], &tail].concat();
        // Six equal bits are an error, except at the delimiter, which ends the stuffed bits.
        prop_assert!(line[..line.len() - 1].windows(6).all(|six| six.iter().any(|bit| *bit != six[0])));
        let (nominal, data) = (head.len() as u64 + 12, tail.len() as u64);
        let expected = if switch { Bits { nominal, data } } else { Bits { nominal: nominal + data, data: 0 } };
        prop_assert_eq!(of(&frame), expected);
        prop_assert!(is_within_bounds(&frame));
    }
}

/// The result of `noticed_after`, found from the bits up to CRC and ACK delimiter; `stuffed` bits are stuffed.
fn noticed_in(line: &[u8], stuffed: usize, k: usize, behind: u8) -> Option<u64> {
    // 40 bits reach beyond every place where an error may still be seen.
    let disturbed = [&line[..k], &[1 - line[k]], &[behind; 40]].concat();
    let is_six = |bit: usize| bit >= 5 && disturbed[bit - 5..=bit].iter().all(|level| *level == disturbed[bit]);
    let is_fixed = |bit: usize| bit >= stuffed && (bit - stuffed).is_multiple_of(5);
    let is_error = |bit: usize| match bit {
        _ if bit < stuffed => is_six(bit),
        _ if bit < line.len() => is_fixed(bit) && disturbed[bit] == disturbed[bit - 1],
        _ => bit == line.len() + 2 * usize::from(behind),
    };
    (k..).find(|bit| is_error(*bit)).map(|bit| (bit - k) as u64)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn receivers_notice_a_disturbed_bit_where_the_string_of_a_classical_frame_says(
        id in id(), data in (0..=8_usize).prop_flat_map(bytes),
    ) {
        let frame = Frame::classic(id, &data).unwrap();
        let mut line = classical(&frame);
        line.truncate(line.len() - 13);
        for (behind, level) in [Level::Dominant, Level::Recessive].into_iter().enumerate() {
            for k in 1..line.len() {
                let expected = noticed_in(&line, line.len(), k, behind as u8);
                prop_assert_eq!(noticed_after(&frame, k as u64, level), expected, "bit {}, {:?}", k, level);
            }
            for k in line.len()..line.len() + 10 {
                prop_assert_eq!(noticed_after(&frame, k as u64, level), Some(0));
            }
        }
    }

    #[test]
    fn receivers_notice_a_disturbed_bit_where_the_string_of_an_fd_frame_says(
        id in id(), data in proptest::sample::select(&LENGTHS[..]).prop_flat_map(bytes), noise: u32,
    ) {
        let format = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
        let frame = Frame::new(id, format, &data).unwrap();
        let (head, tail) = fd(&frame, false, noise);
        let mut line = [head, tail].concat();
        line.pop();
        let stuffed = line.len() + 1 - fd_check(frame.len()) as usize;
        for (behind, level) in [Level::Dominant, Level::Recessive].into_iter().enumerate() {
            for k in 1..line.len() {
                // The bit before it is unknown there: the next fixed stuff bit may happen to equal it.
                let is_known = k < stuffed || !(k + 1 - stuffed).is_multiple_of(5);
                let (expected, got) = (noticed_in(&line, stuffed, k, behind as u8), noticed_after(&frame, k as u64, level));
                prop_assert!(got == expected || !is_known && got > expected, "bit {k}, {level:?}: {got:?}, {expected:?}");
            }
        }
    }
}

/// Receivers see an idle bus before SOF, and after it.
#[test]
fn a_disturbed_sof_is_noticed_by_its_error_flag_alone() {
    let frame = Frame::classic(Id::Standard(0), &[]).unwrap();
    assert_eq!([Level::Dominant, Level::Recessive].map(|level| noticed_after(&frame, 0, level)), [Some(6), None]);
    // 00000 and the stuff bit.
    assert_eq!(
        (1..=5).map(|k| noticed_after(&frame, k, Level::Dominant)).collect::<Vec<_>>(),
        [Some(6), Some(6), Some(6), Some(6), Some(0)]
    );
    assert_eq!(noticed_after(&frame, 6, Level::Recessive), Some(4));
}

/// Computed with `can_frame_length(…, CFL_EXACT, …)` of can-utils.
#[test]
fn classical_frames_have_the_length_that_can_utils_gives() {
    let ramp = [1, 2, 3, 4, 5, 6, 7, 8];
    let force = [0x8A, 0, 0xF4, 1, 0x83, 0xFF, 0x34, 0x12];
    let runs = [0xF0, 0xF8, 0x7C, 0x3E, 0x1F];
    let cases: [(Id, &[u8], u64); 11] = [
        (Id::Standard(0x000), &[], 53),
        (Id::Standard(0x7FF), &[0xFF; 8], 126),
        (Id::Standard(0x123), &ramp, 119),
        (Id::Standard(0x000), &[0; 8], 127),
        (Id::Standard(0x201), &force, 119),
        (Id::Standard(0x701), &[0x7F], 59),
        (Id::Standard(0x555), &[0x55, 0xAA, 0x0F], 74),
        (Id::Standard(0x078), &[0x3C; 8], 131),
        (Id::Extended(0x1234_5678), &[0xDE, 0xAD, 0xBE, 0xEF, 0, 0, 0, 0], 140),
        (Id::Extended(0), &[], 74),
        (Id::Extended(0x1FFF_FFFF), &runs, 120),
    ];
    for (id, data, bits) in cases {
        assert_eq!(of(&Frame::classic(id, data).unwrap()), Bits { nominal: bits, data: 0 }, "{id}");
    }
    let remote = Frame::new(Id::Standard(0x205), FrameFormat::Remote, &[]).unwrap();
    assert_eq!(of(&remote).nominal, 50);
}

#[test]
fn the_bounds_are_the_published_ones() {
    let classical =
        |id, len| [Stuffing::None, Stuffing::Worst].map(|s| bounds(id, FrameFormat::Classic, len, s).nominal);
    assert_eq!(classical(IdFormat::Standard, 8), [111, 135]);
    assert_eq!(classical(IdFormat::Extended, 8), [131, 160]);
    assert_eq!([0, 1].map(|len| classical(IdFormat::Standard, len)), [[47, 55], [55, 65]]);
    assert_eq!(bounds(IdFormat::Standard, FrameFormat::Remote, 8, Stuffing::Worst).nominal, 55);
}

#[test]
fn an_fd_frame_of_64_bytes_takes_29_bits_and_550_or_up_to_130_more() {
    let with = |bit_rate_switch| FrameFormat::Fd { bit_rate_switch, error_state_indicator: false };
    let length = |id, switch, len, stuffing| {
        let Bits { nominal, data } = bounds(id, with(switch), len, stuffing);
        (nominal, data)
    };
    assert_eq!(length(IdFormat::Standard, true, 64, Stuffing::None), (29, 550));
    assert_eq!(length(IdFormat::Standard, true, 64, Stuffing::Worst), (32, 679));
    assert_eq!(length(IdFormat::Extended, true, 64, Stuffing::Worst), (56, 679));
    // 4 + 17 bits with 6 fixed stuff bits up to 16 bytes, 4 + 21 with 7 beyond.
    assert_eq!(length(IdFormat::Standard, true, 16, Stuffing::None), (29, 5 + 128 + 21 + 6 + 1));
    assert_eq!(length(IdFormat::Standard, false, 20, Stuffing::None), (29 + 5 + 160 + 25 + 7 + 1, 0));
}

#[test]
fn a_frame_takes_the_time_of_both_phases() {
    let rates = BitRates { nominal_hz: 500_000, data_hz: 4_000_000 };
    assert_eq!(Bits { nominal: 29, data: 550 }.time_ns(rates), 58_000 + 137_500);
    assert_eq!(Bits { nominal: 1, data: 1 }.time_ns(BitRates::classical(300_000_000)), 4 + 4);
}
