//! The end of an armed node: the ramp, leaving, and the partner's reaction.

use super::*;
use resonarm_protocol::{Heartbeat, Receiver};

/// The messages that a plant has yet to send.
fn messages(plant: &mut PlantNode) -> Vec<Message> {
    let mut receiver = Receiver::new(Network::default());
    let frames = core::iter::from_fn(|| plant.poll_transmit());
    frames.map(|frame| receiver.accept(&frame).unwrap().unwrap()).collect()
}

fn operator(request: OperatorRequest) -> Message {
    Message::Operator(OperatorCommand { request, target: NodeName::Plant })
}

fn force(force_x_n: f64, sample: u16) -> Message {
    Message::Force(ForceCommand { force_x_n, force_y_n: 0.0, sample })
}

fn send(plant: &mut PlantNode, transmitter: &mut Transmitter, message: Message) {
    plant.handle_frame(0, &transmitter.frame(&message).unwrap());
}

/// The force of the next samples.
fn forces(plant: &mut PlantNode, samples: usize) -> Vec<f64> {
    core::iter::repeat_with(|| plant.load().force_n.x).take(samples).collect()
}

#[test]
fn arming_during_the_ramp_lets_it_continue_until_the_first_command() {
    let (mut plant, mut transmitter) = armed();
    send(&mut plant, &mut transmitter, force(50.0, 4464));
    assert_eq!(forces(&mut plant, 1), [50.0]);
    send(&mut plant, &mut transmitter, operator(OperatorRequest::Disarm));
    // A ramp of 50 ms takes 50 samples at this rate, so that 50 N fall by 1 N a sample.
    assert_eq!(forces(&mut plant, 2), [49.0, 48.0]);
    send(&mut plant, &mut transmitter, operator(OperatorRequest::Arm));
    assert!(plant.is_armed());
    assert_eq!(forces(&mut plant, 2), [47.0, 46.0]);
    // Disarmed again, the same ramp continues.
    send(&mut plant, &mut transmitter, operator(OperatorRequest::Disarm));
    assert_eq!(forces(&mut plant, 1), [45.0]);
    send(&mut plant, &mut transmitter, operator(OperatorRequest::Arm));
    send(&mut plant, &mut transmitter, force(-7.0, 4464));
    assert_eq!(forces(&mut plant, 2), [-7.0, -7.0]);
}

#[test]
fn the_ramp_ends_and_the_node_is_quiet_when_all_is_sent() {
    let (mut plant, mut transmitter) = armed();
    send(&mut plant, &mut transmitter, force(50.0, 4464));
    plant.fault(0, EmergencyCode::Overrun, 3);
    assert!(plant.is_ramping() && !plant.is_quiet());
    assert_eq!(forces(&mut plant, 50).last(), Some(&0.0));
    assert!(!plant.is_ramping() && !plant.is_quiet());
    messages(&mut plant);
    assert!(plant.is_quiet());
}

#[test]
fn a_failed_simulation_has_nothing_to_ramp() {
    let (mut plant, mut transmitter) = armed();
    send(&mut plant, &mut transmitter, force(50.0, 4464));
    plant.fault(0, EmergencyCode::SimulationFailed, 0);
    assert!(!plant.is_ramping());
    assert_eq!(
        (plant.load(), plant.latched_fault().map(|fault| fault.code)),
        (Load::default(), Some(EmergencyCode::SimulationFailed))
    );
}

#[test]
fn a_plant_that_leaves_announces_it_disarms_and_ramps() {
    let (mut plant, mut transmitter) = armed();
    send(&mut plant, &mut transmitter, force(50.0, 4464));
    messages(&mut plant);
    // The second call must not announce it again.
    plant.leave(0);
    plant.leave(0);
    let leaving = Emergency { node: NodeName::Plant, code: EmergencyCode::Leaving, detail: 50, sample: 4464 };
    let disarmed = Heartbeat { node: NodeName::Plant, state: NodeState::PreOperational };
    assert_eq!(messages(&mut plant), [Message::Emergency(leaving), Message::Heartbeat(disarmed)]);
    assert_eq!(plant.latched_fault(), None);
    send(&mut plant, &mut transmitter, operator(OperatorRequest::Arm));
    assert!(!plant.is_armed());
    assert_eq!(messages(&mut plant), [Message::Emergency(leaving)]);
    assert_eq!(forces(&mut plant, 51)[48..], [1.0, 0.0, 0.0]);
    assert!(plant.is_quiet());
}

#[test]
fn a_controller_whose_plant_leaves_ends_without_a_fault() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    let left = bench.loads.len();
    bench.plant.leave(bench.now_ns);
    bench.run(60);
    assert_eq!(bench.outcome(), Some(ExciterOutcome::PlantLeft));
    assert_eq!(bench.exciter.as_ref().unwrap().state(), NodeState::PreOperational);
    assert!(bench.loads[left].force_n.x != 0.0 && bench.plant.is_quiet());
}

#[test]
fn a_controller_that_leaves_disarms_the_plant_first() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    bench.exciter.as_mut().unwrap().leave(bench.now_ns);
    bench.run(60);
    let exciter = bench.exciter.as_ref().unwrap();
    assert_eq!((exciter.outcome(), exciter.is_quiet()), (Some(ExciterOutcome::Stopped), true));
    assert_eq!(bench.plant.state(), NodeState::PreOperational);
    assert_eq!(bench.emergencies(), [EmergencyCode::Leaving]);
    assert!(!bench.plant.is_ramping());
}

#[test]
fn a_controller_stopped_before_it_has_heard_that_the_plant_is_armed_disarms_it() {
    let mut bench = Bench::new(10.0);
    bench.exchange();
    assert!(bench.plant.is_armed());
    let exciter = bench.exciter.as_mut().unwrap();
    exciter.stop(bench.now_ns);
    assert_eq!((exciter.state(), exciter.outcome()), (NodeState::PreOperational, None));
    bench.run(60);
    assert_eq!(bench.outcome(), Some(ExciterOutcome::Stopped));
    assert_eq!((bench.plant.state(), bench.plant.latched_fault()), (NodeState::PreOperational, None));
}

#[test]
fn an_armed_plant_disarms_with_a_ramp_when_its_controller_only_announces_that_it_leaves() {
    let (mut plant, mut transmitter) = armed();
    send(&mut plant, &mut transmitter, force(50.0, 4464));
    let leaving = Emergency { node: NodeName::Exciter, code: EmergencyCode::Leaving, detail: 0, sample: 0 };
    send(&mut plant, &mut transmitter, Message::Emergency(leaving));
    assert_eq!((plant.state(), plant.is_ramping()), (NodeState::PreOperational, true));
    // It must introduce itself again.
    send(&mut plant, &mut transmitter, operator(OperatorRequest::Arm));
    assert!(!plant.is_armed());
}

#[test]
fn a_slip_is_reported_and_counted_and_is_no_fault() {
    let mut bench = Bench::new(0.5);
    bench.run(100);
    // A stall of the plant: its schedule moves, and no sample is missing in its numbering.
    bench.now_ns += 150 * TICK_NS;
    bench.plant.slip(150);
    bench.run(20);
    bench.plant.slip(7);
    bench.run(500);
    let exciter = bench.exciter.as_ref().unwrap();
    assert_eq!(
        (exciter.slipped_periods(), exciter.work().missed_samples(), exciter.outcome()),
        (157, 0, Some(ExciterOutcome::Finished))
    );
    assert_eq!(bench.emergencies(), [EmergencyCode::ScheduleSlipped, EmergencyCode::ScheduleSlipped]);
    assert_eq!(bench.plant.slipped_periods(), 157);
}
