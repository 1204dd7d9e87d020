//! `resonarm run`: the plant on a bus.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use super::exciter::warn_of_wire;
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::latency_figure::{self, LatencyCurve, LatencyPlotFlag};
use crate::flags::{self, SessionFlags, SpinFlag, ThreadFlags};
use crate::help::heading;
use crate::live::{LiveFlags, Role, ShownRole, SteerFlag};
use crate::output::{Inputs, JsonFlag};
use crate::recordings::wait_for_reader;
use crate::responses::{self, ResponseDocument};
use crate::session::{
    EventLog, PlantDocument, RecordFlags, complaint, event_ring, open_bus, other_sender_warning, report_text, seconds,
};
use crate::status::{Status, StatusFlag, Style};
use crate::supervise::{Line, supervise};
use resonarm::bus::BusAddress;
use resonarm::control::{Length, TestReport};
use resonarm::node::ExciterOutcome;
use resonarm::realtime::OverrunPolicy;
use resonarm::run::{
    ExciterEnd, ExciterReport, Mode, Options, PlantOutcome, PlantReport, RunError, Session, Signals, Speed,
};
use resonarm::scenario::{Scenario, WireSection};
use resonarm_figures::plot::Color;

/// Runs the plant: the simulated arm with its sensors, as a node on a CAN bus.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Run {
    /// CAN bus, as vcan0, can0, python-can:interface=I,channel=C; not for --mode free.
    #[arg(long, help_heading = heading::BUS, value_name = "BUS")]
    bus: Option<String>,
    /// Run loop of the plant.
    ///
    /// `real-time` takes samples at deadlines of the clock. `lockstep` waits for the command that answers each sample.
    /// `free` runs the plant and the exciter of the scenario in one loop, without a bus.
    #[arg(long, help_heading = heading::BUS, value_parser = flags::one_of(Mode::ALL, Mode::name), default_value_t)]
    mode: Mode,
    #[command(flatten)]
    session: SessionFlags,
    /// Speed in lockstep and free: 1 is that of the clock, 0 as fast as possible.
    #[arg(long, help_heading = heading::BUS, value_name = "X", default_value_t = 0.0)]
    speed: f64,
    #[command(flatten)]
    record: RecordFlags,
    /// End when the controller disarms the plant, or the armed plant faults.
    #[arg(long, help_heading = heading::BUS)]
    stop_on_disarm: bool,
    /// Longest wait for a controller to arm the plant, s [default: without end].
    #[arg(long, help_heading = heading::BUS, value_name = "S")]
    patience_s: Option<f64>,
    /// Reaction to a missed deadline in real time.
    ///
    /// `slip` runs up to three overdue samples late, and shifts the schedule if it is further behind. `continue` runs all
    /// overdue samples late. `fault` does the same, and puts the plant into fault. `stop` ends the run.
    #[arg(long, help_heading = heading::BUS, value_name = "POLICY", default_value_t, value_parser = flags::ByName(OverrunPolicy::ALL, OverrunPolicy::name), hide_short_help = true)]
    overrun: OverrunPolicy,
    #[command(flatten)]
    thread: ThreadFlags,
    #[command(flatten)]
    spin: SpinFlag,
    #[command(flatten)]
    plot: LatencyPlotFlag,
    #[command(flatten)]
    live: LiveFlags,
    #[command(flatten)]
    steer: SteerFlag,
    #[command(flatten)]
    status: StatusFlag,
    #[command(flatten)]
    json: JsonFlag,
    /// Write events to standard error as JSON, one object a line.
    ///
    /// Events are ready, armed, disarmed, faulted, slipped and others.
    #[arg(long, help_heading = heading::OUTPUT, hide_short_help = true)]
    json_events: bool,
}

const EXAMPLES: &str = "\
Examples:
  resonarm run --bus vcan0 --record run.mcap
  resonarm run --bus vcan0 --mode lockstep --scenario bench.toml
  resonarm run --mode free --scenario bench.toml --json";

