//! Reports of a run: how plant and exciter ended, and what was measured and counted on the way.

use core::fmt::Write;

use serde::{Serialize, Serializer};

use super::error::RunError;
use super::fault::Fault;
use super::mistakes::first_such_sample;
use super::pace::Pacing;
use super::signals::{BusLoss, Signals};
use resonarm_bench::control::{ResponsePoint, TestReport};
use resonarm_bench::node::{self, FaultCause, FrameCounts, Refusals, Unheeded};
use resonarm_bus::{ControllerErrors, Statistics};
use resonarm_files::recording::Summary;
use resonarm_protocol::{Emergency, EmergencyCode, Refusal, Trip};
use resonarm_realtime::{LatencyHistogram, OverrunCauses, Percentiles, SpinChoice, ThreadReport};

/// The outcome of a plant's run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlantOutcome {
    /// Its duration has passed.
    Completed,
    /// The controller disarmed the plant.
    Disarmed,
    /// It was asked to stop.
    Stopped,
    /// No controller armed the plant within the patience, or before it was stopped without a single sample.
    NotArmed,
    /// A fault was latched at the end.
    Faulted,
    /// An error ended it.
    Failed,
}

impl PlantOutcome {
    /// Says whether the run achieved its purpose.
    pub const fn is_good(self) -> bool {
        matches!(self, PlantOutcome::Completed | PlantOutcome::Disarmed | PlantOutcome::Stopped)
    }
}

/// Report of a plant's run. As JSON it is the document of `resonarm run --json`, which adds the arm as
/// `configuration`.
#[derive(Debug, Serialize)]
pub struct PlantReport {
    /// The outcome of the run.
    pub outcome: PlantOutcome,
    /// The fault that was latched at the end, if one was.
    pub fault: Option<Fault>,
    /// The emergency message of that fault, as the protocol encodes it.
    #[serde(skip)]
    pub emergency: Option<Emergency>,
    /// The mistake of the controller that caused the fault, where the plant knows it.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "as_cause")]
    pub cause: Option<FaultCause>,
    /// The fault that the exciter reported, where that is the reason of the fault.
    #[serde(skip)]
    pub partner_fault: Option<Emergency>,
    /// The exciter's fault as numbers and by name.
    #[serde(rename = "partner_fault")]
    pub partner: Option<Fault>,
    /// The cause of the last loss of the bus.
    pub bus_loss: Option<BusLoss>,
    /// Error that ended the run early, if one did.
    #[serde(serialize_with = "as_text")]
    pub error: Option<RunError>,
    /// Samples measured: samples 0 to `samples` − 1.
    pub samples: u64,
    /// Number of integration steps made.
    pub steps: u64,
    /// Real time: deadlines missed.
    pub overruns: u64,
    /// Missed deadlines by cause.
    pub overrun_causes: OverrunCauses,
    /// Real time: sample periods by which the schedule moved.
    pub slipped: u64,
    /// Thread settings that the operating system granted; `None` if none were requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thread: Option<ThreadReport>,
    /// Real time: how long the loop busy-waits before a deadline; `None` if it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spin: Option<SpinChoice>,
    /// Delays of the samples, µs; `None` without a schedule, as in simulated time as fast as possible.
    pub wakeup_us: Option<Percentiles>,
    /// Execution times of the samples, µs.
    pub exec_us: Option<Percentiles>,
    /// Histograms of these two, where a loop has a schedule.
    #[serde(skip)]
    pub histograms: Histograms,
    /// Real time: the time from the sending of a sample to the kernel's time stamp of the command that echoes its
    /// index, µs; `None` where the bus has no time stamps, and without commands.
    pub round_trip_us: Option<Percentiles>,
    /// Simulated time: how it kept up with the clock, if a speed was requested.
    pub pacing: Option<Pacing>,
    /// Counts of the bus and of the protocol's checks.
    pub bus: BusCounts,
    /// Valid commands that did not reach the arm, by reason.
    pub refused: RefusedCommands,
    /// The first command that was rejected for its load, with the limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_refused_command: Option<String>,
    /// The first frame that was rejected in a check, with the reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_refused_frame: Option<String>,
    /// The recording, if there is one.
    #[serde(serialize_with = "as_path")]
    pub recording: Option<Summary>,
}

