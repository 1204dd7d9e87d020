//! Lays out a figure as a scene.
//!
//! Widths first: the left margin of a column holds its widest tick labels, so that plots below each other line up. Then
//! heights, row by row; legends without a free corner are below their panel, so that panels of a row stay equal.

use super::axis::{self, AxisMap, Coordinate};
use super::cell::{Cell, Draft, LegendPlace};
use super::error::PlotError;
use super::font::Fonts;
use super::legend::{self, Entries};
use super::marks::{LABEL_SIZE, TICK_LENGTH, TICK_SIZE};
use super::panel;
use super::scene::{Anchor, BLACK, Point, Rect, Rgb, Scene, Shape, Text, WHITE, Weight};
use super::ticks;
use super::{Figure, Legend, Panel};

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

/// Room between a legend and what is above it.
const LEGEND_GAP: f64 = 6.0;

/// The figure, laid out.
pub(super) fn scene(figure: &Figure) -> Result<Scene, PlotError> {
    let fonts = Fonts::embedded()?;
    let mut drafts = drafts(figure, &fonts)?;
    let width = if figure.columns == 1 { WIDTH_ALONE } else { WIDTH_OF_COLUMN * figure.columns as f64 };
    let (heading, top) = heading(figure, &fonts, width);
    // A legend below its panel makes the row taller, and with it the plots move. Legends only move down, so the loop
    // ends.
    let (plots, height) = loop {
        let (plots, height) = plot_areas(figure, &drafts, top, width);
        if !move_legends_below(&mut drafts, &plots) {
            break (plots, height);
        }
    };
    let area = Rect { left: 0.0, top: 0.0, right: width, bottom: height };
    // Without a ground the figure would take the colour of the page on which it is shown.
    let mut shapes = vec![Shape::Rect { area, fill: WHITE }];
    shapes.extend(heading);
    let page = Page { width, height };
    for (draft, plot) in drafts.into_iter().zip(plots) {
        panel::draw(&mut shapes, &fonts, cell(draft, plot, page));
    }
    Ok(Scene { width, height, title: figure.title.clone(), shapes })
}

fn drafts<'a>(figure: &'a Figure, fonts: &Fonts) -> Result<Vec<Draft<'a>>, PlotError> {
    let columns = figure.columns;
    let count = figure.panels.len();
    if count == 0 || columns == 0 {
        return Err(PlotError::NoPanels { title: figure.title.clone(), panels: count, columns });
    }
    for (index, panel) in figure.panels.iter().enumerate() {
        axis::check(&figure.title, index, panel)?;
    }
    let draft = |(index, panel): (usize, &'a Panel)| {
        let sharing = sharing_x(figure, index);
        let y_range = axis::range(Coordinate::Y, &[panel])?;
        // The margin depends on the tick labels, and these on the height of the plot, which is fixed.
        let height = plot_height(figure);
        let map = AxisMap { scale: panel.y.scale, low: y_range.0, high: y_range.1, from: height, to: 0.0 };
        // Labels of a y axis are above each other, so each needs its height, whatever its text.
        let y_ticks = ticks::of_axis(&panel.y, &map, &|_| TICK_SIZE * 2.4);
        let widths = y_ticks.labelled.iter().map(|(_, label)| fonts.width(label, TICK_SIZE, Weight::Regular));
        Ok(Draft {
            panel,
            row: index / columns,
            column: index % columns,
            x_range: axis::range(Coordinate::X, &sharing.iter().map(|i| &figure.panels[*i]).collect::<Vec<_>>())?,
            // The lowest of the panels that share an axis writes it.
            writes_x: sharing.last() == Some(&index),
            y_tick_width: widths.fold(0.0, f64::max),
            y_ticks,
            y_range,
            y_label: fonts.wrap(&panel.y.label, LABEL_SIZE, Weight::Regular, height),
            entries: Entries::new(panel, fonts),
            legend_below: panel.legend == Legend::Below,
        })
    };
    figure.panels.iter().enumerate().map(draft).collect()
}

/// The panels that share the x axis of panel `index`, itself included: its neighbours above and below with an equal
/// axis.
fn sharing_x(figure: &Figure, index: usize) -> Vec<usize> {
    // Panels are numbered row by row, so those of a column are as far apart as there are columns.
    let column: Vec<usize> = (index % figure.columns..figure.panels.len()).step_by(figure.columns).collect();
    let groups = column.chunk_by(|a, b| figure.panels[*a].x == figure.panels[*b].x);
    groups.into_iter().find(|group| group.contains(&index)).unwrap_or_default().to_vec()
}

