//! Lays out a figure as a scene.
//!
//! Widths first: the left margin of a column holds its widest tick labels, so that plots below each other line up; the
//! right one holds legends without a free corner. Then heights, row by row.

use super::axis::{self, AxisMap, Coordinate};
use super::cell::Cell;
use super::font::Fonts;
use super::legend::{self, Entries};
use super::marks::{LABEL_SIZE, TICK_LENGTH, TICK_SIZE};
use super::panel;
use super::scene::{Anchor, BLACK, Direction, Point, Rect, Rgb, Scene, Shape, Text, WHITE, Weight};
use super::ticks::{self, Ticks};
use super::{Figure, Legend, Panel, PlotError};

const WIDTH_ALONE: f64 = 720.0;
const WIDTH_OF_COLUMN: f64 = 400.0;
const EDGE: f64 = 14.0;
const TITLE_SIZE: f64 = 17.0;
const SUBTITLE_SIZE: f64 = 13.0;
const SUBTITLE_COLOR: Rgb = [0x50, 0x50, 0x50];
const LEADING: f64 = 1.3;
/// Room above a plot for a panel's title, and for the power of ten of its y axis.
const PANEL_TITLE: f64 = 22.0;
const FACTOR: f64 = 18.0;
/// Room below a plot for tick labels, and for the axis label; and the room left if the panel below has them.
const X_TICK_LABELS: f64 = 22.0;
const X_LABEL: f64 = 24.0;
const X_SHARED: f64 = 12.0;

/// A panel before its plot has a place.
struct Draft<'a> {
    panel: &'a Panel,
    row: usize,
    column: usize,
    x_range: (f64, f64),
    /// Whether the x axis is labelled below this panel, not below a lower one that shares it.
    writes_x: bool,
    y_ticks: Ticks,
    y_tick_width: f64,
    y_range: (f64, f64),
    y_label: Vec<String>,
    entries: Entries<'a>,
    legend_outside: bool,
}

/// The figure, laid out.
pub(super) fn scene(figure: &Figure) -> Result<Scene, PlotError> {
    let fonts = Fonts::embedded()?;
    let mut drafts = drafts(figure, &fonts)?;
    let width = if figure.columns == 1 { WIDTH_ALONE } else { WIDTH_OF_COLUMN * figure.columns as f64 };
    let (heading, top) = heading(figure, &fonts, width);
    let (plots, height) = loop {
        let (plots, height) = plot_areas(figure, &drafts, top, width);
        if !move_legends_outside(&mut drafts, &plots) {
            break (plots, height);
        }
    };
    let area = Rect { left: 0.0, top: 0.0, right: width, bottom: height };
    let mut shapes = vec![Shape::Rect { area, fill: WHITE }];
    shapes.extend(heading);
    for (draft, plot) in drafts.into_iter().zip(plots) {
        panel::draw(&mut shapes, &fonts, cell(draft, plot));
    }
    Ok(Scene { width, height, title: figure.title.clone(), shapes })
}

fn drafts<'a>(figure: &'a Figure, fonts: &Fonts) -> Result<Vec<Draft<'a>>, PlotError> {
    let (columns, count) = (figure.columns, figure.panels.len());
    if count == 0 || columns == 0 {
        return Err(PlotError::NoPanels { title: figure.title.clone(), panels: count, columns });
    }
    for (index, panel) in figure.panels.iter().enumerate() {
        axis::check(&figure.title, index, panel)?;
    }
    let draft = |(index, panel): (usize, &'a Panel)| {
        let sharing = sharing_x(figure, index);
        let y_range = axis::range(Coordinate::Y, &[panel])?;
        let height = plot_height(figure);
        let map = AxisMap { scale: panel.y.scale, low: y_range.0, high: y_range.1, from: height, to: 0.0 };
        let y_ticks = ticks::ticks(&map, &|_| TICK_SIZE * 2.4);
        let widths = y_ticks.labelled.iter().map(|(_, label)| fonts.width(label, TICK_SIZE, Weight::Regular));
        Ok(Draft {
            panel,
            row: index / columns,
            column: index % columns,
            x_range: axis::range(Coordinate::X, &sharing.iter().map(|i| &figure.panels[*i]).collect::<Vec<_>>())?,
            writes_x: sharing.last() == Some(&index),
            y_tick_width: widths.fold(0.0, f64::max),
            y_ticks,
            y_range,
            y_label: fonts.wrap(&panel.y.label, LABEL_SIZE, Weight::Regular, height),
            entries: Entries::new(panel, fonts),
            legend_outside: panel.legend == Legend::Outside,
        })
    };
    figure.panels.iter().enumerate().map(draft).collect()
}

/// The panels that share the x axis of panel `index`, itself included: its neighbours above and below with an equal
/// axis.
fn sharing_x(figure: &Figure, index: usize) -> Vec<usize> {
    let column: Vec<usize> = (index % figure.columns..figure.panels.len()).step_by(figure.columns).collect();
    let groups = column.chunk_by(|a, b| figure.panels[*a].x == figure.panels[*b].x);
    groups.into_iter().find(|group| group.contains(&index)).unwrap_or_default().to_vec()
}

