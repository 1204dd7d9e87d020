//! `resonarm exciter`: the emulated exciter controller on a bus.

use clap::Args;
use serde::Serialize;

use crate::failure::{Failure, Verdict};
use crate::flags::{self, SessionFlags, ThreadFlags};
use crate::help::heading;
use crate::live::{LiveFlags, Role, ShownRole, SteerFlag};
use crate::numbers;
use crate::output::JsonFlag;
use crate::responses::{self, ResponseDocument};
use crate::session::{frames_text, open_bus, other_sender_warning, seconds};
use crate::status::{Status, StatusFlag, Style};
use crate::supervise::supervise;
use resonarm::bus::BusAddress;
use resonarm::control::TestReport;
use resonarm::node::ExciterOutcome;
use resonarm::rig::Converter;
use resonarm::run::{BusCounts, BusLoss, ExciterEnd, ExciterReport, Fault, Mode, Options, RunError, Session, Signals};
use resonarm::scenario::Scenario;

/// Runs the emulated exciter controller on a CAN bus, as the partner of `run`.
///
/// It arms the plant, plays the scenario's excitation or closes its control loop, reads the responses, and disarms the
/// plant. Without --scenario it plays a stepped sine below the first resonance.
#[derive(Debug, Args)]
pub(crate) struct Exciter {
    /// CAN bus, as vcan0, can0, python-can:interface=I,channel=C.
    #[arg(long, help_heading = heading::BUS, value_name = "BUS")]
    bus: String,
    /// Mode in which the plant runs; in lockstep both ends wait longer for each other.
    #[arg(long, help_heading = heading::BUS, value_parser = flags::one_of([Mode::RealTime, Mode::Lockstep], Mode::name), default_value_t)]
    mode: Mode,
    #[command(flatten)]
    session: SessionFlags,
    #[command(flatten)]
    thread: ThreadFlags,
    /// How long to wait for a plant that can be armed, s.
    #[arg(long, help_heading = heading::BUS, value_name = "S", default_value_t = 10.0)]
    patience_s: f64,
    /// How often to restart after a fault.
    ///
    /// A restart resets and arms the plant, and begins from the start.
    #[arg(long, help_heading = heading::BUS, value_name = "N", default_value_t = 0, value_parser = numbers::integer(0..=u32::MAX))]
    rearm: u32,
    #[command(flatten)]
    live: LiveFlags,
    #[command(flatten)]
    steer: SteerFlag,
    #[command(flatten)]
    status: StatusFlag,
    #[command(flatten)]
    json: JsonFlag,
}

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    end: ExciterEnd,
    fault: Option<Fault>,
    partner_fault: Option<Fault>,
    bus_loss: Option<BusLoss>,
    /// The first frame that was rejected for its checks, with the reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    first_refused_frame: Option<&'a str>,
    error: Option<String>,
    samples_played: u64,
    missed_samples: u64,
    slipped_periods: u64,
    rearmed: u32,
    bus: BusCounts,
    /// The converter for which readings were corrected; none if they are as received.
    plant_converter: Option<Converter>,
    responses: Vec<ResponseDocument>,
    /// State of the test at the end, if a test is controlled.
    #[serde(skip_serializing_if = "Option::is_none")]
    test: Option<&'a TestReport>,
}

/// Returns the default scenario: a stepped sine below the first resonance.
pub(crate) fn scenario() -> Result<Scenario, Failure> {
    Ok(Scenario::parse(include_str!("../../scenarios/bench.toml"), "scenarios/bench.toml")?)
}

