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
use crate::figures::singular_curves::LARGEST_STEP;
use crate::output::{self, JsonFlag};
use crate::progress::timed;
use resonarm::analysis::structure::{
    Assess, Bifurcation, Branch, Coordinate, Forced, Orbit, Reading, SingularCurve, SingularPoint, TraceOptions, Turn,
    Unlocated, trace, trace_doublings, trace_singular_curves,
};
use resonarm::analysis::{BifurcationKind, BranchOptions};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::{Assembly, Dof};
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Marker, Panel, Series, Style, beside};

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
    /// Whether doubled branches are followed, too.
    pub doubled: bool,
    /// The second coordinate of curves of folds and period doublings, and where they end.
    pub curves: Option<(Coordinate, f64)>,
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
    /// The branches of doubled period: points and bifurcations.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    doubled: Vec<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    curves: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ended_early: Option<Value>,
    wall_s: f64,
}

/// What a flag names as a coordinate: `frequency`, `amplitude` or a parameter of the structure.
pub(crate) fn coordinate(flag: &str, name: &str, assembly: &Assembly) -> Result<Coordinate, Failure> {
    match name {
        "frequency" => Ok(Coordinate::FrequencyHz),
        "amplitude" => Ok(Coordinate::Amplitude),
        _ => assembly
            .parameter(name)
            .map(Coordinate::Parameter)
            .map_err(|error| Failure::usage(format!("{flag} {name}: {error}; or frequency, or amplitude"))),
    }
}

/// What was found.
struct Found {
    branch: Branch,
    doubled: Vec<Branch>,
    curves: Option<Curves>,
}

/// The curves of a branch's folds and period doublings, in the plane of two coordinates.
struct Curves {
    coordinates: [Coordinate; 2],
    curves: Vec<(BifurcationKind, SingularCurve)>,
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
    let (found, wall_s) = timed(|| follow(&forced, asked, &options, &mut early));
    let found = found?;
    let branch = &found.branch;
    let mut configuration = configuration::of_arm(scenario)?;
    configuration["continue"] = json!({
        "parameter": asked.coordinate.to_string(), "from": asked.ends[0], "to": asked.ends[1],
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
        peaks: branch.peaks.iter().zip(&read).map(|(orbit, of)| peak(branch, orbit, of, &read)).collect(),
        doubled: found.doubled.iter().map(|branch| doubled(branch, &read)).collect(),
        curves: found.curves.as_ref().map(|curves| curves.document(&read)),
        ended_early: early.document(),
        wall_s,
    };
    let label = label(scenario, tested);
    let branches = || core::iter::once(branch).chain(&found.doubled);
    let drawn = || (figure(&found, asked, &read, &label), tables(branches(), &read));
    let mut files = output::plot(asked.plot, &document, drawn)?;
    if let (Some(stem), Some(curves)) = (asked.plot, &found.curves) {
        let stem = beside(stem, "-curves");
        files.extend(output::draw(curves.figure(asked, &label), &stem)?);
        files.push(output::write(beside(&stem, ".csv"), &curves.table(&read))?);
    }
    asked.json.show(&document, || text(&found, asked, &read, wall_s), &files)?;
    early.verdict()
}

/// The branch, and what leaves it.
fn follow(forced: &Forced, asked: &Asked<'_>, options: &TraceOptions, early: &mut Early) -> Result<Found, Failure> {
    let name = asked.coordinate.to_string();
    let branch = early.keep(&name, trace(forced, asked.frequency_hz, asked.coordinate, options))?;
    let mut doubled = Vec::new();
    if asked.doubled {
        for walked in trace_doublings(forced, &branch, asked.coordinate, options) {
            doubled.extend(early.keep_any(&name, walked)?);
        }
    }
    let Some((second, to)) = asked.curves else { return Ok(Found { branch, doubled, curves: None }) };
    let coordinates = [asked.coordinate, second];
    // They begin at the value on the branch, whichever that is.
    let mut along = TraceOptions::new(forced, second, [0.0, to], options.read.clone());
    along.branch = (asked.settings)(along.branch)?;
    let largest_step = &mut along.branch.continuation.largest_step;
    *largest_step = largest_step.min(LARGEST_STEP);
    let mut curves = Vec::new();
    for (kind, traced) in trace_singular_curves(forced, &branch, coordinates, &along) {
        curves.extend(early.keep_any(&second.to_string(), traced)?.map(|curve| (kind, curve)));
    }
    Ok(Found { branch, doubled, curves: Some(Curves { coordinates, curves }) })
}

/// A doubled branch.
fn doubled(branch: &Branch, read: &Read<'_>) -> Value {
    let points: Vec<Value> = branch.orbits.iter().map(|orbit| point(orbit, read)).collect();
    let bifurcations: Vec<Value> = branch.bifurcations.iter().map(|found| bifurcation(found, read)).collect();
    json!({ "points": points, "bifurcations": bifurcations })
}

/// The unit of a coordinate; empty if it has none.
fn unit(coordinate: Coordinate, drive: Dof) -> &'static str {
    match coordinate {
        Coordinate::FrequencyHz => "Hz",
        Coordinate::Amplitude => load_unit(drive),
        Coordinate::Parameter(parameter) => parameter.unit(),
    }
}

