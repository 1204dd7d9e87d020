//! Ranges of axes, and positions of values on the page.

use super::error::PlotError;
use super::style::Style;
use super::{Axis, Panel, Scale};

/// Fraction of the axis left free beyond the data at either end.
const MARGIN: f64 = 0.04;

/// An axis on the page: value `low` at `from` px, `high` at `to` px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AxisMap {
    pub scale: Scale,
    pub low: f64,
    pub high: f64,
    pub from: f64,
    pub to: f64,
}

impl AxisMap {
    /// Returns the position of `value`, px. With g the identity or log10: from + (to − from) · (g(v) − g(low)) /
    /// (g(high) − g(low)).
    pub fn px(&self, value: f64) -> f64 {
        let part = (along(self.scale, value) - along(self.scale, self.low))
            / (along(self.scale, self.high) - along(self.scale, self.low));
        self.from + (self.to - self.from) * part
    }
}

/// Returns the value in the scale of the axis.
fn along(scale: Scale, value: f64) -> f64 {
    match scale {
        Scale::Linear | Scale::Degrees => value,
        Scale::Log => libm::log10(value),
    }
}

/// One of the two coordinates of a point.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Coordinate {
    X,
    Y,
}

impl Coordinate {
    fn of(self, point: (f64, f64)) -> f64 {
        match self {
            Self::X => point.0,
            Self::Y => point.1,
        }
    }

    pub fn axis(self, panel: &Panel) -> &Axis {
        match self {
            Self::X => &panel.x,
            Self::Y => &panel.y,
        }
    }
}

/// Rejects points that can't be drawn in `panel`, number `index` of the figure `title`.
pub(super) fn check(title: &str, index: usize, panel: &Panel) -> Result<(), PlotError> {
    let mut drawn = 0;
    for (series_index, series) in panel.series.iter().enumerate() {
        for (point_index, &(x, y)) in series.points.iter().enumerate() {
            if x.is_nan() || y.is_nan() {
                continue;
            }
            if x.is_infinite() || y.is_infinite() {
                return Err(PlotError::NotFinite { panel: index, series: series_index, point: point_index, x, y });
            }
            for (axis, value) in [(&panel.x, x), (&panel.y, y)] {
                if axis.scale == Scale::Log && value <= 0.0 {
                    let axis = axis.label.clone();
                    return Err(PlotError::NotPositive {
                        panel: index,
                        series: series_index,
                        point: point_index,
                        axis,
                        value,
                    });
                }
            }
            drawn += 1;
        }
    }
    if drawn == 0 { Err(PlotError::NoPoints { title: title.to_owned(), panel: index }) } else { Ok(()) }
}

/// Returns the range of an axis: the one it states, or that of the data in `panels`, which share it, with a margin.
///
/// Lines may touch the ends of the x axis; everything else keeps the distance [`MARGIN`]. Data that all have one value
/// get a range around it.
pub(super) fn range(coordinate: Coordinate, panels: &[&Panel]) -> Result<(f64, f64), PlotError> {
    let Some(axis) = panels.first().map(|panel| coordinate.axis(panel)) else {
        return Ok((0.0, 1.0)); // no panel: the range is not used
    };
    let (low, high) = axis.range.unwrap_or_else(|| data_range(coordinate, axis.scale, panels));
    // Between two finite ends the difference may overflow.
    let ordered = low.is_finite() && high.is_finite() && low < high && (high - low).is_finite();
    if !ordered || (axis.scale == Scale::Log && low <= 0.0) {
        return Err(PlotError::Range { axis: axis.label.clone(), low, high });
    }
    Ok((low, high))
}

fn data_range(coordinate: Coordinate, scale: Scale, panels: &[&Panel]) -> (f64, f64) {
    let series = || panels.iter().flat_map(|panel| &panel.series);
    let points = series().flat_map(|series| &series.points).filter(|(x, y)| !x.is_nan() && !y.is_nan());
    let mut low = f64::INFINITY;
    let mut high = f64::NEG_INFINITY;
    for value in points.map(|point| coordinate.of(*point)) {
        low = low.min(value);
        high = high.max(value);
    }
    // Tiles reach half their size beyond their centres.
    let tiles = series().filter_map(|series| match series.style {
        Style::Tiles { width, height, .. } => Some(if coordinate == Coordinate::X { width } else { height } / 2.0),
        Style::Line { .. } | Style::Markers { .. } => None,
    });
    let beyond = tiles.fold(0.0, f64::max);
    // A map fills its panel: a margin would look like cells without a value.
    if beyond > 0.0 {
        return (low - beyond, high + beyond);
    }
    let only_lines = series().all(|series| matches!(series.style, Style::Line { .. }));
    let margin = if coordinate == Coordinate::X && only_lines { 0.0 } else { MARGIN };
    match scale {
        Scale::Log if low == high => (low / 2.0, high * 2.0),
        Scale::Log => {
            // A margin of the length on the page: log(low) − margin · log(high / low), and likewise at the other end.
            let factor = libm::pow(high / low, margin);
            (low / factor, high * factor)
        }
        Scale::Linear | Scale::Degrees if low == high => {
            // Without a size of the values to go by, one unit to either side.
            let half = if low == 0.0 { 1.0 } else { low.abs() / 10.0 };
            (low - half, high + half)
        }
        Scale::Linear | Scale::Degrees => (low - margin * (high - low), high + margin * (high - low)),
    }
}
