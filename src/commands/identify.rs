//! `resonarm identify`: modes and frequency responses from the readings in recordings.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use super::identify_figures::{Curve, poles_figure, responses_figure};
use super::identify_found::{Found, signed, smooth_hz};
use super::identify_mac::{COMPUTED, Shapes};
use crate::commands::identify_angles;
use crate::commands::identify_report;
use crate::commands::identify_responses;
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags;
use crate::help::heading;
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use crate::recordings;
use resonarm::analysis;
use resonarm::drawing::Drawing;
use resonarm::identification::{
    KnownPole, MissingMode, averaging, band, has_faults, missing_modes, mode_numbers, record, samples_in,
};
use resonarm::identify::{self, Averaging, Band, Direction, Identification, Integration, Record};
use resonarm::import::IMPORTED_FROM;
use resonarm::modal_file::{FileResponse, ModalFile};
use resonarm::plant::TestedAssembly;
use resonarm::recording::Recording;
use resonarm::responses::{MeasuredQuantity, is_universal_file};
use resonarm::scenario::{READS_IMAGES, Scenario, StructureKind};
use resonarm::survey::{RunState, SurveyIndex};
use resonarm_figures::plot::{Figure, Subtitle, beside};
use resonarm_numeric::number::short;

/// Identifies poles, mode shapes and frequency responses from the readings in recordings.
///
/// A pole λ is stated by its frequency |λ|/2π and its damping ratio −Re λ/|λ|. With damping that is not proportional they
/// differ from those of the undamped structure; `resonarm modes` states both.
///
/// Modes are fitted to the spectra of the whole record, by maximum likelihood, with the ends of the record in the model.
/// Their number follows from the likelihood. Each figure has its standard deviation, or the reason why none can be stated.
/// Shapes are for the modal mass 1 kg if an accelerometer is where the force acts. The noise of the readings is estimated,
/// and stated beside that of the instruments. The structure must be driven by a force where the head is. Modes are numbered
/// as in the scenario's structure; one that is not found is listed with the reason. If no mode is found the exit code is 1.
///
/// Several recordings of one structure are fitted together, with the same poles: the exciter or the accelerometers may be
/// at other points in each. With --other-level the modes of a recording at another force tell whether the structure is linear.
/// In the folder of a survey, the recordings of the first level are fitted, and compared with those of each other level.
///
/// Frequency responses H1 and H2 and the coherence, in the document of --json and the files of --plot, are averages of
/// periods of a multisine or of bursts, or of segments (Welch's method: a Hann window, half overlapping). Leakage makes sharp
/// resonances in them too low and too wide, so the fitted curves are higher there.
///
/// With --angles, for a run with any load, it gives the joints' angles over time instead: the accelerations are
/// integrated twice, and the displacements are converted to angles with the lengths and the pose of the two links in the
/// recording's scenario, at whose ends B and C must be.
/// Vibration at f has the gain 1 − (1 + (f/f0)⁴)⁻³ with the corner f0 of --from-hz. Accelerometers can't measure means,
/// so these are zero. Each angle has the standard deviation due to the instruments' white noise. Four periods of the
/// corner are left out at both ends, except at a start from rest. Clipped readings are refused. The droop of the
/// converters is corrected. Times are those of the readings, earlier than their samples by the converters' delay.
#[derive(Debug, Args)]
pub(crate) struct Identify {
    /// Recordings of one structure, MCAP files, the folder of a survey, or one UFF file of measured frequency responses.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Lowest frequency, Hz [default: that of the recorded excitation, or 1].
    ///
    /// With --angles the default is a quarter of the structure's lowest natural frequency.
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    pub(super) from_hz: Option<f64>,
    /// Highest frequency, Hz [default: that of the recorded excitation, or 100].
    ///
    /// The default for an impact is 1 over its length.
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    pub(super) to_hz: Option<f64>,
    /// Direction of the input force.
    #[arg(long, help_heading = heading::COMPUTATION, value_parser = flags::described(DIRECTIONS), default_value = "principal")]
    input: Direction,
    /// Recording at another force, to tell whether the structure is linear.
    ///
    /// Modes that shift by more than four standard deviations show that it is not; then no deviations are stated.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "FILE")]
    other_level: Option<PathBuf>,
    /// Length of the segments to average, s [default: whole periods, or an eighth of the record].
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "S")]
    segment_s: Option<f64>,
    /// Plot the responses to STEM.svg and STEM.png, with caption, CSV and JSON, and the poles to STEM-poles.svg.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "STEM")]
    pub(super) plot: Option<PathBuf>,
    /// Compare shapes with those of a document, or `computed` ones.
    ///
    /// The document is one of this command with --json. The modal assurance criterion |φᴴψ|²/(φᴴφ ψᴴψ) of two shapes is 1
    /// if they are alike and 0 if they are orthogonal (R. J. Allemang, Sound and Vibration, August 2003). It is taken over
    /// the degrees of freedom that all shapes have; there must be two. The modes `computed` are those of the scenario's
    /// undamped structure in the band. With --plot the figure is STEM-mac.svg.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "FILE")]
    mac: Option<PathBuf>,
    /// Write shapes and responses for modal analysis programs (UFF).
    ///
    /// The file is in the Universal File Format, in ASCII and SI units. It has datasets 151, 164, 15 (nodes), 82 (lines), 55
    /// (shapes) and 58 (measured responses).
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    pub(super) uff: Option<PathBuf>,
    /// Write a report to this HTML file: modes, figures, noise, and the recordings.
    ///
    /// The file needs no network and no other file.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Write the angles of the joints over time to this CSV file, in place of identifying poles.
    ///
    /// The columns are α1 and α2, rad, and their standard deviations.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE", conflicts_with_all = ["to_hz", "input", "other_level", "segment_s", "plot", "mac", "uff", "report"])]
    angles: Option<PathBuf>,
    /// Domain in which accelerations are integrated twice [default: frequency].
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "DOMAIN", value_parser = flags::described(DOMAINS), requires = "angles")]
    integration: Option<Integration>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    pub(super) json: JsonFlag,
}

