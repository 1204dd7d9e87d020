//! `resonarm continue` of a structure: branches of its periodic motions.

use std::path::Path;

use nalgebra::Complex;
use serde::Serialize;
use serde_json::{Value, json};

use super::{Read, displacement_panels, displacement_unit, label, load_unit, read};
use crate::configuration;
use crate::ended_early::Early;
use crate::failure::{Failure, Verdict};
use crate::figures::branch_plot;
use crate::output::{self, JsonFlag};
use crate::progress::timed;
use resonarm::analysis::BranchOptions;
use resonarm::analysis::structure::{
    Assess, Bifurcation, Branch, Coordinate, Forced, Orbit, Reading, TraceOptions, Unlocated, trace,
};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::Dof;
use resonarm_figures::plot::{Color, Dash, Figure, Panel, Series, Style};

/// What is asked for.
pub(crate) struct Asked<'a> {
    /// The degree of freedom that is driven, with its name.
    pub drive: (Dof, &'a str),
    /// The peak of the load, N, or N·m at a joint; of a walk in the amplitude it is 1.
    pub amplitude: f64,
    /// The frequency at the start, Hz.
    pub frequency_hz: f64,
    /// What varies.
    pub coordinate: Coordinate,
    /// From one value to another.
    pub ends: [f64; 2],
    /// Where the motion is read; empty is where it is driven.
    pub at: &'a [String],
    /// Whether the stability is computed.
    pub assess: Assess,
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
    points: Vec<Value>,
    bifurcations: Vec<Value>,
    /// Those that were detected between two points and could not be located.
    unlocated: Vec<Value>,
    /// For each degree of freedom that is read, the motion with the largest displacement, and whether it is at an end
    /// of the branch.
    peaks: Vec<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ended_early: Option<Value>,
    wall_s: f64,
}

/// Follows the branch, and prints or plots it.
pub(crate) fn show(scenario: &Scenario, tested: &TestedAssembly, asked: &Asked<'_>) -> Result<Verdict, Failure> {
    let assembly = &tested.assembly;
    let read = read(asked.at, asked.drive, assembly)?;
    let forced = Forced::new(assembly.clone(), asked.drive.0, asked.amplitude);
    let dofs = read.iter().map(|(dof, _)| *dof).collect();
    let mut options = TraceOptions::new(&forced, asked.coordinate, asked.ends, dofs);
    options.branch = (asked.settings)(options.branch)?;
    options.assess = asked.assess;
    let mut early = Early::default();
    let (traced, wall_s) = timed(|| trace(&forced, asked.frequency_hz, asked.coordinate, &options));
    let branch = early.keep(asked.coordinate.name(), traced)?;
    let mut configuration = configuration::of_arm(scenario)?;
    configuration["continue"] = json!({
        "parameter": asked.coordinate.name(), "from": asked.ends[0], "to": asked.ends[1],
        "drive": asked.drive.1, "amplitude": asked.amplitude, "frequency_hz": asked.frequency_hz,
        "stability": asked.assess == Assess::Multipliers,
    });
    let point = |orbit: &Orbit| point(orbit, &read);
    let document = Document {
        configuration,
        coordinates: configuration::coordinates(assembly),
        points: branch.orbits.iter().map(point).collect(),
        bifurcations: branch.bifurcations.iter().map(|found| bifurcation(found, &read)).collect(),
        unlocated: branch.unlocated.iter().map(unlocated).collect(),
        peaks: branch.peaks.iter().zip(&read).map(|(orbit, of)| peak(&branch, orbit, of, &read)).collect(),
        ended_early: early.document(),
        wall_s,
    };
    let drawn = || (figure(&branch, asked, &read, &label(scenario, tested)), table(&branch, &read));
    let files = output::plot(asked.plot, &document, drawn)?;
    asked.json.show(&document, || text(&branch, asked, &read, wall_s), &files)?;
    early.verdict()
}

