//! Messages, sendable and not, for both senders and back through both receivers.

use resonarm_protocol::{
    Acceleration, Capabilities, Emergency, EmergencyCode, ForceCommand, Heartbeat, Hello, ImpedanceHead, Measured,
    Message, MessageKind, Node, NodeState, OperatorCommand, OperatorRequest, Profile, SamplesPerFrame, SensorPair,
    SensorValues, Sensors, TorqueCommand, Version,
};

use super::harness::bits;
use super::{Harness, common};

/// A sequence of numbers that look random (G. Marsaglia, "Xorshift RNGs", J. Stat. Softw. 8, 14 (2003)).
struct Xorshift(u64);

impl Xorshift {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn word(&mut self) -> u16 {
        self.next() as u16
    }

    fn flag(&mut self) -> bool {
        self.next() & 1 == 1
    }

    /// A value that may be none of a single's: any bits, or near one or a tie of two, or at the ends of the range.
    fn real(&mut self) -> f64 {
        let single = f32::from_bits(self.next() as u32);
        let next = f64::from(single.next_up());
        match self.next() % 8 {
            0 => f64::from_bits(self.next()),
            1 => f64::midpoint(single.into(), next),
            2 => f64::midpoint(single.into(), next).next_up(),
            3 => f64::midpoint(single.into(), next).next_down(),
            4 => self.value(50.0),
            _ => single.into(),
        }
    }

    fn readings(&mut self) -> SensorValues {
        let mut axes = || [(); 2].map(|()| Measured { value: self.real(), saturated: self.flag() });
        SensorValues { force_n: axes(), acceleration_b_m_s2: axes(), acceleration_c_m_s2: axes() }
    }

    /// A message whose values are singles in the FD profile.
    fn fd_message(&mut self) -> Message {
        let sample = self.word();
        match self.next() % 5 {
            0 => Message::Force(ForceCommand { force_x_n: self.real(), force_y_n: self.real(), sample }),
            1 => Message::Torque(TorqueCommand { torque1_nm: self.real(), torque2_nm: self.real(), sample }),
            2 => Message::Sensors(Sensors { values: self.readings(), sample }),
            3 => Message::SensorPair(SensorPair { values: [self.readings(), self.readings()], sample }),
            _ => Message::Capabilities(Capabilities {
                node: if self.flag() { Node::Plant } else { Node::Exciter },
                samples_per_frame: SamplesPerFrame::ALL[self.next() as usize % 2],
                force_limit_n: self.real(),
                torque_limit_nm: self.real().abs(),
            }),
        }
    }

    /// A value: any bits, or near a count or a tie of `counts_per_unit`, within the range or a little beyond it.
    fn value(&mut self, counts_per_unit: f64) -> f64 {
        if self.next().is_multiple_of(16) {
            return f64::from_bits(self.next());
        }
        let value = (self.next() % 131_101) as f64 / 2.0 - 32_775.0;
        let value = value / counts_per_unit;
        match self.next() % 4 {
            0 => value.next_up(),
            1 => value.next_down(),
            2 => value + (self.next() % 1000) as f64 * 1e-5,
            _ => value,
        }
    }

    fn message(&mut self) -> Message {
        let (force, torque) = ([self.value(50.0), self.value(50.0)], [self.value(20.0), self.value(20.0)]);
        let (x_saturated, y_saturated, sample) = (self.flag(), self.flag(), self.word());
        let acceleration = Acceleration {
            acceleration_x_m_s2: torque[0],
            acceleration_y_m_s2: torque[1],
            x_saturated,
            y_saturated,
            sample,
        };
        let node = if self.flag() { Node::Plant } else { Node::Exciter };
        let request = OperatorRequest::ALL[self.next() as usize % 3];
        let hello = Hello {
            version: Version { major: (self.next() % 18) as u8, minor: (self.next() % 18) as u8 },
            dbc_hash: (self.next() % 0x100_0010) as u32,
            profile: if self.flag() { Profile::Fd } else { Profile::Classic },
            rate_hz: self.word(),
        };
        let code = EmergencyCode::ALL[self.next() as usize % EmergencyCode::ALL.len()];
        match self.next() % 10 {
            0 => Message::Operator(OperatorCommand { request, target: node }),
            1 => Message::Force(ForceCommand { force_x_n: force[0], force_y_n: force[1], sample }),
            2 => Message::Torque(TorqueCommand { torque1_nm: torque[0], torque2_nm: torque[1], sample }),
            3 => Message::Head(ImpedanceHead {
                force_x_n: force[0],
                force_y_n: force[1],
                x_saturated,
                y_saturated,
                sample,
            }),
            4 => Message::AccelerometerB(acceleration),
            5 => Message::AccelerometerC(acceleration),
            6 => Message::PlantHello(hello),
            7 => Message::ExciterHello(hello),
            8 => Message::Heartbeat(Heartbeat { node, state: NodeState::ALL[self.next() as usize % 4] }),
            _ => Message::Emergency(Emergency { node, code, detail: self.word(), sample }),
        }
    }
}

