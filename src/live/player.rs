//! Plays a recording: its records in the order of their samples, at the speed of the clock or another.

use std::collections::BTreeMap;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use super::LiveError;
use super::branches::stand_back;
use super::message::{PlayerOrder, PlayerStatus};
use super::source::{Played, Player, Source};
use crate::control::ResponsePoint;
use crate::realtime::{Clock, SystemClock};
use crate::recording::{Record, Recording, RecordingError, Records};
use crate::replay::timed_responses;

/// From one look at the clock to the next.
const LOOK: Duration = Duration::from_millis(15);
/// How far beyond the sample that is played the file is read, samples: topics are interleaved by batches.
const AHEAD: u64 = 2048;
/// How much less processor time the threads get than others (nice(2)).
const NICE: i32 = 10;

/// Starts to play a recording; the threads end when the source is dropped.
///
/// # Errors
/// [`LiveError::Thread`] if a thread can't be started.
pub fn play(recording: Recording) -> Result<Source, LiveError> {
    let (played, receiver) = mpsc::channel();
    let (orders, ordered) = mpsc::channel();
    let (read, responses) = mpsc::channel();
    let for_responses = recording.clone();
    spawn("live-responses", move || {
        match timed_responses(&for_responses) {
            // Nobody waits for them any more if the player has ended.
            Ok(found) => drop(read.send(found)),
            Err(error) => tracing::info!("no responses are shown: {error}"),
        }
    })?;
    let playing = Playing {
        rate_hz: 1.0 / recording.origin().dt_s,
        first: recording.summary().samples.map_or(0, |(first, _)| first),
        recording,
        records: None,
        ahead: BTreeMap::new(),
        newest_read: 0,
        position: 0.0,
        told_to: 0,
        status: PlayerStatus { playing: true, speed: 1.0 },
        played,
        responses: Vec::new(),
        reading: responses,
    };
    spawn("live-player", move || playing.run(&ordered))?;
    Ok(Source::Recording(Player { played: receiver, orders }))
}

fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), LiveError> {
    let work = || {
        stand_back(NICE);
        work();
    };
    thread::Builder::new().name(name.to_owned()).spawn(work).map(drop).map_err(LiveError::Thread)
}

struct Playing {
    recording: Recording,
    rate_hz: f64,
    /// The first sample.
    first: u64,
    /// What is left to read; `None` at the end.
    records: Option<Records<Record<String>>>,
    /// What was read and is not due, by sample.
    ahead: BTreeMap<u64, Vec<Record<String>>>,
    newest_read: u64,
    /// The sample that is due.
    position: f64,
    /// What comes before this sample is told.
    told_to: u64,
    status: PlayerStatus,
    played: mpsc::Sender<Played>,
    responses: Vec<(u64, ResponsePoint)>,
    reading: mpsc::Receiver<Vec<(u64, ResponsePoint)>>,
}

/// Nobody looks any more.
struct Gone;

impl Playing {
    fn run(mut self, orders: &mpsc::Receiver<PlayerOrder>) {
        let mut looked_ns = SystemClock.now_ns();
        let mut going = self.seek(self.first);
        while going.is_ok() {
            let order = orders.recv_timeout(LOOK);
            let now_ns = SystemClock.now_ns();
            if self.status.playing {
                self.position += (now_ns - looked_ns) as f64 * 1e-9 * self.status.speed * self.rate_hz;
            }
            looked_ns = now_ns;
            going = match order {
                Ok(order) => self.obey(order),
                Err(RecvTimeoutError::Timeout) => Ok(()),
                Err(RecvTimeoutError::Disconnected) => Err(Gone),
            };
            going = going.and_then(|()| self.advance());
        }
    }

    fn tell(&self, played: Played) -> Result<(), Gone> {
        self.played.send(played).map_err(|_nobody| Gone)
    }

    fn obey(&mut self, order: PlayerOrder) -> Result<(), Gone> {
        match order {
            PlayerOrder::Play => {
                if self.is_at_end() {
                    self.seek(self.first)?;
                }
                self.status.playing = true;
            }
            PlayerOrder::Pause => self.status.playing = false,
            PlayerOrder::Speed { times } => self.status.speed = times,
            PlayerOrder::Seek { time_s } => self.seek((time_s * self.rate_hz) as u64)?,
        }
        self.tell(Played::Status(self.status))
    }

    fn is_at_end(&self) -> bool {
        self.records.is_none() && self.ahead.is_empty()
    }

    /// Goes on at a sample. Events before it are told at once: they say in which state the node is.
    fn seek(&mut self, sample: u64) -> Result<(), Gone> {
        self.ahead.clear();
        (self.position, self.told_to, self.newest_read) = (sample as f64, sample, 0);
        self.records = self.recording.records().inspect_err(tell_error).ok();
        self.tell(Played::Restarted)?;
        self.tell(Played::Status(self.status))?;
        let before = self.read_to(sample, sample);
        self.tell(Played::Records(before))?;
        self.take_responses(0)
    }

    /// Tells what is due by now.
    fn advance(&mut self) -> Result<(), Gone> {
        let due = self.position as u64;
        if due > self.told_to {
            let events = self.read_to(due, 0);
            let later = self.ahead.split_off(&due);
            let records: Vec<_> = core::mem::replace(&mut self.ahead, later).into_values().flatten().collect();
            debug_assert!(events.is_empty());
            let from = core::mem::replace(&mut self.told_to, due);
            self.tell(Played::Records(records))?;
            self.take_responses(from)?;
        }
        if self.status.playing && self.is_at_end() {
            self.status.playing = false;
            self.tell(Played::Status(self.status))?;
        }
        Ok(())
    }

    /// Reads on to well beyond `sample`; the events before `from`, of which the rest is left out.
    fn read_to(&mut self, sample: u64, from: u64) -> Vec<Record<String>> {
        let mut events = Vec::new();
        while self.newest_read <= sample + AHEAD {
            let Some(next) = self.records.as_mut().and_then(Iterator::next) else {
                self.records = None;
                break;
            };
            match next.inspect_err(tell_error) {
                Ok(record) if record.sample() >= from => {
                    self.newest_read = self.newest_read.max(record.sample());
                    self.ahead.entry(record.sample()).or_default().push(record);
                }
                Ok(record @ Record::Event(_)) => events.push(record),
                Ok(_) => {}
                Err(_) => self.records = None,
            }
        }
        events
    }

    /// Tells the responses that were read from sample `from` on and before the sample that is due; if they are there
    /// only now, all before it.
    fn take_responses(&mut self, from: u64) -> Result<(), Gone> {
        let new = self.reading.try_iter().last();
        let from = if new.is_some() { 0 } else { from };
        self.responses = new.unwrap_or_else(|| core::mem::take(&mut self.responses));
        let due = self.responses.iter().filter(|(sample, _)| (from..self.told_to).contains(sample));
        due.map(|(_, response)| *response).try_for_each(|response| self.tell(Played::Response(Box::new(response))))
    }
}

fn tell_error(error: &RecordingError) {
    tracing::error!("the recording can't be read on: {error}");
}
