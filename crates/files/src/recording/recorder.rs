//! The recorder's interface to the run loops: channels that accept records, and an end.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock, mpsc};
use std::thread::{self, JoinHandle, Thread};
use std::time::Duration;

use super::error::RecordingError;
use super::options::Options;
use super::record::Record;
use super::shared::{Control, Ending, Shared, Source};
use super::slots::{self, MOST_SLOTS, Slot};
use super::writer::{Summary, Writer};
use resonarm_scenario::Configuration;

/// Wait before a full channel is checked again.
const FULL_WAIT: Duration = Duration::from_micros(50);

/// Writes a recording on a thread of its own.
///
/// The thread inherits scheduling policy and affinity of the thread that calls [`Recorder::create`]: call it before the
/// set-up of a real-time thread.
///
/// Dropping a recorder abandons the recording: the file has no end, so that it opens as
/// [`Integrity::Truncated`](super::Integrity::Truncated) with the records written until then. Without a record, or
/// before it has its name ([`Naming`](super::Naming)), it is removed.
#[derive(Debug)]
pub struct Recorder {
    control: mpsc::Sender<Control>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<Result<Summary, RecordingError>>>,
}

/// Fate of a record given to [`Channel::push`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pushed {
    /// The record is on its way to the file.
    Stored,
    /// The channel was full, or the recorder has failed: the record is lost, and counted.
    Lost,
}

/// One producer's channel into a recording: a ring that accepts records without waiting.
#[derive(Debug)]
pub struct Channel {
    ring: rtrb::Producer<Slot>,
    lost: Arc<AtomicU64>,
    shared: Arc<Shared>,
    writer: Thread,
}

impl Recorder {
    /// Creates the file, writes `configuration` into it and starts the thread.
    ///
    /// # Errors
    /// [`RecordingError::Exists`] if the file already exists, [`RecordingError::Create`] if it can't be created,
    /// [`RecordingError::Write`] if not even its head can be written, [`RecordingError::Option`] if `options` are
    /// invalid.
    pub fn create(
        path: impl AsRef<Path>,
        configuration: &Configuration,
        options: Options,
    ) -> Result<Recorder, RecordingError> {
        options.check()?;
        let path = path.as_ref();
        let shared =
            Arc::new(Shared { path: path.to_path_buf(), failure: OnceLock::new(), start_clock_ns: AtomicU64::new(0) });
        let (control, commands) = mpsc::channel();
        let writer = Writer::create(Arc::clone(&shared), configuration, options, commands)?;
        let thread = thread::Builder::new()
            .name(String::from("recorder"))
            .spawn(move || writer.run())
            .map_err(|source| RecordingError::Create { path: path.to_path_buf(), source: Arc::new(source) })?;
        Ok(Recorder { control, shared, thread: Some(thread) })
    }

    /// Opens a channel that holds up to `capacity` records, of states beyond the five of the arm one for every twelve
    /// more; at least one. Losses are counted under `name`.
    ///
    /// # Errors
    /// [`RecordingError::Option`] if `capacity` is 0; the failure of the recorder, if it has failed.
    pub fn channel(&self, name: &str, capacity: usize) -> Result<Channel, RecordingError> {
        if capacity == 0 {
            let option = "capacity";
            let got = String::from("0");
            let expected = "at least 1 record";
            return Err(RecordingError::Option { option, got, expected });
        }
        // A ring shorter than the longest record could never take that record, and would wait for ever.
        let (ring, records) = rtrb::RingBuffer::new(capacity.max(MOST_SLOTS));
        let lost = Arc::new(AtomicU64::new(0));
        let source = Source::new(name.to_string(), records, Arc::clone(&lost));
        // The thread that has failed may not have ended yet, and still be sent to.
        if self.has_failed() {
            return Err(self.shared.error());
        }
        match (&self.thread, self.control.send(Control::Open(source))) {
            (Some(thread), Ok(())) => {
                Ok(Channel { ring, lost, shared: Arc::clone(&self.shared), writer: thread.thread().clone() })
            }
            _ => Err(self.shared.error()),
        }
    }

    /// Returns the path of the recording.
    pub fn path(&self) -> &Path {
        &self.shared.path
    }

