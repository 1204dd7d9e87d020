//! Curves of folds and period doublings in the plane of two parameters.

use clap::Args;
use serde_json::{Value, json};

use crate::continuation_flags::ContinuationFlags;
use crate::drive::DriveFlags;
use crate::ended_early::Early;
use crate::failure::Failure;
use crate::quantity::Quantity;
use resonarm::analysis::{
    BifurcationKind, Branch, BranchOptions, ForcedArm, SingularCurve, SingularPoint, Turn, trace_singular_curves,
};
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Marker, Panel, Series, Style, Subtitle};

/// Which second parameter the bifurcations of the branch are followed in, and how far.
#[derive(Clone, Debug, Args)]
pub(crate) struct CurveFlags {
    /// Also follow the folds and period doublings of the branch in a second parameter: a name as for --parameter.
    #[arg(long, value_name = "NAME", requires = "curves_to")]
    curves_in: Option<String>,
    /// Where the curves end, in the unit of the second parameter; they begin at its value on the branch.
    #[arg(long, value_name = "X", requires = "curves_in")]
    curves_to: Option<f64>,
}

/// The curves of a branch's bifurcations, in the plane of two quantities.
pub(crate) struct Curves {
    first: Quantity,
    second: Quantity,
    curves: Vec<BifurcationCurve>,
}

struct BifurcationCurve {
    kind: BifurcationKind,
    curve: SingularCurve,
}

/// The largest step along a curve, relative to its local size: short enough for a smooth drawing.
pub(crate) const LARGEST_STEP: f64 = 0.08;

impl CurveFlags {
    /// The second parameter's name and where the curves end, if curves are wanted.
    pub fn given(&self) -> Option<(&str, f64)> {
        Some((self.curves_in.as_deref()?, self.curves_to?))
    }

    /// The second quantity and where the curves end, if curves are wanted.
    pub fn second(&self, first: &Quantity, drive: &DriveFlags) -> Result<Option<(Quantity, f64)>, Failure> {
        let Some((name, to)) = self.given() else { return Ok(None) };
        let second = Quantity::parse("--curves-in", name, drive)?;
        if second.name == first.name {
            return Err(Failure::usage(format!(
                "--curves-in {name} is what the branch is followed in already: name another parameter"
            )));
        }
        Ok(Some((second, to)))
    }
}

impl Curves {
    /// Follows each fold and each period doubling of the branch in `second` from its value there to `to`. A curve that
    /// returns through another of them represents both.
    pub fn trace(
        forced: &ForcedArm,
        branch: &Branch,
        first: Quantity,
        (second, to): (Quantity, f64),
        flags: &ContinuationFlags,
        early: &mut Early,
    ) -> Result<Curves, Failure> {
        let mut options = flags.options(BranchOptions::new(0.0, to))?;
        let largest_step = &mut options.continuation.largest_step;
        *largest_step = largest_step.min(LARGEST_STEP);
        let traced = trace_singular_curves(forced, branch, first.coordinate, second.coordinate, &options);
        let mut curves = Vec::new();
        for (kind, traced) in traced {
            curves.extend(early.keep_any(second.name, traced)?.map(|curve| BifurcationCurve { kind, curve }));
        }
        Ok(Curves { first, second, curves })
    }

    pub fn document(&self) -> Value {
        let point = |point: &SingularPoint| {
            let mut document = json!({ "harmonic1_rad": point.harmonic1_rad });
            document[self.first.name] = json!(point.lambda);
            document[self.second.name] = json!(point.mu);
            document
        };
        let turn = |turn: &Turn| {
            let mut document = point(&turn.point);
            document["kind"] = json!(turn_name(turn));
            document
        };
        let curve = |BifurcationCurve { kind, curve }: &BifurcationCurve| {
            let points: Vec<Value> = curve.points.iter().map(point).collect();
            let turns: Vec<Value> = curve.turns.iter().map(turn).collect();
            json!({ "kind": kind.name(), "points": points, "turns": turns })
        };
        Value::Array(self.curves.iter().map(curve).collect())
    }

    /// A line for each point, with the units in the names of the columns. `curve` counts from 0.
    pub fn csv(&self) -> String {
        let (first, second) = (self.first.name, self.second.name);
        let mut text = format!("curve,kind,{first},{second},harmonic1_alpha1_rad,harmonic1_alpha2_rad\n");
        for (number, BifurcationCurve { kind, curve }) in self.curves.iter().enumerate() {
            for SingularPoint { lambda, mu, harmonic1_rad: [h1, h2], .. } in &curve.points {
                text += &format!("{number},{},{lambda},{mu},{h1},{h2}\n", kind.name());
            }
        }
        text
    }

    pub fn text(&self) -> String {
        let (first, second) = (self.first.name, self.second.name);
        if self.curves.is_empty() {
            return String::from("no fold or period doubling to follow\n");
        }
        let mut text = String::new();
        for BifurcationCurve { kind, curve: SingularCurve { points, turns, .. } } in &self.curves {
            let place = |point: &SingularPoint| format!("{first} = {:.6}, {second} = {:.6}", point.lambda, point.mu);
            let ends = [points.first(), points.last()].map(|end| end.map_or_else(String::new, place));
            text += &format!("curve of {}s: {} points from {} to {}\n", kind.name(), points.len(), ends[0], ends[1]);
            for turn in turns {
                let SingularPoint { lambda, mu, .. } = turn.point;
                text += &format!("  {} at {first} = {lambda:.9}, {second} = {mu:.9}\n", turn_name(turn));
            }
        }
        text
    }

    /// The plane of both quantities with the curves in it.
    pub fn figure(&self, conditions: Subtitle) -> Figure {
        let mut panel = Panel::new(Axis::linear(&self.first.label), Axis::linear(&self.second.label));
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
        Figure::new("Bifurcations of the forced arm in two parameters").subtitle(conditions).with(panel)
    }
}

fn turn_name(turn: &Turn) -> &'static str {
    if turn.is_cusp { "cusp" } else { "turn" }
}
