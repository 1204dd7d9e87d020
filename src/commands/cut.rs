//! `resonarm cut` and `resonarm merge`: take a section of a recording, and join sections.

use std::path::PathBuf;

use clap::Args;

use crate::commands::inspect;
use crate::failure::{Failure, Verdict};
use crate::output;
use crate::time_range::TimeRange;
use resonarm::cut::{cut, merge};
use resonarm::export::samples;
use resonarm::recording::{Existing, Recording, Summary};

/// Copies a range of time into a separate recording, which `resim`, `replay` and all other commands accept.
#[derive(Debug, Args)]
pub(crate) struct Cut {
    /// The recording, an MCAP file.
    file: PathBuf,
    /// The new recording.
    output: PathBuf,
    #[command(flatten)]
    range: TimeRange,
    /// Overwrite the new recording if it exists.
    #[arg(long)]
    overwrite: bool,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// Joins recordings of one run that follow each other, as `cut` makes them.
#[derive(Debug, Args)]
pub(crate) struct Merge {
    /// The recordings, in order.
    #[arg(required = true, num_args = 2..)]
    files: Vec<PathBuf>,
    /// The new recording.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite the new recording if it exists.
    #[arg(long)]
    overwrite: bool,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

impl Cut {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let recording = open(&self.file)?;
        let samples = samples(&recording, self.range.from_s, self.range.to_s)?;
        print(&cut(&recording, samples, &self.output, existing(self.overwrite))?, self.json)
    }
}

impl Merge {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let recordings = self.files.iter().map(open).collect::<Result<Vec<_>, _>>()?;
        let recordings: Vec<_> = recordings.iter().collect();
        print(&merge(&recordings, &self.out, existing(self.overwrite))?, self.json)
    }
}

const fn existing(overwrite: bool) -> Existing {
    if overwrite { Existing::Overwrite } else { Existing::Refuse }
}

fn open(path: &PathBuf) -> Result<Recording, Failure> {
    let recording = Recording::open(path)?;
    if let Some(note) = inspect::integrity_note(recording.integrity()) {
        tracing::warn!("{}: {note}", path.display());
    }
    Ok(recording)
}

fn print(summary: &Summary, json: bool) -> Result<Verdict, Failure> {
    if json {
        output::print_json(summary)?;
    } else {
        output::print(&format!("{}: {} samples, {} bytes\n", summary.path.display(), summary.samples, summary.bytes))?;
    }
    Ok(Verdict::Positive)
}
