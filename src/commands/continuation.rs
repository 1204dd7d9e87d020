//! `resonarm continue`: branches of periodic motions, their stability and bifurcations.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::continuation_flags::ContinuationFlags;
use crate::drive::DriveFlags;
use crate::ended_early::Early;
use crate::failure::{Failure, Verdict};
use crate::figures::branch_plot;
use crate::figures::branch_table::csv;
use crate::figures::captions;
use crate::figures::singular_curves::{CurveFlags, Curves};
use crate::flags::ArmFlags;
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use crate::progress::timed;
use crate::quantity::{self, Ends, Quantity};
use crate::readings::{self, Reader, ReadingsFlag};
use crate::structures::{self, StructureDriveFlags};
use resonarm::analysis::{
    ArmParameter, Bifurcation, Branch, BranchOptions, Coordinate, ForcedArm, Orbit, structure, trace, trace_doublings,
};
use resonarm::arm::Load;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm_figures::plot::{Subtitle, beside};
use resonarm_numeric::number::short;

const EXAMPLES: &str = "\
Examples:
  resonarm continue --torque1-nm 60 --from-hz 21 --to-hz 23 --plot branch
  resonarm continue --force-x-n 20 --beta1-deg 30 --beta2-deg 120 --from-hz 60 \\
      --to-hz 20
  resonarm continue --parameter amplitude --frequency-hz 22.1 --from-nm 0 \\
      --to-nm 300
  resonarm continue --parameter mass2_kg --torque1-nm 60 --frequency-hz 22 \\
      --from 40 --to 60
  resonarm continue --torque1-nm 60 --from-hz 21 --to-hz 23 \\
      --curves-in amplitude --curves-to 5
  resonarm continue --torque1-nm 800 --beta2-deg 75 --from-hz 40 --to-hz 50 \\
      --doubled
  resonarm continue --scenario hardening.toml --drive tip.x --amplitude 4 \\
      --from-hz 21 --to-hz 24 --curves-in amplitude --curves-to 1

A walk that ends early prints what it found, says why on standard error, and ends with exit code 1.";

/// Follows periodic motions of the forced arm, or of a scenario's structure, in a parameter, with stability and
/// bifurcations, around folds.
#[derive(Debug, Args)]
#[command(after_long_help = readings::help_after(EXAMPLES, ""))]
pub(crate) struct Continue {
    #[command(flatten)]
    pub(crate) arm: ArmFlags,
    #[command(flatten)]
    drive: DriveFlags,
    #[command(flatten)]
    structure: StructureDriveFlags,
    /// Of a structure: where the motion is read, separated by commas [default: where it is driven].
    #[arg(long, value_name = "DOF", value_delimiter = ',', requires = "drive")]
    at: Vec<String>,
    /// Of a structure: leave out the stability, and with it all bifurcations but folds. Faster, with many modes most.
    #[arg(long, requires = "drive")]
    no_stability: bool,
    /// What varies: frequency, amplitude, beta1_deg, beta2_deg, or a parameter of the arm as a scenario calls it; of a
    /// structure a parameter is link2.angle_deg, mode3.damping_ratio, element1.gap_m, gravity_m_s2.
    #[arg(long, value_name = "NAME", default_value = "frequency")]
    parameter: String,
    #[command(flatten)]
    range: RangeFlags,
    /// Excitation frequency if it does not vary, Hz.
    #[arg(long, value_name = "F")]
    frequency_hz: Option<f64>,
    #[command(flatten)]
    walk: ContinuationFlags,
    /// Also follow the doubled branches that leave at period doublings.
    #[arg(long)]
    doubled: bool,
    #[command(flatten)]
    curves: CurveFlags,
    #[command(flatten)]
    readings: ReadingsFlag,
    /// Plot to STEM.svg and STEM.png, the curves to STEM-curves.svg and STEM-curves.png; captions,
    /// CSV and JSON beside them.
    #[arg(long, value_name = "STEM")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

/// The interval of what varies, in its unit.
#[derive(Clone, Debug, Args)]
struct RangeFlags {
    /// First frequency, Hz.
    #[arg(long, value_name = "F")]
    from_hz: Option<f64>,
    /// Last frequency, Hz; below the first for a walk down.
    #[arg(long, value_name = "F")]
    to_hz: Option<f64>,
    /// First torque amplitude, N·m.
    #[arg(long, value_name = "A")]
    from_nm: Option<f64>,
    /// Last torque amplitude, N·m.
    #[arg(long, value_name = "A")]
    to_nm: Option<f64>,
    /// First force amplitude, N.
    #[arg(long, value_name = "A")]
    from_n: Option<f64>,
    /// Last force amplitude, N.
    #[arg(long, value_name = "A")]
    to_n: Option<f64>,
    /// First angle, degrees.
    #[arg(long, value_name = "DEG")]
    from_deg: Option<f64>,
    /// Last angle, degrees.
    #[arg(long, value_name = "DEG")]
    to_deg: Option<f64>,
    /// First value of a parameter of the arm, in its SI unit, or of a structure, in the unit of its name.
    #[arg(long, value_name = "X")]
    from: Option<f64>,
    /// Last value of a parameter.
    #[arg(long, value_name = "X")]
    to: Option<f64>,
}

/// What varies, with its name in results.
struct Varied {
    quantity: Quantity,
    from: f64,
    to: f64,
}

impl Varied {
    fn is_amplitude(&self) -> bool {
        self.quantity.coordinate == Coordinate::Parameter(ArmParameter::Amplitude)
    }
}

struct Found {
    branch: Branch,
    doubled: Vec<Branch>,
    curves: Option<Curves>,
    /// Reads the motions, if readings are wanted.
    reader: Option<Reader>,
    early: Early,
}

impl Found {
    /// Writes the figures and their data, and returns the files.
    fn plot(
        &self,
        stem: &Path,
        varied: &Varied,
        conditions: Subtitle,
        on_curves: Subtitle,
    ) -> Result<Vec<PathBuf>, Failure> {
        let branches: Vec<&Branch> = core::iter::once(&self.branch).chain(&self.doubled).collect();
        let figure = branch_plot::figure(conditions, &varied.quantity.label, &branches);
        let mut files = output::draw(figure, stem)?;
        files.push(output::write(beside(stem, ".csv"), &csv(varied.quantity.name, &branches, self.reader.as_ref()))?);
        if let Some(curves) = &self.curves {
            let stem = beside(stem, "-curves");
            files.extend(output::draw(curves.figure(on_curves), &stem)?);
            files.push(output::write(beside(&stem, ".csv"), &curves.csv())?);
        }
        Ok(files)
    }

