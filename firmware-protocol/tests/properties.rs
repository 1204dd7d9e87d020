//! Properties that hold for every message, every frame and every order of frames.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use proptest::prelude::*;
use resonarm_protocol::e2e::CounterFault;
use resonarm_protocol::scaling::{ACCELERATION, Count, FORCE, Scale, TORQUE};
use resonarm_protocol::{
    Acceleration, DecodeError, EncodeError, ForceCommand, Frame, FrameFormat, Heartbeat, Id, ImpedanceHead, Measured,
    Message, MessageKind, Network, Node, NodeState, Profile, Receiver, SensorValues, Sensors, SignalError,
    TorqueCommand, Transmitter,
};

/// Values dense at the places where something changes: counts, ties between them, zero, the ends of the range.
fn near_boundaries(scale: Scale) -> impl Strategy<Value = f64> {
    let unit = f64::from(scale.counts_per_unit());
    let places = prop_oneof![
        3 => (-65_600i32..=65_600).prop_map(f64::from),
        1 => prop::sample::select(vec![-65_535.0, -65_534.0, -1.0, 0.0, 1.0, 65_534.0, 65_535.0]),
    ];
    let nudged = (places, -3i32..=3).prop_map(move |(half_counts, nudges)| {
        let value = half_counts / 2.0 / unit;
        // A few steps of the floating-point number to either side of a tie decide which count is the nearest.
        (0..nudges.abs()).fold(value, |value, _| if nudges > 0 { value.next_up() } else { value.next_down() })
    });
    prop_oneof![4 => nudged, 1 => -2.0 * scale.max()..2.0 * scale.max()]
}

/// Any frame, most of them on the identifiers of the protocol and of the form that one of them has.
fn any_frame() -> impl Strategy<Value = Frame> {
    let ids = prop_oneof![
        4 => prop::sample::select(MessageKind::ALL.map(|kind| Id::Standard(kind.id(Network::default()))).to_vec()),
        1 => (0u16..0x800).prop_map(Id::Standard),
        1 => (0u32..0x2000_0000).prop_map(Id::Extended),
    ];
    let fd = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
    let bytes = |lengths: &'static [usize]| {
        prop::sample::select(lengths).prop_flat_map(|length| prop::collection::vec(any::<u8>(), length))
    };
    let classic = (Just(FrameFormat::Classic), bytes(&[0, 1, 2, 7, 8, 8, 8, 8]));
    let fd = (Just(fd), bytes(&[1, 8, 12, 16, 16, 16, 32, 32, 64, 64]));
    let remote = (Just(FrameFormat::Remote), bytes(&[0, 8]));
    (ids, prop_oneof![4 => classic, 4 => fd, 1 => remote])
        .prop_map(|(id, (format, data))| Frame::new(id, format, &data).unwrap())
}

/// The frame with its reserved bytes of zero, where it is one of the FD profile's, and with a CRC that fits its
/// content: so that many are taken.
fn corrected(profile: Profile, frame: Frame) -> Frame {
    common::with_content(profile, &frame, |data| match data.len() {
        16 => data[6..8].fill(0),
        32 => (data[3], data[6], data[7]) = (data[3] & 0x3F, 0, 0),
        64 => {
            (data[3], data[6], data[7]) = (data[3] & 0x3F, data[6] & 0x3F, 0);
            data[56..].fill(0);
        }
        _ => {}
    })
}

/// A commanded value comes back within half a count, or is rejected because its count lies beyond the range.
fn check_command(sent: f64, scale: Scale, got: Result<f64, EncodeError>) -> Result<(), TestCaseError> {
    let half_count = 0.5 / f64::from(scale.counts_per_unit());
    match got {
        Ok(value) => prop_assert!((value - sent).abs() <= half_count * (1.0 + 1e-9), "{sent} came as {value}"),
        Err(EncodeError::OutOfRange { got, limit, .. }) => {
            prop_assert_eq!((got, limit), (sent, scale.max()));
            prop_assert!(sent.abs() >= (scale.max() + half_count) * (1.0 - 1e-15), "{sent} rejected");
        }
        Err(other) => prop_assert!(false, "{other}"),
    }
    Ok(())
}

