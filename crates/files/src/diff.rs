//! Compares two recordings, record by record.
//!
//! States and samples are paired by their sample, frames and events by their order. Neither recording is held in
//! memory.

use core::cmp::Ordering;
use core::ops::RangeInclusive;
use std::collections::BTreeMap;

use serde::Serialize;

use crate::export::RecordingPart;
use crate::recording::{Direction, Record, Recording, RecordingError, SampleRecord};
use crate::starting_plant::without_plant;
use resonarm_bench::structure::{ChannelName, READINGS};
use resonarm_numeric::number::short;

/// Selection and tolerance of a comparison of two recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffOptions {
    /// The records that are compared. Those of the real-time loop's punctuality, [`RecordingPart::Ticks`], differ in
    /// every run, so they are left out.
    pub parts: Vec<RecordingPart>,
    /// Largest difference of a channel, as a share of its largest magnitude in the first recording; at 0 every bit
    /// counts.
    pub tolerance: f64,
    /// Range of samples that are compared.
    pub samples: RangeInclusive<u64>,
}

/// The difference between two recordings, A and B.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Whether all records that were compared are the same within the tolerance, and none is in one recording alone.
    pub same: bool,
    /// Tolerance with which the values were compared.
    pub tolerance: f64,
    /// Result for each kind of records.
    pub parts: Vec<PartDifference>,
    /// Differences in the descriptions of the recordings, by key; they do not make the recordings different.
    pub configuration: Vec<KeyDifference>,
}

/// The difference between the records of one kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PartDifference {
    /// Name of the kind of records.
    pub part: &'static str,
    /// Records that are in both.
    pub compared: u64,
    /// Records of A without one of B.
    pub only_in_a: u64,
    /// Records of B without one of A.
    pub only_in_b: u64,
    /// The first two that differ beyond the tolerance.
    pub first_difference: Option<FirstDifference>,
    /// The largest difference of every channel that differs.
    pub channels: Vec<ChannelDifference>,
}

/// Two records that differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FirstDifference {
    /// The sample in A.
    pub sample: u64,
    /// The channel, or the mark, `is_end` or `clipped`; for frames and events, `frame` or `event`.
    pub what: ChannelName,
    /// Value in recording A.
    pub a: String,
    /// Value in recording B.
    pub b: String,
}

/// The difference of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChannelDifference {
    /// Its name, with the unit.
    pub name: ChannelName,
    /// The largest difference, in that unit.
    pub largest: f64,
    /// Sample at which the difference is largest.
    pub sample: u64,
    /// The largest magnitude in A, in that unit, to which the tolerance is relative.
    pub magnitude: f64,
}

/// An entry of the descriptions that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KeyDifference {
    /// The key; for a scenario with its tables, as `scenario.structure.angles_deg`.
    pub key: String,
    /// Value in A, if it has one.
    pub a: Option<String>,
    /// Value in B, if it has one.
    pub b: Option<String>,
}

/// Compares two recordings.
///
/// # Errors
/// [`RecordingError`] if one of them can't be read.
pub fn diff(a: &Recording, b: &Recording, options: &DiffOptions) -> Result<Difference, RecordingError> {
    let parts = options.parts.iter().filter(|part| **part != RecordingPart::Ticks);
    let parts = parts.map(|part| compare(a, b, *part, options)).collect::<Result<Vec<_>, _>>()?;
    let is_same = |part: &PartDifference| part.first_difference.is_none() && part.only_in_a == 0 && part.only_in_b == 0;
    Ok(Difference {
        same: parts.iter().all(is_same),
        tolerance: options.tolerance,
        parts,
        configuration: configuration(a, b),
    })
}

/// A record in the form in which it is compared.
struct Row {
    /// Key by which its partner is found: its sample, or its place among the frames or events.
    key: u64,
    sample: u64,
    numbers: Vec<f64>,
    /// The other content as text: the frame, the event, the marks of a state or of readings.
    text: String,
}

