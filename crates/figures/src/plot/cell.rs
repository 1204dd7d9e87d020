//! A panel with its place on the page.

use super::Panel;
use super::axis::AxisMap;
use super::legend::Entries;
use super::scene::{Point, Rect};
use super::ticks::Ticks;

/// A panel and the positions of its parts.
pub(super) struct Cell<'a> {
    pub panel: &'a Panel,
    pub plot: Rect,
    pub x: AxisMap,
    pub y: AxisMap,
    pub y_ticks: Ticks,
    /// Width of its widest label.
    pub y_tick_width: f64,
    /// The label of the y axis, in lines.
    pub y_label: Vec<String>,
    /// Whether the x axis is labelled below this panel.
    pub writes_x: bool,
    pub entries: Entries<'a>,
    /// The place of the legend.
    pub legend_at: Option<LegendPlace>,
}

/// The place of a legend.
#[derive(Clone, Copy)]
pub(super) struct LegendPlace {
    /// Its upper left corner.
    pub corner: Point,
    /// The number of entries side by side.
    pub columns: usize,
}
