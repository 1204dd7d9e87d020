//! Golden frames: holds `vectors/classic.json` and `vectors/fd.json` to the code, and writes them.
//!
//! To write the files anew: `RESONARM_WRITE_VECTORS=1 cargo test -p resonarm-protocol --test vectors`
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod case;
mod classic;
#[path = "../common/mod.rs"]
mod common;
mod fd;

use resonarm_protocol::e2e::CounterFault;
use resonarm_protocol::{DecodeError, EncodeError, Message, MessageKind, Network, Profile, Receiver, Transmitter};
use serde_json::{Value, json};

/// The number in JSON, whole ones as integers; what JSON has no number for is a string.
fn to_json(value: f64) -> Value {
    if !value.is_finite() {
        json!(value.to_string())
    } else if value == 0.0 && value.is_sign_negative() {
        json!(-0.0)
    } else if value == value.trunc() && value.abs() < 1e9 {
        json!(value as i64)
    } else {
        json!(value)
    }
}

fn from_json(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| value.as_str().unwrap().parse().unwrap())
}

fn message_to_json(message: &Message) -> Value {
    let signals: serde_json::Map<String, Value> =
        common::signals(message).into_iter().map(|(name, value)| (name, to_json(value))).collect();
    json!({ "message": message.kind().name(), "signals": signals })
}

fn message_from_json(value: &Value) -> Message {
    let signals = value["signals"].as_object().unwrap();
    let signals = signals.iter().map(|(name, value)| (name.clone(), from_json(value))).collect();
    common::message(common::kind(value["message"].as_str().unwrap()), &signals)
}

/// The word of the file for a refusal.
fn reason(error: &DecodeError) -> &'static str {
    match error {
        DecodeError::Format { .. } => "format",
        DecodeError::OtherProfile { .. } => "other profile",
        DecodeError::Length { .. } => "length",
        DecodeError::Crc { .. } => "crc",
        DecodeError::Counter { fault: CounterFault::Repeated, .. } => "repeated",
        DecodeError::Counter { fault: CounterFault::WrongSequence { .. }, .. } => "wrong sequence",
        DecodeError::Counter { fault: CounterFault::Invalid, .. } => "invalid counter",
        DecodeError::Reserved { .. } => "reserved",
        DecodeError::NotAvailable { .. } => "not available",
        DecodeError::NotFinite { .. } => "not finite",
        DecodeError::Negative { .. } => "negative",
        DecodeError::UnknownValue { .. } => "unknown value",
    }
}

fn encode_reason(error: &EncodeError) -> &'static str {
    match error {
        EncodeError::NotFinite { .. } => "not finite",
        EncodeError::OutOfRange { .. } => "out of range",
        EncodeError::Invalid { .. } => "invalid",
        EncodeError::Negative { .. } => "negative",
        EncodeError::OtherProfile { .. } => "other profile",
    }
}

fn file(profile: Profile) -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("vectors/{profile}.json"))
}

fn held(profile: Profile) -> Value {
    serde_json::from_str(&std::fs::read_to_string(file(profile)).unwrap()).unwrap()
}

fn steps(held: &Value) -> Vec<&Value> {
    held["cases"].as_array().unwrap().iter().flat_map(|case| case["steps"].as_array().unwrap()).collect()
}

/// The cases and the messages that can't be sent.
fn made(profile: Profile) -> (Vec<Value>, Vec<Value>) {
    let (cases, unsendable) = match profile {
        Profile::Classic => (classic::all(), classic::unsendable()),
        Profile::Fd => (fd::all(), fd::unsendable()),
    };
    let unsendable = unsendable.into_iter().map(|(message, reason)| {
        let mut value = message_to_json(&message);
        value["reason"] = json!(reason);
        value
    });
    (cases.iter().map(case::Case::to_json).collect(), unsendable.collect())
}