/// Sends a message by both, and takes its frame by both.
fn over_the_wire(both: &mut Harness, message: &Message) -> bool {
    let Ok(frame) = both.encode(message) else { return false };
    assert!(matches!(both.accept(&frame), Ok(Some(_))));
    true
}

#[test]
fn both_send_random_messages_alike() {
    let (mut both, mut random) = (Harness::start(Profile::Classic), Xorshift(0x9E37_79B9_7F4A_7C15));
    let sent = (0..30_000).filter(|_| over_the_wire(&mut both, &random.message())).count();
    assert!((15_000..29_500).contains(&sent), "{sent}");
    both.end();
    let mut both = Harness::start(Profile::Fd);
    let sent = (0..20_000).filter(|_| over_the_wire(&mut both, &random.fd_message())).count();
    assert!((10_000..19_500).contains(&sent), "{sent}");
    let sent = (0..10_000).filter(|_| over_the_wire(&mut both, &random.message())).count();
    assert!((4_000..9_500).contains(&sent), "{sent}");
    both.end();
}

#[test]
fn both_send_the_corners_alike() {
    for profile in Profile::ALL {
        send_the_corners_alike(profile);
    }
}

fn send_the_corners_alike(profile: Profile) {
    let mut both = Harness::start(profile);
    for message in common::samples() {
        let is_sent = message.kind().form(profile).is_some();
        assert_eq!(over_the_wire(&mut both, &message), is_sent, "{message:?}");
    }
    let numbers = [f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN, f64::MIN_POSITIVE, -0.0];
    let ends = [32_767.0, 32_767.5, 32_768.0, 0.5, 1.5, 2.5].into_iter().flat_map(|counts| {
        let ends = [counts / 50.0, counts / 20.0];
        ends.into_iter().flat_map(|value: f64| [value, value.next_up(), value.next_down()])
    });
    let single =
        [f64::from(f32::MAX), f64::from(f32::MAX) + 2.0_f64.powi(103), f64::from(f32::MIN_POSITIVE), 1e-45, 7e-46];
    let singles = single.into_iter().flat_map(|value| [value, value.next_up(), value.next_down()]);
    for value in numbers.into_iter().chain(ends.chain(singles).flat_map(|value| [value, -value])) {
        over_the_wire(&mut both, &capabilities(value));
        let (x_saturated, y_saturated, sample) = (false, false, 1);
        for [x, y] in [[value, 0.0], [0.0, value]] {
            over_the_wire(&mut both, &Message::Force(ForceCommand { force_x_n: x, force_y_n: y, sample }));
            over_the_wire(&mut both, &Message::Torque(TorqueCommand { torque1_nm: x, torque2_nm: y, sample }));
            let head = ImpedanceHead { force_x_n: x, force_y_n: y, x_saturated, y_saturated, sample };
            over_the_wire(&mut both, &Message::Head(head));
            let (acceleration_x_m_s2, acceleration_y_m_s2) = (x, y);
            let at_b = Acceleration { acceleration_x_m_s2, acceleration_y_m_s2, x_saturated, y_saturated, sample };
            over_the_wire(&mut both, &Message::AccelerometerB(at_b));
            over_the_wire(&mut both, &Message::AccelerometerC(at_b));
        }
    }
    both.end();
}

fn capabilities(force_limit_n: f64) -> Message {
    let (node, samples_per_frame, torque_limit_nm) = (Node::Exciter, SamplesPerFrame::One, 0.0);
    Message::Capabilities(Capabilities { node, samples_per_frame, force_limit_n, torque_limit_nm })
}

#[test]
fn c_refuses_numbers_that_rust_cannot_state() {
    let mut both = Harness::start(Profile::Fd);
    for (kind, values, signal) in [
        (MessageKind::Operator, &[0.0, 1.0][..], "request"),
        (MessageKind::Operator, &[4.0, 1.0], "request"),
        (MessageKind::Operator, &[1.0, 0.0], "target"),
        (MessageKind::Operator, &[1.0, 3.0], "target"),
        (MessageKind::PlantHello, &[1.0, 1.0, 5.0, 2.0, 1000.0], "profile"),
        (MessageKind::ExciterHeartbeat, &[6.0], "state"),
        (MessageKind::ExciterEmergency, &[0.0, 0.0, 0.0], "code"),
        (MessageKind::ExciterEmergency, &[15.0, 0.0, 0.0], "code"),
        (MessageKind::ExciterCapabilities, &[0.0, 0.0, 0.0], "samples_per_frame"),
        (MessageKind::ExciterCapabilities, &[3.0, 0.0, 0.0], "samples_per_frame"),
    ] {
        let answer = both.ask(&format!("encode {}{}", kind as u8, bits(values)));
        assert!(answer.starts_with(&format!("refused invalid {signal} ")), "{answer}");
    }
    let answer = both.ask(&format!("encode 16{}", bits(&[0.0; 5])));
    assert!(answer.starts_with("refused invalid kind "), "{answer}");
    both.end();
}
