//! The cases that `vectors/classic.json` is made of.

use crate::case::{self, Case};
use crate::common;
use resonarm_protocol::{
    Acceleration, Emergency, EmergencyCode, ForceCommand, Frame, FrameFormat, Heartbeat, Hello, Id, ImpedanceHead,
    Message, Network, Node, NodeState, OperatorCommand, OperatorRequest, Profile, TorqueCommand, Transmitter, Version,
};

const PROFILE: Profile = Profile::Classic;

fn new(name: &str) -> Case {
    Case::new(PROFILE, name)
}

fn force(force_x_n: f64, force_y_n: f64, sample: u16) -> Message {
    Message::Force(ForceCommand { force_x_n, force_y_n, sample })
}

fn head(force_x_n: f64, force_y_n: f64) -> Message {
    Message::Head(ImpedanceHead { force_x_n, force_y_n, x_saturated: false, y_saturated: false, sample: 9 })
}

fn hello(rate_hz: u16) -> Hello {
    Hello { version: Version { major: 1, minor: 0 }, dbc_hash: 0x12_3456, profile: Profile::Classic, rate_hz }
}

fn boot_up(node: Node) -> Message {
    Message::Heartbeat(Heartbeat { node, state: NodeState::BootUp })
}

/// Returns all cases.
pub fn all() -> Vec<Case> {
    let mut cases = good();
    cases.extend(sequences());
    cases.extend(bad_form());
    cases.extend(bad_content());
    cases
}

fn good() -> Vec<Case> {
    let mut cases = case::good(PROFILE);
    let ties = [0.01, 0.03, 0.05, -0.01, -0.03, -0.05, 0.009_999, 0.010_001, 655.349_999, -655.349_999];
    cases.push(ties.into_iter().fold(new("rounding: to nearest, ties to even"), |case, value| {
        case.send(force(value, 0.0, 1)).send(head(0.0, value))
    }));
    let beyond = [655.35, 1e6, 1e300, -655.35, -1e6, -1e300];
    cases.push(beyond.into_iter().fold(new("saturation: sensors are cut and flagged"), |case, value| {
        case.send(head(value, 0.0)).send(head(0.0, value))
    }));
    for base in [0x180, 0x2A0, 0x570] {
        let network = Network::new(base).unwrap();
        cases.push(
            Case::at(&format!("base {base:#05X}"), network)
                .send(force(1.0, 2.0, 3))
                .send(boot_up(Node::Plant))
                .send(Message::ExciterHello(hello(1000)))
                .ignore(Frame::classic(Id::Standard(base + 12), &[0; 8]).unwrap())
                .ignore(common::frame("201#8A00F40183FF3412")),
        );
    }
    let network = Network::new(0x300).unwrap().with_node_ids(3, 127).unwrap();
    cases.push(
        Case::at("node ids 3 and 127", network)
            .send(force(1.0, 2.0, 3))
            .send(boot_up(Node::Plant))
            .send(boot_up(Node::Exciter))
            .send(Message::Operator(OperatorCommand { request: OperatorRequest::Arm, target: Node::Exciter }))
            .send(Message::Emergency(Emergency {
                node: Node::Exciter,
                code: EmergencyCode::SecondSender,
                detail: 0x301,
                sample: 7,
            }))
            .refuse(common::frame("301#8A00F40183FF3412"), "crc")
            .ignore(common::frame("701#05")),
    );
    cases
}