/// A measured value comes back within half a count, or as the nearest end of the range with its flag set.
fn check_measured(sent: f64, scale: Scale, value: f64, saturated: bool) -> Result<(), TestCaseError> {
    let nearest = sent.clamp(-scale.max(), scale.max());
    let half_count = 0.5 / f64::from(scale.counts_per_unit());
    prop_assert!((value - nearest).abs() <= half_count * (1.0 + 1e-9), "{sent} came as {value}");
    prop_assert_eq!(saturated, matches!(scale.count(sent), Count::Beyond(_)), "{} came as {}", sent, value);
    prop_assert!(saturated || (value - sent).abs() <= half_count * (1.0 + 1e-9), "{sent} came as {value}");
    Ok(())
}

fn over_the_wire(message: Message) -> Result<Message, EncodeError> {
    let frame = Transmitter::new(Network::default()).frame(&message)?;
    Ok(common::accept(Profile::Classic, &frame).unwrap().unwrap())
}

proptest! {
    #[test]
    fn commands_come_back_within_half_a_count(
        force_x_n in near_boundaries(FORCE), torque2_nm in near_boundaries(TORQUE), sample: u16,
    ) {
        let force = over_the_wire(Message::Force(ForceCommand { force_x_n, force_y_n: 1.0, sample }));
        check_command(force_x_n, FORCE, force.map(|message| match message {
            Message::Force(got) => { assert_eq!((got.force_y_n, got.sample), (1.0, sample)); got.force_x_n }
            other => panic!("{other:?}"),
        }))?;
        let torque = over_the_wire(Message::Torque(TorqueCommand { torque1_nm: -1.0, torque2_nm, sample }));
        check_command(torque2_nm, TORQUE, torque.map(|message| match message {
            Message::Torque(got) => { assert_eq!((got.torque1_nm, got.sample), (-1.0, sample)); got.torque2_nm }
            other => panic!("{other:?}"),
        }))?;
    }

    #[test]
    fn measurements_come_back_within_half_a_count_or_flagged(
        force in near_boundaries(FORCE), acceleration in near_boundaries(ACCELERATION), sample: u16,
    ) {
        let head = ImpedanceHead { force_x_n: force, force_y_n: 1.0, x_saturated: false, y_saturated: true, sample };
        match over_the_wire(Message::Head(head)) {
            Ok(Message::Head(got)) => {
                prop_assert_eq!((got.force_y_n, got.y_saturated, got.sample), (1.0, true, sample));
                check_measured(force, FORCE, got.force_x_n, got.x_saturated)?;
            }
            other => prop_assert!(false, "{other:?}"),
        }
        let at_b = Acceleration {
            acceleration_x_m_s2: 1.0, acceleration_y_m_s2: acceleration, x_saturated: true, y_saturated: false, sample,
        };
        match over_the_wire(Message::AccelerometerB(at_b)) {
            Ok(Message::AccelerometerB(got)) => {
                prop_assert_eq!((got.acceleration_x_m_s2, got.x_saturated, got.sample), (1.0, true, sample));
                check_measured(acceleration, ACCELERATION, got.acceleration_y_m_s2, got.y_saturated)?;
            }
            other => prop_assert!(false, "{other:?}"),
        }
    }

    #[test]
    fn whatever_is_accepted_is_what_a_sender_would_send(
        frames in prop::collection::vec(any_frame(), 1..60), profile in prop::sample::select(Profile::ALL.to_vec()),
    ) {
        let network = common::network(profile);
        let mut receiver = Receiver::new(network);
        for frame in frames.into_iter().map(|frame| corrected(profile, frame)) {
            let Ok(Some(message)) = receiver.accept(&frame) else { continue };
            let mut transmitter = Transmitter::new(network);
            // The transmitter begins at counter 0, and the frame may have any, so that all of them are tried.
            let again = (0..=u8::MAX).map(|_| transmitter.frame(&message)).any(|again| again == Ok(frame));
            prop_assert!(again, "{frame} was taken as {message:?}");
        }
    }

    /// A value of the FD profile comes back as the single nearest to it; one beyond its range is rejected or flagged.
    #[test]
    fn values_of_the_fd_profile_come_back_as_singles(value in prop_oneof![any::<f64>(), -1e5..1e5f64], sample: u16) {
        let network = common::network(Profile::Fd);
        let single = f64::from(value as f32);
        let force = Message::Force(ForceCommand { force_x_n: value, force_y_n: 1.0, sample });
        match Transmitter::new(network).frame(&force) {
            Ok(frame) => {
                let expected = Message::Force(ForceCommand { force_x_n: single, force_y_n: 1.0, sample });
                prop_assert_eq!(common::accept(Profile::Fd, &frame), Ok(Some(expected)));
            }
            Err(EncodeError::NotFinite { .. }) => prop_assert!(!value.is_finite()),
            Err(EncodeError::OutOfRange { limit, .. }) => prop_assert!(value.is_finite() && value.abs() > limit),
            Err(other) => prop_assert!(false, "{other}"),
        }
        let mut sensors = Sensors { values: SensorValues::default(), sample };
        sensors.values.acceleration_c_m_s2[1].value = value;
        match Transmitter::new(network).frame(&Message::Sensors(sensors)) {
            Ok(frame) => {
                let end = f64::from(f32::MAX).copysign(value);
                let saturated = single.is_infinite();
                let value = if saturated { end } else { single };
                sensors.values.acceleration_c_m_s2[1] = Measured { value, saturated };
                prop_assert_eq!(common::accept(Profile::Fd, &frame), Ok(Some(Message::Sensors(sensors))));
            }
            Err(other) => prop_assert!(!value.is_finite(), "{}", other),
        }
    }

    #[test]
    fn the_sequence_is_judged_as_profile_11_does(
        fates in prop::collection::vec(
            prop::sample::select(vec!["arrives", "arrives", "lost", "twice", "boot"]), 1..200,
        ),
    ) {
        let (mut transmitter, mut receiver) = (Transmitter::new(Network::default()), Receiver::new(Network::default()));
        let force = Message::Force(ForceCommand { force_x_n: 1.0, force_y_n: 0.0, sample: 0 });
        let boot_up = Message::Heartbeat(Heartbeat { node: Node::Exciter, state: NodeState::BootUp });
        // The model: frames sent since the last that arrived, if one has arrived since the start.
        let (mut gap, mut lost): (Option<u64>, u64) = (None, 0);
        for fate in fates {
            if fate == "boot" {
                prop_assert_eq!(receiver.accept(&common::first_frame(Profile::Classic, &boot_up)), Ok(Some(boot_up)));
                gap = None;
                continue;
            }
            let frame = transmitter.frame(&force).unwrap();
            gap = gap.map(|gap| gap + 1);
            if fate == "lost" {
                continue;
            }
            let counter = frame.data()[1] & 0xF;
            let fault = match gap.map(|gap| gap % 15) {
                None => None,
                Some(0) => Some(CounterFault::Repeated),
                Some(step @ 1..=4) => { lost += step - 1; None }
                Some(step) => Some(CounterFault::WrongSequence { last: (15 + counter - step as u8) % 15 }),
            };
            gap = Some(0);
            match (receiver.accept(&frame), fault) {
                (Ok(Some(got)), None) => prop_assert_eq!(got, force),
                (Err(DecodeError::Counter { fault: got, .. }), Some(fault)) => prop_assert_eq!(got, fault),
                other => prop_assert!(false, "{other:?}"),
            }
            if fate == "twice" {
                let again = receiver.accept(&frame);
                prop_assert!(matches!(again, Err(DecodeError::Counter { fault: CounterFault::Repeated, .. })), "{again:?}");
            }
        }
        prop_assert_eq!(receiver.lost(), lost);
    }
}

