//! `resonarm modes`: the natural modes of the structure, or over a range of one of its parameters.

use core::f64::consts::TAU;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags::{self, StructureFlags};
use crate::help::heading;
use crate::output::{self, Inputs, PlotFlags};
use resonarm::analysis::{Pole, structure_poles};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::{Assembly, CoordinateUnit, Linear, Parameter, StructureMode};
use resonarm_figures::plot::{Axis, Color, Figure, Panel, Series, Subtitle};
use resonarm_numeric::number::short;

/// Computes natural frequencies, damping ratios and mode shapes, also over a parameter.
///
/// Natural frequencies and shapes are those of the undamped structure. Beside them are the poles λ of the damped one,
/// which `resonarm identify` finds: their frequency |λ|/2π and damping ratio −Re λ/|λ|. Elements take part with their
/// slopes at rest.
///
/// Coordinates of a chain with gravity count from rest under its weight; angles are those of relaxed springs, before it
/// sags.
///
/// With --over it prints CSV, a line for each value; shapes are normalised to unit modal mass. With --plot CSV and JSON
/// go to files beside the figure, and standard output lists them.
#[derive(Debug, Args)]
#[command(mut_args(output::explained(
    "Plot the natural frequencies over the parameter to STEM.svg and STEM.png, with caption, CSV and JSON",
    ""
)))]
#[command(mut_args(|arg| if arg.get_id() == "plot" { arg.requires("over") } else { arg }))]
pub(crate) struct Modes {
    #[command(flatten)]
    pub(crate) structure: StructureFlags,
    /// Parameter that varies, as link2.angle_deg, mode1.frequency_hz or element1.stiffness_n_m.
    #[arg(long, help_heading = heading::RANGE, value_name = "NAME", requires = "from", requires = "to")]
    over: Option<String>,
    /// First value of the parameter, in the unit of its name.
    #[arg(long, help_heading = heading::RANGE, value_name = "X", requires = "over")]
    from: Option<f64>,
    /// Last value of the parameter.
    #[arg(long, help_heading = heading::RANGE, value_name = "X", requires = "over")]
    to: Option<f64>,
    /// Number of values, evenly spaced, from 2 to 1000000.
    #[arg(long, help_heading = heading::RANGE, value_name = "N", default_value_t = 181, requires = "over", value_parser = flags::points())]
    points: u32,
    #[command(flatten)]
    output: PlotFlags,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    modes: Vec<ModeAndPole>,
}

/// A mode of the undamped structure, its shape in the coordinates, of unit modal mass; and the pole of the damped one,
/// if that oscillates.
#[derive(Serialize)]
struct ModeAndPole {
    #[serde(flatten)]
    mode: Mode,
    pole_frequency_hz: Option<f64>,
    pole_damping_ratio: Option<f64>,
}

#[derive(Serialize)]
struct Mode {
    frequency_hz: f64,
    damping_ratio: f64,
    shape: Vec<f64>,
}

impl Mode {
    /// Returns the mode of the undamped structure with the part φᵀDφ/2ω of the damping D in it, for a shape φ of unit
    /// modal mass; a rigid mode's is 0, or infinite with damping.
    fn new(mode: &StructureMode, linear: &Linear) -> Mode {
        let StructureMode { frequency_hz, damping_ratio, shape } = mode.clone();
        // Chunks of length 0 would panic: a structure without coordinates has no rows.
        let rows = linear.damping.chunks_exact(shape.len().max(1));
        let along = |row: &[f64]| row.iter().zip(&shape).map(|(d, part)| d * part).sum::<f64>();
        let modal: f64 = rows.zip(&shape).map(|(row, part)| along(row) * part).sum();
        let is_rigid = frequency_hz == 0.0;
        let damping_ratio = if is_rigid { damping_ratio } else { modal / (2.0 * TAU * frequency_hz) };
        Mode { frequency_hz, damping_ratio, shape }
    }

