//! `resonarm survey --labelled`: what other programs for modal analysis read, and what their results are scored on.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::identify::first_and_step_hz;
use crate::failure::Failure;
use crate::output;
use crate::recordings;
use resonarm::analysis::structure_poles;
use resonarm::drawing::Drawing;
use resonarm::export::{ExportFormat, RecordingPart, Selection, export};
use resonarm::identification::{averaging, record};
use resonarm::identify::{Direction, RigPlaces, frequency_response};
use resonarm::modal_file::{FileResponse, ModalFile};
use resonarm::plant::TestedAssembly;
use resonarm::recording::Recording;
use resonarm::responses::MeasuredQuantity;
use resonarm::rig::RigSpec;
use resonarm::scenario::Scenario;
use resonarm::survey::{RunState, SurveyIndex, SurveyRun, displacements};

/// Name of the file with the truth.
const FILE: &str = "labelled.json";

#[derive(Serialize)]
struct Labelled {
    /// Number of the node of each point in the UFF files.
    nodes: BTreeMap<String, u32>,
    /// Numbers of the modes in the band.
    in_band: Vec<usize>,
    /// All modes of the structure at rest.
    modes: Vec<TrueMode>,
    runs: Vec<LabelledRun>,
}

/// A mode of the structure's equations, linear at rest.
#[derive(Serialize)]
struct TrueMode {
    mode: usize,
    /// Of the undamped structure.
    frequency_hz: f64,
    /// |λ|/2π of the damped structure's pole λ; none of a mode that does not oscillate.
    pole_frequency_hz: Option<f64>,
    /// Damping ratio −Re λ/|λ| of the pole.
    pole_damping_ratio: Option<f64>,
    /// Displacements of the undamped structure's mode for the modal mass 1 kg.
    shape_per_sqrt_kg: BTreeMap<String, f64>,
    /// Modal mass of the shape that is 1 where the force of a run acts.
    modal_mass_kg: BTreeMap<String, f64>,
}

#[derive(Serialize)]
struct LabelledRun {
    #[serde(flatten)]
    run: SurveyRun,
    /// File of the readings over time.
    time: PathBuf,
    /// File of the accelerances H1.
    responses: PathBuf,
    /// How they were averaged, and of how many segments or periods.
    averages: usize,
    /// Force and accelerations, by their columns in the table of readings.
    channels: Vec<LabelledChannel>,
}

#[derive(Serialize)]
struct LabelledChannel {
    column: String,
    /// Name of the degree of freedom, as tip.x.
    at: String,
    unit: &'static str,
    /// Standard deviation of a sample's noise, with rounding.
    noise: f64,
}

/// Returns the files that are written for an index, relative to its folder.
pub(super) fn files(runs: &[SurveyRun]) -> Vec<PathBuf> {
    let of_run = |run: &SurveyRun| [responses_file(run), time_file(run)];
    std::iter::once(PathBuf::from(FILE)).chain(runs.iter().flat_map(of_run)).collect()
}

fn responses_file(run: &SurveyRun) -> PathBuf {
    run.file.with_extension("uff")
}

fn stem(run: &SurveyRun) -> PathBuf {
    run.file.with_extension("")
}

fn time_file(run: &SurveyRun) -> PathBuf {
    let files = ExportFormat::Csv.files(&stem(run), &[RecordingPart::Samples]);
    files.into_iter().map(|(path, _)| path).next().unwrap_or_default()
}

/// Writes the truth, and readings and responses of all complete runs. Returns the files.
pub(super) fn write(folder: &Path, index: &SurveyIndex) -> Result<Vec<PathBuf>, Failure> {
    let done: Vec<&SurveyRun> = index.runs.iter().filter(|run| run.state == RunState::Done).collect();
    let Some(first) = done.first() else { return Ok(Vec::new()) };
    let (_, scenario, tested) = opened(&folder.join(&first.file))?;
    let geometry = geometry(&scenario, &tested);
    let mut written = Vec::new();
    let mut runs = Vec::new();
    for run in &done {
        runs.push(labelled(folder, index, run, &geometry)?);
        written.extend([folder.join(responses_file(run)), folder.join(time_file(run))]);
    }
    let document = Labelled {
        modes: modes(&tested, &done),
        nodes: geometry.nodes().into_iter().map(|(point, number)| (point.to_owned(), number)).collect(),
        in_band: index.plan.as_ref().map_or(Vec::new(), |plan| plan.modes.clone()),
        runs,
    };
    written.push(output::write_json(folder.join(FILE), &document)?);
    Ok(written)
}

