//! Curves of folds and period doublings in the plane of two coordinates.

use clap::Args;
use serde_json::{Value, json};

use crate::drive::Drive;
use crate::failure::Failure;
use crate::help::heading;
use crate::read_at::{ReadAt, amplitude, readings};
use resonarm::analysis::{BifurcationKind, Coordinate, SingularCurve, SingularPoint, Turn};
use resonarm::structure::Assembly;
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Marker, Panel, Series, Style, Subtitle};
use resonarm_numeric::number::rounded;

/// Which second parameter the bifurcations of the branch are followed in, and how far.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::COMPUTATION)]
pub(crate) struct CurveFlags {
    /// Second parameter in which to follow folds and period doublings.
    ///
    /// It is named as for --parameter.
    #[arg(long, value_name = "NAME", requires = "curves_to")]
    curves_in: Option<String>,
    /// Value of the second parameter at which these curves end.
    ///
    /// They begin at its value on the branch.
    #[arg(long, value_name = "X", requires = "curves_in")]
    curves_to: Option<f64>,
}

/// Returns the coordinate that a flag names: `frequency`, `amplitude` or a parameter of the structure.
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

/// Returns the unit of a coordinate; empty if it has none.
pub(crate) fn unit(coordinate: Coordinate, drive: &Drive) -> &'static str {
    match coordinate {
        Coordinate::FrequencyHz => "Hz",
        Coordinate::Amplitude => drive.unit(),
        Coordinate::Parameter(parameter) => parameter.unit(),
    }
}

/// Returns the name of a coordinate in figures, with its unit.
pub(crate) fn title(coordinate: Coordinate, drive: &Drive) -> String {
    match coordinate {
        Coordinate::FrequencyHz => String::from("excitation frequency (Hz)"),
        Coordinate::Amplitude => format!("load at {} ({})", drive.loads[0].at.name, drive.unit()),
        Coordinate::Parameter(parameter) => match parameter.unit() {
            "" => parameter.to_string(),
            unit => format!("{parameter} ({unit})"),
        },
    }
}

/// A curve of one kind of bifurcation.
pub(crate) struct BifurcationCurve {
    pub kind: BifurcationKind,
    pub curve: SingularCurve,
}

/// The curves of a branch's folds and period doublings.
pub(crate) struct Curves {
    pub coordinates: [Coordinate; 2],
    pub curves: Vec<BifurcationCurve>,
}

/// The largest step along a curve, relative to its local size: short enough for a smooth drawing.
pub(crate) const LARGEST_STEP: f64 = 0.08;

impl CurveFlags {
    /// Returns the second coordinate, which is not the first, and the value at which the curves end, if curves are
    /// wanted.
    pub fn second(&self, first: Coordinate, assembly: &Assembly) -> Result<Option<(Coordinate, f64)>, Failure> {
        let (Some(name), Some(to)) = (&self.curves_in, self.curves_to) else { return Ok(None) };
        let second = coordinate("--curves-in", name, assembly)?;
        if second == first {
            return Err(Failure::usage(format!(
                "--curves-in {name} is the quantity in which the branch is followed already: choose another"
            )));
        }
        Ok(Some((second, to)))
    }
}

impl Curves {
    /// Returns a point of a curve: both coordinates by their names, and the readings.
    fn point(&self, point: &SingularPoint, read: &[ReadAt]) -> Value {
        let [first, second] = self.coordinates.map(|coordinate| coordinate.to_string());
        let mut document = json!({ "readings": readings(&point.orbit.readings, read) });
        document[first] = json!(point.lambda);
        document[second] = json!(point.mu);
        document
    }

    /// Returns the curves as a document.
    pub fn document(&self, read: &[ReadAt]) -> Value {
        let turn = |turn: &Turn| {
            let mut document = self.point(&turn.point, read);
            document["kind"] = json!(turn_name(turn));
            document
        };
        let curve = |BifurcationCurve { kind, curve }: &BifurcationCurve| {
            let points: Vec<Value> = curve.points.iter().map(|point| self.point(point, read)).collect();
            let turns: Vec<Value> = curve.turns.iter().map(turn).collect();
            json!({ "kind": kind.name(), "points": points, "turns": turns })
        };
        Value::Array(self.curves.iter().map(curve).collect())
    }

