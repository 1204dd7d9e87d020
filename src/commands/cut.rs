//! `resonarm cut` and `resonarm merge`: copy a section of a recording, and join sections.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::help::heading;
use crate::output::{Inputs, JsonFlag};
use crate::recordings::{TimeRange, existing, open_one, verdict};
use resonarm::cut::{cut, merge};
use resonarm::export::samples;
use resonarm::recording::Summary;

/// Copies a range of time of a recording into a separate recording.
///
/// `resim`, `replay` and all other commands accept the new recording. If a recording is not whole, its readable part is
/// copied: the copy is not whole either, and the exit code is 1.
#[derive(Debug, Args)]
pub(crate) struct Cut {
    /// Recording, an MCAP file.
    file: PathBuf,
    /// New recording.
    output: PathBuf,
    #[command(flatten)]
    range: TimeRange,
    /// Overwrite the new recording if it exists.
    #[arg(long, help_heading = heading::OUTPUT)]
    overwrite: bool,
    #[command(flatten)]
    json: JsonFlag,
}

/// Joins recordings of one run that follow each other, as `cut` makes them.
///
/// If one of them is not whole, the new one is not whole either, and the exit code is 1.
#[derive(Debug, Args)]
pub(crate) struct Merge {
    /// Recordings to join, in order.
    #[arg(required = true, num_args = 2..)]
    files: Vec<PathBuf>,
    /// New recording.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite the new recording if it exists.
    #[arg(long, help_heading = heading::OUTPUT)]
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
