//! `resonarm paper`: reproduces the figures and statements of Gierlak & Warmiński (2023).

mod draw;

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use crate::failure::{Failure, Verdict};
use crate::flags;
use crate::help::heading;
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use crate::progress::Progress;
use resonarm::realtime::{Clock, SystemClock};
use resonarm::structure::Preset;
use resonarm_figures::paper::claims::{self, Report};
use resonarm_figures::paper::{
    Figure, MeasuredZones, NaturalFrequencies, PaperError, Plan, Settings, natural_frequencies,
};
use resonarm_figures::plot;

/// Reproduces the figures of Gierlak & Warmiński (2023), and checks its statements.
///
/// Every figure is written as SVG and PNG, with its caption, CSV and JSON. Values that the paper does not give are in
/// the settings file, which is copied to the folder. Exit code 1 means that a statement could not be computed; it does
/// not depend on whether statements hold.
#[derive(Debug, Args)]
pub(crate) struct Paper {
    /// Figure or statements to compute.
    #[arg(value_enum)]
    what: What,
    /// Folder for the files, created if missing; optional for `claims`.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    /// Parameters of the arm in figures 4, 5, 7 and 9; the others show both sets.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "NAME", value_parser = flags::ByName(Preset::ALL, Preset::name))]
    preset: Option<Preset>,
    /// Document of `experiment fig9 --json`, whose measured points figure 9 shows.
    ///
    /// The settled points are drawn over curves for the arm and the forces in the document.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE", conflicts_with = "preset")]
    measured: Option<PathBuf>,
    /// TOML file in place of scenarios/paper/settings.toml, which is built in.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE")]
    settings: Option<PathBuf>,
    #[command(flatten)]
    json: JsonFlag,
}

/// The figure or the statements to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum What {
    /// Natural frequencies over β2.
    Fig3,
    /// Amplitude of link 1 over the frequency of a torque.
    Fig4,
    /// Amplitude of link 1 over the amplitude of a torque.
    Fig5,
    /// Amplitudes over the frequency of a force at the tip.
    Fig7,
    /// Amplitudes in the measured position.
    Fig9,
    /// The paper's statements.
    Claims,
    /// All of these.
    All,
}

const CURVES: [(What, Figure); 4] =
    [(What::Fig4, Figure::Fig4), (What::Fig5, Figure::Fig5), (What::Fig7, Figure::Fig7), (What::Fig9, Figure::Fig9)];
#[derive(Serialize)]
struct Document {
    figures: Vec<Made>,
    #[serde(flatten)]
    claims: Option<Report>,
    wall_s: f64,
}

#[derive(Serialize)]
struct Made {
    figure: &'static str,
    files: Vec<PathBuf>,
    wall_s: f64,
}

impl Paper {
    /// Returns the parameter set of figures of one arm.
    pub(crate) fn preset(&self) -> Preset {
        self.preset.unwrap_or_default()
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let (text, settings) = self.settings()?;
        let measured = self.measured()?;
        let start_ns = SystemClock.now_ns();
        if let Some(folder) = self.folder()? {
            self.overwrite.check(self.files(folder, &text), &Inputs::of(self.settings.iter().chain(&self.measured)))?;
            fs::create_dir_all(folder).map_err(Failure::write(folder))?;
            output::write(folder.join("settings.toml"), &text)?;
        }
        let mut document = Document { figures: self.figures(&settings, measured.as_ref())?, claims: None, wall_s: 0.0 };
        if self.wants(What::Claims) {
            document.claims = Some(self.claims(&settings)?);
        }
        document.wall_s = since(start_ns);
        self.json.show(&document, || text_of(&document), &[])?;
        Ok(Verdict::of(document.claims.is_none_or(|report| report.is_complete())))
    }

    /// Lists the files to write, which must not exist yet; identical settings may.
    fn files(&self, folder: &Path, settings: &str) -> Vec<PathBuf> {
        let figures = CURVES.iter().filter(|(what, _)| self.wants(*what)).map(|(_, figure)| figure.name());
        let figures = figures.chain(self.wants(What::Fig3).then_some("fig3"));
        let forms = |name| output::PLOTTED.iter().map(move |ending| plot::beside(&folder.join(name), ending));
        let mut files: Vec<PathBuf> = figures.flat_map(forms).collect();
        if self.wants(What::Claims) {
            files.extend(["claims.json", "claims.md"].map(|name| folder.join(name)));
        }
        let settings_file = folder.join("settings.toml");
        files.extend(
            (!fs::read(&settings_file).is_ok_and(|there| there == settings.as_bytes())).then_some(settings_file),
        );
        files
    }

