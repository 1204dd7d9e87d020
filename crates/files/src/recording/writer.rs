//! The thread that writes the records of the channels.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

use super::batch::{Batch, Batcher};
use super::build_info::build_info;
use super::error::RecordingError;
use super::frames::FrameBatcher;
use super::layout::Layout;
use super::number_batch::{NumberBatch, Numbers};
use super::options::{FlushPolicy, Naming, Options};
use super::plots::Plots;
use super::record::{FrameRecord, Record, SampleRecord, StateRecord};
use super::schema::proto::{self, TickBatch};
use super::schema::{DT_S, FORMAT, READING_DELAY, Topic, metadata};
use super::shared::{Control, Ending, Shared, Source};
use super::sink::{Sink, Stamp};
use super::slots;
use super::summary::RunTime;
use crate::staged::{Staged, is_at};
use resonarm_numeric::decimate;
use resonarm_scenario::Configuration;

/// Interval at which the thread checks empty channels.
const POLL: Duration = Duration::from_millis(5);
/// Records taken from one channel before the next has its turn.
const TURN: usize = 4096;

/// Result of writing: the file, and the number of messages in it.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// Path of the finished file.
    pub path: PathBuf,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// Number of messages in each topic, by its name in the file; for batched topics that of batches.
    pub messages: BTreeMap<&'static str, u64>,
    /// Number of states in the recording.
    pub samples: u64,
    /// Number of records lost because a channel was full, by the channel's name.
    pub lost: BTreeMap<String, u64>,
}

/// State of the thread that writes a recording.
pub(super) struct Writer {
    shared: Arc<Shared>,
    output: Output,
    file: Staged,
    configuration: BTreeMap<String, String>,
    commands: mpsc::Receiver<Control>,
    sources: Vec<Source>,
    states: Batcher<NumberBatch<StateRecord>>,
    readings: Batcher<NumberBatch<SampleRecord>>,
    ticks: Batcher<TickBatch>,
    frames: FrameBatcher,
    plots: Plots,
    state_count: u64,
    last_sample: u64,
    /// Whether a record has arrived.
    has_begun: bool,
    flushed: Flushed,
}

/// Time of the last flush.
struct Flushed {
    time: Duration,
    sample: Option<u64>,
}

impl Writer {
    /// Creates the file with its head.
    pub fn create(
        shared: Arc<Shared>,
        configuration: &Configuration,
        options: Options,
        commands: mpsc::Receiver<Control>,
    ) -> Result<Writer, RecordingError> {
        let path = &shared.path;
        let configuration = configuration.entries().clone();
        let about = about(&options, None);
        let head = [(metadata::RECORDING, &about), (metadata::CONFIGURATION, &configuration)];
        let create = match options.naming {
            Naming::FirstRecord => Staged::create_growing,
            Naming::Whole => Staged::create,
        };
        let (file, opened) = create(path, options.existing).map_err(|error| RecordingError::create(path, error))?;
        let channels = &options.channels;
        // All topics are declared, also those that stay empty: a reader can then tell a topic without records from one
        // that the file lacks.
        let schemas = Topic::ALL.map(|topic| (topic, topic.descriptor(channels)));
        let sink = Sink::begin(opened, path, options.compression, &head, schemas)?;
        let time = match options.flush {
            FlushPolicy::Interval { clock, .. } => clock(),
            FlushPolicy::Samples(_) => Duration::ZERO,
        };
        Ok(Writer {
            file,
            configuration,
            commands,
            sources: Vec::new(),
            states: numbers(&options),
            readings: numbers(&options),
            ticks: Batcher::new(TickBatch::default(), options.batch_samples, options.dt_s),
            frames: FrameBatcher::new(options.batch_samples, &options.interface),
            plots: Plots::new(options.plot_every_samples, &options.channels),
            state_count: 0,
            last_sample: 0,
            has_begun: false,
            output: Output { sink, options, times: Times { start_unix_ns: None, elapsed_ns: 0 } },
            flushed: Flushed { time, sample: None },
            shared,
        })
    }

    /// Writes until it is told to end. A failure is stored in the shared state before the channels are dropped.
    pub fn run(mut self) -> Result<Summary, RecordingError> {
        let written = self.write_all();
        let summary = self.summary();
        let Writer { shared, output: Output { sink, .. }, mut file, sources: _let_go_at_the_end, .. } = self;
        let ended = match written {
            Ok(Ending::Whole(_) | Ending::Partial { .. }) => close(sink, &mut file, summary),
            Ok(Ending::GivenUp) => {
                sink.abandon();
                Ok(summary)
            }
            Err(error) => {
                sink.abandon();
                Err(error)
            }
        };
        ended.inspect_err(|error| {
            tracing::error!("the recording failed: {error}");
            let _set_once = shared.failure.set(error.clone());
        })
    }

