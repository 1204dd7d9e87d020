//! `resonarm resim`: simulates a recorded run again.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::help::heading;
use crate::output::JsonFlag;
use crate::recordings::{integrity_note, verdict};
use resonarm::recording::{Recording, build_info};
use resonarm::replay::{self, ReadingsVerdict, resimulate, resimulate_readings};
use resonarm::scenario::StructureKind;
use serde::Serialize;

/// Re-simulates a recorded run, and says whether every state is identical.
///
/// The simulation has the recorded loads. If a state differs, or if the recording is not whole, the exit code is 1.
#[derive(Debug, Args)]
pub(crate) struct Resim {
    /// Recording, an MCAP file.
    file: PathBuf,
    /// FMU of the run, if the structure was one.
    ///
    /// It is loaded, and runs with your rights, if its SHA-256 is the recorded one. The file that a recording names is
    /// never loaded.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE")]
    fmu: Option<PathBuf>,
    /// Simulate the instruments as well, and compare every reading.
    #[arg(long, help_heading = heading::SIMULATED)]
    readings: bool,
    #[command(flatten)]
    json: JsonFlag,
}

impl Resim {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let recording = Recording::open(&self.file)?;
        let recording = match &self.fmu {
            Some(fmu) => recording.allow_fmu(fmu),
            None => recording,
        };
        self.warn_of_fmu(&recording);
        let then = &recording.origin().build;
        let now = build_info();
        // A warning only: another compiler or target may still round alike, and the comparison itself will tell.
        if *then != now {
            let version = &then.version;
            let commit = &then.git_commit;
            let target = &then.target;
            tracing::warn!("recorded by another build ({version} {commit} for {target}), so differences are possible");
        }
        let states = resimulate(&recording)?;
        let readings = self.readings.then(|| resimulate_readings(&recording)).transpose()?;
        let identical = states.identical && readings.as_ref().is_none_or(|readings| readings.identical);
        let document = Document { states, readings };
        self.json.show(&document, || text(&document), &[])?;
        Ok(Verdict::of(identical).and(verdict(&recording)))
    }

    /// Warns where a named FMU can't be compared with the recorded one, or the recording has none.
    fn warn_of_fmu(&self, recording: &Recording) {
        let Some(fmu) = &self.fmu else { return };
        let structure = recording.scenario().ok().map(|scenario| scenario.structure);
        match structure.filter(|structure| structure.kind == StructureKind::Fmu) {
            None => tracing::warn!("--fmu {}: the recording has no FMU, so none is loaded", fmu.display()),
            Some(structure) if structure.sha256.is_none() => tracing::warn!(
                "--fmu {}: the recording does not state the SHA-256 of its FMU, so this one may differ from it",
                fmu.display()
            ),
            Some(_) => {}
        }
    }
}

/// Document that `resim --json` prints.
#[derive(Debug, Serialize)]
struct Document {
    #[serde(flatten)]
    states: replay::Verdict,
    #[serde(skip_serializing_if = "Option::is_none")]
    readings: Option<ReadingsVerdict>,
}

fn text(Document { states: verdict, readings }: &Document) -> String {
    let mut text = integrity_note(&verdict.integrity).map_or(String::new(), |note| note + "\n");
    let samples = verdict.samples;
    text += &match (verdict.first_divergence, verdict.identical) {
        (Some(sample), _) => {
            let drift_rad = verdict.max_drift_rad;
            format!(
                "differs from sample {sample} on; largest drift of an angle {drift_rad:.3e} rad in {samples} samples\n"
            )
        }
        (None, true) => format!("identical: {samples} samples, bit for bit\n"),
        (None, false) => format!("not identical: only {samples} samples can be compared, which agree bit for bit\n"),
    };
    if let Some(ReadingsVerdict { samples, first_divergence, .. }) = readings {
        text += &match first_divergence {
            Some(sample) => format!("readings differ from sample {sample} on, of {samples} samples\n"),
            None => format!("readings identical: {samples} samples, bit for bit\n"),
        };
    }
    text
}
