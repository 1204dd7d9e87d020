//! The recording of an FMU, of which the importer may take back the end by an earlier state.
//!
//! Records wait until no state that the importer holds is of before them, so that what goes to the file is never taken
//! back.

use std::collections::VecDeque;
use std::sync::{Arc, Weak};

use crate::fault::Fault;
use resonarm_bus::Statistics;
use resonarm_files::recording::{Channel, Record, Recorder, RecordingError};
use resonarm_session::run::Session;

/// Records on their way to the writer.
const CAPACITY: usize = 1 << 12;

/// Number of records at the time when a state was saved.
#[derive(Debug)]
pub(crate) struct Mark {
    records: u64,
}

/// Recording of an instance, to which its records go.
pub(crate) struct Tape {
    recorder: Recorder,
    channel: Channel,
    waiting: VecDeque<Record>,
    /// Records that went to the file.
    written: u64,
    /// Sample of the last of them, and whether it is of the hold behind the sample's reading.
    last_written: Option<(u64, bool)>,
    /// Marks of the states that the importer holds.
    marks: Vec<Weak<Mark>>,
}

impl Tape {
    /// The recording that the session's options ask for, if they do.
    pub fn open(session: &Session, interface: &str) -> Result<Option<Tape>, Fault> {
        let Some(recorder) = session.recorder(interface)? else { return Ok(None) };
        let mut channel = recorder.channel("fmu", CAPACITY)?;
        channel.begin(0);
        let waiting = VecDeque::new();
        Ok(Some(Tape { recorder, channel, waiting, written: 0, last_written: None, marks: Vec::new() }))
    }

    /// Appends a record to those that wait to be written.
    pub fn push(&mut self, record: Record) {
        self.waiting.push_back(record);
    }

    /// Notes that a state is saved, until the mark is dropped.
    pub fn mark(&mut self) -> Arc<Mark> {
        let mark = Arc::new(Mark { records: self.written + self.waiting.len() as u64 });
        self.marks.push(Arc::downgrade(&mark));
        mark
    }

    /// Takes back what came after the mark. Of a state without one, that was read from bytes, at sample `sample`, what
    /// came after the reading of that sample.
    pub fn rewind(&mut self, mark: Option<&Mark>, sample: u64) -> Result<(), Fault> {
        // `None` where records behind the state are in the file already: those can't be taken back.
        let kept = match mark {
            Some(mark) => mark.records.checked_sub(self.written),
            None if self.last_written.is_some_and(|last| last > (sample, false)) => None,
            None => Some(self.waiting.iter().take_while(|record| place(record) <= (sample, false)).count() as u64),
        };
        let kept = kept.ok_or(Fault::Recorded { sample: self.last_written.map_or(0, |(sample, _)| sample) })?;
        self.waiting.truncate(usize::try_from(kept).unwrap_or(usize::MAX));
        Ok(())
    }

    /// Writes what can't be taken back any more.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.marks.retain(|mark| mark.strong_count() > 0);
        // The oldest state that is held bounds what may be written: the importer may return to it.
        let held = self.marks.iter().filter_map(Weak::upgrade).map(|mark| mark.records).min();
        self.write(held.unwrap_or(u64::MAX))
    }

    fn write(&mut self, end: u64) -> Result<(), RecordingError> {
        while self.written < end
            && let Some(record) = self.waiting.pop_front()
        {
            self.written += 1;
            self.last_written = Some(place(&record));
            self.channel.push_blocking(&record)?;
        }
        Ok(())
    }

    /// Writes all, and the end of the file, of a run of `session` that was advanced by so many samples.
    pub fn finish(mut self, session: &Session, advanced: u64, frames: Statistics) -> Result<(), RecordingError> {
        self.write(u64::MAX)?;
        let steps = advanced * u64::from(session.scenario().simulation.steps_per_sample());
        let Tape { recorder, channel, .. } = self;
        drop(channel);
        let statistics = [
            // A sample is measured at the start and after each hold, so there is one more than were advanced.
            ("samples", (advanced + 1).to_string()),
            ("steps", steps.to_string()),
            ("frames_received", frames.received.to_string()),
            ("frames_sent", frames.sent.to_string()),
        ];
        recorder.finish(&statistics).map(|_| ())
    }
}

/// The place of a record in the run: its sample, and whether it is of the hold behind the sample's reading.
fn place(record: &Record) -> (u64, bool) {
    match record {
        Record::State(state) => (state.sample, true),
        Record::Sample(sample) => (sample.sample, false),
        Record::Frame(frame) => (frame.sample, true),
        Record::Event(event) => (event.sample, true),
        Record::Tick(tick) => (tick.sample, true),
    }
}
