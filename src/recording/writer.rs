//! The thread that takes records from the channels and writes them.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock, mpsc};
use std::thread;
use std::time::Duration;

use resonarm_protocol::{FrameFormat, Id};

use super::batch::{Batch, Batcher};
use super::recorder::Summary;
use super::schema::proto::{self, SampleBatch, StepBatch, TickBatch};
use super::schema::{FORMAT, Topic, metadata};
use super::sink::{self, Sink};
use super::staged::is_at;
use super::{
    Configuration, Direction, FlushPolicy, FrameRecord, Options, Record, RecordingError, SampleRecord, StepRecord,
    build_info,
};

/// How often the thread looks into empty channels.
const POLL: Duration = Duration::from_millis(5);
/// Records taken from one channel before the next has its turn.
const TURN: usize = 4096;

/// What the recorder tells its thread.
#[derive(Debug)]
pub(super) enum Control {
    /// A channel was opened.
    Open(Source),
    /// Write what is there, these statistics, and the end.
    Finish(BTreeMap<String, String>),
}

/// The receiving end of a channel.
#[derive(Debug)]
pub(super) struct Source {
    name: String,
    records: rtrb::Consumer<Record>,
    lost: Arc<AtomicU64>,
    lost_reported: u64,
}

impl Source {
    /// The receiving end of the channel `name`.
    pub fn new(name: String, records: rtrb::Consumer<Record>, lost: Arc<AtomicU64>) -> Source {
        Source { name, records, lost, lost_reported: 0 }
    }
}

/// What the thread works on.
pub(super) struct Writer {
    sink: Sink,
    options: Options,
    configuration: BTreeMap<String, String>,
    commands: mpsc::Receiver<Control>,
    sources: Vec<Source>,
    steps: Batcher<StepBatch>,
    samples: Batcher<SampleBatch>,
    ticks: Batcher<TickBatch>,
    step_count: u64,
    last_step: u64,
    flushed: Flushed,
}

/// When the last flush was.
struct Flushed {
    time: Duration,
    step: Option<u64>,
}

impl Writer {
    /// Creates the file with its head.
    pub fn create(
        path: &Path,
        configuration: &Configuration,
        options: Options,
        commands: mpsc::Receiver<Control>,
    ) -> Result<Writer, RecordingError> {
        let configuration = configuration.0.clone();
        let about = about(&options);
        let head = [(metadata::RECORDING, &about), (metadata::CONFIGURATION, &configuration)];
        let file = sink::open(path, options.existing)?;
        let sink = Sink::begin(file, path, options.compression, &head)?;
        let time = match options.flush {
            FlushPolicy::Interval { clock, .. } => clock(),
            FlushPolicy::Steps(_) => Duration::ZERO,
        };
        Ok(Writer {
            sink,
            configuration,
            commands,
            sources: Vec::new(),
            steps: Batcher::new(options.batch_steps, options.dt_s),
            samples: Batcher::new(options.batch_steps, options.dt_s),
            ticks: Batcher::new(options.batch_steps, options.dt_s),
            step_count: 0,
            last_step: 0,
            flushed: Flushed { time, step: None },
            options,
        })
    }

    /// Writes until told to finish. A failure is put into `failure` before the channels are let go.
    pub fn run(mut self, failure: &OnceLock<RecordingError>) -> Result<Summary, RecordingError> {
        let result = self.write_all();
        let ended = match result {
            Ok(()) => {
                let summary = self.summary();
                self.sink.finish().and_then(|file| match is_at(&file, &summary.path) {
                    true => Ok(Summary { bytes: file.len(), ..summary }),
                    false => Err(RecordingError::Gone { path: summary.path }),
                })
            }
            Err(error) => {
                self.sink.abandon();
                Err(error)
            }
        };
        ended.inspect_err(|error| {
            tracing::error!("the recording has failed: {error}");
            let _set_once = failure.set(error.clone());
        })
    }

    /// Everything but the footer.
    fn write_all(&mut self) -> Result<(), RecordingError> {
        loop {
            let finish = self.take_commands();
            let taken = self.take_records()?;
            self.report_losses()?;
            if let Some(statistics) = finish {
                self.take_rest()?;
                return self.write_end(&statistics);
            }
            self.flush_in_time()?;
            if taken == 0 {
                thread::park_timeout(POLL);
            }
        }
    }

    /// Opens channels. Returns the statistics if the recording is to end.
    fn take_commands(&mut self) -> Option<BTreeMap<String, String>> {
        loop {
            match self.commands.try_recv() {
                Ok(Control::Open(source)) => self.sources.push(source),
                Ok(Control::Finish(statistics)) => return Some(statistics),
                Err(mpsc::TryRecvError::Empty) => return None,
                Err(mpsc::TryRecvError::Disconnected) => return Some(BTreeMap::new()),
            }
        }
    }

