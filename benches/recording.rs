//! Samples a second written to a recording, read from it, and simulated again: `cargo bench --bench recording`.
//!
//! A sample is that of the bench of `scenarios/bench.toml`: a state, readings, four classic frames.

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
use resonarm::rig::{Load, Readings};
use resonarm::run::{self, Mode, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;
use resonarm::structure::{LoadSet, States};

const RATE_HZ: f64 = 1000.0;
const SAMPLES: u64 = 50_000;

fn main() {
    divan::main();
}

/// State and readings of a sample: a decaying sine, so that the bits are those of a motion.
fn motion(sample: u64) -> [Record; 2] {
    let t = sample as f64 / RATE_HZ;
    // 139 rad/s are 22.1 Hz, the first mode of the fitted arm.
    let x = libm::exp(-0.01 * t) * libm::sin(139.0 * t);
    let pair = |scale: f64| [scale * x, -0.3 * scale * x];
    // Rounded as a converter rounds: readings compress better than the numbers of a sine.
    let reading = |scale: f64| pair(scale).map(|value| libm::round(value * 100.0) / 100.0);
    let moving = [pair(1e-3), pair(0.1)].concat();
    let state = StateRecord {
        sample,
        states: States::written(4, 4, |numbers| numbers.copy_from_slice(&moving)),
        load: Load::planar([0.0; 2], reading(80.0)),
        taken: LoadSet::NATIVE,
        is_end: false,
    };
    let readings = SampleRecord {
        sample,
        acceleration_b_m_s2: reading(9.0),
        acceleration_c_m_s2: reading(24.0),
        head_force_n: reading(80.0),
        clipped: Clipped::NONE,
        more: Readings::NONE,
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
        // A factor near 2³² over the golden ratio changes many bits from frame to frame, and the mask leaves two bytes
        // constant, as slow signals do.
        let data = (sample.wrapping_mul(0x9E37_79B9) & 0xFFFF_00FF_FF00_FFFF).to_le_bytes();
        let frame = Frame::classic(Id::Standard(id), &data).ok()?;
        records.push(Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns: None, frame }));
    }
    Some(records)
}

fn record(path: &Path, options: &Options, records: &[Record]) -> Result<u64, Box<dyn Error>> {
    let recorder = Recorder::create(path, &Configuration::new(), options.clone())?;
    let mut channel = recorder.channel("bench", 1 << 15)?;
    records.iter().try_for_each(|record| channel.push_blocking(record))?;
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

/// All records of a run, compressed.
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

/// A recording of everything, with its temporary folder.
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

/// The peer: the same records by the crate `mcap` from memory, decoded by `prost` from the same schemas and split into
/// records as `docs/recording.md` does it in Python.
#[divan::bench]
fn read_by_mcap(bencher: Bencher) {
    let Some((_folder, path)) = recorded() else { return };
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| by_mcap(&path, Unit::Records).map(black_box).ok());
}

/// The same up to messages: columns, not split.
#[divan::bench]
fn messages_by_mcap(bencher: Bencher) {
    let Some((_folder, path)) = recorded() else { return };
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| by_mcap(&path, Unit::Messages).map(black_box).ok());
}

#[allow(missing_docs, dead_code, clippy::doc_markdown)]
mod proto {
    include!(concat!(env!("CARGO_MANIFEST_DIR"), "/proto/resonarm.v1.rs"));
}

/// States and loads, as far as the peer reads them, with the field numbers of `docs/recording.md`.
#[derive(Clone, PartialEq, Message)]
struct StepBatch {
    #[prost(double, repeated, tag = "4")]
    alpha1_rad: Vec<f64>,
    #[prost(double, repeated, tag = "5")]
    alpha2_rad: Vec<f64>,
    #[prost(double, repeated, tag = "6")]
    alpha1_dot_rad_s: Vec<f64>,
    #[prost(double, repeated, tag = "7")]
    alpha2_dot_rad_s: Vec<f64>,
    #[prost(double, repeated, tag = "8")]
    torque1_nm: Vec<f64>,
    #[prost(double, repeated, tag = "9")]
    torque2_nm: Vec<f64>,
    #[prost(double, repeated, tag = "10")]
    force_x_n: Vec<f64>,
    #[prost(double, repeated, tag = "11")]
    force_y_n: Vec<f64>,
}

