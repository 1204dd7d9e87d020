//! Two nodes in virtual time, with a wire between them that can lose, repeat, corrupt and delay.

mod fresh;
mod gate;
mod indices;
mod networks;
mod partner;
mod ramp;
mod sending;
mod stalls;

use super::*;
use crate::control::{Controller, OpenLoop};
use crate::excitation::{ExcitationSpec, Profile, Waveform};
use crate::rig::{Exciter, Load, Measurement};
use alloc::boxed::Box;
use alloc::vec::Vec;
use proptest::prelude::*;
use resonarm_protocol::Node as NodeName;
use resonarm_protocol::{
    Emergency, EmergencyCode, ForceCommand, Frame, Hello, Message, Network, NodeState, OperatorCommand,
    OperatorRequest, Profile as WireProfile, Transmitter,
};

const RATE_HZ: u16 = 1000;
const TICK_NS: u64 = 1_000_000;

/// Sends an exciter three hundred frames that it rejects before and behind those by which the plant is armed, and loses
/// the bus: the run knows of both changes of state.
pub(super) fn check_that_rejected_frames_hide_no_transition(
    exciter: &mut dyn ExciterInterface,
    rejected: &Frame,
    arming: &[Frame],
) {
    let reject = |exciter: &mut dyn ExciterInterface| (0..300).for_each(|_| exciter.handle_frame(0, rejected));
    exciter.start(0);
    reject(exciter);
    arming.iter().for_each(|frame| exciter.handle_frame(0, frame));
    reject(exciter);
    assert_eq!((exciter.core().arms(), exciter.core().leaves()), (1, 0), "{exciter:?}");
    assert_eq!(exciter.frames().refused, 600);
    exciter.bus_lost(0);
    reject(exciter);
    assert_eq!((exciter.core().arms(), exciter.core().leaves()), (1, 1));
    let events: Vec<NodeEvent> = core::iter::from_fn(|| exciter.poll_event()).collect();
    let to = |wanted| events.iter().any(|event| matches!(event, NodeEvent::State { to, .. } if *to == wanted));
    assert!(to(NodeState::Operational) && to(NodeState::Fault), "{events:?}");
    assert!(events.iter().any(|event| matches!(event, NodeEvent::Lost(lost) if *lost > 0)), "{events:?}");
}

fn profile(duration_s: f64) -> Profile {
    let amplitude = Load::force_n(20.0, 0.0);
    let profile = Waveform::Dwell { frequency_hz: 15.0, duration_s, settle_s: 0.1 };
    Profile::new(&ExcitationSpec { amplitude, ramp_s: 0.05, profile }, f64::from(RATE_HZ)).unwrap()
}

fn dwell(duration_s: f64) -> Box<dyn Controller> {
    Box::new(OpenLoop::new(profile(duration_s), crate::rig::Converter::default()))
}

fn plant_node() -> PlantNode {
    plant_with(Timing::real_time(RATE_HZ))
}

fn plant_with(timing: Timing) -> PlantNode {
    PlantNode::new(Network::default(), RATE_HZ, timing, Exciter::default())
}

fn exciter_node(duration_s: f64) -> ExciterNode {
    carry(Network::default(), RATE_HZ, Timing::real_time(RATE_HZ), dwell(duration_s))
}

/// Both nodes and what happened to the load.
struct Bench {
    now_ns: u64,
    sample: u64,
    plant: PlantNode,
    exciter: Option<ExciterNode>,
    loads: Vec<Load>,
    plant_events: Vec<NodeEvent>,
    /// The effect of the wire on the n-th frame from the exciter: the frames that arrive instead.
    wire: fn(u64, Frame) -> Vec<Frame>,
    carried: u64,
}

fn faithful(_: u64, frame: Frame) -> Vec<Frame> {
    alloc::vec![frame]
}

impl Bench {
    fn new(duration_s: f64) -> Bench {
        Bench::with(Timing::real_time(RATE_HZ), duration_s)
    }

    fn with(timing: Timing, duration_s: f64) -> Bench {
        Bench::on([Network::default(); 2], timing, duration_s)
    }

    /// Plant and exciter, each on its own network.
    fn on([of_plant, of_exciter]: [Network; 2], timing: Timing, duration_s: f64) -> Bench {
        let mut plant = PlantNode::new(of_plant, RATE_HZ, timing, Exciter::default());
        let mut exciter = carry(of_exciter, RATE_HZ, timing, dwell(duration_s));
        plant.start(0);
        exciter.start(0);
        let (loads, plant_events) = (Vec::new(), Vec::new());
        let exciter = Some(exciter);
        Bench { now_ns: 0, sample: 0, plant, exciter, loads, plant_events, wire: faithful, carried: 0 }
    }

