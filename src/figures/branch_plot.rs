//! Branches as figures: stable blue, unstable red and dashed, those of doubled period in thin lines.

use resonarm::analysis::{self, BifurcationKind, Branch, Row};
use resonarm_figures::plot::{Axis, Color, Figure, Marker, Panel, Series, Style, Subtitle};

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

/// The branches in such panels.
pub(crate) fn figure(conditions: Subtitle, x: &str, branches: &[&Branch]) -> Figure {
    let figure = Figure::new("Periodic motions of the forced arm").subtitle(conditions);
    of_joints(figure, x, |panel, joint| with_branches(panel, branches, joint))
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

/// The panel with the branches of one joint's amplitude and their bifurcations: the first branch, then those of doubled
/// period.
pub(crate) fn with_branches(mut panel: Panel, branches: &[&Branch], joint: usize) -> Panel {
    for (k, branch) in branches.iter().enumerate() {
        for series in
            [Series::stable(stretches(branch, joint, true)), Series::unstable(stretches(branch, joint, false))]
        {
            panel = panel.with(match k {
                0 => series,
                1 => doubled(series),
                _ => doubled(series).unlabelled(),
            });
        }
    }
    for (kind, label, shape) in BIFURCATIONS {
        let events = branches.iter().flat_map(|branch| &branch.bifurcations).filter(|event| event.kind == kind);
        let points: Vec<_> = events.map(|event| (event.orbit.value, event.orbit.amplitude_rad[joint])).collect();
        panel = panel.with_any(Series::markers(label, Color::Black, shape, points));
    }
    panel
}

/// The series in the style of a doubled branch.
fn doubled(series: Series) -> Series {
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

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm::analysis::{BranchOptions, Coordinate, ForcedArm, trace, trace_doublings};
    use resonarm::arm::{Arm, Load, Pose, Preset};
    use resonarm_figures::plot::Dash;

    /// Strong excitation at the 1:2 resonance, and its branch.
    fn strongly_forced() -> (ForcedArm, Branch) {
        let pose = Pose { beta1_deg: 0.0, beta2_deg: 75.0 };
        let arm = Arm::new(Preset::Irb1600Fitted.parameters().unwrap(), pose).unwrap();
        let forced = ForcedArm::new(arm, Load::torque_nm(1.0, 0.0), 800.0);
        let options = BranchOptions::new(46.0, 50.0);
        let branch = trace(forced.clone(), 46.0, Coordinate::FrequencyHz, &options).unwrap();
        (forced, branch)
    }

    /// Without colours, the lines still differ: by stability in their dashes, by period in their widths.
    #[test]
    fn lines_differ_without_colours() {
        let (forced, branch) = strongly_forced();
        let options = BranchOptions::new(46.0, 50.0);
        let doubled = trace_doublings(&forced, &branch, Coordinate::FrequencyHz, &options);
        let doubled: Vec<Branch> = doubled.into_iter().map(Result::unwrap).collect();
        let branches: Vec<&Branch> = core::iter::once(&branch).chain(&doubled).collect();
        let panel = with_branches(Panel::new(Axis::linear("x"), Axis::linear("y")), &branches, 0);
        let lines = panel.series.iter().filter_map(|series| match series.style {
            Style::Line { width, dash, .. } => Some((series.label.as_deref().unwrap_or(""), dash, width)),
            Style::Markers { .. } | Style::Tiles { .. } => None,
        });
        let expected = [
            ("stable", Dash::Solid, 1.6),
            ("unstable", Dash::Dashed, 1.6),
            ("stable, two periods", Dash::Solid, 0.8),
            ("unstable, two periods", Dash::Dashed, 0.8),
        ];
        assert_eq!(lines.collect::<Vec<_>>(), expected);
    }

    /// The colours change at the period doublings, although the continuation has no motion exactly there.
    #[test]
    fn colours_change_at_the_bifurcations() {
        let (_, branch) = strongly_forced();
        let doublings: Vec<f64> = branch.bifurcations.iter().map(|event| event.orbit.value).collect();
        assert!((doublings[0] - 46.1742).abs() < 1e-3 && (doublings[1] - 46.3572).abs() < 1e-3, "{doublings:?}");
        let unstable = stretches(&branch, 1, false);
        let hz: Vec<f64> = unstable.iter().map(|point| point.0).filter(|hz| hz.is_finite()).collect();
        assert_eq!((hz.first(), hz.last()), (doublings.first(), doublings.last()));
    }
}
