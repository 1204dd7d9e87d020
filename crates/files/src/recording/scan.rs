//! The first pass through a file, which checks whether it is whole, and counts its contents.

use std::collections::BTreeMap;
use std::path::Path;

use super::batch::Batch;
use super::build_info::BuildInfo;
use super::channels::Channels;
use super::checked_reader::{CheckedReader, TopLevelRecord};
use super::contents::{Contents, RawMessage};
use super::decode::{decode, number_batch};
use super::error::RecordingError;
use super::number_batch::Numbers;
use super::record::{Event, Record, SampleRecord, StateRecord};
use super::schema::{
    ARMED_EVENT, DT_S, FAULT_EVENT, FORMAT, OTHER_SENDER_EVENT, OUR_LIBRARY, PARTNER_EVENT, READING_DELAY, Topic,
    metadata,
};
use super::summary::{Integrity, Origin, RecordedFault, RunTime, TopicSummary};
use resonarm_numeric::number::short;

/// The number of faults that are listed one by one; later ones are in `/events`.
const MOST_FAULTS: usize = 100;

/// Results of a pass through a whole file.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    pub integrity: Integrity,
    pub file_bytes: u64,
    /// Everything before this byte is valid.
    pub readable_bytes: u64,
    /// The library that wrote the file, as its head says.
    pub library: String,
    /// The first metadata record of each name.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    pub lost: BTreeMap<String, u64>,
    pub tally: Tally,
}

/// Results of reading the messages in the chunks.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    /// First and last sample of any record.
    pub samples: Option<(u64, u64)>,
    /// Sample period, s, that the metadata, or else the first batch, state.
    pub dt_s: Option<f64>,
    /// Samples with a reading beyond the range of its sensor.
    pub clipped_samples: u64,
    /// Channels of states and readings, as far as their topics are declared.
    pub channels: Channels,
    /// The faults of the plant, the first [`MOST_FAULTS`] of them.
    pub faults: Vec<RecordedFault>,
    /// The exciter's last emergency since the plant was armed, and its sample, until the plant reports a fault.
    pub partner_emergency: Option<(u64, i64)>,
    /// Frames under identifiers that only the plant sends, of another network.
    pub other_sender_frames: u64,
    /// Counts for each of [`Topic::ALL`].
    pub topics: [TopicTally; Topic::ALL.len()],
    /// Whether messages are numbered within their topic, from 0, as our recorder numbers them.
    pub is_numbered: bool,
    /// The first flaw of the messages as a whole: some are repeated, late or missing.
    pub flaw: Option<String>,
}

/// Counts of the messages of a topic.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TopicTally {
    /// Whether the file has the topic, even if it is empty.
    pub declared: bool,
    pub summary: TopicSummary,
    /// The expected sample and the sample found, at the first gap.
    pub first_gap: Option<(u64, u64)>,
    /// The sample after the last.
    pub expected: Option<u64>,
    /// The first sample of the chunk taken in last.
    pub first_of_chunk: Option<u64>,
    /// The latest log time of a batch, ns.
    pub last_log_time_ns: u64,
}