    /// Returns the modes of a structure.
    fn of(assembly: &Assembly) -> Vec<Mode> {
        let linear = assembly.linear();
        assembly.modes().iter().map(|mode| Mode::new(mode, &linear)).collect()
    }
}

#[derive(Serialize)]
struct RangeDocument {
    /// The structure, in which the parameter has its value without the range.
    configuration: Value,
    coordinates: Value,
    /// The parameter that varies.
    over: String,
    points: Vec<AtValue>,
}

#[derive(Serialize)]
struct AtValue {
    value: f64,
    modes: Vec<Mode>,
}

impl Modes {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.output.check(output::PLOTTED, &Inputs::of_scenario(self.structure.scenario.as_deref()))?;
        let scenario = self.structure.scenario()?;
        let tested = scenario.under_test()?;
        match (&self.over, self.from, self.to) {
            (Some(name), Some(from), Some(to)) => self.over(&scenario, &tested, name, [from, to]),
            _ => self.alone(&scenario, &tested),
        }
    }

    /// Computes the modes of the structure as it is.
    fn alone(&self, scenario: &Scenario, tested: &TestedAssembly) -> Result<Verdict, Failure> {
        let assembly = &tested.assembly;
        let with_pole = |(mode, pole): (Mode, Option<Pole>)| ModeAndPole {
            mode,
            pole_frequency_hz: pole.map(|pole| pole.pole_frequency_hz),
            // Without damping it is 0, not −0.
            pole_damping_ratio: pole.map(|pole| pole.pole_damping_ratio + 0.0),
        };
        let document = Document {
            configuration: configuration::of_structure(scenario, tested),
            coordinates: configuration::coordinates(assembly),
            modes: Mode::of(assembly).into_iter().zip(structure_poles(assembly)).map(with_pole).collect(),
        };
        self.output.json.show(&document, || document.text(&captions::label(scenario, tested), assembly), &[])
    }

    /// Computes the modes over the values of a parameter.
    fn over(
        &self,
        scenario: &Scenario,
        tested: &TestedAssembly,
        name: &str,
        [from, to]: [f64; 2],
    ) -> Result<Verdict, Failure> {
        let assembly = &tested.assembly;
        let parameter = assembly.parameter(name).map_err(|error| flags::refused("--over", &error))?;
        if from == to {
            let from = short(&from);
            let to = short(&to);
            return Err(Failure::usage(format!("--from {from} --to {to}: the ends must be different")));
        }
        // There are at least two points.
        let last = f64::from(self.points - 1);
        let at = |k: u32| {
            let value = from + (to - from) * (f64::from(k) / last);
            let changed = assembly.with(parameter, value);
            let changed = changed.map_err(|error| Failure::usage(format!("--over {name}: {error}")))?;
            Ok(AtValue { value, modes: Mode::of(&changed) })
        };
        let document = RangeDocument {
            configuration: configuration::of_structure(scenario, tested),
            coordinates: configuration::coordinates(assembly),
            over: name.to_owned(),
            points: (0..self.points).map(at).collect::<Result<_, Failure>>()?,
        };
        let conditions = captions::structure(scenario, tested, core::slice::from_ref(&document.over));
        let drawn = || (document.figure(conditions, parameter), document.csv(assembly));
        let text = || if self.output.plot.is_none() { document.csv(assembly) } else { String::new() };
        self.output.show(&document, drawn, text)
    }
}

