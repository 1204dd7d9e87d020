//! `resonarm diff`: two recordings compared.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::flags;
use crate::help::heading;
use crate::output::{JsonFlag, in_line};
use crate::recordings::{TimeRange, verdict, warn_of_one};
use resonarm::diff::{DiffOptions, Difference, PartDifference, diff};
use resonarm::export::{RecordingPart, samples};
use resonarm::recording::Recording;
use resonarm_numeric::number::short;

/// The parts of recordings that can be compared.
const PARTS: [RecordingPart; 4] =
    [RecordingPart::States, RecordingPart::Samples, RecordingPart::Frames, RecordingPart::Events];

/// The parts that are compared without --parts.
const DEFAULT: [RecordingPart; 2] = [RecordingPart::States, RecordingPart::Samples];

/// Compares two recordings sample by sample.
///
/// The exit code is 1 if their records differ beyond the tolerance, or if one of them is not whole. Differences in their
/// configuration are listed, too.
#[derive(Debug, Args)]
#[command(
    after_long_help = "States and samples are compared by their sample, frames and events in their order, whenever \
                        they were on the bus.\nExample: resonarm diff a.mcap b.mcap --parts states --tolerance 1e-9"
)]
pub(crate) struct Diff {
    /// First recording, A.
    #[arg(value_name = "A")]
    a: PathBuf,
    /// Second recording, B.
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Records to compare, separated by commas [default: states,samples, or frames if there are neither].
    #[arg(long, help_heading = heading::RECORDS, value_name = "PARTS", value_delimiter = ',', value_parser = flags::one_of(PARTS, RecordingPart::name))]
    parts: Vec<RecordingPart>,
    /// Largest accepted difference, relative to the channel's largest magnitude in A; 0 is bit-identical.
    #[arg(long, help_heading = heading::TEST, value_name = "X", default_value_t = 0.0)]
    tolerance: f64,
    #[command(flatten)]
    range: TimeRange,
    #[command(flatten)]
    json: JsonFlag,
}

impl Diff {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        if self.tolerance < 0.0 {
            return Err(Failure::value("--tolerance", self.tolerance, "it must be 0 or more"));
        }
        let a = Recording::open(&self.a)?;
        let b = Recording::open(&self.b)?;
        [&a, &b].into_iter().for_each(warn_of_one);
        let samples = match (self.range.from_s, self.range.to_s) {
            (None, None) => 0..=u64::MAX,
            // Times are converted by the time step of A. The same samples are compared in both recordings.
            (from_s, to_s) => samples(&a, from_s, to_s)?,
        };
        let compare = |parts: &[RecordingPart]| {
            diff(&a, &b, &DiffOptions { parts: parts.to_vec(), tolerance: self.tolerance, samples: samples.clone() })
        };
        // Frames are not compared by default: on a bus they may come at other times with the same states.
        let mut difference = compare(if self.parts.is_empty() { &DEFAULT } else { &self.parts })?;
        // Recordings of imported logs have neither states nor samples, only frames.
        if self.parts.is_empty() && is_empty(&difference) {
            difference = compare(&[RecordingPart::Frames])?;
        }
        if is_empty(&difference) {
            let parts: Vec<_> = difference.parts.iter().map(|part| part.part).collect();
            let range = if (self.range.from_s, self.range.to_s) == (None, None) { "" } else { " in this range" };
            let parts = parts.join(", ");
            return Err(Failure::usage(format!(
                "nothing to compare: neither recording has {parts}{range}; choose others by --parts, of {}",
                PARTS.map(RecordingPart::name).join(", ")
            )));
        }
        self.json.show(&difference, || text(&difference), &[])?;
        Ok(Verdict::of(difference.same).and(verdict(&a)).and(verdict(&b)))
    }
}

/// Says whether neither recording has records of the compared parts.
fn is_empty(difference: &Difference) -> bool {
    difference.parts.iter().all(|part| part.compared == 0 && part.only_in_a == 0 && part.only_in_b == 0)
}

fn text(difference: &Difference) -> String {
    let mut text = String::new();
    difference.parts.iter().for_each(|part| text.push_str(&part_text(part)));
    for entry in &difference.configuration {
        let [a, b] = [&entry.a, &entry.b].map(|value| in_line(value.as_deref().unwrap_or("absent")));
        text += &format!("{}: {a} in A, {b} in B\n", in_line(&entry.key));
    }
    text
}

fn part_text(part: &PartDifference) -> String {
    let PartDifference { part, compared, only_in_a, only_in_b, first_difference, channels } = part;
    let mut text = format!("{part}: {compared} compared");
    for (count, place) in [(only_in_a, "A"), (only_in_b, "B")] {
        if *count > 0 {
            text += &format!(", {count} only in {place}");
        }
    }
    text += &match first_difference {
        Some(first) => {
            let [a, b] = [&first.a, &first.b].map(|value| in_line(value));
            format!("; first difference at sample {}: {} is {a} in A, {b} in B\n", first.sample, first.what)
        }
        None if channels.is_empty() => String::from("; all the same\n"),
        None => String::from("; all within the tolerance\n"),
    };
    for channel in channels {
        let largest = short(&channel.largest);
        let magnitude = short(&channel.magnitude);
        let name = channel.name;
        let sample = channel.sample;
        text += &format!("  {name}: at most {largest} apart, at sample {sample}; at most {magnitude} in A\n");
    }
    text
}
