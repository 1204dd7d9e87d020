//! A partner's faults, and another network at the same base.

use super::*;
use crate::rig::ExciterSpec;
use resonarm_protocol::{FrameFormat, Heartbeat, Id, Refusal};

fn heard(events: impl Iterator<Item = NodeEvent>) -> Vec<(bool, EmergencyCode)> {
    let code = |event| match event {
        NodeEvent::PartnerEmergency(emergency) => Some((true, emergency.code)),
        NodeEvent::Emergency(emergency) => Some((false, emergency.code)),
        _ => None,
    };
    events.filter_map(code).collect()
}

#[test]
fn a_plant_that_faults_with_its_exciter_has_the_exciter_s_reason() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    bench.exciter.as_mut().unwrap().bus_lost(bench.now_ns);
    bench.run(2);
    let codes = heard(bench.plant_events.iter().copied());
    assert_eq!(codes, [(true, EmergencyCode::BusLoss), (false, EmergencyCode::PartnerFault)]);
    let reason = bench.plant.fault_reason().unwrap();
    assert_eq!((reason.node, reason.code), (NodeName::Exciter, EmergencyCode::BusLoss));
    // The reason belongs only to that fault.
    let mut second = exciter_node(10.0);
    second.start(bench.now_ns);
    bench.exciter = Some(second);
    bench.run(300);
    assert!(bench.plant.is_armed() && bench.plant.fault_reason().is_none());
    bench.exciter = None;
    bench.run(50);
    assert_eq!(bench.plant.latched_fault().unwrap().code, EmergencyCode::CommandTimeout);
    assert_eq!(bench.plant.fault_reason(), None);
}

/// Plant and exciter in lockstep, where the plant rejects the commands as too large; with the timeouts of both, ns. And
/// the plant's events.
fn refused_in_lockstep([of_plant, of_exciter]: [u64; 2]) -> (PlantNode, ExciterNode, Vec<NodeEvent>) {
    let weak = Exciter::Ideal(ExciterSpec { force_limit_n: 1.0, ..ExciterSpec::default() });
    let mut plant = PlantNode::new(Network::default(), RATE_HZ, Timing::lockstep(of_plant), weak);
    let mut exciter = carry(Network::default(), RATE_HZ, Timing::lockstep(of_exciter), dwell(10.0));
    plant.start(0);
    exciter.start(0);
    let (mut sample, mut events) = (0, Vec::new());
    for now_ns in (0..3000).map(|ms| ms * TICK_NS) {
        while let Some(frame) = plant.poll_transmit() {
            exciter.handle_frame(now_ns, &frame);
        }
        exciter.handle_deadline(now_ns);
        while let Some(frame) = exciter.poll_transmit() {
            plant.handle_frame(now_ns, &frame);
            plant.handle_deadline(now_ns);
        }
        plant.handle_deadline(now_ns);
        if plant.is_armed() && (sample == 0 || plant.is_answered()) {
            sample += 1;
            plant.publish(&PublishedSample::of(&Measurement { sample, ..Measurement::default() })).unwrap();
        }
        events.extend(core::iter::from_fn(|| plant.poll_event()));
    }
    (plant, exciter, events)
}

#[test]
fn in_lockstep_a_refused_command_ends_with_its_reason_at_any_timeouts() {
    const SHORT_NS: u64 = 500 * TICK_NS;
    const LONG_NS: u64 = 1000 * TICK_NS;
    // With nearly equal ones the plant's ends between the exciter's emergency and its heartbeat, too.
    let nearly_equal = (0..10).map(|ticks| [SHORT_NS + ticks * TICK_NS, SHORT_NS]);
    let mut first_to_end = [0, 0];
    for timeouts in [[SHORT_NS, LONG_NS], [LONG_NS, SHORT_NS]].into_iter().chain(nearly_equal) {
        let (plant, exciter, events) = refused_in_lockstep(timeouts);
        let fault = plant.latched_fault().unwrap();
        assert_eq!(fault.code, EmergencyCode::CommandTimeout, "{timeouts:?}: {fault}");
        assert_eq!(Refusal::from_detail(fault.detail), (1, Some(Refusal::OutOfRange)), "{timeouts:?}: {fault}");
        let Some(ExciterOutcome::Faulted(ended)) = exciter.outcome() else { panic!("{:?}", exciter.outcome()) };
        let said = exciter.plant_fault().unwrap_or(ended);
        assert_eq!((said, exciter.awaits_reason()), (fault, false), "{timeouts:?}");
        let heard = heard(events.into_iter());
        let reason = (heard[0] == (true, EmergencyCode::SensorTimeout)).then_some(EmergencyCode::SensorTimeout);
        assert_eq!(plant.fault_reason().map(|said| said.code), reason, "{timeouts:?}: {heard:?}");
        first_to_end[usize::from(reason.is_some())] += 1;
    }
    // Both orders must have occurred, or the timeouts of this test no longer reach them.
    assert!(first_to_end.iter().all(|count| *count > 1), "{first_to_end:?}");
}

