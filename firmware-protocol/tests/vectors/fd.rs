//! The cases that `vectors/fd.json` is made of.

use resonarm_protocol::{
    Capabilities, ForceCommand, Frame, FrameFormat, Heartbeat, Id, Measured, Message, MessageKind, Network, Node,
    NodeState, Profile, SamplesPerFrame, SensorValues, Sensors, TorqueCommand, Transmitter,
};

use crate::case::{self, Case};
use crate::common;

const PROFILE: Profile = Profile::Fd;

fn new(name: &str) -> Case {
    Case::new(PROFILE, name)
}

fn force(force_x_n: f64, force_y_n: f64, sample: u16) -> Message {
    Message::Force(ForceCommand { force_x_n, force_y_n, sample })
}

fn torque(sample: u16) -> Message {
    Message::Torque(TorqueCommand { torque1_nm: 1.0, torque2_nm: 0.0, sample })
}

fn sensors(value: f64) -> Message {
    let pair = [Measured { value, saturated: false }; 2];
    let values = SensorValues { force_n: pair, acceleration_b_m_s2: pair, acceleration_c_m_s2: pair };
    Message::Sensors(Sensors { values, sample: 9 })
}

fn boot_up(node: Node) -> Message {
    Message::Heartbeat(Heartbeat { node, state: NodeState::BootUp })
}

fn fd_frame(id: u16, flags: (bool, bool), data: &[u8]) -> Frame {
    let (bit_rate_switch, error_state_indicator) = flags;
    Frame::new(Id::Standard(id), FrameFormat::Fd { bit_rate_switch, error_state_indicator }, data).unwrap()
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
    let halfway = 1.0 + f64::from(f32::EPSILON) / 2.0;
    let values = [0.1, -0.1, 1e-45, -1e-46, 1e38, halfway, halfway.next_up(), 3.0 * halfway - 2.0, 2500.25];
    cases.push(values.into_iter().fold(new("rounding: to the nearest single, ties to even"), |case, value| {
        case.send(force(value, 0.0, 1)).send(sensors(value))
    }));
    let beyond = [3.5e38, 1e300, -3.5e38, -1e300];
    cases.push(
        beyond
            .into_iter()
            .fold(new("saturation: sensors are cut and flagged"), |case, value| case.send(sensors(value))),
    );
    let network = Network::new(0x300).unwrap().with_node_ids(3, 127).unwrap().with_profile(PROFILE);
    cases.push(
        Case::at("base 0x300, node ids 3 and 127", network)
            .send(force(1.0, 2.0, 3))
            .send(sensors(1.0))
            .send(boot_up(Node::Plant))
            .ignore(common::frame("701#05"))
            .ignore(common::first_frame(PROFILE, &force(1.0, 2.0, 3))),
    );
    let (sent, plain) = (common::first_frame(PROFILE, &force(10.0, -2.5, 4660)), |flags| {
        fd_frame(0x201, flags, common::first_frame(PROFILE, &force(10.0, -2.5, 4660)).data())
    });
    cases.push(new("bit rate switch and error state don't matter").accept(plain((false, false))));
    cases.push(new("error passive sender").accept(plain((true, true))));
    cases.push(new("as it is sent").accept(sent));
    cases
}

fn sequences() -> Vec<Case> {
    let wrap = (0..260).fold(new("counter: 0 to 255 and again"), |case, sample| case.send(torque(sample)));
    let lost = |lost: u16| {
        let case = new(&format!("counter: {lost} lost")).send(torque(0));
        (1..=lost).fold(case, |case, sample| case.lose(torque(sample)))
    };
    let first = Transmitter::new(common::network(PROFILE)).frame(&force(1.0, 0.0, 0)).unwrap();
    vec![
        wrap,
        lost(3).send(torque(100)).send(torque(101)),
        lost(4).send_refused(torque(100), "wrong sequence").send(torque(101)),
        lost(255).send_refused(torque(100), "repeated").send(torque(101)),
        new("counter: a frame repeated").send(force(1.0, 0.0, 0)).refuse(first, "repeated").send(force(2.0, 0.0, 1)),
        lost(7).send(boot_up(Node::Exciter)).send(torque(100)),
        lost(6).send(boot_up(Node::Plant)).send_refused(torque(100), "wrong sequence"),
    ]
}

