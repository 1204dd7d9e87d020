//! Frames, good and bad, for both receivers.

use std::cell::RefCell;

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use resonarm_protocol::{Frame, FrameFormat, Id, MessageKind, Network, Profile};
use serde_json::Value;

use super::{Harness, common};

fn message(value: &Value) -> resonarm_protocol::Message {
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| value.as_str().unwrap().parse().unwrap());
    let signals = value["signals"].as_object().unwrap();
    let signals = signals.iter().map(|(name, value)| (name.clone(), number(value))).collect();
    common::message(common::kind(value["message"].as_str().unwrap()), &signals)
}

#[test]
fn both_do_what_the_golden_frames_say() {
    let text = include_str!("../../vectors/classic.json");
    let held: Value = serde_json::from_str(text).unwrap();
    let mut both = Harness::start();
    for case in held["cases"].as_array().unwrap() {
        let id = |at: usize| case["node_ids"][at].as_u64().unwrap() as u8;
        let network = Network::new(case["base"].as_u64().unwrap() as u16).unwrap();
        both.begin(network.with_node_ids(id(0), id(1)).unwrap());
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
    for step in held["unsendable"].as_array().unwrap() {
        assert!(both.encode(&message(step)).is_err(), "{step}");
    }
    both.end();
}

/// What is put on the bus, most of it on the identifiers of the protocol and with the right CRC.
fn any_frame() -> impl Strategy<Value = Frame> {
    let ids = prop_oneof![
        8 => prop::sample::select(MessageKind::ALL.map(|kind| Id::Standard(kind.id(Network::default()))).to_vec()),
        1 => (0u16..0x800).prop_map(Id::Standard),
        1 => (0u32..0x2000_0000).prop_map(Id::Extended),
    ];
    let fd = FrameFormat::Fd { bit_rate_switch: false, error_state_indicator: true };
    let formats = prop_oneof![12 => Just(FrameFormat::Classic), 1 => Just(FrameFormat::Remote), 1 => Just(fd)];
    let byte = prop_oneof![any::<u8>(), 0u8..14, Just(0x80), Just(0)];
    let data = prop_oneof![
        6 => prop::collection::vec(byte.clone(), 8),
        2 => prop::collection::vec(byte.clone(), 1),
        1 => prop::collection::vec(byte, 0..=8),
    ];
    (ids, formats, data, 0..8).prop_map(|(id, format, data, fate)| {
        let frame = Frame::new(id, format, &data).unwrap();
        let whole = format == FrameFormat::Classic && data.len() == 8;
        if whole && fate > 0 { common::with_content(Profile::Classic, &frame, |_| {}) } else { frame }
    })
}

#[test]
fn both_judge_random_frames_alike() {
    let both = RefCell::new(Harness::start());
    let seen = RefCell::new([0_u32; 3]);
    TestRunner::new(Config { cases: 20_000, failure_persistence: None, ..Config::default() })
        .run(&any_frame(), |frame| {
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
fn both_refuse_every_error_of_one_or_two_bits() {
    let mut both = Harness::start();
    let mut first_of_each: Vec<_> = common::samples_of(Profile::Classic);
    first_of_each.dedup_by_key(|message| message.kind());
    for message in first_of_each.iter().step_by(3) {
        let frame = common::first_frame(Profile::Classic, message);
        let Ok(sent) = <[u8; 8]>::try_from(frame.data()) else { continue };
        for (one, two) in (0..64).flat_map(|one| (one..64).map(move |two| (one, two))).step_by(5) {
            let data = (u64::from_le_bytes(sent) ^ (1 << one | 1 << two)).to_le_bytes();
            assert!(both.accept(&Frame::classic(frame.id(), &data).unwrap()).is_err());
        }
    }
    both.end();
}
