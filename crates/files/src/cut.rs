//! Copies a part of a recording to a recording, and joins parts.

use core::ops::RangeInclusive;
use std::collections::BTreeSet;
use std::path::Path;

use crate::recording::{
    Configuration, Event, Existing, FlushPolicy, Integrity, Naming, Options, Origin, Record, Recorder, Recording,
    RecordingError, RunTime, Summary,
};
use crate::staged::same_file;
use crate::starting_plant::{PLANT, noted, without_plant};
use resonarm_numeric::number::short;

/// Capacity of the queue of records to the writer.
const CAPACITY: usize = 8192;
/// Most names of events that are copied; a recorder writes a dozen.
const NAMES: usize = 1000;

/// Copies the records of some samples into a new recording, which can be replayed and re-simulated like the old one.
/// The old one's description of the run is kept. The description of its build moves to the keys `cut.version` and
/// `cut.git_commit`, and the state of the plant before the first sample to `cut.plant`, if the run up to there can be
/// re-simulated. Messages for plotting are made again.
///
/// A part of a recording that is not whole is not whole either: it opens as [`Integrity::Unfinished`].
///
/// # Errors
/// [`RecordingError`] if the recording can't be read or the new one not be written; [`RecordingError::SameFile`] if
/// they are one file; [`RecordingError::NothingToCopy`] if there is no record. No file is written then, and a file that
/// was to be overwritten is kept.
pub fn cut(
    recording: &Recording,
    samples: RangeInclusive<u64>,
    path: &Path,
    existing: Existing,
) -> Result<Summary, RecordingError> {
    // The state of the plant at the first sample is needed to re-simulate the part. For sample 0 it is in the scenario.
    let first = recording.summary().samples.map_or(0, |(first, _)| first.max(*samples.start()));
    join(&[recording], samples, path, existing, (first > 0).then(|| noted(recording, first)).flatten())
}

/// Joins recordings of one run that follow each other, as [`cut`] makes them.
///
/// # Errors
/// As [`cut`]; [`RecordingError::Apart`] if they are not of one run: another sample period, another configuration,
/// another start, or a sample that is not behind the last of those before.
pub fn merge(recordings: &[&Recording], path: &Path, existing: Existing) -> Result<Summary, RecordingError> {
    let mut last = recordings.first().and_then(|first| first.summary().samples);
    for pair in recordings.windows(2) {
        let [before, behind] = pair else { continue };
        check_follows(before, behind, last)?;
        // Behind a part without a record stands what follows the part before it.
        last = behind.summary().samples.or(last);
    }
    let noted = recordings.first().and_then(|first| first.configuration().get(PLANT)).map(str::to_owned);
    join(recordings, 0..=u64::MAX, path, existing, noted)
}

/// Rejects a recording that is not of the same run, or has no later samples than `last`.
fn check_follows(before: &Recording, behind: &Recording, last: Option<(u64, u64)>) -> Result<(), RecordingError> {
    let ours = before.origin();
    let theirs = behind.origin();
    let (expected, got) = match (last, behind.summary().samples) {
        _ if ours.dt_s.to_bits() != theirs.dt_s.to_bits() => {
            let period = |dt_s: f64| format!("the sample period {} s", short(&dt_s));
            (period(ours.dt_s), period(theirs.dt_s))
        }
        _ if of_the_run(before) != of_the_run(behind) => {
            (String::from("the same"), String::from("another configuration (see `resonarm diff`)"))
        }
        // Without a record a recording does not say when its run began.
        (Some(_), Some(_)) if before.summary().samples.is_some() && ours.start_unix_ns != theirs.start_unix_ns => {
            (format!("one that began {}", began(ours)), format!("a run that began {}", began(theirs)))
        }
        (Some((_, last)), Some((first, _))) if first <= last => {
            (format!("samples after {last}"), format!("samples from {first} on"))
        }
        _ => return Ok(()),
    };
    Err(RecordingError::Apart { path: behind.path().to_path_buf(), got, expected })
}

/// Describes the time at which a run began.
fn began(origin: &Origin) -> String {
    match origin.start_unix_ns {
        Some(ns) => format!("{}.{:09} s after the UNIX epoch", ns / 1_000_000_000, ns % 1_000_000_000),
        None => String::from("at no stated time"),
    }
}

/// Returns the configuration that all parts of a run share: all of it except the plant at the first sample.
fn of_the_run(recording: &Recording) -> Vec<(&str, &str)> {
    without_plant(recording.configuration()).collect()
}

