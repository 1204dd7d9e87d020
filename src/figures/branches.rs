//! Branches of periodic responses as figures, stable blue, unstable red and dashed, those that leave others or have
//! another period in thin lines; and as tables.

use resonarm::analysis::{self, BifurcationKind, Branch, Coordinate, Orbit, Stability, Verdict};
use resonarm_figures::plot::{Axis, Color, Figure, Marker, Panel, Series, Style};

use crate::read_at::{ReadAt, cells, columns};

/// Width of the lines of branches that leave others or have another period, px: half of that of the others.
const THIN: f64 = 0.8;

/// The kinds of bifurcation with their label and mark.
const BIFURCATIONS: [(BifurcationKind, &str, Marker); 4] = [
    (BifurcationKind::Fold, "fold", Marker::Circle),
    (BifurcationKind::PeriodDoubling, "period doubling", Marker::Square),
    (BifurcationKind::NeimarkSacker, "Neimark–Sacker", Marker::Triangle),
    (BifurcationKind::BranchPoint, "branch point", Marker::Diamond),
];

/// A row of a branch: a response, or a bifurcation in its place.
struct Row<'a> {
    orbit: &'a Orbit,
    /// The kind of bifurcation, if the row is one.
    bifurcation: Option<BifurcationKind>,
}

impl Row<'_> {
    /// Returns the verdict on the response; `None` at a bifurcation.
    fn verdict(&self) -> Option<Verdict> {
        self.orbit.stability.as_ref().filter(|_| self.bifurcation.is_none()).map(Stability::verdict)
    }

    /// Says whether the response is drawn as stable; `None` at a bifurcation.
    fn stable(&self) -> Option<bool> {
        self.verdict().map(|verdict| verdict == Verdict::Stable)
    }

    /// Says whether the response is not drawn as unstable; `None` at a bifurcation.
    fn not_unstable(&self) -> Option<bool> {
        self.verdict().map(|verdict| verdict != Verdict::Unstable)
    }

    /// Says whether the response is neither stable nor unstable: `None` if it is stable, so that a line from there to
    /// such a response counts as one of these; and at a bifurcation.
    fn neither(&self) -> Option<bool> {
        match self.verdict()? {
            Verdict::Stable => None,
            Verdict::Unstable => Some(false),
            Verdict::Undecided | Verdict::Conservative => Some(true),
        }
    }

    /// Returns the stability in words; empty if it is not computed.
    fn stability(&self) -> &'static str {
        match (&self.orbit.stability, self.bifurcation) {
            (Some(stability), None) => stability.verdict().name(),
            (None, None) => "",
            (_, Some(_)) => "marginal",
        }
    }
}

/// Returns the responses of a branch with its bifurcations in their places.
fn rows(branch: &Branch) -> Vec<Row<'_>> {
    branch.with_bifurcations(|orbit, bifurcation| Row { orbit, bifurcation })
}

/// Adds to a figure a panel for each degree of freedom that is read, its largest displacement over what `x` says. The
/// legend is in the first; those of the others have only what it lacks.
pub(crate) fn of_each(mut figure: Figure, x: &str, read: &[ReadAt], drawn: impl Fn(Panel, usize) -> Panel) -> Figure {
    figure.columns = if read.len() > 3 { 2 } else { 1 };
    let mut known: Vec<Option<String>> = Vec::new();
    for (index, at) in read.iter().enumerate() {
        let y = Axis::linear(format!("largest {} ({})", at.name, at.unit()));
        let mut panel = drawn(Panel::new(Axis::linear(x), y), index);
        let labels: Vec<_> = panel.series.iter().map(|series| series.label.clone()).collect();
        panel.series.iter_mut().filter(|series| known.contains(&series.label)).for_each(|series| series.label = None);
        known.extend(labels);
        figure = figure.with(panel);
    }
    figure
}

/// Adds to a panel the branches of the largest displacement of a degree of freedom, by its number among those that are
/// read, and their bifurcations: the first branch, then this many isolas, then those that leave others. The isolas of the
/// same period look as the first one.
pub(crate) fn with_branches(mut panel: Panel, branches: &[&Branch], isolas: usize, index: usize) -> Panel {
    let at = |row: &Row<'_>| (row.orbit.value, row.orbit.readings[index].largest);
    for (k, branch) in branches.iter().enumerate() {
        let rows = rows(branch);
        let period = branch.period().unwrap_or(1);
        // Without multipliers no orbit may look stable, so the line has a colour and a label of its own.
        let is_assessed = branch.orbits.iter().any(|orbit| orbit.stability.is_some());
        let lines = if is_assessed {
            let mut lines = vec![
                Series::stable(analysis::stretches(&rows, Row::stable, true, at)),
                Series::unstable(analysis::stretches(&rows, Row::not_unstable, false, at)),
            ];
            let neither = analysis::stretches(&rows, Row::neither, true, at);
            if !neither.is_empty() {
                let conservative = rows.iter().any(|row| row.verdict() == Some(Verdict::Conservative));
                let label = if conservative { "neither stable nor unstable" } else { "stability undecided" };
                lines.push(Series::line(label, Color::Black, neither));
            }
            lines
        } else {
            vec![Series::line("stability not computed", Color::Black, rows.iter().map(at).collect())]
        };
        for series in lines {
            let series = if k <= isolas && period == 1 { series } else { other(series, period) };
            let is_labelled = panel.series.iter().any(|known| known.label == series.label);
            panel = panel.with(if is_labelled { series.unlabelled() } else { series });
        }
    }
    for (kind, label, shape) in BIFURCATIONS {
        let found = branches.iter().flat_map(|branch| &branch.bifurcations).filter(|found| found.kind == kind);
        let points = found.map(|found| (found.orbit.value, found.orbit.readings[index].largest)).collect();
        panel = panel.with_any(Series::markers(label, Color::Black, shape, points));
    }
    panel
}