/// The directions of the input force.
const DIRECTIONS: [(Direction, &str, &str); 3] = [
    (Direction::Principal, "principal", "The direction in which the head reads most"),
    (Direction::X, "head-x", "Along x"),
    (Direction::Y, "head-y", "Along y"),
];
/// The domains of the integration.
const DOMAINS: [(Integration, &str, &str); 2] = [
    (Integration::Frequency, "frequency", "The transform of the whole record over −ω²"),
    (Integration::Time, "time", "Butterworth's high-pass forward and backward, and Numerov's formula"),
];

const UNIT: &str = "m/s² per N";
/// Endings of the files of a plot.
const PLOTTED: &[&str] = &[".svg", ".png", ".txt", ".csv", ".json", "-poles.svg", "-poles.png", "-poles.txt"];
const PLOTTED_MAC: &[&str] = &["-mac.svg", "-mac.png", "-mac.txt"];

#[derive(Serialize)]
pub(super) struct Document {
    /// The recorded structure, to compare the modes with.
    configuration: Value,
    /// Name and unit of each coordinate; none of a structure whose equations are not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    coordinates: Option<Value>,
    /// Positions of the structure's points, m, and lines through them; none of a chain, whose links are drawn.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    positions_m: BTreeMap<String, [f64; 3]>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lines: Vec<Vec<String>>,
    #[serde(flatten)]
    pub found: Found,
    /// Modes of the scenario's structure in the band that were not found.
    pub missing: Vec<MissingMode>,
    /// Comparisons with the recording of --other-level, or with the other levels of a survey.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<Levels>,
    /// The index of the survey.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub survey: Option<SurveyIndex>,
    pub runs: Vec<Run>,
}

/// A recording, with what was read from it.
#[derive(Serialize)]
pub(super) struct Run {
    pub recording: String,
    pub samples: usize,
    pub duration_s: f64,
    /// Seed of the instruments' noise; none of an imported log.
    pub seed: Option<u64>,
    /// Unit vector of the force that is the input.
    direction: [f64; 2],
    /// Degree of freedom of the force.
    pub force: String,
    /// Whether a transient was part of the model; false of a record that is at rest at both ends.
    transient: Option<bool>,
    averaging: &'static str,
    pub averages: usize,
    frequency_hz: Vec<f64>,
    pub responses: Vec<ResponseCurve>,
}

