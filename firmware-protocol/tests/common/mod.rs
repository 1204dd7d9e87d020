//! Messages as named numbers, the way the DBC, the vectors and the examples of SPEC.md have them.
#![allow(dead_code, reason = "each test uses its own part")]

use std::collections::BTreeMap;

use resonarm_protocol::e2e::{Protection, profile5, profile11};
use resonarm_protocol::{
    Acceleration, Capabilities, Emergency, EmergencyCode, ForceCommand, Frame, Heartbeat, Hello, Id, ImpedanceHead,
    Measured, Message, MessageKind, Network, Node, NodeState, OperatorCommand, OperatorRequest, Profile, Receiver,
    SamplesPerFrame, SensorPair, SensorValues, Sensors, TorqueCommand, Transmitter, Version,
};

/// The signals of a message by their names in the DBC, in physical units.
pub type Signals = BTreeMap<String, f64>;

/// The signals of a message, without CRC and counter.
pub fn signals(message: &Message) -> Signals {
    let pairs: Vec<(&str, f64)> = match *message {
        Message::Operator(OperatorCommand { request, target }) => {
            vec![("request", request as u8 as f64), ("target", target.number().into())]
        }
        Message::Force(ForceCommand { force_x_n, force_y_n, sample }) => {
            vec![("force_x_n", force_x_n), ("force_y_n", force_y_n), ("sample", sample.into())]
        }
        Message::Torque(TorqueCommand { torque1_nm, torque2_nm, sample }) => {
            vec![("torque1_nm", torque1_nm), ("torque2_nm", torque2_nm), ("sample", sample.into())]
        }
        Message::Head(ImpedanceHead { force_x_n, force_y_n, x_saturated, y_saturated, sample }) => vec![
            ("force_x_n", force_x_n),
            ("force_y_n", force_y_n),
            ("x_saturated", x_saturated.into()),
            ("y_saturated", y_saturated.into()),
            ("sample", sample.into()),
        ],
        Message::AccelerometerB(acceleration) | Message::AccelerometerC(acceleration) => vec![
            ("acceleration_x_m_s2", acceleration.acceleration_x_m_s2),
            ("acceleration_y_m_s2", acceleration.acceleration_y_m_s2),
            ("x_saturated", acceleration.x_saturated.into()),
            ("y_saturated", acceleration.y_saturated.into()),
            ("sample", acceleration.sample.into()),
        ],
        Message::PlantHello(hello) | Message::ExciterHello(hello) => vec![
            ("profile", hello.profile as u8 as f64),
            ("version_major", hello.version.major.into()),
            ("version_minor", hello.version.minor.into()),
            ("dbc_hash", hello.dbc_hash.into()),
            ("rate_hz", hello.rate_hz.into()),
        ],
        Message::Heartbeat(Heartbeat { state, .. }) => vec![("state", state.heartbeat_byte().into())],
        Message::Emergency(Emergency { code, detail, sample, .. }) => {
            vec![("code", code as u16 as f64), ("detail", detail.into()), ("sample", sample.into())]
        }
        Message::Sensors(Sensors { values, sample }) => return with_sample(value_signals("", &values), sample),
        Message::SensorPair(SensorPair { values: [first, second], sample }) => {
            let both = value_signals("first_", &first).into_iter().chain(value_signals("second_", &second));
            return with_sample(both.collect(), sample);
        }
        Message::Capabilities(capabilities) => vec![
            ("samples_per_frame", f64::from(capabilities.samples_per_frame as u8)),
            ("force_limit_n", capabilities.force_limit_n),
            ("torque_limit_nm", capabilities.torque_limit_nm),
        ],
    };
    pairs.into_iter().map(|(name, value)| (name.to_string(), value)).collect()
}