/// Passes through the file once.
pub(super) fn scan(path: &Path) -> Result<Scan, RecordingError> {
    let mut reader = CheckedReader::open(path)?;
    let mut metadata = BTreeMap::new();
    let mut library = String::new();
    let mut tally = Tally::default();
    // What was there before the first message outside a chunk: the rest counts if the data section's checksum is right.
    let mut before_bare_messages = None;
    let mut stated_messages = None;
    let end = loop {
        let offset = reader.offset;
        match reader.next() {
            Ok(Some(TopLevelRecord::Header(name))) => {
                tally.is_numbered = name.starts_with(OUR_LIBRARY);
                library = name;
            }
            Ok(Some(TopLevelRecord::Metadata(name, content))) => {
                if name == metadata::RECORDING && tally.dt_s.is_none() {
                    // First of all: what a later format means by the rest is not known.
                    format(path, &content)?;
                    tally.dt_s = content.get(DT_S).and_then(|value| value.parse().ok());
                }
                metadata.entry(name).or_insert(content);
            }
            Ok(Some(record @ (TopLevelRecord::Chunk | TopLevelRecord::BareMessage))) => {
                if let (TopLevelRecord::BareMessage, None) = (record, &before_bare_messages) {
                    before_bare_messages = Some(tally.clone());
                }
                // On a copy, so that nothing of a chunk counts if any part of it is wrong.
                match tally.clone().with(&reader.contents) {
                    Ok(with) => tally = with,
                    Err(cause) => break Err(reader.damaged(offset, cause)),
                }
            }
            Ok(Some(TopLevelRecord::Statistics(messages))) => stated_messages = Some(messages),
            Ok(Some(TopLevelRecord::Other)) => {}
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    // A wrong checksum of the data section names an earlier byte than where the reading ended.
    let readable_bytes = match &end {
        Err(RecordingError::Damaged { offset, .. }) => *offset,
        _ => reader.offset,
    };
    if let (Err(RecordingError::Damaged { .. }), Some(before)) = (&end, before_bare_messages)
        && readable_bytes < reader.offset
    {
        tally = before;
    }
    let file_bytes = reader.file_bytes;
    let last_sample = tally.samples.map(|(_, last)| last);
    let integrity = match end {
        Ok(()) if !metadata.contains_key(metadata::LOST) => Integrity::Unfinished,
        Ok(()) => match flaw(&tally, &metadata, stated_messages, reader.messages) {
            Some(cause) => Integrity::Incomplete { cause },
            None => Integrity::Complete,
        },
        Err(RecordingError::Truncated { .. }) => Integrity::Truncated { readable_bytes, file_bytes, last_sample },
        Err(RecordingError::Damaged { cause, .. }) => {
            Integrity::Damaged { readable_bytes, file_bytes, last_sample, cause }
        }
        // The file of another program may have a topic of the same name. That it is no recording says more than that
        // its message is another one.
        Err(RecordingError::Schema { .. }) if !metadata.contains_key(metadata::RECORDING) => Integrity::Unfinished,
        Err(error) => return Err(error),
    };
    let lost = lost(path, &metadata)?;
    Ok(Scan { integrity, file_bytes, readable_bytes, library, metadata, lost, tally })
}

/// Returns the first flaw of a file whose every record is in order: messages that are missing or repeated.
fn flaw(
    tally: &Tally,
    metadata: &BTreeMap<String, BTreeMap<String, String>>,
    stated_messages: Option<u64>,
    messages: u64,
) -> Option<String> {
    if let Some(flaw) = &tally.flaw {
        return Some(flaw.clone());
    }
    missing_samples(tally, metadata).or_else(|| wrong_count(tally, stated_messages, messages))
}

/// Compares the count of samples in the statistics of the run with the states that are in the file.
fn missing_samples(tally: &Tally, metadata: &BTreeMap<String, BTreeMap<String, String>>) -> Option<String> {
    // The samples of a run are its states, unless the recorder lost some.
    let lost = metadata.get(metadata::LOST)?.values().any(|count| count != "0");
    let stated: u64 = metadata.get(metadata::STATISTICS)?.get(metadata::SAMPLES)?.parse().ok()?;
    let states = &tally.topics[Topic::States as usize];
    let found = states.summary.records;
    (!lost && states.declared && found < stated)
        .then(|| format!("the statistics count {stated} samples, but the file has {found}"))
}

/// Compares the file's own count of messages with those that were read.
fn wrong_count(tally: &Tally, stated_messages: Option<u64>, messages: u64) -> Option<String> {
    match stated_messages {
        Some(stated) if stated != messages => {
            Some(format!("the file's index counts {stated} messages, but the file has {messages}"))
        }
        // Other writers may leave it out.
        None if tally.is_numbered => Some(String::from(
            "the count of its messages, with which the recorder ends a file, was removed, so the number of missing messages is unknown",
        )),
        _ => None,
    }
}

/// Returns the counts of lost records.
pub(super) fn lost(
    path: &Path,
    metadata: &BTreeMap<String, BTreeMap<String, String>>,
) -> Result<BTreeMap<String, u64>, RecordingError> {
    let entries = metadata.get(metadata::LOST).into_iter().flatten();
    let parsed = entries.map(|(channel, count)| match count.parse() {
        Ok(count) => Ok((channel.clone(), count)),
        Err(_) => Err(RecordingError::Metadata {
            path: path.to_path_buf(),
            name: metadata::LOST,
            key: channel.clone(),
            got: count.clone(),
            expected: "a count of records",
        }),
    });
    parsed.collect()
}

impl Scan {
    /// Returns the metadata record `name`, which must be there.
    pub fn required(&self, path: &Path, name: &'static str) -> Result<&BTreeMap<String, String>, RecordingError> {
        self.metadata.get(name).ok_or_else(|| {
            let path = path.to_path_buf();
            let ours = self.library.is_empty() || self.library.starts_with(OUR_LIBRARY);
            let whole = matches!(self.integrity, Integrity::Complete | Integrity::Unfinished);
            match ours {
                false => RecordingError::NotARecording { path, name, library: self.library.clone() },
                true if whole => RecordingError::NotARecording { path, name, library: String::new() },
                true => RecordingError::NothingLeft { path, name, readable_bytes: self.readable_bytes },
            }
        })
    }

    /// Returns the origin of the recording, from its metadata.
    pub fn origin(&self, path: &Path) -> Result<Origin, RecordingError> {
        let about = self.required(path, metadata::RECORDING)?;
        let value = |key: &'static str| about.get(key).cloned().unwrap_or_default();
        let wrong = |key: &'static str, expected: &'static str| RecordingError::Metadata {
            path: path.to_path_buf(),
            name: metadata::RECORDING,
            key: key.to_string(),
            got: value(key),
            expected,
        };
        let format = format(path, about)?;
        let dt_s = match value(DT_S).parse::<f64>() {
            Ok(dt_s) if dt_s.is_finite() && dt_s > 0.0 => dt_s,
            Ok(_) => return Err(wrong(DT_S, "a finite time above 0 s")),
            Err(_) => return Err(wrong(DT_S, "a time in s")),
        };
        let start = self.metadata.get(metadata::START).unwrap_or(about).get(metadata::START_UNIX_NS);
        let start_unix_ns = match start.map(|start| start.parse::<u64>()).transpose() {
            Ok(start) => start.filter(|start| *start > 0),
            Err(_) => return Err(wrong(metadata::START_UNIX_NS, "a time in ns")),
        };
        let time =
            RunTime::stated(&value("time")).ok_or_else(|| wrong("time", "`simulated`, `lockstep` or `real-time`"))?;
        let every = "plot_every_samples";
        let plot_every_samples = value(every).parse().map_err(|_| wrong(every, "a number of samples"))?;
        let reading_delay_samples = match value(READING_DELAY).parse::<f64>() {
            Ok(delay) if delay.is_finite() && delay >= 0.0 => delay,
            _ => return Err(wrong(READING_DELAY, "a number of samples, 0 or more")),
        };
        Ok(Origin {
            dt_s,
            interface: value("interface"),
            format,
            time,
            start_unix_ns,
            plot_every_samples,
            reading_delay_samples,
            build: BuildInfo {
                version: value(metadata::VERSION),
                git_commit: value("git_commit"),
                target: value("target"),
                profile: value("profile"),
                compiler: value("compiler"),
            },
        })
    }
}

/// Returns the version of the format, if this version can read it.
fn format(path: &Path, about: &BTreeMap<String, String>) -> Result<u32, RecordingError> {
    let value = |key| about.get(key).cloned().unwrap_or_default();
    let got = value(metadata::FORMAT);
    match got.parse() {
        Ok(FORMAT) => Ok(FORMAT),
        Ok(format) => {
            Err(RecordingError::OtherFormat { path: path.to_path_buf(), format, writer: value(metadata::VERSION) })
        }
        Err(_) => Err(RecordingError::Metadata {
            path: path.to_path_buf(),
            name: metadata::RECORDING,
            key: String::from(metadata::FORMAT),
            got,
            expected: "a version of the format",
        }),
    }
}

impl Tally {
    /// Adds the chunk that was read last. The error describes an invalid message in it.
    pub fn with(mut self, contents: &Contents) -> Result<Tally, String> {
        self.topics.iter_mut().for_each(|topic| topic.first_of_chunk = None);
        for declared in contents.declared() {
            let topic = declared.topic;
            self.topics[topic as usize].declared = true;
            declared.layout.iter().for_each(|layout| self.channels.set(topic, &layout.channels));
        }
        for message in contents.messages() {
            self.check_place(&message);
            let topic = message.topic;
            let summary = &mut self.topics[topic as usize].summary;
            summary.messages += 1;
            summary.bytes += message.bytes.len() as u64;
            self.take(message)?;
        }
        Ok(self)
    }

    /// Notes a message at an unexpected place in its topic: one that is repeated, late, or behind a missing one.
    fn check_place(&mut self, message: &RawMessage<'_>) {
        let topic = message.topic;
        let found = &mut self.topics[topic as usize];
        let name = topic.name();
        // The number wraps, as the recorder's does.
        let expected = found.summary.messages as u32;
        if self.is_numbered && message.sequence != expected {
            let got = message.sequence;
            self.flaw.get_or_insert_with(|| {
                format!(
                    "expected message {expected} of topic {name}, got message {got}: messages are missing, \
                     repeated or late"
                )
            });
        }
        // Frames don't come one a sample: without numbers the times alone show that a batch is late.
        let is_late = !self.is_numbered && topic == Topic::Frames && message.log_time_ns < found.last_log_time_ns;
        if is_late {
            self.flaw.get_or_insert_with(|| format!("messages of topic {name} are repeated or late"));
        }
        found.last_log_time_ns = found.last_log_time_ns.max(message.log_time_ns);
    }

    fn event(&mut self, event: &Event<String>) {
        match event.name.as_str() {
            FAULT_EVENT => {
                let emergency = self.partner_emergency.take();
                if self.faults.len() < MOST_FAULTS {
                    self.faults.push(RecordedFault::new(event.sample, event.value).with_partner(emergency));
                }
            }
            PARTNER_EVENT => self.partner_emergency = Some((event.sample, event.value)),
            ARMED_EVENT => self.partner_emergency = None,
            OTHER_SENDER_EVENT => self.other_sender_frames += 1,
            _ => {}
        }
    }

    /// Rejects a batch whose sample period differs from that of the others.
    fn check_period(&mut self, got_s: f64) -> Result<(), String> {
        let expected_s = *self.dt_s.get_or_insert(got_s);
        if got_s.to_bits() == expected_s.to_bits() {
            return Ok(());
        }
        let got_s = short(&got_s);
        let expected_s = short(&expected_s);
        Err(format!("a batch states the sample period {got_s} s, expected {expected_s} s"))
    }

    /// Counts the records of one message.
    fn take(&mut self, message: RawMessage<'_>) -> Result<(), String> {
        match message.topic {
            Topic::States => self.numbers::<StateRecord>(message),
            Topic::Samples => self.numbers::<SampleRecord>(message),
            topic => decode(message, |record| self.record(topic, &record)),
        }
    }

    /// Counts a batch of states or readings, without making records of it.
    fn numbers<R: Numbers>(&mut self, message: RawMessage<'_>) -> Result<(), String> {
        let Some(batch) = number_batch::<R>(message)? else { return Ok(()) };
        if let Some((first, last)) = batch.samples()? {
            self.clipped_samples += batch.clipped_samples() as u64;
            self.samples(message.topic, first, last);
        }
        self.check_period(batch.dt_s())
    }

    /// Adds one record to the counts of its topic.
    fn record(&mut self, topic: Topic, record: &Record<String>) {
        if let Record::Event(event) = record {
            self.event(event);
        }
        self.samples(topic, record.sample(), record.sample());
    }

    /// Counts one record for each of these samples.
    fn samples(&mut self, topic: Topic, first: u64, last: u64) {
        let (least, most) = self.samples.unwrap_or((first, last));
        self.samples = Some((least.min(first), most.max(last)));
        let has_every_sample = matches!(topic, Topic::States | Topic::Samples | Topic::Ticks);
        let name = topic.name();
        let topic = &mut self.topics[topic as usize];
        topic.summary.records += last - first + 1;
        if has_every_sample {
            if let Some(expected) = topic.expected.filter(|&expected| expected != first) {
                topic.first_gap.get_or_insert((expected, first));
                if first > expected {
                    topic.summary.gaps += 1;
                } else {
                    topic.summary.repeated += last.saturating_add(1).min(expected) - first;
                    self.flaw.get_or_insert_with(|| {
                        format!(
                            "samples from {first} on are repeated or late in topic {name}, behind sample {}",
                            expected - 1
                        )
                    });
                }
            }
            topic.first_of_chunk.get_or_insert(first);
            topic.expected = topic.expected.max(last.checked_add(1));
        }
    }
}
