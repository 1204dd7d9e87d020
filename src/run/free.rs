//! Free: plant and exciter in one loop, in virtual time, without a bus.

use super::{BusCounts, PlantSide, RunError, Signals};
use crate::bus::Received;
use crate::node::{ExciterNode, Outcome, ResponsePoint};
use crate::realtime::SampleRate;

/// What a free run came to.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeReport {
    /// Samples made.
    pub steps: u64,
    /// Frames counted between the nodes.
    pub bus: BusCounts,
    /// How the controller's work ended; `None` if the run was stopped before.
    pub outcome: Option<Outcome>,
}

/// Runs plant and exciter until the exciter has finished, `after_samples` have passed, or it is asked to stop.
///
/// The times of everything are those of the samples, so that the same scenario gives the same recording byte for byte.
///
/// # Errors
/// [`RunError`] if the simulation or the recording fails, or the nodes don't come to terms.
pub fn free(
    side: &mut PlantSide,
    exciter: &mut ExciterNode,
    rate: SampleRate,
    after_samples: Option<u64>,
    signals: &Signals,
    mut on_response: impl FnMut(ResponsePoint),
) -> Result<FreeReport, RunError> {
    let mut bus = BusCounts::default();
    side.start(0);
    exciter.start(0);
    exchange(side, exciter, 0, &mut bus)?;
    if !side.node().is_armed() {
        return Err(RunError::Stalled { plant: side.node().state(), exciter: exciter.state() });
    }
    loop {
        let step = side.plant().step();
        let now_ns = rate.offset_ns(step);
        side.measure()?;
        exchange(side, exciter, now_ns, &mut bus)?;
        core::iter::from_fn(|| exciter.poll_response()).for_each(&mut on_response);
        signals.set_step(step);
        let over = after_samples.is_some_and(|samples| step >= samples) || !side.node().is_armed();
        if over || signals.is_stopped() {
            break;
        }
        side.advance(now_ns)?;
    }
    side.finish()?;
    bus.e2e_errors = side.counts().refused_frames;
    Ok(FreeReport { steps: side.plant().step(), bus, outcome: exciter.outcome() })
}

/// Carries frames both ways until neither node has one.
fn exchange(side: &mut PlantSide, exciter: &mut ExciterNode, now_ns: u64, bus: &mut BusCounts) -> Result<(), RunError> {
    side.handle_deadline(now_ns)?;
    exciter.handle_deadline(now_ns);
    loop {
        let mut quiet = true;
        while let Some(frame) = side.next_frame(now_ns)? {
            bus.sent += 1;
            exciter.handle_frame(now_ns, &frame);
            quiet = false;
        }
        while let Some(frame) = exciter.poll_transmit() {
            bus.received += 1;
            side.take(now_ns, &Received { frame, timestamp_ns: None })?;
            quiet = false;
        }
        side.handle_deadline(now_ns)?;
        if quiet {
            return Ok(());
        }
    }
}