pub(super) fn amplitude(harmonic: &Complex<f64>) -> f64 {
    libm::hypot(harmonic.re, harmonic.im)
}

/// By which the motion leads the drive.
fn phase_deg(harmonic: &Complex<f64>) -> f64 {
    libm::atan2(harmonic.im, harmonic.re).to_degrees()
}

fn reading(reading: &Reading, dof: Dof) -> Value {
    let Reading { largest, mean, harmonic1 } = reading;
    json!({
        "largest": largest, "mean": mean, "amplitude": amplitude(harmonic1),
        "phase_deg": phase_deg(harmonic1), "unit": displacement_unit(dof),
    })
}

/// Readings by the names of the degrees of freedom.
pub(super) fn readings(of: &[Reading], read: &Read<'_>) -> Value {
    let named = |(of, (dof, name)): (&Reading, &(Dof, &str))| ((*name).to_owned(), reading(of, *dof));
    Value::Object(of.iter().zip(read).map(named).collect())
}

/// A motion with its readings.
fn point(orbit: &Orbit, read: &Read<'_>) -> Value {
    let multipliers = orbit.stability.as_ref().map(|stability| {
        stability.multipliers.iter().map(|multiplier| [multiplier.re, multiplier.im]).collect::<Vec<_>>()
    });
    json!({
        "value": orbit.value, "frequency_hz": orbit.frequency_hz, "drive": orbit.drive,
        "readings": readings(&orbit.readings, read), "stable": orbit.is_stable(),
        "multipliers": multipliers, "harmonics": orbit.harmonics,
    })
}

fn bifurcation(found: &Bifurcation, read: &Read<'_>) -> Value {
    let mut value = point(&found.orbit, read);
    value["kind"] = json!(found.kind.name());
    value["index"] = json!(found.index);
    value
}

/// The largest motion of a degree of freedom.
fn peak(branch: &Branch, orbit: &Orbit, (_, name): &(Dof, &str), read: &Read<'_>) -> Value {
    let mut value = point(orbit, read);
    value["at"] = json!(name);
    value["at_end"] = json!(is_at_end(branch, orbit));
    value
}

/// Whether a motion is the first or the last of the branch, so that beyond it there may be larger ones.
fn is_at_end(branch: &Branch, orbit: &Orbit) -> bool {
    let ends = [branch.orbits.first(), branch.orbits.last()];
    ends.into_iter().flatten().any(|end| end.arclength == orbit.arclength)
}

fn unlocated(found: &Unlocated) -> Value {
    json!({ "kind": found.kind.name(), "between": found.between, "index": found.index })
}

/// The bifurcations and peaks.
fn text(branch: &Branch, asked: &Asked<'_>, read: &Read<'_>, wall_s: f64) -> String {
    let mut text = format!("{} motions in {wall_s:.3} s\n", branch.orbits.len());
    if asked.assess == Assess::Nothing {
        text += "stability not computed: bifurcations other than folds are not found\n";
    }
    let unit = match asked.coordinate {
        Coordinate::FrequencyHz => "Hz",
        Coordinate::Amplitude => load_unit(asked.drive.0),
    };
    let readings = |orbit: &Orbit| {
        let one = |(of, (dof, name)): (&Reading, &(Dof, &str))| {
            format!("{name} {:.6e} {}", of.largest, displacement_unit(*dof))
        };
        orbit.readings.iter().zip(read).map(one).collect::<Vec<_>>().join(", ")
    };
    for found in &branch.bifurcations {
        text += &format!("{} at {:.7} {unit}: {}\n", found.kind.name(), found.orbit.value, readings(&found.orbit));
    }
    for Unlocated { kind, between: [from, to], .. } in &branch.unlocated {
        let kind = kind.name();
        text += &format!(
            "{kind} between {from:.7} and {to:.7} {unit}, not located: \
             try smaller steps or more harmonics (--largest-step, --most-harmonics)\n"
        );
    }
    for (orbit, (_, name)) in branch.peaks.iter().zip(read) {
        let end = if is_at_end(branch, orbit) { ", an end of the branch" } else { "" };
        text += &format!("largest motion of {name} at {:.7} {unit}{end}: {}\n", orbit.value, readings(orbit));
    }
    text
}