impl PlantReport {
    /// Returns the fault that was latched at the end in words, with its cause and remedy.
    pub fn fault_text(&self) -> Option<String> {
        let emergency = self.emergency.as_ref()?;
        let text = fault_text(emergency, self.cause.as_ref(), self.partner_fault.as_ref(), self.bus_loss);
        let sample = self.fault.map_or_else(|| emergency.sample.into(), |fault| fault.sample);
        Some(at_full_sample(text, emergency, sample))
    }
}

/// Latencies of all samples of a run.
#[derive(Clone, Debug, Default)]
pub struct Histograms {
    /// Delays of the samples.
    pub wakeup: Option<LatencyHistogram>,
    /// Execution times of the samples.
    pub exec: Option<LatencyHistogram>,
}

/// Report of an exciter's run.
#[derive(Debug)]
pub struct ExciterReport {
    /// Outcome of the exciter's work; `None` if an error ended it.
    pub outcome: Option<node::ExciterOutcome>,
    /// The fault that the plant reported, where that is the reason of the exciter's missed samples.
    pub partner_fault: Option<Emergency>,
    /// The cause of the last loss of the bus.
    pub bus_loss: Option<BusLoss>,
    /// The mistake of the controller that caused a fault, where it is known.
    pub cause: Option<String>,
    /// The first frame that was rejected in a check, with the reason.
    pub first_refused_frame: Option<String>,
    /// Error that ended the run early, if one did.
    pub error: Option<RunError>,
    /// Samples answered, counted from the start of the profile.
    pub samples_played: u64,
    /// Samples that never arrived whole.
    pub missed_samples: u64,
    /// Sample periods by which the plant reported its schedule to have moved.
    pub slipped_periods: u64,
    /// Number of restarts after a fault.
    pub rearmed: u32,
    /// Counts of the bus and of the protocol's checks.
    pub bus: BusCounts,
    /// Responses that the controller has read.
    pub responses: Vec<ResponsePoint>,
    /// State of the test at the end, if the controller controls one.
    pub test: Option<TestReport>,
}

impl ExciterReport {
    /// Returns the fault that ended it, if one did.
    pub fn fault(&self) -> Option<&Emergency> {
        match &self.outcome {
            Some(node::ExciterOutcome::Faulted(emergency)) => Some(emergency),
            _ => None,
        }
    }

    /// Returns the full index of the sample that a fault states modulo 65536: an exciter counts samples from arming,
    /// and the plant from its start.
    fn full_sample(&self, emergency: &Emergency) -> u64 {
        first_such_sample(emergency.sample, self.samples_played.saturating_sub(1))
    }

    /// Returns a fault as numbers and by name.
    pub fn found(&self, emergency: &Emergency) -> Fault {
        Fault::at(emergency, self.full_sample(emergency))
    }

    /// Returns the fault that ended it in words, with its cause and remedy.
    pub fn fault_text(&self) -> Option<String> {
        let fault = self.fault()?;
        let text = fault_text(fault, None, self.partner_fault.as_ref(), self.bus_loss);
        let mut text = at_full_sample(text, fault, self.full_sample(fault));
        let mut causes: Vec<String> = self.cause.iter().cloned().collect();
        let is_of_partner = matches!(fault.code, EmergencyCode::PartnerFault | EmergencyCode::SensorTimeout);
        if let Some(first) = self.first_refused_frame.as_ref().filter(|_| is_of_partner) {
            causes.push(format!("{} frames were rejected, the first of them {first}", self.bus.refused));
        }
        if !causes.is_empty() {
            // Causes stand before the remedy, which ends the sentence.
            let place = text.find(REMEDY).unwrap_or(text.len());
            text.insert_str(place, &format!(": {}", causes.join("; ")));
        }
        Some(text)
    }
}

/// Text between the description of a fault and its remedy.
const REMEDY: &str = "; to fix it: ";

/// Replaces the sample modulo 65536 in the text of a fault by its full index.
fn at_full_sample(text: String, emergency: &Emergency, sample: u64) -> String {
    let stated = format!("at sample {}", emergency.sample);
    // Only in the first place: the fault of a partner, which may follow, states its own sample.
    if sample == u64::from(emergency.sample) { text } else { text.replacen(&stated, &format!("at sample {sample}"), 1) }
}