#[test]
fn no_error_of_one_or_two_bits_gets_through() {
    for message in common::samples_of(Profile::Classic) {
        let frame = common::first_frame(Profile::Classic, &message);
        let Ok(sent) = <[u8; 8]>::try_from(frame.data()) else { continue };
        for (one, two) in (0..64).flat_map(|one| (one..64).map(move |two| (one, two))) {
            let data = (u64::from_le_bytes(sent) ^ (1 << one | 1 << two)).to_le_bytes();
            let refused = common::accept(Profile::Classic, &Frame::classic(frame.id(), &data).unwrap());
            assert!(matches!(refused, Err(DecodeError::Crc { .. })), "bits {one} and {two} of {message:?}");
        }
    }
}

#[test]
fn no_burst_of_up_to_7_bits_gets_through() {
    for message in common::samples_of(Profile::Classic) {
        let frame = common::first_frame(Profile::Classic, &message);
        let Ok(sent) = <[u8; 8]>::try_from(frame.data()) else { continue };
        // On the wire the most significant bit of a byte comes first.
        for (start, pattern) in (0..=64 - 7).flat_map(|start| (1u64..1 << 7).map(move |pattern| (start, pattern))) {
            let data = (u64::from_be_bytes(sent) ^ pattern << start).to_be_bytes();
            let refused = common::accept(Profile::Classic, &Frame::classic(frame.id(), &data).unwrap());
            assert!(matches!(refused, Err(DecodeError::Crc { .. })), "{pattern:07b} at {start} of {message:?}");
        }
    }
}

