//! One panel, drawn into the area that the layout gave its plot.

use super::Series;
use super::axis::AxisMap;
use super::cell::{Cell, LegendPlace};
use super::clip;
use super::font::{CAP_HEIGHT, Fonts};
use super::marks::{GRID, LABEL_SIZE, TICK_LENGTH, TICK_SIZE, markers, on_page};
use super::notes;
use super::rows;
use super::scene::{Anchor, Direction, Rect, Rgb, Shape, Stroke, Text, Weight};
use super::style::Style;
use super::ticks::{self, Ticks};

const MINOR_TICK_LENGTH: f64 = 3.0;
const FRAME: Stroke = Stroke { color: [0x20, 0x20, 0x20], width: 1.0, dash: super::Dash::Solid };
/// Draws the panel with its axes, series, names and legend.
pub(super) fn draw(shapes: &mut Vec<Shape>, fonts: &Fonts, cell: Cell<'_>) {
    // A least distance for short labels as well: single digits could be so dense that their ticks are a comb.
    let room = |label: &str| (fonts.width(label, TICK_SIZE, Weight::Regular) + 1.5 * TICK_SIZE).max(4.0 * TICK_SIZE);
    let x_ticks = ticks::of_axis(&cell.draft.panel.x, &cell.x, &room);
    // In the order of drawing: the data cover the grid, the names the data, and the frame cuts them all off.
    grid(shapes, &cell, &x_ticks);
    for series in &cell.draft.panel.series {
        match series.style {
            Style::Tiles { color, width, height } => tiles(shapes, &cell, series, color.rgb(), [width, height]),
            Style::Line { .. } | Style::Markers { .. } => {
                shapes.extend(series_shape(series, &cell.plot, &cell.x, &cell.y));
            }
        }
    }
    let taken = rows::draw(shapes, fonts, &cell);
    notes::draw(shapes, fonts, &cell, taken);
    frame(shapes, &cell, &x_ticks);
    if cell.draft.writes_x {
        x_texts(shapes, &cell, &x_ticks);
    }
    y_texts(shapes, &cell);
    if let Some(LegendPlace { corner, columns }) = cell.legend_at {
        cell.draft.entries.draw(shapes, corner, columns);
    }
}

fn series_shape(series: &Series, plot: &Rect, x: &AxisMap, y: &AxisMap) -> Option<Shape> {
    let shape = match series.style {
        Style::Line { color, width, dash } => {
            let stroke = Stroke { color: color.rgb(), width, dash };
            Shape::Lines { runs: clip::runs(on_page(series, x, y), plot), stroke }
        }
        Style::Markers { .. } => {
            markers(series.style, on_page(series, x, y).filter(|point| plot.contains(*point)).collect())?
        }
        Style::Tiles { .. } => return None,
    };
    let empty = matches!(&shape, Shape::Lines { runs, .. } if runs.is_empty());
    (!empty).then_some(shape)
}

/// The length by which a tile overlaps the next, px: without it a viewer that smooths edges shows the ground between
/// them.
const OVERLAP: f64 = 0.4;

/// The rectangles of a series, those beside each other in a row as one.
fn tiles(shapes: &mut Vec<Shape>, cell: &Cell<'_>, series: &Series, fill: Rgb, [width, height]: [f64; 2]) {
    let mut rows: Vec<Rect> = Vec::new();
    let mut points: Vec<(f64, f64)> =
        series.points.iter().copied().filter(|(x, y)| !x.is_nan() && !y.is_nan()).collect();
    // Row by row from the left, so that neighbours follow each other and become one rectangle.
    points.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.total_cmp(&b.0)));
    for (x, y) in points {
        let left = cell.x.px(x - width / 2.0);
        let right = cell.x.px(x + width / 2.0);
        let top = cell.y.px(y + height / 2.0);
        let bottom = cell.y.px(y - height / 2.0);
        match rows.last_mut() {
            // One rectangle for a row of tiles keeps files small, and no seams show within it.
            // Tiles of one row have equal y, so also equal positions: an exact comparison is right.
            Some(row) if row.bottom == bottom && (row.right - left).abs() < OVERLAP => row.right = right,
            _ => rows.push(Rect { left, top, right, bottom }),
        }
    }
    let plot = cell.plot;
    for Rect { left, top, right, bottom } in rows {
        let area = Rect {
            left: (left - OVERLAP).max(plot.left),
            top: (top - OVERLAP).max(plot.top),
            right: (right + OVERLAP).min(plot.right),
            bottom: (bottom + OVERLAP).min(plot.bottom),
        };
        if area.left < area.right && area.top < area.bottom {
            shapes.push(Shape::Rect { area, fill });
        }
    }
}

