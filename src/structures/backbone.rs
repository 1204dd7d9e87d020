//! `resonarm backbone` of a structure.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Value, json};

use super::continuation::{amplitude, readings, table as response_table, with_branch};
use super::{Read, displacement_panels, displacement_unit, label, load_unit, read};
use crate::configuration;
use crate::ended_early::Early;
use crate::failure::{Failure, Verdict};
use crate::output::{self, JsonFlag};
use crate::progress::timed;
use resonarm::analysis::structure::{
    Backbone, BackboneMotion, BackboneOptions, Branch, Coordinate, Forced, TraceOptions, backbone, trace,
};
use resonarm::analysis::{Bending, BranchOptions};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::Dof;
use resonarm_figures::plot::{Dash, Figure, Series, Style, beside};

/// Largest step of a drawn curve, as a fraction of the motion's size.
const SMOOTH_STEP: f64 = 0.05;

/// What is asked for.
pub(crate) struct Asked<'a> {
    /// The degree of freedom that is driven, with its name.
    pub drive: (Dof, &'a str),
    /// The curve ends at this peak of the load, N, or N·m at a joint.
    pub amplitude: Option<f64>,
    /// Or at this displacement of the first degree of freedom that is read, m, or rad.
    pub to: Option<f64>,
    /// The linear mode, from 1.
    pub mode: u8,
    /// Whether the damping is left out.
    pub undamped: bool,
    /// Where the motion is read; empty is where it is driven.
    pub at: &'a [String],
    /// Settings of the walk.
    pub settings: &'a dyn Fn(BranchOptions) -> Result<BranchOptions, Failure>,
    /// Where the plot goes.
    pub plot: Option<&'a Path>,
    /// How the document is printed.
    pub json: JsonFlag,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    mode: u8,
    kind: &'static str,
    linear_frequency_hz: f64,
    bending: Option<&'static str>,
    frequency_shift_hz: f64,
    /// df/d(a²) at small amplitudes a of each degree of freedom that is read, Hz over the square of its unit.
    curvature: Value,
    points: Vec<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ended_early: Option<Value>,
    wall_s: f64,
}

/// Follows the backbone, and prints or plots it.
pub(crate) fn show(scenario: &Scenario, tested: &TestedAssembly, asked: &Asked<'_>) -> Result<Verdict, Failure> {
    let assembly = &tested.assembly;
    let read = read(asked.at, asked.drive, assembly)?;
    let damped = Forced::new(assembly.clone(), asked.drive.0, asked.amplitude.unwrap_or(1.0));
    let forced = if asked.undamped { damped.undamped()? } else { damped.clone() };
    let mut options = asked.options(&forced, &read)?;
    if asked.plot.is_some() {
        smooth(&mut options.branch);
    }
    let mut early = Early::default();
    let (followed, wall_s) = timed(|| backbone(&forced, &options));
    let curve = early.keep("the backbone", followed)?;
    let response = match (asked.plot, asked.amplitude) {
        (Some(_), Some(_)) => asked.response(&damped, &curve, &read, &mut early)?,
        _ => None,
    };
    let linear_frequency_hz = forced.assembly().modes()[options.mode].frequency_hz;
    let document = Document {
        configuration: asked.configuration(scenario)?,
        coordinates: configuration::coordinates(assembly),
        mode: asked.mode,
        kind: if asked.undamped { "nonlinear-normal-mode" } else { "phase-quadrature" },
        linear_frequency_hz,
        bending: curve.bending().map(Bending::name),
        frequency_shift_hz: curve.shift_hz(),
        curvature: read
            .iter()
            .enumerate()
            .map(|(k, (_, name))| ((*name).to_owned(), json!(curve.curvature(k))))
            .collect(),
        points: curve.points.iter().map(|motion| asked.point(motion, &read)).collect(),
        ended_early: early.document(),
        wall_s,
    };
    let files = asked.plot(&document, &curve, response.as_ref(), &read, &label(scenario, tested))?;
    let text = || {
        let table = if asked.plot.is_none() { asked.table(&curve, &read) } else { String::new() };
        let head = asked.head(&label(scenario, tested), linear_frequency_hz);
        format!("{head}\n\n{table}{}\n", reading_of(&document, &curve, &read))
    };
    asked.json.show(&document, text, &files)?;
    early.verdict()
}