/// CRC-16 finds every burst of up to 16 bits within the bytes it covers.
#[test]
fn no_burst_of_up_to_16_bits_gets_through_in_the_fd_profile() {
    for message in common::samples_of(Profile::Fd) {
        let frame = common::first_frame(Profile::Fd, &message);
        if frame.format() == FrameFormat::Classic {
            continue;
        }
        for start in 16..8 * frame.len() {
            for pattern in [1_u16, 3, 0x8001, 0xFFFF, 0xA5A5, 0x1021] {
                let (mut data, end) = (frame.data().to_vec(), 8 * frame.len());
                let places = (0..16).filter(|k| pattern >> k & 1 == 1).map(|k| start + k);
                places.filter(|at| *at < end).for_each(|at| data[at / 8] ^= 0x80 >> (at % 8));
                let refused = common::accept(Profile::Fd, &Frame::new(frame.id(), frame.format(), &data).unwrap());
                assert!(matches!(refused, Err(DecodeError::Crc { .. })), "{pattern:#x} at {start} of {message:?}");
            }
        }
    }
}

/// The crate's own names and values of signals are those of the tests, and lead back to the message.
#[test]
fn messages_are_their_signals() {
    for message in common::samples() {
        let (kind, mut signals) = (message.kind(), common::Signals::new());
        message.signals(|name, value| assert_eq!(signals.insert(name.to_string(), value), None, "{kind} {name}"));
        assert_eq!(signals, common::signals(&message), "{kind}");
        assert_eq!(Message::from_signals(kind, |name| signals.get(name).copied()), Ok(message));
        for name in signals.keys().filter(|name| !name.ends_with("saturated")) {
            let missing = Message::from_signals(kind, |other| signals.get(other).copied().filter(|_| other != name));
            assert!(matches!(missing, Err(SignalError::Missing { signal, .. }) if signal == name), "{kind} {name}");
        }
    }
    let get = |name| if name == "sample" { Some(0.5) } else { Some(1.0) };
    let refused = Message::from_signals(MessageKind::Force, get).map_err(|error| error.to_string());
    assert_eq!(refused, Err("ForceCommand: 0.5 is not a value of sample".to_string()));
}