    fn document(&self, configuration: Value, varied: &Varied, wall_s: f64) -> Document {
        let reader = self.reader.as_ref();
        let document = |branch: &Branch| BranchDocument {
            points: branch.orbits.iter().map(|orbit| point(varied, orbit, reader)).collect(),
            bifurcations: branch.bifurcations.iter().map(|event| bifurcation(varied, event, reader)).collect(),
        };
        Document {
            configuration,
            branch: document(&self.branch),
            doubled: self.doubled.iter().map(document).collect(),
            curves: self.curves.as_ref().map(Curves::document),
            ended_early: self.early.document(),
            wall_s,
        }
    }

    fn text(&self, varied: &Varied, wall_s: f64) -> String {
        let mut text = String::new();
        for (k, branch) in core::iter::once(&self.branch).chain(&self.doubled).enumerate() {
            let unstable = branch.orbits.iter().filter(|orbit| !orbit.is_stable()).count();
            let which = if k == 0 { String::from("branch") } else { format!("doubled branch {k}") };
            let largest = branch.orbits.iter().fold([0.0_f64; 2], |largest, orbit| {
                [largest[0].max(orbit.amplitude_rad[0]), largest[1].max(orbit.amplitude_rad[1])]
            });
            text += &format!(
                "{which}: {} motions, {unstable} of them unstable; largest |α1| {:.6} rad, |α2| {:.6} rad\n",
                branch.orbits.len(),
                largest[0],
                largest[1]
            );
            for event in &branch.bifurcations {
                let [h1, h2] = event.orbit.harmonic1_rad;
                text += &format!(
                    "  {:16} {} = {:.9}   first harmonic α1 {h1:.9} rad, α2 {h2:.9} rad\n",
                    event.kind.name(),
                    varied.quantity.name,
                    event.orbit.value
                );
            }
        }
        text.push_str(&self.curves.as_ref().map_or_else(String::new, Curves::text));
        text += &format!("in {:.3} s\n", wall_s);
        text
    }
}

#[derive(Serialize)]
struct Document {
    /// What the results depend on; the load is that of the value 1 where the amplitude varies.
    configuration: Value,
    #[serde(flatten)]
    branch: BranchDocument,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    doubled: Vec<BranchDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    curves: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ended_early: Option<Value>,
    wall_s: f64,
}

#[derive(Serialize)]
struct BranchDocument {
    points: Vec<Value>,
    bifurcations: Vec<Value>,
}

impl RangeFlags {
    fn ends(&self) -> [Ends; 5] {
        [
            Ends { unit: "-hz", from: self.from_hz, to: self.to_hz },
            Ends { unit: "-nm", from: self.from_nm, to: self.to_nm },
            Ends { unit: "-n", from: self.from_n, to: self.to_n },
            Ends { unit: "-deg", from: self.from_deg, to: self.to_deg },
            Ends { unit: "", from: self.from, to: self.to },
        ]
    }
}

impl Continue {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let endings = [output::PLOTTED, &["-curves.svg", "-curves.png", "-curves.txt", "-curves.csv"]].concat();
        let inputs = Inputs::of_scenario(self.arm.scenario.as_deref());
        self.overwrite.check_stem(self.plot.as_deref(), &endings, &inputs)?;
        let scenario = self.arm.scenario()?;
        if let Some(tested) = scenario.tested_structure()? {
            return self.of_structure(&scenario, &tested);
        }
        self.structure.refuse()?;
        let arm = scenario.build_arm()?;
        let varied = self.varied()?;
        let second = self.curves.second(&varied.quantity, &self.drive)?;
        let (direction, amplitude, load) = self.excitation(&varied)?;
        let forced = (ForcedArm::new(arm, direction, amplitude), self.frequency_hz(&varied)?);
        let mut configuration = configuration::of(&scenario, &load)?;
        configuration["continue"] = json!({
            "parameter": varied.quantity.name,
            "from": varied.from,
            "to": varied.to,
            "frequency_hz": self.frequency_hz,
        });
        let conditions = self.conditions(&scenario, &load, &[&varied.quantity]);
        let on_curves =
            second.as_ref().map(|(second, _)| self.conditions(&scenario, &load, &[&varied.quantity, second]));
        let (found, wall_s) = timed(|| self.follow(forced, &varied, second));
        let found = found?;
        let document = found.document(configuration, &varied, wall_s);
        let mut files = Vec::new();
        if let Some(stem) = &self.plot {
            files = found.plot(stem, &varied, conditions, on_curves.unwrap_or_default())?;
            files.push(output::write_json(beside(stem, ".json"), &document)?);
        }
        self.json.show(&document, || found.text(&varied, wall_s), &files)?;
        found.early.verdict()
    }