/// A response over all frequencies, complex as [real, imaginary].
#[derive(Serialize)]
pub(super) struct ResponseCurve {
    /// The sensor and its axis.
    response: String,
    /// Its degree of freedom.
    at: String,
    unit: &'static str,
    h1: Vec<[f64; 2]>,
    h2: Vec<[f64; 2]>,
    coherence: Option<Vec<f64>>,
    /// The response of the modes and of the terms for modes outside the band.
    fitted: Option<Vec<[f64; 2]>>,
    /// The fitted response at more frequencies about the modes, for the figure.
    #[serde(skip)]
    smooth: Vec<(f64, [f64; 2])>,
}

/// Comparison of the modes at two levels of force.
#[derive(Serialize)]
pub(super) struct Levels {
    /// Factor of the force in a survey.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level: Option<f64>,
    pub recordings: Vec<String>,
    /// Whether the structure is linear, as far as the modes show; none if no mode was found at both levels.
    pub linear: Option<bool>,
    pub modes: Vec<LevelShift>,
}

/// Differences of a mode, other level less this one.
#[derive(Serialize)]
pub(super) struct LevelShift {
    pub mode: Option<u8>,
    pub pole_frequency_hz: [f64; 2],
    /// Difference of the frequencies over the first one.
    pub frequency_shift: f64,
    /// Difference of the frequencies in its standard deviations.
    pub frequency_z: f64,
    /// Difference of the damping ratios over the first one.
    pub damping_shift: f64,
    /// Difference of the damping ratios in its standard deviations.
    pub damping_z: f64,
    linear: bool,
}

/// A recording that was opened.
struct Opened {
    recording: Recording,
    scenario: Scenario,
    tested: Option<TestedAssembly>,
    record: Record,
}

/// The recordings at a level of force.
struct Level {
    /// Factor of the force in a survey.
    level: Option<f64>,
    opened: Vec<Opened>,
}

/// Returns the poles of a structure's modes.
fn known_poles(tested: &TestedAssembly) -> Vec<KnownPole> {
    let poles = analysis::structure_poles(&tested.assembly);
    let known = |pole: &Option<analysis::Pole>| match pole {
        Some(pole) => KnownPole { frequency_hz: pole.pole_frequency_hz, damping_ratio: pole.pole_damping_ratio },
        // A mode that does not oscillate keeps its number. NaN is near no frequency, so that nothing found gets it.
        None => KnownPole { frequency_hz: f64::NAN, damping_ratio: f64::NAN },
    };
    poles.iter().map(known).collect()
}

