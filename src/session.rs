//! The flags of a session and its report in words, for `run`, `exciter` and `demo`.

use core::time::Duration;
use std::path::PathBuf;

use clap::Args;
use rtrb::{Consumer, Producer, RingBuffer};
use serde::Serialize;
use serde_json::Value;

use crate::failure::Failure;
use crate::help::heading;
use crate::output::Inputs;
use crate::recordings::existing;
use crate::supervise::Line;
use resonarm::bus::{self, Bus, BusAddress};
use resonarm::realtime::Percentiles;
use resonarm::run::{BusCounts, BusLoss, Fault, PlantOutcome, PlantReport, RecordTo, RunEvent, Session};
use resonarm_numeric::number::short;

/// Capacity of the ring of events for standard error.
const EVENTS: usize = 256;

/// The recording of a session.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::OUTPUT)]
pub(crate) struct RecordFlags {
    /// Record everything into this MCAP file.
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Overwrite existing files.
    #[arg(long)]
    pub overwrite: bool,
}

impl RecordFlags {
    /// Returns the target of the recording, which must not replace a file that is read.
    pub fn target(&self, inputs: &Inputs) -> Result<Option<RecordTo>, Failure> {
        let Some(path) = self.record.clone() else { return Ok(None) };
        inputs.check(&path)?;
        Ok(Some(RecordTo { path, existing: existing(self.overwrite) }))
    }
}

/// Converts the value of a flag in seconds.
pub(crate) fn seconds(flag: &str, given_s: f64) -> Result<Duration, Failure> {
    Duration::try_from_secs_f64(given_s).map_err(|error| {
        Failure::usage(format!("{flag} is {}: {error}; expected a time in seconds, 0 or more", short(&given_s)))
    })
}

/// Opens the bus of a session. Unless `all` frames are recorded or shown, the kernel passes only those of the session's
/// network; other adapters may filter in software, and then lose the reports on their controller.
pub(crate) fn open_bus(address: &BusAddress, session: &Session, all: bool) -> Result<Box<dyn Bus>, Failure> {
    // The core is left first, since the adapters of python-can start threads that inherit the cores of this one.
    session.leave_core();
    let mut bus = bus::open(address)?;
    if let (false, BusAddress::SocketCan(_)) = (all, address) {
        bus.set_filters(&session.filters()?)?;
    }
    Ok(bus)
}

/// Makes a ring for a run's events, so that its loop need not wait for standard error.
pub(crate) fn event_ring() -> (Producer<RunEvent>, Consumer<RunEvent>) {
    RingBuffer::new(EVENTS)
}

/// Writes a run's events to standard error: a line each, as text or as JSON.
pub(crate) struct EventLog {
    pub events: Consumer<RunEvent>,
    pub json: bool,
    pub bus: String,
}

impl EventLog {
    /// Writes the events since the last call, above the last line.
    pub fn write(&mut self, last: &Line) {
        while let Ok(event) = self.events.pop() {
            let line = if self.json {
                serde_json::to_string(&event).ok()
            } else if tracing::enabled!(target: "resonarm::events", tracing::Level::WARN) {
                // Events in words count as warnings.
                self.words(&event)
            } else {
                None
            };
            if let Some(line) = line {
                last.note(&line);
            }
        }
    }

    fn words(&self, event: &RunEvent) -> Option<String> {
        let bus = &self.bus;
        Some(match event {
            RunEvent::Ready => format!("ready on {bus}: waiting for a controller to arm the plant"),
            RunEvent::Armed { sample } => format!("armed at sample {sample}"),
            RunEvent::Disarmed { sample } => format!("disarmed at sample {sample}"),
            RunEvent::Faulted { fault, partner: None } => in_words(fault),
            RunEvent::Faulted { fault, partner: Some(partner) } => {
                format!("{}; the exciter reported: {}", in_words(fault), in_words(partner))
            }
            RunEvent::NotArmed { fault } => format!("refused to arm: {} (detail {})", fault.name, fault.detail),
            RunEvent::BusLost { cause: BusLoss::BusOff, .. } => {
                format!("the controller of {bus} is bus-off: waiting for a while in case it comes back")
            }
            RunEvent::BusLost { cause: BusLoss::Down, .. } => {
                format!("{bus} is down: waiting for a while in case it comes back")
            }
            RunEvent::OtherSender { sample, identifier } => format!(
                "a frame of another network arrived under 0x{identifier}, which only this plant sends, at sample {sample}: \
                 {OTHER_SENDER}"
            ),
            RunEvent::BusBack { .. } => format!("{bus} is back: a controller can reset and arm the plant"),
            RunEvent::Controller { state, .. } => format!("the controller of {bus} is {}", state.name()),
            // On a machine that stalls often this would flood the log; the summary has the total.
            RunEvent::Slipped { .. } => return None,
        })
    }
}

