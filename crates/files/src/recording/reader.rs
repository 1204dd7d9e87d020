//! Reads a recording, record by record, also a damaged one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::channels::{Channels, Values};
use super::decode;
use super::error::RecordingError;
use super::record::{Event, FrameRecord, Record, SampleRecord, StateRecord, TickRecord};
use super::records::{Decode, Records};
use super::scan::{Scan, scan};
use super::schema::{DT_S, Topic, metadata};
use super::summary::{Integrity, Origin, RecordingSummary};
use resonarm_numeric::number::short;
use resonarm_scenario::{Configuration, Scenario, ScenarioError};

/// A recording whose every checksum has been checked.
///
/// Only the description of the file is held in memory; records are read from the file on request.
#[derive(Clone, Debug)]
pub struct Recording {
    path: PathBuf,
    scan: Scan,
    origin: Origin,
    configuration: Configuration,
    /// The FMU that may be loaded for a re-simulation of the run.
    fmu: Option<PathBuf>,
}

/// The numbers of a sample in the order of its topic's channels.
pub(crate) struct Row {
    pub sample: u64,
    pub values: Values,
    /// Readings that are clipped, one bit each in the order of the channels.
    pub clipped: u32,
}

/// A row, or the error that ends the rows.
type RowResult = Result<Row, RecordingError>;

impl Recording {
    /// Reads the file once from end to end, checks every checksum, and keeps the file's description of itself.
    ///
    /// A truncated or damaged file opens as well: [`Recording::integrity`] reports this, and the records before the
    /// first bad byte can be read.
    ///
    /// # Errors
    /// [`RecordingError`] if the file can't be read, is not a recording, or was cut off before its head was complete.
    pub fn open(path: impl AsRef<Path>) -> Result<Recording, RecordingError> {
        let path = path.as_ref();
        let scan = scan(path)?;
        let origin = scan.origin(path)?;
        // By bits: every batch and the metadata state the same number, so a difference is a damage or a file of two
        // runs.
        if scan.tally.dt_s.is_some_and(|dt_s| dt_s.to_bits() != origin.dt_s.to_bits()) {
            let path = path.to_path_buf();
            let name = metadata::RECORDING;
            let key = String::from(DT_S);
            let expected = "what its batches state";
            return Err(RecordingError::Metadata { path, name, key, got: short(&origin.dt_s).to_string(), expected });
        }
        let configuration = Configuration::from(scan.required(path, metadata::CONFIGURATION)?.clone());
        Ok(Recording { path: path.to_path_buf(), scan, origin, configuration, fmu: None })
    }

    /// Allows an FMU to be loaded from `file` for a re-simulation. A recording is data, so the file that it names is
    /// never loaded; `file` counts as the recorded FMU if its SHA-256 is the recorded one.
    #[must_use]
    pub fn allow_fmu(self, file: impl Into<PathBuf>) -> Recording {
        Recording { fmu: Some(file.into()), ..self }
    }

    /// Returns the scenario of the run.
    ///
    /// # Errors
    /// As [`Scenario::from_configuration`].
    pub fn scenario(&self) -> Result<Scenario, ScenarioError> {
        let mut scenario = Scenario::from_configuration(&self.configuration)?;
        if let Some(file) = &self.fmu {
            scenario.structure.allow_fmu(file);
        }
        Ok(scenario)
    }

    /// Returns the path of the recording.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns whether the file is whole.
    pub fn integrity(&self) -> &Integrity {
        &self.scan.integrity
    }

    /// Returns where and when the recording was made, and its sample period.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Returns the configuration of the run.
    pub fn configuration(&self) -> &Configuration {
        &self.configuration
    }

    /// Returns the channels of its states and readings.
    pub fn channels(&self) -> &Channels {
        &self.scan.tally.channels
    }

    /// Returns the statistics passed at the end of the run, if its end is in the file.
    pub fn statistics(&self) -> Option<&BTreeMap<String, String>> {
        self.scan.metadata.get(metadata::STATISTICS)
    }

    /// Summarises the recording: size, integrity, origin, samples and counts by topic.
    pub fn summary(&self) -> RecordingSummary {
        let samples = self.scan.tally.samples;
        RecordingSummary {
            path: self.path.clone(),
            file_bytes: self.scan.file_bytes,
            integrity: self.scan.integrity.clone(),
            origin: self.origin.clone(),
            duration_s: samples.map_or(0.0, |(first, last)| (last - first) as f64 * self.origin.dt_s),
            samples,
            clipped_samples: self.scan.tally.clipped_samples,
            faults: self.scan.tally.faults.clone(),
            other_sender_frames: self.scan.tally.other_sender_frames,
            topics: Topic::ALL.map(|topic| (topic.name(), self.scan.tally.topics[topic as usize].summary)).into(),
            lost: self.scan.lost.clone(),
            configuration: self.configuration.entries().clone(),
            statistics: self.statistics().cloned().unwrap_or_default(),
        }
    }

