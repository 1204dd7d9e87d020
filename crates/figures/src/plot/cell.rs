//! A panel with its place on the page.

use super::Panel;
use super::axis::AxisMap;
use super::legend::Entries;
use super::scene::{Point, Rect};
use super::ticks::Ticks;

/// A panel before its plot has a place.
pub(super) struct Draft<'a> {
    pub panel: &'a Panel,
    pub row: usize,
    pub column: usize,
    pub x_range: (f64, f64),
    /// Whether the x axis is labelled below this panel, not below a lower one that shares it.
    pub writes_x: bool,
    pub y_ticks: Ticks,
    /// Width of their widest label.
    pub y_tick_width: f64,
    pub y_range: (f64, f64),
    /// The label of the y axis, in lines.
    pub y_label: Vec<String>,
    pub entries: Entries<'a>,
    pub legend_below: bool,
}

/// A panel and the positions of its parts.
pub(super) struct Cell<'a> {
    pub draft: Draft<'a>,
    pub plot: Rect,
    pub x: AxisMap,
    pub y: AxisMap,
    /// The place of the legend.
    pub legend_at: Option<LegendPlace>,
}

impl Cell<'_> {
    /// The area that the legend covers.
    pub fn legend_area(&self) -> Option<Rect> {
        self.legend_at.map(|place| self.draft.entries.area(place.corner, place.columns))
    }
}

/// The place of a legend.
#[derive(Clone, Copy)]
pub(super) struct LegendPlace {
    /// Its upper left corner.
    pub corner: Point,
    /// The number of entries side by side.
    pub columns: usize,
}
