//! Recorded frames back on a bus, with their timing.

use core::ops::RangeInclusive;

use super::ReplayError;
use crate::bus::{Bus, Sent};
use crate::protocol::Frame;
use crate::realtime::Clock;
use crate::recording::{Direction, FrameRecord, Recording};
use crate::run::Signals;

/// How long to wait before a full transmit queue is tried again, ns.
const RETRY_NS: u64 = 200_000;
/// Longest sleep between two looks at the stop signal and at what came in, ns.
const LOOK_NS: u64 = 20_000_000;
/// Incoming frames thrown away at one look, so that a busy bus can't hold up the player.
const FRAMES_AT_ONCE: usize = 1024;
/// Speeds that are played, times the recorded one; and 0, as fast as it goes.
pub(super) const SPEEDS: RangeInclusive<f64> = 1e-3..=1e6;

/// How to play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playback {
    /// Times the recorded speed, from 0.001 to 1000000; 0 is as fast as it goes.
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

/// Sends the recording's frames in their order, each as long after the first as it was recorded, divided by the speed:
/// of a run in real time by the machine's clock, else in simulated time, where the frames of a sample come together.
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
    let Playback { speed, direction } = playback;
    if speed != 0.0 && !SPEEDS.contains(&speed) {
        return Err(ReplayError::Speed { got: speed });
    }
    let mut played = Played::default();
    let mut first_ns = None;
    let start_ns = clock.now_ns();
    for record in recording.frames()? {
        let record: FrameRecord = record?;
        if direction.is_some_and(|direction| direction != record.direction) {
            continue;
        }
        let time_ns = recording.origin().frame_time_ns(&record);
        let recorded_ns = time_ns.saturating_sub(*first_ns.get_or_insert(time_ns));
        let due_ns = match speed {
            0.0 => clock.now_ns(),
            speed => start_ns.saturating_add((recorded_ns as f64 / speed) as u64),
        };
        let mut player = Player { bus, clock, signals };
        if !player.wait_until(due_ns)? || !player.send(&record.frame)? {
            return Ok(played);
        }
        played.frames += 1;
        played.recorded_s = recorded_ns as f64 * 1e-9;
        played.latest_s = played.latest_s.max(clock.now_ns().saturating_sub(due_ns) as f64 * 1e-9);
    }
    if played.frames == 0 { Err(ReplayError::Empty { what: "frames" }) } else { Ok(played) }
}

struct Player<'a, C> {
    bus: &'a mut dyn Bus,
    clock: &'a C,
    signals: &'a Signals,
}

impl<C: Clock> Player<'_, C> {
    /// Sleeps until `due_ns`; `false` if it was asked to stop before.
    fn wait_until(&mut self, due_ns: u64) -> Result<bool, ReplayError> {
        loop {
            self.discard()?;
            if self.signals.is_stopped() {
                return Ok(false);
            }
            let now_ns = self.clock.now_ns();
            if now_ns >= due_ns {
                return Ok(true);
            }
            self.clock.sleep_until_ns(due_ns.min(now_ns.saturating_add(LOOK_NS)));
        }
    }

    /// Sends a frame, waiting while the queue is full; `false` if it was asked to stop before.
    fn send(&mut self, frame: &Frame) -> Result<bool, ReplayError> {
        while self.bus.send(frame)? == Sent::QueueFull {
            if !self.wait_until(self.clock.now_ns().saturating_add(RETRY_NS))? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Nobody reads here; what comes in is thrown away, so that the queue does not overflow.
    fn discard(&mut self) -> Result<(), ReplayError> {
        for _ in 0..FRAMES_AT_ONCE {
            if self.bus.receive()?.is_none() {
                break;
            }
        }
        Ok(())
    }
}