/// The readings of a sample, each by its name, its unit, and the name of its mark.
const READINGS: [(&str, &str); 6] = [
    ("force_x", "n"),
    ("force_y", "n"),
    ("acceleration_b_x", "m_s2"),
    ("acceleration_b_y", "m_s2"),
    ("acceleration_c_x", "m_s2"),
    ("acceleration_c_y", "m_s2"),
];

fn value_signals(prefix: &str, values: &SensorValues) -> Signals {
    let ([a, b], [c, d], [e, f]) = (values.force_n, values.acceleration_b_m_s2, values.acceleration_c_m_s2);
    let signals = READINGS.into_iter().zip([a, b, c, d, e, f]).flat_map(|((name, unit), measured)| {
        let saturated = f64::from(u8::from(measured.saturated));
        [(format!("{prefix}{name}_{unit}"), measured.value), (format!("{prefix}{name}_saturated"), saturated)]
    });
    signals.collect()
}

fn with_sample(mut signals: Signals, sample: u16) -> Signals {
    signals.insert("sample".to_string(), sample.into());
    signals
}

fn sensor_values(prefix: &str, signals: &Signals) -> SensorValues {
    let [a, b, c, d, e, f] = READINGS.map(|(name, unit)| Measured {
        value: signals[&format!("{prefix}{name}_{unit}")],
        saturated: signals[&format!("{prefix}{name}_saturated")] == 1.0,
    });
    SensorValues { force_n: [a, b], acceleration_b_m_s2: [c, d], acceleration_c_m_s2: [e, f] }
}

/// The message with these signals. Panics where there is none: the tests state valid ones.
pub fn message(kind: MessageKind, signals: &Signals) -> Message {
    let real = |name: &str| *signals.get(name).unwrap_or_else(|| panic!("{kind} without {name}"));
    let flag = |name: &str| real(name) == 1.0;
    let word = |name: &str| real(name) as u16;
    let sample = || word("sample");
    let acceleration = || Acceleration {
        acceleration_x_m_s2: real("acceleration_x_m_s2"),
        acceleration_y_m_s2: real("acceleration_y_m_s2"),
        x_saturated: flag("x_saturated"),
        y_saturated: flag("y_saturated"),
        sample: sample(),
    };
    let hello = || Hello {
        version: Version { major: word("version_major") as u8, minor: word("version_minor") as u8 },
        dbc_hash: real("dbc_hash") as u32,
        profile: if flag("profile") { Profile::Fd } else { Profile::Classic },
        rate_hz: word("rate_hz"),
    };
    match kind {
        MessageKind::Operator => Message::Operator(OperatorCommand {
            request: OperatorRequest::ALL.into_iter().find(|known| *known as u16 == word("request")).unwrap(),
            target: Node::from_number(word("target") as u8).unwrap(),
        }),
        MessageKind::Force => Message::Force(ForceCommand {
            force_x_n: real("force_x_n"),
            force_y_n: real("force_y_n"),
            sample: sample(),
        }),
        MessageKind::Torque => Message::Torque(TorqueCommand {
            torque1_nm: real("torque1_nm"),
            torque2_nm: real("torque2_nm"),
            sample: sample(),
        }),
        MessageKind::Head => Message::Head(ImpedanceHead {
            force_x_n: real("force_x_n"),
            force_y_n: real("force_y_n"),
            x_saturated: flag("x_saturated"),
            y_saturated: flag("y_saturated"),
            sample: sample(),
        }),
        MessageKind::AccelerometerB => Message::AccelerometerB(acceleration()),
        MessageKind::AccelerometerC => Message::AccelerometerC(acceleration()),
        MessageKind::PlantHello => Message::PlantHello(hello()),
        MessageKind::ExciterHello => Message::ExciterHello(hello()),
        MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat => Message::Heartbeat(Heartbeat {
            node: kind.sender(),
            state: NodeState::from_heartbeat_byte(word("state") as u8).unwrap(),
        }),
        MessageKind::PlantEmergency | MessageKind::ExciterEmergency => Message::Emergency(Emergency {
            node: kind.sender(),
            code: EmergencyCode::from_code(word("code")).unwrap(),
            detail: word("detail"),
            sample: sample(),
        }),
        MessageKind::Sensors => Message::Sensors(Sensors { values: sensor_values("", signals), sample: sample() }),
        MessageKind::SensorPair => {
            let values = [sensor_values("first_", signals), sensor_values("second_", signals)];
            Message::SensorPair(SensorPair { values, sample: sample() })
        }
        MessageKind::PlantCapabilities | MessageKind::ExciterCapabilities => Message::Capabilities(Capabilities {
            node: kind.sender(),
            samples_per_frame: SamplesPerFrame::from_number(word("samples_per_frame") as u8).unwrap(),
            force_limit_n: real("force_limit_n"),
            torque_limit_nm: real("torque_limit_nm"),
        }),
    }
}