#[test]
fn an_exciter_that_misses_its_samples_waits_for_the_plant_s_reason() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    let exciter = bench.exciter.as_mut().unwrap();
    for tick in 1..=351 {
        exciter.handle_deadline(bench.now_ns + tick * TICK_NS);
        while exciter.poll_transmit().is_some() {}
    }
    assert!(exciter.awaits_reason());
    // The plant's fault because of the exciter's fault is not a reason.
    let mut plant = Transmitter::new(Network::default());
    let emergency = Emergency { node: NodeName::Plant, code: EmergencyCode::PartnerFault, detail: 2, sample: 0 };
    let state = Heartbeat { node: NodeName::Plant, state: NodeState::Fault };
    let messages = [Message::Emergency(emergency), Message::Heartbeat(state)];
    let [emergency, state] = messages.map(|message| plant.frame(&message).unwrap());
    exciter.handle_frame(bench.now_ns, &emergency);
    assert!(exciter.awaits_reason());
    exciter.handle_frame(bench.now_ns, &state);
    assert_eq!((exciter.awaits_reason(), exciter.plant_fault()), (false, None));
}

fn other_senders(events: impl Iterator<Item = NodeEvent>) -> usize {
    events.filter(|event| matches!(event, NodeEvent::OtherSender(_))).count()
}

/// Another network at the base of an active one: with another node id of the plant, or in the other profile.
#[test]
fn another_network_at_one_base_is_counted_and_reported_by_every_node() {
    let [one, other] =
        [(1, 2), (3, 4)].map(|(plant, exciter)| Network::default().with_node_ids(plant, exciter).unwrap());
    for other in [other, other.with_profile(WireProfile::Fd)] {
        let [mut crowd, mut alone] =
            [super::networks::Crowd::new(&[one, other], &[one, other]), super::networks::Crowd::new(&[one], &[one])];
        crowd.run(400);
        alone.run(400);
        assert_eq!(crowd.faults(), [None; 4], "{other:?}");
        assert_eq!(crowd.loads[0], alone.loads[0]);
        for plant in &mut crowd.plants {
            assert!(plant.frames().other_sender > 0 && plant.frames().other_sender <= plant.frames().refused);
            assert!(other_senders(core::iter::from_fn(|| plant.poll_event())) > 0);
        }
        for exciter in &mut crowd.exciters {
            assert!(exciter.frames().other_sender > 0 && exciter.frames().other_sender <= exciter.frames().refused);
            assert!(other_senders(core::iter::from_fn(|| exciter.poll_event())) > 0);
        }
    }
}

/// CANopen's request for a heartbeat is a remote frame under its identifier.
#[test]
fn a_remote_frame_and_a_refused_request_are_of_no_other_sender() {
    let mut bench = Bench::new(0.3);
    bench.run(50);
    let exciter = bench.exciter.as_mut().unwrap();
    for (id, format) in [(0x702, FrameFormat::Remote), (0x200, FrameFormat::Classic)] {
        let frame = Frame::new(Id::Standard(id), format, &[0; 8]).unwrap();
        exciter.handle_frame(bench.now_ns, &frame);
    }
    assert_eq!((exciter.frames().refused, exciter.frames().other_sender), (2, 0));
}

#[test]
fn a_node_that_receives_its_own_heartbeat_has_a_second_sender() {
    let mut bench = Bench::new(10.0);
    bench.run(50);
    let own = |node, network| {
        let heartbeat = Message::Heartbeat(Heartbeat { node, state: NodeState::Operational });
        Transmitter::new(network).frame(&heartbeat).unwrap()
    };
    let exciter = bench.exciter.as_mut().unwrap();
    exciter.handle_frame(bench.now_ns, &own(NodeName::Exciter, Network::default()));
    let Some(ExciterOutcome::Faulted(fault)) = exciter.outcome() else { panic!("{:?}", exciter.outcome()) };
    assert_eq!((fault.code, fault.detail), (EmergencyCode::SecondSender, 0x702));
    let mut plant = plant_node();
    plant.start(0);
    plant.handle_frame(0, &own(NodeName::Plant, Network::default()));
    let fault = plant.latched_fault().unwrap();
    assert_eq!((fault.code, fault.detail), (EmergencyCode::SecondSender, 0x701));
}

