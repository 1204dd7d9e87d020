//! The nodes of users' own protocols, of the plant and of the exciter, take no memory once they are made.

use assert_no_alloc::assert_no_alloc;

use resonarm::node::{ExciterInterface, PlantInterface, PublishedSample, TimeBase, Timing};
use resonarm::protocol::{Frame, FrameFormat, Id};
use resonarm::rig::{Exciter, GateSpec, Measurement};
use resonarm::scenario::Scenario;
use resonarm::structure::States;

/// A node of the wire of this scenario, without counters and checksums.
fn node(text: &str) -> Box<dyn PlantInterface> {
    let mut scenario = Scenario::parse(text, "test.toml").unwrap();
    if let Some(wire) = &mut scenario.wire {
        wire.text = Some(include_str!("../../examples/own-protocol/bench.dbc").to_string());
    }
    let wire = scenario.wire_spec().unwrap().unwrap();
    let mut node = wire.node((1000, TimeBase::Clock), Timing::real_time(1000), Exciter::default(), GateSpec::default());
    node.start(0);
    node
}

/// A thousand samples with these frames in each; how many frames were sent.
fn run(node: &mut dyn PlantInterface, frames: &[Frame]) -> usize {
    let (mut sent, mut batch) = (0, Vec::with_capacity(64));
    assert_no_alloc(|| {
        for sample in 0..1000 {
            let now_ns = 1_000_000 * sample;
            frames.iter().for_each(|frame| node.handle_frame(now_ns, frame));
            node.handle_deadline(now_ns);
            node.load();
            let measurement = Measurement { sample, ..Measurement::default() };
            let published = PublishedSample {
                measurement: &measurement,
                states: &States::new(&[1e-6; 4], &[]).unwrap(),
                travel_m: None,
            };
            node.publish(&published).unwrap();
            batch.clear();
            node.waiting_frames(64, &mut batch);
            batch.iter().for_each(|_| node.frame_sent());
            sent += batch.len();
            while node.poll_event().is_some() {}
        }
    });
    sent
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(Id::Standard(id), FrameFormat::Classic, data).unwrap()
}

#[test]
fn a_mapped_node_takes_no_memory() {
    let mut node = node(include_str!("../../examples/own-protocol/bench.toml"));
    let refused = frame(0x100, &[1; 8]);
    assert_eq!(run(&mut *node, &[refused, frame(0x200, &[0; 8])]), 1100);
    assert_eq!(node.frames().refused, 1000);
}

#[test]
fn drives_take_no_memory() {
    let mut node = node("wire = { preset = 'odrive', drives = [{ node_id = 0, joint = 1 }] }");
    let mode = frame(0x0B, &[1, 0, 0, 0, 1, 0, 0, 0]);
    let torque = frame(0x0E, &1.0_f32.to_le_bytes());
    run(&mut *node, &[mode, frame(0x07, &[8, 0, 0, 0]), torque]);
    assert!(node.is_armed());
    let mut node = crate::wires_alloc::node(include_str!("../../examples/canopen/drives.toml"));
    let (start, sync) = (frame(0, &[1, 0]), frame(0x80, &[]));
    let upload = frame(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    let target = frame(0x201, &[0x0F, 0, 10, 0]);
    assert!(run(&mut *node, &[start, upload, target, sync]) > 1000);
}

/// The exciter of the wire of this scenario, with its excitation.
fn exciter(text: &str, excitation: &str) -> Box<dyn ExciterInterface> {
    let mut scenario = Scenario::parse(&format!("{text}\n{excitation}"), "test.toml").unwrap();
    if let Some(wire) = &mut scenario.wire {
        wire.text = Some(include_str!("../../examples/own-protocol/bench.dbc").to_string());
    }
    let wire = scenario.wire_spec().unwrap().unwrap();
    let controller = scenario.controller().unwrap();
    wire.exciter((1000, TimeBase::Clock), Timing::real_time(1000), controller).unwrap()
}

/// Five hundred samples of both ends in virtual time; how many the exciter answered.
fn run_both(plant: &mut dyn PlantInterface, exciter: &mut dyn ExciterInterface) -> u64 {
    let mut batch = Vec::with_capacity(64);
    exciter.start(0);
    assert_no_alloc(|| {
        for sample in 0..500 {
            let now_ns = 1_000_000 * sample;
            let measurement = Measurement { sample, ..Measurement::default() };
            let published = PublishedSample {
                measurement: &measurement,
                states: &States::new(&[1e-6; 4], &[]).unwrap(),
                travel_m: None,
            };
            plant.publish(&published).unwrap();
            for _ in 0..4 {
                plant.handle_deadline(now_ns);
                exciter.handle_deadline(now_ns);
                batch.clear();
                plant.waiting_frames(64, &mut batch);
                batch.iter().for_each(|_| plant.frame_sent());
                batch.iter().for_each(|frame| exciter.handle_frame(now_ns, frame));
                while let Some(frame) = exciter.next_frame() {
                    exciter.frame_sent();
                    plant.handle_frame(now_ns, &frame);
                }
            }
            plant.load();
            while plant.poll_event().is_some() || exciter.poll_event().is_some() {}
            while exciter.carried_mut().poll_answer().is_some() {}
        }
    });
    exciter.samples_played()
}

#[test]
fn exciters_take_no_memory() {
    let sine = |load: &str| {
        format!(
            "[excitation]\namplitude = {{ {load} }}\nprofile = {{ waveform = 'dwell', frequency_hz = 20, duration_s = 9, settle_s = 8 }}"
        )
    };
    for (text, load) in [
        (include_str!("../../examples/own-protocol/bench.toml"), "exciter_x = 5"),
        (include_str!("../../examples/odrive/drives.toml"), "joint1 = 5"),
        (include_str!("../../examples/canopen/drives.toml"), "joint2 = 5"),
    ] {
        let answered = run_both(&mut *node(text), &mut *exciter(text, &sine(load)));
        assert!(answered > 300, "{answered} {text}");
    }
}