/// The kind of a message's name in the DBC.
pub fn kind(name: &str) -> MessageKind {
    MessageKind::ALL.into_iter().find(|kind| kind.name() == name).unwrap_or_else(|| panic!("no message {name}"))
}

/// A frame as `cansend` takes it.
pub fn frame(text: &str) -> Frame {
    text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// The network at the default base and node ids.
pub fn network(profile: Profile) -> Network {
    Network::default().with_profile(profile)
}

/// The frame of a message with counter 0.
pub fn first_frame(profile: Profile, message: &Message) -> Frame {
    Transmitter::new(network(profile)).frame(message).unwrap()
}

/// The frame with other content and the CRC that belongs to it.
pub fn with_content(profile: Profile, frame: &Frame, change: impl FnOnce(&mut [u8])) -> Frame {
    let mut data = frame.data().to_vec();
    change(&mut data);
    protect(profile, frame.id(), &mut data);
    Frame::new(frame.id(), frame.format(), &data).unwrap()
}

/// Makes the CRC right; a message without protection stays as it is.
pub fn protect(profile: Profile, id: Id, data: &mut [u8]) {
    let network = network(profile);
    let Some(kind) = MessageKind::from_id(network, id) else { return };
    let protection = kind.form(profile).and_then(|form| form.protection);
    match protection.zip(kind.data_id(network)) {
        None => {}
        Some((Protection::Profile11, data_id)) => {
            if let Ok(bytes) = <&[u8; 8]>::try_from(&*data) {
                data[0] = profile11::crc(data_id, bytes);
            }
        }
        Some((Protection::Profile5, data_id)) if data.len() > 2 => {
            let crc = profile5::crc(data_id, data);
            data[..2].copy_from_slice(&crc.to_le_bytes());
        }
        Some((Protection::Profile5, _)) => {}
    }
}

/// Decodes a frame by a fresh receiver at the default base.
pub fn accept(profile: Profile, frame: &Frame) -> Result<Option<Message>, resonarm_protocol::DecodeError> {
    Receiver::new(network(profile)).accept(frame)
}

/// The messages of [`samples`] that a profile has.
pub fn samples_of(profile: Profile) -> Vec<Message> {
    samples().into_iter().filter(|message| message.kind().form(profile).is_some()).collect()
}

/// Messages of every kind, with ends of ranges, ties, both signs and every value of every enum.
pub fn samples() -> Vec<Message> {
    let mut messages = Vec::new();
    for request in OperatorRequest::ALL {
        messages.extend(Node::ALL.map(|target| Message::Operator(OperatorCommand { request, target })));
    }
    let forces = [(0.0, -0.0, 0), (1.0, -2.5, 7), (655.34, -655.34, 65_535), (0.01, 0.03, 0x1234), (-0.03, 0.02, 256)];
    let torques =
        [(0.0, 0.0, 0), (60.0, -0.05, 1000), (1638.35, -1638.35, 65_535), (0.025, 0.075, 1), (-0.075, 7.0, 2)];
    for ((force_x_n, force_y_n, sample), (torque1_nm, torque2_nm, sample_t)) in forces.into_iter().zip(torques) {
        messages.push(Message::Force(ForceCommand { force_x_n, force_y_n, sample }));
        messages.push(Message::Torque(TorqueCommand { torque1_nm, torque2_nm, sample: sample_t }));
    }
    for ([force_x_n, force_y_n], [acceleration_x_m_s2, acceleration_y_m_s2], x_saturated, y_saturated, sample) in [
        ([0.0, 0.0], [0.0, 0.0], false, false, 0),
        ([12.34, -56.78], [30.85, -141.95], false, false, 42),
        ([655.34, -655.34], [1638.35, -1638.35], true, false, 65_535),
        ([700.0, -1e9], [1640.0, -2e9], false, false, 3),
        ([-0.01, 0.05], [-0.025, 0.125], false, true, 300),
    ] {
        let acceleration = Acceleration { acceleration_x_m_s2, acceleration_y_m_s2, x_saturated, y_saturated, sample };
        messages.push(Message::Head(ImpedanceHead { force_x_n, force_y_n, x_saturated, y_saturated, sample }));
        messages.push(Message::AccelerometerB(acceleration));
        messages.push(Message::AccelerometerC(acceleration));
    }
    let version = Version { major: 1, minor: 0 };
    for (version, dbc_hash, profile, rate_hz) in [
        (version, 0x12_3456, Profile::Classic, 1000),
        (Version { major: 15, minor: 15 }, 0xFF_FFFF, Profile::Fd, 65_535),
        (Version { major: 0, minor: 0 }, 0, Profile::Classic, 1),
    ] {
        let hello = Hello { version, dbc_hash, profile, rate_hz };
        messages.extend([Message::PlantHello(hello), Message::ExciterHello(hello)]);
    }
    for node in Node::ALL {
        messages.extend(NodeState::ALL.map(|state| Message::Heartbeat(Heartbeat { node, state })));
        let details = [0x0503, 1, 2, 0x1234, 4, 5, 0, 65_535, 9, 10, 11, 50, 0x201, 0];
        let of_gate = [
            (EmergencyCode::CommandTimeout, 0x0614),
            (EmergencyCode::CommandTimeout, 0x0701),
            (EmergencyCode::ExciterTripped, 1),
        ];
        for (code, detail) in EmergencyCode::ALL.into_iter().zip(details).chain(of_gate) {
            messages.push(Message::Emergency(Emergency { node, code, detail, sample: 0xABCD }));
        }
    }
    messages.extend(fd_samples());
    messages
}

/// The same of the messages that only the FD profile has.
fn fd_samples() -> Vec<Message> {
    let measured = |value, saturated| Measured { value, saturated };
    let values = |scale: f64| SensorValues {
        force_n: [measured(12.5 * scale, false), measured(-0.25 * scale, true)],
        acceleration_b_m_s2: [measured(2500.0 * scale, false), measured(-1e-3 * scale, false)],
        acceleration_c_m_s2: [measured(0.1 * scale, true), measured(0.0, false)],
    };
    let mut messages = Vec::new();
    for (scale, sample) in [(1.0, 0), (-3.0, 65_535), (1e30, 300), (1e40, 9)] {
        messages.push(Message::Sensors(Sensors { values: values(scale), sample }));
        messages.push(Message::SensorPair(SensorPair { values: [values(scale), values(-scale / 7.0)], sample }));
    }
    for node in Node::ALL {
        for (samples_per_frame, force_limit_n, torque_limit_nm) in
            [(SamplesPerFrame::One, 600.0, 0.0), (SamplesPerFrame::Two, 0.0, f64::from(f32::MAX))]
        {
            let capabilities = Capabilities { node, samples_per_frame, force_limit_n, torque_limit_nm };
            messages.push(Message::Capabilities(capabilities));
        }
    }
    messages
}