/// Readings likewise.
#[derive(Clone, PartialEq, Message)]
struct SampleBatch {
    #[prost(uint32, repeated, tag = "3")]
    clipped: Vec<u32>,
    #[prost(double, repeated, tag = "4")]
    acceleration_b_x_m_s2: Vec<f64>,
    #[prost(double, repeated, tag = "5")]
    acceleration_b_y_m_s2: Vec<f64>,
    #[prost(double, repeated, tag = "6")]
    acceleration_c_x_m_s2: Vec<f64>,
    #[prost(double, repeated, tag = "7")]
    acceleration_c_y_m_s2: Vec<f64>,
    #[prost(double, repeated, tag = "8")]
    head_force_x_n: Vec<f64>,
    #[prost(double, repeated, tag = "9")]
    head_force_y_n: Vec<f64>,
}

/// The peer's result.
#[derive(Clone, Copy, PartialEq)]
enum Unit {
    Messages,
    Records,
}

fn by_mcap(path: &Path, unit: Unit) -> Result<usize, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let mut count = 0;
    for message in mcap::MessageStream::new(&bytes)? {
        let message = message?;
        match message.channel.topic.as_str() {
            "/plant/steps" => {
                let batch = black_box(StepBatch::decode(&*message.data)?);
                let columns = [&batch.alpha1_rad, &batch.alpha2_rad, &batch.alpha1_dot_rad_s, &batch.alpha2_dot_rad_s];
                let loads = [&batch.torque1_nm, &batch.torque2_nm, &batch.force_x_n, &batch.force_y_n];
                count += rows(unit, columns) + rows(unit, loads);
            }
            "/plant/samples" => {
                let batch = black_box(SampleBatch::decode(&*message.data)?);
                let b = [&batch.acceleration_b_x_m_s2, &batch.acceleration_b_y_m_s2];
                let c = [&batch.acceleration_c_x_m_s2, &batch.acceleration_c_y_m_s2];
                count += rows(unit, b) + rows(unit, c) + rows(unit, [&batch.head_force_x_n, &batch.head_force_y_n]);
            }
            "/can/frames" => {
                let batch = black_box(proto::FrameBatch::decode(&*message.data)?);
                count += if unit == Unit::Records { frames(&batch) } else { batch.id.len() };
            }
            _ => {}
        }
    }
    Ok(count)
}

/// The values of each sample side by side.
fn rows<const N: usize>(unit: Unit, columns: [&Vec<f64>; N]) -> usize {
    let count = columns[0].len();
    if unit == Unit::Records {
        (0..count).for_each(|row| {
            black_box(columns.map(|column| column[row]));
        });
    }
    count
}

/// Sample, time, identifier and payload of each frame.
fn frames(batch: &proto::FrameBatch) -> usize {
    let mut payloads: Vec<Vec<u8>> = vec![Vec::new(); batch.id.len()];
    let mut data = batch.data.iter();
    let mut rows: Vec<usize> = (0..batch.id.len()).collect();
    // The payloads are stored by identifier and then by their places, so that equal bytes lie side by side.
    rows.sort_by_key(|row| batch.id[*row]);
    for rows in rows.chunk_by(|one, other| batch.id[*one] == batch.id[*other]) {
        let longest = rows.iter().map(|row| batch.length[*row]).max().unwrap_or(0);
        for place in 0..longest {
            for row in rows.iter().filter(|row| place < batch.length[**row]) {
                payloads[*row].extend(data.next());
            }
        }
    }
    let (mut sample, mut time_ns) = (0, 0);
    for (row, payload) in payloads.into_iter().enumerate() {
        sample += batch.step_difference[row];
        time_ns += batch.time_difference_ns[row];
        drop(black_box((sample, time_ns, batch.direction[row], batch.id[row], payload)));
    }
    batch.id.len()
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
    Session::new(scenario, Mode::Free, options).ok()?.both(&Signals::default(), &mut |_| {}).ok()?;
    let simulated_s = Recording::open(&path).ok()?.summary().duration_s as u64;
    Some((folder, path, simulated_s))
}