/// Returns the records of a part, in the form in which they are compared.
fn rows<'r>(
    recording: &'r Recording,
    part: RecordingPart,
    samples: &RangeInclusive<u64>,
) -> Result<impl Iterator<Item = Result<Row, RecordingError>> + use<'r>, RecordingError> {
    let samples = samples.clone();
    let mut count = 0;
    Ok(recording.records()?.filter_map(move |record| {
        let row = record.map(|record| row(part, &record).filter(|row| samples.contains(&row.sample)));
        row.transpose().map(|row| {
            row.map(|row| {
                count += 1;
                // Frames and events have no numbers. They are paired by their order, since one sample may have
                // several.
                Row { key: if row.numbers.is_empty() { count } else { row.key }, ..row }
            })
        })
    }))
}

fn row(part: RecordingPart, record: &Record<String>) -> Option<Row> {
    let sample = record.sample();
    let numbers = |numbers: &[f64], text| Some(Row { key: sample, sample, numbers: numbers.to_vec(), text });
    let text = |text: String| Some(Row { key: 0, sample, numbers: Vec::new(), text });
    match (part, record) {
        (RecordingPart::States, Record::State(state)) => numbers(&state.values(), u8::from(state.is_end).to_string()),
        (RecordingPart::Samples, Record::Sample(readings)) => numbers(&readings.values(), marks(readings)),
        (RecordingPart::Frames, Record::Frame(frame)) => {
            let direction = if frame.direction == Direction::Sent { "sent" } else { "received" };
            text(format!("{direction} {}", frame.frame))
        }
        (RecordingPart::Events, Record::Event(event)) => {
            text(format!("{} {} at sample {sample}", event.name, event.value))
        }
        _ => None,
    }
}

/// Describes the readings that are marked.
fn marks(readings: &SampleRecord) -> String {
    let bits = readings.clipped_bits();
    let own = READINGS.len();
    let name = |place: usize| match READINGS.get(place) {
        Some(channel) => channel.name.to_string(),
        None => format!("reading {} of the other sensors", place - own + 1),
    };
    let names: Vec<_> = (0..u32::BITS as usize).filter(|place| bits >> place & 1 == 1).map(name).collect();
    if names.is_empty() { String::from("none") } else { names.join(" and ") }
}

fn compare(
    a: &Recording,
    b: &Recording,
    part: RecordingPart,
    options: &DiffOptions,
) -> Result<PartDifference, RecordingError> {
    let channels = magnitudes(a, part, options)?;
    let of_b = b.channels().of(part.topic());
    // By name: the recordings may have different instruments, and their channels other places.
    let place = |channel: &ChannelDifference| of_b.iter().position(|of| of.name == channel.name);
    let mut found = Found {
        tolerance: options.tolerance,
        places: channels.iter().map(place).collect(),
        channels,
        part: PartDifference { part: part.name(), ..PartDifference::default() },
    };
    let mut ours = rows(a, part, &options.samples)?;
    let mut theirs = rows(b, part, &options.samples)?;
    let mut left = ours.next().transpose()?;
    let mut right = theirs.next().transpose()?;
    loop {
        // A merge of two sequences whose keys rise: whichever key is smaller has no partner in the other recording.
        let order = match (&left, &right) {
            (None, None) => break,
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (Some(left), Some(right)) => left.key.cmp(&right.key),
        };
        match order {
            Ordering::Less => found.part.only_in_a += 1,
            Ordering::Greater => found.part.only_in_b += 1,
            Ordering::Equal => {
                if let (Some(left), Some(right)) = (&left, &right) {
                    found.take(part, left, right);
                }
            }
        }
        if order.is_le() {
            left = ours.next().transpose()?;
        }
        if order.is_ge() {
            right = theirs.next().transpose()?;
        }
    }
    found.part.channels = found.channels.into_iter().filter(|channel| channel.largest > 0.0).collect();
    Ok(found.part)
}

