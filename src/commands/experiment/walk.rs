//! `resonarm experiment walk`: the response at constant load through a resonance, with or without folds, or the
//! backbone, in a closed loop.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::arm_drive::ArmDriveFlags;
use crate::configuration;
use resonarm::arm::Load;

use crate::failure::{Failure, Verdict};
use crate::flags::SessionFlags;
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use crate::progress::timed;
use crate::recordings::{existing, wait_for_reader};
use crate::structures;
use crate::structures::walk::{Computed, StructurePoint, StructureScore};
use crate::supervise::supervise;
use crate::walk_point::{self, WalkPoint};
use resonarm::control::{ControlSpec, ModeNumber, PhaseWalkSpec, ResponsePoint};
use resonarm::excitation::Amplitude;
use resonarm::plant::TestedAssembly;
use resonarm::rig::ShakerSpec;
use resonarm::run::{BothReport, ExciterEnd, Mode, Options, RecordTo, RunError, Session, Signals};
use resonarm::scenario::Scenario;
use resonarm_numeric::number::short;

/// Phase walk: a closed loop holds one motion after another, stable or not, at constant amplitude of the load, from a
/// lag of the response behind the load of 10° to 170°. Amplitudes are computed from the accelerometers.
#[derive(Debug, Args)]
pub(crate) struct WalkExperiment {
    #[command(flatten)]
    session: SessionFlags,
    #[command(flatten)]
    drive: ArmDriveFlags,
    /// Amplitude of a force at point C in the direction of the scenario's shaker, N. If no load is given the walk takes
    /// that of the scenario's control or excitation.
    #[arg(long, value_name = "A", conflicts_with_all = ["torque1_nm", "force_x_n", "force_y_n"])]
    force_n: Option<f64>,
    /// The mode whose resonance is walked through: of the arm 1 or 2.
    #[arg(long, value_name = "N")]
    mode_number: Option<u8>,
    /// Walk the backbone: a lag of 90° at loads from a tenth of the given one up to it.
    #[arg(long)]
    backbone: bool,
    /// Number of points.
    #[arg(long, value_name = "N")]
    points: Option<usize>,
    /// Record everything into this MCAP file.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Draw the points over the computed branch to STEM.svg and STEM.png, with the caption in STEM.txt and their data
    /// in STEM.csv and STEM.json.
    #[arg(long, value_name = "STEM")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
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

#[derive(Serialize)]
struct StructureDocument<'a> {
    configuration: Value,
    points: &'a [StructurePoint],
    /// Against the computed branch; none at a load that grows, along more than one degree of freedom, or if no point
    /// has settled.
    score: Option<&'a StructureScore>,
    #[serde(flatten)]
    end: &'a ExciterEnd,
    simulated_s: f64,
    wall_s: f64,
}

impl WalkExperiment {
    /// The scenario of the flags, with the walk in it.
    pub(crate) fn scenario(&self) -> Result<Scenario, Failure> {
        let mut scenario = self.session.scenario_or(|| Ok(Scenario::default()))?;
        scenario.control = Some(ControlSpec::PhaseWalk(self.spec(&scenario)?));
        scenario.excitation = None;
        Ok(scenario)
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let inputs = Inputs::of_scenario(self.session.structure.scenario.as_deref());
        self.overwrite.check_stem(self.plot.as_deref(), output::PLOTTED, &inputs)?;
        self.record.as_deref().map_or(Ok(()), |path| inputs.check(path))?;
        let scenario = self.scenario()?;
        let existing = existing(self.overwrite.overwrite);
        let record = self.record.clone().map(|path| RecordTo { path, existing });
        let options = Options { record, ..Options::default() };
        let session = Session::new(scenario.clone(), Mode::Free, options)?;
        let length = session.controller()?.length();
        let _reader = self.record.as_deref().map(wait_for_reader).transpose()?;
        let work = move |signals: &Signals| {
            let report = session.both(signals, |_| {})?;
            Ok::<_, RunError>((ExciterEnd::of(report.exciter_outcome(signals).as_ref()), report))
        };
        let (done, wall_s) = timed(|| supervise("walk", length, |_, _| {}, work));
        let (end, report) = done??;
        self.conclude(&scenario, &end, report, wall_s)
    }

    /// The walk of the flags, or of the scenario, or the default.
    fn spec(&self, scenario: &Scenario) -> Result<PhaseWalkSpec, Failure> {
        let of_scenario = match &scenario.control {
            Some(ControlSpec::PhaseWalk(spec)) => Some(*spec),
            Some(ControlSpec::ForceControl(_) | ControlSpec::ResponseControl(_)) | None => None,
        };
        let amplitude = self.amplitude(scenario)?;
        let mut spec = of_scenario.map_or(PhaseWalkSpec::new(amplitude), |spec| PhaseWalkSpec { amplitude, ..spec });
        if self.backbone {
            let PhaseWalkSpec { amplitude, mode_number, points, .. } = spec;
            spec = PhaseWalkSpec { mode_number, points, ..PhaseWalkSpec::backbone(amplitude) };
        }
        if let Some(mode) = self.mode_number {
            spec.mode_number = ModeNumber::try_from(mode).map_err(|error| Failure::usage(error.to_string()))?;
        }
        spec.points = self.points.unwrap_or(spec.points);
        Ok(spec)
    }

