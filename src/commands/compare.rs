//! `resonarm compare`: measured points against the computed branch.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::computed_branch::{ComputedBranch, SAME_LOAD, Score, is_at_one_load, load_range};
use crate::configuration;
use crate::drive::{Drive, LoadDocument};
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::help::heading;
use crate::measured_points::{MeasuredPoint, points};
use crate::output::{self, Inputs, PlotFlags, or_empty};
use crate::read_at::displacement_unit;
use crate::recordings;
use resonarm::analysis::Nearest;
use resonarm::control::ResponsePoint;
use resonarm::identification::acting_load;
use resonarm::plant::TestedAssembly;
use resonarm::replay;
use resonarm::scenario::{Scenario, StructureSection};
use resonarm_numeric::number::short;
use resonarm_scenario::text_file;

const EXAMPLES: &str = "\
FILE is one of:
  a recording, *.mcap, from whose frames the responses are measured again;
  a JSON document with `configuration` (the structure as links or modes, and `drive`, the amplitude at each degree of
  freedom) and `points` (`frequency_hz`, `settled`, and `readings` with the amplitude at each degree of freedom; optionally
  `excitation`, and `phase_deg` and `clipped` of each reading).

Each point is compared with the nearest point of the branch. Nearest is measured in frequency and in the amplitude at one
degree of freedom: a relative deviation of 2e-5 in frequency counts as much as one of 1e-3 in amplitude.

Examples:
  resonarm experiment walk --drive joint1=20 --plot walk
  resonarm compare walk.json --plot compared
  resonarm experiment walk --drive joint1=20 --record walk.mcap
  resonarm compare walk.mcap --at joint2.y";

/// Compares measured points with the computed branch.
///
/// The points are those of a document of `experiment walk`, of any other with the same keys, or of a recording.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
#[command(mut_args(output::explained(
    "Plot the points over the branch to STEM.svg and STEM.png",
    "The deviations are in STEM.csv and STEM.json."
)))]
pub(crate) struct Compare {
    /// JSON document with the points, - for standard input; or a recording, an MCAP file.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Degree of freedom whose amplitude is compared [default: where the points move most].
    ///
    /// It is one at which the points were measured. By default one without clipped readings is taken if there is one.
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF")]
    at: Option<String>,
    #[command(flatten)]
    output: PlotFlags,
}

/// Measured points, with the structure and the load at which they were measured.
struct Measured {
    /// The structure and the drive, as the document states them.
    configuration: Value,
    scenario: Scenario,
    tested: TestedAssembly,
    drive: Drive,
    points: Vec<MeasuredPoint>,
}

/// The keys that are read from a document.
#[derive(Deserialize)]
struct MeasuredDocument {
    configuration: Configuration,
    points: Vec<MeasuredPoint>,
}

#[derive(Deserialize)]
struct Configuration {
    structure: Value,
    drive: BTreeMap<String, LoadDocument>,
}

/// A point and the place of the branch that is nearest to it.
#[derive(Serialize)]
struct Compared {
    #[serde(flatten)]
    point: MeasuredPoint,
    /// Measured over computed frequency, less 1.
    frequency_deviation: f64,
    amplitude_deviation: f64,
    /// Measured less computed phase, degrees.
    phase_deviation_deg: Option<f64>,
    computed_stable: Option<bool>,
}

#[derive(Serialize)]
struct Document<'a> {
    configuration: Value,
    coordinates: Value,
    /// The degree of freedom whose fundamental is compared.
    at: &'a str,
    /// The unit of its displacement.
    #[serde(skip)]
    unit: &'static str,
    /// The load of the computed branch: the mean of the loads that acted.
    load: String,
    points: Vec<Compared>,
    /// The largest deviations of settled points without clipped readings; none if there are no such points.
    score: Option<Score>,
}