/// Returns the channels of a part with their magnitudes in A, and no difference yet.
fn magnitudes(
    a: &Recording,
    part: RecordingPart,
    options: &DiffOptions,
) -> Result<Vec<ChannelDifference>, RecordingError> {
    let names = a.channels().of(part.topic()).iter().map(|channel| channel.name);
    let mut channels: Vec<_> =
        names.map(|name| ChannelDifference { name, largest: 0.0, sample: 0, magnitude: 0.0 }).collect();
    if !channels.is_empty() {
        for row in rows(a, part, &options.samples)? {
            for (channel, value) in channels.iter_mut().zip(row?.numbers) {
                channel.magnitude = channel.magnitude.max(value.abs());
            }
        }
    }
    Ok(channels)
}

/// Differences found so far.
struct Found {
    tolerance: f64,
    channels: Vec<ChannelDifference>,
    /// The places of these channels in B.
    places: Vec<Option<usize>>,
    part: PartDifference,
}

impl Found {
    fn take(&mut self, part: RecordingPart, left: &Row, right: &Row) {
        self.part.compared += 1;
        let sample = left.sample;
        let a = &left.text;
        let b = &right.text;
        if a != b {
            let what = match part {
                RecordingPart::States => "is_end",
                RecordingPart::Samples => "clipped",
                RecordingPart::Frames => "frame",
                RecordingPart::Events | RecordingPart::Ticks => "event",
            };
            let first = || FirstDifference { sample, what: what.into(), a: a.clone(), b: b.clone() };
            self.part.first_difference.get_or_insert_with(first);
        }
        let numbers = left.numbers.iter().zip(&self.places);
        for (channel, (a, place)) in self.channels.iter_mut().zip(numbers) {
            // A channel that B does not have is no difference of its samples: the scenarios differ.
            let Some(b) = place.and_then(|place| right.numbers.get(place)) else { continue };
            // By bits, so that two NaN of the same bits are equal and 0 differs from −0.
            if a.to_bits() == b.to_bits() {
                continue;
            }
            let apart = (a - b).abs();
            if apart > channel.largest {
                channel.largest = apart;
                channel.sample = sample;
            }
            // At a tolerance of 0 every bit counts. The comparison alone would accept 0 against −0, whose distance is
            // 0.
            let within = self.tolerance > 0.0 && apart <= self.tolerance * channel.magnitude;
            if !within {
                let [a, b] = [a, b].map(|value| short(value).to_string());
                self.part.first_difference.get_or_insert(FirstDifference { sample, what: channel.name, a, b });
            }
        }
    }
}

/// Returns the entries in which two recordings describe themselves differently.
fn configuration(a: &Recording, b: &Recording) -> Vec<KeyDifference> {
    let a = entries(a);
    let b = entries(b);
    let mut keys: Vec<_> = a.keys().chain(b.keys()).collect();
    keys.sort_unstable();
    keys.dedup();
    let differences = keys.into_iter().filter(|key| a.get(*key) != b.get(*key));
    differences.map(|key| KeyDifference { key: key.clone(), a: a.get(key).cloned(), b: b.get(key).cloned() }).collect()
}

/// Returns a recording's description of itself: configuration, sample period, time base, bus and build.
fn entries(recording: &Recording) -> BTreeMap<String, String> {
    let origin = recording.origin();
    let own = [
        ("recording.dt_s", short(&origin.dt_s).to_string()),
        ("recording.time", origin.time.name().to_owned()),
        ("recording.interface", origin.interface.clone()),
        ("recording.version", origin.build.version.clone()),
        ("recording.git_commit", origin.build.git_commit.clone()),
    ];
    let mut entries = BTreeMap::from(own.map(|(key, value)| (key.to_owned(), value)));
    for (key, text) in without_plant(recording.configuration()) {
        match text.parse::<toml::Table>() {
            // A number or a word alone is no document.
            Ok(table) if text.contains('=') => flatten(key, &toml::Value::Table(table), &mut entries),
            _ => drop(entries.insert(key.to_owned(), text.to_owned())),
        }
    }
    entries
}

/// Flattens a document into its values by their keys.
fn flatten(key: &str, value: &toml::Value, entries: &mut BTreeMap<String, String>) {
    match value {
        toml::Value::Table(table) => {
            table.iter().for_each(|(name, value)| flatten(&format!("{key}.{name}"), value, entries))
        }
        value => drop(entries.insert(key.to_owned(), value.to_string())),
    }
}
