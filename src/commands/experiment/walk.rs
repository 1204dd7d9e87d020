//! `resonarm experiment walk`: the response at constant load through a resonance, with or without folds, or the
//! backbone, in a closed loop.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::computed_branch::{ComputedBranch, Score};
use crate::configuration;
use crate::drive::{Drive, LoadFlag, lacks_amplitude, load_flag, missing};
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags::SessionFlags;
use crate::help::heading;
use crate::measured_points::{self, MeasuredPoint};
use crate::numbers;
use crate::output::{self, Inputs, PlotFlags};
use crate::progress::timed;
use crate::read_at::dof;
use crate::recordings::{existing, wait_for_reader};
use crate::supervise::supervise;
use resonarm::control::{ControlSpec, ModeNumber, PhaseWalkSpec};
use resonarm::plant::TestedAssembly;
use resonarm::rig::{Load, ShakerSpec};
use resonarm::run::{BothReport, ExciterEnd, Mode, Options, RecordTo, RunError, Session, Signals};
use resonarm::scenario::Scenario;

use resonarm_numeric::number::short;

const EXAMPLES: &str = "\
Examples:
  resonarm experiment walk --drive joint1=20 --plot walk
  resonarm experiment walk --drive tip.x=14 --angles-deg 30,60
  resonarm experiment walk --drive joint1=20 --backbone
  resonarm experiment walk --scenario shaken.toml --drive shaker=100

In JSON and CSV every point has its readings by degree of freedom: amplitude and phase of the fundamental of the
displacement, as the accelerometers read it.";

/// The value of --drive that stands for the direction of the scenario's shaker.
const SHAKER: &str = "shaker";

/// Phase walk: measures a resonance by a phase-resonance test that follows it through folds.
///
/// A closed loop holds one periodic response after another, stable or not, at constant amplitude of the load. The phase
/// lag of the response behind the load goes from 10° to 170°. Displacements are computed from the accelerometers.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
#[command(mut_args(output::explained(
    "Plot the points over the computed branch to STEM.svg and STEM.png",
    "The caption is in STEM.txt, the data are in STEM.csv and STEM.json."
)))]
pub(crate) struct WalkExperiment {
    #[command(flatten)]
    session: SessionFlags,
    /// Load whose amplitude is held, as joint1=20, N·m, or tip.x=14, N; may be repeated.
    ///
    /// The load is a torque at a joint, as joint1=20, N·m; a force where the exciter is, along an axis, as tip.x=14, or
    /// along the scenario's shaker, as shaker=100, N. Several loads are in phase. Without this option the walk takes the
    /// load of the scenario's control or excitation.
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF=A", allow_hyphen_values = true, value_parser = load_flag)]
    drive: Vec<LoadFlag>,
    /// Mode whose resonance is measured, from 1, by frequency.
    #[arg(long, help_heading = heading::LOADS, value_name = "N", value_parser = numbers::integer_checked_later(1..=32_u8))]
    mode_number: Option<u8>,
    /// Measure the backbone: a lag of 90° at loads from a tenth of the given one up to it.
    #[arg(long, help_heading = heading::LOADS)]
    backbone: bool,
    /// Number of points.
    #[arg(long, help_heading = heading::RANGE, value_name = "N", value_parser = numbers::integer_checked_later(3..=10_000_usize))]
    points: Option<usize>,
    /// Record everything into this MCAP file.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    output: PlotFlags,
}

#[derive(Serialize)]
struct Document<'a> {
    configuration: Value,
    coordinates: Value,
    points: &'a [MeasuredPoint],
    /// The deviations from the computed branch; none at a load that grows, or if no point has settled.
    score: Option<Score>,
    #[serde(flatten)]
    end: &'a ExciterEnd,
    simulated_s: f64,
    wall_s: f64,
}