/// The name of a coordinate in figures, with its unit.
fn title(coordinate: Coordinate, (drive, name): (Dof, &str)) -> String {
    match coordinate {
        Coordinate::FrequencyHz => String::from("excitation frequency (Hz)"),
        Coordinate::Amplitude => format!("load at {name} ({})", load_unit(drive)),
        Coordinate::Parameter(parameter) => match parameter.unit() {
            "" => parameter.to_string(),
            unit => format!("{parameter} ({unit})"),
        },
    }
}

impl Curves {
    /// A point of a curve: both coordinates by their names, and the readings.
    fn point(&self, point: &SingularPoint, read: &Read<'_>) -> Value {
        let [first, second] = self.coordinates.map(|coordinate| coordinate.to_string());
        let mut document = json!({ "readings": readings(&point.orbit.readings, read) });
        document[first] = json!(point.lambda);
        document[second] = json!(point.mu);
        document
    }

    fn document(&self, read: &Read<'_>) -> Value {
        let turn = |turn: &Turn| {
            let mut document = self.point(&turn.point, read);
            document["kind"] = json!(turn_name(turn));
            document
        };
        let curve = |(kind, curve): &(BifurcationKind, SingularCurve)| {
            let points: Vec<Value> = curve.points.iter().map(|point| self.point(point, read)).collect();
            let turns: Vec<Value> = curve.turns.iter().map(turn).collect();
            json!({ "kind": kind.name(), "points": points, "turns": turns })
        };
        Value::Array(self.curves.iter().map(curve).collect())
    }

    /// CSV: a line for each point; `curve` counts from 0.
    fn table(&self, read: &Read<'_>) -> String {
        let [first, second] = self.coordinates.map(|coordinate| coordinate.to_string().replace('.', "_"));
        let mut text = format!("curve,kind,{first},{second}");
        for (dof, name) in read {
            text += &format!(",{}_amplitude_{}", name.replace('.', "_"), displacement_unit(*dof));
        }
        text.push('\n');
        for (number, (kind, curve)) in self.curves.iter().enumerate() {
            for SingularPoint { lambda, mu, orbit } in &curve.points {
                text += &format!("{number},{},{lambda},{mu}", kind.name());
                orbit.readings.iter().for_each(|of| text += &format!(",{:e}", amplitude(&of.harmonic1)));
                text.push('\n');
            }
        }
        text
    }

    fn text(&self, drive: Dof) -> String {
        if self.curves.is_empty() {
            return String::from("no fold or period doubling to follow\n");
        }
        let names = self.coordinates.map(|coordinate| coordinate.to_string());
        let units = self.coordinates.map(|coordinate| unit(coordinate, drive));
        let value =
            |which: usize, value: f64| format!("{} {value:.7} {}", names[which], units[which]).trim_end().to_owned();
        let place = |point: &SingularPoint| format!("{}, {}", value(0, point.lambda), value(1, point.mu));
        let mut text = String::new();
        for (kind, SingularCurve { points, turns, .. }) in &self.curves {
            let [first, last] = [points.first(), points.last()].map(|end| end.map_or_else(String::new, place));
            text += &format!("curve of {}s, {} points: from {first} to {last}\n", kind.name(), points.len());
            for turn in turns {
                text += &format!("  {} at {}\n", turn_name(turn), place(&turn.point));
            }
        }
        text
    }