impl Identify {
    pub(crate) fn integration(&self) -> Integration {
        self.integration.unwrap_or_default()
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        if let [file] = &self.files[..]
            && is_universal_file(file)
        {
            return self.execute_responses(file);
        }
        if let Some(file) = self.files.iter().chain(&self.other_level).find(|file| is_universal_file(file)) {
            return Err(Failure::usage(format!(
                "{} has frequency responses, which are identified alone: give one such file, or recordings",
                file.display()
            )));
        }
        self.check_outputs()?;
        if let Some(csv) = &self.angles {
            let [file] = &self.files[..] else {
                return Err(Failure::usage(format!(
                    "--angles takes one recording, got {}: give each its own command",
                    self.files.len()
                )));
            };
            let recording = recordings::open(file)?;
            let scenario = Scenario::from_configuration(recording.configuration())?;
            return Ok(identify_angles::execute(self, csv, &recording, &scenario)?.and(recordings::verdict(&recording)));
        }
        let shapes = self.other_shapes()?;
        let (survey, levels) = self.given()?;
        let Some(first) = levels.first().and_then(|level| level.opened.first()) else {
            return Err(Failure::usage("the survey has no complete recording of its first level: repeat its command"));
        };
        let all = || levels.iter().flat_map(|level| &level.opened);
        if let Some(of) = all().find(|of| of.scenario.structure != first.scenario.structure) {
            let [of, first] = [of, first].map(|of| of.recording.path().display());
            let what = format!("{of} has another structure than {first}: give recordings of one structure");
            return Err(Failure::usage(what));
        }
        let verdict = all().map(|of| recordings::verdict(&of.recording)).fold(Verdict::Positive, Verdict::and);
        let verdict = verdict.and(Verdict::of(survey.as_ref().is_none_or(SurveyIndex::is_complete)));
        let document = self.compute(&levels, survey, shapes)?;
        document.missing.iter().for_each(|missing| tracing::warn!("{missing}"));
        if document.missing.is_empty() {
            document.found.warn_of_none();
        }
        if levels[0].opened.iter().any(|of| of.scenario.reads_images()) {
            tracing::warn!("{READS_IMAGES}");
        }
        if all().any(|of| has_faults(&of.scenario)) {
            tracing::warn!("an instrument had a fault in this run, so the modes from its readings may be wrong");
        }
        let Opened { scenario, tested, .. } = first;
        let of = match (tested, scenario.foreign_structure()) {
            (Some(tested), _) => captions::structure(scenario, tested, &[]),
            (None, Some(section)) => captions::foreign_label(section).into(),
            (None, None) => Subtitle::default(),
        };
        let subtitled = |figure: Figure| figure.subtitle(of.clone());
        let drawn = || (subtitled(responses_figure(&document.found, &document.curves())), document.csv());
        let mut files = output::plot(self.plot.as_deref(), &document, drawn)?;
        if let Some(stem) = &self.plot {
            let poles = subtitled(poles_figure(&document.found, &document.curves()));
            files.extend(output::draw(poles, &beside(stem, "-poles"))?);
            files.extend(document.found.draw_mac(stem)?);
        }
        if let Some(path) = &self.uff {
            files.push(write_uff(path, &document.modal_file(first))?);
        }
        if let Some(report) = &self.report {
            files.push(output::write(report.clone(), &identify_report::page(&document, &of)?)?);
        }
        self.json.show(&document, || document.text(), &files)?;
        Ok(Verdict::of(!document.found.modes.is_empty()).and(verdict))
    }

    /// Identifies the modes of measured frequency responses.
    fn execute_responses(&self, file: &Path) -> Result<Verdict, Failure> {
        let given = [
            ("--angles", self.angles.is_some()),
            ("--report", self.report.is_some()),
            ("--other-level", self.other_level.is_some()),
            ("--segment-s", self.segment_s.is_some()),
        ];
        if let Some((flag, _)) = given.into_iter().find(|(_, is_given)| *is_given) {
            return Err(Failure::usage(format!(
                "{flag} needs readings over time, and {} has frequency responses: leave it out",
                file.display()
            )));
        }
        self.check_outputs()?;
        if self.compares_computed() {
            return Err(Failure::usage(format!(
                "--mac {COMPUTED} needs a scenario, and {} has frequency responses: name a document of `identify --json`",
                file.display()
            )));
        }
        identify_responses::execute(self, file, self.other_shapes()?)
    }

    /// Fails if an output would replace an input, or another file without --overwrite.
    fn check_outputs(&self) -> Result<(), Failure> {
        let given = self.files.iter().chain(&self.other_level).chain(&self.mac);
        // Of a survey its index and all of its recordings are read.
        let files = |path: &PathBuf| if path.is_dir() { SurveyIndex::files(path) } else { vec![path.clone()] };
        let inputs = Inputs::of(given.flat_map(files));
        self.overwrite.check_stem(self.plot.as_deref(), PLOTTED, &inputs)?;
        if self.mac.is_some() {
            self.overwrite.check_stem(self.plot.as_deref(), PLOTTED_MAC, &inputs)?;
        }
        self.overwrite.check(self.angles.iter().chain(&self.uff).chain(&self.report).cloned(), &inputs)
    }

    /// Says whether --mac asks for the modes of the scenario's structure.
    fn compares_computed(&self) -> bool {
        self.mac.as_deref() == Some(Path::new(COMPUTED))
    }

    /// Reads the shapes of the document of --mac.
    fn other_shapes(&self) -> Result<Option<Shapes>, Failure> {
        self.mac.as_deref().filter(|_| !self.compares_computed()).map(Shapes::read).transpose()
    }

