//! `resonarm diff`: two recordings compared.

use core::fmt::Write;
use std::path::PathBuf;

use clap::Args;

use crate::commands::inspect;
use crate::failure::{Failure, Verdict};
use crate::flags;
use crate::output::{self, in_line};
use crate::time_range::TimeRange;
use resonarm::diff::{DiffOptions, Difference, PartDifference, diff};
use resonarm::export::{RecordingPart, samples};
use resonarm::recording::Recording;
use resonarm_numeric::number::short;

/// What can be compared.
const PARTS: [RecordingPart; 4] =
    [RecordingPart::States, RecordingPart::Samples, RecordingPart::Frames, RecordingPart::Events];

/// Compares two recordings sample by sample: exit code 1 if their records differ beyond the tolerance. Differences in
/// their configuration are listed, too.
#[derive(Debug, Args)]
#[command(after_help = "States and samples are compared by their sample, frames and events in their order, whenever \
                        they were on the bus.\nExample: resonarm diff a.mcap b.mcap --parts states --tolerance 1e-9")]
pub(crate) struct Diff {
    /// The first recording, A.
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The second recording, B.
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Which records, separated by commas: states, samples, frames, events.
    #[arg(long, value_name = "PARTS", value_delimiter = ',', value_parser = flags::one_of(PARTS, RecordingPart::name), default_value = "states,samples")]
    parts: Vec<RecordingPart>,
    /// How much a channel may differ, relative to its largest magnitude in A; at 0 every bit counts.
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    tolerance: f64,
    #[command(flatten)]
    range: TimeRange,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

impl Diff {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        if self.tolerance < 0.0 {
            return Err(Failure::Usage(format!("--tolerance is {}: it must be 0 or more", short(&self.tolerance))));
        }
        let (a, b) = (Recording::open(&self.a)?, Recording::open(&self.b)?);
        for recording in [&a, &b] {
            if let Some(note) = inspect::integrity_note(recording.integrity()) {
                tracing::warn!("{}: {note}", recording.path().display());
            }
        }
        let samples = match (self.range.from_s, self.range.to_s) {
            (None, None) => 0..=u64::MAX,
            (from_s, to_s) => samples(&a, from_s, to_s)?,
        };
        let options = DiffOptions { parts: self.parts.clone(), tolerance: self.tolerance, samples };
        let difference = diff(&a, &b, &options)?;
        if self.json {
            output::print_json(&difference)?;
        } else {
            output::print(&text(&difference))?;
        }
        Ok(Verdict::of(difference.same))
    }
}

fn text(difference: &Difference) -> String {
    let mut text = String::new();
    difference.parts.iter().for_each(|part| text.push_str(&part_text(part)));
    for entry in &difference.configuration {
        let [a, b] = [&entry.a, &entry.b].map(|value| in_line(value.as_deref().unwrap_or("absent")));
        let _infallible = writeln!(text, "{}: {a} in A, {b} in B", in_line(&entry.key));
    }
    text
}

fn part_text(part: &PartDifference) -> String {
    let PartDifference { part, compared, only_in_a, only_in_b, first_difference, channels } = part;
    let mut text = format!("{part}: {compared} compared");
    for (count, place) in [(only_in_a, "A"), (only_in_b, "B")] {
        if *count > 0 {
            let _infallible = write!(text, ", {count} in {place} alone");
        }
    }
    let _infallible = match first_difference {
        Some(first) => {
            writeln!(
                text,
                "; first difference at sample {}: {} is {} in A, {} in B",
                first.sample,
                first.what,
                in_line(&first.a),
                in_line(&first.b)
            )
        }
        None if channels.is_empty() => writeln!(text, "; all the same"),
        None => writeln!(text, "; all within the tolerance"),
    };
    for channel in channels {
        let (largest, magnitude) = (short(&channel.largest), short(&channel.magnitude));
        let (name, sample) = (channel.name, channel.sample);
        let _infallible =
            writeln!(text, "  {name}: at most {largest} apart, at sample {sample}; at most {magnitude} in A");
    }
    text
}
