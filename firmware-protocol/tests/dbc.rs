//! Holds the code to `resonarm.dbc` and `resonarm-fd.dbc`: identifiers, layouts, scaling, ranges, units, protection,
//! names.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use can_dbc::{
    AttributeValue, ByteOrder, Dbc, Message as DbcMessage, MessageId, NumericValue, Signal, SignalExtendedValueType,
    ValueType,
};
use resonarm_protocol::dbc::{self, Dbc as DbcOf};
use resonarm_protocol::e2e::Protection;
use resonarm_protocol::{
    Cycle, DEFAULT_BASE, DecodeError, EmergencyCode, FrameFormat, MessageKind, Network, Node, NodeState,
    OperatorRequest, PROTOCOL_VERSION, Profile, Version, e2e, scaling,
};

fn dbc(profile: Profile) -> Dbc {
    Dbc::try_from(dbc::text(profile)).unwrap()
}

/// The messages of a profile.
fn kinds(profile: Profile) -> impl Iterator<Item = MessageKind> {
    MessageKind::ALL.into_iter().filter(move |kind| kind.form(profile).is_some())
}

fn of_kind(dbc: &Dbc, kind: MessageKind) -> &DbcMessage {
    dbc.messages.iter().find(|message| message.name == kind.name()).unwrap()
}

/// The bits of a signal, the first the least significant.
fn bits(signal: &Signal, data: &[u8]) -> u64 {
    let bit = |at: u64| u64::from(data[at as usize / 8] >> (at % 8) & 1);
    (0..signal.size).map(|k| bit(signal.start_bit + k) << k).sum()
}

fn is_single(dbc: &Dbc, message: &DbcMessage, signal: &Signal) -> bool {
    dbc.extended_value_type_for_signal(message.id, &signal.name) == Some(&SignalExtendedValueType::IEEEfloat32Bit)
}

/// The physical value of a signal.
fn value(dbc: &Dbc, message: &DbcMessage, signal: &Signal, data: &[u8]) -> f64 {
    let bits = bits(signal, data);
    if is_single(dbc, message, signal) {
        return f32::from_bits(bits as u32).into();
    }
    let raw = match signal.value_type {
        ValueType::Unsigned => bits as i64,
        ValueType::Signed => (bits << (64 - signal.size)) as i64 >> (64 - signal.size),
    };
    raw as f64 * signal.factor + signal.offset
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
    for profile in Profile::ALL {
        let dbc = dbc(profile);
        assert_eq!(dbc.messages.len(), kinds(profile).count());
        for kind in kinds(profile) {
            let (message, form) = (of_kind(&dbc, kind), kind.form(profile).unwrap());
            assert_eq!(message.id, MessageId::Standard(kind.id(common::network(profile))), "{kind}");
            assert_eq!(message.size, form.length as u64, "{kind}");
            let sender = message.transmitter.as_deref().unwrap();
            assert_eq!(sender.to_lowercase(), kind.sender().to_string(), "{kind}");
            let cycle_ms = match kind.cycle() {
                Cycle::Sample if kind == MessageKind::SensorPair => 2,
                Cycle::Sample => 1,
                Cycle::Period { period_ns } => period_ns / 1_000_000,
                Cycle::Event => 0,
            };
            assert_eq!(attribute(&dbc, message.id, "GenMsgCycleTime"), cycle_ms, "{kind}");
            // StandardCAN and StandardCAN_FD.
            let format = if form.format == FrameFormat::Classic { 0 } else { 14 };
            assert_eq!(attribute(&dbc, message.id, "VFrameFormat"), format, "{kind}");
            let protection = match form.protection {
                None => 0,
                Some(Protection::Profile11) => 1,
                Some(Protection::Profile5) => 2,
            };
            assert_eq!(attribute(&dbc, message.id, "E2EProfile"), protection, "{kind}");
            let data_id = kind.data_id(Network::default()).map(|id| AttributeValue::Uint(id.into()));
            assert_eq!(dbc.message_attribute(message.id, "E2EDataId").cloned(), data_id, "{kind}");
        }
    }
}

