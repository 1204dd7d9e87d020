//! `resonarm backbone`: how the frequency of a resonance changes with its amplitude.

use clap::Args;
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::configuration;
use crate::continuation_flags::ContinuationFlags;
use crate::drive::{Drive, DriveFlags};
use crate::ended_early::{Early, of_branch};
use crate::failure::{Failure, Verdict};
use crate::figures::branches::{of_each, table, with_branches};
use crate::figures::captions;
use crate::flags::StructureFlags;
use crate::help::heading;
use crate::numbers;
use crate::output::{self, Inputs, PlotFlags};
use crate::progress::timed;
use crate::read_at::{ReadAt, cells, columns, dofs, read_at, readings};
use resonarm::analysis::{
    Backbone as Curve, BackboneOptions, BackboneOrbit, Branch, Coordinate, Forced, TraceOptions, backbone, trace,
};
use resonarm::analysis::{Bending, BranchOptions};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::Assembly;
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Panel, Series, Style, Subtitle, beside};

const EXAMPLES: &str = "\
Examples:
  resonarm backbone
  resonarm backbone --drive joint1=60 --plot backbone
  resonarm backbone --mode 2 --undamped --angles-deg 0,120 --at joint2 --to 0.1
  resonarm backbone --drive tip.x=60 --angles-deg 30,120 --json
  resonarm backbone --scenario hardening.toml --drive tip.x=4 --plot hardening
  resonarm backbone --scenario hardening.toml --undamped --at tip.x --to 0.02

A curve that ends early is printed as far as it came; standard error says why, and the exit code is 1.";

/// Follows a resonance to larger amplitudes: its frequency and its excitation.
///
/// The curve shows whether the structure hardens or softens. With damping each point is a response in phase quadrature,
/// 90° behind the excitation, which is at the peak of the forced response. Without damping it is a free vibration, which
/// has an energy in place of an excitation, and the curve a nonlinear normal mode. Without --drive a torque acts at joint 1 of
/// a chain; the amplitude of a load may be left out, and the curve then ends at --to.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
#[command(mut_args(output::explained(
    output::PLOT,
    "If an amplitude of the excitation is given, the forced response is drawn, too; its data are in STEM-response.csv."
)))]
pub(crate) struct Backbone {
    #[command(flatten)]
    pub(crate) structure: StructureFlags,
    /// Linear mode in which the curve begins, from 1, by frequency.
    #[arg(long, help_heading = heading::LOADS, value_name = "N", default_value_t = 1, value_parser = numbers::integer(1..=u8::MAX))]
    mode: u8,
    /// Follow the nonlinear normal mode of the undamped structure.
    ///
    /// It takes no excitation. With --plot, --drive DOF=A draws the forced response of the damped structure beside it.
    #[arg(long, help_heading = heading::COMPUTATION)]
    undamped: bool,
    #[command(flatten)]
    drive: DriveFlags,
    /// Degrees of freedom to read, as tip.x,joint1 [default: where the loads act].
    ///
    /// With --undamped and without --drive the default is joint1 of a chain; other structures have none.
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF", value_delimiter = ',')]
    at: Vec<String>,
    /// Displacement at which the curve ends, m, or rad at a joint [default: 0.3 at a joint].
    ///
    /// It is that of the first of --at. The curve also ends where the loads reach their amplitudes.
    #[arg(long, help_heading = heading::RANGE, value_name = "X")]
    to: Option<f64>,
    #[command(flatten)]
    walk: ContinuationFlags,
    #[command(flatten)]
    output: PlotFlags,
}

/// The angle of a joint at which the curve ends without another limit, rad.
const TO_RAD: f64 = 0.3;
/// Largest step of a drawn curve, as a fraction of the response's size.
const SMOOTH_STEP: f64 = 0.05;

/// The backbone to compute: its load, its readings and its end.
struct Walk {
    /// The load; without damping none is needed.
    drive: Option<Drive>,
    /// The amplitude of the first load at which the curve ends, if it is given.
    amplitude: Option<f64>,
    read: Vec<ReadAt>,
    /// The displacement at which the curve ends, if there is one.
    to: Option<f64>,
}

