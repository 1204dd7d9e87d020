//! `resonarm backbone`: how the frequency of a resonance changes with its amplitude.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::continuation_flags::ContinuationFlags;
use crate::drive::{AmplitudeWords, DriveFlags};
use crate::ended_early::Early;
use crate::failure::{Failure, Verdict};
use crate::figures::branch_plot;
use crate::figures::branch_table::csv;
use crate::figures::captions;
use crate::flags::ArmFlags;
use crate::output::{self, JsonFlag, OverwriteFlag};
use crate::progress::timed;
use crate::readings::{self, Reader, ReadingsDocument, ReadingsFlag};
use crate::structures::{self, StructureDriveFlags};
use resonarm::analysis::{
    ArmParameter, Backbone as Curve, BackboneOptions, BackbonePoint, Bending, Branch, BranchOptions, Coordinate,
    ForcedArm, Readings, backbone, modes, trace,
};
use resonarm::arm::Load;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm_figures::plot::{Color, Dash, Figure, Series, Style, beside};

const EXAMPLES: &str = "\
Examples:
  resonarm backbone
  resonarm backbone --torque1-nm 60 --plot backbone
  resonarm backbone --mode 2 --undamped --beta2-deg 120
  resonarm backbone --force-x-n 60 --beta1-deg 30 --beta2-deg 120 --json
  resonarm backbone --scenario hardening.toml --drive tip.x --amplitude 4 \\
      --plot hardening

A curve that ends early is printed as far as it came; standard error says why, and the exit code is 1.";

/// How a motion without a load is read.
const UNUSUAL: &str = " With --undamped there is no load, and sin Ωt is in quadrature with the mode.";

/// Follows a resonance of the arm, or of a scenario's structure, to larger amplitudes: its frequency, the excitation it
/// needs, whether it hardens or softens.
///
/// With dampers each point is a motion in phase quadrature, 90° behind the excitation, which is at the peak of the
/// forced response. Without dampers it is a free motion, and the curve a nonlinear normal mode.
#[derive(Debug, Args)]
#[command(after_long_help = readings::help_after(EXAMPLES, UNUSUAL))]
pub(crate) struct Backbone {
    #[command(flatten)]
    pub(crate) arm: ArmFlags,
    /// Linear mode in which the curve begins, from 1, by frequency; the arm has two.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    mode: u8,
    /// The nonlinear normal mode without dampers, which takes no excitation.
    #[arg(long)]
    undamped: bool,
    #[command(flatten)]
    drive: DriveFlags,
    #[command(flatten)]
    structure: StructureDriveFlags,
    /// Of a structure: where the motion is read, separated by commas [default: where it is driven].
    #[arg(long, value_name = "DOF", value_delimiter = ',', requires = "drive")]
    at: Vec<String>,
    /// Of a structure: the curve ends where the first of --at reaches this, m, or rad at a joint, or where the
    /// excitation reaches --amplitude.
    #[arg(long, value_name = "X")]
    to: Option<f64>,
    /// The curve ends where |α1| or |α2| reaches this, rad, or where the excitation reaches the amplitude given
    /// [default: 0.3].
    #[arg(long, value_name = "RAD")]
    to_rad: Option<f64>,
    #[command(flatten)]
    walk: ContinuationFlags,
    #[command(flatten)]
    readings: ReadingsFlag,
    /// Plot to STEM.svg and STEM.png, over the forced response if an amplitude of the excitation is given; caption, CSV
    /// and JSON beside them, of the forced response STEM-response.csv.
    #[arg(long, value_name = "STEM")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

/// Where the curve ends without another limit, rad.
const TO_RAD: f64 = 0.3;
/// Largest step of a drawn curve, as a fraction of the motion's size.
const SMOOTH_STEP: f64 = 0.05;

/// The excitation: its direction, and its amplitude if one is given.
struct Drive {
    direction: Load,
    amplitude: Option<f64>,
    words: AmplitudeWords,
}

#[derive(Serialize)]
struct Document {
    /// What the results depend on; without an amplitude of the excitation the load is that of the value 1.
    configuration: Value,
    mode: u8,
    kind: &'static str,
    linear_frequency_hz: f64,
    bending: Option<&'static str>,
    frequency_shift_hz: f64,
    curvature_hz_rad2: [Option<f64>; 2],
    points: Vec<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ended_early: Option<Value>,
    wall_s: f64,
}

impl Backbone {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.overwrite.check_stem(self.plot.as_deref(), &[output::PLOTTED, &["-response.csv"]].concat())?;
        let scenario = self.arm.scenario()?;
        if let Some(tested) = scenario.tested_structure()? {
            return self.of_structure(&scenario, &tested);
        }
        self.refuse_structure_flags()?;
        let arm = scenario.build_arm()?;
        let drive = self.drive()?;
        let linear_hz = modes(&arm)[usize::from(self.mode - 1)].frequency_hz;
        let options = self.options(&drive, linear_hz)?;
        let damped = ForcedArm::new(arm, drive.direction, 0.0);
        let mut early = Early::default();
        let (curve, wall_s) = timed(|| self.curve(&damped, &options, &mut early));
        let curve = curve?;
        let mut files = Vec::new();
        if let Some(stem) = &self.plot {
            let mut options = options;
            smooth(&mut options.branch);
            let curve = self.curve(&damped, &options, &mut early)?;
            files = self.plot(stem, &scenario, (&damped, &drive), &curve, &mut early)?;
        }
        let configuration = self.configuration(&scenario, &drive)?;
        let readings = self.read(&damped, &curve);
        let document = self.document(configuration, linear_hz, &drive, (&curve, &readings), wall_s);
        let document = Document { ended_early: early.document(), ..document };
        if let Some(stem) = &self.plot {
            files.push(output::write(beside(stem, ".csv"), &self.csv(&drive, &curve, &readings))?);
            files.push(output::write_json(beside(stem, ".json"), &document)?);
        }
        let text = || {
            // With --plot the points are in the files.
            let table = if self.plot.is_none() { self.table(&drive, &curve) } else { String::new() };
            let head = self.head(&scenario, &document, &drive);
            format!("{head}\n\n{table}{}\n", reading(&document, &curve))
        };
        self.json.show(&document, text, &files)?;
        early.verdict()
    }