    /// Opens the recordings, or those in the folder of a survey with its index: the first level is the one to identify.
    fn given(&self) -> Result<(Option<SurveyIndex>, Vec<Level>), Failure> {
        let (folder, index) = match &self.files[..] {
            [folder] if folder.is_dir() => (folder, SurveyIndex::read(folder)?),
            files => {
                let of_files = |files: &[PathBuf]| {
                    let opened = files.iter().map(|file| self.open(file)).collect::<Result<_, _>>()?;
                    Ok(Level { level: None, opened })
                };
                let other = self.other_level.as_slice();
                let levels = [files, other].into_iter().filter(|files| !files.is_empty()).map(of_files);
                return Ok((None, levels.collect::<Result<_, Failure>>()?));
            }
        };
        self.check_survey(&index)?;
        let mut levels = Vec::new();
        for level in index.levels() {
            let opened = index.at_level(level).map(|run| self.open(&folder.join(&run.file)));
            let opened = opened.collect::<Result<Vec<_>, _>>()?;
            // The first level is fitted, and stays also without a recording, which is told later. Others without one have
            // nothing to compare.
            if levels.is_empty() || !opened.is_empty() {
                levels.push(Level { level: Some(level), opened });
            }
        }
        Ok((Some(index), levels))
    }

    fn open(&self, file: &Path) -> Result<Opened, Failure> {
        // A warning about the only recording needs no name.
        let is_one = self.files == [file] && self.other_level.is_none();
        let recording = if is_one { recordings::open(file)? } else { recordings::open_one(file)? };
        let scenario = Scenario::from_configuration(recording.configuration())?;
        let tested = configuration::computable(&scenario)?;
        let record = record(&recording, &scenario, tested.as_ref(), self.input)?;
        Ok(Opened { recording, scenario, tested, record })
    }

    /// Fails if a flag contradicts a survey; warns of runs that are not in it.
    fn check_survey(&self, index: &SurveyIndex) -> Result<(), Failure> {
        if self.other_level.is_some() {
            return Err(Failure::usage(
                "--other-level is for recordings: a survey has its other levels itself; leave it out",
            ));
        }
        let missing = index.runs.iter().filter(|run| run.state != RunState::Done).count();
        if missing > 0 {
            let total = index.runs.len();
            tracing::warn!("{missing} of {total} runs of the survey have no complete recording, and are left out");
        }
        Ok(())
    }

    /// Returns the band of the flags, that of a plan, or that in which all recordings have a force.
    fn band(&self, opened: &[&Opened], planned: Option<Band>) -> Band {
        let usual = opened.iter().map(|of| {
            let waveform = of.scenario.excitation.as_ref().map(|excitation| &excitation.profile);
            band(waveform, of.record.rate_hz())
        });
        let common = usual
            .reduce(|one, other| Band { from_hz: one.from_hz.max(other.from_hz), to_hz: one.to_hz.min(other.to_hz) });
        // There is at least one recording, so the empty band is never used.
        let common = planned.or(common).unwrap_or(Band { from_hz: 0.0, to_hz: 0.0 });
        Band { from_hz: self.from_hz.unwrap_or(common.from_hz), to_hz: self.to_hz.unwrap_or(common.to_hz) }
    }