impl Compare {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.output.check(output::PLOTTED, &Inputs::of([&self.file]))?;
        let (measured, whole) = if self.file.extension().is_some_and(|extension| extension == "mcap") {
            let (scenario, responses, whole) = recorded_responses(&self.file)?;
            let tested = scenario.under_test()?;
            let (drive, points) = recorded_points(&self.file, (&scenario, &tested), &responses)?;
            let mut configuration = configuration::of_structure(&scenario, &tested);
            configuration["drive"] = drive.document();
            (Measured { configuration, scenario, tested, drive, points }, whole)
        } else {
            (self.read()?, Verdict::Positive)
        };
        self.check(&measured.points, &measured.tested)?;
        let Measured { configuration, scenario, tested, drive, points } = &measured;
        let computed = ComputedBranch::new(&tested.assembly, drive, points, self.at.as_deref())?;
        // At differing loads `ComputedBranch` falls back to the load of the document, which suits a figure.
        // Deviations from it would compare one load with another, so they are rejected here.
        let Some(computed) = computed.filter(|_| is_at_one_load(points)) else {
            return Err(self.not_on_one_branch(points));
        };
        let document = Document {
            configuration: configuration.clone(),
            coordinates: configuration::coordinates(&tested.assembly),
            at: &computed.at.name,
            unit: computed.at.unit(),
            load: computed.drive.rounded_words(),
            points: points.iter().filter_map(|point| Compared::new(point, &computed)).collect(),
            score: computed.score(points),
        };
        let conditions = captions::structure(scenario, tested, &[]);
        let figure = || computed.figure("Measured on computed", conditions, points);
        self.output.show(&document, || (figure(), document.csv()), || document.text())?;
        Ok(whole)
    }

    /// Reads the points of a document, with their structure and its loads.
    fn read(&self) -> Result<Measured, Failure> {
        let name = self.file.display();
        let read = if self.file.as_os_str() == "-" {
            text_file::read_numbers("/dev/stdin".as_ref())
        } else {
            text_file::read_numbers(&self.file)
        };
        let text = read.map_err(|source| Failure::usage(format!("{name} can't be read: {source}")))?;
        let foreign =
            |source| Failure::usage(format!("{name} is not a document of `experiment walk --json`: {source}"));
        let MeasuredDocument { configuration, points } = serde_json::from_str(&text).map_err(foreign)?;
        let Configuration { structure, drive } = configuration;
        let mut configuration = json!({ "structure": structure.clone() });
        // `from_document` makes a chain from the links in the document and drops the preset. Its name is kept for
        // captions.
        let preset = preset_name(&structure);
        let mut structure = StructureSection::from_document(structure).map_err(foreign)?;
        structure.name = structure.name.or(preset);
        let scenario = Scenario { structure, ..Scenario::default() };
        let tested = scenario.under_test()?;
        let drive = Drive::of_document(&drive, &tested.assembly)?;
        if drive.loads.is_empty() || !drive.size().is_finite() || drive.size() == 0.0 {
            return Err(Failure::usage(format!(
                "{name}: the load in its configuration is zero, expected a load to compute the branch at"
            )));
        }
        configuration["drive"] = drive.document();
        Ok(Measured { configuration, scenario, tested, drive, points })
    }

    /// Rejects points that can't be compared.
    fn check(&self, points: &[MeasuredPoint], tested: &TestedAssembly) -> Result<(), Failure> {
        let usage = |problem: String| Err(Failure::usage(format!("{}: {problem}", self.file.display())));
        if points.is_empty() {
            return usage(String::from("it has no points to compare"));
        }
        let is_positive = |value: f64| value.is_finite() && value > 0.0;
        if let Some(at) = points.iter().position(|point| !is_positive(point.frequency_hz)) {
            return usage(format!("the frequency of point {at} must be positive"));
        }
        // A reading below the resolution of an instrument is zero.
        let is_amplitude = |value: f64| value.is_finite() && value >= 0.0;
        let amplitudes = |point: &MeasuredPoint| {
            !point.readings.is_empty() && point.readings.values().all(|reading| is_amplitude(reading.amplitude))
        };
        if let Some(at) = points.iter().position(|point| !amplitudes(point)) {
            return usage(format!("point {at} must have readings, with amplitudes of 0 or more"));
        }
        for (at, point) in points.iter().enumerate() {
            for (name, reading) in &point.readings {
                let expected = tested.assembly.dof(name).map(displacement_unit);
                // An unknown name has no unit here. It is rejected later if its amplitude is the one to be compared.
                if let (Some(unit), Ok(expected)) = (&reading.unit, expected)
                    && unit != expected
                {
                    return usage(format!("point {at}: the reading at {name} is in {unit}, expected {expected}"));
                }
            }
        }
        match &self.at {
            Some(dof) if points.iter().all(|point| point.amplitude(dof).is_none()) => {
                let known: Vec<&str> = points[0].readings.keys().map(String::as_str).collect();
                usage(format!(
                    "--at {dof}: the points were measured at other degrees of freedom; choose one of {}",
                    known.join(", ")
                ))
            }
            _ => Ok(()),
        }
    }

    fn not_on_one_branch(&self, points: &[MeasuredPoint]) -> Failure {
        let [least, most] = load_range(points);
        Failure::usage(format!(
            "{}: its points have loads from {least:.4} to {most:.4}, but loads on a single branch differ by \
             at most {} %; use points at one load, or draw a backbone by `resonarm backbone`",
            self.file.display(),
            short(&(100.0 * SAME_LOAD)),
        ))
    }
}

/// The advice on recordings that can be compared.
const HOW: &str = "responses are read with [control] or with an [excitation] with `dwell`, `stepped-sine` or `sine-list`: \
                   `resonarm experiment walk --drive DOF=A --record walk.mcap` makes such a recording";