type Result<T> = core::result::Result<T, Failure>;

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    plant: PlantDocument<'a>,
    /// The end of the exciter, in a free run.
    #[serde(skip_serializing_if = "Option::is_none")]
    exciter: Option<ExciterEnd>,
    /// The responses that the exciter read.
    #[serde(skip_serializing_if = "Option::is_none")]
    responses: Option<Vec<ResponseDocument>>,
    /// State of the exciter's test at the end, if it controls one.
    #[serde(skip_serializing_if = "Option::is_none")]
    test: Option<&'a TestReport>,
}

/// Returns the default scenario; that of a free run includes an excitation.
pub(crate) fn default_scenario(mode: Mode) -> Result<Scenario> {
    if mode == Mode::Free { crate::commands::exciter::scenario() } else { Ok(Scenario::default()) }
}

impl Run {
    pub(crate) fn scenario(&self) -> Result<Scenario> {
        self.session.scenario_or(|| default_scenario(self.mode))
    }

    pub fn execute(&self) -> Result<Verdict> {
        let inputs = Inputs::of_scenario(self.session.structure.scenario.as_deref());
        let options = Options {
            record: self.record.target(&inputs)?,
            speed: Speed::new(self.speed).map_err(RunError::from)?,
            overrun: self.overrun,
            spin: self.spin.spin,
            // Without deadlines of the clock a thread needs neither a core nor a priority of its own.
            thread: if self.mode == Mode::RealTime { self.thread.setup()? } else { None },
            on_shortfall: self.thread.on_shortfall(),
            end_on_disarm: self.stop_on_disarm,
            patience: self.patience_s.map(|given_s| seconds("--patience-s", given_s)).transpose()?,
            ..Options::default()
        };
        self.plot.check(self.record.overwrite, &inputs)?;
        let session = Session::new(self.scenario()?, self.mode, options)?;
        if let (Mode::Free, Some(stem)) = (self.mode, &self.plot.plot) {
            return Err(Failure::usage(format!(
                "--plot {} draws how late samples were, but a run in the mode free has no schedule: use --mode \
                 real-time or lockstep",
                stem.display()
            )));
        }
        let _reader = self.record.record.as_deref().map(wait_for_reader).transpose()?;
        match self.mode {
            Mode::Free => self.run_free(session),
            Mode::RealTime | Mode::Lockstep => self.run_on_bus(session),
        }
    }

    fn run_on_bus(&self, session: Session) -> Result<Verdict> {
        let Some(bus) = &self.bus else {
            return Err(Failure::usage(format!(
                "--bus is missing: the mode {} needs a bus; give one, as --bus vcan0, or use --mode free",
                self.mode
            )));
        };
        if self.steer.steer {
            return Err(Failure::usage(format!(
                "--steer is for --mode free; in the mode {} steer the exciter on the bus: `resonarm exciter --live --steer`",
                self.mode
            )));
        }
        let configuration = configuration::of_scenario(session.scenario())?;
        for lack in session.scenario().wire.iter().flat_map(WireSection::lacks) {
            tracing::warn!("[wire] {lack}");
        }
        let arming = session.scenario().wire.as_ref().map(WireSection::arming);
        let address: BusAddress = bus.parse()?;
        let mut bus = open_bus(&address, &session, self.record.record.is_some() || self.live.live.is_some())?;
        let shown_role = ShownRole::new(Role::Plant, address.to_string(), bus.name());
        let shown_role = ShownRole { json: self.json_events, ..shown_role };
        let (session, _serving) = self.live.watched(session, &shown_role)?;
        let (mut event_sender, events) = event_ring();
        let mut log = EventLog { events, json: self.json_events, bus: address.to_string() };
        let length = session.scenario().duration_samples()?.map_or(Length::Unknown, Length::Samples);
        let mut status = self.status()?;
        let on_tick = |line: &mut Line, signals: &Signals| {
            log.write(line);
            status.write(line, signals);
        };
        let work = move |signals: &Signals| {
            // If the ring is full, events are missing from the log, but not from the recording.
            let mut report = session.plant(bus.as_mut(), signals, &mut |event| _ = event_sender.push(event))?;
            // The bus is closed in any case. An error of the run takes precedence over one on closing.
            report.error = report.error.take().or(bus.close().err().map(RunError::from));
            Ok::<_, RunError>(report)
        };
        let report = supervise("plant", length, on_tick, work)??;
        // A user protocol has its own way to arm, so the general advice of `complaint` is not enough.
        if let (PlantOutcome::NotArmed, Some(arming)) = (report.outcome, arming) {
            tracing::error!("[wire] the plant was not armed: expected {arming}, but no such frame was received");
        }
        self.conclude(configuration, report, None)
    }