/// With another base and other node ids the DBC has the identifiers, node ids and data ids of the code, and nothing
/// else changes.
#[test]
fn the_dbc_of_a_network_is_that_of_the_code() {
    for profile in Profile::ALL {
        let network = Network::new(0x310).unwrap().with_node_ids(5, 77).unwrap().with_profile(profile);
        let text = DbcOf(network).to_string();
        let (moved, file) = (Dbc::try_from(text.as_str()).unwrap(), dbc(profile));
        for kind in kinds(profile) {
            let (message, original) = (of_kind(&moved, kind), of_kind(&file, kind));
            assert_eq!(message.id, MessageId::Standard(kind.id(network)), "{kind}");
            let data_id = kind.data_id(network).map(|id| AttributeValue::Uint(id.into()));
            assert_eq!(moved.message_attribute(message.id, "E2EDataId").cloned(), data_id, "{kind}");
            assert_eq!(message.signals, original.signals, "{kind}");
            assert_eq!(moved.message_comment(message.id), file.message_comment(original.id), "{kind}");
            for signal in &message.signals {
                let both = [(&moved, message), (&file, original)];
                let [here, there] = both.map(|(dbc, m)| {
                    let values = dbc.value_descriptions_for_signal(m.id, &signal.name);
                    let comment = dbc.signal_comment(m.id, &signal.name);
                    // The hash is that of the file, whatever the network.
                    let comment = comment.filter(|_| signal.name != "dbc_hash");
                    (values.map(<[_]>::to_vec), comment.map(str::to_string), is_single(dbc, m, signal))
                });
                assert_eq!(here, there, "{kind} {}", signal.name);
            }
        }
        assert_eq!(node_ids(&moved), [("Plant".to_string(), 5), ("Exciter".to_string(), 77)]);
        assert_eq!(text.lines().count(), dbc::text(profile).lines().count());
    }
}

fn node_ids(dbc: &Dbc) -> Vec<(String, u64)> {
    let id = |value: &AttributeValue| match value {
        AttributeValue::Uint(id) => *id,
        other => panic!("{other:?}"),
    };
    dbc.attribute_values_node.iter().map(|a| (a.node_name.clone(), id(&a.value))).collect()
}

#[test]
fn every_message_and_signal_is_described() {
    for dbc in Profile::ALL.map(dbc) {
        for message in &dbc.messages {
            assert!(dbc.message_comment(message.id).is_some_and(|text| text.len() > 10), "{}", message.name);
            for signal in &message.signals {
                let comment = dbc.signal_comment(message.id, &signal.name);
                assert!(comment.is_some_and(|text| text.len() > 10), "{} {}", message.name, signal.name);
            }
        }
    }
}

#[test]
fn the_network_is_that_of_the_code() {
    for dbc in Profile::ALL.map(dbc) {
        let version = Version::from_byte(PROTOCOL_VERSION);
        assert_eq!(dbc.version.0, version.to_string());
        assert_eq!(of_kind(&dbc, MessageKind::Operator).id, MessageId::Standard(DEFAULT_BASE));
        let delta = dbc.attribute_values_database.iter().find(|attribute| attribute.name == "E2EMaxDeltaCounter");
        assert_eq!(delta.map(|delta| &delta.value), Some(&AttributeValue::Uint(e2e::MAX_DELTA_COUNTER.into())));
        let id = |node| u64::from(Network::default().node_id(node));
        assert_eq!(
            node_ids(&dbc),
            [("Plant".to_string(), id(Node::Plant)), ("Exciter".to_string(), id(Node::Exciter))]
        );
    }
}

#[test]
fn frames_decode_by_the_dbc_to_what_was_sent() {
    for profile in Profile::ALL {
        let dbc = dbc(profile);
        for sent in common::samples_of(profile) {
            let kind = sent.kind();
            let frame = common::first_frame(profile, &sent);
            let received = common::accept(profile, &frame).unwrap().unwrap();
            let mut signals = common::signals(&received);
            let data = frame.data();
            let crc = match kind.form(profile).and_then(|form| form.protection) {
                None => None,
                Some(Protection::Profile11) => Some(data[0].into()),
                Some(Protection::Profile5) => Some(u16::from_le_bytes([data[0], data[1]])),
            };
            signals.extend(crc.map(|crc| ("crc".to_string(), crc.into())));
            if kind.data_id(Network::default()).is_some() {
                signals.insert("counter".to_string(), 0.0);
            }
            let message = of_kind(&dbc, kind);
            assert_eq!(message.signals.len(), signals.len(), "{kind}");
            for signal in &message.signals {
                let value = value(&dbc, message, signal, frame.data());
                let expected = signals[&signal.name];
                assert!((value - expected).abs() <= 1e-12 * expected.abs(), "{kind} {}: {value}", signal.name);
                let range = number(signal.min)..=number(signal.max);
                assert!(range.contains(&expected), "{kind} {}: {expected} in {range:?}", signal.name);
            }
        }
    }
}

