//! Draws the figures: stable blue, unstable red and dashed.

use resonarm::analysis;
use resonarm_figures::paper::{
    Abscissa, FigureCurves, ForcedBranch, LabelledCurve, MeasuredPoint, NaturalFrequencies, Panel, PaperOrbit, Way,
};
use resonarm_figures::plot::{self, Axis, Color, Legend, Marker, Note, Series};

/// Draws Fig. 3, a panel for each preset.
pub(super) fn natural_frequencies(presets: &[NaturalFrequencies]) -> plot::Figure {
    let mut figure = plot::Figure::new("Natural frequencies of the arm against the angle of link 2");
    figure.columns = 2;
    for curves in presets {
        let x = Axis::degrees("β₂ (°)").range(-180.0, 180.0);
        let highest = curves.frequency_hz.iter().fold(0.0_f64, |highest, frequencies| highest.max(frequencies[1]));
        let mut panel = plot::Panel::new(x, Axis::linear("natural frequency (Hz)").range(0.0, 1.05 * highest));
        // The arm has two links, and so two modes.
        for (mode, color) in [Color::Blue, Color::Vermillion].into_iter().enumerate() {
            let points = curves.beta2_deg.iter().zip(&curves.frequency_hz);
            let points = points.map(|(beta2_deg, frequencies)| (*beta2_deg, frequencies[mode])).collect();
            panel = panel.with(Series::line(format!("mode {}", mode + 1), color, points));
        }
        figure = figure.with(panel.title(curves.preset.name()));
    }
    figure
}

pub(super) fn curves(curves: &FigureCurves) -> plot::Figure {
    let mut figure = plot::Figure::new(curves.title.clone()).subtitle(curves.conditions.clone());
    for (index, panel) in curves.panels.iter().enumerate() {
        let drawn = draw(curves, panel);
        figure = figure.with(if index == 0 { drawn } else { drawn.legend(Legend::None) });
    }
    figure
}

/// The room above the highest peak of a panel, for its name.
const HEADROOM: f64 = 1.15;
/// The same room in logarithmic panels: room for a row of names and the lines to their peaks.
const LOG_HEADROOM: f64 = 30.0;
/// A panel without a range shows each curve where it has at least this fraction of the panel's highest peak, or half of
/// the curve's,
const SHOWN: f64 = 0.05;
/// and additionally this fraction of the width on either side.
const MARGIN: f64 = 0.08;
/// A logarithmic panel shows amplitudes from its highest peak down to this fraction of it.
const DECADES: f64 = 1e-5;

fn draw(curves: &FigureCurves, panel: &Panel) -> plot::Panel {
    let reading = panel.reading - 1;
    let branches = || panel.curves.iter().filter_map(|index| curves.curves.get(*index));
    let range = panel.range.unwrap_or_else(|| shown(branches().map(|curve| &curve.branch), panel));
    let inside = |orbit: &&PaperOrbit| (range[0]..=range[1]).contains(&abscissa(panel, orbit));
    let sizes = |branch: &ForcedBranch| {
        branch.orbits.iter().filter(inside).map(|orbit| branch.size(orbit, reading)).fold(0.0, f64::max)
    };
    let top = branches().map(|curve| sizes(&curve.branch)).fold(0.0, f64::max);
    let top = curves.measured.iter().filter_map(|point| point.amplitude[reading]).fold(top, f64::max);
    let label = match branches().next().map(|curve| curve.branch.read.at[reading].as_str()) {
        Some("joint1") => String::from("amplitude of α₁ (rad)"),
        Some("joint2") => String::from("amplitude of α₂ (rad)"),
        name => format!("amplitude of {} (m)", name.unwrap_or_default()),
    };
    let y = if panel.logarithmic {
        Axis::log(label).range(DECADES * top, LOG_HEADROOM * top)
    } else {
        Axis::linear(label).range(0.0, HEADROOM * top)
    };
    let x = match panel.abscissa {
        Abscissa::FrequencyHz => "excitation frequency (Hz)",
        Abscissa::Torque1Nm => "amplitude of the torque (N·m)",
    };
    let mut drawn = plot::Panel::new(Axis::linear(x).range(range[0], range[1]), y);
    for curve in branches() {
        drawn = drawn.with(Series::stable(stretches(&curve.branch, panel, true)));
        drawn = drawn.with(Series::unstable(stretches(&curve.branch, panel, false)));
    }
    drawn = with_points(drawn, &curves.measured, reading);
    if panel.names {
        drawn = with_names(drawn, panel, range, branches());
    }
    if panel.title.is_empty() { drawn } else { drawn.title(panel.title.clone()) }
}