#[derive(Serialize)]
struct Document {
    /// The inputs of the results; without an amplitude of the excitation the load is that of the value 1.
    configuration: Value,
    coordinates: Value,
    mode: u8,
    kind: &'static str,
    linear_frequency_hz: f64,
    bending: Option<&'static str>,
    frequency_shift_hz: f64,
    /// df/d(a²) at small amplitudes a of each degree of freedom that is read, Hz over the square of its unit.
    curvature: Map<String, Value>,
    points: Vec<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ended_early: Option<Value>,
    wall_s: f64,
}

impl Backbone {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let inputs = Inputs::of_scenario(self.structure.scenario.as_deref());
        let endings = [output::PLOTTED, &["-response.csv"]].concat();
        self.output.check(&endings, &inputs)?;
        let scenario = self.structure.scenario()?;
        let tested = scenario.under_test()?;
        let walk = self.walk(&tested)?;
        // The forced response of the plot is always that of the damped structure, also when the backbone is the
        // undamped normal mode: without damping its peak would be infinite, and the agreement of the two is what the
        // plot shows.
        let damped = walk.drive.as_ref().map(|drive| drive.forced(&tested.assembly));
        let forced = match &damped {
            Some(damped) if !self.undamped => damped.clone(),
            _ => Forced::free(&tested.assembly, self.mode())?,
        };
        if let (Some(drive), true) = (&walk.drive, self.undamped) {
            let is_drawn = walk.amplitude.is_some() && self.output.plot.is_some();
            let at = drive.at();
            let but = if is_drawn { " but for the forced response" } else { "" };
            tracing::warn!("a free vibration has no excitation: the load at {at} changes nothing{but}");
        }
        let options = self.options(&forced, &walk)?;
        let mut early = Early::default();
        let (followed, wall_s) = timed(|| backbone(&forced, &options));
        let curve = early.keep("the backbone", followed, |curve| curve.points.len())?;
        let response = match (&self.output.plot, walk.amplitude, &damped) {
            (Some(_), Some(_), Some(damped)) => self.response(damped, &curve, &walk.read, &mut early)?,
            _ => None,
        };
        let document = Document {
            configuration: self.configuration(&scenario, &tested, &walk),
            coordinates: configuration::coordinates(&tested.assembly),
            mode: self.mode,
            kind: if self.undamped { "nonlinear-normal-mode" } else { "phase-quadrature" },
            linear_frequency_hz: forced.assembly().modes()[options.mode].frequency_hz,
            bending: curve.bending().map(Bending::name),
            frequency_shift_hz: curve.shift_hz(),
            curvature: (walk.read.iter().enumerate())
                .map(|(k, at)| (at.name.clone(), json!(curve.curvature(k))))
                .collect(),
            points: curve.points.iter().map(|orbit| self.point(orbit, &walk.read)).collect(),
            ended_early: early.document(),
            wall_s,
        };
        let conditions = captions::structure(&scenario, &tested, &[]);
        let drawn = || (self.figure(conditions, &curve, response.as_ref(), &walk), self.csv(&curve, &walk.read));
        let mut files = output::plot(self.output.plot.as_deref(), &document, drawn)?;
        if let (Some(stem), Some(response)) = (&self.output.plot, &response) {
            let table = table(Coordinate::FrequencyHz, &[response], &walk.read);
            files.push(output::write(beside(stem, "-response.csv"), &table)?);
        }
        let text = || {
            // With --plot the points are in the files.
            let table = if self.output.plot.is_none() { self.table(&curve, &walk) } else { String::new() };
            let head = self.head(&captions::label(&scenario, &tested), &document, &walk);
            format!("{head}\n\n{table}{}\n", reading_of(&document, &curve, &walk.read))
        };
        self.output.json.show(&document, text, &files)?;
        early.verdict()
    }

    /// Resolves the flags against the structure: the load, the degrees of freedom that are read, and where the curve
    /// ends.
    fn walk(&self, tested: &TestedAssembly) -> Result<Walk, Failure> {
        self.drive.refuse_harmonics("a backbone is the resonance under one sine")?;
        let (drive, amplitude) = if self.undamped && self.drive.is_empty() {
            (None, None)
        } else {
            let (drive, amplitude) = self.drive.up_to(&tested.assembly)?;
            (Some(drive), amplitude)
        };
        let read = match &drive {
            Some(drive) => read_at(&self.at, &drive.driven(), &tested.assembly)?,
            None => self.read_without_load(&tested.assembly)?,
        };
        let to = match self.to {
            Some(to) if to > 0.0 => Some(to),
            Some(to) => return Err(Failure::value("--to", to, "it must be a positive number")),
            // Only an angle has a default limit. Which displacement in metres is large depends on the size of the
            // structure.
            None if read[0].dof.is_angle() => Some(TO_RAD),
            None => None,
        };
        // Without a limit the curve would be followed until the continuation fails. The amplitude of a load limits
        // only the damped curve: an undamped normal mode needs no load.
        if to.is_none() && (amplitude.is_none() || self.undamped) {
            let ReadAt { name, .. } = &read[0];
            let or = match &drive {
                Some(drive) if !self.undamped => {
                    format!(", or the load at which it ends, by --drive {}=A", drive.loads[0].at.name)
                }
                _ => String::new(),
            };
            return Err(Failure::usage(format!(
                "the end of the curve is missing: give the displacement of {name} at which it ends, in {}, by --to X{or}",
                read[0].unit()
            )));
        }
        Ok(Walk { drive, amplitude, read, to })
    }

    /// Returns the degrees of freedom that are read of a free vibration: those of --at, or joint 1 of a chain.
    fn read_without_load(&self, assembly: &Assembly) -> Result<Vec<ReadAt>, Failure> {
        let joint1 = assembly.dof("joint1").ok().map(|dof| ReadAt { dof, name: String::from("joint1") });
        let usual: Vec<ReadAt> = joint1.into_iter().collect();
        if self.at.is_empty() && usual.is_empty() {
            let known = assembly.dof_names().join(", ");
            return Err(Failure::usage(format!(
                "the degree of freedom to read is missing: give it by --at DOF, one of {known}"
            )));
        }
        read_at(&self.at, &usual, assembly)
    }

    /// Returns the mode, numbered from 0.
    fn mode(&self) -> usize {
        usize::from(self.mode).saturating_sub(1)
    }

    fn options(&self, forced: &Forced, walk: &Walk) -> Result<BackboneOptions, Failure> {
        // An infinite limit is never reached. At least one of the two is finite, as `walk` has checked.
        let largest = walk.to.unwrap_or(f64::INFINITY);
        let load = walk.amplitude.map_or(f64::INFINITY, f64::abs);
        let mut options = BackboneOptions::new(forced, self.mode(), largest, load, dofs(&walk.read));
        options.branch = self.walk.options(options.branch)?;
        if self.output.plot.is_some() {
            smooth(&mut options.branch);
        }
        Ok(options)
    }

    fn configuration(&self, scenario: &Scenario, tested: &TestedAssembly, walk: &Walk) -> Value {
        let mut configuration = configuration::of_structure(scenario, tested);
        if let Some(drive) = &walk.drive {
            configuration["drive"] = drive.document();
        }
        configuration["backbone"] = json!({ "undamped": self.undamped, "to": walk.to });
        configuration
    }

    /// Computes the forced response around the curve.
    fn response(
        &self,
        forced: &Forced,
        curve: &Curve,
        read: &[ReadAt],
        early: &mut Early,
    ) -> Result<Option<Branch>, Failure> {
        let mut options = TraceOptions::new(forced, Coordinate::FrequencyHz, curve.window_hz(), dofs(read));
        options.branch = self.walk.options(options.branch)?;
        smooth(&mut options.branch);
        let traced = trace(forced, options.branch.from, Coordinate::FrequencyHz, &options);
        early.keep_any("frequency_hz of the forced response", traced, of_branch)
    }

    /// Returns a response with its readings by the names of the degrees of freedom.
    fn point(&self, orbit: &BackboneOrbit, read: &[ReadAt]) -> Value {
        let mut point = json!({
            "frequency_hz": orbit.frequency_hz, "readings": readings(&orbit.readings, read),
            "harmonics": orbit.harmonics,
        });
        if self.undamped {
            point["energy_j"] = json!(orbit.energy_j);
        } else {
            point["drive"] = json!(orbit.drive);
        }
        point
    }

    fn head(&self, label: &str, document: &Document, walk: &Walk) -> String {
        let what = match &walk.drive {
            Some(drive) if !self.undamped => format!("in phase quadrature with a load at {}", drive.at()),
            _ => String::from("nonlinear normal mode of the structure without damping"),
        };
        format!("{label}, mode {} from {:.6} Hz: {what}", self.mode, document.linear_frequency_hz)
    }

    fn table(&self, curve: &Curve, walk: &Walk) -> String {
        let heads: Vec<String> =
            walk.read.iter().map(|at| format!("{:>16}", format!("largest {} {}", at.name, at.unit()))).collect();
        let mut text = String::from("  frequency Hz");
        heads.iter().for_each(|head| text += &format!("   {head}"));
        let last = match &walk.drive {
            Some(drive) if !self.undamped => drive.unit(),
            _ => "energy J",
        };
        text += &format!("   {last:>12}\n");
        for orbit in &curve.points {
            text += &format!("  {:12.6}", orbit.frequency_hz);
            for (head, reading) in heads.iter().zip(&orbit.readings) {
                text += &format!("   {:width$.6e}", reading.largest, width = head.chars().count());
            }
            text += &match orbit.energy_j {
                Some(energy_j) if self.undamped => format!("   {energy_j:12.6e}\n"),
                _ => format!("   {:12.4}\n", orbit.drive),
            };
        }
        text.push('\n');
        text
    }

    /// Returns a line for each response, with the units in the names of the columns.
    fn csv(&self, curve: &Curve, read: &[ReadAt]) -> String {
        let second = if self.undamped { "energy_j" } else { "drive" };
        let mut text = format!("frequency_hz,{second}{}\n", columns(read));
        for orbit in &curve.points {
            let second = orbit.energy_j.filter(|_| self.undamped).unwrap_or(orbit.drive);
            text += &format!("{},{second}{}\n", orbit.frequency_hz, cells(&orbit.readings));
        }
        text
    }

    /// Draws the curve over the forced response.
    fn figure(&self, conditions: Subtitle, curve: &Curve, response: Option<&Branch>, walk: &Walk) -> Figure {
        let kind = if self.undamped { "nonlinear normal mode" } else { "phase quadrature" };
        let with = walk.drive.as_ref().filter(|_| response.is_some());
        let with = with.map_or(String::new(), |drive| format!("response to {}", drive.words()));
        let figure = Figure::new(format!("Backbone of mode {}", self.mode)).subtitle(conditions.and(with));
        let branches: Vec<&Branch> = response.into_iter().collect();
        let line = |y: &dyn Fn(&BackboneOrbit) -> f64| {
            let points = curve.points.iter().map(|orbit| (orbit.frequency_hz, y(orbit)));
            let style = Style::Line { color: Color::Black, width: 1.2, dash: Dash::Chain };
            Series::line(kind, Color::Black, points.collect()).style(style)
        };
        let figure = of_each(figure, "frequency (Hz)", &walk.read, |panel, index| {
            with_branches(panel, &branches, 0, index).with(line(&|orbit| orbit.readings[index].largest))
        });
        if !self.undamped {
            return figure;
        }
        // It grows as the square of the amplitude, over decades, so that its axis is logarithmic.
        let energy = line(&|orbit| orbit.energy_j.unwrap_or(f64::NAN)).unlabelled();
        figure.with(Panel::new(Axis::linear("frequency (Hz)"), Axis::log("energy (J)")).with(energy))
    }
}

fn smooth(options: &mut BranchOptions) {
    options.continuation.largest_step = options.continuation.largest_step.min(SMOOTH_STEP);
}

/// Says whether the curve hardens or softens, and by how much.
fn reading_of(document: &Document, curve: &Curve, read: &[ReadAt]) -> String {
    let (Some(last), Some(at)) = (curve.points.last(), read.first()) else { return String::from("no points") };
    let shift_hz = document.frequency_shift_hz;
    let percent = 100.0 * (shift_hz / document.linear_frequency_hz);
    let name = &at.name;
    let unit = at.unit();
    let largest = last.readings[0].largest;
    let bending = document.bending.unwrap_or("straight");
    let mut text = format!("{bending}: {shift_hz:+.6} Hz ({percent:+.4} %) at {name} {largest:.6e} {unit}");
    if let Some(curvature) = curve.curvature(0) {
        text += &format!("; at small amplitudes a of {name}, df/d(a²) = {curvature:+.6e} Hz/{unit}²");
    }
    text
}
