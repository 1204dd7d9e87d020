//! `resonarm recover`: repairs a truncated or damaged recording.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::help::heading;
use crate::output::JsonFlag;
use crate::recordings::{existing, integrity_note};
use resonarm::recording::{Recovered, recover};

/// Writes the readable records of a truncated or damaged recording into a whole one.
///
/// Some tools accept only whole files. Damaged chunks are left out and listed. The old file is not changed. If it has no
/// readable record, no file is written, and the exit code is 1.
#[derive(Debug, Args)]
pub(crate) struct Recover {
    /// Recording, an MCAP file that `inspect` calls truncated or damaged.
    file: PathBuf,
    /// New recording.
    output: PathBuf,
    /// Overwrite the new recording if it exists.
    #[arg(long, help_heading = heading::OUTPUT)]
    overwrite: bool,
    #[command(flatten)]
    json: JsonFlag,
}

impl Recover {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let recovered = recover(&self.file, &self.output, existing(self.overwrite))?;
        self.json.show(&recovered, || text(&recovered), &[])
    }
}

fn text(recovered: &Recovered) -> String {
    let mut text = integrity_note(&recovered.source).unwrap_or_default() + "\n";
    let mut line = |line: String| text.extend([&line, "\n"]);
    for chunk in &recovered.lost_chunks {
        // A damaged chunk may state its times, which nothing confirms.
        let times = chunk.log_times_ns.map_or(String::new(), |(first, last)| {
            format!(", which states log times from {:.3} to {:.3} s", first as f64 * 1e-9, last as f64 * 1e-9)
        });
        line(format!("{} bytes from byte {} are lost{times}: {}", chunk.bytes, chunk.offset, chunk.cause));
    }
    for missing in &recovered.missing_samples {
        line(format!("samples {} to {} are lost", missing.first, missing.last));
    }
    let messages = recovered.messages;
    let path = recovered.path.display();
    let bytes = recovered.bytes;
    line(format!("{messages} messages recovered into {path}, {bytes} bytes"));
    text
}
