//! `resonarm resim`: a recorded run simulated again.

use std::path::PathBuf;

use clap::Args;

use super::failure::{Failure, Verdict};
use super::{inspect, output};
use crate::recording::{Recording, build_info};
use crate::replay::resimulate;

/// Simulates a recorded run again from its recorded loads and says whether every state is identical (else exit code 1).
#[derive(Debug, Args)]
pub(super) struct Resim {
    /// The recording, an MCAP file.
    file: PathBuf,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

impl Resim {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let recording = Recording::open(&self.file)?;
        if let Some(note) = inspect::integrity_note(recording.integrity()) {
            tracing::warn!("{note}");
        }
        let (then, now) = (&recording.origin().build, build_info());
        if *then != now {
            tracing::warn!(
                "recorded by another build ({} {} for {}), so differences are possible",
                then.version,
                then.git_commit,
                then.target
            );
        }
        let verdict = resimulate(&recording)?;
        if self.json {
            output::print_json(&verdict)?;
        } else if let Some(step) = verdict.first_divergence {
            output::print(&format!(
                "differs from step {step} on; largest drift of an angle {:.3e} rad in {} steps\n",
                verdict.max_drift_rad, verdict.steps
            ))?;
        } else {
            output::print(&format!("identical: {} steps, bit for bit\n", verdict.steps))?;
        }
        Ok(Verdict::of(verdict.identical))
    }
}
