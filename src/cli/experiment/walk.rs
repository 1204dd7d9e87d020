//! `resonarm experiment walk`: the response at constant load through a resonance, folds or not, or the backbone, by a
//! closed loop.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::arm::Load;
use crate::cli::configuration;
use crate::cli::continuation::DriveFlags;

use crate::cli::failure::{Failure, Verdict};
use crate::cli::flags::SessionFlags;
use crate::cli::output::{self, OverwriteFlag};
use crate::cli::supervise::supervise;
use crate::cli::walk_point::{self, WalkPoint};
use crate::control::{ControlSpec, ModeNumber, PhaseWalkSpec};
use crate::excitation::Amplitude;
use crate::realtime::{Clock, SystemClock};
use crate::recording::Existing;
use crate::run::{BothReport, ExciterEnd, Mode, Options, RecordTo, Session, Signals};
use crate::scenario::Scenario;

/// Phase walk: a closed loop holds one motion after another, stable or not, at constant amplitude of the load, from a
/// lag of the response behind the load of 10° to 170°. Amplitudes are those that the accelerometers tell.
#[derive(Debug, Args)]
pub(super) struct Walk {
    #[command(flatten)]
    session: SessionFlags,
    #[command(flatten)]
    drive: DriveFlags,
    /// The mode whose resonance is walked through, 1 or 2 [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=2))]
    mode_number: Option<u8>,
    /// Walk the backbone: a lag of 90° at loads from a tenth of the one that is given up to it.
    #[arg(long)]
    backbone: bool,
    /// Number of points [default: 25].
    #[arg(long, value_name = "N")]
    points: Option<usize>,
    /// Record everything into this MCAP file.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Draw the points over the computed branch into STEM.svg and STEM.png, their data into STEM.csv and STEM.json.
    #[arg(long, value_name = "STEM")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Document<'a> {
    configuration: Value,
    points: &'a [WalkPoint],
    #[serde(flatten)]
    end: &'a ExciterEnd,
    simulated_s: f64,
    wall_s: f64,
}

impl Walk {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.overwrite.check_stem(self.plot.as_deref(), &[".svg", ".png", ".csv", ".json"])?;
        let mut scenario = self.session.scenario(|| Ok(Scenario::default()))?;
        scenario.control = Some(ControlSpec::PhaseWalk(self.spec(&scenario)?));
        scenario.excitation = None;
        let existing = if self.overwrite.overwrite { Existing::Overwrite } else { Existing::Refuse };
        let record = self.record.clone().map(|path| RecordTo { path, existing });
        let options = Options { record, ..Options::default() };
        let session = Session::new(scenario.clone(), Mode::Free, options)?;
        let length = session.controller()?.length();
        let start_ns = SystemClock.now_ns();
        let signals = Arc::new(Signals::default());
        let watched = Arc::clone(&signals);
        let report = supervise("walk", &signals, length, |_line| {}, move || session.both(&watched, |_| {}))??;
        let wall_s = SystemClock.now_ns().saturating_sub(start_ns) as f64 * 1e-9;
        self.conclude(&scenario, report, wall_s)
    }

    /// What the flags say, else the scenario, else the defaults.
    fn spec(&self, scenario: &Scenario) -> Result<PhaseWalkSpec, Failure> {
        let of_scenario = match &scenario.control {
            Some(ControlSpec::PhaseWalk(spec)) => Some(*spec),
            Some(ControlSpec::ForceControl(_) | ControlSpec::ResponseControl(_)) | None => None,
        };
        let drive = &self.drive;
        let is_driven = drive.torque1_nm.is_some() || drive.is_force();
        let mut spec = match of_scenario {
            Some(spec) if !is_driven => spec,
            spec => {
                let load = drive.load()?;
                let amplitude = Amplitude {
                    force_x_n: load.force_n.x,
                    force_y_n: load.force_n.y,
                    torque1_nm: load.torque_nm.x,
                    torque2_nm: load.torque_nm.y,
                };
                spec.map_or(PhaseWalkSpec::new(amplitude), |spec| PhaseWalkSpec { amplitude, ..spec })
            }
        };
        if self.backbone {
            let PhaseWalkSpec { amplitude, mode_number, points, .. } = spec;
            spec = PhaseWalkSpec { mode_number, points, ..PhaseWalkSpec::backbone(amplitude) };
        }
        if let Some(mode) = self.mode_number {
            spec.mode_number = ModeNumber::try_from(mode).map_err(|error| Failure::Usage(error.to_string()))?;
        }
        spec.points = self.points.unwrap_or(spec.points);
        Ok(spec)
    }

    fn conclude(&self, scenario: &Scenario, report: BothReport, wall_s: f64) -> Result<Verdict, Failure> {
        let BothReport { plant, exciter } = report;
        if let Some(error) = plant.error.or(exciter.error) {
            return Err(error.into());
        }
        let arm = scenario.build_arm()?;
        let points: Vec<WalkPoint> = exciter.responses.iter().map(|point| WalkPoint::new(point, &arm)).collect();
        let simulated_s = plant.samples as f64 / scenario.simulation.rate_hz;
        let end = ExciterEnd::of(exciter.outcome.as_ref());
        let unit = scenario.control.as_ref().map_or("", |control| control.amplitude().unit());
        let load = scenario.control.as_ref().map_or(Load::default(), |control| control.amplitude().load());
        let configuration = configuration::of(scenario, &load)?;
        let document = Document { configuration, points: &points, end: &end, simulated_s, wall_s };
        let mut files = Vec::new();
        if let (Some(stem), Some(control)) = (&self.plot, &scenario.control)
            && let Some(figure) = walk_point::figure(scenario, control, &points)?
        {
            files = output::plot(stem, &figure, &walk_point::csv(&points, unit), &document)?;
        }
        if self.json {
            output::print_json(&document)?;
        } else {
            let settled = points.iter().filter(|point| point.settled).count();
            if self.plot.is_none() {
                output::print(&walk_point::table(&points, unit))?;
            }
            output::print(&format!(
                "{}: {} points, {settled} settled, in {simulated_s:.1} simulated seconds ({wall_s:.1} s)\n",
                end.outcome,
                points.len()
            ))?;
            if !files.is_empty() {
                output::print_written(&files)?;
            }
        }
        if let Some(reason) = &end.reason {
            tracing::error!("{reason}");
        }
        Ok(Verdict::of(end.is_finished() && points.iter().all(|point| point.settled)))
    }
}