    /// Returns a line for each point, with the units in the names of the columns; `curve` counts from 0.
    pub fn table(&self, read: &[ReadAt]) -> String {
        let [first, second] = self.coordinates.map(|coordinate| coordinate.to_string().replace('.', "_"));
        let mut text = format!("curve,kind,{first},{second}");
        read.iter().for_each(|at| text += &format!(",{}_amplitude_{}", at.column(), at.unit()));
        text.push('\n');
        for (number, BifurcationCurve { kind, curve }) in self.curves.iter().enumerate() {
            for SingularPoint { lambda, mu, orbit } in &curve.points {
                text += &format!("{number},{},{lambda},{mu}", kind.name());
                orbit.readings.iter().for_each(|reading| text += &format!(",{:e}", amplitude(reading)));
                text.push('\n');
            }
        }
        text
    }

    /// Lists the ends and turns of each curve.
    pub fn text(&self, drive: &Drive) -> String {
        if self.curves.is_empty() {
            return String::from("no fold or period doubling to follow\n");
        }
        let names = self.coordinates.map(|coordinate| coordinate.to_string());
        let units = self.coordinates.map(|coordinate| unit(coordinate, drive));
        let value = |which: usize, value: f64| {
            // A parameter without a unit leaves a blank at the end.
            format!("{} {} {}", names[which], rounded(&value, 7), units[which]).trim_end().to_owned()
        };
        let place = |point: &SingularPoint| format!("{}, {}", value(0, point.lambda), value(1, point.mu));
        let mut text = String::new();
        for BifurcationCurve { kind, curve: SingularCurve { points, turns, .. } } in &self.curves {
            let [first, last] = [points.first(), points.last()].map(|end| end.map_or_else(String::new, place));
            text += &format!("curve of {}s, {} points: from {first} to {last}\n", kind.name(), points.len());
            for turn in turns {
                text += &format!("  {} at {}\n", turn_name(turn), place(&turn.point));
            }
        }
        text
    }

    /// Draws the plane of both coordinates with the curves in it.
    pub fn figure(&self, conditions: Subtitle, drive: &Drive) -> Figure {
        let [x, y] = self.coordinates.map(|coordinate| title(coordinate, drive));
        let mut panel = Panel::new(Axis::linear(x), Axis::linear(y));
        for (kind, label, color, dash) in [
            (BifurcationKind::Fold, "fold", Color::Black, Dash::Solid),
            (BifurcationKind::PeriodDoubling, "period doubling", Color::Vermillion, Dash::Chain),
        ] {
            let of_kind = self.curves.iter().filter(|curve| curve.kind == kind);
            for (k, curve) in of_kind.enumerate() {
                let line = Series::line(label, color, curve.curve.points.iter().map(|p| (p.lambda, p.mu)).collect())
                    .style(Style::Line { color, width: 1.6, dash });
                panel = panel.with(if k == 0 { line } else { line.unlabelled() });
            }
        }
        // A curve that returns to the branch also ends on it.
        let starts =
            self.curves.iter().flat_map(|curve| curve.curve.on_the_branch()).map(|p| (p.lambda, p.mu)).collect();
        panel = panel.with_any(Series::markers("on the branch", Color::Grey, Marker::Circle, starts));
        let cusps = self.curves.iter().flat_map(|curve| &curve.curve.turns).filter(|turn| turn.is_cusp);
        let cusps = cusps.map(|turn| (turn.point.lambda, turn.point.mu)).collect();
        panel = panel.with_any(Series::markers("cusp", Color::Black, Marker::Diamond, cusps));
        Figure::new("Bifurcations of periodic responses in two parameters").subtitle(conditions).with(panel)
    }
}

fn turn_name(turn: &Turn) -> &'static str {
    if turn.is_cusp { "cusp" } else { "turn" }
}