/// Adds the measured points to a panel; readings count from 0. The marks are those of `experiment fig9`.
fn with_points(mut drawn: plot::Panel, measured: &[MeasuredPoint], reading: usize) -> plot::Panel {
    for way in Way::ALL {
        let (color, shape) = match way {
            Way::Up => (Color::Vermillion, Marker::Triangle),
            Way::Down => (Color::Purple, Marker::Square),
            Way::Walk => (Color::Green, Marker::Circle),
        };
        let points = measured.iter().filter(|point| point.way == way);
        let points = points.filter_map(|point| Some((point.frequency_hz, point.amplitude[reading]?))).collect();
        drawn = drawn.with_any(Series::markers(way.label(), color, shape, points).marked(5.0, false));
    }
    drawn
}

fn abscissa(panel: &Panel, orbit: &PaperOrbit) -> f64 {
    match panel.abscissa {
        Abscissa::FrequencyHz => orbit.frequency_hz,
        Abscissa::Torque1Nm => orbit.excitation,
    }
}

/// Returns the ranges in which the curves of a panel without a range are large.
fn shown<'a>(branches: impl Iterator<Item = &'a ForcedBranch>, panel: &Panel) -> [f64; 2] {
    let reading = panel.reading - 1;
    let branches: Vec<&ForcedBranch> = branches.collect();
    let peak =
        |branch: &ForcedBranch| branch.orbits.iter().map(|orbit| branch.size(orbit, reading)).fold(0.0, f64::max);
    let highest = branches.iter().fold(0.0_f64, |highest, branch| highest.max(peak(branch)));
    let mut low = f64::INFINITY;
    let mut high = f64::NEG_INFINITY;
    for branch in branches {
        // The second bound keeps at least the upper half of a curve that is small beside the others.
        let level = (SHOWN * highest).min(0.5 * peak(branch));
        for orbit in branch.orbits.iter().filter(|orbit| branch.size(orbit, reading) >= level) {
            low = low.min(abscissa(panel, orbit));
            high = high.max(abscissa(panel, orbit));
        }
    }
    [low - MARGIN * (high - low), high + MARGIN * (high - low)]
}

/// Returns the points of one stability, with gaps between their intervals.
fn stretches(branch: &ForcedBranch, panel: &Panel, stable: bool) -> Vec<(f64, f64)> {
    let at = |orbit: &PaperOrbit| (abscissa(panel, orbit), branch.size(orbit, panel.reading - 1));
    analysis::stretches(&branch.orbits, |orbit| orbit.is_stable, stable, at)
}

/// A maximum between samples is a zone's peak if it reaches this fraction of the highest sample.
const SAME: f64 = 0.999;

/// Adds the names of its curves to a panel: over their peaks; in logarithmic panels in a row for each zone, since there
/// the peaks of several poses are crowded.
fn with_names<'a>(
    mut drawn: plot::Panel,
    panel: &Panel,
    range: [f64; 2],
    curves: impl Iterator<Item = &'a LabelledCurve>,
) -> plot::Panel {
    let mut rows: [Vec<Note>; 2] = Default::default();
    for curve in curves {
        let name = |at| Note { at, text: curve.label.clone() };
        match named_at(&curve.branch, panel, range) {
            Named::Peaks(zones) if panel.logarithmic => {
                rows.iter_mut().zip(zones).for_each(|(row, at)| row.extend(at.map(name)));
            }
            Named::Peaks(zones) => drawn.notes.extend(zones.into_iter().flatten().map(name)),
            Named::End(at) => drawn.notes.extend(at.map(name)),
        }
    }
    rows.into_iter().filter(|row| !row.is_empty()).fold(drawn, plot::Panel::row)
}

enum Named {
    /// The name stands over the peak in each zone that has one.
    Peaks([Option<(f64, f64)>; 2]),
    /// The name stands at the end of the curve, or at its highest point if it has no peak.
    End(Option<(f64, f64)>),
}

fn named_at(branch: &ForcedBranch, panel: &Panel, range: [f64; 2]) -> Named {
    let reading = panel.reading - 1;
    let at = |orbit: &PaperOrbit| (abscissa(panel, orbit), branch.size(orbit, reading));
    // Over the torque there is no resonance peak, so the name goes to the end of the curve.
    if panel.abscissa == Abscissa::Torque1Nm {
        return Named::End(branch.orbits.last().map(at));
    }
    let maxima = branch.maxima(reading);
    // A zone that is cut off by the panel may rise to the edge: neither that is a peak, nor anything lower than the
    // edge.
    let peak = |zone: [f64; 2]| {
        let from = zone[0].max(range[0]);
        let to = zone[1].min(range[1]);
        let highest = branch.size(branch.peak(reading, [from, to]).ok()?, reading);
        let top =
            maxima.iter().find(|top| (from..=to).contains(&top.frequency_hz) && top.amplitude_rad >= SAME * highest)?;
        Some((top.frequency_hz, top.amplitude_rad))
    };
    let peaks = branch.zones_hz().map(peak);
    if peaks == [None, None] { Named::End(branch.peak(reading, range).ok().map(at)) } else { Named::Peaks(peaks) }
}
