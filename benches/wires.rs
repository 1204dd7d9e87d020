//! Cost of a frame of a user's own protocol, received and sent, with counter and checksum: `cargo bench --bench wires`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use resonarm::node::mapped::mapping::Mapping;
use resonarm::node::{PlantInterface, PublishedSample, TimeBase, Timing, WireSpec};
use resonarm::protocol::{Frame, FrameFormat};
use resonarm::rig::{Exciter, GateSpec, Measurement};
use resonarm::scenario::Scenario;
use resonarm::structure::States;

/// As many as the counter has values.
const FRAMES: usize = 15;

fn main() {
    divan::main();
}

fn mapping() -> Option<Mapping> {
    let mut scenario = Scenario::parse(include_str!("../examples/own-protocol/bench.toml"), "bench.toml").ok()?;
    scenario.wire.as_mut()?.text = Some(include_str!("../examples/own-protocol/bench.dbc").to_string());
    match scenario.wire_spec().ok()?? {
        WireSpec::Mapped(mapping) => Some(mapping),
        WireSpec::Cia402(_) => None,
    }
}

fn node(mapping: &Mapping) -> Box<dyn PlantInterface> {
    let (exciter, limits) = (Exciter::default(), GateSpec::default());
    WireSpec::Mapped(mapping.clone()).node((1000, TimeBase::Clock), Timing::real_time(1000), exciter, limits)
}

/// Frames of the command message, one for each value of its counter.
fn commands(mapping: &Mapping) -> Option<Vec<Frame>> {
    let drive = mapping.incoming.first()?;
    let (counter, checksum) = (drive.protection.counter.as_ref()?, drive.protection.checksum.as_ref()?);
    let frame = |value: usize| {
        let mut payload = [100, 0, 1, 0, 0, 0, 0, 0];
        counter.write(value as u64, &mut payload).ok()?;
        checksum.write(drive.id, &mut payload).ok()?;
        Frame::new(drive.id, FrameFormat::Classic, &payload).ok()
    };
    (0..FRAMES).map(frame).collect()
}

/// Command frames with counter, checksum and two requests, each checked and taken in.
#[divan::bench]
fn received(bencher: Bencher) {
    let Some(mapping) = mapping() else { return };
    let Some(frames) = commands(&mapping) else { return };
    let mut node = node(&mapping);
    node.start(0);
    bencher.counter(ItemsCount::new(FRAMES)).bench_local(|| {
        black_box(&frames).iter().for_each(|frame| node.handle_frame(0, frame));
    });
}

/// Frames of five signals with counter and checksum, one a sample, and every tenth sample one of four floats.
#[divan::bench]
fn sent(bencher: Bencher) {
    let Some(mapping) = mapping() else { return };
    let mut node = node(&mapping);
    node.start(0);
    let (mut sample, mut frames) = (0, Vec::with_capacity(2));
    // Ten samples are ten frames of signals and one of floats.
    bencher.counter(ItemsCount::new(11_usize)).bench_local(|| {
        for _ in 0..10 {
            let measurement = Measurement { sample, ..Measurement::default() };
            let published = PublishedSample {
                measurement: &measurement,
                states: &States::written(4, 4, |numbers| numbers.fill(1e-6)),
                travel_m: None,
            };
            node.publish(black_box(&published)).ok();
            frames.clear();
            node.waiting_frames(2, &mut frames);
            black_box(&frames).iter().for_each(|_| node.frame_sent());
            sample += 1;
        }
    });
}
