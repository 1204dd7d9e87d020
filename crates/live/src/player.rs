//! Plays a recording: its records in the order of their samples, at the speed of the clock or another.
//!
//! A recording is always at some sample, playing or not: that sample is shown, with those before it in the plots.

use std::collections::BTreeMap;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use super::branches::lower_priority;
use super::message::{PlayerOrder, PlayerStatus};
use super::model::SHOWN_S;
use super::source::{Played, Player, Source};
use crate::error::LiveError;
use resonarm_bench::control::ResponsePoint;
use resonarm_files::recording::{Record, Recording, RecordingError, Records, TickRecord};
use resonarm_realtime::{Clock, SystemClock};
use resonarm_session::replay::timed_responses;

/// Interval of looking at the clock.
const LOOK: Duration = Duration::from_millis(15);
/// Number of samples beyond the sample shown that the file is read ahead: topics are interleaved by batches.
const AHEAD: u64 = 2048;
/// Reduction of the threads' share of processor time against others (nice(2)).
const NICE: i32 = 10;

/// Settings with which a recording is played.
#[derive(Clone, Copy, Debug)]
pub struct Play {
    /// Recorded seconds per second, within [`SPEEDS`](super::message::SPEEDS).
    pub speed: f64,
    /// Number of times that the recording is played from beginning to end, where it then stays; `None` forever.
    pub times: Option<u32>,
    /// Whether it stays at its first sample until the first viewer comes.
    pub wait: bool,
}

/// Starts to play a recording; the threads end when the source is dropped.
///
/// # Errors
/// [`LiveError::Thread`] if a thread can't be started.
pub fn play(recording: Recording, play: Play) -> Result<Source, LiveError> {
    let (played, receiver) = mpsc::channel();
    let (orders, ordered) = mpsc::channel();
    let (read, responses) = mpsc::channel();
    let for_responses = recording.clone();
    spawn("live-responses", move || {
        match timed_responses(&for_responses) {
            // They are not needed after the player has ended.
            Ok(found) => drop(read.send(found)),
            Err(error) => tracing::info!("the responses of the recording are not shown: {error}"),
        }
    })?;
    let playing = Playing::new(recording, play, played, responses);
    spawn("live-player", move || playing.run(&ordered))?;
    Ok(Source::Recording(Player { played: receiver, orders, waits: play.wait }))
}

fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), LiveError> {
    let work = || {
        lower_priority(NICE);
        work();
    };
    thread::Builder::new().name(name.to_owned()).spawn(work).map(drop).map_err(LiveError::Thread)
}

struct Playing {
    recording: Recording,
    rate_hz: f64,
    /// The first and the last sample; of a recording of frames alone the last is unknown, and very large.
    first: u64,
    last: u64,
    /// Number of times that the recording is still to be played from its beginning, this time included.
    times: Option<u32>,
    /// The records still to read; `None` at the end.
    records: Option<Records<Record<String>>>,
    /// Records read but not yet due, by sample.
    ahead: BTreeMap<u64, Vec<Record<String>>>,
    newest_read: u64,
    /// The sample that is shown, and the fraction by which the clock is beyond it.
    position: f64,
    /// All before this sample has been sent.
    sent_to: u64,
    is_playing: bool,
    speed: f64,
    played: mpsc::Sender<Played>,
    responses: Vec<(u64, ResponsePoint)>,
    reading: mpsc::Receiver<Vec<(u64, ResponsePoint)>>,
}

/// The receiver has gone.
#[derive(Debug)]
struct Gone;

impl Playing {
    fn new(
        recording: Recording,
        play: Play,
        played: mpsc::Sender<Played>,
        reading: mpsc::Receiver<Vec<(u64, ResponsePoint)>>,
    ) -> Playing {
        let (first, last) = recording.summary().samples.unwrap_or((0, u64::MAX));
        Playing {
            rate_hz: 1.0 / recording.origin().dt_s,
            first,
            last,
            times: play.times,
            recording,
            records: None,
            ahead: BTreeMap::new(),
            newest_read: 0,
            position: 0.0,
            sent_to: 0,
            is_playing: !play.wait,
            speed: play.speed,
            played,
            responses: Vec::new(),
            reading,
        }
    }

    fn run(mut self, orders: &mpsc::Receiver<PlayerOrder>) {
        let mut looked_ns = SystemClock.now_ns();
        // The first sample is shown even if nobody has asked to play.
        let mut going = self.seek(self.first).and_then(|()| self.send_status());
        while going.is_ok() {
            let order = orders.recv_timeout(LOOK);
            let now_ns = SystemClock.now_ns();
            if self.is_playing {
                self.position += (now_ns - looked_ns) as f64 * 1e-9 * self.speed * self.rate_hz;
            }
            looked_ns = now_ns;
            going = match order {
                Ok(order) => self.carry_out(core::iter::once(order).chain(orders.try_iter())),
                Err(RecvTimeoutError::Timeout) => self.advance(),
                Err(RecvTimeoutError::Disconnected) => Err(Gone),
            };
        }
    }