    /// Writes everything except the footer. Returns how the recording is to end.
    fn write_all(&mut self) -> Result<Ending, RecordingError> {
        loop {
            // Commands are taken before records. If this one ends the recording, everything pushed before it is
            // in the rings, and is taken below.
            let ending = self.take_commands();
            let taken = self.take_at_most(TURN)?;
            self.report_losses()?;
            if let Some(ending) = ending {
                // Only what is there now, so that a channel that is still being filled can't delay the end.
                self.take_at_most(usize::MAX)?;
                self.report_losses()?;
                match &ending {
                    Ending::Whole(statistics) => {
                        let lost = self.lost().into_iter().map(|(name, count)| (name, count.to_string())).collect();
                        self.write_end(statistics, metadata::LOST, &lost)?;
                    }
                    Ending::Partial { statistics, made_from } => {
                        self.write_end(statistics, metadata::RECOVERED, made_from)?;
                    }
                    Ending::GivenUp => self.flush()?,
                }
                return Ok(ending);
            }
            self.flush_in_time()?;
            if taken == 0 {
                thread::park_timeout(POLL);
            }
        }
    }

    /// Opens channels. Returns how the recording is to end, if a command says so.
    fn take_commands(&mut self) -> Option<Ending> {
        loop {
            match self.commands.try_recv() {
                Ok(Control::Open(source)) => self.sources.push(source),
                Ok(Control::End(ending)) => return Some(ending),
                Err(mpsc::TryRecvError::Empty) => return None,
                // The recorder is gone and has not ended the recording, so the file must not look complete.
                Err(mpsc::TryRecvError::Disconnected) => return Some(Ending::GivenUp),
            }
        }
    }

    /// Writes at most `most` of the records that are now in each channel. Returns how many records there were.
    fn take_at_most(&mut self, most: usize) -> Result<usize, RecordingError> {
        // The sources are moved out, since `write` borrows the whole writer.
        let mut sources = core::mem::take(&mut self.sources);
        let mut taken = 0;
        let written = sources.iter_mut().try_for_each(|source| {
            // Only what is in the ring now: a producer as fast as this loop must not starve the other channels.
            for _ in 0..most.min(source.records.slots()) {
                match slots::pop_record(&mut source.records, |record| self.write(record)) {
                    Some(written) => written?,
                    None => break,
                }
                taken += 1;
            }
            Ok(())
        });
        self.sources = sources;
        written.map(|()| taken)
    }

    /// Gives the file its name at the first record and records the start of the run, which the run loop has set by
    /// then.
    fn begin(&mut self) -> Result<(), RecordingError> {
        if core::mem::replace(&mut self.has_begun, true) {
            return Ok(());
        }
        if self.output.options.naming == Naming::FirstRecord {
            self.file.publish().map_err(|error| RecordingError::publish(&self.shared.path, error))?;
        }
        let start_clock_ns = self.shared.start_clock_ns.load(Ordering::Acquire);
        let clock_epoch_unix_ns = self.output.options.clock_epoch_unix_ns;
        self.output.times.start_unix_ns = clock_epoch_unix_ns.map(|epoch_ns| epoch_ns.saturating_add(start_clock_ns));
        match self.output.times.start_unix_ns {
            Some(start_ns) => {
                let start = BTreeMap::from([(String::from(metadata::START_UNIX_NS), start_ns.to_string())]);
                self.output.sink.metadata(metadata::START, &start)
            }
            None => Ok(()),
        }
    }

    /// Writes one record, after a flush if its sample calls for one.
    fn write(&mut self, record: &Record) -> Result<(), RecordingError> {
        self.begin()?;
        // The flush comes before the record, so that the file ends with a whole sample.
        self.flush_by_sample(record.sample())?;
        self.last_sample = self.last_sample.max(record.sample());
        match record {
            Record::State(state) => self.write_state(state),
            Record::Sample(reading) => self.write_reading(reading),
            Record::Frame(frame) => self.write_frame(frame),
            Record::Tick(tick) => self.output.append(&mut self.ticks, tick),
            Record::Event(event) => self.write_event(event.sample, event.time_ns, event.name.to_string(), event.value),
        }
    }

    fn write_state(&mut self, record: &StateRecord) -> Result<(), RecordingError> {
        self.check(Topic::States, record.values().len())?;
        self.state_count += 1;
        self.output.append(&mut self.states, record)?;
        self.plots.state(record);
        self.write_plots()
    }

    fn write_reading(&mut self, record: &SampleRecord) -> Result<(), RecordingError> {
        self.check(Topic::Samples, record.values().len())?;
        self.output.append(&mut self.readings, record)?;
        self.plots.reading(record);
        self.write_plots()
    }