/// The requests among the exciter's frames.
fn requests(exciter: &mut ExciterNode) -> Vec<OperatorRequest> {
    let mut receiver = resonarm_protocol::Receiver::new(Network::default());
    let message = |frame: Frame| match receiver.accept(&frame) {
        Ok(Some(Message::Operator(OperatorCommand { request, .. }))) => Some(request),
        _ => None,
    };
    core::iter::from_fn(|| exciter.poll_transmit()).filter_map(message).collect()
}

#[test]
fn a_plant_found_in_fault_is_reset_before_it_is_armed_and_not_by_an_exciter_in_fault() {
    let mut plant = Transmitter::new(Network::default());
    let mut send_heartbeat = |exciter: &mut ExciterNode, now_ns: u64, state| {
        let heartbeat = Message::Heartbeat(Heartbeat { node: NodeName::Plant, state });
        exciter.handle_frame(now_ns, &plant.frame(&heartbeat).unwrap());
    };
    let hello = Message::PlantHello(Hello::new(WireProfile::Classic, RATE_HZ));
    let mut exciter = exciter_node(1.0);
    exciter.start(0);
    send_heartbeat(&mut exciter, 0, NodeState::Fault);
    exciter.handle_frame(0, &Transmitter::new(Network::default()).frame(&hello).unwrap());
    assert_eq!(requests(&mut exciter), [OperatorRequest::Reset, OperatorRequest::Arm]);
    send_heartbeat(&mut exciter, TICK_NS, NodeState::PreOperational);
    send_heartbeat(&mut exciter, 2 * TICK_NS, NodeState::Operational);
    send_heartbeat(&mut exciter, 3 * TICK_NS, NodeState::Fault);
    assert_eq!(exciter.state(), NodeState::Fault);
    (4..1000).for_each(|tick| exciter.handle_deadline(tick * TICK_NS));
    assert_eq!(requests(&mut exciter), []);
    assert!(exciter.rearm(1000 * TICK_NS));
    assert_eq!(exciter.state(), NodeState::PreOperational);
    exciter.handle_deadline(1100 * TICK_NS);
    assert_eq!(requests(&mut exciter), [OperatorRequest::Reset, OperatorRequest::Arm]);
}

/// A plant that missed the request to disarm receives it again with the next sample, and no more commands.
#[test]
fn an_exciter_that_ends_asks_to_disarm_at_every_sample_and_commands_no_more() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    let exciter = bench.exciter.as_mut().unwrap();
    exciter.stop(bench.now_ns);
    assert_eq!((requests(exciter), exciter.state()), (alloc::vec![OperatorRequest::Disarm], NodeState::PreOperational));
    for sample in 1..4 {
        bench.now_ns += TICK_NS;
        bench
            .plant
            .publish(&PublishedSample::of(&Measurement { sample: bench.sample + sample, ..Measurement::default() }))
            .unwrap();
        while let Some(frame) = bench.plant.poll_transmit() {
            exciter.handle_frame(bench.now_ns, &frame);
        }
        assert_eq!(requests(exciter), [OperatorRequest::Disarm]);
    }
    exciter.handle_deadline(bench.now_ns + 100 * TICK_NS);
    assert_eq!(requests(exciter), [OperatorRequest::Disarm]);
}

/// Timeouts that have passed at the same check.
#[test]
fn of_timeouts_that_pass_together_one_is_reported() {
    let mut jammed = Bench::with(Timing::lockstep(1000 * TICK_NS), 10.0);
    jammed.run(100);
    assert!(jammed.plant.is_armed());
    // Its frames wait from the time of the last command.
    jammed
        .plant
        .publish(&PublishedSample::of(&Measurement { sample: jammed.sample + 1, ..Measurement::default() }))
        .unwrap();
    for tick in 1..2000 {
        jammed.plant.handle_deadline(jammed.now_ns + tick * TICK_NS);
    }
    assert_eq!(jammed.plant.latched_fault().unwrap().code, EmergencyCode::BusLoss);
    let mut silent = Bench::with(Timing::lockstep(1000 * TICK_NS), 10.0);
    silent.run(100);
    for tick in 1..2000 {
        silent.plant.handle_deadline(silent.now_ns + tick * TICK_NS);
        while silent.plant.poll_transmit().is_some() {}
    }
    assert_eq!(silent.plant.latched_fault().unwrap().code, EmergencyCode::CommandTimeout);
}
