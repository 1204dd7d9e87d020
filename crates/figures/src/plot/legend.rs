//! The legend of a panel: its entries, and a place where it covers no data.

use super::axis::AxisMap;
use super::clip;
use super::font::{CAP_HEIGHT, Fonts};
use super::marks::{GRID, TICK_SIZE, markers, on_page};
use super::scene::{Anchor, Point, Rect, Shape, Stroke, Text, WHITE, Weight};
use super::style::Style;
use super::{Panel, Series};

const LINE: f64 = 19.0;
const PADDING: f64 = 7.0;
const SAMPLE: f64 = 28.0;
const GAP: f64 = 8.0;
/// Distance of a legend inside a plot from its frame, and from the data.
const INSET: f64 = 6.0;
const CLEARANCE: f64 = 3.0;

/// The entries of a legend.
pub(super) struct Entries<'a> {
    entries: Vec<(&'a str, Style)>,
    /// Width of the legend with its entries below each other.
    pub width: f64,
}

impl<'a> Entries<'a> {
    /// The entries of `panel`: its series with a label and at least one point to draw, each label and style once.
    pub fn new(panel: &'a Panel, fonts: &Fonts) -> Self {
        let mut entries: Vec<(&str, Style)> = Vec::new();
        let named = |series: &'a Series| series.label.as_deref().map(|label| (label, series.style));
        for entry in panel
            .series
            .iter()
            .filter(|series| series.points.iter().any(|(x, y)| !x.is_nan() && !y.is_nan()))
            .filter_map(named)
        {
            if !entries.contains(&entry) {
                entries.push(entry);
            }
        }
        let widths = entries.iter().map(|(label, _)| fonts.width(label, TICK_SIZE, Weight::Regular));
        Self { width: 2.0 * PADDING + SAMPLE + GAP + widths.fold(0.0, f64::max), entries }
    }

    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Number of entries that fit side by side into this width, at least one.
    pub fn columns(&self, room: f64) -> usize {
        (libm::floor(room / self.width) as usize).clamp(1, self.entries.len().max(1))
    }

    /// Width and height of the legend with so many entries side by side.
    pub fn size(&self, columns: usize) -> [f64; 2] {
        let rows = self.entries.len().div_ceil(columns);
        [self.width * columns as f64, 2.0 * PADDING + LINE * rows as f64]
    }

    /// Draws the legend with its upper left corner at `corner`, and so many entries side by side.
    pub fn draw(&self, shapes: &mut Vec<Shape>, corner: Point, columns: usize) {
        let [left, top] = corner;
        let area = self.area(corner, columns);
        shapes.push(Shape::Rect { area, fill: WHITE });
        shapes.push(Shape::Lines { runs: vec![area.outline()], stroke: GRID });
        for (index, (label, style)) in self.entries.iter().enumerate() {
            let left = left + self.width * (index % columns) as f64;
            let y = top + PADDING + LINE * ((index / columns) as f64 + 0.5);
            shapes.extend(sample(*style, left + PADDING, y));
            let at = [left + PADDING + SAMPLE + GAP, y + TICK_SIZE * CAP_HEIGHT / 2.0];
            shapes.push(Shape::Text(Text::new(at, *label, TICK_SIZE, Anchor::Start)));
        }
    }

    /// The area it covers with its upper left corner at `[left, top]`.
    pub fn area(&self, [left, top]: Point, columns: usize) -> Rect {
        let [width, height] = self.size(columns);
        Rect { left, top, right: left + width, bottom: top + height }
    }
}

/// A piece of the line, or one marker.
fn sample(style: Style, left: f64, y: f64) -> Option<Shape> {
    let middle = left + SAMPLE / 2.0;
    match style {
        Style::Line { color, width, dash } => {
            let stroke = Stroke { color: color.rgb(), width, dash };
            Some(Shape::Lines { runs: vec![vec![[left, y], [left + SAMPLE, y]]], stroke })
        }
        // A tile of the map may be as small as a pixel, so that the legend has one of its own size.
        Style::Tiles { color, .. } => {
            let area = Rect { left: middle - 6.0, top: y - 6.0, right: middle + 6.0, bottom: y + 6.0 };
            Some(Shape::Rect { area, fill: color.rgb() })
        }
        Style::Markers { .. } => markers(style, vec![[middle, y]]),
    }
}

/// A place in `plot` where the legend covers no data: a corner, or the middle of a side.
pub(super) fn free_corner(
    panel: &Panel,
    entries: &Entries<'_>,
    plot: &Rect,
    x: &AxisMap,
    y: &AxisMap,
) -> Option<Point> {
    let left = plot.left + INSET;
    let top = plot.top + INSET;
    let right = plot.right - INSET - entries.width;
    let bottom = plot.bottom - INSET - entries.size(1)[1];
    // The legend is larger than the plot.
    if right < left || bottom < top {
        return None;
    }
    let middle_x = (left + right) / 2.0;
    let middle_y = (top + bottom) / 2.0;
    let corners = [[right, top], [left, top], [right, bottom], [left, bottom]];
    let sides = [[middle_x, top], [right, middle_y], [left, middle_y], [middle_x, bottom]];
    let drawn: Vec<Drawn> = panel.series.iter().map(|series| Drawn::of(series, plot, x, y)).collect();
    // The upper right is the usual place; the sides are tried only if no corner is free.
    corners.into_iter().chain(sides).find(|corner| {
        let area = entries.area(*corner, 1).grown(CLEARANCE);
        !drawn.iter().any(|drawn| drawn.meets(&area))
    })
}

/// The visible part of a series.
enum Drawn {
    Runs(Vec<Vec<Point>>),
    Markers { at: Vec<Point>, size: f64 },
}

impl Drawn {
    fn of(series: &Series, plot: &Rect, x: &AxisMap, y: &AxisMap) -> Self {
        match series.style {
            Style::Line { .. } => Self::Runs(clip::runs(on_page(series, x, y), plot)),
            Style::Markers { size, .. } => {
                Self::Markers { at: on_page(series, x, y).filter(|point| plot.contains(*point)).collect(), size }
            }
            // Tiles are an area without free corners: their marks are as large as the largest of them.
            Style::Tiles { width, height, .. } => {
                let wide = (x.px(width) - x.px(0.0)).abs();
                let high = (y.px(height) - y.px(0.0)).abs();
                Self::Markers { at: on_page(series, x, y).collect(), size: wide.max(high) }
            }
        }
    }

    fn meets(&self, area: &Rect) -> bool {
        match self {
            Self::Runs(runs) => runs.iter().any(|run| clip::crosses(run, area)),
            Self::Markers { at, size } => at.iter().any(|point| area.grown(size / 2.0).contains(*point)),
        }
    }
}
