//! Sizes, the grid and the marks of series, which panels and legends draw alike.

use super::Series;
use super::axis::AxisMap;
use super::scene::{Point, Shape, Stroke, WHITE};
use super::style::{Dash, Style};

pub(super) const TICK_SIZE: f64 = 13.0;
pub(super) const LABEL_SIZE: f64 = 14.0;
pub(super) const TICK_LENGTH: f64 = 5.0;
/// Lines that stay behind the data.
pub(super) const GRID: Stroke = Stroke { color: [0xDD, 0xDD, 0xDD], width: 0.6, dash: Dash::Solid };
const MARKER_OUTLINE: f64 = 1.3;

/// The positions of the points of `series` on the page; NaN stays NaN.
pub(super) fn on_page<'a>(series: &'a Series, x: &'a AxisMap, y: &'a AxisMap) -> impl Iterator<Item = Point> + 'a {
    series.points.iter().map(|point| [x.px(point.0), y.px(point.1)])
}

/// Markers of this style; `None` for a line, or without points.
pub(super) fn markers(style: Style, at: Vec<Point>) -> Option<Shape> {
    let Style::Markers { color, shape, size, filled } = style else { return None };
    let fill = if filled { color.rgb() } else { WHITE };
    let stroke = Stroke { color: color.rgb(), width: MARKER_OUTLINE, dash: Dash::Solid };
    (!at.is_empty()).then_some(Shape::Markers { at, shape, size, fill, stroke })
}
