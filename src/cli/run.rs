//! `resonarm run`: the plant on a bus.

use std::path::Path;
use std::sync::Arc;

use clap::Args;

use super::failure::{Failure, Verdict};
use super::flags::{Mode, SessionFlags, ThreadFlags, become_real_time};
use super::session::{Document, RecordFlags, Session, finish, report_text};
use super::supervise::supervise;
use super::{exciter, output};
use crate::bus::{self, Bus, BusAddress};
use crate::node::{ExciterNode, Outcome};
use crate::realtime::{LoopSummary, OverrunPolicy, SystemClock, ThreadSetup};
use crate::recording::{Existing, Recorder};
use crate::run::{End, PlantReport, PlantSide, RealTimeOptions, RunError, Signals, free, lockstep, real_time};
use crate::scenario::Scenario;

/// Runs the plant: the simulated arm with its sensors, as a node on a CAN bus.
#[derive(Debug, Args)]
pub(super) struct Run {
    /// The bus: vcan0, can0, python-can:interface=I,channel=C. Not for --mode free.
    #[arg(long, value_name = "BUS")]
    bus: Option<String>,
    /// Which run loop drives the plant.
    #[arg(long, value_enum, default_value_t)]
    mode: Mode,
    #[command(flatten)]
    session: SessionFlags,
    #[command(flatten)]
    record: RecordFlags,
    /// End when the controller disarms the plant, or the armed plant faults.
    #[arg(long)]
    stop_on_disarm: bool,
    /// What a missed deadline leads to in real time: continue, fault, stop.
    #[arg(long, value_name = "POLICY", default_value_t)]
    overrun: OverrunPolicy,
    #[command(flatten)]
    thread: ThreadFlags,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

type Result<T> = core::result::Result<T, Failure>;

impl Run {
    pub fn execute(&self) -> Result<Verdict> {
        let default = || if self.mode == Mode::Free { super::demo::scenario() } else { Ok(Scenario::default()) };
        let session = Session::new(self.session.scenario(default)?, self.mode)?;
        match self.mode {
            Mode::Free => self.run_free(&session),
            Mode::RealTime | Mode::Lockstep => self.run_on_bus(&session),
        }
    }

    fn create_recorder(&self, session: &Session, interface: &str) -> Result<Option<Recorder>> {
        let existing = if self.record.overwrite { Existing::Overwrite } else { Existing::Refuse };
        self.record.record.as_deref().map(|path| session.record(path, existing, interface)).transpose()
    }

    fn run_on_bus(&self, session: &Session) -> Result<Verdict> {
        let Some(bus) = &self.bus else {
            return Err(Failure::Usage(format!(
                "--bus is missing: name the bus, as --bus vcan0; --mode {} has one, --mode free has none",
                self.mode.name()
            )));
        };
        let address: BusAddress = bus.parse()?;
        let setup = self.thread.setup()?;
        let mut bus = bus::open(&address)?;
        let recorder = self.create_recorder(session, &address.to_string())?;
        let mut side = session.side(session.tape(recorder.as_ref())?)?;
        let (signals, mode, rate) = (Arc::new(Signals::default()), session.mode, session.rate);
        let end = End { after_samples: session.after_samples, on_disarm: self.stop_on_disarm };
        let overrun = self.overrun;
        let watched = Arc::clone(&signals);
        let (report, result) = supervise("plant", &signals, session.after_samples, move || {
            let outcome = if mode == Mode::Lockstep {
                lockstep(&mut side, bus.as_mut(), &SystemClock, rate, end, &watched)
            } else {
                let options = RealTimeOptions { rate, overrun, end };
                in_real_time(&mut side, bus.as_mut(), &setup, &options, &watched)
            };
            close(bus.as_mut(), outcome)
        })?;
        self.conclude(recorder, &report, result)
    }

    fn run_free(&self, session: &Session) -> Result<Verdict> {
        if self.bus.is_some() {
            return Err(Failure::Usage(String::from(
                "--mode free has no bus: leave --bus out, or take --mode lockstep",
            )));
        }
        let profile = session.scenario.profile()?;
        let (network, rate_hz) = (session.scenario.network()?, session.scenario.wire_rate_hz()?);
        let mut exciter = ExciterNode::new(network, rate_hz, session.timing, profile);
        let recorder = self.create_recorder(session, "none")?;
        let mut side = session.side(session.tape(recorder.as_ref())?)?;
        let (signals, rate, after_samples) = (Arc::new(Signals::default()), session.rate, session.after_samples);
        let samples = after_samples.unwrap_or(exciter.profile().samples());
        let watched = Arc::clone(&signals);
        let free = supervise("plant", &signals, Some(samples), move || {
            free(&mut side, &mut exciter, rate, after_samples, &watched, |_| {})
        })??;
        let timing = LoopSummary { steps: free.steps, overruns: 0, wakeup_us: None, exec_us: None };
        let report = PlantReport { timing, bus: free.bus, fault: None };
        let verdict = self.conclude(recorder, &report, Ok(()))?;
        match free.outcome {
            Some(Outcome::Faulted(emergency)) => {
                tracing::error!("{}", exciter::fault_text(&emergency));
                Ok(Verdict::Negative)
            }
            _ => Ok(verdict),
        }
    }

    /// Closes the recording and prints the report, whatever ended the run; then tells the error, if there was one.
    fn conclude(
        &self,
        recorder: Option<Recorder>,
        report: &PlantReport,
        result: core::result::Result<(), RunError>,
    ) -> Result<Verdict> {
        let summary = finish(recorder, report)?;
        if self.json {
            let recording = summary.as_ref().map(|summary| summary.path.as_path() as &Path);
            let fault = report.fault.as_ref().map(exciter::fault_text);
            output::print_json(&Document { report, fault, recording })?;
        } else {
            output::print(&report_text(report, summary.as_ref()))?;
        }
        result?;
        if let Some(emergency) = &report.fault {
            tracing::error!("{}", exciter::fault_text(emergency));
        }
        Ok(Verdict::of(report.fault.is_none()))
    }
}

/// Makes the calling thread a real-time thread, says what it could not have, and runs.
pub(super) fn in_real_time(
    side: &mut PlantSide,
    bus: &mut dyn Bus,
    setup: &ThreadSetup,
    options: &RealTimeOptions,
    signals: &Signals,
) -> (PlantReport, core::result::Result<(), RunError>) {
    become_real_time(setup);
    real_time(side, bus, &SystemClock, options, signals)
}

/// Leaves the bus; its failure counts only if nothing failed before.
fn close(
    bus: &mut dyn Bus,
    (report, result): (PlantReport, core::result::Result<(), RunError>),
) -> (PlantReport, core::result::Result<(), RunError>) {
    let closed = bus.close().map_err(RunError::from);
    (report, result.and(closed))
}