impl Document {
    fn text(&self, label: &str, assembly: &Assembly) -> String {
        let is_chain = assembly.coordinate_unit() == CoordinateUnit::Radian;
        let shape_head =
            if is_chain { format!("   shape: {}", symbols(assembly, "α").join(", ")) } else { String::new() };
        let mut text = format!(
            "{label}\n{}\n  mode   undamped frequency   damping ratio   pole frequency |λ|/2π   −Re λ/|λ|{shape_head}\n",
            sag_text(assembly)
        );
        for (ModeAndPole { mode, pole_frequency_hz, pole_damping_ratio }, number) in self.modes.iter().zip(1..) {
            let pole = match (pole_frequency_hz, pole_damping_ratio) {
                _ if mode.frequency_hz == 0.0 => format!("{:>21}   {:>9}", "rigid", "–"),
                (Some(hz), Some(ratio)) => format!("{hz:18.4} Hz   {ratio:9.3e}"),
                _ => format!("{:>21}   {:>9}", "overdamped", "–"),
            };
            let shape = if is_chain { format!("   {}", shape_text(&mode.shape)) } else { String::new() };
            let Mode { frequency_hz, damping_ratio, .. } = mode;
            text += &format!("  {number:4}   {frequency_hz:15.4} Hz   {damping_ratio:13.3e}   {pole}{shape}\n");
        }
        text
    }
}

/// Returns the symbols of the coordinates: the letter with the number of each.
fn symbols(assembly: &Assembly, letter: &str) -> Vec<String> {
    (1..=assembly.coordinates()).map(|number| format!("{letter}{number}")).collect()
}

/// Writes a shape with the largest part 1.
fn shape_text(shape: &[f64]) -> String {
    let largest = shape.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(1.0);
    shape.iter().map(|part| format!("{:+.4}", part / largest)).collect::<Vec<_>>().join(" ")
}

/// Returns a line with the joints' deflection under the weight; empty without gravity.
fn sag_text(assembly: &Assembly) -> String {
    let Some(sag_rad) = assembly.sag_rad() else { return String::new() };
    let joint = |(sag_rad, number): (&f64, usize)| format!("{sag_rad:+.5} rad in joint {number}");
    let joints: Vec<String> = sag_rad.iter().zip(1..).map(joint).collect();
    format!(
        "the structure sags under its weight by {}: coordinates count from this state, angles are those before it sags\n",
        joints.join(", ")
    )
}

impl RangeDocument {
    fn csv(&self, assembly: &Assembly) -> String {
        let letter = if assembly.coordinate_unit() == CoordinateUnit::Radian { "alpha" } else { "q" };
        let names = symbols(assembly, letter);
        let mut text = self.over.replace('.', "_");
        for k in 1..=names.len() {
            text += &format!(",frequency{k}_hz,damping_ratio{k}");
            names.iter().for_each(|name| text += &format!(",shape{k}_{name}"));
        }
        for AtValue { value, modes } in &self.points {
            text += &format!("\n{value}");
            for Mode { frequency_hz, damping_ratio, shape } in modes {
                text += &format!(",{frequency_hz},{damping_ratio:e}");
                shape.iter().for_each(|part| text += &format!(",{part}"));
            }
        }
        text.push('\n');
        text
    }

    /// Draws the natural frequencies over the parameter, as Fig. 3 of the paper.
    fn figure(&self, conditions: Subtitle, parameter: Parameter) -> Figure {
        const COLORS: [Color; 4] = [Color::Blue, Color::Vermillion, Color::Orange, Color::Black];
        let x = match parameter.unit() {
            "°" => Axis::degrees(format!("{parameter} (°)")),
            "" => Axis::linear(parameter.to_string()),
            unit => Axis::linear(format!("{parameter} ({unit})")),
        };
        let mut panel = Panel::new(x, Axis::linear("natural frequency (Hz)"));
        let modes = self.points.first().map_or(0, |point| point.modes.len());
        // Every value of the parameter has as many modes as the first one.
        for (k, color) in (0..modes).zip(COLORS.into_iter().cycle()) {
            let points = self.points.iter().map(|point| (point.value, point.modes[k].frequency_hz)).collect();
            panel = panel.with(Series::line(format!("mode {}", k + 1), color, points));
        }
        Figure::new(format!("Natural frequencies over {parameter}")).subtitle(conditions).with(panel)
    }
}
