//! Holds the code to `resonarm.dbc`: identifiers, layouts, scaling, ranges, units, protection, names.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use can_dbc::{AttributeValue, ByteOrder, Dbc, Message as DbcMessage, MessageId, NumericValue, Signal, ValueType};
use resonarm_protocol::{
    Cycle, DBC_TEXT, DEFAULT_BASE, DecodeError, EmergencyCode, MessageKind, Network, Node, NodeState, OperatorRequest,
    PROTOCOL_VERSION, Version, e2e, scaling,
};

fn dbc() -> Dbc {
    Dbc::try_from(DBC_TEXT).unwrap()
}

fn of_kind(dbc: &Dbc, kind: MessageKind) -> &DbcMessage {
    dbc.messages.iter().find(|message| message.name == kind.name()).unwrap()
}

fn raw(signal: &Signal, data: &[u8]) -> i64 {
    let mut bytes = [0; 8];
    bytes[..data.len()].copy_from_slice(data);
    let value = u64::from_le_bytes(bytes) >> signal.start_bit & (u64::MAX >> (64 - signal.size));
    match signal.value_type {
        ValueType::Unsigned => value as i64,
        ValueType::Signed => (value << (64 - signal.size)) as i64 >> (64 - signal.size),
    }
}

fn number(value: NumericValue) -> f64 {
    match value {
        NumericValue::Uint(value) => value as f64,
        NumericValue::Int(value) => value as f64,
        NumericValue::Double(value) => value,
    }
}

fn attribute(dbc: &Dbc, id: MessageId, name: &str) -> u64 {
    match dbc.message_attribute(id, name) {
        Some(AttributeValue::Uint(value)) => *value,
        other => panic!("{name} of {id:?} is {other:?}"),
    }
}

#[test]
fn messages_are_those_of_the_code() {
    let dbc = dbc();
    assert_eq!(dbc.messages.len(), MessageKind::COUNT);
    for kind in MessageKind::ALL {
        let message = of_kind(&dbc, kind);
        assert_eq!(message.id, MessageId::Standard(kind.id(Network::default())), "{kind}");
        assert_eq!(message.size, kind.len() as u64, "{kind}");
        let sender = message.transmitter.as_deref().unwrap();
        assert_eq!(sender.to_lowercase(), kind.sender().to_string(), "{kind}");
        let cycle_ms = match kind.cycle() {
            Cycle::Sample => 1,
            Cycle::Period { period_ns } => period_ns / 1_000_000,
            Cycle::Event => 0,
        };
        assert_eq!(attribute(&dbc, message.id, "GenMsgCycleTime"), cycle_ms, "{kind}");
        assert_eq!(attribute(&dbc, message.id, "VFrameFormat"), 0, "{kind}: StandardCAN");
        let data_id = kind.data_id().map(u64::from);
        assert_eq!(attribute(&dbc, message.id, "E2EProfile"), u64::from(data_id.is_some()), "{kind}");
        assert_eq!(
            dbc.message_attribute(message.id, "E2EDataId").cloned(),
            data_id.map(AttributeValue::Uint),
            "{kind}"
        );
    }
}

#[test]
fn every_message_and_signal_is_described() {
    let dbc = dbc();
    for message in &dbc.messages {
        assert!(dbc.message_comment(message.id).is_some_and(|text| text.len() > 10), "{}", message.name);
        for signal in &message.signals {
            let comment = dbc.signal_comment(message.id, &signal.name);
            assert!(comment.is_some_and(|text| text.len() > 10), "{} {}", message.name, signal.name);
        }
    }
}

#[test]
fn the_network_is_that_of_the_code() {
    let dbc = dbc();
    let version = Version::from_byte(PROTOCOL_VERSION);
    assert_eq!(dbc.version.0, version.to_string());
    assert_eq!(of_kind(&dbc, MessageKind::Operator).id, MessageId::Standard(DEFAULT_BASE));
    let delta = dbc.attribute_values_database.iter().find(|attribute| attribute.name == "E2EMaxDeltaCounter");
    assert_eq!(delta.map(|delta| &delta.value), Some(&AttributeValue::Uint(e2e::MAX_DELTA_COUNTER.into())));
    let ids: Vec<_> = dbc.attribute_values_node.iter().map(|a| (a.node_name.as_str(), a.value.clone())).collect();
    let node = |node: Node| AttributeValue::Uint(node.id().into());
    assert_eq!(ids, [("Plant", node(Node::Plant)), ("Exciter", node(Node::Exciter))]);
}