    fn wants(&self, what: What) -> bool {
        self.what == what || self.what == What::All
    }

    /// Returns the text of the settings, and the parsed settings.
    fn settings(&self) -> Result<(String, Settings), Failure> {
        match &self.settings {
            None => Ok((Settings::EMBEDDED.to_string(), Settings::embedded().map_err(PaperError::from)?)),
            Some(path) => Ok(Settings::read(path).map_err(PaperError::from)?),
        }
    }

    /// Reads the measured points, if they are to be drawn.
    fn measured(&self) -> Result<Option<MeasuredZones>, Failure> {
        match &self.measured {
            Some(_) if self.what != What::Fig9 => {
                Err(Failure::usage("--measured is for `paper fig9`: leave it out, or choose that figure"))
            }
            Some(path) => Ok(Some(MeasuredZones::read(path).map_err(PaperError::from)?)),
            None => Ok(None),
        }
    }

    /// Returns the folder for the files; figures need one.
    fn folder(&self) -> Result<Option<&Path>, Failure> {
        match &self.out {
            None if self.what != What::Claims => {
                Err(Failure::usage("the folder for the figures is missing: give --out DIR"))
            }
            folder => Ok(folder.as_deref()),
        }
    }

    fn figures(&self, settings: &Settings, measured: Option<&MeasuredZones>) -> Result<Vec<Made>, Failure> {
        let mut made = Vec::new();
        let Some(folder) = self.folder()? else { return Ok(made) };
        if self.wants(What::Fig3) {
            let start_ns = SystemClock.now_ns();
            let both = Preset::ALL.map(|preset| natural_frequencies(preset, settings));
            let both = both.into_iter().collect::<Result<Vec<_>, _>>()?;
            let csv = NaturalFrequencies::csv(&both);
            made.push(save(folder, "fig3", start_ns, &draw::natural_frequencies(&both), &csv, &both)?);
        }
        let preset = self.preset();
        for (_, figure) in CURVES.into_iter().filter(|(what, _)| self.wants(*what)) {
            let start_ns = SystemClock.now_ns();
            let plan = match measured {
                Some(measured) => Plan::measured(measured),
                None => Plan::new(figure, preset, settings)?,
            };
            let progress = Progress::new(figure.name(), plan.curve_count(), "curves");
            let curves = plan.compute(|| progress.step())?;
            made.push(save(folder, figure.name(), start_ns, &draw::curves(&curves), &curves.csv(), &curves)?);
        }
        Ok(made)
    }

    fn claims(&self, settings: &Settings) -> Result<Report, Failure> {
        let progress = Progress::new("claims", 0, "branches");
        let report = claims::judge(settings, |count| progress.expect(count), || progress.step())?;
        if let Some(folder) = &self.out {
            output::write(folder.join("claims.json"), &serde_json::to_string_pretty(&report)?)?;
            output::write(folder.join("claims.md"), &report.markdown())?;
        }
        Ok(report)
    }
}

fn since(start_ns: u64) -> f64 {
    SystemClock.now_ns().saturating_sub(start_ns) as f64 * 1e-9
}

fn save(
    folder: &Path,
    name: &'static str,
    start_ns: u64,
    figure: &plot::Figure,
    csv: &str,
    data: &impl Serialize,
) -> Result<Made, Failure> {
    let mut files = output::draw(figure.clone(), &folder.join(name))?;
    for (extension, text) in [("csv", csv), ("json", &serde_json::to_string(data)?)] {
        files.push(output::write(folder.join(name).with_extension(extension), text)?);
    }
    Ok(Made { figure: name, files, wall_s: since(start_ns) })
}

fn text_of(document: &Document) -> String {
    let mut text = String::new();
    for made in &document.figures {
        text += &format!("{} in {:.2} s: {}\n", made.figure, made.wall_s, output::listed(&made.files));
    }
    if let Some(report) = &document.claims {
        text.push_str(&report.text());
    }
    text
}
