//! Records a decaying vibration and reads it back.
//!
//! `cargo run --example recording -- out.mcap [samples]` writes `out.mcap` and prints its summary as one JSON document.

use std::env;
use std::error::Error;
use std::io::Write;

use resonarm::protocol::{Frame, Id};
use resonarm::recording::{
    Clipped, Configuration, Direction, Event, Existing, FrameRecord, Options, Record, Recorder, Recording,
    SampleRecord, StateRecord, TickRecord,
};
use resonarm::rig::{Load, Readings};
use resonarm::structure::{LoadSet, States};

/// Time from one sample to the next, s.
const DT_S: f64 = 1e-3;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args().skip(1);
    let path = arguments.next().ok_or("usage: recording FILE [SAMPLES]")?;
    let samples: u64 = arguments.next().map_or(Ok(1000), |samples| samples.parse())?;

    let configuration = Configuration::new().with("scenario", "frequency_hz = 30\n").with("seed", 1);
    let options = Options { existing: Existing::Overwrite, ..Options::virtual_time(DT_S, "memory") };
    let recorder = Recorder::create(&path, &configuration, options)?;
    let mut channel = recorder.channel("plant", 8192)?;
    for sample in 0..samples {
        records(sample)?.into_iter().try_for_each(|record| channel.push_blocking(&record))?;
    }
    let time_ns = samples * 1_000_000;
    channel.push_blocking(&Record::Event(Event { sample: samples, time_ns, name: "run.end", value: -1 }))?;
    recorder.finish(&[("overruns", "0".to_string())])?;

    let recording = Recording::open(&path)?;
    let peak_rad = recording
        .states()?
        .try_fold(0.0_f64, |peak, state| state.map(|state| peak.max(state.states.coordinates()[0])))?;
    let mut output = std::io::stdout();
    serde_json::to_writer(
        &mut output,
        &serde_json::json!({ "summary": recording.summary(), "peak_alpha1_rad": peak_rad }),
    )?;
    writeln!(output)?;
    Ok(())
}

/// A plant's record at a sample: α1 = 1 mrad · exp(−2t) · cos(2π · 30 Hz · t).
fn records(sample: u64) -> Result<[Record; 5], Box<dyn Error>> {
    let t = sample as f64 * DT_S;
    let phase = 2.0 * core::f64::consts::PI * 30.0 * t;
    let alpha = 1e-3 * libm::exp(-2.0 * t) * libm::cos(phase);
    let time_ns = sample * 1_000_000;
    let frame = |id, direction| -> Result<Record, Box<dyn Error>> {
        let frame = Frame::classic(Id::Standard(id), &sample.to_le_bytes())?;
        Ok(Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns: None, frame }))
    };
    Ok([
        Record::State(StateRecord {
            sample,
            states: States::new(&[alpha, -0.5 * alpha, -2.0 * alpha, alpha], &[]).ok_or("too many states")?,
            load: Load::force_n(10.0 * libm::sin(phase), 0.0),
            taken: LoadSet::NATIVE,
            is_end: false,
        }),
        Record::Sample(SampleRecord {
            sample,
            acceleration_b_m_s2: [alpha, 2.0 * alpha],
            acceleration_c_m_s2: [3.0 * alpha, 4.0 * alpha],
            head_force_n: [10.0 * libm::sin(phase), 0.0],
            clipped: Clipped::NONE,
            more: Readings::NONE,
        }),
        frame(0x201, Direction::Received)?,
        frame(0x203, Direction::Sent)?,
        Record::Tick(TickRecord { sample, wakeup_ns: 1000 + sample, exec_ns: 2000, overruns: 0, cause: None }),
    ])
}