    /// One sample period, in the order of the real-time loop: commands in, load held, sample out.
    fn tick(&mut self) {
        self.now_ns += TICK_NS;
        self.exchange();
        self.plant.handle_deadline(self.now_ns);
        self.loads.push(self.plant.load());
        self.sample += 1;
        self.plant
            .publish(&PublishedSample::of(&Measurement { sample: self.sample, ..Measurement::default() }))
            .unwrap();
        self.exchange();
        self.plant_events.extend(core::iter::from_fn(|| self.plant.poll_event()));
    }

    fn exchange(&mut self) {
        let sent: Vec<Frame> = core::iter::from_fn(|| self.plant.poll_transmit()).collect();
        let Some(exciter) = &mut self.exciter else { return };
        for frame in &sent {
            exciter.handle_frame(self.now_ns, frame);
        }
        exciter.handle_deadline(self.now_ns);
        while let Some(frame) = exciter.poll_transmit() {
            self.carried += 1;
            for frame in (self.wire)(self.carried, frame) {
                self.plant.handle_frame(self.now_ns, &frame);
            }
        }
    }

    fn run(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| self.tick());
    }

    fn outcome(&self) -> Option<ExciterOutcome> {
        self.exciter.as_ref().and_then(ExciterNode::outcome)
    }

    fn emergencies(&self) -> Vec<EmergencyCode> {
        let code = |event: &NodeEvent| match event {
            NodeEvent::Emergency(emergency) => Some(emergency.code),
            _ => None,
        };
        self.plant_events.iter().filter_map(code).collect()
    }
}

#[test]
fn plays_a_profile_from_arming_to_disarming() {
    let mut bench = Bench::new(0.5);
    bench.run(600);
    assert_eq!(bench.outcome(), Some(ExciterOutcome::Finished));
    assert_eq!(bench.plant.state(), NodeState::PreOperational);
    let expected = profile(0.5);
    // The wire has 50 counts a newton.
    let counted = |n: u64| libm::rint(expected.load(n).force_n.x * 50.0) / 50.0;
    let seen = bench.loads.iter().map(|load| load.force_n.x).skip_while(|force| *force == 0.0);
    let wanted = (0..expected.samples()).map(counted).skip_while(|force| *force == 0.0);
    assert!(seen.zip(wanted).all(|(seen, wanted)| seen == wanted));
    assert!(bench.loads.iter().any(|load| load.force_n.x > 19.9));
    assert_eq!(bench.emergencies(), []);
}

#[test]
fn a_dead_controller_brings_the_force_to_zero_in_time_and_latches() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    assert!(bench.plant.is_armed());
    bench.exciter = None;
    let died = bench.loads.len();
    bench.run(500);
    // 20 ms without a command, 50 ms of ramp, one sample: SPEC.md.
    assert!(bench.loads[died + 71..].iter().all(|load| *load == Load::default()));
    let held = bench.loads[died].force_n.x.abs();
    assert!(held > 0.0 && bench.loads[died + 18].force_n.x.abs() == held, "held until the timeout");
    assert!(bench.loads[died + 21..].windows(2).all(|pair| pair[1].force_n.x.abs() <= pair[0].force_n.x.abs()));
    assert_eq!(
        (bench.plant.state(), bench.emergencies()),
        (NodeState::Fault, alloc::vec![EmergencyCode::CommandTimeout])
    );

    let mut second = exciter_node(0.3);
    second.start(bench.now_ns);
    bench.exciter = Some(second);
    bench.run(600);
    assert_eq!(bench.outcome(), Some(ExciterOutcome::Finished));
    assert!(bench.loads[died + 500..].iter().any(|load| load.force_n.x.abs() > 15.0));
}

#[test]
fn a_controller_that_lost_the_plant_faults() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    let exciter = bench.exciter.as_mut().unwrap();
    // A controller waits for 350 ms for a sample (`HEARTBEAT_TIMEOUT_NS`). One tick more is beyond that for certain.
    for tick in 1..=351 {
        exciter.handle_deadline(bench.now_ns + tick * TICK_NS);
        while exciter.poll_transmit().is_some() {}
    }
    let Some(ExciterOutcome::Faulted(emergency)) = exciter.outcome() else { panic!("{:?}", exciter.outcome()) };
    assert_eq!((emergency.node, emergency.code), (NodeName::Exciter, EmergencyCode::SensorTimeout));
}

#[test]
fn lost_repeated_and_corrupt_commands_do_no_harm() {
    fn bad(n: u64, frame: Frame) -> Vec<Frame> {
        let mut corrupt = frame.data().to_vec();
        if let Some(byte) = corrupt.last_mut() {
            *byte ^= 0x10;
        }
        // Of seven frames one is lost, one comes twice, and one has a wrong bit in its last byte.
        match n % 7 {
            3 => Vec::new(),
            4 => alloc::vec![frame, frame],
            5 => alloc::vec![Frame::classic(frame.id(), &corrupt).unwrap()],
            _ => alloc::vec![frame],
        }
    }
    let mut bench = Bench::new(1.0);
    bench.run(20);
    bench.wire = bad;
    bench.run(1500);
    assert_eq!(bench.outcome(), Some(ExciterOutcome::Finished));
    assert!(bench.plant.frames().refused > 200 && bench.plant.lost_frames() > 100);
    assert!(bench.loads.iter().all(|load| load.force_n.x.abs() <= 20.0));
    assert_eq!(bench.emergencies(), []);
}

