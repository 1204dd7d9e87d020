use super::*;
use resonarm_protocol::e2e::{profile5, profile11};

const ID: Id = Id::Standard(0x123);

fn layout(start_bit: u64, bits: u64, order: ByteOrder) -> Layout {
    Layout::new(start_bit, bits, order, Number::Unsigned, 64).unwrap()
}

fn intel(start_bit: u64, bits: u64) -> Layout {
    layout(start_bit, bits, ByteOrder::Intel)
}

fn motorola(start_bit: u64, bits: u64) -> Layout {
    layout(start_bit, bits, ByteOrder::Motorola)
}

/// The payload with fields and checksum of a preset.
fn written(preset: Preset, place: Layout, counter: Option<Layout>, data_id: &DataId, payload: &[u8]) -> Vec<u8> {
    let checksum = preset.checksum(place, counter, data_id, payload.len()).unwrap();
    let mut payload = payload.to_vec();
    checksum.write(ID, &mut payload).unwrap();
    assert_eq!(checksum.check(ID, &payload), Ok(()));
    // Every bit of the payload is protected: by the checksum, or as one of its fixed fields.
    for bit in 0..8 * payload.len() {
        let mut damaged = payload.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(checksum.check(ID, &damaged).is_err(), "{preset}: bit {bit}");
    }
    payload
}

#[test]
fn profile_11_is_that_of_the_protocol() {
    for seed in 0..=255_u8 {
        let mut payload: [u8; 8] = core::array::from_fn(|byte| seed.wrapping_mul(byte as u8 + 31) ^ 0xA5);
        let data_id = 0x5200 + u16::from(seed);
        payload[0] = profile11::crc(data_id, &payload);
        let data_id = DataId::One(u32::from(data_id));
        for preset in [Preset::AutosarP11, Preset::AutosarP1] {
            assert_eq!(written(preset, intel(0, 8), None, &data_id, &payload), payload);
        }
    }
}

#[test]
fn profile_5_is_that_of_the_protocol() {
    for length in [8, 12, 20, 64] {
        let mut payload: Vec<u8> = (0..length).map(|byte: u8| byte.wrapping_mul(37) ^ 0x5A).collect();
        let crc = profile5::crc(0x520B, &payload).to_le_bytes();
        payload[..2].copy_from_slice(&crc);
        let ours = written(Preset::AutosarP5, intel(0, 16), Some(intel(16, 8)), &DataId::One(0x520B), &payload);
        assert_eq!(ours, payload);
    }
}

/// The examples of AUTOSAR FO PRS E2EProtocol: zeros, counter 0.
#[test]
fn gives_the_examples_of_the_standard() {
    let ours = written(Preset::AutosarP5, intel(0, 16), None, &DataId::One(0x1234), &[0; 8]);
    assert_eq!(ours, [0x1C, 0xCA, 0, 0, 0, 0, 0, 0]);
    let ours = written(Preset::AutosarP5, intel(64, 16), None, &DataId::One(0x1234), &[0; 16]);
    assert_eq!(ours[8..10], [0x28, 0x91]);
    let ours = written(Preset::AutosarP4, motorola(71, 32), None, &DataId::One(0x0A0B_0C0D), &[0; 16]);
    assert_eq!(ours, [0, 16, 0, 0, 0xA, 0xB, 0xC, 0xD, 0x86, 0x2B, 0x05, 0x56, 0, 0, 0, 0]);
    let ours = written(Preset::AutosarP6, motorola(7, 16), None, &DataId::One(0x1234), &[0; 8]);
    assert_eq!(ours, [0xB1, 0x55, 0, 8, 0, 0, 0, 0]);
    let ours = written(Preset::AutosarP7, motorola(7, 64), None, &DataId::One(0x0A0B_0C0D), &[0; 24]);
    assert_eq!(ours[..12], [0x1F, 0xB2, 0xE7, 0x37, 0xFC, 0xED, 0xBC, 0xD9, 0, 0, 0, 24]);
    let ours = written(Preset::AutosarP11, intel(0, 8), None, &DataId::One(0x123), &[0; 8]);
    assert_eq!(ours, [0xCC, 0, 0, 0, 0, 0, 0, 0]);
    let ours = written(Preset::AutosarP11Nibble, intel(0, 8), None, &DataId::One(0x123), &[0; 8]);
    assert_eq!(ours, [0x2A, 0x10, 0, 0, 0, 0, 0, 0]);
    let ids = DataId::ByCounter(core::array::from_fn(|counter| counter as u8 + 1));
    let ours = written(Preset::AutosarP2, intel(0, 8), Some(intel(8, 4)), &ids, &[0, 1, 0, 0, 0, 0, 0, 0]);
    // Profile 2 by hand: the checksum is over the payload without its own byte, then the data id of counter 1, which
    // is 2.
    let by_hand = Preset::Crc82f.algorithm().unwrap().of([1, 0, 0, 0, 0, 0, 0, 2]);
    assert_eq!(u64::from(ours[0]), by_hand);
}

