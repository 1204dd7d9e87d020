//! `resonarm inspect`: shows the contents of a recording.

mod plot;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::failure::{Failure, Verdict};
use crate::help::heading;
use crate::output::{self, Inputs, PlotFlags, in_line};
use crate::recordings::{integrity_note, verdict};
use resonarm::recording::{Origin, Recording, RecordingSummary, RunTime};
use resonarm::statistics::{ChannelStatistics, RecordingStatistics, statistics};
use resonarm_figures::plot::Figure;

/// Shows a recording: its run, problems and faults, contents, and whether it is whole.
///
/// If it is not whole, the exit code is 1.
#[derive(Debug, Args)]
#[command(mut_args(output::explained(
    "Plot angles, load and readings over time to STEM.svg and STEM.png",
    "The caption is in STEM.txt."
)))]
pub(crate) struct Inspect {
    /// Recording, an MCAP file.
    file: PathBuf,
    /// Add statistics of every channel, and counts of messages, frames and events.
    ///
    /// The statistics are minimum, maximum, mean and root mean square. Rejected and lost frames are counted, too.
    #[arg(long, help_heading = heading::OUTPUT)]
    statistics: bool,
    #[command(flatten)]
    output: PlotFlags,
}

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    summary: &'a RecordingSummary,
    problems: Vec<Problem>,
    /// Statistics, present with `--statistics` only.
    #[serde(skip_serializing_if = "Option::is_none")]
    statistics: Option<RecordingStatistics>,
}

impl Inspect {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.output.check(&Figure::ENDINGS, &Inputs::of([&self.file]))?;
        let recording = Recording::open(&self.file)?;
        let summary = recording.summary();
        let statistics = if self.statistics { Some(statistics(&recording)?) } else { None };
        let problems = problems(&summary, statistics.as_ref());
        let written = match &self.output.plot {
            Some(stem) => output::draw(plot::figure(&recording, &summary)?, stem)?,
            None => Vec::new(),
        };
        let document = Document { summary: &summary, problems, statistics };
        self.output.json.show(&document, || document.text(), &written)?;
        Ok(verdict(&recording))
    }
}

/// A problem of a run or its recording.
#[derive(Clone, Debug, Serialize)]
struct Problem {
    /// `fault`, `other sender`, `clipped`, `gap`, `repeated`, `lost` or `refused`.
    kind: &'static str,
    what: String,
}

/// Problems of a run or its recording, except its integrity.
fn problems(summary: &RecordingSummary, statistics: Option<&RecordingStatistics>) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut problem = |kind, what| problems.push(Problem { kind, what });
    summary.faults.iter().for_each(|fault| problem("fault", fault.to_string()));
    if let frames @ 1.. = summary.other_sender_frames {
        let what = format!("{frames} frames of another network under identifiers that only the plant sends");
        problem("other sender", what);
    }
    if let clipped @ 1.. = summary.clipped_samples {
        problem("clipped", format!("{clipped} samples with a reading beyond the range of its sensor"));
    }
    for (name, topic) in summary.topics.iter().filter(|(_, topic)| topic.gaps > 0) {
        problem("gap", format!("{name} has {} gaps", topic.gaps));
    }
    for (name, topic) in summary.topics.iter().filter(|(_, topic)| topic.repeated > 0) {
        problem("repeated", format!("{name} has {} records that are repeated or late", topic.repeated));
    }
    for (channel, lost) in summary.lost.iter().filter(|(_, lost)| **lost > 0) {
        problem("lost", format!("{lost} records of channel {channel}"));
    }
    for (reason, count) in statistics.iter().flat_map(|statistics| &statistics.refused_frames) {
        problem("refused", format!("{count} frames, {reason}"));
    }
    if let Some(lost) = statistics.map(|statistics| statistics.lost_frames).filter(|lost| *lost > 0) {
        problem("lost", format!("{lost} frames on the bus, according to the counters"));
    }
    problems
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
    match origin.plot_every_samples {
        0 => String::from("nothing"),
        1 => String::from("every sample"),
        every => format!("one of {every} samples, filtered against aliases"),
    }
}

impl Document<'_> {
    fn text(&self) -> String {
        let Document { summary, problems, statistics } = self;
        let RecordingSummary { origin, duration_s, .. } = summary;
        let mut text = String::new();
        let mut line = |name: &str, value: String| {
            text += &format!("{:12} {}\n", in_line(name), in_line(&value));
        };
        line("file", format!("{}, {} bytes", summary.path.display(), summary.file_bytes));
        line("integrity", integrity_note(&summary.integrity).unwrap_or_else(|| String::from("complete")));
        if let Some((first, last)) = summary.samples {
            line("samples", format!("{first} to {last}, {duration_s:.3} s at {} s a sample", origin.dt_s));
        }
        for problem in problems {
            line(problem.kind, problem.what.clone());
        }
        line("format", format!("{}, {}", origin.format, time_text(origin)));
        line("plotting", plotting_text(origin));
        line("bus", origin.interface.clone());
        let build = &origin.build;
        line("build", format!("{} {}, {}", build.version, build.git_commit, build.target));
        for (topic, has) in &summary.topics {
            line(topic, format!("{} messages, {} records, {} bytes", has.messages, has.records, has.bytes));
        }
        for (key, value) in &summary.statistics {
            line(key, value.clone());
        }
        if let Some(statistics) = statistics {
            text.push_str(&statistics_text(statistics));
        }
        for (key, value) in &summary.configuration {
            text += &format!("\n[{}]\n{}\n", in_line(key), value.trim_end());
        }
        text
    }
}

fn statistics_text(statistics: &RecordingStatistics) -> String {
    let mut text = format!("\n{:24} {:>12} {:>12} {:>12} {:>12}\n", "channel", "least", "largest", "mean", "rms");
    for ChannelStatistics { name, least, largest, mean, rms } in &statistics.channels {
        text += &format!("{name:24} {least:12.4e} {largest:12.4e} {mean:12.4e} {rms:12.4e}\n");
    }
    let counts = statistics.messages.iter().map(|(name, count)| (name.as_str(), count));
    for (name, count) in counts.chain(statistics.events.iter().map(|(name, count)| (name.as_str(), count))) {
        text += &format!("{:24} {count:12}\n", in_line(name));
    }
    let RecordingStatistics { lost_frames, foreign_frames, .. } = statistics;
    text += &format!("{:24} {lost_frames:12}\n{:24} {foreign_frames:12}\n", "lost frames", "foreign frames");
    text
}