    /// A structure in place of the arm.
    fn of_structure(&self, scenario: &Scenario, tested: &TestedAssembly) -> Result<Verdict, Failure> {
        if self.drive.is_given() {
            return Err(structures::arm_drive(&tested.assembly));
        }
        if self.to_rad.is_some() || self.readings.readings {
            return Err(Failure::usage("--to-rad and --readings are for the two-link arm: take --to and --at"));
        }
        let asked = structures::backbone::Asked {
            drive: self.structure.dof(&tested.assembly)?,
            amplitude: self.structure.amplitude(),
            to: self.to,
            mode: self.mode,
            undamped: self.undamped,
            at: &self.at,
            settings: &|options| self.walk.options(options),
            plot: self.plot.as_deref(),
            json: self.json,
        };
        structures::backbone::show(scenario, tested, &asked)
    }

    /// Refuses what is for structures only.
    fn refuse_structure_flags(&self) -> Result<(), Failure> {
        self.structure.refuse()?;
        if let Some(to) = self.to {
            return Err(Failure::value(
                "--to",
                to,
                "it is for a scenario with a [structure]; of the arm give --to-rad",
            ));
        }
        match self.mode {
            1 | 2 => Ok(()),
            mode => Err(Failure::value("--mode", f64::from(mode), "the arm has modes 1 and 2")),
        }
    }

    fn to_rad(&self) -> f64 {
        self.to_rad.unwrap_or(TO_RAD)
    }

    /// The excitation; a torque at joint 1 if none is named.
    fn drive(&self) -> Result<Drive, Failure> {
        let (words, given) = (self.drive.words(), self.drive.is_given());
        let (direction, amplitude) = if given { self.drive.direction()? } else { (Load::torque_nm(1.0, 0.0), 1.0) };
        Ok(Drive { direction, amplitude: given.then_some(amplitude), words })
    }

