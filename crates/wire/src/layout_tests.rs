use proptest::prelude::*;

use super::*;

const BOTH: [ByteOrder; 2] = [ByteOrder::Intel, ByteOrder::Motorola];

/// The numbers of the bits of a signal, the least significant first, by the definition of the numbering.
fn numbers(start_bit: u64, bits: u64, order: ByteOrder) -> Vec<u64> {
    match order {
        ByteOrder::Intel => (start_bit..start_bit + bits).collect(),
        ByteOrder::Motorola => {
            let mut number = start_bit;
            let mut found = vec![];
            for _ in 0..bits {
                found.push(number);
                // Behind bit 0 of a byte comes bit 7 of the next: 15 further in the numbering.
                number = if number.is_multiple_of(8) { number + 15 } else { number - 1 };
            }
            found.reverse();
            found
        }
    }
}

fn unsigned(start_bit: u64, bits: u64, order: ByteOrder) -> Layout {
    Layout::new(start_bit, bits, order, Number::Unsigned, 64).unwrap()
}

proptest! {
    #[test]
    fn bits_lie_where_the_numbering_says(
        start in 0_u64..512, bits in 1_u64..=64, intel in any::<bool>(), raw in any::<u64>(), noise in any::<[u8; 64]>()
    ) {
        let order = BOTH[usize::from(intel)];
        let numbers = numbers(start, bits, order);
        let needed = numbers.iter().max().unwrap() / 8 + 1;
        let layout = Layout::new(start, bits, order, Number::Unsigned, 64);
        prop_assert_eq!(layout.is_ok(), needed <= 64);
        if let Ok(layout) = layout {
            let raw = raw & layout.mask();
            let mut payload = noise;
            layout.insert_u64(raw, &mut payload).unwrap();
            let bit = |payload: &[u8; 64], number: u64| payload[number as usize / 8] >> (number % 8) & 1;
            for (significance, number) in numbers.iter().enumerate() {
                prop_assert_eq!(u64::from(bit(&payload, *number)), raw >> significance & 1);
            }
            for number in (0..512).filter(|number| !numbers.contains(number)) {
                prop_assert_eq!(bit(&payload, number), bit(&noise, number), "bit {} is another's", number);
            }
            let occupied = layout.occupied();
            for number in 0..512 {
                let is_in = occupied.in_byte(number as usize / 8) >> (number % 8) & 1 == 1;
                prop_assert_eq!(is_in, numbers.contains(&number));
            }
            prop_assert_eq!(layout.needed_bytes() as u64, needed);
            prop_assert_eq!(layout.extract_u64(&payload), Some(raw));
            prop_assert_eq!(layout.extract_u64(&payload[..needed as usize]), Some(raw));
            prop_assert_eq!(layout.extract_u64(&payload[..needed as usize - 1]), None);
        }
    }

    #[test]
    fn signed_numbers_come_back(start in 0_u64..440, bits in 1_u64..=64, intel in any::<bool>(), raw in any::<i64>()) {
        let layout = Layout::new(start, bits, BOTH[usize::from(intel)], Number::Signed, 64).unwrap();
        // An arithmetic shift keeps the sign, so that every number of this many bits occurs.
        let raw = raw >> (64 - bits);
        let mut payload = [0x5A; 64];
        layout.insert_i64(raw, &mut payload).unwrap();
        prop_assert_eq!(layout.extract_i64(&payload), Some(raw));
        prop_assert_eq!(layout.extract_f64(&payload), Some(raw as f64));
    }

    #[test]
    fn floating_point_numbers_come_back(start in 0_u64..440, intel in any::<bool>(), value in any::<f64>()) {
        let order = BOTH[usize::from(intel)];
        let mut payload = [0; 64];
        let double = Layout::new(start, 64, order, Number::Float, 64).unwrap();
        double.insert_f64(value, &mut payload).unwrap();
        prop_assert_eq!(double.extract_f64(&payload).map(f64::to_bits), Some(value.to_bits()));
        let single = Layout::new(start, 32, order, Number::Float, 64).unwrap();
        single.insert_f64(f64::from(value as f32), &mut payload).unwrap();
        prop_assert_eq!(single.extract_f64(&payload), Some(f64::from(value as f32)));
    }
}

#[test]
fn refuses_impossible_layouts() {
    let new = |start, bits, number| Layout::new(start, bits, ByteOrder::Intel, number, 8);
    assert_eq!(new(0, 0, Number::Unsigned), Err(LayoutError::Bits { got: 0 }));
    assert_eq!(new(0, 65, Number::Unsigned), Err(LayoutError::Bits { got: 65 }));
    assert_eq!(new(0, 16, Number::Float), Err(LayoutError::FloatBits { got: 16 }));
    let past = LayoutError::PastEnd { start_bit: 60, bits: 8, needed: 9, payload_bytes: 8 };
    assert_eq!(new(60, 8, Number::Signed), Err(past));
    assert_eq!(past.to_string(), "from start bit 60 its 8 bits take 9 bytes, but the payload has only 8");
    assert!(new(u64::MAX, 64, Number::Signed).is_err());
    assert_eq!(Layout::new(0, 1, ByteOrder::Intel, Number::Unsigned, 65), Err(LayoutError::Payload { got: 65 }));
}

#[test]
fn refuses_numbers_that_do_not_fit_and_leaves_the_payload() {
    let layout = unsigned(0, 4, ByteOrder::Intel);
    let mut payload = [0xA5; 8];
    assert_eq!(layout.insert_u64(16, &mut payload), Err(InsertError::Bits { got: 16, bits: 4 }));
    assert_eq!(layout.insert_i64(-9, &mut payload), Err(InsertError::Bits { got: -9, bits: 4 }));
    assert!(layout.insert_f64(f64::NAN, &mut payload).is_err());
    assert!(layout.insert_f64(0.5, &mut payload).is_err());
    assert!(layout.insert_f64(-1.0, &mut payload).is_err());
    assert_eq!(layout.insert_u64(1, &mut []), Err(InsertError::Short { got: 0, needed: 1 }));
    let single = Layout::new(7, 32, ByteOrder::Motorola, Number::Float, 8).unwrap();
    assert!(single.insert_f64(1e39, &mut payload).is_err());
    assert_eq!(payload, [0xA5; 8]);
    single.insert_f64(f64::NAN, &mut payload).unwrap();
    assert!(single.extract_f64(&payload).unwrap().is_nan());
}

#[test]
fn compares_places() {
    let nibble = |start, order| unsigned(start, 4, order);
    assert!(nibble(8, ByteOrder::Intel).is_same_place(&nibble(11, ByteOrder::Motorola)));
    assert!(!nibble(8, ByteOrder::Intel).is_same_place(&nibble(15, ByteOrder::Motorola)));
    assert!(!unsigned(0, 16, ByteOrder::Intel).is_same_place(&unsigned(7, 16, ByteOrder::Motorola)));
    let (low, high) = (nibble(0, ByteOrder::Intel).occupied(), nibble(4, ByteOrder::Intel).occupied());
    assert_eq!(low.first_common(&high), None);
    assert_eq!(high.first_common(&high), Some(4));
    assert_eq!(Bits::NONE.first_common(&high), None);
}
