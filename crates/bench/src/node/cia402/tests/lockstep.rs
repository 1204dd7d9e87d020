//! Lockstep: a SYNC answers a sample.

use super::*;

/// One sample as the loop in lockstep runs it: published, answered, advanced.
fn sample(bench: &mut Bench, targets: [i16; 2]) -> (Vec<Frame>, [f64; 2]) {
    bench.publish();
    let frames = bench.frames();
    for (node, target) in NODES.into_iter().zip(targets) {
        bench.target(node, target);
    }
    assert!(!bench.node.is_answered());
    bench.send(0x80, &[]);
    assert!(bench.node.is_answered());
    assert!(bench.frames().is_empty(), "the PDOs come with the next sample");
    bench.load = bench.node.load();
    (frames, bench.torques_nm())
}

#[test]
fn what_came_before_a_sync_acts_from_the_sample_on() {
    let mut bench = Bench::new(2, TimeBase::Lockstep);
    bench.enable(&NODES);
    let (frames, torques_nm) = sample(&mut bench, [10, 20]);
    assert_eq!((frames.len(), torques_nm), (0, [1.0, 2.0]));
    for n in 2..6 {
        let (frames, torques_nm) = sample(&mut bench, [10 * n, 20]);
        let synchronous = frames.iter().filter(|frame| matches!(frame.id(), Id::Standard(0x281 | 0x282))).count();
        assert_eq!((synchronous, torques_nm), (2, [f64::from(n), 2.0]));
    }
}

#[test]
fn a_second_sync_for_a_sample_is_a_fault() {
    let mut bench = Bench::new(2, TimeBase::Lockstep);
    bench.enable(&NODES);
    sample(&mut bench, [10, 20]);
    bench.send(0x80, &[]);
    assert_eq!(bench.node.latched_fault().map(|fault| fault.code), Some(EmergencyCode::SampleSequence));
    let sent = bench.sent();
    assert!(sent.iter().any(|frame| frame.starts_with("081#0082")), "{sent:?}");
}

#[test]
fn while_no_drive_is_enabled_a_sync_is_answered_at_once() {
    let mut bench = Bench::new(1, TimeBase::Lockstep);
    bench.send(0, &[1, 0]);
    bench.frames();
    bench.send(0x80, &[]);
    assert_eq!(bench.sent(), ["281#0000000000000000"]);
    bench.node.handle_frame(0, &Frame::new(Id::Standard(0x281), FrameFormat::Remote, &[0; 8]).unwrap());
    assert_eq!(bench.sent(), ["281#0000000000000000"]);
}
