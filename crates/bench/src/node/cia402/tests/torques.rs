//! Targets become loads; positions come back.

use super::*;

#[test]
fn targets_of_both_drives_are_one_load() {
    let mut bench = Bench::new(2, TimeBase::Clock);
    bench.tick();
    bench.enable(&NODES);
    bench.target(1, 10);
    bench.target(2, -20);
    bench.tick();
    assert_eq!(bench.torques_nm(), [1.0, -2.0]);
    // The newest target of each counts; the other is held.
    bench.target(1, 30);
    bench.target(1, 40);
    bench.tick();
    assert_eq!(bench.torques_nm(), [4.0, -2.0]);
    assert_eq!(bench.read(1, 0x6077) as i16, 40);
    assert_eq!(bench.read(2, 0x6077) as i16, -20);
    assert_eq!(bench.node.refusals().total(), 0);
}

#[test]
fn a_drive_acts_only_on_targets_received_since_it_was_enabled() {
    let mut bench = Bench::new(1, TimeBase::Clock);
    bench.send(0, &[1, 0]);
    bench.write(1, 0x6071, &100_i16.to_le_bytes()).unwrap();
    bench.tick();
    assert_eq!(bench.torques_nm(), [0.0; 2]);
    bench.enable(&[1]);
    bench.tick();
    assert_eq!(bench.torques_nm(), [0.0; 2]);
    assert_eq!(bench.read(1, 0x6071) as i16, 100);
    bench.write(1, 0x6071, &100_i16.to_le_bytes()).unwrap();
    bench.tick();
    assert_eq!(bench.torques_nm(), [10.0, 0.0]);
}

#[test]
fn halt_and_other_modes_have_no_torque() {
    let mut bench = Bench::new(1, TimeBase::Clock);
    bench.enable(&[1]);
    bench.target(1, 10);
    bench.tick();
    assert_eq!(bench.torques_nm(), [1.0, 0.0]);
    bench.command(1, 0x10F, 10);
    bench.tick();
    assert_eq!((bench.torques_nm(), bench.statusword(1) & 0x106F), ([0.0; 2], 0x0027));
    bench.target(1, 20);
    bench.tick();
    assert_eq!(bench.torques_nm(), [2.0, 0.0]);
    bench.write(1, 0x6060, &[0]).unwrap();
    bench.target(1, 20);
    bench.tick();
    assert_eq!((bench.torques_nm(), bench.read(1, 0x6061)), ([0.0; 2], 0));
    // A mode that there is not.
    assert_eq!(bench.write(1, 0x6060, &[8]), Err(0x0609_0030));
    assert_eq!(bench.read(1, 0x6061), 0);
    // The objects of other modes are there, and do nothing.
    for index in [0x607A, 0x6081, 0x6083, 0x60FF] {
        bench.write(1, index, &1_u32.to_le_bytes()).unwrap();
        assert_eq!(bench.read(1, index), 1);
    }
}

#[test]
fn a_refused_target_never_acts_and_is_counted() {
    let mut bench = Bench::new(1, TimeBase::Clock);
    bench.enable(&[1]);
    bench.target(1, 10);
    bench.tick();
    let (_, limit_nm) = Exciter::default().limits();
    let beyond = (limit_nm / spec(1).drives[0].torque_step_nm()) as i16 + 1;
    bench.target(1, beyond);
    bench.tick();
    assert_eq!(bench.torques_nm(), [1.0, 0.0]);
    assert_eq!(bench.node.refusals().total(), 1);
    assert!(bench.events.contains(&NodeEvent::Refused(Refusal::OutOfRange)));
    assert_eq!(bench.statusword(1) & 0x0800, 0x0800);
    bench.target(1, 20);
    bench.tick();
    assert_eq!((bench.torques_nm(), bench.statusword(1) & 0x0800), ([2.0, 0.0], 0));
}

#[test]
fn a_drive_switched_off_beside_another_drops_its_torque_and_the_last_one_ramps() {
    let mut bench = Bench::new(2, TimeBase::Clock);
    bench.enable(&NODES);
    bench.target(1, 10);
    bench.target(2, 10);
    bench.tick();
    bench.control(1, 0x00);
    bench.tick();
    assert_eq!((bench.torques_nm(), bench.node.state()), ([0.0, 1.0], NodeState::Operational));
    bench.command(2, 0x02, 10);
    assert_eq!((bench.node.state(), bench.statusword(2) & 0x6F), (NodeState::PreOperational, 0x07));
    bench.tick();
    let [_, first_nm] = bench.torques_nm();
    assert!(first_nm > 0.9 && first_nm < 1.0, "{first_nm}");
    (0..200).for_each(|_| bench.tick());
    assert_eq!(bench.torques_nm(), [0.0; 2]);
}

#[test]
fn positions_are_counts_of_the_motor_and_are_limited_and_counted() {
    let mut bench = Bench::new(2, TimeBase::Clock);
    bench.enable(&NODES);
    bench.states = alloc::vec![core::f64::consts::TAU, -core::f64::consts::PI, 0.5, -0.25];
    bench.tick();
    bench.frames();
    bench.send(0x80, &[]);
    bench.tick();
    let of = |first: i32, second: i32| {
        let bytes: Vec<u8> = first.to_le_bytes().into_iter().chain(second.to_le_bytes()).collect();
        bytes
    };
    let frames = bench.frames();
    let data = |id| frames.iter().find(|frame| frame.id() == Id::Standard(id)).unwrap().data().to_vec();
    assert_eq!(data(0x281), of(6_553_600, 521_519));
    assert_eq!(data(0x282), of(-3_276_800, -260_759));
    assert_eq!(bench.node.frames().limited_values, 0);
    bench.states = alloc::vec![1e6, 0.0, 0.0, 0.0];
    bench.send(0x80, &[]);
    bench.tick();
    assert_eq!(bench.frames().iter().filter(|frame| frame.id() == Id::Standard(0x281)).count(), 1);
    assert_eq!(bench.node.frames().limited_values, 1);
    bench.states = alloc::vec![f64::NAN, 0.0, 0.0, 0.0];
    let measurement = Measurement::default();
    let sample = PublishedSample {
        measurement: &measurement,
        states: &States::new(&bench.states, &[]).unwrap(),
        travel_m: None,
    };
    assert!(matches!(bench.node.publish(&sample), Err(PublishError::NotFinite { name, .. }) if name == "alpha1_rad"));
}

/// Position and velocity are those of the drive's own joint, however many joints there are. (The velocity used to be the
/// third state, which is one in a two-link arm alone.)
#[test]
fn a_drive_at_the_first_of_three_joints_has_its_own_rate() {
    let drive = DriveSpec { encoder_counts_per_turn: 1000, gear_ratio: 1.0, ..spec(1).drives[0] };
    for joint in 0..3 {
        let one = Cia402Spec { drives: alloc::vec![DriveSpec { joint, ..drive }], ..spec(1) };
        let mut bench = Bench::of(&one, TimeBase::Clock);
        bench.states = alloc::vec![1.0, 2.0, 3.0, 10.0, 20.0, 30.0];
        bench.tick();
        let counts = |value: f64| libm::rint(value * 1000.0 / core::f64::consts::TAU) as u32;
        let number = (joint + 1) as f64;
        assert_eq!(
            [bench.read(1, 0x6064), bench.read(1, 0x606C)],
            [counts(number), counts(10.0 * number)],
            "joint {joint}"
        );
    }
}
