//! `resonarm demo`: a phase walk of plant and exciter in one process, on an embedded scenario.

use core::time::Duration;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::exciter::complaint as complaint_of_exciter;
use crate::computed_branch::ComputedBranch;
use crate::configuration;
use crate::drive::Drive;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags::{self, StructureFlags};
use crate::help::heading;
use crate::live::{LiveFlags, Role, ShownRole};
use crate::measured_points::{self, MeasuredPoint};
use crate::output::{self, Inputs, JsonFlag};
use crate::session::{PlantDocument, complaint, report_text};
use crate::status::{Status, Style};
use crate::supervise::supervise;
use resonarm::control::{ControlSpec, PhaseWalkSpec};
use resonarm::realtime::ThreadSetup;
use resonarm::recording::Existing;
use resonarm::run::{BothReport, Mode, Options, RecordTo, RunError, Session, Signals, Speed};
use resonarm::scenario::{Scenario, ScenarioError};
use resonarm_numeric::number::rounded;

/// The time for which plant and exciter wait for each other: far longer than a loaded machine delays a thread.
const PATIENCE: Duration = Duration::from_secs(30);

/// Runs plant and controller in one process, and plots a folded resonance.
///
/// The controller performs a phase-resonance test over the folded first resonance of the arm, or over that of a scenario's
/// structure, on an in-memory bus. The command records it, prints the points, and plots them over the computed branch.
/// The plant waits for the controller's answer to each sample, so the results are bit-identical on every machine,
/// however busy. With --live the result stays in the browser until Ctrl-C.
#[derive(Debug, Args)]
pub(crate) struct Demo {
    #[command(flatten)]
    structure: StructureFlags,
    /// Run loop of the plant; in real-time a machine that stalls disturbs the result.
    #[arg(long, help_heading = heading::BUS, value_parser = flags::one_of([Mode::Lockstep, Mode::RealTime], Mode::name), default_value_t = Mode::Lockstep)]
    mode: Mode,
    /// Speed in lockstep: 1 is that of the clock, 0 as fast as possible.
    #[arg(long, help_heading = heading::BUS, value_name = "X")]
    speed: Option<f64>,
    /// Folder for the results; those of an earlier demo are overwritten.
    ///
    /// The files are demo.mcap, response.svg, response.png, and its caption, response.txt.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "DIR", default_value = "resonarm-demo")]
    out: PathBuf,
    #[command(flatten)]
    live: LiveFlags,
    #[command(flatten)]
    json: JsonFlag,
}

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    plant: PlantDocument<'a>,
    /// The figure's files; none if no point was read.
    figures: Vec<PathBuf>,
    points: &'a [MeasuredPoint],
}

pub(crate) fn scenario() -> Result<Scenario, Failure> {
    Ok(Scenario::parse(include_str!("../../scenarios/demo.toml"), "scenarios/demo.toml")?)
}

impl Demo {
    pub(crate) fn scenario(&self) -> Result<Scenario, Failure> {
        self.structure.scenario_or(scenario)
    }

    /// Returns the speed of the run, in simulated seconds a second.
    pub(crate) fn speed(&self) -> Result<Speed, Failure> {
        // Deadlines pace a run in real time. Lockstep has none; it is slowed down to the clock so that the demo can
        // be watched.
        let default = if self.mode == Mode::RealTime { Speed::UNPACED } else { Speed::ACTUAL };
        Ok(self.speed.map_or(Ok(default), Speed::new).map_err(RunError::from)?)
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let mut scenario = self.scenario()?;
        let control = control(&mut scenario)?;
        // A scenario with both is rejected. The load of the excitation is already in the control.
        scenario.control = Some(control.clone());
        scenario.excitation = None;
        // The run ends with the walk.
        scenario.simulation.duration_s = None;
        let inputs = Inputs::of_scenario(self.structure.scenario.as_deref());
        let outputs = ["demo.mcap", "response.svg", "response.png", "response.txt"];
        outputs.iter().try_for_each(|name| inputs.check(&self.out.join(name)))?;
        let record = RecordTo { path: self.out.join("demo.mcap"), existing: Existing::Overwrite };
        let options = Options {
            record: Some(record),
            speed: self.speed()?,
            // In lockstep the result does not depend on punctuality, so no privileges are asked for.
            thread: (self.mode == Mode::RealTime).then(ThreadSetup::default),
            patience: Some(PATIENCE),
            ..Options::default()
        };
        let introduction = introduction(&scenario, &control, self.mode, options.speed)?;
        let session = Session::new(scenario.clone(), self.mode, options)?;
        let length = session.controller()?.length();
        // Only after the session was accepted, so that an invalid scenario leaves no empty folder.
        std::fs::create_dir_all(&self.out).map_err(Failure::write(&self.out))?;
        if !self.json.json {
            output::print(&introduction)?;
        }
        let shown_role = ShownRole::new(Role::PlantAndExciter, "a bus in memory", session.interface_of_both());
        let (session, serving) = self.live.watched(session, &shown_role)?;
        let mut status = Status::new(Style::People { every: None });
        let work = move |signals: &Signals| (session.both(signals, &mut |_| {}), signals.is_stopped());
        let (report, is_stopped) = supervise("plant", length, |line, signals| status.write(line, signals), work)?;
        let verdict = self.conclude(&scenario, &control, report?)?;
        // The demo takes less than a minute: who looks at it wants to go on looking.
        match serving {
            Some(serving) if !is_stopped => serving.show_until_stopped()?,
            _ => {}
        }
        Ok(verdict)
    }