fn smooth(options: &mut BranchOptions) {
    options.continuation.largest_step = options.continuation.largest_step.min(SMOOTH_STEP);
}

impl Asked<'_> {
    fn options(&self, forced: &Forced, read: &Read<'_>) -> Result<BackboneOptions, Failure> {
        let bound = |flag: &str, value: Option<f64>| match value {
            Some(value) if value > 0.0 => Ok(value),
            Some(value) => Err(Failure::value(flag, value, "it must be a positive number")),
            None => Ok(f64::INFINITY),
        };
        if self.to.is_none() && (self.amplitude.is_none() || self.undamped) {
            let (name, unit) = (read[0].1, displacement_unit(read[0].0));
            let or = if self.undamped { "" } else { ", or at which load, by --amplitude A" };
            return Err(Failure::usage(format!(
                "say where the curve ends: at which displacement of {name}, {unit}, by --to X{or}"
            )));
        }
        let (largest, load) = (bound("--to", self.to)?, bound("--amplitude", self.amplitude)?);
        let dofs = read.iter().map(|(dof, _)| *dof).collect();
        let mode = usize::from(self.mode).saturating_sub(1);
        let mut options = BackboneOptions::new(forced, mode, largest, load, dofs);
        options.branch = (self.settings)(options.branch)?;
        Ok(options)
    }

    fn configuration(&self, scenario: &Scenario) -> Result<Value, Failure> {
        let mut configuration = configuration::of_arm(scenario)?;
        configuration["backbone"] = json!({
            "undamped": self.undamped, "drive": self.drive.1, "amplitude": self.amplitude, "to": self.to,
        });
        Ok(configuration)
    }

    /// The forced response around the curve.
    fn response(
        &self,
        forced: &Forced,
        curve: &Backbone,
        read: &Read<'_>,
        early: &mut Early,
    ) -> Result<Option<Branch>, Failure> {
        let dofs = read.iter().map(|(dof, _)| *dof).collect();
        let mut options = TraceOptions::new(forced, Coordinate::FrequencyHz, curve.window_hz(), dofs);
        options.branch = (self.settings)(options.branch)?;
        smooth(&mut options.branch);
        let traced = trace(forced, options.branch.from, Coordinate::FrequencyHz, &options);
        early.keep_any("frequency_hz of the forced response", traced)
    }

    /// A motion with its readings by the names of the degrees of freedom.
    fn point(&self, motion: &BackboneMotion, read: &Read<'_>) -> Value {
        let mut point = json!({
            "frequency_hz": motion.frequency_hz,
            "largest": motion.coordinates.iter().map(|of| of.largest).collect::<Vec<_>>(),
            "amplitude": motion.coordinates.iter().map(|of| amplitude(&of.harmonic1)).collect::<Vec<_>>(),
            "readings": readings(&motion.readings, read), "harmonics": motion.harmonics,
        });
        if !self.undamped {
            point["drive"] = json!(motion.drive);
        }
        point
    }

    fn head(&self, label: &str, linear_frequency_hz: f64) -> String {
        let (dof, name) = self.drive;
        let what = match (self.undamped, dof.is_angle()) {
            (true, _) => String::from("nonlinear normal mode of the structure without damping"),
            (false, true) => format!("in phase quadrature with a torque at {name}"),
            (false, false) => format!("in phase quadrature with a force at {name}"),
        };
        format!("{label}, mode {} from {linear_frequency_hz:.6} Hz: {what}", self.mode)
    }

    fn table(&self, curve: &Backbone, read: &Read<'_>) -> String {
        let mut text = String::from("  frequency Hz");
        for (dof, name) in read {
            let head = format!("largest {name} {}", displacement_unit(*dof));
            text += &format!("   {head:>16}");
        }
        if !self.undamped {
            text += &format!("   {:>12}", load_unit(self.drive.0));
        }
        text.push('\n');
        for motion in &curve.points {
            text += &format!("  {:12.6}", motion.frequency_hz);
            for ((dof, name), reading) in read.iter().zip(&motion.readings) {
                let width = format!("largest {name} {}", displacement_unit(*dof)).chars().count().max(16);
                text += &format!("   {:width$.6e}", reading.largest);
            }
            if !self.undamped {
                text += &format!("   {:12.4}", motion.drive);
            }
            text.push('\n');
        }
        text.push('\n');
        text
    }

    /// CSV: a line for each motion.
    fn csv(&self, curve: &Backbone, read: &Read<'_>) -> String {
        let mut text = String::from("frequency_hz");
        for (dof, name) in read {
            let (name, unit) = (name.replace('.', "_"), displacement_unit(*dof));
            text += &format!(",{name}_largest_{unit},{name}_mean_{unit},{name}_amplitude_{unit}");
        }
        text += if self.undamped { "\n" } else { ",drive\n" };
        for motion in &curve.points {
            text += &format!("{}", motion.frequency_hz);
            for of in &motion.readings {
                text += &format!(",{:e},{:e},{:e}", of.largest, of.mean, amplitude(&of.harmonic1));
            }
            let drive = if self.undamped { String::new() } else { format!(",{}", motion.drive) };
            text += &format!("{drive}\n");
        }
        text
    }

    /// The curve over the forced response, and the numbers of both.
    fn plot(
        &self,
        document: &Document,
        curve: &Backbone,
        response: Option<&Branch>,
        read: &Read<'_>,
        label: &str,
    ) -> Result<Vec<PathBuf>, Failure> {
        let drawn = || (self.figure(curve, response, read, label), self.csv(curve, read));
        let mut files = output::plot(self.plot, document, drawn)?;
        if let (Some(stem), Some(response)) = (self.plot, response) {
            files.push(output::write(beside(stem, "-response.csv"), &response_table(response, read))?);
        }
        Ok(files)
    }

    fn figure(&self, curve: &Backbone, response: Option<&Branch>, read: &Read<'_>, label: &str) -> Figure {
        let kind = if self.undamped { "nonlinear normal mode" } else { "phase quadrature" };
        let panels = displacement_panels("frequency (Hz)", read, |panel, index, name, color| {
            let panel = match response {
                Some(response) => with_branch(panel, response, index, name, color),
                None => panel,
            };
            let points = curve.points.iter().map(|motion| (motion.frequency_hz, motion.readings[index].largest));
            let style = Style::Line { color, width: 1.2, dash: Dash::Chain };
            panel.with(Series::line(format!("{name}, {kind}"), color, points.collect()).style(style))
        });
        let with = self.amplitude.filter(|_| response.is_some()).map_or(String::new(), |amplitude| {
            format!(", response to {amplitude} {} at {}", load_unit(self.drive.0), self.drive.1)
        });
        let figure = Figure::new(format!("Backbone of mode {}", self.mode)).subtitle(format!("{label}{with}"));
        panels.into_iter().fold(figure, Figure::with)
    }
}

/// Whether the curve hardens or softens, and by how much.
fn reading_of(document: &Document, curve: &Backbone, read: &Read<'_>) -> String {
    let (Some(last), Some((dof, name))) = (curve.points.last(), read.first()) else { return String::from("no points") };
    let (shift_hz, part) = (document.frequency_shift_hz, document.frequency_shift_hz / document.linear_frequency_hz);
    let unit = displacement_unit(*dof);
    let mut text = format!(
        "{}: {shift_hz:+.6} Hz ({:+.4} %) at {name} {:.6e} {unit}",
        document.bending.unwrap_or("straight"),
        100.0 * part,
        last.readings[0].largest,
    );
    if let Some(curvature) = curve.curvature(0) {
        text += &format!("; at small amplitudes a of {name}, df/d(a²) = {curvature:+.6e} Hz/{unit}²");
    }
    text
}