    fn options(&self, drive: &Drive, linear_hz: f64) -> Result<BackboneOptions, Failure> {
        let most_rad = BackboneOptions::LARGEST_RAD;
        let to_rad = self.to_rad();
        if !(to_rad > 0.0 && to_rad <= most_rad) {
            let why = format!("it must be above 0 and at most {most_rad:.4} rad");
            return Err(Failure::value("--to-rad", to_rad, why));
        }
        let mut options = BackboneOptions::new(linear_hz, to_rad);
        options.largest_drive = drive.amplitude.unwrap_or(options.largest_drive);
        options.branch = self.walk.options(options.branch)?;
        Ok(options)
    }

    fn curve(&self, damped: &ForcedArm, options: &BackboneOptions, early: &mut Early) -> Result<Curve, Failure> {
        let forced = if self.undamped { damped.undamped()? } else { damped.clone() };
        early.keep("the backbone", backbone(forced, usize::from(self.mode - 1), ArmParameter::Amplitude, options))
    }

    fn kind(&self) -> &'static str {
        if self.undamped { "nonlinear-normal-mode" } else { "phase-quadrature" }
    }

    /// What the results depend on.
    fn configuration(&self, scenario: &Scenario, drive: &Drive) -> Result<Value, Failure> {
        let load = if drive.amplitude.is_some() { self.drive.load()? } else { drive.direction };
        let mut configuration = configuration::of(scenario, &load)?;
        configuration["backbone"] = json!({ "undamped": self.undamped, "to_rad": self.to_rad() });
        Ok(configuration)
    }

    /// The readings of each point, if they are wanted.
    fn read(&self, damped: &ForcedArm, curve: &Curve) -> Vec<ReadingsDocument> {
        let read = |point| ReadingsDocument(Readings::of_backbone(damped.arm(), point));
        curve.points.iter().filter(|_| self.readings.readings).map(read).collect()
    }

    /// A line for each point, with the units in the names of the columns.
    fn csv(&self, drive: &Drive, curve: &Curve, readings: &[ReadingsDocument]) -> String {
        let columns = readings::columns(self.readings.readings);
        let head = if self.undamped { String::new() } else { format!(",{}", drive.words.name) };
        let mut text = format!(
            "frequency_hz,amplitude1_rad,amplitude2_rad,harmonic1_alpha1_rad,harmonic1_alpha2_rad{head}{columns}\n"
        );
        for (index, point) in curve.points.iter().enumerate() {
            let ([a1, a2], [h1, h2]) = (point.amplitude_rad, point.harmonic1_rad);
            let amount = if self.undamped { String::new() } else { format!(",{}", point.drive.abs()) };
            let read = readings.get(index).map_or_else(String::new, ReadingsDocument::cells);
            text += &format!("{},{a1},{a2},{h1},{h2}{amount}{read}\n", point.frequency_hz);
        }
        text
    }

    fn document(
        &self,
        configuration: Value,
        linear_frequency_hz: f64,
        drive: &Drive,
        (curve, readings): (&Curve, &[ReadingsDocument]),
        wall_s: f64,
    ) -> Document {
        let point = |(index, point): (usize, &BackbonePoint)| {
            let BackbonePoint { frequency_hz, amplitude_rad, harmonic1_rad, .. } = point;
            let mut document = json!({
                "frequency_hz": frequency_hz, "amplitude_rad": amplitude_rad, "harmonic1_rad": harmonic1_rad,
            });
            if !self.undamped {
                document[drive.words.name] = json!(point.drive.abs());
            }
            if let Some(read) = readings.get(index) {
                document["readings"] = read.value();
            }
            document
        };
        Document {
            configuration,
            mode: self.mode,
            kind: self.kind(),
            linear_frequency_hz,
            bending: curve.bending().map(Bending::name),
            frequency_shift_hz: curve.shift_hz(),
            curvature_hz_rad2: [0, 1].map(|joint| curve.curvature_hz_rad2(joint)),
            points: curve.points.iter().enumerate().map(point).collect(),
            ended_early: None,
            wall_s,
        }
    }

    fn head(&self, scenario: &Scenario, document: &Document, drive: &Drive) -> String {
        let what = if self.undamped {
            String::from("nonlinear normal mode of the arm without dampers")
        } else {
            format!("in phase quadrature with a {}", drive.words.what)
        };
        let arm = &scenario.arm;
        format!(
            "{}, β1 = {}, β2 = {}, mode {} from {:.6} Hz: {what}",
            arm.label(),
            captions::degrees(arm.beta1_deg),
            captions::degrees(arm.beta2_deg),
            self.mode,
            document.linear_frequency_hz
        )
    }

    fn table(&self, drive: &Drive, curve: &Curve) -> String {
        let drive_head = if self.undamped { String::new() } else { format!("   {:>12}", drive.words.unit) };
        let mut text = format!("  frequency Hz   largest |α1| rad   largest |α2| rad{drive_head}\n");
        for point in &curve.points {
            let [a1, a2] = point.amplitude_rad;
            let amount = if self.undamped { String::new() } else { format!("   {:12.4}", point.drive.abs()) };
            text += &format!("  {:12.6}   {a1:16.8}   {a2:16.8}{amount}\n", point.frequency_hz);
        }
        text.push('\n');
        text
    }

    /// Two panels, |α1| and |α2|: the curve over the forced response. Returns the files written, including that of the
    /// response's points.
    fn plot(
        &self,
        stem: &Path,
        scenario: &Scenario,
        forced: (&ForcedArm, &Drive),
        curve: &Curve,
        early: &mut Early,
    ) -> Result<Vec<PathBuf>, Failure> {
        let (arm, drive) = forced;
        let response = match drive.amplitude {
            Some(amplitude) => {
                self.response(&ForcedArm::new(arm.arm().clone(), drive.direction, amplitude), curve, early)?
            }
            None => None,
        };
        let branches: Vec<&Branch> = response.iter().collect();
        let mut files = Vec::new();
        if response.is_some() {
            let (forced, coordinate) = (arm.clone(), Coordinate::FrequencyHz);
            let reader = self.readings.readings.then_some(Reader { forced, coordinate });
            let table = csv("frequency_hz", &branches, reader.as_ref());
            files.push(output::write(beside(stem, "-response.csv"), &table)?);
        }
        let name = if self.undamped { "nonlinear normal mode" } else { "phase quadrature" };
        let response_to =
            |amplitude: f64| format!("response to a {} of {amplitude} {}", drive.words.what, drive.words.unit);
        let with = drive.amplitude.map_or(String::new(), response_to);
        let figure =
            Figure::new(format!("Backbone of mode {}", self.mode)).subtitle(captions::pose(&scenario.arm).and(with));
        let figure = branch_plot::of_joints(figure, "frequency (Hz)", |panel, joint| {
            let points = curve.points.iter().map(|point| (point.frequency_hz, point.amplitude_rad[joint])).collect();
            let style = Style::Line { color: Color::Black, width: 1.2, dash: Dash::Chain };
            let panel = branch_plot::with_branches(panel, &branches, joint);
            panel.with(Series::line(name, Color::Black, points).style(style))
        });
        Ok([output::draw(figure, stem)?, files].concat())
    }

    fn response(&self, forced: &ForcedArm, curve: &Curve, early: &mut Early) -> Result<Option<Branch>, Failure> {
        let [low, high] = curve.window_hz();
        let mut options = self.walk.options(BranchOptions::new(low, high))?;
        smooth(&mut options);
        let walked = trace(forced.clone(), options.from, Coordinate::FrequencyHz, &options);
        early.keep_any("frequency_hz of the forced response", walked)
    }
}

fn smooth(options: &mut BranchOptions) {
    options.continuation.largest_step = options.continuation.largest_step.min(SMOOTH_STEP);
}

/// Whether the curve hardens or softens, and by how much.
fn reading(document: &Document, curve: &Curve) -> String {
    let Some(last) = curve.points.last() else { return String::from("no points") };
    let joint = usize::from(last.harmonic1_rad[1] > last.harmonic1_rad[0]);
    let (shift_hz, part) = (document.frequency_shift_hz, document.frequency_shift_hz / document.linear_frequency_hz);
    let mut text = format!(
        "{}: {shift_hz:+.6} Hz ({:+.4} %) at |α{}| = {:.6} rad",
        document.bending.unwrap_or("straight"),
        100.0 * part,
        joint + 1,
        last.amplitude_rad[joint]
    );
    if let Some(curvature) = document.curvature_hz_rad2[joint] {
        text += &format!("; at small amplitudes a of α{}, df/d(a²) = {curvature:+.5} Hz/rad²", joint + 1);
    }
    text
}