fn bad_form() -> Vec<Case> {
    let good = common::first_frame(PROFILE, &force(10.0, -2.5, 4660));
    let data = good.data();
    let crc = |name: &str, byte: usize, bits: u8| {
        let mut bytes = data.to_vec();
        bytes[byte] ^= bits;
        let frame = fd_frame(0x201, (true, false), &bytes);
        new(&format!("crc: {name}")).refuse(frame, "crc").send(force(10.0, -2.5, 4660))
    };
    let fd = |id, bytes: &[u8]| fd_frame(id, (true, false), bytes);
    let classic = |id, bytes: &[u8]| Frame::classic(Id::Standard(id), bytes).unwrap();
    let remote = |id| Frame::new(Id::Standard(id), FrameFormat::Remote, &[0; 8]).unwrap();
    vec![
        crc("one bit of the CRC", 1, 0x80),
        crc("one bit of the counter", 2, 0x01),
        crc("one bit of the force", 10, 0x10),
        new("crc: a message under the identifier of another").refuse(fd(0x202, data), "crc"),
        new("crc: nothing but zeros").refuse(fd(0x208, &[0; 32]), "crc"),
        new("length: as in the classic profile").refuse(fd(0x201, &data[..8]), "length"),
        new("length: too long").refuse(fd(0x208, &[0; 64]), "length"),
        new("length: empty").refuse(fd(0x209, &[]), "length"),
        new("format: a classical command").refuse(classic(0x201, &data[..8]), "format"),
        new("format: remote frames").refuse(remote(0x208), "format").refuse(remote(0x701), "format"),
        new("format: a hello as CAN FD").refuse(fd(0x206, &[0; 8]), "format"),
        new("profile: messages of the other")
            .refuse(classic(0x203, &[0; 8]), "other profile")
            .refuse(classic(0x204, &[0; 8]), "other profile")
            .refuse(fd(0x205, &[0; 8]), "other profile"),
        new("not of the protocol")
            .ignore(fd(0x20C, data))
            .ignore(Frame::new(Id::Extended(0x201), good.format(), data).unwrap()),
    ]
}

fn bad_content() -> Vec<Case> {
    let refused = |name: &str, message: Message, why: &str, change: &dyn Fn(&mut [u8])| {
        new(name).refuse(common::with_content(PROFILE, &common::first_frame(PROFILE, &message), change), why)
    };
    let single = |at: usize, value: f32| move |data: &mut [u8]| data[at..at + 4].copy_from_slice(&value.to_le_bytes());
    let byte = |at: usize, value: u8| move |data: &mut [u8]| data[at] = value;
    let capabilities = Message::Capabilities(Capabilities {
        node: Node::Plant,
        samples_per_frame: SamplesPerFrame::One,
        force_limit_n: 600.0,
        torque_limit_nm: 0.0,
    });
    vec![
        refused("not finite: force x is not a number", force(1.0, 1.0, 0), "not finite", &single(8, f32::NAN)),
        refused("not finite: force y is infinite", force(1.0, 1.0, 0), "not finite", &single(12, f32::INFINITY)),
        refused("not finite: a sensor", sensors(1.0), "not finite", &single(28, f32::NEG_INFINITY)),
        refused("negative: a limit", capabilities, "negative", &single(8, -1.0)),
        refused("reserved: byte 3 of a command", force(1.0, 1.0, 0), "reserved", &byte(3, 1)),
        refused("reserved: byte 7 of a command", force(1.0, 1.0, 0), "reserved", &byte(7, 0x80)),
        refused("reserved: the seventh flag of the sensors", sensors(1.0), "reserved", &byte(3, 0x40)),
        refused("unknown: no sample a frame", capabilities, "unknown value", &byte(3, 0)),
        refused("unknown: three samples a frame", capabilities, "unknown value", &byte(3, 3)),
    ]
}

/// Returns the messages that a sender must refuse to send, and why.
pub fn unsendable() -> Vec<(Message, &'static str)> {
    let capabilities = |force_limit_n| {
        let (node, samples_per_frame, torque_limit_nm) = (Node::Exciter, SamplesPerFrame::Two, 0.0);
        Message::Capabilities(Capabilities { node, samples_per_frame, force_limit_n, torque_limit_nm })
    };
    let mut messages = vec![
        (force(3.5e38, 0.0, 0), "out of range"),
        (force(0.0, f64::NAN, 0), "not finite"),
        (sensors(f64::INFINITY), "not finite"),
        (capabilities(-1.0), "negative"),
        (capabilities(1e39), "out of range"),
    ];
    let other = common::samples().into_iter().find(|message| message.kind() == MessageKind::Head);
    messages.extend(other.map(|message| (message, "other profile")));
    messages
}
