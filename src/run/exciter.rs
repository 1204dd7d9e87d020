//! The exciter controller on a bus: answers samples as they come, in real time and in lockstep alike.

use core::time::Duration;

use super::{RunError, Signals};
use crate::bus::{Bus, Sent, Statistics};
use crate::node::{ExciterNode, Outcome, ResponsePoint};
use crate::realtime::Clock;

/// Longest sleep between two looks at the stop signal, ns.
const LOOK_NS: u64 = 20_000_000;
/// How long to wait before a full transmit queue is tried again, ns.
const RETRY_NS: u64 = 200_000;
/// How long to go on sending what is left after the end, tries.
const LAST_TRIES: u32 = 500;

/// What the exciter's work came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExciterReport {
    /// How it ended.
    pub outcome: Outcome,
    /// Samples answered, counted from the start of the profile.
    pub samples_played: u64,
    /// Samples that never came in whole.
    pub missed_samples: u64,
    /// Frames of the protocol refused for their checks.
    pub refused_frames: u64,
    /// What the bus counted.
    pub bus: Statistics,
}

/// Runs the exciter on the calling thread until its profile is played, it faults, or it is asked to stop.
///
/// # Errors
/// [`RunError::NoPlant`] if no plant was heard within `patience`, [`RunError::Bus`] if the bus failed.
pub fn exciter<C: Clock>(
    node: &mut ExciterNode,
    bus: &mut dyn Bus,
    clock: &C,
    patience: Duration,
    signals: &Signals,
    mut on_response: impl FnMut(ResponsePoint),
) -> Result<ExciterReport, RunError> {
    let start_ns = clock.now_ns();
    node.start(0);
    let outcome = loop {
        let now_ns = clock.now_ns().saturating_sub(start_ns);
        while let Some(received) = bus.receive()? {
            node.handle_frame(now_ns, &received.frame);
            // An answer must not wait for the frames behind the sample.
            transmit(node, bus)?;
        }
        if signals.is_stopped() {
            node.stop(now_ns);
        }
        node.handle_deadline(now_ns);
        let sent = transmit(node, bus)?;
        core::iter::from_fn(|| node.poll_response()).for_each(&mut on_response);
        signals.set_step(node.samples_played());
        if let Some(outcome) = node.outcome() {
            break outcome;
        }
        if !node.has_heard_plant() && u128::from(now_ns) > patience.as_nanos() {
            return Err(RunError::NoPlant { waited_s: patience.as_secs_f64() });
        }
        let due_ns = node.next_deadline_ns().saturating_sub(now_ns);
        bus.wait(Duration::from_nanos(due_ns.min(if sent { LOOK_NS } else { RETRY_NS })))?;
    };
    for _ in 0..LAST_TRIES {
        if transmit(node, bus)? {
            break;
        }
        bus.wait(Duration::from_nanos(RETRY_NS))?;
    }
    Ok(ExciterReport {
        outcome,
        samples_played: node.samples_played(),
        missed_samples: node.missed_samples(),
        refused_frames: node.refused_frames(),
        bus: bus.statistics(),
    })
}

/// Sends what there is to send; `true` if all is sent.
fn transmit(node: &mut ExciterNode, bus: &mut dyn Bus) -> Result<bool, RunError> {
    while let Some(frame) = node.next_frame() {
        if bus.send(&frame)? == Sent::QueueFull {
            return Ok(false);
        }
        node.frame_sent();
    }
    Ok(true)
}
