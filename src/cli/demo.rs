//! `resonarm demo`: the main job in one process, on an embedded scenario.

use core::time::Duration;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use serde::Serialize;

use super::demo_report;
use super::exciter::ResponseDocument;
use super::failure::{Failure, Verdict};
use super::flags::ArmFlags;
use super::output;
use super::session::{complaint, mode_parser, report_text};
use super::supervise::supervise;
use crate::realtime::ThreadSetup;
use crate::recording::Existing;
use crate::run::{BothReport, Mode, Options, PlantReport, RecordTo, RunError, Session, Signals, Speed, fault_text};
use crate::scenario::Scenario;

/// How long plant and exciter look for each other: far longer than a machine under load keeps a thread waiting.
const PATIENCE: Duration = Duration::from_secs(30);

/// The main job in one process: plant and exciter controller on an in-memory bus, a stepped sine through the first
/// resonance. Records it, prints a summary, and plots the response. The plant waits for the controller's answer to each
/// sample, so the result is the same to the last bit on every machine, however busy.
#[derive(Debug, Args)]
pub(super) struct Demo {
    #[command(flatten)]
    arm: ArmFlags,
    /// Which run loop drives the plant; in real-time a machine that stalls disturbs the result.
    #[arg(long, value_parser = mode_parser(&[Mode::Lockstep, Mode::RealTime]), default_value_t = Mode::Lockstep)]
    mode: Mode,
    /// Simulated seconds a second in lockstep; 0 is as fast as it goes [default: 1].
    #[arg(long, value_name = "X", allow_hyphen_values = true)]
    speed: Option<f64>,
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
    /// The figure's files; none if no response was read.
    figures: Vec<PathBuf>,
    responses: Vec<ResponseDocument>,
}

/// The demo's scenario.
pub(super) fn scenario() -> Result<Scenario, Failure> {
    Ok(Scenario::parse(include_str!("../../scenarios/demo.toml"), "scenarios/demo.toml")?)
}

impl Demo {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let mut scenario = self.arm.scenario(scenario)?;
        let profile = scenario.profile()?;
        // The run ends with the profile; this is for the progress bar.
        scenario.simulation.duration_s = None;
        let samples = profile.samples();
        let default_speed = if self.mode == Mode::RealTime { Speed::UNPACED } else { Speed::ACTUAL };
        let record = RecordTo { path: self.out.join("demo.mcap"), existing: Existing::Overwrite };
        let options = Options {
            record: Some(record),
            speed: self.speed.map_or(Ok(default_speed), Speed::new).map_err(RunError::from)?,
            thread: (self.mode == Mode::RealTime).then(ThreadSetup::default),
            patience: Some(PATIENCE),
            ..Options::default()
        };
        let introduction = demo_report::introduction(&scenario, &profile, self.mode, options.speed)?;
        let session = Session::new(scenario.clone(), self.mode, options)?;
        std::fs::create_dir_all(&self.out).map_err(|source| Failure::Write { path: self.out.clone(), source })?;
        if !self.json {
            output::print(&introduction)?;
        }
        let signals = Arc::new(Signals::default());
        let watched = Arc::clone(&signals);
        let report = supervise("plant", &signals, Some(samples), || {}, move || session.both(&watched, |_| {}))??;
        self.conclude(&scenario, report)
    }

    fn conclude(&self, scenario: &Scenario, BothReport { plant, exciter }: BothReport) -> Result<Verdict, Failure> {
        let responses = &exciter.responses;
        let figures = match demo_report::figure(scenario, responses)? {
            Some(figure) => figure.write(&self.out.join("response"))?.to_vec(),
            None => Vec::new(),
        };
        if self.json {
            let responses = responses.iter().map(ResponseDocument::from).collect();
            output::print_json(&Document { report: &plant, figures, responses })?;
        } else {
            output::print(&demo_report::table(scenario, responses)?)?;
            output::print(&report_text(&plant))?;
            let paths: Vec<_> = figures.iter().map(|path: &PathBuf| path.display().to_string()).collect();
            if !paths.is_empty() {
                output::print(&format!("plot         {}\n", paths.join(", ")))?;
            }
        }
        let complaints = [complaint(&plant), exciter.fault().map(fault_text)];
        complaints.iter().flatten().for_each(|text| tracing::error!("{text}"));
        match plant.error.or(exciter.error) {
            Some(error) => Err(error.into()),
            None => Ok(Verdict::of(complaints.iter().all(Option::is_none) && plant.outcome.is_good())),
        }
    }
}