fn opened(path: &Path) -> Result<(Recording, Scenario, TestedAssembly), Failure> {
    let recording = recordings::open_one(path)?;
    let scenario = Scenario::from_configuration(recording.configuration())?;
    let tested = scenario.under_test()?;
    Ok((recording, scenario, tested))
}

/// Returns what the UFF files of all runs share: points, lines, and the numbers of the nodes, which all degrees of freedom of the
/// structure give.
fn geometry(scenario: &Scenario, tested: &TestedAssembly) -> ModalFile {
    let drawing = Drawing::of_assembly(&scenario.structure, &tested.assembly);
    let (positions_m, lines) = drawing.as_ref().map(Drawing::named).unwrap_or_default();
    ModalFile { positions_m, lines, at: displacements(&tested.assembly), ..ModalFile::default() }
}

fn modes(tested: &TestedAssembly, runs: &[&SurveyRun]) -> Vec<TrueMode> {
    let assembly = &tested.assembly;
    let component = |name: &str, shape: &[f64]| -> Option<f64> {
        let direction = assembly.direction_at_rest(assembly.dof(name).ok()?);
        Some(direction.iter().zip(shape).map(|(along, part)| along * part).sum())
    };
    let names = displacements(assembly);
    let each = assembly.modes().iter().zip(structure_poles(assembly)).zip(1..);
    each.map(|((mode, pole), number)| TrueMode {
        mode: number,
        frequency_hz: mode.frequency_hz,
        pole_frequency_hz: pole.map(|pole| pole.pole_frequency_hz),
        pole_damping_ratio: pole.map(|pole| pole.pole_damping_ratio),
        shape_per_sqrt_kg: names
            .iter()
            .filter_map(|name| Some((name.clone(), component(name, &mode.shape)?)))
            .collect(),
        modal_mass_kg: runs
            .iter()
            .flat_map(|run| &run.exciter)
            .filter_map(|name| Some((name.clone(), component(name, &mode.shape)?)))
            // A force at a node of the mode does not move it.
            .filter(|(_, part)| *part != 0.0)
            .map(|(name, part)| (name, 1.0 / (part * part)))
            .collect(),
    })
    .collect()
}

/// Writes readings and responses of a run.
fn labelled(folder: &Path, index: &SurveyIndex, run: &SurveyRun, geometry: &ModalFile) -> Result<LabelledRun, Failure> {
    let (recording, scenario, tested) = opened(&folder.join(&run.file))?;
    let selection = Selection::of(&recording, ExportFormat::Csv, &[RecordingPart::Samples], None, None)?;
    export(&recording, ExportFormat::Csv, &selection, &folder.join(stem(run)))?;
    let record = record(&recording, &scenario, Some(&tested), Direction::Principal)?;
    let waveform = scenario.excitation.as_ref().map(|excitation| &excitation.profile);
    let band = index.band().unwrap_or_else(|| resonarm::identification::band(waveform, record.rate_hz()));
    let estimate = frequency_response(&record, band, averaging(waveform, &record))?;
    let force = run.exciter.first().map_or("", String::as_str);
    let responses = record.responses().iter().zip(&estimate.h1).map(|(response, values)| FileResponse {
        response: response.at.clone(),
        force: force.to_owned(),
        quantity: MeasuredQuantity::Acceleration,
        first_and_step_hz: first_and_step_hz(&estimate.frequency_hz),
        values: values.clone(),
    });
    let file = ModalFile { title: run.file.display().to_string(), responses: responses.collect(), ..geometry.clone() };
    let path = folder.join(responses_file(run));
    file.write(&path).map_err(Failure::write(&path))?;
    Ok(LabelledRun {
        run: run.clone(),
        time: time_file(run),
        responses: responses_file(run),
        averages: estimate.averages,
        channels: channels(&scenario.rig, &tested, force, record.rate_hz()),
    })
}

/// Returns the channels of a rig on degrees of freedom, by their columns.
fn channels(rig: &RigSpec, tested: &TestedAssembly, force: &str, rate_hz: f64) -> Vec<LabelledChannel> {
    let head = LabelledChannel {
        column: String::from("head_force_x_n"),
        at: force.to_owned(),
        unit: "N",
        noise: rig.head.reading_noise(rate_hz),
    };
    let places = RigPlaces::of_structure(tested, rig);
    let readings = places.readings.into_iter().filter_map(|reading| {
        Some(LabelledChannel {
            column: format!("acceleration_{}_m_s2", reading.name.replace('-', "_")),
            at: reading.at?,
            unit: "m/s²",
            noise: reading.sensor.reading_noise(rate_hz),
        })
    });
    std::iter::once(head).chain(readings).collect()
}