fn join(
    recordings: &[&Recording],
    samples: RangeInclusive<u64>,
    path: &Path,
    existing: Existing,
    plant: Option<String>,
) -> Result<Summary, RecordingError> {
    let Some(first) = recordings.first() else {
        return Err(RecordingError::Option {
            option: "recordings",
            got: String::from("none"),
            expected: "at least one recording",
        });
    };
    for recording in recordings {
        if same_file(recording.path(), path) {
            return Err(RecordingError::SameFile { path: path.to_path_buf() });
        }
    }
    let recorder = Recorder::create(path, &configuration(first, plant), options(first, existing))?;
    let mut channel = recorder.channel("cut", CAPACITY)?;
    // The recorder of an empty selection is dropped without a record, and leaves no file.
    let mut names = Names::default();
    let mut is_empty = true;
    for recording in recordings {
        for record in recording.records()? {
            let record = record?;
            if samples.contains(&record.sample()) {
                is_empty = false;
                channel.push_blocking(&names.record(record, recording.path())?)?;
            }
        }
    }
    if is_empty {
        let sources = recordings.iter().map(|it| (it.path().to_path_buf(), it.integrity().clone())).collect();
        return Err(RecordingError::NothingToCopy { sources, samples });
    }
    // The file itself is complete in either case. If a source was not, the copy must say so, or it would pass as
    // evidence of a whole run.
    let is_whole = recordings.iter().all(|recording| *recording.integrity() == Integrity::Complete);
    let statistics = [("cut_from_whole_recordings", is_whole.to_string())];
    if is_whole {
        return recorder.finish(&statistics);
    }
    let told = |told: fn(&Recording) -> String| recordings.iter().map(|it| told(it)).collect::<Vec<_>>().join(", ");
    let source = told(|recording| recording.path().display().to_string());
    let integrity = told(|recording| recording.integrity().to_string());
    recorder.finish_partial(&statistics, &[("source", source), ("source_integrity", integrity)])
}

/// Returns the description of the run for a part: the same as that of the whole, the build that recorded it, and the
/// plant at its first sample.
fn configuration(recording: &Recording, plant: Option<String>) -> Configuration {
    let build = &recording.origin().build;
    let cut = [("cut.version", &build.version), ("cut.git_commit", &build.git_commit)];
    let there = without_plant(recording.configuration());
    let there = there.fold(Configuration::new(), |there, (key, value)| there.with(key, value));
    let there = plant.into_iter().fold(there, |there, plant| there.with(PLANT, plant));
    cut.into_iter().fold(there, |configuration, (key, value)| match configuration.get(key) {
        Some(_) => configuration,
        // A part of a part keeps the build of the run, not that of the first cut.
        None => configuration.with(key, value),
    })
}

/// Returns the options for the part: those of the whole.
fn options(recording: &Recording, existing: Existing) -> Options {
    let origin = recording.origin();
    Options {
        time: origin.time,
        clock_epoch_unix_ns: (origin.time != RunTime::Simulated).then(|| origin.start_unix_ns.unwrap_or(0)),
        // The flushes go by samples and not by time, so that the same cut produces identical bytes.
        flush: FlushPolicy::Samples(1000),
        existing,
        naming: Naming::Whole,
        plot_every_samples: origin.plot_every_samples,
        reading_delay_samples: origin.reading_delay_samples,
        channels: recording.channels().clone(),
        ..Options::virtual_time(origin.dt_s, &origin.interface)
    }
}

/// Names of events. A record on its way to the recorder borrows its name forever; a run has a dozen of them.
#[derive(Default)]
struct Names(BTreeSet<&'static str>);

impl Names {
    /// Returns the record with a name of static lifetime.
    fn record(&mut self, record: Record<String>, path: &Path) -> Result<Record, RecordingError> {
        Ok(match record {
            Record::State(record) => Record::State(record),
            Record::Sample(record) => Record::Sample(record),
            Record::Frame(record) => Record::Frame(record),
            Record::Tick(record) => Record::Tick(record),
            Record::Event(Event { sample, time_ns, name, value }) => {
                Record::Event(Event { sample, time_ns, name: self.name(name, path)?, value })
            }
        })
    }

    fn name(&mut self, name: String, path: &Path) -> Result<&'static str, RecordingError> {
        if let Some(known) = self.0.get(name.as_str()) {
            return Ok(known);
        }
        if self.0.len() == NAMES {
            return Err(RecordingError::Names { path: path.to_path_buf(), most: NAMES });
        }
        // Records in a ring have static names. The number of names is bounded, and so is what is leaked.
        let name: &'static str = name.leak();
        self.0.insert(name);
        Ok(name)
    }
}