impl Exciter {
    pub(crate) fn scenario(&self) -> Result<Scenario, Failure> {
        self.session.scenario_or(scenario)
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.session.refuse_duration("the exciter ends with what it plays")?;
        let address: BusAddress = self.bus.parse()?;
        let scenario = self.scenario()?;
        let options = Options {
            thread: if self.mode == Mode::RealTime { self.thread.setup()? } else { None },
            on_shortfall: self.thread.on_shortfall(),
            patience: Some(seconds("--patience-s", self.patience_s)?),
            rearm: self.rearm,
            ..Options::default()
        };
        let session = Session::new(scenario, self.mode, options)?;
        // Taken before the session moves into the work.
        let plant_converter = session.scenario().network.plant_converter;
        let partner_converter = session.scenario().partner_converter();
        let (session, steered) = self.steer.steered(session, partner_converter)?;
        let length = session.controller()?.length();
        warn_of_wire(&session)?;
        let mut bus = open_bus(&address, &session, self.live.live.is_some())?;
        let shown_role = ShownRole { steered, ..ShownRole::new(Role::Exciter, address.to_string(), bus.name()) };
        let (session, _serving) = self.live.watched(session, &shown_role)?;
        let mut status = Status::new(Style::People { every: self.status.every()? });
        let work = move |signals: &Signals| {
            let mut report = session.exciter(bus.as_mut(), signals)?;
            // The argument of `or` is evaluated in any case, so the bus is always closed. An error of the run takes
            // precedence, since one on closing is usually its consequence.
            report.error = report.error.take().or(bus.close().err().map(RunError::from));
            Ok::<_, RunError>(report)
        };
        let report = supervise("exciter", length, |line, signals| status.write(line, signals), work)??;
        self.print(&report, plant_converter)?;
        other_sender_warning(&report.bus).iter().for_each(|text| tracing::warn!("{text}"));
        let complaint = complaint(&report);
        complaint.iter().for_each(|text| tracing::error!("{text}"));
        match report.error {
            Some(error) => Err(error.into()),
            None => Ok(Verdict::of(complaint.is_none())),
        }
    }

    fn print(&self, report: &ExciterReport, plant_converter: Option<Converter>) -> Result<Verdict, Failure> {
        let document = Document {
            end: ExciterEnd::from(report),
            fault: report.fault().map(|fault| report.found(fault)),
            partner_fault: report.partner_fault.as_ref().map(|fault| report.found(fault)),
            first_refused_frame: report.first_refused_frame.as_deref(),
            bus_loss: report.bus_loss,
            error: report.error.as_ref().map(RunError::to_string),
            samples_played: report.samples_played,
            missed_samples: report.missed_samples,
            slipped_periods: report.slipped_periods,
            rearmed: report.rearmed,
            bus: report.bus,
            plant_converter,
            responses: responses::documents(&report.responses),
            test: report.test.as_ref(),
        };
        let Document { end: ExciterEnd { outcome, .. }, samples_played, missed_samples, bus, .. } = &document;
        let text = || {
            let frames = frames_text(bus);
            let readings = match plant_converter {
                Some(converter) => format!("corrected for the plant's converter, {}", converter.name()),
                None => String::from("as received, since network.plant_converter does not state the plant's converter"),
            };
            let readings =
                if report.responses.is_empty() { String::new() } else { format!("readings are {readings}\n") };
            let refused = report.first_refused_frame.as_ref();
            let refused = refused.map_or(String::new(), |first| format!("the first rejected frame is {first}\n"));
            format!(
                "{outcome} after {samples_played} samples, {missed_samples} missed; frames: {frames}\n{refused}{readings}"
            ) + &report.test.as_ref().map_or(String::new(), responses::test_text)
                + &responses::table(&report.responses)
        };
        self.json.show(&document, text, &[])
    }
}

/// Warns of the facts that the exciter can't know on the scenario's user protocol.
pub(crate) fn warn_of_wire(session: &Session) -> Result<(), Failure> {
    session.exciter_remarks()?.iter().for_each(|remark| tracing::warn!("[wire] {remark}"));
    Ok(())
}

/// Says why the exciter did not complete its task, and what to do; `None` if it did, or if the report has an error.
pub(crate) fn complaint(report: &ExciterReport) -> Option<String> {
    match report.outcome {
        Some(ExciterOutcome::Stopped) if report.samples_played == 0 => {
            Some(String::from("stopped before the plant was armed, so nothing was played"))
        }
        _ => ExciterEnd::of_controller(report).reason,
    }
}
