//! Networks of the FD profile, of other node ids, and several on one bus.

use super::*;
use crate::control::{Answer, Length, LoadKind, ResponsePoint};
use resonarm_protocol::{FrameFormat, Mismatch, Receiver, SamplesPerFrame};

fn fd() -> Network {
    Network::default().with_profile(WireProfile::Fd)
}

#[test]
fn the_fd_profile_plays_from_arming_to_disarming() {
    let mut bench = Bench::on([fd(); 2], Timing::real_time(RATE_HZ), 0.5);
    bench.run(600);
    assert_eq!(bench.outcome(), Some(ExciterOutcome::Finished));
    let expected = profile(0.5);
    // The FD profile carries loads in single precision.
    let single = |n: u64| f64::from(expected.load(n).force_n.x as f32);
    let seen = bench.loads.iter().map(|load| load.force_n.x).skip_while(|force| *force == 0.0);
    let wanted = (0..expected.samples()).map(single).skip_while(|force| *force == 0.0);
    assert!(seen.zip(wanted).all(|(seen, wanted)| seen == wanted));
    assert!(bench.loads.iter().any(|load| load.force_n.x > 19.9));
}

#[test]
fn a_sample_of_the_fd_profile_is_one_frame_with_every_reading() {
    let mut plant = PlantNode::new(fd(), RATE_HZ, Timing::real_time(RATE_HZ), Exciter::default());
    let reading = |value, clipped| crate::rig::Reading { value, clipped };
    let measurement = Measurement {
        sample: 65_537,
        head_force_n: [reading(1e4, false), reading(-0.1, true)],
        acceleration_b_m_s2: [reading(2500.0, false), reading(1e-3, false)],
        acceleration_c_m_s2: [reading(-1e39, false), reading(0.0, false)],
        ..Measurement::default()
    };
    plant.publish(&PublishedSample::of(&measurement)).unwrap();
    let frame = plant.poll_transmit().unwrap();
    // The classic profile would have three frames.
    assert_eq!(plant.poll_transmit(), None);
    assert!(matches!(frame.format(), FrameFormat::Fd { bit_rate_switch: true, .. }));
    let Ok(Some(Message::Sensors(sensors))) = Receiver::new(fd()).accept(&frame) else { panic!("{frame}") };
    assert_eq!(sensors.sample, 1);
    let [x, y] = sensors.values.force_n;
    assert_eq!((x.value, x.saturated, y.value, y.saturated), (1e4, false, f64::from(-0.1_f32), true));
    assert_eq!(sensors.values.acceleration_b_m_s2[0].value, 2500.0);
    let beyond = sensors.values.acceleration_c_m_s2[0];
    assert_eq!((beyond.value, beyond.saturated), (f64::from(f32::MIN), true));
}

#[test]
fn nodes_of_different_profiles_never_arm_and_say_why() {
    for networks in [[fd(), Network::default()], [Network::default(), fd()]] {
        let mut bench = Bench::on(networks, Timing::real_time(RATE_HZ), 0.5);
        bench.run(100);
        let Some(ExciterOutcome::Faulted(emergency)) = bench.outcome() else { panic!("{:?}", bench.outcome()) };
        assert_eq!((emergency.code, emergency.detail), (EmergencyCode::Incompatible, Mismatch::Profile as u16));
        assert!(bench.loads.iter().all(|load| *load == Load::default()));
    }
}

/// Two samples a frame: every second sample is answered, and every one is read.
#[test]
fn two_samples_go_in_a_frame_once_armed() {
    let timing = Timing::real_time(RATE_HZ);
    let mut bench = Bench::on([fd(); 2], timing, 0.5);
    bench.plant =
        PlantNode::new(fd(), RATE_HZ, timing, Exciter::default()).with_samples_per_frame(SamplesPerFrame::Two);
    bench.plant.start(0);
    bench.run(600);
    assert_eq!(bench.outcome(), Some(ExciterOutcome::Finished));
    let exciter = bench.exciter.as_ref().unwrap();
    assert_eq!((exciter.work().missed_samples(), exciter.frames().unsent, bench.plant.refusals().total()), (0, 0, 0));
    assert_eq!(exciter.samples_played(), profile(0.5).samples() + 1);
    let held: Vec<f64> = bench.loads.iter().map(|load| load.force_n.x).skip_while(|force| *force == 0.0).collect();
    let expected = profile(0.5);
    let singles: Vec<f64> = (0..expected.samples()).map(|n| f64::from(expected.load(n).force_n.x as f32)).collect();
    for pair in held.chunks_exact(2).take(200) {
        // One answer to two samples is held for both.
        assert_eq!(pair[0], pair[1]);
        assert!(singles.contains(&pair[0]));
    }
    assert!(held.iter().any(|force| *force > 19.0));
}

