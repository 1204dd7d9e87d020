//! The indices of samples and commands: gaps, repetitions, older ones, two plants.

use super::*;
use resonarm_protocol::{Acceleration, Heartbeat, ImpedanceHead};

/// A controller at work, and a transmitter in place of the plant.
fn playing() -> (ExciterNode, Transmitter) {
    let (mut exciter, mut plant) = (exciter_node(20.0), Transmitter::new(Network::default()));
    exciter.start(0);
    let heartbeat = |state| Message::Heartbeat(Heartbeat { node: NodeName::Plant, state });
    for message in [Message::PlantHello(Hello::new(WireProfile::Classic, RATE_HZ)), heartbeat(NodeState::Operational)] {
        exciter.handle_frame(0, &plant.frame(&message).unwrap());
    }
    assert_eq!(exciter.state(), NodeState::Operational);
    (exciter, plant)
}

fn sample(exciter: &mut ExciterNode, plant: &mut Transmitter, sample: u16) {
    let (x_saturated, y_saturated) = (false, false);
    let head = ImpedanceHead { force_x_n: 0.0, force_y_n: 0.0, x_saturated, y_saturated, sample };
    let point = Acceleration { acceleration_x_m_s2: 0.0, acceleration_y_m_s2: 0.0, x_saturated, y_saturated, sample };
    for message in [Message::Head(head), Message::AccelerometerB(point), Message::AccelerometerC(point)] {
        exciter.handle_frame(0, &plant.frame(&message).unwrap());
    }
}

fn fault(exciter: &ExciterNode) -> Option<(EmergencyCode, u16)> {
    match exciter.outcome() {
        Some(ExciterOutcome::Faulted(emergency)) => Some((emergency.code, emergency.detail)),
        _ => None,
    }
}

#[test]
fn an_older_or_repeated_index_is_ignored_and_counted() {
    let (mut exciter, mut plant) = playing();
    for index in [100, 101, 100, 101, 102] {
        sample(&mut exciter, &mut plant, index);
    }
    assert_eq!((exciter.samples_played(), exciter.work().missed_samples(), exciter.outcome()), (3, 0, None));
    assert_eq!(exciter.stale_samples(), 2);
}

#[test]
fn lost_samples_move_the_profile_on() {
    let (mut exciter, mut plant) = playing();
    // The index wraps at 65536: from 65530 to 4 it is ten samples, of which nine are missing.
    for index in [65_530, 4, 5] {
        sample(&mut exciter, &mut plant, index);
    }
    assert_eq!((exciter.samples_played(), exciter.work().missed_samples(), exciter.outcome()), (12, 9, None));
}

#[test]
fn an_index_outside_the_window_is_a_fault() {
    for index in [1000_u16, 40_000, 64_000] {
        let (mut exciter, mut plant) = playing();
        sample(&mut exciter, &mut plant, 100);
        sample(&mut exciter, &mut plant, index);
        assert_eq!(fault(&exciter), Some((EmergencyCode::SampleSequence, index)));
    }
}

#[test]
fn two_plants_on_one_bus_end_in_a_fault() {
    // Their counters are the same and their frames arrive in changing order, so that samples of both are accepted.
    for apart in [1_u16, 3, 200, 5_000, 40_000] {
        let (mut exciter, mut first) = playing();
        let mut second = Transmitter::new(Network::default());
        for n in 0..400_u16 {
            let indices = [(0, n), (1, n.wrapping_add(apart))];
            for (plant, index) in if n % 7 < 3 { indices } else { [indices[1], indices[0]] } {
                sample(&mut exciter, if plant == 0 { &mut first } else { &mut second }, index);
            }
        }
        assert_eq!(fault(&exciter).map(|(code, _)| code), Some(EmergencyCode::SampleSequence), "{apart} apart");
    }
}

#[test]
fn the_first_command_for_a_sample_counts() {
    for timing in [Timing::real_time(RATE_HZ), Timing::lockstep(1_000_000_000)] {
        let (mut plant, mut transmitter) = armed_with(timing);
        for force_x_n in [10.0, 20.0] {
            let command = ForceCommand { force_x_n, force_y_n: 0.0, sample: 4464 };
            plant.handle_frame(0, &transmitter.frame(&Message::Force(command)).unwrap());
        }
        assert_eq!(plant.load(), Load::force_n(10.0, 0.0));
    }
}

#[test]
fn refusals_are_counted_by_reason_and_the_fault_names_the_last() {
    let (mut plant, mut transmitter) = armed();
    let forces = [(1.0, 4464), (1.0, 4464), (1.0, 4463), (700.0, 4464), (1.0, 4400), (601.0, 4464)];
    for (force_x_n, index) in forces {
        plant.publish(&PublishedSample::of(&Measurement { sample: 70_000, ..Measurement::default() })).unwrap();
        let command = ForceCommand { force_x_n, force_y_n: 0.0, sample: index };
        // A load that the wire can't carry is not sent.
        if let Ok(frame) = transmitter.frame(&Message::Force(command)) {
            plant.handle_frame(0, &frame);
        }
    }
    for (tick, force_x_n) in [(1, 601.0), (2, 602.0)] {
        plant.publish(&PublishedSample::of(&Measurement { sample: 70_000 + tick, ..Measurement::default() })).unwrap();
        let command = ForceCommand { force_x_n, force_y_n: 0.0, sample: (70_000 + tick) as u16 };
        plant.handle_frame(0, &transmitter.frame(&Message::Force(command)).unwrap());
    }
    let counts: Vec<u64> = plant.refusals().iter().map(|(_, count)| count).collect();
    assert_eq!((counts, plant.refusals().total()), (alloc::vec![0, 1, 1, 2, 2, 0, 0], 6));
    assert_eq!(plant.refusals().last(), Some(Refusal::OutOfRange));
    while plant.poll_transmit().is_some() {}
    (1..=20).for_each(|tick| plant.handle_deadline(tick * TICK_NS));
    let fault = plant.latched_fault().unwrap();
    assert_eq!(Refusal::from_detail(fault.detail), (6, Some(Refusal::OutOfRange)));
    assert_eq!(
        alloc::format!("{fault}"),
        "plant, code 1: no valid command in time (6 rejected, the last because the load is beyond the exciter's limits), at sample 4466"
    );
}
