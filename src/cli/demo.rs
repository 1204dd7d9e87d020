//! `resonarm demo`: the main job in one process, on an embedded scenario.

use core::time::Duration;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;

use clap::Args;
use serde::Serialize;

use super::demo_report;
use super::exciter::{ResponseDocument, fault_text};
use super::failure::{Failure, Verdict};
use super::flags::{ArmFlags, Mode};
use super::output;
use super::run::in_real_time;
use super::session::{Session, finish, report_text};
use super::supervise::supervise;
use crate::bus::memory::{MemoryBus, hub};
use crate::node::{ExciterNode, Outcome, ResponsePoint};
use crate::realtime::{OverrunPolicy, SystemClock, ThreadSetup};
use crate::recording::{Existing, Recorder};
use crate::run::{End, ExciterReport, PlantReport, PlantSide, RealTimeOptions, RunError, Signals, exciter};
use crate::scenario::Scenario;

/// Frames that fit the memory bus in each direction.
const BUS_CAPACITY: usize = 1024;
/// How long plant and exciter look for each other.
const PATIENCE: Duration = Duration::from_secs(5);

/// The main job in one process: plant and exciter controller on an in-memory bus, in real time, a stepped sine through the
/// first resonance. Records it, prints a summary, and plots the response.
#[derive(Debug, Args)]
pub(super) struct Demo {
    #[command(flatten)]
    arm: ArmFlags,
    /// Folder for demo.mcap, response.svg and response.png; those of an earlier demo are overwritten.
    #[arg(long, value_name = "DIR", default_value = "resonarm-demo")]
    out: PathBuf,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    report: &'a PlantReport,
    recording: &'a Path,
    figures: [PathBuf; 2],
    responses: Vec<ResponseDocument>,
}

/// The demo's scenario.
pub(super) fn scenario() -> Result<Scenario, Failure> {
    Ok(Scenario::parse(include_str!("../../scenarios/demo.toml"), "scenarios/demo.toml")?)
}

/// What both ends of the demo's bus came to.
type Ends = ((PlantReport, Result<(), RunError>), Result<(ExciterReport, Vec<ResponsePoint>), RunError>);

impl Demo {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let mut scenario = self.arm.scenario(scenario)?;
        let profile = scenario.profile()?;
        // The run ends with the profile; this is for the progress bar.
        scenario.simulation.duration_s = None;
        let samples = profile.samples();
        let session = Session::new(scenario, Mode::RealTime)?;
        std::fs::create_dir_all(&self.out).map_err(|source| Failure::Write { path: self.out.clone(), source })?;
        let recorder = session.record(&self.out.join("demo.mcap"), Existing::Overwrite, "memory")?;
        if !self.json {
            output::print(&demo_report::introduction(&session.scenario, &profile)?)?;
        }
        let side = session.side(session.tape(Some(&recorder))?)?;
        let rate_hz = session.scenario.wire_rate_hz()?;
        let node = ExciterNode::new(session.scenario.network()?, rate_hz, session.timing, profile);
        let signals = Arc::new(Signals::default());
        let (watched, rate) = (Arc::clone(&signals), session.rate);
        let options = RealTimeOptions {
            rate,
            overrun: OverrunPolicy::Continue,
            end: End { after_samples: None, on_disarm: true },
        };
        let (plant, exciter) =
            supervise("plant", &signals, Some(samples), move || both(side, node, &options, &watched))?;
        self.conclude(&session, recorder, plant, exciter)
    }

    fn conclude(
        &self,
        session: &Session,
        recorder: Recorder,
        (report, result): (PlantReport, Result<(), RunError>),
        exciter: Result<(ExciterReport, Vec<ResponsePoint>), RunError>,
    ) -> Result<Verdict, Failure> {
        let summary = finish(Some(recorder), &report)?;
        result?;
        let (exciter, responses) = exciter?;
        let figure = demo_report::figure(&session.scenario, &responses)?;
        let figures = figure.write(&self.out.join("response"))?;
        let recording = self.out.join("demo.mcap");
        if self.json {
            let responses = responses.iter().map(ResponseDocument::from).collect();
            output::print_json(&Document { report: &report, recording: &recording, figures, responses })?;
        } else {
            output::print(&demo_report::table(&session.scenario, &responses)?)?;
            output::print(&report_text(&report, summary.as_ref()))?;
            output::print(&format!("plot         {}, {}\n", figures[0].display(), figures[1].display()))?;
        }
        if let Outcome::Faulted(emergency) = exciter.outcome {
            tracing::error!("{}", fault_text(&emergency));
            return Ok(Verdict::Negative);
        }
        Ok(Verdict::Positive)
    }
}

/// Runs the plant on this thread and the exciter on one of its own, on a memory bus between them.
fn both(mut side: PlantSide, mut node: ExciterNode, options: &RealTimeOptions, signals: &Signals) -> Ends {
    let mut ends = hub(2, BUS_CAPACITY).into_iter();
    let (Some(mut near), Some(mut far)) = (ends.next(), ends.next()) else { unreachable!("a hub of two has two ends") };
    thread::scope(|scope| {
        // Started before this thread becomes a real-time one, so that it stays an ordinary thread.
        let controller = scope.spawn(|| control(&mut node, &mut far, signals));
        let plant = in_real_time(&mut side, &mut near, &ThreadSetup::default(), options, signals);
        let exciter = match controller.join() {
            Ok(result) => result,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        (plant, exciter)
    })
}

fn control(
    node: &mut ExciterNode,
    bus: &mut MemoryBus,
    signals: &Signals,
) -> Result<(ExciterReport, Vec<ResponsePoint>), RunError> {
    // The plant's loop keeps the count of samples; this one only listens for the stop.
    let mut responses = Vec::new();
    let report = exciter(node, bus, &SystemClock, PATIENCE, signals, |point| responses.push(point))?;
    Ok((report, responses))
}
