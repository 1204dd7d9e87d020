//! Frames, good and bad, for both receivers.

use std::cell::RefCell;

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use resonarm_protocol::{Frame, FrameFormat, Id, MessageKind, Network, Profile};
use serde_json::Value;

use super::{Harness, common};

const CLASSIC: &str = include_str!("../../vectors/classic.json");
const FD: &str = include_str!("../../vectors/fd.json");

fn message(value: &Value) -> resonarm_protocol::Message {
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| value.as_str().unwrap().parse().unwrap());
    let signals = value["signals"].as_object().unwrap();
    let signals = signals.iter().map(|(name, value)| (name.clone(), number(value))).collect();
    common::message(common::kind(value["message"].as_str().unwrap()), &signals)
}

fn do_what_the_golden_frames_say(mut both: Harness, profile: Profile, text: &str) {
    let held: Value = serde_json::from_str(text).unwrap();
    for case in held["cases"].as_array().unwrap() {
        let id = |at: usize| case["node_ids"][at].as_u64().unwrap() as u8;
        let network = Network::new(case["base"].as_u64().unwrap() as u16).unwrap();
        both.begin(network.with_node_ids(id(0), id(1)).unwrap().with_profile(profile));
        for step in case["steps"].as_array().unwrap() {
            let frame = common::frame(step["frame"].as_str().unwrap());
            if let Some(sent) = step.get("send") {
                assert_eq!(both.encode(&message(sent)), Ok(frame), "{}", case["name"]);
            }
            match step["result"].as_str().unwrap() {
                "accepted" => assert_eq!(both.accept(&frame), Ok(Some(message(&step["accepted"]))), "{}", case["name"]),
                "ignored" => assert_eq!(both.accept(&frame), Ok(None), "{}", case["name"]),
                "refused" => assert!(both.accept(&frame).is_err(), "{}", case["name"]),
                other => assert_eq!(other, "lost"),
            }
        }
        assert_eq!(case["lost"], both.lost(), "{}", case["name"]);
    }
    both.begin(common::network(profile));
    for step in held["unsendable"].as_array().unwrap() {
        assert!(both.encode(&message(step)).is_err(), "{step}");
    }
    both.end();
}

#[test]
fn both_do_what_the_golden_frames_say() {
    for (profile, text) in Profile::ALL.into_iter().zip([CLASSIC, FD]) {
        do_what_the_golden_frames_say(Harness::start(profile), profile, text);
    }
    do_what_the_golden_frames_say(Harness::start_classic_only(), Profile::Classic, CLASSIC);
}

/// Most of the time the bits of a frame that must be zero, in the place of others.
fn clear_reserved(kind: MessageKind, data: &mut [u8]) {
    let zero: &[usize] = match kind {
        MessageKind::Force | MessageKind::Torque => &[3, 6, 7],
        MessageKind::Sensors => &[6, 7],
        MessageKind::SensorPair => &[7, 56, 57, 58, 59, 60, 61, 62, 63],
        _ => &[4, 5, 6, 7],
    };
    for place in zero {
        data.get_mut(*place).into_iter().for_each(|byte| *byte = 0);
    }
    if matches!(kind, MessageKind::Sensors | MessageKind::SensorPair) {
        // The flags; in half of the frames one bit too many.
        data[3] &= 0x7F;
        data[6] &= 0x3F;
    }
}

/// A byte at random: any, one of the first, or one at the end of a range.
fn likely_byte((value, choice): (u8, u8)) -> u8 {
    match choice % 5 {
        0 => value,
        1 => value % 14,
        2 => 0x80,
        3 => 0x7F,
        _ => 0,
    }
}

