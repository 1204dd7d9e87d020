//! What `run` and `demo` share: making the plant's side of a session, and recording it.

use core::time::Duration;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::failure::Failure;
use super::flags::Mode;
use crate::node::{PlantNode, Timing};
use crate::plant::Plant;
use crate::realtime::{Clock, Percentiles, SampleRate, SystemClock, unix_time_ns};
use crate::recording::{Channel, Existing, Options, Recorder, Summary};
use crate::run::{PlantReport, PlantSide, Tape};
use crate::scenario::Scenario;

/// Records on their way to the writer: at 1 kHz about four seconds of everything.
const TAPE_CAPACITY: usize = 1 << 15;

/// Where to record.
#[derive(Clone, Debug, Args)]
pub(super) struct RecordFlags {
    /// Record everything into this MCAP file.
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Overwrite the recording if it exists.
    #[arg(long, requires = "record")]
    pub overwrite: bool,
}

/// The plant of a scenario with its timing, before it has a tape.
pub(super) struct Session {
    pub scenario: Scenario,
    pub mode: Mode,
    pub rate: SampleRate,
    pub timing: Timing,
    pub plant: Plant,
    pub after_samples: Option<u64>,
}

impl Session {
    /// Checks the whole scenario before anything is opened or written.
    pub fn new(scenario: Scenario, mode: Mode) -> Result<Session, Failure> {
        let timing = match mode {
            Mode::RealTime => scenario.real_time_timing()?,
            Mode::Lockstep | Mode::Free => scenario.lockstep_timing()?,
        };
        scenario.wire_rate_hz()?;
        scenario.network()?;
        let plant = Plant::new(&scenario.plant_spec()?)?;
        let rate = SampleRate::new(scenario.simulation.rate_hz)?;
        let after_samples = scenario.duration_samples()?;
        Ok(Session { scenario, mode, rate, timing, plant, after_samples })
    }

    /// Creates the recording.
    pub fn record(&self, path: &Path, existing: Existing, interface: &str) -> Result<Recorder, Failure> {
        let dt_s = 1.0 / self.scenario.simulation.rate_hz;
        let mut options = match self.mode {
            Mode::RealTime => Options::real_time(dt_s, interface, clock_epoch_unix_ns(), monotonic),
            Mode::Lockstep => Options::lockstep(dt_s, interface, clock_epoch_unix_ns(), monotonic),
            Mode::Free => Options::virtual_time(dt_s, interface),
        };
        options.existing = existing;
        Ok(Recorder::create(path, &self.scenario.configuration(self.mode.name())?, options)?)
    }

    /// A tape of the session's kind into `recorder`.
    pub fn tape(&self, recorder: Option<&Recorder>) -> Result<Tape, Failure> {
        let channel =
            |recorder: &Recorder| -> Result<Channel, Failure> { Ok(recorder.channel("plant", TAPE_CAPACITY)?) };
        Ok(match (recorder, self.mode) {
            (None, _) => Tape::Off,
            (Some(recorder), Mode::RealTime) => Tape::Lossy(channel(recorder)?),
            (Some(recorder), Mode::Lockstep | Mode::Free) => Tape::Whole(channel(recorder)?),
        })
    }

    /// The plant with its node and its tape.
    pub fn side(&self, tape: Tape) -> Result<PlantSide, Failure> {
        let (network, rate_hz) = (self.scenario.network()?, self.scenario.wire_rate_hz()?);
        let node = PlantNode::new(network, rate_hz, self.timing, *self.plant.exciter());
        Ok(PlantSide::new(self.plant.clone(), node, tape))
    }
}

/// When the monotonic clock read 0, ns of the UNIX epoch.
fn clock_epoch_unix_ns() -> u64 {
    unix_time_ns().saturating_sub(SystemClock.now_ns())
}

/// The monotonic clock, as the recorder wants it.
fn monotonic() -> Duration {
    Duration::from_nanos(SystemClock.now_ns())
}

/// Closes the recording with the run's figures in it.
pub(super) fn finish(recorder: Option<Recorder>, report: &PlantReport) -> Result<Option<Summary>, Failure> {
    let Some(recorder) = recorder else { return Ok(None) };
    let statistics = [
        ("steps", report.timing.steps.to_string()),
        ("overruns", report.timing.overruns.to_string()),
        ("frames_received", report.bus.received.to_string()),
        ("frames_sent", report.bus.sent.to_string()),
        ("frames_dropped", report.bus.dropped.to_string()),
        ("frames_e2e_errors", report.bus.e2e_errors.to_string()),
    ];
    Ok(Some(recorder.finish(&statistics)?))
}

/// A run's result as JSON.
#[derive(Serialize)]
pub(super) struct Document<'a> {
    #[serde(flatten)]
    pub report: &'a PlantReport,
    /// The fault that was latched at the end, in words; only if there was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
    pub recording: Option<&'a Path>,
}

/// A run's result for people.
pub(super) fn report_text(report: &PlantReport, recording: Option<&Summary>) -> String {
    let (timing, bus) = (&report.timing, &report.bus);
    let mut text = format!("samples      {}, {} overruns\n", timing.steps, timing.overruns);
    for (name, latency) in [("wake-up", timing.wakeup_us), ("execution", timing.exec_us)] {
        if let Some(Percentiles { p50, p99, p99_9, p99_99, max }) = latency {
            text.push_str(&format!(
                "{name:12} p50 {p50:.1} µs, p99 {p99:.1}, p99.9 {p99_9:.1}, p99.99 {p99_99:.1}, max {max:.1}\n"
            ));
        }
    }
    text.push_str(&format!(
        "frames       {} received, {} sent, {} dropped, {} refused\n",
        bus.received, bus.sent, bus.dropped, bus.e2e_errors
    ));
    if let Some(summary) = recording {
        let lost: u64 = summary.lost.values().sum();
        text.push_str(&format!(
            "recording    {}, {} bytes, {lost} records lost\n",
            summary.path.display(),
            summary.bytes
        ));
    }
    text
}
