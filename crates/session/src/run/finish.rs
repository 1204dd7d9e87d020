//! The end of a run, the same on every path: the load ramps to zero, the partner is notified, queued frames are sent.

use super::bench::Bench;
use super::error::RunError;
use super::mistakes::refused_command;
use super::pace::Pace;
use super::report::{BusCounts, Histograms, PlantOutcome, PlantReport, RefusedCommands};
use super::round_trip::RoundTrips;
use resonarm_bus::Bus;
use resonarm_protocol::EmergencyCode;
use resonarm_realtime::{Clock, OverrunCauses, PeriodicError};

/// Longest time to send the remaining frames, ns: several times the time that a full outbox takes at 125 kbit/s.
pub(super) const SEND_LIMIT_NS: u64 = 500_000_000;
/// Wait before a full transmit queue is tried again, ns.
pub(super) const RETRY_NS: u64 = 200_000;

/// Cause of the end of a run's loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EndedBy {
    /// All requested samples were made.
    Duration,
    /// The plant has left the state armed.
    Disarm,
    /// A stop was requested.
    Signal,
    /// Nobody armed the plant in time.
    Patience,
}

/// Ends a run for the cause `ended`, at the sample measured last, and returns its outcome. The first error counts.
///
/// An armed plant is disarmed, or faults if an error ends it; while its load ramps to zero samples go on at the run's
/// pace.
pub(super) fn finish<C: Clock>(
    bench: &mut Bench,
    bus: &mut dyn Bus,
    pace: &mut Pace<'_, C>,
    ended: Result<EndedBy, RunError>,
) -> (PlantOutcome, Option<RunError>) {
    let now_ns = pace.now_ns();
    match &ended {
        Ok(_) => {}
        Err(RunError::Periodic(error)) => bench.fault(now_ns, EmergencyCode::Overrun, missed(error)),
        // The partner can't be told, but the recording and the latched fault must say why the run ended.
        Err(RunError::Bus(_)) => bench.node.bus_lost(now_ns),
        // The node has faulted when the plant did.
        Err(RunError::Plant(_)) => {}
        Err(_) => bench.fail_if_armed(now_ns),
    }
    let outcome = outcome(bench, &ended);
    // Before the ramp, so that no further command acts while the load falls to zero.
    bench.node.leave(now_ns);
    let simulates = !matches!(ended, Err(RunError::Plant(_)));
    let ramped = if simulates { ramp(bench, bus, pace) } else { Ok(()) };
    bench.handle_deadline(pace.now_ns());
    bench.record_end();
    // Both are done in any case. The error that ended the run comes first, since these two usually follow from it.
    let rest = [ramped, send_rest(bench, bus, pace)];
    let mut errors = ended.err().into_iter().chain(rest.into_iter().filter_map(Result::err));
    match errors.next() {
        Some(error) => (PlantOutcome::Failed, Some(error)),
        None => (outcome, None),
    }
}

fn missed(error: &PeriodicError) -> u64 {
    match error {
        PeriodicError::Overrun { missed, .. } => u64::from(*missed),
        PeriodicError::TooFarBehind { .. } => u64::from(u16::MAX),
    }
}

pub(super) fn outcome(bench: &Bench, ended: &Result<EndedBy, RunError>) -> PlantOutcome {
    let nothing_done = !bench.was_armed() && bench.sample() == 0;
    match ended {
        Err(_) => PlantOutcome::Failed,
        Ok(_) if bench.node.latched_fault().is_some() => PlantOutcome::Faulted,
        Ok(EndedBy::Patience) => PlantOutcome::NotArmed,
        Ok(_) if nothing_done => PlantOutcome::NotArmed,
        Ok(EndedBy::Duration) => PlantOutcome::Completed,
        Ok(EndedBy::Disarm) => PlantOutcome::Disarmed,
        Ok(EndedBy::Signal) => PlantOutcome::Stopped,
    }
}

/// Continues until the load is zero, even if the bus fails: the first of its errors is returned at the end.
fn ramp<C: Clock>(bench: &mut Bench, bus: &mut dyn Bus, pace: &mut Pace<'_, C>) -> Result<(), RunError> {
    // The ramp is paced from now on: a run that was late must not catch up while its load falls.
    pace.anchor(bench.sample());
    let mut failed = Ok(());
    while bench.node.is_ramping() {
        bench.advance(pace.now_ns())?;
        pace.sleep(bench.sample());
        let now_ns = pace.now_ns();
        failed = failed.and(bench.receive(now_ns, bus));
        bench.handle_deadline(now_ns);
        if let Err(error) = bench.measure() {
            bench.fail_if_armed(now_ns);
            return Err(error);
        }
        failed = failed.and(bench.transmit(now_ns, bus).map(drop));
    }
    failed
}

/// Sends the remaining frames.
fn send_rest<C: Clock>(bench: &mut Bench, bus: &mut dyn Bus, pace: &Pace<'_, C>) -> Result<(), RunError> {
    let end_ns = pace.now_ns() + SEND_LIMIT_NS;
    while !bench.transmit(pace.now_ns(), bus)? && pace.now_ns() < end_ns {
        pace.clock.sleep_until_ns(pace.clock.now_ns() + RETRY_NS);
    }
    Ok(())
}

impl PlantReport {
    /// Makes the report of a run of `bench`, without its timing.
    pub(super) fn new(bench: &Bench, bus: BusCounts, outcome: PlantOutcome, error: Option<RunError>) -> PlantReport {
        let emergency = bench.node.latched_fault();
        PlantReport {
            outcome,
            fault: emergency.as_ref().map(|found| bench.fault_found(found)),
            emergency,
            cause: bench.node.fault_cause(),
            partner_fault: bench.node.fault_reason(),
            partner: bench.node.fault_reason().map(|reason| bench.fault_found(&reason)),
            bus_loss: bench.bus_loss,
            error,
            samples: bench.samples,
            steps: bench.steps(),
            overruns: 0,
            overrun_causes: OverrunCauses::default(),
            slipped: 0,
            thread: None,
            spin: None,
            histograms: Histograms::default(),
            wakeup_us: None,
            exec_us: None,
            round_trip_us: bench.round_trips.as_ref().and_then(RoundTrips::percentiles),
            pacing: None,
            bus,
            refused: RefusedCommands::from(bench.node.refusals()),
            first_refused_command: bench.node.refusals().first_load().map(|of| refused_command(&of, &bench.plant)),
            first_refused_frame: None,
            recording: None,
        }
    }
}