    /// A structure in place of the arm.
    fn of_structure(&self, scenario: &Scenario, tested: &TestedAssembly) -> Result<Verdict, Failure> {
        if self.drive.is_given() {
            return Err(structures::arm_drive(&tested.assembly));
        }
        let drive = self.structure.dof(&tested.assembly)?;
        let ends = self.range.ends();
        let (coordinate, amplitude, frequency_hz, suffix) = match self.parameter.as_str() {
            "frequency" if self.frequency_hz.is_some() => {
                return Err(Failure::usage("--frequency-hz is for runs in another parameter: leave it out"));
            }
            "frequency" => (structure::Coordinate::FrequencyHz, self.structure.needed_amplitude()?, None, "-hz"),
            "amplitude" if self.structure.amplitude().is_some() => {
                return Err(Failure::usage("the amplitude is what varies: leave --amplitude out"));
            }
            "amplitude" => {
                let suffix = if drive.0.is_angle() { "-nm" } else { "-n" };
                (structure::Coordinate::Amplitude, 1.0, Some(self.positive_frequency_hz()?), suffix)
            }
            _ => {
                let coordinate =
                    structures::continuation::coordinate("--parameter", &self.parameter, &tested.assembly)?;
                (coordinate, self.structure.needed_amplitude()?, Some(self.positive_frequency_hz()?), "")
            }
        };
        if self.readings.readings {
            return Err(Failure::usage("--readings is for the two-link arm: leave it out"));
        }
        if self.no_stability && self.doubled {
            return Err(Failure::usage("--no-stability finds no period doublings: leave it out, or --doubled"));
        }
        let second = self.curves.given().map(|(name, to)| {
            let second = structures::continuation::coordinate("--curves-in", name, &tested.assembly)?;
            if second == coordinate {
                return Err(Failure::usage(format!(
                    "--curves-in {name} is what the branch is followed in already: name another parameter"
                )));
            }
            Ok((second, to))
        });
        let second = second.transpose()?;
        let (from, to) =
            quantity::interval(&format!("--parameter {}", self.parameter), Some(suffix), &ends)?.unwrap_or_default();
        let asked = structures::continuation::Asked {
            drive,
            amplitude,
            frequency_hz: frequency_hz.unwrap_or(from),
            coordinate,
            ends: [from, to],
            at: &self.at,
            doubled: self.doubled,
            curves: second,
            assess: if self.no_stability { structure::Assess::Nothing } else { structure::Assess::Multipliers },
            settings: &|options| self.walk.options(options),
            plot: self.plot.as_deref(),
            json: self.json,
        };
        structures::continuation::show(scenario, tested, &asked)
    }

