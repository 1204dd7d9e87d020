//! `resonarm cut` and `resonarm merge`: copy a section of a recording, and join sections.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::output::{Inputs, JsonFlag};
use crate::recordings::{TimeRange, existing, open_one, verdict};
use resonarm::cut::{cut, merge};
use resonarm::export::samples;
use resonarm::recording::Summary;

/// Copies a range of time into a separate recording, which `resim`, `replay` and all other commands accept. Of a recording
/// that is not whole, what can be read is copied: the copy is not whole either, and the exit code is 1.
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
    #[command(flatten)]
    json: JsonFlag,
}

/// Joins recordings of one run that follow each other, as `cut` makes them. If one is not whole, nor is the new one, and
/// the exit code is 1.
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
    #[command(flatten)]
    json: JsonFlag,
}

impl Cut {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let recording = open_one(&self.file)?;
        let samples = samples(&recording, self.range.from_s, self.range.to_s)?;
        print(&cut(&recording, samples, &self.output, existing(self.overwrite))?, self.json)?;
        Ok(verdict(&recording))
    }
}

impl Merge {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        // --overwrite must not destroy one of the parts while they are joined.
        Inputs::of(&self.files).check(&self.out)?;
        let recordings = self.files.iter().map(open_one).collect::<Result<Vec<_>, _>>()?;
        let recordings: Vec<_> = recordings.iter().collect();
        print(&merge(&recordings, &self.out, existing(self.overwrite))?, self.json)?;
        Ok(recordings.iter().fold(Verdict::Positive, |so_far, recording| so_far.and(verdict(recording))))
    }
}

fn print(summary: &Summary, json: JsonFlag) -> Result<Verdict, Failure> {
    let Summary { path, samples, bytes, .. } = summary;
    json.show(summary, || format!("{}: {samples} samples, {bytes} bytes\n", path.display()), &[])
}
