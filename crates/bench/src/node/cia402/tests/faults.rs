//! One fault stops all drives, and nothing enables them again but controlwords.

use super::*;

/// A held torque, then silence.
fn timed_out() -> Bench {
    let mut bench = Bench::new(2, TimeBase::Clock);
    bench.enable(&NODES);
    bench.target(1, 10);
    bench.target(2, 10);
    bench.tick();
    bench.frames();
    // Drive 2 is commanded on.
    for _ in 0..TIMEOUT_NS / TICK_NS {
        bench.target(2, 10);
        bench.tick();
    }
    bench
}

#[test]
fn silence_of_one_drive_stops_both() {
    let mut bench = timed_out();
    assert_eq!(bench.node.state(), NodeState::Fault);
    assert_eq!(bench.node.latched_fault().map(|fault| fault.code), Some(EmergencyCode::CommandTimeout));
    let sent = bench.sent();
    // Emergency of nodes 1 and 2: error code 8250, low byte first, and the register 11 of a communication error.
    for start in ["081#508211", "082#508211"] {
        assert_eq!(sent.iter().filter(|frame| frame.starts_with(start)).count(), 1, "{sent:?}");
    }
    for node in NODES {
        // CiA 402: 0F under the mask 4F is a fault reaction in progress, 08 the fault behind it, 40 switch on
        // disabled.
        assert_eq!(bench.statusword(node) & 0x4F, 0x0F, "the torque goes to zero");
        assert_eq!((bench.read(node, 0x603F), bench.read(node, 0x1001)), (0x8250, 0x11));
    }
    // Targets and controlwords that enable change nothing.
    for _ in 0..200 {
        NODES.iter().for_each(|node| bench.command(*node, 0x0F, 50));
        bench.tick();
    }
    assert_eq!((bench.torques_nm(), bench.node.state()), ([0.0; 2], NodeState::Fault));
    assert_eq!(NODES.map(|node| bench.statusword(node) & 0x4F), [0x08; 2]);
}

#[test]
fn each_drive_has_its_own_reset_on_a_rising_edge() {
    let mut bench = timed_out();
    (0..200).for_each(|_| bench.tick());
    bench.frames();
    // Bit 7 that was set before the fault's end is no edge.
    bench.control(1, 0x80);
    assert_eq!(bench.statusword(1) & 0x4F, 0x40);
    assert_eq!(bench.statusword(2) & 0x4F, 0x08);
    assert_eq!((bench.node.state(), bench.node.latched_fault()), (NodeState::PreOperational, None));
    assert_eq!((bench.read(1, 0x603F), bench.read(2, 0x603F)), (0, 0x8250));
    [0x06, 0x07, 0x0F].iter().for_each(|controlword| bench.control(2, *controlword));
    assert_eq!(bench.statusword(2) & 0x4F, 0x08);
    bench.enable(&[1]);
    bench.target(1, 10);
    bench.target(2, 10);
    bench.tick();
    assert_eq!(bench.torques_nm(), [1.0, 0.0]);
    bench.send(0x602, &[0x2B, 0x40, 0x60, 0, 0x80, 0, 0, 0]);
    let sent = bench.sent();
    assert!(sent.iter().any(|frame| frame == "082#0000000000000000"), "{sent:?}");
    bench.enable(&[2]);
}

#[test]
fn refused_targets_are_no_sign_of_life() {
    let mut bench = Bench::new(1, TimeBase::Clock);
    bench.enable(&[1]);
    for _ in 0..=TIMEOUT_NS / TICK_NS {
        bench.target(1, i16::MAX);
        bench.tick();
    }
    assert_eq!((bench.node.state(), bench.torques_nm()), (NodeState::Fault, [0.0; 2]));
    assert!(bench.node.refusals().total() >= 49);
}

#[test]
fn network_management_switches_drives_off() {
    // CiA 301: stop, enter pre-operational, reset the node, reset its communication.
    for command in [0x02, 0x80, 0x81, 0x82] {
        let mut bench = Bench::new(1, TimeBase::Clock);
        bench.enable(&[1]);
        bench.target(1, 10);
        bench.tick();
        bench.send(0, &[command, 1]);
        assert_eq!(bench.node.state(), NodeState::PreOperational, "{command:x}");
        (0..200).for_each(|_| bench.tick());
        bench.send(0, &[1, 1]);
        bench.target(1, 10);
        bench.tick();
        assert_eq!((bench.torques_nm(), bench.statusword(1) & 0x4F), ([0.0; 2], 0x40), "{command:x}");
    }
}

#[test]
fn a_lost_bus_and_frames_that_are_not_taken_are_faults() {
    let mut bench = Bench::new(1, TimeBase::Clock);
    bench.node.bus_lost(0);
    assert_eq!(bench.node.state(), NodeState::PreOperational);
    bench.enable(&[1]);
    bench.node.bus_lost(0);
    assert_eq!(bench.node.latched_fault().map(|fault| fault.code), Some(EmergencyCode::BusLoss));
    let mut bench = Bench::new(1, TimeBase::Clock);
    bench.enable(&[1]);
    bench.is_jammed = true;
    let timeout_ns = Timing::real_time(RATE_HZ).command_timeout_ns;
    // TPDO 1 waits from the first of its event times on.
    for _ in 0..timeout_ns / TICK_NS + 12 {
        bench.target(1, 0);
        bench.tick();
    }
    assert_eq!(bench.node.latched_fault().map(|fault| fault.code), Some(EmergencyCode::BusLoss));
}

#[test]
fn the_end_of_a_run_switches_off_for_good_and_an_operator_never_enables() {
    let mut bench = Bench::new(1, TimeBase::Clock);
    bench.node.execute(0, OperatorRequest::Arm);
    assert_eq!(bench.node.state(), NodeState::PreOperational);
    bench.enable(&[1]);
    bench.node.execute(0, OperatorRequest::Disarm);
    assert_eq!((bench.node.state(), bench.statusword(1) & 0x4F), (NodeState::PreOperational, 0x40));
    bench.enable(&[1]);
    bench.node.fault(0, EmergencyCode::Overrun, 3);
    assert_eq!(bench.read(1, 0x603F), 0xFF02);
    bench.node.execute(0, OperatorRequest::Reset);
    bench.enable(&[1]);
    bench.node.leave(0);
    [0x06, 0x07, 0x0F].iter().for_each(|controlword| bench.control(1, *controlword));
    assert_eq!((bench.node.state(), bench.statusword(1) & 0x6F), (NodeState::PreOperational, 0x23));
}