impl WalkExperiment {
    /// Returns the scenario of the flags, with the walk in it.
    pub(crate) fn scenario(&self) -> Result<Scenario, Failure> {
        let mut scenario = self.session.scenario_or(|| Ok(Scenario::default()))?;
        let tested = scenario.under_test()?;
        scenario.control = Some(ControlSpec::PhaseWalk(self.spec(&scenario, &tested)?));
        scenario.excitation = None;
        Ok(scenario)
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let inputs = Inputs::of_scenario(self.session.structure.scenario.as_deref());
        self.output.check(output::PLOTTED, &inputs)?;
        self.record.as_deref().map_or(Ok(()), |path| inputs.check(path))?;
        let scenario = self.scenario()?;
        let existing = existing(self.output.overwrite.overwrite);
        let record = self.record.clone().map(|path| RecordTo { path, existing });
        let options = Options { record, ..Options::default() };
        let session = Session::new(scenario.clone(), Mode::Free, options)?;
        let length = session.controller()?.length();
        let _reader = self.record.as_deref().map(wait_for_reader).transpose()?;
        let work = move |signals: &Signals| {
            let report = session.both(signals, &mut |_| {})?;
            Ok::<_, RunError>((ExciterEnd::of(report.exciter_outcome(signals).as_ref()), report))
        };
        let (done, wall_s) = timed(|| supervise("walk", length, |_, _| {}, work));
        let (end, report) = done??;
        self.conclude(&scenario, &end, report, wall_s)
    }

    /// Returns the walk of the flags, of the scenario, or the default, in this order.
    fn spec(&self, scenario: &Scenario, tested: &TestedAssembly) -> Result<PhaseWalkSpec, Failure> {
        let of_scenario = match &scenario.control {
            Some(ControlSpec::PhaseWalk(spec)) => Some(*spec),
            _ => None,
        };
        let amplitude = self.amplitude(scenario, tested)?;
        let mut spec = of_scenario.map_or(PhaseWalkSpec::new(amplitude), |spec| PhaseWalkSpec { amplitude, ..spec });
        if self.backbone {
            // The mode and the number of points stay those of the scenario; everything else is that of a walk along
            // the backbone.
            let PhaseWalkSpec { amplitude, mode_number, points, .. } = spec;
            spec = PhaseWalkSpec { mode_number, points, ..PhaseWalkSpec::backbone(amplitude) };
        }
        if let Some(mode) = self.mode_number {
            spec.mode_number = ModeNumber::try_from(mode).map_err(|error| Failure::usage(error.to_string()))?;
        }
        spec.points = self.points.unwrap_or(spec.points);
        Ok(spec)
    }

