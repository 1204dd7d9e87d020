//! Limits of the gate: the rate of change of the load, and the travel.

use super::*;
use crate::rig::GateSpec;
use resonarm_protocol::Trip;

/// 1 N and 2 N·m a sample period, and 10 mm.
const LIMITS: GateSpec = GateSpec {
    force_rate_limit_n_per_s: Some(1000.0),
    torque_rate_limit_nm_per_s: Some(2000.0),
    travel_limit_m: Some(0.01),
};

/// An armed plant with these limits, and its controller's transmitter.
struct Driven {
    plant: PlantNode,
    transmitter: Transmitter,
    now_ns: u64,
    sample: u64,
}

impl Driven {
    fn new() -> Driven {
        let (plant, transmitter) = armed();
        Driven { plant: plant.with_limits(LIMITS), transmitter, now_ns: 0, sample: 70_000 }
    }

    fn send(&mut self, message: &Message) {
        self.plant.handle_frame(self.now_ns, &self.transmitter.frame(message).unwrap());
    }

    fn ask(&mut self, request: OperatorRequest) {
        self.send(&Message::Operator(OperatorCommand { request, target: NodeName::Plant }));
    }

    fn force(&mut self, force_x_n: f64, force_y_n: f64) {
        let sample = self.sample as u16;
        self.send(&Message::Force(ForceCommand { force_x_n, force_y_n, sample }));
    }

    /// The load over the next sample period, which ends with this travel.
    fn tick(&mut self, travel_m: f64) -> Load {
        self.now_ns += TICK_NS;
        self.sample += 1;
        self.plant.handle_deadline(self.now_ns);
        let load = self.plant.load();
        let measurement = Measurement { sample: self.sample, ..Measurement::default() };
        self.plant.publish(&PublishedSample { travel_m: Some(travel_m), ..PublishedSample::of(&measurement) }).unwrap();
        while self.plant.poll_transmit().is_some() {}
        load
    }

    /// A number of sample periods, all with this travel.
    fn run(&mut self, ticks: u32, travel_m: f64) {
        for _ in 0..ticks {
            let _ = self.tick(travel_m);
        }
    }
}

#[test]
fn a_jump_is_refused_until_the_command_timeout_and_a_slope_is_taken() {
    let mut driven = Driven::new();
    for n in 1..=5 {
        driven.force(f64::from(n), -f64::from(n));
        assert_eq!(driven.tick(0.0), Load::force_n(f64::from(n), -f64::from(n)));
    }
    // Two commands are lost: the third may change as much as they would have.
    // From 5 to 8 N in the three periods since the last command.
    driven.run(2, 0.0);
    driven.force(8.0, -8.0);
    assert_eq!(driven.tick(0.0), Load::force_n(8.0, -8.0));
    for _ in 0..19 {
        // 1.1 N in a sample period, where 1 N is allowed. A command that is rejected gives the next one no more time.
        driven.force(8.0, -6.9);
        assert_eq!(driven.plant.load(), Load::force_n(8.0, -8.0));
        driven.run(1, 0.0);
    }
    let fault = driven.plant.latched_fault().unwrap();
    assert_eq!(fault.code, EmergencyCode::CommandTimeout);
    assert_eq!(Refusal::from_detail(fault.detail), (19, Some(Refusal::RateOfChange)));
    assert!(driven.plant.is_ramping());
}

/// Parts that no frame carries act with the frame that answers the same sample, and with no other.
#[test]
fn parts_handed_over_for_another_sample_do_not_act() {
    let mut driven = Driven::new();
    let at_joint3 = Load::at_joint(2, 0.5);
    driven.plant.hand_over(driven.sample as u16, &at_joint3);
    assert_eq!(driven.plant.load(), Load::default(), "nothing acts without a frame");
    driven.force(0.0, 0.0);
    assert_eq!(driven.tick(0.0), at_joint3);
    driven.force(1.0, 0.0);
    assert_eq!(driven.tick(0.0), Load::force_n(1.0, 0.0), "these parts answered the sample before");
}

