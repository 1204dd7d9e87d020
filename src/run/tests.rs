use core::time::Duration;
use std::thread;

use super::*;
use crate::bus::{Bus, memory};
use crate::node::{ExciterNode, Outcome, PlantNode, ResponsePoint, Timing};
use crate::plant::Plant;
use crate::protocol::NodeState;
use crate::realtime::{OverrunPolicy, SampleRate, SystemClock};
use crate::scenario::Scenario;

const SCENARIO: &str = "
    arm = { beta2_deg = 60.0 }
    simulation = { seed = 3 }
    [excitation]
    amplitude = { force_x_n = 40.0 }
    ramp_s = 0.2
    profile = { waveform = 'stepped-sine', from_hz = 18, to_hz = 20, steps = 3, dwell_s = 0.5, settle_s = 0.1 }
";

fn scenario() -> Scenario {
    Scenario::parse(SCENARIO, "test").unwrap()
}

fn rate() -> SampleRate {
    SampleRate::new(scenario().simulation.rate_hz).unwrap()
}

fn sides(timing: Timing) -> (PlantSide, ExciterNode) {
    let scenario = scenario();
    let plant = Plant::new(&scenario.plant_spec().unwrap()).unwrap();
    let (network, rate_hz) = (scenario.network().unwrap(), scenario.wire_rate_hz().unwrap());
    let node = PlantNode::new(network, rate_hz, timing, *plant.exciter());
    let exciter = ExciterNode::new(network, rate_hz, timing, scenario.profile().unwrap());
    (PlantSide::new(plant, node, Tape::Off), exciter)
}

fn run_free() -> (PlantSide, Vec<ResponsePoint>) {
    let (mut side, mut exciter) = sides(scenario().lockstep_timing().unwrap());
    let mut responses = Vec::new();
    let report =
        free(&mut side, &mut exciter, rate(), None, &Signals::default(), |point| responses.push(point)).unwrap();
    assert_eq!(report.outcome, Some(Outcome::Finished));
    (side, responses)
}

#[test]
fn lockstep_and_free_give_the_same_states() {
    let (free_side, free_responses) = run_free();
    let (mut side, mut node) = sides(scenario().lockstep_timing().unwrap());
    let mut ends = memory::hub(2, 256);
    let (mut far, mut near) = (ends.pop().unwrap(), ends.pop().unwrap());
    let controller = thread::spawn(move || {
        let mut responses = Vec::new();
        let patience = Duration::from_secs(5);
        let signals = Signals::default();
        let report =
            exciter(&mut node, &mut far, &SystemClock, patience, &signals, |point| responses.push(point)).unwrap();
        (report, responses)
    });
    let end = End { on_disarm: true, after_samples: None };
    let (report, result) = lockstep(&mut side, &mut near, &SystemClock, rate(), end, &Signals::default());
    result.unwrap();
    let (exciter_report, responses) = controller.join().unwrap();
    assert_eq!(exciter_report.outcome, Outcome::Finished);
    assert_eq!((report.timing.steps, side.plant().step()), (free_side.plant().step(), free_side.plant().step()));
    assert_eq!(side.plant().state(), free_side.plant().state());
    assert!(side.plant().state().alpha_rad.norm() > 1e-6);
    assert_eq!(responses, free_responses);
    assert_eq!(responses.len(), 3);
    assert_eq!(report.bus.e2e_errors, 0);
}

#[test]
fn real_time_over_memory_keeps_count_of_everything() {
    let (mut side, mut node) = sides(scenario().real_time_timing().unwrap());
    let mut ends = memory::hub(2, 256);
    let (mut far, mut near) = (ends.pop().unwrap(), ends.pop().unwrap());
    let controller = thread::spawn(move || {
        exciter(&mut node, &mut far, &SystemClock, Duration::from_secs(5), &Signals::default(), |_| {}).unwrap()
    });
    let end = End { on_disarm: false, after_samples: Some(500) };
    let options = RealTimeOptions { rate: rate(), overrun: OverrunPolicy::Continue, end };
    let (report, result) = real_time(&mut side, &mut near, &SystemClock, &options, &Signals::default());
    result.unwrap();
    assert_eq!((report.timing.steps, side.plant().step()), (501, 500));
    assert!(report.bus.sent >= 3 * 501 && report.bus.received > 0);
    near.close().unwrap();
    drop(near);
    let exciter_report = controller.join().unwrap();
    // The plant left in the middle of the profile, so the controller must have noticed.
    assert!(matches!(exciter_report.outcome, Outcome::Faulted(_)), "{exciter_report:?}");
    assert!(exciter_report.samples_played > 0);
}

#[test]
fn an_exciter_alone_gives_up_and_a_plant_alone_goes_on() {
    let (mut side, mut node) = sides(scenario().lockstep_timing().unwrap());
    let mut ends = memory::hub(2, 64);
    let (mut far, mut near) = (ends.pop().unwrap(), ends.pop().unwrap());
    let patience = Duration::from_millis(50);
    let error = exciter(&mut node, &mut far, &SystemClock, patience, &Signals::default(), |_| {}).unwrap_err();
    insta::assert_snapshot!(error, @"no plant was heard within 0.05 s: start one with `resonarm run` on the same bus, with the same rate and base identifier");
    let signals = Signals::default();
    thread::scope(|scope| {
        scope.spawn(|| {
            thread::park_timeout(Duration::from_millis(100));
            signals.stop();
        });
        let end = End::default();
        let (report, result) = lockstep(&mut side, &mut near, &SystemClock, rate(), end, &signals);
        result.unwrap();
        assert_eq!(report.timing.steps, 0);
    });
    assert_eq!(side.node().state(), NodeState::PreOperational);
}
