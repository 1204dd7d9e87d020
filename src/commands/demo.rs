//! `resonarm demo`: the main job in one process, on an embedded scenario.

use core::time::Duration;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use serde::Serialize;

use crate::commands::demo_report;
use crate::commands::exciter::complaint as complaint_of_exciter;
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::flags::{self, ArmFlags};
use crate::live::{LiveFlags, Role, ShownRole};
use crate::output;
use crate::session::{PlantDocument, complaint, report_text};
use crate::status::{Status, Style};
use crate::supervise::{Line, supervise};
use crate::walk_point::{self, WalkPoint};
use resonarm::control::ControlSpec;
use resonarm::realtime::ThreadSetup;
use resonarm::recording::Existing;
use resonarm::run::{BothReport, Mode, Options, RecordTo, RunError, Session, Signals, Speed};
use resonarm::scenario::{Scenario, ScenarioError};

/// How long plant and exciter wait for each other: far longer than a loaded machine delays a thread.
const PATIENCE: Duration = Duration::from_secs(30);

/// The main job in one process: plant and exciter controller on an in-memory bus, a phase walk over the folded first
/// resonance. Records it, prints the points, and plots them over the computed branch. The plant waits for the
/// controller's answer to each sample, so the result is the same to the last bit on every machine, however busy.
#[derive(Debug, Args)]
pub(crate) struct Demo {
    #[command(flatten)]
    arm: ArmFlags,
    /// Which run loop drives the plant; in real-time a machine that stalls disturbs the result.
    #[arg(long, value_parser = flags::one_of([Mode::Lockstep, Mode::RealTime], Mode::name), default_value_t = Mode::Lockstep)]
    mode: Mode,
    /// Simulated seconds a second in lockstep; 0 is as fast as possible.
    #[arg(long, value_name = "X", allow_hyphen_values = true)]
    speed: Option<f64>,
    /// Folder for demo.mcap, response.svg, response.png and its caption, response.txt; those of an earlier demo are
    /// overwritten.
    #[arg(long, value_name = "DIR", default_value = "resonarm-demo")]
    out: PathBuf,
    #[command(flatten)]
    live: LiveFlags,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    plant: PlantDocument<'a>,
    /// The figure's files; none if no point was read.
    figures: Vec<PathBuf>,
    points: &'a [WalkPoint],
}

/// The demo's scenario.
pub(crate) fn scenario() -> Result<Scenario, Failure> {
    Ok(Scenario::parse(include_str!("../../scenarios/demo.toml"), "scenarios/demo.toml")?)
}

impl Demo {
    /// The scenario of the flags.
    pub(crate) fn scenario(&self) -> Result<Scenario, Failure> {
        self.arm.scenario(scenario)
    }

    /// Simulated seconds a second.
    pub(crate) fn speed(&self) -> Result<Speed, Failure> {
        let default = if self.mode == Mode::RealTime { Speed::UNPACED } else { Speed::ACTUAL };
        Ok(self.speed.map_or(Ok(default), Speed::new).map_err(RunError::from)?)
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let mut scenario = self.scenario()?;
        // A scenario without control is driven like the demo's.
        let control = match scenario.control.take().or(self::scenario()?.control) {
            Some(control) => control,
            None => return Err(ScenarioError::NoExcitation.into()),
        };
        (scenario.control, scenario.excitation) = (Some(control.clone()), None);
        // The run ends with the walk.
        scenario.simulation.duration_s = None;
        let record = RecordTo { path: self.out.join("demo.mcap"), existing: Existing::Overwrite };
        let options = Options {
            record: Some(record),
            speed: self.speed()?,
            thread: (self.mode == Mode::RealTime).then(ThreadSetup::default),
            patience: Some(PATIENCE),
            ..Options::default()
        };
        let introduction = demo_report::introduction(&scenario, &control, self.mode, options.speed)?;
        let session = Session::new(scenario.clone(), self.mode, options)?;
        let length = session.controller()?.length();
        std::fs::create_dir_all(&self.out).map_err(|source| Failure::Write { path: self.out.clone(), source })?;
        if !self.json {
            output::print(&introduction)?;
        }
        let shown_role = ShownRole {
            role: Role::PlantAndExciter,
            place: String::from("a bus in memory"),
            interface: session.interface_of_both().to_owned(),
            json: false,
            steered: None,
        };
        let (session, _serving) = self.live.watched(session, &shown_role)?;
        let signals = Arc::new(Signals::default());
        let (watched, shown) = (Arc::clone(&signals), Arc::clone(&signals));
        let mut status = Status::new(Style::People { every: None });
        let on_tick = |line: &mut Line| status.write(&shown, line);
        let report = supervise("plant", &signals, length, on_tick, move || session.both(&watched, |_| {}))??;
        self.conclude(&scenario, &control, report)
    }

    fn conclude(
        &self,
        scenario: &Scenario,
        control: &ControlSpec,
        BothReport { plant, exciter }: BothReport,
    ) -> Result<Verdict, Failure> {
        let arm = scenario.build_arm()?;
        let points: Vec<WalkPoint> = exciter.responses.iter().map(|point| WalkPoint::new(point, &arm)).collect();
        let figures = match walk_point::figure(scenario, control, &points)? {
            Some(figure) => figure.write(&self.out.join("response"))?.to_vec(),
            None => Vec::new(),
        };
        if self.json {
            let plant = PlantDocument { configuration: configuration::of_arm(scenario)?, report: &plant };
            output::print_json(&Document { plant, figures, points: &points })?;
        } else {
            output::print(&walk_point::table(&points, control.amplitude().unit()))?;
            output::print(&format!("\n{}", report_text(&plant)))?;
            let paths: Vec<_> = figures.iter().map(|path: &PathBuf| path.display().to_string()).collect();
            if !paths.is_empty() {
                output::print(&format!("plot         {}\n", paths.join(", ")))?;
            }
        }
        let complaints = [complaint(&plant), complaint_of_exciter(&exciter)];
        complaints.iter().flatten().for_each(|text| tracing::error!("{text}"));
        match plant.error.or(exciter.error) {
            Some(error) => Err(error.into()),
            None => Ok(Verdict::of(complaints.iter().all(Option::is_none) && plant.outcome.is_good())),
        }
    }
}