    fn send(&self, played: Played) -> Result<(), Gone> {
        self.played.send(played).map_err(|_nobody| Gone)
    }

    fn send_status(&self) -> Result<(), Gone> {
        self.send(Played::Status(PlayerStatus { playing: self.is_playing, speed: self.speed, sample: self.shown() }))
    }

    /// The sample that is shown.
    fn shown(&self) -> u64 {
        self.sent_to.saturating_sub(1).min(self.last)
    }

    /// Carries out pending orders. Of several jumps only the last is made, so that dragging the time bar over a long
    /// recording waits for only one.
    fn carry_out(&mut self, orders: impl Iterator<Item = PlayerOrder>) -> Result<(), Gone> {
        let mut wanted = None;
        for order in orders {
            match order {
                PlayerOrder::Play => {
                    // At the end, to play means from the beginning.
                    if wanted.unwrap_or(self.shown()) >= self.last || self.is_at_end() {
                        wanted = Some(self.first);
                    }
                    self.is_playing = true;
                }
                PlayerOrder::Pause => self.is_playing = false,
                PlayerOrder::Speed { times } => self.speed = times,
                // The conversion ends at the largest number, and at 0 below, and the sample is limited to the recording
                // below.
                PlayerOrder::Seek { time_s } => wanted = Some((time_s * self.rate_hz).round() as u64),
                PlayerOrder::Step { samples } => {
                    self.is_playing = false;
                    // From where an order before it leads, which is not reached yet: several quick steps add up.
                    wanted = Some(wanted.unwrap_or(self.shown()).saturating_add_signed(samples));
                }
            }
        }
        match wanted.map(|sample| sample.clamp(self.first, self.last)) {
            // A short way ahead is read on. A jump reads the file from its beginning, for the events before.
            Some(sample) if (self.shown()..=self.shown() + self.kept()).contains(&sample) => {
                self.position = sample as f64;
            }
            Some(sample) => self.seek(sample)?,
            None => {}
        }
        self.advance()?;
        self.send_status()
    }

    fn is_at_end(&self) -> bool {
        self.records.is_none() && self.ahead.is_empty()
    }

    /// Number of samples that the plots over time show.
    fn kept(&self) -> u64 {
        (SHOWN_S * self.rate_hz) as u64
    }

    /// Continues at a sample, with those before it in the plots. Earlier events and missed deadlines are sent, too:
    /// they give the node's state and the deadlines missed so far.
    fn seek(&mut self, sample: u64) -> Result<(), Gone> {
        self.ahead.clear();
        self.newest_read = 0;
        self.records = self.recording.records().inspect_err(log_error).ok();
        let records = self.take_due(sample + 1, sample.saturating_sub(self.kept()));
        self.position = sample as f64;
        self.sent_to = sample + 1;
        self.send(Played::Moved { sample: self.shown(), records })?;
        self.take_responses(0)
    }

    /// Sends the records that are due.
    fn advance(&mut self) -> Result<(), Gone> {
        let due = self.position as u64 + 1;
        if due > self.sent_to {
            let records = self.take_due(due, 0);
            let from = core::mem::replace(&mut self.sent_to, due);
            self.send(Played::Records { sample: self.shown(), records })?;
            self.take_responses(from)?;
        }
        if self.is_playing && self.is_at_end() { self.end() } else { Ok(()) }
    }

    /// Starts over as often as wanted; then stays at the end.
    fn end(&mut self) -> Result<(), Gone> {
        self.times = self.times.map(|times| times.saturating_sub(1));
        if self.times != Some(0) {
            return self.seek(self.first);
        }
        // An order to play plays it once more.
        self.is_playing = false;
        self.times = Some(1);
        self.position = self.shown() as f64;
        self.send_status()
    }

    /// The records before sample `due` not yet sent, if they are of samples from `from` on, or give the node's state or
    /// missed deadlines. Reads ahead to well beyond `due`.
    fn take_due(&mut self, due: u64, from: u64) -> Vec<Record<String>> {
        let mut records = Vec::new();
        while self.newest_read <= due + AHEAD {
            let Some(next) = self.records.as_mut().and_then(Iterator::next) else {
                self.records = None;
                break;
            };
            match next.inspect_err(log_error) {
                Ok(record) if record.sample() >= from => {
                    self.newest_read = self.newest_read.max(record.sample());
                    self.ahead.entry(record.sample()).or_default().push(record);
                }
                Ok(record @ (Record::Event(_) | Record::Tick(TickRecord { overruns: 1.., .. }))) => {
                    records.push(record)
                }
                Ok(_) => {}
                Err(_) => self.records = None,
            }
        }
        // `split_off` leaves what is due in `ahead`; the rest takes its place.
        let later = self.ahead.split_off(&due);
        records.extend(core::mem::replace(&mut self.ahead, later).into_values().flatten());
        records
    }