    /// Returns all records in the file, also beyond gaps. Within a topic they are in order; rows of a batch come
    /// together, so that topics are interleaved only roughly.
    ///
    /// # Errors
    /// [`RecordingError`] if the file can't be opened again.
    pub fn records(&self) -> Result<Records<Record<String>>, RecordingError> {
        // The topics for plotting are left out: they repeat what the batches have.
        const ALL: &[Topic] = &[Topic::States, Topic::Samples, Topic::Frames, Topic::Ticks, Topic::Events];
        Records::new(&self.path, self.scan.readable_bytes, ALL, |message, queue| {
            decode::decode(message, |record| queue.push_back(record))
        })
    }

    /// Returns every state, in order and without a gap.
    ///
    /// # Errors
    /// [`RecordingError::Gap`] before anything is returned if samples are missing; [`RecordingError::MissingTopic`] if
    /// the file has no such topic.
    pub fn states(&self) -> Result<Records<StateRecord>, RecordingError> {
        self.continuous(&[Topic::States], |message, queue| decode::numbers(message, |record| queue.push_back(record)))
    }

    /// Returns every sample, in order and without a gap.
    ///
    /// # Errors
    /// As [`Recording::states`].
    pub fn samples(&self) -> Result<Records<SampleRecord>, RecordingError> {
        self.continuous(&[Topic::Samples], |message, queue| decode::numbers(message, |record| queue.push_back(record)))
    }

    /// Returns every tick of the real-time loop, in order and without a gap.
    ///
    /// # Errors
    /// As [`Recording::states`].
    pub fn ticks(&self) -> Result<Records<TickRecord>, RecordingError> {
        self.continuous(&[Topic::Ticks], |message, queue| decode::ticks(message, |record| queue.push_back(record)))
    }

    /// Returns every frame on the bus, in order.
    ///
    /// # Errors
    /// [`RecordingError::MissingTopic`] if the file has no such topic.
    pub fn frames(&self) -> Result<Records<FrameRecord>, RecordingError> {
        self.continuous(&[Topic::Frames], |message, queue| decode::frames(message, |record| queue.push_back(record)))
    }

    /// Returns every event, in order.
    ///
    /// # Errors
    /// [`RecordingError::MissingTopic`] if the file has no such topic.
    pub fn events(&self) -> Result<Records<Event<String>>, RecordingError> {
        self.continuous(&[Topic::Events], |message, queue| decode::events(message, |record| queue.push_back(record)))
    }

    /// Returns the rows of states or samples, in order and without a gap; none of other topics.
    ///
    /// # Errors
    /// As [`Recording::states`].
    pub(crate) fn rows(&self, topic: Topic) -> Result<Box<dyn Iterator<Item = RowResult>>, RecordingError> {
        let state = |record: StateRecord| Row { sample: record.sample, values: record.values(), clipped: 0 };
        let readings = |record: SampleRecord| {
            let clipped = record.clipped_bits();
            Row { sample: record.sample, values: record.values(), clipped }
        };
        Ok(match topic {
            Topic::States => Box::new(self.states()?.map(move |record| record.map(state))),
            Topic::Samples => Box::new(self.samples()?.map(move |record| record.map(readings))),
            _ => Box::new(core::iter::empty()),
        })
    }

    /// Returns the records of one topic, if the file has it and it has no gap.
    fn continuous<T>(&self, topics: &'static [Topic; 1], decode: Decode<T>) -> Result<Records<T>, RecordingError> {
        let [topic] = *topics;
        let found = &self.scan.tally.topics[topic as usize];
        let path = self.path.clone();
        let topic = topic.name();
        // A run killed before its first chunk has no topics at all, and nothing in them.
        if !found.declared && self.scan.tally.topics.iter().any(|topic| topic.declared) {
            return Err(RecordingError::MissingTopic { path, topic });
        }
        match found.first_gap {
            Some((expected, got)) => Err(RecordingError::Gap { path, topic, expected, got, gaps: found.summary.gaps }),
            None => Records::new(&self.path, self.scan.readable_bytes, topics, decode),
        }
    }
}
