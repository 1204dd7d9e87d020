//! Messages that a mapped node sends, and their times.

use super::*;

fn of(outgoing: Outgoing) -> Rig {
    let incoming = vec![drive(DRIVE, 0, LoadInput::ForceX)];
    Rig::of(Mapping { outgoing: vec![outgoing], ..mapping(incoming) }, TimeBase::Clock)
}

#[test]
fn readings_have_their_value_counter_and_checksum() {
    let mut rig = Rig::new();
    for (sample, acceleration_m_s2) in [1.0, -2.55, 100.0].into_iter().enumerate() {
        rig.publish(acceleration_m_s2);
        let frame = rig.sent[sample];
        let data = frame.data();
        let counts = i16::from_le_bytes([data[0], data[1]]);
        assert_eq!((counts, data[2], data[6]), ((100.0 * acceleration_m_s2).round() as i16, 1, sample as u8 + 1));
        protection(0x124).checksum.unwrap().check(frame.id(), data).unwrap();
    }
}

#[test]
fn a_value_that_a_signal_cannot_say_is_the_nearest_and_counted() {
    let mut rig = Rig::new();
    rig.publish(400.0);
    assert_eq!(&rig.sent[0].data()[..2], i16::MAX.to_le_bytes());
    assert_eq!(rig.node.frames().limited_values, 1);
    rig.publish(1.0);
    assert_eq!(rig.node.frames().limited_values, 1);
}

#[test]
fn a_reading_that_is_no_number_is_an_error() {
    let mut rig = Rig::new();
    let reading = Reading { value: f64::NAN, clipped: false };
    let measurement = Measurement { head_force_n: [reading; 2], ..Measurement::default() };
    let sample = PublishedSample { measurement: &measurement, states: &States::NONE, travel_m: None };
    let error = rig.node.publish(&sample).unwrap_err();
    assert!(matches!(error, PublishError::NotFinite { name, .. } if name == "head_force_x_n"), "{error}");
}

#[test]
fn messages_are_sent_by_samples_by_the_clock_on_sync_and_on_request() {
    let mut rig = of(Outgoing { trigger: Trigger::Every(3), ..meas() });
    for _ in 0..7 {
        rig.tick();
    }
    assert_eq!(rig.sent.len(), 2, "samples 3 and 6");
    let mut rig = of(Outgoing { trigger: Trigger::Period(2_500_000), ..meas() });
    assert_eq!(rig.node.next_deadline_ns(), 0);
    for _ in 0..10 {
        rig.tick();
    }
    assert_eq!(rig.sent.len(), 5, "at 1, 3, 6, 8 and 10 ms");
    rig.now_ns += 100 * TICK_NS;
    let before = rig.sent.len();
    for _ in 0..4 {
        rig.tick();
    }
    assert_eq!(rig.sent.len() - before, 2, "after a stop the next is a period later: at once, and after 2.5 ms");
    let mut rig = of(Outgoing { trigger: Trigger::Request, is_on_request: true, ..meas() });
    rig.tick();
    assert_eq!(rig.sent.len(), 0);
    for format in [FrameFormat::Remote, FrameFormat::Classic] {
        let request = Frame::new(MEAS, format, &[]).unwrap();
        rig.node.handle_frame(rig.now_ns, &request);
        rig.transmit();
    }
    assert_eq!((rig.sent.len(), rig.node.frames().other_sender), (2, 0));
}

#[test]
fn another_sender_of_its_messages_is_reported() {
    let mut rig = Rig::new();
    rig.node.handle_frame(0, &Frame::new(MEAS, FrameFormat::Classic, &[0; 8]).unwrap());
    rig.tick();
    assert!(rig.events.contains(&NodeEvent::OtherSender(MEAS)));
    assert_eq!(rig.node.frames().other_sender, 1);
}

#[test]
fn a_frame_that_waits_is_sent_with_the_newest_values() {
    let mut rig = Rig::new();
    let sample = |sample| Measurement { sample, ..Measurement::default() };
    for index in 0..3 {
        let published = PublishedSample { measurement: &sample(index), states: &States::NONE, travel_m: None };
        rig.node.publish(&published).unwrap();
    }
    rig.transmit();
    assert_eq!((rig.sent.len(), rig.node.frames().unsent), (1, 2));
}

#[test]
fn a_jammed_bus_is_a_fault() {
    let mut rig = Rig::new();
    rig.send(DRIVE, 10, true);
    rig.tick();
    for index in 1..40 {
        rig.now_ns += TICK_NS;
        rig.send(DRIVE, 10, true);
        rig.node.handle_deadline(rig.now_ns);
        let measurement = Measurement { sample: index, ..Measurement::default() };
        let sample = PublishedSample { measurement: &measurement, states: &States::NONE, travel_m: None };
        rig.node.publish(&sample).unwrap();
    }
    assert_eq!(rig.node.latched_fault().unwrap().code, EmergencyCode::BusLoss);
}