    /// Says whether the recorder has failed: [`Recorder::failure`] returns the reason. Cheap, but not for the real-time
    /// loop.
    pub fn has_failed(&self) -> bool {
        self.shared.failure.get().is_some() || self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Returns the failure of the recorder, if any: a full disk, for example. The first failure is also logged at once.
    pub fn failure(&self) -> Option<RecordingError> {
        self.has_failed().then(|| self.shared.error())
    }

    /// Writes the records in the channels, the configuration again, `statistics` and the count of lost records, and
    /// closes the file. Records pushed after this call began are not recorded.
    ///
    /// # Errors
    /// [`RecordingError`] if writing failed, now or at any time before; [`RecordingError::Gone`] if the file was
    /// deleted, moved or replaced meanwhile.
    pub fn finish(mut self, statistics: &[(&str, String)]) -> Result<Summary, RecordingError> {
        let statistics = statistics.iter().map(|(key, value)| (key.to_string(), value.clone())).collect();
        self.end(Ending::Whole(statistics))
    }

    /// Works like [`Recorder::finish`], for a recording made from others that are not whole. `made_from` states this in
    /// the file, and it opens as [`Integrity::Unfinished`](super::Integrity::Unfinished).
    ///
    /// # Errors
    /// As [`Recorder::finish`].
    pub fn finish_partial(
        mut self,
        statistics: &[(&str, String)],
        made_from: &[(&str, String)],
    ) -> Result<Summary, RecordingError> {
        let [statistics, made_from] = [statistics, made_from]
            .map(|entries| entries.iter().map(|(key, value)| (key.to_string(), value.clone())).collect());
        self.end(Ending::Partial { statistics, made_from })
    }

    /// Ends the thread. A thread that has ended before accepts no command; its result states the reason.
    fn end(&mut self, ending: Ending) -> Result<Summary, RecordingError> {
        let _ended_before = self.control.send(Control::End(ending));
        match self.thread.take() {
            Some(thread) => {
                // The thread may be parked between two looks at empty channels, and would notice the command only at
                // the next one.
                thread.thread().unpark();
                thread.join().unwrap_or_else(|_panic| Err(self.shared.error()))
            }
            None => Err(self.shared.error()),
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if self.thread.is_some() {
            // The thread has logged a failure.
            let _given_up = self.end(Ending::GivenUp);
        }
    }
}

impl Channel {
    /// Sets the start of the run on the loop's clock, ns. Must be called before the first record, by the loop itself,
    /// so that its times and those of the bus have one origin. Never blocks, locks or allocates.
    pub fn begin(&mut self, clock_ns: u64) {
        self.shared.start_clock_ns.store(clock_ns, Ordering::Release);
    }

    /// Records `record`, or counts it as lost. Never blocks, locks or allocates: for the real-time loop.
    #[inline]
    pub fn push(&mut self, record: &Record) -> Pushed {
        if !self.ring.is_abandoned() && slots::push(&mut self.ring, record) {
            Pushed::Stored
        } else {
            // Paired with the acquiring load of the writer thread. The ring has its own ordering.
            self.lost.fetch_add(1, Ordering::Release);
            Pushed::Lost
        }
    }

    /// Records `record`, waiting while the channel is full: for loops in virtual time, which must lose nothing.
    ///
    /// # Errors
    /// The failure of the recorder; [`RecordingError::Finished`] if it was finished.
    pub fn push_blocking(&mut self, record: &Record) -> Result<(), RecordingError> {
        while slots::is_full(&self.ring, record) && !self.ring.is_abandoned() {
            // The writer sleeps while the channels are empty; waiting for its next look would cost 5 ms at each full
            // ring.
            self.writer.unpark();
            thread::park_timeout(FULL_WAIT);
        }
        match self.push(record) {
            Pushed::Stored => Ok(()),
            Pushed::Lost => Err(match self.shared.failure.get() {
                Some(error) => error.clone(),
                None => RecordingError::Finished { path: self.shared.path.clone() },
            }),
        }
    }

    /// Says whether its records are no longer written. Neither blocks, locks nor allocates: for the real-time loop.
    pub fn has_failed(&self) -> bool {
        self.shared.failure.get().is_some()
    }

    /// Returns the number of records this channel has lost so far.
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }
}