/// Reads the responses in a recording, with its scenario, and whether the recording is whole.
fn recorded_responses(file: &Path) -> Result<(Scenario, Vec<ResponsePoint>, Verdict), Failure> {
    let recording = recordings::open(file)?;
    let scenario = Scenario::from_configuration(recording.configuration())?;
    let name = file.display();
    let none = |why: &str| Failure::usage(format!("{name} holds no responses: {why}; {HOW}"));
    if scenario.excitation.is_none() && scenario.control.is_none() {
        return Err(none("its scenario does not state what the exciter played"));
    }
    let responses = replay::responses(&recording)?;
    if responses.is_empty() {
        return Err(none("no response was read before its end"));
    }
    Ok((scenario, responses, recordings::verdict(&recording)))
}

/// Returns the points of a recording with the load that acted: in open loop a shaker's force on the structure is not
/// the commanded one.
fn recorded_points(
    file: &Path,
    (scenario, tested): (&Scenario, &TestedAssembly),
    responses: &[ResponsePoint],
) -> Result<(Drive, Vec<MeasuredPoint>), Failure> {
    let acting = |response: &ResponsePoint| {
        let load = acting_load(response, scenario, tested).map_err(|error| Failure::usage(error.to_string()))?;
        Ok(ResponsePoint { load, ..*response })
    };
    let acted = responses.iter().map(acting).collect::<Result<Vec<_>, Failure>>()?;
    // Without an amplitude all loads are 0, which drives nothing and is rejected in the next statement.
    let amplitude = scenario.amplitude().copied().unwrap_or_default();
    let drive = Drive::of_exciter(&amplitude, tested).ok_or_else(|| {
        Failure::usage(format!("{}: the load of its scenario acts at no point of the structure", file.display()))
    })?;
    Ok((drive, points(tested, &acted)))
}

/// Names the preset and the angles that a document states, as `irb1600-fitted at 0°, 60°`.
fn preset_name(structure: &Value) -> Option<String> {
    let preset = structure["preset"].as_str()?;
    let angles = structure["angles_deg"].as_array()?;
    let angles: Vec<String> = angles.iter().filter_map(Value::as_f64).map(captions::degrees).collect();
    Some(format!("{preset} at {}", angles.join(", ")))
}

impl Compared {
    fn new(point: &MeasuredPoint, computed: &ComputedBranch) -> Option<Compared> {
        let Nearest { frequency_deviation, amplitude_deviation, phase_rad, is_stable } = computed.nearest(point)?;
        let measured_deg = point.readings.get(&computed.at.name).and_then(|reading| reading.phase_deg);
        let off_deg = |measured_deg: f64| {
            let off_deg = measured_deg - phase_rad.to_degrees();
            // Both phases are known up to whole turns: the difference is brought to −180° to 180°.
            off_deg - 360.0 * (off_deg / 360.0).round()
        };
        Some(Compared {
            point: point.clone(),
            frequency_deviation,
            amplitude_deviation,
            phase_deviation_deg: measured_deg.map(off_deg),
            computed_stable: is_stable,
        })
    }
}

impl Document<'_> {
    fn text(&self) -> String {
        let at = self.at;
        let mut text = format!("computed for {}\n", self.load);
        text += &format!("  {:>12}  {at:>13}  {:>12}  {:>9}  {:>9}  computed\n", "frequency", "Δf/f", "ΔA/A", "Δφ");
        for compared in &self.points {
            let Compared { point, frequency_deviation, amplitude_deviation, phase_deviation_deg, .. } = compared;
            let stability = match compared.computed_stable {
                Some(true) => "stable",
                Some(false) => "unstable",
                None => "–",
            };
            // A point that has not settled is the graver fault, and its clipping adds nothing: one remark a point.
            let remark = match (point.settled, point.is_clipped(at)) {
                (false, _) => ", point not settled",
                (true, true) => ", from clipped readings",
                (true, false) => "",
            };
            let amplitude = point
                .readings
                .get(at)
                .map_or(String::from("–"), |reading| format!("{:.4e} {}", reading.amplitude, self.unit));
            let phase = phase_deviation_deg.map_or(String::from("–"), |off_deg| format!("{off_deg:+.2}°"));
            text += &format!(
                "  {:9.5} Hz  {:>13}  {frequency_deviation:+12.2e}  {:+7.3} %  {phase:>9}  {stability}{remark}\n",
                point.frequency_hz,
                amplitude,
                100.0 * amplitude_deviation,
            );
        }
        text + &self.score.as_ref().map_or(String::new(), Score::line)
    }

    fn csv(&self) -> String {
        let mut text = String::from(
            "frequency_hz,amplitude,settled,clipped,frequency_deviation,amplitude_deviation,phase_deviation_deg,computed_stable\n",
        );
        for compared in &self.points {
            let Compared { point, frequency_deviation, amplitude_deviation, .. } = compared;
            let amplitude = point.amplitude(self.at).map_or(String::new(), |amplitude| format!("{amplitude:e}"));
            let phase = or_empty(compared.phase_deviation_deg);
            let stable = or_empty(compared.computed_stable);
            text += &format!(
                "{},{amplitude},{},{},{frequency_deviation},{amplitude_deviation},{phase},{stable}\n",
                point.frequency_hz,
                point.settled,
                point.is_clipped(self.at),
            );
        }
        text
    }
}