    /// Rejects a record with another number of values than its topic has channels.
    fn check(&self, topic: Topic, got: usize) -> Result<(), RecordingError> {
        match self.output.options.channels.of(topic).len() {
            expected if expected == got => Ok(()),
            expected => Err(RecordingError::Row { path: self.shared.path.clone(), topic: topic.name(), expected, got }),
        }
    }

    fn write_frame(&mut self, record: &FrameRecord) -> Result<(), RecordingError> {
        if self.frames.must_take_before(record) {
            self.take_frames()?;
        }
        self.frames.append(record);
        // The channels are emptied one after the other, so a frame may be older than what was written before. Publish
        // times still never step back.
        self.output.times.elapsed_ns = self.output.times.elapsed_ns.max(record.time_ns);
        Ok(())
    }

    fn take_frames(&mut self) -> Result<(), RecordingError> {
        match self.frames.take() {
            Some((sample, batch)) => self.output.message(Topic::Frames, sample, batch),
            None => Ok(()),
        }
    }

    /// Writes the finished messages for plotting.
    fn write_plots(&mut self) -> Result<(), RecordingError> {
        for message in self.plots.ready() {
            self.output.message(message.topic, message.sample, &message)?;
        }
        Ok(())
    }

    fn write_event(&mut self, sample: u64, time_ns: u64, name: String, value: i64) -> Result<(), RecordingError> {
        let event = proto::Event { step: sample, time_ns, name, value };
        let Output { sink, options, times } = &mut self.output;
        times.elapsed_ns = times.elapsed_ns.max(time_ns);
        // Stamped with its own time: what was written before it may have been handled later.
        let stamp = Times { elapsed_ns: time_ns, ..*times }.stamp(options, sample);
        sink.message(Topic::Events, stamp, &event)
    }

    /// Writes an event for every channel that has lost records since the last time.
    fn report_losses(&mut self) -> Result<(), RecordingError> {
        for index in 0..self.sources.len() {
            let source = &mut self.sources[index];
            // The counter only grows; what was reported before is subtracted, so no loss is reported twice.
            let lost = source.lost.load(Ordering::Acquire);
            let new = lost - core::mem::replace(&mut source.lost_reported, lost);
            if new > 0 {
                let name = format!("recording.lost.{}", source.name);
                self.begin()?;
                let time_ns = match self.output.times.start_unix_ns {
                    Some(_) => self.output.times.elapsed_ns,
                    None => self.output.options.simulated_ns(self.last_sample),
                };
                self.write_event(self.last_sample, time_ns, name, i64::try_from(new).unwrap_or(i64::MAX))?;
            }
        }
        Ok(())
    }

    /// Flushes if the interval has passed.
    fn flush_in_time(&mut self) -> Result<(), RecordingError> {
        if let FlushPolicy::Interval { interval, clock } = self.output.options.flush {
            let now = clock();
            if now.saturating_sub(self.flushed.time) >= interval {
                self.flush()?;
                self.flushed.time = now;
            }
        }
        Ok(())
    }

    /// Flushes if `sample` is far enough from the sample of the last flush.
    fn flush_by_sample(&mut self, sample: u64) -> Result<(), RecordingError> {
        if let FlushPolicy::Samples(samples) = self.output.options.flush {
            let last = *self.flushed.sample.get_or_insert(sample);
            if sample.saturating_sub(last) >= samples {
                self.flush()?;
                self.flushed.sample = Some(sample);
            }
        }
        Ok(())
    }

    /// Writes the open batches and passes everything to the operating system.
    fn flush(&mut self) -> Result<(), RecordingError> {
        self.take_frames()?;
        self.output.take(&mut self.states)?;
        self.output.take(&mut self.readings)?;
        self.output.take(&mut self.ticks)?;
        self.output.sink.flush()
    }

    /// Writes the configuration again, the statistics, and last the metadata record that says how the recording ends: the
    /// count of lost records, or what a recording that is not whole was made from.
    fn write_end(
        &mut self,
        statistics: &BTreeMap<String, String>,
        name: &str,
        content: &BTreeMap<String, String>,
    ) -> Result<(), RecordingError> {
        self.plots.end();
        self.write_plots()?;
        self.flush()?;
        // A second time, now with the start of the run, which the head could not state yet.
        self.output
            .sink
            .metadata(metadata::RECORDING, &about(&self.output.options, self.output.times.start_unix_ns))?;
        self.output.sink.metadata(metadata::CONFIGURATION, &self.configuration)?;
        self.output.sink.metadata(metadata::STATISTICS, statistics)?;
        self.output.sink.metadata(name, content)
    }