    fn compute(
        &self,
        levels: &[Level],
        survey: Option<SurveyIndex>,
        shapes: Option<Shapes>,
    ) -> Result<Document, Failure> {
        let opened = &levels[0].opened;
        let others = &levels[1..];
        let records: Vec<&Record> = opened.iter().map(|of| &of.record).collect();
        let all: Vec<&Opened> = levels.iter().flat_map(|level| &level.opened).collect();
        let band = self.band(&all, survey.as_ref().and_then(SurveyIndex::band));
        // The responses are estimated first: it is they that --segment-s must fit.
        let estimates = opened
            .iter()
            .map(|of| {
                let averaging = self.averaging(of)?;
                Ok(identify::frequency_response(&of.record, band, averaging)?)
            })
            .collect::<Result<Vec<_>, Failure>>()?;
        let mut found = identify::modes(&records, band)?;
        let Opened { scenario, tested, .. } = &opened[0];
        let known = tested.as_ref().map_or(Vec::new(), known_poles);
        let known_hz: Vec<f64> = known.iter().map(|pole| pole.frequency_hz).collect();
        let numbers_of = |found: &Identification| {
            let found_hz: Vec<f64> = found.modes.iter().map(|mode| mode.pole_frequency_hz).collect();
            mode_numbers(&found_hz, &known_hz)
        };
        let numbers = numbers_of(&found);
        let missing = missing_modes(&records, &numbers, &known, band);
        let levels = others
            .iter()
            .map(|other| compared(&mut found, &numbers, other, band))
            .collect::<Result<Vec<_>, Failure>>()?;
        let runs = estimates.iter().enumerate().map(|(index, estimate)| {
            let of = &opened[index];
            let smooth_hz = smooth_hz(&estimate.frequency_hz, &found);
            let curve = |(response, read): (usize, &identify::RecordedResponse)| {
                let pairs = |values: &[_]| values.iter().map(pair).collect();
                let fitted = estimate.frequency_hz.iter().map(|hz| found.fitted(index, response, *hz));
                ResponseCurve {
                    response: read.name.clone(),
                    at: read.at.clone(),
                    unit: UNIT,
                    h1: pairs(&estimate.h1[response]),
                    h2: pairs(&estimate.h2[response]),
                    coherence: estimate.coherence.as_ref().map(|coherence| coherence[response].clone()),
                    fitted: fitted.map(|value| value.map(|value| pair(&value))).collect(),
                    smooth: smooth_hz
                        .iter()
                        .filter_map(|hz| Some((*hz, pair(&found.fitted(index, response, *hz)?))))
                        .collect(),
                }
            };
            Run {
                recording: of.recording.path().display().to_string(),
                samples: of.record.samples(),
                duration_s: of.record.samples() as f64 / of.record.rate_hz(),
                // The noise of a bench that was logged had no seed.
                seed: of.recording.configuration().get(IMPORTED_FROM).is_none().then_some(of.scenario.simulation.seed),
                direction: of.record.direction(),
                force: found.forces[index].clone(),
                transient: found.estimate.as_ref().map(|estimate| estimate.runs[index].transient),
                averaging: match estimate.averaging {
                    Averaging::Welch(_) => "welch",
                    Averaging::Periods(_) => "periods",
                    Averaging::Single => "single",
                },
                averages: estimate.averages,
                frequency_hz: estimate.frequency_hz.clone(),
                responses: of.record.responses().iter().enumerate().map(curve).collect(),
            }
        });
        let runs = runs.collect();
        let mut found = Found::new(found, numbers, band);
        let shapes = match (self.compares_computed(), tested) {
            (false, _) => shapes,
            (true, Some(tested)) => Some(Shapes::computed(tested, &known, band, &found.at)?),
            (true, None) => {
                return Err(Failure::usage(format!(
                    "--mac {COMPUTED} needs equations, and the structure of {} has none that are known: name a document of \
                     `identify --json`",
                    opened[0].recording.path().display()
                )));
            }
        };
        if let Some(shapes) = &shapes {
            found.compare(shapes)?;
        }
        let is_modal = scenario.structure.kind == StructureKind::Modal;
        let drawing = drawing(&opened[0]).filter(|_| is_modal);
        let (positions_m, lines) = drawing.as_ref().map(Drawing::named).unwrap_or_default();
        Ok(Document {
            runs,
            coordinates: tested.as_ref().map(|tested| configuration::coordinates(&tested.assembly)),
            positions_m,
            lines,
            configuration: configuration::of_scenario(scenario)?,
            found,
            missing,
            levels,
            survey,
        })
    }

    /// Returns the averaging of the flags, or the one that suits the excitation.
    fn averaging(&self, of: &Opened) -> Result<Averaging, Failure> {
        let waveform = of.scenario.excitation.as_ref().map(|excitation| &excitation.profile);
        match self.segment_s {
            None => Ok(averaging(waveform, &of.record)),
            Some(segment_s) if segment_s > 0.0 => Ok(Averaging::Welch(samples_in(segment_s, &of.record))),
            Some(_) => Err(flags::refused("--segment-s", &"it must be positive")),
        }
    }
}

/// Writes modes and responses, and returns the path.
pub(super) fn write_uff(path: &Path, file: &ModalFile) -> Result<PathBuf, Failure> {
    if let Some(dof) = file.without_axis() {
        return Err(Failure::usage(format!(
            "--uff: the response at {dof} has no direction, and shapes in the file are along x, y and z: export the responses \
             with their directions"
        )));
    }
    file.write(path).map_err(Failure::write(path))?;
    Ok(path.to_path_buf())
}