    /// Writes what is in the channels, each at most one turn. Returns how many records there were.
    fn take_records(&mut self) -> Result<usize, RecordingError> {
        let mut taken = 0;
        for index in 0..self.sources.len() {
            for _ in 0..TURN {
                let Ok(record) = self.sources[index].records.pop() else { break };
                self.write(&record)?;
                taken += 1;
            }
        }
        Ok(taken)
    }

    /// Writes what is in the channels at this moment, so that one that is still being filled can't hold up the end.
    fn take_rest(&mut self) -> Result<(), RecordingError> {
        for index in 0..self.sources.len() {
            for _ in 0..self.sources[index].records.slots() {
                let Ok(record) = self.sources[index].records.pop() else { break };
                self.write(&record)?;
            }
        }
        self.report_losses()
    }

    /// Writes one record, after a flush if its step calls for one.
    fn write(&mut self, record: &Record) -> Result<(), RecordingError> {
        self.flush_by_step(record.step())?;
        self.last_step = self.last_step.max(record.step());
        match record {
            Record::Step(step) => self.write_step(step),
            Record::Sample(sample) => self.write_sample(sample),
            Record::Frame(frame) => {
                let time_ns = self.time_of_run_ns(frame.time_ns);
                self.sink.message(Topic::Frames, time_ns, &frame_message(frame, &self.options.interface))
            }
            Record::Tick(tick) => append(&mut self.ticks, tick, &mut self.sink, &self.options),
            Record::Event(event) => self.write_event(event.step, event.time_ns, event.name.to_string(), event.value),
        }
    }

    fn write_step(&mut self, record: &StepRecord) -> Result<(), RecordingError> {
        self.step_count += 1;
        append(&mut self.steps, record, &mut self.sink, &self.options)?;
        if !record.step.is_multiple_of(self.options.plot_every_steps) {
            return Ok(());
        }
        let state = proto::State {
            step: record.step,
            alpha1_rad: record.alpha_rad[0],
            alpha2_rad: record.alpha_rad[1],
            alpha1_dot_rad_s: record.alpha_dot_rad_s[0],
            alpha2_dot_rad_s: record.alpha_dot_rad_s[1],
        };
        let command = proto::Command {
            step: record.step,
            torque1_nm: record.torque_nm[0],
            torque2_nm: record.torque_nm[1],
            force_x_n: record.force_n[0],
            force_y_n: record.force_n[1],
        };
        let time_ns = self.options.time_of_step_ns(record.step);
        self.sink.message(Topic::State, time_ns, &state)?;
        self.sink.message(Topic::Command, time_ns, &command)
    }

    fn write_sample(&mut self, record: &SampleRecord) -> Result<(), RecordingError> {
        append(&mut self.samples, record, &mut self.sink, &self.options)?;
        if !record.step.is_multiple_of(self.options.plot_every_steps) {
            return Ok(());
        }
        let sensors = proto::Sensors {
            step: record.step,
            acceleration_b_x_m_s2: record.acceleration_b_m_s2[0],
            acceleration_b_y_m_s2: record.acceleration_b_m_s2[1],
            acceleration_c_x_m_s2: record.acceleration_c_m_s2[0],
            acceleration_c_y_m_s2: record.acceleration_c_m_s2[1],
            head_force_x_n: record.head_force_n[0],
            head_force_y_n: record.head_force_n[1],
        };
        self.sink.message(Topic::Sensors, self.options.time_of_step_ns(record.step), &sensors)
    }

    fn write_event(&mut self, step: u64, time_ns: u64, name: String, value: i64) -> Result<(), RecordingError> {
        let event = proto::Event { step, time_ns, name, value };
        self.sink.message(Topic::Events, self.time_of_run_ns(time_ns), &event)
    }

    /// A time since the start of the run, in ns of the epoch in use.
    fn time_of_run_ns(&self, time_ns: u64) -> u64 {
        self.options.time_base.start_ns().saturating_add(time_ns)
    }

    /// Writes an event for every channel that has lost records since the last time.
    fn report_losses(&mut self) -> Result<(), RecordingError> {
        for index in 0..self.sources.len() {
            let source = &mut self.sources[index];
            let lost = source.lost.load(Ordering::Relaxed);
            let new = lost - core::mem::replace(&mut source.lost_reported, lost);
            if new > 0 {
                let name = format!("recording.lost.{}", source.name);
                let time_ns = self.options.time_of_step_ns(self.last_step) - self.options.time_base.start_ns();
                self.write_event(self.last_step, time_ns, name, i64::try_from(new).unwrap_or(i64::MAX))?;
            }
        }
        Ok(())
    }