fn sequences() -> Vec<Case> {
    let torque = |sample| Message::Torque(TorqueCommand { torque1_nm: 1.0, torque2_nm: 0.0, sample });
    let wrap = (0..32).fold(new("counter: 0 to 14 and again"), |case, sample| case.send(torque(sample)));
    let lost = |lost: u16| {
        let case = new(&format!("counter: {lost} lost")).send(torque(0));
        (1..=lost).fold(case, |case, sample| case.lose(torque(sample)))
    };
    let mut repeated = Transmitter::new(Network::default());
    let first = repeated.frame(&force(1.0, 0.0, 0)).unwrap();
    let second = repeated.frame(&force(2.0, 0.0, 1)).unwrap();
    let invalid = common::with_content(PROFILE, &second, |data| data[1] |= 0xF);
    let booted = |case: Case, node| case.send(boot_up(node));
    vec![
        wrap,
        lost(1).send(torque(100)).send(torque(101)),
        lost(3).send(torque(100)).send(torque(101)),
        lost(4).send_refused(torque(100), "wrong sequence").send(torque(101)),
        lost(13).send_refused(torque(100), "wrong sequence").send(torque(101)),
        lost(14).send_refused(torque(100), "repeated").send(torque(101)),
        new("counter: a frame repeated")
            .send(force(1.0, 0.0, 0))
            .refuse(first, "repeated")
            .send(force(2.0, 0.0, 1))
            .refuse(second, "repeated")
            .refuse(first, "wrong sequence"),
        new("counter: 15 is invalid and forgotten")
            .refuse(invalid, "invalid counter")
            .send(force(1.0, 0.0, 0))
            .refuse(invalid, "invalid counter")
            .send(force(2.0, 0.0, 1)),
        booted(lost(7), Node::Exciter).send(torque(100)),
        booted(lost(6), Node::Plant).send_refused(torque(100), "wrong sequence"),
        new("counter: each message has its own")
            .send(force(1.0, 0.0, 0))
            .send(torque(0))
            .send(force(1.0, 0.0, 1))
            .send(head(0.0, 0.0))
            .send(torque(1)),
    ]
}

fn bad_form() -> Vec<Case> {
    let good = common::first_frame(PROFILE, &force(10.0, -2.5, 4660));
    let data = good.data();
    let crc = |name: &str, byte: usize, bits: u8| {
        let mut bytes: [u8; 8] = data.try_into().unwrap();
        bytes[byte] ^= bits;
        let case = new(&format!("crc: {name}"));
        case.refuse(Frame::classic(good.id(), &bytes).unwrap(), "crc").send(force(10.0, -2.5, 4660))
    };
    let fd = |len: usize| {
        let format = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
        let mut bytes = [0; 64];
        bytes[..8].copy_from_slice(data);
        Frame::new(good.id(), format, &bytes[..len]).unwrap()
    };
    let remote = |id| Frame::new(Id::Standard(id), FrameFormat::Remote, &[0; 8]).unwrap();
    let classic = |id, bytes: &[u8]| Frame::classic(Id::Standard(id), bytes).unwrap();
    vec![
        crc("one bit of the CRC", 0, 0x01),
        crc("one bit of the counter", 1, 0x01),
        crc("one bit of the flags", 1, 0x80),
        crc("one bit of the force", 3, 0x10),
        crc("a burst of eight bits", 5, 0xFF),
        new("crc: a message under the identifier of another").refuse(classic(0x203, data), "crc"),
        new("crc: nothing but zeros").refuse(classic(0x201, &[0; 8]), "crc"),
        new("crc: nothing but ones").refuse(classic(0x201, &[0xFF; 8]), "crc"),
        new("length: short").refuse(classic(0x201, &data[..7]), "length"),
        new("length: empty").refuse(classic(0x201, &[]), "length"),
        new("length: a heartbeat of two bytes").refuse(classic(0x701, &[5, 5]), "length"),
        new("length: an empty heartbeat").refuse(classic(0x702, &[]), "length"),
        new("format: CAN FD of 8 bytes").refuse(fd(8), "format"),
        new("format: CAN FD of 12 bytes").refuse(fd(12), "format"),
        new("format: CAN FD of 64 bytes").refuse(fd(64), "format"),
        new("format: remote frames").refuse(remote(0x201), "format").refuse(remote(0x701), "format"),
        new("profile: messages of the other")
            .refuse(classic(0x208, data), "other profile")
            .refuse(classic(0x209, &[]), "other profile")
            .refuse(remote(0x20A), "other profile")
            .refuse(classic(0x20B, data), "other profile"),
        new("not of the protocol")
            .ignore(Frame::classic(Id::Extended(0x201), data).unwrap())
            .ignore(classic(0x000, &[1, 0]))
            .ignore(classic(0x080, &[]))
            .ignore(classic(0x083, data))
            .ignore(classic(0x20C, data))
            .ignore(classic(0x703, &[5]))
            .ignore(classic(0x7FF, data)),
    ]
}

