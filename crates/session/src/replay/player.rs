//! Plays recorded frames on a bus, with their timing.

use core::ops::RangeInclusive;

use super::error::{ReplayError, SPEEDS};
use crate::run::Signals;
use resonarm_bus::{Bus, Sent};
use resonarm_files::recording::{Direction, FrameRecord, Recording};
use resonarm_protocol::{Frame, FrameError, FrameFormat, Id};
use resonarm_realtime::Clock;

/// The time to wait before a full transmit queue is tried again, ns.
pub(super) const RETRY_NS: u64 = 200_000;
/// Longest sleep between two checks of the stop signal and of incoming frames, ns.
pub(super) const LOOK_NS: u64 = 20_000_000;
/// Incoming frames discarded at one check, so that a busy bus can't hold up the player.
pub(super) const FRAMES_AT_ONCE: usize = 1024;
/// Frames to play, and how to play them.
#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    /// Times the recorded speed, from 0.001 to 1000000; 0 is as fast as possible.
    pub speed: f64,
    /// Plays only the frames of this direction; `None` plays all.
    pub direction: Option<Direction>,
    /// Plays only the frames with these identifiers; all if there are none.
    pub ids: Vec<Id>,
    /// Replacements of identifiers: from, to.
    pub mapped: Vec<(Id, Id)>,
    /// Plays only the frames of these samples; `None` plays all.
    pub samples: Option<RangeInclusive<u64>>,
    /// Number of passes, a sample period apart; 0 repeats until it is stopped.
    pub times: u32,
}

impl Default for Playback {
    /// Plays everything once, at the recorded speed.
    fn default() -> Playback {
        Playback { speed: 1.0, direction: None, ids: Vec::new(), mapped: Vec::new(), samples: None, times: 1 }
    }
}

impl Playback {
    /// Returns the frame that is sent for a recorded one, if any is.
    fn frame(&self, record: &FrameRecord) -> Result<Option<Frame>, FrameError> {
        let is_wanted = self.direction.is_none_or(|direction| direction == record.direction)
            && (self.ids.is_empty() || self.ids.contains(&record.frame.id()))
            && self.samples.as_ref().is_none_or(|samples| samples.contains(&record.sample));
        if !is_wanted {
            return Ok(None);
        }
        let frame = &record.frame;
        match self.mapped.iter().find(|(from, _)| *from == frame.id()) {
            Some((_, to)) if frame.format() == FrameFormat::Remote => {
                Frame::new(*to, frame.format(), &[0; 8][..frame.len()]).map(Some)
            }
            Some((_, to)) => Frame::new(*to, frame.format(), frame.data()).map(Some),
            None => Ok(Some(*frame)),
        }
    }
}

/// Result of playing a recording's frames on a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Played {
    /// Number of frames sent.
    pub frames: u64,
    /// Recorded time from the first frame of a pass to the last, s.
    pub recorded_s: f64,
    /// The lateness of the latest frame, s; 0 at speed 0.
    pub latest_s: f64,
}

/// Sends the recording's frames in their order, each as long after the first as it was recorded, divided by the speed:
/// of a run in real time by the machine's clock, else in simulated time, where the frames of a sample come together.
///
/// # Errors
/// [`ReplayError`] if the speed is impossible, there are no such frames, an identifier can't take a frame, or recording
/// or bus fail.
pub fn play(
    recording: &Recording,
    bus: &mut dyn Bus,
    clock: &dyn Clock,
    playback: &Playback,
    signals: &Signals,
) -> Result<Played, ReplayError> {
    check_speed(playback.speed)?;
    let mut player = Player { bus, clock, signals };
    let mut played = Played::default();
    let mut start_ns = clock.now_ns();
    for pass in 1_u64.. {
        let is_last = pass == u64::from(playback.times);
        let Some(length_ns) = player.pass(recording, playback, start_ns, &mut played)? else { break };
        if is_last {
            break;
        }
        // Counted from the start of the pass and not from now, so that delays do not add up.
        start_ns = due_ns(start_ns, length_ns, playback.speed);
    }
    if played.frames == 0 && !signals.is_stopped() {
        return Err(ReplayError::Empty { what: "frames that match the selection" });
    }
    Ok(played)
}

/// Rejects a speed that can't be played.
pub(super) fn check_speed(speed: f64) -> Result<(), ReplayError> {
    if speed == 0.0 || SPEEDS.contains(&speed) { Ok(()) } else { Err(ReplayError::Speed { got: speed }) }
}

/// Returns the time at which a frame is due that was recorded so long after the first; at speed 0 at once.
pub(super) fn due_ns(start_ns: u64, recorded_ns: u64, speed: f64) -> u64 {
    if speed == 0.0 { start_ns } else { start_ns.saturating_add((recorded_ns as f64 / speed) as u64) }
}

struct Player<'a> {
    bus: &'a mut dyn Bus,
    clock: &'a dyn Clock,
    signals: &'a Signals,
}

impl Player<'_> {
    /// Plays the recording once and returns its length with the sample period behind it, ns, or `None` if there is
    /// nothing to play or a stop was requested before.
    fn pass(
        &mut self,
        recording: &Recording,
        playback: &Playback,
        start_ns: u64,
        played: &mut Played,
    ) -> Result<Option<u64>, ReplayError> {
        let origin = recording.origin();
        let mut first_ns = None;
        let mut length_ns = 0;
        for record in recording.frames()? {
            let record: FrameRecord = record?;
            let Some(frame) = playback.frame(&record)? else { continue };
            let time_ns = origin.frame_time_ns(&record);
            let recorded_ns = time_ns.saturating_sub(*first_ns.get_or_insert(time_ns));
            let due_ns = due_ns(start_ns, recorded_ns, playback.speed);
            if !self.wait_until(due_ns)? || !self.send(&frame)? {
                return Ok(None);
            }
            played.frames += 1;
            length_ns = recorded_ns.max(length_ns);
            played.recorded_s = played.recorded_s.max(recorded_ns as f64 * 1e-9);
            if playback.speed != 0.0 {
                played.latest_s = played.latest_s.max(self.clock.now_ns().saturating_sub(due_ns) as f64 * 1e-9);
            }
        }
        // A sample period is added: the next pass begins where the sample after the last would have been.
        Ok(first_ns.map(|_| length_ns.saturating_add(libm::round(origin.dt_s * 1e9) as u64)))
    }

    /// Sleeps until `due_ns`; returns `false` if a stop was requested before.
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
            // In slices, so that a request to stop is seen within one of them, and the receive queue is emptied
            // meanwhile.
            self.clock.sleep_until_ns(due_ns.min(now_ns.saturating_add(LOOK_NS)));
        }
    }

    /// Sends a frame, waiting while the queue is full; returns `false` if a stop was requested before.
    fn send(&mut self, frame: &Frame) -> Result<bool, ReplayError> {
        while self.bus.send(frame)? == Sent::QueueFull {
            if !self.wait_until(self.clock.now_ns().saturating_add(RETRY_NS))? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Discards incoming frames, so that the queue does not overflow.
    fn discard(&mut self) -> Result<(), ReplayError> {
        for _ in 0..FRAMES_AT_ONCE {
            if self.bus.receive()?.is_none() {
                break;
            }
        }
        Ok(())
    }
}