/// Returns the first of equally spaced frequencies and their step.
pub(super) fn first_and_step_hz(frequency_hz: &[f64]) -> [f64; 2] {
    match frequency_hz {
        [first, .., last] => [*first, (last - first) / (frequency_hz.len() - 1) as f64],
        [first] => [*first, 0.0],
        [] => [0.0; 2],
    }
}

pub(super) fn pair(value: &nalgebra::Complex<f64>) -> [f64; 2] {
    [value.re, value.im]
}

/// Identifies the modes at another level and compares them. If the structure is not linear, `found` states no deviations.
fn compared(found: &mut Identification, numbers: &[Option<u8>], other: &Level, band: Band) -> Result<Levels, Failure> {
    let records: Vec<&Record> = other.opened.iter().map(|of| &of.record).collect();
    let mut second = identify::modes(&records, band)?;
    let shifts = identify::compare_levels(found, &mut second);
    let modes: Vec<LevelShift> = shifts
        .iter()
        .map(|shift| LevelShift {
            mode: numbers[shift.first],
            pole_frequency_hz: [
                found.modes[shift.first].pole_frequency_hz,
                second.modes[shift.second].pole_frequency_hz,
            ],
            frequency_shift: shift.frequency_shift,
            frequency_z: shift.frequency_z,
            damping_shift: shift.damping_shift,
            damping_z: shift.damping_z,
            linear: !shift.nonlinear,
        })
        .collect();
    Ok(Levels {
        level: other.level,
        recordings: other.opened.iter().map(|of| of.recording.path().display().to_string()).collect(),
        linear: (!modes.is_empty()).then(|| modes.iter().all(|mode| mode.linear)),
        modes,
    })
}

impl Run {
    /// Returns the curves of the responses; the number of the recording is in their titles if there is one.
    fn curves(&self, number: Option<usize>) -> impl Iterator<Item = Curve<'_>> {
        self.responses.iter().map(move |curve| Curve {
            title: number.map_or(curve.at.clone(), |number| format!("{}, run {number}", curve.at)),
            label: format!("H₁ ({UNIT})"),
            frequency_hz: &self.frequency_hz,
            measured: &curve.h1,
            coherence: curve.coherence.as_deref(),
            step: 1,
            fitted: &curve.smooth,
        })
    }
}

/// Returns the drawing of the recorded structure, if its equations are known and its points have positions.
fn drawing(of: &Opened) -> Option<Drawing> {
    let tested = of.tested.as_ref()?;
    Drawing::of_assembly(&of.scenario.structure, &tested.assembly)
}