    /// The load of the flags, or that of the scenario's control or excitation.
    fn amplitude(&self, scenario: &Scenario) -> Result<Amplitude, Failure> {
        let drive = &self.drive;
        let of_scenario = scenario.control.as_ref().map(ControlSpec::amplitude);
        let of_scenario = of_scenario.or(scenario.excitation.as_ref().map(|excitation| &excitation.amplitude));
        match (self.force_n, &scenario.rig.shaker, of_scenario) {
            (Some(force_n), Some(shaker), _) => Ok(along(shaker, force_n)),
            (Some(force_n), None, _) => Err(Failure::usage(format!(
                "--force-n {} acts along a shaker, and the scenario has none: add [rig.shaker], or give --force-x-n and --force-y-n",
                short(&force_n)
            ))),
            (None, _, Some(amplitude)) if !drive.is_given() => Ok(*amplitude),
            (None, _, _) => {
                let Load { torque_nm, force_n } = drive.load()?;
                let (force_x_n, force_y_n) = (force_n.x, force_n.y);
                Ok(Amplitude { force_x_n, force_y_n, torque1_nm: torque_nm.x, torque2_nm: torque_nm.y })
            }
        }
    }

    fn conclude(
        &self,
        scenario: &Scenario,
        end: &ExciterEnd,
        BothReport { plant, exciter }: BothReport,
        wall_s: f64,
    ) -> Result<Verdict, Failure> {
        if let Some(error) = plant.error.or(exciter.error) {
            return Err(error.into());
        }
        if let Some(tested) = scenario.tested_structure()? {
            return self.conclude_on(&tested, scenario, end, (&exciter.responses, plant.samples, wall_s));
        }
        let arm = scenario.build_arm()?;
        let points: Vec<WalkPoint> = exciter.responses.iter().map(|point| WalkPoint::new(point, &arm)).collect();
        let simulated_s = plant.samples as f64 / scenario.simulation.rate_hz;
        let amplitude = scenario.control.as_ref().map(|control| *control.amplitude()).unwrap_or_default();
        let (unit, load) = (amplitude.unit(), amplitude.load());
        let configuration = configuration::of(scenario, &load)?;
        let document = Document { configuration, points: &points, end, simulated_s, wall_s };
        let mut files = Vec::new();
        if let (Some(stem), Some(control)) = (&self.plot, &scenario.control)
            && let Some(figure) = walk_point::figure(scenario, control, &points)?
        {
            files = output::plot(Some(stem), &document, || (figure, walk_point::csv(&points, unit)))?;
        }
        let text = || {
            let settled = points.iter().filter(|point| point.settled).count();
            let table = if self.plot.is_none() { walk_point::table(&points, unit) } else { String::new() };
            format!(
                "{table}{}: {} points, {settled} settled, in {simulated_s:.1} simulated seconds ({wall_s:.1} s)\n",
                end.outcome,
                points.len()
            )
        };
        self.json.show(&document, text, &files)?;
        if let Some(reason) = &end.reason {
            tracing::error!("{reason}");
        }
        Ok(Verdict::of(end.is_finished() && points.iter().all(|point| point.settled)))
    }
}

impl WalkExperiment {
    /// The same on a structure in place of the arm.
    fn conclude_on(
        &self,
        tested: &TestedAssembly,
        scenario: &Scenario,
        end: &ExciterEnd,
        (responses, samples, wall_s): (&[ResponsePoint], u64, f64),
    ) -> Result<Verdict, Failure> {
        let points = structures::walk::points(tested, responses);
        let control = scenario.control.as_ref();
        let amplitude = control.map(|control| *control.amplitude()).unwrap_or_default();
        let computed = Computed::new(tested, &amplitude, responses)?;
        let score = computed.as_ref().and_then(|computed| computed.score(responses));
        let simulated_s = samples as f64 / scenario.simulation.rate_hz;
        let configuration = configuration::of(scenario, &amplitude.load())?;
        let (document_points, document_score) = (&points[..], score.as_ref());
        let document = StructureDocument {
            configuration,
            points: document_points,
            score: document_score,
            end,
            simulated_s,
            wall_s,
        };
        let unit = amplitude.unit();
        let mut files = Vec::new();
        if let (Some(stem), Some(computed)) = (&self.plot, &computed) {
            let figure = computed.figure("Phase walk over the resonance", scenario, tested, responses);
            files = output::plot(Some(stem), &document, || (figure, structures::walk::csv(&points, unit)))?;
        }
        let settled = points.iter().filter(|point| point.settled).count();
        let text = || {
            let table = if files.is_empty() { structures::walk::table(&points, unit) } else { String::new() };
            let score = score.as_ref().map_or(String::new(), structures::walk::score_line);
            format!(
                "{table}{score}{}: {} points, {settled} settled, in {simulated_s:.1} simulated seconds ({wall_s:.1} s)\n",
                end.outcome,
                points.len()
            )
        };
        self.json.show(&document, text, &files)?;
        if let Some(reason) = &end.reason {
            tracing::error!("{reason}");
        }
        Ok(Verdict::of(end.is_finished() && settled == points.len()))
    }
}

/// A force along a shaker; components due to rounding of its direction are 0.
fn along(shaker: &ShakerSpec, force_n: f64) -> Amplitude {
    let component = |share: f64| if share.abs() < 1e-12 { 0.0 } else { share * force_n };
    let direction = shaker.direction();
    Amplitude { force_x_n: component(direction.x), force_y_n: component(direction.y), ..Amplitude::default() }
}
