//! `resonarm export`: a recording in the formats of other tools.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::flags;
use crate::help::heading;
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use crate::recordings::{self, TimeRange};
use resonarm::export::{ExportFormat, ExportedFile, RecordingPart, Selection, export};

const HELP: &str = "\
Formats and their files:
  csv      STEM-PART.csv  a table a part; the names of the columns have the units
  candump  STEM.log       the frames, as `candump -L` writes them and canplayer plays them
  asc      STEM.asc       the frames, for Vector's tools and what reads their logs
  blf      STEM.blf       the frames, the same in binary
  foxglove STEM-foxglove.mcap  a copy for Foxglove, Lichtblick and PlotJuggler: a JSON message for every state and sample
  uff58    STEM.uff       states and samples as functions of time, for tools of modal analysis: dataset 58, ASCII
  wav      STEM-PART.wav  states and samples as channels of 32-bit floating-point numbers, in SI units
Parquet and MF4 are written by the Python package: python3 -m resonarm export RECORDING --to parquet (docs/python.md).
Times are simulated time, except in the log of a run in real time, which has the time of the machine. A reading describes \
a time before its sample, because the converters delay it; time_s is that earlier time.";

/// Writes a recording as CSV, candump, ASC, BLF, Foxglove, UFF or WAV.
///
/// The recording is converted record by record, so it may be larger than the memory. The command names the files on
/// standard error before it writes them. If the recording is not whole, the readable part is written, and the exit code
/// is 1.
#[derive(Debug, Args)]
#[command(after_long_help = HELP)]
pub(crate) struct Export {
    /// Recording, an MCAP file.
    file: PathBuf,
    /// Format of the files.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FORMAT", value_parser = flags::ByName(ExportFormat::ALL, ExportFormat::name))]
    to: ExportFormat,
    /// Beginning of the files' names, or a folder [default: the recording's name, in the current folder].
    ///
    /// In a folder the files have the recording's name.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "STEM")]
    out: Option<PathBuf>,
    /// Records to export, separated by commas [default: all that the format holds].
    #[arg(long, help_heading = heading::RECORDS, value_name = "PARTS", value_delimiter = ',', value_parser = flags::one_of(RecordingPart::ALL, RecordingPart::name))]
    parts: Vec<RecordingPart>,
    #[command(flatten)]
    range: TimeRange,
    /// Add the moving structure for 3D views, its vibration X times as large.
    ///
    /// This is possible with --to foxglove only.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "X")]
    moving_arm: Option<f64>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

impl Export {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let recording = recordings::open(&self.file)?;
        let stem = self.stem();
        let TimeRange { from_s, to_s } = self.range;
        let chosen = Selection::of(&recording, self.to, &self.parts, from_s, to_s)?;
        let selection = Selection { magnification: self.moving_arm, ..chosen };
        self.to.check(&selection)?;
        // All files are checked before the first is written, since an export of a long recording takes minutes.
        let targets: Vec<PathBuf> = self.to.files(&stem, &selection.parts).into_iter().map(|(path, _)| path).collect();
        self.overwrite.check(targets.iter().cloned(), &Inputs::of([&self.file]))?;
        output::check_folder(&stem)?;
        output::note(&format!("writing {}", output::listed(&targets)));
        let files = export(&recording, self.to, &selection, &stem)?;
        let document = serde_json::json!({ "format": self.to.name(), "files": &files });
        self.json.show(&document, || text(&files), &[])?;
        Ok(recordings::verdict(&recording))
    }

    /// Returns the beginning of the names of the files.
    fn stem(&self) -> PathBuf {
        let name = self.file.file_stem().unwrap_or(self.file.as_os_str());
        match &self.out {
            None => PathBuf::from(name),
            Some(folder) if folder.is_dir() => folder.join(name),
            Some(stem) => stem.clone(),
        }
    }
}

fn text(files: &[ExportedFile]) -> String {
    let mut text = String::new();
    for ExportedFile { path, rows, columns } in files {
        text += &match columns[..] {
            // Files of frames have no columns.
            [] => format!("{}: {rows} frames\n", path.display()),
            _ => format!("{}: {rows} rows of {}\n", path.display(), columns.join(", ")),
        };
    }
    text
}
