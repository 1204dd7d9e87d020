//! Measured resonance zones over the computed responses.

use super::fig9::{Run, ZoneDocument};
use crate::computed_branch::CLIPPED;
use crate::figures::branches::stretches;
use crate::measured_points::MeasuredPoint;
use crate::read_at::{displacement_unit, size};
use resonarm::analysis::Reading;
use resonarm::plant::ReadDof;
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Legend, Marker, Note, Panel, Series, Style, Subtitle};

/// Returns the largest computed amplitude of a zone at the reading of this number.
fn peak(zone: &ZoneDocument, at: usize) -> f64 {
    zone.score.branch.orbits.iter().map(|orbit| size_at(&orbit.readings, at)).fold(0.0, f64::max)
}

/// Returns the amplitude of the reading of this number.
fn size_at(readings: &[Reading], at: usize) -> f64 {
    readings.get(at).map_or(f64::NAN, |reading| size(reading.harmonic1))
}

/// Returns the numbers of the readings that are drawn: of each accelerometer the axis along which it moves most.
fn drawn(zones: &[ZoneDocument]) -> Vec<usize> {
    let read: &[ReadDof] = zones.first().map_or(&[], |zone| &zone.score.read);
    let most = |at: &usize| zones.iter().map(|zone| peak(zone, *at)).fold(0.0, f64::max);
    // Channels count head x, y; B x, y; C x, y.
    let of = |accelerometer: usize| {
        let axes = (0..read.len()).filter(|at| read[*at].channel / 2 == accelerometer);
        axes.max_by(|a, b| most(a).total_cmp(&most(b)))
    };
    [of(1), of(2)].into_iter().flatten().collect()
}

/// Returns the axis of the amplitude at a degree of freedom.
fn amplitude_axis(read: &ReadDof) -> Axis {
    Axis::linear(format!("amplitude of {} ({})", read.name, displacement_unit(read.dof)))
}

/// Draws above the amplitudes of both accelerometers over all frequencies, and below each zone where its response
/// bends, at the degree of freedom that is compared. `conditions` name the structure.
pub(super) fn figure(conditions: Subtitle, zones: &[ZoneDocument], interrupted: bool) -> Figure {
    let forces: Vec<_> = zones.iter().map(|zone| format!("{} N", zone.force_n)).collect();
    let conditions = conditions.and(format!("along x at the exciter: {}", forces.join(" and ")));
    let conditions = conditions.and(if interrupted { "interrupted" } else { "" });
    let mut figure = Figure::new("Resonance zones, measured on the bench and computed").subtitle(conditions);
    figure.columns = 2;
    let all = drawn(zones);
    for (place, &at) in all.iter().enumerate() {
        let Some(read) = zones.first().and_then(|zone| zone.score.read.get(at)) else { continue };
        let panel = Panel::new(Axis::linear("frequency (Hz)"), amplitude_axis(read));
        // One legend, of a panel that has both zones.
        let panel = panel.legend(if place + 1 == all.len() { Legend::Bottom } else { Legend::None });
        let mut panel = zones.iter().fold(panel, |panel, zone| with_view(panel, zone, at, &read.name));
        panel = between_zones(panel, zones, at);
        figure = figure.with(panel);
    }
    for (index, zone) in zones.iter().enumerate() {
        let name = &zone.score.at;
        let Some(at) = zone.score.read.iter().position(|read| read.name == *name) else { continue };
        let (low_hz, high_hz) = range(zone);
        let x = Axis::linear("frequency (Hz)").range(low_hz, high_hz);
        let panel = Panel::new(x, amplitude_axis(&zone.score.read[at]));
        let panel = panel.title(format!("Zone {}, {} N", index + 1, zone.force_n)).legend(Legend::None);
        figure = figure.with(with_view(panel, zone, at, name));
    }
    figure
}