/// Reports of a run with both ends in one process.
#[derive(Debug)]
pub struct BothReport {
    /// Report of the plant's end of the bus.
    pub plant: PlantReport,
    /// Report of the exciter's end of the bus.
    pub exciter: ExciterReport,
}

impl BothReport {
    /// Returns how the exciter ended: if these signals requested a stop, it was stopped, although the exciter itself
    /// knows only that the plant has left.
    pub fn exciter_outcome(&self, signals: &Signals) -> Option<node::ExciterOutcome> {
        match self.exciter.outcome {
            Some(node::ExciterOutcome::PlantLeft) if signals.is_stopped() => Some(node::ExciterOutcome::Stopped),
            outcome => outcome,
        }
    }
}

/// Describes a fault and its remedy, with the node's knowledge of the cause; where `partner` reported the reason, its
/// fault and remedy.
pub fn fault_text(
    emergency: &Emergency,
    cause: Option<&FaultCause>,
    partner: Option<&Emergency>,
    bus_loss: Option<BusLoss>,
) -> String {
    let mut text = match cause {
        Some(stop @ FaultCause::Stop { .. }) => format!("{stop}, at sample {}", emergency.sample),
        Some(FaultCause::Unheeded(unheeded)) => format!("fault of the {emergency}: {unheeded}"),
        None => format!("fault of the {emergency}"),
    };
    if let Some(said) = partner {
        let _infallible = write!(text, ", because of the {said}");
    }
    let is_bus_off = emergency.code == EmergencyCode::BusLoss && bus_loss == Some(BusLoss::BusOff);
    if is_bus_off {
        text.push_str(", since its controller was bus-off");
    }
    // The plant says why it rejected commands, which is the reason of both.
    let remedy = match (emergency.code, partner) {
        _ if is_bus_off => {
            "check the bit rate, the wiring and the two terminations of 120 Ω, since there were too many transmit errors"
        }
        (EmergencyCode::PartnerFault, Some(said)) if said.code == EmergencyCode::PartnerFault => {
            "check the bus for bit errors and for a second plant: neither end has faulted by itself, but the exciter heard a heartbeat of this plant \
                 with the state fault or boot-up, which the plant did not send. A heartbeat has no checksum"
        }
        (EmergencyCode::PartnerFault | EmergencyCode::SensorTimeout, Some(said)) => remedy(said),
        _ => match cause {
            Some(FaultCause::Unheeded(Unheeded { frames: 1.., .. })) => {
                "correct the frames of the controller: `resonarm protocol decode` says why each frame is rejected"
            }
            Some(FaultCause::Unheeded(_)) => "let the controller send that message before its commands",
            Some(FaultCause::Stop { .. }) | None => remedy(emergency),
        },
    };
    let _infallible = write!(text, "{REMEDY}{remedy}");
    text
}

/// Returns the remedy for a fault.
fn remedy(emergency: &Emergency) -> &'static str {
    match emergency.code {
        EmergencyCode::CommandTimeout => match Refusal::from_detail(emergency.detail).1 {
            Some(Refusal::OutOfRange) => "lower the excitation, or raise rig.exciter's limits",
            Some(Refusal::RateOfChange) => {
                "lower the excitation or its frequency, lengthen its ramp, or raise rig.gate's limits of the rate of change"
            }
            _ => {
                "the controller was delayed or has ended: give it a core of its own, raise network.command_timeout_s (on a user protocol the message's timeout_s), or \
             use --mode lockstep, where time waits"
            }
        },
        EmergencyCode::SensorTimeout | EmergencyCode::HeartbeatLost => {
            "the partner or the bus has failed: check whether it still runs; raise network.partner_timeout_s if it was delayed"
        }
        EmergencyCode::PartnerFault => {
            "see the partner's report. If it names no other fault than this one, a heartbeat was corrupted, which has no \
             checksum: look for bit errors on the bus, and for a second node that sends heartbeats"
        }
        EmergencyCode::Incompatible => "start both ends with the same scenario and the same version",
        EmergencyCode::CommandOutOfRange => "lower the excitation's amplitude",
        EmergencyCode::SimulationFailed => {
            "lower the excitation: the load is beyond what the arm can be integrated for"
        }
        EmergencyCode::Overrun => "lower the rate, give the loop a core of its own, or use --overrun slip",
        EmergencyCode::BusLoss => "check whether the interface is up: `ip -details link show` shows its state",
        EmergencyCode::SampleSequence => "check whether two plants are on this bus",
        EmergencyCode::SecondSender => {
            "end the other node, or give this network another base and other node ids (network.base_id, network.plant_id, \
             network.exciter_id)"
        }
        EmergencyCode::ExciterTripped if Trip::from_detail(emergency.detail) == Some(Trip::Travel) => {
            "lower the excitation, or raise rig.gate.travel_limit_m"
        }
        EmergencyCode::ExciterTripped => {
            "lower the excitation, or use a larger shaker: the plant's own message names the limit"
        }
        EmergencyCode::StopRequested => "end the request to stop, then reset and arm the plant",
        EmergencyCode::ScheduleSlipped | EmergencyCode::Leaving => "this is no fault",
    }
}