    /// Writes the figure, prints points and report, and returns the verdict.
    fn conclude(
        &self,
        scenario: &Scenario,
        control: &ControlSpec,
        BothReport { plant, exciter }: BothReport,
    ) -> Result<Verdict, Failure> {
        let tested = scenario.under_test()?;
        let amplitude = control.amplitude();
        let points = measured_points::points(&tested, &exciter.responses);
        let computed = Drive::of_exciter(amplitude, &tested)
            .map(|drive| ComputedBranch::new(&tested.assembly, &drive, &points, None))
            .transpose()?
            .flatten();
        let figures = computed.map(|computed| {
            let conditions = captions::structure(scenario, &tested, &[]);
            let figure = computed.figure("Phase walk over the resonance", conditions, &points);
            output::draw(figure, &self.out.join("response"))
        });
        let figures = figures.transpose()?.unwrap_or_default();
        let configuration = configuration::of_scenario(scenario)?;
        let document = Document { plant: PlantDocument { configuration, report: &plant }, figures, points: &points };
        let text = || {
            let plotted = output::listed(&document.figures);
            let plotted = if plotted.is_empty() { plotted } else { format!("plot         {plotted}\n") };
            measured_points::table(&points, amplitude.unit()) + "\n" + &report_text(&plant) + &plotted
        };
        self.json.show(&document, text, &[])?;
        let complaints = [complaint(&plant), complaint_of_exciter(&exciter)];
        complaints.iter().flatten().for_each(|text| tracing::error!("{text}"));
        match plant.error.or(exciter.error) {
            Some(error) => Err(error.into()),
            None => Ok(Verdict::of(complaints.iter().all(Option::is_none) && plant.outcome.is_good())),
        }
    }
}

/// Takes the control from the scenario; without one it is a phase walk at the load of its excitation.
fn control(scenario: &mut Scenario) -> Result<ControlSpec, Failure> {
    match (scenario.control.take(), &scenario.excitation) {
        (Some(control), _) => Ok(control),
        (None, Some(spec)) => Ok(ControlSpec::PhaseWalk(PhaseWalkSpec::new(spec.amplitude))),
        (None, None) => Err(ScenarioError::NoExcitation.into()),
    }
}

/// Describes the run that is about to start.
fn introduction(scenario: &Scenario, control: &ControlSpec, mode: Mode, speed: Speed) -> Result<String, Failure> {
    let tested = scenario.under_test()?;
    let modes = tested.assembly.modes();
    let label = captions::label(scenario, &tested);
    let first = modes.first();
    let (first_hz, damping_ratio) = first.map_or((f64::NAN, f64::NAN), |mode| (mode.frequency_hz, mode.damping_ratio));
    // Time constant of a decaying mode: its envelope is exp(−ζωt), so it is 1/(ζω), with ω = 2πf.
    let settling_s = 1.0 / (core::f64::consts::TAU * first_hz * damping_ratio);
    let others: String = modes.iter().skip(1).map(|mode| format!(", {:.2} Hz", mode.frequency_hz)).collect();
    let pace = match (mode, speed.times()) {
        (Mode::RealTime, _) => String::from("in real time"),
        (_, 0.0) => String::from("in lockstep, as fast as possible"),
        (_, times) => format!("in lockstep at {times} times the speed of the clock"),
    };
    let load = control.amplitude();
    let unit = control.amplitude().unit();
    let size = libm::hypot(load.force_n.norm(), load.torque_nm.norm());
    let law = match control {
        ControlSpec::PhaseWalk(walk) => {
            let points = walk.points;
            let from = walk.from_lag_deg;
            let to = walk.to_lag_deg;
            format!("phase walk of {points} points at {size} {unit}, lags {from}° to {to}°")
        }
        ControlSpec::ForceControl(_) => format!("force control at {size} {unit}"),
        ControlSpec::ResponseControl(spec) => {
            format!("response control at {} m, {} to {} Hz", spec.displacement_m, spec.from_hz, spec.to_hz)
        }
        ControlSpec::Random(spec) => format!("random control by {}", spec.specification),
        ControlSpec::SweptSine(spec) => format!("swept-sine control by {}", spec.specification),
        ControlSpec::Shock(spec) => format!("shocks by {}", spec.specification),
    };
    Ok(format!(
        "structure    {label}\n\
         modes        {first_hz:.2} Hz (damping ratio {damping_ratio:.1e}, time constant {} s){others}\n\
         control      {law}\n\
         bus          in memory, {} samples a second, {pace}\n\n",
        rounded(&settling_s, usize::from(settling_s < 10.0)),
        scenario.simulation.rate_hz,
    ))
}
