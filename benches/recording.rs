//! Samples a second into a recording and out of it, and simulated again: `cargo bench --bench recording`.
//!
//! A sample is what the bench of `scenarios/bench.toml` makes: a state, readings, four classic frames.

use std::error::Error;
use std::path::Path;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use prost::Message;
use resonarm::protocol::{Frame, Id};
use resonarm::recording::{
    Clipped, Compression, Configuration, Direction, Existing, FrameRecord, Options, Record, Recorder, Recording,
    SampleRecord, StateRecord,
};
use resonarm::replay::resimulate;
use resonarm::run::{self, Mode, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;

const RATE_HZ: f64 = 1000.0;
const SAMPLES: u64 = 50_000;

fn main() {
    divan::main();
}

/// State and readings of a sample: a decaying sine, so that the bits are those of a motion.
fn motion(sample: u64) -> [Record; 2] {
    let t = sample as f64 / RATE_HZ;
    let x = libm::exp(-0.01 * t) * libm::sin(139.0 * t);
    let pair = |scale: f64| [scale * x, -0.3 * scale * x];
    let reading = |scale: f64| pair(scale).map(|value| libm::round(value * 100.0) / 100.0);
    let state = StateRecord {
        sample,
        alpha_rad: pair(1e-3),
        alpha_dot_rad_s: pair(0.1),
        torque_nm: [0.0; 2],
        force_n: reading(80.0),
        is_end: false,
    };
    let readings = SampleRecord {
        sample,
        acceleration_b_m_s2: reading(9.0),
        acceleration_c_m_s2: reading(24.0),
        head_force_n: reading(80.0),
        clipped: Some(Clipped::NONE),
    };
    [Record::State(state), Record::Sample(readings)]
}

/// The same with four frames.
fn everything(sample: u64) -> Option<Vec<Record>> {
    let mut records = motion(sample).to_vec();
    let time_ns = sample * 1_000_000;
    for (id, direction) in
        [0x203, 0x204, 0x205].map(|id| (id, Direction::Sent)).into_iter().chain([(0x201, Direction::Received)])
    {
        let data = (sample.wrapping_mul(0x9E37_79B9) & 0xFFFF_00FF_FF00_FFFF).to_le_bytes();
        let frame = Frame::classic(Id::Standard(id), &data).ok()?;
        records.push(Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns: None, frame }));
    }
    Some(records)
}

fn record(path: &Path, options: &Options, records: &[Record]) -> Result<u64, Box<dyn Error>> {
    let recorder = Recorder::create(path, &Configuration::new(), options.clone())?;
    let mut channel = recorder.channel("bench", 1 << 15)?;
    records.iter().try_for_each(|record| channel.push_blocking(*record))?;
    Ok(recorder.finish(&[])?.bytes)
}

fn options() -> Options {
    Options { existing: Existing::Overwrite, ..Options::virtual_time(1.0 / RATE_HZ, "bench") }
}

/// Into batches alone: states and readings, nothing compressed, nothing for plotting.
#[divan::bench]
fn write_batches(bencher: Bencher) {
    let records: Vec<_> = (0..SAMPLES).flat_map(motion).collect();
    let options = Options { compression: Compression::None, plot_every_samples: 0, ..options() };
    write(bencher, &options, &records);
}

/// Everything that a run records, compressed.
#[divan::bench]
fn write_everything(bencher: Bencher) {
    let records: Vec<_> = (0..SAMPLES).filter_map(everything).flatten().collect();
    write(bencher, &options(), &records);
}

fn write(bencher: Bencher, options: &Options, records: &[Record]) {
    let Ok(folder) = tempfile::tempdir() else { return };
    let path = folder.path().join("run.mcap");
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| record(&path, options, black_box(records)));
}

/// A recording of everything, in a folder that goes with it.
fn recorded() -> Option<(tempfile::TempDir, std::path::PathBuf)> {
    let folder = tempfile::tempdir().ok()?;
    let path = folder.path().join("run.mcap");
    let records: Vec<_> = (0..SAMPLES).filter_map(everything).flatten().collect();
    record(&path, &options(), &records).ok()?;
    Some((folder, path))
}

/// The first pass, in which every checksum is compared.
#[divan::bench]
fn open(bencher: Bencher) {
    let Some((_folder, path)) = recorded() else { return };
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| Recording::open(&path).map(|it| it.summary().file_bytes));
}

/// Every record of an opened recording.
#[divan::bench]
fn read(bencher: Bencher) {
    let Some((_folder, path)) = recorded() else { return };
    let Ok(recording) = Recording::open(&path) else { return };
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| recording.records().map(|records| black_box(records.count())));
}

/// The peer: the same messages by the crate `mcap` from memory, and decoded by `prost` from the same schemas.
#[divan::bench]
fn read_by_mcap(bencher: Bencher) {
    let Some((_folder, path)) = recorded() else { return };
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| by_mcap(&path).map(black_box).ok());
}

#[allow(missing_docs, dead_code, clippy::doc_markdown)]
mod proto {
    include!(concat!(env!("CARGO_MANIFEST_DIR"), "/proto/resonarm.v1.rs"));
}

fn by_mcap(path: &Path) -> Result<usize, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let mut values = 0;
    for message in mcap::MessageStream::new(&bytes)? {
        let message = message?;
        values += match message.channel.topic.as_str() {
            "/plant/steps" => black_box(proto::StepBatch::decode(&*message.data)?).alpha1_rad.len(),
            "/plant/samples" => black_box(proto::SampleBatch::decode(&*message.data)?).clipped.len(),
            "/can/frames" => black_box(proto::FrameBatch::decode(&*message.data)?).id.len(),
            _ => 0,
        };
    }
    Ok(values)
}

/// The default bench simulated again, opening included; items are simulated seconds.
#[divan::bench]
fn resim(bencher: Bencher) {
    let Some((_folder, path, simulated_s)) = bench_run() else { return };
    bencher.counter(ItemsCount::new(simulated_s)).bench_local(|| {
        let recording = Recording::open(&path).ok()?;
        resimulate(&recording).ok().map(|verdict| assert!(verdict.identical))
    });
}

fn bench_run() -> Option<(tempfile::TempDir, std::path::PathBuf, u64)> {
    let folder = tempfile::tempdir().ok()?;
    let path = folder.path().join("bench.mcap");
    let scenario = Scenario::parse(include_str!("../scenarios/bench.toml"), "bench.toml").ok()?;
    let record = Some(RecordTo { path: path.clone(), existing: Existing::Refuse });
    let options = run::Options { record, ..Default::default() };
    Session::new(scenario, Mode::Free, options).ok()?.both(&Signals::default(), |_| {}).ok()?;
    let simulated_s = Recording::open(&path).ok()?.summary().duration_s as u64;
    Some((folder, path, simulated_s))
}
