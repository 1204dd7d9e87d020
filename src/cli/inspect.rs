//! `resonarm inspect`: what is in a recording.

use core::fmt::Write;
use std::path::PathBuf;

use clap::Args;

use super::failure::{Failure, Verdict};
use super::output;
use crate::recording::{Integrity, Origin, Recording, RecordingSummary, RunTime};

/// What is in a recording: its run, its faults, its contents, and whether it is whole (else exit code 1).
#[derive(Debug, Args)]
pub(super) struct Inspect {
    /// The recording, an MCAP file.
    file: PathBuf,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

impl Inspect {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let summary = Recording::open(&self.file)?.summary();
        if self.json {
            output::print_json(&summary)?;
        } else {
            output::print(&text(&summary))?;
        }
        Ok(Verdict::of(summary.integrity == Integrity::Complete))
    }
}

/// What to say of a recording that is not whole.
pub(super) fn integrity_note(integrity: &Integrity) -> Option<String> {
    let last = |sample: &Option<u64>| sample.map_or(String::from("no sample"), |last| format!("samples up to {last}"));
    match integrity {
        Integrity::Complete => None,
        Integrity::Unfinished => Some(String::from("the recording was recovered from a truncated or damaged one")),
        Integrity::Truncated { readable_bytes, file_bytes, last_sample } => Some(format!(
            "the recording is truncated: {readable_bytes} of {file_bytes} bytes can be read, {}",
            last(last_sample)
        )),
        Integrity::Damaged { readable_bytes, file_bytes, last_sample, cause } => Some(format!(
            "the recording is damaged ({cause}): {readable_bytes} of {file_bytes} bytes can be read, {}",
            last(last_sample)
        )),
    }
}

fn time_text(origin: &Origin) -> String {
    let time = match origin.time {
        RunTime::Simulated => "simulated time",
        RunTime::Lockstep => "lockstep",
        RunTime::RealTime => "real time",
    };
    match origin.start_unix_ns {
        Some(start_ns) => format!("{time}, begun {:.3} s after the UNIX epoch", start_ns as f64 * 1e-9),
        None => time.to_string(),
    }
}

fn plotting_text(origin: &Origin) -> String {
    match (origin.plot_every_samples, origin.format) {
        (0, _) => String::from("nothing"),
        (1, _) => String::from("every sample"),
        (every, 1) => {
            format!("one of {every} samples, unfiltered: frequencies above half that rate show as lower ones")
        }
        (every, _) => format!("one of {every} samples, filtered against aliases"),
    }
}

fn text(summary: &RecordingSummary) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _infallible = writeln!(text, "{name:12} {value}");
    };
    line("file", format!("{}, {} bytes", summary.path.display(), summary.file_bytes));
    line("integrity", integrity_note(&summary.integrity).unwrap_or_else(|| String::from("complete")));
    if let Some((first, last)) = summary.samples {
        line(
            "samples",
            format!("{first} to {last}, {:.3} s at {} s a sample", summary.duration_s, summary.origin.dt_s),
        );
    }
    for fault in &summary.faults {
        line("fault", fault.to_string());
    }
    if let Some(clipped) = summary.clipped_samples.filter(|clipped| *clipped > 0) {
        line("clipped", format!("{clipped} samples with a reading beyond the range of its sensor"));
    }
    line("format", format!("{}, {}", summary.origin.format, time_text(&summary.origin)));
    line("plotting", plotting_text(&summary.origin));
    line("bus", summary.origin.interface.clone());
    line(
        "build",
        format!(
            "{} {}, {}",
            summary.origin.build.version, summary.origin.build.git_commit, summary.origin.build.target
        ),
    );
    for (topic, contents) in &summary.topics {
        line(topic, format!("{} messages, {} records, {} bytes", contents.messages, contents.records, contents.bytes));
    }
    for (channel, lost) in summary.lost.iter().filter(|(_, lost)| **lost > 0) {
        line("lost", format!("{lost} records of channel {channel}"));
    }
    for (key, value) in &summary.statistics {
        line(key, value.clone());
    }
    for (key, value) in &summary.configuration {
        let _infallible = write!(text, "\n[{key}]\n{}\n", value.trim_end());
    }
    text
}