/// The advice about another sender.
const OTHER_SENDER: &str = "two networks have the same base; give each a different one (network.base_id), or end the other program \
    that sends this plant's messages";

fn in_words(fault: &Fault) -> String {
    format!("fault {} ({}) at sample {}", fault.code, fault.name, fault.sample)
}

/// Returns the warning at the end about frames of others under this node's identifiers; `None` if there were none.
pub(crate) fn other_sender_warning(bus: &BusCounts) -> Option<String> {
    (bus.other_sender > 0).then(|| {
        format!(
            "{} frames of another network arrived under identifiers that only this node sends: {OTHER_SENDER}",
            bus.other_sender
        )
    })
}

/// States the counts of a node's frames.
pub(crate) fn frames_text(bus: &BusCounts) -> String {
    let BusCounts { received, sent, dropped, refused, other_sender, malformed, overwritten, limited_values, .. } = bus;
    let mut text = format!("{received} received, {sent} sent, {dropped} dropped, {refused} rejected");
    if *other_sender > 0 {
        text += &format!(" ({other_sender} of another network under this node's identifiers)");
    }
    if *malformed > 0 {
        text += &format!(", {malformed} malformed");
    }
    if *overwritten > 0 {
        text += &format!(", {overwritten} commands replaced by newer ones before they could act");
    }
    if *limited_values > 0 {
        text += &format!("; {limited_values} values were beyond the range of their signals, and the nearest was sent");
    }
    text
}

/// The report of a plant's run, with its arm, as JSON.
#[derive(Serialize)]
pub(crate) struct PlantDocument<'a> {
    pub configuration: Value,
    #[serde(flatten)]
    pub report: &'a PlantReport,
}

/// States a run's result in words.
pub(crate) fn report_text(report: &PlantReport) -> String {
    let mut text = format!("samples      {}, of {} integration steps", report.samples, report.steps);
    if report.slipped > 0 {
        text += &format!(", {} overruns, schedule slipped by {} periods", report.overruns, report.slipped);
    } else if report.pacing.is_none() && report.wakeup_us.is_some() {
        text += &format!(", {} overruns", report.overruns);
    }
    text.push('\n');
    if report.overruns > 0 {
        let counts = counted(&report.overrun_causes.in_words()).unwrap_or_default();
        text += &format!("overruns     {counts}\n");
    }
    if let Some(spin) = &report.spin {
        text += &format!("spinning     {spin}\n");
    }
    if let Some(pacing) = report.pacing {
        let speed = pacing.speed;
        let longest_s = pacing.longest_lag_s;
        let end_s = pacing.lag_s;
        text += &format!(
            "pacing       speed {speed}, at most {longest_s:.3} s behind the clock, {end_s:.3} s at the end\n"
        );
    }
    let latencies =
        [("wake-up", report.wakeup_us), ("execution", report.exec_us), ("round trip", report.round_trip_us)];
    for (name, latency) in latencies {
        if let Some(Percentiles { p50, p99, p99_9, p99_99, max }) = latency {
            text += &format!(
                "{name:12} p50 {p50:.1} µs, p99 {p99:.1}, p99.9 {p99_9:.1}, p99.99 {p99_99:.1}, max {max:.1}\n"
            );
        }
    }
    text += &format!("frames       {}\n", frames_text(&report.bus));
    let errors = &report.bus.errors;
    let counts = counted(&[
        ("faults on the bus", errors.protocol),
        ("not acknowledged", errors.no_ack),
        ("overflows", errors.overflow),
        ("error-warning", errors.warning),
        ("error-passive", errors.passive),
        ("bus-off", errors.bus_off),
        ("restarted", errors.restarted),
        ("of no known kind", errors.other),
    ]);
    counts.iter().for_each(|counts| text.push_str(&format!("controller   {counts}\n")));
    let refused = &report.refused;
    let reasons = counted(&[
        ("not armed", refused.not_armed),
        ("late", refused.late),
        ("out of order", refused.out_of_order),
        ("repeated", refused.repeated),
        ("out of range", refused.out_of_range),
        ("rate of change", refused.rate_of_change),
        ("travel", refused.travel),
    ]);
    reasons.iter().for_each(|reasons| text.push_str(&format!("rejected     commands: {reasons}\n")));
    for (kind, first) in [("command", &report.first_refused_command), ("frame", &report.first_refused_frame)] {
        first.iter().for_each(|first| text.push_str(&format!("             the first rejected {kind} is {first}\n")));
    }
    if let Some(summary) = &report.recording {
        let lost: u64 = summary.lost.values().sum();
        text += &format!("recording    {}, {} bytes, {lost} records lost\n", summary.path.display(), summary.bytes);
    }
    text
}