#[test]
fn alternates_the_data_id_by_the_counter() {
    let alternating = |payload: &[u8]| {
        written(Preset::AutosarP1Alternating, intel(0, 8), Some(intel(8, 4)), &DataId::One(0x3412), payload)
    };
    let low = |id, payload: &[u8]| written(Preset::AutosarP1Low, intel(0, 8), None, &DataId::One(id), payload);
    assert_eq!(alternating(&[0, 6, 7, 8]), low(0x12, &[0, 6, 7, 8]));
    assert_eq!(alternating(&[0, 7, 7, 8]), low(0x34, &[0, 7, 7, 8]));
}

#[test]
fn presets_come_back_from_their_names() {
    for preset in Preset::ALL {
        assert_eq!(preset.name().parse(), Ok(preset));
    }
    let unknown = "autosar-p3".parse::<Preset>().unwrap_err().to_string();
    assert!(
        unknown.starts_with(r#"there is no checksum "autosar-p3": expected one of autosar-p1, autosar-p1-alternating"#)
    );
}

#[test]
fn refuses_what_the_profile_does_not_have() {
    let refused = |preset: Preset, place, counter, data_id: DataId, bytes| {
        preset.checksum(place, counter, &data_id, bytes).unwrap_err().to_string()
    };
    let one = || DataId::One(1);
    for (got, expected) in [
        (
            refused(Preset::AutosarP5, intel(8, 8), None, one(), 8),
            "autosar-p5: its signal has 8 bits, but the checksum needs 16",
        ),
        (
            refused(Preset::AutosarP5, motorola(7, 16), None, one(), 8),
            "autosar-p5: its checksum is at 7|16@0+: at this byte the profile expects 0|16@1+",
        ),
        (
            refused(Preset::AutosarP2, intel(0, 8), Some(intel(12, 4)), DataId::ByCounter([0; 16]), 8),
            "autosar-p2: its counter is at 12|4@1+: the profile expects it at 8|4@1+",
        ),
        (
            refused(Preset::AutosarP2, intel(0, 8), None, DataId::ByCounter([0; 16]), 8),
            "autosar-p2 needs a counter, but the message has none: give its signal as `counter`",
        ),
        (
            refused(Preset::AutosarP2, intel(0, 8), None, one(), 8),
            "autosar-p2 expects 16 data ids, one for each counter",
        ),
        (refused(Preset::AutosarP1, intel(0, 8), None, DataId::None, 8), "autosar-p1 expects one data id"),
        (refused(Preset::Sum, intel(0, 8), None, one(), 8), "sum expects no data id"),
        (
            refused(Preset::AutosarP1Low, intel(0, 8), None, DataId::One(0x100), 8),
            "autosar-p1-low: data id 0x100 is too large: it must be at most 0xff",
        ),
        (
            refused(Preset::AutosarP1, intel(0, 8), Some(intel(8, 8)), one(), 8),
            "autosar-p1: its counter has 8 bits: the profile expects 4",
        ),
        (
            refused(Preset::AutosarP4, motorola(7, 32), None, one(), 16),
            "autosar-p4 has its length -8 bytes from the checksum, which is outside of the payload of 16 bytes",
        ),
    ] {
        assert_eq!(got, expected);
    }
}

/// A checksum of half a byte: 8 minus the sum of all half bytes, with those of the identifier, and its own as zero.
#[test]
fn sums_half_bytes_around_its_own() {
    let sum = Algorithm::NibbleSum(Sum::new(4, 8, 0, true).unwrap());
    let part = Part::Id { bytes: 2, order: ByteOrder::Motorola };
    let checksum = Checksum::new(sum, intel(56, 4)).unwrap().with_parts(vec![part], vec![]).unwrap();
    let mut payload = [0x12, 0x34, 0, 0, 0, 0, 0, 0x5F];
    checksum.write(ID, &mut payload).unwrap();
    // The identifier 0x123 in two bytes, then the payload; the upper half of the last byte is the 5, and the lower
    // the checksum.
    let nibbles = 1 + 2 + 3 + 1 + 2 + 3 + 4 + 5;
    assert_eq!(payload[7], 0x50 | (8_u8.wrapping_sub(nibbles) & 0xF));
}

#[test]
fn takes_the_bytes_in_the_stated_order() {
    let crc = || Algorithm::Crc(Crc::new(8, 0xD5, 0, 0, false).unwrap());
    let payload = [9, 1, 2, 3, 4, 5];
    let whole = Checksum::new(crc(), intel(40, 8)).unwrap();
    assert_eq!(whole.compute(ID, &payload), Some(crc().of([9, 1, 2, 3, 4])));
    assert_eq!(whole.clone().with_own(Own::Zero).compute(ID, &payload), Some(crc().of([9, 1, 2, 3, 4, 0])));
    assert_eq!(whole.clone().reversed().compute(ID, &payload), Some(crc().of([4, 3, 2, 1, 9])));
    let some = whole.clone().without(&[0, 2]).unwrap();
    assert_eq!(some.compute(ID, &payload), Some(crc().of([1, 3, 4])));
    assert_eq!(whole.clone().without(&[64]), Err(ChecksumError::LeftOut { got: 64 }));
    let before = vec![
        Part::Id { bytes: 4, order: ByteOrder::Intel },
        Part::Length { bytes: 1, order: ByteOrder::Motorola },
        Part::Bytes(vec![7, 8]),
    ];
    let after = vec![Part::ByCounter { counter: intel(8, 4), table: vec![50, 51, 52] }];
    let with_parts = some.with_parts(before, after).unwrap();
    let expected = crc().of([0x23, 0x01, 0, 0, 6, 7, 8, 1, 3, 4, 51]);
    assert_eq!(with_parts.compute(ID, &payload), Some(expected));
    assert_eq!(with_parts.check(ID, &payload), Err(ChecksumFault::Wrong { got: 5, expected }));
    assert_eq!(with_parts.check(ID, &payload[..5]), Err(ChecksumFault::Short { got: 5, needed: 6 }));
    let empty = vec![Part::ByCounter { counter: intel(0, 8), table: vec![] }];
    assert_eq!(whole.clone().with_parts(empty, vec![]), Err(ChecksumError::EmptyTable));
    let bytes = ChecksumError::PartBytes { what: "an identifier", got: 5, most: 4 };
    let id = vec![Part::Id { bytes: 5, order: ByteOrder::Intel }];
    assert_eq!(whole.with_parts(id, vec![]), Err(bytes));
}

#[test]
fn checks_the_fields_of_a_profile() {
    let payload = written(Preset::AutosarP4, motorola(71, 32), None, &DataId::One(7), &[0; 12]);
    let other = Preset::AutosarP4.checksum(motorola(71, 32), None, &DataId::One(8), 12).unwrap();
    let wrong = ChecksumFault::Field { field: FieldKind::DataId, got: 7, expected: 8 };
    assert_eq!(other.check(ID, &payload), Err(wrong));
    assert_eq!(wrong.to_string(), "the data id in the payload is 0x7, expected 0x8");
}
