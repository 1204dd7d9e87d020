//! `resonarm exciter`: the emulated exciter controller on a bus.

use core::fmt::Write;
use std::sync::Arc;

use clap::Args;
use serde::Serialize;

use super::failure::{Failure, Verdict};
use super::flags::{SessionFlags, ThreadFlags};
use super::output;
use super::session::{mode_parser, seconds};
use super::supervise::supervise;
use crate::bus::{self, BusAddress};
use crate::excitation::Phasor;
use crate::node::{Outcome, ResponsePoint};
use crate::run::{BusCounts, ExciterReport, Fault, Mode, Options, RunError, Session, Signals, fault_text};

/// Runs the exciter controller: arms the plant, plays the scenario's excitation, reads the responses, disarms. Without
/// --scenario it plays the demo's stepped sine.
#[derive(Debug, Args)]
pub(super) struct Exciter {
    /// The bus: vcan0, can0, python-can:interface=I,channel=C.
    #[arg(long, value_name = "BUS")]
    bus: String,
    /// How the plant runs; in lockstep both ends wait longer for each other.
    #[arg(long, value_parser = mode_parser(&[Mode::RealTime, Mode::Lockstep]), default_value_t)]
    mode: Mode,
    #[command(flatten)]
    session: SessionFlags,
    #[command(flatten)]
    thread: ThreadFlags,
    /// How long to wait until there is a plant and it is armed, s.
    #[arg(long, value_name = "S", default_value_t = 10.0, allow_hyphen_values = true)]
    patience_s: f64,
    /// How often to begin anew after a fault: reset and arm the plant, and play the excitation from its start.
    #[arg(long, value_name = "N", default_value_t = 0)]
    rearm: u32,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// A response as JSON: phasors against the drive's phase as [in phase, in quadrature], for x and y.
#[derive(Serialize)]
pub(super) struct ResponseDocument {
    frequency_hz: f64,
    head_force_n: [[f64; 2]; 2],
    acceleration_b_m_s2: [[f64; 2]; 2],
    acceleration_c_m_s2: [[f64; 2]; 2],
    drift: f64,
    settled: bool,
    clipped: bool,
}

#[derive(Serialize)]
struct Document {
    outcome: &'static str,
    fault: Option<Fault>,
    error: Option<String>,
    samples_played: u64,
    missed_samples: u64,
    slipped_periods: u64,
    rearmed: u32,
    bus: BusCounts,
    responses: Vec<ResponseDocument>,
}

impl From<&ResponsePoint> for ResponseDocument {
    fn from(point: &ResponsePoint) -> ResponseDocument {
        let pair = |phasors: [Phasor; 2]| phasors.map(|phasor| [phasor.re, phasor.im]);
        ResponseDocument {
            frequency_hz: point.frequency_hz,
            head_force_n: pair(point.head_force_n),
            acceleration_b_m_s2: pair(point.acceleration_b_m_s2),
            acceleration_c_m_s2: pair(point.acceleration_c_m_s2),
            drift: point.drift,
            settled: point.is_settled(),
            clipped: point.clipped,
        }
    }
}

impl Exciter {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let address: BusAddress = self.bus.parse()?;
        let scenario = self.session.scenario(super::demo::scenario)?;
        let options = Options {
            thread: if self.mode == Mode::RealTime { Some(self.thread.setup()?) } else { None },
            patience: Some(seconds("--patience-s", self.patience_s)?),
            rearm: self.rearm,
            ..Options::default()
        };
        let session = Session::new(scenario, self.mode, options)?;
        let samples = session.scenario().profile()?.samples();
        let mut bus = bus::open(&address)?;
        let signals = Arc::new(Signals::default());
        let watched = Arc::clone(&signals);
        let report = supervise(
            "exciter",
            &signals,
            Some(samples),
            || {},
            move || {
                let report = session.exciter(bus.as_mut(), &watched)?;
                let error = report.error.or(bus.close().err().map(RunError::from));
                Ok::<_, RunError>(ExciterReport { error, ..report })
            },
        )??;
        self.print(&report)?;
        let complaint = complaint(&report);
        complaint.iter().for_each(|text| tracing::error!("{text}"));
        match report.error {
            Some(error) => Err(error.into()),
            None => Ok(Verdict::of(complaint.is_none())),
        }
    }

    fn print(&self, report: &ExciterReport) -> Result<(), Failure> {
        let outcome = outcome(report);
        if self.json {
            return output::print_json(&Document {
                outcome,
                fault: report.fault().map(Fault::from),
                error: report.error.as_ref().map(RunError::to_string),
                samples_played: report.samples_played,
                missed_samples: report.missed_samples,
                slipped_periods: report.slipped_periods,
                rearmed: report.rearmed,
                bus: report.bus,
                responses: report.responses.iter().map(ResponseDocument::from).collect(),
            });
        }
        let mut text = format!(
            "{outcome} after {} samples, {} missed; {} frames received, {} sent, {} dropped, {} refused\n",
            report.samples_played,
            report.missed_samples,
            report.bus.received,
            report.bus.sent,
            report.bus.dropped,
            report.bus.e2e_errors
        );
        if !report.responses.is_empty() {
            text.push_str("\n  frequency   head force   B            C            drift\n");
        }
        for point in &report.responses {
            let _infallible = writeln!(
                text,
                "  {:7.3} Hz {:8.3} N {:8.2} m/s² {:8.2} m/s² {:7.3} {}",
                point.frequency_hz,
                magnitude(&point.head_force_n),
                magnitude(&point.acceleration_b_m_s2),
                magnitude(&point.acceleration_c_m_s2),
                point.drift,
                if point.clipped {
                    "clipped"
                } else if point.is_settled() {
                    ""
                } else {
                    "not settled"
                }
            );
        }
        output::print(&text)
    }
}

/// How it ended, in a word.
fn outcome(report: &ExciterReport) -> &'static str {
    match report.outcome {
        _ if report.error.is_some() => "failed",
        Some(Outcome::Finished) => "finished",
        Some(Outcome::Faulted(_)) => "faulted",
        Some(Outcome::PlantLeft) => "plant-left",
        Some(Outcome::Stopped) | None => "stopped",
    }
}

/// Why the exciter did not do what it was for, and what to do; `None` if it did, or an error says so.
fn complaint(report: &ExciterReport) -> Option<String> {
    match (report.fault(), report.outcome) {
        (Some(emergency), _) => Some(fault_text(emergency)),
        (None, Some(Outcome::PlantLeft)) => Some(String::from("the plant left the bus before the excitation was over")),
        (None, Some(Outcome::Stopped)) if report.samples_played == 0 => {
            Some(String::from("stopped before the plant was armed, so nothing was played"))
        }
        _ => None,
    }
}

/// √(|x|² + |y|²): the size of a vector of phasors.
pub(super) fn magnitude(phasors: &[Phasor; 2]) -> f64 {
    (phasors[0].norm_sqr() + phasors[1].norm_sqr()).sqrt()
}
