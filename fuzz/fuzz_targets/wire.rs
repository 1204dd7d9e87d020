//! Any frames on each wire of a user's own: no load acts beyond the limits, none on a plant that is not armed, and none
//! that was not freshly commanded.
#![no_main]

use libfuzzer_sys::fuzz_target;
use resonarm::node::{PlantInterface, PublishedSample, TimeBase, Timing};
use resonarm::protocol::{Frame, FrameFormat, Id, NodeState};
use resonarm::rig::{Exciter, GateSpec, Measurement};
use resonarm::scenario::Scenario;
use resonarm::structure::States;

const DBC: &str = include_str!("../../examples/own-protocol/bench.dbc");
const SCENARIOS: [&str; 3] = [
    include_str!("../../examples/own-protocol/bench.toml"),
    "wire = { preset = 'odrive', drives = [{ node_id = 0, joint = 1 }, { node_id = 1, joint = 2 }] }",
    include_str!("../../examples/canopen/drives.toml"),
];

/// The identifiers of frames that command loads, of each scenario. A master maps the PDOs of its drives as it likes.
fn can_command(scenario: usize, id: u16) -> bool {
    match scenario {
        0 => id == 0x100,
        // Set_Input_Torque of ODrive: the lower five bits are the command, those above it the node.
        1 => id & 0x1F == 0x0E,
        // All but NMT, SYNC and the requests of SDO, which configure and time a drive.
        _ => !matches!(id, 0x000 | 0x080 | 0x600..=0x67F),
    }
}

/// The angles of the arm's joints and their rates, at rest.
fn at_rest() -> States {
    States::written(4, 4, |numbers| numbers.fill(0.0))
}

/// A copy of the node that only gets what answers samples, and no command: whether a load begins to act.
fn acts_by_itself(node: &dyn PlantInterface, mut now_ns: u64, mut sample: u64) -> bool {
    let mut twin = node.boxed_clone();
    (0..4).any(|_| {
        now_ns += 1_000_000;
        sample += 1;
        // SYNC of CANopen, at which drives take over what their PDOs have brought.
        twin.handle_frame(now_ns, &Frame::classic(Id::Standard(0x080), &[]).expect("a frame"));
        twin.handle_deadline(now_ns);
        let (load, is_ramping) = (twin.load(), twin.is_ramping());
        let measurement = Measurement { sample, ..Measurement::default() };
        let published = PublishedSample { measurement: &measurement, states: &at_rest(), travel_m: 0.0 };
        twin.publish(&published).expect("a sample of numbers");
        twin.is_armed() && !is_ramping && load != Default::default()
    })
}

// Ten bytes a frame: the low byte of the identifier, its high bits with the format, the data; each ends a sample if
// its last byte is odd.
fuzz_target!(|input: &[u8]| {
    let Some((&first, frames)) = input.split_first() else { return };
    let kind = usize::from(first) % 3;
    let mut scenario = Scenario::parse(SCENARIOS[kind], "fuzz").expect("a scenario");
    if let Some(wire) = &mut scenario.wire {
        wire.text = Some(DBC.to_string());
    }
    let wire = scenario.wire_spec().expect("a wire").expect("a wire");
    let exciter = Exciter::default();
    let time_base = if first & 0x80 == 0 { TimeBase::Clock } else { TimeBase::Lockstep };
    let mut node = wire.node((1000, time_base), Timing::real_time(1000), exciter, GateSpec::default());
    node.start(0);
    let (mut now_ns, mut sample, mut sent) = (0, 0, Vec::with_capacity(64));
    for chunk in frames.chunks_exact(10) {
        let id = Id::Standard(u16::from(chunk[1] & 7) << 8 | u16::from(chunk[0]));
        let is_fd = chunk[1] & 0x88 == 0x88;
        let format = match chunk[1] & 0x80 {
            0 => FrameFormat::Classic,
            _ if is_fd => FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false },
            _ => FrameFormat::Remote,
        };
        let length = usize::from(8 - (chunk[1] >> 4 & 7));
        let (arms, before) = (node.core().arms(), node.frames().refused);
        node.handle_frame(now_ns, &Frame::new(id, format, &chunk[2..2 + length]).expect("a frame"));
        // What arms and commands nothing lets nothing act that came before.
        let Id::Standard(number) = id else { continue };
        let is_newly_armed = node.core().arms() > arms && node.is_armed() && !node.is_ramping();
        if is_newly_armed && !can_command(kind, number) {
            assert!(!acts_by_itself(&*node, now_ns, sample), "a load of before the arming acts");
        }
        assert!(!is_fd || node.core().arms() == arms, "a CAN FD frame armed the plant");
        assert!(node.frames().refused >= before);
        if chunk[9] & 1 == 0 {
            continue;
        }
        now_ns += 1_000_000;
        node.handle_deadline(now_ns);
        let load = node.load();
        assert!(exciter.can_produce(&load), "{load:?}");
        let is_idle = node.state() != NodeState::Operational && !node.is_ramping();
        assert!(!is_idle || exciter.size(&load) == (0.0, 0.0), "{load:?} while {:?}", node.state());
        let measurement = Measurement { sample, ..Measurement::default() };
        let published = PublishedSample { measurement: &measurement, states: &at_rest(), travel_m: 0.0 };
        node.publish(&published).expect("a sample of numbers");
        sample += 1;
        sent.clear();
        node.waiting_frames(64, &mut sent);
        sent.iter().for_each(|_| node.frame_sent());
        while node.poll_event().is_some() {}
    }
});
