//! `resonarm recover`: a recording that was cut short or damaged, made whole.

use std::path::PathBuf;

use clap::Args;

use super::failure::{Failure, Verdict};
use super::{inspect, output};
use crate::recording::{Existing, recover};

/// Makes a whole recording of what can be read of one that was cut short or damaged, for tools that take none but whole
/// files. The old file stays as it is.
#[derive(Debug, Args)]
pub(super) struct Recover {
    /// The recording, an MCAP file that `inspect` calls truncated or damaged.
    file: PathBuf,
    /// The new file.
    output: PathBuf,
    /// Overwrite the new file if it exists.
    #[arg(long)]
    overwrite: bool,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

impl Recover {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let existing = if self.overwrite { Existing::Overwrite } else { Existing::Refuse };
        let recovered = recover(&self.file, &self.output, existing)?;
        if self.json {
            output::print_json(&recovered)?;
        } else {
            let source = inspect::integrity_note(&recovered.source).unwrap_or_default();
            output::print(&format!(
                "{source}\n{} messages recovered into {}, {} bytes\n",
                recovered.messages,
                recovered.path.display(),
                recovered.bytes
            ))?;
        }
        Ok(Verdict::Positive)
    }
}