/// Draws a vertical line where one zone ends and the next begins, with the load on either side: the response jumps
/// there because the load does.
fn between_zones(mut panel: Panel, zones: &[ZoneDocument], at: usize) -> Panel {
    let top = zones.iter().map(|zone| peak(zone, at)).fold(0.0, f64::max);
    let hz = |zone: &ZoneDocument| zone.score.branch.orbits.iter().map(|orbit| orbit.frequency_hz).collect::<Vec<_>>();
    for pair in zones.windows(2) {
        let [Some(end), Some(start)] =
            [hz(&pair[0]).into_iter().reduce(f64::max), hz(&pair[1]).into_iter().reduce(f64::min)]
        else {
            continue;
        };
        // Branches end where their last orbit lies, not exactly at the border of the zones: the line is between the
        // two.
        let border = (end + start) / 2.0;
        let style = Style::Line { color: Color::Grey, width: 0.8, dash: Dash::Dashed };
        let line = Series::line("load changes", Color::Grey, vec![(border, 0.0), (border, top)]).style(style);
        panel = panel.with(line);
        // The loads stand beside the line, in the middle of the free half of each zone.
        let beside = |zone: &ZoneDocument, towards: f64| {
            let orbits = &zone.score.branch.orbits;
            let peak = orbits.iter().max_by(|a, b| size_at(&a.readings, at).total_cmp(&size_at(&b.readings, at)));
            let peak = peak.map_or(towards, |orbit| orbit.frequency_hz);
            (!orbits.is_empty())
                .then(|| Note { at: ((peak + towards) / 2.0, 0.6 * top), text: format!("{} N", zone.force_n) })
        };
        panel.notes.extend(beside(&pair[0], border).into_iter().chain(beside(&pair[1], border)));
    }
    panel
}

/// Draws the computed response and backbone, and the measured points over them, at the reading of this number and name.
fn with_view(mut panel: Panel, zone: &ZoneDocument, at: usize, name: &str) -> Panel {
    for (stretch, is_stable) in stretches(&zone.score.branch) {
        let points = stretch.iter().map(|orbit| (orbit.frequency_hz, size_at(&orbit.readings, at))).collect();
        panel = panel.with(if is_stable == Some(false) { Series::unstable(points) } else { Series::stable(points) });
    }
    let backbone = zone.score.backbone.points.iter().map(|point| (point.frequency_hz, size_at(&point.readings, at)));
    let thin = Style::Line { color: Color::Black, width: 0.8, dash: Dash::Chain };
    panel = panel.with(Series::line("backbone", Color::Black, backbone.collect()).style(thin));
    // Only settled points are drawn; the others are in the data.
    let places = |run: &Run, wanted: &dyn Fn(&MeasuredPoint) -> bool| -> Vec<(f64, f64)> {
        let settled = run.points.iter().filter(|point| point.settled && wanted(point));
        settled.filter_map(|point| Some((point.frequency_hz, point.amplitude(name)?))).collect()
    };
    for (label, color, shape, run) in [
        ("sine up", Color::Vermillion, Marker::Triangle, &zone.up),
        ("sine down", Color::Purple, Marker::Square, &zone.down),
        ("phase walk", Color::Green, Marker::Circle, &zone.walk),
        ("phase lock", Color::Black, Marker::Diamond, &zone.backbone),
    ] {
        let read = places(run, &|_| true);
        panel = panel.with_any(Series::markers(label, color, shape, read).marked(5.0, false));
    }
    let all = [&zone.walk, &zone.backbone, &zone.up, &zone.down];
    let clipped = all.into_iter().flat_map(|run| places(run, &|point| point.is_clipped(name))).collect();
    panel.with_any(Series::markers(CLIPPED, Color::Black, Marker::Cross, clipped).marked(9.0, false))
}

/// Returns the range of frequencies where a zone bends: five times the distance of its folds, or where the walk's lag
/// is from 20° to 160°, or the whole zone.
fn range(zone: &ZoneDocument) -> (f64, f64) {
    let ends = |hz: &mut dyn Iterator<Item = f64>| {
        hz.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), hz| (low.min(hz), high.max(hz)))
    };
    let folds = ends(&mut zone.score.folds_hz.iter().copied());
    let within = |point: &&MeasuredPoint| point.lag_deg.is_some_and(|lag_deg| (20.0..=160.0).contains(&lag_deg));
    let inner = zone.walk.points.iter().filter(within);
    let inner = ends(&mut inner.map(|point| point.frequency_hz));
    let ((low, high), margin) = if folds.0 < folds.1 {
        (folds, 2.0)
    } else if inner.0 <= inner.1 {
        (inner, 0.1)
    } else {
        (ends(&mut zone.score.branch.orbits.iter().map(|orbit| orbit.frequency_hz)), 0.0)
    };
    // A single point gets a thousandth to each side.
    let margin_hz = if low < high { margin * (high - low) } else { 1e-3 * high };
    (low - margin_hz, high + margin_hz)
}
