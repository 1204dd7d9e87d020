//! Measured resonance zones over the computed responses.

use crate::figures::{branch_plot, captions};
use crate::walk_point::{CLIPPED, WalkPoint};
use resonarm::experiment::Score;
use resonarm::scenario::Scenario;
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Legend, Marker, Note, Panel, Series, Style};

/// A zone as it is drawn.
pub(crate) struct View<'a> {
    /// The joint that moves most in it, 0 or 1.
    pub joint: usize,
    pub force_n: f64,
    pub score: &'a Score,
    pub walk: &'a [WalkPoint],
    pub backbone: &'a [WalkPoint],
    pub up: &'a [WalkPoint],
    pub down: &'a [WalkPoint],
}

/// Above: the amplitudes of both links over all frequencies. Below: each zone where its response bends.
pub(crate) fn figure(scenario: &Scenario, views: &[View], interrupted: bool) -> Figure {
    let forces: Vec<_> = views.iter().map(|view| format!("{} N", view.force_n)).collect();
    let conditions = captions::pose(scenario).and(format!("along x at C: {}", forces.join(" and ")));
    let conditions = conditions.and(if interrupted { "interrupted" } else { "" });
    let mut figure = Figure::new("Resonance zones, measured on the bench and computed").subtitle(conditions);
    figure.columns = 2;
    for joint in 0..2 {
        let panel = Panel::new(Axis::linear("frequency (Hz)"), Axis::linear(captions::largest(joint)));
        let panel = panel.title(format!("Link {}", joint + 1));
        // One legend, of a panel that has both zones.
        let panel = panel.legend(if joint == 1 { Legend::Bottom } else { Legend::None });
        let mut panel = views.iter().fold(panel, |panel, view| with_view(panel, view, joint));
        panel = between_zones(panel, views, joint);
        figure = figure.with(panel);
    }
    for (index, view) in views.iter().enumerate() {
        let (low_hz, high_hz) = range(view);
        let x = Axis::linear("frequency (Hz)").range(low_hz, high_hz);
        let panel = Panel::new(x, Axis::linear(captions::largest(view.joint)));
        let panel = panel.title(format!("Zone {}, {} N", index + 1, view.force_n)).legend(Legend::None);
        figure = figure.with(with_view(panel, view, view.joint));
    }
    figure
}

/// A vertical line where one zone ends and the next begins, with the load on either side: the response jumps there because
/// the load does.
fn between_zones(mut panel: Panel, views: &[View], joint: usize) -> Panel {
    let amplitude =
        |view: &View| view.score.branch.orbits.iter().map(|orbit| orbit.amplitude_rad[joint]).fold(0.0, f64::max);
    let top = views.iter().map(amplitude).fold(0.0, f64::max);
    let hz = |view: &View| view.score.branch.orbits.iter().map(|orbit| orbit.frequency_hz).collect::<Vec<_>>();
    for pair in views.windows(2) {
        let [Some(end), Some(start)] =
            [hz(&pair[0]).into_iter().reduce(f64::max), hz(&pair[1]).into_iter().reduce(f64::min)]
        else {
            continue;
        };
        let border = (end + start) / 2.0;
        let style = Style::Line { color: Color::Grey, width: 0.8, dash: Dash::Dashed };
        let line = Series::line("load changes", Color::Grey, vec![(border, 0.0), (border, top)]).style(style);
        panel = panel.with(line);
        // Beside the line, in the middle of the free half of each zone.
        let beside = |view: &View, towards: f64| {
            let zone = hz(view);
            let peak = view
                .score
                .branch
                .orbits
                .iter()
                .max_by(|a, b| a.amplitude_rad[joint].total_cmp(&b.amplitude_rad[joint]));
            let peak = peak.map_or(towards, |orbit| orbit.frequency_hz);
            (!zone.is_empty())
                .then(|| Note { at: ((peak + towards) / 2.0, 0.6 * top), text: format!("{} N", view.force_n) })
        };
        panel.notes.extend(beside(&pair[0], border).into_iter().chain(beside(&pair[1], border)));
    }
    panel
}

/// The computed response and backbone, and the measured points over them.
fn with_view(panel: Panel, view: &View, joint: usize) -> Panel {
    let panel = branch_plot::with_branch(panel, &view.score.branch, joint);
    let backbone = view.score.backbone.points.iter().map(|point| (point.frequency_hz, point.amplitude_rad[joint]));
    let thin = Style::Line { color: Color::Black, width: 0.8, dash: Dash::Chain };
    let mut panel = panel.with(Series::line("backbone", Color::Black, backbone.collect()).style(thin));
    for (label, color, shape, points) in [
        ("sine up", Color::Vermillion, Marker::Triangle, view.up),
        ("sine down", Color::Purple, Marker::Square, view.down),
        ("phase walk", Color::Green, Marker::Circle, view.walk),
        ("phase lock", Color::Black, Marker::Diamond, view.backbone),
    ] {
        // Settled points; the others are only in the data.
        let settled = points.iter().filter(|point| point.settled);
        let places = settled.map(|point| (point.frequency_hz, point.amplitude_rad[joint])).collect();
        panel = panel.with_any(Series::markers(label, color, shape, places).marked(5.0, false));
    }
    let all = [view.walk, view.backbone, view.up, view.down].into_iter().flatten();
    let clipped = all.filter(|point| point.settled && point.clipped[joint]);
    let places = clipped.map(|point| (point.frequency_hz, point.amplitude_rad[joint])).collect();
    panel.with_any(Series::markers(CLIPPED, Color::Black, Marker::Cross, places).marked(9.0, false))
}

/// The range where a zone bends: five times the distance of its folds, or where the walk's lag is from 20° to 160°, or
/// the whole zone.
fn range(view: &View) -> (f64, f64) {
    let ends = |hz: &mut dyn Iterator<Item = f64>| {
        hz.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), hz| (low.min(hz), high.max(hz)))
    };
    let folds = ends(&mut view.score.folds_hz.iter().copied());
    let inner = view.walk.iter().filter(|point| (20.0..=160.0).contains(&point.phase_deg));
    let inner = ends(&mut inner.map(|point| point.frequency_hz));
    let ((low, high), margin) = if folds.0 < folds.1 {
        (folds, 2.0)
    } else if inner.0 <= inner.1 {
        (inner, 0.1)
    } else {
        (ends(&mut view.score.branch.orbits.iter().map(|orbit| orbit.frequency_hz)), 0.0)
    };
    // A single point gets a thousandth to each side.
    let margin_hz = if low < high { margin * (high - low) } else { 1e-3 * high };
    (low - margin_hz, high + margin_hz)
}