    /// Sends the responses read from sample `from` on and before the sample that is due; all before it if they have
    /// arrived only now.
    fn take_responses(&mut self, from: u64) -> Result<(), Gone> {
        let new = self.reading.try_iter().last();
        let from = if new.is_some() { 0 } else { from };
        self.responses = new.unwrap_or_else(|| core::mem::take(&mut self.responses));
        let due = self.responses.iter().filter(|(sample, _)| (from..self.sent_to).contains(sample));
        due.map(|(_, response)| *response).try_for_each(|response| self.send(Played::Response(Box::new(response))))
    }
}

fn log_error(error: &RecordingError) {
    tracing::error!("can't read the rest of the recording: {error}");
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONCE: Play = Play { speed: 1.0, times: Some(1), wait: false };
    /// The last sample of the recording, at 1 kHz.
    const LAST: u64 = 900;

    /// A player of a recording, at its first sample, and the receiver of what it sends.
    fn playing(play: Play) -> (Playing, mpsc::Receiver<Played>) {
        let recording = Recording::open("../../recordings/lockstep-dwell.mcap").unwrap();
        let (played, receiver) = mpsc::channel();
        let (_read, responses) = mpsc::channel();
        let mut playing = Playing::new(recording, play, played, responses);
        playing.seek(0).unwrap();
        (playing, receiver)
    }

    /// Whether there was a jump, the samples with readings, and the sample shown last; from the last jump on.
    fn received(receiver: &mpsc::Receiver<Played>) -> (bool, Vec<u64>, Option<u64>) {
        let mut has_moved = false;
        let mut samples = Vec::new();
        let mut shown = None;
        for played in receiver.try_iter() {
            if matches!(played, Played::Moved { .. }) {
                has_moved = true;
                samples = Vec::new();
            }
            if let Played::Moved { sample, records } | Played::Records { sample, records } = played {
                shown = Some(sample);
                samples.extend(records.iter().filter(|one| matches!(one, Record::Sample(_))).map(Record::sample));
            }
        }
        (has_moved, samples, shown)
    }

    fn status(of: &mpsc::Receiver<Played>) -> Option<PlayerStatus> {
        let status = |played| if let Played::Status(status) = played { Some(status) } else { None };
        of.try_iter().filter_map(status).last()
    }

    fn range(first: u64, last: u64) -> Vec<u64> {
        (first..=last).collect()
    }

    #[test]
    fn a_paused_recording_shows_the_sample_it_is_set_to_and_those_before() {
        let (mut playing, receiver) = playing(Play { wait: true, ..ONCE });
        assert_eq!(received(&receiver), (true, vec![0], Some(0)));
        playing.carry_out([PlayerOrder::Seek { time_s: 0.3 }].into_iter()).unwrap();
        assert_eq!(
            received(&receiver),
            (false, range(1, 300), Some(300)),
            "the samples that follow are sent without a jump"
        );
        playing.carry_out([PlayerOrder::Seek { time_s: 0.1 }].into_iter()).unwrap();
        assert_eq!(received(&receiver), (true, range(0, 100), Some(100)));
        let seeks = [0.2, 0.05, 0.4].map(|time_s| PlayerOrder::Seek { time_s });
        playing.carry_out(seeks.into_iter()).unwrap();
        assert_eq!(received(&receiver), (false, range(101, 400), Some(400)), "only the last of several jumps is made");
        assert!(!playing.is_playing);
    }

    #[test]
    fn a_step_pauses_and_moves_on_or_back_within_the_recording() {
        let (mut playing, receiver) = playing(ONCE);
        let mut step = |samples| {
            playing.carry_out([PlayerOrder::Step { samples }].into_iter()).unwrap();
            let sent: Vec<Played> = receiver.try_iter().collect();
            match sent.last() {
                Some(Played::Status(PlayerStatus { playing: false, sample, .. })) => *sample,
                _ => panic!("no status"),
            }
        };
        // Also by far more than the recording is long, which must neither overflow nor leave it.
        let steps = [1, 1, -1, 500, -500, -1, i64::MAX, 1, -1, i64::MIN];
        assert_eq!(steps.map(&mut step), [1, 2, 1, 501, 1, 0, LAST, LAST, LAST - 1, 0]);
    }

    #[test]
    fn a_recording_stays_at_its_end_and_plays_again_on_request() {
        let (mut playing, receiver) = playing(ONCE);
        playing.position = 5000.0;
        playing.advance().unwrap();
        playing.advance().unwrap();
        assert_eq!(status(&receiver), Some(PlayerStatus { playing: false, speed: 1.0, sample: LAST }));
        assert_eq!(playing.position, LAST as f64);
        playing.carry_out([PlayerOrder::Play].into_iter()).unwrap();
        assert_eq!(status(&receiver), Some(PlayerStatus { playing: true, speed: 1.0, sample: 0 }));
    }

    #[test]
    fn a_recording_is_played_as_often_as_requested() {
        let ends = |times, runs: usize| {
            let (mut playing, _receiver) = playing(Play { times, ..ONCE });
            (0..runs).for_each(|_| {
                playing.position = 5000.0;
                playing.advance().unwrap();
            });
            playing.is_playing
        };
        assert_eq!([1, 2, 3].map(|runs| ends(Some(3), runs)), [true, true, false]);
        assert!(ends(None, 5));
    }
}