fn plot_height(figure: &Figure) -> f64 {
    match (figure.panels.len().div_ceil(figure.columns), figure.columns) {
        (1, 1) => 380.0,
        (2, 1) => 240.0,
        (1 | 2, _) => 230.0,
        _ => 190.0,
    }
}

/// Title, in as many lines as needed, and subtitle, in one, and the y at which the rest begins.
fn heading(figure: &Figure, fonts: &Fonts, width: f64) -> (Vec<Shape>, f64) {
    let room = width - 2.0 * EDGE;
    let title = fonts.wrap(&figure.title, TITLE_SIZE, Weight::Bold, room);
    let subtitle = Some(figure.subtitle.fitting(fonts, SUBTITLE_SIZE, room)).filter(|line| !line.is_empty());
    let mut shapes = Vec::new();
    let mut y = EDGE;
    for (lines, size, weight, color) in [
        (title, TITLE_SIZE, Weight::Bold, BLACK),
        (subtitle.into_iter().collect(), SUBTITLE_SIZE, Weight::Regular, SUBTITLE_COLOR),
    ] {
        for line in lines {
            y += size;
            shapes.push(Shape::Text(Text {
                at: [width / 2.0, y],
                text: line,
                size,
                weight,
                anchor: Anchor::Middle,
                direction: Direction::Rightwards,
                color,
            }));
            y += size * (LEADING - 1.0);
        }
    }
    (shapes, y + EDGE / 2.0)
}

/// The area of each plot, and the height of the figure.
fn plot_areas(figure: &Figure, drafts: &[Draft<'_>], top: f64, width: f64) -> (Vec<Rect>, f64) {
    let column_width = width / figure.columns as f64;
    let of_column = |column: usize, length: &dyn Fn(&Draft<'_>) -> f64| {
        drafts.iter().filter(|draft| draft.column == column).map(length).fold(0.0, f64::max)
    };
    let mut plots = Vec::new();
    let mut y = top;
    for row in drafts.chunk_by(|a, b| a.row == b.row) {
        let of_row = |needed: &dyn Fn(&Draft<'_>) -> f64| row.iter().map(needed).fold(0.0, f64::max);
        let plot_top = y + of_row(&above);
        let plot_bottom = plot_top + plot_height(figure);
        for draft in row {
            let left = draft.column as f64 * column_width + EDGE + of_column(draft.column, &left_of);
            let right = (draft.column + 1) as f64 * column_width - EDGE - of_column(draft.column, &right_of);
            plots.push(Rect { left, top: plot_top, right, bottom: plot_bottom });
        }
        y = plot_bottom + of_row(&|draft| if draft.writes_x { X_TICK_LABELS + X_LABEL } else { X_SHARED });
    }
    (plots, y + EDGE / 2.0)
}

fn above(draft: &Draft<'_>) -> f64 {
    let title = if draft.panel.title.is_some() { PANEL_TITLE } else { 0.0 };
    let factor = if draft.y_ticks.factor.is_some() { FACTOR } else { 0.0 };
    title + factor + TICK_SIZE / 2.0
}

fn left_of(draft: &Draft<'_>) -> f64 {
    draft.y_tick_width + TICK_LENGTH + 12.0 + draft.y_label.len() as f64 * LABEL_SIZE * LEADING
}

fn right_of(draft: &Draft<'_>) -> f64 {
    if draft.legend_outside && !draft.entries.is_empty() { draft.entries.width() + EDGE } else { EDGE / 2.0 }
}

/// Moves legends without a free corner outside. Returns whether there are more of them than before.
fn move_legends_outside(drafts: &mut [Draft<'_>], plots: &[Rect]) -> bool {
    let mut moved = false;
    for (draft, plot) in drafts.iter_mut().zip(plots) {
        let searched = draft.panel.legend == Legend::Auto && !draft.legend_outside && !draft.entries.is_empty();
        if searched && free_corner(draft, plot).is_none() {
            draft.legend_outside = true;
            moved = true;
        }
    }
    moved
}

fn free_corner(draft: &Draft<'_>, plot: &Rect) -> Option<Point> {
    let [x, y] = maps(draft, plot);
    legend::free_corner(draft.panel, &draft.entries, plot, &x, &y)
}

fn maps(draft: &Draft<'_>, plot: &Rect) -> [AxisMap; 2] {
    let (x, y) = (draft.x_range, draft.y_range);
    [
        AxisMap { scale: draft.panel.x.scale, low: x.0, high: x.1, from: plot.left, to: plot.right },
        AxisMap { scale: draft.panel.y.scale, low: y.0, high: y.1, from: plot.bottom, to: plot.top },
    ]
}

fn cell(draft: Draft<'_>, plot: Rect) -> Cell<'_> {
    let legend_at = match draft.panel.legend {
        _ if draft.entries.is_empty() => None,
        Legend::None => None,
        _ if draft.legend_outside => Some([plot.right + EDGE, plot.top]),
        _ => free_corner(&draft, &plot),
    };
    let [x, y] = maps(&draft, &plot);
    Cell {
        panel: draft.panel,
        plot,
        x,
        y,
        y_ticks: draft.y_ticks,
        y_tick_width: draft.y_tick_width,
        y_label: draft.y_label,
        writes_x: draft.writes_x,
        entries: draft.entries,
        legend_at,
    }
}