#[test]
fn frames_decode_by_the_dbc_to_what_was_sent() {
    let dbc = dbc();
    for sent in common::samples() {
        let kind = sent.kind();
        let frame = common::first_frame(&sent);
        let received = common::accept(&frame).unwrap().unwrap();
        let mut signals = common::signals(&received);
        if let Some(data_id) = kind.data_id() {
            let crc = e2e::crc(data_id, frame.data().try_into().unwrap());
            signals.extend([("crc".to_string(), crc.into()), ("counter".to_string(), 0.0)]);
        }
        let message = of_kind(&dbc, kind);
        assert_eq!(message.signals.len(), signals.len(), "{kind}");
        for signal in &message.signals {
            let value = raw(signal, frame.data()) as f64 * signal.factor + signal.offset;
            let expected = signals[&signal.name];
            assert!((value - expected).abs() <= 1e-12 * expected.abs(), "{kind} {}: {value}", signal.name);
            let range = number(signal.min)..=number(signal.max);
            assert!(range.contains(&expected), "{kind} {}: {expected} in {range:?}", signal.name);
        }
    }
}

#[test]
fn physical_signals_have_unit_factor_and_range_of_the_code() {
    for message in &dbc().messages {
        for signal in &message.signals {
            assert_eq!(signal.byte_order, ByteOrder::LittleEndian);
            let (unit, scale) = match signal.name.as_str() {
                "force_x_n" | "force_y_n" => ("N", Some(scaling::FORCE)),
                "torque1_nm" | "torque2_nm" => ("Nm", Some(scaling::TORQUE)),
                "acceleration_x_m_s2" | "acceleration_y_m_s2" => ("m/s^2", Some(scaling::ACCELERATION)),
                "rate_hz" => ("Hz", None),
                _ => ("", None),
            };
            assert_eq!(signal.unit, unit, "{} {}", message.name, signal.name);
            assert_eq!((signal.offset, scale.is_some()), (0.0, signal.value_type == ValueType::Signed));
            let factor = scale.map_or(1.0, |scale| 1.0 / f64::from(scale.counts_per_unit()));
            assert_eq!(signal.factor, factor, "{} {}", message.name, signal.name);
            if let Some(scale) = scale {
                assert_eq!((number(signal.min), number(signal.max)), (-scale.max(), scale.max()));
                assert_eq!(signal.size, 16);
            }
        }
    }
}

#[test]
fn no_signals_overlap_and_bits_without_one_are_refused() {
    let dbc = dbc();
    for sent in common::samples().iter().filter(|message| message.kind().data_id().is_some()) {
        let kind = sent.kind();
        let mut taken = 0u64;
        for signal in &of_kind(&dbc, kind).signals {
            let bits = (u64::MAX >> (64 - signal.size)) << signal.start_bit;
            assert_eq!(taken & bits, 0, "{kind} {}", signal.name);
            taken |= bits;
        }
        for bit in (0..64).filter(|bit| taken >> bit & 1 == 0) {
            let frame = common::with_content(&common::first_frame(sent), |data| data[bit / 8] |= 1 << (bit % 8));
            let refused = common::accept(&frame).unwrap_err();
            let expected = DecodeError::Reserved { kind, byte: bit / 8, got: 1 << (bit % 8) };
            assert_eq!(refused, expected, "bit {bit}");
        }
    }
}

#[test]
fn values_have_the_names_of_the_code() {
    let dbc = dbc();
    let values = |kind: MessageKind, signal: &str| -> Vec<(i64, String)> {
        let id = of_kind(&dbc, kind).id;
        let values = dbc.value_descriptions_for_signal(id, signal).unwrap();
        values.iter().map(|value| (value.id, value.description.clone())).collect()
    };
    let kebab = |name: String| -> String {
        name.char_indices().fold(String::new(), |mut text, (at, letter)| {
            if at > 0 && letter.is_uppercase() {
                text.push(' ');
            }
            text.extend(letter.to_lowercase());
            text
        })
    };
    let mut states: Vec<_> = NodeState::ALL.map(|s| (i64::from(s.heartbeat_byte()), s.to_string())).into();
    states.sort();
    let codes: Vec<_> = EmergencyCode::ALL.map(|code| (code as i64, kebab(format!("{code:?}")))).into();
    for kind in [MessageKind::PlantHeartbeat, MessageKind::ExciterHeartbeat] {
        assert_eq!(values(kind, "state"), states);
    }
    for kind in [MessageKind::PlantEmergency, MessageKind::ExciterEmergency] {
        assert_eq!(values(kind, "code"), codes);
    }
    let requests = OperatorRequest::ALL.map(|request| (request as i64, kebab(format!("{request:?}"))));
    assert_eq!(values(MessageKind::Operator, "request"), requests);
    assert_eq!(values(MessageKind::Operator, "target"), Node::ALL.map(|node| (node.id().into(), node.to_string())));
    for kind in [MessageKind::Force, MessageKind::Head] {
        assert_eq!(values(kind, "force_x_n"), [(scaling::RAW_NOT_AVAILABLE.into(), "not available".to_string())]);
    }
}