/// The file, one line a step.
fn text(profile: Profile, cases: &[Value], unsendable: &[Value]) -> String {
    let lines = |values: &[Value], indent: &str| {
        values.iter().map(|value| format!("{indent}{value}")).collect::<Vec<_>>().join(",\n")
    };
    let case = |case: &Value| {
        let (name, base, node_ids, lost) = (&case["name"], &case["base"], &case["node_ids"], &case["lost"]);
        let steps = lines(case["steps"].as_array().unwrap(), "    ");
        format!(
            "  {{\"name\":{name},\"base\":{base},\"node_ids\":{node_ids},\"lost\":{lost},\"steps\":[\n{steps}\n  ]}}"
        )
    };
    let cases = cases.iter().map(case).collect::<Vec<_>>().join(",\n");
    let unsendable = lines(unsendable, "  ");
    format!("{{\"profile\":\"{profile}\",\"cases\":[\n{cases}\n],\"unsendable\":[\n{unsendable}\n]}}\n")
}

#[test]
fn the_files_are_those_of_the_cases() {
    for profile in Profile::ALL {
        let (cases, unsendable) = made(profile);
        if std::env::var_os("RESONARM_WRITE_VECTORS").is_some() {
            std::fs::write(file(profile), text(profile, &cases, &unsendable)).unwrap();
        }
        let held = held(profile);
        assert_eq!(held["profile"], profile.name());
        assert_eq!(held["unsendable"], Value::from(unsendable));
        let held = held["cases"].as_array().unwrap();
        assert_eq!(held.len(), cases.len());
        for (held, case) in held.iter().zip(cases) {
            assert_eq!(*held, case);
        }
    }
}

#[test]
fn the_code_does_what_the_files_say() {
    for profile in Profile::ALL {
        let held = held(profile);
        held["cases"].as_array().unwrap().iter().for_each(|case| check_case(profile, case));
        for unsendable in held["unsendable"].as_array().unwrap() {
            let refused = Transmitter::new(common::network(profile)).frame(&message_from_json(unsendable));
            assert_eq!(refused.map_err(|error| encode_reason(&error)), Err(unsendable["reason"].as_str().unwrap()));
        }
    }
}

fn check_case(profile: Profile, case: &Value) {
    let node_id = |at: usize| case["node_ids"][at].as_u64().unwrap() as u8;
    let network = Network::new(case["base"].as_u64().unwrap() as u16).unwrap();
    let network = network.with_node_ids(node_id(0), node_id(1)).unwrap().with_profile(profile);
    let (mut transmitter, mut receiver) = (Transmitter::new(network), Receiver::new(network));
    for (at, step) in case["steps"].as_array().unwrap().iter().enumerate() {
        let place = format!("{} step {at}", case["name"]);
        let frame = common::frame(step["frame"].as_str().unwrap());
        if let Some(sent) = step.get("send") {
            assert_eq!(transmitter.frame(&message_from_json(sent)), Ok(frame), "{place}");
        }
        let expected = step["result"].as_str().unwrap();
        if expected == "lost" {
            continue;
        }
        match receiver.accept(&frame) {
            Ok(None) => assert_eq!(expected, "ignored", "{place}"),
            Ok(Some(message)) => {
                assert_eq!(expected, "accepted", "{place}");
                assert_eq!(message_to_json(&message), step["accepted"], "{place}");
            }
            Err(error) => {
                assert_eq!((expected, step["reason"].as_str()), ("refused", Some(reason(&error))), "{place}");
            }
        }
    }
    assert_eq!(Some(receiver.lost()), case["lost"].as_u64(), "{}", case["name"]);
}

#[test]
fn every_refusal_and_every_message_is_in_the_files() {
    let common =
        ["format", "other profile", "length", "crc", "repeated", "wrong sequence", "reserved", "unknown value"];
    for (profile, own) in
        [(Profile::Classic, ["invalid counter", "not available"]), (Profile::Fd, ["not finite", "negative"])]
    {
        let held = held(profile);
        for reason in common.iter().chain(&own) {
            assert!(steps(&held).iter().any(|step| step["reason"] == *reason), "{profile}: {reason}");
        }
        for kind in MessageKind::ALL.into_iter().filter(|kind| kind.form(profile).is_some()) {
            assert!(steps(&held).iter().any(|step| step["accepted"]["message"] == kind.name()), "{kind}");
        }
    }
}