    fn run_free(&self, session: Session) -> Result<Verdict> {
        if self.bus.is_some() {
            return Err(RunError::FreeHasNoBus.into());
        }
        let configuration = configuration::of_scenario(session.scenario())?;
        let converter = session.scenario().rig.converter;
        let (session, steered) = self.steer.steered(session, converter)?;
        warn_of_wire(&session)?;
        let length = match session.scenario().duration_samples()? {
            Some(samples) => Length::Samples(samples),
            None => session.controller()?.length(),
        };
        let shown_role = ShownRole::new(Role::PlantAndExciter, "a virtual bus", session.interface_of_both());
        let shown_role = ShownRole { json: self.json_events, steered, ..shown_role };
        let (session, _serving) = self.live.watched(session, &shown_role)?;
        let mut status = self.status()?;
        let work = move |signals: &Signals| session.both(signals, &mut |_| {});
        let report = supervise("plant", length, |line, signals| status.write(line, signals), work)??;
        self.conclude(configuration, report.plant, Some(&report.exciter))
    }

    fn status(&self) -> Result<Status> {
        match (self.json_events, self.status.every()?) {
            (false, every) => Ok(Status::new(Style::People { every })),
            (true, None) => Ok(Status::new(Style::Off)),
            // Lines of text between the JSON objects would break every parser of the events.
            (true, Some(_)) => {
                Err(Failure::usage("--status-s and --json-events both write to standard error: give one of them"))
            }
        }
    }

    /// Draws the latencies of a run with a schedule.
    fn draw(stem: &Path, report: &PlantReport) -> Result<Vec<PathBuf>> {
        let latency =
            [("late", Color::Blue, &report.histograms.wakeup), ("work", Color::Vermillion, &report.histograms.exec)];
        let curves = latency.into_iter().filter_map(|(name, color, histogram)| {
            histogram.as_ref().map(|histogram| LatencyCurve { name, color, counted: vec![histogram] })
        });
        let thread = report.thread.as_ref().map_or(String::from("an ordinary thread"), ToString::to_string);
        let subtitle = format!("{} samples, {} overruns, {thread}", report.samples, report.overruns);
        latency_figure::write(stem, &subtitle, &[(None, curves.collect())])
    }

    /// Prints the report, however the run ended; then reports what went wrong.
    fn conclude(&self, configuration: Value, report: PlantReport, exciter: Option<&ExciterReport>) -> Result<Verdict> {
        let drawn = self.plot.plot.as_deref().map(|stem| Self::draw(stem, &report)).transpose()?;
        let document = Document {
            plant: PlantDocument { configuration, report: &report },
            exciter: exciter.map(ExciterEnd::from),
            responses: exciter.map(|report| responses::documents(&report.responses)),
            test: exciter.and_then(|report| report.test.as_ref()),
        };
        let read = || {
            exciter.map_or(String::new(), |report| {
                report.test.as_ref().map_or(String::new(), responses::test_text) + &responses::table(&report.responses)
            })
        };
        self.json.show(&document, || report_text(&report) + &read(), &drawn.unwrap_or_default())?;
        // With a duration the plant may leave before the excitation is over: no complaint.
        let complaints = [
            complaint(&report),
            exciter
                .filter(|report| report.outcome != Some(ExciterOutcome::PlantLeft))
                .and_then(crate::commands::exciter::complaint),
        ];
        other_sender_warning(&report.bus).iter().for_each(|text| tracing::warn!("{text}"));
        complaints.iter().flatten().for_each(|text| tracing::error!("{text}"));
        match report.error {
            Some(error) => Err(error.into()),
            None => Ok(Verdict::of(complaints.iter().all(Option::is_none) && report.outcome.is_good())),
        }
    }
}
