//! Branches as figures: stable blue, unstable red, as the paper has them.

use super::captions;
use crate::analysis::{Branch, Orbit};
use crate::plot::{Axis, Color, Figure, Legend, Marker, Panel, Series};
use crate::scenario::Scenario;

/// Two panels, |α1| and |α2| over what varies.
pub(super) fn figure(scenario: &Scenario, axis_label: &str, branches: &[&Branch]) -> Figure {
    let mut figure = Figure::new("Periodic motions of the forced arm").subtitle(captions::pose(&scenario.arm));
    for joint in 0..2 {
        let panel = Panel::new(Axis::linear(axis_label), Axis::linear(captions::largest(joint)));
        let panel = if joint == 1 { panel.legend(Legend::None) } else { panel };
        figure = figure.with(with_branches(panel, branches, joint));
    }
    figure
}

/// The panel with the branches of one joint's amplitude and their bifurcations.
pub(super) fn with_branches(mut panel: Panel, branches: &[&Branch], joint: usize) -> Panel {
    for (k, branch) in branches.iter().enumerate() {
        for (label, color, stable) in [("stable", Color::Stable, true), ("unstable", Color::Unstable, false)] {
            let series = Series::line(label, color, pieces(&branch.orbits, joint, stable));
            panel = panel.with(if k == 0 { series } else { series.unlabelled() });
        }
    }
    for (name, shape) in [
        ("fold", Marker::Circle),
        ("period-doubling", Marker::Square),
        ("neimark-sacker", Marker::Triangle),
        ("branch-point", Marker::Diamond),
    ] {
        let events = branches.iter().flat_map(|branch| &branch.bifurcations).filter(|event| event.kind.name() == name);
        let points: Vec<_> = events.map(|event| (event.orbit.value, event.orbit.amplitude_rad[joint])).collect();
        if !points.is_empty() {
            panel = panel.with(Series::markers(name.replace('-', " "), Color::Black, shape, points));
        }
    }
    panel
}

/// The stretches of one stability, with gaps between them. Each reaches to its neighbour, so that no gap shows at a change.
fn pieces(orbits: &[Orbit], joint: usize, stable: bool) -> Vec<(f64, f64)> {
    let is = |k: usize| orbits.get(k).is_some_and(|orbit| orbit.is_stable() == stable);
    let mut points = Vec::new();
    for (k, orbit) in orbits.iter().enumerate() {
        // The unstable stretch takes the segments at its ends.
        let drawn = is(k) || (!stable && (is(k + 1) || (k > 0 && is(k - 1))));
        let value = if drawn { orbit.amplitude_rad[joint] } else { f64::NAN };
        points.push((orbit.value, value));
    }
    points
}