/// CSV: a line for each motion.
pub(super) fn table(branch: &Branch, read: &Read<'_>) -> String {
    let mut text = String::from("value,frequency_hz,drive,stable");
    for (dof, name) in read {
        let (name, unit) = (name.replace('.', "_"), displacement_unit(*dof));
        text += &format!(",{name}_largest_{unit},{name}_mean_{unit},{name}_amplitude_{unit},{name}_phase_deg");
    }
    text.push('\n');
    for orbit in &branch.orbits {
        let stable = orbit.is_stable().map_or(String::new(), |stable| stable.to_string());
        text += &format!("{},{},{},{stable}", orbit.value, orbit.frequency_hz, orbit.drive);
        for Reading { largest, mean, harmonic1 } in &orbit.readings {
            text += &format!(",{largest:e},{mean:e},{:e},{}", amplitude(harmonic1), phase_deg(harmonic1));
        }
        text.push('\n');
    }
    text
}

/// The largest displacement over what varies; unstable motions dashed, bifurcations as marks.
fn figure(branch: &Branch, asked: &Asked<'_>, read: &Read<'_>, label: &str) -> Figure {
    let (drive, name) = asked.drive;
    let x = match asked.coordinate {
        Coordinate::FrequencyHz => String::from("excitation frequency (Hz)"),
        Coordinate::Amplitude => format!("load at {name} ({})", load_unit(drive)),
    };
    let panels =
        displacement_panels(&x, read, |panel, index, name, color| with_branch(panel, branch, index, name, color));
    let load = match asked.coordinate {
        Coordinate::FrequencyHz => format!("{} {} at {name}", asked.amplitude, load_unit(drive)),
        Coordinate::Amplitude => format!("{} Hz at {name}", asked.frequency_hz),
    };
    let assessed = match asked.assess {
        Assess::Multipliers => "",
        Assess::Nothing => ", stability not computed",
    };
    let figure = Figure::new("Periodic motions").subtitle(format!("{label}, {load}{assessed}"));
    panels.into_iter().fold(figure, Figure::with)
}

/// A branch in a panel: the largest displacement of a degree of freedom by its number among those read.
pub(super) fn with_branch(mut panel: Panel, branch: &Branch, index: usize, name: &str, color: Color) -> Panel {
    for (stretch, is_stable) in stretches(branch) {
        let points = stretch.iter().map(|orbit| (orbit.value, orbit.readings[index].largest)).collect();
        let (dash, label) = match is_stable {
            Some(false) => (Dash::Dashed, format!("{name}, unstable")),
            _ => (Dash::Solid, name.to_owned()),
        };
        panel.series.push(Series::line(label, color, points).style(Style::Line { color, width: 1.6, dash }));
    }
    for (kind, title, shape) in branch_plot::BIFURCATIONS {
        let found = branch.bifurcations.iter().filter(|found| found.kind == kind).map(|found| &found.orbit);
        let points = found.map(|orbit| (orbit.value, orbit.readings[index].largest)).collect();
        panel = panel.with_any(Series::markers(title, Color::Black, shape, points));
    }
    panel
}

/// Runs of motions of one stability; neighbours share a motion.
pub(crate) fn stretches(branch: &Branch) -> Vec<(&[Orbit], Option<bool>)> {
    let (orbits, mut runs, mut start) = (&branch.orbits, Vec::new(), 0);
    for end in 1..=orbits.len() {
        if end == orbits.len() || orbits[end].is_stable() != orbits[start].is_stable() {
            runs.push((&orbits[start..(end + 1).min(orbits.len())], orbits[start].is_stable()));
            start = end;
        }
    }
    runs
}
