//! The elements of a laid-out figure. Coordinates and lengths are in px of 1/96 inch, y downwards.

use super::style::{Dash, Marker};

/// A position: x to the right, y down.
pub(super) type Point = [f64; 2];
/// Red, green and blue, sRGB.
pub(super) type Rgb = [u8; 3];

pub(super) const BLACK: Rgb = [0, 0, 0];
pub(super) const WHITE: Rgb = [255, 255, 255];

/// A figure, laid out as shapes.
pub(super) struct Scene {
    pub width: f64,
    pub height: f64,
    /// The text alternative for readers who can't see the figure.
    pub title: String,
    /// In the order of drawing.
    pub shapes: Vec<Shape>,
}

/// An element to draw.
pub(super) enum Shape {
    Rect { area: Rect, fill: Rgb },
    Lines { runs: Vec<Vec<Point>>, stroke: Stroke },
    Markers { at: Vec<Point>, shape: Marker, size: f64, fill: Rgb, stroke: Stroke },
    Text(Text),
}

/// The pen of a line.
#[derive(Clone, Copy)]
pub(super) struct Stroke {
    pub color: Rgb,
    pub width: f64,
    pub dash: Dash,
}

/// A line of text.
pub(super) struct Text {
    /// The point on the baseline that `anchor` names.
    pub at: Point,
    pub text: String,
    /// Height of the em square.
    pub size: f64,
    pub weight: Weight,
    pub anchor: Anchor,
    pub direction: Direction,
    pub color: Rgb,
}

impl Text {
    /// A black text in the regular font, from left to right.
    pub fn new(at: Point, text: impl Into<String>, size: f64, anchor: Anchor) -> Self {
        let weight = Weight::Regular;
        let direction = Direction::Rightwards;
        Self { at, text: text.into(), size, weight, anchor, direction, color: BLACK }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Weight {
    Regular,
    Bold,
}

/// The point of the baseline that is at [`Text::at`].
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

#[derive(Clone, Copy)]
pub(super) enum Direction {
    Rightwards,
    Upwards,
}

/// A rectangle with sides along the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Rect {
    pub fn contains(&self, [x, y]: Point) -> bool {
        (self.left..=self.right).contains(&x) && (self.top..=self.bottom).contains(&y)
    }

    /// Says whether the interiors have a point in common.
    pub fn meets(&self, other: &Self) -> bool {
        let across = self.left < other.right && other.left < self.right;
        across && self.top < other.bottom && other.top < self.bottom
    }

    pub fn grown(&self, by: f64) -> Self {
        Self { left: self.left - by, top: self.top - by, right: self.right + by, bottom: self.bottom + by }
    }

    /// Its sides as a closed line.
    pub fn outline(&self) -> Vec<Point> {
        let Self { left, top, right, bottom } = *self;
        vec![[left, top], [right, top], [right, bottom], [left, bottom], [left, top]]
    }
}