    /// A figure's subtitle: the arm, its pose and the excitation, without the quantities that vary.
    fn conditions(&self, scenario: &Scenario, load: &Load, varied: &[&Quantity]) -> Subtitle {
        let names: Vec<&str> = varied.iter().map(|quantity| quantity.name).collect();
        let amplitude = Coordinate::Parameter(ArmParameter::Amplitude);
        let has = |coordinate| varied.iter().any(|quantity| quantity.coordinate == coordinate);
        let load = if has(amplitude) { captions::direction(load) } else { captions::load(load) };
        let hz = self.frequency_hz.filter(|_| !has(Coordinate::FrequencyHz));
        let hz = hz.map_or(String::new(), |hz| format!("{hz} Hz"));
        captions::pose_without(&scenario.arm, &names).and(load).and(hz)
    }

    fn follow(
        &self,
        (forced, frequency_hz): (ForcedArm, f64),
        varied: &Varied,
        second: Option<(Quantity, f64)>,
    ) -> Result<Found, Failure> {
        let options = self.walk.options(BranchOptions::new(varied.from, varied.to))?;
        let Quantity { name, coordinate, .. } = varied.quantity;
        let mut early = Early::default();
        let branch = early.keep(name, trace(forced.clone(), frequency_hz, coordinate, &options))?;
        let mut doubled = Vec::new();
        if self.doubled {
            for walked in trace_doublings(&forced, &branch, coordinate, &options) {
                doubled.extend(early.keep_any(name, walked)?);
            }
        }
        let curves = second
            .map(|second| Curves::trace(&forced, &branch, varied.quantity.clone(), second, &self.walk, &mut early))
            .transpose()?;
        let reader = self.readings.readings.then_some(Reader { forced, coordinate });
        Ok(Found { branch, doubled, curves, reader, early })
    }

    /// The excitation's direction and amplitude, and the peak load: where the amplitude varies, that of the value 1.
    fn excitation(&self, varied: &Varied) -> Result<(Load, f64, Load), Failure> {
        let ((direction, amplitude), load) = if varied.is_amplitude() {
            let found = self.drive.direction_of("varies")?;
            (found, found.0)
        } else {
            (self.drive.direction()?, self.drive.load()?)
        };
        Ok((direction, amplitude, load))
    }

    /// The excitation frequency at the start.
    fn frequency_hz(&self, varied: &Varied) -> Result<f64, Failure> {
        match (varied.quantity.coordinate, self.frequency_hz) {
            (Coordinate::FrequencyHz, None) => Ok(varied.from),
            (Coordinate::FrequencyHz, Some(_)) => {
                Err(Failure::usage("--frequency-hz is for runs in another parameter: leave it out"))
            }
            _ => self.positive_frequency_hz(),
        }
    }

    fn positive_frequency_hz(&self) -> Result<f64, Failure> {
        match self.frequency_hz {
            Some(hz) if hz.is_finite() && hz > 0.0 => Ok(hz),
            got => {
                let got = got.map_or(String::from("missing"), |hz| short(&hz).to_string());
                Err(Failure::usage(format!("--frequency-hz is {got}: it must be a positive number")))
            }
        }
    }

    fn varied(&self) -> Result<Varied, Failure> {
        let quantity = Quantity::parse("--parameter", &self.parameter, &self.drive)?;
        let parameter = format!("--parameter {}", self.parameter);
        let (from, to) = quantity.interval(&parameter, &self.range.ends())?;
        Ok(Varied { quantity, from, to })
    }
}

/// A motion as JSON, with the quantity that varies beside the frequency.
fn point(varied: &Varied, orbit: &Orbit, reader: Option<&Reader>) -> Value {
    let mut point = place(varied, orbit, reader);
    point["stable"] = json!(orbit.is_stable());
    point["multipliers"] = orbit.multipliers().iter().map(|z| json!([z.re, z.im])).collect();
    point
}

fn bifurcation(varied: &Varied, bifurcation: &Bifurcation, reader: Option<&Reader>) -> Value {
    let mut point = place(varied, &bifurcation.orbit, reader);
    point["kind"] = json!(bifurcation.kind.name());
    point
}

/// The keys that points and bifurcations share.
fn place(varied: &Varied, orbit: &Orbit, reader: Option<&Reader>) -> Value {
    let mut place = json!({
        "frequency_hz": orbit.frequency_hz,
        "amplitude_rad": orbit.amplitude_rad,
        "harmonic1_rad": orbit.harmonic1_rad,
    });
    place[varied.quantity.name] = json!(orbit.value);
    if let Some(reader) = reader {
        place["readings"] = reader.read(orbit).value();
    }
    place
}
