//! Places the notes of a panel: near their points, clear of the lines, the legend and each other.

use super::Note;
use super::cell::Cell;
use super::clip;
use super::font::{CAP_HEIGHT, Fonts};
use super::marks::on_page;
use super::scene::{Anchor, Point, Rect, Shape, Stroke, Text, Weight};
use super::style::{Dash, Style};

pub(super) const SIZE: f64 = 12.0;
/// Gap around the words.
pub(super) const GAP: f64 = 3.0;
/// Distance between the places tried to the sides; vertically it is the height of a line.
const STEP: f64 = 6.0;
const LINE: f64 = 13.0;
/// The number of places tried to either side, and of lines up and down.
const SIDEWAYS: i32 = 16;
const UP: i32 = 5;
const DOWN: i32 = -3;
/// Words farther than this from their point get a thin line to it.
const NEAR: f64 = 8.0;
pub(super) const LEADER: Stroke = Stroke { color: [0x80, 0x80, 0x80], width: 0.6, dash: Dash::Solid };

/// Draws the notes, each at the nearest place clear of the areas that are `taken`; if there is none, above its point.
pub(super) fn draw(shapes: &mut Vec<Shape>, fonts: &Fonts, cell: &Cell<'_>, mut taken: Vec<Rect>) {
    if cell.draft.panel.notes.is_empty() {
        return;
    }
    let lines: Vec<Vec<Point>> = cell
        .draft
        .panel
        .series
        .iter()
        .filter(|series| matches!(series.style, Style::Line { .. }))
        .flat_map(|series| clip::runs(on_page(series, &cell.x, &cell.y), &cell.plot))
        .collect();
    taken.extend(cell.legend_area());
    // One after the other, each clear of those before it.
    for note in &cell.draft.panel.notes {
        let at = [cell.x.px(note.at.0), cell.y.px(note.at.1)];
        if cell.plot.contains(at) {
            let area = free_area(at, fonts.width(&note.text, SIZE, Weight::Regular), &cell.plot, &lines, &taken);
            shapes.extend(leader(at, &area));
            shapes.push(words(note, &area));
            taken.push(area);
        }
    }
}

/// The free area nearest to a point, of this width.
fn free_area(at: Point, width: f64, plot: &Rect, lines: &[Vec<Point>], taken: &[Rect]) -> Rect {
    let above = |sideways: i32, up: i32| {
        let x = at[0] + f64::from(sideways) * STEP;
        let bottom = at[1] - GAP - f64::from(up) * LINE;
        Rect { left: x - width / 2.0, right: x + width / 2.0, top: bottom - SIZE * CAP_HEIGHT - GAP, bottom }
    };
    let mut places: Vec<(i32, i32)> =
        (DOWN..=UP).flat_map(|up| (-SIDEWAYS..=SIDEWAYS).map(move |sideways| (sideways, up))).collect();
    let distance = |(sideways, up): &(i32, i32)| {
        let dx = f64::from(*sideways) * STEP;
        let dy = f64::from(*up) * LINE;
        dx * dx + dy * dy
    };
    // The sort is stable, so places equally far keep one order, and the same figure gives the same bytes.
    places.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    let free = |area: &Rect| {
        let corners = [[area.left, area.top], [area.right, area.bottom]];
        corners.iter().all(|corner| plot.contains(*corner))
            && !taken.iter().any(|other| other.meets(&area.grown(GAP / 2.0)))
            && !lines.iter().any(|run| clip::crosses(run, area))
    };
    places.into_iter().map(|(sideways, up)| above(sideways, up)).find(free).unwrap_or(above(0, 0))
}

/// The line from words to their point, if they are far from it.
fn leader(at: Point, area: &Rect) -> Option<Shape> {
    let nearest = [at[0].clamp(area.left, area.right), at[1].clamp(area.top, area.bottom)];
    let far = libm::hypot(nearest[0] - at[0], nearest[1] - at[1]) > NEAR;
    far.then(|| Shape::Lines { runs: vec![vec![at, nearest]], stroke: LEADER })
}

pub(super) fn words(note: &Note, area: &Rect) -> Shape {
    let at = [(area.left + area.right) / 2.0, area.bottom - GAP / 2.0];
    Shape::Text(Text::new(at, &note.text, SIZE, Anchor::Middle))
}
