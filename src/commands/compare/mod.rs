//! `resonarm compare`: measured points against the computed branch.

mod recording;

use std::path::PathBuf;

use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use crate::structures;
use crate::walk_point;
use resonarm::analysis::{Distances, MeasuredMotion, Nearest, nearest};
use resonarm::arm::{Load, Parameters, Pose};
use resonarm::scenario::{Scenario, StructureSection};
use resonarm_scenario::text_file;

/// Compare measured points with the computed branch: the document of `experiment walk`, any other with the same keys,
/// or a recording
#[derive(Debug, Args)]
#[command(
    after_help = "FILE is a recording, *.mcap, whose responses are read again from its frames, or JSON with `configuration` (preset, parameters, beta1_deg, beta2_deg, torque_nm, force_n) and `points` \
                        (frequency_hz, harmonic1_rad, amplitude_rad, settled). The nearest place of the branch is that by frequency and the \
                        fundamental of one joint, a deviation of 2e-5 in the first counting as 1e-3 in the second.\n\n\
                        Examples:\n  \
                        resonarm experiment walk --torque1-nm 20 --plot walk\n  \
                        resonarm compare walk.json --plot compared\n  \
                        resonarm experiment walk --torque1-nm 20 --record walk.mcap\n  \
                        resonarm compare walk.mcap"
)]
pub(crate) struct Compare {
    /// The document with the points, - for standard input; or a recording, an MCAP file.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The joint whose amplitude says which place of the branch is nearest, 1 or 2.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    joint: u8,
    /// Draw the points over the branch to STEM.svg and STEM.png, and write the deviations to STEM.csv and STEM.json.
    #[arg(long, value_name = "STEM")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

/// Largest turn between two motions of the computed branch: with this it is straight between them to a tenth of the
/// relevant deviation.
const STRAIGHT_RAD: f64 = 0.01;

/// Largest relative difference between the loads of points on a single branch.
const SAME_LOAD: f64 = 0.02;

/// The keys that are read from a bench's document.
#[derive(Deserialize)]
struct Bench {
    configuration: Configuration,
    points: Vec<BenchPoint>,
}

#[derive(Deserialize)]
struct Configuration {
    #[serde(default)]
    name: Option<String>,
    preset: String,
    parameters: Parameters,
    beta1_deg: f64,
    beta2_deg: f64,
    torque_nm: [f64; 2],
    force_n: [f64; 2],
}

#[derive(Deserialize)]
struct BenchPoint {
    frequency_hz: f64,
    harmonic1_rad: [f64; 2],
    amplitude_rad: [f64; 2],
    excitation: Option<f64>,
    settled: bool,
    /// Whether the angles come from clipped readings; documents of other programs may not say.
    #[serde(default)]
    clipped: [bool; 2],
}

/// A point and the place of the branch that is nearest to it.
#[derive(Serialize)]
struct Compared {
    frequency_hz: f64,
    harmonic1_rad: [f64; 2],
    settled: bool,
    clipped: [bool; 2],
    computed_frequency_hz: f64,
    computed_harmonic1_rad: [f64; 2],
    computed_stable: bool,
    /// Measured over computed, less 1.
    frequency_deviation: f64,
    amplitude_deviation: [f64; 2],
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    points: Vec<Compared>,
    /// The largest deviations of settled points, of angles that do not come from clipped readings.
    largest_frequency_deviation: f64,
    largest_amplitude_deviation: [f64; 2],
}

impl Compare {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.overwrite.check_stem(self.plot.as_deref(), output::PLOTTED, &Inputs::of([&self.file]))?;
        let mut whole = Verdict::Positive;
        let bench = if self.is_recording() {
            let (scenario, responses, is_whole) = recording::responses(&self.file)?;
            whole = is_whole;
            if let Some(tested) = scenario.tested_structure()? {
                let plot = self.plot.as_deref();
                let shown = structures::compare::show(&self.file, (&scenario, &tested), &responses, plot, self.json)?;
                return Ok(shown.and(whole));
            }
            recording::bench(&scenario, &responses)?
        } else {
            self.read()?
        };
        let (scenario, load) = self.bench_of(&bench)?;
        let measured: Vec<walk_point::Drawn> = bench.points.iter().map(BenchPoint::drawn).collect();
        let branch = walk_point::branch(&scenario, &load, &measured, STRAIGHT_RAD)?;
        let joint = usize::from(self.joint - 1);
        let place = |point: &BenchPoint| {
            let motion = MeasuredMotion { frequency_hz: point.frequency_hz, harmonic1_rad: point.harmonic1_rad };
            nearest(&branch, &motion, joint, Distances::default()).map(|place| Compared::new(point, &place))
        };
        let points: Vec<Compared> = bench.points.iter().filter_map(place).collect();
        let largest = |is_read: &dyn Fn(&Compared) -> bool, of: &dyn Fn(&Compared) -> f64| {
            let judged = points.iter().filter(|point| point.settled && is_read(point));
            judged.fold(0.0_f64, |largest, point| largest.max(of(point).abs()))
        };
        let document = Document {
            configuration: configuration::of(&scenario, &load)?,
            largest_frequency_deviation: largest(&|point| !point.clipped[joint], &|point| point.frequency_deviation),
            largest_amplitude_deviation: [0, 1]
                .map(|joint| largest(&|point| !point.clipped[joint], &|point| point.amplitude_deviation[joint])),
            points,
        };
        let figure = || walk_point::drawn("Measured on computed", &scenario, &load, &branch, &measured);
        let files = output::plot(self.plot.as_deref(), &document, || (figure(), csv(&document.points)))?;
        self.json.show(&document, || text(&document), &files)?;
        Ok(whole)
    }

    fn is_recording(&self) -> bool {
        self.file.extension().is_some_and(|extension| extension == "mcap")
    }