    /// Returns the load of the flags, or that of the scenario's control or excitation.
    fn amplitude(&self, scenario: &Scenario, tested: &TestedAssembly) -> Result<Load, Failure> {
        if self.drive.is_empty() {
            let of_scenario = scenario.control.as_ref().map(ControlSpec::amplitude);
            let of_scenario = of_scenario.or(scenario.excitation.as_ref().map(|excitation| &excitation.amplitude));
            return of_scenario.copied().ok_or_else(|| missing("--drive DOF=A", &tested.assembly));
        }
        // Each place of the exciter has a part of its own, so several flags add up to one load.
        let mut whole = [0.0; Load::PARTS];
        for flag in &self.drive {
            let LoadFlag { name, amplitude } = flag;
            let sum = if name == SHAKER {
                let amplitude = amplitude
                    .ok_or_else(|| Failure::usage("--drive shaker has no amplitude: give --drive shaker=A, in N"))?;
                along(scenario.rig.shaker.as_ref(), amplitude)?
            } else {
                one_load(tested, name, *amplitude)?
            };
            for (total, part) in whole.iter_mut().zip(sum.parts()).filter(|(_, part)| *part != 0.0) {
                if *total != 0.0 {
                    return Err(Failure::usage(format!("--drive {name} is given twice: give each load once")));
                }
                *total = part;
            }
        }
        Ok(Load::from_parts(&whole))
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
        let tested = scenario.under_test()?;
        let points = measured_points::points(&tested, &exciter.responses);
        let amplitude = scenario.amplitude().copied().unwrap_or_default();
        let drive = Drive::of_exciter(&amplitude, &tested);
        let around = drive.as_ref().map(|drive| ComputedBranch::around(&tested.assembly, drive, &points, None));
        let mut computed = around.transpose()?.flatten();
        if let Some(computed) = &mut computed {
            // The measurement stands for itself, so that a branch that can't be computed takes nothing from it.
            if let Err(reason) = computed.compute(&tested.assembly, &points) {
                tracing::warn!("no branch is computed beside the points: {reason}");
            }
        }
        let simulated_s = plant.samples as f64 / scenario.simulation.rate_hz;
        let mut configuration = configuration::of_structure(scenario, &tested);
        configuration["drive"] = drive.as_ref().map_or(Value::Null, Drive::document);
        let document = Document {
            configuration,
            coordinates: configuration::coordinates(&tested.assembly),
            points: &points,
            score: computed.as_ref().and_then(|computed| computed.score(&points)),
            end,
            simulated_s,
            wall_s,
        };
        let unit = amplitude.unit();
        let mut files = Vec::new();
        if let (Some(stem), Some(computed)) = (&self.output.plot, &computed) {
            let conditions = captions::structure(scenario, &tested, &[]);
            let figure = computed.figure("Phase walk over the resonance", conditions, &points);
            files = output::plot(Some(stem), &document, || (figure, measured_points::csv(&points, unit)))?;
        }
        let settled = points.iter().filter(|point| point.settled).count();
        let text = || {
            let table = if files.is_empty() { measured_points::table(&points, unit) } else { String::new() };
            let score = document.score.as_ref().map_or(String::new(), Score::line);
            format!(
                "{table}{score}{}: {} points, {settled} settled, in {simulated_s:.1} simulated seconds ({wall_s:.1} s)\n",
                end.outcome,
                points.len()
            )
        };
        self.output.json.show(&document, text, &files)?;
        if let Some(reason) = &end.reason {
            tracing::error!("{reason}");
        }
        Ok(Verdict::of(end.is_finished() && settled == points.len()))
    }
}

/// Returns the load of one flag, at a degree of freedom that the exciter drives.
fn one_load(tested: &TestedAssembly, name: &str, amplitude: Option<f64>) -> Result<Load, Failure> {
    let wanted = dof("--drive", name, &tested.assembly)?;
    let amplitude = amplitude.ok_or_else(|| lacks_amplitude(name, wanted))?;
    let loaded = tested.loaded();
    let Some(place) = loaded.iter().position(|dof| *dof == Some(wanted)) else {
        let known: Vec<String> = loaded.iter().flatten().map(|dof| tested.dof_name(*dof)).collect();
        return Err(Failure::usage(format!(
            "--drive {name}: the exciter of the scenario acts on {}; choose one of these, or place the exciter there by `rig.exciter.at`",
            known.join(", ")
        )));
    };
    let mut parts = [0.0; Load::PARTS];
    parts[place] = amplitude;
    Ok(Load::from_parts(&parts))
}

/// Returns a force along the scenario's shaker; components due to rounding of its direction are 0.
fn along(shaker: Option<&ShakerSpec>, force_n: f64) -> Result<Load, Failure> {
    let Some(shaker) = shaker else {
        return Err(Failure::usage(format!(
            "--drive shaker={} acts along a shaker, but the scenario has none: add [rig.shaker], or name a degree of freedom, as tip.x",
            short(&force_n)
        )));
    };
    let component = |share: f64| if share.abs() < 1e-12 { 0.0 } else { share * force_n };
    let direction = shaker.direction();
    Ok(Load::force_n(component(direction.x), component(direction.y)))
}