    /// Returns the lost records, by channel; channels of one name count together.
    fn lost(&self) -> BTreeMap<String, u64> {
        let mut lost = BTreeMap::new();
        for source in &self.sources {
            *lost.entry(source.name.clone()).or_insert(0) += source.lost_reported;
        }
        lost
    }

    /// Summarises the written records; the size of the file is filled in later.
    fn summary(&self) -> Summary {
        Summary {
            path: self.output.sink.path().to_path_buf(),
            // `close` fills it in, when the file is finished.
            bytes: 0,
            messages: Topic::ALL.map(|topic| (topic.name(), self.output.sink.messages(topic))).into(),
            samples: self.state_count,
            lost: self.lost(),
        }
    }
}

/// The file, and what the times of its messages follow from.
struct Output {
    sink: Sink,
    options: Options,
    times: Times,
}

impl Output {
    /// Writes a message that belongs to a sample.
    fn message(&mut self, topic: Topic, sample: u64, message: &impl prost::Message) -> Result<(), RecordingError> {
        self.sink.message(topic, self.times.stamp(&self.options, sample), message)
    }

    /// Writes a batch, if it holds a row.
    fn take<B: Batch>(&mut self, batcher: &mut Batcher<B>) -> Result<(), RecordingError> {
        match batcher.take() {
            Some(batch) => self.message(B::TOPIC, batch.first_sample(), batch),
            None => Ok(()),
        }
    }

    /// Appends a row to a batch, which is written before if the row can't be in it.
    fn append<B: Batch>(&mut self, batcher: &mut Batcher<B>, row: &B::Row) -> Result<(), RecordingError> {
        if batcher.must_take_before(row) {
            self.take(batcher)?;
        }
        batcher.append(row);
        Ok(())
    }
}

/// Progress of the run by the machine's clock.
#[derive(Clone, Copy)]
struct Times {
    /// Start of the run, ns of the UNIX epoch; `None` before it, and for simulated time alone.
    start_unix_ns: Option<u64>,
    /// The latest time of a frame or an event, ns from there.
    elapsed_ns: u64,
}

impl Times {
    /// Returns log and publish time of a message that belongs to `sample` and is written now.
    fn stamp(self, options: &Options, sample: u64) -> Stamp {
        let simulated_ns = options.simulated_ns(sample);
        match (options.time, self.start_unix_ns) {
            (RunTime::RealTime, Some(start_ns)) => Stamp {
                log_ns: start_ns.saturating_add(simulated_ns),
                publish_ns: start_ns.saturating_add(self.elapsed_ns),
            },
            (_, Some(start_ns)) => Stamp { log_ns: simulated_ns, publish_ns: start_ns.saturating_add(self.elapsed_ns) },
            (_, None) => Stamp { log_ns: simulated_ns, publish_ns: simulated_ns },
        }
    }
}

/// Writes the footer and puts the file, which must still exist, on the disk.
fn close(sink: Sink, file: &mut Staged, summary: Summary) -> Result<Summary, RecordingError> {
    let written = sink.finish()?;
    file.publish().map_err(|error| RecordingError::publish(&summary.path, error))?;
    // The file may have been moved or replaced while it was written. Without this check its loss would go
    // unnoticed.
    match is_at(&written.metadata, &summary.path) {
        true => Ok(Summary { bytes: written.bytes, ..summary }),
        false => Err(RecordingError::Gone { path: summary.path }),
    }
}

/// Makes a batcher of states or readings.
fn numbers<R: Numbers>(options: &Options) -> Batcher<NumberBatch<R>> {
    let batch = NumberBatch::new(Arc::new(Layout::new(&options.channels, R::TOPIC)));
    Batcher::new(batch, options.batch_samples, options.dt_s)
}

/// Returns the recorder's own description of a recording.
fn about(options: &Options, start_unix_ns: Option<u64>) -> BTreeMap<String, String> {
    let build = build_info();
    let entries = [
        (metadata::FORMAT, FORMAT.to_string()),
        (DT_S, options.dt_s.to_string()),
        ("interface", options.interface.clone()),
        ("time", options.time.name().to_string()),
        ("plot_every_samples", options.plot_every_samples.to_string()),
        (READING_DELAY, options.reading_delay_samples.to_string()),
        ("plot_filter", decimate::describe(options.plot_every_samples)),
        ("version", build.version),
        ("git_commit", build.git_commit),
        ("target", build.target),
        ("profile", build.profile),
        ("compiler", build.compiler),
    ];
    let start = start_unix_ns.map(|start_ns| (metadata::START_UNIX_NS, start_ns.to_string()));
    entries.into_iter().chain(start).map(|(key, value)| (key.to_string(), value)).collect()
}

#[cfg(test)]
#[path = "writer_tests.rs"]
mod tests;