    fn read(&self) -> Result<Bench, Failure> {
        let name = self.file.display();
        let read = if self.file.as_os_str() == "-" {
            text_file::read_numbers("/dev/stdin".as_ref())
        } else {
            text_file::read_numbers(&self.file)
        };
        let text = read.map_err(|source| Failure::usage(format!("{name} can't be read: {source}")))?;
        serde_json::from_str(&text)
            .map_err(|source| Failure::usage(format!("{name} is no document of `experiment walk --json`: {source}")))
    }

    /// Arm, pose and load of the points, if they are on one branch.
    fn bench_of(&self, bench: &Bench) -> Result<(Scenario, Load), Failure> {
        let Configuration { name: arm_name, preset, parameters, beta1_deg, beta2_deg, torque_nm, force_n } =
            &bench.configuration;
        let name = self.file.display();
        let usage = |problem: String| Failure::usage(format!("{name}: {problem}"));
        if bench.points.is_empty() {
            return Err(usage(String::from("it has no points")));
        }
        let numbers = |point: &BenchPoint| {
            let [h1, h2] = point.harmonic1_rad;
            point.frequency_hz > 0.0
                && [point.frequency_hz, h1, h2].iter().all(|value| value.is_finite())
                && h1 != 0.0
                && h2 != 0.0
        };
        if let Some(at) = bench.points.iter().position(|point| !numbers(point)) {
            return Err(usage(format!("point {at} has no positive frequency and amplitudes other than zero")));
        }
        let loads: Vec<f64> = bench.points.iter().filter_map(|point| point.excitation).collect();
        let (least, most) =
            loads.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), load| (low.min(*load), high.max(*load)));
        if most > least * (1.0 + SAME_LOAD) {
            return Err(usage(format!(
                "its points are of loads from {least:.4} to {most:.4}: they are not on a single branch; a backbone is drawn by `resonarm backbone`"
            )));
        }
        let pose = Pose { beta1_deg: *beta1_deg, beta2_deg: *beta2_deg };
        let of_arm = StructureSection::of_arm(preset, parameters, pose).map_err(|source| usage(source.to_string()))?;
        let structure = StructureSection { name: arm_name.clone(), ..of_arm };
        let load = Load { torque_nm: (*torque_nm).into(), force_n: (*force_n).into() };
        if load == Load::default() {
            return Err(usage(String::from("the load in its configuration is zero")));
        }
        Ok((Scenario { structure, ..Scenario::default() }, load))
    }
}

impl BenchPoint {
    fn drawn(&self) -> walk_point::Drawn {
        let BenchPoint { frequency_hz, amplitude_rad, settled, clipped, .. } = *self;
        walk_point::Drawn { frequency_hz, amplitude_rad, settled, clipped }
    }
}

impl Compared {
    fn new(point: &BenchPoint, place: &Nearest) -> Compared {
        Compared {
            frequency_hz: point.frequency_hz,
            harmonic1_rad: point.harmonic1_rad,
            settled: point.settled,
            clipped: point.clipped,
            computed_frequency_hz: place.motion.frequency_hz,
            computed_harmonic1_rad: place.motion.harmonic1_rad,
            computed_stable: place.is_stable,
            frequency_deviation: place.frequency_deviation,
            amplitude_deviation: place.amplitude_deviation,
        }
    }
}

fn text(document: &Document) -> String {
    let mut text = format!(
        "  {:>12}  {:>11}  {:>11}  {:>12}  {:>9}  {:>9}  computed\n",
        "frequency", "α1", "α2", "Δf/f", "Δα1/α1", "Δα2/α2"
    );
    for point in &document.points {
        let ([h1, h2], [d1, d2]) = (point.harmonic1_rad, point.amplitude_deviation);
        let stability = if point.computed_stable { "stable" } else { "unstable" };
        let remark = match (point.settled, point.clipped) {
            (false, _) => ", point not settled",
            (true, [false, false]) => "",
            (true, [false, true]) => ", α2 from clipped readings",
            (true, [true, _]) => ", from clipped readings",
        };
        text += &format!(
            "  {:9.5} Hz  {h1:7.5} rad  {h2:7.5} rad  {:+12.2e}  {:+8.3} %  {:+8.3} %  {stability}{remark}\n",
            point.frequency_hz,
            point.frequency_deviation,
            100.0 * d1,
            100.0 * d2,
        );
    }
    let [a1, a2] = document.largest_amplitude_deviation;
    text += &format!(
        "largest of settled points without clipped readings: {:.1e} in frequency, {:.3} % in α1, {:.3} % in α2\n",
        document.largest_frequency_deviation,
        100.0 * a1,
        100.0 * a2
    );
    text
}

fn csv(points: &[Compared]) -> String {
    let mut text = String::from(
        "frequency_hz,harmonic1_alpha1_rad,harmonic1_alpha2_rad,settled,computed_frequency_hz,computed_harmonic1_alpha1_rad,\
         computed_harmonic1_alpha2_rad,computed_stable,frequency_deviation,amplitude_deviation_alpha1,amplitude_deviation_alpha2,\
         clipped_alpha1,clipped_alpha2\n",
    );
    for point in points {
        let ([h1, h2], [c1, c2]) = (point.harmonic1_rad, point.computed_harmonic1_rad);
        let ([d1, d2], [clipped1, clipped2]) = (point.amplitude_deviation, point.clipped);
        let Compared { frequency_hz, settled, computed_frequency_hz, computed_stable, frequency_deviation, .. } = point;
        text += &format!(
            "{frequency_hz},{h1},{h2},{settled},{computed_frequency_hz},{c1},{c2},{computed_stable},{frequency_deviation},{d1},{d2},{clipped1},{clipped2}\n"
        );
    }
    text
}