impl Document {
    /// Returns the curves of the figures.
    pub fn curves(&self) -> Vec<Curve<'_>> {
        self.curves_of_runs().into_iter().map(|(_, curve)| curve).collect()
    }

    /// Returns the curves of the figures, each with its recording.
    pub fn curves_of_runs(&self) -> Vec<(&Run, Curve<'_>)> {
        let is_several = self.runs.len() > 1;
        let runs = self.runs.iter().zip(1..);
        let of = |(run, number)| Run::curves(run, is_several.then_some(number)).map(move |curve| (run, curve));
        runs.flat_map(of).collect()
    }

    /// Returns the modes and the responses H1 for a file in the Universal File Format.
    fn modal_file(&self, first: &Opened) -> ModalFile {
        let Opened { scenario, tested, recording, .. } = first;
        let (positions_m, lines) = drawing(first).as_ref().map(Drawing::named).unwrap_or_default();
        let of_run = |run: &Run| {
            let force = run.force.clone();
            let first_and_step_hz = first_and_step_hz(&run.frequency_hz);
            let of_curve = move |curve: &ResponseCurve| FileResponse {
                response: curve.at.clone(),
                force: force.clone(),
                quantity: MeasuredQuantity::Acceleration,
                first_and_step_hz,
                values: curve.h1.iter().map(|[re, im]| nalgebra::Complex::new(*re, *im)).collect(),
            };
            run.responses.iter().map(of_curve).collect::<Vec<_>>()
        };
        ModalFile {
            title: match tested {
                Some(tested) => captions::label(scenario, tested),
                None => recording.path().display().to_string(),
            },
            positions_m,
            lines,
            at: self.found.at.clone(),
            modes: self.found.file_modes(),
            responses: self.runs.iter().flat_map(of_run).collect(),
        }
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for run in &self.runs {
            let [x, y] = run.direction.map(to_three_places);
            text += &format!(
                "{}: {:.3} s, force along ({x:.3}, {y:.3}), {} to {} Hz; {} averages\n",
                run.recording,
                run.duration_s,
                short(&self.found.from_hz),
                short(&self.found.to_hz),
                run.averages
            );
        }
        text += &self.found.text(self.runs.len() > 1);
        text + &self.levels.iter().map(Levels::text).collect::<String>()
    }

    /// Returns the CSV: frequency, then modulus and phase of H1, of H2 and of the fit, and the coherence of each response. With
    /// several recordings, the number of each comes first.
    fn csv(&self) -> String {
        let is_several = self.runs.len() > 1;
        let mut names: Vec<&str> = Vec::new();
        for curve in self.runs.iter().flat_map(|run| &run.responses) {
            if !names.contains(&curve.response.as_str()) {
                names.push(&curve.response);
            }
        }
        let has_coherence = self.runs.iter().flat_map(|run| &run.responses).any(|curve| curve.coherence.is_some());
        let mut text = String::from(if is_several { "run,frequency_hz" } else { "frequency_hz" });
        for response in &names {
            let name = response.replace('-', "_");
            for estimate in ["h1", "h2", "fitted"] {
                text += &format!(",{name}_{estimate}_modulus_m_s2_per_n,{name}_{estimate}_phase_deg");
            }
            text += &if has_coherence { format!(",{name}_coherence") } else { String::new() };
        }
        text.push('\n');
        for (run, number) in self.runs.iter().zip(1..) {
            for (k, hz) in run.frequency_hz.iter().enumerate() {
                text += &if is_several { format!("{number},{hz}") } else { format!("{hz}") };
                for name in &names {
                    let curve = run.responses.iter().find(|curve| curve.response == *name);
                    let fitted = curve.and_then(|curve| Some(curve.fitted.as_ref()?[k]));
                    for value in [curve.map(|curve| curve.h1[k]), curve.map(|curve| curve.h2[k]), fitted] {
                        text += &value.map_or(String::from(",,"), |[re, im]| {
                            format!(",{:e},{}", libm::hypot(re, im), libm::atan2(im, re).to_degrees())
                        });
                    }
                    if has_coherence {
                        let coherence = curve.and_then(|curve| Some(curve.coherence.as_ref()?[k]));
                        text += &coherence.map_or(String::from(","), |coherence| format!(",{coherence}"));
                    }
                }
                text.push('\n');
            }
        }
        text
    }
}

impl Levels {
    fn text(&self) -> String {
        let other = match self.level {
            Some(level) => format!("level {}", short(&level)),
            None => self.recordings.join(", "),
        };
        let mut text = format!("\n  against {other}   shift of frequency   (z)   shift of damping   (z)\n");
        let room = other.chars().count() + 8;
        for shift in &self.modes {
            let name =
                shift.mode.map_or(format!("{:.2} Hz", shift.pole_frequency_hz[0]), |mode| format!("mode {mode}"));
            text += &format!(
                "  {name:<room$}   {:+18.1e}   {:>5}   {:+14.1e}   {:>5}\n",
                shift.frequency_shift,
                signed(shift.frequency_z, 1),
                shift.damping_shift,
                signed(shift.damping_z, 1)
            );
        }
        text + match self.linear {
            Some(true) => "  linear: no mode shifts by more than four standard deviations (z)\n",
            Some(false) => "  not linear: a mode shifts by more than four standard deviations (z)\n",
            None => "  no mode was found at both levels\n",
        }
    }
}

/// Rounds to three decimal places, and never to −0.
fn to_three_places(value: f64) -> f64 {
    // In IEEE 754, −0 + 0 is +0. Any other number is unchanged.
    libm::rint(value * 1e3) / 1e3 + 0.0
}