/// Every node on one bus: all others receive the frames of each.
pub(super) struct Crowd {
    now_ns: u64,
    sample: u64,
    pub plants: Vec<PlantNode>,
    pub exciters: Vec<ExciterNode>,
    /// The loads of each plant.
    pub loads: Vec<Vec<Load>>,
}

impl Crowd {
    pub fn new(plants: &[Network], exciters: &[Network]) -> Crowd {
        let timing = Timing::real_time(RATE_HZ);
        let plant = |network: &Network| PlantNode::new(*network, RATE_HZ, timing, Exciter::default());
        let exciter = |network: &Network| carry(*network, RATE_HZ, timing, dwell(0.3));
        let (mut plants, mut exciters) =
            (plants.iter().map(plant).collect::<Vec<_>>(), exciters.iter().map(exciter).collect::<Vec<_>>());
        plants.iter_mut().for_each(|plant| plant.start(0));
        exciters.iter_mut().for_each(|exciter| exciter.start(0));
        let loads = plants.iter().map(|_| Vec::new()).collect();
        Crowd { now_ns: 0, sample: 0, plants, exciters, loads }
    }

    pub fn run(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.now_ns += TICK_NS;
            self.sample += 1;
            for (plant, loads) in self.plants.iter_mut().zip(&mut self.loads) {
                plant.handle_deadline(self.now_ns);
                loads.push(plant.load());
                plant
                    .publish(&PublishedSample::of(&Measurement { sample: self.sample, ..Measurement::default() }))
                    .unwrap();
            }
            self.exchange();
        }
    }

    fn exchange(&mut self) {
        for k in 0..self.plants.len() {
            while let Some(frame) = self.plants[k].poll_transmit() {
                self.deliver(&frame, Some(k), None);
            }
        }
        for k in 0..self.exciters.len() {
            self.exciters[k].handle_deadline(self.now_ns);
            while let Some(frame) = self.exciters[k].poll_transmit() {
                self.deliver(&frame, None, Some(k));
            }
        }
    }

    fn deliver(&mut self, frame: &Frame, plant: Option<usize>, exciter: Option<usize>) {
        for (_, node) in self.plants.iter_mut().enumerate().filter(|(k, _)| Some(*k) != plant) {
            node.handle_frame(self.now_ns, frame);
        }
        for (_, node) in self.exciters.iter_mut().enumerate().filter(|(k, _)| Some(*k) != exciter) {
            node.handle_frame(self.now_ns, frame);
        }
    }

    pub fn faults(&self) -> Vec<Option<EmergencyCode>> {
        let of_exciter = |exciter: &ExciterNode| match exciter.outcome() {
            Some(ExciterOutcome::Faulted(Emergency { node: NodeName::Exciter, code, .. })) => Some(code),
            _ => None,
        };
        let of_plant = |plant: &PlantNode| plant.latched_fault().map(|emergency| emergency.code);
        self.plants.iter().map(of_plant).chain(self.exciters.iter().map(of_exciter)).collect()
    }
}

/// Networks side by side: other bases, other node ids, another profile.
fn side_by_side() -> [Network; 3] {
    let network = |base, plant_id, exciter_id| Network::new(base).unwrap().with_node_ids(plant_id, exciter_id).unwrap();
    [Network::default(), network(0x300, 3, 4), network(0x310, 127, 126).with_profile(WireProfile::Fd)]
}