fn plot_height(figure: &Figure) -> f64 {
    match (figure.panels.len().div_ceil(figure.columns), figure.columns) {
        (1, 1) => 380.0,
        (2, 1) => 240.0,
        (1 | 2, _) => 230.0,
        (3..=5, _) => 190.0,
        _ => 120.0,
    }
}

/// Title, in as many lines as needed, and subtitle, in one, and the y at which the rest begins.
fn heading(figure: &Figure, fonts: &Fonts, width: f64) -> (Vec<Shape>, f64) {
    if !figure.is_titled {
        return (Vec::new(), EDGE);
    }
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
            let text = Text::new([width / 2.0, y], line, size, Anchor::Middle);
            shapes.push(Shape::Text(Text { weight, color, ..text }));
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
            let right = (draft.column + 1) as f64 * column_width - 1.5 * EDGE;
            plots.push(Rect { left, top: plot_top, right, bottom: plot_bottom });
        }
        let row_plots = &plots[plots.len() - row.len()..];
        let below = row.iter().zip(row_plots).map(|(draft, plot)| x_room(draft) + legend_height(draft, plot));
        y = plot_bottom + below.fold(0.0, f64::max);
    }
    let bottom = drafts.iter().filter(|draft| draft.panel.legend == Legend::Bottom && !draft.entries.is_empty());
    let bottom = bottom.map(|draft| LEGEND_GAP + draft.entries.size(draft.entries.columns(width - 2.0 * EDGE))[1]);
    (plots, y + bottom.fold(0.0, f64::max) + EDGE / 2.0)
}

/// Room for the labels of the x axis.
fn x_room(draft: &Draft<'_>) -> f64 {
    if draft.writes_x { X_TICK_LABELS + X_LABEL } else { X_SHARED }
}

/// Room for a legend below the panel.
fn legend_height(draft: &Draft<'_>, plot: &Rect) -> f64 {
    if !draft.legend_below || draft.entries.is_empty() {
        return 0.0;
    }
    draft.entries.size(draft.entries.columns(plot.right - plot.left))[1] + LEGEND_GAP
}

fn above(draft: &Draft<'_>) -> f64 {
    let title = if draft.panel.title.is_some() { PANEL_TITLE } else { 0.0 };
    let factor = if draft.y_ticks.factor.is_some() { FACTOR } else { 0.0 };
    title + factor + TICK_SIZE / 2.0
}

fn left_of(draft: &Draft<'_>) -> f64 {
    draft.y_tick_width + TICK_LENGTH + 12.0 + draft.y_label.len() as f64 * LABEL_SIZE * LEADING
}

/// Moves legends without a free corner below their panel. Returns whether there are more of them than before.
fn move_legends_below(drafts: &mut [Draft<'_>], plots: &[Rect]) -> bool {
    let mut moved = false;
    for (draft, plot) in drafts.iter_mut().zip(plots) {
        let searched = draft.panel.legend == Legend::Auto && !draft.legend_below && !draft.entries.is_empty();
        if searched && free_corner(draft, plot).is_none() {
            draft.legend_below = true;
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
    let x = draft.x_range;
    let y = draft.y_range;
    [
        AxisMap { scale: draft.panel.x.scale, low: x.0, high: x.1, from: plot.left, to: plot.right },
        AxisMap { scale: draft.panel.y.scale, low: y.0, high: y.1, from: plot.bottom, to: plot.top },
    ]
}

/// The size of the figure.
#[derive(Clone, Copy)]
struct Page {
    width: f64,
    height: f64,
}

fn cell(draft: Draft<'_>, plot: Rect, page: Page) -> Cell<'_> {
    let entries = &draft.entries;
    // In the middle of a stretch of the page, with its upper edge at `top`.
    let centred = |left: f64, right: f64, top: f64| {
        let columns = entries.columns(right - left);
        let corner = (left + right - entries.size(columns)[0]) / 2.0;
        LegendPlace { corner: [corner.max(EDGE / 2.0), top], columns }
    };
    let legend_at = match draft.panel.legend {
        _ if entries.is_empty() => None,
        Legend::None => None,
        Legend::Bottom => {
            let height = entries.size(entries.columns(page.width - 2.0 * EDGE))[1];
            Some(centred(EDGE, page.width - EDGE, page.height - EDGE / 2.0 - height))
        }
        _ if draft.legend_below => Some(centred(plot.left, plot.right, plot.bottom + x_room(&draft) + LEGEND_GAP)),
        _ => free_corner(&draft, &plot).map(|corner| LegendPlace { corner, columns: 1 }),
    };
    let [x, y] = maps(&draft, &plot);
    Cell { draft, plot, x, y, legend_at }
}