fn bad_content() -> Vec<Case> {
    let refused = |name: &str, message: Message, why: &str, change: fn(&mut [u8])| {
        new(name).refuse(common::with_content(PROFILE, &common::first_frame(PROFILE, &message), change), why)
    };
    let operator = Message::Operator(OperatorCommand { request: OperatorRequest::Arm, target: Node::Plant });
    let emergency =
        Message::Emergency(Emergency { node: Node::Plant, code: EmergencyCode::CommandTimeout, detail: 0, sample: 0 });
    let still = Acceleration {
        acceleration_x_m_s2: 0.0,
        acceleration_y_m_s2: 0.0,
        x_saturated: false,
        y_saturated: false,
        sample: 0,
    };
    let exciter_hello = Message::ExciterHello(hello(1000));
    vec![
        refused("not available: force x", force(1.0, 1.0, 0), "not available", |data| {
            data[2..4].copy_from_slice(&[0, 0x80])
        }),
        refused("not available: force y", force(1.0, 1.0, 0), "not available", |data| {
            data[4..6].copy_from_slice(&[0, 0x80])
        }),
        refused("not available: a sensor", Message::AccelerometerB(still), "not available", |data| data[3] = 0x80),
        refused("reserved: a flag of a command", force(1.0, 1.0, 0), "reserved", |data| data[1] |= 0x10),
        refused("reserved: the third flag of a sensor", head(1.0, 1.0), "reserved", |data| data[1] |= 0x40),
        refused("reserved: the fourth flag of a hello", exciter_hello, "reserved", |data| data[1] |= 0x80),
        refused("reserved: byte 4 of an operator command", operator, "reserved", |data| data[4] = 1),
        refused("reserved: byte 7 of an operator command", operator, "reserved", |data| data[7] = 0x80),
        refused("unknown: request 0", operator, "unknown value", |data| data[2] = 0),
        refused("unknown: request 4", operator, "unknown value", |data| data[2] = 4),
        refused("unknown: target 0", operator, "unknown value", |data| data[3] = 0),
        refused("unknown: target 3", operator, "unknown value", |data| data[3] = 3),
        refused("unknown: rate 0", exciter_hello, "unknown value", |data| data[6..8].copy_from_slice(&[0, 0])),
        refused("unknown: emergency code 0", emergency, "unknown value", |data| data[2] = 0),
        refused("unknown: emergency code 15", emergency, "unknown value", |data| data[2] = 15),
        refused("unknown: emergency code 257", emergency, "unknown value", |data| data[3] = 1),
        new("unknown: heartbeat states")
            .refuse(common::frame("701#01"), "unknown value")
            .refuse(common::frame("701#85"), "unknown value")
            .refuse(common::frame("702#FF"), "unknown value"),
    ]
}

/// Returns the messages that a sender must refuse to send, and why.
pub fn unsendable() -> Vec<(Message, &'static str)> {
    let torque = |torque1_nm, torque2_nm| Message::Torque(TorqueCommand { torque1_nm, torque2_nm, sample: 0 });
    let with = |version, dbc_hash, rate_hz| {
        Message::PlantHello(Hello { version, dbc_hash, profile: Profile::Classic, rate_hz })
    };
    let version = Version { major: 1, minor: 0 };
    vec![
        (force(655.35, 0.0, 0), "out of range"),
        (force(0.0, -655.35, 0), "out of range"),
        (torque(1638.375, 0.0), "out of range"),
        (torque(0.0, -1e300), "out of range"),
        (force(f64::NAN, 0.0, 0), "not finite"),
        (force(0.0, f64::INFINITY, 0), "not finite"),
        (torque(f64::NEG_INFINITY, 0.0), "not finite"),
        (head(f64::NAN, 0.0), "not finite"),
        (head(0.0, f64::INFINITY), "not finite"),
        (with(version, 0, 0), "invalid"),
        (with(version, 0x100_0000, 1000), "invalid"),
        (with(Version { major: 16, minor: 0 }, 0, 1000), "invalid"),
        (with(Version { major: 1, minor: 16 }, 0, 1000), "invalid"),
    ]
}
