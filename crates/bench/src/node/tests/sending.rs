//! Frames that wait to be sent, and those sent after a jam.

use super::*;
use resonarm_protocol::{Id, ImpedanceHead, Receiver};

fn publish(plant: &mut PlantNode, sample: u64) {
    plant.publish(&PublishedSample::of(&Measurement { sample, ..Measurement::default() })).unwrap();
}

#[test]
fn after_a_jam_the_latest_sample_goes_out_whole_and_no_counter_is_missing() {
    let (mut plant, mut receiver) = (plant_node(), Receiver::new(Network::default()));
    plant.start(0);
    let mut heads = Vec::new();
    for sample in 0..300 {
        publish(&mut plant, sample);
        // The bus takes nothing from sample 10 to 199.
        if !(10..200).contains(&sample) {
            while let Some(frame) = plant.poll_transmit() {
                if let Some(Message::Head(ImpedanceHead { sample, .. })) = receiver.accept(&frame).unwrap() {
                    heads.push(sample);
                }
            }
        }
    }
    let expected: Vec<u16> = (0..10).chain(200..300).collect();
    assert_eq!((heads, receiver.lost()), (expected, 0));
    assert_eq!(plant.frames().unsent, 3 * 190);
}

#[test]
fn a_frame_that_the_bus_did_not_take_is_made_again() {
    let mut plant = plant_node();
    plant.start(0);
    while plant.poll_transmit().is_some() {}
    let sample_of = |frame: Option<Frame>| {
        let data = frame.unwrap().data().to_vec();
        (data[1] & 0xF, u16::from_le_bytes([data[6], data[7]]))
    };
    publish(&mut plant, 1);
    assert_eq!(sample_of(plant.next_frame()), (0, 1));
    publish(&mut plant, 2);
    assert_eq!(sample_of(plant.next_frame()), (0, 2));
    plant.frame_sent();
    assert_eq!(plant.next_frame().unwrap().id(), Id::Standard(0x204));
}

#[test]
fn emergency_and_heartbeat_go_before_samples() {
    let mut plant = plant_node();
    plant.start(0);
    while plant.poll_transmit().is_some() {}
    publish(&mut plant, 1);
    plant.fault(0, EmergencyCode::Overrun, 1);
    let ids: Vec<Id> = core::iter::from_fn(|| plant.poll_transmit()).map(|frame| frame.id()).collect();
    assert_eq!(ids, [0x081, 0x701, 0x203, 0x204, 0x205].map(Id::Standard));
}

#[test]
fn a_node_that_repeats_itself_in_a_jam_sends_it_once() {
    let mut bench = Bench::new(0.5);
    // The plant is not polled for a minute; the exciter receives nothing and repeats its request.
    for tick in 0..60_000 {
        bench.plant.handle_deadline(tick * TICK_NS);
        bench.exciter.as_mut().unwrap().handle_deadline(tick * TICK_NS);
    }
    let heartbeats =
        core::iter::from_fn(|| bench.plant.poll_transmit()).filter(|frame| frame.id() == Id::Standard(0x701));
    assert_eq!(heartbeats.count(), 2, "boot-up and pre-operational");
    assert_eq!(bench.plant.frames().unsent, 0);
}

#[test]
fn a_bus_that_takes_nothing_is_lost_only_for_nodes_at_work() {
    let (mut plant, mut transmitter) = armed();
    let hold = |plant: &mut PlantNode, transmitter: &mut Transmitter, tick: u64| {
        publish(plant, 70_000 + tick);
        let command = ForceCommand { force_x_n: 1.0, force_y_n: 0.0, sample: (70_000 + tick) as u16 };
        plant.handle_frame(tick * TICK_NS, &transmitter.frame(&Message::Force(command)).unwrap());
        plant.handle_deadline(tick * TICK_NS);
    };
    // Commands arrive in time, nothing is sent.
    (1..20).for_each(|tick| hold(&mut plant, &mut transmitter, tick));
    assert!(plant.is_armed());
    hold(&mut plant, &mut transmitter, 20);
    let fault = plant.latched_fault().unwrap();
    assert_eq!(fault.code, EmergencyCode::BusLoss);
    assert!(fault.detail > 3 * 19, "{fault}");

    let mut idle = plant_node();
    idle.start(0);
    (0..1000).for_each(|tick| idle.handle_deadline(tick * TICK_NS));
    idle.bus_lost(1000 * TICK_NS);
    assert_eq!(idle.state(), NodeState::PreOperational);
}

#[test]
fn bus_off_faults_both_nodes_at_work() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    bench.plant.bus_lost(bench.now_ns);
    assert_eq!(bench.plant.latched_fault().map(|fault| fault.code), Some(EmergencyCode::BusLoss));
    let exciter = bench.exciter.as_mut().unwrap();
    exciter.bus_lost(bench.now_ns);
    assert!(matches!(exciter.outcome(), Some(ExciterOutcome::Faulted(Emergency { code: EmergencyCode::BusLoss, .. }))));
}

#[test]
fn a_command_that_still_waits_when_the_controller_stops_is_taken_back() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    let exciter = bench.exciter.as_mut().unwrap();
    let answered = exciter.samples_played();
    bench
        .plant
        .publish(&PublishedSample::of(&Measurement { sample: bench.sample + 1, ..Measurement::default() }))
        .unwrap();
    while let Some(frame) = bench.plant.poll_transmit() {
        exciter.handle_frame(bench.now_ns, &frame);
    }
    assert_eq!(exciter.samples_played(), answered + 1);
    exciter.stop(bench.now_ns);
    let ids: Vec<Id> = core::iter::from_fn(|| exciter.poll_transmit()).map(|frame| frame.id()).collect();
    assert_eq!(ids, [0x200, 0x702].map(Id::Standard));
}

/// Two heartbeats wait at once, so that a counter advances within the list.
#[test]
fn waiting_frames_are_sent_one_by_one() {
    let mut plant = plant_node();
    plant.start(0);
    publish(&mut plant, 0);
    let mut waiting = Vec::new();
    plant.waiting_frames(64, &mut waiting);
    assert_eq!(waiting.len(), 6, "boot-up, pre-operational, hello, three of the sample");
    assert_eq!(waiting.first().copied(), plant.next_frame());
    let one_by_one: Vec<Frame> = core::iter::from_fn(|| plant.poll_transmit()).collect();
    assert_eq!(waiting, one_by_one);
    assert_eq!(plant.waiting(), 0);
}