/// A frame on an identifier of the protocol, of the form that it has there, most of the time with the right CRC.
fn likely_frame(profile: Profile) -> impl Strategy<Value = Frame> {
    let kinds: Vec<_> = MessageKind::ALL.into_iter().filter_map(|kind| Some((kind, kind.form(profile)?))).collect();
    let frames = (prop::sample::select(kinds), any::<[u64; 16]>(), 0..16);
    frames.prop_map(move |((kind, form), random, fate)| {
        let id = Id::Standard(kind.id(Network::default()));
        let (values, choices) = random.split_at(8);
        let bytes = |of: &[u64]| of.iter().flat_map(|eight| eight.to_le_bytes()).collect::<Vec<u8>>();
        let mut data: Vec<u8> = bytes(values).into_iter().zip(bytes(choices)).map(likely_byte).collect();
        data.truncate(form.length);
        if fate > 1 && data.len() > 8 {
            // Counters that follow each other now and then.
            data[2] %= 4;
            clear_reserved(kind, &mut data);
        }
        let frame = Frame::new(id, form.format, &data).unwrap();
        if fate > 0 { common::with_content(profile, &frame, |_| {}) } else { frame }
    })
}

/// A frame of any identifier, format and length.
fn any_frame() -> impl Strategy<Value = Frame> {
    let ids = prop_oneof![
        8 => prop::sample::select(MessageKind::ALL.map(|kind| Id::Standard(kind.id(Network::default()))).to_vec()),
        1 => (0u16..0x800).prop_map(Id::Standard),
        1 => (0u32..0x2000_0000).prop_map(Id::Extended),
    ];
    let fd = FrameFormat::Fd { bit_rate_switch: false, error_state_indicator: true };
    let formats = prop_oneof![Just(FrameFormat::Classic), Just(FrameFormat::Remote), Just(fd)];
    let length = prop::sample::select(&[0_usize, 1, 2, 7, 8, 12, 16, 32, 48, 64][..]);
    (ids, formats, length, any::<u8>()).prop_map(|(id, format, length, byte)| {
        let is_fd = matches!(format, FrameFormat::Fd { .. });
        Frame::new(id, format, &vec![byte; if is_fd { length } else { length.min(8) }]).unwrap()
    })
}

fn judge_random_frames_alike(both: Harness, profile: Profile) {
    let both = RefCell::new(both);
    let seen = RefCell::new([0_u32; 3]);
    let frames = prop_oneof![4 => likely_frame(profile).boxed(), 1 => any_frame().boxed()];
    TestRunner::new(Config { cases: 20_000, failure_persistence: None, ..Config::default() })
        .run(&frames, |frame| {
            let place = match both.borrow_mut().accept(&frame) {
                Ok(Some(_)) => 0,
                Ok(None) => 1,
                Err(_) => 2,
            };
            seen.borrow_mut()[place] += 1;
            Ok(())
        })
        .unwrap();
    assert!(seen.borrow().iter().all(|count| *count > 500), "{seen:?}");
    let mut both = both.into_inner();
    both.lost();
    both.end();
}

#[test]
fn both_judge_random_frames_alike() {
    Profile::ALL.into_iter().for_each(|profile| judge_random_frames_alike(Harness::start(profile), profile));
    judge_random_frames_alike(Harness::start_classic_only(), Profile::Classic);
}

#[test]
fn both_refuse_every_error_of_one_or_two_bits() {
    for profile in Profile::ALL {
        let mut both = Harness::start(profile);
        let mut first_of_each: Vec<_> = common::samples_of(profile);
        first_of_each.dedup_by_key(|message| message.kind());
        // Every third classical message, and the commands and sensors of CAN FD, of whose pairs of bits there are more.
        for message in first_of_each.iter().step_by(3) {
            let frame = common::first_frame(profile, message);
            let bits = 8 * frame.len();
            let step = if bits > 64 { 97 } else { 5 };
            if bits == 8 {
                continue;
            }
            for (one, two) in (0..bits).flat_map(|one| (one..bits).map(move |two| (one, two))).step_by(step) {
                let mut data = frame.data().to_vec();
                for bit in [Some(one), Some(two).filter(|two| *two != one)].into_iter().flatten() {
                    data[bit / 8] ^= 1 << (bit % 8);
                }
                assert!(both.accept(&Frame::new(frame.id(), frame.format(), &data).unwrap()).is_err());
            }
        }
        both.end();
    }
}
