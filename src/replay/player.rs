//! Recorded frames back on a bus, with their timing.

use core::time::Duration;

use super::ReplayError;
use crate::bus::{Bus, Sent};
use crate::realtime::Clock;
use crate::recording::{Direction, FrameRecord, Recording};
use crate::run::Signals;

/// How long to wait before a full transmit queue is tried again.
const RETRY: Duration = Duration::from_micros(200);

/// How to play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playback {
    /// Times the recorded speed; positive.
    pub speed: f64,
    /// Only the frames that went this way; `None` plays all.
    pub direction: Option<Direction>,
}

/// What was played.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Played {
    /// Frames sent.
    pub frames: u64,
    /// Recorded time from the first frame to the last, s.
    pub recorded_s: f64,
    /// How late the latest frame was, s.
    pub latest_s: f64,
}

/// Sends the recording's frames in their order, each as long after the first as it was recorded, divided by the speed.
///
/// # Errors
/// [`ReplayError`] if the speed is impossible, the recording holds no frames, or recording or bus fail.
pub fn play<C: Clock>(
    recording: &Recording,
    bus: &mut dyn Bus,
    clock: &C,
    playback: Playback,
    signals: &Signals,
) -> Result<Played, ReplayError> {
    if !(playback.speed.is_finite() && playback.speed > 0.0) {
        return Err(ReplayError::Speed { got: playback.speed });
    }
    let mut played = Played::default();
    let mut first_ns = None;
    let start_ns = clock.now_ns();
    for record in recording.frames()? {
        let record: FrameRecord = record?;
        if playback.direction.is_some_and(|direction| direction != record.direction) {
            continue;
        }
        if signals.is_stopped() {
            break;
        }
        let recorded_ns = record.time_ns.saturating_sub(*first_ns.get_or_insert(record.time_ns));
        let due_ns = start_ns + (recorded_ns as f64 / playback.speed) as u64;
        clock.sleep_until_ns(due_ns);
        while bus.send(&record.frame)? == Sent::QueueFull {
            bus.wait(RETRY)?;
        }
        // Nobody reads here; what comes in is thrown away, so that the queue does not overflow.
        while bus.receive()?.is_some() {}
        played.frames += 1;
        played.recorded_s = recorded_ns as f64 * 1e-9;
        played.latest_s = played.latest_s.max(clock.now_ns().saturating_sub(due_ns) as f64 * 1e-9);
    }
    if played.frames == 0 { Err(ReplayError::Empty { what: "frames" }) } else { Ok(played) }
}