    /// The plane of both coordinates with the curves in it.
    fn figure(&self, asked: &Asked<'_>, label: &str) -> Figure {
        let [x, y] = self.coordinates.map(|coordinate| title(coordinate, asked.drive));
        let mut panel = Panel::new(Axis::linear(x), Axis::linear(y));
        for (kind, label, color, dash) in [
            (BifurcationKind::Fold, "fold", Color::Black, Dash::Solid),
            (BifurcationKind::PeriodDoubling, "period doubling", Color::Vermillion, Dash::Chain),
        ] {
            let of_kind = self.curves.iter().filter(|(of, _)| *of == kind);
            for (k, (_, curve)) in of_kind.enumerate() {
                let line = Series::line(label, color, curve.points.iter().map(|p| (p.lambda, p.mu)).collect())
                    .style(Style::Line { color, width: 1.6, dash });
                panel = panel.with(if k == 0 { line } else { line.unlabelled() });
            }
        }
        let starts =
            self.curves.iter().flat_map(|(_, curve)| curve.on_the_branch()).map(|p| (p.lambda, p.mu)).collect();
        panel = panel.with_any(Series::markers("on the branch", Color::Grey, Marker::Circle, starts));
        let cusps = self.curves.iter().flat_map(|(_, curve)| &curve.turns).filter(|turn| turn.is_cusp);
        let cusps = cusps.map(|turn| (turn.point.lambda, turn.point.mu)).collect();
        panel = panel.with_any(Series::markers("cusp", Color::Black, Marker::Diamond, cusps));
        let (_, name) = asked.drive;
        let title = "Bifurcations of periodic motions in two parameters";
        Figure::new(title).subtitle(format!("{label}, driven at {name}")).with(panel)
    }
}

fn turn_name(turn: &Turn) -> &'static str {
    if turn.is_cusp { "cusp" } else { "turn" }
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
        "value": orbit.value, "frequency_hz": orbit.frequency_hz, "drive": orbit.drive, "period": orbit.period,
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
fn text(found: &Found, asked: &Asked<'_>, read: &Read<'_>, wall_s: f64) -> String {
    let branch = &found.branch;
    let mut text = format!("{} motions in {wall_s:.3} s\n", branch.orbits.len());
    if asked.assess == Assess::Nothing {
        text += "stability not computed: bifurcations other than folds are not found\n";
    }
    let unit = unit(asked.coordinate, asked.drive.0);
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
    for (k, branch) in (1..).zip(&found.doubled) {
        text += &format!("doubled branch {k}: {} motions\n", branch.orbits.len());
        for found in &branch.bifurcations {
            let (kind, orbit) = (found.kind.name(), &found.orbit);
            text += &format!("  {kind} at {:.7} {unit}: {}\n", orbit.value, readings(orbit));
        }
    }
    text + &found.curves.as_ref().map_or_else(String::new, |curves| curves.text(asked.drive.0))
}

/// CSV: a line for each motion.
pub(super) fn table(branch: &Branch, read: &Read<'_>) -> String {
    tables(core::iter::once(branch), read)
}

/// The same of several branches, one after the other.
fn tables<'a>(branches: impl Iterator<Item = &'a Branch>, read: &Read<'_>) -> String {
    let mut text = String::from("value,frequency_hz,drive,stable");
    for (dof, name) in read {
        let (name, unit) = (name.replace('.', "_"), displacement_unit(*dof));
        text += &format!(",{name}_largest_{unit},{name}_mean_{unit},{name}_amplitude_{unit},{name}_phase_deg");
    }
    text.push('\n');
    for orbit in branches.flat_map(|branch| &branch.orbits) {
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
fn figure(found: &Found, asked: &Asked<'_>, read: &Read<'_>, label: &str) -> Figure {
    let (drive, name) = asked.drive;
    let panels = displacement_panels(&title(asked.coordinate, asked.drive), read, |panel, index, name, color| {
        let panel = with_branch(panel, &found.branch, index, name, color);
        let twice = format!("{name}, two periods");
        found.doubled.iter().fold(panel, |panel, branch| with_branch(panel, branch, index, &twice, color))
    });
    let load = match asked.coordinate {
        Coordinate::FrequencyHz => format!("{} {} at {name}", asked.amplitude, load_unit(drive)),
        Coordinate::Amplitude => format!("{} Hz at {name}", asked.frequency_hz),
        Coordinate::Parameter(_) => {
            format!("{} {} at {name}, {} Hz", asked.amplitude, load_unit(drive), asked.frequency_hz)
        }
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