/// Lists the counts above 0 with their kinds; `None` if all are 0.
fn counted(kinds: &[(&str, u64)]) -> Option<String> {
    let some = kinds.iter().filter(|(_, count)| *count > 0).map(|(kind, count)| format!("{count} {kind}"));
    Some(some.collect::<Vec<String>>().join(", ")).filter(|text| !text.is_empty())
}

/// Says why a run failed its purpose, and what to do; `None` if it did not.
pub(crate) fn complaint(report: &PlantReport) -> Option<String> {
    let mut text = match (report.fault_text(), report.outcome) {
        (Some(text), _) => text,
        (None, PlantOutcome::NotArmed) => String::from(
            "no controller armed the plant, so nothing was simulated or played: start one on the same bus, as `resonarm exciter` with the \
             same mode and scenario; --patience-s says how long to wait",
        ),
        (None, _) => return None,
    };
    if report.overruns > 0 {
        text += &format!(
            "; this process missed {} deadlines itself (see `wake-up`): on a machine that stalls, --mode lockstep gives exact \
             results",
            report.overruns
        );
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm::protocol::Id;
    use resonarm::realtime::OverrunCauses;

    #[test]
    fn events_of_a_plant_are_in_words() {
        let (_, events) = event_ring();
        let log = EventLog { events, json: false, bus: String::from("can0") };
        let fault = |code, name| Fault { code, name, detail: 2, sample: 300 };
        let ours = fault(4, "partner fault");
        let partner = fault(2, "sensor timeout");
        let said = |event| log.words(&event).unwrap();
        insta::assert_snapshot!(said(RunEvent::Faulted { fault: ours, partner: None }), @"fault 4 (partner fault) at sample 300");
        insta::assert_snapshot!(said(RunEvent::Faulted { fault: ours, partner: Some(partner) }), @"fault 4 (partner fault) at sample 300; the exciter reported: fault 2 (sensor timeout) at sample 300");
        insta::assert_snapshot!(said(RunEvent::BusLost { sample: 7, cause: BusLoss::BusOff }), @"the controller of can0 is bus-off: waiting for a while in case it comes back");
        insta::assert_snapshot!(said(RunEvent::BusLost { sample: 7, cause: BusLoss::Down }), @"can0 is down: waiting for a while in case it comes back");
        insta::assert_snapshot!(said(RunEvent::OtherSender { sample: 7, identifier: Id::Standard(0x203) }), @"a frame of another network arrived under 0x203, which only this plant sends, at sample 7: two networks have the same base; give each a different one (network.base_id), or end the other program that sends this plant's messages");
    }

    #[test]
    fn frames_of_another_network_are_in_the_summary() {
        let bus = BusCounts { received: 30, sent: 40, refused: 7, ..BusCounts::default() };
        insta::assert_snapshot!(frames_text(&bus), @"30 received, 40 sent, 0 dropped, 7 rejected");
        assert_eq!(other_sender_warning(&bus), None);
        let bus = BusCounts { other_sender: 5, malformed: 1, ..bus };
        insta::assert_snapshot!(frames_text(&bus), @"30 received, 40 sent, 0 dropped, 7 rejected (5 of another network under this node's identifiers), 1 malformed");
        insta::assert_snapshot!(other_sender_warning(&bus).unwrap(), @"5 frames of another network arrived under identifiers that only this node sends: two networks have the same base; give each a different one (network.base_id), or end the other program that sends this plant's messages");
    }

    #[test]
    fn only_causes_above_zero_are_listed() {
        let causes = OverrunCauses { woke_late: 2, step_long: 4, bus_long: 0, stolen: 58, preempted: 1 };
        insta::assert_snapshot!(counted(&causes.in_words()).unwrap(), @"58 while the host had the core, 1 while other threads had the core, 2 woke late, 4 step long");
    }
}