/// Counts of valid commands that did not reach the arm, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RefusedCommands {
    /// The plant was not armed.
    pub not_armed: u64,
    /// The answered sample was too old, or still in the future.
    pub late: u64,
    /// An older sample was answered after a newer one.
    pub out_of_order: u64,
    /// The sample was answered already.
    pub repeated: u64,
    /// The load was beyond the exciter's limits.
    pub out_of_range: u64,
    /// The load changed too fast.
    pub rate_of_change: u64,
    /// The plant was beyond its travel limit.
    pub travel: u64,
}

impl From<&Refusals> for RefusedCommands {
    fn from(refusals: &Refusals) -> RefusedCommands {
        RefusedCommands {
            not_armed: refusals.count(Refusal::NotArmed),
            late: refusals.count(Refusal::Late),
            out_of_order: refusals.count(Refusal::OutOfOrder),
            repeated: refusals.count(Refusal::Repeated),
            out_of_range: refusals.count(Refusal::OutOfRange),
            rate_of_change: refusals.count(Refusal::RateOfChange),
            travel: refusals.count(Refusal::Travel),
        }
    }
}

/// Counts of the bus and of the protocol's checks, in frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct BusCounts {
    /// Number of frames received.
    pub received: u64,
    /// Number of frames sent.
    pub sent: u64,
    /// Frames lost: incoming ones because the receive queue was full, outgoing ones because they could not be sent in
    /// time.
    pub dropped: u64,
    /// Frames of the protocol that were rejected: for their format, length or values, or, where the protocol protects
    /// them, for their checksum or counter.
    pub refused: u64,
    /// Rejected frames under identifiers that only this node sends: another network has the same base.
    pub other_sender: u64,
    /// Received frames that are malformed: of a length that CAN FD does not have.
    pub malformed: u64,
    /// Commands of a user protocol that newer ones replaced before they could act; left out of documents if there are
    /// none.
    #[serde(skip_serializing_if = "is_zero")]
    pub overwritten: u64,
    /// Values beyond the range of a user protocol's signal, so that the nearest value was sent; left out of documents
    /// if there are none.
    #[serde(skip_serializing_if = "is_zero")]
    pub limited_values: u64,
    /// Errors that the controller reported, on SocketCAN.
    pub errors: ControllerErrors,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

impl BusCounts {
    pub(super) fn new(statistics: Statistics, frames: FrameCounts) -> BusCounts {
        BusCounts {
            received: statistics.received,
            sent: statistics.sent,
            dropped: statistics.dropped + frames.unsent,
            refused: frames.refused,
            other_sender: frames.other_sender,
            malformed: statistics.malformed,
            overwritten: frames.overwritten,
            limited_values: frames.limited_values,
            errors: statistics.errors,
        }
    }
}

fn as_cause<S: Serializer>(cause: &Option<FaultCause>, serializer: S) -> Result<S::Ok, S::Error> {
    cause.as_ref().map(FaultCause::to_string).serialize(serializer)
}

fn as_text<S: Serializer>(error: &Option<RunError>, serializer: S) -> Result<S::Ok, S::Error> {
    error.as_ref().map(RunError::to_string).serialize(serializer)
}

fn as_path<S: Serializer>(summary: &Option<Summary>, serializer: S) -> Result<S::Ok, S::Error> {
    summary.as_ref().map(|summary| summary.path.as_path()).serialize(serializer)
}
