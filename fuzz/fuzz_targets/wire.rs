//! Any frames on each wire of a user's own: no load acts beyond the limits, and none on a plant that is not armed.
#![no_main]

use libfuzzer_sys::fuzz_target;
use resonarm::node::{PublishedSample, TimeBase, Timing};
use resonarm::protocol::{Frame, FrameFormat, Id, NodeState};
use resonarm::rig::{Exciter, GateSpec, Measurement};
use resonarm::scenario::Scenario;

const DBC: &str = include_str!("../../examples/own-protocol/bench.dbc");
const SCENARIOS: [&str; 3] = [
    include_str!("../../examples/own-protocol/bench.toml"),
    "wire = { preset = 'odrive', drives = [{ node_id = 0, joint = 1 }, { node_id = 1, joint = 2 }] }",
    include_str!("../../examples/canopen/drives.toml"),
];

// Ten bytes a frame: the low byte of the identifier, its high bits with the format, the data; each ends a sample if
// its last byte is odd.
fuzz_target!(|input: &[u8]| {
    let Some((&first, frames)) = input.split_first() else { return };
    let mut scenario = Scenario::parse(SCENARIOS[usize::from(first) % 3], "fuzz").expect("a scenario");
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
        let format = if chunk[1] & 0x80 == 0 { FrameFormat::Classic } else { FrameFormat::Remote };
        let length = usize::from(8 - (chunk[1] >> 4 & 7));
        node.handle_frame(now_ns, &Frame::new(id, format, &chunk[2..2 + length]).expect("a frame"));
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
        let published = PublishedSample { measurement: &measurement, states: &[0.0; 4], travel_m: 0.0 };
        node.publish(&published).expect("a sample of numbers");
        sample += 1;
        sent.clear();
        node.waiting_frames(64, &mut sent);
        sent.iter().for_each(|_| node.frame_sent());
        while node.poll_event().is_some() {}
    }
});