fn grid(shapes: &mut Vec<Shape>, cell: &Cell<'_>, x_ticks: &Ticks) {
    let plot = cell.plot;
    let vertical =
        x_ticks.labelled.iter().map(|(value, _)| cell.x.px(*value)).map(|x| vec![[x, plot.top], [x, plot.bottom]]);
    let horizontal = cell.draft.y_ticks.labelled.iter().map(|(value, _)| cell.y.px(*value));
    let horizontal = horizontal.map(|y| vec![[plot.left, y], [plot.right, y]]);
    shapes.push(Shape::Lines { runs: vertical.chain(horizontal).collect(), stroke: GRID });
}

fn frame(shapes: &mut Vec<Shape>, cell: &Cell<'_>, x_ticks: &Ticks) {
    let Rect { left, bottom, .. } = cell.plot;
    let mut runs = vec![cell.plot.outline()];
    let sized = |ticks: &Ticks| -> Vec<(f64, f64)> {
        let labelled = ticks.labelled.iter().map(|(value, _)| (*value, TICK_LENGTH));
        labelled.chain(ticks.minor.iter().map(|value| (*value, MINOR_TICK_LENGTH))).collect()
    };
    for (value, length) in sized(x_ticks) {
        let x = cell.x.px(value);
        runs.push(vec![[x, bottom], [x, bottom + length]]);
    }
    for (value, length) in sized(&cell.draft.y_ticks) {
        let y = cell.y.px(value);
        runs.push(vec![[left - length, y], [left, y]]);
    }
    shapes.push(Shape::Lines { runs, stroke: FRAME });
}

fn x_texts(shapes: &mut Vec<Shape>, cell: &Cell<'_>, ticks: &Ticks) {
    let baseline = cell.plot.bottom + TICK_LENGTH + 3.0 + TICK_SIZE;
    for (value, label) in &ticks.labelled {
        shapes.push(Shape::Text(Text::new([cell.x.px(*value), baseline], label, TICK_SIZE, Anchor::Middle)));
    }
    let below = baseline + LABEL_SIZE * 1.6;
    let middle = (cell.plot.left + cell.plot.right) / 2.0;
    shapes.push(Shape::Text(Text::new([middle, below], &cell.draft.panel.x.label, LABEL_SIZE, Anchor::Middle)));
    if let Some(factor) = &ticks.factor {
        shapes.push(Shape::Text(Text::new([cell.plot.right, below], factor, TICK_SIZE, Anchor::End)));
    }
}

fn y_texts(shapes: &mut Vec<Shape>, cell: &Cell<'_>) {
    let plot = cell.plot;
    let right = plot.left - TICK_LENGTH - 4.0;
    for (value, label) in &cell.draft.y_ticks.labelled {
        let baseline = cell.y.px(*value) + TICK_SIZE * CAP_HEIGHT / 2.0;
        shapes.push(Shape::Text(Text::new([right, baseline], label, TICK_SIZE, Anchor::End)));
    }
    let mut x = right - cell.draft.y_tick_width - 8.0;
    for line in cell.draft.y_label.iter().rev() {
        let label = Text::new([x, (plot.top + plot.bottom) / 2.0], line, LABEL_SIZE, Anchor::Middle);
        shapes.push(Shape::Text(Text { direction: Direction::Upwards, ..label }));
        x -= LABEL_SIZE * 1.3;
    }
    let mut above = plot.top - 7.0;
    if let Some(factor) = &cell.draft.y_ticks.factor {
        shapes.push(Shape::Text(Text::new([plot.left, above], factor, TICK_SIZE, Anchor::Start)));
        above -= TICK_SIZE * 1.4;
    }
    if let Some(title) = &cell.draft.panel.title {
        let title = Text::new([(plot.left + plot.right) / 2.0, above], title, LABEL_SIZE, Anchor::Middle);
        shapes.push(Shape::Text(Text { weight: Weight::Bold, ..title }));
    }
}