#[test]
fn physical_signals_have_unit_factor_and_range_of_the_code() {
    for profile in Profile::ALL {
        let dbc = dbc(profile);
        for message in &dbc.messages {
            for signal in &message.signals {
                check_physical(profile, &dbc, message, signal);
            }
        }
    }
}

fn check_physical(profile: Profile, dbc: &Dbc, message: &DbcMessage, signal: &Signal) {
    assert_eq!(signal.byte_order, ByteOrder::LittleEndian);
    let (name, place) = (signal.name.as_str(), format!("{} {}", message.name, signal.name));
    let (unit, scale) = match name {
        _ if name.contains("force_") && name.ends_with("_n") => ("N", Some(scaling::FORCE)),
        _ if name.contains("torque") => ("Nm", Some(scaling::TORQUE)),
        _ if name.ends_with("_m_s2") => ("m/s^2", Some(scaling::ACCELERATION)),
        "rate_hz" => ("Hz", None),
        _ => ("", None),
    };
    assert_eq!(signal.unit, unit, "{place}");
    assert_eq!((signal.offset, scale.is_some()), (0.0, signal.value_type == ValueType::Signed), "{place}");
    let is_counted = scale.filter(|_| profile == Profile::Classic);
    let factor = is_counted.map_or(1.0, |scale| 1.0 / f64::from(scale.counts_per_unit()));
    assert_eq!(signal.factor, factor, "{place}");
    assert_eq!(is_single(dbc, message, signal), scale.is_some() && profile == Profile::Fd, "{place}");
    if let Some(scale) = scale {
        let (least, most) = (number(signal.min), scale.limit(profile));
        assert_eq!(number(signal.max), most, "{place}");
        assert_eq!(least, if name.contains("limit") { 0.0 } else { -most }, "{place}");
        assert_eq!(signal.size, if profile == Profile::Fd { 32 } else { 16 }, "{place}");
    }
}

#[test]
fn no_signals_overlap_and_bits_without_one_are_refused() {
    for profile in Profile::ALL {
        let dbc = dbc(profile);
        for sent in common::samples_of(profile).iter().filter(|m| m.kind().data_id(Network::default()).is_some()) {
            let (kind, frame) = (sent.kind(), common::first_frame(profile, sent));
            let mut taken = vec![false; 8 * frame.len()];
            for signal in &of_kind(&dbc, kind).signals {
                for bit in &mut taken[signal.start_bit as usize..][..signal.size as usize] {
                    assert!(!*bit, "{kind} {}", signal.name);
                    *bit = true;
                }
            }
            for bit in (0..taken.len()).filter(|bit| !taken[*bit]) {
                let frame = common::with_content(profile, &frame, |data| data[bit / 8] |= 1 << (bit % 8));
                let refused = common::accept(profile, &frame).unwrap_err();
                let expected = DecodeError::Reserved { kind, byte: bit / 8, got: 1 << (bit % 8) };
                assert_eq!(refused, expected, "bit {bit}");
            }
        }
    }
}

#[test]
fn values_have_the_names_of_the_code() {
    Profile::ALL.into_iter().for_each(check_values);
}

fn check_values(profile: Profile) {
    let dbc = dbc(profile);
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
    assert_eq!(values(MessageKind::Operator, "target"), Node::ALL.map(|node| (node.number().into(), node.to_string())));
    for kind in [MessageKind::Force, MessageKind::Head].into_iter().filter(|_| profile == Profile::Classic) {
        assert_eq!(values(kind, "force_x_n"), [(scaling::RAW_NOT_AVAILABLE.into(), "not available".to_string())]);
    }
}