    /// Flushes if the interval has passed.
    fn flush_in_time(&mut self) -> Result<(), RecordingError> {
        if let FlushPolicy::Interval { interval, clock } = self.options.flush {
            let now = clock();
            if now.saturating_sub(self.flushed.time) >= interval {
                self.flush()?;
                self.flushed.time = now;
            }
        }
        Ok(())
    }

    /// Flushes if `step` is far enough from the step of the last flush.
    fn flush_by_step(&mut self, step: u64) -> Result<(), RecordingError> {
        if let FlushPolicy::Steps(steps) = self.options.flush {
            let last = *self.flushed.step.get_or_insert(step);
            if step.saturating_sub(last) >= steps {
                self.flush()?;
                self.flushed.step = Some(step);
            }
        }
        Ok(())
    }

    /// Writes the batches begun and hands everything to the system.
    fn flush(&mut self) -> Result<(), RecordingError> {
        take(&mut self.steps, &mut self.sink, &self.options)?;
        take(&mut self.samples, &mut self.sink, &self.options)?;
        take(&mut self.ticks, &mut self.sink, &self.options)?;
        self.sink.flush()
    }

    /// Writes the configuration again, the statistics and the count of lost records.
    fn write_end(&mut self, statistics: &BTreeMap<String, String>) -> Result<(), RecordingError> {
        self.flush()?;
        self.sink.metadata(metadata::RECORDING, &about(&self.options))?;
        self.sink.metadata(metadata::CONFIGURATION, &self.configuration)?;
        self.sink.metadata(metadata::STATISTICS, statistics)?;
        let lost = self.lost().into_iter().map(|(name, count)| (name, count.to_string())).collect();
        self.sink.metadata(metadata::LOST, &lost)
    }

    /// Records lost, by channel; channels of one name count together.
    fn lost(&self) -> BTreeMap<String, u64> {
        let mut lost = BTreeMap::new();
        for source in &self.sources {
            *lost.entry(source.name.clone()).or_insert(0) += source.lost_reported;
        }
        lost
    }

    /// What was written, the size of the file apart.
    fn summary(&self) -> Summary {
        Summary {
            path: self.sink.path().to_path_buf(),
            bytes: 0,
            messages: Topic::ALL.map(|topic| (topic.name(), self.sink.messages(topic))).into(),
            steps: self.step_count,
            lost: self.lost(),
        }
    }
}

/// Appends a row to its batch, after writing the batch if it is full or the row is not the next step.
fn append<B: Batch>(
    batcher: &mut Batcher<B>,
    row: &B::Row,
    sink: &mut Sink,
    options: &Options,
) -> Result<(), RecordingError> {
    if batcher.must_take_before(row) {
        take(batcher, sink, options)?;
    }
    batcher.append(row);
    Ok(())
}

/// Writes a batch, if it holds a row.
fn take<B: Batch>(batcher: &mut Batcher<B>, sink: &mut Sink, options: &Options) -> Result<(), RecordingError> {
    match batcher.take() {
        Some(batch) => sink.message(B::TOPIC, options.time_of_step_ns(batch.first_step()), batch),
        None => Ok(()),
    }
}

/// What the recorder itself knows about a recording.
fn about(options: &Options) -> BTreeMap<String, String> {
    let build = build_info();
    let entries = [
        ("format", FORMAT.to_string()),
        ("dt_s", options.dt_s.to_string()),
        ("interface", options.interface.clone()),
        ("start_unix_ns", options.time_base.start_ns().to_string()),
        ("plot_every_steps", options.plot_every_steps.to_string()),
        ("version", build.version),
        ("git_commit", build.git_commit),
        ("target", build.target),
        ("profile", build.profile),
        ("compiler", build.compiler),
    ];
    entries.into_iter().map(|(key, value)| (key.to_string(), value)).collect()
}

/// A frame as it goes into the file.
fn frame_message(record: &FrameRecord, interface: &str) -> proto::CanFrame {
    let frame = &record.frame;
    let direction = match record.direction {
        Direction::Received => proto::can_frame::Direction::Received,
        Direction::Sent => proto::can_frame::Direction::Sent,
    };
    let (fd, brs, esi) = match frame.format() {
        FrameFormat::Fd { bit_rate_switch, error_state_indicator } => (true, bit_rate_switch, error_state_indicator),
        FrameFormat::Classic | FrameFormat::Remote => (false, false, false),
    };
    proto::CanFrame {
        step: record.step,
        time_ns: record.time_ns,
        bus_timestamp_ns: record.bus_timestamp_ns,
        direction: direction.into(),
        interface: interface.to_string(),
        id: frame.id().raw(),
        extended: matches!(frame.id(), Id::Extended(_)),
        remote: frame.format() == FrameFormat::Remote,
        fd,
        brs,
        esi,
        length: frame.len() as u32,
        data: frame.data().to_vec(),
    }
}