/// An armed plant and a transmitter in place of the controller.
fn armed() -> (PlantNode, Transmitter) {
    armed_with(Timing::real_time(RATE_HZ))
}

fn armed_with(timing: Timing) -> (PlantNode, Transmitter) {
    let (mut plant, mut transmitter) = (plant_with(timing), Transmitter::new(Network::default()));
    plant.start(0);
    let hello = Message::ExciterHello(Hello::new(WireProfile::Classic, RATE_HZ));
    let arm = Message::Operator(OperatorCommand { request: OperatorRequest::Arm, target: NodeName::Plant });
    for message in [hello, arm] {
        plant.handle_frame(0, &transmitter.frame(&message).unwrap());
    }
    // An index that needs more than 16 bits: frames carry 70000 − 65536 = 4464.
    plant.publish(&PublishedSample::of(&Measurement { sample: 70_000, ..Measurement::default() })).unwrap();
    assert!(plant.is_armed());
    (plant, transmitter)
}

#[test]
fn the_gate_refuses_by_name() {
    let (mut plant, mut transmitter) = armed();
    let now = 70_000_u64 as u16;
    let mut send = |plant: &mut PlantNode, force_x_n, sample| {
        while plant.poll_event().is_some() {}
        let message = Message::Force(ForceCommand { force_x_n, force_y_n: 0.0, sample });
        plant.handle_frame(0, &transmitter.frame(&message).unwrap());
        plant.poll_event()
    };
    let refused = |refusal| Some(NodeEvent::Refused(refusal));
    assert_eq!(send(&mut plant, 5.0, now.wrapping_sub(3)), None);
    assert_eq!(send(&mut plant, 6.0, now.wrapping_sub(4)), refused(Refusal::OutOfOrder));
    // Commands are valid for 20 ms, which are 20 samples at this rate.
    assert_eq!(send(&mut plant, 6.0, now.wrapping_sub(21)), refused(Refusal::Late));
    assert_eq!(send(&mut plant, 6.0, now.wrapping_add(1)), refused(Refusal::Late));
    // The exciter has a limit of 600 N, and 0.02 N is one count of the frame.
    assert_eq!(send(&mut plant, 600.02, now), refused(Refusal::OutOfRange));
    assert_eq!((plant.load(), plant.is_answered()), (Load::force_n(5.0, 0.0), false));
    assert_eq!(send(&mut plant, 600.0, now), None);
    assert_eq!((plant.load(), plant.is_answered()), (Load::force_n(600.0, 0.0), true));
}

#[test]
fn nodes_that_do_not_fit_never_arm() {
    let mut plant = plant_node();
    plant.start(0);
    let mut exciter = carry(Network::default(), 2000, Timing::real_time(RATE_HZ), dwell(0.5));
    exciter.start(0);
    while let Some(frame) = plant.poll_transmit() {
        exciter.handle_frame(0, &frame);
    }
    let Some(ExciterOutcome::Faulted(emergency)) = exciter.outcome() else { panic!("{:?}", exciter.outcome()) };
    // 4 is the number of a mismatch of the rates.
    assert_eq!((emergency.code, emergency.detail), (EmergencyCode::Incompatible, 4));

    let mut transmitter = Transmitter::new(Network::default());
    let hello = Message::ExciterHello(Hello::new(WireProfile::Classic, 2000));
    let arm = Message::Operator(OperatorCommand { request: OperatorRequest::Arm, target: NodeName::Plant });
    // Neither before the hello nor behind it: first the plant does not know its partner, then it knows that the rates
    // differ.
    for message in [arm, hello, arm] {
        plant.handle_frame(0, &transmitter.frame(&message).unwrap());
        assert_eq!(plant.state(), NodeState::PreOperational);
    }
}

proptest! {
    /// Whatever the frames on the bus, an unarmed plant holds no load, and an armed one none beyond the exciter's
    /// limits.
    #[test]
    fn no_frames_get_past_the_gate(
        frames in prop::collection::vec((0x200_u16..0x208, prop::collection::vec(any::<u8>(), 0..=8)), 0..200),
    ) {
        let (mut unarmed, (mut armed, _)) = (plant_node(), armed());
        unarmed.start(0);
        for (id, data) in frames {
            let frame = Frame::classic(resonarm_protocol::Id::Standard(id), &data).unwrap();
            unarmed.handle_frame(1, &frame);
            armed.handle_frame(1, &frame);
            prop_assert!(unarmed.is_armed() || unarmed.load() == Load::default());
            prop_assert!(Exciter::default().can_produce(&armed.load()));
        }
    }
}