/// Returns the series in the style of a branch that leaves another one, or has another period, which is this one.
fn other(series: Series, period: usize) -> Series {
    let of_branch = match period {
        1 => String::from("other branches"),
        period => format!("{period} periods"),
    };
    let label = series.label.map(|label| format!("{label}, {of_branch}"));
    let style = match series.style {
        Style::Line { color, dash, .. } => Style::Line { color, width: THIN, dash },
        other @ (Style::Markers { .. } | Style::Tiles { .. }) => other,
    };
    Series { label, style, ..series }
}

/// Splits a branch into runs of responses of one stability; neighbours share a response.
pub(crate) fn stretches(branch: &Branch) -> Vec<(&[Orbit], Option<bool>)> {
    let orbits = &branch.orbits;
    let mut runs = Vec::new();
    let mut start = 0;
    for end in 1..=orbits.len() {
        if end == orbits.len() || orbits[end].is_stable() != orbits[start].is_stable() {
            // One orbit of the next run is included, so that the drawn line has no gap where the stability changes.
            runs.push((&orbits[start..(end + 1).min(orbits.len())], orbits[start].is_stable()));
            start = end;
        }
    }
    runs
}

/// Returns comma-separated values (RFC 4180), with the units in the names of the columns: a line for each response,
/// bifurcations in their places. `branch` is 0, and counts from 1 for the others; `drive` is the amplitude of the
/// first load.
pub(crate) fn table(coordinate: Coordinate, branches: &[&Branch], read: &[ReadAt]) -> String {
    let parameter = match coordinate {
        Coordinate::FrequencyHz | Coordinate::Amplitude => None,
        Coordinate::Parameter(parameter) => Some(parameter.to_string().replace('.', "_")),
    };
    let varied = parameter.as_ref().map_or(String::new(), |name| format!(",{name}"));
    let mut text =
        format!("branch{varied},frequency_hz,drive,largest_multiplier,stability,bifurcation{}\n", columns(read));
    for (number, branch) in branches.iter().enumerate() {
        for row in rows(branch) {
            let Orbit { value, frequency_hz, drive, readings, stability, .. } = row.orbit;
            let varied = parameter.as_ref().map_or(String::new(), |_name| format!(",{value}"));
            let largest = stability.as_ref().and_then(|of| of.multipliers.first());
            let largest = largest.map_or(String::new(), |mu| libm::hypot(mu.re, mu.im).to_string());
            let stability = row.stability();
            let kind = row.bifurcation.map_or("", BifurcationKind::name);
            text +=
                &format!("{number}{varied},{frequency_hz},{drive},{largest},{stability},{kind}{}\n", cells(readings));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm::analysis::{Forced, OtherOptions, TraceOptions, trace, trace_branches};
    use resonarm::scenario::Scenario;
    use resonarm_figures::plot::Dash;

    /// Strong excitation at the 1:2 resonance: its branch and those that leave it.
    fn strongly_forced() -> (Branch, Vec<Branch>) {
        let scenario = Scenario::parse("structure.angles_deg = [0, 75]", "test.toml").unwrap();
        let assembly = scenario.under_test().unwrap().assembly;
        let joint1 = assembly.dof("joint1").unwrap();
        let forced = Forced::new(assembly, joint1, 800.0);
        let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [46.0, 50.0], vec![joint1]);
        let branch = trace(&forced, 46.0, Coordinate::FrequencyHz, &options).unwrap();
        let leaving = OtherOptions { leaving: true, search: None };
        let switched = trace_branches(&forced, &branch, Coordinate::FrequencyHz, &options, &leaving);
        let switched = switched.branches.into_iter().map(|switched| switched.traced.unwrap()).collect();
        (branch, switched)
    }

    /// Without colours, the lines still differ: by stability in their dashes, by period in their widths. The colours
    /// change at the period doublings, although the continuation has no response exactly there.
    #[test]
    fn lines_differ_without_colours_and_change_at_the_bifurcations() {
        let (branch, switched) = strongly_forced();
        let branches: Vec<&Branch> = core::iter::once(&branch).chain(&switched).collect();
        let panel = with_branches(Panel::new(Axis::linear("x"), Axis::linear("y")), &branches, 0, 0);
        let lines = panel.series.iter().filter_map(|series| match series.style {
            Style::Line { width, dash, .. } => Some((series.label.as_deref().unwrap_or(""), dash, width)),
            Style::Markers { .. } | Style::Tiles { .. } => None,
        });
        let expected = [
            ("stable", Dash::Solid, 1.6),
            ("unstable", Dash::Dashed, 1.6),
            ("stable, 2 periods", Dash::Solid, 0.8),
            ("unstable, 2 periods", Dash::Dashed, 0.8),
        ];
        assert_eq!(lines.take(4).collect::<Vec<_>>(), expected);
        let found: Vec<f64> = branch.bifurcations.iter().map(|found| found.orbit.value).collect();
        assert!((found[0] - 46.1742).abs() < 1e-3 && (found[1] - 46.3572).abs() < 1e-3, "{found:?}");
        let unstable = panel.series.iter().find(|series| series.label.as_deref() == Some("unstable")).unwrap();
        let hz: Vec<f64> = unstable.points.iter().map(|point| point.0).filter(|hz| hz.is_finite()).collect();
        assert_eq!((hz.first(), hz.last()), (found.first(), found.last()));
    }
}
