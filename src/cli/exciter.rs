//! `resonarm exciter`: the emulated exciter controller on a bus.

use core::fmt::Write;
use core::time::Duration;
use std::sync::Arc;

use clap::Args;
use serde::Serialize;

use super::failure::{Failure, Verdict};
use super::flags::{Mode, SessionFlags, ThreadFlags, become_real_time};
use super::output;
use super::supervise::supervise;
use crate::bus::{self, BusAddress};
use crate::excitation::Phasor;
use crate::node::{ExciterNode, Outcome, ResponsePoint};
use crate::protocol::{Emergency, EmergencyCode, Mismatch, Node};
use crate::realtime::SystemClock;
use crate::run::{ExciterReport, Signals, exciter};

/// Runs the exciter controller: arms the plant, plays the scenario's excitation, reads the responses, disarms.
#[derive(Debug, Args)]
pub(super) struct Exciter {
    /// The bus: vcan0, can0, python-can:interface=I,channel=C.
    #[arg(long, value_name = "BUS")]
    bus: String,
    /// How the plant runs; in lockstep both ends wait longer for each other.
    #[arg(long, value_enum, default_value_t)]
    mode: Mode,
    #[command(flatten)]
    session: SessionFlags,
    #[command(flatten)]
    thread: ThreadFlags,
    /// How long to wait for a plant, s.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    patience_s: f64,
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
    fault: Option<String>,
    samples_played: u64,
    missed_samples: u64,
    bus: BusDocument,
    responses: Vec<ResponseDocument>,
}

#[derive(Serialize)]
struct BusDocument {
    received: u64,
    sent: u64,
    dropped: u64,
    e2e_errors: u64,
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
        let mut scenario = self.session.scenario(super::demo::scenario)?;
        if scenario.excitation.is_none() {
            scenario.excitation = super::demo::scenario()?.excitation;
        }
        let timing = match self.mode {
            Mode::RealTime => scenario.real_time_timing()?,
            Mode::Lockstep => scenario.lockstep_timing()?,
            Mode::Free => {
                return Err(Failure::Usage(String::from("--mode free has no bus: it is a mode of `resonarm run`")));
            }
        };
        let patience = Duration::try_from_secs_f64(self.patience_s)
            .map_err(|error| Failure::Usage(format!("--patience-s is {}: {error}", self.patience_s)))?;
        let profile = scenario.profile()?;
        let samples = profile.samples();
        let mut node = ExciterNode::new(scenario.network()?, scenario.wire_rate_hz()?, timing, profile);
        let setup = self.thread.setup()?;
        let real_time = self.mode == Mode::RealTime;
        let mut bus = bus::open(&address)?;
        let signals = Arc::new(Signals::default());
        let watched = Arc::clone(&signals);
        let (report, responses) = supervise("exciter", &signals, Some(samples), move || {
            if real_time {
                become_real_time(&setup);
            }
            let mut responses = Vec::new();
            let keep = |point| responses.push(point);
            let report = exciter(&mut node, bus.as_mut(), &SystemClock, patience, &watched, keep);
            let closed = bus.close();
            report.and_then(|report| closed.map(|()| (report, responses)).map_err(Into::into))
        })??;
        self.print(&report, &responses)?;
        if let Outcome::Faulted(emergency) = report.outcome {
            tracing::error!("{}", fault_text(&emergency));
        }
        Ok(Verdict::of(!matches!(report.outcome, Outcome::Faulted(_))))
    }

    fn print(&self, report: &ExciterReport, responses: &[ResponsePoint]) -> Result<(), Failure> {
        let (outcome, fault) = match &report.outcome {
            Outcome::Finished => ("finished", None),
            Outcome::Stopped => ("stopped", None),
            Outcome::PlantLeft => ("plant-left", None),
            Outcome::Faulted(emergency) => ("faulted", Some(fault_text(emergency))),
        };
        if self.json {
            return output::print_json(&Document {
                outcome,
                fault,
                samples_played: report.samples_played,
                missed_samples: report.missed_samples,
                bus: BusDocument {
                    received: report.bus.received,
                    sent: report.bus.sent,
                    dropped: report.bus.dropped,
                    e2e_errors: report.refused_frames,
                },
                responses: responses.iter().map(ResponseDocument::from).collect(),
            });
        }
        let mut text = format!(
            "{outcome} after {} samples, {} missed; {} frames received, {} sent, {} dropped, {} refused\n",
            report.samples_played,
            report.missed_samples,
            report.bus.received,
            report.bus.sent,
            report.bus.dropped,
            report.refused_frames
        );
        if !responses.is_empty() {
            text.push_str("\n  frequency   head force   B            C            drift\n");
        }
        for point in responses {
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

/// √(|x|² + |y|²): the size of a vector of phasors.
pub(super) fn magnitude(phasors: &[Phasor; 2]) -> f64 {
    (phasors[0].norm_sqr() + phasors[1].norm_sqr()).sqrt()
}

/// A fault in words, with the way to mend it where there is one.
pub(super) fn fault_text(emergency: &Emergency) -> String {
    let node = match emergency.node {
        Node::Plant => "the plant",
        Node::Exciter => "the exciter",
    };
    let mismatch = Mismatch::from_detail(emergency.detail).filter(|_| emergency.code == EmergencyCode::Incompatible);
    match mismatch {
        Some(mismatch) => {
            format!("{node} faulted: {}: {mismatch}; start both ends with the same scenario", emergency.code)
        }
        None => {
            format!("{node} faulted: {} (detail {}, sample {})", emergency.code, emergency.detail, emergency.sample)
        }
    }
}