#[test]
fn benches_side_by_side_do_not_disturb_each_other() {
    let networks = side_by_side();
    let mut crowd = Crowd::new(&networks, &networks);
    crowd.run(400);
    let mut alone = Crowd::new(&networks[..1], &networks[..1]);
    alone.run(400);
    assert!(crowd.exciters.iter().all(|exciter| exciter.outcome() == Some(ExciterOutcome::Finished)));
    assert!(crowd.plants.iter().all(|plant| plant.frames().refused == 0 && plant.refusals().total() == 0));
    assert_eq!(crowd.loads[0], alone.loads[0]);
    // The second network plays the same profile. The third has single precision, so that its loads differ by
    // rounding.
    assert_eq!(crowd.loads[1], alone.loads[0]);
    assert!(alone.loads[0].iter().any(|load| load.force_n.x > 10.0));
}

#[test]
fn a_second_plant_is_found_by_both() {
    let mut crowd = Crowd::new(&[Network::default(); 2], &[]);
    crowd.run(2);
    assert_eq!(crowd.faults(), [Some(EmergencyCode::SecondSender); 2]);
}

#[test]
fn a_second_exciter_is_found_by_both_and_the_load_goes_to_zero() {
    let mut crowd = Crowd::new(&[Network::default()], &[Network::default()]);
    crowd.run(100);
    assert!(crowd.plants[0].is_armed());
    let timing = Timing::real_time(RATE_HZ);
    crowd.exciters.push(carry(Network::default(), RATE_HZ, timing, dwell(0.3)));
    crowd.exciters[1].start(crowd.now_ns);
    crowd.run(5);
    assert_eq!(crowd.faults()[1..], [Some(EmergencyCode::SecondSender); 2]);
    assert!(!crowd.plants[0].is_armed());
    // The ramp takes 50 samples.
    crowd.run(60);
    assert_eq!(crowd.loads[0].last(), Some(&Load::default()));
}

#[test]
fn an_exciter_that_has_ended_arms_no_plant_that_starts_again() {
    let mut bench = Bench::new(0.3);
    bench.run(400);
    assert_eq!(bench.outcome(), Some(ExciterOutcome::Finished));
    bench.plant = plant_node();
    bench.plant.start(bench.now_ns);
    bench.run(300);
    assert_eq!(bench.plant.state(), NodeState::PreOperational);
}

/// A station of the operator's may send requests in place of the exciter.
#[test]
fn an_operator_s_request_is_no_second_sender() {
    let mut bench = Bench::new(0.3);
    bench.run(50);
    let mut operator = Transmitter::new(Network::default());
    let request = OperatorCommand { request: OperatorRequest::Reset, target: NodeName::Plant };
    let frame = operator.frame(&Message::Operator(request)).unwrap();
    bench.exciter.as_mut().unwrap().handle_frame(bench.now_ns, &frame);
    bench.run(400);
    assert_eq!(bench.outcome(), Some(ExciterOutcome::Finished));
}

/// A constant torque at the third joint, of which Resonarm's protocol has no field.
#[derive(Debug)]
struct ThirdJoint;

impl Controller for ThirdJoint {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Torque
    }

    fn restart(&mut self) {}

    fn answer(&mut self, _sample: &Measurement) -> Answer {
        Answer::Hold(Load::torque_nm(5.0, 0.0) + Load::at_joint(2, 5.0))
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Unknown
    }
}

#[test]
fn a_load_without_a_field_is_refused_and_no_part_of_it_acts() {
    let timing = Timing::real_time(RATE_HZ);
    let mut exciter = carry(Network::default(), RATE_HZ, timing, Box::new(ThirdJoint));
    let lack = exciter.check_load(&Load::at_joint(2, 5.0)).unwrap_err();
    insta::assert_snapshot!(lack, @"the exciter's load has torque3_nm, but Resonarm's protocol carries only torque1_nm, torque2_nm, force_x_n and force_y_n: change the excitation, or map a user protocol by [wire]");
    assert_eq!(exciter.check_load(&Load::planar([1.0, 2.0], [3.0, 4.0])), Ok(()));
    exciter.start(0);
    let mut bench = Bench { exciter: Some(exciter), ..Bench::with(timing, 0.5) };
    bench.run(300);
    assert!(bench.loads.iter().all(|load| *load == Load::default()));
    let fault = core::iter::from_fn(|| bench.exciter.as_mut()?.poll_event()).find_map(|event| match event {
        NodeEvent::Emergency(emergency) => Some(emergency.code),
        _ => None,
    });
    assert_eq!(fault, Some(EmergencyCode::CommandOutOfRange));
}
