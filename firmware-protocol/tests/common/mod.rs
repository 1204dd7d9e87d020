//! Messages as named numbers, the way the DBC, the vectors and the examples of SPEC.md have them.
#![allow(dead_code, reason = "each test uses its own part")]

use std::collections::BTreeMap;

use resonarm_protocol::{
    Acceleration, Emergency, EmergencyCode, ForceCommand, Frame, FrameFormat, Heartbeat, Hello, Id, ImpedanceHead,
    Message, MessageKind, Network, Node, NodeState, OperatorCommand, OperatorRequest, Profile, Receiver, TorqueCommand,
    Transmitter, Version,
};

/// The signals of a message by their names in the DBC, in physical units.
pub type Signals = BTreeMap<String, f64>;

/// The signals of a message, without CRC and counter.
pub fn signals(message: &Message) -> Signals {
    let pairs: Vec<(&str, f64)> = match *message {
        Message::Operator(OperatorCommand { request, target }) => {
            vec![("request", request as u8 as f64), ("target", target.id().into())]
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
    };
    pairs.into_iter().map(|(name, value)| (name.to_string(), value)).collect()
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
            target: Node::from_id(word("target") as u8).unwrap(),
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
    }
}

/// The kind of a message's name in the DBC.
pub fn kind(name: &str) -> MessageKind {
    MessageKind::ALL.into_iter().find(|kind| kind.name() == name).unwrap_or_else(|| panic!("no message {name}"))
}

/// A frame as `cansend` takes it.
pub fn frame(text: &str) -> Frame {
    let (id, rest) = text.split_once('#').unwrap();
    let number = u32::from_str_radix(id, 16).unwrap();
    let id = if id.len() == 3 { Id::Standard(number as u16) } else { Id::Extended(number) };
    let bytes = |hex: &str| -> Vec<u8> {
        assert!(hex.is_ascii() && hex.len().is_multiple_of(2), "{text}");
        (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
    };
    let (format, data) = if let Some(fd) = rest.strip_prefix('#') {
        let flags = u8::from_str_radix(&fd[..1], 16).unwrap();
        let format = FrameFormat::Fd { bit_rate_switch: flags & 1 != 0, error_state_indicator: flags & 2 != 0 };
        (format, bytes(&fd[1..]))
    } else if let Some(length) = rest.strip_prefix('R') {
        (FrameFormat::Remote, vec![0; length.parse().unwrap()])
    } else {
        (FrameFormat::Classic, bytes(rest))
    };
    Frame::new(id, format, &data).unwrap()
}

/// The frame of a message with counter 0.
pub fn first_frame(message: &Message) -> Frame {
    Transmitter::new(Network::default()).frame(message).unwrap()
}

/// The frame with other content and the CRC that belongs to it.
pub fn with_content(frame: &Frame, change: impl FnOnce(&mut [u8; 8])) -> Frame {
    let kind = MessageKind::from_id(Network::default(), frame.id()).unwrap();
    let mut data: [u8; 8] = frame.data().try_into().unwrap();
    change(&mut data);
    data[0] = resonarm_protocol::e2e::crc(kind.data_id().unwrap(), &data);
    Frame::classic(frame.id(), &data).unwrap()
}

/// What a fresh receiver at the default base makes of a frame.
pub fn accept(frame: &Frame) -> Result<Option<Message>, resonarm_protocol::DecodeError> {
    Receiver::new(Network::default()).accept(frame)
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
        for (code, detail) in EmergencyCode::ALL.into_iter().zip([0x0503, 1, 2, 0x1234, 4, 5, 0, 65_535, 9, 10, 11, 50])
        {
            messages.push(Message::Emergency(Emergency { node, code, detail, sample: 0xABCD }));
        }
    }
    messages
}