/// A controller may command −0 where nothing acts; a run in lockstep, where nothing is handed over, has 0 there.
#[test]
fn a_negative_zero_that_is_handed_over_has_no_sign() {
    let mut driven = Driven::new();
    driven.plant.hand_over(driven.sample as u16, &Load::at_joint(2, -0.0));
    driven.force(1.0, 0.0);
    let load = driven.tick(0.0);
    assert_eq!(load.torque_nm[2].to_bits(), 0.0_f64.to_bits());
}

#[test]
fn a_torque_in_place_of_a_force_changes_both() {
    let mut driven = Driven::new();
    driven.force(1.0, 0.0);
    driven.run(1, 0.0);
    let torque =
        |torque1_nm, sample| Message::Torque(resonarm_protocol::TorqueCommand { torque1_nm, torque2_nm: 0.0, sample });
    let sample = driven.sample as u16;
    // 2 N·m may come in a period, and the force of 1 N go.
    driven.send(&torque(2.05, sample));
    assert_eq!(driven.tick(0.0), Load::force_n(1.0, 0.0));
    driven.send(&torque(-2.0, sample + 1));
    assert_eq!(driven.tick(0.0), Load::torque_nm(-2.0, 0.0));
    assert_eq!(driven.plant.refusals().count(Refusal::RateOfChange), 1);
}

#[test]
fn the_first_command_after_arming_starts_from_the_load_that_still_ramps() {
    let mut driven = Driven::new();
    for n in 1..=50 {
        driven.force(f64::from(n), 0.0);
        driven.run(1, 0.0);
    }
    driven.ask(OperatorRequest::Disarm);
    driven.run(10, 0.0);
    driven.ask(OperatorRequest::Arm);
    assert!(driven.plant.is_armed());
    driven.force(0.0, 0.0);
    assert_eq!(driven.plant.refusals().last(), Some(Refusal::RateOfChange));
    // 50 N have ramped for 11 of 50 samples.
    let held = driven.tick(0.0);
    assert_eq!(held, Load::force_n(39.0, 0.0));
    driven.force(38.0, 0.0);
    assert_eq!(driven.tick(0.0), Load::force_n(38.0, 0.0));
}

#[test]
fn beyond_the_travel_a_command_trips_the_exciter() {
    let mut driven = Driven::new();
    driven.force(1.0, 0.0);
    assert_eq!(driven.tick(0.01), Load::force_n(1.0, 0.0));
    driven.force(1.0, 0.0);
    assert_eq!(driven.tick(0.010_001), Load::force_n(1.0, 0.0));
    assert!(driven.plant.is_armed(), "it is the command that trips");
    driven.force(0.0, 0.0);
    let tripped = Emergency {
        node: NodeName::Plant,
        code: EmergencyCode::ExciterTripped,
        detail: Trip::Travel as u16,
        sample: driven.sample as u16,
    };
    assert_eq!(driven.plant.latched_fault(), Some(tripped));
    insta::assert_snapshot!(tripped, @"plant, code 14: the exciter has tripped (the travel), at sample 4466");
    assert_eq!(driven.tick(0.005), Load::default(), "at once, without a ramp");

    // Within the travel it can be armed again; beyond, the first command trips it again.
    for (travel_m, is_driven) in [(0.005, true), (0.02, false)] {
        driven.ask(OperatorRequest::Reset);
        driven.ask(OperatorRequest::Arm);
        driven.run(1, travel_m);
        assert!(driven.plant.is_armed());
        driven.force(1.0, 0.0);
        assert_eq!(driven.plant.is_armed(), is_driven);
    }
    assert_eq!(driven.plant.refusals().count(Refusal::Travel), 2);
}

#[test]
fn beyond_the_travel_without_commands_the_command_timeout_runs() {
    let mut driven = Driven::new();
    driven.force(1.0, 0.0);
    // The travel is far too large, but without a command nothing drives the structure further: the timeout of 20 ms
    // ends it.
    driven.run(21, 1.0);
    assert_eq!(driven.plant.latched_fault().map(|fault| fault.code), Some(EmergencyCode::CommandTimeout));
}
