//! Branches of the two-link arm as figures: stable blue, unstable red and dashed.

use resonarm::analysis::{self, BifurcationKind, Branch, Row};
use resonarm_figures::plot::{Axis, Color, Figure, Marker, Panel, Series, Style};

use crate::figures::captions;

/// The figure with two panels, |α1| and |α2| over what `x` says. The legend is in the first; that of the second has only
/// what the first lacks.
pub(crate) fn of_joints(figure: Figure, x: &str, drawn: impl Fn(Panel, usize) -> Panel) -> Figure {
    let panel = |joint| drawn(Panel::new(Axis::linear(x), Axis::linear(captions::largest(joint))), joint);
    let (first, mut second) = (panel(0), panel(1));
    let known = |label: &Option<String>| first.series.iter().any(|series| series.label == *label);
    for series in &mut second.series {
        if known(&series.label) {
            series.label = None;
        }
    }
    figure.with(first).with(second)
}

/// Width of the lines of doubled branches, px: half of that of the others.
const THIN: f64 = 0.8;

/// The kinds of bifurcation with their label and mark.
pub(crate) const BIFURCATIONS: [(BifurcationKind, &str, Marker); 4] = [
    (BifurcationKind::Fold, "fold", Marker::Circle),
    (BifurcationKind::PeriodDoubling, "period doubling", Marker::Square),
    (BifurcationKind::NeimarkSacker, "Neimark–Sacker", Marker::Triangle),
    (BifurcationKind::BranchPoint, "branch point", Marker::Diamond),
];

/// The panel with a branch of one joint's amplitude and its bifurcations.
pub(crate) fn with_branch(mut panel: Panel, branch: &Branch, joint: usize) -> Panel {
    panel = panel.with(Series::stable(stretches(branch, joint, true)));
    panel = panel.with(Series::unstable(stretches(branch, joint, false)));
    for (kind, label, shape) in BIFURCATIONS {
        let found = branch.bifurcations.iter().filter(|found| found.kind == kind);
        let points: Vec<_> = found.map(|found| (found.orbit.value, found.orbit.amplitude_rad[joint])).collect();
        panel = panel.with_any(Series::markers(label, Color::Black, shape, points));
    }
    panel
}

/// The series in the style of a doubled branch.
pub(crate) fn doubled(series: Series) -> Series {
    let label = series.label.map(|label| format!("{label}, two periods"));
    let style = match series.style {
        Style::Line { color, dash, .. } => Style::Line { color, width: THIN, dash },
        other @ (Style::Markers { .. } | Style::Tiles { .. }) => other,
    };
    Series { label, style, ..series }
}

/// A joint's amplitude where the branch has this stability, with gaps between.
fn stretches(branch: &Branch, joint: usize, stable: bool) -> Vec<(f64, f64)> {
    let at = |row: &Row| (row.orbit.value, row.orbit.amplitude_rad[joint]);
    analysis::stretches(&branch.rows(), Row::stable, stable, at)
}
